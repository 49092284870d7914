# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Six numbers for each sample of a result, as columns of a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from stewart_dynamics.arrays import Array

if TYPE_CHECKING:
    from pandas import DataFrame

LEGS = tuple(f'leg_{leg}' for leg in range(1, 7))


def columns(quantities: Mapping[str, Array]) -> dict[str, Array]:
    """Return quantities (..., 6) as (N,) columns, whose names end in _1 to _6."""
    return {f'{name}_{leg + 1}': values.reshape(-1, 6)[:, leg]
            for name, values in quantities.items() for leg in range(6)}


def data_frame(table: Mapping[str, Array]) -> DataFrame:
    """
    Return columns as a ``pandas.DataFrame``.

    Raises ModuleNotFoundError: pandas is not installed.
    """
    try:
        from pandas import DataFrame
    except ModuleNotFoundError as exc:
        raise ModuleNotFoundError('to_dataframe: pandas is not installed: '
                                  'pip install "stewart_dynamics[pandas]"') from exc
    return DataFrame(table)
