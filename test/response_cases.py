# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Recordings of axes that follow their setpoints as drives of second order do, and the truth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from msgspec import to_builtins
import numpy as np
from numpy.typing import NDArray
from referees import rng
from scipy import signal

from stewart_dynamics.response.axes_response import AXES, axes_response
from stewart_dynamics.response.even_samples import Run, Runs

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

RATE, SECONDS, BEFORE = 100.0, 60.0, 10.0
# The axes are analyzed up to 10 Hz.
HIGHEST = 10.0
NOISES = (1e-4, 1e-3, 1e-2)
SIZE = 0.5  # characteristic length [m]


class Drive(NamedTuple):
    """A drive of second order behind a delay."""

    frequency: float
    damping: float
    delay: float

    def at(self, frequencies: Array) -> Complex:
        """Return the response at frequencies [Hz]."""
        s, w = 2j * np.pi * frequencies, 2.0 * np.pi * self.frequency
        found: Complex = w * w / (s * s + 2.0 * self.damping * w * s + w * w) * np.exp(
            -s * self.delay)
        return found


def multisine(sets: Sequence[Array], random: np.random.Generator, times: Array) -> Array:
    """Return sums of sines of the same velocity, of a set of frequencies for each axis."""
    return np.stack([np.sum([np.sin(2.0 * np.pi * f * times + random.uniform(0.0, 2.0 * np.pi)) / f
                             for f in frequencies], axis=0) for frequencies in sets], axis=1)


def periodic(random: np.random.Generator, times: Array, axes: int) -> Array:
    """Return multisines with a period of 10 s, whose axes share no line."""
    lines = np.unique(np.round(np.geomspace(1.0, 99.0, 12 * axes + 12))) / 10.0
    return multisine([lines[n::axes] for n in range(axes)], random, times)


def between(random: np.random.Generator, times: Array, axes: int) -> Array:
    """Return sines anywhere between the lines of the record."""
    lines = np.geomspace(0.13, 9.0, 14 * axes) * np.exp(random.uniform(-0.02, 0.02, 14 * axes))
    return multisine([lines[n::axes] for n in range(axes)], random, times)


def same_lines(random: np.random.Generator, times: Array, axes: int) -> Array:
    """Return the same lines, between those of the record, with other phases for each axis."""
    return multisine([1.0031 * np.geomspace(0.15, 9.0, 24)] * axes, random, times)


def chirp(random: np.random.Generator, times: Array, axes: int) -> Array:
    """Return sweeps, one axis slow to fast, the next fast to slow."""
    part = np.maximum(times - BEFORE, 0.0) / SECONDS
    up = 0.1 * SECONDS * (80.0 ** part - 1.0) / np.log(80.0)
    down = 8.0 * part * SECONDS - 3.95 * part ** 2 * SECONDS
    return np.stack([np.sin(2.0 * np.pi * (down if n % 2 else up) + random.uniform(0.0, 6.0))
                     for n in range(axes)], axis=1)


def noise(random: np.random.Generator, times: Array, axes: int) -> Array:
    """Return random noise from 0.1 to 6 Hz."""
    band = signal.butter(2, [0.1, 6.0], 'band', fs=RATE, output='sos')
    return np.asarray(signal.sosfilt(band, random.normal(size=(len(times), axes)), axis=0))


def steps(random: np.random.Generator, times: Array, axes: int) -> Array:
    """Return trapezoids of random heights, durations and slopes."""
    found = []
    for _ in range(axes):
        lengths = np.ravel(np.column_stack([random.uniform(1.0, 4.0, 60),
                                            random.uniform(0.1, 0.5, 60)]))
        levels = np.repeat(random.uniform(-1.0, 1.0, 60), 2)
        found.append(np.interp(times, np.cumsum(lengths), np.append(0.0, levels[:-1])))
    return np.stack(found, axis=1)


