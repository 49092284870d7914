# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
Possible errors in parameters that break no rule: a wrong unit, a geometry that is singular.

All known hexapods are within the bounds with a margin, from one on a fingertip to the cabin of a
telescope on cables of 300 m; a value outside is a warning, not an error.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache, partial
from itertools import combinations, permutations
import math

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.legs.kind import AtHome, impossible_inertia
from stewart_dynamics.legs.lines import lines_from
from stewart_dynamics.mechanics import gravity_mistakes
from stewart_dynamics.mechanics.drives import drive_mistakes as drives
from stewart_dynamics.mechanics.drives.motors import motor_ratio
from stewart_dynamics.mechanics.dynamics import lagrange
from stewart_dynamics.mechanics.frames.motion import listed
from stewart_dynamics.mechanics.kinematics import joint_angles
from stewart_dynamics.mechanics.kinematics.home_pose import (
    HEIGHTS, Home, home_legs, home_of, is_too_long, poses_of, Shape, shape_of, turns_about)
from stewart_dynamics.mechanics.kinematics.pose_mistakes import typed_pose_mistake
from stewart_dynamics.mechanics.kinematics.symmetry import odd_joint
from stewart_dynamics.mechanics.limits import CLEARANCE_MIN, OF_JOINTS
from stewart_dynamics.mechanics.singularity_warning import UNSOLVABLE_CONDITION
from stewart_dynamics.parameters.circles import circle_names
from stewart_dynamics.parameters.table import (
    BY_IMU, DRIVE_INERTIAS, FIXED, inertia_matrix, NO_MASS, ONE_POINT, Parameters,
    STANDARD_GRAVITY)

# Digits of the position of a joint in a message.
_DIGITS = 5
_listed = partial(listed, digits=3)

# The largest known, the six cables of a radio telescope's cabin, hang from towers on a circle
# of 300 m, and the circle of the cabin's joints is 90 times smaller.
_LARGEST_RADIUS = 1000.0  # [m]
_LARGEST_RATIO = 300.0

# Mass in a cube on the platform's radius: 10 for an empty frame, 1e3 to 1e5 for hexapods. One of
# at least 5 mm that is given in mm has 1e-9 of that. Small ones without mass are not checked.
_SMALL_RADIUS = 5.0  # [m]
_THINNEST = 0.01  # [kg/m^3]
# Less stands for no mass, as stewart_describe --geometry-only writes it.
_NO_BODY = 10.0 * NO_MASS  # [kg/m^3]

# A body's radius of gyration divided by the radius of its joints: 0.1 to 3 for all hexapods known.
# With kg cm^2 for kg m^2 it is 100 times as large, with kg mm^2 1000 times, g mm^2 3e4 times.
_LARGEST_GYRATION = 30.0
_SMALLEST_GYRATION = 1.0 / 200.0
# With a mass in g it is 1/32 as large.
_SMALLEST_GYRATION_OF_A_MASS = 0.03
# The same of a leg's part divided by the longest leg: 0.3 for a rod as long as the leg.
_LARGEST_LEG_GYRATION = 3.0
_SMALLEST_LEG_GYRATION = 0.01

# The reflected mass of a rotor and screw is 10 to 200 % of the mass that a leg carries. The number
# of their inertia in kg m^2 is 1e4 to 1e6 times smaller, in kg cm^2 10 to 100 times.
_SMALLEST_REFLECTED_MASS = 1e-3
# No electric motor of a hexapod whose joints are 1 m from their center, or more, reaches its speed
# within a millisecond under its peak torque (the mechanical time constants of those with ironless
# rotors are 1 to 5 ms), and no screw drive 30 g. Forces fall with the square of the size, masses
# with its third power: small drives accelerate more.
_SHORTEST_START = 1e-3  # [s]
_LARGEST_ACCELERATION = 300.0  # [m/s^2]
# Data of an actuator, beside its limits; where they are given its inertia is known.
_FRICTION = 'actuator.viscous_friction', 'actuator.coulomb_friction'

# The shortest leg divided by the longest: 0.5 to 1, with telescopic actuators 0.2; 0 for strokes.
_SMALLEST_LENGTH_RATIO = 0.05
# Sum of the squares of the legs' horizontal parts in the best order, divided by the one given:
# 1 for hexapods, 0.5 to 0.8 where the platform joints begin with another leg.
_OTHER_ORDER = 0.9

