# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Machine code on disk: only sound files are loaded, all others are ignored and replaced."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
from threading import Event, Thread
import time
from typing import Any

import numpy as np
import pytest
from referees import ROOT

from stewart_dynamics.compilation import machine_code
from stewart_dynamics.compilation.functions import (
    entry_point, EntryPoint, Preparation, prepare)
from stewart_dynamics.compilation.machine_code import COMPILED
from stewart_dynamics.compile_all import compile_all, modules

pytestmark = pytest.mark.skipif(not COMPILED, reason='nothing is compiled here')

SOURCE = """\
from stewart_dynamics.compilation.functions import entry_point

@entry_point('f8[:,::1]', 'f8', 'i8', 'b1', 'f8[::1]')
def {name}(matrix, factor, shift, doubled, sums):
    for n in range(len(sums)):
        sums[n] = {sign} * factor * matrix[n, shift:].sum() * (2.0 if doubled else 1.0)

@entry_point('f8[::1]', 'i8')
def chosen(numbers, n):
    numbers[0] = 2.0 * n
"""
UNSUITABLE = """\
import numpy as np
from stewart_dynamics.compilation.functions import entry_point

@entry_point('f8[::1]')
def unsuitable(numbers):
    {}
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
        prepare([imported(name) for name in SIGNS])
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
    """Return the lines that are announced in the test."""
    texts: list[str] = []
    monkeypatch.setattr(machine_code, 'announce', texts.append)
    return texts


def is_kept(module: str) -> bool:
    """Return whether the machine code of a module is on disk and may be used."""
    return any(machine_code._kept(folder, module) for folder in machine_code._folders())


def imported(name: str) -> EntryPoint:
    """Return the function of a module, imported anew."""
    sys.modules.pop(name, None)
    machine_code._engines.pop(name, None)
    function: EntryPoint = getattr(__import__(name), name)
    return function


def file_of(kept: Path, name: str = 'scaled_sums') -> Path:
    """Return the file of a module."""
    file, = kept.glob(f'{name}.*.code')
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
    assert is_kept('scaled_sums')
    check(imported('scaled_sums'))
    check(imported('negative_sums'), -1.0)
    assert announced == []


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
    assert not is_kept('scaled_sums')
    imported('scaled_sums')
    assert not machine_code.load('scaled_sums')


def test_a_flipped_bit_anywhere_and_the_file_of_another_module_are_found(kept: Path) -> None:
    file = file_of(kept)
    whole = file.read_bytes()
    for place in np.random.default_rng(7).integers(0, 8 * len(whole), 200):
        flipped = bytearray(whole)
        flipped[place // 8] ^= 1 << (place % 8)
        file.write_bytes(flipped)
        assert not is_kept('scaled_sums'), f'bit {place}'
    file.write_bytes(file_of(kept, 'negative_sums').read_bytes())
    assert not is_kept('scaled_sums'), 'the file of another module'


def test_a_damaged_file_is_replaced(kept: Path, announced: list[str]) -> None:
    file = file_of(kept)
    whole = file.read_bytes()
    file.write_bytes(whole[:-1])
    check(imported('scaled_sums'))
    assert announced == ['compiling scaled_sums for this processor: this takes '
                         'seconds, only this once']
    assert file.read_bytes() == whole
    assert len(list(kept.iterdir())) == 2


def test_a_changed_source_is_compiled_anew(kept: Path, folder: Path) -> None:
    source = folder / 'scaled_sums.py'
    text = source.read_text()
    try:
        source.write_text(text.replace('1.0 * factor', '1.5 * factor'))
        machine_code._source.cache_clear()
        assert not is_kept('scaled_sums')
        assert is_kept('negative_sums')
    finally:
        source.write_text(text)
    machine_code._source.cache_clear()
    assert is_kept('scaled_sums')


def test_modules_compiled_by_one_process_depend_on_their_own_sources_only(
        kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A module that does not compile leaves the others compiled."""
    monkeypatch.setattr(os, 'cpu_count', lambda: 1)
    monkeypatch.syspath_prepend(str(tmp_path))
    for name in SIGNS:
        file_of(kept, name).unlink()
    (tmp_path / 'unsuitable.py').write_text(UNSUITABLE.format('numbers[0] = sorted(3.0)'))
    functions = [imported(name) for name in ('unsuitable', *SIGNS)]
    with pytest.warns(RuntimeWarning, match='^unsuitable cannot be compiled: '):
        prepare(functions)
    assert [each.compiled for each in functions] == [False, True, True]
    sources = [file_of(kept, name).read_bytes()[32:].partition(b'\n')[0] for name in SIGNS]
    assert [b'/scaled_sums.py' in each for each in sources] == [True, False]
    assert [b'/negative_sums.py' in each for each in sources] == [False, True]
    assert all(b'compilation/compiler.py' in each for each in sources)


