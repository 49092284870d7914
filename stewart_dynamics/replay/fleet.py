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
Many bags, each replayed on its own: on this machine or on a Dask cluster.

What happens to one bag is nothing to the others. A bag whose process dies is begun again; a run
has a name, kept in all its results, so that one that was finished just before is not taken for
somebody else's.
"""

from __future__ import annotations

import asyncio
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from importlib import import_module
import json
import logging
import multiprocessing
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
import os
from pathlib import Path
import shutil
import signal
import sys
import threading
import time
from typing import Any, NamedTuple
import uuid

from tqdm import tqdm

from stewart_dynamics.errors import BagError, one_line, StewartError
from stewart_dynamics.parameters import Parameters
from stewart_dynamics.replay.bags import bytes_of, FLEET_PAGE, FLEET_TABLE
from stewart_dynamics.replay.index import Cell, RESULTS, row_of, write_fleet
from stewart_dynamics.replay.one import (
    BAD_INPUT, code_of, DONE, LIMIT_MET, Options, partial_name, PARTLY_READ, replay)

_GRAVITY = (DONE, LIMIT_MET, PARTLY_READ, BAD_INPUT).index
_TRIES = 2
# Between two words of how far a bag is [s]
_SOON, _NOW_AND_THEN = 0.1, 1.0
# How long a cluster's workers may take to clear away what was cancelled [s]
_PATIENCE = 20.0


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


class Fleet(NamedTuple):
    """What became of all bags, in the order in which they were given."""

    ended: tuple[Ended, ...]

    def code(self, strict: bool) -> int:
        """Return the exit code, that of the gravest; a limit counts if it is strict."""
        codes = (each.code for each in self.ended)
        return max((code for code in codes if strict or code != LIMIT_MET), key=_GRAVITY,
                   default=DONE)

    def text(self) -> str:
        """Return how many bags ended how, and a line for every bag that is not whole."""
        number = Counter(each.code for each in self.ended)
        counts = ', '.join(f'{number[code]} {RESULTS[code]}'
                           for code in sorted(number, key=_GRAVITY))
        return '\n'.join([f'{len(self.ended)} bags: {counts}',
                          *(each.error for each in self.ended if each.error)])


class _Task(NamedTuple):
    number: int
    bag: Path
    folder: Path
    parameters: Parameters
    options: Options


def replay_fleet(
        bags: Sequence[tuple[Path, Path]], parameters: Parameters, output: Path,
        options: Options, jobs: int = 1, scheduler: str | None = None,
        show_progress: bool | None = None) -> Fleet:
    """
    Replay bags and write fleet.csv and index.html, a row for each bag.

    Parameters
    ----------
    bags : sequence of (Path, Path)
        Each with the folder of its results, as bags.folders_of_results gives them.
    parameters : Parameters
        The machine's.
    output : Path
        Where fleet.csv and index.html go.
    options : Options
        For every bag. ``run`` is set if it is empty.
    jobs : int
        How many processes; 1: this one.
    scheduler : str, optional
        Address of a Dask scheduler whose workers do it. They must have this package and find
        the bags and ``output`` under the same paths as this process.
    show_progress : bool, optional
        On stderr; by default where that is a terminal.

    Raises StewartError: fleet.csv or index.html exists already, or there is no such cluster.
    Whatever is wrong with a bag is in its row. KeyboardInterrupt ends all; bags that
    were finished by then keep their results.

    """
    for path in (output / FLEET_TABLE, output / FLEET_PAGE):
        if path.is_dir() or path.exists() and not options.force:
            raise BagError(f'{path}: exists already' + (
                ' and is a folder' if path.is_dir() else '; --force replaces results'))
    output.mkdir(parents=True, exist_ok=True)
    options = options._replace(run=options.run or uuid.uuid4().hex)
    tasks = [_Task(number, bag, folder, parameters, options)
             for number, (bag, folder) in enumerate(bags)]
    sizes = [bytes_of(task.bag) for task in tasks]
    # The largest first: else it may be the last, and all others wait for it alone.
    order = sorted(tasks, key=lambda task: -sizes[task.number])
    ended: dict[int, Ended] = {}
    try:
        with closing(_Bar(sizes, show_progress)) as bar, closing(
                _on_cluster(order, scheduler, bar) if scheduler is not None
                else _in_processes(order, min(jobs, len(tasks)), bar) if jobs > 1
                else _here(order, bar)) as results:
            for number, result in results:
                bag, folder = bags[number]
                ended[number] = result._replace(bag=bag, folder=folder)
                bar.end(number, result)
    finally:
        _clear_away(tasks, options.run)
    fleet = Fleet(tuple(ended[number] for number in range(len(tasks))))
    write_fleet(output, [_row(each, output) for each in fleet.ended])
    return fleet


def _row(ended: Ended, output: Path) -> dict[str, Cell]:
    results = None if ended.code == BAD_INPUT else Path(
        os.path.relpath(ended.folder, output)).as_posix()
    return {**ended.row, 'bag': str(ended.bag), 'results': results}


def _clear_away(tasks: Sequence[_Task], run: str) -> None:
    """Remove what processes that died, or were ended, have left behind."""
    begun: dict[Path, dict[str, Path]] = {}
    for task in tasks:
        begun.setdefault(task.folder.parent, {})[partial_name(task.folder, run)] = task.folder
    for parent, beginnings in begun.items():
        try:
            left = [path for path in parent.iterdir() if f'.{run}.' in path.name]
        except OSError:  # was never made
            continue
        for path in left:
            folder = next((folder for beginning, folder in beginnings.items()
                           if path.name.startswith(beginning)), None)
            if folder is None:
                continue
            if path.name.endswith('.replaced') and not folder.exists():
                path.rename(folder)  # what was to replace it was never whole
            else:
                shutil.rmtree(path, ignore_errors=True)


# One bag

def _replay_one(task: _Task, progress: Callable[[int, int], None]) -> Ended:
    """Replay a bag, unless this run has done so; whatever goes wrong, say it in words."""
    finished = _finished(task)
    if finished is not None:
        return finished
    try:
        done = replay(task.bag, task.parameters, task.folder, task.options, progress)
    except (StewartError, OSError) as exc:
        why = f'{exc}'
    except (Exception, _Cancelled) as exc:  # a fault of one bag is no reason to stop the others
        why = f'{type(exc).__name__}: {exc}'
    else:
        return _whole(task, done.code, done.summary, done.text)
    # One that was given up for dead may have gone on and finished it meanwhile.
    return _finished(task) or _failed(task, why)


def _finished(task: _Task) -> Ended | None:
    """Return what became of a bag that a process of this run has finished before it died."""
    try:
        summary = json.loads((task.folder / 'summary.json').read_text(encoding='utf-8'))
        if summary['run'] != task.options.run:
            return None
    except (OSError, ValueError, TypeError, KeyError):  # none, or not one of ours
        return None
    return _whole(task, code_of(summary), summary)


def _whole(task: _Task, code: int, summary: dict[str, Any], text: str = '') -> Ended:
    missing = '; '.join(' '.join(what.split()) for what in summary['missing'])
    return Ended(task.bag, task.folder, code, row_of(code, summary, missing), text,
                 f'{task.bag}: part of it could not be read: {missing}' if missing else '')


def _failed(task: _Task, why: str) -> Ended:
    why = ' '.join(why.split())
    return Ended(task.bag, task.folder, BAD_INPUT,
                 row_of(BAD_INPUT, None, why.removeprefix(f'{task.bag}: ')),
                 error=why if why.startswith(f'{task.bag}') else f'{task.bag}: {why}')


def _counted(number: int, tell: Callable[[int, int, int], None],
             every: float) -> Callable[[int, int], None]:
    """Return what adds up how far a bag is and tells it, but not too often."""
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


# How far all are

class _Bar:
    """
    A line on stderr: bags, setpoints, their rate and the time left.

    That is reckoned by bytes, as one bag may be as large as a thousand others.
    """

    def __init__(self, sizes: Sequence[int], show: bool | None) -> None:
        self._sizes = sizes
        self._read = [0] * len(sizes)
        self._setpoints = [0] * len(sizes)
        self._ended = 0
        self._lock = threading.Lock()  # Dask tells how far it is from a thread of its own
        self._begun = time.monotonic()
        self._line = tqdm(
            desc=self._words(), total=sum(sizes), disable=None if show is None else not show,
            file=sys.stderr, dynamic_ncols=True, smoothing=0.1,
            bar_format='{percentage:3.0f}%|{bar}| {desc}, {remaining} left')

    def at(self, number: int, read: int, setpoints: int) -> None:
        """Take it that so many bytes and setpoints of a bag are done."""
        with self._lock:
            # Part of it may be read twice, but not all of it is read before it has ended.
            read = min(read, self._sizes[number])
            more = read - self._read[number]
            self._read[number], self._setpoints[number] = read, setpoints
            self._line.set_description_str(self._words(), refresh=False)
            self._line.update(more)

    def end(self, number: int, ended: Ended) -> None:
        """Take it that a bag has ended."""
        self._ended += 1
        self.at(number, self._sizes[number], int(ended.row.get('setpoints') or 0))

    def _words(self) -> str:
        setpoints = sum(self._setpoints)
        passed = time.monotonic() - self._begun
        rate = _short(setpoints / passed) if setpoints and passed else '?'
        return (f'{self._ended}/{len(self._sizes)} bags, {_short(setpoints)} setpoints, '
                f'{rate}/s')

    def close(self) -> None:
        """End the line."""
        self._line.refresh()
        self._line.close()


def _short(number: float) -> str:
    return f'{number:.0f}' if number < 1000 else tqdm.format_sizeof(number)


# On this machine

_Results = Generator[tuple[int, Ended], None, None]
"""The number of a bag and what became of it, as they end; closed, it ends all."""


def _here(tasks: Sequence[_Task], bar: _Bar) -> _Results:
    for task in tasks:
        yield task.number, _replay_one(task, _counted(task.number, bar.at, _SOON))


class _Worker(NamedTuple):
    process: BaseProcess
    pipe: Connection

    @classmethod
    def started(cls) -> _Worker:
        # A process of its own from the start: what a fork takes along of threads is not safe.
        context = multiprocessing.get_context('spawn')
        pipe, its_end = context.Pipe()
        process = context.Process(target=_work, args=(its_end,), daemon=True)
        with _uninterrupted():
            process.start()
        its_end.close()
        return cls(process, pipe)


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Keep Ctrl-C from a process that is started: it goes to all, and this one ends the others."""
    # To start this one, which comes along with the first, would lift the block.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _work(pipe: Connection) -> None:
    """Replay the bags that come through a pipe until it is closed."""
    with suppress(EOFError, OSError):  # nobody is there any more
        pipe.send(None)
        while True:
            task = pipe.recv()
            pipe.send(_replay_one(task, _counted(
                task.number, lambda *how_far: pipe.send(how_far), _SOON)))


