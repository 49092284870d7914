# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Parameters: the values of a valid file, and the error of each invalid one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import copy, deepcopy
from itertools import count
from operator import attrgetter
from pathlib import Path
import pickle
from typing import Any, get_args, get_type_hints

from hypothesis import given, HealthCheck, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from referees import ROOT
from snapshot import Snapshot
from stewart_dynamics import (
    MotionError, ParameterError, Parameters, PoseError, StewartError)
from stewart_dynamics.arrays import Array
from stewart_dynamics.cueing.cueing_parameters import CueingParameters
from stewart_dynamics.parameters.parameter_set import declare, ParameterGroup, ParameterSet
from stewart_dynamics.parameters.table import PARAMETERS
from stewart_dynamics.parameters.yaml_file import flat, other_nodes, read_yaml
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters
import yaml

GOOD = """\
/**:
  ros__parameters:
    joints: [a, b, c, d, e, f]
    geometry:
      base_joints: [1.0, 0.3, 0.0,  0.9, 0.5, 0.1,  -0.1, 1.0, 0.0,
                    -0.8, 0.6, 0.0,  -0.8, -0.6, 0.0,  1.0, -0.4, 0.0]
      platform_joints: [0.4, 0.4, 0.0,  0.2, 0.5, 0.0,  -0.6, 0.1, 0.0,
                        -0.6, -0.1, 0.0,  0.2, -0.5, 0.0,  0.4, -0.4, 0.0]
    platform:
      mass: 150.0
      center_of_mass: [0.01, 0.0, 0.1]
      inertia: [20.0, 1.0, 2.0, 21.0, 3.0, 35.0]
    legs:
      cylinder: {mass: 12.0, center_of_mass: 0.3, inertia: 0.4}
      piston: {mass: [6.0, 6.1, 6.2, 6.3, 6.4, 6.5], center_of_mass: 0.35, inertia: 1e-3}
    limits: {length_min: 0.8, length_max: 1.4}
    singularity: {warn_condition: 40.0, stop_condition: 400.0}
    visualization_rate: 25.0
"""

GIVEN = {'geometry.base_joints': [0.1 * n for n in range(18)],
         'geometry.platform_joints': [0.2 * n for n in range(18)],
         'platform.mass': 1.0, 'platform.inertia': [1.0, 0.0, 0.0, 1.0, 0.0, 1.0]}


def written(path: Path, text: str) -> Path:
    """Return the path of a parameter file with this text."""
    file = path / 'hexapod.yaml'
    file.write_text(text, encoding='utf-8')
    return file


def assert_rejected(path: Path, text: str, snapshot: Snapshot,
                    read: Callable[[Path], object] = Parameters.from_yaml) -> None:
    """Check that a file with this text is rejected in one short line that names it."""
    with snapshot.raises(ParameterError) as caught:
        read(written(path, text))
    message = str(caught.value)
    assert message.startswith(f'{path / "hexapod.yaml"}: ')
    assert message.isprintable()
    assert len(message) < 450 + len(str(path))


@pytest.fixture
def p(tmp_path: Path) -> Parameters:
    """Return the parameters of the valid file."""
    return Parameters.from_yaml(written(tmp_path, GOOD))


# Valid files

def test_a_valid_file_gives_its_values(p: Parameters) -> None:
    assert set(p) == set(PARAMETERS)
    assert len(p) == len(PARAMETERS)
    assert p['joints'] == ('a', 'b', 'c', 'd', 'e', 'f')
    assert p['geometry.base_joints'].shape == (6, 3)
    assert np.array_equal(p['geometry.base_joints'][1], [0.9, 0.5, 0.1])
    assert p['platform.mass'] == 150.0
    assert np.array_equal(p['platform.inertia'], [20.0, 1.0, 2.0, 21.0, 3.0, 35.0])
    assert np.array_equal(p['legs.piston.mass'], [6.0, 6.1, 6.2, 6.3, 6.4, 6.5])
    assert p['visualization_rate'] == 25.0


def test_one_value_holds_for_all_legs(p: Parameters) -> None:
    assert np.array_equal(p['legs.cylinder.mass'], np.full(6, 12.0))
    assert np.array_equal(p['limits.length_min'], np.full(6, 0.8))
    assert np.array_equal(p['actuator.reflected_mass'], np.zeros(6))
    in_brackets = p.replaced({'legs.cylinder.mass': [12.0]})
    assert np.array_equal(in_brackets['legs.cylinder.mass'], np.full(6, 12.0))


