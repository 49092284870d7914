# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The payload of the node: what setpoints pay for it, and how often its intervals hold.

Run by hand on Linux; see README.md beside this file.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from importlib.metadata import version
import os
from pathlib import Path
import platform
import tempfile
import time

from inverse_dynamics import Array, HERE, markdown, processor_name, write
from latency import PARAMETERS
from node import HEADER, in_turns, latency_rows, ours
import numpy as np

from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.arrays import NO_WRENCH
from stewart_dynamics.external_wrench.estimate import Estimate
from stewart_dynamics.external_wrench.measured_legs import LegHistory
from stewart_dynamics.external_wrench.payload import identify, NAMES, numbers_of, PayloadOutcome
from stewart_dynamics.reference_motion.motion_functions import motion_at
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters

BEGIN, END = '<!-- payload: begin -->', '<!-- payload: end -->'
BEGIN_COVERAGE, END_COVERAGE = '<!-- payload coverage: begin -->', '<!-- payload coverage: end -->'
ROUNDS = 6
SECONDS = 5
SEEDS = 200

GIVEN = Parameters.from_yaml(PARAMETERS)
TRUE = GIVEN.replaced({
    'platform.mass': 172.0, 'platform.center_of_mass': [0.05, 0.02, 0.16],
    'platform.inertia': [15.0, 0.1, -0.6, 15.5, 0.3, 23.0]})
VALUES = np.array([TRUE.platform.mass, *TRUE.platform.center_of_mass,
                   *TRUE.platform.inertia])
RATE = 1000.0  # [Hz]
WINDOW = 10.0  # [s]
# Standard deviations of rates [m/s] and forces [N]; forces also with noise of 0.05 s.
NOISES = {'1 mm/s, 5 N': (1e-3, 5.0, 0.0), '5 N': (0.0, 5.0, 0.0),
          '1 mm/s, 5 N, 2 N coloured': (1e-3, 5.0, 2.0)}


def motion(times: Array) -> Motion:
    """Return the motion of config/trajectory_fourier.yaml, repeated."""
    return motion_at(ReferenceMotionParameters.from_yaml(
        HERE.parent / 'config' / 'trajectory_fourier.yaml').replaced({'loop': True}), times)


def measured(noise: tuple[float, float, float]) -> Callable[[int], LegHistory]:
    """Return what makes a history of measurements from a seed."""
    times = 2.0 + np.arange(round(WINDOW * RATE) + 1) / RATE
    stamps = np.rint(times * 1e9).astype(np.int64).tolist()
    platform_, moved = StewartPlatform(TRUE), motion(times)
    forces = platform_.inverse_dynamics(motion(times - 0.5 / RATE)).forces
    jacobians = platform_.inverse_jacobian(moved)

    def of_seed(seed: int) -> LegHistory:
        random = np.random.default_rng(seed)
        of_rates, of_forces, coloured = noise
        rows = moved.rows.copy()
        rows[:, 12:18] += np.linalg.solve(
            jacobians, of_rates * random.normal(size=(*forces.shape, 1)))[..., 0]
        slow = np.zeros(6)
        memory = np.exp(-1.0 / (0.05 * RATE))
        history = LegHistory(WINDOW)
        for stamp, row, force, white, new in zip(
                stamps, rows.tolist(), forces, of_forces * random.normal(size=forces.shape),
                coloured * np.sqrt(1.0 - memory ** 2) * random.normal(size=forces.shape),
                strict=True):
            slow = memory * slow + new
            history.add_measurement(tuple((force + white + slow).tolist()),
                                    Estimate(stamp, tuple(row), None, None), NO_WRENCH)
        return history

    return of_seed


def outcome_of(history: LegHistory) -> tuple[PayloadOutcome, Array]:
    """Return the outcome, and how long the pieces took [ms of the processor]."""
    work, took = identify(history, StewartPlatform(GIVEN)), []
    outcome = None
    while outcome is None:
        begin = time.thread_time_ns()
        outcome = next(work)
        took.append((time.thread_time_ns() - begin) * 1e-6)
    return outcome, np.array(took)


def coverage(seeds: int) -> list[str]:
    """Return the table of how many intervals contain the true value."""
    rows: list[tuple[str, ...]] = [
        ('noise of each leg', *(name.replace('center of mass', 'center') for name in NAMES))]
    for label, noise in NOISES.items():
        history_of = measured(noise)
        inside, widths = [], []
        for seed in range(seeds):
            outcome, _ = outcome_of(history_of(seed))
            assert outcome.payload is not None
            fitted = outcome.payload.fitted
            inside.append(np.abs(np.array(numbers_of(fitted.body)) - VALUES)
                          <= fitted.half_widths)
            widths.append(fitted.half_widths)
        rows.append((label, *(f'{each:.1%}' for each in np.mean(inside, axis=0))))
        rows.append(('half width', *(f'{each:.2g}' for each in np.mean(widths, axis=0))))
    return ['', *markdown(rows), '', f'{seeds} seeds each.', '']


def latency(rounds: int, seconds: int, folder: Path) -> list[str]:
    """Return the table of a node that is asked each second beside one that is not."""
    nodes = [ours('asked', 'separate'), ours('measured', 'separate')]
    turns = in_turns(nodes, rounds, seconds, folder, beside='weigh')
    cells: list[tuple[str, ...]] = [HEADER[:-4] + ('p50, times other', 'p99, times other')]
    labels: Mapping[int, str] = {0: 'payload identified each second', 1: 'measured legs alone'}
    for n, row in enumerate(latency_rows('', nodes, turns, beside=1)):
        cells.append((labels[n], *row[1:-2]))
    history = measured(NOISES['1 mm/s, 5 N'])(1)
    # The minimum is the time of a piece itself, without other work of the computer.
    least = np.min([outcome_of(history)[1] for _ in range(9)], axis=0)
    return ['', *markdown(cells), '', (
        f'The work on {WINDOW:.0f} s at 1 kHz takes {least.sum():.0f} ms of the processor, in '
        f'{len(least)} pieces, the largest of which takes {least.max():.2f} ms.'), '']


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--rounds', type=int, default=ROUNDS, help='turns of each (%(default)s)')
    parser.add_argument('--seconds', type=int, default=SECONDS, help='of a turn (%(default)s)')
    parser.add_argument('--coverage', action='store_true',
                        help='how often the intervals hold, in place of the latency')
    parser.add_argument('--seeds', type=int, default=SEEDS, help='for that (%(default)s)')
    parser.add_argument('--write', action='store_true', help='put the tables into results/')
    options = parser.parse_args()
    if min(options.rounds, options.seconds, options.seeds) < 1:
        parser.error('--rounds, --seconds and --seeds must be at least 1')
    if options.coverage:
        marks, lines = (BEGIN_COVERAGE, END_COVERAGE), coverage(options.seeds)
    else:
        with tempfile.TemporaryDirectory() as name:
            marks, lines = (BEGIN, END), latency(options.rounds, options.seconds, Path(name))
        versions = ', '.join(f'{name} {version(name)}' for name in ('numpy', 'ros-rclpy'))
        lines += [f'{processor_name()}, {len(os.sched_getaffinity(0))} cores. Python '
                  f'{platform.python_version()}, {versions}. {options.rounds} turns of '
                  f'{options.seconds} s each.', '']
    print('\n'.join(lines))
    if options.write:
        write(lines, *marks)


if __name__ == '__main__':
    main()
