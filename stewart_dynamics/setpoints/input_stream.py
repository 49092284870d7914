# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The stream of messages of setpoints, base and external wrench, joined by stamp: core/joining.c.

Node and replay pass the same bytes in the same order, the node one message, the replay a block;
any division into blocks gives the same. C reads messages of the layout that a topic had before.
Others, and those that are not valid, are read field by field here, which also words the events.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Integers, SECOND, Six, Stamps
from stewart_dynamics.core.binding import CODES, function, record
from stewart_dynamics.mechanics.rows import BASE
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.parameters.table import AT_REST, BY_IMU, FIXED, MOVING, Parameters
from stewart_dynamics.setpoints.input_messages import (
    BASE_SOURCES, MessageLayout, SampleReader, WRENCH)
from stewart_dynamics.setpoints.rejections import (
    jumped_back, NOT_JOINED, Rejections, stamp_words, STAMP_ZERO, TOO_OLD, too_old, TWICE)
from stewart_dynamics.setpoints.step import SETPOINT

# Maximum number of samples of a topic that wait for samples of the other topics, and depth of the
# queues in the middleware, which may deliver all messages of one topic before another topic's.
WAITING = CODES['MOST_WAITING']

Clock = Callable[[], int]
"""Returns the time [ns]; read if the stamps of samples are zero."""

_BASE_TOPIC, _WRENCH_TOPIC, _GROUP = 3, 6, 3
_SETPOINTS, _BASE = 0, 1  # groups of topics
_SOURCES = {FIXED: 0, AT_REST: CODES['BASE_AT_REST'], MOVING: CODES['BASE_MOVING'],
            BY_IMU: CODES['BASE_BY_IMU']}
_DONE, _UNREAD, _CLOCK = (CODES[f'JOIN_{name}'] for name in ('DONE', 'UNREAD', 'CLOCK'))
_VALID, _REJECTED = CODES['SAMPLE_VALID'], CODES['SAMPLE_REJECTED']
(_TWICE, _TOO_OLD, _NOT_JOINED, _UNSTAMPED_DROPPED, _ENDED, _BEFORE_RESTART, _RESTART,
 _NOTICE_UNSTAMPED) = (CODES[f'EVENT_{name}'] for name in (
     'TWICE', 'TOO_OLD', 'NOT_JOINED', 'UNSTAMPED_DROPPED', 'ENDED', 'BEFORE_RESTART', 'RESTART',
     'NOTICE_UNSTAMPED'))
# Places of join_progress as integers.
_NEXT, _N_SETPOINTS, _N_BASES, _N_EVENTS, _STATUS, _TIMED = range(6)
_EVENTS = 8192
_FEWEST_BYTES = 4096  # of the memory of a message


class Joined(NamedTuple):
    """Setpoints and samples of the base that messages complete."""

    stamps: Stamps  # (N,) [ns]
    rows: Array  # (N, SETPOINT), the structure ``setpoint`` in C
    places: Integers  # (N,): index of the message that completed each
    base_stamps: Stamps  # (K,) [ns]
    base_rows: Array  # (K, BASE)
    base_values: Array  # (K, ...): numbers of the joined messages
    base_restarts: Array  # (K,): not zero where time jumped back


