# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Hexapods in files of other tools: parameters, remarks and rejections."""

from contextlib import suppress
import cProfile
import itertools
import math
import os
import pstats
import re
import shutil
import subprocess
import sys
from xml.etree import ElementTree as ET

from legs_of_all_kinds import random_hexapod
import numpy as np
import pytest
from referees import random_parameters, rng, ROOT
from stewart_dynamics import Motion, Parameters, StewartError, StewartPlatform
from stewart_dynamics.description import bounded_process as loading
from stewart_dynamics.description.formats import read_hexapod, WRITERS
from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.description.loops import loops_name, loops_yaml
from stewart_dynamics.description.sdf import sdf, upright
from stewart_dynamics.mechanics.frames.rotation import from_euler, to_euler, to_quaternion
from stewart_dynamics.parameters.circles import CIRCLE_NAMES

PROGRAM = 'stewart_describe'

PLATFORM = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
CRANKS = Parameters.from_yaml(ROOT / 'config' / 'crank_platform.yaml')
EXACT = 1e-12
READ_BY = {'xml': 'mujoco', 'usda': 'pxr'}
# Parameters that all formats have elements for.
OF_FORMATS = ('geometry.base_joints', 'geometry.platform_joints', 'platform.inertia',
              'platform.mass', 'legs.piston.mass', 'legs.piston.center_of_mass',
              'limits.length_min', 'limits.length_max', 'limits.velocity_max', 'limits.force_max',
              'actuator.viscous_friction', 'actuator.coulomb_friction')


def machines():
    """Yield hexapods of all kinds, those without mass in their legs and in a world frame too."""
    yield PLATFORM
    for seed in range(3):
        yield random_parameters(rng(seed))
    given = random_parameters(rng(5)).given
    yield Parameters({**{name: value for name, value in given.items()
                         if not name.startswith('legs.')}, 'base_frame': 'world'})
    yield CRANKS
    yield CRANKS.replaced({'legs.crank.mass': 0.0, 'legs.rod.mass': 0.0, 'legs.crank.inertia': 0.0,
                           'limits.angle_max': None, 'limits.torque_max': None})
    for seed in range(2):
        yield random_hexapod('crank', seed, 0)[0]


def written(p, kind, folder, change=lambda text: text):
    """Return the file of a hexapod; MJCF and USD are read by packages, where these are there."""
    if kind in READ_BY:
        pytest.importorskip(READ_BY[kind])
    path = folder / f'hexapod.{kind}'
    path.write_text(change(WRITERS[kind](Hexapod(p), 'hexapod')), encoding='utf-8')
    if kind == 'urdf' and change is foreign:  # whose loops are beside it
        (folder / loops_name('hexapod')).write_text(loops_yaml(Hexapod(p), 'hexapod'))
    return path


def foreign(text):
    """Return a document without what stewart_describe has added to its format."""
    if text.startswith('#usda'):
        return '\n'.join(line for line in text.splitlines() if 'stewart_dynamics:' not in line)
    root = ET.fromstring(text)
    for parent in [*root.iter()]:
        for child in [*parent]:
            if child.tag.endswith('}parameter') or child.tag in ('stewart_dynamics', 'custom'):
                parent.remove(child)
    return ET.tostring(root, encoding='unicode')


@pytest.mark.parametrize('kind', WRITERS)
@pytest.mark.parametrize('machine', range(9))
def test_written_files_read_back_with_the_same_numbers(kind, machine, tmp_path):
    p = [*machines()][machine]
    read = read_hexapod(written(p, kind, tmp_path)).parameters
    for name, value in p.items():
        if name in CIRCLE_NAMES:
            continue  # joints are read as points
        if isinstance(value, np.ndarray) and not name.startswith(('meshes.', 'singularity.')):
            assert read[name] == pytest.approx(value, rel=EXACT, abs=EXACT), name
        elif name in ('base_frame', 'platform_frame', 'joints', 'platform.mass'):
            assert read[name] == value
        elif name.startswith(('limits.', 'geometry.crank_branch')):
            assert read[name] == value, name


@pytest.mark.parametrize('kind', ['sdf', 'xml'])
def test_closed_files_of_others_are_read_by_how_bodies_are_connected(kind, tmp_path, snapshot):
    p = PLATFORM
    found = read_hexapod(written(p, kind, tmp_path, foreign))
    for name in ('geometry.base_joints', 'geometry.platform_joints', 'platform.inertia',
                 'legs.piston.center_of_mass', 'limits.force_max', 'actuator.viscous_friction'):
        assert found.parameters[name] == pytest.approx(p[name], rel=1e-6, abs=1e-12), name
    said = '\n'.join(found.remarks)
    if kind == 'sdf':  # which counts positions from the file's own
        snapshot(said)
        assert found.parameters['geometry.zero_length'] == pytest.approx(1.3, abs=1e-4)
    else:
        snapshot(said)


@pytest.mark.parametrize('kind', WRITERS)
@pytest.mark.parametrize('change', [lambda text: text, foreign], ids=['own', 'foreign'])
def test_a_hanging_hexapod_keeps_its_side_in_every_format(kind, change, tmp_path):
    p = PLATFORM.replaced({
        'geometry.platform_side': 'negative', 'platform.center_of_mass': [0.02, -0.01, -0.12]})
    assert Hexapod(p).position[2] < -1.0
    found = read_hexapod(written(p, kind, tmp_path, change)).parameters
    assert StewartPlatform(found).home_pose().position == pytest.approx(
        StewartPlatform(p).home_pose().position, abs=1e-6)
    for name in ('geometry.base_joints', 'geometry.platform_joints', 'gravity',
                 'platform.center_of_mass', 'legs.cylinder.center_of_mass'):
        assert found[name] == pytest.approx(p[name], abs=1e-6), name


