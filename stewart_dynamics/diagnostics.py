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

"""
What the node says of itself: one status each for setpoints, singularity and limits.

A check knows no ROS: it is told what happened and returns words; the node makes messages.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from stewart_dynamics.parameters import Parameters
from stewart_dynamics.setpoints import Refusal
from stewart_dynamics.step import Excess, Output

OK, WARN, ERROR, STALE = range(4)

# A level holds for this long after its cause was last seen, so that a machine that dances on
# a limit is not reported a thousand times in a second.
_HOLD_SECONDS = 1.0


class Status(NamedTuple):
    """One diagnostic_msgs/DiagnosticStatus; keys of values carry their unit."""

    name: str
    level: int
    message: str
    values: tuple[tuple[str, str], ...]


class _Held:
    """Levels and their words for as long as they hold; the worst one counts."""

    def __init__(self) -> None:
        self._seen: dict[int, tuple[float, str]] = {}

    def see(self, level: int, message: str, now: float) -> None:
        self._seen[level] = now + _HOLD_SECONDS, message

    def at(self, now: float) -> tuple[int, str]:
        return max(((level, message) for level, (until, message) in self._seen.items()
                    if now < until), default=(OK, ''))


class Diagnostics:
    """
    Gathers what happens to setpoints and what they give.

    Times are seconds of a steady clock.

    Parameters
    ----------
    parameters : Parameters
        Names of the legs, timeout and thresholds.
    topics : sequence of str
        The setpoint topics that are joined.
    now : float
        From when silence counts.

    """

    def __init__(self, parameters: Parameters, topics: Sequence[str], now: float) -> None:
        self.parameters = parameters
        self._heard = dict.fromkeys(topics, now)
        self._silent = dict.fromkeys(topics, True)
        self._refusals: Counter[Refusal] = Counter()
        self._answered = 0
        self._answered_before = (now, 0)
        self._answered_at = now
        self._output: Output | None = None
        self._worst_condition = 1.0
        self._refused, self._singularity, self._limits = _Held(), _Held(), _Held()
        self._levels: tuple[int, ...] = ()
        # of the last output, singularity and limits: they hold until another one comes
        self._states: tuple[tuple[int, str], tuple[int, str]] = (OK, ''), (OK, '')
        self.writers: dict[str, int] = {}

    def heard(self, topic: str, now: float) -> None:
        """Note that a message came on a setpoint topic."""
        self._heard[topic] = now
        self._silent[topic] = False

    def refused(self, refusal: Refusal, details: str, now: float) -> None:
        """Note a refusal."""
        self._refusals[refusal] += 1
        self._refused.see(WARN, f'{refusal.topic}: {refusal.reason} ({details})', now)

    def answered(self, output: Output, now: float) -> bool:
        """Note an output, and return whether a level has changed with it."""
        self._answered += 1
        self._answered_at = now
        self._output = output
        self._worst_condition = max(self._worst_condition, output.condition)
        self._states = _singularity_of(output), self._limits_of(output)
        for held, (level, message) in zip((self._singularity, self._limits), self._states,
                                          strict=True):
            if level > OK:
                held.see(level, message, now)
        return self.level_changed(now)

    def level_changed(self, now: float) -> bool:
        """Return whether any level is another than in the last report."""
        return self._current_levels(now) != self._levels

    def report(self, now: float) -> tuple[Status, Status, Status]:
        """Return the three statuses; the rate is counted since the last report."""
        self._levels = self._current_levels(now)
        statuses = (self._report_setpoints(now), self._report_singularity(now),
                    self._report_limits(now))
        self._answered_before = (now, self._answered)
        self._worst_condition = self._output.condition if self._output else 1.0
        return statuses

    def _current_levels(self, now: float) -> tuple[int, ...]:
        return (self._setpoint_level(now)[0], self._level_of(0, now)[0],
                self._level_of(1, now)[0])

    def _level_of(self, which: int, now: float) -> tuple[int, str]:
        held = (self._singularity, self._limits)[which]
        return max(self._states[which], held.at(now), key=lambda state: state[0])

    def _limits_of(self, output: Output) -> tuple[int, str]:
        if output.excesses:
            return ERROR, ', '.join(map(self._words, output.excesses))
        return OK, ''

    def _setpoint_level(self, now: float) -> tuple[int, str]:
        timeout = self.parameters['setpoint.timeout']
        tolerance = self.parameters['setpoint.sync_tolerance']
        if now - self._answered_at > timeout or not self._answered:
            silent = [f'{topic} ' + ('never came' if self._silent[topic]
                                     else f'silent for {now - at:.1f} s')
                      for topic, at in self._heard.items() if now - at > timeout
                      or self._silent[topic]]
            why = ', '.join(silent) or (
                'all topics speak, but none is joined: their stamps differ by more than '
                f'setpoint.sync_tolerance, {tolerance:g} s')
            return STALE, f'no setpoint: {why}'
        several = [f'{topic} has {n} writers' for topic, n in self.writers.items() if n > 1]
        if several:
            return ERROR, ', '.join(several)
        return self._refused.at(now)

    def _report_setpoints(self, now: float) -> Status:
        level, message = self._setpoint_level(now)
        before, answered = self._answered_before
        rate = (self._answered - answered) / (now - before) if now > before else 0.0
        values = [('setpoints answered', str(self._answered)), ('rate (Hz)', f'{rate:.1f}')]
        if self._answered:
            values.append(('age of the last (s)', f'{now - self._answered_at:.3f}'))
        values += [(f'{topic}: last heard (s ago)', 'never' if self._silent[topic]
                    else f'{now - at:.3f}') for topic, at in self._heard.items()]
        values += [(f'{topic}: writers', str(n)) for topic, n in self.writers.items()]
        values += [(f'refused, {topic}: {reason}', str(n))
                   for (topic, reason), n in sorted(self._refusals.items())]
        return Status('setpoints', level, message or 'answered', tuple(values))

    def _report_singularity(self, now: float) -> Status:
        level, message = self._level_of(0, now)
        output = self._output
        if output is None:
            return Status('singularity', level, 'no setpoint yet', ())
        forces = output.unit_load_forces
        worst = max(range(6), key=forces.__getitem__)
        crossing = output.singularity.time_to_crossing
        return Status('singularity', level, message or 'clear', (
            ('det(J) (m^3)', f'{output.determinant:.9g}'),
            ('d(det(J))/dt (m^3/s)', f'{output.determinant_rate:.9g}'),
            ('time to crossing (s)', f'{crossing:.3f}' if crossing < 1e6 else 'none'),
            ('crossings', str(output.singularity.crossings)),
            ('condition number', f'{output.condition:.6g}'),
            ('worst condition number since the last report', f'{self._worst_condition:.6g}'),
            ('largest leg force under a unit load', f'{forces[worst]:.6g}'),
            ('its leg', self.parameters['joints'][worst])))

    def _report_limits(self, now: float) -> Status:
        level, message = self._level_of(1, now)
        output = self._output
        if output is None:
            return Status('limits', level, 'no setpoint yet', ())
        values = [(f'{leg}: length (m)', f'{length:.6g}') for leg, length in
                  zip(self.parameters['joints'], output.lengths, strict=True)]
        values += [(f'{leg}: rate (m/s)', f'{rate:.6g}') for leg, rate in
                   zip(self.parameters['joints'], output.rates, strict=True)]
        if output.demanded_forces is not None:
            values += [(f'{leg}: force (N)', f'{force:.6g}') for leg, force in
                       zip(self.parameters['joints'], output.demanded_forces, strict=True)]
        return Status('limits', level, message or 'all held', tuple(values))

    def _words(self, excess: Excess) -> str:
        quantity, unit = {'limits.length_min': ('length', 'm'),
                          'limits.length_max': ('length', 'm'),
                          'limits.velocity_max': ('rate', 'm/s'),
                          'limits.force_max': ('force', 'N')}[excess.limit]
        beyond = abs(abs(excess.value) - excess.bound)
        how = ', clipped' if quantity == 'force' else ''
        return (f'{self.parameters["joints"][excess.leg]}: {quantity} {excess.value:.6g} {unit} '
                f'is {beyond:.6g} {unit} beyond {excess.limit}{how}')


def _singularity_of(output: Output) -> tuple[int, str]:
    state = output.singularity
    if output.demanded_forces is None:
        return ERROR, 'J_inv cannot be solved: no forces'
    if state.stopped:
        return ERROR, 'inside stop_condition' + (
            ': forces suppressed' if output.forces is None else '')
    return (WARN, state.cause.value) if state.warning else (OK, '')
