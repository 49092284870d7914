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
The plant: the machine as it moves under leg forces, integrated at a fixed step.

A platform that falls, friction, end stops that the legs run into, actuators that saturate: what
``stewart_simulator`` puts in the place of hardware. It knows no ROS; the same commands give the
same bits.

The method is the classical Runge-Kutta one of the fourth order, on position, quaternion and
twist; the quaternion is brought back to unit length behind every step, which leaves the order as
it is (Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., IV.4, doi:10.1007/
3-540-30666-8). Forces and load are constant within a period, so that the work of a leg force is
that force times the change of its leg's length, exactly, and a balance of energy shows nothing
but the error of the method.
"""

from __future__ import annotations

from collections.abc import Iterator
import math
from operator import sub
from struct import Struct
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Six
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.forward_dynamics import acceleration, WORK
from stewart_dynamics.mechanics.jit import compiled, entry_point, inlined
from stewart_dynamics.mechanics.kernel import COULOMB_RATE, leg_line
from stewart_dynamics.mechanics.rotation import from_euler, from_quaternion, to_quaternion
from stewart_dynamics.mechanics.rows import MOTION
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.mechanics.vectors import add, cross, dot, Matrix3, scale, Vector3
from stewart_dynamics.messages.joint_state import JointStateWriter
from stewart_dynamics.messages.setpoint import StampedWriter
from stewart_dynamics.parameters import inertia_matrix
from stewart_dynamics.runtime.simulator_parameters import SimulatorParameters

# Under the node's name; those that it publishes in their order.
INPUT_TYPES = {
    'commands': 'std_msgs/msg/Float64MultiArray',
    'wrench': 'geometry_msgs/msg/WrenchStamped',
}
OUTPUT_TYPES = {
    'leg_states': 'sensor_msgs/msg/JointState',
    'pose': 'geometry_msgs/msg/PoseStamped',
    'twist': 'geometry_msgs/msg/TwistStamped',
    'accel': 'geometry_msgs/msg/AccelStamped',
}

# A leg that is so much beyond its stop stands on it [m]: a pose has no more digits than that.
_ON_STOP = 1e-9

# The state: position, quaternion x y z w, linear and angular velocity, base axes.
_QUATERNION = 3
_TWIST = 7
_STATE = 13
# What is written beside it: lengths, rates, forces of the actuators, accelerations, whether it
# could be integrated.
_RATES = 6
_FORCES = 12
_ACCELERATION = 18
_SOUND = 24
_RESULT = 25
_NUMBERS = Struct(f'{_STATE + _RESULT}d')
# What is known of the legs, six numbers of each.
_SHORTEST, _LONGEST, _STIFFNESS, _DAMPING, _STRONGEST, _LEGS = range(0, 36, 6)

# The Runge-Kutta method is stable for all modes s with |h s| below 2.6 that do not grow by
# themselves; within 1 their error is small as well, and there is room for what is not linear.
_REACH = 1.0
_MOST_SUBSTEPS = 1000
# The platform may turn by no more than this [rad] in a step, and a platform joint move by no more
# than this part of its leg's length: the step would be blind to what happens in between.
_LARGEST_MOVE = 0.5

_REST: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

_matrix = inlined(from_quaternion)


class State(NamedTuple):
    """The machine at the end of a period."""

    lengths: Six
    """[m]"""
    rates: Six
    """[m/s]"""
    forces: Six
    """Of the actuators in the period: the commands as they saturated, no stops [N]."""
    pose: tuple[float, ...]
    """Position and quaternion x y z w of the platform frame in the base frame."""
    twist: Six
    """Base axes [m/s, rad/s]."""
    acceleration: Six
    """Base axes [m/s^2, rad/s^2]."""


@inlined
def _vector3(numbers: Array, at: int) -> Vector3:
    return numbers[at], numbers[at + 1], numbers[at + 2]


@inlined
def _rotation(state: Array) -> Matrix3:
    """Return R of the quaternion, which between two steps is not of unit length."""
    x, y, z, w = (state[_QUATERNION], state[_QUATERNION + 1], state[_QUATERNION + 2],
                  state[_QUATERNION + 3])
    k = 1.0 / math.sqrt(x * x + y * y + z * z + w * w)
    return _matrix(k * x, k * y, k * z, k * w)


@inlined
def _stop(legs: Array, leg: int, length: float, rate: float) -> float:
    """
    Return the force of a leg's end stops [N]: a spring and a damper that only push back.

    Kelvin and Voigt's, without the pull that its damper alone would have as the leg leaves.
    """
    stiffness, damping = legs[_STIFFNESS + leg], legs[_DAMPING + leg]
    too_short = legs[_SHORTEST + leg] - length
    too_long = length - legs[_LONGEST + leg]
    if too_short > 0.0:
        return float(max(0.0, stiffness * too_short - damping * rate))
    if too_long > 0.0:
        return float(-max(0.0, stiffness * too_long + damping * rate))
    return 0.0


@compiled
def _slope(machine: Array, legs: Array, state: Array, loads: Array, motion: Array,
           forces: Array, work: Array, slope: Array) -> None:
    """Write a state's time derivative under its loads; motion, forces and work are memory."""
    position, velocity, omega = (
        _vector3(state, 0), _vector3(state, _TWIST), _vector3(state, _TWIST + 3))
    rotation = _rotation(state)
    for n in range(3):
        motion[n] = state[n]
    for n in range(9):
        motion[3 + n] = rotation[n]
    for n in range(6):
        motion[12 + n] = state[_TWIST + n]
    for leg in range(6):
        a, length, _, s = leg_line(machine, leg, position, rotation)
        rate = dot(s, add(velocity, cross(omega, a)))
        forces[leg] = loads[leg] + _stop(legs, leg, length, rate)
    acceleration(machine, motion, forces, loads[6:], work)
    vector, scalar = _vector3(state, _QUATERNION), state[_QUATERNION + 3]
    turning = add(scale(scalar, omega), cross(omega, vector))
    for n in range(3):
        slope[n] = velocity[n]
        slope[_QUATERNION + n] = 0.5 * turning[n]
    slope[_QUATERNION + 3] = -0.5 * dot(omega, vector)
    for n in range(6):
        slope[_TWIST + n] = motion[18 + n]


