# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Screws that turn with their legs: J_q, forces by virtual work, and all that follows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from referees import (
    Array, energies, random_motion, random_parameters, random_wrench, rng, symmetric_parameters)
from scipy.spatial.transform import Rotation

from stewart_dynamics import Motion, StewartPlatform
from stewart_dynamics.external_wrench.estimate import external_wrenches
from stewart_dynamics.mechanics.drives.motors import motor_ratio
from stewart_dynamics.mechanics.rows import (
    ACCELERATION, BASE_AXIS, PITCH, PLATFORM_AXIS, TWIST)
from stewart_dynamics.simulator.plant import Plant
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters
from test_drives import driven

# Coefficients of the first derivative by central differences of 8th order, of steps -4 to 4.
DIFFERENCES = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0.0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])


def turning(seed: int, **changes: Any) -> StewartPlatform:
    """Return a random hexapod whose screws turn with its legs."""
    random = rng(seed)
    return StewartPlatform(driven(random_parameters(random), random, **{
        'drive.screw_rotation': 'universal', 'drive.screw_hand': ['right', 'left'][seed % 2],
        **changes}))


def guided(platform: StewartPlatform) -> StewartPlatform:
    return StewartPlatform(platform.parameters.replaced({'drive.screw_rotation': 'guided'}))


def by_chains(platform: StewartPlatform, motion: Motion) -> Array:
    """
    Return the rates of the drives (N, 6) by each leg as a serial chain of six joints.

    Base to platform: axis fixed to the base, axis across it, turn about the leg, slide along it,
    axis across, axis fixed to the platform. The joints' rates follow from the platform's twist.
    """
    p, screws = platform.parameters, platform.screws
    rates = np.empty((len(motion.rows), 6))
    for n in range(len(motion.rows)):
        at = motion[n]
        omega = at.angular_velocity
        twist = np.concatenate([at.linear_velocity - np.cross(omega, at.position), omega])
        for leg in range(6):
            base = p['geometry.base_joints'][leg]
            top = at.position + at.rotation @ p['geometry.platform_joints'][leg]
            s = (top - base) / np.linalg.norm(top - base)
            u, w = screws[leg, BASE_AXIS], at.rotation @ screws[leg, PLATFORM_AXIS]

            def hinge(axis: Array, point: Array) -> Array:
                axis = axis / np.linalg.norm(axis)
                return np.concatenate([np.cross(point, axis), axis])

            chain = np.column_stack([
                hinge(u, base), hinge(np.cross(u, s), base), hinge(s, base),
                np.concatenate([s, np.zeros(3)]), hinge(np.cross(w, s), top), hinge(w, top)])
            of_joints = np.linalg.solve(chain, twist)
            rates[n, leg] = of_joints[3] + screws[leg, PITCH] * of_joints[2]
    return rates


@pytest.mark.parametrize('seed', range(4))
def test_rates_of_the_drives_are_those_of_serial_chains(seed: int) -> None:
    platform = turning(seed)
    motion = random_motion(platform.parameters, rng(seed), 20)
    rates = by_chains(platform, motion)
    found = np.einsum('nij,nj->ni', platform.drive_jacobian(motion), motion.rows[:, TWIST])
    np.testing.assert_allclose(found, rates, rtol=0.0, atol=1e-12 * np.abs(rates).max())
    motors, k = platform.motors(motion), motor_ratio(platform.parameters)
    np.testing.assert_allclose(motors.speeds, k * rates, rtol=0.0,
                               atol=1e-12 * np.abs(motors.speeds).max())
    accelerations = (
        np.einsum('nij,nj->ni', platform.drive_jacobian(motion), motion.rows[:, ACCELERATION])
        + np.einsum('nij,nj->ni', platform.drive_jacobian_rate(motion), motion.rows[:, TWIST]))
    np.testing.assert_allclose(motors.accelerations, k * accelerations, rtol=0.0,
                               atol=1e-12 * np.abs(motors.accelerations).max())
    legs = np.einsum('nij,nj->ni', platform.inverse_jacobian(motion), motion.rows[:, TWIST])
    np.testing.assert_allclose(platform.inverse_dynamics(motion).rates, legs, rtol=0.0,
                               atol=1e-12 * np.abs(legs).max())


