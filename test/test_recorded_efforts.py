# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Efforts in recorded JointState messages: any layout, any order of names, damaged bytes."""

from __future__ import annotations

from collections.abc import Sequence
import math

from hypothesis import given
from hypothesis import strategies as st
import messages as of_ros
from messages import STORE
import numpy as np
from referees import rng
from snapshot import Snapshot

from stewart_dynamics.errors import BagError
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.replay.residuals import Efforts

PROGRAM = 'stewart_replay'

SECOND = 1_000_000_000
JOINTS = [f'leg_{n}' for n in range(1, 7)]


def joint_state(stamp: int, names: Sequence[str], effort: Sequence[float], frame: str = '',
                positions: int = 0, velocities: int = 0, little_endian: bool = True) -> bytes:
    """Return a JointState with these numbers of positions and velocities."""
    return of_ros.joint_state(
        stamp, names, np.arange(positions), np.arange(velocities), effort, frame, little_endian)


def joined(messages: Sequence[bytes]) -> Messages:
    """Return messages in one buffer, with bytes between them that are of no message."""
    data, starts = b'', []
    for number, message in enumerate(messages):
        data += bytes(number % 3 + 1)
        starts.append(len(data))
        data += message
    places = np.zeros(len(messages), np.int64)
    return Messages(('legs',), places, places, np.frombuffer(data, np.uint8),
                    np.array(starts, np.int64),
                    np.array([len(message) for message in messages], np.int64))


@given(st.data())
def test_efforts_are_what_rosbags_wrote(data: st.DataObject) -> None:
    text = st.text(st.characters(codec='utf-8', exclude_characters='\0'), max_size=12)
    numbers = st.floats(-1e9, 1e9)
    more = data.draw(st.lists(text.filter(lambda name: name not in JOINTS), max_size=4))
    messages, expected = [], []
    for _ in range(data.draw(st.integers(1, 4))):
        # a layout, and a few messages of it
        names = data.draw(st.permutations([*JOINTS, *more]))
        frame, little = data.draw(text), data.draw(st.booleans())
        counts = data.draw(st.sampled_from([(0, 0), (len(names), 0), (len(names), len(names))]))
        for _ in range(data.draw(st.integers(1, 4))):
            stamp = data.draw(st.integers(-2 ** 31 * SECOND, 2 ** 31 * SECOND - 1))
            effort = data.draw(st.lists(numbers, min_size=len(names), max_size=len(names)))
            messages.append(joint_state(stamp, names, effort, frame, *counts, little))
            expected.append((stamp, [effort[names.index(joint)] for joint in JOINTS]))
    stamps, efforts, rejected = Efforts(JOINTS).read_efforts(joined(messages))
    assert stamps.tolist() == [stamp for stamp, _ in expected]
    assert efforts.tolist() == [effort for _, effort in expected]
    assert rejected == {}


def test_many_layouts_in_many_calls_keep_their_order() -> None:
    # more layouts than are kept, each in every call
    efforts = Efforts(JOINTS)
    for call in range(3):
        messages = [joint_state(call * 100 + n, [*JOINTS, 'x' * (n % 12)], [float(n)] * 7)
                    for n in range(60)]
        stamps, read, rejected = efforts.read_efforts(joined(messages))
        assert stamps.tolist() == [call * 100 + n for n in range(60)]
        assert read[:, 0].tolist() == [float(n) for n in range(60)]
        assert rejected == {}


def test_messages_without_valid_efforts_are_rejected_and_counted() -> None:
    good = joint_state(7, JOINTS, range(6))
    bad = {
        'without effort': [joint_state(1, JOINTS, [], positions=6)] * 2,
        'not as many numbers as names': [joint_state(1, JOINTS, range(5)),
                                         joint_state(1, JOINTS, range(7)),
                                         joint_state(1, [*JOINTS, 'more'], range(6))],
        'not finite': [joint_state(1, JOINTS, [0, 1, 2, value, 4, 5])
                       for value in (math.nan, math.inf, -math.inf)],
        'lacks one of the joints': [joint_state(1, ['gripper'], [1.0]),
                                    joint_state(1, JOINTS[:5], range(5)),
                                    joint_state(1, [], [])],
        'malformed': [b'', b'\0', good[:20], good[:-1], b'\0\2' + good[2:], b'\1' + good[1:],
                      good[:8] + (SECOND).to_bytes(4, 'little') + good[12:]],
    }
    messages = [good]
    for each in bad.values():
        messages += [*each, good]
    for turn in (1, -1):
        stamps, efforts, rejected = Efforts(JOINTS).read_efforts(joined(messages[::turn]))
        assert stamps.tolist() == [7] * 6
        assert efforts.tolist() == [[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]] * 6
        assert rejected == {reason: len(each) for reason, each in bad.items()}


