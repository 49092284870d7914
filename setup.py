# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


from glob import glob
from pathlib import Path
import re

from setuptools import find_packages, setup

package_name = 'stewart_dynamics'
share = f'share/{package_name}'

# Read, not imported: where the package is built its dependencies need not be installed.
version = re.findall(r"^__version__ = '(.+)'$", Path(package_name, '__init__.py').read_text(
    encoding='utf-8'), re.MULTILINE)[0]

# No ROS package is in install_requires: with a ROS installation they come from package.xml, and
# pip has them under other names. Everything else that an executable imports is listed here.
install_requires = [
    'jinja2>=3.1',  # the replay's pages
    # Upper bounds: tested up to these; the compiler reads numba's IR and writes object files.
    'llvmlite>=0.44,<0.51; platform_machine in "x86_64 AMD64 aarch64 arm64"',
    'lz4>=4',
    'mcap>=1.2.1',
    'numba>=0.61,<0.69; platform_machine in "x86_64 AMD64 aarch64 arm64"',
    'numpy>=1.26',
    'orjson>=3.9',
    'plotly>=6',  # plotly.js in the report
    'pyyaml>=6',
    'rosbags>=0.11',
    'tqdm>=4.64',
    'zstandard>=0.21',
]
extras_require = {
    'calibrate': ['scipy>=1.10'],
    'cluster': ['distributed>=2024.1'],
    'differentiate': ['scipy>=1.10'],
    'docs': [
        'docutils>=0.21',  # tex2mathml has as_block
        'furo>=2024.1.29',
        'myst-parser>=3',  # for this docutils
        'numpydoc>=1.6',
        'sphinx>=7.3.7',  # for this docutils; 7.3.0 warns of any type of a setting
    ],
    'mujoco': ['mujoco>=3.14'],  # before, inertias have errors of 1e-5
    'parquet': ['pyarrow>=14'],
    'plot': ['matplotlib>=3.7'],  # a legend outside of the axes
    'ros': [
        'ros-jazzy-common-interfaces~=5.3',
        'ros-rclpy[fastrtps]~=7.1.6',
    ],
    'ros-kilted': [
        'ros-kilted-common-interfaces~=5.5',
        'ros-rclpy[fastrtps]~=9.1.2',
    ],
    'test': [
        'cmake',
        'colcon-common-extensions',
        'dask',
        'distributed',
        'flake8',
        'flake8-import-order',
        'hypothesis',
        'import-linter',
        'matplotlib',
        'mcap',
        'mcap-ros2-support',
        'mujoco',
        'mypy',
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

setup(
    name=package_name,
    version=version,
    description='Leg forces of Gough-Stewart platforms: inverse dynamics with massive legs',
    author='The stewart_dynamics developers',
    maintainer='The stewart_dynamics developers',
    maintainer_email='maintainers@stewart-dynamics.example',
    license='Apache-2.0',
    packages=find_packages(include=[package_name, f'{package_name}.*']),
    package_data={package_name: ['py.typed'], f'{package_name}.calibration': ['templates/*'],
                  f'{package_name}.datasheet': ['templates/*'],
                  f'{package_name}.export': ['c/*'],
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
        (f'{share}/examples', sorted(glob('examples/*.py'))),
        # Not launch/*: after a launch file was compiled there is a folder __pycache__.
        (f'{share}/launch', sorted(glob('launch/*.launch.py'))),
        (f'{share}/security', sorted(glob('security/*'))),
    ],
    python_requires='>=3.10,<3.14',
    install_requires=install_requires,
    extras_require=extras_require,
    zip_safe=False,
    entry_points={
        'console_scripts': [
            'stewart_calibrate = stewart_dynamics.calibration:main',
            'stewart_capability = stewart_dynamics.datasheet:main',
            'stewart_describe = stewart_dynamics.description:main',
            'stewart_dynamics = stewart_dynamics.ros.console_scripts:dynamics',
            'stewart_export = stewart_dynamics.export:main',
            'stewart_identify = stewart_dynamics.identification:main',
            'stewart_replay = stewart_dynamics.replay:main',
            'stewart_simulator = stewart_dynamics.ros.console_scripts:simulator',
            'stewart_trajectory = stewart_dynamics.ros.console_scripts:trajectory',
        ],
    },
)
