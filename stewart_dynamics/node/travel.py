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

"""``~/travel``: how far the platform can go from the last setpoint's pose."""

from __future__ import annotations

from collections.abc import Sequence
import math
import sys
from typing import Any

import numpy as np
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

from stewart_dynamics.capability.capability import Capability
from stewart_dynamics.compilation.functions import Preparation
from stewart_dynamics.errors import MotionError
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.mechanics.limits import (
    CLEARANCE_MIN, LENGTH_MAX, LENGTH_MIN, OF_JOINTS)
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.node.publishers_at_rate import PublisherAtRate
from stewart_dynamics.parameters.table import Parameters

_RATE = 10.0  # [Hz]
# Directions in the order of the message: each of x y z rx ry rz to minus, then to plus.
_DIRECTIONS = np.stack([-np.eye(6), np.eye(6)], axis=1).reshape(12, 6)
# Values where nothing limits, since no output is infinite: the largest number [m]; one turn [rad].
_UNLIMITED = np.repeat([sys.float_info.max, 2.0 * math.pi], 6)
_LAYOUT = MultiArrayLayout(dim=[
    MultiArrayDimension(label='x y z rx ry rz', size=6, stride=12),
    MultiArrayDimension(label='minus plus', size=2, stride=2)])
_ENDING = LENGTH_MIN, LENGTH_MAX, *OF_JOINTS, CLEARANCE_MIN
NO_LIMIT = (f'~/travel: none of {", ".join(_ENDING)} is set: it ends '
            'at singularity.stop_condition alone')


class TravelPublisher(PublisherAtRate):
    """
    Publishes the travel from the last pose.

    parameters: geometry and limits; ``use`` replaces them.
    code: machine code that is compiled once somebody subscribes.
    """

    def __init__(self, parameters: Parameters, publisher: Any, code: Preparation) -> None:
        super().__init__(publisher, _RATE)
        self._code = code
        self._read = self._said = False
        self.use(parameters)

    def use(self, parameters: Parameters) -> None:
        """Use other parameters from now on."""
        self._parameters = parameters
        self._capability: Capability | None = None

    def look(self) -> str:
        """Check whether there is a subscriber; return a notice where no limit is set, once."""
        subscribed = self._publisher.get_subscription_count() > 0
        self._read = subscribed and self._code.begin()
        if not subscribed:
            return ''
        unlimited = all(self._parameters[name] is None for name in _ENDING)
        said, self._said = self._said, True
        return NO_LIMIT if unlimited and not said else ''

    def answered(self, motion: Sequence[float]) -> None:
        """Note the pose of an answered setpoint, a row of motion."""
        if self._read:
            self._unpublished = (motion,)

    def _write(self, motion: Sequence[float]) -> Any:
        if self._capability is None:
            self._capability = Capability(StewartPlatform(self._parameters))
        try:
            values = self._capability.travel(Motion.of_rows(np.array(motion)), _DIRECTIONS).value
        except MotionError:  # not decided within the largest number of steps
            values = np.zeros(12)
        values = np.where(np.isposinf(values), _UNLIMITED, values)
        return Float64MultiArray(layout=_LAYOUT, data=values.tolist())
