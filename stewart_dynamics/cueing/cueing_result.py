# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The content of cueing.json: its keys, their types and meanings, in the order of the file."""

from __future__ import annotations

from typing import Annotated

from stewart_dynamics.records import means, Number, Record

Numbers = list[float]


class Felt(Record):
    """Demanded and achieved motion along or about an axis."""

    wanted_rms: Annotated[float, means('RMS of the demand about its mean [m/s^2 or rad/s]')]
    felt_rms: Annotated[float, means('RMS of the achieved motion, likewise')]
    correlation: Annotated[Number, means('of both; null: one is constant')]


class AxisResponse(Record):
    """The response of an axis at the frequencies of the objective motion cueing test."""

    gain: Annotated[Numbers, means('felt by wanted, measured on small motions')]
    phase_deg: Annotated[Numbers, means('likewise [deg]')]
    analytic_gain: Annotated[Numbers, means('by the equations')]
    analytic_phase_deg: Annotated[Numbers, means('likewise [deg]')]
    cross: Annotated[dict[str, Numbers], means('gains to the other axes, measured')]
    analytic_cross: Annotated[dict[str, Numbers], means(
        'gains to those axes that the equations couple')]


class Responses(Record):
    """The responses of all axes."""

    frequency_rad_s: Annotated[Numbers, means('of the objective motion cueing test')]
    surge: AxisResponse
    sway: AxisResponse
    heave: AxisResponse
    roll: AxisResponse
    pitch: AxisResponse
    yaw: AxisResponse

    @property
    def axes(self) -> dict[str, AxisResponse]:
        """Return the axes by their names."""
        return {'surge': self.surge, 'sway': self.sway, 'heave': self.heave, 'roll': self.roll,
                'pitch': self.pitch, 'yaw': self.yaw}


class Gain(Record):
    """A proposed gain and its reason."""

    name: Annotated[str, means('the parameter')]
    place: Annotated[int, means('in its array')]
    axis: Annotated[str, means('part of motion cueing, and axis')]
    before: Annotated[float, means('gain of the file')]
    value: Annotated[float, means('proposed gain')]
    reason: Annotated[str, means('the limit that ends its growth')]


class CueingResult(Record):
    """The result of motion cueing for a recorded motion."""

    software: Annotated[str, means('name and version of the program that wrote the file')]
    date: Annotated[str, means('when')]
    vehicle: Annotated[str, means('path of the recording')]
    likely_mistake: Annotated[str | None, means('the possible error in the recording')]
    duration_s: Annotated[float, means('time from the first to the last sample')]
    samples: Annotated[int, means('samples of the recording')]
    notices: Annotated[list[str], means('how the recording was read')]
    travel_m: Annotated[dict[str, Numbers], means(
        'lowest and highest position of the platform from home, by axis')]
    angular_velocity_max_rad_s: Annotated[Numbers, means('largest magnitudes, about x, y, z')]
    largest_use: Annotated[dict[str, float], means('of each kind of limit; 1: it is reached')]
    held_back_s: Annotated[dict[str, float], means(
        'time in which a limit held the demand back, of those that did')]
    demand_given: Annotated[float, means('part of the time in which no limit did')]
    felt_of_wanted: dict[str, Felt]
    response: Responses
    tuned: Annotated[list[Gain], means('proposed gains, with `--tune`')]
