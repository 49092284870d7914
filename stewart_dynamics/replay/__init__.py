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

"""Replay of recorded bags: the node's outputs, summaries and reports; needs no ROS."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import os
import signal
import sys

_INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program stewart_replay; report a missing library in one line."""
    def program(given: Sequence[str] | None) -> int:
        from stewart_dynamics.replay.stewart_replay import main as run

        return run(given)

    return run_program('stewart_replay', program, arguments)


def run_program(name: str, program: Callable[[Sequence[str] | None], int],
                arguments: Sequence[str] | None) -> int:
    """
    Run a program that imports its libraries itself, and return its exit code.

    Without arguments, those of the command line, signals are ignored afterwards: the process ends.
    """
    def end_at_once(number: int, frame: object) -> None:
        """End while libraries are imported: numpy turns an exception into another one."""
        os.write(2, f'{name}: interrupted\n'.encode())
        os._exit(_INTERRUPTED)

    before = {each: signal.signal(each, end_at_once) for each in (signal.SIGINT, signal.SIGTERM)}
    try:
        return program(arguments)
    except ModuleNotFoundError as exc:
        print(f'{name}: needs {exc.name}: pip install {exc.name}', file=sys.stderr)
        return 2
    finally:
        for each, handler in before.items():
            signal.signal(each, signal.SIG_IGN if arguments is None else handler)
