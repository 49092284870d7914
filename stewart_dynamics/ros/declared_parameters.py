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

"""A node's parameters in ROS: checked by the table, described, and no others."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
import math
import sys
from typing import TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange, ParameterDescriptor, ParameterType, SetParametersResult)
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from stewart_dynamics.errors import ParameterError
from stewart_dynamics.parameters.parameter_set import ParameterSet
from stewart_dynamics.parameters.rules import Parameter
from stewart_dynamics.parameters.yaml_file import is_of_ros, other_nodes
from stewart_dynamics.ros.arguments import given_parameters, parameter_files
from stewart_dynamics.ros.rclpy_workarounds import describe_by, is_present, set_parameters_together

_TYPES = {
    'string': (ParameterType.PARAMETER_STRING, ParameterType.PARAMETER_STRING_ARRAY),
    'double': (ParameterType.PARAMETER_DOUBLE, ParameterType.PARAMETER_DOUBLE_ARRAY),
    'bool': (ParameterType.PARAMETER_BOOL, ParameterType.PARAMETER_BOOL_ARRAY)}

Kind = TypeVar('Kind', bound=ParameterSet)


def declare_parameters(node: Node, kind: type[Kind]) -> Kind:
    """
    Return the node's parameters, checked, and declare all of the table.

    The node must have been made with ``automatically_declare_parameters_from_overrides``. Types
    and ranges are left to the table's own check, whose texts are more precise than those of ROS.
    A node without a lifecycle accepts no changes.

    Raises ParameterError where a rule is broken or a name unknown.
    """
    files = parameter_files(sys.argv)
    sources = list(files)
    if not sources or {'-p', '--param'} & set(sys.argv):
        sources.append('command line')
    source = ', '.join(sources)
    given = given_parameters(sys.argv, node.get_fully_qualified_name(), kind)
    try:
        parameters = kind(given, source, exact_types=True)
    except ParameterError as exc:
        if not files:
            raise ParameterError(
                f'{exc}; a file is given by --params-file after --ros-args') from exc
        raise _of_other_nodes(files, node.get_fully_qualified_name()) or exc from exc
    for name, parameter in kind.table.items():
        unchecked = ParameterDescriptor(dynamic_typing=True)
        if name in given:
            node.set_descriptor(name, unchecked)
            value = RosParameter(name, value=given[name])
            if not is_present(node, value):
                node.set_parameters([value])
            continue
        if node.has_parameter(name):
            node.undeclare_parameter(name)
        default = parameter.default
        if isinstance(default, tuple):
            default = list(default) or None
        node.declare_parameter(name, default, unchecked, ignore_override=True)
    if not isinstance(node, LifecycleNode):
        node.add_on_set_parameters_callback(partial(_reject_changes, kind))
    set_parameters_together(node)
    describe_by(node, lambda name: _descriptor(
        kind.table[name], node) if name in kind.table else None)
    return parameters


def _of_other_nodes(files: Sequence[str], node: str) -> ParameterError | None:
    """Return the error where no file has a section for the node."""
    others = [other_nodes(file, node) for file in files]
    if not others or not all(others):
        return None
    return ParameterError('; '.join(
        f"{file}: is for {other}, not for '{node}': rename the section, or use '/**'"
        for file, other in zip(files, others, strict=True)))


def _reject_changes(
        kind: type[ParameterSet], changes: Sequence[RosParameter]) -> SetParametersResult:
    for change in changes:
        if not is_of_ros(change.name):
            try:
                kind.declared(change.name)
            except ParameterError as exc:
                return SetParametersResult(successful=False, reason=str(exc))
            return SetParametersResult(successful=False, reason=(
                f'{change.name}: only read when the node starts: restart it'))
    return SetParametersResult(successful=True)


def _descriptor(parameter: Parameter, node: Node) -> ParameterDescriptor:
    """Return all that is known of a parameter, as ROS describes it."""
    has_lifecycle = isinstance(node, LifecycleNode)
    when = 'only while unconfigured' if has_lifecycle else 'only when the node starts'
    if parameter.while_active:
        when = 'also while active'
    constraints = [f'{parameter.lengths} entries' if parameter.sizes else '', parameter.rule,
                   f'set {when}']
    unit = f' [{parameter.unit}]' if parameter.unit else ''
    in_range = math.isfinite(parameter.minimum) or math.isfinite(parameter.maximum)
    # A parameter of one number or six has the type of its present value.
    type_ = node.get_parameter(parameter.name).type_.value
    if type_ == ParameterType.PARAMETER_NOT_SET:
        type_ = _TYPES[parameter.kind][bool(parameter.sizes)]
    return ParameterDescriptor(
        name=parameter.name, type=type_, description=parameter.text + unit,
        additional_constraints='; '.join(filter(None, constraints)),
        read_only=not has_lifecycle, dynamic_typing=len(parameter.sizes) > 1,
        floating_point_range=[FloatingPointRange(
            from_value=parameter.minimum, to_value=parameter.maximum)] if in_range else [])
