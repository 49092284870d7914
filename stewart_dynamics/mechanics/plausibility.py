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
Machines that break no rule but can hardly be meant: a wrong unit, a geometry that is singular.

Only what can be told of any machine there is, from a hexapod on a fingertip to a telescope's
cabin on cables of 300 m: each bound leaves room on both sides, and a doubt is no error.
"""

from __future__ import annotations

from collections.abc import Iterator
import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.rotation import from_euler
from stewart_dynamics.mechanics.singularity import UNSOLVABLE_CONDITION
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters import inertia_matrix, Parameters

# The largest there is, the six cables of a radio telescope's cabin, hang from towers on a circle
# of 300 m, and the cabin's joints are 90 times nearer to each other.
_LARGEST_RADIUS = 1000.0  # [m]
_LARGEST_RATIO = 300.0

# Mass in a cube on the platform's radius: 10 for an empty frame, 1e3 to 1e5 for machines. One of
# at least 5 mm that is given in mm has 1e-9 of that. Small ones without mass are left alone.
_SMALL_RADIUS = 5.0  # [m]
_THINNEST = 0.01  # [kg/m^3]

# A body's radius of gyration beside the radius of its joints: 0.1 to 3 for all machines known.
# kg cm^2 for kg m^2 makes it 100 times as large, kg mm^2 1000 times, g mm^2 3e4 times.
_LARGEST_GYRATION = 30.0
_SMALLEST_GYRATION = 1.0 / 200.0
# The same of a leg's part beside the longest leg: 0.3 for a rod as long as the leg.
_LARGEST_LEG_GYRATION = 3.0

# How far principal moments rounded to two or three digits may break the triangle inequality.
_ROUNDING = 0.02

# A mast of ten times the platform's radius has its center of mass within.
_FARTHEST_CENTER = 10.0

_LARGEST_GRAVITY = 100.0  # [m/s^2]; Jupiter has 25
_FASTEST = 100.0  # [m/s]; a hundred times what machines do

# Lengths beside the larger radius: legs have 1 to 10 of it, in mm 1000 times that.
_LENGTH_RATIO = 100.0

# Where nothing says how high the platform stands: these parts of the larger radius.
_HEIGHTS = (0.3, 0.6, 1.0, 1.7, 3.0)
_YAWS = np.deg2rad(np.arange(0.0, 360.0, 10.0))
_TILT = math.radians(15.0)


class _Shape(NamedTuple):
    """A machine's joints in axes of which the third is the normal of the base joints' plane."""

    base: Array
    """From their center (6, 3) [m]."""
    platform: Array
    """From their center (6, 3) [m], while the axes of both frames are parallel."""
    axes: Array
    """Those axes in the base frame (3, 3), row by row."""
    base_radius: float
    platform_radius: float

    @property
    def radius(self) -> float:
        """The larger one [m]."""
        return max(self.base_radius, self.platform_radius)


def doubts(parameters: Parameters, geometry: bool = True) -> tuple[str, ...]:
    """
    Return what can hardly be meant, each in one line: parameter, value, what is suspected.

    Home is the pose with parallel axes, the platform joints' center above that of the base
    joints along the normal of their plane, at the height where the mean leg is halfway between
    the limits of its length; without them it has the zero length, and without that several
    heights stand for home. Without ``geometry`` legs and poses are left out, which takes ten
    times as long as the rest.
    """
    # Numbers near the end of what a double holds overflow here: that is no doubt of its own.
    with np.errstate(all='ignore'):
        shape = _shape(parameters)
        found = [*_sizes(parameters, shape), *_inertia(parameters, shape),
                 *_others(parameters, shape)]
        if not geometry:
            return tuple(found)
        reach = _reach(parameters, shape)
        found += [*_legs(parameters, shape, reach), *_singular(parameters, shape, reach)]
    return tuple(found)


def homes(parameters: Parameters) -> tuple[Array, Array]:
    """
    Return where the platform may stand at home, the likeliest first; see ``doubts``.

    Positions (N, 3) [m] and rotations (N, 3, 3); the normal of the base joints' plane does not
    tell above from below, so half of them are on its other side.
    """
    with np.errstate(all='ignore'):
        shape = _shape(parameters)
        reach = _reach(parameters, shape)
        heights, _ = _home(parameters, shape, reach)
        return _poses(parameters, shape, heights,
                      _about(2, np.full(len(heights), reach.yaw or 0.0)))


def _shape(p: Parameters) -> _Shape:
    base, platform = p['geometry.base_joints'], p['geometry.platform_joints']
    around, carried = base - base.mean(axis=0), platform - platform.mean(axis=0)
    axes = level_axes(around)
    return _Shape(around @ axes.T, carried @ axes.T, axes, _mean_norm(around),
                  _mean_norm(carried))


def level_axes(around: Array) -> Array:
    """Return two axes in the plane of points, and its normal, (3, 3)."""
    moments = around.T @ around
    if not np.isfinite(moments).all():
        return np.eye(3)
    # The normal of a plane is the direction in which its points spread least.
    normal = np.linalg.eigh(moments)[1][:, 0]
    nearest = int(np.argmax(np.abs(normal)))
    normal = normal * np.sign(normal[nearest])
    first = np.cross(np.eye(3)[(nearest + 2) % 3], normal)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(normal, first), normal])


def _mean_norm(vectors: Array) -> float:
    return float(np.mean(np.linalg.norm(vectors, axis=-1)))


def _sizes(p: Parameters, shape: _Shape) -> Iterator[str]:
    base, platform = shape.base_radius, shape.platform_radius
    mass = p['platform.mass']
    if base > _LARGEST_RADIUS:
        yield (f'geometry.base_joints: {base:.3g} m from their center: larger than any machine: '
               'in mm?')
    if platform > _SMALL_RADIUS and mass < _THINNEST * platform * platform * platform:
        yield (f'geometry.platform_joints: {platform:.3g} m from their center, and '
               f'platform.mass only {mass:.3g} kg: in mm?')
    if max(base, platform) > _LARGEST_RATIO * min(base, platform):
        yield (f'geometry.platform_joints: {platform:.3g} m from their center, the base joints '
               f'{base:.3g} m: one of them in mm?')
    for name in ('singularity.characteristic_length', 'geometry.zero_length',
                 'limits.length_min', 'limits.length_max'):
        if _is_too_long(p, name, shape):
            yield (f'{name}: {np.max(p[name]):.3g} m, but the joints are {shape.radius:.3g} m '
                   'from their center: in mm?')


def _is_too_long(p: Parameters, name: str, shape: _Shape) -> bool:
    return p[name] is not None and bool(np.max(p[name]) > _LENGTH_RATIO * shape.radius)


def _inertia(p: Parameters, shape: _Shape) -> Iterator[str]:
    moments = np.linalg.eigvalsh(inertia_matrix(p['platform.inertia']))
    gyration = math.sqrt(moments[2] / p['platform.mass'])
    size = f'the platform joints are {shape.platform_radius:.3g} m from their center'
    if gyration > _LARGEST_GYRATION * shape.radius:
        yield (f'platform.inertia: {moments[2]:.3g} kg m^2 at most, a radius of gyration of '
               f'{gyration:.3g} m, but {size}: in g mm^2 or kg mm^2?')
    if gyration < _SMALLEST_GYRATION * shape.platform_radius:
        yield (f'platform.inertia: {moments[2]:.3g} kg m^2 at most, a radius of gyration of '
               f'{gyration:.3g} m, but {size}: scaled twice, or the joints in mm?')
    if moments[2] > (1.0 + _ROUNDING) * (moments[0] + moments[1]):
        yield (f'platform.inertia: principal moments {_listed(moments)} kg m^2: no body has one '
               'larger than the sum of the other two: is the order ixx ixy ixz iyy iyz izz?')
    center = p['platform.center_of_mass'] - p['geometry.platform_joints'].mean(axis=0)
    away = float(np.linalg.norm(center))
    if away > _FARTHEST_CENTER * shape.radius:
        yield (f'platform.center_of_mass: {_listed(p["platform.center_of_mass"])} m is '
               f'{away:.3g} m from the middle of the platform joints, but {size}: in mm?')


def _others(p: Parameters, shape: _Shape) -> Iterator[str]:
    gravity = float(np.linalg.norm(p['gravity']))
    if gravity > _LARGEST_GRAVITY:
        yield f'gravity: {gravity:.6g} m/s^2: four times that of Jupiter: in mm/s^2?'
    if math.isclose(gravity, 1.0, rel_tol=1e-3):
        yield f'gravity: {gravity:.6g} m/s^2: in g? The earth has 9.80665'
    weight, most = p['platform.mass'] * gravity, p['limits.force_max']
    if most is not None and gravity <= _LARGEST_GRAVITY and weight > most.sum():
        yield (f'limits.force_max: {_listed(np.unique(most))} N: six such legs cannot carry the '
               f'platform, {weight:.3g} N: in kN?')
    fastest = p['limits.velocity_max']
    if fastest is not None and fastest.max() > _FASTEST:
        yield f'limits.velocity_max: {fastest.max():.3g} m/s: in mm/s?'


class _Reach(NamedTuple):
    """What the limits of the legs' lengths leave of the level poses."""

    yaw: float | None
    """The angle nearest to 0 at which all legs are within them at some height; None: none."""
    longest: float
    """The longest leg that is to be expected [m]."""


