# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Joints on a circle: radius, angles and height in place of points; the law: ``core/home.c``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.core.binding import function
from stewart_dynamics.errors import ParameterError

BODIES = 'base', 'platform'


def circle_names(body: str) -> tuple[str, str, str]:
    """Return the names of radius, angles and height of a body's joints."""
    return (f'geometry.{body}_radius', f'geometry.{body}_angles', f'geometry.{body}_height')


CIRCLE_NAMES = frozenset(name for body in BODIES for name in circle_names(body))


def joints_on_circle(radius: float, angles: Array, height: float) -> Array:
    """
    Return six points (6, 3) on a circle about the z axis of their frame [m].

    angles (6,): from the x axis toward the y axis [rad].
    """
    points = np.empty((6, 3))
    function('joints_on_circle')(radius, np.ascontiguousarray(angles, dtype=float), height, points)
    points.setflags(write=False)
    return points


def joints_of(values: Mapping[str, Any], body: str, source: str) -> Array:
    """
    Return the joints of a body (6, 3) [m], which are given as points or by their circle.

    Raises ParameterError: both are given and differ, or a part of the circle is missing.
    """
    name, circle = f'geometry.{body}_joints', circle_names(body)
    points, (radius, angles, height) = values[name], (values[each] for each in circle)
    if points is not None and radius is None and angles is None and height == 0.0:
        joints: Array = points
        return joints
    both = ParameterError(f'{source}: {name}: given as well as {circle[0]}, {circle[1]} or '
                          f'{circle[2]}: leave out the points or the circle')
    if radius is None or angles is None:
        if points is not None:
            raise both
        missing, other = circle[:2] if radius is None else circle[1::-1]
        raise ParameterError(f'{source}: {missing}: not set: needed by {other}')
    on_circle = joints_on_circle(radius, angles, height)
    # A whole set of parameters, as dict(parameters), has both.
    if points is not None and not np.array_equal(points, on_circle):
        raise both
    return on_circle


def without_other(changes: Mapping[str, Any]) -> dict[str, None]:
    """Return the names that changes make invalid: the circle of new points, and vice versa."""
    dropped: dict[str, None] = {}
    for body in BODIES:
        points, circle = f'geometry.{body}_joints', circle_names(body)
        on_circle = any(each in changes for each in circle)
        if points in changes and not on_circle:
            dropped |= dict.fromkeys(circle)
        if on_circle and points not in changes:
            dropped[points] = None
    return dropped
