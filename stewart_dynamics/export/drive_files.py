# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Files for the amplifiers of the motors, from ``drive.*``: units, signs and scales.

A C header for hardware interfaces, a page with the numbers of each leg, and the configuration of
each EtherCAT slave for ethercat_driver_ros2, whose channels write ``factor * value + offset`` in
a cast to an integer. Servos on a bus, with ``drive.counts_at_zero`` or ``drive.current_unit``,
need no rated torque; without it nothing is written for CiA 402.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
import math
import re
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics import __version__
from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.export.c_project import source
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.mechanics.drives.motors import motor_ratio
from stewart_dynamics.parameters.table import GUIDED, Parameters

_RATED, _COUNTS = 'drive.rated_torque', 'drive.counts_per_turn'
_ZERO, _CURRENT, _SPEED = 'drive.counts_at_zero', 'drive.current_unit', 'drive.speed_unit'
_CONSTANT = 'drive.torque_constant'
_BITS_16, _BITS_32 = 2.0 ** 15 - 1.0, 2.0 ** 31 - 1.0  # largest integers on a bus
_ODRIVE = 0.001  # of a turn/s, the unit of Vel_FF unless input_vel_scale is changed
# Positions are read and written back by two factors: this much more than the reciprocal covers
# their rounding, so that the cast gives the same increment.
_COVERED = 1.0 + 2.0 ** -50


class Amplifier(NamedTuple):
    """The units of a leg's amplifier; ``unit`` is that of its position, metre or radian."""

    leg: str
    ratio: float  # turn of the motor for a unit of the leg [rad]
    rated_torque: float  # 1000 per mille [N m]; nan: not CiA 402
    counts_per_turn: float
    direction: float  # 1 or -1
    # Units of a servo on a bus; nan where it is not given.
    counts_at_zero: float
    speed_unit: float  # [rad/s]
    current_unit: float  # [A]
    torque_constant: float  # [N m/A]

    @property
    def counts_per_unit(self) -> float:
        """Return the increments of position for a unit of the leg."""
        return self.direction * self.ratio / (2.0 * math.pi) * self.counts_per_turn

    @property
    def per_mille_per_effort(self) -> float:
        """Return the torque offset for an effort of 1, by an ideal screw or gear."""
        return self.direction * 1e3 / (self.ratio * self.rated_torque)


def amplifiers(parameters: Parameters) -> list[Amplifier]:
    """
    Return the amplifiers of the six legs.

    Raises ParameterError: a parameter is missing, the motor's angle is not linear in the position
        of the drive, or a torque, current, position or rate within the limits does not fit into
        the integers of the bus.
    """
    kind, p = parameters.leg_kind, parameters
    on_bus = p[_ZERO] is not None or p[_CURRENT] is not None
    needed = [kind.ratio, *([] if on_bus else [_RATED]), _COUNTS,
              *([_CONSTANT] if p[_CURRENT] is not None else [])]
    missing = [name for name in filter(None, needed) if p[name] is None]
    if missing:
        raise ParameterError(f'{", ".join(missing)}: not set: needed by --drives')
    if p.drive.screw_rotation != GUIDED:
        raise ParameterError(
            f'drive.screw_rotation: {p.drive.screw_rotation}: must be {GUIDED} for '
            '--drives: the angle of a motor depends on the pose; use ~/motor_states')
    if on_bus and p[_ZERO] is None:
        zero: Array = np.zeros(6)
    else:
        zero = _values(p, _ZERO)
    found = [Amplifier(*row) for row in zip(
        p.joints, motor_ratio(p).tolist(), *(_values(p, name).tolist() for name in (
            _RATED, _COUNTS, 'drive.direction')), zero.tolist(),
        *(_values(p, name).tolist() for name in (_SPEED, _CURRENT, _CONSTANT)), strict=True)]
    if p[_RATED] is not None:
        _check_torques(p, found)
    if p[_CURRENT] is not None:
        _check_currents(p, found)
    _check_increments(p, found)
    return found


def _values(parameters: Parameters, name: str) -> Array:
    """Return six values; nan where they are not given."""
    values: Array = np.full(6, math.nan) if parameters[name] is None else parameters[name]
    return values


def _check_torques(parameters: Parameters, found: list[Amplifier]) -> None:
    """Raise ParameterError if a torque within the limits does not fit into 60B2h."""
    kind = parameters.leg_kind
    per_mille_per_effort = [abs(each.per_mille_per_effort) for each in found]
    per_mille = [1e3 / each.rated_torque for each in found]
    _check_fits(parameters, 'per mille of torque', '60B2h', _BITS_16, (
        (kind.effort_limit, kind.effort.unit, 0.0, per_mille_per_effort),
        ('drive.torque_max', 'N m', 0.0, per_mille)), lambda leg, factor: (
            'set drive.rated_torque, 6076h of the amplifier, to at least '
            f'{1.001 * factor * found[leg].rated_torque:.4g} N m'))


