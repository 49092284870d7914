# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The markers for RViz and Foxglove: messages, geometry, colours."""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
import pytest

pytest.importorskip('rclpy')

from rclpy.qos import QoSProfile  # noqa: E402
from rclpy.serialization import deserialize_message, serialize_message  # noqa: E402
from referees import (  # noqa: E402
    QUARTER_TURN, random_motion, random_parameters, rng, size_of, symmetric_parameters)
from running import DynamicsNode, nanoseconds, NODE, PLATFORM, Sample  # noqa: E402
from stewart_dynamics import Parameters, Pose, StewartPlatform  # noqa: E402
from stewart_dynamics.arrays import SECOND  # noqa: E402
from stewart_dynamics.mechanics.frames.rotation import from_quaternion  # noqa: E402
from stewart_dynamics.node import markers as module  # noqa: E402
from stewart_dynamics.node.diagnostics.levels import ERROR, OK, WARN  # noqa: E402
from stewart_dynamics.node.markers import Markers  # noqa: E402
from stewart_dynamics.setpoints.step import Batch, Step  # noqa: E402
from visualization_msgs.msg import Marker, MarkerArray  # noqa: E402

Array = NDArray[np.float64]
Start = Callable[..., DynamicsNode]

HEXAPOD = Parameters.from_yaml(PLATFORM)
UPRIGHT = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
STAMP = 1_700_000_000_123_456_789


def setpoint(position: tuple[float, ...], rotation: Any = UPRIGHT) -> Batch:
    """Return a setpoint at rest."""
    return Batch.from_parts(STAMP, (*position, *np.ravel(rotation), *(0.0,) * 12))


HOME = setpoint((0.0, 0.0, 1.1))
# Turned by 88 degrees, det(J) is nearly zero; by 90 it is.
NEAR = setpoint((0.0, 0.0, 1.1), np.reshape(
    from_quaternion(0.0, 0.0, math.sin(math.radians(43.0)), math.cos(math.radians(43.0))), (3, 3)))
SINGULAR = setpoint((0.0, 0.0, 1.1), QUARTER_TURN)


def written(writer: Markers, step: Step, to: Batch, forces: Any = None) -> bytes:
    """Return the message of the answer to a setpoint, or of one with other published forces."""
    outputs = step(to)
    assert outputs.answered[0]
    if forces is not None:
        outputs.rows[:, outputs.computed.commands] = forces
    return writer.write(to, outputs, step.exceedances(outputs))


def picture(parameters: Parameters, to: Batch, forces: Any = None) -> dict[tuple[str, int], Any]:
    """Return the markers of an answer, as rclpy reads them, by namespace and number."""
    data = written(Markers(parameters), Step(parameters), to, forces)
    return by_name(deserialize_message(data, MarkerArray))


def by_name(message: Any) -> dict[tuple[str, int], Any]:
    """Return markers by namespace and number, each of which there is once."""
    named = {(marker.ns, marker.id): marker for marker in message.markers}
    assert len(named) == len(message.markers)
    return named


def points(marker: Any) -> Array:
    """Return the points of a marker in the base frame (N, 3)."""
    return ends(marker, np.array([[p.x, p.y, p.z] for p in marker.points]))


def ends(marker: Any, local: Any) -> Array:
    """Return points (N, 3) of a marker's own frame in the base frame."""
    q, t = marker.pose.orientation, marker.pose.position
    assert math.hypot(q.x, q.y, q.z, q.w) == pytest.approx(1.0, abs=1e-14)
    rotation = np.reshape(from_quaternion(q.x, q.y, q.z, q.w), (3, 3))
    turned: Array = np.array([t.x, t.y, t.z]) + np.asarray(local) @ rotation.T
    return turned


def axis_ends(marker: Any) -> Array:
    """Return where a cylinder begins and ends (2, 3)."""
    half = 0.5 * marker.scale.z
    return ends(marker, [[0.0, 0.0, -half], [0.0, 0.0, half]])


