# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
References for the tests: random hexapods and motions, and independent physics.

Nothing here uses the package's equations; only Parameters and Motion, which carry the numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics import BaseMotion, Motion, Parameters

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
PLATFORM = ROOT / 'config' / 'platform.yaml'
SEED = 20180926
STANDARD_GRAVITY = 9.80665


def rng(seed: int = SEED) -> np.random.Generator:
    """Return a generator of the same numbers every time."""
    return np.random.default_rng(seed)


def rotation_about(axis: Any, angle: float | Array) -> Array:
    """Return the turns by angles (...) about a unit axis (Rodrigues)."""
    x, y, z = axis
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angles = np.asarray(angle)[..., None, None]
    r: Array = np.eye(3) + np.sin(angles) * k + (1.0 - np.cos(angles)) * (k @ k)
    return r


def random_direction(random: np.random.Generator) -> Array:
    """Return a unit vector, every direction as likely as any."""
    v = random.normal(size=3)
    return v / np.linalg.norm(v)


def random_parameters(random: np.random.Generator, actuators: bool = True) -> Parameters:
    """
    Return a random hexapod.

    Six different legs, base joints off any plane, gravity tilted against the base, a center of
    mass off the platform's origin, a full inertia tensor, pistons balanced anywhere along them.
    """
    size = 10.0 ** random.uniform(-0.5, 0.5)

    def joints(radius: float, turn: float, spread: float) -> Array:
        angles = turn + np.repeat([0.0, 2.0, 4.0], 2) * np.pi / 3 + np.tile([-spread, spread], 3)
        angles = angles + random.uniform(-0.1, 0.1, 6)
        return radius * np.column_stack([
            np.cos(angles), np.sin(angles), random.uniform(-0.15, 0.15, 6)])

    base = size * joints(1.0, 0.0, 0.8)
    platform = size * joints(0.6, 0.0, 0.25)
    turn = rotation_about(random_direction(random), random.uniform(0.0, np.pi))
    inertia = turn @ np.diag(random.uniform(10.0, 18.0, 3)) @ turn.T * size ** 2
    gravity = rotation_about(random_direction(random), random.uniform(0.1, 1.0)) @ [
        0.0, 0.0, -STANDARD_GRAVITY]
    given = {
        'geometry.base_joints': base.ravel(), 'geometry.platform_joints': platform.ravel(),
        'platform.mass': random.uniform(50.0, 300.0),
        'platform.center_of_mass': size * random.uniform(-0.2, 0.2, 3),
        'platform.inertia': inertia[np.triu_indices(3)],
        'legs.cylinder.mass': random.uniform(5.0, 30.0, 6),
        'legs.cylinder.center_of_mass': size * random.uniform(0.1, 0.6, 6),
        'legs.cylinder.inertia': size ** 2 * random.uniform(0.1, 1.0, 6),
        'legs.piston.mass': random.uniform(2.0, 20.0, 6),
        'legs.piston.center_of_mass': size * random.choice([0.05, 0.1, 0.9, 1.0], 6),
        'legs.piston.inertia': size ** 2 * random.uniform(0.05, 0.5, 6),
        'gravity': gravity,
    }
    if actuators:
        given |= {'actuator.reflected_mass': random.uniform(1.0, 50.0, 6),
                  'actuator.viscous_friction': random.uniform(10.0, 500.0, 6),
                  'actuator.coulomb_friction': random.uniform(5.0, 100.0, 6),
                  'actuator.coulomb_velocity': 10.0 ** random.uniform(-3.5, -1.5, 6)}
    return Parameters(given)


