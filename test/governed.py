# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Random hexapods, each limit alone and all together, and demands of all kinds for a governor.

Stops from governed states, by equations of their own.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any

from crank_machines import random_machine
from crank_newton_euler import Motion as BodyMotion, State
from crank_platforms import parameters_of
from independent_cranks import cranks
from independent_limits import clearances, conditions
import numpy as np
from numpy.typing import NDArray
from referees import PLATFORM, rotation_about

from stewart_dynamics import GovernedStream, Motion, Parameters, StewartPlatform
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.kinematics.home_pose import home_pose

Array = NDArray[np.float64]

CRANKS = Parameters.from_yaml(PLATFORM.with_name('crank_platform.yaml'))
KINDS = ('length_min', 'length_max', 'velocity_max', 'force_max', 'joint_force_max',
         'base_joint_angle_max', 'platform_joint_angle_max', 'leg_clearance_min', 'plates',
         'torque_max', 'torque_speed', 'speed_max', 'stop_condition', 'all')
DEMANDS = 'waves', 'steps', 'lost', 'poses alone', 'resets', 'noise', 'enormous'
CRANK_KINDS = ('levers alone', 'angle_min', 'angle_max', 'lever_min', 'speed_max', 'torque_max',
               'rod_force_max', 'platform_joint_angle_max', 'motor_torque_max', 'torque_speed',
               'motor_speed_max', 'stop_condition', 'all', 'rig')
CRANK_DEMANDS = *DEMANDS, 'out of reach', 'cut', 'not a number'
RATE = 250.0  # [Hz]


def limited_hexapod(random: np.random.Generator, kind: str) -> tuple[Parameters, Array]:
    """Return a random hexapod with a kind of limit, and the axes of its joints (2, 6, 3)."""
    example = Parameters.from_yaml(PLATFORM)
    size = 10.0 ** random.uniform(-0.3, 0.3)
    given: dict[str, Any] = dict.fromkeys((
        'limits.length_min', 'limits.length_max', 'limits.velocity_max', 'limits.force_max',
        'limits.joint_force_max'))

    def joints(radius: float, first: float) -> Array:
        angles = np.radians(np.repeat([0.0, 120.0, 240.0], 2) + np.tile([-1.0, 1.0], 3) * first)
        angles = angles + random.uniform(-0.06, 0.06, 6)
        return np.column_stack([radius * np.cos(angles), radius * np.sin(angles),
                                random.uniform(-0.05, 0.05, 6) * radius])

    base = joints(random.uniform(0.7, 1.1), random.uniform(40.0, 54.0))
    platform = joints(random.uniform(0.35, 0.7), random.uniform(8.0, 25.0))
    lead = random.choice([0.005, 0.01, 0.02])
    given |= {
        'geometry.base_joints': base.ravel() * size,
        'geometry.platform_joints': platform.ravel() * size,
        'geometry.zero_length': 0.95 * size,
        'platform.mass': 150.0 * random.uniform(0.4, 2.0),
        'platform.center_of_mass': random.uniform(-0.1, 0.15, 3) * size,
        'legs.cylinder.radius': 0.05 * size, 'legs.piston.radius': 0.03 * size,
        'legs.cylinder.length': random.uniform(0.6, 0.9) * size,
        'actuator.screw_lead': lead, 'drive.gear_ratio': 1.0,
        'drive.efficiency': random.uniform(0.7, 1.0),
        'actuator.coulomb_friction': random.uniform(0.0, 40.0)}
    low, high = 0.95 * size, 1.65 * size
    with_home = example.replaced({**given, 'limits.length_min': low, 'limits.length_max': high})
    if kind in ('length_min', 'length_max'):  # home is another pose with one of them
        with_home = example.replaced(given)
        lengths = StewartPlatform(with_home).inverse_kinematics(home_pose(with_home))
        low, high = 0.85 * float(lengths.min()), 1.15 * float(lengths.max())
    home = Motion.from_pose(home_pose(with_home)[None])
    result = StewartPlatform(with_home).inverse_dynamics(home)
    near = clearances(with_home, home)[0]
    force = float(np.abs(result.forces).max())
    every = kind == 'all'
    limits: dict[str, Any] = {}
    if every or kind == 'length_min':
        limits['limits.length_min'] = low
    if every or kind == 'length_max':
        limits['limits.length_max'] = high
    if every or kind == 'velocity_max':
        limits['limits.velocity_max'] = random.uniform(0.2, 0.8) * size
    if every or kind == 'force_max':
        limits['limits.force_max'] = force * random.uniform(1.5, 3.0) + 100.0
    if every or kind == 'joint_force_max':
        limits['limits.joint_force_max'] = force * random.uniform(1.5, 3.0) + 100.0
    if every or kind == 'base_joint_angle_max':
        limits['limits.base_joint_angle_max'] = random.uniform(0.15, 0.5)
    if every or kind == 'platform_joint_angle_max':
        limits['limits.platform_joint_angle_max'] = random.uniform(0.15, 0.5)
    if kind in ('leg_clearance_min', 'plates', 'all'):
        limits['limits.leg_clearance_min'] = float(random.uniform(0.1, 0.8) * near)
    if kind in ('plates', 'all'):
        angles = np.linspace(0.0, 2.0 * np.pi, 8)[:-1]
        ring = np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles])
        limits['geometry.base_outline'] = (0.8 * size * ring - [0.0, 0.0, 0.2 * size]).ravel()
        limits['geometry.platform_outline'] = (0.4 * size * ring + [0.0, 0.0, 0.1 * size]).ravel()
    torque = force * lead / (2.0 * np.pi)
    if every or kind == 'torque_max':
        limits['drive.torque_max'] = torque * random.uniform(2.5, 4.0) + 0.3
    if kind == 'torque_speed' or every:
        fast = 0.5 * size * 2.0 * np.pi / lead * random.uniform(0.5, 2.0)
        limits['drive.torque_speed'] = [
            0.0, torque * 4.0 + 0.3, 0.5 * fast, torque * 4.0 + 0.3, fast, 0.2 * torque]
    if every or kind == 'speed_max':
        limits['drive.speed_max'] = 0.4 * size * 2.0 * np.pi / lead
    if every or kind == 'stop_condition':
        condition = float(result.condition_number[0])
        limits['singularity.warn_condition'] = condition * 1.2
        limits['singularity.stop_condition'] = condition * random.uniform(1.5, 6.0)
    found = example.replaced({**given, **limits})
    # The axes of the joints, from which their angles are counted.
    home = Motion.from_pose(home_pose(found)[None])
    arms = np.reshape(given['geometry.platform_joints'], (6, 3)) @ home.rotation[0].T
    legs = home.position[0] + arms - np.reshape(given['geometry.base_joints'], (6, 3))
    legs /= np.linalg.norm(legs, axis=1)[:, None]
    return found, np.stack([legs, legs @ home.rotation[0]])


