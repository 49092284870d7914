# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Recorded legs for tests and benchmarks: motions, forces, noise, and bags of them.

The forces are not this package's: they are those of ``independent_hexapod``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from independent_hexapod import moving
import messages
import numpy as np
from numpy.typing import NDArray
from referees import rng, rotation_about

from stewart_dynamics import Motion, Parameters

Array = NDArray[np.float64]

TOPIC = '/stewart_dynamics/measured_legs'
START = 1_700_000_000_000_000_000
HOME = np.array([0.0, 0.0, 1.1])
AMPLITUDES = np.array([0.09, 0.09, 0.06, 0.12, 0.12, 0.15])  # RMS [m, rad]
MotionAt = Callable[[Array], Motion]


class Recorded(NamedTuple):
    """Recorded states of the legs, N samples."""

    times: Array
    positions: Array
    rates: Array | None
    efforts: Array


class Noise(NamedTuple):
    """Standard deviations of white noise, and other errors of the measurements."""

    length: float = 1e-5
    rate: float = 1e-3
    effort: float = 5.0
    coloured: float = 2.0
    """Of the efforts, correlated over 50 ms."""
    delay: float = 3e-3
    """Of the efforts."""
    jitter: float = 0.0
    """Time at which a sample is taken, by its stamp [s]."""
    steps: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Of positions, rates and efforts."""

    def recorded(self, times: Array, positions: Array, rates: Array | None, efforts: Array,
                 ) -> Recorded:
        """Return a recording of measured values, in steps."""
        return Recorded(times, *(
            each if each is None or not step else step * np.round(each / step)
            for each, step in zip((positions, rates, efforts), self.steps, strict=True)))


NOISE = Noise()


def fourier(seed: int, base: float = 0.1, harmonics: int = 12, size: float = 1.0) -> MotionAt:
    """Return a periodic motion around the home of config/platform.yaml."""
    a = rng(seed).normal(size=(2, harmonics, 6))
    a *= size * AMPLITUDES / np.sqrt(np.sum(a ** 2, axis=(0, 1)))
    w = 2.0 * np.pi * base * np.arange(1, harmonics + 1)[:, None]

    def at(times: Array) -> Motion:
        phase = np.asarray(times)[:, None, None] * w
        s, c = np.sin(phase), np.cos(phase)
        x, v, acc = (np.sum(each, axis=1) for each in (
            a[0] * s + a[1] * c, w * (a[0] * c - a[1] * s), -w ** 2 * (a[0] * s + a[1] * c)))
        return Motion.from_euler(x[:, :3] + HOME, x[:, 3:], v[:, :3], v[:, 3:], acc[:, :3],
                                 acc[:, 3:])

    return at


def at_rest(times: Array) -> Motion:
    """Return the home pose at rest."""
    return Motion(np.tile(HOME, (len(times), 1)), np.tile(np.eye(3), (len(times), 1, 1)))


def about(axis: Sequence[float], amplitude: float = 0.15, frequency: float = 0.5) -> MotionAt:
    """Return turning to and fro about one axis through the platform's origin."""
    unit = np.array(axis) / np.linalg.norm(axis)
    w = 2.0 * np.pi * frequency

    def at(times: Array) -> Motion:
        s, c = np.sin(w * times)[:, None], np.cos(w * times)[:, None]
        still = np.zeros((len(times), 3))
        return Motion(HOME + still, [rotation_about(unit, amplitude * each) for each in s[:, 0]],
                      still, amplitude * w * c * unit, still, -amplitude * w * w * s * unit)

    return at


def recorded(p: Parameters, motion: MotionAt, seconds: float, rate: float, seed: int,
             noise: Noise = NOISE, forces: Array | None = None, with_rates: bool = True,
             ) -> Recorded:
    """
    Return a recording of a motion of a hexapod.

    Parameters
    ----------
    p : Parameters
        Parameters of the true hexapod.
    motion : callable
        The motion as a function of times [s].
    seconds, rate : float
        Length [s] and samples per second.
    seed : int
        Seed of the noise.
    noise : Noise
        Noise to add.
    forces : (N, 6), optional
        True forces of the motion, begun ``noise.delay`` earlier; by default those of ``moving``.
    with_rates : bool
        Rates are measured.

    """
    random = rng(1000 + seed)
    times = np.arange(round(seconds * rate)) / rate
    taken = times + noise.jitter * random.normal(size=len(times)) if noise.jitter else times
    found = moving(p, motion(taken))
    if forces is None:
        forces = moving(p, motion(taken - noise.delay)).forces
    return noise.recorded(
        times, found.lengths - p['geometry.zero_length']
        + noise.length * random.normal(size=(len(times), 6)),
        found.rates + noise.rate * random.normal(size=(len(times), 6)) if with_rates else None,
        forces + noise.effort * random.normal(size=forces.shape)
        + noise.coloured * coloured(random, len(times), 0.05 * rate))


def coloured(random: np.random.Generator, many: int, correlation: float) -> Array:
    """Return noise (many, 6) of deviation 1, with the correlation length in samples."""
    size = 1 << (2 * many - 1).bit_length()
    w = 2.0 * np.pi * np.fft.rfftfreq(size)
    shape = 1.0 / np.sqrt(1.0 + (w * correlation) ** 2)
    white = np.fft.rfft(random.normal(size=(size, 6)), axis=0)
    noise = np.fft.irfft(shape[:, None] * white, size, axis=0)[:many]
    power = (2.0 * np.sum(shape ** 2) - shape[0] ** 2 - shape[-1] ** 2) / size
    found: Array = noise / np.sqrt(power)
    return found


def write_bag(folder: Path, given: Recorded, joints: Sequence[str], topic: str = TOPIC,
              start: int = START) -> Path:
    """Write a bag with the recording, in MCAP."""
    stamps = start + np.round(given.times * 1e9).astype(np.int64)
    return messages.write_bag(
        folder, messages.leg_states(stamps, joints, given.positions, given.rates, given.efforts,
                                    topic), **{topic.rpartition('/')[2]: messages.JOINT_STATE})
