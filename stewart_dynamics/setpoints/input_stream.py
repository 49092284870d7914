# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The stream of messages of setpoints, base and external wrench, joined by stamp: core/joining.c.

Node and replay pass the same bytes in the same order, the node one message, the replay a block;
any division into blocks gives the same. In the node setpoints are answered in the same call.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Bytes, Integers, SECOND, Six, Stamps
from stewart_dynamics.core.binding import CODES, function, record
from stewart_dynamics.mechanics.rows import BASE
from stewart_dynamics.messages.layout import MessageRows
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.parameters.table import AT_REST, BY_IMU, FIXED, MOVING, Parameters
from stewart_dynamics.setpoints.input_messages import BASE_SOURCES, SampleReader, WRENCH
from stewart_dynamics.setpoints.output_messages import OutputMessages
from stewart_dynamics.setpoints.rejections import (
    jumped_back, NOT_JOINED, Rejections, stamp_words, STAMP_ZERO, TOO_OLD, too_old, TWICE)
from stewart_dynamics.setpoints.step import (
    ANSWERED, Batch, FIRST, OUTPUT, Outputs, SETPOINT, Step)

# Maximum number of samples of a topic that wait for samples of the other topics, and depth of the
# queues in the middleware, which may deliver all messages of one topic before another topic's.
WAITING = CODES['MOST_WAITING']

Clock = Callable[[], int]
"""Returns the time [ns]; read if the stamps of samples are zero."""

_BASE_TOPIC, _WRENCH_TOPIC, _GROUP = 3, 6, 3
_SETPOINTS, _BASE = 0, 1  # groups of topics
_SOURCES = {FIXED: 0, AT_REST: CODES['BASE_AT_REST'], MOVING: CODES['BASE_MOVING'],
            BY_IMU: CODES['BASE_BY_IMU']}
_DONE, _CLOCK = CODES['JOIN_DONE'], CODES['JOIN_CLOCK']
(_TWICE, _TOO_OLD, _NOT_JOINED, _UNSTAMPED_DROPPED, _ENDED, _BEFORE_RESTART, _RESTART,
 _NOTICE_UNSTAMPED) = (CODES[f'EVENT_{name}'] for name in (
     'TWICE', 'TOO_OLD', 'NOT_JOINED', 'UNSTAMPED_DROPPED', 'ENDED', 'BEFORE_RESTART', 'RESTART',
     'NOTICE_UNSTAMPED'))
# Places of join_progress as integers.
_COUNT, _NEXT, _N_SETPOINTS, _N_BASES, _N_EVENTS, _STATUS, _TIMED, _HELD = range(8)
_EVENTS = 8192
_MOST_BYTES = 4096  # of a message that is copied


