# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Parameters to be identified, with the names and definitions of the parameter file.

The platform is described by mass, center of mass and inertia about it, so that unidentifiable
parameters keep the values of the file. Forces are linear in ten inertial parameters that are
functions of these. Leg parameters are linear themselves: mass, first and second moment of each
part. The tilt of gravity comes last: forces are linear in gravity,
``f = Y theta + sum_i d_i G_i theta`` with d the change of gravity and G_i the part of Y due to one
unit of gravity along axis i, so products of the change with the gravity-dependent parameters are
further linear parameters, exact for a tilt of any size.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Integers
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.dynamics.linear_parameters import (
    about_origin, BODY_UNITS, COULOMB_FRICTION, CYLINDER_FIRST, CYLINDER_MASS, CYLINDER_SECOND,
    FIRST_MOMENT, LINEAR, linear_parameters, names_of, OFFSET, parameter_values, PISTON_FIRST,
    PISTON_MASS, PISTON_SECOND, REFLECTED_MASS, UNITS, VISCOUS_FRICTION)
from stewart_dynamics.mechanics.kinematics.home_pose import turns_about
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters import table
from stewart_dynamics.parameters.table import DRIVE_INERTIAS, Parameters

# Platform parameters as defined in the parameter file.
_PLATFORM = ('platform.mass', *(f'platform.center_of_mass.{axis}' for axis in 'xyz'),
             *(f'platform.inertia.{axes[1:]}' for axes in table.INERTIA))
MASS, CENTER, INERTIA = slice(0, 1), slice(1, 4), slice(4, 10)
PLATFORM = 10

_OF_PLATFORM = {'mass': (MASS,), 'center_of_mass': (CENTER,), 'inertia': (INERTIA,),
                'platform': (MASS, CENTER, INERTIA)}
_OF_LEGS = {'cylinder': (CYLINDER_FIRST, CYLINDER_SECOND),
            'piston': (PISTON_MASS, PISTON_FIRST, PISTON_SECOND),
            'reflected_mass': (REFLECTED_MASS,), 'viscous_friction': (VISCOUS_FRICTION,),
            'coulomb_friction': (COULOMB_FRICTION,),
            'friction': (VISCOUS_FRICTION, COULOMB_FRICTION), 'offset': (OFFSET,)}
TILT = 'tilt'
KINDS = (*_OF_PLATFORM, *_OF_LEGS, TILT)  # values that --identify accepts
DEFAULT = ('platform', 'viscous_friction', 'coulomb_friction')

# Indices of the linear parameters whose forces depend on gravity.
_WEIGHING = np.concatenate([[0], *(np.arange(LINEAR)[part] for part in (
    FIRST_MOMENT, CYLINDER_FIRST, PISTON_MASS, PISTON_FIRST))])

# Scale of a tilt [rad].
_TILT = 0.1
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
        along = int(np.argmax(np.abs(gravity)))
        self._axes = [axis for axis in range(3) if axis != along]
        self.names = tuple(f'gravity.tilt_{"xyz"[axis]}' for axis in self._axes)

    def gravity(self, angles: Array) -> Array:
        """Return gravity, shape (3,), rotated by angles (2,) [rad]."""
        first, second = self._turns(angles)
        turned: Array = second @ first @ self._gravity
        return turned

    def change(self, angles: Array) -> Array:
        """Return the difference (3,) of rotated gravity and the file's value."""
        return self.gravity(angles) - self._gravity

    def derivative(self, angles: Array) -> Array:
        """Return the derivative of gravity with respect to the angles, (3, 2)."""
        first, second = self._turns(angles)
        about = np.eye(3)[self._axes]
        turned = first @ self._gravity
        return np.stack([second @ np.cross(about[0], turned),
                         np.cross(about[1], second @ turned)], axis=-1)

    def _turns(self, angles: Array) -> tuple[Array, Array]:
        first, second = (turns_about(axis, np.array([angle]))[0]
                         for axis, angle in zip(self._axes, angles, strict=True))
        return first, second


