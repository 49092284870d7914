# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
The output bag of a replay: the topics of the node, and the hexapod as a model, in MCAP.

The inputs are the recorded messages, byte by byte, under the names that the node subscribes to:
the bag can be replayed again, with the same numbers.

The model is the URDF, and the transforms of all its links, as robot_state_publisher publishes
them: Foxglove and RViz need nothing else. The joint positions are those that the node publishes,
but for rounding: many are computed at once.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from struct import Struct
from typing import Any, NamedTuple
import zlib

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel, ChunkIndex, DataEnd, Footer, Header, McapRecord, Schema, Statistics)
import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import get_typestore, Stores
from stewart_dynamics.arrays import Array, Bytes, Integers, SECOND, Stamps
from stewart_dynamics.bags.mcap_file import HEAD, MAGIC
from stewart_dynamics.core.binding import function
from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.description.link_transforms import LinkTransforms
from stewart_dynamics.description.model import JOINT_STATES, MODEL_TYPES, TF
from stewart_dynamics.description.urdf import urdf
from stewart_dynamics.mechanics.kinematics.leg_joints import TreeJoints
from stewart_dynamics.mechanics.rows import POSITION, ROTATION
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.joint_state import joint_state_layout
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.messages.standard import string, transforms
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.replay.summary import Answered
from stewart_dynamics.setpoints.input_messages import INPUT_TYPES
from stewart_dynamics.setpoints.output_messages import OutputMessages, WARNING
from stewart_dynamics.setpoints.step import Outputs
import yaml  # type: ignore[import-untyped]

TF_STATIC = '/tf_static'
ROBOT_DESCRIPTION = '/robot_description'

RECORDED_TYPES = MODEL_TYPES | {
    TF_STATIC: type_names.TF_MESSAGE, ROBOT_DESCRIPTION: type_names.STRING}

_LIBRARY = 'stewart_dynamics'
# Late subscribers get their last message, in `ros2 bag play`, too.
_LATCHED = WARNING, TF_STATIC, ROBOT_DESCRIPTION
# Bytes of a message record before the message: opcode, length, channel, sequence, two times.
_HEAD = 31
# Opcode, length, times of first and last message, size, checksum, no compression, size.
_CHUNK_HEAD = Struct('<BQQQQIIQ')


class _Group(NamedTuple):
    """Messages of a topic in a chunk."""

    topic: str
    which: Integers  # (K,): indices of their times in those of the chunk
    data: Bytes  # contains them
    starts: Integers  # (K,): start of each in the data
    sizes: Integers  # (K,): length of each [bytes]

    @classmethod
    def from_entries(cls, topic: str, which: Integers, messages: NDArray[np.void],
                     rows: Integers) -> _Group:
        """Return messages in rows (K,) of an array of messages of one size, without a copy."""
        step, size = messages.strides[0], messages.itemsize
        data = np.lib.stride_tricks.as_strided(
            messages[:1].view(np.uint8), (step * (len(messages) - 1) + size,), (1,))
        return cls(topic, which, data, step * rows, np.full(len(rows), size))


class RecordedModel:
    """
    Writes the messages of a hexapod, which has a name in the URDF.

    Raises ParameterError if two joints or links of the URDF would have the same name.
    """

    def __init__(self, parameters: Parameters, name: str) -> None:
        self._urdf = urdf(Hexapod(parameters), name)
        self._joints = TreeJoints(parameters)
        self._links = LinkTransforms(self._urdf)
        self._positions = joint_state_layout(self._joints.names, ['position'])
        self._moving = transforms(self._links.moving)
        self._fixed = transforms(self._links.fixed)

    def write_beginning(self, stamp: int) -> Iterator[tuple[str, NDArray[np.void]]]:
        """Yield topics and messages (1,) of the constant parts, at a stamp [ns]."""
        yield TF_STATIC, self._fixed.write(
            np.array([stamp]), *self._links.at_fixed[:, None])
        text = string(self._urdf)
        yield ROBOT_DESCRIPTION, np.frombuffer(text, dtype=f'V{len(text)}')

    def write_motions(
            self, stamps: Stamps, poses: Array) -> Iterator[tuple[str, NDArray[np.void]]]:
        """Yield topics and messages (N,) of stamps (N,) [ns] and rows of motion (N, MOTION)."""
        if not len(stamps):
            return
        positions = self._joints.positions(
            poses[:, POSITION], poses[:, ROTATION].reshape(-1, 3, 3))
        yield JOINT_STATES, self._positions.write(stamps, positions)
        yield TF, self._moving.write(
            stamps, *np.moveaxis(self._links.at(positions), 1, 0))


