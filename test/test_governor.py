# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The governor by independent equations: all that leaves is within the limits."""

from __future__ import annotations

from typing import Any

from governed import (
    CRANK_DEMANDS, CRANK_KINDS, CRANKS, DEMANDS, governable, KINDS, limited_cranks,
    limited_hexapod, random_demand, stops)
from independent_cranks import cranks
from independent_limits import exceedances
import numpy as np
import pytest
from referees import PLATFORM
from stewart_dynamics import GovernedStream, Motion, Parameters, StewartPlatform
from stewart_dynamics.mechanics.kinematics.home_pose import home_pose

# Times of a stop by its rate, the last ones at rest.
PARTS = np.concatenate([np.linspace(0.0, 5.0, 21), [7.0, 10.0, 30.0]])
PARAMETERS = Parameters.from_yaml(PLATFORM)
HOME = home_pose(PARAMETERS)


def demanded(values: Any) -> Motion:
    """Return a demand of displacements (N, 3) from home, at rest."""
    values = np.asarray(values)
    return Motion(HOME.position + values, np.tile(HOME.rotation, (len(values), 1, 1)))


@pytest.mark.parametrize('wanted', DEMANDS)
@pytest.mark.parametrize('kind', KINDS)
def test_each_setpoint_is_within_the_limits(kind: str, wanted: str) -> None:
    """One kind of limit, and all together, of random hexapods."""
    random = np.random.default_rng([KINDS.index(kind), DEMANDS.index(wanted)])
    p, axes, stream = governable(random, kind, limited_hexapod)
    times, demand = random_demand(random, wanted, p, 400)
    motion = stream.advance(times, demand)
    assert {name for name, wrong in exceedances(p, motion, axes).items() if wrong.any()} == set()
    if p['limits.velocity_max'] is not None:
        lengths = StewartPlatform(p).inverse_kinematics(motion)
        rates = np.abs(np.diff(lengths, axis=0)) / np.diff(times)[:, None]
        assert (rates <= p['limits.velocity_max']).all()


@pytest.mark.parametrize('kind', CRANK_KINDS)
def test_each_setpoint_of_cranks_has_a_stop_within_the_limits(kind: str) -> None:
    """20,000 setpoints of all kinds of demand; the stops are computed apart, and sampled."""
    random, checked = np.random.default_rng([1, CRANK_KINDS.index(kind)]), 0
    for wanted in CRANK_DEMANDS:
        p, axes, stream = governable(random, kind, limited_cranks)
        times, demand = random_demand(random, wanted, p, 150)
        motion = stream.advance(times, demand)
        for each in (motion, stops(p, motion[::15], stream.stop_rate, PARTS)):
            assert {name for name, wrong in exceedances(p, each, axes).items()
                    if wrong.any()} == set(), wanted
        angles = cranks(p, motion).angles
        assert np.abs(np.diff(angles, axis=0)).max() < 1.0  # no turn between two setpoints
        if p['limits.speed_max'] is not None:
            speeds = np.abs(np.diff(angles, axis=0)) / np.diff(times)[:, None]
            assert (speeds <= p['limits.speed_max']).all()
        checked += len(motion)
    assert checked > 1300


def test_where_the_stream_is_cut_the_platform_stops_within_the_limits() -> None:
    """The stop that is executed is the one that was known; it ends at rest."""
    random = np.random.default_rng(3)
    p, axes = limited_cranks(random, 'rig')
    stream = GovernedStream(p)
    times, demand = random_demand(random, 'waves', p, 500)
    motion = stream.advance(times, demand)
    fine = times[-1] + np.arange(1, 6001) * 2e-4
    none = Motion.of_rows(np.full((len(fine), motion.rows.shape[1]), np.nan))
    executed = stream.advance(fine, none)
    known = stops(p, motion[-1:], stream.stop_rate, stream.stop_rate * (fine - times[-1]))
    np.testing.assert_allclose(executed.rows, known.rows, atol=1e-6)
    assert not any(wrong.any() for wrong in exceedances(p, executed, axes).values())
    assert np.abs(motion.linear_velocity[-1]).max() > 0.05
    assert np.abs(executed.rows[-1, 12:]).max() < 1e-4


@pytest.mark.parametrize('lever_min', [0.0, 0.1, 0.3])
def test_a_dead_centre_is_approached_to_a_margin(lever_min: float) -> None:
    """Down, past the reach of the rods: 0.5 % of the stroke of a crank is left of the reach."""
    p = CRANKS.replaced({'limits.lever_min': [lever_min], 'limits.angle_min': [-2.5],
                         'limits.angle_max': [2.5]})
    home, times = home_pose(p), np.arange(4000) * 0.004
    position = home.position - np.outer(times > 0.5, [0.0, 0.0, 0.6])
    stream = GovernedStream(p)
    motion = stream.advance(times, Motion(position, np.tile(home.rotation, (len(times), 1, 1))))
    ratios = cranks(p, motion).ratios
    # sqrt(1 - ratio^2) changes by at most 1 / L1 + 1 / L2 for a displacement of the joint.
    steep = float((1.0 / p['legs.crank.length'] + 1.0 / p['legs.rod.length'])[0])
    stroke = 2.0 * float(p['legs.crank.length'][0])
    left = (np.sqrt(1.0 - lever_min ** 2) - np.sqrt(1.0 - ratios ** 2)) / steep
    assert 0.005 * stroke <= left.min() < 0.0055 * stroke
    assert {name for name, held in stream.held.items() if held > 1.0} == {'limits.lever_min'}