def color(marker: Any) -> tuple[float, ...]:
    """Return red, green, blue and alpha."""
    return marker.color.r, marker.color.g, marker.color.b, marker.color.a


def shade(expected: tuple[float, ...]) -> Any:
    """Return a color as float32 has it."""
    return pytest.approx(expected, abs=1e-6)


def pose_of(to: Batch) -> Pose:
    """Return the pose of a setpoint."""
    return Pose(to.motions[0, :3], to.motions[0, 3:12].reshape(3, 3))


def joints_of(parameters: Parameters, to: Batch) -> tuple[Array, Array]:
    """Return base and platform joints (6, 3) in the base frame."""
    pose = pose_of(to)
    return (parameters['geometry.base_joints'],
            pose.position + parameters['geometry.platform_joints'] @ pose.rotation.T)


def hexapods() -> list[tuple[Parameters, Batch]]:
    """Return hexapods and poses: random ones, one that hangs, one with its legs in a plane."""
    random = rng()
    cases = [(HEXAPOD, HOME), (HEXAPOD, setpoint((0.0, 0.0, -1.1))),
             (HEXAPOD, setpoint((0.0, 0.0, 0.0))), (HEXAPOD, SINGULAR)]
    for _ in range(8):
        parameters = random_parameters(random)
        motion = random_motion(parameters, random, 1)
        cases.append((parameters, Batch.from_parts(STAMP, motion.rows)))
    return cases


CASES = hexapods()


# The message

@pytest.mark.parametrize('frame, joints, to', [
    ('', tuple('abcdef'), HOME), ('b', tuple(f'leg_{n}' * 20 for n in range(6)), NEAR), *(
        (frame, ('ab', 'abc', 'abcd', 'abcde', 'abcdef', 'ä\u4e2d'), SINGULAR)
        for frame in ('ba', 'bas', 'base', 'base\u00e4'))], ids=range(6))
def test_bytes_are_those_of_a_typed_message(joints: Any, frame: str, to: Batch) -> None:
    parameters = HEXAPOD.replaced({'joints': joints, 'base_frame': frame})
    data = written(Markers(parameters), Step(parameters), to)
    message = deserialize_message(data, MarkerArray)
    again = bytes(serialize_message(message))
    assert len(again) == len(data)
    # Padding bytes are zero here and arbitrary there.
    assert all(ours in (theirs, 0) for ours, theirs in zip(data, again, strict=True))
    assert deserialize_message(again, MarkerArray) == message

    for marker in message.markers:
        assert nanoseconds(marker.header.stamp) == STAMP
        assert marker.header.frame_id == frame
        assert marker.action == Marker.ADD
        assert nanoseconds(marker.lifetime) == 2_000_000_000
        # All that a marker may have and these have not.
        assert len(marker.colors) == (6 if marker.type == Marker.LINE_LIST else 0)
        assert not marker.frame_locked
        assert not marker.uv_coordinates
        assert marker.texture == Marker().texture
        assert marker.texture_resource == marker.mesh_resource == ''
        assert marker.mesh_file == Marker().mesh_file
        assert not marker.mesh_use_embedded_materials
        assert bool(marker.text) == (marker.type == Marker.TEXT_VIEW_FACING)
    kinds = {name: [marker.type for (ns, _), marker in by_name(message).items() if ns == name]
             for name in {marker.ns for marker in message.markers}}
    assert kinds == {
        'base': [Marker.TRIANGLE_LIST, Marker.SPHERE_LIST],
        'names': [Marker.TEXT_VIEW_FACING] * 6,
        'platform': [Marker.TRIANGLE_LIST, Marker.SPHERE_LIST, Marker.LINE_LIST,
                     Marker.SPHERE_LIST],
        'cylinders': [Marker.CYLINDER] * 6, 'pistons': [Marker.CYLINDER] * 6,
        'singularity': [Marker.TEXT_VIEW_FACING]}
    assert [by_name(message)['names', n].text for n in range(6)] == list(joints)


