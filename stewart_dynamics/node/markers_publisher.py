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

"""Publishes the markers, at most at ``visualization_rate``, while there are subscribers."""

from __future__ import annotations

from typing import Any

from stewart_dynamics.node.markers import Markers
from stewart_dynamics.node.publisher_at_rate import PublisherAtRate
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.setpoints.step import Output, Setpoint


class MarkersPublisher(PublisherAtRate):
    """
    Publishes the markers of the last answer.

    Parameters
    ----------
    parameters : Parameters
        What the markers show, and ``visualization_rate``.
    publisher : Publisher, optional
        What publishes their bytes; none where the rate is zero.

    """

    def __init__(self, parameters: Parameters, publisher: Any) -> None:
        super().__init__(publisher, parameters['visualization_rate'])
        self.use(parameters)

    def use(self, parameters: Parameters) -> None:
        """Show other parameters from now on: a payload has another centre of mass."""
        if self._publisher is not None:
            self._markers = Markers(parameters)

    def answered(self, setpoint: Setpoint, output: Output) -> None:
        """Note the last answer."""
        self._unpublished = setpoint, output

    def _write(self, setpoint: Setpoint, output: Output) -> bytes:
        return self._markers.write(setpoint.motion, output)
