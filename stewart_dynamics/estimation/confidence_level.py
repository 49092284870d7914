# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The confidence level of all intervals, and their width."""

from __future__ import annotations

from statistics import NormalDist

CONFIDENCE_LEVEL = 0.95
"""Probability with which an interval holds the true value."""
TWO_SIDED = NormalDist().inv_cdf(0.5 + 0.5 * CONFIDENCE_LEVEL)
"""Standard deviations on either side of the mean that have it in a normal distribution."""
PERCENT = f'{100.0 * CONFIDENCE_LEVEL:.3g} %'
INTERVAL = f'{PERCENT} interval'
