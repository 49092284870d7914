# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Study of how often the intervals of stewart_identify and of the payload contain the truth.

True hexapods are drawn from the uncertainty of the parameter file, legs, gain, reflected masses
and tilt included, see ``test/estimate_cases.py``, with telescopic legs or, ``--legs crank``, with
cranks. ``--table`` shows the answers to recordings that are poor, or in conflict with the file.
Run by hand, ``make bench-coverage``; see README.md in this folder.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
import os
import sys
import time
from typing import Any, NamedTuple

from inverse_dynamics import HERE, markdown, measured_on, write
import numpy as np

from stewart_dynamics import StewartPlatform
from stewart_dynamics.external_wrench.payload import identify

sys.path.append(str(HERE.parent / 'test'))
from estimate_cases import (  # noqa: E402, I100, I202
    about_tilted, AXES, braked, CASES, CLOSED_LOOP, drawn, EXACT, FILE, GIVEN, history_of,
    identified, Judged, MOTIONS, one_axis, Outcome, payload, PAYLOAD_SECONDS, PAYLOAD_SENSORS,
    prior, RATE, recorded, recording, rich, SECONDS, SENSORS, stopping, Truth, with_friction)
from independent_hexapod import moving  # noqa: E402, I202
from recorded import Noise  # noqa: E402, I202
from referees import rng  # noqa: E402, I202

BEGIN, END = '<!-- coverage: begin -->', '<!-- coverage: end -->'
BEGIN_CRANKS, END_CRANKS = (
    '<!-- coverage of cranks: begin -->', '<!-- coverage of cranks: end -->')
BEGIN_TABLE, END_TABLE = '<!-- estimates: begin -->', '<!-- estimates: end -->'
PAYLOAD = 'payload: '
# Motions of the payload service.
OF_PAYLOAD = 'rich', 'heave', 'slow', 'creeping', 'at rest, tilted by 2 deg', 'gentle, then rest'
GROUPS = {'mass': 'platform.mass', **{f'center {axis}': f'platform.center_of_mass.{axis}'
                                      for axis in 'xyz'},
          'inertia': 'platform.inertia', 'viscous': 'actuator.viscous_friction',
          'Coulomb': 'actuator.coulomb_friction'}
# Further columns for cranks, and sampling rates: 200 recordings of cranks have few samples.
OF_CRANKS = {'rotors': 'actuator.reflected_inertia', 'moments': 'legs.crank.first_moment',
             'K1': 'legs.crank.shaft_inertia', 'K2': 'legs.crank.shaft_moment.e',
             'm_c y_c': 'legs.crank.shaft_moment.n', 'm_ab': 'legs.rod.coupling_mass'}
ASKED = {'telescopic': ('platform', 'friction'),
         'crank': ('platform', 'friction', 'reflected_inertia', 'crank')}
RATES = {'telescopic': RATE, 'crank': 100.0}


def in_processes(function: Callable[[Any], Any], runs: Sequence[Any]) -> list[Any]:
    """Return the results of all runs, in two processes of one thread each."""
    for name in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS'):
        os.environ[name] = '1'
    with ProcessPoolExecutor(2, get_context('spawn')) as pool:
        return list(pool.map(function, runs, chunksize=4))


# --- coverage ------------------------------------------------------------------------------------

class Run(NamedTuple):
    """A motion, and the seed of everything else."""

    motion: str
    seed: int
    legs: str = 'telescopic'
    friction: bool = True


def outcome_of(run: Run) -> Outcome:
    """Return the outcome for a hexapod that is drawn."""
    given = CASES[run.legs].given
    if not run.friction:
        given = given.replaced(dict.fromkeys(
            ('actuator.viscous_friction', 'actuator.coulomb_friction'), 0.0))
    truth, rate = drawn(run.seed, given), RATES[run.legs]
    if run.motion.startswith(PAYLOAD):
        return payload(truth, run.motion.removeprefix(PAYLOAD), run.seed, given=given)
    return identified([recorded(truth, run.motion, run.seed, rate=rate)], truth, given, rate,
                      hold_out=0.0, kinds=ASKED[run.legs])


def by_parameter(judged: Sequence[Judged]) -> dict[str, list[Judged]]:
    """Return the estimates by parameter; friction by its kind."""
    found: dict[str, list[Judged]] = {}
    for each in judged:
        name = each.name if each.name.startswith('platform') else each.name.rpartition('.')[0]
        found.setdefault(name, []).append(each)
    return found


