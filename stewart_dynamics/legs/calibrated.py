# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Calibration as a kind of legs supports it: the numbers of a geometry, and the lines of its legs.

A leg has a line of force from a point that its drive may move to its platform joint. The measured
position of the drive says how long this line is, or where it begins; a measured pose says where it
ends. Base joints and platform joints are numbers of all kinds; each kind adds its own.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, TYPE_CHECKING

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.possible_errors.hypothesis import PossibleError

if TYPE_CHECKING:
    from stewart_dynamics.parameters.table import Parameters

ALL_GROUPS = 'all'
"""All groups of unknowns."""
ZERO, LENGTHS, AXES, JOINTS = 'zero', 'lengths', 'axes', 'joints'
"""Groups of unknowns, each with the same meaning for all kinds that have it."""


class Calibrated(NamedTuple):
    """A parameter of the six legs that a calibration finds."""

    name: str  # as in results: 'geometry.base_joints'
    words: str  # in the plural: 'base joints'
    unit: str
    group: str
    axes: tuple[str, ...] = ('',)  # names of the numbers of a leg


BASE_JOINTS = Calibrated('geometry.base_joints', 'base joints', 'm', JOINTS, ('x', 'y', 'z'))
PLATFORM_JOINTS = Calibrated(
    'geometry.platform_joints', 'platform joints', 'm', JOINTS, ('x', 'y', 'z'))


class CalibratedLines(NamedTuple):
    """The lines of the legs in N poses."""

    lengths: Array  # (N, 6) [m]
    directions: Array  # toward the platform joint (N, 6, 3)
    drives: Array  # derivatives of the residuals by the measured positions (N, 6)
    own: Array  # the same by the numbers of the kind, in their order (N, 6, m)


class ComparedPositions(NamedTuple):
    """Positions of drives at N poses, by the file and measured."""

    errors: Array  # their differences (N, 6), up to a constant of each leg
    motions: tuple[Array, ...]  # positions (N, 6) that vary as much as the drives move


class ZeroStep(NamedTuple):
    """An error that the zero of a drive has from its assembly."""

    size: float  # of the error, in the unit of the drive
    words: str  # 'one tooth'
    kind: str  # which one of several that have the same words: '14.4 deg of 25'
    mounted: bool = True  # whether a drive that is off by it can be used as it is