def _in_processes(tasks: Sequence[_Task], jobs: int, bar: _Bar) -> _Results:
    """Replay in processes, each with a pipe of its own: one that dies takes no other along."""
    waiting = deque(tasks)
    idle: list[_Worker] = []
    busy: dict[Any, tuple[_Worker, _Task]] = {}
    began: set[Any] = set()
    deaths: Counter[int] = Counter()
    try:
        while waiting or busy:
            while waiting and len(busy) < jobs:
                worker, task = idle.pop() if idle else _Worker.started(), waiting.popleft()
                busy[worker.pipe] = worker, task
                with suppress(OSError):  # has died: its pipe says so in a moment
                    worker.pipe.send(task)
            for pipe in wait(list(busy)):
                worker, task = busy[pipe]
                try:
                    told = worker.pipe.recv()
                except (EOFError, OSError):
                    del busy[pipe]
                    worker.pipe.close()
                    worker.process.join()
                    if pipe not in began and not _killed(worker.process):
                        # no other would come any farther
                        raise StewartError('a process that was to replay bags could not begin: '
                                           f'{_death(worker.process)}') from None
                    deaths[task.number] += 1
                    bar.at(task.number, 0, 0)
                    if deaths[task.number] < _TRIES:
                        waiting.append(task)  # last, when there may be more memory
                        continue
                    yield task.number, _finished(task) or _failed(
                        task, f'the process that replayed it died {_TRIES} times; the last one '
                        f'{_death(worker.process)}')
                    continue
                if told is None:
                    began.add(pipe)
                elif isinstance(told, Ended):
                    del busy[pipe]
                    idle.append(worker)
                    yield task.number, told
                else:
                    bar.at(*told)
    finally:
        for worker in [*idle, *(worker for worker, _ in busy.values())]:
            worker.pipe.close()
        for worker, _ in busy.values():
            worker.process.kill()
        for worker in [*idle, *(worker for worker, _ in busy.values())]:
            worker.process.join()


