# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""stewart_init: answers on the standard input, and the parameter file that they give."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
import pty
import signal
from xml.etree import ElementTree

import jsonschema
import numpy as np
from programs import Ended, run_program
import pytest
from referees import ROOT
from snapshot import Snapshot
from stewart_dynamics import Parameters, StewartPlatform
from stewart_dynamics.cueing.cueing_parameters import CueingParameters
from stewart_dynamics.executables import executable
from stewart_dynamics.legs import example_file, example_names, TELESCOPIC
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters
import yaml

PROGRAM = 'stewart_init'
FILES = ['my_hexapod.svg', 'my_hexapod.yaml', 'parameters.schema.json']
TELESCOPIC_EXAMPLE = Parameters.from_yaml(example_file(TELESCOPIC.name))
# Kind, joints, units, and 16 parameters of telescopic legs as in the example.
BEGIN, KEPT = ['telescopic', '', '', ''], [''] * len(TELESCOPIC_EXAMPLE.given)


def answer(folder: Path, *lines: str, arguments: tuple[str, ...] = (), code: int | None = 0,
           ) -> Ended:
    """Run the program in a folder, with these answers."""
    return run_program(executable(PROGRAM), *arguments, code=code, folder=folder,
                       text=''.join(f'{line}\n' for line in lines))


def changed(**answers: str) -> list[str]:
    """Return the answers with some of them in place of the example's, by the last of the name."""
    names = [name.replace('.', '_') for name in TELESCOPIC_EXAMPLE.given]
    lines = list(KEPT)
    for name, text in answers.items():
        lines[names.index(name)] = text
    return lines


def comments_of(text: str) -> str:
    """Return a file as one line, so that a comment may have a line's end anywhere."""
    return ' '.join(text.replace('#', '').split())


@pytest.mark.parametrize('kind', example_names())
def test_enter_at_every_question_gives_the_example(kind: str, tmp_path: Path) -> None:
    expected = Parameters.from_yaml(example_file(kind))
    done = answer(tmp_path, kind, '', '', '', *[''] * len(expected.given))
    assert done.err == ''
    assert sorted(path.name for path in tmp_path.iterdir()) == FILES
    file = tmp_path / 'my_hexapod.yaml'
    for each in (Parameters, SimulatorParameters, CueingParameters):
        each.check_file(file)  # before ROS reads it
    parameters = Parameters.from_yaml(file)
    assert parameters == expected
    assert StewartPlatform(parameters).check() == ()
    text = file.read_text()
    assert text.startswith('# yaml-language-server: $schema=parameters.schema.json\n')
    comments = comments_of(text)
    assert comments.count('value of the example') == len(expected.given)
    assert all(Parameters.table[name].text in comments for name in expected.given)
    assert all(len(line) <= 99 for line in text.splitlines())
    schema = (tmp_path / 'parameters.schema.json').read_text()
    assert schema == (ROOT / 'config' / 'parameters.schema.json').read_text()
    jsonschema.Draft7Validator(json.loads(schema)).validate(yaml.safe_load(text))
    picture = ElementTree.parse(tmp_path / 'my_hexapod.svg').getroot()
    assert picture.tag == '{http://www.w3.org/2000/svg}svg'
    assert 'next: stewart_capability --params my_hexapod.yaml' in done.out


def test_millimeters_and_degrees_become_meters_and_radians(tmp_path: Path) -> None:
    done = answer(tmp_path, *BEGIN, *changed(
        geometry_base_radius='305', geometry_base_angles='-13, 13, 107, 133, 227 253',
        limits_length_max='515', limits_velocity_max='123', platform_mass='20', limits_force_max=(
            '200 210 220 230 240 250')), arguments=('rig.yaml',))
    assert done.err == ''
    file = tmp_path / 'rig.yaml'
    found = Parameters.from_yaml(file)
    assert found == TELESCOPIC_EXAMPLE.replaced({
        'geometry.base_radius': 0.305, 'geometry.base_angles': [
            round(math.radians(each), 9) for each in (-13, 13, 107, 133, 227, 253)],
        'limits.length_max': 0.515, 'limits.velocity_max': 0.123, 'platform.mass': 20.0,
        'limits.force_max': [200.0, 210.0, 220.0, 230.0, 240.0, 250.0]})
    # 10 of the 16 are not those of the owner.
    assert comments_of(file.read_text()).count('value of the example') == 10
    assert '10 of 16 numbers' in done.out


def test_joints_as_points_are_asked_leg_by_leg_in_meters(tmp_path: Path) -> None:
    points = TELESCOPIC_EXAMPLE.geometry.base_joints + [0.0, 0.01, 0.0]
    rows = [' '.join(map(repr, row.tolist())) for row in points]
    done = answer(tmp_path, 't', 'p', 'm', 'rad', *rows, *[''] * 18)
    assert done.err == ''
    found = Parameters.from_yaml(tmp_path / 'my_hexapod.yaml')
    assert np.array_equal(found.geometry.base_joints, points)
    assert np.array_equal(found.geometry.platform_joints,
                          TELESCOPIC_EXAMPLE.geometry.platform_joints)
    assert 'geometry.base_radius' not in found.given


