# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Motors over real topics: the node's states, torques and limits, and the simulator's commands."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from running import DynamicsNode, ERROR, MOVING, NODE, OK, PLATFORM, Sample
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from stewart_dynamics import Parameters, StewartPlatform
from test_simulator_node import begin, SIMULATOR, stamp_of, STEPPED  # noqa: F401

DRIVES = {
    'actuator.reflected_mass': None, 'actuator.screw_lead': 0.01, 'drive.gear_ratio': 2.0,
    'drive.motor_inertia': 2e-5, 'drive.efficiency': 0.9, 'drive.torque_max': 1.5,
    'drive.speed_max': 600.0, 'drive.torque_constant': 0.4, 'drive.resistance': 1.0,
    'drive.thermal_resistance': 1.2, 'drive.thermal_time_constant': 600.0}
# 3 g upward, and a leg rate of 0.49 m/s: 616 rad/s.
LEAPING = Sample(accel=(0.0, 0.0, 30.0, 0.0, 0.0, 0.0))
FAST = Sample(twist=(0.0, 0.0, 0.56, 0.0, 0.0, 0.0))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Return a parameter file with drives."""
    path = tmp_path / 'drives.yaml'
    Parameters.from_yaml(PLATFORM).replaced(DRIVES).to_yaml(path)
    return path


def test_the_node_publishes_the_motors_and_checks_their_limits(
        start: Callable[..., DynamicsNode], file: Path) -> None:
    node = start(file=file)
    states = node.peer.listen(f'{NODE}/motor_states', JointState)
    torques = node.peer.listen(f'{NODE}/motor_torques', Float64MultiArray)
    node.until_active()
    platform = StewartPlatform.from_yaml(file)
    for n, sample in enumerate((MOVING, LEAPING, FAST), start=1):
        stamp = node.send(sample)
        node.until(  # type: ignore[misc]
            lambda n=n: min(len(torques), len(states)) >= n, 'torques and states have come')
        motors = platform.motors(sample.motion())
        state = deserialize_message(states[-1], JointState)
        assert state.header.stamp.sec == stamp // 10 ** 9
        assert state.name == [f'leg_{leg}_motor' for leg in range(1, 7)]
        assert tuple(state.position) == tuple(motors.angles)
        assert tuple(state.velocity) == tuple(motors.speeds)
        clipped = np.clip(motors.torques, -1.5, 1.5)
        assert tuple(state.effort) == tuple(clipped)
        assert tuple(deserialize_message(torques[-1], Float64MultiArray).data) == tuple(clipped)
        if sample is MOVING:
            node.until(lambda: 'leg_1: motor speed (rad/s)' in node.values('limits'),
                       'diagnostics have the motors')
            node.until_status('limits', OK, '')
            values = node.values('limits')
            assert values['leg_1: motor speed (rad/s)'] == f'{motors.speeds[0]:.6g}'
            assert 'leg_6: temperature rise (K)' in values
        elif sample is LEAPING:
            assert np.abs(motors.torques).max() > 1.5
            words = node.until_status('limits', ERROR, 'above drive.torque_max, clipped')
            leg = int(np.argmax(np.abs(motors.breakaway_torques)))
            assert f'leg_{leg + 1}: motor torque ' in words
        else:
            words = node.until_status('limits', ERROR, 'rad/s above drive.speed_max')
            assert 'motor speed ' in words


def test_the_simulator_takes_torques_and_gives_motor_states(
        begin: Callable[..., object], file: Path) -> None:  # noqa: F811
    from test_simulator_node import FILE
    simulator = begin(STEPPED, 'commands:=torque', files=(file, FILE))
    states = simulator.peer.listen(f'{SIMULATOR}/motor_states', JointState)
    simulator.until(lambda: states, 'motor states come')  # the first is repeated until a command
    platform = StewartPlatform.from_yaml(file)
    home = simulator.last('pose').pose.position
    from stewart_dynamics import Motion
    torques = platform.motors(Motion([home.x, home.y, home.z], np.eye(3))).torques
    simulator.step(torques)
    stamp = simulator.step(2.0 * torques)
    simulator.until(lambda: stamp_of(states[-1]) == stamp, 'motor states have come')
    state = deserialize_message(states[-1], JointState)
    assert state.name[0] == 'leg_1_motor'
    np.testing.assert_allclose(state.effort, 2.0 * torques, rtol=1e-12)
    leg = simulator.last()
    ratio = 2.0 * np.pi * 2.0 / 0.01
    np.testing.assert_allclose(state.position, ratio * np.array(leg.position), rtol=1e-9)
    np.testing.assert_allclose(state.velocity, ratio * np.array(leg.velocity), atol=1e-9)
    assert min(leg.velocity) > 0.0
    simulator.step(100.0 * torques)
    line = simulator.until_said('WARN', 'exceeds drive.torque_max or drive.torque_speed')
    assert 'N m exceeds' in line and 'clipped to 1.5 N m' in line
