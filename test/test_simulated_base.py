# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The simulated base and its IMU: exact derivatives, the spectrum, and an IMU undone again."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
import pytest
from rclpy.serialization import deserialize_message
from referees import rotation_about
from sensor_msgs.msg import Imu
from simulated import simulated
from snapshot import Snapshot

from stewart_dynamics import BaseMotion, Motion, ParameterError
from stewart_dynamics.mechanics.frames.rotation import from_quaternion
from stewart_dynamics.messages.setpoint import ImuWriter
from stewart_dynamics.simulator.imu import SimulatedImu
from stewart_dynamics.simulator.moving_base import GeneratedBase, GeneratedBaseMotion
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters

Array = NDArray[np.float64]

SEA = {'base_motion__source': 'sea', 'base_motion__center': [3.0, 2.0, 1.0, 0.1, -0.2, 0.7],
       'base_motion__lever_arm': [12.0, 1.0, 6.0],
       'base_motion__phase': [1.6, 1.6, 0.0, 1.6, 1.6, 0.5],
       'base_motion__sea__response': [0.3, 0.4, 0.8, 0.03, 0.02, 0.01]}
SINE = {'base_motion__source': 'sine', 'base_motion__amplitude': [0.1, 0.2, 0.3, 0.2, 0.1, 0.05],
        'base_motion__frequency': [0.3, 0.2, 0.1, 0.15, 0.25, 0.4],
        'base_motion__lever_arm': [1.0, -2.0, 3.0]}


def on(**changes: Any) -> SimulatorParameters:
    """Return the hexapod of config/ on a base."""
    return simulated(rate=1000.0, **changes)


# The motion

@pytest.mark.parametrize('kind', [SEA, SINE], ids=['sea', 'sine'])
def test_twist_and_acceleration_are_the_derivatives_of_the_pose(kind: dict[str, Any]) -> None:
    motion_of = GeneratedBaseMotion(on(base_motion__ramp=3.0, **kind)).at
    times, step = np.linspace(0.1, 20.0, 50), 1e-3

    def slope(of: Any) -> Array:
        d: Array = (8.0 * (of(times + step) - of(times - step))
                    - of(times + 2.0 * step) + of(times - 2.0 * step)) / (12.0 * step)
        return d

    motion = motion_of(times)
    for derivative, of in ((motion.linear_velocity, lambda t: motion_of(t).position),
                           (motion.linear_acceleration, lambda t: motion_of(t).linear_velocity),
                           (motion.angular_acceleration, lambda t: motion_of(t).angular_velocity)):
        np.testing.assert_allclose(derivative, slope(of), atol=1e-9)
    turning = slope(lambda t: motion_of(t).rotation) @ motion.rotation.swapaxes(1, 2)
    np.testing.assert_allclose(motion.angular_velocity, np.stack(
        [turning[:, 2, 1], turning[:, 0, 2], turning[:, 1, 0]], axis=1), atol=1e-9)


@pytest.mark.parametrize('kind', [SEA, SINE], ids=['sea', 'sine'])
def test_the_base_motion_grows_from_rest(kind: dict[str, Any]) -> None:
    parameters = on(base_motion__ramp=3.0, **kind)
    at = GeneratedBaseMotion(parameters).at
    for motion in (at(-5.0), at(0.0)):
        assert np.array_equal(motion.rows, at(-1.0).rows)
        assert not np.any(motion.rows[12:])
    center = parameters['base_motion.center']
    assert np.allclose(at(0.0).position, center[:3] + at(0.0).rotation @ parameters[
        'base_motion.lever_arm'])
    without = GeneratedBaseMotion(on(base_motion__ramp=0.0, **kind)).at
    late = np.array([3.0, 7.0, 100.0])
    assert np.array_equal(at(late).rows, without(late).rows)


def test_a_sine_is_a_sine() -> None:
    motion = GeneratedBaseMotion(on(
        base_motion__source='sine', base_motion__ramp=0.0, base_motion__frequency=0.25,
        base_motion__amplitude=[0.0, 0.0, 0.4, 0.2, 0.0, 0.0],
        base_motion__phase=[0.0, 0.0, math.pi / 2.0, 0.0, 0.0, 0.0])).at([4.0, 5.0])
    assert np.allclose(motion.position, [[0.0, 0.0, 0.4], [0.0, 0.0, 0.0]])
    assert np.allclose(motion.linear_acceleration[0], [0, 0, -0.4 * (math.pi / 2.0) ** 2])
    assert np.allclose(motion.rotation[1], rotation_about(np.array([1.0, 0.0, 0.0]), 0.2))
    assert np.allclose(motion.angular_velocity[0], [0.2 * math.pi / 2.0, 0.0, 0.0])


