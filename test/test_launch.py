# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The launch files under ROS's launch, which is not on PyPI: skipped where it is missing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import os
from pathlib import Path
import runpy
import sys
from xml.etree import ElementTree

import pytest

pytest.importorskip('launch_ros', reason='launch_ros comes with a ROS installation')

from rclpy.serialization import deserialize_message  # noqa: E402
from running import executable, Peer, Program, ROOT  # noqa: E402
from sensor_msgs.msg import Imu, JointState  # noqa: E402
from std_msgs.msg import Float64MultiArray  # noqa: E402

NAME = 'stewart_dynamics'
FILES = sorted(path.name for path in (ROOT / 'launch').glob('*.launch.py'))

# As ``ros2 launch`` runs a file.
RUN = """\
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
file, *arguments = sys.argv[1:]
service = LaunchService(argv=arguments)
service.include_launch_description(LaunchDescription([IncludeLaunchDescription(
    PythonLaunchDescriptionSource(file),
    launch_arguments=[argument.split(':=') for argument in arguments])]))
sys.exit(service.run())
"""

Launch = Callable[..., Program]


@pytest.fixture
def prefix(tmp_path: Path) -> Path:
    """Return an install space with the executables that are tested and the files as they are."""
    folder = tmp_path / 'prefix'
    share, scripts = folder / 'share' / NAME, folder / 'lib' / NAME
    index = folder / 'share' / 'ament_index' / 'resource_index' / 'packages'
    for each in (share, scripts, index):
        each.mkdir(parents=True)
    (index / NAME).touch()
    for name in ('config', 'examples', 'launch'):
        (share / name).symlink_to(ROOT / name)
    for name in ('stewart_cueing', 'stewart_dynamics', 'stewart_simulator', 'stewart_trajectory'):
        (scripts / name).symlink_to(executable(name))
    return folder


@pytest.fixture
def launch(peer: Peer, prefix: Path, tmp_path: Path) -> Iterator[Launch]:
    """Return a function that launches a file; all processes end with the test."""
    begun: list[Program] = []

    def begin(file: str, *arguments: str) -> Program:
        paths = filter(None, [str(prefix), os.environ.get('AMENT_PREFIX_PATH')])
        begun.append(Program(
            [sys.executable, '-c', RUN, ROOT / 'launch' / file, *arguments], peer.domain,
            tmp_path / 'launch', AMENT_PREFIX_PATH=os.pathsep.join(paths),
            PYTHONUNBUFFERED='1'))
        return begun[-1]

    yield begin
    for program in begun:
        if not program.ended:  # so that it ends its nodes
            program.stop()


def said(program: Program) -> str:
    """Return what launch and its nodes have printed."""
    return program.stdout + program.stderr


def nodes(peer: Peer) -> set[str]:
    """Return the other nodes that are found."""
    return set(peer.node.get_node_names()) - {peer.node.get_name()}


@pytest.mark.parametrize('factor', ['abc', 'nan'])
def test_a_payload_that_is_no_number_ends_the_launch(
        launch: Launch, peer: Peer, factor: str) -> None:
    program = launch('demo.launch.py', f'payload_factor:={factor}')
    assert program.wait() == 1
    assert f'payload_factor: {factor}: must be a number above 0' in said(program)
    assert 'process started' not in said(program)
    peer.spin(0.5)
    assert nodes(peer) == set()


@pytest.mark.parametrize('file', FILES)
@pytest.mark.parametrize(('argument', 'words'), [
    ('params_file:=/nowhere/hexapod.yaml', 'params_file: /nowhere/hexapod.yaml: no such file'),
    ('param_file:=/my/hexapod.yaml', 'param_file: unknown argument; did you mean params_file?')])
def test_a_wrong_argument_is_named_and_starts_nothing(
        launch: Launch, file: str, argument: str, words: str) -> None:
    program = launch(file, argument)
    assert program.wait() == 1
    assert words in said(program)
    assert 'process started' not in said(program)


@pytest.mark.parametrize('path', sorted((ROOT / 'config' / 'controllers').glob('*.yaml')),
                         ids=lambda path: path.name)
def test_the_mock_hardware_has_the_interfaces_of_the_controllers_file(path: Path) -> None:
    module = runpy.run_path(str(ROOT / 'launch' / 'ros2_control.launch.py'))
    if path.name == 'effort.yaml':
        with pytest.raises(RuntimeError, match='effort.yaml: has no leg_trajectory_controller'):
            module['command_interfaces'](str(path))
        return
    interfaces = module['command_interfaces'](str(path))
    assert path.name == f'trajectory_{"_".join(interfaces)}.yaml'
    described = ElementTree.fromstring(module['robot_description'](
        str(ROOT / 'config' / 'platform.yaml'), '', interfaces))
    for joint in described.findall('ros2_control/joint'):
        assert [each.get('name') for each in joint.findall('command_interface')] == interfaces


