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

"""The declaration of one parameter, and the check of a value by it."""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.errors import ParameterError, shown

_PYTHON_TYPES: Mapping[str, Any] = {'string': str, 'double': float, 'bool': bool}


class Parameter(NamedTuple):
    """
    The declaration of one parameter.

    Attributes
    ----------
    name : str
        Dotted, as in a file.
    kind : str
        Type in ROS, for an array the type of an entry: string, double or bool.
    text : str
        Meaning, for the documents, ``--help`` and ROS's description.
    unit : str
        SI; empty for a number without a unit.
    default : object
        The value if it is not given; an empty tuple: no value, unlimited.
    required : bool
        Whether it must be given.
    sizes : tuple of int
        The lengths that an array may have, empty for a single value; an array of length 1 or 6
        may also be given as a single value, for all legs.
    repeated : bool
        Whether an array has any number of rows, one after the other, of its one length each.
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
    repeated: bool = False
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


def checked(parameter: Parameter, value: Any, source: str) -> Any:
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
    array = np.array(entries * 6 if len(entries) == 1 else entries)
    if parameter.repeated:
        array = array.reshape(-1, parameter.sizes[0])
    elif len(array) == 18:
        array = array.reshape(6, 3)
    array.setflags(write=False)
    return array


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
        return f'must be {parameter.rule}'
    return ''


def _broken(parameter: Parameter, value: Any, source: str, rule: str) -> ParameterError:
    unit = f' {parameter.unit}' if parameter.unit and isinstance(value, float) else ''
    return ParameterError(f'{source}: {parameter.name}: {shown(value)}{unit}: {rule}')
