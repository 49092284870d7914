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

"""What is said of setpoints, singularity, limits and timing, at which level, and how long."""

from __future__ import annotations

import re

from hypothesis import given, settings
from hypothesis import strategies as st
import pytest
from referees import symmetric_parameters
from test_step import FLAT, HOME, QUARTER, rotations, sizes, UPRIGHT

from stewart_dynamics.mechanics.limits import Exceedance
from stewart_dynamics.mechanics.singularity import Cause, Singularity
from stewart_dynamics.runtime.diagnostics import Diagnostics, ERROR, OK, STALE, Status, WARN
from stewart_dynamics.runtime.input_topics import ACCEL, POSE, TWIST
from stewart_dynamics.runtime.rejections import (
    DROPPED, NOT_FINITE, NOT_JOINED, Rejection, TWICE)
from stewart_dynamics.runtime.step import Output, Setpoint, Step

PARAMETERS = symmetric_parameters().replaced({'setpoint.timeout': 0.1})
TOPICS = (POSE, TWIST, ACCEL)
BEGIN = 100.0


def output_of(setpoint: Setpoint = HOME, before: Singularity | None = None,
              **limits: object) -> Output:
    """Return what a setpoint gives."""
    step = Step(PARAMETERS.replaced({
        name.replace('__', '.'): value for name, value in limits.items()}))
    output = step(setpoint, before)
    assert output is not None
    return output


CLEAR = output_of()


def begun() -> Diagnostics:
    return Diagnostics(PARAMETERS, TOPICS, BEGIN)


def answered(diagnostics: Diagnostics, now: float, output: Output = CLEAR,
             topics: tuple[str, ...] = TOPICS, took: float = 1e-4) -> bool:
    """Let messages of some topics come, and a setpoint be answered."""
    for topic in topics:
        diagnostics.heard(topic, now)
    return diagnostics.answered(output, now - took, now)


def status(diagnostics: Diagnostics, name: str, now: float) -> Status:
    return next(status for status in diagnostics.report(now) if status.name == name)


def test_there_is_one_status_for_each_of_four_things() -> None:
    assert [s.name for s in begun().report(BEGIN)] == [
        'setpoints', 'singularity', 'limits', 'timing']


# Silence

def test_nothing_yet_is_stale_and_names_every_topic() -> None:
    of = status(begun(), 'setpoints', BEGIN + 0.01)
    assert of.level == STALE
    assert all(f'{topic} never came' in of.message for topic in TOPICS)
    for topic in TOPICS:
        assert dict(of.values)[f'{topic}: last heard (s ago)'] == 'never'


def test_setpoints_that_are_answered_are_ok() -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN + 1.0)
    for after in (0.0, 0.05, 0.1):
        assert status(diagnostics, 'setpoints', BEGIN + 1.0 + after).level == OK


@pytest.mark.parametrize('silent', TOPICS)
def test_a_silent_topic_is_named_and_since_when(silent: str) -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN)
    for now in (BEGIN + 0.05, BEGIN + 1.5, BEGIN + 2.48):
        for topic in TOPICS:
            if topic != silent:
                diagnostics.heard(topic, now)
    of = status(diagnostics, 'setpoints', BEGIN + 2.5)
    assert of.level == STALE
    assert f'{silent} silent for 2.5 s' in of.message
    assert not any(topic in of.message for topic in TOPICS if topic != silent)
    assert dict(of.values)[f'{silent}: last heard (s ago)'] == '2.500'
    assert dict(of.values)['age of the last (s)'] == '2.500'


def test_a_topic_that_never_came_is_named() -> None:
    diagnostics = begun()
    for topic in (POSE, TWIST):
        diagnostics.heard(topic, BEGIN + 1.0)
    of = status(diagnostics, 'setpoints', BEGIN + 1.02)
    assert of.level == STALE
    assert f'{ACCEL} never came' in of.message
    assert POSE not in of.message
    assert TWIST not in of.message


def test_topics_that_all_speak_but_do_not_meet_are_stale() -> None:
    diagnostics = begun()
    for topic in TOPICS:
        diagnostics.heard(topic, BEGIN + 1.0)
    of = status(diagnostics, 'setpoints', BEGIN + 1.02)
    assert (of.level, of.message) == (
        STALE, 'no setpoint: all topics speak, but none is joined: '
        'their stamps differ by more than setpoint.sync_tolerance, 0 s')


