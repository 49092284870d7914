# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The MJCF in MuJoCo: it is accepted, its loops are closed, and its leg forces are the same."""

from pathlib import Path
from typing import Any

from legs_of_all_kinds import efforts_of, KINDS, random_hexapod
import numpy as np
import pytest
from referees import (
    Array, each_relative, random_motion, random_parameters, relative, rng, smooth_motion)

from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.description.mjcf import mjcf, scene
from stewart_dynamics.mechanics.kinematics.leg_joints import TreeJoints

mujoco = pytest.importorskip('mujoco')

PLATFORM = Path(__file__).parents[1] / 'config' / 'platform.yaml'
SOFT = 1e-2  # of the largest acceleration
STATIC, MOVING = 1e-3, 5e-3  # parts of the largest force, as the documents promise


def sharp(p: Parameters) -> Parameters:
    """Return parameters whose Coulomb friction jumps at rest, nearly as dry friction in MuJoCo."""
    return p.replaced({'actuator.coulomb_velocity': 1e-3})


class Simulation:
    """A hexapod in MuJoCo, by its MJCF alone."""

    def __init__(self, p: Parameters) -> None:
        self.p = p
        self.model = mujoco.MjModel.from_xml_string(mjcf(Hexapod(p), 'hexapod'))
        self.data = mujoco.MjData(self.model)
        self._joints = TreeJoints(p)
        first = self._joints.names.index(p['joints'][0]) - 6
        self.legs = slice(first, 18, 3)  # the drives among the coordinates of the legs

    def place(self, motion: Motion) -> Array:
        """Set pose and twist; return the rates of all coordinates (24, 6) of a platform twist."""
        data = self.data
        data.qpos[:18] = self._joints.positions(motion.position, motion.rotation)[6:]
        data.qpos[18:21] = motion.position
        data.qpos[21:25] = np.roll(motion.quaternion, 1)
        data.qvel[:] = 0.0
        mujoco.mj_forward(self.model, data)
        loops = self._loops()
        freedoms = np.vstack([-np.linalg.solve(loops[:, :18], loops[:, 18:]), np.eye(6)])
        # A free joint's angular velocity is in axes of the body.
        freedoms[:, 3:] = freedoms[:, 3:] @ motion.rotation.T
        data.qvel[:] = freedoms @ np.concatenate([motion.linear_velocity,
                                                  motion.angular_velocity])
        mujoco.mj_forward(self.model, data)
        return freedoms

    def _loops(self) -> Array:
        """Return the Jacobian (18, 24) of the gaps at the platform joints."""
        rows = self.data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        return self.data.efc_J.reshape(-1, self.model.nv)[rows].copy()

    def _drift(self) -> Array:
        """Return the accelerations (18,) of the gaps at accelerations of zero."""
        model, data, step = self.model, self.data, 1e-4
        q, v, drift = data.qpos.copy(), data.qvel.copy(), np.zeros(18)
        # The first derivative by four differences, of fourth order.
        for steps, part in ((1, 8.0), (-1, -8.0), (2, -1.0), (-2, 1.0)):
            data.qpos[:] = q
            mujoco.mj_integratePos(model, data.qpos, v, steps * step)
            mujoco.mj_forward(model, data)
            drift += part / (12.0 * step) * self._loops() @ v
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        return drift

    def projected_acceleration(self, motion: Motion, efforts: Array) -> Array:
        """Return the platform's acceleration (6,): MuJoCo's mass matrix, loops exactly closed."""
        model, data = self.model, self.data
        freedoms = self.place(motion)
        drift, loops = self._drift(), self._loops()
        v = data.qvel.copy()
        mass = np.empty((model.nv, model.nv))
        for column, one in enumerate(np.eye(model.nv)):
            mujoco.mj_mulM(model, data, mass[column], one)
        applied = data.qfrc_passive - data.qfrc_bias
        sliding = self.p['actuator.coulomb_friction'] * np.sign(v[self.legs])
        applied[self.legs] += efforts - sliding
        # Accelerations that keep the loops closed while the platform's own are zero.
        of_drift = np.concatenate([-np.linalg.solve(loops[:, :18], drift), np.zeros(6)])
        found: Array = np.linalg.solve(freedoms.T @ mass @ freedoms,
                                       freedoms.T @ (applied - mass @ of_drift))
        return found

    def soft_acceleration(self, motion: Motion, efforts: Array) -> Array:
        """Return the platform's acceleration (6,) as MuJoCo's own solver has it."""
        self.place(motion)
        self.data.ctrl[:] = efforts
        mujoco.mj_forward(self.model, self.data)
        own: Array = self.data.qacc[18:24].copy()
        own[3:] = motion.rotation @ own[3:]
        return own

    def projected_forces(self, motion: Motion) -> Array:
        """Return leg forces: MuJoCo's inverse dynamics of the tree, its loops by virtual work."""
        model, data = self.model, self.data
        freedoms = self.place(motion)
        drift, v, loops = self._drift(), data.qvel.copy(), self._loops()
        own = np.concatenate([motion.linear_acceleration,
                              motion.rotation.T @ motion.angular_acceleration])
        of_legs = np.linalg.solve(loops[:, :18], -drift - loops[:, 18:] @ own)
        data.qacc[:] = np.concatenate([of_legs, own])
        flags = model.opt.disableflags
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        mujoco.mj_inverse(model, data)
        model.opt.disableflags = flags
        pushes = np.linalg.solve(freedoms[self.legs].T, freedoms.T @ data.qfrc_inverse)
        sliding: Array = pushes + self.p['actuator.coulomb_friction'] * np.sign(v[self.legs])
        return sliding

    def follow(self, motions: Motion) -> tuple[Motion, Array, Array]:
        """
        Simulate under the forces of the motions and a controller of the legs, step by step.

        Return what the platform did, with its accelerations, the forces of its motors, and
        the rates of the legs.
        """
        p, model, data = self.p, self.model, self.data
        planned = StewartPlatform(p).inverse_dynamics(motions)
        positions = planned.lengths - p['geometry.zero_length']
        stiffness = (2.0 * np.pi * 8.0) ** 2 * (
            p['platform.mass'] / 6.0 + p['legs.piston.mass'] + p['actuator.reflected_mass'])
        damping = stiffness / (np.pi * 8.0)
        self.place(motions[0])
        rows: list[Any] = []
        forces, rates = [], []
        for n in range(len(motions)):
            data.ctrl[:] = (planned.forces[n] + stiffness * (positions[n] - data.qpos[self.legs])
                            + damping * (planned.rates[n] - data.qvel[self.legs]))
            mujoco.mj_step1(model, data)
            state = data.qpos[18:25].copy(), data.qvel[18:24].copy()
            rates.append(data.qvel[self.legs].copy())
            mujoco.mj_step2(model, data)
            rows.append((*state, data.qacc[18:24].copy()))
            forces.append(data.actuator_force.copy())
        poses, twists, accelerations = (np.array(each) for each in zip(*rows, strict=True))
        pose = Motion.from_quaternion(poses[:, :3], np.roll(poses[:, 3:], -1, axis=1))
        r = pose.rotation
        done = Motion(pose.position, r, twists[:, :3],
                      np.einsum('nij,nj->ni', r, twists[:, 3:]), accelerations[:, :3],
                      np.einsum('nij,nj->ni', r, accelerations[:, 3:]))
        return done, np.array(forces), np.array(rates)


