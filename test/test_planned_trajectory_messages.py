# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Planned trajectories as messages: accepted to the last bit, or rejected in words."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
import math
from typing import Any

from hypothesis import given, strategies as st
import messages
import numpy as np
import pytest
from referees import rng
from scipy.spatial.transform import Rotation
from snapshot import Snapshot
from stewart_dynamics import (
    BaseMotion, check_planned_trajectory, Motion, Parameters, StewartPlatform)
from stewart_dynamics.arrays import NO_WRENCH, Six
from stewart_dynamics.node.diagnostics.levels import ERROR, LogLine, OK, WARN
from stewart_dynamics.node.diagnostics.periodic_report import DynamicsDiagnostics
from stewart_dynamics.node.tasks import LENGTH, TaskQueue
from stewart_dynamics.planned import planned_trajectory, trajectory_messages as planned
from stewart_dynamics.planned.planned_trajectory import NOT_INCREASING, PIECE, TOO_FAR
from stewart_dynamics.planned.trajectory_messages import PlannedOutcome
from stewart_dynamics.setpoints.rejections import BASE_NOT_KNOWN, NOT_FINITE, NOT_UNIT
from trajectories import (
    Array, counted, decoded, FREE, HOME, motion_of, PARAMETERS, REST, sampled, SECOND, some, STAMP,
    UNBOUND)

PROGRAM = 'stewart_dynamics'


def outcome_of(data: bytes, parameters: Parameters = PARAMETERS, wrench: Six = NO_WRENCH,
               base: Array | None = None) -> PlannedOutcome:
    """Return the outcome of a trajectory."""
    *pieces, outcome = planned.answer(parameters, wrench, data, base)
    assert outcome is not None
    assert not any(pieces)
    assert bool(outcome.answer) != bool(outcome.reason)
    assert outcome.message.startswith('rejected: ' if outcome.reason else 'accepted: ')
    return outcome


def efforts(outcome: PlannedOutcome) -> bytes:
    """Return the bits of the efforts of an answer."""
    return np.array([point.effort for point in decoded(outcome).points]).tobytes()


# Accepted

@pytest.mark.parametrize('effort', [True, False], ids=['effort', 'no effort'])
@pytest.mark.parametrize(('points', 'frame', 'names', 'little_endian'), [
    (1, '', (), True), (2, 'base', ('platform',), False), (6, '', (), False),
    (PIECE, '', ('p',), False), (PIECE + 1, 'base', ('moving',), True), (1000, '', ('',), True)])
def test_points_are_answered_with_the_bits_of_the_library(
        points: int, frame: str, names: tuple[str, ...], little_endian: bool, effort: bool,
        ) -> None:
    times, rows = some(points)
    wrench = (100.0, -50.0, -300.0, 20.0, 10.0, -5.0)
    # Names of any length, so that doubles stand at another place in the message.
    joints = [f'{"x" * points}{name}' for name in PARAMETERS['joints']]
    if points > 2:
        joints = [name[-3 - points % 4:] for name in joints]
    parameters = PARAMETERS.replaced({'joints': joints, 'trajectory.effort': effort})
    outcome = outcome_of(messages.trajectory(STAMP, times, rows, frame, names, little_endian),
                         parameters, wrench)
    assert outcome.message == (f'accepted: {points} point{"s" * (points > 1)} over '
                               f'{(times[-1] - times[0]) * 1e-9:.6g} s')
    got = decoded(outcome)
    assert got.header.stamp.sec * SECOND + got.header.stamp.nanosec == STAMP
    assert got.header.frame_id == ''
    assert got.joint_names == joints
    assert [point.time_from_start.sec * SECOND + point.time_from_start.nanosec
            for point in got.points] == times
    result = StewartPlatform(parameters).inverse_dynamics(motion_of(rows), wrench)
    for field, expected in (('positions', result.lengths - parameters['geometry.zero_length']),
                            ('velocities', result.rates),
                            ('effort', result.forces[:, :6 if effort else 0])):
        assert np.array([getattr(point, field) for point in got.points]).tobytes() \
            == np.ascontiguousarray(expected).tobytes()
    assert all(len(point.accelerations) == 0 for point in got.points)


def on_base(many: int) -> tuple[list[list[float]], BaseMotion]:
    """Return the motion of a base at points, in the world, as numbers and as the library's."""
    random = rng()
    rows = [[*random.normal(size=3), *Rotation.random(random_state=n).as_quat(),
             *random.normal(size=12)] for n in range(many)]
    numbers = np.array(rows)
    return rows, BaseMotion.from_motion(Motion.from_quaternion(
        *(numbers[:, part] for part in (
            slice(3), slice(3, 7), slice(7, 10), slice(10, 13), slice(13, 16), slice(16, 19)))),
        PARAMETERS['gravity'])


