# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Measured legs in parts: messages or topics of one leg each, or of some, with own stamps."""

from __future__ import annotations

from collections.abc import Sequence
import json
from pathlib import Path
import pickle

from messages import setpoints, write_bag
import numpy as np
from programs import call
import pytest
from referees import PLATFORM, rng
from snapshot import Snapshot

from stewart_dynamics import Motion, StewartPlatform
from stewart_dynamics.arrays import Array, NO_WRENCH
from stewart_dynamics.errors import BagError
from stewart_dynamics.external_wrench.estimate import ExternalWrench
from stewart_dynamics.external_wrench.measured_legs import MeasuredLegs
from stewart_dynamics.identification import main as identify
from stewart_dynamics.messages.joint_state import FIELDS, JointStateReader, JointStateWriter
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.replay.read_arrays import read_legs
from stewart_dynamics.replay.replay_command_line import main as replay
from test_recorded_efforts import joined

HEXAPOD = StewartPlatform.from_yaml(PLATFORM)
JOINTS = HEXAPOD.parameters.joints
BEGIN, PERIOD = 1_700_000_000_000_000_000, 5_000_000
SPLITS = {'one each': [[n] for n in range(6)], 'halves': [[0, 2, 4], [1, 3, 5]],
          'pairs, reversed': [[5, 4], [3, 2], [1, 0]]}


def motion_at(seconds: Array) -> Motion:
    w = 2.0 * np.pi * np.array([0.3, 0.4, 0.5, 0.35, 0.45, 0.55])
    phase = w * seconds[:, None] + np.arange(6.0)
    size = np.array([0.04, 0.04, 0.05, 0.05, 0.05, 0.06])
    x, v, a = size * np.sin(phase), size * w * np.cos(phase), -size * w ** 2 * np.sin(phase)
    return Motion.from_euler(
        x[:, :3] + [0.0, 0.0, 1.18], x[:, 3:], v[:, :3], v[:, 3:], a[:, :3], a[:, 3:])


def legs(count: int) -> Array:
    """Return positions, velocities and efforts (3, N, 6) of a motion."""
    found = HEXAPOD.inverse_dynamics(motion_at(np.arange(count) * PERIOD * 1e-9))
    return np.array([found.lengths - HEXAPOD.parameters.geometry.zero_length, found.rates,
                     found.forces])


def samples_of(reader: JointStateReader, data: bytes) -> list[tuple[int, list[float]]]:
    """Return stamps and values of the samples that a message completes."""
    read = reader.read_states(Messages.single('legs', data))
    return list(zip(read.stamps.tolist(), read.values.tolist(), strict=True))


def parts(values: Array, split: Sequence[Sequence[int]], stagger: int = 0,
          fields: int = 3) -> list[tuple[int, int, bytes]]:
    """Return stamp, number of the part, and message, of values (3, N, 6) in parts."""
    writers = [JointStateWriter([JOINTS[leg] for leg in part]) for part in split]
    return [(stamp, n, writers[n].write(stamp, *(values[field, k, part] for field in range(3))))
            for k in range(values.shape[1]) for n, part in enumerate(split)
            for stamp in [BEGIN + k * PERIOD + n * stagger]]


@pytest.mark.parametrize('split', SPLITS)
@pytest.mark.parametrize('fields', [['effort'], ['velocity', 'position'], list(FIELDS)])
def test_parts_of_one_stamp_are_a_whole_message(split: str, fields: list[str]) -> None:
    values = legs(20)
    messages = parts(values, SPLITS[split])
    expected = np.concatenate([values[FIELDS.index(field)] for field in fields], axis=1)
    one, many = JointStateReader(JOINTS, fields), JointStateReader(JOINTS, fields)
    samples = [sample for *_, data in messages for sample in samples_of(one, data)]
    stamps, rows = zip(*samples, strict=True)
    assert list(stamps) == [BEGIN + k * PERIOD for k in range(20)]
    np.testing.assert_array_equal(rows, expected)
    for cut in (0, 7, 50):
        found, got = [], []
        for some in (messages[:cut], messages[cut:]):
            read = many.read_states(joined([each for *_, each in some]))
            found += read.stamps.tolist()
            got += read.values.tolist()
            assert not read.rejected
        assert found == list(stamps)
        np.testing.assert_array_equal(got, expected)
        many = JointStateReader(JOINTS, fields)


def test_legs_with_stamps_of_their_own_are_interpolated() -> None:
    reader, samples = JointStateReader(JOINTS, ['position']), []
    # positions that are linear in time, other rates and phases, and messages that come late
    times = [np.arange(0.0, 1.0, step) + shift for step, shift in zip(
        (0.01, 0.004, 0.013, 0.01, 0.02, 0.01), 0.001 * np.arange(6), strict=True)]
    order = sorted((at + 0.02 * (leg == 3), leg, at) for leg in range(6) for at in times[leg])
    for _, leg, at in order:
        stamp = BEGIN + round(at * 1e9)
        samples += samples_of(reader, JointStateWriter([JOINTS[leg]]).write(
            stamp, [leg + (stamp - BEGIN) * 1e-9], [0.0], [0.0]))
    stamps, values = (np.array(each) for each in zip(*samples, strict=True))
    assert len(stamps) > 90 and np.all(np.diff(stamps) == 10_000_000)
    np.testing.assert_allclose(
        values, np.arange(6) + (stamps - BEGIN)[:, None] * 1e-9, atol=1e-9)


