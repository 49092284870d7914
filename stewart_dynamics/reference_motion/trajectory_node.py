# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Publishes a motion as setpoints, in real time or in that of a simulation."""

from __future__ import annotations

import time
from typing import Any

from rclpy.clock import Clock, ClockType, JumpThreshold
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.task import Future
from rclpy.time import Time
from stewart_dynamics.arrays import NANOSECOND, SECOND
from stewart_dynamics.mechanics.frames.rotation import to_quaternion
from stewart_dynamics.mechanics.rows import MOTION
from stewart_dynamics.reference_motion.motion_functions import motion_at, sample_count, sample_time
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.ros.declared_parameters import declare_parameters, MADE_WITH
from stewart_dynamics.ros.late_subscribers import is_simulated
from stewart_dynamics.ros.run import run
from stewart_dynamics.ros.setpoint_publisher import SetpointPublisher

# Number of samples computed at once: one by one they cost more than publishing.
_BLOCK = 256

_SETTLE = 500_000_000  # [ns]
_PATIENCE = 2 * SECOND  # after which a wait is logged [ns]
_AGAIN = 5.0  # interval of these lines [s]


class TrajectoryNode(Node):
    """
    Publishes the motion's samples when they are due, then holds the final pose or is done.

    With ``use_sim_time`` they are due by /clock and published as soon as it comes: a simulation
    may run as fast or as slowly as it can, or wait for the answers to it. The motion begins once
    there is a clock and all topics have subscribers, however long that takes.

    done: gets the exit code after the last sample.

    Raises ParameterError where the parameters break a rule.
    """

    def __init__(self, done: Future) -> None:
        super().__init__(ReferenceMotionParameters.node, **MADE_WITH)
        self._settings = declare_parameters(self, ReferenceMotionParameters)
        self._done = done
        self._loop = self._settings.loop
        self._samples = sample_count(self._settings)
        self._index = 0
        self._block: Any = None
        self._held: list[list[float]] | None = None
        self._row()  # an error in it is raised before anything moves
        target = self._settings.target
        self._setpoints = SetpointPublisher(
            self, target, self._settings.output, self._settings.base_frame)
        self._begun = self._subscribed = False
        self._made = time.monotonic_ns()
        self._start = self._made + round(self._settings.start_timeout * SECOND)
        self._timer = self.create_timer(
            1.0 / self._settings.rate, self._on_timer,
            clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._simulated = is_simulated(self)
        if self._simulated:
            self._jumps = self.get_clock().create_jump_callback(
                JumpThreshold(min_forward=Duration(nanoseconds=1),
                              min_backward=Duration(nanoseconds=-1), on_clock_change=False),
                post_callback=self._on_clock)
        motion, rate = self._settings.motion.type, self._settings.rate
        self.get_logger().info(
            f'{motion} motion at {rate:g} Hz to {target}' + (
                ', until stopped' if self._loop else f', {self._samples} setpoints'))

    def _on_timer(self) -> None:
        """Begin, and go on in real time."""
        now = time.monotonic_ns() - self._start
        if self._begun:
            self._publish_due(now)
            return
        self._wait(now)
        if self._begun and self._simulated:
            self._timer.cancel()
            self._publish_due(0)  # the clock may wait for the answer

    def _on_clock(self, jump: Any) -> None:
        """Go on in simulated time."""
        if not self._begun:
            return
        now = self.get_clock().now().nanoseconds - self._stamp
        # A simulation that starts anew begins where the motion began.
        if now < 0 or (now == 0 and jump.delta.nanoseconds < 0):
            self.get_logger().warning('/clock is back at the start of the motion: it restarts')
            self._stamp += now
            self._index = now = 0
            self._held = None
        self._publish_due(now)

    def _publish_due(self, now: int) -> None:
        """Publish the samples that are due, each with its own stamp, however late it is [ns]."""
        if self._held:  # of these the last one is enough
            self._index = max(self._index, int(now * NANOSECOND * self._settings.rate))
        while not self._done.done():
            due = int(sample_time(self._settings, self._index))
            if due > now:
                return
            row = self._row()
            self._setpoints.publish(row, Time(nanoseconds=self._stamp + due).to_msg())
            self._index += 1
            if not self._loop and self._index == self._samples:
                self._end(*row[:2])

    def _end(self, position: list[float], quaternion: list[float]) -> None:
        """Hold the pose of the last sample, or end."""
        log = self.get_logger()
        if self._settings.motion.hold_at_end:
            self._held = [position, quaternion, *[[0.0] * 3] * 4]
            log.info(f'{self._samples} setpoints published; holds the final pose until stopped')
        else:
            log.info(f'{self._samples} setpoints published')
            self._done.set_result(0)

    def _wait(self, now: int) -> None:
        """Begin when it is time, which comes sooner once all topics have subscribers."""
        missing = ', '.join(publisher.topic_name for publisher in self._setpoints.publishers
                            if not publisher.get_subscription_count())
        if not self._subscribed and not missing:
            self._subscribed = True
            # A subscriber may discover the publisher later than the publisher discovers it.
            if now < -_SETTLE:
                self._start += now + _SETTLE
                now = -_SETTLE
        stamp = self.get_clock().now().nanoseconds
        if self._simulated and not self._subscribed:  # the clock would wait for their answers
            self._log_waiting(f'a subscriber of {missing}')
        elif now >= 0 and not stamp:  # simulated time stands at zero until there is a clock
            self._log_waiting('/clock')
        elif now >= 0:
            self._begun = True
            if not self._subscribed:
                self.get_logger().warning(
                    f'begun, but not every topic has a subscriber: {missing}')
            self._start += now
            self._stamp = stamp

    def _log_waiting(self, what: str) -> None:
        if time.monotonic_ns() - self._made > _PATIENCE:
            self.get_logger().warning(f'waiting for {what}', throttle_duration_sec=_AGAIN)

    def _row(self) -> list[list[float]]:
        """Return position, quaternion and the four rates of the sample that is due."""
        if self._held:
            return self._held
        at = self._index % _BLOCK
        if at == 0:
            times = NANOSECOND * sample_time(
                self._settings, range(self._index, self._index + _BLOCK))
            motion = motion_at(self._settings, times)
            quaternions = to_quaternion(motion.rotation)
            self._block = [
                [row[0:3], quaternion, row[12:15], row[15:18], row[18:21], row[21:MOTION]]
                for row, quaternion in zip(
                    motion.rows.tolist(), quaternions.tolist(), strict=True)]
        row: list[list[float]] = self._block[at]
        return row


def main() -> int:
    """Run the node; exit code 0, or 1 where its parameters break a rule."""
    done: Future = Future()
    return run(lambda: TrajectoryNode(done), ReferenceMotionParameters, done)
