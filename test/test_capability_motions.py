# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Motions that grow or are played faster, at their samples and between them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from referees import rng, ROOT
from scipy.spatial.transform import Rotation
from snapshot import Snapshot
from stewart_dynamics import (
    BaseMotion, Capability, check_planned_trajectory, Motion, MotionError, Pose, StewartPlatform)
from stewart_dynamics.arrays import Array
from stewart_dynamics.capability import motions
from stewart_dynamics.capability.motions import Deviations, faster
from stewart_dynamics.planned.interpolation import Interpolation
from test_capability_boxes import PLATFORM

CRANKS = ROOT / 'config' / 'crank_platform.yaml'
HOME = Motion.from_pose(PLATFORM.home_pose())
TIMES: Array = np.linspace(0.0, 4.0, 201, dtype=np.float64)


def turned(seed: int, size: float = 0.1) -> tuple[Array, Array, Array, Array]:
    """Return a motion's amplitudes and phases of position and rotation vector at two rates."""
    random = rng(seed)
    first, third = size * random.uniform(-1.0, 1.0, (2, 6)) / [[1.0], [3.0]]
    return first, third, random.uniform(0.0, 6.0, 6), random.uniform(0.0, 6.0, 6)


def motion(seed: int, times: Array = TIMES, size: float = 0.1, factor: float = 1.0) -> Motion:
    """Return harmonic deviations from home that are larger by a factor."""
    first, third, phase, its = turned(seed, size)

    def coordinates(at: Array) -> Array:
        found: Array = factor * (first * np.sin(2.0 * at[:, None] + phase)
                                 + third * np.sin(6.0 * at[:, None] + its))
        return found

    h = 1e-3
    offsets = np.array([-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0]) * h
    once = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / (60.0 * h)
    around = np.array([coordinates(times + offset) for offset in offsets])
    rotations = np.array([Rotation.from_rotvec(each[:, 3:]).as_matrix() for each in around])
    now = rotations[3] @ HOME.rotation
    position = HOME.position + around[3, :, :3]

    def omega(at: Array) -> Array:
        near = np.array([Rotation.from_rotvec(coordinates(at + offset)[:, 3:]).as_matrix()
                         for offset in offsets])
        spin = np.einsum('k,knij,nlj->nil', once, near, near[3])
        found: Array = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
        return found

    def velocity(at: Array) -> Array:
        found: Array = factor * (2.0 * first * np.cos(2.0 * at[:, None] + phase)
                                 + 6.0 * third * np.cos(6.0 * at[:, None] + its))[:, :3]
        return found

    def acceleration(at: Array) -> Array:
        found: Array = -factor * (4.0 * first * np.sin(2.0 * at[:, None] + phase)
                                  + 36.0 * third * np.sin(6.0 * at[:, None] + its))[:, :3]
        return found

    alpha = np.einsum('k,kni->ni', once, np.array([omega(times + offset) for offset in offsets]))
    return Motion(position, now, velocity(times), omega(times), acceleration(times), alpha)


def ratio(platform: StewartPlatform, moving: Motion, wrench: Any = None) -> float:
    """Return the largest part of a limit that samples take."""
    p, solved = platform.parameters, platform.inverse_dynamics(moving, wrench)
    return float(max((np.abs(solved.rates) / p['limits.velocity_max']).max(),
                     (np.abs(solved.forces) / p['limits.force_max']).max(),
                     (solved.lengths / p['limits.length_max']).max(),
                     (p['limits.length_min'] / solved.lengths).max()))


@pytest.mark.parametrize('factor', [0.3, 2.0])
def test_deviations_grow_with_their_rates_and_accelerations(factor: float) -> None:
    given, wanted = motion(0), motion(0, factor=factor)
    np.testing.assert_allclose(Deviations(HOME, given.rows).at(factor), wanted.rows, atol=1e-7)
    np.testing.assert_allclose(Deviations(HOME, given.rows).at(1.0), given.rows, atol=1e-13)


