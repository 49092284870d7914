# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The width of intervals at the confidence level of all intervals."""

from __future__ import annotations

from statistics import NormalDist

from stewart_dynamics.estimation.confidence_level import CONFIDENCE_LEVEL, TWO_SIDED


def test_the_width_is_that_of_the_normal_distribution() -> None:
    assert NormalDist().inv_cdf(0.5 + 0.5 * CONFIDENCE_LEVEL) == TWO_SIDED
