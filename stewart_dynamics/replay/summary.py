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
What a motion asked of the legs, and how near a singularity it came.

Samples come block after block and are not kept. But for rounding, it does not matter where
one block ends and the next begins. docs/summary.md says what each number means.
"""

from __future__ import annotations

from collections.abc import Callable
import math
import textwrap
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Integers
from stewart_dynamics.mechanics.force_breakdown import SOURCES
from stewart_dynamics.mechanics.limits import LIMITS
from stewart_dynamics.parameters import Parameters
from stewart_dynamics.runtime.step import Batch, Outputs

# So many crossings and warnings are told one by one; all of them are counted.
TOLD = 100
# A step longer than so many usual ones (and than setpoint.timeout) is a gap; the usual one is
# the median of the steps between the first setpoints, so many.
_GAP = 10.0
FIRST = 1000

_TOLD_IN_TABLE = 5
_WIDTH = 100


def longest_step(first: Array, timeout: float) -> float:
    """Return the longest step that is no gap [s], by those between the first FIRST setpoints."""
    forward = first[first > 0.0]
    usual = float(np.median(forward)) if len(forward) else 0.0
    return float(max(timeout, _GAP * usual))


class _Block(NamedTuple):
    seconds: Array
    setpoints: Batch
    outputs: Outputs
    causes: Array | None


class _Extreme:
    """
    Of each column the value that is the greatest by a measure, and the first time it is met.

    nan are passed over, as is what measures -inf.
    """

    def __init__(self, width: int, measure: Callable[[Array], Array]) -> None:
        self._measure = measure
        self._columns = np.arange(width)
        self._measured: Array = np.full(width, -np.inf)
        self.values: Array = np.full(width, np.nan)
        self.at: Array = np.full(width, np.nan)

    def add(self, seconds: Array, values: Array) -> None:
        measured = self._measure(values)
        unknown = np.isnan(measured)
        if unknown.any():
            measured = np.where(unknown, -np.inf, measured)
        row = measured.argmax(axis=0)
        greatest = measured[row, self._columns]
        new = greatest > self._measured
        self._measured = np.where(new, greatest, self._measured)
        self.values = np.where(new, values[row, self._columns], self.values)
        self.at = np.where(new, seconds[row], self.at)


class _Integral:
    """
    Of each column the integral over time by trapezoids, and the mean.

    Rows with a nan are left out, and the steps from and to them.
    """

    def __init__(self, width: int) -> None:
        self.values = np.zeros(width)
        self._time = 0.0
        self._sum = np.zeros(width)
        self._samples = 0
        self._last = np.zeros(width)
        self._last_known = False

    def add(self, steps: Array, values: Array) -> None:
        """Take the values in, and the times from each sample's forerunner to it."""
        known = ~_with_nan(values)
        if not known.all():
            values = np.where(known[:, None], values, 0.0)
        weight = 0.5 * steps * known * np.concatenate(([self._last_known], known[:-1]))
        self.values += (weight @ values + weight[1:] @ values[:-1] + weight[0] * self._last)
        self._time += 2.0 * float(weight.sum())
        self._sum += known.astype(float) @ values
        self._samples += int(known.sum())
        self._last, self._last_known = values[-1].copy(), bool(known[-1])

    @property
    def mean(self) -> Array:
        """Over time, or over the samples where none has passed; nan without samples."""
        if self._time > 0.0:
            return self.values / self._time
        return self._sum / self._samples if self._samples else np.full_like(self._sum, np.nan)