# The largest distance of the center of mass, in larger radii: a mast of ten times the radius.
_FARTHEST_CENTER = 10.0

# A hundred times what hexapods with joints 1 m from their center reach [m/s]; larger ones more.
_FASTEST = 100.0

# The base joints of hexapods are as far from their center as the platform joints, or farther.
_LARGEST_PLATFORM_RATIO = 1.2
# Points are in the base frame if they are this near to home, in terms of its height.
_AT_HOME = 0.25
# A rate that needs this many times the possible acceleration along the whole stroke: 1e-4 to 0.5,
# 3600 times as large in m/min.
_UNREACHABLE = 3.0
# An angle limit by the turn of a leg by half of another's stroke: 1 to 10.
_SMALLEST_ANGLE = 0.25
# The frames of base and platform differ at home by more than this, in terms of its height.
_APART = 0.7
# A center of mass this many radii of gyration away from the joints leaves 15 % of the mass for the
# plate between the joints, at most; this many, near the origin, are enough where joints are far.
_FAR_FOR_BODY, _FAR_WHERE_JOINTS_ARE = 2.6, 2.0
# A center of mass in the base frame is between these heights at home, in terms of home's.
_LOWEST, _HIGHEST = 0.6, 1.7
# The center of mass of a piston behind its joint, in terms of the longest leg.
_BEHIND = 0.02

_TILT = math.radians(15.0)


@lru_cache(maxsize=4)  # the replay of many bags asks for each
def likely_mistakes(parameters: Parameters, geometry: bool = True) -> tuple[str, ...]:
    """
    Return possible errors, each in one line: parameter, value, suspected mistake.

    geometry: check legs and poses as well, which takes ten times as long as the rest.
    """
    # An overflow of numbers near the largest double is not reported by itself.
    with np.errstate(all='ignore'):
        shape = shape_of(parameters)
        if one_point := _base_at_one_point(parameters, shape):
            return (one_point,)  # all others would follow from it
        if wrong := tuple(parameters.leg_kind.wrong_sizes(
                parameters, home_legs(parameters)['base'])):
            return wrong  # likewise
        sizes = [*_sizes(parameters, shape)]
        found = [*sizes, *_inertia(parameters, shape),
                 *_reflected_mass(parameters, shape), *drives.likely_mistakes(parameters),
                 *_others(parameters, shape), *_clearance(parameters)]
        if geometry:
            home = home_of(parameters)
            if not _is_assembled(parameters, home):
                return tuple(found)  # a StewartPlatform is not made of it
            found += _legs(parameters, home, bool(sizes))
            if not sizes:
                found += _frames(parameters, home)
                found += _torques_at_home(parameters, home)
                found += _small_angles(parameters, home)
            odd = tuple(_symmetry(parameters))
            of_kind = () if sizes or odd else tuple(_of_kind(parameters, home))
            found += of_kind
            if len(odd) == 1:
                found += odd
            elif not sizes:  # else what follows from a wrong unit
                found += (tuple(_singular(parameters, home)) or odd or not of_kind
                          and tuple(_order(parameters, home)) or ())
                found += joint_angles.likely_mistakes(parameters)
    return tuple(found)


def _sizes(p: Parameters, shape: Shape) -> Iterator[str]:
    base, platform = shape.base_radius, shape.platform_radius
    mass = p.platform.mass
    if mass < _NO_BODY * platform * platform * platform:
        yield (f'platform.mass: {mass:.3g} kg stands for none: forces are those of a hexapod '
               'without masses: write the mass of the platform')
        return
    if base > _LARGEST_RADIUS:
        yield (f'{_joints_of(p, "base")}: {base:.3g} m from their center: larger than any hexapod '
               'known: in mm?')
    if platform > _SMALL_RADIUS and mass < _THINNEST * platform * platform * platform:
        yield (f'{_joints_of(p, "platform")}: {platform:.3g} m from their center, and '
               f'platform.mass only {mass:.3g} kg: in mm?')
    if max(base, platform) > _LARGEST_RATIO * min(base, platform):
        yield (f'{_joints_of(p, "platform")}: {platform:.3g} m from their center, the '
               f'{p.leg_kind.anchors_are} {base:.3g} m: one of them in mm?')
    for name in ('singularity.characteristic_length', 'geometry.zero_length',
                 'limits.length_min', 'limits.length_max'):
        if is_too_long(p, name, shape):
            yield (f'{name}: {np.max(p[name]):.3g} m, but the joints are {shape.radius:.3g} m '
                   'from their center: in mm?')


