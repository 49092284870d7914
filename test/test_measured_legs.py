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

"""Messages on ~/measured_legs: any layout, any order of names, and every reason of rejection."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from messages import imu, STORE
import numpy as np
import pytest
from stewart_dynamics import Parameters, Pose, StewartPlatform
from stewart_dynamics.arrays import NO_WRENCH
from stewart_dynamics.external_wrench.estimate import Estimate, ExternalWrench, Measurement
from stewart_dynamics.external_wrench.measured_legs import (
    MEASURED_LEGS, MeasuredLegs, NOT_CONVERGED, SINGULAR, UNSTAMPED)
from stewart_dynamics.messages.joint_state import MISSING_JOINTS, UNEVEN
from stewart_dynamics.setpoints.base import BaseInput
from stewart_dynamics.setpoints.inputs import BASE_IMU
from stewart_dynamics.setpoints.rejections import (
    BASE_NOT_KNOWN, MALFORMED, NOT_FINITE, OUT_OF_RANGE, Rejection, Rejections, TOO_OLD, TWICE)
from test_external_wrench import (
    BEGIN, estimates, HEXAPOD, HOME, LOAD, MILLISECOND, resting, six, swing)

KIND = 'sensor_msgs/msg/JointState'
JOINTS = list(HEXAPOD['joints'])
TARGET = tuple(HOME.rows.tolist())
ZERO_LENGTHS = HEXAPOD['geometry.zero_length']


def joint_state(stamp: int, names: Sequence[str], position: Any, velocity: Any, effort: Any,
                frame: str = '', little_endian: bool = True) -> bytes:
    """Return a JointState, serialized by rosbags."""
    header = STORE.types['std_msgs/msg/Header'](
        STORE.types['builtin_interfaces/msg/Time'](*divmod(stamp, 1_000_000_000)), frame)
    message = STORE.types[KIND](header, list(names), *(
        np.array(numbers, dtype=float) for numbers in (position, velocity, effort)))
    return bytes(STORE.serialize_cdr(message, KIND, little_endian=little_endian))


def message_of(at: Measurement, **options: Any) -> bytes:
    """Return the message of a measurement of HEXAPOD."""
    return joint_state(at.stamp, JOINTS, at.lengths - ZERO_LENGTHS, at.rates, at.forces, **options)


class Followed:
    """Measured legs, and the reports of them."""

    def __init__(self, parameters: Parameters = HEXAPOD) -> None:
        self.rejected: list[tuple[Rejection, str]] = []
        self.noticed: list[str] = []
        self.base: BaseInput | None = None
        self._legs = MeasuredLegs(
            parameters, ExternalWrench(parameters),
            lambda rejection, details: self.rejected.append((rejection, details)),
            self.noticed.append)

    def take(self, data: bytes) -> Estimate | None:
        return self._legs.take(data, NO_WRENCH, TARGET, self.base)

    def rejects(self, data: bytes, reason: str, details: str) -> None:
        """Check that a message is rejected, for which reason and with which details."""
        many = len(self.rejected)
        assert self.take(data) is None
        assert len(self.rejected) == many + 1
        rejection, said = self.rejected[-1]
        assert rejection == (MEASURED_LEGS, reason)
        assert details in said
        assert '\n' not in said


REST = resting(HEXAPOD, HOME, LOAD, range(BEGIN, BEGIN + 50 * MILLISECOND, MILLISECOND))
EXPECTED = estimates(ExternalWrench(HEXAPOD), [
    each._replace(lengths=six(each.lengths - ZERO_LENGTHS + ZERO_LENGTHS))
    for each in REST])


def test_messages_give_what_the_step_gives_for_their_numbers() -> None:
    followed = Followed()
    assert [followed.take(message_of(each)) for each in REST] == EXPECTED
    assert not followed.rejected
    assert not followed.noticed


def test_where_the_base_is_not_known_they_are_rejected_and_go_on_with_it() -> None:
    parameters = HEXAPOD.replaced({'base.source': 'imu'})
    base = BaseInput(parameters, Rejections(lambda *why: None), lambda text: None)
    followed = Followed(parameters)
    followed.base = base
    followed.rejects(message_of(REST[0]), BASE_NOT_KNOWN, f'stamp {BEGIN} ns')
    base.take(BASE_IMU, imu(BEGIN, force=(0.0, 0.0, 9.80665)), lambda: 0)
    found = [followed.take(message_of(each)) for each in REST]
    assert len(followed.rejected) == 1
    last = found[-1]
    assert last is not None
    assert last.wrench == pytest.approx(EXPECTED[-1].wrench, rel=1e-9)


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.data())
def test_any_order_of_names_with_others_among_them(data: st.DataObject) -> None:
    """Others' numbers may be anything; the layout may change from message to message."""
    text = st.text(st.characters(codec='utf-8', exclude_characters='\0'), max_size=9)
    followed = Followed()
    names: list[str] = []
    frame, little_endian = '', True
    for n, at in enumerate(REST[:6]):
        if n % 2 == 0:
            more = data.draw(st.lists(text.filter(lambda name: name not in JOINTS), max_size=4))
            names = data.draw(st.permutations([*JOINTS, *more]))
            frame, little_endian = data.draw(text), data.draw(st.booleans())
        arrays = []
        for numbers in (at.lengths - ZERO_LENGTHS, at.rates, at.forces):
            of = dict(zip(JOINTS, np.asarray(numbers).tolist(), strict=True))
            arrays.append([of.get(name, math.nan) for name in names])
        assert followed.take(joint_state(
            at.stamp, names, *arrays, frame=frame, little_endian=little_endian)) == EXPECTED[n]
    assert not followed.rejected


