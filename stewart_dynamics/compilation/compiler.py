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
The program that compiles one function; ``machine_code`` starts it.

It writes a file: a line with the modules that it has read, on which the machine code depends, and
an object file with one symbol, named as the function, of the type ``int (const int64_t
*arguments)``. The arguments are integers: those of the function as they are, floats by their bits,
an array as the address of its data and its shape. No memory is allocated, and nothing of Python or
numba is called.
"""

from __future__ import annotations

import gc
from importlib import import_module
import os
from pathlib import Path
import sys
from threading import Thread
import time
from typing import Any, cast

from llvmlite import ir
import numba
from numba.core import codegen, cpu, sigutils, types as numba_types
from numba.core.compiler_lock import global_compiler_lock
from numba.np import arrayobj

from stewart_dynamics.compilation import functions

# What is used of numba here has no types, or others.
_numba: Any = numba
_sigutils: Any = sigutils
_arrayobj: Any = arrayobj
_library_class: Any = codegen.JITCodeLibrary
_context_class: Any = cpu.CPUContext

_INTEGER = ir.IntType(64)
_LOOK = 0.2  # [s]


# Machine code is made of the whole alone, by _object_file, not of each function that it calls.
_library_class._finalize_specific = lambda library: None
_context_class.get_executable = lambda *_: [].append  # a builtin function, each time another


def _njit(function: Any, **options: Any) -> Any:
    # error_model 'numpy': a division by zero gives inf or nan and no exception, which would be a
    # branch that keeps a loop from becoming vector code. No wrappers that only Python calls, and
    # without _nrt nothing can allocate memory.
    dispatcher = _numba.njit(
        error_model='numpy', no_cpython_wrapper=True, no_cfunc_wrapper=True, _nrt=False,
        **options)(function)
    template = dispatcher.get_call_template
    # Of a function that is called with 0 .. 5, numba would make six.
    dispatcher.get_call_template = lambda types, named: template(
        tuple(map(numba_types.unliteral, types)), named)
    return dispatcher


def object_file(module: str, name: str) -> bytes:
    """Return the object file of a function, for this processor."""
    functions.use_compiler(_njit)
    dispatcher = getattr(import_module(module), name)
    types = cast('tuple[Any, ...]', _sigutils.normalize_signature(
        f'({", ".join(dispatcher.types)},)')[0])
    # Each function is optimized once, where all it calls is known: in the library of the entry.
    level, _numba.config.OPT = _numba.config.OPT, 0
    dispatcher.compile(types)
    _numba.config.OPT = level
    with global_compiler_lock:
        return _object_file(f'{module}.{name}', dispatcher.overloads[types], types)


def _object_file(symbol: str, compiled: Any, types: tuple[Any, ...]) -> bytes:
    context = compiled.target_context
    library = context.codegen().create_library(symbol)
    library.add_ir_module(_entry(library.create_ir_module(symbol), compiled, context, types))
    library.add_linking_library(compiled.library)
    library.finalize()
    return cast('bytes', context.codegen()._tm.emit_object(library._final_module))


def _entry(module: Any, compiled: Any, context: Any, types: tuple[Any, ...]) -> Any:
    """Write the function that takes the arguments from memory, and return the module."""
    function = ir.Function(
        module, ir.FunctionType(ir.IntType(32), [_INTEGER.as_pointer()]), module.name)
    builder = ir.IRBuilder(function.append_basic_block())
    given = 0

    def argument() -> Any:
        nonlocal given
        given += 1
        return builder.load(builder.gep(function.args[0], [_INTEGER(given - 1)]))

    values = []
    for kind in types:
        if isinstance(kind, numba_types.Array):
            array = _arrayobj.make_array(kind)(context, builder)
            item = context.get_abi_sizeof(context.get_data_type(kind.dtype))
            data = builder.inttoptr(argument(), context.get_data_type(kind.dtype).as_pointer())
            shape = [argument() for _ in range(kind.ndim)]
            strides = [_INTEGER(item)]
            for length in reversed(shape[1:]):
                strides.insert(0, builder.mul(strides[0], length))
            _arrayobj.populate_array(array, data=data, shape=shape, strides=strides,
                                     itemsize=_INTEGER(item), meminfo=None)
            values.append(array._getvalue())
        elif isinstance(kind, numba_types.Float):
            values.append(builder.bitcast(argument(), ir.DoubleType()))
        elif kind == numba_types.boolean:
            values.append(builder.icmp_signed('!=', argument(), _INTEGER(0)))
        else:
            values.append(argument())
    status, _ = context.call_conv.call_function(
        builder, context.declare_function(module, compiled.fndesc), compiled.fndesc.restype,
        types, values)
    builder.ret(status.code)
    return module


def _end_with(parent: int) -> None:
    """End when the program that started this one does."""
    while os.getppid() == parent:
        time.sleep(_LOOK)
    os._exit(1)


def main(parent: int, module: str, name: str, target: str) -> None:
    """Compile a function of a module into a file; end when the parent process ends."""
    gc.disable()  # the process ends soon, and the collector takes a tenth of the time
    Thread(target=_end_with, args=[parent], daemon=True).start()
    code = object_file(module, name)
    packages = 'stewart_dynamics', module.partition('.')[0]
    read = ' '.join(each for each in sys.modules if each.partition('.')[0] in packages)
    Path(f'{target}.new').write_bytes(read.encode() + b'\n' + code)
    Path(f'{target}.new').rename(target)
