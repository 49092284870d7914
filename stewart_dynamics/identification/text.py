# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Terminal output of an identification."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math
import textwrap
from typing import Any

from stewart_dynamics.identification.results import IDENTIFIED, NOT_IDENTIFIABLE
from stewart_dynamics.mechanics.least_squares import TWO_SIDED
from stewart_dynamics.replay.statements import plural

# Numbers with more decimals have an exponent.
_MOST_DECIMALS = 9


def result_text(result: Mapping[str, Any]) -> str:
    """
    Return the result as text, at most 100 columns wide except for long names.

    Parameters
    ----------
    result : mapping
        The content of identification.json.

    """
    lack = result['lack_of_fit']
    notice = textwrap.wrap(f'LACK OF FIT: {lack["text"]}', 100) if lack else []
    lines = [*notice, *_headline(result), '', *_table(result['parameters']),
             *_not_identifiable(result)]
    lines += _bags(result)
    return '\n'.join(lines)


def _headline(result: Mapping[str, Any]) -> list[str]:
    residuals = result['residuals']
    lines = [f'residual RMS {residuals["before_rms_n"]:.4g} N by the file, '
             f'{residuals["after_rms_n"]:.4g} N by the identified parameters '
             f'({_percent(residuals["after_rms_n"], residuals["measured_rms_n"])} of the efforts)']
    held = result['validation']
    if held is None:
        lines.append('not validated: too little data to hold some out')
    else:
        worst = max(held['legs'], key=lambda leg: held['legs'][leg]['after_rms_n'])
        lines.append(
            f'on held-out time: {held["before_rms_n"]:.4g} N by the file, '
            f'{held["after_rms_n"]:.4g} N by a fit to the rest; worst leg {worst}, '
            f'{held["legs"][worst]["after_rms_n"]:.4g} N')
    return lines


def _percent(part: float, whole: float) -> str:
    return f'{100.0 * part / whole:.2g} %' if whole > 0.0 else '-'


def _table(parameters: Sequence[Mapping[str, Any]]) -> list[str]:
    name_width = max([len(each['name']) for each in parameters] + [9])
    lines = [f'{"parameter":<{name_width}} {"file":>10} {"identified":>11} {"95 % interval":>24}'
             '  unit']
    for each in parameters:
        if each['state'] == IDENTIFIED:
            error = each['standard_error']
            shown = f'{rounded(each["value"], error):>11}', 'none: lack of fit'
            if each['interval']:
                shown = shown[0], ' .. '.join(rounded(end, error) for end in each['interval'])
            remark = '  at its bound' if each['at_bound'] else ''
        else:
            shown = f'{"-":>11}', ('kept: not identifiable' if each['state'] == NOT_IDENTIFIABLE
                                   else 'only in a combination')
            remark = ''
        lines.append(f'{each["name"]:<{name_width}} {each["file"]:>10.5g} {shown[0]} '
                     f'{shown[1]:>24}  {each["unit"]}{remark}')
    return lines


def rounded(value: float, error: float) -> str:
    """Return a number as text with two digits of its standard error."""
    digits = decimals(error)
    if value == 0.0 or error == 0.0 or (digits < _MOST_DECIMALS and abs(value) < 1e9):
        return f'{value:.{digits}f}'
    places = math.floor(math.log10(abs(value))) - math.floor(math.log10(error)) + 1
    return f'{value:.{max(0, places)}e}'


def decimals(error: float) -> int:
    """Return the number of decimals that show two digits of a standard error."""
    digits = 0
    while digits < _MOST_DECIMALS and error * 10 ** digits < 1.95:
        digits += 1
    return digits


def _not_identifiable(result: Mapping[str, Any]) -> list[str]:
    unknown = [each['name'] for each in result['parameters'] if each['state'] == NOT_IDENTIFIABLE]
    lines = []
    if unknown:
        lines += ['', "not identifiable from the motion (the file's values are kept):",
                  *(f'  {name}' for name in grouped(unknown))]
    if result['combinations']:
        lines += ['', 'identifiable only in combinations:']
        for each in result['combinations']:
            size = TWO_SIDED * each['standard_error']
            value, half = (rounded(number, each['standard_error'])
                           for number in (each['value'], size))
            lines.append(f'  {each["words"]} = {value} +- {half} {each["unit"]}')
    return lines


def grouped(names: Sequence[str]) -> list[str]:
    """Return names; those that differ only in their last part share a line."""
    groups: dict[str, list[str]] = {}
    for name in names:
        begin, _, end = name.rpartition('.')
        groups.setdefault(begin, []).append(end)
    return [f'{begin}: {" ".join(ends)}' if begin else ' '.join(ends)
            for begin, ends in groups.items()]


def _bags(result: Mapping[str, Any]) -> list[str]:
    lines = ['']
    for bag in result['bags']:
        delay = '' if bag['delay_s'] is None else (
            f', efforts {1e3 * bag["delay_s"]:.2f} +- '
            f'{1e3 * TWO_SIDED * bag["delay_standard_error_s"]:.2f} ms later than positions')
        lines.append(f'{bag["bag"]}: {plural(bag["samples"], "sample")} in '
                     f'{bag["seconds"]:.1f} s of {bag["legs"]}{delay}')
        left = [(bag['samples_outliers'], 'wild value', 'replaced'),
                (bag['samples_at_stops'], 'sample', 'at an end stop or force limit left out'),
                (bag['pieces_left_out'], 'piece', 'between gaps too short for the filters')]
        lines += [f'  {plural(number, what)} {why}' for number, what, why in left if number]
        lines += [f'  {plural(number, "message")} rejected: {why}'
                  for why, number in bag['rejected'].items()]
        lines += [f'  {notice}' for notice in bag['notices']]
    if result['efforts_outliers']:
        lines.append(f'{plural(result["efforts_outliers"], "filtered effort")} left out as '
                     'outliers')
    return lines
