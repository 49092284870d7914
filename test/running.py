# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The real programs in processes of their own, for the tests of the executables.

Nothing is mocked: setpoints go in and answers come out over ROS 2 topics, each test in a domain
that no other has. What is awaited is waited for with a deadline that a loaded computer keeps,
and nothing else depends on time.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, ExitStack, redirect_stderr, suppress
import fcntl
from functools import partial
import gc
from itertools import count
import math
import os
from pathlib import Path
import re
import signal
import struct
import subprocess
import sys
import tempfile
from threading import Event, Thread
import time
from typing import Any, NamedTuple
from unittest.mock import patch

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import (
    Accel, AccelStamped, Point, Pose, PoseStamped, Quaternion, Transform, Twist, TwistStamped,
    Vector3, Wrench, WrenchStamped)
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
import numpy as np
from rcl_interfaces.msg import Log, SetParametersResult
from rcl_interfaces.srv import (
    DescribeParameters, GetParameters, SetParameters, SetParametersAtomically)
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.parameter import Parameter as RosParameter
from rclpy.parameter import parameter_value_to_python
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.task import Future
from rclpy.time import Time
from referees import PLATFORM, ROOT  # noqa: F401
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, Float64MultiArray, Header
from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.executables import executable
from stewart_dynamics.legs import TELESCOPIC
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.mechanics.frames.rotation import from_quaternion
from stewart_dynamics.mechanics.stewart_platform import InverseDynamics
from stewart_dynamics.ros.rclpy_workarounds import shut_down, spin
from stewart_dynamics.setpoints.output_messages import LegTopics
from trajectory_msgs.msg import (
    JointTrajectory, MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint)
import yaml

NODE = '/stewart_dynamics'
FEEDER = Path(__file__).with_name('feeder.py')

# Nothing takes seconds on an idle computer; this is for a slow one with other work [s].
DEADLINE = 240.0

STEP = 10_000_000  # between two setpoints' stamps [ns]

# Levels of diagnostics.
OK, WARN, ERROR, STALE = (bytes([level]) for level in range(4))
NOT_JOINED = 'dropped: not all topics had its stamp'

QOS = QoSProfile(depth=2000)
LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)

INPUTS: dict[str, Any] = {
    'setpoint/pose': PoseStamped, 'setpoint/twist': TwistStamped, 'setpoint/accel': AccelStamped,
    'setpoint/combined': MultiDOFJointTrajectory, 'wrench': WrenchStamped}
# Their stamps are those of the answers.
FIRST = ('setpoint/pose', 'setpoint/combined')


def outputs_of(kind: LegKind) -> dict[str, Any]:
    """Return the topics of answers of hexapods with a kind of legs."""
    return {'leg_states': JointState,
            **dict.fromkeys(LegTopics.of(kind), Float64MultiArray),
            'jacobian_determinant': Float64, 'singularity_warning': Bool}


OUTPUTS: dict[str, Any] = outputs_of(TELESCOPIC)
SERVICES: dict[str, Any] = {
    'change_state': ChangeState, 'get_state': GetState, 'describe_parameters': DescribeParameters,
    'get_parameters': GetParameters, 'set_parameters': SetParameters,
    'set_parameters_atomically': SetParametersAtomically}
SEPARATE = ('setpoint/pose', 'setpoint/twist', 'setpoint/accel')

# Lines that a program may print on stderr: those of ROS's log. Fast DDS reports there what other
# programs, killed ones, have left in shared memory.
LOG_LINE = re.compile(r'\[(INFO|WARN|ERROR)\] \[\d+\.\d+\] \[[\w.]+\]: \S|.*\[RTPS_')

_DOMAINS = range(1, 101)
_LOCKS: dict[int, int] = {}  # file descriptors
_ENDLESS = 10_000_000


@contextmanager
def own_domain() -> Iterator[int]:
    """
    Give a ROS domain that no other test on this computer has, in whatever process.

    The programs in it inherit the lock: while one runs on, after its test was killed, no other
    test gets the domain.
    """
    for attempt in range(len(_DOMAINS)):
        domain = _DOMAINS[(os.getpid() + attempt) % len(_DOMAINS)]
        path = Path(tempfile.gettempdir()) / f'stewart_dynamics_test_domain_{domain}'
        with suppress(PermissionError), path.open('w') as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            _LOCKS[domain] = file.fileno()
            for path in of_shared_memory(domain):  # of programs that were killed
                path.unlink(missing_ok=True)
            try:
                yield domain
            finally:
                del _LOCKS[domain]
            return
    raise RuntimeError('all ROS domains are taken')


def of_shared_memory(domain: int) -> list[Path]:
    """Return the files in shared memory that are of Fast DDS's ports of a domain."""
    first = 7400 + 250 * domain
    return [path for name in ('fastrtps', 'fastdds')  # of Jazzy, of Kilted
            for path in Path('/dev/shm').glob(f'*{name}_port*')
            if 0 <= int(re.findall(r'port(\d+)', path.name)[0]) - first < 250]


