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

"""Measured legs of a bag in windows: positions, rates if recorded, and efforts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, SECOND, Stamps
from stewart_dynamics.bags.recording import Recording
from stewart_dynamics.identification.windows import (
    FEWEST, period_of, segments, Signal, uniform, Window)
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.joint_state import FIELDS, JointStateReader, NUMBERS_END
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.replay.bag_topics import find_measured_legs

JOINT_STATE = type_names.JOINT_STATE
# Maximum number of samples in a window, so that it and its extract fit into memory.
_WINDOW = 1 << 16
_LEGS, _EFFORTS = 'legs', 'efforts'


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
        self._legs, self._efforts = _Buffer(), _Buffer()
        self._readers: dict[str, JointStateReader] = {}

    def windows(self, progress: Callable[[int], None] | None = None) -> Iterator[Window]:
        """Yield the windows; report the bytes read to ``progress``."""
        keys = {self._topics.legs: _LEGS} | ({} if self._one else {
            self._topics.efforts: _EFFORTS})
        for messages, size in self._recording.messages(keys):
            self._take(messages)
            if progress is not None:
                progress(size)
            while len(self._legs) > _WINDOW and (self._one or len(self._efforts) > FEWEST):
                yield from self._released(last=False)
        yield from self._released(last=True)
        for key, reader in self._readers.items():
            reader.check(f'{self._recording.path}: {getattr(self._topics, key)}')

    def _take(self, messages: Messages) -> None:
        for n, topic in enumerate(messages.topics):
            which = messages.of_topic == n
            if not which.any():
                continue
            starts, sizes = messages.starts[which], messages.sizes[which]
            if topic == _LEGS:
                if self.rates is None:
                    self.rates = self._has_rates(messages, starts[:1], sizes[:1])
                fields = ['position', *(['velocity'] if self.rates else []),
                          *(['effort'] if self._one else [])]
                stamps, values = self._read(_LEGS, fields, messages, starts, sizes)
                count = 12 if self.rates else 6
                self.samples += len(stamps)
                self._legs.add(stamps, values[:, :count], self.rejected)
                if self._one:
                    self._efforts.add(stamps, values[:, count:], Counter())
            else:
                stamps, values = self._read(_EFFORTS, ['effort'], messages, starts, sizes)
                self._efforts.add(stamps, values, self.rejected)

    def _has_rates(self, messages: Messages, starts: Stamps, sizes: Stamps) -> bool:
        reader = JointStateReader(self._joints, FIELDS if self._one else FIELDS[:2])
        stamps, _, _ = reader.read_many(messages.data, starts, sizes)
        return len(stamps) > 0

    def _read(self, key: str, fields: list[str], messages: Messages, starts: Stamps,
              sizes: Stamps) -> tuple[Stamps, Array]:
        reader = self._readers.setdefault(key, JointStateReader(self._joints, fields))
        stamps, values, rejected = reader.read_many(messages.data, starts, sizes)
        sound = (np.abs(values) < NUMBERS_END).all(axis=1) & (stamps > 0)
        self.rejected.update(rejected)
        if not sound.all():
            self.rejected['out of range or without a stamp'] += int(np.count_nonzero(~sound))
        return stamps[sound], values[sound]

    def _released(self, last: bool) -> Iterator[Window]:
        """Yield windows of the buffered samples, and keep those that the next one needs."""
        legs, efforts = self._legs.signal(), self._efforts.signal()
        if len(legs.stamps) < FEWEST or len(efforts.stamps) < FEWEST:
            self._legs.keep_from(int(legs.stamps[-1]) if len(legs.stamps) else 0)
            return
        if not self.period:
            self.period = period_of(legs.stamps)
        end = min(int(legs.stamps[-1]), int(efforts.stamps[-1]))
        for part in segments(legs.stamps, self.period):
            inner = Signal(legs.stamps[part], legs.values[part]).between(0, end)
            if len(inner.stamps) < FEWEST:
                continue
            pushes = efforts.between(
                int(inner.stamps[0]) - SECOND, int(inner.stamps[-1]) + SECOND)
            window = uniform(inner, pushes, self.period)
            if window is not None:
                yield window
        keep = end if last else end - round(self._overlap * SECOND)
        self._legs.keep_from(keep)
        self._efforts.keep_from(keep)


class _Buffer:
    """Samples in the order of their stamps; samples out of order are dropped."""

    def __init__(self) -> None:
        self._stamps: list[Stamps] = []
        self._values: list[Array] = []
        self._newest = -1

    def __len__(self) -> int:
        return sum(map(len, self._stamps))

    def add(self, stamps: Stamps, values: Array, rejected: Counter[str]) -> None:
        """Add samples; drop and count samples that are not newer than all before."""
        if not len(stamps):
            return
        before = np.maximum.accumulate(np.concatenate([[self._newest], stamps[:-1]]))
        rising = stamps > before
        if not rising.all():
            rejected['stamp not increasing'] += int(np.count_nonzero(~rising))
            stamps, values = stamps[rising], values[rising]
        if len(stamps):
            self._newest = int(stamps[-1])
            self._stamps.append(stamps)
            self._values.append(values)

    def signal(self) -> Signal:
        """Return all samples."""
        if not self._stamps:
            return Signal(np.empty(0, dtype=np.int64), np.empty((0, 6)))
        self._stamps, self._values = [np.concatenate(self._stamps)], [
            np.concatenate(self._values)]
        return Signal(self._stamps[0], self._values[0])

    def keep_from(self, stamp: int) -> None:
        """Drop samples before a stamp."""
        whole = self.signal()
        first = int(np.searchsorted(whole.stamps, stamp))
        self._stamps, self._values = [whole.stamps[first:]], [whole.values[first:]]
