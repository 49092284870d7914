# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Reasons for which messages are rejected or dropped, their texts and counts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
import re
from typing import NamedTuple

from stewart_dynamics.arrays import SECOND
from stewart_dynamics.messages.cdr import MALFORMED, NOT_FINITE
from stewart_dynamics.messages.stamp_order import Order, order_of

__all__ = ['BASE_NOT_KNOWN', 'check_stamp', 'DROPPED', 'frame_details', 'MALFORMED',
           'NOT_EXCLUSIVE', 'NOT_FINITE', 'NOT_JOINED', 'NOT_MEASURED', 'NOT_UNIT', 'OUT_OF_RANGE',
           'OUT_OF_REACH', 'Rejection', 'Rejections', 'STAMP_ZERO', 'TOO_OLD', 'TWICE',
           'WRONG_FRAME']

BASE_NOT_KNOWN = "the base's motion is not known"
NOT_UNIT = 'quaternion not of unit length'
NOT_MEASURED = 'not measured'
WRONG_FRAME = 'wrong frame_id'
TOO_OLD = 'older than the last used'
TWICE = 'same stamp twice'
OUT_OF_RANGE = 'out of range: numbers overflow'
OUT_OF_REACH = 'out of reach'
NOT_EXCLUSIVE = 'more than one writer'
# Prefix of reasons for which valid messages are not used.
_DROPPED = 'dropped: '
NOT_JOINED = f'{_DROPPED}not all topics had its stamp'
DROPPED = f'{_DROPPED}more came at once than can be answered'


class Rejection(NamedTuple):
    """Topic and reason of messages that are not used."""

    topic: str
    reason: str

    def words(self, details: str) -> str:
        """Return the log line for a message, whose details may be empty."""
        how = '' if self.reason.startswith(_DROPPED) else 'rejected: '
        return f'{self.topic} {how}{self.reason}' + f': {details}' * bool(details)

    def counted(self, count: int) -> Rejection:
        """Return the rejection of a number of messages, for ``words``."""
        return self._replace(topic=f'{self.topic}: {count}')


STAMP_ZERO = 'stamp 0'  # details of a message that is joined in order of arrival
_STAMP = re.compile(r'stamp (-?\d+) ns(: | is )?')


def stamp_words(stamp: int) -> str:
    """Return the beginning of the details of a message with a stamp [ns]."""
    return f'stamp {stamp} ns'


def stamp_of(details: str) -> tuple[int | None, str]:
    """Return the stamp [ns] with which details begin, None without one, and the other words."""
    found = _STAMP.match(details)
    return (int(found[1]), details[found.end():]) if found else (None, details)


def too_old(stamp: int, back: int) -> str:
    """Return the details of a stamp that lies back by a time [ns]."""
    return f'{stamp_words(stamp)} is {back / SECOND:g} s older than the last used'


def jumped_back(back: int) -> str:
    """Return the notice of a restart by a time [ns]."""
    return f'stamps jumped back by {back / SECOND:g} s: followed as a restart'


def check_stamp(stamp: int, last: int | None, timeout: int, reject: Callable[[str, str], object],
                noticed: Callable[[str], object]) -> bool:
    """
    Return whether a sample is used by its stamp; report a restart, or the rejection.

    stamp, last, timeout: those of ``order_of`` [ns].
    reject: called with reason and details. noticed: called with a text for the log.
    """
    order = order_of(stamp, last, timeout)
    if order is Order.TWICE:
        reject(TWICE, stamp_words(stamp))
    elif last is not None and order is not Order.FRESH:
        back = last - stamp
        if order is Order.RESTART:
            noticed(jumped_back(back))
        else:
            reject(TOO_OLD, too_old(stamp, back))
    return order.used


class Rejections:
    """Counts rejected and dropped messages."""

    def __init__(self, rejected: Callable[[Rejection, str], None]) -> None:
        self.counts: Counter[Rejection] = Counter()
        self._rejected = rejected

    def reject(self, topic: str, reason: str, details: str, number: int = 1) -> None:
        """Count and report messages."""
        rejection = Rejection(topic, reason)
        self.counts[rejection] += number
        self._rejected(rejection, details)


def frame_details(frame: bytes, wanted: bytes) -> str:
    """Return the details for WRONG_FRAME."""
    given, must = (each[:60].decode(errors='replace') for each in (frame, wanted))
    lengths = f' ({len(frame)} and {len(wanted)} bytes)' if given == must else ''
    return f'{given!r}, must be {must!r} or empty{lengths}'
