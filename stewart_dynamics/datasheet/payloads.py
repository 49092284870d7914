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

"""Payloads at rest: on a base that is level, and in any orientation of the base."""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.capability.capability import Capability
from stewart_dynamics.capability.force_intervals import largest_multiple
from stewart_dynamics.mechanics.dynamics.linear_parameters import linear_parameters, PLATFORM
from stewart_dynamics.mechanics.frames.motion import Motion, Pose

# Azimuths of a center of mass beside the pivot, of which the worst counts.
_AZIMUTHS = np.linspace(0.0, 2.0 * np.pi, 36, endpoint=False)


class Payloads:
    """
    Largest point masses that can be added to a platform at rest, by forces and torques.

    Forces of the legs are linear in gravity, in the mass, and in its first moment.

    Parameters
    ----------
    capability : Capability
        With limits of forces.
    poses : Pose
        (N,)

    """

    def __init__(self, capability: Capability, poses: Pose) -> None:
        platform = capability.platform
        p = platform.parameters
        self._largest = capability.forces_at_rest
        self._gravity = np.asarray(p['gravity'])
        rows = Motion.from_pose(poses).rows
        matrices = np.stack([platform.regressors_at_rest(rows, each[None]) for each in np.eye(3)])
        # (N, 6, 3) of the hexapod, and (N, 6, 3, 4) of a mass of 1 kg: itself, its first moment
        self._own = np.moveaxis(matrices @ linear_parameters(p), 0, -1)
        added = matrices[..., PLATFORM.start:PLATFORM.start + 4]
        self._added = np.moveaxis(added, 0, -2)

    def level(self, offset: float = 0.0, height: float = 0.0) -> float:
        """
        Return the smallest payload [kg] over poses and azimuths, in the given gravity.

        Parameters
        ----------
        offset, height : float
            Position of its center of mass beside the platform's origin and above it [m].

        """
        masses = self._masses(offset, height)
        return float(largest_multiple(
            (self._own @ self._gravity)[..., None, :],
            np.einsum('nikc,mc,k->nmi', self._added, masses, self._gravity), self._largest).min())

    def any_orientation(self, offset: float = 0.0, height: float = 0.0) -> float:
        """Return the same for all directions of gravity: a base that hangs, or on a wall."""
        # |own + m added| |g| <= largest for each leg: a quadratic in m
        own = self._own[:, None]
        added = np.einsum('nikc,mc->nmik', self._added, self._masses(offset, height))
        bound = self._largest / np.linalg.norm(self._gravity)
        a, b = (added * added).sum(axis=-1), (own * added).sum(axis=-1)
        c = (own * own).sum(axis=-1) - bound * bound
        with np.errstate(divide='ignore', invalid='ignore'):
            found = np.where(c > 0.0, 0.0, -c / (b + np.sqrt(np.maximum(b * b - a * c, 0.0))))
        return float(np.where(np.isnan(found), np.inf, found).min())

    def _masses(self, offset: float, height: float) -> Array:
        """Return mass and first moment (M, 4) of 1 kg, for each azimuth."""
        around = _AZIMUTHS if offset else _AZIMUTHS[:1]
        return np.stack([np.ones_like(around), offset * np.cos(around), offset * np.sin(around),
                         np.full_like(around, height)], axis=-1)
