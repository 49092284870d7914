# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The result of a calibration: calibration.json, the terminal, comments of calibrated.yaml."""

from __future__ import annotations

import math
import textwrap

import numpy as np

from stewart_dynamics.calibration.calibrate import Calibration
from stewart_dynamics.calibration.calibration_record import (
    CalibrationResult, ErrorsOfPoses, Frame, FramesOfDevice, LegResiduals, NoiseOfPoses, Options,
    Outlier, PosesRead, ResidualsOfLegs, Validation)
from stewart_dynamics.calibration.equations import inverse
from stewart_dynamics.calibration.frames import PoseErrors
from stewart_dynamics.calibration.measured_poses import MeasuredPoses
from stewart_dynamics.estimation.confidence_level import PERCENT
from stewart_dynamics.legs.calibrated import ALL_GROUPS, CalibratedLegs
from stewart_dynamics.mechanics.frames.motion import listed, Pose
from stewart_dynamics.records import of_kind
from stewart_dynamics.replay.statements import plural
from stewart_dynamics.reporting.estimates import (
    Cause, combined, Estimate, estimate, FIXED, FoundLackOfFit, IDENTIFIED, LikelyError,
    NOT_IDENTIFIABLE, not_identifiable_lines, table_lines)
from stewart_dynamics.whole_file import now


def document(found: Calibration, measured: MeasuredPoses, source: str, options: Options,
             ) -> CalibrationResult:
    """Return the content of calibration.json."""
    what, kind, lack = found.identifiability, found.parameters.leg_kind, found.lack_of_fit
    joints, units, noise = found.parameters.joints, found.legs.units_of(), found.noise
    legs, pose = measured.topics or (None, None)
    return of_kind(CalibrationResult, kind)(
        date=now(),
        poses=PosesRead(
            source, legs, pose, len(measured.names), found.poses,
            [*measured.notices, *measured.notices_of_repeats]),
        options=options,
        parameters=[
            estimate(name, unit, start, value, state, error, share, False,
                     not lack and math.isfinite(error))
            for name, unit, start, value, state, error, share in zip(
                found.names, units, found.start, found.values, found.states, found.errors,
                what.shares, strict=True)],
        combinations=combined(what, found.names, units, found.values, found.covariance),
        rank=what.rank, unknowns=len(found.names) - found.states.count(FIXED),
        singular_values=what.singular_values.tolist(),
        not_identified=found.not_identified,
        noise=None if not np.isfinite(found.errors).all() else of_kind(NoiseOfPoses, kind)(
            given=found.noise_given, drive=noise.drive, position_m=noise.position,
            rotation_rad=noise.rotation),
        frames=None if found.frames is None else FramesOfDevice(
            _frame(found.frames.device), _frame(inverse(found.frames.target))),
        residuals=ResidualsOfLegs(
            math.sqrt((found.before ** 2).mean()), math.sqrt((found.after ** 2).mean()),
            {joint: LegResiduals(before, after) for joint, before, after in zip(
                joints, found.before, found.after, strict=True)}),
        outliers=[Outlier(measured.names[each.pose], [joints[n] for n in each.legs],
                          each.residual) for each in found.outliers],
        validation=None if not (held := found.validation) else Validation(
            len(held.after.position), _errors(held.before) if held.before.known else None,
            _errors(held.after)),
        lack_of_fit=None if not lack else FoundLackOfFit(
            lack[0].what, '; '.join(each.text for each in lack), 'none',
            [Cause(*each) for each in lack]),
        assembly=[LikelyError(*each) for each in found.assembly],
        likely_mistakes=[LikelyError(*each) for each in found.likely],
        calibrated=found.parameters.plain())


def _frame(pose: Pose) -> Frame:
    return Frame(pose.position.tolist(), pose.quaternion.tolist())


def _errors(errors: PoseErrors) -> ErrorsOfPoses:
    (position, rotation), (farthest, most) = errors.rms, errors.largest
    return ErrorsOfPoses(position, farthest, rotation, most)


