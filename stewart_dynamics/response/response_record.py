# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The response in summary.json: its keys, their types and meanings, in the order of the file."""

from __future__ import annotations

from typing import Annotated

from stewart_dynamics.records import means, Number, Record

Numbers = list[float]
Bounds = Annotated[tuple[Number, Number], means(
    'bounds with 95 % confidence [Hz]; a null first: may be below the lowest frequency; a null '
    'last: may be above the highest')]


class SecondOrder(Record):
    """A drive of second order behind a delay."""

    gain: Annotated[float, means('of slow motion')]
    delay: Annotated[float, means('[s]')]
    damping: Annotated[float, means('damping ratio')]
    natural_frequency: Annotated[float, means('[Hz]')]


class LegResponse(Record):
    """The response of one quantity to its command; without arguments it is not stated."""

    frequency: Annotated[Numbers, means(
        'frequencies at which it was excited [Hz]; empty: not stated')] = []
    opposite: Annotated[bool, means(
        'slow motion has the opposite sign: there is no delay')] = False
    gain: Annotated[Numbers, means('at these frequencies')] = []
    phase: Annotated[Numbers, means('at these frequencies [deg]')] = []
    coherence: Annotated[Numbers, means('at these frequencies')] = []
    gain_low: Annotated[Numbers, means('lower bounds with 95 % confidence')] = []
    gain_high: Annotated[Numbers, means('upper bounds')] = []
    phase_low: Annotated[Numbers, means('lower bounds with 95 % confidence [deg]')] = []
    phase_high: Annotated[Numbers, means('upper bounds [deg]')] = []
    delay: Annotated[Number, means(
        'by how much slow motion is late [s]; null: all frequencies are above half the bandwidth, '
        'or the sign is opposite')] = None
    bandwidth_3db: Annotated[Number, means(
        '[Hz]; null: not between the analyzed frequencies')] = None
    bandwidth_90deg: Annotated[Number, means(
        '[Hz]; null: not between the analyzed frequencies')] = None
    bandwidth_3db_bounds: Bounds = (None, None)
    bandwidth_90deg_bounds: Bounds = (None, None)
    second_order: Annotated[SecondOrder | None, means(
        'drive of second order behind a delay; null: it does not fit, or the frequencies do not '
        'reach far enough')] = None


class AxisResponse(LegResponse):
    """The response of an axis of the platform."""

    cross: Annotated[dict[str, Number], means(
        'largest gain to each other axis; null: not certain; shifts in m, turns in rad')] = {}
    noise: Annotated[Number, means('RMS of the motion that is not coherent [m or rad]')] = None
    repeatability: Annotated[Number, means(
        'largest deviation of a period from the mean of the periods [m or rad]; null: the motion '
        'does not repeat')] = None
    turn_around: Annotated[Number, means(
        'largest deviation of that mean from the linear response around a reversal; likewise')
        ] = None
    reason: Annotated[str | None, means('why the axis is not stated')] = None


class LegBalance(Record):
    """Largest difference in phase between two legs."""

    phase_difference: Annotated[float, means('[deg]')]
    frequency: Annotated[float, means('[Hz]')]


class AxesResponse(Record):
    """The responses of the axes, and by how much the clock of the measured samples drifts."""

    x: AxisResponse
    y: AxisResponse
    z: AxisResponse
    rx: AxisResponse
    ry: AxisResponse
    rz: AxisResponse
    clock_drift: Annotated[Number, means(
        'change of the delay with time [s/s]; null: not certain')]

    @property
    def axes(self) -> dict[str, AxisResponse]:
        """Return the axes by their names."""
        return {'x': self.x, 'y': self.y, 'z': self.z, 'rx': self.rx, 'ry': self.ry,
                'rz': self.rz}


class RecordedResponses(AxesResponse):
    """How a platform follows its setpoints in a recording."""

    legs: Annotated[dict[str, LegResponse], means(
        'from commanded to measured lengths, or angles of cranks; no legs with '
        '`--measured-pose`')]
    leg_balance: Annotated[LegBalance | None, means(
        'largest difference in phase between two legs')]
    topic: Annotated[str, means('topic of the measured legs or poses')]
    samples: Annotated[int, means('measured samples used')]
    rate: Annotated[float, means('rate of the setpoints [Hz]')]
    highest_frequency: Annotated[float, means('highest frequency that is analyzed [Hz]')]
