# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Cranks, turned by motors on the base, with rods to the platform: ``core/crank.h``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
import math
from typing import Any, NamedTuple, TYPE_CHECKING

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Records
from stewart_dynamics.core.binding import function, places
from stewart_dynamics.errors import ParameterError, shown
from stewart_dynamics.legs import crank_errors, crank_tree as tree
from stewart_dynamics.legs.crank_calibration import CrankCalibration
from stewart_dynamics.legs.kind import (
    AtHome, BaseParameter, IntervalBounds, LegKind, LegMass, Named, Placed, Solid, STANDARD_G,
    StopLoads, ZeroCause)
from stewart_dynamics.legs.lines import (
    AnchorCircles, AnchorPath, dot, joint_arms, Lines, per_leg, skew, transposed)
from stewart_dynamics.legs.mechanism import Chain, HINGE, LegJoint, MechanismBody, UNIVERSAL
from stewart_dynamics.legs.tree import BARREL, LegBranch, ROD
from stewart_dynamics.possible_errors.hypothesis import find_errors, lines_of, PossibleError

if TYPE_CHECKING:
    from stewart_dynamics.parameters.table import Parameters

AUTO, POSITIVE, NEGATIVE = BRANCHES = 'auto', 'positive', 'negative'  # geometry.crank_branch
_SIGNS = {AUTO: 0.0, POSITIVE: 1.0, NEGATIVE: -1.0}
LEVER_MIN = 0.1
"""Default of ``limits.lever_min``: the lever near a dead centre by its largest value."""
COULOMB_VELOCITY = 0.01
"""Default of ``actuator.coulomb_velocity`` for cranks [rad/s]."""
HEADINGS, AXES, DIRECTIONS = (
    'geometry.crank_angles', 'geometry.crank_axes', 'geometry.crank_directions')
_LEVERS = places('stewart_result')['levers']
_POSITION, _ROTATION = (places('stewart_motion')[each] for each in ('position', 'rotation'))
# A stop near a dead centre is expected to end motions before half of its lever, or before this.
_DEEPEST = 0.5
_LEAST_LEVER = 0.01
# Noise of usual measured torques, by the share of a crank in the weight of the platform.
_NOISE = 0.01
# An inertia that rounding made negative is taken as zero, by that about the joint.
_ROUNDING = 1e-9
# Sums of masses that the torques show, as names of linear parameters.
_MOMENT, _INERTIA, _END, _COUPLING = (
    'legs.crank.first_moment', 'legs.crank.inertia_about_axis.uu', 'legs.rod.crank_end_mass',
    'legs.rod.coupling_mass')


