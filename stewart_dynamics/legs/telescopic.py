# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Telescopic legs, with guided screws or screws that turn with them: ``core/telescopic.h``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple, TYPE_CHECKING

import numpy as np

from stewart_dynamics.arrays import Array, Records
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.legs import telescopic_tree as tree
from stewart_dynamics.legs.kind import (
    IntervalBounds, LegKind, LegMass, Named, Placed, Solid, STANDARD_G, StopLoads, ZeroCause)
from stewart_dynamics.legs.lines import Lines, lines_from, per_leg, skew, transposed
from stewart_dynamics.legs.mechanism import Chain, LegJoint, MechanismBody, SLIDE, UNIVERSAL
from stewart_dynamics.legs.telescopic_calibration import TelescopicCalibration
from stewart_dynamics.legs.tree import BARREL, LegBranch, ROD

if TYPE_CHECKING:
    from stewart_dynamics.parameters.table import Parameters

_OF_LENGTH = 0.5  # length of a cylinder in pictures by its leg, where that has no limit
_NOISE = 5.0  # of usual measured forces [N]
# A moment of inertia that rounding made negative is taken as zero, by the second moment.
_ROUNDING = 1e-9


def _masses_of(part: str) -> tuple[LegMass, ...]:
    """Return mass, first and second moment; the mass of a cylinder alone has no effect."""
    acts = part == 'piston'
    return (LegMass(f'legs.{part}.mass', 'kg', part, f'legs.{part}.mass', acts, acts, acts),
            LegMass(f'legs.{part}.first_moment', 'kg m', part, f'legs.{part}.center_of_mass',
                    weighs=True),
            LegMass(f'legs.{part}.second_moment', 'kg m^2', part, f'legs.{part}.inertia',
                    positive=True))


