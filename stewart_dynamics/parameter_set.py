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

"""A table of parameters, and sets of values that are checked by it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import difflib
from itertools import chain
import math
from pathlib import Path
import re
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple, TYPE_CHECKING

import numpy as np

from stewart_dynamics.errors import ParameterError, shown, shown_name
from stewart_dynamics.parameter_files import (
    check_given, flat, is_of_ros, parameters_of, read_yaml, write_yaml)
from stewart_dynamics.parameters_yaml import no_space, read_document, read_value, scalar

if TYPE_CHECKING:
    from typing_extensions import Self

_PYTHON_TYPES: Mapping[str, Any] = {'string': str, 'double': float, 'bool': bool}


class Parameter(NamedTuple):
    """
    The declaration of one parameter.

    Attributes
    ----------
    name : str
        Dotted, as in a file.
    kind : str
        Its type in ROS, for an array that of an entry: string, double or bool.
    text : str
        Its meaning, for the documents, ``--help`` and ROS's description.
    unit : str
        SI; empty if it has none.
    default : object
        The value if it is not given; an empty tuple: no value, not checked.
    required : bool
        Whether it must be given.
    sizes : tuple of int
        The lengths that an array may have, empty for a single value; an array of length 1 or 6
        may also be given as a single value, for all legs.
    minimum, maximum : float
        Bounds of every entry.
    above : bool
        Whether ``minimum`` itself is out of range.
    choices : tuple of str
        The accepted texts.
    while_active : bool
        Whether it may be changed while the node is active.

    """

    name: str
    kind: str
    text: str
    unit: str = ''
    default: Any = None
    required: bool = False
    sizes: tuple[int, ...] = ()
    minimum: float = -math.inf
    maximum: float = math.inf
    above: bool = False
    choices: tuple[str, ...] = ()
    while_active: bool = False

    @property
    def ros_type(self) -> str:
        """Return the name of the type in ROS, as in the documents."""
        if not self.sizes:
            return self.kind
        return f'{self.kind}[{" or ".join(map(str, self.sizes))}]'

    @property
    def rule(self) -> str:
        """Return the accepted values, as text."""
        if self.choices:
            return 'one of ' + ', '.join(self.choices)
        rules = []
        if self.minimum > -math.inf:
            rules.append(f'{"more than" if self.above else "at least"} {self.minimum:g}')
        if self.maximum < math.inf:
            rules.append(f'at most {self.maximum:g}')
        return ', '.join(rules)


class ParameterSet(Mapping[str, Any]):
    """
    A complete, checked set of parameters under their dotted names; immutable.

    Arrays are read-only numpy arrays: joints (6, 3), values of the legs (6,); limits that are not
    checked are None.

    Parameters
    ----------
    values : mapping of dotted name to value
        As YAML, ROS or Python give them; None stands for the default.
    source : str
        Where they come from, for the text of an error.
    exact_types : bool
        Reject an integer in place of a double, as ROS does.

    Raises
    ------
    ParameterError
        At the first rule that is broken.

    """

    table: ClassVar[Mapping[str, Parameter]]
    node: ClassVar[str]

    def __init__(self, values: Mapping[str, Any], source: str = 'parameters', *,
                 exact_types: bool = False) -> None:
        if not isinstance(values, Mapping):
            raise ParameterError(
                f'{source}: {shown(values)}: must be a mapping of names to values')
        for name, value in values.items():
            self.declared(name, value, source)
        self._given = {
            name: _plain(value) if exact_types else _as_double(self.table[name], _plain(value))
            for name, value in values.items() if value is not None}
        self._values = {
            name: _checked(parameter, self._given.get(name, parameter.default), source)
            for name, parameter in self.table.items()}
        self._check_together(source)

    def __getitem__(self, name: str) -> Any:
        """Return a parameter's value."""
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        """Return an iterator over the names."""
        return iter(self._values)

    def __len__(self) -> int:
        """Return the number of parameters."""
        return len(self._values)

    def __eq__(self, other: object) -> bool:
        """Return whether all values are equal."""
        return isinstance(other, type(self)) and self._key() == other._key()

    def __hash__(self) -> int:
        """Return a hash of all values."""
        return hash(self._key())

    def __repr__(self) -> str:
        """Return the number of values that were given."""
        return f'<{type(self).__name__}: {len(self._given)} of {len(self)} given>'

    def __reduce__(self) -> tuple[type[Self], tuple[dict[str, Any]]]:
        """Return how to make a copy, which is checked and read-only as well."""
        return type(self), (self._given,)

    @property
    def given(self) -> Mapping[str, Any]:
        """Return the values that are not defaults, as they were given."""
        return MappingProxyType(self._given)

    def _key(self) -> tuple[Any, ...]:
        return tuple(tuple(value.ravel()) if isinstance(value, np.ndarray) else value
                     for value in self._values.values())

    def replaced(self, changes: Mapping[str, Any], source: str = 'parameters', *,
                 exact_types: bool = False) -> Self:
        """Return a copy with these values changed, checked as a whole."""
        if not isinstance(changes, Mapping):
            raise ParameterError(
                f'{source}: {shown(changes)}: must be a mapping of names to values')
        return type(self)({**self._given, **changes}, source, exact_types=exact_types)

    @classmethod
    def from_yaml(cls, path: str | Path, node: str = '') -> Self:
        """
        Read a ROS parameter file, ``/**:`` or the node's name, then ``ros__parameters:``.

        Parameters
        ----------
        path : str or Path
            The file.
        node : str
            The name of the node with its namespace, if it is not the default one.

        Raises
        ------
        ParameterError
            Names file, parameter, value and rule.

        """
        return cls(read_yaml(path, node or cls.node), str(path), exact_types=True)

    def to_yaml(self, path: str | Path) -> None:
        """
        Write a complete ROS parameter file, for any node (``/**:``), that reads back equal.

        An existing file is replaced.

        Raises
        ------
        ParameterError
            The file cannot be written.

        """
        values = {name: self._given.get(name, parameter.default)
                  for name, parameter in self.table.items()}
        units = {name: parameter.unit for name, parameter in self.table.items()}
        write_yaml(path, {name: value for name, value in values.items()
                          if value is not None and value != ()}, units)

    @classmethod
    def check_file(cls, path: str | Path) -> None:
        """Raise ParameterError if a value of a file breaks a rule; the file may be incomplete."""
        source = str(path)
        for name, value in list(parameters_of(read_document(path), cls.node, source)):
            parameter = cls.declared(name, value, source)
            if value is not None:
                _checked(parameter, value, source)

    @classmethod
    def read_value(cls, name: str, text: str, source: str) -> Any:
        """Return a value that is text on a command line; ParameterError if it breaks a rule."""
        given = read_value(text, f'{source}: {shown_name(name)}')
        for _, value in flat({name: given}, '', source):
            check_given(name, value, source)
            if value is None:
                raise ParameterError(f'{source}: {shown_name(name)}: has no value')
            if not is_of_ros(name):
                _checked(cls.declared(name, value, source), value, source)
        return given

    @classmethod
    def declared(cls, name: str, value: Any = None, source: str = 'parameters') -> Parameter:
        """Return the declaration of a parameter; ParameterError suggests the most similar name."""
        if isinstance(name, str) and name in cls.table:
            return cls.table[name]
        text = shown_name(name)
        near = difflib.get_close_matches(text, cls.table, n=1)
        hint = f'; do you mean {near[0]}?' if near else ''
        if isinstance(value, str) and (missing := no_space(value)):
            hint = f'; {missing}'
        raise ParameterError(f'{source}: {text}: unknown parameter{hint}')

    def _check_together(self, source: str) -> None:
        """Check the rules between parameters."""


