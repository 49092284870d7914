# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Structures of many hexapods that differ in some parameters, without a parameter set for each.

The table of parameters gives type, size and bounds of each value, ``stewart_complete`` what
follows from them, ``stewart_check`` the rules between them: as for a file.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Integers, Records
from stewart_dynamics.core.binding import CODES, function, RULES
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.hexapod_structure import limited_structure
from stewart_dynamics.mechanics.limits import OF_JOINTS
from stewart_dynamics.parameters.parameter_set import Parameter
from stewart_dynamics.parameters.structure import LEG_FIELDS, not_set, PLATFORM_FIELDS
from stewart_dynamics.parameters.table import Parameters, UNIVERSAL

_PAYLOAD = {'payload.mass': slice(0, 1), 'payload.center_of_mass': slice(1, 4),
            'payload.inertia': slice(4, 10)}


def own_structures(parameters: Parameters, values: Mapping[str, ArrayLike], count: int,
                   ) -> Records:
    """
    Return the structures (count,) of hexapods with values of their own.

    values: arrays by the names of parameters, one value for each hexapod (count,), or a row of
    those that have several (count, n). Raises ParameterError: names hexapod, parameter, value and
    rule; or a parameter that cannot be an array.
    """
    checked = {name: _checked_values(parameters, name, value, count)
               for name, value in values.items()}
    structures, payloads = copies(parameters, count)
    fields = fields_of(parameters)
    for name, rows in checked.items():
        if name in _PAYLOAD:
            payloads = np.repeat(payloads, count, axis=0) if len(payloads) == 1 else payloads
            payloads[:, _PAYLOAD[name]] = rows.reshape(count, -1)
            continue
        of_leg, field = fields[name]
        of: Any = structures['legs'] if of_leg else structures
        if of_leg and rows.ndim == 1:
            rows = rows[:, None]
        of[field] = rows.reshape(of[field].shape) if rows.size == of[field].size else rows
    codes, places = complete(structures, payloads)
    if codes.any():
        at = int(np.flatnonzero(codes)[0])
        raise ParameterError(f'parameters of hexapod {at}: '
                             f'{_words(parameters, checked, codes[at], places[at], at)}')
    reflected = parameters.leg_kind.fields['reflected_mass']
    if reflected in checked:
        wanted = checked[reflected].reshape(count, -1)
        found = structures['legs']['reflected_mass']
        wrong = np.abs(found - wanted) > 1e-9 * np.abs(found)
        if wrong.any():
            at = int(np.argwhere(wrong)[0][0])
            raise ParameterError(
                f'parameters of hexapod {at}: {reflected}: contradicts the inertias of drive.*')
    return structures  # type: ignore[no-any-return]


def fields_of(parameters: Parameters) -> dict[str, tuple[bool, str]]:
    """Return the field that holds a parameter as it is given, and whether it is one of a leg."""
    of_legs = {**LEG_FIELDS, **parameters.leg_kind.fields}
    return {name: (True, field) for field, name in of_legs.items()} | {
        name: (False, field) for field, name in PLATFORM_FIELDS.items()}


def copies(parameters: Parameters, count: int, *, follows: bool = True) -> tuple[Any, Array]:
    """
    Return structures (count,) without payload, and the payload.

    follows: numbers that follow from others, and are not given, are not set.
    """
    one: Any = limited_structure(parameters).copy()
    one['mass'], one['center_of_mass'], one['inertia'] = parameters.platform.body
    for name, (of_leg, field) in fields_of(parameters).items():
        if follows and name not in parameters.given:
            trial = one.copy()
            (trial['legs'] if of_leg else trial)[field] = not_set(name)
            function('stewart_complete')(trial)
            of, before = (each['legs'][field] if of_leg else each[field] for each in (trial, one))
            if np.array_equal(of, before):  # it follows from others, which may be changed
                (one['legs'] if of_leg else one)[field] = not_set(name)
    payload = parameters.payload.body
    row = np.concatenate([[payload.mass], payload.center, payload.inertia])
    return np.repeat(one[None], count), row[None]


