# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The mass, center of mass and inertia of platform and payload, from the last seconds of motion.

Measured forces less those of the model, with the parameters as they are, are what a change of the
platform's ten inertial parameters has to explain, beside all else that is uncertain: ``body_fit``.
Both sides, the forces and the regressor, pass through the same filter, so that motion above its
band costs information but makes no error: means over windows cos^2(pi t / 2 h), -h < t < h, at
every h. With them the noise of the accelerations, differences of measured twists, is that of their
slow part (summation by parts moves the difference to the window).

The work is done in pieces, because setpoints are answered in between.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Integers, NANOSECOND, SECOND
from stewart_dynamics.estimation.noisy_rates import rates_in_noise
from stewart_dynamics.estimation.uncertainty import root_of_covariance
from stewart_dynamics.external_wrench.body_fit import (
    BodyFit, FittedBody, LegSamples, ROUNDS, TEN)
from stewart_dynamics.external_wrench.measured_legs import (
    ACTED, LegHistory, LOADED, motions_of, OF_BASE, stamps_of, TURNED)
from stewart_dynamics.mechanics.dynamics.friction import Friction, slip_in_noise
from stewart_dynamics.mechanics.dynamics.linear_parameters import (
    BODY_UNITS, FIRST_MOMENT, inertial_derivative, linear_parameters, Places, PLATFORM)
from stewart_dynamics.mechanics.rows import ACCELERATION, BASE, GRAVITY, MOTION
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters import table
from stewart_dynamics.parameters.body import Body
from stewart_dynamics.parameters.table import Parameters

# Measurements between two yields.
PIECE = 128
_COPIED = 1024

# Half the width of a window: minimum [s], and minimum in measurements.
_HALF_WIDTH = 0.05
_MEASUREMENTS = 5
# Time over which rates are parabolas, as far as their noise hides [s].
_BLOCK = 0.4
# With fewer windows the correlation of their noise is too uncertain.
LEAST_WINDOWS = 40
# A window counts if measurements cover this part of it.
_COVERED = 0.9

# The fourth difference of white noise has this times its variance. Motion adds next to nothing.
_FOURTH_VARIANCE = 70.0

# Friction is uncertain by its own size; what holds a leg at rest is anything up to Coulomb's.
_STATIC = 1.0 / math.sqrt(3.0)

# An effort of these parts of its limit is saturated: sensors have noise. Larger ones are
# of another unit, or of a drive that does not have this limit.
_SATURATED = 0.99, 1.02

# An overflow is found by its result.
_QUIET = np.errstate(over='ignore', invalid='ignore')

_LEGS = np.arange(6)

# A larger residual, by the measured forces, means that the model does not hold.
_UNEXPLAINED = 0.05
# Forces by those of the model: outside, they are of another unit.
_LEAST_SCALE, _MOST_SCALE = 0.1, 10.0

NAMES = ('mass', *(f'center of mass {axis}' for axis in 'xyz'),
         *(f'inertia {axes}' for axes in table.INERTIA))


class Payload(NamedTuple):
    """Platform and payload as one body, as ``platform.*`` means it."""

    stamp: int  # of the last measurement [ns]
    seconds: float  # time of the measurements
    excluded: int  # measurements that were not used: with saturated efforts, or legs at their ends
    fitted: FittedBody
    given: Body  # unknown ones as in the file


class PayloadOutcome(NamedTuple):
    """The result of a request."""

    message: str
    payload: Payload | None = None


