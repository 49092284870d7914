# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The parameters of a reference motion, and of the node stewart_trajectory that publishes it.

Separate from the motion itself, so that ``--help`` and the check of a file need no compiler.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from stewart_dynamics.errors import ParameterError
from stewart_dynamics.parameters.parameter_set import Parameter, ParameterSet
from stewart_dynamics.parameters.table import COMBINED, PARAMETERS, Parameters, SEPARATE

_POSE = 'X Y Z alpha beta gamma'

REFERENCE_MOTION_PARAMETERS: Mapping[str, Parameter] = MappingProxyType({p.name: p for p in (
    Parameter('target', 'string', 'node that receives the setpoints, on <target>/setpoint/...',
              default=Parameters.node),
    Parameter('base_frame', 'string', 'frame of the setpoints',
              default=PARAMETERS['base_frame'].default),
    Parameter('output', 'string', 'pose, twist and accel on three topics, or combined in one '
              'message', default=SEPARATE, choices=(SEPARATE, COMBINED)),
    Parameter('rate', 'double', 'rate of the setpoints', 'Hz', 100.0, minimum=1e-3, maximum=1e4),
    Parameter('start_timeout', 'double', 'the motion starts half a second after all its topics '
              'have subscribers, at the latest after this time', 's', 5.0, minimum=0.0,
              maximum=86400.0),
    Parameter('loop', 'bool', 'repeat until stopped: paper and quintic back and forth; sine, '
              'fourier and hold without end', default=False),
    Parameter('motion.type', 'string', 'paper: from initial to final, each coordinate as a half '
              'cosine; quintic: on the straight line and about one axis; sine: about initial; '
              'fourier: Fourier series about initial, at rest at both ends; hold: at initial',
              default='paper', choices=('paper', 'quintic', 'sine', 'fourier', 'hold')),
    Parameter('motion.duration', 'double', 'duration of the motion, one way', 's', 10.0,
              minimum=0.0, maximum=86400.0, above=True),
    Parameter('motion.hold_at_end', 'bool', 'without loop, go on with setpoints at rest in the '
              'final pose until stopped; false: exit after the motion', default=True),
    Parameter('motion.initial', 'double', f'{_POSE} at the start; the center of sine and '
              'fourier', 'm, rad', required=True, sizes=(6,)),
    Parameter('motion.final', 'double', f'{_POSE} at the end; required for paper and quintic',
              'm, rad', sizes=(6,)),
    Parameter('motion.amplitude', 'double', f'of {_POSE}; sine only', 'm, rad', (0.0,) * 6,
              sizes=(6,)),
    Parameter('motion.frequency', 'double', f'of {_POSE}, or one for all; sine only', 'Hz',
              (0.5,), sizes=(1, 6), minimum=0.0, maximum=1e3),
    Parameter('motion.phase', 'double', f'of {_POSE}; sine only', 'rad', (0.0,) * 6, sizes=(6,)),
    Parameter('motion.fourier.frequency', 'double', 'base frequency: the series repeats after '
              '1 / frequency', 'Hz', 0.1, minimum=1e-6, maximum=1e3),
    Parameter('motion.fourier.cosine', 'double', f'coefficients of cos(2 pi k frequency t): six '
              f'for {_POSE}, for k = 1 to n one after the other; zero if not set', 'm, rad', (),
              sizes=(6,), repeated=True),
    Parameter('motion.fourier.sine', 'double', 'coefficients of sin(2 pi k frequency t), likewise',
              'm, rad', (), sizes=(6,), repeated=True),
    Parameter('motion.fourier.fade', 'double', 'time in which the series fades in from rest at '
              'the start, and without loop fades out to rest at the end', 's', 1.0, minimum=0.0,
              above=True, maximum=86400.0),
)})


class ReferenceMotionParameters(ParameterSet):
    """A reference motion, and how it is published."""

    table = REFERENCE_MOTION_PARAMETERS
    node = 'stewart_trajectory'

    def _check_together(self, source: str) -> None:
        """Check the rules between parameters."""
        if self['motion.type'] in ('paper', 'quintic') and self['motion.final'] is None:
            raise ParameterError(f'{source}: motion.final: missing, motion.type '
                                 f'{self["motion.type"]} needs it')
        if self['motion.type'] == 'fourier':
            self._check_series(source)

    def _check_series(self, source: str) -> None:
        """Check the rules of a Fourier series."""
        cosine, sine = self['motion.fourier.cosine'], self['motion.fourier.sine']
        if cosine is None and sine is None:
            raise ParameterError(f'{source}: motion.fourier.cosine, motion.fourier.sine: missing, '
                                 'motion.type fourier needs one of them')
        if cosine is not None and sine is not None and len(cosine) != len(sine):
            raise ParameterError(
                f'{source}: motion.fourier.sine: {sine.size} entries: must be as many as of '
                f'motion.fourier.cosine, {cosine.size}')
        fade, most = self['motion.fourier.fade'], self['motion.duration'] / 2.0
        if not self['loop'] and fade > most:
            raise ParameterError(f'{source}: motion.fourier.fade: {fade} s: must be at most half '
                                 f'of motion.duration, {most:g} s')
