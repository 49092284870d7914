# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Motion cueing: the classical washout, at the head, within the limits of the hexapod.

For each axis, f the specific force of the vehicle at the head, g = (0, 0, -9.80665) m/s^2, all in
the axes of the platform at rest (x forward, y left, z up); see L. D. Reid, M. A. Nahon, Flight
simulation motion-base drive algorithms, UTIAS Report 296, 1985:

    translation    p'' = K_t H_t (f + g)
                   H_t = s^3 / ((s^2 + 2 zeta w s + w^2) (s + w_b))     p: displacement of the head
    tilt           pitch = -asin(K_l L f_x / 9.80665), roll = asin(K_l L f_y / 9.80665)
                   L = w_l^2 / (s^2 + 2 zeta w_l s + w_l^2)
    rotation       angle = K_r / (s + w_r) rate                                   added to the tilt

Between samples the input is linear, and the filters are exact: Taylor series to rounding, so that
samples may be any time apart. Velocities and accelerations are the derivatives of the filters'
states. Near ``tilt.rate_max`` the acceleration of the tilt is limited to 10 w_l times the rate
that is left; where it is changed, the limit nears its new value with 4/s. The sine of the tilt
that is demanded is at most 0.6. The computation is ``core/cueing.c``; the governor is
``mechanics/governor.py``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Records
from stewart_dynamics.core.binding import function, record
from stewart_dynamics.errors import MotionError, ParameterError
from stewart_dynamics.mechanics.arguments import as_array, wrong_type
from stewart_dynamics.mechanics.frames.motion import check_kind, Motion
from stewart_dynamics.mechanics.governor import check_gaps, Governor
from stewart_dynamics.mechanics.rows import MOTION
from stewart_dynamics.parameters.table import Parameters, SPECIFIC_FORCE, STANDARD_GRAVITY

GRAVITY = -STANDARD_GRAVITY[2]
AXES = 'surge', 'sway', 'heave', 'roll', 'pitch', 'yaw'
OMCT_FREQUENCIES: Array = np.array([10.0 ** (-1.0 + 0.2 * k) for k in range(12)])
"""Frequencies of the objective motion cueing test, ICAO 9625 [rad/s]."""
# Larger inputs are no motion of a vehicle [m/s^2, rad/s].
_LARGEST_INPUT = 1e4

_FILTERS = {
    f'{part}_{c_name}': f'cueing.{part}.{name}'
    for part, names in {
        'translation': {'gain': 'gain', 'frequency': 'natural_frequency', 'damping': 'damping'},
        'tilt': {'gain': 'gain', 'frequency': 'natural_frequency', 'damping': 'damping',
                 'rate_max': 'rate_max'},
        'rotation': {'gain': 'gain', 'frequency': 'natural_frequency'}}.items()
    for c_name, name in names.items()} | {
        'washout_frequency': 'cueing.translation.washout_frequency'}


class Felt(NamedTuple):
    """Specific force and angular velocity that a pilot feels at the head, platform axes."""

    specific_force: Array  # (N, 3) [m/s^2]
    angular_velocity: Array  # (N, 3) [rad/s]


