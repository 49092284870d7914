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

"""The base wrench of setpoints: the library's, for one and for many, and finite numbers only."""

from __future__ import annotations

import numpy as np
import pytest
from referees import (
    random_base_motion, random_motion, random_parameters, random_wrench, relative, rng)
from stewart_dynamics import BaseMotion, Parameters, StewartPlatform
from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.rows import NO_BASE
from stewart_dynamics.setpoints.base_wrench import BaseWrench
from stewart_dynamics.setpoints.step import Batch, Setpoint
from test_step import FLAT, HOME, PARAMETERS, QUARTER, STAMP

MANY = 50


def setpoints_of(batch: Batch) -> list[Setpoint]:
    bases = [None] * len(batch.stamps) if batch.bases is None else [
        tuple(row) for row in batch.bases.tolist()]
    return [Setpoint(STAMP, tuple(motion), tuple(wrench), False, base)
            for motion, wrench, base in zip(
                batch.motions.tolist(), batch.wrenches.tolist(), bases, strict=True)]


def batch_of(motions: Array, wrenches: Array, bases: Array | None) -> Batch:
    stamps = np.full(len(motions), STAMP)
    return Batch(stamps, motions, wrenches, np.zeros(len(motions), dtype=bool), stamps, bases)


def assert_alike(found: Array, of_one: BaseWrench, batch: Batch) -> None:
    """Check that the call for one gives the rows of the call for many, bit for bit."""
    for row, setpoint in zip(found.tolist(), setpoints_of(batch), strict=True):
        assert of_one(setpoint) == (None if row[0] != row[0] else tuple(row))


@pytest.mark.parametrize('moving', [False, True], ids=['still', 'moving'])
def test_it_is_the_librarys_bit_for_bit(moving: bool) -> None:
    random = rng()
    for _ in range(5):
        parameters = random_parameters(random)
        motion = random_motion(parameters, random, MANY)
        wrenches = random_wrench(parameters, random, MANY)
        base = random_base_motion(parameters, random, MANY) if moving else None
        batch = batch_of(motion.rows, wrenches, None if base is None else base.rows)
        found = BaseWrench(parameters).many(batch)
        assert np.array_equal(
            found, StewartPlatform(parameters).base_wrench(motion, wrenches, base))
        assert_alike(found, BaseWrench(parameters), batch)


def test_an_unknown_base_has_no_base_wrench() -> None:
    random = rng()
    motion = random_motion(PARAMETERS, random, MANY)
    bases = random_base_motion(PARAMETERS, random, MANY).rows.copy()
    bases[10:20] = NO_BASE
    batch = batch_of(motion.rows, random_wrench(PARAMETERS, random, MANY), bases)
    found = BaseWrench(PARAMETERS).many(batch)
    unknown = np.zeros(MANY, dtype=bool)
    unknown[10:20] = True
    assert np.array_equal(np.isnan(found), np.repeat(unknown[:, None], 6, axis=1))
    assert_alike(found, BaseWrench(PARAMETERS), batch)


def test_overflowing_numbers_have_no_base_wrench() -> None:
    motions = np.array([HOME.motion] * 3)
    motions[1, 18:21] = 1e308
    found = BaseWrench(PARAMETERS).many(batch_of(motions, np.zeros((3, 6)), None))
    assert np.isnan(found).all(axis=1).tolist() == [False, True, False]
    assert_alike(found, BaseWrench(PARAMETERS), batch_of(motions, np.zeros((3, 6)), None))


def weight_of(parameters: Parameters) -> float:
    return float(parameters['platform.mass'] + parameters['legs.cylinder.mass'].sum()
                 + parameters['legs.piston.mass'].sum())


@pytest.mark.parametrize('setpoint', [HOME, QUARTER, FLAT], ids=['home', 'a quarter turn', 'flat'])
def test_at_rest_it_is_the_weight_also_where_the_forces_cannot_be_solved(
        setpoint: Setpoint) -> None:
    found = BaseWrench(PARAMETERS)(setpoint)
    assert found is not None
    assert relative(found[:3], weight_of(PARAMETERS) * PARAMETERS['gravity']) < 1e-12
    tilted = BaseMotion([0.0, 6.0, -8.0])
    found = BaseWrench(PARAMETERS)(setpoint._replace(base=tuple(tilted.rows.tolist())))
    assert found is not None
    assert relative(found[:3], weight_of(PARAMETERS) * tilted.gravity) < 1e-12
