# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""The outputs of a replay: a bag with the topics of the node, and a table of the legs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from struct import Struct
from typing import Any, Protocol
import zlib

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel, ChunkIndex, DataEnd, Footer, Header, McapRecord, Schema, Statistics)
import numpy as np
import orjson
from rosbags.typesys import get_typestore, Stores
import yaml  # type: ignore[import-untyped]

from stewart_dynamics.arrays import Bytes, Stamps
from stewart_dynamics.errors import StewartError
from stewart_dynamics.messages.layout import at_any_byte
from stewart_dynamics.replay.mcap_layout import MAGIC
from stewart_dynamics.runtime.output_messages import OUTPUT_TYPES, OutputMessages
from stewart_dynamics.runtime.step import Outputs

_LIBRARY = 'stewart_dynamics'
# Of a message record: opcode, length, channel, sequence, log time and publish time.
_HEAD = 31
# Opcode, length, times of first and last message, size, checksum, no compression, size.
_CHUNK_HEAD = Struct('<BQQQQIIQ')


class OutputBag:
    """
    A bag in MCAP with the topics, types and messages of the node.

    Messages are assembled in blocks; each block is a chunk with a checksum.

    Parameters
    ----------
    folder : Path
        It is created; the file in it has its name.
    node : str
        Node name, the prefix of the topics.
    messages : OutputMessages
        Serializes the messages.

    """

    def __init__(self, folder: Path, node: str, messages: OutputMessages) -> None:
        self._folder = folder
        self._messages = messages
        folder.mkdir()
        self._file = (folder / f'{folder.name}.mcap').open('wb')
        self._counts: Counter[int] = Counter()
        self._times: tuple[int, int] | None = None
        self._chunks: list[ChunkIndex] = []
        store = get_typestore(Stores.ROS2_JAZZY)
        kinds = tuple(dict.fromkeys(OUTPUT_TYPES.values()))
        self._schemas = [
            Schema(data=store.generate_msgdef(kind, ros_version=2)[0].encode(),
                   encoding='ros2msg', id=n, name=kind) for n, kind in enumerate(kinds, start=1)]
        self._hashes = {kind: store.hash_rihs01(kind) for kind in kinds}
        self._channels = {
            topic: Channel(
                id=n, topic=f'{node}/{topic}', message_encoding='cdr',
                schema_id=kinds.index(kind) + 1, metadata={
                    'offered_qos_profiles': '', 'topic_type_hash': self._hashes[kind]})
            for n, (topic, kind) in enumerate(OUTPUT_TYPES.items(), start=1)}
        self._file.write(MAGIC + _bytes(Header(profile='ros2', library=_LIBRARY)))
        self._file.write(self._declarations())

    def write(self, times: Stamps, outputs: Outputs) -> None:
        """Write a chunk: the outputs of each setpoint, with these recording times (N,) [ns]."""
        if not len(times):
            return
        groups = [group for group in self._messages.of_outputs(outputs) if len(group[1])]
        sizes = np.zeros((len(times), len(groups)), dtype=np.int64)
        for n, (_, which, messages) in enumerate(groups):
            sizes[which, n] = _HEAD + messages.dtype.itemsize
        ends = np.cumsum(sizes.ravel()).reshape(sizes.shape)
        content = np.empty(ends[-1, -1], dtype=np.uint8)
        indexes: dict[int, list[tuple[Stamps, Stamps]]] = {}
        for n, (topic, which, messages) in enumerate(groups):
            channel = self._channels[topic].id
            starts = ends[which, n] - sizes[which, n]
            records = np.empty(len(which), dtype=[
                ('opcode', 'u1'), ('length', '<u8'), ('channel', '<u2'), ('sequence', '<u4'),
                ('logged', '<u8'), ('published', '<u8'), ('data', messages.dtype)])
            records['opcode'] = int(Opcode.MESSAGE)
            records['length'] = records.dtype.itemsize - 9
            records['channel'] = channel
            records['sequence'] = 0
            records['logged'] = records['published'] = times[which]
            records['data'] = messages
            at_any_byte(content, records.itemsize)[starts] = records.view(f'V{records.itemsize}')
            indexes.setdefault(channel, []).append((times[which], starts))
            self._counts[channel] += len(which)
        self._write_chunk(content, int(times.min()), int(times.max()), indexes)

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
                     indexes: dict[int, list[tuple[Stamps, Stamps]]]) -> None:
        at = self._file.tell()
        # Like mcap's Chunk, without two copies of the content.
        self._file.write(_CHUNK_HEAD.pack(
            Opcode.CHUNK, _CHUNK_HEAD.size - 9 + len(content), begin, end, len(content),
            zlib.crc32(content.data), 0, len(content)))
        self._file.write(content.data)
        behind = self._file.tell()
        offsets = {}
        for channel, parts in indexes.items():
            offsets[channel] = self._file.tell()
            times, starts = (np.concatenate(part) for part in zip(*parts, strict=True))
            order = np.argsort(starts)
            entries = np.column_stack([times, starts])[order].astype('<u8').tobytes()
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
                    'name': channel.topic, 'type': OUTPUT_TYPES[topic],
                    'serialization_format': 'cdr', 'offered_qos_profiles': [],
                    'type_description_hash': self._hashes[OUTPUT_TYPES[topic]]},
                'message_count': self._counts[channel.id],
            } for topic, channel in self._channels.items()],
            'compression_format': '', 'compression_mode': '', 'files': [{'path': name, **span()}],
            'custom_data': None, 'ros_distro': _LIBRARY}}