@pytest.mark.parametrize('seed', range(8))
def test_a_motion_as_large_as_it_can_be_reaches_its_limit(seed: int) -> None:
    platform = PLATFORM if seed % 2 else StewartPlatform(PLATFORM.parameters.replaced({
        'limits.force_max': 2000.0 if seed % 4 else 900.0, 'limits.velocity_max': 0.4}))
    given, wrench = motion(seed, size=0.05), [0.0, 100.0, -300.0, 0.0, 20.0, 0.0]
    found = Capability(platform).amplitude_factor(given, HOME, wrench)
    grown = Deviations(HOME, given.rows)

    def at(factor: float) -> float:
        return ratio(platform, Motion.of_rows(grown.at(factor)), wrench)

    assert at(found.value) == pytest.approx(1.0, abs=1e-9)
    assert at(found.value * (1.0 + 1e-6)) > 1.0
    assert max(at(k) for k in np.linspace(0.0, found.value, 300)) <= 1.0 + 1e-9
    assert found.limit in ('length_min', 'length_max', 'velocity_max', 'force_max')


def motion_of_cranks(seed: int, times: Array, home: Pose) -> Motion:
    """Return harmonic displacements from home."""
    random = rng(seed)
    first, third = random.uniform(-1.0, 1.0, (2, 6)) * 0.03
    phase = random.uniform(0.0, 6.0, (2, 6))
    angles = [3.0 * times[:, None] + phase[0], 9.0 * times[:, None] + phase[1]]
    x = first * np.sin(angles[0]) + third / 3.0 * np.sin(angles[1])
    dx = 3.0 * (first * np.cos(angles[0]) + third * np.cos(angles[1]))
    ddx = -9.0 * (first * np.sin(angles[0]) + 3.0 * third * np.sin(angles[1]))
    return Motion(home.position + x[:, :3], home.rotation, dx[:, :3], np.zeros(3), ddx[:, :3],
                  np.zeros(3))


@pytest.mark.parametrize('ask', ['speed', 'amplitude', 'payload'])
@pytest.mark.parametrize(('kind', 'seed'), [('telescopic', 3), *(('crank', n) for n in range(3))])
def test_with_times_the_motion_between_the_samples_counts(kind: str, seed: int, ask: str) -> None:
    """Few samples find the limit that many find, and a planned trajectory keeps it."""
    if kind == 'crank':
        platform, times = StewartPlatform.from_yaml(CRANKS), np.linspace(0.0, 2.0, 9)
        center = platform.home_pose()
        given = motion_of_cranks(seed, times, center)
    else:
        platform = StewartPlatform(PLATFORM.parameters.replaced({'limits.velocity_max': 0.3}))
        times = TIMES[::20]
        given = motion(seed, times)
        center = given.pose[0]
    capability = Capability(platform)

    def found(of: Motion, times: Array | None) -> Any:
        if ask == 'speed':
            return capability.speed_factor(of, times=times)
        if ask == 'amplitude':
            return capability.amplitude_factor(of, center, times=times)
        return capability.payload(of, [0.1, 0.2, 0.3], times=times)

    between, samples = found(given, times), found(given, None)
    assert 0.0 < between.value <= samples.value
    assert kind == 'crank' or between.value < samples.value
    assert times[between.sample] <= between.time <= times[between.sample + 1]
    whole, count = Interpolation(np.diff(times), given.rows), len(times) - 1
    where = np.append(np.arange(0.0, count, 1.0 / 512.0), count)
    which = np.minimum(where.astype(np.int64), count - 1)
    dense = found(Motion.of_rows(whole.at(which, where - which)), None)
    assert between.value == pytest.approx(dense.value, rel=2e-4)
    if ask == 'payload':
        return
    for factor in (1.0 - 2e-3, 1.0 + 2e-3):
        k = factor * between.value
        rows, at = given.rows, times
        if ask == 'speed':
            rows, at = faster(rows, k), times / k
        else:
            rows = Deviations(Motion.from_pose(center), rows).at(k)
        accepted = check_planned_trajectory(platform, at, Motion.of_rows(rows)).accepted
        assert accepted == (factor < 1.0)


def test_a_motion_at_rest_is_one_with_times_as_well() -> None:
    capability, rest = Capability(PLATFORM), motion(0, TIMES[:3], size=0.0)
    for ask in (capability.speed_factor, capability.amplitude_factor):
        assert ask(rest, times=TIMES[:3]) == ask(rest)
    found = capability.payload(rest, [0.1, 0.2, 0.3], times=TIMES[:3])
    assert found.value == pytest.approx(capability.payload(rest, [0.1, 0.2, 0.3]).value, 1e-12)


