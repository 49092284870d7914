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

"""The status of planned trajectories, within the node's diagnostics."""

from __future__ import annotations

from referees import ROOT

from stewart_dynamics import Parameters
from stewart_dynamics.node.diagnostics.dynamics import DynamicsDiagnostics
from stewart_dynamics.node.diagnostics.outcomes import PlannedTrajectoryDiagnostics
from stewart_dynamics.node.diagnostics.periodic_report import ERROR, LogLine, OK, WARN
from stewart_dynamics.planned.messages import PlannedOutcome

PLATFORM = ROOT / 'config' / 'platform.yaml'
BEGIN = 100.0
ACCEPTED = PlannedOutcome('accepted: 2 points', answer=b'1')
REJECTED = PlannedOutcome('rejected: x', 'why', values=(('points', '3'),))


def test_planned_trajectories_have_a_status_once_there_was_one() -> None:
    diagnostics = DynamicsDiagnostics(Parameters.from_yaml(PLATFORM), ['setpoint/pose'], (), BEGIN)
    report, planned = diagnostics.report, diagnostics.planned_trajectory
    assert [each.name for each in report.make(BEGIN)[0]][-1] == 'timing'
    planned.done(ACCEPTED, 0.25)
    assert report.make(BEGIN)[0][-1] == ('planned trajectory', OK, 'accepted: 2 points', (
        ('accepted', '1'), ('rejected', '0'), ('time it took (s)', '0.250')))
    assert not report.level_changed(BEGIN)
    planned.done(REJECTED, 0.1)
    assert report.level_changed(BEGIN)
    # It lasts until the next.
    for now in (BEGIN, BEGIN + 100.0):
        status = report.make(now)[0][-1]
        assert status.name == 'planned trajectory'
        assert status.level == ERROR
        assert dict(status.values) == {
            'accepted': '1', 'rejected': '1', 'rejected: why': '1', 'points': '3',
            'time it took (s)': '0.100'}
    planned.done(ACCEPTED._replace(warning=True), 0.1)
    assert report.make(BEGIN)[0][-1].level == WARN


def test_outcomes_that_took_long_are_logged() -> None:
    planned = PlannedTrajectoryDiagnostics()
    for outcome, seconds in ((ACCEPTED, 1.9), (ACCEPTED, 2.14), (ACCEPTED, 3.0), (REJECTED, 4.0)):
        planned.done(outcome, seconds)
    assert planned.log_lines(BEGIN) == [
        LogLine(OK, 'planned trajectory: accepted: 2 points (took 2.1 s)'),
        LogLine(OK, 'planned trajectory: accepted: 2 points (took 3.0 s)'),
        LogLine(ERROR, 'planned trajectory rejected: x (took 4.0 s)', 'why')]


def test_each_rejection_is_logged_and_of_other_outcomes_the_changes() -> None:
    planned = DynamicsDiagnostics(
        Parameters.from_yaml(PLATFORM), ['setpoint/pose'], (), BEGIN).planned_trajectory
    planned.done(ACCEPTED, 0.1)
    assert planned.log_lines(BEGIN) == []
    for _ in range(2):
        planned.done(REJECTED, 0.1)
    assert planned.log_lines(BEGIN) == 2 * [
        LogLine(ERROR, 'planned trajectory rejected: x', 'why')]
    assert planned.log_lines(BEGIN) == []
    for outcome in (ACCEPTED, ACCEPTED, ACCEPTED._replace(warning=True), REJECTED):
        planned.done(outcome, 0.1)
    assert planned.log_lines(BEGIN) == [
        LogLine(OK, 'planned trajectory: accepted: 2 points'),
        LogLine(WARN, 'planned trajectory: accepted: 2 points'),
        LogLine(ERROR, 'planned trajectory rejected: x', 'why')]
