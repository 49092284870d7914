# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Run ``make demo-tune``: gains are searched over many hexapods, and drive the simulated one.

The search is that of examples/hexapod_env.py, on a GPU if there is one. Then the loop of
``make demo-loop`` runs with stewart_simulator, whose platform is heavier than the node knows, with
the gains before and after.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys

from closed_loop import demonstration, Progress, ROOT
from loop import FILES, HEAVIER, Loop
import rclpy
from stewart_dynamics import StewartPlatform

sys.path.insert(0, str(ROOT / 'examples'))
from hexapod_env import HexapodEnv, search  # noqa: E402, I100, I202


def main() -> None:
    """Search, run the loop twice, print the errors."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--hexapods', type=int, default=1024, help='on a GPU 65536')
    parser.add_argument('--trials', type=int, default=16, help='hexapods of a pair of gains')
    parser.add_argument('--rounds', type=int, default=4, help='of the search')
    parser.add_argument('--seconds', type=float, default=10.0, help='duration of the motion [s]')
    options = parser.parse_args()
    hexapod, motion = (ROOT / 'config' / name for name in FILES['telescopic'])
    with demonstration('demo-tune'):
        loop = Loop(Path(hexapod), Path(motion), options.seconds, 8.0)
        env = HexapodEnv(StewartPlatform.from_yaml(hexapod), options.hexapods, 'follow',
                         seconds=1.0, period=1e-3, noise=(2e-6, 2e-4))
        before = loop.gains
        found, errors = search(env, tuple(before.values()), options.rounds, options.trials)
        after = dict(zip(before, found.tolist(), strict=True))
        print(f'{env.hexapods}: error {1e6 * errors[0]:.1f} um before, {1e6 * errors[-1]:.1f} um '
              f'after {options.rounds} rounds', flush=True)
        rclpy.init()
        with Progress(2 * options.seconds) as progress:
            for name, gains in (('before', before), ('after', after)):
                progress.stage(name, options.seconds)
                run = loop.run(True, HEAVIER, progress.reached, gains=gains)
                print(f'{name}: {gains["proportional_gain"]:.4g} N/m, '
                      f'{gains["derivative_gain"]:.4g} N s/m: legs of stewart_simulator '
                      f'{run.errors.rms["all legs"]:.1f} um rms, '
                      f'{run.errors.peak["all legs"]:.1f} um at most', flush=True)


if __name__ == '__main__':
    main()
