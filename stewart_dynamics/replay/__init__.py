# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Replay of recorded bags: the node's outputs, summaries and reports; needs no ROS."""

from __future__ import annotations

from collections.abc import Sequence

from stewart_dynamics.signals import run_program


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program stewart_replay."""
    return run_program('stewart_replay', f'{__name__}.replay_command_line', arguments)
