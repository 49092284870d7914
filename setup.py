# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


from glob import glob
from importlib.util import find_spec
import os
from pathlib import Path
import platform
import re
import shlex
import shutil
import subprocess
import sys

from setuptools import Extension, find_packages, setup
from setuptools.command.build_ext import build_ext

try:
    from setuptools.command.bdist_wheel import bdist_wheel
except ImportError:  # before setuptools 70.1: colcon does without wheels
    from setuptools import Command as bdist_wheel

package_name = 'stewart_dynamics'
if sys.platform == 'win32':
    raise SystemExit(f'{package_name}: Windows: not supported: it locks files as Unix does; '
                     'in WSL 2 it installs as on Linux')
share = f'share/{package_name}'

# Read, not imported: where the package is built its dependencies need not be installed.
version = re.findall(r"^__version__ = '(.+)'$", Path(package_name, '__init__.py').read_text(
    encoding='utf-8'), re.MULTILINE)[0]

# No ROS package is in install_requires: with a ROS installation they come from package.xml, and
# pip has them under other names. Everything else that an executable imports is listed here.
install_requires = [
    'jinja2>=3.1',  # the replay's pages
    'lz4>=4',
    'mcap>=1.2.1',
    'msgspec>=0.18.6',  # records of results
    'numpy>=1.26',
    'orjson>=3.9',
    'plotly>=6',  # plotly.js in the report, figures of the library
    'pyyaml>=6',
    'rosbags>=0.11',
    'tqdm>=4.64',
    'zstandard>=0.21',
]
extras_require = {
    'calibrate': ['scipy>=1.10'],
    'cluster': ['distributed>=2024.1'],
    'completion': ['argcomplete>=3.2.3'],  # before, zsh has no := in names of parameters
    'differentiate': ['scipy>=1.10'],
    'docs': [
        'docutils>=0.21',  # tex2mathml has as_block
        'furo>=2024.1.29',
        'myst-nb>=1.1.1',  # for this docutils
        'myst-parser>=3',  # likewise
        'numpydoc>=1.6',
        'sphinx>=7.3.7',  # for this docutils; 7.3.0 warns of any type of a setting
    ],
    'gpu': ['cupy-cuda12x>=13'],
    'gym': ['gymnasium>=1.1'],  # for examples/hexapod_env.py
    'live': ['websockets>=13'],  # for examples/live_view.py
    'mujoco': ['mujoco>=3.14'],  # before, inertias have errors of 1e-5
    'parquet': ['pyarrow>=14'],
    'pandas': ['pandas>=2'],
    'response': ['scipy>=1.10'],
    'ros': [
        'ros-jazzy-common-interfaces~=5.3',
        'ros-rclpy[fastrtps]~=7.1.6',
    ],
    'ros-kilted': [
        'ros-kilted-common-interfaces~=5.5',
        'ros-rclpy[fastrtps]~=9.1.2',
    ],
    'usd': ['usd-core>=24.8'],
    'test': [
        'check-jsonschema>=0.38',  # older ones ask for a ruamel.yaml that breaks rosbags
        'cmake',
        'colcon-common-extensions',
        'dask',
        'distributed',
        'flake8',
        'flake8-import-order',
        'hypothesis',
        'import-linter',
        'ipykernel',
        'jsonschema>=4.18',  # for check-jsonschema
        'matplotlib',
        'mcap',
        'mcap-ros2-support',
        'mujoco',
        'mypy',
        'nbclient',
        'nvidia-cuda-nvrtc-cu12; sys_platform == "linux"',  # compiles kernels without a GPU
        'packaging',
        'pin',
        'playwright',
        'pyarrow',
        'pytest',
        'pytest-xdist',
        'ruff',
        'scipy',
        'setuptools>=70.1,<80',  # wheels without the package wheel; colcon needs less than 80
    ],
}

CORE = Path(package_name, 'core')
# The same bits on all processors of a kind: no product is fused into a sum, no sum is reordered.
FLAGS = ('-std=gnu99', '-O3', '-fPIC', '-ffp-contract=off', '-fno-math-errno',
         '-fno-trapping-math', '-Wno-psabi', '-Wno-unknown-warning-option')