def _killed(process: BaseProcess) -> bool:
    return (process.exitcode or 0) < 0


def _death(process: BaseProcess) -> str:
    code = process.exitcode or 0
    if not _killed(process):
        return f'ended with exit code {code}'
    name = next((each.name for each in signal.Signals if each == -code), f'signal {-code}')
    return f'was killed by {name}' + (
        ' (was there too little memory?)' if name == 'SIGKILL' else '')


# On a cluster

class _Cancelled(BaseException):
    """The run was ended by its user."""


# Of a process of the cluster: the runs that were ended, and the bags that it has in hand.
_cancelled: set[str] = set()
_in_hand: set[tuple[str, int]] = set()


def _on_cluster(tasks: Sequence[_Task], address: str, bar: _Bar) -> _Results:
    """Replay on a cluster; it begins a bag again whose worker died."""
    run = tasks[0].options.run if tasks else ''
    dask = _dask()
    with _silent('distributed', 'distributed.client'), _connected(dask, address) as client:
        client.subscribe_topic(run, lambda event: bar.at(*event[1]))
        try:
            client.wait_for_workers(1, timeout=_PATIENCE)
        except (TimeoutError, asyncio.TimeoutError) as exc:
            raise StewartError(
                f'{address}: no worker has come to this scheduler in {_PATIENCE:g} s') from exc
        futures: dict[Any, _Task] = {}
        suspects: list[_Task] = []

        def submit(task: _Task, key: str) -> Any:
            future = client.submit(
                _on_worker, task._replace(bag=task.bag.absolute(), folder=task.folder.absolute()),
                key=f'stewart_replay-{run}-{key}', pure=False)
            futures[future] = task
            return future

        try:
            for future in dask.as_completed(
                    [submit(task, f'{task.number}') for task in tasks], loop=client.loop):
                # Let go of it here, or it would be done again when the worker that holds
                # its result dies.
                task = futures.pop(future)
                try:
                    yield task.number, _result(dask, future, task)
                except dask.KilledWorker:
                    suspects.append(task)
            # Bags that only waited for a worker that died count as if they had killed it: now
            # each shows alone what it does.
            for task in suspects:
                future = submit(task, f'{task.number}-alone')
                try:
                    ended = _result(dask, future, task)
                except dask.KilledWorker as exc:
                    ended = _failed(
                        task, 'the worker that replayed it died '
                        f'{_TRIES * (exc.allowed_failures + 1)} times; the last one was at '
                        f'{exc.last_worker.address} (was there too little memory?)')
                del futures[future]
                yield task.number, ended
        except BaseException:
            client.cancel(list(futures))
            with suppress(Exception):  # a worker that is gone has nothing to clear away
                client.run(_stop, run)
            raise


