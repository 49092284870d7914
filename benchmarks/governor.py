# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Governed streams of random hexapods: which setpoints exceed a limit, by independent equations.

Each limit alone, and all together; demands that jump, pause, are lost, are enormous, or have rates
that do not belong to their poses. Setpoints that leave are checked by
``test/independent_limits.py``, and by the differences between them: no leg moves faster than its
limit. Then the speed.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys
import time
from typing import Any

import numpy as np

from stewart_dynamics import GovernedStream, StewartPlatform
from stewart_dynamics.errors import ParameterError

sys.path.append(str(Path(__file__).parents[1] / 'test'))
from governed import DEMANDS, KINDS, limited_hexapod, random_demand  # noqa: E402, I100
from independent_limits import exceedances  # noqa: E402, I202


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--setpoints', type=int, default=1_000_000)
    parser.add_argument('--seed', type=int, default=0)
    options = parser.parse_args()
    random = np.random.default_rng(options.seed)
    rows: dict[str, Any] = {kind: [0, 0.0, {}] for kind in KINDS}
    fastest, total, n, used, worst = 0.0, 0, 0, 0.0, 0.0
    while total < options.setpoints:
        kind, wanted = KINDS[n % len(KINDS)], DEMANDS[n // len(KINDS) % len(DEMANDS)]
        n += 1
        p, axes = limited_hexapod(random, kind)
        try:
            stream = GovernedStream(p)
        except ParameterError:
            continue
        times, demand = random_demand(random, wanted, p, 1500)
        begun = time.process_time()
        motion = stream.advance(times, demand)
        used += time.process_time() - begun
        worst = max(worst, time.process_time() - begun)
        total += len(motion)
        row = rows[kind]
        row[0] += len(motion)
        row[1] += sum(stream.held.values())
        for name, wrong in exceedances(p, motion, axes).items():
            if wrong.any():
                row[2][name] = row[2].get(name, 0) + int(wrong.sum())
                row[2][wanted] = row[2].get(wanted, 0) + int(wrong.sum())
        if p['limits.velocity_max'] is not None:
            lengths = StewartPlatform(p).inverse_kinematics(motion)
            share = (np.abs(np.diff(lengths, axis=0)) / np.diff(times)[:, None]
                     / p['limits.velocity_max']).max()
            fastest = max(fastest, float(share))
    print(f'{total} setpoints of {n} streams, seed {options.seed}; {1e6 * used / total:.1f} us a '
          f'setpoint; fastest leg between two: {fastest:.3f} of its limit')
    for kind, (count, held, wrong) in rows.items():
        print(f'{kind:26} {count:8} setpoints, held back {held:8.1f} s, exceed: '
              f'{wrong or "none"}')


if __name__ == '__main__':
    main()
