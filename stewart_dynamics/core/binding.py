# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Structures, codes, functions and constants of the C library, read from its text.

``record('stewart_motion')`` is the numpy type of a structure, ``CODES['STEWART_OK']`` a code,
``CONSTANTS['HYSTERESIS']`` a number, ``function('solve_many')`` a function. A call passes arrays
by their addresses, after a check of their types; their sizes are the caller's concern.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
import ctypes
from functools import cache, cached_property, partial
from operator import itemgetter
from pathlib import Path
import re
from struct import Struct
from typing import Any, cast, NamedTuple

import numpy as np

_FOLDER = Path(__file__).parent
_NUMBERS: dict[str, tuple[np.dtype[Any], Any]] = {
    'double': (np.dtype(np.float64), ctypes.c_double), 'int': (np.dtype(np.intc), ctypes.c_int),
    'unsigned': (np.dtype(np.uintc), ctypes.c_uint),
    'uint8_t': (np.dtype(np.uint8), ctypes.c_uint8),
    'uint32_t': (np.dtype(np.uint32), ctypes.c_uint32),
    'int64_t': (np.dtype(np.int64), ctypes.c_int64)}
"""Types of numbers in the headers: those of arrays, and of arguments."""


def header(name: str) -> str:
    """Return the text of a header or source file of the library."""
    return (Path(__file__).parent / name).read_text(encoding='utf-8')


class LimitRow(NamedTuple):
    """A line of the table of limits in ``stewart_dynamics.h``."""

    bit: int  # of stewart_output.exceeded
    name: str
    field: str  # of stewart_leg
    depends: str  # what its quantity depends on: POSE, TWIST, LOAD or MOTOR
    quantity: str  # field of stewart_output
    kind: str  # MINIMUM, MAXIMUM, or LARGEST magnitude

    @property
    def minimum(self) -> bool:
        """Return whether the quantity must be at least the limit."""
        return self.kind == 'MINIMUM'


class Rule(NamedTuple):
    """A line of the table of rules in ``stewart_dynamics.h``."""

    name: str
    parameters: tuple[str, ...]
    text: str


_HEADERS = ''.join(map(header, ('stewart_dynamics.h', 'control.h', 'library.h')))
LIMIT_ROWS = tuple(
    LimitRow(int(bit), name, field, depends, quantity, kind)
    for kind, bit, name, field, depends, quantity in re.findall(
        r'(MINIMUM|MAXIMUM|LARGEST)\((\d+), (\w+), (\w+), (\w+), ([\w.]+)\)', _HEADERS))
"""The limits of the legs."""
RULES = {int(code): Rule(name, tuple(names.split(', ')), text) for code, name, names, text in
         re.findall(r'RULE\((\d+), (\w+), "([^"]*)",[\s\\]*"([^"]*)"\)', _HEADERS)}
"""The rules of ``stewart_check`` by their codes."""


def _declarations() -> str:
    """Return the headers without comments and directives, their tables written out."""
    text = re.sub(r'/\*.*?\*/', ' ', _HEADERS, flags=re.DOTALL)
    text = re.sub(r'^#(?:.*\\\n)*.*$', ' ', text, flags=re.MULTILINE)
    for use, lines in (
            ('STEWART_LIMITS(STEWART_BIT, STEWART_BIT, STEWART_BIT)',
             [f'STEWART_{row.name} = {row.bit},' for row in LIMIT_ROWS]),
            ('STEWART_LIMITS(STEWART_FIELD, STEWART_FIELD, STEWART_FIELD)',
             [f'double {row.field};' for row in LIMIT_ROWS]),
            ('STEWART_RULES(STEWART_RULE_CODE)',
             [f'STEWART_RULE_{rule.name} = {code},' for code, rule in RULES.items()])):
        text = text.replace(use, ' '.join(lines))
    return text


_TEXT = _declarations()

KINDS = {name: int(number) for number, name in re.findall(
    r'KIND\((\d+), (\w+), \w+, function, arguments\)', _HEADERS)}
"""The kinds of legs by name: TELESCOPIC, ..."""

CODES = {name: int(value) for enum in re.findall(r'enum \{(.*?)\};', _TEXT, re.DOTALL)
         for name, value in re.findall(r'(\w+) = (\d+)', enum)}
"""Return codes, causes of the singularity warning, and bits of exceeded limits."""

CONSTANTS = {name: float(value) for file in ('stewart_dynamics.c', 'plant.c')
             for name, value in re.findall(
                 r'^#define ([A-Z_]+) (?:INT64_C\()?([0-9.e-]+)\b', header(file), re.MULTILINE)}
"""Tolerances and other numbers that the source defines."""


@cache
def record(name: str) -> np.dtype[Any]:
    """Return the type of an array of structures, laid out as the compiler lays them out."""
    if name in _NUMBERS:
        return _NUMBERS[name][0]
    found = re.search(rf'typedef struct \{{([^}}]*)\}} {name};', _TEXT)
    if found is None:
        raise KeyError(name)
    return np.dtype(list(_fields(found[1])), align=True)


def _fields(text: str) -> Iterator[tuple[str, np.dtype[Any], tuple[int, ...]]]:
    for kind, names in re.findall(r'(\w+)\s+([^;]+);', text):
        for name, sizes in re.findall(r'(\w+)((?:\[\d+\])*)(?:,|$)', names.strip()):
            yield name, record(kind), tuple(map(int, re.findall(r'\d+', sizes)))


