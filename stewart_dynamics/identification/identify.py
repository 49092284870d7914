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
Identification of a hexapod from bags; computes the result and writes no files.

Windows of each bag are converted into extracts (``extraction``), whose sums are fitted (``fit``)
twice, the second time without outliers. Intervals and validation follow; the validation predicts
the end of each bag by a fit to the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.bags.recording import Recording
from stewart_dynamics.errors import BagError, ParameterError, PoseError, SingularityError
from stewart_dynamics.identification.extraction import Block, Extract, Extraction, Extracts
from stewart_dynamics.identification.filters import LowPass
from stewart_dynamics.identification.fit import Fit, fit, shift_of_noise
from stewart_dynamics.identification.identification_options import IdentificationOptions
from stewart_dynamics.identification.intervals import Errors, errors_of
from stewart_dynamics.identification.kinematics import pose_near
from stewart_dynamics.identification.lack_of_fit import lack_of_fit, LackOfFit
from stewart_dynamics.identification.likely_mistakes import (
    LONGEST_LAG, most_motion, of_delay, of_efforts, of_fit, of_no_pose)
from stewart_dynamics.identification.recorded_legs import find_topics, RecordedLegs, Topics
from stewart_dynamics.identification.sums import residual_of, Sums, sums_of
from stewart_dynamics.identification.unknowns import Unknowns
from stewart_dynamics.identification.windows import Window
from stewart_dynamics.mechanics.drives.motors import motor_ratio
from stewart_dynamics.mechanics.kinematics.home_pose import reach_of, shape_of
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import NEGATIVE, Parameters
from stewart_dynamics.reporting.estimates import LikelyMistake

# Minimum number of samples per cut-off period; slowly sampled bags get a lower cut-off.
_FEWEST_SAMPLES = 10.0
# Residuals above this multiple of the leg's deviation are outliers: a contact, a collision.
_OUTLIER = 8.0
# If a larger fraction exceeds it, no residual counts as an outlier.
_MOST_OUTLIERS = 0.2
# Minimum number of filtered samples.
_FEWEST = 20
# Below this number of cut-off periods the correlations of the residuals are not well known.
_SHORT = 100.0
# Squared misfit on one side of the base, relative to the other, below which it is the right side.
_BETTER = 0.25
# A notice is given if a larger share of the rates is inside the band of Coulomb friction.
_MOST_INSIDE = 0.5
# Seed of the noise that is added to determine the information due to noise alone.
_SEED = 20221


class BagRead(NamedTuple):
    """Metadata of a bag that was read."""

    path: Path
    topics: Topics
    samples: int
    seconds: float
    period: float
    cutoff: float
    rates: bool
    lag: float
    """Time by which the efforts were shifted beforehand [s]; delays of the fit are added."""
    rejected: dict[str, int]
    windows_left_out: int
    """Number of windows between gaps that are too short for the filters."""
    stops: int
    outliers: int
    deviations: tuple[float, float]
    missing: list[str]
    notices: list[str]


class Validation(NamedTuple):
    """Residuals on held-out time, RMS per leg (6,) [N], with the file's and fitted values."""

    before: Array
    after: Array
    measured: Array
    samples: int


class Identified(NamedTuple):
    """Result of an identification."""

    parameters: Parameters
    """The file's parameters with the identified values."""
    unknowns: Unknowns
    fit: Fit
    errors: Errors
    bags: tuple[BagRead, ...]
    samples: int
    """Number of filtered samples of all bags."""
    outliers: int
    """Number of filtered efforts left out after the first fit."""
    unsound: int
    """Number left out before it: outliers in samples, end stops, force limits."""
    before: Array
    """Residuals with the file's parameters, RMS (6,) [N]."""
    after: Array
    """Residuals with the identified parameters, RMS (6,) [N]."""
    measured: Array
    """Measured efforts, RMS (6,) [N]."""
    validation: Validation | None
    likely: tuple[LikelyMistake, ...]
    lack_of_fit: LackOfFit | None
    """None if the residuals are noise."""


Progress = Callable[[int], None]