def _check_currents(parameters: Parameters, found: list[Amplifier]) -> None:
    """Raise ParameterError if a torque within the limits does not fit into Goal Current."""
    kind = parameters.leg_kind
    counts = np.array([1.0 / (each.current_unit * each.torque_constant) for each in found])
    ratios = np.array([each.ratio for each in found])
    _check_fits(parameters, 'units of current', 'Goal Current', _BITS_16, (
        (kind.effort_limit, kind.effort.unit, 0.0, counts / ratios),
        ('drive.torque_max', 'N m', 0.0, counts)), lambda leg, factor: (
            'limits, drive.current_unit or drive.torque_constant in another unit?'))


def _check_increments(parameters: Parameters, found: list[Amplifier]) -> None:
    """Raise ParameterError if a position or rate within the limits does not fit into 32 bits."""
    kind = parameters.leg_kind
    per_unit = np.abs([each.counts_per_unit for each in found])
    per_radian = [each.counts_per_turn / (2.0 * math.pi) for each in found]
    lowest, highest = kind.position_limits
    zero: ArrayLike = parameters[kind.zero] if kind.zero else 0.0
    least, most = parameters[lowest], parameters[highest]

    def fewer(leg: int, factor: float) -> str:
        return ('set fewer increments of a turn in the amplifier, drive.counts_per_turn of at '
                f'most {math.floor(found[leg].counts_per_turn / factor)}')

    def fewer_or_centred(leg: int, factor: float) -> str:
        if not kind.zero or least is None or most is None or np.any(
                per_unit * (most - least) > 2.0 * _BITS_32):
            return fewer(leg, factor)
        return (f'{fewer(leg, factor)}, or {kind.zero} in the middle of the stroke, '
                f'{(least[leg] + most[leg]) / 2.0:.6g} m')

    _check_fits(parameters, 'increments of position', '607Ah', _BITS_32, (
        (lowest, kind.position.unit, zero, per_unit),
        (highest, kind.position.unit, zero, per_unit)), fewer_or_centred)
    _check_fits(parameters, 'increments/s', '60B1h', _BITS_32, (
        (kind.rate_limit, kind.rate.unit, 0.0, per_unit),
        ('drive.speed_max', 'rad/s', 0.0, per_radian)), fewer)


def _check_fits(parameters: Parameters, of: str, index: str, largest: float,
                limits: Sequence[tuple[str, str, ArrayLike, ArrayLike]],
                cure: Callable[[int, float], str]) -> None:
    """
    Raise ParameterError for the limit that exceeds the largest integer of an object most.

    limits: name, unit, the value that becomes 0, and the integers for 1 of its unit; each of one
        value or six.
    cure: words for a leg, and by how many times the largest integer is exceeded.
    """
    raw = {(limit, unit): np.abs(parameters[limit] - zero) * np.asarray(scale)
           for limit, unit, zero, scale in limits if parameters[limit] is not None}
    if not raw:
        return
    (limit, unit), integers = max(raw.items(), key=lambda item: float(np.max(item[1])))
    leg = int(np.argmax(integers))
    if integers[leg] > largest:
        raise ParameterError(
            f'{limit}: {parameters[limit][leg]:g} {unit}: leg {leg + 1} needs '
            f'{np.ceil(integers[leg]):.0f} {of}, but {index} has at most {largest:.0f}: '
            f'{cure(leg, integers[leg] / largest)}')


def drive_files(parameters: Parameters, name: str) -> dict[str, str | bytes]:
    """Return the files by their names; ``name`` is that of the hexapod in C."""
    found, kind = amplifiers(parameters), parameters.leg_kind
    parts = {'CIA402': math.isfinite(found[0].rated_torque),
             'DYNAMIXEL': math.isfinite(found[0].counts_at_zero),
             'SPEED': math.isfinite(found[0].speed_unit),
             'CURRENT': math.isfinite(found[0].current_unit)}
    parts['PLAIN'] = not parts['CIA402']
    members = [(part, member, words) for part, member, words in (
        ('CIA402', 'rated_torque', 'object 6076h [N m]'),
        ('', 'counts_per_turn', 'increments of a turn'), ('', 'direction', '1 or -1'),
        ('DYNAMIXEL', 'counts_at_zero', 'increments at zero'),
        ('SPEED', 'speed_unit', 'unit of speeds [rad/s]'),
        ('CURRENT', 'current_unit', 'unit of currents [A]'),
        ('CURRENT', 'torque_constant', '[N m/A]')) if not part or parts[part]]
    rows = ',\n'.join('  {' + ', '.join(repr(value) for value in (
        each.ratio / (2.0 * math.pi), each.ratio, *(
            getattr(each, member) for _, member, _ in members))) + '}' for each in found)
    effort = kind.effort.name
    texts = {
        'NAME': name, 'GUARD': name.upper(), 'ROWS': rows, 'VERSION': __version__,
        'UNIT': kind.position.unit, 'EFFORT': effort, 'EFFORTTITLE': effort.capitalize(),
        'EFFORTUNIT': kind.effort.unit, 'OF': 'force' if effort == 'force' else f'leg_{effort}',
        'MOVES': kind.moves, 'MOVEIT': kind.moves.removeprefix('+ '), 'MOVED': kind.moved,
        'WORD': kind.unit_word, 'RATIO': f' [1/{kind.position.unit}]' if kind.ratio else '',
        'GEAR': kind.gear, 'GEARS': 'screw and gear' if kind.ratio else kind.gear,
        'REFLECTED': kind.fields['reflected_mass'],
        'MEMBERS': ', '.join(member for _, member, _ in members),
        'FIELDS': f'   {"; ".join(words for *_, words in members)}.',
        'TURNS': f'{_BITS_16 * _ODRIVE:g}',
        'FASTEST': f'{min(_BITS_16 * _ODRIVE * 2.0 * math.pi / each.ratio for each in found):.3g}',
        'TABLE': _table(found, kind, parts), 'GOALS': _goals(parameters, found),
        'OFSPEED': (f'`Present Velocity`: `{name}_present_velocity`' if parts['SPEED'] else
                    'drive.speed_unit is not set'),
        'OFCURRENT': (f'`Goal Current`: `{name}_goal_current`; of the motor, from `Present '
                      f'Current`: `{name}_present_torque`' if parts['CURRENT'] else
                      'drive.current_unit is not set')}
    files: dict[str, str | bytes] = {
        f'{name}_drives.h': _filled(source('drives.h.in'), texts, parts),
        f'{name}_drives.md': _filled(source('drives.md.in'), texts, parts)}
    if parts['CIA402']:
        files |= {f'{name}_ethercat_{n + 1}.yaml': _slave(each, kind)
                  for n, each in enumerate(found)}
    return files