class Telescopic(LegKind):
    """Legs of a cylinder and a piston, whose drives change their lengths."""

    name = 'telescopic'
    position = Named('length', 'lengths', 'm')
    rate = Named('rate', 'rates', 'm/s', '+ extends')
    effort = Named('force', 'forces', 'N', '+ pushes', 'pulls')
    effort_signs, extremes = ('push', 'pull'), ('shortest', 'longest')
    position_limits = 'limits.length_min', 'limits.length_max'
    rate_limit, effort_limit = 'limits.velocity_max', 'limits.force_max'
    joint_force_limit = 'limits.joint_force_max'
    commands = 'forces'
    simulated = 'force'
    resolved = 'a joint moves by more than that part of its leg'
    ratio, gear, right_sign = 'actuator.screw_lead', 'screw', '+ must push'
    transmission = 'screw and gear'
    wrong_units = ((1e-3, 'kN in place of N'), (1.0 / STANDARD_G, 'kgf in place of N'),
                   (1.0 / 4.448222, 'pounds in place of N'), (1e3, 'mN in place of N'))
    own = ('legs.cylinder.', 'legs.piston.', 'actuator.reflected_mass', 'actuator.screw_lead',
           'geometry.zero_length', 'geometry.base_joint_axes', 'geometry.base_outline',
           'geometry.platform_outline', 'limits.length_', 'limits.velocity_max',
           'limits.force_max', 'limits.joint_force_max', 'limits.base_joint_angle_max',
           'limits.leg_clearance_min', 'drive.screw_', 'drive.base_universal_axes',
           'drive.platform_universal_axes', 'meshes.cylinder', 'meshes.piston',
           'noise.length', 'noise.rate', 'noise.force')
    fields = {
        'zero_length': 'geometry.zero_length', 'cylinder_mass': 'legs.cylinder.mass',
        'cylinder_center_of_mass': 'legs.cylinder.center_of_mass',
        'cylinder_inertia': 'legs.cylinder.inertia', 'piston_mass': 'legs.piston.mass',
        'piston_center_of_mass': 'legs.piston.center_of_mass',
        'piston_inertia': 'legs.piston.inertia', 'reflected_mass': 'actuator.reflected_mass',
        'cylinder_radius': 'legs.cylinder.radius', 'cylinder_length': 'legs.cylinder.length',
        'piston_radius': 'legs.piston.radius'}
    masses = (*_masses_of('cylinder'), *_masses_of('piston'))
    weights = 'legs.cylinder.second_moment', 'legs.piston.second_moment'
    zero_cause = ZeroCause(
        'zero_length', 'geometry.zero_length', 'mm', 1e3,
        'geometry.zero_length or the geometry is wrong, or legs are swapped', same_as='joint')
    massless = {
        'legs.cylinder.mass': 0.0, 'legs.cylinder.inertia': 0.0, 'legs.piston.mass': 0.0,
        'legs.piston.inertia': 0.0, 'actuator.reflected_mass': 0.0, 'drive.motor_inertia': None,
        'drive.screw_inertia': None}
    solids = Solid('cylinders', BARREL), Solid('pistons', ROD)
    parts, joints = tree.PARTS, (UNIVERSAL, SLIDE)
    elements = ('actuator.reflected_mass', 'actuator.viscous_friction',
                'actuator.coulomb_friction', *(
                    f'legs.{part}.{each}' for part in tree.PARTS
                    for each in ('mass', 'center_of_mass', 'inertia')))
    zero = 'geometry.zero_length'
    inertia_unit = 'kg'
    reflected, rotors = 'J (2 pi / lead)^2', 'rotor and screw'
    friction_units = 'N s/m', 'N'
    moved, moves, unit_word = 'leg', '+ extends', 'metre'
    large_effort = 1e3, '1 kN'
    bodies = {'cylinder': 'legs.cylinder.mass', 'piston': 'legs.piston.mass'}

    def write_fields(self, legs: Records, parameters: Parameters) -> None:
        """Write nothing: all fields hold parameters as they are."""

    def mass_values(self, parameters: Parameters) -> Array:
        """Return mass, first and second moment of cylinders and pistons (6, 6)."""
        return np.stack([row for part in parameters.legs.parts.values() for row in (
            part.mass, part.mass * part.center_of_mass,
            part.inertia + part.mass * part.center_of_mass ** 2)])

    def relative_changes(self, parameters: Parameters) -> list[Array]:
        """Return changes of cylinder and piston; the mass of a cylinder alone has no effect."""
        found: list[Array] = []
        none = np.zeros(6)
        for n, part in enumerate(parameters.legs.parts.values()):
            first, mass = part.mass * part.center_of_mass, n * part.mass
            turning = part.inertia + part.mass * part.center_of_mass ** 2 - part.inertia
            for change in ((mass, first, turning), (none, first, 2.0 * turning),
                           (none, none, part.inertia)):
                rows = np.zeros((6, 6))
                rows[3 * n:3 * n + 3] = change
                found.append(rows)
        return found

    def with_hidden(self, parameters: Parameters, values: Array) -> Array:
        """Return masses of cylinders that bodies with their moments can have."""
        complete = values.copy()
        mass, first, second = values[:3]
        least = np.divide(first ** 2, second, out=np.zeros(6), where=second > 0.0)
        complete[0] = np.where(mass * second < first ** 2, 1.0001 * least, mass)
        return complete

    def mass_parameters(self, parameters: Parameters, values: Array) -> dict[str, Any]:
        """Return masses, centers of mass and inertias of cylinders and pistons."""
        found: dict[str, Any] = {}
        for n, part in enumerate(parameters.legs.parts):
            masses, firsts, seconds = values[3 * n:3 * n + 3]
            massless = masses == 0.0
            wrong = (masses < 0.0) | (massless & (firsts != 0.0))
            distances = np.divide(
                firsts, masses, out=parameters.legs.parts[part].center_of_mass.copy(),
                where=~massless)
            inertias = seconds - firsts * distances * ~massless
            inertias[np.abs(inertias) < _ROUNDING * np.abs(seconds)] = 0.0
            wrong |= inertias < 0.0
            if wrong.any():
                leg = int(np.argmax(wrong))
                raise ParameterError(
                    f'legs.{part} of {parameters.joints[leg]}: mass {masses[leg]:g} kg, first '
                    f'moment {firsts[leg]:g} kg m, second moment {seconds[leg]:g} kg m^2: no body '
                    'has these')
            found |= {f'legs.{part}.mass': masses.copy(),
                      f'legs.{part}.center_of_mass': distances, f'legs.{part}.inertia': inertias}
        return found

    def mass_distances(self, parameters: Parameters) -> Array:
        """Return the size of the platform, twice."""
        return np.full(6, 2.0 * parameters.singularity.characteristic_length)

    def effort_noise(self, parameters: Parameters) -> float:
        """Return the noise of load cells."""
        del parameters
        return _NOISE

    def lines(self, parameters: Parameters, position: Array, rotation: Array) -> Lines:
        """Return the legs: (1), (2)."""
        geometry = parameters.geometry
        return lines_from(geometry.base_joints, geometry.platform_joints, position, rotation)

    def place_solids(self, parameters: Parameters, joints: Array, positions: Array,
                     ) -> tuple[Placed, ...]:
        """Return cylinders that begin at the base joints, and pistons from joint to joint."""
        base, shortest = parameters.geometry.base_joints, parameters.limits.length_min
        vectors = joints - base
        along = vectors / positions[:, None]
        barrels = _OF_LENGTH * positions
        if shortest is not None:
            barrels = np.minimum(tree.BARREL_LENGTH * shortest, positions)
        return (Placed(base + 0.5 * barrels[:, None] * along, along, barrels),
                Placed(base + 0.5 * vectors, along, positions))

    def leg_mass(self, parameters: Parameters, at: Lines) -> Array:
        """Return M_i = m2 s s^T - (I_e / L^2 + m_ce) skew(s)^2."""
        terms = _terms(parameters, at)
        mass: Array = (per_leg(parameters.legs.piston.mass) * terms.along
                       + per_leg(terms.inertia) * terms.across)
        return mass

    def leg_coriolis(self, parameters: Parameters, at: Lines, joint_rates: Array,
                     christoffel: bool) -> Array:
        """
        Return C_i under the platform joints' velocities.

        The matrix of the paper is ``-(2/L) m_co L' skew(s)^2 - (m2 S2/L^2) s x_i'^T skew(s)^2``.
        With ``christoffel`` it consists of the Christoffel symbols of M_i in x_i: the same force
        C_i x_i', and M_i' - 2 C_i is skew.
        """
        terms = _terms(parameters, at)
        piston_mass = parameters.legs.piston.mass
        rate = np.sum(at.directions * joint_rates, axis=-1)
        across_rate = joint_rates - at.directions * rate[..., None]
        outer = at.directions[..., :, None] * across_rate[..., None, :]  # s u^T
        m_co = piston_mass * terms.piston_distance / at.lengths - terms.inertia
        slope = 2.0 / at.lengths * m_co  # d/dL of I_e / L^2 + m_ce
        c: Array
        if christoffel:
            c = (per_leg(0.5 * slope * rate) * terms.across
                 + per_leg((piston_mass - terms.inertia) / at.lengths) * outer
                 - per_leg(0.5 * slope) * (outer - transposed(outer)))
        else:
            s2 = parameters.legs.piston.center_of_mass
            c = (per_leg(slope * rate) * terms.across
                 + per_leg(piston_mass * s2 / at.lengths ** 2) * outer)
        return c

    def leg_gravity(self, parameters: Parameters, at: Lines) -> Array:
        """Return G_i = (m_ge skew(s)^2 - m2 s s^T) g."""
        g: Array = -_weight(parameters, at) @ parameters.gravity
        return g

    def base_coriolis(self, parameters: Parameters, at: Lines, spin: Array) -> Array:
        """Return 2 m2 c2 / L (q s^T - s q^T) + 2 (I_e / L^2 + m_ce) (W . s) skew(s), q = W x s."""
        terms = _terms(parameters, at)
        q = np.cross(spin[..., None, :], at.directions)
        outer = q[..., :, None] * at.directions[..., None, :]
        piston = parameters.legs.piston.mass * terms.piston_distance / at.lengths
        along = np.sum(spin[..., None, :] * at.directions, axis=-1)
        of_legs: Array = (per_leg(2.0 * piston) * (outer - transposed(outer))
                          + per_leg(2.0 * terms.inertia * along) * skew(at.directions))
        return of_legs

    def base_gravity(self, parameters: Parameters, at: Lines, position: Array,
                     felt: Callable[[Array], Array], spin: Array, spin_rate: Array) -> Array:
        """
        Return ``-G_i(A_b) + (I_e / L^2 + m_ce) L across - m2 c2 |q|^2 s``.

        With A_b of the leg's base joint and across the part of ``W' x s + W x q`` across the leg,
        q = W x s.
        """
        terms = _terms(parameters, at)
        field = skew(spin_rate) + skew(spin) @ skew(spin)
        q_squared = np.sum(np.cross(spin[..., None, :], at.directions) ** 2, axis=-1)
        carried = np.einsum('...ij,...kj->...ki', field, at.directions)
        moment = parameters.legs.piston.mass * terms.piston_distance
        on_legs: Array = (
            (_weight(parameters, at) @ felt(parameters.geometry.base_joints)[..., None])[..., 0]
            + (per_leg(terms.inertia * at.lengths) * terms.across @ carried[..., None])[..., 0]
            - (moment * q_squared)[..., None] * at.directions)
        return on_legs

    def calibrated_legs(self, parameters: Parameters) -> TelescopicCalibration:
        """Return numbers and equations of the legs."""
        return TelescopicCalibration(parameters)

    def stop_loads(self, parameters: Parameters) -> StopLoads:
        """Return reflected masses, and the pistons, which move with the platform."""
        ones = np.ones(6)
        return StopLoads(parameters.actuator.reflected_mass, float(np.sum(
            parameters.legs.piston.mass)), (ones, ones), ones, np.zeros(6))

    def bound_intervals(self, parameters: Parameters, results: Array, squares: Array,
                        reach: Array) -> IntervalBounds:
        """Return bounds by the lengths at the points."""
        lengths = results[:, self.position.columns]
        shorter = np.minimum(lengths[:-1], lengths[1:])
        piston, cylinder = parameters.legs.piston, parameters.legs.cylinder
        inertia = (cylinder.mass * cylinder.center_of_mass ** 2 + cylinder.inertia
                   + piston.inertia)
        masses = piston.mass + (inertia + piston.mass * (
            np.maximum(lengths[:-1], lengths[1:]) - piston.center_of_mass) ** 2) / shorter ** 2
        ones = np.ones(6)
        return IntervalBounds(
            ones, 1.0 / shorter.min(axis=1), np.zeros(len(shorter)), masses, ones,
            parameters.actuator.reflected_mass, np.zeros(6))

    def nearest_fault(self, joints: Sequence[str], positions: Sequence[float],
                      ratios: Sequence[float]) -> str:
        """Return the shortest leg."""
        return f'shortest leg {min(positions):.3g} m'

    def branches(self, parameters: Parameters, position: Array, rotation: Array, mounts: Array,
                 size: float) -> list[LegBranch]:
        """Return cylinders and pistons."""
        return tree.branches(parameters, position, rotation, mounts, size)

    def tree_joints(self, parameters: Parameters, mounts: Array, home: tuple[Array, Array],
                    ) -> Callable[[Array, Array], Array]:
        """Return angles of the universal joints and positions of the slides."""
        return partial(tree.tree_positions, parameters, mounts)

    def drive_of(self, steps: Sequence[LegJoint]) -> int | None:
        """Return which joint slides."""
        return tree.drive_of(steps)

    def places(self, steps: Sequence[LegJoint]) -> list[str]:
        """Return the side of the slide on which each joint is."""
        at = tree.drive_of(steps) or 0
        return ['base'] * at + [''] + ['platform'] * (len(steps) - at - 1)

    def parting(self, steps: Sequence[LegJoint]) -> int:
        """Return which joint slides."""
        return tree.drive_of(steps) or 0

    def read_leg(self, chain: Chain, base: MechanismBody, platform: MechanismBody,
                 said: list[str]) -> dict[str, Any]:
        """Return the parameters of a leg in a file."""
        return tree.read_leg(self, chain, base, platform, said)

    def home_rule(self, parameters: Parameters, anchors: Array) -> str:
        """Return that the mean length is missing, or too short."""
        del parameters, anchors
        return ('home pose: limits.length_min and limits.length_max, or geometry.zero_length, '
                'must give a length that the legs can have in a level pose')


