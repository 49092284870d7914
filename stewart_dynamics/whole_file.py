# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Files of others, read within a bound, and files written as a whole or not at all."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import datetime, timezone
import errno
import fcntl
import json
import os
from pathlib import Path
import secrets
import stat
from typing import Any

from stewart_dynamics.errors import shown, StewartError
from stewart_dynamics.signals import signals_wait


def read_text(path: str | Path, largest: int, error: type[StewartError],
              check: Callable[[Any, bytes], None] | None = None) -> str:
    """
    Return the text of a regular file of UTF-8.

    path: the file; a pipe or a device is rejected without waiting for it.
    largest: largest size [bytes].
    check: is called with path and bytes before they are decoded, to reject them.
    Raises StewartError: in one line: the file cannot be read, is too large or is not UTF-8.
    """
    try:
        with open(os.fspath(path), 'rb', opener=_without_waiting) as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise OSError(errno.EINVAL, 'not a regular file')
            data = file.read(largest + 1)
    except OSError as exc:
        raise error(f'{path}: cannot be read: {exc.strerror}') from exc
    except (TypeError, ValueError) as exc:
        raise error(f'{shown(str(path))}: cannot be read: {exc}') from exc
    if len(data) > largest:
        raise error(f'{path}: larger than {largest} bytes')
    if check is not None:
        check(path, data)
    try:
        return data.decode('utf-8')
    except UnicodeDecodeError as exc:
        raise error(f'{path}: cannot be read: not UTF-8 text') from exc


def _without_waiting(path: str, flags: int) -> int:
    """Open a file; a pipe without waiting for its writer."""
    return os.open(path, flags | os.O_NONBLOCK)


Identity = tuple[int, int, int]
"""Device, number and time of modification [ns]: of another file of the name they differ."""


def identity(path: Path) -> Identity | None:
    """Return the identity of a file, folder or link; None if there is no such name."""
    try:
        found = path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return None
    return found.st_dev, found.st_ino, found.st_mtime_ns


class FilesOfFolder:
    """
    The files that a program adds to a folder, in which there may be others.

    Existing ones are replaced only if ``replace``. What another run has written since this object
    was made is never replaced. A link is replaced, not followed: nothing outside is written.
    """

    def __init__(self, folder: Path, replace: bool) -> None:
        self._folder, self._replace = folder, replace
        self._before: dict[str, Identity | None] = {}
        with suppress(FileNotFoundError, NotADirectoryError), named(folder):
            self._before = {path.name: identity(path) for path in folder.iterdir()}

    def check(self, names: Iterable[str]) -> None:
        """
        Raise StewartError where a file exists that may not be replaced, before any work is lost.

        Raises OSError where the folder, or a file of another kind, does not let them be written.
        """
        _check_folder(self._folder)
        for path in (self._folder / name for name in names):
            found = identity(path)
            if found is None:
                continue
            if not self._replace:
                raise StewartError(f'{path}: exists; --force replaces it')
            if found != self._before.get(path.name):
                raise StewartError(f'{path}: another run has written it meanwhile: it is not '
                                   'replaced')
            with named(path):
                _mode_to_replace(path)

    def existing(self, names: Iterable[str], beside: Mapping[str, str]) -> list[str]:
        """Return the files that exist, of ``beside`` those with another content."""
        return [name for name in (*names, *beside) if name in self._before
                and not (name in beside and self._has(name, beside[name].encode()))]

    def write(self, files: Mapping[str, str | bytes], beside: Mapping[str, str] | None = None,
              ) -> list[Path]:
        """
        Make the folder if it is missing, write the files and return their paths.

        Either all of them are written, or the folder stays as it was.

        beside: more files, which may be there already if they have this content.
        """
        files = {**files, **{name: text for name, text in (beside or {}).items()
                             if not self._has(name, text.encode())}}
        self.check(files)
        paths = {self._folder / name: content for name, content in files.items()}
        with named(self._folder):
            self._folder.mkdir(parents=True, exist_ok=True)
        with _partial_files({path: path for path in paths}, paths) as partial, locked(
                self._folder), signals_wait():
            self.check(files)
            _rename(partial)
        return list(paths)

    def _has(self, name: str, content: bytes) -> bool:
        """Return whether there is a file, not a link, with this content."""
        path = self._folder / name
        try:
            found = path.lstat()
            return (stat.S_ISREG(found.st_mode) and found.st_size == len(content)
                    and path.read_bytes() == content)
        except OSError:
            return False


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other runs from renaming files in a folder; without effect if it has no locks."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def write_files(files: Mapping[Path, str | bytes]) -> None:
    """
    Write files, all of them complete or none.

    Existing files are replaced, and kept where writing fails; of a link the target is replaced.
    Text is UTF-8; names in it that are not UTF-8 are written with escapes.

    Raises OSError: with the name of the file that cannot be written.
    """
    finals = {}
    for path in files:
        with named(path):
            finals[path] = Path(path).resolve()
    with _partial_files(finals, files) as partial, signals_wait():
        _rename(partial)