def scaled(parameters: Parameters, size: float) -> Parameters:
    """Return a hexapod of another size of the same materials, without limits: alike in time."""
    def times(power: float, *names: str) -> dict[str, Array]:
        return {name: np.ravel(parameters[name]) * size ** power for name in names}

    return Parameters({
        **times(1.0, 'geometry.base_joints', 'geometry.platform_joints',
                'platform.center_of_mass', 'legs.cylinder.center_of_mass',
                'legs.piston.center_of_mass', 'geometry.zero_length'),
        **times(2.5, 'actuator.viscous_friction'),
        **times(3.0, 'legs.cylinder.mass', 'legs.piston.mass', 'actuator.reflected_mass',
                'actuator.coulomb_friction'),
        **times(5.0, 'platform.inertia', 'legs.cylinder.inertia', 'legs.piston.inertia'),
        'platform.mass': parameters['platform.mass'] * size ** 3,
        'gravity': parameters['gravity']})


def size_of(parameters: Parameters) -> float:
    """Return the mean distance of the base joints from their center [m]."""
    base = parameters['geometry.base_joints']
    return float(np.mean(np.linalg.norm(base - base.mean(axis=0), axis=1)))


def random_motion(parameters: Parameters, random: np.random.Generator, many: int) -> Motion:
    """Return poses around the hexapod's middle, with velocities and accelerations, a batch."""
    size = size_of(parameters)
    return Motion(
        size * (np.array([0.0, 0.0, 1.0]) + random.uniform(-0.2, 0.2, (many, 3))),
        [rotation_about(random_direction(random), random.uniform(0.0, 0.5))
         for _ in range(many)],
        size * random.uniform(-1.0, 1.0, (many, 3)), random.uniform(-2.0, 2.0, (many, 3)),
        size * random.uniform(-5.0, 5.0, (many, 3)), random.uniform(-10.0, 10.0, (many, 3)))


def random_base_motion(parameters: Parameters, random: np.random.Generator, many: int,
                       ) -> BaseMotion:
    """Return gravity of any direction, accelerations and turning, a batch."""
    size = size_of(parameters)
    return BaseMotion(
        [STANDARD_GRAVITY * random_direction(random) for _ in range(many)],
        size * random.uniform(-5.0, 5.0, (many, 3)), random.uniform(-2.0, 2.0, (many, 3)),
        random.uniform(-10.0, 10.0, (many, 3)))


def random_wrench(parameters: Parameters, random: np.random.Generator, many: int) -> Array:
    """Return forces and moments on the platform, (many, 6) [N, N m]."""
    size = size_of(parameters)
    return random.uniform(-500.0, 500.0, (many, 6)) * [1.0, 1.0, 1.0, size, size, size]


def symmetric_parameters() -> Parameters:
    """Return a hexapod of threefold symmetry: singular where turned by 90 degrees about z."""
    thirds = np.repeat([0.0, 2.0, 4.0], 2) * np.pi / 3

    def ring(radius: float, spread: float) -> Array:
        angles = thirds + np.tile([-spread, spread], 3)
        return radius * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(6)])

    return Parameters({
        'geometry.base_joints': ring(1.0, 0.9).ravel(),
        'geometry.platform_joints': ring(0.6, 0.2).ravel(),
        'platform.mass': 100.0, 'platform.inertia': [10.0, 0.0, 0.0, 10.0, 0.0, 16.0],
        'legs.cylinder.mass': 10.0, 'legs.cylinder.center_of_mass': 0.3,
        'legs.cylinder.inertia': 0.3, 'legs.piston.mass': 5.0,
        'legs.piston.center_of_mass': 0.3, 'legs.piston.inertia': 0.1})


QUARTER_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def smooth_motion(parameters: Parameters, random: np.random.Generator) -> Callable[[Any], Motion]:
    """Return a motion as a function of times, its derivatives those of its harmonics."""
    size = size_of(parameters)
    scale = np.array([0.1, 0.1, 0.1, 0.2, 0.2, 0.2]) * [size, size, size, 1.0, 1.0, 1.0]
    amplitudes = scale * random.uniform(0.3, 1.0, (3, 6))
    frequencies = random.uniform(1.0, 6.0, (3, 6))
    phases = random.uniform(0.0, 2.0 * np.pi, (3, 6))

    def at(times: Any) -> Motion:
        phase = frequencies * np.asarray(times, dtype=float)[..., None, None] + phases
        pose = np.sum(amplitudes * np.sin(phase), axis=-2)
        rate = np.sum(amplitudes * frequencies * np.cos(phase), axis=-2)
        acceleration = -np.sum(amplitudes * frequencies ** 2 * np.sin(phase), axis=-2)
        return Motion.from_euler(
            pose[..., :3] + [0.0, 0.0, size], pose[..., 3:], rate[..., :3], rate[..., 3:],
            acceleration[..., :3], acceleration[..., 3:])

    return at


