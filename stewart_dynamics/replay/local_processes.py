# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
Many bags in processes of this computer, which replay one bag at a time.

Each process has a connection of its own. Where a process is killed, only its bag fails; a closed
connection stops a process, also where the one that started it was killed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
import multiprocessing
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
import signal
import time

from stewart_dynamics.errors import StewartError
from stewart_dynamics.replay.bag_task import (
    At, Cancelled, counted, Ended, LOCAL_INTERVAL, replay_task, Replayed, Task)
from stewart_dynamics.signals import signals_wait

_CONTEXT = multiprocessing.get_context('forkserver')
_CONTEXT.set_forkserver_preload(['stewart_dynamics.replay.one_bag'])

# Before each attempt to start a process [s]: a killed server refuses connections for some time
# before its end can be seen.
_PAUSES = 0.0, 0.2, 2.0


@contextmanager
def processes(jobs: int, at: At) -> Iterator[Replayed]:
    """Yield a function that replays bags, in a number of processes at most; then end these."""
    started: dict[Connection, BaseProcess] = {}

    def replayed(tasks: Sequence[Task]) -> Iterator[tuple[Task, Ended | None]]:
        waiting, idle, running = deque(tasks), deque[Connection](), dict[Connection, Task]()
        while waiting or running:
            while waiting and len(running) < jobs:
                connection = idle.popleft() if idle else _start(started)
                running[connection] = waiting.popleft()
                with suppress(OSError):  # killed: its end is received below
                    connection.send(running[connection])
                handle_signals()
            for connection in {*running}.intersection(wait(running, LOCAL_INTERVAL)):
                message = None
                with suppress(EOFError, OSError):  # killed
                    message = connection.recv()
                if isinstance(message, list):
                    at(running[connection].number, *message)
                    continue
                if message is not None:
                    idle.append(connection)
                yield running.pop(connection), message
            handle_signals()

    # Exceptions wait: none comes between the start of a process and the note of it.
    with signals_wait() as handle_signals:
        try:
            yield replayed
        finally:
            for connection in started:
                connection.close()
            for process in started.values():
                process.join()  # until partial results are removed


def _start(started: dict[Connection, BaseProcess]) -> Connection:
    """Start a process, note it, and return the connection to it."""
    for pause in _PAUSES:
        time.sleep(pause)
        ours, its = _CONTEXT.Pipe()
        process = _CONTEXT.Process(target=_work, args=(its,))
        with suppress(EOFError, OSError):  # it was killed, or the server
            _start_server()
            process.start()
            started[ours] = process
            its.close()
            ours.recv()  # it has begun
            return ours
    raise StewartError('the processes to replay bags could not start')


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


def _work(connection: Connection) -> None:
    """Replay the bags that come, in a process, until the connection is closed."""
    def report(*counts: int) -> None:
        try:
            connection.send([*counts])
        except OSError:
            raise Cancelled from None

    with suppress(EOFError, OSError):
        connection.send(None)
        while True:
            connection.send(replay_task(connection.recv(), counted(report, LOCAL_INTERVAL)))
