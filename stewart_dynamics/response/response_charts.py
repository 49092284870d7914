# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of the response: Bode plots with bands, and the samples of steps and turn-arounds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.reporting.vector_picture import Chart, Picture
from stewart_dynamics.response.even_samples import Run, Runs
from stewart_dynamics.response.response_record import LegResponse, RecordedResponses

_WIDTH = 400.0
_LEFT, _ACROSS = 46.0, 344.0
# Top and height of the frames of a Bode plot, and of a plot over time.
_GAIN, _PHASE, _COHERENCE = (26.0, 130.0), (206.0, 130.0), (386.0, 50.0)
_TIME = (26.0, 150.0)
# Lowest gain and phase that a plot shows [dB, deg].
_LOWEST_GAIN, _LOWEST_PHASE = -40.0, -540.0
# Time around a turn-around and after a step that is shown [s], and the same in delays.
_AROUND, _IN_DELAYS = 0.2, 6.0


def bode_charts(response: RecordedResponses) -> dict[str, str]:
    """Return a Bode plot (SVG) of each axis that was excited, all with the same axes."""
    excited = {name: axis for name, axis in response.axes.items() if axis.frequency}
    return {name: _bode(f'Frequency response of {name}', [one], _span(list(excited.values())),
                        True) for name, one in excited.items()}


def legs_chart(response: RecordedResponses) -> str:
    """Return a Bode plot (SVG) of all legs; empty where they were not measured."""
    legs = list(response.legs.values())
    return _bode('Frequency responses of the legs', legs, _span(legs), False) if legs else ''


def _span(several: Sequence[LegResponse]) -> tuple[float, float, float, float]:
    """Return lowest and highest frequency, lowest gain [dB] and phase [deg] of responses."""
    if not several:
        return 0.1, 1.0, _LOWEST_GAIN, _LOWEST_PHASE
    f, gain, phase, coherence = (np.concatenate(each) for each in zip(*(
        (one.frequency, one.gain, one.phase, one.coherence) for one in several), strict=True))
    sure = coherence > 0.5
    lowest_gain = float(_decibels(gain[sure]).min(initial=-10.0))
    lowest_phase = float(phase[sure].min(initial=-90.0))
    low, high = float(f.min()), float(f.max())
    return (low, high if high > low else 2.0 * low,
            max(_LOWEST_GAIN, 10.0 * np.floor(lowest_gain / 10.0)),
            max(_LOWEST_PHASE, 90.0 * np.floor(lowest_phase / 90.0)))


def _decibels(gain: Any) -> Array:
    with np.errstate(divide='ignore'):
        found: Array = 20.0 * np.log10(gain)
    return found.clip(-300.0, 300.0)


def _bode(title: str, several: Sequence[LegResponse],
          span: tuple[float, float, float, float], alone: bool) -> str:
    low, high, lowest_gain, lowest_phase = span
    picture = Picture(_WIDTH, 474.0 if alone else 376.0, title)
    gains, phases = (
        Chart(picture, (_LEFT, top, _ACROSS, height), (low, high), values, logarithmic=True)
        for (top, height), values in (
            (_GAIN, (lowest_gain, 10.0)), (_PHASE, (lowest_phase, 90.0))))
    gains.draw_axes('', 'gain [dB]')
    phases.draw_axes('' if alone else 'frequency [Hz]', 'phase [deg]')
    for chart, level in ((gains, -3.0), (phases, -90.0)):
        picture.line(*chart.at([[low, level], [high, level]]), css='continuous')
    for n, one in enumerate(several):
        f = np.asarray(one.frequency)
        css = 'response' if alone else f'response leg{n}'
        for chart, (value, lower, upper) in (
                (gains, map(_decibels, (one.gain, one.gain_low, one.gain_high))),
                (phases, map(np.asarray, (one.phase, one.phase_low, one.phase_high)))):
            least, most = chart.y
            if alone:
                band = np.column_stack([np.concatenate([f, f[::-1]]), np.concatenate(
                    [lower, upper[::-1]]).clip(least, most)])
                picture.path(chart.at(band), closed=True, css='band')
            shown = np.where((value >= least) & (value <= most), value, np.nan)
            points = chart.at(np.column_stack([f, shown]))
            picture.path(points, css=css)
            for point in points[np.isfinite(points).all(axis=1)] if alone else ():
                picture.circle(point, 1.8, css='dot')
    if alone:
        top, height = _COHERENCE
        coherence = Chart(picture, (_LEFT, top, _ACROSS, height), (low, high), (0.0, 1.0),
                          logarithmic=True)
        coherence.draw_axes('frequency [Hz]', 'coherence', 2)
        picture.path(coherence.at(np.column_stack(
            [several[0].frequency, several[0].coherence])), css='response')
    return picture.svg()


def zoom_charts(response: RecordedResponses, samples: Runs) -> dict[str, tuple[str, str]]:
    """Return pictures (SVG) of each excited axis: its fastest change, its sharpest turn-around."""
    return {name: (_zoom(samples, n, name, axis.delay, turn=False),
                   _zoom(samples, n, name, axis.delay, turn=True))
            for n, (name, axis) in enumerate(response.axes.items()) if axis.frequency}


def _zoom(samples: Runs, axis: int, name: str, delay: float | None, turn: bool) -> str:
    """Return commanded and achieved values around the fastest change or turn-around."""
    reach = max(_AROUND, _IN_DELAYS * (delay or 0.0))
    margin = round(reach * samples.rate)
    best: tuple[float, Run, int] | None = None
    for run in samples.runs:
        speed = np.diff(run.commanded[:, axis])
        change = np.abs(np.diff(speed)) * (speed[1:] * speed[:-1] < 0.0) if turn else np.abs(speed)
        inner = change[margin:len(change) - margin]
        if len(inner) and (best is None or inner.max() > best[0]):
            best = float(inner.max()), run, margin + int(inner.argmax()) + 1
    if best is None:
        return ''
    _, run, at = best
    which = slice(max(at - margin // (1 if turn else 3), 0), at + margin + 1)
    seconds = run.seconds[which] - run.seconds[at]
    unit, scale = ('mm', 1e3) if axis < 3 else ('mrad', 1e3)
    values = scale * np.stack([each[which, axis] for each in (run.commanded, run.achieved)])
    values -= values[0, 0]
    low, high = float(values.min()), float(values.max())
    margin_y = 0.05 * (high - low) or 1.0
    what = 'turn-around' if turn else 'fastest change'
    picture = Picture(_WIDTH, 218.0, f'{name}: {what}, commanded and achieved')
    top, height = _TIME
    chart = Chart(picture, (_LEFT, top, _ACROSS, height), (float(seconds[0]), float(seconds[-1])),
                  (low - margin_y, high + margin_y))
    chart.draw_axes(f'time from {run.seconds[at]:.2f} s [s]', f'{name} [{unit}]')
    for line, css in zip(values, ('commanded', 'response'), strict=True):
        picture.path(chart.at(np.column_stack([seconds, line])), css=css)
    return picture.svg()
