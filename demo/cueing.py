# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Motion cueing of a drive through town: demanded and achieved as a picture, and use of limits.

``make demo-cueing`` runs it. The drive is that of examples/town_drive.py.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys
import time

import matplotlib
import numpy as np
from stewart_dynamics import MotionCueing, Parameters
from stewart_dynamics.cueing.recorded_vehicle import RecordedVehicle
from stewart_dynamics.cueing.report import cued, used_limits

matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402, I100, I202

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / 'examples'))
from town_drive import drive  # noqa: E402, I100, I202

# By the kind of legs: the hexapod, and gains that use it on this drive, translation, tilt and
# rotation.
HEXAPODS = {
    'telescopic': ('platform.yaml', [0.9, 1.0, 1.0], [1.0, 1.0], [1.0, 1.0, 1.0]),
    'crank': ('crank_platform.yaml', [0.42, 0.41, 1.0], [1.0, 0.72], [1.0, 1.0, 0.42])}
WANTED, FELT = '#0072b2', '#d55e00'
CURVES = ((0, 'surge [m/s²]'), (1, 'sway [m/s²]'), (2, 'heave [m/s²]'), (5, 'yaw [rad/s]'))


def main() -> None:
    """Draw the picture and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--output', type=Path, default=Path('motion_cueing.png'), metavar='FILE',
                        help='the picture (default: %(default)s)')
    parser.add_argument('--legs', choices=HEXAPODS, default='telescopic',
                        help='legs of the hexapod (default: %(default)s)')
    options = parser.parse_args()
    output = options.output
    file, translation, tilt, rotation = HEXAPODS[options.legs]
    parameters = Parameters.from_yaml(ROOT / 'config' / file).replaced({
        'cueing.translation.gain': translation, 'cueing.tilt.gain': tilt,
        'cueing.rotation.gain': rotation})
    vehicle = RecordedVehicle(*drive())
    begun = time.perf_counter()
    found = cued(MotionCueing(parameters), vehicle)
    seconds = time.perf_counter() - begun
    used = used_limits(parameters, vehicle.times, found.motion)
    figure, axes = pyplot.subplots(len(CURVES) + 1, 1, sharex=True, figsize=(9.0, 9.5),
                                   layout='constrained')
    for axis, (n, title) in zip(axes, CURVES, strict=False):
        axis.plot(vehicle.times, found.wanted[:, n], color=WANTED, lw=1.1, label='demanded')
        axis.plot(vehicle.times, found.felt[:, n], color=FELT, lw=1.2, label='achieved')
        axis.set_ylabel(title)
    axes[0].legend(loc='lower left', ncols=2, frameon=False)
    for name, each in used.items():
        axes[-1].plot(np.linspace(0.0, vehicle.times[-1], len(each)), 100.0 * each, lw=1.1,
                      label=name)
    axes[-1].set_ylabel('use of limits [%]')
    axes[-1].legend(loc='upper left', ncols=4, frameon=False)
    axes[-1].set_ylim(0.0, 115.0)
    axes[-1].set_xlabel('time [s]')
    for axis in axes:
        axis.grid(color='#e7ebf0')
        axis.spines[['top', 'right']].set_visible(False)
    figure.align_ylabels()
    figure.savefig(output, dpi=110, metadata={'Software': None})
    print(f'a drive of {vehicle.times[-1]:.0f} s, computed in {seconds:.2f} s; largest use: '
          + ', '.join(f'{name} {each.max():.0%}' for name, each in used.items()))
    held = sum(found.held.values())
    print(f'limits held it back for {held:.3f} s' if held else 'no limit held it back', output,
          sep='\n')


if __name__ == '__main__':
    main()
