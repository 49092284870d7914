# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The statuses of setpoints, singularity, limits and timing: level, text and how long."""

from __future__ import annotations

from collections.abc import Sequence
import re
from typing import Any

from hypothesis import given, strategies as st
import messages
import numpy as np
import pytest
from referees import ROOT, symmetric_parameters
from snapshot import Snapshot
from stewart_dynamics.core.binding import places
from stewart_dynamics.mechanics.limits import Exceedance
from stewart_dynamics.mechanics.singularity_warning import Cause, Singularity
from stewart_dynamics.node.diagnostics.levels import ERROR, OK, STALE, Status, WARN
from stewart_dynamics.node.diagnostics.periodic_report import DynamicsDiagnostics
from stewart_dynamics.ros.repeated_log import RepeatedLog, SECONDS
from stewart_dynamics.setpoints.consistency import MessageError
from stewart_dynamics.setpoints.input_messages import ACCEL, BASE_IMU, POSE, TWIST
from stewart_dynamics.setpoints.rejections import (
    DROPPED, NOT_FINITE, NOT_JOINED, Rejection, STAMP_ZERO, TWICE)
from stewart_dynamics.setpoints.step import Batch, FIRST, Outputs, Step, WARNING_STATE
from test_step import FLAT, HOME, QUARTER, rotations, sizes, UPRIGHT

PROGRAM = 'stewart_dynamics'
OUTPUT = places('stewart_output') | {'warning': WARNING_STATE}

PARAMETERS = symmetric_parameters().replaced({'setpoint.timeout': 0.1})
TOPICS = (POSE, TWIST, ACCEL)
BEGIN = 100.0


def outputs_of(setpoint: Batch = HOME) -> Outputs:
    """Return what a setpoint gives."""
    outputs = Step(PARAMETERS)(setpoint)
    assert outputs.answered[0]
    return outputs


CLEAR = outputs_of()


def changed(outputs: Outputs = CLEAR, stamp: int | None = None, **numbers: Any) -> Outputs:
    """Return outputs with another stamp, and other numbers in their row."""
    rows = outputs.rows.copy()
    for name, number in numbers.items():
        rows[:, OUTPUT[name.replace('__', '.')]] = number
    return outputs._replace(
        rows=rows, stamps=outputs.stamps if stamp is None else np.array([stamp]))


def begun(**changes: Any) -> DynamicsDiagnostics:
    parameters = PARAMETERS.replaced(
        {name.replace('__', '.'): value for name, value in changes.items()})
    return DynamicsDiagnostics(parameters, TOPICS, (), BEGIN)


def answered(diagnostics: DynamicsDiagnostics, now: float, outputs: Outputs = CLEAR,
             topics: tuple[str, ...] = TOPICS, took: float = 1e-4, setpoint: Batch = HOME,
             exceedances: Sequence[Exceedance] = ()) -> bool:
    """Let messages of some topics come, and a setpoint be answered."""
    for topic in topics:
        diagnostics.setpoints.heard[topic] = now
    return diagnostics.answered(setpoint, outputs, exceedances, now - took, now)


def status(diagnostics: DynamicsDiagnostics, name: str, now: float) -> Status:
    return next(each for each in report(diagnostics, now) if each.name == name)


def stated(snapshot: Snapshot, level: int, of: Status) -> Status:
    """Check level and words of a status, and return it."""
    assert of.level == level
    snapshot(of.message)
    return of


def report(diagnostics: DynamicsDiagnostics, now: float) -> list[Status]:
    return diagnostics.report(now)[0]


def logged(diagnostics: DynamicsDiagnostics, now: float) -> list[tuple[int, str]]:
    """Return levels and texts that a report gives to the log."""
    return [(level, text) for level, text, _ in diagnostics.report(now)[1]]


# Silence

def test_status_before_any_message_is_stale_and_names_every_topic() -> None:
    of = status(begun(), 'setpoints', BEGIN + 0.01)
    assert of.level == STALE
    assert all(f'{topic} never came' in of.message for topic in TOPICS)
    for topic in TOPICS:
        assert dict(of.values)[f'{topic}: last heard (s ago)'] == 'never'


