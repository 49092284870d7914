# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Declarations of parameters, the check of a value, and sets of values checked by a table."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from itertools import chain
import math
from operator import attrgetter
from pathlib import Path
import re
from types import MappingProxyType
from typing import Any, ClassVar, get_args, get_type_hints, NamedTuple, TYPE_CHECKING

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError, shown, shown_name
from stewart_dynamics.parameters.yaml_file import (
    check_given, check_sections, flat, is_of_ros, parameters_of, read_document, read_value,
    read_yaml, write_yaml, yaml_text)

if TYPE_CHECKING:
    from typing_extensions import Self

_PYTHON_TYPES: Mapping[str, Any] = {'string': str, 'double': float, 'bool': bool}
# The kind of a parameter, by the type with which it is declared.
_KINDS: Mapping[Any, str] = {
    str: 'string', tuple[str, ...]: 'string', float: 'double', Array: 'double', bool: 'bool'}


class LimitWords(NamedTuple):
    """Words of a parameter that limits a quantity of each leg."""

    quantity: str
    phrase: str  # name of the limit in a datasheet
    unit: str = ''  # of the quantity; by default that of the parameter
    title: str = ''  # of the plot of the quantity, where it is a result of the inverse dynamics
    note: str = ''
    usual: bool = False  # the quantity is shown where the limit is not given, too


class Parameter(NamedTuple):
    """The declaration of one parameter."""

    name: str  # dotted, as in a file
    kind: str  # type in ROS, for an array the type of an entry: string, double or bool
    text: str  # meaning, for the documents, ``--help`` and ROS's description
    unit: str = ''
    default: Any = None  # the value if it is not given; an empty tuple: no value, unlimited
    required: bool = False
    sizes: tuple[int, ...] = ()
    """The lengths that an array may have, empty for a single value; an array of length 1 or more
    may also be given as a single value, for all legs."""
    repeated: bool = False
    """Whether an array has any number of rows, one after the other, of its one length each."""
    minimum: float = -math.inf
    maximum: float = math.inf
    above: bool = False  # whether ``minimum`` itself is out of range
    choices: tuple[str, ...] = ()  # the accepted texts
    instead: tuple[str, ...] = ()  # parameters of which one may be given in place of this one
    while_active: bool = False  # whether it may be changed while the node is active
    limit: LimitWords | None = None  # of a limit of the legs, see ``mechanics.limits``

    @property
    def ros_type(self) -> str:
        """Return the name of the type in ROS, as in the documents."""
        if not self.sizes:
            return self.kind
        return f'{self.kind}[{self.lengths}]'

    @property
    def lengths(self) -> str:
        """Return the lengths that an array may have, as text."""
        return f'{self.sizes[0]} n' if self.repeated else ' or '.join(map(str, self.sizes))

    def accepts(self, length: int) -> bool:
        """Return whether an array may have this length."""
        return length % self.sizes[0] == 0 if self.repeated else length in self.sizes

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


def declare(text: str, unit: str = '', default: Any = None, **rule: Any) -> Any:
    """
    Return the declaration of an attribute of a group; ``rule``: further fields of Parameter.

    Name and kind are those of the attribute: ``mass: float = declare('mass of the platform')``.
    """
    return Parameter('', '', text, unit, default, **rule)


