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
The motors of the legs: angle, speed, torque, current, power and copper heat; compiled.

A motor turns k = 2 pi gear_ratio / lead radians for each metre of its leg, + extends. The force f
of the leg is that of ``inverse_dynamics``, with friction and reflected mass m_r; the part through
the screw is the load f - m_r L'', and J = m_r / k^2 is the inertia at the motor's shaft:

    torque = (f - m_r L'') c / k + J angle''
    c = 1 + (1 / efficiency - 1) sat(|L'| / coulomb_velocity)              the motor drives
    c = 1 + (back_driving_efficiency - 1) sat(|L'| / coulomb_velocity)     the leg drives

The losses are friction proportional to the load, and like Coulomb friction they are linear near
standstill (``friction``): the torque does not jump where a leg reverses. At rest it is the one
without losses. There friction can help to hold or be in the way, whichever way the leg moves off:
the larger of the two torques, the breakaway torque, is what limits are checked with.

    current = torque / torque_constant        copper heat = resistance current^2
    power = torque speed + copper heat        from the bus; where it is negative, back to the bus

Where the screw turns with the leg, by its twist (``leg_twist``), a right-handed thread extends
the leg by lead / (2 pi) for each radian. The motor takes that back: gear_ratio times the twist is
subtracted from its angle, added where the thread is left-handed. The moments of the screws about
the legs' axes, force times lead / (2 pi), are not part of the leg forces.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import entry_point, inlined
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics import batch
from stewart_dynamics.mechanics.dynamics.bodies import leg_line
from stewart_dynamics.mechanics.dynamics.hexapod_constants import hexapod_constants
from stewart_dynamics.mechanics.kinematics.home_pose import homes
from stewart_dynamics.mechanics.kinematics.leg_joints import home_directions, mounts
from stewart_dynamics.mechanics.limits import TOLERANCE
from stewart_dynamics.mechanics.rows import (
    ANGULAR_ACCELERATION, ANGULAR_VELOCITY, consecutive, FORCES, LINEAR_ACCELERATION,
    LINEAR_VELOCITY, POSITION, ROTATION)
from stewart_dynamics.mechanics.vectors import (
    add, cross, dot, read3, read9, rotate, scale, subtract, Vector3)
from stewart_dynamics.parameters.table import Parameters, RIGHT, UNIVERSAL


@inlined
def leg_twist(u: Vector3, w: Vector3, w_rate: Vector3, w_acc: Vector3, s: Vector3,
              s_rate: Vector3, s_acc: Vector3) -> tuple[float, float, float]:
    """
    Return the twist of a leg between its universal joints [rad], its rate and its acceleration.

    Each universal joint turns about an axis u that is fixed to the base, or w = R w_P that is
    fixed to the platform, and about an axis across the leg and across the first: the latter axes,
    along ``u x s`` and ``w x s``, are fixed to the cylinder and to the piston. The angle from one
    to the other about s, right-handed, is the turn of the piston against the cylinder:

        twist = atan2(y, x)    y = s . (u x w)    x = u . w - (u . s)(w . s)

    y and x are sine and cosine times ``|u x s| |w x s|``; where x is positive, the twist is the
    arcsine of the product of the unit vectors along s x (u x s) and w x s. All in base axes.
    """
    u_s, u_s_rate, u_s_acc = dot(u, s), dot(u, s_rate), dot(u, s_acc)
    w_s, w_s_rate = dot(w, s), dot(w_rate, s) + dot(w, s_rate)
    w_s_acc = dot(w_acc, s) + 2.0 * dot(w_rate, s_rate) + dot(w, s_acc)
    normal, normal_rate, normal_acc = cross(u, w), cross(u, w_rate), cross(u, w_acc)
    y = dot(s, normal)
    y_rate = dot(s_rate, normal) + dot(s, normal_rate)
    y_acc = dot(s_acc, normal) + 2.0 * dot(s_rate, normal_rate) + dot(s, normal_acc)
    x = dot(u, w) - u_s * w_s
    x_rate = dot(u, w_rate) - u_s_rate * w_s - u_s * w_s_rate
    x_acc = dot(u, w_acc) - u_s_acc * w_s - 2.0 * u_s_rate * w_s_rate - u_s * w_s_acc
    square = x * x + y * y
    inverse = 1.0 / square if square > 0.0 else math.nan
    rate = (x * y_rate - y * x_rate) * inverse
    return math.atan2(y, x), rate, (
        x * y_acc - y * x_acc - 2.0 * (x * x_rate + y * y_rate) * rate) * inverse


@inlined
def turned(w: Vector3, omega: Vector3, alpha: Vector3) -> tuple[Vector3, Vector3]:
    """Return first and second derivative of a vector that turns with the platform."""
    rate = cross(omega, w)
    return rate, add(cross(alpha, w), cross(omega, rate))


# A row of the six motors' quantities. Commands are the torques of the forces that are published,
# clipped to the available torques.
(ANGLES, SPEEDS, COMMANDS, BREAKAWAY_TORQUES, TORQUES, ACCELERATIONS, CURRENTS, POWER, COPPER_HEAT,
 AVAILABLE_TORQUES) = consecutive(*[6] * 10)
MOTORS = 60
# Columns in the order of the C source.
MECHANICAL = np.r_[ANGLES, SPEEDS, ACCELERATIONS, TORQUES]

# Constants of one drive.
(_RATIO, _ZERO, _MASS, _DRIVING, _DRIVEN, _SLOW, _TORQUE_CONSTANT, _RESISTANCE, TWIST,
 BASE_AXIS) = range(10)
PLATFORM_AXIS = 12
_DRIVE = 15

# Sine of the angle between a leg and the fixed axis of its universal joint.
_ALONG_A_LEG = 0.1


class Motors(NamedTuple):
    """
    The six motors in a motion, (..., 6) each; nan where ``drive.*`` does not give them.

    Attributes
    ----------
    angles, speeds, accelerations : (..., 6)
        [rad], [rad/s], [rad/s^2]; + extends the leg. The angle is zero where the published leg
        position is zero.
    torques : (..., 6)
        [N m]; at rest the one without losses.
    currents : (..., 6)
        [A]
    power : (..., 6)
        Electrical power [W]; where it is negative, power flows back to the bus.
    copper_heat : (..., 6)
        Part of it that heats the winding [W].
    breakaway_torques : (..., 6)
        [N m]; torques that limits are checked with: at rest, where the leg can move off either
        way, the larger one.
    available_torques : (..., 6)
        Largest torque at this speed, by ``drive.torque_max`` and ``drive.torque_speed`` [N m].

    """

    angles: Array
    speeds: Array
    accelerations: Array
    torques: Array
    currents: Array
    power: Array
    copper_heat: Array
    breakaway_torques: Array
    available_torques: Array

    @classmethod
    def of_rows(cls, rows: Array) -> Motors:
        """Return the motors of rows (..., MOTORS)."""
        return cls(*(rows[..., part] for part in (
            ANGLES, SPEEDS, ACCELERATIONS, TORQUES, CURRENTS, POWER, COPPER_HEAT,
            BREAKAWAY_TORQUES, AVAILABLE_TORQUES)))

    @property
    def margins(self) -> Array:
        """Return available less breakaway torques (..., 6) [N m]; negative where exceeded."""
        margins: Array = self.available_torques - np.abs(self.breakaway_torques)
        return margins

    def __repr__(self) -> str:
        """Return the shape, not the arrays."""
        return f'<Motors of shape {self.angles.shape[:-1]}: {", ".join(self._fields)}>'


@inlined
def torque_factor(drive: Array, power: float, rate: float) -> float:
    """Return c for a rate of the leg and the sign of the power that its load takes."""
    slip = abs(rate) / drive[_SLOW]
    loss: float = drive[_DRIVING] if power > 0.0 else drive[_DRIVEN]
    return 1.0 + loss * (1.0 if slip > 1.0 else slip)


@inlined
def screw_torque(drive: Array, load: float, rate: float) -> float:
    """Return the torque at the motor for a load [N] of the screw at a rate of the leg."""
    torque: float = load / drive[_RATIO] * torque_factor(drive, load * rate, rate)
    return torque


@inlined
def ratio_and_mass(drive: Array) -> tuple[float, float]:
    """Return k [rad/m] and the reflected mass [kg] of a drive."""
    return drive[_RATIO], drive[_MASS]


@inlined
def curve_torque(curve: Array, speed: float) -> float:
    """Return the torque of a torque-speed curve (n, 2) at a speed; inf without points."""
    points = len(curve)
    if points == 0:
        return math.inf
    speed = abs(speed)
    torque: float = curve[0, 1]
    for n in range(1, points):
        if speed > curve[n - 1, 0]:
            part = min((speed - curve[n - 1, 0]) / (curve[n, 0] - curve[n - 1, 0]), 1.0)
            torque = curve[n - 1, 1] + part * (curve[n, 1] - curve[n - 1, 1])
    return 0.0 if speed > curve[points - 1, 0] * (1.0 + TOLERANCE) else torque


@inlined
def clipped(torque: float, available: float) -> float:
    """Return a torque limited to +- available; nan stays nan."""
    return (available if torque > available else -available if torque < -available else torque)


@inlined
def motor_motion(constants: Array, drive: Array, leg: int, motion: Array,
                 ) -> tuple[float, float, float, float, float]:
    """Return angle, speed and acceleration of a motor, and rate and acceleration of its leg."""
    rotation = read9(motion, ROTATION.start)
    omega = read3(motion, ANGULAR_VELOCITY.start)
    alpha = read3(motion, ANGULAR_ACCELERATION.start)
    a, length, inverse_length, s = leg_line(
        constants, leg, read3(motion, POSITION.start), rotation)
    a_rate, a_acc = turned(a, omega, alpha)
    x_rate = add(read3(motion, LINEAR_VELOCITY.start), a_rate)
    x_acc = add(read3(motion, LINEAR_ACCELERATION.start), a_acc)
    rate = dot(s, x_rate)
    s_rate = scale(inverse_length, subtract(x_rate, scale(rate, s)))
    acc = dot(s, x_acc) + length * dot(s_rate, s_rate)
    ratio = drive[_RATIO]
    angle, speed, speed_rate = ratio * (length - drive[_ZERO]), ratio * rate, ratio * acc
    if drive[TWIST] != 0.0:
        s_acc = scale(inverse_length, subtract(
            subtract(x_acc, scale(acc, s)), scale(2.0 * rate, s_rate)))
        w = rotate(rotation, read3(drive, PLATFORM_AXIS))
        w_rate, w_acc = turned(w, omega, alpha)
        twist, twist_rate, twist_acc = leg_twist(
            read3(drive, BASE_AXIS), w, w_rate, w_acc, s, s_rate, s_acc)
        angle += drive[TWIST] * twist
        speed += drive[TWIST] * twist_rate
        speed_rate += drive[TWIST] * twist_acc
    return angle, speed, speed_rate, rate, acc


@inlined
def put_motors(constants: Array, drives: Array, torque_max: Array, curve: Array, motion: Array,
               demanded: Array, forces: Array, row: Array) -> None:
    """Write the motors of a motion and its demanded forces (6,); see ``motor_rows``."""
    for leg in range(6):
        drive = drives[leg]
        angle, speed, speed_rate, rate, acc = motor_motion(constants, drive, leg, motion)
        ratio, mass = ratio_and_mass(drive)
        own = mass / ratio / ratio * speed_rate
        load = demanded[leg] - mass * acc
        torque = own + screw_torque(drive, load, rate)
        breakaway = torque
        if abs(rate) < drive[_SLOW]:
            breakaway = own + load / ratio * (1.0 + drive[_DRIVING])
            other = own + load / ratio * (1.0 + drive[_DRIVEN])
            if abs(other) > abs(breakaway):
                breakaway = other
        available = min(torque_max[leg], curve_torque(curve, speed))
        command = own + screw_torque(drive, forces[leg] - mass * acc, rate)
        current = torque / drive[_TORQUE_CONSTANT]
        heat = drive[_RESISTANCE] * current * current
        row[ANGLES.start + leg] = angle
        row[SPEEDS.start + leg] = speed
        row[COMMANDS.start + leg] = clipped(command, available)
        row[BREAKAWAY_TORQUES.start + leg] = breakaway
        row[TORQUES.start + leg] = torque
        row[ACCELERATIONS.start + leg] = speed_rate
        row[CURRENTS.start + leg] = current
        row[POWER.start + leg] = torque * speed + heat
        row[COPPER_HEAT.start + leg] = heat
        row[AVAILABLE_TORQUES.start + leg] = available


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]',
             'f8[:,::1]', 'f8[:,::1]')