def _base_at_one_point(p: Parameters, shape: Shape) -> str:
    """Return that all base joints are at one point; empty if they are not."""
    reach = max(shape.platform_radius, np.abs(p.geometry.base_joints).max())
    if shape.base_radius > ONE_POINT * reach:
        return ''
    name = ('geometry.base_joints' if p.geometry.base_angles is None else 'geometry.base_angles')
    which = 'six' if np.ptp(p.geometry.base_joints, axis=0).max() <= ONE_POINT * reach else (
        f'{p.leg_kind.anchors_are}, at the middle of their limits,')
    return f'{name}: all {which} are at one point: the legs hold the platform in no pose'


def _joints_of(p: Parameters, body: str) -> str:
    """Return the parameter that says how far the joints of a body are from their center."""
    radius = circle_names(body)[0]
    return f'geometry.{body}_joints' if p[radius] is None else radius


def _inertia(p: Parameters, shape: Shape) -> Iterator[str]:
    moments = np.linalg.eigvalsh(inertia_matrix(p.platform.inertia))
    gyration = math.sqrt(moments[2] / p.platform.mass)
    yield from _payload(p, shape)
    size = f'the platform joints are {shape.platform_radius:.3g} m from their center'
    if gyration > _LARGEST_GYRATION * shape.radius:
        yield (f'platform.inertia: {moments[2]:.3g} kg m^2 at most, a radius of gyration of '
               f'{gyration:.3g} m, but {size}: in g mm^2 or kg mm^2?')
    if gyration < _SMALLEST_GYRATION * shape.platform_radius:
        yield (f'platform.inertia: {moments[2]:.3g} kg m^2 at most, a radius of gyration of '
               f'{gyration:.3g} m, but {size}: scaled twice, or the joints in mm?')
    elif gyration < _SMALLEST_GYRATION_OF_A_MASS * shape.platform_radius:
        yield (f'platform.mass: {p.platform.mass:.6g} kg, with platform.inertia a radius of '
               f'gyration of {gyration:.3g} m, but {size}: in g, or the joints in cm?')
    yield from impossible_inertia('platform.inertia', moments)
    yield from _far_point('platform.center_of_mass', p.platform.center_of_mass, p, shape)


def _payload(p: Parameters, shape: Shape) -> Iterator[str]:
    mass, center, inertia = p.payload.body
    if mass == 0.0:
        return
    moments = np.linalg.eigvalsh(inertia_matrix(inertia))
    gyration = math.sqrt(max(float(moments[2]), 0.0) / mass)
    if gyration > _LARGEST_GYRATION * shape.radius:
        yield (f'payload.inertia: {moments[2]:.3g} kg m^2 at most, with payload.mass, {mass:.3g} '
               f'kg, a radius of gyration of {gyration:.3g} m, but the platform joints are '
               f'{shape.platform_radius:.3g} m from their center: in g mm^2 or kg mm^2?')
    yield from impossible_inertia('payload.inertia', moments)
    yield from _far_point('payload.center_of_mass', center, p, shape)


def _far_point(name: str, point: Array, p: Parameters, shape: Shape) -> Iterator[str]:
    """Yield that a point of the platform frame is too far away for its unit."""
    away = float(np.linalg.norm(point - p.geometry.platform_joints.mean(axis=0)))
    if away > _FARTHEST_CENTER * shape.radius:
        yield (f'{name}: {_listed(point)} m is {away:.3g} m from the middle of the platform '
               f'joints, but the platform joints are {shape.platform_radius:.3g} m from their '
               'center: in mm?')


