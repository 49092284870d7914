# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Parameters of the nodes: descriptions, and changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing, ExitStack
import math
from pathlib import Path
import sys
from typing import Any
from unittest.mock import patch

import pytest
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterDescriptor, ParameterType, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters, GetParameters, SetParameters, SetParametersAtomically)
import rclpy
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from referees import ROOT, symmetric_parameters
from rosgraph_msgs.msg import Clock
from running import Inside, Peer, SERVICES
from snapshot import Snapshot

from stewart_dynamics import ParameterError, Parameters
from stewart_dynamics.parameters.parameter_set import ParameterSet
from stewart_dynamics.parameters.table import PARAMETERS
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.ros.declared_parameters import declare_parameters, log_changes
from stewart_dynamics.ros.rclpy_workarounds import reject_impossible_times

PROGRAM = 'stewart_dynamics'

# Calls a node's service over ROS.
Ask = Callable[[str, Any], Any]


@pytest.fixture
def declared(domain: int) -> Iterator[Callable[..., Ask]]:
    """Return a function that makes a node with declared parameters, and returns how to call it."""
    with ExitStack() as stack:
        def make(kind: type[Node], parameters: type[ParameterSet], file: str,
                 *overrides: str) -> Ask:
            def node() -> Node:
                made = kind(parameters.node, allow_undeclared_parameters=True,
                            automatically_declare_parameters_from_overrides=True)
                declare_parameters(made, parameters)
                return made

            arguments = ['--ros-args', '--params-file', str(ROOT / 'config' / file)]
            arguments += [each for override in overrides for each in ('-p', override)]
            stack.callback(Inside(node, arguments, domain).kill)
            peer = stack.enter_context(closing(Peer(domain)))

            def ask(service: str, request: Any) -> Any:
                client = peer.node.create_client(
                    SERVICES[service], f'/{parameters.node}/{service}')
                peer.until(client.service_is_ready, f'{service} is there')
                future = client.call_async(request)
                peer.until(future.done, f'{service} answers')
                return future.result()

            return ask

        yield make


def described(ask: Ask, *names: str) -> list[ParameterDescriptor]:
    """Return how a node describes parameters."""
    return list(ask('describe_parameters', DescribeParameters.Request(names=names)).descriptors)


def message(name: str, value: Any) -> ParameterMessage:
    """Return the message that sets a parameter."""
    return RosParameter(name, value=value).to_parameter_msg()


def set_to(ask: Ask, *messages: ParameterMessage) -> tuple[bool, str]:
    """Return whether a node takes messages together, by either service, and why not."""
    several = ask('set_parameters', SetParameters.Request(parameters=messages)).results
    assert len(several) == len(messages)
    once = ask('set_parameters_atomically',
               SetParametersAtomically.Request(parameters=messages)).result
    assert all(each == once for each in several)
    return once.successful, once.reason


def bounds(descriptor: ParameterDescriptor) -> list[tuple[float, float, float]]:
    """Return the ranges that a description holds."""
    return [(each.from_value, each.to_value, each.step)
            for each in descriptor.floating_point_range]


def test_the_node_describes_each_parameter(declared: Any) -> None:
    ask = declared(LifecycleNode, Parameters, 'platform.yaml')
    for name, parameter, each in zip(
            PARAMETERS, PARAMETERS.values(), described(ask, *PARAMETERS), strict=True):
        assert each.name == name
        assert each.description == parameter.text + (
            f' [{parameter.unit}]' if parameter.unit else '')
        assert each.type != ParameterType.PARAMETER_NOT_SET
        assert not each.read_only
        assert each.dynamic_typing == (len(parameter.sizes) > 1)
        assert not each.integer_range
        assert bounds(each) == (
            [(parameter.minimum, parameter.maximum, 0.0)] if parameter.minimum > -math.inf
            else [])
        assert parameter.rule in each.additional_constraints
        assert each.additional_constraints.endswith(
            'set also while active' if parameter.while_active else 'set only while unconfigured')


def test_a_value_out_of_range_is_left_to_the_node_s_own_check(declared: Any) -> None:
    # This node has no check: rclpy's would reject these two, with its own text.
    ask = declared(LifecycleNode, Parameters, 'platform.yaml')
    for value in (-1.0, 'heavy'):
        assert set_to(ask, message('platform.mass', value)) == (True, '')


