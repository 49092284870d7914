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

"""Measured efforts as leg forces, and likely mistakes in their sign and unit."""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.drives.motors import motor_ratio
from stewart_dynamics.parameters.table import AUTO, Parameters, STANDARD_GRAVITY

# A scale of the efforts within this ratio of a known factor is attributed to that factor.
_NEAR = 1.35
# A scale that differs from 1 by a larger ratio is a mistake; a smaller one is that of torques.
FAR, _TORQUES = 2.0, 0.05
_FACTORS = ((1e-3, 'kN in place of N'), (-1.0 / STANDARD_GRAVITY[2], 'kgf in place of N'),
            (1.0 / 4.448222, 'pounds in place of N'), (1e3, 'mN in place of N'))
ZERO, SIGN, UNIT, TORQUE, SCALE = 'zero', 'sign', 'unit', 'torque', 'scale'


def force_per_effort(parameters: Parameters, torques: bool, currents: bool) -> Array | None:
    """
    Return the leg force for an effort of 1 (6,), with the losses; None where efforts are forces.

    torques, currents: whether efforts are motor torques [N m], or motor currents [A].

    Raises ParameterError if a parameter of the drives that this needs has no value, or if screws
    are self-locking: the torque of a motor then does not show the load that drives it back.
    """
    for option, given, name in (
            ('--motor-torque', torques, 'actuator.screw_lead'),
            ('--motor-current', currents, 'actuator.screw_lead'),
            ('--motor-current', currents, 'drive.torque_constant')):
        if given and parameters[name] is None:
            raise ParameterError(f'{name}: has no value: {option} needs it')
    if not (torques or currents):
        return None
    back = parameters['drive.back_driving_efficiency']
    if np.any(back <= 0.0):
        raise ParameterError(
            f'drive.back_driving_efficiency: {back.min():g}: must be more than 0 where efforts '
            'are those of motors: the torque at a self-locking screw does not show its load')
    per_effort: Array = motor_ratio(parameters) * (
        parameters['drive.torque_constant'] if currents else 1.0)
    return per_effort


def has_losses(parameters: Parameters) -> bool:
    """Return whether screw or gear lose a part of the torque."""
    return bool(np.any(parameters['drive.efficiency'] != 1.0)
                or np.any(parameters['drive.back_driving_efficiency'] != 1.0))


def without_losses(forces: Array, rates: Array, accelerations: Array, p: Parameters) -> Array:
    """
    Return the forces (N, 6) of drives whose motors have the torques of ``force_per_effort``.

    It is the inverse of the law in ``motors``: the part m_r q'' of a force turns the rotor and
    passes no screw.

    rates, accelerations (N, 6): of the drives, q' and q'' [m/s, m/s^2].
    """
    of_rotors = p['actuator.reflected_mass'] * accelerations
    through = forces - of_rotors
    slip = np.minimum(np.abs(rates) / p['actuator.coulomb_velocity'], 1.0)
    full = np.where(through * rates > 0.0, 1.0 / p['drive.efficiency'],
                    p['drive.back_driving_efficiency'])
    loads: Array = through / (1.0 + (full - 1.0) * slip) + of_rotors
    return loads


def mistake_of_scale(scale: float, p: Parameters, of_motors: bool) -> tuple[str, str] | None:
    """
    Return keyword and text of the likely mistake if efforts are ``scale`` times the model's.

    of_motors: whether the efforts were torques or currents of the motors.
    """
    if not np.isfinite(scale) or scale == 0.0:
        return ZERO, 'all efforts are zero'
    if scale < 0.0:
        other = '' if p['geometry.platform_side'] != AUTO else (
            '; or the platform is on the other side of the base: geometry.platform_side')
        return SIGN, ('the efforts have the opposite sign: + must push, as the forces of '
                      f'the node do (they are {scale:.3g} times what the model computes)'
                      f'{other}')
    if 1.0 / FAR < scale < FAR:
        return None
    lead, ratio = p['actuator.screw_lead'], p['drive.gear_ratio']
    torques = 'likely torques of the motors in place of forces: --motor-torque takes them'
    units = [unit for factor, unit in _FACTORS if _is_near(scale, factor)]
    if of_motors:
        what, likely = SCALE, (
            f'likely actuator.screw_lead, {lead[0]:g} m, is wrong: about {lead[0] * scale:.3g} m '
            f'would fit; or drive.gear_ratio, {ratio[0]:g}: about {ratio[0] / scale:.3g}')
    elif lead is not None and _is_near(scale, float(np.mean(1.0 / motor_ratio(p)))):
        what, likely = TORQUE, torques
    elif units:
        what, likely = UNIT, f'likely {units[0]}'
    elif scale < _TORQUES:
        what, likely = TORQUE, (f'{torques}, with actuator.screw_lead (a lead of '
                                f'{2.0 * np.pi * scale:.2g} m would fit)')
    else:
        what, likely = SCALE, 'another unit, or a wrong platform.mass'
    return what, f'the efforts are {scale:.3g} times what the model computes: {likely}'


def _is_near(scale: float, factor: float) -> bool:
    return 1.0 / _NEAR < scale / factor < _NEAR
