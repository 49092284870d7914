# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Motion of the base, from its topics: its samples, their checks, and the row at a stamp."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.rows import BASE, GRAVITY
from stewart_dynamics.parameters.table import MOVING, Parameters
from stewart_dynamics.setpoints.arrival_stamps import ArrivalStamps
from stewart_dynamics.setpoints.consistency import Consistency, inconsistencies, MessageError
from stewart_dynamics.setpoints.inconsistency_causes import QUANTITIES, RATES
from stewart_dynamics.setpoints.input_messages import BASE_ACCEL, BASE_TWIST
from stewart_dynamics.setpoints.input_stream import Clock, InputStream, Joined
from stewart_dynamics.setpoints.measured_gravity import MeasuredGravity
from stewart_dynamics.setpoints.rejections import Rejections


class BaseInput:
    """
    Follows the topics of the base.

    stream: of setpoints and base; by default one of the base alone.
    """

    def __init__(self, parameters: Parameters, rejections: Rejections,
                 noticed: Callable[[str], object], stream: InputStream | None = None) -> None:
        self._stream = stream or InputStream(parameters, (), rejections, noticed)
        self.topics = self._stream.base_topics  # empty if the base is fixed
        self._gravity = MeasuredGravity(parameters) if self.topics else None
        self._stamps = ArrivalStamps()
        self.consistency = Consistency(
            parameters.singularity.characteristic_length,
            (parameters.world_frame, parameters.base_frame),
        ) if parameters.base.source == MOVING else None
        """The check of the samples' twists and accelerations; None without samples."""

    @property
    def last(self) -> tuple[int, tuple[float, ...]] | None:
        """Return stamp [ns] and row (BASE,) of the last sample."""
        return self._stream.last_base()

    def possible_errors(self, ever: bool) -> list[MessageError]:
        """Return those in the motion of the base, see ``Setpoints.possible_errors``."""
        found = inconsistencies(self.consistency, ever, dict.fromkeys(
            QUANTITIES, BASE_TWIST) | dict.fromkeys(RATES, BASE_ACCEL))
        if self._gravity is not None:
            of_gravity = self._gravity.found.values() if ever else [self._gravity.present]
            found += [MessageError(self.topics[0], *each) for each in of_gravity if each]
        found += self._stamps.possible_errors(ever, self.topics[:1])
        return found

    def at_rest(self, known: bool) -> Array | None:
        """Return the row (BASE,) at rest, last gravity, nan if unknown; None if base is fixed."""
        if not self.topics:
            return None
        row = np.zeros(BASE)
        last = self.last
        row[GRAVITY] = last[1][GRAVITY] if last and known else np.nan
        return row

    def at(self, stamp: int) -> tuple[float, ...] | None:
        """
        Return the row (BASE,) at a stamp [ns], nan if unknown; None if the base is fixed.

        Between two samples it is interpolated, after the last extrapolated: core/joining.c.
        """
        return self._stream.base_at(stamp) if self.topics else None

    def join_message(self, topic: str, data: bytes, clock: Clock) -> bool:
        """Use a message, see ``InputStream``; return whether it completes a sample."""
        joined = self._stream.join_message(topic, data, clock)
        self.note_samples(joined)
        return len(joined.base_stamps) > 0

    def note_samples(self, joined: Joined) -> None:
        """Note new samples, which may change with the next call of the stream, for the checks."""
        stamps, values = joined.base_stamps, joined.base_values
        if not len(stamps):
            return
        self._stamps.add_readings(stamps, values)
        if self._gravity is not None:
            self._gravity.add_samples(stamps.tolist(), joined.base_rows.tolist())
        if self.consistency is not None:
            self.consistency.note_samples(stamps.copy(), values.copy(), joined.base_restarts > 0.0)
