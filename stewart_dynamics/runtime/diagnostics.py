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
What the node says of itself: one status each for setpoints, singularity, limits and timing.

Other parts of the node add their own, see Part. A check knows no ROS: it is told what happened
and returns words; the node makes messages.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from operator import attrgetter
from statistics import median
from typing import NamedTuple, Protocol

from stewart_dynamics.mechanics.limits import Exceedance
from stewart_dynamics.mechanics.singularity import Cause
from stewart_dynamics.parameters import Parameters
from stewart_dynamics.runtime.rejections import DROPPED, NOT_JOINED, Rejection
from stewart_dynamics.runtime.step import Output

OK, WARN, ERROR, STALE = range(4)

# A level holds for this long after its cause was last seen, so that a machine that dances on
# a limit is not reported a thousand times in a second.
_HOLD_SECONDS = 1.0


class Level(NamedTuple):
    """How grave something is, and what it is in words."""

    level: int
    message: str
    weight: int = 0
    """Of two of the same level the weightier one is said."""

    @property
    def gravity(self) -> tuple[int, int]:
        """By which the gravest is found."""
        return self.level, self.weight


_FINE = Level(OK, '')


class Status(NamedTuple):
    """One diagnostic_msgs/DiagnosticStatus; keys of values carry their unit."""

    name: str
    level: int
    message: str
    values: tuple[tuple[str, str], ...]


class Held:
    """A state, and what was worse for as long as that holds."""

    def __init__(self) -> None:
        self._state = _FINE
        self._seen: dict[tuple[int, int], tuple[float, Level]] = {}

    def see(self, state: Level, now: float, lasting: bool = False) -> None:
        """Note a state; a lasting one is there until the next, others for their time."""
        if lasting:
            self._state = state
        if state.level > OK:
            self._seen[state.gravity] = now + _HOLD_SECONDS, state

    def at(self, now: float) -> Level:
        """Return the worst that holds."""
        if not self._seen:
            return self._state
        self._seen = {gravity: held for gravity, held in self._seen.items() if now < held[0]}
        return max([self._state, *(state for _, state in self._seen.values())],
                   key=attrgetter('gravity'))


class Part(Protocol):
    """What has a status of its own once there is something to say of it."""

    def level(self, now: float) -> int:
        """Return the present level."""

    def report(self, now: float) -> tuple[Status, ...]:
        """Return the status, none while there is nothing to say."""