class _Crossings:
    """
    Where det(J) changes its sign, also by way of a zero.

    Times are interpolated between two samples. A restart is no crossing: what was before it
    says nothing of what comes after.
    """

    def __init__(self) -> None:
        self.count = 0
        self.first: list[float] = []
        # the last sample that was not zero, and the one after it
        self._seconds: Array = np.empty(0)
        self._determinants: Array = np.empty(0)

    def add(self, seconds: Array, determinants: Array, restarts: Flags) -> None:
        carried = len(self._seconds)
        time = np.concatenate((self._seconds, seconds))
        det = np.concatenate((self._determinants, determinants))
        run = np.concatenate((np.zeros(carried, dtype=int), np.cumsum(restarts)))
        apart = np.flatnonzero(det)
        before, after = apart[:-1], apart[1:]
        crossed = (det[before] > 0.0) != (det[after] > 0.0)
        before = before[crossed & (run[before] == run[after])]
        self.count += len(before)
        before = before[:TOLD - len(self.first)]
        share = det[before] / (det[before] - det[before + 1])
        self.first += (time[before] + share * (time[before + 1] - time[before])).tolist()
        keep = slice(0, 0)
        if len(apart) and run[apart[-1]] == run[-1]:
            keep = slice(int(apart[-1]), int(apart[-1]) + 2)
        self._seconds, self._determinants = time[keep], det[keep]


class _Warnings:
    """From when to when a warning was on."""

    def __init__(self) -> None:
        self.count = 0
        self.first: list[list[float | None]] = []
        self.seconds = 0.0
        self._on = False

    def add(self, seconds: Array, steps: Array, warnings: Flags) -> None:
        before = np.concatenate(([self._on], warnings[:-1]))
        self.seconds += float(steps @ before)
        changes = np.flatnonzero(warnings != before)
        self.count += int(warnings[changes].sum())
        for at in changes[:2 * TOLD].tolist():
            if warnings[at] and len(self.first) < TOLD:
                self.first.append([float(seconds[at]), None])
            elif not warnings[at] and self.first[-1][1] is None:
                self.first[-1][1] = float(seconds[at])
        self._on = bool(warnings[-1])


class _Broken(NamedTuple):
    """By leg, how often a limit is broken, and when first."""

    bound: Array
    setpoints: Integers
    first_at: Array

    def add(self, seconds: Array, broken: Flags) -> None:
        if broken.any():
            new = broken.any(axis=0) & (self.setpoints == 0)
            self.first_at[new] = seconds[broken.argmax(axis=0)][new]
            self.setpoints[:] += broken.sum(axis=0)


