# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A hexapod with cranks as 13 free bodies: Newton's and Euler's laws, without this package.

Kinematics: each quantity is a stack of its value and its first two derivatives by time, and
products follow Leibniz' rule: no formula of a rate or of an acceleration is written down. Angles,
their rates and accelerations are the root of |B - A(q)|^2 = L2^2, by Newton's iteration on such
stacks (Griewank and Walther, Evaluating Derivatives, 2nd edition, chapters 13 and 15). A moving
base is one more rotation and translation; axes are inertial and coincide with the base's.

Dynamics: moments of inertial forces are sums of s x s'' over a body's mass, from its second
moments of mass. All reactions of all joints are unknowns of one linear system; forward dynamics
adds the accelerations of all bodies (Featherstone, Rigid Body Dynamics Algorithms, chapter 3).

Names are those of ``data/simulator_rig.json``, where ``fields`` describes them.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PLATFORM, CRANKS, RODS = 0, slice(1, 7), slice(7, 13)  # places of the bodies
ON_PLATFORM, ON_ROD, ON_CRANK = slice(0, 3), slice(3, 6), slice(6, 9)  # forces of a leg's joints
BEARING, SHAFT, SPIN = slice(9, 12), 11, 12  # moments: e, n, u of the crank; axis of the rod
EPSILON = np.array([[np.cross(j, k) for k in np.eye(3)] for j in np.eye(3)])  # (j, k, i)


@dataclass(frozen=True)
class CrankHexapod:
    """A hexapod with cranks; arrays have one row for each leg."""

    center: Array  # (6, 3) [m]
    axis: Array  # (6, 3)
    zero: Array  # (6, 3)
    crank: Array  # (6,) [m]
    rod: Array  # (6,) [m]
    branch: Array  # (6,)
    P: Array  # (6, 3) [m]
    m: float  # [kg]
    c: Array  # (3,) [m]
    I: Array  # noqa: E741 (3, 3) [kg m^2]
    g: Array  # (3,) [m/s^2]
    home: Array  # (3,) [m]
    mc: Array  # (6,) [kg]
    cc: Array  # (6, 3) [m]
    Ic: Array  # (6, 3, 3) [kg m^2]
    mr: Array  # (6,) [kg]
    sr: Array  # (6,) [m]
    Ir: Array  # (6,) [kg m^2]
    J: Array  # (6,) [kg m^2]
    visc: Array  # (6,) [N m s/rad]
    coul: Array  # (6,) [N m]
    slow: Array  # (6,) [rad/s]
    middle: Array = field(default_factory=lambda: np.zeros(6))  # of the ranges of angles [rad]


@dataclass(frozen=True)
class BaseState:
    """Motion of the base in its own axes: gravity, acceleration, angular rate and acceleration."""

    g: Array
    a: Array
    w: Array
    al: Array


@dataclass(frozen=True)
class State:
    """Pose, twist and acceleration of the platform, wrench on it, and motion of the base."""

    t: Array
    R: Array
    v: Array
    w: Array
    a: Array
    al: Array
    wrench: Array
    base: BaseState | None = None


class Answer(NamedTuple):
    """Results of a state; on_platform, on_rod: forces of the balls there; det_q: det(J_q)."""

    angles: Array
    rates: Array
    accelerations: Array
    torques: Array
    shaft: Array
    rod_at_platform: Array
    rod_at_crank: Array
    on_platform: Array
    on_rod: Array
    lever: Array
    det_rods: float
    det_q: float
    base_wrench: Array


def machine_of(parameters: dict[str, Any], angle_range: Any = None) -> CrankHexapod:
    """Return the hexapod of the numbers of a file."""
    numbers: dict[str, Any] = {name: value if name == 'm' else np.array(value)
                               for name, value in parameters.items()}
    if angle_range is not None:
        numbers['middle'] = np.mean(angle_range, axis=-1)
    return CrankHexapod(**numbers)


def state_of(numbers: dict[str, Any]) -> State:
    """Return the state of the numbers of a file."""
    base = numbers['base']
    return State(
        **{name: np.array(numbers[name]) for name in ('t', 'R', 'v', 'w', 'a', 'al', 'wrench')},
        base=base and BaseState(**{name: np.array(each) for name, each in base.items()}))


def skew(v: Array) -> Array:
    """Return the matrix of the cross product with a vector."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def constant(value: Array) -> Array:
    """Return a value with its derivatives by time: zeros."""
    return np.stack([value, np.zeros_like(value), np.zeros_like(value)])


def product(rule: str, a: Array, b: Array) -> Array:
    """Multiply two values with their derivatives by time; rule: of numpy's einsum."""
    def term(i: int, j: int) -> Array:
        found: Array = np.einsum(rule, a[i], b[j])
        return found

    return np.stack([term(0, 0), term(1, 0) + term(0, 1),
                     term(2, 0) + 2.0 * term(1, 1) + term(0, 2)])


def turning(rotation: Array, w: Array, al: Array) -> Array:
    """Return a rotation with its derivatives by time."""
    return np.stack([rotation, skew(w) @ rotation, (skew(al) + skew(w) @ skew(w)) @ rotation])


