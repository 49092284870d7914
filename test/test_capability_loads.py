# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Loads and rates of capability, whatever limits them: no limit is exceeded before an answer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from cases import few
from crank_machines import random_machine, random_state
from crank_platforms import motion_of, parameters_of
import numpy as np
import pytest
from referees import (
    Array, random_base_motion, random_direction, random_motion, random_parameters, rng,
    rotation_about, smooth_motion)
from stewart_dynamics import BaseMotion, Capability, Motion, Parameters, Pose, StewartPlatform
from stewart_dynamics.capability.capability import Extent
from stewart_dynamics.capability.motions import Deviations, faster
from stewart_dynamics.datasheet.pose_ratings import Payloads
from stewart_dynamics.mechanics.drives.motors import motor_ratio
from stewart_dynamics.mechanics.rows import ACCELERATION, TWIST

Use = dict[str, Array]

# Limits of an answer: the quantity of a result, and its parameter.
LIMITS = {'force_max': ('forces', 'limits.force_max'),
          'joint_force_max': ('joint_forces', 'limits.joint_force_max'),
          'velocity_max': ('rates', 'limits.velocity_max'),
          'crank_torque_max': ('torques', 'limits.torque_max'),
          'rod_force_max': ('joint_forces', 'limits.rod_force_max'),
          'crank_speed_max': ('speeds', 'limits.speed_max')}
RATES = 'velocity_max', 'crank_speed_max', 'speed_max'
AVAILABLE = 'torque_max', 'torque_speed'
# Kinds of hexapods: their limits, and their other parameters.
SCREWS = {'actuator.reflected_mass': 50.0, 'actuator.screw_lead': 0.02}
GEARS = {'drive.gear_ratio': 20.0, 'drive.efficiency': 0.8}
KINDS: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
    'actuators': (('force_max', 'velocity_max'), {}),
    'joints': (('joint_force_max', 'velocity_max'), SCREWS),
    'joints of turning screws': (('joint_force_max', 'velocity_max'), SCREWS | {
        'drive.screw_rotation': 'universal'}),
    'motors': ((), SCREWS | {'actuator.reflected_mass': None, 'drive.efficiency': 0.7,
                             'drive.motor_inertia': 1e-4}),
    'cranks': (('crank_torque_max', 'crank_speed_max'), {}),
    'cranks, rods': (('rod_force_max', 'crank_speed_max'), {}),
    'cranks and rods': (('crank_torque_max', 'rod_force_max', 'crank_speed_max'), {}),
    'cranks by gear motors': ((), GEARS)}
EVERY = pytest.mark.parametrize('kind', KINDS)
SEEDS = pytest.mark.parametrize('seed', few(range(20), 2))


class Rig(NamedTuple):
    """A hexapod whose limits are near the loads of some states, and a smooth motion."""

    platform: StewartPlatform
    rest: Motion
    moving: Motion
    wrench: Array
    base: BaseMotion
    smooth: Motion


def states(kind: str, random: np.random.Generator, changes: dict[str, Any],
           ) -> tuple[Parameters, Motion, Motion]:
    """Return a random hexapod without limits, states in motion, and a smooth motion."""
    times = np.linspace(0.0, 1.0, 40)
    if not kind.startswith('cranks'):
        p = random_parameters(random).replaced(changes)
        return p, random_motion(p, random, 5), smooth_motion(p, random)(times)
    machine = random_machine(random, random.choice([1.0, 20.0]))
    moving = Motion.of_rows(np.array([
        motion_of(random_state(machine, random)).rows for _ in range(5)]))
    rate, size = 2.0 * np.pi * np.array([1.0, 1.0, 2.0]), 0.04 * machine.crank.mean()
    phase = times[:, None] * rate + np.arange(3)
    turn, fast = phase[:, ::-1], rate[::-1]
    return parameters_of(machine, **changes), moving, Motion.from_euler(
        machine.home + size * np.sin(phase), 0.015 * np.sin(turn), size * rate * np.cos(phase),
        0.015 * fast * np.cos(turn), -size * rate ** 2 * np.sin(phase),
        -0.015 * fast ** 2 * np.sin(turn))


def rig(kind: str, seed: int) -> Rig:
    """Return a random hexapod of a kind."""
    random = rng(seed)
    limits, changes = KINDS[kind]
    p, moving, smooth = states(kind, random, changes)
    rest, platform = Motion(moving.position[0], moving.rotation[0]), StewartPlatform(p)
    base = random_base_motion(p, random, 1)[0]
    wrench = 0.1 * p.carried.mass * random.uniform(-1.0, 1.0, 6)

    def near(of: Callable[..., Any], name: str) -> Array:
        """Return bounds near the largest value of a quantity."""
        largest = max(np.abs(getattr(each, name)).max() for each in (
            of(rest), of(moving, wrench, base)))
        return largest * random.uniform(0.9, 3.0, 6)

    bounds = {LIMITS[name][1]: near(platform.inverse_dynamics, LIMITS[name][0])
              for name in limits}
    if not limits:
        torque, speed = (near(platform.motors, name) for name in ('breakaway_torques', 'speeds'))
        bounds = {'drive.torque_max': torque, 'drive.torque_continuous': 0.5 * torque,
                  'drive.speed_max': speed}
        if kind == 'motors':
            last, most = 1.1 * speed.max(), torque.max()
            bounds['drive.torque_speed'] = np.array([
                0.1 * last, most, 0.5 * last, 0.9 * most, last, 0.6 * most])
    return Rig(StewartPlatform(p.replaced(bounds)), rest, moving, wrench, base, smooth)


