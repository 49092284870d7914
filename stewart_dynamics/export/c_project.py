# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The files of an exported hexapod: C source, the hexapod, golden vectors with a test, CMake."""

from __future__ import annotations

import hashlib
from importlib.resources import files
import math
import re
from typing import Any

import numpy as np

from stewart_dynamics import __version__
from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.core.binding import header, places
from stewart_dynamics.errors import shown, StewartError
from stewart_dynamics.export.golden_vectors import (
    columns_of, golden_vectors, parts_of, RESULT_COLUMNS, result_columns, whole_columns)
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.mechanics.hexapod_structure import limited_structure
from stewart_dynamics.parameters.structure import LEG_FIELDS, LISTS, PLATFORM_FIELDS
from stewart_dynamics.parameters.table import PARAMETERS, Parameters

SOURCES = 'stewart_dynamics.h', 'stewart_dynamics.c'  # files that are the same for every hexapod

_KEYWORDS = frozenset("""
alignas alignof and and_eq asm auto bitand bitor bool break case catch char char16_t char32_t class
compl const const_cast constexpr continue decltype default delete do double dynamic_cast else enum
explicit export extern false float for friend goto if inline int long mutable namespace new
noexcept not not_eq nullptr operator or or_eq private protected public register reinterpret_cast
restrict return short signed sizeof static static_assert static_cast struct switch template this
thread_local throw true try typedef typeid typename union unsigned using virtual void volatile
wchar_t while xor xor_eq""".split())
# How far the golden vectors hold on another computer.
_BITS = 'bit for bit'
_DIGITS = ('but\n * for last digits, which depend on sin, cos and atan2 of its mathematical '
           'library')
_LAST_DIGITS = 1e-12  # musl differs from glibc by 2e-15
# Targets of CMake, names in test_golden.c, functions of math.h, and macros of C and of compilers.
_TAKEN = frozenset(['all', 'clean', 'compare', 'eof', 'golden', 'help', 'huge_val', 'infinity',
                    'install', 'linux', 'main', 'null', 'package', 'printf', 'stderr', 'stdin',
                    'stdout', 'test', 'test_golden', 'unix', *vars(math)])
_RESULT = places('stewart_result')
_LONGEST = 63  # significant characters of an identifier in C99


def check_name(name: str) -> str:
    """Return the name of a hexapod; StewartError if it cannot be the name of a constant in C."""
    if not re.fullmatch(f'[A-Za-z][A-Za-z0-9_]{{0,{_LONGEST - 1}}}', name):
        raise StewartError(f'{shown(name)}: must be a C identifier of at most {_LONGEST} '
                           'characters: letters, digits and _, a letter first')
    if name in _KEYWORDS or name.lower() in _TAKEN or name.lower().startswith('stewart_'):
        raise StewartError(f'{name}: a word of C, C++ or CMake, or a name in the exported files')
    return name


def source(file: str) -> str:
    """Return the text of a file of the library in C, or in this package's folder ``c``."""
    if file in SOURCES:
        return _in_one(header(file))
    return files(__package__).joinpath('c', file).read_text(encoding='utf-8')


def _in_one(text: str) -> str:
    """Return a source with the files of the kinds of legs in it, without the library's part."""
    def part(found: re.Match[str]) -> str:
        of_kind = header(found[1])
        return of_kind[of_kind.index('#ifndef STEWART_LIBRARY\n'):].partition(
            '\n#el')[0].partition('\n\n')[2]

    return re.sub(r'#include "((?!stewart_dynamics)\w+\.h)"\n', part, text)


def c_project(parameters: Parameters, name: str) -> dict[str, str]:
    """
    Return the texts of all files by their names.

    Raises StewartError: the name cannot be used in C; or a limit of joint angles is set, its axes
        are not, and there is no home pose.
    """
    check_name(name)
    head = (f'A hexapod, written by stewart_export {__version__}.\n'
            f' * SHA-256 of its parameters: {digest(parameters)}')
    kind = parameters.leg_kind
    rows, columns = golden_vectors(parameters).tolist(), columns_of(kind)
    parts, whole = parts_of(kind), whole_columns(kind)
    begins = [columns.index(names[0]) for names in parts.values()]
    texts = {
        '@HEAD@': head, '@NAME@': name, '@PLATFORM@': platform_source(parameters, name),
        '@PARTS@': ',\n  '.join(f'{part} = {begin}'
                                for part, begin in zip(parts, begins, strict=True)),
        '@COLUMNS@': str(len(columns)), '@MORE@': _comparisons(kind),
        '@POSITIONS@': _result(kind.position.columns.start),
        '@DEMANDED@': kind.effort.field, '@EFFORT@': kind.effort.name,
        '@EXACTNESS@': _BITS if kind.exact else _DIGITS,
        '@TOLERANCE@': '0.0' if kind.exact else f'{_LAST_DIGITS:g}',
        '@PUBLISHED@': kind.commands, '@PUBLISHEDPART@': kind.commands.upper(),
        '@VECTORS@': ',\n'.join(f'  {{{", ".join(map(hexadecimal, row))}}}' for row in rows)}

    def filled(file: str) -> str:
        return re.sub('@[A-Z]+@', lambda found: texts[found[0]], source(f'{file}.in'))

    csv = '\n'.join([','.join(columns), *(','.join(
        repr(int(value) if column in whole else value)
        for column, value in zip(columns, row, strict=True)) for row in rows), ''])
    return {**{each: source(each) for each in SOURCES}, f'{name}.h': filled('hexapod.h'),
            f'{name}.c': filled('hexapod.c'), 'golden.csv': csv,
            'test_golden.c': filled('test_golden.c'), 'CMakeLists.txt': filled('CMakeLists.txt')}


