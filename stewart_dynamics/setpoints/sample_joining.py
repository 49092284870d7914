# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Joins samples of several topics by stamp, and counts rejected samples.

``take`` handles one message; ``join_many`` handles a batch of messages without irregularities.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Integers, SECOND, Stamps
from stewart_dynamics.mechanics.rows import MOTION
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.messages.stamp_order import NO_STAMP, Order, order_of
from stewart_dynamics.setpoints.input_messages import SampleReader, TopicSamples
from stewart_dynamics.setpoints.rejections import (
    check_stamp, jumped_back, NOT_JOINED, Rejections, stamp_words, STAMP_ZERO)

# Maximum number of samples of a topic that wait for samples of the other topics, and depth of the
# queues in the middleware, which may deliver all messages of one topic before another topic's.
WAITING = 1000

Waiting = dict[int, tuple[float, ...]]
"""Values of the waiting samples of a topic, by stamp [ns], in order of arrival."""


class Joined(NamedTuple):
    """K joined setpoints, and the remaining samples of each topic."""

    stamps: Stamps  # (K,) [ns]
    motions: Array  # rows of motion (K, MOTION)
    places: Integers  # (K,): index of the message that completed each
    waiting: dict[str, Waiting]
    dropped: dict[str, list[int]]  # stamps of samples that can no longer be joined


def join_many(samples: Mapping[str, TopicSamples], waiting: Mapping[str, Waiting],
              last: Mapping[str, int]) -> Joined | None:
    """
    Join samples; None if stamps are not strictly increasing or more than WAITING samples wait.

    samples: new samples of each topic, in the order of topics in a row of motion.
    waiting: earlier samples of each topic that still wait.
    last: last used stamp of each topic [ns]; empty before the first.
    """
    stamps: dict[str, Stamps] = {}
    places: dict[str, Integers] = {}  # -1 for samples already waiting
    values: dict[str, Array] = {}
    for topic, of_topic in samples.items():
        before = waiting[topic]
        stamps[topic] = np.concatenate([np.fromiter(before, dtype=np.int64), of_topic.stamps])
        if not _only_rise(stamps[topic], of_topic.stamps, last.get(topic)):
            return None
        places[topic] = np.concatenate([np.full(len(before), -1), of_topic.places])
        values[topic] = of_topic.values
        if before:
            old = np.array(list(before.values()))
            values[topic] = np.concatenate([old, of_topic.values.reshape(-1, old.shape[1])])
    # Stamps are strictly increasing, so setpoints are completed in the order of their stamps.
    common, *others = stamps.values()
    for other in others:
        common = np.intersect1d(common, other, assume_unique=True)
    chosen = {topic: np.searchsorted(stamps[topic], common) for topic in samples}
    complete = np.max([places[topic][chosen[topic]] for topic in samples], axis=0)
    if any(_overflows(stamps[topic], places[topic], common, complete) for topic in samples):
        return None
    motions = np.zeros((len(common), MOTION))
    column = 0
    for topic in samples:
        width = values[topic].shape[1]
        motions[:, column:column + width] = values[topic][chosen[topic]]
        column += width
    left, dropped = {}, {}
    for topic in samples:
        first = int(np.searchsorted(stamps[topic], common[-1], side='right')) if len(
            common) else 0
        left[topic] = dict(zip(stamps[topic][first:].tolist(),
                               map(tuple, values[topic][first:].tolist()), strict=True))
        if first > len(common):
            dropped[topic] = np.setdiff1d(
                stamps[topic][:first], common, assume_unique=True).tolist()
    return Joined(common, motions, complete, left, dropped)


def _only_rise(stamps: Stamps, new: Stamps, last: int | None) -> bool:
    """Return whether stamps increase strictly from the last one on and new ones are stamps."""
    # Waiting samples may have arrived out of order.
    return not (np.any(np.diff(stamps) <= 0) or (len(new) and (
        new[0] <= NO_STAMP or (last is not None and stamps[0] <= last))))


