# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Weighted least squares for the geometry, from measured poses.

Directions in which the poses have no information keep the file's values
(``mechanics.least_squares``).
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.calibration.equations import (
    ALL, BASE, DEVICE, Equations, GEOMETRY, Linearization, PLATFORM, TARGET)
from stewart_dynamics.calibration.noise import (
    covariances, estimated_noise, Noise, ROUNDING, whitening)
from stewart_dynamics.mechanics.least_squares import (
    Identifiability, identifiability, LARGEST_ERROR, TWO_SIDED)

# Change of a joint that would matter, by the characteristic length; the same of a frame's angles.
_SCALE = 0.01
# Rounds of noise and fit, until the noise changes by a smaller part.
_ROUNDS, _SETTLED = 10, 1e-3
# Relative change of residuals and values at which a fit ends.
_DONE = 1e-12
# Residuals above this multiple of the leg's deviation are outliers; if a larger part of the poses
# has one, no pose counts as an outlier. Rounds of leaving them out.
_OUTLIER, MOST_OUTLIERS, _OUTLIER_ROUNDS = 8.0, 0.2, 5


class Fit(NamedTuple):
    """Values that fit the poses best."""

    values: Array
    """(ALL,)"""
    covariance: Array
    """(ALL, ALL), of the known directions."""
    identifiability: Identifiability
    noise: Noise
    lin: Linearization
    whitened: Array
    """Residuals (N, 6) by their standard deviations."""


class Unknowns(NamedTuple):
    """Unknowns of a fit: their start, scales, and the changes that are allowed."""

    start: Array
    scales: Array
    basis: Array
    """(ALL, m): allowed changes by the scales, orthonormal."""
    size: float
    """Characteristic length of the hexapod [m]."""

    @classmethod
    def of(cls, start: Array, size: float, fixed: Flags, frames: bool) -> Unknowns:
        """
        Return the unknowns.

        Unknown frames of the device need a definition of base and platform frame: by joints that
        are fixed, or where the joints of the file fit best: their mean displacement and mean
        rotation are zero.
        """
        scales = np.full(ALL, _SCALE * size)
        scales[[*range(45, 48), *range(51, 54)]] = _SCALE
        free = np.concatenate([~fixed, np.full(ALL - GEOMETRY, frames)])
        conditions = []
        for part in (BASE, PLATFORM) if frames else ():
            if fixed[part].any():
                continue
            joints = start[part].reshape(6, 3)
            around = (joints - joints.mean(axis=0)) / size
            rows = np.zeros((6, ALL))
            rows[:3, part] = np.tile(np.eye(3), 6)
            rows[3:, part] = np.concatenate([np.cross(np.eye(3), each).T for each in around], 1)
            conditions.append(rows)
        basis: Array = np.eye(ALL)[:, free]
        if conditions:
            _, _, right = np.linalg.svd(np.concatenate(conditions) @ basis)
            basis = basis @ right[6 * len(conditions):].T
        return cls(start, scales, basis, size)

    def frames_only(self) -> Unknowns:
        """Return the unknowns of the frames alone."""
        return self._replace(basis=np.eye(ALL)[:, DEVICE.start:TARGET.stop])

    def identifiability(self, lin: Linearization, whiten: Array, largest_error: float,
                        ) -> Identifiability:
        """Return what weighted poses identify of all unknowns."""
        rows = (whiten @ lin.derivatives).reshape(-1, ALL) @ (self.scales[:, None] * self.basis)
        found = identifiability(
            rows.T @ rows, np.ones(self.basis.shape[1]), largest_error=largest_error)
        directions = self.basis @ found.directions
        shares = np.sqrt(np.minimum(np.sum(directions[:, found.rank:] ** 2, axis=1), 1.0))
        return found._replace(scales=self.scales, directions=directions, shares=shares)


