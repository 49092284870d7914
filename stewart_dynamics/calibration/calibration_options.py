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

"""Options of a calibration and of the design of poses."""

from __future__ import annotations

from typing import Any, NamedTuple

from stewart_dynamics.calibration.noise import Noise
from stewart_dynamics.reporting.estimates import HOLD_OUT


class CalibrationOptions(NamedTuple):
    """Options of a calibration."""

    fixed: tuple[str, ...] = ()
    """Parts of the geometry that keep the file's values."""
    frames: str = 'known'
    """Whether the device measures the platform frame in the base frame: known, or unknown."""
    noise: Noise | None = None
    """Noise of lengths and poses; None: estimated."""
    hold_out: float = HOLD_OUT
    """Share of the poses that validates a fit to the others."""
    millimeters: bool = False
    degrees: bool = False
    accept_mistakes: bool = False
    """Write results although a mistake is likely."""
    report: bool = True
    """Write report.html."""
    force: bool = False
    """Replace existing results."""
    run: str = ''

    def shown(self) -> dict[str, Any]:
        """Return the options of the calibration for JSON."""
        return {name: value for name, value in self._asdict().items()
                if name not in ('noise', 'report', 'force', 'run')}
