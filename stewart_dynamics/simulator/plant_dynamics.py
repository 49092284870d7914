# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The motion of the platform under leg forces or motor torques, integrated at a fixed step; compiled.

The method is the classical Runge-Kutta method of fourth order, on position, quaternion and twist.
After every step the quaternion is divided by its length, which keeps the order (Hairer, Lubich,
Wanner, Geometric Numerical Integration, 2nd ed., IV.4, doi:10.1007/3-540-30666-8). Forces and
wrench are constant within a call, so that the work of a leg force is the force times the change
of its drive's coordinate, exactly, and an energy balance shows the error of the method alone. The
motion of the base is given at begin, middle and end of a call, which are the stages of the method
where a call is one step; with more steps it is the parabola through them.

The load of a screw is (k torque - m_r q'') / c, see ``drives.motors``: under a torque a leg has
the force k torque / c and the reflected mass m_r / c. c depends on the direction of the power,
which is assumed, and assumed again where the load that follows contradicts it.

End stops act between cylinder and piston, along the leg. With the forces of the drives they are
added up, except where screws turn with their legs (``drives.screws``): drives act with the rows of
J_q there, end stops with those of J_inv, as a wrench on the platform.
"""

from __future__ import annotations

import math

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import compiled, entry_point, inlined
from stewart_dynamics.mechanics.drives.motors import (
    clipped, COMMANDS as OF_MOTORS, curve_torque, motor_motion, MOTORS, put_motors, ratio_and_mass,
    SPEEDS, torque_factor)
from stewart_dynamics.mechanics.dynamics.base_load import moves
from stewart_dynamics.mechanics.dynamics.bodies import leg_line
from stewart_dynamics.mechanics.dynamics.forward_dynamics import acceleration
from stewart_dynamics.mechanics.dynamics.hexapod_constants import (
    CONSTANTS, put_reflected_mass, screws_turn)
from stewart_dynamics.mechanics.frames.rotation import from_quaternion
from stewart_dynamics.mechanics.rows import (
    ACCELERATION, BASE, consecutive, MOTION, POSITION, ROTATION, TWIST)
from stewart_dynamics.mechanics.vectors import (
    add, cross, dot, Matrix3, norm, read3, scale, Vector3)
from stewart_dynamics.simulator.end_stops import stop_force


# Scratch memory of ``torque_acceleration``: constants with other reflected masses, forces, assumed
# directions of the power, and factors c.
_CHANGED, _PUSHES, _POWER, _FACTOR = consecutive(CONSTANTS, 6, 6, 6)

# Solutions until one is taken as it is; one or two are enough but where loads are near zero.
_MOST_ATTEMPTS = 64
# From this one on a single direction is changed at a time, which ends for every hexapod.
_CAREFUL = 8


@compiled
def _torque_acceleration(
        constants: Array, drives: Array, torque_max: Array, curve: Array, motion: Array,
        torques: Array, others: Array, wrench: Array, base: Array, work: Array, scratch: Array,
        forces: Array) -> None:
    """
    Write the acceleration of a motion under motor torques, and the forces of the legs.

    constants, motion, wrench, base, work: as in ``forward_dynamics.acceleration``.
    drives, torque_max, curve: as in ``motor_rows``; torques are clipped in place to those
        available.
    torques (6,): [N m], + extends.
    others (6,): forces along the legs that do not pass through their screws [N].
    scratch (_FACTOR.stop,): scratch memory.
    forces (6,): written: forces of the legs as ``inverse_dynamics`` has them [N].
    """
    changed, pushes = scratch[_CHANGED], scratch[_PUSHES]
    power, factor = scratch[_POWER], scratch[_FACTOR]
    for n in range(CONSTANTS):
        changed[n] = constants[n]
    for n in range(6):
        motion[ACCELERATION.start + n] = 0.0
    for leg in range(6):
        _, speed, _, rate, _ = motor_motion(constants, drives[leg], leg, motion)
        torques[leg] = clipped(torques[leg], min(torque_max[leg], curve_torque(curve, speed)))
        power[leg] = torques[leg] * rate
    for attempt in range(_MOST_ATTEMPTS):
        for leg in range(6):
            ratio, mass = ratio_and_mass(drives[leg])
            _, _, _, rate, _ = motor_motion(constants, drives[leg], leg, motion)
            factor[leg] = torque_factor(drives[leg], power[leg], rate)
            put_reflected_mass(changed, leg, mass / factor[leg])
            pushes[leg] = ratio * torques[leg] / factor[leg] + others[leg]
        acceleration(changed, motion, pushes, wrench, base, work)
        settled = True
        for leg in range(6):
            ratio, mass = ratio_and_mass(drives[leg])
            _, _, _, rate, acc = motor_motion(constants, drives[leg], leg, motion)
            load = (ratio * torques[leg] - mass * acc) / factor[leg]
            forces[leg] = load + mass * acc
            if (load * rate > 0.0) != (power[leg] > 0.0) and (
                    settled or attempt < _CAREFUL):
                power[leg] = load * rate
                settled = False
        if settled:
            break


# The state: position, quaternion x y z w, linear and angular velocity, base axes.
STATE_POSITION, STATE_QUATERNION, STATE_TWIST = consecutive(3, 4, 6)
STATE = STATE_TWIST.stop
_LINEAR, _ANGULAR = STATE_TWIST.start, STATE_TWIST.start + 3
# The result: lengths, rates, forces of the actuators, acceleration, and whether all steps could be
# computed.
RESULT_LENGTHS, RESULT_RATES, RESULT_FORCES, RESULT_ACCELERATION = consecutive(6, 6, 6, 6)
RESULT_SOUND = RESULT_ACCELERATION.stop
# A row of motors, the commands as they saturated; zero without drives.
RESULT_MOTORS = slice(RESULT_SOUND + 1, RESULT_SOUND + 1 + MOTORS)
RESULT = RESULT_MOTORS.stop
# Six commands, the wrench on the platform, and rows of the base's motion at begin, middle and end.
COMMANDS, WRENCH, BASE_BEGIN, BASE_MIDDLE, BASE_END = consecutive(6, 6, BASE, BASE, BASE)
LOADS = BASE_END.stop
# Scratch memory.
_MOTION, _FORCES, _AFTER, _SLOPE, _MEAN, _BASE, _STOPS, _TORQUES, _LOAD, _DRIVES = consecutive(
    MOTION, 6, STATE, STATE, STATE, BASE, 6, 6, 6, _FACTOR.stop)
SCRATCH = _DRIVES.stop

# In one step the platform may turn by at most this [rad], and a platform joint move by at most
# this part of its leg's length: a larger move would not be resolved.
LARGEST_MOVE = 0.5

_matrix = inlined(from_quaternion)


@inlined
def _rotation(state: Array) -> Matrix3:
    """Return R of the quaternion, which within a step is not of unit length."""
    at = STATE_QUATERNION.start
    x, y, z, w = state[at], state[at + 1], state[at + 2], state[at + 3]
    k = 1.0 / math.sqrt(x * x + y * y + z * z + w * w)
    return _matrix(k * x, k * y, k * z, k * w)


@inlined
def _twist(state: Array) -> tuple[Vector3, Vector3]:
    return read3(state, _LINEAR), read3(state, _ANGULAR)


@inlined
def _move_base(loads: Array, part: float, base: Array) -> None:
    """Write the base's motion after a part of the call, between 0 and 1."""
    if not moves(loads[BASE_BEGIN]):
        return
    begin, middle, end = ((1.0 - part) * (1.0 - 2.0 * part), 4.0 * part * (1.0 - part),
                          part * (2.0 * part - 1.0))
    for n in range(BASE):
        base[n] = (begin * loads[BASE_BEGIN.start + n] + middle * loads[BASE_MIDDLE.start + n]
                   + end * loads[BASE_END.start + n])