def test_a_leg_that_lacks_or_stops_is_named_and_nothing_is_made_up() -> None:
    values = legs(200)
    reader, found, said = JointStateReader(JOINTS), [], []
    for stamp, leg, data in parts(values, SPLITS['one each']):
        k = (stamp - BEGIN) // PERIOD
        if leg == 4 and 50 <= k < 120:
            continue
        read = reader.read_states(Messages.single('legs', data))
        found += ((read.stamps - BEGIN) // PERIOD).tolist()
        if read.rejected and not len(read.stamps):
            said.append(read.last)
    assert found == [*range(50), *range(120, 200)]
    assert set(said) == {('lacks one of the joints', 'leg_5 for 0.1 s')}
    # the first leg is silent: the stamps are those of another one
    reader = JointStateReader(JOINTS)
    lasts = [reader.read_states(Messages.single('legs', data)).last
             for _, leg, data in parts(values, SPLITS['one each']) if leg]
    assert ('lacks one of the joints', 'leg_1 for 0.1 s') in lasts
    # time jumps back, as in a simulation that begins again
    reader, found = JointStateReader(JOINTS), []
    for _, _, data in 2 * parts(values, SPLITS['halves']):
        found += [(at - BEGIN) // PERIOD for at, _ in samples_of(reader, data)]
    assert found == 2 * [*range(200)]


@pytest.mark.parametrize('split', SPLITS)
@pytest.mark.parametrize('stagger', [0, 300_000])
def test_the_wrench_of_parts_is_that_of_whole_messages(split: str, stagger: int) -> None:
    parameters, rejected = HEXAPOD.parameters, []
    measured = MeasuredLegs(parameters, ExternalWrench(parameters),
                            lambda *said: rejected.append(said), print)
    found = [estimate for *_, data in parts(legs(600), SPLITS[split], stagger)
             if (estimate := measured.use_message(data, NO_WRENCH, None)) is not None]
    assert not rejected and len(found) > 590
    assert not any(each.possible_error for each in found)
    # staggered stamps of values that were taken at once are off by up to 1.5 ms
    assert max(each.force for each in found[20:]) < (80.0 if stagger else 20.0)


def test_parts_that_never_join_are_dropped_in_the_end() -> None:
    """A stamp in the far future of one leg: the others have nothing to be joined with."""
    reader = JointStateReader(JOINTS, ['effort'])
    first, others = JointStateWriter(JOINTS[:1]), JointStateWriter(JOINTS[1:])
    samples_of(reader, first.write((2 ** 31 - 1) * 10 ** 9, *([0.0],) * 3))

    sizes = []
    for begin in (0, 15_000, 30_000):
        for k in range(begin, begin + 15_000):
            assert samples_of(reader, others.write(
                BEGIN + k * PERIOD, *([0.0] * 5,) * 3)) == []
        sizes.append(len(pickle.dumps(reader._parts)))
    assert sizes[2] == sizes[1] < 1.01 * sizes[0]


def test_parts_without_stamps_are_rejected() -> None:
    parameters, rejected = HEXAPOD.parameters, []
    measured = MeasuredLegs(parameters, ExternalWrench(parameters),
                            lambda rejection, _: rejected.append(rejection.reason), print)
    writers = [JointStateWriter([joint]) for joint in JOINTS]
    for _ in range(3):
        for writer in writers:
            data = writer.write(0, [0.35], [0.0], [0.0])
            assert measured.use_message(data, NO_WRENCH, None) is None
    assert rejected == ['without a stamp'] * 3


def bag(folder: Path, split: Sequence[Sequence[int]], one_topic: bool) -> list[str]:
    """Write a bag of setpoints and measured legs in parts; return the topics of the legs."""
    count = 2400
    motion = motion_at(np.arange(count) * PERIOD * 1e-9)
    noise = rng(3).normal(size=(3, count, 6)) * np.array([1e-6, 1e-4, 2.0])[:, None, None]
    topics = ['/legs'] * len(split) if one_topic else [
        f'/leg_{n}/joint_states' for n in range(len(split))]
    write_bag(folder, [*setpoints(BEGIN + PERIOD * np.arange(count), motion), *(
        (topics[n], stamp, data) for stamp, n, data in parts(legs(count) + noise, split))])
    return topics


@pytest.mark.parametrize('one_topic', [True, False])
def test_programs_read_legs_in_parts(one_topic: bool, tmp_path: Path, snapshot: Snapshot) -> None:
    whole, split = tmp_path / 'whole', tmp_path / 'split'
    bag(whole, [range(6)], True)
    topics = ','.join(dict.fromkeys(bag(split, SPLITS['one each'], one_topic)))
    found = {}
    for path, measured in ((whole, '/legs'), (split, topics)):
        output = tmp_path / 'results' / path.name
        common = [str(path), '--params', str(PLATFORM), '--measured', measured, '--no-report']
        call(replay, *common, '--output', output / 'r')
        call(identify, *common, '--output', output / 'i')
        summary = json.loads((output / 'r' / path.name / 'summary.json').read_text())['measured']
        result = json.loads((output / 'i' / 'identification.json').read_text())
        states = read_legs(path, HEXAPOD, topic=measured)
        found[path] = (summary, result['parameters'], states)
    (summary, parameters, states), (others, numbers, other_states) = found.values()
    assert summary['setpoints_compared'] == others['setpoints_compared'] >= 2399
    assert others['residual_rms_n'] == summary['residual_rms_n']
    assert [each['value'] for each in numbers] == [each['value'] for each in parameters]
    np.testing.assert_array_equal(other_states.positions, states.positions)
    np.testing.assert_array_equal(other_states.efforts, states.efforts)
    if not one_topic:  # without a word which
        snapshot(call(identify, split, '--params', PLATFORM, '--no-report', code=2).err)
        with snapshot.raises(BagError):
            read_legs(split, HEXAPOD, topic=','.join(topics.split(',')[:5]))
