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

A process that dies breaks its pool, and all bags that were in work are begun again: each of them
alone, in a pool of its own, so that one that kills its process shows what it does and takes no
other along; those that waited in another pool.
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
    Cancelled, counted, Ended, failed, finished, replay_task, Results, SOON, Task)
from stewart_dynamics.replay.progress_bar import ProgressBar

# A process of its own from the start: what a fork takes along of threads is not safe.
_CONTEXT = multiprocessing.get_context('spawn')


def replay_in_processes(tasks: Sequence[Task], jobs: int, bar: ProgressBar) -> Results:
    """
    Yield what became of each bag, as they end.

    Parameters
    ----------
    tasks : sequence of Task
        In the order in which they are begun.
    jobs : int
        How many processes there are.
    bar : ProgressBar
        Shown the progress.

    Raises StewartError where processes cannot start.

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
                task, 'the process that replayed it was killed, twice (was there too little '
                'memory?)')


class _Pool:
    """
    Processes that replay bags until all are done or one of the processes dies.

    Attributes
    ----------
    ended : set of int
        The bags that were done.
    in_work : list of Task
        Those that had been begun and were not done when a process died.

    """

    def __init__(self, tasks: Sequence[Task], jobs: int, bar: ProgressBar) -> None:
        self._tasks, self._bar = {task.number: task for task in tasks}, bar
        self._jobs = min(jobs, len(tasks))
        self._begun: set[int] = set()
        self.ended: set[int] = set()

    @property
    def in_work(self) -> list[Task]:
        """Return what was begun and not done."""
        return [self._tasks[number] for number in sorted(self._begun - self.ended)]

    def results(self) -> Results:
        """Yield what became of bags; return when all are done or a process has died."""
        # Words of progress are short: the pipe takes each as a whole, whoever writes.
        progress, of_workers = _CONTEXT.Pipe(duplex=False)
        # Closed, by this process or by its death, it tells the others to stop.
        until, kept_open = _CONTEXT.Pipe(duplex=False)
        pool = ProcessPoolExecutor(
            self._jobs, _CONTEXT, initializer=_set_up, initargs=(of_workers, until))
        pending: dict[Future[Ended], int] = {}
        try:
            with _uninterrupted():
                for number, task in self._tasks.items():
                    pending[pool.submit(_work, task)] = number
            while pending:
                done, _ = wait(pending, SOON, FIRST_COMPLETED)
                self._read(progress)
                for future in done:
                    number = pending.pop(future)
                    ended = future.result()
                    self.ended.add(number)
                    yield number, ended
        except BrokenProcessPool:
            self._read(progress)
            if not self._begun:
                raise StewartError('the processes that were to replay bags could not start') from (
                    None)
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
            self._begun.add(number)
            self._bar.at(number, read, setpoints)


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Keep Ctrl-C, which goes to all, from processes that are started: they are stopped by us."""
    # To start this one, which comes along with the first, would lift the block.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


# In the processes

_stopped = threading.Event()
_busy = threading.Lock()
_progress: Connection | None = None


def _set_up(progress: Connection, until: Connection) -> None:
    global _progress
    _progress = progress
    threading.Thread(target=_watch, args=(until,), daemon=True).start()


def _watch(until: Connection) -> None:
    """Wait for the end of the run; then stop, once a bag in work has been cleared away."""
    until.poll(None)
    _stopped.set()
    with _busy:
        os._exit(0)


def _work(task: Task) -> Ended:
    assert _progress is not None
    connection = _progress

    def tell(*how_far: int) -> None:
        connection.send(how_far)

    report = counted(task.number, tell, SOON)

    def progress(read: int, setpoints: int) -> None:
        if _stopped.is_set():
            raise Cancelled
        report(read, setpoints)

    with _busy:
        tell(task.number, 0, 0)
        return replay_task(task, progress)
