# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Content of calibration.json, see docs/calibration.md, and of the terminal."""

from __future__ import annotations

from collections.abc import Mapping
import math
import textwrap
from typing import Any

import numpy as np

from stewart_dynamics.calibration.calibrate import Calibration
from stewart_dynamics.calibration.equations import inverse
from stewart_dynamics.calibration.frames import PoseErrors
from stewart_dynamics.calibration.measured_poses import MeasuredPoses
from stewart_dynamics.estimation.confidence_level import PERCENT, TWO_SIDED
from stewart_dynamics.legs.calibrated import ALL_GROUPS, CalibratedLegs
from stewart_dynamics.mechanics.frames.motion import listed, Pose
from stewart_dynamics.program import SOFTWARE
from stewart_dynamics.replay.statements import plural
from stewart_dynamics.reporting.estimates import (
    combined, estimate, FIXED, IDENTIFIED, NOT_IDENTIFIABLE, not_identifiable_lines, table_lines)
from stewart_dynamics.whole_file import now

# Version of calibration.json; increased when the meaning of a key changes.
VERSION = 1


def document(found: Calibration, measured: MeasuredPoses, source: str, options: Mapping[str, Any],
             ) -> dict[str, Any]:
    """Return the content of calibration.json."""
    what, joints = found.identifiability, found.parameters.joints
    lack = found.lack_of_fit
    legs, pose = measured.topics or (None, None)
    units, drive = found.legs.units_of(), found.parameters.leg_kind.position
    return {
        'version': VERSION, 'software': SOFTWARE,
        'date': now(),
        'poses': {'source': source, 'legs': legs, 'pose': pose, 'read': len(measured.names),
                  'used': found.poses, 'notices': list(measured.notices)},
        'options': dict(options),
        'parameters': [
            estimate(name, unit, start, value, state, error, share, False,
                     not lack and math.isfinite(error))
            for name, unit, start, value, state, error, share in zip(
                found.names, units, found.start, found.values, found.states, found.errors,
                what.shares, strict=True)],
        'combinations': combined(what, found.names, units, found.values, found.covariance),
        'rank': what.rank, 'unknowns': len(found.names) - found.states.count(FIXED),
        'singular_values': what.singular_values,
        'not_identified': found.not_identified,
        'noise': None if not np.isfinite(found.errors).all() else {
            'given': found.noise_given,
            f'{drive.name}_{drive.unit}': found.noise.drive,
            'position_m': found.noise.position, 'rotation_rad': found.noise.rotation},
        'frames': None if found.frames is None else {
            'device_in_base': _pose(found.frames.device),
            'target_in_platform': _pose(inverse(found.frames.target))},
        'residuals': {'legs': {joint: {'before_rms_m': before, 'after_rms_m': after}
                               for joint, before, after in zip(
                                   joints, found.before, found.after, strict=True)},
                      'before_rms_m': math.sqrt((found.before ** 2).mean()),
                      'after_rms_m': math.sqrt((found.after ** 2).mean())},
        'outliers': [{'pose': measured.names[each.pose], 'legs': [joints[n] for n in each.legs],
                      'residual_m': each.residual} for each in found.outliers],
        'validation': None if found.validation is None else {
            'poses': len(found.validation.after.position),
            'before': _errors(found.validation.before), 'after': _errors(found.validation.after)},
        'lack_of_fit': None if not lack else {
            'cause': lack[0].what, 'text': '; '.join(each.text for each in lack),
            'intervals': 'none', 'causes': [each._asdict() for each in lack]},
        'assembly': [each._asdict() for each in found.assembly],
        'likely_mistakes': [each._asdict() for each in found.likely],
        'calibrated': found.parameters.plain()}


def _pose(pose: Pose) -> dict[str, Any]:
    return {'position_m': pose.position, 'quaternion': pose.quaternion}


def _errors(errors: PoseErrors) -> dict[str, float]:
    return {'position_rms_m': errors.rms[0], 'position_max_m': errors.largest[0],
            'rotation_rms_rad': errors.rms[1], 'rotation_max_rad': errors.largest[1]}


