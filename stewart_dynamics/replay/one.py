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
One recorded bag in; the node's outputs, a summary and a report out; needs no ROS.

Setpoints go through the joining and the step that the node has, in the order of the bag, so the
outputs are the node's, bit for bit. They go through in blocks of some thousand, and nothing that
grows with the bag is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager, ExitStack
import hashlib
from importlib import metadata
import json
import os
from pathlib import Path
import shutil
import tempfile
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Stamps
from stewart_dynamics.errors import BagError, StewartError
from stewart_dynamics.mechanics.force_breakdown import ForceBreakdownRows
from stewart_dynamics.mechanics.singularity import Singularity
from stewart_dynamics.parameters import Parameters
from stewart_dynamics.replay.differentiate import Differentiator
from stewart_dynamics.replay.efforts import Efforts
from stewart_dynamics.replay.measured import Comparison
from stewart_dynamics.replay.output import CsvTable, OutputBag, ParquetTable, Table
from stewart_dynamics.replay.recording import Recording
from stewart_dynamics.replay.report import Report
from stewart_dynamics.replay.summary import Summary
from stewart_dynamics.runtime import input_topics as inputs
from stewart_dynamics.runtime.output_messages import OutputMessages
from stewart_dynamics.runtime.rejections import OUT_OF_RANGE, Rejection
from stewart_dynamics.runtime.setpoints import Messages, Setpoints
from stewart_dynamics.runtime.step import Batch, Step

DONE, LIMIT_MET, BAD_INPUT, PARTLY_READ = range(4)
NODE = '/stewart_dynamics'
# Of summary.json; a change of what a key means is another version.
VERSION = 1

MEASURED = 'measured'
_MEASURED_TYPE = 'sensor_msgs/msg/JointState'
# So many of what could not be read, and of what the node would say, are told one by one.
_TOLD = 20
_SECOND = 1_000_000_000
_TOUCHES_TOLD = 5

Progress = Callable[[int, int], None]


class Options(NamedTuple):
    """How a bag is replayed."""

    node: str = NODE
    """Name before the topics of the outputs, and of the setpoints where they have the usual."""
    topics: Mapping[str, str] = MappingProxyType({})
    """Names in the bag of some of the topics pose, twist, accel, combined and wrench."""
    cutoff: float | None = None
    """[Hz]: take only poses, and differentiate them by smoothing splines."""
    measured: str | None = None
    """Topic of a sensor_msgs/JointState with the efforts that were measured."""
    parquet: bool = False
    """Write legs.parquet in place of legs.csv."""
    report: bool = True
    """Write report.html."""
    force: bool = False
    """Write over results."""
    run: str = ''
    """Told in summary.json; of a run over many bags."""

    # A mapping proxy cannot be handed to another process.
    def __reduce__(self) -> tuple[Any, ...]:
        """Return what makes it anew."""
        return type(self), (*self._replace(topics=dict(self.topics)),)


class Replayed(NamedTuple):
    """What became of a bag."""

    bag: Path
    folder: Path
    summary: dict[str, Any]
    """What summary.json holds; docs/summary.md explains it."""
    text: str
    """For a person to read."""
    code: int
    """DONE, LIMIT_MET or PARTLY_READ, the gravest of them."""


