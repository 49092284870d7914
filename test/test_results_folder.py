# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The folder of a bag's results, and the partial results of killed runs."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import stat
import subprocess
import sys

from programs import call
import pytest
from referees import ROOT
from snapshot import Snapshot

from stewart_dynamics import (
    calibration, datasheet, description, export, identification, replay)
from stewart_dynamics.errors import BagError, StewartError
from stewart_dynamics.replay.replay_options import Options
from stewart_dynamics.reporting.results_folder import (
    check_free, DATASHEET, DESIGNED_MOTION, DESIGNED_POSES, remove_abandoned, whole_folder)

PROGRAM = 'stewart_replay'

# Killed before the folder is complete, or between the two renames.
KILLED = """\
import os, pathlib, signal, sys
from stewart_dynamics.replay.replay_options import Options
from stewart_dynamics.reporting.results_folder import check_free, whole_folder
def rename(self, to):
    os.rename(self, to)
    os.kill(os.getpid(), signal.SIGKILL)
final, run, where = sys.argv[1:]
final, options = pathlib.Path(final), Options(force=True, run=run)
with whole_folder(final, options, before=check_free(final, options)) as folder:
    (folder / 'summary.json').write_text('{"software": "stewart_dynamics 2"}')
    if where == 'writing':
        os.kill(os.getpid(), signal.SIGKILL)
    pathlib.Path.rename = rename
"""
RUN = 32 * 'a'
OLD, NEW = (f'{{"version": 1, "software": "stewart_dynamics {n}"}}' for n in (1, 2))


def kill(final: Path, run: str, where: str) -> None:
    """Let a process be killed that writes a folder of results."""
    done = subprocess.run([sys.executable, '-c', KILLED, str(final), run, where], cwd=ROOT,
                          capture_output=True, timeout=300)
    assert done.returncode == -9, done.stderr


def names(folder: Path) -> set[str]:
    """Return the names in a folder."""
    return {path.name for path in folder.iterdir()}


def test_what_a_killed_run_left_is_removed(tmp_path: Path) -> None:
    bag, other = tmp_path / 'bag', tmp_path / 'other'
    for run in ('', RUN):
        kill(bag, run, 'writing')
    kill(other, RUN, 'writing')
    kept = {'.bag.txt', '.bag.one.partial', f'.bag.{RUN}.partial.12345678.txt', '.git'}
    for name in kept:
        (tmp_path / name).mkdir()
    with whole_folder(bag, Options(run=RUN)) as in_use:
        assert len(names(tmp_path)) == len(kept) + 4
        remove_abandoned([bag, tmp_path / 'nowhere' / 'bag'])
        assert in_use.is_dir()
        # partial results of another bag are kept
        assert len(names(tmp_path)) == len(kept) + 2
    remove_abandoned([bag, other])
    assert names(tmp_path) == kept | {'bag'}


def test_results_that_a_killed_run_was_replacing_are_put_back(tmp_path: Path) -> None:
    bag = tmp_path / 'bag'
    bag.mkdir()
    (bag / 'summary.json').write_text(OLD)
    kill(bag, RUN, 'replacing')
    assert len(names(tmp_path)) == 2
    assert not bag.exists()
    remove_abandoned([bag])
    assert names(tmp_path) == {'bag'}
    assert (bag / 'summary.json').read_text() == OLD


def test_results_are_replaced_while_another_run_begins(tmp_path: Path) -> None:
    bag = tmp_path / 'bag'
    with whole_folder(bag, Options()) as folder:
        (folder / 'summary.json').write_text(OLD)
    options = Options(force=True)
    with whole_folder(bag, options, before=check_free(bag, options)) as folder:
        (folder / 'summary.json').write_text(NEW)
        remove_abandoned([bag])
        # As between the renames, and after them.
        replaced = bag.rename(folder.with_name(f'{folder.name}.replaced'))
        remove_abandoned([bag])
        assert replaced.exists()
        folder.rename(bag)
        remove_abandoned([bag])
        assert replaced.exists()
        bag.rename(folder)
        replaced.rename(bag)
    assert names(tmp_path) == {'bag'}
    assert (bag / 'summary.json').read_text() == NEW