@compiled
def _slope(constants: Array, drives: Array, torque_max: Array, curve: Array, by_torques: bool,
           stops: Array, state: Array, loads: Array, base: Array, scratch: Array, work: Array,
           slope: Array) -> None:
    """Write a state's time derivative under its loads and a motion of the base."""
    motion, forces, of_stops = scratch[_MOTION], scratch[_FORCES], scratch[_STOPS]
    torques, load = scratch[_TORQUES], scratch[_LOAD]
    position, rotation = read3(state, STATE_POSITION.start), _rotation(state)
    velocity, omega = _twist(state)
    for n in range(3):
        motion[POSITION.start + n] = position[n]
    for n in range(9):
        motion[ROTATION.start + n] = rotation[n]
    for n in range(6):
        motion[TWIST.start + n] = state[STATE_TWIST.start + n]
        load[n] = loads[WRENCH.start + n]
    by_wrench = screws_turn(constants)
    for leg in range(6):
        a, length, _, s = leg_line(constants, leg, position, rotation)
        rate = dot(s, add(velocity, cross(omega, a)))
        of_stops[leg] = stop_force(stops, leg, length, rate)
        if by_wrench:
            moment = cross(a, s)
            for n in range(3):
                load[n] += of_stops[leg] * s[n]
                load[3 + n] += of_stops[leg] * moment[n]
            of_stops[leg] = 0.0
        torques[leg] = loads[COMMANDS.start + leg]
        forces[leg] = torques[leg] + of_stops[leg]
    if by_torques:
        _torque_acceleration(constants, drives, torque_max, curve, motion, torques, of_stops,
                             load, base, work, scratch[_DRIVES], forces)
    else:
        acceleration(constants, motion, forces, load, base, work)
    at = STATE_QUATERNION.start
    vector, scalar = read3(state, at), state[at + 3]
    turning = add(scale(scalar, omega), cross(omega, vector))
    for n in range(3):
        slope[STATE_POSITION.start + n] = velocity[n]
        slope[at + n] = 0.5 * turning[n]
    slope[at + 3] = -0.5 * dot(omega, vector)
    for n in range(6):
        slope[STATE_TWIST.start + n] = motion[ACCELERATION.start + n]


