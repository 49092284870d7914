# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Accelerations that other engines compute from the files of stewart_describe, where they are there.

The platform of ``config/platform.yaml`` without friction is at home and at rest, under six forces.
The limit of each test is the agreement in the table of ``docs/description.md``.
"""

from __future__ import annotations

from pathlib import Path
import re
from typing import Any

import numpy as np
import pytest
from referees import Array, ROOT
from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.description.mjcf import mjcf
from stewart_dynamics.description.sdf import sdf
from stewart_dynamics.description.urdf import urdf
from stewart_dynamics.description.usd import usd

P = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml').replaced(
    {'actuator.viscous_friction': 0.0, 'actuator.coulomb_friction': 0.0})
LEGS = P['joints']
HOME = StewartPlatform(P).home_pose()
FORCES = StewartPlatform(P).inverse_dynamics(Motion.from_pose(HOME)).forces + [
    500.0, -300.0, 700.0, 200.0, -400.0, 600.0]
STEP = 1e-3  # of engines that give velocities after a step [s]
TABLE = (ROOT / 'docs' / 'description.md').read_text(encoding='utf-8')


def check(row: str, found: Any, reflected: bool = True) -> None:
    """Compare accelerations (6,), linear and angular, within the agreement in a row's table."""
    p = P if reflected else P.replaced({'actuator.reflected_mass': 0.0})
    motion = StewartPlatform(p).forward_dynamics(Motion.from_pose(HOME), FORCES)
    expected = np.concatenate([motion.linear_acceleration, motion.angular_acceleration])
    line, = (line for line in TABLE.splitlines() if line.startswith(f'| {row} |'))
    limit = float(line.split('|')[-2].split()[0])
    assert np.abs(np.asarray(found) - expected).max() <= limit * np.abs(expected).max(), line


def test_mujoco() -> None:
    mujoco = pytest.importorskip('mujoco')
    model = mujoco.MjModel.from_xml_string(mjcf(Hexapod(P), 'hexapod'))
    data = mujoco.MjData(model)
    data.ctrl[:] = FORCES
    mujoco.mj_forward(model, data)
    check('MuJoCo', data.qacc[18:24])


def test_mjx() -> None:
    """In single precision, as JAX has it by default."""
    mujoco, jax = pytest.importorskip('mujoco'), pytest.importorskip('jax')
    mjx = pytest.importorskip('mujoco.mjx')
    model = mujoco.MjModel.from_xml_string(mjcf(Hexapod(P), 'hexapod'))
    data = mujoco.MjData(model)
    data.ctrl[:] = FORCES
    done = jax.jit(mjx.forward)(mjx.put_model(model), mjx.put_data(model, data))
    check('MJX', np.array(done.qacc)[18:24])


def test_mujoco_warp() -> None:
    mujoco, warp = pytest.importorskip('mujoco'), pytest.importorskip('warp')
    mujoco_warp = pytest.importorskip('mujoco_warp')
    model = mujoco.MjModel.from_xml_string(mjcf(Hexapod(P), 'hexapod'))
    data = mujoco.MjData(model)
    data.ctrl[:] = FORCES
    mujoco.mj_forward(model, data)
    with warp.ScopedDevice('cpu'):
        there = mujoco_warp.put_data(model, data)
        there.qacc_warmstart.zero_()
        mujoco_warp.forward(mujoco_warp.put_model(model), there)
        check('MuJoCo Warp', there.qacc.numpy()[0][18:24])


@pytest.mark.parametrize('kind', ['usda', 'xml'])
def test_newton(kind: str, tmp_path: Path) -> None:
    newton = pytest.importorskip('newton')
    file = tmp_path / f'hexapod.{kind}'
    file.write_text((usd if kind == 'usda' else mjcf)(Hexapod(P), 'hexapod'))
    builder = newton.ModelBuilder()
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    (builder.add_usd if kind == 'usda' else builder.add_mjcf)(str(file))
    model = builder.finalize(device='cpu')
    joints, bodies = ([label.split('/')[-1] for label in labels]
                      for labels in (model.joint_label, model.body_label))
    before, after, control = model.state(), model.state(), model.control()
    forces = np.zeros(model.joint_dof_count, np.float32)
    for leg, force in zip(LEGS, FORCES, strict=True):
        forces[model.joint_qd_start.numpy()[joints.index(leg)]] = force
    control.joint_f.assign(forces)
    newton.eval_fk(model, model.joint_q, model.joint_qd, before)
    newton.solvers.SolverMuJoCo(model, iterations=100, ls_iterations=50).step(
        before, after, control, None, STEP)
    n = bodies.index('platform')
    found = after.body_qd.numpy()[n] / STEP
    found[:3] -= np.cross(found[3:], model.body_com.numpy()[n])  # that of the center of mass
    check(f'Newton, {"USD" if kind == "usda" else "MJCF"}', found)


