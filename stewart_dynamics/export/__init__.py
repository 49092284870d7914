# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The same computation as C99 source, for real-time computers; needs no ROS."""

from __future__ import annotations

from collections.abc import Sequence

from stewart_dynamics.signals import run_program


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program stewart_export."""
    return run_program('stewart_export', f'{__name__}.export_command_line', arguments)