@pytest.mark.parametrize('kind', WRITERS)
@pytest.mark.parametrize('change', [lambda text: text, foreign], ids=['own', 'foreign'])
@pytest.mark.parametrize('height', [-0.06, -0.4, 0.4])
@pytest.mark.parametrize('side', ['auto', 'positive', 'negative'])
def test_the_side_does_not_depend_on_the_frame_of_the_platform(
        side, height, change, kind, tmp_path):
    """The loops of a URDF are open: its platform is at the origin of the base there."""
    joints = PLATFORM['geometry.platform_joints'] + [0.0, 0.0, height]
    p = PLATFORM.replaced({'geometry.platform_joints': joints, 'geometry.platform_side': side})
    found = read_hexapod(written(p, kind, tmp_path, change)).parameters
    assert StewartPlatform(found).home_pose().position == pytest.approx(
        StewartPlatform(p).home_pose().position, abs=1e-6)


MASSLESS = PLATFORM.replaced({'legs.piston.mass': 0.0, 'legs.piston.inertia': 0.0,
                              'geometry.zero_length': 1.3,
                              'limits.force_max': None, 'limits.length_max': None})
MASS_OF = {'sdf': r'(<link name="{}">.*?<mass>)[^<]*(<)',
           'xml': r'(<body name="{}".*?<inertial [^>]* mass=")[^"]*(")',
           'urdf': r'(<link name="{}">.*?<mass value=")[^"]*(")',
           'usda': r'(def Xform "{}".*?float physics:mass = )\S*(\n)'}


def edited(pattern, value):
    """Return an edit of the first place of a pattern with two groups around a value."""
    def change(text):
        new, count = re.subn(pattern, rf'\g<1>{value}\g<2>', text, count=1, flags=re.DOTALL)
        assert count == 1
        return new

    return change


def check_all_else_stays(before, after, *names):
    """Compare all arrays of two sets of parameters but those named."""
    for name, value in before.items():
        if name not in names and isinstance(value, np.ndarray):
            assert after[name] == pytest.approx(value, rel=EXACT, abs=EXACT), name


@pytest.mark.parametrize('p', [PLATFORM, MASSLESS], ids=['full', 'massless'])
@pytest.mark.parametrize('kind', WRITERS)
def test_an_edited_mass_of_the_platform_is_read_and_all_else_stays(kind, p, tmp_path):
    """Legs without mass have a part of the platform's: it is read as zero as it was written."""
    change = edited(MASS_OF[kind].format('platform'), '250.0')
    found = read_hexapod(written(p, kind, tmp_path, change))
    assert found.parameters['platform.mass'] == 250.0
    check_all_else_stays(p, found.parameters)
    # USD carries all numbers, because its own are single-precision.
    assert [each for each in found.remarks if 'edited' in each] == (
        [each for each in found.remarks if each.startswith('platform.mass: edited in the file')])
    assert any('edited' in each for each in found.remarks) == (kind == 'usda')


@pytest.mark.parametrize('p', [PLATFORM, MASSLESS], ids=['full', 'massless'])
@pytest.mark.parametrize('kind', ['sdf', 'xml', 'usda'])
def test_an_edited_mass_of_a_leg_is_read_and_those_of_the_others_stay(
        kind, p, tmp_path, snapshot):
    change = edited(MASS_OF[kind].format('leg_2_piston'), '2.0')
    found = read_hexapod(written(p, kind, tmp_path, change))
    masses = p['legs.piston.mass'].copy()
    masses[1] = 2.0
    assert np.array_equal(found.parameters['legs.piston.mass'], masses)
    check_all_else_stays(p, found.parameters, 'legs.piston.mass')
    if p is MASSLESS:
        snapshot('\n'.join(found.remarks))


@pytest.mark.parametrize(('kind', 'pattern', 'value', 'name', 'expected'), [
    ('sdf', r'(</lower>)()', '<upper>0.2</upper>', 'limits.length_max', 1.5),
    ('sdf', r'(<limit>)()', '<effort>400</effort>', 'limits.force_max', 400.0),
    ('xml', r'(joint="leg_\d")()', ' ctrlrange="-400 400"', 'limits.force_max', 400.0),
    ('xml', r'(<motor name="leg_\d")()', ' forcerange="-400 400"', 'limits.force_max', 400.0),
    ('xml', r'(range="-[^ "]* )[^" ]*(")', '0.5', 'limits.length_max', 1.8),
    ('usda', r'(physics:axis = "Z")(\n)', '\n float physics:upperLimit = 0.4',
     'limits.length_max', 1.7),
    ('usda', r'(float drive:linear:physics:damping = \S*)(\n)',
     '\n float drive:linear:physics:maxForce = 400', 'limits.force_max', 400.0),
    ('urdf', r'(effort=")1000000000.0(")', '400', 'limits.force_max', 400.0),
    ('urdf', r'(upper=")11[^"]*(" velocity="0.5")', '0.5', 'limits.length_max', 1.8)])
def test_a_limit_that_is_added_to_a_file_without_it_is_read(
        kind, pattern, value, name, expected, tmp_path):
    """A limit that is not set is carried as such, and does not hide a limit that is added."""
    p = MASSLESS

    def change(text):
        new, count = re.subn(pattern, rf'\g<1>{value}\g<2>', text)
        assert count == 6
        return new

    found = read_hexapod(written(p, kind, tmp_path, change)).parameters
    assert found[name] is expected or found[name] == pytest.approx([expected] * 6, abs=1e-4)
    others = {'limits.force_max', 'limits.length_max'} - {name}
    assert all(found[other] is None for other in others)
    check_all_else_stays(p, found, name)


@pytest.mark.parametrize(('kind', 'pattern'), [
    ('sdf', r'(<(?:lower|upper|effort|velocity)>)[^<]*'),
    ('urdf', r'((?:lower|upper|effort|velocity)=")[^"]*')])
