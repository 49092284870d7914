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


"""
YAML files as ROS reads them, and nothing in them that could harm its reader or ours.

ROS's own reader (rcl) is built on libyaml, as this one is, so both see the same names and
texts. What a text means is rcl's rule, not that of YAML: ``on`` is true, ``1e3`` a double,
``010`` the integer eight, ``2020-01-01`` a text.
"""

from __future__ import annotations

import math
from pathlib import Path
import re
import stat
from typing import Any

import yaml  # type: ignore[import-untyped]

from stewart_dynamics.errors import one_line, ParameterError

_LARGEST = 1_000_000  # [bytes]; a second's work
_DEEPEST = 20

_TRUE = frozenset('Y y yes Yes YES true True TRUE on On ON'.split())
_FALSE = frozenset('N n no No NO false False FALSE off Off OFF'.split())
_NONE = frozenset(('', '~', 'null', 'Null', 'NULL'))

# What strtoll with base 0 and strtod take.
_INTEGER = re.compile(r'\s*[+-]?(0[xX][0-9a-fA-F]+|[0-9]+)', re.ASCII)
_OCTAL = re.compile(r'\s*[+-]?0[0-7]+', re.ASCII)
_DECIMAL = re.compile(r'\s*[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?', re.ASCII)
_HEXADECIMAL = re.compile(
    r'\s*[+-]?0[xX]([0-9a-fA-F]+(\.[0-9a-fA-F]*)?|\.[0-9a-fA-F]+)([pP][+-]?[0-9]+)?', re.ASCII)
_NOT_FINITE = re.compile(
    r'\s*(?P<sign>[+-]?)(?P<what>inf|infinity|nan(\([0-9A-Za-z_]*\))?)', re.ASCII | re.IGNORECASE)
_DOTTED = re.compile(r'\.(nan|NaN|NAN)|(?P<sign>[+-]?)\.(inf|Inf|INF)')
_SMALLEST = 2.0 ** -1022

_NO_SPACE = re.compile(r'\s*(- )?(?P<name>[A-Za-z_/*][\w./*]*):(?P<value>[^\s:][^:]*)')

# libyaml compares each with all before it: a megabyte of them takes it seconds.
_TAG_DIRECTIVE = re.compile(rb'^%TAG|[\r\x85\xa8\xa9\xbf]%TAG', re.MULTILINE)

_STRING_TAG = 'tag:yaml.org,2002:str'


def value_of(text: str) -> Any:
    """
    Return what ROS takes a text without quotes for: bool, int, float or str; None for nothing.

    ROS takes ``~`` and ``null`` for texts: here they are nothing, as YAML has it.
    """
    if text in _NONE:
        return None
    if text in _TRUE or text in _FALSE:
        return text in _TRUE
    # Longer ones do not fit into 64 bits. (No number of leading zeros is of use to anybody.)
    if len(text) < 80 and _INTEGER.fullmatch(text):
        base = 8 if _OCTAL.fullmatch(text) else 16 if 'x' in text.lower() else 10
        if base != 10 or not re.match(r'\s*[+-]?0[0-9]', text):  # 08 is no octal: a double
            integer = int(text, base)
            if -2 ** 63 <= integer < 2 ** 63:
                return integer
    number = _double(text)
    return text if number is None else number


def _double(text: str) -> float | None:
    """Return the double that a text is for ROS, None where it takes it for a text."""
    if dotted := _DOTTED.fullmatch(text):
        return math.nan if dotted['sign'] is None else float(f'{dotted["sign"]}inf')
    if special := _NOT_FINITE.fullmatch(text):
        what = special['what'][:3].lower()
        return float(f'{special["sign"]}{what}')
    try:
        if _DECIMAL.fullmatch(text):
            number = float(text)
        elif _HEXADECIMAL.fullmatch(text):
            number = float.fromhex(text.strip())
        else:
            return None
    except OverflowError:
        return None
    # Out of range, strtod reports an error, and rcl falls back to a text.
    mantissa = re.split('[pP]' if 'x' in text.lower() else '[eE]', text.lower().replace(
        '0x', ''))[0]
    is_zero = not re.search('[1-9a-f]', mantissa)
    in_range = is_zero or _SMALLEST <= abs(number) < math.inf
    return number if in_range else None


def read_document(path: str | Path, largest: int = _LARGEST) -> dict[str, Any]:
    """
    Return what a YAML file of so many bytes at most holds, a mapping by names.

    Lists are lists, mappings dicts, and all else as ``value_of`` says. Raises ParameterError,
    in one line, for what is no such file, nests too deep, or has what ROS's reader does not
    take as YAML means it: aliases, tags, names given twice, a second document.
    """
    document = _read(_bytes_of(path, largest), str(path))
    if not isinstance(document, dict):
        raise ParameterError(f"{path}: must begin with '/**:' or a node's name")
    return document


def read_value(text: str, source: str) -> Any:
    """Return what ROS takes the text of one value for, as on a command line."""
    return _read(text.encode('utf-8', 'surrogateescape'), source)


def _read(data: bytes, source: str) -> Any:
    if tag := _TAG_DIRECTIVE.search(data):
        line = data.count(b'\n', 0, tag.start()) + 1
        raise ParameterError(f'{source}: not YAML: line {line}: a directive, %TAG: tags are not '
                             'taken')
    try:
        return _Builder(source).build(data)
    except yaml.YAMLError as exc:
        raise ParameterError(f'{source}: not YAML: {_in_words(exc, data)}') from exc


