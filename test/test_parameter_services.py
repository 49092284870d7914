# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""No request to a service of ROS ends a node, whatever names, types and counts are in it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import pytest
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters, GetParameters, GetParameterTypes, ListParameters, SetParameters,
    SetParametersAtomically)
from rclpy.task import Future
from running import Inside, Peer, PLATFORM, ROOT
from stewart_dynamics.node.dynamics_node import DynamicsNode
from stewart_dynamics.reference_motion.trajectory_node import TrajectoryNode
from stewart_dynamics.simulator.simulator_node import SimulatorNode
from type_description_interfaces.srv import GetTypeDescription

SERVICES: dict[str, Any] = {
    'get_parameters': GetParameters, 'get_parameter_types': GetParameterTypes,
    'describe_parameters': DescribeParameters, 'list_parameters': ListParameters,
    'set_parameters': SetParameters, 'set_parameters_atomically': SetParametersAtomically,
    'get_type_description': GetTypeDescription, 'change_state': ChangeState}
NAMES = (
    '', ' ', '.', 'base_frame', 'platform.mass', 'rate', 'platform', 'undeclared', 'use_sim_time',
    'start_type_description_service', 'qos_overrides./clock.subscription.depth', 'a\nb',
    '\u00e4 \u6f22 \U0001f980', 'x' * 10_000, '../' * 100, '%s {0}', 'base_frame\0')
VALUES: dict[str, Any] = {
    'bool_value': True, 'integer_value': -2 ** 63, 'double_value': float('nan'),
    'string_value': '\u6f22' * 1000, 'byte_array_value': [b'\0', b'\xff'],
    'bool_array_value': [True], 'integer_array_value': [2 ** 63 - 1],
    'double_array_value': [float('inf')] * 7, 'string_array_value': ['', 'x' * 1000]}
TYPES = (*range(11), 77, 255)  # as rcl_interfaces numbers them, and others

NODES = {
    'stewart_dynamics': (DynamicsNode, [PLATFORM]),
    'stewart_simulator': (SimulatorNode, [PLATFORM, ROOT / 'config' / 'simulator.yaml']),
    'stewart_trajectory': (TrajectoryNode, [ROOT / 'config' / 'trajectory_hold.yaml'])}


def requests() -> Iterator[tuple[str, Any]]:
    """Yield services and requests, the next one after the answer to the one before."""
    lists = [[], *([name] for name in NAMES), list(NAMES), ['base_frame', 'undeclared'],
             ['undeclared'] * 3000, ['base_frame'] * 3000]
    for names in lists:
        for service in ('get_parameters', 'get_parameter_types', 'describe_parameters'):
            yield service, SERVICES[service].Request(names=names)
        for depth in (0, 1, 2, 2 ** 64 - 1):
            yield 'list_parameters', ListParameters.Request(prefixes=names, depth=depth)
    for name in NAMES:
        for type_ in TYPES:
            message = Parameter(name=name, value=ParameterValue(type=type_, **VALUES))
            for service in ('set_parameters', 'set_parameters_atomically'):
                yield service, SERVICES[service].Request(parameters=[message] * (1 + type_ % 2))
    for count in (0, 3000):
        for service in ('set_parameters', 'set_parameters_atomically'):
            yield service, SERVICES[service].Request(parameters=[
                Parameter(name=f'undeclared_{n}') for n in range(count)])
    for name in NAMES:
        # rcl logs other hashes in lines of its own.
        yield 'get_type_description', GetTypeDescription.Request(
            type_name=name, type_hash='RIHS01_' + 64 * '0')
    for number, label in (*((number, '') for number in (0, 10, 60, 99, 255)), (0, 'undeclared')):
        yield 'change_state', ChangeState.Request(
            transition=Transition(id=number, label=label))


@pytest.mark.parametrize('name', NODES)
def test_no_request_ends_a_node(domain: int, name: str) -> None:
    kind: Callable[..., Any]
    kind, files = NODES[name]
    done = Future()
    if kind is TrajectoryNode:
        kind = partial(kind, done)
    arguments = ['--ros-args', *(part for file in files for part in ('--params-file', file))]
    program = Inside(kind, arguments, domain, done)
    peer = Peer(domain)
    peer.watched = program
    try:
        clients = {service: peer.node.create_client(kind, f'/{name}/{service}')
                   for service, kind in SERVICES.items()
                   if service != 'change_state' or name == 'stewart_dynamics'}
        for service, client in clients.items():
            peer.until(client.service_is_ready, f'{service} is there')

        def ask(service: str, request: Any) -> Any:
            future = clients[service].call_async(request)
            peer.until(future.done, f'{service} answers {str(request)[:200]}')
            return future.result()

        for service, request in requests():
            if service not in clients:
                continue
            answer = ask(service, request)
            if service.startswith('get_parameter') or service == 'describe_parameters':
                entries = getattr(answer, answer.__slots__[0].lstrip('_'))
                assert len(entries) == len(request.names), service
            if service == 'change_state':
                assert not answer.success, request
    finally:
        program.kill()
        peer.close()