def test_limits_that_are_inf_are_unlimited(kind, pattern, tmp_path):
    """The default of SDFormat is inf since version 1.10."""
    found = read_hexapod(written(PLATFORM, kind, tmp_path, lambda text: re.sub(
        pattern, r'\1inf', text))).parameters
    assert all(found[name] is None for name in PLATFORM.leg_kind.drive_limits)


def quaternion_of(angles):
    """Return a quaternion, which needs no length 1, of the text of three angles."""
    turn = to_quaternion(from_euler([float(each) for each in angles.split()]))
    return ' '.join(repr(float(each)) for each in 3e200 * turn)


def with_quaternions(text):
    """Return a URDF or SDFormat whose rotations are quaternions."""
    root = ET.fromstring(text)
    for origin in root.iter('origin'):
        if origin.get('rpy'):
            origin.set('quat_xyzw', quaternion_of(origin.attrib.pop('rpy')))
    for pose in root.iter('pose'):
        x, y, z, angles = pose.text.split(maxsplit=3)
        pose.set('rotation_format', 'quat_xyzw')
        pose.text = ' '.join([x, y, z, quaternion_of(angles)])
    return ET.tostring(root, encoding='unicode')


def in_degrees(text):
    """Return an SDFormat whose angles are in degrees, said as libsdformat takes it, too."""
    root = ET.fromstring(text)
    for pose in root.iter('pose'):
        x, y, z, *angles = pose.text.split()
        pose.set('degrees', 'True')
        pose.text = ' '.join([x, y, z, *(repr(math.degrees(float(each))) for each in angles)])
    return ET.tostring(root, encoding='unicode')


def with_frames(text):
    """Return an SDFormat whose joints end at frames of links, of joints, and at the model's."""
    root = ET.fromstring(text)
    model = root.find('model')
    ends = {'leg_2_tip': 'frame_2', 'base': '__model__', 'leg_1_cylinder': 'leg_1_universal'}
    for end in (*model.iterfind('joint[@type="ball"]/child'), *model.iterfind('joint/parent')):
        end.text = ends.get(end.text, end.text)
    for name, attached_to in (('frame_2', 'frame_1'), ('frame_1', 'leg_2_tip')):
        ET.SubElement(model, 'frame', {'name': name, 'attached_to': attached_to})
    return ET.tostring(root, encoding='unicode')


@pytest.mark.parametrize(('kind', 'change'), [
    ('urdf', with_quaternions), ('sdf', with_quaternions), ('sdf', with_frames),
    ('sdf', in_degrees)])
@pytest.mark.parametrize('p', [PLATFORM, CRANKS], ids=['telescopic', 'crank'])
def test_quaternions_degrees_and_frames_at_joints_change_nothing(p, kind, change, tmp_path):
    """As in URDF 1.1, and in SDFormat 1.9 and 1.8; libsdformat's own files read the same."""
    (tmp_path / 'own').mkdir()
    own = read_hexapod(written(p, kind, tmp_path / 'own'))
    found = read_hexapod(written(p, kind, tmp_path, change))
    assert found.remarks == own.remarks
    check_all_else_stays(own.parameters, found.parameters)


def test_the_model_of_a_world_with_most_joints_is_read(tmp_path):
    """Worlds that Gazebo saves have models of ground and walls before the hexapod."""
    def in_world(text):
        root = ET.fromstring(text)
        world = ET.Element('world', {'name': 'w'})
        ET.SubElement(ET.SubElement(world, 'model', {'name': 'ground'}), 'link', {'name': 'link'})
        ET.SubElement(world, 'gravity').text = '0 0 -1.62'
        world.append(root.find('model'))
        root.remove(root.find('model'))
        root.append(world)
        return ET.tostring(root, encoding='unicode')

    found = read_hexapod(written(CRANKS, 'sdf', tmp_path, lambda text: in_world(foreign(text))))
    assert found.parameters['gravity'] == pytest.approx([0.0, 0.0, -1.62])
    assert found.parameters['legs.rod.length'] == pytest.approx(CRANKS['legs.rod.length'])


@pytest.mark.parametrize('mass', ['', '<mass>2</mass>'])
def test_inertia_that_engines_compute_from_shapes_is_named(mass, tmp_path, snapshot):
    """As in SDFormat since 1.11; without the attribute a missing mass is 1 kg."""
    found = read_hexapod(written(PLATFORM, 'sdf', tmp_path, lambda text: re.sub(
        '(<link name="leg_2_piston">.*?)<inertial>.*?</inertial>',
        rf'\g<1><inertial auto="true">{mass}</inertial>', foreign(text), flags=re.DOTALL)))
    snapshot('\n'.join(each for each in found.remarks if 'leg_2' in each))
    assert found.parameters['legs.piston.mass'][1] == (2.0 if mass else 0.0)
    assert found.parameters['legs.piston.inertia'][1] == 0.0
    with snapshot.raises(StewartError):
        read_hexapod(written(PLATFORM, 'sdf', tmp_path, lambda text: re.sub(
            '(<link name="platform">.*?)<inertial>.*?</inertial>',
            r'\1<inertial auto="true"><mass>250</mass></inertial>', text, flags=re.DOTALL)))


