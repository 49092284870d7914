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

"""One calibration with its files, which get their names only when all are complete."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from stewart_dynamics.calibration.calibrate import calibrate
from stewart_dynamics.calibration.calibration_options import CalibrationOptions
from stewart_dynamics.calibration.calibration_report import write_report
from stewart_dynamics.calibration.measured_poses import MeasuredPoses
from stewart_dynamics.calibration.results import comments, document
from stewart_dynamics.mechanics.kinematics import forward_kinematics
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.reporting.results_folder import (
    CALIBRATION, check_free, remove_abandoned, whole_folder)
from stewart_dynamics.whole_file import write_json

PARAMETERS, RESULT, REPORT = 'calibrated.yaml', CALIBRATION, 'report.html'
# Functions that every calibration needs as machine code.
FUNCTIONS = (forward_kinematics.poses,)


def run(measured: MeasuredPoses, source: str, parameters: Parameters, folder: Path,
        options: CalibrationOptions) -> dict[str, Any]:
    """
    Calibrate into a folder; return the content of calibration.json.

    Parameters
    ----------
    measured : MeasuredPoses
        Legs and poses.
    source : str
        Name of the file that they are of.
    parameters : Parameters
        The hexapod as it is drawn.
    folder : Path
        Results folder, created when complete.
    options : CalibrationOptions
        Options of the calibration.

    Raises
    ------
    StewartError
        The poses do not support a calibration: nothing is written.

    """
    check_free(folder, options, RESULT)
    remove_abandoned([folder])
    found = calibrate(
        StewartPlatform(parameters), measured.lengths, measured.poses, fixed=options.fixed,
        frames=options.frames, noise=options.noise, hold_out=options.hold_out,
        angles=measured.angles, degrees=options.degrees, accept_mistakes=options.accept_mistakes)
    result = document(found, measured, source, options.shown())
    with whole_folder(folder, options, RESULT) as partial:
        found.parameters.to_yaml(partial / PARAMETERS, comments(result))
        write_json(partial / RESULT, result)
        if options.report:
            write_report(partial / REPORT, result, found)
    return result