def test_padding_bytes_are_ignored() -> None:
    """Fast DDS fills messages up to four bytes, and padding may be anything."""
    followed = Followed()
    for at, filling in zip(REST[:8], (b'', b'\0', b'\0', b'\xff\xff\xff', b'', b'\1', b'\2', b''),
                           strict=True):
        assert followed.take(message_of(at, frame='abc') + filling) is not None
    assert not followed.rejected


# Rejections

def changed(**fields: Any) -> Callable[[Measurement], bytes]:
    """Return what makes a message with other fields of a measurement."""
    def make(at: Measurement) -> bytes:
        given = {'names': JOINTS, 'position': at.lengths - ZERO_LENGTHS, 'velocity': at.rates,
                 'effort': at.forces, **fields}
        return joint_state(at.stamp, **given)
    return make


@pytest.mark.parametrize(('make', 'reason', 'details'), [
    (changed(names=[*JOINTS[:5], 'elbow']), MISSING_JOINTS,
     'leg_6; there are leg_1, leg_2, leg_3, leg_4, leg_5, elbow'),
    (changed(names=[], position=[], velocity=[], effort=[]), MISSING_JOINTS, 'there are none'),
    (changed(position=[]), 'without position', '6 names'),
    (changed(velocity=[], effort=[]), 'without velocity and effort', '6 names'),
    (changed(effort=[1.0] * 5), UNEVEN, '6 names, 5 of effort'),
    (changed(names=[*JOINTS, 'elbow']), UNEVEN,
     '7 names, 6 of position, 6 of velocity, 6 of effort'),
    (changed(position=[math.nan] + [0.3] * 5), NOT_FINITE, 'nan'),
    (changed(velocity=[0.0] * 5 + [math.inf]), NOT_FINITE, 'inf'),
    (changed(effort=[-math.inf] + [0.0] * 5), NOT_FINITE, '-inf'),
    (changed(velocity=[1e308] * 6), OUT_OF_RANGE, f'stamp {BEGIN + MILLISECOND} ns'),
    (changed(position=[9.0, 0.3, 0.3, 0.3, 0.3, 0.3]), NOT_CONVERGED,
     'lengths [9.95, 1.25, 1.25, 1.25, 1.25, 1.25] m: did not converge: residual '),
    (changed(position=[-3.0] * 6), NOT_CONVERGED, ' iterations'),
    (lambda at: message_of(at._replace(stamp=0)), UNSTAMPED, 'the time between'),
    (lambda at: message_of(at)[:-9], MALFORMED, ' bytes: '),
    (lambda at: b'', MALFORMED, '0 bytes'),
    (lambda at: b'\0\2' + message_of(at)[2:], MALFORMED, ' bytes: '),
    (lambda at: b'\1\1' + message_of(at)[2:], MALFORMED, 'encapsulation 0101'),
    (lambda at: message_of(at)[:8] + b'\xff' * 4 + message_of(at)[12:], MALFORMED,
     'stamp of 4294967295 ns'),
    (lambda at: message_of(at._replace(stamp=BEGIN)), TWICE, f'stamp {BEGIN} ns'),
    (lambda at: message_of(at._replace(stamp=BEGIN - 2 * MILLISECOND)), TOO_OLD,
     'is 0.002 s older than the last used'),
])
def test_a_rejected_message_changes_nothing(
        make: Callable[[Measurement], bytes], reason: str, details: str) -> None:
    followed = Followed()
    assert followed.take(message_of(REST[0])) == EXPECTED[0]
    followed.rejects(make(REST[1]), reason, details)
    assert followed.take(message_of(REST[2])) == estimates(
        ExternalWrench(HEXAPOD), [REST[0], REST[2]])[1]
    assert len(followed.rejected) == 1


