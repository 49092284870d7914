# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Travel, loads, rates and payload of a hexapod at a pose, and the speed of a motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.capability import travel
from stewart_dynamics.capability.clearance import Clearance
from stewart_dynamics.capability.force_intervals import (
    largest_multiple, quadratic_exit)
from stewart_dynamics.capability.growth import Growth
from stewart_dynamics.capability.motions import Deviations, faster, timed
from stewart_dynamics.capability.motor_bounds import MotorBounds
from stewart_dynamics.capability.quantities import (
    Angles, Conditioning, Lengths, Levers, Quantity, starts_at, Turns)
from stewart_dynamics.capability.reachable import Boxes, checked_ranges, Reachable
from stewart_dynamics.capability.stuck_leg import remaining
from stewart_dynamics.capability.travel import ENDS
from stewart_dynamics.capability.workspace import InBox, Section, section, smallest
from stewart_dynamics.errors import MotionError, ParameterError
from stewart_dynamics.legs import require_kind
from stewart_dynamics.mechanics import limits
from stewart_dynamics.mechanics.arguments import (
    as_array, check_finite, common_shape, copies, wrong_type)
from stewart_dynamics.mechanics.dynamics import lagrange
from stewart_dynamics.mechanics.dynamics.friction import Friction
from stewart_dynamics.mechanics.dynamics.linear_parameters import with_point_mass
from stewart_dynamics.mechanics.dynamics.result import InverseDynamics
from stewart_dynamics.mechanics.frames.base_motion import BaseMotion
from stewart_dynamics.mechanics.frames.motion import check_kind, Motion, motion_rows, Pose
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.mechanics.kinematics.leg_clearance import LegClearance
from stewart_dynamics.mechanics.pose_limits import PoseLimits
from stewart_dynamics.mechanics.rows import (
    ACCELERATION, DETERMINANT, FORCES, JOINT_FORCES, MOTION, POSE, TWIST)
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.mechanics.stiffness import geometric_stiffness, modes_of, NaturalModes
from stewart_dynamics.parameters.table import Parameters

_ENDS = np.array(ENDS)
# Bounds where a minimum is not given.
_UNLIMITED = {limits.LENGTH_MIN: 0.0, limits.CLEARANCE_MIN: -math.inf}
# Limits of a path, after those of drives; of those that are exceeded at one sample the first one
# is named.
_OF_PATHS = (limits.CLEARANCE_MIN, *limits.OF_JOINTS)
_OTHER_ENDS = slice(-6, None)  # of legs, in ``load_rows``
# Rounds in which the least tilt between two azimuths is found.
_ZOOMS = 6
# Step of a numerical derivative by the pose [m, rad].
_STEP = 1e-5
_AROUND: Array = np.linspace(-1.0, 1.0, 33, dtype=np.float64)


class Extent(NamedTuple):
    """
    How far something can grow until the first limit of a hexapod.

    Attributes
    ----------
    value : float or (...)
        In the unit of the question; 0 where a limit is exceeded already, infinity where nothing
        limits.
    limit : str or (...)
        Name of the limit without ``limits.`` or ``drive.``, or ``singularity``; empty where
        nothing limits.
    leg : int or (...)
        Index from 0 of the leg that reaches it, of two legs that are too near the first; -1 for a
        singularity or nothing.
    sample : int or None
        Index of the sample of a motion at which it is reached, or of the last one before.
    time : float or None
        Time in a motion with times at which it is reached [s].
    upper : float or None
        A factor that is proven not to be reachable, of a box; ``value`` is proven to be.

    """

    value: Any
    limit: Any
    leg: Any
    sample: int | None = None
    time: float | None = None
    upper: float | None = None


class StuckLeg(NamedTuple):
    """
    A platform with a leg that keeps its length: see ``stuck_leg.Remaining``.

    Attributes
    ----------
    leg : int
        Index of the leg from 0.
    motions, wrenches : (..., 5, 6)
        The motions that remain [m/s, rad/s], and the wrench along each [N, N m], base axes.
    lost : (..., 6)
        The motion that the leg blocks.
    velocity : Extent or None
        Largest multiple (..., 5) of each motion; None without a limit of rates or speeds.
    load : Extent or None
        Largest multiple (..., 5, 2) of each wrench and of its opposite that the platform at rest
        can exert on its surroundings; None without a limit of forces or torques.
    payload : Extent or None
        Largest point mass that can be added [kg], likewise.

    """

    leg: int
    motions: Array
    wrenches: Array
    lost: Array
    velocity: Extent | None
    load: Extent | None
    payload: Extent | None


class Tilt(NamedTuple):
    """How far a platform can tilt."""

    azimuths: Array
    """Angles of the axes from the base's x axis (N,) [rad]."""
    extents: Extent
    """Travel about each axis (N,) [rad]."""
    total: Extent
    """The smallest about all axes [rad], between the azimuths, too."""