@pytest.mark.parametrize('load', ['wrench', 'base'])
def test_a_load_counts_between_the_samples(load: str) -> None:
    """Forces reach their limit by the load alone, and only between samples."""
    platform = StewartPlatform(PLATFORM.parameters.replaced({
        'limits.velocity_max': None, 'limits.force_max': 3000.0,
        'actuator.coulomb_friction': 0.0}))
    capability, few = Capability(platform), TIMES[::20]
    given = motion(3, few)
    more: dict[str, Any] = {'base': BaseMotion([0.0, 0.0, -60.0])}
    if load == 'wrench':
        more = {'wrench': [0.0, 0.0, -9000.0, 0.0, 0.0, 0.0]}
    whole = motions.Interpolation(np.diff(few), given.rows)
    where = np.arange(0.0, len(few) - 1.0, 1.0 / 64.0)
    which = where.astype(np.int64)
    dense = Motion.of_rows(whole.at(which, where - which))
    for ask in (capability.speed_factor, capability.amplitude_factor):
        found = ask(given, times=few, **more)
        assert found.value == pytest.approx(ask(dense, **more).value, rel=1e-4)
        assert found.value <= ask(given, **more).value * (1.0 + 1e-12)


def test_a_motion_through_a_singularity_is_possible_at_no_speed() -> None:
    """Turned past det(J) = 0 about z: near it, beyond it, and between two samples."""
    platform = StewartPlatform(PLATFORM.parameters.replaced({
        'limits.length_min': None, 'limits.length_max': None, 'limits.force_max': None}))
    capability = Capability(platform)
    end = capability.travel(HOME, [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]).value

    def turning(*angles: float) -> Motion:
        return Motion.from_pose(Pose(np.broadcast_to(HOME.position, (len(angles), 3)),
                                     Rotation.from_rotvec(np.outer(angles, [0.0, 0.0, 1.0])
                                                          ).as_matrix() @ HOME.rotation))

    beyond = 2.0 * end
    assert platform.inverse_dynamics(turning(beyond)).condition_number[0] < 100.0
    assert capability.speed_factor(turning(0.0, end - 1e-9)).value > 0.0
    for angles, sample in (((0.0, end + 1e-9), 1), ((0.0, 0.5, beyond), 2)):
        found = capability.speed_factor(turning(*angles))
        assert (found.value, found.limit, found.leg, found.sample) == (
            0.0, 'singularity', -1, sample)
    there = turning(end - 0.01, end - 0.01)
    overshooting = Motion(there.position, there.rotation, np.zeros(3), [
        [0.0, 0.0, 0.1], [0.0, 0.0, -0.1]])
    assert capability.speed_factor(overshooting).value > 0.0
    found = capability.speed_factor(overshooting, times=[0.0, 1.0])
    assert (found.value, found.limit) == (0.0, 'singularity')


def test_a_motion_that_starts_outside_cannot_grow() -> None:
    outside = Pose(HOME.position + [0.0, 0.0, 5.0], HOME.rotation)
    found = Capability(PLATFORM).amplitude_factor(motion(0), outside)
    assert (found.value, found.limit) == (0.0, 'length_max')


@pytest.mark.parametrize('more', [
    {'times': TIMES[:5]},
    {'times': -TIMES},
    {'times': TIMES, 'wrench': np.zeros((201, 6))},
    {'times': TIMES, 'base': BaseMotion(np.zeros((201, 3)))}])
def test_times_that_do_not_fit_are_rejected(more: Any, snapshot: Snapshot) -> None:
    for ask in (Capability(PLATFORM).speed_factor, Capability(PLATFORM).amplitude_factor):
        with snapshot.raises(MotionError):
            ask(motion(0), **more)


def test_a_long_motion_is_answered_block_by_block(monkeypatch: pytest.MonkeyPatch) -> None:
    platform, count = PLATFORM, 60
    home = platform.home_pose()
    times: Array = np.arange(count) * 0.02
    s, c = np.sin(3.0 * times)[:, None], np.cos(3.0 * times)[:, None]
    axis, none = np.array([0.05, 0.02, 0.03]), np.zeros((count, 3))
    motion = Motion(home.position + s * axis, np.tile(home.rotation, (count, 1, 1)),
                    3.0 * c * axis, none, -9.0 * s * axis, none)
    whole = Capability(platform).speed_factor(motion, times=times)
    # fewer than all of its intervals need together, more than one of them needs
    monkeypatch.setattr(motions, 'MOST_SAMPLES', 100)
    monkeypatch.setattr(motions, '_BLOCK', 37)
    assert Capability(platform).speed_factor(motion, times=times) == whole
