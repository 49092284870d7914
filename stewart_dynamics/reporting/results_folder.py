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


"""
The folder of a bag's results: it gets its name only when it is complete.

Until then it is locked. What a killed run leaves is not, by which the next run finds it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
import fcntl
import hashlib
import os
from pathlib import Path
import re
import shutil
import tempfile
from typing import Protocol

from stewart_dynamics.bags.find import METADATA, OUTPUT_BAG, RESULT
from stewart_dynamics.errors import BagError
from stewart_dynamics.whole_file import named

# The files by which folders of results are known, as RESULT is that of a replay.
IDENTIFICATION, DATASHEET, CALIBRATION = (
    'identification.json', 'datasheet.json', 'calibration.json')
DESIGNED_MOTION, DESIGNED_POSES = 'trajectory.yaml', 'poses.csv'  # the same of designs

# Other files that the programs write there.
DATASHEET_PAGE, REPORT_PAGE = 'datasheet.html', 'report.html'
LEGS_CSV, LEGS_PARQUET, WORKSPACE = 'legs.csv', 'legs.parquet', 'workspace.csv'
IDENTIFIED_PARAMETERS, CALIBRATED_PARAMETERS = 'identified.yaml', 'calibrated.yaml'
WAY_THROUGH_POSES = 'trajectory.csv'
DATASHEETS, REPLAYS, IDENTIFIED, CALIBRATED, DESIGNED = (
    'datasheet', 'replayed', 'identified', 'calibrated', 'designed')
"""Folders of the results of the programs, and of a design, if no other is given."""

# For the file by which a folder is known: the kind of folder, and all that a program writes there.
_KINDS = {
    RESULT: ('replay results', {
        RESULT, REPORT_PAGE, LEGS_CSV, LEGS_PARQUET, OUTPUT_BAG,
        f'{OUTPUT_BAG}/{OUTPUT_BAG}.mcap', f'{OUTPUT_BAG}/{METADATA}'}),
    IDENTIFICATION: ('results of an identification',
                     {IDENTIFICATION, IDENTIFIED_PARAMETERS, REPORT_PAGE}),
    DATASHEET: ('a datasheet', {DATASHEET, DATASHEET_PAGE, WORKSPACE}),
    CALIBRATION: ('results of a calibration', {CALIBRATION, CALIBRATED_PARAMETERS, REPORT_PAGE}),
    DESIGNED_MOTION: ('a designed motion', {DESIGNED_MOTION}),
    DESIGNED_POSES: ('designed poses', {DESIGNED_POSES, WAY_THROUGH_POSES})}

_REPLACED = '.replaced'
_PARTIAL = re.compile(
    rf'(\..+\.)(?:[0-9a-f]{{32}}|one)\.partial\.\w{{8}}(?:{re.escape(_REPLACED)})?', re.DOTALL)


class Writing(Protocol):
    """Options of the program that writes the folder."""

    @property
    def force(self) -> bool:
        """Return whether existing results are replaced."""

    @property
    def run(self) -> str:
        """Return the identifier of the run."""


@contextmanager
def whole_folder(final: Path, options: Writing, result: str = RESULT) -> Iterator[Path]:
    """Yield a folder that gets its final name only when it is complete."""
    final.parent.mkdir(parents=True, exist_ok=True)
    with named(final):
        partial, lock = _new_folder(final, options.run)
    replaced = partial.with_name(f'{partial.name}{_REPLACED}')
    try:
        yield partial
        partial.chmod(0o755)
        # Existing results are kept until their replacement is complete.
        if final.exists():
            check_free(final, options, result)
            final.rename(replaced)
        partial.rename(final)
    except OSError as exc:  # errors of writing to an open file have no name
        exc.filename = str(exc.filename or final).replace(str(partial), str(final))
        raise
    finally:
        if os.path.lexists(replaced) and not os.path.lexists(final):
            replaced.rename(final)  # its replacement was not completed
        for left in (partial, replaced):
            if left.is_symlink():
                left.unlink()
            shutil.rmtree(left, ignore_errors=True)
        os.close(lock)


def _new_folder(final: Path, run: str) -> tuple[Path, int]:
    """Return a folder for partial results, and the descriptor that locks it."""
    while True:
        partial = Path(tempfile.mkdtemp(
            prefix=f'{_beginning(final)}{run or "one"}.partial.', dir=final.parent))
        try:
            lock = os.open(partial, os.O_RDONLY)
        except FileNotFoundError:  # another run has removed it before it was locked
            continue
        if _try_to_lock(lock) is not False and partial.exists():
            return partial, lock
        os.close(lock)


def _try_to_lock(descriptor: int) -> bool | None:
    """Return whether a folder is locked now; None where the file system has no locks."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def remove_abandoned(folders: Iterable[Path]) -> None:
    """Remove partial results of killed runs beside these folders."""
    finals: dict[Path, dict[str, Path]] = {}
    for final in folders:
        finals.setdefault(final.parent, {})[_beginning(final)] = final
    for parent, of_names in finals.items():
        # A folder is sorted before the results that it was to replace.
        for path in sorted(parent.iterdir()) if parent.is_dir() else ():
            found = _PARTIAL.fullmatch(path.name)
            if found and found[1] in of_names:
                _remove_if_abandoned(path, of_names[found[1]])


def _remove_if_abandoned(path: Path, final: Path) -> None:
    """Remove partial results or restore the results they were to replace, unless in use."""
    partial = path.with_name(path.name.removesuffix(_REPLACED))
    locked = partial if partial.exists() else final
    try:
        descriptor = os.open(locked, os.O_RDONLY)
    except FileNotFoundError:
        with suppress(OSError):
            path.rename(final)
        return
    try:
        if _try_to_lock(descriptor):
            shutil.rmtree(path, ignore_errors=True)
    finally:
        os.close(descriptor)


def _beginning(final: Path) -> str:
    # A long name would exceed the limit of the file system with the suffix.
    short = (final.name if len(os.fsencode(final.name)) < 120
             else hashlib.sha256(os.fsencode(final.name)).hexdigest())
    return f'.{short}.'


def check_free(folder: Path, options: Writing, result: str = RESULT) -> None:
    """Raise BagError if results must not be written there."""
    if not folder.exists():
        return
    kind, files = _KINDS[result]
    if not (folder / result).is_file():
        raise BagError(f'{folder}: exists already and is not a folder of {kind}: it is not '
                       'replaced')
    if not options.force:
        raise BagError(f'{folder}: exists already; --force replaces results')
    for path in folder.rglob('*'):
        if path.relative_to(folder).as_posix() not in files:
            raise BagError(f'{folder}: contains {path}, which is not part of {kind}: it is not '
                           'replaced')