def test_the_sea_has_its_height_its_period_and_its_responses() -> None:
    parameters = on(base_motion__sea__wave_height=3.0, base_motion__sea__peak_period=8.0, **SEA)
    x, _, _ = GeneratedBaseMotion(parameters).harmonics.at(np.arange(20_000.0))
    # The band to 2.5 times the peak has exp(-1.25 / 2.5^4) of the energy of the spectrum.
    significant = 4.0 * x.std(axis=0) / math.sqrt(math.exp(-1.25 / 2.5 ** 4))
    assert significant == pytest.approx(3.0 * parameters['base_motion.sea.response'], rel=1e-2)
    # Averaged over some waves the periodogram is the spectrum.
    heave = x[:, 2] / 0.8
    power = np.abs(np.fft.rfft(heave)) ** 2 * 2.0 / len(heave)
    frequencies = np.fft.rfftfreq(len(heave))
    for low, high in ((0.5, 0.8), (0.8, 1.1), (1.1, 1.5), (1.5, 2.5)):
        band = (frequencies > low / 8.0) & (frequencies < high / 8.0)
        energy = float(np.sum(power[band]) * frequencies[1])
        exact = 9.0 / 16.0 * (math.exp(-1.25 * high ** -4) - math.exp(-1.25 * low ** -4))
        assert energy == pytest.approx(exact, rel=0.1)


