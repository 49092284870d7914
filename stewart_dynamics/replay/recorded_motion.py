# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The setpoints of a whole bag in memory, joined as in the replay."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, NANOSECOND, Stamps
from stewart_dynamics.bags.feed import feed_subscribers, Subscription
from stewart_dynamics.bags.recording import Recording
from stewart_dynamics.errors import BagError
from stewart_dynamics.mechanics.frames.base_motion import BaseMotion
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.replay.bag_topics import find_topics
from stewart_dynamics.replay.differentiate import differentiator
from stewart_dynamics.replay.replay_options import Options
from stewart_dynamics.setpoints.input_messages import POSE
from stewart_dynamics.setpoints.joining import Setpoints
from stewart_dynamics.setpoints.step import Batch


class RecordedMotion(NamedTuple):
    """Setpoints of a bag."""

    seconds: Array  # since the first setpoint (N,) [s]
    motion: Motion
    wrench: Array  # external wrench (N, 6) [N, N m]
    base: BaseMotion | None
    missing: list[str]  # parts of the bag that could not be read
    rejected: int = 0  # number of rejected messages
    mistakes: tuple[str, ...] = ()  # possible errors in the setpoints, or in the base's motion
    notices: tuple[str, ...] = ()  # about the reading of the bag
    stamps: Stamps = np.empty(0, dtype=np.int64)  # of the messages (N,) [ns]


def read_motion(bag: Path, parameters: Parameters, options: Options,
                progress: Callable[[int], object] = lambda size: None, *, home: bool = True,
                ) -> RecordedMotion:
    """
    Return the setpoints of a bag, joined as in the replay.

    home: accelerations alone are integrated from the home pose; else they are an error.

    Raises BagError: the bag cannot be read, or has no setpoints.
    """
    parameters = options.applied_to(parameters, bag)
    splines = differentiator(parameters, options)
    batches: list[Batch] = []
    with closing(Recording(
            bag, options.reading, parameters.platform_frame,
            (lambda: StewartPlatform(parameters).home_pose().position) if home else None,
            )) as recording:
        topics = find_topics(recording, parameters, options)
        setpoints = Setpoints(parameters, lambda rejection, details: None, lambda text: None)
        setpoints.unknown_angles = recording.unknown_angles

        def join_messages(messages: Messages) -> None:
            batch = setpoints.join_messages(messages)
            batches.append(batch if splines is None else splines.add_setpoints(batch))

        for size in feed_subscribers(recording, [
                Subscription({name: key for key, name in topics.items()}, join_messages)]):
            progress(size)
        setpoints.drop_waiting('the bag ends')
        if splines is not None:
            batches.append(splines.finish())
        missing, notices = list(recording.missing), tuple(recording.notices)
    recorded = Batch.joined([each for each in batches if len(each.stamps)])
    if not len(recorded.stamps):
        why = ''.join(f'; {each.topic}: {each.reason}' for each in setpoints.counts)
        why += '' if splines is None else ''.join(f'; {reason}' for reason in splines.left_out)
        raise BagError(f'{bag}: has no valid setpoint{why}')
    if recorded.bases is not None:
        known = np.isfinite(recorded.bases).all(axis=1)
        if not known.any():
            raise BagError(f"{bag}: the base's motion is not known at any setpoint")
        recorded = recorded.chosen(known)
    errors = setpoints.possible_errors(ever=True)
    if splines is not None:
        errors += splines.stamps.possible_errors(True, [POSE])
    stamps, bases = recorded.stamps, recorded.bases
    steps = np.maximum(np.diff(stamps, prepend=stamps[0]), 0)  # a bag that loops
    return RecordedMotion(np.cumsum(steps) * NANOSECOND, Motion.of_rows(recorded.motions.copy()),
                          recorded.wrenches.copy(),
                          None if bases is None else BaseMotion.of_rows(bases.copy()), missing,
                          sum(setpoints.counts.values())
                          + (0 if splines is None else splines.left_out.total()),
                          tuple(each.words for each in errors), notices, stamps)
