# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""A pose that the hexapod cannot have: the error without which it can is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from referees import rng

from stewart_dynamics import Pose, StewartPlatform
from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.frames.motion import motion_rows
from stewart_dynamics.mechanics.frames.rotation import from_euler, from_quaternion, to_quaternion
from stewart_dynamics.mechanics.kinematics.home_pose import home_pose
from stewart_dynamics.mechanics.kinematics.pose_errors import find_pose_error
from stewart_dynamics.parameters.table import Parameters

CONFIG = Path(__file__).resolve().parents[1] / 'config'
PLATFORM = StewartPlatform.from_yaml(CONFIG / 'platform.yaml')
SIZE = PLATFORM.parameters['singularity.characteristic_length']


def error_of(position: Array, rotation: Array, parameters: Parameters = PLATFORM.parameters,
             first: bool = True) -> str:
    """Return the possible error in a pose."""
    return find_pose_error(parameters, motion_rows(Pose(position, rotation))[0], first)


def w_first(rotation: Array) -> Array:
    """Return the rotation that is read where x y z w are taken for w x y z."""
    x, y, z, w = to_quaternion(rotation).tolist()
    return np.reshape(from_quaternion(w, x, y, z), (3, 3))


@pytest.mark.parametrize('seed', range(12))
def test_the_possible_error_in_a_pose_is_named(seed: int) -> None:
    home, random = PLATFORM.home_pose(), rng(seed)
    # The first ones at home itself.
    move, turn = random.normal(0.0, 0.04 * SIZE, 3), from_euler(random.normal(0.0, 0.08, 3))
    if seed < 2:
        move, turn = np.zeros(3), np.eye(3)
    position, rotation = home.position + move, turn @ home.rotation
    expected = {
        '': (position, rotation),
        'possible error: position in mm': (1e3 * position, rotation),
        'possible error: a pose counted from home': (move, turn),
        'possible error: a quaternion in the order w x y z': (position, w_first(rotation)),
        'possible error: a pose counted from home and a quaternion in the order w x y z':
            (move, w_first(turn)),
        'possible error: an axis of the other sign, or geometry.platform_side':
            (position * [1.0, 1.0, -1.0], rotation)}
    if np.linalg.norm(move) > 0.01:
        expected['possible error: position in mm and a pose counted from home'] = 1e3 * move, turn
    for text, pose in expected.items():
        assert error_of(*pose).split('; ')[-1] == text
        other_side = 'platform_side' in text
        assert error_of(*pose, first=False) == ('' if other_side else text)


def test_a_pose_just_outside_the_limits_has_no_possible_error() -> None:
    home = PLATFORM.home_pose()
    for by in (-0.3, 0.3):
        assert error_of(home.position + [0.0, 0.0, by], home.rotation) == ''


def test_without_a_home_pose_only_a_position_in_mm_is_named() -> None:
    parameters = PLATFORM.parameters.replaced({
        'limits.length_min': None, 'limits.length_max': None, 'geometry.zero_length': 0.0})
    for z, text in ((1e3, 'possible error: position in mm'), (1.0, ''), (10.0, '')):
        assert error_of(np.array([0.0, 0.0, z]), np.eye(3), parameters) == text


@pytest.mark.parametrize('seed', range(4))
def test_joints_in_the_frame_of_the_other_body_are_named(seed: int) -> None:
    """The hexapod is the same, but its poses are not those of the frames that the user means."""
    home, random, p = PLATFORM.home_pose(), rng(seed), PLATFORM.parameters
    turn = from_euler(random.normal(0.0, 0.05, 3))
    position = home.position + random.normal(0.0, 0.03 * SIZE, 3)
    base, platform = p['geometry.base_joints'], p['geometry.platform_joints']
    for name, joints, text in (
            ('geometry.base_joints', base - home.position, 'base_joints in the platform frame'),
            ('geometry.platform_joints', platform + home.position,
             'platform_joints in the base frame')):
        wrong = p.replaced({name: joints.ravel()})
        assert error_of(position, turn, wrong) == f'possible error: geometry.{text}'
        # Poses of that file itself are possible.
        moved = home_pose(wrong)
        assert error_of(moved.position, moved.rotation, wrong) == ''
