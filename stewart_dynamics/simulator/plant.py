# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The plant: the hexapod as it moves under leg forces.

Gravity, friction, end stops, actuators that saturate: what ``stewart_simulator`` puts in the
place of hardware. Equal commands give equal bits. See ``simulator.plant_dynamics`` for the
integration, and ``simulator.end_stops``.

The step is short enough for friction and end stops, whose modes are the fastest by far. With them
a hexapod is ``M x'' + J^T D J x' + J^T K J x = 0``, with M its mass matrix, D the damping of the
legs (viscous friction, the slope of the Coulomb friction at standstill, the dampers of the stops)
and K the springs of the stops. A mode exp(s t) obeys s^2 + d s + k = 0 with Rayleigh quotients d
and k, which are no larger than the largest eigenvalues of D and of K relative to M. So |s| is at
most the larger of d and sqrt(k) made of these, and h is chosen so that h |s| <= 1.
"""

from __future__ import annotations

import math
from struct import Struct
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, NO_WRENCH, Six
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.drives.motors import DRIVE, Drives, motor_ratio
from stewart_dynamics.mechanics.dynamics.forward_dynamics import WORK
from stewart_dynamics.mechanics.frames.rotation import from_euler, to_quaternion
from stewart_dynamics.mechanics.limits import Limits, result_values
from stewart_dynamics.mechanics.rows import consecutive, NO_BASE
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import inertia_matrix, Parameters
from stewart_dynamics.simulator.end_stops import stiffness_and_damping, stops_of
from stewart_dynamics.simulator.parameters import SimulatorParameters, TORQUE
from stewart_dynamics.simulator.plant_dynamics import (
    advance, BASE_BEGIN, LARGEST_MOVE, RESULT, RESULT_ACCELERATION, RESULT_FORCES, RESULT_LENGTHS,
    RESULT_MOTORS, RESULT_RATES, RESULT_SOUND, SCRATCH, STATE, STATE_POSITION, STATE_QUATERNION,
    STATE_TWIST)

# The Runge-Kutta method is stable for all modes s with |h s| below 2.6 that do not grow by
# themselves; up to 1 their error is small as well, with a margin for nonlinear terms.
_REACH = 1.0
_MOST_SUBSTEPS = 1000


def substeps(parameters: Parameters) -> int:
    """
    Return into how many parts the step of the parameters must be divided.

    Raises ParameterError if they would be too many, with the parameter that is too large.
    """
    step = parameters['step']
    with np.errstate(all='ignore'):
        viscous = parameters['actuator.viscous_friction']
        coulomb = (parameters['actuator.coulomb_friction'] + screw_friction(parameters)
                   ) / parameters['actuator.coulomb_velocity']
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


def screw_friction(parameters: Parameters) -> Array:
    """Return the largest losses in the screws (6,) as forces [N], where commands are torques."""
    if parameters['commands'] != TORQUE:
        return np.zeros(6)
    weight = parameters['platform.mass'] * np.linalg.norm(parameters['gravity'])
    most = parameters['drive.torque_max']
    loads = weight if most is None else most * motor_ratio(parameters)
    losses: Array = loads * (1.0 / parameters['drive.efficiency'] - 1.0)
    return losses


def largest_eigenvalue(parameters: Parameters, of_legs: Array) -> float:
    """
    Return a bound, in every pose, of the largest eigenvalue of J^T diag(of_legs) J against M.

    A force along leg i moves the platform's joint along the leg by no more than
    1 / m + |p_i - c|^2 / I_min, of the platform alone, times the force; the sum of these
    products is the trace of a matrix with these eigenvalues. The reflected masses in series give
    another bound; the masses of the legs would only make it smaller. ``of_legs`` (6,) are dampings
    [N s/m] or stiffnesses [N/m].
    """
    arms = parameters['geometry.platform_joints'] - parameters['platform.center_of_mass']
    smallest = np.linalg.eigvalsh(inertia_matrix(parameters['platform.inertia']))[0]
    mobility = 1.0 / parameters['platform.mass'] + np.sum(arms ** 2, axis=-1) / smallest
    having = of_legs > 0.0
    if not having.any():
        return 0.0
    by_actuators = np.min(parameters['actuator.reflected_mass'][having] / of_legs[having])
    return float(1.0 / (by_actuators + 1.0 / (of_legs @ mobility)))


# In the numbers of the motors.
ANGLES, SPEEDS, TORQUES = consecutive(6, 6, 6)
_OF_MOTORS = slice(RESULT_MOTORS.start, RESULT_MOTORS.start + TORQUES.stop)
_NUMBERS = Struct(f'{STATE + _OF_MOTORS.stop}d')


class PlantState(NamedTuple):
    """The hexapod at the end of a period."""

    lengths: Six  # [m]
    rates: Six  # [m/s]
    forces: Six
    """Of the actuators, without end stops [N]: the commands as they saturated; under torques the
    forces at the end of the period."""
    pose: tuple[float, ...]
    """Position and quaternion x y z w of the platform frame in the base frame."""
    twist: Six  # base axes [m/s, rad/s]
    acceleration: Six  # base axes [m/s^2, rad/s^2]
    motors: tuple[float, ...] = ()
    """Angles [rad], speeds [rad/s] and torques [N m] (18,); empty without ``drive.*``."""


class Plant:
    """
    The hexapod of given parameters, in motion from its initial pose; brakes hold it there first.

    Where a step cannot be computed, because numbers overflow or a leg is so short that one step
    could reverse it, the hexapod is held at rest in the last pose that could be, permanently:
    ``fault`` states it.

    Raises ParameterError if the initial pose exceeds a limit of length, or friction or end stops
    would need too short steps.
    """

    def __init__(self, parameters: SimulatorParameters) -> None:
        self.parameters = parameters
        self.substeps = substeps(parameters)
        """Steps that are taken within one of the parameter's length."""
        self.fault = ''  # why it is held at rest permanently; empty while it is not
        period = 1.0 / parameters['rate']
        self.steps = round(period / parameters['step']) * self.substeps  # steps in a period
        self._step = period / self.steps
        self._limits = Limits(parameters)
        self._loads = np.array(NO_WRENCH + NO_WRENCH + 3 * NO_BASE)
        numbers = np.zeros(STATE + RESULT)
        self._memory = numbers.data  # the same as bytes
        self._state, self._result = numbers[:STATE], numbers[STATE:]
        pose = parameters['initial_pose']
        self._state[STATE_POSITION] = pose[:3]
        self._state[STATE_QUATERNION] = to_quaternion(from_euler(pose[3:]))
        drives = Drives(parameters).arguments if parameters.drives else (
            StewartPlatform(parameters).constants, np.empty((0, DRIVE)), np.empty(0),
            np.empty((0, 2)))
        self._driven = bool(parameters.drives)
        self._take_none, self._take_steps = (advance.bound(
            *drives, parameters['commands'] == TORQUE, stops_of(parameters),
            self._limits.force_max, self._loads, self._state, self._result, steps, self._step,
            np.empty(SCRATCH), np.empty(WORK)) for steps in (0, self.steps))
        self.state = self._run(0)._replace(acceleration=NO_WRENCH)  # the present one
        self._check_lengths()
        self._deviations = np.repeat([
            parameters['noise.length'], parameters['noise.rate'], parameters['noise.force']], 6)
        self._noise = np.random.default_rng(np.float64(parameters['noise.seed']).view(np.uint64))

    def advance(self, commands: Six, wrench: Six, base: Array | None = None) -> PlantState:
        """
        Return the state one period later.

        Commands are forces of the actuators [N], + pushes, that saturate at limits.force_max; or
        torques of the motors [N m] that saturate at drive.torque_max and drive.torque_speed. The
        wrench acts on the platform at its origin, base axes [N, N m]. ``base`` (3, BASE) are rows
        of its motion at begin, middle and end of the period; by default it is still.
        """
        if not self.fault:
            self._loads[:BASE_BEGIN.start] = commands + wrench
            self._loads[BASE_BEGIN.start:] = math.nan if base is None else base.ravel()
            self.state = self._run(self.steps)
        return self.state

    def brake(self) -> PlantState:
        """Return the state at rest in the present pose: the brakes take all speed at once."""
        if not self.fault:
            self._state[STATE_TWIST] = 0.0
            self._loads[:] = NO_WRENCH + NO_WRENCH + 3 * NO_BASE
            self.state = self._run(0)._replace(acceleration=NO_WRENCH)
        return self.state

    def measured(self) -> PlantState:
        """
        Return the present state as it is measured: noise on lengths, rates and forces.

        The noise is another in each call; pose, twist and acceleration are true.
        """
        state = self.state
        if not self._deviations.any():
            return state
        numbers: Any = tuple((
            state.lengths + state.rates + state.forces
            + self._deviations * self._noise.standard_normal(18)).tolist())
        return state._replace(lengths=numbers[RESULT_LENGTHS], rates=numbers[RESULT_RATES],
                              forces=numbers[RESULT_FORCES])

    def _run(self, steps: int) -> PlantState:
        (self._take_steps if steps else self._take_none)()
        numbers = _NUMBERS.unpack_from(self._memory)
        state, result = numbers[:STATE], numbers[STATE:]
        lengths = result[RESULT_LENGTHS]
        if not result[RESULT_SOUND]:
            self.fault = (
                f'held at rest permanently: after position {list(state[STATE_POSITION])} m the '
                'motion cannot be computed: numbers overflow, or within a step of '
                f'{self._step:.3g} s the platform turns by more than {LARGEST_MOVE} rad or a '
                'joint moves by more than that part of its leg; shortest leg '
                f'{min(lengths):.3g} m')
        return PlantState(
            lengths, result[RESULT_RATES], result[RESULT_FORCES], state[:STATE_TWIST.start],
            state[STATE_TWIST], result[RESULT_ACCELERATION],
            result[_OF_MOTORS] if self._driven else ())

    def _check_lengths(self) -> None:
        """Raise ParameterError where the hexapod does not fit between its end stops."""
        pose = self.parameters['initial_pose'].tolist()
        if self.fault:
            raise ParameterError(
                f'initial_pose: {pose}: a leg would have no length, or one that overflows')
        for exceedance in self._limits.exceeded(result_values(
                self.state.lengths, NO_WRENCH, None)):
            raise ParameterError(
                f'initial_pose: {pose}: {exceedance.words(self.parameters["joints"])}')