def checked(parameter: Parameter, value: Any, source: str) -> Any:
    """Return the value as the package uses it; ParameterError if it breaks a rule."""
    if value is None:
        if parameter.required:
            instead = f'; or give {" and ".join(parameter.instead)}' if parameter.instead else ''
            raise ParameterError(
                f'{source}: {parameter.name}: missing, it has no default{instead}')
        return None
    is_array = isinstance(value, list | tuple)
    entries = list(value) if is_array else [value]
    if is_array and not parameter.sizes:
        raise _broken(parameter, value, source, f'must be a single {parameter.kind}')
    if not is_array and parameter.sizes and 1 not in parameter.sizes:
        raise _broken(parameter, value, source, f'must be an array of {parameter.sizes[0]}')
    if not entries and parameter.default == ():
        return None
    if is_array and not parameter.accepts(len(entries)):
        raise _broken(parameter, value, source,
                      f'must have {parameter.lengths} entries, has {len(entries)}')
    for entry in entries:
        if rule := _broken_rule(parameter, entry):
            raise _broken(parameter, entry, source, rule)
    if not parameter.sizes:
        return entries[0]
    if parameter.kind != 'double':
        return tuple(entries)
    array = np.array(entries * 6 if len(entries) == 1 and parameter.sizes == (1, 6) else entries)
    if parameter.repeated:
        array = array.reshape(-1, parameter.sizes[0])
    elif len(array) in (18, 36):
        array = array.reshape(6, -1)
    array.setflags(write=False)
    return array


def check_shape(parameter: Parameter, value: Any, source: str) -> None:
    """
    Raise ParameterError for rows that are not those of the parameter.

    Flat arrays may have its length; rows must be the points of three joints' coordinates, of the
    corners of a plate or of a curve. Other rows of as many numbers would be read in a wrong order.
    """
    try:
        shape = np.shape(value)
    except Exception:
        return  # no array: the check of entries rejects it
    if len(shape) < 2:
        return
    row = parameter.sizes[0] if parameter.repeated else max(parameter.sizes, default=0) // 6
    row = row if row > 1 else 0
    rows = None if parameter.repeated else 6
    if len(shape) == 2 and shape[1] == row and rows in (None, shape[0]):
        return
    flat_shapes = () if parameter.repeated else parameter.sizes
    expected = [f'({each},)' for each in flat_shapes]
    expected += [f'({rows or "N"}, {row})'] if row else []
    turned = row and shape[0] == row or not row and shape[1:] == (1,)
    raise ParameterError(
        f'{source}: {parameter.name}: shape {shape}: must be '
        f'{" or ".join(expected) or "a single value"}{": transposed?" if turned else ""}')


def _broken_rule(parameter: Parameter, entry: Any) -> str:
    """Return the rule that an entry breaks, with a likely correction; empty if it breaks none."""
    kind = parameter.kind
    if kind == 'double' and type(entry) is int:
        written = f': write {entry}.0' if abs(entry) < 1e15 else ''
        return f'is an integer, must be a double{written}'
    if not isinstance(entry, _PYTHON_TYPES[kind]):
        quoted = kind == 'string' and isinstance(entry, bool | int | float)
        return f'must be a {kind}' + (': put it in quotes' if quoted else '')
    if kind == 'string' and not entry.isprintable():
        return 'must be printable text'
    if kind == 'double' and not math.isfinite(entry):
        return 'must be finite'
    out_of_range = kind == 'double' and (
        entry < parameter.minimum or entry > parameter.maximum
        or (parameter.above and entry == parameter.minimum))
    if out_of_range or (parameter.choices and entry not in parameter.choices):
        return f'must be {parameter.rule}{_other_unit(parameter, entry) if out_of_range else ""}'
    return ''


# Parameters of at most this time are pulses of servos: 0.5 to 2.5 ms, 500 to 2500 us [s].
_LONGEST_OF_PULSES, _IN_MICROSECONDS = 0.1, 100.0
# Angles of up to one turn more than the largest are likely sums of two, as of a pair and a horn.
_TURN = 2.0 * math.pi  # [rad]


def _other_unit(parameter: Parameter, entry: float) -> str:
    """Return the unit in which a number that is too large is likely given, as a question."""
    if abs(entry) <= parameter.maximum:
        return ''
    if parameter.unit == 'rad':
        a_turn_more = parameter.maximum >= _TURN and abs(entry) <= 2.0 * _TURN
        return ': subtract a turn, or in degrees?' if a_turn_more else ': in degrees?'
    if parameter.unit == 's' and parameter.maximum < _LONGEST_OF_PULSES:
        unit, size = (('microseconds', 1e-6) if entry >= _IN_MICROSECONDS else ('ms', 1e-3))
        if parameter.minimum <= size * entry <= parameter.maximum:
            return f': in {unit}?'
    return ''


