# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Motors: torques and energy, the twist of the legs, heat, and the rules of ``drive.*``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from referees import (
    Array, energies, random_direction, random_motion, random_parameters, rng, rotation_about,
    symmetric_parameters)
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from snapshot import Snapshot

from stewart_dynamics import (
    Motion, MotionError, ParameterError, Parameters, SingularityError, StewartPlatform)
from stewart_dynamics.identification.unknowns import Unknowns
from stewart_dynamics.mechanics.drives.heat import temperature_rises
from stewart_dynamics.mechanics.drives.motor_limits import force_limits, rate_limits
from stewart_dynamics.mechanics.drives.motors import motor_ratio
from stewart_dynamics.mechanics.kinematics.leg_joints import home_directions
from stewart_dynamics.mechanics.rows import ACCELERATION, TWIST

HEXAPOD = symmetric_parameters().replaced({'geometry.zero_length': 1.1})
PUBLISHED = {'actuator.screw_lead': 0.005, 'drive.gear_ratio': 3.0,
             'drive.motor_inertia': 1.37e-4, 'drive.torque_max': 8.2}


def driven(p: Parameters, random: np.random.Generator, **changes: Any) -> Parameters:
    """Return a hexapod with six different drives."""
    return p.replaced({
        'geometry.zero_length': 0.3, 'actuator.reflected_mass': None,
        'actuator.coulomb_velocity': 0.02,
        'actuator.screw_lead': random.uniform(0.005, 0.02, 6),
        'drive.gear_ratio': random.uniform(1.0, 4.0, 6),
        'drive.motor_inertia': random.uniform(1e-5, 1e-4, 6),
        'drive.screw_inertia': random.uniform(1e-5, 1e-4, 6),
        'drive.efficiency': random.uniform(0.6, 0.95, 6),
        'drive.torque_constant': random.uniform(0.5, 1.0, 6),
        'drive.resistance': random.uniform(0.5, 2.0, 6), **changes})


def at(time: Array | float, random: np.random.Generator, p: Parameters) -> Motion:
    """Return a smooth motion through a random pose at rest, exact at any times."""
    middle = random_motion(p, random, 1)
    amplitude = np.concatenate([0.05 * random.normal(size=3), 0.1 * random.normal(size=3)])
    frequency, phase = random.uniform(3.0, 9.0, 6), random.uniform(0.0, 6.0, 6)
    turn = np.multiply.outer(np.asarray(time), frequency) + phase
    x, rate, acc = (amplitude * np.sin(turn), amplitude * frequency * np.cos(turn),
                    -amplitude * frequency ** 2 * np.sin(turn))
    return Motion.from_euler(middle.position[0] + x[..., :3], x[..., 3:], rate[..., :3],
                             rate[..., 3:], acc[..., :3], acc[..., 3:])


def test_the_published_machine() -> None:
    p = HEXAPOD.replaced({**PUBLISHED, 'actuator.reflected_mass': None})
    assert motor_ratio(p) == pytest.approx(3769.91, abs=5e-3)
    assert p['actuator.reflected_mass'] == pytest.approx(1947.08, abs=5e-3)
    # 8.2 N m at the motor are 30.9 kN at the leg, without losses.
    platform = StewartPlatform(p)
    motors = platform.motors(Motion.from_pose(platform.home_pose()))
    forces = platform.inverse_dynamics(Motion.from_pose(platform.home_pose())).forces
    assert motors.torques * 3769.9111843 == pytest.approx(forces, rel=1e-9)
    assert motors.margins == pytest.approx(8.2 - np.abs(forces) / 3769.9111843)
    assert np.isnan(motors.currents).all() and np.isnan(motors.power).all()


