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

"""The compiled code on disk: damaged files are replaced, and where none can be written none is."""

from __future__ import annotations

from collections.abc import Callable
import importlib.util
from pathlib import Path
import resource
from typing import Any

import numpy as np
import pytest

from stewart_dynamics.mechanics.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason='nothing is compiled here')

SOURCE = """\
from stewart_dynamics.mechanics.jit import entry_point

@entry_point
def {name}(number):
    return {name_factor} * number
"""
FACTORS = {'twice': 2.0, 'thrice': 3.0}

Load = Callable[..., Any]


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Return a function that imports a compiled function anew, as another process does."""
    def anew(name: str = 'twice') -> Any:
        file = tmp_path / f'{name}.py'
        if not file.exists():
            file.write_text(SOURCE.format(name=name, name_factor=FACTORS[name]))
        spec = importlib.util.spec_from_file_location(name, file)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return getattr(module, name)

    return anew


def is_loaded(function: Any, factor: float = 2.0) -> bool:
    """Return whether a function that computes the right number comes from its file."""
    assert function(1.5) == 1.5 * factor
    hits, misses = (sum(each.values()) for each in (
        function.stats.cache_hits, function.stats.cache_misses))
    assert hits + misses == 1
    return bool(hits)


def kept(folder: Path, name: str = 'twice') -> Path:
    """Return the one file of a function."""
    file, = (folder / '__pycache__').glob(f'{name}.*.nbc')
    return file


def test_compiled_code_is_loaded_in_the_next_process(load: Load, tmp_path: Path) -> None:
    assert not is_loaded(load())
    assert is_loaded(load())
    assert kept(tmp_path).stat().st_mode & 0o777 == 0o666 & ~current_umask(tmp_path)


def current_umask(folder: Path) -> int:
    """Return the mask of the permissions of new files."""
    (folder / 'new').touch()
    return 0o666 & ~(folder / 'new').stat().st_mode


@pytest.mark.parametrize('damage', [
    pytest.param(lambda content: b'', id='empty'),
    pytest.param(lambda content: content[:20], id='cut in the digest'),
    pytest.param(lambda content: content[:len(content) // 2], id='cut'),
    pytest.param(lambda content: content[:-1], id='last byte missing'),
    pytest.param(lambda content: content + b'\0', id='one byte more'),
    pytest.param(lambda content: b'\0' * len(content), id='zeros'),
])
def test_a_damaged_file_is_compiled_anew(
        load: Load, tmp_path: Path, damage: Callable[[bytes], bytes]) -> None:
    assert not is_loaded(load())
    file = kept(tmp_path)
    whole = file.read_bytes()
    file.write_bytes(damage(whole))
    assert not is_loaded(load())
    assert file.stat().st_size >= len(whole) - 100
    assert is_loaded(load())


def test_a_flipped_bit_anywhere_is_found(load: Load, tmp_path: Path) -> None:
    assert not is_loaded(load())
    file = kept(tmp_path)
    whole = file.read_bytes()
    for place in np.random.default_rng(7).integers(0, 8 * len(whole), 10):
        flipped = bytearray(whole)
        flipped[place // 8] ^= 1 << (place % 8)
        file.write_bytes(flipped)
        assert not is_loaded(load()), f'bit {place}'


def test_the_file_of_another_function_or_source_is_not_used(load: Load, tmp_path: Path) -> None:
    assert not is_loaded(load('twice'))
    assert not is_loaded(load('thrice'), 3.0)
    kept(tmp_path).write_bytes(kept(tmp_path, 'thrice').read_bytes())
    assert not is_loaded(load('twice'))
    source = tmp_path / 'thrice.py'
    source.write_text(source.read_text().replace('3.0 *', '30.0 *'))
    assert not is_loaded(load('thrice'), 30.0)
    assert len(list((tmp_path / '__pycache__').glob('*.nbc'))) == 2  # those replaced


def test_where_no_file_can_be_written_the_function_works_with_a_warning(
        load: Load, tmp_path: Path) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    function = load()
    with pytest.warns(RuntimeWarning, match=(
            r'^the compiled dynamics cannot be kept on disk \(File too large\): every start takes '
            'seconds; let NUMBA_CACHE_DIR name a folder that can be written to$')):
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
        try:
            assert not is_loaded(function)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not list((tmp_path / '__pycache__').glob('*.nb*'))


def test_a_folder_in_place_of_a_file_is_no_error(load: Load, tmp_path: Path) -> None:
    assert not is_loaded(load())
    file = kept(tmp_path)
    file.unlink()
    (file / 'within').mkdir(parents=True)
    with pytest.warns(RuntimeWarning, match='cannot be kept on disk'):
        assert not is_loaded(load())


def test_files_are_deleted_on_request(load: Load, tmp_path: Path) -> None:
    function = load()
    assert not is_loaded(function)
    function._cache.flush()
    assert not list((tmp_path / '__pycache__').glob('*.nbc'))
