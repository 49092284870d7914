# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Start the node and show the hexapod as a model: robot_state_publisher, RViz with RobotModel.

    ros2 launch stewart_dynamics description.launch.py params_file:=my_hexapod.yaml

The robot description is the URDF that stewart_describe writes; the node gives the positions of all
its joints on joint_states. It needs robot_state_publisher and rviz2.
"""

from pathlib import Path
import sys

from launch import Action, LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.description.urdf import urdf
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.ros.launch_arguments import check_files, check_launch_arguments

PACKAGES = ('robot_state_publisher', 'rviz2')
JOINT_STATES = '/stewart_dynamics/joint_states'


def nodes(context: LaunchContext) -> list[Action]:
    """Return the three programs, once their packages and the file of the hexapod are found."""
    file = LaunchConfiguration('params_file').perform(context)
    check_files({'params_file': (file, Parameters)})
    for package in PACKAGES:
        if package != 'rviz2' or LaunchConfiguration('rviz').perform(context) == 'true':
            FindPackageShare(package).perform(context)  # raises before anything has started
    description = urdf(Hexapod(Parameters.from_yaml(file)), Path(file).stem)
    return [
        LogInfo(msg=f'params_file: {file}'),
        Node(package='stewart_dynamics', executable='stewart_dynamics', name='stewart_dynamics',
             parameters=[file], output='screen'),
        # It publishes the transform to the platform as well: publish_tf of the node stays false.
        Node(package='robot_state_publisher', executable='robot_state_publisher',
             parameters=[{'robot_description': ParameterValue(description, value_type=str)}],
             remappings=[('joint_states', JOINT_STATES)], output='screen'),
        Node(package='rviz2', executable='rviz2',
             arguments=['-d', LaunchConfiguration('rviz_file')],
             condition=IfCondition(LaunchConfiguration('rviz')), output='screen')]


def generate_launch_description() -> LaunchDescription:
    """Return the programs and the arguments."""
    config = PathJoinSubstitution([FindPackageShare('stewart_dynamics'), 'config'])
    description = LaunchDescription([
        DeclareLaunchArgument(
            'params_file', default_value=PathJoinSubstitution([config, 'platform.yaml']),
            description='YAML file with the parameters of the hexapod'),
        DeclareLaunchArgument('rviz', default_value='true', choices=['true', 'false'],
                              description='show it in RViz'),
        DeclareLaunchArgument(
            'rviz_file', default_value=PathJoinSubstitution([config, 'description.rviz']),
            description='configuration of RViz; its fixed frame is base_frame'),
        OpaqueFunction(function=nodes),
    ])
    check_launch_arguments(
        __file__, sys.argv, [each.name for each in description.get_launch_arguments()])
    return description
