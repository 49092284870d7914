# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Reference motions as functions of time, with exact derivatives."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Integers, SECOND
from stewart_dynamics.mechanics.frames import rotation as rotations
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.reference_motion.quintic import quintic
from stewart_dynamics.reference_motion.response_motion import duration, response_motion


def sample_times(parameters: ReferenceMotionParameters) -> Integers:
    """
    Return the times of the motion in one direction (N,) [ns], from 0 on at the rate.

    The last is at the duration or, if that is between two samples, the next one after it, so that
    a motion that ends at rest is complete.
    """
    return sample_time(parameters, np.arange(sample_count(parameters)))


def sample_count(parameters: ReferenceMotionParameters) -> int:
    """Return the number of times in ``sample_times``."""
    seconds = (duration(parameters) if parameters.motion.type == 'response'
               else parameters.motion.duration)
    exact: float = seconds * parameters.rate
    near = round(exact)
    is_near = math.isclose(exact, near, rel_tol=1e-12, abs_tol=1e-9)
    return 1 + (near if is_near else math.ceil(exact))


def sample_time(parameters: ReferenceMotionParameters, index: ArrayLike) -> Integers:
    """Return the times of samples by their index (...) [ns]; rounding errors do not add up."""
    times: Integers = np.rint(
        np.asarray(index) * SECOND / parameters.rate).astype(np.int64)
    return times


def motion_at(parameters: ReferenceMotionParameters, times: ArrayLike) -> Motion:
    """
    Return the motion at times (...) [s] from its start; all derivatives are exact.

    - paper: each of X, Y, Z, alpha, beta, gamma goes from initial to final as
      (1 - cos(pi t / T)) / 2. The paper prints neither its law nor its figures' data, only
      that the input goes from an initial to a final pose in 10 s and is differentiated twice.
      This is the simplest law that does so from rest to rest; its acceleration is bounded but
      does not start at zero, and looped it is one smooth oscillation.
    - quintic: the position on a straight line, the rotation about the one axis, fixed in the
      base, that turns the initial to the final orientation by at most pi; both with
      10 u^3 - 15 u^4 + 6 u^5, u = t / T, so that velocity and acceleration are zero at both
      ends.
    - sine: each coordinate as initial + amplitude sin(2 pi frequency t + phase), from the first
      sample on: it starts at full speed where the phase is zero.
    - fourier: each coordinate as initial + w(t) sum_k (cosine_k cos(k omega t) + sine_k
      sin(k omega t)), k = 1 to n, the excitation of J. Swevers et al. (Optimal robot excitation
      and identification, IEEE Trans. Robotics and Automation 13, 1997, 730-740,
      doi:10.1109/70.631234). The window w(t) is 10 u^3 - 15 u^4 + 6 u^5 with u = t / fade at the
      start, then 1, and at the end the same backward, so that position, velocity and
      acceleration begin and end as at rest, whatever the coefficients are. Looped it is 1 from
      the fade on.
    - response: about initial, each axis in turn as a multisine, see ``response_motion``.
    - hold: at rest in initial.

    paper and quintic are at rest in initial before their start and in final after their end;
    looped they run back and forth, each direction in the duration. fourier is at rest in initial
    before its start and after its end.
    """
    time = np.asarray(times, dtype=float)
    kind, initial = parameters.motion.type, parameters.motion.initial
    if kind == 'hold':
        return _euler_motion(np.broadcast_to(initial, (*time.shape, 6)), np.zeros(6), np.zeros(6))
    if kind == 'sine':
        amplitude = parameters.motion.amplitude
        omega = 2.0 * np.pi * parameters.motion.frequency
        angle = omega * time[..., None] + parameters.motion.phase
        return _euler_motion(
            initial + amplitude * np.sin(angle), amplitude * omega * np.cos(angle),
            -amplitude * omega ** 2 * np.sin(angle))
    if kind == 'response':
        return response_motion(parameters, time)
    if kind == 'fourier':
        offset, rate, acceleration = _series(parameters, time)
        return _euler_motion(initial + offset, rate, acceleration)
    s, ds, dds = (each[..., None] for each in _progress(parameters, time))
    # Both kinds that are left have one.
    final = initial if parameters.motion.final is None else parameters.motion.final
    if kind == 'paper':
        change = final - initial
        return _euler_motion(initial + s * change, ds * change, dds * change)
    start, end = rotations.from_euler(initial[3:]), rotations.from_euler(final[3:])
    turn = rotations.to_rotation_vector(end @ start.T)
    change = final[:3] - initial[:3]
    return Motion(initial[:3] + s * change, rotations.from_rotation_vector(s * turn) @ start,
                  ds * change, ds * turn, dds * change, dds * turn)