def says(words: str, text: str) -> bool:
    """Return whether a log says that a transition is rejected; Kilted has its own words."""
    return words in text or 'Unable to start transition ' in text


def participants(domain: int) -> int:
    """Return the number of participants on this computer, with those that did not leave."""
    return sum(path.name.endswith('_el') for path in of_shared_memory(domain))


def log_lines(text: str, level: str = '') -> list[str]:
    """Return the lines of ROS's log in a program's output, those of a level or all."""
    return [line for line in text.splitlines() if line.startswith(f'[{level}')
            and '[RTPS_' not in line]


def assert_only_log_lines(text: str) -> None:
    """Check that a program printed nothing on stderr but lines of ROS's log."""
    strange = [line for line in text.splitlines() if not LOG_LINE.match(line)]
    assert not strange, text


class Program:
    """One of the executables in a process of its own; a folder gets its output and logs."""

    def __init__(self, command: Sequence[str | Path], domain: int, folder: Path,
                 **environment: str) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._out, self._err = folder / 'stdout', folder / 'stderr'
        self._forgotten = 0
        with self._out.open('wb') as out, self._err.open('wb') as err:
            self.process = subprocess.Popen(
                [str(part) for part in command], stdin=subprocess.DEVNULL, stdout=out,
                stderr=err, cwd=folder, pass_fds=filter(None, [_LOCKS.get(domain)]), env={
                    **os.environ, 'ROS_DOMAIN_ID': str(domain), 'ROS_LOG_DIR': str(folder / 'log'),
                    **environment})

    @property
    def stderr(self) -> str:
        """Its output on stderr so far, or since it was last forgotten."""
        return self._err.read_bytes()[self._forgotten:].decode(errors='replace')

    def forget(self) -> None:
        """Forget its output on stderr so far, once it is checked."""
        assert_only_log_lines(self.stderr)
        self._forgotten = self._err.stat().st_size

    @property
    def stdout(self) -> str:
        """Its output on stdout so far."""
        return self._out.read_text(errors='replace')

    @property
    def ended(self) -> bool:
        """Whether it runs no more."""
        return self.process.poll() is not None

    def wait(self) -> int:
        """Return its exit code once it has ended."""
        try:
            return self.process.wait(DEADLINE)
        except subprocess.TimeoutExpired:
            raise AssertionError(f'it does not end:\n{self.stderr}') from None

    def stop(self, number: int = signal.SIGINT) -> int:
        """Send it a signal and return its exit code."""
        self.process.send_signal(number)
        return self.wait()

    def kill(self) -> None:
        """Kill it if it still runs."""
        if not self.ended:
            self.process.kill()
            self.process.wait()

    def held(self) -> dict[str, int]:
        """Return how many file descriptors and threads it has, and its resident memory [kB]."""
        of_process = Path('/proc') / str(self.process.pid)
        status = dict(line.split(':', 1) for line in
                      (of_process / 'status').read_text(encoding='utf-8').splitlines())
        return {'descriptors': len(list((of_process / 'fd').iterdir())),
                'threads': int(status['Threads']), 'memory': int(status['VmRSS'].split()[0])}


class _Stderr:
    """
    The output of this process on stderr while this is entered.

    No output of a thread is lost at any time, as it is with pytest's ``capfd`` between
    reading and emptying its file.
    """

    def __enter__(self) -> _Stderr:
        self._file = tempfile.TemporaryFile('a+', buffering=1)
        self._python = redirect_stderr(self._file)
        self._python.__enter__()
        self._original = os.dup(2)
        os.dup2(self._file.fileno(), 2)
        self._whole = ''
        return self

    def __exit__(self, *_: object) -> None:
        os.dup2(self._original, 2)
        os.close(self._original)
        self._python.__exit__(None, None, None)
        self._whole = self.text()
        self._file.close()

    def text(self) -> str:
        """Return all that it has said so far."""
        if self._file.closed:
            return self._whole
        file = self._file.fileno()
        return os.pread(file, os.fstat(file).st_size, 0).decode()


