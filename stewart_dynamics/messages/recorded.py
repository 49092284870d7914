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

"""Recorded messages as the replay passes them to ``setpoint_joining``."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Bytes, Integers, Stamps


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

    def places(self) -> dict[str, Integers]:
        """Return where the messages of each topic are, of those that have any."""
        found = ((topic, np.flatnonzero(self.of_topic == n))
                 for n, topic in enumerate(self.topics))
        return {topic: places for topic, places in found if len(places)}
