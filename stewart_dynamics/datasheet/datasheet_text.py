# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The datasheet as text: figures, sentences, and a few lines for the terminal.

Figures are in the units of vendors' sheets, rounded toward zero.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from decimal import Context, Decimal, ROUND_DOWN
import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.datasheet.datasheet_record import (
    AlongAxes, Box, Claim, Datasheet, HeldPayload, JudgedMotion, Limited, MotionBetween, RatedPose,
    RemainingMotion, StuckLeg, UncertainPayload)
from stewart_dynamics.datasheet.pose_ratings import AXES
from stewart_dynamics.datasheet.possible_motion import in_words
from stewart_dynamics.mechanics.limits import (
    LIMITS, POSE, short_name, SINGULARITY, TORQUE_CONTINUOUS)
from stewart_dynamics.parameters.table import FIXED
from stewart_dynamics.records import Value
from stewart_dynamics.reporting.pages import MOST_PLAIN, typeset

_DIGITS = 4
# Smaller numbers are written with a power of ten.
_LEAST_PLAIN = 1e-6
_TOWARD_ZERO, _ROUNDING = Context(_DIGITS, ROUND_DOWN), 1 + Decimal('1e-12')


class Unit(NamedTuple):
    """Unit in which SI values are written."""

    name: str
    factor: float


MM, DEGREE = Unit('mm', 1e3), Unit('°', math.degrees(1.0))
# Units in which the excesses of limits are written.
_OF_LIMITS = {short_name(name): {'m': MM, 'rad': DEGREE, '': Unit('', 1.0)}[limit.quantity.unit]
              for name, limit in LIMITS.items() if limit.depends == POSE}
# Units in which stiffnesses and torques of drives are written.
OF_DRIVES = {'N/m': Unit('N/µm', 1e-6), 'N m/rad': Unit('N m/mrad', 1e-3)}
TORQUES = {'Nm': Unit('N m', 1.0), 'kgcm': Unit('kg cm', 100.0 / 9.80665)}
LINEAR = {'travel': MM, 'velocity': Unit('mm/s', 1e3), 'acceleration': Unit('m/s²', 1.0),
          'force': Unit('N', 1.0), 'stiffness': Unit('N/µm', 1e-6)}
ANGULAR = {'travel': DEGREE, 'velocity': Unit('°/s', DEGREE.factor),
           'acceleration': Unit('°/s²', DEGREE.factor), 'moment': Unit('N m', 1.0),
           'stiffness': Unit('N m/mrad', 1e-3)}
_NAMES = {short_name(name): limit.phrase for name, limit in LIMITS.items()} | {
    short_name(TORQUE_CONTINUOUS): 'continuous torque of a motor'}


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
    # a value that is exact in four digits is not to lose its last one by rounding errors
    shortened = _TOWARD_ZERO.create_decimal(Decimal(value) * _ROUNDING)
    plain = _LEAST_PLAIN <= abs(value) < MOST_PLAIN
    return typeset(f'{shortened:,f}' if plain else f'{shortened:.{_DIGITS - 1}e}')


def both_ways(values: AlongAxes, axis: str, unit: Unit) -> str:
    """Return the extents of an axis to minus and plus: ±1.5, or −1.2 … +1.5."""
    minus, plus = (each.value for each in values.both(axis))
    return span((None if minus is None else -minus, plus), unit)


def span(bounds: Sequence[float | None], unit: Unit) -> str:
    """Return a range in a unit: ±1.5, or −1.2 … +1.5."""
    a, b = (down(None if each is None else each * unit.factor) for each in bounds)
    if a.lstrip('−') == b:
        return b if b in '0–' else f'±{b}'
    # the space that does not break keeps the dots on the first line of a narrow column
    return f'{a}\u00a0… +{b}' if b not in '0–' else f'{a}\u00a0… {b}'


