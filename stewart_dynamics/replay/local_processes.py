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
Many bags in processes of this computer, by concurrent.futures.

A process that dies breaks its pool. The bags that were being replayed are then replayed alone,
each in a pool of its own, so that a bag that kills its process is found and affects no other; the
bags that waited are replayed in another pool.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
import multiprocessing
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
import os
import signal
import threading

from stewart_dynamics.errors import StewartError
from stewart_dynamics.replay.bag_task import (
    Cancelled, counted, Ended, failed, finished, LOCAL_INTERVAL, replay_task, Results, Task)
from stewart_dynamics.replay.progress_bar import ProgressBar

# Forked by a process that has imported the replay once and has no threads of ours: a fork of this
# process, which may have some, is not safe.
_CONTEXT = multiprocessing.get_context('forkserver')
_CONTEXT.set_forkserver_preload(['stewart_dynamics.replay.one_bag'])


def replay_in_processes(tasks: Sequence[Task], jobs: int, bar: ProgressBar) -> Results:
    """
    Yield the outcome of each bag, as they end.

    Parameters
    ----------
    tasks : sequence of Task
        In the order in which they are started.
    jobs : int
        Number of processes.
    bar : ProgressBar
        Shows the progress.

    Raises StewartError if processes cannot start.

    """
    waiting, suspects = list(tasks), list[Task]()
    while waiting:
        pool = _Pool(waiting, jobs, bar)
        yield from pool.results()
        suspects += pool.in_work
        waiting = [task for task in waiting
                   if task.number not in pool.ended and task not in pool.in_work]
    for task in suspects:
        pool = _Pool([task], 1, bar)
        yield from pool.results()
        if task.number not in pool.ended:
            yield task.number, finished(task) or failed(
                task, 'the process that replayed it was killed twice (out of memory?)')


class _Pool:
    """
    Processes that replay bags until all bags are done or a process dies.

    Attributes
    ----------
    ended : set of int
        Numbers of the bags that are done.
    in_work : list of Task
        Bags that had been started and were not done when a process died.

    """

    def __init__(self, tasks: Sequence[Task], jobs: int, bar: ProgressBar) -> None:
        self._tasks, self._bar = {task.number: task for task in tasks}, bar
        self._jobs = min(jobs, len(tasks))
        self._started: set[int] = set()
        self.ended: set[int] = set()

    @property
    def in_work(self) -> list[Task]:
        """Return the bags that were started and are not done."""
        return [self._tasks[number] for number in sorted(self._started - self.ended)]

    def results(self) -> Results:
        """Yield the outcome of bags; return when all are done or a process has died."""
        # Progress reports are short: each is written atomically, though processes share the pipe.
        progress, of_workers = _CONTEXT.Pipe(duplex=False)
        # When this end is closed, also by the death of this process, the others stop.
        until, kept_open = _CONTEXT.Pipe(duplex=False)
        with _uninterrupted():  # a semaphore would remain that nobody removes
            pool = ProcessPoolExecutor(
                self._jobs, _CONTEXT, initializer=_set_up, initargs=(of_workers, until))
        pending: dict[Future[Ended], int] = {}
        try:
            with _uninterrupted():
                for number, task in self._tasks.items():
                    pending[pool.submit(_work, task)] = number
            while pending:
                done, _ = wait(pending, LOCAL_INTERVAL, FIRST_COMPLETED)
                self._read(progress)
                for future in done:
                    number = pending.pop(future)
                    ended = future.result()
                    self.ended.add(number)
                    yield number, ended
        except BrokenProcessPool:
            self._read(progress)
            if not self._started:
                raise StewartError(
                    'the processes to replay bags could not start') from None
            for task in self.in_work:
                self._bar.at(task.number, 0, 0)
        finally:
            if pending:
                kept_open.close()
            pool.shutdown(cancel_futures=True)
            for connection in (progress, of_workers, until, kept_open):
                connection.close()

    def _read(self, progress: Connection) -> None:
        while progress.poll():
            number, read, setpoints = progress.recv()
            self._started.add(number)
            self._bar.at(number, read, setpoints)


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """
    Hold signals while processes are started, and block Ctrl-C in these: this process stops them.

    A process that is being started while an exception comes would be unknown to its pool.
    """
    held: list[int] = []
    handlers = {}
    if threading.current_thread() is threading.main_thread():
        # Other threads, as those of OpenBLAS, receive signals that this one blocks.
        handlers = {each: signal.signal(each, lambda number, _: held.append(number))
                    for each in (signal.SIGINT, signal.SIGTERM)}
    # Starting the resource tracker later would lift the block.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        for each, handler in handlers.items():
            signal.signal(each, handler)
        for number in held[:1]:
            signal.raise_signal(number)


# In the processes

_stopped = threading.Event()
_busy = threading.Lock()
_progress: Connection | None = None


def _set_up(progress: Connection, until: Connection) -> None:
    global _progress
    _progress = progress
    threading.Thread(target=_watch, args=(until,), daemon=True).start()


def _watch(until: Connection) -> None:
    """Wait for the end of the run; then exit, once the partial results are removed."""
    until.poll(None)
    _stopped.set()
    with _busy:
        os._exit(0)


def _work(task: Task) -> Ended:
    assert _progress is not None
    connection = _progress

    def send(*how_far: int) -> None:
        connection.send(how_far)

    report = counted(task.number, send, LOCAL_INTERVAL)

    def progress(read: int, setpoints: int) -> None:
        if _stopped.is_set():
            raise Cancelled
        report(read, setpoints)

    with _busy:
        send(task.number, 0, 0)
        return replay_task(task, progress)
