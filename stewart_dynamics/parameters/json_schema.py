# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The JSON schema of parameter files, made from the tables of parameters.

Editors complete, explain and check a file by it. It knows each parameter on its own: rules between
parameters, and the decimal point that ROS needs (5.0, not 5), are checked by the programs alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
import math
import re
from typing import Any

from stewart_dynamics.legs import KINDS
from stewart_dynamics.parameters.parameter_set import Parameter, ParameterSet
from stewart_dynamics.parameters.yaml_file import OF_ROS, OF_ROS_PREFIX

_TYPES: Mapping[str, str] = {'string': 'string', 'double': 'number', 'bool': 'boolean'}
_SECTION = 'ros__parameters'


def json_schema(sets: Iterable[type[ParameterSet]]) -> dict[str, Any]:
    """
    Return the schema of files with parameters of any of these sets (JSON schema, draft 7).

    Names may be nested or dotted, and sections be of any node in any namespace, as ROS reads them.
    Source: https://json-schema.org/draft-07, of the drafts the one that all editors read.
    """
    table: dict[str, Parameter] = {}
    for each in sets:
        table |= {name: parameter for name, parameter in each.table.items() if name not in table}
    return {
        '$schema': 'http://json-schema.org/draft-07/schema#',
        'title': 'Parameters of stewart_dynamics',
        'type': 'object',
        'additionalProperties': {'$ref': '#/definitions/node'},
        'definitions': {
            'node': {
                'description': 'a node, or a namespace of nodes; /** stands for all',
                'type': 'object',
                'properties': {_SECTION: {'$ref': '#/definitions/parameters'}},
                'additionalProperties': {'$ref': '#/definitions/node'}},
            'parameters': _group_schema({name: name for name in table}, {
                **dict.fromkeys(OF_ROS, {}), OF_ROS_PREFIX.rstrip('.'): {}}),
            **{name: _value_schema(parameter) for name, parameter in table.items()}}}


def _group_schema(names: Mapping[str, str], properties: Mapping[str, Any]) -> dict[str, Any]:
    """Return the schema of a group; names: of its parameters, by their names within it."""
    values = {within: {'$ref': f'#/definitions/{name}'} for within, name in names.items()}
    nested: dict[str, Any] = dict(properties)
    for first in dict.fromkeys(within.partition('.')[0] for within in names):
        nested[first] = values.get(first) or _group_schema(
            {rest: name for within, name in names.items()
             for group, _, rest in [within.partition('.')] if group == first}, {})
    # Patterns: as properties, editors would propose each name twice.
    dotted = {f'^{re.escape(within)}$': value for within, value in values.items()
              if '.' in within}
    group = {'type': 'object', 'properties': nested, 'additionalProperties': False}
    return {**group, 'patternProperties': dotted} if dotted else group


def _value_schema(parameter: Parameter) -> dict[str, Any]:
    """Return the schema of the value of a parameter."""
    entry: dict[str, Any] = {'type': _TYPES[parameter.kind]}
    if parameter.choices:
        entry['enum'] = list(parameter.choices)
    if parameter.minimum > -math.inf:
        entry['exclusiveMinimum' if parameter.above else 'minimum'] = parameter.minimum
    if parameter.maximum < math.inf:
        entry['maximum'] = parameter.maximum
    shapes = [] if parameter.sizes and 1 not in parameter.sizes else [entry]
    if parameter.repeated:
        shapes.append({'type': 'array', 'items': entry, 'minItems': parameter.sizes[0]})
    else:
        shapes += [{'type': 'array', 'items': entry, 'minItems': size, 'maxItems': size}
                   for size in parameter.sizes]
    return {'description': _description(parameter), 'anyOf': shapes}


def _description(parameter: Parameter) -> str:
    """Return the meaning, unit, rule and default of a parameter."""
    units = dict.fromkeys(filter(None, (parameter.unit, *(
        kind.units.get(parameter.name, '') for kind in KINDS))))
    text = parameter.text + (f' [{" or ".join(units)}]' if units else '')
    default = parameter.default
    if isinstance(default, tuple) and len(set(default)) == 1:
        default = default[0]
    if parameter.required:
        text += '; required'
    elif default not in (None, (), ''):
        text += f'; default: {list(default) if isinstance(default, tuple) else default}'
    return f'{text}; {parameter.rule}' if parameter.rule else text
