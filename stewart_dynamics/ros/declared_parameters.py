# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""A node's parameters in ROS: checked by the table, described, changed, and no others."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
import math
import sys
from typing import Any, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange, ParameterDescriptor, ParameterType, SetParametersResult)
from rclpy.exceptions import ParameterException
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.parameter_errors import find_parameter_errors
from stewart_dynamics.parameters.parameter_set import Parameter, ParameterSet
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.parameters.yaml_file import is_of_ros, other_nodes, read_value
from stewart_dynamics.ros.console_scripts import given_parameters, parameter_files
from stewart_dynamics.ros.repeated_log import INFO, WARNING

_TYPES = {
    'string': (ParameterType.PARAMETER_STRING, ParameterType.PARAMETER_STRING_ARRAY),
    'double': (ParameterType.PARAMETER_DOUBLE, ParameterType.PARAMETER_DOUBLE_ARRAY),
    'bool': (ParameterType.PARAMETER_BOOL, ParameterType.PARAMETER_BOOL_ARRAY)}

_NUMBERS = (
    RosParameter.Type.NOT_SET, RosParameter.Type.DOUBLE, RosParameter.Type.DOUBLE_ARRAY)

Kind = TypeVar('Kind', bound=ParameterSet)

# Arguments of a node whose parameters are declared here. Undeclared parameters are allowed so that
# our own check rejects them, with a better text.
MADE_WITH: dict[str, Any] = {
    'automatically_declare_parameters_from_overrides': True, 'allow_undeclared_parameters': True}


def declare_parameters(node: Node, kind: type[Kind]) -> Kind:
    """
    Return the node's parameters, checked, and declare all of the table.

    The node must have been made with the arguments ``MADE_WITH``. Types and ranges are left to the
    table's own check, whose texts are more precise than those of ROS. A node without a
    lifecycle accepts no changes.

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
    for name in kind.table:
        unchecked = ParameterDescriptor(dynamic_typing=True)
        if name in given:
            node.set_descriptor(name, unchecked)
            value = RosParameter(name, value=given[name])
            if not _is_present(node, value):
                node.set_parameters([value])
            continue
        if node.has_parameter(name):
            node.undeclare_parameter(name)
        default = parameters.default_of(name)
        if isinstance(default, tuple):
            default = list(default) or None
        node.declare_parameter(name, default, unchecked, ignore_override=True)
    if not isinstance(node, LifecycleNode):
        node.add_on_set_parameters_callback(partial(_reject_changes, kind))
    _serve(node, kind)
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


def _serve(node: Node, kind: type[ParameterSet]) -> None:
    """
    Answer the parameter services of ROS in place of rclpy, whose callbacks raise out of spin.

    - A type in ``set_parameters`` that does not exist raises ValueError (in rclcpp:
      https://github.com/ros2/rclcpp/issues/3257), and an undeclared name in
      ``get_parameter_types`` TypeError: either ends the program.
    - ``set_parameters`` sets one parameter after the other, as rcl_interfaces defines it: where
      the second is rejected, the first stays set. Here all of one request are set or none.
    - A read-only parameter in the request, as a dump has them, makes rclpy reject the whole
      request even if its value is the present one. Here equal values are no change.
    - rclpy checks a value by the descriptor that it holds before the node's own check is asked,
      in its own words, and takes the bounds of a range as inclusive, so that ``more than 0``
      cannot be described; it also writes the type of a value into the descriptor before it
      rejects the value (``_apply_descriptor`` in
      https://github.com/ros2/rclpy/blob/7.1.5/rclpy/rclpy/node.py).
    """
    def set_together(messages: Sequence[Any]) -> SetParametersResult:
        try:
            received = [_received(node, message) for message in messages]
            changes = [each for each in received if not _is_present(node, each)]
            return (node.set_parameters_atomically(changes) if changes
                    else SetParametersResult(successful=True))
        except (ParameterException, RuntimeError, TypeError, ValueError) as exc:
            return SetParametersResult(successful=False, reason=str(exc))

    def set_parameters(request: Any, response: Any) -> Any:
        response.results = [set_together(request.parameters)] * len(request.parameters)
        return response

    def set_parameters_atomically(request: Any, response: Any) -> Any:
        response.result = set_together(request.parameters)
        return response

    def get_parameter_types(request: Any, response: Any) -> Any:
        response.types = [node.get_parameter(name).type_.value for name in request.names]
        return response

    def describe_parameters(request: Any, response: Any) -> Any:
        response.descriptors = [
            _descriptor(kind.table[name], node) if name in kind.table
            else node.describe_parameter(name) for name in request.names]
        return response

    answers: dict[str, Callable[[Any, Any], Any]] = {
        answer.__name__: answer for answer in (
            set_parameters, set_parameters_atomically, get_parameter_types, describe_parameters)}
    for service in node.services:
        name = service.srv_name.rpartition('/')[2]
        service.callback = answers.get(name, service.callback)


def _received(node: Node, message: Any) -> RosParameter:
    """
    Return the parameter of a request, a number as one where ``ros2 param load`` has sent its text.

    It sends 1e-05 as a text (https://github.com/ros2/rclpy/issues/1672), and the text None where
    ``ros2 param dump`` has written null (https://github.com/ros2/ros2cli/issues/965).
    """
    try:
        parameter: RosParameter = RosParameter.from_parameter_msg(message)
    except ValueError as exc:
        raise ValueError(
            f'{message.name}: parameter type {message.value.type} does not exist') from exc
    if (parameter.type_ != RosParameter.Type.STRING or not node.has_parameter(parameter.name)
            or node.get_parameter(parameter.name).type_ not in _NUMBERS):
        return parameter
    if parameter.value == 'None':
        return RosParameter(parameter.name)
    with suppress(ParameterError):
        value = read_value(parameter.value, parameter.name)
        entries = value if isinstance(value, list) else [value]
        if entries and all(isinstance(entry, float) for entry in entries):
            return RosParameter(parameter.name, value=value)
    return parameter


def _is_present(node: Node, parameter: RosParameter) -> bool:
    """Return whether a parameter has this type and value already."""
    return node.has_parameter(parameter.name) and bool(
        parameter.to_parameter_msg() == node.get_parameter(parameter.name).to_parameter_msg())


def changed(parameters: Kind, changes: Mapping[str, Any], configured: bool) -> Kind:
    """
    Return the parameters with changes applied.

    changes: new values, as given by ROS.
    configured: whether the node is configured: then only some parameters may change.
    Raises ParameterError if a change breaks a rule.
    """
    for name, value in changes.items():
        if value is None:
            raise ParameterError(f'{name}: cannot be unset')
    if configured:
        fixed = [name for name in changes
                 if name in parameters.table and not parameters.table[name].while_active]
        if fixed:
            raise ParameterError(
                f'{", ".join(fixed)}: only changed while the node is unconfigured, because its '
                'topics and its model depend on it: deactivate and clean up first')
    return parameters.replaced(changes, exact_types=True)


def log_changes(before: Parameters, after: Parameters) -> Iterator[tuple[int, str, None]]:
    """Yield log lines for changed values and for new possible errors, as ``RepeatedLog`` takes."""
    changes = [f'{name}: {before.given.get(name, before[name])} -> {value}'
               for name, value in after.given.items() if value != before.given.get(name)]
    if changes:
        yield INFO, '; '.join(changes), None
    known = find_parameter_errors(before, geometry=False)
    for error in find_parameter_errors(after, geometry=False):
        if error not in known:
            yield WARNING, error, None