def test_a_message_does_not_depend_on_the_one_before() -> None:
    writer, step = Markers(HEXAPOD), Step(HEXAPOD)
    first = [written(writer, step, to) for to in (HOME, NEAR, SINGULAR)]
    assert [written(writer, step, to) for to in (SINGULAR, NEAR, HOME)] == first[::-1]


@pytest.mark.parametrize('rate, seconds', [
    (1e9, 2.0), (30.0, 2.0), (1.0, 2.0), (0.5, 4.0), (0.001, 2000.0), (5e-324, 86400.0)])
def test_markers_of_a_silent_node_vanish_but_not_before_the_next_are_due(
        rate: float, seconds: float) -> None:
    for marker in picture(HEXAPOD.replaced({'visualization_rate': rate}), HOME).values():
        assert nanoseconds(marker.lifetime) == seconds * 1e9


# The geometry

@pytest.mark.parametrize('parameters, to', CASES)
def test_legs_are_drawn_from_joint_to_joint(parameters: Parameters, to: Batch) -> None:
    drawn, pose = picture(parameters, to), pose_of(to)
    tolerance = 1e-13 * (size_of(parameters) + float(np.abs(pose.position).max()))
    lengths = StewartPlatform(parameters).inverse_kinematics(pose)
    shortest = parameters['limits.length_min']
    for n, (base, platform) in enumerate(zip(*joints_of(parameters, to), strict=True)):
        piston, cylinder = drawn['pistons', n], drawn['cylinders', n]
        assert piston.scale.z == lengths[n]
        found = axis_ends(piston)
        # A cylinder may stand on either end.
        found = found if np.linalg.norm(found[0] - base) < np.linalg.norm(
            found[1] - base) else found[::-1]
        assert np.allclose(found, [base, platform], rtol=0.0, atol=tolerance)

        of_cylinder = axis_ends(cylinder)
        begin, end = sorted(of_cylinder, key=lambda point: float(
            np.linalg.norm(point - base)))  # noqa: B023
        assert np.allclose(begin, base, rtol=0.0, atol=tolerance)
        share = cylinder.scale.z / lengths[n]
        assert np.allclose(end, base + share * (platform - base), rtol=0.0, atol=tolerance)
        if shortest is None:
            assert share == pytest.approx(0.5)
        else:
            assert cylinder.scale.z == min(0.9 * shortest[n], lengths[n])
        assert cylinder.scale.x == cylinder.scale.y > piston.scale.x == piston.scale.y > 0.0


@pytest.mark.parametrize('parameters, to', CASES)
def test_plates_and_balls_are_at_the_joints(parameters: Parameters, to: Batch) -> None:
    drawn = picture(parameters, to)
    for name, joints in zip(('base', 'platform'), joints_of(parameters, to), strict=True):
        assert np.allclose(points(drawn[name, 1]), joints, rtol=0.0,
                           atol=1e-13 * (size_of(parameters) + np.abs(joints).max()))
        triangles = points(drawn[name, 0]).reshape(-1, 3, 3)
        # Each joint has a corner above it and one below it, at half the thickness.
        corners = np.unique(triangles.reshape(-1, 3).round(9), axis=0)
        distances = np.linalg.norm(corners[:, None] - joints, axis=-1)
        half = distances.min()
        assert np.all(np.sum(distances < 1.000001 * half + 2e-9, axis=0) >= 2)
        # Seen from outside they turn counterclockwise: the volume within is positive, and it
        # is closed: the areas add up to nothing.
        center = triangles.mean(axis=(0, 1))
        a, b, c = np.moveaxis(triangles - center, 1, 0)
        volume = np.sum(np.cross(a, b) * c) / 6.0
        areas = 0.5 * np.cross(b - a, c - a)
        assert volume > 0.0
        assert np.allclose(areas.sum(axis=0), 0.0, atol=1e-12 * np.abs(areas).sum())


