# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Motion cueing: the motion of a vehicle in, the motion of the platform out."""