class Motion:
    """Positions and rotations of all bodies in a state, with their derivatives by time."""

    def __init__(self, machine: CrankHexapod, state: State) -> None:
        base = state.base or BaseState(machine.g, *np.zeros((3, 3)))
        self.gravity = base.g
        turn = turning(np.eye(3), base.w, base.al)
        origin = np.stack([np.zeros(3), np.zeros(3), base.a])

        rotation = turning(state.R, state.w, state.al)
        self.place = np.stack([state.t, state.v, state.a])

        def on_platform(points: Array) -> Array:
            return self.place[:, None] + product('ij,kj->ki', rotation, constant(points))

        # in the frame of the base
        at_platform = on_platform(machine.P)
        self.angle = angles(machine, at_platform)
        cranks = crank_axes(machine, self.angle)

        def on_cranks(points: Array) -> Array:
            return constant(machine.center) + product('kij,kj->ki', cranks, constant(points))

        at_crank = on_cranks(machine.crank[:, None] * [1.0, 0.0, 0.0])
        rod = (at_platform - at_crank) / machine.rod[:, None]
        mass_centers = np.concatenate([
            on_platform(machine.c[None]), on_cranks(machine.cc),
            at_crank + machine.sr[:, None] * rod], axis=1)

        # in inertial axes
        def moved(points: Array) -> Array:
            return origin[:, None] + product('ij,kj->ki', turn, points)

        self.mass_centers = moved(mass_centers)
        self.at_platform, self.at_crank = moved(at_platform)[0], moved(at_crank)[0]
        self.rods = product('ij,kj->ki', turn, rod)
        self.cranks = product('ij,kjl->kil', turn, cranks)
        self.platform = product('ij,jk->ik', turn, rotation)
        self.lever = machine.crank * np.einsum('ki,ki->k', rod[0], cranks[0, :, :, 1])

    def jacobian(self) -> Array:
        """Return J_d: rates along the rods per twist of the platform (6, 6)."""
        rods = self.rods[0]
        return np.hstack([rods, np.cross(self.at_platform - self.place[0], rods)])

    def second_moments(self, machine: CrankHexapod, order: int) -> Array:
        """Return sums of s s^T over the masses of the bodies, or of s s''^T (order 2)."""
        def of_body(inertia: Array, rotation: Array) -> Array:
            trace = np.trace(inertia, axis1=-2, axis2=-1)[..., None, None]
            found: Array = rotation[0] @ (0.5 * trace * np.eye(3) - inertia) @ np.swapaxes(
                rotation[order], -1, -2)
            return found

        of_rods = machine.Ir[:, None, None] * np.einsum(
            'ki,kj->kij', self.rods[0], self.rods[order])
        return np.concatenate([
            of_body(machine.I, self.platform)[None], of_body(machine.Ic, self.cranks), of_rods])


def crank_axes(machine: CrankHexapod, q: Array) -> Array:
    """Return the axes e, n, u of the cranks (columns) at angles, with derivatives by time."""
    cos, sin = np.cos(q[0]), np.sin(q[0])
    cosine = np.stack([cos, -sin * q[1], -sin * q[2] - cos * q[1] ** 2])
    sine = np.stack([sin, cos * q[1], cos * q[2] - sin * q[1] ** 2])
    zero, normal = machine.zero, np.cross(machine.axis, machine.zero)
    e = cosine[..., None] * zero + sine[..., None] * normal
    n = cosine[..., None] * normal - sine[..., None] * zero
    return np.stack([e, n, constant(machine.axis)], axis=-1)


def angles(machine: CrankHexapod, at_platform: Array) -> Array:
    """
    Return the angles of the cranks with their derivatives by time (3, 6).

    The squared distance from the crank's ball to the platform joint is a cosine of the angle.
    Newton's iteration begins where the cosine is steepest, a quarter turn before its minimum
    (branch +) or after it (-), and approaches the root from one side.
    """
    arm = at_platform[0] - machine.center
    normal = np.cross(machine.axis, machine.zero)
    nearest = np.arctan2(np.sum(arm * normal, axis=-1), np.sum(arm * machine.zero, axis=-1))
    q = constant(nearest - 0.5 * np.pi * machine.branch)
    for _ in range(30):
        axes = crank_axes(machine, q)
        gap = (at_platform - constant(machine.center)
               - machine.crank[:, None] * axes[..., 0])
        slope = -2.0 * machine.crank * np.sum(gap[0] * axes[0, :, :, 1], axis=-1)
        error = product('ki,ki->k', gap, gap) - constant(machine.rod ** 2)
        q = q - error / slope
    if not np.all(np.abs(error[0]) < 1e-12 * machine.rod ** 2):
        raise ValueError('a platform joint is out of reach')
    q[0] -= 2.0 * np.pi * np.round((q[0] - machine.middle) / (2.0 * np.pi))
    return q


