# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The status of the external wrench: level, text and since when."""

from __future__ import annotations

import messages
import numpy as np
import pytest
from referees import rotation_about, symmetric_parameters
from snapshot import Snapshot
from stewart_dynamics import Motion
from stewart_dynamics.external_wrench.estimate import Estimate, ExternalWrench
from stewart_dynamics.external_wrench.measured_legs import MEASURED_LEGS
from stewart_dynamics.messages.joint_state import MISSING_JOINTS
from stewart_dynamics.node.diagnostics.levels import (
    ERROR, NEVER, OK, STALE, Status, StatusPart, WARN)
from stewart_dynamics.node.diagnostics.outcomes import ExternalWrenchDiagnostics
from stewart_dynamics.node.diagnostics.periodic_report import DynamicsDiagnostics
from stewart_dynamics.possible_errors.hypothesis import PossibleError
from stewart_dynamics.setpoints.base_input import BaseInput
from stewart_dynamics.setpoints.input_messages import BASE_ACCEL, BASE_IMU, BASE_POSE, BASE_TWIST
from stewart_dynamics.setpoints.rejections import NOT_MEASURED, Rejection, Rejections
from test_diagnostics import stated
from test_external_wrench import (
    BEGIN, estimates, HEXAPOD, HOME, LOAD, MILLISECOND, resting, UNFILTERED)

PROGRAM = 'stewart_dynamics'

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


def felt(diagnostics: ExternalWrenchDiagnostics, now: float, estimate: Estimate = CLEAR) -> None:
    diagnostics.heard(now)
    diagnostics.estimated(estimate, TARGET, now)


def status(part: StatusPart, now: float) -> Status:
    """Return the status of a part, whose level is the one that is judged after each answer."""
    only = part.status(now)
    assert only is not None
    assert only.name == part.name
    assert only.level == part.level(now)
    return only


def logged(part: StatusPart, now: float) -> list[tuple[int, str]]:
    return [(level, text) for level, text, _ in part.log_lines(status(part, now), now)]


def test_the_status_exists_after_the_first_measurement() -> None:
    diagnostics = ExternalWrenchDiagnostics(HEXAPOD)
    assert diagnostics.status(5.0) is None
    assert diagnostics.level(1e9) == OK
    diagnostics.heard(6.0)
    assert diagnostics.status(6.0) is not None


def test_the_age_is_that_of_the_last_measurement_in_use() -> None:
    diagnostics = ExternalWrenchDiagnostics(HEXAPOD)
    assert (diagnostics.heard_at, diagnostics.used_at) == (NEVER, NEVER)
    felt(diagnostics, 6.0, FIRST)  # without a wrench, but with a pose
    diagnostics.heard(6.5)  # and rejected
    assert (diagnostics.heard_at, diagnostics.used_at) == (6.5, 6.0)


def test_the_status_of_the_wrench_is_the_last() -> None:
    diagnostics = DynamicsDiagnostics(HEXAPOD, ('setpoint/pose',), (), 0.0)
    names = ['setpoints', 'singularity', 'limits', 'timing']
    assert [each.name for each in diagnostics.report(0.0)[0]] == names
    assert not diagnostics.level_changed(0.0)
    felt(diagnostics.external_wrench, 0.1, OVER)
    assert diagnostics.level_changed(0.1)
    assert [each.name for each in diagnostics.report(0.1)[0]] == [*names, 'external wrench']
    assert not diagnostics.level_changed(0.1)


def test_the_status_has_force_and_moment(snapshot: Snapshot) -> None:
    diagnostics = ExternalWrenchDiagnostics(HEXAPOD)
    felt(diagnostics, 1.0)
    now = stated(snapshot, OK, status(diagnostics, 1.05))
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


def test_an_overload_is_an_error_and_held_for_a_second(snapshot: Snapshot) -> None:
    diagnostics = ExternalWrenchDiagnostics(HEXAPOD)
    felt(diagnostics, 1.0)
    assert status(diagnostics, 1.0).level == OK
    felt(diagnostics, 1.01, OVER)
    stated(snapshot, ERROR, status(diagnostics, 1.01))
    felt(diagnostics, 1.5)
    assert status(diagnostics, 1.5).level == ERROR
    felt(diagnostics, 2.02)
    assert status(diagnostics, 2.02).level == OK


