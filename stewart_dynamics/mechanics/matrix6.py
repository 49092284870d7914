# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Inverse, determinant and largest eigenvalue of 6x6 matrices, without a branch or a loop.

Straight-line code on tuples, so that the loop over samples around it becomes vector code.
The methods are those of Golub and Van Loan, Matrix Computations, 4th ed.: Gauss-Jordan with
partial pivoting (3.4), Householder tridiagonalization (8.3.1); the largest eigenvalue is
then Laguerre's iteration on the tridiagonal matrix's characteristic polynomial (8.4.1,
Wilkinson, The Algebraic Eigenvalue Problem, 7.12), which comes down on it from above.
"""

from __future__ import annotations

import math

from stewart_dynamics.compilation.functions import inlined
from stewart_dynamics.mechanics.vectors import choose6, dot6, Vector6

Rows = tuple[Vector6, Vector6, Vector6, Vector6, Vector6, Vector6]
# The columns of a symmetric matrix from the diagonal down; n(n+1)/2 numbers.
Vector = tuple[float, ...]
Symmetric = tuple[Vector, ...]
Tridiagonal = tuple[float, float, float, float, float, float, float, float, float, float, float]

# A smaller pivot of a matrix whose rows are of length one is taken as this: far below what
# rounding leaves of a zero, it keeps the inverse finite on a singularity, and the adjugate,
# determinant times inverse, right.
SMALLEST_PIVOT = 1e-32


@inlined
def _exchange(swap: bool, a: Vector6, b: Vector6) -> tuple[Vector6, Vector6]:
    return choose6(swap, b, a), choose6(swap, a, b)


@inlined
def _nonzero(pivot: float) -> float:
    return pivot if abs(pivot) > SMALLEST_PIVOT else SMALLEST_PIVOT


@inlined
def _clear(row: Vector6, pivot_row: Vector6, inverse_pivot: float) -> Vector6:
    k = row[0]
    return (row[1] - k * pivot_row[1], row[2] - k * pivot_row[2], row[3] - k * pivot_row[3],
            row[4] - k * pivot_row[4], row[5] - k * pivot_row[5], -k * inverse_pivot)


@inlined
def _eliminate(a: Vector6, b: Vector6, c: Vector6, d: Vector6, e: Vector6, f: Vector6) -> Rows:
    """
    Do one step of Gauss-Jordan in place, pivot a[0], then turn rows and columns on by one.

    After six steps every row and column stands where it stood, and the rows hold the inverse.
    """
    i = 1.0 / _nonzero(a[0])
    p = (1.0, i * a[1], i * a[2], i * a[3], i * a[4], i * a[5])
    return (_clear(b, p, i), _clear(c, p, i), _clear(d, p, i), _clear(e, p, i), _clear(f, p, i),
            (p[1], p[2], p[3], p[4], p[5], i))


@inlined
def _pivot(swapped: float, a: Vector6, b: Vector6) -> tuple[float, bool, Vector6, Vector6]:
    """Bring the row with the larger first entry to the front; a swap turns the sign."""
    swap = abs(b[0]) > abs(a[0])
    a, b = _exchange(swap, a, b)
    return (-swapped if swap else swapped), swap, a, b


@inlined
def inverse_and_determinant(
        a: Vector6, b: Vector6, c: Vector6, d: Vector6, e: Vector6, f: Vector6,
) -> tuple[Rows, float]:
    """
    Return the rows of the inverse, and the determinant, by Gauss-Jordan with partial pivoting.

    The rows of the matrix should be of about length one (see SMALLEST_PIVOT).
    """
    det = 1.0
    det, s01, a, b = _pivot(det, a, b)
    det, s02, a, c = _pivot(det, a, c)
    det, s03, a, d = _pivot(det, a, d)
    det, s04, a, e = _pivot(det, a, e)
    det, s05, a, f = _pivot(det, a, f)
    det *= _nonzero(a[0])
    a, b, c, d, e, f = _eliminate(a, b, c, d, e, f)
    det, s12, a, b = _pivot(det, a, b)
    det, s13, a, c = _pivot(det, a, c)
    det, s14, a, d = _pivot(det, a, d)
    det, s15, a, e = _pivot(det, a, e)
    det *= _nonzero(a[0])
    a, b, c, d, e, f = _eliminate(a, b, c, d, e, f)
    det, s23, a, b = _pivot(det, a, b)
    det, s24, a, c = _pivot(det, a, c)
    det, s25, a, d = _pivot(det, a, d)
    det *= _nonzero(a[0])
    a, b, c, d, e, f = _eliminate(a, b, c, d, e, f)
    det, s34, a, b = _pivot(det, a, b)
    det, s35, a, c = _pivot(det, a, c)
    det *= _nonzero(a[0])
    a, b, c, d, e, f = _eliminate(a, b, c, d, e, f)
    det, s45, a, b = _pivot(det, a, b)
    det *= _nonzero(a[0])
    a, b, c, d, e, f = _eliminate(a, b, c, d, e, f)
    det *= _nonzero(a[0])
    a, b, c, d, e, f = _eliminate(a, b, c, d, e, f)
    # The swaps of rows, undone in reverse order as swaps of the inverse's columns.
    u, v, w, x, y, z = _transpose(a, b, c, d, e, f)
    y, z = _exchange(s45, y, z)
    x, z = _exchange(s35, x, z)
    x, y = _exchange(s34, x, y)
    w, z = _exchange(s25, w, z)
    w, y = _exchange(s24, w, y)
    w, x = _exchange(s23, w, x)
    v, z = _exchange(s15, v, z)
    v, y = _exchange(s14, v, y)
    v, x = _exchange(s13, v, x)
    v, w = _exchange(s12, v, w)
    u, z = _exchange(s05, u, z)
    u, y = _exchange(s04, u, y)
    u, x = _exchange(s03, u, x)
    u, w = _exchange(s02, u, w)
    u, v = _exchange(s01, u, v)
    return _transpose(u, v, w, x, y, z), det


@inlined
def _transpose(a: Vector6, b: Vector6, c: Vector6, d: Vector6, e: Vector6, f: Vector6) -> Rows:
    return ((a[0], b[0], c[0], d[0], e[0], f[0]), (a[1], b[1], c[1], d[1], e[1], f[1]),
            (a[2], b[2], c[2], d[2], e[2], f[2]), (a[3], b[3], c[3], d[3], e[3], f[3]),
            (a[4], b[4], c[4], d[4], e[4], f[4]), (a[5], b[5], c[5], d[5], e[5], f[5]))


@inlined
def gram(a: Vector6, b: Vector6, c: Vector6, d: Vector6, e: Vector6, f: Vector6) -> Symmetric:
    """Return A A^T of the matrix with these rows."""
    return ((dot6(a, a), dot6(a, b), dot6(a, c), dot6(a, d), dot6(a, e), dot6(a, f)),
            (dot6(b, b), dot6(b, c), dot6(b, d), dot6(b, e), dot6(b, f)),
            (dot6(c, c), dot6(c, d), dot6(c, e), dot6(c, f)),
            (dot6(d, d), dot6(d, e), dot6(d, f)),
            (dot6(e, e), dot6(e, f)),
            (dot6(f, f),))


@inlined
def _mirror(first: float, square: float) -> tuple[float, float]:
    """Return the Householder vector's first entry and 2 / v.v, for x with x[0] and x.x."""
    length = math.sqrt(square)
    half = square + length * abs(first)
    return first + math.copysign(length, first), 1.0 / half if half > 0.0 else 0.0


