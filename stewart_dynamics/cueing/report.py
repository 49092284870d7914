# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The effect of cueing parameters on a recorded motion, and gains that use the hexapod.

Wanted and felt over time, the share of each limit that is used, the time in which limits hold the
demand back, and the response at the frequencies of the objective motion cueing test.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.cueing.cueing_result import (
    AxisResponse, CueingResult, Felt, Gain, Responses)
from stewart_dynamics.cueing.motion_cueing import AXES, GRAVITY, MotionCueing, OMCT_FREQUENCIES
from stewart_dynamics.cueing.recorded_vehicle import RecordedVehicle
from stewart_dynamics.datasheet.motion_ratings import uses
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.program import SOFTWARE
from stewart_dynamics.replay.recorded_motion import RecordedMotion
from stewart_dynamics.whole_file import now

USED = 0.9  # share of the limits that proposed gains use
# Samples of a motion of which the use of limits is computed, evenly spaced.
_SAMPLES = 20_000
_HALVINGS = 7
# A small motion at a frequency: its size [m/s^2, rad/s], least rate [Hz] and least number of
# samples of a period, and time until transients of the slowest filter have vanished, by its time
# constant.
_SMALL, _RATE, _SAMPLES_OF_PERIOD, _SETTLED = 1e-3, 100.0, 128, 16.0


class Cued(NamedTuple):
    """The motion of the platform for a recorded motion of a vehicle."""

    motion: Motion
    wanted: Array  # (N, 6) specific force and angular velocity [m/s^2, rad/s]
    felt: Array  # (N, 6)
    held: dict[str, float]  # time in which each limit held the demand back [s]


def cued(cueing: MotionCueing, vehicle: RecordedVehicle) -> Cued:
    """Return the motion of the platform."""
    stream = cueing.stream()
    motion = stream.advance(vehicle.times, vehicle.forces, vehicle.rates)
    wanted = np.column_stack([vehicle.forces - cueing.at_rest + [0.0, 0.0, GRAVITY],
                              vehicle.rates])
    return Cued(motion, wanted, np.column_stack(cueing.felt(motion)), stream.held)


def used_limits(parameters: Parameters, times: Array, motion: Motion) -> dict[str, Array]:
    """Return the use of each kind of limit (M,) at samples of a motion; at 1 it is reached."""
    some = np.unique(np.linspace(0, len(times) - 1, min(len(times), _SAMPLES)).astype(int))
    return uses(StewartPlatform(parameters), RecordedMotion(
        times[some], motion[some], np.zeros((len(some), 6)), None, []))


def measured_response(cueing: MotionCueing) -> Array:
    """
    Return the felt by the wanted (12, 6, 6), complex, at OMCT_FREQUENCIES: of axes to axes.

    Measured on small sinusoidal motions, one axis after the other, without the governor.
    """
    p = cueing.parameters.replaced({'cueing.govern': False, 'cueing.input': 'acceleration'})
    free = MotionCueing(p)
    slowest = min(p.cueing.translation.washout_frequency.min(),
                  p.cueing.rotation.natural_frequency.min(),
                  p.cueing.translation.natural_frequency.min() / 2.0,
                  p.cueing.tilt.natural_frequency.min() / 2.0)
    found = np.empty((len(OMCT_FREQUENCIES), 6, 6), dtype=complex)
    for n, frequency in enumerate(OMCT_FREQUENCIES):
        period = 2.0 * np.pi / frequency
        samples = max(_SAMPLES_OF_PERIOD, int(np.ceil(period * _RATE)))
        periods = int(np.ceil(_SETTLED / slowest / period)) + 1
        times = np.arange(periods * samples) * period / samples
        wave = np.exp(1j * frequency * times)
        for axis in range(6):
            inputs = np.zeros((len(times), 6))
            inputs[:, axis] = _SMALL * wave.imag
            felt = np.column_stack(free.felt(free.run(times, inputs[:, :3], inputs[:, 3:])))
            last = felt[-samples:] - [0.0, 0.0, GRAVITY, 0.0, 0.0, 0.0]
            basis = np.conj(wave[-samples:])
            found[n, axis] = last.T @ basis / (inputs[-samples:, axis] @ basis)
    return found


def responses(cueing: MotionCueing) -> Responses:
    """Return gains and phases, measured and analytic, and gains of the cross terms."""
    measured, analytic = measured_response(cueing), cueing.response(OMCT_FREQUENCIES)
    cross = cueing.cross_response(OMCT_FREQUENCIES)
    found = {}
    for n, axis in enumerate(AXES):
        own = measured[:, n, n]
        found[axis] = AxisResponse(
            np.abs(own).tolist(), np.degrees(np.angle(own)).tolist(),
            np.abs(analytic[axis]).tolist(), np.degrees(np.angle(analytic[axis])).tolist(),
            {other: np.abs(measured[:, n, k]).tolist() for k, other in enumerate(AXES) if k != n},
            {other: np.abs(cross[axis, other]).tolist()
             for other in AXES if (axis, other) in cross})
    return Responses(frequency_rad_s=OMCT_FREQUENCIES.tolist(), **found)


