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


"""Digest of the inputs of a replay: bag, parameters, options and program."""

from __future__ import annotations

import hashlib
from importlib import metadata
import json
from pathlib import Path
from typing import Any

import numpy as np

from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.replay.replay_options import Options

# Version of summary.json; increased when the meaning of a key changes.
VERSION = 1


def software() -> str:
    """Return name and version of this program."""
    try:
        return f'stewart_dynamics {metadata.version("stewart_dynamics")}'
    except metadata.PackageNotFoundError:  # run from its sources
        return 'stewart_dynamics'


def plain_parameters(parameters: Parameters) -> dict[str, Any]:
    """Return all parameters for JSON."""
    return {name: _plain(value) for name, value in parameters.items()}


def fingerprint(bag: Path, parameters: Parameters, options: Options) -> str:
    """
    Return a digest that changes with whatever the results of a replay depend on.

    It covers names, sizes and times of modification of the files of the bag.
    """
    files = sorted(bag.iterdir()) if bag.is_dir() else [bag]
    about = {
        'program': [software(), VERSION],
        'files': [[file.name, found.st_size, found.st_mtime_ns]
                  for file in files if (found := file.stat())],
        'parameters': plain_parameters(parameters),
        'options': [[name, dict(value) if name == 'topics' else value]
                    for name, value in options._asdict().items() if name not in ('force', 'run')]}
    text = json.dumps(about, sort_keys=True, default=str)
    return hashlib.sha256(text.encode('utf-8', 'backslashreplace')).hexdigest()


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.ravel().tolist()
    return list(value) if isinstance(value, tuple) else value
