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

"""One identification with its files, which are renamed only when all are complete."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from stewart_dynamics.bags import blocks, mcap_scan
from stewart_dynamics.bags.find import bytes_of
from stewart_dynamics.errors import StewartError
from stewart_dynamics.identification.identification_options import IdentificationOptions
from stewart_dynamics.identification.identification_report import write_report
from stewart_dynamics.identification.identify import Identification, Identified
from stewart_dynamics.identification.results import comments, document
from stewart_dynamics.mechanics.dynamics import friction, inverse_dynamics, regressor
from stewart_dynamics.mechanics.kinematics import forward_kinematics
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.reporting.estimates import justified
from stewart_dynamics.reporting.results_folder import (
    check_free, IDENTIFICATION, remove_abandoned, whole_folder)
from stewart_dynamics.whole_file import write_json
from tqdm import tqdm

PARAMETERS, RESULT, REPORT = 'identified.yaml', IDENTIFICATION, 'report.html'

# Functions that every identification needs as machine code.
FUNCTIONS = (inverse_dynamics.solve, forward_kinematics.poses, regressor.regressors,
             friction.friction, *blocks.FUNCTIONS, mcap_scan.scan)


def run(bags: Sequence[Path], parameters: Parameters, folder: Path, options: IdentificationOptions,
        warn: Callable[[str], None]) -> dict[str, Any]:
    """
    Identify from bags into a folder; return the content of identification.json.

    ``warn`` is called with likely mistakes that were accepted. Raises StewartError if a bag cannot
    be used, or a mistake is likely: nothing is written.
    """
    check_free(folder, options, RESULT)
    remove_abandoned([folder])
    with closing(Identification(parameters, options)) as work:
        with tqdm(total=sum(map(bytes_of, bags)), unit='B', unit_scale=True, disable=None,
                  leave=False, dynamic_ncols=True) as bar:
            for bag in bags:
                work.read(bag, bar.update)
        found = work.result()
        for likely in found.likely:
            if not options.accept_mistakes:
                raise StewartError(f'{bags[0]}: {likely.text}; nothing is written '
                                   '(--accept-mistakes writes)')
            warn(f'warning: {likely.text}')
        result = document(found, options)
        with whole_folder(folder, options, RESULT) as partial:
            _rounded(found).to_yaml(
                partial / PARAMETERS, comments(result, found.unknowns))
            write_json(partial / RESULT, result)
            if options.report:
                write_report(partial / REPORT, work.extracts, found, result)
    return result


def _rounded(found: Identified) -> Parameters:
    """Return the parameters rounded to the digits that the intervals justify."""
    errors = np.sqrt(np.maximum(np.diag(found.errors.covariance), 0.0))
    try:
        return found.unknowns.parameters(justified(found.fit.values, errors))
    except StewartError:  # a body at its bound may not be rounded
        return found.parameters
