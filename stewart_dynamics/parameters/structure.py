# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The structure ``stewart_platform`` of a parameter file, and the rules that it keeps.

All but the axes of joints, which may follow from the home pose: ``mechanics.hexapod_structure``
adds them. Derived numbers are those of ``stewart_complete``, rules those of ``stewart_check``.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any, TYPE_CHECKING

import numpy as np

from stewart_dynamics.arrays import Array, Records
from stewart_dynamics.core.binding import (
    function, KINDS, LIMIT_ROWS, LimitRow, record, Rule, RULES)

if TYPE_CHECKING:
    from stewart_dynamics.parameters.table import Parameters


def limit_name(row: LimitRow) -> str:
    """Return the parameter of a limit of the legs; in C its name may begin with a kind of legs."""
    group, name = 'drive' if row.depends == 'MOTOR' else 'limits', row.field
    for kind in KINDS:
        name = name.removeprefix(f'{kind.lower()}_')
    return f'{group}.{name}'


LEG_FIELDS: Mapping[str, str] = {
    'base_joint': 'geometry.base_joints', 'platform_joint': 'geometry.platform_joints',
    'viscous_friction': 'actuator.viscous_friction',
    'coulomb_friction': 'actuator.coulomb_friction',
    'coulomb_velocity': 'actuator.coulomb_velocity',
    **{row.field: limit_name(row) for row in LIMIT_ROWS}, 'screw_lead': 'actuator.screw_lead',
    **{name: f'drive.{name}' for name in (
        'gear_ratio', 'efficiency', 'back_driving_efficiency', 'motor_inertia', 'screw_inertia',
        'torque_constant', 'resistance', 'thermal_resistance', 'thermal_time_constant')},
    **{f'{end}_joint_axis': f'geometry.{end}_joint_axes' for end in ('base', 'platform')},
    **{f'{end}_universal_axis': f'drive.{end}_universal_axes' for end in ('base', 'platform')}}
"""Fields of ``stewart_leg`` and the parameters that they hold; others follow from these, or are
fields of a kind of legs."""
PLATFORM_FIELDS: Mapping[str, str] = {
    'gravity': 'gravity', 'mass': 'platform.mass', 'center_of_mass': 'platform.center_of_mass',
    'inertia': 'platform.inertia', 'leg_clearance_min': 'limits.leg_clearance_min',
    'characteristic_length': 'singularity.characteristic_length',
    'warn_condition': 'singularity.warn_condition', 'stop_condition': 'singularity.stop_condition',
    'warn_time': 'singularity.warn_time', 'sync_tolerance': 'setpoint.sync_tolerance',
    'timeout': 'setpoint.timeout'}
"""The same for ``stewart_platform``."""
LISTS: Mapping[str, str] = {
    'torque_speed': 'drive.torque_speed', 'base_outline': 'geometry.base_outline',
    'platform_outline': 'geometry.platform_outline'}
"""Fields that hold points, as many as the field ``n_...`` counts."""
_IF_NOT_SET = {**{LEG_FIELDS[row.field]: -math.inf if row.minimum else math.inf
                  for row in LIMIT_ROWS},
               'limits.length_min': 0.0, 'limits.lever_min': 0.0,
               'limits.leg_clearance_min': -math.inf, 'actuator.screw_lead': 0.0,
               'singularity.characteristic_length': 0.0}


MOST_POINTS = 32
"""Points that each of LISTS may have; the structure has room for three torques at each speed."""


def not_set(name: str) -> float:
    """Return the number that stands for a parameter that is not set."""
    return _IF_NOT_SET.get(name, math.nan)


def structure_of(parameters: Parameters, with_motors: bool, suppressing: str) -> Records:
    """
    Return the complete structure () of parameters, without a payload and axes of joints.

    with_motors: motors are computed. suppressing: value of an action that suppresses forces.
    """
    hexapod: Any = np.zeros((), record('stewart_platform'))
    legs = hexapod['legs']
    kind = parameters.leg_kind
    for fields, of in ((LEG_FIELDS, legs), (kind.fields, legs), (PLATFORM_FIELDS, hexapod)):
        for field, name in fields.items():
            value = parameters[name]
            of[field] = not_set(name) if value is None else value
    kind.write_fields(legs, parameters)
    for field, name in LISTS.items():
        points = parameters[name]
        if points is not None:
            hexapod[f'n_{field}'] = len(points)
            hexapod[field][:len(points)] = points
    hexapod['with_motors'] = with_motors
    hexapod['suppress_near_singularity'] = parameters['singularity.action'] == suppressing
    hexapod['suppress_at_limits'] = parameters['limits.action'] == suppressing
    function('stewart_complete')(hexapod)
    return hexapod  # type: ignore[no-any-return]


def broken_rule(hexapod: Records) -> tuple[Rule, int] | None:
    """Return the first rule that a hexapod breaks and where; None if it keeps all of them."""
    where: Array = np.empty(1, np.intc)
    code = function('stewart_check')(hexapod, where)
    return None if code == 0 else (RULES[code], int(where[0]))