class Crank(LegKind):
    """Cranks with rods, whose drives turn the cranks."""

    name = 'crank'
    marker = 'legs.crank.length'
    position = Named('angle', 'angles', 'rad')
    rate = Named('speed', 'speeds', 'rad/s')
    effort = Named('torque', 'torques', 'N m', '+ drives the angle up', 'drives it down')
    effort_signs = 'drives the angle up', 'drives it down'
    extremes = 'smallest angle', 'largest angle'
    decimals = -1
    position_limits = 'limits.angle_min', 'limits.angle_max'
    rate_limit, effort_limit = 'limits.speed_max', 'limits.torque_max'
    period = 2.0 * math.pi
    lever_limit, ends_differ = 'limits.lever_min', True
    joint_force, joint_force_limit = 'rod_force', 'limits.rod_force_max'
    commands = 'torques'
    simulated = 'leg_torque'
    resolved = ('a crank turns by more than that, a joint moves by more than that part of its '
                'rod, or a lever changes by more than that part of itself, as at a dead centre')
    gear, transmission, right_sign = 'gear', 'the gear', '+ must drive the angle up'
    wrong_units = (
        (1e-3, 'kN m in place of N m'), (1.0 / STANDARD_G, 'kgf m in place of N m'),
        (1e2 / STANDARD_G, 'kgf cm in place of N m'), (1.0 / 1.355818, 'lbf ft in place of N m'),
        (1e3, 'mN m in place of N m'), (1e2, 'N cm in place of N m'))
    exact = False
    width = places('stewart_result')['levers'].stop
    own = ('legs.crank.', 'legs.rod.', 'geometry.crank_', 'actuator.reflected_inertia',
           'limits.angle_', 'limits.speed_max', 'limits.torque_max', 'limits.rod_force_max',
           'limits.lever_min', 'noise.angle', 'noise.speed', 'noise.torque', 'servo.')
    fields = {
        'crank_length': 'legs.crank.length', 'rod_length': 'legs.rod.length',
        'crank_axis': AXES, 'crank_direction': DIRECTIONS, 'crank_mass': 'legs.crank.mass',
        'rod_mass': 'legs.rod.mass', 'rod_center_of_mass': 'legs.rod.center_of_mass',
        'rod_inertia': 'legs.rod.inertia', 'reflected_mass': 'actuator.reflected_inertia',
        **{f'servo_{name}': f'servo.{name}' for name in (
            'pulse_min', 'pulse_max', 'angle_at_min', 'angle_at_max')}}
    masses = (
        *(LegMass(f'legs.crank.first_moment.{axis}', 'kg m', 'crank', 'legs.crank.center_of_mass',
                  acts=axis != 'u', weighs=axis != 'u') for axis in 'enu'),
        *(LegMass(f'legs.crank.inertia_about_axis.{axes}', 'kg m^2', 'crank',
                  'legs.crank.inertia', acts=axes == 'uu', positive=axes == 'uu')
          for axes in ('ee', 'en', 'eu', 'nn', 'nu', 'uu')),
        *(LegMass(f'legs.rod.{name}_mass', 'kg', 'rod', 'legs.rod.mass', weighs=True,
                  positive=name != 'coupling')
          for name in ('crank_end', 'coupling', 'platform_end')))
    weights = 'legs.crank.first_moment.e', 'legs.rod.coupling_mass'
    zero_cause = ZeroCause(
        'angle_zero', 'zero of the angles', 'deg', math.degrees(1.0),
        'the zero or the sign of an angle or the geometry is wrong, or legs are swapped')
    massless = {
        'legs.crank.mass': 0.0, 'legs.crank.inertia': 0.0, 'legs.rod.mass': 0.0,
        'legs.rod.inertia': 0.0, 'actuator.reflected_inertia': 0.0, 'drive.motor_inertia': None}
    solids = Solid('cranks', BARREL), Solid('rods', ROD)
    parts, joints = tree.PARTS, (HINGE, UNIVERSAL)
    elements = (
        'actuator.reflected_inertia', 'actuator.viscous_friction', 'actuator.coulomb_friction',
        AXES, DIRECTIONS, *(f'legs.{part}.{each}' for part in tree.PARTS
                            for each in ('length', 'mass', 'center_of_mass', 'inertia')))
    shortened = HEADINGS,
    anchors_are = 'ends of the cranks'
    moved, moves, unit_word = 'crank', '+ drives the angle up', 'radian'
    large_effort = 1.0, '1 N m'
    likely = {'geometry.crank_branch': (AUTO,)}
    inertia_unit = 'kg m^2'
    reflected, rotors = 'N^2 J', 'rotor and gear'
    friction_units = 'N m s/rad', 'N m'
    bodies = {'crank': 'legs.crank.mass', 'rod': 'legs.rod.mass'}
    alternatives = (HEADINGS,), (AXES, DIRECTIONS)
    units = {'actuator.viscous_friction': 'N m s/rad', 'actuator.coulomb_friction': 'N m',
             'actuator.coulomb_velocity': 'rad/s'}
    defaults = {'actuator.coulomb_velocity': (COULOMB_VELOCITY,)}

    def check(self, parameters: Parameters, source: str) -> None:
        """Complete axes and directions, and defaults that differ from those of other legs."""
        _complete_axes(parameters, source)
        given = parameters.given
        if parameters['legs.rod.length'] is None:
            raise ParameterError(f'{source}: legs.rod.length: not set: needed by {self.marker}')
        if parameters.limits.lever_min is None:
            parameters._complete('limits.lever_min', np.full(6, LEVER_MIN))
        for name, default in self.defaults.items():
            if name not in given:
                parameters._complete(name, np.full(6, default))

    def write_fields(self, legs: Records, parameters: Parameters) -> None:
        """Write centers of mass and inertias of the cranks, and the branches that are given."""
        of: Any = legs
        of['crank_center_of_mass'], of['crank_inertia'] = crank_bodies(parameters)
        of['branch'] = [-1.0 if each == NEGATIVE else 1.0 for each in _branches(parameters)]

    def mass_values(self, parameters: Parameters) -> Array:
        """Return moments and inertias of the cranks, and the masses of the rods (12, 6)."""
        legs: Any = parameters.structure['legs']
        centers, inertias = crank_bodies(parameters)
        mass = parameters['legs.crank.mass']
        return np.concatenate([mass * centers.T, inertias.T + mass * _about(centers), np.stack([
            legs[name] for name in ('crank_end_mass', 'coupling_mass', 'platform_end_mass')])])

    def relative_changes(self, parameters: Parameters) -> list[Array]:
        """Return changes of crank and rod."""
        centers, inertias = crank_bodies(parameters)
        mass, size = parameters['legs.crank.mass'], parameters['legs.rod.length']
        legs: Any = parameters.structure['legs']
        rod, part = legs['rod_mass'], legs['rod_center_of_mass'] / size
        turning, none = legs['rod_inertia'] / size ** 2, np.zeros(6)
        first, about = mass * centers.T, mass * _about(centers)
        changes = [(np.zeros((3, 6)), np.zeros((6, 6)), each) for each in (
            (rod * (1.0 - part) ** 2, rod * part * (1.0 - part), rod * part ** 2),
            (-2.0 * rod * part * (1.0 - part), rod * part * (1.0 - 2.0 * part),
             2.0 * rod * part ** 2),
            (turning, -turning, turning))]
        changes += [(*each, (none,) * 3) for each in (
            (first, about), (first, 2.0 * about), (np.zeros((3, 6)), inertias.T))]
        return [np.concatenate([moments, inertia, of_rod])
                for moments, inertia, of_rod in changes]

    def with_hidden(self, parameters: Parameters, values: Array) -> Array:
        """Return the moments of cranks about other axes than that of the motor for the others."""
        complete = values.copy()
        centers, inertias = crank_bodies(parameters)
        mass = _masses_of_cranks(parameters, values)
        centers[:, :2] = np.divide(values[:2], mass, out=np.zeros((2, 6)), where=mass > 0.0).T
        complete[2] = mass * centers[:, 2]
        complete[3:8] = (inertias.T + mass * _about(centers))[:5]
        return complete

    def mass_parameters(self, parameters: Parameters, values: Array) -> dict[str, Any]:
        """
        Return masses, centers of mass and inertias of cranks and rods.

        The torques do not show the mass of a crank, which is the file's, or the least that a body
        with these moments can have.
        """
        mass = _masses_of_cranks(parameters, values)
        centers = np.divide(
            values[:3], mass, out=crank_bodies(parameters)[0].T.copy(), where=mass > 0.0).T
        about_axes = values[3:9]
        inertias = (about_axes - mass * _about(centers)).T
        inertias[np.abs(inertias) < _ROUNDING * np.abs(about_axes.T)] = 0.0
        _check_bodies(parameters, 'legs.crank', inertias[:, 5] < 0.0, {
            'first moment {:g} kg m': np.hypot(*values[:2]),
            'inertia about the axis {:g} kg m^2': about_axes[5]})
        end, coupling, carried = values[9:]
        size = parameters['legs.rod.length']
        rods = end + 2.0 * coupling + carried
        rods[np.abs(rods) < _ROUNDING * (np.abs(end) + np.abs(carried))] = 0.0
        part = np.divide(coupling + carried, rods, where=rods != 0.0, out=(
            tree.rod_value(parameters, 'center_of_mass') / size))
        turning = end - rods * (1.0 - part) ** 2
        turning[np.abs(turning) < _ROUNDING * np.abs(end)] = 0.0
        _check_bodies(parameters, 'legs.rod', (rods < 0.0) | (turning < 0.0), {
            'mass {:g} kg': rods, 'center of mass {:g} m': part * size,
            'inertia {:g} kg m^2': turning * size ** 2})
        return {'legs.crank.mass': mass, 'legs.crank.center_of_mass': centers,
                'legs.crank.inertia': inertias, 'legs.rod.mass': rods,
                'legs.rod.center_of_mass': part * size, 'legs.rod.inertia': turning * size ** 2}

    def mass_distances(self, parameters: Parameters) -> Array:
        """Return the lengths of the cranks."""
        return self.reach(parameters)

    def effort_noise(self, parameters: Parameters) -> float:
        """Return a part of the torque by which a crank holds its share of the platform."""
        weight = parameters.carried.mass * STANDARD_G / 6.0
        return float(_NOISE * weight * np.mean(self.reach(parameters)))

    def base_parameters(self, parameters: Parameters) -> tuple[BaseParameter, ...]:
        """Return inertia about the axis with rotor and rod, first moments, and coupling mass."""
        size, ones = parameters['legs.crank.length'], np.ones(6)
        return (
            BaseParameter('legs.crank.shaft_inertia', 'kg m^2', {
                _INERTIA: ones, self.fields['reflected_mass']: ones, _END: size ** 2}),
            BaseParameter('legs.crank.shaft_moment.e', 'kg m', {
                f'{_MOMENT}.e': ones, _END: size}),
            BaseParameter('legs.crank.shaft_moment.n', 'kg m', {f'{_MOMENT}.n': ones}),
            BaseParameter(_COUPLING, 'kg', {_COUPLING: ones}))

    def lines(self, parameters: Parameters, position: Array, rotation: Array) -> Lines:
        """Return the rods, whose anchors are the ends of the cranks: A(q) = c + L1 e(q)."""
        at = _angle_of(parameters, position, rotation)
        tangents, curvatures = at.size * at.normal, -at.size * at.along
        rods = parameters['legs.rod.length']
        directions = (at.line + curvatures) / rods[:, None]
        return Lines(np.broadcast_to(rods, at.arms.shape[:-1]), directions, at.arms,
                     AnchorPath(tangents, curvatures))

    def anchors(self, parameters: Parameters, positions: Array) -> Array:
        """Return the ends of the cranks."""
        return crank_ends(parameters, positions)

    def line_lengths(self, parameters: Parameters, positions: Array) -> Array:
        """Return the lengths of the rods."""
        return np.broadcast_to(parameters['legs.rod.length'], positions.shape)

    def place_solids(self, parameters: Parameters, joints: Array, positions: Array,
                     ) -> tuple[Placed, ...]:
        """Return the cranks at their angles, and the rods from there to the platform joints."""
        centers, sizes = parameters.geometry.base_joints, parameters['legs.crank.length']
        ends = crank_ends(parameters, positions)
        cranks, rods = ends - centers, joints - ends
        lengths = np.linalg.norm(rods, axis=1)
        return (Placed(centers + 0.5 * cranks, cranks / sizes[:, None], sizes),
                Placed(ends + 0.5 * rods, rods / lengths[:, None], lengths))

    def anchor_circles(self, parameters: Parameters) -> AnchorCircles:
        """
        Return the circles of the ends of the cranks.

        The angle is within pi of its middle: where one limit alone is given, that is the other
        end of the range, past which the angle jumps over the limit.
        """
        legs: Any = parameters.structure['legs']
        low, high = parameters.limits.angle_min, parameters.limits.angle_max
        middle = np.zeros(6) if low is None or high is None else 0.5 * (low + high)
        lowest = middle - math.pi if low is None else np.maximum(low, middle - math.pi)
        highest = middle + math.pi if high is None else np.minimum(high, middle + math.pi)
        half = 0.5 * (highest - lowest)
        below, above = self.position_limits
        u, z = crank_axes(parameters)
        across = np.asarray(np.cross(u, z), dtype=float)
        return AnchorCircles(
            z, across, parameters['legs.crank.length'], parameters['legs.rod.length'],
            legs['branch'].copy(), parameters['limits.lever_min'], 0.5 * (lowest + highest),
            np.where(half < math.pi, half, math.inf),
            (below if high is None else above, above if low is None else below))

    def lever_ratios(self, parameters: Parameters, results: Array) -> Array:
        """Return |k| / L1, or -1 where a rod does not reach."""
        ratios = np.abs(results[..., _LEVERS]) / parameters['legs.crank.length']
        reached: Array = np.where(np.isfinite(ratios), ratios, -1.0)
        return reached

    def leg_mass(self, parameters: Parameters, at: Lines) -> Array:
        """Return M_i = I r r^T + m_ab (t r^T + r t^T) + m_b, q' = r . x', A' = t q', r = d / k."""
        inertia, _, coupling, end = _of_legs(parameters)
        t, r = _tangent_and_row(at)
        couple = t[..., :, None] * r[..., None, :]
        mass: Array = (per_leg(inertia) * (r[..., :, None] * r[..., None, :])
                       + per_leg(coupling) * (couple + transposed(couple))
                       + per_leg(end) * np.eye(3))
        return mass

    def leg_coriolis(self, parameters: Parameters, at: Lines, joint_rates: Array,
                     christoffel: bool) -> Array:
        """
        Return C_i = I r r'^T + m_ab (t' r^T + t r'^T).

        As q and A are functions of x_i alone, these are the Christoffel symbols of M_i.
        """
        inertia, _, coupling, _ = _of_legs(parameters)
        assert at.path is not None
        t, r = _tangent_and_row(at)
        speeds, anchor_rates = at.anchor_rates(joint_rates)
        t_rate = speeds * at.path.curvatures
        d_rate = (joint_rates - anchor_rates) / at.lengths[..., None]
        lever_rate = dot(d_rate, t) + dot(at.directions, t_rate)
        r_rate = (d_rate - lever_rate * r) / at.levers()[..., None]
        c: Array = (per_leg(inertia) * (r[..., :, None] * r_rate[..., None, :])
                    + per_leg(coupling) * (t_rate[..., :, None] * r[..., None, :]
                                           + t[..., :, None] * r_rate[..., None, :]))
        return c

    def leg_gravity(self, parameters: Parameters, at: Lines) -> Array:
        """Return what holds crank and rod at rest under gravity."""
        g = parameters.gravity
        at_all = np.broadcast_to(-g, at.directions.shape)
        return _forces_at_rest(parameters, at, at_all, at_all, at_all)

    def base_coriolis(self, parameters: Parameters, at: Lines, spin: Array) -> Array:
        """Return 2 m_ab (skew(W) t r^T + r t^T skew(W)) + 2 m_b skew(W)."""
        _, _, coupling, end = _of_legs(parameters)
        t, r = _tangent_and_row(at)
        turn = skew(spin)[..., None, :, :]
        couple = t[..., :, None] * r[..., None, :]
        c: Array = (per_leg(2.0 * coupling) * (turn @ couple + transposed(couple) @ turn)
                    + per_leg(2.0 * end) * turn)
        return c

    def base_gravity(self, parameters: Parameters, at: Lines, position: Array,
                     felt: Callable[[Array], Array], spin: Array, spin_rate: Array) -> Array:
        """Return the same at rest on a base, and r u . (I W' + W x I W) of the crank."""
        assert at.path is not None
        centers = parameters.geometry.base_joints
        joints = position[..., None, :] + at.arms
        forces = _forces_at_rest(parameters, at, felt(centers), felt(centers - at.path.curvatures),
                                 felt(joints))
        axes = _crank_axes(parameters, at)
        w, w_rate = (np.einsum('...kij,...j->...ki', axes, each) for each in (spin, spin_rate))
        inertia = symmetric_matrices(turning_inertias(parameters))
        torque = (np.einsum('kij,...kj->...ki', inertia, w_rate)
                  + np.cross(w, np.einsum('kij,...kj->...ki', inertia, w)))[..., 2:]
        _, r = _tangent_and_row(at)
        on_legs: Array = forces + torque * r
        return on_legs

    def calibrated_legs(self, parameters: Parameters) -> CrankCalibration:
        """Return numbers and equations of the legs."""
        return CrankCalibration(parameters)

    def stop_loads(self, parameters: Parameters) -> StopLoads:
        """
        Return the inertias of shafts and cranks, and the rods, which move with the platform.

        The rod can have no energy but a positive one, so that shaft and crank alone are a bound of
        the inertia of a drive. Of the slope of a lever, (k / L1)' = n . B' / L2 - q' (L1 / L2 +
        d . e), the second part is at most c = 1 + L1 / L2 by the rate of the drive, and by
        (a + b)^2 <= 1.25 a^2 + 5 b^2 the stop near a dead centre adds 1.25 c^2 to the stiffness at
        the drive and 5 / L2^2 to that at the joint.
        """
        centers, inertias = crank_bodies(parameters)
        mass = parameters['legs.crank.mass']
        size, rods = parameters['legs.crank.length'], parameters['legs.rod.length']
        inertia = (parameters['actuator.reflected_inertia'] + inertias[:, 5]
                   + mass * np.sum(centers[:, :2] ** 2, axis=-1))
        least = np.maximum(_DEEPEST * parameters['limits.lever_min'], _LEAST_LEVER)
        return StopLoads(
            inertia, float(np.sum(parameters['legs.rod.mass'])), (least * size, size),
            1.0 + 1.25 * (1.0 + size / rods) ** 2, 5.0 / rods ** 2)

    def least_levers(self, parameters: Parameters, motions: Array, ends: Array, ways: Array,
                     ) -> Array:
        """
        Return lower bounds of (k / L1)^2, negative where a rod may not reach.

        (k / L1)^2 L2^2 = |l|^2 - (u . l)^2 - g^2 has the gradient 2 w with
        w = l - (u . l) u - g / L1 l, which changes by at most 1 + (|l| / L1)^2 + |g| / L1 of the
        way from the nearer end.
        """
        size, rod = parameters['legs.crank.length'], parameters['legs.rod.length']
        here, there = _reserve_at(parameters, motions), _reserve_at(parameters, ends)
        half = 0.5 * ways
        farthest = np.maximum(here.distances, there.distances) + half
        most = np.maximum(np.abs(here.g), np.abs(there.g)) + farthest * half / size
        steepest = np.maximum(here.slopes, there.slopes) + half * (
            1.0 + (farthest / size) ** 2 + most / size)
        least: Array = (0.5 * (here.values + there.values) - 2.0 * steepest * half) / rod ** 2
        return least

    def bound_intervals(self, parameters: Parameters, results: Array, squares: Array,
                        reach: Array) -> IntervalBounds:
        """
        Return bounds by the least ratio r = |k| / L1 of a lever in each interval.

        With a joint at the speed 1, q' is at most 1 / (r L1), the rod turns at most by
        (1 + 1 / r) / L2, and by k' / L1 = n . B' / L2 - q' (L1 / L2 + d . e) the lever changes, of
        itself, by at most (1 + (1 + L1 / L2) / r) / r of 1 / L2 and of 1 / L1.
        """
        inertia, crank_end, coupling, end = (np.abs(each) for each in _of_legs(parameters))
        size, rod = parameters['legs.crank.length'], parameters['legs.rod.length']
        least = np.maximum(_DEEPEST * parameters['limits.lever_min'], _LEAST_LEVER)
        r = np.sqrt(np.maximum(squares, least ** 2))
        turning = ((1.0 / rod + (1.0 / size + 1.0 / rod) / r) / r * reach).max(axis=1)
        bends = turning + ((1.0 + 1.0 / r) / rod * reach).max(axis=1)
        inertia = inertia + parameters['actuator.reflected_inertia']
        gains = 1.0 / (r * size)
        return IntervalBounds(
            gains, bends, turning, end + coupling / r, size, inertia * gains + size * coupling,
            np.maximum(end + coupling / r, coupling + crank_end / r))

    def nearest_fault(self, joints: Sequence[str], positions: Sequence[float],
                      ratios: Sequence[float]) -> str:
        """Return the leg that is nearest to a dead centre."""
        leg = int(np.argmin(ratios))
        return f'smallest lever: {joints[leg]}, {ratios[leg]:.3g} of its largest'

    def reach(self, parameters: Parameters) -> Array:
        """Return the lengths of the cranks."""
        size: Array = parameters['legs.crank.length']
        return size

    def wrong_sizes(self, parameters: Parameters, anchors: Array) -> Iterator[PossibleError]:
        """Yield lengths in mm, and rods that are shorter than the gap at home."""
        return crank_errors.wrong_sizes(parameters, anchors)

    def possible_errors(self, parameters: Parameters, home: AtHome) -> Iterator[PossibleError]:
        """Yield errors in signs and zeros of the cranks, their masses and limits."""
        at = self.lines(parameters, home.position, home.rotation)
        if not np.isfinite(at.directions).all():
            return iter(())
        above, at_home = (
            _angles_of_branches(parameters, position, home.rotation)[2] for position in (
                crank_errors.above_motors(parameters, home), home.position))
        return find_errors(crank_errors.CRANK_ERRORS, crank_errors.Cranks(
            parameters, home, above, at_home, at.levers(), crank_bodies(parameters)))

    def home_rule(self, parameters: Parameters, anchors: Array) -> str:
        """Return that the rods are shorter than the gap, or far too long."""
        gap = crank_errors.gap_of(parameters, anchors)
        rods = np.unique(parameters['legs.rod.length'])
        return (f'legs.rod.length: {shown(rods.tolist())} m: no level pose has rods of this length'
                ': while the platform joints are level with the ends of the cranks, at the '
                f'middle of their angles, they are {gap:.3g} m away from them')

    def choose_branch(self, legs: Records, parameters: Parameters,
                      home: Callable[[], tuple[Array, Array]]) -> bool:
        """Take the branch whose angle at home is within the limits and a quarter turn of zero."""
        wanted, of = _branches(parameters), legs
        if AUTO not in wanted:
            return False
        position, rotation = home()
        hexapod, undecided, angles = _angles_of_branches(parameters, position, rotation)
        missing = np.isnan(angles[:, 0]) & [each == AUTO for each in wanted]
        if missing.any():
            leg = int(np.argmax(missing))
            raise ParameterError(
                f'{parameters.source}: legs.rod.length: {parameters.joints[leg]}: '
                f'{parameters["legs.rod.length"][leg]:.6g} m: does not reach the platform joint '
                'at home, from which geometry.crank_branch: auto follows')
        if undecided:
            for line in lines_of(crank_errors.limits_in_degrees(parameters)):
                raise ParameterError(f'{parameters.source}: {line}')
            both, leg = divmod(undecided - 1, 6)
            up, down = (angles[leg].round(9) + 0.0).tolist()  # no -3e-16
            words = 'both are possible' if both else 'neither is likely'
            raise ParameterError(
                f'{parameters.source}: geometry.crank_branch: auto: {parameters.joints[leg]} has '
                f'an angle of {up:.4g} rad at home with the branch positive, {down:.4g} rad with '
                f'negative: {words}: give the branch, or limits.angle_min and '
                'limits.angle_max')
        of['branch'] = hexapod['legs']['branch']
        return True

    def branches(self, parameters: Parameters, position: Array, rotation: Array, mounts: Array,
                 size: float) -> list[LegBranch]:
        """Return cranks and rods."""
        return tree.branches(parameters, crank_bodies(parameters), position, rotation, mounts,
                             size)

    def tree_joints(self, parameters: Parameters, mounts: Array, home: tuple[Array, Array],
                    ) -> Callable[[Array, Array], Array]:
        """Return angles of the cranks and of the universal joints."""
        legs = tree.crank_legs(parameters)
        return partial(tree.tree_positions, legs, tree.mounts_on_cranks(legs, home, mounts))

    def drive_of(self, steps: Sequence[LegJoint]) -> int | None:
        """Return 0 if the first joint turns a crank."""
        return tree.drive_of(steps)

    def places(self, steps: Sequence[LegJoint]) -> list[str]:
        """Return at which end of the rod each joint is."""
        return tree.places(steps)

    def parting(self, steps: Sequence[LegJoint]) -> int:
        """Return the first joint at the end of the crank."""
        return 1

    def read_leg(self, chain: Chain, base: MechanismBody, platform: MechanismBody,
                 said: list[str]) -> dict[str, Any]:
        """Return the parameters of a leg in a file."""
        return tree.read_leg(self, chain, base, platform, said)

    def expanded(self, parameters: Parameters, name: str) -> Any:
        """Return centers of mass and inertias of all bodies in full."""
        if name in ('legs.rod.center_of_mass', 'legs.rod.inertia'):
            return tree.rod_value(parameters, name.rpartition('.')[2])
        bodies = crank_bodies(parameters)
        return {'legs.crank.center_of_mass': bodies[0], 'legs.crank.inertia': bodies[1]}.get(
            name, parameters[name])

    def tidy(self, values: dict[str, Any], resolution: float) -> None:
        """Give headings of level axes, and numbers that are the same for all cranks once."""
        tree.tidy(values, resolution)


