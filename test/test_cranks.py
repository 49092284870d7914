# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Hexapods with cranks: the library against independent references, and identities."""

from __future__ import annotations

from functools import cache
import json
from pathlib import Path
from typing import Any

from crank_machines import random_machine, random_state
from crank_newton_euler import CrankHexapod, inverse_dynamics, machine_of, State, state_of
from crank_platforms import base_of, motion_of, parameters_of, six
import numpy as np
import pytest
from referees import derivative, relative, rng, rotation_about
from stewart_dynamics import Motion, Parameters, Pose, StewartPlatform
from stewart_dynamics.errors import ParameterError, ReachError, SingularityError
from stewart_dynamics.mechanics.batch import unreached

RIG = json.loads(Path(__file__).with_name('data').joinpath('simulator_rig.json').read_text())
LEG_MASSES = (0.0, 1.0, 20.0, None)
STATES = 12
SEEDS = range(24)
EXACT = 1e-10  # of the largest value


def at_rest(pose: Pose) -> Motion:
    return Motion(pose.position, pose.rotation)


@cache
def case(seed: int) -> tuple[CrankHexapod, StewartPlatform, list[State]]:
    """Return a random machine, its platform, and states, two of three on a moving base."""
    random = rng(seed)
    machine = random_machine(random, LEG_MASSES[seed % len(LEG_MASSES)])
    states = [random_state(machine, random, n % 3 > 0) for n in range(STATES)]
    return machine, StewartPlatform(parameters_of(machine)), states


def assert_answers(platform: StewartPlatform, state: State, truth: Any, tolerance: float) -> None:
    motion, base = motion_of(state), base_of(state)
    found = platform.inverse_dynamics(motion, state.wrench, base)
    larger = np.maximum(np.abs(truth['rod_at_platform']), np.abs(truth['rod_at_crank']))
    assert np.max(np.abs(found.angles - truth['angles'])) < tolerance
    for value, name in ((found.speeds, 'rates'), (found.torques, 'torques'),
                        (found.forces, 'rod_at_platform'), (found.levers, 'lever'),
                        (found.determinant, 'det_rods')):
        largest = max(np.max(np.abs(truth[name])), 1e-300)  # at rest: rates of zero
        assert np.max(np.abs(value - np.asarray(truth[name]))) < tolerance * largest, name
    assert relative(np.abs(found.joint_forces), larger) < tolerance
    wrench = platform.base_wrench(motion, state.wrench, base)
    assert relative(wrench, np.asarray(truth['base_wrench'])) < tolerance
    forward = platform.forward_dynamics(motion, truth['torques'], state.wrench, base)
    scale = max(np.abs(motion.rows[18:]).max(), 1.0)
    assert np.abs(forward.rows[18:] - motion.rows[18:]).max() < 10.0 * tolerance * scale


@pytest.mark.parametrize('numbers', RIG['states'])
def test_published_states(numbers: dict[str, Any]) -> None:
    machine = machine_of(RIG['parameters'], RIG['angle_range'])
    factor = {'massless': 0.0, 'nominal': 1.0, 'heavy': 20.0}[numbers['masses']]
    platform = StewartPlatform(parameters_of(machine, **{
        'legs.crank.mass': factor * machine.mc, 'legs.rod.mass': factor * machine.mr,
        'legs.crank.inertia': [six(factor * each) for each in machine.Ic],
        'legs.rod.inertia': factor * machine.Ir}))
    assert_answers(platform, state_of(numbers), numbers, 1e-12)


def test_home_of_the_published_rig() -> None:
    platform = StewartPlatform.from_yaml('config/crank_platform.yaml')
    assert np.allclose(platform.home_pose().position, RIG['parameters']['home'], atol=1e-12)
    assert np.abs(platform.inverse_kinematics(platform.home_pose())).max() < 1e-12


@pytest.mark.parametrize('seed', SEEDS)
def test_random_machines_agree_with_free_bodies(seed: int) -> None:
    machine, platform, states = case(seed)
    for state in states:
        assert_answers(platform, state, inverse_dynamics(machine, state)._asdict(), EXACT)


