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

"""
Machine code on disk: a file for each function, with a digest that is checked before it is loaded.

After a power cut, a disk error or an update, a file that does not match its digest is ignored and
written anew after the compilation. What cannot be written is used all the same, with a
RuntimeWarning.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import suppress
from functools import cache
import hashlib
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
import json
import os
from pathlib import Path
import subprocess
import sys
from tempfile import TemporaryDirectory
from threading import Thread
from typing import Any, TypeVar
from uuid import uuid4
import warnings

NOT_KEPT = ('the compiled dynamics cannot be kept on disk{reason}: every start takes seconds; let '
            'STEWART_DYNAMICS_CACHE_DIR name a folder that can be written to')
_UNCOMPILED = ('the dynamics run uncompiled, with the same results but about a thousand times '
               'slower, a millisecond or more for each setpoint')

Result = TypeVar('Result')

_PACKAGE = Path(__file__).parents[1]
_COMPILER = """
import sys
import json
sys.path, *arguments = json.loads(sys.argv[1])
from stewart_dynamics.compilation.compiler import main
main(*arguments)
"""
_DIGEST = hashlib.sha256
_DIGEST_SIZE = 32


class CompilationError(Exception):
    """The compiler has failed."""


def _hint() -> str:
    if os.environ.get('NUMBA_DISABLE_JIT', '0') not in ('', '0'):
        return f'NUMBA_DISABLE_JIT is set: {_UNCOMPILED}'
    if find_spec('numba') is None:
        return f'numba is not installed: {_UNCOMPILED}; pip install numba'
    return ''


HINT = _hint()
"""Why nothing is compiled, and what that costs; empty where functions are compiled."""
COMPILED = not HINT


def _print(text: str) -> None:
    print(f'stewart_dynamics: {text}', file=sys.stderr, flush=True)


announce: Callable[[str], object] = _print
"""Called with a line when a compilation begins; a program may put a function of its own here."""


def kept_address(module: str, name: str) -> int | None:
    """
    Load the machine code of a function from the disk, and return where it is in memory.

    0 where nothing is compiled; None where it has to be compiled first.
    """
    if not COMPILED:
        return 0

    def loaded() -> int | None:
        for folder in _folders():
            if code := _kept(folder, module, name):
                return _load(code, f'{module}.{name}')
        return None

    return _uninterrupted(loaded)


def _uninterrupted(function: Callable[[], Result]) -> Result:
    """
    Return what a function returns, called in a thread of its own.

    What a handler of signals raises comes in the main thread: within llvmlite it would leave
    objects half made, which Python reports when it deletes them.
    """
    result: Future[Result] = Future()

    def call() -> None:
        try:
            result.set_result(function())
        except BaseException as exc:
            result.set_exception(exc)

    Thread(target=call, daemon=True).start()
    return result.result()


def compiled_address(module: str, name: str) -> int:
    """Compile a function, and return where it is in memory; 0 where that is not possible."""
    announce(f'compiling {module}.{name} for this processor: this takes seconds, only this once')
    try:
        answer = _compile(module, name)
    except CompilationError as exc:
        warnings.warn(f'{exc}: {_UNCOMPILED}', RuntimeWarning, stacklevel=2)
        return 0
    address = _uninterrupted(lambda: _load(answer, f'{module}.{name}'))
    _keep(module, name, answer)
    return address


def _compile(module: str, name: str) -> bytes:
    """Return what the compiler writes: the modules it has read, and the object file."""
    # The compiler reads this copy of the package, whatever the present folder is.
    paths = [str(_PACKAGE.parent), *(os.path.abspath(path) for path in sys.path if path)]
    said = ''
    try:
        with TemporaryDirectory() as folder:
            target = Path(folder, 'answer')
            arguments = json.dumps([paths, os.getpid(), module, name, str(target)])
            # In a session of its own: what a terminal sends to this process is not for it. What it
            # prints is not its answer: numba and the start of Python can be told to print.
            done = subprocess.run(
                [sys.executable, '-I', '-c', _COMPILER, arguments], stdin=subprocess.DEVNULL,
                capture_output=True, check=False, start_new_session=True)
            said = done.stderr.decode(errors='replace').strip().rpartition('\n')[2]
            return target.read_bytes()
    except (OSError, TypeError) as exc:  # TypeError: Python does not know where it is
        raise CompilationError(f'{module}.{name} cannot be compiled: {said or exc}') from exc


def _load(answer: bytes, symbol: str) -> int:
    """Return where the function of an object file is in memory."""
    from llvmlite import binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_default_triple().create_target_machine(jit=True)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(''), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_data(answer.partition(b'\n')[2]))
    engine.finalize_object()
    _ENGINES.append(engine)
    return int(engine.get_function_address(symbol))


# They own the memory.
_ENGINES: list[Any] = []


# -- files ----------------------------------------------------------------------------------------

def _folders() -> Iterator[Path]:
    """Yield where machine code may be: in the package, and in the user's cache."""
    if named := os.environ.get('STEWART_DYNAMICS_CACHE_DIR'):
        yield Path(named)
        return
    yield _PACKAGE / '__pycache__'
    with suppress(RuntimeError):  # there is no home
        yield Path(os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache') / _PACKAGE.name


def _kept(folder: Path, module: str, name: str) -> bytes:
    """Return what was kept of a function; empty where it is missing or does not match."""
    try:
        content = (folder / _file_name(module, name)).read_bytes()
    except OSError:
        return b''
    answer = content[_DIGEST_SIZE:]
    return answer if content[:_DIGEST_SIZE] == _digest(module, name, answer) else b''


def folder_to_write() -> Path:
    """Return the first folder for machine code that can be written to, or else the last."""
    folder = Path()
    for folder in _folders():
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            break
    return folder


def _keep(module: str, name: str, answer: bytes) -> None:
    """Write what the compiler gave; RuntimeWarning where that is not possible."""
    path = folder_to_write() / _file_name(module, name)
    # Renamed when it is complete: other processes read and write the same file.
    new = path.with_name(f'{path.name}.tmp.{uuid4().hex[:16]}')
    try:
        new.write_bytes(_digest(module, name, answer) + answer)
        new.replace(path)
    except OSError as exc:
        with suppress(OSError):
            new.unlink(missing_ok=True)
        warnings.warn(NOT_KEPT.format(reason=f' ({exc.strerror})'), RuntimeWarning, stacklevel=2)


def _file_name(module: str, name: str) -> str:
    return f'{module}.{name}.{_DIGEST(_processor()).hexdigest()[:16]}.code'


def _digest(module: str, name: str, answer: bytes) -> bytes:
    """Return the digest of code and of everything on which it depends."""
    digest = _DIGEST(f'{module}.{name} {_versions()}'.encode() + _processor() + answer)
    for each in answer.partition(b'\n')[0].decode(errors='replace').split():
        digest.update(_source(each))
    return digest.digest()


@cache
def _source(module: str) -> bytes:
    """Return the digest of a module's source; empty where there is none."""
    path = _PACKAGE.joinpath(*module.split('.')[1:])
    files = [path.with_suffix('.py'), path / '__init__.py']
    if loaded := getattr(sys.modules.get(module), '__file__', None):
        files.insert(0, Path(loaded))
    for file in files:
        with suppress(OSError, ValueError):
            return _DIGEST(file.read_bytes()).digest()
    return b''


@cache
def _processor() -> bytes:
    from llvmlite import binding as llvm

    features = llvm.get_host_cpu_features()
    return f'{llvm.get_process_triple()} {llvm.get_host_cpu_name()} {features.flatten()}'.encode()


@cache
def _versions() -> str:
    def of(name: str) -> str:
        try:
            return version(name)
        except PackageNotFoundError:
            return ''

    return f'{of("numba")} {of("llvmlite")}'
