# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The files of a replay with an entry for each setpoint, and a process that writes them.

Assembling messages and formatting numbers take as long as computing them, and both hold Python's
global lock: large bags are therefore written by a process of its own. It reads blocks from its
standard input, and ends without completing the files when the replay is killed.
"""

from __future__ import annotations

from collections.abc import Sequence
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
from stewart_dynamics.replay.legs_table import kind_of_table
from stewart_dynamics.replay.output_bag import OutputBag, RecordedModel
from stewart_dynamics.replay.replay_options import Options
from stewart_dynamics.replay.summary import Answered
from stewart_dynamics.setpoints.output_messages import OutputMessages

_PROGRAM = ('import sys; sys.path[:] = sys.argv[1:]; '
            'from stewart_dynamics.replay.output_files import main; main()')
# About a block: one is computed while the one before is written.
_PIPE = 1 << 20

_model = lru_cache(maxsize=1)(RecordedModel)  # many bags have one hexapod


class OutputFiles:
    """
    The output bag and the table of a replay.

    quasi_static: velocities are not known: columns that depend on them are empty.
    inputs: topics of which the output bag has the recorded messages.
    """

    def __init__(self, folder: Path, parameters: Parameters, options: Options,
                 quasi_static: bool, inputs: Sequence[str]) -> None:
        model = _model(parameters, options.node.strip('/'))
        self._table = kind_of_table(options.parquet)(
            folder, parameters.leg_kind, parameters.joints, quasi_static,
            any(parameters[name] is not None for name in OF_JOINTS),
            parameters.limits.leg_clearance_min is not None,
            parameters[parameters.leg_kind.joint_force_limit] is not None)
        self._bag = OutputBag(folder / OUTPUT_BAG, options.node, OutputMessages(parameters), model,
                              parameters.visualization_rate, inputs)

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
        self._table.close()
        self._bag.abandon()


class OutputProcess:
    """Output files, by the same calls, that a process writes; its errors are raised here."""

    def __init__(self, folder: Path, parameters: Parameters, options: Options,
                 quasi_static: bool, inputs: Sequence[str]) -> None:
        self._folder = folder
        # A session of its own: Ctrl-C ends the replay, which ends the process.
        self._process = subprocess.Popen(
            [sys.executable, '-I', '-c', _PROGRAM, *sys.path], stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, start_new_session=True)
        assert self._process.stdin is not None and self._process.stdout is not None
        self._blocks, self._error = self._process.stdin, self._process.stdout
        with suppress(ImportError, OSError):  # other systems; too many large pipes
            from fcntl import F_SETPIPE_SZ, fcntl
            fcntl(self._blocks, F_SETPIPE_SZ, _PIPE)
        self._send((folder, parameters, options, quasi_static, inputs))

    def write(self, block: Answered) -> None:
        """Send setpoints; raises the error of earlier ones."""
        self._send(block)

    def write_inputs(self, recorded: Messages) -> None:
        """Send recorded messages of the inputs; raises the error of earlier ones."""
        self._send(recorded.compact())

    def close(self) -> None:
        """Complete the files."""
        self._send(None)
        self._end()

    def abandon(self) -> None:
        """End the process without completing the files."""
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
        files = OutputFiles(*pickle.load(blocks))
        while (block := pickle.load(blocks)) is not None:
            if isinstance(block, Messages):
                files.write_inputs(block)
            else:
                files.write(block)
        files.close()
    except (EOFError, pickle.UnpicklingError):
        pass  # the replay was killed
    except (StewartError, OSError) as exc:
        pickle.dump(exc, error)
    except Exception as exc:
        pickle.dump(StewartError(unexpected(exc)), error)
