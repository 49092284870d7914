# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
Possible errors in parameters that break no rule: a wrong unit, a geometry that is singular.

All known hexapods are within the bounds with a margin, from one on a fingertip to the cabin of a
telescope on cables of 300 m; a value outside is a warning, not an error.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property, lru_cache, partial
from itertools import combinations
import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.legs.kind import AtHome
from stewart_dynamics.legs.lines import lines_from
from stewart_dynamics.mechanics import gravity_errors
from stewart_dynamics.mechanics.drives.drive_errors import drive_errors
from stewart_dynamics.mechanics.drives.motors import motor_ratio
from stewart_dynamics.mechanics.dynamics import lagrange
from stewart_dynamics.mechanics.frames.motion import listed, Motion
from stewart_dynamics.mechanics.kinematics.home_pose import (
    HEIGHTS, Home, home_legs, home_of, home_pose, is_too_long, poses_of, Shape, shape_of,
    turns_about)
from stewart_dynamics.mechanics.kinematics.joint_angles import JointAngles
from stewart_dynamics.mechanics.kinematics.joint_axes import AXES
from stewart_dynamics.mechanics.kinematics.pose_errors import find_typed_pose_error
from stewart_dynamics.mechanics.kinematics.symmetry import odd_joint
from stewart_dynamics.mechanics.limits import ANGLES, CLEARANCE_MIN, OF_JOINTS
from stewart_dynamics.mechanics.singularity_warning import UNSOLVABLE_CONDITION
from stewart_dynamics.parameters.circles import circle_names
from stewart_dynamics.parameters.table import (
    BY_IMU, DRIVE_INERTIAS, FIXED, inertia_matrix, NO_MASS, ONE_POINT, Parameters,
    STANDARD_GRAVITY)
from stewart_dynamics.possible_errors.bodies import IMPOSSIBLE_INERTIA, Moments, Part, PART_ERRORS
from stewart_dynamics.possible_errors.hypothesis import (
    find_errors, First, Hypothesis, lines_of, PossibleError, Six, Table, When)
from stewart_dynamics.possible_errors.transforms import best_order

# Digits of the position of a joint in a message.
_DIGITS = 5
_listed = partial(listed, digits=3)
_JOINTS = _BASE, _PLATFORM = 'geometry.base_joints', 'geometry.platform_joints'

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
# No ball joint or universal joint reaches this angle, 92 degrees [rad].
_WIDEST = 1.6
# A larger angle between a leg and its axis at home is a possible error [rad].
_AWAY = 0.5 * math.pi
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


class _Body(NamedTuple):
    """Platform or payload, in a hexapod with platform joints at a radius."""

    name: str
    mass: float  # [kg]
    moment: float  # the largest principal moment [kg m^2]
    radius: float  # [m]
    larger: float  # of both radii [m]

    @property
    def gyration(self) -> float:
        """Return the largest radius of gyration [m]."""
        return math.sqrt(max(self.moment, 0.0) / self.mass)


_SIZE = 'but the platform joints are {radius:.3g} m from their center'
_GYRATION = f'{{moment:.3g}} kg m^2 at most, a radius of gyration of {{gyration:.3g}} m, {_SIZE}'
_BODY: Table[_Body] = First(
    Hypothesis('{name}.inertia', lambda b: b.gyration - _LARGEST_GYRATION * b.larger, (
        f'{_GYRATION}: in g mm^2 or kg mm^2?')),
    When(lambda b: b.name == 'platform', First(
        Hypothesis('{name}.inertia', lambda b: _SMALLEST_GYRATION * b.radius - b.gyration, (
            f'{_GYRATION}: scaled twice, or the joints in mm?')),
        Hypothesis('{name}.mass', lambda b: (
            _SMALLEST_GYRATION_OF_A_MASS * b.radius - b.gyration), (
            '{mass:.6g} kg, with {name}.inertia a radius of gyration of {gyration:.3g} m, '
            f'{_SIZE}: in g, or the joints in cm?')))))


