# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Payload of the hexapods that a parameter file admits: ``stewart_capability --uncertainty``.

Each is rated like the hexapod of the file, at the same pose. Travel is the same for all of them:
it ends at limits of poses, and ``uncertainty.*`` has no geometry.
"""

from __future__ import annotations

import numpy as np

from stewart_dynamics.datasheet.datasheet_record import Band, UncertainPayload
from stewart_dynamics.datasheet.rated_hexapod import RatedHexapod
from stewart_dynamics.errors import PoseError
from stewart_dynamics.gpu.uncertain_structures import uncertain_parameters
from stewart_dynamics.reporting.block_statistics import finite

BAND = 2.5, 50.0, 97.5
"""Percentiles of the band and of its middle: 95 % of the hexapods are within."""


def uncertain_payload(hexapod: RatedHexapod, count: int) -> UncertainPayload:
    """Return the band of the payload at rest [kg], and how many carry none."""
    payloads = np.full(count, np.nan)
    if hexapod.loads.limits_forces:
        for n, parameters in enumerate(uncertain_parameters(hexapod.given, count)):
            try:
                each = RatedHexapod(parameters, hexapod.origin, hexapod.pivot)
                payloads[n] = np.ravel(each.loads.payload(each.pose, np.zeros(3)).value)[0]
            except PoseError:  # it does not hold itself: the file's own hexapod is within limits
                payloads[n] = 0.0
    known = np.isfinite(payloads)
    band = np.percentile(payloads, BAND) if known.all() else [np.nan] * 3
    return UncertainPayload(
        count, Band(*map(finite, band)), int((payloads[known] <= 0.0).sum()))
