# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The Lagrange equations as the paper assembles them: the readable reference.

``M(X) X'' + C(X, X') X' + G(X) = J_inv^T f + wrench`` in twist coordinates ``X' = [v; w]``,
base axes. Where screws turn with their legs, their J_q replaces J_inv for the forces f and the
reflected masses: ``turning_screws``. Numbers in brackets are equations of Alwan and Sarhan,
Dynamic Analysis of Gough Stewart Robot Manipulator by Using Lagrange Formulation, J. Univ. Babylon
Eng. Sci. 26(10), 2018, in their correct form: docs/errata.md lists the errata.
``inverse_dynamics`` computes the same forces without a matrix and is validated against these.
Every function takes any leading shape of samples.
"""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import MotionError, ReachError
from stewart_dynamics.legs.lines import dot, Lines, skew, transposed
from stewart_dynamics.mechanics.batch import missing_distances, unreached
from stewart_dynamics.mechanics.rows import (
    BASE_AXIS, PITCH, PLATFORM_AXIS, POSITION, ROTATION, TWIST)
from stewart_dynamics.parameters.table import inertia_matrix, Parameters


def legs(parameters: Parameters, position: Array, rotation: Array) -> Lines:
    """
    Return lengths, directions and arms at a pose: (1), (2).

    Raises MotionError: a length is 0 or overflows. ReachError: a rod does not reach.
    """
    with np.errstate(all='ignore'):
        at = unchecked_legs(parameters, position, rotation)
    missing: Array = np.zeros(6)
    if not np.isfinite(at.directions).all():
        poses = np.concatenate([position, rotation.reshape(*rotation.shape[:-2], 9)], axis=-1)
        missing = missing_distances(parameters.structure, poses)
    if (missing > 0.0).any():
        sample = tuple(map(int, np.argwhere((missing > 0.0).any(axis=-1))[0]))
        raise ReachError(unreached(parameters.joints, missing[sample])
                         + (f' in sample {list(sample)}' if sample else ''))
    bad = ~((at.lengths > 0.0) & np.isfinite(at.lengths))
    if bad.any():
        where = tuple(map(int, np.argwhere(bad)[0]))
        raise MotionError(f'leg {where[-1] + 1} would have a length of {at.lengths[where]} m'
                          + (f' in sample {list(where[:-1])}' if where[:-1] else ''))
    return at


def unchecked_legs(parameters: Parameters, position: Array, rotation: Array) -> Lines:
    """Return the same; not finite where a leg has no length, or does not reach."""
    return parameters.leg_kind.lines(parameters, position, rotation)


def inverse_jacobian(at: Lines) -> Array:
    """Return J_inv (..., 6, 6), row i [s_i, a_i x s_i]: leg rates = J_inv [v; w]: (3)."""
    return np.concatenate([at.directions, np.cross(at.arms, at.directions)], axis=-1)


def determinant(at: Lines) -> Array:
    """Return det(J), the determinant of J_inv (...) [m^3]."""
    found: Array = np.linalg.det(inverse_jacobian(at))
    return found


def inverse_jacobian_rate(at: Lines, velocity: Array, omega: Array) -> Array:
    """Return dJ_inv/dt (..., 6, 6) under a twist."""
    arm_rates = np.cross(omega[..., None, :], at.arms)
    joint_rates = velocity[..., None, :] + arm_rates
    if at.path is not None:
        joint_rates = joint_rates - at.anchor_rates(joint_rates)[1]
    along = np.sum(at.directions * joint_rates, axis=-1, keepdims=True)
    direction_rates = (joint_rates - at.directions * along) / at.lengths[..., None]
    return np.concatenate([
        direction_rates,
        np.cross(arm_rates, at.directions) + np.cross(at.arms, direction_rates)], axis=-1)


def drive_jacobian(at: Lines, rotation: Array, screws: Array | None = None) -> Array:
    """
    Return J_q (..., 6, 6): rates of the drives = J_q [v; w], J_q^T forces = wrench.

    screws (6, SCREW): constants of the screws, see ``turning_screws``; by default they are guided,
        and J_q is J_inv.
    """
    if at.path is not None:
        by_lever: Array = inverse_jacobian(at) / at.levers()[..., None]
        return by_lever
    if screws is None or not screws.any():
        return inverse_jacobian(at)
    pitch, u, w = _screws(rotation, screws)
    s = at.directions
    u_s, w_s = dot(u, s), dot(w, s)
    h = s + pitch / at.lengths[..., None] * (
        u_s / (1.0 - u_s ** 2) * np.cross(s, u) - w_s / (1.0 - w_s ** 2) * np.cross(s, w))
    d = (s - w_s * w) / (1.0 - w_s ** 2)
    return np.concatenate([h, np.cross(at.arms, h) + pitch * d], axis=-1)


def leg_twists(directions: Array, rotation: Array, screws: Array) -> Array:
    """Return the twists (..., 6) of legs between their universal joints [rad]."""
    _, u, w = _screws(rotation, screws)
    u_s, w_s = dot(u, directions), dot(w, directions)
    return np.asarray(np.arctan2(dot(directions, np.cross(u, w)), dot(u, w) - u_s * w_s)[..., 0])


def drive_jacobian_rate(at: Lines, rotation: Array, velocity: Array, omega: Array,
                        screws: Array | None = None) -> Array:
    """Return dJ_q/dt (..., 6, 6) under a twist."""
    if at.path is not None:
        spin = np.cross(omega[..., None, :], at.arms)
        joint_rates = velocity[..., None, :] + spin
        speeds, anchor_rates = at.anchor_rates(joint_rates)
        direction_rates = (joint_rates - anchor_rates) / at.lengths[..., None]
        lever_rates = dot(direction_rates, at.path.tangents) + speeds * dot(
            at.directions, at.path.curvatures)
        by_path: Array = (inverse_jacobian_rate(at, velocity, omega)
                          - lever_rates * drive_jacobian(at, rotation)) / at.levers()[..., None]
        return by_path
    if screws is None or not screws.any():
        return inverse_jacobian_rate(at, velocity, omega)
    pitch, u, w = _screws(rotation, screws)
    s, length = at.directions, at.lengths[..., None]
    spin = omega[..., None, :]
    arm_rate, w_rate = np.cross(spin, at.arms), np.cross(spin, w)
    joint_rate = velocity[..., None, :] + arm_rate
    rate = dot(s, joint_rate)
    s_rate = (joint_rate - s * rate) / length
    u_s, w_s = dot(u, s), dot(w, s)
    u_s_rate, w_s_rate = dot(u, s_rate), dot(w_rate, s) + dot(w, s_rate)
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


def _joint_jacobian(arms: Array) -> Array:
    """Return J_i = [1, -skew(a_i)] (..., 6, 3, 6): x_i' = J_i [v; w]; with a_i = R p_i."""
    return np.concatenate([np.broadcast_to(np.eye(3), (*arms.shape, 3)), -skew(arms)], axis=-1)


def _joint_jacobian_rate(arms: Array, omega: Array) -> Array:
    """Return J_i' = [0, -skew(w x a_i)] (..., 6, 3, 6)."""
    rates = np.cross(omega[..., None, :], arms)
    return np.concatenate([np.zeros((*arms.shape, 3)), -skew(rates)], axis=-1)


def leg_mass(parameters: Parameters, at: Lines) -> Array:
    """Return M_i (..., 6, 3, 3) [kg] of the legs, in coordinates of their platform joints."""
    return parameters.leg_kind.leg_mass(parameters, at)


def leg_coriolis(
        parameters: Parameters, at: Lines, joint_rates: Array, christoffel: bool = False,
) -> Array:
    """Return C_i (..., 6, 3, 3) [kg/s] under the platform joints' velocities x_i'."""
    return parameters.leg_kind.leg_coriolis(parameters, at, joint_rates, christoffel)


def leg_gravity(parameters: Parameters, at: Lines) -> Array:
    """Return G_i (..., 6, 3) [N]."""
    return parameters.leg_kind.leg_gravity(parameters, at)


def _reflected(parameters: Parameters) -> Array:
    reflected: Array = parameters[parameters.leg_kind.fields['reflected_mass']]
    return reflected


def _center_of_mass(parameters: Parameters, rotation: Array) -> Array:
    com: Array = rotation @ parameters.carried.center
    return com


def _platform_inertia(parameters: Parameters, rotation: Array) -> Array:
    local = inertia_matrix(parameters.carried.inertia)
    inertia: Array = rotation @ local @ transposed(rotation)
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
        parameters.carried.mass * transposed(j_com) @ j_com
        + _turning(_platform_inertia(parameters, rotation))
        + np.sum(transposed(j) @ leg_mass(parameters, at) @ j, axis=-3)
        + transposed(j_q) @ (_reflected(parameters)[:, None] * j_q))
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
        parameters.carried.mass * transposed(_joint_jacobian(com)) @ j_com_rate
        + _turning(skew(omega) @ _platform_inertia(parameters, rotation))
        + np.sum(transposed(j) @ (leg_mass(parameters, at) @ j_rate + c @ j), axis=-3)
        + transposed(drive_jacobian(at, rotation, screws)) @ (
            _reflected(parameters)[:, None]
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
    """
    at = legs(parameters, position, rotation)
    inertia, turn = _platform_inertia(parameters, rotation), skew(spin)
    turning = inertia @ turn + turn @ inertia - skew((inertia @ spin[..., None])[..., 0])
    j_com = _joint_jacobian(_center_of_mass(parameters, rotation))
    j = _joint_jacobian(at.arms)
    of_legs = parameters.leg_kind.base_coriolis(parameters, at, spin)
    coriolis: Array = (
        2.0 * parameters.carried.mass * transposed(j_com) @ turn @ j_com
        + _turning(turning) + np.sum(transposed(j) @ of_legs @ j, axis=-3))
    return coriolis


def base_gravity_vector(
        parameters: Parameters, position: Array, rotation: Array, gravity: Array,
        acceleration: Array, spin: Array, spin_rate: Array) -> Array:
    """
    Return G on a moving base, (..., 6) [N, N m]: the wrench that holds platform and legs on it.

    At a point at rest on the base, at r, ``a_B - g + W' x r + W x (W x r)`` replaces -g.
    """
    at = legs(parameters, position, rotation)
    field = skew(spin_rate) + skew(spin) @ skew(spin)

    def felt(arm: Array) -> Array:
        """Return acceleration less gravity of points (..., k, 3) at rest on the base."""
        field_at: Array = np.einsum('...ij,...kj->...ki', field, arm)
        return (acceleration - gravity)[..., None, :] + field_at

    com = _center_of_mass(parameters, rotation)
    inertia = _platform_inertia(parameters, rotation)
    force = parameters.carried.mass * felt((position + com)[..., None, :])[..., 0, :]
    momentum = (inertia @ spin[..., None])[..., 0]
    moment = (np.cross(com, force) + (inertia @ spin_rate[..., None])[..., 0]
              + np.cross(spin, momentum))

    on_legs = parameters.leg_kind.base_gravity(parameters, at, position, felt, spin, spin_rate)
    force = force + np.sum(on_legs, axis=-2)
    moment = moment + np.sum(np.cross(at.arms, on_legs), axis=-2)
    return np.concatenate([force, moment], axis=-1)
