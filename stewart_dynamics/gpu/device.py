# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""A GPU by CuPy: its memory, and the kernels of ``core/hexapods.c``."""

from __future__ import annotations

from functools import cached_property
import re
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Records
from stewart_dynamics.errors import DeviceError, one_line
from stewart_dynamics.gpu.cuda_source import cuda_source, OPTIONS

_THREADS = 128  # of a block: a thread takes most of the registers that it can have
_MOST_BLOCKS = 2 ** 31 - 1
_SHARE = 0.8  # of the free memory, for structures


def _cupy() -> Any:
    """Return the module; DeviceError names a missing package."""
    try:
        import cupy
    except ImportError as exc:
        raise DeviceError("no CuPy: pip install stewart_dynamics[gpu], or device='cpu': "
                          f'{one_line(exc)}') from exc
    return cupy


def count_devices() -> int:
    """Return the number of GPUs; DeviceError gives the reason if it is zero."""
    cupy = _cupy()
    try:
        count = int(cupy.cuda.runtime.getDeviceCount())
    except Exception as exc:  # without a driver, of a type of CuPy's own
        raise DeviceError(f'no GPU: {one_line(exc)}') from exc
    if count == 0:
        raise DeviceError('no GPU: CUDA finds no device')
    return count


class Device:
    """
    One GPU, see ``host.Host`` for the same on the CPU; it becomes CuPy's present device.

    Kernels are compiled when they are first needed, by NVRTC, and kept in CuPy's cache. They run
    in the present stream of CuPy.
    """

    def __init__(self, number: int = 0) -> None:
        count = count_devices()
        if not 0 <= number < count:
            raise DeviceError(f'cuda:{number}: no such GPU: there are {count}, from cuda:0')
        self.xp, self.number, self.name = _cupy(), number, f'cuda:{number}'
        self.xp.cuda.Device(number).use()

    @cached_property
    def _module(self) -> Any:
        module = self.xp.RawModule(code=cuda_source(), options=OPTIONS, backend='nvrtc')
        try:
            module.compile()
        except Exception as exc:
            raise DeviceError(f'{self.name}: kernels: {one_line(exc)}') from exc
        return module

    def empty(self, shape: tuple[int, ...]) -> Any:
        """Return an array whose numbers of a kind lie side by side, as threads read them."""
        with self.xp.cuda.Device(self.number):
            # The last axis, of the numbers of a sample, is the slowest.
            return self.xp.moveaxis(self.xp.empty((shape[-1], *shape[:-1])), 0, -1)

    def put(self, records: Records) -> Any:
        """Return structures in the GPU's memory; where they do not fit, as they are."""
        with self.xp.cuda.Device(self.number):
            free, _ = self.xp.cuda.runtime.memGetInfo()
            if records.nbytes > _SHARE * free:
                return np.ascontiguousarray(records)
            return self.xp.asarray(np.ascontiguousarray(records).view(np.uint8))

    def launch(self, name: str, structures: tuple[Any, ...], which: Any,
               numbers: tuple[float, ...], arrays: tuple[Any, ...], flags: Any = None) -> None:
        """
        Run a kernel for all hexapods: arguments are those of ``Host.launch``.

        Structures that do not fit in memory come to the GPU in parts, with their hexapods.
        """
        if not any(map(_on_host, structures)):
            self._launch(name, structures, which, numbers, arrays, flags)
            return
        count = len(which)
        if any(_on_host(each) and len(each) != count for each in structures):
            raise DeviceError(f'{self.name}: too little memory for the structures of the '
                              'platforms')
        with self.xp.cuda.Device(self.number):
            free, _ = self.xp.cuda.runtime.memGetInfo()
        by_hexapod = sum(each.nbytes for each in structures) // count
        part = max(1, int(_SHARE * free) // by_hexapod)
        for begin in range(0, count, part):
            of = slice(begin, min(begin + part, count))
            rows = tuple(array if array.shape[0] == 1 else array[of] for array in arrays)
            with self.xp.cuda.Device(self.number):
                moved = tuple(self.xp.asarray(
                    each[of].view(np.uint8) if _on_host(each)
                    else each.reshape(count, -1)[of]) for each in structures)
            self._launch(name, moved, which[of] - begin, numbers, rows,
                         None if flags is None else flags[of])

    def _launch(self, name: str, structures: tuple[Any, ...], which: Any,
                numbers: tuple[float, ...], arrays: tuple[Any, ...], flags: Any) -> None:
        count = len(which)
        arguments: list[Any] = [*structures, which, np.int64(count)]
        arguments += [np.float64(each) if isinstance(each, float) else np.int64(each)
                      for each in numbers]
        if flags is not None:
            arguments.append(flags)
        threads = count
        for array in arrays:
            steps = [stride // 8 for stride in array.strides]
            if array.shape[0] == 1:
                steps[0] = 0
            arguments += [array, *map(np.int64, steps)]
            if array.ndim == 3:
                threads = count * max(1, array.shape[1])
        if threads == 0:
            return
        blocks = min(-(-threads // _THREADS), _MOST_BLOCKS)
        with self.xp.cuda.Device(self.number):
            try:
                self._module.get_function(name)((blocks,), (_THREADS,), tuple(arguments))
            except self.xp.cuda.driver.CUDADriverError as exc:
                raise DeviceError(f'{self.name}: {name}: {one_line(exc)}: too little memory for '
                                  'the stacks of the threads?') from exc

    def solve(self, structures: Any, which: Any, conditioned: bool, width: int, motions: Any,
              wrenches: Any, bases: Any, results: Any) -> None:
        """Write results, see ``Host.solve``."""
        self.launch('hexapods_solve', (structures,), which,
                    (results.shape[1], int(conditioned), width),
                    (motions, wrenches, bases, results))


def _on_host(structures: Any) -> bool:
    """Return whether structures are records of numpy: they did not fit into the GPU's memory."""
    return structures.dtype.fields is not None


def device_of(name: str) -> tuple[str, int]:
    """Return kind and number of a device by its name: cpu, cuda, cuda:1."""
    found = re.fullmatch(r'cpu|cuda(?::(\d+))?', name)
    if found is None:
        raise DeviceError(f'device {name!r}: must be cpu, cuda or cuda:N')
    return name[:4].rstrip(':'), int(found[1] or 0)
