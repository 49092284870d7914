# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Capability of hexapods with cranks: travels against dense scans, loads by inverse dynamics."""

from __future__ import annotations

from typing import Any, NamedTuple

from cases import few
from crank_machines import random_machine
from crank_newton_euler import CrankHexapod
from crank_platforms import parameters_of
import numpy as np
import pytest
from referees import random_direction, rng, ROOT, rotation_about
from stewart_dynamics import (
    Capability, Motion, Parameters, Pose, StewartPlatform)
from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import MotionError, ParameterError, ReachError

FILE = ROOT / 'config' / 'crank_platform.yaml'
MACHINES, TRAVELS = range(100), 20
POINTS = 2001  # of a scan
INSIDE, OUTSIDE = 1e-9, 1e-6  # of a travel: nothing is exceeded before, its limit behind


class Scan(NamedTuple):
    """By how much limits are exceeded at points (N, 6), or (N,) of the singularity."""

    angle_max: Array
    angle_min: Array
    lever_min: Array
    platform_joint_angle_max: Array
    singularity: Array


def scanned(machine: CrankHexapod, p: Parameters, position: Array, rotation: Array) -> Scan:
    """Return what limits say of poses (N, 3), (N, 3, 3), by the law of cosines."""
    arms = np.einsum('nij,kj->nki', rotation, machine.P)
    lines = position[:, None] + arms - machine.center
    across = np.cross(machine.axis, machine.zero)
    x, y = (np.einsum('nki,ki->nk', lines, each) for each in (machine.zero, across))
    radius = np.hypot(x, y)
    part = ((lines ** 2).sum(axis=2) + machine.crank ** 2 - machine.rod ** 2) / (
        2.0 * machine.crank)
    cosine = np.clip(part / radius, -1.0, 1.0)
    sine = np.sqrt((1.0 - cosine) * (1.0 + cosine))
    angle = np.arctan2(y, x) - machine.branch * np.arccos(cosine)
    low, high = p.limits.angle_min, p.limits.angle_max
    middle = np.zeros(6) if low is None or high is None else 0.5 * (low + high)
    turned = middle + np.remainder(angle - middle + np.pi, 2.0 * np.pi) - np.pi
    ends = machine.crank[:, None] * (machine.zero * np.cos(angle)[..., None]
                                     + across * np.sin(angle)[..., None])
    rods = (lines - ends) / machine.rod[:, None]
    scaled = np.concatenate([rods, np.cross(
        arms / p.singularity.characteristic_length, rods)], axis=2)
    sides = np.linalg.det(scaled)
    condition = np.where(sides * sides[0] > 0.0, np.linalg.cond(scaled), np.inf)
    joints = p.geometry.platform_joint_axes
    none = np.full(turned.shape, -np.inf)
    seen = none if joints is None else np.arccos(np.clip(np.einsum(
        'nij,kj,nki->nk', rotation, joints / np.linalg.norm(joints, axis=1)[:, None], rods),
        -1.0, 1.0))
    most = p.limits.platform_joint_angle_max
    # the lever counts as negative where the rod does not reach
    lever = np.where(np.abs(part) < radius, radius * sine / machine.rod,
                     radius - np.abs(part))
    return Scan(none if high is None else turned - high, none if low is None else low - turned,
                p.limits.lever_min - lever, none if most is None else seen - most,
                condition - p.singularity.stop_condition)


def moved(pose: Pose, direction: Array, pivot: Array, travels: Array) -> tuple[Array, Array]:
    """Return positions and rotations of a travel."""
    turn = float(np.linalg.norm(direction[3:]))
    spin = np.cross(direction[3:] / max(turn, 1e-300), -np.eye(3))
    angles = (turn * travels)[:, None, None]
    turns = (np.eye(3) + np.sin(angles) * spin + (1.0 - np.cos(angles)) * spin @ spin
             ) @ pose.rotation
    center: Array = pose.position + pose.rotation @ pivot
    return center + travels[:, None] * direction[:3] - turns @ pivot, turns


def condition_at_home(machine: CrankHexapod) -> float:
    """Return the condition number that the library gives at home."""
    home = Motion(machine.home, np.eye(3))
    return float(StewartPlatform(parameters_of(machine)).inverse_dynamics(home).condition_number)


