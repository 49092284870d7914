# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Study of how often stewart_identify notices a wrong model, and names the right cause.

Recordings are simulated with one error each relative to the parameter file, in a motion of all
coordinates and in motions of one, and others that are right, of many kinds. Run by hand, ``make
bench-lack-of-fit``; see README.md in this folder.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
import sys
from typing import NamedTuple

from interval_coverage import HEAVY, in_processes, LIGHT_LEGS, share
from inverse_dynamics import HERE, markdown, measured_on, write
import numpy as np

from stewart_dynamics import Parameters

sys.path.append(str(HERE.parent / 'test'))
from estimate_cases import (  # noqa: E402, I100, I202
    Array, AXES, braked, drawn, GIVEN, identified, MOTIONS, Outcome, QUANTIZED,
    recorded, recording, SECONDS, SENSORS, stopping, tilted, Truth, with_friction)
from independent_hexapod import moving  # noqa: E402, I202
from recorded import Recorded  # noqa: E402, I202
from referees import rng  # noqa: E402, I202
from wrong_models import CAUSES, simulated, true_hexapod  # noqa: E402, I202

BEGIN, END = '<!-- lack of fit: begin -->', '<!-- lack of fit: end -->'
UNEXPLAINED = 'unknown', 'misfit', 'rejected'
Make = Callable[[str, int], tuple[Truth, list[Recorded], Parameters]]


# --- right recordings ----------------------------------------------------------------------------

def _of_right(seed: int) -> Truth:
    """Return a hexapod with legs, gain and tilt of the file, or of an odd seed drawn from it."""
    return drawn(seed) if seed % 2 else with_friction(seed)


def _right(motion: str, seconds: float = SECONDS, **sensors: object) -> Make:
    def make(_: str, seed: int) -> tuple[Truth, list[Recorded], Parameters]:
        truth = _of_right(seed)
        return truth, [recorded(truth, motion, seed, SENSORS._replace(**sensors), seconds)], GIVEN

    return make


def _two_bags(_: str, seed: int) -> tuple[Truth, list[Recorded], Parameters]:
    truth = _of_right(seed)
    return truth, [recorded(truth, each, seed) for each in ('rich', 'heave')], GIVEN


RIGHT: dict[str, Make] = {
    **{each: _right(each) for each in MOTIONS},
    'rich, jitter 0.3 ms': _right('rich', jitter=3e-4),
    'yaw, jitter 0.5 ms': _right('yaw', jitter=5e-4),
    'rich, quantized': _right('rich', steps=QUANTIZED.steps),
    'heave, quantized': _right('heave', steps=QUANTIZED.steps),
    'at rest, quantized': _right('at rest, tilted by 1 deg', steps=QUANTIZED.steps),
    'rich, 60 s': _right('rich', 60.0), 'rich, and heave in a second bag': _two_bags}


# --- wrong ones ----------------------------------------------------------------------------------

def _changed(change: Callable[[Recorded, np.random.Generator], Recorded],
             truth_of: Callable[[int], Truth] = drawn, given: Parameters = GIVEN,
             **sensors: object) -> Make:
    """Return a maker of recordings that are changed."""
    def make(motion: str, seed: int) -> tuple[Truth, list[Recorded], Parameters]:
        truth = truth_of(seed)
        right = recorded(truth, motion, seed, SENSORS._replace(**sensors))
        return truth, [change(right, rng(seed))], given

    return make


def _same(right: Recorded, random: np.random.Generator) -> Recorded:
    return right


def _scaled(factor: float) -> Callable[[Recorded, np.random.Generator], Recorded]:
    return lambda right, random: right._replace(efforts=factor * right.efforts)


def _swapped(*names: str) -> Callable[[Recorded, np.random.Generator], Recorded]:
    def swap(right: Recorded, random: np.random.Generator) -> Recorded:
        a, b = random.choice(6, 2, replace=False)
        order = [{a: b, b: a}.get(leg, leg) for leg in range(6)]
        return right._replace(**{name: getattr(right, name)[:, order] for name in names})

    return swap