def moved(motion: Motion, time: float) -> Motion:
    """Return the poses that the twists of a batch lead to in a time, were they constant."""
    rates = np.linalg.norm(motion.angular_velocity, axis=-1)
    turns = np.array([rotation_about(w / rate, rate * time)
                      for w, rate in zip(motion.angular_velocity, rates, strict=True)])
    return Motion(motion.position + time * motion.linear_velocity, turns @ motion.rotation,
                  motion.linear_velocity, motion.angular_velocity)


def derivative(function: Callable[[float], Any], step: float) -> Array:
    """Return a function's derivative at 0 by central differences of the fourth order."""
    near = np.asarray(function(step)) - np.asarray(function(-step))
    far = np.asarray(function(2.0 * step)) - np.asarray(function(-2.0 * step))
    d: Array = (8.0 * near - far) / (12.0 * step)
    return d


def relative(value: Any, truth: Any) -> float:
    """Return the largest difference from the truth, by the largest number of the truth."""
    return float(np.max(np.abs(np.asarray(value) - truth)) / np.max(np.abs(truth)))


def each_relative(value: Any, truth: Any) -> float:
    """Return the worst ``relative`` of a batch's samples."""
    return max(relative(v, t) for v, t in zip(value, truth, strict=True))


def _of_platform(p: Parameters, motion: Motion, gravity: Array) -> tuple[Array, Array]:
    """Return kinetic and potential energy of the platform in a batch (..., ) [J]."""
    r, w = motion.rotation, motion.angular_velocity
    arm = np.einsum('...ij,j->...i', r, p['platform.center_of_mass'])
    velocity = motion.linear_velocity + np.cross(w, arm)
    xx, xy, xz, yy, yz, zz = p['platform.inertia']
    w_p = np.einsum('...ji,...j->...i', r, w)
    turning = np.einsum('...i,ij,...j->...', w_p,
                        np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), w_p)
    return (0.5 * p['platform.mass'] * np.sum(velocity ** 2, axis=-1) + 0.5 * turning,
            -p['platform.mass'] * (motion.position + arm) @ gravity)


def energies(p: Parameters, motion: Motion) -> tuple[Array, Array]:
    """
    Return kinetic and potential energy of all moving parts in a batch (..., ) [J].

    Part by part: the speed of its center of mass, its turning, its height against gravity.
    """
    r, v, w = motion.rotation, motion.linear_velocity, motion.angular_velocity
    kinetic, potential = _of_platform(p, motion, p['gravity'])
    for i in range(6):
        a = np.einsum('...ij,j->...i', r, p['geometry.platform_joints'][i])
        leg = motion.position + a - p['geometry.base_joints'][i]
        length = np.linalg.norm(leg, axis=-1, keepdims=True)
        s = leg / length
        joint_velocity = v + np.cross(w, a)
        rate = np.sum(s * joint_velocity, axis=-1, keepdims=True)
        s_rate = (joint_velocity - s * rate) / length
        s1, s2 = p['legs.cylinder.center_of_mass'][i], p['legs.piston.center_of_mass'][i]
        m1, m2 = p['legs.cylinder.mass'][i], p['legs.piston.mass'][i]
        inertia = p['legs.cylinder.inertia'][i] + p['legs.piston.inertia'][i]
        cylinder_velocity = s1 * s_rate
        piston_velocity = rate * s + (length - s2) * s_rate
        kinetic = kinetic + 0.5 * (
            m1 * np.sum(cylinder_velocity ** 2, axis=-1)
            + m2 * np.sum(piston_velocity ** 2, axis=-1)
            + inertia * np.sum(s_rate ** 2, axis=-1)
            + p['actuator.reflected_mass'][i] * rate[..., 0] ** 2)
        base = p['geometry.base_joints'][i]
        potential = potential - (m1 * (base + s1 * s) + m2 * (base + (length - s2) * s)
                                 ) @ p['gravity']
    return kinetic, potential