def _bytes_of(path: str | Path, largest: int) -> bytes:
    """Return a file's bytes; what is no file of UTF-8 text is not waited for."""
    try:
        mode = Path(path).stat().st_mode
        if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
            raise ParameterError(f'{path}: cannot be read: not a regular file')
        with open(path, 'rb') as file:
            data = file.read(largest + 1)
        if len(data) > largest:
            raise ParameterError(f'{path}: larger than {largest} bytes')
        data.decode('utf-8')
    except OSError as exc:
        raise ParameterError(f'{path}: cannot be read: {exc.strerror}') from exc
    except UnicodeDecodeError as exc:
        raise ParameterError(f'{path}: cannot be read: not UTF-8 text') from exc
    except ValueError as exc:
        raise ParameterError(f'{str(path)!r}: cannot be read: {exc}') from exc
    return data


class _Builder:
    """Makes a document of libyaml's events, and refuses the first that it must not hold."""

    def __init__(self, source: str) -> None:
        self._source = source
        self._root: Any = None
        self._open: list[Any] = []
        self._keys: list[str | None] = []  # of each open mapping, its key that waits for a value

    def build(self, data: bytes) -> Any:
        documents = 0
        for event in yaml.parse(data, Loader=yaml.CSafeLoader):
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    raise self._refused(event, 'a second document (---): one is all that ROS '
                                        'reads as it is meant')
            elif isinstance(event, yaml.AliasEvent):
                raise ParameterError(f'{self._source}: line {_line(event)}: has a YAML alias (*): '
                                     'write the value out')
            elif isinstance(event, yaml.ScalarEvent):
                self._add(event, self._scalar(event))
            elif isinstance(event, yaml.SequenceStartEvent | yaml.MappingStartEvent):
                self._begin(event)
            elif isinstance(event, yaml.SequenceEndEvent | yaml.MappingEndEvent):
                self._open.pop()
                self._keys.pop()
        return self._root

    def _begin(self, event: Any) -> None:
        if event.tag is not None:
            raise self._refused(event, f'a tag, {_cut(event.tag)}: ROS ignores it, write the '
                                'value without')
        if self._is_key():
            raise self._refused(event, 'a list or a group for a name')
        if len(self._open) == _DEEPEST:
            raise self._refused(event, f'nests deeper than {_DEEPEST}')
        container: Any = [] if isinstance(event, yaml.SequenceStartEvent) else {}
        self._add(event, container)
        self._open.append(container)
        self._keys.append(None)

    def _is_key(self) -> bool:
        return bool(self._open) and isinstance(self._open[-1], dict) and self._keys[-1] is None

    def _scalar(self, event: Any) -> Any:
        if event.tag not in (None, _STRING_TAG):
            raise self._refused(event, f'a tag, {_cut(event.tag)}: ROS ignores it, write the '
                                'value without')
        if '\0' in event.value:
            raise self._refused(event, 'a text with a zero byte: ROS would end it there')
        is_text = event.tag == _STRING_TAG or event.style in ('"', "'") or self._is_key()
        return event.value if is_text else value_of(event.value)

    def _add(self, event: Any, value: Any) -> None:
        if not self._open:
            self._root = value
        elif isinstance(self._open[-1], list):
            self._open[-1].append(value)
        elif (key := self._keys[-1]) is None:
            if value in self._open[-1]:
                raise self._refused(event, f'duplicate key {_cut(value)}')
            self._keys[-1] = value
        else:
            self._open[-1][key] = value
            self._keys[-1] = None

    def _refused(self, event: Any, what: str) -> ParameterError:
        return ParameterError(f'{self._source}: not YAML: line {_line(event)}: {what}')


def _line(event: Any) -> int:
    return int(event.start_mark.line) + 1


def _cut(text: str) -> str:
    return f'{text!r}' if len(text) < 60 else f'{text[:60]!r}...'


def _in_words(exc: Any, data: bytes) -> str:
    """Return where a text is no YAML, why, and what is probably meant."""
    mark = getattr(exc, 'problem_mark', None)
    if mark is None:  # a character that no text may have, and its place in bytes
        line = data.count(b'\n', 0, getattr(exc, 'position', 0)) + 1
        return f'line {line}: {one_line(getattr(exc, "reason", exc))}'
    lines = data.decode('utf-8', 'replace').splitlines()
    context = getattr(exc, 'context_mark', None) or mark
    hint = ''
    for number in dict.fromkeys((context.line, mark.line - 1, mark.line)):
        text = lines[number] if 0 <= number < len(lines) else ''
        if '\t' in text[:len(text) - len(text.lstrip())]:
            hint = f'; line {number + 1} is indented with a tab: use spaces'
            break
        if missing := no_space(text):
            hint = f'; line {number + 1}: {missing}'
            break
    return f'line {mark.line + 1}, column {mark.column + 1}: {one_line(exc.problem)}{hint}'


def no_space(text: str) -> str:
    """Return in words that a space is missing after a text's colon, nothing where none is."""
    found = _NO_SPACE.match(text)
    if not found:
        return ''
    return f'a space is missing after the colon of {_cut(found["name"])[1:-1]}'
