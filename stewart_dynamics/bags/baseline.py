# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Motions from accelerations alone, such as records of earthquakes: integrated, base line corrected.

The offset and drift of an accelerometer, integrated twice, carry the platform away. A base line, a
polynomial of second degree in time, is subtracted from the acceleration of each axis (G. V. Berg,
G. W. Housner, Integrated velocity and displacement of strong earthquake ground motion, Bulletin of
the Seismological Society of America 51, 1961, 175-189). Its coefficients make the mean square of
the velocity least, with velocity and displacement zero at the end, so that the motion begins and
ends at rest in the same place. Between samples the acceleration is linear.

Nothing bridges a gap: the change of the velocity there is lost, and with it each later position.
How large it is follows from windows as long as the gap, elsewhere in the record.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array

# A pause this many times as long as usual is a gap.
_GAP = 1.5
# Largest change of velocity that gaps may hide, by the RMS of the velocity: one lost sample, of
# twenty in a period of the acceleration, is 0.004, and moves the positions by 2 to 6 %.
_HIDDEN = 0.01
# Windows in which a gap is tried.
_WINDOWS = 1000
# Part of a gap after which a window of its length has its end: times are rounded.
_NEARLY = 0.99


class Integrated(NamedTuple):
    """A motion from its accelerations."""

    positions: Array  # from the start (N, 3) [m]
    velocities: Array  # (N, 3) [m/s]
    accelerations: Array  # corrected (N, 3) [m/s^2]
    lines: Array  # base lines that were subtracted (N, 3) [m/s^2]
    uncorrected: Array  # displacements at the end without the correction (3,) [m]

    def words(self) -> str:
        """Return the correction in words, for the user."""
        x, y, z = np.abs(self.uncorrected).tolist()
        return (
            'only accelerations are given: they are integrated twice from rest in the home pose, '
            'linear between samples, after the base line, a polynomial of second degree in time, '
            'is subtracted, so that the motion ends at rest where it began with the least mean '
            f'square of the velocity; it is {np.abs(self.lines).max():.3g} m/s^2 at most, without '
            f'it the motion would end {x:.3g}, {y:.3g}, {z:.3g} m away')


def integrated(times: Array, accelerations: Array) -> Integrated:
    """Return the motion from rest of accelerations (N, 3) [m/s^2] at times (N,) [s]."""
    velocities, positions = _twice(times, accelerations)
    u = (times - times[0]) / (times[-1] - times[0])
    basis = np.stack([u ** power for power in range(3)], axis=1)
    basis_velocities, basis_positions = _twice(times, basis)
    # Least squares of the velocity with two equations that hold: v = x = 0 at the end.
    weights = np.gradient(times)[:, None]
    normal = basis_velocities.T @ (weights * basis_velocities)
    ends = np.stack([basis_velocities[-1], basis_positions[-1]])
    scale = np.array([np.abs(each).max() for each in ends])[:, None]
    size = np.abs(normal).max()
    matrix = np.block([[normal / size, (ends / scale).T], [ends / scale, np.zeros((2, 2))]])
    right = np.vstack([basis_velocities.T @ (weights * velocities) / size,
                       np.stack([velocities[-1], positions[-1]]) / scale])
    coefficients = np.linalg.lstsq(matrix, right, rcond=None)[0][:3]
    return Integrated(
        positions - basis_positions @ coefficients, velocities - basis_velocities @ coefficients,
        accelerations - basis @ coefficients, basis @ coefficients, positions[-1])


def gap_of(times: Array, accelerations: Array, velocities: Array) -> int | None:
    """
    Return the sample after the longest gap, if gaps make the motion unknown.

    times (N,) [s]; accelerations, velocities (N, 3): of the motion [m/s^2, m/s].
    """
    steps = np.diff(times)
    gaps = np.flatnonzero(steps > _GAP * np.median(steps))
    if not len(gaps):
        return None
    hidden = sum(_hidden(times, accelerations, velocities, float(steps[gap])) for gap in gaps)
    known = np.sum(velocities ** 2, axis=1).mean()
    return int(gaps[np.argmax(steps[gaps])]) + 1 if hidden > _HIDDEN ** 2 * known else None


def _hidden(times: Array, accelerations: Array, velocities: Array, gap: float) -> float:
    """Return the mean squared error of linear accelerations over windows of a gap [m^2/s^2]."""
    last = max(int(np.searchsorted(times, times[-1] - gap, side='right')), 1)
    first = np.linspace(0, last - 1, min(_WINDOWS, last), dtype=np.int64)
    after = np.minimum(np.searchsorted(times, times[first] + _NEARLY * gap), len(times) - 1)
    chords = 0.5 * (times[after] - times[first])[:, None] * (
        accelerations[first] + accelerations[after])
    changes = velocities[after] - velocities[first]
    return float(np.sum((changes - chords) ** 2, axis=1).mean())


def _twice(times: Array, accelerations: Array) -> tuple[Array, Array]:
    """Return velocities and positions from rest of accelerations that are linear in between."""
    steps = np.diff(times)[:, None]
    first, second = accelerations[:-1], accelerations[1:]
    zero = np.zeros((1, accelerations.shape[1]))
    velocities = np.vstack([zero, np.cumsum(steps * (first + second) / 2.0, axis=0)])
    positions = np.vstack([zero, np.cumsum(
        steps * velocities[:-1] + steps ** 2 * (2.0 * first + second) / 6.0, axis=0)])
    return velocities, positions
