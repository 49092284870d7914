# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The files of a replay with an entry for each setpoint: the output bag and the table."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

from stewart_dynamics.bags.find import OUTPUT_BAG
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.replay.file_process import FileProcess
from stewart_dynamics.replay.legs_table import kind_of_table, LegsRows
from stewart_dynamics.replay.output_bag import OutputBag, RecordedModel
from stewart_dynamics.replay.replay_options import Options
from stewart_dynamics.replay.summary import Answered
from stewart_dynamics.setpoints.output_messages import OutputMessages

_model = lru_cache(maxsize=1)(RecordedModel)  # many bags have one hexapod


def open_bag(folder: Path, parameters: Parameters, options: Options,
             inputs: Sequence[str]) -> OutputBag:
    """Return the output bag, with the recorded messages of these topics of inputs."""
    return OutputBag(folder / OUTPUT_BAG, options.node, OutputMessages(parameters),
                     _model(parameters, options.node.strip('/')), parameters.visualization_rate,
                     inputs)


class OutputFiles:
    """
    The output bag and the table of a replay.

    quasi_static: velocities are not known: columns that depend on them are empty.
    inputs: topics of which the output bag has the recorded messages.
    processes: each is written by a process, whose errors are raised by a later call.
    """

    def __init__(self, folder: Path, parameters: Parameters, options: Options,
                 quasi_static: bool, inputs: Sequence[str], processes: bool) -> None:
        self._rows, table = LegsRows(parameters, quasi_static), kind_of_table(options.parquet)
        bag = folder, parameters, options, inputs
        self._table = FileProcess(table, folder, self._rows.names) if processes else table(
            folder, self._rows.names)
        try:
            self._bag = FileProcess(open_bag, *bag) if processes else open_bag(*bag)
        except BaseException:  # Ctrl-C as well
            self._table.abandon()
            raise

    def write(self, block: Answered) -> None:
        """Write setpoints."""
        self._bag.write(block)
        self._table.write(self._rows.of_block(block))

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