class Inside:
    """
    A node of the package in this process, spun by a thread, where a test needs no process.

    It is created as its executable creates it; ``done`` gets the exit code.
    """

    def __init__(self, kind: Callable[[], Any], arguments: Sequence[str | Path], domain: int,
                 done: Future | None = None) -> None:
        self._done = done
        with ExitStack() as stack:
            self._said = stack.enter_context(_Stderr())
            with patch.object(sys, 'argv', ['inside', *map(str, arguments)]):
                rclpy.init(args=sys.argv, domain_id=domain)
                try:
                    node = kind()
                except BaseException:
                    rclpy.shutdown()
                    raise
            self._executor = EventsExecutor()
            self._executor.add_node(node)
            stop = Event()
            self._thread = Thread(target=spin, args=(
                self._executor, node, done or Future(), stop.is_set))
            for end in (partial(shut_down, self._executor, node), gc.unfreeze,
                        self._thread.join, stop.set):
                stack.callback(end)  # the last one first
            self._thread.start()
            self._stack = stack.pop_all()

    @property
    def stderr(self) -> str:
        """Its output so far, and that of this process."""
        return self._said.text()

    @property
    def ended(self) -> bool:
        """Whether an exception has ended its thread."""
        return not self._thread.is_alive()

    def run(self, call: Callable[[], Any]) -> Any:
        """Run a call on its thread, where services run: not amid a callback; return the result."""
        task = self._executor.create_task(call)
        end = time.monotonic() + DEADLINE
        while not task.done():
            assert time.monotonic() < end, f'it does not answer:\n{self.stderr}'
            self._thread.join(0.01)
        return task.result()

    def wait(self) -> int:
        """Return its exit code once it is done."""
        assert self._done is not None
        end = time.monotonic() + DEADLINE
        while not self._done.done():
            assert time.monotonic() < end, f'it does not end:\n{self.stderr}'
            self._thread.join(0.01)
        return int(self._done.result())

    def kill(self) -> None:
        """End it, and check its output."""
        self._stack.close()
        assert_only_log_lines(self.stderr)


def rejected(domain: int, folder: Path, *arguments: str | Path) -> str:
    """Return the one line that the node ends with, exit code 1, for these ROS arguments."""
    program = Program([executable('stewart_dynamics'), '--ros-args', *arguments], domain, folder)
    try:
        assert program.wait() == 1, program.stderr
    finally:
        program.kill()
    assert program.stdout == ''
    lines = program.stderr.splitlines()
    assert len(lines) == 1, program.stderr
    return lines[0]


class Peer:
    """A ROS node in this process that talks with the program under test."""

    def __init__(self, domain: int, name: str = 'peer') -> None:
        self.domain = domain
        self.context = Context()
        rclpy.init(args=[], context=self.context, domain_id=domain)
        self.node = rclpy.create_node(name, context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self.watched: Program | Inside | None = None

    def listen(self, topic: str, kind: Any, qos: QoSProfile = QOS) -> list[bytes]:
        """Return a list that gets every message of a topic, as it came."""
        received: list[bytes] = []
        self.node.create_subscription(kind, topic, received.append, qos, raw=True)
        return received

    def writer(self, topic: str, kind: Any, qos: QoSProfile = QOS) -> Publisher:
        """Return a publisher."""
        return self.node.create_publisher(kind, topic, qos)

    def spin(self, seconds: float = 0.05) -> None:
        """Take one message if one comes."""
        self._executor.spin_once(timeout_sec=seconds)

    def until(self, condition: Callable[[], Any], what: str) -> None:
        """Take messages until a condition holds; fail at the deadline or with the program."""
        end = time.monotonic() + DEADLINE
        while not condition():
            if self.watched is not None and self.watched.ended:
                raise AssertionError(f'{what}: the program has ended:\n{self.watched.stderr}')
            if time.monotonic() > end:
                said = self.watched.stderr if self.watched else ''
                raise AssertionError(f'{what}: not within {DEADLINE:g} s\n{said}')
            self.spin()

    def close(self) -> None:
        """Leave ROS."""
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)


class Sample(NamedTuple):
    """A setpoint's numbers; by default the hexapod rests at home."""

    position: tuple[float, ...] = (0.0, 0.0, 1.1)
    quaternion: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0)
    twist: tuple[float, ...] = (0.0,) * 6
    accel: tuple[float, ...] = (0.0,) * 6

    def motion(self) -> Motion:
        """Return the motion as the library has it."""
        length = math.sqrt(sum(q * q for q in self.quaternion))
        x, y, z, w = (number / length for number in self.quaternion)
        return Motion(self.position, np.reshape(from_quaternion(x, y, z, w), (3, 3)),
                      self.twist[:3], self.twist[3:], self.accel[:3], self.accel[3:])

    def messages(self, stamp: int, frame: str = 'base') -> dict[str, Any]:
        """Return the messages on the three topics."""
        head = header(stamp, frame)
        return {
            'setpoint/pose': PoseStamped(header=head, pose=Pose(
                position=Point(**_xyz(self.position)),
                orientation=Quaternion(**_xyzw(self.quaternion)))),
            'setpoint/twist': TwistStamped(header=head, twist=_twist(self.twist)),
            'setpoint/accel': AccelStamped(header=head, accel=Accel(
                linear=_vector(self.accel[:3]), angular=_vector(self.accel[3:])))}

    def combined(self, stamp: int, frame: str = 'base') -> MultiDOFJointTrajectory:
        """Return the one message on the combined topic."""
        return MultiDOFJointTrajectory(
            header=header(stamp, frame), joint_names=['platform'],
            points=[MultiDOFJointTrajectoryPoint(
                transforms=[Transform(translation=_vector(self.position),
                                      rotation=Quaternion(**_xyzw(self.quaternion)))],
                velocities=[_twist(self.twist)], accelerations=[_twist(self.accel)])])


