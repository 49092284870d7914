# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Pages: tables are those of the code, programs run, links and files exist, faults have tests."""

from __future__ import annotations

from contextlib import redirect_stdout
import importlib
import io
import json
from pathlib import Path
import re
import sys
from types import ModuleType
from typing import Any
import xml.etree.ElementTree as ElementTree

import messages
import numpy as np
import pytest
from referees import ROOT, rotation_about
from scipy.spatial.transform import Rotation
import snapshot
import stewart_dynamics
from stewart_dynamics import BaseMotion, Motion, Parameters, Pose, StewartPlatform
from stewart_dynamics.mechanics.parameter_errors import find_parameter_errors
from stewart_dynamics.parameters.table import PARAMETERS
from stewart_dynamics.reference_motion.motion_functions import motion_at, sample_times
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.setpoints.arrival_stamps import LARGEST
from stewart_dynamics.setpoints.base_input import BaseInput
from stewart_dynamics.setpoints.input_messages import BASE_SOURCES
from stewart_dynamics.setpoints.output_messages import MOTOR_STATES, MOTOR_TYPES
from stewart_dynamics.setpoints.rejections import Rejections
from stewart_dynamics.simulator import state_messages as simulator_messages
import yaml

PAGES = sorted([*ROOT.glob('*.md'), *ROOT.glob('*/README.md'), *ROOT.glob('docs/*.md'),
                *ROOT.glob('benchmarks/results/*.md')])
TEXTS = {page.relative_to(ROOT).as_posix(): page.read_text(encoding='utf-8') for page in PAGES}
README = TEXTS['README.md']


