# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
Write docs/errata.md: the errata of the paper, and the error of the leg forces that each causes.

    python docs/figures/errata.py

Run it again when config/platform.yaml has changed. The paper is Alwan and Sarhan, Dynamic
Analysis of Gough Stewart Robot Manipulator by Using Lagrange Formulation in Matlab Software,
J. Univ. Babylon Eng. Sci. 26(10), 2018. Its equations are assembled here line by line, each
line as it is printed or as it is correct.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics import Parameters
from stewart_dynamics.mechanics.dynamics.lagrange import skew
from stewart_dynamics.mechanics.frames.rotation import (
    euler_rate_matrix, euler_rate_matrix_rate, from_euler)
from stewart_dynamics.parameters.table import inertia_matrix

Array = NDArray[np.float64]

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
HEXAPOD = ROOT / 'config' / 'platform.yaml'
TABLE = ROOT / 'docs' / 'errata.md'

SEED = 2018
STATES = 1000
CENTER = np.array([0.0, 0.0, 1.1])
POSITION = np.array([0.15, 0.15, 0.15])  # about CENTER [m]
ANGLES = np.radians([20.0, 20.0, 30.0])  # alpha, beta, gamma
VELOCITY, ANGLE_RATES = 0.4, 1.0  # [m/s, rad/s]
ACCELERATION, ANGLE_ACCELERATIONS = 3.0, 5.0  # [m/s^2, rad/s^2]

NO_ACTUATORS = {'actuator.reflected_mass': 0.0, 'actuator.viscous_friction': 0.0,
                'actuator.coulomb_friction': 0.0}


class Erratum(NamedTuple):
    """A misprinted line of the paper; without a key, its reading here changes no force."""

    key: str
    where: str
    printed: str
    correct: str
    reading: str = ''


ERRATA = (
    Erratum('local joint', 'section 5, whole manipulator: J_i and its derivative',
            '`J_i = [1, -skew(P_i)]`, P_i in platform axes', '`J_i = [1, -skew(R P_i)]`'),
    Erratum('half', '(6)', '`C_pl = 1/2 diag(0, skew(w) I_pl)`', '`diag(0, skew(w) I_pl)`'),
    Erratum('equivalent mass', 'section 5, linkages: m_eq',
            '`m_eq = (m1 S1^2 + m2 S2^2) / L^2`, S2 from the upper joint',
            '`(m1 S1^2 + m2 (L - S2)^2) / L^2`'),
    Erratum('coriolis mass', 'section 5, linkages: C_Li',
            '`m2 S2 / L - (I_eq + L^2 m_eq) / L^2`',
            '`m2 (L - S2) / L - (I_eq + L^2 m_eq) / L^2`'),
    Erratum('leg gravity', 'section 5, linkages: G_Li',
            '`(m1 S1 + m2 (L - S2)) skew(U)^2`', '`(m1 S1 + m2 (L - S2)) / L skew(U)^2`',
            'has kg m in place of kg: taken as the number in SI units'),
    Erratum('', "section 5, whole manipulator: the linkages' equation, in both of its lines",
            "`M_Li x_Li'' + C_Li x_Li' + G_Li = (J^-1)^T F_Li`",
            "`M_Li x_Li'' + C_Li x_Li' + G_Li = F_Li`",
            'three numbers on the left, six on the right: F_Li is the force at the platform '
            'joint of the leg, and `J_i^T F_Li` its part of the six'),
    Erratum('', 'section 5, whole manipulator: G_lini', '`J_i^T G_Li J_i`', '`J_i^T G_Li`',
            'the shapes do not match: the second J_i is left out'),
    Erratum('', 'section 5, whole manipulator: last line',
            "`(J^T)^-1 (M x'' + C x' + G) = F`", "`(J_inv^T)^-1 (M x'' + C x' + G) = F`",
            'the units match if J is the matrix of (3), which the text calls the Jacobian'),
    Erratum('angle rates', 'section 4: angular velocity of the platform',
            "`w = [alpha', beta', gamma']`", "`w = E [alpha', beta', gamma']`"),
)
KEYS = tuple(erratum.key for erratum in ERRATA if erratum.key)


class States(NamedTuple):
    """Poses and their derivatives as the paper gives them, (N, 3) each."""

    position: Array
    angles: Array
    velocity: Array
    angle_rates: Array
    acceleration: Array
    angle_accelerations: Array


