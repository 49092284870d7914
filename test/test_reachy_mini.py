# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The head of Reachy Mini, as Pollen Robotics describes it (pollen-robotics/reachy_mini, Apache-2.0).

No file of it is here: STEWART_REACHY_MINI names its folder ``descriptions/reachy_mini``.
"""

from __future__ import annotations

import os
from pathlib import Path
import re
import textwrap
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from referees import Array, random_direction, rng, ROOT, rotation_about
from stewart_dynamics import Motion, StewartPlatform
from stewart_dynamics.description import main as describe
from stewart_dynamics.description.formats import read_hexapod

pin = pytest.importorskip('pinocchio')
pytestmark = pytest.mark.skipif('STEWART_REACHY_MINI' not in os.environ,
                                reason='needs the folder STEWART_REACHY_MINI')
FOLDER = Path(os.environ.get('STEWART_REACHY_MINI', ''))
URDF, MJCF = FOLDER / 'urdf' / 'robot.urdf', FOLDER / 'mjcf' / 'reachy_mini.xml'

# Parts of the largest torque, at rest and in motion. Their rods have a center of mass up to 35 nm
# off the line of the joints, and transverse moments that differ by 0.35 %; dummies have 1e-9 kg.
AS_IT_IS, AS_LINES = (1e-6, 3e-5), (1e-9, 1e-9)
DUMMY = 1e-6  # [kg]
MOVING = 'yaw_body', 'right_antenna', 'left_antenna'  # joints that do not move here
AXES = pin.LOCAL_WORLD_ALIGNED


class Model:
    """Their URDF in Pinocchio, its loops closed by constraints between frames of equal names."""

    def __init__(self, as_lines: bool) -> None:
        root = ET.parse(URDF).getroot()
        if as_lines:
            for link in root.iter('link'):
                own = link.find('inertial')
                if own is not None and float(own.find('mass').get('value')) < DUMMY:
                    link.remove(own)
        self.model = model = pin.buildModelFromXML(ET.tostring(root, encoding='unicode'))
        for n in range(1, 7) if as_lines else ():
            self._make_line(n)
        self.data = model.createData()
        self.base, self.head = (model.getFrameId(name) for name in ('body_down_3dprint', 'xl_330'))
        joints = [model.joints[model.getJointId(f'stewart_{n}')] for n in range(1, 7)]
        self.angles, self.drives = ([getattr(joint, name) for joint in joints]
                                    for name in ('idx_q', 'idx_v'))
        self.loops = [[model.getFrameId(f'closing_{n}_{end}') for end in (1, 2)]
                      for n in range(1, 6)]
        still = {model.joints[model.getJointId(name)].idx_v for name in MOVING}
        self.free = [n for n in range(model.nv) if n not in still]

    def _make_line(self, n: int) -> None:
        """Give a rod a center of mass and moments of inertia that are those of a line."""
        model = self.model
        rod = model.getJointId(f'passive_{n}_z')
        end = (model.jointPlacements[model.getJointId('passive_7_x')] if n == 6 else
               model.frames[model.getFrameId(f'closing_{n}_1')].placement).translation
        line, body = end / np.linalg.norm(end), model.inertias[rod]
        across = 0.5 * (np.trace(body.inertia) - line @ body.inertia @ line)
        model.inertias[rod] = pin.Inertia(
            body.mass, (body.lever @ line) * line, across * (np.eye(3) - np.outer(line, line)))

    def place_platform(self, joints: Array) -> None:
        """Find the frame of the platform on the head, by its joints (6, 3)."""
        pin.framesForwardKinematics(self.model, self.data, pin.neutral(self.model))
        head = self.data.oMf[self.head]
        on_head = np.array([head.actInv(self.data.oMf[frame].translation)
                            for _, frame in self.loops] + [np.zeros(3)])
        around, at = (each - each.mean(axis=0) for each in (joints, on_head))
        left, _, right = np.linalg.svd(at.T @ around)
        turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
        self.platform = pin.SE3(turn, on_head.mean(axis=0) - turn @ joints.mean(axis=0))
        assert max(np.linalg.norm(self.platform.act(joint) - point)
                   for joint, point in zip(joints, on_head, strict=True)) < 1e-12

    def _jacobians(self, q: Array) -> tuple[Array, Any]:
        """Return rows of five gaps and of the platform's twist (21, free), and the head's arm."""
        model, data = self.model, self.data
        pin.framesForwardKinematics(model, data, q)
        pin.computeJointJacobians(model, data, q)
        rows = [pin.getFrameJacobian(model, data, first, AXES)[:3]
                - pin.getFrameJacobian(model, data, second, AXES)[:3]
                for first, second in self.loops]
        head = pin.getFrameJacobian(model, data, self.head, AXES).copy()
        arm = data.oMf[self.head].rotation @ self.platform.translation
        head[:3] -= pin.skew(arm) @ head[3:]
        return np.vstack([*rows, head])[:, self.free], arm

    def _lifted(self, rows: Array, rates: Array) -> Array:
        """Return the smallest rates of all joints; rods may spin about their lines."""
        found = np.zeros(self.model.nv)
        found[self.free] = np.linalg.lstsq(rows, rates, rcond=1e-12)[0]
        return found

    def closed(self, motion: Motion) -> Array:
        """Return the positions of the joints, by Newton's method from those of the file."""
        data, q = self.data, pin.neutral(self.model)
        for _ in range(60):
            rows, _ = self._jacobians(q)
            goal = data.oMf[self.base] * pin.SE3(motion.rotation, motion.position)
            now = data.oMf[self.head] * self.platform
            gaps = [data.oMf[first].translation - data.oMf[second].translation
                    for first, second in self.loops]
            lack = np.concatenate([*gaps, now.translation - goal.translation,
                                   pin.log3(now.rotation @ goal.rotation.T)])
            step = -self._lifted(rows, lack)
            q = pin.integrate(self.model, q, step / max(1.0, 2.0 * np.abs(step).max()))
            if np.abs(lack).max() < 1e-15:
                break
        assert np.abs(lack).max() < 1e-13
        return q

    def drives_of(self, motion: Motion) -> tuple[Array, Array]:
        """Return angles and torques (6,) of the drives: those of the tree, and virtual work."""
        model, data = self.model, self.data
        q = self.closed(motion)
        rows, arm = self._jacobians(q)
        turn = data.oMf[self.base].rotation
        twists = np.vstack([np.zeros((15, 6)), np.kron(np.eye(2), turn)])
        freedoms = np.column_stack([self._lifted(rows, each) for each in twists.T])
        v = freedoms @ np.concatenate([motion.linear_velocity, motion.angular_velocity])
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        drift = [pin.getFrameClassicalAcceleration(model, data, first, AXES).linear
                 - pin.getFrameClassicalAcceleration(model, data, second, AXES).linear
                 for first, second in self.loops]
        own = pin.getFrameClassicalAcceleration(model, data, self.head, AXES)
        w = pin.getFrameVelocity(model, data, self.head, AXES).angular
        own_linear = own.linear + np.cross(own.angular, arm) + np.cross(w, np.cross(w, arm))
        a = self._lifted(rows, np.concatenate([
            -np.concatenate(drift), turn @ motion.linear_acceleration - own_linear,
            turn @ motion.angular_acceleration - own.angular]))
        model.gravity.linear = np.array([0.0, 0.0, -9.80665])
        tau = pin.rnea(model, data, q, v, a)
        return q[self.angles], np.linalg.solve(freedoms[self.drives].T, freedoms.T @ tau)

    def gravity_compensation(self, motion: Motion) -> Array:
        """
        Return torques (6,) of the drives at rest by the formula of their gravity compensation.

        Torques of the tree as those of a wrench on the head, by the pseudo-inverse of the head's
        Jacobian; the drives carry this wrench. ``compute_gravity_torque`` in their
        ``kinematics/placo_kinematics.py``, written down here with Pinocchio.
        """
        model, data = self.model, self.data
        q = self.closed(motion)
        rows, _ = self._jacobians(q)
        model.gravity.linear = np.array([0.0, 0.0, -9.80665])
        tree = pin.computeGeneralizedGravity(model, data, q)
        head = pin.getFrameJacobian(model, data, self.head, AXES)
        wrench = np.linalg.pinv(head.T) @ tree
        driven = np.zeros((model.nv, 6))
        gaps = np.vstack([rows[:15], np.eye(len(self.free))[
            [self.free.index(drive) for drive in self.drives]]])
        unit = np.vstack([np.zeros((15, 6)), np.eye(6)])
        driven[self.free] = np.linalg.lstsq(gaps, unit, rcond=1e-12)[0]
        return (head @ driven).T @ wrench


