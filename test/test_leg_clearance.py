# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Clearance between the legs: its definition, and where a limit of it is checked."""

from __future__ import annotations

from itertools import combinations, product
from typing import Any

import numpy as np
import pytest
from referees import (
    Array, random_motion, random_parameters, rng, rotation_about, size_of, symmetric_parameters)
from scipy.optimize import lsq_linear, nnls

from snapshot import Snapshot
from stewart_dynamics import Capability, Motion, Parameters, Pose, StewartPlatform
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.kinematics.leg_clearance import BASE, LegClearance, PLATFORM
from stewart_dynamics.mechanics.limits import CLEARANCE_MIN
from stewart_dynamics.parameters.table import LEG_SHAPE, OUTLINES
from stewart_dynamics.planned.checks import LIMIT
from stewart_dynamics.planned.planned_trajectory import check_planned_trajectory
from stewart_dynamics.setpoints.step import Batch, Step
from test_capability import limited, moved, random_travel
from test_capability_boxes import poses_in, some_ranges
from test_capability_workspace import inside
from test_step import each_alone

SHAPE = dict(zip(LEG_SHAPE, (0.04, 0.7, 0.02), strict=True))
SYMMETRIC = symmetric_parameters().replaced({'geometry.zero_length': 1.1, **SHAPE})


def expected(p: Parameters, pose: Pose | Motion) -> Array:
    """Return the clearances (6,): each pair of capsules by bounded least squares."""
    legs = (pose.position + p['geometry.platform_joints'] @ pose.rotation.T
            - p['geometry.base_joints'])
    lengths = np.linalg.norm(legs, axis=1)
    directions = legs / np.where(lengths > 0.0, lengths, 1.0)[:, None]
    found = np.full(6, np.inf)
    for i, j in combinations(range(6), 2):
        gap = p['geometry.base_joints'][j] - p['geometry.base_joints'][i]
        matrix = np.column_stack([directions[i], -directions[j]])
        ends = [[(min(p['legs.cylinder.length'][n], lengths[n]), p['legs.cylinder.radius'][n]),
                 (lengths[n], p['legs.piston.radius'][n])] for n in (i, j)]
        for (u, thick), (v, other) in product(*ends):
            # bounds of a width of zero are not accepted
            nearest = lsq_linear(matrix, gap, (0.0, np.maximum([u, v], 1e-15)), 'bvls', tol=1e-15)
            clearance = np.linalg.norm(matrix @ nearest.x - gap) - thick - other
            found[[i, j]] = np.minimum(found[[i, j]], clearance)
    return found


def upright(tilt: float, **changes: Any) -> tuple[Parameters, Pose]:
    """Return a hexapod whose legs are parallel but for a small tilt of its platform."""
    p = symmetric_parameters()
    p = p.replaced({**SHAPE, 'geometry.platform_joints': p['geometry.base_joints'], **changes})
    return p, Pose([0.0, 0.0, 1.0], rotation_about(np.array([2.0, 3.0, 6.0]) / 7.0, tilt))


def cases() -> list[Any]:
    found: list[Any] = []
    for seed in range(8):
        random = rng(seed)
        p = random_parameters(random).replaced({
            'legs.cylinder.radius': random.uniform(0.03, 0.06, 6),
            'legs.cylinder.length': random.uniform(0.0, 1.5, 6),
            'legs.piston.radius': random.uniform(0.0, 0.03, 6)})
        motion = random_motion(p, random, 3)
        found += [pytest.param(p, Pose(motion.position[n], motion.rotation[n]),
                               id=f'random {seed} {n}') for n in range(3)]
    for tilt in (0.0, 1e-16, 1e-14, 1e-12, 1e-10, 1e-8, 1e-4, 0.3):
        found.append(pytest.param(*upright(tilt), id=f'parallel but for {tilt:g}'))
    found.append(pytest.param(*upright(0.0, **{'legs.cylinder.length': 0.0}), id='no cylinder'))
    p, pose = upright(0.0)
    return [*found, pytest.param(p, Pose(np.zeros(3), pose.rotation), id='legs of no length')]