class _Second:
    """What is gathered in a second."""

    def __init__(self, begin: float) -> None:
        self.begin = begin
        self.processing: list[float] = []
        """How long each setpoint took [s]."""
        self.worst_condition = 1.0


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
    others : sequence of Part
        What else is reported, behind these.

    """

    def __init__(self, parameters: Parameters, topics: Sequence[str], now: float,
                 others: Sequence[Part] = ()) -> None:
        self.parameters = parameters
        self.writers: dict[str, int] = {}
        """Of each setpoint topic."""
        self.readers: dict[str, int] = {}
        """Of the topics that controllers read."""
        self.namesakes: tuple[str, int] = '', 1
        """The node's name, and how many have it."""
        self._others = others
        self._heard = dict.fromkeys(topics, now)
        self._silent = dict.fromkeys(topics, True)
        self._refusals: Counter[Rejection] = Counter()
        self._answered = 0
        self._answered_at = now
        self._output: Output | None = None
        self._second, self._second_before = _Second(now), _Second(now)
        self._refused, self._singularity, self._limits, self._timing = (
            Held(), Held(), Held(), Held())
        self._levels: tuple[int, ...] = ()

    def heard(self, topic: str, now: float) -> None:
        """Note that a message came on a setpoint topic."""
        self._heard[topic] = now
        self._silent[topic] = False

    def refused(self, refusal: Rejection, details: str, now: float) -> None:
        """Note a refusal."""
        self._refusals[refusal] += 1
        state = Level(WARN, f'{refusal.topic}: {refusal.reason} ({details})')
        self._refused.see(state, now)
        if refusal.reason == DROPPED:
            self._timing.see(state, now)

    def answered(self, output: Output, came: float, now: float) -> bool:
        """Note an output and when its setpoint came; return whether a level has changed."""
        self._answered += 1
        self._answered_at = now
        self._second.processing.append(now - came)
        if output.condition > self._second.worst_condition:
            self._second.worst_condition = output.condition
        self._output = output
        self._singularity.see(singularity_level(output), now, lasting=True)
        self._limits.see(self._limits_of(output), now, lasting=True)
        return self.level_changed(now)

    def level_changed(self, now: float) -> bool:
        """Return whether any level is another than in the last report."""
        return self._current_levels(now) != self._levels

    def report(self, now: float) -> tuple[Status, ...]:
        """Return the statuses; rate and processing time are of the last one or two seconds."""
        self._levels = self._current_levels(now)
        statuses = (self._report_setpoints(now), self._report_singularity(now),
                    self._report_limits(now), self._report_timing(now),
                    *(status for other in self._others for status in other.report(now)))
        # Reports come at changes of level as well, and may be much less than a second apart.
        if now - self._second.begin >= 1.0:
            self._second_before, self._second = self._second, _Second(now)
        return statuses

    def _current_levels(self, now: float) -> tuple[int, ...]:
        return (self._setpoint_level(now).level, self._singularity.at(now).level,
                self._limits.at(now).level, self._timing.at(now).level,
                *(other.level(now) for other in self._others))

    @property
    def _processing(self) -> list[float]:
        """Return the processing times of the last one or two seconds."""
        return self._second_before.processing + self._second.processing

    def _limits_of(self, output: Output) -> Level:
        if output.exceedances:
            return Level(ERROR, ', '.join(map(self._words, output.exceedances)))
        return _FINE

    def _setpoint_level(self, now: float) -> Level:
        refused = self._refused.at(now)
        stale = not self._answered or (
            now - self._answered_at > self.parameters['setpoint.timeout'])
        name, namesakes = self.namesakes
        if namesakes < 2 and not stale and not any(n > 1 for n in self.writers.values()):
            return refused
        troubles = [f'{topic} has {n} writers' for topic, n in self.writers.items() if n > 1]
        if namesakes > 1:
            troubles.append(f'{namesakes} nodes are named {name}')
        level = ERROR if troubles else STALE
        if stale:
            troubles.append('no setpoint: ' + (self._silence(now) or refused.message or (
                'all topics speak, but none is joined: their stamps differ by more than '
                f'setpoint.sync_tolerance, {self.parameters["setpoint.sync_tolerance"]:g} s')))
        return Level(level, ', '.join(troubles))

    def _silence(self, now: float) -> str:
        """Return which topics are silent and since when."""
        timeout = self.parameters['setpoint.timeout']
        return ', '.join(
            f'{topic} ' + ('never came' if self._silent[topic] else f'silent for {now - at:.1f} s')
            for topic, at in self._heard.items() if now - at > timeout or self._silent[topic])

    def _report_setpoints(self, now: float) -> Status:
        level, message, _ = self._setpoint_level(now)
        seconds = now - self._second_before.begin
        rate = len(self._processing) / seconds if seconds > 0.0 else 0.0
        values = [('setpoints answered', str(self._answered)), ('rate (Hz)', f'{rate:.1f}')]
        if self._answered:
            values.append(('age of the last (s)', f'{now - self._answered_at:.3f}'))
        values += [(f'{topic}: last heard (s ago)', 'never' if self._silent[topic]
                    else f'{now - at:.3f}') for topic, at in self._heard.items()]
        values += [(f'{topic}: writers', str(n)) for topic, n in self.writers.items()]
        values += [(f'{topic}: readers', str(n)) for topic, n in self.readers.items()]
        values += [(f'rejected, {topic}: {reason}', str(n))
                   for (topic, reason), n in sorted(self._refusals.items())]
        return Status('setpoints', level, message or 'answered', tuple(values))

    def _report_singularity(self, now: float) -> Status:
        level, message, _ = self._singularity.at(now)
        output = self._output
        if output is None:
            return Status('singularity', level, 'no setpoint yet', ())
        forces = output.unit_load_forces
        worst = max(range(6), key=forces.__getitem__)
        crossing = output.singularity.time_to_crossing
        worst_condition = max(output.condition, self._second.worst_condition,
                              self._second_before.worst_condition)
        return Status('singularity', level, (message or 'clear') + self._age(now), (
            ('det(J) (m^3)', f'{output.determinant:.9g}'),
            ('d(det(J))/dt (m^3/s)', f'{output.determinant_rate:.9g}'),
            ('time to crossing (s)', f'{crossing:.3f}' if crossing < 1e6 else 'none'),
            ('crossings', str(output.singularity.crossings)),
            ('condition number', f'{output.condition:.6g}'),
            ('worst condition number of the last second', f'{worst_condition:.6g}'),
            ('largest leg force under a unit load', f'{forces[worst]:.6g}'),
            ('its leg', self.parameters['joints'][worst])))

    def _report_limits(self, now: float) -> Status:
        level, message, _ = self._limits.at(now)
        output = self._output
        if output is None:
            return Status('limits', level, 'no setpoint yet', ())
        values = [(f'{leg}: length (m)', f'{length:.6g}') for leg, length in
                  zip(self.parameters['joints'], output.lengths, strict=True)]
        values += [(f'{leg}: rate (m/s)', f'{rate:.6g}') for leg, rate in
                   zip(self.parameters['joints'], output.rates, strict=True)]
        if output.demanded_forces is not None:
            values += [(f'{leg}: force demanded (N)', f'{force:.6g}') for leg, force in
                       zip(self.parameters['joints'], output.demanded_forces, strict=True)]
        return Status('limits', level, (message or 'all held') + self._age(now), tuple(values))

    def _report_timing(self, now: float) -> Status:
        level, message, _ = self._timing.at(now)
        values = []
        if times := self._processing:
            values = [('processing time, median (us)', f'{median(times) * 1e6:.0f}'),
                      ('processing time, largest (us)', f'{max(times) * 1e6:.0f}')]
        for key, reason in (('dropped', DROPPED), ('incomplete', NOT_JOINED)):
            values.append((key, str(sum(n for refusal, n in self._refusals.items()
                                        if refusal.reason == reason))))
        return Status('timing', level, (message or (
            'on time' if self._answered else 'no setpoint yet')) + self._age(now), tuple(values))

    def _age(self, now: float) -> str:
        """Return how old the last setpoint is where that is all there is to speak of."""
        age = now - self._answered_at
        if not self._answered or age <= self.parameters['setpoint.timeout']:
            return ''
        return f' (of the last setpoint, {age:.1f} s ago)'

    def _words(self, excess: Exceedance) -> str:
        how = ', clipped' if excess.limit == 'limits.force_max' else ''
        return excess.words(self.parameters['joints']) + how


_UNSOLVABLE = Level(ERROR, 'J_inv cannot be solved: no forces')
_STOPPED = Level(ERROR, 'inside stop_condition')
_SUPPRESSED = Level(ERROR, 'inside stop_condition: forces suppressed')
# A crossing is of one sample: the next one has another cause.
_WARNINGS = {cause: Level(WARN, cause.value, cause is Cause.CROSSED) for cause in Cause}


def singularity_level(output: Output) -> Level:
    """Return how grave the singularity is that an output is near, and in which words."""
    if output.demanded_forces is None:
        return _UNSOLVABLE
    if output.singularity.stopped:
        return _SUPPRESSED if output.forces is None else _STOPPED
    return _WARNINGS[output.singularity.cause] if output.singularity.warning else _FINE