@pytest.mark.parametrize('seed', SEEDS)
def test_kinematics_both_ways(seed: int) -> None:
    machine, platform, states = case(seed)
    size = np.mean(np.linalg.norm(machine.center, axis=-1))
    for state in states:
        motion = motion_of(state)
        angles = platform.inverse_kinematics(motion)
        near = Pose(state.t + 0.01 * size, state.R)
        pose = platform.forward_kinematics(angles, near)
        assert np.abs(pose.position - state.t).max() < 1e-9 * size
        assert np.abs(pose.rotation - state.R).max() < 1e-9
        speeds = platform.inverse_dynamics(motion).speeds
        assert relative(platform.twist(motion, speeds), np.hstack([state.v, state.w])) < EXACT
        j_q = platform.drive_jacobian(motion)
        assert relative(j_q @ np.hstack([state.v, state.w]), speeds) < EXACT
        levers = platform.inverse_dynamics(motion).levers
        assert np.linalg.det(j_q) * np.prod(levers) == pytest.approx(
            platform.inverse_dynamics(motion).determinant, rel=1e-9)


def at_time(state: State, time: float) -> Motion:
    """Return the motion of constant acceleration that passes a state at time 0."""
    turn = state.w * time + 0.5 * state.al * time ** 2
    angle = float(np.linalg.norm(turn))
    rotation = rotation_about(turn / angle, angle) @ state.R if angle else state.R
    return Motion(state.t + state.v * time + 0.5 * state.a * time ** 2, rotation,
                  state.v + state.a * time, state.w + state.al * time, state.a, state.al)


@pytest.mark.parametrize('seed', SEEDS)
def test_rates_are_derivatives(seed: int) -> None:
    _, platform, states = case(seed)
    state = states[0]
    motion = motion_of(state)
    step = 1e-6
    rates = derivative(lambda t: platform.inverse_kinematics(at_time(state, t)), step)
    assert relative(rates, platform.inverse_dynamics(motion).speeds) < 1e-6
    for value, rate in ((platform.drive_jacobian, platform.drive_jacobian_rate),
                        (platform.inverse_jacobian, platform.inverse_jacobian_rate)):
        assert relative(derivative(lambda t, of=value: of(at_time(state, t)), step),
                        rate(motion)) < 1e-5
    mass_rate = derivative(lambda t: platform.mass_matrix(at_time(state, t)), step)
    skew = mass_rate - 2.0 * platform.coriolis_matrix(motion, christoffel=True)
    assert relative(skew + skew.T + np.eye(6), np.eye(6)) < 1e-4 * np.abs(mass_rate).max() + 1e-6
    mass = platform.mass_matrix(motion)
    assert relative(mass, mass.T) < EXACT and np.linalg.eigvalsh(mass).min() > 0.0


@pytest.mark.parametrize('seed', SEEDS)
def test_the_work_of_the_torques_is_the_change_of_energy(seed: int) -> None:
    machine, _, states = case(seed)
    state = states[0]
    platform = StewartPlatform(parameters_of(machine, **{
        'actuator.viscous_friction': 0.0, 'actuator.coulomb_friction': 0.0}))

    def energy(time: float) -> float:
        """Return kinetic and potential energy, the latter from the places of the bodies."""
        motion = at_time(state, time)
        twist = motion.rows[12:18]
        lines = platform.parameters.leg_kind.lines(
            platform.parameters, motion.position, motion.rotation)
        assert lines.path is not None
        e = -lines.path.curvatures / machine.crank[:, None]
        n = lines.path.tangents / machine.crank[:, None]
        cranks = machine.center + (machine.cc[:, :1] * e + machine.cc[:, 1:2] * n
                                   + machine.cc[:, 2:] * machine.axis)
        rods = machine.center + machine.crank[:, None] * e + (
            machine.sr[:, None] * lines.directions)
        moments = (machine.m * (motion.position + motion.rotation @ machine.c)
                   + machine.mc @ cranks + machine.mr @ rods)
        return float(0.5 * twist @ platform.mass_matrix(motion) @ twist - machine.g @ moments)

    result = platform.inverse_dynamics(motion_of(state))
    power = float(result.torques @ result.speeds)
    scale = np.abs(result.torques) @ np.abs(result.speeds)
    assert abs(derivative(energy, 1e-6) - power) < 1e-5 * scale


@pytest.mark.parametrize('seed', SEEDS)
def test_without_masses_torques_are_those_of_the_platform(seed: int) -> None:
    machine, _, states = case(seed)
    nothing = dict.fromkeys((
        'legs.crank.mass', 'legs.crank.inertia', 'legs.rod.mass', 'legs.rod.inertia',
        'actuator.reflected_inertia', 'actuator.viscous_friction',
        'actuator.coulomb_friction'), 0.0)
    platform = StewartPlatform(parameters_of(machine, **nothing))
    rest = Motion(states[0].t, states[0].R)
    weight = -machine.m * machine.g
    load = np.hstack([weight, np.cross(states[0].R @ machine.c, weight)])
    torques = np.linalg.solve(platform.drive_jacobian(rest).T, load)
    assert relative(platform.inverse_dynamics(rest).torques, torques) < EXACT


