# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Machine code on disk: one file for each module, checked before it is loaded.

A file is used if its digest matches its content, the sources of the modules that it was compiled
from, the versions of numba and llvmlite, and this processor; and if nobody but this user or root
can have written it. Any other file is ignored, and replaced after the compilation.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from functools import cache, partial
from hashlib import sha256
from importlib.util import find_spec
import inspect
import os
from pathlib import Path
import stat
import subprocess
import sys
from tempfile import TemporaryDirectory
from threading import Lock, RLock
from typing import Any
from uuid import uuid4
import warnings

NOT_KEPT = ('the compiled dynamics cannot be kept on disk ({reason}): every start takes seconds; '
            'let STEWART_DYNAMICS_CACHE_DIR name a folder that can be written to')
_UNCOMPILED = ('the dynamics run uncompiled, with the same results but about a thousand times '
               'slower, a millisecond or more for each setpoint')
PACKAGE = Path(__file__).parents[1]
# The compiler optimizes the whole by itself. Users' settings of numba would be kept on disk.
_NUMBA_SETTINGS = {'NUMBA_OPT': '1', 'NUMBA_LOOP_VECTORIZE': '0'}
# numba imports these if they are there; they would take half of the time of a short compilation.
_UNUSED = {'coverage': None, 'scipy': None}
_LARGEST = 1 << 24  # bytes of a file; those of the package have less than 200 kB
_DIGEST_SIZE = 32


def _hint() -> str:
    if os.environ.get('NUMBA_DISABLE_JIT', '0') not in ('', '0'):
        return f'NUMBA_DISABLE_JIT is set: {_UNCOMPILED}'
    if os.name != 'posix':
        return f'the compiler needs a POSIX system: {_UNCOMPILED}'
    if find_spec('numba') is None:
        return f'numba is not installed: {_UNCOMPILED}; pip install numba'
    return ''


HINT = _hint()  # why nothing is compiled, and the consequence; empty where functions are compiled
COMPILED = not HINT

announce: Callable[[str], object] = partial(
    print, 'stewart_dynamics:', file=sys.stderr, flush=True)
"""Called with a line when a compilation begins; a program may put a function of its own here."""

# Machine code in memory by module; None for modules that run uncompiled.
_engines: dict[str, Any] = {}
# One thread at a time uses LLVM, and one compiles a module. A fork waits for LLVM; other threads
# and the locks they hold do not exist in the child.
_llvm = RLock()
_compiling: dict[str, Lock] = defaultdict(Lock)


def _after_fork() -> None:
    _compiling.clear()
    _llvm.release()


if os.name == 'posix':
    os.register_at_fork(
        before=_llvm.acquire, after_in_parent=_llvm.release, after_in_child=_after_fork)


def address(module: str, name: str) -> int:
    """Return where a function of a prepared module is in memory; 0 if it runs uncompiled."""
    engine = _engines.get(module)
    return engine.get_function_address(f'{module}.{name}') if engine else 0


def prepared(module: str) -> bool:
    """Return whether a module's functions can be called without a wait."""
    return not COMPILED or module in _engines


def load(module: str) -> bool:
    """Load a module's machine code from the disk; return False if it must be compiled first."""
    return prepared(module) or any(
        _load(module, code) for folder in _folders() if (code := _kept(folder, module)))


def prepare(modules: Iterable[str]) -> None:
    """Load the machine code of modules; compile the missing modules, which takes seconds."""
    wanted = sorted(each for each in set(modules) if not load(each))
    warned = []
    with ExitStack() as locks:
        for module in wanted:  # in the same order in all threads
            locks.enter_context(_compiling[module])
        missing = [each for each in wanted if not load(each)]
        for module in missing:
            announce(f'compiling {module} for this processor: this takes seconds, only this once')
        for module, code, reason in _compiled(missing) if missing else ():
            if code:
                _load(module, code)
                warned.append(_keep(module, code))
            else:
                _engines[module] = None
                warned.append(f'{module} cannot be compiled: {reason}: {_UNCOMPILED}')
    for text in filter(None, warned):  # last: where warnings are errors, they end the call
        warnings.warn(text, RuntimeWarning, stacklevel=2)


def target_machine() -> Any:
    """Return this processor as LLVM's target: the one that is compiled for, and no other."""
    from llvmlite import binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    triple, cpu, features = _processor()
    return llvm.Target.from_triple(triple).create_target_machine(
        cpu, features, opt=3, reloc='static' if triple.startswith('x86') else 'default', jit=True)


def _load(module: str, code: bytes) -> bool:
    """Load an object file, and return True."""
    def engine() -> Any:
        from llvmlite import binding as llvm

        with _llvm:
            engine = llvm.create_mcjit_compiler(llvm.parse_assembly(''), target_machine())
            engine.add_object_file(llvm.ObjectFileRef.from_data(code.partition(b'\n')[2]))
            engine.finalize_object()
            return engine

    # In a thread: signal handlers raise in the main thread, and would leave llvmlite's objects
    # half made. The first stays: threads that loaded it at the same time may call it already.
    _engines.setdefault(module, ThreadPoolExecutor(1).submit(engine).result())
    return True


