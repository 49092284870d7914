# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Files built and installed by colcon and by pip, and the metadata in package.xml."""

import ast
from collections import Counter
from collections.abc import Iterable, Iterator
from functools import lru_cache
import importlib.metadata
import os
from pathlib import Path
import py_compile
import re
import runpy
import shutil
import subprocess
import sys
from xml.etree import ElementTree
import zipfile

from packaging.requirements import Requirement
import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
NAME = 'stewart_dynamics'
EXECUTABLES = ('stewart_calibrate', 'stewart_capability', 'stewart_cueing',
               'stewart_cueing_report', 'stewart_dynamics', 'stewart_describe',
               'stewart_export', 'stewart_identify', 'stewart_init', 'stewart_replay',
               'stewart_simulator', 'stewart_trajectory')
PACKAGED = ('bags', 'config', 'examples', 'launch', 'resource', 'security', NAME, 'LICENSE',
            'CHANGELOG.rst', 'CONTRIBUTING.md', 'MANIFEST.in', 'README.md', 'package.xml',
            'pyproject.toml', 'setup.cfg', 'setup.py')
SOURCES = ('bags', 'benchmarks', 'demo', 'docs', 'examples', 'launch', 'test', NAME)

# Modules whose rosdep key is not their own name; '' where rosdep has no key, as in package.xml.
KEYS = {
    'cupy': '', 'dask': '', 'distributed': '', 'docutils': 'python3-docutils',
    'gymnasium': '', 'hypothesis': 'python3-hypothesis', 'jinja2': 'python3-jinja2',
    'jsonschema': 'python3-jsonschema', 'lz4': '',
    'matplotlib': 'python3-matplotlib', 'mcap': 'mcap-ros2-support',
    'mcap_ros2': 'mcap-ros2-support', 'msgspec': '', 'mujoco': 'python3-mujoco-pip',
    'numpy': 'python3-numpy', 'orjson': 'python3-orjson', 'packaging': 'python3-packaging',
    'pandas': 'python3-pandas', 'pinocchio': 'pinocchio', 'playwright': '', 'plotly': '',
    'pxr': '', 'pyarrow': '', 'pytest': 'python3-pytest', 'rosbags': 'python3-rosbags-pip',
    'scipy': 'python3-scipy', 'setuptools': 'python3-setuptools',
    'sphinx': 'python3-sphinx', 'tqdm': 'python3-tqdm',
    'websockets': '', 'yaml': 'python3-yaml', 'zstandard': ''}
# Engines and readers of descriptions, without which the tests that need them are skipped, and the
# plugin of pytest for several processes.
ENGINES = {'pydrake', 'pytransform3d', 'urchin', 'xdist', 'yourdfpy'}
# Modules that are imported where an option asks for them, and the extra that brings them.
OPTIONAL = {'argcomplete': 'completion', 'cupy': 'gpu', 'dask': 'cluster',
            'distributed': 'cluster', 'mujoco': 'mujoco',
            'pandas': 'pandas', 'pxr': 'usd', 'pyarrow': 'parquet', 'scipy': 'differentiate'}
# Modules whose name on PyPI is not their own.
PIP_NAMES = {'cupy': 'cupy-cuda12x', 'mcap_ros2': 'mcap-ros2-support', 'pinocchio': 'pin',
             'pxr': 'usd-core', 'yaml': 'pyyaml'}

# Packages that tests do without: of no use without a GPU.
NOT_PINNED = {'cupy-cuda12x'}

# A compiler that does not optimize, which takes most of the time of a build.
COMPILER = {'CC': """sh -c 'exec cc "$@" -O0' cc"""}

HEADER = re.compile(r"""(#!.*\n)?(#|//|/\*) SPDX-FileCopyrightText: 20\d\d [^\n]+ developers
(#|//| \*) SPDX-License-Identifier[:] Apache-2\.0(\n|$)""")


def python_files(*folders: str) -> list[Path]:
    """Return the Python files in these folders of the repository."""
    return sorted(path for folder in folders for path in (ROOT / folder).rglob('*.py'))


@lru_cache
def imported_by(path: Path) -> frozenset[str]:
    """Return the modules that a file imports."""
    return frozenset(imports(ast.parse(path.read_text())))