def _later(right: Recorded, random: np.random.Generator) -> Recorded:
    """Delay the effort of one leg by 5 ms."""
    leg, efforts = random.integers(6), right.efforts.copy()
    efforts[:, leg] = np.interp(right.times - 5e-3, right.times, efforts[:, leg])
    return right._replace(efforts=efforts)


def _longer(right: Recorded, random: np.random.Generator) -> Recorded:
    return right._replace(positions=right.positions + 2e-3 * np.eye(6)[random.integers(6)])


def _tilted(seed: int) -> Truth:
    turn = rng(seed).uniform(0.0, 2.0 * np.pi)
    angles = np.radians(2.0) * np.cos(turn), np.radians(2.0) * np.sin(turn)
    return drawn(seed)._replace(tilt=angles).changed(gravity=tilted(GIVEN.gravity, *angles))


def _light_legs(seed: int) -> Truth:
    legs = LIGHT_LEGS.parameters
    return drawn(seed).changed(**{f'legs__{part}__mass': legs[f'legs.{part}.mass']
                                  for part in ('cylinder', 'piston')})


def _braked(motion: str, seed: int) -> tuple[Truth, list[Recorded], Parameters]:
    truth, begin = HEAVY, 3.0 + 8.0 * (seed % 2)
    path = MOTIONS[motion](rng(7000 + seed))._replace(warp=stopping(begin, begin + 3.0))
    legs = braked(lambda times: moving(truth.parameters, path(times)), begin, begin + 3.0)
    return truth, [recording(legs, seed)], GIVEN


def _case(name: str) -> Make:
    """Return a maker of the recordings of a case of ``wrong_models``."""
    def make(motion: str, seed: int) -> tuple[Truth, list[Recorded], Parameters]:
        case = CAUSES[name][0](true_hexapod(seed), rng(1000 + seed))
        return Truth(case.true), simulated(case, seed, MOTIONS[motion](rng(7000 + seed))), GIVEN

    return make


_BOTH = 'positions', 'rates'
WRONG: dict[str, tuple[Make, tuple[str, ...]]] = {
    **{name: (_case(name), right) for name, (_, right) in CAUSES.items()},
    'efforts of the other sign': (_changed(_scaled(-1.0)), ('sign',)),
    'efforts in kN': (_changed(_scaled(1e-3)), ('unit',)),
    'torques in place of forces': (_changed(_scaled(0.01 / 2.0 / np.pi), given=GIVEN.replaced(
        {'actuator.screw_lead': 0.01})), ('torque',)),
    'efforts of two legs swapped': (_changed(_swapped('efforts')), ('swapped',)),
    'positions of two legs swapped': (_changed(_swapped(*_BOTH)), ('swapped',)),
    'both of two legs swapped': (_changed(_swapped(*_BOTH, 'efforts')), ('swapped',)),
    'all efforts 20 ms late': (_changed(_same, delay=20e-3), ('delay',)),
    'effort of one leg 5 ms late': (_changed(_later), ('delay',)),
    'zero length of one leg 2 mm off': (_changed(_longer), ('zero_length',)),
    'tilt 2 degrees': (_changed(_same, _tilted), ('tilt',)),
    'leg masses 20 % off': (_changed(_same, _light_legs), ('leg_mass',)),
    'jitter 3 ms': (_changed(_same, jitter=3e-3), ('jitter',)),
    'brakes for 3 s': (_braked, ('brakes', 'held'))}
ALL, ONE = 'all coordinates', 'one coordinate'


class Run(NamedTuple):
    """A recording: its error or kind, the motion, the seed."""

    name: str
    motion: str
    seed: int


def outcome_of(run: Run) -> Outcome:
    """Return the outcome of a run."""
    if not run.motion:
        truth, bags, given = RIGHT[run.name]('', run.seed)
    else:
        axis = AXES[run.seed % 6]
        truth, bags, given = WRONG[run.name][0]('rich' if run.motion == ALL else axis, run.seed)
    return identified(bags, truth, given)