@pytest.mark.parametrize('kind', WRITERS)
def test_an_edited_gravity_or_tilt_and_an_edited_name_are_read(kind, tmp_path):
    p = PLATFORM.replaced({'gravity': [0.0, 0.0, -1.62]})
    tilt = {'sdf': (r'(canonical_link="base">\s*<pose>)[^<]*(<)', '0 0 0 0.1 0 0'),
            'xml': (r'(gravity=")[^"]*(")', f'0 {-1.62 * np.sin(0.1)} {-1.62 * np.cos(0.1)}'),
            'usda': (r'(gravityDirection = )[^\n]*(\n)', f'(0, {-np.sin(0.1)}, {-np.cos(0.1)})'),
            'urdf': (r'(</material>\s*)(<link name="base">)',
                     '<link name="world"/><joint name="fix" type="fixed"><parent link="world"/>'
                     '<child link="base"/><origin rpy="0.1 0 0"/></joint>')}[kind]
    found = read_hexapod(written(p, kind, tmp_path, edited(*tilt))).parameters['gravity']
    assert found / np.linalg.norm(found) == pytest.approx(
        [0.0, -np.sin(0.1), -np.cos(0.1)], abs=1e-7 if kind == 'usda' else 1e-9)
    assert (np.linalg.norm(found) == pytest.approx(1.62)) == (kind in ('xml', 'usda'))
    renamed = read_hexapod(written(PLATFORM.replaced({'base_frame': 'world'}), kind, tmp_path,
                                   lambda text: re.sub(
                                       '(?<!element=")(?<!data=")world_base', 'ground', text)))
    assert renamed.parameters['base_frame'] == (
        'world' if kind in ('urdf', 'usda') else 'ground')


def at_home(text, hexapod):
    """Return the URDF with all joints at zero where they are at home, without its own block."""
    root = ET.fromstring(foreign(text))
    joints = {joint.get('name'): joint for joint in root.findall('joint')}
    for leg in hexapod.legs:
        joints[leg.name].find('origin').set('xyz', f'0 0 {leg.branch.home!r}')
    ET.SubElement(joints['platform_z'], 'origin', {'xyz': f'0 0 {float(hexapod.position[2])!r}'})
    return root, joints


def test_an_open_urdf_whose_loops_gazebo_closes_is_read(tmp_path):
    p = PLATFORM

    def closed_by_gazebo(text):
        root, _ = at_home(text, Hexapod(p))
        for leg in p['joints']:
            joint = ET.SubElement(ET.SubElement(root, 'gazebo'), 'joint',
                                  {'name': f'{leg}_ball', 'type': 'ball'})
            ET.SubElement(joint, 'parent').text = f'{leg}_piston'
            ET.SubElement(joint, 'child').text = f'{leg}_platform_joint'
            dynamics = ET.SubElement(ET.SubElement(joint, 'axis'), 'dynamics')
            ET.SubElement(dynamics, 'damping').text = '3'
        return ET.tostring(root, encoding='unicode')

    found = read_hexapod(written(p, 'urdf', tmp_path, closed_by_gazebo))
    for name in ('geometry.base_joints', 'geometry.platform_joints', 'platform.inertia'):
        assert found.parameters[name] == pytest.approx(p[name], abs=1e-12), name
    assert 'each leg: damping 3 of its joints at the platform is left out' in found.remarks


def test_an_open_urdf_in_which_one_leg_carries_the_platform_is_read_and_reported(tmp_path):
    """As CAD programs write it: the other five legs end in the air."""
    p = PLATFORM

    def carried_by_a_leg(text):
        hexapod = Hexapod(p)
        root, joints = at_home(text, hexapod)
        for name, joint in joints.items():
            if name.startswith('platform_') or name.endswith('_fixed'):
                root.remove(joint)
        for link in root.findall('link'):
            if link.get('name').endswith(('_link', '_platform_joint')):
                root.remove(link)
        leg = hexapod.legs[0]
        joint = ET.SubElement(root, 'joint', {'name': 'ball', 'type': 'spherical'})
        ET.SubElement(joint, 'parent', {'link': leg.last})
        ET.SubElement(joint, 'child', {'link': 'platform'})
        # The platform's frame is at its joint: the other joints are read relative to it.
        turn = to_euler(leg.branch.links[0].at_home.rotation.T)
        ET.SubElement(joint, 'origin', {'rpy': ' '.join(repr(float(angle)) for angle in turn)})
        return ET.tostring(root, encoding='unicode')

    found = read_hexapod(written(p, 'urdf', tmp_path, carried_by_a_leg))
    assert found.parameters['geometry.base_joints'] == pytest.approx(
        p['geometry.base_joints'], abs=1e-12)
    joints = p['geometry.platform_joints']
    assert found.parameters['geometry.platform_joints'] == pytest.approx(
        joints - joints[0], abs=1e-9)
    assert any(remark.startswith('the loops are open: the ends of five legs are taken as ball '
                                 "joints on 'platform'") for remark in found.remarks)


def changed(text, pattern, replacement):
    new, count = re.subn(pattern, replacement, text, count=1)
    assert count == 1
    return new


def test_a_start_outside_the_limits_is_reported(tmp_path):
    p = PLATFORM

    def moved(text):
        return changed(foreign(text), r'<lower>[^<]*</lower>', '<lower>0.1</lower>')

    found = read_hexapod(written(p, 'sdf', tmp_path, moved))
    assert any(re.match(r'leg_1: its position in the file, 0 m, is outside its limits, 0.1 to',
                        remark) for remark in found.remarks)


