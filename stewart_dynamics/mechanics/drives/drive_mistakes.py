# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Possible errors in ``drive.*``: units, shafts, and ratios that other parameters contradict."""

from __future__ import annotations

from collections.abc import Iterator
import math

import numpy as np

from stewart_dynamics.arrays import Array, RPM
from stewart_dynamics.mechanics.drives.motors import motor_ratio
from stewart_dynamics.parameters.table import MOTOR_INERTIA, Parameters, SCREW_INERTIA

# Screws and belts of legs have leads of 0.5 to 100 mm; in mm the number is at least this.
_LONGEST_LEAD = 0.5  # [m]
# 19,000 rpm: motors of legs have 300 to 1000 rad/s, and in rpm ten times the number.
_FASTEST_MOTOR = 2000.0  # [rad/s]
# Motors reach their speed in 5 to 200 ms under their peak torque; in kg cm^2 the number of the
# inertia is 1e4 times larger, in kg mm^2 1e6 times; in tonnes m^2 it is 1e3 times smaller.
_SLOWEST_START, _FASTEST_START = 5.0, 1e-4  # [s]
# The inertia of a screw at the motor's shaft is 0.05 to 5 times that of the rotor.
_LARGEST_SCREW = 20.0
# Continuous torque of a motor divided by the mass that its heat capacity is that of, as iron and
# copper have it: 0.2 to 5 N m/kg. With a time constant in minutes it is 60 times as large.
_HEAT_CAPACITY = 450.0  # [J/(kg K)]
_DENSEST_TORQUE = 10.0  # [N m/kg]
_OF_PEAK = 0.25  # continuous torque of a motor by its peak torque
# Copper heat at the peak torque divided by peak torque times maximum speed: 0.01 to 1.
_LARGEST_HEAT = 20.0
# Temperature rise of a winding at the continuous torque: 50 to 150 K.
_HOTTEST = 1500.0  # [K]
# A drive loses more when it is driven back: 2 - 1 / efficiency is never above the efficiency.
_BACK = 0.1
# How far drive and legs may miss each other's limits, and how well they must fit if corrected.
_MISSED, _FITS = 1.5, 1.2
# Force of the motors by limits.force_max: of a drive 0.7 to 1.5, of a thrust rating 3 and more
# where the rotor, not the rod, takes most of it.
_OF_A_CYLINDER = 2.5


def likely_mistakes(p: Parameters) -> Iterator[str]:
    """Yield possible errors in the drives, each in one line."""
    lead, ratio = p.actuator.screw_lead, p.drive.gear_ratio
    if lead is None or not p.drives:
        return
    speed, curve = p.drive.speed_max, p.drive.torque_speed
    if lead.max() >= _LONGEST_LEAD:
        yield f'actuator.screw_lead: {lead.max():g} m for one turn of the screw: in mm?'
        return
    for name, fastest in (('drive.speed_max', speed),
                          ('drive.torque_speed', None if curve is None else curve[-1:, 0])):
        if fastest is not None and fastest.max() > _FASTEST_MOTOR:
            yield (f'{name}: {fastest.max():g} rad/s, {fastest.max() * RPM:.0f} rpm: '
                   'in rpm?')
            return
    yield from _inertia(p)
    yield from _heat(p)
    forward, back = p.drive.efficiency, p.drive.back_driving_efficiency
    if np.any(back > forward + _BACK):
        at = int(np.argmax(back - forward))
        yield (f'drive.back_driving_efficiency: {back[at]:g}, but drive.efficiency is '
               f'{forward[at]:g}: a drive that loses this much loses more when it is driven back '
               f'(2 - 1 / efficiency is {2.0 - 1.0 / forward[at]:.3g}): exchanged?')
    if speed is None and curve is not None:
        speed = np.full(6, curve[-1, 0])
    torque = p.drive.torque_max
    if torque is None and curve is not None:
        torque = np.full(6, curve[:, 1].max())
    rate, force = p.limits.velocity_max, p.limits.force_max
    if torque is None:
        return
    k = motor_ratio(p)
    most = torque * k * p.drive.efficiency
    weight = p.carried.mass * float(np.linalg.norm(p.gravity)) / 6.0
    force = np.full(6, weight) if force is None else force
    # The reserve of both: above one, the drive cannot reach the limit of the leg.
    if most.min() > _OF_A_CYLINDER * force.max():
        yield from _thrust_rating(p, float(most.min()))
    loads = force / most
    speeds: Array = np.zeros(6)
    moves = moved = ''
    if rate is not None and speed is not None:
        speeds = rate * k / speed
        moves = f' and move a leg at {float((speed / k).min()):.3g} m/s'
        moved = f' and {rate.max():.3g} m/s'
    if max(loads.max(), speeds.max()) <= _MISSED:
        return
    said = (f'the motors can push {most.min():.3g} N{moves}, the legs need '
            f'{force.max():.3g} N{moved}')
    for factor, name, words in (
            (2.0 * math.pi * np.ones(6), 'actuator.screw_lead',
             f'{lead[0]:g} m: {said}: the travel for one radian? It is that of one turn'),
            (ratio ** 2, 'drive.gear_ratio', f'{ratio[0]:g}: {said}: inverted? It is the turns of '
             'the motor in one turn of the screw')):
        if max((loads * factor).max(), (speeds / factor).max()) <= _FITS and factor[0] != 1.0:
            yield f'{name}: {words}'
            return
    if weight > most.min():
        yield (f'drive.torque_max: {torque.min():g} N m: {said}: less than a sixth of the weight')


