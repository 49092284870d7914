# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
Statements about a replayed bag, worded once for terminal, report and the table of many bags.

Each has a level; the worst level of a card's statements gives its color and title.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
import math
from operator import itemgetter
from typing import NamedTuple

from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.mechanics.limits import (
    BASE_ANGLE_MAX, CLEARANCE_MIN, Exceedance, LEVER_MIN, LIMITS as ALL_LIMITS, LOAD, OF_MOTORS,
    PLATFORM_ANGLE_MAX, SPEED_MAX, TEMPERATURE_RISE_MAX, TORQUE_MAX, TORQUE_SPEED)
from stewart_dynamics.mechanics.rows import PARTS_OF_WRENCH
from stewart_dynamics.records import key_of, Record
from stewart_dynamics.replay.bag_summary import (
    BagSummary, BaseWrench, Force, LegLoads, Measured, Moment, Motors, NeededMotor, Setpoints,
    Singularity)
from stewart_dynamics.replay.motor_loads import NEEDS
from stewart_dynamics.reporting.pages import decimals_of, fixed
from stewart_dynamics.setpoints.rejections import BASE_NOT_KNOWN, OUT_OF_REACH, Rejection

(READING, MISSING, REJECTED, INPUTS, LIMITS, MOTOR_LIMITS, JOINTS, LOADS, MOTORS, SINGULARITY,
 MEASURED) = (
    'reading', 'missing', 'rejected', 'inputs', 'limits', 'motor limits', 'joints', 'loads',
    'motors', 'singularity', 'measured')
LEVELS = ('none', 'good', 'warn', 'bad')  # the worst last; the first: information
_CARDS = {
    (READING, MISSING, REJECTED): {
        'good': 'The whole bag was read', 'warn': 'Not all messages could be used',
        'bad': 'Results are incomplete'},
    (INPUTS,): {'none': 'Inputs', 'bad': 'Inputs contradict each other or the parameters'},
    (LIMITS, MOTOR_LIMITS): {
        'none': 'No limits were checked', 'good': 'All limits are held',
        'warn': 'It is not proven that limits are held', 'bad': 'Limits are exceeded'},
    (SINGULARITY,): {'none': 'Singularity', 'good': 'Clear of singularities',
                     'warn': 'A singularity is near', 'bad': 'A singularity is reached'},
    (MOTORS, MOTOR_LIMITS): {
        'none': 'Motors', 'good': 'Motors are large enough',
        'warn': 'Motors may be too small', 'bad': 'Limits of the motors are exceeded'},
    (MEASURED,): {'none': 'Measured {efforts}', 'good': 'Measured {efforts}',
                  'warn': 'Measured {efforts} differ'}}
# Maximum number of reasons of rejection.
_LISTED = 3
# Measured forces differ if the residual's RMS is a larger part of theirs.
_DIFFERENT = 0.05


class Statement(NamedTuple):
    """A sentence, which may have a time in it."""

    topic: str
    level: str
    text: str
    at: float | None = None  # follows the text [s]
    plot: str = ''  # plot of the report that shows this time
    end: str = ''  # follows the time

    @property
    def line(self) -> str:
        """Return the whole sentence."""
        return f'{self.text}{"" if self.at is None else at_time(self.at, 2)}{self.end}'


def at_time(seconds: float, digits: int) -> str:
    """Return the words for a time since the first setpoint, which other topics may precede."""
    if round(seconds, digits) < 0.0:
        return f' {-seconds:.{digits}f} s before the first setpoint'
    return f' at t = {seconds:.{digits}f} s'


def statements(summary: BagSummary) -> list[Statement]:
    """Return all statements about a bag; each topic's most important ones first."""
    return [*motion_statements(summary), *_messages(summary), *_measured(summary.measured)]


def motion_statements(summary: BagSummary) -> list[Statement]:
    """Return the statements about the answered setpoints, for which no bag is needed."""
    points, kind = summary.setpoints, summary.kind
    found = [
        *_inputs(summary), *_limits(summary), *_joints(summary.legs),
        *_loads(summary.base_wrench, kind), *_motors(summary),
        *_singularity(summary.singularity, kind)] if points.answered else []
    return [*found, *_answered(points, kind.effort.field)]


class Card(NamedTuple):
    """A card of the report: its level, its title, and the statements on it."""

    level: str
    title: str
    statements: list[Statement]


def cards(summary: BagSummary) -> dict[str, Card]:
    """Return the cards of the report by their first topic."""
    about, found, shown = statements(summary), {}, set[Statement]()
    efforts = summary.kind.effort.field
    for topics, titles in _CARDS.items():
        on_it = [each for each in about if each.topic in topics]
        level = max((each.level for each in on_it), key=LEVELS.index, default='none')
        # Limits that are held are listed on one card alone.
        listed = [each for each in on_it if each.level != 'good' or each not in shown]
        shown.update(on_it)
        found[topics[0]] = Card(level, titles[level].format(efforts=efforts), listed)
    return found


