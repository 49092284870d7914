# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Possible errors in the parameters of cranks: units, signs of motors, zeros of horns, limits.

Cranks of a symmetric hexapod have the same angle at home, but for the signs of their motors: one
that has another sits wrong, or is described wrong.
"""

from __future__ import annotations

from collections.abc import Iterator
import math
from typing import Any, TYPE_CHECKING

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Integers
from stewart_dynamics.legs.kind import AtHome, impossible_inertia, STANDARD_G

if TYPE_CHECKING:
    from stewart_dynamics.parameters.table import Parameters

CRANK_LENGTH, ROD_LENGTH = 'legs.crank.length', 'legs.rod.length'
# Lengths by the larger radius of the joints: 0.1 to 10; in mm 1000 times that.
_LENGTH_RATIO = 100.0
# No crank turns by more than two turns to either side, or faster than 950 rpm.
_LARGEST_ANGLE, _FASTEST = 4.0 * math.pi, 100.0  # [rad], [rad/s]
# At home cranks are nearer than this to the middle of their limits, unless all six differ [rad].
_AT_MIDDLE = 0.1
# Angles at home of symmetric cranks differ by less: a tooth of a servo's horn is 0.25 rad. Where
# four or more are equal, as in a drawing, the others are.
_ALIKE, _EQUAL, _ALIKE_WHERE_EQUAL = 0.02, 1e-6, 1e-3  # [rad]
_MIRRORED = 0.01  # largest misfit of mirror images, by the radius of the joints
# Radius of gyration of a crank or rod by its length: 0.3 to 1.
_LARGEST_GYRATION, _SMALLEST_GYRATION = 3.0, 0.01
# Stall torque times speed times the torque by that at home, for servos of 2 to 400 kg cm: 300 to
# 8e3 W; with kg cm taken as N m 104 times as much. Speed of a servo if it is not given.
_LARGEST_POWER, _SERVO_SPEED = 1e4, 7.0  # [W], [rad/s]
# Servos need 0.05 to 0.5 s for 60 degrees; none needs two.
_SLOWEST_SERVO, _SIXTY = 0.5, math.pi / 3.0  # [rad/s], [rad]
# Centers of mass of rods are between their joints, or a little beyond.
_BEYOND = 0.5


def wrong_sizes(p: Parameters, ends: Array) -> Iterator[str]:
    """
    Yield mistakes in units, and rods that are too short, from which others would follow.

    ends (6, 3): of the cranks at the middle of their angles, base frame [m].
    """
    size = max(map(_mean_radius, (p.geometry.base_joints, p.geometry.platform_joints)))
    found = False
    for name in (CRANK_LENGTH, ROD_LENGTH):
        if p[name].max() > _LENGTH_RATIO * size:
            found = True
            yield (f'{name}: {p[name].max():.3g} m, but the joints are {size:.3g} m from their '
                   'center: in mm?')
    for mistake in limits_in_degrees(p):
        found = True
        yield mistake
    if found:
        return
    gap = gap_of(p, ends)
    rod = float(np.mean(p[ROD_LENGTH]))
    if rod <= gap:
        yield (f'{ROD_LENGTH}: {rod:.3g} m: shorter than the gap of {gap:.3g} m between the '
               'platform joints and the ends of the cranks, level and at the middle of their '
               'angles: one of the lengths or radii in mm, or the legs in another order?')


def limits_in_degrees(p: Parameters) -> Iterator[str]:
    """Yield limits of the angles that no crank reaches, which are likely in degrees."""
    for name in ('limits.angle_min', 'limits.angle_max'):
        if p[name] is not None and np.abs(p[name]).max() > _LARGEST_ANGLE:
            yield f'{name}: {p[name][np.argmax(np.abs(p[name]))]:.3g} rad: in degrees?'


def gap_of(p: Parameters, ends: Array) -> float:
    """Return the mean distance of ends of cranks (6, 3) and platform joints in one plane [m]."""
    joints = p.geometry.platform_joints
    with np.errstate(all='ignore'):
        return float(np.mean(np.linalg.norm(
            ends - ends.mean(axis=0) - joints + joints.mean(axis=0), axis=1)))


def likely_mistakes(p: Parameters, home: AtHome, above: Array, at_home: Array, levers: Array,
                    bodies: tuple[Array, Array]) -> Iterator[str]:
    """
    Yield other mistakes.

    above, at_home (6, 2): angles with the branches positive and negative [rad], nan where a rod
    does not reach, with the platform ``above_motors`` and at home. levers (6,): at home [m].
    bodies: centers of mass (6, 3) and inertias (6, 6) of the cranks.
    """
    pushing = levers > 0.0
    angles, angles_at_home = (
        np.where(pushing, each[:, 0], each[:, 1]) for each in (above, at_home))
    sizes = p[CRANK_LENGTH]
    fastest = p.limits.speed_max
    if fastest is not None and fastest.max() > _FASTEST:
        yield f'limits.speed_max: {fastest.max():.3g} rad/s: in degrees per second, or in rpm?'
    elif fastest is not None and fastest.min() < _SLOWEST_SERVO and _has_servos(p):
        yield (f'limits.speed_max: {fastest.min():.3g} rad/s: the time of a servo for 60 degrees? '
               f'{fastest.min():.3g} s for 60 degrees are {_SIXTY / fastest.min():.3g} rad/s')
    yield from _turned_over_twice(p, home)
    signs = tuple(_branches(p, at_home, levers)) or tuple(
        _signs_and_zeros(p, home, angles, np.sign(levers)))
    yield from signs
    if not signs:
        yield from _servos(p, angles_at_home)
    yield from _bodies(p, *bodies)
    ratios, least = np.abs(levers) / sizes, p['limits.lever_min']
    at = int(np.argmin(ratios - least))
    if ratios[at] < least[at]:
        yield (f'limits.lever_min: {least[at]:.3g}: at home {p.joints[at]} has a '
               f'lever of {ratios[at]:.3g} by its length, near a dead centre: a length or a '
               'radius in another unit?')
    elif not signs and home.efforts is not None:
        yield from _loads_at_home(p, np.abs(home.efforts), np.abs(levers))


def above_motors(p: Parameters, home: AtHome) -> Array:
    """
    Return the position (3,) with the platform above the middle of the motors, as high as at home.

    Unlike home, it does not depend on a crank that differs from the others.
    """
    base = p.geometry.base_joints
    around = base - base.mean(axis=0)
    normal = np.linalg.eigh(around.T @ around)[1][:, 0]
    normal = normal * np.sign(normal @ home.up)
    arms = p.geometry.platform_joints @ home.rotation.T
    center = base.mean(axis=0) - arms.mean(axis=0)
    gaps = center + arms - home.anchors
    along = gaps @ normal
    heights = np.sqrt(p[ROD_LENGTH] ** 2 - np.sum(gaps ** 2, axis=1) + along ** 2) - along
    position: Array = center + np.nanmedian(heights) * normal
    return position


def _signs_and_zeros(p: Parameters, home: AtHome, angles: Array, signs: Array) -> Iterator[str]:
    """Yield cranks that differ from those of which they should be copies or mirror images."""
    middles = _middles(p)
    turned = signs * (angles - middles)
    if not np.isfinite(turned).all():
        return
    name = next(each for each in (
        'geometry.crank_angles', 'geometry.crank_directions') if each in p.given)
    apart = np.abs(turned[:, None] - turned)
    drawn = (apart <= _EQUAL).sum(axis=1).max() >= 4
    near: Flags = apart <= (_ALIKE_WHERE_EQUAL if drawn else _ALIKE)
    most = int(np.argmax(near.sum(axis=1)))
    alike, others = near[most], np.flatnonzero(~near[most])
    if alike.all():
        pushing = signs > 0.0
        few = np.flatnonzero(pushing if pushing.sum() < 3 else ~pushing)
        if 0 < len(few) < 3:
            here, there = ('push', 'pull') if pushing[few[0]] else ('pull', 'push')
            rest = np.setdiff1d(np.arange(6), few)
            yield (f'geometry.crank_axes: positive angles of {_names(p, few)} {here} the platform '
                   f'joint, those of {_names(p, rest)} {there}: the sign of one of these axes? '
                   'Mirror images turn in opposite senses')
    elif len(others) < 3:
        expected = (middles + signs * np.median(turned[alike]))[others]
        for leg, angle in zip(others, expected, strict=True):
            yield (f'{name}: {p.joints[leg]}: at home the angle is {angles[leg]:.3g} rad, '
                   f'{_rounded(angle):.3g} rad if it were like the others: a heading, a horn that '
                   'sits on another tooth, or a sign?')
    elif len(others) == 3 and near[others[0], others].all() and _are_mirror_images(p, home):
        one, other = (_rounded(np.mean(angles[each])) for each in (alike, ~alike))
        yield (f'{name}: at home {_names(p, np.flatnonzero(alike))} have an angle of '
               f'{one:.3g} rad, {_names(p, others)} of {other:.3g} rad, but the joints are '
               'mirror images in pairs: cranks of a pair point in mirrored directions, too')


def _turned_over_twice(p: Parameters, home: AtHome) -> Iterator[str]:
    """Yield that both gravity and the side of the platform turn a hexapod with headings over."""
    toward_base = float(-p.gravity @ home.up)
    fixed = p.table['base.source'].default
    if (p.geometry.platform_side == 'negative' and 'geometry.crank_angles' in p.given
            and p.base.source == fixed and toward_base > 0.5 * np.linalg.norm(p.gravity) > 0.0
            and float(p.gravity[2]) > 0.0):
        gravity = ', '.join(f'{each:.3g}' for each in p.gravity)
        yield (f'gravity: [{gravity}] m/s^2 and geometry.platform_side: negative: each turns the '
               'hexapod over, both together have the platform above the base: for a hexapod that '
               'hangs give one of them; where z points down give geometry.crank_axes and '
               'geometry.crank_directions, as positive geometry.crank_angles lift toward z')


def _branches(p: Parameters, at_home: Array, levers: Array) -> Iterator[str]:
    """Yield branches by which a crank is outside its limits at home, and not by the other one."""
    given = np.broadcast_to(p['geometry.crank_branch'], 6)
    low, high = (side * np.inf if limit is None else limit for side, limit in (
        (-1.0, p.limits.angle_min), (1.0, p.limits.angle_max)))
    positive = levers > 0.0
    chosen, other = np.where(positive, at_home.T, at_home.T[::-1])
    outside = (chosen < low - _ALIKE_WHERE_EQUAL) | (chosen > high + _ALIKE_WHERE_EQUAL)
    expected = np.abs(other - _middles(p)) <= _AT_MIDDLE
    for leg in np.flatnonzero((given != 'auto') & outside & expected)[:1]:
        name, limit = (('limits.angle_max', high) if np.any(chosen[leg] > np.broadcast_to(
            high, 6)[leg]) else ('limits.angle_min', low))
        yield (f'geometry.crank_branch: {given[leg]}: {p.joints[leg]}: at home the angle is '
               f'{chosen[leg]:.3g} rad, beyond {name}, {np.broadcast_to(limit, 6)[leg]:.3g} rad; '
               f'with the other branch {_rounded(other[leg]):.3g} rad: the other one?')


def _middles(p: Parameters) -> Array:
    """Return the angles by which home is found (6,)."""
    low, high = p.limits.angle_min, p.limits.angle_max
    return np.zeros(6) if low is None or high is None else 0.5 * (low + high)


def _servos(p: Parameters, angles: Array) -> Iterator[str]:
    """Yield servos without a pulse at home (6,), or within the limits of their cranks."""
    first, last = p.servo.angle_at_min, p.servo.angle_at_max
    if first is None or last is None:
        return
    least, most = np.minimum(first, last), np.maximum(first, last)
    beyond = np.maximum(least - angles, angles - most)
    at = int(np.nanargmax(beyond)) if np.isfinite(beyond).any() else 0
    if beyond[at] > _ALIKE_WHERE_EQUAL:
        yield (f'servo.angle_at_min: {first[at]:.3g} rad, servo.angle_at_max: '
               f'{last[at]:.3g} rad: {p.joints[at]}: no pulse turns the servo to the angle at '
               f'home, {_rounded(angles[at]):.3g} rad: angles of the horn on another zero, or a '
               'sign? They are angles of the crank')
        return
    found: list[tuple[float, str]] = []
    for name, ends, sign in (('limits.angle_max', most, 1.0), ('limits.angle_min', least, -1.0)):
        limit: Array | None = p[name]
        missing = sign * ((sign * _LARGEST_ANGLE if limit is None else limit) - ends)
        at = int(np.argmax(missing))
        if missing[at] > _ALIKE_WHERE_EQUAL:
            given = 'not set' if limit is None else f'{limit[at]:.3g} rad'
            found.append((float(missing[at]), (
                f'{name}: {given}: the servo of {p.joints[at]} ends at {ends[at]:.3g} rad, by '
                'servo.*: no pulse turns it to angles in between; limit the angle to that of '
                'the servo')))
    if found:
        yield max(found, key=lambda each: round(each[0], 9))[1]


def _rounded(angle: Any) -> float:
    return round(float(angle), 6) + 0.0  # no -0


def _names(p: Parameters, legs: Integers) -> str:
    return ', '.join(p.joints[leg] for leg in legs)


def _are_mirror_images(p: Parameters, home: AtHome) -> bool:
    """Return whether a plane through the axis of the hexapod mirrors all joints."""
    base = p.geometry.base_joints - p.geometry.base_joints.mean(axis=0)
    platform = p.geometry.platform_joints - p.geometry.platform_joints.mean(axis=0)
    platform = platform @ home.rotation.T
    for other in range(1, 6):
        normal = base[0] - base[other]
        normal = normal - (normal @ home.up) * home.up
        length = float(np.linalg.norm(normal))
        if length <= _MIRRORED * _mean_radius(base):
            continue
        normal = normal / length
        images = base - 2.0 * np.outer(base @ normal, normal)
        nearest = np.argmin(np.linalg.norm(images[:, None] - base, axis=-1), axis=1)
        of_platform = platform - 2.0 * np.outer(platform @ normal, normal)
        if all(np.abs(image - joints[nearest]).max() <= _MIRRORED * _mean_radius(joints)
               for image, joints in ((images, base), (of_platform, platform))):
            return True
    return False


def _bodies(p: Parameters, centers: Array, inertias: Array) -> Iterator[str]:
    """Yield centers of mass and inertias that no crank or rod of its length has."""
    sizes, masses = p[CRANK_LENGTH], p['legs.crank.mass']
    away = np.where(masses > 0.0, np.linalg.norm(centers, axis=1), 0.0)
    at = int(np.argmax(away / sizes))
    if away[at] > sizes[at]:
        yield (f'legs.crank.center_of_mass: {away[at]:.3g} m from the axis of the motor, but the '
               f'crank is {sizes[at]:.3g} m long: in mm?')
    yield from _gyration('legs.crank', masses, inertias[:, 5], sizes)
    # Those about the axis alone are no bodies: of a file, and of cranks that are identified.
    for inertia in inertias:
        if inertia[:5].any():
            words = tuple(impossible_inertia(
                'legs.crank.inertia', np.linalg.eigvalsh(
                    inertia[[[0, 1, 2], [1, 3, 4], [2, 4, 5]]]), 'xx xy xz yy yz zz'))
            yield from words
            if words:
                break
    rods, masses = p[ROD_LENGTH], p['legs.rod.mass']
    along = np.where(masses > 0.0, p['legs.rod.center_of_mass'] / rods, 0.5)
    at = int(np.argmax(np.abs(along - 0.5)))
    if abs(along[at] - 0.5) > 0.5 + _BEYOND:
        yield (f'legs.rod.center_of_mass: {along[at] * rods[at]:.3g} m from the end of the crank, '
               f'but the rod is {rods[at]:.3g} m long: in mm?')
    yield from _gyration('legs.rod', masses, p['legs.rod.inertia'], rods)


def _gyration(part: str, masses: Array, inertias: Array, lengths: Array) -> Iterator[str]:
    heavy = masses > 0.0
    radii = np.sqrt(np.divide(inertias, masses, where=heavy, out=np.zeros(6))) / lengths
    at = int(np.argmax(radii))
    if radii[at] > _LARGEST_GYRATION:
        yield (f'{part}.inertia: {inertias[at]:.3g} kg m^2, a radius of gyration of '
               f'{radii[at] * lengths[at]:.3g} m, but a length of {lengths[at]:.3g} m: in '
               'g mm^2 or kg mm^2?')
    radii[radii == 0.0] = np.inf
    at = int(np.argmin(radii))
    if radii[at] < _SMALLEST_GYRATION:
        yield (f'{part}.mass: {masses[at]:.6g} kg, with {part}.inertia a radius of gyration of '
               f'{radii[at] * lengths[at]:.3g} m, but a length of {lengths[at]:.3g} m: in g?')


def _loads_at_home(p: Parameters, torques: Array, levers: Array) -> Iterator[str]:
    """Yield limits that the platform exceeds by its weight, at rest at home."""
    most, friction = p.limits.torque_max, p.actuator.coulomb_friction
    if most is not None:
        at = int(np.argmax(torques / most))
        if torques[at] > most[at]:
            yield (f'limits.torque_max: {most[at]:.3g} N m: {p.joints[at]} needs '
                   f'{torques[at]:.3g} N m to hold the platform at rest at home: in another '
                   'unit, or at the shaft of the motor?')
        elif np.any(friction >= most):
            at = int(np.argmax(friction - most))
            yield (f'actuator.coulomb_friction: {friction[at]:.3g} N m: {p.joints[at]} cannot '
                   f'move with limits.torque_max, {most[at]:.3g} N m: in mN m?')
        else:
            yield from _torques_of_servos(p, most, torques)
    pushes, largest = torques / levers, p.limits.rod_force_max
    if largest is not None and np.any(pushes > largest):
        at = int(np.argmax(pushes / largest))
        yield (f'limits.rod_force_max: {largest[at]:.3g} N: the rod of {p.joints[at]} carries '
               f'{pushes[at]:.3g} N while the platform is at rest at home: in kN?')


def _has_servos(p: Parameters) -> bool:
    return any(each.startswith('servo.') for each in p.given)


def _torques_of_servos(p: Parameters, most: Array, torques: Array) -> Iterator[str]:
    """Yield torques that no servo has at its speed, for a platform that needs torques (6,)."""
    if not _has_servos(p):
        return
    fastest = np.full(6, _SERVO_SPEED) if p.limits.speed_max is None else p.limits.speed_max
    powers = most * fastest * most / np.maximum(torques.max(), 1e-12)
    at = int(np.argmax(powers))
    if powers[at] > _LARGEST_POWER:
        yield (f'limits.torque_max: {most[at]:.3g} N m: {most[at] / torques.max():.3g} times what '
               f'holds the platform at home, by servos: in kg cm? {most[at]:.3g} kg cm are '
               f'{most[at] * STANDARD_G / 100.0:.3g} N m')


def _mean_radius(points: Array) -> float:
    return float(np.mean(np.linalg.norm(points - points.mean(axis=0), axis=1)))
