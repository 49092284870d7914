# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Twists that are not the derivatives of poses: found, named, and never where they are right."""

from __future__ import annotations

from collections.abc import Callable
import math
from pathlib import Path
import sys
from typing import Any

import messages
from messages import SECOND
import numpy as np
from programs import run_program
import pytest
from referees import rng, ROOT, symmetric_parameters

from stewart_dynamics import Motion, Parameters
from stewart_dynamics.arrays import Array, Stamps
from stewart_dynamics.mechanics.frames.rotation import (
    euler_rate_matrix, from_euler, from_quaternion, to_euler, to_quaternion)
from stewart_dynamics.mechanics.kinematics.home_pose import home_pose
from stewart_dynamics.mechanics.rows import (
    ACCELERATION, ANGULAR_ACCELERATION, ANGULAR_VELOCITY, LINEAR_ACCELERATION, LINEAR_VELOCITY,
    POSE, POSITION, ROTATION, TWIST)
from stewart_dynamics.reference_motion.motion_functions import motion_at
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.setpoints.consistency import Consistency
from stewart_dynamics.setpoints.inconsistency_causes import (
    ACCELERATION as ACCEL, Inconsistency, SPIN, SPIN_RATE, VELOCITY)
from stewart_dynamics.setpoints.input_messages import (
    ACCEL as ACCELS, BASE_ACCEL, BASE_POSE, BASE_TWIST, POSE as POSES, TWIST as TWISTS)

CONFIG = Path(__file__).resolve().parents[1] / 'config'
RADIUS = 0.3
LIMITED = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
HOME = home_pose(LIMITED).position
RATES = (10.0, 60.0, 200.0, 1000.0)

Stream = tuple[Stamps, Array]


def stream(rate: float, seconds: float = 12.0, frequency: float = 0.5, tilt: float = 0.3,
           seed: int = 1) -> Stream:
    """Return stamps and rows of a smooth motion in all six directions."""
    times = np.arange(round(seconds * rate)) / rate
    random = rng(seed)
    omega = 2.0 * math.pi * frequency * random.uniform(0.6, 1.0, (3, 6))
    size = np.repeat([0.05, tilt], 3) * random.uniform(0.3, 0.5, (3, 6))
    angle = omega * times[:, None, None] + random.uniform(0.0, 6.0, (3, 6))
    place, speed, acceleration = (np.sum(each, axis=1) for each in (
        size * np.sin(angle), size * omega * np.cos(angle), -size * omega ** 2 * np.sin(angle)))
    motion = Motion.from_euler(place[:, :3] + [0.0, 0.0, 0.6], place[:, 3:], speed[:, :3],
                               speed[:, 3:], acceleration[:, :3], acceleration[:, 3:])
    return stamps_of(times), motion.rows.copy()


def stamps_of(times: Array) -> Stamps:
    return 1000 * SECOND + np.rint(times * SECOND).astype(np.int64)


def found(given: Stream, radius: float = RADIUS) -> dict[str, Inconsistency]:
    """Return the inconsistencies of a whole stream."""
    check = Consistency(radius)
    check.add(*given, np.zeros(len(given[0]), dtype=bool))
    check.finish()
    return check.found


def reasons(given: Stream) -> dict[str, str]:
    return {name: each.reason for name, each in found(given).items()}


def turned(rows: Array, by: Array) -> None:
    """Turn all twists and accelerations (N, 3, 3)."""
    for part in (LINEAR_VELOCITY, ANGULAR_VELOCITY, LINEAR_ACCELERATION, ANGULAR_ACCELERATION):
        rows[:, part] = (by @ rows[:, part, None])[..., 0]


# Right streams

def jittered(given: Stream, seconds: float) -> Stream:
    stamps, rows = given
    stamps = stamps + np.rint(rng(2).normal(0.0, seconds, len(stamps)) * SECOND).astype(np.int64)
    kept = np.append(True, stamps[1:] > np.maximum.accumulate(stamps)[:-1])
    return stamps[kept], rows[kept]


