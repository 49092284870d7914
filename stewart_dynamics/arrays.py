# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Types of arrays, and their vector product, for all layers."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]  # indices, counts and codes
Stamps = NDArray[np.int64]  # times [ns]
Flags = NDArray[np.bool_]
Bytes = NDArray[np.uint8]
Records = NDArray[np.void]  # structures of the C library

Six = tuple[float, float, float, float, float, float]
"""One number for each leg, or a wrench or twist."""

NO_WRENCH: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

SECOND = 1_000_000_000  # a second in the unit of stamps [ns]
RPM = 30.0 / math.pi  # turns in a minute, of 1 rad/s
NANOSECOND = 1e-9  # the unit of stamps [s]


def cross(a: Array, b: Array) -> Array:
    """Return a x b of vectors (..., 3), with the bits of numpy.cross, which is slower."""
    c = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        c[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return c
