# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
How the axes of the platform, and the legs, follow their commands: frequency responses and noise.

A part in which the commands repeat, as the motion ``response`` of stewart_trajectory, is analyzed
by its periods, see ``frequency_response``; other motion as a whole.
"""

from __future__ import annotations

from collections.abc import Sequence

from msgspec.structs import asdict
import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.response.even_samples import Run, Runs
from stewart_dynamics.response.frequency_response import (
    FrequencyResponses, Part, parts_by_inputs, periodic_parts, responses, spectra)
from stewart_dynamics.response.local_responses import interpolated, local_responses
from stewart_dynamics.response.response_measures import CERTAIN, Response
from stewart_dynamics.response.response_record import (
    AxesResponse, AxisResponse, LegBalance, LegResponse)

AXES = AxesResponse.__struct_fields__[:6]
# Part of the largest motion of an axis below which another axis is not excited.
_EXCITED = 1e-3
_STILL = 1e-9  # [m, rad]
# Smallest drift of clocks that is stated, also in standard errors, and the periods it needs.
_DRIFT, _CERTAIN_DRIFT, _FEWEST_PERIODS = 2e-6, 5.0, 4
# Mean coherence of two inputs from which on they move alike.
_ALIKE = 0.7
# Times that lost samples are predicted.
_FILLED = 6
# Time around a reversal of an axis in which the turn-around bump is searched [s].
_AROUND = 0.1


class Analysis:
    """The frequency responses of the axes, or of the legs, of a recording."""

    def __init__(self, recorded: Runs, scales: Sequence[float]) -> None:
        self._scales = np.asarray(scales)
        self._recorded = recorded
        whole = np.concatenate([run.commanded for run in recorded.runs])
        self.excited = self._moving(whole)
        lost = np.concatenate([run.lost for run in recorded.runs])
        self._lost = float(lost.mean())
        for _ in range(_FILLED if lost.any() and not lost.all() else 0):
            self._recorded = self._recorded._replace(runs=self._filled())
        self.periodic = [
            (run, part) for run in self._recorded.runs
            for part in periodic_parts(run.commanded[:, self.excited], recorded.rate)]

    def _moving(self, commanded: Array) -> list[int]:
        sizes = commanded.std(axis=0) / self._scales
        moving: list[int] = np.flatnonzero(
            (sizes > _EXCITED * sizes.max()) & (sizes > _STILL)).tolist()
        return moving

    def axes(self) -> list[tuple[list[int], FrequencyResponses]]:
        """
        Return responses of all six outputs, with their inputs.

        Each part that repeats has its own inputs; axes that have no such part follow.
        """
        found = []
        for run, part in self.periodic:
            inputs = self._moving(run.commanded[part.begin:part.end])
            if (one := self._of([_both(run, part)], part.period, inputs)) is not None:
                found.append((inputs, one))
        covered = {each for inputs, several in found for n, each in enumerate(inputs)
                   if np.isfinite(several.responses[:, each, n]).any()}
        if set(self.excited) - covered:
            found += self._by_regression()
        return found

    def _of(self, samples: list[Array], period: int, inputs: Sequence[int],
            ) -> FrequencyResponses | None:
        found = spectra(samples, self._recorded.rate, period) if period >= 4 else None
        if not inputs or found is None or found.averages <= len(inputs):
            return None
        return responses(found, inputs, range(6, 12))

    def _filled(self) -> list[Run]:
        """
        Return the runs with lost samples as the responses so far predict them.

        Repeated, this is the EM algorithm for lost samples. What is not predicted is taken from
        the samples around a gap.
        """
        predicted = [np.zeros_like(run.achieved) for run in self._recorded.runs]
        found = self._by_regression()
        for run, total in zip(self._recorded.runs, predicted, strict=True):
            f: Array = np.fft.rfftfreq(len(run.commanded), 1.0 / self._recorded.rate).astype(
                np.float64)
            lines = np.fft.rfft(run.commanded - run.commanded.mean(axis=0), axis=0)
            for inputs, several in found:
                for number, axis in enumerate(inputs):
                    h = interpolated(several, axis, number, f)
                    total[:, axis] += np.fft.irfft(h * lines[:, axis], len(total))
        runs = []
        for run, total in zip(self._recorded.runs, predicted, strict=True):
            rest, known = run.achieved - total, np.flatnonzero(~run.lost)
            at = np.flatnonzero(run.lost)
            filled = run.achieved.copy()
            if len(known):
                filled[at] = total[at] + np.stack(
                    [np.interp(at, known, each[known]) for each in rest.T], axis=1)
            runs.append(run._replace(achieved=filled))
        return runs

    def _by_regression(self) -> list[tuple[list[int], FrequencyResponses]]:
        """Return the responses of the parts in which the same axes move, with their inputs."""
        parts: dict[tuple[int, ...], list[Array]] = {}
        for run in self._recorded.runs:
            for begin, end, moved in parts_by_inputs(
                    run.commanded[:, self.excited], self._recorded.rate):
                inputs = tuple(self.excited[each] for each in moved)
                parts.setdefault(inputs, []).append(_both(run)[begin:end])
        found = []
        for inputs, samples in parts.items():
            if (one := self._regression(samples, inputs, range(6), inputs)) is not None:
                found.append((list(inputs), one))
        return found

    def _regression(self, samples: list[Array], inputs: Sequence[int], outputs: Sequence[int],
                    own: Sequence[int]) -> FrequencyResponses | None:
        """Return the responses of outputs to inputs; both in units of their scales."""
        columns = [*inputs, *(6 + each for each in outputs)]
        scales = np.tile(self._scales, 2)[columns]
        found = local_responses(
            [each[:, columns] / scales for each in samples], self._recorded.rate, own,
            self._recorded.highest)
        if found is None:
            return None
        of_inputs, of_outputs = scales[:len(inputs)], scales[len(inputs):]
        factor = of_outputs[:, None] / of_inputs
        return found._replace(
            responses=found.responses * factor, radii=found.radii * factor,
            noise=found.noise * of_outputs ** 2)

    def legs(self) -> list[Response]:
        """
        Return the response of each leg to its own command.

        Legs are driven one by one: all parts with the period of most samples are averaged.
        """
        lengths: dict[int, list[Array]] = {}
        for run, part in self.periodic:
            lengths.setdefault(part.period, []).append(_both(run, part))
        if lengths:
            period = max(lengths, key=lambda each: sum(map(len, lengths[each])))
            whole = spectra(lengths[period], self._recorded.rate, period) if period >= 4 else None
            several = [] if whole is None or whole.averages <= 1 else [
                responses(whole, [leg], [6 + leg]) for leg in range(6)]
        else:
            samples = [_both(run) for run in self._recorded.runs]
            several = [each for leg in range(6) if (
                each := self._regression(samples, [leg], [leg], [0])) is not None]
        return [self.one(each, 0, 0) for each in several]

    def one(self, several: FrequencyResponses, output: int, number: int) -> Response:
        """Return one of several responses, at the frequencies where it is known."""
        value = several.responses[:, output, number]
        known = np.isfinite(value) & (several.frequencies <= self._recorded.highest)
        return Response(several.frequencies[known], value[known],
                        several.radii[known, output, number] / (1.0 - self._lost),
                        several.coherences[known, output, number])

    def clock_drift(self) -> float | None:
        """
        Return how much faster the clock of the achieved samples is, relative; None if not certain.

        By how much later each period is than the mean of its part, up to the highest frequency.
        """
        times: list[Array] = [np.empty(0)]
        lags: list[Array] = [np.empty(0)]
        for run, part in self.periodic:
            for axis in self._moving(run.commanded[part.begin:part.end]):
                x, y = (np.fft.rfft(each[part.begin:part.end, axis].reshape(-1, part.period))
                        for each in (run.commanded, run.achieved))
                omega = 2.0 * np.pi * self._recorded.rate / part.period * np.arange(x.shape[1])
                cross = y * x.conj()
                mean = cross.mean(axis=0)
                lines = (np.abs(x[0]) > 1e-3 * np.abs(x[0]).max()) & (
                    omega <= 2.0 * np.pi * self._recorded.highest) & (omega > 0.0)
                phase = np.angle(cross[:, lines] * mean[lines].conj())
                weights = np.abs(mean[lines]) * omega[lines]
                if not weights.any():  # it does not follow at all
                    continue
                lags.append((-phase @ weights / (weights @ omega[lines])).astype(np.float64))
                middle = 0.5 * (len(x) - 1)
                numbers: Array = np.arange(len(x), dtype=np.float64)
                times.append((numbers - middle) * (part.period / self._recorded.rate))
        t, late = np.concatenate(times), np.concatenate(lags)
        if len(t) < _FEWEST_PERIODS:
            return None
        slope = float(t @ late / (t @ t))
        error = float(np.sqrt(np.sum((late - slope * t) ** 2) / (len(t) - 1) / (t @ t)))
        return slope if abs(slope) > max(_DRIFT, _CERTAIN_DRIFT * error) else None

    def deviations(self, axis: int) -> tuple[float, float] | None:
        """
        Return repeatability and turn-around bump of an axis in its periods [m or rad].

        The largest deviation of a period from the mean of all; the largest deviation of that mean
        from the coherent response around the reversals of the axis. None without periods.
        """
        for run, part in self.periodic:
            if axis not in self._moving(run.commanded[part.begin:part.end]):
                continue
            commanded, achieved = (
                each[part.begin:part.end, axis].reshape(-1, part.period)
                for each in (run.commanded, run.achieved))
            mean = achieved.mean(axis=0)
            spread = achieved - mean
            spread = spread - spread.mean(axis=1, keepdims=True)
            x, y = np.fft.rfft(commanded.mean(axis=0)), np.fft.rfft(mean)
            x[0] = 0.0
            lines = np.abs(x) > 1e-3 * np.abs(x).max()
            y[~lines] = 0.0
            bump = mean - mean.mean() - np.fft.irfft(y, part.period)
            speed = np.diff(commanded.mean(axis=0), append=commanded[0, 0])
            turns = np.flatnonzero(speed * np.roll(speed, 1) < 0.0)
            reach = round(_AROUND * self._recorded.rate)
            near = (turns[:, None] + np.arange(-reach, reach + 1)) % part.period
            return float(np.abs(spread).max()), float(np.abs(bump[near]).max(initial=0.0))
        return None


def _both(run: Run, part: Part | None = None) -> Array:
    """Return commanded and achieved samples side by side."""
    which = slice(None) if part is None else slice(part.begin, part.end)
    return np.hstack([run.commanded[which], run.achieved[which]])


def axes_response(recorded: Runs, size: float) -> AxesResponse:
    """Return the responses of the axes; ``size`` [m] compares turns with shifts."""
    analysis = Analysis(recorded, [size] * 3 + [1.0] * 3)
    found = analysis.axes()
    axes = {}
    for axis, name in enumerate(AXES):
        pieces = [(several, inputs.index(axis)) for inputs, several in found if axis in inputs]
        own = [analysis.one(several, axis, number) for several, number in pieces]
        response = _joined(own)
        excited = bool(len(response.frequency))
        noise = next((several for (several, _), one in zip(pieces, own, strict=True)
                      if len(one.frequency)), found[0][1] if found and not excited else None)
        repeated = analysis.deviations(axis) if excited else None
        axes[name] = AxisResponse(
            **(asdict(response.measures()) if excited else {}),
            cross=_cross(analysis, pieces, axis) if excited else {},
            noise=None if noise is None else float(np.sqrt(noise.noise[:, axis] @ noise.widths)),
            repeatability=repeated and repeated[0], turn_around=repeated and repeated[1],
            reason=None if response.coherent.any() else _reason(analysis, excited, found, axis))
    return AxesResponse(**axes, clock_drift=analysis.clock_drift())


def _reason(analysis: Analysis, excited: bool,
            found: Sequence[tuple[list[int], FrequencyResponses]], axis: int) -> str:
    """Return why an axis is not stated."""
    if excited:
        return 'not coherent with its setpoints'
    if axis not in analysis.excited:
        return 'not excited'
    names = sorted({each for inputs, several in found if axis in inputs
                    for each in _moved_alike(several, inputs, axis)} | {axis})
    if len(names) < 2:
        return 'the recording is too short'
    *first, last = (AXES[each] for each in names)
    return f'not separable: {", ".join(first)} and {last} were moved alike'


def _moved_alike(several: FrequencyResponses, inputs: Sequence[int], axis: int) -> list[int]:
    """Return the axes that moved as one axis did, or, where several together did, all."""
    alike = several.alike[:, inputs.index(axis)]
    known = np.isfinite(alike).all(axis=1)
    mean = alike[known].mean(axis=0) if known.any() else np.zeros(len(inputs))
    alone = [each for n, each in enumerate(inputs) if each != axis and mean[n] > _ALIKE]
    return alone or [each for each in inputs if known.any()]


def _joined(pieces: Sequence[Response]) -> Response:
    """Return several responses of one axis as one; of a frequency the most certain."""
    if not pieces:
        none = np.empty(0)
        return Response(none, none.astype(complex), none, none)
    columns = [np.concatenate(each) for each in zip(*pieces, strict=True)]
    order = np.lexsort((columns[2], columns[0]))
    columns = [each[order] for each in columns]
    first = np.diff(columns[0], prepend=-1.0) > 1e-9
    return Response(*(each[first] for each in columns))


def _cross(analysis: Analysis, pieces: Sequence[tuple[FrequencyResponses, int]], axis: int,
           ) -> dict[str, float | None]:
    """Return the largest gain from an axis to each other one; None: lost in the noise."""
    cross: dict[str, float | None] = {}
    for other, name in enumerate(AXES):
        if other == axis:
            continue
        all_of = _joined([analysis.one(several, other, number) for several, number in pieces])
        gains = np.abs(all_of.value)
        sure = gains > CERTAIN * all_of.radius
        cross[name] = float(gains[sure].max()) if sure.any() else None
    return cross


def legs_response(recorded: Runs, joints: Sequence[str],
                  ) -> tuple[dict[str, LegResponse], LegBalance | None]:
    """Return the responses of the legs, and the largest difference between two."""
    found = Analysis(recorded, [1.0] * 6).legs()
    legs = {joint: one.measures() for joint, one in zip(joints, found, strict=False)
            if len(one.frequency)}
    return legs, _balance(found)


def _balance(legs: Sequence[Response]) -> LegBalance | None:
    """Return the largest difference in phase between two legs, and where."""
    legs = [each for each in legs if each.coherent.any()]
    if len(legs) < 2:
        return None
    top = min(each.half_bandwidth() for each in legs)
    common = legs[0].frequency[legs[0].coherent]
    for each in legs[1:]:
        common = np.intersect1d(common, each.frequency[each.coherent])
    common = common[common <= top]
    if not len(common):
        return None
    phases = np.array([np.interp(common, each.frequency, each.phase) for each in legs])
    spread = np.degrees(np.ptp(phases, axis=0))
    at = int(spread.argmax())
    return LegBalance(float(spread[at]), float(common[at]))
