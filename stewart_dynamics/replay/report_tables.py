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


"""
The tables of a report, as HTML.

Names of bags, topics and legs are their users' own: all go through ``escape``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime, timezone
from html import escape
import math
from pathlib import Path
from typing import Any

from stewart_dynamics.mechanics.force_breakdown import SOURCES
from stewart_dynamics.parameters import PARAMETERS, Parameters

# So many of the times of one kind are told, the first.
_SHOWN_TIMES = 20


def bag_name(bag: str) -> str:
    """Return a bag's name without the folders before it."""
    return Path(bag).name or bag


def _number(value: float | None, decimals: int) -> str:
    """Return a number with so many decimals, or none where it is large."""
    if value is None or not math.isfinite(value):
        return '–'
    return f'{value:.{decimals}f}'.replace('-', '−') if abs(value) < 1e5 else _digits(value)


def _digits(value: float | None) -> str:
    """Return a number with five digits, or to the unit where that is more."""
    if value is None or not math.isfinite(value):
        return '–'
    grouped = 1e5 <= abs(value) < 1e10
    return (f'{value:,.0f}' if grouped else f'{value:.5g}').replace('-', '−').replace(',', ' ')


def _at(seconds: float | None) -> str:
    """Return a button that moves the cursor to a time."""
    if seconds is None or not math.isfinite(seconds):
        return '–'
    return f'<button class="at" data-at="{seconds!r}">{seconds:.3f}</button>'


def _table(head: Iterable[str], rows: Iterable[Iterable[str]], kind: str = '') -> str:
    """Return a table of cells that are markup already; a row's first cell is its head."""
    def row(cells: Iterable[str], element: str) -> str:
        first, *others = cells
        scope = 'col' if element == 'th' else 'row'
        return (f'<tr><th scope="{scope}">{first}</th>'
                + ''.join(f'<{element}>{cell}</{element}>' for cell in others) + '</tr>')
    return (f'<div class="scroll"><table class="{kind}"><thead>{row(head, "th")}</thead><tbody>'
            + ''.join(row(cells, 'td') for cells in rows) + '</tbody></table></div>')


def _list(items: Iterable[str]) -> str:
    return '<ul>' + ''.join(f'<li>{item}</li>' for item in items) + '</ul>'


def _count(number: int, thing: str) -> str:
    return f'{number:,} {thing}{"" if number == 1 else "s"}'


