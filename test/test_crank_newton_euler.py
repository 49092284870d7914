# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The references for hexapods with cranks: against published states, and against one another."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
import json
from pathlib import Path
from typing import Any

from crank_machines import random_machine, random_state, within
from crank_newton_euler import (
    Answer, Array, CrankHexapod, forward_dynamics, inverse_dynamics, machine_of, State, state_of)
from crank_pinocchio import CrankPinocchio
import numpy as np
import pytest
from referees import derivative, relative, rng, rotation_about

RIG = json.loads(Path(__file__).with_name('data').joinpath('simulator_rig.json').read_text())
MACHINES = 12
STATES = 10
LEG_MASSES = (0.0, 1.0, 20.0, None)


def rig() -> CrankHexapod:
    return machine_of(RIG['parameters'], RIG['angle_range'])


@cache
def case(seed: int) -> tuple[CrankHexapod, list[State]]:
    random = rng(seed)
    machine = random_machine(random, LEG_MASSES[seed % len(LEG_MASSES)])
    return machine, [random_state(machine, random, n % 3 > 0) for n in range(STATES)]


def assert_agree(found: Answer, truth: Any, tolerance: float) -> None:
    """Check all quantities relative to their largest element; angles, to a radian."""
    for name, value in found._asdict().items():
        expected = np.asarray(truth[name])
        scale = max(np.max(np.abs(expected)), float(name == 'angles'))
        assert np.max(np.abs(value - expected)) <= tolerance * scale, name


@pytest.mark.parametrize('numbers', RIG['states'])
def test_newton_euler_has_the_published_states(numbers: dict[str, Any]) -> None:
    state = state_of(numbers)
    assert_agree(inverse_dynamics(rig(), state), numbers, 1e-12)
    found = forward_dynamics(rig(), state, np.array(numbers['torques']))
    assert np.allclose(found, np.hstack([state.a, state.al]), rtol=0.0, atol=1e-11)


@pytest.mark.parametrize('numbers', RIG['states'])
def test_pinocchio_has_the_published_states(numbers: dict[str, Any]) -> None:
    pytest.importorskip('pinocchio')
    state = state_of(numbers)
    referee = CrankPinocchio(rig(), np.array([1.0, -2.0, 3.0]))
    assert_agree(referee.inverse_dynamics(state), numbers, 1e-12)
    found = referee.forward_dynamics(state, np.array(numbers['torques']))
    assert np.allclose(found, np.hstack([state.a, state.al]), rtol=0.0, atol=1e-11)


@pytest.mark.parametrize('seed', range(MACHINES))
def test_newton_euler_is_pinocchio(seed: int) -> None:
    pytest.importorskip('pinocchio')
    machine, states = case(seed)
    referee = CrankPinocchio(machine, rng(seed).uniform(-10.0, 10.0, 3))
    for state in states:
        truth = referee.inverse_dynamics(state)
        assert_agree(inverse_dynamics(machine, state), truth._asdict(), 1e-12)
        acceleration = np.hstack([state.a, state.al])
        assert relative(referee.forward_dynamics(state, truth.torques), acceleration) < 1e-11


@pytest.mark.parametrize('seed', range(MACHINES))
def test_forward_dynamics_of_inverse_dynamics_is_the_acceleration(seed: int) -> None:
    machine, states = case(seed)
    for state in states:
        torques = inverse_dynamics(machine, state).torques
        found = forward_dynamics(machine, replace(state, a=np.ones(3)), torques)
        assert relative(found, np.hstack([state.a, state.al])) < 1e-11


def test_rates_and_accelerations_are_derivatives_of_the_angles() -> None:
    machine, (state, *_) = case(0)
    rate = float(np.linalg.norm(state.w))

    def at(time: float) -> Answer:
        """Return the results of a motion of constant twist."""
        return inverse_dynamics(machine, replace(
            state, t=state.t + time * state.v, a=np.zeros(3), al=np.zeros(3),
            R=rotation_about(state.w / rate, time * rate) @ state.R))

    assert relative(derivative(lambda time: at(time).angles, 1e-4), at(0.0).rates) < 1e-9
    assert relative(derivative(lambda time: at(time).rates, 1e-4), at(0.0).accelerations) < 1e-9


def test_machines_and_states_are_as_promised() -> None:
    machines = [case(seed) for seed in range(MACHINES)]
    branches: set[float] = set()
    wrapped = False
    for machine, states in machines:
        branches |= set(machine.branch)
        for state in states:
            found = inverse_dynamics(machine, state)
            assert np.all(np.sign(found.lever) == machine.branch)
            assert np.all(np.abs(found.lever) >= 0.15 * machine.crank)
            assert np.all(np.abs(found.angles - machine.middle) <= np.pi)
            wrapped |= bool(np.any(np.abs(found.angles) > np.pi))
    assert branches == {-1.0, 1.0}
    assert wrapped
    machine, states = machines[0]
    assert not within(machine, replace(states[0], t=10.0 * states[0].t))
    again: Array = case.__wrapped__(0)[1][-1].wrench
    assert np.array_equal(again, states[-1].wrench)