def identify(history: LegHistory, platform: StewartPlatform) -> Iterator[PayloadOutcome | None]:
    """
    Yield None after each piece of the work, and the outcome at the end.

    Measurements may be added to the history meanwhile; those from now on are not used.
    """
    p, effort = platform.parameters, platform.parameters.leg_kind.effort
    begin, end = _range(history, p.payload.window)
    rows = np.empty((end - begin, OF_BASE.stop))
    for some in _pieces(len(rows), _COPIED):
        rows[some] = history.rows(begin + some.start, begin + some.stop)
        yield None
    rows = rows[max(0, history.first - begin):]  # those before were overwritten meanwhile
    if not len(rows):
        yield PayloadOutcome('no measured legs')
        return
    work = _Windows(platform, rows)
    yield None
    for some in _pieces(len(rows), PIECE):
        work.add(some)
        yield None
    yield from work.end()
    for some in _pieces(len(work.used), work.block):
        work.add_friction(some)
        yield None
    seconds = float(work.seconds[-1])
    if not work.found_means():
        needed = LEAST_WINDOWS * work.half_width
        more = '' if needed < p.payload.window else ', more than payload.window'
        yield PayloadOutcome(
            f'too short: {seconds:.1f} s of measured legs, {needed:.1f} s without gaps are needed'
            f'{more}{_excluded(work.excluded, p)}')
        return
    if not math.isfinite(work.scale):
        yield PayloadOutcome('numbers overflow')
        return
    if not _LEAST_SCALE < work.scale < _MOST_SCALE:
        what = 'sign' if work.scale < 0.0 else 'unit'
        yield PayloadOutcome(f'the measured {effort.field} are {work.scale:.3g} times those of '
                             f'the model: likely they have another {what}')
        return
    samples = yield from work.samples()
    fit = BodyFit(samples, p.carried)
    try:
        yield from fit.prepare()
        for _ in range(ROUNDS):
            yield from fit.improve()
        fitted = fit.result()
    except np.linalg.LinAlgError as exc:
        yield PayloadOutcome(f'the fit failed: {exc}')
        return
    if fitted.residual > _UNEXPLAINED * samples.measured:
        yield PayloadOutcome(f'the model does not explain the measured {effort.field}: residual '
                             f'{fitted.residual:.3g} {effort.unit} of {samples.measured:.4g} '
                             f'{effort.unit} (RMS)')
        return
    yield _outcome(Payload(work.stamp, seconds, work.excluded, fitted, p.platform.body), p)


def _range(history: LegHistory, seconds: float) -> tuple[int, int]:
    """Return the first measurement that counts, and the end: stamps increase between them."""
    end = history.count
    stamps = history.stamps(history.first, end)
    if not len(stamps):
        return end, end
    stopped = np.flatnonzero(np.diff(stamps) <= 0)
    restart = int(stopped[-1]) + 1 if len(stopped) else 0
    late = np.searchsorted(stamps[restart:], stamps[-1] - round(seconds * SECOND))
    return history.first + restart + int(late), end


def _pieces(count: int, size: int) -> Iterator[slice]:
    return (slice(first, min(first + size, count)) for first in range(0, count, size))


