# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""``stewart_calibrate --design N``: options, files and terminal output."""

from __future__ import annotations

import argparse
from pathlib import Path

from stewart_dynamics.estimation.confidence_level import INTERVAL
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.program import between, whole
from stewart_dynamics.reporting.results_folder import DESIGNED, DESIGNED_POSES, WAY_THROUGH_POSES


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that only a design has."""
    group = parser.add_argument_group('design of poses (--design)')
    group.add_argument('--design', type=whole(1, 500), metavar='N',
                       help='calibrate nothing, but choose the N poses within the limits that '
                            f'identify best: DIR/{DESIGNED_POSES}, and DIR/{WAY_THROUGH_POSES} '
                            f'that visits them (default DIR: {DESIGNED})')
    group.add_argument('--rest', type=between(0.0, 3600.0), default=3.0, metavar='S',
                       help='time at rest in each pose (default: %(default)g)')
    group.add_argument('--seed', type=whole(0, 2 ** 32 - 1), default=0, metavar='N',
                       help='equal seeds give equal poses (default: %(default)s)')


def run(given: argparse.Namespace, parameters: Parameters, folder: Path) -> str:
    """Design poses, write them into a folder and return the text for the terminal."""
    # Imported here, so that --help is fast.
    from stewart_dynamics.calibration.measured_poses import poses_csv
    from stewart_dynamics.calibration.noise import Noise
    from stewart_dynamics.calibration.one_run import CalibrationOptions
    from stewart_dynamics.calibration.pose_design import design_poses, NOISE, trajectory_csv, visit
    from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
    from stewart_dynamics.reporting.results_folder import (
        check_free, remove_abandoned, whole_folder)
    from stewart_dynamics.whole_file import write_files
    from tqdm import tqdm

    options = CalibrationOptions(force=given.force)
    before = check_free(folder, options, DESIGNED_POSES)
    remove_abandoned([folder])
    platform = StewartPlatform(parameters)
    noise = Noise(*given.noise) if given.noise else NOISE
    found = design_poses(platform, given.design, noise, given.seed, given.unknowns)
    with tqdm(total=given.design, disable=None, leave=False, unit='pose') as bar:
        motion = visit(platform, found.poses, given.rest, lambda done: bar.update(done - bar.n))
    files = {DESIGNED_POSES: poses_csv(parameters.joints, found.positions, found.poses),
             WAY_THROUGH_POSES: trajectory_csv(motion)}
    with whole_folder(folder, options, DESIGNED_POSES, before) as partial:
        write_files({partial / name: text for name, text in files.items()})
    micro = 'um' if parameters.leg_kind.position.unit == 'm' else 'urad'
    lines = [f'predicted {INTERVAL}s, widest of the legs, for noise of '
             f'{1e6 * noise.drive:.3g} {micro}, {1e6 * noise.position:.3g} um and '
             f'{1e6 * noise.rotation:.3g} urad:',
             f'  {"":28}{"designed":>10}  random poses']
    for each, part in zip(found.legs.calibrated, found.legs.parts.values(), strict=True):
        widest = (1e3 * of[part].reshape(6, -1).max(axis=0)
                  for of in (found.half_widths, found.random_half_widths))
        for axis, own, other in zip(each.axes, *widest, strict=True):
            name = '.'.join(filter(None, (each.name.removeprefix('geometry.'), axis)))
            if own > 0.0:
                lines.append(f'  {name:28}{f"+- {own:.3g}":>10}  +- {other:.3g} m{each.unit}')
    return '\n'.join([*lines, f'{given.design} poses: {folder / DESIGNED_POSES}; '
                      f'{motion.times[-1]:.0f} s through them: {folder / WAY_THROUGH_POSES}'])
