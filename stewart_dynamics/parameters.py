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
The parameters: one table of them, and the files and values that are checked by it.

The check, the node's declaration and the README's table all come from PARAMETERS.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import difflib
import math
from pathlib import Path
import re
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple, TYPE_CHECKING

import numpy as np

from stewart_dynamics.errors import ParameterError
from stewart_dynamics.parameters_yaml import no_space, read_document, read_value, value_of

if TYPE_CHECKING:
    from typing_extensions import Self


class Parameter(NamedTuple):
    """
    What is known of one parameter.

    ``sizes`` are the lengths an array may have, none for a single value; a length of one or
    six may also be given as a single value, for all legs. ``minimum`` and ``maximum``
    hold for every entry, ``minimum`` itself not where ``above`` is set.
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
        """The type's name in ROS, as the documents have it."""
        if not self.sizes:
            return self.kind
        return f'{self.kind}[{" or ".join(map(str, self.sizes))}]'

    @property
    def rule(self) -> str:
        """The values it may have, in words."""
        if self.choices:
            return 'one of ' + ', '.join(self.choices)
        rules = []
        if self.minimum > -math.inf:
            rules.append(f'{"more than" if self.above else "at least"} {self.minimum:g}')
        if self.maximum < math.inf:
            rules.append(f'at most {self.maximum:g}')
        return ', '.join(rules)


def _legs(name: str, text: str, unit: str, default: Any = (0.0,), **rule: Any) -> Parameter:
    return Parameter(name, 'double', text, unit, default, sizes=(1, 6), **rule)


