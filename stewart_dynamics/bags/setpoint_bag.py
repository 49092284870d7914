# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Writes a motion as a bag of setpoints, which all programs take that read setpoints."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

from stewart_dynamics.arrays import Array, SECOND
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.mechanics.rows import ACCELERATION, TWIST
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.setpoint import StampedWriter
from stewart_dynamics.program import NODE

# A stamp of zero is no stamp [ns].
_BEGIN = SECOND


def write_setpoint_bag(folder: Path, times: Array, motion: Motion, frame: str) -> None:
    """Write a folder with the setpoints of a motion (N,) at times (N,) [s], in MCAP."""
    rows = motion.rows
    topics = {
        'pose': (type_names.POSE_STAMPED, np.column_stack([motion.position, motion.quaternion])),
        'twist': (type_names.TWIST_STAMPED, rows[:, TWIST]),
        'accel': (type_names.ACCEL_STAMPED, rows[:, ACCELERATION])}
    stamps = (_BEGIN + np.rint((times - times[0]) * SECOND)).astype(np.int64)
    types = get_typestore(Stores.ROS2_JAZZY)
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        written = [(bag.add_connection(f'{NODE}/setpoint/{topic}', kind, typestore=types),
                    StampedWriter(frame, values.shape[1]).layout.write(stamps, values))
                   for topic, (kind, values) in topics.items()]
        for n, stamp in enumerate(stamps.tolist()):
            for connection, messages in written:
                bag.write(connection, stamp, messages[n].tobytes())