HOME = Sample()
MOVING = Sample((0.05, -0.03, 1.12), (0.1, -0.05, 0.2, math.sqrt(1 - 0.0525)),
                (0.1, -0.05, 0.08, 0.2, -0.1, 0.15), (0.5, 0.4, -0.6, 0.3, 0.7, -0.2))


def header(stamp: int, frame: str = 'base') -> Header:
    """Return a header with a stamp in ns."""
    return Header(stamp=Time(nanoseconds=stamp).to_msg(), frame_id=frame)


def wrench_message(wrench: Sequence[float], frame: str = 'base') -> WrenchStamped:
    """Return a load on the platform."""
    return WrenchStamped(header=header(1, frame), wrench=Wrench(
        force=_vector(wrench[:3]), torque=_vector(wrench[3:])))


def nanoseconds(stamp: Any) -> int:
    """Return a stamp in ns."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _xyz(three: Sequence[float]) -> dict[str, float]:
    return dict(zip('xyz', three, strict=True))


def _xyzw(four: Sequence[float]) -> dict[str, float]:
    return dict(zip('xyzw', four, strict=True))


def _vector(three: Sequence[float]) -> Vector3:
    return Vector3(**_xyz(three))


def _twist(six: Sequence[float]) -> Twist:
    return Twist(linear=_vector(six[:3]), angular=_vector(six[3:]))


class NodeProcess:
    """The node's process in a domain of its own; ``overrides`` are ``name:=value``."""

    def __init__(self, folder: Path, *overrides: str, file: Path = PLATFORM,
                 command: Sequence[str | Path] | None = None, **environment: str) -> None:
        self._stack = ExitStack()
        self.domain = self._stack.enter_context(own_domain())
        self.file = file
        arguments = [part for override in overrides for part in ('-p', override)]
        self._begin = partial(
            Program, [*(command or [executable('stewart_dynamics')]), '--ros-args',
                      '--params-file', file, *arguments], self.domain,
            # A warning for a client that the node has not matched yet: see until_known.
            **{'PYTHONWARNINGS': 'ignore:failed to send response:RuntimeWarning', **environment})
        self._folders = (folder / str(n) for n in count(1))
        self._program: Program | None = None

    @property
    def program(self) -> Program:
        """Return the program, which has been started."""
        assert self._program is not None
        return self._program

    @property
    def runs(self) -> bool:
        """Whether it has been started and has not ended."""
        return self._program is not None and not self.program.ended

    def start(self) -> Program:
        """Start it, for the first time or again."""
        self._program = self._begin(folder=next(self._folders))
        self._stack.callback(self._program.kill)
        return self._program

    def stop(self, number: int = signal.SIGINT) -> None:
        """Stop it with a signal, and check how it ends."""
        code = self.program.stop(number)
        assert code == 0, self.program.stderr
        assert_only_log_lines(self.program.stderr)
        assert self.program.stdout == ''

    def kill(self) -> None:
        """Kill it if it runs."""
        if self._program is not None:
            self._program.kill()

    def close(self) -> None:
        """Stop it if it runs, and give its domain back."""
        with self._stack:
            if self.runs:
                self.stop()


