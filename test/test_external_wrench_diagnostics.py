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

"""The status of the external wrench: level, text and since when."""

from __future__ import annotations

import numpy as np
import pytest
from referees import rotation_about
from stewart_dynamics import Motion
from stewart_dynamics.external_wrench.estimate import Estimate, ExternalWrench
from stewart_dynamics.external_wrench.measured_legs import MEASURED_LEGS
from stewart_dynamics.messages.joint_state import MISSING_JOINTS
from stewart_dynamics.node.diagnostics.dynamics import DynamicsDiagnostics
from stewart_dynamics.node.diagnostics.external_wrench import ExternalWrenchDiagnostics
from stewart_dynamics.node.diagnostics.periodic_report import ERROR, OK, STALE, Status, WARN
from stewart_dynamics.setpoints.rejections import Rejection
from test_external_wrench import (
    BEGIN, estimates, HEXAPOD, HOME, LOAD, MILLISECOND, resting, UNFILTERED)

TARGET = tuple(HOME.rows.tolist())


def found(load: tuple[float, ...] = LOAD, **changes: float) -> Estimate:
    """Return the second estimate of a hexapod at rest under a load."""
    parameters = HEXAPOD.replaced({**UNFILTERED, **{
        f'external_wrench.{name}': value for name, value in changes.items()}})
    return estimates(ExternalWrench(parameters),
                     resting(HEXAPOD, HOME, load, [BEGIN, BEGIN + MILLISECOND]))[1]


FIRST = estimates(ExternalWrench(HEXAPOD), resting(HEXAPOD, HOME, LOAD, [BEGIN]))[0]
CLEAR = found()
OVER = found(force_max=300.0, moment_max=100.0)


def felt(diagnostics: ExternalWrenchDiagnostics, now: float, estimate: Estimate = CLEAR) -> bool:
    diagnostics.heard(now)
    return diagnostics.estimated(estimate, TARGET, now)


def status(diagnostics: ExternalWrenchDiagnostics, now: float) -> Status:
    only = diagnostics.status(now)
    assert only is not None
    assert only.name == 'external wrench'
    assert only.level == diagnostics.level(now)
    return only


def test_there_is_none_before_a_measurement_has_come() -> None:
    diagnostics = ExternalWrenchDiagnostics(HEXAPOD)
    assert diagnostics.status(5.0) is None
    assert diagnostics.level(1e9) == OK
    diagnostics.heard(6.0)
    assert diagnostics.status(6.0) is not None


def test_the_age_is_that_of_the_last_measurement_in_use() -> None:
    diagnostics = ExternalWrenchDiagnostics(HEXAPOD)
    assert diagnostics.age(5.0) == np.inf
    felt(diagnostics, 6.0, FIRST)  # without a wrench, but with a pose
    diagnostics.heard(6.5)  # and rejected
    assert diagnostics.silence(7.0) == 0.5
    assert diagnostics.age(7.0) == 1.0


def test_it_is_the_last_status() -> None:
    diagnostics = DynamicsDiagnostics(HEXAPOD, ('setpoint/pose',), (), 0.0)
    names = ['setpoints', 'singularity', 'limits', 'timing']
    assert [each.name for each in diagnostics.report.make(0.0)[0]] == names
    assert not diagnostics.report.level_changed(0.0)
    felt(diagnostics.external_wrench, 0.1, OVER)
    assert diagnostics.report.level_changed(0.1)
    assert [each.name for each in diagnostics.report.make(0.1)[0]] == [*names, 'external wrench']
    assert not diagnostics.report.level_changed(0.1)


def test_its_keys_have_force_and_moment() -> None:
    diagnostics = ExternalWrenchDiagnostics(HEXAPOD)
    felt(diagnostics, 1.0)
    now = status(diagnostics, 1.05)
    assert (now.level, now.message) == (OK, 'no overload')
    values = dict(now.values)
    assert CLEAR.wrench is not None
    assert CLEAR.differences is not None
    worst = int(np.argmax(np.abs(CLEAR.differences)))
    assert values == {
        'wrenches': '1', 'age of the last (s)': '0.050',
        'force (N)': f'{np.linalg.norm(LOAD[:3]):.6g}',
        'moment (N m)': f'{np.linalg.norm(LOAD[3:]):.6g}',
        'force x (N)': '150', 'force y (N)': '-100', 'force z (N)': '250',
        'moment x (N m)': '60', 'moment y (N m)': '-40', 'moment z (N m)': '80',
        'largest measured - model force of a leg (N)': f'{CLEAR.differences[worst]:.6g}',
        'its leg': f'leg_{worst + 1}',
        'distance from the last setpoint (m)': values['distance from the last setpoint (m)'],
        'turn from the last setpoint (rad)': values['turn from the last setpoint (rad)']}
    assert float(values['distance from the last setpoint (m)']) < 1e-12