PARAMETERS: Mapping[str, Parameter] = MappingProxyType({p.name: p for p in (
    Parameter('base_frame', 'string', 'frame in which setpoints and wrenches are given',
              default='base'),
    Parameter('platform_frame', 'string', 'frame that moves with the platform',
              default='platform'),
    Parameter('joints', 'string', "the legs' names, in the order of all arrays of six",
              default=tuple(f'leg_{n}' for n in range(1, 7)), sizes=(6,)),
    Parameter('geometry.base_joints', 'double',
              'x y z of the six base joints, one leg after the other, base frame', 'm',
              required=True, sizes=(18,)),
    Parameter('geometry.platform_joints', 'double',
              'x y z of the six platform joints, in the same order, platform frame', 'm',
              required=True, sizes=(18,)),
    _legs('geometry.zero_length', 'length at which the published position is zero', 'm',
          minimum=0.0),
    Parameter('platform.mass', 'double', 'mass of the platform with all that it carries', 'kg',
              required=True, minimum=0.0, above=True, while_active=True),
    Parameter('platform.center_of_mass', 'double', 'its center of mass, platform axes', 'm',
              (0.0, 0.0, 0.0), sizes=(3,), while_active=True),
    Parameter('platform.inertia', 'double',
              'ixx ixy ixz iyy iyz izz about its center of mass, platform axes', 'kg m^2',
              required=True, sizes=(6,), while_active=True),
    _legs('legs.cylinder.mass', 'mass of the lower part', 'kg', minimum=0.0),
    _legs('legs.cylinder.center_of_mass', 'its distance from the base joint', 'm'),
    _legs('legs.cylinder.inertia', 'transverse inertia about its center of mass', 'kg m^2',
          minimum=0.0),
    _legs('legs.piston.mass', 'mass of the upper part', 'kg', minimum=0.0),
    _legs('legs.piston.center_of_mass', 'its distance from the platform joint', 'm'),
    _legs('legs.piston.inertia', 'transverse inertia about its center of mass', 'kg m^2',
          minimum=0.0),
    _legs('actuator.reflected_mass', 'inertia of rotor and screw, J (2 pi / lead)^2', 'kg',
          minimum=0.0),
    _legs('actuator.viscous_friction', 'friction force per rate of the leg', 'N s/m',
          minimum=0.0),
    _legs('actuator.coulomb_friction', 'dry friction; linear within 1 mm/s of standstill', 'N',
          minimum=0.0),
    Parameter('gravity', 'double', 'acceleration of free fall, base axes', 'm/s^2',
              (0.0, 0.0, -9.80665), sizes=(3,)),
    _legs('limits.length_min', 'shortest length of a leg; none: not checked', 'm', (),
          minimum=0.0),
    _legs('limits.length_max', 'longest length of a leg; none: not checked', 'm', (),
          minimum=0.0, above=True),
    _legs('limits.velocity_max', 'fastest rate of a leg; none: not checked', 'm/s', (),
          minimum=0.0, above=True),
    _legs('limits.force_max', 'largest force of a leg, to which forces are clipped; none: not '
          'checked', 'N', (), minimum=0.0, above=True),
    Parameter('singularity.characteristic_length', 'double',
              'length that makes moments and forces alike in the condition number; by default '
              'the mean distance of the platform joints from their center', 'm',
              minimum=0.0, above=True),
    Parameter('singularity.warn_condition', 'double',
              'condition number of J_inv from which a singularity is near; the warning ends '
              'below 0.8 of it', '', 20.0, minimum=1.0, while_active=True),
    Parameter('singularity.stop_condition', 'double',
              'condition number from which singularity.action is taken, until below 0.8 of it',
              '', 100.0, minimum=1.0, while_active=True),
    Parameter('singularity.warn_time', 'double',
              'a crossing of det(J) = 0 foretold sooner than this is warned of', 's', 0.5,
              minimum=0.0, while_active=True),
    Parameter('singularity.action', 'string',
              'what is done inside stop_condition: warn only, or publish no forces', '', 'warn',
              choices=('warn', 'suppress_forces'), while_active=True),
    Parameter('setpoint.source', 'string',
              'three topics, one combined topic, or the pose alone (quasi-static: no motion '
              'terms)', '', 'separate', choices=('separate', 'combined', 'pose')),
    Parameter('setpoint.sync_tolerance', 'double',
              'how far the stamps of one setpoint may lie apart', 's', 0.0, minimum=0.0,
              maximum=1e9),
    Parameter('setpoint.timeout', 'double',
              'silence after which setpoints are stale; a longer jump back in time is a '
              'restart', 's', 0.1, minimum=0.0, above=True, maximum=1e9),
    Parameter('setpoint.exclusive', 'bool',
              'refuse setpoints while a topic has more than one writer', default=False),
    Parameter('trajectory.effort', 'bool', 'give forces with the points of ~/leg_trajectory: a '
              'joint_trajectory_controller without an effort command interface refuses points '
              'that have them', default=True),
    Parameter('external_wrench.cutoff', 'double',
              'cut-off frequency of the low-pass filter on ~/external_wrench', 'Hz', 10.0,
              minimum=0.0, above=True, while_active=True),
    Parameter('external_wrench.force_max', 'double',
              'external force from which diagnostics are an ERROR; none: not checked', 'N',
              minimum=0.0, above=True, while_active=True),
    Parameter('external_wrench.moment_max', 'double',
              "external moment at the platform's origin likewise; none: not checked", 'N m',
              minimum=0.0, above=True, while_active=True),
    Parameter('visualization_rate', 'double', 'most pictures (~/markers) in a second, 0: none',
              'Hz', 30.0, minimum=0.0),
    Parameter('autostart', 'bool', 'bring the node to active by itself', default=True),
)})

# A machine's file has 4 kB, that of a whole robot seldom more than 50. ROS's own reader takes
# 2 s at worst for a file of this size, but a minute for a list of 500 kB, of any node.
_LARGEST = 100_000  # [bytes]

# What ROS itself declares in every node.
_OF_ROS = ('use_sim_time', 'start_type_description_service')
_OF_ROS_PREFIX = 'qos_overrides.'

_PYTHON_TYPES: Mapping[str, Any] = {'string': str, 'double': float, 'bool': bool}


def is_of_ros(name: str) -> bool:
    """Return whether a parameter of this name is one that ROS itself declares in nodes."""
    return name in _OF_ROS or name.startswith(_OF_ROS_PREFIX)


