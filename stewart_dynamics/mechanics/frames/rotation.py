# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Rotations: from Euler angles with exact rates, and from quaternions."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.core.binding import function


def from_euler(angles: ArrayLike) -> Array:
    """
    Return R = Rz(gamma) Ry(beta) Rx(alpha) of angles (..., 3) [rad], the paper's r_11 .. r_33.

    R (..., 3, 3) turns platform axes into base axes.
    """
    alpha, beta, gamma = np.moveaxis(np.asarray(angles, dtype=float), -1, 0)
    ca, sa, cb, sb, cg, sg = (np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta),
                              np.cos(gamma), np.sin(gamma))
    return _matrix([
        [cg * cb, cg * sb * sa - sg * ca, cg * sb * ca + sg * sa],
        [sg * cb, sg * sb * sa + cg * ca, sg * sb * ca - cg * sa],
        [-sb, cb * sa, cb * ca]])


def to_euler(rotation: ArrayLike) -> Array:
    """
    Return alpha, beta, gamma (..., 3) [rad] of rotations (..., 3, 3).

    Where beta is 90 degrees only the sum or difference of the others is determined: alpha is
    computed with gamma as it is found, so that the rotation is exact everywhere.
    """
    r = np.ascontiguousarray(rotation, dtype=float)
    angles = np.empty((*r.shape[:-2], 3))
    # In C: bits of numpy 1.26's arctan2 depend on where its arguments are in memory.
    function('euler_angles_many')(angles.size // 3, r, angles)
    return angles


def euler_rate_matrix(angles: ArrayLike) -> Array:
    """
    Return E (..., 3, 3) with angular velocity = E [alpha', beta', gamma'], base axes.

    The paper takes E for the identity, which holds at zero angles only. See Diebel,
    Representing Attitude, Stanford, 2006, 5.3.
    """
    _, beta, gamma = np.moveaxis(np.asarray(angles, dtype=float), -1, 0)
    cb, sb, cg, sg = np.cos(beta), np.sin(beta), np.cos(gamma), np.sin(gamma)
    zero, one = np.zeros_like(cb), np.ones_like(cb)
    return _matrix([[cg * cb, -sg, zero], [sg * cb, cg, zero], [-sb, zero, one]])


def euler_rates(angles: ArrayLike, angular_velocity: ArrayLike) -> Array:
    """Return E^-1 w (..., 3): the rates of angles; not finite where the pitch is 90 degrees."""
    _, beta, gamma = np.moveaxis(np.asarray(angles, dtype=float), -1, 0)
    x, y, z = np.moveaxis(np.asarray(angular_velocity, dtype=float), -1, 0)
    cg, sg = np.cos(gamma), np.sin(gamma)
    alpha_rate = (cg * x + sg * y) / np.cos(beta)
    found: Array = np.stack(
        [alpha_rate, cg * y - sg * x, z + np.sin(beta) * alpha_rate], axis=-1)
    return found


def euler_rate_matrix_rate(angles: ArrayLike, rates: ArrayLike) -> Array:
    """Return dE/dt (..., 3, 3): angular acceleration = E angles'' + E' angles'."""
    _, beta, gamma = np.moveaxis(np.asarray(angles, dtype=float), -1, 0)
    _, db, dg = np.moveaxis(np.asarray(rates, dtype=float), -1, 0)
    cb, sb, cg, sg = np.cos(beta), np.sin(beta), np.cos(gamma), np.sin(gamma)
    zero = np.zeros_like(cb * db)
    return _matrix([
        [-sg * cb * dg - cg * sb * db, -cg * dg, zero],
        [cg * cb * dg - sg * sb * db, -sg * dg, zero],
        [-cb * db, zero, zero]])


Number = TypeVar('Number', float, Array)


def quaternion_length(x: Number, y: Number, z: Number, w: Number) -> Number:
    """Return the length of a quaternion, or of arrays of them; the same bits either way."""
    square = x * x + y * y + z * z + w * w
    return math.sqrt(square) if isinstance(square, float) else np.sqrt(square)


def from_quaternion(
        x: Number, y: Number, z: Number, w: Number,
) -> tuple[Number, Number, Number, Number, Number, Number, Number, Number, Number]:
    """Return the nine numbers of R, row by row, of a unit quaternion, or of arrays of them."""
    xx, yy, zz = x * x, y * y, z * z
    xy, xz, yz = x * y, x * z, y * z
    wx, wy, wz = w * x, w * y, w * z
    return (1.0 - 2.0 * (yy + zz), 2.0 * (xy - wz), 2.0 * (xz + wy),
            2.0 * (xy + wz), 1.0 - 2.0 * (xx + zz), 2.0 * (yz - wx),
            2.0 * (xz - wy), 2.0 * (yz + wx), 1.0 - 2.0 * (xx + yy))


def to_quaternion(rotation: ArrayLike) -> Array:
    """
    Return unit quaternions x y z w (..., 4) of rotation matrices (..., 3, 3), w >= 0.

    Each is computed from the largest of its four numbers (Shepperd,
    J. Guidance and Control 1(3), 1978, doi:10.2514/3.55767b), so that no digits are lost.
    """
    r = np.asarray(rotation, dtype=float)
    r00, r11, r22 = r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]
    squares = np.stack([1 + r00 - r11 - r22, 1 - r00 + r11 - r22, 1 - r00 - r11 + r22,
                        1 + r00 + r11 + r22], axis=-1)
    xy, xz, yz = (r[..., 0, 1] + r[..., 1, 0], r[..., 0, 2] + r[..., 2, 0],
                  r[..., 1, 2] + r[..., 2, 1])
    xw, yw, zw = (r[..., 2, 1] - r[..., 1, 2], r[..., 0, 2] - r[..., 2, 0],
                  r[..., 1, 0] - r[..., 0, 1])
    candidates = _matrix([
        [squares[..., 0], xy, xz, xw], [xy, squares[..., 1], yz, yw],
        [xz, yz, squares[..., 2], zw], [xw, yw, zw, squares[..., 3]]])
    best = np.argmax(squares, axis=-1)[..., None, None]
    q = np.take_along_axis(candidates, best, axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    unit: Array = np.where(q[..., 3:] < 0.0, -q, q)
    return unit


def from_rotation_vector(vectors: ArrayLike) -> Array:
    """Return the rotations (..., 3, 3) by rotation vectors (..., 3), axis times angle [rad]."""
    v = np.asarray(vectors, dtype=float)
    angle = np.linalg.norm(v, axis=-1)
    x, y, z = np.moveaxis(0.5 * np.sinc(angle / (2.0 * np.pi))[..., None] * v, -1, 0)
    rows = from_quaternion(x, y, z, np.cos(0.5 * angle))
    return np.stack(rows, axis=-1).reshape(*angle.shape, 3, 3)


def to_rotation_vector(rotation: ArrayLike) -> Array:
    """Return rotation vectors (..., 3) [rad] of rotations (..., 3, 3), of at most half a turn."""
    q = to_quaternion(rotation)
    sine = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, q[..., 3:])
    scale = np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0.0)
    vectors: Array = scale * q[..., :3]
    return vectors