def limited_cranks(random: np.random.Generator, kind: str) -> tuple[Parameters, Array]:
    """
    Return a random hexapod with cranks and a kind of limit, and the axes of its joints (2, 6, 3).

    Both branches, different legs, axes of the motors in any direction; or the example's, 'rig'.
    """
    every = kind in ('all', 'rig')
    if kind == 'rig':
        changes: dict[str, Any] = {
            'geometry.crank_branch': ['positive'], 'limits.lever_min': [random.uniform(0.0, 0.3)]}
        for name, low, high in (('limits.speed_max', 1.0, 5.0), ('limits.torque_max', 90.0, 300.0),
                                ('limits.rod_force_max', 700.0, 3000.0)):
            changes[name] = [random.uniform(low, high)]
        widest = random.uniform(0.5, 2.5)
        changes |= {'limits.angle_min': [-widest], 'limits.angle_max': [widest]}
        return CRANKS.replaced(changes), np.zeros((2, 6, 3))
    machine = random_machine(random)
    at_home = State(machine.home, np.eye(3), *np.zeros((4, 3)), np.zeros(6))
    # Home is where the cranks are at the middle of their angles, or at 0.
    middle = BodyMotion(machine, at_home).angle[0]
    if kind in ('levers alone', 'angle_min', 'angle_max'):
        machine = replace(machine, middle=np.zeros(6), zero=np.stack([
            rotation_about(u, q) @ z
            for u, q, z in zip(machine.axis, middle, machine.zero, strict=True)]))
        middle = np.zeros(6)
    low, high = (random.uniform(0.3, 2.5, 6) for _ in range(2))
    changes = {'limits.angle_min': None, 'limits.angle_max': None, 'limits.lever_min': [0.0],
               'actuator.coulomb_velocity': machine.slow}
    if every or kind == 'angle_min':
        changes['limits.angle_min'] = middle - low
    if every or kind == 'angle_max':
        changes['limits.angle_max'] = middle + high
    if kind not in ('angle_min', 'angle_max', 'all', 'levers alone'):
        changes |= {'limits.angle_min': middle - 2.5, 'limits.angle_max': middle + 2.5}
    if every:
        changes |= {'limits.angle_min': middle - low, 'limits.angle_max': middle + low}
    if every or kind == 'lever_min':
        changes['limits.lever_min'] = random.uniform(0.0, 0.4, 6)
    home = Motion.from_pose(home_pose(parameters_of(machine, **changes))[None])
    free = parameters_of(machine, **changes)
    found = cranks(free, home)
    torque, force = (float(np.abs(each).max()) for each in (found.torques, found.rod_forces))
    gear = random.uniform(5.0, 100.0)
    friction = 2.0 * float(machine.coul.max())
    if every or kind == 'speed_max':
        changes['limits.speed_max'] = random.uniform(0.5, 6.0)
    if every or kind == 'torque_max':
        changes['limits.torque_max'] = torque * random.uniform(1.5, 4.0) + friction
    if every or kind == 'rod_force_max':
        changes['limits.rod_force_max'] = force * random.uniform(1.5, 4.0)
    if every or kind == 'platform_joint_angle_max':
        changes['limits.platform_joint_angle_max'] = random.uniform(0.15, 0.6)
    if every or kind in ('motor_torque_max', 'torque_speed', 'motor_speed_max'):
        changes |= {'drive.gear_ratio': gear, 'drive.efficiency': random.uniform(0.7, 1.0)}
    most = (torque * random.uniform(2.5, 5.0) + friction) / gear
    if every or kind == 'motor_torque_max':
        changes['drive.torque_max'] = most
    if every or kind == 'torque_speed':
        fast = gear * random.uniform(1.0, 8.0)
        changes['drive.torque_speed'] = [0.0, most, 0.5 * fast, most, fast, 0.2 * most]
    if every or kind == 'motor_speed_max':
        changes['drive.speed_max'] = gear * random.uniform(1.0, 5.0)
    if every or kind == 'stop_condition':
        condition = float(conditions(free, home)[0][0])
        changes['singularity.warn_condition'] = condition * 1.2
        changes['singularity.stop_condition'] = condition * random.uniform(1.5, 6.0)
    arms = machine.P @ home.rotation[0].T
    rods = home.position[0] + arms - found.ends[0]
    rods /= np.linalg.norm(rods, axis=1)[:, None]
    axes = np.stack([rods, rods @ home.rotation[0]])
    if 'limits.platform_joint_angle_max' in changes:
        changes['geometry.platform_joint_axes'] = axes[1]
    return parameters_of(machine, **changes), axes


