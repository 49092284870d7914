# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The replay of one bag: the node's outputs, a summary and a report; needs no ROS.

Setpoints pass through the same joining and the same step as in the node, in the order of the bag,
so the outputs are those of the node, bit for bit. They are processed in blocks of some thousand;
the memory used does not grow with the bag.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing, ExitStack
import hashlib
import json
from pathlib import Path
from typing import Any, NamedTuple, TYPE_CHECKING

from msgspec.structs import replace
import numpy as np

from stewart_dynamics.arrays import Array, NANOSECOND, SECOND, Stamps
from stewart_dynamics.bags.csv_motion import CsvMotion
from stewart_dynamics.bags.feed import feed_subscribers, Subscription
from stewart_dynamics.bags.find import bytes_of, RESULT
from stewart_dynamics.bags.recording import LISTED, listed, Recording
from stewart_dynamics.errors import StewartError
from stewart_dynamics.mechanics.drives.measured_efforts import force_per_effort
from stewart_dynamics.mechanics.drives.servos import outside_servos, pulse_rows, with_servos
from stewart_dynamics.mechanics.dynamics.force_breakdown import ForceBreakdownRows
from stewart_dynamics.mechanics.parameter_errors import find_parameter_errors
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.messages.joint_state import JointStateReader, NUMBERS_END
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.parameters.table import Parameters, POSES_ALONE
from stewart_dynamics.program import SOFTWARE
from stewart_dynamics.replay.bag_report import Report
from stewart_dynamics.replay.bag_summary import (
    BagSummary, Inputs, Mistake, Rejected, Setpoints as SetpointsOfBag, VERSION)
from stewart_dynamics.replay.bag_topics import find_topics, notices_of
from stewart_dynamics.replay.differentiate import differentiator
from stewart_dynamics.replay.output_files import OutputFiles
from stewart_dynamics.replay.replay_options import code_of, Options
from stewart_dynamics.replay.residuals import Comparison, Efforts
from stewart_dynamics.replay.summary import Answered, powers_of, Summary
from stewart_dynamics.replay.summary_text import summary_text
from stewart_dynamics.reporting.results_folder import check_free, REPORT_PAGE, whole_folder
from stewart_dynamics.response.recorded_response import (
    Followed, MEASURED, MEASURED_POSE, RecordedResponse)
from stewart_dynamics.setpoints import input_messages as inputs
from stewart_dynamics.setpoints.base_wrench_step import BaseWrench
from stewart_dynamics.setpoints.joining import Setpoints
from stewart_dynamics.setpoints.rejections import OUT_OF_REACH, Rejection, stamp_of
from stewart_dynamics.setpoints.step import Batch, FIRST, Step
from stewart_dynamics.setpoints.unanswered import unanswered
from stewart_dynamics.whole_file import write_json

if TYPE_CHECKING:
    from stewart_dynamics.replay.uncertain_loads import UncertainLoads

Progress = Callable[[int, int], None]

# Starting processes takes as long as writing the outputs of a bag of this size [bytes].
_LARGE = 32 << 20


class Replayed(NamedTuple):
    """The result of a replay."""

    bag: Path
    folder: Path
    summary: BagSummary  # the content of summary.json
    text: str  # the summary for the terminal
    code: int  # DONE, LIMIT_MET or PARTLY_READ, the most severe


def replay(
        bag: Path, parameters: Parameters, folder: Path, options: Options | None = None,
        progress: Progress | None = None) -> Replayed:
    """
    Replay a bag into a folder: a bag, a table, a summary and a report.

    bag: a bag: a folder or a file.
    folder: folder of the results; it gets this name when complete, and must not exist, unless
        ``options.force``.
    options: topics to read, and files to write.
    progress: called with the bytes read and the setpoints answered since the last call.

    Raises BagError if the bag cannot be read or lacks a topic, or if the folder exists.
    Raises StewartError if a library needed for an option is missing.
    """
    options = options or Options()
    before = check_free(folder, options)
    made_of = fingerprint(bag, parameters, options)
    parameters = options.applied_to(parameters, bag)
    with closing(Recording(
            bag, options.reading_of_bag, parameters.platform_frame,
            lambda: StewartPlatform(parameters).home_pose().position)) as recording:
        topics = find_topics(recording, parameters, options)
        notices = notices_of(recording, topics, parameters, options)
        with whole_folder(folder, options, before=before) as partial, ExitStack() as stack:
            run = _Run(recording, topics, parameters, options, partial, stack)
            run.notices += [*find_parameter_errors(parameters), *notices]
            answered = 0
            for size in feed_subscribers(recording, run.subscriptions()):
                if progress is not None:
                    progress(size, run.answered - answered)
                answered = run.answered
            if options.measured_table is not None:
                run.take_table(CsvMotion(options.measured_table, options.reading, None))
            run.end()
            summary = replace(run.summary(), fingerprint=made_of)
            write_json(partial / RESULT, summary)
            if run.report is not None:
                run.report.write_page(
                    partial / REPORT_PAGE, summary, options.plotly, run.followed,
                    options.capability_command(bag))
    return Replayed(bag, folder, summary, summary_text(summary, parameters), code_of(summary))


