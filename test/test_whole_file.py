# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Files are written as a whole or not at all; only bounded regular files are read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import compileall
from contextlib import contextmanager
import json
import math
import os
from pathlib import Path
import resource
import stat
import sys
from typing import Any, NamedTuple

import numpy as np
from programs import call
import pytest
from referees import ROOT
from snapshot import Snapshot
from stewart_dynamics import ParameterError, Parameters, StewartError
from stewart_dynamics.arrays import Array
from stewart_dynamics.description.describe_command_line import main as describe
from stewart_dynamics.replay.index import write_fleet
from stewart_dynamics.replay.replay_command_line import main as replay
from stewart_dynamics.reporting.pages import page
from stewart_dynamics.reporting.results_folder import RESULT, whole_folder
from stewart_dynamics.whole_file import (
    FilesOfFolder, plain, read_text, to_json, write_files, write_json)

PLATFORM = ROOT / 'config' / 'platform.yaml'
FULL = 2000  # [bytes]


@contextmanager
def full_disk(room: int = FULL) -> Iterator[None]:
    """Let no file grow beyond ``room`` bytes: writing fails halfway, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    # Python would cut its own files, here and in the processes that compile.
    compileall.compile_dir(ROOT / 'stewart_dynamics', quiet=2)
    kept, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, hard))
    try:
        yield
    finally:
        sys.dont_write_bytecode = kept
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def contents(folder: Path) -> dict[str, str]:
    """Return the text of each file of a folder, hidden ones as well."""
    return {path.name: path.read_text(encoding='utf-8') for path in folder.iterdir()}


# Writing

@pytest.mark.parametrize('write, name', [
    (lambda folder: write_files({folder / 'a': 'x', folder / 'b': 'y' * 2 * FULL}), 'b'),
    (lambda folder: write_json(folder / 'a.json', ['x' * 2 * FULL]), 'a.json'),
    (lambda folder: Parameters.from_yaml(PLATFORM).to_yaml(folder / 'a.yaml'), 'a.yaml'),
    (lambda folder: write_fleet(folder, []), 'index.html')])
def test_on_a_full_disk_files_stay_as_they_were_and_the_error_names_one(
        tmp_path: Path, write: Callable[[Path], None], name: str) -> None:
    before = {'a': 'old', 'b': 'old', 'a.json': 'old', 'a.yaml': 'old', 'fleet.csv': 'old'}
    for each, text in before.items():
        (tmp_path / each).write_text(text)
    with full_disk(500 if name == 'a.yaml' else FULL), pytest.raises(
            (OSError, ParameterError)) as caught:
        write(tmp_path)
    assert f'{tmp_path / name}' in str(caught.value)
    assert contents(tmp_path) == before


def test_a_full_disk_leaves_no_partial_description(
        tmp_path: Path, capsys: pytest.CaptureFixture[str], snapshot: Snapshot) -> None:
    arguments = ['--params', f'{PLATFORM}', '--output', f'{tmp_path}']
    with full_disk():
        assert describe(arguments) == 2
    assert contents(tmp_path) == {}
    assert describe(arguments) == 0
    before = contents(tmp_path)
    assert set(before) == {
        'platform.urdf', 'platform.sdf', 'platform.xml', 'platform_scene.xml', 'platform.svg',
        'platform_loops.yaml'}
    capsys.readouterr()
    with full_disk():
        assert describe([*arguments, '--force', '--ros2-control', 'effort']) == 2
        assert describe([
            '--from', f'{tmp_path / "platform.urdf"}', '--output', f'{tmp_path / "read"}']) == 2
    said = capsys.readouterr().err.splitlines()
    snapshot(said[0])
    snapshot(said[-1])
    (tmp_path / 'read').rmdir()  # it is empty
    assert contents(tmp_path) == before


def test_a_replay_on_a_full_disk_keeps_the_results_that_were_there(
        tmp_path: Path, capsys: pytest.CaptureFixture[str], snapshot: Snapshot) -> None:
    arguments = [f'{ROOT / "bags" / "clear"}', '--params', f'{PLATFORM}', '--output',
                 f'{tmp_path / "out"}']
    with full_disk():
        assert replay(arguments) == 2
    assert not list((tmp_path / 'out').iterdir())
    assert replay(arguments) == 0
    before = {path: path.read_bytes() for path in tmp_path.rglob('*') if path.is_file()}
    capsys.readouterr()
    with full_disk():
        assert replay([*arguments, '--force']) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert f'{tmp_path / "out"}' in said
    snapshot(said)
    assert before == {path: path.read_bytes() for path in tmp_path.rglob('*') if path.is_file()}


def test_an_error_in_a_folder_of_results_names_the_file_by_its_final_path(tmp_path: Path) -> None:
    class Options:
        force = False
        run = 'one'

    for write in (lambda folder: write_json(folder / RESULT, 'x' * 2 * FULL),
                  lambda folder: (folder / RESULT).write_bytes(b'x' * 2 * FULL)):
        with full_disk(), pytest.raises(OSError, match='File too large') as caught, whole_folder(
                tmp_path / 'out', Options()) as folder:
            write(folder)
        assert str(caught.value.filename).startswith(f'{tmp_path / "out"}')
        assert list(tmp_path.iterdir()) == []


def test_a_replaced_file_keeps_its_mode_and_a_link_its_target(tmp_path: Path) -> None:
    target, link = tmp_path / 'target', tmp_path / 'link'
    target.write_text('old')
    target.chmod(0o640)
    link.symlink_to(target)
    write_files({link: 'new', tmp_path / 'other': b'\xff'})
    assert link.is_symlink()
    assert target.read_text() == 'new'
    assert stat.S_IMODE(target.stat().st_mode) == 0o640
    umask = os.umask(0)
    os.umask(umask)
    assert stat.S_IMODE((tmp_path / 'other').stat().st_mode) == 0o666 & ~umask
    assert (tmp_path / 'other').read_bytes() == b'\xff'


def test_a_folder_or_a_device_is_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / 'pipe')
    (tmp_path / 'folder').mkdir()
    for name, reason in (('pipe', 'not a regular file'), ('folder', 'Is a directory'),
                         ('no/where', 'No such file')):
        with pytest.raises(OSError, match=reason) as caught:
            write_files({tmp_path / 'new': 'x', tmp_path / name: 'x'})
        assert caught.value.filename == f'{tmp_path / name}'
    assert sorted(path.name for path in tmp_path.iterdir()) == ['folder', 'pipe']


# Reading

def test_a_regular_file_of_utf_8_is_read(tmp_path: Path, snapshot: Snapshot) -> None:
    file = tmp_path / 'file'
    file.write_bytes('\u00fc\r\n'.encode())
    assert read_text(file, 4, StewartError) == '\u00fc\r\n'
    with snapshot.raises(StewartError):
        read_text(file, 3, StewartError)


@pytest.mark.parametrize('content', [b'\xff\xfe\x00a', 'text'.encode('utf-16'), b'a: \xc3'])
def test_other_encodings_are_rejected(tmp_path: Path, content: bytes, snapshot: Snapshot) -> None:
    (tmp_path / 'file').write_bytes(content)
    with snapshot.raises(ParameterError):
        read_text(tmp_path / 'file', 100, ParameterError)


def test_pipes_and_devices_are_rejected_without_waiting(
        tmp_path: Path, snapshot: Snapshot) -> None:
    os.mkfifo(tmp_path / 'pipe')
    (tmp_path / 'link').symlink_to('/dev/zero')
    for path in (tmp_path / 'pipe', Path('/dev/zero'), tmp_path / 'link'):
        with snapshot.raises(ParameterError):
            read_text(path, 100, ParameterError)
    with snapshot.raises(ParameterError):
        read_text(tmp_path, 100, ParameterError)


def test_two_programs_at_once_never_lose_a_result(tmp_path: Path, snapshot: Snapshot) -> None:
    for replace in (False, True):
        first, second = (FilesOfFolder(tmp_path / 'out', replace) for _ in range(2))
        first.write({'a': 'first', 'b': 'first'})
        # without b: a name that is not shared is not written either
        with snapshot.raises(StewartError):
            second.write({'c': 'second', 'a': 'second'})
        assert contents(tmp_path / 'out') == {'a': 'first', 'b': 'first'}
    FilesOfFolder(tmp_path / 'out', True).write({'b': 'third'})
    assert contents(tmp_path / 'out') == {'a': 'first', 'b': 'third'}


def test_links_lead_to_no_file_outside_the_folder(tmp_path: Path, snapshot: Snapshot) -> None:
    folder = tmp_path / 'out'
    folder.mkdir()
    (tmp_path / 'mine').write_text('mine')
    (folder / 'platform.sdf').symlink_to(tmp_path / 'mine')
    (folder / 'platform.xml').symlink_to(tmp_path / 'nowhere')
    arguments = ['--params', f'{PLATFORM}', '--output', f'{folder}']
    snapshot(call(describe, *arguments, code=2).err)
    call(describe, *arguments, '--force')
    assert {path.name for path in tmp_path.iterdir()} == {'mine', 'out'}
    assert (tmp_path / 'mine').read_text() == 'mine'
    assert not any(path.is_symlink() for path in folder.iterdir())


def test_json_takes_numpy_scalars_and_arrays(tmp_path: Path) -> None:
    document = {'count': np.count_nonzero(np.ones(3)), 'flag': np.bool_(True), 'a': np.arange(2),
                'b': [np.float32(0.5), np.int64(3)], 'c': (np.float64(0.1), np.str_('x')),
                'd': None, 'e': np.eye(2), 'f': 'ä\udcff'}
    write_json(tmp_path / 'a.json', document)
    assert json.loads((tmp_path / 'a.json').read_text('utf-8')) == {
        'count': 3, 'flag': True, 'a': [0, 1], 'b': [0.5, 3], 'c': [0.1, 'x'], 'd': None,
        'e': [[1.0, 0.0], [0.0, 1.0]], 'f': 'ä\udcff'}
    assert to_json(document['a']) == '[0,1]'


def test_pages_take_numpy_scalars_and_arrays(tmp_path: Path) -> None:
    """A template gets plain numbers, wherever in its values an array stands."""
    (tmp_path / 'a.css').write_text('')
    (tmp_path / 'a.html').write_text(
        "{{ a|map('round', 1)|join(' ') }} {{ 'full' if b.c[0] else 'empty' }} "
        '{{ d.position|unique|list }} {{ e is true }} {{ f }} {{ g is mapping }}')
    found = Pair(np.array([2.0, 2.0]), np.float64(0.5))
    shown = page(tmp_path, 'a', a=np.array([0.11, 0.25]), b={'c': (np.zeros(2),)}, d=found,
                 e=np.bool_(True), f=[np.int64(3), np.float64(0.1)], g={np.int64(1): None})
    assert shown == '0.1 0.2 full [2.0] True [3, 0.1] True'
    assert plain(found) == Pair([2.0, 2.0], 0.5)  # type: ignore[arg-type]


class Pair(NamedTuple):
    """A result with an array."""

    position: Array
    angle: float


@pytest.mark.parametrize('value', [
    math.nan, np.float64(math.inf), np.float32(math.nan), np.array([[0.0, -math.inf]])])
def test_json_has_no_numbers_that_are_not_finite(tmp_path: Path, value: Any) -> None:
    with pytest.raises(ValueError, match='not JSON compliant'):
        write_json(tmp_path / 'a.json', {'a': [value]})
    assert not any(tmp_path.iterdir())
    with pytest.raises(TypeError, match='PosixPath is not JSON serializable'):
        to_json(tmp_path)