@pytest.mark.parametrize('angle', [1e-9, 1e-3, 1.0, 3.0])
def test_how_far_it_is_from_the_setpoint(angle: float) -> None:
    diagnostics = ExternalWrenchDiagnostics(HEXAPOD)
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    target = Motion([0.003, 0.0, 1.104], rotation_about(axis, angle))
    diagnostics.heard(1.0)
    diagnostics.estimated(CLEAR, target.rows.tolist(), 1.0)
    values = dict(status(diagnostics, 1.0).values)
    assert float(values['distance from the last setpoint (m)']) == pytest.approx(0.005, rel=1e-5)
    assert float(values['turn from the last setpoint (rad)']) == pytest.approx(angle, rel=1e-5)
    diagnostics.estimated(CLEAR, None, 1.0)
    assert not any('setpoint' in key for key, _ in status(diagnostics, 1.0).values)


def test_an_overload_is_an_error_and_held_for_a_second() -> None:
    diagnostics = ExternalWrenchDiagnostics(HEXAPOD)
    assert not felt(diagnostics, 1.0)
    assert status(diagnostics, 1.0).level == OK
    assert felt(diagnostics, 1.01, OVER)
    now = status(diagnostics, 1.01)
    assert now.level == ERROR
    assert now.message == (
        f'force {OVER.force:.6g} N is {OVER.force - 300.0:.6g} N above '
        f'external_wrench.force_max, moment {OVER.moment:.6g} N m is '
        f'{OVER.moment - 100.0:.6g} N m above external_wrench.moment_max')
    assert not felt(diagnostics, 1.5)
    assert status(diagnostics, 1.5).level == ERROR
    assert felt(diagnostics, 2.02)
    assert status(diagnostics, 2.02).level == OK


def test_silence_is_stale() -> None:
    diagnostics = ExternalWrenchDiagnostics(HEXAPOD)
    felt(diagnostics, 1.0)
    assert status(diagnostics, 1.09).level == OK
    now = status(diagnostics, 3.5)
    assert (now.level, now.message) == (STALE, 'no wrench: measured_legs silent for 2.5 s')
    assert felt(diagnostics, 4.0)
    assert status(diagnostics, 4.0).level == OK


def test_measurements_that_are_too_far_apart_are_stale() -> None:
    diagnostics = ExternalWrenchDiagnostics(HEXAPOD)
    for now in (1.0, 1.5, 2.0):
        felt(diagnostics, now, FIRST)
    of = status(diagnostics, 2.0)
    assert (of.level, of.message) == (
        STALE, 'no wrench: measurements are farther apart than setpoint.timeout, 0.1 s')
    assert 'force (N)' not in dict(of.values)
    assert 'distance from the last setpoint (m)' in dict(of.values)


def test_a_rejection_is_reported_and_counted() -> None:
    diagnostics = ExternalWrenchDiagnostics(HEXAPOD)
    felt(diagnostics, 1.0)
    diagnostics.rejected(Rejection(MEASURED_LEGS, MISSING_JOINTS), 'leg_6', 1.01)
    now = status(diagnostics, 1.02)
    assert (now.level, now.message) == (
        WARN, 'measured_legs: lacks one of the joints (leg_6)')
    assert dict(now.values)['rejected, measured_legs: lacks one of the joints'] == '1'
    assert [(level, text) for level, text, _ in diagnostics.log_lines(1.02)] == [
        (WARN, 'external wrench: measured_legs: lacks one of the joints (leg_6)')]
    for n in range(10):
        diagnostics.heard(1.1 + 0.1 * n)
        diagnostics.rejected(Rejection(MEASURED_LEGS, MISSING_JOINTS), 'leg_6', 1.1 + 0.1 * n)
    now = status(diagnostics, 2.0)
    assert (now.level, now.message) == (
        STALE, 'no wrench: measured_legs: lacks one of the joints (leg_6)')
    assert dict(now.values)['rejected, measured_legs: lacks one of the joints'] == '11'
