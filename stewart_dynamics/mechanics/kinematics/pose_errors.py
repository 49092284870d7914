# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The possible error in a pose that the hexapod cannot have: the one without which it can.

A pose may be counted from home, its position in mm, its quaternion in the order w x y z; the
joints of one body may be given in the frame of the other. Each is a transform: the pose without
the error has all legs within their limits, and det(J) has the sign that it has at home. Angles may
be in degrees if even half of them could not be reached in radians.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import combinations
import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.dynamics import lagrange
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.mechanics.frames.rotation import from_euler, from_quaternion, to_quaternion
from stewart_dynamics.mechanics.kinematics.home_pose import home_pose, other_side, shape_of
from stewart_dynamics.mechanics.limits import TOLERANCE
from stewart_dynamics.mechanics.rows import POSE, POSITION, ROTATION
from stewart_dynamics.parameters.table import Parameters

_MILLIMETRE = 1e-3
# Lengths of legs without limits, in terms of those at home.
_SHORTEST, _LONGEST = 0.3, 2.0
# A thousand times the usual length of a leg, or the radius of the joints, at least and at most.
_THOUSAND = 100.0, 10_000.0
# Smallest distance that may be in mm, in terms of the longest leg.
_FAR = 2.0

# Angles of which one is as large may be in degrees, whatever half of them reaches.
_TILTED = 1.0

# Joints of one body are in the frame of the other one if they are this far from the origin of
# theirs, in terms of the longest leg.
_OTHER_FRAME = 0.3

# The simplest first.
_MM, _FROM_HOME, _W_FIRST, IN_DEGREES, _BASE, _PLATFORM = _KNOWN = (
    'position in mm', 'a pose counted from home', 'a quaternion in the order w x y z',
    'angles in degrees', 'geometry.base_joints in the platform frame',
    'geometry.platform_joints in the base frame')


class Angles(NamedTuple):
    """Angles whose unit is not given, and their rotations, base axes."""

    largest: float  # as a number
    half: Array | None
    """Rotation (3, 3) of half the numbers in radians; None: small numbers are not judged."""
    in_degrees: Array  # rotation (3, 3) of the numbers in degrees


class PoseByAngles(NamedTuple):
    """A pose by angles whose unit is not given."""

    row: Array  # position and rotation (12,) with the angles in radians, base axes
    angles: Angles
    advice: str  # the option by which the angles are read in degrees


def find_typed_pose_error(parameters: Parameters, pose: Sequence[float]) -> str:
    """Return the possible error in a pose X Y Z ALPHA BETA GAMMA as a user types it."""
    angles = np.array(pose[3:])
    return find_pose_error(parameters, np.append(pose[:3], from_euler(angles)), angles=Angles(
        float(np.abs(angles).max()), None, from_euler(np.radians(angles))))


def find_pose_error(parameters: Parameters, motion: Sequence[float] | Array,
                    first: bool = True, angles: Angles | None = None) -> str:
    """
    Return the possible error in the pose of a row of motion; empty without one.

    first: whether the motion begins there; on the other side of a singularity is an error then.
    angles: of the rotation, which may be in degrees.

    Without a home pose only a position in mm is named.
    """
    pose = np.array(motion[POSE])
    position: Array = pose[POSITION]
    rotation: Array = pose[ROTATION].reshape(3, 3)
    found = _at_home(parameters)
    if found is None:
        return _far(parameters, position, rotation)
    home, lengths_at_home, at_home = found
    low, high = parameters.limits.length_min, parameters.limits.length_max
    shortest = _SHORTEST * lengths_at_home if low is None else low * (1.0 - TOLERANCE)
    longest = _LONGEST * lengths_at_home if high is None else high * (1.0 + TOLERANCE)

    def is_possible(at: Array, turned: Array) -> bool:
        lengths, determinant = _legs(parameters, at, turned)
        return determinant * at_home > 0.0 and bool(
            np.all(lengths >= shortest) and np.all(lengths <= longest))

    with np.errstate(all='ignore'):
        turns = angles is not None and angles.largest > math.pi  # no platform turns so far
        if not turns and is_possible(position, rotation):
            return ''
        base, platform = (joints.mean(axis=0) for joints in (
            parameters.geometry.base_joints, parameters.geometry.platform_joints))
        far = _OTHER_FRAME * longest.max()
        # Positions and rotations without an error; None where they do not look like it: in m a
        # position is not far off, in mm hardly a motion; no platform turns by more than a quarter
        # turn; an angle may be near those that are reached.
        transforms: dict[str, Callable[[Array, Array], tuple[Array, Array] | None]] = {
            _MM: lambda at, turned: None if np.linalg.norm(at) < _FAR * longest.max() else (
                _MILLIMETRE * at, turned),
            _W_FIRST: lambda at, turned: None if angles is not None or (
                2.0 * (q := to_quaternion(turned).tolist())[0] ** 2 < 1.0) else (
                at, np.reshape(from_quaternion(q[1], q[2], q[3], q[0]), (3, 3))),
            IN_DEGREES: lambda at, _: None if angles is None or angles.largest < _TILTED and (
                angles.half is None or is_possible(at, angles.half)) else (at, angles.in_degrees),
            _FROM_HOME: lambda at, turned: (home.position + at, turned @ home.rotation),
            _BASE: lambda at, turned: (at + base, turned) if np.linalg.norm(base) > far else None,
            _PLATFORM: lambda at, turned: (
                at - turned @ platform, turned) if np.linalg.norm(platform) > far else None}
        # The fewest errors first.
        for each in (each for number in (1, 2, 3) for each in combinations(_KNOWN, number)):
            right: tuple[Array, Array] | None = (position, rotation)
            for error, without in transforms.items():
                right = without(*right) if right and error in each else right
            if right and is_possible(*right):
                return f'possible error: {" and ".join(each)}'
        return other_side(_legs(parameters, position, rotation)[1], at_home) if first else ''


@lru_cache(maxsize=4)  # home takes a millisecond, the rest a tenth of it
def _at_home(parameters: Parameters) -> tuple[Pose, Array, float] | None:
    """Return the home pose, its lengths of the legs and det(J); None if it is not known."""
    try:
        home = home_pose(parameters)
    except ParameterError:
        return None
    return home, *_legs(parameters, home.position, home.rotation)


def _far(parameters: Parameters, position: Array, rotation: Array) -> str:
    """Return that a position is in mm if the legs would be a thousand times as long as usual."""
    lengths, _ = _legs(parameters, position, rotation)
    times = lengths / (parameters.limits.length_max if parameters.limits.length_max is not None
                       else shape_of(parameters).radius)
    thousand = np.all((times > _THOUSAND[0]) & (times < _THOUSAND[1]))
    return f'possible error: {_MM}' if thousand else ''


def _legs(parameters: Parameters, position: Array, rotation: Array) -> tuple[Array, float]:
    """Return the lengths of the legs (6,) [m], and det(J) [m^3]; not finite out of reach."""
    with np.errstate(all='ignore'):
        legs = lagrange.unchecked_legs(parameters, position, rotation)
        return legs.lengths, float(lagrange.determinant(legs))
