# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The plant: the hexapod as it moves under efforts of its drives: leg forces, or torques of shafts.

Gravity, friction, end stops, actuators that saturate: what ``stewart_simulator`` puts in the
place of hardware. Equal commands give equal bits. See ``simulator.end_stops`` for the end stops.

The method is the classical Runge-Kutta method of fourth order, on position, quaternion and twist.
After every step the quaternion is divided by its length, which keeps the order (Hairer, Lubich,
Wanner, Geometric Numerical Integration, 2nd ed., IV.4, doi:10.1007/3-540-30666-8). Forces and
wrench are constant within a call, so that the work of an effort is the effort times the change
of its drive's coordinate, exactly, and an energy balance shows the error of the method alone. The
motion of the base is given at begin, middle and end of a call, which are the stages of the method
where a call is one step; with more steps it is the parabola through them.

The load of a screw is (k torque - m_r q'') / c, see ``drives.motors``: under a torque a drive has
the effort k torque / c and the reflected mass m_r / c. c depends on the direction of the power,
which is assumed, and assumed again where the load that follows contradicts it.

End stops act on the drives' coordinates, between cylinder and piston along the leg. With the
efforts of the drives they are added up, except where screws turn with their legs
(``turning_screws``): drives act with the rows of J_q there, end stops with those of J_inv, as a
wrench on the platform.

The step is short enough for friction and end stops, whose modes are the fastest by far. With them
a hexapod is ``M x'' + J^T D J x' + J^T K J x = 0``, with M its mass matrix, J = J_q, D the damping
of the legs (viscous friction, the slope of the Coulomb friction at standstill, the dampers of the
stops) and K the springs of the stops. A mode exp(s t) obeys s^2 + d s + k = 0 with Rayleigh
quotients d and k, which are no larger than the largest eigenvalues of D and of K relative to M. So
|s| is at most the larger of d and sqrt(k) made of these, and h is chosen so that h |s| <= 1. Near
a dead centre rows of J and with them M grow without a bound, but M grows with J: the eigenvalues
relative to it are those of the drives, D and K by the inertia of a drive, and stay.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, NO_WRENCH, Six
from stewart_dynamics.core.binding import CONSTANTS, function, record, Sample
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics import batch
from stewart_dynamics.mechanics.drives.motors import motor_ratio
from stewart_dynamics.mechanics.dynamics.friction import Friction
from stewart_dynamics.mechanics.frames.rotation import from_euler, to_quaternion
from stewart_dynamics.mechanics.hexapod_structure import hexapod_structure
from stewart_dynamics.mechanics.limits import Limits
from stewart_dynamics.parameters.table import inertia_matrix, Parameters
from stewart_dynamics.simulator.end_stops import stiffness_and_damping, stop_limits, stops_of
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters, TORQUE

# The Runge-Kutta method is stable for all modes s with |h s| below 2.6 that do not grow by
# themselves; up to 1 their error is small as well, with a margin for nonlinear terms.
_REACH = 1.0
_MOST_SUBSTEPS = 1000


def substeps(parameters: SimulatorParameters) -> int:
    """
    Return into how many parts the step of the parameters must be divided.

    Raises ParameterError if they would be too many, with the parameter that is too large.
    """
    step = parameters.step
    with np.errstate(all='ignore'):
        friction = Friction.of(parameters)
        viscous = friction.viscous
        coulomb = friction.slope(friction.coulomb + screw_friction(parameters))
        stiffness, damping = stiffness_and_damping(parameters)
        loads = parameters.leg_kind.stop_loads(parameters)
        of_dampers = damping * loads.at_drives, damping * loads.at_joints
        of_springs = stiffness * loads.at_drives, stiffness * loads.at_joints
        fastest = max(
            largest_eigenvalue(parameters, viscous + coulomb + of_dampers[0], of_dampers[1]),
            math.sqrt(largest_eigenvalue(parameters, *of_springs)))
        parts = float(step * fastest / _REACH)
        if parts <= _MOST_SUBSTEPS:
            return max(1, math.ceil(parts))
        # Up to critical damping, the damping is in proportion to the frequency.
        ratio = parameters.end_stops.damping_ratio
        of_each = {
            'actuator.viscous_friction': largest_eigenvalue(parameters, viscous),
            'actuator.coulomb_friction': largest_eigenvalue(parameters, coulomb),
            'end_stops.frequency': math.sqrt(largest_eigenvalue(parameters, *of_springs)),
            'end_stops.damping_ratio' if ratio > 1.0 else 'end_stops.frequency':
                largest_eigenvalue(parameters, *of_dampers)}
    name = max(of_each, key=lambda each: of_each[each])
    value = parameters[name]
    text = str(value.tolist() if isinstance(value, np.ndarray) else value)
    if name == 'actuator.coulomb_friction':
        kind = parameters.leg_kind
        text += (f' {kind.effort.unit} within actuator.coulomb_velocity '
                 f'{friction.coulomb_velocity.tolist()} {kind.rate.unit}')
    raise ParameterError(
        f'{name}: {text}: too large for a '
        f'platform of {parameters.carried.mass:g} kg: the integration would need steps of '
        f'{_REACH / fastest:.2g} s, the shortest possible are {step / _MOST_SUBSTEPS:.2g} s')


