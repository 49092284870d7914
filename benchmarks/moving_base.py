# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Cost of a moving base, and gain of the straight line through two of its samples.

Run by hand, ``make bench``; see README.md beside this file.
"""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Any

from inverse_dynamics import (
    Contestant, example_hexapod, Figure, markdown, measure, measured_on, once, random_motions,
    ratio, repeated, STILL, table)
import numpy as np

from stewart_dynamics import BaseMotion, Motion, Pose, StewartPlatform
from stewart_dynamics.core.binding import function
from stewart_dynamics.mechanics.dynamics import forward_dynamics
from stewart_dynamics.mechanics.rows import FORCES, RESULT
from stewart_dynamics.messages.setpoint import StampedWriter
from stewart_dynamics.setpoints.base_input import BaseInput
from stewart_dynamics.setpoints.input_messages import BASE_ACCEL, BASE_POSE, BASE_TWIST
from stewart_dynamics.setpoints.rejections import Rejections

BEGIN, END = '<!-- moving base: begin -->', '<!-- moving base: end -->'

SAMPLES = 100_000
CALL, BATCH = '`inverse_dynamics(motion)`', '`inverse_dynamics.solve`, a sample, one core'
WAY_BACK = '`forward_dynamics(motion, forces)`'
MOVING = ' on a moving base'

# A base that sways, heaves and rolls: frequency [Hz], amplitudes [m, rad].
MOTIONS = {'ship': (0.12, 1.5, 0.25), 'vehicle': (1.5, 0.05, 0.05)}
RATES = (50, 200, 1000)
SECONDS = 20.0


def random_base(many: int) -> BaseMotion:
    """Return base motions of a ship in a gale, in any phase."""
    rng = np.random.default_rng(20260104)
    return BaseMotion(np.array([0.0, 0.0, -9.80665]) + rng.uniform(-3.0, 3.0, (many, 3)), *(
        rng.uniform(-bound, bound, (many, 3)) for bound in (2.0, 0.3, 0.3)))


def contestants(platform: StewartPlatform) -> list[Contestant]:
    """Return each call, on a base that is still and on one that moves."""
    motion, base = random_motions(SAMPLES), random_base(SAMPLES)
    one, its_base = (type(many).of_rows(many.rows[0].copy()) for many in (motion, base))
    results = np.empty((SAMPLES, RESULT))
    hexapod, rows, no_wrench = platform.structure, motion.rows, np.zeros((1, 6))
    forces = platform.solve(rows)[:, FORCES].copy()
    moved = rows.copy()
    found = []
    for name, call in ((CALL, 'solve(motion, None, base)'),
                       (WAY_BACK, 'back(motion, forces, None, base)')):
        for moving in (None, its_base):
            found.append(Contestant(name + ('' if moving is None else MOVING), repeated(
                call, solve=platform.inverse_dynamics, back=platform.forward_dynamics,
                motion=one, forces=forces[0], base=moving), name))
    for name, call in ((BATCH, lambda bases: once(
            SAMPLES, function('solve_many'), hexapod, SAMPLES, rows, 1, no_wrench, len(bases),
            bases, 1, results)),
            ('`forward_dynamics.solve`, a sample, one core', lambda bases: once(
                SAMPLES, forward_dynamics.solve, hexapod, moved, forces, no_wrench, bases))):
        for bases in (STILL, base.rows):
            found.append(Contestant(
                name + (MOVING if len(bases) > 1 else ''), call(bases), name))
    found.append(Contestant('`base_wrench(motion)`', repeated(
        'solve(motion)', solve=platform.base_wrench, motion=one), CALL))
    return found


def motion_of(kind: str) -> Callable[[float], Motion]:
    """Return a base's motion in the world as a function of time."""
    frequency, amplitude, angle = MOTIONS[kind]
    w = 2.0 * math.pi * frequency

    def at(t: float) -> Motion:
        phases = [w * t, 1.7 * w * t + 1.0, 0.8 * w * t + 2.0]
        speeds = np.array([w, 1.7 * w, 0.8 * w])
        s, c = np.sin(phases), np.cos(phases)
        return Motion.from_euler(
            amplitude * s, angle * c, amplitude * speeds * c, -angle * speeds * s,
            -amplitude * speeds ** 2 * s, -angle * speeds ** 2 * c)

    return at


def gain_of_the_line(platform: StewartPlatform) -> list[str]:
    """Return a table of the errors of leg forces: by the last sample, and by the line."""
    parameters = platform.parameters.replaced({'base.source': 'motion'})
    writers = {topic: StampedWriter(parameters.world_frame, many) for topic, many in (
        (BASE_POSE, 7), (BASE_TWIST, 6), (BASE_ACCEL, 6))}
    still = Motion.from_pose(Pose([0.0, 0.0, 1.1], np.eye(3)))
    weight = platform.inverse_dynamics(still).forces
    cells: list[tuple[str, ...]] = [(
        'base motion', 'samples (Hz)', 'forces it makes (N)', 'error, last sample (N)',
        'error, line (N)')]
    for kind in MOTIONS:
        at = motion_of(kind)
        for rate in RATES:
            base = BaseInput(parameters, Rejections(print), print)
            rows: dict[str, list[Any]] = {'truth': [], 'last': [], 'line': []}
            for n in range(int(1000 * SECONDS)):
                now = at(n * 1e-3)
                stamp = 10 ** 9 + n * 10 ** 6
                # A sample needs a setpoint's period to come.
                if (n - 1) % (1000 // rate) == 0:
                    put(base, writers, at((n - 1) * 1e-3), stamp - 10 ** 6)
                last, row = base.last, base.at(stamp)
                if last is None or row is None or math.isnan(row[0]):
                    continue
                rows['truth'].append(BaseMotion.from_motion(now).rows)
                rows['last'].append(last[1])
                rows['line'].append(row)
            forces = {name: platform.inverse_dynamics(
                still, base=BaseMotion.of_rows(np.array(each))).forces
                for name, each in rows.items()}
            cells.append((kind, str(rate), *(f'{rms(each):.3g}' for each in (
                forces['truth'] - weight, forces['last'] - forces['truth'],
                forces['line'] - forces['truth']))))
    return markdown(cells)


def put(base: BaseInput, writers: dict[str, StampedWriter], motion: Motion, stamp: int) -> None:
    """Give a sample to the input."""
    for topic, values in (
            (BASE_POSE, (*motion.position, *motion.quaternion)),
            (BASE_TWIST, motion.rows[12:18]), (BASE_ACCEL, motion.rows[18:24])):
        base.join_message(topic, writers[topic].write(stamp, values), lambda: stamp)


def rms(values: Any) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def run(rounds: int) -> tuple[list[str], list[Figure]]:
    """Measure; return the lines for the page, and the figures with targets."""
    platform = StewartPlatform(example_hexapod())
    rows = contestants(platform)
    turns = measure(rows, rounds)
    lines = ['', *table('on a still base and on a moving one', rows, turns), '',
             *gain_of_the_line(platform), '',
             f'{measured_on()} Medians of {rounds} rounds.', '']
    return lines, [Figure(f'{name}{MOVING}', ratio(name + MOVING, rows, turns), 1.25,
                          'times a still one') for name in (CALL, BATCH, WAY_BACK)]
