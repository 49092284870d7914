# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Files of config/ for other programs: RViz, Foxglove and the controller manager."""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
import re
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
from programs import call
import pytest
from referees import ROOT
from rosbags.highlevel import AnyReader
from stewart_dynamics import Parameters, Pose, StewartPlatform
from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.description.urdf import MOCK, Ros2Control, urdf
from stewart_dynamics.replay import main
from stewart_dynamics.replay.output_bag import RECORDED_TYPES, ROBOT_DESCRIPTION
import yaml

CONFIG = ROOT / 'config'
JOINTS = list(Parameters.from_yaml(CONFIG / 'platform.yaml')['joints'])
CONTROLLERS = sorted((CONFIG / 'controllers').glob('*.yaml'))

# Published only with ~/measured_legs connected.
MONITOR = '/stewart_dynamics/external_wrench'
# Foxglove's layouts: with a running node, and for the replay's output bags.
LIVE, OF_BAG = 'foxglove.json', 'foxglove_bag.json'


def rviz() -> dict[str, Any]:
    """Return RViz's configuration."""
    document: dict[str, Any] = yaml.safe_load(
        (CONFIG / 'stewart_dynamics.rviz').read_text(encoding='utf-8'))
    return document['Visualization Manager']


def foxglove(name: str = LIVE) -> dict[str, Any]:
    """Return one of Foxglove's layouts."""
    layout: dict[str, Any] = json.loads((CONFIG / name).read_text(encoding='utf-8'))
    return layout


# Displays of rviz_default_plugins in Jazzy (plugins_description.xml), with their message types.
DISPLAYS = {
    'Grid': None, 'Axes': None, 'MarkerArray': 'visualization_msgs/msg/MarkerArray',
    'Wrench': 'geometry_msgs/msg/WrenchStamped'}
# Message types that Foxglove's panels accept; the field that a Plot shows.
MARKERS = 'visualization_msgs/msg/MarkerArray'
DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
FIELDS = {
    'data': 'std_msgs/msg/Float64', 'data[n]': 'std_msgs/msg/Float64MultiArray',
    'effort[n]': 'sensor_msgs/msg/JointState', 'position[n]': 'sensor_msgs/msg/JointState',
    'wrench.force.x': 'geometry_msgs/msg/WrenchStamped',
    'wrench.torque.x': 'geometry_msgs/msg/WrenchStamped'}


def topics_of_rviz() -> dict[str, str]:
    """Return the topics that RViz is to show, and of which type."""
    found = {}
    for display in rviz()['Displays']:
        package, name = display['Class'].split('/')
        assert package == 'rviz_default_plugins'
        kind = DISPLAYS[name]
        assert ('Topic' in display) == (kind is not None)
        if kind is not None:
            found[display['Topic']['Value']] = kind
    return found


def topics_of_foxglove(layout: str = LIVE) -> dict[str, str]:
    """Return the topics that Foxglove is to show, and of which type."""
    found = {}
    for name, panel in foxglove(layout)['configById'].items():
        kind = name.partition('!')[0]
        if kind == '3D':
            found.update({topic: RECORDED_TYPES.get(topic, MARKERS) for topic in panel['topics']})
            assert ROBOT_DESCRIPTION in found
        elif kind in ('DiagnosticSummary', 'DiagnosticStatusPanel'):
            found[panel['topicToRender']] = DIAGNOSTICS
        else:
            assert kind == 'Plot'
            for path in panel['paths']:
                match = re.fullmatch(
                    r'(/[a-z_/]+)\.((?:data|effort|position)(?:\[[0-5]\])?'
                    r'|wrench\.(?:force|torque)\.[xyz])',
                    path['value'])
                if match is None:
                    assert path['value'] == '0'  # a line at zero
                    continue
                topic, field = match.groups()
                kind = FIELDS[re.sub(r'\.[xyz]$', '.x', re.sub(r'\[\d\]', '[n]', field))]
                assert found.setdefault(topic, kind) == kind
    return found


