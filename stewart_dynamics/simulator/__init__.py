# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The simulated hexapod: leg forces in, measured legs and platform pose out."""