def test_a_lever_changes_by_at_most_its_bound() -> None:
    """The bound on which the proof rests, between two platform joints of random hexapods."""
    random = np.random.default_rng(4)
    for _ in range(20):
        p, _ = limited_cranks(random, 'levers alone')
        home = home_pose(p)
        size = float(p['legs.crank.length'].mean())
        position = home.position + random.uniform(-1.2, 1.2, (2000, 3)) * size
        step = random.normal(size=(2000, 3)) * 1e-4 * size
        here, there = (cranks(p, Motion(each, np.tile(home.rotation, (2000, 1, 1)))).ratios
                       for each in (position, position + step))
        change = np.abs(np.sqrt(1.0 - there ** 2) - np.sqrt(1.0 - here ** 2))
        steep = 1.0 / p['legs.crank.length'] + 1.0 / p['legs.rod.length']
        share = change / (steep * np.linalg.norm(step, axis=1)[:, None])
        assert np.nanmax(share) < 1.0 + 1e-4
        assert np.nanmax(share) > 0.5


def test_a_demand_that_jumps_is_reached_within_the_limits() -> None:
    """As when a game resets: the motion goes there, and is held."""
    times = np.arange(5000) * 0.004
    stream = GovernedStream(PARAMETERS)
    values = np.zeros((len(times), 3))
    values[times >= 1.0] = [0.12, -0.05, 0.08]
    motion = stream.advance(times, demanded(values))
    lengths = StewartPlatform(PARAMETERS).inverse_kinematics(motion)
    assert np.abs(np.diff(lengths, axis=0)).max() / 0.004 < 0.5
    assert sum(stream.held.values()) > 0.0
    np.testing.assert_allclose(motion.position[-1], HOME.position + values[-1], atol=1e-9)
    # The rates are those of the poses.
    np.testing.assert_allclose(np.diff(motion.position, axis=0) / 0.004, 0.5 * (
        motion.linear_velocity[1:] + motion.linear_velocity[:-1]), atol=2e-4)


@pytest.mark.parametrize('enormous', [1e3, 1e10, 1e100, 1.7e308])
def test_the_motion_goes_on_after_an_enormous_number(enormous: float) -> None:
    times = np.arange(4000) * 0.004
    values = np.zeros((len(times), 3))
    values[:, 0] = 0.05
    values[500, 1], values[502:504, 2] = enormous, -enormous
    motion = GovernedStream(PARAMETERS).advance(times, demanded(values))
    assert np.isfinite(motion.rows).all()
    np.testing.assert_allclose(motion.position[-1], HOME.position + values[-1], atol=1e-9)


def test_rates_that_are_not_those_of_the_poses_are_replaced() -> None:
    """Poses alone, with rates of zero, are followed as fast as they move."""
    times = np.arange(8000) * 0.004
    values = np.zeros((len(times), 3))
    values[:, 0] = 0.05 * (1.0 - np.cos(1.5 * times))
    stream = GovernedStream(PARAMETERS)
    motion = stream.advance(times, demanded(values))[-1000:]
    np.testing.assert_allclose(motion.position, HOME.position + values[-1000:], atol=1e-12)
    np.testing.assert_allclose(motion.linear_velocity[:, 0], 0.075 * np.sin(
        1.5 * (times[-1000:] - 0.002)), atol=1e-6)
    assert sum(stream.held.values()) == 0.0


@pytest.mark.parametrize('gap', [0.05, 0.5, 3.0])
def test_lost_samples_of_a_demand_are_bridged(gap: float) -> None:
    times = np.arange(3000) * 0.004
    times = times[(times < 2.0) | (times > 2.0 + gap)]
    w = 1.5
    wave = Motion.from_euler(
        HOME.position + np.outer(0.05 * np.sin(w * times), [1.0, 0.0, 0.0]),
        np.zeros((len(times), 3)), np.outer(0.05 * w * np.cos(w * times), [1.0, 0.0, 0.0]),
        np.zeros((len(times), 3)), np.outer(-0.05 * w ** 2 * np.sin(w * times), [1.0, 0.0, 0.0]),
        np.zeros((len(times), 3)))
    motion = GovernedStream(PARAMETERS).advance(times, wave)
    lengths = StewartPlatform(PARAMETERS).inverse_kinematics(motion)
    assert (np.abs(np.diff(lengths, axis=0)) / np.diff(times)[:, None]).max() < 0.5
    np.testing.assert_allclose(motion.position[-1], wave.position[-1], atol=2e-3)


def test_a_pitch_of_90_degrees_is_no_error() -> None:
    """The rates of roll and yaw are not finite there."""
    times = np.arange(300) * 0.004
    angles = np.outer(times > 0.5, [0.0, 0.5 * np.pi, 0.0])
    demand = Motion.from_euler(np.tile(HOME.position, (len(times), 1)), angles)
    motion = GovernedStream(PARAMETERS).advance(times, demand)
    assert np.isfinite(motion.rows).all()
