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


"""The efforts in recorded sensor_msgs/JointState messages, read in blocks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Bytes, Stamps
from stewart_dynamics.errors import BagError
from stewart_dynamics.messages.joint_state import JointStateReader, MISSING_JOINTS
from stewart_dynamics.setpoints.rejections import OUT_OF_RANGE

# Larger than any force [N]: the square would overflow.
_FORCE_END = 1e100
# Messages without all joints from which on it is an error.
_PATIENCE = 1000


class Efforts:
    """Reads the efforts of the joints of a hexapod; messages may contain other joints, too."""

    def __init__(self, joints: Sequence[str]) -> None:
        self._joints = list(joints)
        self._reader = JointStateReader(joints, ['effort'])
        self._lacked = 0

    def read(self, data: bytes | Bytes, starts: ArrayLike, sizes: ArrayLike,
             ) -> tuple[Stamps, Array, dict[str, int]]:
        """
        Return stamps (K,) [ns], efforts (K, 6) [N], and the number of rejected messages by reason.

        The messages are given as in JointStateReader.read_many. Those without all joints may come
        from another publisher, and are rejected. Raises BagError if a thousand were rejected and
        none had all joints.
        """
        stamps, efforts, rejected = self._reader.read_many(data, starts, sizes)
        in_range = (np.abs(efforts) < _FORCE_END).all(axis=1)
        if not in_range.all():
            rejected[OUT_OF_RANGE] = int(np.count_nonzero(~in_range))
            stamps, efforts = stamps[in_range], efforts[in_range]
        self._lacked += rejected.get(MISSING_JOINTS, 0)
        if self._lacked >= _PATIENCE:
            self.check()
        return stamps, efforts, rejected

    def check(self) -> None:
        """Raise BagError if messages lacked a joint, and none had all joints."""
        if self._lacked and not self._reader.found:
            names = self._reader.other_names
            missing = [joint for joint in self._joints if joint not in names]
            raise BagError(
                f'measured joint states: no message contains {", ".join(missing)}; they contain '
                f'{", ".join(names) or "nothing"}: they must be those of the parameter joints')