def replay(
        bag: Path, parameters: Parameters, folder: Path, options: Options | None = None,
        progress: Progress | None = None) -> Replayed:
    """
    Compute a bag's outputs into a folder: a bag, a table, a summary and a report.

    Parameters
    ----------
    bag : Path
        A rosbag2 folder, or one of its files.
    parameters : Parameters
        The machine's.
    folder : Path
        It appears when all is written; it must not exist, unless ``options.force``.
    options : Options, optional
        Topics and what is written.
    progress : callable, optional
        Told of the bytes read and the setpoints answered since the last call.

    Raises BagError: nothing of the bag can be read, it lacks a topic, or the folder exists.
    Raises StewartError: a library that is needed for an option is missing.

    """
    options = options or Options()
    _check_free(folder, options)
    source = ('pose' if options.cutoff is not None
              else 'combined' if 'combined' in options.topics else None)
    if source:
        parameters = parameters.replaced({'setpoint.source': source})
    with closing(Recording(bag)) as recording:
        topics = _topics(recording, parameters, options)
        notices = _come_by(recording, topics, options)
        with _whole_folder(folder, options) as partial, ExitStack() as stack:
            run = _Run(recording, topics, parameters, options, partial, stack)
            run.notices += notices
            for messages, size in recording.messages({name: key for key, name in topics.items()}):
                answered = run.take(messages)
                if progress is not None:
                    progress(size, answered)
            run.end()
            summary = run.summary()
            _write_json(partial / 'summary.json', summary)
            if run.report is not None:
                run.report.write(partial / 'report.html', summary)
    return Replayed(bag, folder, summary, run.text(summary), code_of(summary))


def code_of(summary: Mapping[str, Any]) -> int:
    """Return the code of a bag that was replayed."""
    return (PARTLY_READ if not summary['complete'] else LIMIT_MET if summary['limit_met']
            else DONE)


