# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Everything that is uncertain in a recording, as random numbers with the file's values as means.

These are all parameters of the hexapod, whether they are to be written or not, the tilt of gravity
and a gain of the efforts. Their standard deviations are those of ``uncertainty.*``; friction may
have any value up to a share of the weight, and so have numbers that are asked for and that the
file gives as 0.

The platform is described by mass, center of mass and inertia about it. Forces are linear in ten
inertial parameters that are functions of these, and in first and second moments and masses of the
parts of the legs. They are linear in gravity, too, ``f = Y theta + sum_i d_i G_i theta`` with the
change d of gravity and G_i the part of Y due to one unit of gravity along axis i, so products of
the change with the gravity-dependent parameters are further linear parameters, exact for a tilt
of any size.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Integers
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.estimation.uncertainty import root_of_covariance
from stewart_dynamics.legs import KINDS as LEG_KINDS
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.mechanics.dynamics.linear_parameters import (
    about_origin, BODY_UNITS, FIRST_MOMENT, inertial_derivative, inertial_parameters,
    linear_parameters, mass_places, names_of, parameter_values, Places, units_of)
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters import table
from stewart_dynamics.parameters.body import Body
from stewart_dynamics.parameters.table import DRIVE_INERTIAS, Parameters

# Platform parameters as defined in the parameter file.
_PLATFORM = ('platform.mass', *(f'platform.center_of_mass.{axis}' for axis in 'xyz'),
             *(f'platform.inertia.{axes[1:]}' for axes in table.INERTIA))
MASS, CENTER, INERTIA = slice(0, 1), slice(1, 4), slice(4, 10)
PLATFORM = 10

_OF_PLATFORM = {'mass': (MASS,), 'center_of_mass': (CENTER,), 'inertia': (INERTIA,),
                'platform': (MASS, CENTER, INERTIA)}
TILT = 'tilt'


@cache
def leg_values(kind: LegKind) -> dict[str, tuple[slice, ...]]:
    """Return the values that --identify accepts of a kind of legs, and where theta has them."""
    places, reflected = Places.of(kind), kind.fields['reflected_mass'].rpartition('.')[2]
    friction = places.viscous_friction, places.coulomb_friction
    return {
        **{part: tuple(mass_places(kind, each.name) for each in kind.masses
                       if each.part == part and each.acts) for part in kind.bodies},
        reflected: (places.reflected_mass,), 'viscous_friction': friction[:1],
        'coulomb_friction': friction[1:], 'friction': friction, 'offset': (places.offset,)}


KINDS = (*_OF_PLATFORM, *dict.fromkeys(sorted(
    (name for kind in LEG_KINDS for name in leg_values(kind)),
    key=lambda name: all(name in leg_values(kind) for kind in LEG_KINDS))), TILT)
"""Values that --identify accepts, those of one kind of legs alone before those of all."""
DEFAULT = ('platform', 'viscous_friction', 'coulomb_friction')

# Origins of the uncertainty: ``uncertainty.*``, friction, and offsets of the efforts.
ORIGINS = ('platform_mass', 'center_of_mass', 'inertia', 'leg_mass', 'reflected_mass', 'friction',
           'offset', 'tilt', 'effort_gain')
_OF_MASSES, _OF_ROTORS, _OF_FRICTION, _OF_OFFSETS = (
    ORIGINS.index(name) for name in ('leg_mass', 'reflected_mass', 'friction', 'offset'))