def test_a_value_that_ros_drops_silently_is_rejected(declared: Any, snapshot: Snapshot) -> None:
    # rclpy would go on with the file's 150.0.
    with snapshot.raises(ParameterError):
        declared(LifecycleNode, Parameters, 'platform.yaml', 'other:platform.mass:=x',
                 'stewart_dynamics:platform.mass:=0,5')


FORMS: dict[str, Any] = {'one number': 1000.0, 'a list of one': [2000.0],
                         'a list': [3000.0, 4000.0, 5000.0, 6000.0, 7000.0, 8000.0]}


@pytest.mark.parametrize('first, last', [
    ('one number', 'a list'), ('a list of one', 'one number'), ('a list', 'a list of one')])
def test_the_last_value_on_the_command_line_is_used(
        first: str, last: str, domain: int, tmp_path: Path) -> None:
    def source(value: Any, how: str) -> list[str]:
        if how == '-p':
            return ['-p', f'limits.force_max:={value}']
        file = tmp_path / f'{len(list(tmp_path.iterdir()))}.yaml'
        file.write_text(f'{how}:\n  ros__parameters:\n    limits: {{force_max: {value}}}\n')
        return ['--params-file', str(file)]

    for before, after in (('-p', '-p'), ('-p', '/**'), ('/**', '-p'), ('/**', '/**'),
                          ('stewart_dynamics', '-p'), ('stewart_dynamics', '/**')):
        arguments = ['--params-file', str(ROOT / 'config' / 'platform.yaml'),
                     *source(FORMS[first], before), *source(FORMS[last], after)]
        given, of_ros = force_max(arguments, domain)
        wanted = tuple(FORMS[last]) if isinstance(FORMS[last], list) else FORMS[last]
        assert (given, of_ros) == (wanted, wanted), f'{before}, then {after}'


def force_max(arguments: list[str], domain: int) -> tuple[Any, Any]:
    """Return limits.force_max of a node with a command line: as used, and as in ROS."""
    context = rclpy.Context()
    with patch.object(sys, 'argv', ['stewart_dynamics', '--ros-args', *arguments]):
        rclpy.init(args=sys.argv, context=context, domain_id=domain)
        node = Node('stewart_dynamics', context=context, allow_undeclared_parameters=True,
                    automatically_declare_parameters_from_overrides=True, enable_rosout=False,
                    start_parameter_services=False)
        try:
            given = declare_parameters(node, Parameters).given['limits.force_max']
            of_ros = node.get_parameter('limits.force_max').value
            return given, of_ros if isinstance(of_ros, float) else tuple(of_ros)
        finally:
            node.destroy_node()
            context.try_shutdown()


def test_the_trajectory_s_parameters_are_read_once(declared: Any) -> None:
    ask = declared(Node, ReferenceMotionParameters, 'trajectory_sine.yaml')
    for parameter, each in zip(ReferenceMotionParameters.table.values(), described(
            ask, *ReferenceMotionParameters.table), strict=True):
        assert each.read_only
        assert each.description.startswith(parameter.text)
        assert each.additional_constraints.endswith('set only when the node starts')
    (rate,) = described(ask, 'rate')
    assert rate.description == 'rate of the setpoints [Hz]'
    assert bounds(rate) == [(1e-3, 1e4, 0.0)]
    assert rate.additional_constraints == (
        'at least 0.001, at most 10000; set only when the node starts')
    for name, value, expected in (
            ('rate', 50.0, (False, 'rate: only read when the node starts: restart it')),
            ('rates', 50.0, (False, 'parameters: rates: unknown parameter; do you mean rate?')),
            ('use_sim_time', True, (True, ''))):
        assert set_to(ask, message(name, value)) == expected


NODES = pytest.mark.parametrize('kind, parameters, file, name, value', [
    (LifecycleNode, Parameters, 'platform.yaml', 'platform.mass', 150.0),
    (Node, ReferenceMotionParameters, 'trajectory_sine.yaml', 'rate', 100.0)],
    ids=['lifecycle', 'plain'])


@NODES
def test_a_parameter_type_that_does_not_exist_is_rejected(
        declared: Any, kind: Any, parameters: Any, file: str, name: str, value: float) -> None:
    ask = declared(kind, parameters, file)
    for number in (10, 77, 255):
        assert set_to(ask, ParameterMessage(
            name=name, value=ParameterValue(type=number))) == (
                False, f'{name}: parameter type {number} does not exist')


