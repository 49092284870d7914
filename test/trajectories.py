# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The planned trajectories of the tests: their points, and the hexapods that they are for."""

from __future__ import annotations

from typing import Any

import messages
import numpy as np
from numpy.typing import NDArray
import pytest
from referees import rng, ROOT

from stewart_dynamics import Motion, Parameters
from stewart_dynamics.mechanics import batch
from stewart_dynamics.mechanics.frames.rotation import from_quaternion, to_quaternion
from stewart_dynamics.planned.trajectory_messages import OUTPUT_TYPE, PlannedOutcome
from stewart_dynamics.reference_motion.motion_functions import motion_at
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters

Array = NDArray[np.float64]

PARAMETERS = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
FREE = PARAMETERS.replaced({name: [] for name in (
    'limits.length_min', 'limits.length_max', 'limits.velocity_max', 'limits.force_max')})
# No condition number stops it: only a change of the sign of det(J) is left.
UNBOUND = FREE.replaced({'singularity.stop_condition': 1e11, 'singularity.warn_condition': 1e11})
STAMP = 1_700_000_000_123_456_789
SECOND = 1_000_000_000
REST = (0.0,) * 6
HOME = (0.0, 0.0, 1.1, 0.0, 0.0, 0.0, 1.0)


def counted(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return a list that gets the number of samples for which the legs are computed."""
    solved: list[int] = []
    solve = batch.solve

    def counting(constants: Array, rows: Array, *loads: Array | None) -> Array:
        solved.append(len(rows))
        return solve(constants, rows, *loads)

    monkeypatch.setattr(batch, 'solve', counting)
    return solved


def rows_of(motion: Motion) -> Array:
    """Return rows of position, quaternion, twist and acceleration."""
    return np.column_stack([motion.position, to_quaternion(motion.rotation),
                            motion.rows[:, 12:24]])


def motion_of(rows: Array) -> Motion:
    """Return the motion of such rows."""
    x, y, z, w = rows[:, 3:7].T
    length = np.sqrt(x * x + y * y + z * z + w * w)
    rotation = np.stack(from_quaternion(x / length, y / length, z / length, w / length), axis=1)
    return Motion(rows[:, 0:3], rotation.reshape(-1, 3, 3), rows[:, 7:10], rows[:, 10:13],
                  rows[:, 13:16], rows[:, 16:19])


def sampled(name: str, step: int) -> tuple[list[int], Array]:
    """Return times [ns] and rows of a motion in config/."""
    motion = ReferenceMotionParameters.from_yaml(ROOT / 'config' / f'trajectory_{name}.yaml')
    times = np.arange(0, 10 * SECOND + 1, step)
    return times.tolist(), rows_of(motion_at(motion, times * 1e-9))


def some(points: int) -> tuple[list[int], Array]:
    """Return a smooth motion whose points are at uneven times."""
    random = rng()
    times = np.cumsum(random.integers(1_000_000, 20_000_000, points))
    motion = ReferenceMotionParameters({
        'motion.type': 'sine', 'motion.initial': (0.0, 0.0, 1.1, 0.0, 0.0, 0.0),
        'motion.amplitude': (0.03, 0.03, 0.04, 0.04, 0.04, 0.06),
        'motion.frequency': (0.25, 0.5, 0.25, 0.5, 0.25, 0.25)})
    rows = rows_of(motion_at(motion, times * 1e-9))
    rows[:, 3:7] *= random.uniform(0.9995, 1.0005, (points, 1))
    return times.tolist(), rows


def decoded(outcome: PlannedOutcome) -> Any:
    """Return the answer as another library reads it."""
    assert outcome.answer, outcome.message
    return messages.STORE.deserialize_cdr(outcome.answer, OUTPUT_TYPE)
