# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Checks that twists are the derivatives of poses, and accelerations the derivatives of twists.

Samples are thinned to knots, at least TICK apart, and the knots are grouped into periods. In a
period the change of a pose over windows of a few knots is compared with the integral of the twist
by the trapezoidal rule, and the change of the twist with the integral of the acceleration. A
difference counts where it exceeds what stamps that jitter, noise or quantization of the poses, and
a delay of a few samples or of a filter explain; all three are estimated from the samples. A
quantity is inconsistent if most windows with enough motion are, in two periods in a row.

Arrays in, no clock. The result does not depend on how samples are split into batches, nor on when
the work is done: ``check_samples`` does it in steps, so that no setpoint waits for a whole period.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterator, Mapping, Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics.arrays import Array, Flags, Integers, NANOSECOND, Stamps
from stewart_dynamics.mechanics.frames.rotation import (
    euler_rate_matrix, to_euler, to_rotation_vector)
from stewart_dynamics.mechanics.rows import (
    ANGULAR_ACCELERATION, ANGULAR_VELOCITY, LINEAR_ACCELERATION, LINEAR_VELOCITY,
    POSITION, ROTATION, TWIST)
from stewart_dynamics.setpoints.inconsistency_causes import (
    ACCELERATION, Inconsistency, POSES, QUANTITIES, RATES, reason_of, SPIN, SPIN_RATE, Sums,
    TWIST_OF, TWISTS, TWISTS_GIVEN, VELOCITY)

_COLUMNS = {VELOCITY: LINEAR_VELOCITY, SPIN: ANGULAR_VELOCITY, ACCELERATION: LINEAR_ACCELERATION,
            SPIN_RATE: ANGULAR_ACCELERATION}

# Shortest time between two knots [ns]; the knot is the first sample after a multiple of it.
TICK = 5_000_000
# Intervals between the knots of a period; smallest number of those of the last period.
PERIOD, _FEWEST = 64, 12
# Periods begin at least this far apart, in ticks: one second.
_INTERVAL = 200
# Lengths of windows that are tried, in intervals.
_LAGS = 1, 3, 9, 27
# Samples that are gathered before they are looked at.
_GATHERED = 64

# Relative difference that is consistent, besides noise, jitter and delay.
TOLERANCE = 0.06
# Delay of a derivative that is consistent: in samples (a difference with the sample before is half
# a sample late, and messages may be two), and at least in seconds: that of a filter of 5 Hz.
DELAY_IN_SAMPLES, DELAY = 3.0, 0.035
# Largest noise of a window, as part of its motion, with which it is judged.
_NOISE_SHARE = 0.25
# A pause this many times as long as usual is a gap.
_GAP = 3.0
# Share of the windows with motion that must differ, and their smallest number.
SHARE, _WINDOWS = 0.4, 6
# Inconsistent periods in a row before anything is reported.
PERSISTENT = 2
# Inconsistent periods whose windows are added up to find the reason.
_MOST_PERIODS = 100

# Slowest motion that is judged: velocity in platform radii per second (or rad/s), and
# acceleration [m/s^2] (of a point at the platform radius): half a percent of gravity.
SLOWEST, WEAKEST = 2e-3, 0.05
# Smallest changes of a window: in platform radii (or rad) of the pose, of the integrated twist.
_SMALLEST, _SMALLEST_INTEGRAL = 1e-5, 5e-3


class MessageError(NamedTuple):
    """A possible error in the messages of a topic."""

    topic: str
    text: str
    first: int | None = None  # stamp from which it is found [ns]; None: all messages have it
    values: tuple[tuple[str, str], ...] = ()  # keys with units, and values, for diagnostics

    @property
    def words(self) -> str:
        """Return the error in one line."""
        return f'{self.topic}: {self.text}'


class _Windows(NamedTuple):
    """Windows of n periods for one quantity, and their verdicts."""

    moving: Flags  # (n,): there are enough windows with motion
    bad: Flags  # (n,): most of these differ
    lag: Integers  # (n,): length of a window in intervals