@pytest.mark.parametrize('seed', range(4))
def test_forces_are_those_of_lagrange_with_the_work_of_the_drives(seed: int) -> None:
    """By differences of the energies of all parts and rotors, in six coordinates."""
    platform, random = turning(seed, **{
        'actuator.viscous_friction': 0.0, 'actuator.coulomb_friction': 0.0}), rng(seed)
    p = platform.parameters
    massless = p.replaced({'actuator.reflected_mass': 0.0, 'drive.motor_inertia': None,
                           'drive.screw_inertia': None})
    place = random_motion(p, random, 1).position[0]
    amplitude = np.array([0.05, 0.05, 0.05, 0.1, 0.1, 0.1]) * random.normal(size=6)
    frequency, phase = random.uniform(1.0, 3.0, 6), random.uniform(0.0, 6.0, 6)

    def coordinates(time: float) -> tuple[Array, Array, Array]:
        turn = frequency * time + phase
        x = amplitude * np.sin(turn)
        x[:3] += place
        return (x, amplitude * frequency * np.cos(turn),
                -amplitude * frequency ** 2 * np.sin(turn))

    def motion(x: Array, rate: Array) -> Motion:
        return Motion.from_euler(x[..., :3], x[..., 3:], rate[..., :3], rate[..., 3:])

    def kinetic(x: Array, rate: Array) -> Array:
        at = motion(np.broadcast_to(x, rate.shape), rate)
        drives = by_chains(platform, at)
        found: Array = energies(massless, at)[0] + 0.5 * (
            p['actuator.reflected_mass'] * drives ** 2).sum(axis=1)
        return found

    def momenta(time: float) -> Array:
        x, rate, _ = coordinates(time)
        ends = rate + np.concatenate([np.eye(6), -np.eye(6)])  # exact: the energy is quadratic
        energy = kinetic(x, ends)
        return 0.5 * (energy[:6] - energy[6:])

    h = 0.02
    steps = h * np.arange(-4, 5)
    x, rate, acceleration = coordinates(0.0)
    change = DIFFERENCES @ np.array([momenta(step) for step in steps]) / h
    slopes = np.empty(6)
    for n in range(6):
        moved = x + steps[:, None] * np.eye(6)[n]
        lagrangian = np.array([kinetic(each, rate[None])[0] for each in moved]) - energies(
            massless, motion(moved, np.broadcast_to(rate, moved.shape)))[1]
        slopes[n] = DIFFERENCES @ lagrangian / h
    # How the drives move with each coordinate.
    drives = by_chains(platform, motion(np.tile(x, (6, 1)), np.eye(6)))
    wanted = np.linalg.solve(drives, change - slopes)
    whole = Motion.from_euler(x[:3], x[3:], rate[:3], rate[3:], acceleration[:3],
                              acceleration[3:])
    forces = platform.inverse_dynamics(whole).forces
    np.testing.assert_allclose(forces, wanted, rtol=0.0, atol=1e-9 * np.abs(forces).max())
    assert np.abs(guided(platform).inverse_dynamics(whole).forces - wanted).max() > (
        1e-4 * np.abs(forces).max())


@pytest.mark.parametrize('seed', range(4))
def test_unit_loads_and_external_wrenches_are_those_of_the_drives(seed: int) -> None:
    platform, random = turning(seed), rng(seed)
    p = platform.parameters
    motion, wrench = random_motion(p, random, 30), random_wrench(p, random, 30)
    result = platform.inverse_dynamics(motion, wrench)
    inverse = np.linalg.inv(np.swapaxes(platform.drive_jacobian(motion), 1, 2))
    inverse[..., 3:] *= p['singularity.characteristic_length']
    np.testing.assert_allclose(
        result.unit_load_forces, np.linalg.norm(inverse, axis=2), rtol=1e-12)
    free = platform.inverse_dynamics(motion).forces
    np.testing.assert_allclose(
        external_wrenches(platform, motion.rows, free, result.forces), wrench, rtol=0.0,
        atol=1e-11 * np.abs(wrench).max())
    # det(J) and the condition number stay those of J_inv
    same = guided(platform).inverse_dynamics(motion, wrench)
    assert np.array_equal(result.determinant, same.determinant)
    assert np.array_equal(result.condition_number, same.condition_number)


