# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The loads of the motors in a bag: peaks, RMS, heat, power of their common bus, and limits.

Samples are added block by block and are not kept. ``bag_summary`` defines each number.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.drives.motor_limits import exceeds, MotorLimits
from stewart_dynamics.mechanics.drives.motors import Motors
from stewart_dynamics.mechanics.limits import (
    LIMITS, OF_MOTORS, SPEED_MAX, TORQUE_SPEED)
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.replay.bag_summary import Bus, MotorLoads, Motors as LoadsOfAll, NeededMotor
from stewart_dynamics.reporting.block_statistics import (
    Exceeded, ExceededLimit, Extreme, finite, Integral)

MARGIN = 1.2  # factor on torques and speed of the motor that is needed
_OF_VELOCITY = TORQUE_SPEED, SPEED_MAX


class Need(NamedTuple):
    """A load that a motor must bear at least."""

    name: str
    unit: str
    kind: str = ''  # follows the unit


# By the key of the motor that is needed.
NEEDS = {'torque_continuous_n_m': Need('continuous torque', 'N m', 'continuous'),
         'torque_peak_n_m': Need('peak torque', 'N m', 'peak'),
         'speed_rad_s': Need('speed', 'rad/s')}


class LoadsOfMotors:
    """
    The loads of the motors of a hexapod that has ``drive.*``.

    Quasi-static, only poses are known: values that depend on velocities are None, not zero.
    """

    def __init__(self, parameters: Parameters, quasi_static: bool) -> None:
        self._parameters, self._quasi_static = parameters, quasi_static
        self._limits = MotorLimits(parameters)
        self._exceeded = {limit: Exceeded() for limit in OF_MOTORS if parameters[limit] is not None
                          and not (quasi_static and limit in _OF_VELOCITY)}
        self._torque, self._speed, self._current = (Extreme(6, np.abs) for _ in range(3))
        self._margin = Extreme(6, np.negative)
        self._rise = Extreme(6, np.positive)
        self._drawn, self._regenerated = Extreme(1, np.positive), Extreme(1, np.negative)
        # squares of the torques; magnitudes of the speeds
        self._means = Integral(12)
        # copper heat; power drawn; power regenerated
        self._electrical = Integral(8)

    def add(self, seconds: Array, steps: Array, rows: Array, rises: Array) -> None:
        """
        Add rows of motors (N, MOTORS) and temperature rises (N, 6) [K] at times (N,).

        steps (N,): the time to each from the one before [s].
        """
        motors = Motors.of_rows(rows)
        with np.errstate(over='ignore', invalid='ignore'):
            power = motors.power.sum(axis=1, keepdims=True)
            self._means.add(steps, np.concatenate(
                [motors.torques ** 2, np.abs(motors.speeds)], axis=1))
            self._electrical.add(steps, np.concatenate(
                [motors.copper_heat, np.maximum(power, 0.0), np.maximum(-power, 0.0)], axis=1))
            self._margin.add(seconds, motors.margins)
        self._torque.add(seconds, motors.breakaway_torques)
        self._speed.add(seconds, motors.speeds)
        self._current.add(seconds, motors.currents)
        self._rise.add(seconds, rises)
        self._drawn.add(seconds, power)
        self._regenerated.add(seconds, power)
        checked = self._limits.excesses(rows, rises)
        for limit, exceeded in self._exceeded.items():
            values, bounds = checked[limit]
            exceeded.add(seconds, exceeds(values, bounds), values, bounds)

    def not_checked(self, without_forces: bool) -> list[str]:
        """Return the limits that need velocities, or forces where some are not known."""
        return [limit for limit in OF_MOTORS if self._parameters[limit] is not None and (
            limit not in self._exceeded or without_forces and LIMITS[limit].clips)]

    def exceeded(self, legs: Sequence[str]) -> list[ExceededLimit]:
        """Return the limits of motors that are exceeded."""
        return [each for limit, exceeded in self._exceeded.items()
                for each in exceeded.of_legs(limit, legs)]

    def values(self, legs: Sequence[str], cycles: int) -> LoadsOfAll:
        """Return the loads of the motors, for a motion of a number of cycles."""
        loads = {name: self._motor(leg) for leg, name in enumerate(legs)}
        return LoadsOfAll(legs=loads, bus=self._bus(cycles), needed=needed_motor(
            (each.torque_rms_n_m, each.torque_peak_n_m, each.speed_peak_rad_s)
            for each in loads.values()))

    def _motor(self, leg: int) -> MotorLoads:
        drive = self._parameters.drive
        limited = drive.torque_max is not None or drive.torque_speed is not None
        continuous, fastest = (None if each is None else each[leg]
                               for each in (drive.torque_continuous, drive.speed_max))
        rms, heat = math.sqrt(self._means.mean[leg]), self._electrical.mean[leg]
        constant, steady = drive.torque_constant, drive.thermal_resistance
        torque, torque_at = self._torque.of_column(leg)
        margin, margin_at = self._margin.of_column(leg) if limited else (None, None)
        speed, speed_at = (None, None) if self._quasi_static else self._speed.of_column(leg)
        rise, rise_at = self._rise.of_column(leg)
        return MotorLoads(
            torque_peak_n_m=torque, torque_peak_at_s=torque_at, torque_rms_n_m=finite(rms),
            torque_margin_n_m=margin, torque_margin_at_s=margin_at,
            torque_continuous_margin_n_m=None if continuous is None else finite(continuous - rms),
            speed_peak_rad_s=speed, speed_peak_at_s=speed_at,
            speed_mean_rad_s=None if self._quasi_static else finite(self._means.mean[6 + leg]),
            speed_margin_rad_s=None if fastest is None or speed is None else finite(
                fastest - abs(speed)),
            current_peak_a=finite(self._current.values[leg]),
            current_rms_a=None if constant is None else finite(rms / constant[leg]),
            temperature_rise_max_k=rise, temperature_rise_max_at_s=rise_at,
            temperature_rise_steady_k=None if steady is None else finite(heat * steady[leg]),
            temperature_rise_margin_k=None if drive.temperature_rise_max is None else finite(
                drive.temperature_rise_max[leg] - self._rise.values[leg]))

    def _bus(self, cycles: int) -> Bus | None:
        if self._quasi_static or not math.isfinite(self._drawn.values[0]):
            return None
        *_, drawn, regenerated = self._electrical.values.tolist()
        *_, mean_drawn, mean_regenerated = self._electrical.mean
        back = self._regenerated.values[0] < 0.0
        peak, at = self._drawn.of_column()
        return Bus(
            power_peak_w=peak, power_peak_at_s=at,
            regenerated_peak_w=finite(-self._regenerated.values[0]) if back else 0.0,
            regenerated_peak_at_s=finite(self._regenerated.at[0]) if back else None,
            power_mean_w=finite(mean_drawn - mean_regenerated),
            energy_drawn_j=drawn, energy_regenerated_j=regenerated,
            cycles=cycles, energy_per_cycle_j=(drawn - regenerated) / cycles)


def needed_motor(loads: Iterable[tuple[float | None, float | None, float | None]]) -> NeededMotor:
    """
    Return the smallest motor that bears loads with MARGIN.

    loads: RMS torque, peak torque and peak speed of each [N m, N m, rad/s]; None: not known.
    """
    columns = list(zip(*loads, strict=True)) or [(), (), ()]
    return NeededMotor(MARGIN, *(max(
        (MARGIN * abs(each) for each in column if each is not None), default=None)
        for column in columns))