def test_plates_have_their_outlines() -> None:
    outline = np.array([[1.0, 1.0, 0.1], [-1.0, 1.0, 0.1], [-2.0, -1.0, 0.1], [1.0, -1.0, 0.1]])
    drawn = picture(HEXAPOD.replaced({
        'geometry.base_outline': outline, 'geometry.platform_outline': 0.5 * outline}), HOME)
    for name, corners in (('base', outline), ('platform', 0.5 * outline + HOME.motions[0, :3])):
        at = points(drawn[name, 0])
        assert len(at) == 12 * len(corners)
        distances = np.linalg.norm((at[:, None] - corners)[..., :2], axis=-1)
        assert (np.isclose(distances, 0.0, atol=1e-12).sum(axis=0) >= 2).all()
        assert at.mean(axis=0)[2] == pytest.approx(corners[0, 2])


def test_the_platforms_axes_are_those_of_its_frame() -> None:
    axes = points(picture(HEXAPOD, SINGULAR)['platform', 2]).reshape(3, 2, 3)
    assert np.allclose(axes[:, 0], SINGULAR.motions[0, :3])
    directions = axes[:, 1] - axes[:, 0]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    assert np.allclose(directions, QUARTER_TURN.T, atol=1e-15)


def test_the_centre_of_mass_is_drawn_in_the_platform() -> None:
    parameters = HEXAPOD.replaced({'platform.center_of_mass': [0.1, -0.2, 0.3]})
    for to in (HOME, NEAR, SINGULAR):
        pose, ball = pose_of(to), picture(parameters, to)['platform', 3]
        assert np.allclose(points(ball), [pose.position + pose.rotation @ [0.1, -0.2, 0.3]],
                           rtol=0.0, atol=1e-13)
        assert color(ball) not in map(color, (
            picture(parameters, to)['platform', n] for n in range(3)))


def test_the_text_stands_above_the_platform() -> None:
    drawn = picture(HEXAPOD, NEAR)
    where = drawn['singularity', 0].pose.position
    assert [where.x, where.y] == NEAR.motions[0, :2].tolist()
    assert where.z > max(points(drawn['platform', 0])[:, 2].max(),
                         points(drawn['platform', 2])[:, 2].max())


# The colours

def _leg_colors(parameters: Parameters, forces: Any) -> list[tuple[float, ...]]:
    drawn = picture(parameters, HOME, forces)
    for n in range(6):
        assert color(drawn['cylinders', n]) == color(drawn['pistons', n])
    return [color(drawn['pistons', n]) for n in range(6)]


def test_legs_are_coloured_by_force_over_limit() -> None:
    parameters = HEXAPOD.replaced({'limits.force_max': [100.0, 200.0, 300.0, 400.0, 500.0, 600.0]})
    none, half, push, pull, little, zero = _leg_colors(
        parameters, (1e-9, 100.0, 300.0, -400.0, -5.0, -0.0))
    assert none == zero == shade(module.NO_LOAD)
    assert push == shade(module.PUSH)
    assert pull == shade(module.PULL)
    assert half == shade(tuple(np.mean([module.NO_LOAD, module.PUSH], axis=0)))
    assert little == shade(tuple(
        0.99 * np.array(module.NO_LOAD) + 0.01 * np.array(module.PULL)))


def test_without_a_limit_the_largest_force_has_the_full_colour() -> None:
    parameters = Parameters({name: value for name, value in HEXAPOD.given.items()
                             if name != 'limits.force_max'})
    colors = _leg_colors(parameters, (1.0, 0.0, -2.0, 1.0, -1.0, 0.5))
    assert colors[2] == shade(module.PULL)
    assert colors[0] == colors[3] == shade(tuple(
        np.mean([module.NO_LOAD, module.PUSH], axis=0)))
    assert _leg_colors(parameters, (0.0,) * 6) == [shade(module.NO_LOAD)] * 6
    outputs = Step(parameters)(HOME)
    assert outputs.with_efforts[0]
    text = picture(parameters, HOME)['singularity', 0].text
    assert f'saturated at {np.abs(outputs.efforts).max():.4g} N' in text


def test_legs_without_forces_are_grey() -> None:
    assert _leg_colors(HEXAPOD, math.nan) == [shade(module.NO_FORCE)] * 6
    assert 'colour' not in picture(HEXAPOD, SINGULAR)['singularity', 0].text


