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
Log lines of repeated events: the first, one in five seconds, and the last.

It uses no ROS and no clock: callers pass the time.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

# Time without an event after which a series ends, and interval of the lines while it lasts [s].
SECONDS = 5.0


@dataclass
class _One:
    """A series that is not over."""

    text: str
    logged: float
    seen: float
    unlogged: int = 0
    number: int = 1


class Series:
    """The series of events, by their kind; times are seconds of a steady clock."""

    def __init__(self) -> None:
        self._of_kind: dict[Hashable, _One] = {}

    def add(self, kind: Hashable, text: str, now: float) -> str | None:
        """Return the line to log for one more event, None if it is too early for one."""
        one = self._of_kind.get(kind)
        if one is None:
            self._of_kind[kind] = _One(text, now, now)
            return text
        one.text, one.seen = text, now
        one.number += 1
        if now - one.logged < SECONDS:
            one.unlogged += 1
            return None
        before = f' (and {one.unlogged} before it)' if one.unlogged else ''
        one.logged, one.unlogged = now, 0
        return text + before

    def over(self, now: float) -> list[str]:
        """Return the lines of the series that are over: the last event of each, if not logged."""
        lines = []
        for kind, one in list(self._of_kind.items()):
            if now - one.seen >= SECONDS:
                del self._of_kind[kind]
                if one.unlogged:
                    lines.append(f'{one.text} (the last of {one.number})')
        return lines
