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

"""tf2_msgs/TFMessage, all of whose transforms have one stamp."""

from __future__ import annotations

from collections.abc import Sequence

from stewart_dynamics.messages.cdr import LITTLE_ENDIAN, put_count, put_text
from stewart_dynamics.messages.layout import Layout


def transforms(frames: Sequence[tuple[str, str]]) -> Layout:
    """
    Return the layout of a TFMessage of the transforms between frames.

    Its parts are the transforms: x y z [m] and the quaternion's x y z w.

    Parameters
    ----------
    frames : sequence of (frame, child)
        The frames of each transform.

    """
    body = bytearray(LITTLE_ENDIAN)
    put_count(body, len(frames))
    stamps, numbers = [], []
    for frame, child in frames:
        stamps.append(len(body))
        body += bytes(8)
        put_text(body, frame)
        put_text(body, child)
        body += bytes((4 - len(body)) % 8)
        numbers.append((len(body), 7))
        body += bytes(7 * 8)
    return Layout(bytes(body), numbers, stamps)
