# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Recordings passed to subscribers: the one loop that reads them."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import messages
from referees import ROOT

import stewart_dynamics
from stewart_dynamics.bags.feed import feed_subscribers, read_all, Subscription
from stewart_dynamics.bags.recording import Recording
from stewart_dynamics.messages.recorded import Messages

POSE, TWIST = '/stewart_dynamics/setpoint/pose', '/stewart_dynamics/setpoint/twist'
ACCEL, IMU = '/stewart_dynamics/setpoint/accel', '/stewart_dynamics/base/imu'


def test_subscribers_get_their_messages_in_recorded_order() -> None:
    poses: list[tuple[str, int, bytes]] = []
    others: list[tuple[str, int, bytes]] = []
    whole: list[tuple[str, int, bytes]] = []
    with closing(Recording(ROOT / 'bags' / 'flawed')) as recording:
        for messages_, _ in recording.messages({POSE: 'p', TWIST: 't', ACCEL: 'a'}):
            whole += messages_.iterate_messages()
        sizes = list(feed_subscribers(recording, [
            Subscription({POSE: 'p'}, lambda found: poses.extend(found.iterate_messages())),
            Subscription({TWIST: 't', ACCEL: 'a'},
                         lambda found: others.extend(found.iterate_messages()))]))
    assert sum(sizes) > 0
    assert poses == [each for each in whole if each[0] == 'p']
    assert others == [each for each in whole if each[0] != 'p']
    assert {each[0] for each in others} == {'t', 'a'}


def test_blocks_without_a_subscribers_messages_are_not_passed_to_it() -> None:
    called: list[Messages] = []
    with closing(Recording(ROOT / 'bags' / 'clear')) as recording:
        read_all(recording, [Subscription({POSE: 'p'}, lambda found: None),
                             Subscription({IMU: 'imu'}, called.append)])
    assert not called


def test_all_messages_of_a_block_are_passed_without_a_copy() -> None:
    found = messages.together([('p', b'12345'), ('p', b'678')], ['p', 't'])
    assert found.select_topics({'p', 't'}) is found
    assert found.select_topics({'p'}) is found
    assert not len(found.select_topics({'t'}).times)


def test_recordings_are_read_by_no_other_loop() -> None:
    package = Path(stewart_dynamics.__file__).parent
    loops = [str(file.relative_to(package)) for file in package.rglob('*.py')
             if 'recording.messages(' in file.read_text(encoding='utf-8')]
    assert loops == ['bags/feed.py']
