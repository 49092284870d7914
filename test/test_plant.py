# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The plant: balances and closed forms, which it does not use, over its motions."""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Any

from crank_machines import random_machine
from crank_platforms import parameters_of
from legs_of_all_kinds import KINDS
from messages import STORE
import numpy as np
from numpy.typing import NDArray
import pytest
from referees import (
    assert_order, energies, friction, random_base_motion, relative, rng,
    rotation_about, size_of, smooth_motion)
from simulated import FRICTIONLESS, HEXAPOD, MASSLESS, random_simulated, simulated, UNLIMITED
from snapshot import Snapshot
from stewart_dynamics import BaseMotion, Motion, ParameterError, Parameters, Pose, StewartPlatform
from stewart_dynamics.mechanics.frames.rotation import from_quaternion
from stewart_dynamics.simulator.plant import largest_eigenvalue, Plant, PlantState, substeps
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters
from stewart_dynamics.simulator.state_messages import OUTPUT_TYPES, StateMessages

PROGRAM = 'stewart_simulator'

Array = NDArray[np.float64]
Six = tuple[float, float, float, float, float, float]

ZERO: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def set_moving(plant: Plant, twist: Any) -> None:
    """Give it a twist, as if the brakes had been released in motion."""
    plant._plant['state']['twist'][:] = twist


def motion_of(state: PlantState) -> Motion:
    """Return a state as a motion."""
    rotation = np.reshape(from_quaternion(*state.pose[3:]), (3, 3))
    return Motion(state.pose[:3], rotation, state.twist[:3], state.twist[3:],
                  state.acceleration[:3], state.acceleration[3:])


def end_of(plant: Plant) -> Array:
    """Return pose and twist at the end of a run without a fault."""
    assert not plant.fault
    return np.array(plant.state.pose + plant.state.twist)


def energy_of(plant: Plant) -> float:
    """Return kinetic and potential energy [J]."""
    return float(sum(energies(plant.parameters, motion_of(plant.state))))


def test_parameters_that_help_lists_as_not_used_change_nothing() -> None:
    given = simulated(actuator__screw_lead=0.01, drive__torque_max=1e6)
    changes: dict[str, Any] = {}
    for name in SimulatorParameters.unused:
        if name.startswith(given.leg_kind.foreign):
            continue
        rule, value = given.table[name], given[name]
        if rule.kind == 'bool':
            changes[name] = not value
        elif rule.choices:
            changes[name] = next(each for each in rule.choices if each != value)
        elif rule.kind == 'string':
            changes[name] = f'other_{value}'
        else:
            changes[name] = (0.5 + 1.5 * value if value is not None and not np.ndim(value)
                             else 1.1 * value if value is not None and np.any(value)
                             else 0.01 if rule.sizes == () or 1 in rule.sizes
                             else np.linspace(0.01, 0.02, rule.sizes[-1]))
    one, other = Plant(given), Plant(given.replaced(changes))
    load = 0.2 * given['platform.mass'] * 9.81 * np.arange(6.0)
    for _ in range(20):
        both = [np.concatenate([np.ravel(part) for part in each.advance(tuple(load), ZERO)])
                for each in (one, other)]
        # J_inv is solved with moments over the characteristic length: rounding differs.
        assert relative(*both) < 1e-12
    assert max(np.abs(one.state.rates)) > 0.01  # above what limits.velocity_max is there


# Energy

def test_the_error_falls_with_the_fourth_power_of_the_step() -> None:
    # A violent motion, under loads that do not depend on the step.
    ends = []
    for step in (1e-3, 5e-4, 2.5e-4, 1.25e-4):
        plant = Plant(random_simulated(6, rate=100.0, step=step, **FRICTIONLESS))
        set_moving(plant, [2.0, -1.0, 3.0, 8.0, -5.0, 12.0])
        for n in range(20):
            load = 3e3 * np.sin(0.7 * n + np.arange(6.0))
            plant.advance(tuple(load.tolist()), tuple((0.3 * load).tolist()))
        ends.append(end_of(plant))
    assert_order(4.0, ends)