# How a colour in linear red, green and blue is seen without the cones for red, green or blue:
# G. M. Machado et al., IEEE Trans. Visualization and Computer Graphics 15(6), 2009, table 1.
SEEN = {
    'protanopia': [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                   [-0.003882, -0.048116, 1.051998]],
    'deuteranopia': [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                     [-0.011820, 0.042940, 0.968881]],
    'tritanopia': [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                   [0.004733, 0.691367, 0.303900]],
    'all cones': np.eye(3).tolist()}


@pytest.mark.parametrize('sight', SEEN)
def test_colours_are_distinct_for_the_colour_blind(sight: str) -> None:
    legs = [module.PUSH, module.PULL, module.NO_LOAD, module.NO_FORCE]
    for colors in (legs, list(module.PLATFORM.values())):
        linear = np.array(colors)[:, :3] ** 2.2
        seen = np.clip(linear @ np.array(SEEN[sight]).T, 0.0, 1.0) ** (1.0 / 2.2)
        for n, first in enumerate(seen):
            for second in seen[n + 1:]:
                assert np.linalg.norm(first - second) > 0.25


# The state of the singularity

def test_the_platform_and_the_text_show_the_singularity() -> None:
    suppressing = HEXAPOD.replaced({'singularity.action': 'suppress_forces',
                                    'singularity.stop_condition': 25.0})
    for parameters, to, level, words in (
            (HEXAPOD, HOME, OK, ''), (HEXAPOD, NEAR, WARN, 'condition number '),
            (suppressing, NEAR, ERROR, 'inside stop_condition: forces suppressed'),
            (HEXAPOD, SINGULAR, ERROR, 'J_inv cannot be solved: no forces')):
        drawn, outputs = picture(parameters, to), Step(parameters)(to)
        assert color(drawn['platform', 0]) == shade(module.PLATFORM[level])
        lines = drawn['singularity', 0].text.split('\n')
        assert lines[0].startswith(words or 'det(J)')
        assert (f'det(J) {outputs.determinants[0]:.4g} m^3, '
                f'condition number {outputs.conditions[0]:.4g}') in lines


def test_the_text_names_legs_that_exceed_their_limits() -> None:
    parameters = HEXAPOD.replaced({'limits.length_max': [1.65, 1.0, 1.65, 1.65, 1.65, 1.0]})
    text = picture(parameters, HOME)['singularity', 0].text
    assert 'limits exceeded: leg_2, leg_6' in text.split('\n')
    assert 'limits' not in picture(HEXAPOD, HOME)['singularity', 0].text
    different = HEXAPOD.replaced({'limits.force_max': [6000.0] * 5 + [5000.0]})
    assert 'saturated at limits.force_max' in picture(different, HOME)['singularity', 0].text


def test_for_any_answer_markers_have_only_finite_numbers() -> None:
    random = rng()
    step, writer = Step(symmetric_parameters()), Markers(symmetric_parameters())
    drawn = 0
    for exponent in np.linspace(-300.0, 300.0, 61):
        position = tuple((10.0 ** exponent * random.uniform(-1.0, 1.0, 3)).tolist())
        to = setpoint(position)
        if not step(to).answered[0]:
            continue
        drawn += 1
        message = deserialize_message(written(writer, step, to), MarkerArray)
        for marker in message.markers:
            pose, scale = marker.pose, marker.scale
            assert np.all(np.isfinite([
                pose.position.x, pose.position.y, pose.position.z, scale.x, scale.y, scale.z,
                pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w,
                *color(marker)]))
    assert drawn > 20


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('size', [1e-150, 1e-20, 1e20, 1e150, 1e160, 1e307])
@pytest.mark.parametrize('joints', [
    HEXAPOD['geometry.base_joints'], np.zeros((6, 3)), np.outer(np.arange(6.0), [1.0, 2.0, 3.0])],
    ids=['as they are', 'one point', 'a line'])
