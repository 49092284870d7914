# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The node at 1 kHz under random lifecycle, parameter and service calls: it must not end.

Setpoints come from stewart_trajectory, measured legs and calls from here, several calls at a time
as ROS keeps them: a request may wait behind a deactivation or a cleanup. Each must be answered.
In the end the node is active, answers setpoints, and its memory has not grown. The exit code is 1
otherwise.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import time
from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetAvailableTransitions, GetState
import numpy as np
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters, GetParameters, GetParameterTypes, ListParameters, SetParameters,
    SetParametersAtomically)
import rclpy
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from stewart_dynamics import StewartPlatform
from stewart_dynamics.executables import executable

CONFIG = Path(__file__).resolve().parent.parent / 'config'
NODE = '/stewart_dynamics'
SERVICES: dict[str, Any] = {
    'change_state': ChangeState, 'get_state': GetState,
    'get_available_transitions': GetAvailableTransitions, 'identify_payload': Trigger,
    'get_parameters': GetParameters, 'get_parameter_types': GetParameterTypes,
    'describe_parameters': DescribeParameters, 'list_parameters': ListParameters,
    'set_parameters': SetParameters, 'set_parameters_atomically': SetParametersAtomically}
NAMES = ('platform.mass', 'platform.center_of_mass', 'singularity.action', 'limits.force_max',
         'undeclared', '', 'use_sim_time', 'x' * 1000)
TRANSITIONS = (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_CLEANUP,
               Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_DEACTIVATE)
TOGETHER = 8  # calls at a time; ROS keeps ten of a service
PATIENCE = 300.0  # until calls are answered; code may have to be compiled first [s]
LEGS_RATE = 200.0  # of measured legs [Hz]


class Soak(Node):
    """Calls the node's services at random, and publishes measured legs."""

    def __init__(self, seed: int) -> None:
        super().__init__('soak')
        self._random = np.random.default_rng(seed)
        self._clients_by_name = {name: self.create_client(kind, f'{NODE}/{name}')
                                 for name, kind in SERVICES.items()}
        self.answers = 0
        self.calls: Counter[str] = Counter()
        self.create_subscription(JointState, f'{NODE}/leg_states', self._count,
                                 QoSProfile(depth=1000), raw=True)
        platform = StewartPlatform.from_yaml(CONFIG / 'platform.yaml')
        pose = platform.home_pose()
        self._legs = JointState(
            name=platform.parameters.joints, velocity=[0.0] * 6, effort=[300.0] * 6,
            position=(platform.inverse_kinematics(pose)
                      - platform.parameters.geometry.zero_length))
        self._measured = self.create_publisher(JointState, f'{NODE}/measured_legs', 100)
        self.create_timer(1.0 / LEGS_RATE, self._measure)

    def _count(self, data: bytes) -> None:
        self.answers += 1

    def _measure(self) -> None:
        self._legs.header.stamp = self.get_clock().now().to_msg()
        self._measured.publish(self._legs)

    def ready(self) -> bool:
        """Return whether all services are there."""
        return all(client.service_is_ready() for client in self._clients_by_name.values())

    def begin(self, name: str, request: Any) -> Any:
        """Call a service and return the future of its answer."""
        self.calls[name] += 1
        return self._clients_by_name[name].call_async(request)

    def change(self, transition: int) -> Any:
        """Ask for a transition and return the future of the answer."""
        return self.begin('change_state', ChangeState.Request(
            transition=Transition(id=transition)))

    def begin_any(self) -> tuple[Any, str]:
        """Call any service with any request; return the future of the answer, and the name."""
        random = self._random
        name = str(random.choice(list(SERVICES)))
        if name == 'change_state':
            return self.change(int(random.choice(TRANSITIONS))), name
        request = SERVICES[name].Request()
        names = [str(each) for each in random.choice(NAMES, int(random.integers(4)))]
        if hasattr(request, 'names'):
            request.names = names
        elif hasattr(request, 'prefixes'):
            request.prefixes = names
        elif hasattr(request, 'parameters'):
            request.parameters = [self._any_parameter(each) for each in names]
        return self.begin(name, request), name

    def _any_parameter(self, name: str) -> Any:
        if name == 'use_sim_time':
            name = 'platform.mass'  # or setpoints would stop
        if self._random.random() < 0.5:
            return RosParameter('platform.mass', value=float(
                self._random.uniform(100.0, 200.0))).to_parameter_msg()
        return Parameter(name=name, value=ParameterValue(
            type=int(self._random.integers(256)), double_value=-1.0))