def limits_of(machine: CrankHexapod, random: np.random.Generator) -> dict[str, Any]:
    """Return random limits: both of an angle, one of them or none; levers down to zero."""
    width = random.uniform(0.4, 3.13, 6)
    offset = random.uniform(-0.3, 0.3, 6)
    found: dict[str, Any] = {
        'limits.angle_min': machine.middle + offset - width,
        'limits.angle_max': machine.middle + offset + width,
        'limits.lever_min': random.choice([0.0, 0.05, 0.1, 0.3])}
    one = random.choice(['', 'limits.angle_min', 'limits.angle_max', 'both'], p=[.6, .15, .15, .1])
    for name in ('limits.angle_min', 'limits.angle_max'):
        if one in (name, 'both'):
            found[name] = None
    if random.uniform() < 0.4:
        stop = random.uniform(1.1, 1.4) * condition_at_home(machine)
        found |= {'singularity.stop_condition': stop, 'singularity.warn_condition': stop}
    if random.uniform() < 0.3:
        # about the direction of the rods at home
        found['limits.platform_joint_angle_max'] = random.uniform(0.4, 1.2)
        found['geometry.platform_joint_axes'] = random.normal(size=(6, 3)) * 0.3 + (
            machine.home + machine.P - machine.center) / np.linalg.norm(
                machine.home + machine.P - machine.center, axis=1)[:, None]
    return found


def direction_of(kind: int, machine: CrankHexapod, random: np.random.Generator) -> Array:
    """Return a random translation, rotation, or both."""
    way: Array = random.normal(size=6) * np.repeat([machine.crank.mean(), 1.0], 3)
    if kind % 3 < 2:
        way[slice(3, 6) if kind % 3 == 0 else slice(0, 3)] = 0.0
    return way


def poses_of(machine: CrankHexapod, p: Parameters, random: np.random.Generator, count: int,
             ) -> Pose:
    """Return random poses within reach, some of them past limits of angles."""
    positions = machine.home + machine.crank.mean() * random.uniform(-0.9, 0.9, (50 * count, 3))
    rotations = np.array([rotation_about(random_direction(random), random.uniform(0.0, 0.6))
                          for _ in positions])
    scan = scanned(machine, p, positions, rotations)
    reached = np.flatnonzero((scan.lever_min.max(axis=1) < 0.0) & (scan.singularity < 0.0))
    good = reached[:count]
    assert len(good) == count
    return Pose(positions[good], rotations[good])


def wrong_travels(seed: int) -> tuple[list[str], list[str]]:
    """Return what is wrong with the travels of a machine, and the limits that end them."""
    random = rng(seed)
    machine = random_machine(random, 0.0)
    p = parameters_of(machine, **limits_of(machine, random))
    c = Capability(StewartPlatform(p))
    directions = np.array([direction_of(n, machine, random) for n in range(TRAVELS)])
    pivots = np.where(np.arange(TRAVELS)[:, None] % 2, random.normal(
        size=(TRAVELS, 3)) * machine.crank.mean(), 0.0)
    poses = poses_of(machine, p, random, TRAVELS)
    found = c.travel(poses, directions, pivots)
    wrong = []
    for n in range(TRAVELS):
        value, limit, leg = found.value[n], str(found.limit[n]), int(found.leg[n])
        end = value if np.isfinite(value) else 2.0 * np.pi / np.linalg.norm(directions[n, 3:])
        travels = np.append(np.linspace(0.0, end * (1.0 - INSIDE), POINTS), end * (1.0 + OUTSIDE))
        scan = scanned(machine, p, *moved(poses[n], directions[n], pivots[n], travels))
        before = {name: each[:-1].max() for name, each in scan._asdict().items()}
        at_once = max(each[0].max() for each in scan) > 0.0
        if value == 0.0:
            right = at_once and getattr(scan, limit)[0].max() > 0.0
        else:
            right = not at_once and max(before.values()) <= 1e-9
        if 0.0 < value < np.inf:
            behind = getattr(scan, limit)[-1]
            right = right and float(behind if leg < 0 else behind[leg]) > 0.0
        if not right:
            wrong.append(f'{seed} {n}: {value} {limit} {leg}: {before}')
    return wrong, found.limit.tolist()


@pytest.mark.parametrize('first', few(MACHINES[::10], 2))
def test_travels_agree_with_a_dense_scan(first: int) -> None:
    ends: set[str] = set()
    for seed in range(first, first + 10):
        wrong, limits = wrong_travels(seed)
        assert not wrong
        ends |= set(limits)
    assert {'angle_max', 'angle_min', 'lever_min'} <= ends


