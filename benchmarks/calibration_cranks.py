# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Calibration of a hexapod with cranks: errors and coverage of the intervals of each stage.

60 poses, angles with 0.2 degrees of noise, poses with 0.3 % of the length of a crank; the hexapod
deviates from its drawing in the numbers of the stage alone. Poses are those of
``test/measured_cranks.py``, a forward kinematics of its own.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys

import numpy as np
from stewart_dynamics import Parameters
from stewart_dynamics.arrays import Array
from stewart_dynamics.calibration.assembly_errors import assembly_errors
from stewart_dynamics.calibration.equations import (
    Equations, GEOMETRY, held_by_groups, values_of)
from stewart_dynamics.calibration.geometry_fit import fit, Unknowns
from stewart_dynamics.estimation.confidence_level import TWO_SIDED

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / 'test'))

from measured_cranks import Built  # noqa: E402, I100, I202

STAGES = ('zero',), ('zero', 'lengths'), ('zero', 'lengths', 'axes', 'joints')


def figures(parameters: Parameters, stage: tuple[str, ...], seeds: int, count: int) -> str:
    """Return a row of the table of a stage."""
    legs = parameters.leg_kind.calibrated_legs(parameters)
    held = held_by_groups(legs, stage)
    unknowns = Unknowns.of(legs, values_of(legs), parameters.singularity.characteristic_length,
                           held, False)
    errors = np.zeros((seeds, legs.count))
    inside = np.zeros((seeds, legs.count), dtype=bool)
    size = 1.0
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        built = Built(parameters).deviate(rng, stage)
        found = fit(Equations(legs, *built.measure(rng, count)), unknowns)
        size = built.size
        errors[seed] = found.values[GEOMETRY] - built.values()
        what = found.identifiability
        deviations = np.sqrt(np.diag(found.covariance) + (what.shares * what.scales) ** 2)
        inside[seed] = np.abs(errors[seed]) < TWO_SIDED * deviations[GEOMETRY]

    def rms(name: str) -> Array:
        return np.asarray(np.sqrt(np.mean(errors[:, legs.parts[name]] ** 2)))

    of_each = inside[:, ~held].mean(axis=0)
    return ' | '.join([
        f'| {",".join(stage)}', f'{np.count_nonzero(~held)}', f'{seeds}',
        f'{np.degrees(rms("geometry.crank_directions")):.3f} deg',
        f'{np.degrees(rms("geometry.crank_axes")):.2f} deg',
        *(f'{100.0 * rms(name) / size:.2f} %' for name in (
            'legs.crank.length', 'legs.rod.length', 'geometry.base_joints',
            'geometry.platform_joints')),
        f'{inside[:, ~held].mean():.1%}', f'{of_each.min():.1%}', f'{of_each.max():.1%} |'])


def teeth(parameters: Parameters, spread: float, seeds: int) -> str:
    """Return how often one tooth of 25 is named, by the deviation of the other zeros [deg]."""
    legs = parameters.leg_kind.calibrated_legs(parameters)
    held, errors = np.zeros(legs.count, dtype=bool), np.full(legs.count, np.radians(0.05))
    named = right = alone = false = 0
    for seed in range(seeds):
        values = legs.values()
        values[legs.zero] += np.radians(np.random.default_rng(seed).normal(0.0, spread, 6))
        false += bool(assembly_errors(legs, values, errors, held))
        values[legs.zero.start + 1] += np.radians(14.4)
        texts = [each.text for each in assembly_errors(legs, values, errors, held)]
        named += any('leg_2' in each for each in texts)
        right += any('leg_2' in each and '14.4 deg of 25' in each for each in texts)
        alone += any('leg_2' in each and '(14.4 deg of 25)' in each for each in texts)
    return ' | '.join([f'| {spread:g} deg', *(
        f'{each / seeds:.0%}' for each in (named, right, alone)), f'{false / seeds:.0%} |'])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--seeds', type=int, default=200)
    parser.add_argument('--poses', type=int, default=60)
    parser.add_argument('--params', type=Path, default=ROOT / 'config' / 'crank_platform.yaml')
    options = parser.parse_args()
    parameters = Parameters.from_yaml(options.params)
    print('| unknowns | numbers | seeds | zero | axis | L1 | L2 | base joint | platform joint | '
          'inside | lowest | highest |')
    print('| --- ' * 12 + '|')
    for stage in STAGES:
        print(figures(parameters, stage, options.seeds, options.poses), flush=True)
    print('\n| other zeros | named | with 25 teeth | with 25 teeth alone | named without one |')
    print('| --- ' * 5 + '|')
    for spread in (0.05, 0.2, 0.5, 1.0, 2.0, 3.0):
        print(teeth(parameters, spread, 2 * options.seeds))


if __name__ == '__main__':
    main()