@compiled
def _write_legs(constants: Array, state: Array, result: Array) -> float:
    """
    Write lengths and rates of the legs.

    Return the largest of the angular speed and the speeds of the platform joints relative to
    their legs' lengths [1/s]; infinite where a leg has no length.
    """
    position, rotation = read3(state, STATE_POSITION.start), _rotation(state)
    velocity, omega = _twist(state)
    fastest = norm(omega)
    for leg in range(6):
        a, length, inverse_length, s = leg_line(constants, leg, position, rotation)
        joint_velocity = add(velocity, cross(omega, a))
        moving = inverse_length * norm(joint_velocity)
        result[RESULT_LENGTHS.start + leg] = length
        result[RESULT_RATES.start + leg] = dot(s, joint_velocity)
        fastest = max(fastest, moving) if 0.0 < length < math.inf else math.inf
    return fastest


@compiled
def _next_state(constants: Array, drives: Array, torque_max: Array, curve: Array, by_torques: bool,
                stops: Array, loads: Array, state: Array, step: int, steps: int, h: float,
                scratch: Array, work: Array) -> bool:
    """
    Write the state after a step of a call to scratch memory; return whether it is finite.

    The motion of the base in scratch memory is that at the begin, and becomes that at the end.
    """
    after, slope, mean, base = scratch[_AFTER], scratch[_SLOPE], scratch[_MEAN], scratch[_BASE]
    _slope(constants, drives, torque_max, curve, by_torques, stops, state, loads, base, scratch,
           work, slope)
    for n in range(STATE):
        mean[n] = slope[n]
        after[n] = state[n] + 0.5 * h * slope[n]
    _move_base(loads, (step + 0.5) / steps, base)
    _slope(constants, drives, torque_max, curve, by_torques, stops, after, loads, base, scratch,
           work, slope)
    for n in range(STATE):
        mean[n] += 2.0 * slope[n]
        after[n] = state[n] + 0.5 * h * slope[n]
    _slope(constants, drives, torque_max, curve, by_torques, stops, after, loads, base, scratch,
           work, slope)
    for n in range(STATE):
        mean[n] += 2.0 * slope[n]
        after[n] = state[n] + h * slope[n]
    _move_base(loads, (step + 1.0) / steps, base)
    _slope(constants, drives, torque_max, curve, by_torques, stops, after, loads, base, scratch,
           work, slope)
    finite = True
    square = 0.0
    for n in range(STATE):
        after[n] = state[n] + h / 6.0 * (mean[n] + slope[n])
        finite = finite and math.isfinite(after[n])
        square += (after[n] * after[n]
                   if STATE_QUATERNION.start <= n < STATE_QUATERNION.stop else 0.0)
    for n in range(STATE_QUATERNION.start, STATE_QUATERNION.stop):
        after[n] /= math.sqrt(square)
    return finite


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[::1]', 'f8[:,::1]', 'b1', 'f8[::1]', 'f8[::1]',
             'f8[::1]', 'f8[::1]', 'f8[::1]', 'i8', 'f8', 'f8[::1]', 'f8[:,::1]')