def test_a_mirrored_machine_has_mirrored_angles() -> None:
    machine, platform, states = case(1)
    p, mirror = platform.parameters, np.array([1.0, -1.0, 1.0])
    mirrored = StewartPlatform(p.replaced({
        'geometry.base_joints': p.geometry.base_joints * mirror,
        'geometry.platform_joints': p.geometry.platform_joints * mirror,
        'geometry.crank_axes': p['geometry.crank_axes'] * -mirror,  # an axial vector
        'geometry.crank_directions': p['geometry.crank_directions'] * mirror,
        'platform.center_of_mass': p.platform.center_of_mass * mirror,
        'platform.inertia': p.platform.inertia * [1.0, -1.0, 1.0, 1.0, -1.0, 1.0],
        'legs.crank.center_of_mass': machine.cc * [1.0, 1.0, -1.0],
        'legs.crank.inertia': [[xx, xy, -xz, yy, -yz, zz] for xx, xy, xz, yy, yz, zz in map(
            six, machine.Ic)],
        'gravity': machine.g * mirror}))
    state = states[0]
    reflection = np.diag(mirror)
    there = Motion(state.t * mirror, reflection @ state.R @ reflection, state.v * mirror,
                   state.w * -mirror, state.a * mirror, state.al * -mirror)
    found = mirrored.inverse_dynamics(there)
    truth = platform.inverse_dynamics(motion_of(state))
    assert np.abs(found.angles - truth.angles).max() < 1e-12
    assert relative(found.torques, truth.torques) < EXACT


def one_crank_stretched(short: float) -> tuple[StewartPlatform, Pose]:
    """Return the rig with a rod 1 that stretches its crank at home, but for a length."""
    p = Parameters.from_yaml('config/crank_platform.yaml')
    home = StewartPlatform(p).home_pose()
    u, c = p['geometry.crank_axes'][0], p.geometry.base_joints[0]
    line = home.position + p.geometry.platform_joints[0] - c
    across = line - (line @ u) * u
    rods = p['legs.rod.length'].copy()
    end = c + p['legs.crank.length'][0] * across / np.linalg.norm(across)
    rods[0] = np.linalg.norm(line + c - end) - short
    return StewartPlatform(p.replaced({
        'legs.rod.length': rods, 'geometry.crank_branch': 'positive'})), home


def test_torques_stay_right_near_a_dead_centre() -> None:
    platform, home = one_crank_stretched(-1e-15)
    result = platform.inverse_dynamics(at_rest(home))
    assert abs(result.levers[0]) < 1e-6 and np.isfinite(result.rows).all()
    near, _ = one_crank_stretched(-1e-9)
    assert relative(result.torques, near.inverse_dynamics(at_rest(home)).torques) < 1e-3
    assert result.forces[0] > 10.0  # the rod carries its load; its motor does not


@pytest.mark.parametrize('missing', [1e-9, 1e-4, 0.05])
def test_a_rod_that_does_not_reach_is_named_with_the_missing_distance(missing: float) -> None:
    platform, home = one_crank_stretched(missing)
    for call in (platform.inverse_kinematics, platform.inverse_dynamics,
                 platform.drive_jacobian, platform.mass_matrix):
        with pytest.raises(ReachError, match='leg_1 cannot reach: .* mm missing') as error:
            call(at_rest(home))
        distance = float(str(error.value).split(': ')[-1].split()[0].partition(' mm')[0])
        assert distance == pytest.approx(1e3 * missing, rel=0.01)
    assert issubclass(ReachError, SingularityError)


def test_the_edge_of_reach_is_reachable_or_not_but_never_an_overflow() -> None:
    """A bisection ends at neighbouring numbers, one of which the rod does not reach."""
    platform = StewartPlatform.from_yaml('config/crank_platform.yaml')
    home = platform.home_pose()
    random, seen = rng(3), 0
    for direction in random.normal(0.0, 1.0, (60, 3)):
        low, high = 0.0, 2.0
        while (middle := 0.5 * (low + high)) not in (low, high):
            motion = Motion(home.position + middle * direction, home.rotation)
            marked = platform.inverse_dynamics(motion, singular='nan')
            reached = bool(np.isfinite(marked.rows).all())
            low, high = (middle, high) if reached else (low, middle)
        with pytest.raises(ReachError, match='cannot reach'):
            platform.inverse_dynamics(Motion(home.position + high * direction, home.rotation))
        seen += 1
    assert seen == 60