def test_a_bad_answer_gets_one_line_and_is_asked_for_again(
        tmp_path: Path, snapshot: Snapshot) -> None:
    bad = ['servo', '300, 200', '0', 'wide', '1_0', '-']
    done = answer(tmp_path, bad[0], *BEGIN, *bad[1:5], '310', *KEPT[1:-1], bad[5])
    assert len(done.err.splitlines()) == 5
    snapshot(done.err)
    found = Parameters.from_yaml(tmp_path / 'my_hexapod.yaml')
    assert found.geometry.base_radius == 0.31
    assert found.limits.force_max is None  # left out


def test_answers_that_break_a_rule_together_can_be_changed(
        tmp_path: Path, snapshot: Snapshot) -> None:
    done = answer(tmp_path, *BEGIN, *changed(limits_length_min='600'),
                  'limits.length', '', '601', 'limits.length_max', '700')
    snapshot(done.err)
    found = Parameters.from_yaml(tmp_path / 'my_hexapod.yaml').limits
    assert (found.length_min[0], found.length_max[0]) == (0.601, 0.7)


def test_possible_errors_are_reported(tmp_path: Path) -> None:
    done = answer(tmp_path, *BEGIN, *changed(geometry_base_radius='3000'))
    line, = done.err.splitlines()
    assert line.startswith('stewart_init: warning: limits.length_min: ')


def test_no_file_is_replaced_unless_the_answer_is_yes(tmp_path: Path) -> None:
    file = tmp_path / 'my_hexapod.yaml'
    file.write_text('mine\n')
    for lines in ((), ('',), ('no', *BEGIN, *KEPT)):
        done = answer(tmp_path, *lines, code=2)
        assert done.err.count('\n') == 1
        assert file.read_text() == 'mine\n'
        assert [path.name for path in tmp_path.iterdir()] == [file.name]
    for lines, arguments in ((('yes',), ()), (('y',), ()), ((), ('--force',))):
        file.write_text('mine\n')
        answer(tmp_path, *lines, *BEGIN, *KEPT, arguments=arguments)
        assert Parameters.from_yaml(file) == TELESCOPIC_EXAMPLE
    # The schema is replaced by another one alone.
    for name in FILES[:2]:
        (tmp_path / name).unlink()
    answer(tmp_path, *BEGIN, *KEPT)
    (tmp_path / FILES[2]).write_text('{}\n')
    assert 'parameters.schema.json exists' in answer(tmp_path, 'no', code=None).out


@pytest.mark.parametrize('count', [0, 3, 19])
def test_nothing_is_written_when_the_input_ends(count: int, tmp_path: Path) -> None:
    done = answer(tmp_path, *[*BEGIN, *KEPT][:count], code=2)
    assert done.err.startswith('stewart_init: the input ended before the answer to ')
    assert done.err.count('\n') == 1
    assert not list(tmp_path.iterdir())


def test_nothing_is_written_after_ctrl_c(tmp_path: Path) -> None:
    """On a terminal, which the program reads and edits by readline."""
    pid, terminal = pty.fork()
    if pid == 0:  # the program
        os.chdir(tmp_path)
        os.execv(executable(PROGRAM), [PROGRAM])
    shown = b''
    while b'(cranks): ' not in shown:
        shown += os.read(terminal, 1024)
    os.write(terminal, b'telescopic\n')
    while b'(circles): ' not in shown:
        shown += os.read(terminal, 1024)
    # The interpreter overlooks a signal between its prompt and its wait for an answer.
    while Path(f'/proc/{pid}/stat').read_text(encoding='utf-8').split()[2] != 'S':
        os.sched_yield()
    os.write(terminal, b'\x03')
    try:
        while part := os.read(terminal, 1024):
            shown += part
    except OSError:  # it has ended
        pass
    _, status = os.waitpid(pid, 0)
    os.close(terminal)
    assert os.waitstatus_to_exitcode(status) == 128 + signal.SIGINT
    assert shown.decode().splitlines()[-1] == 'stewart_init: interrupted: nothing is written'
    assert not list(tmp_path.iterdir())


def test_a_file_of_another_kind_is_rejected(tmp_path: Path) -> None:
    done = answer(tmp_path, arguments=('rig.svg',), code=2)
    assert "'rig.svg': must end with .yaml" in done.err


def test_an_answer_without_numbers_is_asked_again(tmp_path: Path) -> None:
    done = answer(tmp_path, *BEGIN, ',', *KEPT)
    assert done.err.count('\n') == 1
    assert 'must be a single double' in done.err


def test_a_file_that_cannot_be_written_is_named_before_the_questions(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('')
    (tmp_path / 'folder.yaml').mkdir()
    for name in ('file/hexapod.yaml', 'folder.yaml'):
        done = answer(tmp_path, *BEGIN, *KEPT, arguments=(name,), code=2)
        assert done.out == ''
        assert done.err.count('\n') == 1
        assert name.partition('/')[0] in done.err
    assert sorted(path.name for path in tmp_path.iterdir()) == ['file', 'folder.yaml']
