# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
How long programs take to start, and the memory that they have then.

Run by hand, ``make bench``, on Linux; see README.md beside this file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
import os
from pathlib import Path
import signal
from statistics import median
import subprocess
import sys
import time
from typing import NamedTuple

from inverse_dynamics import Figure, HERE, markdown, processor_name

from stewart_dynamics.executables import executable

BEGIN, END = '<!-- starts: begin -->', '<!-- starts: end -->'
DOMAIN = '101'  # the tests have those below
PARAMETERS = str(HERE.parent / 'config' / 'platform.yaml')
NODE = [str(executable('stewart_dynamics')), '--ros-args', '--params-file', PARAMETERS]
FIRST_CALL = [sys.executable, '-c', f"""
import numpy as np
from stewart_dynamics import Motion, StewartPlatform
platform = StewartPlatform.from_yaml({PARAMETERS!r})
platform.inverse_dynamics(Motion(np.array([0.0, 0.0, 1.1]), np.eye(3)))
"""]
# The least that a node like ours needs: rclpy, the types, its publishers and subscriptions.
BARE_NODE = [sys.executable, '-c', """
import numpy
import rclpy
from rclpy.lifecycle import LifecycleNode
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import AccelStamped, PoseStamped, TwistStamped, WrenchStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory
from visualization_msgs.msg import MarkerArray
rclpy.init()
node = LifecycleNode('bare')
for n, kind in enumerate((JointState, Float64MultiArray, Float64MultiArray, Float64, Bool,
                          WrenchStamped, JointTrajectory, DiagnosticArray, MarkerArray)):
    node.create_publisher(kind, f'output_{n}', 10)
for n, kind in enumerate((PoseStamped, TwistStamped, AccelStamped, WrenchStamped, JointState,
                          MultiDOFJointTrajectory)):
    node.create_subscription(kind, f'input_{n}', print, 10, raw=True)
node.trigger_configure()
node.trigger_activate()
node.get_logger().info('ready')
rclpy.spin(node)
"""]


class Start(NamedTuple):
    """Time of a start."""

    seconds: float
    """Until it was ready, or had ended."""
    processor: float
    """Of the program and of those that it started [s]."""
    memory: float
    """Resident when it was ready, or at most [MB]."""


def until_ready(command: Sequence[str], environment: Mapping[str, str]) -> Start:
    """Start a program, stop it when it logs that it is ready, and return what that took."""
    begun = time.perf_counter()
    program = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
    assert program.stderr is not None
    if not any(line.rstrip().endswith('ready') or ' ready after ' in line
               for line in program.stderr):
        raise SystemExit(f'{command[0]} has ended before it was ready')
    seconds = time.perf_counter() - begun
    status = Path(f'/proc/{program.pid}/status').read_text(encoding='utf-8')
    program.send_signal(signal.SIGTERM)
    _, _, usage = os.wait4(program.pid, 0)
    program.returncode = 0
    return Start(seconds, usage.ru_utime + usage.ru_stime, _megabytes(
        int(status.partition('VmRSS:')[2].split()[0])))


def until_ended(command: Sequence[str], environment: Mapping[str, str]) -> Start:
    """Start a program and return its time."""
    begun = time.perf_counter()
    program = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL,
                               stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(program.pid, 0)
    program.returncode = os.waitstatus_to_exitcode(status)
    if program.returncode:
        raise SystemExit(f'{" ".join(command)[:200]}: exit code {program.returncode}')
    return Start(time.perf_counter() - begun, usage.ru_utime + usage.ru_stime,
                 _megabytes(usage.ru_maxrss))


def _megabytes(kibibytes: int) -> float:
    return kibibytes * 1024 / 1e6


Run = Callable[[Sequence[str], Mapping[str, str]], Start]
OF_NODE, OF_BARE_NODE = (
    'the node, until it is ready', 'a bare lifecycle node with the same topics')
STARTS: dict[str, tuple[Run, Sequence[str]]] = {
    OF_NODE: (until_ready, NODE),
    'the first inverse dynamics of the library': (until_ended, FIRST_CALL),
    OF_BARE_NODE: (until_ready, BARE_NODE),
    '`import stewart_dynamics`': (
        until_ended, [sys.executable, '-c', 'import stewart_dynamics']),
    '`from stewart_dynamics import StewartPlatform`': (
        until_ended, [sys.executable, '-c', 'from stewart_dynamics import StewartPlatform']),
    '`import numpy`': (until_ended, [sys.executable, '-c', 'import numpy']),
    'Python': (until_ended, [sys.executable, '-c', 'pass']),
    '`stewart_replay --help`': (until_ended, [str(executable('stewart_replay')), '--help']),
}


def run(rounds: int) -> tuple[list[str], list[Figure]]:
    """Measure; return the lines for the page, and the figures with targets."""
    environment = {
        **os.environ, 'ROS_DOMAIN_ID': DOMAIN, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    found: dict[str, list[Start]] = {name: [] for name in STARTS}
    for number in range(-1, rounds):  # the first does not count
        for name, (take, command) in STARTS.items():
            start = take(command, environment)
            if number >= 0:
                found[name].append(start)
    of = {name: Start(*map(median, zip(*starts, strict=True))) for name, starts in found.items()}
    cells: list[tuple[str, ...]] = [('start', 's', 'processor s', 'memory (MB)'), *(
        (name, f'{each.seconds:.2f}', f'{each.processor:.2f}', f'{each.memory:.1f}')
        for name, each in of.items())]
    return ['', *markdown(cells), '', f'{processor_name()}. Medians of {rounds} starts.', ''], [
        Figure('start of the node', of[OF_NODE].seconds, 0.5, 's'),
        Figure('start of the node, times that of a bare one',
               of[OF_NODE].seconds / of[OF_BARE_NODE].seconds, 1.5, ''),
        Figure('memory of the node, times that of a bare one',
               of[OF_NODE].memory / of[OF_BARE_NODE].memory, 1.3, ''),
        Figure('`import stewart_dynamics`', of['`import stewart_dynamics`'].seconds, 0.06, 's'),
        Figure('`stewart_replay --help`', of['`stewart_replay --help`'].seconds, 0.2, 's')]