@pytest.mark.parametrize('text', [
    '',
    '<robot',
    '<html/>',
    '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="x"><xacro:leg/></robot>',
    '<robot name="x"><xacro:leg/></robot>',
    '<robot name="x"><link name="${a}"/></robot>',
    '<robot xmlns:xacro="http://ros.org/wiki/xacro" name="x"/>',
    '<sdf version="1.9"><%= leg %></sdf>',
    '#usda 1.0\n',
    'PXR-USDC\0',
    'PK\3\4',
    'version https://git-lfs.github.com/spec/v1\noid sha256:1\n',
    '<!DOCTYPE a [<!ENTITY b "c">]><robot name="x"/>',
    '<robot name="x"><link name="a"/></robot>',
    '<robot name="x"><link name="a"/><joint name="j" type="fixed"><parent link="a"/>'
    '<child link="b"/></joint></robot>',
    '<robot name="x"><link name="a"/><link name="b"/><joint name="j" type="fixed">'
    '<origin xyz="1 nan 0"/><parent link="a"/><child link="b"/></joint></robot>',
    '<robot name="x"><link name="a"/><joint name="j" type="fixed"><parent link="a"/>'
    '<child link="a"/></joint></robot>',
    '<sdf version="1.9"/>',
    '<sdf version="1.9"><model name="m"><link name="a"><pose relative_to="a">0 0 0 0 0 0</pose>'
    '</link></model></sdf>',
    '<sdf version="1.9"><model name="m"><joint name="j" type="fixed"><parent>a</parent></joint>'
    '</model></sdf>',
    '<sdf version="1.9"><world name="w"><include><uri>model://six</uri></include></world></sdf>',
    '<robot name="x"><link name="a"/><link name="b"/><joint name="j" type="fixed">'
    '<origin rpy="0 0 0" quat_xyzw="0 0 0 1"/><parent link="a"/><child link="b"/></joint></robot>',
    '<sdf version="1.9"><model name="m"><link name="a"><pose rotation_format="quat_xyzw">'
    '0 0 0 0 0 0 0</pose></link></model></sdf>',
    '<sdf version="1.9"><model name="m"><link name="a"/><frame name="f" attached_to="g"/>'
    '<frame name="g" attached_to="f"/><joint name="j" type="fixed"><parent>f</parent>'
    '<child>a</child></joint></model></sdf>',
    '<sdf version="1.5"><model name="m"><include><uri>model://six</uri></include><link name="a"/>'
    '<joint name="j" type="fixed"><parent>a</parent><child>six::base</child></joint></model>'
    '</sdf>',
], ids=itertools.count())
def test_a_file_without_a_hexapod_is_rejected_in_one_line(text, tmp_path, snapshot):
    path = tmp_path / 'file.xml'
    path.write_text(text, encoding='utf-8')
    with snapshot.raises(StewartError) as caught:
        read_hexapod(path)
    assert '\n' not in str(caught.value)
    assert str(path) in str(caught.value)


def test_an_mjcf_that_mujoco_rejects_is_rejected_with_the_reason_of_mujoco(tmp_path):
    pytest.importorskip('mujoco')
    path = tmp_path / 'file.xml'
    path.write_text('<mujoco><equality><connect relpose="1"/></equality></mujoco>')
    with pytest.raises(StewartError, match="MuJoCo: .*unrecognized attribute: 'relpose'"):
        read_hexapod(path)


def test_a_prismatic_joint_across_its_leg_is_rejected(tmp_path, snapshot):
    path = written(PLATFORM, 'xml', tmp_path, lambda text: changed(
        text, '(<joint name="leg_5" type="slide" axis)="0 0 1"', r'\1="1 0 0"'))
    with snapshot.raises(StewartError):
        read_hexapod(path)


def test_a_negative_gear_is_reported(tmp_path, snapshot):
    path = written(PLATFORM, 'xml', tmp_path, lambda text: changed(
        text, '<motor name="leg_6"', '<motor name="leg_6" gear="-1"'))
    found = read_hexapod(path)
    snapshot('\n'.join(found.remarks))
    assert found.parameters['limits.force_max'] == pytest.approx(6000.0)


def test_a_leg_without_a_joint_at_one_end_is_rejected(tmp_path, snapshot):
    path = written(PLATFORM, 'sdf', tmp_path, lambda text: re.sub(
        '(<joint name="[^"]*") type="ball"', r'\1 type="fixed"', foreign(text)))
    with snapshot.raises(StewartError):
        read_hexapod(path)


def test_legs_that_are_cut_in_two_are_rejected(tmp_path, snapshot):
    """As CAD programs cut loops: one part hangs from the platform."""
    def cut(text):
        return changed(changed(
            text, '<child>leg_2_piston</child>', '<child>leg_2_end</child>'),
            '<joint name="leg_2"', '<link name="leg_2_end"/><joint name="leg_2"')

    with snapshot.raises(StewartError):
        read_hexapod(written(PLATFORM, 'sdf', tmp_path, cut))


@pytest.mark.parametrize('kind', ['urdf', 'sdf'])
def test_parameters_that_no_format_has_elements_for_are_carried(kind, tmp_path):
    given = {'actuator.screw_lead': 0.01, 'actuator.coulomb_velocity': [
        1e-3 * n for n in range(1, 7)], 'limits.base_joint_angle_max': 0.7}
    read = read_hexapod(written(PLATFORM.replaced(given), kind, tmp_path))
    for name, value in given.items():
        assert read.parameters[name] == pytest.approx(np.broadcast_to(value, 6)), name


# Files that cost too much

def chain_of_frames(count):
    """Return a model with a chain of frames, the last of them first."""
    return '<sdf version="1.9"><model name="m"><link name="a"/>' + ''.join(
        f'<frame name="f{n}" attached_to="{f"f{n - 1}" if n else "a"}"/>'
        for n in reversed(range(count))) + (
            f'<joint name="j" type="fixed"><pose relative_to="f{count - 1}">1 0 0 0 0 0</pose>'
            '<parent>world</parent><child>a</child></joint></model></sdf>')


def links(count, kind, parent):
    """Return a URDF whose links are carried by others."""
    return '<robot name="x"><link name="l0"/>' + ''.join(
        f'<link name="l{n}"/><joint name="j{n}" type="{kind}"><parent link="l{parent(n)}"/>'
        f'<child link="l{n}"/></joint>' for n in range(1, count)) + '</robot>'


