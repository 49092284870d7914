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


"""The efforts in recorded sensor_msgs/JointState messages, many at a time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Bytes, Flags, Stamps
from stewart_dynamics.errors import BagError
from stewart_dynamics.messages import cdr
from stewart_dynamics.runtime.setpoints import MALFORMED, NOT_FINITE

# Why a message is refused, beside being malformed or not finite.
LACKING = 'lacks one of the joints'
WITHOUT_EFFORT = 'without effort'
UNEVEN = 'not as many efforts as names'

_SECOND = 1_000_000_000
# No force is as large [N]; its square would be no number.
_NO_FORCE = 1e100
_ORDERS = {0: '>', 1: '<'}
_AFTER_STAMP = 12
# Layouts that are known at once; messages of others are read one by one.
_MOST_LAYOUTS = 8
# Messages that are read at once, and those that may lack a joint before it is a mistake.
_AT_ONCE = 4096
_PATIENCE = 1000


class _Layout(NamedTuple):
    """What messages with the same names and counts have in common."""

    template: Bytes
    fixed: Bytes
    """255 where a message's bytes are those of the template, 0 at stamp, numbers and gaps."""
    order: str
    """Of bytes, as NumPy has it."""
    reason: str
    """Why such messages are refused; empty where they are not."""
    efforts: slice
    """The bytes of all efforts."""
    joints: list[int]
    """Which of the efforts are those wanted."""
    names: list[str]

    @classmethod
    def of(cls, data: bytes, joints: Sequence[str]) -> _Layout:
        """Return the layout of a message, read field by field; MalformedError if it is none."""
        _, names, numbers, gaps = cdr.joint_state_fields(data)
        begin, number = numbers[2]
        reason = ''
        if not set(joints) <= set(names):
            reason = LACKING
        elif number != len(names):
            reason = UNEVEN if number else WITHOUT_EFFORT
        wanted = [] if reason else [names.index(joint) for joint in joints]
        fixed = np.full(len(data), 255, dtype=np.uint8)
        for free in (slice(2, _AFTER_STAMP), *gaps, *(
                slice(at, at + 8 * many) for at, many in numbers)):
            fixed[free] = 0
        return cls(np.frombuffer(data, dtype=np.uint8), fixed, _ORDERS[data[1]], reason,
                   slice(begin, begin + 8 * number), wanted, names)

    def messages(self, whole: Bytes, begins: Stamps) -> Bytes:
        """Return messages, (N, size), by where they begin."""
        messages: Bytes = np.lib.stride_tricks.sliding_window_view(
            whole, len(self.template))[begins]
        return messages

    def fits(self, messages: Bytes) -> Flags:
        """Return which of them have this layout."""
        off: Bytes = (messages ^ self.template) & self.fixed
        return np.asarray(~off.any(axis=1))

    def stamps(self, messages: Bytes) -> tuple[Flags, Stamps]:
        """Return which stamps are sound, and the stamps, (N,) [ns]."""
        seconds = messages[:, 4:8].copy().view(f'{self.order}i4')[:, 0].astype(np.int64)
        nanoseconds = messages[:, 8:12].copy().view(f'{self.order}u4')[:, 0].astype(np.int64)
        return nanoseconds < _SECOND, seconds * _SECOND + nanoseconds

    def values(self, messages: Bytes) -> Array:
        """Return the efforts wanted (N, 6)."""
        numbers = messages[:, self.efforts].copy().view(f'{self.order}f8')
        values: Array = numbers[:, self.joints].astype(float)
        return values


