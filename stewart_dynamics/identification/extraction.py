# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Extraction of regressor and efforts from a window of recorded legs, filtered and decimated.

Lengths are filtered with a wide band and differentiated, forward kinematics and J_inv give the
motion, and the regressor is computed at the full rate. Then the same narrow low-pass filter
decimates regressor and efforts: f = Y theta holds for the filtered signals as well.
(Gautier, Venture: "Identification of standard dynamic parameters of robots with positive definite
inertia matrix", IROS 2013, doi:10.1109/IROS.2013.6697198, section V.)

Efforts are stored with their first derivatives, so that a delay can be applied to them later.
Extracts are kept in a temporary file, so that memory does not grow with the bags.
"""

from __future__ import annotations

from collections.abc import Iterator
import tempfile
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Integers
from stewart_dynamics.identification.filters import convolved, decimated, LowPass, white_deviation
from stewart_dynamics.identification.kinematics import motions, poses
from stewart_dynamics.identification.unknowns import regression, Unknowns
from stewart_dynamics.identification.windows import Window
from stewart_dynamics.mechanics.drives.measured_efforts import has_losses, without_losses
from stewart_dynamics.mechanics.dynamics.friction import friction
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.mechanics.rows import POSE
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform

# Wide cut-off relative to the narrow one; samples per period of the narrow cut-off.
WIDE, SAMPLES = 2.5, 4.0
# Transition width of both filters, relative to the narrow cut-off.
_TRANSITION = 1.0
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
# Number of samples for which the regressor is computed at once.
_TOGETHER = 4096
# Rates at which Stribeck friction may have fallen to 1/e, relative to the RMS rate of the first
# window that moves, and at least this multiple of the change of the rate between two samples at a
# reversal.
_STRIBECK, _RESOLVED = (0.1, 0.3), 4.0
# A leg moves if its length changes by more than this multiple of its noise.
_MOVES = 10.0
SLIP = 1 + len(_STRIBECK)
"""Number of friction shapes over the rate: Coulomb friction, Stribeck friction."""


class Extract(NamedTuple):
    """Regressor and efforts of the N samples of a window, filtered and at a lower rate."""

    times: Array
    """(N,) since the start of the window, in ``Extracts`` since the start of the bag [s]"""
    columns: Array
    """(N, 6, n + 1 + ORDERS): the regressor of ``Unknowns.theta``, the force of all other
    parameters [N], and the effort with its time derivatives [N, N/s, ...]"""
    used: Flags  # (N, 6) whether an effort is fitted: all samples that contribute to it are valid
    legs: Array  # (N, 6, 3) length, rate and acceleration [m, m/s, m/s^2]
    slip: Array  # (N, 6, SLIP) shapes of friction over the rate
    poses: Array  # (N, POSE) platform poses at the output times, guesses for forward kinematics
    bag: int = 0

    @property
    def regressor(self) -> Array:
        return self.columns[..., :-1 - ORDERS]

    @property
    def known(self) -> Array:
        return self.columns[..., -1 - ORDERS]

    @property
    def efforts(self) -> Array:
        return self.columns[..., -ORDERS:]


class WindowRead(NamedTuple):
    """The extract of a window, with its noise and end."""

    extract: Extract
    deviations: tuple[float, float]
    """Standard deviations of the white noise of lengths [m] and rates [m/s]; nan: no rates."""
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

    def close(self) -> None:
        """Remove the file."""
        self._file.close()


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
        self._size = float(platform.parameters['singularity.characteristic_length'])
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
        deviations = self._deviations(window)
        lengths, rates, accelerations = self._filtered(window, deviations, noise)
        found = poses(self.platform, lengths, guess)
        rows = motions(self.platform, found, rates, accelerations)
        drive_rates = self.platform.drive_rates(rows, rates)
        forces = window.efforts[self._wide.half:-self._wide.half]
        if self._losses:
            forces = without_losses(
                forces, drive_rates, accelerations, self.platform.parameters)
        efforts = np.stack([decimated(forces, self._narrow.taps(order), self.step)
                            for order in range(ORDERS)], axis=-1)
        columns = np.concatenate([self._decimated(rows), efforts], axis=-1)
        wrong, stops = self._wrong(window)
        count = len(columns)
        times = self._period * (self.margin + self.step * np.arange(count)).astype(float)
        moves = self._moves(lengths, rates, deviations[0])
        speeds = self.speeds or self._chosen_speeds(rates, accelerations, moves)
        taps = self._narrow.taps()
        legs = np.stack([decimated(each, taps, self.step)
                         for each in (lengths, rates, accelerations)], axis=-1)
        at = self._narrow.half + self.step * np.arange(count)
        slip = decimated(self._slip(drive_rates, speeds), taps, self.step)
        extract = Extract(times, columns, ~wrong[:count], legs, slip, found.rows[at][:, POSE])
        return WindowRead(extract, deviations, stops, Pose.of_rows(found.rows[-1]), moves,
                          1.0 - _rms(legs[..., 1]) / _rms(rates[at]) if moves else 0.0)

    def lag(self, window: Window, guess: Pose, longest: float) -> tuple[int, float]:
        """
        Return a coarse lag of the efforts behind the positions, or before, and the squared misfit.

        It is the lag in samples with the smallest residual, in steps of a fraction of a cut-off
        period; 0 unless the residual is much smaller than without a lag. The misfit is relative
        to the efforts, whatever the values of the linear parameters.
        """
        extract = self(window, guess).extract
        efforts = convolved(window.efforts[self._wide.half:-self._wide.half], self._narrow.taps())
        steps = max(1, round(_LAG_STEP / (self.cutoff * self._period)))
        most = -(-round(longest / self._period) // steps) * steps
        lags: Integers = np.arange(-most, most + 1, steps)
        at: Integers = self.step * np.arange(len(extract.times))
        used = (at + most < len(efforts)) & (at >= most)
        at = at[used]
        if len(at) < extract.regressor.shape[-1]:
            return 0, 1.0
        sound = extract.used[used].reshape(-1)
        columns = extract.regressor[used].reshape(len(sound), -1)[sound]
        sizes = np.linalg.norm(columns, axis=0)
        basis = np.linalg.qr(columns[:, sizes > 0.0] / sizes[sizes > 0.0])[0]
        misfits = []
        for lag in lags:
            forces = (efforts[at + lag] - extract.known[used]).reshape(-1)[sound]
            squares = float(forces @ forces)
            misfits.append(1.0 - float(np.sum((basis.T @ forces) ** 2)) / squares
                           if squares > 0.0 else 1.0)
        best, none = int(np.argmin(misfits)), len(lags) // 2
        if misfits[best] > _LESS * misfits[none]:
            best = none
        return int(lags[best]), misfits[best]

    @property
    def _band(self) -> float:
        return float(np.mean(self.platform.parameters['actuator.coulomb_velocity']))

    def _moves(self, lengths: Array, rates: Array, deviation: float) -> bool:
        """Return whether legs move by more than noise: else nothing slips."""
        return _rms(rates) > self._band and bool(
            np.ptp(lengths, axis=0).max() > _MOVES * deviation)

    def _chosen_speeds(self, rates: Array, accelerations: Array, moves: bool,
                       ) -> tuple[float, ...]:
        """Return the rates of the friction shapes; later windows have those of one that moves."""
        step = self._period * _rms(accelerations) + self._band
        speeds = tuple(max(part * _rms(rates), _RESOLVED * step) for part in _STRIBECK)
        if moves:
            self.speeds = speeds
        return speeds

    def _slip(self, rates: Array, speeds: tuple[float, ...]) -> Array:
        sign = np.empty(rates.shape)
        friction(np.ascontiguousarray(rates), np.zeros(6), np.ones(6),
                 self.platform.parameters['actuator.coulomb_velocity'], sign)
        return np.stack([sign, *(sign * np.exp(-(rates / speed) ** 2) for speed in speeds)],
                        axis=-1)

    def _deviations(self, window: Window) -> tuple[float, float]:
        of_lengths = float(np.sqrt(np.mean(white_deviation(window.positions) ** 2)))
        if window.rates is None:
            return of_lengths, float('nan')
        # Any deviation of rates from differentiated lengths counts as noise, even a wrong unit.
        smooth = self._wide.taps(1), self._wide.taps()
        off = convolved(window.rates, smooth[1]) - convolved(window.positions, smooth[0])
        in_band = np.sqrt(2.0 * WIDE / SAMPLES / self.step)  # fraction of white noise in the band
        white = float(np.sqrt(np.mean(white_deviation(window.rates) ** 2)))
        return of_lengths, max(white, _rms(off) / max(in_band, 1e-3),
                               _ROUNDING * self._size / self._period)

    def _filtered(self, window: Window, deviations: tuple[float, float],
                  noise: np.random.Generator | None) -> tuple[Array, Array, Array]:
        """Return lengths, rates and accelerations of the legs, without the margin."""
        positions, rates = window.positions, window.rates
        positions = positions + self.platform.parameters['geometry.zero_length']
        if noise is not None:
            positions = positions + deviations[0] * noise.normal(size=positions.shape)
            rates = None if rates is None else (
                rates + deviations[1] * noise.normal(size=rates.shape))
        derivatives, wide = [], self._wide._replace(later=self.later)
        for order in range(3):
            if rates is None:
                derivatives.append(convolved(positions, wide.taps(order)))
                continue
            of_positions, of_rates = wide.fused(
                order, max(deviations[0], _ROUNDING * self._size), deviations[1])
            derivatives.append(convolved(positions, of_positions) + convolved(rates, of_rates))
        return derivatives[0], derivatives[1], derivatives[2]

    def _decimated(self, rows: Array) -> Array:
        """Return the decimated regressor and known forces (N, 6, n + 1) of rows of motion."""
        taps = self._narrow.taps()
        parts = []
        # Each part begins at the input of its first output.
        stride = max(1, _TOGETHER // self.step) * self.step
        last = len(rows) - len(taps)
        for first in range(0, last + 1, stride):
            end = min(first + stride - self.step, (last - first) // self.step * self.step + first)
            regressor, known = regression(
                self.platform, self._unknowns, rows[first:end + len(taps)])
            parts.append(np.concatenate([
                decimated(regressor, taps, self.step),
                decimated(known[..., None], taps, self.step)], axis=-1))
        return np.concatenate(parts)

    def _wrong(self, window: Window) -> tuple[Flags, int]:
        """Return outputs (N, 6) affected by invalid samples, and the count of samples at stops."""
        p = self.platform.parameters
        lengths = window.positions + p['geometry.zero_length']
        stopped = np.zeros(lengths.shape, dtype=bool)
        for name, sign in (('limits.length_min', -1.0), ('limits.length_max', 1.0)):
            if p[name] is not None:
                stopped |= sign * (lengths - p[name]) > -_STOP * self._size
        if p['limits.force_max'] is not None:
            stopped |= np.abs(window.efforts) > _SATURATED * p['limits.force_max']
        bad = (window.outliers | stopped)[self._wide.half:-self._wide.half]
        # Two half waves of the cut-off: samples farther away have little weight in the output.
        reach = min(self._narrow.half, round(1.0 / (self._narrow.cutoff * self._period)))
        sums = np.cumsum(np.concatenate([np.zeros((1, 6)), bad]), axis=0)
        at = self._narrow.half + self.step * np.arange(
            (len(bad) - 2 * self._narrow.half - 1) // self.step + 1)
        wrong: Flags = sums[at + reach + 1] - sums[at - reach] > 0.0
        return wrong, int(np.count_nonzero(stopped.any(axis=1)))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values ** 2)))
