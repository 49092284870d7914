# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Marks of the functions that are compiled, and how Python calls their machine code.

numba compiles all entry points of a module at once, in other processes (``compiler``);
programs load the machine code (``machine_code``) and never import numba. Where nothing can be
compiled, the functions run as plain Python and give the same bits: no fast-math flag is set, so
the compiler may neither reorder a sum nor fuse a product into it, and a sample computed in a
vector lane equals the same sample computed alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
import ctypes
from functools import partial, update_wrapper
from struct import pack, unpack
from threading import Thread
from typing import Any, cast, TypeVar

import numpy as np

from stewart_dynamics.compilation import machine_code

Function = TypeVar('Function', bound=Callable[..., Any])

CALLED: dict[Callable[..., Any], bool] = {}
"""The functions that compiled functions call, and whether each of them is inlined."""

DTYPES = {'b1': np.dtype(bool), 'u1': np.dtype(np.uint8), 'i8': np.dtype(np.int64),
          'f8': np.dtype(np.float64)}
"""Types that entry points take, as numba writes them."""


def inlined(function: Function) -> Function:
    """Mark a part of a loop's body; it is inlined, so that the loop becomes vector code."""
    CALLED[function] = True
    return function


def compiled(function: Function) -> Function:
    """Mark a function that compiled functions call."""
    CALLED[function] = False
    return function


def entry_point(*types: str) -> Callable[[Callable[..., None]], EntryPoint]:
    """Make a function one that Python calls, see EntryPoint."""
    return lambda function: EntryPoint(function, types)


class EntryPoint:
    """
    A function of arrays and numbers; it returns nothing.

    Its machine code is loaded, or compiled, at the first call.

    function: the same in plain Python.
    types: types of the arguments: ``f8``, ``i8`` or ``b1``; arrays in C order with ``[::1]`` or
        ``[:,::1]``, those of bytes begin with ``u1``.
    """

    def __init__(self, function: Callable[..., None], types: Sequence[str]) -> None:
        self.function = function
        self.arguments = [(DTYPES[text[:2]], text.count('[') + text.count(',')) for text in types]
        """Data type and number of dimensions of each argument; a number has none."""
        self._address = 0
        self._call: Callable[..., object] | None = None
        update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> None:
        """Call it; other threads run meanwhile."""
        (self._call or self._prepared())(*arguments)

    def bound(self, *arguments: Any) -> Callable[[], object]:
        """
        Return a function without arguments that calls it with these, which stay where they are.

        It takes a tenth of the time of a call, and other threads wait for it: for single samples.
        """
        prepared = self._prepared()
        if not self._address:
            return partial(prepared, *arguments)
        call: Any = partial(ctypes.PYFUNCTYPE(None)(self._address), self._block(arguments))
        call.arguments = arguments  # their memory must live as long as the call
        return cast('Callable[[], object]', call)

    @property
    def compiled(self) -> bool:
        """Whether a call runs machine code."""
        self._prepared()
        return self._address != 0

    def _prepared(self) -> Callable[..., object]:
        if self._call is None:
            machine_code.prepare([self.__module__])
            self._address = machine_code.address(self.__module__, self.function.__name__)
            if self._address:
                native = ctypes.CFUNCTYPE(None)(self._address)  # lets other threads run
                self._call = lambda *arguments: native(self._block(arguments))
            else:
                self._call = np.errstate(all='ignore')(self.function)
        return self._call

    def _block(self, arguments: Sequence[Any]) -> Any:
        """
        Return the arguments as the machine code takes them: 64-bit integers in one block.

        The first is the block's own address; an array is its address and its shape, a number
        itself, a float its bits.
        """
        numbers = [0]
        for argument, (dtype, dimensions) in zip(arguments, self.arguments, strict=True):
            if not dimensions:
                numbers.append(unpack('q', pack('d', argument))[0] if dtype.kind == 'f'
                               else int(argument))
            elif (argument.dtype, argument.ndim, argument.flags.c_contiguous) == (
                    dtype, dimensions, True):
                numbers += (argument.ctypes.data, *argument.shape)
            else:
                raise TypeError(
                    f'{self.__module__}.{self.function.__name__}: an array of {argument.dtype}, '
                    f'shape {argument.shape}: must be of {dtype}, {dimensions} dimensions, in C '
                    'order')
        block = (ctypes.c_int64 * len(numbers))(*numbers)
        block[0] = ctypes.addressof(block)
        return block


def prepare(functions: Iterable[EntryPoint]) -> None:
    """Load the machine code of functions; compile missing modules side by side."""
    machine_code.prepare(each.__module__ for each in functions)


class Preparation:
    """Machine code that may be needed later: loaded if it is on disk, else compiled on demand."""

    def __init__(self, *functions: EntryPoint) -> None:
        self._functions = functions
        self._thread: Thread | None = None
        for module in self._modules():
            machine_code.load(module)

    def _modules(self) -> set[str]:
        return {each.__module__ for each in self._functions}

    @property
    def ready(self) -> bool:
        """Whether nothing remains to be compiled."""
        return all(map(machine_code.prepared, self._modules()))

    def begin(self) -> bool:
        """Start to compile missing functions in a thread, once; return whether all are ready."""
        ready = self.ready
        if self._thread is None and not ready:
            self._thread = Thread(target=prepare, args=[self._functions], daemon=True)
            self._thread.start()
        return ready

    def finish(self) -> None:
        """Load or compile missing functions, and return when all are ready."""
        prepare(self._functions)
