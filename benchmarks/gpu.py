# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Many hexapods at once: on a GPU, on all processors, and beside general engines.

Run by hand, ``make bench-gpu``, on a computer with a GPU; it takes some minutes. --device cpu
measures the processors alone. Engines that are not installed are named with the reason. See
README.md beside this file.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from functools import partial
import os
from pathlib import Path
import platform
import statistics
import time
from typing import Any, NamedTuple

from inverse_dynamics import markdown, write
import numpy as np

from stewart_dynamics import Motion, StewartError, StewartPlatform
from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.description.mjcf import mjcf
from stewart_dynamics.gpu import Hexapods

ROOT = Path(__file__).resolve().parent.parent
BEGIN, END = '<!-- gpu: begin -->', '<!-- gpu: end -->'
FILES = {'telescopic': 'platform.yaml', 'crank': 'crank_platform.yaml'}
STEP = 5e-4  # of the engines [s]


class Row(NamedTuple):
    """A figure: the work, its device, how many are done a second, and the target."""

    what: str
    device: str
    rate: float
    target: float = 0.0

    @property
    def cells(self) -> tuple[str, ...]:
        """Return the row of a table."""
        return (self.what, self.device, f'{self.rate:.2e}',
                f'{self.target:.0e}' if self.target and self.device != 'cpu' else '')


def rate(work: Callable[[], object], count: float, wait: Callable[[], object],
         rounds: int) -> float:
    """Return how many of ``count`` are done a second, the median of rounds."""
    work()  # compiles
    wait()
    seconds = []
    for _ in range(rounds):
        begun = time.perf_counter()
        work()
        wait()
        seconds.append(time.perf_counter() - begun)
    return count / statistics.median(seconds)


def motions_of(of: StewartPlatform, count: int) -> np.ndarray:
    """Return rows of random motions near home (N, 24)."""
    random, home = np.random.default_rng(1), of.home_pose()
    size = of.parameters.singularity.characteristic_length
    return Motion(
        home.position + 0.02 * size * random.normal(size=(count, 3)), home.rotation,
        *(scale * random.normal(size=(count, 3)) for scale in (0.3 * size, 0.5, size, 2.0))).rows


def inverse_dynamics(name: str, legs: str, count: int, rounds: int) -> Iterator[Row]:
    """Measure the inverse dynamics of motions."""
    of = StewartPlatform.from_yaml(ROOT / 'config' / FILES[legs])
    hexapods = Hexapods(of, count, device=name)
    xp, wait = hexapods.xp, waiting(hexapods)
    rows = xp.asarray(np.resize(motions_of(of, min(count, 100_000)), (count, 24)))
    for layout, given in (('arrays of numbers', xp.asfortranarray(rows)), ('rows', rows)):
        for conditioned, target in ((True, 3e9), (False, 5e9)):
            found = rate(lambda given=given, conditioned=conditioned: hexapods.inverse_dynamics(
                given, condition=conditioned, singular='nan'), count, wait, rounds)
            with_it = 'with' if conditioned else 'without'
            yield Row(f'inverse dynamics of {legs} legs, {with_it} condition number, {layout}, '
                      f'{count:,}', hexapods.device, found,
                      target if legs == 'telescopic' and layout != 'rows' else 0.0)


def equal_bits(name: str, legs: str, count: int) -> str:
    """
    Compare the kernels with the lanes of the library, over motions of 100 random hexapods.

    Few samples of a hexapod in a call take the loops of the kernels on a CPU, too.
    """
    of, random = StewartPlatform.from_yaml(ROOT / 'config' / FILES[legs]), np.random.default_rng(2)
    p, shape = of.parameters, (100, 6, 3)
    size = p.singularity.characteristic_length
    own = {'platform.mass': p.platform.mass * random.uniform(0.5, 2.0, 100), **{
        each: p[each] + 0.01 * size * random.normal(size=shape)
        for each in ('geometry.base_joints', 'geometry.platform_joints')}}
    known, found = Hexapods(of, 100, own, device='cpu'), Hexapods(of, 100, own, device=name)
    rows = motions_of(of, count).reshape(-1, 100, 24)
    wrench = 0.1 * p.platform.mass * random.normal(size=(len(rows), 100, 6))
    results = known.inverse_dynamics(rows, wrench, singular='nan').rows
    part = 4 if name == 'cpu' else len(rows)
    equal = 0
    for begin in range(0, len(rows), part):
        of_part = slice(begin, begin + part)
        others = found.to_host(found.inverse_dynamics(
            *(found.xp.asarray(each[of_part]) for each in (rows, wrench)), singular='nan').rows)
        equal += int(((others == results[of_part]) | np.isnan(others) & np.isnan(
            results[of_part])).all(axis=-1).sum())
    return (f'{legs} legs: all bits of {equal:,} of {rows.shape[0] * 100:,} motions of 100 random '
            f'hexapods are those of the lanes ({found.device}), '
            f'{np.isfinite(results).all(axis=-1).mean():.1%} of them within reach.')


