# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Telescopic legs, with guided screws or screws that turn with them: ``core/telescopic.h``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stewart_dynamics.arrays import Array, Records
from stewart_dynamics.legs.kind import HomeLegs, LegKind, LegMass, Named

if TYPE_CHECKING:
    from stewart_dynamics.parameters.table import Parameters


class Telescopic(LegKind):
    """Legs of a cylinder and a piston, whose drives change their lengths."""

    name = 'telescopic'
    position = Named('length', 'lengths', 'm')
    rate = Named('rate', 'rates', 'm/s', '+ extends')
    effort = Named('force', 'forces', 'N', '+ pushes')
    commands = 'forces'
    ratio = 'actuator.screw_lead'
    own = ('legs.cylinder.', 'legs.piston.', 'actuator.reflected_mass', 'actuator.screw_lead',
           'geometry.zero_length', 'geometry.base_joint_axes', 'geometry.base_outline',
           'geometry.platform_outline', 'limits.length_', 'limits.velocity_max',
           'limits.force_max', 'limits.joint_force_max', 'limits.base_joint_angle_max',
           'limits.leg_clearance_min', 'drive.screw_', 'drive.base_universal_axes',
           'drive.platform_universal_axes')
    fields = {
        'zero_length': 'geometry.zero_length', 'cylinder_mass': 'legs.cylinder.mass',
        'cylinder_center_of_mass': 'legs.cylinder.center_of_mass',
        'cylinder_inertia': 'legs.cylinder.inertia', 'piston_mass': 'legs.piston.mass',
        'piston_center_of_mass': 'legs.piston.center_of_mass',
        'piston_inertia': 'legs.piston.inertia', 'reflected_mass': 'actuator.reflected_mass',
        'cylinder_radius': 'legs.cylinder.radius', 'cylinder_length': 'legs.cylinder.length',
        'piston_radius': 'legs.piston.radius'}
    masses = tuple(LegMass(f'legs.{part}.{name}', unit) for part in ('cylinder', 'piston')
                   for name, unit in (('mass', 'kg'), ('first_moment', 'kg m'),
                                      ('second_moment', 'kg m^2')))
    massless = {
        'legs.cylinder.mass': 0.0, 'legs.cylinder.inertia': 0.0, 'legs.piston.mass': 0.0,
        'legs.piston.inertia': 0.0, 'actuator.reflected_mass': 0.0, 'drive.motor_inertia': None,
        'drive.screw_inertia': None}
    inertia_unit = 'kg'
    home_rule = ('limits.length_min and limits.length_max, or geometry.zero_length, must give a '
                 'length that the legs can have in a level pose')
    friction_units = 'N s/m', 'N'

    def write_fields(self, legs: Records, parameters: Parameters) -> None:
        """Write nothing: all fields hold parameters as they are."""

    def mass_values(self, parameters: Parameters) -> Array:
        """Return mass, first and second moment of cylinders and pistons (6, 6)."""
        return np.stack([row for part in parameters.legs.parts.values() for row in (
            part.mass, part.mass * part.center_of_mass,
            part.inertia + part.mass * part.center_of_mass ** 2)])

    def home_legs(self, parameters: Parameters) -> HomeLegs:
        """Return the legs, with the mean one halfway between its limits or of zero length."""
        low, high = parameters.limits.length_min, parameters.limits.length_max
        length = float(np.mean(parameters.geometry.zero_length if low is None or high is None
                               else 0.5 * (low + high)))
        return HomeLegs(parameters.geometry.base_joints, low, high, length)


TELESCOPIC = Telescopic()
