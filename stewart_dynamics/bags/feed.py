# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Passes the messages of a recording to subscribers: the one loop that reads recordings."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

from stewart_dynamics.bags.recording import Recording
from stewart_dynamics.messages.recorded import Messages


class Subscription(NamedTuple):
    """Topics of a recording, and the function that uses their messages."""

    topics: Mapping[str, str]
    """From topics in the recording, several separated by commas, to their names in messages."""
    use: Callable[[Messages], object]
    """Called with the subscriber's messages of each block that has any, in recorded order."""


def feed_subscribers(recording: Recording, subscriptions: Sequence[Subscription]) -> Iterator[int]:
    """
    Pass the messages of each block to the subscribers in their order, then yield the bytes read.

    A topic has one subscriber. Raises BagError as ``Recording.messages`` does.
    """
    names = {topic: name for each in subscriptions for topic, name in each.topics.items()}
    for messages, size in recording.messages(names):
        for topics, use in subscriptions:
            chosen = messages.select_topics(set(topics.values()))
            if len(chosen.times):
                use(chosen)
        yield size


def read_all(recording: Recording, subscriptions: Sequence[Subscription]) -> None:
    """Pass all messages to the subscribers, see ``feed_subscribers``."""
    deque(feed_subscribers(recording, subscriptions), maxlen=0)
