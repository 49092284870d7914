# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The report of the dynamics node: passes its events to the statuses, and says when it is due."""

from __future__ import annotations

from collections.abc import Sequence

from stewart_dynamics.external_wrench.measured_legs import MEASURED_LEGS
from stewart_dynamics.mechanics.kinematics.home_pose import determinant_at_home
from stewart_dynamics.mechanics.kinematics.pose_errors import find_pose_error
from stewart_dynamics.mechanics.limits import Exceedance
from stewart_dynamics.node.diagnostics.answers import (
    Answers, LimitsDiagnostics, SingularityDiagnostics, TimingDiagnostics)
from stewart_dynamics.node.diagnostics.input_statuses import (
    BaseDiagnostics, INCOMPLETE, SetpointDiagnostics)
from stewart_dynamics.node.diagnostics.levels import LogLine, PERIOD, REJECTED, Status, StatusPart
from stewart_dynamics.node.diagnostics.outcomes import (
    ExternalWrenchDiagnostics, PayloadDiagnostics, PlannedTrajectoryDiagnostics)
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.setpoints.consistency import MessageError
from stewart_dynamics.setpoints.rejections import DROPPED, NOT_JOINED, Rejection
from stewart_dynamics.setpoints.step import Batch, Outputs

# Period at which the node calls ``due_at_tick`` [s].
TICK = 0.05


class DynamicsDiagnostics:
    """The statuses of the node, from one activation to the next."""

    def __init__(self, parameters: Parameters, topics: Sequence[str],
                 base_topics: Sequence[str], now: float) -> None:
        self.answers = Answers(parameters, now)
        self.setpoints = SetpointDiagnostics(self.answers, topics)
        self.singularity = SingularityDiagnostics(self.answers)
        self.limits = LimitsDiagnostics(self.answers)
        self.base = BaseDiagnostics(parameters, base_topics)
        self.timing = TimingDiagnostics(self.answers, self.setpoints.rejections)
        self.planned_trajectory = PlannedTrajectoryDiagnostics()
        self.external_wrench = ExternalWrenchDiagnostics(parameters)
        self.payload = PayloadDiagnostics(parameters)
        self.parts: list[StatusPart] = [
            self.setpoints, self.singularity, self.limits, self.base, self.timing,
            self.planned_trajectory, self.external_wrench, self.payload]
        self._levels_of = [part.level for part in self.parts]
        self._made = now
        self._levels: list[int] = []  # those of the last report

    def begins(self, motion: Sequence[float], determinant: float) -> None:
        """Note the first setpoint, a row of motion, and its det(J) [m^3]."""
        parameters = self.answers.parameters
        self.singularity.begins(
            find_pose_error(parameters, motion),
            determinant * determinant_at_home(parameters) < 0.0)

    def answered(self, setpoint: Batch, outputs: Outputs, exceedances: Sequence[Exceedance],
                 came: float, now: float) -> bool:
        """
        Note a single setpoint, its outputs, the limits it exceeds, and its time of arrival.

        Returns whether a report is due.
        """
        self.answers.add(outputs, now - came, now)
        self.limits.answered(setpoint, exceedances, now)
        crossed = self.singularity.answered(now)
        return crossed or self._due(now)

    def rejected(self, rejection: Rejection, details: str, now: float) -> None:
        """Note a rejection on any topic."""
        if rejection.topic == MEASURED_LEGS:
            self.external_wrench.rejected(rejection, details, now)
        elif rejection.topic in self.base.heard:
            self.base.rejected(rejection, details, now)
        else:
            self.setpoints.rejected(rejection, details, now, (
                INCOMPLETE if rejection.reason == NOT_JOINED else REJECTED))
            if rejection.reason == DROPPED:
                self.timing.rejected(rejection, details, now)

    def note_errors(self, errors: Sequence[MessageError], now: float) -> None:
        """Note the possible errors in setpoints and base motion."""
        of_base = [each for each in errors if each.topic in self.base.heard]
        self.base.note_errors(of_base, now)
        self.setpoints.note_errors([each for each in errors if each not in of_base], now)

    def level_changed(self, now: float) -> bool:
        """Return whether a level has changed since the last report."""
        return [level(now) for level in self._levels_of] != self._levels

    def due_at_tick(self, now: float) -> bool:
        """
        Return whether a report is due at a tick, every TICK seconds.

        While setpoints are answered the report is made after an answer, when there is time.
        """
        if now - self.answers.at < TICK:
            return self.level_changed(now)
        return self._due(now, early=0.5 * TICK)

    def report(self, now: float) -> tuple[list[Status], list[LogLine]]:
        """Return the statuses, and the lines for the log."""
        self._made = now
        self._levels = [level(now) for level in self._levels_of]
        statuses, lines = [], []
        for part in self.parts:
            status = part.status(now)
            if status is not None:
                statuses.append(status)
                lines += part.log_lines(status, now)
        self.answers.end_second(now)
        return statuses, lines

    def _due(self, now: float, early: float = 0.0) -> bool:
        return now - self._made >= PERIOD - early or self.level_changed(now)