def test_if_no_file_can_be_written_the_function_works_with_a_warning(
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
    installed.mkdir()
    for path in machine_code.PACKAGE.iterdir():
        if path.name != '__pycache__':
            (installed / path.name).symlink_to(path)
    kept.rename(installed / '__pycache__')
    file_of(installed / '__pycache__', 'negative_sums').unlink()
    monkeypatch.setattr(machine_code, 'PACKAGE', installed)
    monkeypatch.setattr(os, 'access', lambda path, mode: installed not in path.parents)
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'cache'))
    imported('scaled_sums')
    assert machine_code.load('scaled_sums')
    check(imported('negative_sums'), -1.0)
    assert file_of(tmp_path / 'cache' / 'installed', 'negative_sums').exists()


def test_a_module_is_compiled_once_for_all_its_functions_and_threads(
        kept: Path, announced: list[str]) -> None:
    file_of(kept).unlink()
    functions = [imported('scaled_sums'), vars(sys.modules['scaled_sums'])['chosen']]
    threads = [Thread(target=prepare, args=[functions]) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    check(functions[0])
    assert functions[1].compiled
    assert len(announced) == 1
    assert len(list(kept.iterdir())) == 2


def test_two_processes_that_start_on_an_empty_cache_both_work(kept: Path, folder: Path) -> None:
    file_of(kept).unlink()
    code = (f'import sys; sys.path[:0] = {[str(folder), str(ROOT / "test")]!r}\n'
            'from test_machine_code import check, imported\n'
            "check(imported('scaled_sums')); assert imported('scaled_sums').compiled")
    programs = [subprocess.Popen([sys.executable, '-c', code]) for _ in range(2)]
    assert [program.wait() for program in programs] == [0, 0]
    assert len(list(kept.iterdir())) == 2


@pytest.mark.parametrize(('statement', 'result'), [
    pytest.param('numbers[:] = np.sort(np.zeros(len(numbers)) + 1.0)', 1.0, id='calls numba'),
    pytest.param('numbers[:] = (1.0, 2.0)[len(numbers) - 2]', 2.0, id='may raise'),
    pytest.param("numbers[:] = {0: 'a', 'b': 3.0}['b']", 3.0, id='does not compile')])
def test_a_function_that_cannot_be_machine_code_alone_runs_uncompiled_with_a_warning(
        kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, statement: str,
        result: float) -> None:
    """The loader of another process does not find such functions, and would end the program."""
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / 'unsuitable.py').write_text(UNSUITABLE.format(statement))
    numbers = np.zeros(3)
    with pytest.warns(RuntimeWarning, match=(
            r'^unsuitable cannot be compiled: .*: the dynamics run uncompiled')):
        imported('unsuitable')(numbers)
    assert numbers.tolist() == [result] * 3
    assert not list(kept.glob('unsuitable*'))


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


def test_all_modules_of_the_package_are_compiled(capsys: pytest.CaptureFixture[str]) -> None:
    """Whatever versions of numba and LLVM are installed."""
    assert compile_all() == 0
    assert f' {len(modules())} modules are compiled, ' in capsys.readouterr().out


def test_modules_that_cannot_be_compiled_are_not_counted(tmp_path: Path) -> None:
    failed = subprocess.run(
        [sys.executable, '-c', "import sys; sys.executable = '/bin/false'\n"
         'from stewart_dynamics.compile_all import compile_all; sys.exit(compile_all())'],
        env=os.environ | {'STEWART_DYNAMICS_CACHE_DIR': str(tmp_path)}, stdin=subprocess.DEVNULL,
        capture_output=True, text=True)
    assert failed.returncode == 1
    assert ' 0 modules are compiled, 0 of them now ' in failed.stdout


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
    assert is_kept('scaled_sums')


@pytest.mark.parametrize('wrong', [
    pytest.param(np.zeros((3, 4), dtype=np.float32), id='another type'),
    pytest.param(np.zeros((4, 3)).T, id='columns first'),
    pytest.param(np.zeros(12), id='another dimension'),
    pytest.param(np.zeros((3, 8))[:, ::2], id='gaps')])
def test_an_array_of_another_layout_is_an_error(kept: Path, wrong: Any) -> None:
    with pytest.raises(TypeError, match=r'^scaled_sums\.scaled_sums: an array of '):
        imported('scaled_sums')(wrong, 1.0, 0, False, np.empty(3))


