# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Hexapods with cranks as other tools write them: loops, frames and bodies that CAD leaves."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

from legs_of_all_kinds import random_hexapod
import numpy as np
from programs import call
import pytest
from referees import ROOT, rotation_about
from snapshot import Snapshot
from stewart_dynamics import Parameters, StewartError, StewartPlatform
from stewart_dynamics.description import main
from stewart_dynamics.description.formats import read_hexapod
from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.description.mjcf import mjcf
from stewart_dynamics.description.recognition import Recognized
from stewart_dynamics.description.sdf import sdf
from stewart_dynamics.description.urdf import urdf
from stewart_dynamics.mechanics.frames.rotation import to_euler, to_quaternion
from test_reading import foreign

PROGRAM = 'stewart_describe'
RIG = Parameters.from_yaml(ROOT / 'config' / 'crank_platform.yaml')
GEOMETRY = ('geometry.base_joints', 'geometry.platform_joints', 'geometry.crank_axes',
            'geometry.crank_directions', 'legs.crank.length', 'legs.rod.length')
MASSES = ('platform.mass', 'platform.center_of_mass', 'platform.inertia', 'legs.crank.mass',
          'legs.rod.mass')
LIMITS = ('limits.angle_min', 'limits.angle_max', 'limits.torque_max')
SVG = '{http://www.w3.org/2000/svg}'


def read(text: str, path: Path) -> Recognized:
    path.write_text(text, encoding='utf-8')
    return read_hexapod(path)


def assert_equal(found: Parameters, p: Parameters, names: tuple[str, ...]) -> None:
    for name in names:
        assert found[name] == pytest.approx(p[name], rel=1e-9, abs=1e-9), name


def with_named_frames(p: Parameters) -> str:
    """Return a URDF whose loops are in the names of its frames, as onshape-to-robot writes it."""
    text = foreign(urdf(Hexapod(p), 'hexapod'))
    for n, leg in enumerate(p.joints, 1):
        for frame, end in ((f'{leg}_tip', 1), (f'{leg}_platform_joint', 2)):
            text = text.replace(f'"{frame}"', f'"closing_{n}_{end}"')
    return text


def test_a_revolute_joint_of_an_sdf_without_an_axis_turns_about_z(tmp_path: Path) -> None:
    root = ET.fromstring(sdf(Hexapod(RIG), 'hexapod'))
    for joint in root.iter('joint'):
        for axis in joint.findall('axis'):
            joint.remove(axis)
    found = read(ET.tostring(root, encoding='unicode'), tmp_path / 'x.sdf').parameters
    assert_equal(found, RIG, GEOMETRY + MASSES)
    assert all(found[name] is None for name in LIMITS)


@pytest.mark.parametrize('seed', range(3))
def test_frames_named_by_onshape_to_robot_close_the_loops(seed: int, tmp_path: Path) -> None:
    p, _ = random_hexapod('crank', seed, 0)
    found = read(with_named_frames(p), tmp_path / 'x.urdf')
    assert_equal(found.parameters, p, GEOMETRY + MASSES)
    assert 'closing_3_1 to closing_3_2: frames with names of onshape-to-robot' in '\n'.join(
        found.remarks)
    assert found.parameters['geometry.crank_branch'] in (p['geometry.crank_branch'], ('auto',))