# Other systems for which $WHEEL_PLATFORM makes a wheel, by its tag, as targets of ziglang.
TARGETS = {
    'manylinux_2_17_x86_64': 'x86_64-linux-gnu.2.17',
    'manylinux_2_17_aarch64': 'aarch64-linux-gnu.2.17',
    'manylinux_2_31_armv7l': 'arm-linux-gnueabihf.2.31',
    'manylinux_2_31_riscv64': 'riscv64-linux-gnu.2.31',
    'musllinux_1_2_x86_64': 'x86_64-linux-musl',
    'musllinux_1_2_aarch64': 'aarch64-linux-musl',
    'macosx_10_13_x86_64': 'x86_64-macos.10.13',
    'macosx_11_0_arm64': 'aarch64-macos.11.0',
}
WHEEL_PLATFORM = os.environ.get('WHEEL_PLATFORM', '')
if WHEEL_PLATFORM and WHEEL_PLATFORM not in TARGETS:
    raise SystemExit(f'{package_name}: WHEEL_PLATFORM: {WHEEL_PLATFORM!r}: must be one of '
                     f'{", ".join(TARGETS)}')
# Versions of lanes.c: the suffix of its function, its lanes, what the processor must have.
VERSIONS = {'baseline': (2, ())}
if (TARGETS[WHEEL_PLATFORM].partition('-')[0] if WHEEL_PLATFORM else platform.machine()) in (
        'x86_64', 'AMD64', 'amd64'):
    VERSIONS |= {'avx2': (4, ('-mavx2',)), 'avx512': (8, ('-mavx512f', '-mavx512dq'))}


