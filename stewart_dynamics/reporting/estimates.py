# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Estimated parameters as results show them: states, intervals, combinations; as JSON and as text.

The results of identification and calibration are records of their own, ``EstimationResult`` and
more keys.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Annotated, Any

from msgspec import UNSET, UnsetType
import numpy as np

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.estimation.confidence_level import INTERVAL, TWO_SIDED
from stewart_dynamics.mechanics.least_squares import combinations, Identifiability, LEAST_SHARE
from stewart_dynamics.program import SOFTWARE
from stewart_dynamics.records import means, Number, Record

IDENTIFIED, IN_COMBINATION, NOT_IDENTIFIABLE = 'identified', 'in_combination', 'not_identifiable'
FIXED = 'fixed'  # held at the file's value by an option

HOLD_OUT = 0.2  # share of the data that validates a fit to the rest, by default
WITHOUT_VALUE = {IN_COMBINATION: 'only in a combination', FIXED: 'fixed',
                 NOT_IDENTIFIABLE: 'not identifiable'}
# Numbers below _SMALL with more decimals have an exponent.
_MOST_DECIMALS, _SMALL = 9, 1e-4


class _Uncertain:
    """A number with a standard error, as tables show it."""

    __slots__ = ()
    value: float
    standard_error: Number

    @property
    def half(self) -> Number:
        """Return half of the 95 % interval."""
        return None if self.standard_error is None else TWO_SIDED * self.standard_error

    @property
    def digits(self) -> int:
        """Return the decimals that the standard error justifies."""
        return error_decimals(self.standard_error) if self.standard_error else 4


class Estimate(_Uncertain, Record):
    """An estimated parameter."""

    name: Annotated[str, means('name of the parameter; of a leg it ends with the name of the leg')]
    unit: Annotated[str, means('its unit')]
    file: Annotated[float, means('value of the file')]
    value: Annotated[float, means('estimate')]
    state: Annotated[str, means('`identified`, `in_combination`, `not_identifiable` or `fixed`')]
    standard_error: Annotated[Number, means('standard error; null: not known')]
    interval: Annotated[tuple[float, float] | None, means('95 % interval')]
    unknown_share: Annotated[float, means('0: identifiable by itself')]
    at_bound: Annotated[bool, means('no body has the values that fit best')]
    file_deviation: Annotated[float | UnsetType, means('standard error of `file`')] = UNSET
    written: Annotated[float | UnsetType, means('the value in `identified.yaml`')] = UNSET
    parts: Annotated[dict[str, float] | UnsetType, means(
        'standard deviations by origin, without zeros: `noise`, `friction`, `offset`, and the '
        'names in `uncertainty.*`; their squares add up to that of the whole, without a widening')
        ] = UNSET

    @property
    def change(self) -> float:
        """Return the estimate less the value of the file, without a negative zero."""
        return round(self.value - self.file, self.digits) + 0.0

    @property
    def without_value(self) -> str | None:
        """Return in words why the estimate is not shown; None: it is."""
        return WITHOUT_VALUE.get(self.state)


class Combination(_Uncertain, Record):
    """A combination of parameters that is identifiable."""

    parameters: Annotated[list[str], means('names of the parameters')]
    coefficients: Annotated[list[float], means('their coefficients')]
    unit: Annotated[str, means('unit of the sum')]
    value: Annotated[float, means('sum of coefficients times parameters')]
    standard_error: Annotated[float, means('its standard error')]
    words: Annotated[str, means('the sum in words')]


class LikelyError(Record):
    """A possible error, or a cause of a lack of fit."""

    what: Annotated[str, means('keyword')]
    text: Annotated[str, means('description in one line')]


class Cause(LikelyError):
    """A cause of a lack of fit."""

    statistic: Annotated[float | UnsetType, means('test statistic that it explains')] = UNSET
    columns: Annotated[int | UnsetType, means('degrees of freedom of the statistic')] = UNSET
    deviations: Annotated[float | UnsetType, means(
        'standard deviations of a normal distribution with the same probability')] = UNSET


class FoundLackOfFit(Record):
    """Residuals that are more than noise."""

    cause: Annotated[str, means('keyword of the cause, or `unknown`')]
    text: Annotated[str, means('description in one line')]
    intervals: Annotated[str, means('`widened` or `none`')]
    causes: Annotated[list[Cause], means('all significant ones, the likeliest first')]
    residual_left: Annotated[float | UnsetType, means(
        'part of the residual RMS with the cause; 1: nothing is added to the model')] = UNSET


class EstimationResult(Record, kw_only=True):
    """The keys that identification.json and calibration.json have in common."""

    version: Annotated[int, means('of these keys: 1')]
    software: Annotated[str, means('name and version of the program')] = SOFTWARE
    date: Annotated[str, means('when, UTC')]
    parameters: list[Estimate]
    combinations: Annotated[list[Combination], means('identifiable sums of parameters')]
    rank: Annotated[int, means('number of directions of the unknowns that are identifiable')]
    unknowns: Annotated[int, means('number of unknowns')]
    singular_values: Annotated[list[float], means('of the information in the data')]
    lack_of_fit: Annotated[FoundLackOfFit | None, means('null: none, or not tested')]
    likely_mistakes: Annotated[list[LikelyError], means('possible errors that were accepted')]

    @property
    def is_complete(self) -> bool:
        """Return whether the model fits, and all is identified within bounds or fixed."""
        return self.lack_of_fit is None and all(
            each.state in (IDENTIFIED, FIXED) and not each.at_bound for each in self.parameters)

    def in_state(self, state: str) -> list[str]:
        """Return the names of the parameters in a state; those of legs share a line."""
        return grouped([each.name for each in self.parameters if each.state == state])