def test_silence_is_stale(snapshot: Snapshot) -> None:
    diagnostics = ExternalWrenchDiagnostics(HEXAPOD)
    felt(diagnostics, 1.0)
    assert status(diagnostics, 1.09).level == OK
    stated(snapshot, STALE, status(diagnostics, 3.5))
    felt(diagnostics, 4.0)
    assert status(diagnostics, 4.0).level == OK


def test_measurements_that_are_too_far_apart_are_stale(snapshot: Snapshot) -> None:
    diagnostics = ExternalWrenchDiagnostics(HEXAPOD)
    for now in (1.0, 1.5, 2.0):
        felt(diagnostics, now, FIRST)
    of = stated(snapshot, STALE, status(diagnostics, 2.0))
    assert 'force (N)' not in dict(of.values)
    assert 'distance from the last setpoint (m)' in dict(of.values)


def test_a_rejection_is_reported_and_counted(snapshot: Snapshot) -> None:
    diagnostics = ExternalWrenchDiagnostics(HEXAPOD)
    felt(diagnostics, 1.0)
    diagnostics.rejected(Rejection(MEASURED_LEGS, MISSING_JOINTS), 'leg_6', 1.01)
    now = stated(snapshot, WARN, status(diagnostics, 1.02))
    assert dict(now.values)['rejected, measured_legs: lacks one of the joints'] == '1'
    (level, text), = logged(diagnostics, 1.02)
    assert level == WARN
    snapshot(text)
    for n in range(10):
        diagnostics.heard(1.1 + 0.1 * n)
        diagnostics.rejected(Rejection(MEASURED_LEGS, MISSING_JOINTS), 'leg_6', 1.1 + 0.1 * n)
    now = stated(snapshot, STALE, status(diagnostics, 2.0))
    assert dict(now.values)['rejected, measured_legs: lacks one of the joints'] == '11'


@pytest.mark.parametrize('what', ['sign', 'scale'])
def test_a_possible_error_in_the_efforts_is_a_warning_while_it_is_there(
        what: str, snapshot: Snapshot) -> None:
    diagnostics = ExternalWrenchDiagnostics(HEXAPOD)
    mistaken = CLEAR._replace(possible_error=PossibleError(what, 'all are wrong'))
    felt(diagnostics, 1.0, mistaken)
    felt(diagnostics, 1.1, mistaken)
    message = 'measured_legs: possible error: all are wrong' + (
        '; no external wrench is published' * (what == 'sign'))
    assert status(diagnostics, 1.1)[1:3] == (WARN, message)
    values = dict(status(diagnostics, 1.1).values)
    assert values['possible error in the measurements'] == what
    assert values['wrenches'] == ('0' if what == 'sign' else '2')
    (level, text), = logged(diagnostics, 1.1)
    assert level == WARN
    snapshot(text)
    # an overload may be real
    felt(diagnostics, 1.2, OVER._replace(possible_error=mistaken.possible_error))
    assert status(diagnostics, 1.2).level == ERROR
    snapshot(status(diagnostics, 1.2).message)
    felt(diagnostics, 3.0)
    level, text = status(diagnostics, 3.05)[1:3]
    assert level == OK
    snapshot(text)
    assert 'possible error in the measurements' not in dict(status(diagnostics, 3.05).values)


def test_rejections_after_an_overload_are_named(snapshot: Snapshot) -> None:
    diagnostics = ExternalWrenchDiagnostics(HEXAPOD)
    felt(diagnostics, 1.0, OVER)
    diagnostics.heard(1.5)
    diagnostics.rejected(Rejection(MEASURED_LEGS, MISSING_JOINTS), 'leg_6', 1.5)
    stated(snapshot, STALE, status(diagnostics, 1.5))


# The diagnostics of the base: levels, words and log lines, at chosen times

PARAMETERS = symmetric_parameters().replaced({'base.source': 'imu', 'base.timeout': 0.1})
START = 1000.0
STAMP = 1_000_000_000


def diagnostics(*topics: str) -> DynamicsDiagnostics:
    """Return the diagnostics of a node with these topics of the base."""
    return DynamicsDiagnostics(PARAMETERS, ('setpoint/pose',), topics, START)


def base_with_a_sample() -> BaseInput:
    """Return an input that has one sample of an IMU."""
    base = BaseInput(PARAMETERS, Rejections(lambda *why: None), lambda text: None)
    base.join_message(BASE_IMU, messages.imu(STAMP, (0.25, 0.0, 0.0)), lambda: 0)
    return base


def state(of: DynamicsDiagnostics, now: float) -> tuple[int, str]:
    """Return level and words of the status."""
    return status(of.base, now)[1:3]


