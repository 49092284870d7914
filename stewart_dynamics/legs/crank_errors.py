# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Possible errors in the parameters of cranks: units, signs of motors, zeros of horns, limits.

Cranks of a symmetric hexapod have the same angle at home, but for the signs of their motors: one
that has another sits wrong, or is described wrong.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
import math
from typing import Any, TYPE_CHECKING

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Integers
from stewart_dynamics.legs.kind import AtHome, STANDARD_G
from stewart_dynamics.possible_errors.bodies import (
    IMPOSSIBLE_INERTIA, Moments, Part, PART_ERRORS)
from stewart_dynamics.possible_errors.hypothesis import (
    find_errors, First, Hypothesis, PossibleError, Six, Table, When)

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
# Stall torque times speed times the torque by that at home, for servos of 2 to 400 kg cm: 300 to
# 8e3 W; with kg cm taken as N m 104 times as much. Speed of a servo if it is not given.
_LARGEST_POWER, _SERVO_SPEED = 1e4, 7.0  # [W], [rad/s]
# Servos need 0.05 to 0.5 s for 60 degrees; none needs two.
_SLOWEST_SERVO, _SIXTY = 0.5, math.pi / 3.0  # [rad/s], [rad]
# Centers of mass of rods are between their joints, or a little beyond.
_BEYOND = 0.5


class _Sizes:
    """Lengths and limits of cranks; ends (6, 3): at the middle of their angles, base frame [m]."""

    def __init__(self, p: Parameters, ends: Array) -> None:
        self.six = Six(p)
        self.size = max(map(_mean_radius, (p.geometry.base_joints, p.geometry.platform_joints)))
        self.gap, self.rod = gap_of(p, ends), float(np.mean(p[ROD_LENGTH]))


_ANGLE_LIMITS = 'limits.angle_min', 'limits.angle_max'


def _in_degrees(name: str) -> Hypothesis[_Sizes]:
    return Hypothesis(name, lambda s: np.abs(s.six[name]) - _LARGEST_ANGLE,
                      f'{{six[{name}]:.3g}} rad: in degrees?')


def _in_mm(name: str) -> Hypothesis[_Sizes]:
    return Hypothesis(name, lambda s: s.six[name] - _LENGTH_RATIO * s.size, (
        f'{{six[{name}]:.3g}} m, but the joints are {{size:.3g}} m from their center: in mm?'))


_IN_DEGREES: Table[_Sizes] = tuple(map(_in_degrees, _ANGLE_LIMITS))
_WRONG_SIZES: Table[_Sizes] = First(
    (_in_mm(CRANK_LENGTH), _in_mm(ROD_LENGTH), _IN_DEGREES),
    Hypothesis(ROD_LENGTH, lambda s: s.rod <= s.gap, (
        '{rod:.3g} m: shorter than the gap of {gap:.3g} m between the platform joints and the '
        'ends of the cranks, level and at the middle of their angles: one of the lengths or radii '
        'in mm, or the legs in another order?')))


def wrong_sizes(p: Parameters, ends: Array) -> Iterator[PossibleError]:
    """
    Yield errors in units, and rods that are too short, from which others would follow.

    ends (6, 3): of the cranks at the middle of their angles, base frame [m].
    """
    return find_errors(_WRONG_SIZES, _Sizes(p, ends))


def limits_in_degrees(p: Parameters) -> Iterator[PossibleError]:
    """Yield limits of the angles that no crank reaches, which are likely in degrees."""
    return find_errors(_IN_DEGREES, _Sizes(p, p.geometry.base_joints))


def gap_of(p: Parameters, ends: Array) -> float:
    """Return the mean distance of ends of cranks (6, 3) and platform joints in one plane [m]."""
    joints = p.geometry.platform_joints
    with np.errstate(all='ignore'):
        return float(np.mean(np.linalg.norm(
            ends - ends.mean(axis=0) - joints + joints.mean(axis=0), axis=1)))