def motor_rows(constants: Array, drives: Array, torque_max: Array, curve: Array, motions: Array,
               results: Array, forces: Array, rows: Array) -> None:
    """
    Write the motors of each motion.

    constants (CONSTANTS,), drives (6, 15): constants of the hexapod, and of the drives.
    torque_max (6,): [N m]
    curve (n, 2): speed and torque at the points of the torque-speed curve [rad/s, N m].
    motions (N, MOTION), results (N, RESULT): motions, their results of ``inverse_dynamics``.
    forces (N, 6): forces of the legs for which commands are written [N].
    rows (N, MOTORS): written.
    """
    for n in range(len(motions)):
        put_motors(constants, drives, torque_max, curve, motions[n], results[n, FORCES],
                   forces[n], rows[n])


class Drives:
    """
    The motors of a hexapod: rows of motions and of their results to rows of motors.

    arguments: the first of ``motor_rows``: constants of hexapod and drives, limits of torque.
    """

    def __init__(self, parameters: Parameters) -> None:
        curve = parameters['drive.torque_speed']
        self.arguments = (
            hexapod_constants(parameters), drive_constants(parameters),
            np.array(_six(parameters, 'drive.torque_max', math.inf)),
            np.empty((0, 2)) if curve is None else np.array(curve))

    def __call__(self, motions: Array, results: Array) -> Array:
        """Return rows (N, MOTORS) for rows of motion and results, unchecked."""
        rows = np.empty((len(motions), MOTORS))
        batch.in_parts(motor_rows, self.arguments, *map(batch.compact, (
            motions, results, results[:, FORCES])), rows)
        return rows


