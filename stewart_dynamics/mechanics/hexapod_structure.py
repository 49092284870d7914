# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""A hexapod as the C library takes it: the structure ``stewart_platform`` of parameters."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Array, Records
from stewart_dynamics.core.binding import record
from stewart_dynamics.mechanics.drives.turning_screws import motor_turns, screw_constants
from stewart_dynamics.mechanics.rows import BASE_AXIS, PLATFORM_AXIS
from stewart_dynamics.parameters.table import Parameters, SUPPRESS_FORCES

# Fields of stewart_leg and stewart_platform in their order, and the parameters that they hold; the
# other fields of a leg are its limits.
_OF_LEG = {
    'base_joint': 'geometry.base_joints', 'platform_joint': 'geometry.platform_joints',
    'zero_length': 'geometry.zero_length', 'cylinder_mass': 'legs.cylinder.mass',
    'cylinder_center_of_mass': 'legs.cylinder.center_of_mass',
    'cylinder_inertia': 'legs.cylinder.inertia', 'piston_mass': 'legs.piston.mass',
    'piston_center_of_mass': 'legs.piston.center_of_mass',
    'piston_inertia': 'legs.piston.inertia', 'reflected_mass': 'actuator.reflected_mass',
    'viscous_friction': 'actuator.viscous_friction',
    'coulomb_friction': 'actuator.coulomb_friction',
    'coulomb_velocity': 'actuator.coulomb_velocity',
    'base_joint_axis': 'geometry.base_joint_axes',
    'platform_joint_axis': 'geometry.platform_joint_axes',
    'cylinder_radius': 'legs.cylinder.radius', 'cylinder_length': 'legs.cylinder.length',
    'piston_radius': 'legs.piston.radius', 'screw_lead': 'actuator.screw_lead',
    'gear_ratio': 'drive.gear_ratio', 'efficiency': 'drive.efficiency',
    'back_driving_efficiency': 'drive.back_driving_efficiency',
    'twist_ratio': 'drive.screw_rotation', 'base_universal_axis': 'drive.base_universal_axes',
    'platform_universal_axis': 'drive.platform_universal_axes'}
LEG_FIELDS = {field: _OF_LEG.get(field, f'limits.{field}')
              for field in record('stewart_leg').names or ()}
FIELDS_BEFORE_LEGS = {
    'gravity': 'gravity', 'mass': 'platform.mass', 'center_of_mass': 'platform.center_of_mass',
    'inertia': 'platform.inertia'}
FIELDS_AFTER_LEGS = {
    'leg_clearance_min': 'limits.leg_clearance_min',
    'characteristic_length': 'singularity.characteristic_length',
    'warn_condition': 'singularity.warn_condition', 'stop_condition': 'singularity.stop_condition',
    'warn_time': 'singularity.warn_time', 'sync_tolerance': 'setpoint.sync_tolerance',
    'suppress_near_singularity': 'singularity.action', 'suppress_at_limits': 'limits.action'}
_OF_PLATFORM = {**FIELDS_BEFORE_LEGS, **FIELDS_AFTER_LEGS}
_IF_NOT_SET = {'limits.length_min': 0.0, 'limits.leg_clearance_min': -math.inf}


def field_values(parameters: Parameters, screws: Array | None = None) -> dict[str, Any]:
    """
    Return the value of each field under the name of its parameter.

    An array for the fields of the legs, (6,) or (6, 3). A limit that is not set is infinite, a
    length or radius that is not set zero; so are axes of joints, which ``joint_angles`` has, and
    of universal joints where screws are guided. ``platform.*`` are platform and payload.
    ``drive.screw_rotation`` is the turn of the motor for a turn of its leg. ``screws`` (6, SCREW)
    are those of ``screw_constants``.
    """
    values: dict[str, Any] = {}
    for name in (*FIELDS_BEFORE_LEGS.values(), *LEG_FIELDS.values(), *FIELDS_AFTER_LEGS.values()):
        value = parameters[name]
        if value is None:
            value = _IF_NOT_SET.get(name, math.inf if name.startswith('limits.') else 0.0)
        values[name] = int(value == SUPPRESS_FORCES) if isinstance(value, str) else value
    screws = screw_constants(parameters) if screws is None else screws
    values['geometry.base_joint_axes'] = values['geometry.platform_joint_axes'] = np.zeros((6, 3))
    values['drive.screw_rotation'] = motor_turns(parameters)
    values['drive.base_universal_axes'] = screws[:, BASE_AXIS]
    values['drive.platform_universal_axes'] = screws[:, PLATFORM_AXIS]
    (values['platform.mass'], values['platform.center_of_mass'],
     values['platform.inertia']) = parameters.carried
    for name in LEG_FIELDS.values():
        if np.ndim(values[name]) < 1:
            values[name] = np.full(6, values[name])
    return values


def hexapod_structure(parameters: Parameters, screws: Array | None = None) -> Records:
    """Return the structure () of a hexapod; ``screws`` as for ``field_values``."""
    values = field_values(parameters, screws)
    structure = np.zeros((), record('stewart_platform'))
    for field, name in _OF_PLATFORM.items():
        structure[field] = values[name]
    for field, name in LEG_FIELDS.items():
        structure['legs'][field] = values[name]
    return structure