class Tables:
    """The part of the report above the plots."""

    def __init__(self, summary: Mapping[str, Any], parameters: Parameters) -> None:
        self._summary = summary
        self._legs: Mapping[str, Mapping[str, Any]] = summary['legs']
        self._parameters = parameters

    def html(self) -> str:
        return '\n'.join([
            self._header(), '<main>', self._verdicts(), self._notices(), self._peaks(),
            self._margins(), self._motors(), self._causes(), self._measured(),
            self._singularity(), self._refused()])

    def _header(self) -> str:
        s = self._summary
        made = [escape(s['software'])]
        if s['run']:
            made.append(f'run {escape(s["run"])}')
        stamp = s['setpoints']['first_stamp_ns']
        if stamp is not None:
            made.append(f'first stamp {stamp / 1e9:.3f} s{_date(stamp)}')
        links = ''.join(f'<a href="#{key}">{name}</a>' for key, name in _LINKS)
        return (f'<header><h1>{escape(bag_name(s["bag"]))}</h1>'
                f'<p>{escape(s["bag"])}</p><p>{" · ".join(made)}</p></header><nav>{links}</nav>')

    def _verdicts(self) -> str:
        return '<section id="verdict" class="cards">' + ''.join(
            f'<div class="card {state}"><h2><span class="mark">{mark}</span>{title}</h2>'
            f'<p>{text}</p></div>' for (state, mark), title, text in (
                self._reading(), self._limits(), self._nearness())) + '</section>'

    def _reading(self) -> tuple[tuple[str, str], str, str]:
        s = self._summary
        refused = sum(each['count'] for each in s['refused'])
        points = s['setpoints']
        text = [f'<b>{_count(points["answered"], "setpoint")}</b> in '
                f'<b>{_number(points["duration_s"], 3)} s</b>']
        if refused:
            text.append(_count(refused, 'message') + ' refused')
        if points['gaps']:
            text.append(f'{_count(points["gaps"], "gap")}, {_number(points["gaps_s"], 3)} s')
        if points['restarts']:
            text.append(_count(points['restarts'], 'restart'))
        text += [f'not read: {escape(each)}' for each in s['missing']]
        state, title = _GOOD, 'The whole bag was read'
        if refused:
            state, title = _WARN, 'Some messages were refused'
        if not s['complete']:
            state, title = _BAD, 'Only a part could be read'
        if not points['answered']:
            state, title = _BAD, 'No setpoint could be answered'
        return state, title, '<br>'.join(text)

    def _limits(self) -> tuple[tuple[str, str], str, str]:
        broken = self._summary['limits']
        if broken:
            names = dict.fromkeys(each['limit'] for each in broken)
            return _BAD, 'Limits are broken', '<br>'.join(
                _excess(name, [each for each in broken if each['limit'] == name])
                for name in names)
        margins = [(name, leg, values[key], unit) for leg, values in self._legs.items()
                   for name, key, unit in _MARGINS if values[key] is not None]
        if not margins:
            return _NONE, 'No limits to hold', 'none are given, or nothing was answered'
        nearest = [min((each for each in margins if each[0] == name), key=lambda each: each[2])
                   for name, _, _ in _MARGINS if any(each[0] == name for each in margins)]
        return _GOOD, 'All limits are held', '<br>'.join(
            f'{name}: {_digits(value)} {unit} left, {escape(leg)}'
            for name, leg, value, unit in nearest)

    def _nearness(self) -> tuple[tuple[str, str], str, str]:
        s = self._summary['singularity']
        nearest = []
        if s['condition_max'] is not None:
            nearest.append(f'condition number at most {_digits(s["condition_max"])} at '
                           f'{_at(s["condition_max_at_s"])} s')
        if s['determinant_nearest_m3'] is not None:
            nearest.append(f'det(J) nearest zero {_digits(s["determinant_nearest_m3"])} m³ at '
                           f'{_at(s["determinant_nearest_at_s"])} s')
        if s['crossings']:
            when = s['crossings_at_s']
            first = f', first at {_at(when[0])} s' if when else ''
            nearest.insert(0, f'det(J) crosses zero {_times(s["crossings"])}{first}: '
                              'forces grow without bound')
        if s['warnings']:
            nearest.append(f'warned {_times(s["warnings"])}, {_number(s["warning_s"], 3)} s')
        if s['unsolved']:
            nearest.append(f'{_count(s["unsolved"], "setpoint")} without forces: not solvable')
        text = '<br>'.join(nearest) or '–'
        if s['crossings'] or s['unsolved']:
            return _BAD, 'A singularity is met', text
        if s['warnings']:
            return _WARN, 'A singularity is near', text
        if not nearest:
            return _NONE, 'Singularity', text
        return _GOOD, 'Clear of singularities', text

    def _notices(self) -> str:
        s = self._summary
        notices = [escape(each) for each in s['notices']]
        cutoff = s['inputs']['differentiated_cutoff_hz']
        topics = ', '.join(f'<code>{escape(str(found))}</code>'
                           for found in s['inputs']['topics'].values())
        made = (f'Setpoints from {topics or "no topic"} '
                f'(<code>setpoint.source</code>: {escape(self._parameters["setpoint.source"])}).')
        if cutoff is not None:
            made += (f' <b>Twist and acceleration were differentiated from the poses</b> by a '
                     f'smoothing spline, cut-off {_digits(cutoff)} Hz.')
        if self._parameters['setpoint.source'] == 'pose' and cutoff is None:
            made += ' <b>Quasi-static: without velocities and accelerations.</b>'
        return (f'<section id="notices"><p>{made}</p>'
                + (_list(notices) if notices else '') + '</section>')

    def _rows(self, cells: Callable[[Mapping[str, Any]], list[str]]) -> list[list[str]]:
        return [[_leg(name, n), *cells(values)] for n, (name, values) in
                enumerate(self._legs.items())]

    def _peaks(self) -> str:
        return _section('peaks', 'Peaks', _table(
            ['Leg', 'shortest<br>[m]', 'longest<br>[m]', 'peak rate<br>[m/s]', 'at<br>[s]',
             'peak force<br>[N]', 'at<br>[s]', 'published<br>[N]', 'peak power<br>[W]',
             'at<br>[s]'],
            self._rows(lambda leg: [
                _number(leg['length_min_m'], 4), _number(leg['length_max_m'], 4),
                _number(leg['rate_peak_m_s'], 4), _at(leg['rate_peak_at_s']),
                f'<b>{_number(leg["force_peak_n"], 1)}</b>', _at(leg['force_peak_at_s']),
                _number(leg['force_published_peak_n'], 1),
                _number(leg['power_peak_w'], 1), _at(leg['power_peak_at_s'])])),
            'Largest in size, with their signs: + pushes, + extends, + drives. Forces are those '
            'that the motion demands; published is what is left after clipping to '
            '<code>limits.force_max</code>. Click a time to go there.')

    def _margins(self) -> str:
        def margin(value: float | None, decimals: int) -> str:
            if value is None:
                return '<span class="none">no limit</span>'
            return f'<span class="{"broken" if value < 0.0 else "held"}">' \
                   f'{_number(value, decimals)}</span>'
        tables = _table(
            ['Leg', 'length<br>[m]', 'rate<br>[m/s]', 'force<br>[N]'],
            self._rows(lambda leg: [
                margin(leg['length_margin_m'], 4), margin(leg['rate_margin_m_s'], 4),
                margin(leg['force_margin_n'], 1)]))
        broken = self._summary['limits']
        if broken:
            tables += _table(
                ['Broken limit', 'leg', 'setpoints', 'worst', 'bound', 'first at [s]'],
                [[f'<code>{escape(each["limit"])}</code>', escape(str(each['leg'])),
                  f'{each["setpoints"]:,}', f'<b>{_digits(each["worst"])}</b>',
                  _digits(each['bound']), _at(each['first_at_s'])] for each in broken])
        return _section('limits', 'Limits and margins', f'<div class="row">{tables}</div>',
                        'How far every leg stays from its nearest limit; negative where broken.')

    def _motors(self) -> str:
        return _section('motors', 'What sizes a motor', _table(
            ['Leg', 'RMS force<br>[N]', 'peak force<br>[N]', 'peak rate<br>[m/s]',
             'mean power<br>[W]', 'peak power<br>[W]', 'energy driving<br>[J]',
             'energy braking<br>[J]'],
            self._rows(lambda leg: [
                f'<b>{_number(leg["force_rms_n"], 1)}</b>', _number(leg['force_peak_n'], 1),
                _number(leg['rate_peak_m_s'], 4), _number(leg['power_mean_w'], 1),
                _number(leg['power_peak_w'], 1), _number(leg['energy_driving_j'], 1),
                _number(leg['energy_braking_j'], 1)])),
            'Of the demanded forces, over the whole motion, gaps left out. Power is mechanical, '
            'at the leg.' + (
                ' <b>The motion comes too near a singularity: these numbers depend on how near a '
                'sample happens to be, and size nothing.</b>'
                if self._summary['singularity']['warnings'] else ''))

    def _causes(self) -> str:
        split = self._summary['causes']
        if not split:
            return ''
        rows = []
        for cause in SOURCES:
            cells = [escape(cause.capitalize())]
            for leg in split.values():
                cells.append(f'{_number(leg[cause]["rms_n"], 1)} '
                             f'<span class="none">({_number(leg[cause]["peak_n"], 1)})</span>')
            rows.append(cells)
        return _section(
            'shares', 'Force by cause', _table(
                ['RMS (peak) [N]', *(_leg(name, n) for n, name in enumerate(split))], rows),
            'What the demanded force of each leg is for; the parts add up to it. Leg inertia has '
            'the actuators in it.')

    def _measured(self) -> str:
        m = self._summary['measured']
        if m is None:
            return ''
        left_out = m['setpoints_not_compared']
        note = (f'{_count(m["setpoints_compared"], "setpoint")} compared with '
                f'{_count(m["samples"], "measured sample")} of '
                f'<code>{escape(str(self._summary["inputs"]["measured"]))}</code>; '
                f'{left_out["without_measurement"]:,} had none near enough, '
                f'{left_out["without_force"]:,} no computed force. Residual: measured less '
                'computed. The friction is what would explain it best beyond what the '
                'parameters have; share is the part of it that this explains.')
        legs = _table(
            ['Leg', 'residual RMS<br>[N]', 'mean<br>[N]', 'peak<br>[N]', 'at<br>[s]',
             'measured RMS<br>[N]', 'computed RMS<br>[N]', 'correlation',
             'offset<br>[N]', 'Coulomb<br>[N]', 'viscous<br>[N s/m]', 'share'],
            [[_leg(name, n), f'<b>{_number(leg["residual_rms_n"], 2)}</b>',
              _number(leg['residual_mean_n'], 2), _number(leg['residual_peak_n'], 2),
              _at(leg['residual_peak_at_s']), _number(leg['measured_rms_n'], 1),
              _number(leg['computed_rms_n'], 1), _number(leg['correlation'], 4),
              _number(leg['offset_n'], 2), _number(leg['coulomb_friction_n'], 2),
              _number(leg['viscous_friction_n_s_m'], 2), _number(leg['friction_share'], 3)]
             for n, (name, leg) in enumerate(m['legs'].items())])
        axes = []
        for axis, values in m['wrench'].items():
            unit, name = (('n_m', 'N m') if axis.startswith('moment') else ('n', 'N'))
            axes.append([
                f'{axis.replace("_", " ").capitalize()} [{name}]',
                *(_number(values[f'{each}_{unit}'], 2) for each in ('rms', 'mean', 'peak')),
                _at(values['peak_at_s'])])
        wrench = _table(['Residual on the platform', 'RMS', 'mean', 'peak', 'at [s]'], axes)
        mass = m['mass']
        if mass['unmodelled_kg'] is not None:
            wrench += (f'<p>A mass of <b>{_digits(mass["unmodelled_kg"])} kg</b> more on the '
                       f'platform would explain {_number(mass["share"], 3)} of the force.</p>')
        below = f'<div>{wrench}</div>{_touches(m["touches"], m["setpoints_compared"])}'
        return _section('comparison', 'Measured against computed',
                        f'{legs}<div class="row">{below}</div>', note)

    def _singularity(self) -> str:
        s, p = self._summary['singularity'], self._parameters
        warned = [f'{_at(begun)} to {_at(ended) if ended is not None else "the end"}'
                  for begun, ended in s['warnings_from_to_s'][:_SHOWN_TIMES]]
        if s['warnings'] > len(warned):
            warned.append(f'… {s["warnings"] - len(warned):,} more')
        crossed = [_at(when) for when in s['crossings_at_s'][:_SHOWN_TIMES]]
        if s['crossings'] > len(crossed):
            crossed.append(f'… {s["crossings"] - len(crossed):,} more')
        unit_load = '–'
        if s['unit_load_force_max'] is not None:
            unit_load = f'{_digits(s["unit_load_force_max"])} ({escape(s["unit_load_force_leg"])})'
        rows = [
            ['Nearest approach', f'det(J) = {_digits(s["determinant_nearest_m3"])} m³',
             _at(s['determinant_nearest_at_s'])],
            ['Crossings of det(J) = 0', f'{s["crossings"]:,}', ', '.join(crossed) or '–'],
            [f'Largest condition number (warning from {p["singularity.warn_condition"]:g}, stop '
             f'from {p["singularity.stop_condition"]:g})', _digits(s['condition_max']),
             _at(s['condition_max_at_s'])],
            ['Shortest time to a crossing foretold (warning under '
             f'{p["singularity.warn_time"]:g} s)', f'{_digits(s["time_to_crossing_min_s"])} s',
             _at(s['time_to_crossing_min_at_s'])],
            ['Largest leg force per unit load on the platform', unit_load, '–'],
            ['Warnings', f'{s["warnings"]:,} in {_number(s["warning_s"], 3)} s',
             ', '.join(warned) or '–'],
            ['Setpoints for which J_inv cannot be solved', f'{s["unsolved"]:,}', '–'],
            ['Setpoints without published forces', f'{s["suppressed"]:,}', '–']]
        return _section('singularity', 'Singularity', _table(
            ['', 'value', 'at [s]'], rows, 'wide'))

    def _refused(self) -> str:
        refused = self._summary['refused']
        table = _table(['Topic', 'reason', 'messages', 'first'], [
            [f'<code>{escape(str(each["topic"]))}</code>', escape(str(each['reason'])),
             f'{each["count"]:,}', escape(str(each['first']))]
            for each in refused], 'wide') if refused else '<p>No message was refused.</p>'
        return _section('refused', 'Refused messages', table)


