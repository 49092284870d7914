# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The report of the dynamics node: one status for each of its parts.

``levels`` has the base class of a status; ``input_statuses``, ``answers`` and ``outcomes`` have
the statuses; ``periodic_report`` puts them together. No module uses ROS or a clock: callers pass
events and their times, in seconds of a steady clock.
"""