def imports(tree: ast.AST) -> Iterator[str]:
    """Yield the modules that are imported, without those that only a type checker imports."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == 'TYPE_CHECKING':
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield node.module or ''
        elif not isinstance(node, ast.expr):  # which holds no statement
            yield from imports(node)


def third_party(*folders: str) -> set[str]:
    """Return the top-level modules that are imported in these folders and not written here."""
    files = python_files(*folders)
    own = {NAME, 'test', *(path.stem for path in files), *(path.parent.name for path in files)}
    found = {name.split('.')[0] for path in files for name in imported_by(path)}
    return found - own - set(sys.stdlib_module_names)


def package_xml() -> ElementTree.Element:
    """Return the root of package.xml."""
    return ElementTree.parse(ROOT / 'package.xml').getroot()


def depends(*kinds: str) -> set[str]:
    """Return the rosdep keys in package.xml of these kinds of dependency."""
    return {element.text or '' for kind in kinds for element in package_xml().findall(kind)}


def call(arguments: Iterable[str | Path], cwd: Path | None = None,
         **environment: str | Path) -> str:
    """Run a program to its end with exit code 0, and return its output."""
    done = subprocess.run(
        [str(argument) for argument in arguments], stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=300, cwd=cwd,
        env={**os.environ, **COMPILER, **{name: str(of) for name, of in environment.items()}})
    assert done.returncode == 0, done.stdout
    return done.stdout


@pytest.fixture(scope='module')
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy of the packaged files: a build leaves files beside setup.py."""
    folder = tmp_path_factory.mktemp('source') / NAME
    folder.mkdir()
    for name in PACKAGED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name,
                            ignore=shutil.ignore_patterns('__pycache__'))
        else:
            shutil.copy(ROOT / name, folder / name)
    return folder