@pytest.mark.parametrize(('p', 'pose'), cases())
def test_clearance_is_the_least_distance_of_the_capsules(p: Parameters, pose: Pose) -> None:
    np.testing.assert_allclose(
        LegClearance(p)(Motion.from_pose(pose).rows[None])[0], expected(p, pose), rtol=0.0,
        atol=1e-12)


def test_legs_that_cross_overlap_by_both_radii() -> None:
    p, pose = upright(0.0)
    b = p['geometry.base_joints'].copy()
    b[[0, 1]] = b[[1, 0]]  # legs 1 and 2 cross in the middle, above their cylinders
    p = p.replaced({'geometry.platform_joints': b, 'legs.cylinder.length': 0.1})
    assert LegClearance(p)(Motion.from_pose(pose).rows[None])[0, :2] == pytest.approx(
        [-0.04, -0.04], abs=1e-15)


@pytest.mark.parametrize('changes', [
    {CLEARANCE_MIN: 0.01}, {**SHAPE, CLEARANCE_MIN: -1.0}, {**SHAPE, 'legs.piston.radius': 0.05}])
def test_parameters_that_do_not_fit_are_rejected(
        changes: dict[str, Any], snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        symmetric_parameters().replaced(changes)
    with snapshot.raises(ParameterError):
        LegClearance(symmetric_parameters())


# Plates

def outline(random: np.random.Generator, center: Array, radius: float) -> list[float]:
    """Return the corners of a random convex plate, in order."""
    corners = random.integers(3, 9)
    angles = np.sort(random.uniform(0.0, 2.0 * np.pi, corners))
    while np.diff(np.append(angles, angles[0] + 2.0 * np.pi)).max() > np.pi:
        angles = np.sort(random.uniform(0.0, 2.0 * np.pi, corners))
    x, y = np.linalg.qr(random.normal(size=(3, 3)))[0][:2]
    return (center + radius * (np.outer(np.cos(angles), x) + np.outer(np.sin(angles), y))
            ).ravel().tolist()


def hull_distance(p: Array, q: Array) -> float:
    """Return the distance of the convex hulls of points (M, 3), by least squares of weights."""
    sums = 1e5 * np.array([[*np.ones(len(p)), *np.zeros(len(q))],
                           [*np.zeros(len(p)), *np.ones(len(q))]])
    weights, _ = nnls(np.concatenate([np.concatenate([p, -q]).T, sums]),
                      np.array([0.0, 0.0, 0.0, 1e5, 1e5]))
    return float(np.linalg.norm(weights @ np.concatenate([p, -q])))


@pytest.mark.parametrize('seed', range(8))
def test_clearance_from_a_plate_is_the_least_distance_of_the_hulls(seed: int) -> None:
    random = rng(seed)
    p = random_parameters(random)
    motion, size = random_motion(p, random, 5), size_of(p)
    p = p.replaced({
        'legs.cylinder.radius': 0.001 * size, 'legs.piston.radius': 0.0,
        'legs.cylinder.length': random.uniform(0.2, 1.0, 6) * size,
        **{name: outline(random, random.normal(size=3) * size, random.uniform(0.2, 2.0) * size)
           for name in OUTLINES}})
    without = LegClearance(p.replaced(dict.fromkeys(OUTLINES)))(motion.rows)
    found, nearest = LegClearance(p).nearest(motion.rows)
    for n, leg in product(range(5), range(6)):
        position, rotation = motion.position[n], motion.rotation[n]
        b = p['geometry.base_joints'][leg]
        end = position + rotation @ p['geometry.platform_joints'][leg]
        s = (end - b) / np.linalg.norm(end - b)
        cylinder = b + min(p['legs.cylinder.length'][leg], np.linalg.norm(end - b)) * s
        out = b + p['legs.cylinder.length'][leg] * s
        values = [without[n, leg], hull_distance(np.array([out, end]), p[OUTLINES[0]]),
                  hull_distance(np.array([b, cylinder]), position + p[OUTLINES[1]] @ rotation.T)
                  - 0.001 * size]
        assert found[n, leg] == pytest.approx(min(values), abs=1e-9 * size)
        assert nearest[n, leg] >= 6 or values[0] <= min(values[1:]) + 1e-9 * size
        if nearest[n, leg] >= 6:
            assert nearest[n, leg] == (BASE, PLATFORM)[int(values[2] < values[1])]


def test_a_leg_that_pierces_a_plate_overlaps_by_its_radius() -> None:
    p, pose = upright(0.0)
    plate = np.array([[5.0, 5.0, 0.0], [-5.0, 5.0, 0.0], [-5.0, -5.0, 0.0], [5.0, -5.0, 0.0]])
    for name, height, radius in ((OUTLINES[0], 0.85, 0.02), (OUTLINES[1], -0.65, 0.04)):
        found, nearest = LegClearance(p.replaced({name: (plate + [0.0, 0.0, height]).ravel()})
                                      ).nearest(Motion.from_pose(pose).rows[None])
        assert found == pytest.approx(np.full((1, 6), -radius), abs=1e-15)
        assert (nearest == (BASE if name == OUTLINES[0] else PLATFORM)).all()


@pytest.mark.parametrize('corners', [
    [0.0] * 6, [0.0] * 4, [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0],
    [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.01, 0.0, 1.0, 0.0],
    [0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
    [0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 2.0, 0.0],
    [round(float(f(4.0 * np.pi * n / 5.0)), 3)
     for n in range(5) for f in (np.cos, np.sin, lambda _: 0.0)]])
def test_a_plate_that_is_none_is_rejected(corners: list[float], snapshot: Snapshot) -> None:
    for name in OUTLINES:
        with snapshot.raises(ParameterError):
            symmetric_parameters().replaced({name: corners})


def test_a_message_names_what_a_leg_is_near_to() -> None:
    home = StewartPlatform(SYMMETRIC).home_pose()
    square = [1.0, 1.0, -0.3, -1.0, 1.0, -0.3, -1.0, -1.0, -0.3, 1.0, -1.0, -0.3]
    row = Motion.from_pose(home).rows
    for changes, other in (({}, 'leg_2'), ({OUTLINES[1]: square}, OUTLINES[1])):
        p = SYMMETRIC.replaced({CLEARANCE_MIN: 1.0, **changes})
        step, setpoint = Step(p), Batch.from_parts(0, row)
        found = step.exceedances(step(setpoint))
        assert f'leg_1: clearance to {other}, ' in found[0].words(p['joints'])
        result = check_planned_trajectory(
            StewartPlatform(p), [0.0, 1.0], Motion.of_rows(np.stack([row, row])))
        assert f'leg_1: clearance to {other}, ' in result.message


# Where it is checked

# The cylinders of legs 1 and 2 approach each other as the platform comes down.
LOWERING = SYMMETRIC.replaced({
    'legs.cylinder.radius': [0.15, 0.15, 0.01, 0.01, 0.01, 0.01], 'legs.cylinder.length': 0.9,
    'legs.piston.radius': 0.005})
HOME = StewartPlatform(LOWERING).home_pose()


def lowered(depths: Array, rates: Any = 0.0, accelerations: Any = 0.0) -> Motion:
    """Return a motion downward from home."""
    position, velocity, acceleration = (
        np.outer(np.broadcast_to(each, len(depths)), [0.0, 0.0, -1.0])
        for each in (depths, rates, accelerations))
    return Motion(HOME.position + position, np.broadcast_to(HOME.rotation, (len(depths), 3, 3)),
                  velocity, np.zeros(3), acceleration, np.zeros(3))


def least(motion: Motion) -> float:
    return float(LegClearance(LOWERING)(motion.rows).min())


def test_the_step_reports_a_clearance_below_its_limit_for_one_and_for_many() -> None:
    motion = lowered(np.linspace(0.0, 0.2, 51))
    clearances = LegClearance(LOWERING)(motion.rows)
    bound = 0.1
    setpoints = Batch.from_parts(np.arange(51), motion.rows)
    step = Step(LOWERING.replaced({CLEARANCE_MIN: bound}))
    many = step(setpoints)
    assert np.array_equal(many.clearances, clearances)
    assert np.array_equal(many.exceeding, (clearances < bound).any(axis=1))
    assert 5 < many.exceeding.sum() < 46
    for n, (output, found) in enumerate(each_alone(step, setpoints)):
        assert output.clearances.tobytes() == clearances[n].tobytes()
        assert [(each.limit, each.leg, each.value, each.bound) for each in found] == [
            (CLEARANCE_MIN, leg, clearances[n, leg], bound) for leg in range(6)
            if clearances[n, leg] < bound]
    without = Step(LOWERING)(setpoints)
    assert np.array_equal(without.efforts, many.efforts)
    assert without.clearances.shape == (51, 0)
    assert not without.exceeding.any()


@pytest.mark.parametrize('size', [1e-300, 1e-160, 1e160, 1e200, 1e300])
def test_the_rules_of_a_plate_do_not_depend_on_its_size(size: float) -> None:
    for corners, is_plate in (([0, 0, 0, 1, 0, 0, 1, 1, 0], True),
                              ([0, 0, 0, 1, 0, 0, 2, 0, 0], False),
                              ([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 1], False)):
        values = {'geometry.base_outline': [size * each for each in corners]}
        if is_plate:
            assert SYMMETRIC.replaced(values)['geometry.base_outline'].max() == size
        else:
            with pytest.raises(ParameterError):
                SYMMETRIC.replaced(values)


def test_a_corner_of_a_plate_between_two_points_of_a_trajectory_is_found() -> None:
    # Tilted to and fro between two points: the corners move farther than the joints.
    corners = [2.0, 0.2, 0.0, -2.0, 0.2, 0.0, -2.0, -0.2, 0.0, 2.0, -0.2, 0.0]
    p = SYMMETRIC.replaced({
        OUTLINES[1]: corners, 'limits.length_min': None, 'limits.length_max': None})
    rates = Motion(np.stack([HOME.position] * 2), np.stack([HOME.rotation] * 2), np.zeros((2, 3)),
                   np.array([[0.0, 1.6, 0.0], [0.0, -1.6, 0.0]]), np.zeros((2, 3)),
                   np.zeros((2, 3)))
    tilted = Motion.from_pose(Pose(HOME.position, rotation_about(np.array([0.0, 1.0, 0.0]), 0.5)))
    clearances = LegClearance(p)
    here, there = (float(clearances(each.rows.reshape(-1, each.rows.shape[-1])).min())
                   for each in (rates, tilted))
    assert there < here - 0.01
    for bound, accepted in ((there + 1e-3, False), (there - 1e-3, True)):
        result = check_planned_trajectory(
            StewartPlatform(p.replaced({CLEARANCE_MIN: bound})), [0.0, 1.0], rates)
        assert result.accepted is accepted, result.message


@pytest.mark.parametrize('points', [4, 12])
def test_the_least_clearance_between_the_points_of_a_trajectory_is_found(points: int) -> None:
    def at(times: Array) -> Motion:
        # the lowest pose, at 0.5 s, is between two points
        w = 2.0 * np.pi
        return lowered(0.07 * (1.0 - np.cos(w * times)), 0.07 * w * np.sin(w * times),
                       0.07 * w * w * np.cos(w * times))

    times = np.linspace(0.0, 1.0, points)
    lowest = least(at(np.array([0.5])))
    # The motion between few points is not quite the given one.
    slack = {4: 5e-3, 12: 2e-4}[points]
    assert least(at(times)) > lowest + 2.0 * slack
    for bound, accepted in ((lowest + slack, False), (lowest - slack, True)):
        result = check_planned_trajectory(
            StewartPlatform(LOWERING.replaced({CLEARANCE_MIN: bound})), times, at(times))
        assert result.accepted is accepted, result.message
        if not accepted:
            assert (result.reason, result.limit) == (LIMIT, CLEARANCE_MIN)
            assert 'below limits.leg_clearance_min' in result.message
            assert result.time == pytest.approx(0.5, abs=0.1)


def test_a_small_loss_of_clearance_between_close_points_is_found() -> None:
    # Down by 2.5 mm and up again: too little for samples between the two points.
    motion = lowered(np.array([0.14, 0.14]), [0.1, -0.1], [-2.0, -2.0])
    here, there = least(motion), least(lowered(np.array([0.1425])))
    assert there < here - 2e-3
    for bound, accepted in ((there + 1e-4, False), (there - 1e-5, True)):
        result = check_planned_trajectory(
            StewartPlatform(LOWERING.replaced({CLEARANCE_MIN: bound})), [0.0, 0.1], motion)
        assert result.accepted is accepted, result.message


def near(seed: int) -> tuple[StewartPlatform, Pose, np.random.Generator]:
    """Return a random hexapod that a clearance limits, often to one that keeps its value."""
    random = rng(seed)
    platform, pose = limited(random, **{'limits.length_min': None})
    shaped = platform.parameters.replaced({
        'legs.cylinder.radius': random.uniform(0.01, 0.03, 6),
        'legs.cylinder.length': random.uniform(0.2, 1.0, 6),
        'legs.piston.radius': random.uniform(0.0, 0.01, 6),
        'limits.length_max': 5.0 * size_of(platform.parameters)})
    if seed % 3 == 0:
        size = size_of(shaped)
        center = pose.rotation.T @ (shaped['geometry.base_joints'].mean(axis=0) - pose.position)
        shaped = shaped.replaced({
            OUTLINES[0]: outline(random, shaped['geometry.base_joints'].mean(axis=0),
                                 random.uniform(0.1, 1.0) * size),
            OUTLINES[1]: outline(random, random.uniform(0.0, 0.3) * center,
                                 random.uniform(0.1, 1.0) * size)})
    here = Capability(StewartPlatform(shaped)).clearance(pose)
    part = random.choice([0.0, 0.5, 0.9, 0.999, 1.0])
    return StewartPlatform(shaped.replaced({CLEARANCE_MIN: max(part * here, 0.0)})), pose, random


def test_a_travel_ends_where_two_legs_are_too_near() -> None:
    ended = [0] * 8
    for seed in range(60):
        platform, pose, random = near(seed)
        p = platform.parameters
        size, bound, clearances = size_of(p), p[CLEARANCE_MIN], LegClearance(p)
        direction, pivot = random_travel(random, size)
        found = Capability(platform).travel(pose, direction, pivot)

        if found.limit == CLEARANCE_MIN.removeprefix('limits.') and found.value == 0.0:
            assert clearances(Motion.from_pose(pose).rows[None]).min() - bound < 1e-12 * size
            continue
        by = np.append(np.linspace(0.0, found.value, 2001), found.value + 1e-7 * size)
        poses = Motion.from_pose(moved(pose, direction, pivot, by)).rows
        margins, nearest = clearances.nearest(poses)
        margins -= bound
        assert margins[:-1].min() >= -1e-12 * size
        if found.limit == CLEARANCE_MIN.removeprefix('limits.'):
            assert abs(margins[-2, found.leg]) < 1e-12 * size
            assert margins[-1].min() < 0.0
            ended[nearest[-2, found.leg]] += 1
    assert sum(ended[:6]) > 20
    assert min(ended[6:]) > 1


def test_legs_that_become_parallel_far_away_do_not_end_a_travel() -> None:
    free = SYMMETRIC.replaced({
        CLEARANCE_MIN: 0.02, 'limits.length_max': None, 'limits.length_min': None,
        'limits.base_joint_angle_max': None, 'limits.platform_joint_angle_max': None,
        'singularity.stop_condition': 1e8})
    near = StewartPlatform(free.replaced({'singularity.stop_condition': 1e4}))
    for direction in ([0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [1.0, 0.3, 1.0, 0.0, 0.0, 0.0]):
        found = Capability(StewartPlatform(free)).travel(HOME, direction)
        assert found.limit == 'singularity'  # the condition number is proportional to the way
        assert found.value == pytest.approx(
            1e4 * Capability(near).travel(HOME, direction).value, rel=1e-3)


@pytest.mark.slow
def test_no_pose_of_a_box_that_is_reachable_has_legs_too_near() -> None:
    limiting = 0
    for seed in (4, 5, 10, 24, 27):  # the last two with plates; others take up to 20 s each
        platform, pose, random = near(seed)
        p, capability = platform.parameters, Capability(platform)
        box = some_ranges(random)
        found = capability.reachable_factor(box, pose)
        limiting += found.limit == 'leg_clearance_min' and found.value > 0.0
        for factor in (1.0, 2.0):
            scaled = factor * found.value * box
            if found.value > 0.0 and capability.reachable(scaled, pose).certain:
                poses = poses_in(scaled, pose, np.zeros(3), random)
                nearest = LegClearance(p)(Motion.from_pose(poses).rows).min()
                assert nearest >= p[CLEARANCE_MIN] * (1.0 - 1e-9)
        if found.limit == 'leg_clearance_min' and found.value > 1e-6:
            larger = capability.reachable(1.05 * found.value * box, pose)
            assert larger.worst.excess > 0.0, 'a larger box is not reachable'
    assert limiting > 2


@pytest.mark.parametrize('normal', ['z', 'y'])
def test_a_section_ends_where_two_legs_are_too_near(normal: str) -> None:
    parts = 0
    for seed in range(4):
        platform, pose, random = near(seed)
        # without the thin parts between singularities, which the grid misses
        platform = StewartPlatform(platform.parameters.replaced({
            'limits.length_max': 1.3 * platform.inverse_kinematics(pose)}))
        p, n = platform.parameters, 'xyz'.index(normal)
        size = size_of(p)
        found = Capability(platform).section(pose, normal)
        points = pose.position + random.uniform(-1.0, 1.0, (2000, 3)) * size
        points[:, n] = pose.position[n]
        poses = Motion.from_pose(Pose(points, pose.rotation))
        solved = platform.inverse_dynamics(poses, singular='nan')
        side = platform.inverse_dynamics(Motion.from_pose(pose)).determinant
        good = ((LegClearance(p)(poses.rows) >= p[CLEARANCE_MIN]).all(axis=1)
                & (solved.lengths <= p['limits.length_max']).all(axis=1)
                & (solved.determinant * side > 0.0))
        enclosed, distance = inside(found.loops, points, *(k for k in range(3) if k != n))
        # a corner where two boundaries of the grid meet is cut off
        clear = distance > 2.0 * np.ptp(np.concatenate(found.loops), axis=0).max() / 128.0
        np.testing.assert_array_equal(enclosed[clear], good[clear])
        for part in found.boundary:
            if part.limit == 'leg_clearance_min':
                parts += 1
                on = LegClearance(p)(Motion.from_pose(Pose(part.points, pose.rotation)).rows)
                np.testing.assert_allclose(on.min(axis=1), p[CLEARANCE_MIN], atol=1e-8 * size)
                assert np.abs(on[:, part.leg] - p[CLEARANCE_MIN]).min() < 1e-8 * size
    assert parts
