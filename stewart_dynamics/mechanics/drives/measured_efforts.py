# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Measured efforts as those of the drives, and possible errors in their sign and unit."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.core.binding import function
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.drives.motors import motor_ratio
from stewart_dynamics.parameters.table import AUTO, Parameters
from stewart_dynamics.possible_errors.hypothesis import (
    find_errors, First, Hypothesis, likeliest, PossibleError, Table, When)
from stewart_dynamics.possible_errors.transforms import name_of_factor

# A scale of the efforts within this ratio of a known factor is attributed to that factor.
_NEAR = 1.35
# A scale that differs from 1 by a larger ratio is an error; a smaller one is that of torques.
FAR, _TORQUES = 2.0, 0.05
ZERO, SIGN, UNIT, TORQUE, FORCE, SCALE, SWAPPED = (
    'zero', 'sign', 'unit', 'torque', 'force', 'scale', 'swapped')
RATE, STAMPS = 'rate', 'stamps'  # not of the efforts
# The same for forces that were converted as torques: the losses of the drives are taken off them.
_LOSSES = 3.0

# Cosine between measured and computed forces from which on they are alike but for a factor.
_ALIKE = 0.9
# Largest residual of the other legs, as part of that of the one that is wrong (squared).
_OTHERS = 0.1
# Legs are swapped if the residual is at least this part of the varying forces, and swapping
# reduces it to this part (both squared).
_SUSPICIOUS, _BETTER = 0.03 ** 2, 0.25


def force_per_effort(parameters: Parameters, torques: bool, currents: bool) -> Array | None:
    """
    Return the drive's effort for one of 1 (6,), with the losses; None where they are the same.

    torques, currents: whether efforts are motor torques [N m], or motor currents [A].

    Raises ParameterError if a parameter of the drives that this needs has no value, or if screws
    are self-locking: the torque of a motor then does not show the load that drives it back.
    """
    ratio, constant = parameters.leg_kind.ratio, parameters.drive.torque_constant
    for option, given, name in (
            ('--motor-torque', torques, ratio), ('--motor-current', currents, ratio),
            ('--motor-current', currents, 'drive.torque_constant')):
        if given and name and parameters[name] is None:
            raise ParameterError(f'{name}: has no value: {option} needs it')
    if not (torques or currents):
        return None
    back = parameters.drive.back_driving_efficiency
    if np.any(back <= 0.0):
        raise ParameterError(
            f'drive.back_driving_efficiency: {back.min():g}: must be more than 0 where efforts '
            f'are those of motors: the torque at a self-locking {parameters.leg_kind.gear} does '
            'not show its load')
    per_torque = motor_ratio(parameters)
    return per_torque * constant if currents and constant is not None else per_torque


def has_losses(parameters: Parameters) -> bool:
    """Return whether screw or gear lose a part of the torque."""
    return bool(np.any(parameters.drive.efficiency != 1.0)
                or np.any(parameters.drive.back_driving_efficiency != 1.0))


def without_losses(forces: Array, rates: Array, accelerations: Array, p: Parameters) -> Array:
    """
    Return the forces (N, 6) of drives whose motors have the torques of ``force_per_effort``.

    It is the inverse of the law in ``motors``: the part m_r q'' of a force turns the rotor and
    passes no screw.

    rates, accelerations (N, 6): of the drives, q' and q'' [m/s, m/s^2].
    """
    loads = np.empty((len(forces), 6))
    function('without_losses_many')(p.structure, len(forces), *map(
        np.ascontiguousarray, (forces, rates, accelerations)), loads)
    return loads


def leaves_wrench(error: PossibleError | None) -> bool:
    """Return whether measured efforts give an external wrench; those of a wrong scale do."""
    return error is None or error.what == SCALE


