# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Calibration of a hexapod's geometry from measured poses; needs no ROS."""

from __future__ import annotations

from collections.abc import Sequence

from stewart_dynamics.signals import run_program

__all__ = ['main']


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program stewart_calibrate."""
    return run_program('stewart_calibrate', f'{__name__}.calibrate_command_line', arguments)
