# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Contradictions within a motion: the quantity, the size of the difference, the likeliest reason.

Each reason is a hypothesis with a residual, computed from sums over windows; the likeliest is the
one under which the difference vanishes.
"""

from __future__ import annotations

from collections.abc import Iterator
import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.frames.motion import listed
from stewart_dynamics.parameters.table import STANDARD_GRAVITY
from stewart_dynamics.possible_errors.hypothesis import likeliest
from stewart_dynamics.possible_errors.transforms import name_of_factor

VELOCITY, SPIN, ACCELERATION, SPIN_RATE = (
    'velocity', 'angular velocity', 'acceleration', 'angular acceleration')
QUANTITIES = VELOCITY, SPIN, ACCELERATION, SPIN_RATE
TWISTS, RATES = (VELOCITY, SPIN), (ACCELERATION, SPIN_RATE)
POSES, TWISTS_GIVEN = 'the poses', 'the twists'
TWIST_OF = {ACCELERATION: VELOCITY, SPIN_RATE: SPIN}
UNITS = {VELOCITY: 'm/s', SPIN: 'rad/s', ACCELERATION: 'm/s^2', SPIN_RATE: 'rad/s^2'}

# A reason explains a difference if its residual is at most this part of it (both squared); of
# those whose residuals are alike, or below _EXACT, the simplest is named.
_EXPLAINED, _CLEAR, _EXACT = 0.05, 0.3, 1e-4
# Relative difference of a factor from a known one.
_NEAR = 0.03
_FACTORS = {
    VELOCITY: {1e3: 'in mm/s?', 100.0: 'in cm/s?', 1e-3: 'in m/ms?', -1.0: 'a sign?'},
    SPIN: {180.0 / math.pi: 'in deg/s?', math.pi / 180.0: 'converted to radians twice?',
           30.0 / math.pi: 'in rpm?', 0.5 / math.pi: 'in turns per second?', 1e3: 'in mrad/s?',
           1e-3: 'in rad/ms?', -1.0: 'a sign?'},
    ACCELERATION: {1e3: 'in mm/s^2?', 100.0: 'in cm/s^2?', 1e-6: 'in m/ms^2?', -1.0: 'a sign?',
                   1.0 / -STANDARD_GRAVITY[2]: 'in g?'},
    SPIN_RATE: {180.0 / math.pi: 'in deg/s^2?', math.pi / 180.0: 'converted to radians twice?',
                1e3: 'in mrad/s^2?', 1e-6: 'in rad/ms^2?', -1.0: 'a sign?'},
}


class Inconsistency(NamedTuple):
    """A quantity that is not the derivative of the other one."""

    quantity: str  # one of QUANTITIES
    given: float  # RMS of the given values, mean values of windows [m/s, rad/s, ...]
    expected: float  # RMS of the differences of the poses, or of the twists
    difference: float  # RMS
    reason: str  # likeliest reason, with a question mark; empty if it is not known
    first: int  # stamp of the beginning [ns]
    of: str  # the quantity whose derivative was expected

    @property
    def words(self) -> str:
        """Return the difference and the reason in one line."""
        of, derivative = self.of, 'derivative'
        if self.quantity in RATES and of == POSES:  # the twists are wrong, too
            derivative = 'second derivative'
        unit = UNITS[self.quantity]
        reason = f': possible error: {self.reason}' if self.reason else ''
        return (f'{self.quantity} is not the {derivative} of {of}: {self.given:.3g} {unit} RMS, '
                f'by differences of {of} {self.expected:.3g} {unit}, they differ by '
                f'{self.difference:.3g} {unit}{reason}')

    @property
    def values(self) -> tuple[tuple[str, str], ...]:
        """Return keys with their units, and values."""
        unit = UNITS[self.quantity]
        return ((f'{self.quantity} given, RMS ({unit})', f'{self.given:.6g}'),
                (f'{self.quantity} by differences, RMS ({unit})', f'{self.expected:.6g}'),
                (f'possible error in {self.quantity}', self.reason or 'not known'))


class Sums:
    """Sums over the windows of inconsistent periods of one quantity."""

    def __init__(self, first: int) -> None:
        self.first = first
        self.periods = 0
        self.windows = 0
        self.squares = np.zeros(3)  # of changes d, of integrals u, of their difference
        self.rates = np.zeros(3)  # the same divided by the times of the windows
        self.product = 0.0  # d u
        self.candidates: dict[str, float] = {}  # squares of the residual of each
        self.late = np.zeros(2)  # normal equation of a delay
        self.point = np.zeros((3, 3)), np.zeros(3)  # that of another point
        self.gravity = 0.0, np.zeros(3)  # that of a constant acceleration
        self.step = 0.0  # seconds between two samples, the sum over periods


def reason_of(quantity: str, sums: Sums, frame: tuple[str, str] | None) -> str:
    """
    Return the likeliest reason, with a question mark; empty if it is not clear.

    frame: names of the axes, see ``Consistency``; None: no reason is one of axes or points.
    """
    dd, uu, difference = sums.squares.tolist()
    if uu <= 1e-14 * dd:
        return 'it is zero, never filled?'
    found: list[tuple[float, str]] = []  # remaining part of the difference, and the reason
    similar = sums.product * sums.product / (dd * uu) if dd > 0.0 else 0.0
    if similar > 0.0:
        # Noise is in the differences of poses, rather than in the integral.
        found.append((1.0 - similar, _factor_words(
            quantity, uu / sums.product, sums.step / sums.periods)))
    product, square = sums.late.tolist()
    if square > 0.0:
        late = -product / square
        found.append((1.0 - product * product / square / difference,
                      f'{abs(late) * 1e3:.3g} ms {"late" if late > 0.0 else "early"}?'))
    if frame is not None:
        found += _of_axes(quantity, sums, *frame)
    return next((words for _, words in likeliest(found, _EXPLAINED, 1.0 / _CLEAR, _EXACT)), '')


def _of_axes(quantity: str, sums: Sums, axes: str, body: str) -> Iterator[tuple[float, str]]:
    """Yield reasons of axes, points and gravity, see ``reason_of``."""
    difference = float(sums.squares[2])
    of = TWIST_OF.get(quantity, '')
    names = {'body': f'in {body} axes? It is expected in {axes} axes',
             'euler': 'rates of Euler angles? An angular velocity is expected',
             'same': f'the derivative of the given {of}, which is wrong?'}
    for name, square in sums.candidates.items():
        yield square / difference, names[name]
    if quantity in (VELOCITY, ACCELERATION):
        matrix, right = sums.point
        place: Array = np.asarray(
            np.linalg.lstsq(matrix, right, rcond=1e-6)[0].round(6), dtype=np.float64)
        yield (1.0 - float(right @ place) / difference,
               f'of another point, {listed(place, 3)} m in the {body} frame?')
    if quantity == ACCELERATION:
        total, mean = sums.gravity
        constant = mean / total if total > 0.0 else np.zeros(3)
        if abs(float(np.linalg.norm(constant)) / -STANDARD_GRAVITY[2] - 1.0) < 0.1:
            yield (1.0 - float(mean @ constant) / difference,
                   f'gravity is in it, {listed(constant.round(2), 3)} m/s^2?')


def _factor_words(quantity: str, factor: float, step: float) -> str:
    """Return a constant factor in words, with the error that has it."""
    words = name_of_factor(factor, _FACTORS[quantity].items(), 1.0 + _NEAR)
    if abs(factor / step - 1.0) < _NEAR:
        words = 'differences not divided by the time between two samples?'
    rounded = float(f'{factor:.3g}')
    return f'{rounded:g} times: {words}' if words else f'{rounded:g} times what is expected'