def test_rviz_shows_every_namespace_of_the_markers_in_the_base_frame() -> None:
    rclpy = pytest.importorskip('rclpy.serialization')
    from visualization_msgs.msg import MarkerArray

    from stewart_dynamics.node.markers import Markers
    from stewart_dynamics.setpoints.step import Batch, Step
    markers = []
    for name, height in (('platform.yaml', 1.1), ('crank_platform.yaml', 0.65)):
        parameters = Parameters.from_yaml(CONFIG / name)
        home = Batch.from_parts(1, (0.0, 0.0, height, *np.eye(3).ravel(), *(0.0,) * 12))
        message = rclpy.deserialize_message(Markers(parameters).write(
            home, Step(parameters)(home)), MarkerArray)
        markers += message.markers
    display, = (each for each in rviz()['Displays'] if each['Class'].endswith('/MarkerArray'))
    assert display['Namespaces'] == dict.fromkeys({marker.ns for marker in markers}, True)
    assert {rviz()['Global Options']['Fixed Frame']} == {
        marker.header.frame_id for marker in markers} == {parameters['base_frame']}


def test_the_layout_for_bags_shows_topics_of_the_output_bag(tmp_path: Path) -> None:
    call(main, CONFIG.parent / 'bags' / 'clear', '--params', CONFIG / 'platform.yaml', '--output',
         tmp_path / 'results', '--no-report')
    with AnyReader([tmp_path / 'results' / 'clear' / 'bag']) as reader:
        written = {each.topic: each.msgtype for each in reader.connections}
    shown = topics_of_foxglove(OF_BAG)
    assert shown == {topic: written[topic] for topic in shown}


def test_topics_are_those_that_the_node_publishes(node: Any) -> None:
    node.answer()

    def published(topic: str) -> list[str]:
        return [each.topic_type for each in node.peer.node.get_publishers_info_by_topic(topic)]

    shown = {**topics_of_rviz(), **topics_of_foxglove()}
    del shown[ROBOT_DESCRIPTION]  # of robot_state_publisher
    assert {'/stewart_dynamics/markers', '/stewart_dynamics/leg_states',
            '/stewart_dynamics/jacobian_determinant', '/diagnostics', MONITOR} <= set(shown)
    node.until(lambda: all(published(topic) for topic in set(shown) - {MONITOR}),
               'its topics are known')
    for topic, kind in shown.items():
        if topic != MONITOR or published(MONITOR):
            assert published(topic) == [kind]
    panel = foxglove()['configById']['DiagnosticStatusPanel!singularity']
    assert panel['selectedName'] == node.status('singularity').name
    assert panel['selectedHardwareId'] == node.status('singularity').hardware_id


# Controllers. What may be in a file, and the version of it: src/*_parameters.yaml of
# ros2_controllers 4.42.1 and of ros2_control 4.46.0, branches jazzy.

OF_MANAGER = {'update_rate': int}
TYPES = {'joint_state_broadcaster/JointStateBroadcaster',
         'effort_controllers/JointGroupEffortController',
         'joint_trajectory_controller/JointTrajectoryController'}
OF_GROUP = {'joints': list}
OF_TRAJECTORY = {
    'joints': list, 'command_joints': list, 'command_interfaces': list, 'state_interfaces': list,
    'allow_partial_joints_goal': bool, 'interpolate_from_desired_state': bool,
    'allow_integration_in_goal_trajectories': bool,
    'set_last_command_interface_value_as_state_on_activation': bool,
    'action_monitor_rate': float, 'interpolation_method': str,
    'allow_nonzero_velocity_at_trajectory_end': bool, 'cmd_timeout': float,
    'constraints.stopped_velocity_tolerance': float, 'constraints.goal_time': float,
    'constraints.decelerate_on_cancel': bool,
    **{f'constraints.JOINT.{name}': float for name in (
        'trajectory', 'goal', 'max_deceleration_on_cancel')},
    **{f'gains.JOINT.{name}': float for name in (
        'p', 'i', 'd', 'i_clamp_max', 'i_clamp_min', 'ff_velocity_scale', 'u_clamp_max',
        'u_clamp_min', 'tracking_time_constant', 'error_deadband')},
    'gains.JOINT.antiwindup_strategy': str}
# Some of those that joint_trajectory_controller/validate_jtc_parameters.hpp admits.
COMMANDS = (['effort'], ['position'], ['position', 'effort'], ['velocity'])
WITH_PID = (['effort'], ['velocity'])
ANTIWINDUP = ('back_calculation', 'conditional_integration', 'legacy', 'none')


def flat(tree: dict[str, Any], prefix: str = '') -> Iterator[tuple[str, Any]]:
    """Yield dotted names and values."""
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from flat(value, f'{prefix}{key}.')
        else:
            yield f'{prefix}{key}', value