def motor_ratio(parameters: Parameters) -> Array:
    """Return the turn of the motors for a metre of their legs (6,) [rad/m]; nan if not given."""
    with np.errstate(over='ignore'):
        ratio: Array = (2.0 * math.pi * parameters['drive.gear_ratio']
                        / _six(parameters, 'actuator.screw_lead', math.nan))
    return ratio


def drive_constants(p: Parameters) -> Array:
    """Return the constants (6, 15) of the drives; nan where they are not given."""
    turn: Array = np.zeros(6)
    axes: Array = np.zeros((6, 6))
    if p['drive.screw_rotation'] == UNIVERSAL:
        turn = p['drive.gear_ratio'] * (-1.0 if p['drive.screw_hand'] == RIGHT else 1.0)
        axes = _universal_axes(p)
    return np.column_stack([
        motor_ratio(p), p['geometry.zero_length'], p['actuator.reflected_mass'],
        1.0 / p['drive.efficiency'] - 1.0, p['drive.back_driving_efficiency'] - 1.0,
        p['actuator.coulomb_velocity'], _six(p, 'drive.torque_constant', math.nan),
        _six(p, 'drive.resistance', math.nan), turn, axes])


def _universal_axes(p: Parameters) -> Array:
    """Return the unit vectors (6, 6) of the axes fixed to base, base axes, and to platform."""
    rotation = homes(p)[1][0]
    base = p['drive.base_universal_axes']
    base = mounts(p)[:, :, 0] if base is None else base
    platform = p['drive.platform_universal_axes']
    platform = base @ rotation if platform is None else platform
    base, platform = (axes / np.linalg.norm(axes, axis=1, keepdims=True)
                      for axes in (base, platform))
    s, w = home_directions(p).base, platform @ rotation.T
    for end, axes in (('base', base), ('platform', w)):
        sine = np.linalg.norm(np.cross(axes, s), axis=1)
        if np.any(sine < _ALONG_A_LEG):
            raise ParameterError(
                f'{p.source}: drive.{end}_universal_axes: {p["joints"][int(np.argmin(sine))]}: '
                'along the leg at the home pose: must be across it')
    # The axis of a joint has no sense: of its two directions the one with the smaller twist.
    cosine = np.sum(base * w, axis=1) - np.sum(base * s, axis=1) * np.sum(w * s, axis=1)
    return np.column_stack([base, np.where(cosine < 0.0, -1.0, 1.0)[:, None] * platform])


def _six(p: Parameters, name: str, missing: float) -> Array:
    value: Array = np.full(6, missing) if p[name] is None else p[name]
    return value
