# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The program that compiles the entry points of modules; ``machine_code`` starts it.

It writes a file for each module: a line with the source files that the machine code depends on,
and an object file. A function is a symbol there, of the type ``void (int64_t *block)``, named by
its module and its own name; ``functions.EntryPoint`` lays out the block. Only C's mathematical
functions are called from there, nothing of Python or numba: no memory is allocated, and a function
that could raise an exception is rejected.
"""

from __future__ import annotations

import ast
from collections.abc import Callable
import gc
from importlib import import_module
import math
import os
from pathlib import Path
import sys
from threading import Thread
import time
from typing import Any, cast

from llvmlite import binding as llvm
import numba
from numba.extending import register_jitable
import numpy as np

from stewart_dynamics.compilation.functions import CALLED, EntryPoint
from stewart_dynamics.compilation.machine_code import PACKAGE, target_machine

_POLL_SECONDS = 0.2

_numba: Any = numba  # it has no types
_SIGNATURE = 'void(CPointer(voidptr))'


def object_file(module: str) -> bytes:
    """
    Return the object file of a module's entry points, for this processor.

    Functions that an earlier module has called already are not compiled again.
    """
    entries = [each for each in vars(import_module(module)).values()
               if isinstance(each, EntryPoint) and each.function.__module__ == module]
    CALLED.update((each.function, False) for each in entries)
    while CALLED:
        function, inline = CALLED.popitem()
        # error_model 'numpy': a division by zero gives inf or nan; an exception would be a branch
        # that keeps a loop from becoming vector code.
        register_jitable(error_model='numpy', forceinline=inline, no_cfunc_wrapper=True,
                         _nrt=False)(function)
    machine = target_machine()
    whole = llvm.parse_assembly('')
    for entry in entries:
        callback = _numba.cfunc(_SIGNATURE, error_model='numpy')(_from_block(entry))
        part = llvm.parse_assembly(callback.inspect_llvm())
        part.get_function(callback.native_name).name = f'{module}.{entry.function.__name__}'
        whole.link_in(part)
    for function in whole.functions:
        if not function.is_declaration and not function.name.startswith(f'{module}.'):
            function.linkage = 'internal'
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    options.loop_vectorization = True
    passes = llvm.create_pass_builder(machine, options)
    passes.getModulePassManager().run(whole, passes)
    for function in whole.functions:
        if function.is_declaration and not function.name.startswith('llvm.') and not hasattr(
                math, function.name):
            raise TypeError(f'needs {function.name}, which machine code cannot call')
    return cast('bytes', machine.emit_object(whole))


def _from_block(entry: EntryPoint) -> Callable[[Any], None]:
    """Return the function that takes an entry point's arguments from a block, see its class."""
    place, arguments = 1, []
    for dtype, dimensions in entry.arguments:
        if dimensions:
            shape = ''.join(f'integers[{place + n}], ' for n in range(1, dimensions + 1))
            arguments.append(f'carray(block[{place}], ({shape}), np.{dtype.type.__name__})')
        else:
            arguments.append({'f': f'floats[{place}]', 'i': f'integers[{place}]',
                              'b': f'integers[{place}] != 0'}[dtype.kind])
        place += 1 + dimensions
    names = {'carray': _numba.carray, 'np': np, 'function': entry.function}
    exec(f"""
def from_block(block):
    integers = carray(block[0], ({place},), np.int64)
    floats = carray(block[0], ({place},), np.float64)
    function({", ".join(arguments)})
""", names)
    return cast('Callable[[Any], None]', names['from_block'])


def _add_sources(module: str, found: dict[str, str]) -> None:
    """Add the source files of a module and of all that it imports from the same packages."""
    file = getattr(sys.modules.get(module), '__file__', None)
    if not file or module in found:
        return
    found[module] = file.removeprefix(f'{PACKAGE}{os.sep}')
    names = [module.rpartition('.')[0]]
    for node in ast.parse(Path(file).read_bytes()).body:
        if isinstance(node, ast.Import):
            names += (each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names += (node.module, *(f'{node.module}.{each.name}' for each in node.names))
    for name in names:
        if name.partition('.')[0] in ('stewart_dynamics', module.partition('.')[0]):
            _add_sources(name, found)


def main(parent: int, modules: list[str], folder: str) -> None:
    """Compile modules into files, several processes beside one another; end with the parent."""
    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_POLL_SECONDS)
        os._exit(1)

    Thread(target=watch, daemon=True).start()
    gc.disable()  # the process ends soon, and the collector takes a tenth of the time
    for module in modules:
        try:
            Path(folder, module).touch(exist_ok=False)
        except FileExistsError:
            continue  # another process compiles it
        try:
            code = object_file(module)
            sources: dict[str, str] = {}
            _add_sources(__name__, sources)
            _add_sources(module, sources)
            new = Path(folder, f'{module}.new')
            new.write_bytes('\t'.join(sources.values()).encode() + b'\n' + code)
            new.rename(new.with_suffix('.code'))
        except Exception as exc:
            reason = str(exc).strip().rpartition('\n')[2]
            Path(folder, f'{module}.error').write_text(reason)
