# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The hexapod as a model over real topics: ~/joint_states and /tf of the node."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
import importlib.util
import math
import os
from pathlib import Path
from typing import Any

from messages import STORE
import numpy as np
import pytest
from referees import rng
from running import DynamicsNode, executable, NODE, NodeProcess, Program, ROOT, Sample
from sensor_msgs.msg import JointState
from stewart_dynamics import Motion, Pose
from stewart_dynamics.description.model import JOINT_STATES, MODEL_TYPES, TF
from test_external_wrench import HEXAPOD, LOAD, MILLISECOND, resting
from test_external_wrench import message_of
from test_external_wrench_node import Felt
from test_model_messages import stamp_of, tips_and_platform_joints
from visualization_msgs.msg import MarkerArray

Start = Callable[..., DynamicsNode]
HAVE_TF2 = importlib.util.find_spec('tf2_msgs') is not None


def sample(random: np.random.Generator) -> Sample:
    """Return a random pose near home, at rest."""
    axis = random.normal(size=3)
    half = 0.5 * random.uniform(0.0, 0.2)
    x, y, z = math.sin(half) * axis / np.linalg.norm(axis)
    return Sample(tuple([0.0, 0.0, 1.1] + random.uniform(-0.05, 0.05, 3)),
                  (x, y, z, math.cos(half)))


