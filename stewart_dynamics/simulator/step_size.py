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
The longest step of an integration where friction or end stops are stiff.

Their modes are the fastest by far. With them a hexapod is
``M x'' + J^T D J x' + J^T K J x = 0``, with M its mass matrix, D the damping of the legs (viscous
friction, the slope of the Coulomb friction at standstill, the dampers of the stops) and K the
springs of the stops. A mode exp(s t) obeys s^2 + d s + k = 0 with Rayleigh quotients d and k,
which are no larger than the largest eigenvalues of D and of K relative to M. So |s| is at most
the larger of d and sqrt(k) made of these, and h is chosen so that h |s| <= 1.
"""

from __future__ import annotations

import math

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.parameters.table import inertia_matrix, Parameters
from stewart_dynamics.simulator.end_stops import stiffness_and_damping

# The Runge-Kutta method is stable for all modes s with |h s| below 2.6 that do not grow by
# themselves; up to 1 their error is small as well, with a margin for nonlinear terms.
_REACH = 1.0
_MOST_SUBSTEPS = 1000


def substeps(parameters: Parameters) -> int:
    """
    Return into how many parts the step of the parameters must be divided.

    Raises
    ------
    ParameterError
        These would be too many; names the parameter.

    """
    step = parameters['step']
    with np.errstate(all='ignore'):
        viscous = parameters['actuator.viscous_friction']
        coulomb = parameters['actuator.coulomb_friction'] / parameters['actuator.coulomb_velocity']
        stiffness, damping = stiffness_and_damping(parameters)
        fastest = max(largest_eigenvalue(parameters, viscous + coulomb + damping),
                      math.sqrt(largest_eigenvalue(parameters, stiffness)))
        parts = float(step * fastest / _REACH)
        if parts <= _MOST_SUBSTEPS:
            return max(1, math.ceil(parts))
        # Up to critical damping, the damping is in proportion to the frequency.
        ratio = parameters['end_stops.damping_ratio']
        of_each = {
            'actuator.viscous_friction': largest_eigenvalue(parameters, viscous),
            'actuator.coulomb_friction': largest_eigenvalue(parameters, coulomb),
            'end_stops.frequency': math.sqrt(largest_eigenvalue(parameters, stiffness)),
            'end_stops.damping_ratio' if ratio > 1.0 else 'end_stops.frequency':
                largest_eigenvalue(parameters, damping)}
    name = max(of_each, key=lambda each: of_each[each])
    value = parameters[name]
    text = str(value.tolist() if isinstance(value, np.ndarray) else value)
    if name == 'actuator.coulomb_friction':
        velocity = parameters['actuator.coulomb_velocity'].tolist()
        text += f' N within actuator.coulomb_velocity {velocity} m/s'
    raise ParameterError(
        f'{name}: {text}: too large for a '
        f'platform of {parameters["platform.mass"]:g} kg: the integration would need steps of '
        f'{_REACH / fastest:.2g} s, the shortest possible are {step / _MOST_SUBSTEPS:.2g} s')


def largest_eigenvalue(parameters: Parameters, of_legs: Array) -> float:
    """
    Return a bound, in every pose, of the largest eigenvalue of J^T diag(of_legs) J against M.

    A force along leg i moves the platform's joint along the leg by no more than
    1 / m + |p_i - c|^2 / I_min, of the platform alone, times the force; the sum of these
    products is the trace of a matrix with these eigenvalues. The reflected masses in series give
    another bound; the masses of the legs would only make it smaller.

    Parameters
    ----------
    parameters : Parameters
        Geometry, platform and reflected masses.
    of_legs : (6,)
        Damping [N s/m] or stiffness [N/m] of each leg.

    """
    arms = parameters['geometry.platform_joints'] - parameters['platform.center_of_mass']
    smallest = np.linalg.eigvalsh(inertia_matrix(parameters['platform.inertia']))[0]
    mobility = 1.0 / parameters['platform.mass'] + np.sum(arms ** 2, axis=-1) / smallest
    having = of_legs > 0.0
    if not having.any():
        return 0.0
    by_actuators = np.min(parameters['actuator.reflected_mass'][having] / of_legs[having])
    return float(1.0 / (by_actuators + 1.0 / (of_legs @ mobility)))
