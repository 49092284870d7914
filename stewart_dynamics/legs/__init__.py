# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The kinds of legs: what differs between telescopic legs and cranks, one module each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from stewart_dynamics.legs.crank import CRANK
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.legs.telescopic import TELESCOPIC

KINDS: tuple[LegKind, ...] = (TELESCOPIC, CRANK)
for _kind in KINDS:
    _kind.foreign = tuple(name for each in KINDS if each is not _kind for name in each.own)


def kind_of(values: Mapping[str, Any]) -> LegKind:
    """Return the kind of the legs of parameters: the last whose ``marker`` is given."""
    return next((kind for kind in reversed(KINDS) if kind.marker and
                 values[kind.marker] is not None), TELESCOPIC)
