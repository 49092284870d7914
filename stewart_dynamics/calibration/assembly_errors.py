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

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.legs.calibrated import CalibratedLegs, ZeroStep
from stewart_dynamics.mechanics.least_squares import BY_MEDIAN
from stewart_dynamics.possible_errors.hypothesis import likeliest, PossibleError

# Logarithm of the likelihood ratio from which a step is named, and up to which others are named
# beside it.
NAMED = ALIKE = math.log(20.0)
_FREEDOM = 3.0  # of the scale of the zeros: the median of five magnitudes
_EXACT = 1e-9  # smallest scale [rad]
_MOST = 1e9  # larger ratios are all the same to a reader
STEP, TURN = 'step', 'turn'
"""Keywords of a step with which a drive works, and of one with which it does not."""


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
    while alike := sorted(likeliest(
            ((_misfit(left[leg], np.delete(rest, leg), known[leg], step), (leg, step))
             for leg in open_legs for step in legs.zero_steps),
            -NAMED, ALIKE, logarithms=True), key=lambda each: each[0]):
        misfit, (leg, best) = alike[0]
        rest[leg] = left[leg] - math.copysign(best.size, left[leg])
        open_legs.remove(leg)
        steps = _words([step for _, (of, step) in alike if of == leg])
        way = 'far' if left[leg] > 0.0 else 'far back'
        found.append((misfit, PossibleError(STEP if best.mounted else TURN, (
            f'the {legs.zero_part} of {legs.parameters.joints[leg]} sits {steps} too {way}: its '
            f'zero is {math.degrees(left[leg]):.3g} deg from that of the file, '
            f'{times_as_likely(-misfit)} as likely by that as by an error like those of the '
            'others'))))
    return tuple(each for _, each in sorted(found, key=lambda each: each[0]))


def _misfit(zero: float, others: Array, error: float, step: ZeroStep) -> float:
    """Return the logarithm of the likelihood of no step by that of a step."""
    scale = math.hypot(BY_MEDIAN * float(np.median(np.abs(others))), error) + _EXACT
    without, of_step = (math.log1p((zero - size) ** 2 / (_FREEDOM * scale ** 2))
                        for size in (0.0, math.copysign(step.size, zero)))
    return 0.5 * (_FREEDOM + 1.0) * (of_step - without)


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
