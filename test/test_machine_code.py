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

"""The machine code on disk: damaged files are replaced, and where none can be written none is."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import subprocess
import sys
import tempfile
from threading import Thread
from typing import Any

import numpy as np
import pytest
from referees import ROOT

from stewart_dynamics.compilation import entry_point, machine_code
from stewart_dynamics.compilation.entry_point import EntryPoint, prepare
from stewart_dynamics.compilation.functions import entry_point as marked
from stewart_dynamics.compilation.machine_code import COMPILED
from stewart_dynamics.compilation.preparation import Preparation

pytestmark = pytest.mark.skipif(not COMPILED, reason='nothing is compiled here')

SOURCE = """\
from stewart_dynamics.compilation.functions import entry_point

@entry_point('f8[:,::1]', 'f8', 'i8', 'b1', 'f8[::1]')
def {name}(matrix, factor, shift, doubled, sums):
    for n in range(len(sums)):
        sums[n] = {sign} * factor * matrix[n, shift:].sum() * (2.0 if doubled else 1.0)
"""
SIGNS = {'scaled_sums': 1.0, 'negative_sums': -1.0}


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with two modules, and the machine code of a function of each."""
    folder = tmp_path_factory.mktemp('modules')
    for name, sign in SIGNS.items():
        (folder / f'{name}.py').write_text(SOURCE.format(name=name, sign=sign))
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        patch.setenv('STEWART_DYNAMICS_CACHE_DIR', str(folder / 'kept'))
        entry_point.prepare([imported(name) for name in SIGNS])
    return folder


