# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The output bag of a replay, as read by other programs."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable
from pathlib import Path
import struct
from typing import Any
import zlib

from checked_results import part_of
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
import numpy as np
from numpy.typing import NDArray
import pytest
from referees import ROOT
from rosbags.highlevel import AnyReader
from stewart_dynamics import Parameters
from stewart_dynamics.arrays import Array
from stewart_dynamics.bags.recording import Recording
from stewart_dynamics.legs import TELESCOPIC
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.mechanics.rows import MOTION
from stewart_dynamics.replay.output_bag import OutputBag, RecordedModel
from stewart_dynamics.replay.summary import Answered
from stewart_dynamics.setpoints.output_messages import output_types, OutputMessages
from stewart_dynamics.setpoints.step import Batch, Outputs, Step
import yaml  # type: ignore[import-untyped]

PARAMETERS = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml').replaced(
    {'singularity.action': 'suppress_forces'})
OUTPUT_TYPES = output_types(TELESCOPIC)
LEGS: tuple[str, ...] = tuple(PARAMETERS['joints'])
STEP = Step(PARAMETERS)
NODE = '/a_node'
RECORDED = 1_700_000_000_000_000_000


def turning(number: int, first: int = 0) -> Outputs:
    """Return outputs of a platform that turns about the vertical through a singularity."""
    n = np.arange(first, first + number)
    motions = np.zeros((number, 24))
    motions[:, 2] = 1.1
    motions[:, 3:12] = from_euler(0.01 * n[:, None] * [0.0, 0.0, 1.0]).reshape(-1, 9)
    motions[:, 17] = 1.0
    return STEP(Batch.from_parts(1_000_000 * (n + 1), motions))


def times_of(number: int, first: int = 0) -> NDArray[np.int64]:
    return RECORDED + 1000 * np.arange(first, first + number, dtype=np.int64)