@pytest.mark.parametrize('points, names, little_endian', [
    (1, ('platform', 'base'), False), (2, ('p', 'base'), True), (PIECE + 1, ('', 'base'), False)])
def test_the_second_joint_is_the_base(
        points: int, names: tuple[str, str], little_endian: bool) -> None:
    times, rows = some(points)
    others, base = on_base(points)
    data = messages.trajectory(STAMP, times, rows, names=names, others=others,
                               little_endian=little_endian)
    # Whatever the base does now does not matter.
    outcome = outcome_of(data, FREE, base=np.full(12, np.nan))
    result = StewartPlatform(FREE).inverse_dynamics(motion_of(rows), base=base)
    assert efforts(outcome) == result.forces.tobytes()
    with_library = check_planned_trajectory(
        StewartPlatform(FREE), np.array(times) * 1e-9, motion_of(rows), base=base)
    assert np.array_equal(with_library.forces, result.forces)


def test_without_the_base_it_is_at_rest_under_the_gravity_of_now() -> None:
    times, rows = some(10)
    row = np.zeros(12)
    row[:3] = 1.0, 2.0, -9.0
    outcome = outcome_of(messages.trajectory(STAMP, times, rows), base=row)
    result = StewartPlatform(PARAMETERS).inverse_dynamics(
        motion_of(rows), base=BaseMotion([1.0, 2.0, -9.0]))
    assert efforts(outcome) == result.forces.tobytes()
    outcome = outcome_of(messages.trajectory(STAMP, times, rows), base=np.full(12, np.nan))
    assert outcome.reason == BASE_NOT_KNOWN


def test_a_base_that_is_wrong_is_rejected(snapshot: Snapshot) -> None:
    times, rows = some(3)
    others, _ = on_base(3)
    rule = "the first joint is the platform, the second the base, 'base'"
    for names, text in ((('platform', 'ship'), f"joint_names: ['platform', 'ship']: {rule}"),
                        (('base', 'base'), f"joint_names: ['base', 'base']: {rule}"),
                        (('a', 'b', 'base'), '3 joint_names: must be at most')):
        outcome = outcome_of(messages.trajectory(STAMP, times, rows, names=names, others=others))
        assert text in outcome.message
    for n, number, reason in ((1, math.nan, NOT_FINITE), (2, 9.0, NOT_UNIT)):
        wrong = [list(row) for row in others]
        wrong[n][3] = number
        outcome = outcome_of(messages.trajectory(
            STAMP, times, rows, names=('platform', 'base'), others=wrong))
        assert outcome.reason == reason
        assert f'points[{n}]' in outcome.message
    outcome = outcome_of(messages.trajectory(STAMP, times, rows, names=('platform', 'base')))
    snapshot(outcome.message)


def test_a_force_limit_is_checked_between_points_with_the_base_between_them() -> None:
    """The hexapod rests; the base's gravity changes sign between two points."""
    times = [0, SECOND]
    rows = np.array([[*HOME, *REST, *REST]] * 2)
    motion = motion_of(rows)
    platform = StewartPlatform(FREE)
    base = BaseMotion([[0.0, 0.0, -9.0], [0.0, 0.0, 9.0]])
    forces = platform.inverse_dynamics(motion, base=base).forces
    assert np.abs(forces).max() > 0.0
    bounded = FREE.replaced({'limits.force_max': 1.01 * float(np.abs(forces).max())})
    result = check_planned_trajectory(
        StewartPlatform(bounded), np.array(times) * 1e-9, motion, base=base)
    assert result.accepted
    stronger = BaseMotion([[0.0, 0.0, -9.0], [0.0, 0.0, 9.2]])
    result = check_planned_trajectory(
        StewartPlatform(bounded), np.array(times) * 1e-9, motion, base=stronger)
    assert not result.accepted
    assert 'force' in result.message