def _about(centers: Array) -> Array:
    """Return the inertia (6, 6) of a mass of 1 at each center (6, 3), about the origin."""
    x, y, z = centers.T
    return np.stack([y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y])


def _masses_of_cranks(parameters: Parameters, values: Array) -> Array:
    """Return masses (6,) of the file, or the least of bodies with these ``mass_values``."""
    mass: Array = parameters['legs.crank.mass']
    squares, inertia = np.sum(values[:2] ** 2, axis=0), values[8]
    least = np.divide(squares, inertia, out=np.zeros(6), where=inertia > 0.0)
    found: Array = np.where(mass < (1.0 - _ROUNDING) * least, 1.0001 * least, mass)
    return found


def _check_bodies(parameters: Parameters, name: str, wrong: Flags, numbers: dict[str, Array],
                  ) -> None:
    """Raise ParameterError for the first leg of which no body has these numbers (6,)."""
    if wrong.any():
        leg = int(np.argmax(wrong))
        words = ', '.join(text.format(values[leg]) for text, values in numbers.items())
        raise ParameterError(
            f'{name} of {parameters.joints[leg]}: {words}: no body has these')


class _Angle(NamedTuple):
    """The crank of each leg at a pose."""

    arms: Array  # (..., 6, 3) [m]
    line: Array  # from base joint to platform joint (..., 6, 3) [m]
    along: Array  # e (..., 6, 3)
    normal: Array  # n
    size: Array  # length (6, 1) [m]


