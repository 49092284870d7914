# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The parameters in which efforts are linear, theta (n,): their order, their names, both ways.

Platform and payload have ten: mass, first moment m c, inertia about the platform's origin (not
about the center of mass). Those of the legs are ``LegKind.masses``; telescopic ones have three for
each part: mass m, first moment m S, second moment I + m S^2 about its joint (cylinder: base joint,
piston: platform joint). Each actuator has reflected mass, viscous and Coulomb friction; each
measured effort has a constant offset, which is zero in every parameter file.

Each of them is one number per leg: ``theta[places.viscous_friction]`` are six numbers. Not all act
on efforts, and some have the same effect: the mass of a cylinder, the second moments of both parts
of a telescopic leg.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.mechanics.rows import consecutive
from stewart_dynamics.parameters.body import Body
from stewart_dynamics.parameters.table import Parameters

PLATFORM = slice(0, 10)
# Indices of the ten parameters of the platform.
MASS, FIRST_MOMENT, INERTIA = 0, slice(1, 4), slice(4, 10)

_OF_PLATFORM = {  # names and units
    'platform.mass': 'kg', **{f'platform.first_moment.{axis}': 'kg m' for axis in 'xyz'},
    **{f'platform.inertia_about_origin.{axes}': 'kg m^2'
       for axes in ('xx', 'xy', 'xz', 'yy', 'yz', 'zz')}}

# Units of a body as a parameter file has it: mass, center of mass, inertia about it.
BODY_UNITS = ('kg', *3 * ['m'], *6 * ['kg m^2'])


def names_of(p: Parameters) -> tuple[str, ...]:
    """Return the names of the parameters; names of leg parameters end with the leg's name."""
    of_legs = [*(each.name for each in p.leg_kind.masses), *_of_drives(p)]
    return (*_OF_PLATFORM, *(f'{name}.{leg}' for name in of_legs for leg in p.joints))


def units_of(p: Parameters) -> tuple[str, ...]:
    """Return the unit of each parameter."""
    of_legs = [*(each.unit for each in p.leg_kind.masses), *_of_drives(p).values()]
    return (*_OF_PLATFORM.values(), *(unit for unit in of_legs for _ in range(6)))


def _of_drives(p: Parameters) -> dict[str, str]:
    """Return the parameters of drives in which efforts are linear, with their units."""
    kind, (viscous, coulomb) = p.leg_kind, p.leg_kind.friction_units
    return {kind.fields['reflected_mass']: kind.inertia_unit,
            'actuator.viscous_friction': viscous, 'actuator.coulomb_friction': coulomb,
            'effort_offset': kind.effort.unit}


class Places(NamedTuple):
    """Where theta has the numbers of the legs and drives of a kind."""

    masses: slice  # (6 n) those of ``LegKind.masses``
    reflected_mass: slice
    viscous_friction: slice
    coulomb_friction: slice
    offset: slice

    @property
    def whole(self) -> int:
        """Return the number of parameters."""
        end: int = self.offset.stop
        return end

    @classmethod
    def of(cls, kind: LegKind) -> Places:
        """Return the places of a kind."""
        return cls(*consecutive(PLATFORM.stop, 6 * len(kind.masses), *4 * [6])[1:])


def mass_places(kind: LegKind, name: str) -> slice:
    """Return where theta has the six numbers of one of ``LegKind.masses``."""
    first = PLATFORM.stop + 6 * [each.name for each in kind.masses].index(name)
    return slice(first, first + 6)


def linear_parameters(p: Parameters) -> Array:
    """Return theta (n,) of a hexapod, SI units."""
    of_drives = [p[name] for name in _of_drives(p) if name in p]
    return np.concatenate([inertial_parameters(p.carried), p.leg_kind.mass_values(p).ravel(),
                           *of_drives, np.zeros(6)])


def parameter_values(theta: Array, p: Parameters) -> dict[str, Any]:
    """
    Return the values of theta under the names of a parameter file, offsets left out.

    theta (n,): parameters of a hexapod, SI units.
    p: source of the payload, and of numbers that theta does not contain, such as the center of
        mass of each part of a leg without mass.
    Raises ParameterError: no body has these parameters: a mass is not positive, or a part of a leg
        has moments without mass or a negative inertia about its center of mass.
    """
    if p.payload.mass > 0.0:
        theta = theta.copy()
        theta[PLATFORM] -= inertial_parameters(p.payload.body)
    mass = float(theta[MASS])
    if not mass > 0.0:
        raise ParameterError(f'platform.mass: {mass:g} kg: must be more than 0')
    center = theta[FIRST_MOMENT] / mass
    values: dict[str, Any] = {
        'platform.mass': mass, 'platform.center_of_mass': center,
        'platform.inertia': theta[INERTIA] - about_origin(mass, center, np.zeros(6))}
    kind, places = p.leg_kind, Places.of(p.leg_kind)
    of_drives = places.reflected_mass, places.viscous_friction, places.coulomb_friction
    return values | kind.mass_parameters(p, theta[places.masses].reshape(-1, 6)) | {
        name: theta[where].copy() for name, where in zip(
            _of_drives(p), of_drives, strict=False)}


def inertial_parameters(body: Body) -> Array:
    """Return mass, first moment and inertia about the origin (10,) of a body on the platform."""
    return np.concatenate([[body.mass], body.mass * body.center, about_origin(*body)])


def about_origin(mass: float, center: Array, inertia: Array) -> Array:
    """Return ixx ixy ixz iyy iyz izz about the origin, given about a center of mass (6,)."""
    six: Array = inertia + 0.5 * mass * point_inertia_derivative(center) @ center
    return six


def point_inertia_derivative(point: Array) -> Array:
    """Return the derivative (6, 3) of the inertia of a mass of 1 at a point, by the point."""
    x, y, z = point
    return np.array([[0.0, 2.0 * y, 2.0 * z], [-y, -x, 0.0], [-z, 0.0, -x],
                     [2.0 * x, 0.0, 2.0 * z], [0.0, -z, -y], [2.0 * x, 2.0 * y, 0.0]])


def inertial_derivative(mass: float, center: Array) -> Array:
    """Return the derivative (10, 10) of ``inertial_parameters`` by mass, center and inertia."""
    matrix = np.eye(10)
    coupling = point_inertia_derivative(center)
    matrix[FIRST_MOMENT, MASS], matrix[INERTIA, MASS] = center, 0.5 * coupling @ center
    matrix[FIRST_MOMENT, FIRST_MOMENT] *= mass
    matrix[INERTIA, FIRST_MOMENT] = mass * coupling
    return matrix


def with_point_mass(p: Parameters, added: float, position: ArrayLike) -> Parameters:
    """Return the parameters with a point mass [kg] on the platform, platform frame (3,) [m]."""
    point = Body(added, np.array(position, dtype=float), np.zeros(6))
    return p.with_payload(p.payload.body.with_body(point) if p.payload.mass > 0.0 else point)
