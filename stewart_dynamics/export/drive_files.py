# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Files for the amplifiers of the motors, from ``drive.*``: units, signs and scales.

A C header for hardware interfaces, a page with the numbers of each leg, and the configuration of
each EtherCAT slave for ethercat_driver_ros2, whose channels write ``factor * value + offset`` in
a cast to an integer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
import re
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics import __version__
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.export.c_project import source
from stewart_dynamics.legs import require_kind
from stewart_dynamics.mechanics.drives.motors import motor_ratio
from stewart_dynamics.parameters.table import GUIDED, Parameters

_NEEDED = 'actuator.screw_lead', 'drive.rated_torque', 'drive.counts_per_turn'
_BITS_16, _BITS_32 = 2.0 ** 15 - 1.0, 2.0 ** 31 - 1.0  # largest integers on a bus
_ODRIVE = 0.001  # of a turn/s, the unit of Vel_FF unless input_vel_scale is changed
# Positions are read and written back by two factors: this much more than the reciprocal covers
# their rounding, so that the cast gives the same increment.
_COVERED = 1.0 + 2.0 ** -50


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
        length, or a torque, position or rate within the limits does not fit into the integers of
        the bus.
    """
    require_kind(parameters, '--drives')
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
    _check_torques(parameters, found)
    _check_increments(parameters, found)
    return found


def _check_torques(parameters: Parameters, found: list[Amplifier]) -> None:
    """Raise ParameterError if a torque within the limits does not fit into 60B2h."""
    per_mille_per_newton = [abs(each.per_mille_per_newton) for each in found]
    per_mille = [1e3 / each.rated_torque for each in found]
    _check_fits(parameters, 'per mille of torque', '60B2h', _BITS_16, (
        ('limits.force_max', 'N', 0.0, per_mille_per_newton),
        ('drive.torque_max', 'N m', 0.0, per_mille)), lambda leg, factor: (
            'set drive.rated_torque, 6076h of the amplifier, to at least '
            f'{1.001 * factor * found[leg].rated_torque:.4g} N m'))


def _check_increments(parameters: Parameters, found: list[Amplifier]) -> None:
    """Raise ParameterError if a position or rate within the limits does not fit into 32 bits."""
    per_metre = np.abs([each.counts_per_metre for each in found])
    per_radian = [each.counts_per_turn / (2.0 * math.pi) for each in found]
    zero, least, most = (parameters[name] for name in (
        'geometry.zero_length', 'limits.length_min', 'limits.length_max'))

    def fewer(leg: int, factor: float) -> str:
        return ('set fewer increments of a turn in the amplifier, drive.counts_per_turn of at '
                f'most {math.floor(found[leg].counts_per_turn / factor)}')

    def fewer_or_centred(leg: int, factor: float) -> str:
        if least is None or most is None or np.any(per_metre * (most - least) > 2.0 * _BITS_32):
            return fewer(leg, factor)
        return (f'{fewer(leg, factor)}, or geometry.zero_length in the middle of the stroke, '
                f'{(least[leg] + most[leg]) / 2.0:.6g} m')

    _check_fits(parameters, 'increments of position', '607Ah', _BITS_32, (
        ('limits.length_min', 'm', zero, per_metre),
        ('limits.length_max', 'm', zero, per_metre)), fewer_or_centred)
    _check_fits(parameters, 'increments/s', '60B1h', _BITS_32, (
        ('limits.velocity_max', 'm/s', 0.0, per_metre),
        ('drive.speed_max', 'rad/s', 0.0, per_radian)), fewer)


def _check_fits(parameters: Parameters, of: str, index: str, largest: float,
                limits: Sequence[tuple[str, str, ArrayLike, ArrayLike]],
                cure: Callable[[int, float], str]) -> None:
    """
    Raise ParameterError for the limit that exceeds the largest integer of an object most.

    limits: name, unit, the value that becomes 0, and the integers for 1 of its unit; each of one
        value or six.
    cure: words for a leg, and by how many times the largest integer is exceeded.
    """
    raw = {(limit, unit): np.abs(parameters[limit] - zero) * np.asarray(scale)
           for limit, unit, zero, scale in limits if parameters[limit] is not None}
    if not raw:
        return
    (limit, unit), integers = max(raw.items(), key=lambda item: float(np.max(item[1])))
    leg = int(np.argmax(integers))
    if integers[leg] > largest:
        raise ParameterError(
            f'{limit}: {parameters[limit][leg]:g} {unit}: leg {leg + 1} needs '
            f'{np.ceil(integers[leg]):.0f} {of}, but {index} has at most {largest:.0f}: '
            f'{cure(leg, integers[leg] / largest)}')


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
        metres=_COVERED / each.counts_per_metre, newtons=1.0 / each.per_mille_per_newton,
        range=_BITS_32 / abs(each.counts_per_metre))


def _page(found: list[Amplifier], name: str) -> str:
    rows = '\n'.join(
        f'| {each.leg} | {each.direction:+g} | {each.ratio / (2.0 * math.pi):.8g} | '
        f'{each.counts_per_metre:.8g} | {_BITS_32 / abs(each.counts_per_metre):.4g} | '
        f'{1e3 / each.ratio:.6g} | {1e3 * each.per_mille_per_newton:.6g} | '
        f'{each.direction * 1e3 / each.rated_torque:.6g} |' for each in found)
    fastest = min(_BITS_16 * _ODRIVE * 2.0 * math.pi / each.ratio for each in found)
    return source('drives.md.in').format(
        name=name, version=__version__, rows=rows, turns=_BITS_16 * _ODRIVE, fastest=fastest)