def numbers(values: Any, factor: float = 1.0, unit: str = '') -> str:
    """Return numbers in five digits of the largest one, and six equal ones as one."""
    given = factor * np.ravel(np.asarray(values, dtype=float))
    size = max(float(np.abs(given).max()), 1e-7)
    # a home pose has rounding errors behind these digits
    given = np.round(given, 4 - math.floor(math.log10(size))) + 0.0  # no -0
    texts = [f'{each:.5g}' for each in given.tolist()]
    if len(set(texts)) == 1 and len(texts) == 6:
        texts = texts[:1]
    return f'{", ".join(texts)}{unit}'.replace('-', '−')


def pose_row(pose: RatedPose) -> tuple[str, str]:
    """Return name and numbers of the rated pose."""
    return 'Rated pose' + (', home' if pose.home else ''), (
        numbers(pose.position, 1e3, ' mm') + '; ' + numbers(pose.angles, DEGREE.factor, '°'))


def sheet_text(sheet: Datasheet) -> str:
    """Return rated pose, travel, payload, and whether box and motion are possible."""
    at_once, motion = sheet.at_once, sheet.motion
    lines = [f'{sheet.name}: ' + ': '.join(pose_row(sheet.pose)).lower(),
             'travel of each axis alone' + (', all at once' if at_once else '')]
    for axis in AXES:
        unit = unit_of(axis, 'travel')
        line = f'  {axis:<3} {both_ways(sheet.travel, axis, unit):>20} {unit.name:<3}'
        if at_once:
            line += f' {span(at_once.all.ranges[axis], unit):>20} {unit.name}'
        lines.append(line.rstrip())
    for kind, payload in sheet.payloads:
        any_orientation, value = rated_payload(payload, sheet.parameters)
        limit = f', by {_limit(payload)}' if payload.limit and not any_orientation else ''
        lines.append(f'payload at the pivot, at rest{kind and f", {kind}"}{any_orientation}: '
                     f'{down(value)} kg{limit}')
    if sheet.uncertainty:
        lines.append(uncertain_line(sheet.uncertainty))
    if sheet.stuck_leg:
        lines += stuck_lines(sheet.stuck_leg)
    if sheet.box:
        lines.append(f'box {possible(sheet.box)}: {box_verdict(sheet.box)}')
    if motion:
        lines += [f'motion {possible(motion)}: {motion_verdict(motion)}',
                  f'  {setpoints_used(motion.samples, motion.rejected)}',
                  *(f'  {notice}' for notice in motion.notices)]
        if not motion.mistakes and motion.payload and motion.payload.value is not None:
            lines.append('  payload at the pivot that can be added in the motion: '
                         f'{down(motion.payload.value)} kg')
    return '\n'.join(lines)


def uncertain_line(found: UncertainPayload) -> str:
    """Return the band of the payload over the hexapods that the file admits."""
    count, band = found.hexapods, found.payload
    if band.low is None:
        return f'payload of {count} hexapods that the file admits: not limited'
    text = (f'payload at the pivot, at rest, of 95 % of {count} hexapods that the file admits: '
            f'{down(band.low)} to {down(band.high)} kg')
    return text + (f'; {100.0 * found.overloaded / count:.3g} % carry no payload'
                   if found.overloaded else '')


def stuck_lines(found: StuckLeg) -> list[str]:
    """Return lines about the motions that remain with a stuck leg."""
    lines = [f'{found.leg} stuck: five motions remain, x y z [m/s] rx ry rz [rad/s]']
    for motion, velocity, load in map(stuck_row, found.motions):
        lines.append(f'  {motion:<52} {velocity:>8} times, {load}')
    if found.payload is not None:
        lines.append(f'  payload at the pivot, at rest: {down(found.payload.value)} kg')
    return lines


def stuck_row(row: RemainingMotion) -> tuple[str, str, str]:
    """Return motion, speed and load of a motion that remains, as text."""
    speed, *loads = ('–' if each is None else down(each.value)
                     for each in (row.velocity, row.load_plus, row.load_minus))
    return (' '.join(typeset(f'{each + 0.0:+.3f}') for each in row.motion), speed,
            f'+{loads[0]} / −{loads[1]}')


