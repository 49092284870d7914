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

"""
From messages on ``~/measured_legs`` to what the legs feel; what is refused is counted.

A message that is refused is as one that never came: the estimate goes on with the next one, over
the time between the two.
"""

from __future__ import annotations

from collections.abc import Callable
from operator import itemgetter
from struct import Struct
from typing import Any

from stewart_dynamics.arrays import Six
from stewart_dynamics.errors import MotionError, PoseError, SingularityError, StewartError
from stewart_dynamics.messages import cdr
from stewart_dynamics.parameters import Parameters
from stewart_dynamics.runtime.external_wrench import Estimate, ExternalWrench, Measurement
from stewart_dynamics.runtime.setpoints import (
    MALFORMED, NOT_FINITE, OUT_OF_RANGE, Refusal, TOO_OLD, TWICE)

# Under the node's name.
MEASURED_LEGS = 'measured_legs'

# Why a message is refused, beside what setpoints are refused for.
LACKING = 'lacks one of the joints'
WITHOUT = 'without position, velocity or effort'
UNEVEN = 'not as many numbers as names'
UNSTAMPED = 'without a stamp'
NO_POSE = 'lengths belong to no pose'
SINGULAR = 'the way to the pose is singular'

_OF_ERROR = {PoseError: NO_POSE, SingularityError: SINGULAR, MotionError: OUT_OF_RANGE}
_FIELDS = ('position', 'velocity', 'effort')


class MeasuredLegs:
    """
    Follows the measured legs.

    Parameters
    ----------
    parameters : Parameters
        Names, zero lengths and timeout.
    step : ExternalWrench
        Another one may take its place at any time: ``step``.
    refused : callable
        Told of each refusal and its details.
    noticed : callable
        Told what a user should hear once: a restart.

    """

    def __init__(
            self, parameters: Parameters, step: ExternalWrench,
            refused: Callable[[Refusal, str], None], noticed: Callable[[str], None]) -> None:
        self.step = step
        self._joints = parameters['joints']
        self._zero_lengths = tuple(parameters['geometry.zero_length'].tolist())
        self._timeout = round(parameters['setpoint.timeout'] * 1e9)
        self._refused = refused
        self._noticed = noticed
        self._last: Estimate | None = None
        self._layout: cdr.Layout | None = None
        self._chosen: Callable[[tuple[float, ...]], tuple[Any, ...]] = itemgetter(*range(18))

    def take(self, data: bytes, known: Six, target: tuple[float, ...] | None) -> Estimate | None:
        """
        Return what a message tells, or None where it is refused.

        Parameters
        ----------
        data : bytes
            A sensor_msgs/JointState as it came, CDR.
        known, target
            See ``ExternalWrench``.

        """
        measurement = self._sound(data)
        if measurement is None or not self._in_time(measurement.stamp):
            return None
        try:
            self._last = self.step(measurement, self._last, known, target)
        except StewartError as exc:
            self._refuse(_OF_ERROR[type(exc)], str(exc))
            return None
        return self._last

    def _refuse(self, reason: str, details: str) -> None:
        self._refused(Refusal(MEASURED_LEGS, reason), details)

    def _sound(self, data: bytes) -> Measurement | None:
        """Return what a message has measured, or refuse it."""
        # Most messages have the layout of the one before.
        read = self._layout.read_one(data) if self._layout else None
        if read is None:
            try:
                read = self._read(data)
            except cdr.MalformedError as exc:
                self._refuse(MALFORMED, str(exc))
            if read is None:
                return None
        stamp, numbers = read
        values = self._chosen(numbers)
        if not cdr.finite(values):
            self._refuse(NOT_FINITE, str(values))
            return None
        if stamp == 0:
            self._refuse(UNSTAMPED, 'accelerations need the time between two of them')
            return None
        p, z = values, self._zero_lengths
        return Measurement(
            stamp, (p[0] + z[0], p[1] + z[1], p[2] + z[2], p[3] + z[3], p[4] + z[4], p[5] + z[5]),
            values[6:12], values[12:18])

    def _read(self, data: bytes) -> tuple[int, tuple[float, ...]] | None:
        """Read a message field by field and keep its layout, or refuse it."""
        fields = cdr.joint_state_fields(data)
        names, many = fields.names, len(fields.names)
        if missing := [joint for joint in self._joints if joint not in names]:
            self._refuse(LACKING, f'{", ".join(missing)}; there are {", ".join(names) or "none"}')
            return None
        counts = dict(zip(_FIELDS, (count for _, count in fields.numbers), strict=True))
        if empty := [field for field, count in counts.items() if not count]:
            self._refuse(WITHOUT, f'no {" and no ".join(empty)}')
            return None
        if uneven := [f'{count} of {field}' for field, count in counts.items() if count != many]:
            self._refuse(UNEVEN, f'{many} names, {", ".join(uneven)}')
            return None
        self._chosen = itemgetter(*(field * many + names.index(joint)
                                    for field in range(len(_FIELDS)) for joint in self._joints))
        little_endian = data[:2] == cdr.LITTLE_ENDIAN[:2]
        self._layout = (cdr.Layout(data, fields.numbers, gaps=fields.gaps) if little_endian
                        else None)
        layout = Struct(f'{"<" if little_endian else ">"}{many}d')
        numbers = [layout.unpack_from(data, at) for at, _ in fields.numbers]
        return fields.stamp, sum(numbers, ())

    def _in_time(self, stamp: int) -> bool:
        """Return whether a measurement may still be used, or refuse it."""
        back = self._last.stamp - stamp if self._last else -1
        if back > self._timeout:
            self._noticed(f'{MEASURED_LEGS}: stamps jumped back by {back / 1e9:g} s: followed as '
                          'a restart')
        elif back == 0:
            self._refuse(TWICE, f'stamp {stamp} ns')
        elif back > 0:
            self._refuse(TOO_OLD, f'stamp {stamp} ns is {back / 1e9:g} s older than the last used')
        return back < 0 or back > self._timeout
