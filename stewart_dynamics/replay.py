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

"""
Recorded bags in, the node's outputs out; needs no ROS.

Setpoints go through the joining and the step that the node has, message by message in the
order of the bag, so the outputs are the node's, bit for bit.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import csv
import os
from pathlib import Path
import shutil
import sys
import tempfile
from typing import NamedTuple

from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

from stewart_dynamics import compiled
from stewart_dynamics import setpoints as inputs
from stewart_dynamics.errors import BagError, StewartError
from stewart_dynamics.parameters import Parameters
from stewart_dynamics.setpoints import Refusal, Setpoints
from stewart_dynamics.singularity import Singularity
from stewart_dynamics.step import Output, OUTPUT_TYPES, Step
from stewart_dynamics.summary import Summary

DONE, LIMIT_MET, BAD_INPUT, PARTLY_READ = range(4)
# of several bags the gravest decides
_GRAVITY = (DONE, LIMIT_MET, PARTLY_READ, BAD_INPUT).index
_INTERRUPTED = 130
NODE = '/stewart_dynamics'

_NAN = float('nan')


class Replayed(NamedTuple):
    """What became of one bag."""

    bag: Path
    summary: Summary | None
    """None where no setpoint was answered."""
    refusals: dict[Refusal, int]
    """They, and the messages that made the setpoints, are all that was read."""
    notices: tuple[str, ...]
    """What the node would say in its log."""
    excesses: dict[tuple[str, int], tuple[int, float]]
    """Of limits broken, by limit and leg: in how many setpoints, and the value farthest out."""
    limit_met: bool
    """A limit or a singularity warning was met."""
    unread: str
    """Why the rest of the bag could not be read; empty where all was."""


class _Recorded(NamedTuple):
    topic: str
    time: int
    data: bytes


class _Bag:
    """
    The setpoint messages of a bag, in its order.

    Raises BagError where it cannot be opened or lacks a topic. A fault further in ends the
    iteration, and ``unread`` says which.
    """

    def __init__(self, path: Path, node: str, topics: Sequence[str]) -> None:
        self.unread = ''
        self._path = path
        try:
            self._reader = AnyReader(
                [path], default_typestore=get_typestore(Stores.ROS2_JAZZY))
            self._reader.open()
        except Exception as exc:  # rosbags lets bare errors through for a damaged file
            raise BagError(f'{path}: not a bag that can be read: {_one_line(exc)}') from exc
        try:
            if not self._reader.is2:
                raise BagError(f'{path}: a bag of ROS 1, must be one of ROS 2')
            self._topics = {f'{node}/{topic}': topic for topic in (*topics, inputs.WRENCH)}
            self._connections = [c for c in self._reader.connections if c.topic in self._topics]
            self._check_topics(node, topics)
        except BagError:
            self._reader.close()
            raise

    def _check_topics(self, node: str, topics: Sequence[str]) -> None:
        found = {c.topic for c in self._connections}
        missing = [f'{node}/{topic}' for topic in topics if f'{node}/{topic}' not in found]
        if missing:
            held = ', '.join(sorted({f'{c.topic} ({c.msgtype})'
                                     for c in self._reader.connections})) or 'nothing'
            raise BagError(f'{self._path}: has no topic {", ".join(missing)}; it holds {held}')
        for connection in self._connections:
            needed = inputs.INPUT_TYPES[self._topics[connection.topic]]
            if connection.msgtype != needed:
                raise BagError(f'{self._path}: {connection.topic}: is a {connection.msgtype}, '
                               f'must be a {needed}')

    def __iter__(self) -> Iterator[_Recorded]:
        messages = self._reader.messages(connections=self._connections)
        while True:
            try:
                connection, time, data = next(messages)
            except StopIteration:
                return
            except Exception as exc:
                self.unread = _one_line(exc)
                return
            yield _Recorded(self._topics[connection.topic], time, bytes(data))

    def close(self) -> None:
        self._reader.close()


class _Outputs:
    """The output bag, and legs.csv beside it."""

    def __init__(self, folder: Path, node: str, legs: Sequence[str]) -> None:
        self._bag = Writer(folder / 'bag', version=9, storage_plugin=StoragePlugin.MCAP)
        self._bag.open()
        types = get_typestore(Stores.ROS2_JAZZY)
        self._connections = {
            topic: self._bag.add_connection(f'{node}/{topic}', kind, typestore=types)
            for topic, kind in OUTPUT_TYPES.items()}
        self._file = (folder / 'legs.csv').open('w', newline='', encoding='utf-8')
        self._csv = csv.writer(self._file)
        self._csv.writerow([
            'stamp (ns)',
            *(f'{leg} {quantity}' for quantity in (
                'length (m)', 'rate (m/s)', 'force (N)', 'demanded force (N)') for leg in legs),
            'det(J) (m^3)', 'd(det(J))/dt (m^3/s)', 'condition number', 'singularity warning'])

    def write(self, time: int, output: Output, messages: list[tuple[str, bytes]]) -> None:
        for topic, data in messages:
            self._bag.write(self._connections[topic], time, data)
        none = ('',) * 6
        self._csv.writerow([
            output.stamp, *output.lengths, *output.rates, *(output.forces or none),
            *(output.demanded_forces or none), output.determinant, output.determinant_rate,
            output.condition, int(output.singularity.warning)])

    def close(self) -> None:
        with self._file:
            self._bag.close()


@contextmanager
def _whole_folder(final: Path) -> Iterator[Path]:
    """Give a folder that takes its final name only when all in it is written."""
    final.parent.mkdir(parents=True, exist_ok=True)
    partial = Path(tempfile.mkdtemp(prefix=f'.{final.name}.', dir=final.parent))
    try:
        yield partial
        partial.chmod(0o755)
        partial.rename(final)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def replay(
        path: Path, parameters: Parameters, folder: Path, node: str = NODE) -> Replayed:
    """
    Compute one bag's outputs into a folder: ``bag/`` and ``legs.csv``.

    Parameters
    ----------
    path : Path
        A rosbag2 folder, or one of its files (.mcap, .db3).
    parameters : Parameters
        The machine's.
    folder : Path
        It must not exist; it appears when all is written.
    node : str
        The name under which the bag has the setpoints, and the outputs are written.

    Raises BagError: the bag cannot be opened or lacks a topic, or the folder exists.

    """
    if folder.exists():
        raise BagError(f'{folder}: exists already')
    step = Step(parameters)
    notices: list[str] = []
    setpoints = Setpoints(parameters, lambda refusal, details: None, notices.append)
    bag = _Bag(path, node, setpoints.topics)
    stamps: list[int] = []
    lengths: list[Sequence[float]] = []
    forces: list[Sequence[float]] = []
    determinants: list[float] = []
    warnings: list[tuple[int, bool]] = []
    limit_met = False
    excesses: dict[tuple[str, int], tuple[int, float]] = {}
    state: Singularity | None = None
    taken: Counter[str] = Counter()
    joined = 0
    try:
        with _whole_folder(folder) as partial:
            outputs = _Outputs(partial, node, parameters['joints'])
            try:
                for topic, time, data in bag:
                    if topic == inputs.WRENCH:
                        setpoints.take_wrench(data)
                        continue
                    taken[topic] += 1
                    setpoint = setpoints.take(topic, data, time)
                    if setpoint is None:
                        continue
                    joined += 1
                    output = step(setpoint, state)
                    if output is None:
                        setpoints.refuse('setpoint', inputs.OUT_OF_RANGE, '')
                        continue
                    state = output.singularity
                    outputs.write(time, output, step.messages(output))
                    stamps.append(output.stamp)
                    lengths.append(output.lengths)
                    forces.append(output.demanded_forces or (_NAN,) * 6)
                    determinants.append(output.determinant)
                    if output.warning_changed:
                        warnings.append((output.stamp, state.warning))
                    limit_met = limit_met or state.warning or bool(output.excesses)
                    for limit, leg, value, bound in output.excesses:
                        number, worst = excesses.get((limit, leg), (0, bound))
                        if abs(abs(value) - bound) > abs(abs(worst) - bound):
                            worst = value
                        excesses[limit, leg] = number + 1, worst
            finally:
                outputs.close()
    finally:
        bag.close()
    for topic in setpoints.topics:
        refused = sum(n for refusal, n in setpoints.counts.items() if refusal.topic == topic)
        for _ in range(taken[topic] - joined - refused):
            setpoints.refuse(topic, inputs.NOT_JOINED, 'the bag ends')
    summary = Summary.of(parameters['joints'], stamps, lengths, forces, determinants,
                         warnings) if stamps else None
    return Replayed(
        path, summary, dict(setpoints.counts), tuple(notices), excesses, limit_met,
        bag.unread)


def _one_line(exc: BaseException) -> str:
    return ' '.join(f'{exc}'.split()) or type(exc).__name__


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='stewart_replay', formatter_class=argparse.RawDescriptionHelpFormatter,
        description='Compute leg lengths, forces and singularity warnings of recorded setpoints, '
                    'as the node does, bit for bit.',
        epilog='For every bag, DIR/<name of the bag>/ gets bag/ (MCAP, the topics of the node) '
               'and legs.csv.\n\nexit codes: 0 done; 1 with --strict, when a limit or '
               'singularity warning was met;\n2 bad arguments, parameters or bags; 3 part of a '
               'bag could not be read, the rest is done')
    parser.add_argument('bags', nargs='+', type=Path, metavar='BAG',
                        help='rosbag2 folder, .mcap or .db3 file')
    parser.add_argument('--params', required=True, type=Path, metavar='FILE',
                        help='parameters of the machine, the file that the node takes')
    parser.add_argument('--output', type=Path, default=Path('replayed'), metavar='DIR',
                        help='folder of the results (default: replayed)')
    parser.add_argument('--node', default=NODE, metavar='NAME',
                        help=f'name before the topics in the bag (default: {NODE})')
    parser.add_argument('--strict', action='store_true',
                        help='exit code 1 when a limit or singularity warning was met')
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; the exit code is explained in its help."""
    options = _arguments().parse_args(arguments)
    code = DONE
    try:
        parameters = Parameters.from_yaml(options.params, options.node)
        folders = _folders(options.bags, options.output)
        if compiled.HINT:
            print(f'stewart_replay: {compiled.HINT}', file=sys.stderr)
        for path, folder in folders.items():
            code = max(code, _replay_one(path, folder, parameters, options), key=_GRAVITY)
    except StewartError as exc:
        return _complain(exc)
    except KeyboardInterrupt:
        return _INTERRUPTED
    return code


