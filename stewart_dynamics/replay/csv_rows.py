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
Rows of legs.csv as text, and a process that formats them.

Formatting numbers takes longer than computing them, and holds Python's global lock. The process
reads blocks of rows from its standard input and appends their text to its standard output, which
is the file. It ends when its input ends, also because the replay was killed.
"""

from __future__ import annotations

from contextlib import suppress
import os
from struct import Struct
import subprocess
import sys
from typing import BinaryIO

import numpy as np
import orjson

from stewart_dynamics.arrays import Array, Flags, Stamps
from stewart_dynamics.errors import StewartError

# End of a row: no warning, warning.
_ENDS = (b',0\n', b',1\n')
# Rows and columns of a block.
_HEAD = Struct('<QQ')
_PROGRAM = ('import sys; sys.path[:] = sys.argv[1:]; '
            'from stewart_dynamics.replay.csv_rows import main; sys.exit(main())')


def rows_of(stamps: Stamps, numbers: Array, warnings: Flags) -> bytes:
    """Return the text of rows: stamps (N,) [ns], numbers (N, K) with nan as empty, warnings."""
    text = orjson.dumps(numbers, option=orjson.OPT_SERIALIZE_NUMPY)[2:-2]
    if not np.isfinite(numbers).all():
        text = text.replace(b'null', b'')
    # '1,2],[3,4' becomes ',1,2' and ',3,4'
    cells = [b''] * (3 * len(numbers))
    cells[::3] = orjson.dumps(stamps, option=orjson.OPT_SERIALIZE_NUMPY)[1:-1].split(b',')
    cells[1::3] = (b',' + text.replace(b'[', b'')).split(b']')
    cells[2::3] = [_ENDS[on] for on in warnings.tolist()]
    return b''.join(cells)


class RowsProcess:
    """
    A process that appends rows to a file.

    The file is flushed, and nothing else writes to it until the process has ended.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._name = file.name
        # A session of its own: Ctrl-C ends the replay, which ends the process.
        self._process: subprocess.Popen[bytes] | None = subprocess.Popen(
            [sys.executable, '-I', '-c', _PROGRAM, *sys.path], stdin=subprocess.PIPE,
            stdout=file, stderr=subprocess.DEVNULL, start_new_session=True)

    def write(self, stamps: Stamps, numbers: Array, warnings: Flags) -> None:
        """Send rows; raises OSError if earlier ones could not be written."""
        assert self._process is not None and self._process.stdin is not None
        try:
            self._process.stdin.write(_HEAD.pack(*numbers.shape))
            for each in (stamps, numbers, warnings):
                self._process.stdin.write(np.ascontiguousarray(each).data)
        except BrokenPipeError:
            self.close()

    def close(self) -> None:
        """Wait until all rows are written; raises OSError if they could not be."""
        process, self._process = self._process, None
        if process is None:
            return
        assert process.stdin is not None
        with suppress(BrokenPipeError):
            process.stdin.close()
        code = process.wait()
        if code < 0:
            raise StewartError(f'{self._name}: cannot be written: the process that formats the '
                               f'rows was ended by signal {-code}')
        if code:
            raise OSError(code, os.strerror(code), self._name)


def main() -> int:
    """Format blocks of rows until the input ends; return 0, or the number of an OSError."""
    try:
        with open(0, 'rb') as rows_in, open(1, 'wb', buffering=0) as out:
            while len(head := rows_in.read(_HEAD.size)) == _HEAD.size:
                rows, columns = _HEAD.unpack(head)
                block = (np.empty(rows, dtype=np.int64), np.empty((rows, columns)),
                         np.empty(rows, dtype=bool))
                if not all(rows_in.readinto(each.data) == each.nbytes for each in block):
                    break
                text = memoryview(rows_of(*block))
                while text:
                    text = text[out.write(text):]
    except OSError as exc:
        return exc.errno or 1
    return 0