def _reach(p: Parameters, shape: _Shape) -> _Reach:
    shortest, longest = p['limits.length_min'], p['limits.length_max']
    low = np.zeros(6) if shortest is None else shortest
    high = np.full(6, np.inf) if longest is None else longest
    turned = _about(2, _YAWS) @ shape.platform.T  # (yaws, 3, 6)
    offset = turned.swapaxes(-1, -2) - shape.base
    along = offset[..., 2]
    across = np.linalg.norm(offset[..., :2], axis=-1)
    reached = np.zeros(len(_YAWS), dtype=bool)
    for side in (1.0, -1.0):  # above the base, and below it
        # A leg's height is that of the platform and its own share of it.
        least = np.sqrt(np.maximum(low ** 2 - across ** 2, 0.0)) - side * along
        most = np.where(high >= across, np.sqrt(np.abs(high ** 2 - across ** 2)), -np.inf)
        reached |= least.max(axis=-1) <= (most - side * along).min(axis=-1)
    angles = np.abs((_YAWS + np.pi) % (2.0 * np.pi) - np.pi)
    yaw = float(_YAWS[np.argmin(np.where(reached, angles, np.inf))]) if reached.any() else None
    if longest is not None and not _is_too_long(p, 'limits.length_max', shape):
        return _Reach(yaw, float(longest.max()))
    return _Reach(yaw, math.hypot(_HEIGHTS[-1] * shape.radius, float(across.max())))


