# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Possible causes of a lack of fit, and the forces that each of them adds, as columns.

A cause changes the efforts by its columns times small amounts, to first order: an offset, a tilt
of gravity, other masses of the legs, friction of another law, a joint or a zero length elsewhere,
another gain or delay of one leg, saturation, a payload that changes. Columns are computed at the
low rate from the filtered motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.identification.extraction import Extract, SLIP
from stewart_dynamics.identification.fit import Fit
from stewart_dynamics.identification.kinematics import motions
from stewart_dynamics.identification.tilt import Tilt
from stewart_dynamics.identification.unknowns import Unknowns
from stewart_dynamics.mechanics.dynamics.linear_parameters import (
    COULOMB_FRICTION, CYLINDER_FIRST, CYLINDER_SECOND, linear_parameters, PISTON_FIRST,
    PISTON_MASS, PISTON_SECOND, REFLECTED_MASS, VISCOUS_FRICTION)
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform

# Times at which a payload may change, as fractions of all samples.
_CHANGES = (0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875)
# Payload changes between bags are tested as well, up to this number of bags.
_MOST_BAGS = 6
# Predicted forces above this fraction of the largest effort may be cut off by saturation.
_SATURATED = 0.97
# Finite-difference step of joint coordinates and zero lengths, relative to the platform's size.
_STEP = 1e-4
UNKNOWN = 'unknown'


class Cause(NamedTuple):
    """A possible cause of a lack of fit."""

    what: str
    """Keyword for programs."""
    places: Integers
    """Indices of its columns."""
    text: str
    """Description; ``{}`` stands for the amounts."""
    factor: float = 1.0
    """Factor from the amounts to the unit of the text."""
    measure: Callable[[Array], Any] = np.asarray
    """Function from the amounts (k,) to the values in the text."""

    def described(self, amounts: Array) -> str:
        """Return the description with the amounts (k,) of the columns."""
        values = self.factor * np.atleast_1d(self.measure(amounts))
        sign = '' if self.measure is np.linalg.norm else '+'
        return self.text.format(' '.join(f'{each:{sign}.3g}' for each in values))