class Consistency:
    """
    The check of a stream of motions.

    radius: size of the platform [m]; smaller motions are not judged, in terms of it.
    frame: name of the axes in which twists are expected, and of those of the body, for words;
        None: the motion is that of measured legs, which have neither axes nor accelerations.
    """

    def __init__(self, radius: float,
                 frame: tuple[str, str] | None = ('base', 'platform')) -> None:
        self._radius = radius
        self._frame = frame
        self._pending: list[tuple[Stamps, Array, Flags]] = []
        self._steps: Iterator[None] | None = None  # those that ``check_samples`` has not yet done
        self.noted: list[tuple[Any, Any, Any]] = []
        """Single samples not yet checked: stamp [ns], row of motion, whether time jumped back."""
        self._held = 0
        self._due = _GATHERED
        # Tick of the last period's beginning, and that of the next one's at the earliest.
        self._begun: tuple[int, int] | None = None
        self._judged = dict.fromkeys(QUANTITIES, 0)  # periods
        self._row = dict.fromkeys(QUANTITIES, 0)  # inconsistent periods in a row
        self._sums: dict[str, Sums] = {}  # of the present inconsistency
        self.found: dict[str, Inconsistency] = {}
        """The first inconsistency of each quantity, with all of the same that followed."""
        self.present: dict[str, Inconsistency] = {}
        """Those of the last periods with enough motion."""

    def check_samples(self) -> None:
        """Do one step, a fraction of a millisecond, of the check of the samples noted so far."""
        if self._steps is not None:
            with np.errstate(all='ignore'):  # numbers that overflow are not judged
                for _ in self._steps:
                    return
            self._steps = None
        if len(self.noted) >= _GATHERED:
            self._steps = self._take_noted()

    def note_samples(self, stamps: Stamps, motions: Array, restarts: Flags) -> None:
        """Add N samples as ``add`` does; a single one is left to ``check_samples``."""
        if len(stamps) == 1:
            self.noted.append((stamps[0], motions[0], restarts[0]))
        else:
            self.add(stamps, motions, restarts)

    def add(self, stamps: Stamps, motions: Array, restarts: Flags) -> None:
        """Add N samples: stamps [ns], rows of motion (N, MOTION), whether time jumped back."""
        self._do(self._add(stamps, motions, restarts))

    def finish(self) -> None:
        """Judge the remaining samples."""
        self._do(self._periods(ended=True))

    def _do(self, steps: Iterator[None]) -> None:
        """Do all steps, after those that are left."""
        with np.errstate(all='ignore'):
            deque(chain(self._steps or (), self._take_noted(), steps), maxlen=0)
        self._steps = None

    def _take_noted(self) -> Iterator[None]:
        if self.noted:
            stamps, motions, restarts = zip(*self.noted, strict=True)
            self.noted = []
            yield from self._add(
                np.array(stamps, dtype=np.int64), np.array(motions), np.array(restarts))

    def _add(self, stamps: Stamps, motions: Array, restarts: Flags) -> Iterator[None]:
        self._pending.append((stamps, motions, restarts))
        self._held += len(stamps)
        if self._held >= self._due:
            yield from self._periods()

    def _periods(self, ended: bool = False) -> Iterator[None]:
        """Judge all complete periods, step by step."""
        if not self._held:
            return
        stamps, motions, restarts = (np.concatenate(each) for each in zip(
            *self._pending, strict=True))
        cells = stamps // TICK
        knots = np.concatenate([[0], np.flatnonzero(cells[1:] != cells[:-1]) + 1])
        at, kept = self._begin(cells[knots]), []
        while at is not None and at + PERIOD < len(knots):
            kept.append(knots[at:at + PERIOD + 1])
            begun = int(cells[knots[at]])
            self._begun = begun, begun + _INTERVAL
            knots = knots[at + PERIOD:]
            at = self._begin(cells[knots])
        if kept:
            yield from self._judge(stamps, motions, restarts, np.array(kept))
        if ended and at is not None and len(knots) - at > _FEWEST:
            yield from self._judge(stamps, motions, restarts, knots[None, at:])
        # Without a period that has begun, the last sample shows whether the next one is a knot.
        begin = len(stamps) if ended else len(stamps) - 1 if at is None else int(knots[at])
        self._pending = [(stamps[begin:], motions[begin:], restarts[begin:])]
        self._held = len(stamps) - begin
        self._due = self._held + _GATHERED
        if ended:
            for quantity in QUANTITIES:
                # A short stream has only one period.
                if self._row[quantity] == self._judged[quantity]:
                    self._report(quantity)

    def _begin(self, cells: Integers) -> int | None:
        """Return the first of these knots at which a period begins; None if it is not there."""
        if self._begun is None:
            return 0
        begun, following = self._begun
        may = np.flatnonzero((cells >= following) | (cells < begun))
        return int(may[0]) if len(may) else None

    def _judge(self, stamps: Stamps, motions: Array, restarts: Flags, at: Integers,
               ) -> Iterator[None]:
        """Judge periods, given by their knots (n, length + 1), step by step."""
        yield
        periods = _Periods(stamps, motions, restarts, at)
        radius = self._radius
        yield
        twists = yield from periods.windows(TWISTS, None, [
            (size * _SMALLEST, size * _SMALLEST_INTEGRAL, size * SLOWEST)
            for size in (radius, 1.0)])
        rates = {} if self._frame is None else (yield from periods.windows(RATES, {
            twist: found.bad for twist, found in twists.items()}, [
            (size * WEAKEST * 1e-3, size * WEAKEST, size * WEAKEST)
            for size in (1.0, 1.0 / radius)]))
        for n in range(len(at)):
            for quantity, found in (twists | rates).items():
                if found.moving[n]:
                    yield
                    twist = TWIST_OF.get(quantity, quantity)
                    self._note(quantity, bool(found.bad[n]), periods, n, int(found.lag[n]),
                               bool(twists[twist].bad[n]))

    def _note(self, quantity: str, bad: bool, periods: _Periods, n: int, lag: int,
              twist_bad: bool) -> None:
        self._judged[quantity] += 1
        if not bad:
            self._row[quantity] = 0
            self._sums.pop(quantity, None)
            self.present.pop(quantity, None)
            return
        self._row[quantity] += 1
        sums = self._sums.get(quantity)
        if sums is None:
            sums = self._sums[quantity] = Sums(periods.first(n))
        if sums.periods < _MOST_PERIODS:
            periods.add_windows(quantity, n, lag, twist_bad, sums)
            if self._row[quantity] >= PERSISTENT:
                self._report(quantity)

    def _report(self, quantity: str) -> None:
        sums = self._sums.get(quantity)
        if sums is None or not sums.windows:
            return
        expected, given, difference = np.sqrt(sums.rates / sums.windows).tolist()
        found = Inconsistency(
            quantity, given, expected, difference,
            reason_of(quantity, sums, self._frame), sums.first,
            POSES if quantity in TWISTS or 'same' in sums.candidates else TWISTS_GIVEN)
        self.present[quantity] = found
        if quantity not in self.found or self.found[quantity].first == found.first:
            self.found[quantity] = found


