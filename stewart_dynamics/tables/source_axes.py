# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Numbers in the axes of another source, right-handed or left-handed, in those of the base."""

from __future__ import annotations

import re

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import StewartError


def axes_matrix(axes: str) -> Array:
    """
    Return the matrix (3, 3) from the source's axes to those of the base, of determinant 1 or -1.

    Raises StewartError if the text names not each axis once.
    """
    found = re.fullmatch(r'([+-]?)([xyz]),([+-]?)([xyz]),([+-]?)([xyz])', axes.replace(' ', ''))
    if found is None or sorted(found.groups()[1::2]) != ['x', 'y', 'z']:
        raise StewartError(f'{axes!r}: must be x, y and z, each once, as z,-x,y')
    matrix = np.zeros((3, 3))
    for row, (sign, name) in enumerate(zip(*[iter(found.groups())] * 2, strict=True)):
        matrix[row, 'xyz'.index(name)] = -1.0 if sign == '-' else 1.0
    return matrix


def turned(values: Array, matrix: Array, kinds: str) -> Array:
    """
    Return numbers (..., n) of the source's axes in those of the base.

    kinds: of each group of them: v a vector, a an axial vector (rotation, moment), q a quaternion.
    """
    axial = np.linalg.det(matrix) * matrix
    parts, at = [], 0
    for kind in kinds:
        three = values[..., at:at + 3] @ (matrix if kind == 'v' else axial).T
        parts.append(three)
        at += 3
        if kind == 'q':
            parts.append(values[..., at:at + 1])
            at += 1
    found: Array = np.concatenate(parts, axis=-1)
    return found
