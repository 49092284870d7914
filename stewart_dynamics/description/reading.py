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


"""A hexapod from a file of another tool: URDF, SDFormat or MJCF, by the name of its root."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics.description.mechanism import DescriptionError, Mechanism
from stewart_dynamics.description.read_mjcf import read_mjcf
from stewart_dynamics.description.read_sdf import read_sdf
from stewart_dynamics.description.read_urdf import read_urdf
from stewart_dynamics.description.recognition import Recognized, recognized
from stewart_dynamics.errors import one_line
from stewart_dynamics.whole_file import read_text

_LARGEST = 20_000_000  # bytes
_XACRO = 'http://www.ros.org/wiki/xacro'


def read_hexapod(path: Path) -> Recognized:
    """
    Return the parameters of the hexapod in a file, with remarks on all assumptions.

    Raises
    ------
    StewartError
        The file cannot be read, or there is no hexapod in it; in one line.

    """
    try:
        return recognized(read_mechanism(path))
    except np.linalg.LinAlgError as exc:
        raise DescriptionError(f'{path}: out of range: numbers overflow') from exc


def read_mechanism(path: Path) -> Mechanism:
    """Return the mechanism that a file describes."""
    text = read_text(path, _LARGEST, DescriptionError)
    if '<!ENTITY' in text:  # which may grow without bound
        raise DescriptionError(f'{path}: has entities of its own: write their text out')
    try:
        root = ET.fromstring(text)
    except (ET.ParseError, ValueError) as exc:
        raise DescriptionError(f'{path}: not XML: {one_line(exc)}') from exc
    if _XACRO in text and root.tag == 'robot':
        raise DescriptionError(f'{path}: is xacro: convert it with xacro first')
    if root.tag == 'mujoco':
        return read_mjcf(path)
    readers = {'robot': read_urdf, 'sdf': read_sdf, 'gazebo': read_sdf}
    if root.tag not in readers:
        raise DescriptionError(
            f'{path}: begins with {root.tag!r}: must be URDF (robot), SDFormat (sdf) or MJCF '
            '(mujoco)')
    return readers[root.tag](root, path)
