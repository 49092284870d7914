# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Planned trajectories: checked as a whole, answered with leg trajectories."""