def base_wrenches_of(outputs: Outputs) -> Array:
    """Return base wrenches, some of them not known."""
    wrenches = 1e-9 * outputs.stamps[:, None] * np.arange(1.0, 7.0)
    wrenches[outputs.stamps // 1_000_000 % 7 == 0] = np.nan
    return wrenches


def answered(outputs: Outputs, times: NDArray[np.int64], motions: Array) -> Answered:
    """Return outputs as a block."""
    n = len(outputs.stamps)
    setpoints = Batch.from_parts(outputs.stamps, motions, times=times)
    return Answered(np.arange(n) / 7.0, setpoints, outputs, base_wrenches_of(outputs),
                    np.zeros((n, 6)))


def write_bag(folder: Path, blocks: Iterable[tuple[NDArray[np.int64], Outputs]]) -> Path:
    bag = OutputBag(folder, NODE, OutputMessages(PARAMETERS),
                    RecordedModel(PARAMETERS, 'hexapod'), 0.0)
    for times, outputs in blocks:
        bag.write(answered(outputs, times, np.zeros((len(times), MOTION))))
    bag.close()
    return folder


@pytest.fixture(scope='module')
def turned(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Outputs]:
    """Return a bag of three chunks, and the outputs in it."""
    outputs = turning(300)
    assert 5 < np.isnan(outputs.efforts[:, 0]).sum() < 50
    parts = [part_of(outputs, slice(at, at + 100)) for at in (0, 100, 200)]
    return write_bag(tmp_path_factory.mktemp('turned') / 'a bag', [
        (times_of(100, 100 * n), part) for n, part in enumerate(parts)]), outputs


def file_of(bag: Path) -> Path:
    return bag / f'{bag.name}.mcap'


def check_message(topic: str, message: Any, outputs: Outputs, n: int) -> None:
    """Check a message of the n-th output, as either reader gives it."""
    stopped = bool(np.isnan(outputs.efforts[n, 0]))
    if topic == 'leg_states':
        stamp = message.header.stamp
        assert stamp.sec * 1_000_000_000 + stamp.nanosec == outputs.stamps[n]
        assert tuple(message.name) == LEGS
        assert np.array_equal(
            message.position, outputs.drive_positions[n] - PARAMETERS['geometry.zero_length'])
        assert np.array_equal(message.velocity, outputs.rates[n])
        assert np.array_equal(message.effort, [] if stopped else outputs.efforts[n])
    elif topic == 'leg_lengths':
        assert np.array_equal(message.data, outputs.drive_positions[n])
    elif topic == 'leg_forces':
        assert np.array_equal(message.data, outputs.efforts[n])
    elif topic == 'jacobian_determinant':
        assert message.data == outputs.determinants[n]
    elif topic == 'base_wrench':
        stamp, force, torque = message.header.stamp, message.wrench.force, message.wrench.torque
        assert stamp.sec * 1_000_000_000 + stamp.nanosec == outputs.stamps[n]
        assert message.header.frame_id == PARAMETERS['base_frame']
        assert np.array_equal((force.x, force.y, force.z, torque.x, torque.y, torque.z),
                              base_wrenches_of(outputs)[n])
    else:
        assert message.data == outputs.warnings[n]
        assert outputs.changed[n]


def expected_of(outputs: Outputs) -> dict[str, int]:
    forces = int(np.isfinite(outputs.efforts[:, 0]).sum())
    many = len(outputs.stamps)
    return {'leg_states': many, 'leg_lengths': many, 'leg_forces': forces,
            'jacobian_determinant': many, 'singularity_warning': int(outputs.changed.sum()),
            'base_wrench': int(np.isfinite(base_wrenches_of(outputs)[:, 0]).sum())}


def test_mcap_reads_the_numbers(turned: tuple[Path, Outputs]) -> None:
    bag, outputs = turned
    counts: Counter[str] = Counter()
    with file_of(bag).open('rb') as file:
        for _, channel, message, decoded in make_reader(
                file, validate_crcs=True, decoder_factories=[DecoderFactory()],
                ).iter_decoded_messages():
            topic = channel.topic.removeprefix(f'{NODE}/')
            counts[topic] += 1
            assert message.publish_time == message.log_time
            check_message(topic, decoded, outputs, (message.log_time - RECORDED) // 1000)
    assert counts == expected_of(outputs)


def test_rosbags_reads_the_numbers(turned: tuple[Path, Outputs]) -> None:
    bag, outputs = turned
    counts: Counter[str] = Counter()
    with AnyReader([bag]) as reader:
        for connection, time, data in reader.messages():
            topic = connection.topic.removeprefix(f'{NODE}/')
            counts[topic] += 1
            check_message(topic, reader.deserialize(data, connection.msgtype), outputs,
                          (time - RECORDED) // 1000)
        assert {each.topic: each.msgcount for each in reader.connections} == {
            f'{NODE}/{topic}': number for topic, number in counts.items()}
        assert (reader.start_time, reader.end_time) == (RECORDED, RECORDED + 299_001)
    assert counts == expected_of(outputs)


def test_the_index_finds_every_message(turned: tuple[Path, Outputs]) -> None:
    bag, _ = turned
    every: list[tuple[str, int, bytes]] = []
    channels = {}
    with file_of(bag).open('rb') as file:
        for record in StreamReader(file, validate_crcs=True).records:
            if type(record).__name__ == 'Channel':
                channels[record.id] = record.topic
            elif type(record).__name__ == 'Message':
                every.append((channels[record.channel_id], record.log_time, record.data))
    assert [time for _, time, _ in every] == sorted(time for _, time, _ in every)
    for topics in (None, [f'{NODE}/leg_forces'], [f'{NODE}/leg_states', f'{NODE}/leg_lengths']):
        for start, end in ((None, None), (100_000, 200_000), (99_001, 99_002), (50_500, 260_001),
                           (299_000, 999_000), (400_000, 500_000)):
            begin = RECORDED + (start or 0)
            until = RECORDED + (end or 1_000_000)
            with file_of(bag).open('rb') as file:
                found = [(channel.topic, message.log_time, message.data)
                         for _, channel, message in make_reader(file, validate_crcs=True)
                         .iter_messages(topics, begin, until)]
            assert found == [each for each in every if begin <= each[1] < until
                             and (topics is None or each[0] in topics)]


def test_each_entry_of_the_index_points_at_its_message(turned: tuple[Path, Outputs]) -> None:
    content = file_of(turned[0]).read_bytes()
    with file_of(turned[0]).open('rb') as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    pointed = 0
    for chunk in summary.chunk_indexes:
        assert content[chunk.chunk_start_offset] == Opcode.CHUNK
        behind = chunk.chunk_start_offset + chunk.chunk_length
        # records of the index, one behind the other
        assert min(chunk.message_index_offsets.values()) == behind
        messages = behind - chunk.uncompressed_size
        for channel, offset in chunk.message_index_offsets.items():
            opcode, length = struct.unpack_from('<BQ', content, offset)
            assert opcode == Opcode.MESSAGE_INDEX
            assert offset + 9 + length <= behind + chunk.message_index_length
            number, size = struct.unpack_from('<HI', content, offset + 9)
            assert (number, size) == (channel, length - 6)
            entries = list(struct.iter_unpack('<QQ', content[offset + 15:offset + 9 + length]))
            assert [at for _, at in entries] == sorted(at for _, at in entries)
            for time, at in entries:
                code, _, of, _, logged = struct.unpack_from('<BQHIQ', content, messages + at)
                assert (code, of, logged) == (Opcode.MESSAGE, channel, time)
            assert chunk.message_start_time <= entries[0][0]
            assert entries[-1][0] <= chunk.message_end_time
            pointed += len(entries)
    assert summary.statistics is not None
    assert pointed == summary.statistics.message_count


@pytest.mark.parametrize('number', [0, 1, 300])
def test_statistics_checksum_and_metadata_agree(number: int, tmp_path: Path) -> None:
    outputs = turning(number)
    bag = write_bag(tmp_path / 'bag', [(times_of(number), outputs)])
    expected = {f'{NODE}/{topic}': of for topic, of in expected_of(outputs).items()}
    content = file_of(bag).read_bytes()
    start, _, checksum = struct.unpack_from('<QQI', content, len(content) - 28)
    assert zlib.crc32(content[start:-12]) == checksum
    with file_of(bag).open('rb') as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert reader.get_header().profile == 'ros2'
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == sum(expected.values())
    assert {summary.channels[n].topic: of for n, of in
            summary.statistics.channel_message_counts.items() if of} == {
                topic: of for topic, of in expected.items() if of}
    assert summary.statistics.chunk_count == len(summary.chunk_indexes) == bool(number)
    assert summary.statistics.channel_count == len(summary.channels) == len(OUTPUT_TYPES)
    assert summary.statistics.schema_count == len(summary.schemas)
    begin, end = (RECORDED, RECORDED + 1000 * (number - 1)) if number else (0, 0)
    assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (
        begin, end)
    document = yaml.safe_load((bag / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    assert document['message_count'] == sum(expected.values())
    assert document['starting_time'] == {'nanoseconds_since_epoch': begin}
    assert document['duration'] == {'nanoseconds': end - begin}
    assert {each['topic_metadata']['name']: each['message_count']
            for each in document['topics_with_message_count']} == expected
    assert document['relative_file_paths'] == [file_of(bag).name]
    with AnyReader([bag]) as reader2:
        assert {each.topic: (each.msgtype, each.msgcount) for each in reader2.connections} == {
            f'{NODE}/{topic}': (kind, expected[f'{NODE}/{topic}'])
            for topic, kind in OUTPUT_TYPES.items()}
    # it is a bag that this package reads
    recording = Recording(bag)
    assert recording.topics == {f'{NODE}/{topic}': kind for topic, kind in OUTPUT_TYPES.items()}
    many = sum(len(each.times) for each, _ in recording.messages(
        {topic: topic for topic in recording.topics}))
    recording.close()
    assert many == sum(expected.values())
    assert not recording.missing
    assert not recording.notices


def test_blocks_that_overlap_in_time_are_found_in_its_order(tmp_path: Path) -> None:
    one, two = turning(50), turning(50, 50)
    bag = write_bag(tmp_path / 'bag', [(times_of(50, 25), one), (times_of(50), two)])
    with file_of(bag).open('rb') as file:
        times = [message.log_time for _, channel, message in make_reader(file).iter_messages()
                 if channel.topic.endswith('leg_states')]
    assert times == sorted([*times_of(50, 25).tolist(), *times_of(50).tolist()])
    document = yaml.safe_load((bag / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    assert document['starting_time'] == {'nanoseconds_since_epoch': RECORDED}
    assert document['duration'] == {'nanoseconds': 74_000}


def test_a_bag_in_many_blocks_has_the_messages_of_one(tmp_path: Path) -> None:
    outputs = turning(60)
    one = write_bag(tmp_path / 'one', [(times_of(60), outputs)])
    many = write_bag(tmp_path / 'many', [
        (times_of(1, n), part_of(outputs, slice(n, n + 1))) for n in range(60)])
    found = []
    for bag in (one, many):
        by_topic = defaultdict(list)
        with file_of(bag).open('rb') as file:
            for _, channel, message in make_reader(file).iter_messages():
                by_topic[channel.topic].append((message.log_time, message.data))
        found.append(by_topic)
    assert found[0] == found[1]