def test_the_timeout_is_that_of_the_parameters() -> None:
    diagnostics = Diagnostics(
        PARAMETERS.replaced({'setpoint.timeout': 5.0}), TOPICS, BEGIN)
    answered(diagnostics, BEGIN)
    assert status(diagnostics, 'setpoints', BEGIN + 4.9).level == OK
    assert status(diagnostics, 'setpoints', BEGIN + 5.1).level == STALE


def test_the_rate_is_that_of_the_last_seconds() -> None:
    diagnostics = begun()
    for n in range(100):
        answered(diagnostics, BEGIN + 0.01 * n)
    values = dict(status(diagnostics, 'setpoints', BEGIN + 1.0).values)
    assert (values['setpoints answered'], values['rate (Hz)']) == ('100', '100.0')
    for second in range(1, 4):
        for n in range(10):
            answered(diagnostics, BEGIN + second + 0.1 * n)
        values = dict(status(diagnostics, 'setpoints', BEGIN + second + 1.0).values)
    assert (values['setpoints answered'], values['rate (Hz)']) == ('130', '10.0')


def test_no_rate_is_of_no_time() -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN)
    assert dict(status(diagnostics, 'setpoints', BEGIN).values)['rate (Hz)'] == '0.0'


def test_reports_that_come_often_do_not_tear_the_rate_apart() -> None:
    diagnostics = begun()
    rates = []
    for n in range(300):  # 5 Hz, reported at 10 Hz as levels change
        now = BEGIN + 0.1 * n
        if n % 2 == 0:
            answered(diagnostics, now)
        rates.append(float(dict(status(diagnostics, 'setpoints', now).values)['rate (Hz)']))
    assert 4.5 <= min(rates[20:])
    assert max(rates[20:]) <= 6.0


# Refusals and writers

def test_refusals_are_counted_with_their_reason_and_warned_of() -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN)
    for _ in range(3):
        diagnostics.refused(Rejection(TWIST, NOT_FINITE), '(nan, 0.0)', BEGIN)
    diagnostics.refused(Rejection(POSE, TWICE), 'stamp 5 ns', BEGIN)
    of = status(diagnostics, 'setpoints', BEGIN + 0.01)
    assert of.level == WARN
    assert of.message == f'{POSE}: {TWICE} (stamp 5 ns)'
    assert dict(of.values)[f'refused, {TWIST}: {NOT_FINITE}'] == '3'
    assert dict(of.values)[f'refused, {POSE}: {TWICE}'] == '1'
    # the warning ends, the count stays
    answered(diagnostics, BEGIN + 5.0)
    of = status(diagnostics, 'setpoints', BEGIN + 5.0)
    assert of.level == OK
    assert dict(of.values)[f'refused, {TWIST}: {NOT_FINITE}'] == '3'


def test_several_writers_of_a_topic_are_an_error() -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN)
    diagnostics.writers = {POSE: 1, TWIST: 2, ACCEL: 1}
    of = status(diagnostics, 'setpoints', BEGIN)
    assert (of.level, of.message) == (ERROR, f'{TWIST} has 2 writers')
    assert dict(of.values)[f'{TWIST}: writers'] == '2'


def test_another_node_of_the_same_name_is_an_error() -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN)
    diagnostics.namesakes = '/ns/node', 3
    of = status(diagnostics, 'setpoints', BEGIN)
    assert (of.level, of.message) == (ERROR, '3 nodes are named /ns/node')
    diagnostics.namesakes = '/ns/node', 1
    assert status(diagnostics, 'setpoints', BEGIN).level == OK


def test_an_error_is_not_covered_by_silence_and_says_that_too() -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN)
    diagnostics.writers = dict.fromkeys(TOPICS, 2)
    of = status(diagnostics, 'setpoints', BEGIN + 3.0)
    assert of.level == ERROR
    assert of.message == (
        f'{POSE} has 2 writers, {TWIST} has 2 writers, {ACCEL} has 2 writers, no setpoint: '
        + ', '.join(f'{topic} silent for 3.0 s' for topic in TOPICS))


def test_where_all_is_refused_silence_is_not_said_to_be_of_stamps() -> None:
    diagnostics = begun()
    for topic in TOPICS:
        diagnostics.heard(topic, BEGIN)
    diagnostics.refused(Rejection(POSE, NOT_FINITE), 'nan', BEGIN)
    of = status(diagnostics, 'setpoints', BEGIN + 0.01)
    assert (of.level, of.message) == (STALE, f'no setpoint: {POSE}: {NOT_FINITE} (nan)')


# Timing