def test_periods_are_the_motion_at_their_begins_middles_and_ends() -> None:
    parameters = on(**SEA)
    base, at = GeneratedBase(parameters), GeneratedBaseMotion(parameters).at
    for index in (*range(1, 40), 5000, 4999, 20):
        period = base.period(index, 0)
        motion = at((index - 1.0 + np.array([0.0, 0.5, 1.0])) * 1e-3)
        np.testing.assert_allclose(
            period.rows, BaseMotion.from_motion(motion, parameters['gravity']).rows,
            rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(period.pose[:3], motion.position[2], rtol=1e-13)
        np.testing.assert_allclose(np.reshape(from_quaternion(*period.pose[3:]), (3, 3)),
                                   motion.rotation[2], atol=1e-14)
        np.testing.assert_allclose(period.twist + period.acceleration, motion.rows[2, 12:],
                                   rtol=1e-12, atol=1e-13)
    rest = base.period(0, 0)
    assert not np.any(rest.twist + rest.acceleration)
    assert np.array_equal(rest.rows[2], base.period(1, 0).rows[0])


# The IMU

MOUNTED = {'base__imu__position': [0.4, -0.3, 0.2],
           'base__imu__orientation': [0.5, -0.5, 0.5, 0.5]}


def test_an_ideal_imu_gives_the_base_motion_back() -> None:
    parameters = on(**SINE, **MOUNTED)
    imu, motion = SimulatedImu(parameters), GeneratedBaseMotion(parameters).at(7.3)
    true = BaseMotion.from_motion(motion, parameters['gravity'])
    readings = imu.read(true.rows)
    rotation = np.reshape(from_quaternion(0.5, -0.5, 0.5, 0.5), (3, 3))
    back = BaseMotion.from_imu(readings[3:], readings[:3], rotation.T @ true.angular_acceleration,
                               parameters['base.imu.position'], rotation)
    np.testing.assert_allclose(back.gravity, true.gravity - true.linear_acceleration, atol=1e-14)
    np.testing.assert_allclose(back.angular_velocity, true.angular_velocity, atol=1e-15)


def test_an_imu_reads_the_acceleration_of_its_own_place_in_the_world() -> None:
    """By differences of its position in the world, and gravity."""
    parameters = on(**SINE, **MOUNTED)
    at, step = GeneratedBaseMotion(parameters).at, 1e-3
    places = at(7.3 + step * np.array([-1.0, 0.0, 1.0]))
    position = places.position + places.rotation @ parameters['base.imu.position']
    acceleration = (position[0] - 2.0 * position[1] + position[2]) / step ** 2
    to_imu = (places.rotation[1] @ np.reshape(from_quaternion(0.5, -0.5, 0.5, 0.5), (3, 3))).T
    readings = SimulatedImu(parameters).read(
        BaseMotion.from_motion(at(7.3), parameters['gravity']).rows)
    np.testing.assert_allclose(
        readings[3:], to_imu @ (acceleration - parameters['gravity']), atol=1e-6)
    np.testing.assert_allclose(readings[:3], to_imu @ places.angular_velocity[1], atol=1e-14)


def test_bias_and_noise_are_as_in_the_parameters() -> None:
    bias = [0.01, -0.02, 0.03], [0.1, 0.2, -0.3]
    given = {'imu__bias__angular_velocity': bias[0], 'imu__bias__specific_force': bias[1],
             'imu__noise__angular_velocity': 1e-3, 'imu__noise__specific_force': 0.05, **SINE}
    row = BaseMotion([0.0, 0.0, -9.80665]).rows
    many = 4000
    imus = [SimulatedImu(on(noise__seed=seed, **given)) for seed in (1.0, 1.0, 2.0)]
    first, second, other = (np.array([imu.read(row) for _ in range(many)]) for imu in imus)
    assert first.tobytes() == second.tobytes() != other.tobytes()
    noise = (first - [*bias[0], *bias[1]] - [0, 0, 0, 0, 0, 9.80665]) / np.repeat([1e-3, 0.05], 3)
    # Five standard errors of a mean, of a deviation and of a correlation.
    assert np.max(np.abs(noise.mean(axis=0))) < 5.0 / math.sqrt(many)
    assert np.max(np.abs(noise.std(axis=0) - 1.0)) < 5.0 / math.sqrt(2.0 * many)
    assert np.max(np.abs(np.corrcoef(noise.T) - np.eye(6))) < 5.0 / math.sqrt(many)


@pytest.mark.parametrize('frame', ['imu', '', 'a_longer_name'])
def test_the_message_is_what_ros_reads(frame: str) -> None:
    data = ImuWriter(frame, 0.1, 0.5).write(12_000_000_034, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    message = deserialize_message(data, Imu)
    stamp = message.header.stamp
    assert (stamp.sec, stamp.nanosec, message.header.frame_id) == (12, 34, frame)
    assert message.orientation_covariance.tolist() == [-1.0] + [0.0] * 8
    for vector, values, of, variance in (
            (message.angular_velocity, (1.0, 2.0, 3.0), message.angular_velocity_covariance,
             0.1 ** 2),
            (message.linear_acceleration, (4.0, 5.0, 6.0),
             message.linear_acceleration_covariance, 0.5 ** 2)):
        assert (vector.x, vector.y, vector.z) == values
        assert np.array_equal(np.reshape(of, (3, 3)), variance * np.eye(3))


# Parameters

@pytest.mark.parametrize('changes', [
    {'base_motion__source': 'swell'},
    {'base_motion__amplitude': [1e300] + [0.0] * 5},
    {'base_motion__sea__peak_period': 0.0},
    {'base_motion__source': 'sine', 'imu__rate': 300.0},
    {'base_motion__source': 'sine', 'imu__rate': 4000.0},
    {'imu__noise__specific_force': -1.0}],
    ids=str)
def test_a_broken_rule_is_named(changes: dict[str, Any], snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        on(**changes)


def test_the_rate_of_the_imu_is_free_where_the_base_is_fixed() -> None:
    assert on(imu__rate=300.0)['imu.rate'] == 300.0


@pytest.mark.parametrize('kind', [SEA, SINE], ids=['sea', 'sine'])
def test_the_largest_numbers_that_are_accepted_stay_finite(kind: dict[str, Any]) -> None:
    largest = {'base_motion__amplitude': [1e4] * 6, 'base_motion__frequency': 100.0,
               'base_motion__sea__response': [1e3] * 6, 'base_motion__sea__wave_height': 100.0,
               'base_motion__sea__peak_period': 0.1, 'base_motion__lever_arm': [1e6] * 3}
    base = GeneratedBase(on(**{**kind, **largest, 'base_motion__ramp': 1e-6}))
    assert np.isfinite(base.period(100, 0).rows).all()
    assert isinstance(GeneratedBaseMotion(on(**{**kind, **largest})).at(1.0), Motion)