class _File:
    """A parameter file, with the numbers that several hypotheses need."""

    def __init__(self, p: Parameters) -> None:
        self.p, self.kind, self.leg, self.six = p, p.leg_kind, list(p.joints), Six(p)
        self.shape: Shape = shape_of(p)
        self.base, self.platform = self.shape.base_radius, self.shape.platform_radius
        self.larger = self.shape.radius
        self.points = {name: p[name] for name in _JOINTS}
        self.base_middle, self.middle = (each.mean(axis=0) for each in self.points.values())
        self.base_name, self.platform_name = (
            f'geometry.{body}_joints' if p[circle_names(body)[0]] is None else
            circle_names(body)[0] for body in ('base', 'platform'))
        self.angles_name = _BASE if p.geometry.base_angles is None else 'geometry.base_angles'
        self.mass, self.center = p.platform.mass, p.platform.center_of_mass
        self.cube = self.platform * self.platform * self.platform  # inf, where ** would raise
        self.gravity = float(np.linalg.norm(p.gravity))
        self.gravity_error = gravity_errors.find_gravity_error(p.gravity)
        self.weight = p.carried.mass * self.gravity
        self.force, self.rate = self.six['limits.force_max'], self.six['limits.velocity_max']
        self.friction = p.actuator.coulomb_friction
        self.low, self.high = (self.six[f'limits.length_{end}'] for end in ('min', 'max'))
        self.stroke = self.high - self.low
        self.texts = {name: _listed(np.unique(p[name])) for name in (
            'limits.force_max', 'limits.joint_force_max', 'limits.length_min',
            'limits.length_max', 'geometry.zero_length') if p[name] is not None}
        # Inertias of the rotors and of their loads.
        self.rotor = self.kind.fields['reflected_mass']
        self.reflected, reach = self.six[self.rotor], self.kind.reach(p)
        self.carried = (p.carried.mass + np.sum(p.legs.piston.mass)) / 6.0 * float(
            np.min(reach)) ** 2
        self.given = [each for each in (self.kind.rate_limit, self.kind.effort_limit, *_FRICTION)
                      if each in p.given]
        effort = self.six[self.kind.effort_limit]
        if p.drives and p.drive.torque_max is not None:
            effort = np.minimum(effort, motor_ratio(p) * p.drive.torque_max)
        self.acceleration = reach * effort / np.where(
            self.reflected.min() > 0.0, self.reflected, np.nan)  # of the rotors alone
        self.start = reach * np.nan_to_num(
            self.six[self.kind.rate_limit]) / self.acceleration
        # Largest acceleration of a leg with all its force, for a sixth of the platform.
        self.possible = np.full(6, _LARGEST_ACCELERATION / min(self.larger, 1.0))
        if self.weight <= self.force.sum():
            self.possible = np.minimum(self.possible, self.force / (
                p.carried.mass / 6.0 + p.legs.piston.mass + p.actuator.reflected_mass))
        self.needed = self.rate ** 2 / (2.0 * self.stroke)

    def body_errors(self) -> Iterator[PossibleError]:
        """Yield errors in masses and inertias of platform and payload."""
        for name, (mass, center, inertia) in (
                ('payload', self.p.payload.body),
                ('platform', (self.mass, self.center, self.p.platform.inertia))):
            if mass:
                moments = np.linalg.eigvalsh(inertia_matrix(inertia))
                yield from find_errors(_BODY, _Body(
                    name, mass, float(moments[2]), self.platform, self.larger))
                yield from find_errors(IMPOSSIBLE_INERTIA, Moments(
                    f'{name}.inertia', moments[None]))
                yield from self.far_point(f'{name}.center_of_mass', center)

    def far_point(self, name: str, point: Array) -> Iterator[PossibleError]:
        """Yield that a point of the platform frame is too far away for its unit."""
        away = float(np.linalg.norm(point - self.middle))
        if away > _FARTHEST_CENTER * self.larger:
            yield PossibleError(name, (
                f'{_listed(point)} m is {away:.3g} m from the middle of the platform joints, '
                f'{_SIZE.format(radius=self.platform)}: in mm?'))

    @cached_property
    def has_wrong_size(self) -> bool:
        """Return whether a size is in another unit, from which other errors would follow."""
        return any(find_errors(_SIZES, self))

    @property
    def which(self) -> str:
        """Return which base joints are at one point; nothing if none are."""
        reach = max(self.platform, np.abs(self.points[_BASE]).max())
        if self.base > ONE_POINT * reach:
            return ''
        at_one = np.ptp(self.points[_BASE], axis=0).max() <= ONE_POINT * reach
        return 'six' if at_one else f'{self.kind.anchors_are}, at the middle of their limits,'

    @cached_property
    def same_place(self) -> str:
        """Return the first two legs with a joint at the same place, and which, in words."""
        return next((f'{self.leg[i]} and {self.leg[j]} have the same place in {name}'
                     for name, joints in self.points.items() for i, j in combinations(range(6), 2)
                     if np.array_equal(joints[i], joints[j])), '')