def expected_torques(p: Parameters, motion: Motion, forces: Array) -> Array:
    """Return torques of a guided screw by the formulas of a textbook, away from standstill."""
    j_inv = StewartPlatform(p).inverse_jacobian(motion)
    twist, acc = motion.rows[..., TWIST], motion.rows[..., ACCELERATION]
    j_rate = StewartPlatform(p).inverse_jacobian_rate(motion)
    rates = np.einsum('...ij,...j->...i', j_inv, twist)
    accelerations = (np.einsum('...ij,...j->...i', j_inv, acc)
                     + np.einsum('...ij,...j->...i', j_rate, twist))
    k = 2.0 * np.pi * p['drive.gear_ratio'] / p['actuator.screw_lead']
    inertia = p['drive.motor_inertia'] + p['drive.screw_inertia'] / p['drive.gear_ratio'] ** 2
    load = forces - inertia * k ** 2 * accelerations
    slip = np.minimum(np.abs(rates) / p['actuator.coulomb_velocity'], 1.0)
    factor = np.where(load * rates > 0.0, 1.0 / p['drive.efficiency'],
                      p['drive.back_driving_efficiency'])
    return load / k * (1.0 + slip * (factor - 1.0)) + inertia * k * accelerations


@pytest.mark.parametrize('seed', range(10))
def test_torques_and_currents_are_those_of_the_formulas(seed: int) -> None:
    random = rng(seed)
    p = driven(random_parameters(random), random)
    assert p['drive.back_driving_efficiency'] == pytest.approx(2.0 - 1.0 / p['drive.efficiency'])
    platform, motion = StewartPlatform(p), random_motion(p, random, 40)
    wrench = random.normal(size=6) * 300.0
    motors, result = platform.motors(motion, wrench), platform.inverse_dynamics(motion, wrench)
    assert motors.angles == pytest.approx(motor_ratio(p) * (result.lengths - 0.3), rel=1e-12)
    assert motors.speeds == pytest.approx(motor_ratio(p) * result.rates, rel=1e-12)
    wanted = expected_torques(p, motion, result.forces)
    assert motors.torques == pytest.approx(wanted, rel=1e-9, abs=1e-9 * np.abs(wanted).max())
    assert motors.currents == pytest.approx(motors.torques / p['drive.torque_constant'])
    assert motors.copper_heat == pytest.approx(p['drive.resistance'] * motors.currents ** 2)
    assert motors.power == pytest.approx(motors.torques * motors.speeds + motors.copper_heat)
    one = platform.motors(motion[3], wrench)
    assert all((a == b[3]).all() for a, b in zip(one, motors, strict=True))


