# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Formats of other tools: their writers, and their readers by the content of a file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import re
from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.description.mjcf import mjcf
from stewart_dynamics.description.read_mjcf import read_mjcf
from stewart_dynamics.description.read_sdf import read_sdf
from stewart_dynamics.description.read_urdf import read_urdf
from stewart_dynamics.description.read_usd import read_usd, SUFFIXES
from stewart_dynamics.description.recognition import Recognized, recognized
from stewart_dynamics.description.sdf import sdf
from stewart_dynamics.description.urdf import urdf
from stewart_dynamics.description.usd import usd
from stewart_dynamics.errors import one_line
from stewart_dynamics.legs.mechanism import DescriptionError, Mechanism
from stewart_dynamics.whole_file import read_text

WRITERS: dict[str, Callable[[Hexapod, str], str]] = {
    'urdf': urdf, 'sdf': sdf, 'xml': mjcf, 'usda': usd}
"""Writers of a hexapod as a model of a name, by the suffix of its file."""
# Readers of XML by the root element.
_READERS: dict[str, Callable[[ET.Element, Path], Mechanism]] = {
    'robot': read_urdf, 'sdf': read_sdf, 'gazebo': read_sdf,
    'mujoco': lambda _, path: read_mjcf(path)}
_LARGEST = 20_000_000  # bytes
# First bytes of files of other kinds, and the advice about them.
_KINDS = (
    (b'version https://git-lfs.github.com/spec/', 'a Git LFS pointer, not the file: run git lfs '
     'pull first'),
    (b'#usda', 'USD (text): its name must end in .usda or .usd'),
    (b'PXR-USDC', 'USD (binary): its name must end in .usdc or .usd'),
    (b'PK\x03\x04', 'a zip archive: unpack it first, or name it .usdz if it is USD'),
    (b'\x1f\x8b', 'compressed with gzip: unpack it first'),
    (b'ISO-10303-21', 'a STEP file: shapes without joints'))
_XACRO = re.compile(r'<xacro:|\$[{(][^})]*[})]')
_TEMPLATE = re.compile(r'<%|\{%|\{\{')


def read_hexapod(path: Path, geometry_only: bool = False) -> Recognized:
    """
    Return the parameters of the hexapod in a file, with remarks on all assumptions.

    geometry_only: as in ``recognized``.
    Raises StewartError if the file cannot be read, or there is no hexapod in it.
    """
    try:
        return recognized(read_mechanism(path), geometry_only)
    except np.linalg.LinAlgError as exc:
        raise DescriptionError(f'{path}: out of range: numbers overflow') from exc


def _check_kind(path: Path, data: bytes) -> None:
    """Raise DescriptionError for a file of another kind."""
    for begin, words in _KINDS:
        if data.startswith(begin):
            raise DescriptionError(f'{path}: is {words}')


def read_mechanism(path: Path) -> Mechanism:
    """Return the mechanism that a file describes."""
    if path.suffix in SUFFIXES:
        return read_usd(path)
    text = read_text(path, _LARGEST, DescriptionError, _check_kind)
    if path.suffix == '.xacro' or _XACRO.search(text) and '<robot' in text:
        raise DescriptionError(f'{path}: is xacro: run xacro first: xacro FILE > FILE.urdf')
    if _TEMPLATE.search(text):
        raise DescriptionError(f'{path}: is a template (ERB or Jinja): render it first')
    if '<!ENTITY' in text:  # which may grow without bound
        raise DescriptionError(f'{path}: has entities of its own: write their text out')
    try:
        root = ET.fromstring(text)
    except (ET.ParseError, ValueError) as exc:
        raise DescriptionError(f'{path}: not XML: {one_line(exc)}') from exc
    if root.tag not in _READERS:
        raise DescriptionError(
            f'{path}: begins with {root.tag!r}: must be URDF (robot), SDFormat (sdf) or MJCF '
            '(mujoco)')
    return _READERS[root.tag](root, path)
