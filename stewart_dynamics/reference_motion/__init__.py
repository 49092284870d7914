# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Reference motions, and the node stewart_trajectory that publishes them as setpoints."""