def write(folder: Path, text: str) -> None:
    """Write results that are known as such."""
    (folder / 'summary.json').write_text(text)


@pytest.mark.parametrize('force', [False, True])
def test_of_two_runs_at_once_one_is_rejected(tmp_path: Path, force: bool) -> None:
    bag, options = tmp_path / 'bag', Options(force=force)
    if force:
        with whole_folder(bag, Options()) as folder:
            write(folder, OLD)
    before = check_free(bag, options)
    with (pytest.raises(BagError, match='bag: (exists already; --force|another run has written)'),
          whole_folder(bag, options, before=before) as second):
        write(second, OLD)
        with whole_folder(bag, options, before=before) as first:
            write(first, NEW)
    assert names(tmp_path) == {'bag'}
    assert (bag / 'summary.json').read_text() == NEW


def test_a_link_to_nowhere_is_not_free(tmp_path: Path, snapshot: Snapshot) -> None:
    (tmp_path / 'bag').symlink_to(tmp_path / 'nowhere')
    with snapshot.raises(BagError):
        check_free(tmp_path / 'bag', Options(force=True))


def test_folders_have_the_rights_that_the_mask_of_the_process_leaves(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        with whole_folder(tmp_path / 'bag', Options()) as folder:
            write(folder, OLD)
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / 'bag').stat().st_mode) == 0o750
    assert stat.S_IMODE((tmp_path / 'bag' / 'summary.json').stat().st_mode) == 0o640


@pytest.mark.parametrize('error', [
    lambda path: StewartError(f'{path}: cannot be written'),
    lambda path: OSError(28, 'No space left', str(path)),
    lambda path: OSError(28, 'No space left'),
    lambda path: RuntimeError(f'{path.name} is odd')])
def test_no_error_has_the_name_of_the_partial_folder(
        tmp_path: Path, error: Callable[[Path], Exception]) -> None:
    with (pytest.raises((StewartError, OSError, RuntimeError)) as caught,
          whole_folder(tmp_path / 'bag', Options()) as folder):
        raise error(folder)
    assert 'partial' not in str(caught.value)
    assert 'bag' in str(caught.value)


@pytest.mark.parametrize('known, text', [
    (DESIGNED_MOTION, '/**:\n  ros__parameters:\n    motion.type: sine\n'),
    (DESIGNED_POSES, 'leg_1,leg_2,leg_3,leg_4,leg_5,leg_6,x,y,z,qx,qy,qz,qw\n')])
def test_a_file_of_the_user_with_the_name_of_a_design_is_not_replaced(
        tmp_path: Path, known: str, text: str, snapshot: Snapshot) -> None:
    (tmp_path / known).write_text(text)
    with snapshot.raises(BagError):
        check_free(tmp_path, Options(force=True), known)


@pytest.mark.parametrize('main', [each.main for each in (
    calibration, datasheet, description, export, identification, replay)])
def test_an_empty_folder_is_not_the_current_one(main: Callable[[list[str]], int]) -> None:
    assert call(main, '--output', '', code=2).err.endswith(
        "error: argument --output: '': must name a folder\n")


@pytest.mark.parametrize('other', [
    'summary.json', 'flight/summary.json', 'identification.json', 'notes.txt'])
def test_files_of_others_are_not_replaced(tmp_path: Path, other: str, snapshot: Snapshot) -> None:
    sheet = tmp_path / 'sheet'
    sheet.mkdir()
    for force in (False, True):  # --force is advised only where it helps
        with snapshot.raises(BagError):
            check_free(sheet, Options(force=force), DATASHEET)
    (sheet / DATASHEET).write_text('{"name": "mine"}')
    with snapshot.raises(BagError):
        check_free(sheet, Options(force=True), DATASHEET)
    (sheet / DATASHEET).write_text(OLD)
    check_free(sheet, Options(force=True), DATASHEET)
    (sheet / other).parent.mkdir(exist_ok=True)
    (sheet / other).touch()
    with snapshot.raises(BagError):
        check_free(sheet, Options(force=True), DATASHEET)
