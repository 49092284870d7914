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


"""Poses: their constructors, and poses and motions as sequences of samples."""

from __future__ import annotations

import copy
import pickle
import re
from typing import Any

import numpy as np
import pytest
from referees import random_direction, random_motion, random_parameters, rng, rotation_about

from stewart_dynamics import Motion, MotionError, Pose

POSITION = [1.0, 2.0, 3.0]
UPRIGHT = np.eye(3)


def random_poses(many: int) -> Pose:
    """Return poses of any orientation."""
    random = rng()
    return Pose(random.normal(size=(many, 3)), [
        rotation_about(random_direction(random), random.uniform(-3.0, 3.0))
        for _ in range(many)])


def test_all_constructors_give_the_same_pose() -> None:
    turn = rotation_about([0.0, 0.0, 1.0], 0.4) @ rotation_about([0.0, 1.0, 0.0], -0.3) @ (
        rotation_about([1.0, 0.0, 0.0], 0.2))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, POSITION
    pose = Pose(POSITION, turn)
    for other in (Pose.from_euler(POSITION, [0.2, -0.3, 0.4]), Pose.from_matrix(matrix),
                  Pose.from_quaternion(POSITION, pose.quaternion),
                  Pose.from_quaternion(POSITION, -pose.quaternion)):
        assert np.array_equal(other.position, POSITION)
        assert np.allclose(other.rotation, turn, rtol=0.0, atol=1e-15)
    twist = [0.1, 0.2, 0.3], [0.4, 0.5, 0.6]
    truth = Motion(POSITION, turn, *twist)
    assert Motion.from_pose(pose, *twist) == truth
    assert np.allclose(Motion.from_quaternion(POSITION, pose.quaternion, *twist).rows,
                       truth.rows, rtol=0.0, atol=1e-15)
    assert truth.pose == pose
    assert Motion.from_pose(truth) == Motion(POSITION, turn)


def test_a_quaternion_is_x_y_z_w_and_normalized() -> None:
    half = np.sqrt(0.5)
    quarter = Pose.from_quaternion(POSITION, [0.0, 0.0, half, half])
    assert np.allclose(quarter.rotation @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)
    longer = Pose.from_quaternion(POSITION, [0.0, 0.0, 1.0009 * half, 1.0009 * half])
    assert np.allclose(longer.rotation, quarter.rotation, rtol=0.0, atol=1e-15)


def test_constructors_take_any_leading_shape() -> None:
    poses = random_poses(12)
    q = poses.quaternion.reshape(3, 4, 4)
    assert Pose.from_quaternion(POSITION, q).shape == (3, 4)
    assert np.allclose(Pose.from_quaternion(POSITION, q).rotation,
                       poses.rotation.reshape(3, 4, 3, 3), rtol=0.0, atol=4e-15)
    matrices = np.zeros((12, 4, 4))
    matrices[:, :3, :3], matrices[:, :3, 3] = poses.rotation, poses.position
    matrices[:, 3, 3] = 1.0
    assert Pose.from_matrix(matrices) == poses
    assert Pose(np.zeros((0, 3)), UPRIGHT).shape == (0,)


@pytest.mark.parametrize(('make', 'text'), [
    (lambda: Pose(POSITION, np.diag([1.0, 1.0, -1.0])),
     'is a reflection: its determinant is -1, must be +1 (is an axis mirrored, or are two '
     'columns exchanged?)'),
    (lambda: Pose(POSITION, 1.1 * UPRIGHT), 'is not a rotation: R^T R is 0.21 off the identity'),
    (lambda: Pose([np.nan, 0.0, 0.0], UPRIGHT), 'position[0]: nan: must be finite'),
    (lambda: Pose({'x': 1.0}, UPRIGHT), 'position: a value of type dict: not an array'),
    (lambda: Pose(POSITION, UPRIGHT + 0j), 'rotation: a value of type ndarray: not an array of '
     'real numbers: its type is complex128'),
    (lambda: Pose([POSITION, POSITION], [UPRIGHT] * 3), 'position (2,), rotation (3,)'),
    (lambda: Pose.from_quaternion(POSITION, [0.0, 0.0, 0.0, 1.01]), 'length 1.01, must be'),
    (lambda: Pose.from_quaternion(POSITION, [0.0] * 4), 'length 0, must be within 0.001 of 1'),
    (lambda: Pose.from_quaternion(POSITION, [1e308] * 4), 'length inf, must be'),
    (lambda: Pose.from_quaternion(POSITION, [0.0, 0.0, 1.0]), 'quaternion: shape (3,)'),
    (lambda: Pose.from_matrix(np.eye(3)), 'matrix: shape (3, 3): must end in (4, 4)'),
    (lambda: Pose.from_matrix([np.eye(4), np.ones((4, 4))]),
     'matrix[1]: its last row is [1.0, 1.0, 1.0, 1.0]: must be [0, 0, 0, 1]'),
    (lambda: Pose.from_euler(POSITION, None), 'angles: None: not an array of real numbers'),
    (lambda: Motion.from_pose(POSITION), 'pose: a value of type list: must be a Pose or a Motion'),
])
def test_bad_arguments_are_rejected_in_one_line(make: Any, text: str) -> None:
    with pytest.raises(MotionError) as caught:
        make()
    assert text in str(caught.value)
    assert '\n' not in str(caught.value)


