# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The command stewart_describe: its files, messages and exit codes."""

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from programs import call
import pytest

from stewart_dynamics import Parameters
from stewart_dynamics.description import main
from test_circles import ON_CIRCLES

PROGRAM = 'stewart_describe'

PLATFORM = Path(__file__).parents[1] / 'config' / 'platform.yaml'


def test_all_files_are_written_and_nothing_is_said(tmp_path):
    printed = call(main, '--params', PLATFORM, '--output', tmp_path)
    names = ['platform.urdf', 'platform.sdf', 'platform.xml', 'platform.svg',
             'platform_loops.yaml', 'platform_scene.xml']
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)
    assert printed.out.split() == [str(tmp_path / name) for name in names]
    assert printed.err == ''


def test_existing_files_are_kept_unless_replacement_is_requested(tmp_path, snapshot):
    (tmp_path / 'a.sdf').write_text('mine')
    given = '--params', PLATFORM, '--output', tmp_path, '--name', 'a'
    snapshot(call(main, *given, code=2).err)
    assert [path.name for path in tmp_path.iterdir()] == ['a.sdf']
    call(main, *given, '--force')
    assert (tmp_path / 'a.sdf').read_text() != 'mine'


def test_the_parameters_are_those_of_a_node_by_its_name(tmp_path):
    stacked = PLATFORM.with_name('stacked.yaml')
    call(main, '--params', stacked, '--node', 'upper_hexapod', '--output', tmp_path)
    assert '<link name="stage">' in (tmp_path / 'stacked.urdf').read_text()
    call(main, '--params', stacked, '--output', tmp_path, '--force', code=2)


@pytest.mark.parametrize('kind', ['urdf', 'sdf', 'xml'])
def test_each_file_is_read_into_a_parameter_file_that_the_node_takes(kind, tmp_path):
    if kind == 'xml':
        pytest.importorskip('mujoco')
    printed = call(main, '--params', PLATFORM, '--output', tmp_path).err
    printed += call(main, '--from', tmp_path / f'platform.{kind}', '--output',
                    tmp_path / 'read').err
    read = Parameters.from_yaml(tmp_path / 'read' / 'platform.yaml')
    assert read['limits.velocity_max'] == pytest.approx([0.5] * 6)
    assert printed == ''


def test_possible_errors_are_warnings_and_exit_code_1_with_strict(tmp_path, snapshot):
    p = Parameters.from_yaml(PLATFORM)
    joints = p['geometry.base_joints'].copy()
    joints[0, 1] *= -1.0
    p.replaced({'geometry.base_joints': joints}).to_yaml(tmp_path / 'wrong.yaml')
    given = '--params', tmp_path / 'wrong.yaml', '--output', tmp_path
    snapshot(call(main, *given).err)
    call(main, *given, '--force', '--strict', code=1)
    call(main, '--from', tmp_path / 'wrong.sdf', '--output', tmp_path / 'read', '--strict', code=1)


def test_zero_gravity_of_a_file_is_said_once(tmp_path, snapshot):
    pytest.importorskip('mujoco')
    Parameters.from_yaml(PLATFORM).replaced({'gravity': [0.0, 0.0, 0.0]}).to_yaml(
        tmp_path / 'orbit.yaml')
    call(main, '--params', tmp_path / 'orbit.yaml', '--output', tmp_path)
    error = call(main, '--from', tmp_path / 'orbit.xml', '--output', tmp_path / 'read').err
    (said,) = [line for line in error.splitlines() if 'gravity' in line]
    snapshot(said)


@pytest.mark.parametrize(('hardware', 'plugin'), [
    ('topic', 'joint_state_topic_hardware_interface/JointStateTopicSystem'),
    ('joint_command', 'joint_command_topic_hardware_interface/JointCommandTopicSystem')])