@pytest.mark.parametrize('silent', TOPICS)
def test_a_silent_topic_is_named_and_since_when(silent: str, snapshot: Snapshot) -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN)
    for now in (BEGIN + 0.05, BEGIN + 1.5, BEGIN + 2.48):
        for topic in TOPICS:
            if topic != silent:
                diagnostics.setpoints.heard[topic] = now
    of = stated(snapshot, STALE, status(diagnostics, 'setpoints', BEGIN + 2.5))
    assert not any(topic in of.message for topic in TOPICS if topic != silent)
    assert dict(of.values)[f'{silent}: last heard (s ago)'] == '2.500'
    assert dict(of.values)['age of the last (s)'] == '2.500'


def test_the_timeout_is_that_of_the_parameters() -> None:
    diagnostics = DynamicsDiagnostics(
        PARAMETERS.replaced({'setpoint.timeout': 5.0}), TOPICS, (), BEGIN)
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


def test_frequent_reports_do_not_change_the_rate() -> None:
    diagnostics = begun()
    rates = []
    for n in range(300):  # 5 Hz, reported at 10 Hz as levels change
        now = BEGIN + 0.1 * n
        if n % 2 == 0:
            answered(diagnostics, now)
        rates.append(float(dict(status(diagnostics, 'setpoints', now).values)['rate (Hz)']))
    assert 4.5 <= min(rates[20:])
    assert max(rates[20:]) <= 6.0


# Warnings in the log

def come(diagnostics: DynamicsDiagnostics, seconds: float, topics: tuple[str, ...],
         begin: float = BEGIN) -> list[str]:
    """Let messages of topics come at 100 Hz, none complete; return the log lines."""
    lines = []
    for n in range(round(100 * seconds)):
        now = begin + 0.01 * n
        for topic in topics:
            diagnostics.setpoints.heard[topic] = now
        if diagnostics.due_at_tick(now):
            lines += logged(diagnostics, now)
    assert all(level == WARN for level, _ in lines)
    return [text for _, text in lines]


def test_a_missing_topic_is_logged_repeatedly(snapshot: Snapshot) -> None:
    diagnostics = begun()
    lines = come(diagnostics, 3.0, (POSE, TWIST))
    snapshot('\n'.join(lines))
    assert len(come(diagnostics, 12.0, (POSE, TWIST), BEGIN + 3.0)) == 2
    # When setpoints are answered again, all is forgotten.
    answered(diagnostics, BEGIN + 15.0)
    assert come(diagnostics, 0.5, (POSE, TWIST), BEGIN + 15.0) == []


def test_stamps_that_are_never_equal_are_logged(snapshot: Snapshot) -> None:
    diagnostics = begun()
    for n in range(3):  # what waited too long was dropped, which explains nothing
        diagnostics.rejected(Rejection(POSE, NOT_JOINED), f'stamp {n} ns', BEGIN + n)
    snapshot('\n'.join(come(diagnostics, 3.0, TOPICS)))


def test_zero_stamps_that_are_never_joined_are_named(snapshot: Snapshot) -> None:
    diagnostics = begun()
    diagnostics.rejected(Rejection(POSE, NOT_JOINED), STAMP_ZERO, BEGIN)
    snapshot('\n'.join(come(diagnostics, 3.0, TOPICS)))


def test_nothing_is_logged_while_a_late_topic_completes_each_setpoint(snapshot: Snapshot) -> None:
    diagnostics = begun()
    for n in range(250):  # 10 Hz; the acceleration 70 ms after pose and twist
        now = BEGIN + 0.1 * n
        for topic in (POSE, TWIST):
            diagnostics.setpoints.heard[topic] = now
        if n % 10 == 5:  # reports of each second fall between the two
            assert logged(diagnostics, now + 0.03) == []
        # each second setpoint comes later than setpoint.timeout after the one before
        late = 0.071 if n % 2 else 0.069
        if n and n % 2:
            snapshot(diagnostics.setpoints.status(now + 0.0705).message)
        answered(diagnostics, now + late, CLEAR, (ACCEL,))


def test_nothing_is_logged_without_setpoints_or_when_all_are_answered() -> None:
    diagnostics = begun()
    assert come(diagnostics, 20.0, ()) == []
    for n in range(100):  # a setpoint in a second, and reports in the middle of it
        now = BEGIN + 20.0 + n
        for topic in TOPICS[:2]:
            diagnostics.setpoints.heard[topic] = now
        assert logged(diagnostics, now) == []
        answered(diagnostics, now + 0.001)
        assert logged(diagnostics, now + 0.5) == []


