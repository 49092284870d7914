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

from collections.abc import Callable
from queue import SimpleQueue
from threading import Semaphore, Thread
from typing import Any

# Maximum number of calls that wait: blocks of some megabytes each.
_WAITING = 2


class WriterThread:
    """Makes calls in a thread of its own, in their order, until one of them raises an error."""

    def __init__(self) -> None:
        self._calls: SimpleQueue[Callable[[], object] | None] = SimpleQueue()
        self._free = Semaphore(_WAITING)
        self._error: BaseException | None = None
        self._abandoned = False
        self._thread = Thread(target=self._work, daemon=True)
        self._thread.start()

    def call(self, function: Callable[..., object], *arguments: Any) -> None:
        """Call a function as soon as earlier calls are done; raise the error of one of these."""
        self._free.acquire()
        self._raise()
        self._calls.put(lambda: function(*arguments))

    def finish(self) -> None:
        """Wait until all calls are done, and end the thread; raise the error of a call."""
        self._calls.put(None)
        self._thread.join()
        self._raise()

    def abandon(self) -> None:
        """End the thread after the present call."""
        self._abandoned = True
        self._calls.put(None)
        self._thread.join()

    def _work(self) -> None:
        while (call := self._calls.get()) is not None:
            if self._error is None and not self._abandoned:
                try:
                    call()
                except BaseException as exc:
                    self._error = exc
            self._free.release()

    def _raise(self) -> None:
        if self._error is not None:
            raise self._error
