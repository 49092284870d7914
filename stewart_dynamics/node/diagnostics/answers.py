# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The statuses of answers: ``timing``, ``singularity`` and ``limits``.

Processing times and setpoints dropped for lack of time; distance from a singularity, cause of the
warning and crossings; for each kind of limit a state, a line and a peak of its own. Outputs are
those of a single setpoint.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
import math

from stewart_dynamics.arrays import Array, NANOSECOND, SECOND
from stewart_dynamics.mechanics.drives.servos import outside_servos, with_servos
from stewart_dynamics.mechanics.kinematics.pose_errors import find_pose_error
from stewart_dynamics.mechanics.limits import (
    Exceedance, JUMP, LEVER_MIN, LIMITS, limits_of, TORQUE_MAX, TORQUE_SPEED)
from stewart_dynamics.mechanics.rows import (
    CONDITION, DETERMINANT, DETERMINANT_RATE, UNIT_LOAD_FORCES)
from stewart_dynamics.mechanics.singularity_warning import (
    Cause, HYSTERESIS, Singularity, UNSOLVABLE_CONDITION)
from stewart_dynamics.node.diagnostics.levels import (
    ERROR, Level, LogLine, OK, OK_LEVEL, PERIOD, REJECTED, Status, StatusPart, WARN)
from stewart_dynamics.parameters.table import Parameters, SUPPRESS_FORCES
from stewart_dynamics.setpoints.rejections import DROPPED, NOT_JOINED, Rejection
from stewart_dynamics.setpoints.step import Batch, LEVER_TIMES, Outputs, WARNING_STATE

_CROSSING, _NEARNESS = 'crossing', 'nearness'  # causes of the level of singularity
# Causes of the level of limits: it is predicted; an angle without a pulse.
_DEAD_CENTRE, _SERVOS = 'dead centre', 'servos'


@dataclass
class Second:
    """Answers of at least one second, which ends with a report."""

    begin: float
    times: list[float] = field(default_factory=list)  # from the last message to the answer [s]
    condition: float = 1.0  # the largest condition number


class Answers:
    """Answered setpoints: their number, the last two outputs, and the last two seconds."""

    def __init__(self, parameters: Parameters, now: float) -> None:
        self.parameters = parameters  # may be replaced at any time
        self.number = 0
        self.at = now  # time of the last one
        self.outputs: Outputs | None = None
        self.row: list[float] = []  # that of the last outputs, as numbers: far faster to look at
        self.before: Outputs | None = None  # those before the last ones
        self.second, self.second_before = Second(now), Second(now)
        self._timeout = parameters.setpoint.timeout

    def add(self, outputs: Outputs, seconds: float, now: float) -> None:
        """Note an answer, and its processing time."""
        self.number += 1
        self.at = now
        self.before, self.outputs = self.outputs, outputs
        self.row = outputs.rows[0].tolist()
        self.second.times.append(seconds)
        self.second.condition = max(self.second.condition, self.row[CONDITION])

    def end_second(self, now: float) -> None:
        """End the present second after a report: reports may be much less than one apart."""
        if now - self.second.begin >= 1.0:
            self.second_before, self.second = self.second, Second(now)

    def stale(self, now: float) -> bool:
        """Return whether there is no recent answer."""
        return not self.number or now - self.at > self._timeout

    def state(self, state: Level, otherwise: str, now: float) -> Level:
        """Return a state of the answers: with another message if empty, with the age if stale."""
        if not self.number:
            return Level(state.level, state.message or 'no setpoint yet')
        age = f' (of the last setpoint, {now - self.at:.1f} s ago)' if self.stale(now) else ''
        return Level(state.level, (state.message or otherwise) + age)