def _legs(p: Parameters, shape: _Shape, reach: _Reach) -> Iterator[str]:
    if reach.yaw is None:
        limits = ' and '.join(f'{name}: {_listed(np.unique(p[name]))} m' for name in (
            'limits.length_min', 'limits.length_max') if p[name] is not None)
        yield (f'{limits}: no level pose has all legs within; the base joints are '
               f'{shape.base_radius:.3g} m from their center, the platform joints '
               f'{shape.platform_radius:.3g} m: different units?')
        return  # which of them is wrong cannot be told: the rest would be said of both
    longest = reach.longest
    for part, joint in (('cylinder', 'base'), ('piston', 'platform')):
        name = f'legs.{part}.center_of_mass'
        masses, centers = p[f'legs.{part}.mass'], p[name]
        # Behind the joint there may be a motor, but hardly half a leg away from it.
        outside = (centers > longest) | (centers < -0.5 * longest)
        if outside.any():
            yield (f'{name}: {centers[np.argmax(outside)]:.3g} m from the {joint} joint, but no '
                   f'leg is over {longest:.3g} m: in mm?')
        gyration = np.sqrt(np.divide(p[f'legs.{part}.inertia'], masses, where=masses > 0.0,
                                     out=np.zeros(6)))
        at = int(np.argmax(gyration))
        if gyration[at] > _LARGEST_LEG_GYRATION * longest:
            yield (f'legs.{part}.inertia: {p[f"legs.{part}.inertia"][at]:.3g} kg m^2, a radius '
                   f'of gyration of {gyration[at]:.3g} m, but no leg is over {longest:.3g} m: '
                   'in g mm^2 or kg mm^2?')