class Causes:
    """
    Columns of all possible causes in some extracts, with the parameters of a fit.

    ``geometry`` adds the joints and zero lengths, which take longer.
    """

    def __init__(self, platform: StewartPlatform, unknowns: Unknowns, fit: Fit,
                 extracts: Iterable[Extract], geometry: bool) -> None:
        p = platform.parameters
        self._platform, self._geometry = platform, geometry
        self._theta = unknowns.theta(fit.values)
        self._samples, self._largest = 0, 0.0
        begins: dict[int, int] = {}  # samples before each bag
        for extract in extracts:
            begins.setdefault(extract.bag, self._samples)
            self._samples += len(extract.times)
            self._largest = max(self._largest, float(
                np.abs(extract.efforts[..., 0]).max(initial=0.0)))
        between = [begin / self._samples for begin in begins.values() if begin]
        self._changes = sorted({*_CHANGES, *(between if len(between) < _MOST_BAGS else ())})
        self._tilt = Tilt(p['gravity'])
        self._size = float(p['singularity.characteristic_length'])
        self._whole = linear_parameters(p)
        self._whole[unknowns.linear] = self._theta[:len(unknowns.linear)]
        self.all: tuple[Cause, ...] = ()

    def columns(self, extract: Extract, first: int) -> Array:
        """Return an array (N, 6, m) for an extract that begins with the sample ``first``."""
        parts = dict(self._parts(extract, first))
        if not self.all:
            starts = np.cumsum([0, *(each.shape[-1] for each in parts.values())])
            places = {name: np.arange(a, b) for name, (a, b) in zip(
                parts, pairwise(starts), strict=True)}
            self.all = tuple(self._causes(places))
        return np.concatenate(list(parts.values()), axis=-1)

    def _parts(self, extract: Extract, first: int) -> Iterator[tuple[str, Array]]:
        platform, whole = self._platform, self._whole
        lengths, rates, accelerations = np.moveaxis(extract.legs, -1, 0)
        poses = platform.forward_kinematics(lengths, Pose.of_rows(extract.poses))
        rows = motions(platform, poses, rates, accelerations)
        matrix = platform.regressors(rows)
        predicted = extract.regressor @ self._theta + extract.known

        yield 'offset', _by_leg(np.ones((len(rows), 6, 1)))
        gravity = self._tilt.derivative(np.zeros(2))
        yield 'tilt', np.stack([
            platform.regressors_at_rest(rows, axis[None]) @ whole for axis in gravity.T], axis=-1)
        yield 'reflected_mass', matrix[..., REFLECTED_MASS]
        yield 'leg_mass', np.stack([
            sum(matrix[..., part] @ whole[part] for part in parts)
            for parts in ((CYLINDER_FIRST, CYLINDER_SECOND),
                          (PISTON_MASS, PISTON_FIRST, PISTON_SECOND))], axis=-1)
        yield 'viscous_friction', matrix[..., VISCOUS_FRICTION]
        slip = _by_leg(extract.slip)
        yield 'coulomb_friction', slip[..., :6]
        for n in range(1, SLIP):
            yield f'stribeck_friction {n}', slip[..., 6 * n:6 * n + 6]
        yield 'load_friction', slip[..., :6] * np.abs(predicted)[..., None]
        yield 'quadratic_friction', _by_leg((rates * np.abs(rates))[..., None])
        yield 'gain', _by_leg(predicted[..., None])
        yield 'scale', predicted[..., None]
        yield 'delay', _by_leg(extract.efforts[..., 1:2])
        beyond = np.maximum(np.abs(predicted) - _SATURATED * self._largest, 0.0)
        yield 'saturation', (-np.sign(predicted) * beyond)[..., None]
        at = (first + np.arange(len(rows))) / self._samples
        for n, change in enumerate(self._changes):
            yield f'payload {n}', matrix[..., :4] * (at >= change)[:, None, None]
        late = (at - 0.5)[:, None, None]
        yield 'friction_drift', late * np.stack([
            matrix[..., part].sum(axis=-1) for part in (VISCOUS_FRICTION, COULOMB_FRICTION)],
            axis=-1)
        yield 'offset_drift', _by_leg(np.ones((len(rows), 6, 1))) * late
        yield 'platform', matrix[..., :10]
        x = (lengths - lengths.mean(axis=0)) / self._size
        v = rates / (np.sqrt(np.mean(rates ** 2)) + 1e-300)
        yield f'{UNKNOWN} pose', _by_leg(np.stack([x, x ** 2, x ** 3], axis=-1))
        yield f'{UNKNOWN} rate', _by_leg(np.stack([np.abs(v), x * v, v ** 3], axis=-1))
        if self._geometry:
            yield from self._by_geometry(extract, poses)

    def _by_geometry(self, extract: Extract, poses: Pose) -> Iterator[tuple[str, Array]]:
        """Yield derivatives of the forces by zero lengths and joint coordinates [N/m]."""
        p, step = self._platform.parameters, _STEP * self._size
        lengths, rates, accelerations = np.moveaxis(extract.legs, -1, 0)

        def forces(platform: StewartPlatform, lengths: Array) -> Array:
            found = platform.forward_kinematics(lengths, poses)
            return platform.regressors(
                motions(platform, found, rates, accelerations)) @ self._whole

        there = forces(self._platform, lengths)
        yield 'zero_length', np.stack([
            (forces(self._platform, lengths + change) - there) / step
            for change in step * np.eye(6)], axis=-1)
        for end in ('base', 'platform'):
            name = f'geometry.{end}_joints'
            yield f'{end}_joint', np.stack([
                (forces(StewartPlatform(p.replaced({name: p[name] + change})), lengths) - there)
                / step for change in step * np.eye(18).reshape(18, 6, 3)], axis=-1)

    def _causes(self, places: dict[str, Integers]) -> Iterator[Cause]:
        joints = self._platform.parameters['joints']
        of_legs = (
            ('offset', 'a constant offset of the efforts{}, {{}} N', 1.0),
            ('reflected_mass', 'another actuator.reflected_mass{}, {{}} kg', 1.0),
            ('gain', 'another gain of the efforts{}, {{}} %', 100.0),
            ('delay', 'another delay of the efforts{}, {{}} ms', -1e3),
            *((('zero_length', 'another geometry.zero_length{}, {{}} mm', 1e3),)
              if self._geometry else ()))
        for what, text, factor in of_legs:
            for leg, place in zip(joints, places[what], strict=True):
                yield Cause(what, np.array([place]), text.format(f' of {leg}'), factor)
            if what in ('offset', 'reflected_mass', 'zero_length'):
                yield Cause(what, places[what], text.format(''), factor)

        def of_all(what: str, text: str, factor: float = 1.0,
                   measure: Callable[[Array], Any] = np.asarray) -> Cause:
            return Cause(what.partition(' ')[0], places[what], text, factor, measure)

        yield of_all('tilt', 'a base tilted by {} degrees', np.degrees(1.0), np.linalg.norm)
        yield of_all('leg_mass', 'other leg masses, cylinders and pistons {} %', 100.0)
        for n in range(1, SLIP):
            yield of_all(f'stribeck_friction {n}', 'Stribeck friction, {} N at low rates',
                         measure=np.mean)
        yield of_all('load_friction', 'friction that depends on the load, {} % of it', 100.0,
                     np.mean)
        yield of_all('quadratic_friction',
                     'friction that grows with the square of the rate, {} N s^2/m^2',
                     measure=np.mean)
        yield of_all('scale', 'efforts that are by {} % larger than the forces', 100.0)
        yield of_all('saturation', f'saturation of the efforts at about {self._largest:.4g} N')
        yield of_all('friction_drift', 'friction that changes with time')
        yield of_all('offset_drift', 'offsets of the efforts that change with time, {} N')
        yield of_all('platform', 'platform parameters that are not identified')
        yield of_all('viscous_friction', 'another actuator.viscous_friction, {} N s/m')
        yield of_all('coulomb_friction', 'another actuator.coulomb_friction, {} N')
        yield of_all(f'{UNKNOWN} pose', 'forces that depend on the pose')
        yield of_all(f'{UNKNOWN} rate', 'forces that depend on the rate')
        for n, change in enumerate(self._changes):
            yield Cause('payload', places[f'payload {n}'], (
                f'a payload that changes at about {100.0 * change:.0f} % of the time, {{}} kg'),
                1.0, _mass)
        for n, (one, other) in enumerate(pairwise(self._changes)):
            yield Cause('payload', np.concatenate(
                [places[f'payload {n}'], places[f'payload {n + 1}']]), (
                f'a payload that changes between {100.0 * one:.0f} and {100.0 * other:.0f} % of '
                'the time, {} kg'), 1.0, _mass)
        for end in ('base', 'platform') if self._geometry else ():
            for n, leg in enumerate(joints):
                yield Cause('joint', places[f'{end}_joint'][3 * n:3 * n + 3], (
                    f'another {end} joint of {leg}, moved by {{}} mm'), 1e3)


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