class Summary:
    """
    The summary of a motion of a machine with given parameters.

    Parameters
    ----------
    parameters : Parameters
        Names of the legs, limits, and ``setpoint.timeout``.

    """

    def __init__(self, parameters: Parameters) -> None:
        self._legs: tuple[str, ...] = parameters['joints']
        self._timeout: float = parameters['setpoint.timeout']
        self._limits = {
            name: _Broken(parameters[name], np.zeros(6, dtype=np.int64), np.full(6, np.nan))
            for name in LIMITS if parameters[name] is not None}
        self._held: list[_Block] = []
        self._gap: float | None = None
        self._stamps: tuple[int, int] | None = None
        self._answered = self._restarts = self._gaps = self._unsolved = self._suppressed = 0
        self._seconds = self._gap_seconds = 0.0
        self._shortest = _Extreme(6, np.negative)
        self._longest = _Extreme(6, np.positive)
        self._rate, self._force, self._published, self._power = (
            _Extreme(6, np.abs) for _ in range(4))
        # squares of the forces; power that drives the platform, power that brakes it
        self._means = _Integral(18)
        self._nearest = _Extreme(1, lambda det: -np.abs(det))
        self._condition = _Extreme(1, np.positive)
        self._time_to_crossing = _Extreme(1, np.negative)
        self._unit_load_force = _Extreme(6, np.positive)
        self._crossings = _Crossings()
        self._warnings = _Warnings()
        # a cause at a time: numpy seeks along many columns at once far more slowly
        self._cause_peaks = [_Extreme(6, np.abs) for _ in SOURCES]
        self._cause_squares = _Integral(6 * len(SOURCES))
        self._has_causes = False

    def add(self, seconds: Array, setpoints: Batch, outputs: Outputs,
            causes: Array | None = None) -> None:
        """
        Take one more block in.

        Parameters
        ----------
        seconds : (N,)
            Time of the motion since the first setpoint of all [s]; it stands still where
            stamps jump back.
        setpoints : Batch
            Those that were answered.
        outputs : Outputs
            The answers.
        causes : (N, 6, 6), optional
            The forces by cause, as ForceBreakdownRows gives them [N].

        """
        if not len(seconds):
            return
        block = _Block(seconds, setpoints, outputs, causes)
        if self._gap is not None:
            self._add(block)
            return
        self._held.append(block)
        if sum(len(block.seconds) for block in self._held) >= FIRST:
            self._release()

    def _release(self) -> None:
        """Take in what was held back until a gap can be told from a usual step."""
        if not self._held:
            return
        steps = np.diff(np.concatenate([block.seconds for block in self._held])[:FIRST])
        self._gap = longest_step(steps, self._timeout)
        held, self._held = self._held, []
        for block in held:
            self._add(block)

    def _add(self, block: _Block) -> None:
        seconds, setpoints, outputs, causes = block
        steps = self._steps(seconds, setpoints)
        lengths, rates, demanded = outputs.lengths, outputs.rates, outputs.demanded_forces
        unsolved = _with_nan(demanded)
        self._unsolved += int(unsolved.sum())
        self._suppressed += int((_with_nan(outputs.forces) & ~unsolved).sum())
        with np.errstate(over='ignore', invalid='ignore'):
            power = demanded * rates
            self._means.add(steps, np.concatenate(
                (demanded ** 2, np.maximum(power, 0.0), np.maximum(-power, 0.0)), axis=1))
        self._shortest.add(seconds, lengths)
        self._longest.add(seconds, lengths)
        self._rate.add(seconds, rates)
        self._force.add(seconds, demanded)
        self._published.add(seconds, outputs.forces)
        self._power.add(seconds, power)
        for name, limit in self._limits.items():
            values = {'limits.velocity_max': rates, 'limits.force_max': demanded}.get(
                name, lengths)
            limit.add(seconds, values < limit.bound if name == 'limits.length_min'
                      else np.abs(values) > limit.bound)
        self._nearest.add(seconds, outputs.determinants[:, None])
        self._condition.add(seconds, outputs.conditions[:, None])
        self._time_to_crossing.add(seconds, outputs.times_to_crossing[:, None])
        self._unit_load_force.add(seconds, outputs.unit_load_forces)
        self._crossings.add(seconds, outputs.determinants, setpoints.restarts)
        self._warnings.add(seconds, steps, outputs.warnings)
        if causes is not None:
            self._has_causes = True
            for n, peaks in enumerate(self._cause_peaks):
                peaks.add(seconds, causes[:, n])
            with np.errstate(over='ignore', invalid='ignore'):
                self._cause_squares.add(steps, causes.reshape(len(seconds), -1) ** 2)

    def _steps(self, seconds: Array, setpoints: Batch) -> Array:
        """Return the time from each setpoint's forerunner to it, none in a gap."""
        assert self._gap is not None
        steps: Array = np.diff(seconds, prepend=self._seconds if self._stamps else seconds[0])
        gaps = steps > self._gap
        self._gaps += int(gaps.sum())
        self._gap_seconds += float(steps[gaps].sum())
        steps[gaps] = 0.0
        self._seconds = float(seconds[-1])
        self._answered += len(seconds)
        self._restarts += int(setpoints.restarts.sum())
        first = self._stamps[0] if self._stamps else int(setpoints.stamps[0])
        self._stamps = first, int(setpoints.stamps[-1])
        return steps

    def values(self) -> dict[str, Any]:
        """Return the parts of summary.json that a motion gives, plain and finite numbers."""
        self._release()
        limits = self._broken_limits()
        return {
            'setpoints': {
                'answered': self._answered,
                'first_stamp_ns': self._stamps[0] if self._stamps else None,
                'last_stamp_ns': self._stamps[1] if self._stamps else None,
                'duration_s': self._seconds, 'gaps': self._gaps, 'gaps_s': self._gap_seconds,
                'restarts': self._restarts},
            'legs': {name: self._leg(n) for n, name in enumerate(self._legs)},
            'limits': limits,
            'singularity': self._singularity(),
            'causes': self._causes(),
            'limit_met': bool(limits) or self._warnings.count > 0,
        }

    def _leg(self, leg: int) -> dict[str, float | None]:
        squares, driving, braking = self._means.mean.reshape(3, 6)[:, leg].tolist()
        _, energy_driving, energy_braking = self._means.values.reshape(3, 6)[:, leg].tolist()
        solved = self._unsolved < self._answered
        shortest, longest = self._shortest.values[leg], self._longest.values[leg]
        rate, force = self._rate.values[leg], self._force.values[leg]
        least, most, fastest, strongest = (
            self._limits[name].bound[leg] if name in self._limits else None for name in LIMITS)
        length_margins = [*([] if least is None else [shortest - least]),
                          *([] if most is None else [most - longest])]
        return {
            'length_min_m': _number(shortest), 'length_max_m': _number(longest),
            'rate_peak_m_s': _number(rate), 'rate_peak_at_s': _number(self._rate.at[leg]),
            'force_peak_n': _number(force), 'force_peak_at_s': _number(self._force.at[leg]),
            'force_rms_n': _number(math.sqrt(squares)),
            'force_published_peak_n': _number(self._published.values[leg]),
            'power_peak_w': _number(self._power.values[leg]),
            'power_peak_at_s': _number(self._power.at[leg]),
            'power_mean_w': _number(driving - braking),
            'energy_driving_j': _number(energy_driving) if solved else None,
            'energy_braking_j': _number(energy_braking) if solved else None,
            'length_margin_m': _number(min(length_margins)) if length_margins else None,
            'rate_margin_m_s': None if fastest is None else _number(fastest - abs(rate)),
            'force_margin_n': None if strongest is None else _number(strongest - abs(force)),
        }

    def _broken_limits(self) -> list[dict[str, Any]]:
        farthest = dict(zip(LIMITS, (self._shortest, self._longest, self._rate, self._force),
                            strict=True))
        return [{'limit': name, 'leg': self._legs[leg], 'setpoints': int(limit.setpoints[leg]),
                 'worst': _number(farthest[name].values[leg]), 'bound': float(limit.bound[leg]),
                 'first_at_s': float(limit.first_at[leg])}
                for name, limit in self._limits.items()
                for leg in np.flatnonzero(limit.setpoints)]

    def _singularity(self) -> dict[str, Any]:
        # the leg whose largest force under a unit load is the largest of all
        most = np.where(np.isnan(self._unit_load_force.values), -np.inf,
                        self._unit_load_force.values)
        leg = int(most.argmax())
        return {
            'determinant_nearest_m3': _number(self._nearest.values[0]),
            'determinant_nearest_at_s': _number(self._nearest.at[0]),
            'crossings': self._crossings.count,
            'crossings_at_s': list(self._crossings.first),
            'condition_max': _number(self._condition.values[0]),
            'condition_max_at_s': _number(self._condition.at[0]),
            'unsolved': self._unsolved, 'suppressed': self._suppressed,
            'time_to_crossing_min_s': _number(self._time_to_crossing.values[0]),
            'time_to_crossing_min_at_s': _number(self._time_to_crossing.at[0]),
            'unit_load_force_max': _number(most[leg]),
            'unit_load_force_leg': self._legs[leg] if most[leg] > -np.inf else None,
            'warnings': self._warnings.count,
            'warnings_from_to_s': [list(span) for span in self._warnings.first],
            'warning_s': self._warnings.seconds,
        }

    def _causes(self) -> dict[str, dict[str, dict[str, float | None]]] | None:
        if not self._has_causes:
            return None
        rms = np.sqrt(self._cause_squares.mean).reshape(-1, 6)
        return {name: {cause: {'peak_n': _number(self._cause_peaks[n].values[leg]),
                               'rms_n': _number(rms[n, leg])}
                       for n, cause in enumerate(SOURCES)}
                for leg, name in enumerate(self._legs)}

    def table(self) -> str:
        """Return the summary as lines that a person can read, no wider than 100 columns."""
        found = self.values()
        if not self._answered:
            return 'no setpoint could be answered'
        lines = [
            _heading(found['setpoints']), '', *_legs_table(found['legs'], self._at_force_max()),
            *self._limit_lines(found['limits']), '', *_singularity_lines(found['singularity'])]
        return '\n'.join(textwrap.fill(line, _WIDTH, subsequent_indent='  ')
                         if len(line) > _WIDTH else line for line in lines)

    def _at_force_max(self) -> list[bool]:
        limit = self._limits.get('limits.force_max')
        reached: list[bool] = [False] * 6 if limit is None else (
            np.abs(self._force.values) >= limit.bound).tolist()
        return reached

    def _limit_lines(self, broken: list[dict[str, Any]]) -> list[str]:
        lines = []
        reached = any(self._at_force_max())
        if reached:
            lines.append('* at limits.force_max or beyond: published clipped to it, the leg would '
                         'need more')
        for each in broken:
            lines.append(f'{each["limit"]}, {each["bound"]:g}, broken by {each["leg"]} in '
                         f'{_counted(each["setpoints"], "setpoint")} from t = '
                         f'{each["first_at_s"]:.2f} s on: {each["worst"]:.6g} at worst')
        if self._limits and not broken and not reached:
            lines.append('all limits held')
        return lines