def test_arrays_are_read_only(p: Parameters) -> None:
    arrays = [value for value in p.values() if isinstance(value, np.ndarray)]
    assert len(arrays) > 10
    for array in arrays:
        with pytest.raises(ValueError, match='read-only'):
            array[...] = 0.0


def test_the_characteristic_length_is_the_mean_distance_of_the_platform_joints(
        p: Parameters) -> None:
    joints = p['geometry.platform_joints']
    distances = np.linalg.norm(joints - joints.mean(axis=0), axis=1)
    assert p['singularity.characteristic_length'] == pytest.approx(distances.mean(), rel=1e-15)
    twice = p.replaced({'geometry.platform_joints': 2.0 * joints.ravel()})
    assert twice['singularity.characteristic_length'] == pytest.approx(
        2.0 * distances.mean(), rel=1e-15)
    given_one = p.replaced({'singularity.characteristic_length': 0.25})
    assert given_one['singularity.characteristic_length'] == 0.25


def test_replaced_changes_these_alone_and_checks_the_whole(
        p: Parameters, snapshot: Snapshot) -> None:
    heavier = p.replaced({'platform.mass': 200.0})
    assert heavier['platform.mass'] == 200.0
    assert p['platform.mass'] == 150.0
    for name in set(p) - {'platform.mass'}:
        assert np.array_equal(heavier[name], p[name])
    with snapshot.raises(ParameterError):
        p.replaced({'limits.length_max': 0.7})
    with snapshot.raises(ParameterError):
        p.replaced({'platform.mass': -1.0}, 'a node')
    read = Parameters(GIVEN, 'a file')
    for same in (read.replaced({}), pickle.loads(pickle.dumps(read))):
        assert same.source == 'a file'
    assert read.replaced({}, 'identified').source == 'identified'


def test_a_later_section_overrides_an_earlier_one_and_other_nodes_are_ignored(
        tmp_path: Path) -> None:
    later = """\
stewart_dynamics:
  ros__parameters: {platform: {mass: 160.0}}
other_node:
  ros__parameters: {platform: {mass: 170.0}, anything: 1}
"""
    assert Parameters.from_yaml(written(tmp_path, GOOD + later))['platform.mass'] == 160.0


# Invalid files: the part of the valid file that is changed, and its new text

BAD = [
    ('      mass: 150.0\n', ''),
    ('mass: 150.0', 'mass: null'),
    ('mass: 150.0', 'mass:'),
    # names
    ('warn_condition', 'warn_conditions'),
    ('visualization_rate: 25.0', 'limits.joint_angle_max: 0.5'),
    ('visualization_rate: 25.0', 'qqq: 25.0'),
    ('visualization_rate', '"two\\nlines\\e[31m"'),
    ('mass: 150.0', 'mass: {kg: 150.0}'),
    ('limits: {length_min: 0.8, length_max: 1.4}', 'limits: 0.8'),
    ('visualization_rate: 25.0', 'platform.mass: 25.0'),
    # types
    ('mass: 150.0', 'mass: 150'),
    ('[20.0, 1.0,', '[20.0, 1,'),
    ('mass: 150.0', "mass: '150.0'"),
    ('joints: [a,', 'joints: [1,'),
    ('visualization_rate: 25.0', 'base_frame: on'),
    ('joints: [a,', 'joints: ["a\\e",'),
    ('visualization_rate: 25.0', 'autostart: 1'),
    # sizes
    ('mass: 150.0', 'mass: [150.0, 1.0]'),
    ('center_of_mass: [0.01, 0.0, 0.1]', 'center_of_mass: 0.1'),
    ('center_of_mass: [0.01, 0.0, 0.1]', 'center_of_mass: [0.01, 0.1]'),
    ('[6.0, 6.1, 6.2, 6.3, 6.4, 6.5]', '[]'),
    ('[0.01, 0.0, 0.1]', '[[0.01, 0.0, 0.1]]'),
    ('/**:', 'a: {ros__parameters: {b: [[1]]}}\n/**:'),
    # values
    ('warn_condition: 40.0', 'warn_condition: 40.0, action: stop'),
    ('[20.0, 1.0, 2.0, 21.0, 3.0, 35.0]', '[20.0, 0.0, 0.0, 20.0, 0.0, -1.0]'),
    ('length_max: 1.4', 'length_max: 0.8'),
    ('length_max: 1.4', 'length_max: [1.4, 1.4, 1.4, 0.7, 1.4, 1.4]'),
    ('stop_condition: 400.0', 'stop_condition: 39.0'),
    ('mass: 150.0', 'mass: .nan'),
    ('[a, b, c, d, e, f]', '[a, b, c, d, e, a]'),
    ('platform_joints: [0.4, 0.4, 0.0,  0.2, 0.5, 0.0,  -0.6, 0.1, 0.0,\n'
     '                        -0.6, -0.1, 0.0,  0.2, -0.5, 0.0,  0.4, -0.4, 0.0]',
     f'platform_joints: {[0.5] * 18}'),
    # YAML
    ('mass: 150.0', 'mass: [150.0'),
    ('      mass: 150.0', '\tmass: 150.0'),
    ('      mass: 150.0', '      mass:150.0'),
    ('{mass: 12.0,', '{mass:12.0,'),
    ('mass: 150.0', 'mass: !!float 150'),
    ('mass: 150.0', '? [a]\n      : 150.0'),
    ('      mass: 150.0\n', '      mass: 150.0\n      mass: 160.0\n'),
    ('mass: 150.0', 'mass: *m'),
    # sections
    ('/**:', 'a: 1\n---\n/**:'),
    ('/**:', 'other_node:'),
    ('ros__parameters:', 'parameters:'),
    (GOOD, ''),
    (GOOD, 'just words\n'),
    (GOOD, '/**: {ros__parameters: [1, 2]}\n'),
    (GOOD, '/**: {ros__parameters: }\n'),
    (GOOD, '/**: \x07\n')]