def share(judged: Sequence[Judged]) -> float:
    """Return the percentage of intervals that contain the true value."""
    return float(100.0 * np.mean([each.holds for each in judged])) if judged else np.nan


def over_parameters(judged: Sequence[Judged]) -> tuple[str, str]:
    """Return the mean of the shares over the parameters, and the lowest with its parameter."""
    shares = {name: share(each) for name, each in by_parameter(judged).items() if len(each) > 4}
    if not shares:
        return '-', '-'
    lowest = min(shares, key=lambda name: shares[name])
    return (f'{np.mean(list(shares.values())):.1f} %',
            f'{shares[lowest]:.1f} % ({lowest.partition(".")[2]})')


def summary(motion: str, outcomes: Sequence[Outcome]) -> tuple[str, ...]:
    """Return the row of a motion."""
    judged = [each for outcome in outcomes for each in outcome.intervals]
    sure = [each for each in judged if each.identified]
    return (motion, *over_parameters(judged), *over_parameters(sure),
            f'{len(sure) / len(outcomes):.1f}',
            f'{np.median([each.half / width(each) for each in judged]):.2g}' if judged
            else '-', f'{sum(bool(each.causes) for each in outcomes)} of {len(outcomes)}')


def width(each: Judged) -> float:
    """Return the deviation by which the file knows a value; of friction, its own size there."""
    return prior(each.name) if each.name in FILE.values() else each.prior


def details(motion: str, outcomes: Sequence[Outcome], groups: dict[str, str]) -> Iterator[str]:
    """Yield the cells of a motion: for each group the share, and the width by the prior."""
    yield motion
    for begin in groups.values():
        judged = [each for outcome in outcomes for each in outcome.intervals
                  if each.name.startswith(begin)]
        yield '-' if not judged else f'{share(judged):.1f} %, ' + (
            f'{np.median([each.half / width(each) for each in judged]):.2g}')


def coverage(seeds: int, motions: Sequence[str], legs: str, friction: bool) -> list[str]:
    """Return the tables of how many intervals contain the true value."""
    runs = [Run(motion, seed, legs, friction) for motion in motions for seed in range(seeds)]
    groups = {**GROUPS, **(OF_CRANKS if legs == 'crank' else {})}
    found = in_processes(outcome_of, runs)
    of_motion = {motion: [outcome for outcome, run in zip(found, runs, strict=True)
                          if run.motion == motion] for motion in motions}
    return ['', *markdown([
        ('motion', 'truth in intervals', 'lowest', 'identified alone', 'lowest',
         'identified of a run', 'half of the interval by the prior', 'runs with a notice'),
        *(summary(*each) for each in of_motion.items())]), '', *markdown([
            ('motion', *groups), *(tuple(details(*each, groups)) for each in of_motion.items())]),
            '', f'{seeds} seeds of each motion.', '']


# --- recordings that are poor, or in conflict with the file --------------------------------------

def shown(each: Judged) -> str:
    """Return an estimate in words."""
    _, _, name = each.name.partition('.')
    if np.isnan(each.half):
        return f'{name} {each.value:.5g} (no interval) for {each.truth:.5g}'
    return (f'{name} {each.value:.5g} +- {each.half:.2g} for {each.truth:.5g}: {each.miss:.2g} '
            f'half-widths{"" if each.identified else ", not identified"}')


def came_out(found: Outcome, *names: str) -> str:
    """Return an outcome in words: named estimates, the worst one, and the notice."""
    parts = [shown(found.of(name)) for name in names if found.judged]
    if found.intervals:
        worst = max(found.intervals, key=lambda each: each.miss)
        parts += [f'worst {shown(worst)}', f'{sum(each.holds for each in found.intervals)} of '
                  f'{len(found.intervals)} intervals hold']
    said = f'{", ".join(found.causes)}: {found.notices[0][:150]}' if found.causes else 'no notice'
    return '; '.join([*parts, said])


MASS, X, Y = 'platform.mass', 'platform.center_of_mass.x', 'platform.center_of_mass.y'
LOW = FILE.changed(platform__center_of_mass=GIVEN.platform.center_of_mass + [0.0, 0.0, 0.06])
LIGHT_LEGS = FILE.changed(**{f'legs__{part}__mass': GIVEN[f'legs.{part}.mass'] / 1.2
                             for part in ('cylinder', 'piston')})
HEAVY = FILE.changed(platform__mass=172.0)