def test_the_model_begins_at_the_home_pose_with_closed_loops_and_the_names_of_the_parameters():
    p = Parameters.from_yaml(PLATFORM)
    model = mujoco.MjModel.from_xml_string(mjcf(Hexapod(p), 'hexapod'))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    home = StewartPlatform(p).home_pose()
    assert data.body('platform').xpos == pytest.approx(home.position, abs=1e-15)
    assert data.body('base').xpos == pytest.approx([0.0, 0.0, 0.0])
    for leg in p['joints']:
        assert data.site(f'{leg}_tip').xpos == pytest.approx(
            data.site(f'{leg}_platform_joint').xpos, abs=1e-14)
    lengths = StewartPlatform(p).inverse_kinematics(home)
    assert tuple(model.actuator(n).name for n in range(6)) == p['joints']
    assert data.sensordata[:6] == pytest.approx(lengths, abs=1e-14)
    assert tuple(model.sensor(n).name for n in (0, 6, 12)) == (
        'leg_1_length', 'leg_1_rate', 'leg_1_force')
    for n, leg in enumerate(p['joints']):
        assert data.joint(leg).qpos[0] == pytest.approx(lengths[n] - 0.95, abs=1e-14)
        assert model.joint(leg).range == pytest.approx([0.0, 0.7])
        assert model.joint(leg).armature[0] == 30.0
    assert model.actuator_ctrlrange == pytest.approx(np.tile([-6000.0, 6000.0], (6, 1)))
    assert model.opt.gravity == pytest.approx(p['gravity'])


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('seed', range(3))
def test_efforts_by_mujocos_inverse_dynamics_are_the_same(seed, kind):
    p, motions = random_hexapod(kind, seed, 20)
    p = sharp(p)
    simulation = Simulation(p)
    forces = efforts_of(p, motions)
    assert each_relative(
        [simulation.projected_forces(motion) for motion in motions], forces) < 1e-7


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('seed', range(3))
def test_accelerations_by_mujocos_dynamics_with_closed_loops_are_the_same(seed, kind):
    p, motions = random_hexapod(kind, seed, 20)
    p = sharp(p)
    platform, simulation = StewartPlatform(p), Simulation(p)
    # The model has no inertia of legs about their own axes: the written one changes accelerations
    # of fast cranks by up to 2e-6.
    for part in (leg.last for leg in Hexapod(p).legs):
        moments = simulation.model.body_inertia[simulation.model.body(part).id]
        moments[np.argmin(moments)] *= 1e-3
    efforts = rng(seed).uniform(-2.0, 2.0, (20, 6)) * np.abs(efforts_of(p, motions))
    found = [simulation.projected_acceleration(motion, effort)
             for motion, effort in zip(motions, efforts, strict=True)]
    truth = platform.forward_dynamics(motions, efforts).rows[:, 18:]
    assert each_relative(found, truth) < 1e-6


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('seed', range(3))
def test_accelerations_by_mujocos_soft_constraints_differ_by_their_softness(seed, kind):
    """The impedance of a constraint is at most 0.9999 in MuJoCo, whatever a file says."""
    p, motions = random_hexapod(kind, seed, 20)
    p = p.replaced({'actuator.coulomb_friction': 0.0, 'limits.force_max': None})
    simulation = Simulation(p)
    efforts = rng(seed).uniform(-2.0, 2.0, (20, 6)) * np.abs(efforts_of(p, motions))
    found = [simulation.soft_acceleration(motion, effort)
             for motion, effort in zip(motions, efforts, strict=True)]
    truth = StewartPlatform(p).forward_dynamics(motions, efforts).rows[:, 18:]
    assert 1e-6 < each_relative(found, truth) < SOFT


