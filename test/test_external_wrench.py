# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The external wrench: known loads, its filter, its noise, and its errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
from typing import Any

from hypothesis import given, strategies as st
from messages import imu, joint_state
import numpy as np
from numpy.typing import NDArray
import pytest
from referees import (
    random_motion, random_parameters, random_wrench, relative, rng, ROOT,
    smooth_motion)
from simulated import FRICTIONLESS, simulated
from snapshot import Snapshot
from stewart_dynamics import BaseMotion, Motion, Parameters, Pose, StewartPlatform
from stewart_dynamics.arrays import NO_WRENCH, Six
from stewart_dynamics.errors import MotionError, PoseError, SingularityError
from stewart_dynamics.external_wrench.estimate import (
    Estimate, external_wrenches, ExternalWrench, Measurement, Overload, Target)
from stewart_dynamics.external_wrench.measured_legs import (
    MEASURED_LEGS, MeasuredLegs, NOT_CONVERGED, SINGULAR, UNSTAMPED)
from stewart_dynamics.mechanics.stewart_platform import InverseDynamics
from stewart_dynamics.messages.joint_state import MISSING_JOINTS, UNEVEN
from stewart_dynamics.reference_motion.motion_functions import motion_at
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.setpoints.base_input import BaseInput
from stewart_dynamics.setpoints.input_messages import BASE_IMU
from stewart_dynamics.setpoints.rejections import (
    BASE_NOT_KNOWN, MALFORMED, NOT_FINITE, OUT_OF_RANGE, Rejection, Rejections, TOO_OLD, TWICE)
from stewart_dynamics.simulator.plant import Plant

Array = NDArray[np.float64]

HEXAPOD = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
HOME = Motion([0.0, 0.0, 1.1], np.eye(3))
LOAD = (150.0, -100.0, 250.0, 60.0, -40.0, 80.0)
BEGIN = 1_700_000_000_000_000_000
MILLISECOND = 1_000_000
# So high that nothing is left of the filter.
UNFILTERED = {'external_wrench.cutoff': 1e9}


def target_of(motion: Motion) -> Target:
    """Return a motion of one sample as the last setpoint."""
    found = StewartPlatform(HEXAPOD).inverse_dynamics(motion, singular='nan')
    return Target(tuple(motion.rows.reshape(-1).tolist()), float(found.determinant))


def six(values: Any) -> Six:
    a, b, c, d, e, f = np.asarray(values, dtype=float).tolist()
    return a, b, c, d, e, f


def measurement(stamp: int, result: InverseDynamics) -> Measurement:
    """Return the measurement of a result of one sample."""
    return Measurement(stamp, six(result.lengths), six(result.rates), six(result.forces))


def measured(parameters: Parameters, motion: Motion, loads: Any, stamps: Sequence[int],
             ) -> list[Measurement]:
    """Return measurements of a hexapod that moves so under these loads, (N, ...) of each."""
    result = StewartPlatform(parameters).inverse_dynamics(motion, loads)
    return [Measurement(stamp, six(lengths), six(rates), six(forces))
            for stamp, lengths, rates, forces in zip(
                stamps, result.lengths, result.rates, result.forces, strict=True)]


def resting(parameters: Parameters, motion: Motion, load: Any, stamps: Sequence[int],
            ) -> list[Measurement]:
    """Return the same of a hexapod that rests in the pose of a motion under a load."""
    still = Motion(motion.position, motion.rotation)
    result = StewartPlatform(parameters).inverse_dynamics(still, load)
    return [measurement(stamp, result) for stamp in stamps]


def estimates(step: ExternalWrench, measurements: Sequence[Measurement], target: Motion = HOME,
              known: Any = NO_WRENCH) -> list[Estimate]:
    """Return the estimates from measurements one after the other."""
    found: list[Estimate] = []
    row = target_of(target)
    for each in measurements:
        found.append(step(each, found[-1] if found else None, six(known), row))
    return found


def wrenches(found: Sequence[Estimate]) -> Array:
    """Return an array (N - 1, 6) of wrenches: the first measurement has no wrench."""
    assert found[0].wrench is None
    return np.array([each.wrench for each in found[1:]])


def times(random: np.random.Generator, many: int) -> list[int]:
    """Return stamps that are anything but regular, a microsecond to 50 ms apart."""
    gaps = 10.0 ** random.uniform(3.0, math.log10(5e7), many)
    return (BEGIN + np.cumsum(gaps).astype(int)).tolist()


# Known loads

def test_on_a_moving_base_its_motion_is_no_external_load() -> None:
    """A hexapod held at rest on a base that rolls, under a load."""
    random = rng(2)
    parameters = random_parameters(random).replaced(UNFILTERED)
    platform, of_base = StewartPlatform(parameters), smooth_motion(parameters, random)
    pose = random_motion(parameters, random, 1)
    still = Motion(pose.position[0], pose.rotation[0])
    load = random_wrench(parameters, random, 1)[0]
    step, found, row = ExternalWrench(parameters), [], target_of(still)
    for n in range(200):
        base = BaseMotion.from_motion(of_base(n * 1e-3), parameters['gravity'])
        # The forces of a millisecond are those of its middle.
        middle = BaseMotion.from_motion(of_base((n - 0.5) * 1e-3), parameters['gravity'])
        result = platform.inverse_dynamics(still, load, middle)
        found.append(step(
            measurement(BEGIN + n * MILLISECOND, result), found[-1] if found else None,
            NO_WRENCH, row, tuple(base.rows.tolist())))
    assert relative(wrenches(found), np.tile(load, (199, 1))) < 1e-4
    without = estimates(ExternalWrench(parameters), [
        measurement(BEGIN + n * MILLISECOND, result) for n in range(2)], still)
    assert relative(wrenches(without), [load]) > 0.1


