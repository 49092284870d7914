# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The kinds of legs: what differs between telescopic legs and cranks, one module each."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TYPE_CHECKING

from stewart_dynamics.errors import ParameterError, shown_name
from stewart_dynamics.legs.crank import CRANK
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.legs.telescopic import TELESCOPIC

if TYPE_CHECKING:
    from stewart_dynamics.parameters.table import Parameters

_EXAMPLES = Path(__file__).with_name('examples')
KINDS: tuple[LegKind, ...] = (TELESCOPIC, CRANK)
for _kind in KINDS:
    _kind.foreign = tuple(name for each in KINDS if each is not _kind for name in each.own
                          if name not in _kind.own)


def example_names() -> tuple[str, ...]:
    """Return the names of the parameter files to begin with, one of each kind."""
    return tuple(sorted(path.stem for path in _EXAMPLES.glob('*.yaml')))


def example_file(name: str) -> Path:
    """
    Return the path of a commented parameter file to begin with.

    Raises ParameterError: the name is not in ``example_names``.
    """
    if name not in example_names():
        given = shown_name(name) if name else 'missing'
        raise ParameterError(
            f'--example: {given}: must be one of {", ".join(example_names())}')
    return _EXAMPLES / f'{name}.yaml'


def example(name: str) -> str:
    """Return the text of ``example_file``."""
    return example_file(name).read_text(encoding='utf-8')


def kind_of(values: Mapping[str, Any]) -> LegKind:
    """Return the kind of the legs of parameters: the last whose ``marker`` is given."""
    return next((kind for kind in reversed(KINDS) if kind.marker and
                 values[kind.marker] is not None), TELESCOPIC)


def without_alternatives(changes: Mapping[str, Any]) -> dict[str, None]:
    """Return the names in whose place changes give others: see ``LegKind.alternatives``."""
    return {name: None for kind in KINDS for group in kind.alternatives for name in group
            if not any(each in changes for each in group)
            and any(each in changes for other in kind.alternatives for each in other)}


def require_kind(parameters: Parameters, feature: str, *kinds: LegKind) -> None:
    """
    Raise ParameterError if a feature is not available for the legs of a hexapod.

    feature: its name in the error. kinds: those that have it, by default telescopic legs alone.
    """
    known = kinds or (TELESCOPIC,)
    if parameters.leg_kind not in known:
        raise ParameterError(
            f'{parameters.source}: {parameters.leg_kind.marker}: {feature}: available for '
            f'{" and ".join(each.name for each in known)} legs alone')
