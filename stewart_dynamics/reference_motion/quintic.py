# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The quintic polynomial from rest to rest."""

from __future__ import annotations

from stewart_dynamics.arrays import Array


def quintic(u: Array) -> tuple[Array, Array, Array]:
    """Return 10 u^3 - 15 u^4 + 6 u^5 for u (...) from 0 to 1, and its first two derivatives."""
    return (u ** 3 * (10.0 + u * (6.0 * u - 15.0)), 30.0 * (u * (1.0 - u)) ** 2,
            60.0 * u * (1.0 - u) * (1.0 - 2.0 * u))
