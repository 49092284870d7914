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
The report of one bag: a single HTML file with tables, plots linked in time and a moving platform.

It needs no network: plotly.js is inside, from the PyPI package plotly. Numbers go in as base64
of typed arrays; what users have named is text and never markup, and the browser is told to run
no script but the three that are put here.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
import functools
import hashlib
from html import escape
import importlib.util
import json
from pathlib import Path
import re
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import StewartError
from stewart_dynamics.mechanics.force_breakdown import SOURCES
from stewart_dynamics.parameters import Parameters
from stewart_dynamics.replay.curves import Curves, Frames
from stewart_dynamics.replay.report_tables import bag_name, parameter_table, Tables
from stewart_dynamics.runtime.step import Batch, Outputs

TEMPLATE = Path(__file__).with_suffix('.html')

# Okabe and Ito's colours, which the colour-blind can tell apart; their yellow is lost on white.
_COLORS = ('#0072b2', '#d55e00', '#009e73', '#cc79a7', '#e69f00', '#56b4e9')
_AXIS_COLORS = ('#d55e00', '#009e73', '#0072b2')
_BLACK = '#222222'

# Where the channels of a sample begin, in the order in which ``Report.add`` puts them.
_POSITION, _ANGLES, _VELOCITY, _OMEGA, _ACCELERATION, _ALPHA = range(0, 18, 3)
_LENGTHS, _RATES, _FORCES, _POWERS = range(18, 42, 6)
_DETERMINANT, _CONDITION, _SOURCES = 42, 43, 44
_CHANNELS = _SOURCES + 6 * len(SOURCES)

# And of a comparison with what was measured.
_MEASURED, _COMPUTED, _RESIDUAL, _WRENCH = range(0, 24, 6)
_COMPARED = 24

# A frame of the moving platform: position, rotation, lengths, forces.
_FRAME = 24


class Curve(NamedTuple):
    """A line in a plot."""

    name: str
    color: str
    curve: int
    dash: str = 'solid'
    width: float = 1.6


class Bound(NamedTuple):
    """A horizontal line in a plot."""

    value: float
    text: str
    color: str = _BLACK


class Plot(NamedTuple):
    """A plot over time; of several variants one is shown at a time, by the reader's choice."""

    key: str
    figure: str
    title: str
    unit: str
    variants: Mapping[str, Sequence[Curve]]
    note: str = ''
    bounds: Sequence[Bound] = ()
    log: bool = False
    touches: bool = False
    """Shade when something touched the platform."""
    spikes: bool = False
    """A few samples may be far larger than all others: these are not to flatten them."""


