# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The measures of one frequency response: gain, phase, bandwidths, delay, a drive of second order.

They are those that flight simulators are qualified by (AGARD-AR-144, Dynamic characteristics of
flight simulator motion systems, 1979; 14 CFR Part 60, appendix A, attachment 2).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.response.frequency_response import Complex
from stewart_dynamics.response.response_record import LegResponse, SecondOrder

# Coherence from which on a frequency counts for the measures.
COHERENT = 0.5
# A gain that is larger than this many radii of its band is not one of noise.
CERTAIN = 2.0
_HALF_POWER = np.sqrt(0.5)
# Largest power of the frequency in the phase, of odd powers; the first gives the delay.
_POWERS = (1, 3, 5)
# Smallest standard deviation of a phase [rad]: of rounding errors, and of drives that are not
# linear.
_PHASE_FLOOR = 1e-6
# Largest RMS difference of the responses, relative, up to which a drive is of second order.
_LACK_OF_FIT = 0.03
# A drive of second order is fitted up to this multiple of the frequency of -90 degrees.
_FITTED = 3.0


class Response(NamedTuple):
    """The response of one output to one input, at the frequencies where the input has power."""

    frequency: Array  # (F,) [Hz], increasing
    value: Complex  # (F,)
    radius: Array  # (F,): of the confidence circle around each value
    coherence: Array  # (F,)

    @property
    def coherent(self) -> Flags:
        """Return the frequencies (F,) that count for the measures."""
        found: Flags = (self.coherence >= COHERENT) & (
            np.abs(self.value) > CERTAIN * self.radius)
        return found

    @property
    def phase(self) -> Array:
        """Return the (F,) phases [rad] without jumps by whole turns, from the lowest one on."""
        phase: Array = np.angle(self.value).astype(np.float64)
        sure = np.flatnonzero(self.coherent)
        if not len(sure):
            return phase
        phase[sure] = np.unwrap(phase[sure])
        near = np.interp(self.frequency, self.frequency[sure], phase[sure])
        turns: Array = phase + 2.0 * np.pi * np.round((near - phase) / (2.0 * np.pi))
        return turns

    def measures(self) -> LegResponse:
        """Return arrays and measures."""
        gain, phase = np.abs(self.value), np.degrees(self.phase)
        with np.errstate(divide='ignore', invalid='ignore'):
            angle = np.degrees(np.arcsin(np.minimum(self.radius / gain, 1.0)))
        angle = np.where(self.radius < gain, angle, 180.0)  # any phase
        bands = (np.maximum(gain - self.radius, 0.0), gain + self.radius,
                 phase - angle, phase + angle)
        model = self.second_order()
        return LegResponse(
            self.frequency.tolist(), self.opposite, gain.tolist(), phase.tolist(),
            self.coherence.tolist(), bands[0].tolist(), bands[1].tolist(), bands[2].tolist(),
            bands[3].tolist(), delay=_slow_delay(model) if model else self.delay(),
            bandwidth_3db=self.bandwidth_3db, bandwidth_90deg=self.bandwidth_90deg,
            bandwidth_3db_bounds=self._bounds(*(_above_half_power(each) for each in bands[:2])),
            bandwidth_90deg_bounds=self._bounds(*(each + 90.0 for each in bands[2:])),
            second_order=model)

    @property
    def bandwidth_3db(self) -> float | None:
        """Return the lowest frequency at which the gain falls below 1/sqrt(2) [Hz]."""
        return self._crossing(self._above_3db)

    @property
    def bandwidth_90deg(self) -> float | None:
        """Return the lowest frequency at which the phase falls below -90 degrees [Hz]."""
        return self._crossing(self._above_90deg)

    @property
    def _above_3db(self) -> Array:
        return _above_half_power(np.abs(self.value))

    @property
    def _above_90deg(self) -> Array:
        return self.phase + np.pi / 2.0

    def _crossing(self, above: Array) -> float | None:
        """Return where a quantity falls below zero, on the spline over log frequency."""
        f, above = self.frequency[self.coherent], above[self.coherent]
        falls = np.flatnonzero((above[:-1] >= 0.0) & (above[1:] < 0.0))
        if not len(falls) or above[0] < 0.0:
            return None
        from scipy.interpolate import CubicSpline

        n = int(falls[0])
        spline = CubicSpline(np.log(f), above)
        at = [each for each in spline.roots(extrapolate=False)
              if np.log(f[n]) <= each <= np.log(f[n + 1])]
        return float(np.exp(at[0])) if at else float(f[n])

    def _bounds(self, low: Array, high: Array) -> tuple[float | None, float | None]:
        """Return the bounds of a crossing from those of its quantity; None: unbounded."""
        f = self.frequency[self.coherent]
        if not len(f):
            return None, None
        first, last = float(f[0]), float(f[-1])
        lowest = None if low[self.coherent][0] < 0.0 else self._crossing(low) or last
        highest = first if high[self.coherent][0] < 0.0 else self._crossing(high)
        return lowest, highest

    def half_bandwidth(self) -> float:
        """
        Return half the lower bandwidth; without one the highest frequency [Hz].

        Zero if a bandwidth is below the lowest frequency.
        """
        first = self.coherent.argmax()
        if self.coherent.any() and min(self._above_3db[first], self._above_90deg[first]) < 0.0:
            return 0.0
        bandwidths = [each for each in (self.bandwidth_3db, self.bandwidth_90deg) if each]
        return 0.5 * min(bandwidths) if bandwidths else float(self.frequency.max(initial=0.0))

    @property
    def opposite(self) -> bool:
        """Return whether slow motion has the opposite sign."""
        lowest = self.value[self.coherent][:1]
        return bool(lowest.size and lowest[0].real < 0.0 and abs(lowest[0].imag) < -lowest[0].real)

    def delay(self) -> float | None:
        """
        Return by how much slow motion is late [s]: -d phase / d omega at zero.

        The phase up to half the bandwidth, as an odd polynomial of the frequency. None if slow
        motion has the opposite sign, or all frequencies are above half the bandwidth.
        """
        used = self.coherent & (self.frequency <= self.half_bandwidth())
        count = int(np.count_nonzero(used))
        if not count or self.opposite:
            return None
        omega, phase = 2.0 * np.pi * self.frequency[used], self.phase[used]
        sigma = np.maximum(self.radius[used] / np.abs(self.value[used]), _PHASE_FLOOR)
        powers = _POWERS[:max(1, min(len(_POWERS), count // 2))]
        scale = omega.max()
        columns = np.column_stack([(omega / scale) ** power for power in powers])
        weights = 1.0 / sigma
        solution = np.linalg.lstsq(columns * weights[:, None], phase * weights, rcond=None)[0]
        return float(-solution[0] / scale)

    def second_order(self) -> SecondOrder | None:
        """
        Return gain, delay, natural frequency and damping of the drive of second order, if it fits.

        g exp(-s delay) w^2 / (s^2 + 2 damping w s + w^2); None where it does not fit.
        """
        limit, late = self.bandwidth_90deg, self.delay()
        if limit is None or late is None:
            return None
        used = self.coherent & (self.frequency <= _FITTED * limit)
        f = self.frequency[used]
        if np.count_nonzero(f > limit) < 2 or len(f) < 6:
            return None
        from scipy.optimize import least_squares

        s, value, radius = 2j * np.pi * f, self.value[used], self.radius[used]
        weights = 1.0 / np.maximum(radius, 1e-3 * np.abs(value))

        def model(x: Array) -> Complex:
            gain, delay, log_omega, damping = x
            w = np.exp(log_omega)
            found: Complex = gain * np.exp(-s * delay) * w * w / (
                s * s + 2.0 * damping * w * s + w * w)
            return found

        def differences(x: Array) -> Array:
            off = (model(x) - value) * weights
            return np.concatenate([off.real, off.imag])

        start = (float(np.abs(value[0])), 0.25 * late, np.log(2.0 * np.pi * limit), 0.7)
        fit = least_squares(differences, start, x_scale=(0.1, 0.01, 0.1, 0.1))
        gain, delay, log_omega, damping = fit.x.tolist()
        off = np.mean(np.abs(model(fit.x) / value - 1.0) ** 2)
        most = _LACK_OF_FIT ** 2 + np.mean(np.abs(radius / value) ** 2)
        if not (fit.success and off <= most and damping > 0.0):
            return None
        return SecondOrder(gain, delay, damping, float(np.exp(log_omega) / (2.0 * np.pi)))


def _slow_delay(model: SecondOrder) -> float:
    """Return by how much slow motion is late behind a drive of second order [s]."""
    return model.delay + model.damping / (np.pi * model.natural_frequency)


def _above_half_power(gain: Array) -> Array:
    """Return by how much a gain is above 1/sqrt(2), logarithmic."""
    with np.errstate(divide='ignore'):
        above: Array = np.log(gain / _HALF_POWER)
    return above.clip(-100.0)


def bandwidths(measures: LegResponse) -> dict[str, str]:
    """Return in words where each bandwidth is, or on which side of the frequencies."""
    return {'-3 dB': _where(measures.bandwidth_3db, *measures.bandwidth_3db_bounds),
            '-90 deg': _where(measures.bandwidth_90deg, *measures.bandwidth_90deg_bounds)}


def _where(at: float | None, low: float | None, high: float | None) -> str:
    if at is not None:
        return f'at {at:.3g} Hz'
    if low is None:
        return 'not certain' if high is None else f'below {high:.3g} Hz'
    return f'above {low:.3g} Hz'
