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
Compilation: by numba where it is installed; otherwise the functions run uncompiled.

The functions are plain Python either way and give the same bits: no fast-math flag is set,
so the compiler may neither reorder a sum nor fuse a product into it, and a sample computed
in a vector lane equals the same sample computed alone.
"""

from __future__ import annotations

from collections.abc import Callable
import hashlib
from pathlib import Path
from typing import Any, cast, TypeVar

import numpy as np

__all__ = ['COMPILED', 'HINT', 'compiled', 'entry_point', 'inlined']

Function = TypeVar('Function', bound=Callable[..., Any])

_UNCOMPILED = ('the dynamics run uncompiled, with the same results but about a thousand times '
               'slower, a millisecond or more for each setpoint')
# What a program logs once about the compilation; empty where there is nothing to tell.
HINT = ''


def _quiet(function: Function) -> Function:
    """Return the function without warnings of overflows, as compiled code gives none."""
    return np.errstate(all='ignore')(function)


try:
    import numba
except ImportError:
    COMPILED = False
    HINT = f'numba is not installed: {_UNCOMPILED}; pip install numba'

    def inlined(function: Function) -> Function:
        """Return the function as it is: there is no compiler."""
        return function

    compiled = inlined
    entry_point = _quiet
else:
    from stewart_dynamics.mechanics.kept_code import CheckedCache, NOT_KEPT

    COMPILED = not getattr(numba.config, 'DISABLE_JIT', 0)
    if not COMPILED:
        HINT = f'NUMBA_DISABLE_JIT is set: {_UNCOMPILED}'

    def inlined(function: Function) -> Function:
        """Compile a part of a loop's body; inlined, so that the loop becomes vector code."""
        # error_model 'numpy': a division by zero gives inf or nan and no exception, which
        # would be a branch that keeps the loop from becoming vector code.
        return cast('Function', numba.njit(error_model='numpy', forceinline=True)(function))

    def compiled(function: Function) -> Function:
        """Compile a function that is called as one."""
        return cast('Function', numba.njit(error_model='numpy', nogil=True)(function))

    def entry_point(function: Function) -> Function:
        """Compile what Python calls; the compiled code is kept on disk for the next start."""
        global HINT
        if not COMPILED:
            return _quiet(function)
        dispatcher: Any = compiled(function)
        try:
            dispatcher._cache = CheckedCache(function, _SOURCES)
        except RuntimeError:
            HINT = NOT_KEPT.format(reason='')
        return cast('Function', dispatcher)

    # Functions of this folder are compiled into the entry points of all others.
    _SOURCES = hashlib.sha256(b''.join(
        path.read_bytes() for path in sorted(Path(__file__).parent.glob('*.py')))).hexdigest()