@pytest.fixture
def tables(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return the script that writes the generated tables."""
    monkeypatch.syspath_prepend(str(ROOT / 'docs' / 'figures'))
    return importlib.import_module('tables')


def test_generated_tables_are_current(tables: ModuleType) -> None:
    pages = tables.pages()
    assert {path.relative_to(ROOT).as_posix() for path in pages} == {
        'benchmarks/README.md', 'docs/calibration.md', 'docs/capability.md', 'docs/cranks.md',
        'docs/faults.md',
        'docs/identification.md', 'docs/identify_from_bags.md', 'docs/node.md',
        'docs/motion_cueing.md', 'docs/parameters.md', 'docs/simulator.md',
        'docs/summary.md', 'security/policy.xml'}
    for path, own in pages.items():
        text = path.read_text(encoding='utf-8')
        assert tables.generated(text, own) == text, 'run: python docs/figures/tables.py'
    assert tables.SCHEMA_FILE.read_text(encoding='utf-8') == tables.schema_text()
    for name, record in tables.DOCUMENTS.items():
        assert (ROOT / 'config' / name).read_text(encoding='utf-8') == tables.document_schema(
            record)


def test_thresholds_in_tables_of_faults_are_those_of_the_code() -> None:
    text = (ROOT / 'docs' / 'faults.md').read_text()
    assert set(re.findall(r'([0-9.]+) ms \(RMS\)', text)) == {f'{1e3 * LARGEST:g}'}


def test_every_parameter_is_on_the_page_of_parameters() -> None:
    for name in PARAMETERS:
        assert f'| `{name}` |' in TEXTS['docs/parameters.md']


def test_the_simulator_s_topics_are_those_of_the_code() -> None:
    for topic, kind in {
            **simulator_messages.INPUT_TYPES, **simulator_messages.OUTPUT_TYPES,
            **simulator_messages.BASE_TYPES, MOTOR_STATES: MOTOR_TYPES[MOTOR_STATES],
            simulator_messages.IMU: simulator_messages.IMU_TYPE}.items():
        assert f'| `~/{topic}` | {kind.replace("/msg", "")} |' in TEXTS['docs/simulator.md']


def test_the_readme_has_the_figures_of_its_demo() -> None:
    figures = json.loads((ROOT / 'docs' / 'figures' / 'loop.json').read_text(encoding='utf-8'))
    alone, forward, _, heavier = (run['peak']['position'] / 1e3 for run in figures['runs'])
    assert (f'by {alone:.1f} mm, with them by {forward:.3f} mm, and by {heavier:.2f} mm with a '
            'payload that is 30 % heavier') in ' '.join(README.split())


def test_the_example_of_the_readme_runs(
        monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    code, = re.findall(r'```python\n(.*?)```', README, flags=re.DOTALL)
    monkeypatch.chdir(ROOT)
    exec(compile(code, 'README.md', 'exec'), {})
    lengths, forces = capsys.readouterr().out.replace('\n', ' ').strip(' []').split('] [')
    assert len(lengths.split()) == len(forces.split()) == 6
    assert 0.0 < float(forces.split()[0]) < 1e3


def test_the_examples_of_the_library_run(
        monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    blocks = re.findall(r'```python\n(.*?)```', TEXTS['docs/library.md'], flags=re.DOTALL)
    assert len(blocks) == 8
    monkeypatch.chdir(ROOT)
    names: dict[str, object] = {}
    exec(compile(''.join(blocks), 'library.md', 'exec'), names)
    printed = capsys.readouterr().out.split('\n')
    assert len(printed[0].strip('[] ').split()) == 6
    assert 1.0 < float(printed[1]) < 20.0
    assert float(printed[2]) < 1e-12
    assert float(printed[3].strip('[] ').split()[2]) == pytest.approx(1.1, abs=1e-3)
    assert float(printed[4].strip('[] ').split()[2]) == pytest.approx(-0.1 * np.pi, abs=1e-3)
    assert '(6, 6)' in printed
    assert [line.split()[1] for line in printed[-3:-1]] == ['length_max', 'force_max']
    assert [np.shape(names[name]) for name in ('mass', 'gravity', 'coriolis')] == [
        (6, 6), (6,), (1000, 6, 6)]
    assert names['same'] is True


def links(page: str) -> list[tuple[str, str]]:
    """Return the files and the anchors that a page links to in this repository."""
    text = re.sub(r'```.*?```', '', TEXTS[page], flags=re.DOTALL)
    return [(file, anchor) for file, anchor in re.findall(r'\]\(([^)#]*)(?:#([^)]+))?\)', text)
            if '://' not in file]


def included(page: Path) -> Path:
    """Return the page whose text a page of the site consists of."""
    found = re.match(r'```\{include\} (\S+)', page.read_text(encoding='utf-8'))
    return page.parent / found.group(1) if found else page


def anchors(page: Path) -> set[str]:
    """Return the anchors that GitHub gives the headings of a page."""
    text = re.sub(r'^(?:```.*?^```|    .*?$)', '', page.read_text(encoding='utf-8'),
                  flags=re.DOTALL | re.MULTILINE)
    headings = re.findall(r'^#+ (.*)$', text, flags=re.MULTILINE)
    return {re.sub(r'[^\w\- ]', '', heading).lower().replace(' ', '-') for heading in headings}


@pytest.mark.parametrize('page', TEXTS)
def test_links_lead_to_files_and_headings(page: str) -> None:
    for file, anchor in links(page):
        target = (ROOT / page).parent / file if file else ROOT / page
        assert target.exists(), file
        # GitHub includes nothing.
        assert target.is_dir() or target.suffix != '.md' or included(target) == target, file
        if anchor:
            assert anchor in anchors(target), f'{file}#{anchor}'


@pytest.mark.parametrize('page', [
    'README.md', 'docs/from_cad_to_controller.md', 'docs/simulator.md',
    'docs/planned_trajectories.md', 'docs/replay.md', 'docs/development.md', 'docs/node.md'])
def test_files_in_commands_exist(page: str) -> None:
    # Results of programs and builds, which may be left there: not in the repository.
    left = {line.strip('/') for line in (ROOT / '.gitignore').read_text().splitlines()}
    folders = '|'.join([*(path.name for path in ROOT.iterdir() if path.is_dir()
                          and not path.name.startswith('.') and path.name not in {'test', *left}),
                        *(path.name for path in (ROOT / 'stewart_dynamics').iterdir()
                          if (path / '__init__.py').is_file())])
    named = re.findall(rf'(?<![\w./-])(?:{folders})/[\w./]*\w', TEXTS[page])
    assert named
    for path in named:
        made = path.startswith(('docs/_build', 'docs/<', 'env/'))
        assert made or (ROOT / path).exists() or (ROOT / 'stewart_dynamics' / path).exists(), path


def test_version_is_the_same_everywhere() -> None:
    """Setup.py reads it from the package; package.xml and changelog repeat it."""
    version = stewart_dynamics.__version__
    for file in ROOT / 'package.xml', *ROOT.glob('ros2_control/*/package.xml'):
        assert ElementTree.parse(file).getroot().findtext('version') == version
    changelog = (ROOT / 'CHANGELOG.rst').read_text(encoding='utf-8')
    newest = re.findall(r'^(.*)\n-+$', changelog, re.MULTILINE)[0]
    assert newest == 'Forthcoming' or re.fullmatch(
        rf'{re.escape(version)} \(\d{{4}}-\d\d-\d\d\)', newest)


# docs/faults.md: each row has tests, and each test of faults a row

HERE = Path(__file__).parent


def names_in(*files: str) -> set[str]:
    """Return the names of the tests in files."""
    return {name for pattern in files for path in HERE.glob(pattern)
            for name in re.findall(r'^def (test_\w+)', path.read_text(encoding='utf-8'), re.M)}


def test_every_fault_has_a_test_and_every_test_of_faults_a_row() -> None:
    """Both sides of test/data/faults.yaml: the rows of the page, and the tests."""
    given = yaml.safe_load((HERE / 'data' / 'faults.yaml').read_text(encoding='utf-8'))
    assert all(row['tests'] for rows in given.values() for row in rows)
    sections = TEXTS['docs/faults.md'].split('\n## ')[1:]
    rows = {section.partition('\n')[0]: [
        cells[1].strip() for line in section.splitlines()
        if len(cells := line.split('|')) == 6 and not line.startswith(('| fault', '| ---'))]
        for section in sections}
    assert {name: of for name, of in rows.items() if of} == {
        name: [row['fault'] for row in of] for name, of in given.items()}
    found = {name for rows in given.values() for row in rows for name in row['tests']}
    assert not found - names_in('test_*.py')
    assert not names_in('test_faults.py') - found


def test_every_sentence_belongs_to_a_test() -> None:
    for file in snapshot.FOLDER.iterdir():
        for test in snapshot.read(file.stem):
            module, _, name = test.partition('::')
            assert name.partition('[')[0] in names_in(module), f'{file.name}: {test}'


# The page of the moving base: its programs run, its tables and files are those of the code

MOVING_BASE = (ROOT / 'docs' / 'moving_base.md').read_text(encoding='utf-8')
CONFIG = ROOT / 'config'
# File, name of the node, and source of the motion of its base.
FILES = (('telescope.yaml', '', 'pose'), ('ship_hexapod.yaml', '', 'imu'),
         ('stacked.yaml', 'lower_hexapod', 'fixed'), ('stacked.yaml', 'upper_hexapod', 'motion'))
SECOND = 1_000_000_000


def hexapod(file: str, node: str = '') -> StewartPlatform:
    """Return a hexapod of config/."""
    return StewartPlatform(Parameters.from_yaml(CONFIG / file, node))


def base_input(parameters: Parameters, **changes: Any) -> BaseInput:
    """Return the input that follows the topics of the base."""
    return BaseInput(parameters.replaced({
        name.replace('__', '.'): value for name, value in changes.items()}),
        Rejections(lambda *why: pytest.fail(f'{why}')), pytest.fail)


def test_the_programs_on_the_page_print_what_it_says(monkeypatch: pytest.MonkeyPatch) -> None:
    parts = re.findall(r'```python\n(.*?)```\n```text\n(.*?)```', MOVING_BASE, flags=re.DOTALL)
    assert len(parts) == MOVING_BASE.count('```python') == 2
    monkeypatch.chdir(ROOT)
    names: dict[str, Any] = {}
    for code, expected in parts:
        with redirect_stdout(io.StringIO()) as printed:
            exec(compile(code, 'moving_base.md', 'exec'), names)
        assert printed.getvalue() == expected


@pytest.mark.parametrize(('file', 'node', 'source'), FILES)
def test_the_files_describe_hexapods_without_possible_errors(
        file: str, node: str, source: str) -> None:
    platform = hexapod(file, node)
    assert platform.parameters['base.source'] == source
    assert platform.check() == ()
    assert f'`{file}`' in MOVING_BASE
    result = platform.inverse_dynamics(Motion.from_pose(platform.home_pose()))
    assert result.condition_number < 5.0


def test_setpoints_of_the_lower_hexapod_are_the_motion_of_the_upper_ones_base() -> None:
    upper = hexapod('stacked.yaml', 'upper_hexapod').parameters
    turn = rotation_about(np.array([2.0, -1.0, 2.0]) / 3.0, 0.4)
    carrier = Motion([0.1, 0.2, 1.1], turn, [0.3, 0.1, -0.2], [0.1, 0.4, -0.3], [1.0, 2.0, 0.5],
                     [-2.0, 1.0, 3.0])
    base = base_input(upper)
    twist, accel = (tuple(carrier.rows[n:n + 6].tolist()) for n in (12, 18))
    quaternion = Rotation.from_matrix(turn).as_quat()
    given = (messages.pose(SECOND, (0.1, 0.2, 1.1), quaternion, 'ground'),
             messages.twist(SECOND, twist, 'ground'), messages.accel(SECOND, accel, 'ground'))
    for topic, data in zip(BASE_SOURCES['motion'], given, strict=True):
        base.join_message(topic, data, lambda: 0)
    assert np.allclose(base.at(SECOND), BaseMotion.from_motion(carrier).rows, rtol=0.0, atol=1e-13)


def test_the_base_wrench_of_the_upper_hexapod_loads_the_lower_one_as_a_payload() -> None:
    """With massless legs, held still on the carrier, it is a rigid body on it."""
    lower, upper = (hexapod('stacked.yaml', f'{name}_hexapod') for name in ('lower', 'upper'))
    massless = StewartPlatform(upper.parameters.replaced({
        f'legs.{part}.{name}': 0.0 for part in ('cylinder', 'piston') for name in (
            'mass', 'inertia')}))
    turn = rotation_about(np.array([1.0, 2.0, 2.0]) / 3.0, 0.2)
    stage = Motion.from_pose(Pose([0.02, -0.01, 0.78], turn))
    carrier = Motion.from_euler([0.1, 0.0, 1.18], [0.1, -0.05, 0.2], [0.2, 0.1, 0.0],
                                [0.3, 0.2, -0.4], [0.5, -1.0, 2.0], [2.0, -1.0, 1.0])
    load = massless.base_wrench(stage, base=BaseMotion.from_motion(carrier))
    wrench = np.concatenate([carrier.rotation @ load[:3], carrier.rotation @ load[3:]])

    def inertia(parameters: Parameters) -> Any:
        xx, xy, xz, yy, yz, zz = parameters['platform.inertia']
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def about(point: Any, mass: float, center: Any, tensor: Any) -> Any:
        arm = center - point
        return tensor + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))

    own, its = lower.parameters, upper.parameters
    m, n = own['platform.mass'], its['platform.mass']
    c = own['platform.center_of_mass']
    d = stage.position + stage.rotation @ its['platform.center_of_mass']
    center = (m * c + n * d) / (m + n)
    both = about(center, m, c, inertia(own)) + about(
        center, n, d, stage.rotation @ inertia(its) @ stage.rotation.T)
    one = StewartPlatform(own.replaced({
        'platform.mass': m + n, 'platform.center_of_mass': center,
        'platform.inertia': both[np.triu_indices(3)]}))
    assert np.allclose(lower.inverse_dynamics(carrier, wrench=wrench).forces,
                       one.inverse_dynamics(carrier).forces, rtol=0.0, atol=1e-9)


# The page from CAD to the controller: its program runs, its numbers and words are the code's

FROM_CAD = (ROOT / 'docs' / 'from_cad_to_controller.md').read_text(encoding='utf-8')
HEXAPOD, MOVEMENT = re.findall(r'```yaml\n(.*?)```', FROM_CAD, flags=re.DOTALL)
# Programs of the page with their output: the last by itself, with the node.
*PARTS, WITH_NODE = re.findall(
    r'```python\n(.*?)```\n```text\n(.*?)```', FROM_CAD, flags=re.DOTALL)


@pytest.fixture(scope='module')
def names(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Run the page's program, compare its output, and return its names."""
    folder = tmp_path_factory.mktemp('hexapod')
    (folder / 'my_hexapod.yaml').write_text(HEXAPOD, encoding='utf-8')
    assert len(PARTS) + 1 == FROM_CAD.count('```python') == 6
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
    assert find_parameter_errors(names['parameters']) == ()


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
