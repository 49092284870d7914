# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The referee of limits and recordings against that of 13 bodies, and against this package."""

from __future__ import annotations

from dataclasses import replace

from cases import few
from crank_machines import random_machine, random_state
from crank_newton_euler import inverse_dynamics
from crank_platforms import motion_of, parameters_of
from independent_cranks import cranks
import numpy as np
import pytest
from referees import relative, rng
from stewart_dynamics import Motion, StewartPlatform

STATES = 10


@pytest.mark.parametrize('seed', few(range(12), 4))
def test_cranks_of_many_samples_are_those_of_free_bodies(seed: int) -> None:
    random = rng(seed)
    machine = random_machine(random)
    states = [random_state(machine, random, moving_base=False) for _ in range(STATES)]
    p, motions = parameters_of(machine), Motion.of_rows(np.stack([
        motion_of(state).rows for state in states]))
    found = cranks(p, motions)
    assert relative(found.torques, StewartPlatform(p).inverse_dynamics(motions).torques) < 1e-11
    for n, state in enumerate(states):
        truth = inverse_dynamics(machine, replace(state, wrench=np.zeros(6)))
        np.testing.assert_allclose(found.angles[n], truth.angles, atol=1e-12)
        np.testing.assert_allclose(
            found.ratios[n], truth.lever / machine.crank * machine.branch, atol=1e-12)
        for name, values, expected in (
                ('speeds', found.speeds, truth.rates),
                ('accelerations', found.accelerations, truth.accelerations),
                ('torques', found.torques, truth.torques),
                ('rod forces', found.rod_forces, np.maximum(
                    np.abs(truth.rod_at_platform), np.abs(truth.rod_at_crank)))):
            scale = np.abs(expected).max()
            np.testing.assert_allclose(values[n], expected, atol=1e-10 * scale, err_msg=name)
