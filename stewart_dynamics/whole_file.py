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

"""Files of others, read within a bound, and files written as a whole or not at all."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime, timezone
import errno
import json
import os
from pathlib import Path
import secrets
import stat
from typing import Any

import numpy as np
from stewart_dynamics.errors import shown, StewartError


def read_text(path: str | Path, largest: int, error: type[StewartError]) -> str:
    """
    Return the text of a regular file of UTF-8.

    path: the file; a pipe or a device is rejected without waiting for it.
    largest: largest size [bytes].
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
    try:
        return data.decode('utf-8')
    except UnicodeDecodeError as exc:
        raise error(f'{path}: cannot be read: not UTF-8 text') from exc


def _without_waiting(path: str, flags: int) -> int:
    """Open a file; a pipe without waiting for its writer."""
    return os.open(path, flags | os.O_NONBLOCK)


def write_new(folder: Path, files: Mapping[str, str | bytes], replace: bool) -> list[Path]:
    """
    Write files into a folder, which is made if it is missing, as ``write_files`` does.

    Returns their paths; StewartError if a file exists that may not be replaced.
    """
    paths = {folder / name: content for name, content in files.items()}
    check_new(paths, replace)
    folder.mkdir(parents=True, exist_ok=True)
    write_files(paths)
    return list(paths)


def check_new(paths: Iterable[Path], replace: bool) -> None:
    """Raise StewartError where a file exists that may not be replaced."""
    for path in paths:
        if path.exists() and not replace:
            raise StewartError(f'{path}: exists; --force replaces it')


def write_files(files: Mapping[Path, str | bytes]) -> None:
    """
    Write files, all of them complete or none.

    Each is written to the disk under another name in its folder; when all are complete, they take
    their names. Existing files are replaced, and kept where writing fails. Text is UTF-8; names in
    it that are not UTF-8 are written with escapes.

    Raises OSError: with the name of the file that cannot be written.
    """
    partial: dict[Path, Path] = {}
    try:
        for path, content in files.items():
            with named(path):
                final = Path(path).resolve()  # the target of a link is replaced, not the link
                partial[final] = final.with_name(f'.{secrets.token_hex(8)}.partial')
                _write(partial[final], final, content)
        for final, complete in partial.items():
            with named(final):
                complete.replace(final)
    finally:
        for left in partial.values():
            left.unlink(missing_ok=True)


def now() -> str:
    """Return the present time, UTC, as files of results have it."""
    return datetime.now(timezone.utc).strftime('%Y-%m-%dT%H:%M:%SZ')


def write_json(path: Path, document: Any) -> None:
    """Write a document as JSON, complete or not at all."""
    write_files({path: to_json(document, indent=2) + '\n'})


def to_json(document: Any, indent: int | None = None) -> str:
    """
    Return a document as JSON, on one line unless lines are indented.

    Numpy scalars and arrays are written as numbers and lists.

    Raises ValueError: a number is not finite.
    """
    # Not orjson: it writes null for NaN, and takes no names that are not UTF-8.
    return json.dumps(document, indent=indent, separators=None if indent else (',', ':'),
                      allow_nan=False, ensure_ascii=False, default=_plain)


def _plain(value: Any) -> Any:
    """Return a numpy scalar or array as Python's own numbers."""
    if not isinstance(value, (np.generic, np.ndarray)):
        raise TypeError(f'{value!r}: {type(value).__name__} has no form in JSON')
    return value.tolist()


@contextmanager
def named(path: str | Path) -> Iterator[None]:
    """Name a file in errors of writing, which have no name or the name of a partial file."""
    try:
        yield
    except OSError as exc:
        raise type(exc)(exc.errno, exc.strerror, str(path)) from exc


def _write(partial: Path, final: Path, content: str | bytes) -> None:
    if final.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if final.exists() and not final.is_file():
        raise OSError(errno.EINVAL, 'not a regular file')
    with partial.open('xb') as file:
        if final.exists():
            os.fchmod(file.fileno(), stat.S_IMODE(final.stat().st_mode))
        file.write(content.encode('utf-8', 'backslashreplace') if isinstance(content, str)
                   else content)
        file.flush()
        os.fsync(file.fileno())
