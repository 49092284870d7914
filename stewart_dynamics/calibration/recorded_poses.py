# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Poses at rest from a bag: the means of measured legs and of a PoseStamped topic."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, SECOND, Stamps
from stewart_dynamics.bags.feed import read_all, Subscription
from stewart_dynamics.bags.recording import Recording
from stewart_dynamics.calibration.measured_poses import (
    drive_unit, MeasuredPoses, METERS, Millimeters)
from stewart_dynamics.calibration.rests import find_rests, mean_pose, SETTLING, SHORTEST
from stewart_dynamics.errors import BagError
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.cdr import MalformedError
from stewart_dynamics.messages.joint_state import JointStateReader
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.messages.setpoint import read_message
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.parameters.tolerances import is_unit
from stewart_dynamics.replay.bag_topics import find_calibrated_legs
from stewart_dynamics.tables.reading import Reading

# Legs are at rest while no position changes by more than this part of the characteristic length.
_STILL = 3e-4


class RecordedPoses(NamedTuple):
    """Poses of a bag, and the parts of it that could not be read."""

    measured: MeasuredPoses
    missing: list[str]


def read_bag(path: Path, parameters: Parameters, node: str, measured: str | None,
             pose: str | None, reading: Reading | None = None,
             millimeters: Millimeters = METERS) -> RecordedPoses:
    """
    Return the poses at rest of a bag, joined by the stamps of the messages' headers.

    ``measured`` and ``pose`` are topics; by default the usual one, or the only one of its type.

    Raises BagError: the bag cannot be read, a topic is not found, or nothing was measured at rest.
    """
    with closing(Recording(path, reading, parameters.platform_frame)) as recording:
        legs_topic, commanded = find_calibrated_legs(recording, node, measured)
        pose_topic = recording.find_topic(type_names.POSE_STAMPED, pose, '', '--pose')
        reader = JointStateReader(parameters.joints, ['position'])
        leg_stamps: list[Stamps] = []
        leg_values: list[Array] = []
        poses: list[tuple[int, tuple[float, ...]]] = []

        def add_legs(messages: Messages) -> None:
            states = reader.read_states(messages)
            leg_stamps.append(states.stamps)
            leg_values.append(states.values)

        def add_poses(messages: Messages) -> None:
            for _, _, data in messages.iterate_messages():
                try:
                    stamp, _, values, _ = read_message(type_names.POSE_STAMPED, data)
                except MalformedError:
                    continue
                if np.isfinite(values).all() and is_unit(np.linalg.norm(values[3:])):
                    poses.append((stamp, values))

        read_all(recording, [Subscription({legs_topic: 'legs'}, add_legs),
                             Subscription({pose_topic: 'pose'}, add_poses)])
        missing = list(recording.missing)
        notices = [*recording.notices, *(
            [f'{legs_topic}: the commanded positions of the legs, not measured ones']
            if commanded else [])]
    reader.check(f'{path}: {legs_topic}')
    stamps = np.concatenate(leg_stamps) if leg_stamps else np.empty(0, dtype=np.int64)
    if not len(stamps) or not poses:
        raise BagError(f'{path}: {legs_topic} and {pose_topic}: no valid message of the '
                       f'{"poses" if len(stamps) else "legs"}')
    order = np.argsort(stamps, kind='stable')
    of_positions, of_legs = millimeters.units[0], drive_unit(parameters, millimeters, False)
    stamps, positions = stamps[order], of_legs * np.concatenate(leg_values)[order]
    poses.sort()
    at = np.array([stamp for stamp, _ in poses])
    seen = np.array([values for _, values in poses])
    seen[:, :3] *= of_positions
    rows, names = [], []
    still = _STILL * parameters.singularity.characteristic_length / float(
        np.mean(parameters.leg_kind.reach(parameters)))
    for first, last in find_rests(stamps, positions, still, SECOND):
        margin = round(SETTLING * (stamps[last] - stamps[first]))
        begin, end = stamps[first] + margin, stamps[last] - margin
        part = seen[np.searchsorted(at, begin):np.searchsorted(at, end, 'right')]
        legs = positions[np.searchsorted(stamps, begin):np.searchsorted(stamps, end, 'right')]
        if len(part) and len(legs):
            rows.append(np.concatenate([legs.mean(axis=0), mean_pose(part)]))
            names.append(f't = {(begin - stamps[0]) / SECOND:.1f} s')
    if not rows:
        raise BagError(
            f'{path}: no pose was measured while the legs were at rest for {SHORTEST:g} s; '
            f'legs from {stamps[0] / SECOND:.1f} to {stamps[-1] / SECOND:.1f} s, poses from '
            f'{at[0] / SECOND:.1f} to {at[-1] / SECOND:.1f} s')
    table = np.array(rows)
    return RecordedPoses(MeasuredPoses(
        table[:, :6], Pose.from_quaternion(table[:, 6:9], table[:, 9:]), tuple(names),
        topics=(legs_topic, pose_topic), notices=tuple(notices)), missing)
