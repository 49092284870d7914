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

"""Joins batches of samples of several topics by stamp, for messages without irregularities."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Integers, Stamps
from stewart_dynamics.mechanics.rows import MOTION

# Maximum number of samples of a topic that wait for samples of the other topics, and depth of the
# queues in the middleware, which may deliver all messages of one topic before another topic's.
WAITING = 1000

Waiting = dict[int, tuple[float, ...]]
"""Values of the waiting samples of a topic, by stamp [ns], in order of arrival."""


class TopicSamples(NamedTuple):
    """New samples of a topic, N of them."""

    stamps: Stamps
    """(N,) [ns]"""
    values: Array
    """(N, ...)"""
    places: Integers
    """(N,): index of each message in the order of all messages."""


class Joined(NamedTuple):
    """K joined setpoints, and the remaining samples of each topic."""

    stamps: Stamps
    """(K,) [ns]"""
    motions: Array
    """Rows of motion (K, MOTION)."""
    places: Integers
    """(K,): index of the message that completed each."""
    waiting: dict[str, Waiting]
    dropped: dict[str, list[int]]
    """Stamps of samples that can no longer be joined."""


def join_many(samples: Mapping[str, TopicSamples], waiting: Mapping[str, Waiting],
              last: Mapping[str, int]) -> Joined | None:
    """
    Join samples; None if stamps are not strictly increasing or more than WAITING samples wait.

    Parameters
    ----------
    samples : mapping of str to Samples
        New samples of each topic, in the order of topics in a row of motion.
    waiting : mapping of str to Waiting
        Earlier samples of each topic that still wait.
    last : mapping of str to int
        Last used stamp of each topic [ns]; empty before the first.

    """
    stamps: dict[str, Stamps] = {}
    places: dict[str, Integers] = {}  # -1 for samples already waiting
    values: dict[str, Array] = {}
    for topic, of_topic in samples.items():
        before = waiting[topic]
        stamps[topic] = np.concatenate([np.fromiter(before, dtype=np.int64), of_topic.stamps])
        if not _only_rise(stamps[topic], of_topic.stamps, last.get(topic)):
            return None
        places[topic] = np.concatenate([np.full(len(before), -1), of_topic.places])
        values[topic] = of_topic.values
        if before:
            old = np.array(list(before.values()))
            values[topic] = np.concatenate([old, of_topic.values.reshape(-1, old.shape[1])])
    # Stamps are strictly increasing, so setpoints are completed in the order of their stamps.
    common, *others = stamps.values()
    for other in others:
        common = np.intersect1d(common, other, assume_unique=True)
    chosen = {topic: np.searchsorted(stamps[topic], common) for topic in samples}
    complete = np.max([places[topic][chosen[topic]] for topic in samples], axis=0)
    if any(_overflows(stamps[topic], places[topic], common, complete) for topic in samples):
        return None
    motions = np.zeros((len(common), MOTION))
    column = 0
    for topic in samples:
        width = values[topic].shape[1]
        motions[:, column:column + width] = values[topic][chosen[topic]]
        column += width
    left, dropped = {}, {}
    for topic in samples:
        first = int(np.searchsorted(stamps[topic], common[-1], side='right')) if len(
            common) else 0
        left[topic] = dict(zip(stamps[topic][first:].tolist(),
                               map(tuple, values[topic][first:].tolist()), strict=True))
        if first > len(common):
            dropped[topic] = np.setdiff1d(
                stamps[topic][:first], common, assume_unique=True).tolist()
    return Joined(common, motions, complete, left, dropped)


def _only_rise(stamps: Stamps, new: Stamps, last: int | None) -> bool:
    """Return whether stamps increase strictly from the last one on and new ones are positive."""
    # Waiting samples may have arrived out of order.
    return not (np.any(np.diff(stamps) <= 0) or (len(new) and (
        new[0] <= 0 or (last is not None and stamps[0] <= last))))


def _overflows(stamps: Stamps, places: Integers, common: Stamps, complete: Integers) -> bool:
    """Return whether more than WAITING samples of a topic wait at any time."""
    if len(stamps) <= WAITING:
        return False
    completed = np.searchsorted(complete, places)  # setpoints completed when a sample arrives
    used = np.concatenate([[0], np.searchsorted(stamps, common, side='right')])[completed]
    return bool(np.any(np.arange(1, len(stamps) + 1) - used > WAITING))
