# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The motion of a vehicle as an IMU at the head measures it: messages, and likely mistakes."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
import math
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Array, SECOND
from stewart_dynamics.mechanics.gravity_mistakes import IN_G, IN_MM, likely_mistake
from stewart_dynamics.parameters.table import Parameters, SPECIFIC_FORCE
from stewart_dynamics.setpoints.input_messages import SampleReader, VEHICLE
from stewart_dynamics.setpoints.rejections import jumped_back, Rejections
from stewart_dynamics.setpoints.stamp_order import NO_STAMP, Order, order_of, reason_of

# A vehicle is at rest while no reading is further from their mean [m/s^2 by its size, rad/s].
_STILL_FORCE, _STILL_RATE = 0.03, 0.02
_LEAST_RATE = 10.0  # of messages [Hz]
_WINDOW = 2.0  # [s]
_FASTEST = 20.0  # turns, as degrees would be [rad/s]
_UPRIGHT = 0.7  # cosine of the largest slope on which a vehicle stands
_RESTART = SECOND  # stamps that jump back by more are a restart [ns]


def vehicle_mistake(times: Array, forces: Array, rates: Array, kind: str) -> str:
    """
    Return the likely mistake in the motion of a vehicle, empty without one.

    times (N,) [s], forces (N, 3) [m/s^2] and rates (N, 3) [rad/s]: some seconds of it.
    kind: ``cueing.input``.
    """
    if len(times) < 2:
        return ''
    rate = (len(times) - 1) / (times[-1] - times[0])
    if rate < _LEAST_RATE:
        return f'comes at {rate:.2g} Hz: must be at least {_LEAST_RATE:g} Hz, better 60 Hz'
    if np.median(np.abs(rates).max(axis=1)) > _FASTEST:
        return (f'angular_velocity is {np.abs(rates).max():.3g} rad/s: in degrees per second?')
    mean = forces.mean(axis=0)
    size = float(np.linalg.norm(mean))
    still = (np.abs(forces - mean).max() <= _STILL_FORCE * max(size, 1.0)
             and np.abs(rates).max() <= _STILL_RATE)
    text = f'[{", ".join(f"{each:.3g}" for each in mean)}] m/s^2 at rest'
    if not still:
        return ''
    found = likely_mistake(mean)
    if found == IN_MM:
        return f'linear_acceleration is {text}: in mm/s^2?'
    if kind != SPECIFIC_FORCE:
        return '' if size < 0.5 * 9.8 else (
            f'linear_acceleration is {text}, but cueing.input is {kind}: it has gravity in it, '
            f'set {SPECIFIC_FORCE}')
    if found == IN_G:
        return f'linear_acceleration is {text}: in g, must be in m/s^2'
    if size < 0.5:
        return (f'linear_acceleration is {text}, but cueing.input is {kind}: without gravity, set '
                'acceleration')
    if mean[2] < _UPRIGHT * size:
        axis = int(np.argmax(np.abs(mean)))
        return (f'linear_acceleration is {text}: gravity is along '
                f'{"-+"[int(mean[axis] > 0.0)]}{"xyz"[axis]}, must be along +z: axes swapped, or '
                'of another sign (x forward, y left, z up)')
    return ''


class Vehicle:
    """
    Follows ``~/vehicle``.

    reading (6,): last specific force [m/s^2] and angular velocity [rad/s].
    heard: time of the last one, by the clock of ``take`` [s]. mistake: the likely mistake in them.
    """

    def __init__(self, parameters: Parameters, rejections: Rejections, notice: Any) -> None:
        self.reading: Sequence[float] | None = None
        self.heard = -math.inf
        self.mistake = ''
        self._reader = SampleReader(VEHICLE, None, rejections)
        self._rejections = rejections
        self._notice = notice
        self._stamp: int | None = None
        self._recent: deque[tuple[float, ...]] = deque()
        self.kind = parameters.cueing.input

    def take(self, data: bytes, now: float) -> None:
        """Take a message at a time [s]."""
        read = self._reader.read(data)
        if read is None or not self._in_order(read[0]):
            return
        rates, forces = read[1][:3], read[1][3:]
        if max(map(abs, read[1])) > 1e4:
            self._rejections.reject(VEHICLE, 'out of range', f'{read[1]}: must be at most 1e4')
            return
        self.reading, self.heard = (*forces, *rates), now
        self._recent.append((now, *self.reading))

    @property
    def rate(self) -> float:
        """Return the rate of the messages of the last seconds [Hz]."""
        recent = self._recent
        duration = recent[-1][0] - recent[0][0] if recent else 0.0
        return (len(recent) - 1) / duration if duration > 0.0 else 0.0

    def silent(self, now: float) -> float:
        """Return the time since the last message [s]; infinite without one."""
        # After a jump back of the clock there is no message yet.
        return now - self.heard if now >= self.heard else math.inf

    def check(self, now: float) -> None:
        """Look for a likely mistake in the last seconds; an earlier one lasts until it is gone."""
        while self._recent and not now - _WINDOW <= self._recent[0][0] <= now:
            self._recent.popleft()
        recent = np.array(self._recent)
        # At least two, and most of the window.
        if len(recent) > 1 and recent[-1, 0] - recent[0, 0] > 0.4 * _WINDOW:
            self.mistake = vehicle_mistake(
                recent[:, 0], recent[:, 1:4], recent[:, 4:], self.kind)

    def _in_order(self, stamp: int) -> bool:
        """Return whether a reading is used; without a stamp it is used as it comes."""
        if stamp == NO_STAMP:
            return True
        last, order = self._stamp or 0, order_of(stamp, self._stamp, _RESTART)
        if order is Order.RESTART:
            self._notice(f'vehicle: {jumped_back(last - stamp)}')
        if order.used:
            self._stamp = stamp
        else:
            self._rejections.reject(VEHICLE, *reason_of(order, stamp, last))
        return order.used
