# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The parameters of the simulator: those of the hexapod, and its own.

Apart from the plant itself, so that ``--help`` and the check of a file need no compiler.
"""

from __future__ import annotations

import math
from types import MappingProxyType

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.legs import KINDS
from stewart_dynamics.mechanics.limits import LEVER_MIN, LIMITS
from stewart_dynamics.parameters.parameter_set import declare, ParameterGroup
from stewart_dynamics.parameters.table import PARAMETERS, Parameters

_POSE = 'X Y Z alpha beta gamma'

TORQUE = 'torque'  # of the motors; the other values of commands are efforts of kinds of legs
COMMANDS = (*(kind.simulated for kind in KINDS), TORQUE)


class EndStopsGroup(ParameterGroup):
    """End stops of the legs."""

    frequency: float = declare(
        'natural frequency of a drive on its end stop, with its reflected mass or inertia, and a '
        'sixth of the platform and of the parts that move with it, at the largest lever', 'Hz',
        30.0, minimum=0.0, above=True)
    damping_ratio: float = declare(
        'damping ratio of the same; 1: no rebound', '', 0.5, minimum=0.0)


class NoiseGroup(ParameterGroup):
    """Noise of the measured legs."""

    length: float = declare(
        'standard deviation of the measured lengths', 'm', 0.0, minimum=0.0, maximum=1e9)
    rate: float = declare(
        'standard deviation of the measured rates', 'm/s', 0.0, minimum=0.0, maximum=1e9)
    force: float = declare(
        'standard deviation of the measured forces', 'N', 0.0, minimum=0.0, maximum=1e9)
    angle: float = declare(
        'standard deviation of the measured angles', 'rad', 0.0, minimum=0.0, maximum=1e9)
    speed: float = declare(
        'standard deviation of the measured speeds', 'rad/s', 0.0, minimum=0.0, maximum=1e9)
    torque: float = declare(
        'standard deviation of the measured torques', 'N m', 0.0, minimum=0.0, maximum=1e9)
    seed: float = declare('seed of the noise: equal seeds give equal noise', '', 0.0)


class SeaGroup(ParameterGroup):
    """A ship in a seaway."""

    wave_height: float = declare(
        'significant wave height of the Bretschneider spectrum', 'm', 2.0, minimum=0.0,
        maximum=100.0)
    peak_period: float = declare('period of its peak', 's', 10.0, minimum=0.1, maximum=1e3)
    response: Array = declare(
        f'amplitude of {_POSE} for a wave of amplitude 1 m', 'm/m, rad/m', (0.0,) * 6, sizes=(6,),
        minimum=-1e3, maximum=1e3)
    seed: float = declare('seed of the waves: equal seeds give equal motion', '', 0.0)


class BaseMotionGroup(ParameterGroup):
    """How the simulated base moves."""

    source: str = declare(
        'how the base moves: not at all, as ~/base/pose, twist and accel give it, by a sine on '
        'each axis, or as a ship in a seaway', '', 'fixed',
        choices=('fixed', 'topics', 'sine', 'sea'))
    center: Array = declare(
        f'{_POSE} in the world at rest, about which sine and sea move', 'm, rad', (0.0,) * 6,
        sizes=(6,), minimum=-1e6, maximum=1e6)
    lever_arm: Array = declare(
        'position of the base frame from the point that sine or sea move, as the center of '
        'gravity of a ship; base axes', 'm', (0.0, 0.0, 0.0), sizes=(3,), minimum=-1e6,
        maximum=1e6)
    ramp: float = declare(
        'time in which sine and sea grow from rest, from the first command on', 's', 5.0,
        minimum=0.0, maximum=1e6)
    amplitude: Array = declare(
        f'of {_POSE}: surge, sway, heave, roll, pitch, yaw; sine only', 'm, rad', (0.0,) * 6,
        sizes=(6,), minimum=-1e4, maximum=1e4)
    frequency: Array = declare(
        f'of {_POSE}, or one for all; sine only', 'Hz', (0.1,), sizes=(1, 6), minimum=0.0,
        maximum=100.0)
    phase: Array = declare(
        f'of {_POSE}; sea: relative to the wave', 'rad', (0.0,) * 6, sizes=(6,), minimum=-1e3,
        maximum=1e3)
    sea: SeaGroup


class ImuNoiseGroup(ParameterGroup):
    """Noise of the simulated IMU."""

    specific_force: float = declare(
        'standard deviation of each reading', 'm/s^2', 0.0, minimum=0.0, maximum=1e6)
    angular_velocity: float = declare(
        'standard deviation of each reading', 'rad/s', 0.0, minimum=0.0, maximum=1e6)


class ImuBiasGroup(ParameterGroup):
    """Constant errors of the simulated IMU."""

    specific_force: Array = declare(
        'constant error of the readings, IMU axes', 'm/s^2', (0.0, 0.0, 0.0), sizes=(3,),
        minimum=-1e6, maximum=1e6)
    angular_velocity: Array = declare(
        'constant error of the readings, IMU axes', 'rad/s', (0.0, 0.0, 0.0), sizes=(3,),
        minimum=-1e6, maximum=1e6)


class SimulatedImuGroup(ParameterGroup):
    """The simulated IMU on the base."""

    rate: float = declare(
        'rate of ~/imu where the base moves; rate is a whole multiple of it. The IMU is mounted '
        'as base.imu.position and .orientation say', 'Hz', 250.0, minimum=0.0, above=True,
        maximum=1e4)
    noise: ImuNoiseGroup
    bias: ImuBiasGroup


# Limits that commands saturate at, or that have end stops.
_OF_THE_PLANT = {LEVER_MIN, *(name for kind in KINDS for name in (
    *kind.position_limits, kind.effort_limit))}
# Beginnings of names.
_OF_THE_NODE = ('autostart', 'cueing.', 'drive.resistance', 'drive.speed_max',
                'drive.temperature_rise_max', 'drive.thermal_', 'drive.torque_constant',
                'drive.torque_continuous', 'external_wrench.', 'geometry.base_joint_axes',
                'geometry.platform_joint_axes', 'joint_states.', 'legs.cylinder.length',
                'legs.cylinder.radius',
                'legs.piston.radius', 'meshes.', *(
                    name for name in LIMITS if name.startswith('limits.')
                    and name not in _OF_THE_PLANT),
                'platform_frame', 'publish_tf', 'setpoint.', 'singularity.', 'trajectory.',
                'visualization_rate')


class SimulatorParameters(Parameters):
    """The parameters of the simulated hexapod, and of the simulation."""

    initial_pose: Array = declare(
        'X Y Z alpha beta gamma, where the brakes hold the platform until the first command',
        'm, rad', required=True, sizes=(6,))
    step: float = declare(
        'step of the integration; smaller where friction or end stops need it', 's', 1e-3,
        minimum=1e-5, maximum=1e-3)
    rate: float = declare(
        'rate of the published states; a period is a whole number of steps. With use_sim_time '
        'each command advances time by one period', 'Hz', 500.0, minimum=1.0, maximum=1e4)
    command_timeout: float | None = declare(
        'time without a command after which the brakes engage, as those of a drive; they release '
        'with the next command; if not set, the last command is held', 's', minimum=0.0,
        maximum=1e6, above=True)
    commands: str = declare(
        'quantity on ~/commands: forces of the legs [N] or, where legs are turned, their torques '
        '[N m], leg_torque by default; or torques of the motors [N m], with drive.*', '',
        COMMANDS[0], choices=COMMANDS)
    end_stops: EndStopsGroup
    noise: NoiseGroup
    base_motion: BaseMotionGroup
    imu: SimulatedImuGroup

    node = 'stewart_simulator'
    unused = frozenset(name for name in PARAMETERS if name.startswith(_OF_THE_NODE))

    def _check_together(self, source: str) -> None:
        """Check what one parameter demands of another."""
        super()._check_together(source)
        kind = self.leg_kind
        if 'commands' not in self.given:
            self._complete('commands', kind.simulated)
        if self.commands not in (kind.simulated, TORQUE):
            raise ParameterError(f'{source}: commands: {self.commands}: must be {kind.simulated} '
                                 f'or {TORQUE}: the drives of the legs have a {kind.effort.name}')
        if self.commands == TORQUE:
            if not self.drives:
                raise ParameterError(f'{source}: commands: {TORQUE}: needs drive.*')
            least = self.drive.back_driving_efficiency.min()
            if least <= 0.0:
                raise ParameterError(
                    f'{source}: commands: {TORQUE}: drive.back_driving_efficiency {least:.3g}: '
                    f'a self-locking {kind.gear} can be simulated with commanded '
                    f'{kind.effort.field} only')
        steps = 1.0 / (self.rate * self.step)
        if not _is_whole(steps):
            raise ParameterError(
                f'{source}: rate: {self.rate} Hz: a period must be a whole number of steps of '
                f'{self.step:g} s, not {steps:.6g}')
        periods = self.rate / self.imu.rate
        if self.base_motion.source != 'fixed' and not _is_whole(periods):
            raise ParameterError(
                f'{source}: imu.rate: {self.imu.rate} Hz: rate, {self.rate:g} Hz, must be a '
                f'whole multiple of it, not {periods:.6g}')


# The node has no lifecycle: none of the hexapod's may change while it runs either.
SimulatorParameters.table = MappingProxyType({
    name: known._replace(while_active=False) for name, known in SimulatorParameters.table.items()})


def _is_whole(ratio: float) -> bool:
    return round(ratio) >= 1 and math.isclose(ratio, round(ratio), rel_tol=1e-9)
