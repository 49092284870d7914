# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The confidence level of all intervals, and their width."""

from __future__ import annotations

CONFIDENCE_LEVEL = 0.95
"""Probability with which an interval holds the true value."""
TWO_SIDED = 1.9599639845400536
"""
Standard deviations on either side of the mean that have it in a normal distribution.

``statistics``, which computes it, would stay in the memory of the node.
"""
PERCENT = f'{100.0 * CONFIDENCE_LEVEL:.3g} %'
INTERVAL = f'{PERCENT} interval'
