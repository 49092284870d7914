# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Joins messages on the setpoint topics to setpoints, and counts rejected messages.

Node and replay pass the same bytes in the same order, so both reject and join alike: the node
one message at a time, the replay in batches. ``take`` handles one message; ``take_many`` handles a
batch, and calls ``take`` for each message if one of them is irregular. The wrench and the base's
motion have topics of their own: a setpoint gets the values that are valid when it is complete.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from stewart_dynamics.arrays import Six
from stewart_dynamics.mechanics.kinematics.pose_mistakes import pose_mistake
from stewart_dynamics.mechanics.rows import BASE, MOTION
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.parameters.table import Parameters, POSES_ALONE
from stewart_dynamics.setpoints.base_input import BaseInput
from stewart_dynamics.setpoints.consistency import Consistency, inconsistencies, Mistake
from stewart_dynamics.setpoints.inconsistency import QUANTITIES, RATES
from stewart_dynamics.setpoints.input_messages import (
    ACCEL, COMBINED, SOURCES, TopicSamples, TWIST, WRENCH, WrenchInput)
from stewart_dynamics.setpoints.rejections import Rejection, Rejections
from stewart_dynamics.setpoints.sample_joining import NO_SAMPLES, SampleJoining
from stewart_dynamics.setpoints.step import Batch, Setpoint

_STANDSTILL = (0.0,) * 6


