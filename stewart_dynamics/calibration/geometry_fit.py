# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Weighted least squares for the geometry, from measured poses.

Directions in which the poses have no information keep the file's values
(``mechanics.least_squares``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.calibration.equations import (
    BASE, DEVICE, Equations, FRAMES, Linearization, PLATFORM, TARGET)
from stewart_dynamics.calibration.noise import (
    covariances, Noise, ROUNDING, VarianceComponents, whitening)
from stewart_dynamics.legs.calibrated import CalibratedLegs
from stewart_dynamics.mechanics.least_squares import (
    Identifiability, identifiability, LARGEST_ERROR, normal)

# Rounds of noise and fit, until the noise changes by a smaller part.
_ROUNDS, _SETTLED = 20, 0.01
# A fit ends with a step that changes the residuals by a smaller part of them (least squares,
# robust), or of the largest coordinate: a rounding error. Most steps; damping of a second try.
_DONE, _EXACT, _STEPS, _DAMPING = (1e-6, 1e-3), 1e-15, 100, 1e-3


class Fit(NamedTuple):
    """Values that fit the poses best."""

    values: Array  # (n,), n: geometry and frames
    covariance: Array  # (n, n), of the known directions
    identifiability: Identifiability
    noise: Noise
    lin: Linearization
    whitened: Array  # residuals (N, 6) by their standard deviations


class Unknowns(NamedTuple):
    """Unknowns of a fit: their start, scales, and the changes that are allowed."""

    start: Array
    scales: Array
    basis: Array  # (n, m): allowed changes by the scales, orthonormal
    size: float  # characteristic length of the hexapod [m]

    @classmethod
    def of(cls, legs: CalibratedLegs, start: Array, size: float, fixed: Flags, frames: bool,
           ) -> Unknowns:
        """
        Return the unknowns, which are not ``fixed``.

        Unknown frames of the device need a definition of base and platform frame: by joints that
        are fixed, or where the joints of the file fit best: their mean displacement and mean
        rotation are zero.
        """
        scales = np.concatenate([legs.scales(size), np.full(FRAMES, legs.joint_scale * size)])
        for part in (DEVICE, TARGET):
            scales[part][3:] = legs.joint_scale
        free = np.concatenate([~fixed, np.full(FRAMES, frames)])
        conditions = []
        for part in (BASE, PLATFORM) if frames else ():
            if fixed[part].any():
                continue
            joints = start[part].reshape(6, 3)
            around = (joints - joints.mean(axis=0)) / size
            rows = np.zeros((6, len(start)))
            rows[:3, part] = np.tile(np.eye(3), 6)
            rows[3:, part] = np.concatenate([np.cross(np.eye(3), each).T for each in around], 1)
            conditions.append(rows)
        basis: Array = np.eye(len(start))[:, free]
        if conditions:
            _, _, right = np.linalg.svd(np.concatenate(conditions) @ basis)
            basis = basis @ right[6 * len(conditions):].T
        return cls(start, scales, basis, size)

    def identifiability(self, lin: Linearization, whiten: Array, largest_error: float,
                        ) -> Identifiability:
        """Return what weighted poses identify of all unknowns."""
        rows = whiten @ (lin.derivatives @ (self.scales[:, None] * self.basis))
        found = identifiability(
            normal(rows, rows), np.ones(self.basis.shape[1]), largest_error=largest_error)
        directions = self.basis @ found.directions
        shares = np.sqrt(np.minimum(np.sum(directions[:, found.rank:] ** 2, axis=1), 1.0))
        return found._replace(scales=self.scales, directions=directions, shares=shares)


def fit(equations: Equations, unknowns: Unknowns, noise: Noise | None = None) -> Fit:
    """Return the best values for poses with the given noise, or with the noise estimated."""
    size, values, estimated = unknowns.size, unknowns.start, noise is None
    lin = equations.at(values)
    noise, largest_error = noise or Noise(size / lin.lever, 0.0, 0.0), (
        np.inf if estimated else LARGEST_ERROR)
    for _ in range(_ROUNDS):
        whiten = whitening(covariances(noise, size, lin))
        what = unknowns.identifiability(lin, whiten, largest_error)
        values = minimum(equations, unknowns.start, what.known, whiten, guess=values)
        lin = equations.at(values)
        whitened = (whiten @ lin.residuals[..., None])[..., 0]
        components = VarianceComponents.of(lin, whiten, what.known)
        if not estimated:
            break
        before, largest_error = noise, LARGEST_ERROR
        noise = components.noise(whitened, size)
        if np.abs(np.subtract(before, noise)).max() < _SETTLED * max(noise) + ROUNDING * size:
            break
    return Fit(values, components.covariance(estimated), what, noise, lin, whitened)


def minimum(equations: Equations, start: Array, known: Array, whiten: Array,
            robust: bool = False, guess: Array | None = None) -> Array:
    """
    Return the values with the smallest whitened residuals, from ``start`` along ``known``.

    Gauss-Newton steps, damped as Levenberg and Marquardt do if the sum of squares would not
    decrease (J. Nocedal, S. J. Wright, Numerical Optimization, 2nd ed., Springer 2006, section
    10.3). ``robust`` sums 2 sqrt(1 + r^2) instead of r^2. The steps begin at ``guess``.
    """
    def state(steps: Array) -> tuple[Linearization, Array, float]:
        lin = equations.at(start + known @ steps)
        r = (whiten @ lin.residuals[..., None])[..., 0]
        return lin, r, float(np.sum(2.0 * np.sqrt(1.0 + r ** 2) if robust else r ** 2))

    if not known.shape[1]:
        return start
    steps: Array = np.asarray(np.linalg.solve(
        known.T @ known, known.T @ ((start if guess is None else guess) - start)))
    (lin, r, cost), damping, exact = state(steps), 0.0, _EXACT * float(np.abs(start).max())
    for _ in range(_STEPS):
        derivatives = lin.derivatives @ known
        rows = whiten @ derivatives
        weighted = rows / np.sqrt(1.0 + r ** 2)[..., None] if robust else rows
        matrix = normal(rows, weighted)
        scale = 1.0 / np.sqrt(np.diag(matrix))
        step = -scale * np.linalg.lstsq(
            scale[:, None] * matrix * scale + damping * np.eye(len(steps)),
            scale * normal(weighted, r[..., None])[:, 0], rcond=None)[0]
        done = _rms(derivatives @ step) <= _DONE[robust] * _rms(lin.residuals) + exact
        new = state(steps + step)
        if new[-1] < cost:
            (lin, r, cost), steps = new, steps + step
            damping = 0.1 * damping if damping > _DAMPING else 0.0
        else:
            damping = max(10.0 * damping, _DAMPING)
        if done:
            break
    return np.asarray(start + known @ steps)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values ** 2)))
