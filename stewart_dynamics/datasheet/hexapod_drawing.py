# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Drawings of the hexapod to scale: from the front, from above or below, and oblique.

It is drawn as it stands or hangs: up is opposite to gravity.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.mechanics.kinematics.home_pose import level_axes
from stewart_dynamics.parameters.table import Parameters, six_of
from stewart_dynamics.reporting.vector_picture import hull, Picture, ticks

# Radii of parts without a given one, relative to the hexapod's size, and the part of a retracted
# leg that its cylinder takes.
_CYLINDER, _PISTON, _OF_LEG = 0.028, 0.017, 0.62
_PLATE = 0.022  # half of a plate's thickness, relative to the size
# Plates through joints are larger than these; plates with an outline are drawn as given.
_RIM = 1.06
_TRIAD = 22.0  # length of an axis [px]
_VERTICAL = 0.9999  # cosine of the largest angle of an axis that counts as vertical
# Width of a digit and height of a line in a picture [px].
_DIGIT, _LINE = 6.6, 11.0
_ARROW = 0.8  # length of an arrow by the path of an anchor for a unit of its drive
# Axes that are shorter in a view, as parts of their length, are not drawn.
_SEEN = 0.72


class View(NamedTuple):
    """Directions, in axes whose third is up, that are to the right and upward in a drawing."""

    right: tuple[float, float, float]
    up: tuple[float, float, float]

    def of(self, points: Array) -> Array:
        """Return points (..., 3) in the drawing (..., 2) [m]."""
        drawn: Array = points @ np.array([self.right, self.up]).T
        return drawn

    def depth(self, points: Array) -> Array:
        """Return how near to the viewer points (..., 3) are [m]."""
        return points @ np.cross(self.right, self.up)


class Margins(NamedTuple):
    """Free room around a view [px]."""

    top: float = 32.0
    bottom: float = 46.0
    sides: float = 96.0  # left and right together
    left: float = 16.0