@pytest.mark.parametrize('model', [
    chain_of_frames, lambda count: links(count, 'fixed', lambda n: n - 1),
    lambda count: links(count, 'continuous', lambda n: n - 1),
    lambda count: links(count, 'continuous', lambda n: 0)],
    ids=['frames', 'fixed links', 'hinged links', 'star'])
def test_large_models_take_calls_in_proportion_to_their_size(model, tmp_path, snapshot):
    path, calls = tmp_path / 'large.xml', []
    for count, raises in ((2_000, pytest.raises), (20_000, snapshot.raises)):
        path.write_text(model(count))
        with cProfile.Profile() as profile, raises(StewartError):
            read_hexapod(path)
        calls.append(pstats.Stats(profile).total_calls)
    assert calls[1] < 20 * calls[0]


@pytest.mark.parametrize(('text', 'why'), [
    ('<worldbody><replicate count="100000000"><body><geom size="1"/></body></replicate>'
     '</worldbody>', 'not loaded within'),
    ('<include file="/dev/zero"/>', 'not loaded within|MuJoCo: '),
    ('<include file="pipe"/>', 'not loaded within|MuJoCo: '),
    ('<worldbody>' + '<body>' * 50_000 + '</body>' * 50_000 + '</worldbody>', 'MuJoCo: ')])
def test_mujoco_is_given_bounded_time_and_memory(text, why, tmp_path, monkeypatch):
    pytest.importorskip('mujoco')
    monkeypatch.setattr(loading, '_TIME', 1)
    monkeypatch.setattr(loading, '_WAIT', 6)
    os.mkfifo(tmp_path / 'pipe')
    (tmp_path / 'file.xml').write_text(f'<mujoco>{text}</mujoco>')
    with pytest.raises(StewartError, match=why) as caught:
        read_hexapod(tmp_path / 'file.xml')
    assert '\n' not in str(caught.value)


def test_mujoco_writes_its_warnings_nowhere(tmp_path, monkeypatch):
    pytest.importorskip('mujoco')
    monkeypatch.chdir(tmp_path)
    path = written(PLATFORM, 'xml', tmp_path, lambda text: changed(
        text, '<worldbody>', '<worldbody><body pos="nan 0 0"><geom size="1"/></body>'))
    with suppress(StewartError):  # since MuJoCo 3.17 this is an error as well
        read_hexapod(path)
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


# The SDFormat file: accepted by libsdformat where it is installed, its frames and gravity

# The program of libsdformat: gz of new releases, ign of old ones.
GAZEBO = next((name for name in ('gz', 'ign') if shutil.which(name)), '')


@pytest.mark.skipif(not GAZEBO, reason='needs gz sdf or ign sdf')
@pytest.mark.parametrize('seed', [None, 0])
def test_libsdformat_finds_the_file_valid(seed, tmp_path):
    p = PLATFORM if seed is None else random_parameters(rng(seed))
    file = tmp_path / 'hexapod.sdf'
    file.write_text(sdf(Hexapod(p), 'hexapod'), encoding='utf-8')
    done = subprocess.run([GAZEBO, 'sdf', '-k', str(file)], capture_output=True, text=True,
                          timeout=300)
    assert done.returncode == 0, done.stderr
    assert 'Valid' in done.stdout


def sdf_model(p):
    return ET.fromstring(sdf(Hexapod(p), 'hexapod')).find('model')


def test_the_joints_and_the_tips_close_the_loops():
    p, model = PLATFORM, sdf_model(PLATFORM)
    joints = {joint.get('name'): joint for joint in model.iter('joint')}
    kinds = [joint.get('type') for joint in joints.values()]
    assert [kinds.count(kind) for kind in ('fixed', 'universal', 'prismatic', 'ball')] == [
        1, 6, 6, 6]
    tip, = (link for link in model.iter('link') if link.get('name') == 'leg_3_tip')
    assert tip.find('pose').get('relative_to') == 'platform'
    at = [float(each) for each in tip.findtext('pose').split()]
    assert at == [*p['geometry.platform_joints'][2], 0.0, 0.0, 0.0]
    assert joints['leg_3_platform_joint'].find('pose') is None  # at its child, the tip
    assert joints['leg_3_platform_joint'].findtext('child') == 'leg_3_tip'
    fixed = {(plugin.findtext('parent_link'), plugin.findtext('child_link'))
             for plugin in model.iter('plugin')}
    assert fixed == {('platform', f'{leg}_tip') for leg in p['joints']}


def test_no_link_has_two_parent_joints() -> None:
    """Gazebo's engines reject a joint whose child has a parent already."""
    model = sdf_model(PLATFORM)
    children = [joint.findtext('child') for joint in model.iter('joint')]
    assert len(children) == len(set(children)) == 1 + 6 * 3


def test_length_limits_count_from_the_home_pose() -> None:
    p, model = PLATFORM, sdf_model(PLATFORM)
    joints = {joint.get('name'): joint for joint in model.iter('joint')}
    home = StewartPlatform(p).inverse_kinematics(StewartPlatform(p).home_pose())
    limit = joints['leg_1'].find('axis/limit')
    assert float(limit.findtext('lower')) == pytest.approx(0.95 - home[0], abs=1e-15)
    assert float(limit.findtext('upper')) == pytest.approx(1.65 - home[0], abs=1e-15)


@pytest.mark.parametrize('gravity', [
    [0.0, 0.0, -9.8], [0.0, 0.0, 9.8], [3.0, -1.0, 2.0], [-9.8, 0.0, 0.0], [0.0, 0.0, 0.0]])
def test_the_model_is_turned_until_gravity_points_down(gravity):
    turn = upright(np.array(gravity))
    assert turn @ turn.T == pytest.approx(np.eye(3), abs=1e-15)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    assert turn @ gravity == pytest.approx([0.0, 0.0, -np.linalg.norm(gravity)], abs=1e-14)


