# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Tolerances that rules of parameters and the mechanics share."""

from typing import Any

from stewart_dynamics.core.binding import CONSTANTS

QUATERNION_TOLERANCE = CONSTANTS['QUATERNION_TOLERANCE']
"""The length of a given quaternion may differ from one by this; the quaternion is normalized."""

REFLECTED_MASS_TOLERANCE = 0.01
"""
Relative tolerance of actuator.reflected_mass if drive.* gives the inertias: both may be rounded.
"""

START_TOLERANCE = 0.01
"""
The legs may be this far from where a planned trajectory starts, in characteristic lengths: where
trajectory.approach has that checked.
"""

STAMPS_END = int(CONSTANTS['STAMPS_END'])
"""Stamps are less, and not less than its negative [ns]."""


def is_unit(length: Any) -> Any:
    """Return whether a quaternion's length, or each of an array, is one within the tolerance."""
    return abs(length - 1.0) <= QUATERNION_TOLERANCE


def unit_rule(length: float) -> str:
    """Return the rule that a quaternion of this length breaks, in words."""
    return f'length {length:.6g}, must be within {QUATERNION_TOLERANCE:g} of 1'
