# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""How a platform follows its setpoints: frequency responses with bands, delays, bandwidths."""
