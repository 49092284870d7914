# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Twist and acceleration of poses: against analytic motions, for any split into batches."""

from __future__ import annotations

from collections.abc import Iterator
import math
import sys
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from numpy.typing import NDArray
import pytest
from referees import rng
from scipy.interpolate import make_smoothing_spline

from snapshot import Snapshot
from stewart_dynamics import Motion
from stewart_dynamics.errors import StewartError
from stewart_dynamics.replay.differentiate import Differentiator, TOO_FAR, TOO_FAST
from stewart_dynamics.replay.smoothing_spline import FEWEST, smoothing_spline
from stewart_dynamics.setpoints.step import Batch

PROGRAM = 'stewart_replay'

Array = NDArray[np.float64]

SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND
POSE, VELOCITY, OMEGA, ACCELERATION, ALPHA = (
    slice(0, 12), slice(12, 15), slice(15, 18), slice(18, 21), slice(21, 24))


def wave(times: Array, amplitudes: Any, frequencies: Any, phases: Any) -> tuple[Array, ...]:
    """Return sinusoids (N, 3) and their first two derivatives."""
    w = 2.0 * math.pi * np.asarray(frequencies)
    angle = times[:, None] * w + phases
    a = np.asarray(amplitudes)
    return a * np.sin(angle), a * w * np.cos(angle), -a * w ** 2 * np.sin(angle)


def motion_at(times: Array, turns: float = 0.6) -> Motion:
    """Return translations up to 1.2 Hz, and rotations about an axis that wanders, exact."""
    position = wave(times, [0.2, 0.15, 0.1], [0.7, 1.1, 1.2], [0.1, 1.0, 2.0])
    angles = wave(times, [turns, 0.5, 2.0 * turns], [0.6, 0.9, 0.3], [0.3, 2.0, 1.2])
    return Motion.from_euler(position[0] + [0.0, 0.0, 1.1], angles[0], position[1], angles[1],
                             position[2], angles[2])


def batch_of(times: Array, motions: Array, restarts: Any = ()) -> Batch:
    """Return the poses as setpoints without velocities."""
    rows = motions.copy()
    rows[:, 12:] = 0.0
    flags = np.zeros(len(times), dtype=bool)
    flags[list(restarts)] = True
    stamps = START + np.round(times * 1e9).astype(np.int64)
    wrenches = np.arange(6.0 * len(times)).reshape(-1, 6)
    bases = np.arange(1.0, 12.0 * len(times) + 1.0).reshape(-1, 12)
    return Batch.from_parts(stamps, rows, wrenches, flags, stamps + 1000, bases)


def pieces(batch: Batch, cuts: Any) -> Iterator[Batch]:
    """Return a batch cut before these setpoints."""
    edges = [0, *sorted(cuts), len(batch.stamps)]
    for begin, end in zip(edges[:-1], edges[1:], strict=True):
        yield batch.chosen(slice(begin, end))


def differentiated(differentiator: Differentiator, batches: Any) -> Batch:
    """Return all that comes out of it."""
    done = [differentiator.add_setpoints(batch) for batch in batches]
    done.append(differentiator.finish())
    # nothing is done yet, or something with a row of the base for each
    some = [each for each in done if len(each.stamps)] or done[-1:]
    assert len({each.moving for each in some}) == 1
    return Batch.joined(some)


def worst(a: Array, b: Array) -> float:
    """Return the largest error relative to the largest size of a vector."""
    return float(np.max(np.linalg.norm(a - b, axis=-1)) / np.max(np.linalg.norm(b, axis=-1)))


def same(a: Batch, b: Batch) -> bool:
    """Return whether two batches are equal, bit for bit."""
    return a.moving == b.moving and all(
        np.array_equal(x, y) for x, y in zip(a[:3], b[:3], strict=True))


# The spline