class Identification:
    """
    Reads bags and identifies parameters.

    Parameters
    ----------
    parameters : Parameters
        Known or estimated parameters of the hexapod.
    options : IdentificationOptions
        IdentificationOptions of the identification.

    """

    def __init__(self, parameters: Parameters, options: IdentificationOptions) -> None:
        if parameters['base.source'] != 'fixed':
            raise ParameterError(
                f'base.source: {parameters["base.source"]}: hexapods are identified on a base at '
                'rest: must be fixed')
        self._per_effort: Array | None = None  # leg force for an effort of 1
        for option, given, name in (
                ('--motor-torque', options.motor_torque, 'actuator.screw_lead'),
                ('--motor-current', options.motor_current, 'actuator.screw_lead'),
                ('--motor-current', options.motor_current, 'drive.torque_constant')):
            if given and parameters[name] is None:
                raise ParameterError(f'{name}: has no value: {option} needs it')
        if options.motor_torque or options.motor_current:
            self._per_effort = motor_ratio(parameters) * (
                parameters['drive.torque_constant'] if options.motor_current else 1.0)
        self.parameters, self._options = parameters, options
        self.platform = StewartPlatform(parameters)
        self.unknowns = Unknowns(parameters, options.kinds)
        self.extracts = Extracts()
        self.bags: list[BagRead] = []
        self.chosen: list[Flags] = []
        self._first: tuple[Extraction, Window] | None = None
        self._noise: Array | None = None
        self._with_noise: list[tuple[Sums, Sums]] = []
        self._of_noise = 0
        self._speeds: tuple[float, ...] | None = None

    def read(self, path: Path, progress: Progress | None = None) -> None:
        """
        Read a bag.

        Raises
        ------
        BagError
            The bag cannot be read, or contains no usable data.

        """
        options = self._options
        with closing(Recording(path)) as recording:
            topics = find_topics(recording, options.node, options.measured, options.efforts)
            legs = RecordedLegs(recording, topics, self.parameters['joints'],
                                2.0 * _margin(options.cutoff) + LONGEST_LAG)
            bag = self.add(path, legs.windows(progress))
            if bag is None:
                raise BagError(
                    f'{path}: {topics.legs}: nothing to identify from: '
                    + (f'{legs.samples} samples, of which no {2.0 * _margin(options.cutoff):.2g} '
                       's are without a gap; a lower --cutoff needs even more' if legs.samples
                       else ', '.join(f'{count} messages {why}' for why, count in
                                      legs.rejected.items()) or 'no messages'))
            self.bags[-1] = bag._replace(
                topics=topics, samples=legs.samples, rejected=dict(legs.rejected),
                missing=list(recording.missing),
                notices=[*recording.notices, *bag.notices])

    def add(self, path: Path, windows: Iterable[Window]) -> BagRead | None:
        """Add the windows of a bag; return None if none of them is usable."""
        options, p = self._options, self.parameters
        number, left_out, stops, outliers, samples, lag = len(self.bags), 0, 0, 0, 0, 0
        inside = rows = 0.0
        notices: list[str] = []
        extraction: Extraction | None = None
        last: Extract | None = None
        begin = end = 0
        before = self.extracts.samples
        for window in windows:
            if extraction is None:
                extraction, begin = self._extraction(window), window.begin
            if self._per_effort is not None:
                window = window._replace(efforts=window.efforts * self._per_effort)
            fewest = 2 * extraction.margin + 2 * extraction.step
            if len(window.positions) < fewest + lag:
                left_out += 1
                continue
            if last is None and not self.bags and self._is_on_other_side(window):
                notices.append('geometry.platform_side: the efforts are those of a platform on '
                               f'the {NEGATIVE} side of its base')
                extraction = self._extraction(window)
            if last is None and options.delay:
                lag, _ = self._lag(extraction, window)
                if len(window.positions) < fewest + lag:
                    lag = 0
            window = window.with_lag(lag)
            last = self._extract(path, number, extraction, window, (
                window.begin - begin) * 1e-9, last)
            self._speeds = extraction.speeds
            stops, outliers = stops + last.stops, outliers + int(
                np.count_nonzero(window.outliers))
            samples += len(window.positions)
            inside += float(np.count_nonzero(
                np.abs(last.legs[..., 1]) < p['actuator.coulomb_velocity']))
            rows += last.known.size
            end = window.begin + round(len(window.positions) * window.period * 1e9)
            rates, period = window.rates is not None, window.period
        if extraction is None or last is None or self.extracts.samples == before:
            return None
        if extraction.cutoff < options.cutoff:
            notices.append(f'sampled at {1.0 / period:.4g} Hz: the cut-off frequency is '
                           f'{extraction.cutoff:.3g} Hz')
        short = _SHORT / extraction.cutoff
        if (self.extracts.samples - before) * extraction.step * period < short:
            notices.append(f'less than {short:.3g} s are left by the filters: intervals are too '
                           'narrow for so short a recording')
        if inside > _MOST_INSIDE * rows and any(
                'coulomb_friction' in name for name in self.unknowns.names):
            notices.append(
                f'{100.0 * inside / rows:.0f} % of the rates are below actuator.coulomb_velocity: '
                'Coulomb friction is linear there, and its value depends on that parameter')
        self.bags.append(BagRead(
            path, Topics('', ''), samples, (end - begin) * 1e-9, period, extraction.cutoff,
            rates, lag * period, {}, left_out, stops, outliers, last.deviations, [], notices))
        return self.bags[-1]

    def _extraction(self, window: Window) -> Extraction:
        cutoff = min(self._options.cutoff, 1.0 / (_FEWEST_SAMPLES * window.period))
        return Extraction(self.platform, self.unknowns, window.period, cutoff, self._speeds)

    def _lag(self, extraction: Extraction, window: Window) -> tuple[int, float]:
        """Return the lag of the efforts in samples, and the squared misfit."""
        piece, platform = most_motion(window, extraction), extraction.platform
        lengths = piece.positions[0] + platform.parameters['geometry.zero_length']
        try:
            return extraction.lag(piece, pose_near(platform, lengths),
                                  LONGEST_LAG if self._options.delay else 0.0)
        except (PoseError, SingularityError):
            return 0, 1.0

    def _is_on_other_side(self, window: Window) -> bool:
        """
        Move the platform to the negative side of its base if the efforts fit there alone.

        Both sides are tried if the parameters leave the side open: lengths are nearly the same on
        both, but weight and inertia have opposite signs on the wrong one.
        """
        parameters, platform = self.parameters, self.platform
        if reach_of(parameters, shape_of(parameters)).certain:
            return False
        _, misfit = self._lag(self._extraction(window), window)
        self.parameters = parameters.replaced({'geometry.platform_side': NEGATIVE})
        self.platform = StewartPlatform(self.parameters)
        _, below = self._lag(self._extraction(window), window)
        if below < _BETTER * misfit:
            self.unknowns = Unknowns(self.parameters, self._options.kinds)
            return True
        self.parameters, self.platform = parameters, platform
        return False

    def _extract(self, path: Path, number: int, extraction: Extraction, window: Window,
                 begin: float, last: Extract | None) -> Extract:
        try:
            lengths = window.positions[0] + self.parameters['geometry.zero_length']
            guess = last.end if last is not None else pose_near(self.platform, lengths)
            try:
                extract = extraction(window, guess)
            except (PoseError, SingularityError):
                if last is None:
                    raise
                guess = pose_near(self.platform, lengths)
                extract = extraction(window, guess)
        except (PoseError, SingularityError) as exc:
            raise BagError(f'{path}: {of_no_pose(self.parameters, window.positions)}') from exc
        self.extracts.add(number, begin, extract)
        self.chosen.append(extract.sound)
        if last is None:  # once for each bag
            noisy = extraction(window, guess, np.random.default_rng(_SEED))
            change = noisy.regressor - extract.regressor
            found = np.einsum('nla,nlb->lab', change, change)
            self._noise = found if self._noise is None else self._noise + found
            self._with_noise.append((Sums.of(extract.columns, extract.sound),
                                     Sums.of(noisy.columns, extract.sound)))
            self._of_noise += len(change)
            if self._first is None:
                self._first = extraction, window
        return extract

    def result(self) -> Identified:
        """Fit all bags and return the result."""
        options, unknowns = self._options, self.unknowns
        if self.extracts.samples < _FEWEST:
            raise BagError(f'{self.bags[0].path}: {self.extracts.samples} samples are left after '
                           f'the filters: must be at least {_FEWEST}')
        assert self._noise is not None
        noise = self._noise * (self.extracts.samples / self._of_noise)
        left = sum(np.count_nonzero(each, axis=0) for each in self.chosen)
        if np.min(left) < _FEWEST:
            raise BagError(f'{self.bags[0].path}: nothing to identify from: '
                           f'{sum(bag.stops for bag in self.bags)} samples are at an end stop or '
                           'at limits.force_max')
        unsound = sum(int(np.count_nonzero(~each)) for each in self.chosen)
        sums = self._sums()
        found = fit(sums, unknowns, noise, options.prior, self._cutoffs())
        outliers = self._leave_out_outliers(found)
        if outliers:
            sums = self._sums()
            found = fit(sums, unknowns, noise, options.prior, self._cutoffs())
        likely = [*of_delay(bag.lag + delay for bag, delay in zip(
                      self.bags, found.delays, strict=True)),
                  *of_efforts(sums, unknowns, self.parameters, self._per_effort is not None)]
        errors = errors_of(self.extracts, sums, unknowns, found, self.chosen, options.prior)
        clean, noisy = (Sums.stacked(each) for each in zip(*self._with_noise, strict=True))
        shift = shift_of_noise(clean, noisy, unknowns, found, self._cutoffs(), options.prior)
        errors = errors._replace(covariance=errors.covariance + np.outer(shift, shift))
        after = _rms(sums, unknowns, found.values, found.delays)
        measured = _measured(sums)
        lack = lack_of_fit(self.platform, self.extracts, unknowns, found, self.chosen)
        if not likely:
            assert self._first is not None
            likely += of_fit(self.parameters, unknowns, *self._first, found, lack, float(
                np.sqrt(np.mean(after ** 2) / (np.mean(measured ** 2) + 1e-300))))
        return Identified(
            unknowns.parameters(found.values), unknowns, found, errors, tuple(self.bags),
            self.extracts.samples, outliers, unsound,
            _rms(sums, unknowns, unknowns.start, found.delays), after, measured,
            self._validation(noise) if options.hold_out else None, tuple(likely), lack)

    def _sums(self, chosen: Callable[[Block], Flags] | None = None) -> Sums:
        return sums_of(self.extracts, len(self.bags),
                       chosen or (lambda block: self.chosen[block.number]))

    def _cutoffs(self) -> Array | None:
        return np.array([bag.cutoff for bag in self.bags]) if self._options.delay else None

    def residuals(self, found: Fit) -> Sequence[Array]:
        """Return the residuals of each block, (N, 6) [N]."""
        theta = self.unknowns.theta(found.values)
        return [block.columns @ residual_of(theta, found.delays[block.bag])
                for block in self.extracts]

    def _leave_out_outliers(self, found: Fit) -> int:
        """Deselect efforts with outlying residuals; return their number."""
        residuals = self.residuals(found)
        used = np.concatenate([np.where(which, each, np.nan) for which, each in zip(
            self.chosen, residuals, strict=True)])
        if np.isnan(used).all(axis=0).any():
            return 0
        deviation = np.nanmedian(np.abs(used), axis=0) / 0.6745
        far = [(np.abs(each) > _OUTLIER * deviation) & which
               for which, each in zip(self.chosen, residuals, strict=True)]
        number = sum(int(np.count_nonzero(each)) for each in far)
        if not number or number > _MOST_OUTLIERS * used.size:
            return 0
        self.chosen = [which & ~each for which, each in zip(self.chosen, far, strict=True)]
        return number

    def _validation(self, noise: Array) -> Validation | None:
        """Return the residuals at the end of each bag with a fit to the rest."""
        part, options = self._options.hold_out, self._options
        ends = [bag.seconds * (1.0 - part) for bag in self.bags]

        def held_out(block: Block) -> Flags:
            held: Flags = self.chosen[block.number] & (block.times >= ends[block.bag])[:, None]
            return held

        test = self._sums(held_out)
        train = self._sums(lambda block: self.chosen[block.number] & ~held_out(block))
        if min(test.counts.sum(axis=0)) < _FEWEST or min(train.counts.sum(axis=0)) < _FEWEST:
            return None
        found = fit(train, self.unknowns, noise * (1.0 - part), options.prior, self._cutoffs())
        return Validation(
            _rms(test, self.unknowns, self.unknowns.start, found.delays),
            _rms(test, self.unknowns, found.values, found.delays), _measured(test),
            int(test.counts.sum()) // 6)

    def close(self) -> None:
        """Remove the temporary file."""
        self.extracts.close()


def _margin(cutoff: float) -> float:
    """Return the time at each end that the filters need for a cut-off [s]."""
    fine = 1e-4
    return 2.0 * LowPass.of(fine, cutoff, cutoff).half * fine


def _rms(sums: Sums, unknowns: Unknowns, values: Array, delays: Array) -> Array:
    squares = sums.squares(unknowns.theta(values), delays).sum(axis=0)
    rms: Array = np.sqrt(squares / np.maximum(sums.counts.sum(axis=0), 1))
    return rms


def _measured(sums: Sums) -> Array:
    squares = sums.effort_squares().sum(axis=0)
    rms: Array = np.sqrt(squares / np.maximum(sums.counts.sum(axis=0), 1))
    return rms