def plural(number: int, what: str) -> str:
    """Return a number with its noun."""
    return f'{number} {what}' if number == 1 else f'{number} {what}s'


def values_of(legs: Mapping[str, Record], key: str) -> list[tuple[float, str]]:
    """Return the known values under a key of summary.json, each with its leg."""
    return [(value, name) for name, leg in legs.items() if key in leg.keys()
            if (value := leg.under(key)) is not None]


FIRST = itemgetter(0)


def _answered(points: Setpoints, efforts: str) -> Iterator[Statement]:
    yield Statement(READING, 'good', f'{plural(points.answered, "setpoint")} in '
                                     f'{points.duration_s:.2f} s{_interruptions(points)}')
    if unknown := points.base_unknown:
        yield Statement(
            READING, 'warn', f'{BASE_NOT_KNOWN} in {plural(unknown, "setpoint")}, first',
            points.base_unknown_first_at_s, 'base_force', f': they have no {efforts}')


def _messages(summary: BagSummary) -> Iterator[Statement]:
    for part in summary.missing:
        yield Statement(MISSING, 'bad', f'missing: {part}')
    rejected = sorted(summary.rejected, key=lambda each: -each.count)
    for each in rejected[:_LISTED]:
        yield Statement(REJECTED, 'warn', Rejection(each.topic, each.reason).counted(
            each.count).words(''))
    if others := sum(each.count for each in rejected[_LISTED:]):
        yield Statement(REJECTED, 'warn', f'{others} not used for other reasons')


def _interruptions(points: Setpoints) -> str:
    text = ''
    if points.gaps:
        text += f', of them {points.gaps_s:.2f} s in {plural(points.gaps, "gap")}'
    if points.restarts:
        text += f', {plural(points.restarts, "restart")}'
    return text


def _inputs(summary: BagSummary) -> Iterator[Statement]:
    """Yield the possible errors in the messages."""
    for each in summary.mistakes:
        begun = each.first_at_s or None
        yield Statement(INPUTS, 'bad', f'{each.topic}: {each.text}'
                        + '; begins' * (begun is not None), begun)


def _limits(summary: BagSummary) -> Iterator[Statement]:
    points = summary.setpoints
    for name in dict.fromkeys(each.limit for each in summary.limits):
        of_legs = [each for each in summary.limits if each.limit == name]
        most = max(of_legs, key=lambda each: Exceedance(
            name, 0, math.nan if each.worst is None else each.worst, each.bound).excess)
        others = f' and {plural(len(of_legs) - 1, "other leg")}' if len(of_legs) > 1 else ''
        quantity = ALL_LIMITS[name].quantity
        unit = f' {quantity.unit}' if quantity.unit else ''
        at_worst = (' at that speed' if name == TORQUE_SPEED
                    else ', near a dead centre' if name == LEVER_MIN else '')
        yield Statement(
            _topic(name), 'bad', f'{name}, {most.bound:g}{unit}{at_worst}, exceeded '
            f'by {most.leg}{others}: {most.worst:.6g}{unit} at worst, first',
            min(each.first_at_s for each in of_legs), quantity.key)
    if points.jumps:
        kind: LegKind = summary.kind
        yield Statement(
            LIMITS, 'bad', f'{plural(points.jumps, "jump")}, first',
            points.jumps_first_at_s, ALL_LIMITS[kind.position_limits[1]].quantity.key,
            f': the legs cannot follow within {kind.rate_limit}')
    for name in summary.limits_not_checked:
        why = ': velocities are not known; --differentiate computes them from the poses'
        causes = ((summary.singularity.unsolved, 'J_inv cannot be solved'),
                  (points.base_unknown, BASE_NOT_KNOWN))
        of_forces = ALL_LIMITS[name].clips or ALL_LIMITS[name].depends == LOAD
        if of_forces and any(number for number, _ in causes):
            why = ' ' + '; '.join(f'in {plural(number, "setpoint")}: {cause}'
                                  for number, cause in causes if number)
        yield Statement(_topic(name), 'warn', f'{name} could not be checked{why}')
    unreachable = any(each.reason == OUT_OF_REACH for each in summary.rejected)
    yield from _uncertain(summary)
    problems = points.jumps or summary.limits or summary.limits_not_checked or unreachable
    if not problems and _has_margins(summary.legs.values()):
        yield (Statement(LIMITS, 'warn', 'no limit was met by inputs that contradict each other')
               if summary.mistakes else _held(summary, LIMITS, 'all limits'))


