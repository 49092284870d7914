# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Governed streams of random hexapods: which setpoints exceed a limit, by independent equations.

Each limit alone, and all together; demands that jump, pause, are lost, are enormous, or have rates
that do not belong to their poses. Setpoints that leave are checked by
``test/independent_limits.py``, and by the differences between them: no drive moves faster than its
limit. With ``--stops`` so are stops from some of them, which are computed here. Then the speed.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
import sys
import time
from typing import Any

import numpy as np

from stewart_dynamics import GovernedStream, Motion, Parameters, StewartPlatform
from stewart_dynamics.errors import ParameterError

sys.path.append(str(Path(__file__).parents[1] / 'test'))
from governed import (  # noqa: E402, I100
    Array, CRANK_DEMANDS, CRANK_KINDS, DEMANDS, KINDS, limited_cranks, limited_hexapod,
    random_demand, stops)
from independent_limits import exceedances  # noqa: E402, I202

HEXAPODS: dict[str, tuple[tuple[str, ...], tuple[str, ...], Callable[..., Any]]] = {
    'telescopic': (KINDS, DEMANDS, limited_hexapod),
    'crank': (CRANK_KINDS, CRANK_DEMANDS, limited_cranks)}
SAMPLES = 1500  # of a stream
# Times of a stop by its rate, between which it is within the limits: 12 leave nothing of a rate.
PARTS = np.concatenate([np.linspace(0.0, 5.0, 41), [6.0, 8.0, 12.0, 30.0]])


def exceeded(p: Parameters, motion: Motion, axes: Array) -> dict[str, int]:
    """Return how many samples exceed which limit."""
    return {name: int(wrong.sum()) for name, wrong in exceedances(p, motion, axes).items()
            if wrong.any()}


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--setpoints', type=int, default=1_000_000)
    parser.add_argument('--legs', choices=HEXAPODS, default='telescopic')
    parser.add_argument('--stops', type=int, default=0, metavar='N',
                        help='check the stop from every Nth setpoint, too')
    parser.add_argument('--seed', type=int, default=0)
    options = parser.parse_args()
    random = np.random.default_rng(options.seed)
    kinds, demands, limited = HEXAPODS[options.legs]
    rows: dict[str, Any] = {kind: [0, 0.0, {}] for kind in kinds}
    fastest, total, n, used, worst, stopped = 0.0, 0, 0, 0.0, 0.0, 0
    while total < options.setpoints:
        kind, wanted = kinds[n % len(kinds)], demands[n // len(kinds) % len(demands)]
        n += 1
        try:
            p, axes = limited(random, kind)
            stream = GovernedStream(p)
        except ParameterError:
            continue
        times, demand = random_demand(random, wanted, p, SAMPLES)
        begun = time.process_time()
        motion = stream.advance(times, demand)
        used += time.process_time() - begun
        worst = max(worst, time.process_time() - begun)
        total += len(motion)
        row = rows[kind]
        row[0] += len(motion)
        row[1] += sum(stream.held.values())
        found = exceeded(p, motion, axes)
        if options.stops:
            states = motion[::options.stops]
            stopped += len(states)
            rate = float(stream.stop_rate)
            found.update((f'{name} in a stop', count) for name, count in exceeded(
                p, stops(p, states, rate, PARTS), axes).items())
        for name, count in found.items():
            row[2][name] = row[2].get(name, 0) + count
            row[2][wanted] = row[2].get(wanted, 0) + count
            print(f'exceeded: stream {n - 1}, {kind}, {wanted}: {name}: {count}', flush=True)
        limit = p[p.leg_kind.rate_limit]
        if limit is not None:
            positions = StewartPlatform(p).inverse_kinematics(motion)
            share = (np.abs(np.diff(positions, axis=0)) / np.diff(times)[:, None] / limit).max()
            fastest = max(fastest, float(share))
    print(f'{total} setpoints of {n} streams, {stopped} stops, seed {options.seed}; '
          f'{1e6 * used / total:.1f} us a setpoint; fastest drive between two: {fastest:.3f} of '
          'its limit')
    for kind, (count, held, wrong) in rows.items():
        print(f'{kind:26} {count:8} setpoints, held back {held:8.1f} s, exceed: '
              f'{wrong or "none"}')


if __name__ == '__main__':
    main()
