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

"""Publishes the last of what is noted, at most at a rate, while somebody subscribes."""

from __future__ import annotations

from typing import Any


class PublisherAtRate:
    """
    Publishes the last of what is noted; ``_write`` makes its bytes.

    Parameters
    ----------
    publisher : Publisher, optional
        What publishes them; none: nothing is published.
    rate : float
        At most so many are published in a second [Hz].

    """

    def __init__(self, publisher: Any, rate: float) -> None:
        self._publisher = publisher
        self._period = 1.0 / rate if rate else 0.0
        self._due = 0.0
        self._unpublished: tuple[Any, ...] | None = None

    def publish_due(self, now: float) -> None:
        """Publish the last of what was noted if it is due and there is a subscriber."""
        if self._unpublished is None or self._publisher is None or now < self._due:
            return
        last = self._unpublished
        # A later subscriber gets nothing of an old setpoint.
        self._unpublished = None
        self._due = now + self._period
        if self._publisher.get_subscription_count():
            self._publisher.publish(self._write(*last))

    def _write(self, *last: Any) -> bytes:
        raise NotImplementedError