def _broken(parameter: Parameter, value: Any, source: str, rule: str) -> ParameterError:
    unit = f' {parameter.unit}' if parameter.unit and isinstance(value, float) else ''
    return ParameterError(f'{source}: {parameter.name}: {shown(value)}{unit}: {rule}')


# Parameters with all words of an unknown name that are suggested; more are no help.
_MOST_SUGGESTED = 3
# Similarity of names (difflib): of misspelt ones, and the smallest that is suggested.
_MISSPELT, _SIMILAR = 0.9, 0.6


def _similar(text: str, names: Collection[str]) -> list[str]:
    """Return names that an unknown name may stand for; those of its group where that exists."""
    import difflib  # nothing else needs it

    group = text[:text.rfind('.') + 1]
    members = [each for each in names if each.startswith(group)]
    if not members:
        group, members = '', list(names)
    parts = {each[len(group):]: each for each in members}

    def nearest(similarity: float) -> list[str]:
        found = difflib.get_close_matches(text[len(group):], parts, n=1, cutoff=similarity)
        return [parts[each] for each in found]

    words = set(re.findall('[a-z]+', text))
    with_words = [each for each in names if words <= set(re.findall('[a-z]+', each))]
    with_words = [each for each in with_words if words == set(re.findall('[a-z]+', each))
                  ] or with_words
    certain = words and 1 <= len(with_words) <= _MOST_SUGGESTED
    return nearest(_MISSPELT) or (with_words if certain else nearest(_SIMILAR))


class ParameterGroup:
    """
    Parameters whose names begin alike, as ``limits.force_max``; immutable.

    A class declares each with its type: float, Array, str, bool or tuple[str, ...], and None where
    it may be not set. Groups within it are annotations alone. The names of its own begin with _.
    """

    _declarations: ClassVar[Mapping[str, Parameter]] = {}  # by their names from here on
    _groups: ClassVar[Mapping[str, type[ParameterGroup]]] = {}  # likewise, outer ones first
    _path: str = ''  # what the names begin with: 'limits.'
    _set: type[ParameterSet]  # that this is a part of

    def __init__(self, of_set: type[ParameterSet], path: str) -> None:
        vars(self).update(_set=of_set, _path=path)

    def __init_subclass__(cls) -> None:
        """Collect the declarations of the class."""
        declared, groups = dict(cls._declarations), dict(cls._groups)
        hints = get_type_hints(cls, localns={cls.__name__: cls})
        for name in vars(cls).get('__annotations__', ()):
            kind, declaration = hints[name], vars(cls).get(name)
            if isinstance(declaration, Parameter):
                delattr(cls, name)  # the values are attributes of an instance
                declared[name] = declaration._replace(name=name, kind=_kind_of(kind))
            elif isinstance(kind, type) and issubclass(kind, ParameterGroup):
                groups |= {name: kind, **{f'{name}.{each}': group
                                          for each, group in kind._groups.items()}}
                declared |= {(within := f'{name}.{each}'): parameter._replace(name=within)
                             for each, parameter in kind._declarations.items()}
            else:
                continue
            if hasattr(cls, name):
                raise TypeError(f'{cls.__name__}.{name}: the name of a method')
        cls._declarations, cls._groups = declared, groups

    if not TYPE_CHECKING:  # with it, any name would be right

        def __getattr__(self, name: str) -> Any:
            """Raise AttributeError, which suggests similar names of parameters."""
            if name[:1] != '_':
                try:
                    self._set.declared(self._path + name)
                except ParameterError as exc:
                    raise AttributeError(str(exc)) from None
            raise AttributeError(f'{type(self).__name__} has no {name}')

        def __setattr__(self, name: str, value: object) -> None:
            """Set an attribute that is no parameter, of a whole set alone."""
            if name in self._declarations or name in self._groups:
                raise AttributeError(
                    f'{self._path}{name}: parameters are immutable: parameters.replaced'
                    f'({{{self._path + name!r}: ...}}) returns a changed copy')
            if self._path:
                getattr(self, name)  # AttributeError, which suggests similar names
            super().__setattr__(name, value)

        def __delattr__(self, name: str) -> None:
            """Raise AttributeError."""
            raise AttributeError(f'{self._path}{name}: parameters are immutable')

    def __repr__(self) -> str:
        """Return the values."""
        values = ', '.join(
            f'{name}={attrgetter(name)(self)!r}' for name in self._declarations)
        return f'<{self._path[:-1]}: {values}>'


