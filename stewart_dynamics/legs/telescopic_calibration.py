# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Calibration of telescopic legs: ``|B - b| = z + d``, the zero length z and the position d."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.legs.calibrated import (
    Calibrated, CalibratedLegs, CalibratedLines, ComparedPositions, ZERO)
from stewart_dynamics.possible_errors.hypothesis import (
    find_errors, First, Hypothesis, PossibleError, Table)

ZERO_LENGTH = Calibrated('geometry.zero_length', 'zero lengths', 'm', ZERO)
# Zero lengths that become a smaller part of the file's are those of whole lengths; zero lengths
# that move by a larger part of the characteristic length are of other positions.
_WHOLE, _FARTHEST = 0.1, 0.3


class TelescopicCalibration(CalibratedLegs):
    """Telescopic legs with other numbers."""

    own = ZERO_LENGTH,
    units = {'mm': 1e-3}
    unit_option = '--mm-legs'
    scale_words = 'lead of the screw, gear or encoder'
    scale_cause = 'the lead of the screw or the encoder'
    scale_short = 'lead or encoder'
    force_words = 'static forces of the legs'
    line = 'length of a leg by geometry and measured pose, less its measured length'

    def own_values(self) -> Array:
        """Return the zero lengths."""
        return np.array(np.broadcast_to(self.parameters.geometry.zero_length, 6))

    def scales(self, size: float) -> Array:
        """Return a part of the characteristic length."""
        return np.full(self.count, self.joint_scale * size)

    def lines(self, values: Array, vectors: Array, positions: Array) -> CalibratedLines:
        """Return the legs; a residual falls with the zero length and with the position."""
        lengths = np.linalg.norm(vectors, axis=-1)
        return CalibratedLines(
            lengths, vectors / lengths[..., None], np.full(lengths.shape, -1.0),
            np.full((*lengths.shape, 1), -1.0))

    def misses(self, lengths: Array, values: Array, positions: Array) -> Array:
        """Return lengths less zero lengths and positions."""
        return np.asarray(lengths - values[self.zero] - positions)

    def compared(self, vectors: Array, residuals: Array, positions: Array) -> ComparedPositions:
        """Return the residuals, and positions measured and by the file."""
        del vectors
        return ComparedPositions(residuals, (positions, residuals + positions))

    def zero_guesses(self, vectors: Array, positions: Array) -> Array:
        """Return those of the file: residuals are linear in them."""
        return self.own_values()

    def drive_positions(self, positions: Array) -> Array:
        """Return lengths."""
        return np.asarray(positions + self.parameters.geometry.zero_length)

    def measured_positions(self, positions: Array) -> Array:
        """Return positions from the zero length."""
        return np.asarray(positions - self.parameters.geometry.zero_length)

    def changes(self, values: Array, held: Flags, written: bool) -> dict[str, Any]:
        """Return all of them."""
        del held, written
        return {name: values[part].tolist() for name, part in self.parts.items()}

    def written(self, name: str) -> tuple[str, ...]:
        """Return the parameter itself."""
        return name,

    def possible_errors(self, values: Array, size: float) -> Iterable[PossibleError]:
        """Return positions that are whole lengths, or relative to another length."""
        return find_errors(_ZEROS, _Zeros(list(self.parameters.joints), self.own_values(),
                                          values[self.zero], _FARTHEST * size))


class _Zeros(NamedTuple):
    """Zeros of the legs (6,), in the file and calibrated, and the farthest change [m]."""

    leg: list[str]
    zero: Array
    found: Array
    far: float


_ZEROS: Table[_Zeros] = First(
    Hypothesis('zero_length', lambda s: (
        (s.zero > s.far) & (np.abs(s.found) < _WHOLE * s.zero)).all(), (
        'the leg positions are whole lengths between the joints, not positions from '
        'geometry.zero_length; if the hexapod publishes them so, it is zero')),
    Hypothesis('zero_length', lambda s: np.abs(s.found - s.zero) - s.far, (
        'geometry.zero_length of {leg} would become {found:.4g} m in place of {zero:.4g} m: are '
        'the leg positions relative to home, or to another length?')))
