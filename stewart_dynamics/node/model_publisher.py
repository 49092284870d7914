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
Publishes the hexapod as a model: ``~/joint_states`` and ``/tf``, while there are subscribers.

The joints at most at ``visualization_rate``, the platform's transform with every pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from stewart_dynamics.description.joint_states import ModelMessages
from stewart_dynamics.node.publisher_at_rate import PublisherAtRate


class ModelPublisher(PublisherAtRate):
    """
    Publishes the last pose.

    Parameters
    ----------
    messages : ModelMessages
        Writes their messages.
    rate : float
        At most so many of ``~/joint_states`` are published in a second [Hz].
    joint_states, transforms : Publisher, optional
        What publishes their bytes; none where the rate is zero, or ``publish_tf`` is false.

    """

    def __init__(self, messages: ModelMessages, rate: float, joint_states: Any, transforms: Any,
                 ) -> None:
        super().__init__(joint_states, rate)
        self._messages, self._transforms = messages, transforms
        self._read = False  # somebody subscribes to the transforms

    def moved(self, stamp: int, pose: Sequence[float]) -> None:
        """Note a pose, a row of motion at a stamp [ns], and publish its transform."""
        self._unpublished = stamp, pose
        if self._read:
            self._transforms.publish(self._messages.transform(stamp, pose))

    def look(self) -> None:
        """Look whether somebody subscribes to the transforms."""
        self._read = bool(self._transforms and self._transforms.get_subscription_count())

    def _write(self, stamp: int, pose: Sequence[float]) -> bytes:
        return self._messages.joint_states(stamp, pose)
