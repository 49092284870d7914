# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The singularity warning: crossings, hysteresis, prediction."""

from __future__ import annotations

import itertools
import math

from checked_results import checked
import numpy as np
import pytest
from referees import (
    random_direction, random_parameters, rng, rotation_about, size_of, symmetric_parameters)

from stewart_dynamics import InverseDynamics, Motion, Parameters, StewartPlatform
from stewart_dynamics.mechanics.rows import (
    CONDITION, DETERMINANT, DETERMINANT_RATE, MOTION, RESULT)
from stewart_dynamics.mechanics.singularity_warning import (
    Cause, HYSTERESIS, Singularity, time_to_crossing, UNSOLVABLE_CONDITION)

PARAMETERS = symmetric_parameters().replaced({
    'singularity.warn_condition': 50.0, 'singularity.stop_condition': 500.0,
    'singularity.warn_time': 0.5})


def advanced(state: Singularity, parameters: Parameters, *sample: float) -> Singularity:
    """Return the state after one more sample: det, its rate, condition number."""
    result = np.zeros(RESULT)
    result[[DETERMINANT, DETERMINANT_RATE, CONDITION]] = sample
    return checked(parameters, result, state)[0]


def after(*samples: tuple[float, float, float], start: Singularity | None = None) -> Singularity:
    """Return the state after samples of (det, its rate, condition number)."""
    state = start or Singularity()
    for sample in samples:
        state = advanced(state, PARAMETERS, *sample)
    return state


def turning(parameters: Parameters, axis: np.ndarray, rate: float, time: float) -> Motion:
    """Return the platform in the hexapod's middle at a time of a steady turn."""
    return Motion([0.0, 0.0, size_of(parameters)], rotation_about(axis, rate * time), None,
                  rate * axis)


def state_after(state: Singularity, platform: StewartPlatform, motion: Motion) -> Singularity:
    """Return the state after a sample of a motion."""
    row = platform.solve(motion.rows.reshape(1, MOTION))[0]
    return advanced(state, platform.parameters, *row[[DETERMINANT, DETERMINANT_RATE, CONDITION]])


def test_the_first_state_has_no_warning() -> None:
    state = after((0.2, 0.0, 3.0))
    assert not state.warning
    assert not state.stopped
    assert state.cause is Cause.NONE
    assert state.crossings == 0
    assert state.time_to_crossing == math.inf
    assert state.determinant == 0.2


def test_a_change_of_sign_between_two_samples_is_a_crossing() -> None:
    for sign in (1.0, -1.0):
        state = after((sign * 0.2, 0.0, 3.0), (-sign * 0.2, 0.0, 3.0))
        assert state.warning
        assert state.cause is Cause.CROSSED
        assert state.crossings == 1
        assert after((-sign * 0.2, 0.0, 3.0), start=state).crossings == 1
        assert not after((-sign * 0.2, 0.0, 3.0), start=state).warning
        assert after((sign * 0.2, 0.0, 3.0), start=state).crossings == 2


def test_a_negative_determinant_alone_is_no_warning() -> None:
    state = after((-0.2, 0.0, 3.0), (-0.1, 0.0, 3.0))
    assert not state.warning
    assert state.crossings == 0


def test_a_determinant_of_exactly_zero_is_crossed_when_the_sign_has_changed() -> None:
    assert after((0.2, 0.0, 3.0), (0.0, 0.0, 1e16), (-0.2, 0.0, 3.0)).crossings == 1
    assert after((0.2, 0.0, 3.0), (0.0, 0.0, 1e16), (0.2, 0.0, 3.0)).crossings == 0
    assert after((0.0, 0.0, 1e16), (0.2, 0.0, 3.0)).crossings == 0


def test_a_warning_of_the_condition_ends_below_a_part_of_where_it_began() -> None:
    assert HYSTERESIS == 0.8
    assert not after((0.2, 0.0, 49.9)).warning
    warned = after((0.2, 0.0, 50.0))
    assert warned.warning
    assert warned.cause is Cause.CONDITION
    assert after((0.2, 0.0, 40.1), start=warned).warning
    assert not after((0.2, 0.0, 39.9), start=warned).warning
    assert not after((0.2, 0.0, 39.9), (0.2, 0.0, 40.1), start=warned).warning


def test_a_stop_ends_below_a_part_of_where_it_began() -> None:
    assert not after((0.2, 0.0, 499.9)).stopped
    stopped = after((0.2, 0.0, 500.0))
    assert stopped.stopped
    assert after((0.2, 0.0, 400.1), start=stopped).stopped
    left = after((0.2, 0.0, 399.9), start=stopped)
    assert not left.stopped
    assert left.warning
    assert not after((0.2, 0.0, 400.1), start=left).stopped


def test_a_crossing_is_predicted_within_its_time_and_no_longer() -> None:
    # det 0.2 falling by 0.4 a second: zero in 0.5 s
    assert not after((0.2, -0.4, 3.0)).warning
    predicted = after((0.2, -0.41, 3.0))
    assert predicted.cause is Cause.PREDICTED
    assert predicted.time_to_crossing == pytest.approx(0.2 / 0.41, rel=1e-15)
    assert after((0.2, -0.33, 3.0), start=predicted).warning  # 0.606 s < 0.5 s / 0.8
    assert not after((0.2, -0.31, 3.0), start=predicted).warning
    assert after((-0.2, 0.41, 3.0)).warning
    moving_away = after((0.2, 0.41, 3.0))
    assert not moving_away.warning
    assert moving_away.time_to_crossing == math.inf