class _Windows:
    """Means of the inputs of the fit over windows."""

    scale: float  # of the efforts, by those of the model

    def __init__(self, platform: StewartPlatform, rows: Array) -> None:
        p, kind = platform.parameters, platform.parameters.leg_kind
        self._platform, self._rows = platform, rows
        self._kind, self._places = kind, Places.of(kind)
        stamps = stamps_of(rows)
        self.stamp, self.seconds = int(stamps[-1]), (stamps - stamps[0]) * NANOSECOND
        parts = np.abs(rows[:, ACTED]) / table.six_of(p[kind.effort_limit], math.inf)
        self._saturated: Flags = np.any(
            (parts > _SATURATED[0]) & (parts < _SATURATED[1]), axis=1)
        self._lowest, self._highest = (table.six_of(p[name], bound) for name, bound in zip(
            kind.position_limits, (-math.inf, math.inf), strict=True))
        self._friction = Friction.of(p)
        self.excluded = 0
        self._steps = np.diff(self.seconds)
        self._sound = self._steps <= p.setpoint.timeout
        interval = float(np.median(self._steps)) if len(self._steps) else 0.0
        self.half_width = max(_HALF_WIDTH, _MEASUREMENTS * interval)
        # Noise of an acceleration divided by the noise of a twist: the window's slope.
        self._noise_gain = math.pi ** 2 * interval / (4.0 * self.half_width ** 3)
        many = int(self.seconds[-1] / self.half_width) + 2
        # The regressor of each leg, its effort less that of the model, and that.
        self._sums = np.zeros((many, 6, self._places.whole + 2))
        self._motions, self._bases = np.zeros((many, MOTION)), np.full((many, BASE), np.nan)
        self._covered = np.zeros(many)
        self._added: list[tuple[Integers, Array]] = []  # measurements and rates of the drives
        self.block = max(_MEASUREMENTS, round(_BLOCK / interval) if interval > 0.0 else 0)

    @_QUIET
    def add(self, some: slice) -> None:
        """Add measurements, all but Coulomb friction, of which the rates are noted."""
        # Those between two measurements.
        at = np.arange(max(some.start, 1), min(some.stop, len(self._rows) - 1))
        at = at[self._sound[at - 1] & self._sound[at]]
        if not len(at):
            return
        rows, following = self._rows[at], self._rows[at + 1]
        before, after = self._steps[at - 1, None], self._steps[at, None]
        motions, bases = motions_of(rows), rows[:, OF_BASE]
        motions[:, ACCELERATION] = (
            following[:, TURNED] - self._rows[at - 1, TURNED]) / (before + after)
        efforts = (rows[:, ACTED] * before + following[:, ACTED] * after) / (before + after)
        results = self._platform.solve(motions, rows[:, LOADED], bases)
        positions, count = results[:, self._kind.position.columns], self._places.whole
        # Efforts have no part of the force of an end stop.
        right = ~(self._saturated[at] | self._saturated[at + 1]) & np.all(
            (positions > self._lowest) & (positions < self._highest), axis=1)
        self.excluded += int(np.count_nonzero(~right))
        values = np.empty((len(at), 6, count + 2))
        values[..., :count] = self._platform.regressors(motions, bases)
        rates, sliding = (values[:, _LEGS, kind.start + _LEGS] for kind in (
            self._places.viscous_friction, self._places.coulomb_friction))
        values[:, _LEGS, self._places.coulomb_friction.start + _LEGS] = 0.0
        model = results[:, self._kind.effort.columns] - self._friction.coulomb * sliding
        values[..., count], values[..., count + 1] = efforts - model, model
        right &= np.isfinite(values.sum(axis=(1, 2)))  # not where J_inv cannot be solved
        which: Any = slice(None) if right.all() else right  # without a copy of all
        used = at[which]
        if not len(used):
            return
        self._added.append((used, rates[which]))
        windows, share = self._share(used)
        self._sums[windows] += np.tensordot(share, values[which], 1)
        self._covered[windows] += share.sum(axis=1)
        of_window, first = np.unique(self._turns(used), return_index=True)
        self._motions[of_window], self._bases[of_window] = (
            motions[which][first], bases[which][first])

    def end(self) -> Iterator[None]:
        """End the adding, yield after each piece of the work; friction follows."""
        self.used = np.concatenate([np.zeros(0, int), *(used for used, _ in self._added)])
        self._rates = np.concatenate([np.zeros((0, 6)), *(rates for _, rates in self._added)])
        yield
        self._noise = self._noise_of(self._rows[self.used, TURNED])
        yield
        self._rate_deviations = np.sqrt(np.diag(self._noise_of(self._rates)))
        yield

    @_QUIET
    def _noise_of(self, values: Array) -> Array:
        """Return the covariance of white noise in values (N, 6) of the used measurements."""
        rough = np.diff(values, n=4, axis=0)[self.used[4:] - self.used[:-4] == 4]
        noise: Array = rough.T @ rough / (_FOURTH_VARIANCE * max(len(rough), 1))
        return noise

    @_QUIET
    def add_friction(self, some: slice) -> None:
        """Add the Coulomb friction of used measurements."""
        rates, deviations = rates_in_noise(self._rates[some], self._rate_deviations)
        slip = slip_in_noise(rates, self._friction.coulomb_velocity, deviations)
        windows, share = self._share(self.used[some])
        means, count = share @ slip, self._places.whole
        self._sums[windows, _LEGS, self._places.coulomb_friction.start + _LEGS] += means
        self._sums[windows, :, count] -= self._friction.coulomb * means
        self._sums[windows, :, count + 1] += self._friction.coulomb * means

    def _turns(self, at: Integers) -> Integers:
        """Return the windows in the first half of which measurements are, less one."""
        turns: Integers = (self.seconds[at] / self.half_width).astype(np.int64)
        return turns

    def _share(self, at: Integers) -> tuple[slice, Array]:
        """Return windows, and how long (windows, measurements) each measurement counts there."""
        whole = self._turns(at)
        part = np.sin(0.5 * np.pi * (self.seconds[at] / self.half_width - whole)) ** 2
        low, many = int(whole[0]), np.arange(len(at))
        share = np.zeros((int(whole[-1]) + 2 - low, len(at)))
        weights = 0.5 * (self._steps[at - 1] + self._steps[at])
        share[whole - low, many] = (1.0 - part) * weights
        share[whole - low + 1, many] = part * weights
        return slice(low, low + len(share)), share

    @_QUIET
    def found_means(self) -> bool:
        """Return whether there are enough windows, of which the means and the scale are found."""
        self._are_full = self._covered > _COVERED * self.half_width
        self._means = self._sums[self._are_full] / self._covered[self._are_full, None, None]
        differences, modelled = self._means[..., -2], self._means[..., -1]
        self.scale = 1.0 + float(np.sum(differences * modelled) / np.sum(modelled ** 2))
        return len(self._means) >= LEAST_WINDOWS

    def samples(self) -> Generator[None, None, LegSamples]:
        """Return the means over the windows; yield after each piece."""
        full, means = self._are_full, self._means
        motions, bases = self._motions[full], self._bases[full]
        differences, modelled = means[..., -2], means[..., -1]
        p, places, count = self._platform.parameters, self._places, self._places.whole
        of_friction = np.zeros(count)
        of_friction[places.viscous_friction] = self._friction.viscous
        of_friction[places.coulomb_friction] = self._friction.coulomb
        root = root_of_covariance(p, p.carried, of_friction)
        yield
        root[FIRST_MOMENT] *= p.carried.mass
        change = root[PLATFORM, PLATFORM].copy()
        root[PLATFORM] = inertial_derivative(1.0, p.carried.center) @ root[PLATFORM]
        root = root[:, np.any(root != 0.0, axis=0) | (np.arange(count) < TEN)]
        by_tilt = self._by_tilt(motions, bases)
        yield
        standing = self._friction.is_linear(
            means[:, _LEGS, places.viscous_friction.start + _LEGS])
        weight = self.scale * modelled
        parts = (means[..., :count] @ root,
                 (standing * _STATIC * self._friction.coulomb)[..., None] * np.eye(6),
                 p.uncertainty.tilt * by_tilt,
                 p.uncertainty.effort_gain * weight[..., None], differences[..., None])
        columns = np.zeros((len(full), 6, sum(part.shape[-1] for part in parts)))
        columns[full] = np.concatenate(parts, axis=-1)
        yield
        middle = len(motions) // 2
        by_acceleration = np.zeros((6, *columns.shape[1:]))
        by_acceleration[..., :root.shape[1]], by_acceleration[..., -1] = self._by_acceleration(
            motions[middle], bases[middle:middle + 1], root)
        measured = float(np.sqrt(np.mean((differences + modelled) ** 2)))
        return LegSamples(
            columns, change, self._noise_gain * self._noise, by_acceleration, measured,
            p.uncertainty.effort_gain)

    def _by_tilt(self, motions: Array, bases: Array) -> Array:
        """Return the forces (N, 6, 2) by turns of gravity about two base axes [N/rad]."""
        p = self._platform.parameters
        gravity = np.where(np.isnan(bases[:, GRAVITY]), p.gravity, bases[:, GRAVITY])
        across = np.argsort(np.abs(gravity.mean(axis=0)))[:2]
        theta = self.scale * linear_parameters(p)  # as heavy as the forces
        by_tilt: Array = np.stack([self._platform.regressors_at_rest(
            motions, np.cross(axis, gravity)) @ theta for axis in np.eye(3)[across]], axis=-1)
        return by_tilt

    def _by_acceleration(self, motion: Array, base: Array, root: Array) -> tuple[Array, Array]:
        """Return the derivatives of columns (6, 6, n) and differences by accelerations."""
        motions = np.tile(motion, (7, 1))
        motions[1:, ACCELERATION] += np.eye(6)
        columns = self._platform.regressors(motions, base) @ root
        model = self._platform.solve(motions, None, base)[:, self._kind.effort.columns]
        return columns[1:] - columns[0], model[0] - model[1:]


