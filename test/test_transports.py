# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The transports that the programs choose: no shared memory, unless the user has chosen."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path

import pytest
from running import executable, Peer, PLATFORM, Program
from sensor_msgs.msg import JointState
from stewart_dynamics.ros.security import BUILTIN_TRANSPORTS, PROFILES, RANGE
from stewart_dynamics.ros.transports import leave_shared_memory, ONE_HOST

NAMES = (BUILTIN_TRANSPORTS, RANGE, 'FASTRTPS_DEFAULT_PROFILES_FILE',
         'FASTDDS_DEFAULT_PROFILES_FILE', 'ROS_LOCALHOST_ONLY', 'ROS_STATIC_PEERS')


@pytest.fixture
def chosen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., dict[str, str]]:
    """Return a function that gives the variables which a program has with those of a user."""
    monkeypatch.chdir(tmp_path)

    def choose(**given: str) -> dict[str, str]:
        for name in NAMES:
            monkeypatch.setenv(name, given.get(name, ''))
            if name not in given:
                monkeypatch.delenv(name)
        leave_shared_memory()
        return {name: os.environ[name] for name in NAMES if name in os.environ}

    return choose


def test_programs_use_udp_with_the_reach_that_was_asked_for(
        chosen: Callable[..., dict[str, str]]) -> None:
    for reach in ('', 'SUBNET', 'SYSTEM_DEFAULT', 'OFF'):
        given = {RANGE: reach} if reach else {}
        assert chosen(**given) == {**given, BUILTIN_TRANSPORTS: 'UDPv4'}
    one_host = {PROFILES: str(ONE_HOST), RANGE: 'SYSTEM_DEFAULT'}
    for name, value in ((RANGE, 'LOCALHOST'), (RANGE, 'misspelt'), ('ROS_LOCALHOST_ONLY', '1')):
        assert chosen(**{name: value}) == one_host


def test_transports_of_the_user_are_left_as_they_are(
        chosen: Callable[..., dict[str, str]], tmp_path: Path) -> None:
    for given in ({BUILTIN_TRANSPORTS: 'DEFAULT'}, {PROFILES: '/mine.xml'},
                  {RANGE: 'LOCALHOST', 'ROS_STATIC_PEERS': '192.168.1.2'},
                  {RANGE: 'LOCALHOST', BUILTIN_TRANSPORTS: 'DEFAULT'}):
        assert chosen(**given) == given
    (tmp_path / 'DEFAULT_FASTRTPS_PROFILES.xml').touch()
    assert chosen() == {}


@pytest.mark.parametrize(('given', 'shares'), [
    ({}, False), ({BUILTIN_TRANSPORTS: 'DEFAULT'}, True)])
def test_a_program_without_shared_memory_reaches_programs_with_it(
        domain: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: dict[str, str],
        shares: bool) -> None:
    monkeypatch.delenv(PROFILES)  # of the tests
    peer = Peer(domain)  # with the transports of ROS
    states = peer.listen('/stewart_simulator/leg_states', JointState)
    program = Program([executable('stewart_simulator'), '--ros-args', '--params-file', PLATFORM,
                       '-p', 'initial_pose:=[0.0, 0.0, 1.1, 0.0, 0.0, 0.0]', '-p', 'rate:=100.0'],
                      domain, tmp_path, **given)
    peer.watched = program
    try:
        peer.until(lambda: len(states) > 10, 'it is heard')
        maps = (Path('/proc') / str(program.process.pid) / 'maps').read_text()
        assert ('/dev/shm/fastrtps' in maps or '/dev/shm/fastdds' in maps) == shares
    finally:
        program.kill()
        peer.close()
