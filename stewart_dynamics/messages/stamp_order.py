# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The order of stamps: the same rule for setpoints, base, measured legs, parts, and vehicle."""

from __future__ import annotations

from enum import Enum

from stewart_dynamics.core.binding import CODES, function

NO_STAMP = 0
"""A stamp of zero is no time, whatever came before: the message has no stamp."""


class Order(Enum):
    """How a stamp follows the last used one."""

    FRESH = 'later, or the first'
    RESTART = 'earlier by more than the timeout: earlier samples no longer apply'
    TWICE = 'equal: rejected'
    TOO_OLD = 'earlier by at most the timeout: rejected'

    @property
    def used(self) -> bool:
        """Return whether a message with this stamp is used."""
        return self in (Order.FRESH, Order.RESTART)


def order_of(stamp: int, last: int | None, timeout: int) -> Order:
    """
    Return how a stamp follows the last used one.

    stamp, last: [ns], not NO_STAMP; None before the first.
    timeout: longest time by which messages are late [ns]; a longer jump back is a restart.
    """
    return _ORDERS[function('stamp_order')(stamp, last is not None, last or 0, timeout)]


_ORDERS = {CODES[f'STAMP_{order.name}']: order for order in Order}
