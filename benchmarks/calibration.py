# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Calibration: coverage of the intervals, held-out pose errors, identifiability, design, and time.

Run by hand; see README.md beside this file. The true geometry is the file's with 1 mm of noise
on each number, seeded.
"""

from __future__ import annotations

import argparse
import platform as computer
import sys
import time

from inverse_dynamics import Array, HERE, markdown, processor_name, write
import numpy as np
import scipy
from scipy.stats import binom
from stewart_dynamics import calibrate, Parameters, Pose, StewartPlatform
from stewart_dynamics.calibration.equations import Equations, GEOMETRY, values_of, with_geometry
from stewart_dynamics.calibration.frames import pose_errors
from stewart_dynamics.calibration.geometry_fit import fit, Unknowns
from stewart_dynamics.calibration.noise import Noise
from stewart_dynamics.calibration.pose_design import design_poses
from stewart_dynamics.estimation.confidence_level import TWO_SIDED
from stewart_dynamics.mechanics.frames.rotation import from_euler

BEGIN, END = '<!-- calibration: begin -->', '<!-- calibration: end -->'
NOISE = Noise(1e-5, 1e-5, 1e-5)
ALL_TILTS = (0.3, 0.3, 0.3)
KINDS = {'translations': (0.0, 0.0, 0.0), 'translations and yaw': (0.0, 0.0, 0.5),
         'translations and tilts': (0.3, 0.3, 0.0)}
_SIDE = 0.15


class Bench:
    """A hexapod and random measurements of it."""

    def __init__(self, parameters: Parameters) -> None:
        self.platform = StewartPlatform(parameters)
        self.legs = parameters.leg_kind.calibrated_legs(parameters)
        self.start = values_of(self.legs)
        self.home = self.platform.home_pose()
        self.unknowns = Unknowns.of(
            self.legs, self.start, parameters.singularity.characteristic_length,
            np.zeros(self.legs.count, dtype=bool), False)

    def measured(self, seed: int, count: int, noise: Noise = NOISE,
                 tilt: tuple[float, float, float] = ALL_TILTS) -> tuple[Array, Equations]:
        """Return true values, and measurements at random poses."""
        random = np.random.default_rng(seed)
        true = self.start.copy()
        true[GEOMETRY] += random.normal(0.0, 1e-3, self.legs.count)
        poses = Pose(self.home.position + random.uniform(-_SIDE, _SIDE, (count, 3)),
                     from_euler(random.uniform(-1.0, 1.0, (count, 3)) * tilt))
        lengths = Equations(self.legs, np.zeros((count, 6)), poses).at(true).residuals
        turns = from_euler(random.normal(0.0, noise.rotation, (count, 3)))
        return true, Equations(
            self.legs, lengths + random.normal(0.0, noise.drive, lengths.shape),
            Pose(poses.position + random.normal(0.0, noise.position, (count, 3)),
                 turns @ poses.rotation))

    def coverage(self, seeds: int, count: int, given: bool, noise: Noise) -> tuple[str, ...]:
        """Return the share of intervals with the true value: of all, and of single numbers."""
        inside = np.zeros((seeds, self.legs.count), dtype=bool)
        for seed in range(seeds):
            true, equations = self.measured(seed, count, noise)
            found = fit(equations, self.unknowns, noise if given else None)
            what = found.identifiability
            errors = np.sqrt(np.diag(found.covariance) + (what.shares * what.scales) ** 2)
            inside[seed] = (np.abs(found.values - true) < TWO_SIDED * errors)[GEOMETRY]
        of_each = inside.mean(axis=0)
        return (f'{count}', f'{1e6 * noise.drive:g} um, {1e6 * noise.position:g} um, '
                f'{1e6 * noise.rotation:g} urad', 'given' if given else 'estimated',
                f'{inside.mean():.1%}', f'{of_each.min():.1%}', f'{of_each.max():.1%}')

    def held_out(self, count: int, seeds: int) -> tuple[str, ...]:
        """Return pose errors on 200 other poses: by file, calibrated, and by the true geometry."""
        errors = np.zeros((seeds, 3))
        for seed in range(seeds):
            true, both = self.measured(seed, count + 200)
            values = fit(both.part(slice(0, count)), self.unknowns).values
            for n, each in enumerate((self.start, values, true)):
                errors[seed, n] = pose_errors(with_geometry(self.legs, each), both.part(
                    slice(count, None)), both.frames).rms[0]
        file, mine, best = np.sqrt(np.mean(errors ** 2, axis=0))
        return (f'{count}', f'{1e6 * file:.0f}', f'{1e6 * mine:.1f}', f'{1e6 * best:.1f}',
                f'{mine / best:.2f}')


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--seeds', type=int, default=2000)
    parser.add_argument('--write', action='store_true', help='put the tables into results/')
    options = parser.parse_args()
    bench = Bench(Parameters.from_yaml(HERE.parent / 'config' / 'platform.yaml'))
    lines = [f'{processor_name()}, Python {computer.python_version()}, numpy {np.__version__}, '
             f'scipy {scipy.__version__}.', '']
    rows = [('poses', 'noise of lengths, positions, rotations', 'noise',
             'intervals with the truth', 'number with the fewest', 'with the most')]
    for count, given, noise in (
            (40, False, NOISE), (40, True, NOISE), (20, False, NOISE), (20, True, NOISE),
            (12, False, NOISE), (60, False, Noise(1e-6, 1e-5, 1e-5))):
        rows.append(bench.coverage(options.seeds, count, given, noise))
        print(*rows[-1], sep=', ', file=sys.stderr, flush=True)
    # Smallest and largest of as many independent counts, each with 95 % of the runs.
    least, most = (binom.ppf(each, options.seeds, 0.95) / options.seeds for each in (
        0.05 / bench.legs.count, 1.0 - 0.05 / bench.legs.count))
    lines += [f'Coverage of the 95 % intervals, {options.seeds} seeds; by chance alone, the '
              f'fewest of {bench.legs.count} numbers are above {least:.1%} and the most below '
              f'{most:.1%} '
              'in 95 % of such runs each. From 12 poses not all directions are identified; the '
              "intervals include that these keep the file's values:", '', *markdown(rows), '']
    rows = [('poses', 'by the file [um]', 'calibrated [um]', 'true geometry [um]', 'ratio')]
    seeds = max(options.seeds // 40, 20)
    rows += [bench.held_out(count, seeds) for count in (20, 40, 100, 400)]
    lines += [f'Position error of 200 other poses by forward kinematics, RMS of {seeds} seeds; '
              'with the true geometry only the noise of the measurement is left:', '',
              *markdown(rows), '']
    rows = [('motion', 'identifiable for each leg', 'cannot be distinguished')]
    for name, tilt in KINDS.items():
        _, measured = bench.measured(1, 60, NOISE, tilt)
        found = calibrate(bench.platform, measured.positions, measured.pose)
        rows.append((name, f'{found.identifiability.rank / 6:g} of 7',
                     (found.not_identified or '').partition(': ')[2].partition(' cannot')[0]))
    lines += [*markdown(rows), '']
    rows = [('poses', 'interval', 'designed [mm]', 'random [mm]', 'ratio')]
    for count in (20, 40):
        design = design_poses(bench.platform, count)
        for name, part in (('base joints', slice(0, 18)), ('platform joints', slice(18, 36)),
                           ('zero lengths', slice(36, 42))):
            own, other = (float(np.mean(each[part])) for each in (
                design.half_widths, design.random_half_widths))
            rows.append((f'{count}', name, f'{1e3 * own:.3g}', f'{1e3 * other:.3g}',
                         f'{other / own:.2f}'))
    lines += ['Mean half of the 95 % intervals that are predicted for designed and random poses '
              'within the limits:', '', *markdown(rows), '']
    _, measured = bench.measured(2, 1000)
    calibrate(bench.platform, measured.positions, measured.pose)  # imports and machine code
    begun, cpu = time.perf_counter(), time.process_time()
    calibrate(bench.platform, measured.positions, measured.pose)
    lines += [f'`calibrate` of 1,000 poses, with outliers, tests and validation: '
              f'{time.perf_counter() - begun:.2f} s, {time.process_time() - cpu:.2f} s of '
              'processor time.']
    print('\n'.join(lines))
    if options.write:
        write(['', *lines, ''], BEGIN, END)


if __name__ == '__main__':
    main()
