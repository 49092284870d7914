# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Many bags in processes of this computer, which replay one bag at a time."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
import multiprocessing
from multiprocessing import forkserver, parent_process, resource_tracker
import os
import signal
from threading import Event, Lock, Thread
import time
from typing import Any

from stewart_dynamics.errors import StewartError
from stewart_dynamics.replay.bag_task import (
    At, Cancelled, Ended, LOCAL_INTERVAL, replay_task, Replayed, Task)
from stewart_dynamics.signals import signals_wait

_CONTEXT = multiprocessing.get_context('forkserver')
_CONTEXT.set_forkserver_preload(['stewart_dynamics.replay.one_bag'])

# Raised where a process, or the server that starts it, was killed during the start.
_KILLED = BrokenProcessPool, EOFError, OSError
# Before each attempt to start a process [s]: a killed server refuses connections for some time
# before its end can be seen.
_PAUSES = 0.0, 0.2, 2.0


@contextmanager
def processes(jobs: int, at: At) -> Iterator[Replayed]:
    """Yield a function that replays bags, in a number of processes at most; then end these."""
    _start_server()
    stopped: Any = _CONTEXT.RawValue('b')
    # Bytes and setpoints of each process, without a lock, which a process could take with it.
    counts: Any = _CONTEXT.RawArray('q', 2 * jobs)
    pools: dict[int, ProcessPoolExecutor] = {}

    def submitted(n: int, task: Task) -> Future[Ended]:
        if n in pools:
            with suppress(BrokenProcessPool):  # it has been killed
                return pools[n].submit(_work, task)
        for pause in _PAUSES:
            if pause:
                time.sleep(pause)
                _start_server()
            # Pools of one process each: the death of one does not break the others.
            pools[n] = ProcessPoolExecutor(1, _CONTEXT, _begin, (stopped, counts, 2 * n))
            with suppress(*_KILLED):
                pools[n].submit(os.getpid).result()
                return pools[n].submit(_work, task)
        raise StewartError('the processes to replay bags could not start')

    def replayed(tasks: Sequence[Task]) -> Iterator[tuple[Task, Ended | None]]:
        waiting, idle = deque(tasks), deque(range(min(jobs, len(tasks))))
        running: dict[Future[Ended], tuple[Task, int]] = {}
        while waiting or running:
            while waiting and idle:
                task, n = waiting.popleft(), idle.popleft()
                counts[2 * n:2 * n + 2] = 0, 0
                running[submitted(n, task)] = task, n
                handle_signals()
            done, _ = wait(running, LOCAL_INTERVAL, FIRST_COMPLETED)
            handle_signals()
            for task, n in running.values():
                at(task.number, *counts[2 * n:2 * n + 2])
            for future in done:
                task, n = running.pop(future)
                idle.append(n)
                died = isinstance(future.exception(), BrokenProcessPool)
                yield task, None if died else future.result()

    # An exception between the start of a process and that of the thread which ends it would let
    # this process wait for it forever.
    with signals_wait() as handle_signals:
        try:
            yield replayed
        finally:
            stopped.value = 1
            for pool in pools.values():
                pool.shutdown()  # waits until partial results are removed


def _start_server() -> None:
    """Start the process that starts the others."""
    # They inherit its mask: what ends a group of processes ends this one, which ends the others
    # when their partial results are removed.
    # Starting the resource tracker later would lift the mask of SIGINT and SIGTERM.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
    try:
        resource_tracker.ensure_running()
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


# -- in a process ---------------------------------------------------------------------------------

_working = Lock()
_orphaned = Event()
_shared: list[Any] = []


def _begin(*shared: Any) -> None:
    """Keep the memory shared with the other process; end when that process has died."""
    def watch() -> None:
        parent = parent_process()
        assert parent is not None
        parent.join()
        _orphaned.set()  # this process alone: the shared flag would stop all others
        with _working:
            os._exit(1)

    _shared[:] = shared
    Thread(target=watch, daemon=True).start()


def _work(task: Task) -> Ended:
    stopped, counts, place = _shared

    def progress(read: int, setpoints: int) -> None:
        if stopped.value or _orphaned.is_set():
            raise Cancelled
        counts[place] += read
        counts[place + 1] += setpoints

    with _working:
        return replay_task(task, progress)
