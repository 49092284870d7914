# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The runtime path beside Pinocchio and beside the exported C source, measured in turns in one run.

Run by hand, ``make bench``; see README.md beside this file.
"""

from __future__ import annotations

from collections.abc import Callable
import ctypes
import os
from pathlib import Path
import platform
import statistics
import subprocess
import tempfile
import time
import timeit
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
import pinocchio as pin

from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.core.binding import function, places, record
from stewart_dynamics.export.c_project import platform_source
from stewart_dynamics.mechanics.dynamics import lagrange
from stewart_dynamics.mechanics.frames.rotation import to_quaternion
from stewart_dynamics.mechanics.rows import (
    FORCES, NO_BASE, RESULT, WRENCH)
from stewart_dynamics.parameters.table import inertia_matrix

Array = NDArray[np.float64]

HERE = Path(__file__).parent
RESULTS = HERE / 'results'
BEGIN, END = '<!-- measured: begin -->', '<!-- measured: end -->'
C_COMPILER = ['gcc', '-std=c99', '-O3', '-march=native', '-ffp-contract=off']

ROUNDS = 41
SAMPLES = 200_000
LAGRANGE_SAMPLES = 2_000
SINGLE_CALLS_SECONDS = 0.005
AGREEMENT = 1e-9
STILL = np.array([NO_BASE])

# Actuators that the example hexapod does not have, so that their terms count in the checks.
ACTUATORS = {
    'actuator.reflected_mass': (25.0,), 'actuator.viscous_friction': (150.0,),
    'actuator.coulomb_friction': (40.0,)}


class Contestant(NamedTuple):
    """A program that is compared: ``run`` takes one turn and returns s per sample."""

    name: str
    run: Callable[[], float]
    measure: str = ''
    """Name of the contestant to whose time its own is set in relation."""
    decimals: int = 0


class Turns(NamedTuple):
    """Seconds of a contestant in each round."""

    seconds: list[float]
    cores: list[float]
    """Processor time divided by elapsed time."""


def example_hexapod() -> Parameters:
    """Return the hexapod of config/platform.yaml with actuators."""
    given = Parameters.from_yaml(HERE.parent / 'config' / 'platform.yaml').given
    return Parameters({**given, **ACTUATORS})


def random_motions(many: int) -> Motion:
    """Return motions all over the hexapod's workspace."""
    rng = np.random.default_rng(20260101)

    def within(bound: float) -> Array:
        return rng.uniform(-bound, bound, (many, 3))

    return Motion.from_euler(
        np.array([0.0, 0.0, 1.0]) + within(0.15), within(0.3), within(0.5), within(1.0),
        within(3.0), within(6.0))


# --- plain C ---------------------------------------------------------------------------------

class PlainC:
    """The exported C source of a hexapod, compiled here and now."""

    def __init__(self, parameters: Parameters) -> None:
        folder = HERE.parent / 'stewart_dynamics' / 'core'
        with tempfile.TemporaryDirectory() as name:
            hexapod, library = Path(name) / 'hexapod.c', Path(name) / 'hexapod.so'
            hexapod.write_text('#include "stewart_dynamics.h"\n#include <math.h>\n'
                               + platform_source(parameters, 'hexapod'), encoding='utf-8')
            subprocess.run(
                [*C_COMPILER, '-shared', '-fPIC', f'-I{folder}', '-o', library, hexapod,
                 folder / 'stewart_dynamics.c', HERE.parent / 'test' / 'export_calls.c', '-lm'],
                check=True)
            loaded = ctypes.CDLL(str(library))
        self.function = loaded.inverse_dynamics
        self.function.argtypes = [ctypes.c_size_t, ctypes.c_void_p, ctypes.c_size_t,
                                  *[ctypes.c_void_p] * 6]
        self.function.restype = None
        self._hexapod = ctypes.addressof(ctypes.c_char.in_dll(loaded, 'hexapod'))

    def arguments(self, motions: Array, wrenches: Array | None, results: Array) -> list[Any]:
        """Return what the function takes for these C-contiguous arrays; it keeps them alive."""
        given = np.full(len(motions), wrenches is not None, dtype=np.int32)
        codes = np.empty(len(motions), dtype=np.int32)
        x, w, g, out, c = (None if array is None else array.ctypes.data_as(ctypes.c_void_p)
                           for array in (motions, wrenches, given, results, codes))
        return [len(motions), self._hexapod, 0, x, w, None, g, out, c]