def test_rejections_are_not_logged_twice() -> None:
    diagnostics = begun()
    for n in range(100):
        now = BEGIN + 0.1 * n
        diagnostics.setpoints.heard[POSE] = now
        diagnostics.rejected(Rejection(POSE, NOT_FINITE), 'nan', now)
        assert logged(diagnostics, now) == []


# Rejections and writers

def test_rejections_are_counted_with_their_reason_and_are_a_warning(snapshot: Snapshot) -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN)
    for _ in range(3):
        diagnostics.rejected(Rejection(TWIST, NOT_FINITE), '(nan, 0.0)', BEGIN)
    diagnostics.rejected(Rejection(POSE, TWICE), 'stamp 5 ns', BEGIN)
    of = stated(snapshot, WARN, status(diagnostics, 'setpoints', BEGIN + 0.01))
    assert dict(of.values)[f'rejected, {TWIST}: {NOT_FINITE}'] == '3'
    assert dict(of.values)[f'rejected, {POSE}: {TWICE}'] == '1'
    # the warning ends, the count stays
    answered(diagnostics, BEGIN + 5.0)
    of = status(diagnostics, 'setpoints', BEGIN + 5.0)
    assert of.level == OK
    assert dict(of.values)[f'rejected, {TWIST}: {NOT_FINITE}'] == '3'


def test_another_node_of_the_same_name_is_logged_once() -> None:
    diagnostics = begun()
    lines = []
    for namesakes in ('', '2 nodes', '2 nodes', '3 nodes', '', '2 nodes'):
        answered(diagnostics, BEGIN)
        diagnostics.setpoints.found({}, {}, namesakes)
        lines += logged(diagnostics, BEGIN)
    assert lines == 2 * [(WARN, 'setpoints: 2 nodes')]


def test_another_writer_is_an_error_as_long_as_it_is_there() -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN)
    for writers, level in ((1, OK), (2, ERROR), (1, OK)):
        diagnostics.setpoints.found_writers(POSE, writers)
        assert diagnostics.setpoints.level(BEGIN) == level


def test_an_error_is_not_hidden_by_silence_and_both_are_stated(snapshot: Snapshot) -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN)
    diagnostics.setpoints.found(dict.fromkeys(TOPICS, 2), {'leg_states': 3}, '')
    of = status(diagnostics, 'setpoints', BEGIN + 3.0)
    assert dict(of.values)['leg_states: readers'] == '3'
    assert of.level == ERROR
    snapshot(of.message)


def test_the_status_names_the_rejection_if_all_messages_are_rejected(snapshot: Snapshot) -> None:
    diagnostics = begun()
    for topic in TOPICS:
        diagnostics.setpoints.heard[topic] = BEGIN
    diagnostics.rejected(Rejection(POSE, NOT_FINITE), 'nan', BEGIN)
    stated(snapshot, STALE, status(diagnostics, 'setpoints', BEGIN + 0.01))


# Timing

def test_processing_times_are_those_of_the_last_seconds(snapshot: Snapshot) -> None:
    diagnostics = begun()
    assert status(diagnostics, 'timing', BEGIN)[1:] == (
        OK, 'no setpoint yet', [('dropped', '0'), ('incomplete', '0')])
    for took in (100e-6, 900e-6, 200e-6):
        answered(diagnostics, BEGIN, took=took)
    of = stated(snapshot, OK, status(diagnostics, 'timing', BEGIN))
    assert of.values[:2] == [
        ('processing time, median (us)', '200'), ('processing time, largest (us)', '900')]
    for second in (1.0, 2.0, 3.0):
        answered(diagnostics, BEGIN + second, took=50e-6)
        of = status(diagnostics, 'timing', BEGIN + second)
    assert dict(of.values)['processing time, largest (us)'] == '50'
    for second in (4.0, 5.0, 6.0):
        of = status(diagnostics, 'timing', BEGIN + second)
    assert 'processing time, median (us)' not in dict(of.values)


