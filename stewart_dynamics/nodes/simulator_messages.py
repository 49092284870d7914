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

"""The messages of the simulator: what it publishes for a state of the plant."""

from __future__ import annotations

from collections.abc import Iterator
from operator import sub

from stewart_dynamics.messages.joint_state import JointStateWriter
from stewart_dynamics.messages.setpoint import StampedWriter
from stewart_dynamics.parameters import Parameters
from stewart_dynamics.runtime.plant import State

# Under the node's name; those that it publishes in their order.
INPUT_TYPES = {
    'commands': 'std_msgs/msg/Float64MultiArray',
    'wrench': 'geometry_msgs/msg/WrenchStamped',
}
OUTPUT_TYPES = {
    'leg_states': 'sensor_msgs/msg/JointState',
    'pose': 'geometry_msgs/msg/PoseStamped',
    'twist': 'geometry_msgs/msg/TwistStamped',
    'accel': 'geometry_msgs/msg/AccelStamped',
}


class StateMessages:
    """
    Writes the messages of states.

    Parameters
    ----------
    parameters : Parameters
        Names of joints and base frame, and zero lengths.

    """

    def __init__(self, parameters: Parameters) -> None:
        self._zero_lengths = parameters['geometry.zero_length'].tolist()
        self._joint_state = JointStateWriter(parameters['joints'])
        frame = parameters['base_frame']
        self._pose, self._six = StampedWriter(frame, 7), StampedWriter(frame, 6)

    def write(self, stamp: int, state: State) -> Iterator[tuple[str, bytes]]:
        """Yield topics, keys of OUTPUT_TYPES, and messages of a state at a time [ns]."""
        yield 'leg_states', self._joint_state.write(
            stamp, map(sub, state.lengths, self._zero_lengths), state.rates, state.forces)
        yield 'pose', self._pose.write(stamp, state.pose)
        yield 'twist', self._six.write(stamp, state.twist)
        yield 'accel', self._six.write(stamp, state.acceleration)
