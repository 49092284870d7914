# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The node of motion cueing, over real topics."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import AccelStamped, PoseStamped, TwistStamped
import numpy as np
import pytest
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter as RosParameter
from rclpy.serialization import deserialize_message
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from running import Inside, nanoseconds, Peer, PLATFORM
from sensor_msgs.msg import Imu, JointState
from stewart_dynamics import Parameters, Pose
from stewart_dynamics.arrays import Array
from stewart_dynamics.cueing.cueing_node import CueingNode
from stewart_dynamics.cueing.motion_cueing import GRAVITY, MotionCueing
from stewart_dynamics.mechanics.kinematics.home_pose import home_pose
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform

PARAMETERS = Parameters.from_yaml(PLATFORM)
HOME = home_pose(PARAMETERS)
RATE = 100.0
KINDS = {'pose': PoseStamped, 'twist': TwistStamped, 'accel': AccelStamped}
NODE = '/stewart_cueing'
# The head returns to its place in a fifth of the time.
QUICK = 'start_timeout:=0.1', 'cueing.translation.washout_frequency:=[1.25, 2.0, 2.0]'


class Cueing:
    """The node in this process, a vehicle and a listener."""

    def __init__(self, domain: int, *overrides: str, file: Any = PLATFORM) -> None:
        self.peer = Peer(domain)
        self.raw = {name: self.peer.listen(f'/stewart_dynamics/setpoint/{name}', kind)
                    for name, kind in KINDS.items()}
        self.felt = self.peer.listen(f'{NODE}/felt', Imu)
        self.diagnostics = self.peer.listen('/diagnostics', DiagnosticArray)
        self.vehicle = self.peer.writer(f'{NODE}/vehicle', Imu)
        self.legs = self.peer.writer(f'{NODE}/measured_legs', JointState)
        self.clock = self.peer.writer('/clock', Clock)
        self.stamp = 1_000_000_000
        self._decoded, self._last = 0, np.full(9, np.inf)
        nodes: list[CueingNode] = []
        self.program: Any = Inside(lambda: nodes.append(CueingNode()) or nodes[0], [
            '--ros-args', '--params-file', str(file), '-p', f'cueing.rate:={RATE}',
            *(part for each in overrides for part in ('-p', each))], domain)
        self.node = nodes[0]

    def close(self) -> None:
        self.program.kill()
        self.peer.close()

    def send(self, force: Any = (0.0, 0.0, GRAVITY), rates: Any = (0.0, 0.0, 0.0),
             step: int = 10_000_000) -> None:
        """Publish a reading of the vehicle."""
        self.stamp += step
        message = Imu()
        message.header.stamp = Time(nanoseconds=self.stamp).to_msg()
        message.linear_acceleration.x, message.linear_acceleration.y, \
            message.linear_acceleration.z = map(float, force)
        message.angular_velocity.x, message.angular_velocity.y, \
            message.angular_velocity.z = map(float, rates)
        self.vehicle.publish(message)

    def tick(self, now: int, count: int) -> None:
        """Publish a time on /clock [ns], and wait until a number of setpoints has come."""
        message = Clock(clock=Time(nanoseconds=now).to_msg())
        self.peer.until(lambda: self.clock.publish(message) or len(self.raw['accel']) >= count,
                        f'{count} setpoints at {now}')

    def row(self, n: int) -> tuple[int, list[float]]:
        """Return stamp [ns], and position, velocity and acceleration of a setpoint (9,)."""
        pose, twist, accel = (deserialize_message(self.raw[name][n], kind)
                              for name, kind in KINDS.items())
        return nanoseconds(pose.header.stamp), [getattr(three, c) for three in (
            pose.pose.position, twist.twist.linear, accel.accel.linear) for c in 'xyz']

    def rows(self) -> tuple[Array, Array]:
        """Return stamps (N,) [ns], and position, velocity and acceleration (N, 9)."""
        stamps, rows = zip(*map(self.row, range(self.complete)), strict=True)
        return np.array(stamps), np.array(rows)

    @property
    def complete(self) -> int:
        """Return the number of setpoints of which all topics have come."""
        return min(map(len, self.raw.values()))

    @property
    def last(self) -> Array:
        """Return the last row; far away without one."""
        if self.complete != self._decoded:
            self._decoded = self.complete
            self._last = np.array(self.row(self.complete - 1)[1])
        return self._last

    def until(self, condition: Any, text: str, force: Any = None) -> None:
        """Wait for a condition, sending the vehicle's motion meanwhile, one for a setpoint."""
        sent_at = -1

        def met() -> bool:
            nonlocal sent_at
            if force is not None and self.complete != sent_at:
                sent_at = self.complete
                self.send(force)
            return bool(condition())

        self.peer.until(met, text)

    @property
    def status(self) -> Any:
        """Return the last status."""
        return deserialize_message(self.diagnostics[-1], DiagnosticArray).status[0]