def quaternion_product(first: Array, second: Array) -> Array:
    """Return the quaternions (..., 4) of Ra Rb, for those of Ra and Rb; x, y, z, w."""
    (ax, ay, az, aw), (bx, by, bz, bw) = np.moveaxis(first, -1, 0), np.moveaxis(second, -1, 0)
    return np.stack([
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz], axis=-1)


def quaternion_of(rotation: Sequence[float]) -> tuple[float, float, float, float]:
    """Return the result of ``to_quaternion`` for the nine numbers of one matrix, much faster."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation
    xy, xz, yz = r01 + r10, r02 + r20, r12 + r21
    xw, yw, zw = r21 - r12, r02 - r20, r10 - r01
    xx, yy, zz, ww = (1.0 + r00 - r11 - r22, 1.0 - r00 + r11 - r22, 1.0 - r00 - r11 + r22,
                      1.0 + r00 + r11 + r22)
    # The row of the largest number on the diagonal; of each the first entry is that number.
    _, x, y, z, w = max((xx, xx, xy, xz, xw), (yy, xy, yy, yz, yw), (zz, xz, yz, zz, zw),
                        (ww, xw, yw, zw, ww))
    length = math.copysign(math.sqrt(x * x + y * y + z * z + w * w), w)
    return x / length, y / length, z / length, w / length


def _matrix(rows: list[list[Array]]) -> Array:
    found = np.empty((*rows[0][0].shape, len(rows), len(rows[0])))
    for i, row in enumerate(rows):
        for j, each in enumerate(row):
            found[..., i, j] = each
    return found