_Of = Hypothesis[_File]


def _too_long(name: str) -> _Of:
    return _Of(name, lambda f: f.six[name] * is_too_long(f.p, name, f.shape), (
        f'{{six[{name}]:.3g}} m, but the joints are {{larger:.3g}} m from their center: in mm?'))


def _unlike_earth(error: str, words: str) -> _Of:
    return _Of('gravity', lambda f: f.gravity_error == error, (
        f'{{gravity:.6g}} m/s^2: {words} The earth has {-STANDARD_GRAVITY[2]:g}'))


def _too_weak(name: str) -> _Of:
    return _Of(name, lambda f: (
        f.weight > f.six[name].sum() and f.gravity_error != gravity_errors.IN_MM), (
        f'{{texts[{name}]}} N: six such legs cannot carry the platform, {{weight:.3g}} N: in kN?'))


_ONE_POINT: Table[_File] = _Of('{angles_name}', lambda f: len(f.which), (
    'all {which} are at one point: the legs hold the platform in no pose'))

_SIZES: Table[_File] = First(
    _Of('platform.mass', lambda f: f.mass < _NO_BODY * f.cube, (
        '{mass:.3g} kg stands for none: forces are those of a hexapod without masses: write the '
        'mass of the platform')), (
        _Of('{base_name}', lambda f: f.base > _LARGEST_RADIUS,
            '{base:.3g} m from their center: larger than any hexapod known: in mm?'),
        _Of('{platform_name}', lambda f: (
            f.platform > _SMALL_RADIUS and f.mass < _THINNEST * f.cube),
            '{platform:.3g} m from their center, and platform.mass only {mass:.3g} kg: in mm?'),
        _Of('{platform_name}', lambda f: (
            max(f.base, f.platform) > _LARGEST_RATIO * min(f.base, f.platform)), (
            '{platform:.3g} m from their center, the {kind.anchors_are} {base:.3g} m: one of them '
            'in mm?')),
        *map(_too_long, ('singularity.characteristic_length', 'geometry.zero_length',
                         'limits.length_min', 'limits.length_max'))))

_ROTORS: Table[_File] = First(
    _Of('{rotor}', lambda f: len(f.given) * (f.rotor not in f.p.given and not any(
        each in f.p.given for each in DRIVE_INERTIAS)), (
        'missing, but {given} is given: it is {kind.reflected} of {kind.rotors}; write 0.0 for a '
        'drive that has none')),
    _Of('{rotor}', lambda f: 0.0 < f.reflected.min() < _SMALLEST_REFLECTED_MASS * f.carried and (
        f.reflected == f.reflected.min()), (
        '{reflected:.3g} {kind.inertia_unit}, but each leg carries {carried:.3g} '
        '{kind.inertia_unit}: the inertia of the rotor? It is {kind.reflected}')),
    _Of('{rotor}', lambda f: np.where(
        f.start < _SHORTEST_START * min(f.larger, 1.0),
        f.acceleration - _LARGEST_ACCELERATION / min(f.larger, 1.0), np.nan), (
        '{reflected:.3g} {kind.inertia_unit}: {kind.effort_limit} alone would accelerate it by '
        '{acceleration:.3g} m/s^2, more than any motor: the inertia of the rotor in kg cm^2? It '
        'is {kind.reflected} in {kind.inertia_unit}')))

