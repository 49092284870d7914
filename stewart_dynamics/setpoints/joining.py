# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Setpoints from messages on the setpoint topics, and the counts of rejected messages.

Node and replay pass the same bytes in the same order, the node one message at a time, the replay
in blocks. External wrench and base have topics of their own: a setpoint gets the values that are
valid when it is complete.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from stewart_dynamics.arrays import Array, Six, Stamps
from stewart_dynamics.mechanics.kinematics.pose_errors import (
    find_pose_error, IN_DEGREES, PoseByAngles)
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.parameters.table import Parameters, POSES_ALONE
from stewart_dynamics.setpoints.base_input import BaseInput
from stewart_dynamics.setpoints.consistency import Consistency, inconsistencies, MessageError
from stewart_dynamics.setpoints.inconsistency_causes import QUANTITIES, RATES
from stewart_dynamics.setpoints.input_messages import ACCEL, COMBINED, SOURCES, TWIST
from stewart_dynamics.setpoints.input_stream import Clock, InputStream, Joined
from stewart_dynamics.setpoints.output_messages import OutputMessages
from stewart_dynamics.setpoints.rejections import Rejection, Rejections
from stewart_dynamics.setpoints.step import Batch, Outputs, SETPOINT, Step


class Setpoints:
    """
    Joins the samples of the setpoint topics by stamp.

    parameters: source of setpoints, frame, tolerance and timeout.
    rejected: called with each rejection and its details; they are counted as well.
    noticed: called with texts for the log: a restart, stamps that are all zero.
    """

    def __init__(
            self, parameters: Parameters, rejected: Callable[[Rejection, str], None],
            noticed: Callable[[str], object]) -> None:
        self.topics = SOURCES[parameters.setpoint.source]
        self._rejections = Rejections(rejected)
        self._stream = InputStream(parameters, self.topics, self._rejections, noticed)
        self.base = BaseInput(parameters, self._rejections, noticed, self._stream)
        self._consistency = None if parameters.setpoint.source == POSES_ALONE else Consistency(
            parameters.singularity.characteristic_length,
            (parameters.base_frame, parameters.platform_frame))
        self._checks = [each for each in (self._consistency, self.base.consistency) if each]
        self._parameters = parameters
        self._none = Batch(np.empty(0, dtype=np.int64), np.empty((0, SETPOINT)),
                           np.empty(0, dtype=np.int64), bool(self.base.topics))
        self._unchecked: list[Batch] = []
        # Rows of motion; empty before the first.
        self._first = self._last = np.empty(0)
        self._topic_of = dict.fromkeys(QUANTITIES, COMBINED) if COMBINED in self.topics else (
            dict.fromkeys(QUANTITIES, TWIST) | dict.fromkeys(RATES, ACCEL))
        self.unknown_angles: Sequence[PoseByAngles] = ()
        """Poses of a table by angles without a unit, which are checked at the end."""

    @property
    def counts(self) -> Counter[Rejection]:
        """Return the number of rejections so far, by topic and reason."""
        return self._rejections.counts

    @property
    def recorded(self) -> int | None:
        """Return when a recorded message was recorded whose rejection is reported [ns]."""
        return self._stream.recorded

    @property
    def wrench(self) -> Six:
        """Return the known load on the platform, from the last ``~/wrench`` [N, N m]."""
        return self._stream.wrench

    def possible_errors(self, ever: bool = False) -> list[MessageError]:
        """
        Return the possible errors in setpoints and base motion.

        ever: all that were found; by default the present ones.
        """
        self._note_setpoints()
        found = inconsistencies(self._consistency, ever, self._topic_of)
        # The last pose is judged only where twists differ.
        of_pose = (self._angle_error() or self._pose_error('first', self._first) if ever
                   else self._pose_error('last', self._last) if found else [])
        if of_pose:
            # Derivatives of wrong poses do not show the error in twists.
            found = inconsistencies(self._consistency, ever, self._topic_of, reasons=False)
        return of_pose + found + self.base.possible_errors(ever)

    def _angle_error(self) -> list[MessageError]:
        """Return the possible error in most poses by angles without a unit, if they are wrong."""
        found = Counter(find_pose_error(self._parameters, pose.row, False, pose.angles)
                        for pose in self.unknown_angles)
        for text, count in found.most_common(1):
            if IN_DEGREES in text and 2 * count >= found.total():
                pose = max(self.unknown_angles, key=lambda each: each.angles.largest)
                return [MessageError(self.topics[0], (
                    f'{text}: {pose.angles.largest:.3g} is read in rad; {pose.advice} reads '
                    'degrees'))]
        return []

    def _pose_error(self, which: str, motion: Array) -> list[MessageError]:
        """Return the possible error in the pose of a row of motion."""
        if not len(motion):
            return []
        text = find_pose_error(self._parameters, motion.tolist(), first=motion is self._first)
        return [MessageError(self.topics[0], f'{which} setpoint: {text}')] if text else []

    def check_samples(self) -> None:
        """Check setpoints and samples so far, if there are enough; called when there is time."""
        self._note_setpoints()
        for consistency in self._checks:
            consistency.check_samples()

    def join_message(self, topic: str, data: bytes, clock: Clock) -> Batch:
        """Return the setpoint that a message completes, if any; ``check_samples`` checks it."""
        return self._note_joined(self._stream.join_message(topic, data, clock), None)

    def join_messages(self, messages: Messages) -> Batch:
        """Return the setpoints that recorded messages complete."""
        setpoints = self._note_joined(self._stream.join_messages(messages), messages.times)
        self._note_setpoints()
        return setpoints

    def _note_joined(self, joined: Joined, times: Stamps | None) -> Batch:
        """Note joined samples for the checks; return the setpoints."""
        if len(joined.base_stamps):
            self.base.note_samples(joined)
        if not len(joined.stamps):
            return self._none
        stamps = joined.stamps.copy()
        setpoints = Batch(stamps, joined.rows.copy(), stamps if times is None else times[
            joined.places], self._none.moving)
        self._unchecked.append(setpoints)
        return setpoints

    def answer_setpoints(self, step: Step, messages: OutputMessages,
                         publish: Callable[[dict[str, bytes]], object]) -> None:
        """Answer setpoints from now on, see ``InputStream``."""
        self._stream.answer_setpoints(step, messages, publish)

    def hold_answers(self, held: bool) -> None:
        """Complete setpoints without an answer, until ``answer_setpoint``."""
        self._stream.hold_answers(held)

    def answer_setpoint(self, setpoint: Batch) -> None:
        """Answer a single setpoint that was held."""
        self._stream.answer_setpoint(setpoint)

    def last_outputs(self) -> Outputs:
        """Return the outputs of the last single setpoint."""
        return self._stream.last_outputs()

    def _note_setpoints(self) -> None:
        """Note setpoints for the checks: after they are answered."""
        for setpoints in self._unchecked:
            motions = setpoints.motions
            if not len(self._first):
                self._first = motions[0].copy()
            self._last = motions[-1]
            if self._consistency is not None:
                self._consistency.note_samples(setpoints.stamps, motions, setpoints.restarts)
        self._unchecked.clear()

    def drop_waiting(self, why: str) -> None:
        """Drop and count waiting samples: no more messages arrive."""
        self._stream.drop_waiting(why)
        self._note_setpoints()
        for consistency in self._checks:
            consistency.finish()

    def restart(self, why: str) -> None:
        """Follow setpoints and base from any time on; the next setpoint is a restart."""
        self._stream.drop_waiting(why, restart=True)

    def reject(self, topic: str, reason: str, details: str, number: int = 1) -> None:
        """Count and report messages that are not used."""
        self._rejections.reject(topic, reason, details, number)