class Cranks:
    """
    The cranks of a hexapod at home.

    above, at_home (6, 2): angles with the branches positive and negative [rad], nan where a rod
    does not reach, with the platform ``above_motors`` and at home. levers (6,): at home [m].
    bodies: centers of mass (6, 3) and inertias (6, 6) of the cranks.
    """

    def __init__(self, p: Parameters, home: AtHome, above: Array, at_home: Array, levers: Array,
                 bodies: tuple[Array, Array]) -> None:
        six = Six(p)
        self.p, self.home, self.six, self.leg = p, home, six, list(p.joints)
        self.levers, self.length, self.rod = np.abs(levers), p[CRANK_LENGTH], p[ROD_LENGTH]
        self.speed, self.friction = six['limits.speed_max'], p.actuator.coulomb_friction
        self.rated = _SIXTY / self.speed
        self.ratios = self.levers / self.length
        self.low, self.high = (np.nan_to_num(six[name], nan=sign * np.inf) for name, sign in zip(
            _ANGLE_LIMITS, (-1.0, 1.0), strict=True))
        self.middles = np.nan_to_num(0.5 * (six[_ANGLE_LIMITS[0]] + six[_ANGLE_LIMITS[1]]))
        self.gravity = ', '.join(f'{each:.3g}' for each in p.gravity)
        # Angles of the branch at home, and of the other one.
        positive = levers > 0.0
        self.branch = np.full(6, p['geometry.crank_branch'])
        self.signs = np.sign(levers)
        self.above = np.where(positive, above[:, 0], above[:, 1])
        self.angles, other = np.where(positive, at_home.T, at_home.T[::-1])
        self.other = other.round(6) + 0.0
        self.beyond = np.where(self.angles > self.high, _ANGLE_LIMITS[1], _ANGLE_LIMITS[0])
        self.limit = np.where(self.angles > self.high, self.high, self.low)
        self.wrong_branch = (
            (self.branch != 'auto') & ((self.angles < self.low - _ALIKE_WHERE_EQUAL)
                                       | (self.angles > self.high + _ALIKE_WHERE_EQUAL))
            & (np.abs(other - self.middles) <= _AT_MIDDLE))
        # Servos, which have no pulses beyond their ends.
        self.has_servos = any(each.startswith('servo.') for each in p.given)
        self.first, self.last = six['servo.angle_at_min'], six['servo.angle_at_max']
        self.least, self.most = (
            each(self.first, self.last) for each in (np.minimum, np.maximum))
        self.rounded = self.angles.round(6) + 0.0
        # Loads at rest.
        nothing = np.full(6, np.nan)
        self.torques = nothing if home.efforts is None else np.abs(home.efforts)
        self.largest, self.torque = self.torques.max(), six['limits.torque_max']
        self.times, self.newton_metres = self.torque / self.largest, (
            self.torque * STANDARD_G / 100.0)
        self.pushes, self.push = self.torques / self.levers, six['limits.rod_force_max']
        # Bodies.
        self.centers, self.inertias = bodies
        self.away = np.where(
            p['legs.crank.mass'] > 0.0, np.linalg.norm(self.centers, axis=1), 0.0)
        self.along = np.where(p['legs.rod.mass'] > 0.0, p['legs.rod.center_of_mass'], np.nan)

    @cached_property
    def wrong_zeros(self) -> tuple[PossibleError, ...]:
        """Return errors in branches, signs and zeros, from which others would follow."""
        return tuple(find_errors(_WRONG_ZEROS, self))

    def body_errors(self) -> Iterator[PossibleError]:
        """Yield masses and inertias that no crank or rod of its length has."""
        p = self.p
        yield from find_errors(_CRANK_CENTER, self)
        yield from find_errors(PART_ERRORS, Part(
            'legs.crank', p['legs.crank.mass'], self.inertias[:, 5], self.length))
        # Those about the axis alone are no bodies: of a file, and of cranks that are identified.
        whole = self.inertias[self.inertias[:, :5].any(axis=1)]
        if len(whole):
            yield from find_errors(IMPOSSIBLE_INERTIA, Moments(
                'legs.crank.inertia', np.asarray(np.linalg.eigvalsh(whole[:, [
                    [0, 1, 2], [1, 3, 4], [2, 4, 5]]])), 'xx xy xz yy yz zz'))
        yield from find_errors(_ROD_CENTER, self)
        yield from find_errors(PART_ERRORS, Part(
            'legs.rod', p['legs.rod.mass'], p['legs.rod.inertia'], self.rod))

    def ends(self) -> Iterator[PossibleError]:
        """Yield the limit that is farthest beyond the end of a servo."""
        found = []
        for name, ends, sign in zip(_ANGLE_LIMITS[::-1], (self.most, self.least), (1.0, -1.0),
                                    strict=True):
            limit = self.p[name]
            missing = sign * ((sign * _LARGEST_ANGLE if limit is None else limit) - ends)
            at = int(np.argmax(missing))
            if missing[at] > _ALIKE_WHERE_EQUAL:
                given = 'not set' if limit is None else f'{limit[at]:.3g} rad'
                found.append((-round(float(missing[at]), 9), PossibleError(name, (
                    f'{given}: the servo of {self.leg[at]} ends at {ends[at]:.3g} rad, by '
                    'servo.*: no pulse turns it to angles in between; limit the angle to that of '
                    'the servo'))))
        return iter([min(found, key=lambda each: each[0])[1]] if found else [])


_Of = Hypothesis[Cranks]
_CRANK_CENTER: Table[Cranks] = _Of(
    'legs.crank.center_of_mass', lambda c: np.where(
        c.away > c.length, c.away / c.length, np.nan),
    '{away:.3g} m from the axis of the motor, but the crank is {length:.3g} m long: in mm?')
_ROD_CENTER: Table[Cranks] = _Of(
    'legs.rod.center_of_mass', lambda c: np.abs(c.along / c.rod - 0.5) - 0.5 - _BEYOND,
    '{along:.3g} m from the end of the crank, but the rod is {rod:.3g} m long: in mm?')
_WRONG_ZEROS: Table[Cranks] = First(
    _Of('geometry.crank_branch', lambda c: c.wrong_branch, (
        '{branch}: {leg}: at home the angle is {angles:.3g} rad, beyond {beyond}, {limit:.3g} '
        'rad; with the other branch {other:.3g} rad: the other one?')),
    lambda c: _signs_and_zeros(c.p, c.home, c.middles, c.above, c.signs))
