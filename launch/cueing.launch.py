# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
Start a vehicle, motion cueing, node, simulator and an example controller, in real time.

    ros2 launch stewart_dynamics cueing.launch.py vehicle:=false
"""

import sys
from typing import Any

from launch import Action, LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

from stewart_dynamics.cueing.cueing_parameters import CueingParameters
from stewart_dynamics.ros.launch_arguments import check_files, check_launch_arguments
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters

FILES = {
    'params_file': ('platform.yaml', CueingParameters,
                    'YAML file with the parameters of the hexapod, and cueing.*'),
    'simulator_file': ('simulator.yaml', SimulatorParameters,
                       'YAML file with the parameters of the simulation')}


def nodes(context: LaunchContext) -> list[Action]:
    """Return the five programs, once their files are checked."""
    files = {name: LaunchConfiguration(name).perform(context) for name in FILES}
    check_files({name: (file, FILES[name][1]) for name, file in files.items()})
    package = FindPackageShare('stewart_dynamics')
    common: dict[str, Any] = {
        'output': 'screen', 'on_exit': Shutdown()}

    def example(name: str, **more: Any) -> Node:
        # An example to copy, not an executable of the package.
        return Node(executable=sys.executable, name=name,
                    arguments=[PathJoinSubstitution([package, 'examples', f'{name}.py'])],
                    **more, **common)

    def program(name: str, *parameters: str, **more: Any) -> Node:
        return Node(package='stewart_dynamics', executable=name, name=name,
                    parameters=list(parameters), **more, **common)

    hexapod, simulation = files.values()
    measured = {'remappings': [('~/measured_legs', '/stewart_simulator/leg_states')]}
    return [
        LogInfo(msg=', '.join(f'{name}: {file}' for name, file in files.items())),
        program('stewart_dynamics', hexapod, **measured),
        program('stewart_simulator', hexapod, simulation),
        example('leg_controller', parameters=[{'params_file': hexapod}]),
        program('stewart_cueing', hexapod, **measured),
        example('town_drive', condition=IfCondition(LaunchConfiguration('vehicle')))]


def generate_launch_description() -> LaunchDescription:
    """Return the programs and the arguments."""
    share = FindPackageShare('stewart_dynamics')
    description = LaunchDescription([
        *(DeclareLaunchArgument(
            name, default_value=PathJoinSubstitution([share, 'config', file]), description=text)
          for name, (file, _, text) in FILES.items()),
        DeclareLaunchArgument(
            'vehicle', default_value='true', choices=['true', 'false'],
            description='drive through town (examples/town_drive.py); false: publish yours on '
                        '/stewart_cueing/vehicle'),
        OpaqueFunction(function=nodes),
    ])
    check_launch_arguments(
        __file__, sys.argv, [each.name for each in description.get_launch_arguments()])
    return description