@pytest.mark.parametrize('seed', range(3))
def test_legs_that_hold_poses_in_mujoco_have_the_forces_of_statics(seed):
    p = random_parameters(rng(seed), actuators=False)
    poses, simulation = random_motion(p, rng(seed), 10), Simulation(p)
    for pose in poses:
        still = Motion(np.repeat(pose.position[None], 400, axis=0), pose.rotation)
        done, forces, _ = simulation.follow(still)
        statics = StewartPlatform(p).inverse_dynamics(
            Motion(done.position[-1], done.rotation[-1])).forces
        assert relative(forces[-1], statics) < STATIC


@pytest.mark.parametrize('seed', range(3))
@pytest.mark.parametrize('actuators', [True, False], ids=['actuators', 'no_actuators'])
def test_motions_in_mujoco_need_the_forces_of_inverse_dynamics(seed, actuators):
    p = sharp(random_parameters(rng(seed), actuators))
    simulation = Simulation(p)
    times = np.arange(2000) * simulation.model.opt.timestep
    done, forces, rates = simulation.follow(smooth_motion(p, rng(seed))(times))
    truth = StewartPlatform(p).inverse_dynamics(done).forces
    # Coulomb friction changes its sign within 1 mm/s here, and otherwise in MuJoCo.
    sliding = np.abs(rates).min(axis=1) > (0.01 if actuators else 0.0)
    assert np.mean(sliding) > 0.7
    assert relative(forces[sliding], truth[sliding]) < MOVING


def test_legs_without_mass_are_given_one_that_changes_forces_by_less_than_their_tolerance():
    given = random_parameters(rng(0), actuators=False).given
    p = Parameters({name: value for name, value in given.items() if not name.startswith('legs.')})
    simulation = Simulation(p)
    times = np.arange(1000) * simulation.model.opt.timestep
    done, forces, _ = simulation.follow(smooth_motion(p, rng(0))(times))
    truth = StewartPlatform(p).inverse_dynamics(done).forces
    assert relative(forces, truth) < 1e-3
    assert simulation.model.body('leg_1_piston').mass[0] == pytest.approx(
        1e-4 * p['platform.mass'])


def test_meshes_with_a_uri_do_not_keep_mujoco_from_loading():
    p = Parameters.from_yaml(PLATFORM).replaced({
        'meshes.platform': 'package://my_hexapod/top.stl', 'meshes.piston': 'rod.obj'})
    text = mjcf(Hexapod(p), 'hexapod')
    assert 'package:' not in text
    triangle = b'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n'
    model = mujoco.MjModel.from_xml_string(text, {'rod.obj': triangle})
    assert model.nmesh == 1
    assert model.body('leg_1_piston').mass[0] == 6.0


def test_a_scene_around_it_starts_at_home_with_groups_as_in_menagerie(tmp_path):
    for p in (Parameters.from_yaml(PLATFORM), Parameters.from_yaml(PLATFORM).replaced(
            {'gravity': [0.0, 9.81, 0.0]})):
        hexapod = Hexapod(p)
        (tmp_path / 'hexapod.xml').write_text(mjcf(hexapod, 'hexapod'))
        (tmp_path / 'scene.xml').write_text(scene(hexapod, 'hexapod'))
        model = mujoco.MjModel.from_xml_path(str(tmp_path / 'scene.xml'))
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, model.key('home').id)
        assert data.qpos == pytest.approx(model.qpos0, abs=1e-14)
        mujoco.mj_forward(model, data)
        # Nothing touches the floor, which is across gravity.
        assert data.ncon == 0
        floor = data.geom('floor').xmat.reshape(3, 3)[:, 2]
        assert floor @ p['gravity'] == pytest.approx(-np.linalg.norm(p['gravity']))
    geoms = [model.geom(n) for n in range(model.ngeom) if model.geom(n).name != 'floor']
    assert {int(each.group[0]) for each in geoms} == {2, 3}
    for each in geoms:
        assert bool(each.contype[0]) == (each.group[0] == 3)
