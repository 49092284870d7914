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


"""Errors that no rule covers, in one line."""

from __future__ import annotations

from pathlib import Path

from stewart_dynamics.errors import one_line


def unexpected(exc: BaseException) -> str:
    """Return what an error is that should not occur, in one line, and where it was raised."""
    if isinstance(exc, MemoryError):
        return f'out of memory: {one_line(exc)}' if str(exc) else 'out of memory'
    at = exc.__traceback__
    while at is not None and at.tb_next is not None:
        at = at.tb_next
    where = f' ({Path(at.tb_frame.f_code.co_filename).name}, line {at.tb_lineno})' if at else ''
    return f'unexpected error, please report it: {type(exc).__name__}: {one_line(exc)}{where}'
