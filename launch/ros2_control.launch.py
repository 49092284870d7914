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
Start controller manager, a joint_trajectory_controller and the node, as an example to copy.

    ros2 launch stewart_dynamics ros2_control.launch.py

and then examples/plan_motion.py with its leg_trajectory remapped to
/leg_trajectory_controller/joint_trajectory.

The hardware of the default urdf_file is mock_components/GenericSystem, whose state follows the
commands. It needs ros2_control, ros2_controllers and robot_state_publisher.
"""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

CONTROLLER = 'leg_trajectory_controller'
FILES = {
    'params_file': ('platform.yaml', 'YAML file with the parameters of the hexapod'),
    'controllers_file': ('controllers/trajectory_position_effort.yaml',
                         f'YAML file of the controller manager, with {CONTROLLER}'),
    'urdf_file': ('controllers/hexapod.urdf',
                  'URDF with the legs as joints and a block ros2_control')}


def nodes(context: LaunchContext) -> list[Node]:
    """Return all nodes, once the files are there."""
    files = {name: LaunchConfiguration(name).perform(context) for name in FILES}
    for name, file in files.items():
        if not Path(file).is_file():
            raise RuntimeError(f'{name}: {file}: no such file')
    description = Path(files['urdf_file']).read_text(encoding='utf-8')
    controllers = files['controllers_file']
    return [
        Node(package='robot_state_publisher', executable='robot_state_publisher',
             parameters=[{'robot_description': description}], output='screen'),
        # The spawner's file is the manager's as well: it has the types of the controllers.
        Node(package='controller_manager', executable='ros2_control_node',
             parameters=[controllers], remappings=[('~/robot_description', '/robot_description')],
             output='screen'),
        Node(package='controller_manager', executable='spawner',
             arguments=['joint_state_broadcaster', CONTROLLER, '--param-file', controllers],
             output='screen'),
        Node(package='stewart_dynamics', executable='stewart_dynamics', name='stewart_dynamics',
             parameters=[files['params_file']],
             remappings=[('~/leg_trajectory', f'/{CONTROLLER}/joint_trajectory'),
                         ('~/measured_legs', '/joint_states')],
             output='screen')]


def generate_launch_description() -> LaunchDescription:
    """Return the nodes and the arguments."""
    share = FindPackageShare('stewart_dynamics')
    return LaunchDescription([
        *(DeclareLaunchArgument(
            name, default_value=PathJoinSubstitution([share, 'config', file]), description=text)
          for name, (file, text) in FILES.items()),
        OpaqueFunction(function=nodes),
    ])
