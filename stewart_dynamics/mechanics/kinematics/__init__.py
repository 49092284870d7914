# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Lengths of the legs, angles of their joints, poses from lengths."""