def random_states(p: Parameters) -> States:
    """Return the states of the table: random ones within the limits of lengths and rates."""
    random = np.random.default_rng(SEED)
    kept: list[Array] = []
    count = 0
    while count < STATES:
        drawn = random.uniform(-1.0, 1.0, (STATES, 6, 3))
        drawn *= np.array([POSITION, ANGLES, *(np.full(3, bound) for bound in (
            VELOCITY, ANGLE_RATES, ACCELERATION, ANGLE_ACCELERATIONS))])
        drawn[:, 0] += CENTER
        at = States(*np.moveaxis(drawn, 1, 0))
        j_inv, lengths, _, _ = _jacobian(p, at)
        rates = np.abs(np.einsum('nij,nj->ni', j_inv, _twist(at, ())[0]))
        within = np.ones(STATES, dtype=bool)
        for name, broken in (('limits.length_min', np.less), ('limits.length_max', np.greater)):
            if p[name] is not None:
                within &= ~np.any(broken(lengths, p[name]), axis=-1)
        if p.limits.velocity_max is not None:
            within &= ~np.any(rates > p.limits.velocity_max, axis=-1)
        if not np.any(within):
            raise SystemExit(f'{HEXAPOD}: no state of this script is within its limits')
        kept.append(drawn[within])
        count += int(np.sum(within))
    return States(*np.moveaxis(np.concatenate(kept)[:STATES], 1, 0))


def _jacobian(p: Parameters, at: States) -> tuple[Array, Array, Array, Array]:
    """Return the matrix of (3), lengths, directions and R P_i, by (1) and (2)."""
    arms = np.einsum('njk,ik->nij', from_euler(at.angles), p.geometry.platform_joints)
    legs = at.position[:, None] + arms - p.geometry.base_joints
    lengths = np.linalg.norm(legs, axis=-1)
    directions = legs / lengths[..., None]
    return (np.concatenate([directions, np.cross(arms, directions)], axis=-1), lengths,
            directions, arms)


def _twist(at: States, printed: Collection[str]) -> tuple[Array, Array]:
    """Return x' and x'' of the platform, (N, 6)."""
    omega, alpha = at.angle_rates, at.angle_accelerations
    if 'angle rates' not in printed:
        e = euler_rate_matrix(at.angles)
        e_rate = euler_rate_matrix_rate(at.angles, at.angle_rates)
        omega = np.einsum('nij,nj->ni', e, at.angle_rates)
        alpha = (np.einsum('nij,nj->ni', e, at.angle_accelerations)
                 + np.einsum('nij,nj->ni', e_rate, at.angle_rates))
    return (np.concatenate([at.velocity, omega], axis=-1),
            np.concatenate([at.acceleration, alpha], axis=-1))


def leg_forces(p: Parameters, at: States, printed: Collection[str] = ()) -> Array:
    """Return the forces (N, 6) [N]: the lines of these keys as printed, all others corrected."""
    j_inv, lengths, u, arms = _jacobian(p, at)
    x_rate, x_acc = _twist(at, printed)
    omega, alpha = x_rate[:, 3:], x_acc[:, 3:]
    gravity = p.gravity
    m1, s1 = p.legs.cylinder.mass, p.legs.cylinder.center_of_mass
    m2, s2 = p.legs.piston.mass, p.legs.piston.center_of_mass
    i_eq = p.legs.cylinder.inertia + p.legs.piston.inertia

    # the platform joints' motion by J_i and its derivative
    joints = p.geometry.platform_joints if 'local joint' in printed else arms
    joint_arm_rates = np.cross(omega[:, None], joints)
    joint_rate = at.velocity[:, None] + joint_arm_rates
    joint_acc = (at.acceleration[:, None] + np.cross(alpha[:, None], joints)
                 + np.cross(omega[:, None], joint_arm_rates))

    # M_Li, C_Li, G_Li
    c2 = lengths - s2
    m_eq = (m1 * s1 ** 2 + m2 * (s2 if 'equivalent mass' in printed else c2) ** 2) / lengths ** 2
    coriolis_mass = (m2 * (s2 if 'coriolis mass' in printed else c2) / lengths
                     - (i_eq + lengths ** 2 * m_eq) / lengths ** 2)
    gravity_mass = (m1 * s1 + m2 * c2) / (1.0 if 'leg gravity' in printed else lengths)
    length_rate = np.einsum('nij,nj->ni', j_inv, x_rate)
    along = u[..., :, None] * u[..., None, :]
    square = skew(u) @ skew(u)

    def each(numbers: Array) -> Array:
        return numbers[..., None, None]

    m_leg = each(m2) * along - each(m_eq + i_eq / lengths ** 2) * square
    c_leg = (-each(2.0 / lengths * coriolis_mass * length_rate) * square
             - each(m2 * s2 / lengths ** 2)
             * (u[..., :, None] * np.einsum('nij,nijk->nik', joint_rate, square)[..., None, :]))
    g_leg = (each(gravity_mass) * square - each(m2) * along) @ gravity
    force = (np.einsum('nijk,nik->nij', m_leg, joint_acc)
             + np.einsum('nijk,nik->nij', c_leg, joint_rate) + g_leg)

    # (5), (6), for a center of mass anywhere
    rotation = from_euler(at.angles)
    com = rotation @ p.platform.center_of_mass
    inertia = rotation @ inertia_matrix(p.platform.inertia) @ np.swapaxes(rotation, -1, -2)
    weight = p.platform.mass * (
        at.acceleration + np.cross(alpha, com) + np.cross(omega, np.cross(omega, com)) - gravity)
    spin = np.cross(omega, np.einsum('nij,nj->ni', inertia, omega))
    moment = (np.einsum('nij,nj->ni', inertia, alpha)
              + (0.5 if 'half' in printed else 1.0) * spin + np.cross(com, weight))

    wrench = np.concatenate([
        weight + np.sum(force, axis=1), moment + np.sum(np.cross(joints, force), axis=1)], axis=-1)
    forces: Array = np.linalg.solve(np.swapaxes(j_inv, -1, -2), wrench[..., None])[..., 0]
    return forces