class ParameterSet(Mapping[str, Any]):
    """
    A whole, checked set of parameters under their dotted names; it never changes.

    Arrays are read-only numpy arrays: joints (6, 3), whatever is given for each leg (6,),
    limits that are not checked None. Raises ParameterError at the first rule broken.

    Parameters
    ----------
    values : mapping of dotted name to value
        As YAML or ROS gives them; what is missing takes its default.
    source : str
        Where they come from, for the text of an error.

    """

    table: ClassVar[Mapping[str, Parameter]]
    node: ClassVar[str]

    def __init__(self, values: Mapping[str, Any], source: str = 'parameters') -> None:
        for name, value in values.items():
            self.declared(name, value, source)
        self._given = {name: _plain(value) for name, value in values.items()
                       if value is not None}
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
        """Return how many parameters there are."""
        return len(self._values)

    def __eq__(self, other: object) -> bool:
        """Return whether all values are equal."""
        return isinstance(other, type(self)) and self._key() == other._key()

    def __hash__(self) -> int:
        """Return a hash of all values."""
        return hash(self._key())

    def __reduce__(self) -> tuple[type[Self], tuple[dict[str, Any]]]:
        """Return how to make a copy: checked and read-only again."""
        return type(self), (self._given,)

    @property
    def given(self) -> Mapping[str, Any]:
        """The values that are not defaults, as they were given."""
        return MappingProxyType(self._given)

    def _key(self) -> tuple[Any, ...]:
        return tuple(tuple(value.ravel()) if isinstance(value, np.ndarray) else value
                     for value in self._values.values())

    def replaced(self, changes: Mapping[str, Any], source: str = 'parameters') -> Self:
        """Return the parameters with these changed, checked as a whole again."""
        return type(self)({**self._given, **changes}, source)

    @classmethod
    def from_yaml(cls, path: str | Path, node: str = '') -> Self:
        """
        Read a ROS parameter file, ``/**:`` or the node's name, then ``ros__parameters:``.

        Parameters
        ----------
        path : str or Path
            The file.
        node : str
            The node's name, with its namespace if it has one, where it is not the usual one.

        Raises ParameterError, naming file, parameter, value and rule.

        """
        return cls(read_yaml(path, node or cls.node), str(path))

    @classmethod
    def check_file(cls, path: str | Path) -> None:
        """Raise ParameterError if what a file gives a node breaks a rule; it need not be all."""
        for name, value in list(_of_node(_document(path), cls.node, str(path))):
            _checked(cls.declared(name, value, str(path)), value, str(path))

    @classmethod
    def check_value(cls, name: str, text: str, source: str) -> None:
        """Raise ParameterError if the text of a value, as a command line has it, breaks a rule."""
        given = {name: read_value(text, f'{source}: {_name(name)}')}
        for _, value in _flat(given, '', source):
            _check_given(name, value, source)
            if not is_of_ros(name):
                _checked(cls.declared(name, value, source), value, source)

    @classmethod
    def declared(cls, name: str, value: Any = None, source: str = 'parameters') -> Parameter:
        """Return what is known of a parameter; else ParameterError names the nearest one."""
        if name in cls.table:
            return cls.table[name]
        shown = _name(name)
        near = difflib.get_close_matches(shown, cls.table, n=1)
        hint = f'; do you mean {near[0]}?' if near else ''
        if isinstance(value, str) and (missing := no_space(value)):
            hint = f'; {missing}'
        raise ParameterError(f'{source}: {shown}: unknown parameter{hint}')

    def _check_together(self, source: str) -> None:
        """Check what one parameter demands of another."""


