# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Start the node with its parameters from a file; it becomes active by itself."""

import sys

from launch import Action, LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.ros.launch_arguments import check_files, check_launch_arguments

TOPICS = {
    'leg_forces': 'topic of the leg forces, as the commands of an effort controller',
    'leg_torques': 'topic of the torques of cranks, as the commands of an effort controller',
    'servo_pulses': 'topic of the pulse widths of servos, as that of their driver',
    'leg_trajectory': 'topic of the leg trajectories, as that of a joint_trajectory_controller',
    'measured_legs': 'topic of the measured legs, as /joint_states'}


def node(context: LaunchContext) -> list[Action]:
    """Return the node, once its file is checked."""
    file = LaunchConfiguration('params_file').perform(context)
    check_files({'params_file': (file, Parameters)})
    return [LogInfo(msg=f'params_file: {file}'), Node(
        package='stewart_dynamics',
        executable='stewart_dynamics',
        name='stewart_dynamics',
        namespace=LaunchConfiguration('namespace'),
        parameters=[file],
        remappings=[(f'~/{topic}', LaunchConfiguration(topic)) for topic in TOPICS],
        output='screen')]


def generate_launch_description() -> LaunchDescription:
    """Return the node and the arguments."""
    description = LaunchDescription([
        DeclareLaunchArgument(
            'params_file',
            default_value=PathJoinSubstitution(
                [FindPackageShare('stewart_dynamics'), 'config', 'platform.yaml']),
            description='YAML file with the parameters of the hexapod'),
        DeclareLaunchArgument(
            'namespace', default_value='', description='namespace of the node and its topics'),
        *(DeclareLaunchArgument(topic, default_value=f'~/{topic}', description=text)
          for topic, text in TOPICS.items()),
        OpaqueFunction(function=node),
    ])
    check_launch_arguments(
        __file__, sys.argv, [each.name for each in description.get_launch_arguments()])
    return description
