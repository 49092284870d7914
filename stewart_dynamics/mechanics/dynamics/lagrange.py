# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The Lagrange equations as the paper assembles them: the readable reference.

``M(X) X'' + C(X, X') X' + G(X) = J_inv^T f + wrench`` in twist coordinates ``X' = [v; w]``,
base axes. Where screws turn with their legs, their J_q replaces J_inv for the forces f and the
reflected masses: ``turning_screws``. Numbers in brackets are equations of Alwan and Sarhan,
Dynamic Analysis of Gough Stewart Robot Manipulator by Using Lagrange Formulation, J. Univ. Babylon
Eng. Sci. 26(10), 2018, in their correct form: docs/misprints.md lists the misprints.
``inverse_dynamics`` computes the same forces without a matrix and is validated against these.
Every function takes any leading shape of samples.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import MotionError
from stewart_dynamics.mechanics.rows import (
    BASE_AXIS, PITCH, PLATFORM_AXIS, POSITION, ROTATION, TWIST)
from stewart_dynamics.parameters.table import inertia_matrix, Parameters


class Legs(NamedTuple):
    """The six legs at a pose; the axis of the legs precedes the axes of vectors."""

    lengths: Array  # (..., 6) [m]
    directions: Array  # s_i (..., 6, 3), from base joint to platform joint
    arms: Array  # a_i = R p_i (..., 6, 3) [m]


def skew(vector: NDArray[np.floating[Any]]) -> Array:
    """Return S (..., 3, 3) with S b = vector x b."""
    x, y, z = np.moveaxis(vector, -1, 0)
    zero = np.zeros_like(x)
    return np.stack([np.stack([zero, -z, y], -1), np.stack([z, zero, -x], -1),
                     np.stack([-y, x, zero], -1)], -2)


def legs(parameters: Parameters, position: Array, rotation: Array) -> Legs:
    """
    Return lengths, directions and arms at a pose: (1), (2).

    Raises MotionError: a length is 0 or overflows.
    """
    with np.errstate(all='ignore'):
        at = unchecked_legs(parameters, position, rotation)
    bad = ~((at.lengths > 0.0) & np.isfinite(at.lengths))
    if bad.any():
        where = tuple(map(int, np.argwhere(bad)[0]))
        raise MotionError(f'leg {where[-1] + 1} would have a length of {at.lengths[where]} m'
                          + (f' in sample {list(where[:-1])}' if where[:-1] else ''))
    return at


def unchecked_legs(parameters: Parameters, position: Array, rotation: Array) -> Legs:
    """Return the same; directions are not finite where a length is 0."""
    arms = np.einsum('...jk,ik->...ij', rotation, parameters.geometry.platform_joints)
    vectors = position[..., None, :] + arms - parameters.geometry.base_joints
    lengths = np.linalg.norm(vectors, axis=-1)
    return Legs(lengths, vectors / lengths[..., None], arms)


def inverse_jacobian(at: Legs) -> Array:
    """Return J_inv (..., 6, 6), row i [s_i, a_i x s_i]: leg rates = J_inv [v; w]: (3)."""
    return np.concatenate([at.directions, np.cross(at.arms, at.directions)], axis=-1)


def determinant(at: Legs) -> Array:
    """Return det(J), the determinant of J_inv (...) [m^3]."""
    found: Array = np.linalg.det(inverse_jacobian(at))
    return found


def inverse_jacobian_rate(at: Legs, velocity: Array, omega: Array) -> Array:
    """Return dJ_inv/dt (..., 6, 6) under a twist."""
    arm_rates = np.cross(omega[..., None, :], at.arms)
    joint_rates = velocity[..., None, :] + arm_rates
    along = np.sum(at.directions * joint_rates, axis=-1, keepdims=True)
    direction_rates = (joint_rates - at.directions * along) / at.lengths[..., None]
    return np.concatenate([
        direction_rates,
        np.cross(arm_rates, at.directions) + np.cross(at.arms, direction_rates)], axis=-1)


def drive_jacobian(at: Legs, rotation: Array, screws: Array | None = None) -> Array:
    """
    Return J_q (..., 6, 6): rates of the drives = J_q [v; w], J_q^T forces = wrench.

    screws (6, SCREW): constants of the screws, see ``turning_screws``; by default they are guided,
        and J_q is J_inv.
    """
    if screws is None or not screws.any():
        return inverse_jacobian(at)
    pitch, u, w = _screws(rotation, screws)
    s = at.directions
    u_s, w_s = _dot(u, s), _dot(w, s)
    h = s + pitch / at.lengths[..., None] * (
        u_s / (1.0 - u_s ** 2) * np.cross(s, u) - w_s / (1.0 - w_s ** 2) * np.cross(s, w))
    d = (s - w_s * w) / (1.0 - w_s ** 2)
    return np.concatenate([h, np.cross(at.arms, h) + pitch * d], axis=-1)


def leg_twists(directions: Array, rotation: Array, screws: Array) -> Array:
    """Return the twists (..., 6) of legs between their universal joints [rad]."""
    _, u, w = _screws(rotation, screws)
    u_s, w_s = _dot(u, directions), _dot(w, directions)
    return np.asarray(np.arctan2(_dot(directions, np.cross(u, w)), _dot(u, w) - u_s * w_s)[..., 0])


def drive_jacobian_rate(at: Legs, rotation: Array, velocity: Array, omega: Array,
                        screws: Array | None = None) -> Array:
    """Return dJ_q/dt (..., 6, 6) under a twist."""
    if screws is None or not screws.any():
        return inverse_jacobian_rate(at, velocity, omega)
    pitch, u, w = _screws(rotation, screws)
    s, length = at.directions, at.lengths[..., None]
    spin = omega[..., None, :]
    arm_rate, w_rate = np.cross(spin, at.arms), np.cross(spin, w)
    joint_rate = velocity[..., None, :] + arm_rate
    rate = _dot(s, joint_rate)
    s_rate = (joint_rate - s * rate) / length
    u_s, w_s = _dot(u, s), _dot(w, s)
    u_s_rate, w_s_rate = _dot(u, s_rate), _dot(w_rate, s) + _dot(w, s_rate)
    of_u, of_w = u_s / (1.0 - u_s ** 2), w_s / (1.0 - w_s ** 2)
    of_u_rate, of_w_rate = ((1.0 + c ** 2) / (1.0 - c ** 2) ** 2 * c_rate
                            for c, c_rate in ((u_s, u_s_rate), (w_s, w_s_rate)))
    inner = of_u * np.cross(s, u) - of_w * np.cross(s, w)
    inner_rate = (of_u_rate * np.cross(s, u) + of_u * np.cross(s_rate, u)
                  - of_w_rate * np.cross(s, w)
                  - of_w * (np.cross(s_rate, w) + np.cross(s, w_rate)))
    h = s + pitch / length * inner
    h_rate = s_rate + pitch / length * (inner_rate - rate / length * inner)
    d = (s - w_s * w) / (1.0 - w_s ** 2)
    d_rate = (s_rate - w_s_rate * w - w_s * w_rate + 2.0 * w_s * w_s_rate * d) / (1.0 - w_s ** 2)
    return np.concatenate([
        h_rate, np.cross(arm_rate, h) + np.cross(at.arms, h_rate) + pitch * d_rate], axis=-1)


def drive_rates(parameters: Parameters, motions: Array, screws: Array) -> Array:
    """Return the rates of the drives (..., 6) [m/s] of rows of motion (..., MOTION), unchecked."""
    rotation = motions[..., ROTATION].reshape(*motions.shape[:-1], 3, 3)
    with np.errstate(all='ignore'):
        at = unchecked_legs(parameters, motions[..., POSITION], rotation)
        rates: Array = np.einsum('...ij,...j->...i', drive_jacobian(at, rotation, screws),
                                 motions[..., TWIST])
    return rates


def _screws(rotation: Array, screws: Array) -> tuple[Array, Array, Array]:
    """Return pitches (6, 1), and axes fixed to base (6, 3) and to platform (..., 6, 3)."""
    return screws[:, PITCH, None], screws[:, BASE_AXIS], np.einsum(
        '...jk,ik->...ij', rotation, screws[:, PLATFORM_AXIS])


def _dot(a: NDArray[np.floating[Any]], b: NDArray[np.floating[Any]]) -> Array:
    product: Array = np.sum(a * b, axis=-1, keepdims=True)
    return product


def _joint_jacobian(arms: Array) -> Array:
    """Return J_i = [1, -skew(a_i)] (..., 6, 3, 6): x_i' = J_i [v; w]; with a_i = R p_i."""
    return np.concatenate([np.broadcast_to(np.eye(3), (*arms.shape, 3)), -skew(arms)], axis=-1)


def _joint_jacobian_rate(arms: Array, omega: Array) -> Array:
    """Return J_i' = [0, -skew(w x a_i)] (..., 6, 3, 6)."""
    rates = np.cross(omega[..., None, :], arms)
    return np.concatenate([np.zeros((*arms.shape, 3)), -skew(rates)], axis=-1)


def _transposed(matrix: Array) -> Array:
    return np.swapaxes(matrix, -1, -2)


class _LegTerms(NamedTuple):
    along: Array  # s s^T (..., 6, 3, 3)
    across: Array  # 1 - s s^T = -skew(s)^2
    piston_distance: Array  # c2 = L - S2 (..., 6)
    inertia: Array  # I_e / L^2 + m_ce: effective mass across the leg [kg]


def _leg_terms(parameters: Parameters, at: Legs) -> _LegTerms:
    along = at.directions[..., :, None] * at.directions[..., None, :]
    piston_distance = at.lengths - parameters.legs.piston.center_of_mass
    inertia = (parameters.legs.cylinder.inertia + parameters.legs.piston.inertia
               + parameters.legs.cylinder.mass * parameters.legs.cylinder.center_of_mass ** 2
               + parameters.legs.piston.mass * piston_distance ** 2) / at.lengths ** 2
    return _LegTerms(along, np.eye(3) - along, piston_distance, inertia)


def _each(scalars: Array) -> Array:
    """Return a number for each leg, shaped to multiply a (..., 6, 3, 3)."""
    return scalars[..., None, None]


def leg_mass(parameters: Parameters, at: Legs) -> Array:
    """Return M_i = m2 s s^T - (I_e / L^2 + m_ce) skew(s)^2, (..., 6, 3, 3) [kg]."""
    terms = _leg_terms(parameters, at)
    mass: Array = (_each(parameters.legs.piston.mass) * terms.along
                   + _each(terms.inertia) * terms.across)
    return mass


def leg_coriolis(
        parameters: Parameters, at: Legs, joint_rates: Array, christoffel: bool = False,
) -> Array:
    """
    Return C_i (..., 6, 3, 3) [kg/s] under the platform joints' velocities x_i'.

    The matrix of the paper is ``-(2/L) m_co L' skew(s)^2 - (m2 S2/L^2) s x_i'^T skew(s)^2``. With
    ``christoffel`` it consists of the Christoffel symbols of M_i in x_i: the same force
    C_i x_i', and M_i' - 2 C_i is skew.
    """
    terms = _leg_terms(parameters, at)
    piston_mass = parameters.legs.piston.mass
    rate = np.sum(at.directions * joint_rates, axis=-1)
    across_rate = joint_rates - at.directions * rate[..., None]
    outer = at.directions[..., :, None] * across_rate[..., None, :]  # s u^T
    m_co = piston_mass * terms.piston_distance / at.lengths - terms.inertia
    slope = 2.0 / at.lengths * m_co  # d/dL of I_e / L^2 + m_ce
    c: Array
    if christoffel:
        c = (_each(0.5 * slope * rate) * terms.across
             + _each((piston_mass - terms.inertia) / at.lengths) * outer
             - _each(0.5 * slope) * (outer - _transposed(outer)))
    else:
        s2 = parameters.legs.piston.center_of_mass
        c = (_each(slope * rate) * terms.across
             + _each(piston_mass * s2 / at.lengths ** 2) * outer)
    return c


def leg_gravity(parameters: Parameters, at: Legs) -> Array:
    """Return G_i = (m_ge skew(s)^2 - m2 s s^T) g, (..., 6, 3) [N]."""
    terms = _leg_terms(parameters, at)
    m_ge = (parameters.legs.cylinder.mass * parameters.legs.cylinder.center_of_mass
            + parameters.legs.piston.mass * terms.piston_distance) / at.lengths
    g: Array = -(_each(m_ge) * terms.across
                 + _each(parameters.legs.piston.mass) * terms.along) @ parameters.gravity
    return g


def _center_of_mass(parameters: Parameters, rotation: Array) -> Array:
    com: Array = rotation @ parameters.carried.center
    return com


def _platform_inertia(parameters: Parameters, rotation: Array) -> Array:
    local = inertia_matrix(parameters.carried.inertia)
    inertia: Array = rotation @ local @ _transposed(rotation)
    return inertia


def _turning(inertia: Array) -> Array:
    """Return the (..., 6, 6) matrix that has a (..., 3, 3) one in its lower right corner."""
    return np.pad(inertia, [(0, 0)] * (inertia.ndim - 2) + [(3, 0), (3, 0)])


def mass_matrix(parameters: Parameters, position: Array, rotation: Array,
                screws: Array | None = None) -> Array:
    """Return M = M_p + sum J_i^T M_i J_i + J_q^T m_r J_q, (..., 6, 6): (5)."""
    at = legs(parameters, position, rotation)
    j_com = _joint_jacobian(_center_of_mass(parameters, rotation))
    j = _joint_jacobian(at.arms)
    j_q = drive_jacobian(at, rotation, screws)
    m: Array = (
        parameters.carried.mass * _transposed(j_com) @ j_com
        + _turning(_platform_inertia(parameters, rotation))
        + np.sum(_transposed(j) @ leg_mass(parameters, at) @ j, axis=-3)
        + _transposed(j_q) @ (parameters.actuator.reflected_mass[:, None] * j_q))
    return m


def coriolis_matrix(
        parameters: Parameters, position: Array, rotation: Array, velocity: Array,
        omega: Array, christoffel: bool = False, screws: Array | None = None,
) -> Array:
    """Return C = C_p + sum (J_i^T M_i J_i' + J_i^T C_i J_i) + J_q^T m_r J_q': (6)."""
    at = legs(parameters, position, rotation)
    com = _center_of_mass(parameters, rotation)
    com_rate = -skew(np.cross(omega, com))
    j_com_rate = np.concatenate([np.zeros_like(com_rate), com_rate], axis=-1)
    j = _joint_jacobian(at.arms)
    j_rate = _joint_jacobian_rate(at.arms, omega)
    joint_rates = velocity[..., None, :] + np.cross(omega[..., None, :], at.arms)
    c = leg_coriolis(parameters, at, joint_rates, christoffel)
    coriolis: Array = (
        parameters.carried.mass * _transposed(_joint_jacobian(com)) @ j_com_rate
        + _turning(skew(omega) @ _platform_inertia(parameters, rotation))
        + np.sum(_transposed(j) @ (leg_mass(parameters, at) @ j_rate + c @ j), axis=-3)
        + _transposed(drive_jacobian(at, rotation, screws)) @ (
            parameters.actuator.reflected_mass[:, None]
            * drive_jacobian_rate(at, rotation, velocity, omega, screws)))
    return coriolis


def gravity_vector(parameters: Parameters, position: Array, rotation: Array) -> Array:
    """Return G = G_p + sum J_i^T G_i, (..., 6) [N, N m]."""
    at = legs(parameters, position, rotation)
    g = leg_gravity(parameters, at)
    weight = -parameters.carried.mass * parameters.gravity
    com = _center_of_mass(parameters, rotation)
    force = weight + np.sum(g, axis=-2)
    moment = np.cross(com, weight) + np.sum(np.cross(at.arms, g), axis=-2)
    return np.concatenate([force, moment], axis=-1)


def base_coriolis_matrix(
        parameters: Parameters, position: Array, rotation: Array, spin: Array) -> Array:
    """
    Return the part of C due to the angular velocity W of a base, (..., 6, 6): a skew matrix.

    Platform: ``2 m J_c^T skew(W) J_c``, and ``I skew(W) + skew(W) I - skew(I W)`` of its turning.
    Leg: ``2 m2 c2 / L (q s^T - s q^T) + 2 (I_e / L^2 + m_ce) (W . s) skew(s)`` with q = W x s.
    """
    at = legs(parameters, position, rotation)
    terms = _leg_terms(parameters, at)
    inertia, turn = _platform_inertia(parameters, rotation), skew(spin)
    turning = inertia @ turn + turn @ inertia - skew((inertia @ spin[..., None])[..., 0])
    j_com = _joint_jacobian(_center_of_mass(parameters, rotation))
    j = _joint_jacobian(at.arms)
    q = np.cross(spin[..., None, :], at.directions)
    outer = q[..., :, None] * at.directions[..., None, :]
    piston = parameters.legs.piston.mass * terms.piston_distance / at.lengths
    along = np.sum(spin[..., None, :] * at.directions, axis=-1)
    of_legs = (_each(2.0 * piston) * (outer - _transposed(outer))
               + _each(2.0 * terms.inertia * along) * skew(at.directions))
    coriolis: Array = (
        2.0 * parameters.carried.mass * _transposed(j_com) @ turn @ j_com
        + _turning(turning) + np.sum(_transposed(j) @ of_legs @ j, axis=-3))
    return coriolis


def base_gravity_vector(
        parameters: Parameters, position: Array, rotation: Array, gravity: Array,
        acceleration: Array, spin: Array, spin_rate: Array) -> Array:
    """
    Return G on a moving base, (..., 6) [N, N m]: the wrench that holds platform and legs on it.

    At a point at rest on the base, at r, ``a_B - g + W' x r + W x (W x r)`` replaces -g.
    Leg: ``-G_i(A_b)`` with A_b of the leg's base joint, and
    ``(I_e / L^2 + m_ce) L across - m2 c2 |q|^2 s`` with across the part of ``W' x s + W x q``
    across the leg, q = W x s.
    """
    at = legs(parameters, position, rotation)
    terms = _leg_terms(parameters, at)
    field = skew(spin_rate) + skew(spin) @ skew(spin)

    def felt(arm: Array) -> Array:
        """Return acceleration less gravity of points (..., k, 3) fixed to the base."""
        field_at: Array = np.einsum('...ij,...kj->...ki', field, arm)
        return (acceleration - gravity)[..., None, :] + field_at

    com = _center_of_mass(parameters, rotation)
    inertia = _platform_inertia(parameters, rotation)
    force = parameters.carried.mass * felt((position + com)[..., None, :])[..., 0, :]
    momentum = (inertia @ spin[..., None])[..., 0]
    moment = (np.cross(com, force) + (inertia @ spin_rate[..., None])[..., 0]
              + np.cross(spin, momentum))

    piston_mass = parameters.legs.piston.mass
    m_ge = (parameters.legs.cylinder.mass * parameters.legs.cylinder.center_of_mass
            + piston_mass * terms.piston_distance) / at.lengths
    weight = _each(m_ge) * terms.across + _each(piston_mass) * terms.along
    q_squared = np.sum(np.cross(spin[..., None, :], at.directions) ** 2, axis=-1)
    carried = np.einsum('...ij,...kj->...ki', field, at.directions)
    on_legs = (
        (weight @ felt(parameters.geometry.base_joints)[..., None])[..., 0]
        + (_each(terms.inertia * at.lengths) * terms.across @ carried[..., None])[..., 0]
        - (piston_mass * terms.piston_distance * q_squared)[..., None] * at.directions)
    force = force + np.sum(on_legs, axis=-2)
    moment = moment + np.sum(np.cross(at.arms, on_legs), axis=-2)
    return np.concatenate([force, moment], axis=-1)