def _folders(bags: Sequence[Path], output: Path) -> dict[Path, Path]:
    """Return each bag's folder of results, named as the bag; no two may have the same."""
    folders: dict[Path, Path] = {}
    for path in bags:
        whole = Path(os.path.abspath(path))  # '.' has no name
        folder = output / (whole.name if path.is_dir() else whole.stem)
        for other, taken in folders.items():
            if folder == taken:
                raise BagError(f'{other}, {path}: the results of both would be {folder}: replay '
                               'one of them into another --output')
        folders[path] = folder
    return folders


def _replay_one(path: Path, folder: Path, parameters: Parameters,
                options: argparse.Namespace) -> int:
    try:
        result = replay(path, parameters, folder, '/' + options.node.strip('/'))
    except (StewartError, OSError) as exc:
        return _complain(exc)
    _print(result, parameters['joints'])
    if result.unread:
        _complain(f'{path}: the rest could not be read: {result.unread}')
        return PARTLY_READ
    return LIMIT_MET if options.strict and result.limit_met else DONE


def _complain(what: object) -> int:
    print(f'stewart_replay: {" ".join(str(what).split())}', file=sys.stderr)
    return BAD_INPUT


def _print(result: Replayed, legs: Sequence[str]) -> None:
    print(f'{result.bag}:')
    print(result.summary.table() if result.summary else 'no setpoint could be answered')
    for (limit, leg), (number, worst) in sorted(result.excesses.items()):
        print(f'{limit} broken by {legs[leg]} in {number} setpoints, farthest {worst:.6g}')
    if result.summary and not result.excesses:
        print('all limits held')
    for notice in result.notices:
        print(notice)
    for refusal, number in sorted(result.refusals.items()):
        print(f'refused, {refusal.topic}: {number} {refusal.reason}')
    print()


if __name__ == '__main__':
    sys.exit(main())