@inlined
def tridiagonal(g: Symmetric) -> Tridiagonal:
    """Return six diagonal entries and five SQUARES of the off-diagonal ones of H^T G H."""
    # Each step mirrors the first column x below the diagonal onto its first axis and
    # takes the mirror v through the rest S: S - v w^T - w v^T.
    x0, x1, x2, x3, x4 = g[0][1], g[0][2], g[0][3], g[0][4], g[0][5]
    e0 = x0 * x0 + x1 * x1 + x2 * x2 + x3 * x3 + x4 * x4
    v0, b = _mirror(x0, e0)
    (s00, s10, s20, s30, s40), (s11, s21, s31, s41), (s22, s32, s42), (s33, s43), (s44,) = (
        g[1], g[2], g[3], g[4], g[5])
    w0 = b * (s00 * v0 + s10 * x1 + s20 * x2 + s30 * x3 + s40 * x4)
    w1 = b * (s10 * v0 + s11 * x1 + s21 * x2 + s31 * x3 + s41 * x4)
    w2 = b * (s20 * v0 + s21 * x1 + s22 * x2 + s32 * x3 + s42 * x4)
    w3 = b * (s30 * v0 + s31 * x1 + s32 * x2 + s33 * x3 + s43 * x4)
    w4 = b * (s40 * v0 + s41 * x1 + s42 * x2 + s43 * x3 + s44 * x4)
    k = 0.5 * b * (w0 * v0 + w1 * x1 + w2 * x2 + w3 * x3 + w4 * x4)
    w0, w1, w2, w3, w4 = w0 - k * v0, w1 - k * x1, w2 - k * x2, w3 - k * x3, w4 - k * x4
    d1 = s00 - 2.0 * v0 * w0
    y0, y1 = s10 - x1 * w0 - w1 * v0, s20 - x2 * w0 - w2 * v0
    y2, y3 = s30 - x3 * w0 - w3 * v0, s40 - x4 * w0 - w4 * v0
    s11, s22 = s11 - 2.0 * x1 * w1, s22 - 2.0 * x2 * w2
    s33, s44 = s33 - 2.0 * x3 * w3, s44 - 2.0 * x4 * w4
    s21, s31, s41 = (s21 - x2 * w1 - w2 * x1, s31 - x3 * w1 - w3 * x1, s41 - x4 * w1 - w4 * x1)
    s32, s42, s43 = (s32 - x3 * w2 - w3 * x2, s42 - x4 * w2 - w4 * x2, s43 - x4 * w3 - w4 * x3)

    e1 = y0 * y0 + y1 * y1 + y2 * y2 + y3 * y3
    v0, b = _mirror(y0, e1)
    w0 = b * (s11 * v0 + s21 * y1 + s31 * y2 + s41 * y3)
    w1 = b * (s21 * v0 + s22 * y1 + s32 * y2 + s42 * y3)
    w2 = b * (s31 * v0 + s32 * y1 + s33 * y2 + s43 * y3)
    w3 = b * (s41 * v0 + s42 * y1 + s43 * y2 + s44 * y3)
    k = 0.5 * b * (w0 * v0 + w1 * y1 + w2 * y2 + w3 * y3)
    w0, w1, w2, w3 = w0 - k * v0, w1 - k * y1, w2 - k * y2, w3 - k * y3
    d2 = s11 - 2.0 * v0 * w0
    z0, z1, z2 = (s21 - y1 * w0 - w1 * v0, s31 - y2 * w0 - w2 * v0, s41 - y3 * w0 - w3 * v0)
    s22, s33, s44 = s22 - 2.0 * y1 * w1, s33 - 2.0 * y2 * w2, s44 - 2.0 * y3 * w3
    s32, s42, s43 = (s32 - y2 * w1 - w2 * y1, s42 - y3 * w1 - w3 * y1, s43 - y3 * w2 - w3 * y2)

    e2 = z0 * z0 + z1 * z1 + z2 * z2
    v0, b = _mirror(z0, e2)
    w0 = b * (s22 * v0 + s32 * z1 + s42 * z2)
    w1 = b * (s32 * v0 + s33 * z1 + s43 * z2)
    w2 = b * (s42 * v0 + s43 * z1 + s44 * z2)
    k = 0.5 * b * (w0 * v0 + w1 * z1 + w2 * z2)
    w0, w1, w2 = w0 - k * v0, w1 - k * z1, w2 - k * z2
    d3 = s22 - 2.0 * v0 * w0
    u0, u1 = s32 - z1 * w0 - w1 * v0, s42 - z2 * w0 - w2 * v0
    s33, s44, s43 = s33 - 2.0 * z1 * w1, s44 - 2.0 * z2 * w2, s43 - z2 * w1 - w2 * z1

    e3 = u0 * u0 + u1 * u1
    v0, b = _mirror(u0, e3)
    w0 = b * (s33 * v0 + s43 * u1)
    w1 = b * (s43 * v0 + s44 * u1)
    k = 0.5 * b * (w0 * v0 + w1 * u1)
    w0, w1 = w0 - k * v0, w1 - k * u1
    d4, d5 = s33 - 2.0 * v0 * w0, s44 - 2.0 * u1 * w1
    e4 = s43 - u1 * w0 - w1 * v0
    return g[0][0], d1, d2, d3, d4, d5, e0, e1, e2, e3, e4 * e4