def test_a_base_frame_with_the_name_of_the_world_gets_another_in_sdf():
    model = sdf_model(PLATFORM.replaced({'base_frame': 'world'}))
    assert [link.get('name') for link in model.iter('link')][0] == 'world_base'


def read_changed(kind, folder, *changes):
    """Read a file of PLATFORM by others, with texts replaced in all legs."""
    def change(text):
        text = foreign(text)
        for pattern, replacement in changes:
            text, count = re.subn(pattern, replacement, text)
            assert count
        return text

    return read_hexapod(written(PLATFORM, kind, folder, change))


SLIDE = r'(<joint name="leg_\d" type="slide" [^>]*?)( ?/>)'


@pytest.mark.parametrize(('changes', 'said'), [
    ([(SLIDE, r'\1 stiffness="2000" springref="0.05"\2')], 'stiffness 2000 N/m about 0.05 m'),
    ([('<body name="platform"', '<body name="platform" gravcomp="1"')],
     'platform: gravcomp 1 is left out'),
    ([('</worldbody>', '</worldbody><tendon><spatial name="s" stiffness="30"><site '
       'site="leg_1_base_joint"/><site site="leg_1_platform_joint"/></spatial></tendon>')],
     's: stiffness 30 N/m of this tendon is left out'),
])
def test_forces_of_an_mjcf_at_rest_are_warnings(changes, said, tmp_path):
    found = read_changed('xml', tmp_path, *changes)
    assert any(said in each for each in found.warnings)


def test_limits_of_an_mjcf_are_taken_both_ways_or_named(tmp_path, snapshot):
    without = (r' ctrlrange="[^"]*"| ctrllimited="[^"]*"', '')
    found = read_changed('xml', tmp_path, without,
                         (SLIDE, r'\1 actuatorfrclimited="true" actuatorfrcrange="-250 250"\2'))
    assert found.parameters['limits.force_max'] == pytest.approx(250.0)
    found = read_changed('xml', tmp_path, without, (
        '<motor ', '<motor ctrllimited="true" ctrlrange="0 400" '))
    snapshot('\n'.join(found.remarks))
    assert found.parameters['limits.force_max'] is None
    assert not any('limits.force_max' in each for each in found.remarks)


def test_springs_and_links_without_weight_of_an_sdf_are_warnings(tmp_path):
    found = read_changed('sdf', tmp_path, ('</damping>', '</damping><spring_stiffness>50'
                                           '</spring_stiffness>'),
                         ('<link name="platform">', '<link name="platform"><gravity>0</gravity>'))
    assert any('each leg: stiffness 50 N/m about 0 m' in each for each in found.warnings)
    assert any(each.startswith('platform: gravity switched off') for each in found.warnings)


@pytest.mark.parametrize('empty', [
    ['damping'], ['friction'], ['effort'], ['velocity'], ['damping', 'friction', 'effort'],
    ['spring_stiffness'], ['lower', 'upper'], ['mass'], ['ixx'], ['pose']])
def test_empty_elements_of_an_sdf_have_their_defaults(empty, tmp_path):
    """As in libsdformat: 0, unlimited, 1 kg."""
    def change(text):
        root = ET.fromstring(foreign(text))
        for joint in root.iter('joint'):
            for axis in [*joint.findall('axis'), *joint.findall('axis2')]:
                dynamics = axis.find('dynamics')
                if dynamics is None:
                    dynamics = ET.SubElement(axis, 'dynamics')
                    ET.SubElement(dynamics, 'damping').text = '3'
                ET.SubElement(dynamics, 'spring_stiffness').text = '0'
        for tag in empty:
            for element in [*root.iter(tag)]:
                if tag != 'pose' or element.text == '0.0 0.0 0.0 0.0 0.0 0.0':
                    element.text = '\n  ' if tag == 'friction' else None
        return ET.tostring(root, encoding='unicode')

    found = read_hexapod(written(PLATFORM, 'sdf', tmp_path, change)).parameters
    changes = {'damping': ('actuator.viscous_friction', 0.0), 'velocity': (
        'limits.velocity_max', None), 'friction': ('actuator.coulomb_friction', 0.0),
        'effort': ('limits.force_max', None), 'lower': ('limits.length_min', None),
        'upper': ('limits.length_max', None), 'mass': ('platform.mass', 7.0)}
    expected = {name: PLATFORM[name] for name in OF_FORMATS} | dict(
        changes[tag] for tag in empty if tag in changes)
    for name, value in expected.items():
        if 'mass' not in empty and 'ixx' not in empty or name.startswith(('geo', 'lim')):
            assert (found[name] is None) == (value is None), name
            assert value is None or found[name] == pytest.approx(value, abs=1e-6), name
    if 'mass' in empty:  # the tips have 1 kg as well
        assert found['platform.mass'] == 7.0 and found['legs.piston.mass'] == pytest.approx(1.0)


def test_placeholders_of_other_tools_are_named(tmp_path, snapshot):
    def change(text):
        one = ('<inertial><mass value="1.0"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" '
               'izz="1"/></inertial>')
        return re.sub(r'(<link name="leg_\d_cross">).*?</inertial>', rf'\1{one}', text,
                      flags=re.DOTALL)

    found = read_hexapod(written(PLATFORM, 'urdf', tmp_path, change))
    snapshot('\n'.join(found.warnings))
    assert found.parameters['legs.cylinder.mass'] == pytest.approx(
        PLATFORM['legs.cylinder.mass'] + 1.0)


@pytest.mark.parametrize('code', [
    'raise ImportError("libmujoco.so.4.0.0: cannot open")', 'raise AttributeError("mjtBias")',
    '__version__ = "2.0"', 'raise OSError("wrong ELF class")'])