@pytest.mark.parametrize('interfaces', ['effort', 'velocity', 'position,effort', 'position'])
def test_the_block_of_ros2_control_is_written_by_option(tmp_path, hardware, plugin, interfaces):
    """Hardware over topics publishes each command, not only those that differ from the state."""
    call(main, '--params', PLATFORM, '--output', tmp_path, '--ros2-control', interfaces,
         '--hardware', hardware)
    block = ET.parse(tmp_path / 'platform.urdf').find('ros2_control')
    assert block.findtext('hardware/plugin') == plugin
    assert len(block.findall('joint/command_interface')) == 6 * len(interfaces.split(','))
    assert {each.get('name'): each.text for each in block.findall('hardware/param')} == {
        'joint_commands_topic': '/hexapod/joint_commands',
        'joint_states_topic': '/hexapod/joint_states', 'trigger_joint_command_threshold': '-1'}


@pytest.mark.parametrize('arguments', [
    ['--params', 'none.yaml'], ['--from', 'none.urdf'], ['--from', str(PLATFORM)],
    ['--from', 'none.urdf', '--ros2-control', 'effort']])
def test_bad_input_is_exit_code_2_and_one_line(arguments, tmp_path, snapshot):
    printed = call(main, *arguments, '--output', tmp_path, code=2)
    assert printed.err.startswith('stewart_describe: ')
    snapshot(printed.err)
    assert printed.err.count('\n') == 1
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize('arguments', [
    [], ['--params', 'a', '--from', 'b'], ['--params', 'a', '--name', 'a/b'],
    ['--params', 'a', '--ros2-control', 'torque']])
def test_wrong_arguments_are_explained(arguments):
    assert 'usage: stewart_describe' in call(main, *arguments, code=2).err


def test_joints_on_circles_are_written_as_points(tmp_path):
    on_circles = tmp_path / 'circles.yaml'
    ON_CIRCLES.to_yaml(on_circles)
    call(main, '--params', on_circles, '--output', tmp_path)
    written = Parameters.from_yaml(tmp_path / 'circles_points.yaml')
    assert written == ON_CIRCLES.with_points()
    text = (tmp_path / 'circles_points.yaml').read_text()
    assert not any(each in text for each in ('_radius', '_angles', '_height'))
    assert 'geometry.base_joints' in written.given
    call(main, '--from', tmp_path / 'circles.urdf', '--output', tmp_path / 'read')
    read = Parameters.from_yaml(tmp_path / 'read' / 'circles.yaml')
    assert np.array_equal(read['geometry.base_joints'], written['geometry.base_joints'])


def test_a_description_is_read_back_in_its_own_folder(tmp_path):
    """The picture that is there already needs no --force, but another one is not replaced."""
    call(main, '--params', PLATFORM, '--output', tmp_path)
    call(main, '--from', tmp_path / 'platform.urdf', '--output', tmp_path)
    assert Parameters.from_yaml(tmp_path / 'platform.yaml')
    (tmp_path / 'platform.yaml').unlink()
    (tmp_path / 'platform.svg').write_text('<svg>of mine</svg>')
    error = call(main, '--from', tmp_path / 'platform.urdf', '--output', tmp_path, code=2).err
    assert 'platform.svg: exists; --force replaces it' in error
    assert not (tmp_path / 'platform.yaml').exists()
    assert (tmp_path / 'platform.svg').read_text() == '<svg>of mine</svg>'


@pytest.mark.parametrize('source', ['params', 'from'])
def test_a_picture_shows_all_joints_with_the_numbers_of_their_legs(source, tmp_path):
    call(main, '--params', PLATFORM, '--output', tmp_path)
    picture = tmp_path / 'platform.svg'
    if source == 'from':
        call(main, '--from', tmp_path / 'platform.urdf', '--output', tmp_path / 'read')
        picture = tmp_path / 'read' / 'platform.svg'
    tree = ET.parse(picture)
    texts = [each.text for each in tree.iter('{http://www.w3.org/2000/svg}text')]
    # From above each joint has a number of its own; from the front pairs are behind each other.
    for leg in range(1, 7):
        assert texts.count(str(leg)) == 2
    assert texts.count('1, 6') == texts.count('2, 5') == texts.count('3, 4') == 2
    assert '0.8803, 0.1871, 0' in [text.replace(',  ', ', ') for text in texts]
    circles = list(tree.iter('{http://www.w3.org/2000/svg}circle'))
    assert len(circles) == 2 * 12