def sections(path: Any) -> tuple[dict[str, str], dict[str, dict[str, Any]]]:
    """Return the controllers' types, and the parameters of those that have some."""
    document = yaml.safe_load(path.read_text(encoding='utf-8'))
    for section in document.values():
        assert set(section) == {'ros__parameters'}
    given = {name: section['ros__parameters'] for name, section in document.items()}
    manager = given.pop('controller_manager')
    types = {name: value.pop('type') for name, value in manager.items() if isinstance(value, dict)}
    assert not any(value for value in manager.values() if isinstance(value, dict))
    for name, value in manager.items():
        if name not in types:
            assert type(value) is OF_MANAGER[name]
    return types, given


@pytest.mark.parametrize('path', CONTROLLERS, ids=lambda path: path.name)
def test_controllers_have_parameters_that_they_know(path: Any) -> None:
    types, given = sections(path)
    assert set(types.values()) <= TYPES
    assert types['joint_state_broadcaster'] == 'joint_state_broadcaster/JointStateBroadcaster'
    name, = given
    known = OF_GROUP if types[name].startswith('effort_controllers/') else OF_TRAJECTORY
    parameters = dict(flat(given[name]))
    for key, value in parameters.items():
        general = '.'.join('JOINT' if part in JOINTS else part for part in key.split('.'))
        assert type(value) is known[general], key
    assert parameters['joints'] == JOINTS
    if known is OF_TRAJECTORY:
        assert parameters['command_interfaces'] in COMMANDS
        assert parameters['state_interfaces'] == ['position', 'velocity']
        has_gains = parameters['command_interfaces'] in WITH_PID
        assert set(given[name].get('gains', {})) == (set(JOINTS) if has_gains else set())
        assert JOINTS == [key for key in given[name]['constraints'] if key in JOINTS]
        assert {value for key, value in parameters.items()
                if key.endswith('antiwindup_strategy')} <= set(ANTIWINDUP)


@pytest.mark.parametrize('path', CONTROLLERS, ids=lambda path: path.name)
def test_controllers_use_interfaces_that_the_described_hexapod_has(path: Any) -> None:
    """Names and interfaces are those in the URDF of stewart_describe, and the file says how."""
    types, given = sections(path)
    (name, parameters), = given.items()
    commands = parameters.get('command_interfaces', ['effort'])
    assert path.name == '_'.join([*(['trajectory'] if 'trajectory' in name else []), *commands]
                                 ) + '.yaml'
    block = ET.fromstring(urdf(Hexapod(Parameters.from_yaml(CONFIG / 'platform.yaml')), 'hexapod',
                               Ros2Control(commands, MOCK))).find('ros2_control')
    assert block is not None
    described = {
        kind: {(joint.get('name'), each.get('name')) for joint in block.findall('joint')
               for each in joint.findall(f'{kind}_interface')} for kind in ('command', 'state')}
    joints = parameters['joints']
    assert described['command'] == {(joint, each) for joint in joints for each in commands}
    assert described['state'] >= {(joint, each) for joint in joints
                                  for each in parameters.get('state_interfaces', ())}
    # The commands in the comment: without effort the controller rejects points that have one.
    text = path.read_text(encoding='utf-8')
    assert f'{name}/' in text and f'spawner joint_state_broadcaster {name}' in text
    assert ('-p trajectory.effort:=false' in text) == ('effort' not in commands)


def test_the_example_gains_damp_every_mode_of_the_hexapod() -> None:
    """
    With p, i and d on each leg, m s^3 + d s^2 + p s + i = 0 for each mode of mass m.

    The modes of the legs are those of J^-T M J^-1; no payload adds more to a mode than its share.
    """
    platform = StewartPlatform.from_yaml(ROOT / 'config' / 'platform.yaml')
    home = Pose([0.0, 0.0, 1.1], np.eye(3))
    inverse = np.linalg.inv(platform.inverse_jacobian(home))
    masses = np.linalg.eigvalsh(inverse.T @ platform.mass_matrix(home) @ inverse)
    assert masses.round().astype(int).tolist()[::5] == [53, 338]  # as the file says
    file, = (yaml.safe_load(path.read_text(encoding='utf-8')) for path in CONTROLLERS
             if path.name == 'trajectory_effort.yaml')
    for gains in file['leg_trajectory_controller']['ros__parameters']['gains'].values():
        for factor, least in ((1.0, 0.7), (1.3, 0.6)):
            for mass in factor * masses:
                poles = np.roots([mass, gains['d'], gains['p'], gains['i']])
                assert min(-poles.real / np.abs(poles)) > least