def test_a_backlog_is_a_warning_for_a_second_and_its_losses_stay_counted(
        snapshot: Snapshot) -> None:
    diagnostics = begun()
    for n in range(3):
        diagnostics.rejected(Rejection('setpoint', DROPPED), f'stamp {n} ns', BEGIN)
    diagnostics.rejected(Rejection(POSE, NOT_JOINED), 'stamp 3 ns', BEGIN)
    diagnostics.rejected(Rejection(POSE, TWICE), 'stamp 4 ns', BEGIN)
    answered(diagnostics, BEGIN + 0.5)
    of = stated(snapshot, WARN, status(diagnostics, 'timing', BEGIN + 0.5))
    answered(diagnostics, BEGIN + 1.5)
    of = stated(snapshot, OK, status(diagnostics, 'timing', BEGIN + 1.5))
    assert of.values[-2:] == [('dropped', '3'), ('incomplete', '1')]


def test_the_age_of_the_last_setpoint_is_stated(snapshot: Snapshot) -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN, outputs_of(QUARTER))
    for name in ('singularity', 'limits', 'timing'):
        assert 'ago' not in status(diagnostics, name, BEGIN + 0.1).message
        of = status(diagnostics, name, BEGIN + 7.0)
        snapshot(of.message)
        assert of.level == (ERROR if name == 'singularity' else OK)


# Singularity

def test_possible_errors_are_a_warning_of_their_topics_as_long_as_they_are_there(
        snapshot: Snapshot) -> None:
    parameters = PARAMETERS.replaced({'base.source': 'imu'})
    diagnostics = DynamicsDiagnostics(parameters, TOPICS, (BASE_IMU,), BEGIN)
    answered(diagnostics, BEGIN)
    diagnostics.base.heard[BASE_IMU] = BEGIN
    diagnostics.base.sampled(messages.Feed(parameters).setpoints.base, BEGIN)
    diagnostics.note_errors([
        MessageError(TWIST, 'velocity is not the derivative of the poses', 0, (('given', '0'),)),
        MessageError(BASE_IMU, 'measured gravity: in g?')], BEGIN)
    statuses, lines = diagnostics.report(BEGIN)
    setpoints, base = (next(each for each in statuses if each.name == name)
                       for name in ('setpoints', 'base'))
    assert (setpoints.level, base.level) == (WARN, WARN)
    snapshot(setpoints.message)
    assert ('given', '0') in setpoints.values
    snapshot(base.message)
    line = WARN, f'setpoints: {setpoints.message}'
    assert line in [(level, text) for level, text, _ in lines]
    # Once, not with each report.
    assert line not in logged(diagnostics, BEGIN)
    answered(diagnostics, BEGIN + 2.0)
    diagnostics.note_errors([], BEGIN + 2.0)
    answered(diagnostics, BEGIN + 3.5)
    assert status(diagnostics, 'setpoints', BEGIN + 3.5).level == OK


def test_a_clear_motion_is_ok() -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN)
    of = status(diagnostics, 'singularity', BEGIN)
    assert (of.level, of.message) == (OK, 'clear')
    values = dict(of.values)
    assert values['det(J) (m^3)'] == f'{CLEAR.determinants[0]:.9g}'
    assert values['condition number'] == f'{CLEAR.conditions[0]:.6g}'
    assert values['time to crossing (s)'] == 'none'
    assert values['crossings'] == '0'
    assert values['its leg'] in PARAMETERS['joints']


def test_a_motion_that_begins_beyond_a_singularity_is_a_possible_error() -> None:
    """With z down a platform stands where it would hang: the lengths are the same."""
    around = {'limits__length_min': [1.0], 'limits__length_max': [1.4]}
    motions = HOME.motions.copy()
    motions[:, 2] *= -1.0
    below = outputs_of(HOME.replaced(motions))
    assert below.drive_positions == pytest.approx(CLEAR.drive_positions, rel=1e-12)
    diagnostics = begun(**around)
    diagnostics.begins(motions[0].tolist(), float(below.determinants[0]))
    for n in range(2):
        answered(diagnostics, BEGIN + n, below)
        of = status(diagnostics, 'singularity', BEGIN + n)
        assert of.level == WARN
        assert re.fullmatch(
            rf'det\(J\) is -{CLEAR.determinants[0]:.3g} m\^3, at home \+[\d.]+ m\^3: the motion '
            'begins beyond a .*possible error: an axis of the other sign, or .*', of.message)
    above = begun(**around)
    above.begins(HOME.motions[0].tolist(), float(CLEAR.determinants[0]))
    answered(above, BEGIN)
    assert status(above, 'singularity', BEGIN).message == 'clear'