def mistakes_in_options(
        p: Parameters, poses: Mapping[str, Sequence[float] | None],
        points: Mapping[str, Sequence[float] | None]) -> Iterator[str]:
    """
    Yield possible errors in poses and points that a user types, each in one line.

    poses: X Y Z ALPHA BETA GAMMA of each option [m, rad]; None if it is not given.
    points: X Y Z of each option in the platform frame [m].
    """
    for name, pose in poses.items():
        if pose is not None and (text := typed_pose_mistake(p, pose)):
            yield f'{name}: {listed(np.array(pose), _DIGITS)}: {text}'
    for name, point in points.items():
        if point is not None:
            yield from _far_point(name, np.array(point), p, shape_of(p))


def _frames(p: Parameters, home: Home) -> Iterator[str]:
    """Yield values that seem to be in the frame of the other body, or on the other side."""
    shape = home.shape
    away = shape.axes[2] * home.side  # from the base to the platform
    if shape.platform_radius > _LARGEST_PLATFORM_RATIO * shape.base_radius:
        joints = _joints_of(p, 'platform')
        yield (f'{joints}: {shape.platform_radius:.3g} m from their center, the '
               f'{p.leg_kind.anchors_are} only {shape.base_radius:.3g} m: base and platform '
               'exchanged?')
    if p.base.source == FIXED and gravity_mistakes.likely_mistake(
            p.gravity, home) == gravity_mistakes.AWAY:
        yield (f'gravity: {_listed(p.gravity)} m/s^2 pulls the platform away from the base: a '
               'sign? For a hexapod that hangs, or whose axes point down, set '
               'geometry.platform_side')
    center = p.platform.center_of_mass
    middle = p.geometry.platform_joints.mean(axis=0)
    height = abs(float(home.heights[0]))
    base_middle = p.geometry.base_joints.mean(axis=0)
    inertia = inertia_matrix(p.platform.inertia)
    across = shape.axes[:2] @ inertia @ shape.axes[:2].T
    least = math.sqrt(max(float(np.linalg.eigvalsh(across)[0]), 0.0) / p.platform.mass)
    far = float(np.linalg.norm(center - middle))
    beyond_body = far > _FAR_FOR_BODY * least
    if _in_one_frame(p, home, bool(
            far > _FAR_WHERE_JOINTS_ARE * least and np.linalg.norm(center) < 0.5 * far)):
        apart = '' if far < 0.5 * np.linalg.norm(middle) else (
            f', but platform.center_of_mass is {far:.3g} m away from it')
        yield (f'geometry.platform_joints: {_listed(middle.round(9))} m is their center, '
               f'where it is in the base frame, legs of {_legs_in_one_frame(p).min():.3g} m and '
               f'more{apart}: are the joints given in the base frame? They are expected in the '
               'platform frame')
    raised = float((center - base_middle) @ away) / height
    in_base_frame = bool(
        np.linalg.norm(middle) < 0.5 * np.linalg.norm(center) and (
            beyond_body and (home.length is None or _LOWEST < raised < _HIGHEST)
            or home.length is not None
            and np.linalg.norm(center - base_middle - height * away) < _AT_HOME * height
            and far > _APART * height))
    if in_base_frame:
        yield (f'platform.center_of_mass: {_listed(center)} m is where the platform is at home '
               "in the base frame: from the base's origin? It is from that of the platform frame")
    if home.length is None:
        return  # heights are guesses
    axial = math.sqrt(max(float(away @ inertia @ away), 0.0) / p.platform.mass)
    reference = abs(height + float((center - middle) @ away))
    if in_base_frame:
        reference = abs(float(center @ away))
    if least > 0.9 * reference > 0.45 * height and axial < 0.6 * least:
        yield (f'platform.inertia: radii of gyration of {least:.3g} m and more across the axis of '
               f'the hexapod, {axial:.3g} m about it, and the base is {reference:.3g} m from '
               "the center of mass at home: about the base's origin? It is about the center of "
               'mass')


def _legs_in_one_frame(p: Parameters) -> Array:
    """Return the lengths (6,) of the legs if base and platform joints are in one frame [m]."""
    return np.asarray(np.linalg.norm(p.geometry.platform_joints - p.geometry.base_joints, axis=1))


