# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The messages of the output bag from which Foxglove and RViz show the hexapod as a model."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

from messages import STORE
import numpy as np
import pytest
from referees import Array, random_motion, random_parameters, rng
from scipy.spatial.transform import Rotation
from snapshot import Snapshot

from stewart_dynamics import Parameters
from stewart_dynamics.description.model import JOINT_STATES, ModelMessages, TF
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.replay.output_bag import (
    RECORDED_TYPES, RecordedModel, ROBOT_DESCRIPTION, TF_STATIC)

PROGRAM = 'stewart_replay'

STAMP = 1_700_000_000_123_456_789
SAMPLES = 20
CLOSED = 1e-12  # [m], of machines of 0.3 to 3 m


def read(topic: str, data: Any) -> Any:
    """Return a message, of which every byte has been read."""
    message = STORE.deserialize_cdr(data.tobytes(), RECORDED_TYPES[topic])
    assert STORE.serialize_cdr(message, RECORDED_TYPES[topic]).tobytes() == data.tobytes()
    return message


def links(message: Any, stamp: int) -> dict[str, tuple[str, Array]]:
    """Return of each link the one that it is fixed to and the transform to it (4, 4)."""
    found: dict[str, tuple[str, Array]] = {}
    for each in message.transforms:
        assert each.header.stamp.sec * 1_000_000_000 + each.header.stamp.nanosec == stamp
        t, r = each.transform.translation, each.transform.rotation
        quaternion = [r.x, r.y, r.z, r.w]
        assert np.linalg.norm(quaternion) == pytest.approx(1.0, abs=1e-15)
        matrix = np.eye(4)
        matrix[:3, :3] = Rotation.from_quat(quaternion).as_matrix()
        matrix[:3, 3] = t.x, t.y, t.z
        assert each.child_frame_id not in found
        found[each.child_frame_id] = each.header.frame_id, matrix
    return found


def placed(tree: dict[str, tuple[str, Array]], link: str, base: str) -> Array:
    """Return the transform from a link to the base (4, 4)."""
    found = np.eye(4)
    while link != base:
        link, transform = tree[link]
        found = transform @ found
    return found


class Recorded:
    """A random hexapod, a motion, and the recorded messages."""

    def __init__(self, **changes: Any) -> None:
        random = rng()
        self.parameters = random_parameters(random).replaced(
            {'geometry.zero_length': random.uniform(0.2, 1.0, 6), **changes})
        self.motion = random_motion(self.parameters, random, SAMPLES)
        self.stamps = STAMP + 33_000_000 * np.arange(SAMPLES)
        model = RecordedModel(self.parameters, 'hexapod')
        (of_fixed, fixed), (of_urdf, described) = model.write_beginning(STAMP)
        assert (of_fixed, of_urdf) == (TF_STATIC, ROBOT_DESCRIPTION)
        self.urdf: str = read(of_urdf, described[0]).data
        self.rows = dict(model.write_motions(self.stamps, self.motion.rows))
        assert set(self.rows) == {JOINT_STATES, TF}
        assert not dict(model.write_motions(self.stamps[:0], self.motion.rows[:0]))
        self.trees = [
            links(read(TF, data), stamp) | links(read(of_fixed, fixed[0]), STAMP)
            for stamp, data in zip(self.stamps.tolist(), self.rows[TF], strict=True)]


@pytest.fixture(scope='module', params=['base', 'Süd/0'])
def recorded(request: pytest.FixtureRequest) -> Recorded:
    return Recorded(base_frame=request.param)


def test_every_link_of_the_urdf_has_its_transform(recorded: Recorded) -> None:
    robot = ElementTree.fromstring(recorded.urdf)
    names = {each.attrib['name'] for each in robot.findall('link')}
    for tree in recorded.trees:
        assert {*tree} | {recorded.parameters['base_frame']} == names
        for joint in robot.findall('joint'):
            (parent,), (child,) = joint.findall('parent'), joint.findall('child')
            assert tree[child.attrib['link']][0] == parent.attrib['link']


def test_the_platform_has_the_pose_and_the_loops_are_closed(recorded: Recorded) -> None:
    p, motion = recorded.parameters, recorded.motion
    base, platform = p['base_frame'], p['platform_frame']
    for n, tree in enumerate(recorded.trees):
        found = placed(tree, platform, base)
        np.testing.assert_allclose(found[:3, 3], motion.position[n], rtol=0.0, atol=CLOSED)
        np.testing.assert_allclose(found[:3, :3], motion.rotation[n], rtol=0.0, atol=CLOSED)
        for leg in p['joints']:
            tip, joint = (placed(tree, f'{leg}_{end}', base)[:3, 3]
                          for end in ('piston', 'platform_joint'))
            np.testing.assert_allclose(tip, joint, rtol=0.0, atol=CLOSED)


def test_the_transforms_are_those_of_pinocchio(recorded: Recorded) -> None:
    """It reads the same URDF and gets the recorded positions of the joints."""
    pin = pytest.importorskip('pinocchio')
    model = pin.buildModelFromXML(recorded.urdf)
    data = model.createData()
    base = recorded.parameters['base_frame']
    for row, tree in zip(recorded.rows[JOINT_STATES], recorded.trees, strict=True):
        state = read(JOINT_STATES, row)
        places = [model.joints[model.getJointId(name)].idx_q for name in state.name]
        q = np.zeros(model.nq)
        q[places] = state.position
        pin.framesForwardKinematics(model, data, q)
        for link in tree:
            found = data.oMf[model.getFrameId(link, pin.BODY)].homogeneous
            np.testing.assert_allclose(
                placed(tree, link, base), found, rtol=0.0, atol=CLOSED)


def test_the_joints_are_those_of_the_node(recorded: Recorded) -> None:
    messages = ModelMessages(recorded.parameters)
    for stamp, row, data in zip(recorded.stamps.tolist(), recorded.motion.rows.tolist(),
                                recorded.rows[JOINT_STATES], strict=True):
        ours = read(JOINT_STATES, data)
        of_node = STORE.deserialize_cdr(
            messages.joint_states(stamp, row), RECORDED_TYPES[JOINT_STATES])
        assert (ours.header, ours.name) == (of_node.header, of_node.name)
        np.testing.assert_allclose(ours.position, of_node.position, rtol=0.0, atol=2e-15)


def test_two_links_of_one_name_are_rejected(snapshot: Snapshot) -> None:
    p = Parameters({**random_parameters(rng()), 'base_frame': 'leg_1_piston'})
    with snapshot.raises(ParameterError):
        RecordedModel(p, 'hexapod')
