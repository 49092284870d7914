# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""A hexapod as a library for the Arduino IDE, with a sketch that moves six hobby servos."""

from __future__ import annotations

import io
import re
import zipfile

import numpy as np

from stewart_dynamics import __version__
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.export.c_project import c_project, hexadecimal, source, SOURCES
from stewart_dynamics.mechanics.kinematics.home_pose import home_pose
from stewart_dynamics.parameters.table import Parameters

_NEEDED = 'servo.angle_at_min', 'servo.angle_at_max'
_ROW = 3  # numbers in a line


def arduino_library(parameters: Parameters, name: str) -> bytes:
    """
    Return the library as the bytes of a ZIP file, the same for the same parameters.

    Raises ParameterError: the points of the servos are not set, or there is no home pose.
    """
    missing = [each for each in _NEEDED if parameters[each] is None]
    if missing:
        raise ParameterError(
            f'{parameters.source}: {", ".join(missing)}: not set: needed by --arduino')
    files = c_project(parameters, name)
    head = files[f'{name}.h'].partition('\n */')[0].removeprefix('/* ')
    home = home_pose(parameters)
    numbers = [hexadecimal(float(each)) for each in (*home.position, *np.ravel(home.rotation))]
    texts = {'@HEAD@': head, '@NAME@': name, '@HOME@': ''.join(
        f'  {", ".join(numbers[n:n + _ROW])},\n' for n in range(0, len(numbers), _ROW))}
    sketch = re.sub('@[A-Z]+@', lambda found: texts[found[0]], source('servos.ino.in'))
    content = {
        'library.properties': _properties(name),
        **{f'src/{each}': files[each] for each in (*SOURCES, f'{name}.h', f'{name}.c')},
        f'examples/{name}_servos/{name}_servos.ino': sketch}
    file = io.BytesIO()
    with zipfile.ZipFile(file, 'w', zipfile.ZIP_DEFLATED) as archive:
        for path, text in content.items():
            archive.writestr(zipfile.ZipInfo(f'{name}/{path}'), text, zipfile.ZIP_DEFLATED)
    return file.getvalue()


def _properties(name: str) -> str:
    return ''.join(f'{key}={value}\n' for key, value in {
        'name': name, 'version': __version__, 'author': 'stewart_export',
        'maintainer': 'stewart_export', 'sentence': 'A Stewart platform with six servos.',
        'paragraph': 'Angles, torques, limits and pulse widths of poses.',
        'category': 'Device Control', 'url': 'https://docs.ros.org', 'architectures': '*',
        'includes': f'{name}.h'}.items())