def _uncertain(summary: BagSummary) -> Iterator[Statement]:
    """Yield what the uncertainty of the file does to loads and their limits."""
    found = summary.uncertainty
    if not found:
        return
    effort, count = summary.kind.effort, found.hexapods
    if highest := [(leg.effort_peak_high, name, leg.effort_peak_low)
                   for name, leg in found.legs.items() if leg.effort_peak_high is not None]:
        high, leg, low = max(highest, key=FIRST)
        yield Statement(
            LIMITS, 'none', f'peak {effort.name} of {leg}: {low:.4g} to {high:.4g} {effort.unit} '
            f'in 95 % of {count} hexapods that the file admits')
    for each in found.limits:
        yield Statement(
            _topic(each.limit), 'warn' if each.hexapods else 'good',
            f'{each.limit} is exceeded in {100.0 * each.share:.3g} % of the hexapods that the '
            f'file admits ({each.hexapods} of {count})' if each.hexapods else
            f'{each.limit} is held in all {count} hexapods that the file admits')


def _held(summary: BagSummary, topic: str, limits: str) -> Statement:
    """Return that limits are held by demands, and whether measured efforts contradict that."""
    measured = summary.measured
    if not measured:
        return Statement(topic, 'good', f'within {limits}')
    demands = f'within {limits} by the demands of the setpoints'
    if measured.likely_mistake is None:
        return Statement(topic, 'good', demands)
    return Statement(topic, 'warn', f'{demands}, which the measured efforts contradict (possible '
                                    f'error: {measured.likely_mistake.what})')


def _topic(limit: str) -> str:
    return MOTOR_LIMITS if limit in OF_MOTORS else LIMITS


def _joints(legs: Mapping[str, LegLoads]) -> Iterator[Statement]:
    """Yield the largest angles of the joints at both ends, and the smallest clearance."""
    for joint, limit in (('base', BASE_ANGLE_MAX), ('platform', PLATFORM_ANGLE_MAX)):
        angle, _, margin = LegLoads.keys_of_limit(limit)
        angles, margins = values_of(legs, angle), values_of(legs, margin)
        if angles and margins:
            (largest, most), (smallest, least) = max(angles, key=FIRST), min(margins, key=FIRST)
            yield Statement(
                JOINTS, 'none', f'{joint} joints: {_angle(largest)} at most, {most}',
                legs[most].peak(limit)[1], '', f'; margin {_angle(smallest)}'
                + (f', {least}' if least != most else ''))
    clearance, _, margin = LegLoads.keys_of_limit(CLEARANCE_MIN)
    if clearances := values_of(legs, clearance):
        smallest, least = min(clearances, key=FIRST)
        yield Statement(
            JOINTS, 'none', f'clearance between legs: {smallest:.4g} m at least, {least}',
            legs[least].peak(CLEARANCE_MIN)[1], '', f'; margin {legs[least].under(margin):.4g} m')


def _angle(radians: float) -> str:
    return f'{radians:.4g} rad ({math.degrees(radians):.1f} deg)'


def _loads(found: BaseWrench, kind: LegKind) -> Iterator[Statement]:
    loads: tuple[Force | Moment, ...] = found.force, found.moment
    for (name, unit), each in zip(PARTS_OF_WRENCH.items(), loads, strict=True):
        if each.peak is not None:
            decimals = decimals_of(kind.decimals, [each.peak])
            rms = '-' if each.rms is None else fixed(each.rms, decimals)
            peak = fixed(each.peak, decimals)
            yield Statement(LOADS, 'none', f'{name} on the base: {peak} {unit} at most',
                            each.peak_at_s, f'base_{name}', f' (RMS {rms})')