class Report:
    """
    What is drawn of a bag, gathered block after block, and the file that it goes into.

    Parameters
    ----------
    parameters : Parameters
        The machine's.
    measured : bool
        The bag holds measured forces: ``add_measured`` will be called.

    """

    def __init__(self, parameters: Parameters, measured: bool = False) -> None:
        self._parameters = parameters
        self._legs: tuple[str, ...] = parameters['joints']
        timeout = parameters['setpoint.timeout']
        self._curves = Curves(_CHANNELS, timeout)
        self._frames = Frames(_FRAME)
        self._compared = Curves(_COMPARED, timeout) if measured else None
        self._angles: Array = np.zeros((1, 3))

    def add(self, seconds: Array, setpoints: Batch, outputs: Outputs, causes: Array) -> None:
        """
        Add setpoints and what they gave.

        Parameters
        ----------
        seconds : (N,)
            Since the first setpoint of the bag, never decreasing [s].
        setpoints : Batch
            N of them, at least one.
        outputs : Outputs
            Theirs.
        causes : (N, 6, 6)
            The demanded forces split: sample, cause as in SOURCES, leg [N].

        """
        motions, forces = setpoints.motions, outputs.demanded_forces
        rows = np.empty((_CHANNELS, len(seconds)))
        rows[_POSITION:_POSITION + 3] = motions[:, 0:3].T
        rows[_ANGLES:_ANGLES + 3] = self._continued(_euler(motions[:, 3:12])).T
        rows[_VELOCITY:_VELOCITY + 3] = motions[:, 12:15].T
        rows[_OMEGA:_OMEGA + 3] = np.degrees(motions[:, 15:18]).T
        rows[_ACCELERATION:_ACCELERATION + 3] = motions[:, 18:21].T
        rows[_ALPHA:_ALPHA + 3] = np.degrees(motions[:, 21:24]).T
        rows[_LENGTHS:_LENGTHS + 6] = outputs.lengths.T
        rows[_RATES:_RATES + 6] = outputs.rates.T
        rows[_FORCES:_FORCES + 6] = forces.T
        with np.errstate(over='ignore'):
            rows[_POWERS:_POWERS + 6] = (forces * outputs.rates).T
        rows[_DETERMINANT] = outputs.determinants
        rows[_CONDITION] = outputs.conditions
        rows[_SOURCES:] = causes.reshape(len(seconds), -1).T
        self._curves.add(seconds, rows)
        self._frames.add(seconds, np.concatenate(
            [motions[:, :12], outputs.lengths, forces], axis=1))

    def add_measured(
            self, seconds: Array, measured: Array, computed: Array, wrench: Array) -> None:
        """
        Add measured forces and the computed ones at the same times.

        Parameters
        ----------
        seconds : (M,)
            Since the first setpoint of the bag, never decreasing [s].
        measured, computed : (M, 6)
            Leg forces [N].
        wrench : (M, 6)
            Their difference as a load on the platform [N, N m].

        """
        if self._compared is None:
            raise ValueError('the report was begun without measured forces')
        self._compared.add(seconds, np.concatenate(
            [measured, computed, measured - computed, wrench], axis=1).T)

    def write(self, path: Path, summary: Mapping[str, Any]) -> None:
        """
        Write the report.

        Parameters
        ----------
        path : Path
            The file; one that exists is overwritten.
        summary : mapping
            What summary.json holds.

        Raises StewartError where plotly is not installed.

        """
        script = _plotly()
        template = TEMPLATE.read_text(encoding='utf-8')
        data = _json(self._data(summary))
        own = _between(template, '<script id="own">', '</script>')
        policy = ' '.join(f"'sha256-{_digest(text)}'" for text in (script, own))
        parts = {
            'policy': escape(f"default-src 'none'; script-src {policy}; style-src "
                             "'unsafe-inline'; img-src data: blob:; base-uri 'none'; "
                             "form-action 'none'"),
            'title': escape(f'{bag_name(summary["bag"])}: report'),
            'tables': Tables(summary, self._parameters).html(),
            'parameters': parameter_table(summary['parameters']),
            'data': data,
            'plotly': script,
        }
        page = re.sub(r'<!--=(\w+)-->', lambda match: parts[match[1]], template)
        path.write_text(page, encoding='utf-8', errors='backslashreplace', newline='\n')

    def _continued(self, angles: Array) -> Array:
        """Return angles [deg] that go on past half a turn where they would jump to the other."""
        whole = np.concatenate([self._angles, angles])
        turns = np.cumsum(np.round(np.diff(whole, axis=0) / 360.0), axis=0)
        continued: Array = angles - 360.0 * turns
        self._angles = continued[-1:]
        return continued

    def _data(self, summary: Mapping[str, Any]) -> dict[str, Any]:
        times, frames = self._frames.chosen()
        singularity = summary['singularity']
        p = self._parameters
        curves = [_curve(self._curves, n) for n in range(_CHANNELS)]
        plots = self._plots() if self._curves.samples else []
        if self._compared is not None and self._compared.samples:
            plots += self._measured_plots(len(curves))
            curves += [_curve(self._compared, n) for n in range(_COMPARED)]
        return {
            'samples': self._curves.samples,
            'samplesInBucket': self._curves.samples_in_bucket,
            'begin': float(times[0]) if len(times) else 0.0,
            'end': float(times[-1]) if len(times) else 0.0,
            'legs': self._legs,
            'colors': _COLORS,
            'baseJoints': p['geometry.base_joints'].tolist(),
            'platformJoints': p['geometry.platform_joints'].tolist(),
            'frames': {'times': _base64(times, '<f8'), 'numbers': _base64(frames, '<f8')},
            'warnings': singularity['warnings_from_to_s'],
            'crossings': singularity['crossings_at_s'],
            'allWarnings': singularity['warnings'],
            'allCrossings': singularity['crossings'],
            'touches': [[each['from_s'], each['to_s']] for each in (
                summary['measured']['touches']['strongest'] if summary['measured'] else ())],
            'curves': curves,
            'plots': [plot._asdict() | {
                'bounds': [bound._asdict() for bound in plot.bounds],
                'variants': [{'name': name, 'curves': [curve._asdict() for curve in curves_]}
                             for name, curves_ in plot.variants.items()],
            } for plot in plots],
        }

    def _plots(self) -> list[Plot]:
        p, legs = self._parameters, self._of_legs
        crossing = Bound(0.0, 'singular', '#c00000')
        return [
            Plot('position', '12', 'Inputs: position of the platform', 'm',
                 _of_axes(_POSITION, 'X', 'Y', 'Z'), 'of its origin, base axes'),
            Plot('angles', '12', 'Inputs: orientation of the platform', 'deg',
                 _of_axes(_ANGLES, 'alpha', 'beta', 'gamma'),
                 'R = Rz(gamma) Ry(beta) Rx(alpha)'),
            Plot('velocity', '13', 'Velocity of the platform', 'm/s',
                 _of_axes(_VELOCITY, 'v x', 'v y', 'v z'), 'of its origin, base axes'),
            Plot('angular_velocity', '13', 'Angular velocity of the platform', 'deg/s',
                 _of_axes(_OMEGA, 'w x', 'w y', 'w z'),
                 'base axes; not the rates of alpha, beta, gamma'),
            Plot('acceleration', '14', 'Acceleration of the platform', 'm/s²',
                 _of_axes(_ACCELERATION, 'a x', 'a y', 'a z'), 'of its origin, base axes'),
            Plot('angular_acceleration', '14', 'Angular acceleration of the platform', 'deg/s²',
                 _of_axes(_ALPHA, 'dw/dt x', 'dw/dt y', 'dw/dt z'), 'base axes'),
            Plot('lengths', '15', 'Leg lengths', 'm', legs(_LENGTHS),
                 'between the joint centers', [
                     *_bounds('length_min', p['limits.length_min']),
                     *_bounds('length_max', p['limits.length_max'])]),
            Plot('determinant', '17', 'det(J)', 'm³',
                 {'': [Curve('det(J)', _COLORS[0], _DETERMINANT)]},
                 'zero where the legs cannot hold some load', [crossing], spikes=True),
            Plot('condition', '17', 'Condition number of J_inv', '–',
                 {'': [Curve('condition', _COLORS[1], _CONDITION)]},
                 'dimensionless; 1 is best', [
                     Bound(p['singularity.warn_condition'], 'warn', '#b36b00'),
                     Bound(p['singularity.stop_condition'], 'stop', '#c00000')], log=True),
            Plot('forces', '18', 'Leg forces', 'N', legs(_FORCES),
                 'as the motion demands them, + pushes',
                 [*_bounds('force_max', p['limits.force_max'], both=True)], spikes=True),
            Plot('rates', '', 'Leg rates', 'm/s', legs(_RATES), '+ extends',
                 [*_bounds('velocity_max', p['limits.velocity_max'], both=True)]),
            Plot('powers', '', 'Mechanical power of the legs', 'W', legs(_POWERS),
                 'demanded force times rate; + drives, − brakes', spikes=True),
            Plot('causes', '', 'Leg force by cause', 'N', {
                leg: [Curve('sum', '#a3abb6', _FORCES + n, width=4.5),
                      *(Curve(cause, color, _SOURCES + 6 * c + n) for c, (cause, color) in
                        enumerate(zip(SOURCES, _COLORS, strict=True)))]
                for n, leg in enumerate(self._legs)}, 'the parts of the demanded force',
                spikes=True),
        ]

    def _measured_plots(self, first: int) -> list[Plot]:
        wrench = first + _WRENCH
        return [
            Plot('measured', '', 'Measured and computed leg force', 'N', {
                leg: [Curve('measured', _BLACK, first + _MEASURED + n),
                      Curve('computed', _COLORS[n], first + _COMPUTED + n),
                      Curve('residual', '#888888', first + _RESIDUAL + n, 'dot')]
                for n, leg in enumerate(self._legs)}, 'residual: measured less computed',
                touches=True, spikes=True),
            Plot('residuals', '', 'Residual of every leg', 'N', self._of_legs(first + _RESIDUAL),
                 'measured less computed force', touches=True, spikes=True),
            Plot('residual_force', '', 'Residual as a force on the platform', 'N',
                 _of_axes(wrench, 'F x', 'F y', 'F z'),
                 'J_inv^T (measured − computed): what the model does not know, base axes',
                 touches=True, spikes=True),
            Plot('residual_moment', '', 'Residual as a moment on the platform', 'N m',
                 _of_axes(wrench + 3, 'M x', 'M y', 'M z'),
                 'about its origin, base axes', touches=True, spikes=True),
        ]

    def _of_legs(self, first: int) -> dict[str, list[Curve]]:
        return {'': [Curve(leg, color, first + n) for n, (leg, color) in
                     enumerate(zip(self._legs, _COLORS, strict=True))]}


