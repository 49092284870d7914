# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""
Start reference motion, node, simulator and an example controller, in real time.

    ros2 launch stewart_dynamics demo.launch.py feed_forward:=false payload_factor:=1.3
"""

import sys

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from stewart_dynamics.parameters import Parameters


def simulator(context: LaunchContext) -> list[Node]:
    """Return the simulator, its payload scaled by payload_factor."""
    file = LaunchConfiguration('params_file').perform(context)
    factor = float(LaunchConfiguration('payload_factor').perform(context))
    parameters = Parameters.from_yaml(file)
    return [Node(
        package='stewart_dynamics',
        executable='stewart_simulator',
        name='stewart_simulator',
        namespace=LaunchConfiguration('namespace'),
        parameters=[file, LaunchConfiguration('simulator_file'), {
            'platform.mass': factor * parameters['platform.mass'],
            'platform.inertia': (factor * parameters['platform.inertia']).tolist()}],
        output='screen')]


def generate_launch_description() -> LaunchDescription:
    """Return the four nodes and the arguments."""
    share = FindPackageShare('stewart_dynamics')
    return LaunchDescription([
        DeclareLaunchArgument(
            'trajectory_file',
            default_value=PathJoinSubstitution([share, 'config', 'trajectory_loop.yaml']),
            description='YAML file with the parameters of the reference motion'),
        DeclareLaunchArgument(
            'simulator_file',
            default_value=PathJoinSubstitution([share, 'config', 'simulator.yaml']),
            description='YAML file with the parameters of the simulation; the motion must begin '
                        'at its initial_pose'),
        DeclareLaunchArgument(
            'payload_factor', default_value='1.0',
            description='mass and inertia of the simulated platform, relative to those in '
                        'params_file'),
        DeclareLaunchArgument(
            'controller', default_value='true', choices=['true', 'false'],
            description='run the example controller; false: run your own, which publishes on '
                        'stewart_simulator/commands'),
        DeclareLaunchArgument(
            'feed_forward', default_value='true', choices=['true', 'false'],
            description='let the example controller add the forces of the node'),
        DeclareLaunchArgument(
            'params_file',
            default_value=PathJoinSubstitution([share, 'config', 'platform.yaml']),
            description='YAML file with the parameters of the hexapod'),
        DeclareLaunchArgument(
            'namespace', default_value='', description='namespace of all nodes'),
        # With the measured legs of the simulator the node estimates the external wrench.
        Node(
            package='stewart_dynamics',
            executable='stewart_dynamics',
            name='stewart_dynamics',
            namespace=LaunchConfiguration('namespace'),
            parameters=[LaunchConfiguration('params_file')],
            remappings=[('~/measured_legs', 'stewart_simulator/leg_states')],
            output='screen'),
        OpaqueFunction(function=simulator),
        # An example to copy, not an executable of the package.
        Node(
            executable=sys.executable,
            arguments=[PathJoinSubstitution([share, 'examples', 'leg_controller.py'])],
            name='leg_controller',
            namespace=LaunchConfiguration('namespace'),
            parameters=[{'params_file': LaunchConfiguration('params_file'),
                         'feed_forward': ParameterValue(
                             LaunchConfiguration('feed_forward'), value_type=bool)}],
            condition=IfCondition(LaunchConfiguration('controller')),
            output='screen'),
        # Setpoints go to stewart_dynamics/setpoint/..., hence the same namespace.
        Node(
            package='stewart_dynamics',
            executable='stewart_trajectory',
            name='stewart_trajectory',
            namespace=LaunchConfiguration('namespace'),
            parameters=[LaunchConfiguration('trajectory_file')],
            output='screen'),
    ])
