# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Identification of platform, legs and actuators from recorded motions; needs no ROS."""

from __future__ import annotations

from collections.abc import Sequence

from stewart_dynamics.signals import run_program

__all__ = ['main']


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program stewart_identify."""
    return run_program('stewart_identify', f'{__name__}.identify_command_line', arguments)