_LINKS = (('peaks', 'Peaks'), ('limits', 'Limits'), ('motors', 'Motors'),
          ('singularity', 'Singularity'), ('refused', 'Refused'), ('motion', 'Motion'),
          ('plots', 'Plots'), ('parameters', 'Parameters'))
_GOOD, _WARN, _BAD, _NONE = ('good', '✓'), ('warn', '!'), ('bad', '✕'), ('none', '–')
_MARGINS = (('length', 'length_margin_m', 'm'), ('rate', 'rate_margin_m_s', 'm/s'),
            ('force', 'force_margin_n', 'N'))
_LIMIT_UNITS = {name: PARAMETERS[name].unit for name in PARAMETERS if name.startswith('limits.')}


def _excess(limit: str, broken: Sequence[Mapping[str, Any]]) -> str:
    """Return in words which legs break a limit, and by how much."""
    unit = _LIMIT_UNITS.get(limit, '')
    worst = max(broken, key=lambda each: abs(abs(each['worst']) - each['bound']))
    first = min(each['first_at_s'] for each in broken)
    others = f' and {_count(len(broken) - 1, "other leg")}' if len(broken) > 1 else ''
    return (f'<code>{escape(limit)}</code> {_digits(worst["bound"])} {unit}: '
            f'<b>{escape(worst["leg"])} {_digits(worst["worst"])} {unit}</b>{others}, first at '
            f'{_at(first)} s')


