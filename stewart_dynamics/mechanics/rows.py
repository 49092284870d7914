# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
The layout of a sample as a row of numbers.

All layers pass motions, wrenches, base motions and results as rows of float64, SI units, base
axes; ``rows[..., FORCES]`` is a quantity of all samples.
"""

from __future__ import annotations

import math

# A row of a motion. The rotation is row by row.
POSITION, ROTATION = slice(0, 3), slice(3, 12)
POSE = slice(0, 12)
LINEAR_VELOCITY, ANGULAR_VELOCITY = slice(12, 15), slice(15, 18)
TWIST = slice(12, 18)
LINEAR_ACCELERATION, ANGULAR_ACCELERATION = slice(18, 21), slice(21, 24)
ACCELERATION = slice(18, 24)
MOTION = 24

# A row of a wrench: force and moment, and their units.
WRENCH = 6
PARTS_OF_WRENCH = {'force': 'N', 'moment': 'N m'}

# A row of a base's motion, base axes. One of nan adds no load: the base is still, or its motion is
# not known.
GRAVITY, BASE_ACCELERATION = slice(0, 3), slice(3, 6)
BASE_ANGULAR_VELOCITY, BASE_ANGULAR_ACCELERATION = slice(6, 9), slice(9, 12)
BASE = 12
NO_BASE = (math.nan,) * BASE

# A row of a result.
LENGTHS, RATES, FORCES = slice(0, 6), slice(6, 12), slice(12, 18)
UNIT_LOAD_FORCES = slice(18, 24)
DETERMINANT, DETERMINANT_RATE, CONDITION = 24, 25, 26
RESULT = 27

# A row of joint angles, see ``joint_angles``.
BASE_JOINT_ANGLES, PLATFORM_JOINT_ANGLES = slice(0, 6), slice(6, 12)
JOINT_ANGLES = 12

# Constants of one screw: its pitch [m/rad], and the unit vectors of the axes of the universal
# joints, fixed to the base, base axes, and to the platform, platform axes.
PITCH, BASE_AXIS, PLATFORM_AXIS = 0, slice(1, 4), slice(4, 7)
SCREW = 7


def consecutive(*sizes: int) -> tuple[slice, ...]:
    """Return the slices of consecutive parts of these sizes."""
    ends = [sum(sizes[:n + 1]) for n in range(len(sizes))]
    return tuple(slice(end - size, end) for end, size in zip(ends, sizes, strict=True))
