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
YAML files as ROS reads them: plain scalars have the type that rcl, ROS's own reader, gives them.

PyYAML's safe loader follows YAML 1.1, rcl does not: for rcl ``1e3`` is a double, ``y`` a bool,
``1_000``, ``1:30`` and ``2020-01-01`` are texts.
"""

from __future__ import annotations

import math
from pathlib import Path
import re
import stat
from typing import Any

from stewart_dynamics.errors import one_line, ParameterError, shown, shown_name
import yaml  # type: ignore[import-untyped]

# The file of a hexapod has 4 kB, that of a whole robot rarely more than 50. rcl needs at most 2 s
# for a file of this size, but a minute for one list of 500 kB, whichever node it is for.
LARGEST = 100_000  # [bytes]
_DEEPEST = 20


class _Blank(str):
    """A text of length 0."""


BLANK = _Blank()
"""The value of a name without a value, which rcl rejects."""

_SafeLoader: Any = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)

_TRUE = frozenset('Y y yes Yes YES true True TRUE on On ON'.split())
_FALSE = frozenset('N n no No NO false False FALSE off Off OFF'.split())
NULL = ('~', 'null', 'Null', 'NULL')
"""For rcl these are texts; here they stand for no value."""
_NUMBER = re.compile(
    r'[+-]?((?P<octal>0[0-7]{1,20})|(?P<decimal>0|[1-9][0-9]{0,18})'
    r'|(?P<hexadecimal>0x[0-9a-f]{1,15})|(?P<special>\.?inf|infinity|\.?nan)'
    r'|([0-9]+(\.[0-9]*)?|\.[0-9]+)(e[+-]?[0-9]+)?)',
    re.ASCII | re.IGNORECASE)
_BASES = {'octal': 8, 'decimal': 10, 'hexadecimal': 16}
_SMALLEST = 2.0 ** -1022

_TEXT = 'tag:yaml.org,2002:str'
_LIST = 'tag:yaml.org,2002:seq'
_TUPLE = 'tag:yaml.org,2002:python/tuple'  # as launch_ros writes a list
_GROUP = 'tag:yaml.org,2002:map'
_PLAIN = 'plain'  # a scalar without quotes
_NO_SPACE = re.compile(r'\s*(- )?(?P<name>[A-Za-z_/*][\w./*]*):[^\s:][^:]*')


def scalar(text: str) -> Any:
    """
    Return the value that ROS reads from a text without quotes: bool, int, float or str.

    None for ``null`` and ``~``, which are texts for rcl: the value is not given.
    """
    if text in NULL:
        return None
    if text in _TRUE or text in _FALSE:
        return text in _TRUE
    found = _NUMBER.fullmatch(text)
    if not found:
        return text
    for kind, base in _BASES.items():
        if found[kind]:
            return int(text, base)
    number = float(text.replace('.', '') if found['special'] else text)
    # For rcl a number out of range is a text.
    in_range = found['special'] or number == 0.0 or _SMALLEST <= abs(number) < math.inf
    return number if in_range else text


def read_document(path: str | Path, largest: int = LARGEST) -> dict[str, Any]:
    """
    Return the content of a YAML file of at most ``largest`` bytes, a mapping by names.

    Raises
    ------
    ParameterError
        In one line: the file cannot be read, is not YAML, or has what rcl rejects or reads
        differently from YAML (aliases, tags, a second document), a name given twice, or nesting
        deeper than 20.

    """
    document = _read(_bytes_of(path, largest), str(path))
    if not isinstance(document, dict):
        raise ParameterError(f"{path}: must begin with '/**:' or a node's name")
    return document


def read_value(text: str, source: str) -> Any:
    """Return the value that ROS reads from a text, as on a command line."""
    return _read(text.encode('utf-8', 'surrogateescape'), source)


class _Loader(_SafeLoader):  # type: ignore[misc]
    """The safe loader, without the types that YAML 1.1 gives plain scalars."""

    yaml_implicit_resolvers = {None: [(_PLAIN, re.compile('(?!$)', re.DOTALL))]}


def _read(data: bytes, source: str) -> Any:
    try:
        depth = 0
        for event in yaml.parse(data, Loader=_SafeLoader):  # its recursion is unbounded
            if isinstance(event, yaml.AliasEvent):
                raise _wrong(event, 'has a YAML alias (*): write the value out')
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > _DEEPEST:
                raise _wrong(event, f'nests deeper than {_DEEPEST}')
        node = yaml.compose(data, Loader=_Loader)
        return None if node is None else _value(node)
    except yaml.YAMLError as exc:
        raise ParameterError(f'{source}: not YAML: {_in_words(exc, data)}') from exc


def _value(node: Any) -> Any:
    """Return the value of a node of the document."""
    if isinstance(node, yaml.ScalarNode) and node.tag == _TEXT:
        return node.value if node.value or node.style else BLANK
    if isinstance(node, yaml.ScalarNode) and node.tag == _PLAIN:
        return scalar(node.value)
    if isinstance(node, yaml.SequenceNode) and node.tag in (_LIST, _TUPLE):
        return [_value(each) for each in node.value]
    if not isinstance(node, yaml.MappingNode) or node.tag != _GROUP:
        raise _wrong(node, f'a tag, {shown(node.tag)}: ROS ignores it, write the value without')
    found: dict[str, Any] = {}
    for key, value in node.value:
        if not isinstance(key, yaml.ScalarNode):
            raise _wrong(key, 'a list or a group in place of a name')
        if key.value in found:
            raise _wrong(key, f'duplicate key {shown(key.value)}')
        found[key.value] = _value(value)
    return found


def _wrong(where: Any, what: str) -> Exception:
    error: Exception = yaml.MarkedYAMLError(problem=what, problem_mark=where.start_mark)
    return error


def _bytes_of(path: str | Path, largest: int) -> bytes:
    """Return the bytes of a regular file of UTF-8 text; a pipe is rejected without waiting."""
    try:
        mode = Path(path).stat().st_mode
        if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
            raise OSError(0, 'not a regular file')
        with open(path, 'rb') as file:
            data = file.read(largest + 1)
        data[:largest].decode('utf-8')
    except OSError as exc:
        raise ParameterError(f'{path}: cannot be read: {exc.strerror}') from exc
    except UnicodeDecodeError as exc:
        if exc.end < largest:
            raise ParameterError(f'{path}: cannot be read: not UTF-8 text') from exc
    except (TypeError, ValueError) as exc:
        raise ParameterError(f'{shown(str(path))}: cannot be read: {exc}') from exc
    if len(data) > largest:
        raise ParameterError(f'{path}: larger than {largest} bytes')
    return data


def _in_words(exc: Any, data: bytes) -> str:
    """Return where and why a text is not YAML, with a likely correction."""
    mark = getattr(exc, 'problem_mark', None)
    if mark is None:  # an invalid character, with its position in bytes
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
    problem = one_line(exc.problem)
    if problem.startswith('but '):
        problem = f'{one_line(exc.context)}, {problem}'
    return f'line {mark.line + 1}, column {mark.column + 1}: {problem}{hint}'


def no_space(text: str) -> str:
    """Return the text that a space is missing after a colon; empty if it is not."""
    found = _NO_SPACE.match(text)
    if not found:
        return ''
    return f'a space is missing after the colon of {shown_name(found["name"])}'
