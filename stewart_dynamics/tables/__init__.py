# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Tables of numbers in text files: named columns, units, axes, angles and exports of trackers."""
