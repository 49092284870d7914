# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""One of many bags as a task for any process, and its outcome."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
import json
from pathlib import Path
import re
import time
from typing import NamedTuple

from stewart_dynamics.bags.find import OUTPUT_BAG, RESULT
from stewart_dynamics.errors import StewartError
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.program import BAD_INPUT, partly_read, unexpected
from stewart_dynamics.records import record_of
from stewart_dynamics.replay.bag_summary import BagSummary, VERSION
from stewart_dynamics.replay.index import Cell, row_of
from stewart_dynamics.replay.legs_table import kind_of_table
from stewart_dynamics.replay.one_bag import fingerprint, replay
from stewart_dynamics.replay.replay_options import code_of, Options
from stewart_dynamics.replay.summary_text import summary_text
from stewart_dynamics.reporting.results_folder import REPORT_PAGE

# Interval of progress reports, within one computer and on a cluster [s].
LOCAL_INTERVAL, CLUSTER_INTERVAL = 0.1, 1.0

STOPPED = 'the run was stopped'


class Ended(NamedTuple):
    """The outcome of one bag."""

    bag: Path
    folder: Path
    code: int
    row: dict[str, Cell]  # of fleet.csv
    text: str = ''  # the summary in the terminal; empty if the bag failed
    error: str = ''  # why it failed or was read in part, with its path
    kept: bool = False  # the results are those of an earlier run


class Task(NamedTuple):
    """A bag to be replayed, one of many."""

    number: int
    bag: Path
    folder: Path
    parameters: Parameters
    options: Options


At = Callable[[int, int, int], None]
"""Called with the number of a bag, its bytes read and its setpoints answered so far."""
Replayed = Callable[[Sequence[Task]], Iterator[tuple[Task, Ended | None]]]
"""Yields the outcome of each bag, as they end; None if the process that replayed it has died."""


class Cancelled(BaseException):
    """The user has stopped the run."""


def replay_task(task: Task, progress: Callable[[int, int], None]) -> Ended:
    """Replay a bag, unless this run has done so; errors are part of the outcome."""
    before = finished(task)
    if before is not None:
        return before
    try:
        done = replay(task.bag, task.parameters, task.folder, task.options, progress)
    except (StewartError, OSError) as exc:
        why = f'{exc}'
    except Cancelled:
        why = STOPPED
    except Exception as exc:  # an error in one bag does not stop the others
        why = unexpected(exc)
    else:
        return _outcome(task, done.summary)
    # A process that was believed dead may have finished it in the meantime.
    return finished(task) or failed(task, why)


def finished(task: Task) -> Ended | None:
    """Return the outcome of a bag that a process of this run finished before it died."""
    summary = _summary_of(task)
    return _outcome(task, summary) if summary and summary.run == task.options.run else None


def kept(task: Task) -> Ended | None:
    """Return the outcome of a bag whose results are there and whose inputs have not changed."""
    table = kind_of_table(task.options.parquet)
    files = [OUTPUT_BAG, table.FILE, *([REPORT_PAGE] if task.options.report else [])]
    summary = _summary_of(task)
    if summary is None or not all((task.folder / name).exists() for name in files):
        return None
    made_of = fingerprint(task.bag, task.parameters, task.options)
    if not made_of or summary.fingerprint != made_of:
        return None
    try:
        return _outcome(task, summary)._replace(kept=True)
    except (ArithmeticError, LookupError, TypeError, ValueError):
        return None  # its values are not those of a replay


def _summary_of(task: Task) -> BagSummary | None:
    """Return the content of summary.json; None if this version has not written one."""
    try:
        text = (task.folder / RESULT).read_text(encoding='utf-8')
        summary = record_of(BagSummary, json.loads(text), task.parameters.leg_kind)
        return summary if summary.version == VERSION and summary.fingerprint else None
    except (OSError, RecursionError, SystemError, ValueError):  # of another program, or spoiled
        return None


def _outcome(task: Task, summary: BagSummary) -> Ended:
    code = code_of(summary)
    missing = [' '.join(what.split()) for what in summary.missing]
    return Ended(task.bag, task.folder, code, row_of(code, summary, '; '.join(missing)),
                 summary_text(summary, task.parameters),
                 partly_read(task.bag, missing) if missing else '')


def failed(task: Task, why: str) -> Ended:
    """Return the outcome of a bag that could not be replayed."""
    why = ' '.join(why.split())
    return Ended(task.bag, task.folder, BAD_INPUT,
                 # The row has the path already.
                 row_of(BAD_INPUT, None, re.sub(rf'{re.escape(f"{task.bag}")}(: |/)', '', why)),
                 error=why if why.startswith(f'{task.bag}') else f'{task.bag}: {why}')


def counted(report: Callable[[int, int], None], every: float) -> Callable[[int, int], None]:
    """Return a function that sums up bytes and setpoints, and reports the sums at an interval."""
    read = setpoints = 0
    reported = time.monotonic()

    def progress(more_read: int, more_setpoints: int) -> None:
        nonlocal read, setpoints, reported
        read, setpoints = read + more_read, setpoints + more_setpoints
        now = time.monotonic()
        if now - reported >= every:
            reported = now
            report(read, setpoints)

    return progress
