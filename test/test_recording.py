# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Bags of all kinds, whole and damaged: the messages read of each, and its reports."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from dataclasses import replace
from functools import partial
from io import BytesIO
import os
from pathlib import Path
import random
import sqlite3
import tempfile
import tracemalloc
from typing import Any, NamedTuple
import zlib

from hypothesis import given
from hypothesis import strategies as st
import lz4.frame
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, DataEnd, Footer, Header, Message, Schema
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
import messages
from messages import MS, RECORDED, Recorded, STORE
import pytest
from referees import ROOT
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from rosbags.typesys import get_typestore, Stores
from snapshot import Snapshot
from stewart_dynamics import BagError, Parameters
from stewart_dynamics.bags import mcap_file
from stewart_dynamics.bags.blocks import LARGEST_CHUNK, LARGEST_MESSAGE
from stewart_dynamics.bags.recording import Recording
from stewart_dynamics.program import PARTLY_READ
from stewart_dynamics.replay.one_bag import replay as replay_one
from stewart_dynamics.replay.replay_options import NODE, Options
from stewart_dynamics.setpoints.input_messages import INPUT_TYPES, POSE, TWIST
import zstandard

PROGRAM = 'stewart_replay'

PARAMETERS = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
MAGIC = b'\x89MCAP0\r\n'
WITHOUT_INDEX: dict[str, Any] = {
    'index_types': IndexType.NONE, 'repeat_channels': False, 'repeat_schemas': False,
    'use_statistics': False, 'use_summary_offsets': False}
# How mcap's writer writes the bags that are damaged here.
KINDS: dict[str, dict[str, Any]] = {
    'plain': {},
    'lz4': {'compression': CompressionType.LZ4},
    'zstd': {'compression': CompressionType.ZSTD},
    'without an index': WITHOUT_INDEX,
    'without a summary': {**WITHOUT_INDEX, 'index_types': IndexType.MESSAGE},
}


class Read(NamedTuple):
    messages: list[Recorded]
    missing: list[str]
    notices: list[str]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / 'bag.mcap'


def read(bag: Path, *topics: str) -> Read:
    """Return a bag's messages in the order in which they are handed over."""
    recording = Recording(bag)
    try:
        keys = {topic: topic for topic in topics or recording.topics}
        found = [each for block, _ in recording.messages(keys)
                 for each in block.iterate_messages()]
        return Read(found, recording.missing, recording.notices)
    finally:
        recording.close()


def motion(number: int) -> list[Recorded]:
    """Return setpoints 10 ms apart: a slow heave."""
    return [(f'{NODE}/{topic}', when, data) for topic, when, data in messages.motion(number)]


TYPES = {f'{NODE}/{topic}': kind for topic, kind in INPUT_TYPES.items()}


def mcap(of: Iterable[Recorded], **options: Any) -> bytes:
    """Return a bag as mcap's own writer writes it, in small chunks by default."""
    stream = BytesIO()
    writer = McapWriter(stream, **{
        'chunk_size': 2000, 'compression': CompressionType.NONE, **options})
    writer.start('ros2')
    channels: dict[str, int] = {}
    for topic, when, data in of:
        if topic not in channels:
            kind = TYPES.get(topic, 'std_msgs/msg/String')
            definition, _ = STORE.generate_msgdef(kind, ros_version=2)
            channels[topic] = writer.register_channel(
                topic, 'cdr', writer.register_schema(kind, 'ros2msg', definition.encode()))
        writer.add_message(channels[topic], when, data, when)
    writer.finish()
    return stream.getvalue()


def record(of: Any) -> bytes:
    builder = RecordBuilder()
    of.write(builder)
    return bytes(builder.end())


def channel(number: int, topic: str, schema: int = 1, encoding: str = 'cdr') -> bytes:
    return record(Channel(id=number, topic=topic, message_encoding=encoding, metadata={},
                          schema_id=schema))


def schema(number: int, name: str) -> bytes:
    return record(Schema(id=number, data=b'', encoding='ros2msg', name=name))


def message(number: int, when: int, data: bytes = b'\0\1\0\0') -> bytes:
    return record(Message(channel_id=number, log_time=when, data=data, publish_time=when,
                          sequence=0))


def chunk(content: bytes, start: int = 0, size: int | None = None, checksum: int | None = None,
          compression: str = '', packed: bytes | None = None) -> bytes:
    return record(Chunk(
        compression=compression, data=content if packed is None else packed,
        message_end_time=0, message_start_time=start,
        uncompressed_crc=zlib.crc32(content) if checksum is None else checksum,
        uncompressed_size=len(content) if size is None else size))


def file_of(*records: bytes) -> bytes:
    """Return a file of these records without a summary."""
    begin = MAGIC + record(Header(profile='ros2', library='')) + b''.join(records)
    return begin + record(DataEnd(data_section_crc=0)) + record(
        Footer(summary_start=0, summary_offset_start=0, summary_crc=0)) + MAGIC


def records_of(content: bytes) -> Iterator[tuple[int, int]]:
    """Yield where each record of a file begins, and how long it is."""
    at = len(MAGIC)
    while at < len(content) - len(MAGIC):
        length = 9 + int.from_bytes(content[at + 1:at + 9], 'little')
        yield at, length
        at += length


def is_part(part: Iterable[Any], whole: Iterable[Any]) -> bool:
    """Return whether these are some of those, in the same order."""
    rest = iter(whole)
    return all(each in rest for each in part)


def check(file: Path, whole: list[Recorded]) -> bool:
    """Check the messages read of a damaged file; return whether all were read."""
    try:
        found = read(file)
    except BagError as exc:
        assert '\n' not in str(exc)
        return False
    assert is_part(found.messages, whole)
    assert len(found.messages) == len(whole) or found.missing
    assert all('\n' not in said for said in found.missing)
    return len(found.messages) == len(whole)


