# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The URDF by Pinocchio's reader: closed loops, and the same leg forces."""

import os
from pathlib import Path
import shutil
import sys
from typing import Any
from xml.etree import ElementTree as ET

from legs_of_all_kinds import efforts_of, KINDS, random_hexapod
import numpy as np
from programs import run_program
import pytest
from referees import (
    Array, each_relative, friction, random_parameters, reflected, rng,
    rotation_about)
from snapshot import Snapshot

from stewart_dynamics import Motion, ParameterError, Parameters, Pose, StewartPlatform
from stewart_dynamics.description.formats import read_hexapod
from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.description.loops import loops_yaml
from stewart_dynamics.description.urdf import Ros2Control, urdf
from stewart_dynamics.mechanics.kinematics.leg_joints import TreeJoints
import yaml

PROGRAM = 'stewart_describe'

pin = pytest.importorskip('pinocchio')

PLATFORM = Path(__file__).parents[1] / 'config' / 'platform.yaml'
CLOSED = 1e-9  # [m]
FORCES = 1e-9


class Tree:
    """The model that Pinocchio reads, and its frames at the platform joints."""

    def __init__(self, p: Parameters) -> None:
        self.model = pin.buildModelFromXML(urdf(Hexapod(p), 'hexapod'))
        self.data = self.model.createData()
        self.joints = TreeJoints(p)
        self.places = [self.model.joints[self.model.getJointId(name)].idx_q
                       for name in self.joints.names]
        self.ends = [self.model.getFrameId(leg.end_frame) for leg in Hexapod(p).legs]
        self.balls = [self.model.getFrameId(f'{leg}_platform_joint') for leg in p['joints']]
        self.platform = self.model.getFrameId(p['platform_frame'], pin.BODY)

    def configuration(self, row: Array) -> Array:
        """Return Pinocchio's order of the positions of all joints."""
        q = np.zeros(self.model.nq)
        q[self.places] = row
        return q

    def gap(self, pose: Any, row: Array) -> float:
        """Return the largest distance of a leg's end from its platform joint [m]."""
        pin.framesForwardKinematics(self.model, self.data, self.configuration(row))
        frames = self.data.oMf
        platform = frames[self.platform]
        assert np.abs(platform.translation - pose.position).max() < CLOSED
        assert np.abs(platform.rotation - pose.rotation).max() < CLOSED
        return float(max(
            np.linalg.norm(frames[end].translation - frames[ball].translation)
            for end, ball in zip(self.ends, self.balls, strict=True)))

    def forces(self, p: Parameters, motion: Motion) -> Array:
        """Return the leg forces of one sample: the tree's, its loops closed by constraints."""
        model, data = self.model, self.data
        q = self.configuration(self.joints.positions(motion.position, motion.rotation))
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        full = pin.LOCAL_WORLD_ALIGNED
        loops = [pin.getFrameJacobian(model, data, end, full)[:3]
                 - pin.getFrameJacobian(model, data, ball, full)[:3]
                 for end, ball in zip(self.ends, self.balls, strict=True)]
        # Closed loops and the platform's twist determine the rates of all joints.
        all_rows = np.vstack([*loops, pin.getFrameJacobian(model, data, self.platform, full)])
        twist = np.concatenate([motion.linear_velocity, motion.angular_velocity])
        freedoms = np.linalg.solve(all_rows, np.vstack([np.zeros((18, 6)), np.eye(6)]))
        v = freedoms @ twist
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        drift = [pin.getFrameClassicalAcceleration(model, data, end, full).linear
                 - pin.getFrameClassicalAcceleration(model, data, ball, full).linear
                 for end, ball in zip(self.ends, self.balls, strict=True)]
        own = pin.getFrameClassicalAcceleration(model, data, self.platform, full)
        a = np.linalg.solve(all_rows, np.concatenate([
            -np.concatenate(drift), motion.linear_acceleration - own.linear,
            motion.angular_acceleration - own.angular]))
        model.gravity.linear = np.array(p['gravity'])
        tau = pin.rnea(model, data, q, v, a)
        legs = [model.joints[model.getJointId(name)].idx_v for name in p['joints']]
        pushes = np.linalg.solve(freedoms[legs].T, freedoms.T @ tau)
        # Terms that are not in a URDF, or left out by Pinocchio's recursion.
        forces: Array = pushes + reflected(p) * a[legs] + friction(p, v[legs])
        return forces


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('seed', range(3))
def test_efforts_by_pinocchio_from_the_urdf_are_the_same(seed, kind):
    p, motions = random_hexapod(kind, seed, 20)
    tree = Tree(p)
    efforts = efforts_of(p, motions)
    assert each_relative([tree.forces(p, motion) for motion in motions], efforts) < FORCES


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('seed', range(3))
def test_the_joints_of_a_motion_close_all_loops_of_the_urdf(seed, kind):
    p, motions = random_hexapod(kind, seed, 100)
    tree = Tree(p)
    rows = tree.joints.positions(motions.position, motions.rotation)
    assert max(tree.gap(motion, row) for motion, row in zip(motions, rows, strict=True)) < CLOSED


