# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Possible causes of a lack of fit, and the forces that each of them adds, as columns.

A cause changes the efforts by its columns times small amounts, to first order: an offset, friction
of another law, a joint or the zero of a leg elsewhere, another gain or delay of one leg,
saturation, a payload that changes. Columns are computed at the low rate from the filtered motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.identification.extraction import Extract, SLIP
from stewart_dynamics.identification.parameter_fit import Fit
from stewart_dynamics.identification.unknowns import Unknowns
from stewart_dynamics.identification.window_poses import motions
from stewart_dynamics.legs import KINDS
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform

# Times at which a payload may change, as fractions of all samples.
_CHANGES = (0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875)
# Payload changes between bags are tested as well, up to this number of bags.
_MOST_BAGS = 6
# Predicted forces above this fraction of the largest effort may be cut off by saturation.
_SATURATED = 0.97
# Finite-difference step of joint coordinates and zeros, relative to the platform's size.
_STEP = 1e-4
# Causes with the same forces: a joint that is displaced along its leg, and a zero length.
SAME = {zero.what: zero.same_as for zero in (kind.zero_cause for kind in KINDS) if zero.same_as}

_Part = tuple[Array, list['Cause']]


class Cause(NamedTuple):
    """A possible cause of a lack of fit."""

    what: str  # keyword for programs
    places: Integers  # indices of its columns
    text: str  # description; ``{}`` stands for the amounts
    factor: float = 1.0  # factor from the amounts to the unit of the text
    measure: Callable[[Array], Any] = np.asarray
    """Function from the amounts (k,) to the values in the text."""

    def described(self, amounts: Array) -> str:
        """Return the description with the amounts (k,) of the columns."""
        values = self.factor * np.atleast_1d(self.measure(amounts))
        sign = '' if self.measure is np.linalg.norm else '+'
        return self.text.format(' '.join(f'{each:{sign}.3g}' for each in values))


def _part(what: str, columns: Array, text: str, factor: float = 1.0,
          measure: Callable[[Array], Any] = np.asarray,
          groups: Sequence[tuple[str, slice]] = (('', slice(None)),)) -> _Part:
    """
    Return columns (N, 6, m) with their causes; the indices are those among these columns.

    Each group has a word, for which ``@`` stands in the text, and some of the columns.
    """
    places = np.arange(columns.shape[-1])
    return columns, [Cause(what, places[which], text.replace('@', word), factor, measure)
                     for word, which in groups]