def _comparisons(kind: LegKind) -> str:
    """Return lines of test_golden.c for the results that hexapods of this kind alone have."""
    return ''.join(
        f'\n    differences += compare(\n      row, "{name}", output.result.{field}, '
        f'wanted + {_result(_RESULT[field].start)}, 6);'
        for name, field in ((name, RESULT_COLUMNS[name]) for name in result_columns(kind))
        if isinstance(_RESULT[field], slice) and _RESULT[field].start >= LegKind.width)


def _result(column: int) -> str:
    """Return where a column of the results begins in a vector, as an expression of C."""
    return f'RESULT + {column}' if column else 'RESULT'


def digest(parameters: Parameters) -> str:
    """Return the SHA-256 of the hexapod in C, in hexadecimal digits."""
    return hashlib.sha256(platform_source(parameters, '').encode()).hexdigest()


def platform_source(parameters: Parameters, name: str) -> str:
    """
    Return the C definition of a hexapod, ``const stewart_platform NAME``.

    Raises ParameterError: axes that are needed are not given, and there is no home pose.
    """
    hexapod: Any = limited_structure(parameters)
    fields = {**LEG_FIELDS, **parameters.leg_kind.fields}
    lines = [f'const stewart_platform {name} = {{']
    for field in hexapod.dtype.names:
        if field != 'legs':
            lines.append(_field(PLATFORM_FIELDS.get(field) or LISTS.get(field, field),
                                hexapod[field], '  '))
            continue
        lines.append('  {')
        for leg, joint in enumerate(parameters.joints):
            lines.append(f'    {{  /* leg {leg + 1}: {in_comment(joint)} */')
            of_leg = hexapod['legs'][leg]
            lines += (_field(fields.get(each, each), of_leg[each], '      ')
                      for each in of_leg.dtype.names)
            lines.append('    },')
        lines.append('  },')
    return '\n'.join([*lines, '};', ''])


def in_comment(text: str) -> str:
    """Return a printable text as it may stand in a comment of C."""
    plain = text.encode('ascii', 'backslashreplace').decode()
    return plain.replace('*', ' ').replace('??', '? ?')


def _field(name: str, value: Any, indent: str) -> str:
    """Return the line of a field: its numbers, then the parameter or field, values and unit."""
    unit = PARAMETERS[name].unit if name in PARAMETERS else ''
    decimal = ', '.join(f'{each:.9g}' for each in _without_end(np.ravel(value)))
    return f'{indent}{_constant(value)},  /* {name}: {decimal}{unit and f" {unit}"} */'


def _constant(value: Any) -> str:
    """Return a number, or an array of numbers in braces, as a constant of C."""
    if not np.ndim(value):
        return hexadecimal(value.item())
    rows = list(value) if np.ndim(value) == 1 else [
        row for row, used in zip(value, _used(value), strict=True) if used] or [value[0]]
    return f'{{{", ".join(map(_constant, rows))}}}'


def _used(points: Array) -> Flags:
    """Return which points (N, M) are given: all to the last that is not zero."""
    used: Flags = np.cumsum(np.any(points, axis=1)[::-1])[::-1] > 0
    return used


def _without_end(numbers: Array) -> Array:
    """Return the numbers to the last that is not zero, or the first one."""
    return numbers[:max(1, 1 + int(np.max(np.flatnonzero(numbers), initial=0)))]


def hexadecimal(number: float) -> str:
    """Return a number as a constant of C with all its bits."""
    if math.isnan(number):
        return 'NAN'
    if math.isinf(number):
        return 'HUGE_VAL' if number > 0.0 else '-HUGE_VAL'
    return str(number) if isinstance(number, int) else number.hex()
