# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Calibration of cranks: ``|B - A(q)| = L2`` with ``A = c + L1 e(q)``, q the measured angle.

A leg has 11 numbers: c, platform joint, L1, L2, and three small turns of the crank: about the axis
of the motor (the zero of q), and of that axis about the crank at the angle 0 and across it. With
the turn t of the axis as a rotation vector, and the zero z,
``e = exp(skew(t)) (z_0 cos(q + z) + n_0 sin(q + z))``.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain
import math
from typing import Any, NamedTuple, TYPE_CHECKING

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.legs.calibrated import (
    AXES, BASE_JOINTS, Calibrated, CalibratedLegs, CalibratedLines, ComparedPositions, LENGTHS,
    PLATFORM_JOINTS, ZERO, ZeroStep)
from stewart_dynamics.legs.lines import dot, skew
from stewart_dynamics.possible_errors.hypothesis import (
    find_errors, Hypothesis, PossibleError)

if TYPE_CHECKING:
    from stewart_dynamics.parameters.table import Parameters

HEADINGS, CRANK_AXES, DIRECTIONS, BRANCH = (
    'geometry.crank_angles', 'geometry.crank_axes', 'geometry.crank_directions',
    'geometry.crank_branch')
CRANK_LENGTH, ROD_LENGTH = 'legs.crank.length', 'legs.rod.length'
SERVO_POINTS = 'servo.angle_at_min', 'servo.angle_at_max'
TURN = Calibrated(DIRECTIONS, 'zeros', 'rad', ZERO, ('about_axis',))
TILTS = Calibrated(CRANK_AXES, 'axes of motors', 'rad', AXES, ('about_crank', 'across_crank'))
CRANKS = Calibrated(CRANK_LENGTH, 'lengths of cranks', 'm', LENGTHS)
RODS = Calibrated(ROD_LENGTH, 'lengths of rods', 'm', LENGTHS)

TEETH = 25, 24, 23, 21
"""Numbers of teeth of the splines of hobby servos."""
# Change of a length that would matter, by the length of the crank, and of an angle [rad].
_SCALE = 0.4
# Zeros that are farther from the file's are looked for from where they are: half a tooth is 0.13.
_FAR = 0.1  # [rad]
# The other branch is taken where it leaves a smaller part of the scatter.
_BETTER = 0.5
# Lengths that change by a larger part are of other cranks.
_FARTHEST = 0.3


def _steps() -> tuple[ZeroStep, ...]:
    """Return teeth, and half a turn."""
    found = [ZeroStep(number * 2.0 * math.pi / teeth, words, (
        f'{360.0 * number / teeth:.4g} deg of {teeth}')) for number, words in (
            (1, 'one tooth'), (2, 'two teeth'), (3, 'three teeth')) for teeth in TEETH]
    return (*found, ZeroStep(0.5 * math.pi, 'a quarter turn', '90 deg', False),
            ZeroStep(math.pi, 'half a turn', '180 deg', False))


