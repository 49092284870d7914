# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The reader of YAML files: what ROS's own reader gives, or a rejection in one line."""

from __future__ import annotations

import json
import os
from pathlib import Path
import subprocess
import sys

import pytest
from snapshot import Snapshot
from stewart_dynamics import ParameterError
from stewart_dynamics.parameters.yaml_file import no_space, read_document, read_value
import yaml

# Each as written in a file, and the value that both readers return.
VALUES = {
    # doubles
    '1e3': 1000.0, '1.e3': 1000.0, '1E5': 1e5, '5.': 5.0, '.5': 0.5, '+.5': 0.5, '-.5e-3': -5e-4,
    '-0.0': -0.0, '0e-999': 0.0, '100000000000000000000': 1e20, '1.0 # one': 1.0,
    '2.2250738585072014e-308': 2.0 ** -1022, '&a 1.0': 1.0,
    'inf': float('inf'), '-Infinity': -float('inf'), '.inf': float('inf'), '+.INF': float('inf'),
    '-.Inf': -float('inf'),
    # integers, which no parameter of the package is
    '0': 0, '-0': 0, '+5': 5,
    '9223372036854775807': 2 ** 63 - 1, '-9223372036854775808': -2 ** 63,
    # bools
    'yes': True, 'y': True, 'On': True, 'TRUE': True, 'no': False, 'N': False, 'off': False,
    # everything else is a text
    '1_000': '1_000', '0b101': '0b101', '0o17': '0o17', '1,5': '1,5', '1:30': '1:30',
    '2020-01-01': '2020-01-01', '1e': '1e', '0x': '0x',
    '1.5f': '1.5f', '.e3': '.e3', '.': '.', 'tRUE': 'tRUE', '=': '=',
    '<<': '<<', '\u0661': '\u0661', "'1.0'": '1.0', '"on"': 'on', "''": '', '!!str 1.0': '1.0',
    '|\n      5.0': '5.0\n', '1.0\n      2.0': '1.0 2.0', '"null"': 'null',
    # lists; the last as launch_ros writes one
    '[1.0, .inf, 3e0]': [1.0, float('inf'), 3.0], '[yes, off]': [True, False],
    '[1, 2]': [1, 2], '[a, "1"]': ['a', '1'],
    '!!python/tuple\n      - 1.0\n      - 2.0': [1.0, 2.0],
}


def file_of(path: Path, text: str) -> Path:
    """Return the path of a file with this text."""
    file = path / 'file.yaml'
    file.write_text(text, encoding='utf-8')
    return file


def parameters_of(texts: list[str]) -> str:
    """Return a file in which these are the parameters p0, p1 and so on."""
    return '/**:\n  ros__parameters:\n' + ''.join(
        f'    p{n}: {text}\n' for n, text in enumerate(texts))


def test_texts_have_the_meaning_that_they_have_to_ros(tmp_path: Path) -> None:
    file = file_of(tmp_path, parameters_of(list(VALUES)))
    found = list(read_document(file)['/**']['ros__parameters'].values())
    for text, value, expected in zip(VALUES, found, VALUES.values(), strict=True):
        assert repr(value) == repr(expected), text


# In its own process: a context of ROS and its arguments are the process's.
READ_BY_ROS = """\
import json, sys
import rclpy
from rclpy.node import Node
rclpy.init(args=['--ros-args', '--params-file', sys.argv[1]])
node = Node('reader', automatically_declare_parameters_from_overrides=True)
values = []
for n in range(int(sys.argv[2])):
    value = node.get_parameter(f'p{n}').value
    values.append(repr(list(value) if hasattr(value, 'tolist') else value))
print(json.dumps(values))
node.destroy_node()
rclpy.shutdown()
"""


def test_ros_itself_reads_the_same(tmp_path: Path, domain: int) -> None:
    pytest.importorskip('rclpy')
    file = file_of(tmp_path, parameters_of(list(VALUES)))
    read = subprocess.run(
        [sys.executable, '-c', READ_BY_ROS, str(file), str(len(VALUES))], check=True,
        capture_output=True, text=True, timeout=300,
        env={**os.environ, 'ROS_DOMAIN_ID': f'{domain}'})
    for text, value, expected in zip(
            VALUES, json.loads(read.stdout), VALUES.values(), strict=True):
        assert value == repr(expected), text