@inlined
def _minor(
        x: float, e: float, p: float, dp: float, ddp: float, q: float, dq: float, ddq: float,
) -> tuple[float, float, float]:
    """Return the next leading minor and its two derivatives; p is the last, q the one before."""
    return x * p - e * q, p + x * dp - e * dq, 2.0 * dp + x * ddp - e * ddq


@inlined
def laguerre_step(x: float, t: Tridiagonal) -> float:
    """
    Return x one step nearer the largest eigenvalue of T, from above, or x where it is there.

    Once it returns x itself it does so for good: more steps change nothing.
    """
    p0, dp0, ddp0 = x - t[0], 1.0, 0.0
    p1, dp1, ddp1 = _minor(x - t[1], t[6], p0, dp0, ddp0, 1.0, 0.0, 0.0)
    p2, dp2, ddp2 = _minor(x - t[2], t[7], p1, dp1, ddp1, p0, dp0, ddp0)
    p3, dp3, ddp3 = _minor(x - t[3], t[8], p2, dp2, ddp2, p1, dp1, ddp1)
    p4, dp4, ddp4 = _minor(x - t[4], t[9], p3, dp3, ddp3, p2, dp2, ddp2)
    p5, dp5, ddp5 = _minor(x - t[5], t[10], p4, dp4, ddp4, p3, dp3, ddp3)
    root = 25.0 * dp5 * dp5 - 30.0 * p5 * ddp5
    divisor = dp5 + math.sqrt(root if root > 0.0 else 0.0)
    nearer = x - 6.0 * p5 / (divisor if divisor > 0.0 else 1.0)
    return nearer if p5 > 0.0 and divisor > 0.0 and 0.0 < nearer < x else x
