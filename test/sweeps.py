# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Sine sweeps, with which designed motions are compared in tests and benchmarks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics import Motion
from stewart_dynamics.identification.identification_options import DesignOptions
from stewart_dynamics.identification.motion_design import DesignLimits
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform

Array = NDArray[np.float64]

LOWEST = 0.1  # of a sweep [Hz]


def sweep(platform_: StewartPlatform, options: DesignOptions, together: bool) -> Motion:
    """
    Return a sine sweep about home, as large as the limits allow.

    Each coordinate from LOWEST to the design's highest frequency, by the same factor in the same
    time (exponential): one coordinate after the other, or all at once with phases in between.
    """
    limits = DesignLimits(platform_, options.amplitude)
    times = np.arange(0.0, options.duration, 1.0 / (100.0 * options.frequency))
    each = options.duration if together else options.duration / 6.0
    growth = np.log(options.frequency / LOWEST) / each
    local = times if together else np.mod(times, each)
    which = np.zeros(len(times), dtype=int) if together else (times // each).astype(int)
    omega = 2.0 * np.pi * LOWEST * np.exp(growth * local)
    phase = (omega - 2.0 * np.pi * LOWEST) / growth
    poses, rates, accelerations = np.zeros((3, len(times), 6))
    size = platform_.parameters['singularity.characteristic_length']
    for n in range(6):
        at = np.ones(len(times), dtype=bool) if together else which == n
        angle = phase[at] + (n * np.pi / 6.0 if together else 0.0)
        amplitude = 0.01 if n < 3 else 0.01 / size
        poses[at, n] = amplitude * np.sin(angle)
        rates[at, n] = amplitude * omega[at] * np.cos(angle)
        accelerations[at, n] = amplitude * (
            omega[at] * growth * np.cos(angle) - omega[at] ** 2 * np.sin(angle))
    parts = [np.ones(len(times), dtype=bool)] if together else [which == n for n in range(6)]
    for part in parts:
        for _ in range(20):
            rows = _motion(limits, poses[part], rates[part], accelerations[part]).rows[None]
            factor = 1.0 / float(limits.excess(rows)[0])
            for values in (poses, rates, accelerations):
                values[part] *= factor
    return _motion(limits, poses, rates, accelerations)


def _motion(limits: DesignLimits, pose: Array, rate: Array, acceleration: Array) -> Motion:
    pose = limits.center + pose
    return Motion.from_euler(pose[:, :3], pose[:, 3:], rate[:, :3], rate[:, 3:],
                             acceleration[:, :3], acceleration[:, 3:])
