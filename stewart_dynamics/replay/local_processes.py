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
Many bags in processes of this computer, which replay one bag at a time.

A process that dies costs only its bag. That bag is replayed again after all others and alone, so
that a lack of memory caused by others cannot end it a second time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
import multiprocessing
from multiprocessing import forkserver, parent_process, resource_tracker
import os
import signal
from threading import local, Lock, Thread
from typing import Any

from stewart_dynamics.errors import StewartError
from stewart_dynamics.replay.bag_task import (
    At, Cancelled, Ended, failed, finished, LOCAL_INTERVAL, replay_task, Results, Task)

_CONTEXT = multiprocessing.get_context('forkserver')
_CONTEXT.set_forkserver_preload(['stewart_dynamics.replay.one_bag'])


def replay_in_processes(tasks: Sequence[Task], jobs: int, at: At) -> Results:
    """Yield the outcome of each bag, as they end; StewartError if processes cannot start."""
    # The processes inherit the mask of the server: Ctrl-C ends this process, which ends them.
    # Starting the resource tracker later would lift the mask.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    processes = _Processes(tasks)
    try:
        died = []
        for task, ended in processes.replayed(tasks, jobs, at):
            if ended is None:
                died.append(task)
            else:
                yield task.number, ended
        for task, ended in processes.replayed(died, 1, at):
            yield task.number, ended or finished(task) or failed(
                task, 'the process that replayed it was killed twice (out of memory?)')
    finally:
        processes.close()


class _Processes:
    """
    Pools of one process each, so that the death of one does not break the others.

    The progress is in shared memory without a lock, which a process could take with it.
    """

    def __init__(self, tasks: Sequence[Task]) -> None:
        self._places = {task.number: 2 * n for n, task in enumerate(tasks)}
        self._counts: Any = _CONTEXT.RawArray('q', 2 * len(tasks))
        self._stopped: Any = _CONTEXT.RawValue('b')
        self._pools: list[ProcessPoolExecutor] = []
        self._of_thread = local()

    def replayed(self, tasks: Sequence[Task], jobs: int, at: At,
                 ) -> Iterator[tuple[Task, Ended | None]]:
        """Yield the outcome of each bag; None if its process has died."""
        with ThreadPoolExecutor(jobs) as threads:
            try:
                pending = {threads.submit(self._replay, task): task for task in tasks}
                while pending:
                    done, _ = wait(pending, LOCAL_INTERVAL, FIRST_COMPLETED)
                    for future, task in pending.items():
                        if future.running():
                            place = self._places[task.number]
                            at(task.number, *self._counts[place:place + 2])
                    for future in done:
                        yield pending.pop(future), future.result()
            except BaseException:
                self._stopped.value = 1
                threads.shutdown(cancel_futures=True)
                raise

    def _replay(self, task: Task) -> Ended | None:
        """Replay a bag in the process of this thread."""
        if not hasattr(self._of_thread, 'pool'):
            pool = ProcessPoolExecutor(1, _CONTEXT, _begin, (self._stopped, self._counts))
            self._pools.append(pool)
            try:
                pool.submit(os.getpid).result()
            except BrokenProcessPool:
                raise StewartError('the processes to replay bags could not start') from None
            self._of_thread.pool = pool
        place = self._places[task.number]
        self._counts[place:place + 2] = 0, 0
        try:
            ended: Ended = self._of_thread.pool.submit(_work, task, place).result()
        except BrokenProcessPool:
            del self._of_thread.pool
            return None
        return ended

    def close(self) -> None:
        """Stop the processes, and wait until they have removed their partial results."""
        self._stopped.value = 1
        for pool in self._pools:
            pool.shutdown()


# -- in a process ---------------------------------------------------------------------------------

_working = Lock()
_shared: list[Any] = []


def _begin(*shared: Any) -> None:
    """Keep the memory shared with the other process; end when that process has died."""
    def watch() -> None:
        parent = parent_process()
        assert parent is not None
        parent.join()
        _shared[0].value = 1
        with _working:
            os._exit(1)

    _shared[:] = shared
    Thread(target=watch, daemon=True).start()


def _work(task: Task, place: int) -> Ended:
    stopped, counts = _shared

    def progress(read: int, setpoints: int) -> None:
        if stopped.value:
            raise Cancelled
        counts[place] += read
        counts[place + 1] += setpoints

    with _working:
        return replay_task(task, progress)
