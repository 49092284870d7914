# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Hypotheses about a file or a recording, and the search for those that are likely.

A possible error is a hypothesis: its keyword or parameter, its evidence, its words. The evidence
is computed from a subject, which holds the file or the data and numbers that several hypotheses
need, and is positive where the error is likely, as a value above all that are known. An array is
the evidence for each leg; the leg with the largest one is named. Numbers that are not known are
nan, which is no evidence.

Packages declare their hypotheses in tables, nested tuples in the order of the report. ``First``
reports the first entry that finds anything, where later ones would follow from it; ``When``
depends on a condition; a function finds the errors of another subject. A new possible error is
one entry of a table.

Hypotheses that exclude one another are transforms of the same data: another unit, sign, order or
frame. ``likeliest`` compares their misfits, those of the data without the error.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
import math
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar, Union

import numpy as np

from stewart_dynamics.arrays import Array

S = TypeVar('S')
T = TypeVar('T')


class PossibleError(NamedTuple):
    """A possible error in a file or in data, or the likely cause of a lack of fit."""

    what: str  # keyword for programs, as sign, unit, swapped; or the parameter
    text: str  # description in one line


@dataclass(frozen=True)
class Hypothesis(Generic[S]):
    """A possible error of a subject."""

    what: str  # keyword or parameter; may be a template
    evidence: Callable[[S], Any]
    words: str
    """Template with attributes of the subject; of an array the element of the largest evidence."""


class First(tuple['Table[S]', ...], Generic[S]):
    """Entries of which the first that finds anything is reported alone."""

    __slots__ = ()

    def __new__(cls, *entries: Table[S]) -> First[S]:
        """Return the entries in their order."""
        return super().__new__(cls, entries)


@dataclass(frozen=True)
class When(Generic[S]):
    """Entries that are looked at under a condition."""

    holds: Callable[[S], Any]
    table: Table[S]


Table: TypeAlias = Union[Hypothesis[S], First[S], When[S], 'tuple[Table[S], ...]',
                         Callable[[S], Iterable[PossibleError]]]


class Six:
    """Parameters of the legs as arrays (6,); nan, which is no evidence, where they are not set."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self._values = values

    def __getitem__(self, name: str) -> Array:
        """Return the values of a parameter."""
        value = self._values[name]
        return np.full(6, np.nan if value is None else value)


class _OfLeg:
    """Attributes of a subject, or items of a mapping, by their names; of lists and arrays one."""

    def __init__(self, of: Any, at: int) -> None:
        self._of, self._at = of, at

    def __getitem__(self, name: str) -> Any:
        """Return a value."""
        value = (self._of[name] if isinstance(self._of, Mapping | Six) else
                 getattr(self._of, name))
        if isinstance(value, Mapping | Six):
            return _OfLeg(value, self._at)
        return value[self._at] if isinstance(value, list | np.ndarray) else value


def find_errors(table: Table[S], subject: S) -> Iterator[PossibleError]:
    """Yield the likely errors of a table, in its order."""
    if isinstance(table, Hypothesis):
        evidence = np.nan_to_num(np.atleast_1d(np.asarray(
            table.evidence(subject), dtype=float)), nan=-np.inf)
        at = int(np.argmax(evidence))
        if evidence[at] > 0.0:
            of_leg = _OfLeg(subject, at)
            yield PossibleError(table.what.format_map(of_leg), table.words.format_map(of_leg))
    elif isinstance(table, When):
        if table.holds(subject):
            yield from find_errors(table.table, subject)
    elif callable(table):
        yield from table(subject)
    else:
        for entry in table:
            found = [*find_errors(entry, subject)]
            yield from found
            if found and isinstance(table, First):
                return


def lines_of(errors: Iterable[PossibleError]) -> Iterator[str]:
    """Yield possible errors of parameters, each in one line that begins with the parameter."""
    return (f'{what}: {text}' for what, text in errors)


def likeliest(tried: Iterable[tuple[float, T]], largest: float, alike: float = 1.0,
              exact: float = 0.0, logarithms: bool = False) -> list[tuple[float, T]]:
    """
    Return the hypotheses with the smallest misfit, in the order in which they were tried.

    tried: misfits without the error, and the hypotheses; simpler ones first.
    largest: misfits from this one on are no evidence for an error.
    alike: misfits up to this multiple of the smallest explain the data as well.
    exact: misfits below it are all the same.
    logarithms: misfits are logarithms, of likelihoods those of their inverse; ``largest`` is one,
        too, and ``alike`` is that of the multiple.
    """
    each = [*tried]
    best = min((misfit for misfit, _ in each), default=math.inf)
    if not best < largest:
        return []
    most = best + alike if logarithms else max(alike * best, exact)
    return [(misfit, of) for misfit, of in each if misfit <= most]
