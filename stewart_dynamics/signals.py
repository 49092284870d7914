# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Signals that end the programs, and the start of those without ROS.

Until a program handles them, a signal ends Python in its own way: with a traceback, or without a
word. Therefore this module imports little, and whoever starts a program imports it alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
import os
import signal
import sys

BAD_INPUT, INTERRUPTED = 2, 130  # exit codes; the others are in program.py

_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def ending_signals() -> list[signal.Signals]:
    """Return the signals that end this process: SIGHUP not where nohup ignores it."""
    return [each for each in _ENDING
            if each != signal.SIGHUP or signal.getsignal(each) != signal.SIG_IGN]


def run_program(name: str, module: str, arguments: Sequence[str] | None) -> int:
    """
    Import a module, run its ``main``, and return the exit code; report a missing library.

    Without arguments, those of the command line, signals are ignored afterwards: the process ends.
    OpenBLAS, which numpy loads, gets one thread unless the environment says otherwise: the
    matrices are small, and its threads wait for each other on a busy computer.
    """
    def end_at_once(number: int, frame: object) -> None:
        """End while libraries are imported: numpy turns an exception into another one."""
        os.write(2, f'{name}: interrupted\n'.encode())
        os._exit(INTERRUPTED)

    before = {each: signal.signal(each, end_at_once) for each in ending_signals()}
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    try:
        code: int = import_module(module).main(arguments)
        return code
    except ModuleNotFoundError as exc:
        print(f'{name}: needs {exc.name}: pip install {exc.name}', file=sys.stderr)
        return BAD_INPUT
    finally:
        for each, handler in before.items():
            signal.signal(each, signal.SIG_IGN if arguments is None else handler)


def interrupt_on_signals() -> None:
    """From now on raise KeyboardInterrupt on the first signal that ends programs."""
    for each in ending_signals():
        signal.signal(each, _interrupted)


def _interrupted(number: int, frame: object) -> None:
    """Stop; further signals are ignored while partial results are removed."""
    for each in _ENDING:
        signal.signal(each, signal.SIG_IGN)
    raise KeyboardInterrupt


@contextmanager
def signals_wait() -> Iterator[Callable[[], None]]:
    """
    Yield a function that calls the handlers of the signals received since its last call.

    For what an exception in the middle would leave half done: files that take their names, and
    functions of libraries, which it would leave with a lock taken.
    """
    from threading import current_thread, main_thread

    received: list[int] = []

    def wait(number: int, frame: object) -> None:
        received.append(number)

    def handle() -> None:
        while received:
            handlers[number := received.pop()](number, None)

    # Only the main thread handles signals, and may change how.
    handled = _ENDING if current_thread() is main_thread() else ()
    handlers = {int(each): handler for each in handled
                if callable(handler := signal.getsignal(each))}
    for each in handlers:
        signal.signal(each, wait)
    try:
        yield handle
    finally:
        for each, handler in handlers.items():
            if signal.getsignal(each) is wait:
                signal.signal(each, handler)
        handle()
