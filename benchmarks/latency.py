# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The processes around the node whose latency is measured.

A source publishes setpoints and notes when it begins to publish the last message of each; a
listener notes when its leg states have come, by the same clock of the computer; a caller asks
for parameters and states meanwhile, a viewer takes the markers, a hexapod has its legs measured
and its payload weighed, an IMU is on the base, a planner sends planned trajectories.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from contextlib import suppress
import gc
import itertools
from pathlib import Path
import random
import sys
import time
from typing import Any

from geometry_msgs.msg import AccelStamped, PoseStamped, Transform, Twist, TwistStamped
from lifecycle_msgs.srv import GetState
import numpy as np
from pass_through import spin, TOPICS
from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParametersAtomically
import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu, JointState
from std_srvs.srv import Trigger
from stewart_dynamics import Parameters, StewartPlatform
from stewart_dynamics.mechanics.frames.rotation import to_quaternion
from stewart_dynamics.messages.joint_state import JointStateWriter
from stewart_dynamics.messages.layout import Layout
from stewart_dynamics.messages.setpoint import layout_of
from stewart_dynamics.reference_motion.motion_functions import motion_at
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from trajectory_msgs.msg import (
    JointTrajectory, MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint)
from visualization_msgs.msg import MarkerArray

PARAMETERS = Path(__file__).resolve().parents[1] / 'config' / 'platform.yaml'
QOS = QoSProfile(depth=2000)
PERIOD = 1_000_000  # [ns]
FIRST_STAMP = 1_700_000_000_000_000_000
DISCOVERY_SECONDS = 60.0
CALLS_PERIOD = 0.1  # [s]
PLAN_SECONDS = 1.0
IMU_EVERY = 5  # setpoints: 200 Hz
# All six coordinates move, within the limits of config/platform.yaml, and repeat themselves.
MOTION = {
    'motion.type': 'sine', 'motion.initial': (0.0, 0.0, 1.1, 0.0, 0.0, 0.0),
    'motion.amplitude': (0.03, 0.03, 0.04, 0.04, 0.04, 0.06),
    'motion.frequency': (0.25, 0.5, 0.25, 0.5, 0.25, 0.25),
    'motion.phase': (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)}
REPEATED = 4000


def messages(source: str) -> list[tuple[bytes, ...]]:
    """Return the messages of each setpoint, in the order of their topics, with no stamp yet."""
    motion = motion_at(ReferenceMotionParameters(MOTION), np.arange(REPEATED) * (PERIOD * 1e-9))
    numbers = (np.column_stack([motion.position, to_quaternion(motion.rotation)]),
               np.column_stack([motion.linear_velocity, motion.angular_velocity]),
               np.column_stack([motion.linear_acceleration, motion.angular_acceleration]))
    stamps = np.zeros(REPEATED, dtype=np.int64)
    if source == 'combined':
        empty = MultiDOFJointTrajectory(
            joint_names=['platform'], points=[MultiDOFJointTrajectoryPoint(
                transforms=[Transform()], velocities=[Twist()], accelerations=[Twist()])])
        written = [_layout(empty).write(stamps, *numbers)]
    else:
        written = [_layout(kind()).write(stamps, values) for kind, values in zip(
            (PoseStamped, TwistStamped, AccelStamped), numbers, strict=True)]
    return [tuple(each.tobytes() for each in together) for together in zip(*written, strict=True)]


def _layout(message: Any) -> Layout:
    package = type(message).__module__.partition('.')[0]
    return layout_of(f'{package}/msg/{type(message).__name__}', bytes(serialize_message(message)))


def publish(path: Path, turns: Sequence[str]) -> None:
    """
    Publish turn after turn of setpoints at 1 kHz, each when a line comes on stdin.

    Parameters
    ----------
    path : Path
        Gets the times [ns], one array for each turn.
    turns : sequence of str
        ``NODE SOURCE SETPOINTS`` each: who gets them.

    """
    node = rclpy.create_node('setpoint_source')
    of_source = {source: messages(source) for source in TOPICS}
    publishers: dict[str, list[Any]] = {}
    plan = []
    for turn in turns:
        name, source, number = turn.split()
        if name not in publishers:
            publishers[name] = [node.create_publisher(kind, f'/{name}/setpoint/{topic}', QOS)
                                for topic, kind in TOPICS[source].items()]
        plan.append((publishers[name], of_source[source], int(number)))
    wait_for(lambda: all(each.get_subscription_count() for of_node in publishers.values()
                         for each in of_node), 'every topic has a subscriber')
    print('ready', flush=True)
    stamp = FIRST_STAMP
    times = []
    gc.disable()
    for of_node, content, number in plan:
        sys.stdin.readline()
        times.append(_publish_turn(of_node, content, stamp, number))
        stamp += number * PERIOD
        print('done', flush=True)
    np.savez(path, *times)