def _of_axes(first: int, *names: str) -> dict[str, list[Curve]]:
    return {'': [Curve(name, color, first + n) for n, (name, color) in
                 enumerate(zip(names, _AXIS_COLORS, strict=True))]}


def _bounds(name: str, values: Array | None, both: bool = False) -> list[Bound]:
    """Return a line for the bound of all legs, or one in its own colour for each."""
    if values is None:
        return []
    alike = bool(np.all(values == values[0]))
    return [Bound(sign * float(value), name if alike else '', _BLACK if alike else color)
            for sign in ((1.0, -1.0) if both else (1.0,))
            for value, color in list(zip(values, _COLORS, strict=True))[:1 if alike else 6]]


def _euler(rotations: Array) -> Array:
    """Return alpha, beta, gamma (N, 3) [deg] of rows of R = Rz(gamma) Ry(beta) Rx(alpha)."""
    r = rotations.T
    level = np.hypot(r[0], r[3])
    angles: Array = np.degrees(np.stack([
        np.arctan2(r[7], r[8]), np.arctan2(-r[6], level), np.arctan2(r[3], r[0])], axis=1))
    return angles


def _curve(curves: Curves, channel: int) -> dict[str, str]:
    times, values = curves.drawn(channel)
    most = float(np.finfo(np.float32).max)
    return {'times': _base64(times, '<f8'), 'values': _base64(values.clip(-most, most), '<f4')}


def _base64(numbers: ArrayLike, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(numbers, dtype=kind).tobytes()).decode()


def _json(data: Any) -> str:
    """Return JSON in which no markup can be: the characters that begin it are escaped."""
    text = json.dumps(data, allow_nan=False, separators=(',', ':'))
    return text.replace('<', r'\u003c').replace('>', r'\u003e').replace('&', r'\u0026')


@functools.lru_cache(maxsize=1)
def _plotly() -> str:
    """Return plotly.js, without the import of the package around it."""
    found = importlib.util.find_spec('plotly')
    for folder in found.submodule_search_locations or () if found else ():
        try:
            script = (Path(folder) / 'package_data' / 'plotly.min.js').read_text(encoding='utf-8')
        except OSError:
            continue
        # A browser reads line ends as \n, and a script until the first of these.
        script = script.replace('\r\n', '\n').replace('\r', '\n')
        return script.replace('</script', r'<\/script').replace('<!--', r'<\!--')
    raise StewartError('the report needs plotly, which is not installed: pip install plotly, or '
                       'replay with --no-report')


def _digest(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()


def _between(text: str, begin: str, end: str) -> str:
    return text.split(begin, 1)[1].split(end, 1)[0]