class CrankCalibration(CalibratedLegs):
    """
    Cranks with other numbers.

    axes, directions (6, 3): of the motors, and of the cranks at the angle 0, unit vectors of the
        file. across (6, 3): completes them. branches (6,): signs of the levers. middles (6,):
        of the allowed angles [rad].
    """

    own = TURN, TILTS, CRANKS, RODS
    units = {'degrees': math.pi / 180.0}
    unit_option = '--degrees'
    zero_part = 'crank'
    zero_steps = _steps()
    signs = True
    scale_words = 'travel of the servo by its pulses, gear or encoder'
    scale_cause = 'the travel of the servo by its pulses, the gear or the encoder'
    scale_short = 'servo or gear'
    force_words = 'static torques of the motors'
    line = 'length of a rod by geometry, measured pose and angle, less its length'

    def __init__(self, parameters: Parameters) -> None:
        super().__init__(parameters)
        legs: Any = parameters.structure['legs']
        self.axes, self.directions = legs['crank_axis'].copy(), legs['crank_direction'].copy()
        self.across = np.asarray(np.cross(self.axes, self.directions), dtype=float)
        self.branches = legs['branch'].copy()
        low, high = parameters.limits.angle_min, parameters.limits.angle_max
        self.middles = np.zeros(6) if low is None or high is None else 0.5 * (low + high)
        self.joint_scale = _SCALE * float(np.mean(
            parameters[CRANK_LENGTH])) / parameters.singularity.characteristic_length

    def own_values(self) -> Array:
        """Return turns of zero, and the lengths of cranks and rods."""
        p = self.parameters
        return np.concatenate([np.zeros(18), *(
            np.broadcast_to(p[name], 6) for name in (CRANK_LENGTH, ROD_LENGTH))])

    def scales(self, size: float) -> Array:
        """Return parts of the mean length of the cranks, and of a radian."""
        return np.array([self.joint_scale * size if unit == 'm' else _SCALE
                         for unit in self.units_of()])

    def lines(self, values: Array, vectors: Array, positions: Array) -> CalibratedLines:
        """Return the rods."""
        zeros, tilts, sizes, _ = self.own_of_legs(values)
        angles = (positions + zeros[:, 0])[..., None]
        along = self.directions * np.cos(angles) + self.across * np.sin(angles)
        normal = self.across * np.cos(angles) - self.directions * np.sin(angles)
        turns = tilts[:, :1] * self.directions + tilts[:, 1:] * self.across
        rotations, rates = _rotations(turns)
        along, normal = ((rotations @ each[..., None])[..., 0] for each in (along, normal))
        rods = vectors - sizes * along
        lengths = np.linalg.norm(rods, axis=-1)
        d = rods / lengths[..., None]
        levers = -(sizes * dot(d, normal))[..., 0]
        # A turn r of the crank moves its end by r x e: d . (r x e) = r . (e x d).
        moments = -sizes * np.cross(along, d)
        of_tilts = [dot(moments, (rates @ each[..., None])[..., 0])
                    for each in (self.directions, self.across)]
        own = np.concatenate([levers[..., None], *of_tilts, -dot(along, d),
                              np.full((*lengths.shape, 1), -1.0)], axis=-1)
        return CalibratedLines(lengths, d, levers, own)

    def misses(self, lengths: Array, values: Array, positions: Array) -> Array:
        """Return lengths less those of the rods."""
        return np.asarray(lengths - values[self.parts[ROD_LENGTH]])

    def angles_at(self, vectors: Array) -> Array:
        """
        Return the angles of the file at poses (2, N, 6), nan where a rod does not reach.

        First those of the branches of the file, then the others.
        """
        p = self.parameters
        size, rod = p[CRANK_LENGTH], p[ROD_LENGTH]
        x, y = (dot(vectors, each)[..., 0] for each in (self.directions, self.across))
        g = (np.sum(vectors ** 2, axis=-1) + size ** 2 - rod ** 2) / (2.0 * size)
        with np.errstate(invalid='ignore'):
            h = self.branches * np.sqrt(x * x + y * y - g * g)
        return np.stack([np.arctan2(y * g - x * each, x * g + y * each) for each in (h, -h)])

    def _offsets(self, vectors: Array, positions: Array) -> tuple[Array, Array, Array]:
        """
        Return angles of the file, and these less measured ones: about their middles, and these.

        Each leg has the branch that leaves less scatter. Shapes (N, 6), (N, 6), (6,); nan where
        a rod does not reach.
        """
        both = self.angles_at(vectors)
        off = both - positions
        middles = np.angle(np.nansum(np.exp(1j * off), axis=1))
        around = _near(off - middles[:, None])
        reached = np.isfinite(around)
        scatter = np.sqrt(np.where(reached, around, math.pi) ** 2).mean(axis=1)
        other = (scatter[0] > _FAR) & (scatter[1] < _BETTER * scatter[0])
        return (np.where(other, both[1], both[0]), np.where(other, around[1], around[0]),
                np.where(other, middles[1], middles[0]))

    def compared(self, vectors: Array, residuals: Array, positions: Array) -> ComparedPositions:
        """Return differences of angles from their middle, and the angles of the file."""
        del residuals
        angles, around, _ = self._offsets(vectors, positions)
        # Rods that do not reach say that something is wrong, by any angle.
        anywhere = np.linspace(-math.pi, math.pi, len(around))[:, None]
        moved = _near(angles - np.angle(np.nansum(np.exp(1j * angles), axis=0)))
        errors, moved = (np.where(np.isfinite(each), each, anywhere) for each in (around, moved))
        return ComparedPositions(errors, (moved,))

    def zero_guesses(self, vectors: Array, positions: Array) -> Array:
        """Return the median differences of angles, where they are large."""
        _, around, middles = self._offsets(vectors, positions)
        reached = np.isfinite(around).any(axis=0)
        off = _near(middles + np.nanmedian(np.where(reached, around, 0.0), axis=0))
        guess: Array = np.where(reached & (np.abs(off) > _FAR), off, 0.0)
        return guess

    def drive_positions(self, positions: Array) -> Array:
        """Return the angles as they are."""
        return positions

    def measured_positions(self, positions: Array) -> Array:
        """Return the angles as they are."""
        return positions

    def changes(self, values: Array, held: Flags, written: bool) -> dict[str, Any]:
        """
        Return the parameters of the numbers that were calibrated.

        Measured angles keep their meaning if the direction at the angle zero turns with the zero.
        In a file with two points of each servo, which were measured, their angles are what was
        wrong: the cranks of the drawing, their limits and home stay, and pulses are right.
        """
        p = self.parameters
        zeros, tilts, sizes, rods = self.own_of_legs(values)
        free = {name: not held[part].all() for name, part in self.parts.items()}
        found: dict[str, Any] = {
            each.name: values[self.parts[each.name]].tolist()
            for each in (BASE_JOINTS, PLATFORM_JOINTS) if free[each.name]}
        for name, lengths in ((CRANK_LENGTH, sizes), (ROD_LENGTH, rods)):
            if free[name]:
                found[name] = lengths[:, 0].tolist()
        turned = zeros
        if written and self._has_servos and free[DIRECTIONS]:
            turned = np.zeros((6, 1))
            for name in SERVO_POINTS:
                found[name] = (p[name] + zeros[:, 0]).tolist()
        if (free[DIRECTIONS] and turned.any()) or free[CRANK_AXES]:
            rotations, _ = _rotations(tilts[:, :1] * self.directions + tilts[:, 1:] * self.across)
            along = self.directions * np.cos(turned) + self.across * np.sin(turned)
            found |= {HEADINGS: None, **{
                name: (rotations @ each[..., None])[..., 0].ravel().tolist()
                for name, each in ((CRANK_AXES, self.axes), (DIRECTIONS, along))}}
        found[BRANCH] = ['positive' if sign > 0.0 else 'negative' for sign in self.branches]
        return found

    @property
    def _has_servos(self) -> bool:
        return all(self.parameters[name] is not None for name in SERVO_POINTS)

    def written(self, name: str) -> tuple[str, ...]:
        """Return the points of the servos for zeros, where a file has them."""
        return SERVO_POINTS if name == DIRECTIONS and self._has_servos else (name,)

    def possible_errors(self, values: Array, size: float) -> Iterable[PossibleError]:
        """Return lengths that are those of other cranks or rods."""
        p = self.parameters
        return chain.from_iterable(find_errors(_OTHER_LENGTHS, _Lengths(
            name, list(p.joints), values[self.parts[name]], np.broadcast_to(p[name], 6)))
            for name in (CRANK_LENGTH, ROD_LENGTH))