class Unknowns:
    """
    The k parameters to be identified: those of KINDS in ``kinds``.

    The file's parameters give the scales, and the values of all other parameters. ``prior`` is
    the standard error of the file's values by the scales; without it they do not count.

    names, units: name and unit of each parameter.
    start (k,): values from the file.
    scales (k,): relevant change of each parameter.
    linear (m,): indices of the LINEAR parameters that depend on them; the platform's ten come
        first.
    inertial_scales, linear_scales (10,), (m,): mass of the platform with powers of its size;
        scales of ``linear``.
    weighing (w,): elements of ``linear`` whose forces depend on gravity.
    legs: indices of the leg parameters: after the platform's, before the tilt.
    tilt: rotation of gravity; None: not to be identified.
    strength (k, k): information of the file's values; zero without a prior.
    """

    def __init__(self, parameters: Parameters, kinds: Sequence[str] = DEFAULT,
                 prior: float | None = None) -> None:
        self._parameters = p = parameters
        self._theta = linear_parameters(p)
        of_platform = np.zeros(PLATFORM, dtype=bool)
        of_legs: Flags = np.zeros(LINEAR, dtype=bool)
        for kind in kinds:
            for part in _OF_PLATFORM.get(kind, ()):
                of_platform[part] = True
            for part in _OF_LEGS.get(kind, ()):
                of_legs[part] = True
        self._platform: Integers = np.flatnonzero(of_platform)
        legs: Integers = np.flatnonzero(of_legs)
        self.linear: Integers = np.concatenate([np.arange(PLATFORM), legs])
        self.weighing: Integers = self.linear[np.isin(self.linear, _WEIGHING)]
        self.legs = range(len(self._platform), len(self._platform) + len(legs))
        self.tilt = Tilt(p['gravity']) if TILT in kinds else None
        of_tilt = () if self.tilt is None else self.tilt.names
        names = names_of(p)
        self.names = (
            *(_PLATFORM[n] for n in self._platform), *(names[n] for n in legs), *of_tilt)
        self.units = (*(BODY_UNITS[n] for n in self._platform), *(UNITS[n] for n in legs),
                      *len(of_tilt) * ['rad'])
        self._of_file: Array = np.concatenate([
            [p['platform.mass']], p['platform.center_of_mass'], p['platform.inertia']])
        self.start: Array = np.concatenate(
            [self._of_file[self._platform], self._theta[legs], np.zeros(len(of_tilt))])
        self.scales: Array = np.concatenate([
            _platform_scales(p)[self._platform], _leg_scales(p)[legs],
            np.full(len(of_tilt), _TILT)])
        self.strength: Array = np.diag(
            np.zeros(len(self.scales)) if prior is None else (prior * self.scales) ** -2.0)
        mass, size = p['platform.mass'], _size(p)
        self.inertial_scales: Array = mass * np.repeat([1.0, size, size ** 2], [1, 3, 6])
        self.linear_scales: Array = np.concatenate([self.inertial_scales, _leg_scales(p)[legs]])

    @property
    def many_of_platform(self) -> int:
        """Return the number of platform parameters; they come first."""
        return len(self._platform)

    @property
    def fixed(self) -> Array:
        """Return the linear parameters (LINEAR,) with zeros where they depend on the unknowns."""
        theta = self._theta.copy()
        theta[self.linear] = 0.0
        return theta

    def theta(self, values: Array) -> Array:
        """
        Return the linear parameters (n,) for values (k,): the m parameters ``linear``.

        With the tilt, the change of gravity along each axis times ``weighing``, and times 1 for
        the fixed parameters, is appended: n = m + 3 (w + 1).
        """
        theta = self._level(values)
        if self.tilt is None:
            return theta
        change = self.tilt.change(values[self.legs.stop:])
        return np.concatenate([theta, np.outer(change, self._carried(theta)).ravel()])

    def derivative(self, values: Array) -> Array:
        """Return the derivative of ``theta`` with respect to the values, (n, k)."""
        d: Array = np.zeros((len(self.linear), len(values)))
        d[:PLATFORM, :self.many_of_platform] = _inertial_derivative(
            self._whole(values))[:, self._platform]
        d[PLATFORM:, self.legs] = np.eye(len(self.legs))
        if self.tilt is None:
            return d
        angles = values[self.legs.stop:]
        weighs = np.isin(self.linear, self.weighing)
        of_carried = np.concatenate([d[weighs], np.zeros((1, len(values)))])
        products = self.tilt.change(angles)[:, None, None] * of_carried
        products[..., self.legs.stop:] += (
            self._carried(self._level(values))[:, None] * self.tilt.derivative(angles)[:, None])
        return np.concatenate([d, products.reshape(-1, len(values))])

    def _level(self, values: Array) -> Array:
        """Return the parameters ``linear`` (m,)."""
        theta: Array = np.concatenate([_inertial(self._whole(values)), values[self.legs]])
        return theta

    def _carried(self, theta: Array) -> Array:
        """Return the factors (w + 1,) of the change of gravity."""
        return np.append(theta[np.isin(self.linear, self.weighing)], 1.0)

    def with_inertial(self, values: Array, ten: Array) -> Array:
        """Return values with these inertial parameters (10,), as far as they are unknowns."""
        mass, center = ten[0], ten[1:4] / ten[0]
        inertia = ten[4:] - about_origin(mass, center, np.zeros(6))
        changed = values.copy()
        changed[:self.many_of_platform] = np.concatenate(
            [[mass], center, inertia])[self._platform]
        return changed

    def inertial(self, values: Array) -> Array:
        """Return the platform's ten inertial parameters for values (k,)."""
        return _inertial(self._whole(values))

    def not_negative(self) -> Integers:
        """Return the indices of leg parameters that cannot be negative."""
        ends = ('.mass.', '.second_moment.', 'reflected_mass.', '_friction.')
        return np.array([n for n, name in enumerate(self.names) if n >= self.many_of_platform
                         and any(end in f'{name}.' for end in ends)], dtype=np.int64)

    def parameters(self, values: Array) -> Parameters:
        """Return the parameters with these values (k,); raise ParameterError if invalid."""
        theta = self._theta.copy()
        theta[self.linear] = self._level(values)
        theta[CYLINDER_MASS] = self._masses_of_cylinders(theta)
        try:
            found = parameter_values(theta, self._parameters)
        except ParameterError as exc:
            raise ParameterError(f'what fits best is no machine: {exc}: identify less') from exc
        platform = self._whole(values)
        found |= {'platform.mass': platform[0], 'platform.center_of_mass': platform[CENTER],
                  'platform.inertia': platform[INERTIA]}
        if self.tilt is not None:
            found['gravity'] = self.tilt.gravity(values[self.legs.stop:])
        changed: dict[str, Any] = {name: value for name, value in found.items()
                                   if not _alike(value, self._parameters[name])}
        if 'actuator.reflected_mass' in changed:
            changed |= dict.fromkeys(DRIVE_INERTIAS)  # from which it would follow
        return self._parameters.replaced(changed, 'identified')

    def _masses_of_cylinders(self, theta: Array) -> Array:
        """Return cylinder masses (6,) consistent with the moments; they do not affect forces."""
        first, second = theta[CYLINDER_FIRST], theta[CYLINDER_SECOND]
        least = np.divide(first ** 2, second, out=np.zeros(6), where=second > 0.0)
        return np.where(theta[CYLINDER_MASS] * second < first ** 2, 1.0001 * least,
                        theta[CYLINDER_MASS])

    def _whole(self, values: Array) -> Array:
        whole = self._of_file.copy()
        whole[self._platform] = values[:self.many_of_platform]
        return whole