def test_processing_times_are_those_of_the_last_seconds() -> None:
    diagnostics = begun()
    assert status(diagnostics, 'timing', BEGIN)[1:] == (
        OK, 'no setpoint yet', (('passed over', '0'), ('incomplete', '0')))
    for took in (100e-6, 900e-6, 200e-6):
        answered(diagnostics, BEGIN, took=took)
    of = status(diagnostics, 'timing', BEGIN)
    assert (of.level, of.message) == (OK, 'on time')
    assert of.values[:2] == (
        ('processing time, median (us)', '200'), ('processing time, largest (us)', '900'))
    for second in (1.0, 2.0, 3.0):
        answered(diagnostics, BEGIN + second, took=50e-6)
        of = status(diagnostics, 'timing', BEGIN + second)
    assert dict(of.values)['processing time, largest (us)'] == '50'
    for second in (4.0, 5.0, 6.0):
        of = status(diagnostics, 'timing', BEGIN + second)
    assert 'processing time, median (us)' not in dict(of.values)


def test_a_backlog_is_warned_of_for_a_second_and_its_losses_stay_counted() -> None:
    diagnostics = begun()
    for n in range(3):
        diagnostics.refused(Rejection('setpoint', DROPPED), f'stamp {n} ns', BEGIN)
    diagnostics.refused(Rejection(POSE, NOT_JOINED), 'stamp 3 ns', BEGIN)
    diagnostics.refused(Rejection(POSE, TWICE), 'stamp 4 ns', BEGIN)
    answered(diagnostics, BEGIN + 0.5)
    of = status(diagnostics, 'timing', BEGIN + 0.5)
    assert (of.level, of.message) == (WARN, f'setpoint: {DROPPED} (stamp 2 ns)')
    answered(diagnostics, BEGIN + 1.5)
    of = status(diagnostics, 'timing', BEGIN + 1.5)
    assert (of.level, of.message) == (OK, 'on time')
    assert of.values[-2:] == (('passed over', '3'), ('incomplete', '1'))


def test_what_is_said_of_the_last_setpoint_says_how_old_it_is() -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN, output_of(QUARTER))
    for name in ('singularity', 'limits', 'timing'):
        assert 'ago' not in status(diagnostics, name, BEGIN + 0.1).message
        of = status(diagnostics, name, BEGIN + 7.0)
        assert of.message.endswith(' (of the last setpoint, 7.0 s ago)')
        assert of.level == (ERROR if name == 'singularity' else OK)


# Singularity

def test_a_clear_motion_is_ok() -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN)
    of = status(diagnostics, 'singularity', BEGIN)
    assert (of.level, of.message) == (OK, 'clear')
    values = dict(of.values)
    assert values['det(J) (m^3)'] == f'{CLEAR.determinant:.9g}'
    assert values['condition number'] == f'{CLEAR.condition:.6g}'
    assert values['time to crossing (s)'] == 'none'
    assert values['crossings'] == '0'
    assert values['its leg'] in PARAMETERS['joints']


@pytest.mark.parametrize('cause', [Cause.CONDITION, Cause.FORETOLD, Cause.CROSSED])
def test_a_warning_says_its_cause(cause: Cause) -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN, CLEAR._replace(singularity=Singularity(
        cause=cause, time_to_crossing=0.25, crossings=4)))
    of = status(diagnostics, 'singularity', BEGIN)
    assert (of.level, of.message) == (WARN, cause.value)
    assert dict(of.values)['time to crossing (s)'] == '0.250'
    assert dict(of.values)['crossings'] == '4'


@pytest.mark.parametrize('setpoint', [QUARTER, FLAT])
def test_a_pose_that_cannot_be_solved_is_an_error(setpoint: Setpoint) -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN, output_of(setpoint))
    of = status(diagnostics, 'singularity', BEGIN)
    assert of.level == ERROR
    assert 'no forces' in of.message
    # and no force is named among the legs' values
    assert not any('force' in key for key, _ in status(diagnostics, 'limits', BEGIN).values)


@pytest.mark.parametrize('suppressed', [False, True])
def test_inside_the_stop_condition_is_an_error(suppressed: bool) -> None:
    stopped = Singularity(stopped=True, cause=Cause.CONDITION)
    output = CLEAR._replace(singularity=stopped)
    diagnostics = begun()
    answered(diagnostics, BEGIN, output._replace(forces=None) if suppressed else output)
    of = status(diagnostics, 'singularity', BEGIN)
    assert of.level == ERROR
    assert 'stop_condition' in of.message
    assert ('suppressed' in of.message) == suppressed


