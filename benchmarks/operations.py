# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Floating-point operations of a sample, and the rates that a GPU cannot exceed because of them.

Run by hand: ``python benchmarks/operations.py``; it needs g++, no GPU. The text of the kernels is
compiled as C++ in which ``double`` is a number that counts its operations. The bits of results do
not allow fused products, so that additions and products count one each.
"""

from __future__ import annotations

import ctypes
from pathlib import Path
import subprocess
import tempfile
from typing import Any, NamedTuple

from inverse_dynamics import markdown
import numpy as np

from stewart_dynamics import Motion, StewartPlatform
from stewart_dynamics.gpu import Hexapods
from stewart_dynamics.gpu.cuda_source import cuda_source

ROOT = Path(__file__).resolve().parent.parent
FILES = {'telescopic': 'platform.yaml', 'crank': 'crank_platform.yaml'}
# Double-precision instructions a second of an H100 SXM or H200: 132 multiprocessors with 64 units
# at 1.98 GHz (NVIDIA H100 Tensor Core GPU Architecture, 2022: 33.5 TFLOP/s of fused products).
INSTRUCTIONS = 132 * 64 * 1.98e9
# Instructions of a division and of a square root, in double precision: a reciprocal from a table
# of single precision, two iterations, and the correction of the last digit.
OF_DIVISION, OF_ROOT = 8, 8

NUMBER = r"""
#include <math.h>
#include <stddef.h>
#include <string.h>
typedef double plain;
static long long additions, products, divisions, roots, comparisons;
struct counted {
  plain value;
  counted() = default;
  constexpr counted(plain a) : value(a) {}
  explicit operator long() const {return (long)value;}
  explicit operator int() const {return (int)value;}
  counted operator-() const {return counted(-value);}
};
#define OPERATOR(sign, count) \
  static counted operator sign(counted a, counted b) {count++; return a.value sign b.value;} \
  static counted & operator sign ## =(counted & a, counted b) {return a = a sign b;}
#define COMPARISON(sign) \
  static bool operator sign(counted a, counted b) {comparisons++; return a.value sign b.value;}
#define FUNCTION(name) static counted name(counted a) {return ::name(a.value);}
#define FUNCTION_OF_TWO(name) \
  static counted name(counted a, counted b) {return ::name(a.value, b.value);}