def effects(machine: CrankHexapod, motion: Motion) -> Array:
    """
    Return the wrenches on all bodies at their centers of mass per reaction of the joints (78, 78).

    13 reactions a leg: force of the rod on the platform, of the crank on the rod, of the base on
    the crank, moment of the base on the crank in its axes, and a moment about the rod's axis that
    is zero, since nothing else acts there, and fixes the spin of the rod.
    """
    found = np.zeros((13, 6, 6, 13))
    platform, cranks, rods = (motion.mass_centers[0, which] for which in (
        PLATFORM, CRANKS, RODS))

    def force_at(arm: Array) -> Array:
        return np.vstack([np.eye(3), skew(arm)])

    for i in range(6):
        crank, rod = found[1 + i, :, i], found[7 + i, :, i]
        a, b = motion.at_crank[i], motion.at_platform[i]
        found[PLATFORM, :, i, ON_PLATFORM] = force_at(b - platform)
        rod[:, ON_PLATFORM] = -force_at(b - rods[i])
        rod[:, ON_ROD] = force_at(a - rods[i])
        crank[:, ON_ROD] = -force_at(a - cranks[i])
        crank[:, ON_CRANK] = force_at(machine.center[i] - cranks[i])
        crank[3:, BEARING] = motion.cranks[0, i]
        rod[3:, SPIN] = motion.rods[0, i]
    return found.reshape(78, 78)


def masses(machine: CrankHexapod) -> Array:
    """Return the masses of all bodies (13,) [kg]."""
    return np.hstack([machine.m, machine.mc, machine.mr])


def needed(machine: CrankHexapod, state: State, motion: Motion) -> Array:
    """Return the wrenches (78,) that the joints must exert on the bodies."""
    found = np.empty((13, 6))
    found[:, :3] = masses(machine)[:, None] * (motion.mass_centers[2] - motion.gravity)
    found[:, 3:] = np.einsum('jki,njk->ni', EPSILON, motion.second_moments(machine, 2))
    force, moment = state.wrench[:3], state.wrench[3:]
    found[PLATFORM, :3] -= force
    found[PLATFORM, 3:] -= moment + np.cross(state.t - motion.mass_centers[0, PLATFORM], force)
    return found.ravel()


def friction(machine: CrankHexapod, rates: Array) -> Array:
    """Return the torques of friction at rates of the cranks (6,) [N m]."""
    found: Array = machine.visc * rates + machine.coul * np.clip(rates / machine.slow, -1.0, 1.0)
    return found


def inverse_dynamics(machine: CrankHexapod, state: State) -> Answer:
    """Return angles, torques, forces of the rods and wrench on the base of a state."""
    motion = Motion(machine, state)
    reactions = np.linalg.solve(effects(machine, motion), needed(machine, state, motion)).reshape(
        6, 13).astype(np.float64)
    on_platform, on_rod = reactions[:, ON_PLATFORM], reactions[:, ON_ROD]
    force = reactions[:, ON_CRANK]
    moment = (np.einsum('kij,kj->ki', motion.cranks[0], reactions[:, BEARING])
              + np.cross(machine.center, force))
    q, rates, accelerations = motion.angle
    rods = motion.rods[0]
    determinant = float(np.linalg.det(motion.jacobian()))
    shaft = reactions[:, SHAFT]
    return Answer(
        q, rates, accelerations,
        shaft + machine.J * accelerations + friction(machine, rates),
        shaft, np.sum(rods * on_platform, axis=-1), np.sum(rods * on_rod, axis=-1),
        on_platform, on_rod, motion.lever, determinant,
        determinant / float(np.prod(motion.lever)),
        -np.hstack([force.sum(axis=0), moment.sum(axis=0)]))


def forward_dynamics(machine: CrankHexapod, state: State, torques: Array) -> Array:
    """
    Return the acceleration (6,) of the platform under torques; that of the state is not used.

    Unknowns are all reactions and the accelerations of all bodies, less the accelerations of the
    same motion with a platform that does not accelerate. By virtual work, the transposed effects
    of the reactions give the relative accelerations in the joints: zero, except at the shafts.
    """
    still = replace(state, a=np.zeros(3), al=np.zeros(3))
    motion = Motion(machine, still)
    joints = effects(machine, motion)
    second = motion.second_moments(machine, 0)
    inertia = np.zeros((13, 6, 13, 6))
    for body, mass in enumerate(masses(machine)):
        inertia[body, :3, body, :3] = mass * np.eye(3)
        inertia[body, 3:, body, 3:] = np.trace(second[body]) * np.eye(3) - second[body]
    shafts = np.arange(6) * 13 + SHAFT
    freedoms, given = joints.T.copy(), np.zeros(78)
    freedoms[shafts] *= machine.J[:, None]
    held = np.zeros((78, 78))
    held[shafts, shafts] = 1.0
    given[shafts] = torques - friction(machine, motion.angle[1]) - machine.J * motion.angle[2]
    found = np.linalg.solve(
        np.block([[inertia.reshape(78, 78), -joints], [freedoms, held]]),
        np.hstack([-needed(machine, still, motion), given]))
    center = motion.mass_centers[0, PLATFORM] - state.t
    return np.hstack([found[:3] - np.cross(found[3:6], center), found[3:6]])