class Capability:
    """
    Answers to "possible?" and "how far?" of a hexapod: exact, without sampling.

    J_inv is square, as is J_q of screws that turn with their legs (``turning_screws``), so leg
    forces are an affine function of a load, of an acceleration and of an added mass: each question
    at a pose is six intervals. Poses and directions have any leading shapes that broadcast against
    each other. A direction is six numbers, translation and rotation (or force and moment), base
    axes; answers are multiples of it, so a unit vector gives meters, radians, newtons. Loads,
    rates and payload are those of a pose whether or not its lengths, joint angles and clearance
    are within their limits: ``reachable`` and ``travel`` say that.

    Parameters
    ----------
    platform : StewartPlatform
        The hexapod; its ``limits.*`` that are not set do not limit. Where ``drive.*`` limits the
        motors, loads and accelerations end at their torques, rates at their speeds: of two limits
        the tighter one.

    Raises
    ------
    ParameterError
        By all calls: no limit of the question is set; names them.
    MotionError
        By all calls: an argument has another type or shape, or is not finite; a whole motion has
        no samples. No poses or directions, shape (0,), are no error: the answers are empty.
    SingularityError
        By calls on forces: J_inv cannot be solved at a pose.

    """

    def __init__(self, platform: StewartPlatform) -> None:
        if not isinstance(platform, StewartPlatform):
            raise wrong_type('platform', platform, 'a StewartPlatform')
        self.platform = platform
        self._kind = kind = platform.parameters.leg_kind
        self._known = limits.limits_of(platform.parameters)
        self._pose_limits = PoseLimits(platform.parameters)
        self._limits = self._pose_limits.limits
        bounds = self._limits.bounds
        self._bounds = np.array([
            bounds.get(name, np.full(6, _UNLIMITED.get(name, math.inf)))
            for name in limits.OF_POSES])
        clearance, angles = self._pose_limits.clearance, self._pose_limits.angles
        none = np.empty((0, 3))
        self._shapes = np.full((6, 3), math.nan) if clearance is None else clearance.shapes
        self._plates = (none, none) if clearance is None else (clearance.base, clearance.platform)
        self._axes = np.full((12, 3), math.nan) if angles is None else angles.axes
        size = float(platform.parameters.singularity.characteristic_length)
        nearest = float(self._bounds[travel.CLEARANCE_MIN, 0])
        self._margins = travel.PoseMargins(
            Lengths(self._bounds[:2]) if (self._bounds[0] > 0.0).any() or np.isfinite(
                self._bounds[1]).any() else None,
            Angles(self._bounds[2:4], self._axes[:6]) if (
                self._bounds[2:4] < math.pi).any() else None,
            Conditioning(self._pose_limits.stop_condition),
            None if clearance is None else Clearance(
                clearance.shapes, nearest, size, *map(len, self._plates)), size,
            _on_circles(platform.parameters))
        self._ends_differ = kind.ends_differ and kind.joint_force_limit in bounds
        self._motors = MotorBounds(platform.parameters) if platform.parameters.drives else None
        self._frictionless = StewartPlatform(platform.parameters.replaced({
            'actuator.viscous_friction': 0.0, 'actuator.coulomb_friction': 0.0}))

    def travel(self, pose: Pose | Motion, direction: ArrayLike, pivot: ArrayLike | None = None,
               ) -> Extent:
        """
        Return how far the platform can move from a pose until the first limit.

        Lengths, joint angles, clearance of the legs, and the condition number of J_inv up to
        ``singularity.stop_condition``, which comes before det(J) = 0. No limit is exceeded before
        the answer: one that is left and entered again is not passed.

        Parameters
        ----------
        pose : Pose or Motion
            Start of the travel, (...).
        direction : (..., 6)
            Translation [m] and rotation vector [rad] for a travel of 1, base axes.
        pivot : (..., 3), optional
            Point that the platform turns about, platform frame [m]; by default its origin.

        Raises
        ------
        MotionError
            A bounded number of steps does not decide whether a limit is exceeded.

        """
        return self._travel(pose, direction, pivot, False)

    def _travel(self, pose: Pose | Motion, direction: ArrayLike, pivot: ArrayLike | None,
                shortest: bool) -> Extent:
        """Return the travels; with ``shortest`` only the smallest is needed."""
        check_kind(pose, Pose, Motion)
        directions, sizes = _directions(direction)
        pivots = np.zeros(3) if pivot is None else as_array('pivot', pivot, (3,))
        shape = common_shape(pose=pose.shape, direction=directions.shape[:-1],
                             pivot=pivots.shape[:-1])
        rows = motion_rows(pose, shape)
        starts = starts_at(self.platform.parameters, self._axes, self._plates, rows,
                           copies(pivots, shape))
        values, codes, legs = travel.travels(
            self._margins, starts, copies(directions, shape),
            copies(sizes[..., None], shape)[:, 0] if shortest else None)
        if np.isnan(values).any():
            at = int(np.isnan(values).argmax())
            where = list(map(int, np.unravel_index(at, shape))) if shape else ''
            raise MotionError(f'travel{where}: {_ENDS[codes[at]]}: not decided whether it is '
                              'exceeded, after the largest number of steps')
        return _extent(values.reshape(shape) / sizes, _ENDS[codes].reshape(shape),
                       legs.reshape(shape))

    def reachable(self, box: ArrayLike, pose: Pose | Motion | None = None,
                  pivot: ArrayLike | None = None) -> Reachable:
        """
        Return whether all poses of a box of ranges are within the limits: proven, not sampled.

        Lengths, joint angles, clearance of the legs, the condition number up to
        ``singularity.stop_condition``, and the sign of det(J), by branch and bound
        (``capability.reachable``). The work is bounded: a box that is within the limits, but too
        near to a singularity, may be answered with ``certain`` False and a worst pose whose excess
        is negative.

        Parameters
        ----------
        box : (6, 2)
            Ranges of the translation of the pivot [m] and of the rotation vector [rad] from the
            pose, base axes, all at once.
        pose : Pose or Motion of one sample, optional
            By default the home pose.
        pivot : (3,), optional
            Point that the platform turns about, platform frame [m]; by default its origin.

        """
        ranges = checked_ranges(box)
        return self._boxes(pose, pivot).reachable(ranges)

    def reachable_factor(self, box: ArrayLike, pose: Pose | Motion | None = None,
                         pivot: ArrayLike | None = None) -> Extent:
        """
        Return the largest factor by which a box of ranges can be scaled and still is reachable.

        Arguments are those of ``reachable``; each range includes zero. The box of the answer is
        proven to be reachable, and one of the factor ``upper``, which a travel in it gives, is
        not. They differ by 1e-9 of it where lengths or joint angles limit; by 1e-3 where the
        clearance of the legs or a singularity limits, and by more where that is not decided
        within a bounded number of steps. Rotations grow up to a turn.
        """
        ranges = checked_ranges(box)
        if (ranges[:, 0] > 0.0).any() or (ranges[:, 1] < 0.0).any():
            raise MotionError('box: a range without zero cannot be scaled')
        found = self._boxes(pose, pivot).factor(ranges)
        return Extent(found.value, found.limit, found.leg, upper=found.upper)

    def smallest(self, quantity: Callable[[Pose], ArrayLike], box: ArrayLike,
                 pose: Pose | Motion | None = None, pivot: ArrayLike | None = None) -> InBox:
        """
        Return the smallest value of a quantity over a box of ranges, and its pose: searched.

        Corners, random poses and a search along the coordinates; not a proof.
        ``capability.smallest(capability.force, box)`` is the force that can be exerted everywhere.

        Parameters
        ----------
        quantity : callable
            Takes poses of shape (N,), returns (N,).
        box, pose, pivot
            As in ``reachable``.

        """
        ranges, boxes = checked_ranges(box), self._boxes(pose, pivot)
        return smallest(lambda poses: np.asarray(quantity(poses), dtype=float), boxes.poses,
                        ranges)

    def section(self, pose: Pose | Motion | None = None, normal: str = 'z') -> Section:
        """
        Return the reachable positions in a plane through a pose, at its rotation.

        The curves on which lengths and joint angles end are exact; holes are holes. Boundaries at
        singularities and at the clearance of the legs, if there are any, are exact at points of a
        grid of 128 x 128; parts that are thinner than one of its steps are missed. So are all
        boundaries of legs whose lengths do not change, and whose anchors are moved.

        Parameters
        ----------
        pose : Pose or Motion of one sample, optional
            By default the home pose.
        normal : 'x', 'y' or 'z'
            Base axis normal to the plane: the platform's origin has the pose's coordinate there.

        """
        if not (self._margins.circles or limits.LENGTH_MAX in self._limits.bounds):
            raise self._unlimited((limits.LENGTH_MAX,))
        if normal not in ('x', 'y', 'z'):
            raise wrong_type('normal', normal, "'x', 'y' or 'z'")
        return section(self.platform, self._axes, self._single(pose), 'xyz'.index(normal))

    def tilt(self, pose: Pose | Motion | None = None, pivot: ArrayLike | None = None,
             azimuths: int = 360) -> Tilt:
        """
        Return how far the platform can tilt about every horizontal axis, and about all of them.

        Parameters
        ----------
        pose : Pose or Motion of one sample, optional
            By default the home pose.
        pivot : (3,), optional
            Point that the platform turns about, platform frame [m]; by default its origin.
        azimuths : int
            Number of axes, in the base's x-y plane, at equal angles from x.

        """
        start = self._single(pose)
        if not isinstance(azimuths, int) or azimuths < 3:
            raise wrong_type('azimuths', azimuths, 'an integer of at least 3')

        def about(angles: Array) -> Extent:
            directions = np.zeros((len(angles), 6))
            directions[:, 3], directions[:, 4] = np.cos(angles), np.sin(angles)
            return self.travel(start, directions, pivot)

        step = 2.0 * math.pi / azimuths
        angles: Array = step * np.arange(azimuths, dtype=float)
        found = about(angles)
        middle = angles[int(np.argmin(found.value))]
        for _ in range(_ZOOMS):  # toward the least one between two azimuths
            near: Array = middle + step * _AROUND
            close = about(near)
            at = int(np.argmin(close.value))
            middle, step = near[at], step / 16.0
        total = Extent(float(close.value[at]), str(close.limit[at]), int(close.leg[at]))
        return Tilt(angles, found, total)

    def _single(self, pose: Pose | Motion | None) -> Motion:
        """Return one pose at rest, by default home."""
        start = self.platform.home_pose() if pose is None else pose
        row = motion_rows(start)
        if start.shape:
            raise MotionError(f'pose: shape {start.shape}: must be a single one')
        return Motion.of_rows(row[0])

    def _boxes(self, pose: Pose | Motion | None, pivot: ArrayLike | None) -> Boxes:
        center = np.zeros(3) if pivot is None else as_array('pivot', pivot, (3,))
        if center.ndim > 1:
            raise MotionError(f'pivot: shape {center.shape}: must be (3,)')
        row = self._single(pose).rows
        starts = starts_at(self.platform.parameters, self._axes, self._plates, row[None],
                           center[None])

        def ends(directions: Array) -> travel.Ends:
            every: Integers = np.zeros(len(directions), dtype=np.int64)
            return travel.travels(self._margins, starts.take(every), directions,
                                  np.ones(len(directions)))

        return Boxes(self.platform, self._margins, starts, ends, row, center)

    def wrench(self, pose: Pose | Motion, direction: ArrayLike, base: BaseMotion | None = None,
               *, continuous: bool = False) -> Extent:
        """
        Return the largest wrench that the platform at rest can exert on its surroundings.

        Applied as ``wrench = -value * direction`` to ``inverse_dynamics``, it brings the leg that
        is named to its limit of force or torque, the latter with the breakaway torque.

        Parameters
        ----------
        pose : Pose or Motion
            Pose, (...).
        direction : (..., 6)
            Force [N] and moment [N m] at the platform's origin for a value of 1, base axes.
        base : BaseMotion, optional
            Motion or tilt of the base, as in ``inverse_dynamics``.
        continuous : bool
            Held without end: ``drive.torque_continuous`` counts as well, for the torque without
            losses, which is that of ``motors`` and heats the winding. By default what the peak
            torque can hold for a short time.

        """
        directions, sizes = _directions(direction)
        still = self._held(pose)
        return _divided(self._multiple(
            still, self._results(still, base), self._change(pose, wrench=-directions),
            continuous=continuous), sizes)

    def stuck_leg(self, pose: Pose | Motion, leg: int,
                  center_of_mass: ArrayLike = (0.0, 0.0, 0.0)) -> StuckLeg:
        """
        Return the motions that remain while a leg keeps its length, and the loads they can hold.

        A brake is on, or a screw has jammed: the leg holds any force, which no motor makes, so
        that the limits of its actuator's force and torque do not count. That of the force in its
        joints does.

        Parameters
        ----------
        pose : Pose or Motion
            Pose, (...).
        leg : int
            Index of the leg from 0.
        center_of_mass : (3,)
            Position of the payload, platform frame [m].

        Raises
        ------
        SingularityError
            J_inv cannot be solved at a pose.

        """
        if isinstance(leg, bool) or not (isinstance(leg, int | np.integer) and 0 <= leg < 6):
            raise MotionError(f'leg: {leg!r}: must be an index from 0 to 5')
        still = self._held(pose)
        results = self._results(still, None)
        found = remaining(self.platform.drive_jacobian(pose), leg, float(
            self.platform.parameters.singularity.characteristic_length))
        one = Motion.of_rows(still.rows[..., None, :])
        wrenches = None
        if self.limits_forces:
            both = np.stack([found.wrenches, -found.wrenches], axis=-2)
            two = Motion.of_rows(still.rows[..., None, None, :])
            wrenches = self._multiple(
                two, results[..., None, None, :], self._change(two, wrench=-both), stuck=leg)
        return StuckLeg(
            leg, found.motions, found.wrenches, found.lost,
            self.velocity(one, found.motions) if self.limits_rates else None, wrenches,
            self._added_mass(still, results, center_of_mass, stuck=leg)
            if self.limits_forces else None)

    def clearance(self, pose: Pose | Motion) -> Array | float:
        """Return the smallest distance of a leg from another or a plate [m]; negative: overlap."""
        require_kind(self.platform.parameters, 'clearance between legs')
        values = LegClearance(self.platform.parameters)(motion_rows(pose)).min(axis=1)
        return float(values[0]) if pose.shape == () else values.reshape(pose.shape)

    def stiffness(self, pose: Pose | Motion, leg_stiffness: ArrayLike) -> Array:
        """
        Return the stiffness K (..., 6, 6) at rest, as ``StewartPlatform.stiffness``.

        It includes the forces of the legs, which turn with them: minus the derivative of the
        wrench of six springs that carry these forces at the lengths of the pose.
        """
        check_kind(pose, Pose, Motion)
        legs = lagrange.legs(self.platform.parameters, pose.position, pose.rotation)
        return self.platform.stiffness(pose, leg_stiffness) + geometric_stiffness(
            legs, self._results(self._held(pose), None)[..., self._efforts], pose.rotation,
            self.platform.screws)

    def modes(self, pose: Pose | Motion, leg_stiffness: ArrayLike) -> NaturalModes:
        """
        Return natural frequencies and shapes at rest, as ``StewartPlatform.natural_modes``.

        Besides ``stiffness``, the change of the weight's wrench holds the platform or tips it
        over; both together are symmetric. At a pose that is not stable the frequency of each mode
        that does not come back is 0.
        """
        total = self.stiffness(pose, leg_stiffness) + self._weight_stiffness(pose)
        return modes_of(
            self.platform.mass_matrix(pose), 0.5 * (total + np.swapaxes(total, -1, -2)))

    def _weight_stiffness(self, pose: Pose | Motion) -> Array:
        """Return the derivative (..., 6, 6) of the gravity vector, by central differences."""
        columns = []
        for direction in _STEP * np.eye(6):
            ends = [self.platform.gravity_vector(Pose(
                pose.position + sign * direction[:3],
                from_euler(sign * direction[3:]) @ pose.rotation)) for sign in (1, -1)]
            columns.append((ends[0] - ends[1]) / (2.0 * _STEP))
        return np.stack(columns, axis=-1)

    def force(self, pose: Pose | Motion, *, continuous: bool = False) -> Array | float:
        """
        Return the force [N] that the platform at rest can exert in every direction.

        ``continuous`` as in ``wrench``.
        """
        return self._in_every_direction(pose, slice(0, 3), continuous)

    def moment(self, pose: Pose | Motion, *, continuous: bool = False) -> Array | float:
        """
        Return the moment [N m] that the platform at rest can exert about every axis.

        ``continuous`` as in ``wrench``.
        """
        return self._in_every_direction(pose, slice(3, 6), continuous)

    def velocity(self, pose: Pose | Motion, direction: ArrayLike) -> Extent:
        """Return the largest twist along a direction (..., 6) that legs and motors permit."""
        directions, sizes = _directions(direction)
        rows = np.zeros((*common_shape(pose=pose.shape, direction=directions.shape[:-1]), MOTION))
        rows[..., POSE], rows[..., TWIST] = pose.rows[..., POSE], directions
        moving = Motion.of_rows(rows)
        found = self._of_rates(moving, self.platform.inverse_dynamics(moving))
        if not found:
            raise self._unlimited((self._kind.rate_limit,))
        return _divided(_smallest(*_tightest(found)), sizes)

    def acceleration(self, pose: Pose | Motion, direction: ArrayLike,
                     motion: Motion | None = None) -> Extent:
        """
        Return the largest acceleration along a direction that forces and torques permit.

        Parameters
        ----------
        pose : Pose or Motion
            Pose, (...).
        direction : (..., 6)
            Acceleration of the platform's origin [m/s^2] and angular acceleration [rad/s^2] for a
            value of 1, base axes.
        motion : Motion, optional
            Its twist is that of the platform; by default it is at rest.

        """
        directions, sizes = _directions(direction)
        moving = self._held(pose, motion)
        return _divided(self._multiple(
            moving, self._results(moving, None), self._change(pose, acceleration=directions),
            directions=directions), sizes)

    def payload(self, motion: Pose | Motion, center_of_mass: ArrayLike,
                times: ArrayLike | None = None, *, continuous: bool = False,
                wrench: ArrayLike | None = None, base: BaseMotion | None = None) -> Extent:
        """
        Return the largest point mass that can be added to the platform [kg].

        Parameters
        ----------
        motion : Pose or Motion
            Poses at rest, with an answer for each; or a motion, with one answer for all samples.
        center_of_mass : (3,)
            Position of the added mass, platform frame [m].
        times : (N,), optional
            Times of a motion (N,), as in ``speed_factor``.
        continuous : bool
            Held without end, as in ``wrench``: for poses at rest.
        wrench, base
            As in ``speed_factor``: the load beside the mass, and the motion of the base.

        """
        if continuous and (times is not None or isinstance(motion, Motion)):
            raise MotionError('continuous: must be False for a motion: drive.torque_continuous '
                              'limits what is held at rest')
        if times is not None:
            return timed(
                times, motion, lambda each, _: self.payload(
                    each, center_of_mass, wrench=wrench, base=base),
                lambda mass: (StewartPlatform(with_point_mass(
                    self.platform.parameters, mass, center_of_mass)), motion.rows, 1.0),
                wrench, base)
        moving = motion if isinstance(motion, Motion) else Motion.from_pose(motion)
        return self._added_mass(
            moving, self.load_rows(moving, wrench, base), center_of_mass, base,
            whole=isinstance(motion, Motion), continuous=continuous)

    def _added_mass(self, moving: Motion, results: Array, center_of_mass: ArrayLike,
                    base: BaseMotion | None = None, **how: Any) -> Extent:
        """Return the largest point mass [kg] beside results; ``how`` as in ``_multiple``."""
        center = as_array('center_of_mass', center_of_mass, (3,))
        of_base = BaseMotion(self.platform.parameters.gravity) if base is None else base
        with np.errstate(over='ignore', invalid='ignore'):
            arm = moving.rotation @ center
            turning = np.cross(moving.angular_velocity, arm)
            carried = np.cross(of_base.angular_velocity, np.cross(
                of_base.angular_velocity, moving.position + arm)
                + 2.0 * (moving.linear_velocity + turning)) + np.cross(
                    of_base.angular_acceleration, moving.position + arm)
            force = of_base.gravity - of_base.linear_acceleration - carried - (
                moving.linear_acceleration + np.cross(moving.angular_acceleration, arm)
                + np.cross(moving.angular_velocity, turning))
            load = check_finite(
                'center_of_mass', np.concatenate([force, np.cross(arm, force)], axis=-1), 0)
        return self._multiple(moving, results, self._change(moving, wrench=load), **how)

    def speed_factor(self, motion: Motion, wrench: ArrayLike | None = None,
                     base: BaseMotion | None = None, times: ArrayLike | None = None) -> Extent:
        """
        Return how much faster a motion can be played until the first limit.

        Played k times as fast, leg rates are k times as large, and leg forces
        ``g + k c1 + k^2 c2`` with a Coulomb friction that is linear below
        ``actuator.coulomb_velocity``: so the answer is the smallest root of all samples. Torques
        of motors likewise, piece by piece of ``drive.torque_speed``. Below 1
        the motion is not possible as it is; 0 where a length, a joint angle, a clearance or a
        singularity, up to ``singularity.stop_condition``, ends it at any speed.

        Parameters
        ----------
        motion : Motion
            Samples of the motion, (...).
        wrench : (..., 6), optional
            External wrench, which does not depend on the speed.
        base : BaseMotion, optional
            Motion of the base, likewise.
        times : (N,), optional
            Times of a motion (N,) [s]: the motion between the samples counts as well, by the rules
            of planned trajectories (``planned_trajectory``). Where a limit may be exceeded between
            two samples at the answer of the samples alone, at least 16 samples are put between
            them; the extreme that limits is then found to rounding errors. Wrench and base must
            be constant. By default the samples alone count.

        """
        if times is not None:
            return timed(times, motion, lambda each, _: self.speed_factor(each, wrench, base),
                         lambda k: (self.platform, faster(motion.rows, k), k), wrench, base)
        solved = self.platform.inverse_dynamics(motion, singular='nan')
        ended = self._of_path(motion, solved)
        if ended is not None:
            return ended
        found = [*self._of_rates(motion, solved), *self._speed_of_forces(motion, wrench, base)]
        if not found:
            raise self._unlimited((self._kind.rate_limit, self._kind.effort_limit))
        return _of_all(*_tightest(found))

    def amplitude_factor(self, motion: Motion, center: Pose | Motion | None = None,
                         wrench: ArrayLike | None = None, base: BaseMotion | None = None,
                         times: ArrayLike | None = None) -> Extent:
        """
        Return how much larger a motion can be until the first limit.

        Positions and rotation vectors from a center grow by the factor, and their rates and
        accelerations with them. Lengths, joint angles, clearance and singularities end the factor
        as they end a ``travel`` from the center. Rates, forces, and speeds and torques of motors
        are sampled at ``growth.STEPS`` equal steps of the factor, up to that end; where it has
        none, up to 1, and from then on up to twice the factor. The answer is the first root in
        the first step at whose end a limit is exceeded, exact to rounding errors; a limit that
        is exceeded only between two steps is passed.

        Parameters
        ----------
        motion : Motion of shape (N,)
            Samples of the motion.
        center : Pose or Motion of one sample, optional
            By default the first pose of the motion; less than half a turn from all poses.
        wrench, base, times
            As in ``speed_factor``.

        Raises
        ------
        MotionError
            Next to a singularity it is not known whether a limit is exceeded.

        """
        check_kind(motion, Motion)
        if len(motion.shape) != 1 or not len(motion):
            raise MotionError(f'motion: shape {motion.shape}: must be (N,), of N samples')
        start = self._single(Pose(motion.position[0], motion.rotation[0]) if center is None
                             else center)
        if times is not None:
            return timed(
                times, motion, lambda each, most: self._amplitude(each, start, wrench, base, most),
                lambda k: (self.platform, Deviations(start, motion.rows).at(k), 1.0), wrench, base)
        return self._amplitude(motion, start, wrench, base, math.inf)

    def _amplitude(self, motion: Motion, start: Motion, wrench: ArrayLike | None,
                   base: BaseMotion | None, most: float) -> Extent:
        deviations = Deviations(start, motion.rows)
        moving = np.flatnonzero(deviations.changes[:, 0].any(axis=1))
        path = Extent(math.inf, '', -1)
        if len(moving):
            travels = self._travel(start, deviations.changes[moving, 0], None, True)
            at = int(np.argmin(travels.value))
            path = Extent(float(travels.value[at]), str(travels.limit[at]),
                          int(travels.leg[at]), int(moving[at]))
        growth = Growth(self.platform, self._limits.bounds, self._motors, deviations, wrench, base)
        if not growth.names or path.value == 0.0:
            return path
        found = growth.first_exit(min(path.value, most))
        if found is None:
            return path
        return Extent(found.factor, growth.limit(found), found.column % 6, found.sample)

    def _of_path(self, motion: Motion, solved: InverseDynamics) -> Extent | None:
        """
        Return an extent of 0 at the first sample where the path exceeds a limit at any speed.

        Lengths, clearance, joint angles, and the condition number; a determinant of the other sign
        than at the first sample is beyond a singularity.
        """
        results, motions = solved.rows.reshape(-1, solved.rows.shape[-1]), motion_rows(motion)
        of_poses = self._pose_limits
        values = of_poses.values(motions, results)
        exceeded = [(limits.short_name(name), self._limits.exceeds(name, values[name]))
                    for name in (*of_poses.of_drives, *_OF_PATHS) if name in values]
        regular = of_poses.regular(results, results[:1, DETERMINANT])
        ends = [(*np.argwhere(each)[0].tolist(), name) for name, each in exceeded if each.any()]
        if not regular.all():
            ends.append((int(regular.argmin()), -1, limits.SINGULARITY))
        if not ends:
            return None
        sample, leg, name = min(ends, key=lambda end: end[0])
        return Extent(0.0, name, leg, sample)

    def _of_rates(self, motion: Motion, solved: InverseDynamics) -> list[tuple[Array, Any]]:
        """Return multiples (..., 6) of the twist at which legs and motors are too fast."""
        found: list[tuple[Array, Any]] = [
            (largest_multiple(np.zeros(6), solved.rows[..., limits.LIMITS[name].columns],
                              self._limits.bounds[name]), limits.short_name(name))
            for name in self._known.rates if name in self._limits.bounds]
        if self._motors is not None and self._motors.limits_speeds:
            found.append((largest_multiple(
                np.zeros(6), self._motors.moving(motion.rows, solved.rows).speeds,
                self._motors.fastest), limits.short_name(limits.SPEED_MAX)))
        return found

    def _speed_of_forces(self, motion: Motion, wrench: ArrayLike | None,
                         base: BaseMotion | None) -> list[tuple[Array, Any]]:
        """Return factors (..., 6) at which forces and torques are too large."""
        torques = self._motors is not None and self._motors.limited
        if not (self._limits.of_loads or torques):
            return []
        rows = motion.rows
        still, back = rows.copy(), rows.copy()
        still[..., TWIST.start:] = 0.0
        back[..., TWIST] = -rows[..., TWIST]
        solved, at_rest, backward = (
            self.load_rows(Motion.of_rows(each), wrench, base, self._frictionless)
            for each in (rows, still, back))
        powers = at_rest, (solved - backward) / 2.0, (solved + backward) / 2.0 - at_rest
        effort_max = self._kind.effort_limit
        found: list[tuple[Array, Any]] = [(quadratic_exit(
            [each[..., columns] for each in powers], self._limits.bounds[name], np.zeros(()),
            np.full((), math.inf)), limits.short_name(name))
            for name in self._limits.of_loads if name != effort_max
            for columns in self._columns(name)]
        strongest = self._limits.bounds.get(effort_max)
        constant, linear, square = (each[..., self._efforts] for each in powers)
        friction = Friction.of(self.platform.parameters)
        rates = self._drive_rates(rows, solved)
        linear = linear + friction.viscous * rates
        for piece in friction.coulomb_by_speed(rates):
            forces = constant + piece.constant, linear + piece.linear, square
            if strongest is not None:
                found.append((quadratic_exit(forces, strongest, piece.begin, piece.end),
                              limits.short_name(effort_max)))
            if self._motors is not None and torques:
                motors = self._motors.moving(rows, solved)
                none = np.zeros(6)
                found.append(self._motors.exits(
                    (*forces[:2], forces[2] - motors.inertial), (none, none, motors.own),
                    motors.speeds, piece.direction, piece.begin, piece.end, growing=True))
        return found

    def _held(self, pose: Pose | Motion, motion: Motion | None = None) -> Motion:
        """Return a pose with the twist of a motion, without acceleration."""
        check_kind(pose, Pose, Motion)
        if motion is not None and not isinstance(motion, Motion):
            raise wrong_type('motion', motion, 'a Motion')
        shape = pose.shape if motion is None else common_shape(
            pose=pose.shape, motion=motion.shape)
        rows = np.zeros((*shape, MOTION))
        rows[..., POSE] = pose.rows[..., POSE]
        if motion is not None:
            rows[..., TWIST] = motion.rows[..., TWIST]
        return Motion.of_rows(rows)

    def _results(self, motion: Motion, base: BaseMotion | None) -> Array:
        return self.load_rows(motion, base=base)

    @property
    def _efforts(self) -> slice:
        return self._kind.effort.columns

    def _columns(self, name: str) -> tuple[slice, ...]:
        """Return where the values of a limit of loads are in rows of ``load_rows``."""
        if self._kind.ends_differ and name == self._kind.joint_force_limit:
            return FORCES, _OTHER_ENDS
        return limits.LIMITS[name].columns,

    def _drive_rates(self, rows: Array, results: Array) -> Array:
        return self.platform.drive_rates(rows, results[..., self._kind.rate.columns])

    def load_rows(self, motion: Motion, wrench: ArrayLike | None = None,
                  base: BaseMotion | None = None, platform: StewartPlatform | None = None,
                  ) -> Array:
        """
        Return rows of results, all of whose loads are affine in wrenches and accelerations.

        Where forces differ between the ends of a leg, and have a limit, a row of results has the
        one that is larger, which is not affine: behind it are the six forces at the ends that are
        not those of ``forces``.

        platform: a hexapod that differs by friction; by default that of the capability.
        """
        platform = self.platform if platform is None else platform
        rows = platform.inverse_dynamics(motion, wrench, base).rows
        if not self._ends_differ:
            return rows
        # with a push along all legs that is larger than the forces, the larger one is the greater
        # one, and with a pull the lesser one: they are those of both ends
        push = 2.0 * np.abs(rows[..., JOINT_FORCES]).max(axis=-1, keepdims=True)
        pushes = np.where(push > 0.0, push, 1.0) * platform.inverse_jacobian(motion).sum(axis=-2)
        load = np.zeros(6) if wrench is None else np.asarray(wrench, dtype=float)
        pushed, pulled = (platform.inverse_dynamics(motion, load - each, base).rows[
            ..., JOINT_FORCES] for each in (pushes, -pushes))
        return np.concatenate([rows, pushed + pulled - rows[..., FORCES]], axis=-1)

    def _change(self, pose: Pose | Motion, wrench: ArrayLike | None = None,
                acceleration: Array | None = None) -> Array:
        """Return ``load_rows`` of a wrench or acceleration alone, without weight."""
        still = self._held(pose)
        if acceleration is not None:
            rows = np.zeros((*np.broadcast_shapes(still.shape, acceleration.shape[:-1]), MOTION))
            rows[..., POSE], rows[..., ACCELERATION] = still.rows[..., POSE], acceleration
            still = Motion.of_rows(rows)
        return self.load_rows(still, wrench, BaseMotion(np.zeros(3)))

    def _multiple(self, motion: Motion, results: Array, change: Array, whole: bool = False,
                  directions: Array | None = None, continuous: bool = False,
                  stuck: int | None = None) -> Extent:
        """
        Return the largest multiple of a change of results that forces and torques permit.

        results, change: ``load_rows`` of the motion, and of a load or acceleration alone.
        ``directions`` (..., 6): the change is that of this acceleration.
        continuous: the load is held without end.
        stuck: index of a leg whose actuator does not limit; its joints do.
        """
        forces, added = results[..., self._efforts], change[..., self._efforts]
        of_actuators: list[tuple[Array, Any]] = []
        of_joints: list[tuple[Array, Any]] = []
        if continuous:
            of_actuators.append((largest_multiple(forces, added, self._continuous_forces),
                                 limits.short_name(limits.TORQUE_CONTINUOUS)))
        for name in self._limits.of_loads:
            group = of_actuators if name == self._kind.effort_limit else of_joints
            group += [(largest_multiple(results[..., columns], change[..., columns],
                                        self._limits.bounds[name]), limits.short_name(name))
                      for columns in self._columns(name)]
        if self._motors is not None and self._motors.limited:
            of_actuators.append(self._torques(self._motors, motion, forces, added, directions))
        if stuck is not None:
            for each, _ in of_actuators:
                each[..., stuck] = math.inf
        if not (of_actuators or of_joints):
            raise self._unlimited((self._kind.effort_limit,))
        multiples, names = _tightest([*of_actuators, *of_joints])
        return (_of_all if whole else _smallest)(multiples, names)

    def _torques(self, bounds: MotorBounds, motion: Motion, forces: Array, change: Array,
                 directions: Array | None) -> tuple[Array, Array]:
        """Return the multiples of ``_multiple`` at which torques end them, and the limits."""
        shape = np.broadcast_shapes(forces.shape, change.shape)
        rows = np.broadcast_to(motion.rows, (*shape[:-1], MOTION))
        solved = self.platform.inverse_dynamics(Motion.of_rows(rows))
        motors, none = bounds.moving(rows, solved.rows), np.zeros(shape)
        more = motors
        if directions is not None:
            accelerated = rows.copy()
            accelerated[..., ACCELERATION] += directions
            more = bounds.moving(accelerated, solved.rows)
        rates = self._drive_rates(rows, solved.rows)
        slow = Friction.of(self.platform.parameters).is_linear(rates)
        return bounds.exits(
            (forces - motors.inertial, change - (more.inertial - motors.inertial), none),
            (motors.own, more.own - motors.own, none), motors.speeds,
            np.where(slow, 0.0, np.sign(rates)), np.zeros(()), np.full((), math.inf))

    @property
    def limits_rates(self) -> bool:
        """Return whether there is a limit of the legs' rates or of the motors' speeds."""
        return any(name in self._limits.bounds for name in self._known.rates) or (
            self._motors is not None and self._motors.limits_speeds)

    @property
    def limits_held(self) -> bool:
        """Return whether there is a limit of the torques that motors can hold without end."""
        return self._motors is not None and self._motors.continuous_forces is not None

    @property
    def _continuous_forces(self) -> Array:
        held = None if self._motors is None else self._motors.continuous_forces
        if held is None:
            raise self._unlimited((limits.TORQUE_CONTINUOUS,))
        return held

    def holding_loads(self, continuous: bool = False) -> list[tuple[slice, Array]]:
        """
        Return the largest loads (6,) of legs at rest, or those that are held without end.

        Each with its columns in ``load_rows``. Motors limit the efforts by their torques.
        """
        found = [(columns, self._limits.bounds[name]) for name in self._limits.of_loads
                 for columns in self._columns(name)]
        if self._motors is not None and self._motors.limited:
            found.append((self._efforts, self._motors.forces_at_rest))
        if continuous:
            found.append((self._efforts, self._continuous_forces))
        return found

    @property
    def limits_forces(self) -> bool:
        """Return whether there is a limit of the legs' loads or of the motors' torques."""
        return self.limits_held or bool(self.holding_loads())

    def _in_every_direction(self, pose: Pose | Motion, part: slice, continuous: bool,
                            ) -> Array | float:
        if not (self.limits_forces or continuous):
            raise self._unlimited((self._kind.effort_limit,))
        still = self._held(pose)
        results = self._results(still, None)
        per_wrench = self._change(Motion.of_rows(still.rows[..., None, :]), np.eye(6)[part])
        values: Array = np.full(still.shape, math.inf)
        for columns, strongest in self.holding_loads(continuous):
            reach = np.linalg.norm(per_wrench[..., columns], axis=-2)
            with np.errstate(divide='ignore'):
                room = (strongest - np.abs(results[..., columns])) / reach
            values = np.minimum(values, np.maximum(room, 0.0).min(axis=-1))
        return float(values) if values.ndim == 0 else values

    def _unlimited(self, names: Sequence[str]) -> ParameterError:
        return ParameterError(f'parameters: {", ".join(names)}: not set: without a limit there is '
                              'no answer')