@compiled
def _legs_of(machine: Array, state: Array, result: Array) -> float:
    """Write lengths and rates, and return the fastest turning, or move beside a leg's length."""
    position, velocity, omega = (
        _vector3(state, 0), _vector3(state, _TWIST), _vector3(state, _TWIST + 3))
    rotation = _rotation(state)
    fastest = math.sqrt(dot(omega, omega))
    for leg in range(6):
        a, length, inverse_length, s = leg_line(machine, leg, position, rotation)
        joint_velocity = add(velocity, cross(omega, a))
        moving = inverse_length * math.sqrt(dot(joint_velocity, joint_velocity))
        result[leg] = length
        result[_RATES + leg] = dot(s, joint_velocity)
        fastest = max(fastest, moving) if 0.0 < length < math.inf else math.inf
    return fastest


@entry_point
def _advance(machine: Array, legs: Array, loads: Array, state: Array, result: Array,
             steps: int, h: float) -> None:
    """
    Take steps of h [s] and write the state and, beside it, the result.

    Parameters
    ----------
    machine : (MACHINE,)
        The machine's numbers as ``inverse_dynamics`` has them.
    legs : (36,)
        Shortest and longest length, stiffness and damping of the stops, strongest force.
    loads : (12,)
        Six commands, force and moment on the platform; the commands are clipped in place.
    state : (13,)
        Where it begins, and then where it ends: in the last state that was sound, with its
        twist taken away, where a step cannot be computed.
    result : (25,)
        Written.
    steps, h
        How many, and how long.

    """
    motion, forces, work = np.empty(MOTION), np.empty(6), np.empty(WORK)
    stage, slope, mean = np.empty(_STATE), np.empty(_STATE), np.empty(_STATE)
    for leg in range(6):
        most = legs[_STRONGEST + leg]
        loads[leg] = min(max(loads[leg], -most), most)
        result[_FORCES + leg] = loads[leg]
    sound = h * _legs_of(machine, state, result) <= _LARGEST_MOVE
    for _step in range(steps):
        _slope(machine, legs, state, loads, motion, forces, work, slope)
        for n in range(_STATE):
            mean[n] = slope[n]
            stage[n] = state[n] + 0.5 * h * slope[n]
        _slope(machine, legs, stage, loads, motion, forces, work, slope)
        for n in range(_STATE):
            mean[n] += 2.0 * slope[n]
            stage[n] = state[n] + 0.5 * h * slope[n]
        _slope(machine, legs, stage, loads, motion, forces, work, slope)
        for n in range(_STATE):
            mean[n] += 2.0 * slope[n]
            stage[n] = state[n] + h * slope[n]
        _slope(machine, legs, stage, loads, motion, forces, work, slope)
        square = 0.0
        for n in range(_STATE):
            stage[n] = state[n] + h / 6.0 * (mean[n] + slope[n])
            sound = sound and math.isfinite(stage[n])
            square += stage[n] * stage[n] if _QUATERNION <= n < _TWIST else 0.0
        for n in range(_QUATERNION, _TWIST):
            stage[n] /= math.sqrt(square)
        sound = sound and h * _legs_of(machine, stage, result) <= _LARGEST_MOVE
        if not sound:
            break
        for n in range(_STATE):
            state[n] = stage[n]
    _slope(machine, legs, state, loads, motion, forces, work, slope)
    for n in range(6):
        sound = sound and math.isfinite(slope[_TWIST + n])
    for n in range(6):
        if not sound:
            state[_TWIST + n] = 0.0
            result[_FORCES + n] = 0.0
        result[_ACCELERATION + n] = slope[_TWIST + n] if sound else 0.0
    _legs_of(machine, state, result)
    result[_SOUND] = 1.0 if sound else 0.0