@pytest.mark.parametrize('rotation', ['guided', 'universal'])
@pytest.mark.parametrize('seed', range(5))
def test_work_less_losses_is_the_change_of_energy(seed: int, rotation: str) -> None:
    random = rng(seed)
    p = driven(random_parameters(random), random, **{'drive.screw_rotation': rotation})
    platform = StewartPlatform(p)
    # Rotors turn with their drives, not with the rates of the legs.
    massless = p.replaced({'actuator.reflected_mass': 0.0, 'drive.motor_inertia': None,
                           'drive.screw_inertia': None})
    # Gauss-Legendre in pieces that end where an integrand has a kink: where a rate or a load
    # changes its sign, or the rate leaves the band near standstill. Fine pieces find these.
    begin, end, pieces = 0.0, 0.3, 300
    state = random.bit_generator.state

    def motion_at(time: Array | float) -> Motion:
        random.bit_generator.state = state
        return at(time, random, p)

    def of(time: Array) -> tuple[Array, Array, Array, Array]:
        motion = motion_at(time)
        motors, result = platform.motors(motion), platform.inverse_dynamics(motion)
        k = motor_ratio(p)
        load = result.forces - p['actuator.reflected_mass'] / k * motors.accelerations
        work, rates = motors.torques * motors.speeds, motors.speeds / k
        lost = work - result.forces * rates  # in screw and gear
        slip = np.clip(rates / p['actuator.coulomb_velocity'], -1.0, 1.0)
        lost = lost + rates * (p['actuator.viscous_friction'] * rates
                               + p['actuator.coulomb_friction'] * slip)
        direct = np.abs(load * rates) * np.where(
            load * rates > 0.0, 1.0 / p['drive.efficiency'] - 1.0,
            1.0 - p['drive.back_driving_efficiency']) * np.abs(slip)
        switches = np.concatenate([
            load, rates, np.abs(rates) - p['actuator.coulomb_velocity']], axis=-1)
        friction = rates * (p['actuator.viscous_friction'] * rates
                            + p['actuator.coulomb_friction'] * slip)
        assert lost - friction == pytest.approx(direct, abs=1e-9 * np.abs(work).max())
        return work.sum(axis=-1), (direct + friction).sum(axis=-1), switches, lost

    edges = np.linspace(begin, end, pieces + 1)
    signs = np.sign(of(edges)[2])
    piece, switch = np.nonzero(signs[1:] != signs[:-1])
    low, high = edges[piece], edges[piece + 1]
    for _ in range(50):
        middle = 0.5 * (low + high)
        same = np.sign(of(middle)[2][np.arange(len(piece)), switch]) == signs[piece, switch]
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    edges = np.unique(np.concatenate([edges, low]))
    nodes, weights = np.polynomial.legendre.leggauss(8)
    half = 0.5 * np.diff(edges)
    times = (edges[:-1] + half)[:, None] + half[:, None] * nodes
    work, lost, _, _ = of(times.ravel())
    weight = (half[:, None] * weights).ravel()
    ends = motion_at(np.array([begin, end]))
    drives = platform.motors(ends).speeds / motor_ratio(p)
    stored = np.sum(energies(massless, ends), axis=0) + 0.5 * (
        p['actuator.reflected_mass'] * drives ** 2).sum(axis=1)
    change = np.diff(stored)[0]
    scale = weight @ np.abs(work)
    assert lost.min() >= 0.0 and weight @ lost > 1e-3 * scale
    assert abs(weight @ work - weight @ lost - change) < 1e-9 * scale


def test_at_rest_the_ideal_torque_is_given_and_the_larger_one_counts() -> None:
    random = rng()
    p = driven(random_parameters(random), random, **{'drive.torque_max': 5.0})
    platform = StewartPlatform(p)
    motion = random_motion(p, random, 20)
    rest = Motion(motion.position, motion.rotation)
    motors, forces = platform.motors(rest), platform.inverse_dynamics(rest).forces
    assert motors.torques == pytest.approx(forces / motor_ratio(p))
    wanted = forces / motor_ratio(p) / p['drive.efficiency']
    assert motors.breakaway_torques == pytest.approx(wanted)
    assert motors.margins == pytest.approx(5.0 - np.abs(wanted))
    # A screw that locks itself: nothing holds it at rest, and down it must be pushed.
    locked = platform.parameters.replaced({'drive.efficiency': 0.3})
    moving = platform.twist(rest[0], -np.sign(forces[0]) * 0.1)
    down = Motion(rest[0].position, rest[0].rotation, moving[:3], moving[3:])
    load = StewartPlatform(locked.replaced({
        'actuator.viscous_friction': 0.0, 'actuator.coulomb_friction': 0.0})).motors(down)
    assert (load.torques * load.speeds > 0.0).sum() >= 5


