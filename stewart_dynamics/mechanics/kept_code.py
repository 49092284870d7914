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
Compiled functions kept on disk by numba, each with a digest that is checked before it is loaded.

numba alone loads whatever its files contain: after a power cut or a disk error, an exception that
names no file, or machine code that computes wrong forces. Here a file that does not match its
digest is ignored and written anew after the compilation, and a function that cannot be written is
used all the same, with a RuntimeWarning.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
import pickle
from typing import Any
from uuid import uuid4
import warnings

import numba
import numba.core.caching

_caching: Any = numba.core.caching  # it has no types

NOT_KEPT = ('the compiled dynamics cannot be kept on disk{reason}: every start takes seconds; let '
            'NUMBA_CACHE_DIR name a folder that can be written to')

_DIGEST = hashlib.sha256
_DIGEST_SIZE = 32


class CheckedCache(_caching.FunctionCache):  # type: ignore[misc]
    """
    The compiled forms of one function, in numba's cache folder.

    Parameters
    ----------
    function : callable
        Compiled by numba.
    sources : str
        Digest of the source files of all functions that it may call: numba takes a file as valid
        while the source file of the function itself is unchanged.

    Raises
    ------
    RuntimeError
        numba finds no folder that it can write to.

    """

    def __init__(self, function: Any, sources: str) -> None:
        super().__init__(function)
        stamp = self._impl.locator.get_source_stamp()
        self._cache_file = _CheckedFiles(
            Path(self._cache_path, self._impl.filename_base),
            (numba.__version__, stamp, sources))

    def save_overload(self, signature: Any, result: Any) -> None:
        """Write the compiled form for a signature; RuntimeWarning where that is not possible."""
        try:
            super().save_overload(signature, result)
        except OSError as exc:
            warnings.warn(NOT_KEPT.format(reason=f' ({exc.strerror})'), RuntimeWarning,
                          stacklevel=2)


class _CheckedFiles:
    """
    The files of one function, one for each signature and processor.

    A file has the digest of what follows it and of everything on which it depends.

    Parameters
    ----------
    base : Path
        What the names of the files begin with.
    versions : tuple
        Of the compiler and of the sources.

    """

    def __init__(self, base: Path, versions: tuple[Any, ...]) -> None:
        self._base, self._versions = base, versions

    def load(self, key: Any) -> Any:
        """Return what was saved for a key; None where it is missing or does not match."""
        path = self._path(key)
        try:
            content = path.read_bytes()
        except OSError:
            return None
        payload = content[_DIGEST_SIZE:]
        if content[:_DIGEST_SIZE] != self._digest(key, payload):
            return None
        _caching._cache_log('[cache] data loaded from %r', str(path))
        return pickle.loads(payload)

    def save(self, key: Any, data: Any) -> None:
        """Save data for a key, in place of what was there; OSError where that is not possible."""
        payload, path = _caching.dumps(data), self._path(key)
        # Renamed when it is complete: other processes read and write the same file.
        new = path.with_name(f'{path.name}.tmp.{uuid4().hex[:16]}')
        try:
            new.write_bytes(self._digest(key, payload) + payload)
            new.replace(path)
        except OSError:
            new.unlink(missing_ok=True)
            raise
        _caching._cache_log('[cache] data saved to %r', str(path))

    def flush(self) -> None:
        """Delete all files of the function."""
        for path in self._base.parent.glob(f'{self._base.name}.*.nbc'):
            path.unlink(missing_ok=True)

    def _path(self, key: Any) -> Path:
        # A changed source has the same name: its file is replaced.
        signature, target, _ = key
        name = _DIGEST(repr((signature, target)).encode()).hexdigest()[:16]
        return self._base.with_name(f'{self._base.name}.{name}.nbc')

    def _digest(self, key: Any, payload: bytes) -> bytes:
        return _DIGEST(repr((self._versions, key)).encode() + payload).digest()
