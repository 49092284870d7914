# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""A Gough-Stewart platform: the calls of the library."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.errors import ParameterError, PoseError, SingularityError
from stewart_dynamics.legs.lines import Lines
from stewart_dynamics.mechanics import batch, stiffness
from stewart_dynamics.mechanics.arguments import (
    as_array, check_finite, common_shape, copies, optional_array, place, wrong_type)
from stewart_dynamics.mechanics.drives.motors import Drives, MECHANICAL, MOTORS, Motors
from stewart_dynamics.mechanics.drives.servos import servo_pulses
from stewart_dynamics.mechanics.drives.turning_screws import screw_constants
from stewart_dynamics.mechanics.dynamics import base_wrench, forward_dynamics, lagrange, regressor
from stewart_dynamics.mechanics.dynamics.force_breakdown import (
    ForceBreakdown, ForceBreakdownRows, SOURCES)
from stewart_dynamics.mechanics.dynamics.linear_parameters import (
    linear_parameters, names_of)
from stewart_dynamics.mechanics.dynamics.regressor import Regressor
from stewart_dynamics.mechanics.dynamics.result import InverseDynamics
from stewart_dynamics.mechanics.frames.base_motion import base_rows, BaseMotion
from stewart_dynamics.mechanics.frames.motion import (
    check_kind, listed, Motion, motion_rows, Pose)
from stewart_dynamics.mechanics.hexapod_structure import hexapod_structure
from stewart_dynamics.mechanics.kinematics import forward_kinematics, home_pose
from stewart_dynamics.mechanics.kinematics.joint_angles import JointAngles
from stewart_dynamics.mechanics.limits import Limits
from stewart_dynamics.mechanics.parameter_errors import find_parameter_errors
from stewart_dynamics.mechanics.rows import (
    BASE, BASE_ACCELERATION, BASE_ANGULAR_ACCELERATION, BASE_ANGULAR_VELOCITY, BASE_JOINT_ANGLES,
    FORCES, GRAVITY, JOINT_ANGLES, JOINT_FORCES, MOTION, NO_BASE, PLATFORM_JOINT_ANGLES, POSE,
    POSITION, TWIST, WRENCH)
from stewart_dynamics.mechanics.single_sample import SingleSample
from stewart_dynamics.mechanics.stiffness import NaturalModes
from stewart_dynamics.parameters.table import mean_radius, Parameters