class Plant:
    """
    The machine of given parameters, in motion from its initial pose, held there at first.

    Where a step cannot be computed, because numbers overflow or a leg has so little length that
    one step could turn it round, the machine is held at rest in the last pose that could be, for
    good: ``fault`` says so.

    Steps are divided until none is too long for what friction and end stops do, the fastest by
    far of what happens here. Beside them a machine is ``M x'' + J^T D J x' + J^T K J x = 0``,
    with M its mass, D what damps the legs (viscous friction, the slope of the Coulomb friction
    below 1 mm/s, the dampers of the stops) and K the springs of the stops. A mode exp(s t) of it
    obeys s^2 + d s + k = 0 with Rayleigh quotients d and k, which are no larger than the largest
    eigenvalues of D and of K against M. So no |s| is larger than the larger of d and sqrt(k)
    made of these, and h is so short that h |s| <= 1. ``_largest`` bounds both in all poses.

    Parameters
    ----------
    parameters : SimulatorParameters
        ParameterError says which is wrong: an initial pose beyond the end stops, or friction or
        end stops that would need too short steps.

    """

    def __init__(self, parameters: SimulatorParameters) -> None:
        self.parameters = parameters
        self.substeps = _substeps(parameters)
        """Steps that are taken within one of the parameter's length."""
        self.fault = ''
        """Why it is held at rest for good; empty while all is well."""
        period = 1.0 / parameters['rate']
        self.steps = round(period / parameters['step']) * self.substeps
        """Steps in a period."""
        self._step = period / self.steps
        self._machine = StewartPlatform(parameters).machine
        self._legs = _of_legs(parameters)
        self._loads = np.zeros(12)
        numbers = np.zeros(_STATE + _RESULT)
        self._memory = numbers.data  # the same as bytes
        self._state, self._result = numbers[:_STATE], numbers[_STATE:]
        pose = parameters['initial_pose']
        self._state[:_QUATERNION] = pose[:3]
        self._state[_QUATERNION:_TWIST] = to_quaternion(from_euler(pose[3:]))
        self.state = self._run(0)._replace(acceleration=_REST)
        """The present one."""
        self._check_lengths()
        self._zero_lengths = parameters['geometry.zero_length'].tolist()
        self._deviations = np.repeat([
            parameters['noise.length'], parameters['noise.rate'], parameters['noise.force']], 6)
        self._noise = np.random.default_rng(np.float64(parameters['noise.seed']).view(np.uint64))
        frame = parameters['base_frame']
        self._joint_state = JointStateWriter(parameters['joints'])
        self._pose, self._six = StampedWriter(frame, 7), StampedWriter(frame, 6)

    def advance(self, commands: Six, wrench: Six) -> State:
        """
        Return the state one period later.

        Parameters
        ----------
        commands : six numbers
            Forces of the actuators [N], + pushes; they saturate at limits.force_max.
        wrench : six numbers
            Load on the platform at its origin, base axes [N, N m].

        """
        if not self.fault:
            self._loads[:] = commands + wrench
            self.state = self._run(self.steps)
        return self.state

    def messages(self, stamp: int) -> Iterator[tuple[str, bytes]]:
        """
        Yield topics (keys of OUTPUT_TYPES) and messages to publish for the present state.

        Noise is on what sensors would measure, the leg states, and another one in each call;
        pose, twist and acceleration are true.
        """
        state = self.state
        lengths, rates, forces = state.lengths, state.rates, state.forces
        if self._deviations.any():
            measured = (lengths + rates + forces
                        + self._deviations * self._noise.standard_normal(18)).tolist()
            lengths, rates, forces = measured[0:6], measured[6:12], measured[12:18]
        yield 'leg_states', self._joint_state.write(
            stamp, map(sub, lengths, self._zero_lengths), rates, forces)
        yield 'pose', self._pose.write(stamp, state.pose)
        yield 'twist', self._six.write(stamp, state.twist)
        yield 'accel', self._six.write(stamp, state.acceleration)

    def _run(self, steps: int) -> State:
        _advance(self._machine, self._legs, self._loads, self._state, self._result, steps,
                 self._step)
        numbers = _NUMBERS.unpack_from(self._memory)
        result = numbers[_STATE:]
        if not result[_SOUND]:
            self.fault = (
                f'held at rest, for good: beyond the pose at {list(numbers[:_QUATERNION])} m its '
                f'motion cannot be computed: numbers overflow, or in a step of {self._step:.3g} s '
                f'it turns by more than {_LARGEST_MOVE} rad or moves by more than that part of '
                f'a leg; shortest leg {min(result[:_RATES]):.3g} m')
        return State(
            result[:_RATES], result[_RATES:_FORCES], result[_FORCES:_ACCELERATION],
            numbers[:_TWIST], numbers[_TWIST:_STATE], result[_ACCELERATION:_SOUND])

    def _check_lengths(self) -> None:
        """Raise ParameterError where the machine does not fit between its end stops."""
        pose = self.parameters['initial_pose'].tolist()
        if self.fault:
            raise ParameterError(f'initial_pose: {pose}: a leg would have no length there, or one '
                                 'that overflows')
        for leg, length in enumerate(self.state.lengths):
            name = self.parameters['joints'][leg]
            for limit, at, sign in (('limits.length_min', _SHORTEST, -1.0),
                                    ('limits.length_max', _LONGEST, 1.0)):
                bound = self._legs[at + leg]
                if sign * (length - bound) > 0.0:
                    raise ParameterError(f'initial_pose: {pose}: {name} would have a length of '
                                         f'{length:.6g} m, beyond {limit}, {bound:g} m')


