# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Arrays as they are given, of any library with DLPack: checked, and taken without a copy."""

from __future__ import annotations

from typing import Any

from stewart_dynamics.errors import MotionError

_CPU = 1, 3, 13  # of DLPack: memory of the host, also pinned for a GPU


def take_array(xp: Any, name: str, value: Any, tail: tuple[int, ...], device: str) -> Any:
    """
    Return an array as one of ``xp``, numpy or cupy, in the same memory.

    Numbers, and lists of them, are copied. tail: how its shape ends. device: 'cpu' or 'cuda:0',
    where the hexapods are. Raises MotionError: another device, another type of numbers, a shape
    that does not fit, strides that are not those of whole numbers.
    """
    if not hasattr(value, '__dlpack_device__'):
        try:
            array = xp.asarray(value, dtype=xp.float64)
        except (TypeError, ValueError) as exc:
            raise MotionError(f'{name}: not an array of real numbers: {exc}') from exc
    else:
        kind, number = value.__dlpack_device__()
        where = 'cpu' if int(kind) in _CPU else f'cuda:{int(number)}'
        if where != device:
            raise MotionError(
                f'{name}: an array on {where}: must be on {device}, where the hexapods are')
        dtype = str(getattr(value, 'dtype', '')).rpartition('.')[2]
        if dtype != 'float64':
            raise MotionError(f'{name}: numbers of {dtype}: must be float64')
        array = value if isinstance(value, xp.ndarray) else xp.from_dlpack(value)
    if array.shape[len(array.shape) - len(tail):] != tail:
        raise MotionError(f'{name}: shape {tuple(array.shape)}: must end in {tail}')
    if any(stride % array.itemsize for stride in array.strides):
        raise MotionError(f'{name}: strides of {array.strides} bytes: not contiguous, and no '
                          f'multiples of {array.itemsize} bytes')
    return array


def take_mask(xp: Any, name: str, value: Any, count: int, device: str) -> Any:
    """Return flags (count,) of one for each hexapod; MotionError as in ``take_array``."""
    if hasattr(value, '__dlpack_device__') and not isinstance(value, xp.ndarray):
        kind, number = value.__dlpack_device__()
        where = 'cpu' if int(kind) in _CPU else f'cuda:{int(number)}'
        if where != device:
            raise MotionError(
                f'{name}: an array on {where}: must be on {device}, where the hexapods are')
        value = xp.from_dlpack(value)
    array = xp.asarray(value)
    if array.dtype != bool or array.shape != (count,):
        raise MotionError(f'{name}: shape {tuple(array.shape)} of {array.dtype}: must be '
                          f'({count},) of bool')
    return xp.ascontiguousarray(array)


def spread(xp: Any, name: str, array: Any, hexapods: int, samples: int, width: int) -> Any:
    """
    Return an array (width,), (N, width) or (S, N, width) as a view (N, S, width).

    Hexapods come first, samples second; axes of one element stand for all, with strides of zero.
    """
    whole = array[(None,) * (3 - array.ndim)] if array.ndim < 3 else array
    try:
        return xp.broadcast_to(whole, (samples, hexapods, width)).transpose(1, 0, 2)
    except ValueError as exc:
        raise MotionError(
            f'{name}: shape {tuple(array.shape)}: must be ({width},), ({hexapods}, {width}) or '
            f'({samples}, {hexapods}, {width}), for {hexapods} hexapods') from exc


def leading(name: str, array: Any, count: int) -> tuple[int, ...]:
    """Return the shape of samples of an array (..., width): () or (S,) before the hexapods."""
    if array.ndim > 3 or (array.ndim > 1 and array.shape[-2] not in (1, count)):
        raise MotionError(f'{name}: shape {tuple(array.shape)}: must be (N, ...) or (S, N, ...) '
                          f'with {count} hexapods')
    return tuple(array.shape[:-2])
