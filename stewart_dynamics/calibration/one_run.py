# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""One calibration with its files, which get their names only when all are complete."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from stewart_dynamics.calibration.calibrate import calibrate
from stewart_dynamics.calibration.calibration_record import CalibrationResult, Options
from stewart_dynamics.calibration.calibration_report import write_report
from stewart_dynamics.calibration.calibration_results import comments, document
from stewart_dynamics.calibration.measured_poses import MeasuredPoses, METERS, Millimeters
from stewart_dynamics.calibration.noise import Noise
from stewart_dynamics.legs.calibrated import ALL_GROUPS
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.reporting.estimates import HOLD_OUT
from stewart_dynamics.reporting.results_folder import (
    CALIBRATED_PARAMETERS, CALIBRATION, check_free, remove_abandoned, REPORT_PAGE, whole_folder)
from stewart_dynamics.whole_file import write_json


class CalibrationOptions(NamedTuple):
    """Options of a calibration as ``calibrate`` takes them, and of its files."""

    fixed: tuple[str, ...] = ()
    unknowns: tuple[str, ...] = (ALL_GROUPS,)
    frames: str = 'known'
    noise: Noise | None = None
    hold_out: float = HOLD_OUT
    millimeters: Millimeters = METERS
    degrees: bool = False
    drive_positions: bool = False
    accept_mistakes: bool = False
    report: bool = True
    force: bool = False
    run: str = ''

    def shown(self) -> Options:
        """Return the options of the calibration for JSON."""
        return Options(
            list(self.fixed), list(self.unknowns), self.frames, self.hold_out,
            self.millimeters._asdict(), self.degrees, self.drive_positions, self.accept_mistakes)


def run(measured: MeasuredPoses, source: str, parameters: Parameters, folder: Path,
        options: CalibrationOptions) -> CalibrationResult:
    """
    Calibrate into a folder, created when complete; return the content of calibration.json.

    ``source`` names the measured poses, ``parameters`` are those of the drawing. StewartError if
    the poses do not support a calibration: nothing is written.
    """
    before = check_free(folder, options, CALIBRATION)
    remove_abandoned([folder])
    found = calibrate(
        StewartPlatform(parameters), measured.positions, measured.poses,
        unknowns=options.unknowns, fixed=options.fixed, frames=options.frames,
        noise=options.noise, hold_out=options.hold_out,
        angles=measured.angles, degrees=options.degrees, millimeters=options.millimeters,
        drive_positions=options.drive_positions, accept_mistakes=options.accept_mistakes)
    result = document(found, measured, source, options.shown())
    with whole_folder(folder, options, CALIBRATION, before) as partial:
        found.parameters.to_yaml(partial / CALIBRATED_PARAMETERS, comments(result, found.legs))
        write_json(partial / CALIBRATION, result)
        if options.report:
            write_report(partial / REPORT_PAGE, result, found)
    return result
