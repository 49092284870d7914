# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Whatever comes from a network: the one check, and that no example ends or hangs by it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from http.client import HTTPConnection
import json
from pathlib import Path
import re
import signal
import socket
import struct
import sys
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import (
    AccelStamped, Point, PoseStamped, TwistStamped, Vector3, Wrench, WrenchStamped)
import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from running import Peer, PLATFORM, Program, ROOT
from sensor_msgs.msg import Imu, JointState
from snapshot import Snapshot
from std_msgs.msg import ColorRGBA, Float64MultiArray
from stewart_dynamics.messages.received import (
    checked_joints, checked_numbers, ReceivedError, shown_text)
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from visualization_msgs.msg import Marker, MarkerArray

NAN, INF = float('nan'), float('inf')
NAMES = [f'leg_{n}' for n in range(1, 7)]
SIX = [0.1] * 6
ESCAPES = '\x1b]0;owned\x07\x1b[2J\n<script>'

Run = Callable[..., Program]


@pytest.fixture
def run(peer: Peer, tmp_path: Path) -> Iterator[Run]:
    """Return a function that starts an example; it ends with the test."""
    programs: list[Program] = []

    def begin(name: str, *arguments: object) -> Program:
        programs.append(Program(
            [sys.executable, ROOT / 'examples' / name, *map(str, arguments)], peer.domain,
            tmp_path / f'example_{len(programs)}', PYTHONUNBUFFERED='1'))
        peer.watched = programs[-1]
        return programs[-1]

    yield begin
    for program in programs:
        program.kill()


# The check

@pytest.mark.parametrize('values', [[1.0], [1.0, NAN], [1.0, INF], [1.0, -1e300]])
def test_numbers_that_cannot_be_used_are_rejected(
        values: list[float], snapshot: Snapshot) -> None:
    assert checked_numbers('pair', (1, 2.5), 2) == [1.0, 2.5]
    with snapshot.raises(ReceivedError):
        checked_numbers('pair', values, 2)


@pytest.mark.parametrize('state', [
    {'name': NAMES[:5], 'position': SIX[:5]}, {'name': NAMES, 'position': SIX[:5]},
    {'name': NAMES, 'position': [*SIX[:5], NAN]}, {}], ids=['names', 'numbers', 'nan', 'empty'])
def test_joints_that_cannot_be_used_are_rejected(
        state: dict[str, Any], snapshot: Snapshot) -> None:
    found = checked_joints(JointState(name=['wheel', *NAMES], position=[NAN, *SIX]), NAMES)
    assert found == {'position': SIX}
    with snapshot.raises(ReceivedError):
        checked_joints(JointState(**state), NAMES)


def test_a_text_is_shown_in_one_printable_line() -> None:
    assert shown_text('leg_1: 3.5 °C') == 'leg_1: 3.5 °C'
    assert shown_text(ESCAPES).isprintable()
    assert len(shown_text('x' * 10**6)) == 1000


# The examples

def hostile_joints() -> list[JointState]:
    """Return messages that a controller or a planner may get."""
    return [JointState(), JointState(name=NAMES), JointState(name=NAMES, position=SIX[:5]),
            JointState(name=NAMES, position=[INF] * 6, velocity=SIX, effort=SIX),
            JointState(name=NAMES, position=SIX, velocity=[NAN] * 6, effort=SIX),
            JointState(name=NAMES, position=SIX, velocity=SIX, effort=SIX[:2]),
            JointState(name=[ESCAPES] * 6, position=SIX, velocity=SIX, effort=SIX),
            JointState(name=NAMES, position=[1e308] * 6, velocity=[1e308] * 6,
                       effort=[1e308] * 6)]


def hostile_diagnostics() -> list[DiagnosticArray]:
    """Return messages with levels, names and texts that no node publishes."""
    return [DiagnosticArray(status=[DiagnosticStatus(
        level=level, name=f'stewart_dynamics: {name}', message=ESCAPES,
        values=[KeyValue(key=ESCAPES, value=ESCAPES), *values])])
        for level in (b'\0', b'\7', b'\xff') for name in ('', ESCAPES, 'planned trajectory')
        for values in ([], [KeyValue(key='rejected', value='many')])]


