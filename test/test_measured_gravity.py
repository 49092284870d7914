# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Measured gravity: possible errors are found by the rules for the parameter, and no others."""

from __future__ import annotations

import math
from typing import Any

import messages
import numpy as np
import pytest
from referees import rng, rotation_about, symmetric_parameters

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.frames.rotation import to_quaternion
from stewart_dynamics.setpoints.input_messages import BASE_IMU, BASE_POSE

G = 9.80665
RATE = 100.0


def feed_of(source: str, **given: Any) -> messages.Feed:
    # Legs that level poses can have on both sides of the base.
    return messages.Feed(symmetric_parameters().replaced({
        'base.source': source, **{k.replace('__', '.'): v for k, v in given.items()}}))


def errors_of(feed: messages.Feed) -> list[str]:
    return [each.words for each in feed.setpoints.possible_errors(ever=True)]


def imu(force: Array, spin: Array | None = None, **given: Any) -> list[str]:
    """Return the errors in readings of an IMU (N, 3) at 100 Hz."""
    feed = feed_of('imu', **given)
    spin = np.zeros(force.shape) if spin is None else spin
    for n, (f, w) in enumerate(zip(force.tolist(), spin.tolist(), strict=True)):
        feed(BASE_IMU, messages.imu(messages.NOW + round(n / RATE * 1e9), w, f))
    return errors_of(feed)


def still(up: float, seconds: float = 3.0) -> Array:
    return np.tile([0.0, 0.0, up], (round(seconds * RATE), 1))


@pytest.mark.parametrize(('up', 'expected'), [
    (0.0, '0 m/s^2: removed by the driver?'), (1.0, '1 m/s^2: in g?'),
    (-G, '[0, 0, 9.81] m/s^2 pulls the platform away from the base: a sign? '
         'base.imu.orientation?')])
def test_the_possible_error_in_a_specific_force_is_named(up: float, expected: str) -> None:
    noise = rng(1).normal(0.0, 0.02, (300, 3))
    for force in (still(up), still(up) + noise):
        one, = imu(force)
        assert one.startswith('base/imu: measured gravity, base axes: ')
        assert expected.split('] ')[-1].split('m/s^2')[-1] in one


def test_right_readings_have_no_possible_error() -> None:
    random, times = rng(2), np.arange(2000) / RATE
    noise = random.normal(0.0, 0.3, (2000, 3))
    assert imu(still(G, 20.0) + noise) == []
    # a ship: roll and heave
    roll, omega = 0.3, 2.0 * math.pi / 8.0
    angle, rate = roll * np.sin(omega * times), roll * omega * np.cos(omega * times)
    zero = np.zeros(2000)
    heave = 2.0 * np.sin(0.7 * times)
    force = np.stack([zero, (G + heave) * np.sin(angle), (G + heave) * np.cos(angle)], axis=1)
    spin = np.stack([rate, zero, zero], axis=1)
    assert imu(force + noise, spin + 0.1 * noise) == []
    # the same with the gyro in deg/s
    one, = imu(force + 0.1 * noise, np.degrees(spin))
    assert one.endswith('possible error: angular_velocity in deg/s?')
    # a vehicle that turns about the vertical, and brakes
    turning = np.tile([0.0, 0.0, 1.0], (2000, 1))
    assert imu(still(G, 20.0) + [3.0, 2.0, 0.0], turning) == []


def test_half_a_second_of_free_fall_is_no_possible_error() -> None:
    force = still(G, 5.0)
    force[200:250] = 0.0
    assert imu(force) == []
    force[200:400] = 0.0
    assert len(imu(force)) == 1


def test_an_angular_velocity_that_no_base_has_is_in_degrees() -> None:
    one, = imu(still(G), np.tile([0.0, 0.0, 20.0], (300, 1)))
    assert one == ('base/imu: angular velocity of 20 rad/s for a second: possible error: '
                   'angular_velocity in deg/s?')


def test_the_orientation_of_the_imu_is_used() -> None:
    over = to_quaternion(rotation_about([1.0, 0.0, 0.0], math.pi)).tolist()
    assert imu(still(-G), base__imu__orientation=over) == []
    assert len(imu(still(G), base__imu__orientation=over)) == 1


def test_a_hexapod_that_hangs_is_no_possible_error() -> None:
    assert imu(still(-G), geometry__platform_side='positive') == []


@pytest.mark.parametrize('turn', [0.0, 0.4, math.pi])
def test_a_base_turned_over_is_a_possible_error(turn: float) -> None:
    feed = feed_of('pose')
    x, y, z, w = to_quaternion(rotation_about([1.0, 0.0, 0.0], turn)).tolist()
    for n in range(300):
        feed(BASE_POSE, messages.pose(
            messages.NOW + round(n / RATE * 1e9), (0.0, 0.0, 0.0), (x, y, z, w), 'world'))
    assert len(errors_of(feed)) == (turn > 3.0)
