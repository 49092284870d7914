# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Design of a motion that minimizes identification intervals within the limits of the hexapod.

The motion is a Fourier series of all six coordinates about home (``motion_functions``).
Its coefficients minimize the sum of the squared deviations of the requested parameters, each
divided by that of the file, in the posterior that an identification would state (A-optimal; J.
Swevers et al., "Optimal robot excitation and identification", IEEE Trans. Robotics and Automation
13, 1997, doi:10.1109/70.631234). Every set of coefficients is scaled up to the limits, so that
only their ratios are searched, with an evolution strategy that adapts the spread of each
coefficient (R. Ros, N. Hansen, "A simple modification in CMA-ES achieving linear time and space
complexity", PPSN X, 2008, doi:10.1007/978-3-540-87700-4_30). Equal seeds give equal results.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError, StewartError
from stewart_dynamics.estimation.confidence_level import TWO_SIDED
from stewart_dynamics.estimation.posterior import IDENTIFIABLE, posterior
from stewart_dynamics.estimation.whitening import gram_of, spectra_of
from stewart_dynamics.identification.extraction import BAND, ORDERS, SAMPLES, time_for_filters
from stewart_dynamics.identification.identification_options import DesignOptions
from stewart_dynamics.identification.parameter_fit import (
    covariance_of, delay_deviations, directions)
from stewart_dynamics.identification.unknowns import regressor_of, Unknowns
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.mechanics.limits import CLEARANCE_MIN, LIMITS, limits_of, OF_JOINTS
from stewart_dynamics.mechanics.pose_limits import PoseLimits
from stewart_dynamics.mechanics.rows import (
    CONDITION, MOTION, POSE, POSITION, ROTATION)
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.reference_motion.motion_functions import motion_at
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters


# Margins, as fractions of the stroke (at each end), rates, efforts, and of joint angles and
# clearance: the masses are not known yet, and a controller overshoots. Margin of the ratio of a
# lever to its largest value: rates grow without bound where it is zero.
_STROKE, _RATE, _FORCE, _ANGLE, _LEVER = 0.02, 0.1, 0.2, 0.1, 0.1
# Largest condition number, relative to singularity.warn_condition.
_CONDITION = 0.5
_WARN_CONDITION = 'singularity.warn_condition'


class DesignLimits:
    """
    The limits of a hexapod with their margins, and the center of the motion.

    ``amplitude`` is the largest displacement of the origin [m]; rotations are limited to it
    divided by the characteristic length. If it is given, limits may be missing. ``center`` is
    X Y Z alpha beta gamma [m, rad], home by default. Raises ParameterError if a limit is missing,
    or the center is not within the limits.
    """

    def __init__(self, platform: StewartPlatform, amplitude: float | None = None,
                 center: Sequence[float] | None = None) -> None:
        p = platform.parameters
        missing = [name for name in limits_of(p).usual if p[name] is None]
        if missing and amplitude is None:
            raise ParameterError(
                f'{", ".join(missing)}: missing: a motion is designed within the limits of the '
                'parameter file, or with --amplitude')
        self._platform, self._amplitude = platform, amplitude
        self._size = p.singularity.characteristic_length
        if center is None:
            digits = 6 - round(math.log10(self._size))
            center = [*platform.home_pose().position.round(digits).tolist(), 0.0, 0.0, 0.0]
        self.center: Array = np.array(center, dtype=float)  # X Y Z alpha beta gamma
        self._rotation = from_euler(self.center[3:]).ravel()
        self._bounds = _bounds(p)
        self._limits = PoseLimits(p)
        row = np.zeros((1, 1, MOTION))
        row[..., POSE] = *self.center[:3], *self._rotation
        self._there = {name: values[0, 0] for name, values in self._values(row).items()}
        for name, there in self._there.items():
            bound = self._bounds[name]
            minimum = name in LIMITS and LIMITS[name].minimum
            if np.any(there <= bound if minimum else there >= bound):
                raise ParameterError(f'{name}: at the center of the motion the hexapod exceeds '
                                     'it, or is within its margin')

    def excess(self, rows: Array) -> Array:
        """
        Return the fraction of the free range that motions (M, N, MOTION) use; 1 is all of it.

        The value is large beyond a singularity, or if numbers overflow.
        """
        parts = np.array(list(self._parts(rows).values()))
        worst: Array = np.where(np.isfinite(parts), parts, 10.0).max(axis=0)
        return np.minimum(worst, 10.0)

    def use(self, motion: Motion) -> dict[str, float]:
        """Return the fraction of each limit, less its margin, that a motion (N,) uses."""
        return {name: float(part[0]) for name, part in self._parts(motion.rows[None]).items()
                if part[0] > 0.0}

    def _parts(self, rows: Array) -> dict[str, Array]:
        """Return the fraction (M,) of the range from the center to each bound that is used."""
        parts = {
            name: (values - self._there[name]) / (self._bounds[name] - self._there[name])
            for name, values in self._values(rows).items()}
        if self._amplitude is not None:
            moved = np.linalg.norm(rows[..., POSITION] - self.center[:3], axis=-1)
            turned = self._size * np.linalg.norm(
                rows[..., ROTATION] - self._rotation, axis=-1) / np.sqrt(2.0)
            parts['--amplitude'] = np.maximum(moved, turned)[..., None] / self._amplitude
        return {name: part.max(axis=(1, 2)) for name, part in parts.items()}

    def _values(self, rows: Array) -> dict[str, Array]:
        """Return the values (M, N, ...) that each limit bounds, for motions (M, N, MOTION)."""
        motions, names = rows.reshape(-1, MOTION), limits_of(self._platform.parameters)
        results = self._platform.solve(motions)
        found = {**self._limits.values(motions, results),
                 **{name: np.abs(results[:, LIMITS[name].columns])
                    for name in (*names.rates, *names.loads)},
                 _WARN_CONDITION: results[:, CONDITION, None]}
        if CLEARANCE_MIN in found:
            found[CLEARANCE_MIN] = found[CLEARANCE_MIN].min(axis=1, keepdims=True)
        return {name: values.reshape(*rows.shape[:2], -1) for name, values in found.items()}


def _bounds(p: Parameters) -> dict[str, Any]:
    """Return the limits less their margins; infinite if not given."""
    kind, names = p.leg_kind, limits_of(p)
    given = {name: np.full(6, -np.inf if LIMITS[name].minimum else np.inf) if p[name] is None
             else p[name] for name in names.results}
    low, high = (given[name] for name in kind.position_limits)
    stroke = np.where(np.isfinite(high - low), high - low, 0.0)
    ends = dict(zip(kind.position_limits, (
        low + _STROKE * stroke, high - _STROKE * stroke), strict=True))
    return {
        **ends, **({kind.lever_limit: p[kind.lever_limit] + _LEVER} if kind.lever_limit else {}),
        **{name: (1.0 - _RATE) * given[name] for name in names.rates},
        **{name: (1.0 - _FORCE) * given[name] for name in names.loads},
        _WARN_CONDITION: _CONDITION * p.singularity.warn_condition,
        **{name: (1.0 - _ANGLE) * p[name] for name in OF_JOINTS if p[name] is not None},
        CLEARANCE_MIN: (1.0 + _ANGLE) * (p.limits.leg_clearance_min or 0.0)}


# Samples per period of the highest harmonic: in the search, and in the final check. Intervals
# need fewer of them than limits, in the search every second.
_SAMPLES, _FINE_SAMPLES, _SECOND = 20, 100, 2
# Number of iterations that scale a motion to its limits: in the search, and at the end.
_SCALINGS, _LAST_SCALINGS = 2, 30
_CLOSE = 1e-3
# Digits of coefficients in a file [rad]; lengths relative to the size of the platform.
_DIGITS = 7


class Design(NamedTuple):
    """A designed motion."""

    trajectory: ReferenceMotionParameters
    unknowns: Unknowns
    half_widths: Array
    """Predicted 95 % intervals of the asked unknowns, the uncertainty of the file included."""
    use: dict[str, float]  # fraction of each limit that the motion uses


def design(parameters: Parameters, options: DesignOptions,
           progress: Callable[[int], object] = lambda done: None) -> Design:
    """
    Return a motion from which the parameters are identifiable, and its predicted intervals.

    ``progress`` is called with the number of generations done. Raises StewartError if a requested
    parameter is not identifiable from any motion, a limit is missing, or the center is not within
    the limits.
    """
    search = _Search(parameters, options)
    best = _evolution(search.costs, search.size, options, progress)
    trajectory = search.trajectory(best)
    motion = motion_at(trajectory, fine_times(options))
    half_widths = predicted_half_widths(
        search.platform, search.unknowns, motion, options.duration, options)
    unknowns = search.unknowns
    unknown = [unknowns.names[n] for n, half in zip(unknowns.asked, half_widths, strict=True)
               if not half < IDENTIFIABLE * TWO_SIDED * unknowns.deviations[n]]
    if unknown:
        raise StewartError(f'no motion within the limits identifies {", ".join(options.kinds)}: '
                           f'{unknown[0]} is not identifiable; ask for less with --identify')
    return Design(trajectory, unknowns, half_widths, search.limits.use(motion))


def fine_times(options: DesignOptions) -> Array:
    """Return the times of the final check [s], which cover the whole motion."""
    count = math.ceil(options.duration * options.frequency * _FINE_SAMPLES)
    return np.arange(count + 1, dtype=np.float64) * (options.duration / count)


def predicted_half_widths(platform: StewartPlatform, unknowns: Unknowns, motion: Motion,
                          seconds: float, options: DesignOptions) -> Array:
    """
    Return half of the 95 % intervals of the asked unknowns, for a motion of a duration [s].

    They are those that an identification from this motion states, with white noise of the efforts
    alone: the uncertainty of the file is in them.
    """
    variances = _variances(
        platform, unknowns, motion.rows.reshape(1, -1, MOTION), seconds, options)
    half_widths: Array = TWO_SIDED * np.sqrt(variances[0])
    return half_widths


def noise_of(options: DesignOptions, p: Parameters) -> float:
    """Return the standard deviation of the measured efforts."""
    return p.leg_kind.effort_noise(p) if options.noise is None else options.noise


def _variances(platform: StewartPlatform, unknowns: Unknowns, rows: Array, seconds: float,
               options: DesignOptions) -> Array:
    """Return the variances (M, a) of the asked unknowns after motions (M, N, MOTION)."""
    count, samples, _ = rows.shape
    step = seconds / samples
    regressor = regressor_of(platform, rows.reshape(-1, MOTION)).reshape(count, samples, 6, -1)
    efforts = np.zeros((count, samples, 6, ORDERS))
    efforts[..., 0] = regressor @ unknowns.theta(unknowns.start)
    efforts[..., 1] = np.gradient(efforts[..., 0], step, axis=1)
    columns = np.concatenate([regressor, efforts], axis=-1) @ directions(
        unknowns, unknowns.start, np.zeros(1), 0, delay_deviations(np.array([options.cutoff])))
    left = 1.0 - 2.0 * time_for_filters(options.cutoff) / seconds
    columns *= math.sqrt(max(left, 0.0) * step * options.rate) / noise_of(
        options, platform.parameters)
    zeros = np.zeros((columns.shape[-1], columns.shape[-1]))
    variances = np.full((count, len(unknowns.asked)), np.inf)  # where the hexapod does not reach
    for n in np.flatnonzero(np.isfinite(columns).all(axis=(1, 2, 3))):
        found = posterior(gram_of(spectra_of(columns[n], BAND * SAMPLES * options.cutoff * step)),
                          zeros[0], zeros[0], zeros)
        variances[n] = np.diag(covariance_of(unknowns, found))[unknowns.asked]
    return variances


class _Search:
    """Cost function of the search over ratios of coefficients."""

    def __init__(self, parameters: Parameters, options: DesignOptions) -> None:
        self._options = options
        self.unknowns = Unknowns(parameters, options.kinds)
        self.platform = StewartPlatform(parameters)
        self.limits = DesignLimits(self.platform, options.amplitude, options.center)
        harmonics = options.harmonics
        self.size = 2 * harmonics * 6
        self._base = options.frequency / harmonics
        turns = np.arange(_SAMPLES * harmonics) / (_SAMPLES * harmonics)
        angle = 2.0 * np.pi * turns[:, None] * np.arange(1, harmonics + 1)
        omega = 2.0 * np.pi * self._base * np.arange(1, harmonics + 1)
        c, s = np.cos(angle), np.sin(angle)
        # Position, velocity and acceleration of each sample by cosine and sine coefficients.
        self._bases = (np.hstack([c, s]), np.hstack([-omega * s, omega * c]),
                       np.hstack([-omega ** 2 * c, -omega ** 2 * s]))
        # Equal ratios give equal velocities, and equal displacements at the joints.
        self._length = size = parameters.singularity.characteristic_length
        self._units = (1.0 / np.tile(np.arange(1, harmonics + 1), 2)[:, None]
                       / np.array([1.0, 1.0, 1.0, size, size, size]))
        self._first = 0.02 * size

    def costs(self, proportions: Array) -> Array:
        """Return the cost (M,) of coefficient ratios (M, size)."""
        coefficients = proportions.reshape(len(proportions), -1, 6) * self._units
        coefficients *= self._first / np.abs(coefficients).max(axis=(1, 2), keepdims=True)
        for _ in range(_SCALINGS):
            excess = self.limits.excess(self._rows(coefficients))
            coefficients /= np.maximum(excess, 0.2)[:, None, None]
        rows = self._rows(coefficients)
        excess = self.limits.excess(rows)
        variances = np.sum(_variances(
            self.platform, self.unknowns, rows[:, ::_SECOND], self._options.duration,
            self._options)
            / self.unknowns.deviations[self.unknowns.asked] ** 2, axis=1)
        # Information grows with the square of the amplitude; excess amplitude costs as much.
        cost: Array = np.log(variances) + 2.0 * np.abs(np.log(np.maximum(excess, 0.2)))
        return np.where(np.isfinite(cost), cost, np.inf)

    def _rows(self, coefficients: Array) -> Array:
        """Return rows of motion (M, N, MOTION) of one period for coefficients (M, 2 n, 6)."""
        pose, rate, acceleration = (base @ coefficients for base in self._bases)
        pose = self.limits.center + pose
        rows: Array = Motion.from_euler(
            pose[..., :3], pose[..., 3:], rate[..., :3], rate[..., 3:], acceleration[..., :3],
            acceleration[..., 3:]).rows
        return rows

    def trajectory(self, proportions: Array) -> ReferenceMotionParameters:
        """Return the motion with these ratios, as large as the limits allow."""
        coefficients = proportions.reshape(-1, 6) * self._units
        coefficients *= self._first / np.abs(coefficients).max()
        times = fine_times(self._options)
        for _ in range(_LAST_SCALINGS):
            found = self._parameters(coefficients)
            excess = float(self.limits.excess(motion_at(found, times).rows[None])[0])
            if 1.0 - _CLOSE <= excess <= 1.0:
                break
            coefficients /= excess * (1.0 + 0.3 * _CLOSE)
        return found

    def _parameters(self, coefficients: Array) -> ReferenceMotionParameters:
        harmonics, options = self._options.harmonics, self._options
        digits = _DIGITS - round(math.log10(self._length))
        rounded = np.hstack([
            coefficients[:, :3].round(digits), coefficients[:, 3:].round(_DIGITS)])
        given: dict[str, Any] = {
            'base_frame': self.platform.parameters.base_frame, 'rate': options.rate,
            'motion.type': 'fourier', 'motion.duration': options.duration,
            'motion.hold_at_end': False, 'motion.initial': self.limits.center,
            'motion.fourier.frequency': self._base,
            'motion.fourier.fade': min(1.0, options.duration / 4.0),
            'motion.fourier.cosine': rounded[:harmonics].ravel(),
            'motion.fourier.sine': rounded[harmonics:].ravel()}
        return ReferenceMotionParameters(given)


def _evolution(costs: Callable[[Array], Array], size: int, options: DesignOptions,
               progress: Callable[[int], object]) -> Array:
    """Return the best ratios found by an evolution strategy with adapted spreads."""
    random = np.random.default_rng(options.seed)
    population = 4 + int(3.0 * math.log(size))
    parents = population // 2
    weights = math.log(parents + 0.5) - np.log(np.arange(1, parents + 1))
    weights /= weights.sum()
    effective = 1.0 / float(np.sum(weights ** 2))
    # Hansen's constants, with those for a diagonal covariance matrix.
    c_step = (effective + 2.0) / (size + effective + 5.0)
    damping = 1.0 + 2.0 * max(0.0, math.sqrt((effective - 1.0) / (size + 1.0)) - 1.0) + c_step
    c_path = (4.0 + effective / size) / (size + 4.0 + 2.0 * effective / size)
    faster = (size + 2.0) / 3.0
    c_rank_one = faster * 2.0 / ((size + 1.3) ** 2 + effective)
    c_rank = min(1.0 - c_rank_one, faster * 2.0 * (effective - 2.0 + 1.0 / effective) / (
        (size + 2.0) ** 2 + effective))
    expected = math.sqrt(size) * (1.0 - 1.0 / (4.0 * size) + 1.0 / (21.0 * size ** 2))

    first = random.normal(size=(8 * population, size))
    of_first = costs(first)
    mean: Array = first[np.argmin(of_first)]
    best, lowest = mean, float(np.min(of_first))
    step, spread = 0.3, np.ones(size)
    step_path, path = np.zeros(size), np.zeros(size)
    for generation in range(options.generations):
        moves = random.normal(size=(population, size)) * np.sqrt(spread)
        candidates = mean + step * moves
        found = costs(candidates)
        order = np.argsort(found, kind='stable')
        if found[order[0]] < lowest:
            best, lowest = candidates[order[0]], float(found[order[0]])
        chosen = moves[order[:parents]]
        move = weights @ chosen
        mean = mean + step * move
        step_path = (1.0 - c_step) * step_path + math.sqrt(
            c_step * (2.0 - c_step) * effective) * move / np.sqrt(spread)
        path = (1.0 - c_path) * path + math.sqrt(c_path * (2.0 - c_path) * effective) * move
        spread = ((1.0 - c_rank_one - c_rank) * spread + c_rank_one * path ** 2
                  + c_rank * (weights @ chosen ** 2))
        step *= math.exp(c_step / damping * (float(np.linalg.norm(step_path)) / expected - 1.0))
        progress(generation + 1)
    return best
