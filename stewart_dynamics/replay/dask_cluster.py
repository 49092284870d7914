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


"""Many bags on a Dask cluster; a bag whose worker died is begun again."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
import logging
import time
from typing import Any

from stewart_dynamics.errors import one_line, StewartError
from stewart_dynamics.replay.bag_task import (
    Cancelled, counted, Ended, failed, finished, NOW_AND_THEN, replay_task, Results, Task)
from stewart_dynamics.replay.progress_bar import ProgressBar

_TRIES = 2
# How long a cluster's workers may take to clear away what was cancelled [s]
_PATIENCE = 20.0

# Of a process of the cluster: the runs that were ended, and the bags that it has in hand.
_cancelled: set[str] = set()
_in_hand: set[tuple[str, int]] = set()


def replay_on_cluster(
        tasks: Sequence[Task], address: str, bar: ProgressBar) -> Results:
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
        futures: dict[Any, Task] = {}
        suspects: list[Task] = []

        def submit(task: Task, key: str) -> Any:
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
                    ended = failed(
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


def _result(dask: Any, future: Any, task: Task) -> Ended:
    """Return what became of a bag; raises KilledWorker."""
    try:
        ended: Ended = future.result()
    except Exception as exc:
        done = finished(task)
        if isinstance(exc, dask.KilledWorker) and done is None:
            raise
        return done or failed(task, f'{type(exc).__name__}: {exc}')
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


def _on_worker(task: Task) -> Ended:
    """Replay a bag in a thread of a worker."""
    worker, run = _dask().get_worker(), task.options.run

    tell = counted(
        task.number, lambda *how_far: worker.log_event(run, how_far), NOW_AND_THEN)

    def progress(read: int, setpoints: int) -> None:
        if run in _cancelled:
            raise Cancelled
        tell(read, setpoints)

    _in_hand.add((run, task.number))
    try:
        return replay_task(task, progress)
    finally:
        _in_hand.discard((run, task.number))


async def _stop(run: str) -> None:
    """End a run in a worker; return when it has let go of its bags."""
    _cancelled.add(run)
    until = time.monotonic() + _PATIENCE
    while any(of == run for of, _ in tuple(_in_hand)) and time.monotonic() < until:
        await asyncio.sleep(0.05)