# Damage

def cut(content: bytes, chance: random.Random) -> bytes:
    return content[:chance.randrange(len(content))]


def flipped(content: bytes, chance: random.Random) -> bytes:
    spoiled = bytearray(content)
    for _ in range(chance.choice((1, 1, 1, 2, 5, 20))):
        spoiled[chance.randrange(len(spoiled))] ^= chance.randrange(1, 256)
    return bytes(spoiled)


def zeroed(content: bytes, chance: random.Random) -> bytes:
    """Return what a file system may leave after a loss of power."""
    at = chance.randrange(len(content))
    size = min(chance.choice((16, 512, 4096)), len(content) - at)
    return content[:at] + bytes(size) + content[at + size:]


def shifted(content: bytes, chance: random.Random) -> bytes:
    at = chance.randrange(len(content))
    if chance.random() < 0.5:
        return content[:at] + content[at + chance.choice((1, 9, 100, 4096)):]
    return content[:at] + chance.randbytes(chance.choice((1, 9, 100))) + content[at:]


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('spoil', [cut, flipped, zeroed, shifted])
def test_a_damaged_bag_gives_no_wrong_messages_and_reports_missing_ones(
        spoil: Callable[[bytes, random.Random], bytes], kind: str, file: Path) -> None:
    given_ = motion(60)
    content = mcap(given_, **KINDS[kind])
    file.write_bytes(content)
    assert read(file) == (given_, [], [])
    chance = random.Random(f'{spoil.__name__} {kind}')
    for _ in range(60):
        file.write_bytes(spoil(content, chance))
        check(file, given_)