def fit(equations: Equations, unknowns: Unknowns, noise: Noise | None = None) -> Fit:
    """Return the best values for poses with the given noise, or with the noise estimated."""
    from scipy.stats import t

    values, known = unknowns.start, noise
    lin = equations.at(values)
    count = lin.residuals.size
    noise, largest_error = noise or Noise(unknowns.size, 0.0, 0.0), (
        np.inf if known is None else LARGEST_ERROR)
    for _ in range(_ROUNDS):
        whiten = whitening(covariances(noise, unknowns.size, lin))
        what = unknowns.identifiability(lin, whiten, largest_error)
        values = minimum(equations, unknowns.start, what.known, whiten)
        lin = equations.at(values)
        if known is not None:
            break
        before, largest_error = noise, LARGEST_ERROR
        noise = estimated_noise(lin, whiten, unknowns.size, what.rank)
        if np.abs(np.subtract(before, noise)).max() < _SETTLED * max(noise):
            break
    whiten = whitening(covariances(noise, unknowns.size, lin))
    rows = (whiten @ lin.derivatives).reshape(-1, ALL) @ what.known
    # Few poses give the estimated noise an error of its own: Student's distribution.
    wider = 1.0 if known else (t.ppf(0.975, max(count - what.rank, 1)) / TWO_SIDED) ** 2
    covariance = wider * what.known @ np.linalg.pinv(rows.T @ rows, hermitian=True) @ what.known.T
    return Fit(values, covariance, what, noise, lin, (whiten @ lin.residuals[..., None])[..., 0])


def minimum(equations: Equations, start: Array, known: Array, whiten: Array | float,
            loss: str = 'linear') -> Array:
    """Return the values with the smallest whitened residuals, from ``start`` along ``known``."""
    from scipy.optimize import least_squares

    def white(rows: Array) -> Array:
        return rows * whiten if isinstance(whiten, float) else whiten @ rows

    def residuals(steps: Array) -> Array:
        return white(at(steps.tobytes()).residuals[..., None]).ravel()

    def derivatives(steps: Array) -> Array:
        return white(at(steps.tobytes()).derivatives).reshape(-1, ALL) @ known

    @functools.lru_cache(maxsize=1)
    def at(steps: bytes) -> Linearization:
        return equations.at(start + known @ np.frombuffer(steps))

    if not known.shape[1]:
        return start
    sizes = np.linalg.norm(derivatives(np.zeros(known.shape[1])), axis=0)
    found = least_squares(
        residuals, np.zeros(known.shape[1]), derivatives, x_scale=1.0 / sizes, loss=loss,
        method='lm' if loss == 'linear' else 'trf', ftol=_DONE, xtol=_DONE, gtol=_DONE,
        max_nfev=200)
    values: Array = start + known @ found.x
    return values


class Outliers(NamedTuple):
    """Poses with outliers, and a fit to the others with equal weights, leg by leg."""

    residuals: Array
    """(N, 6) [m], of all poses."""
    deviations: Array
    """(6,) robust standard deviations [m]."""
    outlying: Flags
    """(N, 6): which measured lengths are outliers."""
    values: Array


def outliers(equations: Equations, unknowns: Unknowns) -> Outliers:
    """Return the outliers, by a robust fit and then by fits to the other poses."""
    lin = equations.at(unknowns.start)
    everything = np.ones(len(equations.lengths), dtype=bool)

    def fitted(deviation: float, largest_error: float, sound: Flags, loss: str = 'linear',
               ) -> Outliers:
        what = unknowns.identifiability(lin, np.eye(6) / deviation, largest_error)
        values = minimum(equations.part(sound), unknowns.start, what.known,
                         1.0 / deviation, loss)
        r = equations.at(values).residuals
        many = 6 * np.count_nonzero(sound)
        wider = np.sqrt(many / max(many - what.rank, 1))
        deviations = 1.4826 * wider * np.median(np.abs(r[sound]), axis=0) + (
            10.0 * ROUNDING * unknowns.size)
        return Outliers(r, deviations, np.abs(r) > _OUTLIER * deviations, values)

    # All directions are free at first, so that the deviations are those of noise.
    found = fitted(unknowns.size, np.inf, everything)
    first = fitted(float(np.median(found.deviations)), LARGEST_ERROR, everything)
    found = fitted(float(np.median(first.deviations)), LARGEST_ERROR, everything, 'soft_l1')
    for _ in range(_OUTLIER_ROUNDS):
        sound: Flags = ~np.any(found.outlying, axis=1)
        if np.mean(sound) < 1.0 - MOST_OUTLIERS or (
                6 * np.count_nonzero(sound) <= unknowns.basis.shape[1]):
            return first._replace(outlying=np.zeros_like(first.outlying))
        before = found
        found = fitted(float(np.median(found.deviations)), LARGEST_ERROR, sound)
        if (found.outlying == before.outlying).all() and np.allclose(
                found.deviations, before.deviations):
            break
    return found