def _filled(template: str, texts: Mapping[str, str], parts: Mapping[str, bool]) -> str:
    """Return a template with its texts, and with those of its parts that there are."""
    chosen = re.sub(r'^@IF ([A-Z0-9]+)@\n(.*?)^@END@\n',
                    lambda at: at[2] if parts[at[1]] else '', template, flags=re.M | re.S)
    return re.sub('@([A-Z]+)@', lambda at: texts[at[1]], chosen)


def _slave(each: Amplifier, kind: LegKind) -> str:
    return source('ethercat.yaml.in').format(
        leg=each.leg, version=__version__, counts=each.counts_per_unit,
        per_mille=each.per_mille_per_effort, rated=each.rated_torque,
        metres=_COVERED / each.counts_per_unit, newtons=1.0 / each.per_mille_per_effort,
        range=_BITS_32 / abs(each.counts_per_unit), unit=kind.position.unit,
        effort_unit=kind.effort.unit, moves=kind.moves, word=kind.unit_word)


def _table(found: list[Amplifier], kind: LegKind, parts: Mapping[str, bool]) -> str:
    """Return the numbers of each leg."""
    unit, (size, words) = kind.position.unit, kind.large_effort
    at = '' if kind.ratio else f' at the {kind.moved}'
    columns: dict[str, Callable[[Amplifier], str]] = {
        'leg': lambda each: each.leg, 'direction': lambda each: f'{each.direction:+g}',
        f'motor turns for 1 {unit}': lambda each: f'{each.ratio / (2.0 * math.pi):.8g}',
        f'increments for 1 {unit}': lambda each: f'{each.counts_per_unit:.8g}',
        f'607Ah holds +- [{unit}], 60B1h +- [{unit}/s]':
            lambda each: f'{_BITS_32 / abs(each.counts_per_unit):.4g}',
        f'torque for {words}{at}, ideal {kind.gear} [N m]':
            lambda each: f'{size / each.ratio:.6g}'}
    if parts['CIA402']:
        columns |= {
            f'60B2h for {words}{at} [per mille]':
                lambda each: f'{size * each.per_mille_per_effort:.6g}',
            '60B2h for 1 N m': lambda each: f'{each.direction * 1e3 / each.rated_torque:.6g}'}
    if parts['DYNAMIXEL']:
        columns['Goal Position at zero'] = lambda each: f'{each.counts_at_zero:g}'
    if parts['CURRENT']:
        columns['Goal Current for 1 N m of the motor'] = lambda each: (
            f'{each.direction / (each.current_unit * each.torque_constant):.6g}')
    rows = [list(columns), ['---'] * len(columns), *(
        [column(each) for column in columns.values()] for each in found)]
    return '\n'.join(f'| {" | ".join(row)} |' for row in rows)


def _goals(parameters: Parameters, found: list[Amplifier]) -> str:
    """Return Goal Position at the limits of each leg, in words."""
    limits = [parameters[name] for name in parameters.leg_kind.position_limits]
    if any(limit is None for limit in limits):
        return 'not set'
    zero = parameters[parameters.leg_kind.zero] if parameters.leg_kind.zero else np.zeros(6)
    return ', '.join(
        ' to '.join(f'{each.counts_at_zero + each.counts_per_unit * (limit[n] - zero[n]):.0f}'
                    for limit in limits) for n, each in enumerate(found))
