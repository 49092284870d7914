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


"""
Forward dynamics under motor torques: how the platform accelerates, and with which leg forces.

The load of a screw is (k torque - m_r L'') / c, see ``motors``: under a torque a leg has the force
k torque / c and the reflected mass m_r / c. c depends on the direction of the power, which is
assumed, and assumed again where the load that follows contradicts it. The acceleration of a leg's
twist, which adds little to the torque of its motor, is found by the same iteration.
"""

from __future__ import annotations

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import compiled
from stewart_dynamics.mechanics.drives.motors import (
    clipped, curve_torque, motor_motion, ratio_and_mass, torque_factor)
from stewart_dynamics.mechanics.dynamics.forward_dynamics import acceleration
from stewart_dynamics.mechanics.dynamics.hexapod_constants import (
    CONSTANTS, put_reflected_mass)
from stewart_dynamics.mechanics.rows import ACCELERATION, consecutive

# Scratch memory: constants with other reflected masses, forces, assumed directions of the power,
# factors c, and torques for the twist of the legs.
_CHANGED, _FORCES, _POWER, _FACTOR, _OF_TWIST = consecutive(CONSTANTS, 6, 6, 6, 6)
SCRATCH = _OF_TWIST.stop

# Solutions until one is taken as it is; one or two are enough but where loads are near zero.
_MOST_ATTEMPTS = 64
# From this one on a single direction is changed at a time, which ends for every hexapod.
_CAREFUL = 8
# Relative change of the torque for the twist, above rounding errors.
_UNCHANGED = 1e-14


@compiled
def torque_acceleration(
        constants: Array, drives: Array, torque_max: Array, curve: Array, motion: Array,
        torques: Array, others: Array, wrench: Array, base: Array, work: Array, scratch: Array,
        forces: Array) -> None:
    """
    Write the acceleration of a motion under motor torques, and the forces of the legs.

    Parameters
    ----------
    constants, motion, wrench, base, work
        As in ``forward_dynamics.acceleration``.
    drives, torque_max, curve
        As in ``motor_rows``; torques are clipped in place to those available.
    torques : (6,)
        [N m], + extends.
    others : (6,)
        Forces along the legs that do not pass through their screws [N].
    scratch : (SCRATCH,)
        Scratch memory.
    forces : (6,)
        Written: forces of the legs as ``inverse_dynamics`` has them [N].

    """
    changed, pushes = scratch[_CHANGED], scratch[_FORCES]
    power, factor, of_twist = scratch[_POWER], scratch[_FACTOR], scratch[_OF_TWIST]
    for n in range(CONSTANTS):
        changed[n] = constants[n]
    for n in range(6):
        motion[ACCELERATION.start + n] = 0.0
    for leg in range(6):
        _, speed, _, rate, _ = motor_motion(constants, drives[leg], leg, motion)
        torques[leg] = clipped(torques[leg], min(torque_max[leg], curve_torque(curve, speed)))
        power[leg] = torques[leg] * rate
        of_twist[leg] = 0.0
    for attempt in range(_MOST_ATTEMPTS):
        for leg in range(6):
            ratio, mass = ratio_and_mass(drives[leg])
            _, _, _, rate, _ = motor_motion(constants, drives[leg], leg, motion)
            factor[leg] = torque_factor(drives[leg], power[leg], rate)
            put_reflected_mass(changed, leg, mass / factor[leg])
            pushes[leg] = ratio * (torques[leg] - of_twist[leg]) / factor[leg] + others[leg]
        acceleration(changed, motion, pushes, wrench, base, work)
        settled = True
        for leg in range(6):
            ratio, mass = ratio_and_mass(drives[leg])
            _, _, speed_rate, rate, acc = motor_motion(constants, drives[leg], leg, motion)
            load = (ratio * (torques[leg] - of_twist[leg]) - mass * acc) / factor[leg]
            forces[leg] = load + mass * acc
            own = mass / ratio / ratio * (speed_rate - ratio * acc)
            if abs(own - of_twist[leg]) > _UNCHANGED * abs(torques[leg]):
                settled = False
            of_twist[leg] = own
            if (load * rate > 0.0) != (power[leg] > 0.0) and (
                    settled or attempt < _CAREFUL):
                power[leg] = load * rate
                settled = False
        if settled:
            break
