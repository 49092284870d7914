# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Records: results with the keys, types and meanings of the JSON documents that programs write.

A key that is named by the quantities of a kind of legs has braces,
``'{effort}_peak_{effort_unit}'``: ``of_kind`` gives the record of a kind, in which it is
``force_peak_n`` or ``torque_peak_n_m``. A key that is UNSET is not in the document.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache, reduce
from operator import or_
from types import UnionType
from typing import (
    Annotated, Any, ClassVar, get_args, get_origin, TYPE_CHECKING, TypeVar, Union)

from msgspec import convert, defstruct, field, Meta, NODEFAULT, Struct
from msgspec.structs import fields

if TYPE_CHECKING:
    from stewart_dynamics.legs.kind import LegKind

R = TypeVar('R', bound='Record')
Number = float | None
"""A number; None: not known, or not finite."""
Value = bool | int | float | str | list[Any] | None
"""A value of a parameter or option."""


class Record(Struct):
    """A group of keys of a JSON document; ``kind`` is the one that ``of_kind`` was given."""

    kind: ClassVar[Any]
    __struct_encode_fields__: ClassVar[tuple[str, ...]]

    @classmethod
    def more_fields(cls, kind: LegKind) -> Iterable[tuple[str, Any]]:
        """Return further keys of a kind of legs, each with its type."""
        return ()

    @classmethod
    def keys(cls) -> tuple[str, ...]:
        """Return the keys of the document."""
        return cls.__struct_encode_fields__

    def under(self, key: str) -> Any:
        """Return the value under a key of the document."""
        return getattr(self, self.__struct_fields__[self.keys().index(key)])


def means(text: str) -> Meta:
    """Return the meaning of a key, as documentation and schema have it."""
    return Meta(description=text)


def unit_key(unit: str) -> str:
    """Return a unit as keys end with it: n_m, rad_s."""
    return unit.lower().replace('/', '_').replace(' ', '_')


def key_of(name: str, unit: str) -> str:
    """Return a key, which ends with the unit: torque_peak_n_m."""
    return f'{name}_{unit_key(unit)}' if unit else name


def of_kind(record: type[R], kind: LegKind) -> type[R]:
    """Return a record, and the records in it, with the keys of a kind of legs."""
    found: type[R] = _of_kind(record, kind)
    return found


@cache
def _of_kind(record: type[Record], kind: LegKind) -> Any:
    words = {name: text for quantity in ('position', 'rate', 'effort')
             for each in [getattr(kind, quantity)]
             for name, text in ((quantity, each.name), (f'{quantity}s', each.field),
                                (f'{quantity}_unit', unit_key(each.unit)))}
    found: list[Any] = []
    more = list(record.more_fields(kind))
    differs = bool(more)
    for each in fields(record):
        options = {} if each.default is NODEFAULT else {'default': each.default}
        if each.default_factory is not NODEFAULT:
            options = {'default_factory': each.default_factory}
        key, type_of_kind = each.encode_name.format(**words), _type_of_kind(each.type, kind)
        differs |= (key, type_of_kind) != (each.encode_name, each.type)
        found.append((each.name, type_of_kind, field(name=key, **options)))
    if not differs:
        return record
    return defstruct(
        f'{record.__name__}_{kind.name}', found + more, bases=(record,),
        kw_only=True, module=record.__module__,
        namespace={'__doc__': record.__doc__, 'kind': kind})


def _type_of_kind(kind_of_value: Any, kind: LegKind) -> Any:
    """Return the type of a key with the records in it as they are for a kind of legs."""
    origin, arguments = get_origin(kind_of_value), get_args(kind_of_value)
    if isinstance(kind_of_value, type) and issubclass(kind_of_value, Record):
        return of_kind(kind_of_value, kind)
    if origin is Annotated:
        return Annotated[(_type_of_kind(arguments[0], kind), *arguments[1:])]
    if origin in (list, dict):
        return origin[tuple(_type_of_kind(each, kind) for each in arguments)]
    if origin in (Union, UnionType):
        return reduce(or_, (_type_of_kind(each, kind) for each in arguments))
    return kind_of_value


def record_of(record: type[R], document: Any, kind: LegKind) -> R:
    """Return the record in a JSON document; raises ValidationError if it is another document."""
    found: R = convert(document, of_kind(record, kind))
    return found
