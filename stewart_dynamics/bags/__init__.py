# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Recorded bags: found, read and decoded in blocks; needs no ROS."""