def _in_one_frame(p: Parameters, home: Home, apart: bool) -> bool:
    """
    Return whether the platform joints are likely given in the base frame.

    They are then where the legs have a possible length while both frames are the same. A base
    frame away from its joints may be where the platform frame is at home: this is no mistake.

    apart: the center of mass is near the platform's origin, and too far away from its joints.
    """
    lengths = _legs_in_one_frame(p)
    low, high = p.limits.length_min, p.limits.length_max
    base_middle, middle = (each.mean(axis=0) for each in _joints(p).values())
    offset = float((middle - base_middle) @ home.shape.axes[2]) * home.side
    if offset < 0.5 * lengths.mean() or np.linalg.norm(middle) < np.linalg.norm(base_middle):
        return False
    if low is None or high is None:
        return apart
    return bool(np.all((lengths > low) & (lengths < high)))


def _torques_at_home(p: Parameters, home: Home) -> Iterator[str]:
    """Yield that the motors cannot hold the platform where it is at rest at home."""
    most = p.drive.torque_max
    if most is None or not p.drives or home.length is None or p.base.source == BY_IMU:
        return
    if any(each.startswith('drive.torque_max') for each in drives.likely_mistakes(p)):
        return
    efforts = _efforts_at_home(p, home)
    if efforts is None:
        return
    torques = np.abs(efforts) / motor_ratio(p) / p.drive.efficiency
    at = int(np.argmax(torques / most))
    if torques[at] > most[at]:
        yield (f'drive.torque_max: {most[at]:.3g} N m: {p.joints[at]} needs '
               f'{torques[at]:.3g} N m to hold the platform at rest at home: at another shaft, or '
               'in another unit?')


def _efforts_at_home(p: Parameters, home: Home) -> Array | None:
    """Return the efforts of the drives (6,) for the weight of the platform; None: not known."""
    positions, rotations = home.positions, home.rotations
    jacobian = lagrange.drive_jacobian(
        lagrange.unchecked_legs(p, positions[:1], rotations[:1]), rotations[:1])[0]
    weight = p.carried.mass * p.gravity
    load = np.concatenate([weight, np.cross(rotations[0] @ p.carried.center, weight)])
    if not np.isfinite(jacobian).all() or np.linalg.cond(jacobian) > UNSOLVABLE_CONDITION:
        return None
    efforts: Array = np.linalg.solve(jacobian.T, load)
    return efforts


def _is_assembled(p: Parameters, home: Home) -> bool:
    """Return whether home decides the assembly of the legs, where the parameters do not."""
    positions, rotations = home.positions, home.rotations
    try:
        p.choose_branch(lambda: (positions[0], rotations[0]))
    except ParameterError:
        return False
    return True


def _of_kind(p: Parameters, home: Home) -> Iterator[str]:
    """Yield mistakes in parameters that the kind of legs has alone."""
    if home.length is None:
        return
    positions, rotations = home.positions, home.rotations
    known = p.base.source != BY_IMU and (
        gravity_mistakes.likely_mistake(p.gravity) != gravity_mistakes.IN_MM)
    yield from p.leg_kind.likely_mistakes(p, AtHome(
        positions[0], rotations[0], home.shape.axes[2] * home.side, home_legs(p)['base'],
        _efforts_at_home(p, home) if known else None))


def _small_angles(p: Parameters, home: Home) -> Iterator[str]:
    """Yield limits of the joints' angles that end far before the strokes of the legs."""
    low, high = p.limits.length_min, p.limits.length_max
    if low is None or high is None:
        return
    turns = 0.5 * float(np.max((high - low) / (high + low)))
    for name in OF_JOINTS:
        if p[name] is not None and p[name].max() < _SMALLEST_ANGLE * turns:
            yield (f'{name}: {p[name].max():.3g} rad, {math.degrees(p[name].max()):.2g} degrees, '
                   f'but the strokes of the legs are enough to turn them by {turns:.2g} rad: '
                   'converted from degrees twice?')


