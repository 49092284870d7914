# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""A recorded motion in a datasheet: whether it is possible, how far, and its use of limits."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec.structs import replace
import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.capability.capability import Capability, Extent
from stewart_dynamics.capability.motor_bounds import MotorBounds
from stewart_dynamics.datasheet.datasheet_record import JudgedMotion, MotionBetween
from stewart_dynamics.datasheet.pose_ratings import rate_extent
from stewart_dynamics.datasheet.possible_motion import possible_changes
from stewart_dynamics.errors import MotionError, ParameterError
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.legs.lines import AnchorCircles
from stewart_dynamics.mechanics import limits
from stewart_dynamics.mechanics.frames.base_motion import BaseMotion
from stewart_dynamics.mechanics.kinematics.leg_clearance import clearance_to_check
from stewart_dynamics.mechanics.singularity_warning import stop_condition_of
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.replay.recorded_motion import RecordedMotion
from stewart_dynamics.reporting.block_statistics import finite

LENGTH, SPEED, TORQUE, ANGLE, CLEARANCE, SINGULARITY = (
    'length', 'motor speed', 'motor torque', 'joint angle', 'leg clearance', 'singularity')
# Largest number of samples of which the amplitude is computed, and the motion between them, which
# takes 0.6 ms for each.
_MOST, _MOST_BETWEEN = 100_000, 10_000


def uses(platform: StewartPlatform, recorded: RecordedMotion) -> dict[str, Array]:
    """
    Return the largest use of each kind of limit at each sample (N,): above 1 it is exceeded.

    The use of a length is 0 in the middle of its range and 1 at both ends.
    """
    p = platform.parameters
    result = platform.inverse_dynamics(
        recorded.motion, recorded.wrench, recorded.base, singular='nan')
    found: dict[str, Array] = {}
    low, high = p.limits.length_min, p.limits.length_max
    circles, kind = p.leg_kind.anchor_circles(p), p.leg_kind
    if circles is not None:
        found |= _of_circles(circles, kind, kind.lever_ratios(p, result.rows), result.rows)
    elif high is not None:
        shortest = np.zeros(6) if low is None else low
        found[LENGTH] = np.abs(2.0 * result.lengths - high - shortest) / (high - shortest)
    elif low is not None:
        found[LENGTH] = low / result.lengths
    known = limits.limits_of(p)
    for limit in (*known.rates, *known.loads):
        if p[limit] is not None:
            values = np.abs(result.rows[..., limits.LIMITS[limit].columns])
            found[limits.LIMITS[limit].quantity.name] = np.where(
                np.isfinite(values), values, np.inf) / p[limit]
    if p.drives:
        motors = MotorBounds(p)
        speeds, torques = motors.ratios(recorded.motion.rows, result.rows)
        if motors.limits_speeds:
            found[SPEED] = speeds
        if motors.limited:
            found[TORQUE] = np.where(np.isfinite(torques), torques, np.inf)
    of_joints = [name for name in limits.OF_JOINTS if p[name] is not None]
    if of_joints:
        angles = dict(zip(limits.OF_JOINTS, platform.joint_angles(recorded.motion), strict=True))
        found[ANGLE] = np.max([angles[name] / p[name] for name in of_joints], axis=0)
    clearances, least = clearance_to_check(p), p.limits.leg_clearance_min
    if clearances is not None and least is not None:
        distances = clearances(recorded.motion.rows)
        with np.errstate(divide='ignore'):
            found[CLEARANCE] = np.where(distances > 0.0, least / distances, np.inf)
    found = {name: each.max(axis=-1) for name, each in found.items()}
    condition = result.condition_number / stop_condition_of(p)
    crossed = np.diff(np.sign(result.determinant), prepend=np.sign(result.determinant[0])) != 0.0
    found[SINGULARITY] = np.where(crossed, np.inf, condition)
    return found