def test_a_static_load_is_found() -> None:
    """Use random hexapods with a known load that is not external."""
    random = rng(1)
    for _ in range(20):
        parameters = random_parameters(random).replaced(UNFILTERED)
        pose = random_motion(parameters, random, 1)
        pose = Motion(pose.position[0], pose.rotation[0])
        load, known = random_wrench(parameters, random, 2)
        found = estimates(
            ExternalWrench(parameters),
            resting(parameters, pose, load + known, times(random, 3)), pose, known)
        assert relative(wrenches(found), [load, load]) < 1e-9
        assert relative(found[-1].motion[:3], pose.position) < 1e-9
        differences = np.linalg.solve(
            StewartPlatform(parameters).inverse_jacobian(pose).T, -load)
        assert relative(found[-1].differences, differences) < 1e-9


def test_in_motion_it_is_the_residual_of_the_equation_of_motion() -> None:
    """
    Unfiltered, it is the mean over both ends of M dX'/dt + C X' + G - J_inv^T f - known.

    With forces measured at the end instead of held ones, the error is of first order.
    """
    random = rng(3)
    for _ in range(5):
        parameters = random_parameters(random, actuators=False).replaced(UNFILTERED)
        platform = StewartPlatform(parameters)
        motion_at = smooth_motion(parameters, random)
        load, known = random_wrench(parameters, random, 2)
        largest = []
        for interval in (4 * MILLISECOND, 2 * MILLISECOND, MILLISECOND):
            stamps = list(range(BEGIN, BEGIN + 200 * MILLISECOND, interval))
            motion = motion_at(np.subtract(stamps, BEGIN) * 1e-9)
            data = measured(parameters, motion, load + known, stamps)
            found = wrenches(estimates(ExternalWrench(parameters), data, motion_at(0.0), known))
            twist = np.concatenate([motion.linear_velocity, motion.angular_velocity], axis=1)
            acceleration = np.diff(twist, axis=0) / (interval * 1e-9)
            mass, jacobian = platform.mass_matrix(motion), platform.inverse_jacobian(motion)
            rest = platform.gravity_vector(motion) - known + np.einsum(
                'nij,nj->ni', platform.coriolis_matrix(motion), twist)
            forces = np.array([each.efforts for each in data[1:]])
            left = sum(np.einsum('nij,nj->ni', mass[end], acceleration) + rest[end]
                       - np.einsum('nji,nj->ni', jacobian[end], forces)
                       for end in (slice(None, -1), slice(1, None)))
            assert relative(found, 0.5 * left) < 1e-9
            largest.append(np.max(np.abs(found - load)))
        orders = np.log2(np.divide(largest[:-1], largest[1:]))
        assert np.all(np.abs(orders - 1.0) < 0.1)


def test_many_are_the_equation_of_motion_of_each() -> None:
    """With the sign of ~/wrench: the load that the model does not contain is found."""
    random = rng(9)
    for _ in range(10):
        parameters = random_parameters(random)
        platform = StewartPlatform(parameters)
        motion = random_motion(parameters, random, 50)
        known, load = random_wrench(parameters, random, 50), random_wrench(parameters, random, 50)
        model = platform.inverse_dynamics(motion, known).forces
        forces = platform.inverse_dynamics(motion, known + load).forces
        found = external_wrenches(platform, motion.rows, model, forces)
        assert relative(found, load) < 1e-9
        jacobian = platform.inverse_jacobian(motion)
        assert relative(found, np.einsum('nji,nj->ni', jacobian, model - forces)) < 1e-12
        # Each alone gives the same bits, of a pose alone too, and however the arrays lie.
        for n in range(0, 50, 7):
            assert np.array_equal(external_wrenches(
                platform, motion.rows[n:n + 1, :12], model[n:n + 1], forces[n:n + 1]),
                found[n:n + 1])
        assert np.array_equal(external_wrenches(
            platform, motion.rows[::-2], model[::-2], forces[::-2]), found[::-2])
    assert external_wrenches(platform, np.empty((0, 12)), *np.empty((2, 0, 6))).shape == (0, 6)


# The filter

def test_the_filter_follows_a_step_by_the_closed_form_at_irregular_times() -> None:
    """Compare with 1 - exp(-2 pi cutoff t), then with the decay after the load ends."""
    random = rng(4)
    cutoff = 3.0
    step = ExternalWrench(HEXAPOD.replaced({'external_wrench.cutoff': cutoff}))
    stamps = times(random, 400)
    found = estimates(step, [*resting(HEXAPOD, HOME, LOAD, stamps[:200]),
                             *resting(HEXAPOD, HOME, None, stamps[200:])])
    since = 2.0 * math.pi * cutoff * np.subtract(stamps, stamps[0])[1:] * 1e-9
    share = -np.expm1(-since[:199])
    share = np.concatenate([share, share[-1] * np.exp(since[198] - since[199:])])
    assert relative(wrenches(found), share[:, None] * LOAD) < 1e-9