# Poses and motions as sequences of samples

def batches() -> list[Any]:
    """Return a batch of poses and one of motions, both of shape (4, 5)."""
    motion = random_motion(random_parameters(rng()), rng(), 20)
    motion = Motion.of_rows(motion.rows.reshape(4, 5, -1))
    return [motion, motion.pose]


@pytest.mark.parametrize('batch', batches(), ids=['Motion', 'Pose'])
def test_samples_are_indexed_like_an_array(batch: Any) -> None:
    kind = type(batch)
    assert len(batch) == 4
    mask = np.arange(4) % 2 == 0
    both = np.arange(20).reshape(4, 5) % 3 == 0
    for index, shape in ((3, (5,)), (slice(None, None, 2), (2, 5)), ((1, 2), ()),
                         ((slice(None), -1), (4,)), ((..., 0), (4,)), ([0, 2, 1], (3, 5)),
                         (mask, (2, 5)), (both, (7,)), (slice(0, 0), (0, 5))):
        part = batch[index]
        assert type(part) is kind
        assert part.shape == shape
        assert np.array_equal(part.position, batch.position[
            (*index, slice(None)) if isinstance(index, tuple) else index])
        assert np.array_equal(part.rotation.shape, (*shape, 3, 3))
    assert [each.shape for each in batch] == [(5,)] * 4
    assert list(batch)[2] == batch[2]
    one = batch[1, 2]
    for wrong in (9, (0, 0, 0), 'x', 1.5):
        with pytest.raises(IndexError, match=re.escape(f'{kind.__name__} of shape (4, 5): ')):
            batch[wrong]
    with pytest.raises(IndexError, match=re.escape('of shape (): ')):
        one[0]
    with pytest.raises(TypeError, match='has no length'):
        len(one)


@pytest.mark.parametrize('batch', batches(), ids=['Motion', 'Pose'])
def test_equality_is_that_of_all_numbers(batch: Any) -> None:
    assert batch == copy.deepcopy(batch) == pickle.loads(pickle.dumps(batch))
    assert batch != batch[:3]
    changed = copy.deepcopy(batch)
    changed.rows[2, 3, -1] += 1e-9
    assert batch != changed
    assert batch != batch.rows
    assert batches()[0] != batches()[1]
    with pytest.raises(TypeError, match='unhashable'):
        hash(batch)


def test_representations_are_short() -> None:
    motion, poses = batches()
    assert repr(motion) == '<Motion of shape (4, 5)>'
    assert repr(poses[0]) == '<Pose of shape (5,)>'
    assert repr(Pose(POSITION, UPRIGHT)) == (
        '<Pose: position [1, 2, 3] m, quaternion [0, 0, 0, 1]>')
    assert len(repr(motion[0, 0])) < 150


def test_angles_may_be_in_degrees() -> None:
    degrees = np.array([[10.0, -20.0, 30.0], [0.0, 5.0, -170.0]])
    derivatives = [None, 2.0 * degrees, None, 3.0 * degrees]
    position = [0.1, 0.2, 1.0]
    assert Pose.from_euler(position, degrees, degrees=True) == Pose.from_euler(
        position, np.radians(degrees))
    given = Motion.from_euler(position, degrees, *derivatives, degrees=True)
    assert given == Motion.from_euler(position, np.radians(degrees), *(
        None if each is None else np.radians(each) for each in derivatives))
