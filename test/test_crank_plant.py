# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The plant with cranks: energies and motions of 13 free bodies, end stops, dead centres."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import math
from typing import Any

from cases import few
from crank_machines import random_machine
from crank_newton_euler import (
    BaseState, CrankHexapod, forward_dynamics, machine_of, masses, Motion, State)
import numpy as np
from numpy.typing import NDArray
import pytest
from referees import (
    assert_order, random_direction, relative, rng, size_of)
from scipy.integrate import solve_ivp
from simulated import simulated
from snapshot import Snapshot
from stewart_dynamics import BaseMotion, ParameterError, Pose, StewartPlatform
from stewart_dynamics import Motion as PlatformMotion
from stewart_dynamics.errors import StewartError
from stewart_dynamics.legs.crank import crank_bodies
from stewart_dynamics.mechanics.frames.rotation import from_quaternion
from stewart_dynamics.simulator.plant import largest_eigenvalue, Plant, PlantState
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters
from test_cranks import parameters_of, RIG
from test_plant import finite

PROGRAM = 'stewart_simulator'

Array = NDArray[np.float64]
Six = tuple[float, float, float, float, float, float]

ZERO: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
LEVER_MIN = 0.1
FREE = dict.fromkeys(('limits.angle_min', 'limits.angle_max'))
MASSLESS = {'legs.crank.mass': 0.0, 'legs.crank.inertia': 0.0, 'legs.rod.mass': 0.0,
            'legs.rod.inertia': 0.0, 'actuator.reflected_inertia': 0.0}


def rig() -> CrankHexapod:
    """Return the published rig, without friction."""
    machine = machine_of(RIG['parameters'], RIG['angle_range'])
    return replace(machine, visc=np.zeros(6), coul=np.zeros(6))


def cranks(machine: CrankHexapod, **changes: Any) -> SimulatorParameters:
    """Return a machine of the references, at home; ``__`` in a name for a point."""
    return SimulatorParameters({
        **parameters_of(machine).given, 'initial_pose': [*machine.home, 0.0, 0.0, 0.0],
        'rate': 1000.0, **{name.replace('__', '.'): value for name, value in changes.items()}})


def state_of(state: PlantState, base: BaseState | None = None) -> State:
    """Return a state of the plant as the references take it, without acceleration."""
    rotation = np.reshape(from_quaternion(*state.pose[3:]), (3, 3))
    return State(np.array(state.pose[:3]), rotation, np.array(state.twist[:3]),
                 np.array(state.twist[3:]), np.zeros(3), np.zeros(3), np.zeros(6), base)


def energy(machine: CrankHexapod, state: PlantState) -> float:
    """Return kinetic and potential energy of all bodies and rotors [J]."""
    motion, mass = Motion(machine, state_of(state)), masses(machine)

    def turning(inertia: Array, rate: Array) -> float:
        """Return half of the sum of (R' s)^2 over masses, by the rates R' of rotations."""
        trace = np.trace(inertia, axis1=-2, axis2=-1)[..., None, None]
        second = 0.5 * trace * np.eye(3) - inertia
        return 0.5 * float(np.einsum('kij,kjl,kil->', rate, second, rate))

    return float(
        0.5 * mass @ np.sum(motion.mass_centers[1] ** 2, axis=-1)
        - mass @ (motion.mass_centers[0] @ machine.g)
        + turning(machine.I[None], motion.platform[1][None])
        + turning(machine.Ic, motion.cranks[1])
        + 0.5 * machine.Ir @ np.sum(motion.rods[1] ** 2, axis=-1)
        + 0.5 * machine.J @ motion.angle[1] ** 2)


def ratios(plant: Plant) -> Array:
    """Return the levers by their largest values."""
    found: Array = plant._plant['lever_ratios'].copy()
    return found


