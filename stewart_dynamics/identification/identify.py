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

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, NANOSECOND, SECOND
from stewart_dynamics.bags.recording import Recording
from stewart_dynamics.errors import BagError, ParameterError, PoseError, SingularityError
from stewart_dynamics.identification.extraction import Extraction, Extracts, WindowRead
from stewart_dynamics.identification.filters import LowPass
from stewart_dynamics.identification.fit import Errors, errors_of, Fit, fit, shift_of_noise
from stewart_dynamics.identification.identification_options import IdentificationOptions
from stewart_dynamics.identification.kinematics import first_pose
from stewart_dynamics.identification.lack_of_fit import (
    lack_of_fit, LackOfFit, LEFT_BY_FILTERS, long_pieces)
from stewart_dynamics.identification.likely_mistakes import (
    LONGEST_LAG, most_motion, of_delay, of_efforts, of_fit, of_no_pose, scale_of_efforts)
from stewart_dynamics.identification.recorded_legs import find_topics, RecordedLegs
from stewart_dynamics.identification.sums import residual_of, Sums, sums_of
from stewart_dynamics.identification.unknowns import Unknowns
from stewart_dynamics.identification.windows import Window
from stewart_dynamics.mechanics.drives.measured_efforts import FAR, force_per_effort
from stewart_dynamics.mechanics.kinematics.home_pose import home_of
from stewart_dynamics.mechanics.least_squares import BY_MEDIAN
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import FIXED, NEGATIVE, Parameters
from stewart_dynamics.reporting.estimates import LikelyMistake

# Minimum number of samples per cut-off period; slowly sampled bags get a lower cut-off.
_FEWEST_SAMPLES = 10.0
# Residuals above this multiple of the leg's deviation are outliers: a contact, a collision.
_OUTLIER = 8.0
# If a larger fraction exceeds it, no residual counts as an outlier.
_MOST_OUTLIERS = 0.2
# Number of times that the delay of a bag is refined.
_REFINED = 3
# A notice is given if a larger share of the RMS rate is above the cut-off.
_MOST_ABOVE = 0.03
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
    """Data of a bag that was read, besides its extracts, by the names of identification.json."""

    bag: Path
    samples: int
    seconds: float
    period_s: float
    cutoff_hz: float
    rates: bool
    pieces_left_out: int  # number of windows between gaps that are too short for the filters
    samples_at_stops: int
    samples_outliers: int
    noise_of_lengths_m: float
    noise_of_rates_m_s: float | None
    delay_s: float
    """Time by which the efforts were shifted beforehand; delays of the fit are added."""
    rejected: dict[str, int]
    missing: list[str]
    notices: list[str]
    legs: str = ''
    efforts: str = ''


