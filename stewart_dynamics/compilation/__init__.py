# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The machine code of the functions that Python calls: compiled once, kept on disk, loaded."""
