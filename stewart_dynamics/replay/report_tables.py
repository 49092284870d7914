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


"""Tables of the report: rejected messages, margins, units."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime, timezone
import re
from typing import Any, NamedTuple

from stewart_dynamics.arrays import SECOND
from stewart_dynamics.mechanics.limits import CLEARANCE_MIN, LIMITS, OF_JOINTS, QUANTITIES
from stewart_dynamics.parameters.table import PARAMETERS, Parameters


def rejections(summary: Mapping[str, Any]) -> list[dict[str, Any]]:
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
    """Return the quantities with limits; joint angles and clearance only if theirs are given."""
    left_out: set[str] = set()
    for names in (OF_JOINTS, (CLEARANCE_MIN,)):
        if all(parameters[name] is None for name in names):
            left_out.update(names)
    return [column for column in _MARGINS if column.limits[0] not in left_out]


def _margin_column(name: str, unit: str) -> MarginColumn:
    suffix = unit.lower().replace('/', '_')
    return MarginColumn(
        name, unit, f'{name.replace(" ", "_")}_margin_{suffix}',
        tuple(limit for limit in LIMITS if QUANTITIES[limit] == (name, unit)))


_MARGINS = [_margin_column(*quantity) for quantity in dict.fromkeys(
    QUANTITIES[limit] for limit in LIMITS)]


def smallest_margins(summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the smallest margins of all quantities with a limit, each with its leg."""
    found = []
    for name, unit, key, _ in _MARGINS:
        of_legs = [(leg[key], joint) for joint, leg in summary['legs'].items()
                   if leg[key] is not None]
        if of_legs:
            value, joint = min(of_legs, key=lambda each: each[0])
            found.append({'name': name, 'value': value, 'unit': unit, 'leg': joint})
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