def advance(constants: Array, drives: Array, torque_max: Array, curve: Array, by_torques: bool,
            stops: Array, largest_forces: Array, loads: Array, state: Array, result: Array,
            steps: int, h: float, scratch: Array, work: Array) -> None:
    """
    Take steps of h [s] and write the state and the result.

    constants (CONSTANTS,): constants of the hexapod, see ``hexapod_constants``.
    drives, torque_max, curve: as in ``motor_rows``; without motors ``drives`` is (0, n).
    by_torques: whether commands are torques of the motors [N m]; else they are forces.
    stops (STOPS,): the end stops, see ``end_stops``.
    largest_forces (6,): to which commanded forces are clipped [N].
    loads (LOADS,): commands, force and moment on the platform [N, N m], rows of the base's motion
        at begin, middle and end of the call, of nan where it is still; forces are clipped in
        place.
    state (STATE,): the initial state, overwritten with the final one. Where a step cannot be
        computed: the last state that could be, at rest.
    result (RESULT,): written.
    steps, h: number of steps, and their length.
    scratch (SCRATCH,), work: scratch memory.
    """
    after, slope, base = scratch[_AFTER], scratch[_SLOPE], scratch[_BASE]
    forces = result[RESULT_FORCES]
    for n in range(BASE):
        base[n] = loads[BASE_BEGIN.start + n]
    for leg in range(6):
        force, most = loads[COMMANDS.start + leg], largest_forces[leg]
        if not by_torques:
            loads[COMMANDS.start + leg] = forces[leg] = min(max(force, -most), most)
    sound = h * _write_legs(constants, state, result) <= LARGEST_MOVE
    for step in range(steps):
        finite = _next_state(constants, drives, torque_max, curve, by_torques, stops, loads,
                             state, step, steps, h, scratch, work)
        sound = (sound and finite
                 and h * _write_legs(constants, after, result) <= LARGEST_MOVE)
        if not sound:
            break
        for n in range(STATE):
            state[n] = after[n]
    _slope(constants, drives, torque_max, curve, by_torques, stops, state, loads, base, scratch,
           work, slope)
    for n in range(6):
        sound = sound and math.isfinite(slope[STATE_TWIST.start + n])
        if by_torques:
            forces[n] = scratch[_FORCES.start + n]
    if len(drives):
        motors = result[RESULT_MOTORS]
        put_motors(constants, drives, torque_max, curve, scratch[_MOTION], forces, forces, motors)
        for n in range(6):
            if by_torques:
                motors[OF_MOTORS.start + n] = scratch[_TORQUES.start + n]
    for n in range(6):
        if not sound:
            state[STATE_TWIST.start + n] = 0.0
            forces[n] = 0.0
            result[RESULT_MOTORS.start + SPEEDS.start + n] = 0.0
            result[RESULT_MOTORS.start + OF_MOTORS.start + n] = 0.0
        result[RESULT_ACCELERATION.start + n] = (
            slope[STATE_TWIST.start + n] if sound else 0.0)
    _write_legs(constants, state, result)
    result[RESULT_SOUND] = 1.0 if sound else 0.0