@pytest.mark.parametrize(('rate', 'cutoff'), [(1000.0, 20.0), (100.0, 5.0), (100.0, 20.0)])
@pytest.mark.parametrize('part', [0.2, 1.0, 2.0, 3.0])
def test_a_sinusoid_passes_as_the_cutoff_frequency_says(
        rate: float, cutoff: float, part: float) -> None:
    h, w = 1.0 / rate, 2.0 * math.pi * part * cutoff
    times = np.arange(0.0, 40.0 / cutoff, h)
    sine, cosine = np.sin(w * times), np.cos(w * times)
    spline = smoothing_spline(times, np.column_stack([sine, cosine]), cutoff)

    # sinusoids are what an endless spline has for eigenfunctions: none turns into another, that
    # is, there is no phase
    spread = (2.0 + math.cos(w * h)) / 3.0
    fourth = (2.0 - 2.0 * math.cos(w * h)) ** 2 / (h ** 4 * spread)
    passes = 1.0 / (1.0 + (math.sqrt(2.0) - 1.0) * fourth / (2.0 * math.pi * cutoff) ** 4)
    middle = slice(len(times) // 3, 2 * len(times) // 3)
    for got, wanted in (
            (spline.values, passes * np.column_stack([sine, cosine])),
            (spline.rates,
             passes * math.sin(w * h) / (h * spread) * np.column_stack([cosine, -sine])),
            (spline.accelerations, passes * (2.0 * math.cos(w * h) - 2.0) / (h * h * spread)
             * np.column_stack([sine, cosine]))):
        assert np.max(np.abs(got - wanted)[middle]) < 1e-5 * np.max(np.abs(wanted))

    # and that is what the module promises of the cut-off frequency, and of derivatives below it
    promised = 1.0 / (1.0 + (math.sqrt(2.0) - 1.0) * part ** 4)
    if part * cutoff <= rate / 5.0:
        assert fourth == pytest.approx(w ** 4, rel=5e-3)
    if part <= 1.0:
        assert passes == pytest.approx(promised, rel=2e-3)
    if part == 1.0:
        assert promised == pytest.approx(math.sqrt(0.5), rel=1e-12)


@pytest.mark.parametrize('seed', range(4))
def test_the_spline_is_scipys(seed: int) -> None:
    random = rng(seed)
    times = np.cumsum(random.uniform(1e-4, 2e-2, 300))
    samples = np.cumsum(random.normal(size=(300, 2)), axis=0)
    cutoff = random.uniform(2.0, 40.0)
    spline = smoothing_spline(times, samples, cutoff)
    steps = np.diff(times)
    weights = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
    for axis in range(2):
        theirs = make_smoothing_spline(
            times, samples[:, axis], w=weights,
            lam=(math.sqrt(2.0) - 1.0) / (2.0 * math.pi * cutoff) ** 4)
        for order, ours in enumerate(spline):
            expected = theirs.derivative(order)(times) if order else theirs(times)
            assert np.max(np.abs(ours[:, axis] - expected)) < 1e-9 * np.max(np.abs(expected))


def test_the_response_is_the_same_however_the_samples_are_spaced() -> None:
    random = rng()
    w = 2.0 * math.pi * 5.0
    for gaps in (random.uniform(1e-4, 8e-3, 4000), np.tile([1e-3, 9e-3], 1500),
                 # in pairs a microsecond apart, as a stamp taken twice may be
                 np.tile([1e-6, 5e-3], 2000),
                 # ten times as dense in one half as in the other
                 np.repeat([5e-4, 5e-3], [8000, 1000])):
        times = np.cumsum(gaps)
        spline = smoothing_spline(times, np.sin(w * times)[:, None], 5.0)
        middle = (times > times[0] + 1.5) & (times < times[-1] - 1.5)
        wanted = math.sqrt(0.5) * np.sin(w * times)
        assert np.max(np.abs(spline.values[:, 0] - wanted)[middle]) < 2e-3
        assert np.max(np.abs(spline.accelerations[:, 0] / w ** 2 + wanted)[middle]) < 1e-2
        assert np.max(np.abs(spline.rates[:, 0] / w - math.sqrt(0.5) * np.cos(w * times))[
            middle]) < 5e-3


def test_noise_of_the_acceleration_agrees_with_the_docstring() -> None:
    cutoff, h, noise = 20.0, 1e-3, 1e-5
    spline = smoothing_spline(
        h * np.arange(200_000), rng().normal(0.0, noise, (200_000, 1)), cutoff)
    w = 2.0 * math.pi * cutoff / (math.sqrt(2.0) - 1.0) ** 0.25
    assert np.std(spline.accelerations) == pytest.approx(
        noise * math.sqrt(math.sqrt(2.0) / 16.0 * h * w ** 5), rel=0.02)


# Motions

# Twice the droop (f / f_c)^4 (sqrt(2) - 1) of the fastest part, the product of two of the angles'
# sinusoids in a quaternion among them, with the spline's own error (w h)^2 / 12
@pytest.mark.parametrize(('rate', 'cutoff', 'velocity', 'acceleration'), [
    (1000.0, 20.0, 2e-4, 4e-4), (1000.0, 100.0, 1e-6, 2e-5), (100.0, 20.0, 2e-4, 1e-3),
    (100.0, 45.0, 5e-5, 6e-4)])
def test_derivatives_of_a_motion(
        rate: float, cutoff: float, velocity: float, acceleration: float) -> None:
    times = np.arange(0.0, 20.0, 1.0 / rate)
    exact = motion_at(times).rows
    done = differentiated(Differentiator(cutoff, 0.1), [batch_of(times, exact)])
    inner = slice(int(2.0 * rate), -int(2.0 * rate))
    assert np.array_equal(done.motions[:, POSE], exact[:, POSE])
    for part, limit in ((VELOCITY, velocity), (OMEGA, velocity), (ACCELERATION, acceleration),
                        (ALPHA, acceleration)):
        assert worst(done.motions[inner, part], exact[inner, part]) < limit


def test_full_turns_pass_where_the_quaternion_changes_its_sign() -> None:
    times = np.arange(0.0, 20.0, 1e-3)
    exact = motion_at(times, turns=5.0).rows
    done = differentiated(Differentiator(40.0, 0.1), [batch_of(times, exact)])
    inner = slice(500, -500)
    assert worst(done.motions[inner, OMEGA], exact[inner, OMEGA]) < 1e-2
    assert worst(done.motions[inner, ALPHA], exact[inner, ALPHA]) < 2e-2


@pytest.mark.parametrize('rate', [100.0, 1000.0])
def test_noise_of_a_measured_pose_stays_small(rate: float) -> None:
    random = rng()
    times = np.arange(0.0, 20.0, 1.0 / rate) + random.uniform(0.0, 0.3 / rate, int(20.0 * rate))
    exact = motion_at(times).rows
    noise, turn_noise = 2e-5, 5e-5
    noisy = exact.copy()
    noisy[:, :3] += random.normal(0.0, noise, (len(times), 3))
    small = Motion.from_euler(np.zeros(3), random.normal(0.0, turn_noise, (len(times), 3)))
    noisy[:, 3:12] = (small.rotation @ exact[:, 3:12].reshape(-1, 3, 3)).reshape(-1, 9)
    cutoff = 10.0
    differentiator = Differentiator(cutoff, 0.1)
    done = differentiated(differentiator, [batch_of(times, noisy)])
    inner = slice(int(rate), -int(rate))
    w = 2.0 * math.pi * cutoff / (math.sqrt(2.0) - 1.0) ** 0.25
    gain = math.sqrt(math.sqrt(2.0) / 16.0 / rate * w ** 5)
    for part, size in ((ACCELERATION, noise), (ALPHA, turn_noise)):
        off = done.motions[inner, part] - exact[inner, part]
        # what the noise must leave, and the droop
        assert np.std(off) < 1.3 * gain * size + 2e-3 * np.std(exact[inner, part])
        assert np.std(off) > 0.5 * gain * size
        # far less than by differences of the recorded
        assert gain < (0.1 if rate == 100.0 else 1e-3) * math.sqrt(6.0) * rate ** 2
    off = differentiator.deviation
    assert 0.5 * noise < off.position_rms / math.sqrt(3.0) < 1.2 * noise
    assert 0.5 * turn_noise < off.angle_rms / math.sqrt(3.0) < 1.3 * turn_noise
    assert off.position_rms < off.position_max < 10.0 * off.position_rms
    assert off.angle_rms < off.angle_max < 10.0 * off.angle_rms


def test_the_integral_of_the_twist_gives_the_pose_back() -> None:
    h = 1e-3
    times = np.arange(0.0, 20.0 + h / 2, h)
    exact = motion_at(times).rows
    done = differentiated(Differentiator(100.0, 0.1), [batch_of(times, exact)]).motions
    begin, end = 200, 19800
    position = done[begin, :3].copy()
    rotation = done[begin, 3:12].reshape(3, 3).copy()
    most = np.zeros(2)
    for at in range(begin, end):
        # trapezoids, corrected by the accelerations at both ends (Euler and Maclaurin)
        a, b = done[at], done[at + 1]
        position += h / 2 * (a[VELOCITY] + b[VELOCITY]) + h * h / 12 * (
            a[ACCELERATION] - b[ACCELERATION])
        turn = h / 2 * (a[OMEGA] + b[OMEGA]) + h * h / 12 * (a[ALPHA] - b[ALPHA]) + (
            h * h / 12 * np.cross(b[OMEGA], a[OMEGA]))  # Magnus
        angle = np.linalg.norm(turn)
        x, y, z = turn / angle
        k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        rotation = (np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k) @ rotation
        most = np.maximum(most, [np.max(np.abs(position - b[:3])),
                                 np.max(np.abs(rotation - b[3:12].reshape(3, 3)))])
    assert most[0] < 1e-7
    assert most[1] < 1e-5


# Windows, segmentes and batches

@pytest.mark.parametrize(('steps', 'cutoff', 'windows'), [
    (rng().uniform(5e-4, 1.5e-3, 30_000), 20.0, (300, 7000)),
    # sparse: few poses for each period of the cut-off frequency
    (np.full(2000, 1e-2), 200.0, (50,)), (np.full(2000, 1e-2), 40.0, (50,)),
    (np.full(600, 1.0 / 30.0), 10.0, (50,))])
def test_windows_change_nothing(steps: Array, cutoff: float, windows: tuple[int, ...]) -> None:
    times = np.cumsum(steps)
    batch = batch_of(times, motion_at(times).rows)
    whole = differentiated(Differentiator(cutoff, 0.1, window=100_000), [batch])
    for window in windows:
        cut = differentiated(Differentiator(cutoff, 0.1, window=window), [batch])
        for part in (VELOCITY, OMEGA, ACCELERATION, ALPHA):
            assert worst(cut.motions[:, part], whole.motions[:, part]) < 1e-9


@given(st.lists(st.sampled_from([0.004, 0.01, 0.0100001, 0.02, 0.3, -0.5, 0.0]), max_size=400),
       st.sets(st.integers(0, 400), max_size=12), st.sampled_from([1, 7, 40, 1000]),
       st.sampled_from([3.0, 20.0]))
def test_batches_change_nothing_and_no_setpoint_is_lost(
        steps: list[float], cuts: set[int], window: int, cutoff: float) -> None:
    times = np.cumsum([0.0, *steps])
    batch = batch_of(times, motion_at(times).rows,
                     [at + 1 for at, step in enumerate(steps) if step < 0.0])
    once = Differentiator(cutoff, 0.1, window)
    whole = differentiated(once, [batch])
    again = Differentiator(cutoff, 0.1, window)
    cut = differentiated(again, pieces(batch, [at for at in cuts if at <= len(steps)]))
    assert same(whole, cut)
    assert once.left_out == again.left_out
    assert once.near_ends == again.near_ends
    assert once.deviation == again.deviation
    assert len(whole.stamps) + once.left_out.total() == len(times)
    # the returned setpoints are the given ones, in their order
    kept = np.isin(batch.wrenches[:, 0], whole.wrenches[:, 0])
    assert np.array_equal(batch.stamps[kept], whole.stamps)
    assert np.array_equal(batch.times[kept], whole.times)
    assert np.array_equal(batch.wrenches[kept], whole.wrenches)
    assert np.array_equal(batch.motions[kept, POSE], whole.motions[:, POSE])
    assert np.isfinite(whole.motions).all()
    # every jump back is a restart, unless it is at the begin or the end
    back = np.flatnonzero(np.diff(whole.stamps) < 0) + 1
    assert whole.restarts[back].all()
    passes = np.cumsum(batch.restarts)[kept]
    assert np.array_equal(whole.restarts, np.diff(passes, prepend=0) > 0)


def test_no_spline_continues_across_a_gap_or_a_restart(snapshot: Snapshot) -> None:
    times = np.arange(0.0, 2.0, 1e-2)
    exact = motion_at(times).rows
    alone = differentiated(Differentiator(10.0, 0.1), [batch_of(times, exact)])
    # the same once more, five seconds later and then five seconds back
    for later, restarts in ((7.0, ()), (-5.0, (len(times),))):
        both = batch_of(np.concatenate([times, times + later]), np.tile(exact, (2, 1)), restarts)
        differentiator = Differentiator(10.0, 0.1)
        done = differentiated(differentiator, [both])
        for half in (slice(0, 200), slice(200, 400)):
            assert worst(done.motions[half, 12:], alone.motions[:, 12:]) < 1e-9
        assert done.restarts.tolist() == both.restarts.tolist()
        assert not differentiator.left_out
        assert differentiator.near_ends == 4 * 10
    # a step as long as the limit is not a gap
    joined = np.concatenate([times, times + 2.09])
    done = differentiated(differentiator := Differentiator(10.0, 0.1), [
        batch_of(joined, motion_at(joined).rows)])
    assert differentiator.near_ends == 2 * 10
    snapshot(differentiator.notices()[1])


def test_too_few_poses_in_a_row_are_left_out_and_counted() -> None:
    times = np.concatenate([np.arange(20) * 0.01, 5.0 + np.arange(FEWEST - 1) * 0.01,
                            -9.0 + np.arange(3) * 0.01, 10.0 + np.arange(FEWEST) * 0.01])
    batch = batch_of(times, motion_at(times).rows, [24])
    differentiator = Differentiator(10.0, 0.1)
    done = differentiated(differentiator, [batch])
    assert differentiator.left_out == {differentiator.too_few: FEWEST - 1 + 3}
    assert np.array_equal(done.stamps, batch.stamps[[*range(20), *range(27, 27 + FEWEST)]])
    # the restart before the three poses applies to the next pose
    assert np.flatnonzero(done.restarts).tolist() == [20]


@pytest.mark.parametrize(('step', 'proposed'), [
    (0.5, '--cutoff 1.6'), (1.0, '--cutoff 0.8'), (0.2, '--cutoff 4'), (0.01, '')])
def test_poses_that_are_slower_than_the_gap_name_the_cutoff_that_joins_them(
        step: float, proposed: str, snapshot: Snapshot) -> None:
    times = np.arange(20) * step
    if not proposed:  # one gap, which no cut-off should bridge
        times[16:] += 7.0
    batch = batch_of(times, motion_at(0.01 * times).rows)
    differentiator = Differentiator(10.0, 0.1)
    differentiated(differentiator, [batch])
    reason, = differentiator.left_out
    snapshot(reason)
    assert reason.endswith('computed') if not proposed else proposed in reason
    if proposed:
        cutoff = float(proposed.split()[1])
        again = Differentiator(cutoff, 1.0 / cutoff)
        assert len(differentiated(again, [batch]).stamps) == len(times)
        assert not again.left_out


@pytest.mark.parametrize('far', [1e10, 1e300])
def test_a_pose_far_out_of_range_is_left_out_alone(far: float) -> None:
    times = np.arange(400) * 0.005
    batch = batch_of(times, motion_at(times).rows, [200])
    batch.motions[200, 2] = far
    differentiator, others = Differentiator(10.0, 0.1), np.arange(400) != 200
    # a piece ends with the far pose: its restart passes over an empty one to the next pose
    done = differentiated(differentiator, pieces(batch, [100, 201, 201]))
    assert differentiator.left_out == {TOO_FAR: 1}
    restarts = batch.restarts
    restarts[201] = True
    assert same(done, differentiated(Differentiator(10.0, 0.1), [
        batch.replaced(restarts=restarts).chosen(others)]))
    assert differentiator.deviation.position_max < 1e-3


def test_poses_that_turn_too_fast_for_the_cutoff_are_left_out_and_counted() -> None:
    times = np.arange(0.0, 4.0, 1e-2)
    # fifteen turns in a second, about an axis at right angles to that in which it stood, from 2 s
    angles = np.zeros((len(times), 3))
    angles[:, 2] = np.where(times < 2.0, 0.0, 2.0 * math.pi * 15.0 * (times - 2.0))
    exact = Motion.from_euler(np.zeros((len(times), 3)), angles).rows
    differentiator = Differentiator(2.0, 0.1)
    done = differentiated(differentiator, [batch_of(times, exact)])
    assert set(differentiator.left_out) == {TOO_FAST}
    assert 150 < differentiator.left_out[TOO_FAST] < 210
    assert len(done.stamps) == 400 - differentiator.left_out[TOO_FAST]
    assert np.isfinite(done.motions).all()


@pytest.mark.parametrize('far', [0, 1])
def test_one_wrench_for_all_is_given_to_each(far: int) -> None:
    times = np.arange(0.0, 1.0, 1e-2)
    poses = batch_of(times, motion_at(times).rows)
    batch = Batch.from_parts(poses.stamps, poses.motions, np.arange(6.0))
    batch.motions[:far, 2] = 1e10
    done = differentiated(Differentiator(10.0, 0.1), [batch])
    assert np.array_equal(done.wrenches, np.tile(np.arange(6.0), (100 - far, 1)))


def test_every_setpoint_keeps_its_base_and_a_still_base_stays_still() -> None:
    times = np.arange(0.0, 2.0, 1e-2)
    batch = batch_of(times, motion_at(times).rows)
    done = differentiated(Differentiator(10.0, 0.1, window=30), pieces(batch, [7, 90]))
    assert done.bases is not None
    assert np.array_equal(done.bases, batch.bases)
    still = Differentiator(10.0, 0.1)
    still.add_setpoints(Batch.from_parts(batch.stamps, batch.motions))
    assert still.finish().bases is None


def test_no_poses_give_no_setpoints() -> None:
    differentiator = Differentiator(10.0, 0.1)
    done = differentiator.finish()
    assert [each.shape for each in (
        done.stamps, done.motions, done.wrenches, done.restarts, done.times, done.stamped)] == [
        (0,), (0, 24), (0, 6), (0,), (0,), (0,)]
    assert done.bases is None
    assert not differentiator.left_out
    assert differentiator.deviation == (0.0, 0.0, 0.0, 0.0)


def test_the_notice_states_the_cutoff_and_the_deviation(snapshot: Snapshot) -> None:
    times = np.arange(0.0, 4.0, 1e-2)
    differentiator = Differentiator(12.5, 0.1)
    differentiated(differentiator, [batch_of(times, motion_at(times).rows)])
    text, ends = differentiator.notices()
    snapshot(text)
    assert f'{differentiator.deviation.position_rms * 1e3:.3g} mm' in text
    snapshot(ends)


# Rejected values

@pytest.mark.parametrize('cutoff', [0.0, -1.0, math.nan, math.inf])
def test_a_cutoff_that_is_not_positive_is_rejected(cutoff: float, snapshot: Snapshot) -> None:
    with snapshot.raises(StewartError):
        Differentiator(cutoff, 0.1)


def test_a_cutoff_too_low_for_the_digits_of_a_double_is_rejected(snapshot: Snapshot) -> None:
    times = np.arange(5000) * 1e-3
    batch = batch_of(times, motion_at(times).rows)
    with snapshot.raises(StewartError):
        differentiated(Differentiator(0.4, 0.1), [batch])


def test_missing_scipy_is_reported_in_one_line(
        monkeypatch: pytest.MonkeyPatch, snapshot: Snapshot) -> None:
    monkeypatch.setitem(sys.modules, 'scipy.linalg', None)
    with snapshot.raises(StewartError):
        Differentiator(10.0, 0.1)