def test_a_hexapod_that_is_singular_everywhere_is_rejected() -> None:
    """Base and platform are similar hexagons."""
    similar = HEXAPOD.replaced({
        'geometry.base_joints': (1.5 * HEXAPOD['geometry.platform_joints']).ravel()})
    followed = Followed(similar)
    lengths = StewartPlatform(similar).inverse_kinematics(Pose([0.0, 0.0, 1.1], np.eye(3)))
    followed.rejects(message_of(REST[0]._replace(lengths=six(lengths))), SINGULAR, 'lengths [')


@settings(derandomize=True, deadline=None, max_examples=200)
@given(st.binary(max_size=120), st.integers(0, 400), st.integers(0, 255))
def test_for_any_input_a_wrench_is_finite(noise: bytes, at: int, byte: int) -> None:
    followed = Followed()
    sound = message_of(REST[0])
    for data in (noise, sound[:at] + noise, sound[:at] + bytes([byte]) + sound[at + 1:],
                 message_of(REST[1]), message_of(REST[2])):
        found = followed.take(data)
        if found is not None and found.wrench is not None:
            assert np.all(np.isfinite(found.wrench))


# Time

def test_a_jump_back_is_a_restart() -> None:
    followed = Followed()
    late = 10 ** 12
    for at in REST[:3]:
        assert followed.take(message_of(at._replace(stamp=at.stamp + late))) is not None
    assert [followed.take(message_of(each)) for each in REST] == EXPECTED
    assert followed.noticed == [
        'measured_legs: stamps jumped back by 1000 s: followed as a restart']
    assert not followed.rejected


def test_after_a_gap_it_restarts() -> None:
    followed = Followed()
    for at in REST[:3]:
        followed.take(message_of(at._replace(stamp=at.stamp - 10 ** 12)))
    assert [followed.take(message_of(each)) for each in REST] == EXPECTED
    assert not followed.rejected


def test_where_no_pose_is_found_for_long_the_setpoint_is_the_guess() -> None:
    """Such a hexapod was moved meanwhile; until then only the last pose is believed."""
    followed = Followed()
    assert followed.take(message_of(REST[0])) is not None
    away = StewartPlatform(HEXAPOD).inverse_dynamics(swing(0.9))
    for n in range(1, 4):
        followed.rejects(changed(position=[5.0, 0.3, 0.3, 0.3, 0.3, 0.3])(
            REST[0]._replace(stamp=BEGIN + n * 30 * MILLISECOND)), NOT_CONVERGED, ' iterations')
    found = followed.take(changed(position=away.lengths - ZERO_LENGTHS)(
        REST[0]._replace(stamp=BEGIN + 120 * MILLISECOND)))
    assert found is not None
    assert found.wrench is None
