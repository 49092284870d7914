# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Errors of the assembly that calibrated zeros of drives show: a horn that sits on another tooth.

A zero z is compared with each step s that an assembly can be off by, and with no step, by the
likelihood of the remaining error. The error has Student's distribution with the scale S of the
zeros of the other legs and the standard error of z, and with few degrees of freedom, as S is
estimated from five zeros. The likelihood ratio is
``((1 + z^2 / (nu S^2)) / (1 + (z - s)^2 / (nu S^2)))^((nu + 1) / 2)``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.legs.calibrated import CalibratedLegs, ZeroStep
from stewart_dynamics.mechanics.least_squares import BY_MEDIAN
from stewart_dynamics.possible_errors.hypothesis import PossibleError

# Logarithm of the likelihood ratio from which a step is named, and up to which others are named
# beside it.
NAMED = ALIKE = math.log(20.0)
_FREEDOM = 3.0  # of the scale of the zeros: the median of five magnitudes
_EXACT = 1e-9  # smallest scale [rad]
_MOST = 1e9  # larger ratios are all the same to a reader
STEP, TURN = 'step', 'turn'
"""Keywords of a step with which a drive works, and of one with which it does not."""


class _Likeliest(NamedTuple):
    leg: int
    evidence: float
    size: float  # of the step, with its sign
    step: ZeroStep
    text: str


def assembly_errors(legs: CalibratedLegs, values: Array, errors: Array, held: Flags,
                    ) -> tuple[PossibleError, ...]:
    """
    Return the legs whose zeros are off by a step, the likeliest first.

    values, errors, held (n,): calibrated numbers, standard errors, and which are the file's.
    """
    if not legs.zero_steps or held[legs.zero].any():
        return ()
    left = values[legs.zero] - legs.values()[legs.zero]
    known = np.where(np.isfinite(errors[legs.zero]), errors[legs.zero], 0.0)
    found: list[tuple[float, PossibleError]] = []
    rest, open_legs = left.copy(), [*range(6)]
    while open_legs:
        best = max((_likeliest(legs, leg, left, rest, known) for leg in open_legs),
                   key=lambda each: each.evidence)
        if best.evidence < NAMED:
            break
        rest[best.leg] = left[best.leg] - best.size
        open_legs.remove(best.leg)
        found.append((best.evidence, PossibleError(
            STEP if best.step.mounted else TURN, best.text)))
    return tuple(each for _, each in sorted(found, key=lambda each: -each[0]))


def _likeliest(legs: CalibratedLegs, leg: int, zeros: Array, rest: Array, errors: Array,
               ) -> _Likeliest:
    """Return the step that is likeliest for a leg."""
    others = np.delete(rest, leg)
    scale = math.hypot(BY_MEDIAN * float(np.median(np.abs(others))), errors[leg]) + _EXACT

    def likelihood(size: float) -> float:
        return -0.5 * (_FREEDOM + 1.0) * math.log1p(
            (zeros[leg] - size) ** 2 / (_FREEDOM * scale ** 2))

    sign = math.copysign(1.0, zeros[leg])
    tried = sorted(((likelihood(sign * step.size), step) for step in legs.zero_steps),
                   key=lambda each: -each[0])
    best, step = tried[0]
    evidence = best - likelihood(0.0)
    alike = [each for value, each in tried if value > best - ALIKE]
    joint = legs.parameters.joints[leg]
    way = 'far' if sign > 0.0 else 'far back'
    text = (f'the {legs.zero_part} of {joint} sits {_words(alike)} too {way}: its zero is '
            f'{math.degrees(zeros[leg]):.3g} deg from that of the file, '
            f'{times_as_likely(evidence)} as likely by that as by an error like those of the '
            'others')
    return _Likeliest(leg, evidence, sign * step.size, step, text)


def times_as_likely(evidence: float) -> str:
    """Return a likelihood ratio, given by its logarithm, in words."""
    if evidence >= math.log(_MOST):
        return 'more than 1e9 times'
    ratio = math.exp(evidence)
    return f'{ratio:.2g} times' if ratio < 1e3 else f'{ratio:.0e} times'.replace('e+0', 'e')


def _words(steps: list[ZeroStep]) -> str:
    """Return steps in words, those of the same words together."""
    groups: dict[str, list[str]] = {}
    for each in steps:
        groups.setdefault(each.words, []).append(each.kind)
    return ' or '.join(f'{words} ({" or ".join(kinds)})' for words, kinds in groups.items())
