# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Accuracy, coverage of the intervals, and cost of an identification.

Forces are those of an independent engine, noise is added. Run by hand on Linux,
``make bench-identify``; see README.md beside this file.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
import json
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import time
from typing import Any

from inverse_dynamics import Array, HERE, markdown, measured_on, write
import numpy as np

from stewart_dynamics import Parameters, StewartPlatform
from stewart_dynamics.estimation.confidence_level import TWO_SIDED
from stewart_dynamics.executables import executable
from stewart_dynamics.identification.extraction import Extraction, Extracts
from stewart_dynamics.identification.parameter_fit import fit
from stewart_dynamics.identification.unknowns import Unknowns
from stewart_dynamics.identification.windows import Window
from stewart_dynamics.reference_motion.motion_functions import motion_at
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters

sys.path.append(str(HERE.parent / 'test'))
from independent_hexapod import moving  # noqa: E402, I100, I202
from recorded import (  # noqa: E402, I202
    about, at_rest, fourier, MotionAt, NOISE, Recorded, recorded, write_bag)
from referees import random_motion, random_parameters, rng  # noqa: E402, I202

BEGIN, END = '<!-- identification: begin -->', '<!-- identification: end -->'
FILE = HERE.parent / 'config' / 'platform.yaml'
GIVEN = Parameters.from_yaml(FILE)
TRUE = GIVEN.replaced({
    'platform.mass': 180.0, 'platform.center_of_mass': [0.03, -0.02, 0.15],
    'platform.inertia': [14.0, 0.5, -0.3, 16.0, 0.4, 24.0],
    'actuator.viscous_friction': 400.0, 'actuator.coulomb_friction': 50.0})
RATE = 1000.0
SECONDS = 60.0
SEED = 3
# Largest error allowed of each kind, and its unit.
TARGETS = {
    'platform.mass': (0.2, '% of it'), 'platform.center_of_mass': (1.0, 'mm'),
    'platform.inertia': (2.0, '% of the largest'), 'actuator.viscous_friction': (3.0, '% of it'),
    'actuator.coulomb_friction': (3.0, '% of it')}
# Payload: five equal masses on the platform [kg], above its origin [m].
MASS, HEIGHT = 15.0, 0.2
LONG = 600.0


def kind_of(name: str) -> str:
    """Return a parameter's name without its last part, that of the mass whole."""
    return name if name == 'platform.mass' else name.rpartition('.')[0]


def errors(names: Sequence[str], values: Array) -> dict[str, float]:
    """Return the largest error of each kind, in the units of TARGETS."""
    unknowns = Unknowns(TRUE)
    truth = dict(zip(unknowns.names, unknowns.start, strict=True))
    largest: dict[str, float] = {}
    for name, value in zip(names, values, strict=True):
        kind = kind_of(name)
        unit = {'platform.center_of_mass': 1e-3, 'platform.inertia': 0.01 * 24.0}.get(
            kind, 0.01 * abs(truth[name]))
        largest[kind] = max(largest.get(kind, 0.0), abs(value - truth[name]) / unit)
    return largest