@pytest.mark.parametrize('kind', ['plain', 'without a summary'])
def test_a_flipped_bit_in_the_records_gives_no_wrong_messages(kind: str, file: Path) -> None:
    given_ = motion(6)
    content = mcap(given_, chunk_size=700, **KINDS[kind])
    whole = 0
    for at, _ in records_of(content):
        for bit in (*range(8), *range(8, 32, 3)):  # of the kind, of the length
            spoiled = bytearray(content)
            spoiled[at + bit // 8] ^= 1 << bit % 8
            file.write_bytes(spoiled)
            whole += check(file, given_)
    # without an index the chain is read up to where it breaks
    assert whole > (150 if kind == 'plain' else 50)


@pytest.mark.parametrize('kind', KINDS)
def test_a_bag_cut_by_twenty_bytes_is_read_to_its_end(kind: str, tmp_path: Path) -> None:
    given_ = motion(60)
    file = tmp_path / 'bag.mcap'
    file.write_bytes(mcap(given_, **KINDS[kind])[:-20])
    found = read(file)
    assert found.messages == given_
    assert found.missing
    replayed = replay_one(file, PARAMETERS, tmp_path / 'out', Options(report=False))
    assert replayed.code == PARTLY_READ
    assert replayed.summary.setpoints.answered == 60


@pytest.mark.parametrize('kind', KINDS)
def test_a_damaged_chunk_is_lost_and_without_an_index_all_after_it(
        kind: str, file: Path) -> None:
    given_ = motion(60)
    content = mcap(given_, **KINDS[kind])
    chunks = [at for at, _ in records_of(content) if content[at] == Opcode.CHUNK]
    assert len(chunks) > 3
    # all topics are declared before it
    for at in (chunks[2], chunks[2] + 4, chunks[2] + 45, chunks[2] + 90):
        spoiled = bytearray(content)
        spoiled[at:at + 20] = b'\xff' * 20
        file.write_bytes(spoiled)
        found = read(file)
        assert is_part(found.messages, given_)
        lost = [n for n, each in enumerate(given_) if each not in found.messages]
        assert lost == list(range(lost[0], lost[-1] + 1))
        in_its_length = at < chunks[2] + 9
        if 'without' in kind and in_its_length:
            assert lost[-1] == len(given_) - 1
            assert len(given_) / len(chunks) < lost[0] < 3 * len(given_) / len(chunks)
        else:
            assert len(lost) < 2 * len(given_) / len(chunks)
        assert any(f'byte {chunks[2]}' in said for said in found.missing)


def test_chunks_are_in_order_although_a_time_in_a_head_is_wrong(file: Path) -> None:
    given_ = motion(60)
    for kind in ('plain', 'without a summary'):
        content = mcap(given_, **KINDS[kind])
        at = [at for at, _ in records_of(content) if content[at] == Opcode.CHUNK][2] + 9
        for time in (0, RECORDED + 300 * MS, RECORDED + 10_000 * MS, 1 << 63, (1 << 64) - 1):
            file.write_bytes(content[:at] + time.to_bytes(8, 'little') + content[at + 8:])
            found = read(file)
            assert found.messages == given_ or (kind != 'plain' and found.missing)
            assert is_part(found.messages, given_)


ONE = schema(1, 'a/msg/A') + channel(1, '/a')
DECLARED = schema(1, 'a/msg/A') + channel(2, '/a') + channel(3, '/c')
AMONG = (DECLARED, chunk(message(2, 5), 5), message(2, 3), chunk(message(2, 1), 1))
LAST = (1 << 63) - 1


@pytest.mark.parametrize(('records', 'times', 'missing'), [
    (AMONG, [1, 5], 'messages outside of chunks: no checksum covers them'),
    ((DECLARED, channel(65535, '/a'), channel(0, '/a'),
      chunk(message(0, 2) + message(3, 1) + message(65535, 1), 1)), [1, 1, 2], ''),
    ((DECLARED, *(chunk(message(2, time), time) for time in ((1 << 64) - 1, 1 << 63, LAST, 0))),
     [0, LAST, LAST, LAST], ''),
    ((DECLARED, chunk(message(2, 1) + chunk(message(2, 2), 2), 1), chunk(message(2, 3), 3)),
     [3], 'its records are inconsistent')], ids=[
         'between chunks', 'two channels of a topic', 'times out of range', 'chunk in a chunk'])
def test_records_that_are_used_and_records_that_are_damage(
        records: tuple[bytes, ...], times: list[int], missing: str,
        file: Path) -> None:
    file.write_bytes(file_of(*records))
    found = read(file)
    assert [when for _, when, _ in found.messages] == times
    assert missing in ''.join(found.missing)
    assert len(found.missing) == bool(missing)


# Files as recorders write them

def test_unchunked_bags_are_read_with_a_notice(file: Path, snapshot: Snapshot) -> None:
    given_ = motion(30)
    for options in ({}, WITHOUT_INDEX):  # the latter is rosbag2's preset fastwrite
        content = mcap(given_, use_chunking=False, **options)
        file.write_bytes(content)
        found = read(file)
        assert found[:2] == (given_, [])
        assert len(found.notices) == 1
        # up to a cut it is read
        file.write_bytes(content[:len(content) // 2])
        found = read(file)
        assert 30 < len(found.messages) < 60
        assert found.messages == given_[:len(found.messages)]
        assert found.missing
        snapshot(found.notices[0])


def test_a_checksum_of_the_file_covers_messages_outside_of_chunks(file: Path) -> None:
    given_ = motion(30)
    content = mcap(given_, use_chunking=False, enable_data_crcs=True)
    file.write_bytes(content)
    assert read(file) == (given_, [], [])
    chance = random.Random(5)
    for _ in range(100):
        at = chance.randrange(len(content))
        file.write_bytes(content[:at] + bytes([content[at] ^ 0x10]) + content[at + 1:])
        found = read(file)
        # it cannot be checked where the end of the chain of records is not found
        assert is_part(found.messages, given_) or (found.missing and found.notices)
        assert found.messages == given_ or found.missing


def test_chunks_without_checksums_are_read_with_a_notice(file: Path, snapshot: Snapshot) -> None:
    file.write_bytes(file_of(DECLARED, chunk(message(2, 5), 5, checksum=0)))
    found = read(file)
    assert (len(found.messages), found.missing) == (1, [])
    snapshot(found.notices[0])


def test_attachments_and_metadata_between_chunks_are_skipped(file: Path) -> None:
    given_ = motion(20)
    stream = BytesIO()
    writer = McapWriter(stream, chunk_size=500, compression=CompressionType.NONE)
    writer.start('ros2')
    number = writer.register_schema('geometry_msgs/msg/PoseStamped', 'ros2msg', b'')
    channels = {topic: writer.register_channel(topic, 'cdr', number)
                for topic in dict.fromkeys(topic for topic, _, _ in given_)}
    for n, (topic, when, data) in enumerate(given_):
        writer.add_message(channels[topic], when, data, when)
        if n % 5 == 0:
            # among them one that looks like a chunk
            writer.add_attachment(when, when, 'ü', 'text/plain', mcap(given_)[:3000 * n])
            writer.add_metadata('rosbag2', {'a': 'b' * n, 'ü': ''})
    writer.finish()
    for content in (stream.getvalue(), stream.getvalue()[:-20]):
        file.write_bytes(content)
        assert read(file).messages == given_


def test_bags_without_definitions_have_their_types_by_name(file: Path) -> None:
    file.write_bytes(file_of(
        channel(1, '/before', schema=7), schema(7, 'a/msg/A'), channel(2, '/without', schema=0),
        channel(3, '/json', schema=7, encoding='json'), channel(4, '/two', schema=7),
        channel(5, '/two', schema=7), channel(6, '/mixed', schema=7),
        channel(7, '/mixed', schema=7, encoding='json')))
    recording = Recording(file)
    recording.close()
    assert recording.topics == {
        '/before': 'a/msg/A', '/without': 'message without a type',
        '/json': 'a/msg/A encoded as json', '/two': 'a/msg/A',
        '/mixed': 'a/msg/A and a/msg/A encoded as json'}


def test_empty_bags(file: Path, snapshot: Snapshot) -> None:
    for content in (mcap([]), file_of(), file_of(chunk(b''))):
        file.write_bytes(content)
        assert read(file) == ([], [], [])
    for content in (b'', MAGIC[:4], b'\0' * 100, b'MCAP'):
        file.write_bytes(content)
        with snapshot.raises(BagError):
            Recording(file)
    for content in (MAGIC, mcap([])[:30]):
        file.write_bytes(content)
        assert read(file).missing


# Order

@given(st.lists(st.tuples(st.sampled_from('abc'), st.integers(0, 12), st.integers(1, 300)),
                min_size=1, max_size=60))
def test_messages_come_in_the_order_in_which_rosbags_has_them(
        tmp_path_factory: pytest.TempPathFactory, of: list[tuple[str, int, int]]) -> None:
    # chunks overlap in any way, and are not in order, nor are the messages in them
    written = [(f'/{topic}', RECORDED + when, n.to_bytes(4, 'big') + bytes(size))
               for n, (topic, when, size) in enumerate(of)]
    file = tmp_path_factory.mktemp('order') / 'bag.mcap'
    file.write_bytes(mcap(written, chunk_size=600))
    with AnyReader([file]) as reader:
        expected = [(each.topic, when, bytes(data)) for each, when, data in reader.messages()]
    assert read(file) == (expected, [], [])
    assert [when for _, when, _ in expected] == sorted(when for _, when, _ in written)
    some = [each for each in expected if each[0] == '/a']
    if some:
        assert read(file, '/a').messages == some
    # rosbags reads nothing of the like
    file.write_bytes(mcap(written, use_chunking=False))
    assert read(file).messages == sorted(written, key=lambda each: each[1])


def test_topics_recorded_one_after_the_other_are_merged(file: Path) -> None:
    given_ = motion(3000)
    by_topic = sorted(given_, key=lambda each: each[0])
    for options in ({'chunk_size': 20_000}, {'use_chunking': False}):
        file.write_bytes(mcap(by_topic, **options))
        assert read(file).messages == given_


# Memory

def peak_of(file: Path, *topics: str) -> int:
    read(file, *topics)  # loading the machine code does not count
    tracemalloc.start()
    try:
        recording = Recording(file)
        for _ in recording.messages({topic: topic for topic in topics or recording.topics}):
            pass
        recording.close()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_large_messages_of_other_topics_are_not_kept_in_memory(file: Path) -> None:
    given_ = [('/image', RECORDED + 10 * MS * n + 5, bytes(2_000_000)) for n in range(1, 31)]
    ordered = sorted([*motion(30), *given_], key=lambda each: each[1])
    for options in ({}, {'use_chunking': False}, {'compression': CompressionType.ZSTD}):
        file.write_bytes(mcap(ordered, **options))
        assert peak_of(file, *TYPES) < 12_000_000


def test_long_bags_are_not_kept_in_memory(file: Path) -> None:
    peaks = []
    for number in (20_000, 80_000):
        of = [(topic, n, bytes(92)) for topic in ('/a', '/b') for n in range(number)]
        file.write_bytes(mcap(of, chunk_size=50_000, index_types=IndexType.CHUNK))
        peaks.append(peak_of(file))
    assert file.stat().st_size > 15_000_000
    assert peaks[1] < 1.2 * peaks[0] < 8_000_000


def test_attachments_are_not_read_into_memory(file: Path) -> None:
    attachment = record(Attachment(create_time=0, log_time=0, name='film', media_type='video/mp4',
                                   data=bytes(40_000_000)))
    file.write_bytes(file_of(
        ONE, chunk(message(1, 1), 1), attachment, chunk(message(1, 2), 2)))
    assert read(file)[1:] == ([], [])
    assert peak_of(file) < 6_000_000


@pytest.mark.parametrize('compression', ['', 'lz4', 'zstd'])
def test_a_chunk_with_a_wrong_size_is_not_decompressed(
        compression: str, file: Path) -> None:
    frame = zstandard.ZstdCompressor().compress(bytes(50_000_000))
    for size in (3, 1 << 20, 1 << 40, (1 << 64) - 1):
        file.write_bytes(file_of(
            ONE, chunk(message(1, 1), 1),
            chunk(b'', 2, size, 1, compression, packed=frame if compression == 'zstd' else
                  b'\x04\x22\x4d\x18' + frame)))
        found = read(file)
        assert (len(found.messages), len(found.missing)) == (1, 1)
        assert peak_of(file) < 10_000_000


def test_large_compressed_messages_do_not_fill_the_memory(file: Path) -> None:
    zeros = zstandard.ZstdCompressor().compress(bytes(1 << 24))
    small = zstandard.ZstdCompressor().compress(bytes(LARGEST_MESSAGE))
    for frame, size in ((zeros, len(zeros)), (small, LARGEST_MESSAGE)):
        given_ = [(f'{NODE}/{POSE}', RECORDED + n, frame) for n in range(150)]
        file.write_bytes(mcap(given_, compression=CompressionType.ZSTD))
        assert file.stat().st_size < 100_000
        found = read(file)
        assert [len(data) for _, _, data in found.messages] == [size] * 150
        found.messages.clear()
        assert peak_of(file) < 80_000_000


@pytest.mark.parametrize('compression', ['', 'zstd', 'lz4'])
def test_a_chunk_that_is_too_large_is_missing(compression: str, file: Path) -> None:
    whole = message(1, 2, bytes(LARGEST_CHUNK))
    packed = {'': lambda data: data, 'zstd': zstandard.ZstdCompressor().compress,
              'lz4': lz4.frame.compress}[compression](whole)
    file.write_bytes(file_of(
        ONE, chunk(message(1, 1), 1),
        chunk(whole, 2, compression=compression, packed=packed), chunk(message(1, 3), 3)))
    del whole, packed
    found = read(file)
    assert [when for _, when, _ in found.messages] == [1, 3]
    assert len(found.missing) == 1
    assert f'at most {LARGEST_CHUNK} are read' in found.missing[0]
    assert peak_of(file) < 10_000_000


def empty_messages(count: int, time: int) -> bytes:
    return message(1, time, b'') * count


def bomb(*contents: bytes, start: int = 5) -> bytes:
    packer = zstandard.ZstdCompressor()
    return file_of(ONE, *(
        chunk(content, start, compression='zstd', packed=packer.compress(content))
        for content in contents))


@pytest.mark.parametrize('contents', [
    [(1_000_000, 5)], [(200_000, time) for time in range(5, 10)], [(300_000, 5)] * 4])
def test_of_a_file_with_more_messages_than_bytes_the_first_are_read(
        contents: list[tuple[int, int]], file: Path, snapshot: Snapshot) -> None:
    file.write_bytes(bomb(*(empty_messages(*each) for each in contents)))
    size = file.stat().st_size
    assert size < 20_000
    found = read(file)
    assert 80_000 < len(found.messages) < 100_000 + size
    snapshot('\n'.join(found.missing))
    found.messages.clear()
    assert peak_of(file) < 200_000_000
    # a few are no bomb, however well they are compressed
    file.write_bytes(bomb(empty_messages(50_000, 5), empty_messages(40_000, 6)))
    assert len(read(file).messages) == 90_000


def test_chunks_that_overlap_wait_in_limited_memory(
        file: Path, monkeypatch: pytest.MonkeyPatch, snapshot: Snapshot) -> None:
    contents = [message(1, 7, bytes(1 << 20)) + message(1, 8 + n, bytes(1 << 20))
                for n in range(20)]
    file.write_bytes(bomb(*contents))
    whole = read(file)
    assert [when for _, when, _ in whole.messages] == [7] * 20 + list(range(8, 28))
    assert not whole.missing
    whole.messages.clear()
    monkeypatch.setattr(mcap_file, '_MOST_WAITING', 1 << 23)
    found = read(file)
    times = [when for _, when, _ in found.messages]
    assert times == sorted(times)
    assert len(times) < 40
    snapshot(found.missing[0])
    found.messages.clear()
    assert peak_of(file) < 40_000_000


def test_declarations_do_not_fill_the_memory(file: Path) -> None:
    file.write_bytes(bomb(*(channel(n, '/' + 'a' * (1 << 24)) for n in range(2, 22))))
    assert file.stat().st_size < 100_000
    assert any('topics and types: more than' in said for said in read(file).missing)
    assert peak_of(file) < 250_000_000


def test_many_small_chunks_of_equal_times(file: Path) -> None:
    for content, count in ((b'', 0), (message(1, 5), 5000)):
        file.write_bytes(file_of(ONE, chunk(content, 5) * 5000))
        assert read(file) == ([('/a', 5, b'\0\1\0\0')] * count, [], [])


def test_a_compressed_file_is_unpacked_up_to_a_limit(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, snapshot: Snapshot) -> None:
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path))
    packer = zstandard.ZstdCompressor().compressobj()
    packed = packer.compress(mcap(motion(5)))
    for _ in range(300):
        packed += packer.compress(bytes(1 << 20))
    file = tmp_path / 'bag.mcap.zstd'
    file.write_bytes(packed + packer.flush())
    assert file.stat().st_size < 60_000
    recording = Recording(file)
    unpacked = [path for path in tmp_path.rglob('*') if path.is_file() and path != file]
    assert sum(path.stat().st_size for path in unpacked) <= 1 << 26
    recording.close()
    assert list(tmp_path.iterdir()) == [file]
    snapshot(recording.missing[0])


# Whatever bytes

@given(st.binary(max_size=300), st.sampled_from([MAGIC, b'SQLite format 3\0', b'']),
       st.sampled_from(['.mcap', '.db3', '.mcap.zstd']))
def test_random_bytes_never_raise(
        tmp_path_factory: pytest.TempPathFactory, content: bytes, begin: bytes, suffix: str,
        ) -> None:
    file = tmp_path_factory.mktemp('bytes') / f'bag{suffix}'
    file.write_bytes(begin + content)
    try:
        found = read(file)
    except BagError as exc:
        assert '\n' not in str(exc)
    else:
        assert not found.messages
        assert found.missing


RECORDS = st.one_of(
    st.builds(lambda code, content: bytes([code]) + len(content).to_bytes(8, 'little') + content,
              st.integers(0, 255), st.binary(max_size=60)),
    st.builds(lambda code, length: bytes([code]) + length.to_bytes(8, 'little'),
              st.integers(0, 16), st.integers(0, (1 << 64) - 1)),
    st.builds(message, st.integers(0, 3), st.integers(0, 9)),
    st.builds(channel, st.integers(0, 3), st.sampled_from(['/a', '/b']), st.integers(0, 2)),
    st.builds(schema, st.integers(0, 2), st.sampled_from(['a/msg/A', 'b/msg/B'])))


@given(st.lists(st.one_of(RECORDS, st.builds(
    lambda of, start, name: chunk(b''.join(of), start, compression=name),
    st.lists(RECORDS, max_size=6), st.integers(0, 9), st.sampled_from(['', '', '', 'lz4'])))))
def test_random_records_never_raise(
        tmp_path_factory: pytest.TempPathFactory, of: list[bytes]) -> None:
    file = tmp_path_factory.mktemp('records') / 'bag.mcap'
    file.write_bytes(file_of(*of))
    times = [when for _, when, _ in read(file).messages]
    assert times == sorted(times)


# sqlite3

write_bag = partial(messages.write_bag, plugin=StoragePlugin.SQLITE3)


def storage(folder: Path) -> Path:
    found, = (path for path in folder.iterdir() if path.name != 'metadata.yaml')
    return found


def execute(file: Path, *scripts: str) -> None:
    """Change a bag of sqlite3."""
    with closing(sqlite3.connect(file)) as database:
        database.executescript('; '.join(scripts))


def test_sqlite3_is_read_in_the_order_of_time(tmp_path: Path) -> None:
    given_ = motion(2000)
    mixed = random.Random(1).sample(given_, len(given_))
    bag = write_bag(tmp_path / 'bag', mixed).rename(tmp_path / 'a bag, 50% of it? #1')
    for path in (bag, storage(bag)):
        found = read(path)
        assert found[:2] == (given_, [])
        assert not found.notices  # the format has no checksums: nothing to be repaired
    assert read(bag, f'{NODE}/{TWIST}').messages == [
        each for each in given_ if each[0].endswith(TWIST)]
    assert [path.name for path in tmp_path.iterdir()] == [bag.name]
    assert len(list(bag.iterdir())) == 2


def test_lost_rows_of_sqlite3_are_reported(tmp_path: Path) -> None:
    given_ = motion(400)
    file = storage(write_bag(tmp_path / 'bag', given_))
    content = file.read_bytes()
    chance = random.Random(6)
    lost = rejected = 0
    for _ in range(200):
        # the head of a page: how many rows are in it, and where
        at = 4096 * chance.randrange(1, len(content) // 4096) + chance.randrange(8)
        file.write_bytes(content[:at] + bytes([content[at] ^ 1 << chance.randrange(8)])
                         + content[at + 1:])
        try:
            found = read(file)
        except BagError:
            rejected += 1
            continue
        assert found.messages == given_ or found.missing
        lost += len(found.messages) < len(given_)
    assert lost > 10
    # only where the list of tables or topics is damaged
    assert 0 < rejected < 10


def test_rows_that_are_not_messages_are_missing(tmp_path: Path, snapshot: Snapshot) -> None:
    given_ = motion(2)
    file = storage(write_bag(tmp_path / 'bag', given_))
    execute(file, *(
        'INSERT INTO messages (topic_id, timestamp, data) SELECT topic_id, timestamp, data FROM '
        f'messages LIMIT 1; UPDATE messages SET {wrong} WHERE id = last_insert_rowid()'
        for wrong in ("timestamp = 'soon'", 'timestamp = 1.5', 'data = 1000000000000',
                      "data = 'text'")))
    found = read(file)
    assert found.messages == given_
    snapshot('\n'.join(found.missing))


ENDLESS = 'WITH RECURSIVE n(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM n) '


@pytest.mark.parametrize('changes', [
    f'DROP TABLE messages; CREATE VIEW messages AS {ENDLESS} SELECT x AS id, 1 AS topic_id, '
    "x AS timestamp, x'00010000' AS data FROM n",
    f'DROP TABLE topics; CREATE VIEW topics AS {ENDLESS} SELECT x AS id, x AS name, x AS type, '
    'x AS serialization_format FROM n',
    'DROP TABLE topics; CREATE TABLE topics (id, name, type, serialization_format AS '
    '(hex(zeroblob(500000000))))',
    'DROP TABLE messages; CREATE TABLE messages (id, topic_id, timestamp)'])
def test_tables_that_may_never_end_are_rejected(
        changes: str, tmp_path: Path, snapshot: Snapshot) -> None:
    file = storage(write_bag(tmp_path / 'bag', motion(1)))
    execute(file, changes)
    with snapshot.raises(BagError):
        Recording(file)


def test_definitions_that_never_end_are_not_read(tmp_path: Path) -> None:
    given_ = motion(1)
    file = storage(write_bag(tmp_path / 'bag', given_))
    execute(file, 'DROP TABLE IF EXISTS message_definitions; CREATE VIEW message_definitions AS '
            f"{ENDLESS} SELECT x AS id, '' AS topic_type, '' AS encoding, '' AS "
            "encoded_message_definition, '' AS type_description_hash FROM n")
    assert read(file)[:2] == (given_, [])


@pytest.mark.parametrize(('changes', 'missing'), [
    ("UPDATE topics SET name = x'00ff' WHERE id = 1", r"topic b'\x00\xff': number, name, type"),
    ("UPDATE topics SET type = x'05' WHERE id = 1", 'number, name, type or encoding is not valid'),
    ("UPDATE topics SET name = '/' || hex(zeroblob(5000000)) WHERE id = 1",
     '0000... of type geometry_msgs/msg/PoseStamped: at most 255 characters'),
    ('UPDATE messages SET timestamp = -timestamp WHERE topic_id = 1', '2 rows that are not'),
    ('UPDATE messages SET data = zeroblob(2000000) WHERE topic_id = 1', '2 rows that are not')])
def test_odd_rows_are_missing(changes: str, missing: str, tmp_path: Path) -> None:
    given_ = motion(2)
    file = storage(write_bag(tmp_path / 'bag', given_))
    execute(file, changes)
    found = read(file)
    assert found.messages == [each for each in given_ if not each[0].endswith(POSE)]
    assert len(found.missing) == 1
    assert missing in found.missing[0]
    assert len(found.missing[0]) < 300


@pytest.mark.parametrize('suffix', ['-wal', '-journal'])
def test_the_journal_of_a_killed_recorder_is_reported(suffix: str, tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'bag', motion(2))
    journal = bag / f'{storage(bag).name}{suffix}'
    journal.write_bytes(b'')
    assert not read(bag).missing
    journal.write_bytes(b'1')
    found = read(bag)
    assert len(found.messages) == 6
    assert len(found.missing) == 1
    assert journal.name in found.missing[0]


# ROS 1

def write_ros_1(file: Path, of: Iterable[Recorded], compression: Writer1.CompressionFormat | None,
                ) -> Path:
    """Write a bag of ROS 1, whose headers have a number more."""
    store = get_typestore(Stores.ROS1_NOETIC)
    writer = Writer1(file)
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        connections: dict[str, Any] = {}
        for n, (topic, when, data) in enumerate(of):
            kind = TYPES[topic]
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            read = STORE.deserialize_cdr(data, kind)
            header = store.types['std_msgs/msg/Header'](n, read.header.stamp,
                                                        read.header.frame_id)
            writer.write(connections[topic], when, store.serialize_ros1(
                replace(read, header=header), kind))
    return file


@pytest.mark.parametrize('compression', [None, *Writer1.CompressionFormat])
def test_bags_of_ros_1_are_converted(
        compression: Writer1.CompressionFormat | None, tmp_path: Path) -> None:
    given_ = motion(200)
    folder = tmp_path / 'a folder, 50% of it? #1'
    folder.mkdir()
    files = [write_ros_1(folder / f'bag_{n}.bag', given_[300 * n:300 * n + 300], compression)
             for n in range(2)]
    found = read(files[0])
    assert found[:2] == (given_[:300], [])
    assert not found.notices
    assert read(folder)[:2] == (given_, [])
    assert read(files[0], f'{NODE}/{TWIST}').messages == given_[1:300:3]
    # a topic that is not there is not all of them
    assert read(files[0], '/none').messages == []


@pytest.mark.parametrize('kind', ['sqlite3', 'ROS 1'])
def test_damaged_bags_never_raise(kind: str, tmp_path: Path) -> None:
    given_ = motion(60)
    file = storage(write_bag(tmp_path / 'bag', given_)) if kind == 'sqlite3' else write_ros_1(
        tmp_path / 'bag.bag', given_, Writer1.CompressionFormat.LZ4)
    content = file.read_bytes()
    chance = random.Random(7)
    for n in range(200):
        file.write_bytes((cut, flipped, zeroed, shifted)[n % 4](content, chance))
        try:
            found = read(file)
        except BagError as exc:
            assert '\n' not in str(exc)
        else:
            assert all('\n' not in text for text in found.missing)


def test_a_type_of_ros_1_with_another_definition_is_another_type(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer1(tmp_path / 'bag.bag') as writer:
        writer.add_connection('/a', TYPES[f'{NODE}/{POSE}'], msgdef='float64 x\n', md5sum='0' * 32)
        writer.add_connection('/b', TYPES[f'{NODE}/{POSE}'], typestore=store)
        writer.write(writer.connections[0], 1, bytes(8))
    recording = Recording(tmp_path / 'bag.bag')
    recording.close()
    assert recording.topics == {'/a': 'geometry_msgs/msg/PoseStamped of another definition',
                                '/b': 'geometry_msgs/msg/PoseStamped'}


# Folders

def split_bag(folder: Path, parts: int, names: Callable[[int], str]) -> list[Recorded]:
    """Write a bag of several files with the metadata of rosbag2; its messages."""
    given_ = motion(4 * parts)
    folder.mkdir()
    for n in range(parts):
        (folder / names(n)).write_bytes(mcap(given_[12 * n:12 * n + 12]))
    listed(folder, [names(n) for n in range(parts)])
    return given_


def listed(folder: Path, names: Iterable[str]) -> None:
    (folder / 'metadata.yaml').write_text(
        'rosbag2_bagfile_information:\n  relative_file_paths:\n'
        + ''.join(f'  - "{name}"\n' for name in names))


def test_a_bag_of_several_files_is_read_in_their_order(tmp_path: Path, snapshot: Snapshot) -> None:
    bag = tmp_path / 'bag'
    given_ = split_bag(bag, 12, lambda n: f'bag_{n}.mcap')
    assert read(bag) == (given_, [], [])
    # also by name, where bag_10 comes after bag_9
    (bag / 'metadata.yaml').unlink()
    found = read(bag)
    assert found[:2] == (given_, [])
    snapshot('\n'.join(found.notices))


def test_a_listed_file_that_does_not_exist_is_missing(tmp_path: Path) -> None:
    bag = tmp_path / 'bag'
    given_ = split_bag(bag, 3, lambda n: f'bag_{n}.mcap')
    # older recorders put the folder before the name
    listed(bag, ['bag/bag_0.mcap', '/home/robot/bag/bag_1.mcap', 'bag_1.mcap', 'bag_2.mcap'])
    assert read(bag) == (given_, [], [])
    (bag / 'bag_1.mcap').unlink()
    found = read(bag)
    assert found == (given_[:12] + given_[24:], ['bag_1.mcap: no such file'], [])
    (bag / 'bag_0.mcap').write_bytes(b'')
    found = read(bag)
    assert found.messages == given_[24:]
    assert len(found.missing) == 2


@pytest.mark.parametrize('name', [
    'bag_1.mcap', 'bag_1.db3', 'bag_1.mcap.zstd', 'bag_1.db3.zstd', 'bag_12.mcap'])
def test_a_part_that_metadata_does_not_list_is_missing(
        name: str, tmp_path: Path, snapshot: Snapshot) -> None:
    bag = tmp_path / 'bag'
    given_ = split_bag(bag, 1, lambda n: f'bag_{n}.mcap')
    (bag / name).write_bytes(b'not read')
    found = read(bag)
    assert found.messages == given_
    snapshot('\n'.join(found.missing))
    assert not found.notices


def test_other_files_beside_a_recording_are_no_part_of_it(
        tmp_path: Path, snapshot: Snapshot) -> None:
    bag = tmp_path / 'bag'
    given_ = split_bag(bag, 1, lambda n: f'bag_{n}.mcap')
    # the same part compressed, a file of the Finder, and files that are no bags
    for name in ('bag_0.mcap.zstd', '._bag_1.mcap', 'bag_1.txt', 'bag_0.db3-wal'):
        (bag / name).write_bytes(b'not read')
    assert read(bag) == (given_, [], [])
    (bag / 'other_0.mcap').write_bytes(b'not read')
    messages, missing, notices = read(bag)
    assert (messages, missing, len(notices)) == (given_, [], 1)
    snapshot(notices[0])
    (bag / 'bag.mcap').write_bytes(b'not read')  # the parts merged
    messages, missing, notices = read(bag)
    assert (messages, missing, len(notices)) == (given_, [], 2)
    (bag / 'bag.mcap').unlink()
    # and where the compressed one is listed
    listed(bag, ['bag_0.mcap.zstd', 'other_0.mcap'])
    (bag / 'bag_0.mcap.zstd').write_bytes(zstandard.compress(mcap(given_)))
    (bag / 'other_0.mcap').unlink()
    assert read(bag).messages == given_


@pytest.mark.parametrize(('names', 'beside', 'is_part'), [
    (['run_2024'], 'run_2023', False), (['run'], 'run_1', False), (['run'], 'run_0', False),
    (['run_2'], 'run_1', False), (['run_0_2024'], 'run_0_2023', False),
    (['run_0'], 'run_1', True), (['run_1'], 'run_0', True), (['a_2024_0'], 'a_2023_0', False)])
def test_only_files_counted_from_0_are_parts_of_one_recording(
        names: list[str], beside: str, is_part: bool, tmp_path: Path) -> None:
    bag = tmp_path / 'bag'
    split_bag(bag, len(names), lambda n: f'{names[n]}.mcap')
    (bag / f'{beside}.mcap').write_bytes(b'not read')
    found = read(bag)
    assert (len(found.missing), len(found.notices)) == ((1, 0) if is_part else (0, 1))


@pytest.mark.parametrize('text', [
    '', '\0', 'a: b', '- 1', 'rosbag2_bagfile_information: 1', '\xff', '*a', '[' * 300,
    'rosbag2_bagfile_information: {relative_file_paths: }',
    'rosbag2_bagfile_information: {relative_file_paths: []}',
    'rosbag2_bagfile_information: {relative_file_paths: [1]}',
    'rosbag2_bagfile_information: {relative_file_paths: text}',
    'rosbag2_bagfile_information: {relative_file_paths: {a: b}}',
    'rosbag2_bagfile_information: {relative_file_paths: [elsewhere.mcap]}',
    'rosbag2_bagfile_information: {relative_file_paths: ["\\0"]}'])
def test_a_bag_with_damaged_metadata_is_read_by_its_files(
        text: str, tmp_path: Path, snapshot: Snapshot) -> None:
    bag = tmp_path / 'bag'
    given_ = split_bag(bag, 2, lambda n: f'bag_{n}.mcap')
    (bag / 'metadata.yaml').write_bytes(text.encode('latin-1'))
    assert read(bag)[:2] == (given_, [])
    for file in bag.glob('*.mcap'):
        file.unlink()
    with snapshot.raises(BagError) as caught:
        Recording(bag)
    assert '\n' not in str(caught.value)


def test_no_file_outside_of_the_folder_is_read(tmp_path: Path, snapshot: Snapshot) -> None:
    bag, outside = tmp_path / 'bag', tmp_path / 'outside.mcap'
    given_ = split_bag(bag, 2, lambda n: f'bag_{n}.mcap')
    outside.write_bytes(mcap(motion(1)))
    (bag / 'link.mcap').symlink_to(outside)
    (bag / 'circle.mcap').symlink_to(bag / 'circle.mcap')
    (bag / 'sub').mkdir()
    (bag / 'sub' / 'bag.mcap').write_bytes(outside.read_bytes())
    os.mkfifo(bag / 'pipe.mcap')
    for name in ('../outside.mcap', str(outside), 'link.mcap', 'sub/bag.mcap', 'sub', '.',
                 'pipe.mcap'):
        listed(bag, ['bag_0.mcap', name])
        with snapshot.raises(BagError):
            Recording(bag)
    for name in ('circle.mcap', 'x' * 300, 'x/' * 3000):
        listed(bag, ['bag_0.mcap', name])
        try:
            assert read(bag).missing
        except BagError as exc:
            assert '\n' not in str(exc)
    (bag / 'metadata.yaml').unlink()
    assert read(bag)[:2] == (given_, [])
    # but a bag may be a link
    (tmp_path / 'named').symlink_to(bag)
    assert read(tmp_path / 'named').messages == given_


def test_paths_that_are_not_files(tmp_path: Path, snapshot: Snapshot) -> None:
    os.mkfifo(tmp_path / 'pipe.mcap')
    (tmp_path / 'circle').symlink_to(tmp_path / 'circle')
    for path in (tmp_path / 'pipe.mcap', tmp_path / 'circle', tmp_path / 'none', tmp_path,
                 tmp_path / ('x' * 300), tmp_path / '\0'):
        with snapshot.raises(BagError):
            Recording(path)


# Compression by rosbag2

@pytest.mark.parametrize('plugin', list(StoragePlugin))
def test_bags_compressed_message_by_message(plugin: StoragePlugin, tmp_path: Path) -> None:
    given_ = motion(50)
    bag = messages.write_bag(tmp_path / 'bag', given_, plugin=plugin, mode=CompressionMode.MESSAGE)
    with AnyReader([bag]) as reader:
        assert [(of.topic, when, bytes(data)) for of, when, data in reader.messages()] == given_
    for path in (bag, storage(bag)):
        assert read(path)[:2] == (given_, [])


def test_a_damaged_compressed_message_stays_as_it_is(file: Path) -> None:
    frame = zstandard.ZstdCompressor().compress(bytes(100))
    large = zstandard.ZstdCompressor().compress(bytes(1 << 25))
    of = [('/a', n, data) for n, data in enumerate(
        (frame, frame[:-3], b'', b'\x28', frame[:4], large, b'\0\1\0\0'))]
    file.write_bytes(mcap(of))
    assert read(file).messages == [('/a', 0, bytes(100)), *of[1:]]


def test_bags_compressed_file_by_file(tmp_path: Path) -> None:
    bag = tmp_path / 'bag'
    given_ = split_bag(bag, 3, lambda n: f'bag_{n}.mcap.zstd')
    for n in range(3):
        file = bag / f'bag_{n}.mcap.zstd'
        content = file.read_bytes()
        # of two frames, as some compressors write
        file.write_bytes(b''.join(zstandard.ZstdCompressor().compress(part)
                                  for part in (content[:1000], content[1000:])))
    assert read(bag) == (given_, [], [])
    assert read(bag / 'bag_0.mcap.zstd').messages == given_[:12]
    (bag / 'metadata.yaml').unlink()
    assert read(bag)[:2] == (given_, [])
    content = (bag / 'bag_1.mcap.zstd').read_bytes()
    chance = random.Random(4)
    for spoil in (cut, flipped) * 20:
        (bag / 'bag_1.mcap.zstd').write_bytes(spoil(content, chance))
        check(bag, given_)
    sqlite = write_bag(tmp_path / 'sqlite', given_)
    database = storage(sqlite)
    packed = database.with_name(f'{database.name}.zstd')
    packed.write_bytes(zstandard.ZstdCompressor().compress(database.read_bytes()))
    database.unlink()
    assert read(sqlite)[:2] == (given_, [])
    assert read(packed)[:2] == (given_, [])
