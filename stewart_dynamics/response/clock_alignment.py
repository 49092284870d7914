# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Samples of a source with a clock of its own, brought to the clock of the setpoints.

The clocks are shifted so that the speeds of commanded and achieved motion correlate best. Speeds,
unlike coordinates, do not depend on the frame in which a tracker measures. A delay cannot be
distinguished from the difference of the clocks: it is not known then.
"""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array, NANOSECOND, SECOND
from stewart_dynamics.errors import StewartError
from stewart_dynamics.response.even_samples import Track

# Smallest correlation of the speeds of one motion.
_ALIKE = 0.5
# Shortest step at which speeds are compared [s].
_STEP = 0.005


def overlaps(first: Track, second: Track) -> bool:
    """Return whether two sources have samples of the same time."""
    return bool(max(first.stamps[0], second.stamps[0]) < min(first.stamps[-1], second.stamps[-1]))


def aligned(commanded: Track, achieved: Track, name: str) -> tuple[Track, float]:
    """
    Return achieved samples on the clock of the commanded ones, and their shift [s].

    Tracks have positions in their first three columns. Raises StewartError if the motions differ.
    """
    step = max(_STEP, float(np.median(np.diff(commanded.stamps))) * NANOSECOND)
    speeds = [_speeds(track, step) for track in (commanded, achieved)]
    size = sum(len(each) for each in speeds)
    spectra = [np.fft.rfft(each, 1 << size.bit_length()) for each in speeds]
    products = np.fft.irfft(spectra[0] * np.conj(spectra[1]))
    scale = np.sqrt(np.prod([np.sum(each ** 2) for each in speeds]))
    best = int(products.argmax())
    if not products[best] >= _ALIKE * scale:
        raise StewartError(f'response: {name} has another clock than the setpoints, and another '
                           f'motion: the speeds correlate by {products[best] / scale:.2g} at most')
    # The largest value of the parabola through three.
    before, at, after = (float(products[(best + n) % len(products)]) for n in (-1, 0, 1))
    curved = before - 2.0 * at + after
    lag = best + (0.5 * (before - after) / curved if curved else 0.0)
    lag -= len(products) if best > len(products) // 2 else 0
    shift = lag * step + (int(commanded.stamps[0]) - int(achieved.stamps[0])) * NANOSECOND
    return achieved._replace(stamps=achieved.stamps + round(shift * SECOND)), shift


def _speeds(track: Track, step: float) -> Array:
    """Return the speed at even times, less its mean."""
    times = (track.stamps - track.stamps[0]) * NANOSECOND
    at = np.arange(0.0, times[-1], step)
    positions = np.stack([np.interp(at, times, each) for each in track.values[:, :3].T], axis=1)
    speeds: Array = np.linalg.norm(np.gradient(positions, axis=0), axis=1)
    found: Array = speeds - speeds.mean()
    return found