class Causes:
    """
    Columns of all possible causes in some extracts, with the parameters of a fit.

    ``geometry`` adds the joints and zeros, which take longer.
    """

    def __init__(self, platform: StewartPlatform, unknowns: Unknowns, fit: Fit,
                 extracts: Iterable[Extract], geometry: bool) -> None:
        p = platform.parameters
        self._platform, self._geometry = platform, geometry
        self._kind, self._unit = p.leg_kind, p.leg_kind.effort.unit
        self._theta = unknowns.theta(fit.values)
        self.samples, self._largest = 0, 0.0
        begins: dict[int, int] = {}  # samples before each bag
        for extract in extracts:
            begins.setdefault(extract.bag, self.samples)
            self.samples += len(extract.times)
            self._largest = max(self._largest, float(
                np.abs(extract.efforts[..., 0]).max(initial=0.0)))
        between = [begin / self.samples for begin in begins.values() if begin]
        self._changes = sorted({*_CHANGES, *(between if len(between) < _MOST_BAGS else ())})
        self._size = p.singularity.characteristic_length
        self._whole = unknowns.linear(fit.values)
        self._each = [(f' of {leg}', slice(n, n + 1)) for n, leg in enumerate(p.joints)]
        self._each_and_all = [*self._each, ('', slice(None))]

    def columns(self, extract: Extract, at: Array) -> tuple[Array, tuple[Cause, ...]]:
        """Return (N, 6, m) columns at times ``at``, as fractions of all, and the causes."""
        poses = self._platform.forward_kinematics(
            extract.legs[..., 0], Pose.of_rows(extract.poses))
        parts = [*self._of_forces(extract, poses, at),
                 *(self._of_geometry(extract, poses) if self._geometry else ())]
        causes: list[Cause] = []
        first = 0
        for columns, of_columns in parts:
            causes += [each._replace(places=first + each.places) for each in of_columns]
            first += columns.shape[-1]
        return np.concatenate([columns for columns, _ in parts], axis=-1), tuple(causes)

    def _of_forces(self, extract: Extract, poses: Pose, at: Array) -> Iterator[_Part]:
        """Yield forces that depend on the motion and, of a payload, on time."""
        platform = self._platform
        positions, rates, accelerations = np.moveaxis(extract.legs, -1, 0)
        rows = motions(platform, poses, rates, accelerations)
        matrix = platform.regressors(rows)
        predicted = extract.regressor @ self._theta

        yield _part('offset', _by_leg(np.ones((len(rows), 6, 1))),
                    f'a constant offset of the efforts@, {{}} {self._unit}',
                    groups=self._each_and_all)
        coulomb, *stribeck = (_by_leg(extract.slip[..., n:n + 1]) for n in range(SLIP))
        for columns in stribeck:
            yield _part('stribeck_friction', columns,
                        f'Stribeck friction, {{}} {self._unit} at low rates', measure=np.mean)
        yield _part('load_friction', coulomb * np.abs(predicted)[..., None],
                    'friction that depends on the load, {} % of it', 100.0, np.mean)
        yield _part('gain', _by_leg(predicted[..., None]),
                    'another gain of the efforts@, {} %', 100.0, groups=self._each)
        yield _part('delay', _by_leg(extract.efforts[..., 1:2]),
                    'another delay of the efforts@, {} ms', -1e3, groups=self._each)
        beyond = np.maximum(np.abs(predicted) - _SATURATED * self._largest, 0.0)
        yield _part('saturation', (-np.sign(predicted) * beyond)[..., None],
                    f'saturation of the efforts at about {self._largest:.4g} {self._unit}')
        changes = self._changes
        words = [(f'at about {100.0 * change:.0f} %', slice(4 * n, 4 * n + 4))
                 for n, change in enumerate(changes)]
        words += [(f'between {100.0 * one:.0f} and {100.0 * other:.0f} %', slice(4 * n, 4 * n + 8))
                  for n, (one, other) in enumerate(pairwise(changes))]
        after = np.where(at[:, None] >= np.repeat(changes, 4), 1.0, 0.0)
        yield _part('payload', np.tile(matrix[..., :4], len(changes)) * after[:, None],
                    'a payload that changes @ of the time, {} kg', measure=_mass, groups=words)

    def _of_geometry(self, extract: Extract, poses: Pose) -> Iterator[_Part]:
        """Yield derivatives of the efforts by zeros of positions and joint coordinates."""
        p, step, zero = self._platform.parameters, _STEP * self._size, self._kind.zero_cause
        turn = step / float(np.mean(self._kind.reach(p)))
        positions, rates, accelerations = np.moveaxis(extract.legs, -1, 0)

        def forces(platform: StewartPlatform, positions: Array) -> Array:
            found = platform.forward_kinematics(positions, poses)
            return platform.regressors(
                motions(platform, found, rates, accelerations)) @ self._whole

        there = forces(self._platform, positions)
        yield _part(zero.what, np.stack([
            (forces(self._platform, positions + change) - there) / turn
            for change in turn * np.eye(6)], axis=-1),
            f'another {zero.name}@, {{}} {zero.unit}', zero.factor, groups=self._each_and_all)
        for end in ('base', 'platform'):
            name = f'geometry.{end}_joints'
            yield _part('joint', np.stack([
                (forces(StewartPlatform(p.replaced({name: p[name] + change})), positions) - there)
                / step for change in step * np.eye(18).reshape(18, 6, 3)], axis=-1),
                f'another {end} joint@, moved by {{}} mm', 1e3, groups=[
                    (word, slice(3 * n, 3 * n + 3)) for n, (word, _) in enumerate(self._each)])


def _mass(amounts: Array) -> Array:
    """Return the mass change from amounts (mass, first moments) at one or two times."""
    mass: Array = amounts[::4].sum()
    return mass


def _by_leg(values: Array) -> Array:
    """Return columns (N, 6, 6 k) of values (N, 6, k): one column per value and leg."""
    columns = np.zeros((len(values), 6, values.shape[-1], 6))
    for leg in range(6):
        columns[:, leg, :, leg] = values[:, leg]
    return columns.reshape(len(values), 6, -1)
