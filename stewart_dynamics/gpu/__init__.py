# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Many hexapods at once, on a GPU or on the processors of a computer: ``Hexapods``."""

from stewart_dynamics.gpu.hexapods import Hexapods, HexapodStates

__all__ = ['HexapodStates', 'Hexapods']
