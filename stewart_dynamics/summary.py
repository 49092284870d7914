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

"""What a motion asked of the legs, and how near a singularity it came, as a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class Peak(NamedTuple):
    """A leg's largest force, and the range of its length."""

    leg: str
    force: float
    """Largest in size, with its sign [N]; nan where no force was published."""
    force_time: float
    """[s]"""
    shortest: float
    longest: float
    clipped: bool
    """The force is the limit, and the leg would need more."""


class Summary(NamedTuple):
    """Of all samples of a motion; times are from the first sample on [s]."""

    samples: int
    duration: float
    peaks: tuple[Peak, ...]
    nearest: float
    """det(J) nearest zero [m^3]."""
    nearest_time: float
    crossings: tuple[float, ...]
    """When det(J) crossed zero, interpolated between two samples."""
    warnings: tuple[tuple[float, float], ...]
    """When each warning began and ended; the end is inf for one that was still on."""

    @classmethod
    def of(cls, legs: Sequence[str], stamps: ArrayLike, lengths: ArrayLike, forces: ArrayLike,
           determinants: ArrayLike, warnings: Sequence[tuple[int, bool]],
           force_max: ArrayLike | None = None) -> Summary:
        """
        Return the summary.

        Parameters
        ----------
        legs : sequence of str
            Six names.
        stamps : (N,)
            Of the samples [ns], at least one.
        lengths : (N, 6)
            [m]
        forces : (N, 6)
            [N]; a force that was not published is nan.
        determinants : (N,)
            [m^3]
        warnings : sequence of (stamp, on)
            The changes of the singularity warning [ns].
        force_max : (6,), optional
            To what the forces were clipped [N]; not given where they were not.

        """
        stamp = np.asarray(stamps, dtype=np.int64)
        time = (stamp - stamp[0]) * 1e-9
        length, force = np.asarray(lengths, dtype=float), np.asarray(forces, dtype=float)
        det = np.asarray(determinants, dtype=float)
        size = np.where(np.isnan(force), -np.inf, np.abs(force))
        at = np.argmax(size, axis=0)
        most = np.full(6, np.inf) if force_max is None else np.asarray(force_max, dtype=float)
        peaks = tuple(
            Peak(leg, float(force[at[n], n]), float(time[at[n]]), float(length[:, n].min()),
                 float(length[:, n].max()), bool(size[at[n], n] >= most[n]))
            for n, leg in enumerate(legs))
        nearest = int(np.argmin(np.abs(det)))
        crossings = _crossings(time, det)
        begun: list[float] = []
        spans: list[tuple[float, float]] = []
        for when, on in warnings:
            seconds = (when - int(stamp[0])) * 1e-9
            if on and not begun:
                begun.append(seconds)
            elif not on and begun:
                # One that ends before it began was on when a bag began anew.
                spans.append((begun[0], seconds if seconds >= begun[0] else np.inf))
                begun.clear()
        spans += [(seconds, np.inf) for seconds in begun]
        # where stamps jump back a bag began anew: what it lasted is what went forward
        duration = int(np.diff(stamp).clip(0).sum()) * 1e-9
        return cls(len(stamp), duration, peaks, float(det[nearest]),
                   float(time[nearest]), crossings, tuple(spans))

    def table(self) -> str:
        """Return the summary as lines that a person can read."""
        lines = [f'{self.samples} setpoints in {self.duration:.2f} s', '',
                 'leg              peak force       at     length from        to',
                 '                          N        s               m         m']
        for peak in self.peaks:
            force, when = ((f'{peak.force:16.1f}', f'{peak.force_time:8.2f}')
                           if np.isfinite(peak.force) else (f'{"none":>16}', ' ' * 8))
            mark = '*' if peak.clipped else ' '
            lines.append(f'{peak.leg:<11.11}{force}{mark}{when}{peak.shortest:16.4f}'
                         f'{peak.longest:10.4f}')
        if any(peak.clipped for peak in self.peaks):
            lines.append('* clipped to limits.force_max from then on: the leg would need more')
        lines.append('')
        if self.crossings:
            times = ', '.join(f't = {time:.3f} s' for time in self.crossings)
            lines.append(f'det(J) crossed zero at {times}: forces grow without bound there')
        else:
            lines.append('det(J) did not cross zero')
        lines.append(f'det(J) nearest zero: {self.nearest:.6g} m^3 at t = '
                     f'{self.nearest_time:.2f} s')
        for begun, ended in self.warnings:
            ahead = [time - begun for time in self.crossings if begun <= time <= ended]
            lines.append(
                f'singularity warning from t = {begun:.2f} s '
                + (f'to {ended:.2f} s' if np.isfinite(ended) else 'to the end')
                + (f': {ahead[0]:.2f} s before the crossing' if ahead else ''))
        if not self.warnings:
            lines.append('no singularity warning')
        return '\n'.join(lines)


def _crossings(time: Array, det: Array) -> tuple[float, ...]:
    """Return when det(J) changed its sign, also by way of a zero, between forward steps."""
    apart = np.flatnonzero(det)
    before = apart[:-1][np.sign(det[apart[:-1]]) != np.sign(det[apart[1:]])]
    before = before[time[before + 1] > time[before]]
    share = det[before] / (det[before] - det[before + 1])
    when: list[float] = (time[before] + share * (time[before + 1] - time[before])).tolist()
    return tuple(when)
