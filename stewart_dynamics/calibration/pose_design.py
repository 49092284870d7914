# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Poses that identify the geometry best, within the limits of the hexapod.

From random poses within the limits, the N with the largest determinant of information are chosen
(D-optimal), leg by leg: the exchange of one chosen pose for another that increases it most is
repeated (V. V. Fedorov, Theory of Optimal Experiments, Academic Press, 1972). Random poses are
taken instead where their predicted intervals are smaller. Equal seeds give equal poses.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import io
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.calibration.calibrate import check_number
from stewart_dynamics.calibration.equations import (
    Equations, GEOMETRY, held_by_groups, values_of)
from stewart_dynamics.calibration.geometry_fit import Unknowns
from stewart_dynamics.calibration.noise import covariances, Noise, whitening
from stewart_dynamics.errors import MotionError, ParameterError, StewartError
from stewart_dynamics.estimation.confidence_level import TWO_SIDED
from stewart_dynamics.legs.calibrated import ALL_GROUPS, CalibratedLegs
from stewart_dynamics.mechanics.frames.motion import Motion, motion_rows, Pose
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.mechanics.least_squares import LARGEST_ERROR
from stewart_dynamics.mechanics.pose_limits import PoseLimits
from stewart_dynamics.mechanics.rows import CONDITION, DETERMINANT
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.planned.approach import approach, TimedMotion
from stewart_dynamics.tables.column_names import POSITION, QUATERNION

NOISE = Noise(1e-5, 1e-5, 1e-5)  # noise for the predicted intervals, by default [m, m, rad]
# Poses to choose from, poses tried for each of them, and random sets for comparison.
_CANDIDATES, _TRIES, _RANDOM = 1500, 40, 100
# Part of the stroke that stays free at both ends; largest angle of a pose [rad].
_MARGIN, _LARGEST_ANGLE = 0.02, 0.6
# An exchange that increases the logarithm of the determinant by less ends the search.
_LEAST_GAIN, _MOST_EXCHANGES = 1e-3, 500


class PoseDesign(NamedTuple):
    """Designed poses in the order of their visit."""

    poses: Pose  # (N,)
    positions: Array  # (N, 6) of the drives, to be commanded [m] or [rad]
    half_widths: Array  # (n,) predicted 95 % intervals of the numbers of the geometry
    random_half_widths: Array  # (n,) the same, median of as many random poses within the limits
    legs: CalibratedLegs


def design_poses(platform: StewartPlatform, count: int, noise: Noise = NOISE, seed: int = 0,
                 groups: Sequence[str] = (ALL_GROUPS,)) -> PoseDesign:
    """
    Return poses from which the geometry is identifiable, and its predicted intervals.

    groups: of the unknowns, as ``calibrate`` takes them.

    Raises ParameterError: a limit of the drives is missing, or home is not within the limits.
    Raises StewartError: too few poses are asked for, or within the limits.
    """
    p = platform.parameters
    legs = p.leg_kind.calibrated_legs(p)
    held = held_by_groups(legs, groups)
    check_number(count, legs, held)
    random = np.random.default_rng(seed)
    candidates = _within_limits(platform, random, max(_CANDIDATES, 3 * count))
    if len(candidates) < 3 * count:
        raise StewartError(f'{len(candidates)} of {_TRIES * _CANDIDATES} random poses are within '
                           f'the limits: too few to choose {count}')
    size = p.singularity.characteristic_length
    values = values_of(legs)
    unknowns = Unknowns.of(legs, values, size, held, False)
    positions = legs.measured_positions(platform.inverse_kinematics(candidates))
    lin = Equations(legs, positions, candidates).at(values)
    whiten = whitening(covariances(noise, size, lin))

    def half_widths(which: Integers) -> Array:
        part = lin._replace(derivatives=lin.derivatives[which])
        what = unknowns.identifiability(part, whiten[which], LARGEST_ERROR)
        variances = np.sum((what.directions / np.maximum(what.singular_values, 1.0)) ** 2, axis=1)
        return np.asarray(TWO_SIDED * what.scales * np.sqrt(variances))[GEOMETRY]

    deviations = np.sqrt(np.einsum('nll->nl', covariances(noise, size, lin)))
    of_leg = [[n for n in legs.columns(leg) if not held[n]] for leg in range(6)]
    rows = np.stack([lin.derivatives[:, n, columns] / deviations[:, n, None]
                     * unknowns.scales[columns] for n, columns in enumerate(of_leg)])
    chosen = _exchange(rows, random.choice(len(candidates), count, replace=False))
    drawn = [random.choice(len(candidates), count, replace=False) for _ in range(_RANDOM)]
    others = [half_widths(each) for each in drawn]
    # The exchange knows no correlation of the legs, by the noise of the poses that they share.
    # Where it counts most, as for zeros alone, random poses may be better.
    predicted = half_widths(chosen)
    chosen, predicted = min(
        zip([chosen, *drawn], [predicted, *others], strict=True),
        key=lambda each: float(np.log(each[1][~held]).sum()))
    found = candidates[_in_order(candidates[chosen], platform.home_pose(), size, chosen)]
    return PoseDesign(found, legs.measured_positions(platform.inverse_kinematics(found)),
                      predicted, np.median(others, axis=0), legs)