def _angle_of(parameters: Parameters, position: Array, rotation: Array) -> _Angle:
    legs: Any = parameters.structure['legs']
    u, z = crank_axes(parameters)
    n0 = np.cross(u, z)
    size, rod = parameters['legs.crank.length'], parameters['legs.rod.length']
    arms = joint_arms(rotation, parameters.geometry.platform_joints)
    line = position[..., None, :] + arms - parameters.geometry.base_joints
    x, y, height = (dot(line, axis)[..., 0] for axis in (z, n0, u))
    square = x * x + y * y
    g = (square + height * height + size * size - rod * rod) / (2.0 * size)
    h = legs['branch'] * np.sqrt(square - g * g)
    cosine, sine = ((x * g + y * h) / square)[..., None], ((y * g - x * h) / square)[..., None]
    return _Angle(arms, line, z * cosine + n0 * sine, n0 * cosine - z * sine, size[:, None])


class _Reserve(NamedTuple):
    """The square of the lever times (L2 / L1)^2, |l|^2 - (u . l)^2 - g^2, at poses (N, 6)."""

    values: Array  # [m^2]
    slopes: Array  # half of the largest change by the way of the platform joint [m]
    distances: Array  # |l| [m]
    g: Array  # [m]


def _reserve_at(parameters: Parameters, motions: Array) -> _Reserve:
    u, _ = crank_axes(parameters)
    size, rod = parameters['legs.crank.length'], parameters['legs.rod.length']
    position, rotation = motions[:, _POSITION], motions[:, _ROTATION].reshape(-1, 3, 3)
    line = position[:, None] + joint_arms(
        rotation, parameters.geometry.platform_joints) - parameters.geometry.base_joints
    square, height = dot(line, line)[..., 0], dot(line, u)[..., 0]
    g = (square + (size * size - rod * rod)) / (2.0 * size)
    slopes: Array = np.linalg.norm(
        (1.0 - g / size)[..., None] * line - height[..., None] * u, axis=-1)
    return _Reserve(square - height ** 2 - g ** 2, slopes, np.sqrt(square), g)