def random_motions(count: int, moving: bool) -> list[Motion]:
    random, home = rng(0), np.array([0.0, 0.0, 0.1148])
    return [Motion(home + random.uniform(-0.008, 0.008, 3),
                   rotation_about(random_direction(random), random.uniform(0.0, 0.25)),
                   *(factor * random.uniform(-1.0, 1.0, 3) * moving
                     for factor in (0.1, 2.0, 2.0, 20.0))) for _ in range(count)]


@pytest.mark.parametrize('moving', [False, True])
@pytest.mark.parametrize(('as_lines', 'tolerances'), [(False, AS_IT_IS), (True, AS_LINES)])
def test_torques_of_their_urdf_are_those_of_pinocchio(as_lines, tolerances, moving):
    p = read_hexapod(URDF).parameters
    platform, model = StewartPlatform(p), Model(as_lines)
    model.place_platform(p['geometry.platform_joints'])
    for motion in random_motions(20, moving):
        found = platform.inverse_dynamics(motion)
        angles, torques = model.drives_of(motion)
        assert np.abs(found.angles - angles).max() < 1e-12
        assert np.abs(found.torques - torques).max() < (
            tolerances[moving] * np.abs(torques).max())


def test_their_mjcf_is_the_same_machine_with_its_own_drives():
    pytest.importorskip('mujoco')
    of_urdf, of_mjcf = (read_hexapod(path).parameters for path in (URDF, MJCF))
    assert of_mjcf['geometry.crank_branch'] == of_urdf['geometry.crank_branch'] == ('auto',)
    for name in ('geometry.base_joints', 'geometry.platform_joints', 'geometry.crank_axes',
                 'geometry.crank_directions', 'legs.crank.length', 'legs.rod.length',
                 'legs.crank.mass', 'legs.rod.mass', 'platform.mass', 'platform.center_of_mass',
                 'platform.inertia', 'limits.angle_min', 'limits.angle_max'):
        assert of_mjcf[name] == pytest.approx(of_urdf[name], rel=1e-5, abs=2e-5), name
    for name, value in (('actuator.reflected_inertia', 0.001), ('limits.torque_max', 20.0),
                        ('actuator.viscous_friction', 0.15), ('actuator.coulomb_friction', 0.1)):
        assert of_mjcf[name] == pytest.approx([value] * 6), name
    still = of_mjcf.replaced({'gravity': of_urdf['gravity']})
    for motion in random_motions(20, False):
        truth = StewartPlatform(of_urdf).inverse_dynamics(motion).torques
        found = StewartPlatform(still).inverse_dynamics(motion).torques
        assert np.abs(found - truth).max() < 1e-4 * np.abs(truth).max()