def _result(dask: Any, future: Any, task: _Task) -> Ended:
    """Return what became of a bag; raises KilledWorker."""
    try:
        ended: Ended = future.result()
    except Exception as exc:
        finished = _finished(task)
        if isinstance(exc, dask.KilledWorker) and finished is None:
            raise
        return finished or _failed(task, f'{type(exc).__name__}: {exc}')
    return ended


def _dask() -> Any:
    """Return the module distributed, which only a cluster needs."""
    try:
        return import_module('distributed')
    except ImportError as exc:
        raise StewartError('a Dask scheduler was named, but Dask cannot be imported: pip install '
                           f"'stewart_dynamics[cluster]' ({exc})") from exc


@contextmanager
def _silent(*names: str) -> Iterator[None]:
    """Keep loggers from saying, with a traceback, what is said of each bag in words."""
    loggers = [logging.getLogger(name) for name in names]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


@contextmanager
def _connected(dask: Any, address: str) -> Iterator[Any]:
    try:
        # Asked first if it is there: a client that does not find it prints what it thinks of that.
        asyncio.run(_answer(dask, address))
        client = dask.Client(address, timeout=_PATIENCE, set_as_default=False)
    except Exception as exc:
        why = one_line(exc)
        raise StewartError(f'{address}: no Dask scheduler answers there: {why}') from exc
    with client:
        yield client


async def _answer(dask: Any, address: str) -> None:
    secrets = dask.Security().get_connection_args('client')
    comm = await dask.core.connect(
        dask.core.coerce_to_address(address), timeout=_PATIENCE, **secrets)
    comm.abort()


def _on_worker(task: _Task) -> Ended:
    """Replay a bag in a thread of a worker."""
    worker, run = _dask().get_worker(), task.options.run

    tell = _counted(
        task.number, lambda *how_far: worker.log_event(run, how_far), _NOW_AND_THEN)

    def progress(read: int, setpoints: int) -> None:
        if run in _cancelled:
            raise _Cancelled
        tell(read, setpoints)

    _in_hand.add((run, task.number))
    try:
        return _replay_one(task, progress)
    finally:
        _in_hand.discard((run, task.number))


async def _stop(run: str) -> None:
    """End a run in a worker; return when it has let go of its bags."""
    _cancelled.add(run)
    until = time.monotonic() + _PATIENCE
    while any(of == run for of, _ in tuple(_in_hand)) and time.monotonic() < until:
        await asyncio.sleep(0.05)
