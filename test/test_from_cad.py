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

"""The page from CAD to the controller: its program runs, its numbers and words are the code's."""

from __future__ import annotations

from contextlib import redirect_stdout
import io
from pathlib import Path
import re
import sys
from typing import Any

import numpy as np
import pytest
from referees import ROOT

from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.plausibility import likely_mistakes
from stewart_dynamics.reference_motion.motion import motion_at, sample_times
from stewart_dynamics.reference_motion.parameters import ReferenceMotionParameters

PAGE = (ROOT / 'docs' / 'from_cad_to_controller.md').read_text(encoding='utf-8')
HEXAPOD, MOVEMENT = re.findall(r'```yaml\n(.*?)```', PAGE, flags=re.DOTALL)
# Programs of the page with their output: the last by itself, with the node.
*PARTS, WITH_NODE = re.findall(r'```python\n(.*?)```\n```text\n(.*?)```', PAGE, flags=re.DOTALL)


@pytest.fixture(scope='module')
def names(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Run the page's program, compare its output, and return its names."""
    folder = tmp_path_factory.mktemp('hexapod')
    (folder / 'my_hexapod.yaml').write_text(HEXAPOD, encoding='utf-8')
    assert len(PARTS) + 1 == PAGE.count('```python') == 6
    program: dict[str, Any] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for code, expected in PARTS:
            with redirect_stdout(io.StringIO()) as printed:
                exec(compile(code, 'from_cad_to_controller.md', 'exec'), program)
            assert printed.getvalue() == expected
    return program


def test_the_file_on_the_page_is_the_hexapod_that_is_computed(names: dict[str, Any]) -> None:
    assert names['platform'].parameters == names['parameters']
    assert likely_mistakes(names['parameters']) == ()


def test_the_node_gives_the_forces_on_the_page(
        names: dict[str, Any], domain: int, tmp_path: Path) -> None:
    pytest.importorskip('rclpy')
    from running import executable, log_lines, Program
    file = tmp_path / 'my_hexapod.yaml'
    file.write_text(HEXAPOD, encoding='utf-8')
    node = Program([executable('stewart_dynamics'), '--ros-args', '--params-file', file,
                    '-p', 'setpoint.source:=pose'], domain, tmp_path / 'node')
    code, expected = WITH_NODE
    asking = Program([sys.executable, '-c', code], domain, tmp_path / 'asking')
    try:
        assert asking.wait() == 0, asking.stderr
        assert asking.stdout == expected
        assert f'forces {names["at_rest"].forces.round(1).tolist()} N' in expected
        assert node.stop() == 0
        # The page does not stamp its pose.
        assert all('stamps are zero' in line for line in log_lines(node.stderr, 'WARN'))
    finally:
        asking.kill()
        node.kill()


def test_the_motion_on_the_page_begins_at_home_and_keeps_all_limits(
        names: dict[str, Any], tmp_path: Path) -> None:
    file = tmp_path / 'my_motion.yaml'
    file.write_text(MOVEMENT, encoding='utf-8')
    settings = ReferenceMotionParameters.from_yaml(file)
    motion = motion_at(settings, sample_times(settings) * 1e-9)
    assert motion.position[0] == pytest.approx(names['home'], abs=1e-12)
    assert np.array_equal(motion.rotation[0], np.eye(3))
    assert not motion.rows[[0, -1], 12:18].any()
    platform, limits = names['platform'], names['parameters']
    result = platform.inverse_dynamics(motion)
    assert (result.lengths > limits['limits.length_min']).all()
    assert (result.lengths < limits['limits.length_max']).all()
    assert (np.abs(result.rates) < limits['limits.velocity_max']).all()
    assert (np.abs(result.forces) < limits['limits.force_max']).all()
    assert result.condition_number.max() < limits['singularity.warn_condition']


# Mistakes by the words with which the node reports them on the page.
def mistakes(names: dict[str, Any]) -> dict[str, list[dict[str, Any]]]:
    """Return the changes that make each reported mistake."""
    p = names['parameters']
    in_mm = {name: 1e3 * p[name] for name in ('geometry.base_joints', 'geometry.platform_joints')}
    moments = names['inertia'][np.diag_indices(3)]
    products = names['inertia'][np.triu_indices(3, 1)]
    return {
        'joints in mm': [in_mm],
        'inertia in g mm^2 or kg mm^2': [
            {'platform.inertia': factor * p['platform.inertia']} for factor in (1e9, 1e6)],
        '`zero_length` or limits in mm': [
            {'limits.length_min': 620.0, 'limits.length_max': 920.0,
             'geometry.zero_length': 620.0}],
        '`force_max` in kN': [{'limits.force_max': 2.49}],
        'a number without a point': [{'platform.mass': 21}],
        'moments first, then products: ixx iyy izz ixy ixz iyz': [
            {'platform.inertia': np.concatenate([moments, products])}],
        'platform joints that start with another leg': [
            {'geometry.platform_joints': np.roll(p['geometry.platform_joints'], by, axis=0)}
            for by in range(1, 6)],
        'masses in g': [{'platform.mass': 21400.0}, {'legs.cylinder.mass': 2100.0},
                        {'legs.piston.mass': 900.0}],
        'strokes as limits of length': [
            {'limits.length_min': 0.0, 'limits.length_max': 0.3}],
        '`reflected_mass` left out, or inertia of the rotor': [
            {'actuator.reflected_mass': inertia} for inertia in (None, 2.9e-5, 0.29)],
        'lead in mm, or per radian': [
            {'actuator.reflected_mass': mass} for mass in (1.4e-5, 0.35)],
        "center of mass from CAD's origin": [
            {'platform.center_of_mass': names['axes'] @ names['center_cad']}]}


def _rows() -> dict[str, tuple[str, ...]]:
    section = PAGE.split('## 6. ')[1].split('## 7. ')[0]
    cells = [tuple(cell.strip() for cell in line.strip('|').split('|'))
             for line in section.splitlines() if line.startswith('|')][2:]
    return {mistake: rest for mistake, *rest in cells}


def test_what_the_node_says_of_mistakes_is_what_the_page_says(names: dict[str, Any]) -> None:
    rows = _rows()
    told = mistakes(names)
    assert set(told) == {mistake for mistake, (said, _) in rows.items()
                         if not said.startswith('nothing')}
    for mistake, changes in told.items():
        for change in changes:
            try:
                if change == {'platform.mass': 21}:  # in a file; the library takes it
                    Parameters.read_value('platform.mass', '21', 'my_hexapod.yaml')
                said = '\n'.join(likely_mistakes(names['parameters'].replaced(change)))
            except ParameterError as exc:
                said = str(exc)
                assert 'does not start' in rows[mistake][0]
            for words in re.findall('`([^`]+)`', rows[mistake][0]):
                assert words in said, (mistake, said)


def test_what_the_node_cannot_see_shows_as_the_page_says(names: dict[str, Any]) -> None:
    p, axes = names['parameters'], names['axes']
    mirrored = {name: p[name] * [1.0, -1.0, 1.0] for name in (
        'geometry.base_joints', 'geometry.platform_joints')}
    for change in (mirrored, {'geometry.zero_length': 0.77},
                   {'platform.inertia': p['platform.inertia'] * [1, -1, -1, 1, -1, 1]}):
        assert likely_mistakes(p.replaced(change)) == ()

    # The other three legs become longer in the mirror image.
    mirror = StewartPlatform(p.replaced(mirrored))
    turned = names['turned']
    change = mirror.inverse_kinematics(turned) - names['lengths']
    longer = {n for n in range(6) if names['change'][n] > 0.0}
    assert {n for n in range(6) if change[n] > 0.0} == set(range(6)) - longer
    # Forces do not depend on the zero length.
    other = StewartPlatform(p.replaced({'geometry.zero_length': 0.77}))
    at_rest = other.inverse_dynamics(Motion(names['home'], np.eye(3)))
    assert np.array_equal(at_rest.forces, names['at_rest'].forces)

    c = 1e-3 * axes @ names['center_cad']
    about_origin = names['inertia'] + names['mass'] * (c @ c * np.eye(3) - np.outer(c, c))
    largest = np.linalg.eigvalsh(about_origin)[-1]
    assert f'{largest:.1f} kg m^2' in PAGE
    assert np.sqrt(largest / names['mass']) == pytest.approx(1.0, abs=0.05)
    inertia = names['rotor'] + names['screw']
    for lead, unit in ((10.0, 1.0), (0.010, 1.0 / (2.0 * np.pi))):
        mass = inertia * (2.0 * np.pi * unit / lead) ** 2
        assert f'{mass:.2g} kg'.replace('e-05', 'e-5') in PAGE
    assert 6 * names['reflected_mass'] > names['mass']
    assert names['reflected_mass'] == pytest.approx(2 / 3 * names['mass'], rel=0.05)


def test_the_page_is_one_that_is_read_in_ten_minutes() -> None:
    assert len(PAGE.split()) < 2000


def test_controllers_of_the_page_are_those_of_the_files() -> None:
    section = PAGE.split('## 8. ')[1]
    for path in sorted((ROOT / 'config' / 'controllers').glob('*.yaml')):
        assert f'](../config/controllers/{path.name})' in section
