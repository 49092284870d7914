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

"""Machine code that is needed later: loaded ahead where it is on disk, else compiled meanwhile."""

from __future__ import annotations

from threading import Thread

from stewart_dynamics.compilation.entry_point import EntryPoint, prepare


class Preparation:
    """
    The functions of a task that may never come.

    Parameters
    ----------
    functions : EntryPoint
        What the task calls.

    """

    def __init__(self, *functions: EntryPoint) -> None:
        self._functions = functions
        self._thread: Thread | None = None
        self.ready = all(function.load() for function in functions)
        """Whether nothing has to be compiled any more."""

    def begin(self) -> None:
        """Have what is missing compiled; other threads run meanwhile."""
        if self._thread is None and not self.ready:
            self._thread = Thread(target=self._run, daemon=True)
            self._thread.start()

    def _run(self) -> None:
        try:
            prepare(self._functions)
        finally:  # what is not compiled runs uncompiled
            self.ready = True