def box_of(machine: CrankHexapod, random: np.random.Generator, size: float) -> Array:
    """Return random ranges with zero in them."""
    half = size * np.repeat([machine.crank.mean(), 0.5], 3) * random.uniform(0.2, 1.0, (2, 6))
    found: Array = np.stack([-half[0], half[1]], axis=1)
    found[random.uniform(size=6) < 0.3] = 0.0
    return found if np.ptp(found) > 0.0 else box_of(machine, random, size)


def points_in(box: Array, random: np.random.Generator, count: int) -> Array:
    """Return the corners of a box, and points inside and on its sides."""
    bits = (np.arange(64)[:, None] >> np.arange(6)) & 1
    corners = np.where(bits == 1, box[:, 1], box[:, 0])
    inside = random.uniform(box[:, 0], box[:, 1], (count, 6))
    sides = np.where(random.uniform(size=(count, 6)) < 0.3, inside,
                     corners[random.integers(64, size=count)])
    return np.concatenate([np.zeros((1, 6)), corners, inside, sides])


def excess(machine: CrankHexapod, p: Parameters, pose: Pose, pivot: Array, points: Array) -> Array:
    """Return the largest excess of each point (N,)."""
    poses = [moved(pose, each, pivot, np.ones(1)) for each in points]
    scan = scanned(machine, p, *(np.concatenate(each) for each in zip(*poses, strict=True)))
    largest: Array = np.max([each if each.ndim == 1 else each.max(axis=1) for each in scan],
                            axis=0)
    return largest


@pytest.mark.parametrize('first', few(range(0, 30, 5), 1))
def test_boxes_agree_with_samples(first: int) -> None:
    answers = []
    for seed in range(first, first + 5):
        random = rng(seed)
        machine = random_machine(random, 0.0)
        p = parameters_of(machine, **limits_of(machine, random))
        c, pose = Capability(StewartPlatform(p)), Pose(machine.home, np.eye(3))
        pivot = random.normal(size=3) * machine.crank.mean()
        if excess(machine, p, pose, pivot, np.zeros((1, 6))) > 0.0:
            continue
        for size in (0.1, 0.4, 1.0):
            box = box_of(machine, random, size)
            found = c.reachable(box, pose, pivot)
            points = points_in(box, random, 1000)
            largest = excess(machine, p, pose, pivot, points).max()
            worst = found.worst
            at = scanned(machine, p, *(np.stack([np.eye(3) if n else machine.home, each])
                                       for n, each in enumerate(
                                           (worst.pose.position, worst.pose.rotation))))
            if found.certain:
                assert largest <= 1e-9
                assert worst.excess <= 1e-9
            else:
                assert worst.excess > 0.0
                assert max(float(each[1].max()) for each in at) > 0.0
            answers.append(found.certain)
        factor = c.reachable_factor(box, pose, pivot)
        assert 0.0 < factor.value <= factor.upper
        assert excess(machine, p, pose, pivot, factor.value * points).max() <= 1e-9
        if factor.limit != 'singularity':
            assert factor.upper / factor.value < 1.0 + 1e-8
    assert {True, False} <= set(answers)


def test_a_box_out_of_reach_names_the_leg() -> None:
    platform = StewartPlatform.from_yaml(FILE)
    c = Capability(StewartPlatform(platform.parameters.replaced({
        'limits.lever_min': 0.0, 'limits.angle_min': None, 'limits.angle_max': None})))
    found = c.reachable(np.outer([0, 0, 1, 0, 0, 0], [0.0, 0.3]))
    assert (found.certain, found.worst.limit, found.worst.excess) == (False, 'lever_min', np.inf)
    with pytest.raises(ReachError, match='leg_'):
        platform.inverse_dynamics(Motion.from_pose(found.worst.pose))
    up = c.travel(platform.home_pose(), [0, 0, 1, 0, 0, 0])
    reach = platform.home_pose().position + [0, 0, up.value]
    assert np.abs(c.platform.inverse_dynamics(Motion.from_pose(Pose(
        reach - [0, 0, 1e-12], np.eye(3)))).levers).min() < 1e-5
    with pytest.raises(ReachError):
        c.platform.inverse_dynamics(Motion.from_pose(Pose(reach + [0, 0, 1e-9], np.eye(3))))
    out = Pose(reach + [0, 0, 0.1], np.eye(3))
    ended = c.travel(out, [0, 0, -1, 0, 0, 0])
    assert (ended.value, ended.limit) == (0.0, 'lever_min')
    with pytest.raises(ReachError):
        c.wrench(out, np.eye(6)[0])