class DynamicsNode:
    """
    The node in a process of its own, and a peer that feeds it and keeps its answers.

    Where the process runs already, the node in it is brought to the state ``unconfigured``, with
    the parameters of its file and ``overrides``; ``until_active`` configures and activates it
    then. The peer is new as well, so that nothing is left of an earlier test.
    """

    def __init__(self, process: NodeProcess, *overrides: str) -> None:
        self._process = process
        self._stack = ExitStack()
        self.domain = process.domain
        self.peer = Peer(self.domain)
        self._stack.callback(self.peer.close)
        self._stamp = 1_700_000_000_000_000_000
        self.expected: Counter[str] = Counter()
        self.asked: Counter[int] = Counter()  # setpoints that were sent, by their stamp
        self.fed: list[range] = []  # stamps that others may have sent, each once
        self.platform = StewartPlatform.from_yaml(process.file)
        self.kind = self.platform.parameters.leg_kind
        self.of_legs, self.outputs = LegTopics.of(self.kind), outputs_of(self.kind)
        self._statuses: dict[str, DiagnosticStatus] = {}
        self._reported: list[DiagnosticStatus] = []
        self.time = 0  # of the last diagnostics [ns]
        self._decoded: dict[str, list[Any]] = defaultdict(list)
        self._clients = {name: self.peer.node.create_client(kind, f'{NODE}/{name}')
                         for name, kind in SERVICES.items()}
        self._said: list[str] = []
        self._known = False
        self._unconfigured = process.runs or bool(overrides)
        try:
            if process.runs:
                # Before the others listen: latched messages there are of another test.
                self.peer.watched = self.program
                self._clean_up()
            self.writers = {topic: self.peer.writer(f'{NODE}/{topic}', kind)
                            for topic, kind in INPUTS.items()}
            self.raw = {topic: self.peer.listen(
                f'{NODE}/{topic}', kind, LATCHED if topic == 'singularity_warning' else QOS)
                for topic, kind in self.outputs.items()}
            self.peer.node.create_subscription(
                Log, '/rosout', lambda message: self._said.append(message.msg), LATCHED)
            self.peer.node.create_subscription(
                DiagnosticArray, '/diagnostics', self._on_diagnostics, QOS)
            if not process.runs:
                self.peer.watched = process.start()
            if self._unconfigured:
                self._renew(overrides)
        except BaseException:
            self._stack.close()  # or the next one hears this one as well
            raise

    @property
    def program(self) -> Program:
        """Return the process in which the node runs."""
        return self._process.program

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.time = nanoseconds(message.header.stamp)
        for status in message.status:
            self._statuses[status.name.rpartition(': ')[2]] = status
            self._reported.append(status)

    # -- awaited events -------------------------------------------------------------------

    def until(self, condition: Callable[[], Any], what: str) -> None:
        """Take messages until a condition holds."""
        self.peer.until(condition, what)

    def until_active(self, writers: int = 1) -> None:
        """
        Wait until the node answers: it hears us and we hear it.

        Its diagnostics show that it is active, and the number of writers on each topic.
        """
        if self._unconfigured:
            self._unconfigured = False
            for transition in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
                assert self.change(transition), self.program.stderr
        self.until_known()
        self._statuses.clear()
        key_of_writers = re.compile('setpoint/.*: writers')

        def heard() -> bool:
            values = self.values('setpoints')
            found = [number for key, number in values.items() if key_of_writers.fullmatch(key)]
            return bool(found) and set(found) == {str(writers)} and all(
                self.writers[topic].get_subscription_count() for topic in self.topics)

        self.until(heard, 'the node is active and hears us')

    def until_known(self) -> None:
        """
        Wait until the node knows all that the peer has made so far.

        It discovers readers and writers in the order in which they are made, so it knows the
        others when it has answered the one that is made last, a client. A service whose answer
        finds no reader gives it up after 0.1 s: it is asked again.
        """
        client = self.peer.node.create_client(GetState, f'{NODE}/get_state')
        asked: list[Any] = []
        ask_at = 0.0

        def answered() -> bool:
            nonlocal ask_at
            if client.service_is_ready() and time.monotonic() > ask_at:
                asked.append(client.call_async(GetState.Request()))
                ask_at = time.monotonic() + 1.0
            return any(future.done() for future in asked)

        self.until(answered, 'the node knows us')
        self.peer.node.destroy_client(client)
        self._known = True

    def until_said(self, text: str) -> None:
        """Wait until the node has logged a text, on stderr and on /rosout."""
        self.until(lambda: any(text in said for said in self._said)
                   and text in self.program.stderr, f'the node says {text!r}')

    @property
    def topics(self) -> list[str]:
        """Return the topics that the node subscribes to, by its parameters."""
        return [topic for topic in INPUTS if f'{topic}: writers' in self.values('setpoints')]

    def received(self, topic: str) -> list[Any]:
        """Return the messages of an output topic so far."""
        decoded = self._decoded[topic]
        decoded += [deserialize_message(raw, self.outputs[topic])
                    for raw in self.raw[topic][len(decoded):]]
        return decoded

    @property
    def warning(self) -> bool | None:
        """Return the last warning of a singularity, None before the first."""
        warnings = self.received('singularity_warning')
        return bool(warnings[-1].data) if warnings else None

    def status(self, name: str) -> DiagnosticStatus:
        """Return the last diagnostics of a name, empty ones before the first."""
        return self._statuses.get(name, DiagnosticStatus())

    def values(self, name: str) -> dict[str, str]:
        """Return the keys and values of the last diagnostics of a name."""
        return {pair.key: pair.value for pair in self.status(name).values}

    def until_status(self, name: str, level: bytes, text: str) -> str:
        """Return the message of the diagnostics once they have a level and a text in it."""
        self.until(lambda: self.status(name).level == level and text in self.status(name).message,
                   f'diagnostics of {name} have level {level!r} and {text!r}')
        return str(self.status(name).message)

    def until_reported_anew(self) -> None:
        """Forget the diagnostics so far, and wait for the next."""
        self._statuses.clear()
        self.until(lambda: self._statuses, 'the node reports')

    def until_reported(self, name: str, level: bytes, text: str) -> None:
        """Wait until the diagnostics of a name have had a level and a text in it, ever."""
        self.until(lambda: any(
            status.name.endswith(f': {name}') and status.level == level and text in status.message
            for status in self._reported), f'diagnostics of {name} had {level!r} and {text!r}')

    # -- setpoints -------------------------------------------------------------------------

    def stamp(self, step: int = STEP) -> int:
        """Return the next setpoint's stamp [ns], 10 ms after the one before."""
        self._stamp += step
        return self._stamp

    def publish(self, topic: str, message: Any) -> None:
        """Publish a message, or bytes in the place of one."""
        if topic in FIRST:
            self.asked[_stamp_of(message)] += 1
        self.writers[topic].publish(message)

    def send(self, sample: Sample = HOME, stamp: int | None = None,
             frame: str = 'base') -> int:
        """Publish a setpoint on all topics that the node subscribes to, and return its stamp."""
        stamp = self.stamp() if stamp is None else stamp
        messages = {**sample.messages(stamp, frame),
                    'setpoint/combined': sample.combined(stamp, frame)}
        for topic in self.topics:
            self.publish(topic, messages[topic])
        return stamp

    def state_of(self, stamp: int) -> JointState:
        """Return the leg states that carry a stamp, once they and all others have come."""
        found: list[JointState] = []

        def answered() -> bool:
            found[:] = [state for state in self.received('leg_states')
                        if nanoseconds(state.header.stamp) == stamp]
            states = self.received('leg_states')
            positions, efforts = (len(self.raw[topic]) for topic in self.of_legs)
            return bool(found) and positions == len(
                self.raw['jacobian_determinant']) == len(states) and (
                    efforts == sum(len(state.effort) > 0 for state in states))

        self.until(answered, f'the setpoint with stamp {stamp} is answered')
        assert len(found) == 1
        return found[0]

    def result_of(self, sample: Sample, wrench: Sequence[float] | None = None,
                  platform: StewartPlatform | None = None) -> InverseDynamics:
        """Return the library's numbers for a setpoint."""
        return (platform or self.platform).inverse_dynamics(sample.motion(), wrench)

    def answer(self, sample: Sample = HOME, wrench: Sequence[float] | None = None,
               platform: StewartPlatform | None = None, stamp: int | None = None) -> JointState:
        """Send a setpoint and check that it is answered, with the library's bits."""
        before = len(self.received('leg_states'))
        stamp = self.send(sample, stamp)
        state = self.state_of(stamp)
        assert len(self.received('leg_states')) == before + 1, 'more than this one was answered'
        self.check(state, self.result_of(sample, wrench, platform), platform)
        return state

    def check(self, state: JointState, result: InverseDynamics,
              platform: StewartPlatform | None = None) -> None:
        """Check leg states, all of their bits, against the library's numbers."""
        parameters = (platform or self.platform).parameters
        bound = parameters[self.kind.effort_limit]
        positions, rates, efforts = (getattr(result, each.field) for each in (
            self.kind.position, self.kind.rate, self.kind.effort))
        assert state.name == list(parameters['joints'])
        assert bits(state.position) == bits(positions - parameters['geometry.zero_length'])
        assert bits(state.velocity) == bits(rates)
        assert bits(state.effort) == bits(np.clip(efforts, -bound, bound))

    def rejects(self, topic: str, reason: str, number: int = 1) -> None:
        """Expect that the diagnostics count this number of further rejections."""
        self.expected[f'rejected, {topic}: {reason}'] += number

    def counted(self) -> Counter[str]:
        """Return how many rejections of each kind the last diagnostics count."""
        return Counter({key: int(number) for key, number in self.values('setpoints').items()
                        if key.startswith('rejected, ')})

    def until_counted(self) -> None:
        """Wait until the diagnostics count the rejections that are expected, and no others."""
        try:
            self.until(lambda: self.counted() == self.expected, 'rejections are counted')
        except AssertionError as exc:
            raise AssertionError(
                f'counted {self.counted()}, expected {self.expected}: {exc}') from exc

    def at_work(self, sample: Sample = HOME) -> None:
        """
        Check that the node does its work, and has done nothing else so far.

        A setpoint is answered with the library's bits, rejections are counted as expected, and of
        all that has come out nothing is without a setpoint that asked for it.
        """
        self.answer(sample)
        self.until_counted()
        states = self.received('leg_states')
        efforts = self.raw[self.of_legs.efforts]
        count = sum(len(state.effort) > 0 for state in states)
        self.until(lambda: len(efforts) >= count, 'all efforts have come')
        assert len(efforts) == count
        self.check_answers()

    # -- services --------------------------------------------------------------------------

    def call(self, name: str, request: Any) -> Any:
        """Return the answer of one of the node's services."""
        if not self._known:
            self.until_known()
        client = self._clients[name]
        self.until(client.service_is_ready, f'{name} is there')
        future = client.call_async(request)
        self.until(future.done, f'{name} answers')
        return future.result()

    def set_parameters(self, **changes: Any) -> SetParametersResult:
        """Set parameters, all or none, ``__`` in a name for a point."""
        return self.set_atomically([
            RosParameter(name.replace('__', '.'), value=value)
            for name, value in changes.items()])

    def set_atomically(self, changes: Sequence[RosParameter]) -> SetParametersResult:
        """Set parameters through the node's service, all or none."""
        return self.call('set_parameters_atomically', SetParametersAtomically.Request(
            parameters=[change.to_parameter_msg() for change in changes])).result

    # -- lifecycle -------------------------------------------------------------------------

    def change(self, transition: int) -> bool:
        """Ask for a transition of the lifecycle, and return whether it is done."""
        future = self.begin_change(transition)
        self.until(future.done, 'change_state answers')
        return bool(future.result().success)

    def begin_change(self, transition: int) -> Future:
        """Ask for a transition of the lifecycle, and return the future of its answer."""
        if not self._known:
            self.until_known()
        client = self._clients['change_state']
        self.until(client.service_is_ready, 'change_state is there')
        return client.call_async(ChangeState.Request(transition=Transition(id=transition)))

    @property
    def state(self) -> str:
        """Return the state of the lifecycle."""
        return str(self.call('get_state', GetState.Request()).current_state.label)

    def _clean_up(self) -> None:
        """Bring the node that runs to the state ``unconfigured``."""
        state = self.state
        if state == 'active':
            assert self.change(Transition.TRANSITION_DEACTIVATE)
        if state != 'unconfigured':
            assert self.change(Transition.TRANSITION_CLEANUP)

    def _renew(self, overrides: Sequence[str]) -> None:
        """Bring the node that runs to the state ``unconfigured``, with these parameters."""
        self._clean_up()
        wanted = {name: parameter.default for name, parameter in Parameters.table.items()}
        wanted.update(Parameters.from_yaml(self._process.file).given)
        wanted.update((name, yaml.safe_load(text)) for name, _, text in (
            override.partition(':=') for override in overrides))
        values = self.call('get_parameters', GetParameters.Request(names=list(wanted))).values
        changes = {
            name: _listed(value)
            for (name, value), message in zip(wanted.items(), values, strict=True)
            if _listed(value) != _listed(parameter_value_to_python(message))}
        if None in changes.values():  # a value cannot be unset
            self._process.stop()
            self.peer.watched = self._process.start()
            self._known = False
            self._renew(overrides)
            return
        if changes:
            result = self.set_atomically([
                RosParameter(name, value=value) for name, value in changes.items()])
            assert result.successful, result.reason
        self.program.forget()
        self._said.clear()

    # -- the end ---------------------------------------------------------------------------

    def stop(self, number: int = signal.SIGINT) -> None:
        """Stop the node with a signal and check how it ends, and all of its output."""
        self._process.stop(number)
        self.check_answers()

    def start_again(self) -> DynamicsNode:
        """
        Kill the node, as nothing in it can notice, and start it anew with the same arguments.

        It has a peer of its own: messages in transit from the one before do not come there.
        """
        self._process.kill()
        self.close()
        return DynamicsNode(self._process)

    def check_answers(self) -> None:
        """
        Check that every answer was asked for, no more often than that, and is of numbers.

        A setpoint whose stamp is zero is answered with the time.
        """
        self.check_finite()
        states = self.received('leg_states')
        answered = Counter(nanoseconds(state.header.stamp) for state in states)
        repeated = answered - self.asked - Counter(
            stamp for stamp in answered if any(stamp in stamps for stamps in self.fed))
        assert repeated.total() <= self.asked[0], repeated
        # Forces carry no stamp: each is that of an answer, in their order.
        efforts = [bits(state.effort) for state in states if len(state.effort)]
        forces = [bits(each.data) for each in self.received(self.of_legs.efforts)]
        for n, (effort, force) in enumerate(zip(efforts, forces, strict=False)):
            assert effort == force, f'force {n} of {len(forces)}'

    def check_finite(self) -> None:
        """Check that no output had a number that is not finite."""
        for topic in self.outputs:
            for message in self.received(topic):
                numbers = ([*message.position, *message.velocity, *message.effort]
                           if topic == 'leg_states' else np.atleast_1d(message.data))
                assert np.all(np.isfinite(numbers)), (topic, message)

    def close(self) -> None:
        """Check the node's output and answers, and leave ROS; the process may run on."""
        with self._stack:
            assert_only_log_lines(self.program.stderr)
            self.check_answers()


