# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The content of calibration.json: its keys, their types and meanings."""

from __future__ import annotations

from typing import Annotated

from msgspec import field
from stewart_dynamics.records import means, Record, Value
from stewart_dynamics.reporting.estimates import EstimationResult, LikelyError

VERSION = 1  # of calibration.json; increased when the meaning of a key changes


class PosesRead(Record):
    """Where the measured poses were taken from."""

    source: Annotated[str, means('path of the file or bag')]
    legs: Annotated[str | None, means('topic of the legs in a bag; null: a file')]
    pose: Annotated[str | None, means('topic of the poses in a bag, or the file of a tracker')]
    read: Annotated[int, means('number of poses')]
    used: Annotated[int, means('number of those that are not outliers')]
    notices: Annotated[list[str], means('how the poses were read')]


class Options(Record):
    """The options as given."""

    fixed: Annotated[list[str], means('parts that keep the values of the file')]
    unknowns: Annotated[list[str], means('groups of numbers that are calibrated')]
    frames: Annotated[str, means('`known` or `unknown`')]
    hold_out: Annotated[float, means('part of the poses that validates a fit to the others')]
    millimeters: Annotated[dict[str, bool], means('numbers that were read as mm')]
    degrees: Annotated[bool, means('angles were read as degrees')]
    drive_positions: Annotated[bool, means('positions are those of turning screws')]
    accept_mistakes: Annotated[bool, means('results are written although an error is likely')]


class NoiseOfPoses(Record):
    """Standard deviations of the noise."""

    given: Annotated[bool, means('by an option; else it is estimated')]
    drive: Annotated[float, means('of the positions of the drives')] = field(
        name='{position}_{position_unit}')
    position_m: Annotated[float, means('of each coordinate of the positions')]
    rotation_rad: Annotated[float, means('of the rotations about each axis')]


class Frame(Record):
    """A frame in another one."""

    position_m: Annotated[list[float], means('its origin')]
    quaternion: Annotated[list[float], means('its rotation, x y z w')]


class FramesOfDevice(Record):
    """The frames of the device that measured the poses."""

    device_in_base: Annotated[Frame, means('frame of the device in the base frame')]
    target_in_platform: Annotated[Frame, means('frame of the target in the platform frame')]


class LegResiduals(Record):
    """RMS residuals, of lengths of legs or rods."""

    before_rms_m: Annotated[float, means('by the file')]
    after_rms_m: Annotated[float, means('calibrated')]


class ResidualsOfLegs(LegResiduals):
    """The same of all legs together, and of each."""

    legs: dict[str, LegResiduals]


class Outlier(Record):
    """A pose that was left out."""

    pose: Annotated[str, means('row or time')]
    legs: Annotated[list[str], means('legs whose positions are outliers')]
    residual_m: Annotated[float, means('largest residual')]


class ErrorsOfPoses(Record):
    """Errors of held-out poses."""

    position_rms_m: Annotated[float, means('RMS distance')]
    position_max_m: Annotated[float, means('largest distance')]
    rotation_rms_rad: Annotated[float, means('RMS angle')]
    rotation_max_rad: Annotated[float, means('largest angle')]


class Validation(Record):
    """Errors on poses that were held out."""

    poses: Annotated[int, means('number of held-out poses')]
    before: Annotated[ErrorsOfPoses | None, means(
        'errors by the file; null: by it, no pose has the leg positions')]
    after: Annotated[ErrorsOfPoses, means('errors by a fit to the others')]


class CalibrationResult(EstimationResult, kw_only=True):
    """The content of calibration.json."""

    version: Annotated[int, means('of these keys: 1')] = VERSION
    poses: PosesRead
    options: Options
    not_identified: Annotated[str | None, means('numbers that cannot be distinguished, and why')]
    noise: Annotated[NoiseOfPoses | None, means('null: as many residuals as unknowns')]
    frames: Annotated[FramesOfDevice | None, means('null: the frames are known')]
    residuals: ResidualsOfLegs
    outliers: Annotated[list[Outlier], means('poses that were left out')]
    validation: Annotated[Validation | None, means('null: too few poses')]
    assembly: Annotated[list[LikelyError], means('cranks on another tooth: `what` is `step`')]
    calibrated: Annotated[dict[str, Value], means('all parameters of `calibrated.yaml`')]
