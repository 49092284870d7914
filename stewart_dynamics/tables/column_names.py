# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Quantities that columns of a table can have: their names, other names of them, and units."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
import math
import re
from typing import NamedTuple

_LENGTHS = {'m': 1.0, 'mm': 1e-3, 'cm': 1e-2, 'km': 1e3, 'um': 1e-6, 'µm': 1e-6, 'μm': 1e-6,
            'in': 0.0254, 'ft': 0.3048}
_ANGLES = {'rad': 1.0, 'mrad': 1e-3, 'urad': 1e-6, 'µrad': 1e-6, 'μrad': 1e-6,
           'deg': math.pi / 180.0, '°': math.pi / 180.0, 'arcmin': math.pi / 10800.0,
           'arcsec': math.pi / 648000.0}
_TIMES = {'s': 1.0, 'ms': 1e-3, 'us': 1e-6, 'µs': 1e-6, 'μs': 1e-6, 'ns': 1e-9, 'min': 60.0}
_ACCELERATIONS = {'g': 9.80665, 'mg': 9.80665e-3, 'gal': 1e-2}
_SPINS = {'dps': math.pi / 180.0, 'rpm': math.pi / 30.0}
# Units in words; their plural ends with s.
_WORDS = {'meter': 'm', 'metre': 'm', 'millimeter': 'mm', 'millimetre': 'mm', 'centimeter': 'cm',
          'centimetre': 'cm', 'micrometer': 'um', 'inch': 'in', 'inche': 'in', 'feet': 'ft',
          'radian': 'rad', 'degree': 'deg', 'second': 's', 'sec': 's', 'millisecond': 'ms',
          'msec': 'ms', 'microsecond': 'us', 'usec': 'us', 'nanosecond': 'ns', 'nsec': 'ns',
          'minute': 'min'}
# With a capital letter these would be a million times the unit, not a thousandth of it.
_MILLI = {'mm', 'mrad', 'ms', 'mg'}
# Different spellings of m/s^2 become one.
_PLAIN = str.maketrans({' ': '', '^': '', '*': '', '.': '', '·': '', '²': '2', '⁻': '-',
                        '¹': '1', '_': '/'})
_ENDINGS = {0: '', 1: '/s', 2: '/s2'}


class Quantity(NamedTuple):
    """Columns that belong together."""

    columns: tuple[str, ...]
    units: Mapping[str, float]  # in SI
    order: int = 0  # of the derivative by time
    aliases: tuple[tuple[str, ...], ...] = ()  # other names of the columns, in their order


def _with_axes(*patterns: str) -> tuple[tuple[str, ...], ...]:
    return tuple(tuple(pattern.format(axis) for axis in 'xyz') for pattern in patterns)


TIME = Quantity(('t',), _TIMES, aliases=(
    ('time',), ('timestamp',), ('timestamps',), ('stamp',), ('seconds',)))
POSITION = Quantity(('x', 'y', 'z'), _LENGTHS, aliases=(
    ('surge', 'sway', 'heave'), *_with_axes('t{}', 'p{}', 'pos_{}', 'position_{}',
                                            'pose_position_{}')))
QUATERNION = Quantity(('qx', 'qy', 'qz', 'qw'), {}, aliases=tuple(
    tuple(f'{name}_{axis}' for axis in 'xyzw')
    for name in ('q', 'quat', 'orientation', 'pose_orientation')))
ANGLES = Quantity(('roll', 'pitch', 'yaw'), _ANGLES, aliases=(('alpha', 'beta', 'gamma'),))
U_V_W = Quantity(('u', 'v', 'w'), _ANGLES)
ROTATION_VECTOR = Quantity(('rx', 'ry', 'rz'), _ANGLES)
MATRIX = Quantity(tuple(f'r{row}{column}' for row in '123' for column in '123'), {})
VELOCITY = Quantity(('vx', 'vy', 'vz'), _LENGTHS, 1, _with_axes('vel_{}', 'linear_velocity_{}'))
ANGULAR_VELOCITY = Quantity(('wx', 'wy', 'wz'), _ANGLES, 1, _with_axes(
    'omega_{}', 'gyro_{}', 'angular_velocity_{}'))
ACCELERATION = Quantity(('ax', 'ay', 'az'), _LENGTHS, 2, _with_axes(
    'acc_{}', 'accel_{}', 'linear_acceleration_{}'))
ANGULAR_ACCELERATION = Quantity(('alx', 'aly', 'alz'), _ANGLES, 2, _with_axes(
    'dw{}', 'angular_acceleration_{}'))
ROTATIONS = QUATERNION, ANGLES, U_V_W, ROTATION_VECTOR, MATRIX
MOTION = (TIME, POSITION, *ROTATIONS, VELOCITY, ANGULAR_VELOCITY, ACCELERATION,
          ANGULAR_ACCELERATION)