@pytest.fixture
def cueing(domain: int) -> Iterator[Any]:
    """Give a function that starts the node."""
    made = []

    def start(*overrides: str, **changes: Any) -> Cueing:
        made.append(Cueing(domain, *overrides, **changes))
        return made[-1]

    yield start
    for each in made:
        each.close()


def test_vehicle_moves_the_platform_and_silence_brings_it_home(cueing: Any) -> None:
    """Without legs it begins at home; each setpoint is the derivative of the one before."""
    node = cueing(*QUICK)
    push = (1.5, 0.0, GRAVITY)
    node.until(lambda: len(node.raw['accel']) > 10, 'setpoints come')
    node.until(lambda: node.last[0] > HOME.position[0] + 0.03, 'it moves', push)
    node.until(lambda: np.abs(node.last[:3] - HOME.position).max() < 1e-4
               and np.abs(node.last[3:]).max() < 1e-4, 'it is at rest at home')
    stamps, rows = node.rows()
    # More where the computer is so late that time is skipped.
    assert (np.diff(stamps) >= 1e9 / RATE - 1.0).all()
    step = 1.0 / RATE
    np.testing.assert_allclose(np.diff(rows[:, :3], axis=0),
                               step * 0.5 * (rows[1:, 3:6] + rows[:-1, 3:6]), atol=2e-5)
    assert np.abs(np.diff(rows[:, 6:9], axis=0)).max() < 0.1
    felt = [deserialize_message(data, Imu) for data in node.felt]
    assert max(each.linear_acceleration.x for each in felt) > 0.3
    node.until(lambda: 'no ~/vehicle: for' in node.status.message, 'silence is reported')


def test_begins_with_the_approach_from_the_measured_legs(cueing: Any) -> None:
    node = cueing()
    low = StewartPlatform(PARAMETERS)
    pose = HOME.position - [0.0, 0.0, 0.1]
    lengths = low.inverse_kinematics(type(HOME)(pose, HOME.rotation))
    legs = JointState(name=list(PARAMETERS['joints']),
                      position=(lengths - PARAMETERS['geometry.zero_length']).tolist())
    node.until(lambda: node.legs.publish(legs) or node.raw['accel'], 'setpoints come')
    node.until(lambda: abs(node.last[2] - HOME.position[2]) < 1e-9, 'it is at home')
    _, rows = node.rows()
    np.testing.assert_allclose(rows[0, :3], pose, atol=1e-9)
    assert np.abs(np.diff(rows[:, 2])).max() < 0.01
    np.testing.assert_allclose(rows[-1, 3:], 0.0, atol=1e-9)


def test_cranks_approach_home_from_their_measured_angles(cueing: Any) -> None:
    file = PLATFORM.with_name('crank_platform.yaml')
    p = Parameters.from_yaml(file)
    home, node = home_pose(p), cueing(file=file)
    pose = home.position - [0.0, 0.0, 0.05]
    angles = StewartPlatform(p).inverse_kinematics(Pose(pose, home.rotation))
    legs = JointState(name=list(p.joints), position=angles.tolist())
    node.until(lambda: node.legs.publish(legs) or node.raw['accel'], 'setpoints come')
    node.until(lambda: abs(node.last[2] - home.position[2]) < 1e-9, 'it is at home')
    _, rows = node.rows()
    np.testing.assert_allclose(rows[0, :3], pose, atol=1e-9)
    np.testing.assert_allclose(rows[-1, 3:], 0.0, atol=1e-9)


def test_it_does_not_start_without_an_approach(cueing: Any) -> None:
    """From a measured pose outside the limits: not from home either, where it is not."""
    node = cueing('start_timeout:=1.0', 'limits.length_min:=[0.95]')
    pose = HOME.position - [0.0, 0.0, 0.5]
    lengths = StewartPlatform(PARAMETERS).inverse_kinematics(type(HOME)(pose, HOME.rotation))
    legs = JointState(name=list(PARAMETERS['joints']),
                      position=(lengths - PARAMETERS['geometry.zero_length']).tolist())
    assert lengths.min() < 0.95
    node.until(lambda: node.legs.publish(legs) or node.diagnostics and (
        'no approach to the home pose: ' in node.status.message), 'it says so')
    reports = len(node.diagnostics)
    # Legs at 1 kHz do not keep it from its reports.
    node.until(lambda: [node.legs.publish(legs) for _ in range(50)] and (
        len(node.diagnostics) > reports + 1), 'time passes')
    assert not node.raw['accel']