class Joined(NamedTuple):
    """Setpoints and samples of the base that messages complete; valid until the next call."""

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
        world = None if source == BY_IMU else parameters.world_frame
        inputs: Any = np.zeros(_WRENCH_TOPIC + 1, record('input_topic'))
        self._readers = {
            number: SampleReader(topic, world if number in range(_BASE_TOPIC, _WRENCH_TOPIC)
                                 else parameters.base_frame, rejections, inputs[number:number + 1])
            for topic, number in self._numbers.items()}
        widths: Integers = np.zeros(2 * _GROUP, np.int64)
        for number, reader in self._readers.items():
            if number != _WRENCH_TOPIC:
                widths[number] = reader.width
        self._base_width = int(widths[_BASE_TOPIC:].sum())
        self._memory = np.zeros(function('input_stream_size')(), np.uint8)
        self._inputs = inputs  # it must stay
        function('begin_stream')(
            self._memory, inputs, widths, round(parameters.setpoint.sync_tolerance * SECOND),
            round(parameters.setpoint.timeout * SECOND), round(parameters.base.timeout * SECOND),
            _SOURCES[source], np.array(parameters.gravity, dtype=float), _imu_of(parameters))
        self._events: Any = np.zeros(_EVENTS, record('input_event'))
        self._progress_record: Any = np.zeros(1, record('join_progress'))
        self._progress = self._progress_record.view(np.int64).data
        self._last: tuple[Stamps, Array] = np.zeros(1, np.int64), np.zeros((1, BASE))
        self._last_base = function('last_base').bound(self._memory, *self._last)
        self._state = FIRST.copy()  # of the step
        self._join = function('join_messages').bound(self._memory)
        self._answer = function('answer_setpoints').bound(self._memory)
        self._answers: tuple[Step, MessageRows, Callable[[dict[str, bytes]], object]] | None = None
        self._reserve_memory(1)

    def _reserve_memory(self, count: int) -> None:
        """Make the memory of messages, and of setpoints, samples and answers."""
        self._room = count
        self._data_bytes = np.empty(_MOST_BYTES, np.uint8)
        self._data = self._data_bytes.data
        self._places: Integers = np.zeros((4, count), np.int64)  # topics, times, starts, sizes
        self._first_place = self._places.data  # as integers that are set fast
        self._joined = Joined(
            np.empty(count, np.int64), np.empty((count, SETPOINT)), np.empty(count, np.int64),
            np.empty(count, np.int64), np.empty((count, BASE)),
            np.empty((count, self._base_width)), np.empty(count))
        self._parts = {each: _first_of(self._joined, *each) for each in ((0, 0), (1, 0), (0, 1))}
        self._written: tuple[Any, ...] = (None, None, None)
        if self._answers is not None:
            rows = self._answers[1]
            self._written = (np.empty((count, OUTPUT)), np.empty((count, rows.size), np.uint8),
                             np.empty((count, len(rows.parts)), bool))
        function('put_memory')(
            self._memory, *self._places, self._data_bytes, *self._joined, *self._written, _EVENTS,
            self._events, self._progress_record)

    def answer_setpoints(self, step: Step, messages: OutputMessages,
                         publish: Callable[[dict[str, bytes]], object]) -> None:
        """
        Answer setpoints from now on, in the call that completes them; the step's state is kept.

        publish: called with the messages of each answer by topic, before ``join_messages`` ends.
        """
        self._answers = step, messages.rows, publish
        function('put_answers')(self._memory, step.hexapod, self._state, *messages.rows.arguments)
        self._reserve_memory(self._room)

    def hold_answers(self, held: bool) -> None:
        """Complete setpoints without an answer, until ``answer_setpoint``."""
        self._progress[_HELD] = held

    def answer_setpoint(self, setpoint: Batch) -> None:
        """Answer a single setpoint that was held."""
        self._joined.stamps[:1], self._joined.rows[:1] = setpoint.stamps, setpoint.rows
        self._progress[_N_SETPOINTS] = 1
        self._answer()
        self._publish_answers(1)

    def _publish_answers(self, count: int) -> None:
        """Publish the messages of the first setpoints in memory that are answered."""
        assert self._answers is not None
        _, rows, publish = self._answers
        outputs, messages, having = self._written
        for n in range(count):
            if outputs[n, ANSWERED]:
                data = messages[n].tobytes()
                publish({topic: data[begin:end] for has, (topic, begin, end) in zip(
                    having[n].tolist(), rows.parts, strict=True) if has})

    def last_outputs(self) -> Outputs:
        """Return the outputs of the last single setpoint."""
        assert self._answers is not None
        return self._answers[0].outputs_of(
            self._joined.stamps[:1].copy(), self._written[0][:1].copy(), self._state.copy())

    def join_message(self, topic: str, data: bytes, clock: Clock) -> Joined:
        """Join one message; without arrays, which would take longer than all else."""
        size, place = len(data), self._first_place
        place[0, 0], place[1, 0], place[2, 0], place[3, 0] = self._numbers[topic], 0, 0, size
        if size > _MOST_BYTES:  # no message makes the memory larger
            return self._join_there(np.frombuffer(data, np.uint8), 1, clock)
        self._data[:size] = data
        return self._join_placed(1, clock)

    def join_messages(self, messages: Messages) -> Joined:
        """Join messages of these and other topics, in recorded order."""
        count = len(messages.times)
        if count > self._room:
            self._reserve_memory(count)
        numbers = np.array([self._numbers.get(topic, -1) for topic in messages.topics])
        self._places[:, :count] = (
            numbers[messages.of_topic], messages.times, messages.starts, messages.sizes)
        return self._join_there(messages.data, count, None)

    def _join_there(self, data: Bytes, count: int, clock: Clock | None) -> Joined:
        """Join messages whose places are in memory where their bytes are, without a copy."""
        self._data = data.data
        function('put_data')(self._memory, data)
        try:
            return self._join_placed(count, clock)
        finally:
            function('put_data')(self._memory, self._data_bytes)
            self._data = self._data_bytes.data  # also if `publish` has changed the memory

    def _join_placed(self, count: int, clock: Clock | None) -> Joined:
        """
        Join the messages in memory.

        clock: for stamps that are zero; None: these get the times of recording.
        """
        progress = self._progress
        progress[_COUNT], progress[_TIMED] = count, clock is None
        progress[_NEXT] = progress[_N_SETPOINTS] = progress[_N_BASES] = 0
        self._join()
        while progress[_STATUS] != _DONE or progress[_N_EVENTS]:
            self._report_events(clock is None)
            if progress[_STATUS] == _DONE:
                break
            if progress[_STATUS] == _CLOCK and clock is not None:
                self._places[1, :count], progress[_TIMED] = clock(), 1
            self._join()
        n, k = progress[_N_SETPOINTS], progress[_N_BASES]
        if n and self._answers is not None and not progress[_HELD]:
            self._publish_answers(n)
        return self._parts.get((n, k)) or _first_of(self._joined, n, k)

    def _report_events(self, recorded: bool, why: str = '') -> None:
        """Report what C has noted; whether the times of messages are those of recording."""
        for kind, number, stamp, last, n in self._events[:self._progress[_N_EVENTS]].tolist():
            self.recorded = int(self._places[1, n]) if recorded and n >= 0 else None
            reader = self._readers[number]
            topic = reader.topic
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
            elif kind in (_RESTART, _NOTICE_UNSTAMPED):
                text = jumped_back(last - stamp) if kind == _RESTART else (
                    f'{topic}: header stamps are zero: such samples are joined in order of '
                    'arrival and stamped with the clock')
                self._noticed(f'base: {text}' if number >= _BASE_TOPIC else text)
            else:
                start, size = self._places[2:, n].tolist()
                reader.reject_message(kind, bytes(self._data[start:start + size]))
        self._progress[_N_EVENTS] = 0
        self.recorded = None

    def drop_waiting(self, why: str, restart: bool = False) -> None:
        """
        Drop and count waiting samples, of setpoints and base.

        restart: samples of any time follow, none of the base is known, and the next setpoint is a
            restart.
        """
        for group in (_SETPOINTS, _BASE):
            function('end_stream')(self._memory, group, restart)
            self._report_events(False, why)

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


def _first_of(memory: Joined, n: int, k: int) -> Joined:
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