@pytest.mark.parametrize(('old', 'new'), BAD, ids=count())
def test_the_error_of_a_bad_file_names_parameter_value_and_rule(
        tmp_path: Path, old: str, new: str, snapshot: Snapshot) -> None:
    assert GOOD.count(old) == 1
    assert_rejected(tmp_path, GOOD.replace(old, new), snapshot)


@pytest.mark.parametrize(('name', 'value'), [
    ('platform.mass', -150.0),
    ('platform.mass', 0.0),
    ('platform.mass', True),
    ('platform.center_of_mass', [-np.inf, 0.0, 0.0]),
    ('platform.inertia', [20.0, 20.0, 35.0, 0.0, 0.0, 0.0]),
    ('geometry.zero_length', -0.9),
    ('limits.length_min', -0.8),
    ('limits.length_max', 0.0),
    ('limits.base_joint_angle_max', 3.2),
    ('legs.piston.inertia', -1e-3),
    ('legs.piston.mass', [6.0] * 5),
    ('legs.piston.mass', [6.0, 6.0, 6.0, 6.0, 6.0, -6.4]),
    ('singularity.warn_condition', 0.5),
    ('setpoint.timeout', 2e9),
    ('payload.window', 61.0),
    ('joints', list('abcde') + ['']),
    ('base.imu.orientation', [0.0, 0.0, 0.0, 1.002]),
    ('geometry.base_joint_axes', [0.0] * 18)])
def test_a_value_that_breaks_a_rule_is_rejected(name: str, value: Any, snapshot: Snapshot) -> None:
    with pytest.raises(ParameterError) as caught:
        Parameters({**GIVEN, name: value})
    assert str(caught.value).startswith(f'parameters: {name}: ')
    snapshot(caught.value)


@pytest.mark.parametrize(('name', 'meant'), [
    ('geometry.platform_joint', 'geometry.platform_joints'),
    ('geometry.base_joint', 'geometry.base_joints'), ('platfrom.mass', 'platform.mass'),
    ('limits.max_force', 'limits.force_max'), ('base_joints', 'geometry.base_joints'),
    ('platform.cog', None), ('legs.cylinder.com', None)])
def test_the_nearest_name_is_suggested_for_an_unknown_one(
        name: str, meant: str | None, snapshot: Snapshot) -> None:
    with pytest.raises(ParameterError) as caught:
        Parameters.declared(name)
    assert meant is None or str(caught.value).endswith(f' {meant}?')
    snapshot(caught.value)


