# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
The layout of a sample as a row of numbers: that of the structures in C.

All layers pass motions, wrenches, base motions and results as rows of float64, SI units, base
axes; ``rows[..., FORCES]`` is a quantity of all samples.
"""

from __future__ import annotations

import math

from stewart_dynamics.core.binding import places

# A row of a motion. The rotation is row by row.
(POSITION, ROTATION, LINEAR_VELOCITY, ANGULAR_VELOCITY, LINEAR_ACCELERATION,
 ANGULAR_ACCELERATION) = places('stewart_motion').values()
POSE, TWIST = slice(0, ROTATION.stop), slice(ROTATION.stop, ANGULAR_VELOCITY.stop)
ACCELERATION = slice(ANGULAR_VELOCITY.stop, ANGULAR_ACCELERATION.stop)
MOTION: int = ANGULAR_ACCELERATION.stop

# A row of a wrench: force and moment, and their units.
WRENCH = 6
PARTS_OF_WRENCH = {'force': 'N', 'moment': 'N m'}

# A row of a base's motion, base axes. One of nan adds no load: the base is still, or its motion is
# not known.
GRAVITY, BASE_ACCELERATION, BASE_ANGULAR_VELOCITY, BASE_ANGULAR_ACCELERATION = places(
    'stewart_base').values()
BASE: int = BASE_ANGULAR_ACCELERATION.stop
NO_BASE: tuple[float, ...] = (math.nan,) * BASE

# A row of a result.
DETERMINANT: int
DETERMINANT_RATE: int
CONDITION: int
(LENGTHS, RATES, FORCES, DETERMINANT, DETERMINANT_RATE, CONDITION, UNIT_LOAD_FORCES,
 JOINT_FORCES, ANGLES, SPEEDS, TORQUES, LEVERS) = places('stewart_result').values()
RESULT: int = LEVERS.stop

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
