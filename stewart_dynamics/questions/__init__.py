# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The first parameter file of a hexapod, from the answers to questions; needs no ROS."""

from __future__ import annotations

from collections.abc import Sequence

from stewart_dynamics.signals import run_program


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program stewart_init."""
    return run_program('stewart_init', f'{__name__}.init_command_line', arguments)
