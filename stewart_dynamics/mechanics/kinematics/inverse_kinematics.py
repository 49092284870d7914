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

"""The leg lengths at a pose (1), in plain numpy: nothing has to be compiled for them."""

from __future__ import annotations

from typing import Any

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.dynamics.hexapod_constants import joints_of
from stewart_dynamics.mechanics.rows import POSE
from stewart_dynamics.mechanics.vectors import add, dot, rotate, subtract


def leg_lengths(constants: Array, poses: Array) -> Array:
    """
    Return the lengths (..., 6) [m] of the legs in poses (..., POSE), unchecked.

    All legs and samples go side by side through the operations of ``bodies.leg_line``, and get
    the same bits.
    """
    numbers: Any = [poses[..., n, None] for n in range(POSE.stop)]  # arrays for scalars
    legs: Any = np.arange(6)
    base_joints, platform_joints = joints_of(constants, legs)
    leg = subtract(add(numbers[:3], rotate(numbers[3:], platform_joints)), base_joints)
    lengths: Array = np.sqrt(dot(leg, leg))
    return lengths