def _of_legs(p: SimulatorParameters) -> Array:
    """Return the numbers of the legs (36,) as the integration takes them."""
    legs = np.zeros(_LEGS)
    for at, limit, never in ((_SHORTEST, 'limits.length_min', -math.inf),
                             (_LONGEST, 'limits.length_max', math.inf),
                             (_STRONGEST, 'limits.force_max', math.inf)):
        legs[at:at + 6] = never if p[limit] is None else p[limit]
    legs[_STIFFNESS:_DAMPING], legs[_DAMPING:_STRONGEST] = _end_stops(p)
    return legs


def _end_stops(p: SimulatorParameters) -> tuple[Array, Array]:
    """Return stiffness [N/m] and damping [N s/m] of the legs' end stops, each (6,)."""
    carried = ((p['platform.mass'] + np.sum(p['legs.piston.mass'])) / 6.0
               + p['actuator.reflected_mass'])
    if p['limits.length_min'] is None and p['limits.length_max'] is None:
        carried = np.zeros(6)  # there are none
    omega = 2.0 * np.pi * p['end_stops.frequency']
    return carried * omega ** 2, carried * 2.0 * p['end_stops.damping_ratio'] * omega


def _largest(p: SimulatorParameters, of_legs: Array) -> float:
    """
    Return a bound of the largest eigenvalue of what each leg has (6,) against the mass.

    It holds in every pose. A force along leg i moves the platform's joint along it by no more
    than 1 / m + |p_i - c|^2 / I_min, the platform alone, times the force; the sum of these times
    what the legs have is the trace of a matrix that has these eigenvalues. The reflected masses
    in series bound it anew, the masses of the legs would only make it smaller.
    """
    arms = p['geometry.platform_joints'] - p['platform.center_of_mass']
    smallest = np.linalg.eigvalsh(inertia_matrix(p['platform.inertia']))[0]
    mobility = 1.0 / p['platform.mass'] + np.sum(arms ** 2, axis=-1) / smallest
    having = of_legs > 0.0
    if not having.any():
        return 0.0
    by_actuators = np.min(p['actuator.reflected_mass'][having] / of_legs[having])
    return float(1.0 / (by_actuators + 1.0 / (of_legs @ mobility)))


