# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Files for the amplifiers of the motors, from ``drive.*``: units, signs and scales.

A C header for hardware interfaces, a page with the numbers of each leg, and the configuration of
each EtherCAT slave for ethercat_driver_ros2, whose channels write ``factor * value + offset``.
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple

import numpy as np

from stewart_dynamics import __version__
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.export.c_project import source
from stewart_dynamics.mechanics.drives.motors import motor_ratio
from stewart_dynamics.parameters.table import GUIDED, Parameters

_NEEDED = 'actuator.screw_lead', 'drive.rated_torque', 'drive.counts_per_turn'
_LARGEST = 32767.0  # of a torque offset [per mille]


class Amplifier(NamedTuple):
    """The units of a leg's amplifier."""

    leg: str
    ratio: float  # turn of the motor for a metre of the leg [rad/m]
    rated_torque: float  # 1000 per mille [N m]
    counts_per_turn: float
    direction: float  # 1 or -1

    @property
    def counts_per_metre(self) -> float:
        """Return the increments of position for a metre of the leg."""
        return self.direction * self.ratio / (2.0 * math.pi) * self.counts_per_turn

    @property
    def per_mille_per_newton(self) -> float:
        """Return the torque offset for a force of 1 N, by an ideal screw."""
        return self.direction * 1e3 / (self.ratio * self.rated_torque)


def amplifiers(parameters: Parameters) -> list[Amplifier]:
    """
    Return the amplifiers of the six legs.

    Raises ParameterError: a parameter is missing, the motor's angle is not linear in the leg's
        length, or a torque within the limits does not fit into 16 bits.
    """
    missing = [name for name in _NEEDED if parameters[name] is None]
    if missing:
        raise ParameterError(f'{", ".join(missing)}: not set: needed by --drives')
    if parameters.drive.screw_rotation != GUIDED:
        raise ParameterError(
            f'drive.screw_rotation: {parameters.drive.screw_rotation}: must be {GUIDED} for '
            '--drives: the angle of a motor depends on the pose; use ~/motor_states')
    found = [Amplifier(*row) for row in zip(
        parameters.joints, motor_ratio(parameters).tolist(), *(
            parameters[f'drive.{name}'].tolist()
            for name in ('rated_torque', 'counts_per_turn', 'direction')), strict=True)]
    for name, unit, per_mille in (
            ('limits.force_max', 'N', [abs(each.per_mille_per_newton) for each in found]),
            ('drive.torque_max', 'N m', [1e3 / each.rated_torque for each in found])):
        most = parameters[name]
        if most is not None and np.any(most * per_mille > _LARGEST):
            leg = int(np.argmax(most * per_mille))
            raise ParameterError(
                f'{name}: {most[leg]:g} {unit}: {most[leg] * per_mille[leg]:.6g} per mille of '
                f'drive.rated_torque, {found[leg].rated_torque:g} N m: a torque offset has at '
                f'most {_LARGEST:g}')
    return found


def drive_files(parameters: Parameters, name: str) -> dict[str, str | bytes]:
    """Return the files by their names; ``name`` is that of the hexapod in C."""
    found = amplifiers(parameters)
    rows = ',\n'.join('  {' + ', '.join(repr(value) for value in (
        each.ratio / (2.0 * math.pi), each.ratio, each.rated_torque, each.counts_per_turn,
        each.direction)) + '}' for each in found)
    texts = {'@NAME@': name, '@GUARD@': name.upper(), '@ROWS@': rows, '@VERSION@': __version__}
    header = re.sub('@[A-Z]+@', lambda at: texts[at[0]], source('drives.h.in'))
    return {f'{name}_drives.h': header, f'{name}_drives.md': _page(found, name),
            **{f'{name}_ethercat_{n + 1}.yaml': _slave(each) for n, each in enumerate(found)}}


def _slave(each: Amplifier) -> str:
    return source('ethercat.yaml.in').format(
        leg=each.leg, version=__version__, counts=each.counts_per_metre,
        per_mille=each.per_mille_per_newton, rated=each.rated_torque,
        metres=1.0 / each.counts_per_metre, newtons=1.0 / each.per_mille_per_newton)


def _page(found: list[Amplifier], name: str) -> str:
    rows = '\n'.join(
        f'| {each.leg} | {each.direction:+g} | {each.ratio / (2.0 * math.pi):.8g} | '
        f'{each.counts_per_metre:.8g} | {1e3 / each.ratio:.6g} | '
        f'{1e3 * each.per_mille_per_newton:.6g} | '
        f'{each.direction * 1e3 / each.rated_torque:.6g} |' for each in found)
    return source('drives.md.in').format(name=name, version=__version__, rows=rows)
