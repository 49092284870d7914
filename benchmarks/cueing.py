# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Speed of motion cueing, and random flights and drives under the governor: limits exceeded.

Half of the motions are wild: steps of 5 g, spins, noise; the other half are those of vehicles.

--latency measures the node instead, from the message of a vehicle to the first setpoint that has
its acceleration, which steps at random times. Beside it a bare node publishes the last reading in
the same messages, at the same rate, and computes nothing; they take turns.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
import os
import random
import signal
import subprocess
import sys
import time
from typing import Any

from inverse_dynamics import markdown, processor_name, write
import numpy as np

from stewart_dynamics import Motion, MotionCueing, Parameters, StewartPlatform
from stewart_dynamics.arrays import Array
from stewart_dynamics.executables import executable
from stewart_dynamics.mechanics.drives.motor_limits import MotorLimits
from stewart_dynamics.mechanics.drives.motors import Drives
from stewart_dynamics.mechanics.pose_limits import PoseLimits
from stewart_dynamics.mechanics.rows import CONDITION, DETERMINANT, FORCES, RATES

RATE = 250.0
PIECE = 40.0  # [s]
GRAVITY = 9.80665

BEGIN, END = '<!-- cueing: begin -->', '<!-- cueing: end -->'
NODES = {'stewart_cueing': '`stewart_cueing`', 'bare': 'bare node'}
DOMAIN = '101'  # the tests have those below
VEHICLE_RATE = 100.0  # [Hz]
STEP = 1.0  # of the acceleration [m/s^2]; setpoints have the half, by the default gain
STEP_EVERY = 5  # messages
FADE = 1.5  # of the node at the begin of a turn, not measured [s]


def vehicle(generator: np.random.Generator, times: Array, wild: bool) -> tuple[Array, Array]:
    """Return accelerations without gravity and angular velocities (N, 3) of a random motion."""
    n = len(times)
    inputs = np.zeros((n, 6))
    size = np.array([4.0, 4.0, 3.0, 0.5, 0.4, 0.5]) * generator.uniform(0.2, 1.5)
    if wild:
        size = np.array([25.0, 25.0, 25.0, 3.0, 3.0, 6.0]) * generator.uniform(0.1, 2.0)
    for axis in range(6):
        kind = generator.integers(4)
        if kind == 0:  # steps
            knots = np.sort(generator.uniform(0.0, times[-1], generator.integers(1, 40)))
            levels = generator.normal(size=len(knots) + 1)
            inputs[:, axis] = levels[np.searchsorted(knots, times)]
        elif kind == 1:  # oscillations
            for _ in range(4):
                inputs[:, axis] += np.sin(
                    generator.uniform(0.1, 15.0) * times + generator.uniform(0.0, 6.3)) / 2.0
        elif kind == 2:  # noise of a bandwidth
            knots = np.arange(0.0, times[-1] + 1.0, generator.uniform(0.05, 1.0))
            inputs[:, axis] = np.interp(times, knots, generator.normal(size=len(knots)))
        elif wild and generator.random() < 0.5:
            inputs[:, axis] = generator.normal(size=n)
    return inputs[:, :3] * size[:3], inputs[:, 3:] * size[3:]


def exceeded(platform: StewartPlatform, motion: Motion) -> int:
    """Return the number of samples that exceed any limit of the hexapod."""
    limits = PoseLimits(platform.parameters)
    results = platform.solve(motion.rows)
    values = limits.values(motion.rows, results)
    found = limits.exceeded(values, len(results))
    for name, each in (('limits.velocity_max', RATES), ('limits.force_max', FORCES)):
        if name in limits.limits.bounds:
            found |= limits.limits.exceeds(name, results[:, each]).any(axis=1)
    found |= ~np.isfinite(results).all(axis=1)
    found |= results[:, CONDITION] >= limits.stop_condition
    found |= results[:, DETERMINANT] * results[0, DETERMINANT] <= 0.0
    if platform.parameters.drives:
        motors = Drives(platform.parameters)(motion.rows, results)
        for values_of, bounds in MotorLimits(platform.parameters).excesses(
                motors, np.zeros((len(results), 6))).values():
            found |= (np.abs(values_of) > bounds * (1.0 + 1e-9)).any(axis=1)
    return int(found.sum())


