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

"""The status ``base``: whether the base's motion is known; there is one where it is asked for."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
import math

from stewart_dynamics.mechanics.rows import (
    BASE_ACCELERATION, BASE_ANGULAR_ACCELERATION, BASE_ANGULAR_VELOCITY, GRAVITY)
from stewart_dynamics.node.diagnostics.periodic_report import (
    ERROR, Held, Level, LevelLog, LogLine, OK, Status, WARN)
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.setpoints.base import BaseInput
from stewart_dynamics.setpoints.rejections import Rejection
from stewart_dynamics.setpoints.step import Setpoint

_NAME = 'base'
_NEVER = -math.inf
_QUANTITIES = (('gravity', 'm/s^2', GRAVITY), ('acceleration', 'm/s^2', BASE_ACCELERATION),
               ('angular velocity', 'rad/s', BASE_ANGULAR_VELOCITY),
               ('angular acceleration', 'rad/s^2', BASE_ANGULAR_ACCELERATION))


class BaseDiagnostics:
    """
    Notes what becomes of the base's messages, and for which setpoints its motion is known.

    Parameters
    ----------
    parameters : Parameters
        For the timeout.
    topics : sequence of str
        Those of the base; none where it is still.

    """

    def __init__(self, parameters: Parameters, topics: Sequence[str]) -> None:
        self._timeout: float = parameters['base.timeout']
        self._heard = dict.fromkeys(topics, _NEVER)
        self._samples = 0
        self._sampled_at = _NEVER
        self._row: Sequence[float] = ()
        self._unknown = 0
        self._rejections: Counter[Rejection] = Counter()
        self._held = Held()
        self._unknown_held = Held()
        self._log = LevelLog(_NAME)

    def heard(self, topic: str, now: float) -> None:
        """Note that a message came."""
        self._heard[topic] = now

    def sampled(self, base: BaseInput, now: float) -> None:
        """Note that a message has completed a sample."""
        self._samples += 1
        self._sampled_at = now
        if base.last:
            self._row = base.last[1]

    def stale(self, now: float) -> bool:
        """Return whether there is no sample, or only an old one."""
        return now - self._sampled_at > self._timeout

    def answered(self, setpoint: Setpoint, now: float) -> None:
        """Note a setpoint that was answered."""
        if not setpoint.base_known:
            self._unknown += 1
            self._unknown_held.happened(Level(ERROR, self._why(now)), now)

    def rejected(self, rejection: Rejection, details: str, now: float) -> None:
        """Note a rejection."""
        self._rejections[rejection] += 1
        self._held.happened(
            Level(WARN, f'{rejection.topic}: {rejection.reason} ({details})'), now)

    def level(self, now: float) -> int:
        """Return the present level."""
        return self._state(now).level if self._heard else OK

    def status(self, now: float) -> Status | None:
        """Return the status, None where the base is still."""
        if not self._heard:
            return None
        values = [('samples', str(self._samples)),
                  ('setpoints without forces, as the base was not known', str(self._unknown))]
        if self._samples:
            values.append(('age of the last sample (s)', f'{now - self._sampled_at:.3f}'))
        values += [(f'{topic}: last heard (s ago)', 'never' if at == _NEVER
                    else f'{now - at:.3f}') for topic, at in self._heard.items()]
        values += [(f'{name} {axis} ({unit})', f'{number:.6g}') for name, unit, part in _QUANTITIES
                   for axis, number in zip('xyz', self._row[part], strict=False)]
        values += [(f'rejected, {topic}: {reason}', str(n))
                   for (topic, reason), n in sorted(self._rejections.items())]
        return Status(_NAME, *self._state(now), tuple(values))

    def log_lines(self, now: float) -> list[LogLine]:
        """Return that there are no forces, and that there are again; rejections are logged."""
        # Where nothing has begun, nothing is wrong.
        return self._log.lines(self._lack(now)) if self._samples or self._unknown else []

    def _state(self, now: float) -> Level:
        lack, held = self._lack(now), self._held.at(now)
        return held if held.level > lack.level else lack

    def _lack(self, now: float) -> Level:
        """Return whether the base's motion lacks."""
        if self.stale(now):
            return Level(ERROR, f'no forces: {self._why(now)}')
        unknown = self._unknown_held.at(now)
        return (Level(unknown.level, f'no forces: {unknown.message}') if unknown.level
                else Level(OK, 'its motion is known'))

    def _why(self, now: float) -> str:
        """Return why the base's motion is not known."""
        silent = ', '.join(
            f'{topic} never came' if at == _NEVER else f'{topic} silent for {now - at:.1f} s'
            for topic, at in self._heard.items() if now - at > self._timeout)
        if silent or self.stale(now):
            return silent or self._held.at(now).message or (
                'its topics arrive, but are not joined: their stamps differ')
        return ('the stamps of the base and of setpoints differ by more than base.timeout, '
                f'{self._timeout:g} s')
