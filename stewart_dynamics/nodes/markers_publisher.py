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

from stewart_dynamics.nodes.markers import Markers
from stewart_dynamics.parameters import Parameters
from stewart_dynamics.runtime.step import Output, Setpoint


class MarkersPublisher:
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
        self._publisher = publisher
        self._due = 0.0
        self._unpublished: tuple[Setpoint, Output] | None = None
        self.use(parameters)

    def use(self, parameters: Parameters) -> None:
        """Show other parameters from now on: a payload has another centre of mass."""
        if self._publisher is not None:
            self._markers = Markers(parameters)
            self._period = 1.0 / parameters['visualization_rate']

    def answered(self, setpoint: Setpoint, output: Output) -> None:
        """Note the last answer."""
        self._unpublished = setpoint, output

    def publish_due(self, now: float) -> None:
        """Publish the markers of the last answer if they are due and there is a subscriber."""
        if self._unpublished is None or self._publisher is None or now < self._due:
            return
        setpoint, output = self._unpublished
        # A later subscriber gets no markers of an old setpoint.
        self._unpublished = None
        self._due = now + self._period
        if self._publisher.get_subscription_count():
            self._publisher.publish(self._markers.write(setpoint.motion, output))
