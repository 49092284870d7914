# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Why the step cannot answer a setpoint: a leg does not reach it, or numbers overflow."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stewart_dynamics.mechanics.batch import missing_distances, unreached
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.setpoints.rejections import OUT_OF_RANGE, OUT_OF_REACH, stamp_words
from stewart_dynamics.setpoints.step import Batch, Outputs


def unanswered(parameters: Parameters, setpoints: Batch, outputs: Outputs,
               ) -> Iterator[tuple[str, str, int]]:
    """Yield each reason, with the details of its first setpoint and the number of setpoints."""
    if len(outputs.stamps) == len(setpoints.stamps):
        return
    left = setpoints.chosen(~outputs.answered)
    distances = missing_distances(parameters.structure, left.motions)
    with np.errstate(invalid='ignore'):
        beyond = np.isfinite(distances).all(axis=1) & (distances > 0.0).any(axis=1)
    for reason, which in ((OUT_OF_REACH, beyond), (OUT_OF_RANGE, ~beyond)):
        if which.any():
            first = int(which.argmax())
            details = stamp_words(int(left.stamps[first]))
            if reason == OUT_OF_REACH:
                details += f': {unreached(parameters.joints, distances[first])}'
            yield reason, details, int(which.sum())
