# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The governor by independent equations: all that leaves is within the limits."""

from __future__ import annotations

from typing import Any

from governed import DEMANDS, KINDS, limited_hexapod, random_demand
from independent_limits import exceedances
import numpy as np
import pytest
from referees import PLATFORM
from stewart_dynamics import GovernedStream, Motion, Parameters, StewartPlatform
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.kinematics.home_pose import home_pose

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
    while True:
        p, axes = limited_hexapod(random, kind)
        try:
            stream = GovernedStream(p)
            break
        except ParameterError:  # home is not within such limits
            continue
    times, demand = random_demand(random, wanted, p, 400)
    motion = stream.advance(times, demand)
    assert {name for name, wrong in exceedances(p, motion, axes).items() if wrong.any()} == set()
    if p['limits.velocity_max'] is not None:
        lengths = StewartPlatform(p).inverse_kinematics(motion)
        rates = np.abs(np.diff(lengths, axis=0)) / np.diff(times)[:, None]
        assert (rates <= p['limits.velocity_max']).all()


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
