# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
Start reference motion, node, simulator and an example controller, in real time.

    ros2 launch stewart_dynamics demo.launch.py feed_forward:=false payload_factor:=1.3
    ros2 launch stewart_dynamics demo.launch.py params_file:=config/crank_platform.yaml
        trajectory_file:=config/trajectory_cranks.yaml
"""

import math
import os
import sys
from typing import Any

from launch import Action, LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.reference_motion.motion_functions import first_pose
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.ros.launch_arguments import check_files, check_launch_arguments
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters

FILES = {
    'params_file': ('platform.yaml', Parameters, 'YAML file with the parameters of the hexapod'),
    'trajectory_file': ('trajectory_loop.yaml', ReferenceMotionParameters,
                        'YAML file with the parameters of the reference motion'),
    'simulator_file': ('simulator.yaml', SimulatorParameters,
                       'YAML file with the parameters of the simulation; the motion must begin at '
                       'its initial_pose, which is where it begins with the default file')}


def checked(context: LaunchContext) -> tuple[dict[str, str], float]:
    """Return the files and the payload factor; raise RuntimeError before anything is started."""
    files = {name: LaunchConfiguration(name).perform(context) for name in FILES}
    check_files({name: (file, FILES[name][1]) for name, file in files.items()})
    text = LaunchConfiguration('payload_factor').perform(context)
    try:
        factor = float(text)
    except ValueError:
        factor = math.nan
    if not 0.0 < factor < math.inf:
        raise RuntimeError(f'payload_factor: {text}: must be a number above 0')
    return files, factor


def nodes(context: LaunchContext) -> list[Action]:
    """Return the four nodes, all in one namespace: setpoints go to stewart_dynamics/setpoint/."""
    files, factor = checked(context)
    parameters = Parameters.from_yaml(files['params_file'])
    simulated: dict[str, Any] = {
        'platform.mass': factor * parameters.platform.mass,
        'platform.inertia': (factor * parameters.platform.inertia).tolist()}
    default, *_ = FILES['simulator_file']
    package = FindPackageShare('stewart_dynamics')
    if os.path.samefile(files['simulator_file'], PathJoinSubstitution(
            [package, 'config', default]).perform(context)):
        # A file of config/ is about platform.yaml; another hexapod and motion begin elsewhere.
        simulated['initial_pose'] = first_pose(
            ReferenceMotionParameters.from_yaml(files['trajectory_file'])).tolist()
    common: dict[str, Any] = {'namespace': LaunchConfiguration('namespace'), 'output': 'screen'}
    # Without one of these there is no loop; the motion may be complete.
    needed = {**common, 'on_exit': Shutdown()}
    return [
        LogInfo(msg=', '.join(f'{name}: {file}' for name, file in files.items())),
        # With the measured legs of the simulator the node estimates the external wrench.
        Node(package='stewart_dynamics', executable='stewart_dynamics', name='stewart_dynamics',
             parameters=[files['params_file']],
             remappings=[('~/measured_legs', 'stewart_simulator/leg_states')], **needed),
        Node(package='stewart_dynamics', executable='stewart_simulator', name='stewart_simulator',
             parameters=[files['params_file'], files['simulator_file'], simulated], **needed),
        # An example to copy, not an executable of the package.
        Node(executable=sys.executable, name='leg_controller',
             arguments=[PathJoinSubstitution([package, 'examples', 'leg_controller.py'])],
             parameters=[{'params_file': files['params_file'],
                          'feed_forward': ParameterValue(
                              LaunchConfiguration('feed_forward'), value_type=bool)}],
             condition=IfCondition(LaunchConfiguration('controller')), **needed),
        Node(package='stewart_dynamics', executable='stewart_trajectory',
             name='stewart_trajectory', parameters=[files['trajectory_file']], **common)]


def generate_launch_description() -> LaunchDescription:
    """Return the four nodes and the arguments."""
    share = FindPackageShare('stewart_dynamics')
    description = LaunchDescription([
        *(DeclareLaunchArgument(
            name, default_value=PathJoinSubstitution([share, 'config', file]), description=text)
          for name, (file, _, text) in FILES.items()),
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
            'namespace', default_value='', description='namespace of all nodes'),
        OpaqueFunction(function=nodes),
    ])
    check_launch_arguments(
        __file__, sys.argv, [each.name for each in description.get_launch_arguments()])
    return description
