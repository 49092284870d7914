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

"""Diagnostics of the dynamics node: passes its events to the parts of the report."""

from __future__ import annotations

from collections.abc import Sequence

from stewart_dynamics.external_wrench.measured_legs import MEASURED_LEGS
from stewart_dynamics.node.diagnostics.base_motion import BaseDiagnostics
from stewart_dynamics.node.diagnostics.external_wrench import ExternalWrenchDiagnostics
from stewart_dynamics.node.diagnostics.limits import LimitsDiagnostics
from stewart_dynamics.node.diagnostics.outcomes import (
    PayloadDiagnostics, PlannedTrajectoryDiagnostics)
from stewart_dynamics.node.diagnostics.periodic_report import Answers, PeriodicReport, TICK
from stewart_dynamics.node.diagnostics.setpoints import SetpointDiagnostics, TimingDiagnostics
from stewart_dynamics.node.diagnostics.singularity import SingularityDiagnostics
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.setpoints.rejections import Rejection
from stewart_dynamics.setpoints.step import Output


class DynamicsDiagnostics:
    """The parts of the node's report, from one activation to the next."""

    def __init__(self, parameters: Parameters, topics: Sequence[str],
                 base_topics: Sequence[str], now: float) -> None:
        self._base_topics = base_topics
        self._answers = Answers(parameters['setpoint.timeout'], now)
        self.setpoints = SetpointDiagnostics(parameters, topics, self._answers, now)
        self.singularity = SingularityDiagnostics(parameters, self._answers, now)
        self.limits = LimitsDiagnostics(parameters, self._answers)
        self.base = BaseDiagnostics(parameters, base_topics)
        self.timing = TimingDiagnostics(self._answers, now)
        self.planned_trajectory = PlannedTrajectoryDiagnostics()
        self.external_wrench = ExternalWrenchDiagnostics(parameters)
        self.payload = PayloadDiagnostics()
        self.report = PeriodicReport([
            self.setpoints, self.singularity, self.limits, self.base, self.timing,
            self.planned_trajectory, self.external_wrench, self.payload], now)

    def use(self, parameters: Parameters) -> None:
        """Use other parameters from now on."""
        self.singularity.parameters = self.limits.parameters = parameters

    def answered(self, output: Output, came: float, now: float) -> bool:
        """
        Note an output and the time of arrival of its setpoint.

        Returns whether a report is due.
        """
        self._answers.add(now)
        self.timing.answered(now - came)
        self.limits.answered(output, now)
        crossed = self.singularity.answered(output, now)
        return crossed or self.report.due(now)

    def rejected(self, rejection: Rejection, details: str, now: float) -> None:
        """Note a rejection on any topic."""
        if rejection.topic == MEASURED_LEGS:
            self.external_wrench.rejected(rejection, details, now)
        elif rejection.topic in self._base_topics:
            self.base.rejected(rejection, details, now)
        else:
            self.setpoints.rejected(rejection, details, now)
            self.timing.rejected(rejection, details, now)

    def due_at_tick(self, now: float) -> bool:
        """
        Return whether a report is due at a tick, every TICK seconds.

        While setpoints are answered the report is made after an answer, when there is time.
        """
        if now - self._answers.at < TICK:
            return self.report.level_changed(now)
        return self.report.due(now, early=0.5 * TICK)