class MotionCueing:
    """
    Motions of the platform that let a pilot feel the motion of a vehicle.

    Parameters
    ----------
    parameters : Parameters or path
        Parameters of the hexapod, with ``cueing.*``.

    Raises
    ------
    ParameterError
        There is no home pose, or with ``cueing.govern`` a limit is exceeded at home.

    """

    def __init__(self, parameters: Parameters | str | Path) -> None:
        if isinstance(parameters, str | Path):
            parameters = Parameters.from_yaml(parameters)
        if not isinstance(parameters, Parameters):
            raise wrong_type('parameters', parameters, 'Parameters or the path of their file')
        self.parameters = parameters
        self.governed = parameters.cueing.govern
        self.governor = Governor(parameters, parameters.cueing.head)
        if self.governed:
            self.governor.check_home(parameters)
        filters: Any = np.zeros((), record('washout_filters'))
        for field, name in _FILTERS.items():
            filters[field] = parameters[name]
        self._constants = *self.governor.arguments, self.governed, filters
        # The input that is rest.
        self.at_rest: Array = np.zeros(3)
        if parameters.cueing.input == SPECIFIC_FORCE:
            self.at_rest[2] = GRAVITY

    def run(self, times: ArrayLike, specific_force: ArrayLike,
            angular_velocity: ArrayLike | None = None) -> Motion:
        """
        Return the motion of the platform, from rest at home.

        Parameters
        ----------
        times : (N,)
            Strictly increasing [s].
        specific_force : (N, 3)
            At the head in the vehicle, x forward, y left, z up [m/s^2]; with ``cueing.input:
            acceleration`` without gravity.
        angular_velocity : (N, 3), optional
            The vehicle's, the same axes [rad/s]; zero by default.

        Returns
        -------
        Motion
            In the base frame, of shape (N,).

        Raises
        ------
        MotionError
            A shape does not fit, a number is not finite or out of range, or times are not
            strictly increasing.

        """
        return CueingStream(self).advance(times, specific_force, angular_velocity)

    def stream(self) -> CueingStream:
        """Return a motion that is computed in pieces, with the same bits as by ``run``."""
        return CueingStream(self)

    def felt(self, motion: Motion) -> Felt:
        """Return specific force and angular velocity at the head in motions of the platform."""
        check_kind(motion, Motion)
        rows = np.ascontiguousarray(motion.rows.reshape(-1, MOTION))
        felt = np.empty((len(rows), 6))
        function('felt_many')(self.parameters.cueing.head, len(rows), rows, felt)
        forces, rates = (felt[:, part].reshape(*motion.shape, 3)
                         for part in (slice(0, 3), slice(3, 6)))
        return Felt(forces, rates)

    def response(self, frequencies: ArrayLike) -> dict[str, Array]:
        """
        Return the felt by the wanted, complex, at frequencies (N,) [rad/s], for small motions.

        Surge, sway and heave are specific forces, roll, pitch and yaw angular velocities; the
        governor and the limit of the rate of tilt are idle.
        """
        s = 1j * as_array('frequencies', frequencies, np.shape(frequencies))
        of, rotation = self.parameters.cueing.translation, self.parameters.cueing.rotation
        found: dict[str, Array] = {}
        for n, axis in enumerate(AXES[:3]):
            w, zeta, slow = of.natural_frequency[n], of.damping[n], of.washout_frequency[n]
            found[axis] = of.gain[n] * s ** 3 / (
                (s ** 2 + 2.0 * zeta * w * s + w ** 2) * (s + slow))
        for n, axis in enumerate(AXES[:2]):
            found[axis] = found[axis] + self._tilt(n, s)
        for n, axis in enumerate(AXES[3:]):
            found[axis] = rotation.gain[n] * s / (s + rotation.natural_frequency[n])
        return found

    def _tilt(self, n: int, s: Any) -> Any:
        """Return the response of the tilt for surge, 0, or sway, 1."""
        of = self.parameters.cueing.tilt
        w, zeta = of.natural_frequency[n], of.damping[n]
        return of.gain[n] * w ** 2 / (s ** 2 + 2.0 * zeta * w * s + w ** 2)

    def cross_response(self, frequencies: ArrayLike) -> dict[tuple[str, str], Array]:
        """
        Return the responses of other axes than the wanted one, by both names.

        Tilt is felt as rotation [rad/s by m/s^2], and rotation tilts gravity [m/s^2 by rad/s].
        """
        s = 1j * as_array('frequencies', frequencies, np.shape(frequencies))
        rotation, found = self.parameters.cueing.rotation, {}
        for n, (axis, turn, sign) in enumerate((('surge', 'pitch', -1.0), ('sway', 'roll', 1.0))):
            found[axis, turn] = s * sign * self._tilt(n, s) / GRAVITY
            k = AXES.index(turn) - 3
            found[turn, axis] = sign * GRAVITY * rotation.gain[k] / (
                s + rotation.natural_frequency[k])
        return found

    def inputs(self, specific_force: ArrayLike, angular_velocity: ArrayLike | None) -> Array:
        """Return accelerations and angular velocities (N, 6), checked."""
        force = as_array('specific_force', specific_force, (3,))
        rates = (np.zeros_like(force) if angular_velocity is None
                 else as_array('angular_velocity', angular_velocity, (3,)))
        if force.ndim != 2 or rates.shape != force.shape:
            raise MotionError(f'specific_force {force.shape}, angular_velocity {rates.shape}: '
                              'must both be (N, 3)')
        inputs: Array = np.column_stack([force - self.at_rest, rates])
        if (wrong := np.abs(inputs) > _LARGEST_INPUT).any():
            n, column = np.argwhere(wrong)[0].tolist()
            name = 'specific_force' if column < 3 else 'angular_velocity'
            raise MotionError(f'{name}[{n}]: {inputs[n, column]:.6g}: must be at most '
                              f'{_LARGEST_INPUT:g}')
        return inputs

    def advance(self, times: Array, inputs: Array, state: Records) -> Array:
        """Return rows of motion (N, MOTION) at times (N,) of inputs (N, 6); advance the state."""
        rows = np.empty((len(times), MOTION))
        function('cue_many')(*self._constants, len(times), times, inputs, state, rows)
        return rows

    def bound(self, time: Array, inputs: Array, state: Records, row: Array, felt: Array,
              ) -> tuple[Callable[[], Any], Callable[[], Any]]:
        """Return functions that advance by one sample, and that write the felt quantities then."""
        return (function('cue_many').bound(*self._constants, 1, time, inputs, state, row),
                function('felt_many').bound(self.parameters.cueing.head, 1, row, felt))


