# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Identification of a hexapod from bags; computes the result and writes no files.

Windows of each bag are converted into extracts (``extraction``). Stretches in which the platform
does not follow the model, as with brakes or in contact, are left out; the rest is fitted
(``parameter_fit``), and the end of each bag is predicted by a fit to its begin, and by the file.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from msgspec.structs import replace
import numpy as np

from stewart_dynamics.arrays import Array, Flags, NANOSECOND, SECOND
from stewart_dynamics.bags.recording import Recording
from stewart_dynamics.errors import BagError, ParameterError, PoseError, SingularityError
from stewart_dynamics.identification.extraction import (
    Extract, Extraction, Extracts, time_for_filters, WindowRead)
from stewart_dynamics.identification.identification_options import IdentificationOptions
from stewart_dynamics.identification.identification_record import BagRead
from stewart_dynamics.identification.lack_of_fit import (
    lack_of_fit, LackOfFit, LEFT_BY_FILTERS, long_pieces)
from stewart_dynamics.identification.parameter_fit import (
    best_for_file, Fit, fit, Noisy, residual_of)
from stewart_dynamics.identification.recorded_legs import find_topics, RecordedLegs
from stewart_dynamics.identification.recording_errors import (
    Comparison, LONGEST_LAG, most_motion, of_efforts, of_fit, of_no_pose, of_validation)
from stewart_dynamics.identification.unknowns import Unknowns
from stewart_dynamics.identification.window_poses import first_pose
from stewart_dynamics.identification.windows import Window
from stewart_dynamics.mechanics.drives.measured_efforts import FAR, force_per_effort
from stewart_dynamics.mechanics.kinematics.home_pose import home_of
from stewart_dynamics.mechanics.least_squares import BY_MEDIAN
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import FIXED, NEGATIVE, Parameters
from stewart_dynamics.possible_errors.hypothesis import PossibleError
from stewart_dynamics.records import of_kind
from stewart_dynamics.tables.reading import is_table

# Minimum number of samples per cut-off period; slowly sampled bags get a lower cut-off.
_FEWEST_SAMPLES = 10.0
# A notice is given if a larger share of the RMS rate is above the cut-off.
_MOST_ABOVE = 0.03
# Samples in a block that is left out where the platform does not follow the model, degrees of
# freedom of the residuals where it does, largest part that is left out, and number of fits.
_BLOCK, _FREEDOM, _MOST_HELD, _ROUNDS = 8, 4.0, 0.5, 10
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


_Chosen = Callable[[Extract], Flags]


def _used(extract: Extract) -> Flags:
    return extract.used


