# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""From setpoint messages to the messages that answer them; node and replay share it."""