def governable(random: np.random.Generator, kind: str,
               limited: Callable[[np.random.Generator, str], tuple[Parameters, Array]],
               ) -> tuple[Parameters, Array, GovernedStream]:
    """Return a limited hexapod whose home is within its limits, and its governor."""
    while True:
        with suppress(ParameterError):
            p, axes = limited(random, kind)
            return p, axes, GovernedStream(p)


def size_of(p: Parameters) -> float:
    """Return the size of a hexapod by which demands are [m]: a quarter is a large one."""
    crank = p['legs.crank.length']
    return (float(p['geometry.zero_length'][0]) / 0.95 if crank is None
            else 4.0 * float(np.mean(crank)))


def random_demand(random: np.random.Generator, kind: str, p: Parameters, samples: int,
                  ) -> tuple[Array, Motion]:
    """Return times and a demand of a kind, about the home pose of a hexapod."""
    home, size = home_pose(p), size_of(p)
    times = np.arange(samples) / RATE
    w = random.uniform(0.3, 9.0, 6)
    sizes = random.uniform(0.2, 3.0) * np.array([0.25, 0.25, 0.2, 0.3, 0.3, 0.5])
    sizes *= (random.random(6) < 0.6)
    sizes[:3] *= size
    phase = random.uniform(0.0, 6.3, 6)
    angle = np.outer(times, w) + phase
    q, v, a = sizes * np.sin(angle), sizes * w * np.cos(angle), -sizes * w ** 2 * np.sin(angle)
    if kind == 'steps':
        at = np.searchsorted(np.sort(random.uniform(0.0, times[-1], 8)), times)
        q, v, a = (random.normal(size=(9, 6)) * sizes * 0.5)[at], 0.0 * v, 0.0 * a
    if kind == 'poses alone':
        v, a = 0.0 * v, 0.0 * a
    if kind == 'resets':
        keep = np.searchsorted(np.sort(random.uniform(0.0, times[-1], 5)), times) % 2 == 0
        q, v, a = (np.where(keep[:, None], each, 0.0) for each in (q, v, a))
    if kind == 'noise':
        q = q + random.normal(size=q.shape) * 10.0 ** random.uniform(-6.0, -2.0)
        v = v + random.normal(size=v.shape) * 0.1
    if kind == 'enormous':
        for _ in range(20):
            n = random.integers(samples)
            (q, v, a)[random.integers(3)][n, random.integers(3)] = 10.0 ** random.uniform(0, 308)
    if kind == 'out of reach':
        q[:, :3] += np.linspace(0.0, 3.0 * size, samples)[:, None] * random.normal(size=3)
    cut = (samples if p['legs.crank.length'] is None
           else int(random.integers(samples // 4, samples)))
    if kind == 'cut':
        q[cut:, :3] = 1e12  # is not followed: the motion stops
    q[:, 3:] = np.clip(q[:, 3:], -3.0, 3.0)
    if kind == 'lost':
        keep = random.random(samples) < 0.9
        for begin in random.integers(0, samples, 4):
            keep[begin:begin + random.integers(200)] = False
        times, q, v, a = (each[keep] for each in (times, q, v, a))
    with np.errstate(all='ignore'):
        motion = Motion.from_euler(home.position + q[:, :3], q[:, 3:], v[:, :3], v[:, 3:],
                                   a[:, :3], a[:, 3:])
    if kind == 'not a number':
        motion = Motion.of_rows(motion.rows.copy())  # from_euler would reject them
        motion.rows[random.random(samples) < 0.02, random.integers(24)] = np.nan
        motion.rows[cut:cut + random.integers(samples)] = np.nan
    return times, motion


def _euler_rates(angles: Array) -> Array:
    """Return E (N, 3, 3) of w = E angles', by the axes of Rz Ry Rx."""
    _, b, c = angles.T
    zero = np.zeros_like(b)
    return np.stack([np.stack([np.cos(b) * np.cos(c), np.cos(b) * np.sin(c), -np.sin(b)], axis=-1),
                     np.stack([-np.sin(c), np.cos(c), zero], axis=-1),
                     np.stack([zero, zero, zero + 1.0], axis=-1)], axis=-1)


def stops(p: Parameters, motion: Motion, rate: float, parts: Array) -> Motion:
    """
    Return the stops from states of a motion (N,), N * M samples at M times parts / rate.

    Each coordinate's velocity follows v'' + 2 k v' + k^2 v = 0. The coordinates are position, and
    angles of R = Rz Ry Rx in the axes of home; their rates come from w = E angles'.
    """
    home = home_pose(p)
    turn = np.einsum('ji,njk->nik', home.rotation, motion.rotation)
    angles = np.stack([np.arctan2(turn[:, 2, 1], turn[:, 2, 2]), -np.arcsin(turn[:, 2, 0]),
                       np.arctan2(turn[:, 1, 0], turn[:, 0, 0])], axis=-1)
    e = _euler_rates(angles)
    w, alpha = (each @ home.rotation for each in (
        motion.angular_velocity, motion.angular_acceleration))
    rates = np.linalg.solve(e, w[..., None])[..., 0]
    step = 1e-6
    e_rate = (_euler_rates(angles + step * rates) - _euler_rates(angles - step * rates)) / (
        2.0 * step)
    second = np.linalg.solve(e, (alpha - np.einsum('nij,nj->ni', e_rate, rates))[..., None])
    q = np.concatenate([(motion.position - home.position) @ home.rotation, angles], axis=-1)
    v = np.concatenate([motion.linear_velocity @ home.rotation, rates], axis=-1)
    a = np.concatenate([motion.linear_acceleration @ home.rotation, second[..., 0]], axis=-1)
    t = (parts / rate)[None, :, None]
    fall, slope = np.exp(-rate * t), (a + rate * v)[:, None]
    q, v, a = q[:, None], v[:, None], a[:, None]
    # integrals of (v + slope t) exp(-rate t)
    at = q + v * (1.0 - fall) / rate + slope * (1.0 - fall - rate * t * fall) / rate ** 2
    at_v, at_a = (v + slope * t) * fall, (slope - rate * (v + slope * t)) * fall
    rows = [each.reshape(-1, 6) for each in (at, at_v, at_a)]
    inner = Motion.from_euler(rows[0][:, :3], rows[0][:, 3:], rows[1][:, :3], rows[1][:, 3:],
                              rows[2][:, :3], rows[2][:, 3:])
    home_axes = home.rotation.T
    return Motion(home.position + inner.position @ home_axes, home.rotation @ inner.rotation,
                  inner.linear_velocity @ home_axes, inner.angular_velocity @ home_axes,
                  inner.linear_acceleration @ home_axes, inner.angular_acceleration @ home_axes)
