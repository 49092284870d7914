# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Capability of hexapods with cranks: travels against dense scans, loads by inverse dynamics."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

from crank_machines import random_machine, random_state
from crank_newton_euler import CrankHexapod, State
from crank_platforms import base_of, motion_of, parameters_of
import numpy as np
import pytest
from referees import random_direction, rng, rotation_about, ROOT
from stewart_dynamics import (
    BaseMotion, Capability, Motion, Parameters, Pose, StewartPlatform)
from stewart_dynamics.arrays import Array
from stewart_dynamics.capability.capability import Extent
from stewart_dynamics.errors import MotionError, ParameterError, ReachError
from stewart_dynamics.mechanics.stiffness import platform_stiffness

FILE = ROOT / 'config' / 'crank_platform.yaml'
MACHINES, TRAVELS = range(100), 20
POINTS = 2001  # of a scan
INSIDE, OUTSIDE = 1e-9, 1e-6  # of a travel: nothing is exceeded before, its limit behind
EXACT = 1e-9
POSITIVE = np.concatenate([np.eye(6), -np.eye(6)])


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
    return (pose.position + pose.rotation @ pivot + travels[:, None] * direction[:3]
            - turns @ pivot), turns


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
    way = random.normal(size=6) * np.repeat([machine.crank.mean(), 1.0], 3)
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


@pytest.mark.parametrize('first', MACHINES[::10])
def test_travels_agree_with_a_dense_scan(first: int) -> None:
    ends: set[str] = set()
    for seed in range(first, first + 10):
        wrong, limits = wrong_travels(seed)
        assert not wrong
        ends |= set(limits)
    assert {'angle_max', 'angle_min', 'lever_min'} <= ends
