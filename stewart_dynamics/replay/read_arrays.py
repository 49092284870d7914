# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The setpoints and the measured legs of a recording as arrays, for the library."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
import os
from pathlib import Path
from typing import NamedTuple, TYPE_CHECKING

import numpy as np

from stewart_dynamics.arrays import Array, NANOSECOND, Stamps
from stewart_dynamics.bags.feed import read_all, Subscription
from stewart_dynamics.bags.recording import Recording
from stewart_dynamics.errors import BagError, StewartError
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.mechanics.leg_columns import columns, data_frame
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.messages.joint_state import JointStateReader
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.parameters.table import COMBINED, Parameters, POSES_ALONE, SEPARATE
from stewart_dynamics.program import EULER, NODE, node_name
from stewart_dynamics.replay.bag_topics import find_measured_legs, name_of
from stewart_dynamics.replay.recorded_motion import read_motion
from stewart_dynamics.replay.replay_options import Options
from stewart_dynamics.setpoints import input_messages as inputs
from stewart_dynamics.tables.reading import Reading
from stewart_dynamics.tables.source_axes import axes_matrix

if TYPE_CHECKING:
    from pandas import DataFrame

_LEGS = 'legs'


class RecordedSetpoints(NamedTuple):
    """
    N recorded setpoints.

    Attributes
    ----------
    times : (N,)
        Since the first setpoint [s].
    motion : Motion
        Poses, twists and accelerations.
    wrench : (N, 6)
        External wrench on the platform: force [N] and moment [N m], base axes.
    stamps : (N,)
        Stamps of the messages [ns].
    missing : tuple of str
        Parts of the recording that could not be read.

    """

    times: Array
    motion: Motion
    wrench: Array
    stamps: Stamps
    missing: tuple[str, ...]

    def to_dataframe(self) -> DataFrame:
        """Return a ``pandas.DataFrame`` of all numbers; ModuleNotFoundError without pandas."""
        quaternions = self.motion.quaternion
        table = {'t': self.times}
        for names, values in (
                (('x', 'y', 'z'), self.motion.position), (('qx', 'qy', 'qz', 'qw'), quaternions),
                (('vx', 'vy', 'vz'), self.motion.linear_velocity),
                (('wx', 'wy', 'wz'), self.motion.angular_velocity),
                (('ax', 'ay', 'az'), self.motion.linear_acceleration),
                (('alx', 'aly', 'alz'), self.motion.angular_acceleration)):
            table |= {name: values[:, n] for n, name in enumerate(names)}
        return data_frame(table)


class RecordedLegStates(NamedTuple):
    """
    N recorded states of the legs.

    Attributes
    ----------
    times : (N,)
        Since the first state [s].
    positions, velocities, efforts : (N, 6)
        Recorded values [m, m/s, N]; nan where the messages lack them.
    stamps : (N,)
        Stamps of the messages [ns].
    missing : tuple of str
        Parts of the recording that could not be read.

    """

    times: Array
    positions: Array
    velocities: Array
    efforts: Array
    stamps: Stamps
    missing: tuple[str, ...]

    def to_dataframe(self) -> DataFrame:
        """Return a ``pandas.DataFrame`` of all numbers; ModuleNotFoundError without pandas."""
        return data_frame({'t': self.times, **columns({
            'position': self.positions, 'velocity': self.velocities, 'effort': self.efforts})})


def read_setpoints(
        path: str | os.PathLike[str], parameters: Parameters | StewartPlatform | None = None, *,
        node: str = NODE, topics: Mapping[str, str] | None = None, cutoff: float | None = None,
        child: str | None = None, euler: str | None = None, axes: str | None = None,
        columns: Mapping[str, str] | None = None,
) -> RecordedSetpoints:
    """
    Return the setpoints of a bag or of a CSV file, as ``stewart_replay`` reads them.

    Parameters
    ----------
    path : path
        A bag of ROS 2 or ROS 1, or a CSV file with named columns.
    parameters : Parameters or StewartPlatform, optional
        Frames, tolerances and ``setpoint.source``; and the home pose, from which accelerations
        alone are integrated. By default those of any hexapod, and the source that is there.
    node : str, optional
        Name before the usual topics.
    topics : mapping, optional
        Topics by ``pose``, ``twist``, ``accel``, ``combined`` or ``wrench``.
    cutoff : float, optional
        Compute twist and acceleration from the poses by smoothing splines of this cut-off
        frequency [Hz]. Without it, those of poses alone are zero.
    child : str, optional
        ``child_frame_id`` of the platform in transforms, or its body in the file of a tracker.
    euler : str, optional
        Order of the rotations about x, y, z of a CSV file, as ``XYZ``: capital letters about axes
        that turn along, others about fixed axes.
    axes : str, optional
        Axes of the source that are x, y, z of the base frame, as ``x,-y,z``; by default
        ``x,y,z``, or those of a tracker.
    columns : mapping, optional
        Headings of the columns of a CSV file, by their names: ``{'x': 'Surge [mm]'}``.

    Raises
    ------
    BagError
        The recording cannot be read, or has no setpoints.
    StewartError
        An option breaks a rule.

    """
    whole = Path(os.fspath(path))
    options = Options(node=node_name(node), reading=_reading(child, euler, axes, columns),
                      topics=dict(topics or {}), cutoff=cutoff)
    known = [name_of(key) for key in inputs.INPUT_TYPES]
    if other := [name for name in options.topics if name not in known]:
        raise StewartError(f'topics: {other[0]!r}: must be one of {", ".join(known)}')
    given = parameters.parameters if isinstance(parameters, StewartPlatform) else parameters
    if given is None:
        given = any_hexapod().replaced({'setpoint.source': _source(whole, options)})
    found = read_motion(whole, given, options, home=parameters is not None)
    return RecordedSetpoints(
        found.seconds, found.motion, found.wrench, found.stamps, tuple(found.missing))