def test_cranks_are_moved_within_their_limits(cueing: Any) -> None:
    """A push that they cannot follow: diagnostics name the limit that holds it back."""
    file = PLATFORM.with_name('crank_platform.yaml')
    p = Parameters.from_yaml(file)
    home = home_pose(p)
    node = cueing('start_timeout:=0.1', 'cueing.translation.gain:=[2.0, 2.0, 2.0]', file=file)
    values: dict[str, str] = {}

    def held_back() -> bool:
        values.update((pair.key, pair.value) for pair in (
            node.status.values if node.diagnostics else []))
        return 'held back by angle_max (%)' in values

    node.until(held_back, 'it is held back', (6.0, 0.0, GRAVITY))
    _, rows = node.rows()
    assert rows[:, 0].max() > home.position[0] + 0.1
    poses = [deserialize_message(data, PoseStamped).pose for data in node.raw['pose']]
    motion = Pose.from_quaternion(
        [[getattr(each.position, c) for c in 'xyz'] for each in poses],
        [[getattr(each.orientation, c) for c in 'xyzw'] for each in poses])
    angles = StewartPlatform(p).inverse_kinematics(motion)
    assert (angles <= p.limits.angle_max).all() and (angles >= p.limits.angle_min).all()
    assert (np.abs(np.diff(angles, axis=0)) * RATE <= p.limits.speed_max).all()
    assert not any('length' in key or 'force_max' in key for key in values)


def test_in_simulated_time_setpoints_are_due_by_the_clock(cueing: Any) -> None:
    """As with Gazebo or a bag that is played: stamps, rate and silence are those of /clock."""
    node = cueing('use_sim_time:=true', 'start_timeout:=0.1', 'vehicle_timeout:=0.5')
    node.until(lambda: node.diagnostics and 'waits for /clock' in node.status.message,
               'it waits')
    assert not node.raw['accel']
    second, period = 1_000_000_000, round(1e9 / RATE)
    node.tick(5 * second, 1)
    node.send((2.0, 0.0, GRAVITY))
    node.until(lambda: node.node._vehicle.reading, 'it has the vehicle')
    # However coarse the clock is, each setpoint has its own stamp; while it stands, none comes.
    node.tick(5 * second + 40 * period, 41)
    node.tick(5 * second + 40 * period, 41)
    reports = len(node.diagnostics)
    node.until(lambda: len(node.diagnostics) > reports + 1, 'time passes')
    assert len(node.raw['accel']) == 41
    assert node.status.message == 'follows the vehicle'  # it has not been silent for 0.5 s
    # It has: the motion fades out, after a jump of the clock, too.
    node.tick(6 * second, 101)
    node.until(lambda: 'no ~/vehicle: for 1.0 s' in node.status.message, 'it is silent')
    node.tick(2 * second, 102)
    node.tick(3 * second, 202)
    stamps, rows = node.rows()
    assert np.array_equal(stamps, np.concatenate([
        5 * second + period * np.arange(101), 2 * second + period * np.arange(101)]))
    assert 0.0 < rows[:41, 3].max() and np.abs(np.diff(rows[:, 6])).max() < 0.1
    # The jump is one of the stamps, not of the motion.
    np.testing.assert_allclose(np.diff(rows[:, 0]), 0.5 / RATE * (rows[1:, 3] + rows[:-1, 3]),
                               atol=2e-5)


def test_changed_parameters_blend_in_and_wrong_ones_are_rejected(cueing: Any) -> None:
    node = cueing('start_timeout:=0.1')
    push = (1.0, 0.0, GRAVITY)
    node.until(lambda: len(node.raw['accel']) > 150, 'it follows', push)
    before = len(node.raw['accel'])
    result = node.node.set_parameters_atomically([
        RosParameter('cueing.translation.gain', value=[0.9, 0.9, 0.9])])
    assert result.successful, result.reason
    rejected = node.node.set_parameters_atomically([
        RosParameter('cueing.tilt.damping', value=[0.1, 1.0])])
    assert 'cueing.tilt.damping: 0.1: must be at least 0.5' in rejected.reason
    fixed = node.node.set_parameters_atomically([RosParameter('cueing.rate', value=50.0)])
    assert 'cueing.rate: only changed while the node is unconfigured' in fixed.reason
    node.until(lambda: len(node.raw['accel']) > before + 100, 'it goes on', push)
    _, rows = node.rows()
    assert np.abs(np.diff(rows[before - 5:, 6:9], axis=0)).max() < 0.05