def assert_order(order: float, ends: Sequence[Array]) -> None:
    """Check the order of convergence of results of steps that are halved each time."""
    errors = [float(np.linalg.norm(one - finer))
              for one, finer in zip(ends, ends[1:], strict=False)]
    assert errors[0] > 1e-9  # else it is rounding that is compared
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all(np.abs(orders - order) < 0.3)


def friction(p: Parameters, rates: Array) -> Array:
    """Return the friction of the actuators at their rates (..., 6) [N]."""
    f: Array = (p['actuator.viscous_friction'] * rates
                + p['actuator.coulomb_friction'] * np.clip(
                    rates / p['actuator.coulomb_velocity'], -1.0, 1.0))
    return f


def reflected(p: Parameters) -> Array:
    """Return the masses or inertias of rotors at the drives (6,)."""
    value: Array = p[p.leg_kind.fields['reflected_mass']]
    return value


class PinocchioReferee:
    """
    Leg forces and base wrench by the recursive Newton-Euler algorithm of Pinocchio.

    The hexapod as an open tree: the base on a joint with six freedoms, whose motion is
    prescribed, with a velocity that must not matter; from the base a universal joint (two
    revolute ones) and a prismatic joint for each leg, and the platform on a joint of its own
    with six freedoms. The
    platform's motion gives all joints' positions, velocities and accelerations, by closed form
    and by Pinocchio's frame Jacobians; its algorithm gives the generalized forces of the tree,
    and virtual work those of the six prismatic joints that do the same on the closed hexapod.
    The parts of a leg have no inertia about its axis, so its spin does nothing.
    """

    def __init__(self, parameters: Parameters, random: np.random.Generator) -> None:
        import pinocchio as pin

        self._pin = pin
        self._p = p = parameters
        self._model = pin.Model()
        base = self._model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), 'base')
        self._base_velocity = random.uniform(-10.0, 10.0, 3)
        self._mounts = []
        self._tips = []
        for i in range(6):
            # The universal joint stands anyhow, its last axis roughly up.
            mount = rotation_about(random_direction(random), random.uniform(0.0, 0.3))
            placement = pin.SE3(mount, np.array(p['geometry.base_joints'][i]))
            first = self._model.addJoint(base, pin.JointModelRX(), placement, f'first {i}')
            second = self._model.addJoint(first, pin.JointModelRY(), pin.SE3.Identity(),
                                          f'second {i}')
            piston = self._model.addJoint(second, pin.JointModelPZ(), pin.SE3.Identity(),
                                          f'piston {i}')
            for joint, part, com in (
                    (second, 'cylinder', p['legs.cylinder.center_of_mass'][i]),
                    (piston, 'piston', -p['legs.piston.center_of_mass'][i])):
                transverse = p[f'legs.{part}.inertia'][i]
                self._model.appendBodyToJoint(joint, pin.Inertia(
                    p[f'legs.{part}.mass'][i], np.array([0.0, 0.0, com]),
                    np.diag([transverse, transverse, 0.0])), pin.SE3.Identity())
            self._tips.append(self._model.addFrame(pin.Frame(
                f'tip {i}', piston, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME)))
            self._mounts.append(mount)
        platform = self._model.addJoint(base, pin.JointModelFreeFlyer(), pin.SE3.Identity(),
                                        'platform')
        xx, xy, xz, yy, yz, zz = p['platform.inertia']
        self._model.appendBodyToJoint(platform, pin.Inertia(
            p['platform.mass'], np.array(p['platform.center_of_mass']),
            np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])), pin.SE3.Identity())
        self._data = self._model.createData()

    def forces(self, motion: Motion, wrench: Array, base: BaseMotion | None = None) -> Array:
        """Return the forces of the six actuators in one sample."""
        return self.forces_and_base_wrench(motion, wrench, base)[0]

    def forces_and_base_wrench(self, motion: Motion, wrench: Array,
                               base: BaseMotion | None = None) -> tuple[Array, Array]:
        """Return the forces of the six actuators, and the wrench in the joint of the base."""
        pin, p, model, data = self._pin, self._p, self._model, self._data
        base = BaseMotion(p['gravity']) if base is None else base
        model.gravity.linear = np.array(base.gravity)
        t, r = motion.position, motion.rotation
        v, w = motion.linear_velocity, motion.angular_velocity
        arms = p['geometry.platform_joints'] @ r.T
        legs = t + arms - p['geometry.base_joints']

        # The joints of the legs and of the platform move relative to the base; their motion is
        # computed with the base at rest.
        q = np.zeros(model.nq)
        q[6] = 1.0
        for i in range(6):
            length = np.linalg.norm(legs[i])
            x, y, z = self._mounts[i].T @ legs[i] / length
            # Rx(q1) Ry(q2) e_z = (sin q2, -sin q1 cos q2, cos q1 cos q2)
            q[7 + 3 * i:10 + 3 * i] = np.arctan2(-y, z), np.arcsin(x), length
        q[25:28] = t
        q[28:32] = pin.Quaternion(np.array(r)).coeffs()

        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        qd, qdd = np.zeros(model.nv), np.zeros(model.nv)
        along_freedoms = np.zeros((model.nv, 6))  # joint rates of a platform twist
        own = []
        for i in range(6):
            tip = pin.getFrameJacobian(model, data, self._tips[i], pin.LOCAL_WORLD_ALIGNED)
            own.append(tip[:3, 6 + 3 * i:9 + 3 * i])
            x, y, z = arms[i]
            of_platform = np.hstack([np.eye(3), [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]])
            along_freedoms[6 + 3 * i:9 + 3 * i] = np.linalg.solve(own[i], of_platform)
        along_freedoms[24:27, :3] = r.T
        along_freedoms[27:30, 3:] = r.T
        qd = along_freedoms @ np.concatenate([v, w])

        pin.forwardKinematics(model, data, q, qd, qdd)
        for i in range(6):
            drift = pin.getFrameClassicalAcceleration(
                model, data, self._tips[i], pin.LOCAL_WORLD_ALIGNED).linear
            joint_acceleration = (
                motion.linear_acceleration + np.cross(motion.angular_acceleration, arms[i])
                + np.cross(w, np.cross(w, arms[i])))
            qdd[6 + 3 * i:9 + 3 * i] = np.linalg.solve(own[i], joint_acceleration - drift)
        qdd[24:27] = r.T @ motion.linear_acceleration - np.cross(r.T @ w, r.T @ v)
        qdd[27:30] = r.T @ motion.angular_acceleration

        qd[:3], qd[3:6] = self._base_velocity, base.angular_velocity
        # Pinocchio's acceleration is the time derivative of the numbers of the velocity.
        qdd[:3] = base.linear_acceleration - np.cross(base.angular_velocity, self._base_velocity)
        qdd[3:6] = base.angular_acceleration
        tau = pin.rnea(model, data, q, qd, qdd)
        pistons = [6 + 3 * i + 2 for i in range(6)]
        force = np.linalg.solve(along_freedoms[pistons].T, along_freedoms.T @ tau - wrench)
        on_base = np.concatenate([wrench[:3], wrench[3:] + np.cross(t, wrench[:3])]) - tau[:6]
        return (force + p['actuator.reflected_mass'] * qdd[pistons]
                + friction(p, qd[pistons])), on_base