@pytest.mark.parametrize(('cause', 'condition', 'time'), [
    (Cause.CONDITION, 30.0, 9.0),
    # The warning ends only below 0.8 of it, and the text is not of the number before.
    (Cause.CONDITION, 17.5, 9.0),
    (Cause.PREDICTED, 5.0, 0.25),
    (Cause.PREDICTED, 5.0, 0.6)],
    ids=['exceeds', 'has exceeded', 'predicted', 'predicted later'])
def test_a_warning_states_its_reason_with_its_own_numbers(
        cause: Cause, condition: float, time: float, snapshot: Snapshot) -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN, changed(
        result__condition_number=condition,
        warning=Singularity(cause=cause, time_to_crossing=time, crossings=4)))
    of = stated(snapshot, WARN, status(diagnostics, 'singularity', BEGIN))
    assert dict(of.values)['time to crossing (s)'] == f'{time:.3f}'
    assert dict(of.values)['crossings'] == '4'
    answered(diagnostics, BEGIN + 2.0)
    (level, text), = logged(diagnostics, BEGIN + 2.0)
    assert level == OK
    snapshot(text)


def near(condition: float, stamp: int = 0) -> Outputs:
    """Return outputs inside warn_condition."""
    return changed(CLEAR, stamp, result__condition_number=condition,
                   warning=Singularity(cause=Cause.CONDITION))


def test_a_past_state_is_reported_with_its_own_number_and_since_when(snapshot: Snapshot) -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN, near(23.5))
    answered(diagnostics, BEGIN + 0.4, changed(result__condition_number=7.42))
    of = stated(snapshot, WARN, status(diagnostics, 'singularity', BEGIN + 0.4))
    assert dict(of.values)['condition number'] == '7.42'
    assert status(diagnostics, 'singularity', BEGIN + 1.0).message.startswith('clear')


def test_a_crossing_is_one_line_in_the_log_with_stamp_and_time() -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN, changed(
        near(23.5, 1_700_000_000_120_000_000), result__determinant=0.3))
    assert [level for level, _ in logged(diagnostics, BEGIN)] == [WARN]
    crossing = changed(
        CLEAR, 1_700_000_000_130_000_001, result__condition_number=30.0,
        result__determinant=-0.1, warning=Singularity(cause=Cause.CROSSED, crossings=1))
    assert answered(diagnostics, BEGIN + 0.01, crossing), 'it is reported at once'
    line = 'det(J) crossed zero 0.0025 s before stamp 1700000000.130000001 s'
    assert (ERROR, f'singularity: {line}') in logged(diagnostics, BEGIN + 0.01)
    for n in range(2, 300):
        now = BEGIN + 0.01 * n
        answered(diagnostics, now, near(25.0) if n < 50 else CLEAR)
        of = status(diagnostics, 'singularity', now)
        assert of.level == (ERROR if now < BEGIN + 1.01 else WARN if now < BEGIN + 1.49 else OK)
        assert (line in of.message) == (of.level == ERROR)
        # status asks for a report, whose lines are of the log
        assert not any('crossed' in text for _, text in logged(diagnostics, now))


def test_a_crossing_inside_stop_condition_hides_nothing_and_is_not_hidden(
        snapshot: Snapshot) -> None:
    diagnostics = begun(singularity__action='suppress_forces')
    inside = changed(result__condition_number=1e4, forces=np.nan,
                     warning=Singularity(cause=Cause.CONDITION, stopped=True))
    answered(diagnostics, BEGIN, inside)
    logged(diagnostics, BEGIN)
    assert answered(diagnostics, BEGIN + 0.01, changed(
        inside, 1, warning=Singularity(cause=Cause.CROSSED, stopped=True)))
    stated(snapshot, ERROR, status(diagnostics, 'singularity', BEGIN + 0.01))


def test_hundreds_of_crossings_are_one_line_in_a_second_with_their_number(
        snapshot: Snapshot) -> None:
    diagnostics = begun()
    crossing = changed(warning=Singularity(cause=Cause.CROSSED))
    lines = []
    for n in range(100):
        now = BEGIN + 0.02 * n
        if answered(diagnostics, now, changed(crossing, n)):
            lines += logged(diagnostics, now)
    first, second = [text for _, text in lines]
    snapshot(first)
    snapshot(second)


@pytest.mark.parametrize('setpoint', [QUARTER, FLAT])
def test_a_pose_that_cannot_be_solved_is_an_error(setpoint: Batch, snapshot: Snapshot) -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN, outputs_of(setpoint))
    stated(snapshot, ERROR, status(diagnostics, 'singularity', BEGIN))
    # and no force is named among the legs' values
    assert not any('force' in key for key, _ in status(diagnostics, 'limits', BEGIN).values)