def test_preparation_compiles_in_the_background(kept: Path, announced: list[str]) -> None:
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


@entry_point('f8[:,::1]', 'f8', 'i8', 'b1', 'f8[::1]')
def plain_sums(matrix: Any, factor: float, shift: int, doubled: bool, sums: Any) -> None:
    """Write the sums of the rows."""
    for n in range(len(sums)):
        sums[n] = factor * matrix[n, shift:].sum() * (2.0 if doubled else 1.0)


def test_the_code_is_for_this_processor_whatever_numba_is_told(
        kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Code for another processor, kept under this one's name, would end later starts."""
    file = file_of(kept)
    whole = file.read_bytes()
    for name, text in (('CPU_NAME', 'skylake-avx512'), ('CPU_FEATURES', '+avx512f,+avx512vl'),
                       ('OPT', '0'), ('BOUNDSCHECK', '1'), ('DEBUGINFO', '1')):
        monkeypatch.setenv(f'NUMBA_{name}', text)
    (tmp_path / '.numba_config.yaml').write_text('opt: 0\ncpu_name: skylake-avx512\n')
    monkeypatch.chdir(tmp_path)
    file.unlink()
    check(imported('scaled_sums'))
    assert file.read_bytes() == whole


@pytest.mark.parametrize('mode', [0o775, 0o757])
@pytest.mark.parametrize('whose', ['file', 'folder'])
def test_code_that_others_can_write_is_not_run(kept: Path, whose: str, mode: int) -> None:
    assert is_kept('scaled_sums')
    (file_of(kept) if whose == 'file' else kept).chmod(mode)
    assert not is_kept('scaled_sums')
    if whose == 'folder':
        with pytest.warns(RuntimeWarning, match='on disk .other users can write to it.: every'):
            check(imported('scaled_sums'))


@pytest.mark.parametrize('whose', ['file', 'folder'])
def test_code_of_another_user_is_not_run(kept: Path, whose: str) -> None:
    path = file_of(kept) if whose == 'file' else kept
    try:
        os.chown(path, 12345, -1)
    except PermissionError:
        pytest.skip('only root can give files to others')
    assert not is_kept('scaled_sums')


def test_kept_code_can_be_written_by_its_user_only_whatever_the_umask(
        kept: Path, announced: list[str]) -> None:
    file_of(kept).unlink()
    before = os.umask(0)
    try:
        check(imported('scaled_sums'))
    finally:
        os.umask(before)
    assert file_of(kept).stat().st_mode & 0o777 == 0o644


@pytest.mark.parametrize('kind', ['pipe', 'link to a device', 'sparse file', 'folder', 'link'])
def test_what_is_no_file_of_ours_neither_blocks_nor_fails(kept: Path, kind: str) -> None:
    file = file_of(kept)
    file.rename(kept / 'other')
    if kind == 'pipe':
        os.mkfifo(file)
    elif kind == 'link to a device':
        file.symlink_to('/dev/zero')
    elif kind == 'link':
        file.symlink_to('other')
    elif kind == 'folder':
        file.mkdir()
    else:
        with open(file, 'wb') as sparse:
            sparse.truncate(20 << 30)
    assert not is_kept('scaled_sums')


def test_a_module_that_two_threads_load_stays_where_it_is(kept: Path) -> None:
    function = imported('scaled_sums')
    assert machine_code.load('scaled_sums')
    check(function)
    engine = machine_code._engines['scaled_sums']
    machine_code._load('scaled_sums', machine_code._kept(kept, 'scaled_sums'))
    assert machine_code._engines['scaled_sums'] is engine


def test_a_fork_while_threads_load_code_does_not_hang(
        kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    loading = Event()
    target_machine = machine_code.target_machine

    def slowly() -> Any:
        loading.set()
        time.sleep(0.3)
        return target_machine()

    monkeypatch.setattr(machine_code, 'target_machine', slowly)
    function = imported('scaled_sums')
    thread = Thread(target=prepare, args=[[function]])
    thread.start()
    assert loading.wait(60.0)
    monkeypatch.setattr(machine_code, 'target_machine', target_machine)
    child = os.fork()
    if not child:
        signal.alarm(20)  # a child that hangs ends
        try:
            check(function)
            check(imported('negative_sums'), -1.0)
        except BaseException:
            os._exit(1)
        os._exit(0)
    thread.join()
    assert os.waitpid(child, 0)[1] == 0
    check(function)