def test_a_tree_in_which_one_rod_carries_the_platform_is_read(tmp_path: Path) -> None:
    """As CAD programs write it: balls as three hinges, four loops by names of frames."""
    root = ET.fromstring(with_named_frames(RIG))
    hexapod = Hexapod(RIG)
    drop = {'closing_6_1', 'closing_6_2'}
    for joint in root.findall('joint'):
        child = joint.find('child').get('link')
        if joint.get('name').startswith('platform_') or child in drop:
            root.remove(joint)
    for link in root.findall('link'):
        if link.get('name') in drop or link.get('name').startswith('platform_'):
            root.remove(link)
    leg = hexapod.legs[5]
    # The platform is turned back as at home, where its axes are those of the base.
    turn = np.linalg.multi_dot([link.at_zero.rotation for link in leg.branch.links]).T
    links = [f'ball_{axis}' for axis in 'xyz'] + ['platform']
    for name in links[:3]:
        ET.SubElement(root, 'link', {'name': name})
    first = ET.SubElement(root, 'joint', {'name': 'to_ball', 'type': 'fixed'})
    ET.SubElement(first, 'parent', {'link': leg.last})
    ET.SubElement(first, 'child', {'link': links[0]})
    ET.SubElement(first, 'origin', {
        'xyz': ' '.join(map(repr, leg.branch.end.tolist())),
        'rpy': ' '.join(map(repr, to_euler(turn).tolist()))})
    for axis, parent, child in zip(('1 0 0', '0 1 0', '0 0 1'), links, links[1:], strict=False):
        joint = ET.SubElement(root, 'joint', {'name': f'{child}_joint', 'type': 'continuous'})
        ET.SubElement(joint, 'parent', {'link': parent})
        ET.SubElement(joint, 'child', {'link': child})
        ET.SubElement(joint, 'axis', {'xyz': axis})
        if child == 'platform':
            at = -RIG['geometry.platform_joints'][5]
            mount = ET.SubElement(root, 'link', {'name': 'mount'})
            joint.find('child').set('link', mount.get('name'))
            fixed = ET.SubElement(root, 'joint', {'name': 'mounted', 'type': 'fixed'})
            ET.SubElement(fixed, 'parent', {'link': 'mount'})
            ET.SubElement(fixed, 'child', {'link': 'platform'})
            ET.SubElement(fixed, 'origin', {'xyz': ' '.join(map(repr, at.tolist()))})
    found = read(ET.tostring(root, encoding='unicode'), tmp_path / 'x.urdf').parameters
    assert found['base_frame'] == 'base'
    # The first link with the joints is the frame of the platform: they are moved against it.
    shift = found['geometry.platform_joints'] - RIG['geometry.platform_joints']
    assert np.abs(shift - shift[0]).max() < 1e-9
    assert_equal(found, RIG, tuple(each for each in GEOMETRY if 'platform' not in each))
    assert found['platform.mass'] == RIG['platform.mass']
    moved = RIG['platform.center_of_mass'] + shift[0]
    assert found['platform.center_of_mass'] == pytest.approx(moved, abs=1e-9)


def test_a_body_that_moves_on_the_platform_is_a_part_of_it(tmp_path: Path) -> None:
    """As the antennas of a robot's head, on hinges with actuators of their own."""
    pytest.importorskip('mujoco')
    root = ET.fromstring(foreign(mjcf(Hexapod(RIG), 'hexapod')))
    platform = next(body for body in root.iter('body') if body.get('name') == 'platform')
    antenna = ET.SubElement(platform, 'body', {'name': 'antenna', 'pos': '0.1 0 0.5'})
    ET.SubElement(antenna, 'joint', {'name': 'wave', 'type': 'hinge', 'axis': '0 1 0'})
    ET.SubElement(antenna, 'inertial', {
        'pos': '0 0 0.2', 'mass': '40', 'diaginertia': '2 2 2'})
    ET.SubElement(root.find('actuator'), 'motor', {'name': 'waver', 'joint': 'wave'})
    found = read(ET.tostring(root, encoding='unicode'), tmp_path / 'x.xml')
    p = found.parameters
    assert p['platform.mass'] == pytest.approx(200.0)
    at = (160.0 * RIG['platform.center_of_mass'] + 40.0 * np.array([0.1, 0.0, 0.7])) / 200.0
    assert p['platform.center_of_mass'] == pytest.approx(at)
    assert_equal(p, RIG, GEOMETRY + LIMITS)
    assert 'antenna: moves against the platform in the file: taken as fixed to it where it is' in (
        found.remarks)
    assert "wave: actuator 'waver' is left out" in found.remarks


