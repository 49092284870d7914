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

"""The status of planned motions, within the node's diagnostics."""

from __future__ import annotations

from referees import ROOT

from stewart_dynamics import Parameters
from stewart_dynamics.runtime.diagnostics import Diagnostics, ERROR, OK, WARN
from stewart_dynamics.runtime.planned_trajectory_diagnostics import PlannedDiagnostics
from stewart_dynamics.runtime.planned_trajectory_messages import Outcome

PLATFORM = ROOT / 'config' / 'platform.yaml'
BEGIN = 100.0


def test_planned_motions_have_a_status_once_there_was_one() -> None:
    planned = PlannedDiagnostics()
    diagnostics = Diagnostics(Parameters.from_yaml(PLATFORM), ['setpoint/pose'], BEGIN, [planned])
    assert [each.name for each in diagnostics.report(BEGIN)][-1] == 'timing'
    status = planned.done(Outcome('answered: 2 points', answer=b'1'), 0.25)
    assert diagnostics.report(BEGIN)[-1] == status == ('trajectory', OK, 'answered: 2 points', (
        ('answered', '1'), ('refused', '0'), ('time it took (s)', '0.250')))
    assert not diagnostics.level_changed(BEGIN)
    refusal = Outcome('refused: x', 'why', values=(('points', '3'),))
    planned.done(refusal, 0.1)
    assert diagnostics.level_changed(BEGIN)
    # It lasts until the next.
    for now in (BEGIN, BEGIN + 100.0):
        status = diagnostics.report(now)[-1]
        assert status.name == 'trajectory'
        assert status.level == ERROR
        assert dict(status.values) == {
            'answered': '1', 'refused': '1', 'refused: why': '1', 'points': '3',
            'time it took (s)': '0.100'}
    planned.done(Outcome('answered', answer=b'1', warning=True), 0.1)
    assert diagnostics.report(BEGIN)[-1].level == WARN
