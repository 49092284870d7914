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


"""The node, and a motion that is published to it as setpoints."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """Return the two nodes; `trajectory_file` adds to the arguments of the first."""
    share = FindPackageShare('stewart_dynamics')
    return LaunchDescription([
        DeclareLaunchArgument(
            'trajectory_file',
            default_value=PathJoinSubstitution([share, 'config', 'trajectory_clear.yaml']),
            description='YAML file with the parameters of the motion'),
        # It declares params_file and namespace, for this file as well.
        IncludeLaunchDescription(PythonLaunchDescriptionSource(
            PathJoinSubstitution([share, 'launch', 'stewart_dynamics.launch.py']))),
        # Setpoints go to stewart_dynamics/setpoint/..., hence the same namespace.
        Node(
            package='stewart_dynamics',
            executable='stewart_trajectory',
            name='stewart_trajectory',
            namespace=LaunchConfiguration('namespace'),
            parameters=[LaunchConfiguration('trajectory_file')],
            output='screen'),
    ])
