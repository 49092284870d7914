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

"""The folder of a bag's results, and the partial results of killed runs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import subprocess
import sys

import pytest
from referees import ROOT

from stewart_dynamics import (
    calibration, datasheet, description, export, identification, replay)
from stewart_dynamics.errors import BagError
from stewart_dynamics.replay.replay_options import Options
from stewart_dynamics.reporting.results_folder import (
    check_free, DATASHEET, remove_abandoned, whole_folder)

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


@pytest.mark.parametrize('main', [each.main for each in (
    calibration, datasheet, description, export, identification, replay)])
def test_an_empty_folder_is_not_the_current_one(
        main: Callable[[list[str]], int], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match='^2$'):
        main(['--output', ''])
    assert capsys.readouterr().err.endswith("error: argument --output: '': must name a folder\n")


@pytest.mark.parametrize('other', [
    'summary.json', 'flight/summary.json', 'identification.json', 'notes.txt'])
def test_files_of_others_are_not_replaced(tmp_path: Path, other: str) -> None:
    sheet = tmp_path / 'sheet'
    sheet.mkdir()
    for force in (False, True):  # --force is advised only where it helps
        with pytest.raises(BagError, match='is not a folder of a datasheet'):
            check_free(sheet, Options(force=force), DATASHEET)
    (sheet / DATASHEET).write_text('{"name": "mine"}')
    with pytest.raises(BagError, match='is not a folder of a datasheet'):
        check_free(sheet, Options(force=True), DATASHEET)
    (sheet / DATASHEET).write_text(OLD)
    check_free(sheet, Options(force=True), DATASHEET)
    (sheet / other).parent.mkdir(exist_ok=True)
    (sheet / other).touch()
    with pytest.raises(BagError, match=f'sheet: contains .*{other.partition("/")[0]}, which is '
                                       'not part of a datasheet: it is not replaced'):
        check_free(sheet, Options(force=True), DATASHEET)