@pytest.mark.parametrize('kind', ['xml', 'sdf'])
def test_drake(kind: str, tmp_path: Path) -> None:
    """Drake has a gravity of its own; its legs are actuators in the order of the file."""
    plants = pytest.importorskip('pydrake.multibody.plant')
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.tree import JointActuatorIndex
    from pydrake.systems.analysis import Simulator

    file = tmp_path / f'hexapod.{kind}'
    file.write_text((sdf if kind == 'sdf' else mjcf)(Hexapod(P), 'hexapod'))
    plant = plants.MultibodyPlant(STEP)
    plant.set_discrete_contact_approximation(plants.DiscreteContactApproximation.kSap)
    Parser(plant).AddModels(str(file))
    plant.mutable_gravity_field().set_gravity_vector(P['gravity'])
    plant.Finalize()
    context = plant.CreateDefaultContext()
    names = [plant.get_joint_actuator(JointActuatorIndex(n)).joint().name()
             for n in range(plant.num_actuators())]
    plant.get_actuation_input_port().FixValue(
        context, np.array([FORCES[LEGS.index(name)] for name in names]))
    simulator = Simulator(plant, context)
    simulator.Initialize()
    simulator.AdvanceTo(STEP)
    velocity = plant.EvalBodySpatialVelocityInWorld(
        simulator.get_context(), plant.GetBodyByName('platform'))
    check(f'Drake, {"SDF" if kind == "sdf" else "MJCF"}', np.concatenate(
        [velocity.translational(), velocity.rotational()]) / STEP)


@pytest.mark.parametrize('solid', [False, True])
def test_pybullet(solid: bool, tmp_path: Path) -> None:
    """Its loops are closed by constraints between pistons and the frames on the platform."""
    bullet = pytest.importorskip('pybullet')
    file = tmp_path / 'hexapod.urdf'
    file.write_text(urdf(Hexapod(P), 'hexapod', solid=solid))
    bullet.connect(bullet.DIRECT)
    try:
        bullet.setGravity(*P['gravity'])
        bullet.setTimeStep(STEP)
        bullet.setPhysicsEngineParameter(numSolverIterations=2000, solverResidualThreshold=1e-20)
        robot = bullet.loadURDF(str(file), useFixedBase=True,
                                flags=bullet.URDF_USE_INERTIA_FROM_FILE)
        of_joints = [bullet.getJointInfo(robot, n) for n in range(bullet.getNumJoints(robot))]
        joints = {each[1].decode(): each[0] for each in of_joints}
        links = {each[12].decode(): each[0] for each in of_joints}
        for n in range(-1, len(of_joints)):
            bullet.changeDynamics(robot, n, linearDamping=0, angularDamping=0, jointDamping=0)
            if n >= 0 and of_joints[n][2] != bullet.JOINT_FIXED:
                bullet.setJointMotorControl2(robot, n, bullet.VELOCITY_CONTROL, force=0)
        for axis, at in zip('xyz', HOME.position, strict=True):
            bullet.resetJointState(robot, joints[f'platform_{axis}'], at)
        lengths = StewartPlatform(P).inverse_kinematics(HOME) - P['geometry.zero_length']
        for leg, at, force in zip(LEGS, lengths, FORCES, strict=True):
            bullet.resetJointState(robot, joints[leg], at)
            piston = links[f'{leg}_piston']
            center = bullet.getDynamicsInfo(robot, piston)[3]  # constraints count from it
            closing = bullet.createConstraint(
                robot, piston, robot, links[f'{leg}_platform_joint'], bullet.JOINT_POINT2POINT,
                [0, 0, 0], [-x for x in center], [0, 0, 0])
            bullet.changeConstraint(closing, maxForce=1e9)
            bullet.setJointMotorControl2(robot, joints[leg], bullet.TORQUE_CONTROL, force=force)
        bullet.stepSimulation()
        found = [bullet.getJointState(robot, joints[f'platform_{axis}'])[1] / STEP
                 for axis in ('x', 'y', 'z', 'roll', 'pitch', 'yaw')]
    finally:
        bullet.disconnect()
    check('PyBullet', found, reflected=False)


def placed(matrix: Any) -> Array:
    return np.asarray(matrix, float)[:3, 3]


@pytest.mark.parametrize('reader', ['yourdfpy', 'urchin', 'pytransform3d'])
def test_readers_of_the_urdf(reader: str, tmp_path: Path) -> None:
    """They place the ends of the legs where the platform is at home, and know no other mass."""
    pytest.importorskip(reader)
    file = tmp_path / 'platform.urdf'
    text = re.sub(r'<(visual|collision)>.*?</\1>', '', urdf(Hexapod(P), 'platform'),
                  flags=re.DOTALL)
    file.write_text(text)
    positions = dict(zip(('platform_x', 'platform_y', 'platform_z'), HOME.position, strict=True))
    positions |= dict(zip(LEGS, StewartPlatform(P).inverse_kinematics(HOME)
                          - P['geometry.zero_length'], strict=True))
    tip, ball = 'leg_2_piston', 'leg_2_platform_joint'
    if reader == 'yourdfpy':
        import yourdfpy
        robot = yourdfpy.URDF.load(str(file))
        robot.update_cfg(positions)
        ends = [placed(robot.get_transform(link, 'base')) for link in (tip, ball)]
        assert sum(link.inertial.mass for link in robot.robot.links) == pytest.approx(258.0)
    elif reader == 'urchin':
        import urchin
        robot = urchin.URDF.load(str(file))
        found = robot.link_fk(cfg=positions, use_names=True)
        ends = [placed(found[link]) for link in (tip, ball)]
        assert sum(link.inertial.mass for link in robot.links) == pytest.approx(258.0)
    else:
        from pytransform3d.urdf import UrdfTransformManager
        robot = UrdfTransformManager()
        robot.load_urdf(text)
        for name, value in positions.items():
            robot.set_joint(name, value)
        ends = [placed(robot.get_transform(link, 'base')) for link in (tip, ball)]
    expected = HOME.position + P['geometry.platform_joints'][1]
    for end in ends:
        assert end == pytest.approx(expected, abs=1e-9)