_LOADS: Table[_File] = (
    First(
        _Of('gravity', lambda f: f.gravity_error == gravity_errors.IN_MM,
            '{gravity:.6g} m/s^2: four times that of Jupiter: in mm/s^2?'),
        When(lambda f: f.p.base.source != BY_IMU, (
            _unlike_earth(gravity_errors.IN_G, 'in g?'),
            _unlike_earth(gravity_errors.NONE, 'none, as in orbit?')))),
    First(
        _Of('payload.mass', lambda f: f.mass * f.gravity <= f.force.sum() < f.weight, (
            '{p[payload.mass]:.3g} kg: six legs with limits.force_max, {texts[limits.force_max]} '
            'N, cannot carry it and the platform, {weight:.3g} N: in g?')),
        _too_weak('limits.force_max')),
    _too_weak('limits.joint_force_max'),
    When(lambda f: f.weight <= f.force.sum(), _Of(
        'actuator.coulomb_friction', lambda f: f.friction >= f.force,
        '{friction:.3g} N: {leg} cannot move with limits.force_max, {force:.3g} N: in mN?')),
    First(
        _Of('limits.velocity_max', lambda f: f.rate - _FASTEST * max(f.larger, 1.0),
            '{rate:.3g} m/s: in mm/s?'),
        _Of('limits.velocity_max', lambda f: f.needed / f.possible - _UNREACHABLE, (
            '{rate:.3g} m/s: reached within the stroke of {stroke:.3g} m with {needed:.3g} m/s^2 '
            'alone, possible are {possible:.3g}: in m/min or mm/s?'))),
    _Of('legs.cylinder.length', lambda f: f.six['legs.cylinder.length'] - f.low, (
        '{six[legs.cylinder.length]:.3g} m, but {leg} can be as short as limits.length_min, '
        '{low:.3g} m: in mm? It is the length from the base joint to the end of the cylinder')),
    When(lambda f: f.p.limits.leg_clearance_min is not None, _Of(
        CLEARANCE_MIN, lambda f: len(f.same_place), (
            f'{{p[{CLEARANCE_MIN}]:.3g}} m, but {{same_place}}: their clearance is never above '
            'zero; leave the limit out'))))

_NUMBERS: Table[_File] = (
    _SIZES, lambda f: f.body_errors(), _ROTORS, lambda f: drive_errors(f.p), _LOADS)


