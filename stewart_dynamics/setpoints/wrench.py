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

"""The known load on the platform: the last message on ``~/wrench``."""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array, Integers, NO_WRENCH, Six
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.setpoints.batch_joining import Samples
from stewart_dynamics.setpoints.inputs import SampleReader
from stewart_dynamics.setpoints.rejections import Rejections
from stewart_dynamics.setpoints.topics import WRENCH


class WrenchInput:
    """
    Follows ``~/wrench``.

    Parameters
    ----------
    parameters : Parameters
        ``base_frame`` is used.
    rejections : Rejections
        Counts rejected messages.

    """

    def __init__(self, parameters: Parameters, rejections: Rejections) -> None:
        self.wrench: Six = NO_WRENCH
        """Force and moment at the platform's origin, base axes [N, N m]."""
        self.reader = SampleReader(WRENCH, parameters['base_frame'], rejections)

    def take(self, data: bytes) -> None:
        """Use the wrench of this geometry_msgs/WrenchStamped from now on, if it is valid."""
        sample = self.reader.read(data)
        if sample is not None:
            fx, fy, fz, tx, ty, tz = sample[1]
            self.wrench = fx, fy, fz, tx, ty, tz

    def at(self, samples: Samples, places: Integers) -> Array:
        """
        Use new wrenches in order, and return the one that is valid at each of the given indices.

        Parameters
        ----------
        samples : Samples
            Read by ``reader``.
        places : (K,)
            Indices in the order of all messages.

        Returns
        -------
        (K, 6) [N, N m]

        """
        wrenches = np.empty((len(places), 6))
        wrenches[:] = self.wrench
        if len(samples.values):
            latest = np.searchsorted(samples.places, places) - 1
            wrenches[latest >= 0] = samples.values[latest[latest >= 0]]
            fx, fy, fz, tx, ty, tz = samples.values[-1].tolist()
            self.wrench = fx, fy, fz, tx, ty, tz
        return wrenches