def vehicle(random: np.random.Generator, times: Array, axes: int) -> Array:
    """Return a drive: slow random motion whose sources move several axes at once."""
    sources = random.normal(size=(len(times), axes + 1))
    for n in range(axes + 1):
        low = signal.butter(2, random.uniform(0.5, 3.0), fs=RATE, output='sos')
        high = signal.butter(1, 0.1, 'high', fs=RATE, output='sos')
        sources[:, n] = signal.sosfilt(high, signal.sosfilt(low, sources[:, n]))
    mixed = 0.4 * random.normal(size=(axes + 1, axes))
    mixed[:axes] += np.eye(axes)
    return np.asarray(sources / sources.std(axis=0) @ mixed)


EXCITATIONS: dict[str, Callable[[np.random.Generator, Array, int], Array]] = {
    'periodic lines': periodic, 'lines between bins': between, 'the same lines': same_lines,
    'chirps': chirp, 'random noise': noise, 'trapezoids': steps, 'vehicle': vehicle}


class Judged(NamedTuple):
    """How a recording was answered."""

    own: list[bool]  # whether bands of an axis that was moved contain the truth
    radii: list[float]  # of the bands, by the gain
    bandwidths: list[float]  # stated -3 dB by the true one
    delays: list[float]  # stated delay less the true one [s]
    stated: int  # axes with a number
    false: int  # cross terms that are stated


def judged(kind: str, axes: int, level: float, seed: int) -> Judged:
    """Return the answers to a recording of some axes; noise by the RMS of the motion."""
    random = rng(1000 * seed + 10 * axes + list(EXCITATIONS).index(kind))
    times = np.arange(round((BEFORE + SECONDS) * RATE)) / RATE
    moved = sorted(random.permutation(6)[:axes].tolist())
    drives = [Drive(random.uniform(2.0, 8.0), random.uniform(0.5, 1.0), random.uniform(0.0, 0.03))
              for _ in moved]
    x = EXCITATIONS[kind](random, times, axes)
    x = 0.01 * x / x.std(axis=0) * np.clip(times / 3.0, 0.0, 1.0)[:, None] ** 2
    whole = 2 * len(x)
    f = np.fft.rfftfreq(whole, 1.0 / RATE)
    y = np.fft.irfft(np.fft.rfft(x, whole, axis=0) * np.stack(
        [drive.at(f) for drive in drives], axis=1), whole, axis=0)[:len(x)]
    begin = round(BEFORE * RATE)
    commanded, achieved = np.zeros((2, len(x) - begin, 6))
    scale = np.where(np.array(moved) < 3, SIZE, 1.0)
    commanded[:, moved], achieved[:, moved] = scale * x[begin:], scale * y[begin:]
    achieved += level * 0.01 * random.normal(size=achieved.shape) * ([SIZE] * 3 + [1.0] * 3)
    run = Run(times[begin:], commanded, achieved, np.zeros(len(commanded), dtype=bool))
    return answered(to_builtins(axes_response(Runs([run], RATE, HIGHEST), SIZE)), moved, drives)


def answered(found: dict[str, Any], moved: Sequence[int], drives: Sequence[Drive]) -> Judged:
    """Compare answers with the truth."""
    result = Judged([], [], [], [], 0, 0)
    stated = false = 0
    for axis, drive in zip(moved, drives, strict=True):
        one = found[AXES[axis]]
        f, gain = np.array(one['frequency']), np.array(one['gain'])
        if not len(f):
            continue
        stated += 1
        truth, radius = drive.at(f), np.array(one['gain_high']) - gain
        value = gain * np.exp(1j * np.radians(one['phase']))
        result.own.extend((np.abs(value - truth) <= radius).tolist())
        result.radii.extend((radius / np.abs(truth)).tolist())
        fine = np.linspace(0.1, 10.0, 10_000)
        below = np.flatnonzero(np.abs(drive.at(fine)) < np.sqrt(0.5))
        if one['bandwidth_3db'] is not None and len(below):
            result.bandwidths.append(one['bandwidth_3db'] / fine[below[0]])
        if one['delay'] is not None:
            result.delays.append(one['delay'] - drive.delay - drive.damping / (
                np.pi * drive.frequency))
        false += sum(each is not None for each in one['cross'].values())
    return result._replace(stated=stated, false=false)