class _Assembled(_File):
    """A parameter file whose hexapod can be assembled, and its home pose."""

    def __init__(self, f: _File, home: Home) -> None:
        vars(self).update(vars(f))
        p = self.p
        self.home, self.longest, self.known = home, home.longest, home.length is not None
        self.away = self.shape.axes[2] * home.side  # from the base to the platform
        self.height = abs(float(home.heights[0]))
        self.limit, _, self.limits = ' and '.join(f'{name}: {self.texts[name]} m' for name in (
            'limits.length_min', 'limits.length_max') if name in self.texts).partition(': ')
        self.texts |= {'gravity': _listed(p.gravity), 'center': _listed(self.center),
                       'middle': _listed(self.middle.round(9))}
        # Whether points are in the frame of the other body.
        inertia, axes = inertia_matrix(p.platform.inertia), self.shape.axes[:2]
        self.across, self.about = (
            math.sqrt(max(float(np.linalg.eigvalsh(of @ inertia @ of.T)[0]), 0.0) / self.mass)
            for of in (axes, self.away[None]))  # smallest radii of gyration
        self.far = float(np.linalg.norm(self.center - self.middle))
        self.lengths = np.linalg.norm(self.points[_PLATFORM] - self.points[_BASE], axis=1)
        self.in_base_frame = self._is_center_in_base_frame()
        self.below = abs(float(self.center @ self.away) if self.in_base_frame else (
            self.height + float((self.center - self.middle) @ self.away)))
        self.odd = {name: odd for name, joints in self.points.items()
                    if (odd := odd_joint(joints)) is not None}
        self.turns = 0.5 * float(np.max(self.stroke / (self.high + self.low)))
        self.degrees = {name: np.degrees(self.six[name]) for name in OF_JOINTS}

    def _is_center_in_base_frame(self) -> bool:
        """Return whether the center of mass is where the platform is at home, base frame."""
        center = self.center - self.base_middle
        raised = float(center @ self.away) / self.height
        return bool(np.linalg.norm(self.middle) < 0.5 * np.linalg.norm(self.center) and (
            self.far > _FAR_FOR_BODY * self.across and (
                not self.known or _LOWEST < raised < _HIGHEST)
            or self.known and self.far > _APART * self.height
            and np.linalg.norm(center - self.height * self.away) < _AT_HOME * self.height))

    @property
    def joints_in_base_frame(self) -> bool:
        """
        Return whether the platform joints are likely given in the base frame.

        They are then where the legs have a possible length while both frames are the same. A base
        frame away from its joints may be where the platform frame is at home: this is no error.
        """
        if (float((self.middle - self.base_middle) @ self.away) < 0.5 * self.lengths.mean()
                or np.linalg.norm(self.middle) < np.linalg.norm(self.base_middle)):
            return False
        if np.isnan(self.stroke).any():  # a center of mass near the origin, and not in the joints
            return bool(self.far > _FAR_WHERE_JOINTS_ARE * self.across
                        and np.linalg.norm(self.center) < 0.5 * self.far)
        return bool(np.all((self.lengths > self.low) & (self.lengths < self.high)))

    @property
    def apart(self) -> str:
        """Return that the center of mass is not where the platform joints are, if so."""
        return '' if self.far < 0.5 * np.linalg.norm(self.middle) else (
            f', but platform.center_of_mass is {self.far:.3g} m away from it')

    @cached_property
    def efforts(self) -> Array | None:
        """Return the efforts of the drives (6,) for the weight at home; None: not known."""
        p, positions, rotations = self.p, self.home.positions, self.home.rotations
        jacobian = lagrange.drive_jacobian(
            lagrange.unchecked_legs(p, positions[:1], rotations[:1]), rotations[:1])[0]
        weight = p.carried.mass * p.gravity
        load = np.concatenate([weight, np.cross(rotations[0] @ p.carried.center, weight)])
        if not np.isfinite(jacobian).all() or np.linalg.cond(jacobian) > UNSOLVABLE_CONDITION:
            return None
        return np.asarray(np.linalg.solve(jacobian.T, load))

    @cached_property
    def torques(self) -> Array:
        """Return the torques of the motors that hold the platform at home (6,) [N m], or nan."""
        p = self.p
        if (not p.drives or not self.known or p.base.source == BY_IMU or self.efforts is None
                or any(what == 'drive.torque_max' for what, _ in drive_errors(p))):
            return np.full(6, np.nan)
        return np.asarray(np.abs(self.efforts) / motor_ratio(p) / p.drive.efficiency)

    @cached_property
    def of_kind(self) -> tuple[PossibleError, ...]:
        """Return errors in parameters that the kind of legs has alone."""
        if self.has_wrong_size or self.odd or not self.known:
            return ()
        loaded = self.p.base.source != BY_IMU and self.gravity_error != gravity_errors.IN_MM
        return tuple(self.kind.possible_errors(self.p, AtHome(
            self.home.positions[0], self.home.rotations[0], self.away, home_legs(self.p)['base'],
            self.efforts if loaded else None)))

    def symmetry(self) -> Iterator[PossibleError]:
        """Yield joints that break the symmetry of the others."""
        for name, odd in self.odd.items():
            joints = self.points[name]
            twins = [leg for n, leg in enumerate(self.leg)
                     if n != odd.joint and np.array_equal(joints[n], joints[odd.joint])]
            same = f', the same as {twins[0]}' if twins else ''
            yield PossibleError(name, (
                f'{self.leg[odd.joint]}: {listed(joints[odd.joint], _DIGITS)} m{same}: the other '
                f'five {odd.symmetry}, as all six would with {listed(odd.expected, _DIGITS)} m: a '
                'sign or a digit?'))

    def joint_axes(self) -> Iterator[PossibleError]:
        """Yield axes of joints from which legs are far away at home."""
        given = [axes for axes in AXES if self.p[axes] is not None]
        try:
            home = home_pose(self.p) if given else None
        except ParameterError:
            return
        if home is None:
            return  # the angles at home are zero
        angles = JointAngles(self.p, given)(Motion.from_pose(home).rows[None])[0]
        for axes, (limit, where) in zip(AXES, ANGLES.items(), strict=True):
            bounds, at_home = self.six[limit], angles[where]
            leg = int(np.argmax(at_home - np.nan_to_num(bounds)))
            if axes in given and at_home[leg] > _AWAY:
                yield PossibleError(axes, (
                    f'at home {self.leg[leg]} is {at_home[leg]:.3g} rad from it: does it point '
                    'from the platform to the base, is the platform on the other side of the base '
                    '(geometry.platform_side), or are the legs in another order?'))
            elif axes in given and at_home[leg] > bounds[leg]:
                yield PossibleError(limit, (
                    f'{bounds[leg]:.3g} rad, but at home {self.leg[leg]} is {at_home[leg]:.3g} '
                    f'rad from its axis in {axes}'))

    def singularity(self) -> Iterator[PossibleError]:
        """Yield that all poses that are tried, or home, are singular."""
        tried = [(height * side * self.larger, math.radians(yaw), tilt)
                 for height in HEIGHTS for side in (1.0, -1.0)
                 for yaw in (0.0, 20.0, -20.0, 45.0, -45.0) for tilt in (0.0, _TILT, -_TILT)]
        heights, angles, tilts = np.array(tried).T
        turned = turns_about(2, angles) @ turns_about(0, tilts) @ turns_about(1, 0.5 * tilts)
        stop = self.p.singularity.stop_condition
        for where, at, turns, suspected in (
                (f'every pose of {len(tried)} tried: the condition number is at least',
                 heights, turned,
                 'are base and platform joints similar hexagons, two legs the same,'),
                (f'home ({self.home.text}): the condition number is', self.home.heights,
                 self.home.turns, 'is the platform turned against the base there,')):
            best = float(_conditions(self.p, self.shape, at, turns).min())
            if best >= stop:
                kind = 'singular' if best >= UNSOLVABLE_CONDITION else 'nearly singular'
                yield PossibleError('geometry', (
                    f'{kind} at {where} {best:.3g}, singularity.stop_condition is {stop:g}: '
                    f'{suspected} or the joints in another order?'))
                return

    @cached_property
    def shorter(self) -> float:
        """Return squares of lengths in the best order by those given; keep it as ``order``."""
        turned = self.home.shape.platform @ self.home.turns[0].T
        base = (self.points[_BASE] - self.base_middle) @ self.home.shape.axes.T
        squares = ((base[:, None, :2] - turned[:, :2]) ** 2).sum(axis=-1)
        order, best = best_order(squares)
        self.order = str([leg + 1 for leg in order])
        return best / float(np.trace(squares))

    def part_errors(self) -> Iterator[PossibleError]:
        """Yield errors in masses of the legs' parts."""
        for part, joint in (('cylinder', 'base'), ('piston', 'platform')):
            of, name = self.p.legs.parts[part], f'legs.{part}.center_of_mass'
            # Behind the joint there may be a motor, but at most half a leg away from it.
            outside = (of.center_of_mass > self.longest) | (
                of.center_of_mass < -0.5 * self.longest)
            if outside.any():
                yield PossibleError(name, (
                    f'{of.center_of_mass[np.argmax(outside)]:.3g} m from the {joint} joint, but '
                    f'no leg is over {self.longest:.3g} m: in mm?'))
            elif part == 'piston' and of.center_of_mass.min() < -_BEHIND * self.longest:
                yield PossibleError(name, (
                    f'{of.center_of_mass.min():.3g} m: behind the platform joint: a sign? It '
                    'counts from this joint toward the base'))
            yield from find_errors(PART_ERRORS, Part(
                f'legs.{part}', of.mass, of.inertia, np.full(6, self.longest)))