def test_values_have_the_largest_force_and_condition_number() -> None:
    times, rows = sampled('clear', SECOND // 100)
    outcome = outcome_of(messages.trajectory(STAMP, times, rows))
    values = dict(outcome.values)
    result = StewartPlatform(PARAMETERS).inverse_dynamics(motion_of(rows))
    largest = np.abs(result.forces).max()
    leg = int(np.argmax(np.abs(result.forces).max(axis=0)))
    assert values['points'] == '1001'
    assert values['duration (s)'] == '10'
    assert float(values['largest force (N)']) == pytest.approx(largest, rel=1e-3)
    assert values['its leg'] == f'leg_{leg + 1}'
    assert float(values['largest force, of limits.force_max']) == pytest.approx(
        largest / 6000.0, rel=1e-3)
    assert float(values['worst condition number']) == pytest.approx(
        result.condition_number.max(), rel=1e-3)
    assert 'largest force, of limits.force_max' not in dict(
        outcome_of(messages.trajectory(STAMP, times, rows), FREE).values)


def test_within_warn_condition_it_is_accepted_with_a_warning(snapshot: Snapshot) -> None:
    times, rows = sampled('clear', SECOND)
    parameters = PARAMETERS.replaced({'singularity.warn_condition': 4.0})
    outcome = outcome_of(messages.trajectory(STAMP, times, rows), parameters)
    assert outcome.answer
    assert outcome.warning
    snapshot(outcome.message)
    assert not outcome_of(messages.trajectory(STAMP, times, rows)).warning


# The work in pieces

def test_no_piece_is_larger_than_its_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    solved = counted(monkeypatch)
    for step in (SECOND, SECOND // 100):
        times, rows = sampled('clear', step)
        total = 0
        for _ in planned.answer(PARAMETERS, NO_WRENCH, messages.trajectory(STAMP, times, rows)):
            # for the platform between points, and for the poses to which the legs lead it
            assert sum(solved) <= 2 * (PIECE + 1)
            total += sum(solved)
            solved.clear()
        assert total > len(times)


@pytest.mark.parametrize(('piece', 'name', 'step'), [
    (1, 'clear', SECOND), (1, 'singular', SECOND // 2), (7, 'clear', SECOND // 10),
    (100, 'singular', SECOND // 2), (10**6, 'clear', SECOND // 10)])
def test_the_outcome_does_not_depend_on_the_pieces(
        monkeypatch: pytest.MonkeyPatch, piece: int, name: str, step: int) -> None:
    times, rows = sampled(name, step)
    for parameters in (PARAMETERS, UNBOUND):
        data = messages.trajectory(STAMP, times, rows)
        expected = outcome_of(data, parameters)
        with monkeypatch.context() as patch:
            patch.setattr(planned, '_READ', piece)
            patch.setattr(planned, '_WRITTEN', piece)
            patch.setattr(planned, 'check_in_pieces', partial(
                planned_trajectory.check_in_pieces, piece=piece))
            assert outcome_of(data, parameters) == expected


def test_parameters_and_wrench_are_those_it_began_with() -> None:
    times, rows = sampled('clear', SECOND // 100)
    data = messages.trajectory(STAMP, times, rows)
    light = PARAMETERS.replaced({'platform.mass': 100.0})
    works = [planned.answer(parameters, NO_WRENCH, data) for parameters in (PARAMETERS, light)]
    outcomes: list[PlannedOutcome | None] = [None, None]
    while not all(outcomes):
        outcomes = [next(work, None) or outcome
                    for work, outcome in zip(works, outcomes, strict=True)]
    assert outcomes == [outcome_of(data), outcome_of(data, light)]


# Rejected

def spoilt(**changes: Any) -> bytes:
    """Return a message of four points, corrupted."""
    times, rows = some(4)
    times = list(changes.pop('times', times))
    for (point, column), value in changes.pop('numbers', {}).items():
        rows[point, column] = value
    return messages.trajectory(STAMP, times, rows, **changes)


WHOLE = spoilt()
BAD: dict[str, tuple[bytes, str, str]] = {
    'nothing': (b'', 'malformed', '0 bytes'),
    'no CDR': (b'\x01' + WHOLE[1:], 'malformed', 'is not plain CDR'),
    'cut short in the last point': (WHOLE[:-40], 'malformed', 'points[3] is cut short'),
    'no points': (messages.trajectory(STAMP, [], []), 'malformed',
                  '0 points: must be 1 to 100000'),
    'two joints': (spoilt(names=('a', 'b')), 'malformed', 'the second the base'),
    'another frame': (spoilt(frame='world'), 'wrong frame_id',
                      "'world', must be 'base' or empty"),
    'not finite': (spoilt(numbers={(2, 8): math.nan}), 'not finite', 'points[2]'),
    'no unit quaternion': (spoilt(numbers={(1, 6): 1.01}), 'quaternion not of unit length',
                           'points[1]: length 1.0'),
    'times that stand': (spoilt(times=[0, 5, 5, 6]), NOT_INCREASING,
                         'points[2]: 5e-09 s, after 5e-09 s'),
    'a time before zero': (spoilt(times=[-SECOND, 0, 1, 2]), NOT_INCREASING,
                           'points[0]: -1 s, must be at least 0'),
    'out of range': (spoilt(numbers={(1, 0): 1e200}), TOO_FAR, 'points[0] and the next'),
    'out of range at once': (messages.trajectory(STAMP, [0], [(1e200, *HOME[1:], *REST, *REST)]),
                             'out of range', 'at 0.000 s: out of range: numbers overflow'),
    'too far': (spoilt(times=[0, SECOND, 2 * SECOND, 10**18]), TOO_FAR,
                'points[2] and the next'),
    **{f'{parts} at {n}': (
        spoilt(parts=[parts if at == n else (1, 1, 1) for at in range(4)]), 'malformed',
        f'points[{n}]: {words}: each point has one') for n, parts, words in (
            (1, (0, 1, 1), '0 transforms'), (2, (1, 0, 1), '0 velocities'),
            (3, (1, 1, 0), '0 accelerations'), (2, (2, 1, 1), '2 transforms'))},
}


@pytest.mark.parametrize('case', BAD)
def test_bad_input_is_rejected_with_its_reason(case: str) -> None:
    data, reason, words = BAD[case]
    outcome = outcome_of(data)
    assert outcome.reason.startswith(reason)
    assert words in outcome.message
    assert '\n' not in outcome.message


def test_too_many_points_are_rejected_unread(snapshot: Snapshot) -> None:
    _, rows = some(1)
    one = messages.trajectory(STAMP, [1], rows)
    at = one.index(b'platform\0') + 12
    assert one[at:at + 4] == b'\x01\0\0\0'
    outcome = outcome_of(
        one[:at] + (100_001).to_bytes(4, 'little') + one[at + 4:] + bytes(100_001))
    snapshot(outcome.message)


def test_more_samples_than_allowed_are_not_taken(
        monkeypatch: pytest.MonkeyPatch, snapshot: Snapshot) -> None:
    times, rows = sampled('clear', SECOND)
    monkeypatch.setattr(planned_trajectory, 'MOST_SAMPLES', 100)
    outcome = outcome_of(messages.trajectory(STAMP, times, rows))
    assert outcome.reason == TOO_FAR
    snapshot(outcome.message)


@given(st.data())
def test_any_trajectory_is_accepted_or_rejected(data: st.DataObject) -> None:
    times, rows = some(data.draw(st.integers(1, 6)))
    message = bytearray(messages.trajectory(
        STAMP, times, rows, frame=data.draw(st.sampled_from(['', 'base'])),
        names=data.draw(st.sampled_from([(), ('platform',), ('p',)]))))
    for _ in range(data.draw(st.integers(0, 4))):
        at = data.draw(st.integers(0, len(message) - 1))
        change = data.draw(st.binary(min_size=1, max_size=8))
        message[at:at + len(change)] = change
    cut = data.draw(st.one_of(st.none(), st.integers(0, len(message))))
    outcome = outcome_of(bytes(message[:cut]))
    if outcome.answer:
        for point in decoded(outcome).points:
            assert np.isfinite([*point.positions, *point.velocities, *point.effort]).all()


@given(st.binary(max_size=600))
def test_any_bytes_are_rejected(data: bytes) -> None:
    assert outcome_of(data).reason


@given(st.lists(st.tuples(st.integers(1, 10**12), st.lists(st.floats(
    allow_nan=False, allow_infinity=False), min_size=15, max_size=15)), min_size=1, max_size=5))
def test_any_numbers_are_accepted_or_rejected(points: list[tuple[int, list[float]]]) -> None:
    times = np.cumsum([time for time, _ in points]).tolist()
    rows = [(*numbers[:3], *HOME[3:], *numbers[3:]) for _, numbers in points]
    outcome_of(messages.trajectory(STAMP, times, rows))


# Planned trajectories are worked on one after the other, a piece at each tick of the timer

class Timed:
    """A queue, its timer, and the outcomes of the trajectories."""

    def __init__(self) -> None:
        self.running = False
        self.pieces: list[str] = []
        self.done: list[tuple[str, float]] = []
        self.queue: TaskQueue[PlannedOutcome] = TaskQueue(
            self._timer,
            lambda outcome, came: self.done.append((outcome.message, came)))

    def _timer(self, callback: Callable[[], None]) -> Any:
        self._callback = callback
        return self

    def start(self) -> None:
        """Start the timer."""
        self.running = True

    def stop(self) -> None:
        """Stop the timer."""
        self.running = False

    def tick(self) -> None:
        """Call back, as the timer does once after each start."""
        self.running = False
        self._callback()

    def work(self, name: str, pieces: int = 2) -> Iterator[PlannedOutcome | None]:
        """Yield None after each piece, and the outcome at the end."""
        for _ in range(pieces):
            self.pieces.append(name)
            yield None
        yield PlannedOutcome(name)


def test_each_tick_is_one_piece_and_the_timer_runs_while_there_is_work() -> None:
    timed = Timed()
    assert not timed.running
    timed.queue.add(timed.work('first'), 1.0)
    timed.queue.add(timed.work('second', pieces=1), 2.0)
    for pieces, done in ((['first'], []), (['first'] * 2, []),
                         (['first'] * 2, [('first', 1.0)]),
                         (['first', 'first', 'second'], [('first', 1.0)])):
        assert timed.running
        timed.tick()
        assert timed.pieces == pieces
        assert timed.done == done
    timed.tick()
    assert timed.done == [('first', 1.0), ('second', 2.0)]
    assert not timed.running


def test_the_queue_counts_trajectories_in_work_and_waiting() -> None:
    timed = Timed()
    for n in range(LENGTH):
        assert not timed.queue.full
        timed.queue.add(timed.work(str(n), pieces=0), 0.0)
    assert timed.queue.full
    timed.tick()
    assert not timed.queue.full


def test_dropped_trajectories_are_counted_and_not_continued() -> None:
    timed = Timed()
    assert timed.queue.drop() == 0
    for name in ('first', 'second'):
        timed.queue.add(timed.work(name), 0.0)
    timed.tick()
    assert timed.queue.drop() == 2
    assert timed.queue.empty
    assert timed.pieces == ['first']
    assert not timed.done
    assert not timed.running


# The status of planned trajectories, within the node's diagnostics

BEGIN = 100.0
ACCEPTED = PlannedOutcome('accepted: 2 points', answer=b'1')
REJECTED = PlannedOutcome('rejected: x', 'why', values=(('points', '3'),))


def diagnostics() -> DynamicsDiagnostics:
    return DynamicsDiagnostics(PARAMETERS, ['setpoint/pose'], (), BEGIN)


def logged(of: DynamicsDiagnostics) -> list[LogLine]:
    return [line for line in of.report(BEGIN)[1] if line.text.startswith('planned')]


def test_planned_trajectories_have_a_status_once_there_was_one() -> None:
    of = diagnostics()
    planned = of.planned_trajectory
    assert [each.name for each in of.report(BEGIN)[0]][-1] == 'timing'
    planned.done(ACCEPTED, 0.25)
    assert of.report(BEGIN)[0][-1] == ('planned trajectory', OK, 'accepted: 2 points', [
        ('accepted', '1'), ('rejected', '0'), ('time it took (s)', '0.250')])
    assert not of.level_changed(BEGIN)
    planned.done(REJECTED, 0.1)
    assert of.level_changed(BEGIN)
    # It lasts until the next.
    for now in (BEGIN, BEGIN + 100.0):
        status = of.report(now)[0][-1]
        assert status.name == 'planned trajectory'
        assert status.level == ERROR
        assert dict(status.values) == {
            'accepted': '1', 'rejected': '1', 'rejected: why': '1', 'points': '3',
            'time it took (s)': '0.100'}
    planned.done(ACCEPTED._replace(warning=True), 0.1)
    assert of.report(BEGIN)[0][-1].level == WARN


def test_each_rejection_is_logged_and_what_took_long_and_of_others_the_changes() -> None:
    of = diagnostics()
    warned = ACCEPTED._replace(warning=True)
    text = 'planned trajectory: accepted: 2 points'
    rejected = LogLine(ERROR, 'planned trajectory rejected: x', 'why')
    outcomes: list[tuple[PlannedOutcome, float]]
    for outcomes, lines in (
            ([(ACCEPTED, 0.1)], []), ([(REJECTED, 0.1)] * 2, [rejected] * 2), ([], []),
            ([(ACCEPTED, 0.1), (ACCEPTED, 1.9), (warned, 0.1), (REJECTED, 0.1)],
             [LogLine(OK, text), LogLine(WARN, text), rejected]),
            ([(ACCEPTED, 2.14), (ACCEPTED, 3.0), (REJECTED, 4.0)],
             [LogLine(OK, f'{text} (took 2.1 s)'), LogLine(OK, f'{text} (took 3.0 s)'),
              LogLine(ERROR, 'planned trajectory rejected: x (took 4.0 s)', 'why')])):
        for outcome, seconds in outcomes:
            of.planned_trajectory.done(outcome, seconds)
        assert logged(of) == lines
