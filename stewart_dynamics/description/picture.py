# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A picture (SVG) of a hexapod at home, with numbered joints: to be compared with the machine.

It shows numbers as they were read, base joints as discs and platform joints as rings, from above
and from the front of the base frame, and a table of the legs. Where drives turn, it shows both
bodies of a leg, and the motion of the end of the first one while the angle grows: an arrow, or,
as for vectors across a page, a dot toward the reader and a cross away from the reader.
"""

from __future__ import annotations

import math
from typing import NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.colors import LEG_COLORS, ROLES
from stewart_dynamics.description.hexapod import Hexapod, LegDescription
from stewart_dynamics.description.xml_text import add, text_of
from stewart_dynamics.legs.mechanism import HINGE
from stewart_dynamics.mechanics.frames.rotation import to_euler

_WIDTH, _VIEW, _MARGIN = 900.0, 420.0, 48.0  # [px]
_TABLE = 24.0  # height of a row [px]
_AWAY = 17.0  # of a number from its joint [px]
_SAME = 6.0  # joints as near to each other in a view have their numbers together [px]
# Title, axes to the right and up, and the direction to the reader.
_VIEWS = (('From above: x to the right, y up', (0, 1), (0.0, 0.0, 1.0)),
          ('From the front: x to the right, z up', (0, 2), (0.0, -1.0, 0.0)))
_ARROW = 0.45  # length in terms of the arm that turns
_ACROSS = 0.8  # motion with a larger part across the page has a dot or cross
_HEAD = 8.0  # length of the head of an arrow [px]
_DOT = 5.0  # radius of the ring around a dot or cross [px]
_COLUMNS = (('leg', 20.0), ('base joint x, y, z [m]', 150.0),
            ('platform joint x, y, z [m]', 425.0), ('{position} at home [{unit}]', 700.0))


def picture(hexapod: Hexapod, name: str) -> str:
    """Return the picture of a hexapod as SVG; ``name`` is its title."""
    height = _VIEW + 8.5 * _TABLE + 60.0
    root = ET.Element('svg', {
        'xmlns': 'http://www.w3.org/2000/svg', 'viewBox': f'0 0 {_WIDTH:g} {height:g}',
        'width': f'{_WIDTH:g}', 'height': f'{height:g}', 'font-family': 'sans-serif',
        'font-size': '14', 'role': 'img'})
    add(root, 'title', f'{name}: joints as read, at home')
    add(root, 'rect', width='100%', height='100%', fill='white')
    p = hexapod.parameters
    base = p.geometry.base_joints
    platform = hexapod.position + p.geometry.platform_joints @ hexapod.rotation.T
    knees = [_knee(leg) for leg in hexapod.legs if hexapod.kind.drive_joint == HINGE]
    for at, (title, axes, toward) in zip((0.0, 0.5 * _WIDTH), _VIEWS, strict=True):
        across = np.array([knee.motion @ toward for knee in knees])
        _view(root, at, title, base[:, axes], platform[:, axes],
              np.array([[knee.point, knee.motion] for knee in knees])[..., axes]
              if knees else None, across)
    x, y, z = hexapod.position
    angles = ', '.join(f'{math.degrees(each) + 0.0:.4g}' for each in to_euler(hexapod.rotation))
    _text(root, 20.0, _VIEW + 24.0, f'{name} at home: platform frame at {_number(x)}, '
          f'{_number(y)}, {_number(z)} m, turned by {angles} degrees.')
    words = 'Discs are base joints, rings platform joints.'
    if knees:
        words += ' Arrows: motion at a growing angle (dot: toward you, cross: away).'
    _text(root, 20.0, _VIEW + 44.0, words)
    _table(root, hexapod)
    return text_of(root, 'Numbers are legs in the order of all arrays of six.')


class _Knee(NamedTuple):
    """The joint between the bodies of a leg whose drive turns, at home."""

    point: Array  # base frame (3,) [m]
    motion: Array  # unit vector (3,) along which it moves while the angle grows


def _knee(leg: LegDescription) -> _Knee:
    first, second = leg.branch.links
    point = first.at_home.point(second.at_home.position)
    motion = np.cross(first.at_home.rotation[:, 2], point - first.at_home.position)
    return _Knee(point, motion / np.linalg.norm(motion))


def _view(root: ET.Element, left: float, title: str, base: Array, platform: Array,
          knees: Array | None, across: Array) -> None:
    """
    Draw both bodies and the legs, from points (6, 2) [m].

    knees: points and motions (6, 2, 2) of the joints between the bodies of legs that have such;
        across: parts of the motions toward the reader.
    """
    points = np.concatenate([base, platform] if knees is None else [base, platform, knees[:, 0]])
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    size = float(np.ptp(points, axis=0).max())
    scale = (min(_VIEW, 0.5 * _WIDTH) - 2.0 * _MARGIN - 24.0) / size
    place = (np.array([1.0, -1.0]) * scale, np.array([left + 0.25 * _WIDTH, 0.5 * _VIEW + 12.0]))
    base, platform = ((each - middle) * place[0] + place[1] for each in (base, platform))
    between = None if knees is None else (knees[:, 0] - middle) * place[0] + place[1]
    _text(root, left + 20.0, 24.0, title, font_weight='bold')
    for joints, color in ((base, ROLES['base']), (platform, ROLES['piston'])):
        # Rounded as they are drawn: the order of a plate from its side is not one of last digits.
        x, y = (joints - joints.mean(axis=0)).round(1).T + 0.0
        around = np.argsort(np.arctan2(y, x), kind='stable')
        corners = ' '.join(f'{x:.1f},{y:.1f}' for x, y in joints[around])
        _draw(root, 'polygon', None, points=corners, fill=color, fill_opacity=0.5, stroke=color)
    for n, (color, begin, end) in enumerate(zip(LEG_COLORS, base, platform, strict=True)):
        if between is None or knees is None:
            _line(root, begin, end, stroke=color, stroke_width=3)
        else:
            _line(root, begin, between[n], stroke=color, stroke_width=5)
            _line(root, between[n], end, stroke=color, stroke_width=2)
            _motion(root, between[n], knees[n, 1] * [1.0, -1.0], float(across[n]),
                    _ARROW * float(np.linalg.norm(between - base, axis=1).max()))
        _draw(root, 'circle', None, cx=begin[0], cy=begin[1], r=6, fill=color)
        _draw(root, 'circle', None, cx=end[0], cy=end[1], r=6, fill='white', stroke=color,
              stroke_width=3)
    _numbers(root, base)
    _numbers(root, platform)
    _origin(root, (-middle) * place[0] + place[1], title)


def _motion(root: ET.Element, at: Array, along: Array, across: float, length: float) -> None:
    """Draw an arrow (2,) of a motion, or a dot or cross where it is mostly across the page."""
    ink = ROLES['ink']
    if abs(across) > _ACROSS:
        _draw(root, 'circle', None, cx=at[0], cy=at[1], r=_DOT, fill='white', stroke=ink)
        if across > 0.0:
            _draw(root, 'circle', None, cx=at[0], cy=at[1], r=0.4 * _DOT, fill=ink)
            return
        for x, y in ((1.0, 1.0), (1.0, -1.0)):
            arm = np.array([x, y]) * _DOT / math.sqrt(2.0)
            _line(root, at - arm, at + arm, stroke=ink)
        return
    end = at + along * length
    unit = along / np.linalg.norm(along)
    side = np.array([-unit[1], unit[0]])
    _line(root, at, end, stroke=ink, stroke_width=1.5)
    corners = (end, end - _HEAD * (unit + 0.4 * side), end - _HEAD * (unit - 0.4 * side))
    _draw(root, 'polygon', None, points=' '.join(f'{x:.1f},{y:.1f}' for x, y in corners),
          fill=ink)


def _numbers(root: ET.Element, joints: Array) -> None:
    """Write the numbers of legs beside joints (6, 2), away from their middle."""
    middle = joints.mean(axis=0)
    for n, at in enumerate(joints):
        same = np.flatnonzero(np.linalg.norm(joints - at, axis=1) < _SAME)
        if same[0] < n:
            continue
        away = (at - middle) / max(float(np.linalg.norm(at - middle)), 1e-9)
        x, y = at + away * (_AWAY + 6.0 * (len(same) - 1))
        _text(root, x, y + 5.0, ', '.join(str(each + 1) for each in same), text_anchor='middle',
              font_weight='bold',
              fill=LEG_COLORS[n] if len(same) == 1 else ROLES['black'], stroke='white',
              stroke_width=3, paint_order='stroke')


def _origin(root: ET.Element, at: Array, title: str) -> None:
    """Draw the axes of the base frame at its origin."""
    up = title[-4]
    for name, (x, y) in (('x', (28.0, 0.0)), (up, (0.0, -28.0))):
        _line(root, at, at + (x, y), stroke=ROLES['ink'])
        _text(root, at[0] + 1.35 * x, at[1] + 1.2 * y + (4.0 if x else 0.0), name, font_size=12,
              text_anchor='middle')


def _table(root: ET.Element, hexapod: Hexapod) -> None:
    top = _VIEW + 80.0
    position = hexapod.kind.position
    for name, left in _COLUMNS:
        words = name.format(position=position.name, unit=position.unit)
        _text(root, left, top, words, font_weight='bold')
    for n, leg in enumerate(hexapod.legs):
        row = top + (n + 1) * _TABLE
        texts = (f'{n + 1}  {leg.name}', *(
            ',  '.join(map(_number, joint)) for joint in (leg.base_joint, leg.platform_joint)),
            _number(leg.branch.home))
        for text, (_, left) in zip(texts, _COLUMNS, strict=True):
            color = LEG_COLORS[n] if left == _COLUMNS[0][1] else ROLES['black']
            _text(root, left, row, text, fill=color)


def _number(value: float) -> str:
    return f'{round(float(value), 9) + 0.0:.6g}'


def _text(root: ET.Element, x: float, y: float, text: str, **look: object) -> None:
    _draw(root, 'text', text, x=x, y=y, **look)


def _line(root: ET.Element, begin: Array, end: Array, **look: object) -> None:
    _draw(root, 'line', None, x1=begin[0], y1=begin[1], x2=end[0], y2=end[1], **look)


def _draw(root: ET.Element, tag: str, text: str | None, /, **look: object) -> None:
    add(root, tag, text, **{
        name.replace('_', '-'): f'{value:.1f}' if isinstance(value, float) else str(value)
        for name, value in look.items()})
