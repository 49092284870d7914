# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The JSON schema by which editors complete and check parameter files."""

from __future__ import annotations

import json
from typing import Any

import jsonschema
import pytest
from referees import ROOT
from stewart_dynamics import ParameterError
from stewart_dynamics.cueing.cueing_parameters import CueingParameters
from stewart_dynamics.parameters.json_schema import json_schema
from stewart_dynamics.parameters.parameter_set import checked
from stewart_dynamics.parameters.yaml_file import check_given
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters
import yaml

SETS = CueingParameters, SimulatorParameters, ReferenceMotionParameters
TABLE = {name: parameter for each in reversed(SETS) for name, parameter in each.table.items()}
SCHEMA = ROOT / 'config' / 'parameters.schema.json'
FILES = sorted((ROOT / 'config').glob('*.yaml'))
# Texts, one number, numbers at and beyond bounds, lists of all lengths that parameters have.
VALUES: tuple[Any, ...] = (
    'positive', 'other', True, 0.5, 0.0, -0.5, 1e9, -1e9, 6.283185307179586, [], ['auto'],
    ['a', 'b', 'c', 'd', 'e', 'f'], [True], [0.5, 'x', 0.5],
    *([value] * size for value in (0.25, -1e9) for size in (1, 2, 3, 6, 18, 36)))


def validator() -> jsonschema.Draft7Validator:
    """Return the check by the schema that users have."""
    schema = json.loads(SCHEMA.read_text(encoding='utf-8'))
    jsonschema.Draft7Validator.check_schema(schema)
    return jsonschema.Draft7Validator(schema)


def errors(text: str) -> list[str]:
    """Return the errors in parameters of a node."""
    document = {'/**': {'ros__parameters': yaml.safe_load(text)}}
    return [error.message for error in validator().iter_errors(document)]


@pytest.mark.parametrize('path', FILES, ids=lambda path: path.name)
def test_files_name_the_schema_and_follow_it(path: Any) -> None:
    text = path.read_text(encoding='utf-8')
    assert text.startswith(f'# yaml-language-server: $schema={SCHEMA.name}\n')
    validator().validate(yaml.safe_load(text))


def test_values_are_accepted_that_the_programs_accept() -> None:
    schema = json_schema(SETS)
    values = jsonschema.Draft7Validator(schema)
    for name, parameter in TABLE.items():
        check = values.evolve(schema=schema['definitions'][name])
        for value in VALUES:
            try:
                check_given(name, value, 'file')
                checked(parameter, value, 'file')
            except ParameterError:
                accepted = False
            else:
                accepted = True
            # Multiples of a length are not known to a schema.
            if not parameter.repeated or not isinstance(value, list):
                assert check.is_valid(value) is accepted, (name, value)
        assert parameter.text in schema['definitions'][name]['description']


@pytest.mark.parametrize('text', [
    'limits: {force_max: 8000.0}', 'limits.force_max: [8000.0]', 'legs: {crank.length: 0.1}',
    'use_sim_time: true', 'qos_overrides: {/tf: {publisher: {depth: 1}}}', 'motion: {type: sine}',
    'end_stops.frequency: 30.0'])
def test_names_may_be_nested_or_dotted(text: str) -> None:
    assert errors(text) == []


@pytest.mark.parametrize(('text', 'named'), [
    ('limits: {force_mx: 8000.0}', 'force_mx'), ('limits.force_mx: 8000.0', 'limits.force_mx'),
    ('legs: {crank.lenght: 0.1}', 'crank.lenght'), ('limits: 8000.0', '8000.0'),
    ('limits:', 'None'), ('limits: {force_max: }', 'None'), ('limits: {force_max: []}', '[]'),
    ('platform_side: up', 'platform_side'), ('geometry: {platform_side: up}', "'up'"),
    ('legs: {crank: {length: -0.1}}', '-0.1'), ('joints: leg', "'leg'")])
def test_a_possible_error_is_named(text: str, named: str) -> None:
    assert any(named in error for error in errors(text))


def test_sections_are_of_any_node_and_namespace() -> None:
    parameters = {'ros__parameters': {'rate': 500.0}}
    for document in ({'stewart_trajectory': parameters}, {'left': {'*': parameters}}, {}):
        validator().validate(document)
    assert not validator().is_valid({'/**': {'rate': 500.0}})
