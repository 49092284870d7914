# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The CPU: the functions of ``core/hexapods.c`` in the library, on all processors."""

from __future__ import annotations

from typing import Any

import numpy as np

from stewart_dynamics.arrays import Records
from stewart_dynamics.core.binding import function
from stewart_dynamics.mechanics import batch


class Host:
    """Memory of the host and loops in C, see ``device.Device``."""

    xp = np
    name = 'cpu'

    def empty(self, shape: tuple[int, ...]) -> Any:
        """Return an array whose numbers are to be written."""
        return np.empty(shape)

    def put(self, records: Records) -> Records:
        """Return structures where the functions find them."""
        return np.ascontiguousarray(records)

    def launch(self, name: str, structures: tuple[Records, ...], which: Any,
               numbers: tuple[float, ...], arrays: tuple[Any, ...], flags: Any = None) -> None:
        """
        Call a function for all hexapods.

        structures (M,): those of hexapod h are number which[h]. numbers: single arguments.
        arrays (N, ...): strided, one row for each hexapod; flags (N,): likewise, if it has them.
        """
        call = function(name)

        def part(of: Any, *rows: Any) -> None:
            arguments: list[Any] = [*structures, of, len(of), *numbers]
            if flags is not None:
                arguments.append(rows[0])
                rows = rows[1:]
            for array in rows:
                steps = [stride // 8 for stride in array.strides]
                if array.shape[0] == 1:
                    steps[0] = 0
                arguments += [_first(array), *steps]
            call(*arguments)

        given = (which, *(() if flags is None else (flags,)), *arrays)
        batch.in_parts(part, (), *given, least=_HEXAPODS_FOR_A_THREAD)

    def solve(self, structures: Records, which: Any, conditioned: bool, width: int,
              motions: Any, wrenches: Any, bases: Any, results: Any) -> None:
        """Write results (N, S, width) of arrays (N, S, ...), in lanes where that pays."""
        count, samples = results.shape[:2]
        if count * samples < _LANES_PAY * len(structures):
            self.launch('hexapods_solve', (structures,), which, (samples, conditioned, width),
                        (motions, wrenches, bases, results))
            return
        for number in range(len(structures)):
            structure = structures[number:number + 1].reshape(())
            chosen = slice(None) if len(structures) == 1 else np.flatnonzero(which == number)
            rows, loads, moving = (
                _rows(array[chosen]) for array in (motions, wrenches, bases))
            if len(structures) == 1:
                batch.solve(structure, rows, loads, moving, conditioned,
                            results.reshape(-1, results.shape[-1]))
                return
            results[chosen] = batch.solve(structure, rows, loads, moving, conditioned).reshape(
                results[chosen].shape)


_HEXAPODS_FOR_A_THREAD = 256  # at least: a millisecond of work with many steps or samples
_LANES_PAY = 8  # samples of a platform: below, it costs more to copy them


def _rows(array: Any) -> Any:
    """Return rows (n, width) of an array (N, S, width); one row if all are the same."""
    if not any(array.strides[:2]) or array.shape[0] * array.shape[1] == 0:
        array = array[:1, :1]
    return np.ascontiguousarray(array.reshape(-1, array.shape[-1]))


def _first(array: Any) -> Any:
    """Return the first number of an array as an array, whose address is passed."""
    return np.lib.stride_tricks.as_strided(array, (1,), (8,), writeable=False)
