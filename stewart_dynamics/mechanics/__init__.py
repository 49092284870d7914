# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The mechanics of a hexapod: arrays in, arrays out; no ROS, no bytes, no files, no clock."""