def test_the_worst_condition_is_kept_for_a_second_or_two() -> None:
    diagnostics = begun()
    key = 'worst condition number of the last second'
    for condition in (3.0, 40.0, 5.0):
        answered(diagnostics, BEGIN, changed(result__condition_number=condition))
    assert dict(status(diagnostics, 'singularity', BEGIN).values)[key] == '40'
    for second, worst in ((1.0, '40'), (2.0, '40'), (3.0, '4')):
        answered(diagnostics, BEGIN + second, changed(result__condition_number=4.0))
        values = dict(status(diagnostics, 'singularity', BEGIN + second).values)
        assert values[key] == worst
        assert values['worst condition number since activation'] == '40'


# Limits

def test_held_limits_are_ok(snapshot: Snapshot) -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN)
    of = stated(snapshot, OK, status(diagnostics, 'limits', BEGIN))
    values = dict(of.values)
    for leg, name in enumerate(PARAMETERS['joints']):
        assert values[f'{name}: length (m)'] == f'{CLEAR.drive_positions[0, leg]:.6g}'
        assert values[f'{name}: rate (m/s)'] == f'{CLEAR.rates[0, leg]:.6g}'
        assert values[f'{name}: force demanded (N)'] == f'{CLEAR.demanded_efforts[0, leg]:.6g}'


@pytest.mark.parametrize('action', ['warn', 'suppress_forces'])
@pytest.mark.parametrize('limited', [False, True])
def test_a_position_in_millimetres_is_named_as_the_possible_error(
        action: str, limited: bool, snapshot: Snapshot) -> None:
    limits = {'limits__length_max': 1.4} if limited else {'limits__velocity_max': 0.5}
    high = Batch.from_parts(HOME.stamps + 1_000_000, (0.0, 0.0, 1e3, *HOME.motions[0, 3:]))
    step = Step(PARAMETERS.replaced({
        'limits.action': action, **{k.replace('__', '.'): v for k, v in limits.items()}}))
    outputs = step(high, step(HOME).state)
    assert outputs.answered[0]
    diagnostics = begun(limits__action=action, **limits)
    answered(diagnostics, BEGIN, outputs, setpoint=high,
             exceedances=step.exceedances(outputs))
    lines = [line.text for line in diagnostics.report(BEGIN)[1]]
    of = status(diagnostics, 'limits', BEGIN)
    assert of.level == ERROR
    suppressed = '; forces suppressed' if action == 'suppress_forces' else ''
    for text in (of.message, next(line for line in lines if line.startswith('limits: '))):
        text = text.removeprefix('limits: ')
        snapshot(text)
    values = dict(of.values)
    assert values.get('jumps') == (None if limited else '1')
    assert values.get('setpoints without forces, by limits.action') == (
        '1' if suppressed else None)


def test_a_limit_hides_no_other(snapshot: Snapshot) -> None:
    diagnostics = begun()
    rate = Exceedance('limits.velocity_max', 2, 0.5001, 0.5)
    force = Exceedance('limits.force_max', 0, 2.4e6, 6000.0)
    answered(diagnostics, BEGIN, exceedances=(rate, force))
    answered(diagnostics, BEGIN + 0.5, exceedances=(rate,))
    words = [excess.words(PARAMETERS['joints']) for excess in (rate, force)]
    of = status(diagnostics, 'limits', BEGIN + 0.5)
    snapshot(of.message)
    values = dict(of.values)
    assert values['setpoints that exceed limits.velocity_max'] == '2'
    assert values['setpoints that exceed limits.force_max'] == '1'
    assert values['worst since activation, limits.force_max'] == f'{words[1]}, clipped'
    assert not any('length' in key for key in values if 'limits.' in key)


def test_each_kind_of_limit_is_logged_when_it_is_exceeded_and_when_no_longer(
        snapshot: Snapshot) -> None:
    diagnostics = begun()
    rate = Exceedance('limits.velocity_max', 2, 0.5001, 0.5)
    force, less = (Exceedance('limits.force_max', 0, value, 6000.0) for value in (2.4e6, 7e3))
    lines: list[tuple[int, str]] = []
    for n in range(600):
        now = BEGIN + 0.01 * n
        excesses = (rate, less if n % 2 else force) if 100 <= n < 341 else (rate,)
        answered(diagnostics, now, exceedances=excesses)
        lines += logged(diagnostics, now)
    levels, texts = zip(*lines, strict=True)
    assert levels == (ERROR, ERROR, OK)
    snapshot('\n'.join(texts))


