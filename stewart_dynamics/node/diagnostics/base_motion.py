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

"""The status ``base``: whether the base's motion is known; omitted if the base is fixed."""

from __future__ import annotations

from collections.abc import Sequence

from stewart_dynamics.mechanics.rows import (
    BASE_ACCELERATION, BASE_ANGULAR_ACCELERATION, BASE_ANGULAR_VELOCITY, GRAVITY)
from stewart_dynamics.node.diagnostics.periodic_report import (
    ERROR, last_heard, Level, LogLine, NEVER, OK, silent_topics, StatusPart)
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.setpoints.base_input import BaseInput
from stewart_dynamics.setpoints.rejections import Rejection
from stewart_dynamics.setpoints.step import Setpoint

_QUANTITIES = (('gravity', 'm/s^2', GRAVITY), ('acceleration', 'm/s^2', BASE_ACCELERATION),
               ('angular velocity', 'rad/s', BASE_ANGULAR_VELOCITY),
               ('angular acceleration', 'rad/s^2', BASE_ANGULAR_ACCELERATION))
_REJECTED, _UNKNOWN = 'rejected', 'unknown'


class BaseDiagnostics(StatusPart):
    """Counts the base's messages, and notes for which setpoints its motion is known."""

    name = 'base'

    def __init__(self, parameters: Parameters, topics: Sequence[str]) -> None:
        super().__init__(_REJECTED, _UNKNOWN)
        self._timeout: float = parameters['base.timeout']
        self._heard = dict.fromkeys(topics, NEVER)
        self._samples = 0
        self._sampled_at = NEVER
        self._row: Sequence[float] = ()
        self._unknown = 0

    def heard(self, topic: str, now: float) -> None:
        """Note that a message has arrived."""
        self._heard[topic] = now

    def sampled(self, base: BaseInput, now: float) -> None:
        """Note that a message has completed a sample."""
        self._samples += 1
        self._sampled_at = now
        if base.last:
            self._row = base.last[1]

    def rejected(self, rejection: Rejection, details: str, now: float,
                 cause: str = _REJECTED) -> None:
        """Note a rejection."""
        super().rejected(rejection, details, now, cause)

    def stale(self, now: float) -> bool:
        """Return whether no recent sample is available."""
        return now - self._sampled_at > self._timeout

    def answered(self, setpoint: Setpoint, now: float) -> None:
        """Note a setpoint that was answered."""
        if not setpoint.base_known:
            self._unknown += 1
            self.held.happened(Level(ERROR, self._why(now)), now, _UNKNOWN)

    def level(self, now: float) -> int:
        """Return the present level."""
        return self.state(now).level if self._heard else OK

    def state(self, now: float) -> Level:
        """Return the present level and its cause."""
        lack, held = self._lack(now), self.held.of(_REJECTED, now)
        return held if held.level > lack.level else lack

    def values(self, now: float) -> list[tuple[str, str]] | None:
        """Return keys and values; None if the base is fixed."""
        if not self._heard:
            return None
        values = [('samples', str(self._samples)),
                  ('setpoints without forces, as the base was not known', str(self._unknown))]
        if self._samples:
            values.append(('age of the last sample (s)', f'{now - self._sampled_at:.3f}'))
        values += last_heard(self._heard, now)
        values += [(f'{name} {axis} ({unit})', f'{number:.6g}') for name, unit, part in _QUANTITIES
                   for axis, number in zip('xyz', self._row[part], strict=False)]
        return values + self.rejections()

    def log_lines(self, now: float) -> list[LogLine]:
        """Return that there are no forces, and that there are again; rejections are logged."""
        # Where nothing has begun, nothing is wrong.
        return self._changed(self._lack(now)) if self._samples or self._unknown else []

    def _lack(self, now: float) -> Level:
        """Return whether the base's motion is missing."""
        if self.stale(now):
            return Level(ERROR, f'no forces: {self._why(now)}')
        unknown = self.held.of(_UNKNOWN, now)
        return (Level(unknown.level, f'no forces: {unknown.message}') if unknown.level
                else Level(OK, 'its motion is known'))

    def _why(self, now: float) -> str:
        """Return why the base's motion is unknown."""
        silent = silent_topics(self._heard, self._timeout, now)
        if silent or self.stale(now):
            return silent or self.held.of(_REJECTED, now).message or (
                'its topics arrive, but are not joined: their stamps differ')
        return ('the stamps of the base and of setpoints differ by more than base.timeout, '
                f'{self._timeout:g} s')