def test_a_missing_file_is_named(tmp_path: Path, snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        Parameters.from_yaml(tmp_path / 'nowhere.yaml')
    with snapshot.raises(ParameterError):
        Parameters.from_yaml('a\0b')


@pytest.mark.parametrize('change', [
    lambda text: '\ufeff' + text, lambda text: text.replace('\n', '\r\n'),
    lambda text: '%YAML 1.2\n---\n' + text, lambda text: text.replace('150.0', '&a 150.0')],
    ids=['byte order mark', 'CRLF', 'version', 'anchor'])
def test_sections_that_ros_ignores_change_nothing(
        tmp_path: Path, p: Parameters, change: Any) -> None:
    path = tmp_path / 'other.yaml'
    path.write_bytes(change(GOOD).encode())
    assert Parameters.from_yaml(path) == p


def test_every_parameter_of_the_table_has_what_the_documents_need() -> None:
    for name, parameter in PARAMETERS.items():
        assert parameter.name == name
        assert parameter.text
        assert parameter.required == (parameter.default is None and name in (
            'geometry.base_joints', 'geometry.platform_joints', 'platform.mass',
            'platform.inertia'))
        assert parameter.ros_type.startswith(parameter.kind)


@pytest.mark.parametrize('text', [
    'x: &a {b: *a}',
    'a: ' + '{a: ' * 30,
    f'{"a" * 1000}: 1.0',
    f'platform.mass: {"9" * 90000}',
    'platform: {mass: 0x' + 'f' * 5000 + '}'], ids=count())
def test_difficult_yaml_is_rejected_in_one_short_line(
        tmp_path: Path, text: str, snapshot: Snapshot) -> None:
    assert_rejected(tmp_path, f'/**:\n  ros__parameters:\n    {text}\n', snapshot,
                    Parameters.check_file)


def test_null_and_omitted_parameters_have_their_defaults() -> None:
    parameters = Parameters({**GIVEN, 'gravity': None, 'joints': None,
                             'singularity.warn_condition': None, 'limits.force_max': None})
    assert set(parameters.given) == set(GIVEN)
    assert parameters['gravity'].tolist() == [0.0, 0.0, -9.80665]
    assert parameters['joints'] == tuple(f'leg_{n}' for n in range(1, 7))
    assert parameters['base_frame'] == 'base'
    assert parameters['limits.force_max'] is None
    assert parameters['singularity.action'] == 'warn'
    assert parameters['autostart'] is True


# Arbitrary input

NAMES = sorted(PARAMETERS)
plain = st.one_of(
    st.none(), st.booleans(), st.integers(-10 ** 30, 10 ** 30), st.floats(), st.text(max_size=8),
    st.sampled_from(['warn', 'base', '/**', 'ros__parameters', 'x' * 300]),
    st.dates(), st.binary(max_size=8))
values = st.recursive(plain, lambda inner: st.one_of(
    st.lists(inner, max_size=7), st.lists(st.floats(), min_size=6, max_size=6),
    st.lists(st.floats(0.1, 2.0), min_size=18, max_size=18),
    st.dictionaries(st.text(max_size=5), inner, max_size=3)), max_leaves=12)


@given(st.dictionaries(st.one_of(st.sampled_from(NAMES), st.text(max_size=8)), values,
                       max_size=4))
@np.errstate(all='ignore')
def test_any_values_are_accepted_or_rejected_with_a_parameter_error(changes: Any) -> None:
    try:
        parameters = Parameters({**GIVEN, **changes})
    except ParameterError:
        return
    for value in parameters.values():
        if isinstance(value, np.ndarray):
            assert np.all(np.isfinite(value))


def check_any(file: Path) -> None:
    """Assert that a file gives parameters that obey their rules, or one line of rejection."""
    for read in (Parameters.from_yaml, Parameters.check_file):
        try:
            parameters = read(file)
        except ParameterError as exc:
            assert str(exc).startswith(f'{file}: ')
            assert str(exc).isprintable()
            assert len(str(exc)) < 1000
            continue
        for name, value in (parameters or {}).items():
            known = PARAMETERS[name]
            if known.kind == 'double' and value is not None:
                assert np.size(value) in (1, 2, 3, 4, 6, 18)
                assert np.all(np.isfinite(value) & (value <= known.maximum) & (
                    value > known.minimum if known.above else value >= known.minimum))


def encoded(text: str) -> bytes:
    """Return the bytes of a text, with surrogates in it."""
    return text.encode(errors='surrogatepass')


# A place in the valid file, the number of characters removed there, and the text inserted.
cuts = st.tuples(st.integers(0, len(GOOD)), st.integers(0, 40))
SPECIAL = '{}[],:-&?!|>\'"%@`# \n\t\r\0\\01.e+<*~_\ufeff\u2028'
scalars = st.sampled_from([
    '1e3', '.5', '0x1p3', '1_000', 'on', '~', '0,5', "''", '!!str 1', '&a 1', '*a', '1e400',
    '010', '-.inf', 'nan', '[]', '[1.0, 2]', '[[1.0]]', '{a: 1.0}', '|\n  1.0', '-1.0', '9' * 30,
    '"\\0"'])


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
@given(st.one_of(
    st.text(max_size=60).map(encoded),
    st.text(alphabet=f'/*:rosparmet_{SPECIAL}', max_size=60).map(encoded),
    st.tuples(cuts, st.text(alphabet=SPECIAL, max_size=6)).map(
        lambda cut: encoded(GOOD[:cut[0][0]] + cut[1] + GOOD[sum(cut[0]):])),
    st.binary(max_size=60), st.tuples(cuts, st.binary(max_size=4)).map(
        lambda cut: GOOD.encode()[:cut[0][0]] + cut[1] + GOOD.encode()[sum(cut[0]):])))
@np.errstate(all='ignore')
def test_any_file_is_accepted_or_rejected_in_one_line(tmp_path: Path, data: bytes) -> None:
    file = tmp_path / 'any.yaml'
    file.write_bytes(data)
    check_any(file)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.dictionaries(
    st.one_of(st.sampled_from(NAMES), st.text(alphabet='aA.*/: \n', max_size=5)),
    st.one_of(scalars, st.floats().map(repr), st.lists(
        st.floats().map(repr), max_size=18).map(lambda many: f'[{", ".join(many)}]')),
    max_size=5))
