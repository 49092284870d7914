# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Possible errors in files and data: hypotheses, declared in tables, and the search in them."""
