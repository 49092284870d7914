# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A picture (SVG) of a hexapod at home, with numbered joints: to be compared with the machine.

It shows numbers as they were read, base joints as discs and platform joints as rings, from above
and from the front of the base frame, and a table of the legs.
"""

from __future__ import annotations

import math
from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.colors import LEG_COLORS, ROLES
from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.description.xml_text import add, text_of
from stewart_dynamics.mechanics.frames.rotation import to_euler

_WIDTH, _VIEW, _MARGIN = 900.0, 420.0, 48.0  # [px]
_TABLE = 24.0  # height of a row [px]
_AWAY = 17.0  # of a number from its joint [px]
_SAME = 6.0  # joints as near to each other in a view have their numbers together [px]
_VIEWS = (('From above: x to the right, y up', (0, 1)),
          ('From the front: x to the right, z up', (0, 2)))
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
    for at, (title, axes) in zip((0.0, 0.5 * _WIDTH), _VIEWS, strict=True):
        _view(root, at, title, base[:, axes], platform[:, axes])
    x, y, z = hexapod.position
    angles = ', '.join(f'{math.degrees(each) + 0.0:.4g}' for each in to_euler(hexapod.rotation))
    _text(root, 20.0, _VIEW + 24.0, f'{name} at home: platform frame at {_number(x)}, '
          f'{_number(y)}, {_number(z)} m, turned by {angles} degrees.')
    _text(root, 20.0, _VIEW + 44.0, 'Discs are base joints, rings platform joints.')
    _table(root, hexapod)
    return text_of(root, 'Numbers are legs in the order of all arrays of six.')


def _view(root: ET.Element, left: float, title: str, base: Array, platform: Array) -> None:
    """Draw both bodies and the legs, from points (6, 2) [m]."""
    points = np.concatenate([base, platform])
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    size = float(np.ptp(points, axis=0).max())
    scale = (min(_VIEW, 0.5 * _WIDTH) - 2.0 * _MARGIN - 24.0) / size
    place = (np.array([1.0, -1.0]) * scale, np.array([left + 0.25 * _WIDTH, 0.5 * _VIEW + 12.0]))
    base, platform = ((each - middle) * place[0] + place[1] for each in (base, platform))
    _text(root, left + 20.0, 24.0, title, font_weight='bold')
    for joints, color in ((base, ROLES['base']), (platform, ROLES['piston'])):
        around = np.argsort(np.arctan2(*(joints - joints.mean(axis=0)).T[::-1]))
        corners = ' '.join(f'{x:.1f},{y:.1f}' for x, y in joints[around])
        _draw(root, 'polygon', None, points=corners, fill=color, fill_opacity=0.5, stroke=color)
    for color, begin, end in zip(LEG_COLORS, base, platform, strict=True):
        _line(root, begin, end, stroke=color, stroke_width=3)
        _draw(root, 'circle', None, cx=begin[0], cy=begin[1], r=6, fill=color)
        _draw(root, 'circle', None, cx=end[0], cy=end[1], r=6, fill='white', stroke=color,
              stroke_width=3)
    _numbers(root, base)
    _numbers(root, platform)
    _origin(root, (-middle) * place[0] + place[1], title)


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
