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

from collections import deque
from collections.abc import Sequence
from contextlib import suppress
import multiprocessing
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from queue import SimpleQueue
import signal
from threading import Event, Thread

from stewart_dynamics.errors import StewartError
from stewart_dynamics.replay.bag_task import (
    At, Cancelled, counted, Ended, failed, finished, LOCAL_INTERVAL, replay_task, Results, Task)

# Forked by a process that has imported the replay once and has no threads of ours: a fork of this
# process, which may have some, is not safe.
_CONTEXT = multiprocessing.get_context('forkserver')
_CONTEXT.set_forkserver_preload(['stewart_dynamics.replay.one_bag'])


def replay_in_processes(tasks: Sequence[Task], jobs: int, at: At) -> Results:
    """
    Yield the outcome of each bag, as they end.

    Parameters
    ----------
    tasks : sequence of Task
        In the order in which they are started.
    jobs : int
        Number of processes.
    at : callable
        Called with the progress.

    Raises StewartError if processes cannot start.

    """
    # The processes inherit the mask of the server: Ctrl-C ends this process, which ends them.
    # Starting the resource tracker later would lift the mask.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    died: list[Task] = []
    yield from _side_by_side(tasks, jobs, at, died)
    for task in tuple(died):
        died.clear()
        yield from _side_by_side([task], 1, at, died)
        if died:
            yield task.number, finished(task) or failed(
                task, 'the process that replayed it was killed twice (out of memory?)')


def _side_by_side(tasks: Sequence[Task], jobs: int, at: At, died: list[Task]) -> Results:
    """Yield the outcome of each bag; append those whose process has died to ``died``."""
    waiting, idle = deque(tasks), list[Connection]()
    working: dict[Connection, Task] = {}
    processes: dict[Connection, BaseProcess] = {}
    try:
        while waiting or working:
            while waiting and len(working) < jobs:
                worker = idle.pop() if idle else _started(processes)
                working[worker] = waiting.popleft()
                with suppress(BrokenPipeError):  # it has died: found by the next call
                    worker.send(working[worker])
            for worker in set(working).intersection(wait(list(working))):
                task = working[worker]
                try:
                    message = worker.recv()
                except (EOFError, OSError):
                    died.append(working.pop(worker))
                    at(task.number, 0, 0)
                else:
                    if isinstance(message, Ended):
                        idle.append(worker)
                        yield working.pop(worker).number, message
                    else:
                        at(task.number, *message)
    finally:
        _end(processes)


def _started(processes: dict[Connection, BaseProcess]) -> Connection:
    """Start a process, and return the connection to it."""
    ours, its = _CONTEXT.Pipe()
    process = _CONTEXT.Process(target=_work, args=(its,))
    processes[ours] = process  # now, since an interrupt may come at any time
    try:
        process.start()
    finally:
        its.close()
    try:
        ours.recv()
    except (EOFError, OSError):
        raise StewartError('the processes to replay bags could not start') from None
    return ours


def _end(processes: dict[Connection, BaseProcess]) -> None:
    """Stop the processes, and wait until they have removed their partial results."""
    for connection in processes:
        with suppress(OSError):
            connection.send(None)
    for connection, process in processes.items():
        with suppress(EOFError, OSError):
            while True:
                connection.recv()
        connection.close()
        if process.pid is not None:
            process.join()


# In the processes

def _work(connection: Connection) -> None:
    """Replay bags until the other process sends None or has died."""
    tasks: SimpleQueue[Task | None] = SimpleQueue()
    stopped = Event()

    def receive() -> None:
        with suppress(EOFError, OSError):
            while (task := connection.recv()) is not None:
                tasks.put(task)
        stopped.set()
        tasks.put(None)

    def replayed(task: Task) -> Ended:
        report = counted(lambda *how_far: connection.send(how_far), LOCAL_INTERVAL)

        def progress(read: int, setpoints: int) -> None:
            if stopped.is_set():
                raise Cancelled
            report(read, setpoints)

        return replay_task(task, progress)

    Thread(target=receive, daemon=True).start()
    with suppress(BrokenPipeError):
        connection.send('ready')
        while (task := tasks.get()) is not None:
            connection.send(replayed(task))
