# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Random hexapods, each limit alone and all together, and demands of all kinds for a governor."""

from __future__ import annotations

from typing import Any

from independent_limits import clearances
import numpy as np
from numpy.typing import NDArray
from referees import PLATFORM

from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.mechanics.kinematics.home_pose import home_pose

Array = NDArray[np.float64]

KINDS = ('length_min', 'length_max', 'velocity_max', 'force_max', 'joint_force_max',
         'base_joint_angle_max', 'platform_joint_angle_max', 'leg_clearance_min', 'plates',
         'torque_max', 'torque_speed', 'speed_max', 'stop_condition', 'all')
DEMANDS = 'waves', 'steps', 'lost', 'poses alone', 'resets', 'noise', 'enormous'
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


def random_demand(random: np.random.Generator, kind: str, p: Parameters, samples: int,
                  ) -> tuple[Array, Motion]:
    """Return times and a demand of a kind, about the home pose of a hexapod."""
    home, size = home_pose(p), float(p['geometry.zero_length'][0]) / 0.95
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
    q[:, 3:] = np.clip(q[:, 3:], -3.0, 3.0)
    if kind == 'lost':
        keep = random.random(samples) < 0.9
        for begin in random.integers(0, samples, 4):
            keep[begin:begin + random.integers(200)] = False
        times, q, v, a = (each[keep] for each in (times, q, v, a))
    with np.errstate(all='ignore'):
        return times, Motion.from_euler(home.position + q[:, :3], q[:, 3:], v[:, :3], v[:, 3:],
                                        a[:, :3], a[:, 3:])
