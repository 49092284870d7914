# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Array arguments: checked (real, finite, of the right shape; else MotionError), as rows."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.errors import MotionError


def as_array(name: str, value: ArrayLike, tail: tuple[int, ...]) -> Array:
    """Return a finite array whose shape ends with ``tail``; MotionError names any other."""
    try:
        given = np.asarray(value)
        if given.dtype.kind not in 'biuf':
            raise TypeError(f'its type is {given.dtype}')
        array = given.astype(float, copy=False)
    # Conversion of an arbitrary object may raise any exception.
    except Exception as exc:
        text = ' '.join(f'{exc}'.split())
        raise MotionError(f'{name}: {_shown(value)}: not an array of real numbers: '
                          f'{text[:200]}') from exc
    if array.shape[-len(tail):] != tail:
        turned = ': transposed?' if tail and tail[-1] in array.shape[:-1] else ''
        raise MotionError(f'{name}: shape {array.shape}: must end in {tail}{turned}')
    finite = np.isfinite(array)
    if not finite.all():
        at, name = first_of(name, ~finite)
        raise MotionError(f'{name}: {array[at]}: must be finite')
    return array


def first_of(name: str, wrong: Flags) -> tuple[tuple[int, ...], str]:
    """Return the first index where an argument is wrong, and the argument's name with it."""
    at = tuple(map(int, np.argwhere(wrong)[0]))
    return at, f'{name}{list(at) if at else ""}'


def optional_array(name: str, value: ArrayLike | None, tail: tuple[int, ...]) -> Array:
    """Return the same for an optional argument: zeros for None."""
    return np.zeros(tail) if value is None else as_array(name, value, tail)


def common_shape(**shapes: tuple[int, ...]) -> tuple[int, ...]:
    """Return the leading shape to which all broadcast; MotionError names them if they do not."""
    try:
        return np.broadcast_shapes(*shapes.values())
    except ValueError as exc:
        given = ', '.join(f'{name} {shape}' for name, shape in shapes.items())
        raise MotionError(f'leading shapes do not fit each other: {given}') from exc


def wrong_type(name: str, value: object, wanted: str) -> MotionError:
    """Return the error about an argument of another type."""
    return MotionError(f'{name}: {_shown(value)}: must be {wanted}')


def check_finite(name: str, values: Array, leading: int) -> Array:
    """Return values whose first ``leading`` axes are samples; MotionError where not finite."""
    if not np.isfinite(values).all():
        finite = np.isfinite(values).all(axis=tuple(range(leading, values.ndim)))
        at = list(map(int, np.argwhere(~finite)[0]))
        raise MotionError(f'{name}{f" of sample {at}" if at else ""}: out of range: '
                          'numbers overflow')
    return values


def _shown(value: object) -> str:
    """Return an argument as an error shows it: short."""
    if isinstance(value, str | bool | int | float | complex) and len(f'{value!r}') < 40:
        return f'{value!r}'
    return 'None' if value is None else f'a value of type {type(value).__name__}'


def copies(array: Array, shape: tuple[int, ...]) -> Array:
    """Return a copy as rows (N, ...) of an array that is broadcast to a leading shape."""
    last = array.shape[-1]
    if array.shape[:-1] != shape:
        array = np.broadcast_to(array, (*shape, last))
    return np.array(array, order='C').reshape(-1, last)


def place(at: int, shape: tuple[int, ...]) -> str:
    """Return the index of a sample in the leading shape, as text."""
    if len(shape) < 2:
        return str(at)
    return str(list(map(int, np.unravel_index(at, shape))))
