# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""A hexapod with cranks by Pinocchio: the tree cut at the platform's joints, and virtual work."""

from __future__ import annotations

from dataclasses import replace

from crank_newton_euler import Answer, Array, CrankHexapod, friction, State
import numpy as np
from scipy.optimize import brentq

CRANKS = 6 + 4 * np.arange(6)  # velocities of the tree: 6 of the base, 4 a leg, 6 of the platform


class CrankPinocchio:
    """
    Results of inverse and forward dynamics by the recursive algorithms of Pinocchio.

    The base has a joint with six freedoms, whose motion is prescribed, with a velocity that must
    not matter; on it six cranks with revolute joints, on these the rods with balls, and the
    platform on a joint of its own with six freedoms. Frame Jacobians of the rods' ends give the
    joint rates of a twist of the platform; rods do not spin against their cranks. Virtual work
    of these rates gives the torques, the balance of each cut leg the forces of its rod. Angles
    are found by Brent's method, between those where the crank's ball is nearest to the platform
    joint and farthest from it.
    """

    def __init__(self, machine: CrankHexapod, base_velocity: Array) -> None:
        import pinocchio as pin  # type: ignore[import-untyped]

        self._pin, self._machine, self._base_velocity = pin, machine, base_velocity
        self._model = model = pin.Model()
        base = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), 'base')
        self._balls, self._tips = [], []
        for i in range(6):
            z, u = machine.zero[i], machine.axis[i]
            motor = pin.SE3(np.column_stack([z, np.cross(u, z), u]), machine.center[i])
            crank = model.addJoint(base, pin.JointModelRZ(), motor, f'crank {i}')
            end = pin.SE3(np.eye(3), np.array([machine.crank[i], 0.0, 0.0]))
            ball = model.addJoint(crank, pin.JointModelSpherical(), end, f'rod {i}')
            model.appendBodyToJoint(crank, pin.Inertia(
                machine.mc[i], machine.cc[i], machine.Ic[i]), pin.SE3.Identity())
            model.appendBodyToJoint(ball, pin.Inertia(
                machine.mr[i], np.array([0.0, 0.0, machine.sr[i]]),
                np.diag([machine.Ir[i], machine.Ir[i], 0.0])), pin.SE3.Identity())
            self._tips.append(model.addFrame(pin.Frame(
                f'tip {i}', ball, 0, pin.SE3(np.eye(3), np.array([0.0, 0.0, machine.rod[i]])),
                pin.FrameType.OP_FRAME)))
            self._balls.append(ball)
        platform = model.addJoint(base, pin.JointModelFreeFlyer(), pin.SE3.Identity(), 'platform')
        model.appendBodyToJoint(
            platform, pin.Inertia(machine.m, machine.c, machine.I), pin.SE3.Identity())
        self._data = model.createData()

    def _angle(self, i: int, at_platform: Array) -> float:
        """Return the angle of a crank whose rod ends at a point."""
        pin, machine = self._pin, self._machine
        z, u = machine.zero[i], machine.axis[i]
        arm = at_platform - machine.center[i]

        def excess(q: float) -> float:
            return float(np.linalg.norm(arm - machine.crank[i] * (pin.exp3(q * u) @ z))
                         - machine.rod[i])

        nearest = float(np.arctan2(arm @ np.cross(u, z), arm @ z))
        farthest = nearest - np.pi * float(machine.branch[i])
        q = float(brentq(excess, *sorted((nearest, farthest)), xtol=1e-15, rtol=1e-15))
        return q - 2.0 * np.pi * float(np.round((q - machine.middle[i]) / (2.0 * np.pi)))

    def _place(self, state: State) -> tuple[Array, Array, Array]:
        """Return positions, Jacobians of the rods' ends (6, 3, 4), and joint rates per twist."""
        pin, machine, model, data = self._pin, self._machine, self._model, self._data
        arms = machine.P @ state.R.T
        q = pin.neutral(model)
        for i, leg in enumerate(q[7:37].reshape(6, 5)):
            z, u = machine.zero[i], machine.axis[i]
            leg[0] = self._angle(i, state.t + arms[i])
            turn = pin.exp3(leg[0] * u)
            rod = state.t + arms[i] - machine.center[i] - machine.crank[i] * turn @ z
            along = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), rod).matrix()
            crank = turn @ np.column_stack([z, np.cross(u, z), u])
            leg[1:] = pin.Quaternion(crank.T @ along).coeffs()
        q[37:40], q[40:44] = state.t, pin.Quaternion(state.R).coeffs()
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        tips = np.array([pin.getFrameJacobian(model, data, tip, pin.LOCAL_WORLD_ALIGNED)[
            :3, CRANKS[i]:CRANKS[i] + 4] for i, tip in enumerate(self._tips)])
        per_twist = np.zeros((model.nv, 6))
        for i in range(6):
            per_twist[CRANKS[i]:CRANKS[i] + 4] = _without_spin(
                tips[i], np.hstack([np.eye(3), -pin.skew(arms[i])]))
        per_twist[30:33, :3] = per_twist[33:36, 3:] = state.R.T
        return q, tips, per_twist

    def _move(self, state: State, q: Array, tips: Array, per_twist: Array,
              ) -> tuple[Array, Array]:
        """Return velocities and accelerations of the tree."""
        pin, machine, model, data = self._pin, self._machine, self._model, self._data
        velocity = per_twist @ np.hstack([state.v, state.w])
        acceleration = np.zeros(model.nv)
        pin.forwardKinematics(model, data, q, velocity, acceleration)
        for i, arm in enumerate(machine.P @ state.R.T):
            drift = pin.getFrameClassicalAcceleration(
                model, data, self._tips[i], pin.LOCAL_WORLD_ALIGNED).linear
            acceleration[CRANKS[i]:CRANKS[i] + 4] = _without_spin(
                tips[i], state.a + np.cross(state.al, arm)
                + np.cross(state.w, np.cross(state.w, arm)) - drift)
        # Pinocchio's acceleration is the time derivative of the numbers of the velocity.
        acceleration[30:33] = state.R.T @ (state.a - np.cross(state.w, state.v))
        acceleration[33:36] = state.R.T @ state.al
        if state.base is not None:
            velocity[:3], velocity[3:6] = self._base_velocity, state.base.w
            acceleration[:3] = state.base.a - np.cross(state.base.w, self._base_velocity)
            acceleration[3:6] = state.base.al
        return velocity, acceleration

    def inverse_dynamics(self, state: State) -> Answer:
        """Return angles, torques, forces of the rods and wrench on the base of a state."""
        pin, machine, model, data = self._pin, self._machine, self._model, self._data
        q, tips, per_twist = self._place(state)
        velocity, acceleration = self._move(state, q, tips, per_twist)
        model.gravity.linear = machine.g if state.base is None else state.base.g
        tree = pin.rnea(model, data, q, velocity, acceleration)
        shaft = np.linalg.solve(
            per_twist[CRANKS].T, per_twist.T @ tree - state.wrench)

        on_platform, on_rod, rods = np.empty((3, 6, 3))
        for i, ball in enumerate(self._balls):
            # The cut leg is balanced by its torque and by the force of the platform at its end.
            lack = tree[CRANKS[i]:CRANKS[i] + 4] - [shaft[i], 0.0, 0.0, 0.0]
            on_platform[i] = -np.linalg.lstsq(tips[i].T, lack, rcond=1e-12)[0]
            pose = data.oMi[ball].rotation
            on_rod[i], rods[i] = pose @ data.f[ball].linear + on_platform[i], pose[:, 2]

        rates, accelerations = velocity[CRANKS], acceleration[CRANKS]
        arms = machine.P @ state.R.T
        lever = np.einsum('ki,ki->k', rods, tips[:, :, 0])
        determinant = float(np.linalg.det(np.hstack([rods, np.cross(arms, rods)])))
        wrench = np.hstack([
            state.wrench[:3], state.wrench[3:] + np.cross(state.t, state.wrench[:3])])
        return Answer(
            q[7:37:5], rates, accelerations,
            shaft + machine.J * accelerations + friction(machine, rates), shaft,
            np.sum(rods * on_platform, axis=-1), np.sum(rods * on_rod, axis=-1),
            on_platform, on_rod, lever, determinant,
            float(np.linalg.det(per_twist[CRANKS])), wrench - tree[:6])

    def forward_dynamics(self, state: State, torques: Array) -> Array:
        """Return the acceleration (6,) of the platform under torques."""
        pin, machine = self._pin, self._machine
        still = replace(state, a=np.zeros(3), al=np.zeros(3))
        lack = torques - self.inverse_dynamics(still).torques
        q, _, per_twist = self._place(state)
        tree = pin.crba(self._model, self._data, q)
        tree = np.triu(tree) + np.triu(tree, 1).T
        rows = per_twist[CRANKS]
        mass = per_twist.T @ tree @ per_twist + rows.T @ (machine.J[:, None] * rows)
        found: Array = np.linalg.solve(mass, rows.T @ lack)
        return found


def _without_spin(tip: Array, of_tip: Array) -> Array:
    """Return rates of crank and rod that give its end a velocity, without spin of the rod."""
    found: Array = np.linalg.solve(
        np.vstack([tip, [0.0, 0.0, 0.0, 1.0]]),
        np.concatenate([of_tip, np.zeros((1, *of_tip.shape[1:]))]))
    return found
