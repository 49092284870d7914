# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


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
import secrets
import shutil
import time
from typing import NamedTuple, Protocol

from stewart_dynamics.bags.find import METADATA, OUTPUT_BAG, RESULT
from stewart_dynamics.errors import BagError
from stewart_dynamics.whole_file import Identity, identity, locked, named

# The files by which folders of results are known, as RESULT is that of a replay.
IDENTIFICATION, DATASHEET, CALIBRATION = (
    'identification.json', 'datasheet.json', 'calibration.json')
CUEING, CUEING_PARAMETERS, MOTION_BAG = 'cueing.json', 'cueing.yaml', 'motion'
DESIGNED_MOTION, DESIGNED_POSES = 'trajectory.yaml', 'poses.csv'  # the same of designs

# Other files that the programs write there.
DATASHEET_PAGE, REPORT_PAGE = 'datasheet.html', 'report.html'
LEGS_CSV, LEGS_PARQUET, WORKSPACE = 'legs.csv', 'legs.parquet', 'workspace.csv'
IDENTIFIED_PARAMETERS, CALIBRATED_PARAMETERS = 'identified.yaml', 'calibrated.yaml'
WAY_THROUGH_POSES = 'trajectory.csv'
DATASHEETS, REPLAYS, IDENTIFIED, CALIBRATED, DESIGNED = (
    'datasheet', 'replayed', 'identified', 'calibrated', 'designed')
"""Folders of the results of the programs, and of a design, if no other is given."""

# Beginnings of the files by which folders are known: a file of the same name may be the user's.
_OF_DOCUMENT = re.compile(rb'\s*\{.{0,400}?"software":\s*"stewart_dynamics ', re.DOTALL)
_OF_DESIGNED_MOTION = re.compile(rb'# Designed to identify ')
_OF_DESIGNED_POSES = re.compile(rb'[^\n]*,x,y,z,qx,qy,qz,qw\r?\n')
_HEAD = 4096


class _Kind(NamedTuple):
    """A kind of folder of results."""

    name: str
    beginning: re.Pattern[bytes]  # of the file by which it is known
    files: set[str]  # all that the program writes there
    beside: str = ''  # another file that is always there

    def is_found(self, file: Path) -> bool:
        """Return whether a file is that by which such a folder is known."""
        try:
            with file.open('rb') as opened:
                head = opened.read(_HEAD)
        except OSError:
            return False
        return bool(self.beginning.match(head)) and (file.parent / self.beside).exists()


_KINDS = {
    RESULT: _Kind('replay results', _OF_DOCUMENT, {
        RESULT, REPORT_PAGE, LEGS_CSV, LEGS_PARQUET, OUTPUT_BAG,
        f'{OUTPUT_BAG}/{OUTPUT_BAG}.mcap', f'{OUTPUT_BAG}/{METADATA}'}),
    IDENTIFICATION: _Kind('results of an identification', _OF_DOCUMENT,
                          {IDENTIFICATION, IDENTIFIED_PARAMETERS, REPORT_PAGE}),
    DATASHEET: _Kind('a datasheet', _OF_DOCUMENT, {DATASHEET, DATASHEET_PAGE, WORKSPACE}),
    CALIBRATION: _Kind('results of a calibration', _OF_DOCUMENT,
                       {CALIBRATION, CALIBRATED_PARAMETERS, REPORT_PAGE}),
    CUEING: _Kind('results of motion cueing', _OF_DOCUMENT, {
        CUEING, CUEING_PARAMETERS, REPORT_PAGE, MOTION_BAG,
        f'{MOTION_BAG}/{MOTION_BAG}.mcap', f'{MOTION_BAG}/{METADATA}'}),
    DESIGNED_MOTION: _Kind('a designed motion', _OF_DESIGNED_MOTION, {DESIGNED_MOTION}),
    DESIGNED_POSES: _Kind('designed poses', _OF_DESIGNED_POSES,
                          {DESIGNED_POSES, WAY_THROUGH_POSES}, WAY_THROUGH_POSES)}

_REPLACED = '.replaced'
_SECONDS_TO_DIE, _LOOK = 5.0, 0.05
_PARTIAL = re.compile(
    rf'(\..+\.)([0-9a-f]{{32}}|one)\.partial\.\w{{8}}(?:{re.escape(_REPLACED)})?', re.DOTALL)


class Writing(Protocol):
    """Options of the program that writes the folder."""

    @property
    def force(self) -> bool:
        """Return whether existing results are replaced."""

    @property
    def run(self) -> str:
        """Return the identifier of the run."""