def counts(outcomes: Sequence[Outcome], right: Sequence[str]) -> Array:
    """Return how many were noticed, named right, named wrong, and not explained."""
    names = [each.causes[0] for each in outcomes if each.causes]
    kinds = [0 if each in right else 2 if each in UNEXPLAINED else 1 for each in names]
    return np.array([len(names), *np.bincount(kinds, minlength=3)], dtype=float)


def silent(outcomes: Sequence[Outcome]) -> str:
    """Return the share of intervals that contain the truth where nothing was noticed."""
    judged = [each for outcome in outcomes if not outcome.causes for each in outcome.intervals]
    return f'{share(judged):.0f} %' if judged else '-'


def false_notices(seeds: int) -> list[str]:
    """Return the table of notices on right recordings."""
    runs = [Run(name, '', seed) for name in RIGHT for seed in range(seeds)]
    found = in_processes(outcome_of, runs)
    rows: list[tuple[str, ...]] = [
        ('right recording', 'notices, legs of the file', 'notices, legs drawn', 'causes')]
    for name in RIGHT:
        causes = {run.seed: each.causes[0] for each, run in zip(found, runs, strict=True)
                  if run.name == name and each.causes}
        odd = sum(seed % 2 for seed in causes)
        rows.append((name, f'{len(causes) - odd} of {(seeds + 1) // 2}', f'{odd} of {seeds // 2}',
                     ', '.join(sorted(set(causes.values())))))
    noticed = sum(bool(each.causes) for each in found)
    rows.append(('all', f'{noticed} of {len(found)}', f'{100.0 * noticed / len(found):.1f} %', ''))
    return ['', *markdown(rows)]


def causes_named(seeds: int, only: str) -> list[str]:
    """Return the table of causes named for wrong models."""
    names = [name for name in WRONG if only in name]
    runs = [Run(name, motion, seed) for name in names for motion in (ALL, ONE)
            for seed in range(seeds)]
    found = in_processes(outcome_of, runs)
    cells = 'noticed', 'right', 'wrong', 'not explained', 'truth in silent intervals'
    rows = [('error', *(f'{motion}: {cell}' if n == 0 else cell for motion in (ALL, ONE)
                        for n, cell in enumerate(cells)))]
    total = {motion: np.zeros(4) for motion in (ALL, ONE)}
    for name in names:
        row = [name]
        for motion in (ALL, ONE):
            outcomes = [each for each, run in zip(found, runs, strict=True)
                        if run[:2] == (name, motion)]
            count = counts(outcomes, WRONG[name][1])
            total[motion] += count
            row += [*(f'{each:.0f}' for each in count), silent(outcomes)]
        rows.append(tuple(row))
    rows.append(('all', *(cell for each in total.values() for cell in (
        *(f'{count:.0f}' for count in each), ''))))
    _, right, wrong, _ = sum(total.values())
    given = max(right + wrong, 1.0)
    return ['', *markdown(rows), '', (
        f'{seeds} of each; causes named: {100.0 * right / given:.0f} % right, '
        f'{100.0 * wrong / given:.0f} % wrong; right of all runs: '
        f'{100.0 * right / len(runs):.0f} %.')]


def main() -> None:
    """Run the study and print its tables."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--seeds', type=int, default=10, help='of each error (%(default)s)')
    parser.add_argument('--right', type=int, default=10,
                        help='of each kind of right recordings (%(default)s)')
    parser.add_argument('--only', default='', help='errors that contain this text')
    parser.add_argument('--write', action='store_true', help='put the tables into results/')
    options = parser.parse_args()
    lines = causes_named(options.seeds, options.only) if options.seeds else []
    print('\n'.join(lines), flush=True)
    right = false_notices(options.right) if options.right else []
    right += ['', measured_on(), '']
    print('\n'.join(right))
    if options.write:
        write([*lines, *right], BEGIN, END)


if __name__ == '__main__':
    main()
