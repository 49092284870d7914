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
The report of an identification as one HTML page.

Like the replay's report it needs no network: plotly.js is included, numbers are base64 of typed
arrays.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.identification.identify import Identification, Identified
from stewart_dynamics.identification.sums import residual_of
from stewart_dynamics.mechanics.least_squares import TWO_SIDED
from stewart_dynamics.reporting.colors import LEG_COLORS
from stewart_dynamics.reporting.estimates import page_values
from stewart_dynamics.reporting.pages import base64_of, page, plotly_script
from stewart_dynamics.reporting.spectrum import drawn, Spectrum
from stewart_dynamics.whole_file import write_files

_FOLDER = Path(__file__).with_name('templates')
# Largest number of samples in the curves; later samples are not drawn.
_MOST = 12_000


class IdentificationReport:
    """
    The page of an identification.

    Parameters
    ----------
    work : Identification
        Identification with its extracts.
    found : Identified
        Result of the identification.

    """

    def __init__(self, work: Identification, found: Identified) -> None:
        self._found = found
        u = found.unknowns
        before, after = u.theta(u.start), u.theta(found.fit.values)
        timeout = found.parameters['setpoint.timeout']
        spectrum = Spectrum(12, timeout)
        curves: list[Array] = []
        drawn_samples, elapsed = 0, 0.0
        for block in work.extracts:
            delay = found.fit.delays[block.bag]
            shifts = residual_of(np.zeros(0), delay)[1:]
            effort = block.columns[..., -len(shifts):] @ shifts
            residuals = [block.columns @ residual_of(theta, delay) for theta in (before, after)]
            both = np.concatenate(residuals, axis=1)
            times = elapsed + block.times - block.times[0]
            spectrum.add(times, both.T)
            elapsed = float(times[-1]) + 10.0 * timeout  # no step between bags
            if drawn_samples < _MOST:
                rows = np.concatenate(
                    [block.times[:, None], effort, effort - residuals[0], effort - residuals[1]],
                    axis=1)[:_MOST - drawn_samples]
                curves.append(np.concatenate([rows, np.full((1, 19), np.nan)]))
                drawn_samples += len(rows)
        self._curves = np.concatenate(curves)
        self._density = spectrum.density()

    def write(self, path: Path, result: Mapping[str, Any]) -> None:
        """Write the page, with the content of identification.json."""
        script = plotly_script()
        text = page(
            _FOLDER, 'identification', [script], document=True, r=result,
            name=Path(result['bags'][0]['bag']).name or result['bags'][0]['bag'],
            **page_values(result),
            legs=list(self._found.parameters['joints']), plotly=script, data=self._data(),
            two_sided=TWO_SIDED, samples=len(self._curves), most=_MOST)
        write_files({path: text})

    def _data(self) -> dict[str, Any]:
        spectra = [] if self._density is None else [
            dict(zip(('frequencies', 'values'), (
                base64_of(each, '<f4') for each in drawn(self._density.frequencies, amplitudes)),
                strict=True)) for amplitudes in self._density.amplitudes]
        return {'legs': list(self._found.parameters['joints']), 'colors': LEG_COLORS,
                'curves': [base64_of(column, '<f4') for column in self._curves.T],
                'spectra': spectra}
