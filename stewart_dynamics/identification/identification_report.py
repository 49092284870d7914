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
from stewart_dynamics.identification.extraction import Extracts
from stewart_dynamics.identification.identify import Identified
from stewart_dynamics.identification.sums import residual_of, shifted_by
from stewart_dynamics.mechanics.least_squares import TWO_SIDED
from stewart_dynamics.reporting.colors import LEG_COLORS
from stewart_dynamics.reporting.estimates import page_values
from stewart_dynamics.reporting.pages import base64_of, page, plotly_script
from stewart_dynamics.reporting.spectrum import drawn, Spectrum
from stewart_dynamics.whole_file import write_files

_FOLDER = Path(__file__).with_name('templates')
# Largest number of samples in the curves; later samples are not drawn.
_MOST = 12_000


def write_report(path: Path, extracts: Extracts, found: Identified, result: Mapping[str, Any],
                 ) -> None:
    """Write the page of a result, with the content of identification.json."""
    legs = list(found.parameters['joints'])
    curves, spectra = _curves(extracts, found)
    data = {'legs': legs, 'colors': LEG_COLORS,
            'curves': [base64_of(column, '<f4') for column in curves.T], 'spectra': spectra}
    script = plotly_script()
    bag = result['bags'][0]['bag']
    text = page(
        _FOLDER, 'identification', [script], document=True, r=result, name=Path(bag).name or bag,
        **page_values(result), legs=legs, plotly=script, data=data, two_sided=TWO_SIDED,
        samples=len(curves), most=_MOST)
    write_files({path: text})


def _curves(extracts: Extracts, found: Identified) -> tuple[Array, list[dict[str, str]]]:
    """Return times, efforts and forces before and after (M, 19), and spectra of residuals."""
    u = found.unknowns
    before, after = u.theta(u.start), u.theta(found.fit.values)
    timeout = found.parameters['setpoint.timeout']
    spectrum = Spectrum(12, timeout)
    curves: list[Array] = []
    count, elapsed = 0, 0.0
    for extract in extracts:
        delay = found.fit.delays[extract.bag]
        effort = extract.efforts @ shifted_by(delay)
        residuals = [extract.columns @ residual_of(theta, delay) for theta in (before, after)]
        times = elapsed + extract.times - extract.times[0]
        spectrum.add(times, np.concatenate(residuals, axis=1).T)
        elapsed = float(times[-1]) + 10.0 * timeout  # no step between bags
        if count < _MOST:
            rows = np.concatenate(
                [extract.times[:, None], effort, effort - residuals[0], effort - residuals[1]],
                axis=1)[:_MOST - count]
            curves.append(np.concatenate([rows, np.full((1, 19), np.nan)]))
            count += len(rows)
    density = spectrum.density()
    spectra = [] if density is None else [
        dict(zip(('frequencies', 'values'), (
            base64_of(each, '<f4') for each in drawn(density.frequencies, amplitudes)),
            strict=True)) for amplitudes in density.amplitudes]
    return np.concatenate(curves), spectra