def identify(folder: Path, bags: Sequence[Path], *options: str,
             params: Path = FILE) -> tuple[dict[str, Any] | None, float, float, str]:
    """Run the program; return identification.json, seconds, peak memory [MB] and errors."""
    output = folder / 'identified'
    begun = time.perf_counter()
    with subprocess.Popen(
            [executable('stewart_identify'), *map(str, bags), '--params', str(params),
             '--output', str(output), '--force', *options],
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as program:
        assert program.stderr is not None
        said = program.stderr.read()
        _, status, usage = os.wait4(program.pid, 0)
        program.returncode = os.waitstatus_to_exitcode(status)
    seconds = time.perf_counter() - begun
    found = (json.loads((output / 'identification.json').read_text())
             if program.returncode == 0 else None)
    return found, seconds, usage.ru_maxrss / 1024.0, said


def designed(folder: Path) -> MotionAt:
    """Return the motion of a minute that the program designs from the parameter file."""
    subprocess.run([executable('stewart_identify'), '--design', '--params', str(FILE), '--output',
                    str(folder / 'designed')], check=True, stdout=subprocess.DEVNULL)
    motion = ReferenceMotionParameters.from_yaml(folder / 'designed' / 'trajectory.yaml')
    return lambda times: motion_at(motion, np.maximum(times, 0.0))


def accuracy(folder: Path) -> list[str]:
    """Return the lines of errors on a designed motion, with and without measured rates."""
    motion = designed(folder)
    times = np.arange(round(SECONDS * RATE)) / RATE
    forces = moving(TRUE, motion(times - NOISE.delay)).forces
    rows = [('largest error, one minute of a designed motion at 1 kHz', 'with rates', 'without',
             'at most', 'unit')]
    columns = []
    seconds = memory = 0.0
    for with_rates in (True, False):
        given = recorded(TRUE, motion, SECONDS, RATE, 1, NOISE, forces, with_rates)
        bag = write_bag(folder / f'minute {with_rates}', given, GIVEN.joints)
        found, took, peak, said = identify(folder, [bag])
        assert found is not None, said
        seconds, memory = max(seconds, took), max(memory, peak)
        columns.append(errors([each['name'] for each in found['parameters']],
                              np.array([each['value'] for each in found['parameters']])))
        delay = 1e3 * (found['bags'][0]['delay_s'] - NOISE.delay)
        columns[-1]['delay'] = abs(delay)
    rows += [(f'`{kind}`', f'{columns[0][kind]:.2g}', f'{columns[1][kind]:.2g}', f'{most:g}', unit)
             for kind, (most, unit) in TARGETS.items()]
    rows.append(('delay of 3 ms', f'{columns[0]["delay"]:.2g}', f'{columns[1]["delay"]:.2g}', '',
                 'ms'))
    return [*markdown(rows), '', f'The whole program, with report: {seconds:.1f} s (at most 5 s), '
            f'{memory:.0f} MB.']


def one_seed(given: tuple[int, Array]) -> tuple[Array, Array]:
    """Return values and standard errors of one seed, the delay's last."""
    seed, forces = given
    unknowns, platform = Unknowns(GIVEN), StewartPlatform(GIVEN)
    made = recorded(TRUE, fourier(SEED), SECONDS, RATE, seed, NOISE, forces)
    window = Window(0, 1.0 / RATE, made.positions, made.rates, made.efforts,
                    np.zeros(made.efforts.shape, dtype=bool))
    read = Extraction(platform, unknowns, 1.0 / RATE, 10.0)(window, platform.home_pose())
    extracts = Extracts()
    extracts.add(0, 0.0, read)
    found = fit(extracts, unknowns, None, np.array([10.0]))
    extracts.close()
    return (np.append(found.values[unknowns.asked], found.delays[0]),
            np.append(np.sqrt(np.diag(found.covariance))[unknowns.asked], found.delay_errors[0]))


def coverage(forces: Array, seeds: int) -> list[str]:
    """Return the lines of how often the intervals hold the truth."""
    with ProcessPoolExecutor(2) as pool:
        found = list(pool.map(one_seed, ((seed, forces) for seed in range(seeds)), chunksize=5))
    values, deviations = (np.array(each) for each in zip(*found, strict=True))
    unknowns = Unknowns(TRUE)
    truth = np.append(unknowns.start[unknowns.asked], NOISE.delay)
    held = 100.0 * np.mean(np.abs(values - truth) < TWO_SIDED * deviations, axis=0)
    names = [kind_of(unknowns.names[n]) for n in unknowns.asked] + ['delay']
    rows = [(f'95 % intervals that hold the truth, {seeds} seeds', 'least', 'most', 'standard '
             'error / spread')]
    for kind in dict.fromkeys(names):
        which = [n for n, name in enumerate(names) if name == kind]
        ratio = np.mean(deviations[:, which], axis=0) / np.std(values[:, which], axis=0)
        rows.append((f'`{kind}`' if '.' in kind else kind, f'{held[which].min():.1f} %',
                     f'{held[which].max():.1f} %', f'{ratio.min():.2f} .. {ratio.max():.2f}'))
    return markdown(rows)


def states(result: Mapping[str, Any], state: str) -> str:
    """Return the names of parameters in a state, shortened."""
    names = [each['name'] for each in result['parameters'] if each['state'] == state]
    kinds: dict[str, list[str]] = {}
    for name in names:
        kinds.setdefault(kind_of(name), []).append(name.rpartition('.')[2])
    return ', '.join(
        f'`{kind}`' if len(ends) == 6 or kind == 'platform.mass'
        else f'`{kind}` {" ".join(ends)}' for kind, ends in kinds.items()) or '-'


def not_identifiable(folder: Path) -> list[str]:
    """Return the lines on identifiable parameters of bags at rest and about one axis."""
    lines = []
    for name, motion in (('at rest', at_rest), ('about x', about([1.0, 0.0, 0.0])),
                         ('about (1, 1, 0)', about([1.0, 1.0, 0.0]))):
        given = recorded(TRUE, motion, 20.0, 250.0, 1, NOISE)
        bag = write_bag(folder / name, given, GIVEN.joints)
        found, _, _, said = identify(folder, [bag], '--no-report')
        assert found is not None, said
        sums = '; '.join(f'`{each["words"]}`' for each in found['combinations'])
        lines.append(f'- {name}, 20 s: identified are {states(found, "identified")}'
                     + (f'; in combinations {sums}' if sums else '')
                     + f'; not identifiable are {states(found, "not_identifiable")}.')
    return lines


def five_masses(folder: Path) -> list[str]:
    """Return the lines of the differences as five masses are taken off one by one."""
    found = []
    for masses in range(5, -1, -1):
        mass = TRUE.platform.mass + masses * MASS
        center = (TRUE.platform.mass * TRUE.platform.center_of_mass
                  + masses * MASS * np.array([0.0, 0.0, HEIGHT])) / mass
        loaded = TRUE.replaced({'platform.mass': mass, 'platform.center_of_mass': center})
        given = recorded(loaded, fourier(SEED), SECONDS, 250.0, 10 + masses,
                         NOISE._replace(effort=2.5, length=5e-6, rate=5e-4))
        bag = write_bag(folder / f'{masses} masses', given, GIVEN.joints)
        result, _, _, said = identify(folder, [bag], '--no-report')
        assert result is not None, said
        found.append(result['parameters'][0])
    differences = -np.diff([each['value'] for each in found])
    rows = [(f'masses of {MASS:g} kg on the platform', 'identified (kg)', '± 95 % (kg)',
             'taken off (kg)', 'error (%)')]
    for n, each in enumerate(found):
        taken = ('', '') if not n else (
            f'{differences[n - 1]:.4f}', f'{100.0 * (differences[n - 1] / MASS - 1.0):+.2f}')
        rows.append((f'{5 - n}', f'{each["value"]:.3f}',
                     f'{TWO_SIDED * each["standard_error"]:.3f}', *taken))
    return markdown(rows)


def volume(folder: Path) -> list[str]:
    """Return the lines of time and memory of bags of ten minutes."""
    times = np.arange(round(LONG * RATE)) / RATE
    platform = StewartPlatform(TRUE)
    parts = [platform.inverse_dynamics(fourier(SEED)(part - NOISE.delay)).forces
             for part in np.array_split(times, 20)]
    made = Recorded(times, *(np.empty((len(times), 6)) for _ in range(3)))
    for part, forces in zip(np.array_split(np.arange(len(times)), 20), parts, strict=True):
        random = rng(int(part[0]))
        result = platform.inverse_dynamics(fourier(SEED)(times[part]))
        shape = len(part), 6
        made.positions[part] = result.lengths - GIVEN.geometry.zero_length + (
            NOISE.length * random.normal(size=shape))
        assert made.rates is not None
        made.rates[part] = result.rates + NOISE.rate * random.normal(size=shape)
        made.efforts[part] = forces + NOISE.effort * random.normal(size=shape)
    bag = write_bag(folder / 'ten minutes', made, GIVEN.joints)
    size = sum(file.stat().st_size for file in bag.iterdir()) / 1e6
    rows = [('bags of ten minutes at 1 kHz', 'MB', 's', 'peak memory (MB)')]
    for many in (1, 10):
        found, seconds, peak, said = identify(folder, [bag] * many)
        assert found is not None, said
        rows.append((f'{many}', f'{many * size:.0f}', f'{seconds:.1f}', f'{peak:.0f}'))
    return markdown(rows)


def cost() -> list[str]:
    """Return the lines that compare the cost of regressor and inverse dynamics."""
    p = random_parameters(rng(1))
    platform, motion = StewartPlatform(p), random_motion(p, rng(2), 4000)
    calls = {'`inverse_dynamics(motion)`': lambda: platform.inverse_dynamics(motion),
             '`regressor(motion)`': lambda: platform.regressor(motion),
             '`regressors(rows)`, unchecked': lambda: platform.regressors(motion.rows)}
    took: dict[str, list[float]] = {name: [] for name in calls}
    for turn in range(42):
        for name, call in calls.items():
            begun = time.perf_counter()
            call()
            if turn:
                took[name].append(1e9 * (time.perf_counter() - begun) / len(motion))
    first = np.array(took['`inverse_dynamics(motion)`'])
    return markdown([('a sample in a batch of 4,000', 'ns', 'times `inverse_dynamics`'), *(
        (name, f'{np.median(each):.0f}', f'{np.median(np.array(each) / first):.1f}')
        for name, each in took.items())])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--seeds', type=int, default=500, help='of the coverage (%(default)s)')
    parser.add_argument('--write', action='store_true', help='put the tables into results/')
    options = parser.parse_args()
    lines = ['', *cost(), '']
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        times = np.arange(round(SECONDS * RATE)) / RATE
        forces = moving(TRUE, fourier(SEED)(times - NOISE.delay)).forces
        for part in (accuracy(folder), coverage(forces, options.seeds), not_identifiable(folder),
                     five_masses(folder), volume(folder)):
            print('\n'.join(part), flush=True)
            lines += [*part, '']
    lines += [measured_on(), '']
    if options.write:
        write(lines, BEGIN, END)


if __name__ == '__main__':
    main()