class StewartPlatform:
    """
    A hexapod with given parameters, and its mechanics.

    All poses are of the platform frame in the base frame, all vectors in base axes, all units
    SI. Every call takes one sample or any leading shape (...) of samples; the leading shapes of
    its arguments broadcast against each other. Where a Pose is taken, a Motion will do.

    Parameters
    ----------
    parameters : Parameters
        Parameters of the hexapod.

    Attributes
    ----------
    parameters : Parameters
        As given.
    structure : ()
        The hexapod as the functions in C take it, see ``hexapod_structure``.
    screws : (6, SCREW)
        The screws as the readable functions take them, see ``turning_screws``; zero if guided.
    solve : callable
        ``mechanics.batch.solve`` of this hexapod: rows of motion, and optionally rows of wrenches
        and of the base's motion, to rows of results, unchecked.

    Raises
    ------
    MotionError
        By all calls: an argument has another type or shape, is not finite, or numbers overflow.

    """

    def __init__(self, parameters: Parameters) -> None:
        if not isinstance(parameters, Parameters):
            raise wrong_type('parameters', parameters, 'Parameters; StewartPlatform.from_yaml '
                             'reads a file, Parameters takes a dict')
        self.parameters = parameters
        self.screws = screw_constants(parameters)
        self.structure = hexapod_structure(parameters, self.screws)
        self.solve = partial(batch.solve, self.structure)
        self._single = SingleSample(self.structure)
        self._kind = parameters.leg_kind
        self._breakdown: ForceBreakdownRows | None = None
        self._home: Pose | None = None
        self._joint_angles: JointAngles | None = None
        self._drives: Drives | None = None
        self._still = BaseMotion(parameters.gravity)

    def __reduce__(self) -> tuple[type[StewartPlatform], tuple[Parameters]]:
        """Pickle and copy the parameters alone."""
        return type(self), (self.parameters,)

    @classmethod
    def from_yaml(cls, path: str | Path, node: str = '') -> StewartPlatform:
        """
        Return the hexapod of a parameter file; ParameterError names the error in it.

        A file with several nodes needs the node's name, with its namespace.
        """
        return cls(Parameters.from_yaml(path, node))

    def __repr__(self) -> str:
        """Return mass and sizes."""
        p = self.parameters
        base, platform = (
            mean_radius(p[name]) for name in ('geometry.base_joints', 'geometry.platform_joints'))
        return (f'<StewartPlatform: {p.carried.mass:g} kg, joints on {base:.3g} m (base) and '
                f'{platform:.3g} m (platform)>')

    def inverse_dynamics(
            self, motion: Motion, wrench: ArrayLike | None = None,
            base: BaseMotion | None = None, *,
            singular: Literal['raise', 'nan'] = 'raise') -> InverseDynamics:
        """
        Return leg lengths, rates and forces of a motion, and how near a singularity it is.

        Parameters
        ----------
        motion : Motion
            Motions of any leading shape (...).
        wrench : (..., 6), optional
            External wrench on the platform at its origin: force [N] and moment [N m], base
            axes; zero by default.
        base : BaseMotion, optional
            How the base moves; by default it is still, and gravity is the parameter.
        singular : 'raise' or 'nan'
            Where J_inv cannot be solved: raise, or return nan as forces.

        Raises
        ------
        SingularityError
            J_inv cannot be solved in a sample; names the sample.

        """
        if singular == 'raise':
            result = self._single.inverse_dynamics(motion, None, wrench, base)
            if result is not None:
                return InverseDynamics(result)
        _, _, results, unsolvable, shape = self._solved(motion, wrench, base, singular)
        for forces in FORCES, JOINT_FORCES, self._kind.effort.columns:
            results[unsolvable, forces] = np.nan
        return InverseDynamics(results.reshape(*shape, results.shape[-1]))

    def _solved(
            self, motion: Motion, wrench: ArrayLike | None, base: BaseMotion | None,
            singular: str) -> tuple[Array, tuple[Array, Array], Array, Integers, tuple[int, ...]]:
        """Return rows of motion, of wrenches and base, of results; the unsolvable; the shape."""
        rows, wrenches, bases, shape = batch.loaded(motion, wrench, base)
        results = self.solve(rows, wrenches, bases)
        unreachable = batch.find_unreachable(
            self.structure, self.parameters.joints, rows, results, shape, singular)
        results[unreachable] = 0.0
        check_finite('motion', results.reshape(*shape, results.shape[-1]), len(shape))
        unsolvable = batch.find_unsolvable(rows, results, shape, singular)
        results[unreachable] = np.nan
        return rows, (wrenches, bases), results, unsolvable, shape

    def force_breakdown(
            self, motion: Motion, wrench: ArrayLike | None = None,
            base: BaseMotion | None = None, *,
            singular: Literal['raise', 'nan'] = 'raise') -> ForceBreakdown:
        """Return the leg forces by source; arguments and errors are ``inverse_dynamics``'s."""
        rows, loads, _, unsolvable, shape = self._solved(motion, wrench, base, singular)
        if self._breakdown is None:
            self._breakdown = ForceBreakdownRows(self.parameters)
        forces = self._breakdown(rows, loads[0], None if base is None else loads[1])
        known = forces.copy()
        known[unsolvable] = 0.0
        check_finite('motion', known.reshape(*shape, len(SOURCES), 6), len(shape))
        return ForceBreakdown(*np.moveaxis(forces, 1, 0).reshape(len(SOURCES), *shape, 6))

    def motors(self, motion: Motion, wrench: ArrayLike | None = None,
               base: BaseMotion | None = None) -> Motors:
        """
        Return angles, speeds, torques, currents and power of the motors.

        Quantities that ``actuator.screw_lead`` and ``drive.*`` do not give are nan. Arguments and
        errors are ``inverse_dynamics``'s.
        """
        results = self.inverse_dynamics(motion, wrench, base).rows
        shape = results.shape[:-1]
        if self._drives is None:
            self._drives = Drives(self.parameters)
        rows = self._drives(copies(motion.rows, shape), results.reshape(-1, results.shape[-1]))
        rows = rows.reshape(*shape, MOTORS)
        if self.parameters.actuator.screw_lead is not None:
            check_finite('motion', rows[..., MECHANICAL], len(shape))
        return Motors.of_rows(rows)

    def regressor(self, motion: Motion, base: BaseMotion | None = None, *,
                  tilt: bool = False) -> Regressor:
        """
        Return how the leg forces depend on the parameters in which they are linear.

        ``regressor.matrix @ linear_parameters(platform.parameters)`` are the forces of
        ``inverse_dynamics``; the parameters of this hexapod matter for it only by geometry and
        gravity. Arguments and errors are those of ``inverse_dynamics``.

        With ``tilt`` two columns are added, ``gravity.tilt_x`` and ``gravity.tilt_y`` [N/rad]: the
        derivatives by small turns of gravity about the base's x and y axes, with this hexapod's
        parameters; their linear parameters are zero.
        """
        rows, (_, bases), _, _, shape = self._solved(motion, None, base, 'raise')
        names = names_of(self.parameters)
        matrix = self.regressors(rows, bases).reshape(*shape, 6, len(names))
        if tilt:
            columns = self._tilt_columns(rows, base, shape).reshape(*shape, 6, 2)
            matrix = np.concatenate([matrix, columns], axis=-1)
            names = *names, 'gravity.tilt_x', 'gravity.tilt_y'
        return Regressor(check_finite('motion', matrix, len(shape)), names)

    def _tilt_columns(self, rows: Array, base: BaseMotion | None, shape: tuple[int, ...],
                      ) -> Array:
        """Return the derivatives of the forces (N, 6, 2) by turns of gravity about x and y."""
        gravity = copies((self._still if base is None else base).rows[..., GRAVITY], shape)
        theta = linear_parameters(self.parameters)
        return np.stack([self.regressors_at_rest(rows, np.cross(axis, gravity)) @ theta
                         for axis in np.eye(3)[:2]], axis=-1)

    def regressors(self, rows: Array, bases: Array | None = None) -> Array:
        """Return ``regressor`` (N, 6, n) of rows of motion, unchecked, see ``solve``."""
        bases = np.array([NO_BASE]) if bases is None else bases
        matrices = np.empty((len(rows), 6, len(names_of(self.parameters))))
        batch.in_parts(regressor.regressors, (self.structure,), *map(
            batch.compact, (rows, bases)), matrices)
        return matrices

    def regressors_at_rest(self, rows: Array, gravity: Array) -> Array:
        """
        Return ``regressors`` in the poses of rows of motion at rest, under any gravity.

        Forces are linear in gravity: those under a change of it are the change of the forces.
        ``gravity`` (N, 3) or (1, 3) is in base axes [m/s^2].
        """
        still = np.zeros_like(rows)
        still[:, POSE] = rows[:, POSE]
        bases = np.zeros((len(gravity), BASE))
        bases[:, GRAVITY] = gravity
        return self.regressors(still, bases)

    def base_wrench(self, motion: Motion, wrench: ArrayLike | None = None,
                    base: BaseMotion | None = None) -> Array:
        """
        Return the wrench of the hexapod on its base, at the base's origin (..., 6) [N, N m].

        Force and moment, base axes: for foundation, deck or truss. Arguments are those of
        ``inverse_dynamics``. Forces within the hexapod, friction among them, do not matter, and
        singular poses are allowed.
        """
        base = self._still if base is None else base
        result = self._single.base_wrench(motion, None, wrench, base)
        if result is not None:
            return result
        rows, wrenches, bases, shape = batch.loaded(motion, wrench, base)
        results = self.base_wrenches(rows, wrenches, bases)
        return check_finite('motion', results.reshape(*shape, WRENCH), len(shape))

    def base_wrenches(self, rows: Array, wrenches: Array, bases: Array | None = None) -> Array:
        """Return rows (N, 6) of ``base_wrench`` of rows of motion, unchecked, see ``solve``."""
        bases = self._still.rows[None] if bases is None else bases
        results = np.empty((len(rows), WRENCH))
        batch.in_parts(base_wrench.base_wrenches, (self.structure,), *map(
            batch.compact, (rows, wrenches, bases)), results)
        return results

    def forward_dynamics(
            self, motion: Motion, forces: ArrayLike, wrench: ArrayLike | None = None,
            base: BaseMotion | None = None) -> Motion:
        """
        Return a motion with the accelerations that follow from leg forces.

        ``inverse_dynamics`` of the result gives these forces. Singular poses are allowed: J_inv is
        not inverted.

        Parameters
        ----------
        motion : Motion
            Its own accelerations are ignored.
        forces : (..., 6)
            Forces of the actuators [N], + pushes. Their friction is subtracted.
        wrench : (..., 6), optional
            External wrench on the platform, as in ``inverse_dynamics``.
        base : BaseMotion, optional
            How the base moves, as in ``inverse_dynamics``.

        """
        row = self._single.forward_dynamics(motion, forces, wrench, base)
        if row is not None:
            return Motion.of_rows(row)
        check_kind(motion, Motion)
        pushes = as_array('forces', forces, (6,))
        load = optional_array('wrench', wrench, (WRENCH,))
        bases = base_rows(base)
        shape = common_shape(motion=motion.shape, forces=pushes.shape[:-1],
                             wrench=load.shape[:-1], base=bases.shape[:-1])
        rows, pushes, load, bases = (
            copies(array, shape) for array in (motion.rows, pushes, load, bases))
        batch.in_parts(forward_dynamics.solve, (self.structure,), rows, pushes, load, bases)
        rows = check_finite('accelerations', rows.reshape(*shape, MOTION), len(shape))
        return Motion.of_rows(rows)

    def inverse_kinematics(self, pose: Pose | Motion) -> Array:
        """
        Return the six leg lengths at a pose, (..., 6) [m]; of cranks their angles [rad].

        Raises
        ------
        ReachError
            A rod does not reach the platform: names leg and missing distance.

        """
        check_kind(pose, Pose, Motion)
        positions = batch.drive_positions(self.structure, pose.rows)
        rows = pose.rows.reshape(-1, pose.rows.shape[-1])
        batch.find_unreachable(self.structure, self.parameters.joints, rows,
                               positions.reshape(-1, 6), pose.shape)
        return check_finite(f'leg {self._kind.position.field}', positions, len(pose.shape))

    def servo_pulses(self, positions: ArrayLike) -> Array:
        """
        Return the pulse widths (..., 6) [s] of servos at positions of the drives (..., 6) [rad].

        Positions are those of ``inverse_kinematics``, pulses never outside ``servo.pulse_min``
        and ``servo.pulse_max``.

        Raises
        ------
        ParameterError
            ``servo.angle_at_min`` and ``servo.angle_at_max`` are not set.
        MotionError
            A position is not between them: names sample and leg.

        """
        return servo_pulses(self.parameters, positions)

    def forward_kinematics(self, lengths: ArrayLike, guess: Pose | Motion | None = None) -> Pose:
        """
        Return the pose of six leg lengths, or angles of cranks, on the guess's side.

        The side is that of singularities. The leading shapes of lengths and guess broadcast
        against each other. The lengths of legs or rods in the pose returned differ by less than
        1e-12 m from those given.

        Parameters
        ----------
        lengths : (..., 6)
            [m]; angles of cranks [rad]
        guess : Pose or Motion, optional
            Where to begin: the last pose, or the one commanded; by default home. From 20 % of the
            platform's height and 0.2 rad away it converges nearly always (benchmarks/README.md).

        Raises
        ------
        PoseError
            It did not converge: no pose on the guess's side of singularities has the lengths.
        SingularityError
            The guess is singular, or a pose in the iteration.

        """
        if guess is None:
            try:
                guess = self.home_pose()
            except ParameterError as exc:
                raise ParameterError(f'{exc}; give guess=, the pose to begin at') from exc
        row = self._single.forward_kinematics(lengths, guess)
        if row is not None:
            return Pose.of_rows(row)
        wanted = as_array(self._kind.position.field, lengths, (6,))
        check_kind(guess, Pose, Motion, name='guess')
        shape = common_shape(lengths=wanted.shape[:-1], guess=guess.shape)
        wanted, rows = copies(wanted, shape), motion_rows(guess, shape)
        codes, steps = np.empty(len(rows), dtype=np.int64), np.empty(len(rows), dtype=np.int64)
        residuals = np.empty(len(rows))
        batch.in_parts(forward_kinematics.poses, (self.structure,), wanted, rows, codes, steps,
                       residuals)
        if codes.any():
            at = int(np.argmax(codes > 0))
            outside = Limits(self.parameters).exceeded(
                dict.fromkeys(self._kind.position_limits, wanted[at].tolist()))
            reason = f'{outside[0].words(self.parameters.joints)}; ' if outside else ''
            of = self._kind.position
            where = (f'sample {place(at, shape)}: {of.field} {listed(wanted[at])} {of.unit} from '
                     f'the guess {listed(rows[at, POSITION].round(9))} m: {reason}')
            if codes[at] == forward_kinematics.SINGULAR:
                raise SingularityError(f'{where}a singular pose after {steps[at]} iterations: '
                                       'give a guess farther from singularities')
            why = forward_kinematics.failure(steps[at], residuals[at])
            most = f', must be at most {forward_kinematics.RESIDUAL:g}'
            raise PoseError(
                f'{where}{why}' + most * bool(residuals[at] > forward_kinematics.RESIDUAL))
        return Pose.of_rows(rows[:, POSE].reshape(*shape, POSE.stop).copy())

    def twist(self, pose: Pose | Motion, rates: ArrayLike) -> Array:
        """
        Return the twist [v; w] (..., 6) of leg rates (..., 6) [m/s] at a pose, base axes.

        With cranks the rates are speeds [rad/s].

        Raises
        ------
        SingularityError
            J_inv cannot be solved, or a rod does not reach.

        """
        check_kind(pose, Pose, Motion)
        given = as_array('rates', rates, (6,))
        shape = common_shape(pose=pose.shape, rates=given.shape[:-1])
        given, rows = copies(given, shape), motion_rows(pose, shape)
        results = self.solve(rows)
        batch.find_unreachable(self.structure, self.parameters.joints, rows, results, shape)
        batch.find_unsolvable(rows, results, shape, 'raise')
        forward_kinematics.twists(self.structure, given, rows)
        return check_finite('twist', rows[:, TWIST].reshape(*shape, 6).copy(), len(shape))

    def joint_angles(self, pose: Pose | Motion) -> tuple[Array, Array]:
        """
        Return the angles of base joints and platform joints at a pose, (..., 6) each [rad].

        Between each leg and the axis of its joint: ``geometry.base_joint_axes`` and
        ``geometry.platform_joint_axes``, by default the leg's direction at the home pose. See
        ``mechanics.kinematics.joint_angles``.

        Raises
        ------
        ParameterError
            Axes are not given, and there is no home pose.

        """
        rows = motion_rows(pose)
        if self._joint_angles is None:
            self._joint_angles = JointAngles(self.parameters)
        angles = self._joint_angles(rows).reshape(*pose.shape, JOINT_ANGLES)
        check_finite('pose', angles, len(pose.shape))
        return angles[..., BASE_JOINT_ANGLES].copy(), angles[..., PLATFORM_JOINT_ANGLES].copy()

    def inverse_jacobian(self, pose: Pose | Motion) -> Array:
        """
        Return J_inv (..., 6, 6): leg rates = J_inv [v; w].

        Unless screws turn with their legs, J_inv^T forces = wrench as well: ``drive_jacobian``.
        """
        return lagrange.inverse_jacobian(self._legs(pose))

    def drive_jacobian(self, pose: Pose | Motion) -> Array:
        """
        Return J_q (..., 6, 6): rates of the drives = J_q [v; w], J_q^T forces = wrench.

        It is J_inv unless ``drive.screw_rotation`` is universal: there a drive makes up for the
        turn of its leg, and its force acts with the moment of its screw (``turning_screws``).
        """
        with np.errstate(all='ignore'):
            return check_finite('pose', lagrange.drive_jacobian(
                self._legs(pose), pose.rotation, self.screws), len(pose.shape))

    def drive_jacobian_rate(self, motion: Motion) -> Array:
        """Return dJ_q/dt (..., 6, 6) in a motion."""
        check_kind(motion, Motion)
        with np.errstate(all='ignore'):
            return check_finite('motion', lagrange.drive_jacobian_rate(
                self._legs(motion), motion.rotation, motion.linear_velocity,
                motion.angular_velocity, self.screws), len(motion.shape))

    def drive_rates(self, motions: Array, leg_rates: Array) -> Array:
        """
        Return the rates of the drives (..., 6) of rows of motion, unchecked.

        ``leg_rates`` (..., 6) are those of ``inverse_dynamics``, of cranks their speeds; but with
        screws that turn with their legs they are the drives' rates as well.
        """
        if not self.screws.any():
            return leg_rates
        return lagrange.drive_rates(self.parameters, motions, self.screws)

    def inverse_jacobian_rate(self, motion: Motion) -> Array:
        """Return dJ_inv/dt (..., 6, 6) in a motion."""
        check_kind(motion, Motion)
        with np.errstate(all='ignore'):
            return check_finite('motion', lagrange.inverse_jacobian_rate(
                self._legs(motion), motion.linear_velocity, motion.angular_velocity),
                len(motion.shape))

    def position_jacobian(self, pose: Pose | Motion) -> Array:
        """
        Return J (..., 6, 6): rates of the measured positions = J [v; w].

        Positions are those of ``inverse_kinematics``. It is J_q but for screws that turn with
        their legs: lengths are measured there, so that it is J_inv.
        """
        return lagrange.drive_jacobian(self._legs(pose), pose.rotation)

    def position_jacobian_rate(self, motion: Motion) -> Array:
        """Return the derivative of ``position_jacobian`` by time (..., 6, 6) in a motion."""
        check_kind(motion, Motion)
        with np.errstate(all='ignore'):
            return check_finite('motion', lagrange.drive_jacobian_rate(
                self._legs(motion), motion.rotation, motion.linear_velocity,
                motion.angular_velocity), len(motion.shape))

    def mass_matrix(self, pose: Pose | Motion) -> Array:
        """
        Return M (..., 6, 6) of M X'' + C X' + G = J_q^T f + wrench, with X' = [v; w].

        Platform, both parts of each leg, and the actuators' reflected mass.
        """
        check_kind(pose, Pose, Motion)
        with np.errstate(all='ignore'):
            return check_finite('pose', lagrange.mass_matrix(
                self.parameters, pose.position, pose.rotation, self.screws), len(pose.shape))

    def coriolis_matrix(self, motion: Motion, christoffel: bool = False,
                        base: BaseMotion | None = None) -> Array:
        """
        Return C (..., 6, 6); without friction.

        C X' is the same either way. The paper's C has X'^T (M' - 2 C) X' = 0; with
        ``christoffel``, M' - 2 C is skew itself, which passivity-based controllers need. A base
        that turns adds a skew matrix.
        """
        check_kind(motion, Motion)
        bases = base_rows(base)
        shape = common_shape(motion=motion.shape, base=bases.shape[:-1])
        with np.errstate(all='ignore'):
            c = lagrange.coriolis_matrix(
                self.parameters, motion.position, motion.rotation, motion.linear_velocity,
                motion.angular_velocity, christoffel, self.screws)
            if base is not None:
                c = c + lagrange.base_coriolis_matrix(
                    self.parameters, motion.position, motion.rotation,
                    bases[..., BASE_ANGULAR_VELOCITY])
            return check_finite('motion', c, len(shape))

    def gravity_vector(self, pose: Pose | Motion, base: BaseMotion | None = None) -> Array:
        """
        Return G (..., 6) [N, N m]: the wrench that holds platform and legs at rest.

        At rest on the base: if that moves, inertial forces are in it as well.
        """
        check_kind(pose, Pose, Motion)
        bases = base_rows(base)
        shape = common_shape(pose=pose.shape, base=bases.shape[:-1])
        with np.errstate(all='ignore'):
            return check_finite('pose', lagrange.gravity_vector(
                self.parameters, pose.position, pose.rotation) if base is None else
                lagrange.base_gravity_vector(
                    self.parameters, pose.position, pose.rotation, *(bases[..., part] for part in (
                        GRAVITY, BASE_ACCELERATION, BASE_ANGULAR_VELOCITY,
                        BASE_ANGULAR_ACCELERATION))), len(shape))

    def stiffness(self, pose: Pose | Motion, leg_stiffness: ArrayLike) -> Array:
        """
        Return the stiffness K (..., 6, 6) of the platform at its origin, base axes.

        Parameters
        ----------
        pose : Pose or Motion
            Poses of any leading shape (...).
        leg_stiffness : float or (..., 6)
            Stiffness of each leg along its axis [N/m], or of its drive where that turns
            [N m/rad]; one number is for all legs.

        Returns
        -------
        (..., 6, 6)
            ``J_q^T k J_q`` in [N/m], [N] and [N m/rad]; see ``mechanics.stiffness``.

        """
        legs = stiffness.leg_stiffnesses(leg_stiffness, self._kind.stiffness_unit)
        j_q = self.drive_jacobian(pose)
        shape = common_shape(pose=pose.shape, leg_stiffness=legs.shape[:-1])
        with np.errstate(all='ignore'):
            return check_finite('stiffness', stiffness.platform_stiffness(j_q, legs), len(shape))

    def natural_modes(self, pose: Pose | Motion, leg_stiffness: ArrayLike) -> NaturalModes:
        """
        Return natural frequencies (..., 6) [Hz] and mode shapes (..., 6, 6) at a pose.

        Arguments are those of ``stiffness``. The mass matrix includes
        ``actuator.reflected_mass``, as for compliance in the position control. Compliance between
        held motors and the platform does not turn the rotors: take the modes of a platform of
        ``parameters.replaced({'actuator.reflected_mass': 0.0, 'drive.motor_inertia': None,
        'drive.screw_inertia': None})``.
        """
        legs = stiffness.leg_stiffnesses(leg_stiffness, self._kind.stiffness_unit)
        mass, j_q = self.mass_matrix(pose), self.drive_jacobian(pose)
        shape = common_shape(pose=pose.shape, leg_stiffness=legs.shape[:-1])
        with np.errstate(all='ignore'):
            modes = stiffness.natural_modes(mass, j_q, legs)
        check_finite('natural modes', modes.frequencies, len(shape))
        check_finite('natural modes', modes.shapes, len(shape))
        return modes

    def home_pose(self) -> Pose:
        """
        Return the home pose: parallel axes, the mean leg halfway between its limits.

        See ``mechanics.kinematics.home_pose``.

        Raises
        ------
        ParameterError
            The parameters do not give the height of the platform.

        """
        if self._home is None:
            self._home = home_pose.home_pose(self.parameters)
        return Pose.of_rows(self._home.rows.copy())

    def check(self) -> tuple[str, ...]:
        """Return possible errors in the parameters, each in one line."""
        return find_parameter_errors(self.parameters)

    def _legs(self, pose: Pose | Motion) -> Lines:
        check_kind(pose, Pose, Motion)
        return lagrange.legs(self.parameters, pose.position, pose.rotation)