def stiffness_of(p: SimulatorParameters) -> Array:
    """Return the stiffness of the end stops [N m/rad], of what a crank carries at most."""
    size, mass = p['legs.crank.length'], p['legs.crank.mass']
    centers, inertias = crank_bodies(p)
    carried = ((p['platform.mass'] + np.sum(p['legs.rod.mass'])) / 6.0 * size ** 2
               + p['actuator.reflected_inertia'] + inertias[:, 5]
               + mass * np.sum(centers[:, :2] ** 2, axis=-1))
    found: Array = carried * (2.0 * math.pi * p['end_stops.frequency']) ** 2
    return found


def stopped(plant: Plant) -> float:
    """Return the energy in the springs of the end stops [J]."""
    p, state, stiffness = plant.parameters, plant.state, stiffness_of(plant.parameters)
    angles, deep = np.array(state.positions), np.zeros(6)
    if p['limits.angle_min'] is not None:
        deep = np.maximum(p['limits.angle_min'] - angles, 0.0) + np.maximum(
            angles - p['limits.angle_max'], 0.0)
    near = np.maximum(p['limits.lever_min'] - ratios(plant), 0.0)
    return 0.5 * float(stiffness @ (deep ** 2 + near ** 2))


def set_moving(plant: Plant, twist: Any) -> None:
    """Give it a twist, as if the brakes had been released in motion."""
    plant._plant['state']['twist'][:] = twist
    plant.state = plant._run(0)


# Energy, and motions that are integrated independently

@pytest.mark.parametrize('seed', [None, *range(8)])
def test_the_work_of_the_torques_is_the_gain_of_energy(seed: int | None) -> None:
    """
    The sum of torque and change of angle is that of the energy of all bodies, without friction.

    They differ by less than 1e-9 of the energy that the motion exchanges; of the rig, with the
    usual step, by less than 1e-12.
    """
    machine = rig() if seed is None else replace(
        random_machine(rng(seed)), visc=np.zeros(6), coul=np.zeros(6))
    plant = Plant(cranks(machine, step=1e-3 if seed is None else 2e-5))
    weight = machine.m * 9.80665 * machine.crank / 6.0
    first, angles, work, worst, swing = energy(machine, plant.state), np.array(
        plant.state.positions), 0.0, 0.0, 0.0
    for n in range(300):
        torques = weight * machine.branch * (1.0 + np.sin(0.02 * n + np.arange(6.0)))
        state = plant.advance(tuple(torques.tolist()), ZERO)
        if min(ratios(plant)) < 2.0 * LEVER_MIN:
            break  # near an end stop
        work += float(torques @ (np.array(state.positions) - angles))
        angles = np.array(state.positions)
        gained = energy(machine, state) - first
        worst, swing = max(worst, abs(gained - work)), max(swing, abs(gained))
    assert n > 30
    assert not plant.fault
    assert worst < (1e-12 if seed is None else 1e-9) * swing


def test_the_error_falls_with_the_fourth_power_of_the_step() -> None:
    machine, ends = rig(), []
    for step in (5e-3, 2.5e-3, 1.25e-3, 6.25e-4):  # long ones: rounding is 1e-3 of the last error
        plant = Plant(cranks(machine, rate=100.0, limits__lever_min=0.0, **FREE))
        plant.substeps, plant.steps = 1, round(0.01 / step)
        plant._step = step
        plant._plant['step'] = step
        set_moving(plant, [0.4, -0.3, 0.5, 1.0, -0.8, 1.2])
        for _ in range(10):
            state = plant.advance(ZERO, ZERO)
        assert not plant.fault
        ends.append(np.array(state.pose + state.twist))
    assert_order(4.0, ends)


def moving_base(time: float) -> BaseState:
    """Return a motion of the base."""
    turn = np.array([0.5, -0.4, 0.3])
    return BaseState(
        np.array([0.6, -0.4, -9.7]), np.array([1.5, 2.0, -1.0]) * math.sin(9.0 * time),
        turn * math.sin(7.0 * time), 7.0 * turn * math.cos(7.0 * time))