def _within_limits(platform: StewartPlatform, random: np.random.Generator, count: int) -> Pose:
    """Return random poses within all limits, on home's side of singularities."""
    p = platform.parameters
    names = p.leg_kind.position_limits
    low, high = (p[name] for name in names)
    if low is None or high is None:
        raise ParameterError(f'{names[0]} and {names[1]}: needed for a design')
    home, stroke = platform.home_pose(), high - low
    tries = _TRIES * count
    spread = float(np.max(stroke * p.leg_kind.reach(p)))
    angle = min(spread / p.singularity.characteristic_length, _LARGEST_ANGLE)
    poses = Pose(home.position + random.uniform(-0.5, 0.5, (tries, 3)) * spread,
                 from_euler(random.uniform(-angle, angle, (tries, 3))) @ home.rotation)
    positions = platform.solve(motion_rows(poses))[:, p.leg_kind.position.columns]
    sound = ((positions > low + _MARGIN * stroke) & (
        positions < high - _MARGIN * stroke)).all(axis=1)
    poses = poses[np.flatnonzero(sound)[:count]]
    known, motions = PoseLimits(p), motion_rows(poses)
    side, results = (platform.solve(rows) for rows in (motion_rows(home), motions))
    exceeded = known.exceeded(known.values(motions, results), len(poses))
    return poses[known.regular(results, side[0, DETERMINANT]) & (
        results[:, CONDITION] < p.singularity.warn_condition)
        & ~exceeded & ~known.overloaded(motions, results)]


def _exchange(rows: Array, chosen: Integers) -> Integers:
    """Return the indices of poses with a large determinant of their information (6, M, 7)."""
    chosen = chosen.copy()
    least = 1e-9 * np.eye(rows.shape[2]) * float(np.mean(rows ** 2))
    for _ in range(_MOST_EXCHANGES):
        own = rows[:, chosen]
        inverse = np.linalg.inv(own.swapaxes(1, 2) @ own + least)
        across = own @ inverse @ rows.swapaxes(1, 2)  # (6, N, M)
        new = np.sum((rows @ inverse) * rows, axis=2)
        old = np.sum((own @ inverse) * own, axis=2)
        ratios = (1.0 + new[:, None]) * (1.0 - old[..., None]) + across ** 2
        gains = np.log(np.maximum(ratios, 1e-300)).sum(axis=0)
        gains[:, chosen] = -np.inf
        out, into = np.unravel_index(int(np.argmax(gains)), gains.shape)
        if gains[out, into] < _LEAST_GAIN:
            break
        chosen[out] = into
    return chosen


def _in_order(poses: Pose, home: Pose, size: float, chosen: Integers) -> list[int]:
    """Return the indices in an order of short ways, from home to the nearest one left."""
    left, order = list(range(len(chosen))), []
    position, rotation = home.position, home.rotation
    while left:
        ways = np.linalg.norm(poses.position[left] - position, axis=1) + size * np.linalg.norm(
            poses.rotation[left] - rotation, axis=(1, 2))
        nearest = left.pop(int(np.argmin(ways)))
        position, rotation = poses.position[nearest], poses.rotation[nearest]
        order.append(int(chosen[nearest]))
    return order


def visit(platform: StewartPlatform, poses: Pose, rest: float,
          progress: Callable[[int], object] = lambda done: None) -> TimedMotion:
    """
    Return a planned trajectory from home through all poses, at rest for a time [s] in each.

    Each part is within all limits; a pose that cannot be reached directly is reached over home.
    """
    home = platform.home_pose()
    times: list[Array] = [np.zeros(1)]
    rows: list[Array] = [Motion(home.position, home.rotation).rows[None]]
    end, here = 0.0, home

    def append(way: TimedMotion) -> None:
        nonlocal end
        times.append(end + way.times[1:])
        rows.append(way.motion.rows[1:])
        end = float(times[-1][-1])

    for n in range(len(poses)):
        try:
            append(approach(platform, here, poses[n]))
        except MotionError:
            append(approach(platform, here, home))
            append(approach(platform, home, poses[n]))
        here = poses[n]
        times.append(np.array([end + rest]))
        rows.append(Motion(here.position, here.rotation).rows[None])
        end += rest
        progress(n + 1)
    return TimedMotion(np.concatenate(times), Motion.of_rows(np.concatenate(rows)))


def trajectory_csv(motion: TimedMotion) -> str:
    """Return a planned trajectory as text: time, pose, twist and acceleration of each point."""
    text = io.StringIO()
    names = ['time', *POSITION.columns, *QUATERNION.columns, *(f'{kind}{axis}' for kind in (
        'v', 'w', 'a', 'dw') for axis in 'xyz')]
    m = motion.motion
    np.savetxt(text, np.column_stack([
        motion.times, m.position, m.pose.quaternion, m.linear_velocity, m.angular_velocity,
        m.linear_acceleration, m.angular_acceleration]), '%.12g', ',',
        header=','.join(names), comments='')
    return text.getvalue()