def _reflected_mass(p: Parameters, shape: Shape) -> Iterator[str]:
    kind = p.leg_kind
    name = kind.fields['reflected_mass']
    formula, unit = kind.reflected, kind.inertia_unit
    if name not in p.given and not any(each in p.given for each in DRIVE_INERTIAS):
        given = [each for each in (kind.rate_limit, kind.effort_limit, *_FRICTION)
                 if each in p.given]
        if given:
            yield (f'{name}: missing, but {given[0]} is given: it is {formula} of '
                   f'{kind.rotors}; write 0.0 for a drive that has none')
        return
    reach = kind.reach(p)
    carried = (p.carried.mass + np.sum(p.legs.piston.mass)) / 6.0
    masses = p[name]
    least, moved = float(np.min(masses)), carried * float(np.min(reach)) ** 2
    if 0.0 < least < _SMALLEST_REFLECTED_MASS * moved:
        yield (f'{name}: {least:.3g} {unit}, but each leg carries {moved:.3g} {unit}: the inertia '
               f'of the rotor? It is {formula}')
        return
    force, rate = p[kind.effort_limit], p[kind.rate_limit]
    if least == 0.0 or force is None:
        return
    if p.drives and p.drive.torque_max is not None:
        force = np.minimum(force, motor_ratio(p) * p.drive.torque_max)
    acceleration = reach * force / masses
    at = int(np.argmax(acceleration))
    start = 0.0 if rate is None else reach[at] * rate[at] / acceleration[at]
    size = min(shape.radius, 1.0)
    if acceleration[at] > _LARGEST_ACCELERATION / size and start < _SHORTEST_START * size:
        yield (f'{name}: {masses[at]:.3g} {unit}: {kind.effort_limit} alone would accelerate it '
               f'by {acceleration[at]:.3g} m/s^2, more than any motor: the inertia of the rotor '
               f'in kg cm^2? It is {formula} in {unit}')


def _others(p: Parameters, shape: Shape) -> Iterator[str]:
    gravity = float(np.linalg.norm(p.gravity))
    wrong = gravity_mistakes.likely_mistake(p.gravity)
    if wrong == gravity_mistakes.IN_MM:
        yield f'gravity: {gravity:.6g} m/s^2: four times that of Jupiter: in mm/s^2?'
    elif wrong and p.base.source != BY_IMU:
        suspected = {gravity_mistakes.IN_G: 'in g?',
                     gravity_mistakes.NONE: 'none, as in orbit?'}[wrong]
        yield (f'gravity: {gravity:.6g} m/s^2: {suspected} The earth has '
               f'{-STANDARD_GRAVITY[2]:g}')
    weight, most = p.carried.mass * gravity, p.limits.force_max
    if most is not None and p.platform.mass * gravity <= most.sum() < weight:
        yield (f'payload.mass: {p.payload.mass:.3g} kg: six legs with limits.force_max, '
               f'{_listed(np.unique(most))} N, cannot carry it and the platform, {weight:.3g} N: '
               'in g?')
    elif most is not None and wrong != gravity_mistakes.IN_MM and weight > most.sum():
        yield (f'limits.force_max: {_listed(np.unique(most))} N: six such legs cannot carry the '
               f'platform, {weight:.3g} N: in kN?')
    rated = p.limits.joint_force_max
    if rated is not None and wrong != gravity_mistakes.IN_MM and weight > rated.sum():
        yield (f'limits.joint_force_max: {_listed(np.unique(rated))} N: six such legs cannot '
               f'carry the platform, {weight:.3g} N: in kN?')
    friction = p.actuator.coulomb_friction
    if most is not None and weight <= most.sum() and np.any(friction >= most):
        at = int(np.argmax(friction - most))
        yield (f'actuator.coulomb_friction: {friction[at]:.3g} N: {p.joints[at]} cannot move '
               f'with limits.force_max, {most[at]:.3g} N: in mN?')
    fastest = p.limits.velocity_max
    if fastest is not None and fastest.max() > _FASTEST * max(shape.radius, 1.0):
        yield f'limits.velocity_max: {fastest.max():.3g} m/s: in mm/s?'
        return
    low, high = p.limits.length_min, p.limits.length_max
    if fastest is None or low is None or high is None:
        return
    # Along the whole stroke, with all the force of a leg for a sixth of the platform.
    needed = fastest ** 2 / (2.0 * (high - low))
    largest = np.full(6, _LARGEST_ACCELERATION / min(shape.radius, 1.0))
    if most is not None and weight <= most.sum():
        largest = np.minimum(largest, most / (
            p.carried.mass / 6.0 + p.legs.piston.mass + p.actuator.reflected_mass))
    at = int(np.argmax(needed / largest))
    if needed[at] > _UNREACHABLE * largest[at]:
        yield (f'limits.velocity_max: {fastest[at]:.3g} m/s: reached within the stroke of '
               f'{high[at] - low[at]:.3g} m with {needed[at]:.3g} m/s^2 alone, possible are '
               f'{largest[at]:.3g}: in m/min or mm/s?')


