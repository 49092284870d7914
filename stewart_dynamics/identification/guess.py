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

"""Pose of leg lengths without an initial guess."""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import PoseError, SingularityError
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.mechanics.kinematics.home_pose import homes
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform

# Rotations about z that are tried, platform axes parallel to base axes first [rad].
_TURNS = (0.0, 0.3, -0.3, 0.6, -0.6)


def pose_near(platform: StewartPlatform, lengths: Array) -> Pose:
    """
    Return the pose of lengths (6,), starting from home and level poses on both sides.

    Raises
    ------
    PoseError, SingularityError
        Forward kinematics converges from no initial guess.

    """
    p = platform.parameters
    positions, rotations = homes(p)  # both sides of the base, the more likely one first
    guesses = [Pose(*each) for each in zip(positions, rotations, strict=True)]
    across = p['geometry.platform_joints'] - p['geometry.base_joints']
    level = float(np.mean(lengths ** 2 - np.sum(across[:, :2] ** 2, axis=1)))
    height = np.sqrt(max(level, 1e-4))
    side = 1.0 if positions[0, 2] >= 0.0 else -1.0
    guesses += [Pose.from_euler([0.0, 0.0, up * height - across[:, 2].mean()], [0.0, 0.0, turn])
                for up in (side, -side) for turn in _TURNS]
    for guess in guesses[:-1]:
        try:
            return platform.forward_kinematics(lengths, guess)
        except (PoseError, SingularityError):
            continue
    return platform.forward_kinematics(lengths, guesses[-1])
