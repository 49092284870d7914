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

from collections.abc import Mapping
import textwrap
from typing import Any

from stewart_dynamics.mechanics.least_squares import TWO_SIDED
from stewart_dynamics.replay.statements import plural
from stewart_dynamics.reporting.estimates import not_identifiable_lines, table_lines


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
    lines = [*notice, *_headline(result), '', *table_lines(result['parameters']),
             *not_identifiable_lines(result, 'motion')]
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
