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
From messages on the setpoint topics to joined setpoints; what is rejected is counted.

Node and replay feed it the same bytes in the same order, so both reject and join alike: the node
one message at a time, the replay many at once. ``take`` handles one message;
``take_many`` does the same for many of which none is out of the ordinary, and calls ``take`` for
each of them where one is.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Bytes, Integers, Six, Stamps
from stewart_dynamics.mechanics.rows import MOTION
from stewart_dynamics.parameters import Parameters
from stewart_dynamics.runtime.batch_joining import join_many, Samples, WAITING, Waiting
from stewart_dynamics.runtime.input_topics import SOURCES, WRENCH
from stewart_dynamics.runtime.rejections import NOT_JOINED, Rejection, Rejections, TOO_OLD, TWICE
from stewart_dynamics.runtime.samples import SampleReader
from stewart_dynamics.runtime.step import Batch, Setpoint
from stewart_dynamics.runtime.wrench_input import WrenchInput

_STANDSTILL = (0.0,) * 6
_NOWHERE = np.empty(0, dtype=np.int64)
_NO_SAMPLES = Samples(_NOWHERE, np.empty((0, 0)), _NOWHERE)


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


class Setpoints:
    """
    Joins the topics' samples by stamp.

    Parameters
    ----------
    parameters : Parameters
        Which topics, frame, tolerance and timeout.
    rejected : callable
        Called with each rejection and its details; they are counted as well.
    noticed : callable
        Called with texts for the log: a restart, stamps that are all zero.

    """

    def __init__(
            self, parameters: Parameters, rejected: Callable[[Rejection, str], None],
            noticed: Callable[[str], None]) -> None:
        self.topics = SOURCES[parameters['setpoint.source']]
        self._rejections = Rejections(rejected)
        self._wrench_input = WrenchInput(parameters, self._rejections)
        self._readers = {topic: SampleReader(topic, parameters['base_frame'], self._rejections)
                         for topic in self.topics}
        self._tolerance = round(parameters['setpoint.sync_tolerance'] * 1e9)
        self._timeout = round(parameters['setpoint.timeout'] * 1e9)
        self._noticed = noticed
        self._last: dict[str, int] = {}
        self._waiting: dict[str, Waiting] = {topic: {} for topic in self.topics}
        self._unstamped: dict[str, tuple[float, ...] | None] = {}
        self._unstamped_logged = False
        self._unstamped_first = ''
        self._stamped: set[str] = set()
        self.recorded: int | None = None
        """When the message at work was recorded [ns], if it is one of ``take_many``."""

    @property
    def counts(self) -> Counter[Rejection]:
        """Return what was rejected so far, and how often."""
        return self._rejections.counts

    @property
    def wrench(self) -> Six:
        """Return the known load on the platform, of the last message on ``~/wrench`` [N, N m]."""
        return self._wrench_input.wrench

    def take_wrench(self, data: bytes) -> None:
        """Use this geometry_msgs/WrenchStamped for all setpoints to come, if it is sound."""
        self._wrench_input.take(data)

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
        sample = self._readers[topic].read(data)
        if sample is None:
            if self._unstamped_logged and topic not in self._stamped:
                self._join_unstamped(topic, None, now)  # it keeps its place in the order
            return None
        stamp, values = sample
        if topic not in self._stamped:
            if stamp == 0:
                return self._join_unstamped(topic, values, now)
            # From now on zero is a time as others are.
            self._stamped.add(topic)
            if self._unstamped.pop(topic, None):
                self.reject(topic, NOT_JOINED, 'stamp 0')
        if not self._in_time(topic, stamp):
            return None
        waiting = self._waiting[topic]
        waiting[stamp] = values
        if len(waiting) > WAITING:
            oldest = next(iter(waiting))
            del waiting[oldest]
            self.reject(topic, NOT_JOINED, f'stamp {oldest} ns')
        return self._join(stamp)

    def take_many(self, messages: Messages) -> Batch:
        """Return the setpoints that these messages complete."""
        joined = self._join_many(messages)
        if joined is not None:
            return joined
        for reader in (self._wrench_input.reader, *self._readers.values()):
            reader.forget_layout()
        setpoints = []
        times = []
        for topic, time, data in messages.each():
            self.recorded = time
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
        """Drop and count what still waits: no more messages come."""
        for topic, waiting in self._waiting.items():
            for stamp in waiting:
                self.reject(topic, NOT_JOINED, f'stamp {stamp} ns: {why}')
            waiting.clear()
        self._drop_unstamped()

    def reject(self, topic: str, reason: str, details: str, number: int = 1) -> None:
        """Count and report what is not used."""
        self._rejections.reject(topic, reason, details, number)

    def _in_time(self, topic: str, stamp: int) -> bool:
        """Return whether a sample may still be used, or reject it."""
        if stamp in self._waiting[topic]:
            self.reject(topic, TWICE, f'stamp {stamp} ns')
            return False
        last = self._last.get(topic)
        if last is None or not 0 <= last - stamp <= self._timeout:
            return True
        if stamp == last:
            self.reject(topic, TWICE, f'stamp {stamp} ns')
        else:
            self.reject(topic, TOO_OLD, f'stamp {stamp} ns is {(last - stamp) / 1e9:g} s '
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
        restart = self._drop_passed(stamps)
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

    def _drop_passed(self, stamps: dict[str, int]) -> bool:
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
                    self.reject(topic, NOT_JOINED, f'stamp {other} ns')
        self._last = stamps
        return bool(jump > self._timeout)

    def _join_unstamped(
            self, topic: str, values: tuple[float, ...] | None, now: Callable[[], int],
    ) -> Setpoint | None:
        """
        Join samples without a stamp in their order of arrival; one without values was rejected.

        A setpoint begins with the topic that began the first one, and has one sample of each.
        What is incomplete when the next one begins is dropped, all of it: else a lost sample
        would join the following ones wrongly for ever.
        """
        if not self._unstamped_logged:
            self._unstamped_logged = True
            self._noticed(f'{topic}: header stamps are zero: such samples are joined in order '
                          'of arrival and stamped with the clock')
        if topic in self._unstamped or topic == self._unstamped_first:
            self._drop_unstamped()
        self._unstamped[topic] = values
        if len(self._unstamped) < len(self.topics):
            return None
        in_order = [self._unstamped[other] for other in self.topics]
        sound = [each for each in in_order if each is not None]
        if len(sound) < len(in_order):
            self._drop_unstamped()
            return None
        self._unstamped_first = self._unstamped_first or next(iter(self._unstamped))
        self._unstamped.clear()
        return Setpoint(now(), self._motion(sound), self.wrench)

    def _drop_unstamped(self) -> None:
        for topic, values in self._unstamped.items():
            if values is not None:
                self.reject(topic, NOT_JOINED, 'stamp 0')
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
        if self._tolerance or self._unstamped_logged:
            return None
        samples: dict[str, Samples] = dict.fromkeys(self.topics, _NO_SAMPLES)
        wrenches = _NO_SAMPLES
        for n, topic in enumerate(messages.topics):
            places = np.flatnonzero(messages.of_topic == n)
            if not len(places):
                continue
            reader = self._wrench_input.reader if topic == WRENCH else self._readers[topic]
            read = reader.read_many(messages.data, messages.starts[places], messages.sizes[places])
            if read is None:
                return None
            if topic == WRENCH:
                wrenches = Samples(*read, places)
            else:
                samples[topic] = Samples(*read, places)
        joined = join_many(samples, self._waiting, self._last)
        if joined is None:
            return None
        self._stamped |= {topic for topic in self.topics if len(samples[topic].stamps)}
        self._waiting = joined.waiting
        if len(joined.stamps):
            self._last = dict.fromkeys(self.topics, int(joined.stamps[-1]))
        for topic, dropped in joined.dropped.items():
            for stamp in dropped:
                self.reject(topic, NOT_JOINED, f'stamp {stamp} ns')
        return Batch(joined.stamps, joined.motions, self._wrench_input.at(wrenches, joined.places),
                     np.zeros(len(joined.stamps), dtype=bool), messages.times[joined.places])
