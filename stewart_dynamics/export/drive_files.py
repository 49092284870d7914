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
    if parameters['drive.screw_rotation'] != GUIDED:
        raise ParameterError(
            f'drive.screw_rotation: {parameters["drive.screw_rotation"]}: must be {GUIDED} for '
            '--drives: the angle of a motor depends on the pose; use ~/motor_states')
    found = [Amplifier(*row) for row in zip(
        parameters['joints'], motor_ratio(parameters).tolist(), *(
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
    return {f'{name}_drives.h': header, f'{name}_drives.md': _page(parameters, found, name),
            **{f'{name}_ethercat_{n + 1}.yaml': _slave(each) for n, each in enumerate(found)}}


_SLAVE = '''\
# {leg}: an EtherCAT drive (CiA 402) in cyclic synchronous position mode with torque offset, for
# ethercat_driver_ros2 (plugin ethercat_generic_plugins/EcCiA402Drive). Written by stewart_export
# {version}. Commands are position [m], velocity [m/s] and effort [N] of the joint, + extends.
# Fill in what your drive's manual says: vendor, product, the indices of its PDOs.
vendor_id: 0x00000000
product_id: 0x00000000
assign_activate: 0x0300  # distributed clocks
auto_fault_reset: false  # a fault is acknowledged by a person
auto_state_transitions: true
sdo:
- {{index: 0x6060, sub_index: 0, type: int8, value: 8}}  # cyclic synchronous position
rpdo:
- index: 0x1600
  channels:
  - {{index: 0x6040, sub_index: 0, type: uint16, default: 0}}  # control word
  - {{index: 0x607a, sub_index: 0, type: int32, command_interface: position, default: .nan,
     factor: {counts!r}}}  # increments for a metre
  - {{index: 0x60b1, sub_index: 0, type: int32, command_interface: velocity, default: 0,
     factor: {counts!r}}}  # increments/s for 1 m/s
  - {{index: 0x60b2, sub_index: 0, type: int16, command_interface: effort, default: 0,
     factor: {per_mille!r}}}  # per mille of {rated:g} N m for 1 N
tpdo:
- index: 0x1a00
  channels:
  - {{index: 0x6041, sub_index: 0, type: uint16}}  # status word
  - {{index: 0x6064, sub_index: 0, type: int32, state_interface: position,
     factor: {metres!r}}}
  - {{index: 0x606c, sub_index: 0, type: int32, state_interface: velocity,
     factor: {metres!r}}}
  - {{index: 0x6077, sub_index: 0, type: int16, state_interface: effort,
     factor: {newtons!r}}}
sm:
- {{index: 0, type: output, pdo: ~, watchdog: disable}}
- {{index: 1, type: input, pdo: ~, watchdog: disable}}
- {{index: 2, type: output, pdo: rpdo, watchdog: enable}}
- {{index: 3, type: input, pdo: tpdo, watchdog: disable}}
'''


def _slave(each: Amplifier) -> str:
    return _SLAVE.format(
        leg=each.leg, version=__version__, counts=each.counts_per_metre,
        per_mille=each.per_mille_per_newton, rated=each.rated_torque,
        metres=1.0 / each.counts_per_metre, newtons=1.0 / each.per_mille_per_newton)


_PAGE = '''\
# Drives of {name}

Written by stewart_export {version} from `drive.*`. Inputs are positions [m], rates [m/s] and forces [N] of the legs, or torques
[N m] of the motors (`~/motor_torques`), + extends; the numbers below have the amplifier's direction.

| leg | direction | motor turns for 1 m | increments for 1 m | torque for 1 kN, ideal screw [N m] | 60B2h for 1 kN [per mille] | 60B2h for 1 N m |
| --- | --- | --- | --- | --- | --- | --- |
{rows}

| amplifier | position | torque |
| --- | --- | --- |
| EtherCAT, CiA 402, mode 8 (CSP) | 607Ah, increments; 60B1h velocity offset | 60B2h torque offset, per mille of 6076h: `{name}_per_mille`; `{name}_ethercat_1.yaml` .. `_6.yaml` for ethercat_driver_ros2 |
| CANopen, CiA 402, mode 8 | the same objects; map 607Ah (32 bits), 60B1h (32 bits) and 60B2h (16 bits) into RPDOs with SYNC (80 bits: two RPDOs) | the same |
| moteus | `position`, turns of the motor where `motor_position.rotor_to_output_ratio` is 1: `{name}_turns` | `feedforward_torque` [N m]: `{name}_torque` |
| ODrive | `Input_Pos`, turns: `{name}_turns` | `Torque_FF` of Set_Input_Pos, 0.001 N m: `{name}_odrive_torque` |

- Torques of `~/motor_torques` have the losses of screw and gear; forces of `~/leg_forces` divided by the ratio have not.
- If the amplifier has a feed-forward of its own for its rotor, leave one of both out: set `drive.motor_inertia` and `actuator.reflected_mass` to zero here, or that feed-forward.
- An offset is no limit: set the amplifier's torque limit (6072h) to `drive.torque_max`.
- Try the sign before anything carries a load: with the brake on, 60B2h of {small} per mille must press in the direction that extends
  the leg, and 6077h must show it with the same sign.
- Positions are zero where `~/leg_states` is zero; add the amplifier's offset of home (607Ch), see homing.
'''


def _page(parameters: Parameters, found: list[Amplifier], name: str) -> str:
    rows = '\n'.join(
        f'| {each.leg} | {each.direction:+g} | {each.ratio / (2.0 * math.pi):.8g} | '
        f'{each.counts_per_metre:.8g} | {1e3 / each.ratio:.6g} | '
        f'{1e3 * each.per_mille_per_newton:.6g} | '
        f'{each.direction * 1e3 / each.rated_torque:.6g} |' for each in found)
    return _PAGE.format(name=name, version=__version__, rows=rows, small=20)