class Columns(NamedTuple):
    """The linear parameters of hexapods with a kind of legs that are uncertain."""

    linear: Integers  # those that act on efforts, among theta (m,)
    weighing: Integers  # among these, those whose efforts depend on gravity
    coulomb: Integers  # among these, Coulomb friction (6,)
    origins: Integers  # of each, among ORIGINS (m,)

    @classmethod
    @cache
    def of(cls, kind: LegKind) -> Columns:
        """Return those of a kind."""
        places = Places.of(kind)
        rest = [False] * (places.whole - places.masses.stop)
        acts, weighs = (np.repeat(flags, 6) for flags in (
            [each.acts for each in kind.masses], [each.weighs for each in kind.masses]))
        linear: Integers = np.flatnonzero(np.r_[[True] * PLATFORM, acts, np.logical_not(rest)])
        weighing = np.r_[np.arange(PLATFORM) < FIRST_MOMENT.stop, weighs, rest]
        origins = np.full(places.whole, _OF_MASSES)
        for origin, part in enumerate((MASS, CENTER, INERTIA)):
            origins[part] = origin
        for origin, part in ((_OF_ROTORS, places.reflected_mass), (_OF_OFFSETS, places.offset),
                             (_OF_FRICTION, places.viscous_friction),
                             (_OF_FRICTION, places.coulomb_friction)):
            origins[part] = origin
        return cls(linear, np.flatnonzero(weighing[linear]),
                   np.flatnonzero(np.isin(linear, np.r_[places.coulomb_friction])),
                   origins[linear])


_LEAST_MASS = 1e-9  # relative to the file's, where the prior judges it
# Acceleration at which the scale of inertial effects equals a leg's share of the weight [m/s^2].
_ACCELERATION = 10.0
# Rate at which the scale of friction equals that share, relative to sqrt(acceleration size).
_RATE = 0.1


class Tilt:
    """
    Gravity of the parameter file (3,) [m/s^2], rotated about two base axes.

    These are the two of x, y and z most perpendicular to gravity, which is rotated about the first
    of them, then about the second.
    """

    def __init__(self, gravity: Array) -> None:
        self._gravity = gravity
        self._axes = np.delete(np.arange(3), np.argmax(np.abs(gravity)))
        self.names = tuple(f'gravity.tilt_{"xyz"[axis]}' for axis in self._axes)

    def gravity(self, angles: Array) -> Array:
        """Return gravity, shape (3,), rotated by angles (2,) [rad]."""
        return self._turns(angles)[-1]

    def change(self, angles: Array) -> Array:
        """Return the difference (3,) of rotated gravity and the file's value."""
        return self.gravity(angles) - self._gravity

    def derivative(self, angles: Array) -> Array:
        """Return the (3, 2) derivative of rotated gravity by the angles."""
        first, second = self._axes
        _, once, twice = self._turns(angles)
        return np.stack([_turned(np.cross(np.eye(3)[first], once), second, angles[1]),
                         np.cross(np.eye(3)[second], twice)], axis=-1)

    def _turns(self, angles: Array) -> tuple[Array, Array, Array]:
        """Return gravity before, between and after the rotations."""
        once = _turned(self._gravity, self._axes[0], angles[0])
        return self._gravity, once, _turned(once, self._axes[1], angles[1])


