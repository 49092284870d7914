# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Summaries of bags as documents, and documents as summaries."""

from __future__ import annotations

from typing import Any

from msgspec import to_builtins
from referees import symmetric_parameters

from stewart_dynamics import Parameters
from stewart_dynamics.records import record_of
from stewart_dynamics.replay.bag_summary import BagSummary
from stewart_dynamics.replay.residuals import Comparison
from stewart_dynamics.replay.summary import Summary

# Defaults of entries in lists.
_ENTRIES = {'limits': {'setpoints': 1}, 'rejected': {'first': '', 'first_at_s': None}}


def motion_of(summary: Summary) -> dict[str, Any]:
    """Return the keys of summary.json that depend on the motion alone."""
    found = to_builtins(summary.values())
    keys = list(found)
    return {key: found[key] for key in keys[keys.index('quasi_static'):keys.index('mistakes')]}


def bag_summary(summary: dict[str, Any] | None = None, parameters: Parameters | None = None,
                **changes: Any) -> BagSummary:
    """Return the summary with the keys of a document and others; the rest is not known."""
    parameters = parameters or symmetric_parameters()
    base = to_builtins(Summary(parameters).values())
    given = {**(summary or {}), **changes}
    for key, entry in _ENTRIES.items():
        if key in given:
            given[key] = [entry | each for each in given[key]]
    if given.get('measured'):
        given['measured'] = _filled(to_builtins(Comparison(parameters).values()),
                                    given['measured'])
    return record_of(BagSummary, _filled(base, given), parameters.leg_kind)


def _filled(base: Any, given: Any) -> Any:
    """Return a document, with missing keys from another one."""
    if not isinstance(base, dict) or not isinstance(given, dict):
        return given
    if 'legs' in given:  # all as the first
        base = base | {'legs': dict.fromkeys(given['legs'], next(iter(base['legs'].values())))}
    return {**base, **{key: _filled(base.get(key), value) for key, value in given.items()}}
