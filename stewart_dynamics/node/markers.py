# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The markers of an answer for RViz and Foxglove: base, platform and legs coloured by force.

They are one visualization_msgs/MarkerArray in bytes (CDR), made once for a set of parameters; for
an answer only stamp, poses, lengths, colours and the text are written into it.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from struct import pack, Struct

import numpy as np
from stewart_dynamics.arrays import Array, SECOND
from stewart_dynamics.description.hexapod import Color, COLORS
from stewart_dynamics.legs.tree import BALL, PLATE
from stewart_dynamics.mechanics.frames.rotation import quaternion_of
from stewart_dynamics.mechanics.kinematics.home_pose import level_axes
from stewart_dynamics.mechanics.limits import Exceedance
from stewart_dynamics.messages.cdr import LITTLE_ENDIAN
from stewart_dynamics.node.diagnostics.answers import singularity_state
from stewart_dynamics.node.diagnostics.levels import ERROR, OK, WARN
from stewart_dynamics.parameters.table import (
    mean_radius, Parameters)
from stewart_dynamics.setpoints.step import Batch, Outputs
from visualization_msgs.msg import Marker


# Okabe and Ito's blue, vermillion and yellow, distinct for the colour-blind. A leg without load is
# nearly white: the darker a leg, the larger its force, whether it pushes or pulls.
PUSH: Color = (0.835, 0.369, 0.0, 1.0)
PULL: Color = (0.0, 0.447, 0.698, 1.0)
NO_LOAD: Color = (0.95, 0.95, 0.95, 1.0)
NO_FORCE: Color = (0.4, 0.4, 0.4, 1.0)
PLATFORM: dict[int, Color] = {
    OK: COLORS['platform'], WARN: (0.941, 0.894, 0.259, 1.0), ERROR: PUSH}
_CENTER_OF_MASS: Color = (0.8, 0.475, 0.655, 1.0)  # Okabe and Ito's reddish purple
_PAYLOAD: Color = (0.0, 0.62, 0.451, 1.0)  # and their bluish green
_WHITE: Color = (1.0, 1.0, 1.0, 1.0)
_AXES: list[Color] = [(0.9, 0.1, 0.1, 1.0), (0.1, 0.7, 0.1, 1.0), (0.1, 0.3, 0.9, 1.0)]

# Relative to the platform's size, as the sizes of the description.
_AXIS, _LINE = 1.2, 0.02
_HEAVY = 0.2  # the ball at the centre of mass
_TEXT_SIZE, _TEXT_ABOVE = 0.11, 1.4
_NAME_OUTSIDE = 0.15  # relative to the base's size

# Lifetime of markers [s]: setpoints sent by hand typically arrive once per second. At a lower
# visualization_rate it is two periods, at most one day: a Duration is limited to 68 years.
STAYS = 2.0
_LONGEST = 86400.0

_STAMP = Struct('<iI')
_POSE = Struct('<7d')
_POSE_AND_SCALE = Struct('<10d')
_COLOR = Struct('<4f')  # it follows the scale
_COUNT = Struct('<I')
# Two empty names, an empty file and a bool.
_BEHIND_TEXT = 8 + 8 + 5