class Parameters(ParameterSet):
    """The parameters of a machine and of the node that computes for it."""

    table = PARAMETERS
    node = 'stewart_dynamics'

    def _check_together(self, source: str) -> None:
        """Check what one parameter demands of another."""
        joints = self['joints']
        if len(set(joints)) < 6 or '' in joints:
            raise ParameterError(f'{source}: joints: {list(joints)}: six different names needed')
        inertia = inertia_matrix(self['platform.inertia'])
        moments = np.linalg.eigvalsh(inertia)
        if moments[0] <= 0.0:
            raise ParameterError(
                f'{source}: platform.inertia: {self["platform.inertia"].tolist()}: must be '
                f'positive definite, but its smallest principal moment is {moments[0]:.6g} '
                'kg m^2 (the order is ixx ixy ixz iyy iyz izz)')
        low, high = self['limits.length_min'], self['limits.length_max']
        if low is not None and high is not None and np.any(low >= high):
            raise ParameterError(
                f'{source}: limits.length_min: {low.tolist()}: must be less than '
                f'limits.length_max, {high.tolist()}')
        warn, stop = self['singularity.warn_condition'], self['singularity.stop_condition']
        if stop < warn:
            raise ParameterError(
                f'{source}: singularity.stop_condition: {stop}: must be at least '
                f'singularity.warn_condition, {warn}')
        platform_joints = self['geometry.platform_joints']
        size = float(np.mean(np.linalg.norm(
            platform_joints - platform_joints.mean(axis=0), axis=1)))
        if size == 0.0:
            raise ParameterError(
                f'{source}: geometry.platform_joints: all six are one point: they must '
                'span the platform')
        if self['singularity.characteristic_length'] is None:
            self._values['singularity.characteristic_length'] = size


def inertia_matrix(six: Any) -> Any:
    """Return the (3, 3) matrix of ixx ixy ixz iyy iyz izz."""
    ixx, ixy, ixz, iyy, iyz, izz = six
    return np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])


def read_yaml(path: str | Path, node: str) -> dict[str, Any]:
    """
    Return the values that a ROS parameter file holds for a node, under dotted names.

    Sections apply in the file's order, a later one over an earlier one, as in ROS.
    """
    document = _document(path)
    values = dict(_of_node(document, node, str(path)))
    if not values:
        held = ', '.join(map(_name, list(document)[:9])) + (', ...' if len(document) > 9 else '')
        raise ParameterError(
            f"{path}: holds {held}, but no parameters under '/**:' or '{node}:'")
    return values


def _document(path: str | Path) -> dict[str, Any]:
    return read_document(path, _LARGEST)


def _of_node(document: dict[str, Any], node: str, source: str) -> Iterator[tuple[str, Any]]:
    """
    Yield the names and values that a document holds for a node, in their order.

    What ROS's reader takes otherwise than it is meant is refused in the sections of other
    nodes as well: it reads all of them.
    """
    for name, content in document.items():
        sections = list(_sections(name, content))
        if not sections and _is_meant(name, node):
            raise ParameterError(f"{source}: {_name(name)}: must hold 'ros__parameters:'")
        for section, parameters in sections:
            is_meant = _is_meant(section, node)
            seen = set()
            for parameter, value in _flat(parameters, '', source):
                if parameter in seen:
                    raise ParameterError(
                        f'{source}: {_name(parameter)}: given twice under {_name(section)}')
                seen.add(parameter)
                if not is_meant:
                    continue
                _check_given(parameter, value, source)
                if not is_of_ros(parameter):
                    yield parameter, value


def _sections(name: str, content: Any) -> Iterator[tuple[str, Any]]:
    """Yield nodes' names, their namespaces before them, and what ros__parameters holds."""
    if not isinstance(content, dict):
        return
    for key, value in content.items():
        if key == 'ros__parameters':
            yield name, {} if value is None else value
        else:
            yield from _sections(f'{name}/{key}', value)


def _is_meant(section: str, node: str) -> bool:
    """Return whether a section is for a node: /* is one part of its name, /** are any."""
    pattern = re.escape(f'/{section.removeprefix("/")}')
    pattern = re.sub(r'(/\\\*\\\*)+', r'(/\\w+)*', pattern).replace(r'/\*', r'/\w+')
    return re.fullmatch(pattern, f'/{node.strip("/")}') is not None