def test_the_largest_force_is_kept_until_the_next_activation() -> None:
    diagnostics = begun()
    forces, = CLEAR.demanded_efforts
    key, leg = 'largest force demanded since activation (N)', 'leg of the largest force demanded'
    for largest, at in ((1e4, 3), (-2.5e4, 5), (2e4, 0)):
        peak = (*forces[:at], largest, *forces[at + 1:])
        answered(diagnostics, BEGIN, changed(result__forces=peak))
    for after in (0.0, 100.0):
        answered(diagnostics, BEGIN + after)
        values = dict(status(diagnostics, 'limits', BEGIN + after).values)
        assert (values[key], values[leg]) == ('-25000', 'leg_6')
    diagnostics = begun()
    answered(diagnostics, BEGIN, changed(result__forces=np.nan))
    assert key not in dict(status(diagnostics, 'limits', BEGIN).values)


# Levels over time

def test_a_level_holds_for_a_second_after_its_cause() -> None:
    diagnostics = begun()
    excess = Exceedance('limits.force_max', 0, 2.0, 1.0)
    answered(diagnostics, BEGIN, exceedances=(excess,))
    for after in (0.1, 0.5, 0.99):
        answered(diagnostics, BEGIN + after)
        assert status(diagnostics, 'limits', BEGIN + after).level == ERROR
    assert status(diagnostics, 'limits', BEGIN + 1.0).level == OK
    answered(diagnostics, BEGIN + 3.0, exceedances=(excess,))
    answered(diagnostics, BEGIN + 3.9, exceedances=(excess,))
    assert status(diagnostics, 'limits', BEGIN + 4.8).level == ERROR


def test_a_change_of_level_is_pending_until_it_is_reported() -> None:
    diagnostics = begun()
    diagnostics.report(BEGIN)
    assert not diagnostics.level_changed(BEGIN)
    assert answered(diagnostics, BEGIN)  # from stale to ok
    assert diagnostics.level_changed(BEGIN)
    diagnostics.report(BEGIN)
    assert not answered(diagnostics, BEGIN + 0.01)
    diagnostics.rejected(Rejection(POSE, TWICE), '', BEGIN + 0.01)
    assert diagnostics.level_changed(BEGIN + 0.01)
    diagnostics.report(BEGIN + 0.01)
    assert not answered(diagnostics, BEGIN + 0.02)
    assert answered(diagnostics, BEGIN + 0.03, outputs_of(QUARTER))
    diagnostics.report(BEGIN + 0.03)
    assert not diagnostics.level_changed(BEGIN + 0.04)
    assert diagnostics.level_changed(BEGIN + 0.14)  # stale


def test_a_report_is_due_each_second_while_setpoints_are_answered_after_an_answer() -> None:
    diagnostics = begun()
    answered(diagnostics, BEGIN)
    diagnostics.report(BEGIN)
    for n in range(1, 100):
        assert not answered(diagnostics, BEGIN + 0.01 * n)
    assert not diagnostics.due_at_tick(BEGIN + 1.02)
    assert diagnostics.due_at_tick(BEGIN + 1.05)
    assert answered(diagnostics, BEGIN + 1.0)
    diagnostics.report(BEGIN + 2.0)  # no setpoint
    assert not diagnostics.due_at_tick(BEGIN + 2.97)
    assert diagnostics.due_at_tick(BEGIN + 2.98)  # half a tick early


# Every value

UNIT = re.compile(r'\((m|m/s|N|s|us|s ago|Hz|m\^3|m\^3/s)\)$')
PLAIN = re.compile(
    r'setpoints answered|crossings|condition number|worst condition number of the last second'
    r'|largest leg force under a unit load|its leg|rejected, .*|.*: (?:writers|readers)|dropped'
    r'|worst condition number since activation|leg of the largest force demanded'
    r'|setpoints that exceed limits\.\w+|worst since activation, (limits\.\w+|jump)'
    r'|jumps|setpoints without forces, by limits\.action'
    r'|incomplete')