@np.errstate(all='ignore')
def test_any_values_in_a_file_are_accepted_or_rejected_in_one_line(
        tmp_path: Path, changes: dict[str, str]) -> None:
    file = tmp_path / 'any.yaml'
    lines = [f'    ? {name!r}\n    : {value}\n' for name, value in changes.items()]
    given = [f'    {name}: {value}\n' for name, value in GIVEN.items() if name not in changes]
    file.write_text('/**:\n  ros__parameters:\n' + ''.join([*given, *lines]), encoding='utf-8')
    check_any(file)


# Parameters of ROS, and of nodes with other names

@pytest.mark.parametrize('name', [
    'use_sim_time: false',
    'qos_overrides: {/a/setpoint/pose: {subscription: {reliability: best_effort}}}'])
def test_parameters_that_ros_declares_are_ignored(tmp_path: Path, name: str) -> None:
    path = written(tmp_path, f'/**:\n  ros__parameters:\n    platform.mass: 3.0\n    {name}\n')
    assert read_yaml(path, 'stewart_dynamics') == {'platform.mass': 3.0}
    Parameters.check_file(path)


@pytest.mark.parametrize(('name', 'text'), [
    ('platform.mass', '150'),
    ('platform.mass', '0,5'),
    ('gravity', '[]'),
    ('gravity', ''),
    ('gravity', '~'),
    ('gravity', '['),
    ('gravity', '\udcff'),
    ('use_sim_time', '1')])
def test_a_bad_value_on_a_command_line_is_rejected(
        name: str, text: str, snapshot: Snapshot) -> None:
    Parameters.read_value('platform.mass', '150.0', 'command line')
    Parameters.read_value('use_sim_time', 'true', 'command line')
    with snapshot.raises(ParameterError) as caught:
        Parameters.read_value(name, text, 'command line')
    assert str(caught.value).isprintable()


@pytest.mark.parametrize('value', ['5', "'true'", '[]', '~', ''])
def test_a_value_that_ros_would_ignore_is_rejected(
        tmp_path: Path, value: str, snapshot: Snapshot) -> None:
    path = written(tmp_path, f'/**: {{ros__parameters: {{use_sim_time: {value}}}}}\n')
    with snapshot.raises(ParameterError):
        Parameters.check_file(path)


@pytest.mark.parametrize('section, node, meant', [
    ('/**', 'stewart_dynamics', True), ('/**', '/a/b', True), ('stewart_dynamics', '', True),
    ('/a/b', 'a/b', True), ('b', '/a/b', False), ('/*/b', '/a/b', True), ('/**/b', '/a/c/b', True),
    ('/*/b', '/a/c/b', False), ('stewart.dynamics', '', False), ('**', '/a/b', True),
    ('*', '/a/b', False), ('/**/b', '/b', True), ('/a/**/b', '/a/b', True), ('/a/**', '/a', True),
    ('/**/**/*', '/b', True), ('stewart_*', '', False), ('/*/*', '/b', False),
    ('/**' * 10000 + '/x', '/a/b', False)])
