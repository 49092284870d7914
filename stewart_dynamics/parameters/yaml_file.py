# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
YAML files as ROS reads them, and the sections in them that hold a node's parameters.

``/**:``, or a node's name with its namespaces, then ``ros__parameters:``, then the parameters,
dotted or in groups. Plain scalars have the type that rcl, ROS's own reader, gives them: PyYAML's
safe loader follows YAML 1.1, but for rcl ``1e3`` is a double, ``y`` a bool, and ``1_000``,
``1:30`` and ``2020-01-01`` are texts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import takewhile
from pathlib import Path
import re
from textwrap import wrap
from typing import Any

from stewart_dynamics.errors import one_line, ParameterError, shown, shown_name
from stewart_dynamics.whole_file import read_text, write_files
import yaml  # type: ignore[import-untyped]

LARGEST = 100_000  # size of the largest file that is read [bytes]
_DEEPEST = 20


class _Blank(str):
    """A text of length 0."""


BLANK = _Blank()  # the value of a name without a value, which rcl rejects

_TRUE = frozenset('Y y yes Yes YES true True TRUE on On ON'.split())
_FALSE = frozenset('N n no No NO false False FALSE off Off OFF'.split())
_NULL = frozenset(['~', 'null', 'Null', 'NULL'])
_INTEGER = re.compile('[+-]?[0-9]{1,19}', re.ASCII)
_DOUBLE = re.compile(
    r'[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)(e[+-]?[0-9]+)?|[+-]?\.?(inf|nan)|[+-]?infinity',
    re.ASCII | re.IGNORECASE)

# Tags without effect; launch_ros writes a list as a tuple.
_TAGS = {kind: (None, '!', *(f'tag:yaml.org,2002:{tag}' for tag in tags)) for kind, tags in (
    (yaml.ScalarEvent, ['str']), (yaml.SequenceStartEvent, ['seq', 'python/tuple']),
    (yaml.MappingStartEvent, ['map']))}
_NO_SPACE = re.compile(r'\s*(- )?(?P<name>[A-Za-z_/*][\w./*]*):[^\s:][^:]*')

OF_ROS = ('use_sim_time', 'start_type_description_service')
OF_ROS_PREFIX = 'qos_overrides.'

_NAME = re.compile('[A-Za-z_][A-Za-z0-9_]*')
_LONGEST_ROW = 6
_ROW = 3  # numbers in each row of a longer list: x y z
_COLUMNS = 99  # a comment that would make a line longer stands above it
_LISTED = 9


def scalar(text: str) -> Any:
    """
    Return the value that ROS reads from a text without quotes: bool, int, float or str.

    None for ``null`` and ``~``, which are texts for rcl: the value is not given. Integers, which
    no parameter of the package is, are decimal here, for rcl also octal and hexadecimal.
    """
    if text in _NULL:
        return None
    if text in _TRUE or text in _FALSE:
        return text in _TRUE
    if _INTEGER.fullmatch(text):
        return int(text)
    if _DOUBLE.fullmatch(text):
        return float(re.sub(r'\.(?=[in])', '', text, flags=re.IGNORECASE))
    return text


def read_document(path: str | Path, largest: int = LARGEST) -> dict[str, Any]:
    """
    Return the content of a YAML file of at most ``largest`` bytes, a mapping by names.

    Raises ParameterError if the file cannot be read, is not YAML, or has what rcl rejects or reads
    differently from YAML (aliases, tags, a second document), a name given twice, or nesting deeper
    than 20.
    """
    document = read_value(read_text(path, largest, ParameterError), str(path))
    if not isinstance(document, dict):
        raise ParameterError(f"{path}: must begin with '/**:' or a node's name")
    return document


def read_value(text: str, source: str) -> Any:
    """Return the value that ROS reads from a text, as on a command line."""
    data = text.encode('utf-8', 'surrogateescape')
    try:
        # By events: yaml.compose recurses without bound, and yaml.load follows YAML 1.1.
        events = yaml.parse(data, Loader=getattr(yaml, 'CSafeLoader', yaml.SafeLoader))
        next(events)  # the stream begins
        if isinstance(next(events), yaml.StreamEndEvent):
            return None
        value = _value(next(events), events)
        next(events)  # the document ends
        following = next(events)
        if not isinstance(following, yaml.StreamEndEvent):
            raise _wrong(following, 'expected a single document in the stream, but found another')
    except yaml.YAMLError as exc:
        raise ParameterError(f'{source}: not YAML: {_reason(exc, data)}') from exc
    return value


def _value(event: Any, events: Iterator[Any], depth: int = 1) -> Any:
    """Return the value that begins with an event; takes the other events of it."""
    if isinstance(event, yaml.AliasEvent):
        raise _wrong(event, 'has a YAML alias (*): write the value out')
    if isinstance(event, yaml.CollectionStartEvent) and depth > _DEEPEST:
        raise _wrong(event, f'nests deeper than {_DEEPEST}')
    if event.tag not in _TAGS[type(event)]:
        raise _wrong(event, f'a tag, {shown(event.tag)}: ROS ignores it, write the value without')
    if isinstance(event, yaml.ScalarEvent):
        if not event.value and not event.style:
            return BLANK
        return scalar(event.value) if event.implicit[0] else event.value
    inside = takewhile(lambda each: not isinstance(each, yaml.CollectionEndEvent), events)
    if isinstance(event, yaml.SequenceStartEvent):
        return [_value(each, events, depth + 1) for each in inside]
    found: dict[str, Any] = {}
    for key in inside:
        if not isinstance(key, yaml.ScalarEvent):
            raise _wrong(key, 'a list, a group or an alias in place of a name')
        if key.value in found:
            raise _wrong(key, f'duplicate key {shown(key.value)}')
        found[key.value] = _value(next(events), events, depth + 1)
    return found


def _wrong(where: Any, what: str) -> Exception:
    error: Exception = yaml.MarkedYAMLError(problem=what, problem_mark=where.start_mark)
    return error


def _reason(exc: Any, data: bytes) -> str:
    """Return where and why a text is not YAML, with a likely correction."""
    mark = getattr(exc, 'problem_mark', None)
    if mark is None:  # an invalid character, with its position in bytes
        line = data.count(b'\n', 0, getattr(exc, 'position', 0)) + 1
        return f'line {line}: {one_line(getattr(exc, "reason", exc))}'
    lines = data.decode('utf-8', 'replace').splitlines()
    context = getattr(exc, 'context_mark', None) or mark
    hint = ''
    for number in (context.line, mark.line - 1, mark.line):
        text = lines[number] if 0 <= number < len(lines) else ''
        if '\t' in text[:len(text) - len(text.lstrip())]:
            hint = f'; line {number + 1} is indented with a tab: use spaces'
        elif missing := no_space(text):
            hint = f'; line {number + 1}: {missing}'
        if hint:
            break
    problem = one_line(exc.problem)
    if problem.startswith('but '):
        problem = f'{one_line(exc.context)}, {problem}'
    return f'line {mark.line + 1}, column {mark.column + 1}: {problem}{hint}'


def no_space(text: str) -> str:
    """Return the remark that a space is missing after a colon; empty if it is not."""
    found = _NO_SPACE.match(text)
    return f'a space is missing after the colon of {shown_name(found["name"])}' if found else ''


# Sections

def is_of_ros(name: str) -> bool:
    """Return whether a parameter of this name is one that ROS itself declares in nodes."""
    return name in OF_ROS or name.startswith(OF_ROS_PREFIX)


def read_yaml(path: str | Path, node: str) -> dict[str, Any]:
    """
    Return the values of a ROS parameter file for a node, under dotted names.

    Sections apply in the order of the file; a later one overrides an earlier one, as in ROS.
    Raises ParameterError if the file breaks a rule, or holds no parameters for the node.
    """
    document = read_document(path)
    values = dict(parameters_of(document, node, str(path)))
    if not values:
        raise _without_parameters(path, document, node)
    return values


def check_sections(path: str | Path, document: Mapping[str, Any], node: str) -> None:
    """Raise ParameterError where a file has no parameters of any node: rcl rejects it."""
    if document and not any(_all_sections(document)):
        raise _without_parameters(path, document, node)


def _without_parameters(
        path: str | Path, document: Mapping[str, Any], node: str) -> ParameterError:
    return ParameterError(f"{path}: holds {_listed(document)}, but no parameters under '/**:' or "
                          f"'{node}:', 'ros__parameters:'")


def other_nodes(path: str | Path, node: str) -> str:
    """List the sections of a file without a section for the node; else return an empty text."""
    names = [section for section, _ in _all_sections(read_document(path))]
    return '' if any(_is_meant(name, node) for name in names) else _listed(names)


def _listed(names: Iterable[Any]) -> str:
    shown_names = [shown_name(name) for name in names]
    return ', '.join(shown_names[:_LISTED] + ['...'] * (len(shown_names) > _LISTED))


def parameters_of(document: Mapping[str, Any], node: str, source: str,
                  ) -> Iterator[tuple[str, Any]]:
    """
    Yield the names and values of a document for a node, in their order.

    Sections of other nodes are checked as well: rcl reads all of them, and may read them otherwise
    than intended.
    """
    for name, content in document.items():
        sections = list(_sections(name, content))
        if not sections and _is_meant(name, node):
            raise ParameterError(f"{source}: {shown_name(name)}: must hold 'ros__parameters:'")
        for section, parameters in sections:
            is_meant = _is_meant(section, node)
            seen = set()
            for parameter, value in flat(parameters, '', source):
                if parameter in seen:
                    raise ParameterError(
                        f'{source}: {shown_name(parameter)}: given twice under '
                        f'{shown_name(section)}')
                seen.add(parameter)
                if is_meant:
                    check_given(parameter, value, source)
                    if not is_of_ros(parameter):
                        yield parameter, value


def _all_sections(document: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    for name, content in document.items():
        yield from _sections(name, content)


def _sections(name: str, content: Any) -> Iterator[tuple[str, Any]]:
    """Yield names of nodes with their namespaces, and the content of ros__parameters."""
    if not isinstance(content, dict):
        return
    for key, value in content.items():
        if key == 'ros__parameters':
            yield name, {} if value is None or value is BLANK else value
        else:
            yield from _sections(f'{name}/{key}', value)


def _is_meant(section: str, node: str) -> bool:
    """Return whether a section is for a node; in it /* matches one part of a name, /** any."""
    pattern = re.escape(f'/{section.removeprefix("/")}')
    pattern = re.sub(r'(/\\\*\\\*)+', r'(/\\w+)*', pattern).replace(r'/\*', r'/\w+')
    return re.fullmatch(pattern, f'/{node.strip("/")}') is not None


def flat(tree: Any, prefix: str, source: str) -> Iterator[tuple[str, Any]]:
    """Yield dotted names and values of groups within groups."""
    if not isinstance(tree, dict):
        name = prefix or 'ros__parameters'
        raise ParameterError(
            f'{source}: {shown_name(name)}: {shown(tree)}: must hold names and values')
    for key, value in tree.items():
        name = f'{prefix}{key}'
        if isinstance(value, dict):
            yield from flat(value, f'{name}.', source)
            continue
        if isinstance(value, list) and any(isinstance(each, list | dict) for each in value):
            raise ParameterError(
                f'{source}: {shown_name(name)}: {shown(value)}: has a list or a group in the '
                'list: write the numbers one after the other, [x1, y1, z1, x2, y2, z2]')
        yield name, value


def check_given(name: str, value: Any, source: str) -> None:
    """Raise ParameterError for a value that rcl does not accept, with a likely correction."""
    given = f'{source}: {shown_name(name)}'
    if value == []:
        raise ParameterError(f'{given}: []: ROS accepts no empty list: leave the name out')
    if value is BLANK:
        missing = no_space(name)  # {mass:0.5}
        raise ParameterError(f'{given}: has no value' + (f'; {missing}' if missing else ''))
    # ROS ignores a value of another type: the node would not use simulated time.
    if name in OF_ROS and not isinstance(value, bool):
        raise ParameterError(f'{given}: {shown(value)}: must be a bool')


# Writing

def write_yaml(path: str | Path, values: Mapping[str, Any], comments: Mapping[str, str],
               head: str = '') -> None:
    """
    Write a ROS parameter file for any node, complete or not at all; replaces an existing one.

    Values are texts, doubles, bools, or tuples of them, by dotted names; a tuple of length 1 is
    written as a single value. Comments stand behind the values, long ones above them, ``head``
    before all lines. Raises ParameterError if the file cannot be written.
    """
    try:
        write_files({Path(path): yaml_text(values, comments, head).encode('utf-8')})
    except (OSError, TypeError, ValueError) as exc:
        reason = exc.strerror if isinstance(exc, OSError) else exc
        raise ParameterError(f'{one_line(path)}: cannot be written: {reason}') from exc


def yaml_text(values: Mapping[str, Any], comments: Mapping[str, str], head: str = '') -> str:
    """Return the text that ``write_yaml`` writes."""
    tree: dict[str, Any] = {}
    for name, value in values.items():
        *groups, last = name.split('.')
        group = tree
        for each in groups:
            group = group.setdefault(each, {})
        group[last] = value, comments[name]
    lines = ['/**:', '  ros__parameters:', *_lines(tree, '    ')]
    return head + '\n'.join([*lines, ''])


def _lines(tree: Mapping[str, Any], indent: str) -> Iterator[str]:
    """Yield the lines of a group."""
    for name, content in tree.items():
        if isinstance(content, dict):
            yield f'{indent}{name}:'
            yield from _lines(content, f'{indent}  ')
            continue
        value, text = content
        entries = [_written(each) for each in (value if isinstance(value, tuple) else (value,))]
        rest: list[str] = []
        if len(entries) == 1:
            first = f'{indent}{name}: {entries[0]}'
        elif len(entries) <= _LONGEST_ROW:
            first = f'{indent}{name}: [{", ".join(entries)}]'
        else:
            first = f'{indent}{name}: ['
            for n in range(0, len(entries), _ROW):
                end = ']' if n + _ROW >= len(entries) else ','
                rest.append(f'{indent}  {", ".join(entries[n:n + _ROW])}{end}')
        if text and len(commented := f'{first}  # {text}') <= _COLUMNS:
            first = commented
        elif text:
            yield from wrap(text, _COLUMNS, initial_indent=f'{indent}# ',
                            subsequent_indent=f'{indent}# ', break_on_hyphens=False)
        yield first
        yield from rest


def _written(value: Any) -> str:
    """Return a value as YAML with the same meaning to rcl and to YAML 1.1."""
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, float):
        text = repr(value)
        return text if '.' in text else text.replace('e', '.0e')
    if _NAME.fullmatch(value) and scalar(value) == value:
        return str(value)
    quoted = value.replace("'", "''")
    return f"'{quoted}'"
