# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
Start controller manager, a joint_trajectory_controller and the node, as an example to copy.

    ros2 launch stewart_dynamics ros2_control.launch.py

and then examples/plan_motion.py, which starts from the measured legs, with two topics remapped:
stewart_dynamics/leg_trajectory:=/leg_trajectory_controller/joint_trajectory and
stewart_dynamics/measured_legs:=/joint_states.

Without urdf_file the robot description is that of stewart_describe with the hardware
mock_components/GenericSystem, whose state follows the commands. It needs ros2_control,
ros2_controllers and robot_state_publisher.
"""

from pathlib import Path
import sys

from launch import Action, LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.description.urdf import MOCK, Ros2Control, urdf
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.ros.launch_arguments import check_files, check_launch_arguments
import yaml

PACKAGES = ('controller_manager', 'joint_state_broadcaster', 'joint_trajectory_controller',
            'robot_state_publisher')
CONTROLLER = 'leg_trajectory_controller'
FILES = {
    'params_file': ('platform.yaml', 'YAML file with the parameters of the hexapod'),
    'controllers_file': ('controllers/trajectory_position_effort.yaml',
                         f'YAML file of the controller manager, with {CONTROLLER}')}


def command_interfaces(controllers_file: str) -> list[str]:
    """Return the interfaces of the legs that a file commands."""
    document = yaml.safe_load(Path(controllers_file).read_text(encoding='utf-8'))
    try:
        interfaces: list[str] = document[CONTROLLER]['ros__parameters']['command_interfaces']
    except (KeyError, TypeError):
        raise RuntimeError(f'controllers_file: {controllers_file}: has no {CONTROLLER} with '
                           'command_interfaces') from None
    return interfaces


def robot_description(params_file: str, urdf_file: str, interfaces: list[str]) -> str:
    """Return the URDF of a file, or that of the hexapod with mock hardware."""
    if urdf_file:
        return Path(urdf_file).read_text(encoding='utf-8')
    return urdf(Hexapod(Parameters.from_yaml(params_file)), 'hexapod',
                Ros2Control(interfaces, MOCK))


def nodes(context: LaunchContext) -> list[Action]:
    """Return all nodes, once their packages and files are found."""
    files = {name: LaunchConfiguration(name).perform(context) for name in FILES}
    urdf_file = LaunchConfiguration('urdf_file').perform(context)
    check_files({'params_file': (files['params_file'], Parameters),
                 'controllers_file': (files['controllers_file'], None),
                 **({'urdf_file': (urdf_file, None)} if urdf_file else {})})
    for package in PACKAGES:
        FindPackageShare(package).perform(context)  # raises before anything has started
    controllers = files['controllers_file']
    interfaces = command_interfaces(controllers)
    description = robot_description(files['params_file'], urdf_file, interfaces)
    return [
        LogInfo(msg=', '.join(f'{name}: {file}' for name, file in (
            files | {'urdf_file': urdf_file or 'written from params_file'}).items())),
        Node(package='robot_state_publisher', executable='robot_state_publisher',
             parameters=[{'robot_description': ParameterValue(description, value_type=str)}],
             output='screen'),
        # The spawner's file is the manager's as well: it has the types of the controllers.
        Node(package='controller_manager', executable='ros2_control_node',
             parameters=[controllers], remappings=[('~/robot_description', '/robot_description')],
             output='screen'),
        Node(package='controller_manager', executable='spawner',
             arguments=['joint_state_broadcaster', CONTROLLER, '--param-file', controllers],
             output='screen'),
        Node(package='stewart_dynamics', executable='stewart_dynamics', name='stewart_dynamics',
             # The controller rejects efforts that it does not command.
             parameters=[files['params_file'], *(
                 [] if 'effort' in interfaces else [{'trajectory.effort': False}])],
             remappings=[('~/leg_trajectory', f'/{CONTROLLER}/joint_trajectory'),
                         ('~/measured_legs', '/joint_states')],
             output='screen')]


def generate_launch_description() -> LaunchDescription:
    """Return the nodes and the arguments."""
    share = FindPackageShare('stewart_dynamics')
    description = LaunchDescription([
        *(DeclareLaunchArgument(
            name, default_value=PathJoinSubstitution([share, 'config', file]), description=text)
          for name, (file, text) in FILES.items()),
        DeclareLaunchArgument(
            'urdf_file', default_value='',
            description='URDF with the legs as joints and a block ros2_control; empty: that of '
                        'params_file with mock hardware'),
        OpaqueFunction(function=nodes),
    ])
    check_launch_arguments(
        __file__, sys.argv, [each.name for each in description.get_launch_arguments()])
    return description