class Residuals(NamedTuple):
    """Residuals by the file's and by fitted parameters, and efforts: RMS per leg (6,) [N]."""

    before: Array
    after: Array
    measured: Array
    samples: int

    @classmethod
    def of(cls, sums: Sums, unknowns: Unknowns, found: Fit) -> Residuals:
        """Return the residuals of the efforts in some sums."""
        counts = np.maximum(sums.counts.sum(axis=0), 1)
        before, after, measured = (np.sqrt(squares.sum(axis=0) / counts) for squares in (
            sums.squares(unknowns.theta(unknowns.start), found.delays),
            sums.squares(unknowns.theta(found.values), found.delays), sums.effort_squares()))
        return cls(before, after, measured, int(sums.counts.sum()) // 6)


class Identified(NamedTuple):
    """Result of an identification."""

    parameters: Parameters  # the file's parameters with the identified values
    unknowns: Unknowns
    fit: Fit
    errors: Errors
    bags: tuple[BagRead, ...]
    samples: int  # number of filtered samples of all bags
    outliers: int  # number of filtered efforts left out after the first fit
    unsound: int  # number left out before it: outliers in samples, end stops, force limits
    residuals: Residuals
    validation: Residuals | None  # residuals on held-out time, by a fit to the rest
    likely: tuple[LikelyMistake, ...]
    lack_of_fit: LackOfFit | None  # None if the residuals are noise, or not tested
    tested: bool  # for a lack of fit: the bags are long enough


class _Motion(NamedTuple):
    """A window of a bag, and how much the legs move in it."""

    number: int  # among all extracts
    window: Window
    read: WindowRead
    squares: float  # sum of the squared rates


class Identification:
    """Reads bags and identifies parameters, beginning with those of the file."""

    def __init__(self, parameters: Parameters, options: IdentificationOptions) -> None:
        if parameters['base.source'] != FIXED:
            raise ParameterError(
                f'base.source: {parameters["base.source"]}: hexapods are identified on a base at '
                'rest: must be fixed')
        self._per_effort = force_per_effort(
            parameters, options.motor_torque, options.motor_current)
        self.parameters, self._options = parameters, options
        self.platform = StewartPlatform(parameters)
        self.unknowns = Unknowns(parameters, options.kinds, options.prior)
        self.extracts, self._noisy = Extracts(), Extracts()
        self.bags: list[BagRead] = []
        self._first: tuple[Extraction, Window] | None = None
        # For the window of each bag with the most motion: its number; sums without and with more
        # noise, the Gram matrix of that noise in the regressor, and the number of samples.
        self._moving: list[int] = []
        self._noises: list[tuple[Sums, Sums, Array, int]] = []

    def read(self, path: Path, progress: Callable[[int], None] | None = None) -> None:
        """Read a bag; raise BagError if it cannot be read, or contains no usable data."""
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
                **topics._asdict(), samples=legs.samples, rejected=dict(legs.rejected),
                missing=list(recording.missing), notices=[*recording.notices, *bag.notices])

    def add(self, path: Path, windows: Iterable[Window]) -> BagRead | None:
        """Add the windows of a bag; return None if none of them is usable."""
        options = self._options
        lag = begin = end = 0
        above = 0.0
        lag_is_known = not options.delay
        counts: Counter[str] = Counter()
        notices: list[str] = []
        extraction: Extraction | None = None
        last: WindowRead | None = None
        motion: _Motion | None = None
        before = self.extracts.samples
        for window in windows:
            if extraction is None:
                extraction, begin = self._extraction(window), window.begin
            if self._per_effort is not None:
                window = window._replace(efforts=window.efforts * self._per_effort)
            fewest = 2 * extraction.margin + 2 * extraction.step
            if len(window.positions) < fewest + abs(lag):
                counts['left out'] += 1
                continue
            if last is None and not self.bags and self._is_on_other_side(window):
                notices.append('geometry.platform_side: the efforts are those of a platform on '
                               f'the {NEGATIVE} side of its base')
                extraction = self._extraction(window)
            if not lag_is_known:
                lag, _ = self._lag(extraction, window)
                if len(window.positions) < fewest + abs(lag):
                    lag = 0
            window = window.with_lag(lag)
            read = self._read_window(path, extraction, window, last)
            if read.moves and not lag_is_known:
                lag_is_known = True
                read = self._delayed(path, extraction, window, last, read)
            last = read
            speeds = np.abs(last.extract.legs[..., 1])
            squares = float(np.sum(speeds ** 2))
            above = max(above, last.above)
            if motion is None or squares > motion.squares:
                motion = _Motion(len(self.extracts), window, last, squares)
            self.extracts.add(len(self.bags), (window.begin - begin) * NANOSECOND, last)
            counts.update({
                'samples': len(window.positions), 'stops': last.stops,
                'outliers': np.count_nonzero(window.outliers), 'speeds': speeds.size,
                'slow': np.count_nonzero(
                    speeds < self.parameters['actuator.coulomb_velocity'])})
            end = window.begin + round(len(window.positions) * window.period * SECOND)
        if extraction is None or last is None or motion is None:
            return None
        self._add_noise(extraction, motion)
        period, rates = window.period, window.rates is not None
        notices += self._notices(
            extraction, period, (self.extracts.samples - before) * extraction.step * period,
            counts['slow'] / counts['speeds'], above)
        self.bags.append(BagRead(
            path, counts['samples'], (end - begin) * NANOSECOND, period, extraction.cutoff,
            rates, counts['left out'], counts['stops'], counts['outliers'], last.deviations[0],
            last.deviations[1] if rates else None, lag * period + extraction.later,
            {}, [], notices))
        return self.bags[-1]

    def _notices(self, extraction: Extraction, period: float, filtered: float, inside: float,
                 above: float) -> Iterator[str]:
        """
        Yield notices on a bag.

        filtered: its time that the filters leave [s].
        inside, above: shares of the rates in the band of friction, and above the cut-off.
        """
        if above > _MOST_ABOVE:
            yield (f'{100.0 * above:.0f} % of the motion is above the cut-off frequency of '
                   f'{extraction.cutoff:.3g} Hz: values and intervals are wrong; '
                   + ('raise --cutoff' if extraction.cutoff == self._options.cutoff else
                      'a slower motion or a faster recording is needed'))
        if extraction.cutoff < self._options.cutoff:
            yield (f'sampled at {1.0 / period:.4g} Hz: the cut-off frequency is '
                   f'{extraction.cutoff:.3g} Hz')
        short = _SHORT / extraction.cutoff
        if filtered < short:
            yield (f'less than {short:.3g} s are left by the filters: intervals are too narrow '
                   'for so short a recording')
        if inside > _MOST_INSIDE and any(
                'coulomb_friction' in name for name in self.unknowns.names):
            yield (f'{100.0 * inside:.0f} % of the rates are below actuator.coulomb_velocity: '
                   'Coulomb friction is linear there, and its value depends on that parameter')

    def _extraction(self, window: Window) -> Extraction:
        cutoff = min(self._options.cutoff, 1.0 / (_FEWEST_SAMPLES * window.period))
        speeds = self._first[0].speeds if self._first else None
        return Extraction(self.platform, self.unknowns, window.period, cutoff, speeds,
                          self._per_effort is not None)

    def _lag(self, extraction: Extraction, window: Window) -> tuple[int, float]:
        """Return the lag of the efforts in samples, and the squared misfit."""
        piece = most_motion(window, extraction)
        try:
            return extraction.lag(piece, first_pose(extraction.platform, piece),
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
        if home_of(parameters).certain:
            return False
        _, misfit = self._lag(self._extraction(window), window)
        self.parameters = parameters.replaced({'geometry.platform_side': NEGATIVE})
        self.platform = StewartPlatform(self.parameters)
        extraction = self._extraction(window)
        _, below = self._lag(extraction, window)
        if below < _BETTER * misfit and self._of_this_model(extraction, window):
            self.unknowns = Unknowns(
                self.parameters, self._options.kinds, self._options.prior)
            return True
        self.parameters, self.platform = parameters, platform
        return False

    def _of_this_model(self, extraction: Extraction, window: Window) -> bool:
        """Return whether the efforts are those of the file's model in any unit, or with -."""
        piece = most_motion(window, extraction)
        extract = extraction(piece, first_pose(extraction.platform, piece)).extract
        scale, _ = scale_of_efforts(
            Sums.of(extract.columns, extract.used), self.unknowns, platform_too=True)
        return scale > 0.0 or 1.0 / FAR < -scale < FAR

    def _read_window(self, path: Path, extraction: Extraction, window: Window,
                     last: WindowRead | None) -> WindowRead:
        if last is not None:
            with suppress(PoseError, SingularityError):
                return extraction(window, last.end)
        try:
            return extraction(window, first_pose(self.platform, window))
        except (PoseError, SingularityError) as exc:
            raise BagError(f'{path}: {of_no_pose(self.parameters, window.positions)}') from exc

    def _delayed(self, path: Path, extraction: Extraction, window: Window,
                 last: WindowRead | None, read: WindowRead) -> WindowRead:
        """
        Return a window read with its positions delayed as its efforts are, and so from now on.

        Filters of the efforts cannot do that: friction that jumps between two samples aliases.
        """
        for _ in range(_REFINED):
            sums = Sums.of(read.extract.columns, read.extract.used)
            extraction.later += float(fit(
                sums, self.unknowns, None, np.array([extraction.cutoff])).delays[0])
            read = self._read_window(path, extraction, window, last)
        return read

    def _add_noise(self, extraction: Extraction, motion: _Motion) -> None:
        """Determine the information due to noise alone in a window."""
        window, extract = motion.window, motion.read.extract
        read = extraction(window, first_pose(self.platform, window),
                          np.random.default_rng(_SEED))
        self._noisy.add(len(self.bags), 0.0, read)
        noisy = read.extract
        self._moving.append(motion.number)
        change = noisy.regressor - extract.regressor
        self._noises.append((
            Sums.of(extract.columns, extract.used), Sums.of(noisy.columns, extract.used),
            np.einsum('nla,nlb->lab', change, change), len(change)))
        if self._first is None:
            self._first = extraction, window

    def _of_efforts(self, sums: Sums) -> list[LikelyMistake]:
        return list(of_efforts(
            sums, self.unknowns, self.parameters, self._per_effort is not None))

    def result(self) -> Identified:
        """Fit all bags and return the result."""
        options, unknowns, extracts = self._options, self.unknowns, self.extracts
        if extracts.samples < _FEWEST:
            raise BagError(f'{self.bags[0].bag}: {extracts.samples} samples are left after '
                           f'the filters: must be at least {_FEWEST}')
        sums = sums_of(extracts)
        if sums.counts.sum(axis=0).min() < _FEWEST:
            whole = sums_of(extracts, lambda each: np.ones_like(each.used))
            reasons = [f'likely mistake: {each.text}' for each in self._of_efforts(whole)] or [
                'is geometry.zero_length right, and are the efforts in N?']
            raise BagError(f'{self.bags[0].bag}: nothing to identify from: '
                           f'{sum(bag.samples_at_stops for bag in self.bags)} samples are at or '
                           'beyond limits.length_min, length_max or force_max: '
                           + '; '.join(reasons))
        unsound = 6 * extracts.samples - int(sums.counts.sum())
        clean, noisy, grams, samples = zip(*self._noises, strict=True)
        noise = sum(grams) * (extracts.samples / sum(samples))
        found = fit(sums, unknowns, noise, self._cutoffs)
        outliers = self._leave_out_outliers(found)
        if outliers:
            sums = sums_of(extracts)
            found = fit(sums, unknowns, noise, self._cutoffs)
        # The sign first: a delay of half a period fits the moving part of opposite efforts.
        likely = self._of_efforts(sums) or list(of_delay(
                bag.delay_s + delay for bag, delay in zip(
                    self.bags, found.delays, strict=True)))
        errors = errors_of(extracts, sums, unknowns, found)
        shift = shift_of_noise(
            Sums.stacked(clean), Sums.stacked(noisy), unknowns, found, self._cutoffs)
        errors = errors._replace(covariance=errors.covariance + np.outer(shift, shift))
        residuals = Residuals.of(sums, unknowns, found)
        lack = lack_of_fit(
            self.platform, extracts, self._moving, self._noisy, unknowns, found)
        left = float(np.sqrt(
            np.mean(residuals.after ** 2) / (np.mean(residuals.measured ** 2) + 1e-300)))
        if not likely:
            assert self._first is not None
            likely += of_fit(self.parameters, *self._first, found, lack, left)
        tested = bool(long_pieces(extracts))
        return Identified(
            unknowns.parameters(found.values), unknowns, found, errors, tuple(self.bags),
            extracts.samples, outliers, unsound, residuals,
            self._validation(noise) if options.hold_out else None, tuple(likely),
            lack if tested and left > LEFT_BY_FILTERS else None, tested)

    @property
    def _cutoffs(self) -> Array | None:
        return np.array([bag.cutoff_hz for bag in self.bags]) if self._options.delay else None

    def _leave_out_outliers(self, found: Fit) -> int:
        """Deselect efforts with outlying residuals; return their number."""
        theta = self.unknowns.theta(found.values)
        residuals = [
            np.where(each.used, each.columns @ residual_of(theta, found.delays[each.bag]), np.nan)
            for each in self.extracts]
        whole = np.concatenate(residuals)
        if np.isnan(whole).all(axis=0).any():
            return 0
        deviation = BY_MEDIAN * np.nanmedian(np.abs(whole), axis=0)
        far = [np.abs(each) > _OUTLIER * deviation for each in residuals]
        number = sum(map(np.count_nonzero, far))
        if number > _MOST_OUTLIERS * whole.size:
            return 0
        self.extracts.used = [
            used & ~each for used, each in zip(self.extracts.used, far, strict=True)]
        return number

    def _validation(self, noise: Array) -> Residuals | None:
        """Return the residuals at the end of each bag with a fit to the rest."""
        part = self._options.hold_out
        ends = [bag.seconds * (1.0 - part) for bag in self.bags]

        def part_of(held_out: bool) -> Sums:
            return sums_of(self.extracts, lambda each: each.used & (
                (each.times >= ends[each.bag]) == held_out)[:, None])

        test, train = part_of(True), part_of(False)
        if min(test.counts.sum(axis=0)) < _FEWEST or min(train.counts.sum(axis=0)) < _FEWEST:
            return None
        found = fit(train, self.unknowns, noise * (1.0 - part), self._cutoffs)
        return Residuals.of(test, self.unknowns, found)

    def close(self) -> None:
        """Remove the temporary file."""
        self.extracts.close()
        self._noisy.close()


def _margin(cutoff: float) -> float:
    """Return the time at each end that the filters need for a cut-off [s]."""
    fine = 1e-4
    return 2.0 * LowPass.of(fine, cutoff, cutoff).half * fine