def _flat(tree: Any, prefix: str, source: str) -> Iterator[tuple[str, Any]]:
    if not isinstance(tree, dict):
        raise ParameterError(f'{source}: {_name(prefix or "ros__parameters")}: {_cut(tree)}: '
                             'must hold names and values')
    for key, value in tree.items():
        name = f'{prefix}{key}'
        if isinstance(value, dict):
            yield from _flat(value, f'{name}.', source)
            continue
        if isinstance(value, list) and any(isinstance(each, list | dict) for each in value):
            raise ParameterError(
                f'{source}: {_name(name)}: {_cut(value)}: has a list or a group in the list: '
                'write the numbers one after the other, [x1, y1, z1, x2, y2, z2]')
        yield name, value


def _name(name: Any) -> str:
    """Return a name as an error shows it, whatever was given as one."""
    text = str(name)
    if not text.isprintable():
        text = repr(text)
    return text if len(text) < 80 else f'{text:.77}...'


def _cut(value: Any) -> str:
    """Return a value as an error shows it."""
    value = list(value) if isinstance(value, tuple) else value
    try:
        # No more of a long list than is shown.
        shown = repr(value[:40] if isinstance(value, list | str | bytes) else value)
    except ValueError:  # an integer of more digits than Python writes
        shown = f'an integer of {value.bit_length()} bits'
    return shown if len(shown) < 80 else f'{shown:.77}...'


def _check_given(name: str, value: Any, source: str) -> None:
    """Raise ParameterError for a value that ROS goes on without, and say what may be meant."""
    if value == []:
        raise ParameterError(f'{source}: {_name(name)}: []: ROS takes no empty list: leave the '
                             'name out')
    if value is not None:
        # ROS goes on without it: a node that was to take simulated time does not.
        if name in _OF_ROS and not isinstance(value, bool):
            raise ParameterError(f'{source}: {name}: {_cut(value)}: must be a bool')
        return
    key = name.rpartition('.')[2]
    hint = ''
    if missing := no_space(name):  # {mass:0.5}
        hint = f'; {missing}'
    elif key.isdecimal():  # {mass: 0,5}
        hint = '; a decimal comma? write 0.5, not 0,5'
    raise ParameterError(f'{source}: {_name(name)}: has no value{hint}')


def _plain(value: Any) -> Any:
    """Return a value that nobody else can change; arrays as tuples, of one axis."""
    if isinstance(value, np.ndarray):
        value = value.ravel() if value.ndim else value[()]
    if hasattr(value, 'tolist'):
        value = value.tolist()
    return tuple(value) if isinstance(value, list) else value


def _checked(parameter: Parameter, value: Any, source: str) -> Any:
    """Return the value as the package uses it, or raise ParameterError."""
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
    """Return in words that a value is of another type, and what is probably meant."""
    if kind == 'double' and type(entry) is int:
        written = f': write {entry}.0' if abs(entry) < 1e15 else ''
        return f'is an integer, must be a double{written}'
    if kind == 'string':
        return 'must be a string' + (
            ': put it in quotes' if isinstance(entry, bool | int | float) else '')
    if kind == 'double' and isinstance(entry, str) and len(entry) < 80:
        if re.fullmatch(r'[+-]?[0-9]+,[0-9]+', entry, re.ASCII):
            return f'must be a double; a decimal comma? write {entry.replace(",", ".")}'
        if isinstance(value_of(entry), int | float):
            return 'must be a double, not a text: write it without quotes'
        if re.fullmatch(r'[+-]?[0-9][0-9_ ]*[0-9](\.[0-9_]*)?', entry, re.ASCII):
            return 'must be a double: write its digits without anything between them'
        if re.fullmatch(r'[+-]?[0-9]*\.?[0-9]*([eE][+-]?[0-9]+)?', entry, re.ASCII):
            return 'must be a double: it is out of range'
    return f'must be a {kind}'


def _broken(parameter: Parameter, value: Any, source: str, rule: str) -> ParameterError:
    unit = f' {parameter.unit}' if parameter.unit and isinstance(value, float) else ''
    return ParameterError(f'{source}: {parameter.name}: {_cut(value)}{unit}: {rule}')
