# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The files of an exported hexapod: C source, the hexapod, golden vectors with a test, CMake."""

from __future__ import annotations

from collections.abc import Iterator
import hashlib
from importlib.resources import files
import math
import re
from typing import Any

import numpy as np

from stewart_dynamics import __version__
from stewart_dynamics.core.binding import header
from stewart_dynamics.errors import ParameterError, shown, StewartError
from stewart_dynamics.export.golden_vectors import COLUMNS, golden_vectors, PARTS, WHOLE
from stewart_dynamics.mechanics.hexapod_structure import (
    field_values, FIELDS_AFTER_LEGS, FIELDS_BEFORE_LEGS, LEG_FIELDS)
from stewart_dynamics.mechanics.kinematics.joint_angles import angles_to_check
from stewart_dynamics.mechanics.limits import Limits
from stewart_dynamics.parameters.table import OUTLINES, PARAMETERS, Parameters

SOURCES = 'stewart_dynamics.h', 'stewart_dynamics.c'  # files that are the same for every hexapod

_KEYWORDS = frozenset("""
alignas alignof and and_eq asm auto bitand bitor bool break case catch char char16_t char32_t class
compl const const_cast constexpr continue decltype default delete do double dynamic_cast else enum
explicit export extern false float for friend goto if inline int long mutable namespace new
noexcept not not_eq nullptr operator or or_eq private protected public register reinterpret_cast
restrict return short signed sizeof static static_assert static_cast struct switch template this
thread_local throw true try typedef typeid typename union unsigned using virtual void volatile
wchar_t while xor xor_eq""".split())
# Targets of CMake, names in test_golden.c, functions of math.h, and macros of C and of compilers.
_TAKEN = frozenset(['all', 'clean', 'compare', 'eof', 'golden', 'help', 'huge_val', 'infinity',
                    'install', 'linux', 'main', 'null', 'package', 'printf', 'stderr', 'stdin',
                    'stdout', 'test', 'test_golden', 'unix', *vars(math)])
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
        return header(file)
    return files(__package__).joinpath('c', file).read_text(encoding='utf-8')


def c_project(parameters: Parameters, name: str) -> dict[str, str]:
    """
    Return the texts of all files by their names.

    Raises StewartError: the name cannot be used in C; a limit of joint angles is set, its axes are
        not, and there is no home pose; or plates limit the clearance of the legs.
    """
    check_name(name)
    head = (f'A hexapod, written by stewart_export {__version__}.\n'
            f' * SHA-256 of its parameters: {digest(parameters)}')
    rows = golden_vectors(parameters).tolist()
    begins = [COLUMNS.index(names[0]) for names in PARTS.values()]
    texts = {
        '@HEAD@': head, '@NAME@': name, '@PLATFORM@': platform_source(parameters, name),
        '@PARTS@': ',\n  '.join(f'{part} = {begin}'
                                for part, begin in zip(PARTS, begins, strict=True)),
        '@COLUMNS@': str(len(COLUMNS)),
        '@VECTORS@': ',\n'.join(f'  {{{", ".join(map(hexadecimal, row))}}}' for row in rows)}

    def filled(file: str) -> str:
        return re.sub('@[A-Z]+@', lambda found: texts[found[0]], source(f'{file}.in'))

    csv = '\n'.join([','.join(COLUMNS), *(','.join(
        repr(int(value) if column in WHOLE else value)
        for column, value in zip(COLUMNS, row, strict=True)) for row in rows), ''])
    return {**{each: source(each) for each in SOURCES}, f'{name}.h': filled('hexapod.h'),
            f'{name}.c': filled('hexapod.c'), 'golden.csv': csv,
            'test_golden.c': filled('test_golden.c'), 'CMakeLists.txt': filled('CMakeLists.txt')}


def exported_values(parameters: Parameters) -> dict[str, Any]:
    """
    Return ``field_values`` with the axes of the joints whose angles are limited.

    Raises ParameterError: axes that are needed are not given, and there is no home pose; or the
        clearance of the legs is limited, and a plate is given, which the C source does not know.
    """
    plates = [name for name in OUTLINES if parameters[name] is not None]
    if plates and parameters.limits.leg_clearance_min is not None:
        raise ParameterError(
            f'{", ".join(plates)}: must not be set with limits.leg_clearance_min: the exported '
            'source has the clearance between legs, not that from plates')
    values = field_values(parameters)
    angles = angles_to_check(parameters, Limits(parameters).of_joints)
    if angles is not None:
        axes = np.nan_to_num(angles.axes)
        values['geometry.base_joint_axes'] = axes[:6]
        values['geometry.platform_joint_axes'] = axes[6:]
    return values


def digest(parameters: Parameters) -> str:
    """Return the SHA-256 of the values of all fields, in hexadecimal digits."""
    text = '\n'.join(f'{name} {" ".join(_numbers(value))}'
                     for name, value in exported_values(parameters).items())
    return hashlib.sha256(text.encode()).hexdigest()


def platform_source(parameters: Parameters, name: str) -> str:
    """Return the C definition of a hexapod, ``const stewart_platform NAME``."""
    values = exported_values(parameters)
    lines = [f'const stewart_platform {name} = {{']
    lines += (_field(each, values[each], '  ') for each in FIELDS_BEFORE_LEGS.values())
    lines.append('  {')
    for leg, joint in enumerate(parameters.joints):
        lines.append(f'    {{  /* leg {leg + 1}: {in_comment(joint)} */')
        lines += (_field(each, values[each][leg], '      ') for each in LEG_FIELDS.values())
        lines.append('    },')
    lines.append('  },')
    lines += (_field(each, values[each], '  ') for each in FIELDS_AFTER_LEGS.values())
    return '\n'.join([*lines, '};', ''])


def in_comment(text: str) -> str:
    """Return a printable text as it may stand in a comment of C."""
    plain = text.encode('ascii', 'backslashreplace').decode()
    return plain.replace('*', ' ').replace('??', '? ?')


def _field(name: str, value: Any, indent: str) -> str:
    numbers = ', '.join(_numbers(value))
    text = f'{{{numbers}}}' if np.ndim(value) else numbers
    unit = PARAMETERS[name].unit
    decimal = ', '.join(f'{each:.9g}' for each in np.ravel(value))
    return f'{indent}{text},  /* {name}: {decimal}{unit and f" {unit}"} */'


def hexadecimal(number: float) -> str:
    """Return a number as a constant of C with all its bits."""
    if math.isinf(number):
        return 'HUGE_VAL' if number > 0.0 else '-HUGE_VAL'
    return str(number) if isinstance(number, int) else number.hex()


def _numbers(value: Any) -> Iterator[str]:
    return map(hexadecimal, np.ravel(value).tolist())
