# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Messages that show the hexapod as a model: all joints, and the platform's transform."""

from __future__ import annotations

from typing import Any

from messages import STORE
import numpy as np
import pytest
from referees import Array, random_motion, random_parameters, rng
from scipy.spatial.transform import Rotation
from snapshot import Snapshot

from stewart_dynamics import Parameters
from stewart_dynamics.description.model import JOINT_STATES, MODEL_TYPES, ModelMessages, TF
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.kinematics.leg_joints import mounts

PROGRAM = 'stewart_dynamics'

STAMP = 1_700_000_000_123_456_789


def tips_and_platform_joints(p: Parameters, names: Any, positions: Any) -> tuple[Array, Array]:
    """
    Return where legs end and where platform joints are (6, 3) [m], base frame.

    By forward kinematics along both branches of the URDF: fixed origins, and joints one by one.
    """
    q = dict(zip(names, positions, strict=True))
    platform = p['platform_frame']
    turned = Rotation.from_euler(
        'ZYX', [q[f'{platform}_{axis}'] for axis in ('yaw', 'pitch', 'roll')])
    joints = [q[f'{platform}_{axis}'] for axis in 'xyz'] + turned.apply(
        p['geometry.platform_joints'])
    tips = []
    for leg, mount, base, zero in zip(
            p['joints'], mounts(p), p['geometry.base_joints'], p['geometry.zero_length'],
            strict=True):
        universal = Rotation.from_euler(
            'XY', [q[f'{leg}_universal_x'], q[f'{leg}_universal_y']])
        along = universal.apply([0.0, 0.0, q[leg] + zero])
        tips.append(base + mount @ along)
    return np.array(tips), joints


def stamp_of(message: Any) -> int:
    return int(message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec)


def test_the_loops_are_closed_in_every_message() -> None:
    random = rng()
    for _ in range(3):
        p = random_parameters(random).replaced({'geometry.zero_length': random.uniform(0.2, 1, 6)})
        messages = ModelMessages(p)
        for n, row in enumerate(random_motion(p, random, 100).rows.tolist()):
            data = messages.joint_states(STAMP + n, row)
            state: Any = STORE.deserialize_cdr(data, MODEL_TYPES[JOINT_STATES])
            assert STORE.serialize_cdr(state, MODEL_TYPES[JOINT_STATES]).tobytes() == data
            assert (stamp_of(state), state.header.frame_id) == (STAMP + n, '')
            assert len(state.name) == len(state.position) == len(set(state.name)) == 24
            assert len(state.velocity) == len(state.effort) == 0
            tips, joints = tips_and_platform_joints(p, state.name, state.position)
            assert np.abs(tips - joints).max() < 1e-12
            np.testing.assert_allclose(state.position[:3], row[:3], rtol=0.0, atol=0.0)


def test_the_joints_are_those_of_the_urdf() -> None:
    """As Pinocchio reads it: it puts the end of each leg on its platform joint."""
    pytest.importorskip('pinocchio')
    from test_urdf import CLOSED, Tree
    random = rng()
    p = random_parameters(random)
    tree, messages, motion = Tree(p), ModelMessages(p), random_motion(p, random, 50)
    for n, row in enumerate(motion.rows.tolist()):
        state: Any = STORE.deserialize_cdr(
            messages.joint_states(STAMP, row), MODEL_TYPES[JOINT_STATES])
        assert sorted(state.name) == sorted(tree.model.names[1:])
        places = [tree.model.joints[tree.model.getJointId(name)].idx_q for name in state.name]
        q = np.zeros(tree.model.nq)
        q[places] = state.position
        assert tree.gap(motion[n], q[tree.places]) < CLOSED


@pytest.mark.parametrize('frame', ['b', 'ba', 'bas', 'base', 'base_link', 'Süd'])
@pytest.mark.parametrize('child', ['p', 'pl', 'platform', 'tool/0'])
def test_the_transform_is_the_pose(frame: str, child: str) -> None:
    random = rng()
    p = random_parameters(random).replaced({'base_frame': frame, 'platform_frame': child})
    motion = random_motion(p, random, 5)
    for n, row in enumerate(motion.rows.tolist()):
        data = ModelMessages(p).transform(STAMP, row)
        message: Any = STORE.deserialize_cdr(data, MODEL_TYPES[TF])
        assert STORE.serialize_cdr(message, MODEL_TYPES[TF]).tobytes() == data
        of, = message.transforms
        assert (stamp_of(of), of.header.frame_id, of.child_frame_id) == (STAMP, frame, child)
        t, r = of.transform.translation, of.transform.rotation
        assert [t.x, t.y, t.z] == row[:3]
        np.testing.assert_allclose(
            Rotation.from_quat([r.x, r.y, r.z, r.w]).as_matrix(), motion.rotation[n],
            rtol=0.0, atol=1e-14)


def test_two_joints_of_one_name_are_rejected(snapshot: Snapshot) -> None:
    p = random_parameters(rng()).replaced(
        {'joints': ['a', 'a_universal_x', 'c', 'd', 'e', 'f']})
    with snapshot.raises(ParameterError):
        ModelMessages(p)
