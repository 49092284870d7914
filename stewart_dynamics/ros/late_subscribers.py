# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
In a simulation that waits for answers, a subscriber that comes late gets the last message.

Programs of a loop start in any order and find each other at any time. In real time the next
message comes soon; where the clock waits for the answer to this one, none would.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node


def is_simulated(node: Node) -> bool:
    """Return whether a node has the time of /clock, which may wait for its answers."""
    return bool(node.get_parameter('use_sim_time').value)


def for_late_subscribers(node: Node, publish_again: Callable[[], None],
                         once: bool = False) -> PublisherEventCallbacks | None:
    """
    Return event callbacks for a publisher that is about to be created.

    publish_again: publishes the last message on it, if there is one; called with ``use_sim_time``
        when a subscriber is matched.
    once: only where no other subscriber has got the message: its repetition would count twice, as
        that of a command does.
    """
    if not is_simulated(node):
        return None

    def on_matched(event: Any) -> None:
        new = event.current_count_change
        if new > 0 and not (once and event.current_count > new):
            publish_again()

    return PublisherEventCallbacks(matched=on_matched)
