# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Many bags on a Dask cluster."""

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
    At, Cancelled, CLUSTER_INTERVAL, counted, Ended, failed, finished, replay_task, Replayed,
    STOPPED, Task)

# How long workers may take to remove partial results of a cancelled run [s].
_PATIENCE = 20.0

# In a worker: the cancelled runs, and the bags being replayed.
_cancelled: set[str] = set()
_in_work: set[tuple[str, int]] = set()


@contextmanager
def cluster(address: str, run: str, at: At) -> Iterator[Replayed]:
    """Yield a function that replays bags on the workers of a scheduler; an error cancels them."""
    dask = _dask()
    with _connected(dask, address) as client:
        client.subscribe_topic(run, lambda event: at(*event[1]))
        try:
            client.wait_for_workers(1, timeout=_PATIENCE)
        except (TimeoutError, asyncio.TimeoutError) as exc:
            raise StewartError(
                f'{address}: this scheduler had no worker within {_PATIENCE:g} s') from exc
        pending: dict[Any, Task] = {}

        def replayed(tasks: Sequence[Task]) -> Iterator[tuple[Task, Ended | None]]:
            for task in tasks:
                there = task._replace(bag=task.bag.absolute(), folder=task.folder.absolute())
                pending[client.submit(_on_worker, there, pure=False)] = task
            for future in dask.as_completed(list(pending), loop=client.loop):
                # A result is released at once: if the worker that holds it died, the bag would
                # be replayed again.
                task = pending.pop(future)
                try:
                    ended = future.result()
                except dask.KilledWorker:
                    ended = finished(task)
                except dask.CancelledError:  # by Dask; a cancelled run does not come back here
                    ended = finished(task) or failed(
                        task, 'the connection to the scheduler was lost')
                except Exception as exc:  # the connection may be lost
                    ended = finished(task) or failed(task, f'{type(exc).__name__}: {exc}')
                yield task, ended

        try:
            yield replayed
        except BaseException:
            client.cancel(list(pending))
            with suppress(Exception):  # a worker that died has nothing to remove
                client.run(_stop, run)
            raise


def _dask() -> Any:
    """Return the module distributed, which only a cluster needs."""
    try:
        return import_module('distributed')
    except ImportError as exc:
        raise StewartError('a Dask scheduler was named, but Dask cannot be imported: pip install '
                           f"'stewart_dynamics[cluster]' ({exc})") from exc


@contextmanager
def _connected(dask: Any, address: str) -> Iterator[Any]:
    """Yield a client whose loggers are silent: errors are reported for each bag in one line."""
    loggers = [logging.getLogger(name) for name in ('distributed', 'distributed.client')]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        try:
            # Tried first: a client that does not find the scheduler prints a traceback.
            asyncio.run(_answer(dask, address))
            client = dask.Client(address, timeout=_PATIENCE, set_as_default=False)
        except Exception as exc:
            raise StewartError(
                f'{address}: no Dask scheduler answers there: {one_line(exc)}') from exc
        with client:
            yield client
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


async def _answer(dask: Any, address: str) -> None:
    secrets = dask.Security().get_connection_args('client')
    comm = await dask.core.connect(
        dask.core.coerce_to_address(address), timeout=_PATIENCE, **secrets)
    comm.abort()


def _on_worker(task: Task) -> Ended:
    """Replay a bag in a thread of a worker."""
    worker, run = _dask().get_worker(), task.options.run
    report = counted(lambda *how_far: worker.log_event(run, (task.number, *how_far)),
                     CLUSTER_INTERVAL)

    def progress(read: int, setpoints: int) -> None:
        if run in _cancelled:
            raise Cancelled
        report(read, setpoints)

    _in_work.add((run, task.number))
    try:
        if run in _cancelled:  # after _in_work.add: _stop cancels first, then looks at _in_work
            return failed(task, STOPPED)
        return replay_task(task, progress)
    finally:
        _in_work.discard((run, task.number))


async def _stop(run: str) -> None:
    """Cancel a run in a worker; return when none of its bags is being replayed."""
    _cancelled.add(run)
    until = time.monotonic() + _PATIENCE
    while any(of == run for of, _ in tuple(_in_work)) and time.monotonic() < until:
        await asyncio.sleep(0.05)