def use(platform: StewartPlatform, motion: Motion, wrench: Any = None, base: Any = None) -> Use:
    """Return the parts of the limits that samples need (..., 6)."""
    p, result = platform.parameters, platform.inverse_dynamics(motion, wrench, base)
    found = {limit: np.abs(getattr(result, field)) / p[name]
             for limit, (field, name) in LIMITS.items() if p[name] is not None}
    if p.drive.torque_max is not None:
        motors = platform.motors(motion, wrench, base)
        found['torque_max'] = np.abs(motors.breakaway_torques) / motors.available_torques
        found['speed_max'] = np.abs(motors.speeds) / p.drive.speed_max
    return found


def loads(*arguments: Any) -> Use:
    """Return the parts of the limits of loads."""
    return {name: each for name, each in use(*arguments).items() if name not in RATES}


def check(found: Extent, used: Callable[[float], Use], tolerance: float = 1e-9) -> None:
    """Check that an answer is where the limit that is named is reached, and none before."""
    if found.value == 0.0:
        assert max(each.max() for each in used(0.0).values()) > 1.0 - tolerance
        return
    at = used(found.value)
    limit = at['torque_max' if found.limit in AVAILABLE else found.limit].reshape(-1, 6)
    assert max(each.max() for each in at.values()) == pytest.approx(1.0, abs=tolerance)
    assert limit[found.sample or 0, found.leg] == pytest.approx(1.0, abs=tolerance)
    assert max(each.max() for each in used(found.value * (1.0 + 1e-6)).values()) > 1.0
    for part in np.linspace(0.0, 1.0, 21):
        assert max(each.max() for each in used(part * found.value).values()) <= 1.0 + tolerance


def changed(motion: Motion, part: slice, change: Array) -> Motion:
    """Return a motion with a change of its rows."""
    rows = motion.rows.copy()
    rows[..., part] += change
    return Motion.of_rows(rows)


@EVERY
@SEEDS
def test_a_load_ends_at_a_limit(kind: str, seed: int) -> None:
    platform, rest, _, _, base, _ = rig(kind, seed)
    for direction in rng(seed).normal(size=(5, 6)):
        for moved in (None, base):
            check(Capability(platform).wrench(rest, direction, moved),
                  lambda k, way=direction, on=moved: loads(platform, rest, -k * way, on), 1e-11)


@EVERY
@SEEDS
def test_an_acceleration_ends_at_a_limit(kind: str, seed: int) -> None:
    platform, rest, moving, *_ = rig(kind, seed)
    direction = rng(seed).normal(size=6)
    slow = changed(rest, TWIST, 0.1 * moving.rows[0, TWIST])
    for begin, given in ((rest, None), (slow, slow)):
        check(Capability(platform).acceleration(rest, direction, given), lambda k, at=begin: loads(
            platform, changed(at, ACCELERATION, k * direction)), 1e-11)


@EVERY
@SEEDS
def test_a_velocity_ends_at_a_limit(kind: str, seed: int) -> None:
    platform, rest, *_ = rig(kind, seed)
    direction = rng(seed).normal(size=6)

    def rates(k: float) -> Use:
        found = use(platform, changed(rest, TWIST, k * direction))
        return {name: each for name, each in found.items() if name in RATES}

    check(Capability(platform).velocity(rest, direction), rates, 1e-13)


def with_payload(p: Parameters, more: float, center: Array) -> Parameters:
    """Return the hexapod with a point mass on it, by the parallel axis theorem."""
    mass, (a, b, c, d, e, f) = p.platform.mass, p.platform.inertia
    both = (mass * p.platform.center_of_mass + more * center) / (mass + more)
    inertia = np.array([[a, b, c], [b, d, e], [c, e, f]])
    for each, place in ((mass, p.platform.center_of_mass), (more, center)):
        arm = place - both
        inertia = inertia + each * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return p.replaced({'platform.mass': mass + more, 'platform.center_of_mass': both,
                       'platform.inertia': inertia[np.triu_indices(3)]})


@EVERY
@SEEDS
def test_a_payload_ends_at_a_limit(kind: str, seed: int) -> None:
    platform, rest, moving, wrench, base, _ = rig(kind, seed)
    center = 0.2 * rng(seed).normal(size=3)
    pose = Pose(rest.position, rest.rotation)
    for given, motion, more in ((pose, rest, (None, None)), (moving, moving, (None, None)),
                                (moving, moving, (wrench, base))):
        found = Capability(platform).payload(given, center, wrench=more[0], base=more[1])
        if np.isfinite(found.value):
            check(found, lambda k, of=(motion, *more): loads(StewartPlatform(with_payload(
                platform.parameters, k, center)), *of))