class OutputBag:
    """
    A bag in MCAP with the topics, types and messages of the node.

    Messages are assembled in blocks; each block is a chunk with a checksum.

    folder: it is created; the file in it has its name.
    node: node name, the prefix of the topics.
    model: serializes those that show the hexapod as a model.
    rate: highest rate of these [Hz]; 0: they are not written and have no topics.
    inputs: topics whose recorded messages are written as well.
    """

    def __init__(self, folder: Path, node: str, messages: OutputMessages, model: RecordedModel,
                 rate: float, inputs: Iterable[str] = ()) -> None:
        self._folder = folder
        self._messages, self._model = messages, model
        self._period = round(SECOND / rate) if rate else 0
        self._due: int | None = None  # when the model is written next
        self._types = {
            **{topic: INPUT_TYPES[topic] for topic in inputs}, **messages.types,
            **(RECORDED_TYPES if rate else {})}
        folder.mkdir()
        self._file = (folder / f'{folder.name}.mcap').open('wb')
        self._counts: Counter[int] = Counter()
        self._times: tuple[int, int] | None = None
        self._chunks: list[ChunkIndex] = []
        store = get_typestore(Stores.ROS2_JAZZY)
        kinds = tuple(dict.fromkeys(self._types.values()))
        self._schemas = [
            Schema(data=store.generate_msgdef(kind, ros_version=2)[0].encode(),
                   encoding='ros2msg', id=n, name=kind) for n, kind in enumerate(kinds, start=1)]
        self._hashes = {kind: store.hash_rihs01(kind) for kind in kinds}
        self._channels = {
            topic: Channel(
                id=n, topic=topic if topic.startswith('/') else f'{node}/{topic}',
                message_encoding='cdr', schema_id=kinds.index(kind) + 1, metadata={
                    'offered_qos_profiles': yaml.safe_dump(
                        offered, sort_keys=False) if (offered := _offered(topic)) else '',
                    'topic_type_hash': self._hashes[kind]})
            for n, (topic, kind) in enumerate(self._types.items(), start=1)}
        self._file.write(MAGIC + _bytes(Header(profile='ros2', library=_LIBRARY)))
        self._file.write(self._declarations())

    def write(self, block: Answered) -> None:
        """Write a chunk: the messages of setpoints."""
        times, outputs = block.setpoints.times, block.outputs
        if not len(times):
            return
        groups: list[_Group] = []
        for topic, having, messages in (
                *self._messages.write_outputs(outputs),
                self._messages.write_base_wrenches(outputs.stamps, block.base_wrenches)):
            if len(which := np.flatnonzero(having)):
                groups.append(_Group.from_entries(topic, which, messages, which))
        groups += self._of_model(times, block.setpoints.motions, outputs)
        self._write_messages(times, groups)

    def write_inputs(self, recorded: Messages) -> None:
        """Write a chunk: recorded messages of the inputs."""
        if not len(recorded.times):
            return
        self._write_messages(recorded.times, [
            _Group(topic, which, recorded.data, recorded.starts[which], recorded.sizes[which])
            for topic, which in recorded.find_places().items()])

    def _write_messages(self, times: Stamps, groups: Sequence[_Group]) -> None:
        """Write a chunk of messages: by time, and of one time in the order of the groups."""
        sizes = np.zeros((len(times), len(groups)), dtype=np.int64)
        for n, group in enumerate(groups):
            sizes[group.which, n] = _HEAD + group.sizes
        ends = np.cumsum(sizes.ravel()).reshape(sizes.shape)
        places = ends - sizes
        content = np.empty(ends[-1, -1], dtype=np.uint8)
        indexes: dict[int, list[Integers]] = {}
        for n, (topic, which, *messages) in enumerate(groups):
            channel, entries = self._channels[topic].id, np.empty((len(which), 2), np.int64)
            data, starts, its_sizes = messages
            function('write_records')(
                len(which), channel, times[which], starts, its_sizes, data, places[which, n],
                content, entries)
            indexes.setdefault(channel, []).append(entries)
            self._counts[channel] += len(which)
        self._write_chunk(content, int(times.min()), int(times.max()), indexes)

    def _of_model(self, times: Stamps, motions: Array, outputs: Outputs) -> Iterator[_Group]:
        """Yield the messages that show the model, as often as they are due."""
        if self._period and self._due is None:
            first = np.zeros(1, dtype=np.int64)
            for topic, messages in self._model.write_beginning(int(outputs.stamps[0])):
                yield _Group.from_entries(topic, first, messages, first)
        which = np.array([*self._when_due(times.tolist())], dtype=np.int64)
        for topic, messages in self._model.write_motions(outputs.stamps[which], motions[which]):
            yield _Group.from_entries(topic, which, messages, np.arange(len(which)))

    def _when_due(self, times: Sequence[int]) -> Iterator[int]:
        n = 0
        while self._period and n < len(times):
            now = times[n]
            if self._due is None or now >= self._due:
                yield n
                self._due = now + self._period
            n = max(n + 1, bisect_left(times, self._due))

    def close(self) -> None:
        """Write the index, and metadata.yaml."""
        with self._file:
            self._file.write(_bytes(DataEnd(data_section_crc=0)))
            start = self._file.tell()
            begin, end = self._times or (0, 0)
            statistics = Statistics(
                message_count=self._counts.total(), schema_count=len(self._schemas),
                channel_count=len(self._channels), attachment_count=0, metadata_count=0,
                chunk_count=len(self._chunks), message_start_time=begin, message_end_time=end,
                channel_message_counts=dict(self._counts))
            footer = Footer(summary_start=start, summary_offset_start=0, summary_crc=0)
            # The checksum covers everything but itself.
            index = (self._declarations() + _bytes(statistics)
                     + b''.join(map(_bytes, self._chunks)) + _bytes(footer)[:-4])
            self._file.write(index + zlib.crc32(index).to_bytes(4, 'little') + MAGIC)
        with (self._folder / 'metadata.yaml').open('w', encoding='utf-8') as file:
            yaml.safe_dump(self._metadata(begin, end), file, sort_keys=False)

    def abandon(self) -> None:
        """Close the file without completing it."""
        self._file.close()

    def _declarations(self) -> bytes:
        return b''.join(map(_bytes, (*self._schemas, *self._channels.values())))

    def _write_chunk(self, content: Bytes, begin: int, end: int,
                     indexes: dict[int, list[Integers]]) -> None:
        at = self._file.tell()
        # Like mcap's Chunk, without two copies of the content.
        self._file.write(_CHUNK_HEAD.pack(
            Opcode.CHUNK, _CHUNK_HEAD.size - HEAD + len(content), begin, end, len(content),
            zlib.crc32(content.data), 0, len(content)))
        self._file.write(content.data)
        behind = self._file.tell()
        offsets = {}
        for channel, parts in indexes.items():
            offsets[channel] = self._file.tell()
            rows = np.concatenate(parts)
            if len(parts) > 1:
                rows = rows[np.argsort(rows[:, 1], kind='stable')]  # fast: mostly sorted
            entries = rows.tobytes()
            head = channel.to_bytes(2, 'little') + len(entries).to_bytes(4, 'little')
            self._file.write(bytes([Opcode.MESSAGE_INDEX])
                             + (len(head) + len(entries)).to_bytes(8, 'little') + head + entries)
        self._chunks.append(ChunkIndex(
            chunk_length=behind - at, chunk_start_offset=at, compression='',
            compressed_size=len(content), message_end_time=end, message_start_time=begin,
            message_index_length=self._file.tell() - behind, message_index_offsets=offsets,
            uncompressed_size=len(content)))
        first, last = self._times or (begin, end)
        self._times = min(first, begin), max(last, end)

    def _metadata(self, begin: int, end: int) -> dict[str, Any]:
        # A new dict for each place: YAML would write an alias.
        def span() -> dict[str, Any]:
            return {'starting_time': {'nanoseconds_since_epoch': begin},
                    'duration': {'nanoseconds': end - begin},
                    'message_count': self._counts.total()}

        name = f'{self._folder.name}.mcap'
        return {'rosbag2_bagfile_information': {
            'version': 9, 'storage_identifier': 'mcap', 'relative_file_paths': [name], **span(),
            'topics_with_message_count': [{
                'topic_metadata': {
                    'name': channel.topic, 'type': self._types[topic],
                    'serialization_format': 'cdr', 'offered_qos_profiles': _offered(topic),
                    'type_description_hash': self._hashes[self._types[topic]]},
                'message_count': self._counts[channel.id],
            } for topic, channel in self._channels.items()],
            'compression_format': '', 'compression_mode': '', 'files': [{'path': name, **span()}],
            'custom_data': None, 'ros_distro': _LIBRARY}}


def _offered(topic: str) -> list[dict[str, Any]]:
    """Return the profile with which a topic is published: the latched ones have one."""
    if topic not in _LATCHED:
        return []
    forever = {'sec': 9223372036, 'nsec': 854775807}
    return [{
        'history': 'keep_last', 'depth': 1, 'reliability': 'reliable',
        'durability': 'transient_local', 'deadline': {**forever}, 'lifespan': {**forever},
        'liveliness': 'automatic', 'liveliness_lease_duration': {**forever},
        'avoid_ros_namespace_conventions': False}]


def _bytes(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]