def screw_friction(parameters: SimulatorParameters) -> Array:
    """Return the largest losses in screws or gears (6,) as efforts, where commands are torques."""
    if parameters.commands != TORQUE:
        return np.zeros(6)
    _, largest = parameters.leg_kind.stop_loads(parameters).levers
    weight = parameters.carried.mass * np.linalg.norm(parameters.gravity) * largest
    most = parameters.drive.torque_max
    loads = weight if most is None else most * motor_ratio(parameters)
    losses: Array = loads * (1.0 / parameters.drive.efficiency - 1.0)
    return losses


def largest_eigenvalue(parameters: Parameters, of_drives: Array, of_joints: Array | None = None,
                       ) -> float:
    """
    Return a bound, in every pose, of the largest eigenvalue of J^T diag(of_drives) J against M.

    A force along leg i moves the platform's joint along the leg by no more than
    1 / m + |p_i - c|^2 / I_min, of the platform alone, times the force; the sum of these
    products is the trace of a matrix with these eigenvalues. The inertias of the drives in series
    give another bound; the masses of the legs would only make it smaller. ``of_drives`` (6,) are
    dampings or stiffnesses of the drives, ``of_joints`` (6,) more of them [N s/m, N/m], in any
    directions at the platform joints.
    """
    loads = parameters.leg_kind.stop_loads(parameters)
    arms = parameters.geometry.platform_joints - parameters.carried.center
    smallest = np.linalg.eigvalsh(inertia_matrix(parameters.carried.inertia))[0]
    mobility = 1.0 / parameters.carried.mass + np.sum(arms ** 2, axis=-1) / smallest
    having, found = of_drives > 0.0, 0.0
    if having.any():
        by_drives = np.min(loads.inertia[having] / of_drives[having])
        found = 1.0 / (by_drives + 1.0 / (of_drives @ (mobility / loads.levers[0] ** 2)))
    return float(found if of_joints is None else found + of_joints @ mobility)


# In one step the platform may turn by at most this [rad], a platform joint move by at most this
# part of its leg's length, and a lever change by at most this part of itself: a larger move would
# not be resolved.
LARGEST_MOVE = CONSTANTS['LARGEST_MOVE']


class PlantState(NamedTuple):
    """The hexapod at the end of a period."""

    positions: Six  # of the drives: lengths [m], angles [rad]
    rates: Six  # [m/s, rad/s]
    efforts: Six
    """Of the drives, without end stops [N, N m]: the commands as they saturated; under torques of
    motors the efforts at the end of the period."""
    pose: tuple[float, ...]
    """Position and quaternion x y z w of the platform frame in the base frame."""
    twist: Six  # base axes [m/s, rad/s]
    acceleration: Six  # base axes [m/s^2, rad/s^2]
    motors: MotorState | tuple[()] = ()
    """Empty without ``drive.*``."""


class MotorState(NamedTuple):
    """The motors at the end of a period."""

    angles: Six  # [rad]
    speeds: Six  # [rad/s]
    torques: Six  # [N m]