def steps(name: str, legs: str, count: int, number: int, rounds: int, own: bool) -> Row:
    """Measure the steps of the simulator."""
    of = StewartPlatform.from_yaml(ROOT / 'config' / FILES[legs])
    masses = {'payload.mass': np.linspace(1.0, 50.0, count)} if own else None
    hexapods = Hexapods(of, count, masses, device=name)
    home = Motion.from_pose(of.home_pose())
    efforts = getattr(of.inverse_dynamics(home), of.parameters.leg_kind.effort.field)
    commands = hexapods.xp.asarray(np.tile(efforts, (count, 1)))
    hexapods.reset()
    found = rate(lambda: hexapods.step(commands, steps=number), count * number,
                 waiting(hexapods), rounds)
    what = f'steps of {legs} legs' + ', own payloads' * own
    return Row(f'{what}, {number} a call, {count:,}', hexapods.device, found,
               0.0 if own or legs != 'telescopic' else 5e9 if number > 1 else 1e9)


def waiting(hexapods: Hexapods) -> Callable[[], object]:
    """Return a function that waits until all is computed."""
    if hexapods.device == 'cpu':
        return lambda: None
    return lambda: hexapods.xp.cuda.get_current_stream().synchronize()


def model_of(of: StewartPlatform) -> Any:
    """Return the model of MuJoCo of the hexapod, with the step of the engines."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(mjcf(Hexapod(of.parameters), 'hexapod'))
    model.opt.timestep = STEP
    return model


def mujoco_c(model: Any, count: int, number: int) -> Row:
    """Measure MuJoCo in C on all processors."""
    from concurrent.futures import ThreadPoolExecutor

    import mujoco

    threads = len(os.sched_getaffinity(0))
    data = [mujoco.MjData(model) for _ in range(threads)]

    def run(each: Any) -> None:
        mujoco.mj_step(model, each, nstep=number * count // threads)

    with ThreadPoolExecutor(threads) as pool:
        found = rate(lambda: list(pool.map(run, data)), number * count // threads * threads,
                     lambda: None, 1)
    return Row(f'steps of MuJoCo {mujoco.__version__} in C, {threads} threads', 'cpu', found)


def mujoco_warp(model: Any, count: int, number: int) -> Row:
    """Measure MuJoCo Warp, in single precision, as a graph of CUDA."""
    import mujoco
    import mujoco_warp
    import warp

    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    on_device = mujoco_warp.put_model(model)
    worlds = mujoco_warp.put_data(model, data, nworld=count)
    mujoco_warp.step(on_device, worlds)
    with warp.ScopedCapture() as capture:
        mujoco_warp.step(on_device, worlds)

    def run() -> None:
        for _ in range(number):
            warp.capture_launch(capture.graph)

    found = rate(run, count * number, warp.synchronize, 3)
    return Row(f'steps of MuJoCo Warp, {count:,}', 'cuda', found)


def mjx(model: Any, count: int, number: int) -> Row:
    """Measure MJX."""
    import jax
    from mujoco import mjx as engine

    on_device = engine.put_model(model)
    one = engine.make_data(on_device)
    worlds = jax.vmap(lambda _: one)(jax.numpy.arange(count))
    step = jax.jit(jax.vmap(lambda data: jax.lax.fori_loop(
        0, number, lambda _, each: engine.step(on_device, each), data)))
    found = rate(lambda: jax.block_until_ready(step(worlds)), count * number, lambda: None, 1)
    return Row(f'steps of MJX, {count:,}', 'cuda', found)


def engines(gpu: bool, small: bool) -> Iterator[Row | str]:
    """Measure general engines on the same hexapod; a text says why one is not measured."""
    of = StewartPlatform.from_yaml(ROOT / 'config' / 'platform.yaml')
    try:
        model = model_of(of)
    except (ImportError, StewartError, ValueError) as exc:
        yield f'MuJoCo: not measured: {exc}'
        return
    trials: dict[str, Callable[[], Row]] = {
        'MuJoCo': lambda: mujoco_c(model, 64, 20 if small else 200)}
    if gpu:
        trials |= {f'MuJoCo Warp, {count:,}': partial(mujoco_warp, model, count, 20)
                   for count in (4096, 16384, 65536)} | {'MJX': partial(mjx, model, 4096, 20)}
    for name, trial in trials.items():
        try:
            yield trial()
        except Exception as exc:  # of whatever an engine raises: the other figures stay
            yield f'{name}: not measured: {" ".join(str(exc).split())[:150]}.'


def card() -> str:
    """Return the name of the GPU, with driver and memory."""
    import cupy

    found = cupy.cuda.runtime.getDeviceProperties(0)
    memory = found['totalGlobalMem'] / 2 ** 30
    return (f'{found["name"].decode()}, {memory:.0f} GiB, CUDA '
            f'{cupy.cuda.runtime.runtimeGetVersion()}, CuPy {cupy.__version__}')


def processor() -> str:
    """Return the processor and how many of them there are."""
    names = [line.partition(': ')[2] for line in Path('/proc/cpuinfo').read_text().splitlines()
             if line.startswith('model name')] if Path('/proc/cpuinfo').exists() else []
    return f'{len(os.sched_getaffinity(0))} of {names[0] if names else platform.processor()}'


def measured(gpu: bool, small: bool, rounds: int) -> tuple[list[Row], list[str]]:
    """Return all figures; then which bits are equal, and the reasons for missing figures."""
    rows: list[Row] = []
    device, lanes = ('cuda' if gpu else 'cpu'), 2 ** 14 if small else 2 ** 20
    for legs in FILES:
        rows += inverse_dynamics(device, legs, 2 ** 23 if gpu else lanes, rounds)
    counts = (4096, 65536, 2 ** 18, 2 ** 20) if gpu else (256,) if small else (4096,)
    rows += [steps(device, 'telescopic', count, 100, rounds, False) for count in counts]
    if gpu:
        rows += [steps(device, 'telescopic', 2 ** 18, 1, rounds, False),
                 steps(device, 'telescopic', 2 ** 18, 100, rounds, True),
                 steps(device, 'crank', 2 ** 18, 100, rounds, False)]
        rows += inverse_dynamics('cpu', 'telescopic', lanes, 3)
        rows.append(steps('cpu', 'telescopic', 4096, 100, 1, False))
    found = list(engines(gpu, small))
    bits = [equal_bits(device, legs, 10_000 if small else 1_000_000) for legs in FILES]
    return ([*rows, *(each for each in found if isinstance(each, Row))],
            [*bits, *(each for each in found if isinstance(each, str))])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--device', choices=('cpu', 'cuda'), default='cuda')
    parser.add_argument('--small', action='store_true', help='fewer, to see that it runs')
    parser.add_argument('--rounds', type=int, default=7, help='of each call (%(default)s)')
    parser.add_argument('--write', action='store_true', help='put the table into results/')
    options = parser.parse_args()
    gpu = options.device == 'cuda'
    try:
        where = card() if gpu else 'no GPU'
        rows, missing = measured(gpu, options.small, options.rounds)
    except (StewartError, ImportError, RuntimeError) as exc:
        parser.exit(1, f'gpu: {" ".join(str(exc).split())}\n')
    lines = ['', *markdown([('work', 'device', 'a second', 'target'),
                            *(row.cells for row in rows)]), '',
             f'{where}; {processor()}; {time.strftime("%Y-%m-%d")}. Medians of '
             f'{options.rounds} rounds; steps are of the Runge-Kutta method, four '
             'accelerations each.', *missing, '']
    print('\n'.join(lines))
    if options.write:
        write(lines, BEGIN, END)


if __name__ == '__main__':
    main()
