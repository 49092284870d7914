# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The node: the motion of a vehicle in, setpoints of the platform out, at a rate of its own."""

from __future__ import annotations

import math
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
from rclpy.clock import Clock, ClockType, JumpHandle, JumpThreshold, ROSClock
from rclpy.duration import Duration
from rclpy.qos import QoSProfile
from rclpy.time import Time
from sensor_msgs.msg import Imu, JointState

from stewart_dynamics.arrays import Array, SECOND
from stewart_dynamics.cueing.cueing_parameters import CueingParameters
from stewart_dynamics.cueing.motion_cueing import CueingStream, MotionCueing
from stewart_dynamics.cueing.vehicle import Vehicle
from stewart_dynamics.errors import StewartError
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.mechanics.frames.rotation import quaternion_of
from stewart_dynamics.mechanics.limits import short_name
from stewart_dynamics.mechanics.rows import MOTION, ROTATION, TWIST
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.messages.joint_state import JointStateReader
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.messages.setpoint import ImuWriter
from stewart_dynamics.node.diagnostics.levels import ERROR, LogLine, OK, Status, WARN
from stewart_dynamics.node.publishers_at_rate import diagnostic_array
from stewart_dynamics.planned.approach import approach
from stewart_dynamics.ros.due_periods import BACKLOG, DuePeriods
from stewart_dynamics.ros.managed_node import ManagedNode
from stewart_dynamics.ros.run import run
from stewart_dynamics.ros.setpoint_publisher import SetpointPublisher
from stewart_dynamics.setpoints.input_messages import VEHICLE
from stewart_dynamics.setpoints.rejections import MALFORMED, Rejection, Rejections

FELT, DIAGNOSTICS, MEASURED_LEGS = 'felt', '/diagnostics', 'measured_legs'
_TICK = 0.2  # between two looks at the input [s]
_TICKS_A_REPORT = 5
_FADE = 1.0  # in which the motion of the vehicle fades in, or out [s]
_JUMP = 1_000_000_000  # longest step of /clock, which may be coarse, that is caught up [ns]
_LATE = 'late: fell behind by {:.3f} s: that time is skipped'
_JUMPED = '/clock jumped by {:.3f} s: the motion goes on from there'
_REST = 1e-4  # velocity of a platform at rest [m/s, rad/s]
_LONGEST_STOP = 5.0  # [s]
_AWAY = 1e-3  # drives this near to their positions at home need no approach [m, rad]