class Setpoints:
    """
    Joins the samples of the setpoint topics by stamp.

    parameters: source of setpoints, frame, tolerance and timeout.
    rejected: called with each rejection and its details; they are counted as well.
    noticed: called with texts for the log: a restart, stamps that are all zero.
    """

    def __init__(
            self, parameters: Parameters, rejected: Callable[[Rejection, str], None],
            noticed: Callable[[str], object]) -> None:
        self.topics = SOURCES[parameters.setpoint.source]
        self._rejections = Rejections(rejected)
        self._wrench_input = WrenchInput(parameters, self._rejections)
        self.base = BaseInput(parameters, self._rejections, noticed)  # the motion of the base
        self._joining = SampleJoining(
            self.topics, parameters.base_frame, parameters.setpoint.sync_tolerance,
            parameters.setpoint.timeout, self._rejections, noticed)
        self._consistency = None if parameters.setpoint.source == POSES_ALONE else Consistency(
            parameters.singularity.characteristic_length,
            (parameters.base_frame, parameters.platform_frame))
        self._checks = [each for each in (self._consistency, self.base.consistency) if each]
        self._parameters = parameters
        # Rows of motion; empty before the first.
        self._first: Sequence[float] = ()
        self._last: Sequence[float] = ()
        self._topic_of = dict.fromkeys(QUANTITIES, COMBINED) if COMBINED in self.topics else (
            dict.fromkeys(QUANTITIES, TWIST) | dict.fromkeys(RATES, ACCEL))
        self.recorded: int | None = None
        """Time of recording [ns] of the message being processed by ``take_many``."""

    @property
    def counts(self) -> Counter[Rejection]:
        """Return the number of rejections so far, by topic and reason."""
        return self._rejections.counts

    @property
    def wrench(self) -> Six:
        """Return the known load on the platform, from the last ``~/wrench`` [N, N m]."""
        return self._wrench_input.wrench

    def mistakes(self, ever: bool = False) -> list[Mistake]:
        """
        Return the likely mistakes in setpoints and base motion.

        ever: all that were found; by default the present ones.
        """
        found = inconsistencies(self._consistency, ever, self._topic_of)
        # The last pose is judged only where twists differ.
        mistake = (self._pose_mistake('first', self._first) if ever
                   else self._pose_mistake('last', self._last) if found else [])
        if mistake:
            # Derivatives of wrong poses do not show the mistake in twists.
            found = inconsistencies(self._consistency, ever, self._topic_of, reasons=False)
        return mistake + found + self.base.mistakes(ever)

    def _pose_mistake(self, which: str, motion: Sequence[float]) -> list[Mistake]:
        """Return the likely mistake in the pose of a row of motion."""
        if not len(motion):
            return []
        text = pose_mistake(self._parameters, motion, first=motion is self._first)
        return [Mistake(self.topics[0], f'{which} setpoint: {text}')] if text else []

    def judge(self) -> None:
        """Check the samples noted by ``take``, if there are enough; called when there is time."""
        for consistency in self._checks:
            consistency.judge()

    def take_wrench(self, data: bytes) -> None:
        """Use this geometry_msgs/WrenchStamped for all later setpoints, if it is valid."""
        self._wrench_input.take(data)

    def take(self, topic: str, data: bytes, now: Callable[[], int]) -> Setpoint | None:
        """
        Return the setpoint that this message completes, if any; without the base's motion.

        now: the clock [ns]; read if the stamps of a setpoint are zero.
        """
        sample = self._joining.take(topic, data, now)
        if sample is None:
            return None
        stamp, values, restart, stamped = sample
        # Twist and acceleration are zero if only the pose is given.
        motion = values + _STANDSTILL + _STANDSTILL if len(values) == 12 else values
        self._first = self._first or motion
        self._last = motion
        if restart:
            self.base.restarted(stamp)
        if self._consistency is not None:
            self._consistency.noted.append((stamp, motion, restart))
        return Setpoint(stamp, motion, self.wrench, restart, stamped=stamped)

    def on_base(self, setpoint: Setpoint) -> Setpoint:
        """Return the setpoint with the base's motion at its stamp."""
        if not self.base.topics:
            return setpoint
        return setpoint._replace(base=self.base.at(setpoint.stamp))

    def take_many(self, messages: Messages) -> Batch:
        """Return the setpoints that these messages complete."""
        joined = self._take_ordinary(messages)
        if joined is not None:
            return joined
        self._wrench_input.reader.forget_layout()
        self._joining.forget_layouts()
        self.base.joining.forget_layouts()
        setpoints = []
        times = []
        for topic, time, data in messages.each():
            self.recorded = time
            if topic == WRENCH:
                self.take_wrench(data)
                continue
            clock = partial(int, time)
            if topic in self.base.topics:
                self.base.take(topic, data, clock)
                continue
            setpoint = self.take(topic, data, clock)
            if setpoint is not None:
                setpoints.append(self.on_base(setpoint))
                times.append(time)
            self.judge()
        return Batch(
            np.array([each.stamp for each in setpoints], dtype=np.int64),
            np.array([each.motion for each in setpoints], dtype=float).reshape(-1, MOTION),
            np.array([each.wrench for each in setpoints], dtype=float).reshape(-1, 6),
            np.array([each.restart for each in setpoints], dtype=bool),
            np.array(times, dtype=np.int64),
            np.array([each.base for each in setpoints], dtype=float).reshape(-1, BASE)
            if self.base.topics else None,
            np.array([each.stamped for each in setpoints], dtype=bool))

    def end(self, why: str) -> None:
        """Drop and count waiting samples: no more messages arrive."""
        self._joining.end(why)
        self.base.joining.end(why)
        for consistency in self._checks:
            consistency.finish()

    def reject(self, topic: str, reason: str, details: str, number: int = 1) -> None:
        """Count and report messages that are not used."""
        self._rejections.reject(topic, reason, details, number)

    def _take_ordinary(self, messages: Messages) -> Batch | None:
        """Join a batch as ``take_many``; None, without effect, if a message is irregular."""
        places = messages.places()
        wrenches = NO_SAMPLES
        if WRENCH in places:
            which = places[WRENCH]
            read = self._wrench_input.reader.read_many(
                messages.data, messages.starts[which], messages.sizes[which])
            if read is None:
                return None
            wrenches = TopicSamples(*read, which)
        joined = self._joining.join_many(messages, places)
        base = self.base.join_many(messages, places)
        if joined is None or base is None:
            return None
        self._joining.accept(joined, places)
        if len(joined.stamps):
            self._first = self._first or tuple(joined.motions[0].tolist())
            self._last = tuple(joined.motions[-1].tolist())
        if self._consistency is not None and len(joined.stamps):
            self._consistency.add(
                joined.stamps, joined.motions, np.zeros(len(joined.stamps), dtype=bool))
        return Batch(
            joined.stamps, joined.motions, self._wrench_input.at(wrenches, joined.places),
            np.zeros(len(joined.stamps), dtype=bool), messages.times[joined.places],
            self.base.accept(base, places, joined.stamps, joined.places))