def _check_values(diagnostics: DynamicsDiagnostics, now: float) -> None:
    for of in report(diagnostics, now):
        assert of.level in (OK, WARN, ERROR, STALE)
        assert of.message
        keys = [key for key, _ in of.values]
        assert len(set(keys)) == len(keys)
        for key, value in of.values:
            assert UNIT.search(key) or PLAIN.fullmatch(key)
            assert not re.search('nan|inf', value, re.IGNORECASE)
            assert value


@given(st.lists(st.tuples(
    st.tuples(*[sizes] * 3), rotations | st.just(UPRIGHT), st.tuples(*[sizes] * 12),
    st.sampled_from([0.0, 0.01, 0.2, 2.0])), max_size=6))
def test_every_value_is_finite_and_every_key_has_its_unit(
        motions: list[tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...], float]],
) -> None:
    step = Step(PARAMETERS.replaced({
        'limits.force_max': 10.0, 'limits.length_max': 1.0, 'limits.velocity_max': 0.1}))
    diagnostics = begun()
    now, state = BEGIN, FIRST
    _check_values(diagnostics, now)
    for stamp, (position, rotation, rates, pause) in enumerate(motions):
        now += pause
        setpoint = Batch.from_parts(stamp, (*position, *rotation, *rates))
        outputs = step(setpoint, state)
        state = outputs.state
        if outputs.answered[0]:
            answered(diagnostics, now, outputs,
                     exceedances=step.exceedances(outputs))
        else:
            diagnostics.rejected(Rejection('setpoint', 'out of range'), '', now)
        diagnostics.setpoints.found({POSE: 2}, {'leg_states': 1}, '')
        _check_values(diagnostics, now)


def test_a_level_lasts_as_long_as_the_output_that_caused_it() -> None:
    diagnostics = begun()
    warned = changed(warning=Singularity(cause=Cause.CONDITION))
    stopped = changed(warning=Singularity(Cause.CONDITION, stopped=True))
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


# The log lines of repeated events

class Log:
    """A log at chosen times, and its lines."""

    def __init__(self) -> None:
        self.now = 0.0
        self.lines: list[str] = []
        self.log = RepeatedLog(self, lambda: self.now)

    def warning(self, text: str) -> None:
        """Take a line, as the logger of a node does."""
        self.lines.append(text)

    def add(self, text: str, now: float, kind: str = 'a') -> None:
        """Let one more event happen."""
        self.now = now
        self.log.write([(WARN, text, kind)])


def test_the_first_is_logged_at_once_and_the_last_when_the_series_ends() -> None:
    of = Log()
    of.add('one', 0.0)
    assert of.lines == ['one']
    of.add('two', 1.0)
    of.add('three', 2.0)
    of.log.write_last(2.0 + 0.99 * SECONDS)
    assert of.lines == ['one']
    of.log.write_last(2.0 + SECONDS)
    of.log.write_last()
    of.add('anew', 101.0)
    assert of.lines == ['one', 'three (the last of 3)', 'anew']


def test_frequent_events_are_logged_every_five_seconds_with_their_number(
        snapshot: Snapshot) -> None:
    of = Log()
    for n in range(101):
        of.add(f'number {n}', 0.1 * n)
    of.log.write_last()  # the last one has been logged
    snapshot('\n'.join(of.lines))


@given(st.lists(st.tuples(st.sampled_from('ab'), st.floats(0.0, 4.0)), min_size=1))
def test_first_and_last_are_logged_and_none_is_lost(events: list[tuple[str, float]]) -> None:
    of, now = Log(), 0.0
    for n, (kind, pause) in enumerate(events):
        now += pause
        of.log.write_last(now)
        of.add(f'{kind} {n}.', now, kind)
    of.log.write_last()
    for kind in {kind for kind, _ in events}:
        own = [n for n, (each, _) in enumerate(events) if each == kind]
        lines = [line for line in of.lines if line.startswith(kind)]
        assert lines[0] == f'{kind} {own[0]}.'
        assert lines[-1].startswith(f'{kind} {own[-1]}.')


def test_the_page_of_the_node_names_each_status() -> None:
    page = (ROOT / 'docs/node.md').read_text(encoding='utf-8')
    table = page.partition('| status | contents |')[2].partition('\n\n')[0]
    assert set(re.findall(r'^\| ([a-z ]+) \|', table, re.MULTILINE)) == {
        part.name for part in begun().parts}