# --- Pinocchio -------------------------------------------------------------------------------

class Tree:
    """
    The hexapod as Pinocchio's rnea takes it: legs and platform side by side, not connected.

    Leg: a universal joint that carries the cylinder, a prismatic one that carries the piston.
    Platform: a free flyer. rnea gives joint forces that would move all of them; it knows
    nothing of the platform joints, which ``leg_forces`` brings in.
    """

    def __init__(self, parameters: Parameters) -> None:
        p = parameters
        self.parameters = p
        self.model = pin.Model()
        self.model.gravity.linear = np.array(p.gravity)
        x, y, here = np.eye(3)[0], np.eye(3)[1], pin.SE3.Identity()
        self.tips = []
        for i in range(6):
            base = pin.SE3(np.eye(3), p.geometry.base_joints[i])
            cylinder = self.model.addJoint(0, pin.JointModelUniversal(x, y), base, f'base_{i}')
            self.model.appendBodyToJoint(cylinder, _rod(
                p.legs.cylinder.mass[i], p.legs.cylinder.center_of_mass[i],
                p.legs.cylinder.inertia[i]), here)
            piston = self.model.addJoint(cylinder, pin.JointModelPZ(), here, f'leg_{i}')
            self.model.appendBodyToJoint(piston, _rod(
                p.legs.piston.mass[i], -p.legs.piston.center_of_mass[i],
                p.legs.piston.inertia[i]), here)
            self.model.armature[3 * i + 2] = p.actuator.reflected_mass[i]
            self.tips.append(piston)
        body = self.model.addJoint(0, pin.JointModelFreeFlyer(), here, 'platform')
        self.model.appendBodyToJoint(body, pin.Inertia(
            p.platform.mass, p.platform.center_of_mass,
            inertia_matrix(p.platform.inertia)), here)
        self.data = self.model.createData()

    def state(self, motion: Motion) -> tuple[Array, Array, Array, Array]:
        """Return q, v, a of a single motion, and the matrix G of v = G [linear; angular]."""
        q, v, a = np.zeros(25), np.zeros(24), np.zeros(24)
        g = np.zeros((24, 6))
        r, omega = motion.rotation, motion.angular_velocity
        back, twist = np.kron(np.eye(2), r.T), motion.rows[12:18]
        q[18:21], q[21:] = motion.position, to_quaternion(r)
        g[18:] = back
        a[18:] = back @ motion.rows[18:24]
        a[18:21] -= r.T @ np.cross(omega, motion.linear_velocity)
        at = lagrange.legs(self.parameters, motion.position, r)
        for i, (s, length) in enumerate(zip(at.directions, at.lengths, strict=True)):
            q[3 * i:3 * i + 3] = np.arctan2(-s[1], s[2]), np.arcsin(s[0]), length
        # the velocities and accelerations that take each piston along with its platform joint
        in_base_axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        pin.computeJointJacobians(self.model, self.data, q)
        tips = [np.array(pin.getJointJacobian(self.model, self.data, tip, in_base_axes))[
            :3, 3 * i:3 * i + 3] for i, tip in enumerate(self.tips)]
        for i, arm in enumerate(at.arms):
            joint = np.hstack([np.eye(3), -lagrange.skew(arm)])
            g[3 * i:3 * i + 3] = np.linalg.solve(tips[i], joint)
        v[:] = g @ twist
        pin.forwardKinematics(self.model, self.data, q, v, np.zeros(24))
        for i, arm in enumerate(at.arms):
            drift = pin.getClassicalAcceleration(
                self.model, self.data, self.tips[i], in_base_axes).linear
            acceleration = (motion.linear_acceleration + np.cross(
                motion.angular_acceleration, arm) + np.cross(omega, np.cross(omega, arm)))
            a[3 * i:3 * i + 3] = np.linalg.solve(tips[i], acceleration - drift)
        return q, v, a, g

    def leg_forces(self, motion: Motion) -> Array:
        """Return the leg forces of a single motion, by rnea and the principle of d'Alembert."""
        q, v, a, g = self.state(motion)
        at = lagrange.legs(self.parameters, motion.position, motion.rotation)
        wrench = g.T @ pin.rnea(self.model, self.data, q, v, a)
        forces: Array = np.linalg.solve(lagrange.inverse_jacobian(at).T, wrench) + _friction(
            self.parameters, v[2:18:3])
        return forces


