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

"""The status ``external wrench``, present after the first measurement."""

from __future__ import annotations

from collections.abc import Sequence
import math

from stewart_dynamics.external_wrench.estimate import Estimate, Overload
from stewart_dynamics.node.diagnostics.periodic_report import (
    ERROR, Level, NEVER, OK, STALE, Status, StatusPart)
from stewart_dynamics.parameters.table import Parameters

_QUANTITIES = {'external_wrench.force_max': ('force', 'N'),
               'external_wrench.moment_max': ('moment', 'N m')}
_REJECTED, _OVERLOAD = '', 'overload'  # causes of a level
_COMPONENTS = ('force x (N)', 'force y (N)', 'force z (N)', 'moment x (N m)', 'moment y (N m)',
               'moment z (N m)')


class ExternalWrenchDiagnostics(StatusPart):
    """Notes estimates from measured legs, and rejections of measurements."""

    name = 'external wrench'

    def __init__(self, parameters: Parameters) -> None:
        super().__init__(_OVERLOAD, _REJECTED)
        self._joints = parameters['joints']
        self._timeout = parameters['setpoint.timeout']
        self._begun = self._heard = self._used_at = self._estimated_at = NEVER
        self._estimated = 0
        self._estimate: Estimate | None = None
        self._target: Sequence[float] | None = None
        self._reported = OK  # the level in the last report

    def heard(self, now: float) -> None:
        """Note that a message has arrived."""
        self._heard = now
        if self._begun == NEVER:
            self._begun = now

    def silence(self, now: float) -> float:
        """Return the time since the last message [s]."""
        return now - self._heard

    def age(self, now: float) -> float:
        """Return the age of the last measurement that was not rejected [s]."""
        return now - self._used_at

    def estimated(self, estimate: Estimate, target: Sequence[float] | None, now: float) -> bool:
        """
        Note an estimate, and the row of motion of the last setpoint; None without a setpoint.

        Return whether the level has changed since the last report.
        """
        self._estimate, self._target = estimate, target
        self._used_at = now
        if estimate.wrench is None:
            return False
        self._estimated += 1
        self._estimated_at = now
        self.held.see(Level(ERROR if estimate.overloads else OK,
                            ', '.join(map(_words, estimate.overloads))), now, _OVERLOAD)
        return self.held.level(now) != self._reported

    def level(self, now: float) -> int:
        """Return the present level."""
        if self._begun == NEVER:
            return OK
        return STALE if self._is_stale(now) else self.held.level(now)

    def values(self, now: float) -> list[tuple[str, str]] | None:
        """Return keys and values; None before the first measurement."""
        if self._begun == NEVER:
            return None
        values = [('wrenches', str(self._estimated))]
        if self._estimated:
            values.append(('age of the last (s)', f'{now - self._estimated_at:.3f}'))
        if self._estimate is not None:
            values += self._numbers(self._estimate)
        return values + self.rejections()

    def status(self, now: float) -> Status | None:
        """Return the status for a report, and remember its level."""
        self._reported = self.level(now)
        return super().status(now)

    def _is_stale(self, now: float) -> bool:
        last = max(self._begun, self._estimated_at)
        return last != NEVER and now - last > self._timeout

    def state(self, now: float) -> Level:
        """Return the present level and its cause."""
        if not self._is_stale(now):
            held = self.held.at(now)
            return Level(held.level, held.message or 'no overload')
        silent = now - self._heard
        return Level(STALE, 'no wrench: ' + (
            f'measured_legs silent for {silent:.1f} s' if silent > self._timeout
            else self.held.of(_REJECTED, now).message
            or f'measurements are farther apart than setpoint.timeout, {self._timeout:g} s'))

    def _numbers(self, estimate: Estimate) -> list[tuple[str, str]]:
        values = []
        if estimate.wrench is not None and estimate.differences is not None:
            values = [('force (N)', f'{estimate.force:.6g}'),
                      ('moment (N m)', f'{estimate.moment:.6g}'),
                      *((key, f'{value:.6g}') for key, value in zip(
                          _COMPONENTS, estimate.wrench, strict=True))]
            differences = estimate.differences
            worst = max(range(6), key=lambda leg: abs(differences[leg]))
            values += [('largest measured - model force of a leg (N)',
                        f'{differences[worst]:.6g}'), ('its leg', self._joints[worst])]
        if self._target is not None:
            distance, angle = _apart(estimate.motion, self._target)
            values += [('distance from the last setpoint (m)', f'{distance:.6g}'),
                       ('turn from the last setpoint (rad)', f'{angle:.6g}')]
        return values


def _apart(motion: Sequence[float], target: Sequence[float]) -> tuple[float, float]:
    """Return the distance [m] and the angle [rad] between the poses of two rows of motion."""
    # The difference of two rotations has the norm sqrt(8) sin(angle / 2), exact for small angles.
    half = math.dist(motion[3:12], target[3:12]) / math.sqrt(8.0)
    return math.dist(motion[:3], target[:3]), 2.0 * math.asin(min(half, 1.0))


def _words(overload: Overload) -> str:
    quantity, unit = _QUANTITIES[overload.limit]
    return (f'{quantity} {overload.value:.6g} {unit} is {overload.value - overload.bound:.6g} '
            f'{unit} above {overload.limit}')