class TimingDiagnostics(StatusPart):
    """The processing times of the last one or two seconds; dropped setpoints are a warning."""

    name = 'timing'

    def __init__(self, answers: Answers, of_setpoints: Counter[Rejection]) -> None:
        super().__init__(REJECTED)
        self._answers = answers
        self._of_setpoints = of_setpoints

    def status(self, now: float) -> Status:
        """Return the status."""
        values = []
        if times := sorted(self._answers.second_before.times + self._answers.second.times):
            # ``statistics`` and ``numpy.median`` would load a megabyte of code.
            median = 0.5 * (times[(len(times) - 1) // 2] + times[len(times) // 2])
            values = [('processing time, median (us)', f'{median * 1e6:.0f}'),
                      ('processing time, largest (us)', f'{times[-1] * 1e6:.0f}')]
        for key, reason in (('dropped', DROPPED), ('incomplete', NOT_JOINED)):
            values.append((key, str(sum(n for rejection, n in self._of_setpoints.items()
                                        if rejection.reason == reason))))
        return Status(self.name, *self._answers.state(self.held.at(now), 'on time', now), values)


def singularity_state(row: Sequence[float], parameters: Parameters) -> Level:
    """Return the level of a row of outputs, and its cause with the numbers of the row."""
    condition = row[CONDITION]
    if condition >= UNSOLVABLE_CONDITION:
        return Level(ERROR, f'J_inv cannot be solved: no {parameters.leg_kind.effort.field}')
    cause, stopped, *_ = row[WARNING_STATE]
    if not cause and not stopped:
        return OK_LEVEL
    state = Singularity.of(row[WARNING_STATE])
    if state.stopped:
        efforts = parameters.leg_kind.effort
        is_suppressed = not math.isnan(row[efforts.columns.start]) and (
            parameters.singularity.action == SUPPRESS_FORCES)
        suppressed = f': {efforts.field} suppressed' if is_suppressed else ''
        return Level(ERROR, f'inside stop_condition{suppressed}: ' + _condition(
            condition, 'stop_condition', parameters.singularity.stop_condition))
    if state.cause is Cause.CROSSED:
        return Level(ERROR, 'det(J) crossed zero since the last setpoint')
    if state.cause is Cause.CONDITION:
        return Level(WARN, _condition(
            condition, 'warn_condition', parameters.singularity.warn_condition))
    time, bound = state.time_to_crossing, parameters.singularity.warn_time
    ends = '' if time < bound else f' (the warning ends above {bound / HYSTERESIS:g} s)'
    return Level(WARN, f'crossing of det(J) = 0 predicted in {time:.3g} s, singularity.warn_time '
                 f'is {bound:g} s{ends}')


def _condition(condition: float, threshold: str, bound: float) -> str:
    if condition >= bound:
        return f'condition number {condition:.4g} exceeds singularity.{threshold}, {bound:g}'
    return (f'condition number {condition:.4g} has exceeded singularity.{threshold}, {bound:g}, '
            f'and is not yet below {HYSTERESIS * bound:g}')


class SingularityDiagnostics(StatusPart):
    """Notes the distance of setpoints from a singularity."""

    name = 'singularity'

    def __init__(self, answers: Answers) -> None:
        super().__init__(_CROSSING, _NEARNESS)
        self._answers = answers
        self._other_side = ''  # the possible error with which the motion begins there
        self._crossed = False  # with the last setpoint
        self._crossings: list[str] = []  # since the last report
        self._crossing_logged_at = -PERIOD
        self._largest = 1.0

    def begins(self, error: str, other_side: bool) -> None:
        """Note the possible error in the first pose, and whether it is beyond a singularity."""
        self._other_side = error if other_side else ''

    def answered(self, now: float) -> bool:
        """Note the last outputs; return whether they must be reported at once, at any level."""
        row = self._answers.row
        self._largest = max(self._largest, row[CONDITION])
        state = singularity_state(row, self._answers.parameters)
        if state.level == OK and self._other_side:
            state = Level(WARN, self._other_side)
        cause, stopped, *_ = row[WARNING_STATE]
        if cause != Cause.CROSSED:
            self.held.see(state, now, _NEARNESS)
            if self._crossed:
                self.held.see(OK_LEVEL, now, _CROSSING)
                self._crossed = False
            return False
        self._crossed, self._other_side = True, ''
        crossing = Level(ERROR, self._crossing())
        self._crossings.append(crossing.message)
        self.held.see(crossing, now, _CROSSING)
        inside = stopped or row[CONDITION] >= UNSOLVABLE_CONDITION
        self.held.see(state if inside else OK_LEVEL, now, _NEARNESS)
        return now - self._crossing_logged_at >= PERIOD

    def status(self, now: float) -> Status:
        """Return the status."""
        answers, row, values = self._answers, self._answers.row, []
        if row:
            forces, condition = row[UNIT_LOAD_FORCES], row[CONDITION]
            worst = max(range(6), key=forces.__getitem__)
            state = Singularity.of(row[WARNING_STATE])
            crossing = state.time_to_crossing
            of_the_last_second = max(
                condition, answers.second.condition, answers.second_before.condition)
            values = [
                ('det(J) (m^3)', f'{row[DETERMINANT]:.9g}'),
                ('d(det(J))/dt (m^3/s)', f'{row[DETERMINANT_RATE]:.9g}'),
                ('time to crossing (s)', f'{crossing:.3f}' if crossing < 1e6 else 'none'),
                ('crossings', str(state.crossings)),
                ('condition number', f'{condition:.6g}'),
                ('worst condition number of the last second', f'{of_the_last_second:.6g}'),
                ('worst condition number since activation', f'{self._largest:.6g}'),
                ('largest leg force under a unit load', f'{forces[worst]:.6g}'),
                ('its leg', answers.parameters.joints[worst])]
        return Status(self.name, *answers.state(self.held.at(now), 'clear', now), values)

    def log_lines(self, status: Status, now: float) -> list[LogLine]:
        """Return the crossing since the last report, and the change of level besides."""
        lines = []
        if self._crossings:
            count = len(self._crossings)
            how_many = f' (the last of {count} crossings)' if count > 1 else ''
            lines = [LogLine(ERROR, f'{self.name}: {self._crossings[-1]}{how_many}')]
            self._crossings = []
            self._crossing_logged_at = now
        level, message = self.held.of(_NEARNESS, now)
        return lines + self._changed(level, message or 'clear')

    def _crossing(self) -> str:
        """Return when det(J) crossed zero, on a straight line between two setpoints."""
        answers = self._answers
        assert answers.outputs is not None
        at = int(answers.outputs.stamps[0])
        seconds, nanoseconds = divmod(at, SECOND)
        stamp = f'stamp {seconds}.{nanoseconds:09d} s'
        passed = 0 if answers.before is None else at - int(answers.before.stamps[0])
        if answers.before is None or passed <= 0:
            return f'det(J) crossed zero before {stamp}'
        now, then = abs(answers.row[DETERMINANT]), abs(answers.before.determinants[0])
        return (f'det(J) crossed zero {passed * NANOSECOND * now / (now + then):.3g} s before '
                f'{stamp}')


class LimitsDiagnostics(StatusPart):
    """Notes which limits setpoints exceed, predicted ones, and the largest effort demanded."""

    name = 'limits'

    def __init__(self, answers: Answers) -> None:
        super().__init__(*LIMITS, _DEAD_CENTRE, _SERVOS)
        self._answers = answers
        self._joints = answers.parameters.joints
        self._kind = kind = answers.parameters.leg_kind
        limits = limits_of(answers.parameters)
        self._demanded = *limits.loads, TORQUE_MAX
        self._of_pose = *kind.position_limits, JUMP  # those that a wrong pose exceeds
        self._with_levers = LEVER_MIN in limits.legs
        self._predicted = False  # a dead centre
        self._with_servos = with_servos(answers.parameters)
        self._without_pulses = 0  # setpoints with an angle outside the points of its servo
        self._setpoints = Counter[str]()  # that exceed each limit
        self._worst: dict[str, Exceedance] = {}
        self._suppressed = 0
        self._exceeding = False
        self._pose_error = ''  # in the pose with which legs became too long or too short
        self._largest_effort, self._its_leg = 0.0, 0

    def answered(self, setpoint: Batch, exceedances: Sequence[Exceedance], now: float) -> None:
        """Note the last outputs, the limits they exceed, and their setpoint."""
        efforts = self._answers.row[self._kind.effort.columns]
        largest = abs(self._largest_effort)
        # These two take less time than abs of each; nan is never larger.
        if max(efforts) > largest or min(efforts) < -largest:
            self._its_leg = max(range(6), key=lambda leg: abs(efforts[leg]))
            self._largest_effort = efforts[self._its_leg]
        if self._with_levers:
            self._predict(now)
        if self._with_servos:
            self._note_servos(now)
        if exceedances or self._exceeding:
            self._exceeding = bool(exceedances)
            self._note_exceedances(setpoint, exceedances, now)

    def _predict(self, now: float) -> None:
        """Note whether a leg comes to its dead centre soon."""
        times, bound = self._answers.row[LEVER_TIMES], (
            self._answers.parameters.singularity.warn_time)
        time, leg = _first_dead_centre(times)
        if time < bound:
            words = (f'dead centre predicted: {LIMITS[LEVER_MIN].quantity.name} of '
                     f'{self._joints[leg]} falls to {LEVER_MIN} in {time:.3g} s, '
                     f'singularity.warn_time is {bound:g} s')
            self.held.see(Level(WARN, words), now, _DEAD_CENTRE)
        elif self._predicted:
            self.held.see(OK_LEVEL, now, _DEAD_CENTRE)
        self._predicted = time < bound

    def _note_servos(self, now: float) -> None:
        """Note whether an angle is outside the points of its servo: there are no pulses then."""
        assert self._answers.outputs is not None
        outside = outside_servos(
            self._answers.parameters, self._answers.outputs.drive_positions[0])
        self._without_pulses += bool(outside)
        self.held.see(Level(ERROR, f'no servo_pulses: {outside}') if outside else OK_LEVEL,
                      now, _SERVOS)

    def _note_exceedances(
            self, setpoint: Batch, exceedances: Sequence[Exceedance], now: float) -> None:
        row = self._answers.row
        published, demanded = (
            row[each.start] for each in (self._kind.published, self._kind.effort.columns))
        suppressed = math.isnan(published) and not math.isnan(demanded) and (
            self._answers.parameters.limits.action == SUPPRESS_FORCES) and any(
                not LIMITS[each.limit].clips for each in exceedances)
        self._suppressed += suppressed
        if not any(self.held.of(name, now).level for name in self._of_pose):
            # At most once in a second: it may take a millisecond.
            self._pose_error = find_pose_error(
                self._answers.parameters, setpoint.motions[0].tolist(),
                first=self._answers.number == 1)
        for name in LIMITS:
            exceeded = [each for each in exceedances if each.limit == name]
            if not exceeded:
                self.held.see(OK_LEVEL, now, name)
                continue
            worst = max(exceeded, key=_excess)
            words = self._words(worst, len(exceeded) - 1)
            if suppressed and not LIMITS[name].clips:
                words += f'; {self._kind.effort.field} suppressed'
            if self._pose_error and name in self._of_pose:
                words = f'{self._pose_error}; {words}'
            self.held.see(Level(ERROR, words), now, name)
            self._setpoints[name] += 1
            self._worst[name] = max(worst, self._worst.get(name, worst), key=_excess)

    def status(self, now: float) -> Status:
        """Return the status, with all causes of its level."""
        values = []
        if self._answers.outputs is not None:
            values = [(f'{leg}: {quantity}', f'{number:.6g}')
                      for quantity, numbers in self._of_legs(self._answers.outputs)
                      for leg, number in zip(self._joints, numbers, strict=False)
                      if not math.isnan(number)]
            if self._with_levers:
                time, leg = _first_dead_centre(self._answers.row[LEVER_TIMES])
                values += [('time to dead centre (s)', 'none' if time == math.inf
                            else f'{time:.3f}')]
                values += [('leg of the time to dead centre', self._joints[leg])] * (
                    time < math.inf)
        if self._largest_effort:
            effort = self._kind.effort
            values += [
                (f'largest {effort.name} demanded since activation ({effort.unit})',
                 f'{self._largest_effort:.6g}'),
                (f'leg of the largest {effort.name} demanded', self._joints[self._its_leg])]
        for name in (each for each in LIMITS if each in self._worst):
            values += [('jumps' if name == JUMP else f'setpoints that exceed {name}',
                        str(self._setpoints[name])),
                       (f'worst since activation, {name}', self._words(self._worst[name]))]
        if self._suppressed:
            values.append((f'setpoints without {self._kind.effort.field}, by limits.action',
                           str(self._suppressed)))
        if self._without_pulses:
            values.append(('setpoints outside the points of servos', str(self._without_pulses)))
        return Status(self.name, *self._answers.state(self.held.at(now), 'all held', now), values)

    def _of_legs(self, outputs: Outputs) -> list[tuple[str, Array]]:
        """Return each quantity that is computed, with its unit, and six numbers."""
        numbers = {limit: values[0] for limit, values in outputs.values().items()
                   if limit not in (self._kind.position_limits[0], TORQUE_SPEED)}
        return [(LIMITS[limit].quantity.name + ' demanded' * (limit in self._demanded)
                 + f' ({LIMITS[limit].quantity.unit})' * bool(LIMITS[limit].quantity.unit), each)
                for limit, each in numbers.items()]

    def log_lines(self, status: Status, now: float) -> list[LogLine]:
        """Return the changes of each kind of limit."""
        lines = []
        for name, worst in self._worst.items():
            level, message = self.held.of(name, now)
            lines += self._changed(level, message or (
                f'{name}: no longer exceeded; {self._setpoints[name]} setpoints since activation, '
                f'worst: {self._words(worst)}'), name)
        if self._with_levers:
            level, message = self.held.of(_DEAD_CENTRE, now)
            lines += self._changed(level, message or 'no dead centre predicted', _DEAD_CENTRE)
        if self._with_servos:
            level, message = self.held.of(_SERVOS, now)
            lines += self._changed(level, message or 'servo_pulses again', _SERVOS)
        return lines

    def _words(self, worst: Exceedance, others: int = 0) -> str:
        words = worst.words(self._joints) + ', clipped' * LIMITS[worst.limit].clips
        if worst.limit == LEVER_MIN:
            words = f'near a dead centre: {words}'
        return words + (f', and {others} other leg{"s" * (others > 1)}' if others else '')


def _excess(exceedance: Exceedance) -> float:
    return exceedance.excess


def _first_dead_centre(times: Sequence[float]) -> tuple[float, int]:
    """Return the shortest time to a dead centre [s], of legs not near one; inf: none; its leg."""
    return min((time or math.inf, leg) for leg, time in enumerate(times))
