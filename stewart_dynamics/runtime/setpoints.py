# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
From messages on the setpoint topics to joined setpoints; what is refused is counted.

Node and replay feed it the same bytes in the same order, so both refuse and join alike: the node
one message at a time, the replay many at once. ``take`` says what becomes of a message;
``take_many`` does the same to many of which none is out of the ordinary, and hands them to
``take`` where one is.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Bytes, Integers, NO_WRENCH, Six, Stamps
from stewart_dynamics.mechanics.rotation import from_quaternion
from stewart_dynamics.mechanics.rows import MOTION
from stewart_dynamics.messages import cdr
from stewart_dynamics.parameters import Parameters
from stewart_dynamics.runtime.step import Batch, Setpoint

# Of each topic under the node's name: type, how it is read.
POSE = 'setpoint/pose'
TWIST = 'setpoint/twist'
ACCEL = 'setpoint/accel'
COMBINED = 'setpoint/combined'
WRENCH = 'wrench'
INPUT_TYPES = {
    POSE: 'geometry_msgs/msg/PoseStamped',
    TWIST: 'geometry_msgs/msg/TwistStamped',
    ACCEL: 'geometry_msgs/msg/AccelStamped',
    COMBINED: 'trajectory_msgs/msg/MultiDOFJointTrajectory',
    WRENCH: 'geometry_msgs/msg/WrenchStamped',
}
SOURCES = {'separate': (POSE, TWIST, ACCEL), 'combined': (COMBINED,), 'pose': (POSE,)}
_READERS: dict[str, Callable[[bytes], cdr.Stamped]] = {
    POSE: cdr.pose, TWIST: cdr.twist, ACCEL: cdr.twist, COMBINED: cdr.combined,
    WRENCH: cdr.wrench}

# A quaternion's length may be this far from one; it is brought to one.
QUATERNION_TOLERANCE = 1e-3
# Samples of a topic that wait for those of the others; beyond it the oldest is given up. As many
# as may wait in the node's middleware: it hands over one topic's after the other's.
WAITING = 1000

_STANDSTILL = (0.0,) * 6


class Refusal(NamedTuple):
    """Why a message, or what became of it, is counted and not used."""

    topic: str
    reason: str