class EffortSums:
    """
    Sums over measured and computed forces of the legs, and the possible error that they show.

    of_motors: whether the efforts were torques or currents of the motors.
    """

    def __init__(self, parameters: Parameters, of_motors: bool = False) -> None:
        self._parameters, self._of_motors = parameters, of_motors
        self.leg, self.kind = list(parameters.joints), parameters.leg_kind
        self.count = 0.0
        self.measured, self.computed = np.zeros((2, 6))  # [N]
        self.measured_squares, self.computed_squares = np.zeros((2, 6))  # [N^2]
        self.products = np.zeros((6, 6))  # of leg i measured, leg j computed [N^2]

    def add(self, measured: Array, computed: Array, weight: float = 1.0) -> None:
        """Add forces (6, N) [N], + pushes; each counts ``weight`` times."""
        self.count += weight * measured.shape[1]
        self.measured += weight * np.sum(measured, axis=1)
        self.computed += weight * np.sum(computed, axis=1)
        self.measured_squares += weight * np.sum(measured ** 2, axis=1)
        self.computed_squares += weight * np.sum(computed ** 2, axis=1)
        self.products += weight * (measured @ computed.T)

    @property
    def own_products(self) -> Array:
        """Return the products of measured and computed force of the same leg (6,) [N^2]."""
        return np.diag(self.products)

    @property
    def alike(self) -> bool:
        """Return whether measured and computed forces are alike, in size as well."""
        scale = self._scale()
        return scale is not None and 1.0 / FAR < scale < FAR

    def find_error(self) -> PossibleError | None:
        """Return the possible error in the efforts; None without one."""
        residual = float(self._residuals.sum())
        # Friction may hold the platform with any force up to its own.
        friction = self.count * float(np.sum(self._parameters.actuator.coulomb_friction ** 2))
        if residual <= friction:
            return None
        scale = self._scale()
        found = None if scale is None else find_scale_error(
            scale, self._parameters, self._of_motors)
        return found or next(find_errors(_ONE_LEG, self), None) or self._swapped()

    def _scale(self) -> float | None:
        """Return the factor from computed to measured forces; None if they are not alike."""
        measured, computed = float(self.measured_squares.sum()), float(self.computed_squares.sum())
        products = float(self.own_products.sum())
        if not computed or (
                measured and abs(products) < _ALIKE * np.sqrt(measured * computed)):
            return None
        return products / computed

    @property
    def _residuals(self) -> Array:
        """Return the squared differences of measured and computed forces (6,) [N^2]."""
        return self.measured_squares - 2.0 * self.own_products + self.computed_squares

    @property
    def alone(self) -> Flags:
        """Return whether the other legs are right (6,); a load moves all."""
        each = self._residuals
        alone: Flags = (each.sum() - each <= _OTHERS * each) & (self.computed_squares > 0.0)
        return alone

    @property
    def opposite(self) -> Flags:
        """Return whether measured and computed forces are alike but for the sign (6,)."""
        sizes, products = self.computed_squares, self.own_products
        opposite: Flags = (sizes < -_NEAR * products) & (-products < _NEAR * sizes) & (
            products ** 2 > _ALIKE ** 2 * self.measured_squares * sizes)
        return opposite

    def _swapped(self) -> PossibleError | None:
        """Return the two legs whose efforts are swapped, if they vary and show it."""
        if not self.count:
            return None
        number, joints = self.count, self.leg
        varying = self.products - np.outer(self.measured, self.computed) / number
        means = (self.measured - self.computed) ** 2 / number
        residuals = float(self._residuals.sum()), float(np.sum(self._residuals - means))
        moved = float(np.sum(self.computed_squares - self.computed ** 2 / number))
        if residuals[1] < _SUSPICIOUS * moved or moved < _SUSPICIOUS * self.computed_squares.sum():
            return None
        tried = [(max(1.0 - 2.0 * float(of[a, b] + of[b, a] - of[a, a] - of[b, b]) / residual
                      for of, residual in zip((self.products, varying), residuals, strict=True)),
                  (joints[a], joints[b])) for a, b in combinations(range(6), 2)]
        return next((PossibleError(SWAPPED, (
            f'the efforts of {one} and {other} look swapped: the residual becomes '
            f'{np.sqrt(max(misfit, 0.0)):.2f} times as large'))
            for misfit, (one, other) in likeliest(tried, _BETTER)), None)


_ONE_LEG: Table[EffortSums] = First(
    Hypothesis(ZERO, lambda s: s.alone & (s.measured_squares == 0.0),
               'the effort of {leg} is zero'),
    Hypothesis(SIGN, lambda s: s.alone & s.opposite, (
        'the effort of {leg} has the opposite sign of those of the other legs: '
        '{kind.right_sign}')))


