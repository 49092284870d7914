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

"""A thread that writes files while the next setpoints are computed."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

# Maximum number of calls that wait: blocks of some megabytes each.
_WAITING = 2


class WriterThread:
    """Makes calls in a thread of its own, in their order, until one of them raises an error."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1)
        self._calls: deque[Future[None]] = deque()

    def call(self, function: Callable[..., object], *arguments: Any) -> None:
        """Call a function as soon as earlier calls are done; raise the error of one of these."""
        if len(self._calls) == _WAITING:
            self._calls.popleft().result()
        before = self._calls[-1] if self._calls else None
        self._calls.append(self._thread.submit(_make, before, function, arguments))

    def finish(self) -> None:
        """Wait until all calls are done, and end the thread; raise the error of a call."""
        for call in self._calls:
            call.result()
        self._thread.shutdown()

    def abandon(self) -> None:
        """End the thread after the present call."""
        self._thread.shutdown(cancel_futures=True)


def _make(before: Future[None] | None, function: Callable[..., object],
          arguments: tuple[Any, ...]) -> None:
    if before is not None:
        before.result()  # its error ends the work
    function(*arguments)