def hostile_trajectories() -> list[JointTrajectory]:
    """Return answers that no node gives."""
    return [JointTrajectory(), JointTrajectory(joint_names=NAMES),
            *(JointTrajectory(joint_names=NAMES, points=[JointTrajectoryPoint(**point)])
              for point in ({}, {'positions': [NAN] * 6},
                            {'positions': SIX, 'effort': [INF]}))]


def hostile_markers() -> list[MarkerArray]:
    """Return pictures without parts of the hexapod, or with numbers that cannot be drawn."""
    def picture(*without: str, x: float = 0.0, count: int = 6) -> MarkerArray:
        points = [Point(x=x)] * count
        parts = [('platform', 1), ('base', 1), ('singularity', 0), *(
            (part, n) for part in ('names', 'pistons') for n in range(6))]
        return MarkerArray(markers=[
            Marker(ns=name, id=n, points=points, text=ESCAPES, color=ColorRGBA(r=0.5))
            for name, n in parts if name not in without])

    return [MarkerArray(), picture('platform'), picture('names'), picture(x=NAN),
            picture(count=2), picture()]


SENT: dict[str, tuple[Any, Callable[[], list[Any]]]] = {
    '/stewart_simulator/leg_states': (JointState, hostile_joints),
    '/stewart_dynamics/leg_states': (JointState, hostile_joints),
    '/stewart_dynamics/measured_legs': (JointState, hostile_joints),
    '/diagnostics': (DiagnosticArray, hostile_diagnostics),
    '/stewart_dynamics/markers': (MarkerArray, hostile_markers),
    '/stewart_dynamics/leg_trajectory': (JointTrajectory, hostile_trajectories),
    '/stewart_dynamics/travel': (Float64MultiArray, lambda: [
        Float64MultiArray(data=data) for data in ([], [1.0], *(
            [number] * 12 for number in (NAN, -1.0, INF)))]),
    '/stewart_dynamics/external_wrench': (WrenchStamped, lambda: [
        WrenchStamped(wrench=Wrench(force=Vector3(x=NAN))), WrenchStamped()]),
    **{f'/stewart_simulator/base/{name}': (kind, lambda kind=kind: [kind(), kind()])
       for name, kind in (('pose', PoseStamped), ('twist', TwistStamped),
                          ('accel', AccelStamped))},
}


@pytest.mark.slow
@pytest.mark.parametrize(('name', 'arguments'), [
    ('leg_controller.py', ['--ros-args', '-p', f'params_file:={PLATFORM}']),
    ('leg_controller.py', ['--ros-args', '-p', 'use_sim_time:=true']),
    ('motion_compensation.py', ['--ros-args', '-p', 'position:=[0.0, 0.0, 1.1]']),
    ('live_view.py', ['--port', '0']),
    ('show_diagnostics.py', ['--values']),
    ('show_travel.py', []),
    ('push_platform.py', ['--timeout', '1000.0']),
    ('stream_setpoints.py', ['--timeout', '1000.0']),
    ('plan_motion.py', ['--timeout', '1000.0'])])
def test_no_message_ends_an_example_or_keeps_it_from_ending(
        peer: Peer, run: Run, name: str, arguments: list[str]) -> None:
    program = run(name, *arguments)
    writers = {topic: peer.writer(topic, kind) for topic, (kind, _) in SENT.items()}
    commands = peer.listen('/stewart_simulator/commands', Float64MultiArray)
    peer.until(lambda: any(each.get_subscription_count() for each in writers.values()),
               'it subscribes')
    for _ in range(3):
        for topic, (_, messages) in SENT.items():
            for message in messages():
                writers[topic].publish(message)
        peer.spin(0.2)
    assert not program.ended, program.stderr
    assert program.stop(signal.SIGTERM) in (0, -signal.SIGTERM), program.stderr
    assert 'Traceback' not in program.stderr
    assert '\x1b]' not in program.stdout + program.stderr
    assert not [data for data in commands if not _finite(data)]


def _finite(data: bytes) -> bool:
    return bool(np.isfinite(deserialize_message(data, Float64MultiArray).data).all())