@pytest.mark.parametrize('base', [None, moving_base], ids=['fixed base', 'moving base'])
@pytest.mark.parametrize('rubs', few([False, True], 1), ids=['free', 'friction'])
def test_it_falls_from_home_as_free_bodies_do(
        base: Callable[[float], BaseState] | None, rubs: bool) -> None:
    """
    Motors off: against Newton's and Euler's laws for 13 bodies, by an adaptive method of order 8.

    After 0.15 s the rig has fallen 0.1 m and its cranks turn at 8 rad/s: poses and twists agree to
    1e-9; with friction, which has kinks, to 1e-6.
    """
    machine = machine_of(RIG['parameters'], RIG['angle_range']) if rubs else rig()
    end, step = 0.15, 1e-4 if rubs else 5e-4

    def slope(time: float, y: Array) -> Array:
        x, turn, twist = y[:3], y[3:7] / np.linalg.norm(y[3:7]), y[7:]
        omega = twist[3:]
        state = State(x, np.reshape(from_quaternion(*turn), (3, 3)), twist[:3], omega,
                      np.zeros(3), np.zeros(3), np.zeros(6), base and base(time))
        return np.hstack([twist[:3], 0.5 * (turn[3] * omega + np.cross(omega, turn[:3])),
                          -0.5 * omega @ turn[:3], forward_dynamics(machine, state, np.zeros(6))])

    truth = solve_ivp(slope, (0.0, end), [*machine.home, 0.0, 0.0, 0.0, 1.0, *ZERO],
                      method='DOP853', rtol=1e-9 if rubs else 1e-11, atol=1e-12).y[:, -1]
    plant = Plant(cranks(machine, step=step, rate=1.0 / step))
    plant.substeps, plant.steps = 1, 1
    plant._plant['step'] = plant._step = step
    for n in range(round(end / step)):
        rows = None if base is None else BaseMotion(*np.moveaxis([
            (of.g, of.a, of.w, of.al) for of in (
                base((n + part) * step) for part in (0.0, 0.5, 1.0))], 1, 0)).rows
        state = plant.advance(ZERO, ZERO, rows)
    assert not plant.fault
    assert max(map(abs, state.rates)) > 5.0
    truth[3:7] /= np.linalg.norm(truth[3:7])
    assert np.abs(np.array(state.pose + state.twist) - truth).max() < (1e-6 if rubs else 1e-9)


# End stops

def test_end_stops_of_angles_hold_a_platform_that_falls_on_them() -> None:
    machine = rig()
    plant = Plant(cranks(machine, limits__angle_min=-0.6, limits__angle_max=0.6))
    platform, first = StewartPlatform(plant.parameters), energy(machine, plant.state)
    for _ in range(2000):
        state = plant.advance(ZERO, ZERO)
    assert not plant.fault
    assert max(map(abs, state.twist)) < 1e-9
    motion = PlatformMotion(*(getattr(state_of(state), name) for name in 'tR'))
    held = platform.inverse_dynamics(motion).torques
    deep = -0.6 - np.array(state.positions)
    assert relative(stiffness_of(plant.parameters) * deep, held) < 1e-8
    assert energy(machine, state) < first
    assert np.all(np.array(state.positions) > -0.6 - 0.003)


def test_a_stop_before_the_dead_centre_holds_a_platform_without_limits_of_angles() -> None:
    """From 0.2 m above its rest, it arrives with 15 rad/s and comes to rest at the lever."""
    machine = rig()
    plant = Plant(cranks(machine, **FREE))
    first, fastest, nearest = energy(machine, plant.state), 0.0, 1.0
    for _ in range(1500):
        state = plant.advance(ZERO, ZERO)
        nearest = min(nearest, ratios(plant).min())
        fastest = max(fastest, *map(abs, state.rates))
        assert energy(machine, state) + stopped(plant) < first * (1.0 + 1e-9)
    assert not plant.fault
    assert fastest > 14.0
    assert 0.5 * LEVER_MIN < nearest < LEVER_MIN
    assert max(map(abs, state.twist)) < 1e-6
    assert np.abs(ratios(plant) - LEVER_MIN).max() < 0.002