def noisy(given: Stream, size: float) -> Stream:
    stamps, rows = given
    random = rng(3)
    rows[:, POSITION] += random.normal(0.0, size, (len(rows), 3))
    tilts = from_euler(random.normal(0.0, size, (len(rows), 3)))
    rows[:, ROTATION] = (tilts @ rows[:, ROTATION].reshape(-1, 3, 3)).reshape(-1, 9)
    return given


def quantized(given: Stream, step: float) -> Stream:
    stamps, rows = given
    angles = to_euler(rows[:, ROTATION].reshape(-1, 3, 3))
    rows[:, ROTATION] = from_euler(np.round(angles / step) * step).reshape(-1, 9)
    rows[:, POSITION] = np.round(rows[:, POSITION] / step) * step
    return given


def late(given: Stream, samples: int) -> Stream:
    stamps, rows = given
    rows[samples:, TWIST.start:] = rows[:-samples, TWIST.start:].copy()
    return stamps[samples:], rows[samples:]


def differences(given: Stream) -> Stream:
    """Twists and accelerations as differences with the sample before."""
    stamps, rows = given
    step = (stamps[1] - stamps[0]) / SECOND
    for of, part in ((POSITION, LINEAR_VELOCITY), (LINEAR_VELOCITY, LINEAR_ACCELERATION)):
        rows[1:, part] = np.diff(rows[:, of], axis=0) / step
    return stamps[2:], rows[2:]


def filtered(given: Stream, part: slice, cutoff: float = 5.0) -> Stream:
    """Filter poses or accelerations alone, as games do: of first order."""
    stamps, rows = given
    share = 1.0 - math.exp(-2.0 * math.pi * cutoff * (stamps[1] - stamps[0]) / SECOND)
    pose = part == POSE
    rotations = rows[:, ROTATION].reshape(-1, 3, 3)
    values = (np.concatenate([rows[:, POSITION], to_euler(rotations)], axis=1) if pose
              else rows[:, part])
    for n in range(1, len(values)):
        values[n] = values[n - 1] + share * (values[n] - values[n - 1])
    if pose:
        rows[:, POSITION] = values[:, :3]
        rows[:, ROTATION] = from_euler(values[:, 3:]).reshape(-1, 9)
    settled = np.searchsorted(stamps, stamps[0] + SECOND)
    return stamps[settled:], rows[settled:]


def some_dropped(given: Stream) -> Stream:
    kept = rng(4).random(len(given[0])) > 0.15
    return given[0][kept], given[1][kept]


def with_noisy_twist(given: Stream) -> Stream:
    given[1][:, TWIST] += rng(5).normal(0.0, 0.01, (len(given[1]), 6))
    return given


