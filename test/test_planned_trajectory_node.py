# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Planned trajectories over real topics: checked beside the setpoints, and never half."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from running import (
    bits, DynamicsNode, header, HOME, nanoseconds, NODE, Planner, Sample, wrench_message)
from sensor_msgs.msg import JointState
from stewart_dynamics import approach, StewartPlatform
from trajectory_msgs.msg import JointTrajectory

Start = Callable[..., DynamicsNode]

OK = bytes([0])

RISEN = HOME._replace(position=(0.01, -0.02, 1.13))
MOTION = [HOME, RISEN, HOME._replace(position=(0.02, 0.0, 1.1)), HOME]


def check(answer: JointTrajectory, samples: list[Sample], platform: StewartPlatform,
          wrench: tuple[float, ...] | None = None) -> None:
    """Check all bits of an answer against the library's."""
    parameters = platform.parameters
    assert list(answer.joint_names) == list(parameters['joints'])
    assert answer.header.frame_id == ''
    assert len(answer.points) == len(samples)
    for point, sample in zip(answer.points, samples, strict=True):
        result = platform.inverse_dynamics(sample.motion(), wrench)
        assert bits(point.positions) == bits(result.lengths - parameters['geometry.zero_length'])
        assert bits(point.velocities) == bits(result.rates)
        assert bits(point.effort) == bits(result.forces)
        assert len(point.accelerations) == 0


def test_a_trajectory_is_answered_with_the_bits_of_the_library(fresh: Start) -> None:
    node = fresh()
    node.until_active()
    planner = Planner(node)
    planner.send(MOTION, step=500_000_000, stamp=123_456_789_012)
    answer = planner.until_answered(1)
    check(answer, MOTION, node.platform)
    assert nanoseconds(answer.header.stamp) == 123_456_789_012
    assert [nanoseconds(point.time_from_start) for point in answer.points] == [
        0, 500_000_000, 1_000_000_000, 1_500_000_000]
    node.until_status('planned trajectory', OK, 'accepted: 4 points over 1.5 s')
    assert node.values('planned trajectory')['accepted'] == '1'
    # The load that ~/wrench last gave holds for it as for setpoints.
    load = (100.0, -50.0, -300.0, 20.0, 10.0, -5.0)
    node.publish('wrench', wrench_message(load))
    expected = node.result_of(HOME, load)
    node.until(lambda: bits(node.state_of(node.send()).effort) == bits(expected.forces),
               'the load has come')
    planner.send(MOTION, step=500_000_000)
    check(planner.until_answered(2), MOTION, node.platform, load)


def test_setpoints_are_answered_while_trajectories_are_in_work(fresh: Start) -> None:
    """
    Many setpoints, one after the other, are answered before the next trajectory is done.

    The trajectories are rejected at their ends, because such long answers may be delayed.
    """
    node = fresh()
    node.until_active()
    planner = Planner(node)
    planner.fill(leap=0.01)

    def done() -> int:
        return int(node.values('planned trajectory').get('rejected: a limit is exceeded', 0))

    # Five are in work or wait, and one more comes for each that is done; a few setpoints could be
    # answered before each is done if they were in work all at once.
    longest = between = 0
    before = done()
    for _ in range(20_000):
        if longest > 8:
            break
        answered = len(node.raw['leg_states'])
        node.send()
        node.until(lambda answered=answered: len(node.raw['leg_states']) > answered,
                   'the setpoint is answered')
        between += 1
        if done() > before:
            longest, between, before = max(longest, between), 0, done()
            planner.send_long(20_000, leap=0.01)
    assert longest > 8


def measured_at(node: DynamicsNode) -> Callable[..., None]:
    """Return a function that publishes the legs, the first ones only, measured in a pose."""
    writer = node.peer.writer(f'{NODE}/measured_legs', JointState)
    node.until(writer.get_subscription_count, 'the node hears measured legs')

    def publish(sample: Sample, legs: int = 6) -> None:
        names = node.platform.parameters['joints'][:legs]
        positions = node.platform.inverse_kinematics(sample.motion()) - node.platform.parameters[
            'geometry.zero_length']
        writer.publish(JointState(
            header=header(node.stamp()), name=names, position=positions[:legs].tolist(),
            velocity=[0.0] * legs, effort=[0.0] * legs))

    return publish


# The measured legs are in use when the node is active, for as long as a test may take.
MEASURED = ('joint_states.source:=measured', 'setpoint.timeout:=1000.0')


def measure(node: DynamicsNode, sample: Sample) -> None:
    """Publish the legs measured in a pose, and wait until the node has them."""
    publish, models = measured_at(node), node.peer.listen(f'{NODE}/joint_states', JointState)
    node.until(lambda: publish(sample) or models, 'the node has measured legs')


def test_a_trajectory_that_starts_away_from_the_measured_legs_is_rejected(fresh: Start) -> None:
    node = fresh('trajectory.approach:=check', *MEASURED)
    node.until_active()
    planner = Planner(node)
    planner.send(MOTION, step=500_000_000)
    planner.until_rejected('measured legs not known', 1)
    measure(node, RISEN)
    planner.send(MOTION, step=500_000_000)
    planner.until_rejected('does not start where the legs are: leg_', 2)
    assert node.values('planned trajectory')['rejected: does not start where the legs are'] == '1'
    from_there = [RISEN, *MOTION[2:]]
    planner.send(from_there, step=500_000_000)
    check(planner.until_answered(1), from_there, node.platform)


def test_an_approach_leads_from_the_measured_legs_to_the_trajectory(fresh: Start) -> None:
    node = fresh('trajectory.approach:=prepend', *MEASURED)
    node.until_active()
    planner = Planner(node)
    measure(node, RISEN)
    planner.send(MOTION, step=500_000_000, stamp=123_456_789_012)
    answer = planner.until_answered(1)
    assert nanoseconds(answer.header.stamp) == 123_456_789_012
    times, motion = approach(node.platform, RISEN.motion(), HOME.motion())
    before, after = answer.points[:len(times) - 1], answer.points[len(times) - 1:]
    result = node.platform.inverse_dynamics(motion[:-1])
    # The measured pose is that of forward kinematics, to 1e-12 m.
    for field, expected in (
            ('positions', result.lengths - node.platform.parameters['geometry.zero_length']),
            ('velocities', result.rates), ('effort', result.forces)):
        np.testing.assert_allclose([getattr(point, field) for point in before], expected,
                                   rtol=1e-9, atol=1e-9)
    answer.points = after
    check(answer, MOTION, node.platform)
    assert [nanoseconds(point.time_from_start) for point in (*before, *after)] == [
        *np.rint(times[:-1] * 1e9), *(round(times[-1] * 1e9) + 500_000_000 * n for n in range(4))]


def test_legs_of_rejected_messages_are_not_where_the_hexapod_is(fresh: Start) -> None:
    """They show that somebody measures, but not where the legs are now."""
    node = fresh('trajectory.approach:=prepend', MEASURED[0], 'setpoint.timeout:=0.5')
    node.until_active()
    planner, publish = Planner(node), measured_at(node)

    def trajectory(legs: int) -> bool:
        publish(RISEN, legs)
        planner.send([HOME])
        return 'measured legs not known' in node.status('planned trajectory').message

    node.until(lambda: not trajectory(6) and planner.raw, 'a trajectory has its approach')
    node.until(lambda: trajectory(5), 'trajectories are rejected again')