def _publish_turn(publishers: Any, content: Any, stamp: int, number: int) -> Any:
    published = np.zeros(number, dtype=np.int64)
    *first, last = publishers
    begin = time.monotonic_ns()
    for n in range(number):
        sec, nanosec = divmod(stamp + n * PERIOD, 1_000_000_000)
        head = b'\x00\x01\x00\x00' + sec.to_bytes(4, 'little') + nanosec.to_bytes(4, 'little')
        together = [head + body[12:] for body in content[n % REPEATED]]
        left = begin + n * PERIOD - time.monotonic_ns()
        if left > 0:
            time.sleep(left * 1e-9)
        for publisher, message in zip(first, together, strict=False):
            publisher.publish(message)
        published[n] = time.monotonic_ns()
        last.publish(together[-1])
    return published


def listen(path: Path, names: Sequence[str]) -> None:
    """Note stamp and time of the leg states of these nodes [ns], until a signal."""
    node = rclpy.create_node('leg_states_listener')
    stamps, times = array('Q'), array('q')
    now = time.monotonic_ns

    def note(data: bytes) -> None:
        times.append(now())
        stamps.append(int.from_bytes(data[4:12], 'little'))

    for name in names:
        node.create_subscription(JointState, f'/{name}/leg_states', note, QOS, raw=True)
    wait_for(lambda: all(node.count_publishers(f'/{name}/leg_states') for name in names),
             'every node is there')
    print('ready', flush=True)
    gc.disable()
    spin(node)
    both = np.array(stamps, dtype=np.uint64)
    seconds, nanoseconds = both & 0xFFFFFFFF, both >> 32
    np.savez(path, stamps=(seconds * 1_000_000_000 + nanoseconds).astype(np.int64),
             times=np.array(times, dtype=np.int64))


def call(name: str) -> None:
    """Call parameter and lifecycle services of a node in turns, and say how many answered."""
    node = rclpy.create_node('caller')
    clients = [(node.create_client(kind, f'/{name}/{service}'), request)
               for kind, service, request in (
        (SetParametersAtomically, 'set_parameters_atomically', SetParametersAtomically.Request(
            parameters=[Parameter('platform.mass', value=150.0).to_parameter_msg()])),
        (DescribeParameters, 'describe_parameters', DescribeParameters.Request(
            names=['platform.mass'])),
        (GetParameters, 'get_parameters', GetParameters.Request(names=['geometry.base_joints'])),
        (GetState, 'get_state', GetState.Request()))]
    wait_for(lambda: all(client.service_is_ready() for client, _ in clients),
             'every service is there')
    turn = itertools.cycle(clients)
    answered = []

    def ask() -> None:
        client, request = next(turn)
        client.call_async(request).add_done_callback(lambda _: answered.append(1))

    node.create_timer(CALLS_PERIOD, ask)
    print('ready', flush=True)
    spin(node)
    print(len(answered), flush=True)


def view(name: str) -> None:
    """Take the markers of a node as bytes, until a signal, and say how many there were."""
    node = rclpy.create_node('viewer')
    seen: list[int] = []
    node.create_subscription(MarkerArray, f'/{name}/markers', lambda data: seen.append(len(data)),
                             QoSProfile(depth=1), raw=True)
    wait_for(lambda: node.count_publishers(f'/{name}/markers'), 'the node is there')
    print('ready', flush=True)
    spin(node)
    print(len(seen), flush=True)


def plan(path: Path, name: str, points: int) -> None:
    """
    Send planned trajectories, one a second: as many as each number on stdin; note their times.

    Parameters
    ----------
    path : Path
        Gets when each begins to be published, when it is, and when its answer is here [ns].
    name : str
        Name of the node.
    points : int
        Number of points of each motion, over ten seconds.

    """
    node = rclpy.create_node('planner')
    executor = EventsExecutor()
    executor.add_node(node)
    answers: list[int] = []
    node.create_subscription(JointTrajectory, f'/{name}/leg_trajectory', lambda data: (
        answers.append(time.monotonic_ns()) if len(data) > points else None), QOS, raw=True)
    publisher = node.create_publisher(
        MultiDOFJointTrajectory, f'/{name}/platform_trajectory', QOS)
    message = trajectory(points)
    wait_for(lambda: publisher.get_subscription_count() and node.count_publishers(
        f'/{name}/leg_trajectory'), 'the node is there')
    print('ready', flush=True)
    times = []
    for line in iter(sys.stdin.readline, ''):
        for n in range(int(line)):
            if n:
                time.sleep(PLAN_SECONDS)
            answers.clear()
            begin = time.monotonic_ns()
            publisher.publish(message)
            published = time.monotonic_ns()
            while not answers:
                executor.spin_once(timeout_sec=10.0)
            times.append((begin, published, answers[0]))
        print('done', flush=True)
    executor.shutdown()
    np.savez(path, times=np.array(times))


