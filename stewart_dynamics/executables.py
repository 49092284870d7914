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
