# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The simulator: the time of a period, its share of a processor, its balance of energy.

Run by hand, ``make bench-loop``, on Linux; see README.md beside this file.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from importlib.metadata import version
import os
from pathlib import Path
import platform
import sys
import tempfile
import time
from typing import Any

from inverse_dynamics import HERE, markdown, processor_name, write
from node import DOMAIN, Process, SHARED_MEMORY
import numpy as np
import rclpy
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.task import Future
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from stewart_dynamics import Motion, StewartPlatform
from stewart_dynamics.arrays import NO_WRENCH, Six
from stewart_dynamics.executables import executable
from stewart_dynamics.mechanics.frames.rotation import from_quaternion
from stewart_dynamics.messages.standard import float64_array
from stewart_dynamics.parameters.yaml_file import read_yaml
from stewart_dynamics.simulator.plant import Plant
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters
from stewart_dynamics.simulator.state_messages import StateMessages

sys.path.append(str(HERE.parent / 'test'))
from referees import energies, rng, smooth_motion  # noqa: E402, I100, I202

BEGIN, END = '<!-- simulator: begin -->', '<!-- simulator: end -->'
FILES = [HERE.parent / 'config' / name for name in ('platform.yaml', 'simulator.yaml')]
GIVEN: dict[str, Any] = {}
for _file in FILES:
    GIVEN |= read_yaml(_file, 'stewart_simulator')
SIMULATOR = str(executable('stewart_simulator'))

ROUNDS = 15
PERIODS = 2000  # in a turn
SECONDS = 10
MINUTE = 60
RATE = 1000.0
STEPS = (1e-3, 5e-4, 2.5e-4, 1.25e-4)
# The hexapod moves forever: no loss, no end stop.
IDEAL = {'actuator.viscous_friction': 0.0, 'actuator.coulomb_friction': 0.0, **dict.fromkeys(
    ('limits.length_min', 'limits.length_max', 'limits.velocity_max', 'limits.force_max'))}


def holding(parameters: SimulatorParameters) -> Six:
    """Return the forces that hold the hexapod in its initial pose."""
    pose = parameters.initial_pose
    motion = Motion.from_euler(pose[:3], pose[3:])
    first, second, third, fourth, fifth, sixth = StewartPlatform(
        parameters).inverse_dynamics(motion).forces.tolist()
    return first, second, third, fourth, fifth, sixth


# The time of a period

def timed(call: Callable[[], Any]) -> float:
    """Return how long one call takes [us], the mean of many."""
    begin = time.perf_counter()
    for _ in range(PERIODS):
        call()
    return (time.perf_counter() - begin) / PERIODS * 1e6


def period_rows(rounds: int) -> list[tuple[str, ...]]:
    """Return the table of the time of a period."""
    rows = [('a period of 1 ms', 'us', 'min .. max', 'simulated s in 1 s')]
    stiff = {'actuator.reflected_mass': 0.0}  # its friction has less mass to work on
    for changes in ({}, stiff):
        plant = Plant(SimulatorParameters({**GIVEN, **changes, 'rate': RATE}))
        commands = holding(plant.parameters)
        steps = f'{plant.steps} step{"s: no reflected mass" if plant.steps > 1 else ""}'
        for name, call in (
                ('`Plant.advance`', partial(plant.advance, commands, NO_WRENCH)),
                ('its four messages beside',
                 partial(published, StateMessages(plant.parameters), plant))):
            timed(call)
            times = [timed(call) for _ in range(rounds)]
            middle = float(np.median(times))
            of_messages = 'messages' in name
            rows.append((name if of_messages else f'{name}, {steps}', f'{middle:.1f}',
                         f'{min(times):.1f} .. {max(times):.1f}',
                         '' if of_messages else f'{1e3 / middle:,.0f}'))
    return rows


def published(messages: StateMessages, plant: Plant) -> list[tuple[str, bytes]]:
    """Return the messages of a period."""
    return list(messages.write(1, plant.measured()))


# The node

class Controller(Node):
    """
    Counts the simulator's states and, if it shall, answers each with the same forces.

    Parameters
    ----------
    simulator : Process
        It is measured for some seconds, once a thousand states have come.
    seconds : float
        How long.
    answered : type, optional
        The messages that are answered: leg states or clocks.

    """

    def __init__(self, simulator: Process, seconds: float, answered: Any) -> None:
        super().__init__('controller')
        self.done = Future()
        self._simulator, self._seconds = simulator, seconds
        self._states = 0
        self._begin = (0.0, 0.0, 0)
        self._forces = float64_array(holding(SimulatorParameters(GIVEN)))
        qos = QoSProfile(depth=2000)
        self._commands = self.create_publisher(
            Float64MultiArray, '/stewart_simulator/commands', qos)
        self.create_subscription(
            JointState, '/stewart_simulator/leg_states', self._on_state, qos, raw=True)
        if answered is not None:
            topic = '/clock' if answered is Clock else '/stewart_simulator/leg_states'
            self.create_subscription(answered, topic, self._on_answered, qos, raw=True)

    def _on_state(self, data: bytes) -> None:
        self._states += 1
        if self._states == 1000:
            self._begin = time.monotonic(), self._simulator.processor, self._states
        if self._states > 1000 and time.monotonic() > self._begin[0] + self._seconds:
            if not self.done.done():
                self.done.set_result((
                    time.monotonic() - self._begin[0],
                    self._simulator.processor - self._begin[1], self._states - self._begin[2]))

    def _on_answered(self, data: bytes) -> None:
        self._commands.publish(self._forces)


