# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Where the executables of the package are installed."""

from __future__ import annotations

import os
from pathlib import Path
import sys

from stewart_dynamics.errors import StewartError

_PACKAGE = 'stewart_dynamics'


def executable(name: str) -> Path:
    """
    Return the path of an executable: beside Python (pip), or in lib/stewart_dynamics (colcon).

    A virtual environment is searched before the workspaces that are sourced, any other Python
    after them.

    Raises StewartError: not found; the message lists the folders that were searched.
    """
    beside = Path(sys.executable).parent
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    folders = [Path(prefix, 'lib', _PACKAGE) for prefix in prefixes if prefix]
    folders.insert(0 if sys.prefix != sys.base_prefix else len(folders), beside)
    for folder in folders:
        if (folder / name).is_file():
            return folder / name
    raise StewartError(f'{name}: not found in {", ".join(map(str, folders))}')