def noisy(parameters: Parameters, interval: int, many: int, deviation: float, seed: int,
          ) -> tuple[list[Measurement], Array]:
    """Return a hexapod at rest whose rates have noise, and that noise (many, 6) [m/s]."""
    stamps = range(BEGIN, BEGIN + many * interval, interval)
    rest = resting(parameters, HOME, None, stamps)
    noise = deviation * rng(seed).standard_normal((many, 6))
    return [each._replace(rates=six(rate))
            for each, rate in zip(rest, noise, strict=True)], noise


@pytest.mark.parametrize('interval', [10_000_000, 1_000_000, 100_000])
def test_noise_is_bounded_however_short_the_time_between_measurements(interval: int) -> None:
    """
    White noise in the rates comes out as at most K M J_inv^-1 times itself, K = 2 pi cutoff.

    The gain is K x (1 - exp(-x)) sqrt(2 / (1 + exp(-x))) / x^2 with x = K dt, from the filter's
    transfer function, K (1 - z^-1) (1 - a) / x / (1 - a z^-1).
    """
    frictionless, deviation, many = HEXAPOD.replaced(FRICTIONLESS), 1e-4, 20_000
    found = estimates(ExternalWrench(frictionless),
                      noisy(frictionless, interval, many, deviation, 5)[0])
    platform = StewartPlatform(frictionless)
    per_rate = platform.mass_matrix(HOME) @ np.linalg.inv(platform.inverse_jacobian(HOME))
    gain = 2.0 * math.pi * 10.0
    x = gain * interval * 1e-9
    expected = deviation * gain * -math.expm1(-x) / x * math.sqrt(2.0 / (1.0 + math.exp(-x)))
    deviations = np.std(np.linalg.solve(per_rate, wrenches(found).T), axis=1)
    assert expected <= deviation * gain
    assert np.all(np.abs(deviations - expected) < 0.05 * expected)
    # The difference quotient alone.
    raw = estimates(ExternalWrench(frictionless.replaced(UNFILTERED)),
                    noisy(frictionless, interval, 1000, deviation, 5)[0])
    rough = np.std(np.linalg.solve(per_rate, wrenches(raw).T), axis=1)
    assert np.all(rough > 0.9 * math.sqrt(2.0) * deviation / (interval * 1e-9))


def test_the_estimate_is_that_of_a_momentum_observer() -> None:
    """De Luca's residual, r = K (p - integral(J_inv^T f - G + r)), of the same noisy data."""
    frictionless = HEXAPOD.replaced(FRICTIONLESS)
    platform = StewartPlatform(frictionless)
    interval, many = 100_000, 10_000
    data, noise = noisy(frictionless, interval, many, 1e-4, 6)
    touched = resting(frictionless, HOME, LOAD, [0])[0].efforts
    data = [each._replace(efforts=touched) if 3000 <= n < 7000 else each
            for n, each in enumerate(data)]
    mass, gravity = platform.mass_matrix(HOME), platform.gravity_vector(HOME)
    jacobian = platform.inverse_jacobian(HOME)
    momentum = np.linalg.solve(jacobian, noise.T).T @ mass
    gain, dt = 2.0 * math.pi * 10.0, interval * 1e-9
    residual, integral, observed = np.zeros(6), np.zeros(6), []
    for n in range(1, many):
        integral += dt * (jacobian.T @ data[n].efforts - gravity + residual)
        residual = gain * (momentum[n] - momentum[0] - integral)
        observed.append(residual)
    found = wrenches(estimates(ExternalWrench(frictionless), data))
    # Euler's rule for the integral: off by K dt / 2 of the value.
    assert relative(found, observed) < gain * dt
    assert relative(np.std(found[:2900], axis=0), np.std(observed[:2900], axis=0)) < gain * dt


# Time

def test_a_wrench_needs_two_measurements_without_a_gap() -> None:
    step = ExternalWrench(HEXAPOD)
    gap = 100 * MILLISECOND
    stamps = [0, gap, 2 * gap + 1, 2 * gap + 2, MILLISECOND, 2 * MILLISECOND]
    found = estimates(step, resting(HEXAPOD, HOME, LOAD, stamps))
    assert [each.wrench is None for each in found] == [True, False, True, False, True, False]
    assert [each.differences is None for each in found] == [each.wrench is None for each in found]
    # The filter has restarted: after a nanosecond its output is close to zero.
    assert found[1].force > 200.0
    assert 0.0 < found[3].force < 1e-4


def test_the_acceleration_is_the_mean_one() -> None:
    motion_at = smooth_motion(HEXAPOD, rng(7))
    motion = motion_at([0.0, 0.01])
    found = estimates(ExternalWrench(HEXAPOD), measured(
        HEXAPOD, motion, None, [BEGIN, BEGIN + 10 * MILLISECOND]), motion_at(0.0))
    assert relative(found[1].motion[12:18], np.concatenate(
        [motion.linear_velocity[1], motion.angular_velocity[1]])) < 1e-9
    assert relative(found[1].motion[18:21], np.diff(motion.linear_velocity, axis=0) / 0.01) < 1e-9
    assert found[0].motion[18:] == NO_WRENCH