def _of_circles(circles: AnchorCircles, kind: LegKind, ratios: Array, rows: Array,
                ) -> dict[str, Array]:
    """Return the use of positions and levers (N, 6) of drives whose anchors move on circles."""
    found: dict[str, Array] = {}
    if np.isfinite(circles.halves).any():
        offsets = np.remainder(
            rows[..., kind.position.columns] - circles.middles + np.pi, 2.0 * np.pi) - np.pi
        used = np.abs(offsets) / circles.halves
        found[kind.position.name] = np.where(np.isfinite(used), used, np.inf)
    if circles.least.any():
        with np.errstate(divide='ignore'):
            found['lever'] = np.where(ratios > 0.0, circles.least / ratios, np.inf)
    return found


def is_possible(used: dict[str, Array]) -> bool:
    """Return whether a motion with this use of the limits is possible."""
    return bool(used[SINGULARITY].max() < 1.0 and all(
        each.max() <= 1.0 + limits.TOLERANCE for each in used.values()))


def judged(platform: StewartPlatform, recorded: RecordedMotion, used: dict[str, Array],
           bag: str = '') -> JudgedMotion:
    """Return whether a motion is possible, how much faster it could be, and its payload."""
    c, joints = Capability(platform), platform.parameters.joints
    possible, limited = is_possible(used), c.limits_rates or c.limits_forces
    worst = max(used, key=lambda name: float(used[name].max()))
    speed = MotionBetween(None, None, None, None)
    if not possible or limited:
        speed = _fastest(c.speed_factor(recorded.motion, recorded.wrench, recorded.base),
                         recorded, joints)
    amplitude = payload = None
    if len(recorded.seconds) <= _MOST and used[SINGULARITY].max() < 1.0:
        amplitude = rate_extent(*c.amplitude_factor(
            recorded.motion, None, recorded.wrench, recorded.base)[:3], joints=joints)
    if c.limits_forces and speed.factor != 0.0:
        payload = rate_extent(*c.payload(
            recorded.motion, np.zeros(3), wrench=recorded.wrench, base=recorded.base)[:3],
            joints=joints)
    return JudgedMotion(
        speed.limit, speed.leg, possible, speed.factor, bag=bag, at_s=speed.at_s,
        samples=len(recorded.seconds), duration_s=float(recorded.seconds[-1]),
        largest_use={name: finite(each.max()) for name, each in used.items()},
        largest_use_limit=worst,
        largest_use_at_s=float(recorded.seconds[int(used[worst].argmax())]),
        between_setpoints=_between(c, recorded, joints) if limited and speed.factor != 0.0
        else None, amplitude=amplitude, payload=payload,
        possible_with=[] if possible or recorded.mistakes else possible_changes(
            platform, recorded, lambda each: is_possible(uses(platform, each))),
        rejected=recorded.rejected, missing=recorded.missing, mistakes=list(recorded.mistakes),
        notices=list(recorded.notices))


def _between(capability: Capability, recorded: RecordedMotion, joints: Sequence[str],
             ) -> MotionBetween:
    """
    Return how much faster the motion could be with that between its setpoints.

    It is that of a planned trajectory through the poses, twists and accelerations. The ``reason``
    is why it is not known.
    """
    times = recorded.seconds
    rows = (recorded.wrench,) if recorded.base is None else (recorded.wrench, recorded.base.rows)
    if len(times) > _MOST_BETWEEN:
        reason = f'they are more than {_MOST_BETWEEN}'
    elif len(times) < 2 or not (np.diff(times) > 0.0).all():
        reason = 'their stamps do not increase'
    elif any((each != each[0]).any() for each in rows):
        reason = 'the wrench or the base changes'
    else:
        base = None if recorded.base is None else BaseMotion.of_rows(recorded.base.rows[0])
        try:
            found = capability.speed_factor(recorded.motion, recorded.wrench[0], base, times)
            return replace(_fastest(found, recorded, joints), at_s=found.time)
        except (MotionError, ParameterError) as exc:
            reason = str(exc)
    return MotionBetween(None, None, None, None, reason)


def _fastest(extent: Extent, recorded: RecordedMotion, joints: Sequence[str]) -> MotionBetween:
    """Return how much faster a motion could be at its setpoints."""
    found = rate_extent(*extent[:3], joints=joints)
    return MotionBetween(
        found.limit, found.leg, found.value,
        None if extent.sample is None else float(recorded.seconds[extent.sample]))
