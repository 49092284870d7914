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

"""Topics of setpoints, of the base's motion and of the known wrench, and their types."""

from __future__ import annotations

# Topics, relative to the node's name.
POSE = 'setpoint/pose'
TWIST = 'setpoint/twist'
ACCEL = 'setpoint/accel'
COMBINED = 'setpoint/combined'
BASE_POSE = 'base/pose'
BASE_TWIST = 'base/twist'
BASE_ACCEL = 'base/accel'
BASE_IMU = 'base/imu'
WRENCH = 'wrench'

INPUT_TYPES = {
    POSE: 'geometry_msgs/msg/PoseStamped',
    TWIST: 'geometry_msgs/msg/TwistStamped',
    ACCEL: 'geometry_msgs/msg/AccelStamped',
    COMBINED: 'trajectory_msgs/msg/MultiDOFJointTrajectory',
    BASE_POSE: 'geometry_msgs/msg/PoseStamped',
    BASE_TWIST: 'geometry_msgs/msg/TwistStamped',
    BASE_ACCEL: 'geometry_msgs/msg/AccelStamped',
    BASE_IMU: 'sensor_msgs/msg/Imu',
    WRENCH: 'geometry_msgs/msg/WrenchStamped',
}

# Topics that are joined, for each value of setpoint.source.
SOURCES = {'separate': (POSE, TWIST, ACCEL), 'combined': (COMBINED,), 'pose': (POSE,)}
# Topics that are joined, for each value of base.source.
BASE_SOURCES = {'fixed': (), 'pose': (BASE_POSE,), 'motion': (BASE_POSE, BASE_TWIST, BASE_ACCEL),
                'imu': (BASE_IMU,)}
