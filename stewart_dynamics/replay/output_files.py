# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The files of a replay with an entry for each setpoint, and the processes that write them.

Assembling messages and formatting numbers take as long as computing them, and both hold Python's
global lock: output bag and table of a large bag are therefore written by a process each. It reads
blocks from its standard input, and ends without completing its file when the replay is killed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
import pickle
import subprocess
import sys
from typing import Any

from stewart_dynamics.bags.find import OUTPUT_BAG
from stewart_dynamics.errors import StewartError
from stewart_dynamics.mechanics.limits import OF_JOINTS
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.program import unexpected
from stewart_dynamics.replay.legs_table import kind_of_table, Table
from stewart_dynamics.replay.output_bag import OutputBag, RecordedModel
from stewart_dynamics.replay.replay_options import Options
from stewart_dynamics.replay.summary import Answered
from stewart_dynamics.setpoints.output_messages import OutputMessages

_PROGRAM = ('import sys; sys.path[:] = sys.argv[1:]; '
            'from stewart_dynamics.replay.output_files import main; main()')
# About a block: one is computed while the one before is written.
_PIPE = 1 << 20

_model = lru_cache(maxsize=1)(RecordedModel)  # many bags have one hexapod


def open_bag(folder: Path, parameters: Parameters, options: Options,
             inputs: Sequence[str]) -> OutputBag:
    """Return the output bag, with the recorded messages of these topics of inputs."""
    return OutputBag(folder / OUTPUT_BAG, options.node, OutputMessages(parameters),
                     _model(parameters, options.node.strip('/')), parameters.visualization_rate,
                     inputs)


def open_table(folder: Path, parameters: Parameters, options: Options,
               quasi_static: bool) -> Table:
    """Return the table; columns that depend on velocities are empty if these are not known."""
    return kind_of_table(options.parquet)(
        folder, parameters.leg_kind, parameters.joints, quasi_static,
        any(parameters[name] is not None for name in OF_JOINTS),
        parameters.limits.leg_clearance_min is not None,
        parameters[parameters.leg_kind.joint_force_limit] is not None)


class OutputFiles:
    """
    The output bag and the table of a replay.

    quasi_static: velocities are not known: columns that depend on them are empty.
    inputs: topics of which the output bag has the recorded messages.
    processes: each is written by a process, whose errors are raised by a later call.
    """

    def __init__(self, folder: Path, parameters: Parameters, options: Options,
                 quasi_static: bool, inputs: Sequence[str], processes: bool) -> None:
        table = folder, parameters, options, quasi_static
        bag = folder, parameters, options, inputs
        self._table = FileProcess(open_table, *table) if processes else open_table(*table)
        self._bag = FileProcess(open_bag, *bag) if processes else open_bag(*bag)

    def write(self, block: Answered) -> None:
        """Write setpoints."""
        self._bag.write(block)
        self._table.write(block)

    def write_inputs(self, recorded: Messages) -> None:
        """Write recorded messages of the inputs."""
        self._bag.write_inputs(recorded)

    def close(self) -> None:
        """Complete the files."""
        self._table.close()
        self._bag.close()

    def abandon(self) -> None:
        """Close the files without completing them."""
        self._table.abandon()
        self._bag.abandon()


class FileProcess:
    """
    An output bag or a table, by the same calls, that a process writes.

    open_file: opens it in the process, with these arguments, of which the first is the folder.
    """

    def __init__(self, open_file: Callable[..., OutputBag | Table], *arguments: Any) -> None:
        self._folder = arguments[0]
        # A session of its own: Ctrl-C ends the replay, which ends the process.
        self._process = subprocess.Popen(
            [sys.executable, '-I', '-c', _PROGRAM, *sys.path], stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, start_new_session=True)
        assert self._process.stdin is not None and self._process.stdout is not None
        self._blocks, self._error = self._process.stdin, self._process.stdout
        with suppress(ImportError, OSError):  # other systems; too many large pipes
            from fcntl import F_SETPIPE_SZ, fcntl
            fcntl(self._blocks, F_SETPIPE_SZ, _PIPE)
        self._send((open_file, arguments))

    def write(self, block: Answered) -> None:
        """Send setpoints; raises the error of earlier ones."""
        self._send(block)

    def write_inputs(self, recorded: Messages) -> None:
        """Send recorded messages of the inputs; raises the error of earlier ones."""
        self._send(recorded.compact())

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
    blocks, error = sys.stdin.buffer, sys.stdout.buffer
    try:
        open_file, arguments = pickle.load(blocks)
        file = open_file(*arguments)
        while (block := pickle.load(blocks)) is not None:
            if isinstance(block, Messages):
                file.write_inputs(block)
            else:
                file.write(block)
        file.close()
    except (EOFError, pickle.UnpicklingError):
        pass  # the replay was killed
    except (StewartError, OSError) as exc:
        pickle.dump(exc, error)
    except Exception as exc:
        pickle.dump(StewartError(unexpected(exc)), error)