class CalibratedLegs(ABC):
    """
    The legs of a parameter file with other numbers.

    Attributes
    ----------
    own : tuple of Calibrated
        Parameters besides base and platform joints.
    joint_scale : float
        Change of a joint that would matter, by the characteristic length.
    units : mapping
        Units that positions of drives may be given in wrongly, and their sizes.
    unit_option : str
        Option by which they are read in the first of these units.
    zero_part : str
        Part that sits on the zero, in words.
    zero_steps : tuple of ZeroStep
        Errors of the zero of a drive that are looked for in calibrated zeros.
    signs : bool
        Whether a drive can turn in either sense by its wiring or its settings.
    scale_words, scale_cause, scale_short : str
        Parts that give positions of drives another scale, in words.
    force_words : str
        Static efforts of the drives, in words.
    line : str
        Residual of a line, in words.

    """

    own: tuple[Calibrated, ...]
    joint_scale: float = 0.01
    units: dict[str, float]
    unit_option: str
    zero_part = ''
    zero_steps: tuple[ZeroStep, ...] = ()
    signs = False
    scale_words: str
    scale_cause: str
    scale_short: str
    force_words: str
    line: str

    def __init__(self, parameters: Parameters) -> None:
        self.parameters = parameters

    @property
    def calibrated(self) -> tuple[Calibrated, ...]:
        """Return all parameters, in the order of the numbers."""
        return BASE_JOINTS, PLATFORM_JOINTS, *self.own

    @property
    def count(self) -> int:
        """Return the number of numbers of the geometry."""
        return 6 * self.of_a_leg

    @property
    def of_a_leg(self) -> int:
        """Return the number of numbers of a leg."""
        return sum(len(each.axes) for each in self.calibrated)

    @property
    def parts(self) -> dict[str, slice]:
        """Return where the numbers of each parameter are, leg by leg."""
        places, start = {}, 0
        for each in self.calibrated:
            places[each.name] = slice(start, start + 6 * len(each.axes))
            start = places[each.name].stop
        return places

    @property
    def zero(self) -> slice:
        """Return where the zeros of the drives are."""
        return self.parts[next(each.name for each in self.own if each.group == ZERO)]

    @property
    def groups(self) -> tuple[str, ...]:
        """Return the names of the groups of unknowns, those of fewest numbers first."""
        return tuple(dict.fromkeys(each.group for each in (
            *self.own, BASE_JOINTS, PLATFORM_JOINTS)))

    def names(self) -> tuple[str, ...]:
        """Return the names of the numbers."""
        return tuple(
            '.'.join(filter(None, (each.name, joint, axis))) for each in self.calibrated
            for joint in self.parameters.joints for axis in each.axes)

    def units_of(self) -> tuple[str, ...]:
        """Return the units of the numbers."""
        return tuple(each.unit for each in self.calibrated for _ in range(6 * len(each.axes)))

    def columns(self, leg: int) -> list[int]:
        """Return the numbers of a leg."""
        return [start + axis for each, part in zip(
            self.calibrated, self.parts.values(), strict=True)
            for start in [part.start + leg * len(each.axes)] for axis in range(len(each.axes))]

    def values(self) -> Array:
        """Return the numbers (n,) of the file."""
        geometry = self.parameters.geometry
        return np.concatenate([
            geometry.base_joints.ravel(), geometry.platform_joints.ravel(), self.own_values()])

    def own_of_legs(self, values: Array) -> list[Array]:
        """Return the numbers of each own parameter (6, axes), of all numbers (n,)."""
        return [values[self.parts[each.name]].reshape(6, -1) for each in self.own]

    @abstractmethod
    def own_values(self) -> Array:
        """Return the numbers of the own parameters of the file."""

    @abstractmethod
    def scales(self, size: float) -> Array:
        """Return changes of all numbers (n,) that would matter; size: characteristic length."""

    @abstractmethod
    def lines(self, values: Array, vectors: Array, positions: Array) -> CalibratedLines:
        """
        Return the lines of the legs.

        values (n,): numbers of the geometry. vectors (N, 6, 3): from base joints to platform
        joints [m]. positions (N, 6): measured, of the drives.
        """

    @abstractmethod
    def misses(self, lengths: Array, values: Array, positions: Array) -> Array:
        """Return the residuals (N, 6) of lines of these lengths (N, 6) [m]."""

    @abstractmethod
    def compared(self, vectors: Array, residuals: Array, positions: Array) -> ComparedPositions:
        """
        Return the comparison of measured positions (N, 6) with those of the file at the poses.

        vectors (N, 6, 3): from base joints to platform joints of the file [m]. residuals (N, 6):
        by the file [m].
        """

    @abstractmethod
    def zero_guesses(self, vectors: Array, positions: Array) -> Array:
        """Return numbers (6,) of the zeros near which they are; else those of the file."""

    @abstractmethod
    def drive_positions(self, positions: Array) -> Array:
        """Return positions (..., 6) as forward kinematics takes them, of measured ones."""

    @abstractmethod
    def measured_positions(self, positions: Array) -> Array:
        """Return positions (..., 6) as they are measured, of those of inverse kinematics."""

    @abstractmethod
    def changes(self, values: Array, held: Flags, written: bool) -> dict[str, Any]:
        """
        Return the parameters of the numbers (n,) that were calibrated.

        held (n,): numbers that keep the file's values. written: for a file; otherwise so that
        measured positions keep their meaning.
        """

    @abstractmethod
    def written(self, name: str) -> tuple[str, ...]:
        """Return the parameters of a file that hold a parameter of ``calibrated``."""

    @abstractmethod
    def possible_errors(self, values: Array, size: float) -> Iterable[PossibleError]:
        """Return possible errors that show in calibrated numbers (n,); size: of the hexapod."""


def listed_groups(legs: CalibratedLegs) -> str:
    """Return the names of the groups of unknowns, for errors."""
    return ', '.join((*legs.groups, ALL_GROUPS))


def listed(names: Sequence[str]) -> str:
    """Return names in words: a, b and c."""
    return ' and '.join([', '.join(names[:-1]), names[-1]]) if len(names) > 1 else names[0]