def _thrust_rating(p: Parameters, pushed: float) -> Iterator[str]:
    """Yield that the limit of the actuators' forces looks like one of the forces in the joints."""
    force, reflected = p.limits.force_max, p.actuator.reflected_mass
    carried = p.carried.mass / 6.0 + p.legs.piston.mass
    if p.limits.joint_force_max is not None or force is None or np.any(reflected < carried):
        return
    yield (f'limits.force_max: {force.max():.3g} N: the motors can push {pushed:.3g} N, of which '
           f'actuator.reflected_mass, {reflected.max():.3g} kg, takes more than the '
           f'{carried.max():.3g} kg that a leg carries: the thrust rating of a cylinder? It is '
           'limits.joint_force_max')


def _heat(p: Parameters) -> Iterator[str]:
    """Yield that windings would be heated as no motor is."""
    peak, lasting = p.drive.torque_max, p.drive.torque_continuous
    torque = lasting if lasting is not None or peak is None else _OF_PEAK * peak
    resistance, constant = p.drive.resistance, p.drive.torque_constant
    speed = p.drive.speed_max
    if torque is None:
        return
    to_ambient, time = p.drive.thermal_resistance, p.drive.thermal_time_constant
    if time is not None and to_ambient is not None:
        density = torque * _HEAT_CAPACITY * to_ambient / time
        at = int(np.argmax(density))
        if density[at] > _DENSEST_TORQUE:
            yield (f'drive.thermal_time_constant: {time[at]:g} s: the heat capacity of '
                   f'{1000.0 * time[at] / to_ambient[at] / _HEAT_CAPACITY:.3g} g of metal for a '
                   f'motor of {torque[at]:.3g} N m: in minutes?')
    if resistance is None or constant is None:
        return
    rise = 0.0 * torque if to_ambient is None else (
        resistance * (torque / constant) ** 2 * to_ambient)
    heat = 0.0 * torque if peak is None or speed is None else (
        resistance * (peak / constant) ** 2 / (peak * speed))
    at = int(np.argmax(np.maximum(rise / _HOTTEST, heat / _LARGEST_HEAT)))
    if rise[at] > _HOTTEST or heat[at] > _LARGEST_HEAT:
        yield (f'drive.resistance: {resistance[at]:g} Ohm: {torque[at]:.3g} N m would need '
               f'{resistance[at] * (torque[at] / constant[at]) ** 2:.3g} W: in mOhm, or '
               'drive.torque_constant in mN m/A?')


def _inertia(p: Parameters) -> Iterator[str]:
    ratio, torque, speed = p.drive.gear_ratio, p.drive.torque_max, p.drive.speed_max
    motor, screw = p.drive.motor_inertia, p.drive.screw_inertia
    if SCREW_INERTIA in p.given and MOTOR_INERTIA not in p.given:
        yield (f'{MOTOR_INERTIA}: missing, but {SCREW_INERTIA} is given: is that the inertia of '
               'the rotor, at the wrong shaft? Write 0.0 for a rotor without inertia')
    elif np.any(screw / ratio ** 2 > _LARGEST_SCREW * motor) and motor.any():
        at = int(np.argmax(screw / ratio ** 2 / np.where(motor > 0.0, motor, np.inf)))
        yield (f'{SCREW_INERTIA}: {screw[at]:g} kg m^2 is {screw[at] / ratio[at] ** 2:.3g} kg m^2 '
               f'at the motor, whose rotor has {motor[at]:g}: other units, or at another shaft?')
    if torque is None or speed is None or not motor.any():
        return
    start = motor * speed / torque
    if start.max() > _SLOWEST_START or start.min() < _FASTEST_START:
        at = int(np.argmax(start)) if start.max() > _SLOWEST_START else int(np.argmin(start))
        yield (f'{MOTOR_INERTIA}: {motor[at]:g} kg m^2 reaches drive.speed_max under '
               f'drive.torque_max in {start[at]:.2g} s: in other units than kg m^2, or at the '
               'screw?')