def test_a_fixed_base_has_no_status() -> None:
    of = diagnostics()
    assert of.base.status(START) is None
    assert of.base.level(START + 100.0) == OK


def test_missing_topics_are_named(snapshot: Snapshot) -> None:
    of = diagnostics(BASE_POSE, BASE_TWIST, BASE_ACCEL)
    level, text = state(of, START)
    assert level == ERROR
    snapshot(text)
    for topic in (BASE_POSE, BASE_TWIST, BASE_ACCEL):
        of.base.heard[topic] = START + 1.0
    level, text = state(of, START + 1.05)
    assert level == ERROR
    snapshot(text)
    of.base.sampled(base_with_a_sample(), START + 1.06)
    level, text = state(of, START + 1.1)
    assert level == OK
    snapshot(text)
    of.base.heard[BASE_POSE] = START + 3.0
    level, text = state(of, START + 3.05)
    assert level == ERROR
    snapshot(text)


def test_base_stamps_that_differ_from_those_of_setpoints_are_reported(snapshot: Snapshot) -> None:
    of = diagnostics(BASE_IMU)
    of.base.heard[BASE_IMU] = START
    of.base.sampled(base_with_a_sample(), START)
    of.base.unknown(START + 0.01)
    why = 'no forces: the stamps of the base and of setpoints differ by more than base.timeout, ' \
        '0.1 s'
    assert state(of, START + 0.02) == (ERROR, why)
    (level, text), = logged(of.base, START + 0.02)
    assert level == ERROR
    snapshot(text)
    assert logged(of.base, START + 0.03) == []
    assert state(of, START + 0.06)[0] == ERROR  # for a second
    of.base.heard[BASE_IMU] = START + 1.05
    of.base.sampled(base_with_a_sample(), START + 1.05)
    level, text = state(of, START + 1.06)
    assert level == OK
    snapshot(text)
    (level, text), = logged(of.base, START + 1.06)
    assert level == OK
    snapshot(text)
    assert dict(status(of.base, START + 1.06).values)[
        'setpoints without forces, as the base was not known'] == '1'


def test_a_base_that_comes_after_the_last_setpoint_is_known_within_a_second(
        snapshot: Snapshot) -> None:
    of = diagnostics(BASE_IMU)
    of.base.unknown(START)
    level, text = state(of, START + 0.01)
    assert level == ERROR
    snapshot(text)
    for n in range(120):
        of.base.heard[BASE_IMU] = START + 0.01 * n
        of.base.sampled(base_with_a_sample(), START + 0.01 * n)
    level, text = state(of, START + 1.2)
    assert level == OK
    snapshot(text)


def test_before_anything_has_come_nothing_is_logged() -> None:
    of = diagnostics(BASE_IMU)
    assert logged(of.base, START + 10.0) == []
    of.base.unknown(START + 10.0)
    assert [level for level, _ in logged(of.base, START + 10.0)] == [ERROR]


def test_rejections_of_the_base_are_counted_here(snapshot: Snapshot) -> None:
    of = diagnostics(BASE_IMU)
    of.base.heard[BASE_IMU] = START
    of.base.sampled(base_with_a_sample(), START)
    rejection = Rejection(BASE_IMU, NOT_MEASURED)
    for _ in range(2):
        of.rejected(rejection, 'why', START + 0.01)
    level, text = state(of, START + 0.02)
    assert level == WARN
    snapshot(text)
    assert logged(of.base, START + 0.02) == []  # each is logged by itself
    assert dict(status(of.base, START + 0.02).values)['rejected, base/imu: not measured'] == '2'
    assert not any('rejected' in key for key, _ in status(of.setpoints, START + 0.02).values)


def test_the_numbers_of_the_last_sample_have_their_units() -> None:
    of = diagnostics(BASE_IMU)
    of.base.heard[BASE_IMU] = START
    of.base.sampled(base_with_a_sample(), START)
    found = dict(status(of.base, START + 0.05).values)
    assert found['gravity z (m/s^2)'] == '-9.80665'
    assert found['angular velocity x (rad/s)'] == '0.25'
    assert found['angular acceleration y (rad/s^2)'] == '0'
    assert found['age of the last sample (s)'] == '0.050'
    assert found['base/imu: last heard (s ago)'] == '0.050'
    assert found['samples'] == '1'
    assert np.isfinite(float(found['acceleration x (m/s^2)']))
