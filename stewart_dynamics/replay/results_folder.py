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


"""The folder of a bag's results: it gets its name only when it is complete."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import hashlib
import json
import os
from pathlib import Path
import shutil
import tempfile
from typing import Any

from stewart_dynamics.errors import BagError
from stewart_dynamics.replay.options import Options


@contextmanager
def whole_folder(final: Path, options: Options) -> Iterator[Path]:
    """Yield a folder that gets its final name only when it is complete."""
    final.parent.mkdir(parents=True, exist_ok=True)
    partial = Path(tempfile.mkdtemp(
        prefix=f'{partial_name(final, options.run)}partial.', dir=final.parent))
    replaced = partial.with_name(f'{partial.name}.replaced')
    try:
        yield partial
        partial.chmod(0o755)
        # Existing results are kept until their replacement is complete.
        if final.exists():
            check_free(final, options)
            final.rename(replaced)
        partial.rename(final)
    finally:
        if os.path.lexists(replaced) and not os.path.lexists(final):
            replaced.rename(final)  # its replacement was not completed
        for left in (partial, replaced):
            if left.is_symlink():
                left.unlink()
            shutil.rmtree(left, ignore_errors=True)


def partial_name(final: Path, run: str) -> str:
    """Return the prefix of the names of partial results, of a folder in a run."""
    # A long name would exceed the limit of the file system with the suffix.
    short = (final.name if len(os.fsencode(final.name)) < 120
             else hashlib.sha256(os.fsencode(final.name)).hexdigest())
    return f'.{short}.{run or "one"}.'


def check_free(folder: Path, options: Options) -> None:
    """Raise BagError if results must not be written there."""
    if not folder.exists():
        return
    if not options.force:
        raise BagError(f'{folder}: exists already; --force replaces results')
    if not (folder / 'summary.json').is_file():
        raise BagError(f'{folder}: exists already and is not a folder of replay results: it is '
                       'not replaced')


def write_json(path: Path, document: Any) -> None:
    """Write a document; names that are not UTF-8 are written with escapes."""
    path.write_text(json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False) + '\n',
                    encoding='utf-8', errors='backslashreplace')
