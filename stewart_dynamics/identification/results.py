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

"""Result of an identification: identification.json, comments of identified.yaml, terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime, timezone
import textwrap
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.identification.identification_options import IdentificationOptions
from stewart_dynamics.identification.identify import Identified, Residuals
from stewart_dynamics.identification.lack_of_fit import Found
from stewart_dynamics.identification.unknowns import Unknowns
from stewart_dynamics.mechanics.least_squares import TWO_SIDED
from stewart_dynamics.replay.fingerprint import plain_parameters, software
from stewart_dynamics.replay.statements import plural
from stewart_dynamics.reporting.estimates import (
    combined, estimate, IDENTIFIED, NOT_IDENTIFIABLE, not_identifiable_lines, states_of,
    table_lines)

# Version of identification.json; increased when the meaning of a key changes.
VERSION = 1


def document(found: Identified, options: IdentificationOptions) -> dict[str, Any]:
    """Return the content of identification.json, see docs/identification.md."""
    what, joints = found.fit.identifiability, found.parameters['joints']
    u, lack = found.unknowns, found.lack_of_fit
    sure = lack is None or not lack.unexplained
    parameters = [
        estimate(name, unit, start, value, state, error, share, name in found.fit.at_bound, sure)
        for name, unit, start, value, state, error, share in zip(
            u.names, u.units, u.start, found.fit.values, states_of(what), _errors(found),
            what.shares, strict=True)]
    return {
        'version': VERSION, 'software': software(),
        'date': datetime.now(timezone.utc).strftime('%Y-%m-%dT%H:%M:%SZ'),
        'bags': [{
            **bag._asdict(), 'bag': str(bag.bag),
            'delay_s': float(delay + bag.delay_s) if error else None,
            'delay_standard_error_s': float(error) if error else None,
        } for bag, delay, error in zip(
            found.bags, found.fit.delays, found.errors.delays, strict=True)],
        'options': {
            'identify': list(options.kinds), 'motor_torque': options.motor_torque,
            'motor_current': options.motor_current,
            'cutoff_hz': options.cutoff, 'prior': options.prior, 'hold_out': options.hold_out,
            'delay': options.delay, 'accept_mistakes': options.accept_mistakes},
        'samples': found.samples, 'efforts_left_out': found.unsound,
        'efforts_outliers': found.outliers,
        'parameters': parameters,
        'combinations': combined(
            what, u.names, u.units, found.fit.values, found.errors.covariance),
        'rank': what.rank, 'unknowns': len(u.names),
        'singular_values': what.singular_values.tolist(),
        'residuals': _residuals(joints, found.residuals),
        'validation': None if found.validation is None else {
            'samples': found.validation.samples, **_residuals(joints, found.validation)},
        'lack_of_fit': None if lack is None else {
            'cause': lack.causes[0].what, 'text': lack.text,
            'intervals': 'widened' if sure else 'none', 'residual_left': lack.left,
            'causes': [_cause(each) for each in lack.causes],
            'other_causes': [_cause(each) for each in lack.others]},
        'likely_mistakes': [each._asdict() for each in found.likely],
        'identified': plain_parameters(found.parameters),
    }


def _cause(each: Found) -> dict[str, Any]:
    return {'what': each.what, 'text': each.text, 'statistic': each.statistic,
            'columns': each.columns, 'deviations': each.deviations}


def _errors(found: Identified) -> Array:
    """Return standard errors (k,), including unidentifiable directions and lack of fit."""
    what = found.fit.identifiability
    own = np.maximum(np.diag(found.errors.covariance), 0.0)
    errors: Array = np.sqrt(own + (what.shares * what.scales) ** 2)
    return errors if found.lack_of_fit is None else (
        errors + found.lack_of_fit.shifts / TWO_SIDED)


def _residuals(joints: Sequence[str], residuals: Residuals) -> dict[str, Any]:
    """Return the residuals of each leg, and their RMS of all legs."""
    rms = {'before_rms_n': residuals.before, 'after_rms_n': residuals.after,
           'measured_rms_n': residuals.measured}
    return {'legs': {joint: {key: float(values[leg]) for key, values in rms.items()}
                     for leg, joint in enumerate(joints)},
            **{key: float(np.sqrt(np.mean(values ** 2))) for key, values in rms.items()}}


def comments(result: dict[str, Any], unknowns: Unknowns) -> dict[str, str]:
    """Return the comments of identified.yaml by parameter: intervals and date."""
    texts: dict[str, list[str]] = {}
    for each in result['parameters']:
        parts = each['name'].split('.')
        name = '.'.join(parts[:2]) if parts[0] == 'platform' else '.'.join(parts[:-1])
        name = name.replace('first_moment', 'center_of_mass').replace('second_moment', 'inertia')
        if each['state'] == IDENTIFIED:
            text = (f'+-{TWO_SIDED * each["standard_error"]:.2g}' if each['interval'] else
                    'no interval: lack of fit')
            if name == 'gravity':  # the identified angle is not a value of the file
                text = f'turned about {parts[1][-1]} by {each["value"]:.5f} {text} rad'
        else:
            text = 'kept' if each['state'] == NOT_IDENTIFIABLE else 'only in a combination'
        texts.setdefault(name, []).append(text)
    return {name: 'kept: not identifiable from the motion' if set(each) == {'kept'} else
            f'identified {result["date"][:10]}, 95 %: '
            + ', '.join(each if len(set(each)) > 1 else each[:1])
            for name, each in texts.items()}


def result_text(result: Mapping[str, Any]) -> str:
    """Return identification.json as text, at most 100 columns wide except for long names."""
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