@contextmanager
def _partial_files(finals: Mapping[Path, Path], files: Mapping[Path, str | bytes],
                   ) -> Iterator[dict[Path, Path]]:
    """
    Write each file to the disk under another name in its folder; yield these by final name.

    Those that have not been renamed are removed.
    """
    partial: dict[Path, Path] = {}
    try:
        for path, content in files.items():
            with named(path):
                final = finals[path]
                partial[final] = final.with_name(f'.{secrets.token_hex(8)}.partial')
                _write(partial[final], final, content)
        yield partial
    finally:
        for left in partial.values():
            left.unlink(missing_ok=True)


def _rename(partial: Mapping[Path, Path]) -> None:
    for final, complete in partial.items():
        with named(final):
            complete.replace(final)


def now() -> str:
    """Return the present time, UTC, as files of results have it."""
    return datetime.now(timezone.utc).strftime('%Y-%m-%dT%H:%M:%SZ')


def write_json(path: Path, document: Any) -> None:
    """Write a document as JSON, complete or not at all."""
    write_files({path: to_json(document, indent=2) + '\n'})


def to_json(document: Any, indent: int | None = None) -> str:
    """
    Return a document as JSON, on one line unless lines are indented.

    Raises ValueError: a number is not finite.
    """
    # Not orjson: it writes null for NaN, and takes no names that are not UTF-8.
    return json.dumps(
        plain(document), indent=indent, allow_nan=False, ensure_ascii=False,
        separators=None if indent else (',', ':'), default=_by_keys)


def _by_keys(document: Any) -> dict[str, Any]:
    """Return the values of a record by their keys."""
    from msgspec import UNSET

    from stewart_dynamics.records import Record

    if not isinstance(document, Record):
        raise TypeError(f'Object of type {type(document).__name__} is not JSON serializable')
    return {key: value for key, name in zip(
        document.keys(), document.__struct_fields__, strict=True)
        if (value := getattr(document, name)) is not UNSET}


def plain(document: Any) -> Any:
    """
    Return a document with Python's own numbers and lists in place of numpy's.

    All that goes into JSON or onto a page passes here: an array has no truth value, and neither
    a template nor JSON takes all of numpy's scalars.
    """
    # late, so that --help is fast
    import numpy as np

    from stewart_dynamics.records import Record

    if isinstance(document, Record):
        return type(document)(**{name: plain(getattr(document, name))
                                 for name in document.__struct_fields__})
    if isinstance(document, (np.generic, np.ndarray)):
        return document.tolist()
    if isinstance(document, Mapping):
        return {plain(key): plain(value) for key, value in document.items()}
    if isinstance(document, tuple) and hasattr(document, '_fields'):
        return type(document)(*map(plain, document))
    return [plain(each) for each in document] if isinstance(document, (list, tuple)) else document


@contextmanager
def named(path: str | Path) -> Iterator[None]:
    """Name a file in errors of writing, which have no name or the name of a partial file."""
    try:
        yield
    except OSError as exc:
        raise type(exc)(exc.errno, exc.strerror, str(path)) from exc


def _check_folder(folder: Path) -> None:
    """Raise OSError where no file can be written to a folder, or it cannot be made."""
    while not os.path.lexists(folder):  # it will be made
        folder = folder.parent
    if not folder.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(folder))
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(folder))


def _mode_to_replace(final: Path) -> int | None:
    """Return the mode of a file or link, None if missing; OSError if it cannot be replaced."""
    mode = final.lstat().st_mode if identity(final) else None
    if mode is not None and stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if mode is not None and not (stat.S_ISREG(mode) or stat.S_ISLNK(mode)):
        raise OSError(errno.EINVAL, 'not a regular file')
    return mode


def _write(partial: Path, final: Path, content: str | bytes) -> None:
    mode = _mode_to_replace(final)
    with partial.open('xb') as file:
        if mode is not None and stat.S_ISREG(mode):
            os.fchmod(file.fileno(), stat.S_IMODE(mode))
        file.write(content.encode('utf-8', 'backslashreplace') if isinstance(content, str)
                   else content)
        file.flush()
        os.fsync(file.fileno())
