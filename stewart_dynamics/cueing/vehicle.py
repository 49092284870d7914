# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The motion of a vehicle as an IMU at the head measures it: messages, and possible errors."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from functools import partial
import math
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Array, SECOND
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.messages.stamp_order import NO_STAMP
from stewart_dynamics.parameters.table import Parameters, SPECIFIC_FORCE
from stewart_dynamics.possible_errors.transforms import axes_and_signs
from stewart_dynamics.setpoints.input_messages import SampleReader, VEHICLE
from stewart_dynamics.setpoints.rejections import check_stamp, Rejections

# Readings are judged by means of blocks, in which the noise of a sensor averages out.
_BLOCK = 0.25  # [s]
_WINDOW = 2.0  # of the rate of messages; a longer gap is between two drives [s]
_LEAST_RESTING = 3  # blocks
_REST_BLOCKS, _LONG_BLOCKS, _LEAST_BLOCKS = 8, 120, 40  # 2 s, half a minute, 10 s
# A vehicle is at rest while no mean of a block is further from their mean [m/s^2 by its size,
# rad/s].
_STILL_FORCE, _STILL_RATE = 0.03, 0.02
_LEAST_RATE = 10.0  # of messages [Hz]
_FASTEST = 20.0  # turns, as degrees would be [rad/s]
_FASTEST_MEAN = 4.0  # mean rate of turns of half a minute [rad/s]
_MOST_TURNS = 6.0 * math.pi  # of roll or pitch while gravity stays where it is [rad]
_UPRIGHT = 0.7  # cosine of the largest slope on which a vehicle stands
_STEADY = 0.5  # of the mean specific force, in each block along it: gravity is always there
# The turning of the specific force is that of the vehicle where this share of it is explained by
# the angular velocity; other axes explain more of it by at least this; and ratios of both that
# are the same.
_EXPLAINED, _BETTER, _SAME = 0.8, 0.2, (0.7, 1.4)
_LEAST_TURNING = 0.005  # root mean square of the turning that is looked at [rad/s]
_NEAR = 0.15  # relative difference of units
_UNITS = {'g': 1.0 / 9.80665, 'ft/s^2': 1.0 / 0.3048, 'cm/s^2': 100.0, 'mm/s^2': 1000.0}
_GRAVITY = 9.80665
_HALF = 5.0  # mean specific force that is more than that of accelerations [m/s^2]