# The pose to begin with

def test_the_search_begins_at_home_without_a_guess() -> None:
    for parameters in (HEXAPOD, random_parameters(rng(8))):
        size = float(np.mean(np.linalg.norm(parameters['geometry.base_joints'], axis=1)))
        pose = HOME if parameters is HEXAPOD else Motion([0.0, 0.0, size], np.eye(3))
        at = resting(parameters, pose, None, [BEGIN])[0]
        found = ExternalWrench(parameters)(at, None, NO_WRENCH, None)
        assert relative(found.motion[:3], pose.position) < 1e-9


def test_the_search_begins_at_the_last_pose_and_then_at_the_setpoint(snapshot: Snapshot) -> None:
    """Below the base there is a pose of the same lengths."""
    below = Motion([0.0, 0.0, -1.1], np.eye(3))
    step = ExternalWrench(HEXAPOD)
    at = resting(HEXAPOD, HOME, None, [BEGIN])[0]
    found = step(at, None, NO_WRENCH, target_of(below))
    assert relative(found.motion[:3], below.position) < 1e-9
    again = step(at, found._replace(stamp=BEGIN + 10 ** 12), NO_WRENCH, target_of(HOME))
    assert relative(again.motion[:3], below.position) < 1e-9
    # It does not converge from the last pose: the setpoint is the guess.
    flat = found._replace(stamp=0, motion=tuple(Motion([0.0, 0.0, 0.0], np.eye(3)).rows.tolist()))
    assert relative(step(at, flat, NO_WRENCH, target_of(HOME)).motion[:3],
                    HOME.position) < 1e-9
    # But not within a series.
    with snapshot.raises(SingularityError):
        step(at, flat._replace(stamp=BEGIN - 1), NO_WRENCH, target_of(HOME))


# Singularities

@pytest.mark.parametrize(('turn', 'crossings', 'lag'), [
    (1.66, 1, 0.0), (1.66, 1, 0.02), (1.52, 0, 0.0), (1.52, 0, 0.02)])
def test_the_estimate_follows_the_setpoint_through_a_singularity(
        turn: float, crossings: int, lag: float) -> None:
    """The paper's motion, and one that ends short of the singularity and returns."""
    reference = ReferenceMotionParameters.from_yaml(
        ROOT / 'config' / 'trajectory_singular.yaml').replaced({
            'motion.final': [0.06, -0.04, 0.8, 0.1, -0.08, turn]})
    seconds = np.arange(0.0, 10.0, 0.0025)
    if not crossings:
        seconds = 10.0 - np.abs(10.0 - 2.0 * seconds)  # there and back
    targets = motion_at(reference, seconds)
    true = motion_at(reference, np.maximum(seconds - lag, 0.0))
    platform, step = StewartPlatform(HEXAPOD), ExternalWrench(HEXAPOD)
    sides = np.sign(platform.inverse_dynamics(targets, singular='nan').determinant)
    assert np.count_nonzero(np.diff(sides)) == crossings
    result = platform.inverse_dynamics(true, singular='nan')
    found: list[Estimate] = []
    for n in range(len(seconds)):
        found.append(step(
            Measurement(BEGIN + n * 5 * MILLISECOND // 2, six(result.lengths[n]),
                        six(result.rates[n]), six(result.forces[n])),
            found[-1] if found else None, NO_WRENCH, Target(
                tuple(targets.rows[n].tolist()), float(sides[n]))))
    poses = np.array([each.motion[:12] for each in found])
    off = np.abs(poses - true.rows[:, :12]).max(axis=1)
    # While the platform lags behind, near the singularity its mirror image may be taken.
    behind = np.zeros(len(off), dtype=bool)
    at = np.flatnonzero(np.diff(sides))
    for n in at:
        behind[n:n + round(lag / 0.0025) + 2] = True
    assert off[~behind].max() < 1e-8 and off.max() < 0.01
    # A restart, without a wrench, for each crossing.
    assert sum(each.wrench is None for each in found) == 1 + crossings


def test_a_setpoint_beyond_a_singularity_that_is_not_followed_changes_nothing() -> None:
    step, platform = ExternalWrench(HEXAPOD), StewartPlatform(HEXAPOD)
    beyond = Motion.from_euler([0.06, -0.04, 0.8], [0.1, -0.08, 1.66])
    assert platform.inverse_dynamics(HOME).determinant * platform.inverse_dynamics(
        beyond).determinant < 0.0
    legs = resting(HEXAPOD, HOME, LOAD, [BEGIN + n * MILLISECOND for n in range(50)])
    found = [step(legs[0], None, NO_WRENCH, target_of(HOME))]
    for each in legs[1:]:
        found.append(step(each, found[-1], NO_WRENCH, target_of(beyond)))
    assert found == estimates(ExternalWrench(HEXAPOD), legs)


# Impossible

def test_lengths_of_no_pose_are_an_error(snapshot: Snapshot) -> None:
    at = resting(HEXAPOD, HOME, None, [BEGIN])[0]
    step = ExternalWrench(HEXAPOD)
    for lengths in ((0.1, *at.positions[1:]), (-1.0,) * 6, (1e300,) * 6):
        with snapshot.raises((PoseError, SingularityError)):
            step(at._replace(positions=six(lengths)), None, NO_WRENCH, target_of(HOME))


