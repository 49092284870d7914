# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The motion of a vehicle as an IMU at the head measures it: messages, and possible errors."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from functools import partial
import math
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Array, SECOND
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.messages.stamp_order import NO_STAMP
from stewart_dynamics.parameters.table import Parameters, SPECIFIC_FORCE
from stewart_dynamics.possible_errors.hypothesis import (
    find_errors, First, Hypothesis, likeliest, PossibleError, Table, When)
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
_MOST_TURNS = 3.0  # of roll or pitch while gravity stays where it is
_UPRIGHT = 0.7  # cosine of the largest slope on which a vehicle stands
_STEADY = 0.5  # of the mean specific force, in each block along it: gravity is always there
# The turning of the specific force is that of the vehicle where the angular velocity leaves less
# than this share of it; other axes explain more of it by at least this; and ratios of both that
# are the same.
_LEFT, _BETTER, _SAME = 0.2, 0.2, (0.7, 1.4)
_LEAST_TURNING = 0.005  # root mean square of the turning that is looked at [rad/s]
_NEAR = 0.15  # relative difference of units
_UNITS = {'g': 1.0 / 9.80665, 'ft/s^2': 1.0 / 0.3048, 'cm/s^2': 100.0, 'mm/s^2': 1000.0}
_GRAVITY = 9.80665
# Mean specific forces that are more than those of accelerations, in motion and at rest, and more
# than any in m/s^2.
_HALF, _FREE, _LARGEST_FORCE = 5.0, 0.5, 100.0  # [m/s^2]