def regression(platform: StewartPlatform, unknowns: Unknowns, rows: Array) -> tuple[Array, Array]:
    """
    Return the regressor (N, 6, n) of ``unknowns.theta`` and the known forces (N, 6) [N].

    They are those of a platform with the parameters of the file, in motions (N, MOTION).
    """
    matrix, fixed = platform.regressors(rows), unknowns.fixed
    regressor: Array = matrix[..., unknowns.linear]
    known: Array = matrix @ fixed
    if unknowns.tilt is not None:
        parts = [regressor]
        for axis in np.eye(3):
            matrix = platform.regressors_at_rest(rows, axis[None])
            parts += [matrix[..., unknowns.weighing], (matrix @ fixed)[..., None]]
        regressor = np.concatenate(parts, axis=-1)
    return regressor, known


def _alike(value: Any, other: Any) -> bool:
    return bool(np.allclose(value, other, rtol=1e-9, atol=1e-12 * np.abs(other).max()))


def _inertial(platform: Array) -> Array:
    """Return the ten inertial parameters from mass, center of mass and inertia about it."""
    mass, center, inertia = platform[0], platform[CENTER], platform[INERTIA]
    ten: Array = np.concatenate([[mass], mass * center, about_origin(mass, center, inertia)])
    return ten


def _inertial_derivative(platform: Array) -> Array:
    mass, center = platform[0], platform[CENTER]
    d = np.zeros((10, 10))
    d[0, 0] = 1.0
    d[CENTER, 0], d[CENTER, CENTER] = center, mass * np.eye(3)
    d[INERTIA, 0] = about_origin(1.0, center, np.zeros(6))
    for axis in range(3):
        # c . c 1 - c c^T
        unit = np.eye(3)[axis]
        change = mass * (2.0 * center[axis] * np.eye(3) - np.outer(unit, center)
                         - np.outer(center, unit))
        d[INERTIA, 1 + axis] = change[np.triu_indices(3)]
    d[INERTIA, INERTIA] = np.eye(6)
    return d


def _size(p: Parameters) -> float:
    return float(p['singularity.characteristic_length'])


def _platform_scales(p: Parameters) -> Array:
    mass, size = p['platform.mass'], _size(p)
    return np.array([mass, *3 * [0.5 * size], *6 * [0.25 * mass * size ** 2]])


def _leg_scales(p: Parameters) -> Array:
    """Return scales of the linear parameters; only the leg parameters are set."""
    mass, length = p['platform.mass'] / 6.0, 2.0 * _size(p)
    weight, rate = _ACCELERATION * mass, _RATE * np.sqrt(_ACCELERATION * _size(p))
    scales: Array = np.empty(LINEAR)
    scales[PISTON_MASS] = scales[REFLECTED_MASS] = mass
    scales[CYLINDER_FIRST] = scales[PISTON_FIRST] = mass * length
    scales[CYLINDER_SECOND] = scales[PISTON_SECOND] = mass * length ** 2
    scales[VISCOUS_FRICTION] = weight / rate
    scales[COULOMB_FRICTION] = scales[OFFSET] = weight
    return scales