@pytest.fixture
def kept(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with the machine code, which the test may spoil."""
    kept = tmp_path / 'kept'
    kept.mkdir()
    for file in (folder / 'kept').iterdir():
        (kept / file.name).write_bytes(file.read_bytes())
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.setenv('STEWART_DYNAMICS_CACHE_DIR', str(kept))
    machine_code._source.cache_clear()
    return kept


@pytest.fixture
def announced(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return what is announced in the test."""
    texts: list[str] = []
    monkeypatch.setattr(machine_code, 'announce', texts.append)
    return texts


def is_kept(module: str, name: str) -> bool:
    """Return whether the machine code of a function is on disk and valid."""
    return any(machine_code._kept(folder, module, name) for folder in machine_code._folders())


def imported(name: str) -> EntryPoint:
    """Return the function of a module, imported anew."""
    sys.modules.pop(name, None)
    function: EntryPoint = getattr(__import__(name), name)
    return function


def file_of(kept: Path, name: str = 'scaled_sums') -> Path:
    """Return the one file of a function."""
    file, = kept.glob(f'{name}.{name}.*.code')
    return file


def check(function: EntryPoint, sign: float = 1.0) -> None:
    """Check what a function computes, called both ways."""
    matrix, sums = np.arange(12.0).reshape(3, 4), np.empty(3)
    function(matrix, 0.5, 1, True, sums)
    assert np.array_equal(sums, sign * matrix[:, 1:].sum(axis=1))
    bound = function.bound(matrix, 0.25, 2, False, sums)
    matrix += 1.0
    bound()
    assert np.array_equal(sums, sign * 0.25 * matrix[:, 2:].sum(axis=1))


def test_machine_code_is_loaded_by_the_next_process(kept: Path, announced: list[str]) -> None:
    assert is_kept('scaled_sums', 'scaled_sums')
    check(imported('scaled_sums'))
    check(imported('negative_sums'), -1.0)
    assert announced == []
    (kept / 'new').touch()
    assert file_of(kept).stat().st_mode == (kept / 'new').stat().st_mode


@pytest.mark.parametrize('damage', [
    pytest.param(lambda content: b'', id='empty'),
    pytest.param(lambda content: content[:20], id='cut in the digest'),
    pytest.param(lambda content: content[:len(content) // 2], id='cut'),
    pytest.param(lambda content: content[:-1], id='last byte missing'),
    pytest.param(lambda content: content + b'\0', id='one byte more'),
    pytest.param(lambda content: b'\0' * len(content), id='zeros'),
])
def test_a_damaged_file_is_not_used(kept: Path, damage: Callable[[bytes], bytes]) -> None:
    file = file_of(kept)
    file.write_bytes(damage(file.read_bytes()))
    assert not is_kept('scaled_sums', 'scaled_sums')
    assert not imported('scaled_sums').load()


def test_a_flipped_bit_anywhere_is_found(kept: Path) -> None:
    file = file_of(kept)
    whole = file.read_bytes()
    for place in np.random.default_rng(7).integers(0, 8 * len(whole), 200):
        flipped = bytearray(whole)
        flipped[place // 8] ^= 1 << (place % 8)
        file.write_bytes(flipped)
        assert not is_kept('scaled_sums', 'scaled_sums'), f'bit {place}'


def test_a_damaged_file_is_replaced(kept: Path, announced: list[str]) -> None:
    file = file_of(kept)
    whole = file.read_bytes()
    file.write_bytes(whole[:-1])
    check(imported('scaled_sums'))
    assert announced == ['compiling scaled_sums.scaled_sums for this processor: this takes '
                         'seconds, only this once']
    assert file.read_bytes() == whole
    assert len(list(kept.iterdir())) == 2


def test_the_file_of_another_function_is_not_used(kept: Path) -> None:
    file_of(kept).write_bytes(file_of(kept, 'negative_sums').read_bytes())
    assert not is_kept('scaled_sums', 'scaled_sums')


def test_a_changed_source_is_compiled_anew(kept: Path, folder: Path) -> None:
    source = folder / 'scaled_sums.py'
    text = source.read_text()
    try:
        source.write_text(text.replace('1.0 * factor', '1.5 * factor'))
        machine_code._source.cache_clear()
        assert not is_kept('scaled_sums', 'scaled_sums')
        assert is_kept('negative_sums', 'negative_sums')
    finally:
        source.write_text(text)
    machine_code._source.cache_clear()
    assert is_kept('scaled_sums', 'scaled_sums')


def test_where_no_file_can_be_written_the_function_works_with_a_warning(
        kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('STEWART_DYNAMICS_CACHE_DIR', str(file_of(kept) / 'within'))
    with pytest.warns(RuntimeWarning, match=(
            r'^the compiled dynamics cannot be kept on disk \(Not a directory\): every start takes'
            ' seconds; let STEWART_DYNAMICS_CACHE_DIR name a folder that can be written to$')):
        check(imported('scaled_sums'))


def test_a_read_only_installation_is_used_and_the_users_cache_for_what_it_lacks(
        kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv('STEWART_DYNAMICS_CACHE_DIR')
    installed = tmp_path / 'installed'
    (installed / '__pycache__').parent.mkdir()
    kept.rename(installed / '__pycache__')
    file_of(installed / '__pycache__', 'negative_sums').unlink()
    (installed / 'compilation').symlink_to(Path(machine_code.__file__).parent)
    monkeypatch.setattr(machine_code, '_PACKAGE', installed)
    monkeypatch.setattr(os, 'access', lambda path, mode: installed not in path.parents)
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'cache'))
    assert imported('scaled_sums').load()
    check(imported('negative_sums'), -1.0)
    assert file_of(tmp_path / 'cache' / 'installed', 'negative_sums').exists()


def test_two_processes_that_start_on_an_empty_cache_both_work(
        kept: Path, folder: Path, announced: list[str]) -> None:
    file_of(kept).unlink()
    functions = [imported('scaled_sums') for _ in range(2)]
    threads = [Thread(target=function.prepare) for function in functions]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(announced) == 2
    for function in functions:
        check(function)
    assert len(list(kept.iterdir())) == 2


def test_a_function_that_does_not_compile_runs_uncompiled_with_a_warning(
        kept: Path, folder: Path) -> None:
    (folder / 'dictionary.py').write_text("""\
from stewart_dynamics.compilation.functions import entry_point

@entry_point('f8[::1]')
def dictionary(numbers):
    numbers[0] = {0: 'a', 'b': 3.0}['b']
""")
    numbers = np.zeros(1)
    with pytest.warns(RuntimeWarning, match=(
            r'^dictionary\.dictionary cannot be compiled: .*: the dynamics run uncompiled')):
        imported('dictionary')(numbers)
    assert numbers[0] == 3.0


def test_where_no_temporary_file_can_be_written_it_runs_uncompiled_with_a_warning(
        kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a full disk; the warning is raised where the functions are used, not in a thread."""
    file_of(kept).unlink()
    monkeypatch.setattr(tempfile, 'tempdir', '/nowhere')
    function = imported('scaled_sums')
    with pytest.warns(RuntimeWarning, match='cannot be compiled: .*No such file.*run uncompiled'):
        prepare([function])
    check(function)


@pytest.mark.parametrize('python', ['/bin/true', '/bin/false', '/nowhere', '', None])
def test_a_program_that_is_no_python_compiles_nothing(
        kept: Path, monkeypatch: pytest.MonkeyPatch, python: Any) -> None:
    file_of(kept).unlink()
    monkeypatch.setattr(sys, 'executable', python)
    with pytest.warns(RuntimeWarning, match='cannot be compiled: .*: the dynamics run uncompiled'):
        check(imported('scaled_sums'))
    assert not list(kept.glob('scaled_sums*'))


def test_the_compiler_reads_nothing_from_the_present_folder_and_may_print(
        kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file_of(kept).unlink()
    for name in ('numba', 'numbers', 'json', 'scaled_sums', 'stewart_dynamics'):
        (tmp_path / f'{name}.py').write_text("raise SystemExit('this is another one')")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('NUMBA_DUMP_ASSEMBLY', '1')
    function = imported('scaled_sums')
    check(function)
    assert function.compiled
    assert is_kept('scaled_sums', 'scaled_sums')


@pytest.mark.parametrize('wrong', [
    pytest.param(np.zeros((3, 4), dtype=np.float32), id='another type'),
    pytest.param(np.zeros((4, 3)).T, id='columns first'),
    pytest.param(np.zeros(12), id='another dimension'),
    pytest.param(np.zeros((3, 8))[:, ::2], id='gaps')])
def test_an_array_of_another_layout_is_an_error(kept: Path, wrong: Any) -> None:
    with pytest.raises(TypeError, match=r'^scaled_sums\.scaled_sums: an array of '):
        imported('scaled_sums')(wrong, 1.0, 0, False, np.empty(3))


def test_what_is_needed_later_is_compiled_in_the_background(
        kept: Path, announced: list[str]) -> None:
    assert Preparation(imported('scaled_sums')).ready
    file_of(kept).unlink()
    functions = [imported(name) for name in SIGNS]
    preparation = Preparation(*functions)
    assert not preparation.ready
    assert announced == []
    preparation.begin()
    preparation.begin()
    assert preparation._thread is not None
    preparation._thread.join()
    assert preparation.ready
    assert len(announced) == 1
    check(functions[0])


def test_without_a_compiler_a_function_is_plain_python() -> None:
    code = (f'import sys; sys.path.insert(0, {str(ROOT / "test")!r})\n'
            'from test_machine_code import check, plain_sums; check(plain_sums)')
    subprocess.run([sys.executable, '-c', code], check=True,
                   env={**os.environ, 'NUMBA_DISABLE_JIT': '1'})


@marked('f8[:,::1]', 'f8', 'i8', 'b1', 'f8[::1]')
def plain_sums(matrix: Any, factor: float, shift: int, doubled: bool, sums: Any) -> None:
    """Write the sums of the rows."""
    for n in range(len(sums)):
        sums[n] = factor * matrix[n, shift:].sum() * (2.0 if doubled else 1.0)


def test_all_functions_that_are_called_are_compiled_at_installation() -> None:
    from stewart_dynamics.compile_all import MODULES
    package = ROOT / 'stewart_dynamics'
    assert set(MODULES) == {
        '.'.join(path.relative_to(package).with_suffix('').parts)
        for path in package.rglob('*.py') if '@entry_point(' in path.read_text()}
