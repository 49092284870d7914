# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
Start a vehicle, motion cueing, node, simulator and an example controller, in real time.

    ros2 launch stewart_dynamics cueing.launch.py vehicle:=false
"""

import sys
from typing import Any

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

from stewart_dynamics.ros.launch_arguments import check_launch_arguments

FILES = {
    'params_file': ('platform.yaml', 'YAML file with the parameters of the hexapod, and cueing.*'),
    'simulator_file': ('simulator.yaml', 'YAML file with the parameters of the simulation')}


def generate_launch_description() -> LaunchDescription:
    """Return the nodes and the arguments."""
    package = FindPackageShare('stewart_dynamics')
    file, simulator_file = (LaunchConfiguration(name) for name in FILES)
    common: dict[str, Any] = {'output': 'screen'}

    def example(name: str, condition: Any = None, **more: Any) -> Node:
        # An example to copy, not an executable of the package.
        return Node(executable=sys.executable, name=name, condition=condition,
                    arguments=[PathJoinSubstitution([package, 'examples', f'{name}.py'])],
                    **more, **common)

    description = LaunchDescription([
        *(DeclareLaunchArgument(
            name, default_value=PathJoinSubstitution([package, 'config', default]),
            description=text) for name, (default, text) in FILES.items()),
        DeclareLaunchArgument(
            'vehicle', default_value='true', choices=['true', 'false'],
            description='drive through town (examples/town_drive.py); false: publish yours on '
                        '/stewart_cueing/vehicle'),
        Node(package='stewart_dynamics', executable='stewart_dynamics', name='stewart_dynamics',
             parameters=[file],
             remappings=[('~/measured_legs', '/stewart_simulator/leg_states')], **common),
        Node(package='stewart_dynamics', executable='stewart_simulator', name='stewart_simulator',
             parameters=[file, simulator_file], **common),
        example('leg_controller', parameters=[{'params_file': file}]),
        Node(package='stewart_dynamics', executable='stewart_cueing', name='stewart_cueing',
             parameters=[file],
             remappings=[('~/measured_legs', '/stewart_simulator/leg_states')], **common),
        example('town_drive', IfCondition(LaunchConfiguration('vehicle'))),
    ])
    check_launch_arguments(
        __file__, sys.argv, [each.name for each in description.get_launch_arguments()])
    return description
