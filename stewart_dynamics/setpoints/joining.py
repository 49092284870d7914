# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Joins messages on the setpoint topics to setpoints, and counts rejected messages.

Node and replay pass the same bytes in the same order, so both reject and join alike: the node
one message at a time, the replay in blocks. Regular blocks are joined at once, all others message
by message. The wrench and the base's motion have topics of their own: a setpoint gets the values
that are valid when it is complete.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from struct import Struct

import numpy as np

from stewart_dynamics.arrays import Six, Stamps
from stewart_dynamics.mechanics.kinematics.pose_mistakes import (
    IN_DEGREES, pose_mistake, PoseByAngles)
from stewart_dynamics.mechanics.rows import MOTION, NO_BASE
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.parameters.table import Parameters, POSES_ALONE
from stewart_dynamics.setpoints.base_input import BaseInput
from stewart_dynamics.setpoints.consistency import Consistency, inconsistencies, Mistake
from stewart_dynamics.setpoints.inconsistency import QUANTITIES, RATES
from stewart_dynamics.setpoints.input_messages import (
    ACCEL, COMBINED, SOURCES, TopicSamples, TWIST, WRENCH, WrenchInput)
from stewart_dynamics.setpoints.rejections import Rejection, Rejections
from stewart_dynamics.setpoints.sample_joining import NO_SAMPLES, SampleJoining
from stewart_dynamics.setpoints.step import Batch, SETPOINT

_STANDSTILL = (0.0,) * 12
_ONE = Struct(f'q{SETPOINT}d')  # stamp and row: numpy needs three times as long for so few

Message = tuple[str, bytes, Callable[[], int]]
"""Topic, data and clock [ns]; the clock is read if the stamps of a setpoint are zero."""


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
        self._none = Batch(np.empty(0, dtype=np.int64), np.empty((0, SETPOINT)),
                           np.empty(0, dtype=np.int64), bool(self.base.topics))
        # Rows of motion; empty before the first.
        self._first: Sequence[float] = ()
        self._last: Sequence[float] = ()
        self._topic_of = dict.fromkeys(QUANTITIES, COMBINED) if COMBINED in self.topics else (
            dict.fromkeys(QUANTITIES, TWIST) | dict.fromkeys(RATES, ACCEL))
        self.unknown_angles: Sequence[PoseByAngles] = ()
        """Poses of a table by angles without a unit, which are checked at the end."""
        self._restarting = False  # the next setpoint is a restart
        self.recorded: int | None = None
        """Time of recording [ns] of the message of a block that is being processed."""

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
        mistake = (self._angle_mistake() or self._pose_mistake('first', self._first) if ever
                   else self._pose_mistake('last', self._last) if found else [])
        if mistake:
            # Derivatives of wrong poses do not show the mistake in twists.
            found = inconsistencies(self._consistency, ever, self._topic_of, reasons=False)
        return mistake + found + self.base.mistakes(ever)

    def _angle_mistake(self) -> list[Mistake]:
        """Return the likely mistake in most poses by angles without a unit, if they are wrong."""
        found = Counter(pose_mistake(self._parameters, pose.row, False, pose.angles)
                        for pose in self.unknown_angles)
        for text, count in found.most_common(1):
            if IN_DEGREES in text and 2 * count >= found.total():
                pose = max(self.unknown_angles, key=lambda each: each.angles.largest)
                return [Mistake(self.topics[0], f'{text}: {pose.angles.largest:.3g} is read in '
                                                f'rad; {pose.advice} reads degrees')]
        return []

    def _pose_mistake(self, which: str, motion: Sequence[float]) -> list[Mistake]:
        """Return the likely mistake in the pose of a row of motion."""
        if not len(motion):
            return []
        text = pose_mistake(self._parameters, motion, first=motion is self._first)
        return [Mistake(self.topics[0], f'{which} setpoint: {text}')] if text else []

    def judge(self) -> None:
        """Check samples noted so far, if there are enough; called when there is time."""
        for consistency in self._checks:
            consistency.judge()

    def take(self, messages: Messages | Iterable[Message]) -> Batch:
        """Return the setpoints that these messages complete."""
        if not isinstance(messages, Messages):
            return self._take_each(messages)
        joined = self._take_regular(messages)
        if joined is None:
            self._wrench_input.reader.forget_layout()
            self._joining.forget_layouts()
            self.base.joining.forget_layouts()
            joined = self._take_each(self._recorded(messages))
        return joined

    def _recorded(self, messages: Messages) -> Iterator[Message]:
        for topic, time, data in messages.each():
            self.recorded = time
            yield topic, data, partial(int, time)
            self.judge()
        self.recorded = None

    def _take_each(self, messages: Iterable[Message]) -> Batch:
        """Join messages one by one."""
        found: list[Batch] = []
        for topic, data, now in messages:
            if topic == WRENCH:
                self._wrench_input.take(data)
            elif topic in self.base.topics:
                self.base.take(topic, data, now)
            elif (sample := self._joining.take(topic, data, now)) is not None:
                stamp, values, restart, stamped = sample
                restart, self._restarting = restart or self._restarting, False
                # Twist and acceleration are zero if only the pose is given.
                motion = values if len(values) == MOTION else (*values, *_STANDSTILL)
                self._first = self._first or motion
                self._last = motion
                if restart:
                    self.base.restarted(stamp)
                if self._consistency is not None:
                    self._consistency.noted.append((stamp, motion, restart))
                base = self.base.at(stamp) if self.base.topics else None
                one = _ONE.pack(
                    stamp, *motion, *self._wrench_input.wrench, *(base or NO_BASE),
                    base is None or base[0] == base[0], restart, stamped)
                at: Stamps = np.ndarray(1, np.int64, one)
                found.append(Batch(
                    at, np.ndarray((1, SETPOINT), float, one, at.nbytes),
                    at if self.recorded is None else np.array([self.recorded]),
                    self._none.moving))
        return Batch.joined(found) if found else self._none

    def end(self, why: str) -> None:
        """Drop and count waiting samples: no more messages arrive."""
        self._joining.end(why)
        self.base.joining.end(why)
        for consistency in self._checks:
            consistency.finish()

    def restart(self, why: str) -> None:
        """Follow setpoints and base from any time on; the next setpoint is a restart."""
        self._restarting = True
        self._joining.restart(why)
        self.base.restart(why)

    def reject(self, topic: str, reason: str, details: str, number: int = 1) -> None:
        """Count and report messages that are not used."""
        self._rejections.reject(topic, reason, details, number)

    def _take_regular(self, messages: Messages) -> Batch | None:
        """Join a block at once; None, without effect, if a message is irregular."""
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
        return Batch.of(
            joined.stamps, joined.motions, self._wrench_input.at(wrenches, joined.places),
            times=messages.times[joined.places],
            bases=self.base.accept(base, places, joined.stamps, joined.places))