def test_samples_out_of_reach_can_be_marked() -> None:
    platform = StewartPlatform.from_yaml('config/crank_platform.yaml')
    home = platform.home_pose()
    poses = Pose(home.position + np.outer([0.0, 1.0, 0.01], [0.0, 0.0, 1.0]),
                 np.stack(3 * [home.rotation]))
    found = platform.inverse_dynamics(at_rest(poses), singular='nan')
    assert np.isnan(found.rows[1]).all() and np.isfinite(found.rows[[0, 2]]).all()
    with pytest.raises(ReachError, match='sample 1: leg_'):
        platform.inverse_dynamics(at_rest(poses))


@pytest.mark.parametrize('middle', [-9.0, -3.0, 0.0, 3.0, 9.0])
def test_angles_are_within_half_a_turn_of_the_middle_of_their_limits(middle: float) -> None:
    machine = machine_of(RIG['parameters'], RIG['angle_range'])
    platform = StewartPlatform(parameters_of(machine, **{
        'limits.angle_min': middle - 3.2, 'limits.angle_max': middle + 3.1}))
    angles = platform.inverse_kinematics(Pose(machine.home + [0.02, 0.01, 0.03], np.eye(3)))
    middle -= 0.05
    assert np.abs(angles - middle).max() <= np.pi
    plain = StewartPlatform(parameters_of(machine)).inverse_kinematics(
        Pose(machine.home + [0.02, 0.01, 0.03], np.eye(3)))
    turns = (angles - plain) / (2.0 * np.pi)
    assert np.abs(turns - np.round(turns)).max() < 1e-15 * 10.0


def test_angles_agree_with_the_tangent_everywhere() -> None:
    """All eighths of the circle, their edges, and both signs of zero."""
    machine = machine_of(RIG['parameters'], RIG['angle_range'])
    p = parameters_of(machine)
    turns = np.linspace(-np.pi, np.pi, 721)
    for turn in turns:
        zero = np.array([rotation_about(u, turn) @ z for u, z in zip(
            machine.axis, machine.zero, strict=True)])
        angles = StewartPlatform(p.replaced({
            'geometry.crank_directions': zero, 'limits.angle_min': None,
            'limits.angle_max': None})).inverse_kinematics(Pose(machine.home, np.eye(3)))
        assert np.abs(np.exp(1j * angles) - np.exp(-1j * turn)).max() < 2e-14


def test_a_payload_is_part_of_the_platform() -> None:
    p = Parameters.from_yaml('config/crank_platform.yaml')
    carried = p.replaced({'payload.mass': 80.0, 'payload.center_of_mass': [0.1, 0.0, 0.6]})
    one, other = StewartPlatform(carried), StewartPlatform(carried.merged())
    home = at_rest(one.home_pose())
    torques = one.inverse_dynamics(home).torques
    assert relative(torques, other.inverse_dynamics(home).torques) < EXACT
    assert torques.sum() > 1.3 * StewartPlatform(p).inverse_dynamics(home).torques.sum()


def test_motors_turn_by_the_gear_ratio() -> None:
    p = Parameters.from_yaml('config/crank_platform.yaml').replaced({
        'actuator.reflected_inertia': None, 'drive.gear_ratio': 50.0,
        'drive.motor_inertia': 1.2e-4, 'drive.torque_constant': 0.1})
    assert np.allclose(p['actuator.reflected_inertia'], 0.3)
    platform = StewartPlatform(p)
    home = platform.home_pose()
    motion = Motion(home.position, home.rotation, [0.0, 0.0, 0.1], [0.0, 0.1, 0.0],
                    [0.0, 0.0, 1.0])
    result, motors = platform.inverse_dynamics(motion), platform.motors(motion)
    assert relative(motors.speeds, 50.0 * result.speeds) < EXACT
    assert relative(motors.torques, result.torques / 50.0) < EXACT
    assert relative(motors.currents, result.torques / 5.0) < EXACT
    with pytest.raises(ParameterError, match='contradicts drive.motor_inertia, with which'):
        p.replaced({'actuator.reflected_inertia': 0.31})


@pytest.mark.parametrize(('distance', 'words'), [
    (0.0042, '4.2 mm'), (0.2493, '249 mm'), (0.9985, '998 mm'), (0.9999, '1 m'),
    (4.087, '4.09 m')])
def test_a_missing_distance_has_three_digits(distance: float, words: str) -> None:
    distances, names = np.array([0.0, 0.001, distance, 0.0, 0.0, 0.0]), 'abcdef'
    assert unreached(names, distances) == f'c cannot reach: {words} missing'