class Joints:
    """All joint states of a node since it was asked for them."""

    def __init__(self, node: DynamicsNode) -> None:
        self.node = node
        self.raw = node.peer.listen(f'{NODE}/{JOINT_STATES}', JointState)

    def received(self) -> list[Any]:
        return [STORE.deserialize_cdr(data, MODEL_TYPES[JOINT_STATES]) for data in self.raw]

    def until_matched(self) -> None:
        """Answer setpoints until joint states come."""
        def came() -> bool:
            self.node.answer()
            return bool(self.raw)

        self.node.until(came, 'joint states come')

    def check(self, state: Any, motion: Motion | Pose) -> None:
        """Check that the loops of the URDF are closed, at this pose."""
        tips, joints = tips_and_platform_joints(
            self.node.platform.parameters, state.name, state.position)
        assert np.abs(tips - joints).max() < 1e-9
        lengths = self.node.platform.inverse_kinematics(motion)
        zero = self.node.platform.parameters['geometry.zero_length']
        q = dict(zip(state.name, state.position, strict=True))
        of_legs = [q[leg] for leg in self.node.platform.parameters['joints']]
        np.testing.assert_allclose(of_legs, lengths - zero, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(state.position[:3], motion.position, rtol=0.0, atol=1e-9)


def test_joint_states_close_the_loops_at_each_setpoint(fresh: Start) -> None:
    random = rng()
    node = fresh('visualization_rate:=1000000.0')
    node.until_active()
    joints = Joints(node)
    joints.until_matched()
    sent: dict[int, Sample] = {}
    for _ in range(30):
        stamp = node.stamp()
        sent[stamp] = sample(random)
        node.answer(sent[stamp], stamp=stamp)
    node.until(lambda: stamp_of(joints.received()[-1]) == stamp, 'the last has come')
    found = {stamp_of(state): state for state in joints.received()}
    assert len(found) == len(joints.raw)
    assert set(sent) <= set(found)
    for at, each in sent.items():
        joints.check(found[at], Pose.from_quaternion(each.position, each.quaternion))


def test_without_a_rate_and_publish_tf_there_are_no_such_topics(fresh: Start) -> None:
    node = fresh('visualization_rate:=0.0')
    node.until_active()
    node.answer()

    writers = node.peer.node.count_publishers
    node.until(lambda: writers(f'{NODE}/leg_forces') == 1, 'its topics are known')
    assert not any(map(writers, (f'{NODE}/{JOINT_STATES}', f'{NODE}/markers', TF)))


def test_joint_states_of_measured_legs(fresh: Start) -> None:
    node = fresh('visualization_rate:=1000000.0', 'joint_states.source:=measured')
    felt, joints = Felt(node), Joints(node)
    felt.until_heard()
    random = rng()
    stamp = felt.stamp
    sent: dict[int, Motion] = {}
    for _ in range(200):
        if len(joints.raw) > 20:
            break
        each = sample(random)
        motion = Motion.from_pose(Pose.from_quaternion(each.position, each.quaternion))
        stamp += MILLISECOND
        sent[stamp] = motion
        felt.publish(message_of(resting(HEXAPOD, motion, LOAD, [stamp])[0]))
        # A setpoint elsewhere has no part in it.
        node.answer()
    found = joints.received()
    assert len(found) > 20
    for state in found:
        joints.check(state, sent[stamp_of(state)])
    # Lengths that no pose has: reported, and nothing is published.
    wrong = resting(HEXAPOD, motion, LOAD, [stamp + MILLISECOND])[0]
    felt.publish(message_of(wrong._replace(positions=(0.2, 3.0, 0.2, 3.0, 0.2, 3.0))))
    node.until_said('measured_legs rejected: forward kinematics did not converge')
    for _ in range(20):
        node.answer()
    assert {stamp_of(state) for state in joints.received()} <= set(sent)


# Transforms

@pytest.fixture(scope='module')
def with_tf2(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """
    Return the environment in which a program finds tf2_msgs.

    ROS's wheels on PyPI do not contain it: in its place another type gives the topic a type,
    while the bytes are those of a TFMessage.
    """
    if HAVE_TF2:
        yield {}
        return
    folder = tmp_path_factory.mktemp('tf2')
    (folder / 'tf2_msgs' / 'msg').mkdir(parents=True)
    (folder / 'tf2_msgs' / '__init__.py').touch()
    (folder / 'tf2_msgs' / 'msg' / '__init__.py').write_text(
        'from visualization_msgs.msg import MarkerArray as TFMessage\n', encoding='utf-8')
    others = os.environ.get('PYTHONPATH')
    yield {'PYTHONPATH': f'{folder}{os.pathsep}{others}' if others else str(folder)}


def test_each_setpoint_has_its_transform(with_tf2: dict[str, str], tmp_path: Path,
                                         ros_environment: None) -> None:
    if HAVE_TF2:
        from tf2_msgs.msg import TFMessage
    else:
        TFMessage = MarkerArray  # noqa: N806
    random = rng()
    with closing(NodeProcess(tmp_path, 'publish_tf:=true', **with_tf2)) as process:
        with closing(DynamicsNode(process)) as node:
            node.until_active()
            raw = node.peer.listen(TF, TFMessage)

            def came() -> bool:
                node.answer()
                return bool(raw)

            node.until(came, 'transforms come')
            sent: dict[int, Sample] = {}
            for _ in range(30):
                stamp = node.stamp()
                sent[stamp] = sample(random)
                node.answer(sent[stamp], stamp=stamp)

            def received() -> dict[int, Any]:
                messages = [STORE.deserialize_cdr(data, MODEL_TYPES[TF]) for data in raw]
                return {stamp_of(of): of for message in messages for of in message.transforms}

            node.until(lambda: set(sent) <= set(received()), 'each has its transform')
            assert len(received()) == len(raw)
            for stamp, each in sent.items():
                of = received()[stamp]
                assert (of.header.frame_id, of.child_frame_id) == ('base', 'platform')
                t, r = of.transform.translation, of.transform.rotation
                assert (t.x, t.y, t.z) == each.position
                np.testing.assert_allclose(
                    [r.x, r.y, r.z, r.w], each.quaternion, rtol=0.0, atol=1e-15)


@pytest.mark.skipif(HAVE_TF2, reason='tf2_msgs is installed')
def test_without_tf2_msgs_publish_tf_is_rejected(domain: int, tmp_path: Path) -> None:
    program = Program([
        executable('stewart_dynamics'), '--ros-args', '--params-file',
        ROOT / 'config' / 'platform.yaml', '-p', 'publish_tf:=true'], domain, tmp_path)
    try:
        assert program.wait() == 1, program.stderr
    finally:
        program.kill()
    assert 'publish_tf: true: needs the ROS package tf2_msgs, which is not installed' in (
        program.stderr.splitlines()[-1])
