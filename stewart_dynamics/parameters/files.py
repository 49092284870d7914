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
ROS parameter files: the sections that hold a node's parameters, read and written.

``/**:``, or a node's name with its namespaces, then ``ros__parameters:``, then the parameters,
dotted or in groups.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
import re
from typing import Any

from stewart_dynamics.errors import ParameterError, shown, shown_name
from stewart_dynamics.parameters.yaml_file import BLANK, no_space, read_document, scalar

# Parameters that ROS declares in every node.
_OF_ROS = ('use_sim_time', 'start_type_description_service')
_OF_ROS_PREFIX = 'qos_overrides.'

_NAME = re.compile('[A-Za-z_][A-Za-z0-9_]*')
_LONGEST_ROW = 6
_ROW = 3  # numbers in each row of a longer list: x y z


def is_of_ros(name: str) -> bool:
    """Return whether a parameter of this name is one that ROS itself declares in nodes."""
    return name in _OF_ROS or name.startswith(_OF_ROS_PREFIX)


def read_yaml(path: str | Path, node: str) -> dict[str, Any]:
    """
    Return the values of a ROS parameter file for a node, under dotted names.

    Sections apply in the order of the file; a later one overrides an earlier one, as in ROS.

    Raises
    ------
    ParameterError
        The file cannot be read, breaks a rule, or holds no parameters for the node.

    """
    document = read_document(path)
    values = dict(parameters_of(document, node, str(path)))
    if not values:
        raise _without_parameters(path, document, node)
    return values


def check_sections(path: str | Path, document: Mapping[str, Any], node: str) -> None:
    """Raise ParameterError where a file has no parameters of any node: rcl rejects it."""
    if document and not any(
            True for name, content in document.items() for _ in _sections(name, content)):
        raise _without_parameters(path, document, node)


def _without_parameters(
        path: str | Path, document: Mapping[str, Any], node: str) -> ParameterError:
    return ParameterError(f"{path}: holds {_listed(document)}, but no parameters under '/**:' or "
                          f"'{node}:', 'ros__parameters:'")


def other_nodes(path: str | Path, node: str) -> str:
    """Return the sections of a file as text if none is for the node; else an empty text."""
    document = read_document(path)
    names = [section for name, content in document.items()
             for section, _ in _sections(name, content)]
    return '' if any(_is_meant(name, node) for name in names) else _listed(names)


def _listed(names: Sequence[Any] | Mapping[str, Any]) -> str:
    most = 9
    return ', '.join(map(shown_name, list(names)[:most])) + (', ...' if len(names) > most else '')


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
                if not is_meant:
                    continue
                check_given(parameter, value, source)
                if not is_of_ros(parameter):
                    yield parameter, value


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
    shown_as = shown_name(name)
    if value == []:
        raise ParameterError(
            f'{source}: {shown_as}: []: ROS accepts no empty list: leave the name out')
    if value is BLANK:
        hint = ''
        if missing := no_space(name):  # {mass:0.5}
            hint = f'; {missing}'
        elif name.rpartition('.')[2].isdecimal():  # {mass: 0,5}
            hint = '; a decimal comma? write 0.5, not 0,5'
        raise ParameterError(f'{source}: {shown_as}: has no value{hint}')
    # ROS ignores a value of another type: the node would not use simulated time.
    if name in _OF_ROS and not isinstance(value, bool):
        raise ParameterError(f'{source}: {name}: {shown(value)}: must be a bool')


def write_yaml(path: str | Path, values: Mapping[str, Any], comments: Mapping[str, str]) -> None:
    """
    Write a ROS parameter file for any node, with comments.

    Parameters
    ----------
    path : str or Path
        The file; an existing one is replaced.
    values : mapping of dotted name to value
        Texts, doubles, bools, or tuples of them; a tuple of length 1 is written as a single value.
    comments : mapping of dotted name to str
        Behind the values: units and more; empty where there is none.

    Raises
    ------
    ParameterError
        The file cannot be written.

    """
    tree: dict[str, Any] = {}
    for name, value in values.items():
        *groups, last = name.split('.')
        group = tree
        for each in groups:
            group = group.setdefault(each, {})
        group[last] = value, comments[name]
    try:
        lines = ['/**:', '  ros__parameters:', *_lines(tree, '    ')]
        Path(path).write_text('\n'.join(lines) + '\n', encoding='utf-8')
    except (OSError, TypeError, ValueError) as exc:
        reason = exc.strerror if isinstance(exc, OSError) else exc
        raise ParameterError(f'{shown_name(path)}: cannot be written: {reason}') from exc


def _lines(tree: Mapping[str, Any], indent: str) -> Iterator[str]:
    """Yield the lines of a group."""
    for name, content in tree.items():
        if isinstance(content, dict):
            yield f'{indent}{name}:'
            yield from _lines(content, f'{indent}  ')
            continue
        value, text = content
        entries = [_written(each) for each in (value if isinstance(value, tuple) else (value,))]
        comment = f'  # {text}' if text else ''
        if len(entries) == 1:
            yield f'{indent}{name}: {entries[0]}{comment}'
        elif len(entries) <= _LONGEST_ROW:
            yield f'{indent}{name}: [{", ".join(entries)}]{comment}'
        else:
            yield f'{indent}{name}: [{comment}'
            for n in range(0, len(entries), _ROW):
                end = ']' if n + _ROW >= len(entries) else ','
                yield f'{indent}  {", ".join(entries[n:n + _ROW])}{end}'


def _written(value: Any) -> str:
    """Return a value as YAML with the same meaning to rcl and to YAML 1.1."""
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, float):
        text = repr(value)
        if not isinstance(scalar(text), float):
            raise ValueError(f'{text}: ROS reads no number so small')
        return text if '.' in text else text.replace('e', '.0e')
    if _NAME.fullmatch(value) and scalar(value) == value:
        return str(value)
    quoted = value.replace("'", "''")
    return f"'{quoted}'"