def _compiled(modules: Sequence[str]) -> Iterator[tuple[str, bytes, str]]:
    """Yield modules, their code as the compiler answers it, and if there is no code the reason."""
    # The compiler reads this copy of the package, whatever the present folder is.
    paths = [str(PACKAGE.parent), *(os.path.abspath(path) for path in sys.path if path)]
    settings = {name: text for name, text in os.environ.items() if name[:6] != 'NUMBA_'}
    codes, reasons = dict[str, bytes](), dict[str, str]()
    reason = 'the compiler has ended without an answer'
    try:
        # The largest source first, so that all processes end at about the same time.
        order = sorted(modules, key=lambda each: -len(inspect.getsource(sys.modules[each])))
        with TemporaryDirectory() as folder, ExitStack() as stack:
            programs = []
            for _ in order[:os.cpu_count()]:
                # In a session of its own, so that signals of the terminal do not reach it.
                programs.append(program := subprocess.Popen(
                    [sys.executable, '-I', '-S', '-c', f'import sys; sys.path = {paths!r}; '
                     f'sys.modules.update({_UNUSED!r}); from {__package__}.compiler import main; '
                     f'main{os.getpid(), order, folder!r}'],
                    cwd=folder, env=settings | _NUMBA_SETTINGS, stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, errors='replace',
                    start_new_session=True))
                stack.callback(program.wait)
                stack.callback(program.kill)  # first: where a signal handler has raised
            for program in programs:
                reason = program.communicate()[1].strip().rpartition('\n')[2] or reason
            codes = {each.stem: each.read_bytes() for each in Path(folder).glob('*.code')}
            reasons = {each.stem: each.read_text() for each in Path(folder).glob('*.error')}
    except (OSError, TypeError) as exc:  # TypeError: Python does not know where it is
        reason = str(exc)
    for module in modules:
        yield module, codes.get(module, b''), reasons.get(module, reason)


# -- files ----------------------------------------------------------------------------------------

def _folders() -> Iterator[Path]:
    """Yield the folders for machine code: in the package, and in the user's cache."""
    if named := os.environ.get('STEWART_DYNAMICS_CACHE_DIR'):
        yield Path(named)
        return
    yield PACKAGE / '__pycache__'
    with suppress(RuntimeError):  # there is no home
        yield Path(os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache') / PACKAGE.name


def _check_writers(status: os.stat_result) -> None:
    """Raise PermissionError if another user than root can have written a file or a folder."""
    if status.st_uid not in (0, os.geteuid()) or status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise PermissionError(1, 'other users can write to it')


def _kept(folder: Path, module: str) -> bytes:
    """Return the code of a module on disk; empty if it is missing or not to be used."""
    try:
        _check_writers(folder.stat())
        # Neither the opening of a pipe nor a link to a device may block.
        with open(folder / _file_name(module), 'rb', opener=lambda name, flags: os.open(
                name, flags | os.O_NOFOLLOW | os.O_NONBLOCK)) as file:
            _check_writers(status := os.fstat(file.fileno()))
            content = file.read(_LARGEST) if stat.S_ISREG(status.st_mode) else b''
    except OSError:
        return b''
    code = content[_DIGEST_SIZE:]
    return code if content[:_DIGEST_SIZE] == _digest(module, code) else b''


def folder_to_write() -> Path:
    """Return the first folder for machine code that is ours to write to, or else the last."""
    folder = Path()
    for folder in _folders():
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True, mode=0o755)
            _check_writers(folder.stat())
            if os.access(folder, os.W_OK):
                break
    return folder


def _keep(module: str, code: bytes) -> str:
    """Write the code of a module; return why that is not possible, or nothing."""
    path = folder_to_write() / _file_name(module)
    # Renamed when it is complete: other processes read and write the same file.
    new = path.with_name(f'{path.name}.tmp.{uuid4().hex[:16]}')
    try:
        _check_writers(path.parent.stat())
        with open(new, 'xb', opener=lambda name, flags: os.open(name, flags, 0o644)) as file:
            file.write(_digest(module, code) + code)
        new.replace(path)
    except OSError as exc:
        with suppress(OSError):
            new.unlink(missing_ok=True)
        return NOT_KEPT.format(reason=exc.strerror)
    return ''


def _file_name(module: str) -> str:
    return f'{module}.{sha256(repr(_processor()).encode()).hexdigest()[:16]}.code'


def _digest(module: str, code: bytes) -> bytes:
    """Return the digest of code and of all that it depends on."""
    versions = [version_of(name) for name in ('numba', 'llvmlite')]
    digest = sha256(repr((module, versions, _processor())).encode() + code)
    for path in code.partition(b'\n')[0].decode(errors='replace').split('\t'):
        digest.update(_source(path))
    return digest.digest()


@cache
def version_of(library: str) -> str:
    """
    Return a library's version, by the names of the folders of its metadata; empty without one.

    ``importlib.metadata`` takes 20 ms, a fifth of the time by which the node starts later than a
    bare one.
    """
    found = find_spec(library)
    places = found.submodule_search_locations or () if found else ()
    names = sorted(each.name for place in places
                   for each in Path(place).parent.glob(f'{library}-*-info'))
    return ' '.join(name.removeprefix(f'{library}-') for name in names)


@cache
def _source(path: str) -> bytes:
    """Return the digest of a source file, its path relative to the package; empty if missing."""
    with suppress(OSError, ValueError):
        return sha256((PACKAGE / path).read_bytes()).digest()
    return b''


@cache
def _processor() -> tuple[str, str, str]:
    from llvmlite import binding as llvm

    return (llvm.get_process_triple(), llvm.get_host_cpu_name(),
            llvm.get_host_cpu_features().flatten())
