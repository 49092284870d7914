# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Datasheet of a hexapod: reach, loads, rates, and recorded motions; needs no ROS."""

from __future__ import annotations

from collections.abc import Sequence

from stewart_dynamics.signals import run_program


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program stewart_capability."""
    return run_program('stewart_capability', f'{__name__}.datasheet_command_line', arguments)