def _plain(value: Any) -> Any:
    """Return an immutable copy of a value; arrays as flat tuples."""
    if isinstance(value, np.ndarray):
        value = value.ravel() if value.ndim else value[()]
    if hasattr(value, 'tolist'):
        value = value.tolist()
    if isinstance(value, list | tuple):  # rows of joints as well
        entries = [each.tolist() if hasattr(each, 'tolist') else each for each in value]
        return tuple(chain.from_iterable(
            each if isinstance(each, list | tuple) else (each,) for each in entries))
    return value


def _as_double(parameter: Parameter, value: Any) -> Any:
    """Return a value with integers converted to double where the parameter is a double."""
    if parameter.kind != 'double':
        return value
    if isinstance(value, tuple):
        return tuple(_as_double(parameter, each) for each in value)
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) < 2 ** 63:
        return float(value)
    return value


def _checked(parameter: Parameter, value: Any, source: str) -> Any:
    """Return the value as the package uses it; ParameterError if it breaks a rule."""
    if value is None:
        if parameter.required:
            raise ParameterError(f'{source}: {parameter.name}: missing, it has no default')
        return None
    is_array = isinstance(value, list | tuple)
    entries = list(value) if is_array else [value]
    if is_array and not parameter.sizes:
        raise _broken(parameter, value, source, f'must be a single {parameter.kind}')
    if not is_array and parameter.sizes and 1 not in parameter.sizes:
        raise _broken(parameter, value, source, f'must be an array of {parameter.sizes[0]}')
    if not entries and parameter.default == ():
        return None
    if is_array and len(entries) not in parameter.sizes:
        has = f'must have {" or ".join(map(str, parameter.sizes))} entries, has {len(entries)}'
        if parameter.kind == 'double' and len(entries) > min(parameter.sizes) and any(
                type(entry) is int for entry in entries):  # [0,5, 1,5]
            has += '; decimal commas? write 0.5, not 0,5'
        raise _broken(parameter, value, source, has)
    for entry in entries:
        _check_entry(parameter, entry, source)
    if parameter.kind != 'double':
        return tuple(entries) if parameter.sizes else entries[0]
    if not parameter.sizes:
        return entries[0]
    array = np.array(entries * 6 if len(entries) == 1 else entries)
    array = array.reshape(6, 3) if len(array) == 18 else array
    array.setflags(write=False)
    return array