def vehicle_mistake(times: Array, forces: Array, rates: Array, kind: str) -> str:
    """
    Return the possible error in the motion of a vehicle, empty without one.

    times (N,) [s], forces (N, 3) [m/s^2] and rates (N, 3) [rad/s]: all of it.
    kind: ``cueing.input``.
    """
    if len(times) < 2:
        return ''
    rate = float((len(times) - 1) / (times[-1] - times[0]))
    if rate < _LEAST_RATE:
        return _too_slow(rate)
    begins = np.flatnonzero(np.diff(np.floor((times - times[0]) / _BLOCK), prepend=-1.0))
    values = np.column_stack([forces, rates, np.abs(rates).max(axis=1)])
    blocks = np.add.reduceat(values, begins, axis=0) / np.diff(
        begins, append=len(times))[:, None]
    found = _mistake_of(blocks[:_REST_BLOCKS], kind)
    for begin in range(0, max(len(blocks) - _LEAST_BLOCKS, 0) + 1, _LONG_BLOCKS // 2):
        found = found or _mistake_of(blocks[begin:begin + _LONG_BLOCKS], kind)
    return found


def _too_slow(rate: float) -> str:
    return f'comes at {rate:.2g} Hz: must be at least {_LEAST_RATE:g} Hz, better 60 Hz'


def _is_still(blocks: Array) -> bool:
    """Return whether a vehicle is at rest in blocks (N, 7), as those of ``_mistake_of``."""
    forces, rates = blocks[:, :3], blocks[:, 3:6]
    mean = forces.mean(axis=0)
    return bool(
        np.abs(forces - mean).max() <= _STILL_FORCE * max(float(np.linalg.norm(mean)), _GRAVITY)
        and np.abs(rates).max() <= _STILL_RATE)


def _mistake_of(blocks: Array, kind: str) -> str:
    """
    Return the possible error in blocks (N, 7) of readings, empty without one.

    blocks: mean specific force [m/s^2] and angular velocity, and mean of the largest of the three
        angular velocities [rad/s]. At rest a few will do; in motion accelerations average out over
        some time, gravity does not.
    """
    fastest = blocks[:, 6]
    if np.median(fastest) > _FASTEST:
        return f'angular_velocity is {fastest.max():.3g} rad/s: in degrees per second?'
    moving = not _is_still(blocks)
    if moving and len(blocks) < _LEAST_BLOCKS:
        return ''
    words = (f'in the mean of {_BLOCK * len(blocks):.0f} s' if moving else 'at rest')
    return (_mistake_of_forces(blocks[:, :3], kind, words)
            or (_mistake_of_rates(blocks, kind, words) if moving else ''))


def _mistake_of_forces(forces: Array, kind: str, words: str) -> str:
    """Return the possible error in mean specific forces (N, 3) of blocks, empty without one."""
    mean = forces.mean(axis=0)
    size = float(np.linalg.norm(mean))
    text = f'linear_acceleration is [{", ".join(f"{each:.3g}" for each in mean)}] m/s^2 {words}'
    steady = size > 0.0 and bool((forces @ mean > _STEADY * size ** 2).all())
    units = [name for name, unit in _UNITS.items()
             if steady and abs(size / (unit * _GRAVITY) - 1.0) <= _NEAR]
    if size > 100.0:
        return f'{text}: in {units[0] if units else "mm/s^2"}?'
    if kind != SPECIFIC_FORCE:
        return '' if size < _HALF else (
            f'{text}, but cueing.input is {kind}: it has gravity in it, set {SPECIFIC_FORCE}')
    if units:
        return f'{text}: in {units[0]}, must be in m/s^2'
    if size < (_HALF if words != 'at rest' else 0.5):
        return f'{text}, but cueing.input is {kind}: without gravity, set acceleration'
    if mean[2] < _UPRIGHT * size:
        axis = int(np.argmax(np.abs(mean)))
        return (f'{text}: gravity is along {"-+"[int(mean[axis] > 0.0)]}{"xyz"[axis]}, must be '
                'along +z: axes swapped, or of another sign (x forward, y left, z up)')
    return ''


def _mistake_of_rates(blocks: Array, kind: str, words: str) -> str:
    """
    Return the possible error in the angular velocities of a motion, empty without one.

    In the axes of the vehicle gravity u turns as u' = -w x u. Where the specific force turns like
    that, but for a factor, a sign or the order of axes, these are wrong. Turning about gravity is
    not seen, and nothing is where accelerations turn the specific force more than the vehicle.
    """
    forces, rates, fastest = blocks[:, :3], blocks[:, 3:6], blocks[:, 6]
    degrees = 'in degrees per second?'
    if fastest.mean() > _FASTEST_MEAN:
        return f'angular_velocity is {fastest.mean():.3g} rad/s {words}: {degrees}'
    if kind != SPECIFIC_FORCE:
        return ''
    sizes = np.linalg.norm(forces, axis=1, keepdims=True)
    up = forces / np.maximum(sizes, 1e-9)
    turns = np.ptp(np.cumsum(rates[:, :2], axis=0) * _BLOCK, axis=0)
    if turns.max() > _MOST_TURNS and (up @ up.mean(axis=0)).min() > _UPRIGHT:
        return (f'angular_velocity turns the vehicle by {turns.max() / (2.0 * math.pi):.0f} turns '
                f'of {("roll", "pitch")[int(np.argmax(turns))]}, but gravity stays along '
                f'+z: {degrees}')
    change = np.diff(up, axis=0) / _BLOCK
    middle, turning = 0.5 * (up[1:] + up[:-1]), 0.5 * (rates[1:] + rates[:-1])
    if np.sqrt((change ** 2).sum(axis=1).mean()) < _LEAST_TURNING:
        return ''

    def fit(axes: Sequence[int], signs: Sequence[float]) -> tuple[float, float]:
        """Return the share that rates of other axes explain, and the factor of these."""
        by_rates = np.cross(middle, turning[:, axes] * signs)
        product, square = float((change * by_rates).sum()), float((by_rates ** 2).sum())
        if square < 1e-12:
            return 0.0, 0.0
        return product ** 2 / square / float((change ** 2).sum()), product / square

    share, factor = fit([0, 1, 2], [1.0] * 3)
    if share > _EXPLAINED and _SAME[0] < math.degrees(factor) < _SAME[1]:
        return f'angular_velocity is {1.0 / factor:.0f} times the turning of gravity: {degrees}'
    share = share if factor > 0.0 else 0.0
    # Fewest changes first: where gravity does not turn about an axis, its sign is not known.
    for axes, signs in axes_and_signs():
        other, factor = fit(axes, signs)
        if other > max(_EXPLAINED, share + _BETTER) and _SAME[0] < factor < _SAME[1]:
            return 'angular_velocity: gravity turns as by x y z = ' + ' '.join(
                f'{"-" * (sign < 0.0)}{"xyz"[axis]}' for axis, sign in zip(
                    axes, signs, strict=True)) + ' of it: axes swapped, or of another sign'
    return ''


class Vehicle:
    """
    Follows ``~/vehicle``.

    reading (6,): last specific force [m/s^2] and angular velocity [rad/s].
    heard: time of the last one, by the clock of ``use_message`` [s].
    mistake: the possible error in them.
    """

    def __init__(self, parameters: Parameters, rejections: Rejections, notice: Any) -> None:
        self.reading: Sequence[float] | None = None
        self.heard = -math.inf
        self.mistake = ''
        self._reader = SampleReader(VEHICLE, None, rejections)
        self._rejections = rejections
        self._notice = notice
        self._stamp: int | None = None
        self._timeout = round(parameters.setpoint.timeout * SECOND)
        self._recent: deque[float] = deque()  # times [s]
        self._blocks: deque[list[float]] = deque(maxlen=_LONG_BLOCKS)
        self._sums: list[float] = [0.0] * 7
        self._begin, self._count = -math.inf, 0  # of the block that is not complete
        self.kind = parameters.cueing.input

    def use_message(self, data: bytes, now: float) -> None:
        """Take a message at a time [s]."""
        samples = self._reader.read_samples(Messages.single(VEHICLE, data))
        if not len(samples.stamps) or not self._in_order(int(samples.stamps[0])):
            return
        values = tuple(samples.values[0].tolist())
        rates, forces = values[:3], values[3:]
        if max(map(abs, values)) > 1e4:
            self._rejections.reject(VEHICLE, 'out of range', f'{values}: must be at most 1e4')
            return
        self.reading, self.heard = (*forces, *rates), now
        self._recent.append(now)
        self._add(now, (*self.reading, max(map(abs, rates))))

    def _add(self, now: float, values: Sequence[float]) -> None:
        """Add a reading, and its largest rate, to the block of its time."""
        if not self._begin <= now < self._begin + _BLOCK:
            if self._count:
                self._blocks.append([each / self._count for each in self._sums])
            if not self._begin <= now < self._begin + _WINDOW:
                self._blocks.clear()  # readings before a gap are those of another drive
            self._begin, self._count, self._sums = now, 0, [0.0] * 7
        self._sums = [a + b for a, b in zip(self._sums, values, strict=True)]
        self._count += 1

    @property
    def rate(self) -> float:
        """Return the rate of the messages of the last seconds [Hz]."""
        recent = self._recent
        duration = recent[-1] - recent[0] if recent else 0.0
        return (len(recent) - 1) / duration if duration > 0.0 else 0.0

    def silent(self, now: float) -> float:
        """Return the time since the last message [s]; infinite without one."""
        # After a jump back of the clock there is no message yet.
        return now - self.heard if now >= self.heard else math.inf

    def check(self, now: float) -> None:
        """Look for a possible error in the last half minute; one lasts until it is gone."""
        recent = self._recent
        while recent and not now - _WINDOW <= recent[0] <= now:
            recent.popleft()
        # At least two, and most of the window.
        if len(recent) < 2 or recent[-1] - recent[0] < 0.4 * _WINDOW:
            return
        if self.rate < _LEAST_RATE:
            self.mistake = _too_slow(self.rate)
            return
        blocks = np.array(self._blocks)
        if len(blocks) < _LEAST_RESTING:
            return
        last = blocks[-_REST_BLOCKS:]
        found = _mistake_of(last, self.kind)
        if not found and _is_still(last):
            # At rest and right: readings before are another drive.
            while len(self._blocks) > _REST_BLOCKS:
                self._blocks.popleft()
        elif not found and (len(blocks) >= _LEAST_BLOCKS or not self.mistake):
            found = _mistake_of(blocks, self.kind)
        elif not found:
            found = self.mistake
        self.mistake = found

    def _in_order(self, stamp: int) -> bool:
        """Return whether a reading is used; without a stamp it is used as it comes."""
        if stamp == NO_STAMP:
            return True
        used = check_stamp(
            stamp, self._stamp, self._timeout, partial(self._rejections.reject, VEHICLE),
            lambda text: self._notice(f'vehicle: {text}'))
        if used:
            self._stamp = stamp
        return used
