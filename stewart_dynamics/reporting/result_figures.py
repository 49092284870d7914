# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The library's results as figures of matplotlib: curves of the six legs, one above the other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import BytesIO

try:
    from matplotlib.figure import Figure
except ImportError as exc:
    raise ModuleNotFoundError(
        'plot: matplotlib is not installed: pip install matplotlib') from exc
import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import MotionError
from stewart_dynamics.mechanics.arguments import as_array

_HEIGHT = 2.6  # of one plot [in]


class NotebookFigure(Figure):
    """A figure that Jupyter shows as a picture, also where pyplot is not imported."""

    def _repr_png_(self) -> bytes:
        """Return the picture, as IPython asks for it."""
        picture = BytesIO()
        self.savefig(picture, format='png')
        return picture.getvalue()


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
    made = NotebookFigure(figsize=(8.0, 0.4 + _HEIGHT * len(quantities)), layout='constrained')
    every = made.subplots(len(quantities), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (title, values) in zip(every, quantities.items(), strict=True):
        lines = axes.plot(across, values)
        axes.set_ylabel(title)
        axes.grid(alpha=0.3)
    every[-1].set_xlabel('sample' if times is None else 'time [s]')
    # beside the axes: no curve is below it
    made.legend(lines, list(joints), loc='outside upper center', ncols=6, frameon=False)
    return made
