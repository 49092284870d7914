# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The types of the messages, by the names that ROS gives them."""

from __future__ import annotations

ACCEL_STAMPED = 'geometry_msgs/msg/AccelStamped'
BOOL = 'std_msgs/msg/Bool'
DIAGNOSTIC_ARRAY = 'diagnostic_msgs/msg/DiagnosticArray'
FLOAT64 = 'std_msgs/msg/Float64'
FLOAT64_MULTI_ARRAY = 'std_msgs/msg/Float64MultiArray'
IMU = 'sensor_msgs/msg/Imu'
INERTIA_STAMPED = 'geometry_msgs/msg/InertiaStamped'
JOINT_STATE = 'sensor_msgs/msg/JointState'
JOINT_TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
MARKER_ARRAY = 'visualization_msgs/msg/MarkerArray'
MULTI_DOF_JOINT_TRAJECTORY = 'trajectory_msgs/msg/MultiDOFJointTrajectory'
POSE_STAMPED = 'geometry_msgs/msg/PoseStamped'
STRING = 'std_msgs/msg/String'
TF_MESSAGE = 'tf2_msgs/msg/TFMessage'
TWIST_STAMPED = 'geometry_msgs/msg/TwistStamped'
WRENCH_STAMPED = 'geometry_msgs/msg/WrenchStamped'