class Feeder(Program):
    """
    A publisher of setpoints in a process of its own: the hexapod at rest, ``rate`` in a second.

    It ends when the node has ``many``, or when it is stopped.
    """

    def __init__(self, node: DynamicsNode, folder: Path, rate: int, many: int = _ENDLESS,
                 **environment: str) -> None:
        self.node = node
        self._before, self._known = self._writers(), self._endpoints()
        first = node.stamp()
        self.stamps = range(first, first + many * STEP, STEP)
        node.stamp(many * STEP)
        messages = {**HOME.messages(0), 'setpoint/combined': HOME.combined(0)}
        parts = [part for topic in node.topics for part in (topic, raw(messages[topic]).hex())]
        super().__init__([sys.executable, FEEDER, *map(str, (rate, first, STEP, many)), *parts],
                         node.domain, folder, **environment)

    def begin(self, heard: bool = True) -> None:
        """Let it begin, and expect answers; its first setpoints may be lost."""
        if heard:
            self.node.until(lambda: self._writers() > self._before, 'the node hears the feeder')
        else:
            self.node.until(lambda: self._endpoints() - self._known, 'the feeder is there')
        self.node.fed.append(self.stamps)
        self.process.send_signal(signal.SIGUSR1)

    def end(self) -> None:
        """Stop it if it still runs, and wait until the node has removed it."""
        if not self.ended:
            self.process.terminate()
        assert self.wait() == 0, self.stderr
        assert_only_log_lines(self.stderr)
        self.node.until_reported_anew()
        self.node.until(lambda: self._writers() <= self._before, 'the feeder is gone')

    def _endpoints(self) -> set[bytes]:
        """Return what identifies the writers, those of killed processes as well."""
        topic = f'{NODE}/{self.node.topics[-1]}'  # the last that it makes
        return {bytes(info.endpoint_gid) for info in
                self.node.peer.node.get_publishers_info_by_topic(topic)}

    def _writers(self) -> int:
        values = self.node.values('setpoints')
        return min(int(values[f'{topic}: writers']) for topic in self.node.topics)