def _with_nan(values: Array) -> Flags:
    """Return which rows have a nan in them."""
    unknown = np.isnan(values)
    rows: Flags = np.zeros(len(values), dtype=bool)
    if unknown.any():  # seldom; to look row by row takes ten times as long
        np.any(unknown, axis=1, out=rows)
    return rows


def _number(value: float) -> float | None:
    """Return a plain number, none for what JSON cannot hold."""
    return float(value) if math.isfinite(value) else None


def _counted(number: int, what: str) -> str:
    return f'{number} {what}' if number == 1 else f'{number} {what}s'


def _heading(setpoints: dict[str, Any]) -> str:
    text = f'{_counted(setpoints["answered"], "setpoint")} in {setpoints["duration_s"]:.2f} s'
    if setpoints['gaps']:
        text += (f', of them {setpoints["gaps_s"]:.2f} s in '
                 f'{_counted(setpoints["gaps"], "gap")}')
    if setpoints['restarts']:
        text += f', {_counted(setpoints["restarts"], "restart")}'
    return text


# Of the legs' table: what it is of, title, key, width, digits after the point. With a leg's name
# and the mark they fill _WIDTH.
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


def _legs_table(legs: dict[str, dict[str, float | None]], marked: list[bool]) -> list[str]:
    """Return the lines of the legs; a column without any number is left out."""
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
    """Return a number with so many digits after the point, fewer where they have no room."""
    if value is None:
        return f'{"-":>{width}}'
    for text in (f'{value:.{digits}f}', f'{value:.0f}'):
        if len(text) < width:
            return f'{text:>{width}}'
    return f'{value:>{width}.1e}'


