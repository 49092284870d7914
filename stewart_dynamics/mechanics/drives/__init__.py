# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The drives of the legs: from leg force and rate to motor torque, speed, current and heat."""