def places(name: str) -> dict[str, Any]:
    """
    Return where the doubles of a structure are in a row of its numbers.

    Numbers have an index, arrays and structures a slice; the fields of a structure in it follow
    it, as ``result.forces``. Fields of other types have no place.
    """
    return {field: begin if kind.base.fields is None and not kind.shape
            else slice(begin, begin + kind.itemsize // 8)
            for field, kind, begin in _numbered(record(name))
            if kind.base.fields is not None or kind.base == np.float64}


def _numbered(structure: np.dtype[Any], first: int = 0, prefix: str = '',
              ) -> Iterator[tuple[str, np.dtype[Any], int]]:
    fields: Any = structure.fields
    for field, (kind, offset, *_) in fields.items():
        begin = first + offset // 8
        yield prefix + field, kind, begin
        if kind.fields is not None:
            yield from _numbered(kind, begin, f'{prefix}{field}.')


class Sample:
    """
    The memory of a structure of doubles, for calls of one sample.

    given: the last field that ``write`` takes; it takes the numbers of all up to it.
    found: the fields that ``read`` returns.
    numbers: all of them, as a row.

    It takes a tenth of the time that setting and reading fields of an array of records takes.
    """

    def __init__(self, name: str, given: str, *found: str) -> None:
        self._where = where = places(name)
        self.numbers: Any = np.zeros(1, record(name)).view(np.float64)
        self._memory = self.numbers.data  # the same as bytes
        self._given = Struct(f'{_end(where[given])}d')
        read = [where[each] for each in found]
        first, end = min(map(_begin, read)), max(map(_end, read))
        self._at, self._found = 8 * first, Struct(f'{end - first}d')
        self._parts = itemgetter(*(
            each - first if isinstance(each, int) else slice(each.start - first, each.stop - first)
            for each in read))

    def __getitem__(self, field: str) -> Any:
        """Return the numbers of a field, as an array that stays."""
        place = self._where[field]
        return self.numbers[_begin(place):_end(place)]

    def write(self, *numbers: float) -> None:
        """Set the numbers of the fields that are given."""
        self._given.pack_into(self._memory, 0, *numbers)

    def read(self) -> Any:
        """Return a tuple of the fields that are found, or the only one: numbers, and tuples."""
        return self._parts(self._found.unpack_from(self._memory, self._at))


def _begin(place: int | slice) -> int:
    return place if isinstance(place, int) else place.start


def _end(place: int | slice) -> int:
    return place + 1 if isinstance(place, int) else place.stop


def _pointer(kind: str) -> Callable[[Any], Any]:
    """Return a function from an array, or None, to what ctypes passes; TypeError: another type."""
    wanted = record(kind)
    numbers = np.dtype(np.float64 if wanted.fields else {'uint8_t': bool}.get(kind, wanted))

    def passed(array: Any) -> Any:
        if array is None:
            return None
        if array.dtype != numbers:
            if array.dtype != wanted:
                raise _refused(array, kind)
        elif array.flags.carray:  # far faster than by the address
            return _MEMORY.from_buffer(array)
        if not array.flags.c_contiguous:
            raise _refused(array, kind)
        # Nothing is left to convert in a call: a quarter faster than with a c_void_p.
        return ctypes.byref(ctypes.c_char.from_address(array.ctypes.data))

    return passed


_MEMORY: Any = ctypes.c_char * 0  # passed by its address; arrays may be empty


def _refused(array: Any, kind: str) -> TypeError:
    return TypeError(
        f'an array of {array.dtype}, shape {array.shape}: must be of {kind}, in C order')


class Function:
    """A function of the library, with the arguments that its header declares."""

    def __init__(self, name: str) -> None:
        found = re.search(rf'(\w+) {name}\(([^)]*)\);', _TEXT)
        if found is None:
            raise KeyError(name)
        self.name = name
        self._returns = None if found[1] == 'void' else _NUMBERS[found[1]][1]
        self._passed = [
            _pointer(kind) if star or size else _NUMBERS[kind][1]
            for kind, star, size in re.findall(
                r'(?:const )?(\w+) (\*?) ?\w+(\[\d+\])?', found[2])]

    def __call__(self, *arguments: Any) -> Any:
        """Call it; other threads run meanwhile."""
        return self._unbound(*arguments)

    @cached_property
    def _unbound(self) -> Callable[..., Any]:
        return self.bound()

    def bound(self, *first: Any) -> Callable[..., Any]:
        """
        Return a function that calls it with these arguments, which stay where they are, and more.

        Without more, for single samples, a call takes a tenth of the time, and other threads
        wait for it.
        """
        passed = [each(value) for each, value in zip(self._passed, first, strict=False)]
        rest = self._passed[len(first):]
        # A function object of its own: types of results are attributes of it.
        native: Any = _library(ctypes.CDLL if rest else ctypes.PyDLL)[self.name]
        native.restype = self._returns
        call: Any = partial(_call, native, passed, rest) if rest else partial(native, *passed)
        call.arrays = first  # their memory must live as long as the call
        return cast('Callable[..., Any]', call)


def _call(native: Any, passed: list[Any], rest: list[Callable[[Any], Any]], *others: Any) -> Any:
    return native(*passed, *[each(value) for each, value in zip(rest, others, strict=True)])


@cache
def _library(kind: type[ctypes.CDLL]) -> ctypes.CDLL:
    path = _FOLDER / 'library.so'
    try:
        return kind(str(path))
    except OSError as exc:
        raise ImportError(f'{path}: {exc}: not built for this system: install the package with '
                          'pip, or build it with colcon or make') from exc


@cache
def function(name: str) -> Function:
    """Return a function of the library; KeyError if its headers do not declare it."""
    return Function(name)