def with_a_jump(given: Stream) -> Stream:
    given[1][len(given[1]) // 2:, 0] += 0.02
    return given


def paused(given: Stream) -> Stream:
    given[0][len(given[0]) // 2:] += 3 * SECOND
    return given


RIGHT: dict[str, Callable[[Stream], Stream]] = {
    'exact': lambda given: given,
    'stamps with jitter': lambda given: jittered(given, 0.0005),
    'tracker noise': lambda given: noisy(given, 2e-4),
    'in tenths of a millimetre': lambda given: quantized(given, 1e-4),
    'single precision': lambda given: (given[0], given[1].astype(np.float32).astype(float)),
    'stamps with jitter of 20 %': lambda given: jittered(
        given, 0.1e-9 * float(given[0][1] - given[0][0])),
    'differences': differences,
    'differences, two samples late': lambda given: late(differences(given), 2),
    'filtered poses': lambda given: filtered(given, POSE),
    'filtered accelerations': lambda given: filtered(given, ACCELERATION),
    'dropped samples': some_dropped,
    'noisy twist': with_noisy_twist,
    'a jump': with_a_jump,
    'a pause': paused,
}


@pytest.mark.parametrize('rate', RATES)
@pytest.mark.parametrize('name', RIGHT)
def test_right_streams_are_consistent(name: str, rate: float) -> None:
    assert found(RIGHT[name](stream(rate))) == {}


@pytest.mark.parametrize('samples', [1, 2])
def test_a_delay_of_two_samples_at_1_khz_is_consistent(samples: int) -> None:
    assert found(late(stream(1000.0), samples)) == {}


@pytest.mark.parametrize('rate', [200.0, 500.0, 1000.0])
@pytest.mark.parametrize('frequency', [20.0, 50.0, 80.0])
@pytest.mark.parametrize('size', [1e-5, 1e-3])
def test_vibration_is_consistent(rate: float, frequency: float, size: float) -> None:
    times = np.arange(round(4.0 * rate)) / rate
    w = 2.0 * math.pi * np.array([0.3, frequency])
    amplitude = np.array([0.05, size])
    phase = times[:, None] * w
    place, speed, acceleration = (np.sum(each, axis=1)[:, None] * [1.0, 0.5, -0.7] for each in (
        amplitude * np.sin(phase), amplitude * w * np.cos(phase),
        -amplitude * w ** 2 * np.sin(phase)))
    rows = Motion.from_euler(place + [0.0, 0.0, 0.6], place, speed, speed, acceleration,
                             acceleration).rows
    assert found((stamps_of(times), rows.copy())) == {}


@pytest.mark.parametrize('rate', RATES)
def test_accelerations_of_zero_are_found_from_those_that_matter(rate: float) -> None:
    """Half a percent of gravity is where inertia begins to matter."""
    for frequency, matters in ((0.1, False), (0.5, True)):
        stamps, rows = stream(rate, frequency=frequency)
        size = float(np.sqrt(np.mean(np.sum(rows[:, LINEAR_ACCELERATION] ** 2, axis=1))))
        assert size > 0.3 if matters else size < 0.05
        rows[:, LINEAR_ACCELERATION] = 0.0
        assert (ACCEL in found((stamps, rows))) is matters


def test_rest_and_noise_at_rest_are_consistent() -> None:
    stamps, rows = stream(200.0)
    rows[:] = rows[0]
    rows[:, TWIST.start:] = 0.0
    assert found((stamps, rows)) == {}
    assert found(noisy((stamps, rows), 1e-4)) == {}
    assert found(with_noisy_twist((stamps, rows))) == {}


@pytest.mark.parametrize('profile', ['bang', 'trapezoid'])
@pytest.mark.parametrize('rate', [20.0, 100.0, 1000.0])
def test_jumps_in_acceleration_are_consistent(profile: str, rate: float) -> None:
    """From rest to rest, back and forth, with acceleration, coasting and deceleration."""
    times = np.arange(round(10.0 * rate)) / rate
    ramp = 0.5 if profile == 'bang' else 0.2
    u = times % 1.0
    shape = np.where(u < ramp, 1.0, np.where(u < 1.0 - ramp, 0.0, -1.0)) / (ramp - ramp ** 2)
    speed = np.where(u < ramp, u, np.where(u < 1.0 - ramp, ramp, 1.0 - u)) / (ramp - ramp ** 2)
    place = np.where(u < ramp, 0.5 * u ** 2, np.where(
        u < 1.0 - ramp, ramp * (u - 0.5 * ramp), ramp - ramp ** 2 - 0.5 * (1.0 - u) ** 2)) / (
            ramp - ramp ** 2)
    back = np.where(times // 1.0 % 2.0 > 0.0, -1.0, 1.0)
    place = np.where(back < 0.0, 1.0 - place, place)
    direction = np.array([0.05, -0.03, 0.02])
    rows = Motion.from_euler(
        [0.0, 0.0, 0.6] + place[:, None] * direction, place[:, None] * direction,
        (back * speed)[:, None] * direction, (back * speed)[:, None] * direction,
        (back * shape)[:, None] * direction, (back * shape)[:, None] * direction).rows
    assert found((stamps_of(times), rows.copy())) == {}


@pytest.mark.parametrize('file', sorted(CONFIG.glob('trajectory_*.yaml')), ids=lambda f: f.stem)
def test_reference_motions_are_consistent(file: Path) -> None:
    parameters = ReferenceMotionParameters.from_yaml(file)
    times = np.arange(2000) / 100.0
    rows = motion_at(parameters, times).rows.copy()
    assert found((stamps_of(times), rows)) == {}
    moves = bool(rows[:, TWIST].any())
    rows[:, TWIST.start:] = 0.0
    assert (VELOCITY in found((stamps_of(times), rows))) == moves


# Wrong streams

def scaled(part: slice, factor: float) -> Callable[[Array], None]:
    def change(rows: Array) -> None:
        rows[:, part] *= factor
    return change


def in_platform_axes(rows: Array) -> None:
    turned(rows, rows[:, ROTATION].reshape(-1, 3, 3).transpose(0, 2, 1))


def euler_rates(rows: Array) -> None:
    matrices = euler_rate_matrix(to_euler(rows[:, ROTATION].reshape(-1, 3, 3)))
    rows[:, ANGULAR_VELOCITY] = np.linalg.solve(matrices, rows[:, ANGULAR_VELOCITY, None])[..., 0]


def of_another_point(rows: Array) -> None:
    arms = rows[:, ROTATION].reshape(-1, 3, 3) @ [0.05, 0.1, 0.3]
    rows[:, LINEAR_VELOCITY] += np.cross(rows[:, ANGULAR_VELOCITY], arms)


def with_gravity(rows: Array) -> None:
    rows[:, LINEAR_ACCELERATION.start + 2] += 9.81


WHOLE = slice(TWIST.start, ACCELERATION.stop)
WRONG: dict[str, tuple[Callable[[Array], None], dict[str, str]]] = {
    'zeros': (scaled(WHOLE, 0.0), dict.fromkeys(
        (VELOCITY, SPIN, ACCEL, SPIN_RATE), 'it is zero, never filled?')),
    'negated twist': (scaled(TWIST, -1.0), dict.fromkeys((VELOCITY, SPIN), '-1 times: a sign?')),
    'mm/s': (scaled(LINEAR_VELOCITY, 1e3), {VELOCITY: '1000 times: in mm/s?'}),
    'deg/s': (scaled(ANGULAR_VELOCITY, 180.0 / math.pi), {SPIN: '57.3 times: in deg/s?'}),
    'a quarter': (scaled(TWIST, 0.25), dict.fromkeys(
        (VELOCITY, SPIN), '0.25 times what is expected')),
    'per millisecond': (scaled(TWIST, 1e-3), {
        VELOCITY: '0.001 times: in m/ms?', SPIN: '0.001 times: in rad/ms?'}),
    'not divided': (scaled(TWIST, 0.005), dict.fromkeys(
        (VELOCITY, SPIN),
        '0.005 times: differences not divided by the time between two samples?')),
    'platform axes': (in_platform_axes, {
        VELOCITY: 'in platform axes? It is expected in base axes'}),
    'Euler rates': (euler_rates, {
        SPIN: 'rates of Euler angles? An angular velocity is expected'}),
    'another point': (of_another_point, {
        VELOCITY: 'of another point, [0.05, 0.1, 0.3] m in the platform frame?'}),
    'negated acceleration': (scaled(ACCELERATION, -1.0), dict.fromkeys(
        (ACCEL, SPIN_RATE), '-1 times: a sign?')),
    'gravity': (with_gravity, {ACCEL: 'gravity is in it, [0, 0, 9.81] m/s^2?'}),
}


@pytest.mark.parametrize('name', WRONG)
def test_a_wrong_derivative_is_found_and_its_reason_named(name: str) -> None:
    change, expected = WRONG[name]
    stamps, rows = stream(200.0, tilt=0.6)
    change(rows)
    named = reasons((stamps, rows))
    assert {quantity: named.get(quantity) for quantity in expected} == expected


@pytest.mark.parametrize('rate', RATES)
@pytest.mark.parametrize('name', ['zeros', 'negated twist', 'mm/s', 'deg/s', 'a quarter'])
def test_it_is_found_at_any_rate_and_with_jitter(name: str, rate: float) -> None:
    change, expected = WRONG[name]
    stamps, rows = stream(rate)
    change(rows)
    assert set(found(jittered((stamps, rows), 0.05 / rate))) >= set(expected)


def test_the_size_of_the_difference_alone_is_stated_without_a_reason() -> None:
    stamps, rows = stream(200.0)
    rows[:, LINEAR_VELOCITY] = stream(200.0, seed=9)[1][:, LINEAR_VELOCITY]
    one = found((stamps, rows))[VELOCITY]
    assert one.reason == ''
    assert one.words.startswith('velocity is not the derivative of the poses: ')
    assert one.words.endswith(f'they differ by {one.difference:.3g} m/s')


def test_what_is_given_and_expected_are_root_mean_squares() -> None:
    stamps, rows = stream(200.0)
    expected = math.sqrt(np.mean(np.sum(rows[:, LINEAR_VELOCITY] ** 2, axis=1)))
    rows[:, LINEAR_VELOCITY] *= -0.5
    one = found((stamps, rows))[VELOCITY]
    assert one.expected == pytest.approx(expected, rel=0.15)
    assert one.given == pytest.approx(0.5 * one.expected, rel=1e-3)
    assert one.difference == pytest.approx(1.5 * one.expected, rel=1e-3)


@pytest.mark.parametrize('rate', RATES)
def test_pieces_give_the_same_as_the_whole(rate: float) -> None:
    stamps, rows = jittered(stream(rate), 0.1 / rate)
    rows[:, TWIST] *= 0.25
    restarts = np.zeros(len(stamps), dtype=bool)
    restarts[len(stamps) // 3] = True
    whole, pieces, ones = (Consistency(RADIUS) for _ in range(3))
    whole.add(stamps, rows, restarts)
    begin = 0
    while begin < len(stamps):
        end = begin + int(rng(begin).integers(1, 90))
        pieces.add(stamps[begin:end], rows[begin:end], restarts[begin:end])
        begin = end
    for stamp, row, restart in zip(stamps.tolist(), rows.tolist(), restarts.tolist(),
                                   strict=True):
        ones.noted.append((stamp, row, restart))
        ones.check_samples()
    for each in (whole, pieces, ones):
        each.finish()
    assert whole.found
    assert whole.found == pieces.found == ones.found
    assert whole.present == pieces.present == ones.present


def test_nothing_is_imported_while_setpoints_are_answered() -> None:
    """Numpy imports some modules on first use, which takes 50 ms: a setpoint would wait."""
    script = (
        'import sys\nimport numpy as np\n'
        'from stewart_dynamics.setpoints.consistency import Consistency\n'
        'rows = np.zeros((2000, 24))\nrows[:, 3:12] = np.eye(3).ravel()\n'
        'rows[:, 0] = np.sin(np.arange(2000) * 1e-2)\n'
        'before, check = {*sys.modules}, Consistency(0.3)\n'
        'for n, row in enumerate(rows.tolist()):\n'
        '    check.noted.append((n * 1_000_000, row, False))\n'
        '    check.check_samples()\n'
        'print(sorted({*sys.modules} - before), sorted(check.present))\n')
    done = run_program(sys.executable, '-c', script)
    assert done.out == "[] ['acceleration', 'velocity']\n"


def test_the_present_state_follows_the_stream() -> None:
    stamps, rows = stream(100.0, seconds=20.0)
    rows[500:1000, TWIST] = 0.0
    check, seen = Consistency(RADIUS), []
    for begin in range(0, len(stamps), 100):
        part = slice(begin, begin + 100)
        check.add(stamps[part], rows[part], np.zeros(100, dtype=bool))
        seen.append(VELOCITY in check.present)
    assert seen[4:6] == [False, False]
    assert all(seen[8:10])
    assert not any(seen[12:])
    assert VELOCITY in check.found
    assert 1004.0 < check.found[VELOCITY].first / SECOND < 1006.5


@pytest.mark.parametrize('wild', [1e300, math.nan, math.inf])
def test_numbers_that_overflow_are_not_judged(wild: float) -> None:
    stamps, rows = stream(100.0)
    rows[300] = wild
    stamps[600] = -2 ** 62
    assert found((stamps, rows)) == {}


# Topics

def take(feed: messages.Feed, rows: Array, rate: float, topics: tuple[str, str, str]) -> None:
    """Feed poses, twists and accelerations."""
    quaternions = to_quaternion(rows[:, ROTATION].reshape(-1, 3, 3))
    for n, row in enumerate(rows):
        stamp = messages.NOW + round(n * SECOND / rate)
        frame = 'world' if BASE_POSE in topics else 'base'
        for topic, data in zip(topics, (
                messages.pose(stamp, row[:3].tolist(), quaternions[n].tolist(), frame),
                messages.twist(stamp, row[TWIST].tolist(), frame),
                messages.accel(stamp, row[ACCELERATION].tolist(), frame)), strict=True):
            if topic in (*feed.setpoints.topics, *feed.setpoints.base.topics):
                feed(topic, data)


def errors_of(rows: Array, topics: tuple[str, str, str], **given: Any) -> list[tuple[str, str]]:
    feed = messages.Feed(symmetric_parameters().replaced(
        {name.replace('__', '.'): value for name, value in given.items()}))
    take(feed, rows, 100.0, topics)
    feed.setpoints.drop_waiting('')
    return [(each.topic, each.text.split(': ')[0])
            for each in feed.setpoints.possible_errors(ever=True)]


def test_possible_errors_are_those_of_the_topics() -> None:
    rows = stream(100.0, seconds=4.0)[1]
    setpoints, base = (POSES, TWISTS, ACCELS), (BASE_POSE, BASE_TWIST, BASE_ACCEL)
    assert errors_of(rows, setpoints) == []
    assert errors_of(rows, base, base__source='motion') == []
    rows[:, ACCELERATION] *= -1.0
    text = 'acceleration is not the derivative of the twists'
    assert (ACCELS, text) in errors_of(rows, setpoints)
    assert (BASE_ACCEL, text) in errors_of(rows, base, base__source='motion')


def w_first(rows: Array) -> None:
    quaternions = to_quaternion(rows[:, ROTATION].reshape(-1, 3, 3))
    rows[:, ROTATION] = np.array([
        np.ravel(from_quaternion(w, x, y, z)) for x, y, z, w in quaternions.tolist()])


def in_mm(rows: Array) -> None:
    rows[:, :3] *= 1e3


def from_home_in_mm(rows: Array) -> None:
    rows[:, :3] = 1e3 * (rows[:, :3] - HOME)


@pytest.mark.parametrize(('mistaken', 'text'), [
    (in_mm, 'position in mm'), (w_first, 'a quaternion in the order w x y z'),
    (from_home_in_mm, 'position in mm and a pose counted from home')])
def test_the_possible_error_in_poses_is_named_before_twists_that_are_not_their_derivative(
        mistaken: Callable[[Array], None], text: str) -> None:
    rows = stream(100.0, seconds=4.0, tilt=0.1)[1]
    rows[:, :3] = HOME + np.array([0.05, 0.0, 0.0]) + 0.3 * (rows[:, :3] - rows[0, :3])
    rows[:, TWIST.start:TWIST.start + 3] *= 0.3
    rows[:, ACCELERATION.start:ACCELERATION.start + 3] *= 0.3
    feed = messages.Feed(LIMITED)
    mistaken(rows)
    take(feed, rows, 100.0, (POSES, TWISTS, ACCELS))
    feed.setpoints.drop_waiting('')
    for ever, which in ((True, 'first'), (False, 'last')):
        pose, twist, *others = feed.setpoints.possible_errors(ever)
        assert (pose.topic, pose.text) == (POSES, f'{which} setpoint: possible error: {text}')
        assert 'is not the derivative of the poses' in twist.text
        assert not any('possible error' in each.text for each in (twist, *others))


def test_poses_alone_have_no_twist_to_be_wrong() -> None:
    rows = stream(100.0, seconds=4.0)[1]
    rows[:, TWIST.start:] = 0.0
    assert errors_of(rows, (POSES, TWISTS, ACCELS), setpoint__source='pose') == []


def test_gravity_in_the_acceleration_of_a_base_at_rest_is_named() -> None:
    rows = np.tile(stream(100.0)[1][:1], (400, 1))
    rows[:, POSE] = [0.0, 0.0, 0.0, *np.eye(3).ravel()]
    rows[:, TWIST.start:] = 0.0
    rows[:, LINEAR_ACCELERATION.start + 2] = 9.80665
    feed = messages.Feed(symmetric_parameters().replaced({'base.source': 'motion'}))
    take(feed, rows, 100.0, (BASE_POSE, BASE_TWIST, BASE_ACCEL))
    feed.setpoints.drop_waiting('')
    one, = feed.setpoints.possible_errors(ever=True)
    assert one.topic == BASE_ACCEL
    assert one.text.endswith('possible error: gravity is in it, [0, 0, 9.81] m/s^2?')