def _on_circles(p: Parameters) -> tuple[Quantity, ...]:
    """Return the quantities with limits of drives whose anchors move on circles."""
    circles = p.leg_kind.anchor_circles(p)
    if circles is None:
        return ()
    levers = Levers(circles, travel.LIMITED.index(p.leg_kind.lever_limit))
    turns = Turns(circles, [travel.LIMITED.index(name) for name in circles.limits])
    return (levers, turns) if len(turns.legs) else (levers,)


def _directions(value: ArrayLike) -> tuple[Array, Array]:
    """Return directions whose largest number is about 1, and the powers of two to divide by."""
    directions = as_array('direction', value, (6,))
    largest = np.abs(directions).max(axis=-1)
    if not largest.all():
        raise MotionError('direction: all six numbers are zero')
    sizes: Array = np.ldexp(1.0, np.frexp(largest)[1] - 1)  # no rounding
    return directions / sizes[..., None], sizes


def _divided(extent: Extent, sizes: Array) -> Extent:
    return _extent(np.asarray(extent.value / sizes), extent.limit, extent.leg)


def _tightest(found: Sequence[tuple[Array, Any]]) -> tuple[Array, Array]:
    """Return the smallest of several multiples (..., 6), and the names of their limits."""
    multiples = np.stack(np.broadcast_arrays(*(each for each, _ in found)))
    names = np.stack([np.broadcast_to(name, multiples.shape[1:]) for _, name in found])
    which = multiples.argmin(axis=0)[None]
    return (np.take_along_axis(multiples, which, axis=0)[0],
            np.take_along_axis(names, which, axis=0)[0])


def _smallest(multiples: Array, names: Array) -> Extent:
    """Return the smallest of six multiples of each sample (..., 6)."""
    legs = multiples.argmin(axis=-1)
    values = multiples.min(axis=-1)
    limited = np.isfinite(values)
    name = np.take_along_axis(names, legs[..., None], axis=-1)[..., 0]
    return _extent(values, np.where(limited, name, ''), np.where(limited, legs, -1))


def _of_all(multiples: Array, names: Array) -> Extent:
    """Return the smallest of six multiples of all samples (..., 6)."""
    flat = multiples.reshape(-1, 6)
    if not len(flat):
        raise MotionError(f'motion: shape {multiples.shape[:-1]}: has no samples')
    sample, leg = divmod(int(flat.argmin()), 6)
    if not math.isfinite(flat[sample, leg]):
        return Extent(math.inf, '', -1)
    return Extent(float(flat[sample, leg]), str(names.reshape(-1, 6)[sample, leg]), leg, sample)


def _extent(values: Array, names: Any, legs: Any) -> Extent:
    if values.ndim == 0:
        return Extent(float(values), str(names), int(legs))
    return Extent(values, names, legs)
