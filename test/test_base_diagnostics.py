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

"""The diagnostics of the base: levels, words and log lines, at chosen times."""

from __future__ import annotations

import messages
import numpy as np
from referees import symmetric_parameters

from stewart_dynamics.mechanics.rows import NO_BASE
from stewart_dynamics.node.diagnostics.dynamics import DynamicsDiagnostics
from stewart_dynamics.node.diagnostics.periodic_report import ERROR, OK, Status, WARN
from stewart_dynamics.setpoints.base import BaseInput
from stewart_dynamics.setpoints.inputs import BASE_ACCEL, BASE_IMU, BASE_POSE, BASE_TWIST
from stewart_dynamics.setpoints.rejections import NOT_MEASURED, Rejection, Rejections
from stewart_dynamics.setpoints.step import Setpoint

PARAMETERS = symmetric_parameters().replaced({'base.source': 'imu', 'base.timeout': 0.1})
BEGIN = 1000.0
STAMP = 1_000_000_000


def diagnostics(*topics: str) -> DynamicsDiagnostics:
    """Return the diagnostics of a node with these topics of the base."""
    return DynamicsDiagnostics(PARAMETERS, ('setpoint/pose',), topics, BEGIN)


def base_with_a_sample() -> BaseInput:
    """Return an input that has one sample of an IMU."""
    base = BaseInput(PARAMETERS, Rejections(lambda *why: None), lambda text: None)
    base.take(BASE_IMU, messages.imu(STAMP, (0.25, 0.0, 0.0)), lambda: 0)
    return base


def setpoint(known: bool) -> Setpoint:
    """Return a setpoint on a base that is known or not."""
    return Setpoint(STAMP, (0.0,) * 24, base=(0.0,) * 12 if known else NO_BASE)


def state(of: DynamicsDiagnostics, now: float) -> tuple[int, str]:
    """Return level and words of the status."""
    status = of.base.status(now)
    assert status is not None
    assert of.base.level(now) == status.level
    return status.level, status.message


def values(status: Status | None) -> dict[str, str]:
    """Return keys and values."""
    assert status is not None
    return dict(status.values)


def test_a_fixed_base_has_no_status() -> None:
    of = diagnostics()
    assert of.base.status(BEGIN) is None
    assert of.base.level(BEGIN + 100.0) == OK
    assert of.base.log_lines(BEGIN + 100.0) == []


def test_missing_topics_are_named() -> None:
    of = diagnostics(BASE_POSE, BASE_TWIST, BASE_ACCEL)
    assert state(of, BEGIN) == (ERROR, 'no forces: base/pose never came, base/twist never came, '
                                'base/accel never came')
    for topic in (BASE_POSE, BASE_TWIST, BASE_ACCEL):
        of.base.heard(topic, BEGIN + 1.0)
    assert state(of, BEGIN + 1.05) == (
        ERROR, 'no forces: its topics arrive, but are not joined: their stamps differ')
    of.base.sampled(base_with_a_sample(), BEGIN + 1.06)
    assert state(of, BEGIN + 1.1) == (OK, 'its motion is known')
    of.base.heard(BASE_POSE, BEGIN + 3.0)
    assert state(of, BEGIN + 3.05) == (
        ERROR, 'no forces: base/twist silent for 2.0 s, base/accel silent for 2.0 s')


def test_stamps_that_do_not_fit_those_of_setpoints_are_told() -> None:
    of = diagnostics(BASE_IMU)
    of.base.heard(BASE_IMU, BEGIN)
    of.base.sampled(base_with_a_sample(), BEGIN)
    of.base.answered(setpoint(known=False), BEGIN + 0.01)
    why = 'no forces: the stamps of the base and of setpoints differ by more than base.timeout, ' \
        '0.1 s'
    assert state(of, BEGIN + 0.02) == (ERROR, why)
    assert [line.text for line in of.base.log_lines(BEGIN + 0.02)] == [f'base: {why}']
    assert of.base.log_lines(BEGIN + 0.03) == []
    of.base.answered(setpoint(known=True), BEGIN + 0.05)
    assert state(of, BEGIN + 0.06)[0] == ERROR  # for a second
    of.base.heard(BASE_IMU, BEGIN + 1.05)
    of.base.sampled(base_with_a_sample(), BEGIN + 1.05)
    assert state(of, BEGIN + 1.06) == (OK, 'its motion is known')
    assert [line.text for line in of.base.log_lines(BEGIN + 1.06)] == ['base: its motion is known']
    assert values(of.base.status(BEGIN + 1.06))[
        'setpoints without forces, as the base was not known'] == '1'


def test_a_base_that_comes_after_the_last_setpoint_is_known_within_a_second() -> None:
    of = diagnostics(BASE_IMU)
    of.base.answered(setpoint(known=False), BEGIN)
    assert state(of, BEGIN + 0.01) == (ERROR, 'no forces: base/imu never came')
    for n in range(120):
        of.base.heard(BASE_IMU, BEGIN + 0.01 * n)
        of.base.sampled(base_with_a_sample(), BEGIN + 0.01 * n)
    assert state(of, BEGIN + 1.2) == (OK, 'its motion is known')


def test_before_anything_has_come_nothing_is_logged() -> None:
    of = diagnostics(BASE_IMU)
    assert of.base.log_lines(BEGIN + 10.0) == []
    of.base.answered(setpoint(known=False), BEGIN + 10.0)
    assert [line.level for line in of.base.log_lines(BEGIN + 10.0)] == [ERROR]


def test_rejections_of_the_base_are_counted_here() -> None:
    of = diagnostics(BASE_IMU)
    of.base.heard(BASE_IMU, BEGIN)
    of.base.sampled(base_with_a_sample(), BEGIN)
    rejection = Rejection(BASE_IMU, NOT_MEASURED)
    for _ in range(2):
        of.rejected(rejection, 'why', BEGIN + 0.01)
    assert state(of, BEGIN + 0.02) == (WARN, 'base/imu: not measured (why)')
    assert of.base.log_lines(BEGIN + 0.02) == []  # each is logged by itself
    assert values(of.base.status(BEGIN + 0.02))['rejected, base/imu: not measured'] == '2'
    assert 'rejected, base/imu: not measured' not in values(of.setpoints.status(BEGIN + 0.02))


def test_the_numbers_of_the_last_sample_have_their_units() -> None:
    of = diagnostics(BASE_IMU)
    of.base.heard(BASE_IMU, BEGIN)
    of.base.sampled(base_with_a_sample(), BEGIN)
    found = values(of.base.status(BEGIN + 0.05))
    assert found['gravity z (m/s^2)'] == '-9.80665'
    assert found['angular velocity x (rad/s)'] == '0.25'
    assert found['angular acceleration y (rad/s^2)'] == '0'
    assert found['age of the last sample (s)'] == '0.050'
    assert found['base/imu: last heard (s ago)'] == '0.050'
    assert found['samples'] == '1'
    assert np.isfinite(float(found['acceleration x (m/s^2)']))
