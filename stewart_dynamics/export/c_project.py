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

"""The files of an exported hexapod: C source, the hexapod, golden vectors with a test, CMake."""

from __future__ import annotations

from importlib.resources import files
import math
import re

from stewart_dynamics import __version__
from stewart_dynamics.errors import shown, StewartError
from stewart_dynamics.export.golden_vectors import COLUMNS, golden_vectors, PARTS
from stewart_dynamics.export.hexapod_source import digest, hexadecimal, platform_source
from stewart_dynamics.parameters.table import Parameters

SOURCES = 'stewart_dynamics.h', 'stewart_dynamics.c'
"""Files that are the same for every hexapod."""

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
    """Return the text of a file in this package's folder ``c``."""
    return files(__package__).joinpath('c', file).read_text(encoding='utf-8')


def c_project(parameters: Parameters, name: str) -> dict[str, str]:
    """
    Return the texts of all files by their names.

    Raises
    ------
    StewartError
        The name cannot be used in C; a limit of joint angles is set, its axes are not, and there
        is no home pose; or plates limit the clearance of the legs.

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

    csv = '\n'.join([','.join(COLUMNS), *(','.join(map(repr, row)) for row in rows), ''])
    return {**{each: source(each) for each in SOURCES}, f'{name}.h': filled('hexapod.h'),
            f'{name}.c': filled('hexapod.c'), 'golden.csv': csv,
            'test_golden.c': filled('test_golden.c'), 'CMakeLists.txt': filled('CMakeLists.txt')}