@NODES
def test_a_value_equal_to_the_present_one_is_no_change(
        declared: Any, kind: Any, parameters: Any, file: str, name: str, value: float) -> None:
    ask = declared(kind, parameters, file)
    same = [message(name, value), message('use_sim_time', False),
            # Read-only, and of ROS itself.
            message('start_type_description_service', True),
            # As `ros2 param load` sends them.
            message(name, f'{value:.5e}')]
    assert set_to(ask, *same) == (True, '')
    successful, reason = set_to(ask, *same, message('start_type_description_service', False))
    assert not successful
    assert 'read-only' in reason


def test_a_dump_can_be_loaded_again(declared: Any) -> None:
    ask = declared(LifecycleNode, Parameters, 'platform.yaml')
    # `ros2 param load` sends None for the null that `ros2 param dump` has written.
    inertia = [1e-5, 0.0, 0.0, 1e-5, 0.0, 1e-5]
    assert set_to(ask, message('external_wrench.force_max', 'None'),
                  message('platform.inertia', f'{inertia}')) == (True, '')
    assert set_to(ask, message('platform.inertia', inertia)) == (True, '')


@pytest.mark.parametrize('sec, nanosec', [(-5, 0), (2 ** 31 - 1, 2 ** 32 - 1), (5, 10 ** 9)])
def test_a_time_that_ros_cannot_hold_is_not_followed(
        domain: int, monkeypatch: pytest.MonkeyPatch, sec: int, nanosec: int) -> None:
    monkeypatch.setenv('ROS_DOMAIN_ID', f'{domain}')
    monkeypatch.setattr('rclpy.node.TimeSource', rclpy.node.TimeSource)
    context = rclpy.Context()
    rclpy.init(context=context)
    reject_impossible_times()
    node = Node('follower', context=context, parameter_overrides=[
        RosParameter('use_sim_time', value=True)])
    try:
        for time in ((7, 5), (sec, nanosec)):
            clock = Clock()
            clock.clock.sec, clock.clock.nanosec = time
            node._time_source.clock_callback(clock)
            assert node.get_clock().now().nanoseconds == 7_000_000_005
    finally:
        node.destroy_node()
        context.try_shutdown()


def test_null_in_a_file_is_a_parameter_not_given(declared: Any, tmp_path: Path) -> None:
    # As `ros2 param dump` writes parameters without a value.
    file = tmp_path / 'dump.yaml'
    text = (ROOT / 'config' / 'platform.yaml').read_text(encoding='utf-8')
    file.write_text(text.replace('force_max: 6000.0', 'force_max: null').replace(
        'base_frame: base', 'base_frame: ~') + '    external_wrench.force_max: null\n')
    assert Parameters.from_yaml(file)['limits.force_max'] is None
    ask = declared(LifecycleNode, Parameters, str(file))
    values = ask('get_parameters', GetParameters.Request(
        names=['limits.force_max', 'external_wrench.force_max', 'base_frame'])).values
    assert [value.type for value in values] == [
        ParameterType.PARAMETER_NOT_SET, ParameterType.PARAMETER_NOT_SET,
        ParameterType.PARAMETER_STRING]
    assert values[-1].string_value == 'base'


def test_a_file_for_another_node_is_named(declared: Any, tmp_path: Path) -> None:
    file = tmp_path / 'other.yaml'
    text = (ROOT / 'config' / 'platform.yaml').read_text(encoding='utf-8')
    file.write_text(text.replace('/**:', 'stewart_dynamic:'))
    with pytest.raises(ParameterError) as caught:
        declared(LifecycleNode, Parameters, str(file), 'base_frame:=world')
    assert str(caught.value) == (f"{file}: is for stewart_dynamic, not for '/stewart_dynamics': "
                                 "rename the section, or use '/**'")


def test_a_change_from_a_default_is_logged_with_it() -> None:
    before = symmetric_parameters()
    assert 'external_wrench.cutoff' not in before.given
    changed = before.replaced({'external_wrench.cutoff': 5.0})
    assert [text for _, text, _ in log_changes(before, changed)] == [
        'external_wrench.cutoff: 10.0 -> 5.0']
