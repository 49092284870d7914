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
The statuses ``planned trajectory`` and ``payload``: the outcome of the last task of each.

There is no status before the first outcome.
"""

from __future__ import annotations

from collections import Counter

from stewart_dynamics.external_wrench.payload import (
    NAMES, numbers_of, Payload, PayloadOutcome, UNITS)
from stewart_dynamics.node.diagnostics.periodic_report import (
    ERROR, Level, LogLine, OK, OK_LEVEL, StatusPart, WARN)
from stewart_dynamics.planned.messages import PlannedOutcome

_LONG = 2.0  # [s]


class _LastOutcome(StatusPart):
    """The level and values of the last outcome, until the next one."""

    def __init__(self) -> None:
        super().__init__()
        self._last = OK_LEVEL
        self._values: list[tuple[str, str]] | None = None
        self._lines: list[LogLine] = []

    def level(self, now: float) -> int:
        """Return the present level."""
        return self._last.level

    def state(self, now: float) -> Level:
        """Return the level of the last outcome, and its message."""
        return self._last

    def values(self, now: float) -> list[tuple[str, str]] | None:
        """Return keys and values; None before the first outcome."""
        return self._values

    def log_lines(self, now: float) -> list[LogLine]:
        """Return the lines since the last call."""
        lines, self._lines = self._lines, []
        return lines


class PlannedTrajectoryDiagnostics(_LastOutcome):
    """Keeps the outcome of the last planned trajectory, and counts them all."""

    name = 'planned trajectory'

    def __init__(self) -> None:
        super().__init__()
        self._counts: Counter[str] = Counter()

    def done(self, outcome: PlannedOutcome, seconds: float) -> None:
        """Note an outcome, and the time from the message to the outcome [s]."""
        level = ERROR if outcome.reason else WARN if outcome.warning else OK
        counts = self._counts
        counts[f'rejected: {outcome.reason}' if outcome.reason else 'accepted'] += 1
        self._last = Level(level, outcome.message)
        self._values = [
            ('accepted', str(counts['accepted'])),
            ('rejected', str(counts.total() - counts['accepted'])),
            *((reason, str(n)) for reason, n in sorted(counts.items()) if reason != 'accepted'),
            *outcome.values, ('time it took (s)', f'{seconds:.3f}')]
        message = outcome.message + (f' (took {seconds:.1f} s)' if seconds > _LONG else '')
        lines = self._changed(Level(level, message))
        if outcome.reason:  # each one is logged
            lines = [LogLine(ERROR, f'{self.name} {message}', outcome.reason)]
        elif seconds > _LONG:
            lines = [LogLine(level, f'{self.name}: {message}')]
        self._lines += lines


class PayloadDiagnostics(_LastOutcome):
    """Keeps the outcome of the last request to identify the payload."""

    name = 'payload'

    def done(self, outcome: PayloadOutcome, seconds: float) -> None:
        """Note an outcome, and the duration of the task [s]."""
        payload = outcome.payload
        self._last = Level(OK, f'identified from {payload.seconds:.1f} s') if payload else (
            Level(WARN, f'not identified: {outcome.message}'))
        self._values = [*(_values_of(payload) if payload else ()),
                        ('time it took (s)', f'{seconds:.3f}')]
        self._lines += self._changed(self._last)


def _values_of(payload: Payload) -> list[tuple[str, str]]:
    fitted, values = payload.fitted, []
    for name, unit, value, half, known in zip(
            NAMES, UNITS, numbers_of(fitted.body), fitted.half_widths, fitted.known,
            strict=True):
        values.append((f'{name} ({unit})', f'{value:.6g}'))
        values.append((f'{name}, half of the 95 % interval ({unit})',
                       f'{half:.3g}' if known else 'not identified'))
    return [*values,
            ('mass less platform.mass (kg)', f'{fitted.body.mass - payload.given.mass:.6g}'),
            ('RMS of measured - model force, with these (N)', f'{fitted.residual:.4g}')]