def _of_legs(parameters: Parameters) -> tuple[Array, Array, Array, Array]:
    """Return inertia about the axis, mass at the crank's end, coupling, mass at the platform."""
    legs: Any = parameters.structure['legs']
    return (legs['turning_inertia'][:, 5], legs['crank_end_mass'], legs['coupling_mass'],
            legs['platform_end_mass'])


def _tangent_and_row(at: Lines) -> tuple[Array, Array]:
    """Return t = dA/dq and r = dq/dx = d / k (..., 6, 3)."""
    assert at.path is not None
    return at.path.tangents, at.directions / at.levers()[..., None]


def _crank_axes(parameters: Parameters, at: Lines) -> Array:
    """Return the axes e, n, u of the cranks (..., 6, 3, 3), row by row."""
    assert at.path is not None
    size = parameters['legs.crank.length'][:, None]
    e, n = -at.path.curvatures / size, at.path.tangents / size
    return np.stack([e, n, np.broadcast_to(crank_axes(parameters)[0], e.shape)], axis=-2)


def _forces_at_rest(parameters: Parameters, at: Lines, at_center: Array, at_tip: Array,
                    at_end: Array) -> Array:
    """Return forces at the platform joints (..., 6, 3) [N] for accelerations felt at rest."""
    _, _, coupling, end = _of_legs(parameters)
    t, r = _tangent_and_row(at)
    axes = _crank_axes(parameters, at)
    legs: Any = parameters.structure['legs']
    moment = legs['turning_moment']
    torque = dot(moment[:, :1] * axes[..., 1, :] - moment[:, 1:] * axes[..., 0, :], at_center)
    torque = torque + coupling[:, None] * dot(t, at_end)
    forces: Array = (torque * r + coupling[:, None] * at_tip + end[:, None] * at_end)
    return forces