def _singularity_lines(found: dict[str, Any]) -> list[str]:
    crossings, spans = found['crossings_at_s'], found['warnings_from_to_s']
    lines = ['det(J) did not cross zero']
    if crossings:
        times = ', '.join(f't = {time:.3f} s' for time in crossings[:_TOLD_IN_TABLE])
        more = found['crossings'] - _TOLD_IN_TABLE
        lines = [f'det(J) crossed zero at {times}{f" and {more} times more" if more > 0 else ""}:'
                 ' forces grow without bound there']
    lines.append(f'det(J) nearest zero: {found["determinant_nearest_m3"]:.6g} m^3 at t = '
                 f'{found["determinant_nearest_at_s"]:.2f} s')
    if found['condition_max'] is not None:
        lines.append(f'condition number of J_inv: {found["condition_max"]:.4g} at most, at t = '
                     f'{found["condition_max_at_s"]:.2f} s')
    if unpublished := found['unsolved'] + found['suppressed']:
        lines.append(f'no forces were published in {_counted(unpublished, "setpoint")}')
    for begun, ended in spans[:_TOLD_IN_TABLE]:
        ahead = [time - begun for time in crossings
                 if begun <= time and (ended is None or time <= ended)]
        lines.append(
            f'singularity warning from t = {begun:.2f} s '
            + ('to the end' if ended is None else f'to {ended:.2f} s')
            + (f': {ahead[0]:.2f} s before the crossing' if ahead else ''))
    if found['warnings'] > _TOLD_IN_TABLE:
        lines.append(f'and {found["warnings"] - _TOLD_IN_TABLE} singularity warnings more, for '
                     f'{found["warning_s"]:.2f} s in all')
    if not spans:
        lines.append('no singularity warning')
    return lines