def any_hexapod() -> Parameters:
    """Return the parameters of some hexapod, where only defaults are read."""
    angles = np.radians([10.0, 110.0, 130.0, 230.0, 250.0, 350.0])
    circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(6)])
    return Parameters({
        'geometry.base_joints': circle.ravel().tolist(),
        'geometry.platform_joints': np.roll(circle, 1, axis=0).ravel().tolist(),
        'platform.mass': 1.0, 'platform.inertia': [1.0, 0.0, 0.0, 1.0, 0.0, 1.0]})


def _source(path: Path, options: Options) -> str:
    """Return the value of setpoint.source that fits a recording."""
    if options.cutoff is not None:
        return POSES_ALONE
    with closing(Recording(path, options.reading)) as recording:
        kinds = set(recording.topics.values())
    if 'combined' in options.topics:
        return COMBINED
    if {inputs.INPUT_TYPES[inputs.TWIST], inputs.INPUT_TYPES[inputs.ACCEL]} <= kinds:
        return SEPARATE
    return COMBINED if inputs.INPUT_TYPES[inputs.COMBINED] in kinds else POSES_ALONE


def read_legs(
        path: str | os.PathLike[str], joints: Parameters | StewartPlatform | tuple[str, ...] | None
        = None, *, node: str = NODE, topic: str | None = None) -> RecordedLegStates:
    """
    Return the measured legs of a bag.

    Parameters
    ----------
    path : path
        A bag of ROS 2 or ROS 1.
    joints : Parameters, StewartPlatform or names, optional
        Names of the six joints, in order; by default ``leg_1`` to ``leg_6``.
    node : str, optional
        Name before the usual topic, ``NODE/measured_legs``.
    topic : str, optional
        Another topic of type sensor_msgs/JointState, or several with commas, of some legs each.

    Raises
    ------
    BagError
        The bag cannot be read, or has no valid message of the six joints.

    """
    if joints is None:
        joints = any_hexapod()
    if isinstance(joints, StewartPlatform):
        joints = joints.parameters
    names = joints['joints'] if isinstance(joints, Parameters) else tuple(joints)
    readers = {field: JointStateReader(names, [field]) for field in (
        'position', 'velocity', 'effort')}
    found: dict[str, list[tuple[Stamps, Array]]] = {field: [] for field in readers}
    with closing(Recording(Path(os.fspath(path)))) as recording:
        name = find_measured_legs(recording, node_name(node), topic)

        def read_states(messages: Messages) -> None:
            for field, reader in readers.items():
                states = reader.read_states(messages)
                found[field].append((states.stamps, states.values))

        read_all(recording, [Subscription({name: _LEGS}, read_states)])
        missing = tuple(recording.missing)
    stamps, rows = {}, {}
    for field, reader in readers.items():
        reader.check(f'{path}: {name}')
        stamps[field] = np.concatenate([each for each, _ in found[field]] or [
            np.empty(0, dtype=np.int64)])
        rows[field] = np.concatenate([each for _, each in found[field]] or [np.empty((0, 6))])
    whole = np.unique(np.concatenate(list(stamps.values())))
    if not len(whole):
        raise BagError(f'{path}: {name}: has no valid message')
    values = {field: np.full((len(whole), 6), np.nan) for field in readers}
    for field, at in stamps.items():
        values[field][np.searchsorted(whole, at)] = rows[field]
    return RecordedLegStates((whole - whole[0]) * NANOSECOND, values['position'],
                             values['velocity'], values['effort'], whole, missing)


def _reading(child: str | None, euler: str | None, axes: str | None,
             columns: Mapping[str, str] | None) -> Reading:
    """Return the options for other sources; StewartError if one breaks a rule."""
    if euler is not None and euler not in EULER:
        raise StewartError(f'euler: {euler!r}: must be one of {", ".join(EULER)}')
    if axes is not None:
        axes_matrix(axes)
        axes = axes.replace(' ', '')
    return Reading(child, euler, axes, dict(columns or {}))