def twist_by_matrices(p: Parameters, motion: Motion, base: Array, platform: Array) -> Array:
    """Return how far each piston turns about its leg against the cylinder, by rotations."""
    found = np.empty(6)
    for leg in range(6):
        b, q = p['geometry.base_joints'][leg], p['geometry.platform_joints'][leg]
        s = motion.position + motion.rotation @ q - b
        s /= np.linalg.norm(s)
        frames = []
        # A universal joint turns about its fixed axis until the leg is in the plane across its
        # second axis, then about that one until the leg points along s: two Euler angles.
        for fixed in (base[leg], motion.rotation @ platform[leg]):
            x = fixed
            seed = np.cross([0.3, 0.5, 0.8], x)
            y = seed / np.linalg.norm(seed)
            z = np.cross(x, y)
            whole = np.column_stack([x, y, z])
            local = whole.T @ s
            first = np.arctan2(-local[1], local[2])
            second = np.arctan2(local[0], np.hypot(local[1], local[2]))
            frames.append(whole @ Rotation.from_euler('XY', [first, second]).as_matrix())
        # The second axis is the frame's y; both frames have s as z.
        between = frames[0].T @ frames[1]
        assert between[2, 2] == pytest.approx(1.0)
        found[leg] = np.arctan2(between[1, 0], between[0, 0])
    return found


@pytest.mark.parametrize('hand', ['right', 'left'])
@pytest.mark.parametrize('given', [False, True])
def test_twist_of_a_leg_between_its_universal_joints(given: bool, hand: str) -> None:
    random = rng(5)
    base = np.array([random_direction(random) for _ in range(6)])
    base[:, 2] = 0.0  # across the legs, about
    base /= np.linalg.norm(base, axis=1, keepdims=True)
    turn = np.array([rotation_about([0.0, 0.0, 1.0], angle)
                     for angle in random.uniform(-0.5, 0.5, 6)])
    axes = np.einsum('nij,nj->ni', turn, base)
    p = driven(HEXAPOD, random, **{
        'drive.screw_rotation': 'universal', 'drive.screw_hand': hand,
        'drive.base_universal_axes': base if given else None,
        # The sense of an axis does not matter.
        'drive.platform_universal_axes': -axes if given else None})
    platform, guided = (StewartPlatform(each) for each in (
        p, p.replaced({'drive.screw_rotation': 'guided'})))
    motion = random_motion(p, random, 30)
    added = platform.motors(motion).angles - guided.motors(motion).angles
    if not given:
        base = np.cross(home_directions(p).base, [0.0, 0.0, 1.0])
        base, axes = (base / np.linalg.norm(base, axis=1, keepdims=True),) * 2
    sign = -1.0 if hand == 'right' else 1.0
    for n in range(30):
        twists = twist_by_matrices(p, motion[n], base, axes)
        # up to half turns, by which two choices of the second axes differ
        off = (added[n] / p['drive.gear_ratio'] * sign - twists) / np.pi
        assert off == pytest.approx(np.round(off), abs=1e-9)
    # Rates and accelerations against differences of the angles.
    state = random.bit_generator.state

    def angles(time: float) -> Array:
        random.bit_generator.state = state
        return platform.motors(at(time, random, p)).angles

    h = 1e-3
    a = [angles(n * h) for n in range(-4, 5)]
    rate = np.dot([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0.0, 4 / 5, -1 / 5, 4 / 105, -1 / 280],
                  a) / h
    acc = np.dot([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560],
                 a) / h ** 2
    random.bit_generator.state = state
    motors = platform.motors(at(0.0, random, p))
    assert motors.speeds == pytest.approx(rate, rel=1e-8, abs=1e-8 * np.abs(rate).max())
    assert motors.accelerations == pytest.approx(acc, abs=1e-6 * np.abs(acc).max())


def test_a_platform_that_turns_about_an_upright_leg_extends_a_right_handed_screw() -> None:
    # The leg of constant length under the platform's origin: a nut that turns against its screw
    # like the hands of a clock seen from below moves up, so the motor must turn back.
    p = HEXAPOD
    base, joints = p['geometry.base_joints'].copy(), p['geometry.platform_joints'].copy()
    base[0] = joints[0] = [0.0, 0.0, 0.0]
    p = p.replaced({**PUBLISHED, 'actuator.reflected_mass': None, 'geometry.base_joints': base,
                    'geometry.platform_joints': joints, 'drive.screw_rotation': 'universal'})
    turned = Motion.from_euler([0.0, 0.0, 1.0], [0.0, 0.0, 0.2])
    motors = [StewartPlatform(p).motors(each).angles[0] for each in (
        Motion([0.0, 0.0, 1.0], np.eye(3)), turned)]
    assert motors[1] - motors[0] == pytest.approx(-3.0 * 0.2)