@pytest.mark.parametrize('changed', [
    {'rates': (1e308,) * 6}, {'efforts': (1e308,) * 6}], ids=str)
def test_numbers_that_overflow_are_an_error(changed: dict[str, Any], snapshot: Snapshot) -> None:
    step = ExternalWrench(HEXAPOD)
    first, second = resting(HEXAPOD, HOME, None, [BEGIN, BEGIN + 1])
    before = estimates(step, [first])[0]
    with snapshot.raises(MotionError):
        step(second._replace(**changed), before, NO_WRENCH, None)
    # It leaves nothing behind.
    assert step(second, before, NO_WRENCH, None) == estimates(step, [first, second])[1]


# Thresholds

def test_an_exceeded_threshold_is_reported() -> None:
    parameters = HEXAPOD.replaced({**UNFILTERED, 'external_wrench.force_max': 50.0})
    rest = resting(HEXAPOD, HOME, (30.0, 0.0, 40.1, 3.0, 0.0, 4.0), [0, MILLISECOND])
    found = estimates(ExternalWrench(parameters), rest)[1]
    assert found.overloads == (Overload('external_wrench.force_max', found.force, 50.0),)
    assert (found.force, found.moment) == pytest.approx((math.hypot(30.0, 40.1), 5.0))
    both = HEXAPOD.replaced({**UNFILTERED, 'external_wrench.force_max': 51.0,
                             'external_wrench.moment_max': 4.9})
    found = estimates(ExternalWrench(both), rest)[1]
    assert [each.limit for each in found.overloads] == ['external_wrench.moment_max']
    assert estimates(ExternalWrench(HEXAPOD), rest)[1].overloads == ()


# In the simulator

def controlled(rate: float) -> tuple[Array, float]:
    """
    Let the plant follow a motion for 4 s by PD and feed-forward, under a load from 1 s to 3 s.

    Return the wrenches (N, 6), nan of the first, and the largest error of a position [m].
    """
    plant, step, last = Plant(simulated(rate=rate)), ExternalWrench(HEXAPOD), None
    seconds = np.arange(round(4.0 * rate)) / rate
    wanted = StewartPlatform(HEXAPOD).inverse_dynamics(swing(seconds))
    found, off = np.full((len(seconds), 6), np.nan), 0.0
    for n, now in enumerate(seconds.tolist()):
        state = plant.state
        command = (wanted.forces[n] + 61.0 * 900.0 * (wanted.lengths[n] - state.positions)
                   + 61.0 * 42.0 * (wanted.rates[n] - state.rates))
        state = plant.advance(six(command), LOAD if 1.0 <= now < 3.0 else NO_WRENCH)
        last = step(Measurement(BEGIN + round((n + 1) * 1e9 / rate), state.positions, state.rates,
                                state.efforts), last, NO_WRENCH, None)
        if last.wrench is not None:
            found[n] = last.wrench
        off = max(off, math.dist(last.motion[:3], state.pose[:3]))
    assert not plant.fault
    return found, off


def swing(seconds: Any) -> Motion:
    """Return a bounded motion of all six coordinates, at rest at first."""
    t = np.asarray(seconds, dtype=float)[..., None]
    amplitudes = np.array([0.05, 0.04, 0.06, 0.1, 0.08, 0.12])
    rates = 2.0 * np.pi * np.array([0.5, 0.7, 0.6, 0.45, 0.55, 0.65])
    # (1 - cos) / 2 has no velocity at the start; its acceleration is the motor's to give.
    pose = 0.5 * amplitudes * (1.0 - np.cos(rates * t))
    rate = 0.5 * amplitudes * rates * np.sin(rates * t)
    acceleration = 0.5 * amplitudes * rates ** 2 * np.cos(rates * t)
    return Motion.from_euler(pose[..., :3] + [0.0, 0.0, 1.1], pose[..., 3:], rate[..., :3],
                             rate[..., 3:], acceleration[..., :3], acceleration[..., 3:])


# Sign and unit of the efforts

def judged(measurements: Sequence[Measurement], parameters: Parameters = HEXAPOD,
           ) -> list[Estimate]:
    """Return the estimates from messages, with the possible errors in their efforts."""
    def failed(*said: object) -> None:
        pytest.fail(f'{said}')

    legs = MeasuredLegs(parameters, ExternalWrench(parameters), failed, failed)
    found = [legs.use_message(message_of(each), NO_WRENCH, None) for each in measurements]
    return [each for each in found if each is not None]


def with_noise(measurements: Sequence[Measurement], factor: float = 1.0, noise: float = 0.0,
               ) -> list[Measurement]:
    """Return measurements with efforts in another unit, and noise as the accuracy page has it."""
    random = rng(3)
    return [each._replace(
        positions=six(each.positions + noise * 1e-5 * random.normal(size=6)),
        rates=six(each.rates + noise * 1e-4 * random.normal(size=6)),
        efforts=six(factor * (each.efforts + noise * 5.0 * random.normal(size=6))))
        for each in measurements]


STREAMS = [(rate, noise, moving) for rate in (1000.0, 100.0, 20.0) for noise in (0.0, 1.0)
           for moving in (True, False)]