@pytest.fixture(scope='module')
def wheel(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the wheel that pip builds from the sdist alone."""
    pytest.importorskip('setuptools', '70.1')  # older ones need the package wheel as well
    folder = tmp_path_factory.mktemp('wheel')
    call([sys.executable, 'setup.py', '-q', 'sdist', '--dist-dir', folder], source)
    archive, = folder.glob('*.tar.gz')
    call([sys.executable, '-m', 'pip', 'wheel', '--no-deps', '--no-build-isolation',
          '--wheel-dir', folder, archive])
    return next(folder.glob('*.whl'))


@pytest.fixture(scope='module')
def distribution(wheel: Path) -> importlib.metadata.Distribution:
    """Return the metadata of the wheel."""
    folder = next(path for path in zipfile.Path(wheel).iterdir()
                  if path.name.endswith('.dist-info'))
    return importlib.metadata.PathDistribution(folder)


@pytest.fixture(scope='module')
def install(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the install space of colcon after two builds."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ['PATH']])
    colcon = shutil.which('colcon', path=path)
    if colcon is None:
        pytest.skip('there is no colcon')
    folder = tmp_path_factory.mktemp('colcon')
    for launch_file in (source / 'launch').glob('*.py'):
        # As ros2 launch leaves them: a folder __pycache__ in launch/.
        py_compile.compile(str(launch_file), doraise=True)
    for _ in range(2):
        call([colcon, '--log-base', folder / 'log', 'build', '--base-paths', source,
              '--build-base', folder / 'build', '--install-base', folder / 'install',
              '--event-handlers', 'desktop_notification-', 'console_direct+'],
             folder, COLCON_HOME=folder / 'home')
    return folder / 'install'


def check_share(share: Path) -> None:
    """Check that the files are there which ROS and the launch files look up."""
    assert (share / 'ament_index/resource_index/packages' / NAME).is_file()
    assert (share / NAME / 'package.xml').is_file()
    for pattern in ('bags/*.mcap', 'config/*.*', 'config/controllers/*.*', 'examples/*.py',
                    'launch/*.launch.py', 'security/*'):
        expected = {path.name for path in ROOT.glob(pattern)}
        folder, _, files = pattern.rpartition('/')
        assert {path.name for path in (share / NAME / folder).glob(files)} == expected
    assert (share / NAME / 'config/platform.yaml').is_file()
    assert (share / NAME / 'launch/demo.launch.py').is_file()


@pytest.mark.slow
def test_colcon_puts_executables_where_ros2_run_looks(install: Path) -> None:
    """Scripts stand in lib/<package> and data in share/."""
    scripts = install / NAME / 'lib' / NAME
    assert {path.name for path in scripts.iterdir()} == set(EXECUTABLES)
    assert all(os.access(path, os.X_OK) for path in scripts.iterdir())
    check_share(install / NAME / 'share')


@pytest.mark.slow
def test_colcon_result_runs(install: Path) -> None:
    """The executables are those of the install space and not of another installation."""
    script = install / NAME / 'lib' / NAME / 'stewart_replay'
    setup = f'. "{install}/setup.bash" && '
    assert 'usage' in call(['bash', '-c', f'{setup}"{script}" --help'])
    where = call(['bash', '-c', f'{setup}"{sys.executable}" -c '
                  f'"import {NAME}; print({NAME}.__file__)"'], cwd=install)
    assert str(install) in where
    # With the Python that a workspace has, where no executable is beside it.
    python = Path(sys.base_prefix, 'bin', 'python3')
    found = call(['bash', '-c', f'{setup}"{python}" -c "from {NAME}.executables import '
                  'executable; print(executable(\'stewart_replay\'))"'], cwd=install)
    assert found.strip() == str(script)


# As launch_testing 3.4 and launch_testing_ros 0.26 have it: pytest 9 rejects the argument path.
OLD_PLUGIN = 'def pytest_pycollect_makemodule(path, parent): pass\n'


def test_pytest_starts_beside_the_plugins_of_launch(tmp_path: Path) -> None:
    info = tmp_path / 'old_plugins-1.0.dist-info'
    info.mkdir()
    (info / 'METADATA').write_text('Metadata-Version: 2.1\nName: old_plugins\nVersion: 1.0\n')
    names = 'launch_testing', 'launch_ros', 'launch_pytest'
    (info / 'entry_points.txt').write_text('\n'.join(
        ['[pytest11]', *(f'{name} = old_{name}' for name in names)]))
    for name in names:
        (tmp_path / f'old_{name}.py').write_text(OLD_PLUGIN)
    paths = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get('PYTHONPATH')]))
    call([sys.executable, '-m', 'pytest', '--markers'], ROOT, PYTHONPATH=paths)


@pytest.mark.slow
def test_wheel_has_entry_points_and_no_scripts(
        wheel: Path, distribution: importlib.metadata.Distribution) -> None:
    """The folder of scripts that setup.cfg gives colcon is not that of the wheel."""
    assert {point.name for point in distribution.entry_points} == set(EXECUTABLES)
    names = {name for name in zipfile.ZipFile(wheel).namelist() if '.data/data/share' not in name}
    assert not [name for name in names if '/scripts/' in name or '/lib/' in name]
    files = {path.relative_to(ROOT).as_posix() for path in (ROOT / NAME).rglob('*')
             if path.is_file() and '__pycache__' not in path.parts}
    assert {name for name in names if name.startswith(f'{NAME}/')} == files | {
        f'{NAME}/core/library.so'}
    assert not [name for name in names if name.startswith('test/')]


@pytest.mark.slow
def test_pip_puts_executables_on_the_path(wheel: Path, tmp_path: Path) -> None:
    """They land in bin/, beside Python, and the data in share/."""
    call([sys.executable, '-m', 'pip', 'install', '--no-deps', '--no-index', '--ignore-installed',
          '--prefix', tmp_path, wheel])
    assert {path.name for path in (tmp_path / 'bin').iterdir()} == set(EXECUTABLES)
    check_share(tmp_path / 'share')


def test_windows_is_named_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip('setuptools.command.build_ext')  # not while the system is another one
    monkeypatch.setattr(sys, 'platform', 'win32')
    with pytest.raises(SystemExit, match='^stewart_dynamics: Windows: not supported: .* in WSL 2'):
        runpy.run_path(str(ROOT / 'setup.py'))


def test_no_module_has_the_name_of_one_of_python() -> None:
    for path in python_files(NAME):  # A005 of flake8-builtins
        assert path.stem not in sys.stdlib_module_names, path


def test_no_two_modules_have_the_same_name() -> None:
    """A file is found by its name alone."""
    names = Counter(path.name for path in python_files(NAME) if path.name != '__init__.py')
    assert [name for name, count in names.items() if count > 1] == []


@pytest.mark.parametrize('name', EXECUTABLES)
def test_entry_point_loads(distribution: importlib.metadata.Distribution, name: str) -> None:
    """The function behind each executable exists."""
    if name not in ('stewart_calibrate', 'stewart_capability', 'stewart_describe',
                    'stewart_export', 'stewart_init', 'stewart_replay'):
        pytest.importorskip('rclpy')
    point, = distribution.entry_points.select(name=name)
    assert callable(point.load())


def test_package_xml_names_what_the_package_imports() -> None:
    """Each third-party module that is imported has its rosdep key in package.xml."""
    needed = {KEYS.get(name, name)
              for name in third_party('examples', 'launch', NAME) - set(OPTIONAL)} - {''}
    assert needed <= depends('depend', 'exec_depend')


def test_package_xml_names_what_the_tests_import() -> None:
    """The same for the tests, some of which run the demos."""
    imported = third_party('demo', 'examples', 'test') - ENGINES
    needed = {KEYS.get(name, name) for name in imported} - {''}
    assert needed <= depends('depend', 'exec_depend', 'test_depend')


def test_setup_agrees_with_package_xml(distribution: importlib.metadata.Distribution) -> None:
    """Name, version and licence are the same to pip as to ROS."""
    xml = package_xml()
    assert distribution.metadata['Name'].replace('-', '_') == xml.findtext('name') == NAME
    assert distribution.metadata['Version'] == xml.findtext('version')
    citation = yaml.safe_load((ROOT / 'CITATION.cff').read_text(encoding='utf-8'))
    assert citation['version'] == xml.findtext('version')
    assert f'{citation["version"]} ({citation["date-released"]})' in (
        ROOT / 'CHANGELOG.rst').read_text(encoding='utf-8').splitlines()
    assert distribution.metadata['License'] == xml.findtext('license') == 'Apache-2.0'
    assert xml.findtext('export/build_type') == 'ament_python'


def test_pip_requirements(distribution: importlib.metadata.Distribution) -> None:
    """Imported packages are required, ROS only by its extra, and all of them are pinned."""
    requirements = [Requirement(text) for text in distribution.requires or ()]
    always = {item.name for item in requirements if 'extra' not in str(item.marker)}
    imported = third_party(NAME) & set(KEYS)
    assert {PIP_NAMES.get(name, name) for name in imported - set(OPTIONAL)} <= always
    for name in imported & set(OPTIONAL):
        assert not any(item.name == PIP_NAMES.get(name, name) for item in requirements
                       if 'extra' not in str(item.marker))
        assert any(item.name in (PIP_NAMES.get(name, name), 'distributed') for item in requirements
                   if f'extra == "{OPTIONAL[name]}"' in str(item.marker))
    assert not [name for name in always if name.startswith('ros-')]
    extras = {item.name for item in requirements} | {'pip'}
    imported = third_party(*SOURCES) & set(KEYS)
    assert {PIP_NAMES.get(name, name) for name in imported} <= extras
    for ros, other in (('ros', 'ros-kilted'), ('kilted', 'ros')):
        pins = [Requirement(line) for file in (
            'requirements.txt', 'requirements-test.txt', f'requirements-{ros}.txt')
                for line in (ROOT / file).read_text().splitlines() if not line.startswith('#')]
        assert {str(pin.specifier)[:2] for pin in pins} == {'=='}
        versions = {pin.name: str(pin.specifier)[2:] for pin in pins}
        for item in requirements:
            if f'extra == "{other}"' not in str(item.marker) and item.name not in NOT_PINNED:
                assert item.specifier.contains(versions[item.name]), item


def test_programs_beside_the_package_import_names_that_exist() -> None:
    """Nothing else runs all of the benchmarks."""
    for path in python_files('bags', 'benchmarks', 'demo', 'docs', 'examples', 'launch'):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and (node.module or '').startswith(NAME):
                code = compile(ast.Module([node], []), str(path), 'exec')
                exec(code, {})  # as the program does


def test_copyright_headers() -> None:
    """Each source file that is not empty begins with the two lines of SPDX, which REUSE reads."""
    sources = [path for folder in (*SOURCES, 'ros2_control') for path in (ROOT / folder).rglob('*')
               if path.suffix in ('.py', '.c', '.h', '.cpp', '.hpp') and path.stat().st_size]
    assert len(sources) > 400
    assert not [path for path in sources if not HEADER.match(path.read_text())]