@pytest.mark.slow
def test_the_page_is_for_browsers_of_this_computer(peer: Peer, run: Run) -> None:
    """Names that point here by other means, and pages from elsewhere, get nothing."""
    program = run('live_view.py', '--port', '0')
    peer.until(lambda: 'http' in program.stdout, 'the page is served')
    port = int(re.findall(r':(\d+)/', program.stdout)[0])
    own = f'127.0.0.1:{port}'
    socket_headers = {'Upgrade': 'websocket', 'Connection': 'Upgrade',
                      'Sec-WebSocket-Version': '13', 'Sec-WebSocket-Key': 'x' * 22 + '=='}

    def status(path: str, **headers: str) -> int:
        with closing(HTTPConnection('127.0.0.1', port, timeout=60.0)) as connection:
            connection.request('GET', path, headers={
                **(socket_headers if path == '/live' else {}), **headers})
            return connection.getresponse().status

    for path, found in (('/', 200), ('/live', 101)):
        assert status(path, Host=own) == found
        assert status(path, Host=f'localhost:{port}', Origin=f'http://localhost:{port}') == found
        for host, origin in ((f'evil.example:{port}', ''), (own, 'http://evil.example'),
                             (own, f'http://127.0.0.1:{port + 1}'), (own, 'null'),
                             (f'127.0.0.1.evil.example:{port}', '')):
            assert status(path, Host=host, **({'Origin': origin} if origin else {})) == 403
    with socket.create_connection(('127.0.0.1', port)) as silent:  # asks for nothing
        silent.sendall(b'\0\xff' * 10)
        assert program.stop(signal.SIGTERM) == 0, program.stderr
    assert 'Traceback' not in program.stderr


@pytest.mark.slow
def test_a_picture_after_messages_that_were_dropped(peer: Peer, run: Run) -> None:
    """An unknown level is shown as such, and the JSON is that of a browser."""
    websockets = pytest.importorskip('websockets.sync.client')
    program = run('live_view.py', '--port', '0')
    markers = peer.writer('/stewart_dynamics/markers', MarkerArray)
    diagnostics = peer.writer('/diagnostics', DiagnosticArray)
    peer.until(lambda: 'http' in program.stdout and markers.get_subscription_count()
               and diagnostics.get_subscription_count(), 'it subscribes')
    port = re.findall(r':(\d+)/', program.stdout)[0]

    def warned() -> bool:
        markers.publish(next(iter(hostile_markers())))
        peer.spin()
        return 'markers dropped: lacks ' in program.stderr

    # Alone: of several that come at once it hears the last one, and it warns once in 5 s.
    peer.until(warned, 'it warns')
    with websockets.connect(f'ws://127.0.0.1:{port}/live') as page:
        def shown() -> bool:
            for message in hostile_diagnostics():
                diagnostics.publish(message)
            for message in hostile_markers():
                markers.publish(message)
            peer.spin(0.1)
            try:
                text = page.recv(timeout=0.1)
            except TimeoutError:
                return False
            found = json.loads(text, parse_constant=pytest.fail)
            return found.get('statuses', {}).get('planned trajectory', [''])[0] == '?'

        peer.until(shown, 'it is shown')


@pytest.mark.slow
def test_no_packet_ends_the_telemetry_of_a_game(peer: Peer, run: Run) -> None:
    """Infinite, huge and wrong numbers are dropped, and the next packet of the game is used."""
    received = peer.listen('/stewart_cueing/vehicle', Imu)
    program = run('game_telemetry.py', 'outsim', '--port', '0')
    peer.until(lambda: re.search(r'127\.0\.0\.1:\d+', program.stderr), 'it listens here alone')
    port = int(re.findall(r'127\.0\.0\.1:(\d+)', program.stderr)[0])
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as sender:
        time = [1000]

        def packet(place: int = -1, number: float = 0.0) -> bytes:
            time[0] += 16
            numbers = [0.0] * 12
            if place >= 0:
                numbers[place] = number
            return struct.pack('<I12f3i', time[0], *numbers, 0, 0, 0)

        def sent() -> bool:
            for place in range(9):
                for number in (INF, -INF, NAN, 3e38):
                    sender.sendto(packet(place, number), ('127.0.0.1', port))
            sender.sendto(packet(), ('127.0.0.1', port))
            peer.spin(0.1)
            return len(received) > 2

        peer.until(sent, 'messages come')
    assert 'packet dropped (1 so far): OutSim: inf: must be finite' in program.stderr
    assert program.stop(signal.SIGTERM) == 0, program.stderr