_At = Hypothesis[_Assembled]


def _small_angle(name: str) -> _At:
    return _At(name, lambda f: f.six[name] * (f.six[name].max() < _SMALLEST_ANGLE * f.turns), (
        f'{{six[{name}]:.3g}} rad, {{degrees[{name}]:.2g}} degrees, but the strokes of the legs '
        'are enough to turn them by {turns:.2g} rad: converted from degrees twice?'))


def _wide_angle(name: str) -> _At:
    return _At(name, lambda f: f.six[name] - _WIDEST, (
        f'{{six[{name}]:.3g}} rad, {{degrees[{name}]:.0f}} degrees: more than any joint of a leg: '
        'in degrees?'))


_LEGS: Table[_Assembled] = First(  # later entries use the limits that earlier ones doubt
    _At('limits.length_min', lambda f: _SMALLEST_LENGTH_RATIO * f.high - f.low, (
        '{texts[limits.length_min]} m, limits.length_max: {texts[limits.length_max]} m: strokes? '
        'They are lengths from joint to joint')),
    _At('{limit}', lambda f: not f.home.reachable, (
        '{limits}: no level pose has all legs within them; the base joints are {base:.3g} m '
        'from their center, the platform joints {platform:.3g} m: different units?')),
    When(lambda f: not f.has_wrong_size, First(
        _At('limits.length_max', lambda f: f.six['geometry.zero_length'] - f.high, (
            '{texts[limits.length_max]} m, less than geometry.zero_length, '
            '{texts[geometry.zero_length]} m: a stroke? It is the length from joint to joint')),
        lambda f: f.part_errors())))

