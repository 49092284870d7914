# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""ROS messages as bytes (CDR): arrays in, bytes out, and back."""
