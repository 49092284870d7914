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


"""The motion between points: its ends, its derivatives, and the bounds of its path."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
import pytest
from referees import derivative, rng, rotation_about

from stewart_dynamics.mechanics.frames.rotation import from_quaternion
from stewart_dynamics.planned.interpolation import Interpolation

Array = NDArray[np.float64]

MANY = 30


def rows_of(quaternions: Array, random: np.random.Generator) -> Array:
    """Return rows of motion with these rotations and all else at random."""
    rows = random.normal(size=(len(quaternions), 24))
    rows[:, 3:12] = np.stack(from_quaternion(*quaternions.T), axis=1)
    return rows


def some(turn: float) -> tuple[Interpolation, Array, Array]:
    """Return the motion between points turned by about this angle, durations and points."""
    random = rng()
    quaternions = np.array([0.0, 0.0, 0.0, 1.0]) + turn * random.normal(size=(MANY + 1, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    quaternions *= random.choice([-1.0, 1.0], size=(MANY + 1, 1))
    rows = rows_of(quaternions, random)
    durations = random.uniform(0.1, 1.0, MANY)
    return Interpolation(durations, rows), durations, rows


@pytest.mark.parametrize('turn', [0.0, 1e-9, 1e-3, 0.1, 1.0, 100.0])
@pytest.mark.parametrize('end', [0, 1])
def test_it_has_pose_twist_and_acceleration_of_its_ends(turn: float, end: int) -> None:
    between, durations, rows = some(turn)
    which = np.arange(MANY)
    assert np.array_equal(between.at(which, np.full(MANY, float(end))), rows[which + end])
    # The polynomials themselves, so near the ends that they change by less than the tolerance.
    near = between.at(which, np.full(MANY, abs(end - 1e-10)))
    bounds = np.abs(rows).max() * np.ones(24)
    bounds[18:24] = 1e4  # third derivatives, over the shortest duration
    assert np.all(np.abs(near - rows[which + end]) <= 1e-8 * bounds)


@pytest.mark.parametrize('turn', [0.0, 1e-9, 1e-3, 0.1, 1.0, 100.0])
def test_twist_and_acceleration_are_derivatives(turn: float) -> None:
    between, durations, _ = some(turn)
    which = np.arange(MANY)
    fraction = rng(1).uniform(0.1, 0.9, MANY)

    def at(shift: float) -> Array:
        return between.at(which, fraction + shift / durations)

    rows, rate = at(0.0), derivative(at, 1e-4)
    scale = 1.0 + np.abs(rows).max()
    assert np.abs(rate[:, 0:3] - rows[:, 12:15]).max() < 1e-7 * scale
    assert np.abs(rate[:, 12:18] - rows[:, 18:24]).max() < 1e-6 * scale
    rotation, its_rate = (each[:, 3:12].reshape(-1, 3, 3) for each in (rows, rate))
    spin = its_rate @ rotation.transpose(0, 2, 1)
    omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    assert np.abs(omega - rows[:, 15:18]).max() < 1e-6 * scale
    assert np.abs(rotation @ rotation.transpose(0, 2, 1) - np.eye(3)).max() < 1e-14


@pytest.mark.parametrize('angle', [0.0, 1e-6, 0.7, 3.0, np.pi - 1e-9])
def test_a_rotation_at_constant_rate_is_interpolated_exactly(angle: float) -> None:
    axis = np.array([0.36, -0.48, 0.8])
    rotations = np.stack([np.eye(3), rotation_about(axis, angle)])
    rows = np.zeros((2, 24))
    rows[:, 3:12] = rotations.reshape(2, 9)
    rows[:, 15:18] = axis * angle / 2.0
    between = Interpolation(np.array([2.0]), rows)
    part = np.linspace(0.0, 1.0, 11)
    got = between.at(np.zeros(11, dtype=np.int64), part)
    expected = np.stack([rotation_about(axis, angle * each) for each in part])
    assert np.abs(got[:, 3:12] - expected.reshape(-1, 9)).max() < 1e-8
    assert np.abs(got[:, 15:18] - rows[0, 15:18]).max() < 1e-7
    assert np.abs(got[:, 21:24]).max() < 1e-6


def test_position_and_its_derivatives_are_within_their_bounds() -> None:
    between, durations, _ = some(1.0)
    bounds = between.bounds(0.5)
    part = np.linspace(0.0, 1.0, 401)
    for n in range(MANY):
        rows = between.at(np.full(len(part), n), part)
        assert np.linalg.norm(np.diff(rows[:, 0:3], axis=0), axis=1).sum() <= bounds.path[n]
        for columns, bound, deviation in (
                (slice(0, 3), None, bounds.position_deviation),
                (slice(12, 15), bounds.speed, bounds.velocity_deviation),
                (slice(18, 21), bounds.acceleration, bounds.acceleration_deviation)):
            values = rows[:, columns]
            if bound is not None:
                assert np.linalg.norm(values, axis=1).max() <= bound[n]
            line = values[0] + part[:, None] * (values[-1] - values[0])
            assert np.linalg.norm(values - line, axis=1).max() <= deviation[n]
        jerk = np.diff(rows[:, 18:21], axis=0) / (durations[n] / 400.0)
        assert np.linalg.norm(jerk, axis=1).max() <= bounds.jerk[n]