def test_torque_speed_curve() -> None:
    p = HEXAPOD.replaced({
        **PUBLISHED, 'actuator.reflected_mass': None, 'drive.efficiency': 0.8,
        'drive.torque_speed': [100.0, 8.0, 300.0, 6.0, 400.0, 1.0]})
    platform = StewartPlatform(p)
    pose = platform.home_pose()
    speeds = np.array([-0.0, 99.0, 200.0, -300.0, 350.0, 400.0])
    twist = platform.twist(pose, speeds / motor_ratio(p))
    motion = Motion(pose.position, pose.rotation, twist[:3], twist[3:])
    assert platform.motors(motion).available_torques == pytest.approx(
        [8.0, 8.0, 7.0, 6.0, 3.5, 1.0])
    assert force_limits(p, speeds / motor_ratio(p)) == pytest.approx(
        motor_ratio(p) * 0.8 * np.array([8.0, 8.0, 7.0, 6.0, 3.5, 1.0]))
    assert not force_limits(p, np.full(6, 401.0) / motor_ratio(p)).any()
    assert rate_limits(p) == pytest.approx(400.0 / motor_ratio(p))
    motion = Motion(pose.position, pose.rotation, 1.001 * twist[:3], 1.001 * twist[3:])
    assert platform.motors(motion).available_torques[5] == 0.0


def test_windings_warm_exactly_while_the_heat_is_held() -> None:
    random = rng()
    p = driven(HEXAPOD, random, **{
        'drive.thermal_resistance': random.uniform(0.5, 2.0, 6),
        'drive.thermal_time_constant': random.uniform(5.0, 20.0, 6)})
    times = np.cumsum(random.uniform(0.1, 3.0, 20))
    heat = random.uniform(0.0, 100.0, (20, 6))
    rises = temperature_rises(p, times, heat, np.full(6, 10.0))
    for leg in range(6):
        rise = 10.0
        for n in range(19):
            held = heat[n, leg] * p['drive.thermal_resistance'][leg]
            constant = p['drive.thermal_time_constant'][leg]
            rise = solve_ivp(lambda _, t, held=held, constant=constant: (held - t) / constant,
                             (0.0, times[n + 1] - times[n]), [rise], rtol=1e-12,
                             atol=1e-12).y[0, -1]
            assert rises[n + 1, leg] == pytest.approx(rise, rel=1e-9)
    assert np.isnan(temperature_rises(driven(HEXAPOD, random), times, heat)).all()


def test_without_a_lead_nothing_is_known_and_a_singular_sample_raises() -> None:
    p = HEXAPOD
    platform = StewartPlatform(p)
    motors = platform.motors(Motion.from_pose(platform.home_pose()))
    assert all(np.isnan(each).all() for each in motors[:-1])
    assert repr(motors) == (
        '<Motors of shape (): angles, speeds, accelerations, torques, currents, power, '
        'copper_heat, breakaway_torques, available_torques>')
    flat = Motion(p['geometry.base_joints'].mean(axis=0), np.eye(3))
    with pytest.raises(SingularityError):
        platform.motors(flat)