def stream(rate: float, moving: bool, load: Any = NO_WRENCH, parameters: Parameters = HEXAPOD,
           ) -> list[Measurement]:
    """Return measurements over two seconds."""
    seconds = np.arange(0.0, 2.0, 1.0 / rate)
    stamps = [BEGIN + round(each * 1e9) for each in seconds]
    return measured(parameters, swing(seconds if moving else np.zeros(len(seconds))), load, stamps)


@pytest.mark.parametrize(('factor', 'what'), [
    (-1.0, 'sign'), (1e-3, 'unit'), (0.0, 'zero'), (0.01, 'torque'), (-1e-3, 'sign')])
@pytest.mark.parametrize(('rate', 'noise', 'moving'), STREAMS)
def test_efforts_of_another_sign_or_unit_give_no_wrench(
        factor: float, what: str, rate: float, noise: float, moving: bool) -> None:
    found = judged(with_noise(stream(rate, moving), factor, noise))
    assert not noise or found[-1].wrench is not None
    first = 0 if not noise else len(found) // 4
    assert all(each.published is None for each in found[first:])
    assert {each.possible_error.what for each in found[max(first, 1):]
            if each.possible_error} == {what}


@pytest.mark.parametrize(('rate', 'noise', 'moving'), STREAMS)
def test_loads_and_a_wrong_mass_are_no_possible_error_in_the_efforts(
        rate: float, noise: float, moving: bool) -> None:
    weight, mass = 9.81 * HEXAPOD['platform.mass'], HEXAPOD['platform.mass']
    push = np.zeros((round(2.0 * rate), 6))
    push[len(push) // 4:, 2] = 3.0 * weight  # lifted: all legs pull
    loads = [np.array(LOAD), push, np.array([0.3 * weight, 0.0, -0.3 * weight, 0.0, 0.0, 0.0])]
    streams = [stream(rate, moving, load) for load in loads] + [
        stream(rate, moving, parameters=HEXAPOD.replaced({'platform.mass': factor * mass}))
        for factor in (0.8, 1.3)]
    for each in streams:
        found = judged(with_noise(each, noise=noise))
        late = found[len(found) // 8 if noise else 0:]
        assert all(estimate.possible_error is None for estimate in late)


def moving(rate: float, noise: float = 0.0) -> list[Measurement]:
    """Return measurements over four seconds."""
    seconds = np.arange(0.0, 4.0, 1.0 / rate)
    return with_noise(measured(HEXAPOD, swing(seconds), NO_WRENCH, [
        BEGIN + round(each * 1e9) for each in seconds]), noise=noise)


WRONG_RATES: dict[str, tuple[Callable[[Array, Array], Array], str]] = {
    'zero': (lambda p, v: 0.0 * v, ': 0 m/s RMS, by the positions ?: it is zero, never filled?'),
    'half': (lambda p, v: 0.5 * v, ': 0.5 times what is expected'),
    'negative': (lambda p, v: -v, ': -1 times: a sign?'),
    'mm/s': (lambda p, v: 1e3 * v, ': 1000 times: in mm/s?'),
    'positions': (lambda p, v: p, ''),
    'constant': (lambda p, v: 0.0 * v + 0.5, ''),
    'one dead': (lambda p, v: v * (np.arange(6) != 2), 'leg_3: 0 m/s RMS, by the positions ?: '
                 'it is zero, never filled?'),
    'two of the other sign': (lambda p, v: v * [1, -1, 1, 1, -1, 1], 'leg_2, leg_5: '),
    'exchanged': (lambda p, v: v[[3, 1, 2, 0, 4, 5]],
                  ': in another order, leg_4, leg_2, leg_3, leg_1, leg_5, leg_6?')}


@pytest.mark.parametrize('rate', [1000.0, 200.0, 50.0])
@pytest.mark.parametrize('wrong', WRONG_RATES)
def test_velocities_that_are_not_the_derivative_of_positions_give_no_wrench(
        wrong: str, rate: float) -> None:
    change, words = WRONG_RATES[wrong]
    noise = 1.0 if rate > 50.0 else 0.0
    found = judged([each._replace(rates=six(change(
        np.array(each.positions) - ZERO_LENGTHS, np.array(each.rates)))) for each in moving(
            rate, noise)])
    last = found[-1]
    assert last.wrench is not None and last.published is None
    assert last.possible_error is not None and last.possible_error.what == 'rate'
    said = last.possible_error.text
    assert said.startswith('velocity is not the derivative of position: ')
    for part in words.split('?: '):
        assert part in said, said
    assert {each.possible_error.what for each in found if each.possible_error} <= {
        'rate', 'scale', 'sign'}


@pytest.mark.parametrize('noise', [0.0, 1.0])
@pytest.mark.parametrize('rate', [1000.0, 200.0, 50.0])
def test_right_velocities_are_no_possible_error(rate: float, noise: float) -> None:
    found = judged(moving(rate, noise))
    assert all(each.published is not None for each in found[1:])
    # those of encoders, quantized and differences of each other, and those of a filter
    late = max(1, round(0.01 * rate))
    steps = moving(rate)
    lengths = np.round(np.array([each.positions for each in steps]) / 1e-6) * 1e-6
    rates = np.diff(lengths, axis=0, prepend=lengths[:1]) * rate
    for values in (rates, np.repeat(rates[:1], late, axis=0).tolist() + rates.tolist()):
        assert not any(each.possible_error for each in judged([
            each._replace(positions=six(length), rates=six(value)) for each, length, value in zip(
                steps, lengths, values, strict=False)]))


@pytest.mark.parametrize('rate', [1000.0, 200.0, 50.0])
def test_stamps_of_arrival_give_no_wrench(rate: float) -> None:
    """Messages wait until there are some of them, as behind a slow bus or network."""
    steps, size = moving(rate), max(2, round(0.02 * rate))
    late = [each._replace(stamp=steps[min(n - n % size + size - 1, len(steps) - 1)].stamp
                          + n % size * 10_000) for n, each in enumerate(steps)]
    last = judged(late)[-1]
    assert last.published is None and last.possible_error is not None
    assert last.possible_error.what == 'stamps'
    # lost messages leave the stamps of the others right
    assert all(each.possible_error is None for each in judged([
        each for n, each in enumerate(steps) if n % (2 * size) < size]))


def test_a_changed_mass_is_judged_anew() -> None:
    heavy = HEXAPOD.replaced({'platform.mass': 6.0 * HEXAPOD['platform.mass']})
    legs = MeasuredLegs(HEXAPOD, ExternalWrench(HEXAPOD), print, print)
    *first, last = [message_of(each) for each in stream(100.0, True, parameters=heavy)]
    for message in first:
        found = legs.use_message(message, NO_WRENCH, None)
    assert found is not None and found.possible_error is not None
    assert found.possible_error.what == 'scale' and found.published is not None
    legs.use_parameters(heavy, ExternalWrench(heavy))
    found = legs.use_message(last, NO_WRENCH, None)
    assert found is not None and found.possible_error is None


@pytest.mark.parametrize('rate', [1000.0, 500.0, 100.0])
def test_a_wrench_on_the_moving_plant_is_found_within_5_percent(rate: float) -> None:
    """Compare force and moment from 0.1 s after each change of the load: 0.2 % of it is left."""
    found, off = controlled(rate)
    assert off < 1e-9
    for begin, end, load in ((0.1, 1.0, NO_WRENCH), (1.1, 3.0, LOAD), (3.1, 4.0, NO_WRENCH)):
        errors = found[round(begin * rate):round(end * rate)] - load
        for part in (slice(0, 3), slice(3, 6)):
            assert np.max(np.linalg.norm(errors[:, part], axis=1)) < (
                0.05 * np.linalg.norm(LOAD[part]))


# Messages on ~/measured_legs: any layout, any order of names, and every reason of rejection

JOINTS = list(HEXAPOD['joints'])
TARGET = target_of(HOME)
ZERO_LENGTHS = HEXAPOD['geometry.zero_length']


def message_of(at: Measurement, **options: Any) -> bytes:
    """Return the message of a measurement of HEXAPOD."""
    return joint_state(
        at.stamp, JOINTS, at.positions - ZERO_LENGTHS, at.rates, at.efforts, **options)


class Followed:
    """Measured legs, and the reports of them."""

    def __init__(self, parameters: Parameters = HEXAPOD) -> None:
        self.rejected: list[tuple[Rejection, str]] = []
        self.noticed: list[str] = []
        self.base: BaseInput | None = None
        self._legs = MeasuredLegs(
            parameters, ExternalWrench(parameters),
            lambda rejection, details: self.rejected.append((rejection, details)),
            self.noticed.append)

    def use_message(self, data: bytes) -> Estimate | None:
        return self._legs.use_message(data, NO_WRENCH, TARGET, self.base)

    def rejects(self, data: bytes, reason: str, details: str) -> None:
        """Check that a message is rejected, for which reason and with which details."""
        many = len(self.rejected)
        assert self.use_message(data) is None
        assert len(self.rejected) == many + 1
        rejection, said = self.rejected[-1]
        assert rejection == (MEASURED_LEGS, reason)
        assert details in said
        assert '\n' not in said


REST = resting(HEXAPOD, HOME, LOAD, range(BEGIN, BEGIN + 50 * MILLISECOND, MILLISECOND))
EXPECTED = estimates(ExternalWrench(HEXAPOD), [
    each._replace(positions=six(each.positions - ZERO_LENGTHS + ZERO_LENGTHS))
    for each in REST])


def test_messages_give_what_the_step_gives_for_their_numbers() -> None:
    followed = Followed()
    assert [followed.use_message(message_of(each)) for each in REST] == EXPECTED
    assert not followed.rejected
    assert not followed.noticed


def test_measured_legs_are_rejected_until_the_base_is_known() -> None:
    parameters = HEXAPOD.replaced({'base.source': 'imu'})
    base = BaseInput(parameters, Rejections(lambda *why: None), lambda text: None)
    followed = Followed(parameters)
    followed.base = base
    followed.rejects(message_of(REST[0]), BASE_NOT_KNOWN, f'stamp {BEGIN} ns')
    base.join_message(BASE_IMU, imu(BEGIN, force=(0.0, 0.0, 9.80665)), lambda: 0)
    found = [followed.use_message(message_of(each)) for each in REST]
    assert len(followed.rejected) == 1
    last = found[-1]
    assert last is not None
    assert last.wrench == pytest.approx(EXPECTED[-1].wrench, rel=1e-9)


def test_padding_bytes_are_ignored() -> None:
    """Fast DDS fills messages up to four bytes, and padding may be anything."""
    followed = Followed()
    for at, filling in zip(REST[:8], (b'', b'\0', b'\0', b'\xff\xff\xff', b'', b'\1', b'\2', b''),
                           strict=True):
        assert followed.use_message(message_of(at, frame='abc') + filling) is not None
    assert not followed.rejected


# Rejections

def changed(**fields: Any) -> Callable[[Measurement], bytes]:
    """Return what makes a message with other fields of a measurement."""
    def make(at: Measurement) -> bytes:
        given = {'names': JOINTS, 'position': at.positions - ZERO_LENGTHS, 'velocity': at.rates,
                 'effort': at.efforts, **fields}
        return joint_state(at.stamp, **given)
    return make


@pytest.mark.parametrize(('make', 'reason', 'details'), [
    (changed(names=[*JOINTS[:5], 'elbow']), MISSING_JOINTS,
     'leg_6; there are leg_1, leg_2, leg_3, leg_4, leg_5, elbow'),
    (changed(names=[], position=[], velocity=[], effort=[]), MISSING_JOINTS, 'there are none'),
    (changed(velocity=[], effort=[]), 'without velocity and effort', '6 names'),
    (changed(names=[*JOINTS, 'elbow']), UNEVEN,
     '7 names, 6 of position, 6 of velocity, 6 of effort'),
    (changed(position=[math.nan] + [0.3] * 5), NOT_FINITE, 'nan'),
    (changed(velocity=[1e308] * 6), OUT_OF_RANGE, f'stamp {BEGIN + MILLISECOND} ns'),
    (changed(position=[9.0, 0.3, 0.3, 0.3, 0.3, 0.3]), NOT_CONVERGED,
     'lengths [9.95, 1.25, 1.25, 1.25, 1.25, 1.25] m: did not converge: residual '),
    (lambda at: message_of(at._replace(stamp=0)), UNSTAMPED, 'the time between'),
    (lambda at: message_of(at)[:-9], MALFORMED, ' bytes: '),
    (lambda at: message_of(at._replace(stamp=BEGIN)), TWICE, f'stamp {BEGIN} ns'),
    (lambda at: message_of(at._replace(stamp=BEGIN - 2 * MILLISECOND)), TOO_OLD,
     'is 0.002 s older than the last used'),
])
def test_a_rejected_message_changes_nothing(
        make: Callable[[Measurement], bytes], reason: str, details: str) -> None:
    followed = Followed()
    assert followed.use_message(message_of(REST[0])) == EXPECTED[0]
    followed.rejects(make(REST[1]), reason, details)
    assert followed.use_message(message_of(REST[2])) == estimates(
        ExternalWrench(HEXAPOD), [REST[0], REST[2]])[1]
    assert len(followed.rejected) == 1


def test_a_hexapod_that_is_singular_everywhere_is_rejected() -> None:
    """Base and platform are similar hexagons."""
    similar = HEXAPOD.replaced({
        'geometry.base_joints': (1.5 * HEXAPOD['geometry.platform_joints']).ravel()})
    followed = Followed(similar)
    lengths = StewartPlatform(similar).inverse_kinematics(Pose([0.0, 0.0, 1.1], np.eye(3)))
    followed.rejects(message_of(REST[0]._replace(positions=six(lengths))), SINGULAR, 'lengths [')


@given(st.binary(max_size=120), st.integers(0, 400), st.integers(0, 255))
def test_for_any_input_a_wrench_is_finite(noise: bytes, at: int, byte: int) -> None:
    followed = Followed()
    sound = message_of(REST[0])
    for data in (noise, sound[:at] + noise, sound[:at] + bytes([byte]) + sound[at + 1:],
                 message_of(REST[1]), message_of(REST[2])):
        found = followed.use_message(data)
        if found is not None and found.wrench is not None:
            assert np.all(np.isfinite(found.wrench))


# Time

def test_a_jump_back_is_a_restart() -> None:
    followed = Followed()
    late = 10 ** 12
    for at in REST[:3]:
        assert followed.use_message(message_of(at._replace(stamp=at.stamp + late))) is not None
    assert [followed.use_message(message_of(each)) for each in REST] == EXPECTED
    assert followed.noticed == [
        'measured_legs: stamps jumped back by 1000 s: followed as a restart']
    assert not followed.rejected


def test_the_setpoint_is_the_guess_after_a_long_search() -> None:
    """Such a hexapod was moved meanwhile; until then only the last pose is believed."""
    followed = Followed()
    assert followed.use_message(message_of(REST[0])) is not None
    away = StewartPlatform(HEXAPOD).inverse_dynamics(swing(0.9))
    for n in range(1, 4):
        followed.rejects(changed(position=[5.0, 0.3, 0.3, 0.3, 0.3, 0.3])(
            REST[0]._replace(stamp=BEGIN + n * 30 * MILLISECOND)), NOT_CONVERGED, ' iterations')
    found = followed.use_message(changed(position=away.lengths - ZERO_LENGTHS)(
        REST[0]._replace(stamp=BEGIN + 120 * MILLISECOND)))
    assert found is not None
    assert found.wrench is None