@EVERY
@pytest.mark.parametrize('seed', few(range(6), 1))
def test_in_every_direction_it_is_the_smallest_of_all_directions(kind: str, seed: int) -> None:
    platform, rest, *_ = rig(kind, seed)
    random, capability = rng(seed), Capability(platform)
    for value, part in ((capability.force(rest), slice(0, 3)),
                        (capability.moment(rest), slice(3, 6))):
        wrenches = np.zeros((20000, 6))
        wrenches[:, part] = [random_direction(random) for _ in wrenches]
        values = capability.wrench(rest, wrenches).value
        assert value <= values.min() * (1.0 + 1e-12)
        assert value == pytest.approx(values.min(), rel=1e-2)


@pytest.mark.parametrize('kind', ['actuators', 'joints', 'joints of turning screws'])
@SEEDS
def test_the_level_of_payloads_is_that_of_a_pose(kind: str, seed: int) -> None:
    platform, rest, *_ = rig(kind, seed)
    capability, pose = Capability(platform), Pose(rest.position, rest.rotation)
    assert Payloads(capability, pose[None]).level() == pytest.approx(
        capability.payload(pose, np.zeros(3)).value, rel=1e-9)


@EVERY
@SEEDS
def test_a_motion_is_faster_and_larger_until_a_limit(kind: str, seed: int) -> None:
    platform, _, _, wrench, _, smooth = rig(kind, seed)
    capability = Capability(platform)
    check(capability.speed_factor(smooth, wrench),
          lambda k: use(platform, Motion.of_rows(faster(smooth.rows, k)), wrench))
    found = capability.amplitude_factor(smooth, None, wrench)
    if found.limit in (*LIMITS, *AVAILABLE, 'speed_max'):
        grown = Deviations(Motion(smooth.position[0], smooth.rotation[0]), smooth.rows)
        check(found, lambda k: use(platform, Motion.of_rows(grown.at(k)), wrench))
    else:
        assert found.limit in ('singularity', 'angle_max', 'angle_min', 'lever_min')


@pytest.mark.parametrize('kind', ['motors', 'cranks by gear motors'])
@SEEDS
def test_what_is_held_without_end_ends_at_the_continuous_torque(kind: str, seed: int) -> None:
    platform, rest, *_ = rig(kind, seed)
    continuous = platform.parameters.drive.torque_continuous
    for direction in rng(seed).normal(size=(5, 6)):
        found = Capability(platform).wrench(rest, direction, continuous=True)
        assert found.limit == 'torque_continuous'
        # The torque that heats the winding at rest is the one without losses.
        check(found._replace(limit='held'), lambda k, way=direction: {'held': np.abs(
            platform.motors(rest, -k * way).torques) / continuous})


def positions(platform: StewartPlatform, pose: Pose) -> Array:
    """Return the positions of the drives: screws that turn are known by their motors."""
    if platform.screws.any():
        ratio = motor_ratio(platform.parameters)
        return np.asarray(platform.motors(Motion.from_pose(pose)).angles / ratio)
    return platform.inverse_kinematics(pose)


@pytest.mark.parametrize(('kind', 'stiffness', 'step', 'tolerance'), [
    ('actuators', 1e6, 1e-5, 1e-8), ('joints of turning screws', 1e7, 1e-6, 1e-7),
    ('cranks', 6e3, 1e-6, 1e-6)])
@SEEDS
def test_stiffness_is_the_derivative_of_the_wrench_of_loaded_springs(
        kind: str, stiffness: float, step: float, tolerance: float, seed: int) -> None:
    platform, rest, *_ = rig(kind, seed)
    capability, pose = Capability(platform), Pose(rest.position, rest.rotation)
    springs = stiffness * rng(seed).uniform(0.1, 1.0, 6)
    still, at_rest = platform.inverse_dynamics(rest), positions(platform, pose)
    held = getattr(still, platform.parameters.leg_kind.effort.field)

    def wrench(change: Array) -> Array:
        size = float(np.linalg.norm(change[3:]))
        turn = rotation_about(change[3:] / (size or 1.0), size)
        moved = Pose(pose.position + change[:3], turn @ pose.rotation)
        efforts = held - springs * (positions(platform, moved) - at_rest)
        return np.asarray(platform.drive_jacobian(moved).T @ efforts)

    found = capability.stiffness(pose, springs)
    expected = np.stack([
        (wrench(-change) - wrench(change)) / (2.0 * step) for change in step * np.eye(6)], -1)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=tolerance * np.abs(found).max())
    unloaded = platform.stiffness(pose, springs)
    assert np.abs(found - unloaded).max() > 1e-6 * np.abs(found).max()
    if kind == 'actuators':
        # With the weight the whole is the second derivative of an energy.
        total = found + capability._weight_stiffness(pose)
        np.testing.assert_allclose(
            total, total.T, rtol=0.0, atol=1e-7 * np.abs(total - unloaded).max())
