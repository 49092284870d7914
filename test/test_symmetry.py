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


"""A wrong sign in a table of joints is found, and tables without one are not touched."""

from pathlib import Path

import numpy as np
import pytest
from referees import random_parameters, rng

from stewart_dynamics import Parameters, StewartPlatform
from stewart_dynamics.mechanics.kinematics.symmetry import odd_joint

PLATFORM = Path(__file__).parents[1] / 'config' / 'platform.yaml'
TABLES = ('geometry.base_joints', 'geometry.platform_joints')


@pytest.mark.parametrize('table', TABLES)
@pytest.mark.parametrize('joint', range(6))
@pytest.mark.parametrize('axis', range(2))
def test_a_wrong_sign_is_found(table, joint, axis):
    good = Parameters.from_yaml(PLATFORM)[table]
    joints = good.copy()
    joints[joint, axis] *= -1.0
    odd = odd_joint(joints)
    # A sign may move a joint onto its mirror image; then the wrong joint is not identifiable.
    twins = [n for n in range(6) if np.array_equal(joints[n], joints[joint])]
    assert odd.joint in twins
    if len(twins) == 1:
        assert odd.expected == pytest.approx(good[joint], abs=2e-3)


def test_a_swapped_digit_is_found():
    joints = Parameters.from_yaml(PLATFORM)['geometry.base_joints'].copy()
    joints[1, 0] = -0.2871 * 3.0
    assert odd_joint(joints).joint == 1


@pytest.mark.parametrize('table', TABLES)
@pytest.mark.parametrize('off', [0.005, 0.02])
def test_a_wrong_digit_that_moves_a_joint_a_little_is_found(table, off):
    """The other five fit far better: by the four digits of the file."""
    good = Parameters.from_yaml(PLATFORM)[table]
    for seed in range(30):
        random, joints = rng(seed), good.copy()
        joint, axis = random.integers(6), random.integers(2)
        joints[joint, axis] += off
        odd = odd_joint(np.round(joints, 4))
        assert odd.joint == joint
        assert odd.expected == pytest.approx(good[joint], abs=3e-4)


@pytest.mark.parametrize('error', [0.0, 1e-9, 1e-5, 1e-4, 1e-3, 1e-2])
@pytest.mark.parametrize('table', TABLES)
def test_symmetric_and_calibrated_hexapods_have_no_odd_joint(table, error):
    good = Parameters.from_yaml(PLATFORM)[table]
    for seed in range(100):
        assert odd_joint(good + rng(seed).normal(size=(6, 3)) * error) is None


@pytest.mark.parametrize('digits', [3, 4, 5, 12])
def test_rounded_hexapods_have_no_odd_joint(digits):
    random = rng()
    for _ in range(100):
        radius, half, begin = random.uniform([0.2, 0.1, 0.0], [1.5, 0.5, 2.0])
        angles = begin + half * np.tile([-1.0, 1.0], 3) + np.repeat(np.arange(3), 2) * 2.0944
        joints = radius * np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles])
        assert odd_joint(np.round(joints, digits)) is None


def test_irregular_hexapods_have_no_odd_joint():
    for seed in range(50):
        p = random_parameters(rng(seed))
        assert [odd_joint(p[table]) for table in TABLES] == [None, None]


def test_the_likely_mistake_names_the_leg_and_the_place():
    p = Parameters.from_yaml(PLATFORM)
    joints = p['geometry.platform_joints'].copy()
    joints[2, 1] *= -1.0
    mistakes = StewartPlatform(p.replaced({'geometry.platform_joints': joints})).check()
    assert len(mistakes) == 1
    assert mistakes[0].startswith('geometry.platform_joints: leg_')
    assert 'repeat after a third of a turn' in mistakes[0]