def test_the_worst_condition_is_kept_for_a_second_or_two() -> None:
    diagnostics = begun()
    key = 'worst condition number of the last second'
    for condition in (3.0, 40.0, 5.0):
        answered(diagnostics, BEGIN, CLEAR._replace(condition=condition))
    assert dict(status(diagnostics, 'singularity', BEGIN).values)[key] == '40'
    for second, worst in ((1.0, '40'), (2.0, '40'), (3.0, '4')):
        answered(diagnostics, BEGIN + second, CLEAR._replace(condition=4.0))
        assert dict(status(diagnostics, 'singularity', BEGIN + second).values)[key] == worst


# Limits

def test_held_limits_are_ok() -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN)
    of = status(diagnostics, 'limits', BEGIN)
    assert (of.level, of.message) == (OK, 'all held')
    values = dict(of.values)
    for leg, name in enumerate(PARAMETERS['joints']):
        assert values[f'{name}: length (m)'] == f'{CLEAR.lengths[leg]:.6g}'
        assert values[f'{name}: rate (m/s)'] == f'{CLEAR.rates[leg]:.6g}'
        assert values[f'{name}: force demanded (N)'] == f'{CLEAR.demanded_forces[leg]:.6g}'


@pytest.mark.parametrize(('exceedance', 'words'), [
    (Exceedance('limits.length_min', 0, 0.9, 0.95),
     'leg_1: length 0.9 m is 0.05 m beyond limits.length_min'),
    (Exceedance('limits.length_max', 1, 1.75, 1.5),
     'leg_2: length 1.75 m is 0.25 m beyond limits.length_max'),
    (Exceedance('limits.velocity_max', 2, -0.75, 0.5),
     'leg_3: rate -0.75 m/s is 0.25 m/s beyond limits.velocity_max'),
    (Exceedance('limits.force_max', 5, -7000.0, 6000.0),
     'leg_6: force -7000 N is 1000 N beyond limits.force_max, clipped')])
def test_a_limit_exceeded_is_an_error_that_says_by_how_much(
        exceedance: Exceedance, words: str) -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN, CLEAR._replace(exceedances=(exceedance,)))
    of = status(diagnostics, 'limits', BEGIN)
    assert (of.level, of.message) == (ERROR, words)


def test_a_clipped_force_is_said_as_the_leg_would_need_it() -> None:
    output = output_of(limits__force_max=100.0)
    assert output.demanded_forces is not None
    diagnostics = begun()
    answered(diagnostics, BEGIN, output)
    of = status(diagnostics, 'limits', BEGIN)
    assert of.level == ERROR
    for leg, name in enumerate(PARAMETERS['joints']):
        force = output.demanded_forces[leg]
        assert dict(of.values)[f'{name}: force demanded (N)'] == f'{force:.6g}'
        assert (f'{name}: force {force:.6g} N is {abs(force) - 100.0:.6g} N beyond '
                'limits.force_max, clipped') in of.message


# Levels over time

def test_a_level_holds_for_a_second_after_its_cause() -> None:
    diagnostics = begun()
    exceedance = Exceedance('limits.force_max', 0, 2.0, 1.0)
    answered(diagnostics, BEGIN, CLEAR._replace(exceedances=(exceedance,)))
    for after in (0.1, 0.5, 0.99):
        answered(diagnostics, BEGIN + after)
        assert status(diagnostics, 'limits', BEGIN + after).level == ERROR
    assert status(diagnostics, 'limits', BEGIN + 1.0).level == OK
    answered(diagnostics, BEGIN + 3.0, CLEAR._replace(exceedances=(exceedance,)))
    answered(diagnostics, BEGIN + 3.9, CLEAR._replace(exceedances=(exceedance,)))
    assert status(diagnostics, 'limits', BEGIN + 4.8).level == ERROR


def test_a_worse_level_is_not_covered_by_a_lesser_one() -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN, output_of(QUARTER))
    near = CLEAR._replace(singularity=Singularity(cause=Cause.CONDITION))
    for after in (0.2, 0.9):
        answered(diagnostics, BEGIN + after, near)
        assert status(diagnostics, 'singularity', BEGIN + after).level == ERROR
    answered(diagnostics, BEGIN + 1.1, near)
    assert status(diagnostics, 'singularity', BEGIN + 1.1).level == WARN