FRONT = View((1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
TOP, BOTTOM = View((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), View((1.0, 0.0, 0.0), (0.0, -1.0, 0.0))
_TURN, _TILT = np.radians(28.0), np.radians(20.0)
OBLIQUE = View(
    (np.cos(_TURN), np.sin(_TURN), 0.0),
    (-np.sin(_TURN) * np.sin(_TILT), np.cos(_TURN) * np.sin(_TILT), np.cos(_TILT)))


class Drawing:
    """
    Drawings of a hexapod at a pose.

    pose: pose that is drawn.
    ends: poses whose platforms are drawn as outlines.
    pivot: the platform turns about it, platform frame [m]; marked where it is not the origin.
    """

    def __init__(self, parameters: Parameters, pose: Pose, ends: tuple[Pose, ...] = (),
                 pivot: Array | None = None) -> None:
        self._p, self._poses = parameters, (pose, *ends)
        self._upright = upright(parameters.gravity)
        self._arms = np.asarray(parameters.geometry.platform_joints)
        self._base = np.asarray(parameters.geometry.base_joints) @ self._upright.T
        self._platform = self._placed(pose, self._arms)
        lines = parameters.leg_kind.lines(parameters, pose.position, pose.rotation)
        # the begin of each line of force, where drives move it, and its path by a unit of theirs
        self._anchors: Array | None = None
        self._tangents: Array | None = None
        if lines.path is not None:
            self._anchors = self._platform - (
                lines.lengths[:, None] * lines.directions @ self._upright.T)
            self._tangents = lines.path.tangents @ self._upright.T
        self._pivot: Array = np.empty((0, 3))
        if pivot is not None and np.any(pivot):
            self._pivot = self._placed(pose, pivot[None])
        everything = np.concatenate([self._base, self._platform])
        self._size = float(np.linalg.norm(np.ptp(everything, axis=0))) / 2.0
        base = parameters.geometry.base_outline
        self._base_plate = (self._plate(self._base) if base is None else base @ self._upright.T)
        below = self._platform[:, 2].mean() < self._base[:, 2].mean() - _PLATE * self._size
        self._plan = BOTTOM if below else TOP

    def front(self) -> Picture:
        """Return the front view, with heights along z where that is vertical."""
        picture = Picture(340.0, 360.0, 'Front view of the hexapod, to scale')
        place = self._fitted(FRONT, picture, (FRONT, TOP), Margins(bottom=58.0))
        for end in self._poses[1:]:
            picture.path(hull(place(FRONT.of(self._moving_plate(end)))), closed=True, css='ghost')
        self._draw(picture, FRONT, place)
        self._mark_pivot(picture, FRONT, place)
        if abs(self._upright[2, 2]) > _VERTICAL:
            self._heights(picture, place)
        picture.text([8, 18], 'Front view', css='view')
        self._axes(picture, FRONT)
        return picture

    def top(self) -> Picture:
        """Return the view from the platform's side, with the numbers of the legs."""
        name = 'View from below' if self._plan is BOTTOM else 'Top view'
        picture = Picture(340.0, 360.0, f'{name} of the hexapod, to scale')
        place = self._fitted(self._plan, picture, (FRONT, TOP), Margins(left=48.0))
        for joints in (self._base, self._platform):
            diameter = circle_of(joints)
            if diameter is not None:
                center = joints.mean(axis=0)
                around = np.linspace(0.0, 2.0 * np.pi, 73)[:-1]
                circle = np.stack([np.cos(around), np.sin(around)], axis=1) @ level_axes(
                    joints - center)[:2]
                picture.path(place(self._plan.of(center + diameter / 2.0 * circle)), closed=True,
                             css='pitch')
        self._draw(picture, self._plan, place)
        self._mark_pivot(picture, self._plan, place)
        center = place(self._plan.of(self._base.mean(axis=0)))
        for n, joint in enumerate(place(self._plan.of(self._base))):
            out = joint - center
            at = joint + 16.0 * out / max(float(np.linalg.norm(out)), 1e-9)
            picture.text(at + [0, 4], str(n + 1), 'middle', css=f'number leg{n}')
        picture.text([8, 18], name, css='view')
        self._axes(picture, self._plan)
        self._scale_bar(picture, place)
        return picture

    def oblique(self) -> Picture:
        """Return an oblique view without dimensions; with signs where drives move anchors."""
        picture, moving = Picture(300.0, 240.0, 'The hexapod'), self._anchors is not None
        place = self._fitted(OBLIQUE, picture, (OBLIQUE,), Margins(
            6.0, 26.0, 52.0, 26.0) if moving else Margins(6.0, 6.0, 12.0, 6.0))
        self._draw(picture, OBLIQUE, place)
        if self._anchors is not None and self._tangents is not None:
            self._signs(picture, place, self._anchors, self._tangents)
        return picture

    def _signs(self, picture: Picture, place: _Place, anchors: Array, tangents: Array) -> None:
        """Draw arrows along which anchors move with positive rates, and numbers of the legs."""
        begins, joints = place(OBLIQUE.of(anchors)), place(OBLIQUE.of(self._base))
        ends = place(OBLIQUE.of(anchors + _ARROW * tangents))
        for n, (begin, end, joint) in enumerate(zip(begins, ends, joints, strict=True)):
            along = end - begin
            length = max(float(np.linalg.norm(along)), 1e-9)
            along = along / length
            across = np.array([-along[1], along[0]])
            picture.line(begin, end, css=f'turn leg{n}')
            picture.path([end + 4.0 * along, end - 3.0 * along + 3.0 * across,
                          end - 3.0 * along - 3.0 * across], closed=True, css=f'turn tip leg{n}')
            away = joint - begin
            away = away / max(float(np.linalg.norm(away)), 1e-9)
            picture.text(joint + 11.0 * away + [0.0, 4.0], str(n + 1), 'middle',
                         css=f'number halo leg{n}')
        name = self._p.leg_kind.position.field
        picture.text([150.0, 234.0], f'arrows: positive {name}', 'middle', css='tick')

    def _placed(self, pose: Pose, arms: Array) -> Array:
        """Return where points (N, 3) of the platform frame are, upright [m]."""
        placed: Array = (pose.position + arms @ pose.rotation.T) @ self._upright.T
        return placed

    def _moving_plate(self, pose: Pose) -> Array:
        """Return the corners of the platform's plate at a pose."""
        outline = self._p.geometry.platform_outline
        return (self._plate(self._placed(pose, self._arms)) if outline is None
                else self._placed(pose, outline))

    def _fitted(self, view: View, picture: Picture, views: Sequence[View], margins: Margins,
                ) -> _Place:
        """Return the place of a view, at the largest scale at which some views fit."""
        points = np.concatenate([
            self._base, *([] if self._anchors is None else [self._anchors]), self._base_plate,
            self._platform, self._pivot, *map(self._moving_plate, self._poses)])
        room = np.array([picture.width - margins.sides, picture.height - margins.top
                         - margins.bottom])
        spans = [np.ptp(each.of(points), axis=0) + _PLATE * self._size for each in views]
        scale = float(np.min(room / np.array(spans)))
        drawn = view.of(points)
        middle = np.array([(picture.width - margins.sides) / 2.0 + margins.left,
                           margins.top + room[1] / 2.0])
        return _Place((drawn.min(axis=0) + drawn.max(axis=0)) / 2.0, scale, middle)

    def _draw(self, picture: Picture, view: View, place: _Place) -> None:
        p = self._p
        legs = [(float(view.depth((self._base[n] + self._platform[n]) / 2.0)), n)
                for n in range(6)]
        plates = [(float(view.depth(plate.mean(axis=0))), plate, css) for plate, css in (
            (self._base_plate, 'plate base'),
            (self._moving_plate(self._poses[0]), 'plate moving'))]
        plates.sort(key=lambda each: each[0])
        for _, points, css in plates[:1]:
            picture.path(hull(place(view.of(points))), closed=True, css=css)
        radii = (six_of(p.legs.cylinder.radius, _CYLINDER * self._size),
                 six_of(p.legs.piston.radius, _PISTON * self._size))
        shortest = p.limits.length_min
        for _, n in sorted(legs):
            begin, end = self._base[n], self._platform[n]
            length = float(np.linalg.norm(end - begin))
            retracted = length if shortest is None else float(shortest[n])
            cylinder = begin + (end - begin) * min(_OF_LEG * retracted / length, 1.0)
            middle = cylinder if self._anchors is None else self._anchors[n]
            a, b, c = place(view.of(np.array([begin, middle, end])))
            picture.line(a if self._anchors is None else b, c, css=f'piston leg{n}',
                         stroke_width=max(2.0 * radii[1][n] * place.scale, 1.5))
            picture.line(a, b, css=f'cylinder leg{n}', stroke_width=max(
                2.0 * radii[0][n] * place.scale, 3.0))
            for joint in (a, c) if self._anchors is None else (a, b, c):
                picture.circle(joint, 2.6, css='joint')
        for _, points, css in plates[1:]:
            picture.path(hull(place(view.of(points))), closed=True, css=css)

    def _plate(self, joints: Array) -> Array:
        """Return corners of a plate through joints, a little larger than they are."""
        arms = joints - joints.mean(axis=0)
        wide = joints.mean(axis=0) + _RIM * arms
        normal = level_axes(arms)[2] * _PLATE * self._size
        return np.concatenate([wide - normal, wide + normal])

    def _mark_pivot(self, picture: Picture, view: View, place: _Place) -> None:
        for at in place(view.of(self._pivot)):
            picture.circle(at, 4.0, css='pivot')
            for way in np.array([[7.0, 0.0], [0.0, 7.0]]):
                picture.line(at - way, at + way, css='pivot')
            left = float(at[0]) + 44.0 > picture.width
            picture.text(at + [-10.0 if left else 10.0, -6.0], 'pivot',
                         'end' if left else 'start', css='tick halo')

    def _heights(self, picture: Picture, place: _Place) -> None:
        """Draw z of the platform's origin, at the pose and its ends, from parts that are drawn."""
        texts = [f'{1e3 * float(pose.position[2]):.0f}'.replace('-', '−')
                 for pose in self._poses]
        right = picture.width - 14.0 - _DIGIT * max(map(len, texts))
        zero = float(place(FRONT.of(np.zeros(3)))[1])
        base = place(FRONT.of(self._base_plate))
        low, high = 4.0, picture.height - 4.0
        heights: list[float] = []
        for n, (pose, text) in enumerate(zip(self._poses, texts, strict=True)):
            origin = place(FRONT.of(self._upright @ pose.position))
            height = float(origin[1])
            if not low < height < high or any(abs(height - each) < _LINE for each in heights):
                continue
            heights.append(height)
            plate = place(FRONT.of(self._moving_plate(pose)))
            on_plate = plate[:, 1].min() - 2.0 <= height <= plate[:, 1].max() + 2.0
            begin = float(plate[:, 0].max()) + 5.0 if on_plate else float(origin[0])
            if not on_plate:
                picture.circle(origin, 1.8, css='origin')
            picture.line([begin, height], [right + 8.0, height], css='extension')
            if n == 0 and low < zero < high and abs(zero - height) > _LINE:
                picture.line([float(base[:, 0].max()) + 5.0, zero], [right + 8.0, zero],
                             css='extension')
                _dimension(picture, [right, zero], [right, height])
                if abs(zero - height) > _DIGIT * len(text) + 24.0:
                    picture.text([right - 4.0, (zero + height) / 2.0], text, 'middle', 90.0,
                                 css='dimension halo')
                    continue
            picture.text([right + 11.0, height + 4.0], text,
                         css='dimension' if n == 0 else 'dimension soft')

    def _axes(self, picture: Picture, view: View) -> None:
        """Draw the base axes in the lower left corner, as far as they are seen."""
        tips = _TRIAD * view.of(self._upright.T) * [1.0, -1.0]
        (left, _), (_, low) = tips.min(axis=0), tips.max(axis=0)
        origin = np.array([30.0 - min(left, 0.0), picture.height - 22.0 - max(low, 0.0)])
        for name, tip in zip('XYZ', tips, strict=True):
            length = float(np.linalg.norm(tip))
            if length > _SEEN * _TRIAD:
                picture.line(origin, origin + tip, css=f'triad axis-{name.lower()}')
                picture.text(origin + tip * (1.0 + 9.0 / length) + [0.0, 3.5], name, 'middle',
                             css='tick')

    def _scale_bar(self, picture: Picture, place: _Place) -> None:
        length = ticks(0.0, 110.0 / place.scale, 2)[1]
        right, y = picture.width - 14.0, picture.height - 18.0
        picture.path([[right - length * place.scale, y - 4.0], [right - length * place.scale, y],
                      [right, y], [right, y - 4.0]], css='bar')
        picture.text([right, y + 13.0], f'{1e3 * length:.10g} mm', 'end', css='tick')


class _Place:
    """From meters in a view to pixels in a picture."""

    def __init__(self, center: Array, scale: float, middle: Array) -> None:
        self._center, self.scale, self._middle = center, scale, middle

    def __call__(self, points: Array) -> Array:
        placed: Array = self._middle + (points - self._center) * self.scale * [1.0, -1.0]
        return placed


def upright(gravity: Array) -> Array:
    """Return the axes (3, 3), base frame, row by row, whose third is opposite to gravity."""
    weight = float(np.linalg.norm(gravity))
    up = -np.asarray(gravity) / weight if weight else np.array([0.0, 0.0, 1.0])
    # To the right is x or, on a wall, z: a front view from behind the base would show only that.
    right = np.eye(3)[0 if abs(up[2]) > 0.5 else 2]
    right = right - right @ up * up
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(up, right), up])


def circle_of(joints: Array) -> float | None:
    """Return the diameter [m] of the circle around the joints' center that they are on, if any."""
    radii = np.linalg.norm(joints - joints.mean(axis=0), axis=1)
    mean = float(radii.mean())
    return 2.0 * mean if float(np.ptp(radii)) < 0.01 * mean else None


def _dimension(picture: Picture, begin: list[float], end: list[float]) -> None:
    """Draw a line with arrows at both ends."""
    a, b = np.array(begin), np.array(end)
    picture.line(a, b, css='measure')
    along = (b - a) / max(float(np.linalg.norm(b - a)), 1e-9)
    across = np.array([-along[1], along[0]])
    for tip, way in ((a, along), (b, -along)):
        picture.path([tip, tip + 7.0 * way + 2.0 * across, tip + 7.0 * way - 2.0 * across],
                     closed=True, css='arrow')