def _bytes(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


# End of a row in legs.csv: no warning, warning.
_ENDS = (b',0\n', b',1\n')


class Table(Protocol):
    """A file with one row per setpoint."""

    def write(self, outputs: Outputs) -> None:
        """Write the rows of these outputs."""

    def close(self) -> None:
        """Finish the file."""


def _columns(legs: Sequence[str]) -> list[str]:
    return ['stamp (ns)',
            *(f'{leg} {quantity}' for quantity in (
                'length (m)', 'rate (m/s)', 'force (N)', 'demanded force (N)') for leg in legs),
            'det(J) (m^3)', 'd(det(J))/dt (m^3/s)', 'condition number', 'singularity warning']


def _numbers(outputs: Outputs, quasi_static: bool) -> Any:
    """Return the columns between stamp and warning (N, 27); nan: not known."""
    numbers = np.column_stack([
        outputs.lengths, outputs.rates, outputs.forces, outputs.demanded_forces,
        outputs.determinants, outputs.determinant_rates, outputs.conditions])
    if quasi_static:
        numbers[:, 6:12] = numbers[:, 25] = np.nan
    return numbers


class CsvTable:
    """legs.csv: each number with the fewest digits that represent it exactly."""

    def __init__(
            self, folder: Path, legs: Sequence[str], quasi_static: bool = False) -> None:
        self._quasi_static = quasi_static
        self._file = (folder / 'legs.csv').open('wb')
        self._file.write(','.join(map(_quoted, _columns(legs))).encode() + b'\n')

    def write(self, outputs: Outputs) -> None:
        """Write the rows of these outputs."""
        if not len(outputs.stamps):
            return
        numbers = _numbers(outputs, self._quasi_static)
        text = orjson.dumps(numbers, option=orjson.OPT_SERIALIZE_NUMPY)[2:-2]
        if not np.isfinite(numbers).all():
            text = text.replace(b'null', b'')
        # '1,2],[3,4' becomes ',1,2' and ',3,4'
        cells = [b''] * (3 * len(numbers))
        cells[::3] = orjson.dumps(
            outputs.stamps, option=orjson.OPT_SERIALIZE_NUMPY)[1:-1].split(b',')
        cells[1::3] = (b',' + text.replace(b'[', b'')).split(b']')
        cells[2::3] = [_ENDS[on] for on in outputs.warnings.tolist()]
        self._file.write(b''.join(cells))

    def close(self) -> None:
        """Finish the file."""
        self._file.close()


def _quoted(text: str) -> str:
    if any(mark in text for mark in ',"\n\r'):
        return '"' + text.replace('"', '""') + '"'
    return text


class ParquetTable:
    """legs.parquet: the columns of legs.csv; null: not known, or no force."""

    def __init__(
            self, folder: Path, legs: Sequence[str], quasi_static: bool = False) -> None:
        self._quasi_static = quasi_static
        try:
            import pyarrow
            import pyarrow.parquet
        except ImportError as exc:
            raise StewartError(
                "--parquet needs pyarrow: pip install 'stewart_dynamics[parquet]'") from exc
        self._arrow = pyarrow
        names = _columns(legs)
        self._schema = pyarrow.schema([
            (names[0], pyarrow.int64()), *((name, pyarrow.float64()) for name in names[1:-1]),
            (names[-1], pyarrow.bool_())])
        self._writer = pyarrow.parquet.ParquetWriter(folder / 'legs.parquet', self._schema)
        self._waiting: list[Any] = []

    def write(self, outputs: Outputs) -> None:
        """Write the rows of these outputs."""
        columns = [outputs.stamps, *_numbers(outputs, self._quasi_static).T, outputs.warnings]
        self._waiting.append(self._arrow.record_batch(
            [self._arrow.array(column, type=field.type, from_pandas=True)
             for column, field in zip(columns, self._schema, strict=True)], schema=self._schema))
        if sum(batch.num_rows for batch in self._waiting) >= 1 << 16:
            self._flush()

    def close(self) -> None:
        """Finish the file."""
        self._flush()
        self._writer.close()

    def _flush(self) -> None:
        # Parquet is read faster in large row groups.
        if self._waiting:
            self._writer.write_table(self._arrow.Table.from_batches(self._waiting))
            self._waiting.clear()