def test_a_crossing_is_said_for_a_second_whatever_comes_after_it() -> None:
    diagnostics = begun()
    for n, cause in enumerate((Cause.FORETOLD, Cause.CROSSED, Cause.CONDITION, Cause.CONDITION)):
        answered(diagnostics, BEGIN + 0.001 * n, CLEAR._replace(singularity=Singularity(cause)))
    for after, message in ((0.9, Cause.CROSSED.value), (1.1, Cause.CONDITION.value)):
        answered(diagnostics, BEGIN + after,
                 CLEAR._replace(singularity=Singularity(Cause.CONDITION)))
        of = status(diagnostics, 'singularity', BEGIN + after)
        assert (of.level, of.message) == (WARN, message)


def test_a_change_of_level_is_seen_until_it_is_reported() -> None:
    diagnostics = begun()
    diagnostics.report(BEGIN)
    assert not diagnostics.level_changed(BEGIN)
    assert answered(diagnostics, BEGIN)  # from stale to ok
    assert diagnostics.level_changed(BEGIN)
    diagnostics.report(BEGIN)
    assert not answered(diagnostics, BEGIN + 0.01)
    diagnostics.refused(Rejection(POSE, TWICE), '', BEGIN + 0.01)
    assert diagnostics.level_changed(BEGIN + 0.01)
    diagnostics.report(BEGIN + 0.01)
    assert not answered(diagnostics, BEGIN + 0.02)
    assert answered(diagnostics, BEGIN + 0.03, output_of(QUARTER))
    diagnostics.report(BEGIN + 0.03)
    assert not diagnostics.level_changed(BEGIN + 0.04)
    assert diagnostics.level_changed(BEGIN + 0.14)  # stale


# Every value

UNIT = re.compile(r'\((m|m/s|N|s|us|s ago|Hz|m\^3|m\^3/s)\)$')
PLAIN = re.compile(
    r'setpoints answered|crossings|condition number|worst condition number of the last second'
    r'|largest leg force under a unit load|its leg|refused, .*|.*: (?:writers|readers)|passed over'
    r'|incomplete')


def _check_values(diagnostics: Diagnostics, now: float) -> None:
    for of in diagnostics.report(now):
        assert of.level in (OK, WARN, ERROR, STALE)
        assert of.message
        keys = [key for key, _ in of.values]
        assert len(set(keys)) == len(keys)
        for key, value in of.values:
            assert UNIT.search(key) or PLAIN.fullmatch(key)
            assert not re.search('nan|inf', value, re.IGNORECASE)
            assert value


@settings(derandomize=True, deadline=None, max_examples=200)
@given(st.lists(st.tuples(
    st.tuples(*[sizes] * 3), rotations | st.just(UPRIGHT), st.tuples(*[sizes] * 12),
    st.sampled_from([0.0, 0.01, 0.2, 2.0])), max_size=6))
def test_no_value_is_other_than_a_number_and_every_key_has_its_unit(
        motions: list[tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...], float]],
) -> None:
    step = Step(PARAMETERS.replaced({
        'limits.force_max': 10.0, 'limits.length_max': 1.0, 'limits.velocity_max': 0.1}))
    diagnostics = begun()
    now, state = BEGIN, None
    _check_values(diagnostics, now)
    for position, rotation, rates, pause in motions:
        now += pause
        output = step(Setpoint(0, (*position, *rotation, *rates)), state)
        if output is None:
            diagnostics.refused(Rejection('setpoint', 'out of range'), '', now)
        else:
            answered(diagnostics, now, output)
            state = output.singularity
        diagnostics.writers = {POSE: 2}
        diagnostics.readers = {'leg_states': 1}
        _check_values(diagnostics, now)


def test_a_level_lasts_as_long_as_the_output_that_caused_it() -> None:
    diagnostics = begun()
    warned = CLEAR._replace(singularity=Singularity(cause=Cause.CONDITION))
    stopped = CLEAR._replace(singularity=Singularity(Cause.CONDITION, stopped=True))
    answered(diagnostics, BEGIN, stopped)
    levels = []
    for n in range(1, 40):
        at = BEGIN + 0.1 * n
        answered(diagnostics, at, warned)
        levels += [status(diagnostics, 'singularity', at + shift).level for shift in (0.0, 0.09)]
    assert levels[0] == ERROR
    assert levels[-1] == WARN
    assert levels == sorted(levels, reverse=True), 'it was OK or rose in between'
    # and when setpoints end there
    assert status(diagnostics, 'singularity', BEGIN + 100.0).level == WARN
