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

"""A function that Python calls: as machine code, or as plain Python where there is none."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
import ctypes
from functools import partial, update_wrapper
import os
from struct import pack, unpack
from threading import Lock, Thread
from typing import Any, cast

import numpy as np

from stewart_dynamics.compilation import machine_code

# Of the types that entry points take, as numba writes them.
_DTYPES = {'b1': np.dtype(bool), 'u1': np.dtype(np.uint8), 'i8': np.dtype(np.int64),
           'f8': np.dtype(np.float64)}


class EntryPoint:
    """
    A function of arrays and numbers that returns nothing.

    Its machine code is loaded, or compiled, when it is called first.

    Parameters
    ----------
    function : callable
        The same in plain Python.
    types : sequence of str
        Of the arguments: ``f8``, ``i8`` or ``b1``; arrays in C order with ``[::1]``, ``[:,::1]``.

    """

    def __init__(self, function: Callable[..., None], types: Sequence[str]) -> None:
        self._function = function
        self._kinds = [_kind(text) for text in types]
        self._lock = Lock()
        self._call: Callable[..., object] | None = None
        self._address = 0
        update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> None:
        """Call it; other threads run meanwhile."""
        (self._call or self._prepared())(*arguments)

    def bound(self, *arguments: Any) -> Callable[[], object]:
        """
        Return a function without arguments that calls it with these, which stay where they are.

        It takes a tenth of the time of a call, and other threads wait for it: for single samples.
        """
        if not self.compiled:
            return partial(self._prepared(), *arguments)
        block = self._block(arguments)
        call: Any = partial(ctypes.PYFUNCTYPE(ctypes.c_int)(self._address), block)
        call.arguments = arguments  # as long as the call exists, so does their memory
        return cast('Callable[[], object]', call)

    def prepare(self) -> None:
        """Load the machine code, or have it compiled, for seconds."""
        self._prepared()

    @property
    def compiled(self) -> bool:
        """Whether a call runs machine code."""
        self.prepare()
        return self._address != 0

    def load(self) -> bool:
        """Load the machine code if it is on disk; return whether a call compiles nothing."""
        with self._lock:
            if self._call is None:
                self._use(machine_code.kept_address(*self._name))
            return self._call is not None

    @property
    def _name(self) -> tuple[str, str]:
        return self._function.__module__, self._function.__name__

    def _prepared(self) -> Callable[..., object]:
        with self._lock:
            if self._call is None:
                self._use(machine_code.kept_address(*self._name))
            if self._call is None:
                self._use(machine_code.compiled_address(*self._name))
            return cast('Callable[..., object]', self._call)

    def _use(self, address: int | None) -> None:
        """Call what is at an address from now on; 0: plain Python; None: not yet known."""
        if address is None:
            return
        self._address = address
        if address:
            # This one lets other threads run.
            self._native = ctypes.CFUNCTYPE(ctypes.c_int)(address)
            self._call = self._call_native
        else:
            self._call = np.errstate(all='ignore')(self._function)

    def _call_native(self, *arguments: Any) -> None:
        if self._native(self._block(arguments)):
            raise RuntimeError(f'{".".join(self._name)}: an exception in compiled code')

    def _block(self, arguments: Sequence[Any]) -> Any:
        """Return the arguments as the machine code takes them, see ``compiler``."""
        numbers: list[int] = []
        for argument, (dtype, dimensions) in zip(arguments, self._kinds, strict=True):
            if dimensions:
                if (argument.dtype != dtype or argument.ndim != dimensions
                        or not argument.flags.c_contiguous):
                    raise TypeError(f'{".".join(self._name)}: an array of {argument.dtype}, shape '
                                    f'{argument.shape}: must be of {dtype}, {dimensions} '
                                    'dimensions, in C order')
                numbers += (argument.ctypes.data, *argument.shape)
            elif dtype.kind == 'f':
                numbers += unpack('q', pack('d', argument))
            else:
                numbers.append(int(argument))
        return (ctypes.c_int64 * len(numbers))(*numbers)


def prepare(functions: Iterable[EntryPoint]) -> None:
    """Have functions compiled that are not, side by side."""
    waiting = [each for each in functions if not each.load()]
    errors: list[Exception] = []

    def work() -> None:
        with suppress(IndexError):  # nothing waits any more
            while True:
                try:
                    waiting.pop(0).prepare()
                except RuntimeWarning as exc:  # where warnings are errors
                    errors.append(exc)

    # Not a pool, which an interrupted program would wait for.
    threads = [Thread(target=work, daemon=True) for _ in range(os.cpu_count() or 1)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if errors:
        raise errors[0]


def _kind(text: str) -> tuple[np.dtype[Any], int]:
    name, _, axes = text.partition('[')
    return _DTYPES[name], axes.count(',') + 1 if axes else 0
