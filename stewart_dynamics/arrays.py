# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Types of arrays, for all layers."""

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
STAMPS_END = 2 ** 31 * SECOND  # stamps are less, and not less than its negative [ns]
RPM = 30.0 / math.pi  # turns in a minute, of 1 rad/s
NANOSECOND = 1e-9  # the unit of stamps [s]
