# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The same hexapod in the formats of other tools: URDF, SDFormat and MJCF; needs no ROS."""

from __future__ import annotations

from collections.abc import Sequence

from stewart_dynamics.signals import run_program


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program stewart_describe."""
    return run_program('stewart_describe', f'{__name__}.describe_command_line', arguments)
