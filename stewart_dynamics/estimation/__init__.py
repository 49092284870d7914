# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Estimates of uncertain numbers: their prior, white noise, and the posterior."""