def test_a_hexapod_of_any_geometry_is_drawn(joints: Array, size: float) -> None:
    with np.errstate(all='ignore'):
        parameters = HEXAPOD.replaced({
            'geometry.base_joints': size * joints,
            'geometry.platform_joints': size * HEXAPOD['geometry.platform_joints']})
    Markers(parameters)


# The node

def _look(node: DynamicsNode) -> list[Any]:
    """Return a list that gets all markers."""
    seen: list[Any] = []
    node.peer.node.create_subscription(
        MarkerArray, f'{NODE}/markers', seen.append, QoSProfile(depth=100))
    return seen


def _stamps(pictures: list[Any]) -> list[int]:
    return [nanoseconds(message.markers[0].header.stamp) for message in pictures]


def _seen(node: DynamicsNode) -> list[Any]:
    """Return a list as ``_look`` does, once the node has matched the subscriber."""
    pictures = _look(node)

    def found() -> bool:
        node.answer()
        return bool(pictures)

    node.until(found, 'the node draws')
    return pictures


def test_markers_show_the_answer(node: DynamicsNode) -> None:
    seen = _seen(node)
    sample = Sample((0.1, -0.05, 1.15), (0.1, -0.05, 0.2, math.sqrt(1 - 0.0525)),
                    (0.1, -0.05, 0.08, 0.2, -0.1, 0.15), (0.5, 0.4, -0.6, 0.3, 0.7, -0.2))
    stamp = node.stamp() + 10 * SECOND  # time for the legs to move there
    node.answer(sample, stamp=stamp)
    node.until(lambda: stamp in _stamps(seen), 'it is drawn')
    expected = written(
        Markers(HEXAPOD), Step(HEXAPOD), Batch.from_parts(stamp, sample.motion().rows))
    assert seen[_stamps(seen).index(stamp)] == deserialize_message(expected, MarkerArray)


def test_the_last_answer_is_drawn_though_no_other_comes(fresh: Start) -> None:
    node = fresh('visualization_rate:=2.0')
    node.until_active()
    seen = _seen(node)
    for _ in range(5):
        node.answer()
    stamp = node.stamp()
    node.answer(stamp=stamp)
    node.until(lambda: _stamps(seen)[-1] == stamp, 'the last one is drawn')
    assert len(set(_stamps(seen))) == len(seen) < len(node.received('leg_states'))


def test_no_answer_is_drawn_twice_at_whatever_rate(fresh: Start) -> None:
    node = fresh('visualization_rate:=1000000.0')
    node.until_active()
    seen = _seen(node)
    for _ in range(50):
        node.answer()
    answered = [nanoseconds(state.header.stamp) for state in node.received('leg_states')]
    node.until(lambda: _stamps(seen)[-1] == answered[-1], 'each is drawn')
    assert _stamps(seen) == answered[-len(seen):]
    assert len(seen) > 50


def test_a_later_subscriber_gets_no_earlier_markers(fresh: Start) -> None:
    node = fresh()
    node.until_active()
    before = node.stamp()
    node.answer(stamp=before)
    # Behind the answer it looks for subscribers of its markers: it is done when this is answered.
    assert node.state == 'active'
    seen = _seen(node)
    assert before not in _stamps(seen)


def test_a_payload_and_thresholds_change_the_markers_while_active(node: DynamicsNode) -> None:
    seen = _seen(node)
    changes = {'platform.center_of_mass': [0.05, -0.04, 0.25], 'singularity.warn_condition': 1.5}
    assert node.set_parameters(**{
        name.replace('.', '__'): value for name, value in changes.items()}).successful
    stamp = node.stamp()
    node.send(stamp=stamp)
    node.state_of(stamp)
    node.until(lambda: stamp in _stamps(seen), 'it is drawn')
    drawn = by_name(seen[_stamps(seen).index(stamp)])
    assert np.allclose(points(drawn['platform', 3]), [[0.05, -0.04, 1.35]], rtol=0.0, atol=1e-13)
    assert 'singularity.warn_condition, 1.5' in drawn['singularity', 0].text
