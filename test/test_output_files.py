# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The files of a replay with an entry for each setpoint, written in place and by processes."""

from __future__ import annotations

from pathlib import Path

import pytest
from snapshot import Snapshot
from stewart_dynamics.errors import ParameterError, StewartError
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.replay.file_process import FileProcess
from stewart_dynamics.replay.output_files import OutputFiles
from stewart_dynamics.replay.replay_options import Options
from test_legs_table import motions_of
from test_output_bag import answered, PARAMETERS, times_of, turning

PROGRAM = 'stewart_replay'

BLOCK = 100


def started(folder: Path, parameters: Parameters = PARAMETERS,
            processes: bool = True) -> OutputFiles:
    folder.mkdir(exist_ok=True)
    return OutputFiles(folder, parameters, Options(), False, [], processes)


def write_block(files: OutputFiles, first: int = 0) -> None:
    outputs = turning(BLOCK, first)
    files.write(answered(outputs, times_of(BLOCK, first), motions_of(BLOCK)))


def test_the_processes_write_the_same_files(tmp_path: Path) -> None:
    for processes in (False, True):
        files = started(tmp_path / f'{processes}', processes=processes)
        for first in range(0, 6 * BLOCK, BLOCK):
            write_block(files, first)
        files.close()
        files.abandon()  # closed before: nothing is left to do
    for name in ('legs.csv', 'bag/bag.mcap', 'bag/metadata.yaml'):
        content = tmp_path.joinpath('False', name).read_bytes()
        assert tmp_path.joinpath('True', name).read_bytes() == content
    rows = (tmp_path / 'False' / 'legs.csv').read_bytes()
    assert rows.count(b'\n') == 6 * BLOCK + 1
    assert b',,' in rows  # forces or base wrenches that are not known


class Broken:
    """A file whose writing fails in the way in which the blocks of a killed replay end."""

    def write(self, block: object) -> None:
        raise EOFError('in the file')

    def close(self) -> None:
        """Nothing is left to do."""


def open_broken(folder: Path) -> Broken:
    return Broken()


def test_an_end_of_file_in_the_file_is_not_the_end_of_the_replay(tmp_path: Path) -> None:
    file = FileProcess(open_broken, tmp_path)
    with pytest.raises(StewartError, match='EOFError: in the file'):
        file.write(None)
        file.close()
    file.abandon()


def test_errors_of_the_process_are_raised_here(tmp_path: Path, snapshot: Snapshot) -> None:
    (tmp_path / 'legs.csv').symlink_to('/dev/full')
    files = started(tmp_path)
    with pytest.raises(OSError, match='No space left on device'):
        while True:
            write_block(files)
    files.abandon()
    joints = (PARAMETERS['base_frame'], *PARAMETERS['joints'][1:])
    files = started(tmp_path / 'names', PARAMETERS.replaced({'joints': joints}))
    with snapshot.raises(ParameterError):
        files.close()


def test_a_process_that_is_killed_is_reported(
        tmp_path_factory: pytest.TempPathFactory, snapshot: Snapshot) -> None:
    for name in ('bag', 'table'):
        folder = tmp_path_factory.mktemp(name)
        files = started(folder)
        write_block(files)
        getattr(files, f'_{name}')._process.kill()
        with snapshot.raises(StewartError) as caught:
            files.close()
        assert f'{caught.value}'.startswith(f'{folder}: ')
        files.abandon()


def test_an_abandoned_process_completes_nothing(tmp_path: Path) -> None:
    files = started(tmp_path)
    write_block(files)
    files.abandon()
    assert not (tmp_path / 'bag' / 'metadata.yaml').exists()