class Unknowns:
    """
    The k uncertain numbers and their prior distribution; those of ``kinds`` are asked for.

    names, units: name and unit of each.
    start (k,): their means.
    root (k, k): they are ``start + root z`` with the k numbers z independent, of deviation 1.
    asked: indices of those that are identified; the others are uncertain as well, unless they
        are ``known`` (k,).
    origins (k,): for each z the index of its origin in ORIGINS.
    """

    def __init__(self, parameters: Parameters, kinds: Sequence[str] = DEFAULT,
                 known: Flags | None = None) -> None:
        self._parameters = p = parameters
        self._kind = kind = p.leg_kind
        self._check(kinds)
        self._theta, places = linear_parameters(p), Places.of(kind)
        self.columns = Columns.of(kind)
        linear = self.columns.linear
        self.count = len(linear)
        """Number of those in which efforts are linear; tilt and gain follow them."""
        # Known beside the platform: its ten parameters, zero without one.
        self._payload = inertial_parameters(p.payload.body)
        self.tilt = Tilt(p.gravity)
        names, units = names_of(p), units_of(p)
        self.names = (*_PLATFORM, *(names[n] for n in linear[PLATFORM:]), *self.tilt.names,
                      'effort_gain')
        self.units = (*BODY_UNITS, *(units[n] for n in linear[PLATFORM:]), 'rad', 'rad', '')
        self.start: Array = np.concatenate([
            [p.platform.mass], p.platform.center_of_mass, p.platform.inertia,
            self._theta[linear[PLATFORM:]], np.zeros(3)])
        asked = np.zeros(places.whole, dtype=bool)
        for name in kinds:
            for part in (*_OF_PLATFORM.get(name, ()), *leg_values(kind).get(name, ())):
                asked[part] = True
        self.asked: Integers = np.flatnonzero(np.concatenate([
            asked[linear], [TILT in kinds] * 2, [False]]))
        scales = _leg_scales(p)
        of_friction = np.isin(
            np.arange(places.whole), np.r_[places.viscous_friction, places.coulomb_friction])
        # Numbers that the file does not know at all count if they are asked for.
        level = root_of_covariance(
            p, p.platform.body, np.where(asked | of_friction, scales, 0.0))
        more = [p.uncertainty.tilt, p.uncertainty.tilt, p.uncertainty.effort_gain]
        self.root: Array = np.diag(np.concatenate([np.zeros(self.count), more]))
        self.root[:self.count, :self.count] = level[np.ix_(linear, linear)]
        if known is not None:
            self.root[known] = self.root[:, known] = 0.0
        self.origins: Integers = np.concatenate([self.columns.origins, [7, 7, 8]])

    def _check(self, kinds: Sequence[str]) -> None:
        """Raise ParameterError for a value of --identify that is one of other legs."""
        known = leg_values(self._kind)
        for name in kinds:
            if name not in (*_OF_PLATFORM, *known, TILT):
                raise ParameterError(
                    f'{self._parameters.source}: --identify {name}: not a part of '
                    f'{self._kind.name} legs: known are {", ".join(known)}')

    @property
    def inertial_units(self) -> Array:
        """Return units of the ten inertial parameters (10,), by the file's mass and size."""
        size = self._parameters.singularity.characteristic_length
        units: Array = self.start[0] * np.repeat([1.0, size, size ** 2], [1, 3, 6])
        return units

    @property
    def deviations(self) -> Array:
        """Return the (k,) prior standard deviations."""
        deviations: Array = np.sqrt(np.sum(self.root ** 2, axis=1))
        return deviations

    def misfit_of_mass(self, z: float) -> float:
        """Return the misfit that z^2 lacks: of a mass the logarithm of its ratio is judged."""
        part = self.root[0, 0] / self.start[0]
        if not part > 0.0:
            return 0.0
        return float((math.log(max(1.0 + part * z, _LEAST_MASS)) / part) ** 2 - z ** 2)

    def linear(self, values: Array) -> Array:
        """Return the parameters of the regressor, under level gravity."""
        theta = self._theta.copy()
        theta[self.columns.linear] = self._level(values)
        return theta

    def theta(self, values: Array) -> Array:
        """
        Return the linear parameters (n,) for values (k,).

        They are followed by the change of gravity along each axis times those that depend on it.
        """
        level = self._level(values)
        change = self.tilt.change(values[-3:-1])
        return np.concatenate([level, np.outer(change, level[self.columns.weighing]).ravel()])

    def derivative(self, values: Array) -> Array:
        """Return the derivative of ``theta`` with respect to the values, (n, k)."""
        d: Array = np.zeros((self.count, len(values)))
        weighing = self.columns.weighing
        d[:PLATFORM, :PLATFORM] = inertial_derivative(values[0], values[CENTER])
        d[PLATFORM:, PLATFORM:self.count] = np.eye(self.count - PLATFORM)
        angles = values[-3:-1]
        products = self.tilt.change(angles)[:, None, None] * d[weighing]
        products[..., -3:-1] += (self._level(values)[weighing, None]
                                 * self.tilt.derivative(angles)[:, None])
        return np.concatenate([d, products.reshape(-1, len(values))])

    def _level(self, values: Array) -> Array:
        """Return the linear parameters without those of the tilt."""
        level: Array = np.concatenate([
            self.inertial(values) + self._payload, values[PLATFORM:self.count]])
        return level

    def with_inertial(self, values: Array, ten: Array) -> Array:
        """Return values with these inertial parameters (10,) of the platform."""
        mass, center = ten[0], ten[1:4] / ten[0]
        changed = values.copy()
        changed[:PLATFORM] = mass, *center, *(ten[4:] - about_origin(mass, center, np.zeros(6)))
        return changed

    def inertial(self, values: Array) -> Array:
        """Return the platform's ten inertial parameters for values (k,)."""
        return inertial_parameters(Body(values[0], values[CENTER], values[INERTIA]))

    def not_negative(self) -> Integers:
        """Return the indices of leg parameters that cannot be negative."""
        of_legs = (self._kind.fields['reflected_mass'], 'actuator.viscous_friction',
                   'actuator.coulomb_friction',
                   *(each.name for each in self._kind.masses if each.positive))
        return np.array([n for n, name in enumerate(self.names)
                         if name.rpartition('.')[0] in of_legs], dtype=np.int64)

    def parameters(self, values: Array) -> Parameters:
        """Return the parameters with the asked ones of values (k,); ParameterError if invalid."""
        written = self.start.copy()
        written[self.asked] = values[self.asked]
        theta, of_masses = self._theta.copy(), Places.of(self._kind).masses
        theta[self.columns.linear] = self._level(written)
        theta[of_masses] = self._kind.with_hidden(
            self._parameters, theta[of_masses].reshape(-1, 6)).ravel()
        try:
            found = parameter_values(theta, self._parameters)
        except ParameterError as exc:
            raise ParameterError(f'what fits best is no machine: {exc}: identify less') from exc
        found |= {'platform.mass': written[0], 'platform.center_of_mass': written[CENTER],
                  'platform.inertia': written[INERTIA],
                  'gravity': self.tilt.gravity(written[-3:-1])}
        changed: dict[str, Any] = {
            name: value for name, value in found.items()
            if not _alike(value, self._kind.expanded(self._parameters, name))}
        if self._kind.fields['reflected_mass'] in changed:
            changed |= dict.fromkeys(DRIVE_INERTIAS)  # from which it would follow
        return self._parameters.replaced(changed, 'identified')