def test_a_package_mujoco_that_is_broken_or_too_old_is_named_in_one_line(code, tmp_path):
    path = written(PLATFORM, 'xml', tmp_path)
    package = tmp_path / 'broken' / 'mujoco'
    package.mkdir(parents=True)
    (package / '__init__.py').write_text(f'{code}\n')
    done = subprocess.run(
        [sys.executable, '-c', 'import sys; from stewart_dynamics.description import main; '
         'sys.exit(main(sys.argv[1:]))', '--from', path, '--output', tmp_path / 'read'],
        env={**os.environ, 'PYTHONPATH': f'{package.parent}'}, capture_output=True, text=True,
        timeout=300)
    assert done.returncode == 2
    assert done.stderr.count('\n') == 1 and 'pip install --force-reinstall' in done.stderr
    assert 'unexpected' not in done.stderr


def cad_urdf(platform, limit='lower="-0.1" upper="0.1" effort="500" velocity="0.3"', extra='',
             mass=0.001):
    """Return a URDF as CAD programs write it: leg 1 carries the platform, dummies at joints."""
    p = PLATFORM
    home = StewartPlatform(p).home_pose()
    tips = home.position + p['geometry.platform_joints'] @ home.rotation.T

    def link(name, heavy):
        return (f'<link name="{name}"><inertial><mass value="{heavy}"/><inertia ixx="{heavy}" '
                f'ixy="0" ixz="0" iyy="{heavy}" iyz="0" izz="0"/></inertial></link>')

    def joint(name, kind, parent, child, at, axis):
        return (f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child '
                f'link="{child}"/><origin xyz="{" ".join(map(repr, map(float, at)))}"/>'
                f'<axis xyz="{" ".join(map(repr, map(float, axis)))}"/>'
                + (f'<limit {limit}/>' if kind == 'prismatic' else '') + '</joint>')

    text, zero, (x, y, z) = link('base', 30), np.zeros(3), np.eye(3)
    for n, (base, tip) in enumerate(zip(p['geometry.base_joints'], tips, strict=True)):
        arm = tip - base
        for child, heavy in (('u', mass), ('cyl', 2), ('rod', 1), ('s1', mass), ('s2', mass),
                             ('s3', mass)):
            text += link(f'{child}{n}', heavy)
        text += joint(f'ux{n}', 'continuous', 'base', f'u{n}', base, x)
        text += joint(f'uy{n}', 'continuous', f'u{n}', f'cyl{n}', zero, y)
        text += joint(f'slide{n}', 'prismatic', f'cyl{n}', f'rod{n}', arm, arm)
        for parent, child, axis in (('rod', 's1', x), ('s1', 's2', y), ('s2', 's3', z)):
            text += joint(f'{child}_{n}', 'continuous', f'{parent}{n}', f'{child}{n}', zero, axis)
    text += platform + joint('plate', 'fixed', 's30', 'platform', home.position - tips[0], x)
    return f'<robot name="cad">{text}{extra}</robot>'


def from_text(text, folder, geometry_only=False):
    path = folder / 'hexapod.urdf'
    path.write_text(text)
    return read_hexapod(path, geometry_only)


HEAVY = ('<link name="platform"><inertial><mass value="20"/><inertia ixx="1" ixy="0" ixz="0" '
         'iyy="1" iyz="0" izz="1"/></inertial></link>')


@pytest.mark.parametrize('platform', [
    HEAVY, '<link name="platform"/>',
    '<link name="platform"><visual><geometry><sphere radius="1"/></geometry></visual></link>'])
def test_the_platform_frame_does_not_depend_on_masses(platform, tmp_path):
    found = from_text(cad_urdf(platform), tmp_path)
    p = found.parameters
    assert p['platform_frame'] == 'platform'
    assert p['geometry.platform_joints'] == pytest.approx(
        PLATFORM['geometry.platform_joints'], abs=1e-9)
    missing = ('platform: no mass but 0.006 kg of six links; legs have 3 kg each: is the mass of '
               "'platform' missing?")
    assert (missing in found.warnings) == (platform is not HEAVY)


def test_limits_of_zero_are_left_out_and_not_listed_as_missing(tmp_path, snapshot):
    found = from_text(cad_urdf(HEAVY, 'lower="0" upper="0" effort="0" velocity="0"'), tmp_path)
    assert all(found.parameters[name] is None for name in (
        'limits.length_min', 'limits.length_max', 'limits.velocity_max', 'limits.force_max'))
    snapshot('\n'.join(found.remarks))
    assert not any('not in the file: unlimited' in each for each in found.remarks)


def test_what_gazebo_and_ros2_control_add_in_a_urdf_is_named_or_taken(tmp_path):
    extra = ''.join(
        f'<gazebo reference="slide{n}"><springStiffness>40</springStiffness></gazebo>'
        f'<ros2_control><joint name="slide{n}"><command_interface name="effort">'
        f'<param name="min">-90</param>'
        '<param name="max">90</param></command_interface></joint></ros2_control>'
        for n in range(6))
    found = from_text(cad_urdf(HEAVY, extra=extra), tmp_path)
    assert found.parameters['limits.force_max'] == pytest.approx(90.0)
    assert any(each.startswith('each leg: stiffness 40 N/m about 0 m') for each in found.warnings)


def test_geometry_alone_is_read_without_masses(tmp_path, snapshot):
    text = cad_urdf('<link name="platform"/>', mass=0.0)
    with snapshot.raises(StewartError):
        from_text(text, tmp_path)
    p = from_text(text, tmp_path, True).parameters
    assert p['geometry.base_joints'] == pytest.approx(PLATFORM['geometry.base_joints'], abs=1e-9)
    machine = StewartPlatform(p)
    assert any(each.startswith('platform.mass: ') and 'stands for none' in each
               for each in machine.check())
    assert np.abs(machine.inverse_dynamics(Motion.from_pose(machine.home_pose())).forces
                  ).max() < 1e-9