def _kind_of(hint: Any) -> str:
    """Return the kind of a parameter that is declared with a type, or with it and None."""
    plain = [each for each in get_args(hint) if each is not type(None)]
    return _KINDS[hint] if hint in _KINDS else _KINDS[plain[0]]


class ParameterSet(ParameterGroup, Mapping[str, Any]):
    """
    A complete, checked set of parameters; immutable.

    A parameter is read as an attribute, ``parameters.limits.force_max``, whose type is known where
    it is declared, or under its dotted name, ``parameters['limits.force_max']``.

    Arrays are read-only numpy arrays: joints (6, 3), values of the legs (6,); limits that are not
    checked are None. None as a given value stands for the default. ``source`` names where the
    values come from in the text of an error, also of one that a model raises later;
    ``exact_types`` rejects an integer in place of a double, as ROS does. Raises ParameterError at
    the first rule that is broken.
    """

    source = 'parameters'
    table: ClassVar[Mapping[str, Parameter]]
    node: ClassVar[str]
    unused: ClassVar[frozenset[str]] = frozenset()  # accepted in a shared file, without effect
    described: ClassVar[tuple[str, ...]] = ()  # groups that a file describes by giving any of them

    def __init_subclass__(cls) -> None:
        """Make the table from the declarations of the class."""
        super().__init_subclass__()
        cls.table, cls._set = MappingProxyType(dict(cls._declarations)), cls

    def __init__(self, values: Mapping[str, Any], source: str = 'parameters', *,
                 exact_types: bool = False) -> None:
        if not isinstance(values, Mapping):
            raise ParameterError(
                f'{source}: {shown(values)}: must be a mapping of names to values')
        self.source = source
        for name, value in values.items():
            check_shape(self.declared(name, source), value, source)
        self._given = {
            name: _plain(value) if exact_types else _as_double(self.table[name], _plain(value))
            for name, value in values.items() if value is not None}
        self._values = {
            name: checked(parameter, self._given.get(name, parameter.default), source)
            if name in self._given or not any(each in self._given for each in parameter.instead)
            else None for name, parameter in self.table.items()}
        groups: dict[str, ParameterGroup] = {'': self}
        for path, kind in self._groups.items():
            outer, _, name = path.rpartition('.')
            vars(groups[outer])[name] = groups[path] = kind(type(self), f'{path}.')
        for whole_name, value in self._values.items():
            path, _, name = whole_name.rpartition('.')
            vars(groups[path])[name] = value
        self._check_together(source)

    def _complete(self, name: str, value: Any) -> None:
        """Set the value of a parameter that follows from others."""
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
        self._values[name] = value
        path, _, last = name.rpartition('.')
        vars(attrgetter(path)(self) if path else self)[last] = value

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

    def __reduce__(self) -> tuple[type[Self], tuple[dict[str, Any], str]]:
        """Return how to make a copy, which is checked and read-only as well."""
        return type(self), (self._given, self.source)

    @property
    def given(self) -> Mapping[str, Any]:
        """Return the values that are not defaults, as they were given."""
        return MappingProxyType(self._given)

    def plain(self) -> dict[str, Any]:
        """Return all values for JSON, arrays as flat lists."""
        return {name: list(plain) if isinstance(plain := _plain(value), tuple) else plain
                for name, value in self._values.items()}

    def _key(self) -> tuple[Any, ...]:
        return tuple(tuple(value.ravel()) if isinstance(value, np.ndarray) else value
                     for value in self._values.values())

    def replaced(self, changes: Mapping[str, Any], source: str = '', *,
                 exact_types: bool = False) -> Self:
        """Return a copy with these values changed, checked as a whole; ``source``: of them."""
        named = source or 'parameters'
        if not isinstance(changes, Mapping):
            raise ParameterError(
                f'{named}: {shown(changes)}: must be a mapping of names to values')
        changed = type(self)({**self._given, **changes}, named, exact_types=exact_types)
        changed.source = source or self.source
        return changed

    @classmethod
    def from_yaml(cls, path: str | Path, node: str = '') -> Self:
        """
        Read a ROS parameter file, ``/**:`` or the node's name, then ``ros__parameters:``.

        ``node`` is the name of the node with its namespace, if it is not the default one. Raises
        ParameterError, which names file, parameter, value and rule.
        """
        return cls(read_yaml(path, node or cls.node), str(path), exact_types=True)

    def to_yaml(self, path: str | Path, comments: Mapping[str, str] | None = None) -> None:
        """
        Write a complete ROS parameter file, for any node (``/**:``), that reads back equal.

        An existing file is replaced. Comments by name stand behind the units of parameters. Raises
        ParameterError if the file cannot be written.
        """
        write_yaml(path, *self._for_yaml(comments))

    def yaml_text(self, comments: Mapping[str, str] | None = None) -> str:
        """Return the text of the file that ``to_yaml`` writes."""
        return yaml_text(*self._for_yaml(comments))

    def _for_yaml(self, comments: Mapping[str, str] | None,
                  ) -> tuple[dict[str, Any], dict[str, str]]:
        """Return the values to write, and the comment behind each."""
        values = {name: self._given.get(name, parameter.default)
                  for name, parameter in self.table.items()
                  if name in self._given or not name.startswith(self._only_given())}
        added = comments or {}
        texts = {name: '; '.join(filter(None, (self.unit_of(name), added.get(name))))
                 for name in self.table}
        return {name: value for name, value in values.items()
                if value is not None and value != ()}, texts

    def default_of(self, name: str) -> Any:
        """Return the default of a parameter."""
        return self.table[name].default

    def unit_of(self, name: str) -> str:
        """Return the unit of a parameter."""
        return self.table[name].unit

    def _only_given(self) -> tuple[str, ...]:
        """Return beginnings of the names that a file has only if they are given."""
        return self.described

    @classmethod
    def check_file(cls, path: str | Path) -> None:
        """Raise ParameterError if a value of a file breaks a rule; the file may be incomplete."""
        source = str(path)
        document = read_document(path)
        check_sections(path, document, cls.node)
        for name, value in list(parameters_of(document, cls.node, source)):
            parameter = cls.declared(name, source)
            if value is not None:
                checked(parameter, value, source)

    @classmethod
    def read_value(cls, name: str, text: str, source: str) -> Any:
        """Return a value that is text on a command line; ParameterError if it breaks a rule."""
        given = read_value(text, f'{source}: {shown_name(name)}')
        for _, value in flat({name: given}, '', source):
            check_given(name, value, source)
            if value is None:
                raise ParameterError(f'{source}: {shown_name(name)}: has no value')
            if not is_of_ros(name):
                checked(cls.declared(name, source), value, source)
        return given

    @classmethod
    def declared(cls, name: str, source: str = 'parameters') -> Parameter:
        """Return the declaration of a parameter; ParameterError suggests similar names."""
        if isinstance(name, str) and name in cls.table:
            return cls.table[name]
        text = shown_name(name)
        near = _similar(text, cls.table)
        hint = f'; do you mean {" or ".join(near)}?' if near else ''
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