def test_sections_are_matched_as_ros_matches_them(
        tmp_path: Path, section: str, node: str, meant: bool, snapshot: Snapshot) -> None:
    path = written(
        tmp_path, f"? '{section}'\n: {{ros__parameters: {{platform: {{mass: 7.0}}}}}}\n")
    if meant:
        assert read_yaml(path, node or Parameters.node) == {'platform.mass': 7.0}
    else:
        with snapshot.raises(ParameterError):
            read_yaml(path, node or Parameters.node)


def test_namespaces_may_nest_in_the_file(tmp_path: Path, snapshot: Snapshot) -> None:
    path = written(tmp_path, 'a:\n  ros__parameters: {x: 1.0}\n  b: {ros__parameters: {y: 2.0}}\n')
    assert read_yaml(path, '/a/b') == {'y': 2.0}
    assert read_yaml(path, 'a') == {'x': 1.0}
    with snapshot.raises(ParameterError):
        read_yaml(path, 'b')


def test_many_other_sections_are_named_in_short(tmp_path: Path, snapshot: Snapshot) -> None:
    path = written(tmp_path, ''.join(f'node_{n}: {{}}\n' for n in range(5000)))
    with snapshot.raises(ParameterError) as caught:
        Parameters.from_yaml(path)
    assert len(str(caught.value)) < 400 + len(str(path))


def test_parameters_are_taken_from_numpy_and_from_parameters(snapshot: Snapshot) -> None:
    parameters = Parameters({name: np.array(value) if isinstance(value, list) else value
                             for name, value in GIVEN.items()})
    assert parameters == Parameters(GIVEN)
    assert Parameters(dict(parameters)) == parameters
    joints = list(parameters['geometry.base_joints'].ravel())
    assert parameters.replaced({'geometry.base_joints': joints}) == parameters
    rows = parameters['geometry.base_joints'].tolist()
    for same in (rows, [tuple(row) for row in rows], [np.array(row) for row in rows]):
        assert parameters.replaced({'geometry.base_joints': same}) == parameters
    with snapshot.raises(ParameterError):
        parameters.replaced({'geometry.base_joints': [*rows[:5], rows[5][:2]]})
    assert parameters != 1


def test_an_integer_is_a_double_from_python_alone(tmp_path: Path, snapshot: Snapshot) -> None:
    parameters = Parameters(GIVEN).replaced({
        'platform.mass': 70, 'gravity': [0, 0, -10], 'limits.force_max': np.full(6, 5)})
    assert repr(parameters['platform.mass']) == '70.0'
    assert parameters['gravity'].dtype == float
    assert parameters.given['gravity'] == (0.0, 0.0, -10.0)
    assert parameters['limits.force_max'].tolist() == [5.0] * 6
    for wrong in (True, 10 ** 400, 1j, '70'):
        with snapshot.raises(ParameterError):
            parameters.replaced({'platform.mass': wrong})
    for read in (lambda: parameters.replaced({'platform.mass': 70}, exact_types=True),
                 lambda: Parameters({**GIVEN, 'platform.mass': 70}, exact_types=True)):
        with snapshot.raises(ParameterError):
            read()


@pytest.mark.parametrize('wrong', [None, [1.0], 'no.yaml', 3, {1: 2.0}, {None: 1}])
def test_a_wrong_object_in_place_of_parameters_is_named(wrong: Any, snapshot: Snapshot) -> None:
    for use in (Parameters, Parameters(GIVEN).replaced):
        with snapshot.raises(ParameterError):
            use(wrong)
    with snapshot.raises(ParameterError):
        Parameters.from_yaml(wrong)


def test_an_error_about_an_argument_is_a_value_error() -> None:
    for kind in (ParameterError, MotionError, PoseError):
        assert issubclass(kind, StewartError)
        assert issubclass(kind, ValueError)
    with pytest.raises(ValueError, match='platform.mass: -1.0 kg: must be more than 0'):
        Parameters({**GIVEN, 'platform.mass': -1})


# Written files

@pytest.mark.parametrize('file', ['platform.yaml', 'simulator.yaml', 'trajectory_sine.yaml'])
def test_a_whole_file_is_written_that_reads_back_equal(tmp_path: Path, file: str) -> None:
    kind: Any = {'p': Parameters, 's': SimulatorParameters,
                 't': ReferenceMotionParameters}[file[0]]
    config = ROOT / 'config'
    hexapod = read_yaml(config / 'platform.yaml', kind.node) if file[0] == 's' else {}
    parameters = kind({**hexapod, **read_yaml(config / file, kind.node)})
    parameters.to_yaml(tmp_path / 'written.yaml')
    kind.check_file(tmp_path / 'written.yaml')
    assert kind.from_yaml(tmp_path / 'written.yaml') == parameters
    # YAML 1.1, as `ros2 param load` reads it, has the same numbers and texts.
    document = yaml.safe_load((tmp_path / 'written.yaml').read_text(encoding='utf-8'))
    read = kind(dict(flat(document['/**']['ros__parameters'], '', 'yaml')), exact_types=True)
    assert read == parameters