def inconsistencies(
        consistency: Consistency | None, ever: bool, topics: Mapping[str, str],
        reasons: bool = True) -> list[MessageError]:
    """
    Return the inconsistencies of a stream as possible errors.

    ever: all that were found, else the present ones.
    topics: the topic of each quantity.
    reasons: whether likely reasons of differences from the poses are named.
    """
    if consistency is None:
        return []
    found = consistency.found if ever else consistency.present
    shown = {name: each if reasons or each.of != POSES else each._replace(reason='')
             for name, each in found.items()}
    return [MessageError(topics[name], each.words, each.first, each.values)
            for name, each in shown.items()]


class _Periods:
    """n periods of the same number of intervals."""

    def __init__(self, stamps: Stamps, motions: Array, restarts: Flags, at: Integers) -> None:
        self._stamps, self._motions, self._at = stamps, motions, at
        self._number, self._length = len(at), at.shape[1] - 1
        # Each pair of samples, one after the other; pairs of a period follow those of the last.
        counts = at[:, -1] - at[:, 0]
        ends = np.cumsum(counts)
        before = np.arange(ends[-1]) + np.repeat(at[:, 0] - (ends - counts), counts)
        after = before + 1
        self._starts = (at[:, :-1] - at[:, :1] + (ends - counts)[:, None]).ravel()
        steps = (stamps[after] - stamps[before]) * NANOSECOND
        broken = (steps <= 0.0) | restarts[after]
        steps[broken] = 0.0
        # (n, length): of each interval
        seconds = self._of_intervals(steps)
        samples = np.diff(at, axis=1)
        usual = _median(seconds)
        interrupted = (self._of_intervals(broken.astype(float)) > 0.0) | (seconds > _GAP * usual)
        self._times = _summed(seconds)
        self._broken = _summed(interrupted.astype(float))
        self.step = usual[:, 0] / _median(samples)[:, 0]  # between samples (n,) [s]
        changes = self._of_intervals(np.abs(np.diff(steps, prepend=steps[:1]))) / samples
        self._jitter = 2.0 * _median(changes)[:, 0]
        self._delay = np.maximum(DELAY_IN_SAMPLES * self.step, DELAY)
        rows = motions[at]
        self._rows = rows
        rotations = rows[..., ROTATION].reshape(self._number, -1, 3, 3)
        self._turned = _summed(to_rotation_vector(
            rotations[:, 1:] @ rotations[:, :-1].transpose(0, 1, 3, 2)))
        halves = motions[before, TWIST.start:]
        halves += motions[after, TWIST.start:]
        halves *= 0.5 * steps[:, None]
        self._integrals = _summed(self._of_intervals(halves))

    def first(self, n: int) -> int:
        """Return the first stamp of a period [ns]."""
        return int(self._stamps[self._at[n, 0]])

    def _of_intervals(self, values: Array) -> Array:
        """Return the sums over the samples of each interval, (n, length, ...)."""
        found = (values if len(values) == len(self._starts)
                 else np.add.reduceat(values, self._starts, axis=0))
        return found.reshape(self._number, self._length, *values.shape[1:])

    def _given(self, quantity: str) -> Array:
        """Return a quantity at the knots, (n, length + 1, 3)."""
        values: Array = self._rows[..., _COLUMNS[quantity]]
        return values

    def paths(self, quantity: str, by_poses: Flags | None = None) -> Array:
        """
        Return what a quantity is the derivative of, at the knots, (n, length + 1, 3).

        by_poses (n,): periods in which the twist is not that of the poses: that of the poses.
        """
        if quantity == VELOCITY:
            places: Array = self._rows[..., POSITION]
            return places - places[:, :1]
        if quantity == SPIN:
            return self._turned
        twist = TWIST_OF[quantity]
        found = self._given(twist)
        if by_poses is not None and by_poses.any():
            found = found.copy()
            found[by_poses] = self._slopes(self.paths(twist), by_poses)
        return found

    def _slopes(self, paths: Array, which: Flags) -> Array:
        """Return central differences of paths at the knots; nan at both ends of a period."""
        paths, times = paths[which], self._times[which]
        found = np.full(paths.shape, np.nan)
        found[:, 1:-1] = (paths[:, 2:] - paths[:, :-2]) / (times[:, 2:] - times[:, :-2])[..., None]
        return found

    def windows(self, quantities: Sequence[str], by_poses: Mapping[str, Flags] | None,
                floors: Sequence[tuple[float, float, float]],
                ) -> Generator[None, None, dict[str, _Windows]]:
        """
        Judge windows of the length that has most of those with motion, step by step.

        by_poses: of each twist, the periods in which it is not the derivative of the poses.
        floors: of each quantity, the smallest change, integral and mean value of a window.
        """
        count = len(quantities)
        # One row for each quantity and period: (m, length + 1, 3).
        paths = np.concatenate([self.paths(each, None if by_poses is None else by_poses[
            TWIST_OF[each]]) for each in quantities])
        integrals = np.concatenate([self._integral(each) for each in quantities])
        given = np.concatenate([self._given(each) for each in quantities])
        times, broken = np.tile(self._times, (count, 1)), np.tile(self._broken, (count, 1))
        smallest, smallest_integral, slowest = np.repeat(
            np.array(floors), self._number, axis=0).T[..., None]
        step, jitter, delay = (np.tile(each, count)[:, None] for each in (
            self.step, self._jitter, self._delay))
        third = _norm(np.diff(paths, n=3, axis=1))
        third[(broken[:, 3:] != broken[:, :-3]) | np.isnan(third)] = 0.0
        of_path = 3.0 * np.max(third, axis=1)[:, None] / 4.0  # half the height of a step
        of_given = 3.0 * np.sqrt(np.mean(  # white noise
            np.sum(np.diff(given, n=3, axis=1) ** 2, axis=-1), axis=1) / 20.0)[:, None]
        best, moves, bads, lags = np.zeros((4, len(paths)), dtype=int)
        for lag in _LAGS:
            if 2 * lag > self._length:
                break
            yield
            lasts = times[:, lag:] - times[:, :-lag]
            d, u = paths[:, lag:] - paths[:, :-lag], integrals[:, lag:] - integrals[:, :-lag]
            change, integral = _norm(d), _norm(u)
            size = np.maximum(change, integral)
            uncertain = of_path + of_given * np.sqrt(lasts * step) + jitter * size / lasts
            moving = (broken[:, lag:] == broken[:, :-lag]) & (
                (change >= smallest) | (integral >= smallest_integral)) & (
                size >= slowest * lasts) & (uncertain <= _NOISE_SHARE * size)
            off, tolerance = _without_delay(
                u - d, u, given[:, lag:] - given[:, :-lag], moving, delay)
            bad = moving & (_norm(off) > tolerance * size + uncertain)
            # Reasons are found the better, the smaller the noise is.
            moved = moving.sum(axis=1)
            score = moved + (moving & (10.0 * of_path <= change)).sum(axis=1)
            better = score > best
            best[better], lags[better], moves[better] = score[better], lag, moved[better]
            bads[better] = bad.sum(axis=1)[better]
        enough = moves >= _WINDOWS
        found = np.array([enough, enough & (bads >= SHARE * moves), lags]).reshape(
            3, count, self._number)
        return {each: _Windows(found[0, n] > 0, found[1, n] > 0, found[2, n])
                for n, each in enumerate(quantities)}

    def _integral(self, quantity: str) -> Array:
        columns = _COLUMNS[quantity]
        return self._integrals[..., columns.start - TWIST.start:columns.stop - TWIST.start]

    def add_windows(self, quantity: str, n: int, lag: int, twist_bad: bool, sums: Sums) -> None:
        """Add the windows of a period to the sums from which the reason is found."""
        one = np.arange(self._number) == n
        paths = self.paths(quantity, one if twist_bad else None)[n]
        at = self._at[n]
        rows = self._motions[at[0]:at[-1] + 1]
        steps = np.maximum(np.diff(self._stamps[at[0]:at[-1] + 1]) * NANOSECOND, 0.0)
        given, rotations = rows[:, _COLUMNS[quantity]], rows[:, ROTATION].reshape(-1, 3, 3)
        knots = at - at[0]

        def windows(values: Array) -> Array:
            return values[lag:] - values[:-lag]

        def integral(values: Array) -> Array:
            halves = (values[1:] + values[:-1]) * (0.5 * steps[:, None])
            return windows(np.concatenate([np.zeros((1, 3)), np.cumsum(halves, axis=0)])[knots])

        d, u = windows(paths), windows(self._integral(quantity)[n])
        times = windows(self._times[n])[:, None]
        kept = np.isfinite(d).all(axis=1) & np.isfinite(u).all(axis=1) & (
            windows(self._broken[n]) == 0) & (times[:, 0] > 0.0)
        d, times = d[kept], times[kept]

        def residual(integrated: Array) -> float:
            return _square(d - integrated[kept])

        late = windows(given[knots])[kept]
        candidates = {'body': residual(integral((rotations @ given[..., None])[..., 0]))}
        if quantity == SPIN:
            rates = euler_rate_matrix(to_euler(rotations))
            candidates['euler'] = residual(integral((rates @ given[..., None])[..., 0]))
        if quantity in (ACCELERATION, SPIN_RATE) and twist_bad:
            candidates['same'] = _square(
                windows(self.paths(quantity)[n])[kept] - u[kept])
        u = u[kept]
        off = u - d
        if quantity in (VELOCITY, ACCELERATION):
            arms = rotations[knots]
            if quantity == ACCELERATION:
                arms = _crossed(rows[knots][:, ANGULAR_VELOCITY], arms)
            arms = windows(arms)[kept]
            matrix, right = sums.point
            sums.point = (matrix + np.einsum('nki,nkj->ij', arms, arms),
                          right + np.einsum('nki,nk->i', arms, off))
            total, mean = sums.gravity
            sums.gravity = total + _square(times), mean + np.sum(times * off, axis=0)
        sums.windows += len(d)
        sums.periods += 1
        sums.step += float(self.step[n])
        sums.squares += [_square(d), _square(u), _square(off)]
        sums.rates += [_square(d / times), _square(u / times), _square(off / times)]
        sums.product += float(np.sum(d * u))
        sums.late += [np.sum(late * off), np.sum(late * late)]
        for name, square in candidates.items():
            sums.candidates[name] = sums.candidates.get(name, 0.0) + square


