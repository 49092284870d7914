# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The parameters of a reference motion, and of the node stewart_trajectory that publishes it.

Separate from the motion itself, so that ``--help`` and the check of a file need no compiler.
"""

from __future__ import annotations

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.parameters.parameter_set import declare, ParameterGroup, ParameterSet
from stewart_dynamics.parameters.table import COMBINED, PARAMETERS, Parameters, SEPARATE

_POSE = 'X Y Z alpha beta gamma'
# Largest number of periods of the highest frequency in that of motion.response.
_MOST_HARMONICS = 2000


class FourierGroup(ParameterGroup):
    """A Fourier series about the initial pose."""

    frequency: float = declare(
        'base frequency: the series repeats after 1 / frequency', 'Hz', 0.1, minimum=1e-6,
        maximum=1e3)
    cosine: Array | None = declare(
        f'coefficients of cos(2 pi k frequency t): six for {_POSE}, for k = 1 to n one after the '
        'other; zero if not set', 'm, rad', (), sizes=(6,), repeated=True)
    sine: Array | None = declare(
        'coefficients of sin(2 pi k frequency t), likewise', 'm, rad', (), sizes=(6,),
        repeated=True)
    fade: float = declare(
        'time in which the series fades in from rest at the start, and without loop fades out to '
        'rest at the end', 's', 1.0, minimum=0.0, above=True, maximum=86400.0)


class ResponseGroup(ParameterGroup):
    """A motion from which the response of the hexapod is computed."""

    params_file: str = declare(
        'parameter file of the hexapod, within whose limits the amplitudes are; empty: they are '
        'motion.amplitude', default='')
    part: float = declare(
        'part of the largest amplitude of each axis, at which a length, rate, force or another '
        'limit of the hexapod would be reached', default=0.1, minimum=1e-3, maximum=0.9)
    highest_frequency: float = declare(
        'highest frequency that is excited; the lowest is 1 / period', 'Hz', 10.0, minimum=1e-3,
        maximum=1e3)
    period: float = declare(
        'period of the multisine of each axis', 's', 10.0, minimum=0.1, maximum=3600.0)
    periods: float = declare(
        'periods of each axis that are analyzed, a whole number; before them is one in which the '
        'motion fades in and settles', default=3.0, minimum=2.0, maximum=1e3)


class MotionGroup(ParameterGroup):
    """The motion."""

    type: str = declare(
        'paper: from initial to final, each coordinate as a half cosine; quintic: on the straight '
        'line and about one axis; sine: about initial; fourier: Fourier series about initial, at '
        'rest at both ends; response: about initial, one axis after the other, for '
        'stewart_replay --response; hold: at initial', default='paper',
        choices=('paper', 'quintic', 'sine', 'fourier', 'response', 'hold'))
    duration: float = declare(
        'duration of the motion, one way; response has its own', 's', 10.0, minimum=0.0,
        maximum=86400.0, above=True)
    hold_at_end: bool = declare(
        'without loop, go on with setpoints at rest in the final pose until stopped; false: exit '
        'after the motion', default=True)
    initial: Array = declare(
        f'{_POSE} at the start; the center of sine, fourier and response', 'm, rad',
        required=True, sizes=(6,))
    final: Array | None = declare(
        f'{_POSE} at the end; required for paper and quintic', 'm, rad', sizes=(6,))
    amplitude: Array = declare(
        f'of {_POSE}; sine, and response without params_file', 'm, rad', (0.0,) * 6, sizes=(6,))
    frequency: Array = declare(
        f'of {_POSE}, or one for all; sine only', 'Hz', (0.5,), sizes=(1, 6), minimum=0.0,
        maximum=1e3)
    phase: Array = declare(f'of {_POSE}; sine only', 'rad', (0.0,) * 6, sizes=(6,))
    fourier: FourierGroup
    response: ResponseGroup


class ReferenceMotionParameters(ParameterSet):
    """A reference motion, and how it is published."""

    target: str = declare(
        'node that receives the setpoints, on <target>/setpoint/...', default=Parameters.node)
    base_frame: str = declare(
        'frame of the setpoints', default=PARAMETERS['base_frame'].default)
    output: str = declare(
        'pose, twist and accel on three topics, or combined in one message', default=SEPARATE,
        choices=(SEPARATE, COMBINED))
    rate: float = declare('rate of the setpoints', 'Hz', 100.0, minimum=1e-3, maximum=1e4)
    start_timeout: float = declare(
        'the motion starts half a second after all its topics have subscribers, at the latest '
        'after this time; with use_sim_time never before', 's', 5.0, minimum=0.0, maximum=86400.0)
    loop: bool = declare(
        'repeat until stopped: paper and quintic back and forth; sine, fourier and hold without '
        'end', default=False)
    motion: MotionGroup

    node = 'stewart_trajectory'

    def _check_together(self, source: str) -> None:
        """Check the rules between parameters."""
        if self.motion.type in ('paper', 'quintic') and self.motion.final is None:
            raise ParameterError(f'{source}: motion.final: missing, motion.type '
                                 f'{self.motion.type} needs it')
        if self.motion.type == 'fourier':
            self._check_series(source)
        if self.motion.type == 'response':
            self._check_response(source)

    def _check_series(self, source: str) -> None:
        """Check the rules of a Fourier series."""
        cosine, sine = self.motion.fourier.cosine, self.motion.fourier.sine
        if cosine is None and sine is None:
            raise ParameterError(f'{source}: motion.fourier.cosine, motion.fourier.sine: missing, '
                                 'motion.type fourier needs one of them')
        if cosine is not None and sine is not None and len(cosine) != len(sine):
            raise ParameterError(
                f'{source}: motion.fourier.sine: {sine.size} entries: must be as many as of '
                f'motion.fourier.cosine, {cosine.size}')
        fade, most = self.motion.fourier.fade, self.motion.duration / 2.0
        if not self.loop and fade > most:
            raise ParameterError(f'{source}: motion.fourier.fade: {fade} s: must be at most half '
                                 f'of motion.duration, {most:g} s')

    def _check_response(self, source: str) -> None:
        """Check the rules of the motion response."""
        given = self.motion.response.params_file
        if bool(given) == bool(self.motion.amplitude.any()):
            raise ParameterError(
                f'{source}: motion.response.params_file, motion.amplitude: '
                f'{"both given" if given else "missing"}: motion.type response needs one of them')
        periods = self.motion.response.periods
        if periods != round(periods):
            raise ParameterError(
                f'{source}: motion.response.periods: {periods}: must be a whole number')
        period, highest = (
            self[f'motion.response.{name}'] for name in ('period', 'highest_frequency'))
        if highest * period < 2.0 or highest * period > _MOST_HARMONICS:
            raise ParameterError(
                f'{source}: motion.response.highest_frequency: {highest} Hz: times '
                f'motion.response.period, {period} s, must be at least 2, at most '
                f'{_MOST_HARMONICS}')
        if highest > self.rate / 4.0:
            raise ParameterError(
                f'{source}: motion.response.highest_frequency: {highest} Hz: must be at most a '
                f'quarter of rate, {self.rate / 4.0:g} Hz')
        samples = period * self.rate
        if abs(samples - round(samples)) > 1e-6 * samples:
            raise ParameterError(
                f'{source}: motion.response.period: {period} s: times rate, {self.rate} Hz, '
                'must be a whole number, so that the periods are equal')