class _Run:
    """The way from messages to what is written, and what is gathered on it."""

    def __init__(self, recording: Recording, topics: dict[str, str], parameters: Parameters,
                 options: Options, folder: Path, stack: ExitStack) -> None:
        self._recording, self._topics = recording, topics
        self._parameters, self._options = parameters, options
        self.notices: list[str] = []
        self._more = 0
        if parameters['setpoint.source'] == 'pose' and options.cutoff is None:
            self.notices.append('setpoint.source is pose: the forces are those at rest')
        self._firsts: dict[Rejection, str] = {}
        self._setpoints = Setpoints(parameters, self._refused, self._notice)
        self._step = Step(parameters)
        self._state: Singularity | None = None
        self._restarting = False
        self._stamp: int | None = None
        self._elapsed = 0, 0  # [s], [ns]
        self._summary = Summary(parameters)
        # Poses farther apart than a period of the cut-off frequency say nothing of it.
        self._differentiator = None if options.cutoff is None else Differentiator(
            options.cutoff, max(parameters['setpoint.timeout'], 1.0 / options.cutoff))
        self._comparison = None if options.measured is None else Comparison(parameters)
        self._efforts = Efforts(parameters['joints'])
        self.report: Report | None = None
        self._causes = None
        if options.report:
            self.report = Report(parameters, measured=options.measured is not None)
            self._causes = ForceBreakdownRows(parameters)
        self._bag = OutputBag(folder / 'bag', options.node, OutputMessages(parameters))
        stack.callback(self._bag.abandon)
        table = ParquetTable if options.parquet else CsvTable
        self._table: Table = table(folder, parameters['joints'])
        stack.callback(self._table.close)

    def take(self, messages: Messages) -> int:
        """Take messages in, and return how many setpoints they gave."""
        if self._comparison is not None:
            measured = messages.of_topic == messages.topics.index(MEASURED)
            if measured.any():
                self._take_measured(messages, measured)
                messages = messages.chosen(~measured)
        setpoints = self._setpoints.take_many(messages)
        if self._differentiator is not None:
            setpoints = self._differentiator.add(setpoints)
        return self._answer(setpoints)

    def end(self) -> None:
        """Take the end of the bag in, and finish what is written."""
        self._setpoints.end('the bag ends')
        if self._differentiator is not None:
            self._answer(self._differentiator.finish())
            for reason, number in self._differentiator.left_out.items():
                self._setpoints.reject(inputs.POSE, reason, '', number)
            for notice in self._differentiator.notices():
                self._notice(notice)
        if self._comparison is not None:
            self._efforts.check()
            self._compared(self._comparison.finish())
        self._table.close()
        self._bag.close()

    def summary(self) -> dict[str, Any]:
        """Return what summary.json holds."""
        missing = list(self._recording.missing)
        values = self._summary.values()
        if not values['setpoints']['answered']:
            missing.append('no setpoint could be answered')
        measured = None if self._comparison is None else self._comparison.values()
        if measured and not measured['setpoints_compared']:
            missing.append(f'nothing could be compared with {self._options.measured}: no '
                           f'setpoint has sound samples around its stamp')
        notices = [*self._recording.notices, *self.notices]
        if self._more:
            notices.append(f'and {self._more} more like these')
        return {
            'version': VERSION,
            'software': _software(),
            'bag': str(self._recording.path),
            'run': self._options.run,
            'complete': not missing,
            'missing': _told(missing),
            'notices': notices,
            'inputs': {
                'node': self._options.node, 'topics': self._topics,
                'differentiated_cutoff_hz': self._options.cutoff,
                'measured': self._options.measured},
            'refused': [{'topic': refusal.topic, 'reason': refusal.reason, 'count': number,
                         'first': self._firsts[refusal]}
                        for refusal, number in sorted(self._setpoints.counts.items())],
            **values,
            'measured': measured,
            'parameters': {name: _plain(value)
                           for name, value in self._parameters.items()},
        }

    def text(self, summary: Mapping[str, Any]) -> str:
        """Return what a person reads in the terminal."""
        lines = [f'{self._recording.path}:', self._summary.table()]
        lines += summary['notices']
        lines += [f'refused, {each["topic"]}: {each["count"]} {each["reason"]}'
                  + (f' (first: {each["first"]})' if each['first'] else '')
                  for each in summary['refused']]
        if summary['measured']:
            lines += _compared_lines(summary['measured'])
        return '\n'.join(lines)

    def _refused(self, refusal: Rejection, details: str) -> None:
        self._firsts.setdefault(refusal, details)

    def _notice(self, text: str) -> None:
        if len(self.notices) < _TOLD:
            self.notices.append(text)
        else:
            self._more += 1

    def _answer(self, setpoints: Batch) -> int:
        """Take the step for setpoints, and write and gather what they give."""
        if not len(setpoints.stamps):
            return 0
        if self._restarting:
            setpoints.restarts[0] = True
        outputs = self._step.many(setpoints, self._state)
        restarts = np.cumsum(setpoints.restarts)
        restarts_answered = restarts[outputs.answered]
        refused = len(setpoints.stamps) - len(outputs.stamps)
        if refused:
            self._setpoints.reject('setpoint', OUT_OF_RANGE, '', refused)
            # A restart holds for the next that is answered.
            setpoints = setpoints.chosen(outputs.answered)._replace(
                restarts=np.diff(restarts_answered, prepend=0) > 0)
        self._restarting = bool(restarts[-1] > restarts_answered.max(initial=0))
        if not len(setpoints.stamps):
            return 0
        self._state = outputs.singularity()
        self._bag.write(setpoints.times, outputs)
        self._table.write(outputs)
        seconds = self._seconds(setpoints.stamps)
        causes = None
        if self.report is not None and self._causes is not None:
            causes = self._causes(setpoints.motions, setpoints.wrenches)
            self.report.add(seconds, setpoints, outputs, causes)
        self._summary.add(seconds, setpoints, outputs, causes)
        if self._comparison is not None:
            self._compared(self._comparison.add_setpoints(seconds, setpoints, outputs))
        return len(setpoints.stamps)

    def _seconds(self, stamps: Stamps) -> Array:
        """Return the time of the motion since the first setpoint; it never goes back."""
        steps = np.diff(stamps, prepend=stamps[0] if self._stamp is None else self._stamp)
        # Seconds apart from nanoseconds: clocks that differ by years sum up to more than 2^63 ns.
        whole, rest = np.divmod(np.maximum(steps, 0), _SECOND)
        whole, rest = self._elapsed[0] + np.cumsum(whole), self._elapsed[1] + np.cumsum(rest)
        self._stamp = int(stamps[-1])
        self._elapsed = int(whole[-1] + rest[-1] // _SECOND), int(rest[-1] % _SECOND)
        seconds: Array = (whole + rest // _SECOND) + (rest % _SECOND) * 1e-9
        return seconds

    def _take_measured(self, messages: Messages, which: Flags) -> None:
        assert self._comparison is not None
        stamps, efforts, refused = self._efforts.read(
            messages.data, messages.starts[which], messages.sizes[which])
        for reason, number in refused.items():
            self._setpoints.reject(MEASURED, reason, '', number)
        self._compared(self._comparison.add_measured(stamps, efforts))

    def _compared(self, compared: Any) -> None:
        if self.report is not None and len(compared[0]):
            self.report.add_measured(*compared)


def _topics(recording: Recording, parameters: Parameters, options: Options) -> dict[str, str]:
    """Return of each topic that is read its name in the bag."""
    wanted = inputs.SOURCES[parameters['setpoint.source']]
    for name in options.topics:
        if name != 'wrench' and f'setpoint/{name}' not in wanted:
            raise StewartError(f'--{name}: is not read where setpoint.source is '
                               f'{parameters["setpoint.source"]}')
    found = {key: _topic(recording, key, options) for key in wanted}
    wrench = options.topics.get('wrench')
    # One found by its type could be anything: a load cell, an estimate.
    if wrench or f'{options.node}/{inputs.WRENCH}' in recording.topics:
        found[inputs.WRENCH] = _topic(recording, inputs.WRENCH, options)
    if options.measured:
        found[MEASURED] = _of_type(recording, options.measured, _MEASURED_TYPE)
    names = list(found.values())
    for name in names:
        if names.count(name) > 1:
            raise BagError(f'{recording.path}: {name}: stands for '
                           f'{" and ".join(key for key in found if found[key] == name)}')
    return found


def _come_by(recording: Recording, topics: Mapping[str, str], options: Options) -> list[str]:
    """Return what a user should know of the choice of topics."""
    notices = [f'{key} is taken from {name}, the only topic that it can be'
               for key, name in topics.items()
               if key in inputs.INPUT_TYPES and name != f'{options.node}/{key}'
               and name not in options.topics.values()]
    loads = sorted(name for name, kind in recording.topics.items()
                   if kind == inputs.INPUT_TYPES[inputs.WRENCH] and name not in topics.values())
    if loads and inputs.WRENCH not in topics:
        notices.append(f'{", ".join(loads)}: loads that are not used; --wrench names one to use')
    return notices


def _topic(recording: Recording, key: str, options: Options) -> str:
    """Return a topic's name in the bag: as given, as usual, or the only one it can be."""
    kind = inputs.INPUT_TYPES[key]
    usual = f'{options.node}/{key}'
    given = options.topics.get(key.rpartition('/')[2])
    if given or usual in recording.topics:
        return _of_type(recording, given or usual, kind)
    of_type = sorted(name for name, other in recording.topics.items() if other == kind)
    named = [name for name in of_type if name.endswith(f'/{key}')]
    for candidates in (named, of_type):
        if len(candidates) == 1:
            return candidates[0]
    option = f'--{key.rpartition("/")[2]}'
    if of_type:
        raise BagError(f'{recording.path}: has no topic {usual}, and several of its type, '
                       f'{kind}: {", ".join(of_type)}: choose one by {option}')
    raise BagError(f'{recording.path}: has no topic {usual}, nor another of its type, {kind}; '
                   f'it holds {_held(recording)}{_advice(recording, key)}')


def _advice(recording: Recording, key: str) -> str:
    kinds = set(recording.topics.values())
    if key in (inputs.TWIST, inputs.ACCEL) and inputs.INPUT_TYPES[inputs.POSE] in kinds:
        return '; --differentiate makes twist and acceleration of the poses'
    if inputs.INPUT_TYPES[inputs.COMBINED] in kinds:
        return '; --combined takes setpoints in one message'
    return ''


def _of_type(recording: Recording, name: str, kind: str) -> str:
    if name not in recording.topics:
        raise BagError(f'{recording.path}: has no topic {name}; it holds {_held(recording)}')
    if recording.topics[name] != kind:
        raise BagError(f'{recording.path}: {name}: is a {recording.topics[name]}, must be a '
                       f'{kind}')
    return name


def _held(recording: Recording) -> str:
    held = ', '.join(f'{name} ({kind})' for name, kind in sorted(
        recording.topics.items())) or 'nothing'
    damage = _told(recording.damage)
    return held + (f'; of it could not be read: {"; ".join(damage)}' if damage else '')


def _compared_lines(measured: Mapping[str, Any]) -> list[str]:
    rms = ', '.join(f'{leg} {found["residual_rms_n"]:.1f}' for leg, found in
                    measured['legs'].items() if found['residual_rms_n'] is not None)
    touches = measured['touches']
    lines = [f'compared {measured["setpoints_compared"]} setpoints; measured less computed '
             f'force, RMS [N]: {rms or "none"}']
    lines += [f'touched from t = {each["from_s"]:.2f} to {each["to_s"]:.2f} s by '
              f'({", ".join(f"{part:.1f}" for part in each["force_n"])}) N'
              for each in touches['strongest'][:_TOUCHES_TOLD]]
    if touches['count'] > _TOUCHES_TOLD:
        lines.append(f'and {touches["count"] - _TOUCHES_TOLD} more touches')
    return lines


@contextmanager
def _whole_folder(final: Path, options: Options) -> Iterator[Path]:
    """Give a folder that takes its final name only when all in it is written."""
    final.parent.mkdir(parents=True, exist_ok=True)
    partial = Path(tempfile.mkdtemp(
        prefix=f'{partial_name(final, options.run)}partial.', dir=final.parent))
    replaced = partial.with_name(f'{partial.name}.replaced')
    try:
        yield partial
        partial.chmod(0o755)
        # What is there stays whole until what replaces it is.
        if final.exists():
            _check_free(final, options)
            final.rename(replaced)
        partial.rename(final)
    finally:
        if os.path.lexists(replaced) and not os.path.lexists(final):
            replaced.rename(final)  # what was to replace it was never whole
        for left in (partial, replaced):
            if left.is_symlink():
                left.unlink()
            shutil.rmtree(left, ignore_errors=True)


def partial_name(final: Path, run: str) -> str:
    """Return how the names of what is half written begin, of a folder in a run."""
    # A long name would leave no room for what comes behind it.
    short = (final.name if len(os.fsencode(final.name)) < 120
             else hashlib.sha256(os.fsencode(final.name)).hexdigest())
    return f'.{short}.{run or "one"}.'


def _check_free(folder: Path, options: Options) -> None:
    """Raise BagError if results may not go there."""
    if not folder.exists():
        return
    if not options.force:
        raise BagError(f'{folder}: exists already; --force replaces results')
    if not (folder / 'summary.json').is_file():
        raise BagError(f'{folder}: exists already and holds no results of a replay: it is not '
                       'replaced')


def _write_json(path: Path, document: Any) -> None:
    path.write_text(json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False) + '\n',
                    encoding='utf-8', errors='backslashreplace')


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.ravel().tolist()
    return list(value) if isinstance(value, tuple) else value


def _software() -> str:
    try:
        return f'stewart_dynamics {metadata.version("stewart_dynamics")}'
    except metadata.PackageNotFoundError:  # run from its sources
        return 'stewart_dynamics'


def _told(what: list[str]) -> list[str]:
    if len(what) <= _TOLD:
        return list(what)
    return [*what[:_TOLD], f'and {len(what) - _TOLD} more']