def payloads_in_words(sheet: Datasheet) -> str:
    """Return the payloads at rest with the limits that end them; empty without a limit."""
    return ', '.join(
        f'{kind and f"{kind} "}{down(each.value)} kg'
        + (f' by {_limit(each)}' if each.limit else '') for kind, each in sheet.payloads)


def rated_payload(payload: HeldPayload, parameters: Mapping[str, Value],
                  ) -> tuple[str, float | None]:
    """Return a payload at rest; of any orientation of the base, and so named, if that moves."""
    if parameters['base.source'] != FIXED and payload.any_orientation is not None:
        return ', base in any orientation', payload.any_orientation
    return '', payload.value


def possible(found: Claim) -> str:
    """Return whether a box or motion is possible, in words."""
    if isinstance(found, JudgedMotion) and found.mistakes:
        return 'not judged, its messages contradict each other or the parameters'
    return 'possible' if found.possible else 'not possible'


def setpoints_used(samples: int, rejected: int) -> str:
    """Return how many setpoints a motion has, and how many messages were rejected."""
    text = f'{samples} setpoints'
    return f'{text} used, {rejected} messages rejected' if rejected else text


def motion_verdict(found: JudgedMotion) -> str:
    """Return how much faster a motion can be, and its limit; or why it is not judged."""
    if found.mistakes:
        return '; '.join(found.mistakes)
    text, larger = _fastest(found), found.amplitude
    if found.factor != 0.0 and larger and larger.value is not None:
        text += (f'; up to {down(larger.value)} times as large about its first pose, limited '
                 f'by {_limit(larger)}')
    changes = in_words(found.possible_with)
    return f'{text}; {changes}' if changes else text


def _fastest(found: JudgedMotion | MotionBetween) -> str:
    """Return the factor of a motion's speed, and its limit."""
    factor = found.factor
    if factor is None:
        return 'no limit at any speed'
    where = _limit(found) + ('' if found.at_s is None else f' at {found.at_s:.3f} s')
    if factor == 0.0:
        return f'at no speed, by {where}'
    return f'up to {down(factor)} times as fast, limited by {where}'


def between_setpoints(found: JudgedMotion) -> str:
    """Return a sentence on the limits between the setpoints of a motion."""
    between = found.between_setpoints
    if between is None or found.mistakes:
        return 'Limits are checked at the setpoints.'
    if between.reason is not None:
        return f'Checked at the setpoints, not between them: {between.reason}.'
    same = (between.limit, between.leg, down(between.factor)) == (
        found.limit, found.leg, down(found.factor))
    return ('Speed between the setpoints as in a planned trajectory: '
            f'{"the same" if same else _fastest(between)}.')


def box_verdict(found: Box) -> str:
    """Return how much larger a box can be, or the limit that is exceeded in it."""
    factor = '' if found.factor is None else f'up to {down(found.factor)} times as large'
    if found.possible:
        return f'all of it is reachable, {factor}' if factor else 'all of it is reachable'
    moved = ', '.join(
        f'{axis} {down(each * unit.factor)} {unit.name}'
        for axis, each in found.displacement.items()
        if each and (unit := unit_of(axis, 'travel')))
    text = f'{_exceeded(found)} at {moved or "the rated pose"}'
    return text + (f'; reachable {factor}' if factor else '')


def _limit(found: Limited) -> str:
    text = limit_name(found.limit or '')
    return f'{text} ({found.leg})' if found.leg else text


def _exceeded(found: Box) -> str:
    """Return by how much a box exceeds a limit."""
    excess, limit = found.excess, _limit(found)
    if excess is None:
        return f'{limit} between the rated pose and a pose'
    if excess <= 0.0:
        return f'not proven: no pose exceeds a limit as far as searched, {limit} is nearest'
    if found.limit == SINGULARITY:
        return f'{limit}: condition number exceeded by {down(excess)}'
    unit = _OF_LIMITS[found.limit or '']
    return f'{limit} exceeded by {down(excess * unit.factor)} {unit.name}'.rstrip()