def _rod(mass: float, center_of_mass: float, inertia: float) -> Any:
    return pin.Inertia(mass, np.array([0.0, 0.0, center_of_mass]),
                       np.diag([inertia, inertia, 0.0]))


def _friction(parameters: Parameters, rates: Array) -> Array:
    slip = np.clip(rates / parameters.actuator.coulomb_velocity, -1.0, 1.0)
    force: Array = (parameters.actuator.viscous_friction * rates
                    + parameters.actuator.coulomb_friction * slip)
    return force


# --- the Lagrange equations in numpy ---------------------------------------------------------

def lagrange_forces(parameters: Parameters, motion: Motion) -> Array:
    """Return the leg forces of the readable reference, matrix by matrix."""
    position, rotation = motion.position, motion.rotation
    twist, acceleration = motion.rows[..., 12:18, None], motion.rows[..., 18:24, None]
    m = lagrange.mass_matrix(parameters, position, rotation)
    c = lagrange.coriolis_matrix(parameters, position, rotation, motion.linear_velocity,
                                 motion.angular_velocity)
    g = lagrange.gravity_vector(parameters, position, rotation)
    j = lagrange.inverse_jacobian(lagrange.legs(parameters, position, rotation))
    wrench = m @ acceleration + c @ twist + g[..., None]
    forces: Array = np.linalg.solve(np.swapaxes(j, -1, -2), wrench)[..., 0] + _friction(
        parameters, (j @ twist)[..., 0])
    return forces


# --- the benchmark ---------------------------------------------------------------------------

def check(name: str, found: Array, wanted: Array) -> None:
    """Stop where a column of two results differs by more of its largest entry than agreed."""
    difference = float(np.max(np.abs(found - wanted).max(axis=0) / np.abs(wanted).max(axis=0)))
    # written so that a nan does not pass
    if not difference <= AGREEMENT:
        raise SystemExit(f'{name} does not agree with the runtime path: relative difference '
                         f'{difference:.2g}, must be at most {AGREEMENT:g}')
    print(f'{name} agrees with the runtime path: largest relative difference {difference:.1g}')


def repeated(call: str, **names: Any) -> Callable[[], float]:
    """Return a turn whose number of calls takes about SINGLE_CALLS_SECONDS."""
    timer = timeit.Timer(call, globals=names)
    timer.timeit(10)
    many = max(10, int(SINGLE_CALLS_SECONDS / (timer.timeit(100) / 100)))
    return lambda: timer.timeit(many) / many


def once(samples: int, function: Callable[..., Any], *arguments: Any) -> Callable[[], float]:
    """Return a turn of one call on a batch."""
    def turn() -> float:
        start = time.perf_counter()
        function(*arguments)
        return (time.perf_counter() - start) / samples

    return turn


RNEA = '`pin.rnea` alone'
STEP = 'the function in C alone'
CALL = '`StewartPlatform.inverse_dynamics`, one `Motion`'
MOTION = '`Motion` of six arrays'
BATCH = '`solve_many` in C, one core'
PLAIN_C = 'plain C, one core'