@pytest.mark.parametrize('off', [0.0, 1e-14, 1e-9, 1e-5])
def test_the_loops_are_closed_in_the_singular_direction_of_a_universal_joint(off):
    p = Parameters.from_yaml(PLATFORM)
    tree = Tree(p)
    for leg in range(6):
        x, y, z = tree.joints.mounts[leg].T
        tip = p['geometry.base_joints'][leg] + 1.2 * x + off * (y - z)
        turn = rotation_about([0.0, 0.0, 1.0], 0.3)
        pose = Pose(tip - turn @ p['geometry.platform_joints'][leg], turn)
        assert tree.gap(pose, tree.joints.positions(pose.position, pose.rotation)) < CLOSED


def test_the_urdf_has_the_joints_of_the_closed_form_and_the_limits_of_the_parameters():
    p = Parameters.from_yaml(PLATFORM)
    root = ET.fromstring(urdf(Hexapod(p), 'hexapod'))
    moving = [joint for joint in root.iter('joint') if joint.get('type') != 'fixed']
    assert tuple(joint.get('name') for joint in moving) == TreeJoints(p).names
    leg = next(joint for joint in moving if joint.get('name') == 'leg_1')
    limit = {name: float(value) for name, value in leg.find('limit').attrib.items()}
    assert limit == pytest.approx({'lower': 0.0, 'upper': 0.7, 'velocity': 0.5, 'effort': 6000.0})


# Beside Python, where it comes with Pinocchio from PyPI.
CHECK_URDF = shutil.which('check_urdf', path=os.pathsep.join(
    [str(Path(sys.executable).parent), os.environ.get('PATH', '')]))


@pytest.mark.skipif(CHECK_URDF is None, reason='needs check_urdf of urdfdom')
def test_urdfdom_reads_the_urdf(tmp_path):
    file = tmp_path / 'hexapod.urdf'
    file.write_text(urdf(Hexapod(Parameters.from_yaml(PLATFORM)), 'hexapod',
                         Ros2Control(['effort'], 'mock')), encoding='utf-8')
    done = run_program(CHECK_URDF, file)
    assert 'root Link: base has 7 child(ren)' in done.out
    assert 'error' not in (done.out + done.err).lower()


def test_all_links_have_their_mass_and_inertia_zeros_too():
    """Engines such as PyBullet take 1 kg and 1 kg m^2 for a link without ``inertial``."""
    p = Parameters.from_yaml(PLATFORM).replaced(
        {'legs.piston.mass': 0.0, 'legs.piston.inertia': 0.0})
    links = [*ET.fromstring(urdf(Hexapod(p), 'x')).iter('link')]
    masses = {link.get('name'): float(link.find('inertial/mass').get('value')) for link in links}
    heavy = {'platform': 150.0, **{f'leg_{n}_cylinder': 12.0 for n in range(1, 7)}}
    assert len(masses) == 31
    assert {name: mass for name, mass in masses.items() if mass} == heavy
    for link in links:
        inertia = link.find('inertial/inertia').attrib
        assert len(inertia) == 6
        assert link.get('name') in heavy or {*map(float, inertia.values())} == {0.0}