def test_deactivation_brings_the_platform_to_rest(cueing: Any) -> None:
    node = cueing('start_timeout:=0.1')
    node.until(lambda: 0.05 < np.abs(node.last[3:6]).max() < 9.0,
               'it moves', (2.0, 1.0, GRAVITY))
    node.program.run(node.node.trigger_deactivate)
    node.until(lambda: np.abs(node.last[3:6]).max() < 2e-4, 'it is at rest')


def test_the_whole_lifecycle(cueing: Any) -> None:
    """An unconfigured node takes another rate, and begins anew with it."""
    node = cueing('start_timeout:=0.1', 'autostart:=false')
    for change in (node.node.trigger_configure, node.node.trigger_activate):
        assert node.program.run(change) == TransitionCallbackReturn.SUCCESS
    node.until(lambda: len(node.raw['accel']) > 10, 'setpoints come')
    for change in (node.node.trigger_deactivate, node.node.trigger_cleanup):
        assert node.program.run(change) == TransitionCallbackReturn.SUCCESS
    node.until(lambda: not node.vehicle.get_subscription_count(), 'its topics are closed')
    assert node.node.set_parameters_atomically([
        RosParameter('cueing.rate', value=50.0)]).successful
    before = len(node.raw['accel'])
    for change in (node.node.trigger_configure, node.node.trigger_activate):
        assert node.program.run(change) == TransitionCallbackReturn.SUCCESS
    # Some from before may come late.
    node.until(lambda: len(node.raw['accel']) > before + 10
               and (np.diff(node.rows()[0][-9:]) == 20_000_000).all(), 'setpoints come again')
    assert node.program.run(node.node.trigger_shutdown) == TransitionCallbackReturn.SUCCESS


@pytest.mark.parametrize('force, text', [
    ((0.0, 0.0, 1.0), 'in g, must be in m/s^2'),
    *(pytest.param(force, text, marks=pytest.mark.slow) for force, text in (
        ((0.0, 0.0, -GRAVITY), 'gravity is along -z, must be along +z'),
        ((GRAVITY, 0.0, 0.0), 'gravity is along +x'),
        ((0.0, 0.0, 0.0), 'without gravity, set acceleration')))])
def test_possible_errors_are_named(cueing: Any, force: Any, text: str) -> None:
    """The platform stays at home meanwhile."""
    node = cueing(*QUICK)
    node.until(lambda: node.diagnostics and text in node.status.message,
               'the error is reported', force)
    at = len(node.raw['accel'])
    node.until(lambda: np.abs(node.last[:3] - HOME.position).max() < 1e-3
               and len(node.raw['accel']) > at + 50, 'it washes out', force)


def test_bad_messages_are_rejected_and_counted(cueing: Any) -> None:
    node = cueing('start_timeout:=0.1')
    node.until(lambda: node.diagnostics, 'it reports', (0.0, 0.0, GRAVITY))
    node.send((np.nan, 0.0, GRAVITY))
    node.send((0.0, 0.0, np.inf))
    node.send((2e4, 0.0, 0.0))
    node.send(step=-50_000_000)  # by less than setpoint.timeout
    wanted = {'vehicle rejected: not finite': '2', 'vehicle rejected: out of range': '1',
              'vehicle rejected: older than the last used': '1'}

    def counted() -> bool:
        values = {pair.key: pair.value for pair in node.status.values}
        return all(values.get(key) == value for key, value in wanted.items())

    node.until(counted, 'they are counted')
    _, rows = node.rows()
    assert np.isfinite(rows).all()
    np.testing.assert_allclose(rows[-1, :3], HOME.position, atol=1e-6)


def test_same_bits_as_the_library(cueing: Any) -> None:
    """At rest the node publishes the home pose of the library."""
    node = cueing('start_timeout:=0.1')
    node.until(lambda: len(node.raw['accel']) > 20, 'setpoints come')
    _, rows = node.rows()
    at_rest = MotionCueing(PLATFORM).run([0.0], [[0.0, 0.0, GRAVITY]])
    assert np.array_equal(rows[:, :3], np.tile(at_rest.position, (len(rows), 1)))
