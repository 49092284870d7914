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


"""The first screen of a report: reading, limits, singularity, measured forces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime, timezone
import re
from typing import Any, NamedTuple

from stewart_dynamics.arrays import SECOND
from stewart_dynamics.mechanics.limits import LIMITS, OF_JOINTS, QUANTITIES
from stewart_dynamics.parameters.table import PARAMETERS, Parameters

Summary = Mapping[str, Any]
"""The content of summary.json."""
Verdict = tuple[str, str]
"""Level (good, warn, bad or none) and title of a card."""

# Measured forces differ if the residual's RMS is a larger part of theirs.
_DIFFERENT = 0.05


def verdicts(summary: Summary) -> dict[str, Verdict]:
    """Return the cards of reading, limits, singularity and measured forces."""
    return {'reading': _reading(summary), 'limits': _limits(summary),
            'singularity': _singularity(summary['singularity']),
            'measured': _measured(summary['measured'])}


def _reading(summary: Summary) -> Verdict:
    if not summary['setpoints']['answered']:
        return 'bad', 'No setpoint could be answered'
    if not summary['complete']:
        return 'bad', 'The bag could not be read completely'
    if summary['setpoints']['base_unknown']:
        return 'warn', "The base's motion is not always known"
    if summary['rejected']:
        return 'warn', 'Some messages were rejected'
    return 'good', 'The whole bag was read'


def _limits(summary: Summary) -> Verdict:
    if summary['limits']:
        return 'bad', 'Limits are exceeded'
    if summary['limits_not_checked']:
        return 'warn', 'Not all limits could be checked'
    if not smallest_margins(summary):
        return 'none', 'No limits are given'
    return 'good', 'All limits are held'


def _singularity(found: Mapping[str, Any]) -> Verdict:
    if found['crossings'] or found['unsolved']:
        return 'bad', 'A singularity is reached'
    if found['warnings']:
        return 'warn', 'A singularity is near'
    if found['condition_max'] is None and found['determinant_nearest_m3'] is None:
        return 'none', 'Singularity'
    return 'good', 'Clear of singularities'


def _measured(measured: Mapping[str, Any] | None) -> Verdict:
    if not measured or not measured['setpoints_compared']:
        return 'none', 'Measured forces'
    if measured['contacts']['count'] or (measured['residual_share'] or 0.0) > _DIFFERENT:
        return 'warn', 'Measured forces differ'
    return 'good', 'Measured forces'


def rejections(summary: Summary) -> list[dict[str, Any]]:
    """Return the rejected messages, with details that do not repeat the stamp."""
    return [{**each, 'details': re.sub(r'^stamp \d+ ns(: | is )?', '', each['first'])}
            for each in summary['rejected']]


class MarginColumn(NamedTuple):
    """The margins of a quantity from its limits."""

    name: str
    unit: str
    key: str
    """Key of a leg in summary.json."""
    limits: tuple[str, ...]


def margin_columns(parameters: Parameters) -> list[MarginColumn]:
    """Return the quantities with limits; angles of joints only if one of them has a limit."""
    of_joints = any(parameters[name] is not None for name in OF_JOINTS)
    return [column for column in _MARGINS if of_joints or column.limits[0] not in OF_JOINTS]


def _margin_column(name: str, unit: str) -> MarginColumn:
    suffix = unit.lower().replace('/', '_')
    return MarginColumn(
        name, unit, f'{name.replace(" ", "_")}_margin_{suffix}',
        tuple(limit for limit in LIMITS if QUANTITIES[limit] == (name, unit)))


_MARGINS = [_margin_column(*quantity) for quantity in dict.fromkeys(
    QUANTITIES[limit] for limit in LIMITS)]


def smallest_margins(summary: Summary) -> list[dict[str, Any]]:
    """Return the smallest margins of length, rate, force and joint angles, each with its leg."""
    found = []
    for name, unit, key, _ in _MARGINS:
        of_legs = [(leg[key], joint) for joint, leg in summary['legs'].items()
                   if leg[key] is not None]
        if of_legs:
            value, joint = min(of_legs, key=lambda each: each[0])
            found.append({'name': name, 'value': value, 'unit': unit, 'leg': joint})
    return found


def exceeded_limits(limits: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return each exceeded limit, with the leg that exceeds it most."""
    found = []
    for name in dict.fromkeys(each['limit'] for each in limits):
        legs = [each for each in limits if each['limit'] == name]
        worst = max(legs, key=lambda each: abs(abs(each['worst']) - each['bound']))
        found.append({
            'name': name, 'bound': worst['bound'], 'unit': QUANTITIES[name][1],
            'leg': worst['leg'], 'worst': worst['worst'], 'others': len(legs) - 1,
            'first_at_s': min(each['first_at_s'] for each in legs)})
    return found


def date(stamp: int | None) -> str:
    """Return the date of a stamp, empty if it is not a plausible time."""
    if stamp is None or stamp < SECOND * 10 ** 9:
        return ''
    try:
        when = datetime.fromtimestamp(stamp // SECOND, timezone.utc)
    except (OverflowError, OSError, ValueError):
        return ''
    return f' ({when:%Y-%m-%d %H:%M:%S} UTC)'


def units() -> dict[str, str]:
    """Return the unit of each parameter for display."""
    return {name: (PARAMETERS[name].unit or '').replace('^2', '²') for name in PARAMETERS}
