# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The ship: simulator, motion compensation, node and leg controller, four processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import rclpy
from running import own_domain, PLATFORM, ROOT
from stewart_dynamics.mechanics.frames.rotation import from_euler

DEMO = 'ship'

SECONDS = 0.6
# Much faster than a ship, so that little time is enough.
MOTION = """
/**:
  ros__parameters:
    base_motion:
      source: sine
      ramp: 0.2
      frequency: 1.0
      amplitude: [0.01, 0.02, 0.02, 0.03, 0.02, 0.01]
    imu: {rate: 250.0}
"""


@pytest.fixture(scope='module')
def run(ros_environment: None, demo: ModuleType, tmp_path_factory: pytest.TempPathFactory,
        ) -> Iterator[Callable[..., Any]]:
    """Return a function that makes a run of a name in a domain of its own, once."""
    file = tmp_path_factory.mktemp('ship') / 'ship.yaml'
    file.write_text(MOTION, encoding='utf-8')
    ship = demo.Ship(PLATFORM, file, SECONDS)
    with pytest.MonkeyPatch.context() as patch, own_domain() as domain:
        patch.setenv('ROS_DOMAIN_ID', str(domain))
        rclpy.init()
        yield cache(lambda name, number=0: ship.run(name, lambda many: None))
        rclpy.try_shutdown()


# A motion so fast shows the delay of the angular acceleration from an IMU.
@pytest.mark.parametrize('name, times', [
    ('PD + forces, base motion', 10.0), ('PD + forces, IMU', 3.0)])
@pytest.mark.slow
def test_base_terms_cut_the_error(run: Callable[..., Any], name: str, times: float) -> None:
    without, forward = run('PD + forces, fixed base'), run(name)
    assert len(without.errors.seconds) == len(forward.errors.seconds) == 301
    for series in ('all legs', 'position', 'rotation'):
        assert 0.0 < times * forward.errors.rms[series] < without.errors.rms[series], series


def test_setpoints_are_the_inverse_of_the_base_motion(demo: ModuleType) -> None:
    """The platform is at rest in the world; the derivatives are those of the pose."""
    ship = demo.Ship(PLATFORM, ROOT / 'config' / 'ship.yaml', 10.0)
    base, motion = ship.base, ship.motion
    world = base.position + np.einsum('nij,nj->ni', base.rotation, motion.position)
    np.testing.assert_allclose(world, np.tile(ship.target.position, (len(world), 1)), atol=1e-14)
    np.testing.assert_allclose(base.rotation @ motion.rotation,
                               np.tile(ship.target.rotation, (len(world), 1, 1)), atol=1e-14)
    step = 2.0 / demo.RATE
    for derivative, of in ((motion.linear_velocity, motion.position),
                           (motion.linear_acceleration, motion.linear_velocity),
                           (motion.angular_acceleration, motion.angular_velocity)):
        np.testing.assert_allclose(derivative[1:-1], (of[2:] - of[:-2]) / step, atol=1e-4)
    turning = (motion.rotation[2:] - motion.rotation[:-2]) / step @ motion.rotation[
        1:-1].swapaxes(1, 2)
    np.testing.assert_allclose(motion.angular_velocity[1:-1], np.stack(
        [turning[:, 2, 1], turning[:, 0, 2], turning[:, 1, 0]], axis=1), atol=1e-5)


def test_a_platform_that_is_turned_in_the_world_stays_so(demo: ModuleType) -> None:
    ship = demo.Ship(PLATFORM, ROOT / 'config' / 'ship.yaml', 1.0)
    target = demo.Pose([0.1, -0.2, 1.2], from_euler([0.1, -0.2, 0.3]))
    for base in ship.base[::100]:
        setpoint = demo.seen_from(base, target)
        np.testing.assert_allclose(base.rotation @ setpoint.rotation, target.rotation, atol=1e-14)


@pytest.mark.parametrize('option, value', [
    ('--params', 'nowhere.yaml'),
    ('--ship', 'large'),
    ('--ship', 'nowhere.yaml')])
def test_a_run_with_bad_options_is_rejected_in_one_line(
        rejects: Callable[..., None], tmp_path: Path, option: str, value: str) -> None:
    if value == 'large':
        file = tmp_path / 'large.yaml'
        file.write_text(MOTION.replace('0.02, 0.02, 0.03', '0.5, 0.5, 0.3'), encoding='utf-8')
        value = str(file)
    rejects(option, value)