def turning_inertias(parameters: Parameters) -> Array:
    """Return inertias (6, 6) of cranks and the points at their ends, about the base joints."""
    legs: Any = parameters.structure['legs']
    inertias: Array = legs['turning_inertia']
    return inertias


def symmetric_matrices(six: Array) -> Array:
    """Return matrices (..., 3, 3) of xx xy xz yy yz zz."""
    matrices: Array = six[..., [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    return matrices


def crank_bodies(parameters: Parameters) -> tuple[Array, Array]:
    """Return centers of mass (6, 3) [m] and inertias about them (6, 6), both in [e n u]."""
    given = parameters['legs.crank.center_of_mass']
    centers = np.zeros((6, 3))
    if given.shape in ((1,), (6,)):
        centers[:, 0] = given  # along the crank alone
    else:
        centers[:] = given
    given = parameters['legs.crank.inertia']
    inertias = np.zeros((6, 6))
    if given.shape == (1,):
        inertias[:, 5] = given  # about the axis alone
    else:
        inertias[:] = given
    return centers, inertias


def crank_ends(parameters: Parameters, angles: Array) -> Array:
    """Return the ends of the cranks (..., 6, 3) at their angles (..., 6), base frame [m]."""
    u, z = crank_axes(parameters)
    along = z * np.cos(angles)[..., None] + np.cross(u, z) * np.sin(angles)[..., None]
    sizes = parameters['legs.crank.length'][:, None]
    ends: Array = parameters.geometry.base_joints + sizes * along
    return ends


def crank_axes(parameters: Parameters) -> tuple[Array, Array]:
    """Return the axes of the motors and the cranks at the angle 0, unit vectors (6, 3) each."""
    legs: Any = parameters.structure['legs']
    return legs['crank_axis'], legs['crank_direction']


def _branches(parameters: Parameters) -> tuple[str, ...]:
    given: tuple[str, ...] = parameters['geometry.crank_branch']
    return given * 6 if len(given) == 1 else given


def _complete_axes(parameters: Parameters, source: str) -> None:
    """Set axes and directions that follow from headings; level axes lift at a positive angle."""
    headings, axes, directions = (parameters[name] for name in (HEADINGS, AXES, DIRECTIONS))
    if headings is None:
        if axes is None and directions is None:
            raise ParameterError(f'{source}: {HEADINGS}: not set: needed by {Crank.marker}; or '
                                 f'give {AXES} and {DIRECTIONS}')
        for name, other in ((AXES, DIRECTIONS), (DIRECTIONS, AXES)):
            if parameters[name] is None:
                raise ParameterError(f'{source}: {name}: not set: needed by {other}')
        for name, given in ((AXES, axes), (DIRECTIONS, directions)):
            if not given.any(axis=-1).all():
                leg = int(np.argmin(given.any(axis=-1)))
                raise ParameterError(f'{source}: {name}: {parameters.joints[leg]}: '
                                     f'{given[leg].tolist()}: a direction must not be 0, 0, 0')
        return
    found = {AXES: np.empty((6, 3)), DIRECTIONS: np.empty((6, 3))}
    function('level_cranks')(headings, *found.values())
    for name, value in found.items():
        if parameters[name] is not None and not np.array_equal(parameters[name], value):
            raise ParameterError(f'{source}: {name}: given as well as {HEADINGS}: leave out one '
                                 'of them')
        parameters._complete(name, value)


def _angles_of_branches(parameters: Parameters, position: Array, rotation: Array,
                        ) -> tuple[Any, int, Array]:
    """
    Return the structure () with the branches that a pose decides, and angles (6, 2) there.

    Angles [rad] are those of the branches positive and negative, nan out of reach; between them
    stands the answer of ``choose_branches`` in C: whether a branch is not decided.
    """
    hexapod: Any = parameters.structure.copy()
    angles = np.empty((6, 2))
    undecided: int = function('choose_branches')(
        hexapod, np.concatenate([position, np.ravel(rotation)]),
        np.array([_SIGNS[each] for each in _branches(parameters)]), angles)
    return hexapod, undecided, angles


CRANK = Crank()