def leg_positions(joints: Sequence[str]) -> Quantity:
    """Return the quantity of the positions of legs, whose columns have the names of the joints."""
    return Quantity(tuple(joints), _LENGTHS)


def leg_angles(joints: Sequence[str]) -> Quantity:
    """Return the quantity of the angles of legs whose drives turn, likewise."""
    return Quantity(tuple(joints), _ANGLES)


def si_factor(quantity: Quantity, unit: str) -> float | None:
    """Return a unit in SI; None if the quantity does not have it."""
    if not unit:
        return 1.0
    others = {(2, True): _ACCELERATIONS, (1, False): _SPINS}.get(
        (quantity.order, quantity.units is _LENGTHS), {})
    if quantity.units and (found := _symbol(others, unit)) is not None:
        return found
    if quantity.order == 0:
        return _symbol(quantity.units, unit)
    plain = unit.replace('_per_', '/').replace(' per ', '/').translate(_PLAIN)
    plain = plain.replace('/sec', '/s').replace('/s/s', '/s2')
    plain = plain.replace('s-1', '/s').replace('s-2', '/s2').replace('//', '/')
    ending = _ENDINGS[quantity.order]
    if not plain.endswith(ending):
        return None
    return _symbol(quantity.units, plain.removesuffix(ending))


def _symbol(units: Mapping[str, float], text: str) -> float | None:
    """Return a unit by its symbol or word; case matters where another case is another unit."""
    if text in units:
        return units[text]
    lower = text.lower()
    word = _WORDS.get(lower, _WORDS.get(lower.removesuffix('s')))
    return units.get(word or ('' if lower in _MILLI else lower))


def unit_rule(quantity: Quantity) -> str:
    """Return the units of a quantity in words."""
    if not quantity.units:
        return 'must not be given: the numbers have no unit'
    names = [name for name in quantity.units if name.isascii()]
    ending = _ENDINGS[quantity.order].replace('2', '^2')
    others = {(2, True): _ACCELERATIONS, (1, False): _SPINS}.get(
        (quantity.order, quantity.units is _LENGTHS), {})
    return 'must be one of ' + ', '.join([*(f'{name}{ending}' for name in names), *others])


class Heading(NamedTuple):
    """The heading of a column: its name in the table of quantities, and its unit."""

    name: str
    unit: str  # empty: SI
    rank: int  # 0: the name itself; else the number of the other name, plus one


_BRACKETS = re.compile(r'(?P<name>.*?)\s*[\[(]\s*(?P<unit>[^\[\]()]*?)\s*[\])]')
_SLASH = re.compile(r'(?P<name>[^/]*[^/\s])\s*/\s*(?P<unit>[^\s].*)')


def split(cell: str) -> tuple[str, str]:
    """Return a heading without the unit behind it in brackets, and that unit; empty without."""
    found = _BRACKETS.fullmatch(cell.strip())
    return (found['name'], found['unit']) if found else (cell.strip(), '')


class Names:
    """The names of the columns of some quantities."""

    def __init__(self, quantities: Iterable[Quantity]) -> None:
        self.quantities = tuple(quantities)
        self.quantity: dict[str, Quantity] = {}  # of each column
        self._of: dict[str, tuple[str, int]] = {}
        for quantity in self.quantities:
            self.quantity |= dict.fromkeys(quantity.columns, quantity)
            for rank, names in enumerate((quantity.columns, *quantity.aliases)):
                for column, name in zip(quantity.columns, names, strict=True):
                    self._of.setdefault(name, (column, rank))
                    self._of.setdefault(_plain(name), (column, rank))

    def heading(self, cell: str) -> Heading | None:
        """
        Return the heading that a cell names; None if it names no column of these quantities.

        The unit stands in brackets, behind a slash, or behind an underscore: ``x [mm]``,
        ``x (mm)``, ``x / mm``, ``x_mm``.
        """
        for name, unit in self._readings(cell):
            if found := self._of.get(name, self._of.get(_plain(name))):
                return Heading(found[0], unit, found[1])
        return None

    def _readings(self, cell: str) -> Iterator[tuple[str, str]]:
        yield split(cell)
        if found := _SLASH.fullmatch(cell.strip()):
            yield found['name'], found['unit']
        plain = cell.strip()
        for at in [n for n, letter in enumerate(plain) if letter == '_'][::-1]:
            name, unit = plain[:at], plain[at + 1:]
            column = self._of.get(_plain(name))
            if column and unit and si_factor(self.quantity[column[0]], unit) is not None:
                yield name, unit

    def has_unit(self, cell: str) -> bool:
        """Return whether a cell is a unit of one of the quantities, in brackets or without."""
        text = cell.strip().strip('[]()').strip()
        return text in ('', '-') or any(
            si_factor(quantity, text) is not None for quantity in self.quantities)


def _plain(name: str) -> str:
    return re.sub(r'[\s.-]+', '_', name.strip().strip('#%"').strip().lower())
