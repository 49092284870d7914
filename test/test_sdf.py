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


"""The SDFormat file: accepted by libsdformat where it is installed, its frames and gravity."""

from pathlib import Path
import shutil
import subprocess
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from referees import random_parameters, rng

from stewart_dynamics import Parameters, StewartPlatform
from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.description.sdf import sdf, upright

PLATFORM = Path(__file__).parents[1] / 'config' / 'platform.yaml'
# The program of libsdformat: gz of new releases, ign of old ones.
PROGRAM = next((name for name in ('gz', 'ign') if shutil.which(name)), '')


@pytest.mark.skipif(not PROGRAM, reason='needs gz sdf or ign sdf')
@pytest.mark.parametrize('seed', [None, 0])
def test_libsdformat_finds_the_file_valid(seed, tmp_path):
    p = Parameters.from_yaml(PLATFORM) if seed is None else random_parameters(rng(seed))
    file = tmp_path / 'hexapod.sdf'
    file.write_text(sdf(Hexapod(p), 'hexapod'), encoding='utf-8')
    done = subprocess.run([PROGRAM, 'sdf', '-k', str(file)], capture_output=True, text=True,
                          timeout=60)
    assert done.returncode == 0, done.stderr
    assert 'Valid' in done.stdout


def test_the_joints_and_the_tips_close_the_loops():
    p = Parameters.from_yaml(PLATFORM)
    model = ET.fromstring(sdf(Hexapod(p), 'hexapod')).find('model')
    joints = {joint.get('name'): joint for joint in model.iter('joint')}
    kinds = [joint.get('type') for joint in joints.values()]
    assert [kinds.count(kind) for kind in ('fixed', 'universal', 'prismatic', 'ball')] == [
        1, 6, 6, 6]
    tip, = (link for link in model.iter('link') if link.get('name') == 'leg_3_tip')
    assert tip.find('pose').get('relative_to') == 'platform'
    at = [float(each) for each in tip.findtext('pose').split()]
    assert at == [*p['geometry.platform_joints'][2], 0.0, 0.0, 0.0]
    assert joints['leg_3_platform_joint'].find('pose') is None  # at its child, the tip
    assert joints['leg_3_platform_joint'].findtext('child') == 'leg_3_tip'
    fixed = {(plugin.findtext('parent_link'), plugin.findtext('child_link'))
             for plugin in model.iter('plugin')}
    assert fixed == {('platform', f'{leg}_tip') for leg in p['joints']}


def test_no_link_has_two_parent_joints() -> None:
    """Gazebo's engines reject a joint whose child has a parent already."""
    model = ET.fromstring(sdf(Hexapod(Parameters.from_yaml(PLATFORM)), 'hexapod')).find('model')
    children = [joint.findtext('child') for joint in model.iter('joint')]
    assert len(children) == len(set(children)) == 1 + 6 * 3


def test_length_limits_count_from_the_home_pose() -> None:
    p = Parameters.from_yaml(PLATFORM)
    model = ET.fromstring(sdf(Hexapod(p), 'hexapod')).find('model')
    joints = {joint.get('name'): joint for joint in model.iter('joint')}
    home = StewartPlatform(p).inverse_kinematics(StewartPlatform(p).home_pose())
    limit = joints['leg_1'].find('axis/limit')
    assert float(limit.findtext('lower')) == pytest.approx(0.95 - home[0], abs=1e-15)
    assert float(limit.findtext('upper')) == pytest.approx(1.65 - home[0], abs=1e-15)


@pytest.mark.parametrize('gravity', [
    [0.0, 0.0, -9.8], [0.0, 0.0, 9.8], [3.0, -1.0, 2.0], [-9.8, 0.0, 0.0], [0.0, 0.0, 0.0]])
def test_the_model_is_turned_until_gravity_points_down(gravity):
    turn = upright(np.array(gravity))
    assert turn @ turn.T == pytest.approx(np.eye(3), abs=1e-15)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    assert turn @ gravity == pytest.approx([0.0, 0.0, -np.linalg.norm(gravity)], abs=1e-14)


def test_a_base_frame_with_the_name_of_the_world_gets_another_in_sdf():
    p = Parameters.from_yaml(PLATFORM).replaced({'base_frame': 'world'})
    model = ET.fromstring(sdf(Hexapod(p), 'hexapod')).find('model')
    assert [link.get('name') for link in model.iter('link')][0] == 'world_base'