def node_rows(seconds: int, folder: Path) -> list[tuple[str, ...]]:
    """Return the table of the node at work."""
    rows = [('`stewart_simulator` at 1 kHz', 'of a core', 'periods in 1 s', 'simulated s in 1 s')]
    environment = {'ROS_DOMAIN_ID': DOMAIN, 'ROS_LOG_DIR': str(folder), **SHARED_MEMORY.node}
    os.environ.update(environment)
    for title, stepped, answered in (
            ('real time, its brakes on', False, None),
            ('real time, each state answered', False, JointState),
            ('step by step, each clock answered', True, Clock)):
        simulator = Process([
            SIMULATOR, '--ros-args', *(part for file in FILES for part in ('--params-file',
                                                                           str(file))),
            '-p', f'rate:={RATE}', '-p', f'use_sim_time:={str(stepped).lower()}'], environment)
        rclpy.init(args=[])
        controller = Controller(simulator, seconds, answered)
        executor = EventsExecutor()
        executor.add_node(controller)
        executor.spin_until_future_complete(controller.done, 300.0)
        simulator.stop()
        executor.shutdown()
        controller.destroy_node()
        rclpy.try_shutdown()
        elapsed, processor, states = controller.done.result()
        rows.append((title, f'{processor / elapsed:.0%}', f'{states / elapsed:,.0f}',
                     f'{states / elapsed / RATE:.2f}'))
    return rows


# Energy

def energy_of(plant: Plant) -> float:
    """Return kinetic and potential energy [J], as the tests' referee has them."""
    state = plant.state
    motion = Motion(state.pose[:3], np.reshape(from_quaternion(*state.pose[3:]), (3, 3)),
                    state.twist[:3], state.twist[3:])
    return float(sum(energies(plant.parameters, motion)))


def balance_of_a_minute(step: float) -> float:
    """Return work minus change of energy, relative to the energy exchanged."""
    plant = Plant(SimulatorParameters({**GIVEN, **IDEAL, 'rate': RATE, 'step': step}))
    p = plant.parameters
    times = np.arange(MINUTE * round(RATE)) / RATE
    wanted = StewartPlatform(p).inverse_dynamics(smooth_motion(p, rng())(times))
    carried = p.platform.mass / 6.0 + p.actuator.reflected_mass
    state, before = plant.state, energy_of(plant)
    work = exchanged = 0.0
    for n in range(len(times)):
        lengths = np.array(state.positions)
        forces = (wanted.forces[n] + 400.0 * carried * (wanted.lengths[n] - lengths)
                  + 30.0 * carried * (wanted.rates[n] - state.rates))
        state = plant.advance(tuple(forces.tolist()), NO_WRENCH)
        of_legs = forces * (state.positions - lengths)
        work += float(np.sum(of_legs))
        exchanged += float(np.sum(np.abs(of_legs)))
    return abs(energy_of(plant) - before - work) / exchanged


def balance_of_a_tumble(step: float) -> float:
    """Return the change of energy of a hexapod that tumbles freely, of all that it has."""
    plant = Plant(SimulatorParameters({
        **GIVEN, **IDEAL, 'rate': RATE, 'step': step, 'gravity': [0.0, 0.0, 0.0]}))
    plant._plant['state']['twist'][:] = 0.5, -0.3, 1.0, 8.0, -5.0, 12.0
    plant.state = plant._run(0)
    before = energy_of(plant)
    for _ in range(200):
        plant.advance(NO_WRENCH, NO_WRENCH)
    return abs(energy_of(plant) - before) / before


def energy_rows() -> list[tuple[str, ...]]:
    """Return the table of the balance of energy by the step."""
    rows = [('step (ms)', 'a minute of smooth motion', 'times the next',
             '0.2 s of free tumbling at 15 rad/s', 'times the next')]
    of_each = [[balance(step) for step in STEPS]
               for balance in (balance_of_a_minute, balance_of_a_tumble)]
    for n, step in enumerate(STEPS):
        cells = [f'{step * 1e3:g}']
        for errors in of_each:
            ratio = f'{errors[n] / errors[n + 1]:.1f}' if n + 1 < len(STEPS) else ''
            cells += [f'{errors[n]:.1e}', ratio]
        rows.append(tuple(cells))
    return rows


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--rounds', type=int, default=ROUNDS, help='turns of each (%(default)s)')
    parser.add_argument('--seconds', type=int, default=SECONDS,
                        help='of each run of the node (%(default)s)')
    parser.add_argument('--write', action='store_true', help='put the tables into results/')
    options = parser.parse_args()
    if options.rounds < 1 or options.seconds < 1:
        parser.error('--rounds and --seconds must be at least 1')
    with tempfile.TemporaryDirectory() as name:
        nodes = node_rows(options.seconds, Path(name))
    versions = ', '.join(f'{name} {version(name)}' for name in ('numpy', 'ros-rclpy'))
    lines = ['', *markdown(period_rows(options.rounds)), '', *markdown(nodes), '',
             *markdown(energy_rows()), '',
             f'{processor_name()}, {len(os.sched_getaffinity(0))} cores. Python '
             f'{platform.python_version()}, {versions}. Medians of {options.rounds} turns of '
             f'{PERIODS:,} periods; {options.seconds} s of each run of the node.', '']
    print('\n'.join(lines))
    if options.write:
        write(lines, BEGIN, END)


if __name__ == '__main__':
    main()