def _singular(p: Parameters, shape: _Shape, reach: _Reach) -> Iterator[str]:
    tried = [(height * side * shape.radius, math.radians(yaw), tilt)
             for height in _HEIGHTS for side in (1.0, -1.0)
             for yaw in (0.0, 20.0, -20.0, 45.0, -45.0) for tilt in (0.0, _TILT, -_TILT)]
    heights, angles, tilts = np.array(tried).T
    anywhere = _conditions(
        p, shape, heights, _about(2, angles) @ _about(0, tilts) @ _about(1, 0.5 * tilts))
    stop = p['singularity.stop_condition']
    best = float(anywhere.min())
    if best >= stop:
        yield (f'geometry: {_kind(best)} at every pose of {len(tried)} tried: the condition '
               f'number is at least {best:.3g}, singularity.stop_condition is {stop:g}: are base '
               'and platform joints similar hexagons, two legs the same, or the joints in '
               'another order?')
        return
    heights, where = _home(p, shape, reach)
    turned = _about(2, np.full(len(heights), reach.yaw or 0.0))
    home = float(_conditions(p, shape, heights, turned).min())
    if home >= stop:
        yield (f'geometry: {_kind(home)} at home ({where}): the condition number is {home:.3g}, '
               f'singularity.stop_condition is {stop:g}: is the platform turned against the '
               'base there, or the order of the joints another?')


def _kind(condition: float) -> str:
    return 'singular' if condition >= UNSOLVABLE_CONDITION else 'nearly singular'


def _home(p: Parameters, shape: _Shape, reach: _Reach) -> tuple[Array, str]:
    """Return the heights at which the platform may stand at home, and what they are in words."""
    yaw = reach.yaw or 0.0
    turned = f'turned by {math.degrees(yaw):.0f} degrees' if yaw else 'the axes parallel'
    low, high = p['limits.length_min'], p['limits.length_max']
    length = float(np.mean(p['geometry.zero_length'] if low is None or high is None
                           else 0.5 * (low + high)))
    if _mean_length(shape, 0.0, yaw) < length < _LENGTH_RATIO * shape.radius:
        heights = [side * _height(shape, side, yaw, length) for side in (1.0, -1.0)]
        return np.array(heights), f'{turned}, a mean leg of {length:.3g} m'
    heights = [side * height * shape.radius for side in (1.0, -1.0) for height in _HEIGHTS]
    return np.array(heights), f'{turned}, at any height'


def _height(shape: _Shape, side: float, yaw: float, length: float) -> float:
    """Return how far above or below the base the mean leg has a length."""
    low, high = 0.0, length + shape.base_radius + shape.platform_radius
    for _ in range(60):
        middle = 0.5 * (low + high)
        if _mean_length(shape, side * middle, yaw) < length:
            low = middle
        else:
            high = middle
    return high


def _mean_length(shape: _Shape, height: float, yaw: float) -> float:
    offset = shape.platform @ _about(2, np.array([yaw]))[0].T - shape.base
    offset[:, 2] += height
    return _mean_norm(offset)


def _poses(p: Parameters, shape: _Shape, heights: Array, rotations: Array,
           ) -> tuple[Array, Array]:
    """Return positions (N, 3) and rotations (N, 3, 3) at these heights and turns of the shape."""
    middle = p['geometry.platform_joints'].mean(axis=0)
    rotations = shape.axes.T @ rotations @ shape.axes
    positions = (p['geometry.base_joints'].mean(axis=0) - rotations @ middle
                 + heights[:, None] * shape.axes[2])
    return positions, rotations


def _conditions(p: Parameters, shape: _Shape, heights: Array, rotations: Array) -> Array:
    """Return condition numbers (N,) at these heights and turns, both in the shape's axes."""
    positions, rotations = _poses(p, shape, heights, rotations)
    if not np.isfinite(positions).all():
        return np.full(len(heights), 1.0)
    matrices = StewartPlatform(p).jacobian(positions, rotations)
    length = p['singularity.characteristic_length']
    if _is_too_long(p, 'singularity.characteristic_length', shape):
        length = shape.platform_radius  # said already, and no doubt of the geometry
    matrices[..., 3:] /= length
    matrices[~np.isfinite(matrices).all(axis=(-2, -1))] = np.zeros((6, 6))
    values = np.linalg.svd(matrices, compute_uv=False)
    conditions: Array = np.where(values[:, 5] > 0.0, values[:, 0] / values[:, 5], np.inf)
    return conditions


def _about(axis: int, angles: Array) -> Array:
    """Return rotations about one of the axes, (N, 3, 3)."""
    euler = np.zeros((len(angles), 3))
    euler[:, axis] = angles
    return from_euler(euler)


def _listed(values: Array) -> str:
    return '[' + ', '.join(f'{value:.3g}' for value in values) + ']'
