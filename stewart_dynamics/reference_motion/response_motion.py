# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The motion ``response``: a multisine of each axis in turn, to find frequency responses from.

Each axis fades in, settles for the rest of one period, repeats for the periods that are analyzed,
and fades out; then all are at rest. Axes are x y z and rotations about base axes.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.frames import rotation as rotations
from stewart_dynamics.mechanics.frames.motion import listed, Motion, Pose
from stewart_dynamics.mechanics.limits import limits_of
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.reference_motion.multisine import multisine
from stewart_dynamics.reference_motion.quintic import quintic

# Fade in and out, in periods; the time at rest between two axes [s].
_FADE, _REST = 0.5, 2.5
# Samples of a period of the highest frequency with which amplitudes are found.
_SAMPLES = 16
# Amplitude from which the largest one is found, of the characteristic length.
_SMALL = 1e-3


def duration(parameters: ReferenceMotionParameters) -> float:
    """Return the duration of the motion [s]."""
    return float(np.count_nonzero(_amplitudes_of(parameters)) * _time_of_axis(parameters))


def response_motion(parameters: ReferenceMotionParameters, time: Array) -> Motion:
    """Return the motion at times (...) [s] from its start; all derivatives are exact."""
    amplitudes = _amplitudes_of(parameters)
    moving = np.flatnonzero(amplitudes)
    each = _time_of_axis(parameters)
    whole = each * len(moving)
    time = np.mod(time, whole) if parameters.loop else np.clip(time, 0.0, whole)
    number = np.minimum((time // each).astype(np.int64), len(moving) - 1)
    offset, rate, acceleration = _one_axis(parameters, time - number * each)
    axis = moving[number]
    chosen: Flags = np.arange(6) == axis[..., None]
    x, dx, ddx = (np.where(chosen, amplitudes * value[..., None], 0.0)
                  for value in (offset, rate, acceleration))
    return _about(parameters.motion.initial, x, dx, ddx)


def _about(initial: Array, x: Array, dx: Array, ddx: Array) -> Motion:
    """Return the motion of one axis at a time (..., 6) about a pose."""
    start = rotations.from_euler(initial[3:])
    return Motion(initial[:3] + x[..., :3], rotations.from_rotation_vector(x[..., 3:]) @ start,
                  dx[..., :3], dx[..., 3:], ddx[..., :3], ddx[..., 3:])


def _time_of_axis(parameters: ReferenceMotionParameters) -> float:
    """Return the time from the start of one axis to that of the next [s], in whole samples."""
    period, rate = parameters.motion.response.period, parameters.rate
    time = (1.0 + parameters.motion.response.periods + _FADE) * period + _REST
    return float(np.ceil(time * rate - 1e-6) / rate)


def _one_axis(parameters: ReferenceMotionParameters, time: Array) -> tuple[Array, Array, Array]:
    """Return the signal of an axis, its peak 1, and its time derivatives [1, 1/s, 1/s^2]."""
    period = parameters.motion.response.period
    signal = multisine(_highest(parameters))
    x, dx, ddx = signal.at(time / period)
    dx, ddx = dx / period, ddx / period ** 2
    end = (1.0 + parameters.motion.response.periods + _FADE) * period
    fade = _FADE * period
    ends = time > 0.5 * end
    w, dw, ddw = quintic(np.clip(np.where(ends, end - time, time) / fade, 0.0, 1.0))
    dw, ddw = np.where(ends, -dw, dw) / fade, ddw / fade ** 2
    return w * x, dw * x + w * dx, ddw * x + 2.0 * dw * dx + w * ddx


def _highest(parameters: ReferenceMotionParameters) -> int:
    response = parameters.motion.response
    return int(response.highest_frequency * response.period + 1e-9)


def _amplitudes_of(parameters: ReferenceMotionParameters) -> Array:
    """Return the peaks of the axes (6,) [m, rad]."""
    if not parameters.motion.response.params_file:
        return parameters.motion.amplitude
    return parameters.motion.response.part * np.array(_amplitudes_within(
        parameters.motion.response.params_file, tuple(parameters.motion.initial.tolist()),
        _highest(parameters), parameters.motion.response.period))


@lru_cache(maxsize=4)
def _amplitudes_within(path: str, initial: tuple[float, ...], highest: int, period: float,
                       ) -> tuple[float, ...]:
    """
    Return the largest peaks of the axes within the hexapod's limits [m, rad].

    Raises ParameterError if the hexapod lacks a limit, or is not within them at the center.
    """
    from stewart_dynamics.capability.capability import Capability  # slow, other motions need none

    platform = StewartPlatform(Parameters.from_yaml(path))
    if missing := [name for name in limits_of(platform.parameters).usual
                   if platform.parameters[name] is None]:
        raise ParameterError(f'{path}: {", ".join(missing)}: missing: the motion response needs '
                             'them, or motion.amplitude in place of motion.response.params_file')
    capability = Capability(platform)
    size = platform.parameters.singularity.characteristic_length
    center = np.array(initial)
    pose = Pose.from_euler(center[:3], center[3:])
    samples = np.arange(_SAMPLES * highest) / (_SAMPLES * highest)
    x, dx, ddx = multisine(highest).at(samples)
    found = []
    for axis in range(6):
        small = _SMALL * (size if axis < 3 else 1.0)
        unit = small * np.eye(6)[axis]
        motion = _about(center, *(each[:, None] * unit for each in (
            x, dx / period, ddx / period ** 2)))
        factor = float(capability.amplitude_factor(motion, pose).value)
        if not factor > 0.0:
            raise ParameterError(f'motion.initial: {listed(center)}: is not within the limits of '
                                 f'the hexapod in {path}')
        found.append(factor * small)
    return tuple(found)