def _clearance(p: Parameters) -> Iterator[str]:
    shortest, cylinders = p.limits.length_min, p.legs.cylinder.length
    if shortest is not None and cylinders is not None and np.any(cylinders > shortest):
        at = int(np.argmax(cylinders - shortest))
        yield (f'legs.cylinder.length: {cylinders[at]:.3g} m, but {p.joints[at]} can be as '
               f'short as limits.length_min, {shortest[at]:.3g} m: in mm? It is the length from '
               'the base joint to the end of the cylinder')
    if p.limits.leg_clearance_min is None:
        return
    for name, joints in _joints(p).items():
        for i, j in combinations(range(6), 2):
            if np.array_equal(joints[i], joints[j]):
                yield (f'{CLEARANCE_MIN}: {p.limits.leg_clearance_min:.3g} m, but '
                       f'{p.joints[i]} and {p.joints[j]} have the same place in {name}: their '
                       'clearance is never above zero; leave the limit out')
                return


def _joints(p: Parameters) -> dict[str, Array]:
    return {'geometry.base_joints': p.geometry.base_joints,
            'geometry.platform_joints': p.geometry.platform_joints}


def _legs(p: Parameters, home: Home, wrong_size: bool) -> Iterator[str]:
    """Yield mistakes of the legs; where joints or lengths have a wrong unit, no others of them."""
    shape, longest = home.shape, home.longest
    low, high = p.limits.length_min, p.limits.length_max
    if low is not None and high is not None and np.any(low < _SMALLEST_LENGTH_RATIO * high):
        yield (f'limits.length_min: {_listed(np.unique(low))} m, limits.length_max: '
               f'{_listed(np.unique(high))} m: strokes? They are lengths from joint to joint')
        return  # the limits are used below
    if not home.reachable:
        limits = ' and '.join(f'{name}: {_listed(np.unique(p[name]))} m' for name in (
            'limits.length_min', 'limits.length_max') if p[name] is not None)
        yield (f'{limits}: no level pose has all legs within them; the base joints are '
               f'{shape.base_radius:.3g} m from their center, the platform joints '
               f'{shape.platform_radius:.3g} m: different units?')
        return  # any of them may be wrong, so that the other checks would report it again
    if wrong_size:
        return
    if high is not None and np.any(p.geometry.zero_length > high) and not is_too_long(
            p, 'geometry.zero_length', shape):
        yield (f'limits.length_max: {_listed(np.unique(high))} m, less than geometry.zero_length, '
               f'{_listed(np.unique(p.geometry.zero_length))} m: a stroke? It is the length '
               'from joint to joint')
        return
    for part, joint in (('cylinder', 'base'), ('piston', 'platform')):
        name = f'legs.{part}.center_of_mass'
        masses, centers = p.legs.parts[part].mass, p.legs.parts[part].center_of_mass
        inertias = p.legs.parts[part].inertia
        # Behind the joint there may be a motor, but at most half a leg away from it.
        outside = (centers > longest) | (centers < -0.5 * longest)
        if outside.any():
            yield (f'{name}: {centers[np.argmax(outside)]:.3g} m from the {joint} joint, but no '
                   f'leg is over {longest:.3g} m: in mm?')
        elif part == 'piston' and np.any(centers < -_BEHIND * longest):
            yield (f'{name}: {centers.min():.3g} m: behind the platform joint: a sign? It counts '
                   'from this joint toward the base')
        gyration = np.sqrt(np.divide(inertias, masses, where=masses > 0.0, out=np.zeros(6)))
        at = int(np.argmax(gyration))
        if gyration[at] > _LARGEST_LEG_GYRATION * longest:
            yield (f'legs.{part}.inertia: {inertias[at]:.3g} kg m^2, a radius '
                   f'of gyration of {gyration[at]:.3g} m, but no leg is over {longest:.3g} m: '
                   'in g mm^2 or kg mm^2?')
        gyration[gyration == 0.0] = np.inf
        at = int(np.argmin(gyration))
        if gyration[at] < _SMALLEST_LEG_GYRATION * longest:
            yield (f'legs.{part}.mass: {masses[at]:.6g} kg, with legs.{part}.inertia a radius of '
                   f'gyration of {gyration[at]:.3g} m, but the longest leg is {longest:.3g} m: '
                   'in g?')