def fingerprint(bag: Path, parameters: Parameters, options: Options) -> str:
    """
    Return a digest that changes with whatever the results of a replay depend on.

    It covers names, sizes and times of modification of the files of the bag; it is empty if these
    cannot be read.
    """
    try:
        files = [[file.name, found.st_size, found.st_mtime_ns]
                 for file in (*(sorted(bag.iterdir()) if bag.is_dir() else [bag]),
                              *([options.measured_table] if options.measured_table else []))
                 if (found := file.stat())]
    except OSError:  # reported when the bag is opened
        return ''
    about = {
        'program': [SOFTWARE, VERSION], 'files': files, 'parameters': parameters.plain(),
        'options': [[name, dict(value) if name == 'topics' else value]
                    for name, value in options._asdict().items()
                    if name not in ('force', 'run', 'params')]}
    text = json.dumps(about, sort_keys=True, default=str)
    return hashlib.sha256(text.encode('utf-8', 'backslashreplace')).hexdigest()


class _First(NamedTuple):
    """The first message that was rejected for a reason."""

    details: str
    stamp: int | None  # [ns], if the details begin with it
    recorded: int | None  # when it was recorded [ns]


class _Run:
    """One replay: from messages to the files, the summary and the report."""

    def __init__(self, recording: Recording, topics: dict[str, str], parameters: Parameters,
                 options: Options, folder: Path, stack: ExitStack) -> None:
        self._recording, self._topics = recording, topics
        self._parameters, self._options = parameters, options
        self.notices: list[str] = []
        self.answered = 0  # number of setpoints
        self._more = 0
        self._quasi_static = (
            parameters.setpoint.source == POSES_ALONE and options.cutoff is None)
        if self._quasi_static:
            self.notices.append('setpoint.source is pose: the forces are those at rest')
        self._firsts: dict[Rejection, _First] = {}
        self._first_time: int | None = None
        self._setpoints = Setpoints(parameters, self._rejected, self._notice)
        self._setpoints.unknown_angles = recording.unknown_angles
        self._step = Step(parameters)
        self._platform = StewartPlatform(parameters)
        self._base_wrench = BaseWrench(parameters)
        self._state = FIRST
        self._stamp: int | None = None
        self._elapsed = 0, 0  # [s], [ns]
        self._summary = Summary(parameters, self._quasi_static)
        self._differentiator = differentiator(parameters, options)
        self._per_effort = force_per_effort(
            parameters, options.motor_torque, options.motor_current)
        self._comparison = None if options.measured is None else Comparison(
            parameters, self._per_effort is not None)
        self._efforts = Efforts(parameters.joints)
        self._with_servos = with_servos(parameters)
        self._outside_servos, self._first_outside = 0, ''  # setpoints, and the first in words
        self._response = RecordedResponse(
            parameters, topics if options.measured_table is None else {
                MEASURED_POSE: str(options.measured_table)}, self._setpoints.reject,
        ) if options.response else None
        self.followed: Followed | None = None
        self._uncertain: UncertainLoads | None = None
        if options.uncertainty:  # imported where it is used: the simulator is as large as the rest
            from stewart_dynamics.replay import uncertain_loads

            self._uncertain = uncertain_loads.UncertainLoads(parameters, options.uncertainty)
            if not any(name.startswith('uncertainty.') for name in parameters.given):
                self.notices.append('uncertainty.* are not given: the defaults are weak')
        self._response_missing = ''
        self._first_measured = True
        self.report: Report | None = None
        if options.report:
            self.report = Report(parameters, options.measured is not None, folder,
                                 options.uncertainty > 0)
            self._breakdown = ForceBreakdownRows(parameters)
        self._files = OutputFiles(
            folder, parameters, options, self._quasi_static,
            [topic for topic in topics if topic not in (MEASURED, MEASURED_POSE)],
            bytes_of(recording.path) > _LARGE)
        stack.callback(self._files.abandon)

    def subscriptions(self) -> list[Subscription]:
        """Return the subscriptions: of each block the measured legs come first."""
        measured, setpoints = ({name: key for key, name in self._topics.items()
                                if (key in (MEASURED, MEASURED_POSE)) is wanted}
                               for wanted in (True, False))
        return [Subscription(measured, self._take_measured),
                Subscription(setpoints, self._take_setpoints)]

    def _take_setpoints(self, messages: Messages) -> None:
        """Answer messages of setpoints, base and external wrench."""
        self._files.write_inputs(messages)
        setpoints = self._setpoints.join_messages(messages)
        if self._differentiator is not None:
            setpoints = self._differentiator.add_setpoints(setpoints)
        self._answer(setpoints)

    def take_table(self, table: CsvMotion) -> None:
        """Process achieved poses of a table; with setpoints of a table they share a clock."""
        assert self._response is not None
        commanded, shift = self._recording.table, 0
        if commanded is not None:  # each of them may have been shifted, if it begins at zero
            begins = [each.begin - each.stamps[0] * NANOSECOND for each in (table, commanded)]
            shift = round((begins[0] - begins[1]) * SECOND)
        self._response.take_poses(table.stamps + shift, table.poses)
        self.notices += table.notices

    def end(self) -> None:
        """Process the end of the bag, and complete the files."""
        self._setpoints.drop_waiting('the bag ends')
        if self._differentiator is not None:
            self._answer(self._differentiator.finish())
            for reason, number in self._differentiator.left_out.items():
                self._setpoints.reject(inputs.POSE, reason, '', number)
            for notice in self._differentiator.notices():
                self._notice(notice)
        if self._comparison is not None:
            self._efforts.check()
            self._compared(self._comparison.finish())
            if self._comparison.too_large:
                self._notice(
                    f'{self._comparison.too_large} of the setpoints have computed efforts of '
                    f'{NUMBERS_END:g} or more: they are not compared with measured ones')
        if self._response is not None:
            try:
                self.followed = self._response.finish()
            except StewartError as exc:
                self._response_missing = f'{exc}'
            for notice in self._response.notices:
                self._notice(notice)
        if self._outside_servos:
            self._notice(f'servo_pulses: none for {self._outside_servos} of the setpoints, '
                         f'first at {self._first_outside}')
        self._files.close()

    def summary(self) -> BagSummary:
        """Return the content of summary.json."""
        missing = list(self._recording.missing)
        values = self._summary.values()
        points = values.setpoints
        if not points.answered:
            missing.append('no setpoint could be answered')
        elif points.base_unknown == points.answered:
            missing.append("the base's motion is not known at any setpoint: there are no forces")
        errors = self._setpoints.possible_errors(ever=True)
        if self._differentiator is not None:
            errors += self._differentiator.stamps.possible_errors(True, [inputs.POSE])
        if self._comparison is not None:
            errors += self._comparison.stamps.possible_errors(True, [MEASURED])
        unreachable = any(each.reason == OUT_OF_REACH for each in self._setpoints.counts)
        measured = None if self._comparison is None else self._comparison.values()
        if measured and not measured.setpoints_compared:
            missing.append(f'nothing could be compared with {self._options.measured}: no '
                           f'setpoint has valid samples on both sides of its stamp')
        if self._response_missing:
            missing.append(self._response_missing)
        notices = [*self._recording.notices, *self.notices]
        if self._more:
            notices.append(f'and {self._more} more like these')
        options = self._options
        return replace(
            values, bag=str(self._recording.path), run=options.run, complete=not missing,
            missing=listed(missing), notices=notices,
            inputs=Inputs(options.node, self._topics, options.cutoff, options.measured,
                          options.measured_pose, options.motor_torque, options.motor_current),
            rejected=[Rejected(
                rejection.topic, rejection.reason, number, self._firsts[rejection].details,
                self._rejected_at(self._firsts[rejection], points))
                for rejection, number in sorted(self._setpoints.counts.items())],
            limit_met=(values.limit_met or bool(errors) or unreachable
                       or self._outside_servos > 0),
            mistakes=[Mistake(each.topic, each.text, _since_first(each.first, points))
                      for each in errors],
            measured=measured, response=self.followed and self.followed.values,
            uncertainty=self._uncertain and self._uncertain.values(),
            parameters=self._parameters.plain())

    def _rejected(self, rejection: Rejection, details: str) -> None:
        if rejection not in self._firsts:
            self._firsts[rejection] = _First(
                details, stamp_of(details)[0], self._setpoints.recorded if details else None)

    def _rejected_at(self, first: _First, setpoints: SetpointsOfBag) -> float | None:
        """Return when a message was rejected, since the first setpoint [s]; None: not known."""
        at = _since_first(first.stamp, setpoints)
        if at is None and self._first_time is not None and first.recorded is not None:
            return (first.recorded - self._first_time) * NANOSECOND
        return at

    def _notice(self, text: str) -> None:
        if len(self.notices) < LISTED:
            self.notices.append(text)
        else:
            self._more += 1

    def _answer(self, setpoints: Batch) -> None:
        """Take the step for setpoints; write its outputs and add them to summary and report."""
        if not len(setpoints.stamps):
            return
        outputs = self._step(setpoints, self._state)
        self._state = outputs.state
        for reason in unanswered(self._parameters, setpoints, outputs):
            self._setpoints.reject('setpoint', *reason)
        if len(outputs.stamps) < len(setpoints.stamps):
            setpoints = setpoints.chosen(outputs.answered)
        if not len(setpoints.stamps):
            return
        if self._first_time is None:
            self._first_time = int(setpoints.times[0])
        block = Answered(self._seconds(setpoints.stamps), setpoints, outputs,
                         self._base_wrench(setpoints),
                         powers_of(self._platform, setpoints, outputs))
        self._files.write(block)
        if self._with_servos:
            self._note_servos(block)
        bands = None if self._uncertain is None else self._uncertain.add(block)
        if self.report is not None:
            block = block._replace(breakdown=self._breakdown(
                setpoints.motions, setpoints.wrenches, setpoints.bases))
            self.report.add_block(block, bands)
        self._summary.add_block(block)
        if self._comparison is not None:
            self._compared(self._comparison.add_setpoints(block.seconds, setpoints, outputs))
        if self._response is not None:
            self._response.add(setpoints)
        self.answered += len(setpoints.stamps)

    def _note_servos(self, block: Answered) -> None:
        """Count setpoints with an angle outside the points of its servo: they have no pulses."""
        positions = block.outputs.drive_positions
        outside = np.flatnonzero(np.isnan(pulse_rows(self._parameters, positions)[0][:, 0]))
        if len(outside) and not self._outside_servos:
            n = int(outside[0])
            self._first_outside = (f't = {block.seconds[n]:.3f} s: '
                                   f'{outside_servos(self._parameters, positions[n])}')
        self._outside_servos += len(outside)

    def _seconds(self, stamps: Stamps) -> Array:
        """Return the time since the first setpoint, never decreasing [s]."""
        steps = np.diff(stamps, prepend=stamps[0] if self._stamp is None else self._stamp)
        # Seconds and nanoseconds separately: clocks that differ by years exceed 2^63 ns in sum.
        whole, rest = np.divmod(np.maximum(steps, 0), SECOND)
        whole, rest = self._elapsed[0] + np.cumsum(whole), self._elapsed[1] + np.cumsum(rest)
        self._stamp = int(stamps[-1])
        self._elapsed = int(whole[-1] + rest[-1] // SECOND), int(rest[-1] % SECOND)
        seconds: Array = (whole + rest // SECOND) + (rest % SECOND) * NANOSECOND
        return seconds

    def _take_measured(self, messages: Messages) -> None:
        """Process messages of the measured legs or poses."""
        if self._response is not None:
            self._response.read_messages(messages)
            if self._first_measured and not self._efforts_recorded(messages):
                self._comparison = None  # the response needs none
            self._first_measured = False
        if self._comparison is None:
            return
        stamps, efforts, rejected = self._efforts.read_efforts(messages)
        for reason, number in rejected.items():
            self._setpoints.reject(MEASURED, reason, '', number)
        if self._per_effort is not None:
            efforts = efforts * self._per_effort
        self._compared(self._comparison.add_measured(stamps, efforts))

    def _efforts_recorded(self, messages: Messages) -> bool:
        reader = JointStateReader(self._parameters.joints, ['effort'])
        return len(reader.read_states(messages).stamps) > 0

    def _compared(self, compared: Any) -> None:
        if self.report is not None and len(compared[0]):
            self.report.add_measured(*compared)


def _since_first(stamp: int | None, setpoints: SetpointsOfBag) -> float | None:
    """Return the time of a stamp since the first setpoint [s]; None: not known."""
    begin = setpoints.first_stamp_ns
    if stamp is None or begin is None or setpoints.restarts:
        return None
    return (stamp - begin) * NANOSECOND