def in_motion(truth: Truth, motion: str, *names: str, **sensors: Any) -> str:
    """Return the outcome for a motion of MOTIONS."""
    return came_out(identified([recorded(
        truth, motion, 1, SENSORS._replace(**sensors))], truth), *names)


def tilted_heave(degrees: float) -> str:
    """Return the outcome of heave about a tilted pose."""
    path = about_tilted(degrees, rng(1), one_axis('heave', rng(2)))
    legs = recording(lambda times: moving(LOW.parameters, path(times)), 1)
    return came_out(identified([legs], LOW), X, Y)


def payload_at_rest(degrees: int) -> str:
    """Return the outcome without Coulomb friction, which could hold a part of the weight."""
    truth = LOW.changed(actuator__coulomb_friction=0.0)
    given = GIVEN.replaced({'actuator.coulomb_friction': 0.0})
    found = payload(truth, f'at rest, tilted by {degrees} deg', 1, given=given)
    return came_out(found, MASS, X, Y)


def slow_payload() -> str:
    found = [payload(HEAVY, 'creeping', seed) for seed in range(40)]
    of_each = {name: [each.of(name) for each in found if each.judged] for name in (MASS, X)}
    return '; '.join(f'{name.partition(".")[2]} in {share(each):.0f} % of {len(each)}'
                     for name, each in of_each.items())


def rotors() -> str:
    truth = FILE.changed(actuator__reflected_mass=1030.0, limits__force_max=None)
    return came_out(identified([recorded(
        truth, 'gentle, then rest', 1, EXACT)], truth, truth.parameters), 'platform.inertia.xx')


def brakes(mass: float, begin: float, sensors: Noise, given_mass: float) -> str:
    truth, given = (FILE.changed(platform__mass=each) for each in (mass, given_mass))
    path = rich(rng(3))._replace(warp=stopping(begin, begin + 3.0))
    legs = braked(lambda times: moving(truth.parameters, path(times)), begin, begin + 3.0)
    return came_out(identified([recording(legs, 1, sensors, seconds=28.0)], truth,
                               given.parameters), MASS)


def in_closed_loop() -> str:
    found = [identified([recorded(truth, 'yaw in closed loop', seed, SENSORS._replace(
        delay=1e-3))], truth) for seed, truth in enumerate(map(with_friction, range(10)))]
    viscous = [each for outcome in found for each in outcome.intervals if 'viscous' in each.name]
    return (f'viscous friction in {share(viscous):.0f} % of {len(viscous)}; delay '
            f'{1e3 * np.nanmedian([each.delay for each in found]):.2f} for 1.00 ms; notices: '
            f'{sum(bool(each.causes) for each in found)} of {len(found)}')


def jitter() -> str:
    motions = 'rich', 'heave', 'yaw', 'sweep', 'rich', 'roll'
    found = [identified([recorded(with_friction(seed), motion, seed, SENSORS._replace(
        jitter=1e-4 * (2 + seed % 4)))], with_friction(seed))
        for seed, motion in enumerate(motions)]
    return (f'{sum(bool(each.causes) for each in found)} of {len(found)} noticed: '
            f'{", ".join(each.causes[0] for each in found if each.causes)}')


def opposite() -> str:
    legs = recorded(FILE, 'heave', 1, EXACT)
    return came_out(identified([legs._replace(efforts=-legs.efforts)], FILE))


def heavier_at_rest() -> str:
    given = recorded(FILE, 'at rest, tilted by 1 deg', 1, EXACT).efforts.mean()
    more = recorded(HEAVY, 'at rest, tilted by 1 deg', 1, EXACT).efforts.mean()
    truth = FILE.changed(platform__mass=150.0 + 22.0 * 0.28 * given / (more - given))
    return in_motion(truth, 'at rest, tilted by 1 deg', MASS)