def test_a_drive_moves_as_far_for_a_turn_of_an_upright_leg_as_its_screw() -> None:
    p = symmetric_parameters()
    base, joints = p['geometry.base_joints'].copy(), p['geometry.platform_joints'].copy()
    base[0] = joints[0] = [0.0, 0.0, 0.0]
    platform = StewartPlatform(p.replaced({
        'actuator.screw_lead': 0.005, 'drive.gear_ratio': 3.0, 'geometry.zero_length': 1.1,
        'geometry.base_joints': base, 'geometry.platform_joints': joints,
        'drive.screw_rotation': 'universal'}))
    row = platform.drive_jacobian(Motion([0.0, 0.0, 1.0], np.eye(3)))[0]
    np.testing.assert_allclose(row, [0.0, 0.0, 1.0, 0.0, 0.0, -0.005 / (2.0 * np.pi)], atol=1e-15)


@pytest.mark.parametrize('commands', ['force', 'torque'])
def test_an_end_stop_pushes_along_its_leg_alone(commands: str) -> None:
    """At rest, within the end stops of two legs, with no command."""
    free = turning(1)
    pose = random_motion(free.parameters, rng(1), 1)[0]
    position = [*pose.position, 0.0, 0.0, 0.0]
    pose = Motion(pose.position, np.eye(3))
    lengths = free.inverse_kinematics(pose)
    most = lengths + [0.2, 0.2, 0.0, 0.2, 0.0, 0.2]
    plant = Plant(SimulatorParameters({
        **dict(free.parameters), 'limits.length_max': most, 'limits.length_min': 0.1,
        'commands': commands, 'initial_pose': position}))
    # Brakes release; the platform falls or is lifted until legs are in their stops.
    zero = (0.0,) * 6
    up = (0.0, 0.0, 1e5, 0.0, 0.0, 0.0)
    for _ in range(200):
        before = plant.state
        state = plant.advance(zero, up)
        over = np.array(state.positions) - most
        if (over > 1e-5).any():
            break
    assert (over > 1e-5).any() and before.positions != state.positions
    at = Motion.of_rows(np.concatenate([
        state.pose[:3], Rotation.from_quat(state.pose[3:]).as_matrix().ravel(), state.twist,
        np.zeros(6)]))
    forces = np.array(state.efforts)
    # The wrench of the stops on the platform explains its acceleration.
    moving = at.rows.copy()
    moving[ACCELERATION] = state.acceleration
    needed = free.inverse_dynamics(Motion.of_rows(moving), up).forces
    stops = free.drive_jacobian(at).T @ (needed - forces)
    along = np.linalg.solve(free.inverse_jacobian(at).T, stops)
    pushed = np.abs(along) > 1e-6 * np.abs(along).max()
    assert pushed.tolist() == (over > 0.0).tolist()


def test_passivity_and_symmetry() -> None:
    platform, random = turning(4), rng(4)
    motion = random_motion(platform.parameters, random, 1)[0]
    m = platform.mass_matrix(motion)
    np.testing.assert_allclose(m, m.T, rtol=0.0, atol=1e-12 * np.abs(m).max())
    twist = motion.rows[TWIST]
    h = 1e-3

    def energy(time: float) -> float:
        turn = Rotation.from_rotvec(time * motion.angular_velocity).as_matrix()
        at = Motion(motion.position + time * motion.linear_velocity, turn @ motion.rotation)
        return float(twist @ platform.mass_matrix(at) @ twist)

    slope = DIFFERENCES @ np.array([energy(n * h) for n in range(-4, 5)]) / h
    for christoffel in (False, True):
        c = platform.coriolis_matrix(motion, christoffel)
        assert twist @ c @ twist == pytest.approx(0.5 * slope, rel=1e-8)