def outlier_text(each: Mapping[str, Any]) -> str:
    """Return a pose that was left out, in words."""
    legs = 'all legs' if len(each['legs']) == 6 else ', '.join(each['legs'])
    return f'{each["pose"]}: left out, {legs} off by up to {1e3 * each["residual_m"]:.3g} mm'


def validation_text(held: Mapping[str, Any] | None) -> str:
    """Return the errors of held-out poses in words."""
    if held is None:
        return 'not validated: too few poses to hold some out'
    before, after = (
        f'{1e3 * held[key]["position_rms_m"]:.3g} mm and '
        f'{1e3 * held[key]["rotation_rms_rad"]:.3g} mrad' for key in ('before', 'after'))
    return (f'pose errors on {plural(held["poses"], "held-out pose")}, RMS: {before} by the file, '
            f'{after} by a fit to the others')


def noise_text(noise: Mapping[str, Any] | None) -> str:
    """Return the noise of drives and poses in words."""
    if noise is None:
        return 'no intervals: as many residuals as unknowns give no noise; --noise does'
    drives = (f'leg positions {1e6 * noise["length_m"]:.2g} um' if 'length_m' in noise else
              f'angles {1e3 * noise["angle_rad"]:.2g} mrad')
    how = 'as given' if noise['given'] else 'estimated'
    return (f'noise {how}: {drives}, poses {1e6 * noise["position_m"]:.2g} um and '
            f'{1e6 * noise["rotation_rad"]:.2g} urad')


def frames_text(result: Mapping[str, Any]) -> str:
    """Return the frames of the device in words; empty if they were known."""
    return '' if result['frames'] is None else '; '.join(
        f'{name}: {listed(np.array(frame["position_m"]), 6)} m, quaternion '
        f'{listed(np.array(frame["quaternion"]), 6)}' for name, frame in zip(
            ('Device in the base frame', 'target in the platform frame'),
            result['frames'].values(), strict=True))


def result_text(result: Mapping[str, Any]) -> str:
    """Return the content of calibration.json as text for the terminal."""
    lack = result['lack_of_fit']
    lines = textwrap.wrap(f'LACK OF FIT: {lack["text"]}', 100) if lack else []
    lines += [line for each in result['assembly'] for line in textwrap.wrap(each['text'], 100)]
    lines += [
        *result['poses']['notices'],
        validation_text(result['validation']),
        f'residuals of the legs, RMS: {1e6 * result["residuals"]["before_rms_m"]:.3g} um by the '
        f'file, {1e6 * result["residuals"]["after_rms_m"]:.3g} um calibrated',
        noise_text(result['noise']),
        *textwrap.wrap(frames_text(result), 100),
        *map(outlier_text, result['outliers']), '',
        *table_lines(_asked(result), 'calibrated')]
    if result['not_identified']:
        lines += ['', *textwrap.wrap(result['not_identified'], 100)]
    return '\n'.join([*lines, *not_identifiable_lines(result, 'poses')])


def _asked(result: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the parameters; of some groups of unknowns without all that was not asked for."""
    return [each for each in result['parameters']
            if each['state'] != FIXED or ALL_GROUPS in result['options']['unknowns']]


def comments(result: Mapping[str, Any], legs: CalibratedLegs) -> dict[str, str]:
    """Return the comments of calibrated.yaml by parameter: date and largest interval."""
    texts: dict[str, str] = {}
    for of in legs.calibrated:
        each = result['parameters'][legs.parts[of.name]]
        halves = [TWO_SIDED * row['standard_error'] for row in each
                  if row['state'] == IDENTIFIED and row['interval']]
        kept = sum(row['state'] in (FIXED, NOT_IDENTIFIABLE) for row in each)
        texts |= dict.fromkeys(legs.written(of.name), ', '.join([
            f'calibrated {result["date"][:10]}' if kept < len(each) else 'kept',
            *([f'{PERCENT}: within +-{max(halves):.2g} {of.unit}'] if halves else []),
            *([f'{len(each) - len(halves) - kept} without an interval of its own']
              if 0 < len(halves) < len(each) - kept else []),
            *([f'{kept} kept'] if 0 < kept < len(each) else [])]))
    return texts