# Limits that the platform exceeds by its weight, at rest at home.
_LOADS: Table[Cranks] = (
    First[Cranks](
        _Of('limits.torque_max', lambda c: c.torques / c.torque - 1.0, (
            '{torque:.3g} N m: {leg} needs {torques:.3g} N m to hold the platform at rest at '
            'home: in another unit, or at the shaft of the motor?')),
        _Of('actuator.coulomb_friction', lambda c: c.friction >= c.torque, (
            '{friction:.3g} N m: {leg} cannot move with limits.torque_max, {torque:.3g} N m: in '
            'mN m?')),
        When(lambda c: c.has_servos, _Of('limits.torque_max', lambda c: c.torque * np.where(
            np.isnan(c.speed), _SERVO_SPEED, c.speed) * c.torque / np.maximum(
            c.largest, 1e-12) - _LARGEST_POWER, (
            '{torque:.3g} N m: {times:.3g} times what holds the platform at home, by servos: in '
            'kg cm? {torque:.3g} kg cm are {newton_metres:.3g} N m')))),
    Hypothesis[Cranks]('limits.rod_force_max', lambda c: c.pushes / c.push - 1.0, (
        '{push:.3g} N: the rod of {leg} carries {pushes:.3g} N while the platform is at rest at '
        'home: in kN?')))
CRANK_ERRORS: Table[Cranks] = (
    First(
        _Of('limits.speed_max', lambda c: c.speed - _FASTEST,
            '{speed:.3g} rad/s: in degrees per second, or in rpm?'),
        When(lambda c: c.has_servos, _Of('limits.speed_max', lambda c: _SLOWEST_SERVO - c.speed, (
            '{speed:.3g} rad/s: the time of a servo for 60 degrees? {speed:.3g} s for 60 degrees '
            'are {rated:.3g} rad/s')))),
    # Both gravity and the side of the platform turn a hexapod with headings over.
    _Of('gravity', lambda c: (
        c.p.geometry.platform_side == 'negative' and 'geometry.crank_angles' in c.p.given
        and c.p.base.source == c.p.table['base.source'].default and float(c.p.gravity[2]) > 0.0
        and -c.p.gravity @ c.home.up > 0.5 * np.linalg.norm(c.p.gravity)), (
        '[{gravity}] m/s^2 and geometry.platform_side: negative: each turns the hexapod over, '
        'both together have the platform above the base: for a hexapod that hangs give one of '
        'them; where z points down give geometry.crank_axes and geometry.crank_directions, as '
        'positive geometry.crank_angles lift toward z')),
    First(lambda c: c.wrong_zeros, When(lambda c: np.isfinite(c.least).all(), First(
        _Of('servo.angle_at_min', lambda c: np.maximum(
            c.least - c.angles, c.angles - c.most) - _ALIKE_WHERE_EQUAL, (
            '{first:.3g} rad, servo.angle_at_max: {last:.3g} rad: {leg}: no pulse turns the servo '
            'to the angle at home, {rounded:.3g} rad: angles of the horn on another zero, or a '
            'sign? They are angles of the crank')),
        lambda c: c.ends()))),
    lambda c: c.body_errors(),
    First(
        _Of('limits.lever_min', lambda c: c.six['limits.lever_min'] - c.ratios, (
            '{six[limits.lever_min]:.3g}: at home {leg} has a lever of {ratios:.3g} by its '
            'length, near a dead centre: a length or a radius in another unit?')),
        When(lambda c: not c.wrong_zeros, _LOADS)))


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


def _signs_and_zeros(p: Parameters, home: AtHome, middles: Array, angles: Array, signs: Array,
                     ) -> Iterator[PossibleError]:
    """Yield cranks that differ from those of which they should be copies or mirror images."""
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
            yield PossibleError('geometry.crank_axes', (
                f'positive angles of {_names(p, few)} {here} the platform joint, those of '
                f'{_names(p, rest)} {there}: the sign of one of these axes? Mirror images turn in '
                'opposite senses'))
    elif len(others) < 3:
        expected = (middles + signs * np.median(turned[alike]))[others]
        for leg, angle in zip(others, expected, strict=True):
            yield PossibleError(name, (
                f'{p.joints[leg]}: at home the angle is {angles[leg]:.3g} rad, '
                f'{_rounded(angle):.3g} rad if it were like the others: a heading, a horn that '
                'sits on another tooth, or a sign?'))
    elif len(others) == 3 and near[others[0], others].all() and _are_mirror_images(p, home):
        one, other = (_rounded(np.mean(angles[each])) for each in (alike, ~alike))
        yield PossibleError(name, (
            f'at home {_names(p, np.flatnonzero(alike))} have an angle of {one:.3g} rad, '
            f'{_names(p, others)} of {other:.3g} rad, but the joints are mirror images in pairs: '
            'cranks of a pair point in mirrored directions, too'))


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


def _mean_radius(points: Array) -> float:
    return float(np.mean(np.linalg.norm(points - points.mean(axis=0), axis=1)))