@pytest.mark.slow
def test_topics_of_the_node_are_remapped(launch: Launch, peer: Peer) -> None:
    program = launch(
        'stewart_dynamics.launch.py', 'leg_forces:=/efforts/commands', 'namespace:=cell',
        'leg_trajectory:=/follower/joint_trajectory', 'measured_legs:=/joint_states')
    peer.until(lambda: peer.node.count_publishers('/efforts/commands')
               and peer.node.count_publishers('/follower/joint_trajectory')
               and peer.node.count_subscribers('/joint_states')
               and peer.node.count_subscribers('/cell/stewart_dynamics/setpoint/pose'),
               'all topics are there')
    for topic in ('leg_forces', 'leg_trajectory', 'measured_legs'):
        assert not peer.node.get_publishers_info_by_topic(f'/cell/stewart_dynamics/{topic}')
        assert not peer.node.get_subscriptions_info_by_topic(f'/cell/stewart_dynamics/{topic}')
    assert program.stop() == 0
    peer.until(lambda: nodes(peer) == set(), 'the node has ended')


@pytest.mark.slow
def test_the_demo_runs_and_ends(launch: Launch, peer: Peer) -> None:
    measured = peer.listen('/stewart_simulator/leg_states', JointState)
    commands = peer.listen('/stewart_simulator/commands', Float64MultiArray)
    program = launch('demo.launch.py', 'payload_factor:=1.3')
    peer.until(lambda: len(commands) > 100 and len(measured) > 100, 'the loop runs')
    assert nodes(peer) == {
        'leg_controller', 'stewart_dynamics', 'stewart_simulator', 'stewart_trajectory'}
    assert program.stop() == 0
    assert said(program).count('process has finished cleanly') == 4, said(program)
    peer.until(lambda: nodes(peer) == set(), 'all have ended')


@pytest.mark.slow
def test_the_demo_begins_where_the_motion_of_another_hexapod_does(
        launch: Launch, peer: Peer) -> None:
    measured = peer.listen('/stewart_simulator/leg_states', JointState)
    commands = peer.listen('/stewart_simulator/commands', Float64MultiArray)
    program = launch('demo.launch.py', f'params_file:={ROOT / "config" / "crank_platform.yaml"}',
                     f'trajectory_file:={ROOT / "config" / "trajectory_cranks.yaml"}')
    peer.until(lambda: len(commands) > 100 and len(measured) > 100, 'the loop runs')
    assert program.stop() == 0
    assert 'cannot reach' not in said(program)


@pytest.mark.slow
@pytest.mark.parametrize('file', ['demo.launch.py', 'cueing.launch.py'])
def test_a_loop_ends_with_one_of_its_programs(
        launch: Launch, peer: Peer, tmp_path: Path, file: str) -> None:
    """A parameter that only the running simulator can judge; the others would go on forever."""
    simulation = tmp_path / 'simulation.yaml'
    simulation.write_text('/**:\n  ros__parameters:\n    initial_pose: [0., 0., 9., 0., 0., 0.]\n')
    program = launch(file, f'simulator_file:={simulation}')
    program.wait()
    assert 'stewart_simulator: ' in said(program)
    assert 'process[stewart_simulator-2] was required: shutting down' in said(program)
    peer.until(lambda: nodes(peer) == set(), 'all have ended')


@pytest.mark.slow
def test_a_drive_moves_the_simulated_hexapod(launch: Launch, peer: Peer) -> None:
    """Vehicle, motion cueing, node, simulator and controller: the legs follow, and all end."""
    felt = peer.listen('/stewart_cueing/felt', Imu)
    legs = peer.listen('/stewart_simulator/leg_states', JointState)
    program = launch('cueing.launch.py')

    def moved() -> bool:
        positions = [deserialize_message(data, JointState).position[0] for data in legs[::100]]
        return bool(felt) and max(positions, default=0.0) - min(positions, default=0.0) > 5e-3

    peer.until(moved, 'the simulated legs move')
    assert nodes(peer) == {'leg_controller', 'stewart_cueing', 'stewart_dynamics',
                           'stewart_simulator', 'town_drive'}
    assert program.stop() == 0
    assert said(program).count('process has finished cleanly') == 5, said(program)
    peer.until(lambda: nodes(peer) == set(), 'all have ended')


@pytest.mark.slow
def test_two_hexapods_run_beside_each_other(launch: Launch, peer: Peer) -> None:
    program = launch('two_hexapods.launch.py', 'names:=one,two')
    peer.until(lambda: all(peer.node.count_subscribers(f'/{name}/stewart_dynamics/setpoint/pose')
                           for name in ('one', 'two')), 'both nodes are there')
    assert program.stop() == 0
    peer.until(lambda: nodes(peer) == set(), 'both have ended')


@pytest.mark.parametrize('names', ['left', 'left,left', 'left,Right', 'a,b,c'])
def test_names_of_two_hexapods_are_two_namespaces(launch: Launch, names: str) -> None:
    program = launch('two_hexapods.launch.py', f'names:={names}')
    assert program.wait() == 1
    assert f'names: {names}: must be two different namespaces' in said(program)
