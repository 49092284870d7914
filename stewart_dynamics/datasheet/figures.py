# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""How figures of a datasheet are written: units of vendors' sheets, rounded toward zero."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math
from typing import Any, NamedTuple

_DIGITS = 4
_THIN_SPACE = '\u202f'


class Unit(NamedTuple):
    """Unit in which SI values are written."""

    name: str
    factor: float


MM, DEGREE = Unit('mm', 1e3), Unit('°', math.degrees(1.0))
LINEAR = {'travel': MM, 'velocity': Unit('mm/s', 1e3), 'acceleration': Unit('m/s²', 1.0),
          'force': Unit('N', 1.0), 'stiffness': Unit('N/µm', 1e-6)}
ANGULAR = {'travel': DEGREE, 'velocity': Unit('°/s', DEGREE.factor),
           'acceleration': Unit('°/s²', DEGREE.factor), 'moment': Unit('N m', 1.0),
           'stiffness': Unit('N m/mrad', 1e-3)}


_NAMES = {
    'length_max': 'longest leg', 'length_min': 'shortest leg', 'velocity_max': 'speed of a leg',
    'force_max': 'force of a leg', 'torque_max': 'torque of a motor',
    'torque_speed': 'torque of a motor at its speed', 'speed_max': 'speed of a motor',
    'base_joint_angle_max': 'joint angle at the base',
    'platform_joint_angle_max': 'joint angle at the platform',
    'leg_clearance_min': 'clearance between legs'}


def limit_name(limit: str) -> str:
    """Return the name of a limit or of a singularity."""
    return _NAMES.get(limit, limit)


def unit_of(axis: str, quantity: str) -> Unit:
    """Return the unit of a quantity along an axis, x or rx."""
    return (ANGULAR if axis.startswith('r') else LINEAR)[quantity]


def down(value: float | None) -> str:
    """Return a value in four digits, rounded toward zero: the written value is reachable."""
    if value is None or not math.isfinite(value):
        return '–'
    if value == 0.0:
        return '0'
    places = _DIGITS - 1 - math.floor(math.log10(abs(value)))
    power = 10.0 ** places
    # a value that is exact in four digits is not to lose its last one by rounding errors
    shortened = math.trunc(value * power * (1.0 + 1e-12)) / power
    text = f'{shortened:,.{max(places, 0)}f}'
    return text.replace(',', _THIN_SPACE).replace('-', '−')


def both_ways(values: Mapping[str, Any], axis: str, unit: Unit) -> str:
    """Return the extents of an axis to minus and plus: ±1.5, or −1.2 … +1.5."""
    minus, plus = (values[f'{axis}{sign}']['value'] for sign in '-+')
    return span((None if minus is None else -minus, plus), unit)


def span(bounds: Sequence[float | None], unit: Unit) -> str:
    """Return a range in a unit: ±1.5, or −1.2 … +1.5."""
    a, b = (down(None if each is None else each * unit.factor) for each in bounds)
    if a.lstrip('−') == b:
        return b if b in '0–' else f'±{b}'
    # the space that does not break keeps the dots on the first line of a narrow column
    return f'{a}\u00a0… +{b}' if b not in '0–' else f'{a}\u00a0… {b}'