class Residuals(NamedTuple):
    """Residuals by the file's and by written parameters, and efforts: RMS per leg (6,)."""

    before: Array
    after: Array
    measured: Array
    samples: int

    @classmethod
    def of(cls, extracts: Extracts, unknowns: Unknowns, written: Array, delays: Array,
           chosen: _Chosen) -> Residuals:
        """Return the residuals of the chosen efforts, with delays (B,) [s]."""
        squares, counts = np.zeros((3, 6)), np.zeros(6)
        for extract in extracts:
            used, delay = chosen(extract), delays[extract.bag]
            counts += np.count_nonzero(used, axis=0)
            for n, each in enumerate((
                    *(extract.columns @ residual_of(unknowns, values, delay)
                      for values in (unknowns.start, written)),
                    extract.efforts[..., 0])):
                squares[n] += np.sum(used * each ** 2, axis=0)
        before, after, measured = np.sqrt(squares / np.maximum(counts, 1.0))
        return cls(before, after, measured, int(counts.sum()) // 6)


@dataclass(frozen=True)
class Identified:
    """Result of an identification."""

    unknowns: Unknowns
    fit: Fit
    written: Array  # values (k,) of ``parameters``
    bags: tuple[BagRead, ...]  # their delays: by which the efforts were shifted beforehand
    samples: int  # number of filtered samples of all bags
    outliers: int  # number of filtered efforts at which the platform does not follow the model
    unsound: int  # number left out before it: outliers in samples, end stops, force limits
    residuals: Residuals
    validation: Residuals | None  # residuals on held-out time, by a fit to the rest
    likely: tuple[PossibleError, ...]
    lack_of_fit: LackOfFit | None  # None if the residuals are noise, or not tested
    tested: bool  # for a lack of fit: the bags are long enough

    @cached_property
    def parameters(self) -> Parameters:
        """Return the file's parameters with the identified values; ParameterError if invalid."""
        return self.unknowns.parameters(self.written)


class _Motion(NamedTuple):
    """A window of a bag, and how much the legs move in it."""

    number: int  # among all extracts
    window: Window
    read: WindowRead
    squares: float  # sum of the squared rates


@dataclass
class _Bag:
    """A bag whose windows are being added."""

    path: Path
    begin: int  # stamp of the first sample [ns]
    period: float  # [s]
    rates: bool  # recorded
    extraction: Extraction
    lag_is_known: bool
    lag: int = 0  # of the efforts [samples]
    last: WindowRead | None = None
    motion: _Motion | None = None  # the window in which the legs move most
    filtered: int = 0  # samples left by the filters
    above: float = 0.0  # largest share of the rates above the cut-off frequency
    end: int = 0  # stamp after the last sample [ns]
    counts: Counter[str] = field(default_factory=Counter)
    notices: list[str] = field(default_factory=list)

    def is_long_enough(self, window: Window) -> bool:
        """Return whether the filters leave samples of a window whose efforts lag."""
        fewest = 2 * self.extraction.margin + 2 * self.extraction.step
        return len(window.positions) >= fewest + abs(self.lag)

    def result(self, last: WindowRead) -> BagRead:
        """Return the data of the bag, with the noise of the last window."""
        of_positions, of_rates = last.deviations
        kind = self.extraction.platform.parameters.leg_kind
        return of_kind(BagRead, kind)(
            bag=str(self.path), samples=self.counts['samples'],
            seconds=(self.end - self.begin) * NANOSECOND, period_s=self.period,
            cutoff_hz=self.extraction.cutoff, rates=self.rates,
            pieces_left_out=self.counts['left out'], samples_at_stops=self.counts['stops'],
            samples_outliers=self.counts['outliers'], noise_of_positions=of_positions,
            noise_of_rates=of_rates if self.rates else None,
            delay_s=self.lag * self.period + self.extraction.later, notices=self.notices)


class Identification:
    """Reads bags and identifies parameters, beginning with those of the file."""

    def __init__(self, parameters: Parameters, options: IdentificationOptions) -> None:
        if parameters.base.source != FIXED:
            raise ParameterError(
                f'base.source: {parameters.base.source}: hexapods are identified on a base at '
                'rest: must be fixed')
        self._per_effort = force_per_effort(
            parameters, options.motor_torque, options.motor_current)
        self.parameters, self._options = parameters, options
        self.platform = StewartPlatform(parameters)
        self.unknowns = Unknowns(parameters, options.kinds)
        self.extracts, self._noisy = Extracts(), Extracts()
        self.bags: list[BagRead] = []
        self._first: tuple[Extraction, Window] | None = None
        self._moving: list[int] = []  # for each bag the number of the extract with most motion

    def read(self, path: Path, progress: Callable[[int], None] | None = None) -> None:
        """Read a bag; raise BagError if it cannot be read, or contains no usable data."""
        options = self._options
        if is_table(path):
            raise BagError(f'{path}: a table: measured legs are read from bags; '
                           'docs/identify_from_bags.md has a script that writes one from a table')
        with closing(Recording(path)) as recording:
            topics = find_topics(recording, options.node, options.measured, options.efforts)
            needed = 2.0 * time_for_filters(options.cutoff)
            legs = RecordedLegs(
                recording, topics, self.parameters.joints, needed + LONGEST_LAG)
            bag = self.add(path, legs.windows(progress))
            if bag is None:
                raise BagError(
                    f'{path}: {topics.legs}: nothing to identify from: '
                    + (f'{legs.samples} samples, of which no {needed:.2g} s '
                       'are without a gap; a lower --cutoff needs even more' if legs.samples
                       else ', '.join(f'{count} messages {why}' for why, count in
                                      legs.rejected.items()) or 'no messages'))
            self.bags[-1] = replace(
                bag, **topics._asdict(), samples=legs.samples, rejected=dict(legs.rejected),
                missing=list(recording.missing), notices=[*recording.notices, *bag.notices])

    def add(self, path: Path, windows: Iterable[Window]) -> BagRead | None:
        """Add the windows of a bag; return None if none of them is usable."""
        bag: _Bag | None = None
        for window in windows:
            if bag is None:
                bag = _Bag(path, window.begin, window.period, window.rates is not None,
                           self._extraction(window), lag_is_known=not self._options.delay)
            if self._per_effort is not None:
                window = window._replace(efforts=window.efforts * self._per_effort)
            if not bag.is_long_enough(window):
                bag.counts['left out'] += 1
                continue
            if bag.last is None and not self.bags and self._is_on_other_side(window):
                bag.notices.append(
                    'geometry.platform_side: the efforts are those of a platform on the '
                    f'{NEGATIVE} side of its base')
                bag.extraction = self._extraction(window)
            self._add_read(bag, *self._aligned(bag, window))
        if bag is None or bag.last is None or bag.motion is None:
            return None
        self._add_noise(bag.extraction, bag.motion)
        bag.notices += self._notices(bag)
        self.bags.append(bag.result(bag.last))
        return self.bags[-1]

    def _aligned(self, bag: _Bag, window: Window) -> tuple[Window, WindowRead]:
        """Return a window with efforts at the times of its positions, and its extract."""
        if bag.lag_is_known:
            window = window.with_lag(bag.lag)
            return window, self._read_window(bag, window)
        bag.lag, _, scale = self._lag(bag.extraction, window)
        if not bag.is_long_enough(window):
            bag.lag = 0
        window = window.with_lag(bag.lag)
        self._find_delay(bag, window._replace(efforts=window.efforts / scale))
        return window, self._read_window(bag, window)

    def _add_read(self, bag: _Bag, window: Window, read: WindowRead) -> None:
        """Add a window that was read to the extracts, and count its samples."""
        speeds = np.abs(read.extract.legs[..., 1])
        squares = float(np.sum(speeds ** 2))
        if bag.motion is None or squares > bag.motion.squares:
            bag.motion = _Motion(len(self.extracts), window, read, squares)
        self.extracts.add(len(self.bags), (window.begin - bag.begin) * NANOSECOND, read)
        bag.last = read
        bag.filtered += len(read.extract.times)
        bag.above = max(bag.above, read.above)
        bag.end = window.begin + round(len(window.positions) * window.period * SECOND)
        bag.counts.update({
            'samples': len(window.positions), 'stops': read.stops,
            'outliers': np.count_nonzero(window.outliers), 'speeds': speeds.size,
            'slow': np.count_nonzero(speeds < self.parameters.actuator.coulomb_velocity)})

    def _notices(self, bag: _Bag) -> Iterator[str]:
        """Yield notices on a bag whose windows are all added."""
        extraction = bag.extraction
        if bag.above > _MOST_ABOVE:
            yield (f'{100.0 * bag.above:.0f} % of the motion is above the cut-off frequency of '
                   f'{extraction.cutoff:.3g} Hz: values and intervals are wrong; '
                   + ('raise --cutoff' if extraction.cutoff == self._options.cutoff else
                      'a slower motion or a faster recording is needed'))
        if extraction.cutoff < self._options.cutoff:
            yield (f'sampled at {1.0 / bag.period:.4g} Hz: the cut-off frequency is '
                   f'{extraction.cutoff:.3g} Hz')
        short = _SHORT / extraction.cutoff
        if bag.filtered * extraction.step * bag.period < short:
            yield (f'less than {short:.3g} s are left by the filters: intervals are too narrow '
                   'for so short a recording')
        inside = bag.counts['slow'] / bag.counts['speeds']
        if inside > _MOST_INSIDE and any(
                'coulomb_friction' in self.unknowns.names[n] for n in self.unknowns.asked):
            yield (f'{100.0 * inside:.0f} % of the rates are below actuator.coulomb_velocity: '
                   'Coulomb friction is linear there, and its value depends on that parameter')

    def _extraction(self, window: Window) -> Extraction:
        cutoff = min(self._options.cutoff, 1.0 / (_FEWEST_SAMPLES * window.period))
        speeds = self._first[0].speeds if self._first else None
        return Extraction(self.platform, self.unknowns, window.period, cutoff, speeds,
                          self._per_effort is not None)

    def _lag(self, extraction: Extraction, window: Window, of_any_scale: bool = True,
             ) -> tuple[int, float, float]:
        """Return the lag of the efforts in samples, the squared misfit, and their scale."""
        piece = most_motion(window, extraction, LONGEST_LAG)
        try:
            return extraction.lag(piece, first_pose(extraction.platform, piece),
                                  LONGEST_LAG if self._options.delay else 0.0, of_any_scale)
        except (PoseError, SingularityError):
            return 0, 1.0, 1.0

    def _is_on_other_side(self, window: Window) -> bool:
        """
        Move the platform to the negative side of its base if the efforts fit there alone.

        Both sides are tried if the parameters leave the side open: lengths are nearly the same on
        both, but weight and inertia have opposite signs on the wrong one.
        """
        parameters, platform = self.parameters, self.platform
        if home_of(parameters).certain:
            return False
        _, misfit, _ = self._lag(self._extraction(window), window, of_any_scale=False)
        self.parameters = parameters.replaced({'geometry.platform_side': NEGATIVE})
        self.platform = StewartPlatform(self.parameters)
        extraction = self._extraction(window)
        _, below, scale = self._lag(extraction, window, of_any_scale=False)
        # efforts of the file's model in any unit, or with another sign
        if below < _BETTER * misfit and (scale > 0.0 or 1.0 / FAR < -scale < FAR):
            self.unknowns = Unknowns(self.parameters, self._options.kinds)
            return True
        self.parameters, self.platform = parameters, platform
        return False

    def _read_window(self, bag: _Bag, window: Window) -> WindowRead:
        if bag.last is not None:
            with suppress(PoseError, SingularityError):
                return bag.extraction(window, bag.last.end)
        try:
            return bag.extraction(window, first_pose(self.platform, window))
        except (PoseError, SingularityError) as exc:
            raise BagError(
                f'{bag.path}: {of_no_pose(self.parameters, window.positions)}') from exc

    def _find_delay(self, bag: _Bag, window: Window) -> None:
        """
        Delay the positions of a bag as its efforts are from now on, if legs move in a window.

        Filters of the efforts cannot do that: friction that jumps between two samples aliases.
        """
        piece, cutoff = most_motion(window, bag.extraction), np.array([bag.extraction.cutoff])
        with closing(Extracts()) as one:
            for part in piece, piece, window:
                with suppress(BagError):  # a piece without a pose is no reason to reject the bag
                    read = self._read_window(bag, part)
                    bag.lag_is_known = bag.lag_is_known or read.moves
                    if not bag.lag_is_known:
                        return
                    one.clear()
                    one.add(0, 0.0, read._replace(extract=read.extract._replace(
                        used=bag.extraction.showing_delay(read.extract))))
                    bag.extraction.later += float(
                        fit(one, self.unknowns, None, cutoff, passes=1).delays[0])

    def _add_noise(self, extraction: Extraction, motion: _Motion) -> None:
        """Add the window with the most motion of a bag with more noise."""
        window = motion.window
        self._noisy.add(len(self.bags), 0.0, extraction(
            window, first_pose(self.platform, window), np.random.default_rng(_SEED)))
        self._moving.append(motion.number)
        if self._first is None:
            self._first = extraction, window

    def result(self) -> Identified:
        """Fit all bags and return the result."""
        options, unknowns, extracts = self._options, self.unknowns, self.extracts
        if extracts.samples < _FEWEST:
            raise BagError(f'{self.bags[0].bag}: {extracts.samples} samples are left after '
                           f'the filters: must be at least {_FEWEST}')
        counts = sum(np.count_nonzero(used, axis=0) for used in extracts.used)
        usable = np.min(counts) >= _FEWEST
        # The sign first: a delay of half a period fits the moving part of opposite efforts.
        likely = list(of_efforts(Comparison(extracts, unknowns, whole=not usable),
                                 self.parameters, self._per_effort is not None))
        if not usable:
            kind = self.parameters.leg_kind
            reasons = [f'possible error: {each.text}' for each in likely] or [
                f'is {kind.zero_cause.subject} right, and are the efforts in {kind.effort.unit}?']
            low, *others = *kind.position_limits, kind.effort_limit
            names = ', '.join([low, *(each.rpartition('.')[2] for each in others[:-1])])
            raise BagError(f'{self.bags[0].bag}: nothing to identify from: '
                           f'{sum(bag.samples_at_stops for bag in self.bags)} samples are at or '
                           f'beyond {names} or {others[-1].rpartition(".")[2]}: '
                           + '; '.join(reasons))
        unsound = 6 * extracts.samples - int(np.sum(counts))
        outliers = 0 if likely else self._leave_out()
        noisy = Noisy(self._moving, self._noisy)
        found = fit(extracts, unknowns, noisy, self._cutoffs)
        delays = [(bag.delay_s or 0.0) + delay
                  for bag, delay in zip(self.bags, found.delays, strict=True)]
        written = best_for_file(extracts, self.parameters, options.kinds, self._cutoffs,
                                found.ratios(unknowns))
        residuals = Residuals.of(extracts, unknowns, written, found.delays, _used)
        lack = lack_of_fit(self.platform, extracts, noisy, unknowns, found)
        fitted = Residuals.of(extracts, unknowns, found.values, found.delays, _used)
        left = float(np.sqrt(
            np.mean(fitted.after ** 2) / (np.mean(fitted.measured ** 2) + 1e-300)))
        validation, of_time = self._validation(found, noisy) if options.hold_out else (None, [])
        if not likely:
            assert self._first is not None
            likely += of_fit(
                self.parameters, unknowns, *self._first, found, lack, left, delays)
        likely = likely or of_time
        tested = bool(long_pieces(extracts))
        return Identified(
            unknowns, found, written, tuple(self.bags),
            extracts.samples, outliers, unsound, residuals, validation, tuple(likely),
            lack if tested and left > LEFT_BY_FILTERS else None, tested)

    @property
    def _cutoffs(self) -> Array:
        return np.array([bag.cutoff_hz if self._options.delay else 0.0 for bag in self.bags])

    def _leave_out(self) -> int:
        """
        Deselect blocks of efforts that are not those of the model; return the number of efforts.

        In each block the platform follows the model, with residuals that have Student's
        distribution of few degrees of freedom, or it is held, by brakes or a contact, and efforts
        are unrelated to the model, normally distributed with their own size. What is likelier
        is taken, and the rest is fitted again.
        """
        extracts = self.extracts
        used = list(extracts.used)
        held: list[Flags] = [np.zeros(len(each), dtype=bool) for each in used]
        for _ in range(_ROUNDS):
            found = fit(extracts, self.unknowns, None, self._cutoffs, passes=2)
            of_extracts = [np.where(whole, extract.columns @ residual_of(
                self.unknowns, found.values, found.delays[extract.bag]), np.nan)
                for extract, whole in zip(extracts, used, strict=True)]
            before = held
            held = self._held(of_extracts, before)
            if sum(map(np.count_nonzero, held)) > _MOST_HELD * extracts.samples:
                held = [np.zeros(len(each), dtype=bool) for each in used]
            extracts.used = [
                each & ~out[:, None] for each, out in zip(used, held, strict=True)]
            if all(map(np.array_equal, before, held)):
                break
        return sum(np.count_nonzero(each & out[:, None])
                   for each, out in zip(used, held, strict=True))

    def _held(self, residuals: list[Array], before: list[Flags]) -> list[Flags]:
        """Return which samples are in blocks in which the platform is held."""
        free = np.concatenate(
            [each[~out] for each, out in zip(residuals, before, strict=True)])
        deviation = BY_MEDIAN * np.nanmedian(np.abs(free), axis=0) + 1e-300
        sizes = np.sqrt(np.mean(np.concatenate(
            [each.efforts[..., 0] for each in self.extracts]) ** 2, axis=0)) + 1e-300
        sizes = np.maximum(sizes / deviation, 1.0)  # of forces, by the noise
        found = []
        for each in residuals:
            squares = np.nan_to_num((each / deviation) ** 2)
            edges = np.arange(0, len(each), _BLOCK)
            mean = np.add.reduceat(squares, edges)
            mean /= np.diff([*edges, len(each)])[:, None]  # of a block, of each leg
            of_free = 0.5 * (_FREEDOM + 6.0) * np.log1p(mean.sum(axis=1) / _FREEDOM)
            of_held = np.sum(np.log(sizes)) + 0.5 * np.sum(mean / sizes ** 2, axis=1)
            found.append(np.repeat(of_free > of_held, _BLOCK)[:len(each)])
        return found

    def _validation(self, found: Fit, noisy: Noisy,
                    ) -> tuple[Residuals | None, list[PossibleError]]:
        """
        Return the residuals at the end of each bag with a fit to the rest, and a possible error.

        Values that fit best with legs and gain of the file may predict the end worse than the file
        where only these are off; then all that is uncertain is fitted to the rest, and may be
        off by its uncertainty, where legs slide: in others friction has any value.
        """
        ends = [bag.seconds * (1.0 - self._options.hold_out) for bag in self.bags]

        def rest(extract: Extract) -> Flags:
            return extract.used & (extract.times < ends[extract.bag])[:, None]

        def held_out(extract: Extract) -> Flags:
            return extract.used & (extract.times >= ends[extract.bag])[:, None]

        counts = [sum(np.count_nonzero(chosen(each), axis=0) for each in self.extracts)
                  for chosen in (rest, held_out)]
        if np.min(counts) < _FEWEST:
            return None, []
        extracts, unknowns = self.extracts, self.unknowns
        written = Residuals.of(extracts, unknowns, best_for_file(
            extracts, self.parameters, self._options.kinds, self._cutoffs,
            found.ratios(unknowns), rest), found.delays, held_out)
        unit = self.parameters.leg_kind.effort.unit
        if not list(of_validation(written.before, written.after, written.measured, 0.0, unit)):
            return written, []
        whole = fit(extracts, unknowns, noisy, self._cutoffs, rest)
        slow = self.parameters.actuator.coulomb_velocity

        def sliding(extract: Extract) -> Flags:
            flags: Flags = held_out(extract) & (np.abs(extract.legs[..., 1]) > slow)
            return flags

        end = Residuals.of(extracts, unknowns, whole.values, whole.delays, sliding)
        deviation = whole.of_prediction(extracts, unknowns, sliding)
        return written, list(of_validation(
            end.before, end.after, end.measured, deviation, unit))

    def close(self) -> None:
        """Remove the temporary file."""
        self.extracts.close()
        self._noisy.close()