def first_pose(parameters: ReferenceMotionParameters) -> Array:
    """Return where a motion begins, as a simulator takes its ``initial_pose`` (6,) [m, rad]."""
    begin = motion_at(parameters, 0.0)
    return np.concatenate([begin.position, rotations.to_euler(begin.rotation)])


def _euler_motion(pose: Array, rate: Array, acceleration: Array) -> Motion:
    return Motion.from_euler(pose[..., :3], pose[..., 3:], rate[..., :3], rate[..., 3:],
                             acceleration[..., :3], acceleration[..., 3:])


def _progress(parameters: ReferenceMotionParameters, time: Array) -> tuple[Array, Array, Array]:
    """Return the completed part of the motion and its time derivatives [1, 1/s, 1/s^2]."""
    duration = parameters.motion.duration
    u = time / duration
    sign = np.ones_like(u)
    if parameters.loop:
        u = np.mod(u, 2.0)
        sign = np.where(u > 1.0, -1.0, 1.0)
        u = np.where(u > 1.0, 2.0 - u, u)
    moving = np.where((u >= 0.0) & (u <= 1.0), 1.0, 0.0)
    u = np.clip(u, 0.0, 1.0)
    if parameters.motion.type == 'paper':
        s, ds, dds = ((1.0 - np.cos(np.pi * u)) / 2.0, np.pi / 2.0 * np.sin(np.pi * u),
                      np.pi ** 2 / 2.0 * np.cos(np.pi * u))
    else:
        s, ds, dds = quintic(u)
    return s, sign * moving * ds / duration, moving * dds / duration ** 2


def _series(parameters: ReferenceMotionParameters, time: Array) -> tuple[Array, Array, Array]:
    """Return the Fourier series in its window (..., 6), and its time derivatives."""
    cosine, sine = parameters.motion.fourier.cosine, parameters.motion.fourier.sine
    cosine = np.zeros_like(sine) if cosine is None else cosine
    sine = np.zeros_like(cosine) if sine is None else sine
    turn = 2.0 * np.pi * np.mod(time * parameters.motion.fourier.frequency, 1.0)[..., None]
    x, dx, ddx = np.zeros((3, *time.shape, 6))
    # Not by a matrix product: its last bits depend on the number of times.
    for k, (a, b) in enumerate(zip(cosine, sine, strict=True), start=1):
        omega = 2.0 * np.pi * parameters.motion.fourier.frequency * k
        c, s = np.cos(k * turn), np.sin(k * turn)
        x += a * c + b * s
        dx += omega * (b * c - a * s)
        ddx -= omega ** 2 * (a * c + b * s)
    w, dw, ddw = (each[..., None] for each in _window(parameters, time))
    return w * x, dw * x + w * dx, ddw * x + 2.0 * dw * dx + w * ddx


def _window(parameters: ReferenceMotionParameters, time: Array) -> tuple[Array, Array, Array]:
    """Return the window of a Fourier series and its time derivatives [1, 1/s, 1/s^2]."""
    fade, duration = parameters.motion.fourier.fade, parameters.motion.duration
    ends = not parameters.loop and time > duration / 2.0
    sign = np.where(ends, -1.0, 1.0)
    u = np.clip(np.where(ends, duration - time, time) / fade, 0.0, 1.0)
    w, dw, ddw = quintic(u)
    return w, sign * dw / fade, ddw / fade ** 2
