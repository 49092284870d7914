# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The library's results as figures of plotly: curves of the six legs, one above the other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike
from plotly.graph_objects import Figure

from stewart_dynamics.arrays import Array
from stewart_dynamics.colors import LEG_COLORS
from stewart_dynamics.errors import MotionError
from stewart_dynamics.mechanics.arguments import as_array

_HEIGHT = 250  # of one plot [px]


def figure_of_legs(quantities: Mapping[str, Array], times: ArrayLike | None,
                   joints: Sequence[str]) -> Figure:
    """
    Return a figure of quantities (N, 6), by their titles, with units.

    Arguments and errors are those of ``InverseDynamics.plot``.
    """
    shape = next(iter(quantities.values())).shape
    if len(shape) != 2:
        raise MotionError(f'plot: results of shape {shape[:-1]}: must be (N,)')
    across = np.arange(shape[0]) if times is None else as_array('times', times, shape[:1])
    curves = [
        {'x': across, 'y': values[:, n], 'yaxis': f'y{row}', 'name': joint,
         'line': {'color': color, 'width': 1.5}, 'legendgroup': joint, 'showlegend': row == 1}
        for row, values in enumerate(quantities.values(), 1)
        for n, (joint, color) in enumerate(zip(joints, LEG_COLORS, strict=True))]
    axes = {f'yaxis{row}': {'title': {'text': title}} for row, title in enumerate(quantities, 1)}
    return Figure(curves, {
        **axes, 'xaxis': {'title': {'text': 'sample' if times is None else 'time [s]'}},
        # one axis below all plots, for which they are zoomed together
        'grid': {'columns': 1, 'rows': len(axes), 'pattern': 'coupled', 'ygap': 0.12},
        'legend': {'orientation': 'h', 'y': 1.01, 'yanchor': 'bottom'},  # above: no curve is below
        'height': 100 + _HEIGHT * len(axes), 'margin': {'t': 40}, 'template': 'plotly_white'})