class _Lengths(NamedTuple):
    """Lengths of cranks or rods (6,), calibrated and in the file [m]."""

    name: str
    leg: list[str]
    found: Array
    before: Array


_OTHER_LENGTHS = Hypothesis[_Lengths](
    'far', lambda s: np.abs(s.found / s.before - 1.0) - _FARTHEST, (
        '{name} of {leg} would become {found:.4g} m in place of {before:.4g} m: the angles are '
        'not those of this hexapod'))


def _near(angles: Array) -> Array:
    """Return angles within half a turn of zero."""
    return np.asarray(np.angle(np.exp(1j * angles)))


def _rotations(turns: Array) -> tuple[Array, Array]:
    """Return exp(skew(t)) (6, 3, 3) of turns t (6, 3), and its turn by a change of t, J_l(t)."""
    angles = np.linalg.norm(turns, axis=-1)[:, None, None]
    small = angles < 1e-4
    safe = np.where(small, 1.0, angles)
    sine = np.where(small, 1.0 - angles ** 2 / 6.0, np.sin(safe) / safe)
    cosine = np.where(small, 0.5 - angles ** 2 / 24.0, (1.0 - np.cos(safe)) / safe ** 2)
    third = np.where(small, 1.0 / 6.0 - angles ** 2 / 120.0, (safe - np.sin(safe)) / safe ** 3)
    across = skew(turns)
    square = across @ across
    return (np.eye(3) + sine * across + cosine * square,
            np.eye(3) + cosine * across + third * square)