PAGE = ROOT / 'docs' / 'magic_number.md'


def test_the_commands_of_the_page_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    page = PAGE.read_text(encoding='utf-8')
    command = re.search('^    stewart_describe --from robot.urdf (.*)$', page, re.MULTILINE)[1]
    assert describe(['--from', str(URDF), *command.split()]) == 0
    lines = re.findall('^    (import numpy.*?)\n\n\\|', page, re.MULTILINE | re.DOTALL)[0]
    capsys.readouterr()
    exec(compile(textwrap.dedent('    ' + lines), 'magic_number.md', 'exec'), {})
    printed = np.array(capsys.readouterr().out.strip('[]\n ').split(), float)
    assert np.abs(printed - [21.13, -21.41, 22.59, -22.05, 23.36, -23.61]).max() < 0.02


def test_numbers_of_the_page_are_those_of_their_formula_and_of_the_package():
    """Torques at home, leg by leg, and how far the formula misses over 60 poses at rest."""
    hexapod = read_hexapod(URDF)
    platform, model = StewartPlatform(hexapod.parameters), Model(False)
    model.place_platform(hexapod.parameters['geometry.platform_joints'])
    page = PAGE.read_text(encoding='utf-8')
    home = Motion.from_pose(platform.forward_kinematics(
        0.62654 * np.tile([1.0, -1.0], 3)))
    torques, theirs = platform.inverse_dynamics(home).torques, model.gravity_compensation(home)
    for n in range(6):
        row = re.search(rf'\| stewart_{n + 1} \| (\S+) \| (\S+) \| (\S+) %', page)
        assert float(row[1]) == pytest.approx(1e3 * torques[n], abs=0.02)
        assert float(row[2]) == pytest.approx(1e3 * theirs[n], abs=0.02)
        assert float(row[3]) == pytest.approx(100.0 * (1.0 - theirs[n] / torques[n]), abs=0.15)
    missed = []
    for motion in random_motions(60, False):
        torques = platform.inverse_dynamics(motion).torques
        missed.append(np.abs(model.gravity_compensation(motion) - torques).max()
                      / np.abs(torques).max())
    median, worst = re.search(r'median (\S+) %, at the worst pose (\S+) %', page).groups()
    assert float(median) == pytest.approx(100.0 * np.median(missed), abs=0.06)
    assert float(worst) == pytest.approx(100.0 * max(missed), abs=0.06)
