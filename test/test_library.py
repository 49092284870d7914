# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The package's names: complete, documented, and imported without unneeded modules."""

from __future__ import annotations

import ast
from pathlib import Path
import pydoc
import re
import subprocess
import sys

from programs import run_program
import pytest
from referees import ROOT

import stewart_dynamics

PLATFORM = ROOT / 'config' / 'platform.yaml'


def test_all_names_resolve_and_are_listed() -> None:
    for name in stewart_dynamics.__all__:
        assert getattr(stewart_dynamics, name) is not None
    assert dir(stewart_dynamics) == sorted(stewart_dynamics.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'Platform'"):
        _ = stewart_dynamics.Platform
    with pytest.raises(ImportError):
        from stewart_dynamics import Nothing  # noqa: F401


def test_type_checkers_see_the_names_that_are_resolved() -> None:
    tree = ast.parse(Path(stewart_dynamics.__file__).read_text(encoding='utf-8'))
    seen = {alias.name: node.module for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom) and node.module
            and node.module.startswith('stewart_dynamics') for alias in node.names}
    assert set(seen) | {'__version__'} == set(stewart_dynamics.__all__)
    for name, module in seen.items():
        assert getattr(sys.modules[module], name) is getattr(stewart_dynamics, name)


def test_the_version_is_that_of_the_package() -> None:
    manifest = (ROOT / 'package.xml').read_text(encoding='utf-8')
    version = re.search(r'<version>(.*)</version>', manifest)
    assert version
    assert stewart_dynamics.__version__ == version[1]
    done = run_program(sys.executable, 'setup.py', '--version', folder=ROOT)
    assert done.out.split()[-1] == version[1]


def test_a_parameter_file_is_checked_without_ros_and_bags() -> None:
    def imported_by(code: str) -> set[str]:
        done = subprocess.run(
            [sys.executable, '-c', f'{code}\nimport sys; print(*sys.modules)'], cwd=ROOT,
            capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return {name.partition('.')[0] for name in done.stdout.split()}

    assert 'numpy' not in imported_by('import stewart_dynamics')
    modules = imported_by(
        'import stewart_dynamics\n'
        f'p = stewart_dynamics.Parameters.from_yaml({str(PLATFORM)!r})\n'
        'stewart_dynamics.Pose.from_euler([0.0, 0.0, 1.0], [0.0, 0.0, 0.0])')
    assert 'numpy' in modules
    assert not modules & {'scipy', 'rclpy', 'rosbags', 'mcap', 'plotly'}


@pytest.mark.parametrize(('name', 'fields'), [
    ('Pose', ('position', 'rotation', 'quaternion', 'rows', 'shape', 'from_matrix')),
    ('Motion', ('linear_velocity', 'angular_acceleration', 'rad/s', 'from_pose')),
    ('InverseDynamics', ('lengths', 'rates', 'forces', 'unit_load_forces', 'm^3/s',
                         'condition_number', 'time_to_crossing')),
    ('ForceBreakdown', ('gravity', 'platform_inertia', 'friction', 'wrench', '[N]', 'total')),
    ('NaturalModes', ('frequencies', 'shapes', '[Hz]')),
    ('StewartPlatform', ('parameters', 'inverse_dynamics', 'natural_modes', 'home_pose'))])
def test_help_describes_the_fields(name: str, fields: tuple[str, ...]) -> None:
    text = pydoc.plain(pydoc.render_doc(getattr(stewart_dynamics, name)))
    summary = text.partition('Method resolution order')[0]
    for field in fields:
        assert field in text
    assert 'Attributes' in summary or name in ('Pose', 'Motion')
    assert len(summary) > 300
