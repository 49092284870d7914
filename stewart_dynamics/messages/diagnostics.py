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

"""The diagnostic_msgs/DiagnosticArray, written."""

from __future__ import annotations

from collections.abc import Sequence

from stewart_dynamics.messages.cdr import header, LITTLE_ENDIAN, put_count, put_text


def diagnostics(
        stamp: int,
        statuses: Sequence[tuple[int, tuple[str, str, str], Sequence[tuple[str, str]]]],
) -> bytes:
    """
    Write a diagnostic_msgs/DiagnosticArray; frame_id is empty.

    Parameters
    ----------
    stamp : int
        [ns]
    statuses : sequence of (level, (name, message, hardware_id), keys and values)
        In their order.

    """
    body = header(stamp)
    put_count(body, len(statuses))
    for level, texts, values in statuses:
        body.append(level)
        for text in texts:
            put_text(body, text)
        put_count(body, len(values))
        for key, value in values:
            put_text(body, key)
            put_text(body, value)
    return LITTLE_ENDIAN + bytes(body)
