# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A file of a replay that a process writes.

Assembling messages and formatting numbers take as long as computing them, and both hold Python's
global lock: output bag and table of a large bag are therefore written by a process each. It reads
blocks from its standard input, and ends without completing its file when the replay is killed. It
imports no more than its file needs.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
import pickle
import subprocess
import sys
from typing import Any, BinaryIO, TYPE_CHECKING

from stewart_dynamics.errors import StewartError
from stewart_dynamics.program import unexpected

if TYPE_CHECKING:
    from stewart_dynamics.messages.recorded import Messages

_PROGRAM = ('import sys; sys.path[:] = sys.argv[1:]; '
            'from stewart_dynamics.replay.file_process import main; main()')
# About a block: one is computed while the one before is written.
_PIPE = 1 << 20


class FileProcess:
    """
    An output bag or a table, by the same calls, that a process writes; it raises their errors.

    open_file: opens it in the process, with these arguments, of which the first is the folder.
    """

    def __init__(self, open_file: Callable[..., Any], *arguments: Any) -> None:
        self._folder = arguments[0]
        # A session of its own: Ctrl-C ends the replay, which ends the process.
        self._process = subprocess.Popen(
            [sys.executable, '-c', _PROGRAM, *sys.path], stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, start_new_session=True)
        assert self._process.stdin is not None and self._process.stdout is not None
        self._blocks, self._error = self._process.stdin, self._process.stdout
        with suppress(ImportError, OSError):  # other systems; too many large pipes
            from fcntl import F_SETPIPE_SZ, fcntl
            fcntl(self._blocks, F_SETPIPE_SZ, _PIPE)
        self._send((open_file, arguments))

    def write(self, block: Any) -> None:
        """Send setpoints; raises the error of earlier ones."""
        self._send(('write', block))

    def write_inputs(self, recorded: Messages) -> None:
        """Send recorded messages of the inputs; raises the error of earlier ones."""
        self._send(('write_inputs', recorded.compact()))

    def close(self) -> None:
        """Complete the file."""
        self._send(None)
        self._end()

    def abandon(self) -> None:
        """End the process without completing the file."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._blocks, self._error):
            with suppress(BrokenPipeError):
                pipe.close()

    def _send(self, what: Any) -> None:
        try:
            pickle.dump(what, self._blocks, protocol=5)
            self._blocks.flush()  # else the process waits for the end of a block until the next
        except BrokenPipeError:
            self._end()

    def _end(self) -> None:
        with suppress(BrokenPipeError):
            self._blocks.close()
        error = self._error.read()
        code = self._process.wait()
        if error:
            raise pickle.loads(error)
        if code:
            how = f'was ended by signal {-code}' if code < 0 else f'ended with code {code}'
            raise StewartError(
                f'{self._folder}: cannot be written: the process that writes it {how}')


def main() -> None:
    """Write the blocks of the standard input; an error goes to the standard output."""
    error = _error_of(sys.stdin.buffer)
    with suppress(BrokenPipeError), sys.stdout.buffer as end:  # the replay may have ended
        if error is not None:
            pickle.dump(error, end)


def _error_of(blocks: BinaryIO) -> Exception | None:
    """Write the blocks; return the error that ended it, if any."""
    try:
        open_file, arguments = _received(blocks)
        file = open_file(*arguments)
        while (call := _received(blocks)) is not None:
            method, block = call
            getattr(file, method)(block)
        file.close()
    except (StewartError, OSError) as exc:
        return exc
    except Exception as exc:
        return StewartError(unexpected(exc))
    return None


def _received(blocks: BinaryIO) -> Any:
    """Return what the replay sends; end the process where the replay was killed."""
    try:
        return pickle.load(blocks)
    except (EOFError, pickle.UnpicklingError):
        sys.exit(1)