def test_a_written_file_has_units_and_short_lines(
        tmp_path: Path, p: Parameters, snapshot: Snapshot) -> None:
    parameters = p.replaced({
        'platform.mass': 1e-5, 'base_frame': "on 'deck'", 'platform_frame': 'y',
        'legs.cylinder.inertia': 1e17})
    parameters.to_yaml(tmp_path / 'out.yaml')
    text = (tmp_path / 'out.yaml').read_text(encoding='utf-8')
    assert text.startswith('/**:\n  ros__parameters:\n')
    for lines in ("    base_frame: 'on ''deck'''\n    platform_frame: 'y'\n",
                  '    joints: [a, b, c, d, e, f]\n',
                  '    geometry:\n      base_joints: [  # m\n        1.0, 0.3, 0.0,\n',
                  '        1.0, -0.4, 0.0]\n      platform_joints: [  # m\n',
                  '      mass: 1.0e-05  # kg\n', '        inertia: 1.0e+17  # kg m^2\n',
                  '    gravity: [0.0, 0.0, -9.80665]  # m/s^2\n', '    autostart: true\n'):
        assert lines in text
    assert Parameters.from_yaml(tmp_path / 'out.yaml') == parameters
    assert 'force_max' not in text  # not given, and none by default
    with snapshot.raises(ParameterError):
        parameters.to_yaml(tmp_path)


TEXTS = st.text(st.characters(codec='utf-8'), min_size=1, max_size=8).filter(str.isprintable)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.one_of(TEXTS, st.sampled_from([
    'null', '~', 'yes', 'n', '1e3', '0x1F', '- a', 'a: b', '#', "'", '"', ' a ', '!!str', '*a',
    'nan', '1_000', '2020-01-01', '010', '=', '<<', '%', '@', '`', '|', '>'])), min_size=6,
    max_size=6, unique=True), st.floats(1e-300, 1e300), st.lists(
    st.floats(-1e300, 1e300, allow_subnormal=False), min_size=3, max_size=3))
def test_written_values_read_back_equal(
        tmp_path: Path, joints: list[str], mass: float, center: list[float]) -> None:
    parameters = Parameters({**GIVEN, 'joints': joints, 'base_frame': joints[0],
                             'platform.mass': mass, 'platform.center_of_mass': center})
    parameters.to_yaml(tmp_path / 'out.yaml')
    assert Parameters.from_yaml(tmp_path / 'out.yaml') == parameters


def test_other_nodes_of_a_file_are_named(tmp_path: Path) -> None:
    file = written(tmp_path, 'a: {b: {ros__parameters: {x: 1.0}}}\nc: {ros__parameters: {}}\n')
    assert other_nodes(file, '/stewart_dynamics') == 'a/b, c'
    assert other_nodes(file, '/a/b') == ''


def test_the_given_values_cannot_be_changed() -> None:
    given = {name: list(value) if isinstance(value, list) else value
             for name, value in GIVEN.items()}
    parameters = Parameters(given)
    given['platform.inertia'].append(3.0)
    assert parameters.replaced({'platform.mass': 2.0})['platform.mass'] == 2.0
    with pytest.raises(TypeError):
        parameters.given['platform.mass'] = 3.0  # type: ignore[index]


# Typed attributes

EACH_KIND = [
    Parameters(GIVEN), Parameters.from_yaml(ROOT / 'config' / 'platform.yaml'),
    SimulatorParameters({**GIVEN, 'initial_pose': np.zeros(6)}),
    CueingParameters(GIVEN), ReferenceMotionParameters({
        'motion.type': 'sine', 'motion.initial': np.zeros(6)})]


def declared_types(kind: type[ParameterGroup], path: str = '') -> Iterator[tuple[str, Any]]:
    """Yield the names of parameters, and the types with which they are declared."""
    for name, hint in get_type_hints(kind).items():
        if isinstance(hint, type) and issubclass(hint, ParameterGroup):
            yield from declared_types(hint, f'{path}{name}.')
        elif name in kind._declarations:
            yield path + name, hint