@contextmanager
def whole_folder(final: Path, options: Writing, result: str = RESULT,
                 before: Identity | None = None) -> Iterator[Path]:
    """
    Yield a folder that gets its final name only when it is complete.

    before: the existing results, as ``check_free`` has returned them. What another run has
        written since then is not replaced.
    """
    final.parent.mkdir(parents=True, exist_ok=True)
    partial = final.with_name(
        f'{_beginning(final)}{options.run or "one"}.partial.{secrets.token_hex(4)}')
    replaced = partial.with_name(f'{partial.name}{_REPLACED}')
    lock: int | None = None
    try:
        with named(final):
            lock = _make_and_lock(partial)
        yield partial
        # Existing results are kept until their replacement is complete.
        with locked(final.parent):
            if identity(final) is not None:
                check_free(final, options, result)
                if identity(final) != before:
                    raise BagError(f'{final}: another run has written it meanwhile: it is not '
                                   'replaced')
                final.rename(replaced)
            partial.rename(final)
    except Exception as exc:
        _name_final(exc, partial, final)
        raise
    finally:
        if os.path.lexists(replaced) and not os.path.lexists(final):
            replaced.rename(final)  # its replacement was not completed
        for left in (partial, replaced):
            if left.is_symlink():
                left.unlink()
            shutil.rmtree(left, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def _make_and_lock(partial: Path) -> int:
    """Make a folder, by the mask of this process, and return the descriptor that locks it."""
    while True:
        partial.mkdir(exist_ok=True)  # as long as that run removes it
        with suppress(FileNotFoundError):  # another run has removed it before it was locked
            lock = os.open(partial, os.O_RDONLY)
            if _try_to_lock(lock) is not False and partial.exists():
                return lock
            os.close(lock)


def _name_final(exc: Exception, partial: Path, final: Path) -> None:
    """Let an error name the folder by its final name, an error of writing as well."""
    exc.args = tuple(each.replace(partial.name, final.name) if isinstance(each, str) else each
                     for each in exc.args)
    if isinstance(exc, OSError):  # those of writing to an open file have no name
        exc.filename = str(exc.filename or final).replace(partial.name, final.name)


def _try_to_lock(descriptor: int) -> bool | None:
    """Return whether a folder is locked now; None where the file system has no locks."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def remove_abandoned(folders: Iterable[Path], ended: str = '') -> None:
    """
    Remove partial results of killed runs beside these folders.

    ended: identifier of a run that has ended: its partial results are removed as soon as
        its processes have died.
    """
    until = time.monotonic() + _SECONDS_TO_DIE
    finals: dict[Path, dict[str, Path]] = {}
    for final in folders:
        finals.setdefault(final.parent, {})[_beginning(final)] = final
    for parent, of_names in finals.items():
        # A folder is sorted before the results that it was to replace.
        for path in sorted(parent.iterdir()) if parent.is_dir() else ():
            found = _PARTIAL.fullmatch(path.name)
            if found and found[1] in of_names:
                final = of_names[found[1]]
                while (not _remove_if_abandoned(path, final) and found[2] == ended
                       and time.monotonic() < until):
                    time.sleep(_LOOK)


def _remove_if_abandoned(path: Path, final: Path) -> bool:
    """
    Remove partial results or restore the results they were to replace, unless in use.

    Returns whether it has done so.
    """
    partial = path.with_name(path.name.removesuffix(_REPLACED))
    owner = partial if partial.exists() else final
    try:
        descriptor = os.open(owner, os.O_RDONLY)
    except FileNotFoundError:
        with suppress(OSError):
            path.rename(final)
        return True
    try:
        if unused := bool(_try_to_lock(descriptor)):
            shutil.rmtree(path, ignore_errors=True)
        return unused
    finally:
        os.close(descriptor)


def _beginning(final: Path) -> str:
    # A long name would exceed the limit of the file system with the suffix.
    short = (final.name if len(os.fsencode(final.name)) < 120
             else hashlib.sha256(os.fsencode(final.name)).hexdigest())
    return f'.{short}.'


def check_free(folder: Path, options: Writing, result: str = RESULT) -> Identity | None:
    """
    Return the identity of existing results, None if there is nothing of this name.

    Raises BagError: results must not be written there.
    """
    found = identity(folder)
    if found is None:
        return None
    kind = _KINDS[result]
    if not kind.is_found(folder / result):
        raise BagError(f'{folder}: exists already and is not a folder of {kind.name}: it is not '
                       'replaced')
    if not options.force:
        raise BagError(f'{folder}: exists already; --force replaces results')
    for path in folder.rglob('*'):
        if path.relative_to(folder).as_posix() not in kind.files:
            raise BagError(f'{folder}: contains {path}, which is not part of {kind.name}: it is '
                           'not replaced')
    return found
