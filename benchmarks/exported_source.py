# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The exported C source on one core: time of each call, code size, golden vectors by each compiler.

Run by hand, ``make bench-export``; see README.md beside this file.
"""

from __future__ import annotations

import argparse
import ctypes
import os
from pathlib import Path
import shutil
import subprocess
import tempfile
import time
from typing import Any, NamedTuple

from inverse_dynamics import markdown, processor_name, RESULTS, write
import numpy as np
from numpy.typing import NDArray

from stewart_dynamics import BaseMotion, Motion, Parameters, StewartPlatform
from stewart_dynamics.export.c_project import c_project

Array = NDArray[np.float64]

HERE = Path(__file__).parent
BEGIN, END = '<!-- export: begin -->', '<!-- export: end -->'
CALLS, MOTIONS = 1_000_000, 10_000
PYTHON_CALLS = 100_000
# Linux suspends programs of real-time priority for 5 % of each second, unless they pause [s].
PAUSE, BETWEEN_PAUSES = 0.02, 10
OPTIONS = '-std=c99', '-ffp-contract=off'
LEVELS = '-O2', '-Os'
NODE_ROW = '| separate, `stewart_dynamics`'


class Times(NamedTuple):
    """The times of the calls of one kind [ns]."""

    name: str
    calls: Array
    """(calls on each motion, MOTIONS)"""

    @property
    def row(self) -> tuple[str, ...]:
        """Return the row of the table; the slowest motion is that of its fastest call."""
        return (self.name, f'{np.median(self.calls):,.0f}',
                f'{np.max(np.min(self.calls, axis=0)):,.0f}',
                f'{np.percentile(self.calls, 99.9):,.0f}', f'{np.max(self.calls) / 1e3:,.0f}')


def motions() -> Motion:
    """Return motions within 0.15 m and 0.3 rad of a pose 1.1 m above the base."""
    rng = np.random.default_rng(20260101)

    def within(bound: float) -> Array:
        return rng.uniform(-bound, bound, (MOTIONS, 3))

    return Motion.from_euler(
        np.array([0.0, 0.0, 1.1]) + within(0.15), within(0.3), within(0.3), within(0.5),
        within(3.0), within(6.0))


def compiled(folder: Path, compiler: str, level: str) -> ctypes.CDLL:
    """Return the source, the hexapod and exported_source.c as a library."""
    library = folder / f'{compiler}{level}.so'
    subprocess.run(
        [compiler, *OPTIONS, level, '-shared', '-fPIC', f'-I{folder}', '-o', library,
         HERE / 'exported_source.c', folder / 'hexapod.c', folder / 'stewart_dynamics.c', '-lm'],
        check=True)
    return ctypes.CDLL(str(library))


def measure(name: str, function: Any, *arrays: Array | None) -> Times:
    """Return the times of CALLS calls on arrays."""
    repeats = CALLS // MOTIONS
    times = np.empty((repeats, MOTIONS))
    function.restype = ctypes.c_int
    for repeat, of_one in enumerate(times):
        failed = function(ctypes.c_size_t(MOTIONS), *(
            None if each is None else ctypes.c_void_p(each.ctypes.data)
            for each in (*arrays, of_one)))
        if (repeat + 1) % BETWEEN_PAUSES == 0:
            time.sleep(PAUSE)
        if name and failed:
            raise SystemExit(f'{name}: {failed} calls of {MOTIONS} fail')
    return Times(name, times)


def library_calls(platform: StewartPlatform, rows: Array) -> Times:
    """Return the times of the library's call for one motion."""
    singles = [Motion.of_rows(row) for row in rows]
    times = np.empty((PYTHON_CALLS // MOTIONS, MOTIONS))
    for of_one in times:
        for n, motion in enumerate(singles):
            begin = time.perf_counter_ns()
            platform.inverse_dynamics(motion)
            of_one[n] = time.perf_counter_ns() - begin
    return Times('`StewartPlatform.inverse_dynamics`, one `Motion`', times)


def node_row() -> tuple[str, ...]:
    """Return the row of the node, from the table that ``make bench-node`` has written."""
    row = next(line for line in (RESULTS / 'node.md').read_text(encoding='utf-8').splitlines()
               if line.startswith(NODE_ROW))
    p50, _, p999, most = (int(cell.replace(',', '')) for cell in row.split('|')[2:6])
    return ('the node at 1 kHz, from message to message ([Node](node.md))', f'{1000 * p50:,}', '',
            f'{1000 * p999:,}', f'{most:,}')


def code_size(folder: Path, compiler: str, level: str) -> int:
    """Return the size of code and constants of stewart_dynamics.c [bytes]."""
    made = folder / 'size.o'
    subprocess.run([compiler, *OPTIONS, level, '-c', folder / 'stewart_dynamics.c', '-o', made],
                   check=True)
    text = subprocess.run(['size', made], check=True, capture_output=True, text=True).stdout
    return int(text.splitlines()[1].split()[0])


def golden(folder: Path, compiler: str, level: str) -> str:
    """Return the last line of the test of golden vectors."""
    program = folder / 'golden'
    subprocess.run([compiler, *OPTIONS, level, *folder.glob('*.c'), '-o', program, '-lm'],
                   check=True)
    done = subprocess.run([program], capture_output=True, text=True)
    return done.stdout.splitlines()[-1].partition(': ')[2]


def run() -> list[str]:
    """Measure; return the lines for the page."""
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        priority = 'SCHED_FIFO'
    except PermissionError:
        priority = 'the priority of any program'
    parameters = Parameters.from_yaml(HERE.parent / 'config' / 'platform.yaml')
    platform, motion = StewartPlatform(parameters), motions()
    rows = motion.rows
    before = rows[:, :12].copy()  # a millisecond before, to first order: still a rotation
    before[:, :3] -= 1e-3 * rows[:, 12:15]
    before[:, 3:] = (Motion.from_euler(
        np.zeros(3), -1e-3 * rows[:, 15:18]).rotation @ motion.rotation).reshape(-1, 9)
    base = BaseMotion([1.0, 0.5, -9.7], [0.3, 0.2, 0.5], [0.1, 0.2, 0.05], [0.2, 0.1, 0.3]).rows
    wrench = np.array([100.0, -50.0, 200.0, 10.0, 20.0, -30.0])
    compilers = [name for name in ('gcc', 'clang') if shutil.which(name)]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, text in c_project(parameters, 'hexapod').items():
            (folder / file).write_text(text, encoding='utf-8')
        table: list[Times] = []
        sizes: list[tuple[str, ...]] = []
        for compiler in compilers:
            library = compiled(folder, compiler, '-O2')
            steps, searches = library.steps, library.searches
            table += [
                measure(f'`stewart_step`, {compiler}', steps, rows, None, None),
                measure(f'`stewart_step` with wrench and moving base, {compiler}', steps, rows,
                        wrench, base),
                measure(f'`stewart_forward_kinematics`, from 1 ms before, {compiler}', searches,
                        rows, before)]
            sizes += [(f'{compiler} {level}', f'{code_size(folder, compiler, level):,}',
                       golden(folder, compiler, level)) for level in LEVELS]
        empty = float(np.median(measure('', library.nothing).calls))
    table.append(library_calls(platform, rows))
    versions = ', '.join(subprocess.run(
        [each, '--version'], check=True, capture_output=True,
        text=True).stdout.splitlines()[0] for each in compilers)
    return [
        '', *markdown([('one call', 'median (ns)', 'slowest motion (ns)', '99.9 % (ns)',
                        'worst (us)'), *(each.row for each in table), node_row()]), '',
        *markdown([('compiler', 'code (bytes)', 'golden vectors'), *sizes]), '',
        f'{processor_name()}, one core, {priority}. {versions}; {" ".join(OPTIONS)}, times with '
        f'-O2. {CALLS:,} calls on {MOTIONS:,} motions, {PYTHON_CALLS:,} of the library; '
        f'{empty:.0f} ns of each are the clock. Load of the computer: '
        f'{os.getloadavg()[0]:.1f}.', '']


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--write', action='store_true', help='put the tables into results/')
    options = parser.parse_args()
    lines = run()
    print('\n'.join(lines))
    if options.write:
        write(lines, BEGIN, END)


if __name__ == '__main__':
    main()