class Bare:
    """A node that publishes the last reading at the rate, and computes nothing."""

    def __init__(self) -> None:
        from geometry_msgs.msg import AccelStamped, PoseStamped, TwistStamped
        from rclpy.clock import Clock, ClockType
        from rclpy.node import Node
        from rclpy.qos import QoSProfile
        from sensor_msgs.msg import Imu
        self.node = Node('bare')
        qos = QoSProfile(depth=1000)
        self._messages = PoseStamped(), TwistStamped(), AccelStamped()
        self._publishers = [
            self.node.create_publisher(type(message), f'/of_bare/setpoint/{name}', qos)
            for name, message in zip(('pose', 'twist', 'accel'), self._messages, strict=True)]
        self.node.create_subscription(Imu, '/bare/vehicle', self._on_vehicle, qos)
        self.node.create_timer(
            1.0 / RATE, self._on_time, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _on_vehicle(self, message: Any) -> None:
        self._messages[2].accel.linear = message.linear_acceleration

    def _on_time(self) -> None:
        stamp = self.node.get_clock().now().to_msg()
        for publisher, message in zip(self._publishers, self._messages, strict=True):
            message.header.stamp = stamp
            publisher.publish(message)


class Drive:
    """The vehicle, and the accelerations in the setpoints of both nodes."""

    def __init__(self) -> None:
        import rclpy
        from geometry_msgs.msg import AccelStamped
        from rclpy.qos import QoSProfile
        from rclpy.serialization import deserialize_message
        from sensor_msgs.msg import Imu
        self.node = rclpy.create_node('drive')
        qos = QoSProfile(depth=1000)
        self.heard: dict[str, list[tuple[int, float]]] = {name: [] for name in NODES}

        def listen(name: str) -> Any:
            def note(data: bytes) -> None:
                now = time.monotonic_ns()
                accel = deserialize_message(data, AccelStamped).accel.linear.x
                self.heard[name].append((now, accel))
            return note

        self._publishers = {}
        for name in NODES:
            self.node.create_subscription(
                AccelStamped, f'/of_{name}/setpoint/accel', listen(name), qos, raw=True)
            self._publishers[name] = self.node.create_publisher(Imu, f'/{name}/vehicle', qos)
        self._message = Imu()
        self._message.linear_acceleration.z = GRAVITY

    def ready(self) -> bool:
        """Return whether both nodes are there and publish."""
        return all(self.heard.values()) and all(
            each.get_subscription_count() for each in self._publishers.values())

    def turn(self, name: str, seconds: float, spin: Any) -> Array:
        """Drive with one of the nodes and return the latencies of its steps [us]."""
        self.heard[name].clear()
        steps: list[int] = []
        begin = due = time.monotonic()
        n = 0
        while due < begin + seconds:
            # At any time within the period of the setpoints, whatever that of the messages is.
            due = begin + n / VEHICLE_RATE + random.random() / RATE
            while (left := due - time.monotonic()) > 0.0:
                spin(left)
            step = n % STEP_EVERY == 0
            if step:
                self._message.linear_acceleration.x = (
                    -0.5 * STEP if self._message.linear_acceleration.x > 0.0 else 0.5 * STEP)
            self._message.header.stamp = self.node.get_clock().now().to_msg()
            if step and due > begin + FADE:
                steps.append(time.monotonic_ns())
            self._publishers[name].publish(self._message)
            n += 1
        end = time.monotonic() + 0.1
        while time.monotonic() < end:
            spin(0.01)
        times, values = (np.array(each) for each in zip(*self.heard[name], strict=True))
        jumps = np.append(times[1:][np.abs(np.diff(values)) > 0.2 * STEP], np.iinfo(np.int64).max)
        arrived = jumps[np.searchsorted(jumps, steps)]
        # Where the computer is so late that a step and the next one are in one setpoint: neither.
        known = arrived < np.append(steps[1:], steps[-1] + 10 ** 9)
        if known.mean() < 0.8:
            raise SystemExit(f'{name}: {(~known).sum()} of {len(steps)} steps did not arrive')
        latencies: Array = (arrived - np.array(steps))[known] * 1e-3
        return latencies


@contextmanager
def running() -> Iterator[None]:
    """Run both nodes."""
    commands = {
        'stewart_cueing': [
            str(executable('stewart_cueing')), '--ros-args', '--params-file',
            'config/platform.yaml', '-p', 'target:=/of_stewart_cueing', '-p',
            f'cueing.rate:={RATE}', '-p', 'start_timeout:=0.1'],
        'bare': [sys.executable, __file__, '--bare']}
    processes = [subprocess.Popen(command) for command in commands.values()]
    try:
        yield
    finally:
        for process in processes:
            process.send_signal(signal.SIGINT)
        for process in processes:
            process.wait(30)


def latency(rounds: int, seconds: float) -> list[str]:
    """Return the table of the latencies."""
    import rclpy
    from rclpy.experimental.events_executor import EventsExecutor
    os.environ.update(ROS_DOMAIN_ID=DOMAIN, ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST')
    rclpy.init(args=[])
    drive = Drive()
    executor = EventsExecutor()
    executor.add_node(drive.node)

    def spin(timeout: float) -> None:
        executor.spin_once(timeout_sec=timeout)

    turns: dict[str, list[Array]] = {name: [] for name in NODES}
    with running():
        while not drive.ready():
            spin(0.1)
        for n in range(rounds):
            for name in sorted(NODES, reverse=n % 2 == 0):
                turns[name].append(drive.turn(name, FADE + seconds, spin))
    executor.shutdown()
    rclpy.try_shutdown()
    cells: list[tuple[str, ...]] = [(
        'latency (ms)', 'p50', 'p99', 'max', 'p50, times bare', 'p99, times bare')]
    for name, title in NODES.items():
        ratios = np.median([
            np.percentile(ours, (50, 99)) / np.percentile(bare, (50, 99))
            for ours, bare in zip(turns[name], turns['bare'], strict=True)], axis=0)
        values = np.percentile(np.concatenate(turns[name]), (50, 99, 100)) * 1e-3
        cells.append((title, *(f'{each:.2f}' for each in values),
                      *(f'{each:.2f}' for each in ratios)))
    return ['', *markdown(cells), '', f'{processor_name()}, {len(os.sched_getaffinity(0))} cores. '
            f'{rounds} turns of {seconds:g} s each, {sum(map(len, turns["bare"]))} steps.', '']


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--params', default='config/platform.yaml')
    parser.add_argument('--seconds', type=float, default=10_000.0, help='of random motions')
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--latency', action='store_true', help='of the node')
    parser.add_argument('--rounds', type=int, default=6, help='turns of each node')
    parser.add_argument('--turn', type=float, default=10.0, help='duration of a turn [s]')
    parser.add_argument('--write', action='store_true', help='put the latency into results/')
    parser.add_argument('--bare', action='store_true', help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.bare:
        import rclpy
        from pass_through import spin
        rclpy.init(args=[])
        spin(Bare().node)
        return
    if options.latency:
        lines = latency(options.rounds, options.turn)
        print('\n'.join(lines))
        if options.write:
            write(lines, BEGIN, END)
        return
    parameters = Parameters.from_yaml(options.params)
    cueing = MotionCueing(parameters.replaced({'cueing.input': 'acceleration'}))
    platform = StewartPlatform(parameters)
    times = np.arange(1_000_000) / RATE
    force = np.sin(times[:, None] * [1.0, 0.7, 3.0])
    begun = time.process_time()
    cueing.run(times, force, 0.2 * force)
    print(f'10^6 samples, governed: {time.process_time() - begun:.2f} s')
    generator = np.random.default_rng(options.seed)
    samples, wrong, held, begun = 0, 0, 0.0, time.process_time()
    steps = np.zeros(2)
    while samples < options.seconds * RATE:
        times = np.arange(PIECE * RATE) / RATE
        stream = cueing.stream()
        motion = stream.advance(times, *vehicle(generator, times, samples // len(times) % 2 == 0))
        samples += len(times)
        wrong += exceeded(platform, motion)
        held += sum(stream.held.values())
        steps = np.maximum(steps, [
            np.abs(np.diff(motion.position, axis=0)).max(),
            np.abs(np.diff(motion.linear_velocity, axis=0)).max()])
    print(f'{samples / RATE:.0f} s of random motions, seed {options.seed}: {wrong} of {samples} '
          f'samples exceed a limit; held back {held / (samples / RATE):.1%}; largest step '
          f'{steps[0] * 1e3:.2f} mm, {steps[1]:.3f} m/s; '
          f'{(time.process_time() - begun) / samples * 1e6:.1f} us a sample')


if __name__ == '__main__':
    main()
