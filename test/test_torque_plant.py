# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The simulated hexapod under torques of its motors: as under the forces that follow from them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from referees import relative, rng, rotation_about
from simulated import random_simulated, simulated
from snapshot import Snapshot
from stewart_dynamics import Motion, ParameterError, Parameters, StewartPlatform
from stewart_dynamics.mechanics.drives.motors import motor_ratio
from stewart_dynamics.mechanics.frames.rotation import to_quaternion
from stewart_dynamics.simulator.plant import Plant, PlantState
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters
from test_drives import driven
from test_plant import motion_of, ZERO

PROGRAM = 'stewart_simulator'


def plants(p: SimulatorParameters) -> tuple[Plant, Plant]:
    """Return the hexapod under forces, and under torques."""
    return Plant(p), Plant(p.replaced({'commands': 'torque'}))


def numbers(state: PlantState) -> Any:
    return np.concatenate([state.positions, state.rates, state.pose, state.twist, state.efforts])


def test_under_torques_it_moves_as_under_the_forces() -> None:
    """Without losses a constant force is a constant torque, whatever the motion."""
    given = driven(random_simulated(3), rng(3), **{'drive.efficiency': 1.0})
    by_forces, by_torques = plants(given)
    ratio = motor_ratio(given)
    weight = given['platform.mass'] * 9.81
    for n in range(400):
        forces = weight * (0.3 + 0.3 * np.sin(0.05 * n + np.arange(6.0)))
        one = by_forces.advance(tuple(forces.tolist()), ZERO)
        other = by_torques.advance(tuple((forces / ratio).tolist()), ZERO)
        assert relative(numbers(one), numbers(other)) < 1e-9
        assert one.motors.angles + one.motors.speeds == pytest.approx(
            other.motors.angles + other.motors.speeds, rel=1e-9, abs=1e-7)
        assert one.motors.torques == pytest.approx(tuple(forces / ratio), rel=1e-9)
    assert max(np.abs(one.rates)) > 0.1 and not by_torques.fault


@pytest.mark.parametrize('seed', range(6))
def test_with_losses_torques_give_the_acceleration_and_forces_that_need_them(seed: int) -> None:
    """The motors of a motion, as commands, give this motion: the rates are of either sign."""
    random = rng(seed)
    given = driven(random_simulated(seed), random, **{
        'drive.screw_rotation': 'universal' if seed % 2 else 'guided', 'commands': 'torque'})
    platform, plant = StewartPlatform(Parameters({
        name: value for name, value in given.given.items() if name in Parameters.table})), Plant(
            given)
    pose = given['initial_pose']
    for _ in range(20):
        rotation = rotation_about([0.6, 0.0, 0.8], random.uniform(-0.4, 0.4))
        motion = Motion(pose[:3] * random.uniform(0.9, 1.1), rotation,
                        *random.normal(size=(2, 3)) * 10.0 ** random.uniform(-5.0, 0.0),
                        *random.normal(size=(2, 3)) * 10.0 ** random.uniform(-1.0, 1.5))
        motors, forces = platform.motors(motion), platform.inverse_dynamics(motion).forces
        state = plant._plant['state']
        state['position'][:], state['quaternion'][:], state['twist'][:] = (
            motion.position, to_quaternion(motion.rotation), motion.rows[12:18])
        plant._plant['commands'][:] = motors.torques
        state = plant._run(0)
        # A hexapod whose rotors dominate has little acceleration for a lot of torque.
        assert relative(state.acceleration, motion.rows[18:24]) < 1e-9
        assert relative(state.efforts, forces) < 1e-9
        assert state.motors.angles == pytest.approx(tuple(motors.angles), rel=1e-12)
        assert state.motors.torques == tuple(motors.torques)


@pytest.mark.parametrize('efficiency', [1.0, 0.85])
def test_a_closed_loop_by_torques_tracks_as_by_forces(efficiency: float) -> None:
    """Feed-forward and PD of the legs; the plant carries 10 % more than the controller knows."""
    given = simulated(
        rate=1000.0, actuator__reflected_mass=None, actuator__screw_lead=0.01,
        drive__motor_inertia=7.6e-5, drive__efficiency=efficiency, limits__force_max=None)
    platform = StewartPlatform(Parameters({
        name: value for name, value in given.given.items() if name in Parameters.table}))
    by_forces, by_torques = plants(given.replaced({
        'platform.mass': 1.1 * given['platform.mass']}))
    ratio = motor_ratio(given)
    times = 1e-3 * np.arange(600)
    turn = 2.0 * np.pi * 1.5
    s, c = np.sin(turn * times), np.cos(turn * times)
    amplitude = np.array([0.02, 0.01, 0.015])
    wanted = Motion(
        np.array([0.0, 0.0, 1.1]) + np.outer(1.0 - c, amplitude),
        np.broadcast_to(np.eye(3), (600, 3, 3)), np.outer(s, turn * amplitude), np.zeros((600, 3)),
        np.outer(c, turn ** 2 * amplitude))
    result, motors = platform.inverse_dynamics(wanted), platform.motors(wanted)
    errors = []
    for plant, feed, scale in ((by_forces, result.forces, 1.0),
                               (by_torques, motors.torques, 1.0 / ratio)):
        error = np.empty((600, 6))
        for n in range(600):
            state = plant.state
            error[n] = result.lengths[n] - state.positions
            push = 4e5 * error[n] + 1e4 * (result.rates[n] - state.rates)
            plant.advance(tuple((feed[n] + scale * push).tolist()), ZERO)
        errors.append(error)
    rms = [np.sqrt(np.mean(each ** 2)) for each in errors]
    assert rms[0] < 3e-4
    if efficiency == 1.0:
        assert np.abs(errors[0] - errors[1]).max() < 1e-9
    # The plant pays its losses from the feed-forward for the lighter platform.
    assert rms[1] < 1.3 * rms[0]


def test_torques_saturate_at_what_is_available() -> None:
    given = simulated(
        commands='torque', actuator__screw_lead=0.01, drive__gear_ratio=1.0,
        drive__torque_max=1.5, drive__torque_speed=[0.0, 2.0, 50.0, 0.5])
    plant = Plant(given)
    state = plant.advance((9.0, -9.0, 1.0, 0.0, 0.0, 0.0), ZERO)
    assert state.motors.torques[:3] == pytest.approx((1.5, -1.5, 1.0), rel=1e-2)
    for _ in range(60):
        state = plant.advance((0.2,) * 6, ZERO)
    assert motion_of(state).position[2] < 1.1


@pytest.mark.parametrize('changes', [
    {'commands': 'torque'},
    {'commands': 'torque', 'actuator.screw_lead': 0.01, 'drive.efficiency': 0.4},
    {'commands': 'speed'}])
def test_rules(changes: dict[str, Any], snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        simulated().replaced(changes)
