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

"""What the node says of the external wrench, a status of its own once a measurement has come."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
import math

from stewart_dynamics.parameters import Parameters
from stewart_dynamics.runtime.diagnostics import ERROR, Held, Level, OK, STALE, Status, WARN
from stewart_dynamics.runtime.external_wrench import Estimate, Overload
from stewart_dynamics.runtime.rejections import Rejection

_NAME = 'external wrench'
_QUANTITIES = {'external_wrench.force_max': ('force', 'N'),
               'external_wrench.moment_max': ('moment', 'N m')}
_COMPONENTS = ('force x (N)', 'force y (N)', 'force z (N)', 'moment x (N m)', 'moment y (N m)',
               'moment z (N m)')


class WrenchDiagnostics:
    """
    Gathers what becomes of measured legs; times are seconds of a steady clock.

    Parameters
    ----------
    parameters : Parameters
        Names of the legs, and timeout.

    """

    def __init__(self, parameters: Parameters) -> None:
        self._joints = parameters['joints']
        self._timeout = parameters['setpoint.timeout']
        self._begun = self._heard = -math.inf
        self._estimated = 0
        self._estimated_at = -math.inf
        self._estimate: Estimate | None = None
        self._target: Sequence[float] | None = None
        self._refusals: Counter[Rejection] = Counter()
        self._held = Held()
        self._level = OK  # in the last report

    def heard(self, now: float) -> None:
        """Note that a message came."""
        self._heard = now
        if self._begun == -math.inf:
            self._begun = now

    def refused(self, refusal: Rejection, details: str, now: float) -> None:
        """Note a refusal."""
        self._refusals[refusal] += 1
        self._held.see(Level(WARN, f'{refusal.topic}: {refusal.reason} ({details})'), now)

    def estimated(self, estimate: Estimate, target: Sequence[float] | None, now: float) -> bool:
        """
        Note an estimate and the last setpoint; return whether the level has changed.

        The setpoint is a row of motion, none where there is none yet.
        """
        self._estimate, self._target = estimate, target
        if estimate.wrench is None:
            return False
        self._estimated += 1
        self._estimated_at = now
        self._held.see(Level(ERROR if estimate.overloads else OK,
                             ', '.join(map(_words, estimate.overloads))), now, lasting=True)
        return self._held.at(now).level != self._level

    def level(self, now: float) -> int:
        """Return the present level."""
        return self._state(now).level

    def report(self, now: float) -> tuple[Status, ...]:
        """Return the status, none before a measurement has come."""
        level, message, _ = self._state(now)
        self._level = level
        if self._begun == -math.inf:
            return ()
        values = [('wrenches', str(self._estimated))]
        if self._estimated:
            values.append(('age of the last (s)', f'{now - self._estimated_at:.3f}'))
        if self._estimate is not None:
            values += self._numbers(self._estimate)
        values += [(f'rejected, {topic}: {reason}', str(n))
                   for (topic, reason), n in sorted(self._refusals.items())]
        return Status(_NAME, level, message or 'no overload', tuple(values)),

    def _state(self, now: float) -> Level:
        held = self._held.at(now)
        if now - max(self._begun, self._estimated_at) <= self._timeout or (
                self._begun == -math.inf):
            return held
        silent = now - self._heard
        return Level(STALE, 'no wrench: ' + (
            f'measured_legs silent for {silent:.1f} s' if silent > self._timeout
            else held.message or 'measurements are farther apart than setpoint.timeout, '
            f'{self._timeout:g} s'))

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
    """Return how far two rows of motion are apart [m] and turned against each other [rad]."""
    # The difference of two rotations has the norm sqrt(8) sin(angle / 2), exact for small angles.
    half = math.dist(motion[3:12], target[3:12]) / math.sqrt(8.0)
    return math.dist(motion[:3], target[:3]), 2.0 * math.asin(min(half, 1.0))


def _words(overload: Overload) -> str:
    quantity, unit = _QUANTITIES[overload.limit]
    return (f'{quantity} {overload.value:.6g} {unit} is {overload.value - overload.bound:.6g} '
            f'{unit} beyond {overload.limit}')