def test_an_inclined_frame_of_a_level_platform_is_replaced(
        tmp_path: Path, snapshot: Snapshot) -> None:
    """Home has parallel axes: with the frame of a part of the head no home pose would be found."""
    pytest.importorskip('mujoco')
    root = ET.fromstring(foreign(mjcf(Hexapod(RIG), 'hexapod')))
    platform = next(body for body in root.iter('body') if body.get('name') == 'platform')
    turn = rotation_about([1.0, 0.0, 0.0], 1.9) @ rotation_about([0.0, 0.0, 1.0], 0.7)
    x, y, z, w = to_quaternion(turn).tolist()
    platform.set('quat', f'{w!r} {x!r} {y!r} {z!r}')
    found = read(ET.tostring(root, encoding='unicode'), tmp_path / 'x.xml')
    p = found.parameters
    assert p['platform_frame'] == 'platform_level'
    center = RIG['geometry.platform_joints'].mean(axis=0)
    assert p['geometry.platform_joints'] == pytest.approx(
        RIG['geometry.platform_joints'] - center, abs=1e-9)
    assert p['platform.center_of_mass'] == pytest.approx(
        turn @ RIG['platform.center_of_mass'] - center, abs=1e-9)
    assert StewartPlatform(p).inverse_kinematics(
        StewartPlatform(p).home_pose()) == pytest.approx(np.zeros(6), abs=1e-9)
    snapshot(next(each for each in found.remarks if each.startswith('platform_frame')))


@pytest.mark.parametrize('content', [None, b'version https://git-lfs.github.com/spec/v1\n'])
def test_meshes_that_cannot_be_read_keep_no_mjcf_with_masses_from_being_read(
        content: bytes | None, tmp_path: Path) -> None:
    pytest.importorskip('mujoco')
    p = RIG.replaced({'meshes.platform': 'top.stl'})
    if content is not None:
        (tmp_path / 'top.stl').write_bytes(content)
    found = read(mjcf(Hexapod(p), 'hexapod'), tmp_path / 'x.xml')
    assert_equal(found.parameters, RIG, GEOMETRY + MASSES + LIMITS)
    assert any(each.startswith('meshes are left out, all bodies have masses: ')
               and 'top.stl' in each for each in found.remarks)


def test_a_body_whose_mass_is_that_of_a_missing_mesh_is_rejected(tmp_path: Path) -> None:
    pytest.importorskip('mujoco')
    root = ET.fromstring(mjcf(Hexapod(RIG.replaced({'meshes.platform': 'top.stl'})), 'hexapod'))
    platform = next(body for body in root.iter('body') if body.get('name') == 'platform')
    platform.remove(platform.find('inertial'))
    with pytest.raises(StewartError, match='top.stl'):
        read(ET.tostring(root, encoding='unicode'), tmp_path / 'x.xml')


@pytest.mark.parametrize(('axes', 'toward'), [('1 0 0 0', 'dot'), ('mirrored', 'cross')])
def test_the_picture_shows_the_direction_of_positive_angles(
        axes: str, toward: str, tmp_path: Path) -> None:
    given = RIG
    if axes == 'mirrored':  # motors that turn the other way
        given = RIG.replaced({
            'geometry.crank_angles': None, 'geometry.crank_axes': -RIG['geometry.crank_axes'],
            'geometry.crank_directions': RIG['geometry.crank_directions']})
    path = tmp_path / 'rig.yaml'
    given.to_yaml(path)
    call(main, '--params', path, '--output', tmp_path)
    tree = ET.parse(tmp_path / 'rig.svg')
    circles = list(tree.iter(f'{SVG}circle'))
    rings = [each for each in circles if each.get('r') == '5.0']
    dots = [each for each in circles if each.get('r') == '2.0']
    assert (len(rings), len(dots)) == (6, 6 if toward == 'dot' else 0)
    # From the front, all arrows point up, or down.
    heads = [[float(number) for number in each.get('points').split()[0].split(',')]
             for each in tree.iter(f'{SVG}polygon') if each.get('fill-opacity') is None]
    ends = [float(each.get('y1')) for each in tree.iter(f'{SVG}line')
            if each.get('stroke-width') == '1.5']
    assert len(heads) == len(ends) == 6
    assert all((head[1] < end) == (toward == 'dot')
               for head, end in zip(heads, ends, strict=True))
    texts = [each.text or '' for each in tree.iter(f'{SVG}text')]
    assert 'angle at home [rad]' in texts
    assert any(text.startswith('Discs') and 'growing angle' in text for text in texts)
    # A line of 900 px is cut off where it is longer.
    assert max(map(len, texts)) < 120