def test_numbers_of_joints_that_are_not_asked_for_may_be_anything() -> None:
    message = joint_state(7, ['gripper', *JOINTS], [math.nan, *range(6)])
    _, efforts, rejected = Efforts(JOINTS).read_efforts(joined([message]))
    assert efforts.tolist() == [[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]]
    assert rejected == {}


def test_padding_bytes_are_ignored() -> None:
    names = [f'{joint}x' for joint in JOINTS]
    good = joint_state(7, names, range(6), 'base')
    # rclpy leaves in gaps what the memory held: every byte that no field takes may be anything.
    # The zero at the end of a text is part of it, which not every version of rosbags looks at.
    ends = {at for at in range(len(good)) if good[:at].endswith((b'base', b'x'))}
    efforts = Efforts(names)
    efforts.read_efforts(joined([good]))
    gaps = 0
    for at in sorted({*range(2, len(good))} - ends):
        damaged = good[:at] + bytes([good[at] ^ 0xff]) + good[at + 1:]
        try:
            read = STORE.deserialize_cdr(damaged, 'sensor_msgs/msg/JointState')
            same = (list(read.name) == names and list(read.effort) == list(range(6))
                    and read.header.stamp.nanosec == 7 and read.header.frame_id == 'base'
                    and not len(read.position) and not len(read.velocity))
        except Exception:  # rosbags lets bare errors through
            continue
        if same:
            gaps += 1
            _, numbers, rejected = efforts.read_efforts(joined([damaged]))
            assert numbers.tolist() == [[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]] and not rejected
    assert gaps > 6


def test_damaged_bytes_never_raise() -> None:
    random = rng()
    good = joint_state(7, ['a', *JOINTS], range(7), 'base', positions=7)
    messages = []
    for _ in range(2000):
        message = bytearray(good)
        for at in random.integers(0, len(good), random.integers(1, 4)):
            message[at] = random.integers(0, 256)
        messages.append(bytes(message[:random.integers(0, len(good) + 1)]
                              if random.random() < 0.3 else message))
    # the good one first: else it could be that none has all the joints
    stamps, efforts, rejected = Efforts(JOINTS).read_efforts(joined([good, *messages]))
    assert len(stamps) + sum(rejected.values()) == 2001
    assert np.isfinite(efforts).all()
    assert stamps[0] == 7


def test_a_joint_in_no_message_is_named(snapshot: Snapshot) -> None:
    names = ['leg_1', 'leg_2', 'leg_3', 'leg_4', 'leg_5', 'cylinder_6']
    efforts = Efforts(JOINTS)
    stamps, _, rejected = efforts.read_efforts(joined([joint_state(1, names, range(6))]))
    assert not len(stamps) and rejected == {'lacks one of the joints': 1}
    with snapshot.raises(BagError):
        efforts.check()
    # also before the end of the bag
    with snapshot.raises(BagError):
        efforts.read_efforts(joined([joint_state(1, names, range(6))] * 1000))


def test_joints_of_another_publisher_are_not_an_error() -> None:
    efforts = Efforts(JOINTS)
    other = joint_state(1, ['gripper'], [2.0])
    efforts.read_efforts(joined([other] * 500))
    stamps, _, _ = efforts.read_efforts(joined([*[other] * 800, joint_state(1, JOINTS, range(6))]))
    assert len(stamps) == 1
    efforts.read_efforts(joined([other] * 2000))
    efforts.check()


def test_no_messages_give_nothing() -> None:
    efforts = Efforts(JOINTS)
    stamps, values, rejected = efforts.read_efforts(joined([]))
    assert stamps.shape == (0,) and values.shape == (0, 6) and rejected == {}
    efforts.check()