class _Terms(NamedTuple):
    along: Array  # s s^T (..., 6, 3, 3)
    across: Array  # 1 - s s^T = -skew(s)^2
    piston_distance: Array  # c2 = L - S2 (..., 6)
    inertia: Array  # I_e / L^2 + m_ce: effective mass across the leg [kg]


def _terms(parameters: Parameters, at: Lines) -> _Terms:
    along = at.directions[..., :, None] * at.directions[..., None, :]
    piston_distance = at.lengths - parameters.legs.piston.center_of_mass
    inertia = (parameters.legs.cylinder.inertia + parameters.legs.piston.inertia
               + parameters.legs.cylinder.mass * parameters.legs.cylinder.center_of_mass ** 2
               + parameters.legs.piston.mass * piston_distance ** 2) / at.lengths ** 2
    return _Terms(along, np.eye(3) - along, piston_distance, inertia)


def _weight(parameters: Parameters, at: Lines) -> Array:
    """Return the masses m_ge across and m2 along the legs (..., 6, 3, 3) [kg]."""
    terms = _terms(parameters, at)
    piston_mass = parameters.legs.piston.mass
    m_ge = (parameters.legs.cylinder.mass * parameters.legs.cylinder.center_of_mass
            + piston_mass * terms.piston_distance) / at.lengths
    weight: Array = per_leg(m_ge) * terms.across + per_leg(piston_mass) * terms.along
    return weight


TELESCOPIC = Telescopic()
