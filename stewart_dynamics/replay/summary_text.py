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


"""The summary of a bag as text for a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math
import textwrap
from typing import Any

from stewart_dynamics.mechanics.limits import FORCE_MAX, LIMITS
from stewart_dynamics.mechanics.plausibility import likely_mistakes
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.setpoints.rejections import BASE_NOT_KNOWN, Rejection

_LISTED = 5
_WIDTH = 100


def summary_text(summary: Mapping[str, Any], parameters: Parameters) -> str:
    """
    Return the summary of a bag, without the likely mistakes among its notices.

    Parameters
    ----------
    summary : mapping
        The content of summary.json.
    parameters : Parameters
        Parameters of the hexapod.

    """
    lines = [f'{summary["bag"]}:']
    if summary['measured']:
        lines += _measured_lines(summary['measured'])
    lines += summary_lines(summary, parameters)
    mistakes = likely_mistakes(parameters)
    lines += [notice for notice in summary['notices'] if notice not in mistakes]
    for each in summary['rejected']:
        rejection = Rejection(f'{each["topic"]}: {each["count"]}', each['reason'])
        when = '' if each['first_at_s'] is None else f' at t = {each["first_at_s"]:.3f} s'
        lines.append(rejection.words(f'first{when}: {each["first"]}') if each['first']
                     else rejection.words('').removesuffix(': '))
    return '\n'.join(lines)


def summary_lines(found: Mapping[str, Any], parameters: Mapping[str, Any]) -> list[str]:
    """
    Return the lines, no wider than 100 columns.

    Parameters
    ----------
    found : mapping
        The values of Summary.values.
    parameters : mapping
        The parameters of the hexapod.

    """
    if not found['setpoints']['answered']:
        return ['no setpoint could be answered']
    bounds = parameters[FORCE_MAX]
    clipped = [bounds is not None and leg['force_peak_n'] is not None
               and abs(leg['force_peak_n']) >= bounds[n]
               for n, leg in enumerate(found['legs'].values())]
    lines = [_heading(found['setpoints']), '', *_legs_table(found['legs'], clipped)]
    if found['quasi_static']:
        lines.append('velocities are not known: the forces are those at rest; rates, power and '
                     'energy are not known')
    lines += _limit_lines(found, any(clipped), any(name in LIMITS and bound is not None
                                                   for name, bound in parameters.items()))
    lines += [*_joint_lines(found['legs']), *_base_lines(found)]
    lines += ['', *_singularity_lines(found['singularity'])]
    return [textwrap.fill(line, _WIDTH, subsequent_indent='  ') if len(line) > _WIDTH else line
            for line in lines]


def measured_headline(measured: Mapping[str, Any]) -> str:
    """
    Return by how much measured and computed forces differ.

    Parameters
    ----------
    measured : mapping
        The values of Comparison.values.

    """
    if not measured['setpoints_compared']:
        return 'no setpoint could be compared'
    worst, leg = max((leg['residual_rms_n'], name) for name, leg in measured['legs'].items())
    share = '' if measured['residual_share'] is None else (
        f', {100.0 * measured["residual_share"]:.3g} % of the measured force')
    return (f'measured and computed forces differ by {measured["residual_rms_n"]:.3g} N RMS'
            f'{share}; most in {leg}, by {worst:.3g} N')


def _measured_lines(measured: Mapping[str, Any]) -> list[str]:
    """Return the result of the comparison with measured forces, the headline first."""
    lines = [measured['headline']]
    if not measured['setpoints_compared']:
        return lines
    rms = ', '.join(f'{leg} {found["residual_rms_n"]:.1f}' for leg, found in
                    measured['legs'].items())
    lines += [f'compared {measured["setpoints_compared"]} setpoints; measured minus computed '
              f'force, RMS [N]: {rms}',
              'stewart_identify finds the payload and friction that fit the measured forces']
    contacts = measured['contacts']
    lines += [f'contact {_span(each["from_s"], each["to_s"])}: external force '
              f'({", ".join(f"{part:.1f}" for part in each["force_n"])}) N'
              for each in contacts['strongest'][:_LISTED]]
    if contacts['count'] > _LISTED:
        lines.append(f'and {contacts["count"] - _LISTED} more contacts')
    return lines


def _span(begin: float, end: float) -> str:
    first, last = f'{begin:.2f}', f'{end:.2f}'
    return f'at t = {first} s' if first == last else f'from t = {first} to {last} s'


def _limit_lines(found: Mapping[str, Any], clipped: bool, limits_given: bool) -> list[str]:
    lines = []
    if clipped:
        lines.append('* reaches limits.force_max: the published force is clipped to it')
    for each in found['limits']:
        lines.append(f'{each["limit"]}, {each["bound"]:g}, exceeded by {each["leg"]} in '
                     f'{plural(each["setpoints"], "setpoint")} from t = '
                     f'{each["first_at_s"]:.2f} s on: {each["worst"]:.6g} at worst')
    if found['setpoints']['jumps']:
        lines.append(f'{plural(found["setpoints"]["jumps"], "jump")}, first at t = '
                     f'{found["setpoints"]["jumps_first_at_s"]:.2f} s: the legs cannot follow '
                     'within limits.velocity_max')
    for name in found['limits_not_checked']:
        lines.append(f'{name} could not be checked' + (
            ' ' + '; '.join(f'in {plural(number, "setpoint")}: {why}' for number, why in (
                (found['singularity']['unsolved'], 'J_inv cannot be solved'),
                (found['setpoints']['base_unknown'], BASE_NOT_KNOWN)) if number)
            if name == FORCE_MAX else
            ': velocities are not known; --differentiate computes them from the poses'))
    if limits_given and not lines:
        lines.append('all limits held')
    return lines


def _joint_lines(legs: Mapping[str, Mapping[str, float | None]]) -> list[str]:
    """Return the largest angle of a joint at either end, and the smallest margin."""
    lines = []
    for joint in ('base', 'platform'):
        angle, at, margin = (
            f'{joint}_joint_angle_{key}' for key in ('max_rad', 'max_at_s', 'margin_rad'))
        found = {name: leg[angle] for name, leg in legs.items() if leg[angle] is not None}
        margins = {name: leg[margin] for name, leg in legs.items() if leg[margin] is not None}
        if found and margins:
            most = max(found, key=lambda name: found[name] or 0.0)
            least = min(margins, key=lambda name: margins[name] or 0.0)
            lines.append(f'{joint} joints: {_angle(found[most])} at most, {most} at t = '
                         f'{legs[most][at]:.2f} s; margin {_angle(margins[least])}'
                         + (f', {least}' if least != most else ''))
    return lines


def _angle(radians: float | None) -> str:
    assert radians is not None
    return f'{radians:.4g} rad ({math.degrees(radians):.1f} deg)'


def _base_lines(found: Mapping[str, Any]) -> list[str]:
    points, force, moment = (
        found['setpoints'], found['base_wrench']['force'], found['base_wrench']['moment'])
    lines = []
    if force['peak_n'] is not None:
        lines.append(f'base wrench: at most {force["peak_n"]:.1f} N at t = '
                     f'{force["peak_at_s"]:.2f} s (RMS {_rounded(force["rms_n"])}) and '
                     f'{moment["peak_n_m"]:.1f} N m at t = {moment["peak_at_s"]:.2f} s '
                     f'(RMS {_rounded(moment["rms_n_m"])})')
    if points['base_unknown']:
        lines.append(f'{BASE_NOT_KNOWN} in {plural(points["base_unknown"], "setpoint")}, first at '
                     f't = {points["base_unknown_first_at_s"]:.2f} s: they have no forces')
    return lines


def _rounded(value: float | None) -> str:
    return '-' if value is None else f'{value:.1f}'


def plural(number: int, what: str) -> str:
    """Return a number with its noun."""
    return f'{number} {what}' if number == 1 else f'{number} {what}s'


def _heading(setpoints: Mapping[str, Any]) -> str:
    text = f'{plural(setpoints["answered"], "setpoint")} in {setpoints["duration_s"]:.2f} s'
    if setpoints['gaps']:
        text += (f', of them {setpoints["gaps_s"]:.2f} s in '
                 f'{plural(setpoints["gaps"], "gap")}')
    if setpoints['restarts']:
        text += f', {plural(setpoints["restarts"], "restart")}'
    return text


# Columns of the table of legs: group, title, key, width, decimals. With the leg's name and the
# mark, they have the width _WIDTH.
_COLUMNS = (
    ('force [N]', 'peak', 'force_peak_n', 10, 1), ('force [N]', 'at [s]', 'force_peak_at_s', 9, 2),
    ('force [N]', 'RMS', 'force_rms_n', 9, 1), ('force [N]', 'margin', 'force_margin_n', 9, 1),
    ('power [W]', 'peak', 'power_peak_w', 10, 1),
    ('length [m]', 'from', 'length_min_m', 8, 4), ('length [m]', 'to', 'length_max_m', 8, 4),
    ('length [m]', 'margin', 'length_margin_m', 8, 4),
    ('rate [m/s]', 'peak', 'rate_peak_m_s', 9, 4),
    ('rate [m/s]', 'margin', 'rate_margin_m_s', 8, 4))
_NAME = 11
_MARKED = 'force_peak_n'


def _legs_table(legs: Mapping[str, Mapping[str, float | None]],
                marked: Sequence[bool]) -> list[str]:
    """Return the table of the legs; columns without numbers are left out."""
    columns = [column for column in _COLUMNS
               if any(leg[column[2]] is not None for leg in legs.values())]
    spans: dict[str, int] = {}
    titles = f'{"leg":<{_NAME}}'
    for group, title, key, width, _ in columns:
        spans[group] = spans.get(group, 0) + width + (key == _MARKED)
        titles += f'{title:>{width}}' + ' ' * (key == _MARKED)
    lines = [' ' * _NAME + ''.join(f' {group:-^{span - 1}}' for group, span in spans.items()),
             titles]
    for (name, leg), mark in zip(legs.items(), marked, strict=True):
        line = f'{name:<{_NAME}.{_NAME}}'
        for _, _, key, width, digits in columns:
            line += _fitted(leg[key], width, digits) + ('* '[not mark] if key == _MARKED else '')
        lines.append(line)
    return lines


def _fitted(value: float | None, width: int, digits: int) -> str:
    """Return a number with these decimals, or fewer if it would be too wide."""
    if value is None:
        return f'{"-":>{width}}'
    for text in (f'{value:.{digits}f}', f'{value:.0f}'):
        if len(text) < width:
            return f'{text:>{width}}'
    return f'{value:>{width}.1e}'


def _singularity_lines(found: Mapping[str, Any]) -> list[str]:
    crossings, spans = found['crossings_at_s'], found['warnings_from_to_s']
    lines = ['det(J) did not cross zero']
    if crossings:
        times = ', '.join(f't = {time:.3f} s' for time in crossings[:_LISTED])
        more = found['crossings'] - _LISTED
        lines = [f'det(J) crossed zero at {times}{f" and {more} times more" if more > 0 else ""}:'
                 ' forces grow without bound there']
    lines.append(f'det(J) nearest zero: {found["determinant_nearest_m3"]:.6g} m^3 at t = '
                 f'{found["determinant_nearest_at_s"]:.2f} s')
    if found['condition_max'] is not None:
        lines.append(f'condition number of J_inv: {found["condition_max"]:.4g} at most, at t = '
                     f'{found["condition_max_at_s"]:.2f} s')
    if unpublished := found['unsolved'] + found['suppressed']:
        lines.append(f'no forces were published in {plural(unpublished, "setpoint")}')
    for begun, ended in spans[:_LISTED]:
        ahead = [time - begun for time in crossings
                 if begun <= time and (ended is None or time <= ended)]
        lines.append(
            f'singularity warning from t = {begun:.2f} s '
            + ('to the end' if ended is None else f'to {ended:.2f} s')
            + (f': {ahead[0]:.2f} s before the crossing' if ahead else ''))
    if found['warnings'] > _LISTED:
        lines.append(f'and {found["warnings"] - _LISTED} singularity warnings more, for '
                     f'{found["warning_s"]:.2f} s in all')
    if not spans:
        lines.append('no singularity warning')
    return lines