def _substeps(p: SimulatorParameters) -> int:
    """Return how many parts a step needs; ParameterError names what needs too many."""
    with np.errstate(all='ignore'):
        viscous = p['actuator.viscous_friction']
        coulomb = p['actuator.coulomb_friction'] / COULOMB_RATE
        stiffness, damping = _end_stops(p)
        fastest = max(_largest(p, viscous + coulomb + damping),
                      math.sqrt(_largest(p, stiffness)))
        parts = float(p['step'] * fastest / _REACH)
        if parts <= _MOST_SUBSTEPS:
            return max(1, math.ceil(parts))
        # At most critical, the damping is in proportion to the frequency.
        ratio = p['end_stops.damping_ratio']
        of_each = {
            'actuator.viscous_friction': _largest(p, viscous),
            'actuator.coulomb_friction': _largest(p, coulomb),
            'end_stops.frequency': math.sqrt(_largest(p, stiffness)),
            'end_stops.damping_ratio' if ratio > 1.0 else 'end_stops.frequency':
                _largest(p, damping)}
    name = max(of_each, key=lambda each: of_each[each])
    value = p[name].tolist() if isinstance(p[name], np.ndarray) else p[name]
    raise ParameterError(
        f'{name}: {value}: too large for a platform of {p["platform.mass"]:g} kg: the integration '
        f'would need steps of {_REACH / fastest:.2g} s, at least {p["step"] / _MOST_SUBSTEPS:.2g} '
        's can be had')