def _outcome(payload: Payload, p: Parameters) -> PayloadOutcome:
    fitted, effort = payload.fitted, p.leg_kind.effort
    mass = fitted.body.mass
    if not mass > 0.0:
        return PayloadOutcome(f'the mass that fits best is {mass:.6g} kg: must be more than 0')
    if not fitted.known[0]:
        return PayloadOutcome(
            f'the mass is not identifiable from the measured {effort.field}: residual '
            f'{fitted.residual:.3g} {effort.unit} (RMS){_of_gain(fitted)}')
    return PayloadOutcome(_words(payload, p), payload)


def _words(payload: Payload, p: Parameters) -> str:
    """Return the identified numbers, the others' names and the parameters to set, in one line."""
    fitted, more = payload.fitted, payload.fitted.body.mass - payload.given.mass
    rows = rows_of(fitted)
    known = [f'{name} {with_interval(value, half)} {unit}'
             for name, unit, value, half, is_known in rows if is_known]
    unknown = [name for name, *_, is_known in rows if not is_known]
    text = (f'{", ".join(known)}; {abs(more):.{_decimals(fitted.half_widths[0])}f} kg '
            f'{"less" if more < 0.0 else "more"} than platform.mass; from '
            f'{payload.seconds:.1f} s')
    text += _excluded(payload.excluded, p)
    text += _of_gain(fitted)
    if not fitted.consistent:
        text += '; no real body has the inertia that fits best'
    if unknown:
        text += f'; not identified, as in the parameters: {", ".join(unknown)}'
    found = carried_payload(payload)
    if isinstance(found, str):
        return f'{text}; platform: {body_words(fitted.body)}'
    return f'{text}; payload: {body_words(found)}'