_FRAMES: Table[_Assembled] = (
    _At('{platform_name}', lambda f: f.platform - _LARGEST_PLATFORM_RATIO * f.base, (
        '{platform:.3g} m from their center, the {kind.anchors_are} only {base:.3g} m: base and '
        'platform exchanged?')),
    _At('gravity', lambda f: f.p.base.source == FIXED and gravity_errors.find_gravity_error(
        f.p.gravity, f.home) == gravity_errors.AWAY, (
        '{texts[gravity]} m/s^2 pulls the platform away from the base: a sign? For a hexapod that '
        'hangs, or whose axes point down, set geometry.platform_side')),
    _At(_PLATFORM, lambda f: f.joints_in_base_frame / f.lengths, (
        '{texts[middle]} m is their center, where it is in the base frame, legs of '
        '{lengths:.3g} m and more{apart}: are the joints given in the base frame? They are '
        'expected in the platform frame')),
    _At('platform.center_of_mass', lambda f: f.in_base_frame, (
        "{texts[center]} m is where the platform is at home in the base frame: from the base's "
        'origin? It is from that of the platform frame')),
    When(lambda f: f.known, _At('platform.inertia', lambda f: (
        f.across > 0.9 * f.below > 0.45 * f.height and f.about < 0.6 * f.across), (
        'radii of gyration of {across:.3g} m and more across the axis of the hexapod, {about:.3g} '
        'm about it, and the base is {below:.3g} m from the center of mass at home: about the '
        "base's origin? It is about the center of mass"))),
    _At('drive.torque_max', lambda f: f.torques / f.six['drive.torque_max'] - 1.0, (
        '{six[drive.torque_max]:.3g} N m: {leg} needs {torques:.3g} N m to hold the platform at '
        'rest at home: at another shaft, or in another unit?')),
    *map(_small_angle, OF_JOINTS))