@pytest.mark.parametrize('massless', [True, False])
def test_a_solid_urdf_has_no_zero_in_a_link_that_moves_and_reads_back_equal(massless, tmp_path):
    p = Parameters.from_yaml(PLATFORM)
    if massless:
        p = p.replaced({'legs.piston.mass': 0.0, 'legs.piston.inertia': 0.0})
    text = urdf(Hexapod(p), 'x', solid=True)
    root = ET.fromstring(text)
    fixed = {joint.find('child').get('link') for joint in root.iter('joint')
             if joint.get('type') == 'fixed'}
    for link in root.iter('link'):
        if link.get('name') not in {'base', *fixed}:
            assert float(link.find('inertial/mass').get('value')) > 0.0
            assert all(float(link.find('inertial/inertia').get(key)) > 0.0
                       for key in ('ixx', 'iyy', 'izz'))
    file = tmp_path / 'x.urdf'
    file.write_text(text)
    read = read_hexapod(file).parameters
    for name, value in p.items():
        if isinstance(value, np.ndarray):
            assert read[name] == pytest.approx(value, rel=1e-12, abs=1e-12), name


def test_the_name_of_the_robot_is_not_that_of_a_link():
    """pytransform3d takes it for a frame of its own, and places both as one."""
    p = Parameters.from_yaml(PLATFORM)
    assert ET.fromstring(urdf(Hexapod(p), 'platform')).get('name') == 'platform_hexapod'
    assert ET.fromstring(urdf(Hexapod(p), 'hexapod')).get('name') == 'hexapod'


@pytest.mark.parametrize('seed', range(2))
def test_constraint_elements_close_the_loops_in_place_of_the_block(seed, tmp_path):
    p = random_parameters(rng(seed))
    root = ET.fromstring(urdf(Hexapod(p), 'x', constraints=True))
    assert root.find('stewart_dynamics/loop') is None
    for n, each in enumerate(root.findall('constraint')):
        at = np.array([float(x) for x in each.find('child_origin').get('xyz').split()])
        assert each.get('type') == 'spherical' and each.find('child').get('link') == 'platform'
        assert at == pytest.approx(p['geometry.platform_joints'][n])
        # An edit here is not hidden by another element.
        each.find('child_origin').set('xyz', ' '.join(map(repr, (at + [0.0, 0.0, 0.1]).tolist())))
    file = tmp_path / 'x.urdf'
    file.write_text(ET.tostring(root, encoding='unicode'))
    read = read_hexapod(file).parameters
    assert read['geometry.platform_joints'] == pytest.approx(
        p['geometry.platform_joints'] + [0.0, 0.0, 0.1], abs=1e-12)
    assert read['geometry.base_joints'] == pytest.approx(p['geometry.base_joints'], abs=1e-12)


def test_meshes_take_the_place_of_the_simple_shapes():
    p = Parameters.from_yaml(PLATFORM).replaced({
        'meshes.platform': 'package://my_hexapod/top.stl', 'meshes.scale': 0.001,
        'meshes.platform_offset': [0.0, 0.0, -0.02, 0.0, 0.0, 1.5]})
    links = {link.get('name'): link for link in ET.fromstring(urdf(Hexapod(p), 'x')).iter('link')}
    visual = links['platform'].find('visual')
    assert visual.find('origin').attrib == {'xyz': '0.0 0.0 -0.02', 'rpy': '0.0 0.0 1.5'}
    assert visual.find('geometry/mesh').attrib == {
        'filename': 'package://my_hexapod/top.stl', 'scale': '0.001 0.001 0.001'}
    assert links['base'].find('visual/geometry/cylinder') is not None


@pytest.mark.parametrize('interfaces', [
    ['effort'], ['velocity'], ['velocity', 'effort'], ['position', 'effort'],
    ['position', 'velocity', 'effort']])