@pytest.mark.parametrize('changes', few([{}, MASSLESS], 1), ids=['rig', 'massless'])
@pytest.mark.parametrize('sign', [-1.0, 1.0], ids=['down', 'up'])
def test_motors_at_their_limit_do_not_push_it_through(
        sign: float, changes: dict[str, Any]) -> None:
    plant = Plant(cranks(rig(), limits__torque_max=250.0, **{**FREE, **changes}))
    for _ in range(1500):
        state = plant.advance((sign * 1000.0,) * 6, ZERO)
        assert state.efforts == (sign * 250.0,) * 6
        assert ratios(plant).min() > 0.2 * LEVER_MIN
    assert not plant.fault
    assert max(map(abs, state.rates)) < 1e-3
    assert ratios(plant).max() < LEVER_MIN


def test_a_motion_that_no_stop_can_hold_is_refused() -> None:
    """It is held at rest before the dead centre, on the same branch, and says which crank."""
    plant = Plant(cranks(rig(), **FREE))
    set_moving(plant, [0.0, 0.0, 20.0, 0.0, 0.0, 0.0])
    for _ in range(100):
        state = plant.advance(ZERO, ZERO)
        assert finite(state)
        assert ratios(plant).min() > 0.0
    assert 'motion cannot be computed' in plant.fault
    assert 'as at a dead centre; smallest lever: leg_' in plant.fault
    assert state.twist == state.rates == state.efforts == ZERO
    assert plant.advance((50.0,) * 6, ZERO) is state


def test_without_a_stop_the_dead_centre_is_not_passed() -> None:
    plant = Plant(cranks(rig(), limits__lever_min=0.0, **FREE))
    for _ in range(1000):
        state = plant.advance(ZERO, ZERO)
        assert finite(state)
    assert 'dead centre' in plant.fault
    assert 0.0 < ratios(plant).min() < 0.05
    assert min(state.positions) < -1.2


