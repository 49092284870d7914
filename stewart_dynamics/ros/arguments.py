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

"""The parameters that a node's command line gives: in files, and by ``-p``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TYPE_CHECKING

from stewart_dynamics.errors import ParameterError
from stewart_dynamics.parameters.yaml_file import is_of_ros, parameters_of, read_document

if TYPE_CHECKING:
    from stewart_dynamics.parameters.parameter_set import ParameterSet


def parameter_files(arguments: Sequence[str]) -> list[str]:
    """Return the parameter files that a command line names."""
    return [value for option, value in zip(arguments, arguments[1:], strict=False)
            if option == '--params-file']


def check_arguments(arguments: Sequence[str], kind: type[ParameterSet]) -> None:
    """Raise ParameterError for arguments that the parser of ROS rejects in its own words."""
    for option, argument in zip(arguments, [*arguments[1:], ''], strict=True):
        if option in ('-p', '--param') and ':=' not in argument:
            raise ParameterError(f'command line: {option} {argument}: must be NAME:=VALUE')
    for path in parameter_files(arguments):
        kind.check_file(path)


def given_parameters(arguments: Sequence[str], node: str, kind: type[ParameterSet],
                     ) -> dict[str, Any]:
    """
    Return the values that a command line gives a node, in files and by ``-p``: the last of each.

    ROS may use another one. rcl keeps both a number and a list that ``-p`` sets in its place, and
    rclpy takes the number; values for ``/**`` and those for the node's name are applied in the
    order in which these two first appear; a ``-p`` of another type than in a file is dropped.
    """
    values: dict[str, Any] = {}
    for option, argument in zip(arguments, arguments[1:], strict=False):
        if option == '--params-file':
            values.update(parameters_of(read_document(argument), node, argument))
        elif option in ('-p', '--param'):
            target, _, text = argument.partition(':=')
            section, _, name = target.rpartition(':')
            if section in ('', node.lstrip('/')):
                values[name] = kind.read_value(name, text, 'command line')
    return {name: value for name, value in values.items()
            if value is not None and not is_of_ros(name)}