def _times(number: int) -> str:
    return 'once' if number == 1 else f'{number:,} times'


def _date(stamp: int) -> str:
    """Return a stamp's date where it can be one."""
    if stamp < 1_000_000_000 * 10 ** 9:
        return ''
    try:
        when = datetime.fromtimestamp(stamp // 10 ** 9, timezone.utc)
    except (OverflowError, OSError, ValueError):
        return ''
    return f' ({when:%Y-%m-%d %H:%M:%S} UTC)'


def _leg(name: str, number: int) -> str:
    return f'<i class="swatch leg{number}"></i>{escape(name)}'


def _section(key: str, title: str, content: str, note: str = '') -> str:
    note = f'<p class="note">{note}</p>' if note else ''
    return f'<section id="{key}"><h2>{title}</h2>{note}{content}</section>'


def _touches(touches: Mapping[str, Any], compared: int) -> str:
    """Return when something touched the platform, and with what load."""
    if not compared:
        return '<p>Nothing could be compared.</p>'
    if not touches['count']:
        return '<p>Nothing touched the platform that stands out of the residual.</p>'
    shown = touches['strongest'][:_SHOWN_TIMES]
    rows = [[escape(each['axis'].replace('_', ' ')), _at(each['from_s']), _at(each['to_s']),
             ', '.join(_number(f, 1) for f in each['force_n']),
             ', '.join(_number(f, 1) for f in each['moment_n_m'])] for each in shown]
    table = _table(['Touched, most in', 'from [s]', 'to [s]', 'by a force x, y, z [N]',
                    'by a moment x, y, z [N m]'], rows)
    more = touches['count'] - len(shown)
    told = f'<p>… {more:,} more</p>' if more else ''
    return (f'<div>{table}{told}<p class="note">What the surroundings put on the platform, at its '
            'origin, base axes: the opposite of the residual.</p></div>')


def parameter_table(values: Mapping[str, Any]) -> str:
    """Return the table of all parameters; joints stand one leg in a line."""
    rows = []
    for name, value in values.items():
        is_points = isinstance(value, list | tuple) and len(value) == 18
        shown = '<br>'.join(_plain(value[n:n + 3]) for n in range(0, 18, 3)) if is_points else (
            _plain(value))
        unit = PARAMETERS[name].unit if name in PARAMETERS else ''
        unit = unit.replace('^2', '²')
        rows.append([f'<code>{escape(name)}</code>', shown, escape(unit)])
    return _table(['Parameter', 'value', 'unit'], rows, 'wide units')


def _plain(value: Any) -> str:
    """Return any value of the summary as text."""
    if value is None:
        return '<span class="none">none</span>'
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, float):
        return f'{value:.10g}'.replace('-', '−')
    if isinstance(value, list | tuple):
        if len(value) == 6 and all(each == value[0] for each in value):
            return f'{_plain(value[0])} <span class="none">(all legs)</span>'
        return ', '.join(map(_plain, value))
    return escape(str(value))