def regressor_of(platform: StewartPlatform, rows: Array, tilt: bool = True) -> Array:
    """
    Return the regressor (N, 6, n) of ``Unknowns.theta`` in motions (N, MOTION).

    Without the tilt it is that of the first ``Unknowns.count`` of them.
    """
    linear, weighing, *_ = Columns.of(platform.parameters.leg_kind)
    regressor: Array = platform.regressors(rows)[..., linear]
    return regressor if not tilt else np.concatenate([regressor, *(
        platform.regressors_at_rest(rows, axis[None])[..., linear[weighing]]
        for axis in np.eye(3))], axis=-1)


def _alike(value: Any, other: Any) -> bool:
    return bool(np.allclose(value, other, rtol=1e-9, atol=1e-12 * np.abs(other).max()))


def _turned(vector: Array, axis: int, angle: float) -> Array:
    """Return a vector (3,) rotated about x, y or z."""
    turned, (one, other) = vector.copy(), ((axis + 1) % 3, (axis + 2) % 3)
    cosine, sine = math.cos(angle), math.sin(angle)
    turned[one] = cosine * vector[one] - sine * vector[other]
    turned[other] = sine * vector[one] + cosine * vector[other]
    return turned


def _leg_scales(p: Parameters) -> Array:
    """Return sizes of the linear parameters at which they matter; only those of legs are set."""
    mass, size = p.carried.mass / 6.0, p.singularity.characteristic_length
    weight, rate = _ACCELERATION * mass, _RATE * math.sqrt(_ACCELERATION * size)
    kind, places = p.leg_kind, Places.of(p.leg_kind)
    reach, distance = kind.reach(p), kind.mass_distances(p)
    powers = {'kg': 0, 'kg m': 1, 'kg m^2': 2}
    scales: Array = np.zeros(places.whole)
    for each in kind.masses:
        if each.acts:
            scales[mass_places(kind, each.name)] = mass * distance ** powers[each.unit]
    scales[places.reflected_mass] = mass * reach ** 2
    scales[places.viscous_friction] = weight / rate * reach ** 2
    scales[places.coulomb_friction] = scales[places.offset] = weight * reach
    return scales
