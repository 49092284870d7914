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
Topics that are published at a limited rate, while there are subscribers.

``~/markers`` and ``~/joint_states`` at most at ``visualization_rate``; with every pose the
platform's transform on ``/tf``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from stewart_dynamics.description.model import ModelMessages
from stewart_dynamics.node.markers import Markers
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.setpoints.step import Output, Setpoint


class PublisherAtRate:
    """
    Publishes the last data noted, at most at a given rate, while there are subscribers.

    publisher: publishes the message from ``_write``; None if nothing is to be published.
    rate: maximum rate [Hz].
    """

    def __init__(self, publisher: Any, rate: float) -> None:
        self._publisher = publisher
        self._period = 1.0 / rate if rate else 0.0
        self._due = 0.0
        self._unpublished: tuple[Any, ...] | None = None

    def publish_due(self, now: float) -> None:
        """Publish the last data noted if publication is due and there is a subscriber."""
        if self._unpublished is None or self._publisher is None or now < self._due:
            return
        last = self._unpublished
        # A later subscriber must not get data of an old setpoint.
        self._unpublished = None
        self._due = now + self._period
        if self._publisher.get_subscription_count():
            self._publisher.publish(self._write(*last))

    def _write(self, *last: Any) -> Any:
        raise NotImplementedError


class MarkersPublisher(PublisherAtRate):
    """Publishes the markers of the last answer."""

    def __init__(self, parameters: Parameters, publisher: Any) -> None:
        super().__init__(publisher, parameters['visualization_rate'])
        self.use(parameters)

    def use(self, parameters: Parameters) -> None:
        """Use other parameters from now on: a payload moves the centre of mass."""
        if self._publisher is not None:
            self._markers = Markers(parameters)

    def answered(self, setpoint: Setpoint, output: Output) -> None:
        """Note the last answer."""
        self._unpublished = setpoint, output

    def _write(self, setpoint: Setpoint, output: Output) -> bytes:
        return self._markers.write(setpoint.motion, output)


class ModelPublisher(PublisherAtRate):
    """
    Publishes the last pose as joint states, and each pose as a transform.

    rate: maximum rate of ``~/joint_states`` [Hz].
    joint_states, transforms: None if the rate is zero, or if ``publish_tf`` is false.
    """

    def __init__(self, messages: ModelMessages, rate: float, joint_states: Any, transforms: Any,
                 ) -> None:
        super().__init__(joint_states, rate)
        self._messages, self._transforms = messages, transforms
        self._read = False  # the transforms have a subscriber

    def moved(self, stamp: int, pose: Sequence[float]) -> None:
        """Note a pose, a row of motion at a stamp [ns], and publish its transform."""
        self._unpublished = stamp, pose
        if self._read:
            self._transforms.publish(self._messages.transform(stamp, pose))

    def look(self) -> None:
        """Check whether the transforms have a subscriber."""
        self._read = bool(self._transforms and self._transforms.get_subscription_count())

    def _write(self, stamp: int, pose: Sequence[float]) -> bytes:
        return self._messages.joint_states(stamp, pose)
