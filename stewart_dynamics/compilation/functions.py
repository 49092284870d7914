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
Decorators of the functions that are compiled.

numba compiles them, in a process of its own (``compiler``); a program loads the machine code
(``machine_code``) without the half second that the import of numba takes. Where nothing can be
compiled they run as the plain Python that they are, and give the same bits: no fast-math flag is
set, so the compiler may neither reorder a sum nor fuse a product into it, and a sample computed in
a vector lane equals the same sample computed alone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast, TypeVar

from stewart_dynamics.compilation.entry_point import EntryPoint

__all__ = ['compiled', 'entry_point', 'inlined', 'use_compiler']

Function = TypeVar('Function', bound=Callable[..., Any])

# What makes numba's functions; none in a program that only calls machine code.
_njit: Callable[..., Any] | None = None


def use_compiler(njit: Callable[..., Any]) -> None:
    """Have the functions of modules that are imported from now on compiled by numba."""
    global _njit
    _njit = njit


def inlined(function: Function) -> Function:
    """Mark a part of a loop's body; it is inlined, so that the loop becomes vector code."""
    return function if _njit is None else cast('Function', _njit(function, forceinline=True))


def compiled(function: Function) -> Function:
    """Mark a function that compiled functions call."""
    return function if _njit is None else cast('Function', _njit(function))


def entry_point(*types: str) -> Callable[[Callable[..., None]], EntryPoint]:
    """
    Make a function one that Python calls; it returns nothing.

    Parameters
    ----------
    types : str
        Of the arguments, as numba writes them: ``f8[:,::1]`` is a matrix of floats in C order.

    """
    def decorator(function: Callable[..., None]) -> EntryPoint:
        if _njit is None:
            return EntryPoint(function, types)
        dispatcher = _njit(function)
        dispatcher.types = types
        return cast('EntryPoint', dispatcher)

    return decorator