class CueingNode(ManagedNode[CueingParameters]):
    """
    Moves the platform as the motion of the vehicle demands, within its limits.

    Time is that of a steady clock, or with ``use_sim_time`` that of /clock: setpoints are due by
    it and published as soon as it comes; while it stands still, nothing moves.

    Raises ParameterError if the parameters break a rule: then nothing starts.
    """

    def __init__(self) -> None:
        super().__init__(CueingParameters)
        self._rejections = Rejections(self._on_rejection)
        self._ours: list[Any] = []  # publishers, subscriptions and timers while configured
        self._last: Array | None = None  # the last setpoint
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.start()

    # -- lifecycle --------------------------------------------------------------------------

    def begin_work(self) -> None:
        """Begin with the approach to the home pose."""
        self._vehicle = Vehicle(self._settings, self._rejections, self._on_notice)
        self._stream: CueingStream | None = None
        self._approach: Array = np.empty((0, MOTION))
        self._presence = 0.0  # of the vehicle's motion, from 0 to 1
        self._held: dict[str, float] = {}
        self._no_approach = ''  # the reason, where it does not start because of it
        # Whether an approach was not found since the last tick: looking for it takes longer than
        # the period of fast legs.
        self._tried = False
        self._ticks = 0
        self._due = 0  # index of the next setpoint, from the begin
        self._periods = DuePeriods(
            self._settings.cueing.rate, self._on_notice, now=lambda: self._now)
        self._reported = 0  # index of the next setpoint at the last report
        self._activated = time.monotonic()
        if self._last is not None:
            self._start_from(Motion.of_rows(self._last))

    def open_topics(self) -> None:
        """Make the filters and open the topics."""
        p = self._settings
        self._cueing = MotionCueing(p)
        self._setpoints = SetpointPublisher(self, p.target, p.output, p.base_frame)
        qos = QoSProfile(depth=1000)
        self._felt = self.create_publisher(Imu, f'~/{FELT}', qos)
        self._felt_writer = ImuWriter(p.platform_frame, 0.0, 0.0)
        self._diagnostics = self.create_publisher(DiagnosticArray, DIAGNOSTICS, qos)
        self._legs = JointStateReader(p.joints, ('position',))
        self._ours = [
            (self.destroy_subscription, self.create_subscription(
                Imu, f'~/{VEHICLE}', self._on_vehicle, qos, raw=True)),
            (self.destroy_subscription, self.create_subscription(
                JointState, f'~/{MEASURED_LEGS}', self._on_legs, qos, raw=True)),
            (self.destroy_timer, self.create_timer(
                1.0 / p.cueing.rate, self._on_time, clock=self._steady)),
            (self.destroy_timer, self.create_timer(_TICK, self._on_tick, clock=self._steady)),
            (JumpHandle.unregister, self.get_clock().create_jump_callback(
                JumpThreshold(min_forward=Duration(nanoseconds=1),
                              min_backward=Duration(nanoseconds=-1), on_clock_change=False),
                post_callback=lambda jump: self._on_time())),
            *((self.destroy_publisher, each) for each in (
                self._felt, self._diagnostics, *self._setpoints.publishers))]
        self.get_logger().info(
            f'motion cueing at {p.cueing.rate:g} Hz to {p.target}, '
            + ('within the limits of the hexapod' if p.cueing.govern else 'not governed'))

    def close_topics(self) -> None:
        for destroy, each in self._ours:
            destroy(each)
        self._ours = []

    # -- inputs -----------------------------------------------------------------------------

    def _on_vehicle(self, data: bytes) -> None:
        if self._active:
            self._vehicle.use_message(data, self._now / SECOND)

    def _on_legs(self, data: bytes) -> None:
        """Start the approach from where the platform stands."""
        if not self._active or self._periods.begun or self._tried or not self._now:
            return
        platform = StewartPlatform(self._settings)
        try:
            states = self._legs.read_states(Messages.single(MEASURED_LEGS, data))
            if not len(states.stamps):
                if states.rejected:  # else a part: the others follow
                    self._rejections.reject(MEASURED_LEGS, *states.last)
                return
            positions = states.values[-1] + self._settings.geometry.zero_length
            away = np.abs(positions - platform.inverse_kinematics(self._cueing.governor.home))
            pose = (self._cueing.governor.home if away.max() < _AWAY
                    else platform.forward_kinematics(positions))
        except StewartError as exc:
            self._rejections.reject(MEASURED_LEGS, MALFORMED, str(exc))
            return
        self._start_from(Motion.from_pose(pose))

    def _start_from(self, pose: Motion) -> None:
        """Begin with the approach from a pose to home."""
        p, home = self._settings, self._cueing.governor.home
        try:
            found = approach(StewartPlatform(p), pose, home, rate=p.cueing.rate)
        except StewartError as exc:
            # It does not start at home either: the platform is known to be elsewhere.
            self._no_approach, self._tried = f'no approach to the home pose: {exc}', True
            self._log.write([LogLine(ERROR, self._no_approach, 'approach')])
            return
        self._no_approach, self._approach = '', found.motion.rows
        self.get_logger().info(f'approach to the home pose: {found.times[-1]:.3g} s')
        self._go()

    def _go(self) -> None:
        self._periods.begin(self.get_clock().now().nanoseconds)
        self._due = self._reported = 0
        self._stream = self._cueing.stream()

    # -- setpoints --------------------------------------------------------------------------

    @property
    def _simulated(self) -> bool:
        """Whether time is that of /clock."""
        clock = self.get_clock()
        return isinstance(clock, ROSClock) and clock.ros_time_is_active

    @property
    def _now(self) -> int:
        """Time of the clock by which setpoints are due [ns]; 0 before the first /clock."""
        return self.get_clock().now().nanoseconds if self._simulated else time.monotonic_ns()

    def _on_time(self) -> None:
        """Publish the setpoints that are due, each with its own stamp."""
        if not self._active:
            return
        backlog, words = (_JUMP, _JUMPED) if self._simulated else (BACKLOG, _LATE)
        for _ in self._periods.due(self._due, backlog, _JUMP, words):
            self._publish_next()

    def _publish_next(self) -> None:
        at, stream = self._due, self._stream
        assert stream is not None  # made before the first setpoint
        stamp = self._periods.stamp_of(at)
        if at < len(self._approach):
            self._last = self._approach[at]
            felt = np.concatenate(self._cueing.felt(Motion.of_rows(self._last))).tolist()
        else:
            self._advance(stream)
            self._last = stream.row
            felt = stream.felt.tolist()
        numbers = self._last.tolist()
        self._setpoints.publish(
            [numbers[:3], list(quaternion_of(numbers[ROTATION])), numbers[12:15], numbers[15:18],
             numbers[18:21], numbers[21:24]], Time(nanoseconds=stamp).to_msg())
        self._felt.publish(self._felt_writer.write(stamp, felt[3:], felt[:3]))
        self._due += 1

    def _advance(self, stream: CueingStream) -> None:
        """Advance the cueing to the next setpoint."""
        vehicle, gravity = self._vehicle, float(self._cueing.at_rest[2])
        heard = (vehicle.reading is not None and not vehicle.possible_error
                 and vehicle.silent(self._now / SECOND) < self._settings.vehicle_timeout)
        change = 1.0 / (_FADE * self._settings.cueing.rate)
        share = min(max(self._presence + (change if heard else -change), 0.0), 1.0)
        self._presence = share
        x, y, z, *rates = vehicle.reading or (0.0, 0.0, gravity, 0.0, 0.0, 0.0)
        stream.advance_by_one(1e-9 * self._periods.time_of(self._due), (
            share * x, share * y, gravity + share * (z - gravity), *(share * w for w in rates)))

    def end_work(self) -> None:
        """Bring the platform to rest within its limits, an approach to its end."""
        if self._stream is None:
            return
        self._stream.stop()
        # In real time, also with use_sim_time: /clock is not heard meanwhile.
        begin = time.monotonic_ns() - self._periods.time_of(self._due)
        end = time.monotonic() + _LONGEST_STOP
        while time.monotonic() < end and self._last is not None and (
                self._due < len(self._approach) or np.abs(self._last[TWIST]).max() > _REST):
            wait = self._periods.time_of(self._due) - (time.monotonic_ns() - begin)
            time.sleep(max(wait, 0) / SECOND)
            self._publish_next()

    # -- diagnostics ------------------------------------------------------------------------

    def _on_tick(self) -> None:
        now = time.monotonic()
        self._tried = False
        self._log.write_last(now)
        if not self._active:
            return
        before = self._vehicle.possible_error
        self._vehicle.check(self._now / SECOND)
        if (error := self._vehicle.possible_error) and error != before:
            self._log.write([LogLine(WARN, f'vehicle: {error}', 'possible error')])
        if not (self._periods.begun or self._no_approach) and (
                now - self._activated > self._settings.start_timeout):
            if self._now:
                self.get_logger().warning('no ~/measured_legs: starts at the home pose')
                self._go()
            else:
                self.get_logger().warning('waiting for /clock', once=True)
        self._ticks += 1
        if self._ticks % _TICKS_A_REPORT == 0:
            self._diagnostics.publish(diagnostic_array(self, [self._status()]))

    def _status(self) -> Status:
        level, message = OK, 'follows the vehicle'
        held: dict[str, float] = {}
        shares: dict[str, float] = {}
        if self._stream is not None:
            total = self._stream.held
            held = {name: value - self._held.get(name, 0.0) for name, value in total.items()}
            self._held, shares = total, self._stream.shares
        period = (self._due - self._reported or 1) / self._settings.cueing.rate
        self._reported = self._due
        silent = self._vehicle.silent(self._now / SECOND)
        worst = max(held, key=held.__getitem__, default='')
        if self._no_approach:
            level, message = ERROR, self._no_approach
        elif not self._periods.begun:
            level, message = WARN, f'waits for {"~/measured_legs" if self._now else "/clock"}'
        elif self._due < len(self._approach):
            message = 'approaches the home pose'
        elif self._vehicle.possible_error:
            level, message = ERROR, f'vehicle: {self._vehicle.possible_error}'
        elif silent > self._settings.vehicle_timeout:
            level, message = WARN, 'no ~/vehicle: ' + (
                'never heard' if math.isinf(silent)
                else f'for {silent:.1f} s') + ': washes out to rest'
        elif worst and held[worst] > 0.0:
            level, message = WARN, (f'{worst} holds the demand back by '
                                    f'{100.0 * held[worst] / period:.0f} %')
        return Status('cueing', level, message, [
            ('vehicle rate (Hz)', f'{self._vehicle.rate:.1f}'),
            ('demand given (%)', f'{100.0 * (1.0 - sum(held.values()) / period):.1f}'),
            *((f'{axis}: demand given (%)', f'{100.0 * share:.1f}')
              for axis, share in shares.items()),
            *((f'held back by {short_name(name)} (%)', f'{100.0 * value / period:.1f}')
              for name, value in held.items() if value > 0.0),
            *((str(each.words('')), str(count)) for each, count in
              self._rejections.counts.items())])

    def _on_rejection(self, rejection: Rejection, details: str) -> None:
        self._log.write([LogLine(WARN, rejection.words(details), rejection)])

    def _on_notice(self, text: str) -> None:
        self._log.write([LogLine(WARN, text, text[:8])])

    # -- parameters -------------------------------------------------------------------------

    def use_parameters(self, parameters: CueingParameters) -> None:
        """Use changed parameters, blended into the motion."""
        cueing = MotionCueing(parameters)
        if self._active:
            if self._stream is not None:
                self._stream.use(cueing)
            self._vehicle.kind = parameters.cueing.input
        self._cueing = cueing


def main() -> int:
    """Run the node; exit code 0, or 1 where its parameters break a rule."""
    return run(CueingNode, CueingParameters)