class CueingStream:
    """
    A motion of the platform that is computed piece by piece.

    row (MOTION,): last motion.
    felt (6,): specific force and angular velocity at the head, of ``advance_by_one``.
    """

    def __init__(self, cueing: MotionCueing) -> None:
        self._state: Any = np.zeros((), record('cueing_state'))
        self._state['time'] = np.nan
        self._time, self._inputs = np.empty(1), np.empty(6)
        self.row, self.felt = np.zeros(MOTION), np.zeros(6)
        self._bind(cueing)

    def _bind(self, cueing: MotionCueing) -> None:
        self.cueing = cueing
        self._gravity: float = cueing.at_rest[2]
        self._advance, self._feel = cueing.bound(
            self._time, self._inputs, self._state, self.row, self.felt)

    def advance_by_one(self, time: float, reading: Sequence[float]) -> None:
        """
        Advance to a later time [s], for real time: with the bits of ``advance``, and unchecked.

        reading (6,): specific force [m/s^2] and angular velocity [rad/s] of the vehicle.
        """
        x, y, z, *rates = reading
        self._time[0] = time
        self._inputs[:] = x, y, z - self._gravity, *rates
        self._advance()
        self._feel()

    def advance(self, times: ArrayLike, specific_force: ArrayLike,
                angular_velocity: ArrayLike | None = None) -> Motion:
        """Return the motion (N,) at the next times; arguments and errors are those of ``run``."""
        inputs = self.cueing.inputs(specific_force, angular_velocity)
        array = as_array('times', times, inputs.shape[:1])
        before = np.concatenate([[self._state['time']], array[:-1]])
        if (stuck := array <= before).any():
            n = int(np.argmax(stuck))
            raise MotionError(f'times[{n}]: {array[n]:.9g} s: must be after {before[n]:.9g} s')
        check_gaps(array, before)
        rows = self.cueing.advance(np.ascontiguousarray(array, dtype=float), inputs, self._state)
        self.row[:] = rows[-1] if len(rows) else self.row
        return Motion.of_rows(rows)

    def use(self, cueing: MotionCueing) -> None:
        """
        Go on with other parameters, into which the motion blends without a step.

        Raises ParameterError, and changes nothing: with these parameters the present motion, or
            the stop from it, would exceed a limit.
        """
        if not np.isnan(self._state['time']):
            now = cueing.governor.coordinates(Motion.of_rows(self.row[None]))
            limit = cueing.governor.limit_of(now) if cueing.governed else None
            if limit is not None:
                raise ParameterError(
                    f'parameters: {limit} would be exceeded by the present motion or by the stop '
                    'from it: change them nearer to rest')
            self._state['governor']['now'] = now[0]
        self._bind(cueing)
        self._state['governor']['following'] = 0.0

    def stop(self) -> None:
        """Come to rest, whatever the input is, until ``resume``."""
        self._state['governor']['stopping'] = 1.0

    def resume(self) -> None:
        """Blend into the demand again, after ``stop``."""
        self._state['governor']['stopping'] = 0.0

    @property
    def shares(self) -> dict[str, float]:
        """Return the share of the demand that each axis was given at last."""
        governor = self._state['governor']
        shares = np.ones(6) if governor['following'] else governor['share']
        return dict(zip(AXES, shares.tolist(), strict=True))

    @property
    def held(self) -> dict[str, float]:
        """Return the time by which each limit has held the demand back [s], all axes together."""
        return self.cueing.governor.held_times(self._state['governor'])
