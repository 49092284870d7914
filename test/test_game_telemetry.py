# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Packets of games: axes, units and signs, and through the loopback to the topic."""

from __future__ import annotations

from pathlib import Path
import re
import socket
import struct
import sys
from typing import Any

import numpy as np
import pytest
from referees import ROOT
from snapshot import Snapshot
from stewart_dynamics.messages.received import ReceivedError

sys.path.insert(0, str(ROOT / 'examples'))
from game_telemetry import (  # noqa: E402, I100, I202
    GRAVITY, OutSim, outsim_rotation, to_vehicle, XPlane)


def outsim(milliseconds: int = 1000, turning: Any = (0.0,) * 3, angles: Any = (0.0,) * 3,
           acceleration: Any = (0.0,) * 3, identifier: bool = False) -> bytes:
    """Return a packet."""
    packet = struct.pack('<I12f3i', milliseconds, *turning, *angles, *acceleration, 1.0, 2.0, 3.0,
                         65536, 0, 0)
    return packet + struct.pack('<i', 7) * identifier


def xplane(*rows: tuple[int, list[float]]) -> bytes:
    """Return a packet."""
    return b'DATA*' + b''.join(
        struct.pack('<i8f', index, *values, *[0.0] * (8 - len(values))) for index, values in rows)


def test_outsim_at_rest_and_on_a_slope() -> None:
    """The specific force of a parked car is up, on a slope it is pushed forward or left."""
    force, turning = OutSim().read(outsim())
    np.testing.assert_allclose(force, [0.0, 0.0, GRAVITY], atol=1e-12)
    np.testing.assert_allclose(turning, 0.0)
    force, _ = OutSim().read(outsim(angles=(1.0, 0.1, 0.0), identifier=True))
    np.testing.assert_allclose(
        force, [GRAVITY * np.sin(0.1), 0.0, GRAVITY * np.cos(0.1)], atol=1e-6)
    # Rolled anticlockwise as seen from the front: the left side is up.
    force, _ = OutSim().read(outsim(angles=(2.0, 0.0, 0.1)))
    assert force[1] == pytest.approx(np.sin(0.1) * GRAVITY, abs=1e-6)


def test_outsim_acceleration_is_of_the_world() -> None:
    """A car that heads to -x, heading 90 degrees, and accelerates there."""
    force, turning = OutSim().read(outsim(
        angles=(np.pi / 2.0, 0.0, 0.0), acceleration=(-3.0, 1.0, 0.5), turning=(0.1, 0.2, 0.3)))
    np.testing.assert_allclose(force, [3.0, -1.0, GRAVITY + 0.5][0:1] + [-1.0, GRAVITY + 0.5],
                               atol=1e-6)
    np.testing.assert_allclose(turning, [-0.1, -0.2, 0.3], atol=1e-6)
    rotation = outsim_rotation(0.4, 0.2, -0.3)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)


def test_xplane_is_in_g_and_degrees() -> None:
    """Normal, axial and side in g; roll, pitch and yaw in deg/s, before 12 in rad/s."""
    g_load = (4, [0.5, 0.0, 100.0, 0.0, 1.2, 0.1, -0.2])
    force, turning = XPlane(12).read(xplane(g_load, (16, [10.0, 20.0, 30.0])))
    np.testing.assert_allclose(force, GRAVITY * np.array([0.1, 0.2, 1.2]), rtol=1e-6)
    np.testing.assert_allclose(np.degrees(turning), [10.0, -20.0, -30.0], rtol=1e-6)
    reader = XPlane(11)
    assert reader.read(xplane((16, [0.2, 0.1, 0.3]))) is None  # the g-load comes in another packet
    _, turning = reader.read(xplane(g_load))
    np.testing.assert_allclose(turning, [0.1, -0.2, -0.3], rtol=1e-6)


def test_left_handed_axes_turn_the_other_way() -> None:
    """X right, y up, z forward, as in many engines: a positive yaw there is to the right."""
    axes = ((2, 1.0), (0, -1.0), (1, 1.0))
    np.testing.assert_allclose(to_vehicle([1.0, 2.0, 3.0], axes), [3.0, -1.0, 2.0])
    np.testing.assert_allclose(to_vehicle([0.0, 0.5, 0.0], axes, axial=True), [0.0, 0.0, -0.5])


@pytest.mark.parametrize('reader, packet', [
    (OutSim(), b''), (OutSim(), bytes(272)), (XPlane(12), b'RREF,' + bytes(36)),
    (XPlane(12), b'DATA*'), (XPlane(12), b'DATA*' + bytes(35))])
def test_other_packets_are_rejected(reader: Any, packet: bytes, snapshot: Snapshot) -> None:
    with snapshot.raises(ReceivedError):
        reader.read(packet)


def test_old_packets_are_dropped() -> None:
    reader = OutSim()
    assert reader.read(outsim(1000)) is not None
    assert reader.read(outsim(990)) is None
    assert reader.read(outsim(1010)) is not None
    assert reader.read(outsim(0)) is not None  # the game was restarted


def test_over_the_loopback(domain: int, tmp_path: Path) -> None:
    """Packets of a game become messages; a malformed one is named and dropped."""
    from rclpy.serialization import deserialize_message
    from running import Peer, Program
    from sensor_msgs.msg import Imu
    peer = Peer(domain)
    received = peer.listen('/stewart_cueing/vehicle', Imu)
    program = Program([sys.executable, ROOT / 'examples' / 'game_telemetry.py', 'outsim',
                       '--port', '0', '--address', '127.0.0.1'], domain, tmp_path / 'run')
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        peer.watched = program
        peer.until(lambda: re.search(r'127\.0\.0\.1:\d+', program.stderr), 'it listens')
        port = int(re.findall(r'127\.0\.0\.1:(\d+)', program.stderr)[0])
        clock = [1000]

        def sent() -> bool:
            clock[0] += 16
            sender.sendto(b'noise', ('127.0.0.1', port))
            sender.sendto(outsim(clock[0], acceleration=(0.0, 2.0, 0.0)), ('127.0.0.1', port))
            return len(received) > 2

        peer.until(sent, 'messages come')
        message = deserialize_message(received[-1], Imu)
        assert message.linear_acceleration.x == pytest.approx(2.0)
        assert message.linear_acceleration.z == pytest.approx(GRAVITY)
        assert message.header.stamp.sec > 0
        assert '5 bytes: must be 64' in program.stderr
    finally:
        sender.close()
        program.kill()
        peer.close()
