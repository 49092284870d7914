# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The statuses of measured legs and of longer tasks, each present after its first event.

``external wrench`` after the first measurement; ``planned trajectory`` and ``payload`` after the
first outcome of a task.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
import math

from stewart_dynamics.estimation.confidence_level import INTERVAL
from stewart_dynamics.external_wrench.estimate import Estimate, Overload, WRENCH_LIMITS
from stewart_dynamics.external_wrench.measured_legs import MEASURED_LEGS
from stewart_dynamics.external_wrench.payload import Payload, PayloadOutcome, rows_of
from stewart_dynamics.legs.kind import Named
from stewart_dynamics.mechanics.drives.measured_efforts import leaves_wrench
from stewart_dynamics.mechanics.rows import PARTS_OF_WRENCH
from stewart_dynamics.node.diagnostics.levels import (
    ERROR, Level, LogLine, NEVER, OK, POSSIBLE_ERRORS, REJECTED, STALE, Status, StatusPart, Values,
    WARN)
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.planned.trajectory_messages import PlannedOutcome
from stewart_dynamics.possible_errors.hypothesis import PossibleError
from stewart_dynamics.setpoints.consistency import MessageError

_OVERLOAD = 'overload'  # a cause of a level
_COMPONENTS = [f'{part} {axis} ({unit})'
               for part, unit in PARTS_OF_WRENCH.items() for axis in 'xyz']
_LONG = 2.0  # duration of a task above which it is logged [s]


class ExternalWrenchDiagnostics(StatusPart):
    """Notes estimates from measured legs, and rejections of measurements."""

    name = 'external wrench'

    def __init__(self, parameters: Parameters) -> None:
        super().__init__(POSSIBLE_ERRORS, _OVERLOAD, REJECTED)
        self._joints, self._effort = parameters.joints, parameters.leg_kind.effort
        self._timeout = parameters.setpoint.timeout
        # Times of the first and the last message, and of the last one that was not rejected.
        self._begun = self.heard_at = self.used_at = NEVER
        self._estimated = 0
        self._estimated_at = NEVER
        self._estimate: Estimate | None = None
        self._target: Sequence[float] | None = None
        self._error: PossibleError | None = None

    def heard(self, now: float) -> None:
        """Note that a message has arrived."""
        self.heard_at = now
        if self._begun == NEVER:
            self._begun = now

    def estimated(self, estimate: Estimate, target: Sequence[float] | None, now: float) -> None:
        """Note an estimate, and the row of motion of the last setpoint; None without one."""
        self._estimate, self._target = estimate, target
        self.used_at = now
        if estimate.possible_error != self._error:
            self._error = estimate.possible_error
            self.note_errors([] if self._error is None else [_message_error(self._error)], now)
        if estimate.wrench is not None:
            self._estimated += estimate.published is not None
            self._estimated_at = now
            self.held.see(Level(ERROR if estimate.overloads else OK,
                                ', '.join(map(_words, estimate.overloads))), now, _OVERLOAD)

    def level(self, now: float) -> int:
        """Return the present level."""
        if self._begun == NEVER:
            return OK
        return STALE if self._is_stale(now) else self.held.level(now)

    def status(self, now: float) -> Status | None:
        """Return the status; None before the first measurement."""
        if self._begun == NEVER:
            return None
        values = [('wrenches', str(self._estimated))]
        if self._estimated_at != NEVER:
            values.append(('age of the last (s)', f'{now - self._estimated_at:.3f}'))
        if self._estimate is not None:
            values += self._numbers(self._estimate)
        values += self._error_values()
        message = (self._no_wrench(now) if self._is_stale(now)
                   else self.held.at(now).message or 'no overload')
        return Status(self.name, self.level(now), message, values + self._rejection_values())

    def _is_stale(self, now: float) -> bool:
        return now - max(self._begun, self._estimated_at) > self._timeout

    def silence(self, now: float) -> str:
        """Return since when no message has come, if that is too long and one had come."""
        silent = now - self.heard_at
        return (f'{MEASURED_LEGS} silent for {silent:.1f} s'
                if self._timeout < silent < math.inf else '')

    def _no_wrench(self, now: float) -> str:
        return 'no wrench: ' + (
            self.silence(now) or self.held.of(REJECTED, now).message
            or f'measurements are farther apart than setpoint.timeout, {self._timeout:g} s')

    def _numbers(self, estimate: Estimate) -> Values:
        values = []
        if estimate.wrench is not None and estimate.differences is not None:
            values = [*((f'{part} ({unit})', f'{getattr(estimate, part):.6g}')
                        for part, unit in PARTS_OF_WRENCH.items()),
                      *((key, f'{value:.6g}') for key, value in zip(
                          _COMPONENTS, estimate.wrench, strict=True))]
            effort, leg = max(zip(estimate.differences, self._joints, strict=True),
                              key=lambda each: abs(each[0]))
            values += [(f'largest measured - model {self._effort.name} of a leg '
                        f'({self._effort.unit})', f'{effort:.6g}'), ('its leg', leg)]
        if self._target is not None:
            distance, angle = _apart(estimate.motion, self._target)
            values += [('distance from the last setpoint (m)', f'{distance:.6g}'),
                       ('turn from the last setpoint (rad)', f'{angle:.6g}')]
        return values


