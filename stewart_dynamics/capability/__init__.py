# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Capability: reach, load, speed and payload of a hexapod within its limits; needs no ROS."""