def contestants(samples: int) -> tuple[list[Contestant], list[Contestant]]:
    """Return the contestants of single calls and of batches, after checking that all agree."""
    parameters = example_hexapod()
    hexapod = StewartPlatform(parameters)
    motion = random_motions(samples)
    rows, no_wrench = motion.rows, np.zeros((1, WRENCH))
    results, c_results = (np.empty((samples, RESULT)) for _ in range(2))
    c, tree = PlainC(parameters), Tree(parameters)

    wrenches = np.random.default_rng(20260102).normal(0.0, 500.0, (samples, WRENCH))
    for name, wrench in ('plain C under a wrench', wrenches), ('plain C', None):
        loads = no_wrench if wrench is None else wrench
        function('solve_many')(hexapod.structure, samples, rows, len(loads), loads, 1, STILL, 1,
                               results)
        c.function(*c.arguments(rows, wrench, c_results))
        if not np.array_equal(c_results, results):
            raise SystemExit(f'{name} does not have the bits of the runtime path')
    forces = results[:, FORCES]
    few = [_part(motion, slice(k, k + 1)) for k in range(min(50, samples))]
    check('Pinocchio', np.array([tree.leg_forces(_single(one)) for one in few]),
          forces[:len(few)])
    part = _part(motion, slice(0, LAGRANGE_SAMPLES))
    check('Lagrange', lagrange_forces(parameters, part), forces[:len(part.rows)])

    one = _single(_part(motion, slice(0, 1)))
    row, result = rows[:1].copy(), np.empty((1, RESULT))
    sample, places_of = np.zeros(1, record('one_motion')), places('one_motion')
    numbers = sample.view(float)
    numbers[places_of['motion']], numbers[places_of['base']] = row, STILL
    q, v, a, _ = tree.state(one)
    single = [
        Contestant(STEP, repeated('solve()', solve=function('solve_one').bound(
            hexapod.structure, sample)), RNEA),
        Contestant(RNEA, repeated(
            'rnea(model, data, q, v, a)', rnea=pin.rnea, model=tree.model, data=tree.data,
            q=q, v=v, a=a), RNEA),
        Contestant(CALL, repeated(
            'solve(motion)', solve=hexapod.inverse_dynamics, motion=one), RNEA),
        Contestant(MOTION, repeated(
            'make(*arrays)', make=Motion, arrays=[part.copy() for part in (
                one.position, one.rotation, one.linear_velocity, one.angular_velocity,
                one.linear_acceleration, one.angular_acceleration)]), RNEA),
        Contestant('plain C through ctypes', repeated(
            'solve(*arguments)', solve=c.function,
            arguments=c.arguments(row, None, result)), RNEA)]
    batch = [
        Contestant(BATCH, once(
            samples, function('solve_many'), hexapod.structure, samples, rows, 1, no_wrench, 1,
            STILL, 1, results),
            PLAIN_C),
        Contestant(PLAIN_C, once(
            samples, c.function, *c.arguments(rows, None, c_results)), PLAIN_C),
        Contestant('`StewartPlatform.solve`: the default, all cores', once(
            samples, hexapod.solve, rows), PLAIN_C),
        Contestant('`lagrange`, the reference in numpy', once(
            len(part.rows), lagrange_forces, parameters, part), PLAIN_C)]
    return single, batch


def _part(motion: Motion, part: slice) -> Motion:
    return Motion(
        motion.position[part], motion.rotation[part], motion.linear_velocity[part],
        motion.angular_velocity[part], motion.linear_acceleration[part],
        motion.angular_acceleration[part])


def _single(motion: Motion) -> Motion:
    return Motion(
        motion.position[0], motion.rotation[0], motion.linear_velocity[0],
        motion.angular_velocity[0], motion.linear_acceleration[0],
        motion.angular_acceleration[0])


def measure(all_of_them: list[Contestant], rounds: int) -> dict[str, Turns]:
    """Let them take turns, forth in one round and back in the next; the first does not count."""
    turns = {one.name: Turns([], []) for one in all_of_them}
    for number in range(-1, rounds):
        for one in all_of_them if number % 2 else reversed(all_of_them):
            start, processor = time.perf_counter(), time.process_time()
            seconds = one.run()
            cores = (time.process_time() - processor) / (time.perf_counter() - start)
            if number >= 0:
                turns[one.name].seconds.append(seconds)
                turns[one.name].cores.append(cores)
    return turns


class Figure(NamedTuple):
    """A figure that has a target."""

    name: str
    value: float
    most: float
    unit: str


def ratio(name: str, rows: list[Contestant], turns: dict[str, Turns]) -> float:
    """Return the median of a contestant's times, in relation to the one beside it."""
    measure, = (one.measure for one in rows if one.name == name)
    return statistics.median(mine / its for mine, its in zip(
        turns[name].seconds, turns[measure].seconds, strict=True))