class Messages(NamedTuple):
    """Recorded messages in their order, M of them."""

    topics: tuple[str, ...]
    """Keys of INPUT_TYPES."""
    of_topic: Integers
    """(M,): which of the topics."""
    times: Stamps
    """(M,): when each was recorded [ns]."""
    data: Bytes
    """Bytes in which all of them are."""
    starts: Integers
    """(M,): where each begins in them."""
    sizes: Integers
    """(M,): how long each is."""

    def chosen(self, which: Any) -> Messages:
        """Return some of them: a slice, or an index or a mask (M,)."""
        return self._replace(of_topic=self.of_topic[which], times=self.times[which],
                             starts=self.starts[which], sizes=self.sizes[which])

    def each(self) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time and bytes of one after the other."""
        for topic, time, start, size in zip(
                self.of_topic.tolist(), self.times.tolist(), self.starts.tolist(),
                self.sizes.tolist(), strict=True):
            yield self.topics[topic], time, self.data[start:start + size].tobytes()


MALFORMED = 'malformed'
NOT_FINITE = 'not finite'
NOT_UNIT = 'quaternion not of unit length'
WRONG_FRAME = 'wrong frame_id'
TOO_OLD = 'older than the last used'
TWICE = 'same stamp twice'
NOT_JOINED = 'passed over: not all topics had its stamp'
OUT_OF_RANGE = 'out of range: the numbers overflow'
NOT_EXCLUSIVE = 'more than one writer'
PASSED_OVER = 'passed over: more came at once than can be answered'


def frame_details(frame: bytes, base_frame: bytes) -> str:
    """Return what is said of a WRONG_FRAME."""
    return f'{frame[:60].decode(errors="replace")!r}, must be {base_frame.decode()!r} or empty'


def unit_details(length: float) -> str:
    """Return what is said of a quaternion that is NOT_UNIT."""
    return f'length {length:.6g}, must be within {QUATERNION_TOLERANCE:g} of 1'


class Setpoints:
    """
    Joins the topics' samples by stamp.

    Parameters
    ----------
    parameters : Parameters
        Which topics, frame, tolerance and timeout.
    refused : callable
        Told of each refusal and its details, beside the counting.
    noticed : callable
        Told what a user should hear once: a restart, stamps that are all zero.

    """

    def __init__(
            self, parameters: Parameters, refused: Callable[[Refusal, str], None],
            noticed: Callable[[str], None]) -> None:
        self.topics = SOURCES[parameters['setpoint.source']]
        self.counts: Counter[Refusal] = Counter()
        self.wrench: Six = NO_WRENCH
        self._frames = {b'', parameters['base_frame'].encode()}
        self._tolerance = round(parameters['setpoint.sync_tolerance'] * 1e9)
        self._timeout = round(parameters['setpoint.timeout'] * 1e9)
        self._refused = refused
        self._noticed = noticed
        self._last: dict[str, int] = {}
        self._waiting: dict[str, dict[int, tuple[float, ...]]] = {t: {} for t in self.topics}
        self._unstamped: dict[str, tuple[float, ...] | None] = {}
        self._unstamped_said = False
        self._unstamped_first = ''
        self._stamped: set[str] = set()
        self._layouts: dict[str, cdr.Layout] = {}

    def take_wrench(self, data: bytes) -> None:
        """Use this geometry_msgs/WrenchStamped for all setpoints to come, if it is sound."""
        sample = self._sound(WRENCH, data)
        if sample is not None:
            fx, fy, fz, tx, ty, tz = sample[1]
            self.wrench = fx, fy, fz, tx, ty, tz

    def take(self, topic: str, data: bytes, now: Callable[[], int]) -> Setpoint | None:
        """
        Return the setpoint that this message completes, if it does.

        Parameters
        ----------
        topic : str
            One of ``topics``.
        data : bytes
            The message as it came, CDR.
        now : callable
            The clock [ns]; asked where a setpoint's own stamps are zero.

        """
        sample = self._sound(topic, data)
        if sample is None:
            if self._unstamped_said and topic not in self._stamped:
                self._join_unstamped(topic, None, now)  # it keeps its place in the order
            return None
        stamp, values = sample
        if topic not in self._stamped:
            if stamp == 0:
                return self._join_unstamped(topic, values, now)
            # From now on zero is a time as others are.
            self._stamped.add(topic)
            if self._unstamped.pop(topic, None):
                self.refuse(topic, NOT_JOINED, 'stamp 0')
        if not self._in_time(topic, stamp):
            return None
        waiting = self._waiting[topic]
        waiting[stamp] = values
        if len(waiting) > WAITING:
            oldest = next(iter(waiting))
            del waiting[oldest]
            self.refuse(topic, NOT_JOINED, f'stamp {oldest} ns')
        return self._join(stamp)

    def take_many(self, messages: Messages) -> Batch:
        """Return the setpoints that these messages complete."""
        joined = self._join_many(messages)
        if joined is not None:
            return joined
        self._layouts.clear()
        setpoints = []
        times = []
        for topic, time, data in messages.each():
            if topic == WRENCH:
                self.take_wrench(data)
                continue
            setpoint = self.take(topic, data, partial(int, time))
            if setpoint is not None:
                setpoints.append(setpoint)
                times.append(time)
        return Batch(
            np.array([each.stamp for each in setpoints], dtype=np.int64),
            np.array([each.motion for each in setpoints], dtype=float).reshape(-1, MOTION),
            np.array([each.wrench for each in setpoints], dtype=float).reshape(-1, 6),
            np.array([each.restart for each in setpoints], dtype=bool),
            np.array(times, dtype=np.int64))

    def end(self, why: str) -> None:
        """Give up and count what still waits: no more messages come."""
        for topic, waiting in self._waiting.items():
            for stamp in waiting:
                self.refuse(topic, NOT_JOINED, f'stamp {stamp} ns: {why}')
            waiting.clear()
        self._give_up_unstamped()

    def refuse(self, topic: str, reason: str, details: str, number: int = 1) -> None:
        """Count, and tell of, what is not used."""
        refusal = Refusal(topic, reason)
        self.counts[refusal] += number
        self._refused(refusal, details)

    def _sound(self, topic: str, data: bytes) -> tuple[int, tuple[float, ...]] | None:
        """Return a message's stamp and numbers, a rotation matrix in them, or refuse it."""
        # Most messages have the layout of the first one, whose frame was right.
        layout = self._layouts.get(topic)
        stamp_and_values = layout.read_one(data) if layout else None
        if stamp_and_values is None:
            try:
                stamp, frame, values = _READERS[topic](data)
            except cdr.MalformedError as exc:
                self.refuse(topic, MALFORMED, str(exc))
                return None
            if frame not in self._frames:
                self.refuse(topic, WRONG_FRAME, frame_details(frame, max(self._frames)))
                return None
            self._learn(topic, data)
        else:
            stamp, values = stamp_and_values
        if not cdr.finite(values):
            self.refuse(topic, NOT_FINITE, str(values))
            return None
        if topic in (POSE, COMBINED):
            x, y, z, w = values[3:7]
            length = math.sqrt(x * x + y * y + z * z + w * w)
            if not abs(length - 1.0) <= QUATERNION_TOLERANCE:
                self.refuse(topic, NOT_UNIT, unit_details(length))
                return None
            values = values[:3] + from_quaternion(
                x / length, y / length, z / length, w / length) + values[7:]
        return stamp, values

    def _learn(self, topic: str, data: bytes) -> None:
        """Keep the layout of a topic's first sound message."""
        if topic not in self._layouts:
            layout = cdr.Layout.of(_READERS[topic], data)
            if layout is not None:
                self._layouts[topic] = layout

    def _in_time(self, topic: str, stamp: int) -> bool:
        """Return whether a sample may still be used, or refuse it."""
        if stamp in self._waiting[topic]:
            self.refuse(topic, TWICE, f'stamp {stamp} ns')
            return False
        last = self._last.get(topic)
        if last is None or not 0 <= last - stamp <= self._timeout:
            return True
        if stamp == last:
            self.refuse(topic, TWICE, f'stamp {stamp} ns')
        else:
            self.refuse(topic, TOO_OLD, f'stamp {stamp} ns is {(last - stamp) / 1e9:g} s '
                        f'older than the last used')
        return False

    def _join(self, stamp: int) -> Setpoint | None:
        """Return the setpoint that a sample completes, all its stamps within the tolerance."""
        if self._tolerance:
            stamps = self._nearest(stamp)
        elif all(stamp in waiting for waiting in self._waiting.values()):
            stamps = dict.fromkeys(self.topics, stamp)
        else:
            return None
        if not stamps:
            return None
        restart = self._give_up(stamps)
        values = [self._waiting[other].pop(at) for other, at in stamps.items()]
        return Setpoint(stamps[self.topics[0]], self._motion(values), self.wrench, restart)

    def _nearest(self, stamp: int) -> dict[str, int]:
        """Return the stamps that belong to one, none if they are not all within the tolerance."""
        stamps = {}
        # A setpoint has the stamp of the first topic: what is nearest to it belongs to it.
        at = stamp
        for other, waiting in self._waiting.items():
            if at not in waiting:
                if not waiting:
                    return {}
                at = min(waiting, key=lambda candidate: abs(candidate - at))
            stamps[other] = at
            at = stamps[self.topics[0]]
        return stamps if max(stamps.values()) - min(stamps.values()) <= self._tolerance else {}

    def _give_up(self, stamps: dict[str, int]) -> bool:
        """
        Drop and count what waits and can no longer be used once these stamps are.

        Return whether time has jumped back.
        """
        first = self.topics[0]
        jump: int = self._last[first] - stamps[first] if self._last else 0
        if jump > self._timeout:
            self._noticed(f'stamps jumped back by {jump / 1e9:g} s: followed as a restart')
        for topic, stamp in stamps.items():
            waiting = self._waiting[topic]
            if len(waiting) > 1:
                # After a restart, what is left of the time before it lies in the future.
                future = (self._last[topic] - self._timeout if jump > self._timeout
                          else math.inf)
                for other in [other for other in waiting if other < stamp or other > future]:
                    del waiting[other]
                    self.refuse(topic, NOT_JOINED, f'stamp {other} ns')
        self._last = stamps
        return bool(jump > self._timeout)

    def _join_unstamped(
            self, topic: str, values: tuple[float, ...] | None, now: Callable[[], int],
    ) -> Setpoint | None:
        """
        Join samples without a stamp in their order of arrival; one without values was refused.

        A setpoint begins with the topic that began the first one, and has one sample of each.
        What is incomplete when the next one begins is given up, all of it: else a lost sample
        would join the following ones wrongly for ever.
        """
        if not self._unstamped_said:
            self._unstamped_said = True
            self._noticed(f'{topic}: header stamps are zero: such samples are joined in order '
                          'of arrival and stamped with the clock')
        if topic in self._unstamped or topic == self._unstamped_first:
            self._give_up_unstamped()
        self._unstamped[topic] = values
        if len(self._unstamped) < len(self.topics):
            return None
        in_order = [self._unstamped[other] for other in self.topics]
        sound = [each for each in in_order if each is not None]
        if len(sound) < len(in_order):
            self._give_up_unstamped()
            return None
        self._unstamped_first = self._unstamped_first or next(iter(self._unstamped))
        self._unstamped.clear()
        return Setpoint(now(), self._motion(sound), self.wrench)

    def _give_up_unstamped(self) -> None:
        for topic, values in self._unstamped.items():
            if values is not None:
                self.refuse(topic, NOT_JOINED, 'stamp 0')
        self._unstamped.clear()

    def _motion(self, values: list[tuple[float, ...]]) -> tuple[float, ...]:
        """Return a row of motion: what the topics give, and zeros for what they do not."""
        motion = sum(values, ())
        return motion + _STANDSTILL + _STANDSTILL if len(motion) == 12 else motion

    def _join_many(self, messages: Messages) -> Batch | None:
        """
        Join messages of which none is out of the ordinary; None, and nothing done, if one is.

        Ordinary are sound messages of one layout for each topic, whose stamps only rise.
        """
        if self._tolerance or self._unstamped_said:
            return None
        came = {topic: np.flatnonzero(messages.of_topic == n)
                for n, topic in enumerate(messages.topics)}
        samples: dict[str, tuple[Stamps, Array]] = {}
        for topic, at in came.items():
            of_topic = self._samples(topic, messages, at)
            if of_topic is None:
                return None
            samples[topic] = of_topic
        wrench_at, wrenches = came.get(WRENCH, _NOWHERE), samples.pop(WRENCH, (None, None))[1]
        stamps: dict[str, Stamps] = {}
        # Where each of a topic's samples came, -1 for those that wait already.
        places: dict[str, Integers] = {}
        for topic in self.topics:
            fresh, places_of = samples.get(topic, _NO_SAMPLES)[0], came.get(topic, _NOWHERE)
            waiting = np.fromiter(self._waiting[topic], dtype=np.int64)
            of_topic_all = np.concatenate([waiting, fresh])
            after = self._last.get(topic)
            # What waits need not have come in the order of its stamps.
            if np.any(np.diff(of_topic_all) <= 0) or (len(fresh) and (
                    fresh[0] <= 0 or (after is not None and of_topic_all[0] <= after))):
                return None
            stamps[topic] = of_topic_all
            places[topic] = np.concatenate([np.full(len(waiting), -1), places_of])
        # Stamps only rise, so setpoints are complete in the order of their stamps.
        common = stamps[self.topics[0]]
        for topic in self.topics[1:]:
            common = np.intersect1d(common, stamps[topic], assume_unique=True)
        chosen = {topic: np.searchsorted(stamps[topic], common) for topic in self.topics}
        complete = np.max([places[topic][chosen[topic]] for topic in self.topics], axis=0)
        if any(self._overflows(stamps[t], places[t], common, complete) for t in self.topics):
            return None
        values = {topic: self._values(topic, samples) for topic in self.topics}
        motions = np.zeros((len(common), MOTION))
        column = 0
        for topic in self.topics:
            width = values[topic].shape[1]
            motions[:, column:column + width] = values[topic][chosen[topic]]
            column += width
        loads = np.empty((len(common), 6))
        loads[:] = self.wrench
        if wrenches is not None and len(wrenches):
            latest = np.searchsorted(wrench_at, complete) - 1
            loads[latest >= 0] = wrenches[latest[latest >= 0]]
            self.wrench = tuple(wrenches[-1].tolist())
        self._stamped |= {topic for topic in self.topics if len(came.get(topic, ()))}
        self._keep_waiting(stamps, values, common)
        return Batch(common, motions, loads, np.zeros(len(common), dtype=bool),
                     messages.times[complete])

    def _samples(self, topic: str, messages: Messages, at: Integers,
                 ) -> tuple[Stamps, Array] | None:
        """Return stamps and values of a topic's messages; None where one is not ordinary."""
        if not len(at):
            return _NO_SAMPLES
        layout = self._layouts.get(topic)
        if layout is None:
            start, size = int(messages.starts[at[0]]), int(messages.sizes[at[0]])
            first = messages.data[start:start + size].tobytes()
            try:
                if _READERS[topic](first).frame not in self._frames:
                    return None
            except cdr.MalformedError:
                return None
            self._learn(topic, first)
            layout = self._layouts.get(topic)
            if layout is None:
                return None
        if np.any(messages.sizes[at] != layout.size):
            return None
        read = layout.read(messages.data, messages.starts[at])
        if read is None or not np.isfinite(read[1]).all():
            return None
        stamps, values = read
        if topic not in (POSE, COMBINED):
            return read
        # The same arithmetic as in _sound, so that the bits are the same.
        x, y, z, w = values[:, 3:7].T
        with np.errstate(over='ignore'):
            length = np.sqrt(x * x + y * y + z * z + w * w)
        if not np.all(np.abs(length - 1.0) <= QUATERNION_TOLERANCE):
            return None
        rotation = from_quaternion(x / length, y / length, z / length, w / length)
        return stamps, np.column_stack([values[:, :3], *rotation, values[:, 7:]])

    def _values(self, topic: str, samples: dict[str, tuple[Stamps, Array]]) -> Array:
        """Return the values of what waits and of what came."""
        fresh = samples.get(topic, _NO_SAMPLES)[1]
        waiting = list(self._waiting[topic].values())
        if not waiting:
            return fresh
        return np.concatenate([np.array(waiting), fresh.reshape(-1, len(waiting[0]))])

    @staticmethod
    def _overflows(stamps: Stamps, places: Integers, common: Stamps,
                   complete: Integers) -> bool:
        """Return whether, at any time, more than WAITING samples of a topic wait."""
        if len(stamps) <= WAITING:
            return False
        completed = np.searchsorted(complete, places)  # setpoints, when a sample comes
        used = np.concatenate([[0], np.searchsorted(stamps, common, side='right')])[completed]
        return bool(np.any(np.arange(1, len(stamps) + 1) - used > WAITING))

    def _keep_waiting(self, stamps: dict[str, Stamps], values: dict[str, Array],
                      common: Stamps) -> None:
        """Keep what came after the last setpoint; count what no setpoint can use any more."""
        if len(common):
            self._last = dict.fromkeys(self.topics, int(common[-1]))
        for topic in self.topics:
            first = 0
            if len(common):
                first = int(np.searchsorted(stamps[topic], common[-1], side='right'))
                if first > len(common):
                    for stamp in np.setdiff1d(stamps[topic][:first], common,
                                              assume_unique=True).tolist():
                        self.refuse(topic, NOT_JOINED, f'stamp {stamp} ns')
            self._waiting[topic] = dict(zip(
                stamps[topic][first:].tolist(), map(tuple, values[topic][first:].tolist()),
                strict=True))


_NOWHERE = np.empty(0, dtype=np.int64)
_NO_SAMPLES: tuple[Stamps, Array] = (_NOWHERE, np.empty((0, 0)))