@pytest.mark.parametrize('parameters', EACH_KIND)
def test_every_parameter_is_an_attribute_of_the_declared_type(parameters: ParameterSet) -> None:
    types = dict(declared_types(type(parameters)))
    assert list(types) == list(parameters.table) == list(parameters)
    for name, hint in types.items():
        value, parameter = attrgetter(name)(parameters), parameters.table[name]
        assert value is parameters[name]
        optional = type(None) in get_args(hint)
        if value is None:
            assert optional, name
        elif parameter.sizes and parameter.kind == 'double':
            assert value.dtype == np.float64
            assert hint in (Array, Array | None)
        elif parameter.sizes:
            assert hint == tuple[str, ...]
            assert all(type(each) is str for each in value)
        else:
            assert hint in (type(value), type(value) | None)
        assert not optional or not parameter.required and parameter.default in (None, ()), name


@pytest.mark.parametrize(('wrong', 'said'), [
    ('limits.force_mx', '; do you mean limits.force_max?'),
    ('cueing.tilt.rate', '; do you mean cueing.tilt.rate_max?'),
    ('legs.cylinder.mas', '; do you mean legs.cylinder.mass?'),
    ('gravitation', '')])
def test_a_misspelt_attribute_is_an_error_with_the_nearest_name(wrong: str, said: str) -> None:
    with pytest.raises(AttributeError) as caught:
        attrgetter(wrong)(Parameters(GIVEN))
    assert str(caught.value).startswith(f'parameters: {wrong}: unknown parameter{said}')


def test_attributes_are_those_of_a_copy_and_cannot_be_set(p: Parameters) -> None:
    later = p.replaced({'limits.force_max': 3.0, 'payload.mass': 2.0})
    assert p.limits.force_max is None
    for each in (later, pickle.loads(pickle.dumps(later)), deepcopy(later), copy(later)):
        assert each == later
        assert hash(each) == hash(later)
        assert each.limits.force_max is not None
        assert each.limits.force_max.tolist() == [3.0] * 6
        assert each.payload.body.mass == 2.0
    for group, name in ((p, 'gravity'), (p, 'limits'), (p.limits, 'force_max'),
                        (p.legs.cylinder, 'mass')):
        with pytest.raises(AttributeError, match=f'{name}: parameters are immutable'):
            setattr(group, name, None)
        with pytest.raises(AttributeError, match=f'{name}: parameters are immutable'):
            delattr(group, name)
    wrong = 'force_mx'
    with pytest.raises(AttributeError, match='do you mean limits.force_max'):
        setattr(p.limits, wrong, 3.0)
    assert 'velocity_max=None' in repr(p.limits)
    assert 'cylinder.mass=array' in repr(p.legs)


def test_values_that_follow_from_others_are_attributes_as_well(p: Parameters) -> None:
    driven = p.replaced({'actuator.screw_lead': 0.01, 'drive.motor_inertia': 1e-4})
    assert driven.actuator.reflected_mass is driven['actuator.reflected_mass']
    assert driven.actuator.reflected_mass.min() > 0.0
    assert driven.drive.back_driving_efficiency.tolist() == [1.0] * 6


def test_a_parameter_has_no_name_of_a_method() -> None:
    with pytest.raises(TypeError, match='Wrong.items: the name of a method'):
        class Wrong(ParameterSet):
            items: float = declare('something', 'm', 0.0)  # type: ignore[assignment]


@pytest.mark.parametrize(('name', 'shape'), [
    ('geometry.base_joints', (3, 6)),
    ('geometry.platform_joints', (2, 9)),
    ('geometry.base_joints', (1, 18)),
    ('drive.base_universal_axes', (3, 3, 2)),
    ('platform.inertia', (2, 3)),
    ('platform.inertia', (3, 3)),
    ('platform.center_of_mass', (3, 1)),
    ('platform.mass', (1, 1)),
    ('legs.piston.mass', (2, 3)),
    ('geometry.base_outline', (3, 4)),
    ('drive.torque_speed', (2, 3))])
def test_rows_that_are_not_those_of_the_parameter_are_rejected(
        p: Parameters, name: str, shape: tuple[int, ...], snapshot: Snapshot) -> None:
    values = np.arange(1.0, 1.0 + np.prod(shape)).reshape(shape)
    for each in (values, values.tolist()):
        with snapshot.raises(ParameterError):
            p.replaced({name: each})


def test_joints_are_taken_as_rows_and_flat(p: Parameters) -> None:
    joints = p['geometry.base_joints']
    for each in (joints, joints.ravel(), joints.tolist(), [*joints]):
        assert p.replaced({'geometry.base_joints': each}) == p
