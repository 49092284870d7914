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

"""The status ``payload``: there is one from the first request to identify the payload on."""

from __future__ import annotations

from stewart_dynamics.external_wrench.payload import NAMES, numbers_of, Outcome, Payload, UNITS
from stewart_dynamics.node.diagnostics.periodic_report import LastOutcome, Level, OK, Status, WARN


class PayloadDiagnostics(LastOutcome):
    """Keeps the outcome of the last request."""

    def __init__(self) -> None:
        super().__init__('payload')

    def done(self, outcome: Outcome, seconds: float) -> None:
        """Note an outcome, and how long the work took [s]."""
        payload = outcome.payload
        level = OK if payload else WARN
        message = f'identified from {payload.seconds:.1f} s' if payload else (
            f'not identified: {outcome.message}')
        values = _values(payload) if payload else []
        self._status = Status(
            self._name, level, message, (*values, ('time it took (s)', f'{seconds:.3f}')))
        self._lines += self._log.lines(Level(level, message))


def _values(payload: Payload) -> list[tuple[str, str]]:
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
