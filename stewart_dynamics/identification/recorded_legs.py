# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Measured legs of a bag in windows: positions, rates if recorded, and efforts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, SECOND, Stamps
from stewart_dynamics.bags.feed import feed_subscribers, Subscription
from stewart_dynamics.bags.recording import Recording
from stewart_dynamics.identification.windows import (
    FEWEST, period_of, segments, Signal, uniform, Window)
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.joint_state import JointStateReader, NUMBERS_END
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.replay.bag_topics import find_measured_legs

JOINT_STATE = type_names.JOINT_STATE
# Maximum number of samples in a window, so that it and its extract fit into memory.
_WINDOW = 1 << 16
_LEGS, _EFFORTS = 'legs', 'efforts'
_NOTHING = Signal(np.empty(0, dtype=np.int64), np.empty((0, 6)))


class Topics(NamedTuple):
    """Topics of positions and efforts."""

    legs: str
    efforts: str


def find_topics(recording: Recording, node: str, measured: str | None, efforts: str | None,
                ) -> Topics:
    """
    Return the topics: the given one, the one with the usual name, or the only one of its type.

    Raises BagError if no such topic is found, or several.
    """
    if efforts is not None:
        recording.checked_topic(efforts, JOINT_STATE)
    legs = find_measured_legs(recording, node, measured, efforts or '')
    return Topics(legs, efforts or legs)


class RecordedLegs:
    """Reads the measured legs of a bag in windows that overlap by a time [s]."""

    def __init__(self, recording: Recording, topics: Topics, joints: tuple[str, ...],
                 overlap: float) -> None:
        self._recording, self._topics, self._overlap = recording, topics, overlap
        self._joints = joints
        self.rejected: Counter[str] = Counter()  # number of rejected messages by reason
        self.samples = 0  # number of positions used
        self.rates: bool | None = None  # whether rates are recorded
        self.period = 0.0  # sampling period [s], known after the first window
        self._one = topics.legs == topics.efforts
        self._read = dict.fromkeys((_LEGS, _EFFORTS), _NOTHING)
        self._readers: dict[str, JointStateReader] = {}

    def windows(self, progress: Callable[[int], None] | None = None) -> Iterator[Window]:
        """Yield the windows; report the bytes read to ``progress``."""
        topics = {_LEGS: self._topics.legs} | ({} if self._one else {
            _EFFORTS: self._topics.efforts})
        for size in feed_subscribers(self._recording, [
                Subscription({topic: key}, partial(self._read_states, key))
                for key, topic in topics.items()]):
            if progress is not None:
                progress(size)
            while len(self._read[_LEGS].stamps) > _WINDOW and (
                    self._one or len(self._read[_EFFORTS].stamps) > FEWEST):
                yield from self._released(last=False)
        yield from self._released(last=True)
        for key, reader in self._readers.items():
            reader.check(f'{self._recording.path}: {getattr(self._topics, key)}')

    def _read_states(self, key: str, messages: Messages) -> None:
        if key not in self._readers:
            self._readers[key] = self._reader(key, messages)
        stamps, values, _, rejected, _ = self._readers[key].read_states(messages)
        sound = (np.abs(values) < NUMBERS_END).all(axis=1) & (stamps > 0)
        self.rejected.update(rejected)
        if not sound.all():
            self.rejected['out of range or without a stamp'] += int(np.count_nonzero(~sound))
        if key == _LEGS:
            self.samples += int(np.count_nonzero(sound))
        self._read[key] = _extended(
            self._read[key], stamps[sound], values[sound], self.rejected)

    def _reader(self, key: str, messages: Messages) -> JointStateReader:
        """Return the reader of a topic; the first message shows whether rates are recorded."""
        if key == _EFFORTS:
            return JointStateReader(self._joints, ['effort'])
        efforts = ['effort'] if self._one else []
        reader = JointStateReader(self._joints, ['position', 'velocity', *efforts])
        self.rates = not reader.read_states(messages.chosen(slice(1))).rejected
        return reader if self.rates else JointStateReader(self._joints, ['position', *efforts])

    def _released(self, last: bool) -> Iterator[Window]:
        """Yield windows of the buffered samples, and keep those that the next one needs."""
        legs, efforts = self._read[_LEGS], self._read[_EFFORTS]
        if self._one:
            legs, efforts = (legs._replace(values=part)
                             for part in (legs.values[:, :-6], legs.values[:, -6:]))
        if len(legs.stamps) < FEWEST or len(efforts.stamps) < FEWEST:
            self._read[_LEGS] = self._read[_LEGS].part(slice(-1, None))
            return
        if not self.period:
            self.period = period_of(legs.stamps)
        end = min(int(legs.stamps[-1]), int(efforts.stamps[-1]))
        for part in segments(legs.stamps, self.period):
            inner = legs.part(part).between(0, end)
            if len(inner.stamps) < FEWEST:
                continue
            pushes = efforts.between(
                int(inner.stamps[0]) - SECOND, int(inner.stamps[-1]) + SECOND)
            window = uniform(inner, pushes, self.period)
            if window is not None:
                yield window
        keep = end if last else end - round(self._overlap * SECOND)
        self._read = {
            key: signal.part(slice(int(np.searchsorted(signal.stamps, keep)), None))
            for key, signal in self._read.items()}


def _extended(signal: Signal, stamps: Stamps, values: Array, rejected: Counter[str]) -> Signal:
    """Return a signal with more samples; drop and count those not newer than all before."""
    if len(signal.stamps):
        stamps = np.concatenate([signal.stamps, stamps])
        values = np.concatenate([signal.values, values])
    rising = np.diff(np.maximum.accumulate(stamps), prepend=0) > 0
    if not rising.all():
        rejected['stamp not increasing'] += int(np.count_nonzero(~rising))
    return Signal(stamps[rising], values[rising])