def test_the_block_of_ros2_control_has_the_six_legs(interfaces):
    p = Parameters.from_yaml(PLATFORM)
    block = ET.fromstring(urdf(Hexapod(p), 'hexapod', Ros2Control(interfaces, 'mock'))).find(
        'ros2_control')
    assert block.find('hardware/plugin').text == 'mock_components/GenericSystem'
    assert [joint.get('name') for joint in block.iter('joint')] == list(p['joints'])
    for joint in block.iter('joint'):
        assert [each.get('name') for each in joint.iter('command_interface')] == interfaces
    home = StewartPlatform(p).home_pose()
    lengths = StewartPlatform(p).inverse_kinematics(home) - p['geometry.zero_length']
    initial = block.findall('joint/state_interface/param')
    assert [float(each.text) for each in initial] == pytest.approx(lengths, abs=1e-15)
    # mock_components copies commands into states; positions that it does not get it integrates.
    assert [(each.get('name'), each.text) for each in block.findall('hardware/param')] == (
        [('calculate_dynamics', 'true')] if interfaces[0] == 'velocity' else [])


@pytest.mark.parametrize(('changes', 'name'), [
    ({'base_frame': 'leg_1_piston'}, 'leg_1_piston'),
    ({'joints': ['platform', 'b', 'c', 'd', 'e', 'f']}, 'platform'),
    ({'platform_frame': 'world'}, 'world')])
def test_two_bodies_or_joints_of_the_same_name_are_rejected(
        changes, name, snapshot: Snapshot) -> None:
    p = Parameters.from_yaml(PLATFORM).replaced(changes)
    with snapshot.raises(ParameterError):
        Hexapod(p)


@pytest.mark.skipif(not hasattr(pin, 'RigidConstraintModel'), reason='needs Pinocchio 3')
@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('seed', range(3))
def test_loops_of_robot_yaml_give_the_closed_mechanism_in_pinocchio(seed, kind):
    """As Gepetto's loader makes them: ball joints between frames; then constrained dynamics."""
    p, motions = random_hexapod(kind, seed, 1)
    p = p.replaced({'actuator.viscous_friction': 0.0, 'actuator.coulomb_friction': 0.0,
                    p.leg_kind.fields['reflected_mass']: 0.0})
    closed = yaml.safe_load(loops_yaml(Hexapod(p), 'hexapod'))
    assert closed['type'] == ['3d'] * 6 and closed['name_mot'] == list(p['joints'])
    tree = Tree(p)
    model, data = tree.model, tree.data
    constraints = pin.StdVec_RigidConstraintModel()
    datas = pin.StdVec_RigidConstraintData()
    for names in closed['closed_loop']:
        first, second = (model.frames[model.getFrameId(name)] for name in names)
        constraints.append(pin.RigidConstraintModel(
            pin.ContactType.CONTACT_3D, model, first.parentJoint, first.placement,
            second.parentJoint, second.placement, pin.ReferenceFrame.LOCAL))
    for each in constraints:
        datas.append(each.createData())
    pose = motions[0].pose
    q = tree.configuration(tree.joints.positions(pose.position, pose.rotation))
    forces = 100.0 * rng(seed).normal(size=6)
    torques = np.zeros(model.nv)
    for leg, force in zip(p['joints'], forces, strict=True):
        torques[model.joints[model.getJointId(leg)].idx_v] = force
    model.gravity.linear = p['gravity']
    pin.initConstraintDynamics(model, data, constraints, datas)
    settings = pin.ProximalSettings(1e-13, 1e-13, 50)
    found = pin.constraintDynamics(
        model, data, q, np.zeros(model.nv), torques, constraints, datas, settings)
    expected = StewartPlatform(p).forward_dynamics(Motion.from_pose(pose), forces)
    places = [model.joints[model.getJointId(f'platform_{axis}')].idx_v for axis in 'xyz']
    assert each_relative(found[places][None], expected.linear_acceleration[None]) < 1e-7