@pytest.mark.parametrize('changes', [
    {'actuator.screw_lead': None},
    {'actuator.reflected_mass': 30.0},
    {'drive.efficiency': 90.0},
    {'drive.efficiency': 0.0},
    {'drive.back_driving_efficiency': 1.1},
    {'drive.torque_continuous': 9.0},
    {'drive.torque_speed': [0.0, 8.0, 300.0]},
    {'drive.torque_speed': [300.0, 8.0, 200.0, 2.0]},
    {'drive.torque_speed': [0.0, -1.0]},
    {'drive.resistance': 1.0},
    {'drive.temperature_rise_max': 80.0},
    {'drive.screw_rotation': 'free'},
    {'drive.base_universal_axes': [0.0] * 18},
    {'actuator.screw_lead': 1e-300},
    {'drive.gear_ratio': -3.0},
    {'drive.torque': 3.0},
])
def test_rules(changes: dict[str, Any], snapshot: Snapshot) -> None:
    p = HEXAPOD.replaced({**PUBLISHED, 'actuator.reflected_mass': None})
    with snapshot.raises(ParameterError) as caught:
        p.replaced(changes)
    assert '\n' not in str(caught.value)


def test_a_reflected_mass_that_agrees_is_accepted_and_rounding_too() -> None:
    p = HEXAPOD.replaced({**PUBLISHED, 'actuator.reflected_mass': 1947.0})
    assert p['actuator.reflected_mass'] == pytest.approx(1947.0756)
    assert p.drives == ('drive.gear_ratio', 'drive.motor_inertia', 'drive.torque_max')
    assert not HEXAPOD.drives


def test_a_file_has_no_reflected_mass_that_follows(tmp_path: Path) -> None:
    p = HEXAPOD.replaced({**PUBLISHED, 'actuator.reflected_mass': None})
    p.to_yaml(tmp_path / 'drives.yaml')
    assert Parameters.from_yaml(tmp_path / 'drives.yaml') == p
    written = (tmp_path / 'drives.yaml').read_text()
    assert written.count('reflected_mass') == 1  # that of uncertainty
    HEXAPOD.to_yaml(tmp_path / 'no_drives.yaml')
    assert Parameters.from_yaml(tmp_path / 'no_drives.yaml').drives == ()


def test_axes_along_a_leg_are_rejected(snapshot: Snapshot) -> None:
    p = HEXAPOD
    p = p.replaced({**PUBLISHED, 'actuator.reflected_mass': None,
                    'drive.screw_rotation': 'universal',
                    'drive.base_universal_axes': home_directions(p).base})
    with snapshot.raises(ParameterError):
        StewartPlatform(p).motors(Motion([0.0, 0.0, 1.0], np.eye(3)))


def test_force_breakdown_and_identified_masses_with_drives() -> None:
    random = rng()
    p = driven(random_parameters(random), random)
    platform, motion = StewartPlatform(p), random_motion(p, random, 5)
    assert platform.force_breakdown(motion).total == pytest.approx(
        platform.inverse_dynamics(motion).forces, rel=1e-9)
    unknowns = Unknowns(p, ['reflected_mass'])
    values = unknowns.start.copy()
    values[unknowns.asked] = 40.0
    found = unknowns.parameters(values)
    assert (found['actuator.reflected_mass'] == 40.0).all()
    assert 'drive.motor_inertia' not in found.given


def test_motors_are_columns_and_curves_as_results_are(snapshot: Snapshot) -> None:
    platform = StewartPlatform(driven(symmetric_parameters(), rng()))
    motion = random_motion(platform.parameters, rng(), 5)
    motors, result = platform.motors(motion), platform.inverse_dynamics(motion)
    columns = motors.to_dict()
    np.testing.assert_array_equal(columns['torque_3'], motors.torques[:, 2])
    assert len(columns) == 6 * len(motors)
    for plot in (motors.plot, result.plot):
        figure = plot(np.arange(5.0))
        named = [each.name for each in figure.data if each.showlegend]
        assert named == [f'leg_{n}' for n in range(1, 7)]
        # beside the axes: no curve is below it
        assert (figure.layout.legend.yanchor, figure.layout.legend.y) >= ('bottom', 1.0)
    with snapshot.raises(MotionError):
        motors.plot(np.arange(4.0))
