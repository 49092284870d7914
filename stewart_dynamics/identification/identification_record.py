# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The content of identification.json: its keys, their types and meanings."""

from __future__ import annotations

from typing import Annotated

from msgspec import field, UNSET, UnsetType
from stewart_dynamics.records import means, Number, Record, Value
from stewart_dynamics.replay.statements import plural
from stewart_dynamics.reporting.estimates import Estimate, EstimationResult

VERSION = 1  # of identification.json; increased when the meaning of a key changes


class BagRead(Record, kw_only=True):
    """Data of a bag that was read."""

    bag: Annotated[str, means('path of the bag as it was given')]
    samples: Annotated[int, means('samples of the legs')]
    seconds: Annotated[float, means('time from the first to the last sample')]
    period_s: Annotated[float, means('period of the samples')]
    cutoff_hz: Annotated[float, means('cut-off frequency of the filter')]
    rates: Annotated[bool, means('recorded rates are used')]
    pieces_left_out: Annotated[int, means('pieces between gaps, too short for the filters')]
    samples_at_stops: Annotated[int, means('samples left out at end stops or limits of efforts')]
    samples_outliers: Annotated[int, means('wild values that were replaced')]
    noise_of_positions: Annotated[float, means('standard deviation of the positions')] = field(
        name='noise_of_{positions}_{position_unit}')
    noise_of_rates: Annotated[Number, means('likewise; null: not recorded')] = field(
        name='noise_of_{rates}_{rate_unit}')
    delay_s: Annotated[Number, means(
        'delay of the efforts behind the positions; null: not identifiable')]
    delay_standard_error_s: Annotated[Number, means('its standard error; null: likewise')] = None
    rejected: Annotated[dict[str, int], means('rejected messages by reason')] = {}
    missing: Annotated[list[str], means('what could not be read')] = []
    notices: Annotated[list[str], means('notes on the recording and on how it was read')]
    legs: Annotated[str, means('topic of the measured legs')] = ''
    efforts: Annotated[str, means('topic of the efforts')] = ''

    @property
    def left_out(self) -> list[str]:
        """Return in words which samples and messages were not used."""
        limit = f'at an end stop or {self.kind.effort.name} limit left out'
        return [f'{plural(number, what)} {why}' for number, what, why in (
            (self.samples_outliers, 'wild value', 'replaced'),
            (self.samples_at_stops, 'sample', limit),
            (self.pieces_left_out, 'piece', 'between gaps too short for the filters'),
            *((number, 'message', f'rejected: {why}') for why, number in self.rejected.items()),
            ) if number]


class Options(Record):
    """The options as given."""

    identify: Annotated[list[str], means('groups of parameters')]
    motor_torque: Annotated[bool, means('the efforts are torques of the motors')]
    motor_current: Annotated[bool, means('the efforts are currents of the motors')]
    cutoff_hz: Annotated[float, means('cut-off frequency of the filter')]
    hold_out: Annotated[float, means('part of each bag that validates a fit to the rest')]
    delay: Annotated[bool, means('the delay of the efforts is estimated')]
    accept_mistakes: Annotated[bool, means('results are written although an error is likely')]


class LegResiduals(Record):
    """RMS of residuals and efforts."""

    before_rms: Annotated[float, means('of the residual by the file')] = field(
        name='before_rms_{effort_unit}')
    after_rms: Annotated[float, means(
        'of that by `identified.yaml`, of `validation` by a fit to the rest')] = field(
        name='after_rms_{effort_unit}')
    measured_rms: Annotated[float, means('of the efforts')] = field(
        name='measured_rms_{effort_unit}')


class ResidualsOfLegs(LegResiduals):
    """The same of all legs together, and of each."""

    legs: dict[str, LegResiduals]
    samples: Annotated[int | UnsetType, means('of `validation`: filtered samples')] = UNSET


class IdentificationResult(EstimationResult, kw_only=True):
    """The content of identification.json."""

    version: Annotated[int, means('of these keys: 1')] = VERSION
    bags: list[BagRead]
    options: Options
    samples: Annotated[int, means('filtered samples')]
    efforts_left_out: Annotated[int, means('efforts left out beforehand')]
    efforts_outliers: Annotated[int, means(
        'efforts left out in stretches in which the platform does not follow the model')]
    base_parameters: Annotated[list[Estimate] | UnsetType, means(
        'of cranks: sums of masses that torques show and that the file does not know exactly')
        ] = UNSET
    residuals: ResidualsOfLegs
    validation: Annotated[ResidualsOfLegs | None, means('on held-out time; null: too little data')]
    tested_for_lack_of_fit: Annotated[bool, means('false: the usable motion is too short')]
    identified: Annotated[dict[str, Value], means('all parameters of `identified.yaml`')]

    @property
    def shown_base_parameters(self) -> list[Estimate]:
        """Return base parameters if some of the masses in them were asked for."""
        inertial = self.kind.fields['reflected_mass'], *(each.name for each in self.kind.masses)
        return self.base_parameters or [] if any(
            each.name.startswith(inertial) for each in self.parameters) else []
