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


"""One of many bags: replayed by whatever process it is given to, and what became of it."""

from __future__ import annotations

from collections.abc import Callable, Generator
import json
from pathlib import Path
import time
from typing import Any, NamedTuple

from stewart_dynamics.errors import StewartError
from stewart_dynamics.parameters import Parameters
from stewart_dynamics.replay.index import Cell, row_of
from stewart_dynamics.replay.one_bag import replay
from stewart_dynamics.replay.options import BAD_INPUT, code_of, Options

# Between two reports of progress [s]
SOON, NOW_AND_THEN = 0.1, 1.0


class Ended(NamedTuple):
    """What became of one bag."""

    bag: Path
    folder: Path
    code: int
    row: dict[str, Cell]
    """Of fleet.csv."""
    text: str = ''
    """What a person reads of it; empty where it failed or was found finished."""
    error: str = ''
    """Why it failed or was partly read; names it."""


class Task(NamedTuple):
    """A bag to be replayed, one of many."""

    number: int
    bag: Path
    folder: Path
    parameters: Parameters
    options: Options


Results = Generator[tuple[int, Ended], None, None]
"""The number of a bag and what became of it, as they end; closed, it stops all."""


class Cancelled(BaseException):
    """The run was stopped by its user."""


def replay_task(task: Task, progress: Callable[[int, int], None]) -> Ended:
    """Replay a bag, unless this run has done so; whatever goes wrong, say it in words."""
    before = finished(task)
    if before is not None:
        return before
    try:
        done = replay(task.bag, task.parameters, task.folder, task.options, progress)
    except (StewartError, OSError) as exc:
        why = f'{exc}'
    except (Exception, Cancelled) as exc:  # a fault of one bag is no reason to stop the others
        why = f'{type(exc).__name__}: {exc}'
    else:
        return _whole(task, done.code, done.summary, done.text)
    # One that was taken for dead may have finished it meanwhile.
    return finished(task) or failed(task, why)


def finished(task: Task) -> Ended | None:
    """Return what became of a bag that a process of this run has finished before it died."""
    try:
        summary = json.loads((task.folder / 'summary.json').read_text(encoding='utf-8'))
        if summary['run'] != task.options.run:
            return None
    except (OSError, ValueError, TypeError, KeyError):  # none, or not one of ours
        return None
    return _whole(task, code_of(summary), summary)


def _whole(task: Task, code: int, summary: dict[str, Any], text: str = '') -> Ended:
    missing = '; '.join(' '.join(what.split()) for what in summary['missing'])
    return Ended(task.bag, task.folder, code, row_of(code, summary, missing), text,
                 f'{task.bag}: part of it could not be read: {missing}' if missing else '')


def failed(task: Task, why: str) -> Ended:
    why = ' '.join(why.split())
    return Ended(task.bag, task.folder, BAD_INPUT,
                 row_of(BAD_INPUT, None, why.removeprefix(f'{task.bag}: ')),
                 error=why if why.startswith(f'{task.bag}') else f'{task.bag}: {why}')


def counted(number: int, tell: Callable[[int, int, int], None],
            every: float) -> Callable[[int, int], None]:
    """Return what sums up the progress of a bag and reports it, but not too often."""
    read = setpoints = 0
    told = time.monotonic()

    def progress(more_read: int, more_setpoints: int) -> None:
        nonlocal read, setpoints, told
        read, setpoints = read + more_read, setpoints + more_setpoints
        now = time.monotonic()
        if now - told >= every:
            told = now
            tell(number, read, setpoints)

    return progress