class _Scale:
    """Efforts that are ``scale`` times the model's, of the drives or of the motors."""

    def __init__(self, scale: float, p: Parameters, of_motors: bool) -> None:
        self.scale, self.kind, self.of_motors = scale, p.leg_kind, of_motors
        self.side = '' if p.geometry.platform_side != AUTO else (
            '; or the platform is on the other side of the base: geometry.platform_side')
        ratio = motor_ratio(p)
        self.motors = _per_effort(p)
        self.known, self.per_torque = bool(np.isfinite(ratio).all()), float(np.mean(1.0 / ratio))
        lead, gear = p.actuator.screw_lead, p.drive.gear_ratio[0]
        self.ratio = f'drive.gear_ratio, {gear:g}: about {gear / scale:.3g}' if lead is None else (
            f'actuator.screw_lead, {lead[0]:g} m, is wrong: about {lead[0] * scale:.3g} m would '
            f'fit; or drive.gear_ratio, {gear:g}: about {gear / scale:.3g}')
        self.fits = ' would fit' if lead is None else ''
        self.lead = 2.0 * np.pi * scale
        self.unit = name_of_factor(scale, self.kind.wrong_units, _NEAR)


_Of = Hypothesis[_Scale]
_TIMES = 'the efforts are {scale:.3g} times what the model computes: '
_MOTORS = (_TIMES + 'likely torques of the motors in place of {kind.effort.field}: stewart_replay '
           'and stewart_identify take them with --motor-torque')
_SCALES: Table[_Scale] = First(
    _Of(SIGN, lambda s: s.scale < 0.0, (
        'the efforts have the opposite sign: {kind.right_sign}, as the {kind.effort.field} of the '
        'node do (they are {scale:.3g} times what the model computes){side}')),
    When(lambda s: not 1.0 / FAR < s.scale < FAR, First(
        When(lambda s: s.of_motors, First(
            _Of(FORCE, lambda s: any(_is_near(s.scale, each, _LOSSES) for each in s.motors), (
                _TIMES + 'likely {kind.effort.field} at the legs in place of torques or currents '
                'of the motors: omit --motor-torque, --motor-current')),
            _Of(SCALE, lambda s: s.known, _TIMES + 'likely {ratio}{fits}'))),
        _Of(TORQUE, lambda s: s.known and _is_near(s.scale, s.per_torque), _MOTORS),
        _Of(UNIT, lambda s: len(s.unit), _TIMES + 'likely {unit}'),
        _Of(TORQUE, lambda s: s.scale < _TORQUES and s.kind.ratio != '', (
            _MOTORS + ', with actuator.screw_lead (a lead of {lead:.2g} m would fit)')),
        _Of(SCALE, lambda s: True, _TIMES + 'another unit, or a wrong platform.mass'))))


def find_scale_error(scale: float, p: Parameters, of_motors: bool) -> PossibleError | None:
    """
    Return the possible error if efforts are ``scale`` times the model's; None without one.

    of_motors: whether the efforts were torques or currents of the motors.
    """
    if not np.isfinite(scale) or scale == 0.0:
        return PossibleError(
            ZERO, 'all efforts are zero: brakes hold the legs, or no efforts are measured')
    return next(find_errors(_SCALES, _Scale(scale, p, of_motors)), None)


def known_scales(p: Parameters, of_motors: bool) -> list[float]:
    """Return the scales of efforts that ``find_scale_error`` attributes to a unit."""
    if of_motors:
        return _per_effort(p)
    torque = float(np.mean(1.0 / motor_ratio(p)))
    return [*(factor for factor, _ in p.leg_kind.wrong_units), *(
        [torque] if np.isfinite(torque) else [])]


def _per_effort(p: Parameters) -> list[float]:
    """Return the mean leg forces for torques, and for currents, of 1."""
    ratio, constant = motor_ratio(p), p.drive.torque_constant
    return [float(np.mean(each * ratio)) for each in (1.0, constant) if each is not None]


def _is_near(scale: float, factor: float, near: float = _NEAR) -> bool:
    return 1.0 / near < scale / factor < near