@pytest.mark.parametrize('seed', range(8))
def test_the_energy_of_a_released_hexapod_never_increases(seed: int) -> None:
    """Friction from zero to far too much, stops from soft to hard."""
    machine, random = random_machine(rng(seed)), rng(seed)
    rubs = machine.m * 9.80665 * machine.crank
    machine = replace(machine, visc=rubs * 10.0 ** random.uniform(-4.0, 0.0),
                      coul=rubs * 10.0 ** random.uniform(-4.0, -1.0))
    home = np.array(Plant(cranks(machine)).state.positions)
    plant = Plant(cranks(
        machine, limits__angle_min=home - random.uniform(0.1, 1.0, 6),
        limits__angle_max=home + random.uniform(0.1, 1.0, 6),
        end_stops__frequency=float(10.0 ** random.uniform(1.0, 2.0)),
        end_stops__damping_ratio=float(10.0 ** random.uniform(-1.0, 0.5))))
    size = size_of(plant.parameters)
    set_moving(plant, random.uniform(-0.5, 0.5, 6) * np.repeat([size, 1.0], 3))
    kinetic = last = energy(machine, plant.state)
    for _ in range(min(300, 20_000 // plant.substeps)):
        plant.advance(ZERO, ZERO)
        now = energy(machine, plant.state) + stopped(plant)
        assert now < last + 1e-9 * abs(kinetic)
        last = now
    assert not plant.fault


@pytest.mark.parametrize('massless', [False, True])
@pytest.mark.parametrize('seed', range(6))
def test_the_bound_of_stiffness_holds_near_dead_centres(seed: int, massless: bool) -> None:
    """Inertias of drives bound it even at a lever of 1e-4, where M has grown by 1e8."""
    random = rng(seed)
    machine = random_machine(random)
    p = cranks(machine, **(MASSLESS if massless else {
        'actuator.reflected_inertia': 0.05 * machine.m * machine.crank ** 2}))
    platform, has = StewartPlatform(p), random.uniform(0.1, 1.0, 6)
    bound, worst = largest_eigenvalue(p, has), 0.0
    by_drives = float(np.max(has / p.leg_kind.stop_loads(p).inertia)) if not massless else math.inf
    assert bound < by_drives
    for least in (0.5 * LEVER_MIN,) if massless else (0.5 * LEVER_MIN, 1e-4):
        for _ in range(20):
            pose = near_dead_centre(platform, machine, random, least)
            levers = platform.inverse_dynamics(PlatformMotion.from_pose(pose)).levers
            jacobian = platform.inverse_jacobian(pose) / levers[:, None]
            mobility = jacobian @ np.linalg.solve(platform.mass_matrix(pose), jacobian.T)
            root = np.sqrt(has)
            worst = max(worst, float(np.linalg.eigvalsh(root[:, None] * mobility * root)[-1]))
        assert worst <= (bound if least > 0.01 else by_drives) * (1.0 + 1e-6)
    assert worst > 0.01 * bound  # not for nothing


def near_dead_centre(platform: StewartPlatform, machine: CrankHexapod, random: np.random.Generator,
                     least: float) -> Pose:
    """Return a pose whose smallest lever is this part of its largest."""
    along = random_direction(random)

    def ratio(distance: float) -> float:
        pose = Pose(machine.home + distance * along, np.eye(3))
        try:
            levers = platform.inverse_dynamics(PlatformMotion.from_pose(pose)).levers
        except StewartError:  # out of reach, or singular
            return 0.0
        return float(np.min(np.abs(levers) / machine.crank))

    near, far = 0.0, 4.0 * float(machine.crank.max())
    for _ in range(60):
        middle = 0.5 * (near + far)
        near, far = (middle, far) if ratio(middle) > least else (near, middle)
    return Pose(machine.home + near * along, np.eye(3))


# Parameters and messages

def test_noise_is_that_of_angles_speeds_and_torques() -> None:
    plant = Plant(cranks(rig(), noise__angle=1e-3, noise__speed=2e-2, noise__torque=5.0))
    rows = np.array([np.concatenate(plant.measured()[:3]) for _ in range(2000)])
    noise = (rows - np.concatenate(plant.state[:3])) / np.repeat([1e-3, 2e-2, 5.0], 6)
    assert np.abs(noise.std(axis=0) - 1.0).max() < 5.0 / math.sqrt(4000.0)


def test_torques_of_motors_move_it_by_their_gears() -> None:
    """With losses, motors have the torques that the library gives for the motion."""
    machine = rig()
    plant = Plant(cranks(
        machine, commands='torque', actuator__reflected_inertia=None, drive__gear_ratio=50.0,
        drive__motor_inertia=1.2e-4, drive__efficiency=0.8))
    platform = StewartPlatform(plant.parameters)
    torques = tuple((1.2 + 0.3 * np.arange(6.0)).tolist())
    for _ in range(40):
        state = plant.advance(torques, ZERO)
    s = state_of(state)
    motion = PlatformMotion(s.t, s.R, s.v, s.w, state.acceleration[:3], state.acceleration[3:])
    motors = platform.motors(motion)
    assert relative(motors.torques, torques) < 1e-9
    assert relative(state.motors.speeds, 50.0 * np.array(state.rates)) < 1e-12
    assert relative(platform.inverse_dynamics(motion).torques, state.efforts) < 1e-9


@pytest.mark.parametrize('changes', [
    {'initial_pose': [0.0, 0.0, 0.9, 0.0, 0.0, 0.0]},
    {'initial_pose': [0.0, 0.0, 0.86, 0.0, 0.0, 0.0], **FREE, 'limits.lever_min': 0.7},
    {'initial_pose': [0.0, 0.0, 0.797, 0.0, 0.0, 0.0], 'limits.angle_max': 0.5},
    {'commands': 'force'},
    {'commands': 'torque'},
    {'noise.length': 1e-3},
    {'end_stops.frequency': 1e6},
    {'actuator.coulomb_friction': 1e9}], ids=str)
def test_a_broken_rule_is_named(changes: dict[str, Any], snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError) as info:
        Plant(cranks(rig(), **changes))
    assert '\n' not in str(info.value)


@pytest.mark.parametrize('changes', [{'noise.angle': 1e-3}, {'commands': 'leg_torque'}], ids=str)
def test_parameters_of_the_other_kind_are_named(
        changes: dict[str, Any], snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError) as info:
        simulated(**changes)
    assert '\n' not in str(info.value)