def c_compiler() -> list[str]:
    """Return the command of a C compiler: $CC, the system's, or that of the package ziglang."""
    # The defaults of ziglang are this very processor, and checks of undefined behavior.
    ziglang = [sys.executable, '-m', 'ziglang', 'cc', '-mcpu=baseline', '-fno-sanitize=undefined']
    if WHEEL_PLATFORM:
        if find_spec('ziglang'):
            return [*ziglang, '-target', TARGETS[WHEEL_PLATFORM], '-Wl,-s']
        raise SystemExit(f'{package_name}: WHEEL_PLATFORM: needs the package ziglang from PyPI')
    for name in (os.environ.get('CC', ''), 'cc', 'gcc', 'clang'):
        command = shlex.split(name)
        if command and shutil.which(command[0]) and subprocess.run(
                [*command, '-E', '-x', 'c', '-'], input=b'#include <math.h>', check=False,
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode == 0:
            return command
    if find_spec('ziglang'):
        return ziglang
    raise SystemExit(
        f'{package_name}: found no C compiler: install one (Debian and Ubuntu: apt install gcc '
        'libc6-dev); or, for builds without isolation, the package ziglang from PyPI')


class BuildCore(build_ext):
    """Build the shared library of core/, the same for every Python."""

    def get_ext_filename(self, fullname: str) -> str:
        """Return the name without that of a Python."""
        return f'{fullname.replace(".", os.sep)}.so'

    def build_extension(self, ext: Extension) -> None:
        """Compile and link it, if a source is newer."""
        path = Path(self.get_ext_fullpath(ext.name))
        times = [os.path.getmtime(each) for each in (*ext.depends, 'setup.py')]
        if not self.force and path.is_file() and path.stat().st_mtime > max(times):
            return
        compiler = c_compiler()
        folder = Path(self.build_temp)
        folder.mkdir(parents=True, exist_ok=True)
        path.parent.mkdir(parents=True, exist_ok=True)
        # Single samples: vectors of two numbers would only cost moves.
        commands = {'library': ['-fno-tree-vectorize', str(CORE / 'library.c')]} | {
            suffix: [*processor, f'-DLANES={lanes}', f'-DSUFFIX={suffix}', str(CORE / 'lanes.c')]
            for suffix, (lanes, processor) in VERSIONS.items()}
        objects = [str(folder / f'{name}.o') for name in commands]
        compiling = [subprocess.Popen([*compiler, *FLAGS, '-c', *command, '-o', each])
                     for command, each in zip(commands.values(), objects, strict=True)]
        done = [each.wait() for each in compiling]  # all, before an error ends this process
        # Renamed when it is complete: running processes keep the old one.
        new = path.with_suffix('.new')
        if any(done) or subprocess.run(
                [*compiler, '-shared', *objects, '-lm', '-o', str(new)], check=False).returncode:
            raise SystemExit(f'{package_name}: {shlex.join(compiler)}: cannot compile {CORE}')
        new.replace(path)


class Wheel(bdist_wheel):
    """A wheel for every Python 3, and for all systems with the libraries that it needs."""

    def get_tag(self) -> tuple[str, str, str]:
        """Return the tags of Python, ABI and system."""
        if WHEEL_PLATFORM:
            return 'py3', 'none', WHEEL_PLATFORM
        *_, system = super().get_tag()
        library = next(Path(self.bdist_dir, CORE).glob('*.so'), None) if self.bdist_dir else None
        if library and system.startswith('linux_'):
            versions = re.findall(rb'GLIBC_2\.(\d+)', library.read_bytes())
            if versions:
                system = f'manylinux_2_{max(17, *map(int, versions))}_{system[len("linux_"):]}'
        return 'py3', 'none', system


setup(
    name=package_name,
    version=version,
    description='Leg forces of Gough-Stewart platforms: inverse dynamics with massive legs',
    author='The stewart_dynamics developers',
    maintainer='The stewart_dynamics developers',
    maintainer_email='maintainers@stewart-dynamics.example',
    license='Apache-2.0',
    packages=find_packages(include=[package_name, f'{package_name}.*']),
    # A build for this system does not meet the library of another one.
    options={'build': {'build_base': f'build/{WHEEL_PLATFORM}'}} if WHEEL_PLATFORM else {},
    ext_modules=[Extension(f'{package_name}.core.library', [str(CORE / 'library.c')],
                           depends=sorted(map(str, CORE.glob('*.[ch]'))))],
    cmdclass={'build_ext': BuildCore} | (
        {'bdist_wheel': Wheel} if hasattr(bdist_wheel, 'get_tag') else {}),
    package_data={package_name: ['py.typed'], f'{package_name}.core': ['*.c', '*.h'],
                  f'{package_name}.ros': ['one_host.xml'],
                  f'{package_name}.calibration': ['templates/*'],
                  f'{package_name}.cueing': ['templates/*'],
                  f'{package_name}.datasheet': ['templates/*'],
                  f'{package_name}.export': ['c/*'],
                  f'{package_name}.legs': ['examples/*'],
                  f'{package_name}.identification': ['templates/*'],
                  f'{package_name}.replay': ['templates/*'],
                  f'{package_name}.reporting': ['templates/*']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{package_name}']),
        (share, ['package.xml']),
        (f'{share}/bags', ['bags/README.md']),
        *[(f'{share}/{bag}', sorted(glob(f'{bag}/*'))) for bag in sorted(glob('bags/*/'))
          if not bag.startswith('bags/__')],
        (f'{share}/config', sorted(glob('config/*.*'))),
        (f'{share}/config/controllers', sorted(glob('config/controllers/*.*'))),
        (f'{share}/deploy', sorted(glob('deploy/*'))),
        (f'{share}/examples', sorted(glob('examples/*.*'))),
        (f'{share}/examples/notebooks', sorted(glob('examples/notebooks/*.*'))),
        # Not launch/*: after a launch file was compiled there is a folder __pycache__.
        (f'{share}/launch', sorted(glob('launch/*.launch.py'))),
        (f'{share}/security', sorted(glob('security/*'))),
    ],
    python_requires='>=3.10,<3.15',
    install_requires=install_requires,
    extras_require=extras_require,
    zip_safe=False,
    entry_points={
        'console_scripts': [
            'stewart_calibrate = stewart_dynamics.calibration:main',
            'stewart_capability = stewart_dynamics.datasheet:main',
            'stewart_cueing = stewart_dynamics.ros.console_scripts:cueing',
            'stewart_cueing_report = stewart_dynamics.cueing.report_command_line:main',
            'stewart_describe = stewart_dynamics.description:main',
            'stewart_dynamics = stewart_dynamics.ros.console_scripts:dynamics',
            'stewart_export = stewart_dynamics.export:main',
            'stewart_identify = stewart_dynamics.identification:main',
            'stewart_init = stewart_dynamics.questions:main',
            'stewart_replay = stewart_dynamics.replay:main',
            'stewart_simulator = stewart_dynamics.ros.console_scripts:simulator',
            'stewart_trajectory = stewart_dynamics.ros.console_scripts:trajectory',
        ],
    },
)
