# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Tolerances that rules of parameters and the mechanics share."""

from typing import Any

QUATERNION_TOLERANCE = 1e-3
"""The length of a given quaternion may differ from one by this; the quaternion is normalized."""

HYSTERESIS = 0.8
"""
A singularity warning or stop ends below this part of the condition number at which it began, or
when the predicted time to the crossing exceeds warn_time divided by it.
"""

REFLECTED_MASS_TOLERANCE = 0.01
"""
Relative tolerance of actuator.reflected_mass if drive.* gives the inertias: both may be rounded.
"""

START_TOLERANCE = 0.01
"""
The legs may be this far from where a planned trajectory starts, in characteristic lengths: where
trajectory.approach has that checked.
"""


def is_unit(length: Any) -> Any:
    """Return whether a quaternion's length, or each of an array, is one within the tolerance."""
    return abs(length - 1.0) <= QUATERNION_TOLERANCE


def unit_rule(length: float) -> str:
    """Return the rule that a quaternion of this length breaks, in words."""
    return f'length {length:.6g}, must be within {QUATERNION_TOLERANCE:g} of 1'