class Failure(Exception):
    """Ends the soak; its text is one line."""


def memory(process: subprocess.Popen[bytes]) -> float:
    """Return the resident memory of a process [MB]."""
    text = Path(f'/proc/{process.pid}/status').read_text(encoding='utf-8')
    return int(text.partition('VmRSS:')[2].split()[0]) / 1000.0


def run(seconds: float, seed: int, folder: Path) -> str:
    """Run the soak and return its figures in one line."""
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('ROS_DOMAIN_ID', str(os.getpid() % 100 + 1))
    rclpy.init()
    soak, executor = Soak(seed), EventsExecutor()
    executor.add_node(soak)
    programs: dict[str, subprocess.Popen[bytes]] = {}

    def until(done: Callable[[], bool], what: str | dict[Any, str]) -> None:
        end = time.monotonic() + PATIENCE
        while not done():
            executor.spin_once(timeout_sec=0.1)
            for name, program in programs.items():
                if program.poll() is not None:
                    log = (folder / f'{name}.txt').read_text(errors='replace').splitlines()
                    raise Failure(f'{name} ended with exit code {program.returncode} after '
                                  f'{soak.calls.total()} calls: {(log or ["no output"])[-1]}')
            if time.monotonic() > end:
                if isinstance(what, dict):
                    what = f'answers to {", ".join(what.values())}'
                raise Failure(f'{what}: not within {PATIENCE:g} s')

    try:
        for name, arguments in (
                ('stewart_dynamics', ['--params-file', CONFIG / 'platform.yaml',
                                      '-p', 'setpoint.source:=combined']),
                ('stewart_trajectory', ['--params-file', CONFIG / 'trajectory_loop.yaml',
                                        '-p', 'rate:=1000.0', '-p', 'output:=combined'])):
            with (folder / f'{name}.txt').open('wb') as output:
                programs[name] = subprocess.Popen(
                    [executable(name), '--ros-args', *arguments], stdout=output, stderr=output)
        until(soak.ready, 'services are there')
        until(lambda: soak.answers > 0, 'setpoints are answered')
        future = soak.begin('identify_payload', Trigger.Request())
        until(future.done, 'code is compiled')
        begun, first = time.monotonic(), 0.0
        while time.monotonic() < begun + seconds:
            pending = dict([soak.begin_any() for _ in range(TOGETHER)])

            def answered(pending: dict[Any, str] = pending) -> bool:
                for future in [each for each in pending if each.done()]:
                    del pending[future]
                return not pending

            until(answered, pending)
            if not first and time.monotonic() > begun + 0.3 * seconds:
                first = memory(programs['stewart_dynamics'])
        for transition in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
            future = soak.change(transition)
            until(future.done, 'the node is active again')
        many = soak.answers
        until(lambda: soak.answers > many + 100, 'setpoints are answered in the end')
        last = memory(programs['stewart_dynamics'])
        if last > first + 20.0:
            raise Failure(f'memory grew from {first:.1f} to {last:.1f} MB')
        return (f'{seconds:g} s: {soak.calls.total()} calls, {soak.calls["change_state"]} of them '
                f'transitions, all answered; {soak.answers} setpoints answered; memory '
                f'{first:.1f} MB after a third, {last:.1f} MB at the end')
    finally:
        for program in programs.values():
            program.terminate()
        for program in programs.values():
            program.wait()
        executor.shutdown()
        soak.destroy_node()
        rclpy.try_shutdown()


def main() -> None:
    """Run the soak and print its figures."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--seconds', type=float, default=600.0, help='duration (%(default)g)')
    parser.add_argument('--seed', type=int, default=1, help='of the calls (%(default)s)')
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        try:
            print(run(options.seconds, options.seed, Path(folder)))
        except Failure as exc:
            sys.exit(f'soak: {exc}')


if __name__ == '__main__':
    main()