def _overflows(stamps: Stamps, places: Integers, common: Stamps, complete: Integers) -> bool:
    """Return whether more than WAITING samples of a topic wait at any time."""
    if len(stamps) <= WAITING:
        return False
    completed = np.searchsorted(complete, places)  # setpoints completed when a sample arrives
    used = np.concatenate([[0], np.searchsorted(stamps, common, side='right')])[completed]
    return bool(np.any(np.arange(1, len(stamps) + 1) - used > WAITING))


_NOWHERE = np.empty(0, dtype=np.int64)
NO_SAMPLES = TopicSamples(_NOWHERE, np.empty((0, 0)), _NOWHERE)


class JoinedSample(NamedTuple):
    """Samples of the same time, one of each topic."""

    stamp: int  # stamp of the first topic's sample [ns]
    values: tuple[float, ...]  # concatenated values, in the order of topics
    restart: bool  # time has jumped back before it
    stamped: bool = True
    """Whether the stamp comes from the samples; otherwise it is the time of arrival."""


class SampleJoining:
    """
    Joins the topics' samples by stamp.

    topics: topics, in the order in which their values are joined.
    frame: required frame_id; an empty one is accepted. None: the first non-empty one is required.
    tolerance, timeout: maximum difference between the stamps of joined samples, and the jump back
        in time above which a restart is assumed [s].
    noticed: called with texts for the log: a restart, stamps that are zero.
    """

    def __init__(self, topics: Sequence[str], frame: str | None, tolerance: float, timeout: float,
                 rejections: Rejections, noticed: Callable[[str], object]) -> None:
        self.topics = tuple(topics)
        self._reject = rejections.reject
        self._readers = {topic: SampleReader(topic, frame, rejections) for topic in self.topics}
        self._tolerance = round(tolerance * SECOND)
        self._timeout = round(timeout * SECOND)
        self._noticed = noticed
        self._last: dict[str, int] = {}
        self._waiting: dict[str, Waiting] = {topic: {} for topic in self.topics}
        self._unstamped: dict[str, tuple[float, ...] | None] = {}
        self._unstamped_logged = False
        self._unstamped_first = ''
        self._without_stamp: set[str] = set()  # topics whose last sample had no stamp

    def take(self, topic: str, data: bytes, now: Callable[[], int]) -> JoinedSample | None:
        """
        Return the joined sample that this message completes, if any.

        now: the clock [ns]; read if the stamps of samples are zero.
        """
        sample = self._readers[topic].read(data)
        if sample is None:
            if topic in self._without_stamp:
                self._join_unstamped(topic, None, now)  # it keeps its place in the order
            return None
        stamp, values = sample
        if stamp == NO_STAMP:
            self._without_stamp.add(topic)
            return self._join_unstamped(topic, values, now)
        if topic in self._without_stamp:
            self._without_stamp.discard(topic)
            self._unstamped_first = ''
            if self._unstamped.pop(topic, None):
                self._reject(topic, NOT_JOINED, STAMP_ZERO)
        if not self._in_time(topic, stamp):
            return None
        waiting = self._waiting[topic]
        waiting[stamp] = values
        if len(waiting) > WAITING:
            oldest = next(iter(waiting))
            del waiting[oldest]
            self._reject(topic, NOT_JOINED, stamp_words(oldest))
        return self._join(stamp)

    def forget_layouts(self) -> None:
        """Learn the layout again, from the next valid message of each topic."""
        for reader in self._readers.values():
            reader.forget_layout()

    def end(self, why: str) -> None:
        """Drop and count waiting samples: no more messages arrive."""
        for topic, waiting in self._waiting.items():
            for stamp in waiting:
                self._reject(topic, NOT_JOINED, f'{stamp_words(stamp)}: {why}')
            waiting.clear()
        self._drop_unstamped()

    def restart(self, why: str) -> None:
        """Accept samples of any time from now on; drop and count waiting samples."""
        self.end(why)
        self._last = {}

    def join_many(self, messages: Messages, places: Mapping[str, Integers]) -> Joined | None:
        """
        Join a batch of messages; None if one is irregular. The state is not changed.

        Regular messages are valid, have one layout for each topic and strictly increasing stamps.

        messages: messages of these and other topics.
        places (K,): indices of the messages of each topic; topics without a message are absent.
        """
        if self._tolerance or self._without_stamp:
            return None
        samples = dict.fromkeys(self.topics, NO_SAMPLES)
        for topic in self.topics:
            if topic in places:
                which = places[topic]
                read = self._readers[topic].read_many(
                    messages.data, messages.starts[which], messages.sizes[which])
                if read is None:
                    return None
                samples[topic] = TopicSamples(*read, which)
        return join_many(samples, self._waiting, self._last)

    def accept(self, joined: Joined, places: Mapping[str, Integers]) -> None:
        """Continue after the samples that ``join_many`` has joined."""
        self._waiting = joined.waiting
        if len(joined.stamps):
            self._last = dict.fromkeys(self.topics, int(joined.stamps[-1]))
        for topic, dropped in joined.dropped.items():
            for stamp in dropped:
                self._reject(topic, NOT_JOINED, stamp_words(stamp))

    def _in_time(self, topic: str, stamp: int) -> bool:
        """Return whether a sample is in time; reject it otherwise."""
        # A sample that still waits is followed as the last used one is.
        last = stamp if stamp in self._waiting[topic] else self._last.get(topic)
        # A restart is noticed where the sample is joined.
        return check_stamp(
            stamp, last, self._timeout, partial(self._reject, topic), lambda text: None)

    def _join(self, stamp: int) -> JoinedSample | None:
        """Return the joined sample that a sample completes, if stamps are within the tolerance."""
        if self._tolerance:
            stamps = self._nearest(stamp)
            if not stamps:
                return None
        else:
            for waiting in self._waiting.values():
                if stamp not in waiting:
                    return None
            stamps = dict.fromkeys(self.topics, stamp)
        restart = self._drop_passed(stamps)
        values = [self._waiting[other].pop(at) for other, at in stamps.items()]
        return JoinedSample(stamps[self.topics[0]], sum(values, ()), restart)

    def _nearest(self, stamp: int) -> dict[str, int]:
        """Return the stamps that belong to a stamp; empty if not all are within the tolerance."""
        stamps = {}
        # The first topic defines the stamp; the nearest samples of the others belong to it.
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
        Drop and count waiting samples that can no longer be used after these stamps.

        Return whether time has jumped back.
        """
        first = self.topics[0]
        restart = order_of(
            stamps[first], self._last.get(first), self._timeout) is Order.RESTART
        if restart:
            self._noticed(jumped_back(self._last[first] - stamps[first]))
        for topic, stamp in stamps.items():
            waiting = self._waiting[topic]
            if len(waiting) > 1 or (waiting and stamp not in waiting):
                # After a restart, remaining samples from before the restart lie in the future.
                future = self._last[topic] - self._timeout if restart else math.inf
                for other in [other for other in waiting if other != stamp and (
                        other < stamp or other > future)]:
                    del waiting[other]
                    self._reject(topic, NOT_JOINED, stamp_words(other))
        self._last = stamps
        return restart

    def _join_unstamped(
            self, topic: str, values: tuple[float, ...] | None, now: Callable[[], int],
    ) -> JoinedSample | None:
        """
        Join samples without a stamp in order of arrival; ``values`` is None if one was rejected.

        A joined sample begins with the same topic as the first one, and has one sample of each
        topic. If it is incomplete when the next one begins, all of it is dropped: otherwise one
        lost sample would shift all following ones.
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
        # The clock takes their place: from and to samples with stamps, time may jump back.
        stamp = now()
        restart = self._drop_passed(dict.fromkeys(self.topics, stamp))
        return JoinedSample(stamp, sum(sound, ()), restart, stamped=False)

    def _drop_unstamped(self) -> None:
        for topic, values in self._unstamped.items():
            if values is not None:
                self._reject(topic, NOT_JOINED, STAMP_ZERO)
        self._unstamped.clear()