@pytest.mark.parametrize('text', ['~', 'null', 'Null', 'NULL'])
def test_null_is_no_value(tmp_path: Path, text: str) -> None:
    assert read_document(file_of(tmp_path, f'a: {text}\n')) == {'a': None}


def test_not_a_number_is_one_for_ros_in_all_its_spellings() -> None:
    found = read_value('[.nan, .NaN, nan, NAN, -nan]', 'x')
    assert all(isinstance(each, float) and each != each for each in found)


def test_a_document_of_any_form_is_read(tmp_path: Path) -> None:
    text = 'a:\n  - b: 1\n    c: [[x], {y: 2.0}]\n  -\n    - d\n1: {}\n2.0: []\n'
    assert read_document(file_of(tmp_path, text)) == {
        'a': [{'b': 1, 'c': [['x'], {'y': 2.0}]}, ['d']], '1': {}, '2.0': []}


def test_files_written_by_launch_are_read(tmp_path: Path) -> None:
    # launch_ros: yaml.dump, with tuples for the lists in ``parameters=[{...}]``.
    given = {'/**': {'ros__parameters': {
        'limits.force_max': (1000.0, 1e-5, -0.0), 'joints': ('a', 'true', '1e3', '2.0'),
        'platform.mass': 1e20, 'base_frame': "it's: [a] base", 'autostart': True}}}
    text = yaml.dump(given, default_flow_style=False)
    assert '!!python/tuple' in text
    read = read_document(file_of(tmp_path, text))['/**']['ros__parameters']
    # For YAML 1.1 '1e3' is a text and stands there without quotes, for ROS it is a double.
    assert read == {**given['/**']['ros__parameters'], 'limits.force_max': [1000.0, 1e-5, 0.0],
                    'joints': ['a', 'true', 1000.0, '2.0']}


@pytest.mark.parametrize('text', [
    '[' * 90_000, '{' * 90_000, '- ' * 45_000, '? ' * 45_000, 'a: ' * 30_000,
    '[\n' * 45_000, '%TAG !a! b\n' * 8_000, '---\n' * 22_500,
    ''.join(f'%TAG !{n}! b\n' for n in range(6_000)),
    '\u2028'.join(f'%TAG !{n}! b' for n in range(6_000)), '\r%TAG ! b' * 8_000,
    'a: &a [1]\nb: ' + '&b [*a, *a, *a]', 'a: !<' + '%20' * 20_000 + '> b', '!' * 90_000,
    'x: {<<: {a: 1}, <<: {a: 1}}', 'a: 1\na: 1', 'a: !<plain> {b: 1}', 'a: !!str [b]',
    'a: !!python/tuple b', 'a: !!map [b]'],
    ids=lambda text: repr(text[:10]))
def test_input_that_could_take_long_is_rejected_early(tmp_path: Path, text: str) -> None:
    with pytest.raises(ParameterError) as caught:
        read_document(file_of(tmp_path, text))
    message = str(caught.value)
    assert message.isprintable()
    assert len(message) < 300 + len(str(tmp_path))


@pytest.mark.parametrize('text', [
    '1' * 90_000 + 'x', '0x' + '1' * 90_000 + 'x', '.' + '1' * 90_000 + 'x', ' ' * 90_000 + 'x',
    '1e' + '1' * 90_000 + 'x', 'nan(' + 'a' * 90_000, '+' * 90_000])
def test_a_text_that_is_almost_a_number_is_a_text(tmp_path: Path, text: str) -> None:
    assert read_document(file_of(tmp_path, f'a: {text}\n')) == {'a': text.strip()}


def test_the_largest_file_may_be_chosen(tmp_path: Path, snapshot: Snapshot) -> None:
    file = file_of(tmp_path, 'a: 1\n' + '#' * 95)
    assert read_document(file, largest=100) == {'a': 1}
    with snapshot.raises(ParameterError):
        read_document(file, largest=99)


@pytest.mark.parametrize('text, name', [
    ('mass:150.0', 'mass'), ('  - mass:[1.0]', 'mass'), ('/**:{}', '/**'), ('a.b:c', 'a.b'),
    ('mass: 150.0', ''), ('mass:', ''), ('a::b', ''), ('5:30', ''), ('', '')])
def test_a_missing_space_is_found(text: str, name: str) -> None:
    assert no_space(text) == (f'a space is missing after the colon of {name}' if name else '')
