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
from stewart_dynamics.possible_errors.hypothesis import (
    find_errors, First, Hypothesis, PossibleError, Six, Table, When)

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


class _Drives:
    """The drives of a parameter file; nan where something is not set."""

    def __init__(self, p: Parameters) -> None:
        six, drive = Six(p), p.drive
        self.p, self.six, self.drive = p, six, drive
        self.lead, self.ratio, self.motor = (
            six['actuator.screw_lead'], drive.gear_ratio, drive.motor_inertia)
        self.screw = drive.screw_inertia / self.ratio ** 2  # at the motor [kg m^2]
        self.peak, self.fastest = six['drive.torque_max'], six['drive.speed_max']
        self.curve = np.full((1, 2), np.nan) if drive.torque_speed is None else drive.torque_speed
        self.end = self.curve[-1:, 0]
        self.rpm = {'fastest': self.fastest * RPM, 'end': self.end * RPM}
        # The rotors reach their speed in the first time, as rotors without mass do at once.
        self.start = np.where(self.motor.any(), self.motor, np.nan) * self.fastest / self.peak
        # Heat at the continuous torque, and at the peak torque by the largest power.
        self.lasting = (_OF_PEAK * self.peak if drive.torque_continuous is None else
                        drive.torque_continuous)
        self.time, to_ambient = (six[f'drive.thermal_{each}'] for each in (
            'time_constant', 'resistance'))
        self.density = self.lasting * _HEAT_CAPACITY * to_ambient / self.time
        self.grams = 1000.0 * self.time / to_ambient / _HEAT_CAPACITY
        self.loss, constant = six['drive.resistance'], six['drive.torque_constant']
        self.watts = self.loss * (self.lasting / constant) ** 2
        self.heat = np.fmax(self.watts * to_ambient / _HOTTEST, self.loss * (
            self.peak / constant) ** 2 / (self.peak * self.fastest) / _LARGEST_HEAT)
        self.forward, self.back = drive.efficiency, drive.back_driving_efficiency
        self.usual_back = 2.0 - 1.0 / self.forward
        # Limits of the motors at the legs, and limits of the legs.
        k, speed = motor_ratio(p), np.where(
            drive.speed_max is None, self.curve[-1, 0], self.fastest)
        torque = np.where(drive.torque_max is None, self.curve[:, 1].max(), self.peak)
        self.torque, self.pushed = float(torque.min()), float((torque * k * self.forward).min())
        self.weight = p.carried.mass * float(np.linalg.norm(p.gravity)) / 6.0
        self.carried = (p.carried.mass / 6.0 + p.legs.piston.mass).max()
        self.reflected = p.actuator.reflected_mass
        force = np.full(6, self.weight) if p.limits.force_max is None else p.limits.force_max
        self.needed = float(force.max())
        self.loads = force / (torque * k * self.forward)
        self.rates = np.nan_to_num(six['limits.velocity_max'] * k / speed)
        rate, moves, moved = p.limits.velocity_max, '', ''
        if rate is not None and np.isfinite(speed).all():
            moves = f' and move a leg at {float((speed / k).min()):.3g} m/s'
            moved = f' and {rate.max():.3g} m/s'
        self.said = (f'the motors can push {self.pushed:.3g} N{moves}, the legs need '
                     f'{self.needed:.3g} N{moved}')

    def missed(self, factor: Array | float = 1.0) -> float:
        """Return the limits of the legs by those of the drives, with another ratio."""
        return max(float((self.loads * factor).max()), float((self.rates / factor).max()))


_Of = Hypothesis[_Drives]
_START = ('{motor:g} kg m^2 reaches drive.speed_max under drive.torque_max in {start:.2g} s: in '
          'other units than kg m^2, or at the screw?')
_TABLE: Table[_Drives] = First(
    _Of('actuator.screw_lead', lambda d: np.where(d.lead >= _LONGEST_LEAD, d.lead, 0.0),
        '{lead:g} m for one turn of the screw: in mm?'),
    _Of('drive.speed_max', lambda d: d.fastest - _FASTEST_MOTOR,
        '{fastest:g} rad/s, {rpm[fastest]:.0f} rpm: in rpm?'),
    _Of('drive.torque_speed', lambda d: d.end - _FASTEST_MOTOR,
        '{end:g} rad/s, {rpm[end]:.0f} rpm: in rpm?'), (
        First(
            _Of(MOTOR_INERTIA, lambda d: (
                SCREW_INERTIA in d.p.given and MOTOR_INERTIA not in d.p.given), (
                f'missing, but {SCREW_INERTIA} is given: is that the inertia of the rotor, at the '
                'wrong shaft? Write 0.0 for a rotor without inertia')),
            _Of(SCREW_INERTIA, lambda d: d.motor.any() and np.where(
                d.screw > _LARGEST_SCREW * d.motor, d.screw / d.motor, 0.0), (
                '{p[drive.screw_inertia]:g} kg m^2 is {screw:.3g} kg m^2 at the motor, whose '
                'rotor has {motor:g}: other units, or at another shaft?'))),
        First(_Of(MOTOR_INERTIA, lambda d: d.start - _SLOWEST_START, _START),
              _Of(MOTOR_INERTIA, lambda d: _FASTEST_START - d.start, _START)),
        _Of('drive.thermal_time_constant', lambda d: d.density - _DENSEST_TORQUE, (
            '{time:g} s: the heat capacity of {grams:.3g} g of metal for a motor of '
            '{lasting:.3g} N m: in minutes?')),
        _Of('drive.resistance', lambda d: d.heat - 1.0, (
            '{loss:g} Ohm: {lasting:.3g} N m would need {watts:.3g} W: in mOhm, or '
            'drive.torque_constant in mN m/A?')),
        _Of('drive.back_driving_efficiency', lambda d: d.back - d.forward - _BACK, (
            '{back:g}, but drive.efficiency is {forward:g}: a drive that loses this much loses '
            'more when it is driven back (2 - 1 / efficiency is {usual_back:.3g}): exchanged?')),
        # Most of the thrust rating of a cylinder goes to the rotors.
        _Of('limits.force_max', lambda d: (
            d.pushed > _OF_A_CYLINDER * d.needed and d.p.limits.joint_force_max is None
            and d.p.limits.force_max is not None and d.reflected * (
                d.reflected >= d.p.carried.mass / 6.0 + d.p.legs.piston.mass).all()), (
            '{needed:.3g} N: the motors can push {pushed:.3g} N, of which '
            'actuator.reflected_mass, {reflected:.3g} kg, takes more than the {carried:.3g} kg '
            'that a leg carries: the thrust rating of a cylinder? It is limits.joint_force_max')),
        When(lambda d: d.missed() > _MISSED, First(
            _Of('actuator.screw_lead', lambda d: d.missed(2.0 * math.pi) <= _FITS,
                '{lead:g} m: {said}: the travel for one radian? It is that of one turn'),
            _Of('drive.gear_ratio', lambda d: (
                d.missed(d.ratio ** 2) <= _FITS and d.ratio[0] != 1.0), (
                '{ratio:g}: {said}: inverted? It is the turns of the motor in one turn of the '
                'screw')),
            _Of('drive.torque_max', lambda d: d.weight - d.pushed,
                '{torque:g} N m: {said}: less than a sixth of the weight')))))


def drive_errors(p: Parameters) -> Iterator[PossibleError]:
    """Yield possible errors in the drives; without a screw lead nothing is known."""
    return iter(()) if p.actuator.screw_lead is None or not p.drives else find_errors(
        _TABLE, _Drives(p))