class Markers:
    """
    Writes the markers of a hexapod.

    A leg consists of the cylinders of its kind, ``LegKind.solids``. Their colour goes from white
    to vermillion with an effort of the leg's drive of up to its limit, to blue with a negative
    one; where there is no such limit, of up to the largest of the six efforts. They are grey where
    no efforts are published. The platform is grey blue, yellow while the singularity
    warning is on, and vermillion inside ``singularity.stop_condition`` and at a crossing. A purple
    ball is the centre of mass of platform and payload, a green one that of the payload.

    parameters: geometry, centre of mass, limits, thresholds, names and ``visualization_rate``.
        Some of them may change while the node is active: other parameters need other ``Markers``.
    """

    # Sizes near the maximum of a double overflow: then nothing is answered or drawn.
    @np.errstate(all='ignore')
    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._names = parameters.joints
        geometry = parameters.geometry
        self._base, self._platform = geometry.base_joints, geometry.platform_joints
        self._kind = kind = parameters.leg_kind
        self._bounds: Array | None = parameters[kind.effort_limit]
        size = mean_radius(self._platform)
        self._diameters = np.repeat([2.0 * solid.radius * size for solid in kind.solids], 6)
        self._text_above = _TEXT_ABOVE * size
        self._frame = parameters.base_frame
        rate = parameters.visualization_rate
        self._stays = min(max(STAYS, 2.0 / rate if rate else 0.0), _LONGEST)

        ball, line = (2.0 * BALL * size,) * 3, (_LINE * size, 0.0, 0.0)
        text_size = 0.0, 0.0, _TEXT_SIZE * size
        thickness = PLATE * size
        axes = np.zeros((6, 3))
        axes[[1, 3, 5], [0, 1, 2]] = _AXIS * size
        self._stamps: list[int] = []
        self._body = bytearray(LITTLE_ENDIAN)
        self._put(4, 'I', 0)  # how many there are
        self._marker('base', 0, Marker.TRIANGLE_LIST, COLORS['base'], points=_plate(
            self._base if geometry.base_outline is None else geometry.base_outline, thickness))
        self._marker('base', 1, Marker.SPHERE_LIST, COLORS['joint'], ball, self._base)
        outside = self._base + _NAME_OUTSIDE * (self._base - self._base.mean(axis=0))
        for n, name in enumerate(self._names):
            self._marker('names', n, Marker.TEXT_VIEW_FACING, _WHITE, text_size,
                         position=outside[n], text=name)
        self._plate = self._marker('platform', 0, Marker.TRIANGLE_LIST, PLATFORM[OK],
                                   points=_plate(
            self._platform if geometry.platform_outline is None else geometry.platform_outline,
            thickness))
        self._with_platform = [
            self._plate,
            self._marker('platform', 1, Marker.SPHERE_LIST, COLORS['joint'], ball, self._platform),
            self._marker('platform', 2, Marker.LINE_LIST, _WHITE, line, axes,
                         [color for color in _AXES for _ in range(2)]),
            self._marker('platform', 3, Marker.SPHERE_LIST, _CENTER_OF_MASS, (_HEAVY * size,) * 3,
                         parameters.carried.center[None]),
            *([self._marker('platform', 4, Marker.SPHERE_LIST, _PAYLOAD, (_HEAVY * size,) * 3,
                            parameters.payload.body.center[None])]
              if parameters.payload.mass > 0.0 else [])]
        self._bodies = [self._marker(solid.name, n, Marker.CYLINDER, NO_FORCE)
                        for solid in kind.solids for n in range(6)]
        self._text = self._marker('singularity', 0, Marker.TEXT_VIEW_FACING, _WHITE, text_size)
        _COUNT.pack_into(self._body, len(LITTLE_ENDIAN), len(self._stamps))
        # The text has variable length: the bytes before and after it are kept.
        self._end = bytes(self._body[-_BEHIND_TEXT:])
        del self._body[-_BEHIND_TEXT - 8:]

    def write(self, setpoint: Batch, outputs: Outputs,
              exceedances: Sequence[Exceedance] = ()) -> bytes:
        """Return the message of a single setpoint, its outputs, and the limits it exceeds."""
        motion = setpoint.motions[0].tolist()
        body = self._body
        stamp = divmod(int(outputs.stamps[0]), SECOND)
        for at in self._stamps:
            _STAMP.pack_into(body, at, *stamp)
        rotation = np.reshape(motion[3:12], (3, 3))
        pose = (*motion[:3], *quaternion_of(motion[3:12]))
        for at in self._with_platform:
            _POSE.pack_into(body, at, *pose)
        level, message = singularity_state(outputs.rows[0].tolist(), self._parameters)
        _put_color(body, self._plate, PLATFORM[level])

        joints = motion[:3] + self._platform @ rotation.T
        efforts = outputs.efforts[0].tolist()
        colors = len(self._kind.solids) * self._colors(efforts)
        for at, numbers, color in zip(
                self._bodies, self._cylinders(joints, outputs.drive_positions[0]), colors,
                strict=True):
            _POSE_AND_SCALE.pack_into(body, at, *numbers)
            _put_color(body, at, color)

        x, y, z = motion[:3]
        _POSE.pack_into(body, self._text, x, y, z + self._text_above, 0.0, 0.0, 0.0, 1.0)
        text = self._words(outputs, exceedances, efforts, message).encode() + b'\x00'
        return b''.join((body, _COUNT.pack(len(text)), text, bytes(-len(text) % 4), self._end))

    def _cylinders(self, joints: Array, positions: Array) -> list[list[float]]:
        """Return pose and scale of six cylinders for each solid, ten numbers each."""
        placed = self._kind.place_solids(self._parameters, joints, positions)
        along = np.concatenate([each.directions for each in placed])
        numbers = np.zeros((len(along), 10))
        numbers[:, :3] = np.concatenate([each.centers for each in placed])
        # The rotation that turns z into a direction on the shortest way. The one up is taken of
        # the two that a cylinder has: half the way is far from upside down then.
        up = np.copysign(1.0, along[:, 2:]) * along
        half = np.sqrt(0.5 + 0.5 * up[:, 2])
        numbers[:, 3] = -0.5 * up[:, 1] / half
        numbers[:, 4] = 0.5 * up[:, 0] / half
        numbers[:, 6] = half
        numbers[:, 7] = numbers[:, 8] = self._diameters
        numbers[:, 9] = np.concatenate([each.lengths for each in placed])
        rows: list[list[float]] = numbers.tolist()
        return rows

    def _full(self, efforts: Sequence[float]) -> Sequence[float]:
        """Return the effort of each drive at which its colour is saturated."""
        if self._bounds is not None:
            bounds: list[float] = self._bounds.tolist()
            return bounds
        return [max(map(abs, efforts)) or 1.0] * 6

    def _colors(self, efforts: Sequence[float]) -> list[Color]:
        if math.isnan(efforts[0]):
            return [NO_FORCE] * 6
        return [_between(NO_LOAD, PUSH if effort > 0.0 else PULL, abs(effort) / full)
                for effort, full in zip(efforts, self._full(efforts), strict=True)]

    def _words(self, outputs: Outputs, exceedances: Sequence[Exceedance], efforts: Sequence[float],
               message: str) -> str:
        lines = [f'det(J) {outputs.determinants[0]:.4g} m^3, '
                 f'condition number {outputs.conditions[0]:.4g}']
        if message:
            lines.insert(0, message)
        legs = sorted({exceedance.leg for exceedance in exceedances})
        if legs:
            lines.append('limits exceeded: ' + ', '.join(self._names[leg] for leg in legs))
        if not math.isnan(efforts[0]):
            full = self._full(efforts)
            limit = (self._kind.effort_limit if len(set(full)) > 1
                     else f'{full[0]:.4g} {self._kind.effort.unit}')
            push, pull = self._kind.effort_signs
            lines.append(f'vermillion: {push}, blue: {pull}, saturated at {limit}')
        return '\n'.join(lines)

    # -- the message that is made once ------------------------------------------------------

    def _put(self, size: int, layout: str, *values: object) -> int:
        """Append numbers of a size and return where they begin."""
        self._body += bytes((4 - len(self._body)) % size)
        at = len(self._body)
        self._body += pack('<' + layout, *values)
        return at

    def _text_of(self, text: str) -> None:
        encoded = text.encode() + b'\x00'
        self._put(4, f'I{len(encoded)}s', len(encoded), encoded)
        self._body += bytes(-len(self._body) % 4)

    def _marker(self, namespace: str, number: int, kind: int, color: Color,
                scale: tuple[float, ...] = (1.0, 1.0, 1.0), points: Array | tuple[()] = (),
                colors: Sequence[Color] = (), position: Sequence[float] = (0.0, 0.0, 0.0),
                text: str = '') -> int:
        """Append a marker and return where its pose begins."""
        self._stamps.append(self._put(4, 'iI', 0, 0))
        self._text_of(self._frame)
        self._text_of(namespace)
        self._put(4, '3i', number, kind, 0)
        at = self._put(8, '10d', *position, 0.0, 0.0, 0.0, 1.0, *scale)
        self._put(4, '4f', *color)
        seconds = int(self._stays)
        self._put(4, 'iI?', seconds, int((self._stays - seconds) * SECOND), False)
        self._put(4, 'I', len(points))
        for point in points:
            self._put(8, '3d', *point)
        self._put(4, 'I', len(colors))
        for each in colors:
            self._put(4, '4f', *each)
        self._text_of('')  # no texture: its name, stamp, frame, format and data
        self._put(4, 'iI', 0, 0)
        self._text_of('')
        self._text_of('')
        self._put(4, 'II', 0, 0)  # and no coordinates in it
        self._text_of(text)
        self._text_of('')  # no mesh: its name, that of its file, and the file
        self._text_of('')
        self._put(4, 'I?', 0, False)
        return at


def _put_color(body: bytearray, at: int, color: Color) -> None:
    _COLOR.pack_into(body, at + _POSE_AND_SCALE.size, *color)


def _between(first: Color, last: Color, share: float) -> Color:
    r, g, b, a = (x + share * (y - x) for x, y in zip(first, last, strict=True))
    return r, g, b, a


def _plate(corners: Array, thickness: float) -> Array:
    """Return the triangles (12 N, 3) of a convex plate through corners (N, 3), outside up."""
    center = corners.mean(axis=0)
    first, second, normal = level_axes(corners - center)
    around = np.argsort(np.arctan2((corners - center) @ second, (corners - center) @ first))
    up = 0.5 * thickness * normal
    rim = corners[around]  # counterclockwise as seen from the normal's end
    triangles = []
    for a, b in zip(rim, np.roll(rim, -1, axis=0), strict=True):
        triangles += [center + up, a + up, b + up, center - up, b - up, a - up,
                      a - up, b - up, b + up, a - up, b + up, a + up]
    return np.array(triangles)
