# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Possible errors in the motion of a vehicle: at rest and in motion, with the noise of an IMU."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
import pytest
from referees import PLATFORM
from stewart_dynamics import MotionCueing, Parameters
from stewart_dynamics.cueing.vehicle import find_vehicle_error, Vehicle
from stewart_dynamics.mechanics.frames.rotation import euler_rate_matrix, from_euler
from stewart_dynamics.messages.setpoint import ImuWriter
from stewart_dynamics.setpoints.rejections import Rejections

Array = NDArray[np.float64]

G = 9.80665
TIMES = np.linspace(0.0, 60.0, 3600, endpoint=False, dtype=np.float64)
PARAMETERS = Parameters.from_yaml(PLATFORM)


def car() -> tuple[Array, Array]:
    """Return specific forces and angular velocities (N, 3) of a drive without any rest."""
    t = TIMES
    return np.column_stack([
        2.0 * np.sin(0.8 * t), 3.0 * np.sin(0.5 * t + 1.0), G + 0.5 * np.sin(3.0 * t)]), (
            np.column_stack([0.1 * np.sin(0.7 * t), 0.05 * np.sin(0.9 * t),
                             0.3 * np.sin(0.5 * t)]))


def boat() -> tuple[Array, Array]:
    """Return those of a boat that rolls and pitches slowly, with the noise of an IMU."""
    random = np.random.default_rng(0)
    w, size = np.array([0.6, 0.8, 0.2]), np.array([0.2, 0.08, 0.1])
    angles, slopes = size * np.sin(TIMES[:, None] * w), size * w * np.cos(TIMES[:, None] * w)
    turned = np.swapaxes(from_euler(angles), -1, -2)
    omega = (euler_rate_matrix(angles) @ slopes[..., None])[..., 0]
    forces = turned @ [0.0, 0.0, G] + 0.3 * np.sin(np.outer(TIMES, [0.5, 0.7, 0.9]))
    return (forces + 0.1 * random.normal(size=forces.shape),
            (turned @ omega[..., None])[..., 0] + 0.003 * random.normal(size=omega.shape))


def rest() -> tuple[Array, Array]:
    """Return those of an ordinary IMU at rest, noise of 0.1 m/s^2."""
    random = np.random.default_rng(1)
    noise = random.normal(size=(2, 500, 3))
    return [0.0, 0.0, G] + 0.1 * noise[0], 0.005 * noise[1]


def slope() -> tuple[Array, Array]:
    """Return those of an IMU without noise on a slope, and in a motion of a few seconds."""
    t = TIMES[:200, None]
    return G * np.array([0.3, 0.1, 0.95]) + np.sin(t), 0.0 * t + [0.0, 0.0, 0.0]


Wrong = Callable[[Array, Array], tuple[Array, Array]]
DOWN = np.array([1.0, -1.0, -1.0])
OF_FORCES: dict[str, Wrong] = {
    'without gravity, set acceleration': lambda f, w: (f - [0.0, 0.0, G], w),
    'in g, must be in m/s^2': lambda f, w: (f / G, w),
    'in ft/s^2, must be in m/s^2': lambda f, w: (f / 0.3048, w),
    'in mm/s^2?': lambda f, w: (1e3 * f, w),
    'in cm/s^2?': lambda f, w: (1e2 * f, w),
    'gravity is along -z': lambda f, w: (f * DOWN, w * DOWN),
    'gravity is along +x': lambda f, w: (f[:, [2, 1, 0]], w[:, [2, 1, 0]])}
OF_RATES: dict[str, Wrong] = {
    'in degrees per second?': lambda f, w: (f, np.degrees(w)),
    'as by x y z = -x -y': lambda f, w: (f, -w),
    'as by x y z = -x y': lambda f, w: (f, w * [-1.0, 1.0, 1.0]),
    'as by x y z = y x': lambda f, w: (f, w[:, [1, 0, 2]])}


@pytest.mark.parametrize('motion', [car, boat, rest, slope])
def test_right_motions_have_no_possible_error(motion: Callable[[], tuple[Array, Array]]) -> None:
    forces, rates = motion()
    assert find_vehicle_error(TIMES[:len(forces)], forces, rates, 'specific_force') == ''
    free = forces - [0.0, 0.0, G]
    assert find_vehicle_error(TIMES[:len(forces)], free, rates, 'acceleration') == ''


@pytest.mark.parametrize('text', OF_FORCES)
@pytest.mark.parametrize('motion', [car, boat, rest])
def test_specific_forces_are_judged_at_rest_and_in_motion(
        motion: Callable[[], tuple[Array, Array]], text: str) -> None:
    forces, rates = OF_FORCES[text](*motion())
    assert text in find_vehicle_error(TIMES[:len(forces)], forces, rates, 'specific_force')


@pytest.mark.parametrize('motion', [car, boat, rest])
def test_gravity_in_accelerations_is_found(motion: Callable[[], tuple[Array, Array]]) -> None:
    forces, rates = motion()
    assert 'has gravity in it' in find_vehicle_error(
        TIMES[:len(forces)], forces, rates, 'acceleration')


def test_turns_and_rates_of_messages_that_no_vehicle_has() -> None:
    forces, rates = rest()
    assert 'in degrees per second' in find_vehicle_error(
        TIMES[:500], forces, rates + 40.0, 'specific_force')
    assert find_vehicle_error(60.0 * TIMES[:500], forces, rates, 'specific_force').startswith(
        'comes at 1 Hz')


@pytest.mark.parametrize('text', OF_RATES)
def test_rates_are_judged_by_the_turning_of_gravity(text: str) -> None:
    found = find_vehicle_error(TIMES, *OF_RATES[text](*boat()), 'specific_force')
    assert text in found
    assert 'in degrees' in find_vehicle_error(
        TIMES, *OF_RATES['in degrees per second?'](*car()), 'specific_force')


@pytest.mark.parametrize('size', [0.1, 0.2, 0.4])
def test_small_turns_in_degrees_are_found(size: float) -> None:
    """Less than a turn of degrees, taken for radians."""
    forces, rates = boat()
    up = np.array([0.0, 0.0, G])
    found = find_vehicle_error(TIMES, up + size * (forces - up), np.degrees(size * rates),
                               'specific_force')
    assert 'in degrees per second?' in found


@pytest.mark.parametrize('wrong, text', [
    (None, ''), *((each, text) for text, each in (*OF_FORCES.items(), *OF_RATES.items()))])
def test_messages_are_judged_as_recordings_are(wrong: Wrong | None, text: str) -> None:
    """In motion after ten seconds, and until the motion has been right for as long."""
    vehicle = Vehicle(PARAMETERS, Rejections(lambda *_: None), lambda _: None)
    writer = ImuWriter('vehicle', 0.0, 0.0)
    now = 5.0

    def drive(seconds: float, forces: Array, rates: Array) -> None:
        nonlocal now
        for n in range(round(60.0 * seconds)):
            now += 1.0 / 60.0
            data = writer.write(round(1e9 * now), rates[n].tolist(), forces[n].tolist())
            vehicle.use_message(data, now)
            if n % 12 == 0:
                vehicle.check(now)

    right = boat()
    drive(32.0, *(right if wrong is None else wrong(*right)))
    assert text in vehicle.possible_error and bool(text) == bool(vehicle.possible_error)
    drive(45.0, *right)
    assert vehicle.possible_error == ''


def test_an_empty_recording_moves_nothing() -> None:
    nothing = np.empty((0, 3))
    assert MotionCueing(PARAMETERS).run(np.empty(0), nothing, nothing).shape == (0,)
