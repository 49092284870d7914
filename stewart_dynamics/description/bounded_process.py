# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Loaders of other packages in a process of their own, with bounded time and memory.

A file of others can make a loader repeat a body a billion times, read a device or crash.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
import subprocess
import sys
from types import ModuleType

from stewart_dynamics.errors import one_line
from stewart_dynamics.legs.mechanism import DescriptionError, Mechanism

_TIME = 30  # [s]
_WAIT = 4 * _TIME
_MEMORY = 8 << 30  # of addresses; libraries reserve some without using them [bytes]
_LOAD = """
import resource, sys
source, target, time, memory = sys.argv[1:]
for kind, most in ((resource.RLIMIT_CPU, int(time)), (resource.RLIMIT_AS, int(memory))):
    _, hard = resource.getrlimit(kind)
    resource.setrlimit(kind, (most if hard < 0 else min(most, hard), hard))
{imports}
try:
    {load}
except MemoryError:
    sys.exit(2)
except Exception as exc:
    sys.exit(str(exc))
"""
# Begin of the output of an interpreter whose imports fail.
_TRACEBACK = 'Traceback'


def load_in_process(package: str, imports: str, load: str, source: Path, target: Path) -> None:
    """
    Run a loader that reads ``source`` and writes ``target``; warnings go to the target's folder.

    package: its name in errors.
    imports, load: lines of Python, the latter an expression of ``source`` and ``target``.
    Raises DescriptionError: in one line: the loader rejects the file, or exceeds time or memory.
    Raises ImportError: the package is broken or too old.
    """
    try:
        ended = subprocess.run(
            [sys.executable, '-c', _LOAD.format(imports=imports, load=load), source.absolute(),
             target, str(_TIME), str(_MEMORY)],
            cwd=target.parent, stdin=subprocess.DEVNULL, capture_output=True, timeout=_WAIT,
            check=False)
    except subprocess.TimeoutExpired as exc:
        raise DescriptionError(f'{source}: {package}: not loaded within {_WAIT} s') from exc
    why = ended.stderr.decode('utf-8', 'replace')
    if ended.returncode == 1 and why.startswith(_TRACEBACK):
        raise ImportError(why.splitlines()[-1])
    if ended.returncode == 1:
        raise DescriptionError(f'{source}: {package}: {one_line(why)}')
    if ended.returncode:
        raise DescriptionError(
            f'{source}: {package}: not loaded within {_TIME} s of processor time and '
            f'{_MEMORY >> 30} GiB (exit code {ended.returncode})')


def read_with(package: str, module: str, extra: str, source: Path, form: str,
              read: Callable[[ModuleType, Path], Mechanism]) -> Mechanism:
    """
    Return what ``read`` makes of a file with a module of a package, which an extra brings.

    form: the format of the file, in errors.
    Raises DescriptionError: in one line: the package is missing, too old or broken.
    """
    try:
        imported = import_module(module)
    except ModuleNotFoundError as exc:
        raise DescriptionError(f'{source}: {form} is read by {package}: pip install '
                               f"'stewart_dynamics[{extra}]'") from exc
    except Exception as exc:  # a package of parts of several versions fails in any way
        raise _unusable(source, package, extra, form, exc) from exc
    try:
        return read(imported, source)
    except (AttributeError, ImportError) as exc:
        raise _unusable(source, package, extra, form, exc) from exc


def _unusable(source: Path, package: str, extra: str, form: str, exc: Exception,
              ) -> DescriptionError:
    """Return the error about a package that is too old, or broken."""
    try:
        installed = version(package)
    except PackageNotFoundError:
        installed = 'of an unknown version'
    return DescriptionError(
        f'{source}: {form} is read by {package}: the installed package, {installed}, cannot be '
        f"used ({one_line(exc)}): pip install --force-reinstall 'stewart_dynamics[{extra}]'")
