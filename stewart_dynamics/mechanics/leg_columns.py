# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Six numbers for each sample of a result, as columns of a table and as curves of a figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import MotionError
from stewart_dynamics.mechanics.arguments import as_array

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

LEGS = tuple(f'leg_{leg}' for leg in range(1, 7))
_HEIGHT = 2.6  # of one plot [in]


def columns(quantities: Mapping[str, Array]) -> dict[str, Array]:
    """Return quantities (..., 6) as columns (N,), whose names end in _1 to _6."""
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


def figure(quantities: Mapping[str, Array], times: ArrayLike | None, joints: Sequence[str],
           ) -> Figure:
    """
    Return a matplotlib figure of quantities (N, 6), one above the other.

    quantities: by their titles, with units.
    times (N,): [s]; None: the axis shows sample numbers.
    joints: names of the legs.

    Raises ModuleNotFoundError: matplotlib is not installed.
    Raises MotionError: there is one sample alone, or times do not fit.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as exc:
        raise ModuleNotFoundError('plot: matplotlib is not installed: '
                                  'pip install matplotlib') from exc
    shape = next(iter(quantities.values())).shape
    if len(shape) != 2:
        raise MotionError(f'plot: results of shape {shape[:-1]}: must be (N,)')
    across = np.arange(shape[0]) if times is None else as_array('times', times, shape[:1])
    made = Figure(figsize=(8.0, 0.4 + _HEIGHT * len(quantities)), layout='constrained')
    every = made.subplots(len(quantities), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (title, values) in zip(every, quantities.items(), strict=True):
        lines = axes.plot(across, values)
        axes.set_ylabel(title)
        axes.grid(alpha=0.3)
    every[-1].set_xlabel('sample' if times is None else 'time [s]')
    # beside the axes: no curve is below it
    made.legend(lines, list(joints), loc='outside upper center', ncols=6, frameon=False)
    return made