def _message_error(found: PossibleError) -> MessageError:
    """Return the possible error in the efforts for the status."""
    wrench = '' if leaves_wrench(found) else '; no external wrench is published'
    return MessageError(MEASURED_LEGS, f'possible error: {found.text}{wrench}', values=(
        ('possible error in the measurements', found.what),))


def _apart(motion: Sequence[float], target: Sequence[float]) -> tuple[float, float]:
    """Return the distance [m] and the angle [rad] between the poses of two rows of motion."""
    # The difference of two rotations has the norm sqrt(8) sin(angle / 2), exact for small angles.
    half = math.dist(motion[3:12], target[3:12]) / math.sqrt(8.0)
    return math.dist(motion[:3], target[:3]), 2.0 * math.asin(min(half, 1.0))


def _words(overload: Overload) -> str:
    quantity = WRENCH_LIMITS[overload.limit]
    unit = PARTS_OF_WRENCH[quantity]
    return (f'{quantity} {overload.value:.6g} {unit} is {overload.value - overload.bound:.6g} '
            f'{unit} above {overload.limit}')


class _OutcomeDiagnostics(StatusPart):
    """Keeps the status of the last outcome of a task, and the log lines since the last report."""

    def __init__(self) -> None:
        super().__init__()
        self._last: Status | None = None
        self._lines: list[LogLine] = []

    def level(self, now: float) -> int:
        """Return the level of the last outcome."""
        return self._last.level if self._last else OK

    def status(self, now: float) -> Status | None:
        """Return the status; None before the first outcome."""
        return self._last

    def log_lines(self, status: Status, now: float) -> list[LogLine]:
        """Return the lines since the last call."""
        lines, self._lines = self._lines, []
        return lines


class PlannedTrajectoryDiagnostics(_OutcomeDiagnostics):
    """Counts planned trajectories."""

    name = 'planned trajectory'

    def __init__(self) -> None:
        super().__init__()
        self._counts = Counter[str]()

    def done(self, outcome: PlannedOutcome, seconds: float) -> None:
        """Note an outcome, and the time from the message to the outcome [s]."""
        level = ERROR if outcome.reason else WARN if outcome.warning else OK
        counts = self._counts
        counts[f'rejected: {outcome.reason}' if outcome.reason else 'accepted'] += 1
        self._last = Status(self.name, level, outcome.message, [
            ('accepted', str(counts['accepted'])),
            ('rejected', str(counts.total() - counts['accepted'])),
            *((reason, str(n)) for reason, n in sorted(counts.items()) if reason != 'accepted'),
            *outcome.values, ('time it took (s)', f'{seconds:.3f}')])
        message = outcome.message + (f' (took {seconds:.1f} s)' if seconds > _LONG else '')
        lines = self._changed(level, message)
        if outcome.reason:  # each one is logged
            lines = [LogLine(ERROR, f'{self.name} {message}', outcome.reason)]
        elif seconds > _LONG:
            lines = [LogLine(level, f'{self.name}: {message}')]
        self._lines += lines


class PayloadDiagnostics(_OutcomeDiagnostics):
    """Requests to identify the payload."""

    name = 'payload'

    def __init__(self, parameters: Parameters) -> None:
        super().__init__()
        self._effort = parameters.leg_kind.effort

    def done(self, outcome: PayloadOutcome, seconds: float) -> None:
        """Note an outcome, and the duration of the task [s]."""
        payload = outcome.payload
        level, message = (OK, f'identified from {payload.seconds:.1f} s') if payload else (
            WARN, f'not identified: {outcome.message}')
        self._last = Status(self.name, level, message, [
            *(_values_of(payload, self._effort) if payload else ()),
            ('time it took (s)', f'{seconds:.3f}')])
        self._lines += self._changed(level, message)


def _values_of(payload: Payload, effort: Named) -> Values:
    fitted, values = payload.fitted, []
    for name, unit, value, half, known in rows_of(fitted):
        values.append((f'{name} ({unit})', f'{value:.6g}'))
        values.append((f'{name}, half of the {INTERVAL} ({unit})',
                       f'{half:.3g}' if known else 'not identified'))
    return [*values,
            ('mass less platform.mass (kg)', f'{fitted.body.mass - payload.given.mass:.6g}'),
            (f'RMS of measured - model {effort.name}, with these ({effort.unit})',
             f'{fitted.residual:.4g}')]