ROWS: dict[str, Callable[[], str]] = {
    **{f"heave about {each:g} deg, the file's center 60 mm too low":
       lambda each=each: tilted_heave(each) for each in (1.0, 2.0, 2.8)},
    **{f"payload at rest, {each} deg, no Coulomb friction, the file's center 60 mm too low":
       lambda each=each: payload_at_rest(each) for each in (1, 2)},
    'payload, legs below 8 mm/s, rates noisy by 1 mm/s, right model, 40 seeds': slow_payload,
    **{f'leg masses 20 % too large in the file, {each}':
       lambda each=each: in_motion(LIGHT_LEGS, each, MASS)
       for each in ('heave', 'surge', 'yaw', 'roll', 'sweep')},
    'leg masses 20 % too large in the file, payload': lambda: came_out(payload(
        LIGHT_LEGS.changed(platform__mass=172.0), 'rich', 1), MASS),
    **{f'gain of all efforts 2 %, {each}':
       lambda each=each: in_motion(FILE._replace(gain=1.02), each, MASS)
       for each in ('rich', *AXES, 'sweep')},
    **{f'reflected mass -20 %, {each}': lambda each=each: in_motion(
        FILE.changed(actuator__reflected_mass=24.0), each, MASS) for each in ('roll', 'rich')},
    'rotors of 1,030 kg a leg, gentle, then rest, no noise': rotors,
    'brakes for 3 s before 25 s of motion, no noise': lambda: brakes(250.0, 0.0, EXACT, 250.0),
    'brakes for 3 s before 25 s of motion': lambda: brakes(230.0, 0.0, SENSORS, 150.0),
    'brakes for 3 s in the middle': lambda: brakes(230.0, 14.0, SENSORS, 150.0),
    'yaw in closed loop, 10 seeds': in_closed_loop,
    'jitter 0.2 to 0.5 ms, right model, 6 seeds': jitter,
    'efforts exactly -1 times the model, heave': opposite,
    'at rest, right, heavier payload: efforts 1.28 times the file': heavier_at_rest}


def answer(row: str) -> tuple[str, str]:
    """Return a row of the table."""
    return row, ROWS[row]()


def milliseconds() -> float:
    """Return the processor time of the payload service for its window at 1 kHz [ms]."""
    path = rich(rng(1))
    given = recording(lambda times: moving(HEAVY.parameters, path(times)), 1, PAYLOAD_SENSORS,
                      seconds=PAYLOAD_SECONDS, rate=1000.0)
    history, took = history_of(given, path(given.times)), []
    for _ in range(9):
        begin = time.thread_time()
        *_, outcome = identify(history, StewartPlatform(GIVEN))
        took.append(1e3 * (time.thread_time() - begin))
    assert outcome is not None and outcome.payload is not None
    return min(took)


def seconds() -> float:
    """Return the processor time of an identification from 20 s at 1 kHz, the least of three."""
    path, took = rich(rng(1)), []
    legs = recording(lambda times: moving(HEAVY.parameters, path(times)), 1, rate=1000.0)
    for _ in range(3):
        begin = time.process_time()
        found = identified([legs], HEAVY, rate=1000.0)
        took.append(time.process_time() - begin)
        assert found.causes == ()
    return min(took)


def table(only: str) -> list[str]:
    """Return the table of poor recordings."""
    rows = in_processes(answer, [each for each in ROWS if only in each])
    of_payload, of_identification = in_processes(called, (milliseconds, seconds))
    return ['', *markdown([('recording', 'answer'), *rows]), '',
            f'The payload of {PAYLOAD_SECONDS:.0f} s at 1 kHz takes {of_payload:.0f} ms of '
            f'processor time, an identification from {SECONDS:.0f} s at 1 kHz '
            f'{of_identification:.1f} s.', '']


def called(function: Callable[[], float]) -> float:
    """Return the result of a function, in a process of one thread."""
    return function()


def main() -> None:
    """Run the study and print its tables."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--seeds', type=int, default=200, help='of each motion (%(default)s)')
    parser.add_argument('--only', default='', help='motions or rows that contain this text')
    parser.add_argument('--table', action='store_true', help='poor recordings, not the coverage')
    parser.add_argument('--legs', choices=list(CASES), default='telescopic', help='kind of legs')
    parser.add_argument('--no-friction', dest='friction', action='store_false',
                        help='neither the hexapods nor the file have friction')
    parser.add_argument('--write', action='store_true', help='put the tables into results/')
    options = parser.parse_args()
    motions = [each for each in (*MOTIONS, *(f'{PAYLOAD}{each}' for each in OF_PAYLOAD))
               if options.only in each and (
                   options.legs == 'telescopic' or CLOSED_LOOP not in each)]
    lines = table(options.only) if options.table else coverage(
        options.seeds, motions, options.legs, options.friction)
    lines += [measured_on(), '']
    print('\n'.join(lines))
    if options.write:
        write(lines, *((BEGIN_TABLE, END_TABLE) if options.table else (BEGIN, END)
                       if options.legs == 'telescopic' else (BEGIN_CRANKS, END_CRANKS)))


if __name__ == '__main__':
    main()