class InputStream:
    """
    Joins messages.

    topics: those of setpoints, in the order in which their values are joined.
    noticed: called with texts for the log: a restart, stamps that are zero.
    recorded: time of recording [ns] of the message whose rejection is reported, if it has one.
    """

    def __init__(self, parameters: Parameters, topics: Sequence[str], rejections: Rejections,
                 noticed: Callable[[str], object]) -> None:
        source = parameters.base.source
        self.base_topics = BASE_SOURCES[source]
        self.recorded: int | None = None
        self._reject, self._noticed = rejections.reject, noticed
        numbers = {topic: n for n, topic in enumerate(topics)}
        numbers |= {topic: _BASE_TOPIC + n for n, topic in enumerate(self.base_topics)}
        self._numbers = numbers | {WRENCH: _WRENCH_TOPIC}
        self._topics = {number: topic for topic, number in self._numbers.items()}
        world = None if source == BY_IMU else parameters.world_frame
        self._readers = {
            number: SampleReader(topic, world if number in range(_BASE_TOPIC, _WRENCH_TOPIC)
                                 else parameters.base_frame, rejections)
            for number, topic in self._topics.items()}
        widths: Integers = np.zeros(2 * _GROUP, np.int64)
        for number, reader in self._readers.items():
            if number != _WRENCH_TOPIC:
                widths[number] = reader.width
        self._base_width = int(widths[_BASE_TOPIC:].sum())
        self._memory = np.zeros(function('input_stream_size')(), np.uint8)
        function('begin_stream')(
            self._memory, widths, round(parameters.setpoint.sync_tolerance * SECOND),
            round(parameters.setpoint.timeout * SECOND), round(parameters.base.timeout * SECOND),
            _SOURCES[source], np.array(parameters.gravity, dtype=float), _imu_of(parameters))
        self._layouts: dict[int, MessageLayout] = {}
        self._given: Any = np.zeros(1, record('given_sample'))
        self._events: Any = np.zeros(_EVENTS, record('input_event'))
        progress: Any = np.zeros(1, record('join_progress'))
        self._progress = progress.view(np.int64).data
        self._n_events = progress.view(np.int64)[_N_EVENTS:_N_EVENTS + 1]
        self._last: tuple[Stamps, Array] = np.zeros(1, np.int64), np.zeros((1, BASE))
        self._last_base = function('last_base').bound(self._memory, *self._last)
        self._ends = (self._given, _EVENTS, self._events, progress)
        self._make_memory_of_one(_FEWEST_BYTES)

    def _make_memory_of_one(self, size: int) -> None:
        """Make the memory of one message, which stays: a call takes a tenth of the time."""
        data: Any = np.zeros(size, np.uint8)
        whole: Integers = np.zeros(4, np.int64)  # topic, time, start and size of the message
        self._data, self._message, self._room = data.data, whole.data, size
        memory, self._join_one = self._bound(
            1, whole[0:1], whole[1:2], data, whole[2:3], whole[3:4])
        # A message completes nothing, a setpoint, or a sample of the base.
        self._of_one = {each: _part(memory, *each) for each in ((0, 0), (1, 0), (0, 1))}

    def _bound(self, count: int, topics: Integers, times: Stamps, data: Any, starts: Integers,
               sizes: Integers) -> tuple[Joined, Callable[[], object]]:
        """Return the memory for the numbers of messages, and the call that joins them."""
        given, room, events, progress = self._ends
        memory = Joined(
            np.empty(count, np.int64), np.empty((count, SETPOINT)), np.empty(count, np.int64),
            np.empty(count, np.int64), np.empty((count, BASE)),
            np.empty((count, self._base_width)), np.empty(count))
        return memory, function('join_messages').bound(
            self._memory, count, topics, times, data, starts, sizes, given, *memory, room, events,
            progress)

    def join_message(self, topic: str, data: bytes, clock: Clock) -> Joined:
        """Join one message; the result is valid until the next call."""
        size = len(data)
        if size > self._room:
            self._make_memory_of_one(2 * size)
        progress, message = self._progress, self._message
        self._data[:size] = data
        message[0], message[3] = self._numbers[topic], size
        progress[_NEXT] = progress[_N_SETPOINTS] = progress[_N_BASES] = 0
        progress[_TIMED] = 0
        self._join_one()
        while progress[_STATUS] != _DONE or progress[_N_EVENTS]:
            self._report_events(None)
            if progress[_STATUS] == _DONE:
                break
            if progress[_STATUS] == _CLOCK:
                message[1], progress[_TIMED] = clock(), 1
            elif progress[_STATUS] == _UNREAD:
                self._read_fields(message[0], data)
            self._join_one()
        return self._of_one[progress[_N_SETPOINTS], progress[_N_BASES]]

    def join_messages(self, messages: Messages) -> Joined:
        """Join messages of these and other topics, in recorded order."""
        topics = np.array([self._numbers.get(topic, -1) for topic in messages.topics], np.int64)[
            messages.of_topic]
        memory, join = self._bound(
            len(topics), topics, np.ascontiguousarray(messages.times), messages.data,
            np.ascontiguousarray(messages.starts), np.ascontiguousarray(messages.sizes))
        progress = self._progress
        progress[_NEXT] = progress[_N_SETPOINTS] = progress[_N_BASES] = 0
        progress[_TIMED], progress[_STATUS] = 1, -1
        while progress[_STATUS] != _DONE:
            join()
            self._report_events(messages.times)
            if progress[_STATUS] == _UNREAD:
                n = progress[_NEXT]
                self.recorded = int(messages.times[n])
                start = messages.starts[n]
                self._read_fields(
                    int(topics[n]), messages.data[start:start + messages.sizes[n]].tobytes())
        self.recorded = None
        return _part(memory, progress[_N_SETPOINTS], progress[_N_BASES])

    def _read_fields(self, number: int, data: bytes) -> None:
        """Read a message field by field, as the next sample."""
        reader, given = self._readers[number], self._given
        sample = reader.read_fields(data)
        if sample is None:
            given['state'] = _REJECTED
            return
        stamp, values = sample
        given['state'], given['stamp'] = _VALID, stamp
        given['values'][0, :len(values)] = values
        if (layout := reader.new_layout()) is not None:
            self._layouts[number] = layout  # its arrays must stay
            function('put_layout')(self._memory, number, *layout)

    def _report_events(self, times: Stamps | None, why: str = '') -> None:
        """Report what C has noted; times: when the messages were recorded [ns]."""
        for kind, number, stamp, last, n in self._events[:self._progress[_N_EVENTS]].tolist():
            self.recorded = int(times[n]) if times is not None and n >= 0 else None
            topic = self._topics[number]
            if kind == _TWICE:
                self._reject(topic, TWICE, stamp_words(stamp))
            elif kind == _TOO_OLD:
                self._reject(topic, TOO_OLD, too_old(stamp, last - stamp))
            elif kind == _NOT_JOINED:
                self._reject(topic, NOT_JOINED, stamp_words(stamp))
            elif kind == _UNSTAMPED_DROPPED:
                self._reject(topic, NOT_JOINED, STAMP_ZERO)
            elif kind in (_ENDED, _BEFORE_RESTART):
                reason = why if kind == _ENDED else 'before setpoints restarted'
                self._reject(topic, NOT_JOINED, f'{stamp_words(stamp)}: {reason}')
            else:
                text = jumped_back(last - stamp) if kind == _RESTART else (
                    f'{topic}: header stamps are zero: such samples are joined in order of '
                    'arrival and stamped with the clock')
                self._noticed(f'base: {text}' if number >= _BASE_TOPIC else text)
        self._progress[_N_EVENTS] = 0
        self.recorded = None

    def end(self, why: str, restart: bool = False) -> None:
        """
        Drop and count waiting samples, of setpoints and base.

        restart: samples of any time follow, none of the base is known, and the next setpoint is a
            restart.
        """
        for group in (_SETPOINTS, _BASE):
            function('end_stream')(self._memory, group, restart, self._events, self._n_events)
            self._report_events(None, why)

    def base_at(self, stamp: int) -> tuple[float, ...]:
        """Return the row (BASE,) of the base at a stamp [ns], nan if unknown."""
        row = np.empty((1, BASE))
        function('base_at')(self._memory, stamp, row)
        return tuple(row[0].tolist())

    def last_base(self) -> tuple[int, tuple[float, ...]] | None:
        """Return stamp [ns] and row (BASE,) of the last sample of the base."""
        stamp, row = self._last
        return (int(stamp[0]), tuple(row[0].tolist())) if self._last_base() else None

    @property
    def wrench(self) -> Six:
        """Return the last load on the platform [N, N m]."""
        wrench = np.empty(6)
        function('last_wrench')(self._memory, wrench)
        fx, fy, fz, tx, ty, tz = wrench.tolist()
        return fx, fy, fz, tx, ty, tz


def _part(memory: Joined, n: int, k: int) -> Joined:
    """Return the first n setpoints and k samples of the base."""
    return Joined(memory.stamps[:n], memory.rows[:n], memory.places[:n], memory.base_stamps[:k],
                  memory.base_rows[:k], memory.base_values[:k], memory.base_restarts[:k])


def _imu_of(parameters: Parameters) -> Any:
    """Return the structure of the IMU's mounting."""
    given = parameters.base.imu
    imu: Any = np.zeros(1, record('imu_mounting'))
    imu['position'], imu['rate'] = given.position, 2.0 * math.pi * given.cutoff
    imu['timeout'] = round(parameters.base.timeout * SECOND)
    function('stewart_rotation')(np.array(given.orientation, dtype=float), imu['rotation'][0])
    return imu
