# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Programs run to their end: in the process of the test, or as installed, in one of their own."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
import io
import os
from pathlib import Path
import subprocess
import sys
from typing import NamedTuple

TIMEOUT = 300.0  # [s]


class Ended(NamedTuple):
    """The exit code and the output of a program that has ended."""

    code: object
    out: str
    err: str


def call(main: Callable[[list[str]], int], *arguments: object, code: int | None = 0) -> Ended:
    """Call the main function of a program with texts; its exit code must be this one, if any."""
    streams = [io.TextIOWrapper(io.BytesIO(), 'utf-8', write_through=True) for _ in range(2)]
    with redirect_stdout(streams[0]), redirect_stderr(streams[1]):
        try:
            ended: object = main([str(each) for each in arguments])
        except SystemExit as exc:
            ended = exc.code
    done = Ended(ended, *(each.buffer.getvalue().decode() for each in streams))
    assert code in (None, done.code), done
    return done


def run_program(
        program: str | Path, *arguments: object, code: int | None = 0,
        folder: Path | None = None, text: str | None = None, **environment: object) -> Ended:
    """
    Run a program in a process of its own.

    Parameters
    ----------
    program : str or Path
        Its file, or the name of a program that this Python or the computer has installed.
    arguments : object
        Its arguments, as texts.
    code : int, optional
        The exit code that it must have; any by None.
    folder : Path, optional
        Its working folder.
    text : str, optional
        Its input.
    environment : object
        Changes of the environment.

    """
    installed = Path(sys.executable).parent / program
    done = subprocess.run(
        [str(each) for each in (installed if installed.exists() else program, *arguments)],
        cwd=folder, input=text, capture_output=True, text=True, timeout=TIMEOUT, check=False,
        env=os.environ | {name: str(value) for name, value in environment.items()})
    assert code in (None, done.returncode), done
    return Ended(done.returncode, done.stdout, done.stderr)
