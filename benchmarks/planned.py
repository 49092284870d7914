# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Planned trajectories: time of the node to check one, and latency of setpoints meanwhile.

Run by hand, ``make bench-planned``, on Linux; see README.md beside this file.
"""

from __future__ import annotations

import argparse
from importlib.metadata import version
import os
from pathlib import Path
import platform
import tempfile
import time

from inverse_dynamics import Array, markdown, processor_name, write
from latency import trajectory
from node import (
    DOMAIN, EACH, Measurement, ours, PARAMETERS, Process, RATE, role, SETTLE, SHARED_MEMORY, Turn)
import numpy as np

from stewart_dynamics import Parameters
from stewart_dynamics.arrays import NO_WRENCH
from stewart_dynamics.planned import trajectory_messages as planned

BEGIN, END = '<!-- planned: begin -->', '<!-- planned: end -->'
POINTS = 10_000
ROUNDS = 8
SECONDS = 5
ALONE = 10


class Planned(Measurement):
    """
    The node with a stream of setpoints, in turns with and without a trajectory each second.

    Parameters
    ----------
    rounds, seconds : int
        How many turns of either kind, and how long each is.
    folder : Path
        Gets the times.

    """

    def __init__(self, rounds: int, seconds: int, folder: Path) -> None:
        order = [n % 2 == 0 for n in range(rounds)]
        # The first turn is not measured.
        self.plans = [False, *(each for first in order for each in (first, not first))]
        self._seconds = seconds
        super().__init__([ours('planned', 'separate')],
                         [(0, seconds * RATE)] * len(self.plans), folder)

    def measure(self) -> tuple[list[Turn], list[Turn], Array, Array]:
        """
        Return turns without and with trajectories, times of these alone and beside setpoints.

        Times (N, 2) [ms]: to publish a trajectory, and from then to its answer.
        """
        path = self._folder / 'planned.npz'
        with self._processes() as (nodes, source, _):
            planner = Process(role('plan', str(path), 'planned', str(POINTS)), {
                'ROS_DOMAIN_ID': DOMAIN, 'ROS_LOG_DIR': str(self._folder / 'log'),
                **SHARED_MEMORY.source})
            planner.expect('ready')

            def plan(number: int) -> None:
                assert planner.process.stdin is not None
                planner.process.stdin.write(f'{number}\n')
                planner.process.stdin.flush()

            plan(ALONE)
            planner.expect('done')
            for beside in self.plans:
                time.sleep(SETTLE)
                processor, begin = nodes[0].processor, time.monotonic()
                source.go()
                if beside:
                    plan(self._seconds)
                    planner.expect('done')
                source.expect('done')
                self._cores.append(
                    (nodes[0].processor - processor) / (time.monotonic() - begin))
            planner.process.communicate(timeout=60)
            time.sleep(SETTLE)
        turns = list(zip(self._read(), self.plans, strict=True))[1:]
        times = np.diff(np.load(path)['times'], axis=1) * 1e-6
        return ([turn for turn, beside in turns if not beside],
                [turn for turn, beside in turns if beside], times[:ALONE], times[ALONE:])


def pieces() -> tuple[float, int]:
    """Return the largest piece of the work [ms of the processor] and how many there are."""
    parameters, data = Parameters.from_yaml(PARAMETERS), trajectory(POINTS)
    of_runs = []
    for _ in range(9):
        work, took = planned.answer(parameters, NO_WRENCH, data), []
        outcome = None
        while outcome is None:
            begin = time.thread_time_ns()
            outcome = next(work)
            took.append((time.thread_time_ns() - begin) * 1e-6)
        of_runs.append(took)
    # The minimum is the time of a piece itself, without other work of the computer.
    least = np.min(of_runs[1:], axis=0)
    return float(least.max()), len(least)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--rounds', type=int, default=ROUNDS, help='turns of each (%(default)s)')
    parser.add_argument('--seconds', type=int, default=SECONDS, help='of a turn (%(default)s)')
    parser.add_argument('--write', action='store_true', help='put the tables into results/')
    options = parser.parse_args()
    if options.rounds < 1 or options.seconds < 1:
        parser.error('--rounds and --seconds must be at least 1')
    with tempfile.TemporaryDirectory() as name:
        without, beside, alone, streaming = Planned(
            options.rounds, options.seconds, Path(name)).measure()
    rows: list[tuple[str, ...]] = [
        (f'from sending {POINTS:,} points to their answer (ms)', 'median', 'max', 'trajectories')]
    for label, times in (('alone', alone), ('beside setpoints at 1 kHz', streaming)):
        rows.append((label, f'{np.median(times.sum(axis=1)):.0f}',
                     f'{times.sum(axis=1).max():.0f}', str(len(times))))
    lines = ['', *markdown(rows), '']
    rows = [('latency of setpoints (us)', 'p50', 'p99', 'p99.9', 'max', 'lost', 'of a core')]
    for label, turns in (('no planned trajectory', without), ('one each second', beside)):
        latencies = np.concatenate([turn.latencies for turn in turns])
        rows.append((label, *(f'{value:,.0f}' for value in np.percentile(latencies, EACH)),
                     str(sum(turn.lost for turn in turns)),
                     f'{np.mean([turn.cores for turn in turns]):.0%}'))
    largest, many = pieces()
    message = np.concatenate([alone, streaming])[:, 0]
    lines += [*markdown(rows), '', (
        f'The work is done in {many} pieces, the largest of which takes {largest:.2f} ms of the '
        f'processor. To hand the middleware a message of {len(trajectory(POINTS)) / 1e6:.1f} MB '
        f'takes {np.median(message):.1f} ms in the middle, {np.percentile(message, 90):.1f} ms '
        'for one of ten.'), '']
    versions = ', '.join(f'{name} {version(name)}' for name in ('numpy', 'ros-rclpy'))
    lines += [f'{processor_name()}, {len(os.sched_getaffinity(0))} cores. Python '
              f'{platform.python_version()}, {versions}. {options.rounds} turns of '
              f'{options.seconds} s each.', '']
    print('\n'.join(lines))
    if options.write:
        write(lines, BEGIN, END)


if __name__ == '__main__':
    main()