def effect(p: Parameters, at: States, printed: Collection[str]) -> tuple[float, float]:
    """Return median and worst error of a leg force, in percent of the state's largest force."""
    true = leg_forces(p, at)
    error = np.max(np.abs(leg_forces(p, at, printed) - true), axis=-1)
    percent = 100.0 * error / np.max(np.abs(true), axis=-1)
    return float(np.median(percent)), float(np.max(percent))


def _shown(percent: float) -> str:
    return f'{float(f"{percent:.1e}"):g}'


def hexapod() -> Parameters:
    """Return the hexapod of the table: the paper's legs have no actuators."""
    return Parameters.from_yaml(HEXAPOD).replaced(NO_ACTUATORS)


def table() -> str:
    """Return the text of docs/errata.md."""
    p = hexapod()
    at = random_states(p)
    lines = []
    for erratum in ERRATA:
        if erratum.key:
            median, worst = map(_shown, effect(p, at, {erratum.key}))
        else:
            median = worst = 'none'
        lines.append(f'| {erratum.where} | {erratum.printed} | {erratum.correct} | '
                     f'{median} | {worst} | {erratum.reading} |')
    median, worst = map(_shown, effect(p, at, KEYS))
    lines.append(f'| all of them at once | | | {median} | {worst} | |')
    x, y, z = CENTER
    dx, dy, dz = POSITION
    alpha, beta, gamma = np.degrees(ANGLES)
    return f"""\
<!-- Written by docs/figures/errata.py (make docs): do not edit this file. -->
# Errata of the paper

The package computes with the equations of H. M. Alwan and R. A. Sarhan, *Dynamic Analysis of
Gough Stewart Robot Manipulator by Using Lagrange Formulation in Matlab Software*, Journal of
University of Babylon for Engineering Sciences 26(10), 2018, except for the lines in this table.
Each line is computed as printed, all other lines as corrected, and the leg forces are compared
with those of the corrected equations. The error is that of the leg with the largest error, in
percent of the largest leg force of the state: median and maximum of {STATES} states.

| where in the paper | as printed | corrected | median [%] | maximum [%] | how it is read here |
| --- | --- | --- | ---: | ---: | --- |
{chr(10).join(lines)}

The hexapod is that of `config/platform.yaml` without the inertia and friction of its actuators,
which the paper does not model. The states are uniformly distributed
(`numpy.random.default_rng({SEED})`) over

- positions within {dx:g}, {dy:g}, {dz:g} m of ({x:g}, {y:g}, {z:g}) m,
- alpha, beta, gamma within {alpha:g}, {beta:g}, {gamma:g} degrees,
- velocities within {VELOCITY:g} m/s on each axis, Euler rates within {ANGLE_RATES:g} rad/s,
- accelerations within {ACCELERATION:g} m/s^2, of the Euler angles {ANGLE_ACCELERATIONS:g} rad/s^2.

States outside the limits of leg length and rate are left out. Each error grows with the quantity
that its line contains: the tilt, the angular velocity, the mass of the legs, the distance of S2
from the middle of the leg. Fast hexapods with heavy legs have larger errors than these states.

Notation of the paper, as read throughout: `U_i` is the direction of the leg; `I_eq` (printed as a
matrix, with I_yy1 in both of its parts) is the sum of the transverse inertias of both parts; the
dotted L_i between bars is the rate of the length with its sign; g in G_Li is the vector of
gravity. The center of mass may be away from the platform's origin; (5) and (6) have no terms for
this, and they are added throughout.
"""


if __name__ == '__main__':
    TABLE.write_text(table(), encoding='utf-8')
    print(f'{TABLE} written')
