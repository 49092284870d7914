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


"""The progress of many bags, as a line on stderr."""

from __future__ import annotations

from collections.abc import Sequence
import sys
import threading
import time

from stewart_dynamics.replay.bag_task import Ended
from tqdm import tqdm


class ProgressBar:
    """
    A line on stderr: bags, setpoints, their rate and the time left.

    The time left is estimated from bytes, since bags differ in size.

    Parameters
    ----------
    sizes : sequence of int
        Size of each bag [bytes]; zero if it need not be replayed.
    show : bool, optional
        None: only if stderr is a terminal.
    ended : int
        Number of bags that are done already.

    """

    def __init__(self, sizes: Sequence[int], show: bool | None, ended: int = 0) -> None:
        self._sizes = sizes
        self._read = [0] * len(sizes)
        self._setpoints = [0] * len(sizes)
        self._ended = ended
        self._lock = threading.Lock()  # Dask reports progress in another thread
        self._started = time.monotonic()
        self._line = tqdm(
            desc=self._words(), total=sum(sizes), file=sys.stderr,
            disable=True if not sum(sizes) else None if show is None else not show,
            dynamic_ncols=True, smoothing=0.1,
            bar_format='{percentage:3.0f}%|{bar}| {desc}, {remaining} left')

    def at(self, number: int, read: int, setpoints: int) -> None:
        """Show that these bytes and setpoints of a bag are done."""
        with self._lock:
            # Part of a bag may be read twice.
            read = min(read, self._sizes[number])
            more = read - self._read[number]
            self._read[number], self._setpoints[number] = read, setpoints
            self._line.set_description_str(self._words(), refresh=False)
            self._line.update(more)

    def end(self, number: int, ended: Ended) -> None:
        """Show that a bag is done."""
        self._ended += 1
        self.at(number, self._sizes[number], int(ended.row.get('setpoints') or 0))

    def _words(self) -> str:
        setpoints = sum(self._setpoints)
        passed = time.monotonic() - self._started
        rate = _short(setpoints / passed) if setpoints and passed else '?'
        return (f'{self._ended}/{len(self._sizes)} bags, {_short(setpoints)} setpoints, '
                f'{rate}/s')

    def close(self) -> None:
        """End the line."""
        self._line.refresh()
        self._line.close()


def _short(number: float) -> str:
    return f'{number:.0f}' if number < 1000 else tqdm.format_sizeof(number)