OPERATOR(+, additions) OPERATOR(-, additions) OPERATOR(*, products) OPERATOR(/, divisions)
COMPARISON(<) COMPARISON(>) COMPARISON(<=) COMPARISON(>=) COMPARISON(==) COMPARISON(!=)
FUNCTION(fabs) FUNCTION(rint) FUNCTION(sin) FUNCTION(cos) FUNCTION(exp) FUNCTION(asin)
FUNCTION(acos) FUNCTION(expm1)
FUNCTION_OF_TWO(copysign) FUNCTION_OF_TWO(atan2) FUNCTION_OF_TWO(hypot)
static counted sqrt(counted a) {roots++; return ::sqrt(a.value);}
#undef isfinite
#undef isnan
#undef isinf
static bool isfinite(counted a) {return __builtin_isfinite(a.value);}
static bool isnan(counted a) {return __builtin_isnan(a.value);}
static bool isinf(counted a) {return __builtin_isinf(a.value);}
#undef HUGE_VAL
#undef NAN
static plain __longlong_as_double(long long bits)
{plain number; memcpy(&number, &bits, sizeof number); return number;}
static struct {unsigned x;} blockIdx, threadIdx, blockDim = {1}, gridDim = {1};
#define __CUDACC_RTC__
#define __global__
#define __noinline__
#define double counted
"""
COUNTS = r"""
extern "C" void take_counts(long long counts[5]) {
  counts[0] = additions, counts[1] = products, counts[2] = divisions, counts[3] = roots;
  counts[4] = comparisons;
  additions = products = divisions = roots = comparisons = 0;
}
"""


class Operations(NamedTuple):
    """The operations of a sample or a step; a comparison takes an instruction, too."""

    additions: float
    products: float
    divisions: float
    roots: float
    comparisons: float

    @property
    def bound(self) -> float:
        """Return the samples a second of a GPU that does nothing else, all the time."""
        return INSTRUCTIONS / (self.additions + self.products + self.comparisons +
                               OF_DIVISION * self.divisions + OF_ROOT * self.roots)


def counting_kernels(folder: Path) -> ctypes.CDLL:
    """Compile the text of the kernels with numbers that count."""
    lines = [line for line in cuda_source().splitlines()
             if not (line.startswith('typedef') and line.endswith('_t;'))]
    (folder / 'kernels.cpp').write_text(
        '\n'.join(['#include <stdint.h>', NUMBER, *lines, COUNTS]), encoding='utf-8')
    subprocess.run(['g++', '-std=c++17', '-O1', '-fpermissive', '-w', '-fPIC', '-shared',
                    str(folder / 'kernels.cpp'), '-o', str(folder / 'kernels.so')], check=True)
    return ctypes.CDLL(str(folder / 'kernels.so'))


def count(kernels: ctypes.CDLL, name: str, *arguments: Any) -> Operations:
    """Run a kernel, and return its operations."""
    counts = (ctypes.c_longlong * 5)()
    kernels.take_counts(counts)
    getattr(kernels, name)(*(
        each.ctypes.data_as(ctypes.c_void_p) if isinstance(each, np.ndarray)
        else ctypes.c_double(each) if isinstance(each, float) else ctypes.c_int64(each)
        for each in arguments))
    kernels.take_counts(counts)
    return Operations(*counts)


def operations(kernels: ctypes.CDLL, legs: str) -> dict[str, Operations]:
    """Return the operations of a kind of legs, near the home pose, without a moving base."""
    platform = StewartPlatform.from_yaml(ROOT / 'config' / FILES[legs])
    hexapods = Hexapods(platform, 1, device='cpu')
    hexapods.reset()
    home = platform.home_pose()
    motion = np.r_[home.rows, np.random.default_rng(1).normal(size=12)]
    wrench, base, efforts, which = np.zeros(6), np.full(12, np.nan), np.zeros(6), np.zeros(1, int)
    result = platform.inverse_dynamics(Motion.from_pose(home))
    efforts[:] = getattr(result, platform.parameters.leg_kind.effort.field)
    rows = np.empty(result.rows.size)
    one = 0, 0, 1  # strides of a single sample
    loads = wrench, *one, base, *one
    found = {}
    for conditioned in (0, 1):
        found[f'inverse dynamics, {"with" if conditioned else "without"} condition number'] = \
            count(kernels, 'hexapods_solve', hexapods._structures, which, 1, 1, conditioned,
                  rows.size, motion, *one, *loads, rows, *one)
    found['forward dynamics'] = count(
        kernels, 'hexapods_accelerate', hexapods._structures, which, 1, 1, motion, *one, efforts,
        *one, *loads, np.empty(6), *one)
    state, of_legs, motors = (np.array(each) for each in (
        hexapods._state, hexapods._of_legs, hexapods._motors))
    several = [count(
        kernels, 'hexapods_step', hexapods._structures, hexapods._constants, which, 1,
        float(steps), hexapods.step_length, np.ones(1, np.uint8), efforts, 0, 1, wrench, 0, 1,
        base, 0, 1, state, 0, 1, of_legs, 0, 1, motors, 0, 1) for steps in (1, 101)]
    found['a step of 100 in a call'] = Operations(*(
        (more - less) / 100.0 for less, more in zip(*several, strict=True)))
    found['a call of a single step'] = several[0]
    return found


def main() -> None:
    """Count and print."""
    cells: list[tuple[str, ...]] = [
        ('work', '+, -', '*', '/', 'square roots', 'comparisons', 'a second at most')]
    with tempfile.TemporaryDirectory() as folder:
        kernels = counting_kernels(Path(folder))
        for legs in FILES:
            cells += [
                (f'{legs} legs: {name}', *(f'{number:,.0f}' for number in of), f'{of.bound:.1e}')
                for name, of in operations(kernels, legs).items()]
    print('\n'.join(markdown(cells)))


if __name__ == '__main__':
    main()