def trajectory(points: int) -> bytes:
    """Return a MultiDOFJointTrajectory of the motion over ten seconds, with a number of points."""
    seconds = np.linspace(0.0, 10.0, points)
    motion = motion_at(ReferenceMotionParameters(MOTION), seconds)
    rows = np.column_stack([motion.position, to_quaternion(motion.rotation),
                            motion.rows[:, 12:24]]).tolist()
    message = MultiDOFJointTrajectory(joint_names=['platform'])
    for second, row in zip(seconds.tolist(), rows, strict=True):
        point = MultiDOFJointTrajectoryPoint(
            transforms=[Transform()], velocities=[Twist()], accelerations=[Twist()])
        to, twist, accel = point.transforms[0], point.velocities[0], point.accelerations[0]
        vectors = (to.translation, twist.linear, twist.angular, accel.linear, accel.angular)
        for vector, at in zip(vectors, (0, 7, 10, 13, 16), strict=True):
            vector.x, vector.y, vector.z = row[at:at + 3]
        to.rotation.x, to.rotation.y, to.rotation.z, to.rotation.w = row[3:7]
        point.time_from_start.sec, point.time_from_start.nanosec = divmod(
            round(second * 1e9), 1_000_000_000)
        message.points.append(point)
    return bytes(serialize_message(message))


def legs(parameters: Parameters, first: int) -> list[bytes]:
    """Return the measured leg states of the motion, at 1 kHz."""
    motion = motion_at(ReferenceMotionParameters(MOTION), np.arange(REPEATED) * (PERIOD * 1e-9))
    result = StewartPlatform(parameters).inverse_dynamics(motion)
    stamps = first + PERIOD * np.arange(REPEATED)
    layout = JointStateWriter(parameters.joints).layout(True)
    return [each.tobytes() for each in layout.write(
        stamps, result.lengths - parameters.geometry.zero_length, result.rates,
        result.forces)]


def measure(*names: str, asked: str = '') -> None:
    """
    Publish measured legs to nodes at 1 kHz until a signal, and say how many.

    One of them may be asked for its payload, each second.
    """
    node = rclpy.create_node('hexapod')
    publishers = [node.create_publisher(JointState, f'/{name}/measured_legs', QOS)
                  for name in names]
    client = node.create_client(Trigger, f'/{asked}/identify_payload') if asked else None
    bodies = legs(Parameters.from_yaml(PARAMETERS), FIRST_STAMP)
    for publisher in publishers:
        wait_for(publisher.get_subscription_count, 'the node is there')
    if client:
        wait_for(client.service_is_ready, 'its service is there')
    print('ready', flush=True)
    begin = time.monotonic_ns()
    number = 0
    with suppress(KeyboardInterrupt, RCLError):
        while rclpy.ok():
            sec, nanosec = divmod(FIRST_STAMP + number * PERIOD, 1_000_000_000)
            message = (b'\x00\x01\x00\x00' + sec.to_bytes(4, 'little')
                       + nanosec.to_bytes(4, 'little') + bodies[number % REPEATED][12:])
            for publisher in publishers:
                publisher.publish(message)
            number += 1
            if client and number % 1000 == 0:
                client.call_async(Trigger.Request())
            left = begin + number * PERIOD - time.monotonic_ns()
            if left > 0:
                time.sleep(left * 1e-9)
    print(number, flush=True)


def sway(name: str) -> None:
    """
    Publish the readings of an IMU to a node, one with every fifth setpoint's stamp.

    It comes at any time until the next setpoint, as the clocks of an IMU and of setpoints drift.
    """
    node = rclpy.create_node('imu')
    publisher = node.create_publisher(Imu, f'/{name}/base/imu', QOS)
    message = Imu()
    message.linear_acceleration.z, message.angular_velocity.x = 9.8, 0.1
    body = bytes(serialize_message(message))
    heard = itertools.count()
    sent: list[int] = []

    def follow(data: bytes) -> None:
        if next(heard) % IMU_EVERY == 0:
            time.sleep(PERIOD * 1e-9 * random.random())
            publisher.publish(data[:12] + body[12:])
            sent.append(1)

    node.create_subscription(PoseStamped, f'/{name}/setpoint/pose', follow, QOS, raw=True)
    wait_for(publisher.get_subscription_count, 'the node is there')
    print('ready', flush=True)
    spin(node)
    print(len(sent), flush=True)


def wait_for(condition: Any, what: str) -> None:
    """Wait for discovery."""
    end = time.monotonic() + DISCOVERY_SECONDS
    while not condition():
        if time.monotonic() > end:
            raise SystemExit(f'not within {DISCOVERY_SECONDS:g} s: {what}')
        time.sleep(0.05)


def main() -> None:
    """Be one of them."""
    role, *arguments = sys.argv[1:]
    rclpy.init(args=[])
    if role == 'publish':
        publish(Path(arguments[0]), arguments[1:])
    elif role == 'listen':
        listen(Path(arguments[0]), arguments[1:])
    elif role == 'view':
        view(*arguments)
    elif role == 'plan':
        plan(Path(arguments[0]), arguments[1], int(arguments[2]))
    elif role == 'measure':
        measure(*arguments)
    elif role == 'weigh':
        measure(*arguments, 'measured', asked=arguments[0])
    elif role == 'sway':
        sway(*arguments)
    else:
        call(*arguments)
    rclpy.try_shutdown()


if __name__ == '__main__':
    main()