def test_time_to_crossing_is_the_same_for_one_and_for_many() -> None:
    dets, rates = np.array([0.2, 0.2, -0.2, -0.2, 0.2, 0.0, 0.0]), np.array(
        [-0.4, 0.4, 0.4, -0.4, 0.0, 1.0, 0.0])
    times = time_to_crossing(dets, rates)
    assert np.array_equal(times[:6], [0.5, np.inf, 0.5, np.inf, np.inf, 0.0])
    for det, rate, time in zip(dets, rates, times, strict=True):
        assert after((det, rate, 3.0)).time_to_crossing == time
    row = np.zeros(RESULT)
    row[DETERMINANT], row[DETERMINANT_RATE] = 0.2, -0.4
    of_result = InverseDynamics(row)
    assert of_result.time_to_crossing == 0.5


@pytest.mark.parametrize('rate', [0.5, -2.0])
def test_the_predicted_time_nears_the_true_one_along_a_quarter_turn(rate: float) -> None:
    parameters = symmetric_parameters()
    platform = StewartPlatform(parameters)
    axis = np.array([0.0, 0.0, 1.0])
    crossing = np.pi / 2 / abs(rate)
    errors = []
    for left in 0.2 * crossing * 0.5 ** np.arange(8):
        result = platform.inverse_dynamics(turning(parameters, axis, rate, crossing - left))
        errors.append(abs(result.time_to_crossing / left - 1.0))
    assert errors[0] < 0.5
    # Newton's step to a simple zero: in the limit its relative error falls with the time left.
    assert all(later < 0.65 * sooner
               for sooner, later in itertools.pairwise(errors))
    assert errors[-1] < 0.51 * errors[-2]


def test_the_predicted_time_nears_the_true_one_on_hexapods_without_symmetry() -> None:
    random = rng()
    crossed = 0
    while crossed < 5:
        parameters = random_parameters(random)
        platform = StewartPlatform(parameters)
        axis = np.array([0.0, 0.0, 1.0]) + 0.2 * random_direction(random)
        axis /= np.linalg.norm(axis)

        def det(time: float, p: Parameters = parameters, platform: StewartPlatform = platform,
                axis: np.ndarray = axis) -> float:
            motion = turning(p, axis, 1.0, time)
            return float(np.linalg.det(platform.inverse_jacobian(motion)))

        low, high = 0.0, 2.5
        if det(low) * det(high) > 0.0:
            continue
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if det(low) * det(middle) > 0.0 else (low, middle)
        for left in (1e-2, 1e-3, 1e-4):
            result = platform.inverse_dynamics(turning(parameters, axis, 1.0, low - left))
            assert result.time_to_crossing == pytest.approx(left, rel=30.0 * left)
        crossed += 1


def test_a_turn_through_a_singularity_is_warned_of_before_and_counted_once() -> None:
    parameters = PARAMETERS
    platform = StewartPlatform(parameters)
    axis = np.array([0.0, 0.0, 1.0])
    crossing = np.pi / 2
    state, warned_at, stopped = Singularity(), math.inf, []
    for time in np.arange(0.0, 2.5, 0.007):
        state = state_after(state, platform, turning(parameters, axis, 1.0, time))
        if state.warning:
            warned_at = min(warned_at, time)
        if state.stopped:
            stopped.append(time)
        if time < crossing:
            assert state.crossings == 0
    # warn_time is 0.5 s; det(J) flattens out on the way to its zero, which comes a bit later
    assert crossing - 0.8 < warned_at < crossing - 0.5
    assert state.crossings == 1
    assert not state.warning
    # every stop lies around the crossing: a condition of 500, left at 400
    assert stopped
    assert all(abs(time - crossing) < 0.01 for time in stopped)


def test_a_crossing_that_no_sample_is_near_is_counted() -> None:
    parameters = PARAMETERS.replaced({'singularity.warn_time': 0.0})
    platform = StewartPlatform(parameters)
    axis = np.array([0.0, 0.0, 1.0])
    state = Singularity()
    causes = []
    for time in (0.9, 1.2, 1.9, 2.2):
        state = state_after(state, platform, turning(parameters, axis, 1.0, time))
        causes.append(state.cause)
    assert causes == [Cause.NONE, Cause.NONE, Cause.CROSSED, Cause.NONE]
    assert state.crossings == 1


def test_an_exactly_singular_sample_warns_and_stops() -> None:
    platform = StewartPlatform(PARAMETERS)
    turn = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    state = state_after(Singularity(), platform, Motion([0.0, 0.0, 1.0], turn))
    assert state.warning
    assert state.stopped
    row = platform.solve(Motion([[0.0, 0.0, 1.0]], turn).rows)[0]
    assert row[CONDITION] > UNSOLVABLE_CONDITION
