# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The computation in C: ``stewart_dynamics.c``, which is also exported, and all beside it."""