def _summed(values: Array) -> Array:
    """Return the sums up to each knot (n, length + 1, ...) of intervals (n, length, ...)."""
    shape = (values.shape[0], values.shape[1] + 1, *values.shape[2:])
    found = np.zeros(shape)
    np.cumsum(values, axis=1, out=found[:, 1:])
    return found


def _without_delay(
        off: Array, integral: Array, change: Array, moving: Flags, most: Array,
        ) -> tuple[Array, Array]:
    """
    Return the differences of windows without those of a delay, and the relative tolerance.

    Differences of windows that do not count are zero.

    off, integral, change: of windows (m, windows, 3), the difference from the expected value, the
    integral of the given values, and their change.
    moving: windows that count.
    most: largest delay, to either side (m, 1) [s].
    """
    late, differing, given = (
        np.where(moving[..., None], each, 0.0) for each in (change, off, integral))
    squares, product, whole = (np.einsum('nwi,nwi->n', *pair)[:, None] for pair in (
        (late, late), (late, differing), (given, given)))
    delay = np.clip(-product / np.maximum(squares, 1e-300), -most, most)
    # The delay in radians, squared; half of it is the next term of the series.
    phase = delay ** 2 * squares / np.maximum(whole, 1e-300)
    return differing + delay[..., None] * late, TOLERANCE + 0.5 * phase


def _crossed(vectors: Array, matrices: Array) -> Array:
    """Return the cross products of vectors (N, 3) with the columns of matrices (N, 3, 3)."""
    return np.asarray(np.cross(vectors[:, :, None], matrices, axis=1), dtype=np.float64)


def _median(values: NDArray[Any]) -> Array:
    """Return the medians of rows (n, k), (n, 1); numpy's own imports 50 ms of modules first."""
    ordered, middle = np.sort(values, axis=1), values.shape[1] // 2
    found: Array = 0.5 * (ordered[:, middle - 1 + values.shape[1] % 2] + ordered[:, middle])
    return found[:, None]


def _norm(vectors: Array) -> Array:
    found: Array = np.sqrt(np.einsum('...i,...i->...', vectors, vectors))
    return found


def _square(values: Array) -> float:
    return float(np.sum(values * values))
