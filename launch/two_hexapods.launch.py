# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
Start the nodes of two hexapods on one computer, each in a namespace and with frames of its own.

    ros2 launch stewart_dynamics two_hexapods.launch.py \
        params_file:=left.yaml second_params_file:=right.yaml names:=left,right record:=/data/run_1
"""

import re
import sys

from launch import Action, LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, LogInfo, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.ros.launch_arguments import check_files, check_launch_arguments

FILES = 'params_file', 'second_params_file'


def nodes(context: LaunchContext) -> list[Action]:
    """Return both nodes and the recorder, once the files are checked."""
    files = [LaunchConfiguration(each).perform(context) for each in FILES]
    check_files({argument: (file, Parameters)
                 for argument, file in zip(FILES, files, strict=True)})
    text = LaunchConfiguration('names').perform(context)
    names = text.split(',')
    if len(set(names)) != 2 or not all(re.fullmatch('[a-z][a-z0-9_]*', each) for each in names):
        raise RuntimeError(f'names: {text}: must be two different namespaces, as left,right')
    actions: list[Action] = [LogInfo(msg=f'{name}: {file}')
                             for name, file in zip(names, files, strict=True)]
    actions += [Node(
        package='stewart_dynamics', executable='stewart_dynamics', name='stewart_dynamics',
        namespace=name, output='screen',
        # Setpoints of one hexapod are rejected by the other: their frame is another one.
        parameters=[file, {'base_frame': f'{name}_base', 'platform_frame': f'{name}_platform'}])
        for name, file in zip(names, files, strict=True)]
    folder = LaunchConfiguration('record').perform(context)
    if folder:
        actions.append(ExecuteProcess(cmd=[
            'ros2', 'bag', 'record', '--storage', 'mcap', '--output', folder,
            '--regex', f'/({"|".join(names)})/.*|/diagnostics|/rosout|/tf|/tf_static'],
            output='screen'))
    return actions


def generate_launch_description() -> LaunchDescription:
    """Return the nodes and the arguments."""
    default = PathJoinSubstitution([FindPackageShare('stewart_dynamics'), 'config',
                                    'platform.yaml'])
    description = LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=default, description=f'YAML file with the '
                                f'parameters of the {which} hexapod, under /**:')
          for name, which in zip(FILES, ('first', 'second'), strict=True)),
        DeclareLaunchArgument('names', default_value='left,right',
                              description='namespaces of the two, which name their frames, too'),
        DeclareLaunchArgument('record', default_value='',
                              description='folder of a new bag with all topics of both; empty: '
                                          'nothing is recorded'),
        OpaqueFunction(function=nodes),
    ])
    check_launch_arguments(
        __file__, sys.argv, [each.name for each in description.get_launch_arguments()])
    return description