def test_the_energy_lost_is_the_work_of_friction() -> None:
    """In free motion the energy falls all the time, by the product of friction and rate."""
    plant = Plant(random_simulated(7, rate=1000.0))
    set_moving(plant, [0.5, -0.3, 0.2, 0.4, 0.5, -0.6])
    plant.state = plant._run(0)
    last, lost = energy_of(plant), 0.0
    power = friction(plant.parameters, np.array(plant.state.rates)) @ plant.state.rates
    for _ in range(300):
        state = plant.advance(ZERO, ZERO)
        now = energy_of(plant)
        assert now < last
        power_now = friction(plant.parameters, np.array(state.rates)) @ state.rates
        lost += last - now - 0.5e-3 * (power + power_now)  # the trapezoidal rule
        last, power = now, power_now
    # Its error is that of the rule, where a leg changes its direction.
    taken = energy_of(Plant(plant.parameters)) - last
    assert abs(lost) < 1e-3 * abs(taken)


# Against solutions without integration

def test_a_free_symmetrical_body_falls_on_a_parabola_and_precesses() -> None:
    """
    With legs that have no mass and give no force, it is Euler's top in free fall.

    Its angular momentum h is constant; it turns about h at |h| / I_1, and about its own axis at
    (1 - I_3 / I_1) times its spin (Goldstein, Classical Mechanics, 3rd ed., 5.6).
    """
    errors, omega = [], np.array([30.0, -20.0, 25.0])
    for step in (1e-3, 5e-4, 2.5e-4, 1.25e-4):
        plant = Plant(simulated(
            step=step, rate=1000.0, platform__inertia=[10.0, 0.0, 0.0, 10.0, 0.0, 16.0],
            platform__center_of_mass=[0.0] * 3, initial_pose=[0.0, 0.0, 9.0, 0.3, -0.2, 0.5],
            **{**FRICTIONLESS, **UNLIMITED, **MASSLESS}))
        set_moving(plant, [0.3, -0.2, 1.0, *omega])
        first = motion_of(plant.state).rotation
        h = first @ np.diag([10.0, 10.0, 16.0]) @ first.T @ omega
        spin = float(first[:, 2] @ omega) * (1.0 - 16.0 / 10.0)
        for _ in range(1000):
            state = plant.advance(ZERO, ZERO)
        assert not plant.fault
        np.testing.assert_allclose(
            state.pose[:3], [0.3, -0.2, 9.0 + 1.0 - 0.5 * 9.80665], rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(state.acceleration[:3], [0.0, 0.0, -9.80665], atol=1e-9)
        rate = float(np.linalg.norm(h)) / 10.0
        turned = (rotation_about(h / np.linalg.norm(h), rate) @ first
                  @ rotation_about(np.array([0.0, 0.0, 1.0]), spin))
        errors.append(float(np.linalg.norm(motion_of(state).rotation - turned)))
    assert errors[0] < 1e-6
    # Terms of the fourth and fifth order have different signs here, so only over all steps.
    assert abs(math.log2(errors[0] / errors[-1]) / 3.0 - 4.0) < 0.3


@pytest.mark.parametrize('on_base', [False, True], ids=['fixed base', 'moving base'])
@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('seed', range(4))
def test_the_accelerations_require_the_efforts_that_acted(
        seed: int, kind: str, on_base: bool) -> None:
    random = rng(seed)
    if kind == 'crank':
        machine = random_machine(rng(seed))
        plant = Plant(SimulatorParameters({
            **parameters_of(machine).given, 'initial_pose': [*machine.home, 0.0, 0.0, 0.0]}))
        weight = machine.m * 9.80665
        commands = weight * machine.crank * random.uniform(-0.2, 0.2, 6)
        wrench = 0.2 * weight * random.uniform(-1.0, 1.0, 6) * np.repeat(
            [1.0, machine.crank[0]], 3)
    else:
        plant = Plant(random_simulated(seed))
        commands, wrench = random.uniform(-500.0, 500.0, 6), random.uniform(-300.0, 300.0, 6)
    set_moving(plant, random.uniform(-0.3, 0.3, 6) * (kind != 'crank'))
    base = random_base_motion(plant.parameters, random, 3) if on_base else None
    for _ in range(3):
        state = plant.advance(tuple(commands.tolist()), tuple(wrench.tolist()),
                              None if base is None else base.rows)
    result = StewartPlatform(plant.parameters).inverse_dynamics(
        motion_of(state), wrench, base=None if base is None else base[2])
    legs = plant.parameters.leg_kind
    position, rate, effort = (
        getattr(result, each.field) for each in (legs.position, legs.rate, legs.effort))
    assert relative(effort, commands) < 1e-9
    assert relative(state.positions, position) < (1e-12 if kind == 'crank' else 1e-13)
    assert relative(state.rates, rate) < 1e-12
    assert state.efforts == tuple(commands.tolist())


# End stops and saturation

def test_end_stops_hold_a_hexapod_that_falls_on_them() -> None:
    plant = Plant(simulated())
    platform = StewartPlatform(plant.parameters)
    fallen, deepest = energy_of(plant), 0.0
    for _ in range(2000):
        state = plant.advance(ZERO, ZERO)
        deepest = max(deepest, 0.95 - min(state.positions))
    assert max(map(abs, state.twist)) < 1e-9
    carried = (150.0 + 6 * 6.0) / 6.0 + 30.0
    stiffness = carried * (2.0 * math.pi * 30.0) ** 2
    # At rest the springs carry the hexapod, as its gravity vector has it without them.
    motion = motion_of(state)
    held = np.linalg.solve(platform.inverse_jacobian(motion).T,
                           platform.gravity_vector(motion))
    assert relative(stiffness * (0.95 - np.array(state.positions)), held) < 1e-9
    # No leg went deeper than all that fell would have pressed its spring together.
    assert 0.0 < deepest < math.sqrt(2.0 * (fallen - energy_of(plant)) / stiffness)
    assert deepest < 0.02


@pytest.mark.parametrize('ratio', [0.0, 0.3, 3.0])
def test_end_stops_only_push_back_and_add_no_energy(ratio: float) -> None:
    """Their force is what the balance of forces leaves: outward where short, never inward."""
    parameters = simulated(end_stops__damping_ratio=ratio, rate=1000.0, **FRICTIONLESS)
    plant, platform = Plant(parameters), StewartPlatform(parameters)
    before = energy_of(plant)
    met = 0
    for _ in range(1000):
        state = plant.advance(ZERO, ZERO)
        stops = platform.inverse_dynamics(motion_of(state)).forces
        inside = np.array(state.positions) > 0.95
        assert np.all(np.abs(stops[inside]) < 1e-7)
        assert np.all(stops > -1e-7)
        met += int(np.any(~inside))
        stored = np.sum(np.maximum(0.95 - np.array(state.positions), 0.0) ** 2)
        assert energy_of(plant) + 0.5 * 61.0 * (2.0 * math.pi * 30.0) ** 2 * stored < (
            before * (1.0 + 1e-4))
    assert met


def test_actuators_saturate() -> None:
    plant = Plant(simulated())
    state = plant.advance((7000.0, -8000.0, 5000.0, 6000.0, -6000.0, 6000.0001), ZERO)
    assert state.efforts == (6000.0, -6000.0, 5000.0, 6000.0, -6000.0, 6000.0)
    other = Plant(simulated())
    assert other.advance((6000.0, -6000.0, 5000.0, 6000.0, -6000.0, 6000.0), ZERO) == state


def test_brakes_stop_it_where_it_is() -> None:
    plant = Plant(simulated())
    for _ in range(100):
        moving = plant.advance((600.0, 500.0, 600.0, 500.0, 600.0, 500.0), ZERO)
    assert any(moving.twist)
    braked = plant.brake()
    assert braked.pose == moving.pose
    assert braked.positions == moving.positions
    for rest in (braked.twist, braked.rates, braked.efforts, braked.acceleration):
        assert rest == (0.0,) * 6
    assert plant.advance((600.0, 500.0, 600.0, 500.0, 600.0, 500.0), ZERO).twist != (0.0,) * 6


# Stiff hexapods

@pytest.mark.parametrize('seed', range(6))
def test_the_energy_of_a_released_stiff_hexapod_never_increases(seed: int) -> None:
    """Friction from zero to far too much, stops from soft to hard, with reflected mass or none."""
    random = rng(seed)
    p = random_simulated(seed)
    lengths = StewartPlatform(p).inverse_kinematics(
        Pose(p['initial_pose'][:3], np.eye(3)))
    plant = Plant(random_simulated(
        seed, rate=1000.0, limits__length_min=(lengths * random.uniform(0.8, 0.99)).tolist(),
        limits__length_max=(lengths * random.uniform(1.01, 1.3)).tolist(),
        actuator__viscous_friction=float(10.0 ** random.uniform(-1.0, 4.0)),
        actuator__coulomb_friction=float(10.0 ** random.uniform(-1.0, 2.5)),
        actuator__reflected_mass=float(random.choice([0.0, 1.0, 30.0])),
        end_stops__frequency=float(10.0 ** random.uniform(0.0, 2.5)),
        end_stops__damping_ratio=float(10.0 ** random.uniform(-1.0, 1.0))))
    limits = plant.parameters['limits.length_min'], plant.parameters['limits.length_max']
    moved = plant.parameters['platform.mass'] + sum(plant.parameters['legs.piston.mass'])
    carried = moved / 6.0 + plant.parameters['actuator.reflected_mass']
    stiffness = carried * (2.0 * math.pi * plant.parameters['end_stops.frequency']) ** 2
    set_moving(plant, random.uniform(-2.0, 2.0, 6))
    plant.state = plant._run(0)

    def energy() -> float:
        now = np.array(plant.state.positions)
        deep = np.maximum(limits[0] - now, 0.0) + np.maximum(now - limits[1], 0.0)
        return energy_of(plant) + 0.5 * float(stiffness @ deep ** 2)

    kinetic, last = float(energies(plant.parameters, motion_of(plant.state))[0]), energy()
    for _ in range(min(400, 20_000 // plant.substeps)):
        plant.advance(ZERO, ZERO)
        now = energy()
        assert now < last + 1e-12 * (kinetic + abs(last))
        last = now
    assert not plant.fault


# Motions that cannot be computed

def finite(state: PlantState) -> bool:
    """Return whether all numbers of a state are."""
    return all(map(math.isfinite, (number for part in state for number in part)))


@pytest.mark.parametrize('commands', [(1e300,) * 6, (1e15, -1e15) * 3, (1.7e308,) * 6], ids=str)
def test_numbers_that_overflow_hold_it_at_rest(commands: Six) -> None:
    plant = Plant(simulated(**UNLIMITED))
    plant.advance((400.0,) * 6, ZERO)
    for _ in range(10):
        state = plant.advance(commands, ZERO)
        assert finite(state)
    assert 'motion cannot be computed' in plant.fault
    assert state.twist == state.acceleration == state.efforts == state.rates == ZERO
    assert plant.advance((400.0,) * 6, ZERO) is state
    lengths = StewartPlatform(plant.parameters).inverse_kinematics(motion_of(state))
    assert relative(state.positions, lengths) < 1e-13


@pytest.mark.parametrize('massless', [False, True])
def test_legs_of_zero_length_hold_it_at_rest(massless: bool) -> None:
    """Base and platform joints are alike and it falls straight down, through itself."""
    joints = HEXAPOD['geometry.base_joints']
    plant = Plant(simulated(geometry__platform_joints=joints, **{
        **UNLIMITED, **FRICTIONLESS, **(MASSLESS if massless else {}),
        'platform.center_of_mass': [0.0, 0.0, 0.0],
        'initial_pose': [1e-4, 0.0, 0.5, 0.0, 0.0, 0.0]}))
    for _ in range(2000):
        state = plant.advance(ZERO, ZERO)
        assert finite(state)
    assert 'motion cannot be computed' in plant.fault
    assert abs(state.pose[2]) < 0.05


def test_through_a_singularity_it_falls_as_a_free_body_does() -> None:
    """Where det(J) is zero the legs hold no longer; nothing of the motion is singular."""
    plant = Plant(simulated(**UNLIMITED))
    dets = []
    platform = StewartPlatform(plant.parameters)
    for _ in range(600):
        motion = motion_of(plant.advance(ZERO, ZERO))
        dets.append(np.linalg.det(platform.inverse_jacobian(motion)))
    assert not plant.fault
    assert min(dets) < 0.0 < max(dets)


# Measured

def test_noise_has_its_deviations_and_is_on_the_legs_only() -> None:
    plant = Plant(simulated(noise__length=1e-4, noise__rate=2e-3, noise__force=5.0))
    state = plant.state
    many = 2000
    rows = np.empty((many, 18))
    for n in range(many):
        measured = plant.measured()
        rows[n] = measured.positions + measured.rates + measured.efforts
        assert measured[3:] == state[3:]
    truth = np.array(state.positions + state.rates + state.efforts)
    deviations = np.repeat([1e-4, 2e-3, 5.0], 6)
    noise = (rows - truth) / deviations
    # Five standard errors of a mean, of a deviation and of a correlation.
    assert np.max(np.abs(noise.mean(axis=0))) < 5.0 / math.sqrt(many)
    assert np.max(np.abs(noise.std(axis=0) - 1.0)) < 5.0 / math.sqrt(2.0 * many)
    assert np.max(np.abs(np.corrcoef(noise.T) - np.eye(18))) < 5.0 / math.sqrt(many)
    assert np.max(np.abs(np.mean(noise[1:] * noise[:-1], axis=0))) < 5.0 / math.sqrt(many)


def test_noise_is_the_same_for_the_same_seed() -> None:
    seen = [[plant.measured() for _ in range(3)] for plant in (
        Plant(simulated(noise__length=1e-4, noise__seed=seed)) for seed in (1.0, 1.0, 2.0))]
    assert seen[0] == seen[1]
    assert seen[0] != seen[2]


# The same bits


# Parameters

@pytest.mark.parametrize('changes', [
    {'rate': 300.0},
    {'rate': 2000.0},
    {'step': 2e-3},
    {'initial_pose': [0.0, 0.0, 2.0, 0.0, 0.0, 0.0]},
    {'initial_pose': [0.0, 0.0, 0.5, 0.0, 0.0, 0.0]},
    {'initial_pose': [1e300, 0.0, 0.5, 0.0, 0.0, 0.0], **UNLIMITED},
    {'initial_pose': [0.0, 0.0, 0.0, 0.0, 0.0, 0.0], **UNLIMITED,
     'geometry.platform_joints': HEXAPOD['geometry.base_joints']},
    {'initial_pose': None},
    {'noise.length': -1.0},
    {'noise.force': 1e308}],
    ids=str)
def test_a_broken_rule_is_named(changes: dict[str, Any], snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError) as info:
        Plant(simulated(**changes))
    assert '\n' not in str(info.value)


@pytest.mark.parametrize('rate', [1.0, 40.0, 500.0, 1000.0, 10_000.0])
def test_a_period_is_a_whole_number_of_steps(rate: float) -> None:
    plant = Plant(simulated(rate=rate, step=min(1e-3, 1.0 / rate)))
    assert plant.steps * plant._step == pytest.approx(1.0 / rate, rel=1e-15)
    assert plant._step <= 1e-3 * (1.0 + 1e-12)


# How short steps must be: a bound that holds in every pose, and rejections

@pytest.mark.parametrize('seed', range(8))
def test_the_bound_of_stiffness_holds_in_every_pose(seed: int) -> None:
    random = rng(seed)
    reflected = random.uniform(0.0, 30.0, 6) * (seed % 2)
    p = random_simulated(seed, actuator__reflected_mass=reflected.tolist())
    platform = StewartPlatform(p)
    for kind in range(3):
        has = random.uniform(0.0, 1e5, 6) * (random.uniform(size=6) < (1.0, 0.5, 0.2)[kind])
        bound = largest_eigenvalue(p, has)
        worst = 0.0
        for _ in range(50):
            position = size_of(p) * random.uniform([-1, -1, 0.2], [1, 1, 2], 3)
            turn = rotation_about(np.array([0.6, 0.0, 0.8]), random.uniform(-1.0, 1.0))
            pose = Pose(position, turn)
            jacobian = platform.inverse_jacobian(pose)
            mobility = jacobian @ np.linalg.solve(platform.mass_matrix(pose), jacobian.T)
            root = np.sqrt(has)
            worst = max(worst, float(np.linalg.eigvalsh(root[:, None] * mobility * root)[-1]))
        assert worst <= bound * (1.0 + 1e-12)
        assert bound == 0.0 or worst > 0.05 * bound  # not for nothing


@pytest.mark.parametrize('changes', [
    {'actuator.coulomb_friction': 1e8},
    {'actuator.coulomb_velocity': 1e-12},
    {'actuator.viscous_friction': 1e12},
    {'actuator.viscous_friction': 1e308},
    {'end_stops.frequency': 1e6},
    {'end_stops.frequency': 1e6, 'end_stops.damping_ratio': 1.5},
    {'end_stops.damping_ratio': 1e7}], ids=str)
def test_parameters_that_need_too_short_steps_are_rejected_by_name(
        changes: dict[str, Any], snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        substeps(simulated(actuator__reflected_mass=0.0, **changes))


def test_steps_are_in_proportion_to_the_velocity_of_coulomb_friction() -> None:
    coarse, fine = (substeps(simulated(actuator__coulomb_velocity=velocity,
                                       actuator__reflected_mass=0.0))
                    for velocity in (1e-4, 1e-5))
    assert coarse > 1
    assert 9.5 < fine / coarse < 10.5


# The messages of the simulator, as another library reads them

def test_messages_have_the_state() -> None:
    plant = Plant(simulated(base_frame='ground', joints=list('abcdef'), geometry__zero_length=0.9))
    state = plant.advance((500.0, 400.0, 300.0, 200.0, 100.0, 0.0), ZERO)
    written = dict(StateMessages(plant.parameters).write(12_000_000_034, state))
    assert list(written) == list(OUTPUT_TYPES)
    of = {topic: STORE.deserialize_cdr(data, OUTPUT_TYPES[topic])
          for topic, data in written.items()}
    for topic, each in of.items():
        assert (each.header.stamp.sec, each.header.stamp.nanosec) == (12, 34)
        assert each.header.frame_id == ('' if topic == 'leg_states' else 'ground')
    legs, pose = of['leg_states'], of['pose'].pose
    assert legs.name == list('abcdef')
    assert legs.position.tolist() == [length - 0.9 for length in state.positions]
    assert legs.velocity.tolist() == list(state.rates)
    assert legs.effort.tolist() == [500.0, 400.0, 300.0, 200.0, 100.0, 0.0]
    position, q = pose.position, pose.orientation
    assert (position.x, position.y, position.z, q.x, q.y, q.z, q.w) == state.pose
    for vectors, values in ((of['twist'].twist, state.twist),
                            (of['accel'].accel, state.acceleration)):
        linear, angular = vectors.linear, vectors.angular
        assert values == (linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)


# The plant on a moving base: balances and closed forms in the world, which does not move

MotionOf = Callable[[Any], Motion]

GRAVITY = np.array([0.0, 0.0, -9.80665])  # world axes


def base_motion(parameters: Parameters, seed: int, scale: float = 1.0) -> MotionOf:
    """Return a motion of the base in the world as a function of time."""
    moved = smooth_motion(parameters, rng(seed))

    def at(times: Any) -> Motion:
        motion = moved(scale * np.asarray(times, dtype=float))
        return Motion(motion.position, motion.rotation, scale * motion.linear_velocity,
                      scale * motion.angular_velocity, scale ** 2 * motion.linear_acceleration,
                      scale ** 2 * motion.angular_acceleration)

    return at


def rows_at(base: MotionOf, begin: Any, period: float) -> Array:
    """Return the input of the plant for a period, or (..., 3, BASE) for several periods."""
    times = np.asarray(begin)[..., None] + period * np.array([0.0, 0.5, 1.0])
    return BaseMotion.from_motion(base(times.ravel()), GRAVITY).rows.reshape(*times.shape, -1)


def end_on_base(rate: float, step: float, seconds: float, scale: float = 1.0,
                twist: Any = ZERO) -> Array:
    """Return the end of a run on a moving base."""
    plant = Plant(random_simulated(6, rate=rate, step=step, gravity=GRAVITY.tolist(),
                                   **FRICTIONLESS))
    set_moving(plant, twist)
    base = base_motion(plant.parameters, 9, scale)
    for rows in rows_at(base, np.arange(round(seconds * rate)) / rate, 1.0 / rate):
        plant.advance(ZERO, ZERO, rows)
    return end_of(plant)


def test_the_error_falls_with_the_fourth_power_of_the_period() -> None:
    # A violent motion of hexapod and base; a step is a period, so the base is at each stage right.
    assert_order(4.0, [
        end_on_base(rate, 1.0 / rate, 0.2, 3.0, [2.0, -1.0, 3.0, 8.0, -5.0, 12.0])
        for rate in (1000.0, 2000.0, 4000.0, 8000.0)])


def test_steps_within_a_period_follow_the_base_as_well() -> None:
    """Ten steps of a period of 10 ms come close to ten periods, the parabola being no sine."""
    tens, ones = (end_on_base(rate, 1e-3, 0.5) for rate in (100.0, 1000.0))
    assert 0.0 < relative(tens, ones) < 1e-6


@pytest.mark.parametrize('seed', range(3))
def test_a_constant_velocity_of_the_base_changes_nothing(seed: int) -> None:
    parameters = random_simulated(seed, gravity=GRAVITY.tolist())
    straight = Motion([0.0, 0.0, 0.0], np.eye(3), rng(seed).uniform(-10.0, 10.0, 3))
    rows = BaseMotion.from_motion(straight, GRAVITY).rows
    one, other = Plant(parameters), Plant(parameters)
    for n in range(250):
        force = tuple((300.0 + 200.0 * np.sin(0.05 * n + np.arange(6.0))).tolist())
        one.advance(force, (20.0, 0.0, -30.0, 5.0, 0.0, 1.0), np.array([rows] * 3))
        other.advance(force, (20.0, 0.0, -30.0, 5.0, 0.0, 1.0), None)
    assert not one.fault and not other.fault
    for of_one, of_other in zip(one.state, other.state, strict=True):
        np.testing.assert_allclose(of_one, of_other, rtol=1e-11, atol=1e-10)
