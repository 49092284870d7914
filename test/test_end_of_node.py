# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A node whose end hangs: the process is ended."""

from __future__ import annotations

import subprocess
import sys

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
    done = subprocess.run(
        [sys.executable, '-c', HANGS], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 1
    assert 'in destroy_node' in done.stderr
    assert 'in shut_down' in done.stderr