def _motors(summary: BagSummary) -> Iterator[Statement]:
    motors = summary.motors
    if not motors:
        return
    legs = motors.legs
    over = [each for each in values_of(legs, 'torque_continuous_margin_n_m') if each[0] < 0.0]
    if over:
        margin, worst = min(over, key=FIRST)
        others = f' and {plural(len(over) - 1, "other motor")}' if len(over) > 1 else ''
        yield Statement(
            MOTORS, 'warn', f'drive.torque_continuous, exceeded by the RMS torque of {worst}'
            f'{others}: {legs[worst].torque_rms_n_m:.4g} N m, by {-margin:.4g} N m')
    elif values_of(legs, 'torque_continuous_margin_n_m') and not summary.mistakes:
        yield _held(summary, MOTORS, 'drive.torque_continuous')
    if _motors_hold(motors, summary):
        yield _held(summary, MOTOR_LIMITS, 'all limits of the motors')
    for name, peak, of in ((TORQUE_MAX, 'torque_peak', ''), (SPEED_MAX, 'speed_peak', ''),
                           (TEMPERATURE_RISE_MAX, 'temperature_rise_max', ' of the winding')):
        quantity = ALL_LIMITS[name].quantity
        if values := values_of(legs, key_of(peak, quantity.unit)):
            value, most = max(values, key=lambda each: abs(each[0]))
            yield Statement(
                MOTORS, 'none',
                f'{quantity.name}{of}: {value:.4g} {quantity.unit} at most, {most},',
                legs[most].under(f'{peak}_at_s'), quantity.key)
    if bus := motors.bus:
        yield Statement(MOTORS, 'none', f'power of the bus: {bus.power_peak_w:.4g} W at most,',
                        bus.power_peak_at_s, 'bus_power',
                        f'; {bus.regenerated_peak_w:.4g} W back to it at most')
    # Near a singularity peaks depend on the sampling.
    known = not summary.singularity.warnings and not summary.mistakes
    if known and (text := needed_words(motors.needed)):
        yield Statement(MOTORS, 'none', f'motor needed: {text}')


def _motors_hold(motors: Motors, summary: BagSummary) -> bool:
    """Return whether a limit of the motors is given, and all are checked and held."""
    problems = [*(each.limit for each in summary.limits), *summary.limits_not_checked]
    return _has_margins(motors.legs.values()) and not summary.mistakes and not any(
        limit in OF_MOTORS for limit in problems)


def _has_margins(legs: Iterable[Record]) -> bool:
    """Return whether a limit of the legs, or of their motors, is given."""
    return any(each.under(key) is not None for each in legs for key in each.keys()
               if '_margin_' in key and not key.startswith('torque_continuous'))


def needed_words(needed: NeededMotor) -> str:
    """Return the motor that is needed in words; empty if it is not known."""
    words = [f'{value:.4g} {need.unit} {need.kind}'.rstrip() for key, need in NEEDS.items()
             if (value := needed.under(key)) is not None]
    return f'{", ".join(words)}, with a margin of {100.0 * (needed.margin - 1.0):.3g} %' * bool(
        words)


def _singularity(found: Singularity, kind: LegKind) -> Iterator[Statement]:
    efforts = kind.effort.field
    crossings, spans = found.crossings_at_s, found.warnings_from_to_s
    if crossings:
        more = f' and {plural(found.crossings - 1, "time")} more' if len(crossings) > 1 else ''
        yield Statement(SINGULARITY, 'bad', 'det(J) crossed zero', crossings[0], 'determinant',
                        f'{more}: {efforts} grow without bound there')
    if found.unsolved:
        yield Statement(SINGULARITY, 'bad', 'J_inv cannot be solved in '
                        f'{plural(found.unsolved, "setpoint")}: they have no {efforts}')
    if spans:
        begun, ended = spans[0]
        ahead = [time - begun for time in crossings
                 if begun <= time and (ended is None or time <= ended)]
        more = f' and {plural(found.warnings - 1, "time")} more' if len(spans) > 1 else ''
        yield Statement(
            SINGULARITY, 'warn', 'singularity warning', begun, 'condition',
            (f', {ahead[0]:.2f} s before the crossing' if ahead else '')
            + f'{more}, for {found.warning_s:.2f} s in all')
    if found.suppressed:
        yield Statement(SINGULARITY, 'none', f'{efforts} were suppressed in '
                        f'{plural(found.suppressed, "setpoint")}')
    if not crossings:
        yield Statement(SINGULARITY, 'good', 'det(J) did not cross zero')
    if not spans:
        yield Statement(SINGULARITY, 'good', 'no singularity warning')
    yield Statement(
        SINGULARITY, 'none', f'det(J) nearest zero: {found.determinant_nearest_m3:.6g} m^3',
        found.determinant_nearest_at_s, 'determinant')
    if found.condition_max is not None:
        yield Statement(
            SINGULARITY, 'none', f'condition number of J_inv: {found.condition_max:.4g} at '
            'most,', found.condition_max_at_s, 'condition')


def _measured(measured: Measured | None) -> Iterator[Statement]:
    if not measured:
        return
    compared, contacts = measured.setpoints_compared, measured.contacts
    differs = (contacts.count or measured.likely_mistake
               or (measured.residual_share or 0.0) > _DIFFERENT)
    yield Statement(MEASURED, 'none' if not compared else 'warn' if differs else 'good',
                    measured.headline)
    if contacts.count:
        yield Statement(MEASURED, 'warn', f'{plural(contacts.count, "contact")}, first',
                        contacts.strongest[0].from_s, 'external_force')