def microseconds(name: str, turns: dict[str, Turns]) -> float:
    """Return the median of a contestant's times."""
    return 1e6 * statistics.median(turns[name].seconds)


def summary(figures: list[Figure]) -> list[str]:
    """Return the lines of a table: each figure, its target, and whether it is met."""
    cells = [('figure', 'measured', 'at most', 'met'), *(
        (each.name, f'{each.value:.3g} {each.unit}', f'{each.most:g} {each.unit}',
         'yes' if each.value <= each.most else 'no') for each in figures)]
    return markdown(cells)


def markdown(cells: list[tuple[str, ...]]) -> list[str]:
    """Return the lines of a Markdown table that is also readable as it is."""
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = ['| ' + ' | '.join(
        cell.rjust(width) if n else cell.ljust(width)
        for n, (cell, width) in enumerate(zip(row, widths, strict=True))) + ' |'
        for row in cells]
    lines.insert(1, '| ' + ' | '.join(
        '-' * (width - 1) + (':' if n else '-') for n, width in enumerate(widths)) + ' |')
    return lines


def table(title: str, rows: list[Contestant], turns: dict[str, Turns]) -> list[str]:
    """Return the lines of a Markdown table that is also readable as it is."""
    cells = [(title, 'ns', 'cores', f'times {rows[0].measure}', 'min .. max')]
    for one in rows:
        own = turns[one.name]
        ratios = [mine / its for mine, its in zip(
            own.seconds, turns[one.measure].seconds, strict=True)]
        cells.append((
            one.name, f'{1e9 * statistics.median(own.seconds):,.0f}',
            f'{statistics.median(own.cores):.1f}', f'{statistics.median(ratios):.2f}',
            '' if one.name == one.measure else f'{min(ratios):.2f} .. {max(ratios):.2f}'))
    return markdown(cells)


def measured_on() -> str:
    """Return processor and versions."""
    gcc = subprocess.run([C_COMPILER[0], '-dumpfullversion'], check=True, capture_output=True,
                         text=True).stdout.strip()
    cpus = len(os.sched_getaffinity(0))
    return (f'{processor_name()}, {cpus} cores. Python {platform.python_version()}, '
            f'numpy {np.__version__}, '
            f'Pinocchio {pin.__version__}, gcc {gcc}.')


def processor_name() -> str:
    """Return the processor's name, with family and model, for the name alone can say little."""
    try:
        lines = Path('/proc/cpuinfo').read_text(encoding='utf-8').splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    facts = dict(reversed([[part.strip() for part in line.split(':', 1)]
                           for line in lines if ':' in line]))
    name = facts.get('model name', platform.machine())
    return f'{name} (family {facts["cpu family"]}, model {facts["model"]})' if (
        'cpu family' in facts and 'model' in facts) else name


def write(lines: list[str], begin: str = BEGIN, end: str = END) -> None:
    """Put the lines between the markers, which stand in one of the files of results/."""
    page, text = next((page, text) for page in RESULTS.glob('*.md')
                      if begin in (text := page.read_text(encoding='utf-8')))
    before, rest = text.split(begin)
    _, after = rest.split(end)
    page.write_text('\n'.join([before + begin, *lines, end + after]), encoding='utf-8')


def run(rounds: int, samples: int = SAMPLES) -> tuple[list[str], list[Figure]]:
    """Check and measure; return the lines for the page, and the figures with targets."""
    single, batch = contestants(samples)
    turns = measure(single + batch, rounds)
    lines = ['', *table('one call from Python', single, turns), '',
             *table(f'a sample in a batch of {samples:,}', batch, turns),
             '', f'{measured_on()} Medians of {rounds} rounds.', '']
    return lines, [
        Figure('the function in C', ratio(STEP, single, turns), 1.0, 'times `pin.rnea`'),
        Figure('`inverse_dynamics(motion)`', ratio(CALL, single, turns), 1.1, 'times `pin.rnea`'),
        Figure(MOTION, microseconds(MOTION, turns), 5.0, 'us'),
        Figure('a sample of a batch', ratio(BATCH, batch, turns), 0.8, 'times plain C')]