def _check_entry(parameter: Parameter, entry: Any, source: str) -> None:
    if not isinstance(entry, _PYTHON_TYPES[parameter.kind]):
        raise _broken(parameter, entry, source, _wrong_type(parameter.kind, entry))
    if parameter.kind == 'string' and not entry.isprintable():
        raise _broken(parameter, entry, source, 'must be printable text')
    if parameter.choices and entry not in parameter.choices:
        raise _broken(parameter, entry, source, f'must be {parameter.rule}')
    if parameter.kind == 'double':
        if not math.isfinite(entry):
            raise _broken(parameter, entry, source, 'must be finite')
        if (entry < parameter.minimum or entry > parameter.maximum
                or (parameter.above and entry == parameter.minimum)):
            raise _broken(parameter, entry, source, f'must be {parameter.rule}')


def _wrong_type(kind: str, entry: Any) -> str:
    """Return the rule that a value of another type breaks, with a likely correction."""
    if kind == 'double' and type(entry) is int:
        written = f': write {entry}.0' if abs(entry) < 1e15 else ''
        return f'is an integer, must be a double{written}'
    if kind == 'string':
        return 'must be a string' + (
            ': put it in quotes' if isinstance(entry, bool | int | float) else '')
    if kind == 'double' and isinstance(entry, str) and len(entry) < 80:
        if re.fullmatch(r'[+-]?[0-9]+,[0-9]+', entry, re.ASCII):
            return f'must be a double; a decimal comma? write {entry.replace(",", ".")}'
        if type(scalar(entry)) in (int, float):
            return 'must be a double, not a text: write it without quotes'
        if re.fullmatch(r'[+-]?[0-9][0-9_ ]*[0-9](\.[0-9_]*)?', entry, re.ASCII):
            return 'must be a double: write its digits without anything between them'
        if re.fullmatch(r'[+-]?[0-9]*\.?[0-9]*([eE][+-]?[0-9]+)?', entry, re.ASCII):
            return 'must be a double: it is out of range'
    return f'must be a {kind}'


def _broken(parameter: Parameter, value: Any, source: str, rule: str) -> ParameterError:
    unit = f' {parameter.unit}' if parameter.unit and isinstance(value, float) else ''
    return ParameterError(f'{source}: {parameter.name}: {shown(value)}{unit}: {rule}')