class _Read(NamedTuple):
    """What was read of messages, and why others were refused."""

    stamps: Stamps
    efforts: Array
    taken: Flags
    refused: Counter[str]

    def take(self, layout: _Layout, whole: Bytes, begins: Stamps, lengths: Stamps,
             which: Stamps) -> Stamps:
        """Read those of the messages that have the layout, and return which have not."""
        of_size = lengths[which] == len(layout.template)
        others = [which[~of_size]]
        same = which[of_size]
        for begin in range(0, len(same), _AT_ONCE):
            part = same[begin:begin + _AT_ONCE]
            messages = layout.messages(whole, begins[part])
            fits = layout.fits(messages)
            if not fits.all():
                others.append(part[~fits])
                part, messages = part[fits], messages[fits]
            if layout.reason:
                self.refused[layout.reason] += len(part)
                continue
            sound, stamps = layout.stamps(messages)
            values = layout.values(messages)
            with np.errstate(invalid='ignore'):
                finite = (np.abs(values) < _NO_FORCE).all(axis=1)
            self.refused[MALFORMED] += int(np.count_nonzero(~sound))
            self.refused[NOT_FINITE] += int(np.count_nonzero(sound & ~finite))
            self.stamps[part], self.efforts[part], self.taken[part] = (
                stamps, values, sound & finite)
        return np.sort(np.concatenate(others))


class Efforts:
    """
    Reads the efforts of a machine's joints from sensor_msgs/JointState as bytes.

    Nearly all messages of a topic have one layout: the same names, the same counts. One is read
    field by field, and those whose bytes are the same but for stamp and numbers are read at once.

    Parameters
    ----------
    joints : sequence of str
        Names of the six joints in the order wanted. A message may hold others besides, in any
        order.

    """

    def __init__(self, joints: Sequence[str]) -> None:
        self._joints = list(joints)
        self._layouts: list[_Layout] = []
        self._found = False
        self._lacked = 0
        self._lacking: list[str] = []

    def read(self, data: bytes | Bytes, starts: ArrayLike, sizes: ArrayLike,
             ) -> tuple[Stamps, Array, dict[str, int]]:
        """
        Return stamps (K,) [ns], efforts (K, 6) [N], and of other messages how many, by reason.

        Parameters
        ----------
        data : bytes or array of them
            It holds all messages.
        starts, sizes : (M,)
            Where each begins, and its length in bytes.

        Messages that lack a joint may be another publisher's, and are refused. Raises BagError
        where a thousand did and none had them all.

        """
        whole = np.frombuffer(data, dtype=np.uint8)
        begins, lengths = np.asarray(starts, dtype=np.int64), np.asarray(sizes, dtype=np.int64)
        read = _Read(np.zeros(len(begins), dtype=np.int64),
                     np.zeros((len(begins), len(self._joints))),
                     np.zeros(len(begins), dtype=bool), Counter())
        left: Stamps = np.arange(len(begins))
        for layout in self._layouts:
            left = read.take(layout, whole, begins, lengths, left)
        while len(left):
            begin, length = int(begins[left[0]]), int(lengths[left[0]])
            try:
                layout = _Layout.of(whole[begin:begin + length].tobytes(), self._joints)
            except cdr.MalformedError:
                read.refused[MALFORMED] += 1
                left = left[1:]
                continue
            if layout.reason != LACKING:
                self._found = True
            else:
                self._lacking = self._lacking or layout.names
            if len(self._layouts) < _MOST_LAYOUTS:
                self._layouts.append(layout)
                left = read.take(layout, whole, begins, lengths, left)
            else:
                read.take(layout, whole, begins, lengths, left[:1])
                left = left[1:]
        self._lacked += read.refused[LACKING]
        if self._lacked >= _PATIENCE:
            self.check()
        return read.stamps[read.taken], read.efforts[read.taken], dict(+read.refused)

    def check(self) -> None:
        """Raise BagError where messages lacked a joint, and none had them all."""
        if self._lacked and not self._found:
            missing = [joint for joint in self._joints if joint not in self._lacking]
            raise BagError(
                f'measured joint states: no message has {", ".join(missing)}; there are '
                f'{", ".join(self._lacking) or "none"}: the names must be those of the '
                'parameter joints')