def complete(structures: Any, payloads: Array) -> tuple[Integers, Integers]:
    """Complete and check structures (n,); return codes (n,), zero where valid, and places."""
    codes, places = (np.empty(len(structures), dtype=np.int64) for _ in range(2))
    function('complete_hexapods')(len(structures), structures, len(payloads),
                                  np.ascontiguousarray(payloads), codes, places)
    return codes, places


def _checked_values(parameters: Parameters, name: str, value: ArrayLike, count: int) -> Array:
    """Return the values of a parameter, checked by its own rule."""
    parameter = parameters.declared(name, 'parameters')
    known = name in _PAYLOAD or name in fields_of(parameters)
    if not known or name.startswith(parameters.leg_kind.foreign):
        raise ParameterError(f'parameters: {name}: cannot be an array: give a list of platforms')
    if _moves_axes(parameters, name):
        raise ParameterError(f'parameters: {name}: cannot be an array where axes of joints follow '
                             'from the home pose, or screws turn: give a list of platforms')
    try:
        rows = np.asarray(value, dtype=float)
    except (TypeError, ValueError) as exc:
        raise ParameterError(f'parameters: {name}: not an array of real numbers') from exc
    sizes = {max(parameter.sizes, default=1), *parameter.sizes} or {1}
    flat = rows.reshape(count, -1) if len(rows.shape) and rows.shape[0] == count else None
    if flat is None or flat.shape[1] not in sizes:
        each = ' or '.join(str((count,) if size == 1 else (count, size)) for size in sorted(sizes))
        raise ParameterError(f'parameters: {name}: shape {rows.shape}: must be {each}')
    _check_range(parameter, flat)
    return flat[:, 0] if flat.shape[1] == 1 else flat


def _check_range(parameter: Parameter, rows: Array) -> None:
    """Raise ParameterError for the first value that is not finite or out of range."""
    below = rows <= parameter.minimum if parameter.above else rows < parameter.minimum
    wrong = ~np.isfinite(rows) | below | (rows > parameter.maximum)
    if wrong.any():
        at = int(np.argwhere(wrong)[0][0])
        value = float(rows[at][wrong[at]][0])
        unit = f' {parameter.unit}' if parameter.unit else ''
        rule = 'finite' if not math.isfinite(value) else parameter.rule
        raise ParameterError(
            f'parameters of hexapod {at}: {parameter.name}: {value:g}{unit}: must be {rule}')


def _moves_axes(parameters: Parameters, name: str) -> bool:
    """Return whether a parameter changes axes that a structure has from its platform."""
    if parameters.drive.screw_rotation == UNIVERSAL:
        return name.startswith(('geometry.', 'drive.gear', 'actuator.screw'))
    moving = name.startswith('geometry.') and not name.endswith('_axes')
    return moving and any(
        parameters[limit] is not None and f'geometry.{end}_joint_axes' not in parameters.given
        for limit, end in zip(OF_JOINTS, ('base', 'platform'), strict=True))


def _words(parameters: Parameters, values: Mapping[str, Array], code: int, place: int, at: int,
           ) -> str:
    """Return the rule that a hexapod breaks, with the value if that is one of the arrays."""
    if code < 0:
        known = {-CODES['STEWART_BROKEN_RULE']: 'payload.inertia: must be positive semidefinite'}
        return known.get(code, 'payload.mass: no mass is left, or the numbers overflow')
    rule = RULES[code]
    name = next((each for each in rule.parameters if each in values), rule.parameters[0])
    value = f' {np.asarray(values[name][at]).tolist()}:' if name in values else ''
    leg = f' {parameters.joints[place]}:' if 0 <= place < 6 and value else ''
    return f'{name}:{leg}{value} {rule.text}'
