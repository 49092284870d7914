# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The content of datasheet.json: its keys, their types and meanings.

A key that ends with a sign is along an axis, or about it, to plus or minus: ``x+``, ``rz-``.
"""

from __future__ import annotations

from typing import Annotated

from msgspec import field, UNSET, UnsetType
from stewart_dynamics.program import SOFTWARE
from stewart_dynamics.records import means, Number, Record, Value

VERSION = 2  # of datasheet.json; increased when the meaning of a key changes

Vector = list[float]
Stiff = Annotated[float, means('load along the axis per deflection along it')]


class Limited(Record):
    """A limit that ends something."""

    limit: Annotated[str | None, means('its name after `limits.` or `drive.`, or `singularity`')]
    leg: Annotated[str | None, means('the leg that reaches the limit; null: not a single leg')]


class Rating(Limited):
    """How far, fast or heavy until a limit ends it."""

    value: Annotated[Number, means('size [SI]; null: not limited')]


class AlongAxes(Record):
    """Ratings along axes, or about them, by axis and sign."""

    def both(self, axis: str) -> tuple[Rating, Rating]:
        """Return the ratings of an axis to minus and to plus."""
        return self.under(f'{axis}-'), self.under(f'{axis}+')


class Translations(AlongAxes):
    """Ratings along the axes."""

    x_plus: Rating = field(name='x+')
    x_minus: Rating = field(name='x-')
    y_plus: Rating = field(name='y+')
    y_minus: Rating = field(name='y-')
    z_plus: Rating = field(name='z+')
    z_minus: Rating = field(name='z-')


class Directions(Translations):
    """Ratings along and about the axes."""

    rx_plus: Rating = field(name='rx+')
    rx_minus: Rating = field(name='rx-')
    ry_plus: Rating = field(name='ry+')
    ry_minus: Rating = field(name='ry-')
    rz_plus: Rating = field(name='rz+')
    rz_minus: Rating = field(name='rz-')


class HeldForce(Translations):
    """Forces on the surroundings at rest."""

    every_direction: Annotated[float, means('smallest of all directions [N]')]


class Force(HeldForce):
    """Forces, also those that are held without end."""

    continuous: Annotated[HeldForce | UnsetType, means('held without end')] = UNSET


class HeldMoment(AlongAxes):
    """Moments on the surroundings at rest."""

    rx_plus: Rating = field(name='rx+')
    rx_minus: Rating = field(name='rx-')
    ry_plus: Rating = field(name='ry+')
    ry_minus: Rating = field(name='ry-')
    rz_plus: Rating = field(name='rz+')
    rz_minus: Rating = field(name='rz-')
    every_direction: Annotated[float, means('smallest of all directions [N m]')]


class Moment(HeldMoment):
    """Moments, also those that are held without end."""

    continuous: Annotated[HeldMoment | UnsetType, means('held without end')] = UNSET


class HeldPayload(Rating):
    """Largest point mass at the pivot, at rest [kg]."""

    any_orientation: Annotated[Number, means('in any orientation of the base [kg]')]


class RatedPayload(HeldPayload):
    """Payloads, also those that are held without end."""

    continuous: Annotated[HeldPayload | UnsetType, means('held without end')] = UNSET


class Ratings(Record, kw_only=True):
    """Rates and loads, the smallest over poses; a key is missing without a limit of it."""

    velocity: Directions | UnsetType = UNSET
    acceleration: Directions | UnsetType = UNSET
    force: Force | UnsetType = UNSET
    moment: Moment | UnsetType = UNSET
    payload: RatedPayload | UnsetType = UNSET


class Worst(Ratings):
    """The smallest over a grid of the ranges that are reachable at once."""

    poses: Annotated[int, means('number of poses')]


class RatedPose(Record):
    """The pose that is rated."""

    position: Annotated[Vector, means('of the platform frame [m]')]
    angles: Annotated[Vector, means('its Euler angles [rad]')]
    pivot_position: Annotated[Vector, means('position of the pivot [m]')]
    home: Annotated[bool, means('it is the home pose')]


class AddedPayload(Record):
    """The payload of the option."""

    mass: Annotated[float, means('[kg]')]
    center_of_mass: Annotated[Vector, means('platform frame [m]')]


class RangesAtOnce(Limited):
    """Ranges of axes that are reachable at once."""

    factor: Annotated[Number, means('by which the ranges of the axes alone are scaled')]
    ranges: Annotated[dict[str, list[Number]], means('of each axis, from the pose [m, rad]')]


class AtOnce(Record):
    """Ranges that are reachable at once."""

    translation: Annotated[RangesAtOnce, means('ranges of x, y and z')]
    rotation: Annotated[RangesAtOnce, means('ranges of the rotations')]
    all: Annotated[RangesAtOnce, means('ranges of all six')]


class Claim(Limited):
    """A box or a motion that may be possible."""

    possible: Annotated[bool, means('whether all of it is possible')]
    factor: Annotated[Number, means('how much larger a box, or faster a motion can be')]

    @property
    def holds(self) -> bool:
        """Return whether it is possible and does not contradict itself."""
        return self.possible


class Box(Claim):
    """A claimed set of ranges, with its worst pose."""

    ranges: Annotated[dict[str, list[Number]], means('as given [m, rad]')]
    excess: Annotated[Number, means('of the limit at the worst pose; null: across a singularity')]
    displacement: Annotated[dict[str, float], means('of that pose from the rated one [m, rad]')]
    position: Annotated[Vector, means('of that pose [m]')]
    angles: Annotated[Vector, means('of that pose [rad]')]


class PossibleChange(Record):
    """A change with which a motion is possible."""

    change: Annotated[str, means('`amplitude`, `speed` or `height`')]
    value: Annotated[float, means('a part, or meters away from the base')]
    words: Annotated[str, means('in words: from 93 mm higher')]


class MotionBetween(Limited):
    """How much faster a motion can be with that between its setpoints."""

    factor: Annotated[Number, means('of the planned trajectory through the setpoints')]
    at_s: Annotated[Number, means('when it is limited')]
    reason: Annotated[str | None, means('why it is not known')] = None


class JudgedMotion(Claim, kw_only=True):
    """A recorded motion."""

    bag: Annotated[str, means('path of the bag as it was given')] = ''
    at_s: Annotated[Number, means('when the motion is limited')]
    samples: Annotated[int, means('number of setpoints')]
    duration_s: Annotated[float, means('time from the first to the last')]
    largest_use: Annotated[dict[str, Number], means('of each kind of limit; 1: it is reached')]
    largest_use_limit: Annotated[str, means('the kind of limit that is used most')]
    largest_use_at_s: Annotated[float, means('when')]
    between_setpoints: Annotated[MotionBetween | None, means('with the motion between them')]
    amplitude: Annotated[Rating | None, means('how much larger about its first pose')]
    payload: Annotated[Rating | None, means('payload that can be added at the pivot [kg]')]
    possible_with: Annotated[list[PossibleChange], means('changes that make it possible')]
    rejected: Annotated[int, means('messages that could not be used')]
    missing: Annotated[list[str], means('what could not be read')]
    mistakes: Annotated[list[str], means('possible errors in the messages: it is not judged')]
    notices: Annotated[list[str], means('how the setpoints were found')]

    @property
    def holds(self) -> bool:
        """Return whether it is possible and does not contradict itself."""
        return self.possible and not self.mistakes


class Band(Record):
    """A number over hexapods."""

    low: Annotated[Number, means('percentile 2.5')]
    median: Annotated[Number, means('percentile 50')]
    high: Annotated[Number, means('percentile 97.5')]


class UncertainPayload(Record):
    """The payload of the hexapods that `uncertainty.*` admits."""

    hexapods: Annotated[int, means('N')]
    payload: Annotated[Band, means('at rest [kg]')]
    overloaded: Annotated[int, means('hexapods that carry none')]


class OfAxes(Record):
    """Stiffness along and about each axis [N/m, N m/rad], and natural frequencies."""

    x: Stiff
    y: Stiff
    z: Stiff
    rx: Stiff
    ry: Stiff
    rz: Stiff
    frequencies: Annotated[Vector, means('natural frequencies, the lowest first [Hz]')]


class FrequencySection(Record):
    """Lowest natural frequencies over a section of the workspace."""

    first: Annotated[Vector, means('displacements along the first axis of the section [m]')]
    second: Annotated[Vector, means('displacements along the second axis [m]')]
    frequencies: Annotated[list[list[Number]], means('[Hz]; null: outside')]


class Stiffness(OfAxes, kw_only=True):
    """Stiffness at the pose."""

    leg_stiffness: Annotated[float, means('as given [N/m, N m/rad]')]
    worst: Annotated[OfAxes | None, means('the smallest over a grid of the ranges at once')]
    sections: Annotated[dict[str, FrequencySection] | UnsetType, means('of the pose')] = UNSET


class RemainingMotion(Record):
    """A motion that remains with a stuck leg."""

    motion: Annotated[Vector, means('its direction [m/s, rad/s]')]
    wrench: Annotated[Vector, means('the wrench of length 1 along it [N, N m]')]
    velocity: Annotated[Rating | None, means('how fast, times the motion')]
    load_plus: Annotated[Rating | None, means('times the wrench')] = field(name='load+')
    load_minus: Annotated[Rating | None, means('against the wrench')] = field(name='load-')


class StuckLeg(Record):
    """The motions that remain with a stuck leg."""

    leg: Annotated[str, means('name of the leg')]
    lost: Annotated[Vector, means('the motion that is lost')]
    motions: Annotated[list[RemainingMotion], means('the five that remain')]
    payload: Annotated[Rating | None, means('payload at rest [kg]')]


class WorstLever(Record):
    """The smallest lever of all legs."""

    value: Annotated[float, means('1: the best')]
    leg: Annotated[str, means('its leg')]


class Drives(Record):
    """Drives with levers at rest at the pose."""

    positions: Annotated[Vector, means('of the drives [rad]')] = field(name='{positions}')
    efforts: Annotated[Vector, means('of the drives [N m]')] = field(name='{efforts}')
    lever_ratios: Annotated[Vector, means('torque by push of a rod; 1: the best')]
    worst_lever: Annotated[WorstLever | None, means('over a grid of the ranges at once')]


class Tilt(Rating):
    """The smallest of the tilts toward all azimuths."""

    azimuth: Annotated[float, means('from x to y [rad]')]


class Datasheet(Record, kw_only=True):
    """The content of datasheet.json."""

    version: Annotated[int, means('of these keys: 2')] = VERSION
    software: Annotated[str, means('name and version of the program')] = SOFTWARE
    date: Annotated[str, means('when, UTC')]
    name: Annotated[str, means('name of the hexapod')]
    pose: RatedPose
    pivot: Annotated[Vector, means('pivot, platform frame [m]')]
    added_payload: Annotated[AddedPayload | None, means('the payload of the option')]
    leg_clearance: Annotated[Number, means('smallest distance between legs at the pose [m]')]
    travel: Annotated[Directions, means('of each axis alone [m, rad]')]
    at_once: Annotated[AtOnce | None, means('ranges that are reachable at once, proven')]
    box: Annotated[Box | None, means('the claimed set of ranges, with `--box`')]
    velocity: Annotated[Directions | None, means('of each axis alone, at the pose [m/s, rad/s]')]
    acceleration: Annotated[Directions | None, means('likewise, from rest [m/s^2, rad/s^2]')]
    force: Annotated[Force | None, means('on the surroundings, at rest [N]')]
    moment: Annotated[Moment | None, means('on the surroundings, at rest [N m]')]
    payload: Annotated[RatedPayload | None, means('point mass at the pivot, at rest [kg]')]
    uncertainty: Annotated[UncertainPayload | None, means('with `--uncertainty`')]
    worst: Annotated[Worst | None, means('the smallest over a grid of the ranges at once')]
    stiffness: Annotated[Stiffness | None, means('with `--leg-stiffness`')]
    stuck_leg: Annotated[StuckLeg | None, means('with `--stuck`')]
    drives: Annotated[Drives | UnsetType, means('of cranks')] = UNSET
    tilt: Annotated[Tilt, means('smallest tilt [rad]')]
    motion: Annotated[JudgedMotion | None, means('with `--motion`')]
    parameters: Annotated[dict[str, Value], means('all of them, as used')]

    @property
    def payloads(self) -> list[tuple[str, HeldPayload]]:
        """Return the payload at rest, or those of continuous and peak torque with their kind."""
        if self.payload is None:
            return []
        held = self.payload.continuous
        return [('continuous', held), ('peak', self.payload)] if held else [('', self.payload)]

    @property
    def holds(self) -> bool:
        """Return whether box and motion are possible, and do not contradict themselves."""
        return all(each is None or each.holds for each in (self.box, self.motion))
