# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Compiles what the package compiles, so that no later start waits: ``stewart_dynamics --compile``.

For the installation of the package, and for containers: the machine code is kept beside it.
"""

from __future__ import annotations

from importlib import import_module
import time

from stewart_dynamics.compilation.functions import EntryPoint, prepare
from stewart_dynamics.compilation.machine_code import folder_to_write, HINT, load, PACKAGE


def modules() -> list[str]:
    """Return the names of the modules with functions that Python calls as machine code."""
    return sorted('.'.join(path.relative_to(PACKAGE.parent).with_suffix('').parts)
                  for path in PACKAGE.rglob('*.py')
                  if '\n@entry_point(' in path.read_text(encoding='utf-8'))


def compile_all() -> int:
    """Compile all functions that are not on disk, print their number, return the exit code."""
    if HINT:
        print(f'stewart_dynamics: nothing is compiled: {HINT}')
        return 1
    begun = time.monotonic()
    names = modules()
    functions = [each for name in names for each in vars(import_module(name)).values()
                 if isinstance(each, EntryPoint)]
    missing = [name for name in names if not load(name)]
    prepare(functions)
    failed = {each.__module__ for each in functions if not each.compiled}
    print(f'stewart_dynamics: {len(names) - len(failed)} modules are compiled, '
          f'{len(missing) - len(failed)} of them now in {time.monotonic() - begun:.0f} s; '
          f'their machine code is in {folder_to_write()}')
    return 1 if failed else 0