def outlier_text(each: Outlier) -> str:
    """Return a pose that was left out, in words."""
    legs = 'all legs' if len(each.legs) == 6 else ', '.join(each.legs)
    return f'{each.pose}: left out, {legs} off by up to {1e3 * each.residual_m:.3g} mm'


def validation_text(held: Validation | None) -> str:
    """Return the errors of held-out poses in words."""
    if held is None:
        return 'not validated: too few poses to hold some out'
    before, after = (
        'no pose has the leg positions' if errors is None else
        f'{1e3 * errors.position_rms_m:.3g} mm and {1e3 * errors.rotation_rms_rad:.3g} mrad'
        for errors in (held.before, held.after))
    return (f'pose errors on {plural(held.poses, "held-out pose")}, RMS: {before} by the file, '
            f'{after} by a fit to the others')


def noise_text(noise: NoiseOfPoses | None) -> str:
    """Return the noise of drives and poses in words."""
    if noise is None:
        return 'no intervals: as many residuals as unknowns give no noise; --noise does'
    drives = (f'leg positions {1e6 * noise.drive:.2g} um' if noise.kind.position.unit == 'm' else
              f'{noise.kind.position.field} {1e3 * noise.drive:.2g} mrad')
    how = 'as given' if noise.given else 'estimated'
    return (f'noise {how}: {drives}, poses {1e6 * noise.position_m:.2g} um and '
            f'{1e6 * noise.rotation_rad:.2g} urad')


def frames_text(frames: FramesOfDevice | None) -> str:
    """Return the frames of the device in words; empty if they were known."""
    return '' if frames is None else '; '.join(
        f'{name}: {listed(np.array(frame.position_m), 6)} m, quaternion '
        f'{listed(np.array(frame.quaternion), 6)}' for name, frame in (
            ('Device in the base frame', frames.device_in_base),
            ('target in the platform frame', frames.target_in_platform)))


def result_text(result: CalibrationResult) -> str:
    """Return the content of calibration.json as text for the terminal."""
    lack, residuals = result.lack_of_fit, result.residuals
    lines = textwrap.wrap(f'LACK OF FIT: {lack.text}', 100) if lack else []
    lines += [line for each in result.assembly for line in textwrap.wrap(each.text, 100)]
    lines += [
        *result.poses.notices,
        validation_text(result.validation),
        f'residuals of the legs, RMS: {1e6 * residuals.before_rms_m:.3g} um by the file, '
        f'{1e6 * residuals.after_rms_m:.3g} um calibrated',
        noise_text(result.noise),
        *textwrap.wrap(frames_text(result.frames), 100),
        *map(outlier_text, result.outliers), '',
        *table_lines(_asked(result), 'calibrated')]
    if result.not_identified:
        lines += ['', *textwrap.wrap(result.not_identified, 100)]
    return '\n'.join([*lines, *not_identifiable_lines(result, 'poses')])


def _asked(result: CalibrationResult) -> list[Estimate]:
    """Return the parameters; of some groups of unknowns without all that was not asked for."""
    return [each for each in result.parameters
            if each.state != FIXED or ALL_GROUPS in result.options.unknowns]


def comments(result: CalibrationResult, legs: CalibratedLegs) -> dict[str, str]:
    """Return the comments of calibrated.yaml by parameter: date and largest interval."""
    texts: dict[str, str] = {}
    for of in legs.calibrated:
        each = result.parameters[legs.parts[of.name]]
        halves = [row.half for row in each
                  if row.state == IDENTIFIED and row.interval and row.half is not None]
        kept = sum(row.state in (FIXED, NOT_IDENTIFIABLE) for row in each)
        texts |= dict.fromkeys(legs.written(of.name), ', '.join([
            f'calibrated {result.date[:10]}' if kept < len(each) else 'kept',
            *([f'{PERCENT}: within +-{max(halves):.2g} {of.unit}'] if halves else []),
            *([f'{len(each) - len(halves) - kept} without an interval of its own']
              if 0 < len(halves) < len(each) - kept else []),
            *([f'{kept} kept'] if 0 < kept < len(each) else [])]))
    return texts
