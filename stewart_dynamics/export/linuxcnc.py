# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A hexapod for genhexkins, the kinematics of LinuxCNC for hexapods: HAL lines, in mm and degrees.

A, B and C of LinuxCNC are the angles alpha, beta and gamma of ``Motion.from_euler`` in degrees:
rotation z(C) y(B) x(A). A joint is the length of its leg; where screws turn with their legs it is
the coordinate of the drive, see ``mechanics.drives.turning_screws``.
"""

from __future__ import annotations

from collections.abc import Iterator
import math

import numpy as np

from stewart_dynamics import __version__
from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.export.c_project import in_comment
from stewart_dynamics.legs import require_kind
from stewart_dynamics.mechanics.drives.motors import motor_ratio
from stewart_dynamics.mechanics.drives.turning_screws import universal_axes
from stewart_dynamics.mechanics.frames.motion import Motion, Pose
from stewart_dynamics.mechanics.frames.rotation import to_euler
from stewart_dynamics.mechanics.kinematics.home_pose import home_pose
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import Parameters, RIGHT, UNIVERSAL

_MM = 1e3  # of a metre
# Its iteration takes a small rotation for changes of A, B and C: it finds no pose far from C = 0.
_FARTHEST = math.radians(45.0)


def hal_lines(parameters: Parameters) -> str:
    """
    Return the HAL file of a hexapod.

    Raises ParameterError: screws turn with their legs, and their leads differ; or at home the
        platform is turned so far about z that genhexkins finds no pose.
    """
    require_kind(parameters, '--linuxcnc: genhexkins has lengths of legs')
    return '\n'.join([*_head(parameters), *_pins(parameters), ''])


def _pins(parameters: Parameters) -> Iterator[str]:
    geometry = parameters.geometry
    yield from _vectors('base', _MM * geometry.base_joints)
    yield from _vectors('platform', _MM * geometry.platform_joints)
    if parameters.drive.screw_rotation != UNIVERSAL:
        yield from ('', '# Screws that do not turn with their legs: no correction.',
                    'setp genhexkins.screw-lead 0')
        return
    leads = parameters['actuator.screw_lead']
    if np.any(leads != leads[0]):
        raise ParameterError(
            f'actuator.screw_lead: {leads.tolist()}: must be equal for --linuxcnc with '
            f'drive.screw_rotation: {UNIVERSAL}: genhexkins has one lead')
    axes = universal_axes(parameters)
    yield from ('', '# Axes of the universal joints that are fixed to the base; and to the '
                'platform, of the other sense.')
    yield from _vectors('base-n', axes[:, :3])
    yield from _vectors('platform-n', -axes[:, 3:])
    right = parameters.drive.screw_hand == RIGHT
    yield f'setp genhexkins.screw-lead {_text(_MM * leads[0] * (1.0 if right else -1.0))}'


def _vectors(name: str, vectors: Array) -> Iterator[str]:
    for leg, vector in enumerate(vectors):
        yield ''
        for axis, value in zip('xyz', vector, strict=True):
            yield f'setp genhexkins.{name}.{leg}.{axis} {_text(value)}'


def _text(value: float) -> str:
    """Return a number of mm with the digits that a double has, without noise below 1e-15 m."""
    return f'{round(value, 12) + 0.0:.15g}'


def _head(parameters: Parameters) -> Iterator[str]:
    """Yield comments: the order of the legs, and lines that belong into the INI file."""
    yield f'# A hexapod for genhexkins of LinuxCNC, written by stewart_export {__version__}.'
    yield f'# Legs in their order: {in_comment(", ".join(parameters.joints))}. For the INI file:'
    yield '#   [KINS] KINEMATICS = genhexkins, JOINTS = 6'
    yield '#   [TRAJ] COORDINATES = X Y Z A B C, LINEAR_UNITS = mm, ANGULAR_UNITS = degree'
    limits, at_home = parameters.limits, None
    if (pose := _home(parameters)) is not None:
        euler = to_euler(pose.rotation)
        if abs(euler[2]) > _FARTHEST:
            raise ParameterError(
                f'{parameters.source}: home pose: C is {math.degrees(euler[2]):.4g} degrees: must '
                f'be within {math.degrees(_FARTHEST):.0f} for --linuxcnc: farther from 0 '
                'genhexkins finds no pose: turn the axes of geometry.platform_joints about z')
        at_home = _joints(StewartPlatform(parameters), pose)
        yield '#   [TRAJ] HOME = ' + ' '.join(
            map(_text, [*_MM * pose.position, *np.degrees(euler)]))
    for leg in range(6):
        of_joint = [f'{name} = {_text(_MM * values[leg])}' for name, values in (
            ('HOME', at_home), ('MIN_LIMIT', limits.length_min),
            ('MAX_LIMIT', limits.length_max), ('MAX_VELOCITY', limits.velocity_max))
            if values is not None]
        if of_joint:
            yield f'#   [JOINT_{leg}] {", ".join(of_joint)}'


def _home(parameters: Parameters) -> Pose | None:
    """Return the home pose; None if the parameters do not give its height."""
    try:
        return home_pose(parameters)
    except ParameterError:
        return None


def _joints(platform: StewartPlatform, pose: Pose) -> Array:
    """Return the joints of genhexkins (6,) [m] at a pose."""
    lengths = platform.inverse_kinematics(pose)
    if not platform.screws.any():
        return lengths
    angles = platform.motors(Motion.from_pose(pose)).angles
    return platform.parameters.geometry.zero_length + angles / motor_ratio(platform.parameters)
