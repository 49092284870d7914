# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Extraction of regressor and efforts from a window of recorded legs, filtered and decimated.

Positions of the drives, which are lengths of telescopic legs, are filtered with a wide band and
differentiated, forward kinematics and their Jacobian give the motion, and the regressor is
computed at the full rate. Then the same narrow low-pass filter decimates regressor and efforts:
f = Y theta holds for the filtered signals as well.
(Gautier, Venture: "Identification of standard dynamic parameters of robots with positive definite
inertia matrix", IROS 2013, doi:10.1109/IROS.2013.6697198, section V.)

Efforts are stored with their first derivatives, so that a delay can be applied to them later.
Extracts are kept in a temporary file, so that memory does not grow with the bags.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import math
import tempfile
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Integers
from stewart_dynamics.identification.filters import (
    convolved, decimated, fast_length, LowPass, white_deviation)
from stewart_dynamics.identification.unknowns import regressor_of, Unknowns
from stewart_dynamics.identification.window_poses import motions, poses
from stewart_dynamics.identification.windows import Window
from stewart_dynamics.mechanics.drives.measured_efforts import FAR, has_losses, without_losses
from stewart_dynamics.mechanics.dynamics.friction import slip_in_noise, stribeck
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.mechanics.rows import POSE
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform

# Wide cut-off relative to the narrow one; samples per period of the narrow cut-off.
WIDE, SAMPLES = 2.5, 4.0
# Widest band of rates for the law of friction, by the rate of the samples.
_WIDEST = 0.42
# Largest variance of fast noise in them, by the square of the rate below which friction is linear.
_WIDTH = 0.3
# Transition width of both filters, relative to the narrow cut-off.
_TRANSITION = 1.0
BAND = 0.9 / SAMPLES
"""Highest frequency that is used, relative to that of the samples."""
ORDERS = 4  # number of columns of an effort: its value and its first ORDERS - 1 derivatives
# Distance from a length limit within which an end stop may be touched, relative to the platform's
# size; fraction of force_max above which an effort may be saturated. A live measurement is judged
# more widely: ``external_wrench.payload``.
_STOP, _SATURATED = 1e-4, 0.999
# Least noise of lengths, relative to the platform's size, and of rates per sample.
_ROUNDING = 1e-12
# Lags are tried in steps of this fraction of a cut-off period; a lag must reduce the squared
# residuals to this fraction.
_LAG_STEP, _LESS = 0.05, 0.8
# Deviation of the efforts in this search, relative to them.
_ROUGHLY = 0.01
# Number of samples for which the regressor is computed at once.
_TOGETHER = 4096
# Rates at which Stribeck friction may have fallen to 1/e, relative to the RMS rate of the first
# window that moves, and at least this multiple of the change of the rate between two samples at a
# reversal.
_STRIBECK, _RESOLVED = (0.1, 0.3), 4.0
# A leg slides if its length changes by more than this multiple of its noise.
_MOVES = 10.0
SLIP = 1 + len(_STRIBECK)
"""Number of friction shapes over the rate: Coulomb friction, Stribeck friction."""


def time_for_filters(cutoff: float) -> float:
    """Return the time at each end that the filters need for a cut-off frequency [s]."""
    fine = 1e-4
    return 2.0 * LowPass.of(fine, cutoff, _TRANSITION * cutoff).half * fine


class Extract(NamedTuple):
    """Regressor and efforts of the N samples of a window, filtered and at a lower rate."""

    times: Array
    """(N,) since the start of the window, in ``Extracts`` since the start of the bag [s]"""
    columns: Array
    """(N, 6, n + ORDERS): the regressor of ``Unknowns.theta``, and the effort with its time
    derivatives [N, N/s, ...], or [N m, ...]"""
    used: Flags  # (N, 6) whether an effort is fitted: all samples that contribute to it are valid
    legs: Array  # (N, 6, 3) position of the drive, rate and acceleration [m, ...] or [rad, ...]
    slip: Array  # (N, 6, SLIP) shapes of friction over the rate
    poses: Array  # (N, POSE) platform poses at the output times, guesses for forward kinematics
    bag: int = 0

    @property
    def step(self) -> float:
        """Time between two samples [s]."""
        return float(self.times[1] - self.times[0]) if len(self.times) > 1 else 1.0

    @property
    def regressor(self) -> Array:
        return self.columns[..., :-ORDERS]

    @property
    def efforts(self) -> Array:
        return self.columns[..., -ORDERS:]


class WindowRead(NamedTuple):
    """The extract of a window, with its noise and end."""

    extract: Extract
    deviations: tuple[float, float]
    """Standard deviations of the white noise of positions and rates; nan: no rates."""
    stops: int  # number of recorded samples at an end stop or a force limit
    end: Pose  # last pose
    moves: bool  # whether legs move by more than noise
    above: float  # share of the RMS rate that is above the cut-off; 0 if nothing moves


class Extracts:
    """Extracts of B bags in the order of addition; can be iterated over repeatedly."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile()
        self._bags: list[int] = []
        self.samples = 0
        self.used: list[Flags] = []  # (N, 6) of each extract; may be changed
        self.moves: list[bool] = []  # of each extract

    def add(self, bag: int, begin: float, read: WindowRead) -> None:
        """Add the extract of a window of a bag that begins at a time [s]."""
        extract = read.extract
        for array in (begin + extract.times, extract.columns, extract.legs, extract.slip,
                      extract.poses):
            np.save(self._file, array)
        self._bags.append(bag)
        self.used.append(extract.used)
        self.moves.append(read.moves)
        self.samples += len(extract.times)

    def __iter__(self) -> Iterator[Extract]:
        """Read the extracts from the file."""
        self._file.seek(0)
        for bag, used in zip(self._bags, self.used, strict=True):
            times, columns, legs, slip, poses = (np.load(self._file) for _ in range(5))
            yield Extract(times, columns, used, legs, slip, poses, bag)

    def __len__(self) -> int:
        """Return the number of extracts."""
        return len(self._bags)

    def clear(self) -> None:
        """Remove all extracts."""
        self._file.seek(0)
        self._bags, self.used, self.moves, self.samples = [], [], [], 0

    def close(self) -> None:
        """Remove the file."""
        self._file.close()


class _Term(NamedTuple):
    """A signal (N, 6), the taps of its filter, and the deviation of its noise."""

    signal: Array
    taps: Array
    deviation: float


class Extraction:
    """
    Computes the extracts of windows with a sampling period [s].

    ``platform`` has the parameters of the file; ``cutoff`` is the frequency of the narrow band
    [Hz]. ``speeds`` are the rates of the friction shapes [m/s], by default those of the first
    window that moves. ``of_motors``: efforts are forces by the torques of the motors, with losses.
    """

    def __init__(self, platform: StewartPlatform, unknowns: Unknowns, period: float,
                 cutoff: float, speeds: tuple[float, ...] | None = None,
                 of_motors: bool = False) -> None:
        self.platform, self._unknowns, self._period = platform, unknowns, period
        self._losses = of_motors and has_losses(platform.parameters)
        self._coulomb_velocity = platform.parameters.actuator.coulomb_velocity
        parameters = platform.parameters
        # Movement of the drives by which a platform joint moves by the size of the platform.
        self._size = float(parameters.singularity.characteristic_length / np.mean(
            parameters.leg_kind.reach(parameters)))
        self._wide = LowPass.of(period, WIDE * cutoff, _TRANSITION * cutoff)
        self._narrow = LowPass.of(period, cutoff, _TRANSITION * cutoff)
        self.cutoff, self.speeds = cutoff, speeds
        self.later = 0.0
        """Time by which the efforts are later than the positions, less than the lag [s]."""
        self.step = max(1, int(1.0 / (SAMPLES * cutoff * period)))
        self.margin = self._wide.half + self._narrow.half
        """Number of samples at each end of a window without an output."""

    def __call__(self, window: Window, guess: Pose, noise: np.random.Generator | None = None,
                 ) -> WindowRead:
        """
        Return the extract of a window that is longer than twice the margin.

        ``guess`` is near the first pose; ``noise`` adds noise to lengths and rates, as large as
        the noise that they contain.
        """
        wrong, stops = self._wrong(window)
        count = fast_length((len(window.positions) - 2 * self.margin - 1) // self.step + 1)
        part = slice(0, 2 * self.margin + (count - 1) * self.step + 1)
        window = window.part(part, part)
        deviations = self._deviations(window)
        lengths, rates, accelerations, quick, variance = self._filtered(
            window, deviations, noise)
        found = poses(self.platform, lengths, guess)
        rows = motions(self.platform, found, rates, accelerations)
        drive_rates = self.platform.drive_rates(rows, rates)
        forces = window.efforts[self._wide.half:-self._wide.half]
        if self._losses:
            forces = without_losses(
                forces, drive_rates, accelerations, self.platform.parameters)
        efforts = np.stack([decimated(forces, self._narrow.taps(order), self.step)
                            for order in range(ORDERS)], axis=-1)
        drive_rates = drive_rates + quick - rates
        squares = self._coulomb_velocity ** 2
        narrower = np.sqrt(squares - 3.0 * np.clip(-variance, 0.0, _WIDTH * squares))
        slides = bool(np.ptp(lengths, axis=0).max() > _MOVES * deviations[0])
        sliding = slides * slip_in_noise(drive_rates, narrower, math.sqrt(max(variance, 0.0)))
        columns = np.concatenate([self._decimated(rows, sliding), efforts], axis=-1)
        times = self._period * (self.margin + self.step * np.arange(count)).astype(float)
        moves = slides and _rms(rates) > float(np.mean(self._coulomb_velocity))
        speeds = self.speeds or self._chosen_speeds(rates, accelerations, moves)
        taps = self._narrow.taps()
        legs = np.stack([decimated(each, taps, self.step)
                         for each in (lengths, rates, accelerations)], axis=-1)
        at = self._narrow.half + self.step * np.arange(count)
        slip = decimated(np.stack([sliding, *(
            stribeck(sliding, drive_rates, speed) for speed in speeds)], axis=-1),
            taps, self.step)
        extract = Extract(times, columns, ~wrong[:count], legs, slip, found.rows[at][:, POSE])
        return WindowRead(extract, deviations, stops, Pose.of_rows(found.rows[-1]), moves,
                          1.0 - _rms(legs[..., 1]) / _rms(rates[at]) if moves else 0.0)

    def lag(self, window: Window, guess: Pose, longest: float, of_any_scale: bool,
            ) -> tuple[int, float, float]:
        """
        Return a coarse lag of the efforts behind the positions, or before, misfit, and scale.

        It is the lag in samples with the smallest misfit, in steps of a fraction of a cut-off
        period; 0 unless the misfit is much smaller than without a lag. The misfit is that of
        efforts and prior, squared and relative to the efforts. The scale is that of the efforts by
        the file. ``of_any_scale``: it is 1 unless efforts divided by it, of another unit or sign,
        fit better.
        """
        extract = self(window, guess).extract
        efforts = convolved(window.efforts[self._wide.half:-self._wide.half], self._narrow.taps())
        steps = max(1, round(_LAG_STEP / (self.cutoff * self._period)))
        most = -(-round(longest / self._period) // steps) * steps
        lags: Integers = np.arange(-most, most + 1, steps)
        at: Integers = self.step * np.arange(len(extract.times))
        inside = (at + most < len(efforts)) & (at >= most)
        at, used = at[inside], self.showing_delay(extract)[inside]
        if not used.any() or not efforts.any():
            return 0, 1.0, 1.0
        u = self._unknowns
        regressor = extract.regressor[inside][used]
        columns = regressor @ u.derivative(u.start) @ u.root
        modelled = regressor @ u.theta(u.start)
        shifted = np.stack([efforts[at + lag][used] for lag in lags])
        none = len(lags) // 2
        by_file = float(shifted[none] @ modelled / (modelled @ modelled + 1e-300))
        is_far = by_file != 0.0 and not 1.0 / FAR < by_file < FAR
        found = []
        for scale in [1.0, by_file] if of_any_scale and is_far else [1.0]:
            deviation = _ROUGHLY * _rms(efforts / scale)
            off = (shifted / scale - modelled) / deviation
            inverse = np.linalg.inv(columns.T @ columns / deviation ** 2 + np.eye(len(u.start)))
            z = off @ columns @ inverse / deviation
            left = off - z @ columns.T / deviation
            misfits = np.sum(left ** 2, axis=1) + np.sum(z ** 2, axis=1)
            best = int(np.argmin(misfits))
            if misfits[best] > _LESS * misfits[none]:
                best = none
            # A sign that only a negative mass could explain may also be the other side.
            of_mass = u.misfit_of_mass(float(z[best, 0])) if of_any_scale else 0.0
            found.append(((float(misfits[best]) + of_mass) * _ROUGHLY ** 2 / len(modelled), best,
                          scale))
        misfit, best, scale = min(found)
        return int(lags[best]), misfit, scale if of_any_scale else by_file

    def showing_delay(self, extract: Extract) -> Flags:
        """
        Return which efforts (N, 6) show a delay: those in motion, if the platform moves at all.

        At rest it may be held, by brakes or a contact.
        """
        moving = np.any(
            np.abs(extract.legs[..., 1]) > self._coulomb_velocity, axis=1, keepdims=True)
        used: Flags = extract.used & (moving | ~moving.any())
        return used

    def _chosen_speeds(self, rates: Array, accelerations: Array, moves: bool,
                       ) -> tuple[float, ...]:
        """Return the rates of the friction shapes; later windows have those of one that moves."""
        step = self._period * _rms(accelerations) + float(np.mean(self._coulomb_velocity))
        speeds = tuple(max(part * _rms(rates), _RESOLVED * step) for part in _STRIBECK)
        if moves:
            self.speeds = speeds
        return speeds

    def _deviations(self, window: Window) -> tuple[float, float]:
        of_lengths = float(np.sqrt(np.mean(white_deviation(window.positions) ** 2)))
        if window.rates is None:
            return of_lengths, float('nan')
        # Any deviation of rates from differentiated lengths counts as noise, even a wrong unit;
        # the noise of these lengths does not.
        of_positions, of_rates = self._wide.taps(1), self._wide.taps()
        off = convolved(window.rates, of_rates) - convolved(window.positions, of_positions)
        square = float(np.mean(off ** 2) - (of_lengths * np.linalg.norm(of_positions)) ** 2)
        white = float(np.sqrt(np.mean(white_deviation(window.rates) ** 2)))
        return of_lengths, max(
            white, math.sqrt(max(square, 0.0)) / float(np.linalg.norm(of_rates)),
            _ROUNDING * self._size / self._period)

    def _filtered(self, window: Window, deviations: tuple[float, float],
                  noise: np.random.Generator | None,
                  ) -> tuple[Array, Array, Array, Array, float]:
        """
        Return lengths, rates and accelerations of the legs, without the margin.

        They are followed by the rates for the law of friction and their variance (``_quick``).
        """
        window = window._replace(
            positions=window.positions + self.platform.parameters.geometry.zero_length)
        fast = window
        if noise is not None:
            white = noise.normal(size=(2, *window.positions.shape))
            count = white.shape[1]
            faster = 1.0 - np.abs(np.fft.rfft(self._narrow.taps(), count))
            of_fast = np.fft.irfft(
                np.fft.rfft(white, axis=1) * faster[:, None], count, axis=1)
            window, fast = (_with_noise(window, deviations, each) for each in (white, of_fast))
        lengths, rates, accelerations = (
            _derivative(self._terms(self._wide, order, window, deviations)) for order in range(3))
        return lengths, rates, accelerations, *self._quick(fast, deviations)

    def _quick(self, window: Window, deviations: tuple[float, float]) -> tuple[Array, float]:
        """
        Return rates of the widest band that noise allows, since friction bends them at reversals.

        They are followed by the variance [(m/s)^2] by which the law of friction is to be wider at
        them than at true rates. Its slope is a box of variance v^2 / 3, v the parameter
        ``actuator.coulomb_velocity``. Noise that is slower than the narrow band makes the mean of
        the law over true rates wider, and is not correlated with the residuals. Faster noise is
        averaged by that band: it makes the law as wide as it is itself.
        """
        narrow = self._narrow.taps()

        def widening(terms: Sequence[_Term]) -> float:
            """Return the variance of slow noise less that of fast noise."""
            return sum(each.deviation ** 2 * float(
                2.0 * np.sum(np.convolve(each.taps, narrow) ** 2) - np.sum(each.taps ** 2))
                for each in terms)

        widest, terms = self._wide, self._terms(self._wide, 1, window, deviations)
        while (band := 2.0 * widest.cutoff) * self._period < _WIDEST:
            wider = LowPass.of(self._period, band, self._narrow.cutoff)
            inner = self._terms(wider, 1, window, deviations)
            if -widening(inner) > _WIDTH * float(np.min(self._coulomb_velocity)) ** 2:
                break
            widest, terms = wider, inner
        quick, margin = _derivative(terms), self._wide.half - widest.half
        return quick[margin:len(quick) - margin], widening(terms)

    def _terms(self, band: LowPass, order: int, window: Window,
               deviations: tuple[float, float]) -> list[_Term]:
        """Return the signals of which a derivative of the lengths in a band is the sum."""
        band = band._replace(later=self.later)
        if window.rates is None:
            return [_Term(window.positions, band.taps(order), deviations[0])]
        of_positions, of_rates = band.fused(
            order, max(deviations[0], _ROUNDING * self._size), deviations[1])
        return [_Term(window.positions, of_positions, deviations[0]),
                _Term(window.rates, of_rates, deviations[1])]

    def _decimated(self, rows: Array, sliding: Array) -> Array:
        """Return the decimated regressor (N, 6, n) of rows of motion; ``sliding``: of the law."""
        taps, legs = self._narrow.taps(), np.arange(6)
        parts = []
        # Each part begins at the input of its first output.
        stride = max(1, _TOGETHER // self.step) * self.step
        last = len(rows) - len(taps)
        for first in range(0, last + 1, stride):
            end = min(first + stride - self.step, (last - first) // self.step * self.step + first)
            part = slice(first, end + len(taps))
            regressor = regressor_of(self.platform, rows[part])
            regressor[:, legs, self._unknowns.columns.coulomb] = sliding[part]
            parts.append(decimated(regressor, taps, self.step))
        return np.concatenate(parts)

    def _wrong(self, window: Window) -> tuple[Flags, int]:
        """Return outputs (N, 6) affected by invalid samples, and the count of samples at stops."""
        p, kind = self.platform.parameters, self.platform.parameters.leg_kind
        positions = window.positions + p.geometry.zero_length
        stopped = np.zeros(positions.shape, dtype=bool)
        for limit, sign in zip(kind.position_limits, (-1.0, 1.0), strict=True):
            if p[limit] is not None:
                stopped |= sign * (positions - p[limit]) > -_STOP * self._size
        if p[kind.effort_limit] is not None:
            stopped |= np.abs(window.efforts) > _SATURATED * p[kind.effort_limit]
        bad = (window.outliers | stopped)[self._wide.half:-self._wide.half]
        # Two half waves of the cut-off: samples farther away have little weight in the output.
        reach = min(self._narrow.half, round(1.0 / (self._narrow.cutoff * self._period)))
        sums = np.cumsum(np.concatenate([np.zeros((1, 6)), bad]), axis=0)
        at = self._narrow.half + self.step * np.arange(
            (len(bad) - 2 * self._narrow.half - 1) // self.step + 1)
        wrong: Flags = sums[at + reach + 1] - sums[at - reach] > 0.0
        return wrong, int(np.count_nonzero(stopped.any(axis=1)))


def _derivative(terms: Sequence[_Term]) -> Array:
    whole: Array = sum((convolved(each.signal, each.taps) for each in terms), np.zeros(()))
    return whole


def _with_noise(window: Window, deviations: tuple[float, float], white: Array) -> Window:
    """Return a window with noise (2, N, 6) of lengths and rates added, by their deviations."""
    of_lengths, of_rates = white * np.reshape(deviations, (2, 1, 1))
    return window._replace(positions=window.positions + of_lengths,
                           rates=None if window.rates is None else window.rates + of_rates)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values ** 2)))
