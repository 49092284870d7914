# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""A node whose end hangs: the process is ended."""

from __future__ import annotations

import sys

from programs import run_program
import pytest

pytest.importorskip('rclpy')

# A regular expression that takes years holds the interpreter, as rclpy does at the end of a node.
HANGS = """
import re
from stewart_dynamics.ros import rclpy_workarounds

class Hanging:
    def destroy_node(self):
        re.match('(a+)+$', 'a' * 60 + 'b')

rclpy_workarounds._LONGEST_END = 0.5
rclpy_workarounds.shut_down(None, Hanging())
"""


@pytest.mark.ros
def test_a_process_whose_end_hangs_is_ended_with_a_traceback() -> None:
    done = run_program(sys.executable, '-c', HANGS, code=1)
    assert 'in destroy_node' in done.err
    assert 'in shut_down' in done.err