class Plant:
    """
    The hexapod of given parameters, in motion from its initial pose; brakes hold it there first.

    Where a step cannot be computed, because numbers overflow, a leg is so short that one step
    could reverse it, or its lever so small that one step could pass a dead centre, the hexapod is
    held at rest in the last pose that could be, permanently: ``fault`` states it.

    Raises ParameterError if the initial pose exceeds a limit with an end stop or is out of reach,
    or friction or end stops would need too short steps.
    """

    def __init__(self, parameters: SimulatorParameters) -> None:
        self.parameters = parameters
        self.substeps = substeps(parameters)
        """Steps that are taken within one of the parameter's length."""
        self.fault = ''  # why it is held at rest permanently; empty while it is not
        period = 1.0 / parameters.rate
        self.steps = round(period / parameters.step) * self.substeps  # steps in a period
        self._step = period / self.steps
        self._limits = Limits(parameters)
        self._sample = Sample(
            'one_plant', 'by_torques', 'positions', 'rates', 'efforts', 'state.position',
            'state.quaternion', 'state.twist', 'acceleration', 'lever_ratios', 'sound',
            'motors.angles', 'motors.speeds', 'motors.commands')
        plant = self._sample.numbers.view(record('one_plant'))
        self._plant = plant[0]
        self._driven = bool(parameters.drives)
        plant['by_torques'] = parameters.commands == TORQUE
        plant['step'] = self._step
        plant['stops'], plant['effort_max'] = stops_of(parameters), self._limits.force_max
        self._sample['bases'][:] = math.nan
        pose = parameters.initial_pose
        plant['state']['position'] = pose[:3]
        plant['state']['quaternion'] = to_quaternion(from_euler(pose[3:]))
        self._hexapod = hexapod_structure(parameters)
        self._take_steps = function('plant_advance').bound(self._hexapod, plant)
        self.state = self._run(0)._replace(acceleration=NO_WRENCH)  # the present one
        self._check_initial_pose()
        kind = parameters.leg_kind
        self._deviations = np.repeat([
            parameters[f'noise.{each.name}'] for each in (kind.position, kind.rate, kind.effort)],
            6)
        self._noise = np.random.default_rng(np.float64(parameters.noise.seed).view(np.uint64))

    def advance(self, commands: Six, wrench: Six, base: Array | None = None) -> PlantState:
        """
        Return the state one period later.

        Commands are efforts of the drives: forces [N], + pushes, that saturate at
        limits.force_max, or torques [N m] that saturate at limits.torque_max; or torques of the
        motors [N m] that saturate at drive.torque_max and drive.torque_speed. The
        wrench acts on the platform at its origin, base axes [N, N m]. ``base`` (3, BASE) are rows
        of its motion at begin, middle and end of the period; by default it is still.
        """
        if not self.fault:
            self._plant['commands'], self._plant['wrench'] = commands, wrench
            self._sample['bases'][:] = math.nan if base is None else base.ravel()
            self.state = self._run(self.steps)
        return self.state

    def brake(self) -> PlantState:
        """Return the state at rest in the present pose: the brakes take all speed at once."""
        if not self.fault:
            self._sample['state.twist'][:] = 0.0
            self._plant['commands'] = self._plant['wrench'] = 0.0
            self._sample['bases'][:] = math.nan
            self.state = self._run(0)._replace(acceleration=NO_WRENCH)
        return self.state

    def measured(self) -> PlantState:
        """
        Return the present state as it is measured: noise on positions, rates and efforts.

        The noise is another in each call; pose, twist and acceleration are true.
        """
        state = self.state
        if not self._deviations.any():
            return state
        numbers: Any = tuple((
            state.positions + state.rates + state.efforts
            + self._deviations * self._noise.standard_normal(18)).tolist())
        return state._replace(positions=numbers[:6], rates=numbers[6:12], efforts=numbers[12:])

    def _run(self, steps: int) -> PlantState:
        self._plant['steps'] = steps
        self._take_steps()
        (positions, rates, efforts, position, quaternion, twist, acceleration, ratios, sound,
         *of_motors) = self._sample.read()
        if not sound:
            kind, joints = self.parameters.leg_kind, self.parameters.joints
            self.fault = (
                f'held at rest permanently: after position {list(position)} m the '
                'motion cannot be computed: numbers overflow, or within a step of '
                f'{self._step:.3g} s the platform turns by more than {LARGEST_MOVE} rad or '
                f'{kind.resolved}; {kind.nearest_fault(joints, positions, ratios)}')
        return PlantState(
            positions, rates, efforts, position + quaternion, twist, acceleration,
            MotorState(*of_motors) if self._driven else ())

    def _check_initial_pose(self) -> None:
        """Raise ParameterError where the hexapod does not fit between its end stops."""
        pose, joints = self.parameters.initial_pose.tolist(), self.parameters.joints
        state = self._plant['state']
        distances = batch.missing_distances(self._hexapod, np.concatenate([
            state['position'], from_euler(self.parameters.initial_pose[3:]).ravel()]))
        if (distances > 0.0).any():
            raise ParameterError(f'initial_pose: {pose}: {batch.unreached(joints, distances)}')
        if self.fault:
            raise ParameterError(
                f'initial_pose: {pose}: a leg would have no length, or one that overflows')
        low, high, least = stop_limits(self.parameters)
        for exceedance in self._limits.exceeded({
                low: self.state.positions, high: self.state.positions,
                least: self._plant['lever_ratios'].tolist()}):
            raise ParameterError(f'initial_pose: {pose}: {exceedance.words(joints)}')
