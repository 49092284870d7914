# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A hexapod computed without this package: forces of a motion, and motion under control.

The equations are those of virtual power, in independent_hexapod.c, which is compiled here and now.
Nothing is taken from this package besides the values of the parameter file.
``test_estimate_cases`` compares both.
"""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path
import shutil
import subprocess
import sys
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from stewart_dynamics import Motion, Parameters

Array = NDArray[np.float64]


def hexapod_of(p: Parameters) -> Array:
    """Return the numbers of a parameter file, as the structure in C has them."""
    xx, xy, xz, yy, yz, zz = p['platform.inertia']
    legs = [p[f'legs.{part}.{name}'] for part in ('cylinder', 'piston')
            for name in ('mass', 'center_of_mass', 'inertia')]
    actuators = [p[f'actuator.{name}'] for name in (
        'reflected_mass', 'viscous_friction', 'coulomb_friction', 'coulomb_velocity')]
    return np.hstack([np.ravel(each) for each in (
        p['geometry.base_joints'], p['geometry.platform_joints'], np.transpose(legs),
        np.transpose(actuators), p['platform.mass'], p['platform.center_of_mass'],
        (xx, xy, xz, xy, yy, yz, xz, yz, zz), p['gravity'])])


@cache
def _library() -> ctypes.CDLL:
    compiler = shutil.which('cc') or shutil.which('gcc')
    command = [compiler] if compiler else [sys.executable, '-m', 'ziglang', 'cc']
    with TemporaryDirectory() as folder:
        made = Path(folder, 'independent_hexapod.so')
        subprocess.run([*command, '-std=c99', '-O2', '-shared', '-fPIC', '-Wall', '-Werror',
                        Path(__file__).with_suffix('.c'), '-o', made, '-lm'], check=True)
        return ctypes.CDLL(str(made))


def _legs(function: str, p: Parameters, count: int, *arguments: Any) -> Legs:
    """Return the legs that a function in C writes for a number of samples."""
    legs = np.empty((count, 3, 6))
    # arrays that live until the call ends
    passed = [each if isinstance(each, (int, float)) else np.ascontiguousarray(each)
              for each in (hexapod_of(p), count, *arguments, legs)]
    _library()[function](*(
        ctypes.c_size_t(each) if isinstance(each, int) else ctypes.c_double(each)
        if isinstance(each, float) else ctypes.c_void_p(each.ctypes.data) for each in passed))
    return Legs(*np.moveaxis(legs, 1, 0))


class Legs(NamedTuple):
    """Lengths [m], rates [m/s] and forces [N] of the legs at some times, (N, 6) each."""

    lengths: Array
    rates: Array
    forces: Array


def moving(p: Parameters, motion: Motion) -> Legs:
    """Return the legs of a hexapod in a motion (N,)."""
    return _legs('moving', p, len(motion), motion.position, motion.rotation,
                 motion.rows[:, 12:18], motion.rows[:, 18:24])


class Controlled:
    """
    A hexapod whose legs follow a motion, from its first pose at rest.

    Proportional and derivative control of each leg at 1 kHz; the forces are held in between.
    """

    PERIOD = 1e-3  # [s]
    PARTS = 2  # steps of the integration in a period
    GAINS = np.array([2e5, 5e3])  # [N/m], [N s/m]

    def __init__(self, p: Parameters, motion: Motion) -> None:
        target = moving(p, motion)
        still = Motion(motion.position[:1], motion.rotation[:1])
        lengths, rates, self._forces = _legs(
            'controlled', p, len(motion), motion.position[0], motion.rotation[0], target.lengths,
            target.rates, moving(p, still).forces[0], self.GAINS, self.PERIOD, self.PARTS)
        times = self.PERIOD * np.arange(len(lengths))
        self._middles = times + 0.5 * self.PERIOD
        self._lengths = CubicHermiteSpline(times, lengths, rates)

    def __call__(self, times: Array) -> Legs:
        """Return the legs at times [s], with the mean force of a period around each."""
        forces = [np.interp(times, self._middles, each) for each in self._forces.T]
        return Legs(self._lengths(times), self._lengths(times, 1), np.stack(forces, axis=-1))