class Planner:
    """Sends a node whole motions, and keeps the bytes that it answers."""

    def __init__(self, node: DynamicsNode) -> None:
        self._node = node
        self.raw = node.peer.listen(f'{NODE}/leg_trajectory', JointTrajectory)
        self._writer = node.peer.writer(f'{NODE}/platform_trajectory', MultiDOFJointTrajectory)
        node.until(lambda: self._writer.get_subscription_count() == 1, 'the node hears it')
        node.until(lambda: node.peer.node.count_publishers(f'{NODE}/leg_trajectory') == 1,
                   'it hears the node')
        node.until_known()

    def send(self, samples: Sequence[Sample], step: int = 10 * STEP, frame: str = 'base',
             stamp: int = STEP) -> None:
        """Send a motion through these samples, ``step`` ns apart."""
        message = MultiDOFJointTrajectory(header=header(stamp, frame), joint_names=['platform'])
        for n, sample in enumerate(samples):
            point, = sample.combined(0).points
            point.time_from_start.sec, point.time_from_start.nanosec = divmod(
                n * step, 1_000_000_000)
            message.points.append(point)
        self._writer.publish(message)

    def send_bytes(self, message: bytes) -> None:
        """Send these bytes in the place of a message."""
        self._writer.publish(message)

    def send_long(self, points: int, stamp: int = STEP, leap: float = 0.0, step: int = 1,
                  swing: float = 0.0) -> None:
        """Send points at home, ``step`` ms apart: every second one higher, the last one, too."""
        point, = HOME.combined(0).points
        two = raw(MultiDOFJointTrajectory(header=header(stamp, ''), points=[point, point]))
        # Points are of 184 bytes, their times in the last eight.
        head, each = two[:-2 * 184], two[-184:]
        assert head[-4:] == b'\x02\0\0\0'
        many = np.tile(np.frombuffer(each, np.uint8), (points, 1))
        times = step * np.arange(points)
        many[:, 176:].view('<i4')[:] = np.column_stack([times // 1000, times % 1000 * 1_000_000])
        many[1::2, 24:32].view('<f8')[:] += swing
        many[-1, 24:32].view('<f8')[:] += leap
        self._writer.publish(head[:-4] + points.to_bytes(4, 'little') + many.tobytes())

    def fill(self, leap: float = 0.0) -> None:
        """Send long trajectories until the queue is full."""
        while not any('queue full' in line for line in log_lines(
                self._node.program.stderr, 'ERROR')):
            self.send_long(20_000, leap=leap)
            self._node.peer.spin(0.1)

    def until_answered(self, number: int) -> JointTrajectory:
        """Return the last answer once the given number has come."""
        self._node.until(lambda: len(self.raw) >= number, f'{number} trajectories are answered')
        assert len(self.raw) == number
        return deserialize_message(self.raw[-1], JointTrajectory)

    def until_rejected(self, text: str, number: int) -> None:
        """Wait until the last trajectory is rejected for a reason, and ``number`` in total."""
        self._node.until_status('planned trajectory', b'\2', text)
        self._node.until(
            lambda: self._node.values('planned trajectory')['rejected'] == str(number),
            f'{number} trajectories are rejected')


def bits(numbers: Any) -> bytes:
    """Return the bits of float64 numbers."""
    return np.ascontiguousarray(numbers, dtype=np.float64).tobytes()


def raw(message: Any) -> bytes:
    """Return a message's bytes as they are sent."""
    return bytes(serialize_message(message))


def _listed(value: Any) -> Any:
    """Return a parameter's value, an array as a list; None for no entries."""
    if isinstance(value, str) or not hasattr(value, '__len__'):
        return value
    return list(value) or None


def _stamp_of(message: Any) -> int:
    """Return the stamp of a message, or of the bytes of one; any other number for no message."""
    data = message if isinstance(message, bytes) else raw(message)
    try:
        sec, nanosec = struct.unpack_from('<iI' if data[1] else '>iI', data, 4)
    except (IndexError, struct.error):
        return -1
    return int(sec) * 1_000_000_000 + int(nanosec)
