# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The C source of ``core/`` as one text that NVRTC compiles for a GPU.

``core/hexapods.c`` includes the rest. No line is another one: includes of the package are written
out, those of the system are replaced by the types and constants that NVRTC does not have. The text
is complete, so that a cache of compiled kernels finds a change of any file.
"""

from __future__ import annotations

import re

from stewart_dynamics.core.binding import header

OPTIONS = ('-default-device', '-fmad=false', '-std=c++17')
"""Of NVRTC: functions without a mark run on the GPU; no product is fused into a sum, so that the
bits are those of a CPU."""

_SYSTEM = """\
typedef signed char int8_t;
typedef unsigned char uint8_t;
typedef int int32_t;
typedef unsigned int uint32_t;
typedef long long int64_t;
typedef unsigned long long uint64_t;
#define INT64_C(number) number ## LL
#define HUGE_VAL __longlong_as_double(0x7ff0000000000000LL)
#define NAN __longlong_as_double(0x7ff8000000000000LL)
"""


def cuda_source() -> str:
    """Return the text of the kernels and of all that they call."""
    return _SYSTEM + _written_out('hexapods.c')


def _written_out(name: str) -> str:
    """Return a file of ``core/`` with the included files in place of the includes."""
    return re.sub(r'^#include ("(?P<own>[\w.]+)"|<.*>).*$',
                  lambda found: _written_out(found['own']) if found['own'] else '',
                  header(name), flags=re.MULTILINE)
