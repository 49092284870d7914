# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The motors of the legs: angle, speed, torque, current, power and copper heat; compiled.

A motor turns k = 2 pi gear_ratio / lead radians for each metre of its drive's coordinate q, which
is the length L of its leg, + extends. The force f of the leg is that of ``inverse_dynamics``, with
friction and reflected mass m_r; the part through the screw is the load f - m_r q'', and
J = m_r / k^2 is the inertia at the motor's shaft:

    torque = (f - m_r q'') c / k + J angle''
    c = 1 + (1 / efficiency - 1) sat(|q'| / coulomb_velocity)              the motor drives
    c = 1 + (back_driving_efficiency - 1) sat(|q'| / coulomb_velocity)     the leg drives

The losses are friction proportional to the load, and like Coulomb friction they are linear near
standstill (``friction``): the torque does not jump where a leg reverses. At rest it is the one
without losses. There friction can help to hold or be in the way, whichever way the leg moves off:
the larger of the two torques, the breakaway torque, is what limits are checked with.

    current = torque / torque_constant        copper heat = resistance current^2
    power = torque speed + copper heat        from the bus; where it is negative, back to the bus

Where the screw turns with the leg, by its twist, a right-handed thread extends the leg by
lead / (2 pi) for each radian. The motor takes that back: q is L less that extension
(``drives.screws``), gear_ratio times the twist is subtracted from the angle, added where the
thread is left-handed. The moments of the screws about the legs' axes, force times lead / (2 pi),
are part of the leg forces: the torque of an ideal screw is f / k, and its power f q'.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import NamedTuple, TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import entry_point, inlined
from stewart_dynamics.mechanics import batch
from stewart_dynamics.mechanics.dynamics.bodies import drive_motion
from stewart_dynamics.mechanics.dynamics.hexapod_constants import hexapod_constants
from stewart_dynamics.mechanics.leg_curves import columns, figure, LEGS
from stewart_dynamics.mechanics.limits import TOLERANCE
from stewart_dynamics.mechanics.rows import (
    ANGULAR_ACCELERATION, ANGULAR_VELOCITY, consecutive, FORCES, LINEAR_ACCELERATION,
    LINEAR_VELOCITY, POSITION, ROTATION)
from stewart_dynamics.mechanics.vectors import read3, read9
from stewart_dynamics.parameters.table import Parameters

if TYPE_CHECKING:
    from matplotlib.figure import Figure


# A row of the six motors' quantities. Commands are the torques of the forces that are published,
# clipped to the available torques.
(ANGLES, SPEEDS, COMMANDS, BREAKAWAY_TORQUES, TORQUES, ACCELERATIONS, CURRENTS, POWER, COPPER_HEAT,
 AVAILABLE_TORQUES) = consecutive(*[6] * 10)
MOTORS = 60
# Columns in the order of the C source.
MECHANICAL = np.r_[ANGLES, SPEEDS, ACCELERATIONS, TORQUES]

# Constants of one drive.
(_RATIO, _ZERO, _MASS, _DRIVING, _DRIVEN, _SLOW, _TORQUE_CONSTANT, _RESISTANCE) = range(8)
DRIVE = 8


# Columns of a table of motors, in the order of Motors.
_COLUMNS = ('angle', 'speed', 'acceleration', 'torque', 'current', 'power', 'copper_heat',
            'breakaway_torque', 'available_torque')


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

    def to_dict(self) -> dict[str, Array]:
        """
        Return the numbers as columns, each (N,), as ``pandas.DataFrame`` takes them.

        Leading shapes are flattened; SI units. The columns of the motors end in _1 to _6.
        """
        return columns(dict(zip(_COLUMNS, self, strict=True)))

    def plot(self, times: ArrayLike | None = None, joints: Sequence[str] = LEGS) -> Figure:
        """
        Return a matplotlib figure of speeds and torques, and of currents and power if known.

        Arguments and errors are those of ``InverseDynamics.plot``.
        """
        curves = {'speed [rad/s]': self.speeds, 'torque [N m]': self.torques,
                  'current [A]': self.currents, 'power [W]': self.power}
        known = {name: each for name, each in curves.items() if np.isfinite(each).any()}
        return figure(known or curves, times, joints)

    def __repr__(self) -> str:
        """Return the shape, not the arrays."""
        return f'<Motors of shape {self.angles.shape[:-1]}: {", ".join(self._fields)}>'


@inlined
def torque_factor(drive: Array, power: float, rate: float) -> float:
    """Return c for a rate of the drive and the sign of the power that its load takes."""
    slip = abs(rate) / drive[_SLOW]
    loss: float = drive[_DRIVING] if power > 0.0 else drive[_DRIVEN]
    return 1.0 + loss * (1.0 if slip > 1.0 else slip)


@inlined
def screw_torque(drive: Array, load: float, rate: float) -> float:
    """Return the torque at the motor for a load [N] of the screw at a rate of the drive."""
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
    """Return angle, speed and acceleration of a motor, and rate and acceleration of its drive."""
    coordinate, rate, acc = drive_motion(
        constants, leg, read3(motion, POSITION.start), read9(motion, ROTATION.start),
        read3(motion, LINEAR_VELOCITY.start), read3(motion, ANGULAR_VELOCITY.start),
        read3(motion, LINEAR_ACCELERATION.start), read3(motion, ANGULAR_ACCELERATION.start))
    ratio = drive[_RATIO]
    return ratio * (coordinate - drive[_ZERO]), ratio * rate, ratio * acc, rate, acc


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

    constants (CONSTANTS,), drives (6, DRIVE): constants of the hexapod, and of the drives.
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
    """Return the constants (6, DRIVE) of the drives; nan where they are not given."""
    return np.column_stack([
        motor_ratio(p), p['geometry.zero_length'], p['actuator.reflected_mass'],
        1.0 / p['drive.efficiency'] - 1.0, p['drive.back_driving_efficiency'] - 1.0,
        p['actuator.coulomb_velocity'], _six(p, 'drive.torque_constant', math.nan),
        _six(p, 'drive.resistance', math.nan)])


def _six(p: Parameters, name: str, missing: float) -> Array:
    value: Array = np.full(6, missing) if p[name] is None else p[name]
    return value
