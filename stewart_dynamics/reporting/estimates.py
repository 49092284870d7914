# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Estimated parameters as results show them: states, intervals, combinations; as JSON and as text.

Identification and calibration describe their estimates alike.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.estimation.confidence_level import INTERVAL, TWO_SIDED
from stewart_dynamics.mechanics.least_squares import combinations, Identifiability, LEAST_SHARE

IDENTIFIED, IN_COMBINATION, NOT_IDENTIFIABLE = 'identified', 'in_combination', 'not_identifiable'
FIXED = 'fixed'  # held at the file's value by an option

HOLD_OUT = 0.2  # share of the data that validates a fit to the rest, by default
WITHOUT_VALUE = {IN_COMBINATION: 'only in a combination', FIXED: 'fixed',
                 NOT_IDENTIFIABLE: 'not identifiable'}
# Numbers below _SMALL with more decimals have an exponent.
_MOST_DECIMALS, _SMALL = 9, 1e-4


def states_of(what: Identifiability) -> list[str]:
    """Return the state of each parameter."""
    return [IDENTIFIED if known else IN_COMBINATION if part >= LEAST_SHARE else NOT_IDENTIFIABLE
            for known, part in zip(what.identifiable, what.known_shares, strict=True)]


def estimate(name: str, unit: str, start: float, value: float, state: str, error: float,
             share: float, at_bound: bool, sure: bool, prior: bool = False) -> dict[str, Any]:
    """
    Return an estimated parameter for JSON.

    name, unit, state: name, unit and state of the parameter.
    start, value: the file's value and the estimate.
    error, share: standard error; share of the unknown directions.
    at_bound, sure: whether the value is at a bound; whether it has an interval, if it is
        identified.
    prior: whether the interval holds without that, because the file's uncertainty is in it.
    """
    return {
        'name': name, 'unit': unit, 'file': start, 'value': value,
        'state': state, 'standard_error': (
            error if (prior or state != NOT_IDENTIFIABLE) and math.isfinite(error) else None),
        'interval': ([value - TWO_SIDED * error, value + TWO_SIDED * error]
                     if (prior or state == IDENTIFIED) and sure else None),
        'unknown_share': share, 'at_bound': at_bound}


def combined(what: Identifiability, names: Sequence[str], units: Sequence[str], values: Array,
             covariance: Array, unclear: Integers | None = None,
             widening: Array | None = None) -> list[dict[str, Any]]:
    """
    Return the combinations of parameters that are identifiable, for JSON.

    widening: added to the standard error of each parameter, as where there is a lack of fit.
    """
    result = []
    for each in combinations(what, unclear):
        places = list(each.parameters)
        c = each.coefficients
        variance = float(c @ covariance[np.ix_(places, places)] @ c)
        wider = 0.0 if widening is None else float(np.abs(c) @ widening[places])
        result.append({
            'parameters': [names[n] for n in places], 'coefficients': c,
            'unit': units[places[0]], 'value': c @ values[places],
            'standard_error': math.sqrt(max(variance, 0.0)) + wider,
            'words': in_words(c, [names[n] for n in places])})
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


def table_lines(parameters: Sequence[Mapping[str, Any]], column: str) -> list[str]:
    """Return the table of estimates for the terminal; ``column`` is the heading of the values."""
    name_width = max([len(each['name']) for each in parameters] + [9])
    lines = [f'{"parameter":<{name_width}} {"file":>10} {column:>12} {INTERVAL:>28}'
             '  unit']
    for each in parameters:
        if each['state'] == IDENTIFIED:
            error = each['standard_error']
            value = f'{each["value"]:.5g}' if error is None else rounded(each['value'], error)
            shown = f'{value:>12}', 'no interval'
            if each['interval']:
                shown = shown[0], ' .. '.join(rounded(end, error) for end in each['interval'])
            remark = '  at its bound' if each['at_bound'] else ''
        else:
            shown, remark = (f'{"-":>12}', WITHOUT_VALUE[each['state']]), ''
        lines.append(f'{each["name"]:<{name_width}} {each["file"]:>10.5g} {shown[0]} '
                     f'{shown[1]:>28}  {each["unit"]}{remark}')
    return lines


def not_identifiable_lines(result: Mapping[str, Any], source: str) -> list[str]:
    """Return the parameters and combinations that the motion or the poses do not identify."""
    unknown = [each['name'] for each in result['parameters'] if each['state'] == NOT_IDENTIFIABLE]
    lines = []
    if unknown:
        lines += ['', f'not identifiable from the {source}:',
                  *(f'  {name}' for name in grouped(unknown))]
    if result['combinations']:
        lines += ['', 'identifiable only in combinations:']
        for each in result['combinations']:
            size = TWO_SIDED * each['standard_error']
            value, half = (rounded(number, each['standard_error'])
                           for number in (each['value'], size))
            lines.append(f'  {each["words"]} = {value} +- {half} {each["unit"]}')
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


def is_complete(result: Mapping[str, Any]) -> bool:
    """Return whether the model fits, and all parameters are identified within bounds or fixed."""
    return result['lack_of_fit'] is None and all(
        each['state'] in (IDENTIFIED, FIXED) and not each['at_bound']
        for each in result['parameters'])


def page_values(result: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of the template ``estimates.html``."""
    def drawn(each: Mapping[str, Any]) -> dict[str, Any]:
        error = each['standard_error']
        return {**each, 'half': None if error is None else TWO_SIDED * error,
                'digits': error_decimals(error) if error else 4}

    def changed(each: Mapping[str, Any]) -> dict[str, Any]:
        row = drawn(each)
        # a sum with 0.0, so that no -0.000 is written
        return {**row, 'change': round(row['value'] - row['file'], row['digits']) + 0.0,
                'without_value': WITHOUT_VALUE.get(row['state'])}

    def named(state: str) -> list[str]:
        return grouped([each['name'] for each in result['parameters'] if each['state'] == state])

    return {'parameters': [changed(each) for each in result['parameters']],
            'combinations': [drawn(each) for each in result['combinations']],
            'identified': sum(each['state'] == IDENTIFIED for each in result['parameters']),
            'combined': named(IN_COMBINATION), 'not_identifiable': named(NOT_IDENTIFIABLE)}
