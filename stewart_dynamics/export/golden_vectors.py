# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Golden vectors: a motion of a hexapod, and the results of the node's step for it.

The motion begins at the home pose, or where it is likely to be, and swings farther and faster in
all six directions until limits are exceeded; parts of it are on a moving base and under a wrench.
The results are those of the library.
"""

from __future__ import annotations

import math

import numpy as np

from stewart_dynamics.arrays import Array, NANOSECOND
from stewart_dynamics.core.binding import CODES, places
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.mechanics.drives.motors import Drives, MECHANICAL
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.mechanics.hexapod_structure import hexapod_structure
from stewart_dynamics.mechanics.kinematics import forward_kinematics
from stewart_dynamics.mechanics.kinematics.home_pose import homes
from stewart_dynamics.mechanics.rows import BASE, MOTION, POSE, RESULT, WRENCH
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.setpoints.step import (
    Batch, FIRST, MOTOR_COMMANDS, Outputs, RISES, Step)

# Return codes of the C source.
OK, SINGULAR, SUPPRESSED, NO_POSE, NO_MOTORS = (CODES[f'STEWART_{name}'] for name in (
    'OK', 'SINGULAR', 'SUPPRESSED', 'NO_POSE', 'NO_MOTORS'))

_COUNT = 40
_PERIOD = 20_000_000  # of the setpoints [ns]

_XYZ = 'x', 'y', 'z'
_TWIST = [f'{part}_{axis}' for part in ('v', 'w', 'dv', 'dw') for axis in _XYZ]
_POSE = [*_XYZ, *(f'r{row}{column}' for row in _XYZ for column in _XYZ)]


def _legs(name: str) -> list[str]:
    return [f'{name}_{leg}' for leg in range(1, 7)]


# Fields of stewart_result by the names of their columns.
RESULT_COLUMNS = {
    'length': 'lengths', 'rate': 'rates', 'demanded_force': 'forces', 'determinant': 'determinant',
    'determinant_rate': 'determinant_rate', 'condition_number': 'condition_number',
    'unit_load_force': 'unit_load_forces', 'joint_force': 'joint_forces', 'angle': 'angles',
    'speed': 'speeds', 'demanded_torque': 'torques', 'lever': 'levers'}
_PLACES = places('stewart_result')


def parts_of(kind: LegKind) -> dict[str, list[str]]:
    """
    Return the columns of a vector, in parts: the inputs first, then the results.

    Stamp [ns], SI units otherwise, base axes; torques of motors are those of the demanded efforts;
    ``found`` is the pose that the forward kinematics find for the positions of the drives, from
    the last one.
    """
    return {
        'STAMP': ['stamp'],
        'HAS_BASE': ['has_base'],
        'MOTION': [*_POSE, *_TWIST],
        'WRENCH': ['fx', 'fy', 'fz', 'mx', 'my', 'mz'],
        'BASE': [f'base_{part}_{axis}' for part in ('g', 'dv', 'w', 'dw') for axis in _XYZ],
        'CODE': ['code'],
        'RESULT': [column for name in result_columns(kind) for column in (
            _legs(name) if isinstance(_PLACES[RESULT_COLUMNS[name]], slice) else [name])],
        kind.commands.upper(): _legs(kind.effort.name),
        'EXCEEDED': _legs('exceeded'),
        'WARNING': ['warning', 'stopped', 'crossings'],
        'COMMANDS': _legs('motor_command'),
        'RISES': _legs('winding_rise'),
        'MOTOR_CODE': ['motor_code'],
        'MOTORS': [*_legs('motor_angle'), *_legs('motor_speed'), *_legs('motor_acceleration'),
                   *_legs('motor_torque')],
        'FOUND_CODE': ['found_code'],
        'FOUND': [f'found_{name}' for name in _POSE],
    }


def result_columns(kind: LegKind) -> list[str]:
    """Return the names of RESULT_COLUMNS that hexapods of a kind have, in the order of C."""
    return [name for name, field in RESULT_COLUMNS.items()
            if not isinstance(_PLACES[field], slice) or _PLACES[field].stop <= kind.width]


def columns_of(kind: LegKind) -> list[str]:
    """Return the names of all columns."""
    return [name for names in parts_of(kind).values() for name in names]


def whole_columns(kind: LegKind) -> set[str]:
    """Return the names of columns of whole numbers: stamps, flags, codes, bits of limits."""
    parts = parts_of(kind)
    return {name for part in ('STAMP', 'HAS_BASE', 'CODE', 'EXCEEDED', 'WARNING', 'MOTOR_CODE',
                              'FOUND_CODE') for name in parts[part]}


def golden_vectors(parameters: Parameters) -> Array:
    """
    Return the vectors, a number for each of ``columns_of``.

    Samples that the legs do not reach, or whose numbers overflow, are left out.
    """
    kind = parameters.leg_kind
    step = Step(parameters)
    hexapod = hexapod_structure(parameters)
    drives = Drives(parameters) if not kind.ratio or parameters[kind.ratio] is not None else None
    motions = _motions(parameters)
    weight = parameters.carried.mass * 10.0 + 1.0
    phases = np.arange(_COUNT)[:, None] + np.arange(WRENCH + BASE)
    wrenches = weight * np.sin(phases[:, :WRENCH]) * (np.arange(_COUNT) % 4 > 0)[:, None]
    bases = np.sin(phases[:, WRENCH:])
    bases[:, :3] += parameters.gravity
    guess = np.zeros((1, MOTION))
    guess[0, :POSE.stop] = motions[0, :POSE.stop]
    rows, state = [], FIRST
    for n in range(_COUNT):
        stamp, moving = n * _PERIOD, n % 3 == 2
        outputs = step(Batch.from_parts(
            stamp, motions[n], wrenches[n], bases=bases[n] if moving else None), state)
        state = outputs.state
        if not outputs.answered[0]:
            continue
        code, steps, residual = np.empty(1, dtype=int), np.empty(1, dtype=int), np.empty(1)
        forward_kinematics.poses(
            hexapod, outputs.rows[:, kind.position.columns].copy(), guess, code, steps, residual)
        rows.append([
            stamp, moving, *motions[n], *wrenches[n], *bases[n], *_results(kind, outputs),
            *_commanded(outputs), *_motors(drives, motions[n:n + 1], outputs), int(code[0]),
            *guess[0, :POSE.stop]])
    return np.array(rows, dtype=float).reshape(-1, len(columns_of(kind)))


def _motions(parameters: Parameters) -> Array:
    """Return rows of motion (_COUNT, MOTION)."""
    positions, rotations = homes(parameters)
    size = parameters.singularity.characteristic_length
    times = NANOSECOND * _PERIOD * np.arange(_COUNT)[:, None]
    omega = 2.0 * math.pi * np.array([0.9, 1.1, 1.3, 1.5, 1.7, 1.9])
    growth = times / times[-1]
    sine, cosine = np.sin(omega * times), np.cos(omega * times)
    swing = 0.5 * np.array([size, size, size, 1.0, 1.0, 1.0])
    q = swing * growth * sine
    rate = swing * (sine / times[-1] + growth * omega * cosine)
    acceleration = swing * (2.0 * omega * cosine / times[-1] - growth * omega ** 2 * sine)
    turning = Motion.from_euler(
        q[:, :3], q[:, 3:], rate[:, :3], rate[:, 3:], acceleration[:, :3], acceleration[:, 3:])
    return Motion(positions[0] + turning.position, turning.rotation @ rotations[0],
                  turning.linear_velocity, turning.angular_velocity,
                  turning.linear_acceleration, turning.angular_acceleration).rows


def _results(kind: LegKind, outputs: Outputs) -> list[float]:
    """Return the columns from CODE to WARNING of one setpoint's outputs."""
    code = SINGULAR if not outputs.solvable[0] else OK if outputs.with_efforts[0] else SUPPRESSED
    exceeded = outputs.records['exceeded'][0]
    state = outputs.singularity()
    row = outputs.rows[0]
    return [code, *_or_zero(row[:kind.width]), *_or_zero(row[kind.published]),
            *exceeded, state.cause, state.stopped, state.crossings]


def _commanded(outputs: Outputs) -> list[float]:
    """Return the columns of torques to command and of temperature rises, 0 for nan."""
    return [*_or_zero(np.concatenate([outputs.rows[0, MOTOR_COMMANDS], outputs.rows[0, RISES]]))]


def _or_zero(numbers: Array) -> Array:
    """Return zeros for numbers that are not known."""
    return np.where(np.isnan(numbers), 0.0, numbers)


def _motors(drives: Drives | None, motions: Array, outputs: Outputs) -> list[float]:
    """Return the columns MOTOR_CODE and MOTORS, for the demanded efforts."""
    if drives is None:
        return [NO_MOTORS, *np.zeros(len(MECHANICAL))]
    return [OK, *drives(motions, _or_zero(outputs.rows[:, :RESULT]))[0, MECHANICAL]]