def _order(p: Parameters, home: Home) -> Iterator[str]:
    """Yield that other pairs of joints give shorter legs at home, as in all hexapods known."""
    turned = home.shape.platform @ home.turns[0].T
    base = p.geometry.base_joints
    base = (base - base.mean(axis=0)) @ home.shape.axes.T
    squares = ((base[:, None, :2] - turned[:, :2]) ** 2).sum(axis=-1)
    orders = np.array(list(permutations(range(6))))
    sums = squares[np.arange(6), orders].sum(axis=1)
    best = int(np.argmin(sums))
    if sums[best] < _OTHER_ORDER * np.trace(squares):
        yield (f'geometry.platform_joints: at home ({home.text}) the legs are shorter with the '
               f'platform joints in the order {(orders[best] + 1).tolist()}: are the joints in '
               'another order?')


def _symmetry(p: Parameters) -> Iterator[str]:
    for name, joints in _joints(p).items():
        odd = odd_joint(joints)
        if odd is not None:
            twins = [leg for n, leg in enumerate(p.joints)
                     if n != odd.joint and np.array_equal(joints[n], joints[odd.joint])]
            same = f', the same as {twins[0]}' if twins else ''
            yield (f'{name}: {p.joints[odd.joint]}: '
                   f'{listed(joints[odd.joint], _DIGITS)} m'
                   f'{same}: the other five {odd.symmetry}, as all six would with '
                   f'{listed(odd.expected, _DIGITS)} m: a sign or a digit?')


def _singular(p: Parameters, home: Home) -> Iterator[str]:
    shape = home.shape
    tried = [(height * side * shape.radius, math.radians(yaw), tilt)
             for height in HEIGHTS for side in (1.0, -1.0)
             for yaw in (0.0, 20.0, -20.0, 45.0, -45.0) for tilt in (0.0, _TILT, -_TILT)]
    heights, angles, tilts = np.array(tried).T
    turned = turns_about(2, angles) @ turns_about(0, tilts) @ turns_about(1, 0.5 * tilts)
    stop = p.singularity.stop_condition
    for where, at, turns, suspected in (
            (f'every pose of {len(tried)} tried: the condition number is at least',
             heights, turned,
             'are base and platform joints similar hexagons, two legs the same,'),
            (f'home ({home.text}): the condition number is', home.heights, home.turns,
             'is the platform turned against the base there,')):
        best = float(_conditions(p, shape, at, turns).min())
        if best >= stop:
            kind = 'singular' if best >= UNSOLVABLE_CONDITION else 'nearly singular'
            yield (f'geometry: {kind} at {where} {best:.3g}, singularity.stop_condition is '
                   f'{stop:g}: {suspected} or the joints in another order?')
            return


def _conditions(p: Parameters, shape: Shape, heights: Array, rotations: Array) -> Array:
    """Return condition numbers (N,) at these heights and turns, both in the shape's axes."""
    positions, rotations = poses_of(p, shape, heights, rotations)
    if not np.isfinite(positions).all():
        return np.full(len(heights), 1.0)
    matrices = lagrange.inverse_jacobian(lines_from(
        home_legs(p)['base'], p.geometry.platform_joints, positions, rotations))
    length = p.singularity.characteristic_length
    if is_too_long(p, 'singularity.characteristic_length', shape):
        length = shape.platform_radius  # reported already, and not a mistake of the geometry
    matrices[..., 3:] /= length
    matrices[~np.isfinite(matrices).all(axis=(-2, -1))] = np.zeros((6, 6))
    values = np.linalg.svd(matrices, compute_uv=False)
    conditions: Array = np.where(values[:, 5] > 0.0, values[:, 0] / values[:, 5], np.inf)
    return conditions
