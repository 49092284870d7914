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
The program that compiles the entry points of one module; ``machine_code`` starts it.

It writes a file: a line with the source files that it has read, on which the machine code depends,
and an object file. A function is a symbol there, of the type ``void (int64_t *block)``, named by
its module and its own name; ``functions.EntryPoint`` lays out the block. Only C's mathematical
functions are called from there, nothing of Python or numba: no memory is allocated, and a function
that could raise an exception is rejected.
"""

from __future__ import annotations

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
    """Return the object file of a module's entry points, for this processor."""
    entries = [each for each in vars(import_module(module)).values()
               if isinstance(each, EntryPoint) and each.function.__module__ == module]
    for function, inline in (CALLED | {each.function: False for each in entries}).items():
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
            raise SystemExit(f'needs {function.name}, which machine code cannot call')
    return cast('bytes', machine.emit_object(whole))


def _from_block(entry: EntryPoint) -> Callable[[Any], None]:
    """Return the function that takes an entry point's arguments from a block, see its class."""
    place, arguments = 1, []
    for dtype, dimensions in entry.arguments:
        if dimensions:
            shape = ''.join(f'integers[{place + n}], ' for n in range(1, dimensions + 1))
            arguments.append(f'carray(block[{place}], ({shape}), np.{dtype.name})')
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


def main(parent: int, module: str, target: str) -> None:
    """Compile a module into a file; end when the parent process ends."""
    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_POLL_SECONDS)
        os._exit(1)

    Thread(target=watch, daemon=True).start()
    gc.disable()  # the process ends soon, and the collector takes a tenth of the time
    code = object_file(module)
    packages = 'stewart_dynamics', module.partition('.')[0]
    paths = '\t'.join(str(each.__file__).removeprefix(f'{PACKAGE}{os.sep}')
                      for name, each in sys.modules.items()
                      if name.partition('.')[0] in packages and each.__file__)
    Path(f'{target}.new').write_bytes(paths.encode() + b'\n' + code)
    Path(f'{target}.new').rename(target)
