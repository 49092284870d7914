# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Recorded messages in blocks, as bags are read."""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Bytes, Integers, Stamps
from stewart_dynamics.messages.layout import at_any_byte

_FIRST: Integers = np.zeros(1, np.int64)


class Messages(NamedTuple):
    """M recorded messages in the order of time, and the bytes that contain them."""

    topics: tuple[str, ...]  # names under which the topics were asked for
    of_topic: Integers  # (M,): index of the topic
    times: Stamps  # (M,): when each was recorded [ns]
    data: Bytes
    starts: Integers  # (M,): start of each in the data
    sizes: Integers  # (M,): length of each [bytes]

    @classmethod
    def from_bytes(cls, topics: tuple[str, ...], of_topic: Sequence[int], times: Sequence[int],
                   messages: Sequence[bytes]) -> Messages:
        """Join single messages."""
        sizes = np.array([len(message) for message in messages], dtype=np.int64)
        return cls(topics, np.array(of_topic, dtype=np.int64), np.array(times, dtype=np.int64),
                   np.frombuffer(bytearray(b''.join(messages)), dtype=np.uint8),
                   np.cumsum(sizes) - sizes, sizes)

    @classmethod
    def single(cls, topic: str, data: bytes) -> Messages:
        """Return one message of a topic."""
        return cls((topic,), _FIRST, _FIRST, np.frombuffer(data, np.uint8), _FIRST,
                   np.array([len(data)]))

    def chosen(self, which: Any) -> Messages:
        """Return some of the messages: a slice, or an index or a mask (M,)."""
        return self._replace(of_topic=self.of_topic[which], times=self.times[which],
                             starts=self.starts[which], sizes=self.sizes[which])

    def select_topics(self, names: Container[str]) -> Messages:
        """Return the messages of some topics."""
        which = np.array([topic in names for topic in self.topics])[self.of_topic]
        return self if which.all() else self.chosen(which)

    def compact(self) -> Messages:
        """Return the same messages with only their own bytes."""
        if self.data.size == self.sizes.sum():
            return self
        starts = np.cumsum(self.sizes) - self.sizes
        data = np.empty(self.sizes.sum(), dtype=np.uint8)
        for size in np.unique(self.sizes).tolist():
            which = self.sizes == size
            at_any_byte(data, size)[starts[which]] = at_any_byte(self.data, size)[
                self.starts[which]]
        return self._replace(data=data, starts=starts)

    def places_in_data(self) -> tuple[Bytes, Integers, Integers]:
        """Return data, starts and sizes as C takes them."""
        return self.data, np.ascontiguousarray(self.starts), np.ascontiguousarray(self.sizes)

    def bytes_of(self, n: int) -> bytes:
        """Return the bytes of a message."""
        return bytes(self.view_of(n))

    def view_of(self, n: int) -> memoryview:
        """Return the bytes of a message, however many, without a copy."""
        return self.data[self.starts[n]:self.starts[n] + self.sizes[n]].data

    def iterate_messages(self) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time and bytes of each message."""
        for topic, time, start, size in zip(
                self.of_topic.tolist(), self.times.tolist(), self.starts.tolist(),
                self.sizes.tolist(), strict=True):
            yield self.topics[topic], time, self.data[start:start + size].tobytes()

    def find_places(self) -> dict[str, Integers]:
        """Return the indices of the messages of each topic that has any."""
        places: dict[str, Integers] = {}
        for n, topic in enumerate(self.topics):
            if len(found := np.flatnonzero(self.of_topic == n)):
                places[topic] = (np.sort(np.concatenate([places[topic], found]))
                                 if topic in places else found)
        return places