def test_what_limits_nothing_and_what_is_not_known() -> None:
    given = Parameters.from_yaml(FILE)
    c = Capability(StewartPlatform(given.replaced({
        'limits.torque_max': None, 'limits.rod_force_max': None, 'limits.speed_max': None})))
    home = c.platform.home_pose()
    with pytest.raises(ParameterError, match=r'limits\.torque_max: not set'):
        c.wrench(home, np.eye(6)[0])
    with pytest.raises(ParameterError, match=r'limits\.speed_max: not set'):
        c.velocity(home, np.eye(6)[0])
    motion = Motion.of_rows(np.repeat(Motion.from_pose(home).rows[None], 3, axis=0))
    for ask in (lambda: c.speed_factor(motion, times=[0, 1, 2]),
                lambda: c.payload(motion, [0, 0, 0], times=[0, 1, 2])):
        with pytest.raises(ParameterError, match='not set: without a limit there is no answer'):
            ask()
    assert c.amplitude_factor(motion, times=[0, 1, 2]).value == np.inf  # it stays where it is
    with pytest.raises(ParameterError, match='available for telescopic legs alone'):
        c.clearance(home)
    with pytest.raises(MotionError, match='all six numbers are zero'):
        c.travel(home, np.zeros(6))


@pytest.mark.parametrize('seed', range(6))
def test_sections_agree_with_samples(seed: int) -> None:
    random = rng(seed)
    machine = random_machine(random, 0.0)
    angles = StewartPlatform(parameters_of(machine)).inverse_kinematics(
        Pose(machine.home, np.eye(3)))
    # one of two to the ends of reach
    p = parameters_of(machine, **{
        'limits.angle_min': None if seed % 2 else angles - random.uniform(0.4, 1.2, 6),
        'limits.angle_max': None if seed % 2 else angles + random.uniform(0.4, 1.2, 6),
        'limits.lever_min': 0.0 if seed % 2 else 0.1})
    pose = Pose(machine.home, rotation_about(random_direction(random), 0.05))
    turned = np.tile(pose.rotation, (20000, 1, 1))
    found = Capability(StewartPlatform(p)).section(pose, 'xyz'[seed % 3])
    axes = [n for n in range(3) if n != seed % 3]
    edges = np.concatenate([part.points for part in found.boundary])
    low, high = edges.min(axis=0), edges.max(axis=0)
    points = np.tile(pose.position, (2000, 1))
    points[:, axes] = random.uniform(low - 0.1 * (high - low), high + 0.1 * (high - low),
                                     (2000, 3))[:, axes]
    inside = np.zeros(len(points), dtype=bool)
    for loop in found.loops:
        (x, y), (next_x, next_y) = loop[:-1, axes].T, loop[1:, axes].T
        at = points[:, axes]
        above = (y > at[:, 1:]) != (next_y > at[:, 1:])
        with np.errstate(all='ignore'):
            crossing = x + (at[:, 1:] - y) / (next_y - y) * (next_x - x)
        inside ^= (above & (crossing > at[:, :1])).sum(axis=1) % 2 == 1
    scan = scanned(machine, p, np.concatenate([pose.position[None], points]), turned[:2001])
    good = np.max([each if each.ndim == 1 else each.max(axis=1) for each in scan], axis=0) <= 0.0
    tips, longest = machine.center - machine.P @ pose.rotation.T, (
        machine.crank + machine.rod)[:, None]
    step = float(((tips + longest).min(axis=0) - (tips - longest).max(axis=0)).max()) / 128
    away = np.array([np.linalg.norm(edges - each, axis=1).min() for each in points]) > 1.5 * step
    assert np.count_nonzero(away & inside) > 100
    assert (inside == good[1:])[away].all()
    on = scanned(machine, p, np.concatenate([pose.position[None], edges]),
                 turned[:len(edges) + 1])
    assert max(float(each[1:].max()) for each in (on.angle_max, on.angle_min)) < 1e-6
    assert float(on.lever_min[1:].max()) < 1e-6
    assert {part.limit for part in found.boundary} <= set(Scan._fields)