def carried_payload(payload: Payload) -> Body | str:
    """
    Return the identified body without the empty platform, or why it is no body.

    A mass within its interval of zero counts as zero. The inertia is that of a point mass where it
    is not identified; moments that noise made negative are zero.
    """
    fitted, empty = payload.fitted, payload.given
    mass, half = fitted.body.mass - empty.mass, float(fitted.half_widths[0])
    if mass < -half:
        return (f'{-mass:.6g} kg less than platform.mass, {empty.mass:.6g} kg, that of the empty '
                'platform')
    if mass <= half:
        return Body(0.0, np.zeros(3), np.zeros(6))
    rest = fitted.body.without(empty)
    if not fitted.known[4:].all():
        return rest._replace(inertia=np.zeros(6))
    moments, axes = np.linalg.eigh(table.inertia_matrix(rest.inertia))
    inertia = (axes * np.maximum(moments, 0.0)) @ axes.T
    return rest._replace(inertia=inertia[np.triu_indices(3)])


def _of_gain(fitted: FittedBody) -> str:
    """Return the words on a gain of the efforts that is farther from the file than possible."""
    return '' if not fitted.gain else (
        f'; likely another gain of all efforts, by about {100.0 * fitted.gain:+.2g} %, which '
        'widens the intervals: check the scale of the efforts')


def _excluded(count: int, p: Parameters) -> str:
    return '' if not count else (f'; {count} measurements not used: efforts at '
                                 f'{p.leg_kind.effort_limit} or legs at their ends')


def with_interval(value: float, half_width: float) -> str:
    """Return a value and half of its 95 % interval, of which two digits are given."""
    digits = _decimals(half_width)
    return f'{value:.{digits}f} +- {half_width:.{digits}f}'


def _decimals(half_width: float) -> int:
    digits = 1 - math.floor(math.log10(half_width)) if half_width > 0.0 else 6
    return min(max(digits, 0), 9)


def body_words(body: Body) -> str:
    """Return a body as the value of ``platform`` or ``payload`` in a parameter file."""
    center, inertia = (', '.join(f'{float(f"{value:.6g}")}' for value in values)
                       for values in (body.center, body.inertia))
    return (f'{{mass: {float(f"{body.mass:.6g}")}, center_of_mass: [{center}], '
            f'inertia: [{inertia}]}}')


def rows_of(fitted: FittedBody) -> list[tuple[str, str, float, float, bool]]:
    """Return name, unit, value, half of the interval, and whether it is known, of each number."""
    return list(zip(NAMES, BODY_UNITS, numbers_of(fitted.body), fitted.half_widths.tolist(),
                    fitted.known.tolist(), strict=True))


def numbers_of(body: Body) -> list[float]:
    """Return mass, center of mass and inertia, as NAMES names them."""
    return [body.mass, *body.center.tolist(), *body.inertia.tolist()]
