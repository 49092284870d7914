# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Parameters: the table that declares them, their rules, and files in YAML."""