_GEOMETRY: Table[_Assembled] = (
    _LEGS,
    When(lambda f: not f.has_wrong_size, _FRAMES),
    lambda f: f.of_kind,
    First(
        When(lambda f: len(f.odd) == 1, lambda f: f.symmetry()),
        When(lambda f: not f.has_wrong_size, (
            First(lambda f: f.singularity(), lambda f: f.symmetry(),
                  When(lambda f: not f.of_kind, _At(
                      _PLATFORM, lambda f: _OTHER_ORDER - f.shorter, (
                          'at home ({home.text}) the legs are shorter with the platform joints in '
                          'the order {order}: are the joints in another order?')))),
            *map(_wide_angle, OF_JOINTS),
            lambda f: f.joint_axes()))))


def _assembled_errors(f: _File) -> Iterator[PossibleError]:
    """Yield errors of the geometry, if home decides the assembly where the parameters do not."""
    home = home_of(f.p)
    try:
        f.p.choose_branch(lambda: (home.positions[0], home.rotations[0]))
    except ParameterError:
        return  # a StewartPlatform is not made of it
    yield from find_errors(_GEOMETRY, _Assembled(f, home))


@lru_cache(maxsize=4)  # the replay of many bags asks for each
def find_parameter_errors(parameters: Parameters, geometry: bool = True) -> tuple[str, ...]:
    """
    Return possible errors, each in one line: parameter, value, suspected error.

    geometry: check legs and poses as well, which takes ten times as long as the rest.
    """
    # All others would follow from the first two.
    table: Table[_File] = First(_ONE_POINT, lambda f: f.kind.wrong_sizes(
        f.p, home_legs(f.p)['base']), (_NUMBERS, When(lambda _: geometry, _assembled_errors)))
    # An overflow of numbers near the largest double is not reported by itself.
    with np.errstate(all='ignore'):
        return tuple(lines_of(find_errors(table, _File(parameters))))


def find_option_errors(
        p: Parameters, poses: Mapping[str, Sequence[float] | None],
        points: Mapping[str, Sequence[float] | None]) -> Iterator[str]:
    """
    Yield possible errors in poses and points that a user types, each in one line.

    poses: X Y Z ALPHA BETA GAMMA of each option [m, rad]; None if it is not given.
    points: X Y Z of each option in the platform frame [m].
    """
    for name, pose in poses.items():
        if pose is not None and (text := find_typed_pose_error(p, pose)):
            yield f'{name}: {listed(np.array(pose), _DIGITS)}: {text}'
    for name, point in points.items():
        if point is not None:
            yield from lines_of(_File(p).far_point(name, np.array(point)))


def _conditions(p: Parameters, shape: Shape, heights: Array, rotations: Array) -> Array:
    """Return condition numbers (N,) at these heights and turns, both in the shape's axes."""
    positions, rotations = poses_of(p, shape, heights, rotations)
    if not np.isfinite(positions).all():
        return np.full(len(heights), 1.0)
    matrices = lagrange.inverse_jacobian(lines_from(
        home_legs(p)['base'], p.geometry.platform_joints, positions, rotations))
    length = p.singularity.characteristic_length
    if is_too_long(p, 'singularity.characteristic_length', shape):
        length = shape.platform_radius  # reported already, and not an error of the geometry
    matrices[..., 3:] /= length
    matrices[~np.isfinite(matrices).all(axis=(-2, -1))] = np.zeros((6, 6))
    values = np.linalg.svd(matrices, compute_uv=False)
    conditions: Array = np.where(values[:, 5] > 0.0, values[:, 0] / values[:, 5], np.inf)
    return conditions