def states_of(what: Identifiability) -> list[str]:
    """Return the state of each parameter."""
    return [IDENTIFIED if known else IN_COMBINATION if part >= LEAST_SHARE else NOT_IDENTIFIABLE
            for known, part in zip(what.identifiable, what.known_shares, strict=True)]


def estimate(name: str, unit: str, start: float, value: float, state: str, error: float,
             share: float, at_bound: bool, sure: bool, prior: bool = False, **more: Any,
             ) -> Estimate:
    """
    Return an estimated parameter.

    name, unit, state: name, unit and state of the parameter.
    start, value: the file's value and the estimate.
    error, share: standard error; share of the unknown directions.
    at_bound: whether the value is at a bound.
    sure: whether there are intervals at all; without ``prior`` only of identified parameters.
    prior: whether the error includes the file's uncertainty, so that parameters that are not
        identified have an error and an interval, too.
    more: keys that not all estimates have.
    """
    return Estimate(
        name, unit, start, value, state,
        error if (prior or state != NOT_IDENTIFIABLE) and math.isfinite(error) else None,
        (value - TWO_SIDED * error, value + TWO_SIDED * error)
        if (prior or state == IDENTIFIED) and sure else None, share, at_bound, **more)


def combined(what: Identifiability, names: Sequence[str], units: Sequence[str], values: Array,
             covariance: Array, unclear: Integers | None = None,
             widening: Array | None = None) -> list[Combination]:
    """
    Return the combinations of parameters that are identifiable.

    widening: added to the standard error of each parameter, as where there is a lack of fit.
    """
    result = []
    for each in combinations(what, unclear):
        places = list(each.parameters)
        c = each.coefficients
        variance = float(c @ covariance[np.ix_(places, places)] @ c)
        wider = 0.0 if widening is None else float(np.abs(c) @ widening[places])
        of = [names[n] for n in places]
        result.append(Combination(
            of, c.tolist(), units[places[0]], float(c @ values[places]),
            math.sqrt(max(variance, 0.0)) + wider, in_words(c, of)))
    return result


def justified(values: Array, errors: Array) -> Array:
    """Return values rounded to a hundredth of their standard errors, finite ones above zero."""
    result = values.copy()
    for n, (value, error) in enumerate(zip(values, errors, strict=True)):
        if error > 0.0 and math.isfinite(error):
            result[n] = round(value, max(0, 2 - math.floor(math.log10(error))))
    return result


def in_words(coefficients: Array, names: Sequence[str]) -> str:
    """Return a combination of parameters as a sum in text form."""
    text = ''
    for c, name in zip(coefficients, names, strict=True):
        sign = ' - ' if c < 0.0 else ' + '
        size = f'{abs(c):.3g} '
        text += (sign if text else '-' if c < 0.0 else '') + ('' if size == '1 ' else size) + name
    return text


def table_lines(parameters: Sequence[Estimate], column: str) -> list[str]:
    """Return the table of estimates for the terminal; ``column`` is the heading of the values."""
    name_width = max([len(each.name) for each in parameters] + [9])
    lines = [f'{"parameter":<{name_width}} {"file":>10} {column:>12} {INTERVAL:>28}'
             '  unit']
    for each in parameters:
        value, interval, remark = '-', each.without_value, ''
        if interval is None:
            error = each.standard_error
            value, interval = f'{each.value:.5g}', 'no interval'
            if error is not None:
                value = rounded(each.value, error)
                if each.interval:
                    interval = ' .. '.join(rounded(end, error) for end in each.interval)
            remark = '  at its bound' if each.at_bound else ''
        lines.append(f'{each.name:<{name_width}} {each.file:>10.5g} {value:>12} '
                     f'{interval:>28}  {each.unit}{remark}')
    return lines


def not_identifiable_lines(result: EstimationResult, source: str) -> list[str]:
    """Return the parameters and combinations that the motion or the poses do not identify."""
    lines = []
    if unknown := result.in_state(NOT_IDENTIFIABLE):
        lines += ['', f'not identifiable from the {source}:', *(f'  {name}' for name in unknown)]
    if result.combinations:
        lines += ['', 'identifiable only in combinations:']
        for each in result.combinations:
            value, half = (rounded(number, each.standard_error)
                           for number in (each.value, TWO_SIDED * each.standard_error))
            lines.append(f'  {each.words} = {value} +- {half} {each.unit}')
    return lines


def rounded(value: float, error: float) -> str:
    """Return a number as text with two digits of its standard error."""
    digits = error_decimals(error)
    if value == 0.0 or error == 0.0 or (abs(value) < 1e9 and (
            digits < _MOST_DECIMALS or abs(value) > _SMALL)):
        return f'{value:.{digits}f}'
    places = math.floor(math.log10(abs(value))) - math.floor(math.log10(error)) + 1
    return f'{value:.{min(max(0, places), _MOST_DECIMALS)}e}'


def error_decimals(error: float) -> int:
    """Return the number of decimals that show two digits of a standard error."""
    digits = 0
    while digits < _MOST_DECIMALS and error * 10 ** digits < 1.95:
        digits += 1
    return digits


def grouped(names: Sequence[str]) -> list[str]:
    """Return names; those that differ only in their last part share a line."""
    groups: dict[str, list[str]] = {}
    for name in names:
        begin, _, end = name.rpartition('.')
        groups.setdefault(begin, []).append(end)
    return [f'{begin}: {" ".join(ends)}' if begin else ' '.join(ends)
            for begin, ends in groups.items()]
