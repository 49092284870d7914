# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The constants of a hexapod as one array, for all compiled functions.

The constants of the platform come first, then 15 for each leg, then those of the screws
(``drives.screws``). Products of masses and distances of a leg that do not change with its length
are computed here.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import inlined
from stewart_dynamics.mechanics.drives.screws import screw_constants
from stewart_dynamics.mechanics.rows import BASE_AXIS, PITCH, PLATFORM_AXIS, SCREW
from stewart_dynamics.mechanics.vectors import read3, Symmetric3, Vector3
from stewart_dynamics.parameters.table import Parameters

_GRAVITY, _CHARACTERISTIC_LENGTH = 0, 3
_PLATFORM_MASS, _PLATFORM_CENTER, _PLATFORM_INERTIA = 4, 5, 8
_FIRST_LEG = 14
# Offsets of the constants of a leg from its first one.
_BASE_JOINT, _PLATFORM_JOINT = 0, 3
_PISTON_MASS, _PISTON_CENTER, _CYLINDER_MOMENT, _JOINT_INERTIA = 6, 7, 8, 9
_REFLECTED_MASS, _VISCOUS_FRICTION, _COULOMB_FRICTION, _COULOMB_VELOCITY = 10, 11, 12, 13
_CYLINDER_MASS = 14
_LEG = 15

_FIRST_SCREW = _FIRST_LEG + 6 * _LEG
CONSTANTS = _FIRST_SCREW + 6 * SCREW


class Leg(NamedTuple):
    """The constants of one leg but for its joints."""

    piston_mass: float  # [kg]
    piston_center: float  # distance of its center of mass from the platform joint [m]
    cylinder_moment: float  # mass times distance of the center of mass from the base joint [kg m]
    joint_inertia: float
    """About the base joint: cylinder mass * CoM^2 + the inertias of both parts [kg m^2]."""
    reflected_mass: float  # of the actuator [kg]
    viscous_friction: float  # [N s/m]
    coulomb_friction: float  # [N]
    coulomb_velocity: float  # rate below which Coulomb friction is linear [m/s]
    cylinder_mass: float  # [kg]


def hexapod_constants(p: Parameters) -> Array:
    """Return the constants (CONSTANTS,) of a hexapod, SI units."""
    return constants_with(p, screw_constants(p))


def constants_with(p: Parameters, screws: Array) -> Array:
    """Return the constants (CONSTANTS,) of a hexapod with given screws (6, SCREW)."""
    cylinder_mass, cylinder_center = p['legs.cylinder.mass'], p['legs.cylinder.center_of_mass']
    legs = np.column_stack([
        p['geometry.base_joints'], p['geometry.platform_joints'],
        p['legs.piston.mass'], p['legs.piston.center_of_mass'],
        cylinder_mass * cylinder_center,
        cylinder_mass * cylinder_center ** 2 + p['legs.cylinder.inertia']
        + p['legs.piston.inertia'],
        p['actuator.reflected_mass'], p['actuator.viscous_friction'],
        p['actuator.coulomb_friction'], p['actuator.coulomb_velocity'], cylinder_mass])
    return np.concatenate([
        p['gravity'], [p['singularity.characteristic_length'], p['platform.mass']],
        p['platform.center_of_mass'], p['platform.inertia'], legs.ravel(), screws.ravel()])


@inlined
def gravity_of(constants: Array) -> Vector3:
    """Return the acceleration of free fall, base axes [m/s^2]."""
    return read3(constants, _GRAVITY)


@inlined
def characteristic_length_of(constants: Array) -> float:
    """Return the length by which moments are divided [m]."""
    length: float = constants[_CHARACTERISTIC_LENGTH]
    return length


@inlined
def platform_of(constants: Array) -> tuple[float, Vector3, Symmetric3]:
    """Return mass, center of mass and inertia about it (xx xy xz yy yz zz), platform axes."""
    o = _PLATFORM_INERTIA
    return (constants[_PLATFORM_MASS], read3(constants, _PLATFORM_CENTER),
            (constants[o], constants[o + 1], constants[o + 2], constants[o + 3],
             constants[o + 4], constants[o + 5]))


@inlined
def joints_of(constants: Array, leg: int) -> tuple[Vector3, Vector3]:
    """Return a leg's base joint, base frame, and platform joint, platform frame [m]."""
    o = _FIRST_LEG + leg * _LEG
    return read3(constants, o + _BASE_JOINT), read3(constants, o + _PLATFORM_JOINT)


@inlined
def leg_of(constants: Array, leg: int) -> Leg:
    """Return a leg's other constants."""
    o = _FIRST_LEG + leg * _LEG
    return Leg(
        constants[o + _PISTON_MASS], constants[o + _PISTON_CENTER],
        constants[o + _CYLINDER_MOMENT], constants[o + _JOINT_INERTIA],
        constants[o + _REFLECTED_MASS], constants[o + _VISCOUS_FRICTION],
        constants[o + _COULOMB_FRICTION], constants[o + _COULOMB_VELOCITY],
        constants[o + _CYLINDER_MASS])


@inlined
def put_reflected_mass(constants: Array, leg: int, mass: float) -> None:
    """Write the reflected mass of a leg's actuator [kg]."""
    constants[_FIRST_LEG + leg * _LEG + _REFLECTED_MASS] = mass


@inlined
def coulomb_velocity_of(constants: Array, leg: int) -> float:
    """Return the rate of a leg below which its Coulomb friction is linear [m/s]."""
    velocity: float = constants[_FIRST_LEG + leg * _LEG + _COULOMB_VELOCITY]
    return velocity


@inlined
def screw_pitch_of(constants: Array, leg: int) -> float:
    """Return how far the drive of a leg moves for a turn of its leg [m/rad]; 0 where guided."""
    pitch: float = constants[_FIRST_SCREW + leg * SCREW + PITCH]
    return pitch


@inlined
def screws_turn(constants: Array) -> bool:
    """Return whether the screws turn with their legs."""
    return screw_pitch_of(constants, 0) != 0.0


@inlined
def universal_axes_of(constants: Array, leg: int) -> tuple[Vector3, Vector3]:
    """Return the axes of a leg's universal joints: fixed to base, and to platform, their axes."""
    o = _FIRST_SCREW + leg * SCREW
    return read3(constants, o + BASE_AXIS.start), read3(constants, o + PLATFORM_AXIS.start)