def _gains(parameters: Parameters) -> Iterator[tuple[str, int, str]]:
    for part, axes in (('translation', AXES[:3]), ('tilt', AXES[:2]), ('rotation', AXES[3:])):
        for n, axis in enumerate(axes):
            yield f'cueing.{part}.gain', n, f'{part}: {axis}'


def tuned(parameters: Parameters, vehicle: RecordedVehicle) -> tuple[Parameters, list[Gain]]:
    """
    Return parameters with gains that use 90 % of the limits on a recorded motion, and reasons.

    All gains grow together from 0, until one of the limits is used so far; then each alone, tilt
    first. None is larger than 1: a motion larger than that of the vehicle is a false cue.
    """
    places = list(_gains(parameters))
    values: Array = np.zeros(len(places))
    platform_free = parameters.replaced({'cueing.govern': False})

    def use_of(gains: Array) -> tuple[float, str]:
        cueing = MotionCueing(_with(platform_free, gains))
        motion = cueing.run(vehicle.times, vehicle.forces, vehicle.rates)
        found = used_limits(parameters, vehicle.times, motion)
        worst = max(found, key=lambda name: float(found[name].max()))
        at = int(found[worst].argmax())
        seconds = vehicle.times[-1] * at / max(len(found[worst]) - 1, 1)
        return float(found[worst].max()), f'{worst} at {seconds:.1f} s'

    def grown(direction: Array) -> tuple[float, str]:
        """Return how far the gains can grow, at most by 1, and the limit that ends it."""
        most, why = use_of(values + direction)
        if most <= USED:
            return 1.0, ''
        low, high = 0.0, 1.0
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            most, reason = use_of(values + middle * direction)
            if most <= USED:
                low = middle
            else:
                high, why = middle, reason
        return low, why

    at_rest, why = use_of(values)
    reasons = [f'{why}: {at_rest:.0%} used at rest'] * len(places)
    if at_rest <= USED:
        share, why = grown(np.ones(len(places)))
        values += share
        reasons = [f'with all gains alike: {USED:.0%} of {why}' if why else '1: full size'] * len(
            places)
        order = sorted(range(len(places)), key=lambda n: not places[n][0].startswith(
            'cueing.tilt'))
        for n in order if share < 1.0 else ():
            direction = np.zeros(len(places))
            direction[n] = 1.0 - values[n]
            more, why = grown(direction)
            values[n] += more * direction[n]
            reasons[n] = f'{USED:.0%} of {why}' if why else 'full size: more is a false cue'
    values = np.floor(values * 1e3) / 1e3
    return _with(parameters, values), [
        Gain(name, place, axis, float(parameters[name][place]), float(value), reason)
        for (name, place, axis), value, reason in zip(places, values, reasons, strict=True)]


def _with(parameters: Parameters, gains: Array) -> Parameters:
    values: dict[str, list[float]] = {}
    for (name, _, _), gain in zip(_gains(parameters), gains.tolist(), strict=True):
        values.setdefault(name, []).append(gain)
    return parameters.replaced(values)


def cueing_result(path: Path, possible_error: str | None, cueing: MotionCueing,
                  vehicle: RecordedVehicle, found: Cued, used: Mapping[str, Array],
                  gains: list[Gain]) -> CueingResult:
    """Return the content of cueing.json."""
    away = found.motion.position - cueing.governor.home.position
    turning = found.motion.angular_velocity
    duration = float(vehicle.times[-1])
    return CueingResult(
        software=SOFTWARE, date=now(), vehicle=str(path), likely_mistake=possible_error,
        duration_s=duration, samples=len(vehicle.times), notices=list(vehicle.notices),
        travel_m={axis: [float(each.min()), float(each.max())]
                  for axis, each in zip('xyz', away.T, strict=True)},
        angular_velocity_max_rad_s=np.abs(turning).max(axis=0).tolist(),
        largest_use={name: float(each.max()) for name, each in used.items()},
        held_back_s={name: each for name, each in found.held.items() if each > 0.0},
        demand_given=1.0 - sum(found.held.values()) / duration,
        felt_of_wanted={axis: _felt(found.wanted[:, n], found.felt[:, n])
                        for n, axis in enumerate(AXES)},
        response=responses(cueing), tuned=gains)


def _felt(wanted: Array, felt: Array) -> Felt:
    """Return the RMS of both, and their correlation; None where one is constant."""
    w, f = wanted - wanted.mean(), felt - felt.mean()
    size = float(np.sqrt((w ** 2).mean() * (f ** 2).mean()))
    return Felt(float(np.sqrt((w ** 2).mean())), float(np.sqrt((f ** 2).mean())),
                float((w * f).mean() / size) if size > 1e-12 else None)