def find_vehicle_error(times: Array, forces: Array, rates: Array, kind: str) -> str:
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
    found = _error_in(blocks[:_REST_BLOCKS], kind)
    for begin in range(0, max(len(blocks) - _LEAST_BLOCKS, 0) + 1, _LONG_BLOCKS // 2):
        found = found or _error_in(blocks[begin:begin + _LONG_BLOCKS], kind)
    return found


def _too_slow(rate: float) -> str:
    return f'comes at {rate:.2g} Hz: must be at least {_LEAST_RATE:g} Hz, better 60 Hz'


class _Blocks:
    """
    Means over blocks of readings, with the numbers that several hypotheses need.

    blocks (N, 7): mean specific force [m/s^2] and angular velocity, and mean of the largest of the
        three angular velocities [rad/s]. At rest a few will do; in motion accelerations average
        out over some time, gravity does not.
    kind: ``cueing.input``.
    """

    def __init__(self, blocks: Array, kind: str) -> None:
        self.forces, self.rates, fastest = blocks[:, :3], blocks[:, 3:6], blocks[:, 6]
        self.median, self.largest, self.fastest = (
            float(of(fastest)) for of in (np.median, np.max, np.mean))
        self.kind, self.has_gravity = kind, kind == SPECIFIC_FORCE
        mean = self.forces.mean(axis=0)
        self.size, self.height = float(np.linalg.norm(mean)), float(mean[2])
        self.is_still = bool(
            np.abs(self.forces - mean).max() <= _STILL_FORCE * max(self.size, _GRAVITY)
            and np.abs(self.rates).max() <= _STILL_RATE)
        self.is_enough = self.is_still or len(blocks) >= _LEAST_BLOCKS
        self.when = ('at rest' if self.is_still else
                     f'in the mean of {_BLOCK * len(blocks):.0f} s')
        self.text = (f'linear_acceleration is [{", ".join(f"{each:.3g}" for each in mean)}] m/s^2 '
                     f'{self.when}')
        is_steady = bool((self.forces @ mean > _STEADY * self.size ** 2).all())
        self.unit = next((name for name, unit in _UNITS.items() if is_steady and abs(
            self.size / (unit * _GRAVITY) - 1.0) <= _NEAR), '')
        self.unit_or_mm = self.unit or 'mm/s^2'
        axis = int(np.argmax(np.abs(mean)))
        self.along = f'{"-+"[int(mean[axis] > 0.0)]}{"xyz"[axis]}'
        self.up = self.forces / np.maximum(
            np.linalg.norm(self.forces, axis=1, keepdims=True), 1e-9)
        self.turned = np.ptp(np.cumsum(self.rates[:, :2], axis=0) * _BLOCK, axis=0) / (
            2.0 * math.pi)
        self.about = ['roll', 'pitch']

    def turning_errors(self) -> Iterator[PossibleError]:
        """
        Yield an error in the angular velocities by which gravity does not turn.

        In the axes of the vehicle gravity u turns as u' = -w x u. Where the specific force turns
        like that, but for a factor, a sign or the order of axes, these are wrong. Turning about
        gravity is not seen, and nothing is where accelerations turn the specific force more than
        the vehicle.
        """
        change = np.diff(self.up, axis=0) / _BLOCK
        middle, turning = (0.5 * (each[1:] + each[:-1]) for each in (self.up, self.rates))
        if np.sqrt((change ** 2).sum(axis=1).mean()) < _LEAST_TURNING:
            return

        def fit(axes: Sequence[int], signs: Sequence[float]) -> tuple[float, float]:
            """Return the share that rates of other axes do not explain, and their factor."""
            by_rates = np.cross(middle, turning[:, axes] * signs)
            product, square = float((change * by_rates).sum()), float((by_rates ** 2).sum())
            if square < 1e-12:
                return 1.0, 0.0
            return 1.0 - product ** 2 / square / float((change ** 2).sum()), product / square

        left, factor = fit([0, 1, 2], [1.0] * 3)
        if left < _LEFT and _SAME[0] < math.degrees(factor) < _SAME[1]:
            yield PossibleError('unit', f'angular_velocity is {1.0 / factor:.0f} times the '
                                f'turning of gravity: {_DEGREES}')
            return
        # Fewest changes first: where gravity does not turn about an axis, its sign is not known.
        largest = min(_LEFT, (left if factor > 0.0 else 1.0) - _BETTER)
        tried = ((*fit(*each), each) for each in axes_and_signs())
        for _, (axes, signs) in likeliest(
                ((left, each) for left, factor, each in tried if _SAME[0] < factor < _SAME[1]),
                largest, exact=largest)[:1]:
            found = ' '.join(f'{"-" * (sign < 0.0)}{"xyz"[axis]}'
                             for axis, sign in zip(axes, signs, strict=True))
            yield PossibleError('axes', f'angular_velocity: gravity turns as by x y z = {found} '
                                'of it: axes swapped, or of another sign')


_Of = Hypothesis[_Blocks]
_DEGREES = 'in degrees per second?'
_TABLE: Table[_Blocks] = First(
    _Of('unit', lambda b: b.median - _FASTEST,
        f'angular_velocity is {{largest:.3g}} rad/s: {_DEGREES}'),
    When(lambda b: b.is_enough, First(
        _Of('unit', lambda b: b.size - _LARGEST_FORCE, '{text}: in {unit_or_mm}?'),
        When(lambda b: not b.has_gravity, _Of('gravity', lambda b: b.size >= _HALF, (
            f'{{text}}, but cueing.input is {{kind}}: it has gravity in it, set {SPECIFIC_FORCE}'
        ))),
        When(lambda b: b.has_gravity, First(
            _Of('unit', lambda b: len(b.unit), '{text}: in {unit}, must be in m/s^2'),
            _Of('gravity', lambda b: (_FREE if b.is_still else _HALF) - b.size, (
                '{text}, but cueing.input is {kind}: without gravity, set acceleration')),
            _Of('axes', lambda b: _UPRIGHT * b.size - b.height, (
                '{text}: gravity is along {along}, must be along +z: axes swapped, or of another '
                'sign (x forward, y left, z up)')))),
        When(lambda b: not b.is_still, First(
            _Of('unit', lambda b: b.fastest - _FASTEST_MEAN,
                f'angular_velocity is {{fastest:.3g}} rad/s {{when}}: {_DEGREES}'),
            When(lambda b: b.has_gravity, First(
                _Of('unit', lambda b: np.where(
                    (b.up @ b.up.mean(axis=0)).min() > _UPRIGHT, b.turned - _MOST_TURNS, 0.0), (
                    'angular_velocity turns the vehicle by {turned:.0f} turns of {about}, but '
                    f'gravity stays along +z: {_DEGREES}')),
                lambda b: b.turning_errors())))))))


def _error_in(blocks: Array, kind: str) -> str:
    """Return the possible error in blocks (N, 7) of readings, empty without one."""
    return next((each.text for each in find_errors(_TABLE, _Blocks(blocks, kind))), '')


class Vehicle:
    """
    Follows ``~/vehicle``.

    reading (6,): last specific force [m/s^2] and angular velocity [rad/s].
    heard: time of the last one, by the clock of ``use_message`` [s].
    possible_error: the possible error in them.
    """

    def __init__(self, parameters: Parameters, rejections: Rejections, notice: Any) -> None:
        self.reading: Sequence[float] | None = None
        self.heard = -math.inf
        self.possible_error = ''
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
            self.possible_error = _too_slow(self.rate)
            return
        blocks = np.array(self._blocks)
        if len(blocks) < _LEAST_RESTING:
            return
        last = blocks[-_REST_BLOCKS:]
        found = _error_in(last, self.kind)
        if not found and _Blocks(last, self.kind).is_still:
            # At rest and right: readings before are another drive.
            while len(self._blocks) > _REST_BLOCKS:
                self._blocks.popleft()
        elif not found and (len(blocks) >= _LEAST_BLOCKS or not self.possible_error):
            found = _error_in(blocks, self.kind)
        elif not found:
            found = self.possible_error
        self.possible_error = found

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
