# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Calibration of a hexapod's geometry from measured poses; computes the result, writes no files.

Outliers are found by robust fits with equal weights; the rest is fitted with the noise given or
estimated (``geometry_fit``). A fit without the held-out poses predicts them by forward kinematics.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.calibration.assembly_errors import assembly_errors, TURN
from stewart_dynamics.calibration.calibration_errors import (
    CalibratedFit, find_input_errors, Measured, not_identified, RESULT_ERRORS)
from stewart_dynamics.calibration.equations import (
    chosen, DEVICE, Equations, Frames, GEOMETRY, GUIDED, held_by_groups, SAME, values_of,
    with_geometry)
from stewart_dynamics.calibration.frames import find_frames, pose_errors, PoseErrors
from stewart_dynamics.calibration.geometry_fit import Fit, fit, minimum, Unknowns
from stewart_dynamics.calibration.measured_poses import METERS, Millimeters
from stewart_dynamics.calibration.noise import Noise
from stewart_dynamics.calibration.outliers import MOST_OUTLIERS, outliers
from stewart_dynamics.calibration.residual_causes import lack_of_fit
from stewart_dynamics.errors import MotionError, ParameterError, StewartError
from stewart_dynamics.legs.calibrated import ALL_GROUPS, CalibratedLegs
from stewart_dynamics.mechanics.arguments import as_array, wrong_type
from stewart_dynamics.mechanics.drives.turning_screws import screw_constants, universal_axes
from stewart_dynamics.mechanics.frames.motion import Motion, Pose
from stewart_dynamics.mechanics.least_squares import Identifiability, LARGEST_SHARE
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import Parameters, UNIVERSAL
from stewart_dynamics.possible_errors.hypothesis import find_errors, PossibleError
from stewart_dynamics.reporting.estimates import (
    FIXED, HOLD_OUT, IDENTIFIED, justified, states_of)

# Held-out poses are the middle ones of equal groups; below this number of others, no pose is.
_FEWEST_OTHERS = 12
# Errors of held-out poses may grow by this factor: a good file, and few poses.
_WORSE = 1.2
# Numbers of the file are rounded to a hundredth of this part of their standard errors [m].
_DIGITS, _FINEST = 0.01, 1e-10


class Outlier(NamedTuple):
    """A pose that was left out."""

    pose: int
    legs: tuple[int, ...]
    """Legs whose positions are outliers; nearly all: the pose is."""
    residual: float
    """The largest of them [m]."""


class Validation(NamedTuple):
    """Errors of held-out poses by the file's geometry, and by a fit to the others."""

    before: PoseErrors
    after: PoseErrors


class Calibration(NamedTuple):
    """
    A calibrated geometry of n numbers: base and platform joints, and those of the kind of legs.

    Telescopic legs have 42, with their zero lengths; ``legs`` names them and their units.
    """

    parameters: Parameters
    """The file's parameters with the calibrated geometry."""
    names: tuple[str, ...]
    start: Array
    """(n,) values of the file."""
    values: Array
    """(n,) calibrated."""
    covariance: Array
    """(n, n)"""
    errors: Array
    """(n,) standard errors, with what the poses cannot identify; infinite if no noise is known."""
    states: tuple[str, ...]
    identifiability: Identifiability
    not_identified: str | None
    """Which numbers the poses cannot distinguish, and why; None: all are identified."""
    noise: Noise
    noise_given: bool
    frames: Frames | None
    """Of the device, if they were unknown."""
    poses: int
    """Number of poses that were used."""
    before: Array
    """(6,) RMS residuals of the legs by the file [m]."""
    after: Array
    outliers: tuple[Outlier, ...]
    validation: Validation | None
    lack_of_fit: tuple[PossibleError, ...]
    likely: tuple[PossibleError, ...]
    """Possible errors that were accepted."""
    assembly: tuple[PossibleError, ...]
    """Errors of the assembly that calibrated zeros show, which are in the values."""
    legs: CalibratedLegs
    """The numbers by name, unit and group."""


def calibrate(platform: StewartPlatform, lengths: ArrayLike, poses: Pose | Motion, *,
              unknowns: Sequence[str] = (ALL_GROUPS,), fixed: Sequence[str] = (),
              frames: str = 'known',
              noise: tuple[float, float, float] | None = None,
              hold_out: float = HOLD_OUT,
              angles: Array | None = None, degrees: bool = False,
              millimeters: Millimeters = METERS, drive_positions: bool = False,
              accept_mistakes: bool = False) -> Calibration:
    """
    Return the geometry that explains measured poses.

    Parameters
    ----------
    platform : StewartPlatform
        The hexapod as it is drawn.
    lengths : (N, 6)
        Measured positions of the drives, or commanded ones: as ``~/leg_states`` has them, [m], or
        [rad] where the drives turn.
    poses : Pose of shape (N,)
        Measured poses.
    unknowns : sequence of str
        Groups of numbers that are calibrated: ``zero``, ``joints``, of drives that turn
        ``lengths`` and ``axes`` as well; ``all`` by default. One pose is enough for ``zero``.
    fixed : sequence of str
        Parts of the geometry that keep the file's values: ``zero_length``,
        ``base_joints.leg_1``, ``platform_joints.leg_3.z``.
    frames : 'known' or 'unknown'
        Whether the poses are those of the platform frame in the base frame, or of a target on the
        platform in the frame of a device.
    noise : three floats, optional
        Standard deviations of the positions of drives, of each coordinate of the positions [m],
        and of the rotations about each axis [rad]; estimated by default.
    hold_out : float
        Share of the poses that validates a fit to the others; 0: none.
    angles : (N, 3), optional
        The angles of which the poses were made, to find angles in another unit.
    degrees : bool
        They, or angles of drives, were read as degrees.
    millimeters : Millimeters
        The numbers that were read as mm, to name the option for those in another unit.
    drive_positions : bool
        ``lengths`` are positions of drives whose screws turn with their legs: motor angles times
        lead / (2 pi gear_ratio).
    accept_mistakes : bool
        Return a result although a possible error is found or held-out poses are predicted worse.

    Raises
    ------
    StewartError
        The poses do not support a calibration, or a possible error is found.

    """
    p = platform.parameters
    legs = p.leg_kind.calibrated_legs(p)
    held = held_by_groups(legs, unknowns)
    measured = _checked(legs, held, lengths, poses)._replace(screws=_screws(p, drive_positions))
    if frames not in ('known', 'unknown'):
        raise ParameterError(f"frames: {frames!r}: must be 'known' or 'unknown'")
    if noise is not None and not any(noise):
        raise ParameterError('noise: 0, 0, 0: one of them must be above 0')
    unknown = frames == 'unknown'
    for name in fixed:
        held[chosen(legs, name)] = True
    if held.all() and not unknown:
        raise ParameterError('fixed: nothing is left to be calibrated')
    likely: list[PossibleError] = []

    def refuse(found_errors: Iterable[PossibleError]) -> None:
        likely.extend(found_errors)
        if likely and not accept_mistakes:
            raise StewartError(
                f'{likely[0].text}; nothing is calibrated (--accept-mistakes does)')

    refuse(find_input_errors(Measured(p, measured, unknown, angles, degrees, millimeters)))
    known = find_frames(p, measured) if unknown else SAME
    measured = measured._replace(frames=known)
    size = p.singularity.characteristic_length
    of_file, start = values_of(legs, known), values_of(legs, known)
    if not held[legs.zero].any():
        start[legs.zero] = legs.zero_guesses(measured.vectors(of_file), measured.positions)
    free = Unknowns.of(legs, start, size, held, unknown)
    first = outliers(measured, free)
    sound: Flags = ~first.left_out
    used = measured.part(sound)
    count = free.basis.shape[1]
    if len(used.positions) * 6 < count or (unknown and len(used.positions) * 6 == count):
        raise StewartError(f'{len(used.positions)} poses for {count} unknowns: '
                           f'at least {count // 6 + 1} are needed')
    if np.mean(sound) < 1.0 - MOST_OUTLIERS:
        refuse([PossibleError(
            'outliers', f'{np.sum(~sound)} of {len(sound)} poses do not fit the geometry that '
            f'fits all others: {p.leg_kind.position.field} and poses must be of the same '
            'instants, at rest')])
    exact = len(used.positions) * 6 == count  # no residual from which noise could be estimated
    known_noise = None if noise is None else Noise(*noise)
    found = fit(used, free, known_noise or (Noise(0.0, 0.0, 0.0) if exact else None))
    lack = lack_of_fit(platform, used, found, free, held, found.whitened if noise else None)
    what = found.identifiability
    what = what._replace(scales=what.scales[GEOMETRY], shares=what.shares[GEOMETRY],
                         directions=what.directions[GEOMETRY])
    states = tuple(FIXED if each else state for each, state in zip(
        held, states_of(what), strict=True))
    refuse(find_errors(RESULT_ERRORS, CalibratedFit(
        legs, found.values, found.lin.residuals, size)))
    assembly = assembly_errors(legs, found.values[GEOMETRY], np.sqrt(
        np.maximum(np.diag(found.covariance)[GEOMETRY], 0.0)), held)
    refuse(each for each in assembly if each.what == TURN)
    missing = not_identified(used, what.shares, LARGEST_SHARE, size)
    before, after = (np.sqrt(np.mean(each ** 2, axis=0)) for each in (
        used.at(_with_frames(used, free, of_file)).residuals, found.lin.residuals))
    if IDENTIFIED not in states and not held.all():  # frames alone have no numbers
        refuse([PossibleError(
            'identifiable', 'no number is identifiable by itself, with residuals of '
            f'{1e3 * after.max():.3g} mm: {lack[0].text if lack else missing}')])
    validation = _validated(used, free, of_file, found, hold_out)
    if validation is not None:
        if not validation.after.known:
            raise StewartError('by a fit to the other poses, the hexapod has no pose with the '
                               f'{p.leg_kind.position.field} of any held-out one')
        # Where zeros of the drives are far off, the file has no pose with the positions: it is
        # worse.
        errors_before, errors_after = (
            math.hypot(each.rms[0], size * each.rms[1]) if each.known else math.inf
            for each in validation)
        if not errors_after < _WORSE * errors_before:
            refuse([PossibleError(
                'worse', f'held-out poses are {_shown(validation.before)} off by the file, but '
                f'{_shown(validation.after)} by a fit to the others: the poses do not support a '
                'better geometry' + (f'; {lack[0].text}' if lack else ''))])
    covariance = found.covariance[GEOMETRY, GEOMETRY]
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0) + (what.shares * what.scales) ** 2)
    if exact and noise is None:
        errors[~held] = np.inf
    # Errors of neighbors are correlated: poses are known better than each number of the geometry.
    rounded = justified(found.values[GEOMETRY],
                        np.maximum(_DIGITS * np.sqrt(np.diag(covariance)), _FINEST))
    return Calibration(
        with_geometry(legs, rounded, held, written=True), legs.names(), of_file[GEOMETRY],
        found.values[GEOMETRY], covariance, errors, states, what, missing, found.noise,
        noise is not None, used.frames_at(found.values) if unknown else None,
        len(used.positions), before, after,
        tuple(Outlier(int(n), tuple(map(int, np.flatnonzero(first.outlying[n]))),
                      float(np.abs(first.residuals[n]).max())) for n in np.flatnonzero(~sound)),
        validation, lack, tuple(likely), assembly, legs)


def _checked(legs: CalibratedLegs, held: Flags, lengths: ArrayLike, poses: Pose | Motion,
             ) -> Equations:
    if not isinstance(poses, (Pose, Motion)):
        raise wrong_type('poses', poses, 'a Pose')
    field = legs.parameters.leg_kind.position.field
    given = as_array(field, lengths, (6,))
    pose = poses.pose if isinstance(poses, Motion) else poses
    if given.ndim != 2 or pose.shape != given.shape[:1]:
        raise MotionError(f'{field} {given.shape}, poses {pose.shape}: must be (N, 6) and (N,)')
    check_number(len(given), legs, held)
    return Equations(legs, given, pose)


def _screws(p: Parameters, drive_positions: bool) -> Array:
    """Return the screws, with a pitch if positions are those of drives."""
    if drive_positions:
        if p.drive.screw_rotation != UNIVERSAL:
            raise ParameterError('drive positions: with drive.screw_rotation: guided they are '
                                 'those of the legs')
        return screw_constants(p)
    if not p.leg_kind.ratio:  # no screws
        return GUIDED
    try:
        return np.column_stack([np.zeros(6), universal_axes(p)])
    except StewartError:  # no home pose
        return GUIDED


def check_number(poses: int, legs: CalibratedLegs, held: Flags) -> None:
    """
    Raise StewartError if these are too few poses for the numbers that are not ``held`` (n,).

    A pose has one equation of each leg, and one pose more gives the noise; one number of a leg,
    its zero, can be taken from a single pose.
    """
    of_a_leg = max(int(np.count_nonzero(~held[legs.columns(leg)])) for leg in range(6))
    fewest = of_a_leg + 1 if of_a_leg > 1 else 1
    if poses < fewest:
        raise StewartError(f'{poses} poses: at least {fewest} are needed, each leg has {of_a_leg} '
                           f'unknown{"s" if of_a_leg > 1 else ""}; 40 are advisable')


def _with_frames(equations: Equations, unknowns: Unknowns, of_file: Array) -> Array:
    """Return the file's values, with the frames that fit them best if these are unknown."""
    if not unknowns.basis[DEVICE.start:].any():
        return of_file
    return minimum(equations, of_file, np.diag(unknowns.scales)[:, DEVICE.start:], np.eye(6))


def _validated(equations: Equations, unknowns: Unknowns, of_file: Array, found: Fit,
               hold_out: float) -> Validation | None:
    """Return the validation: every n-th pose is predicted by a fit to the others."""
    every = round(1.0 / hold_out) if hold_out > 0.0 else 0
    index = np.arange(len(equations.positions))
    held = index % every == every // 2 if every else index < 0
    if not held.any() or np.count_nonzero(~held) < _FEWEST_OTHERS:
        return None
    others = equations.part(~held)
    before = _with_frames(others, unknowns, of_file)
    after = fit(others, unknowns, found.noise).values
    return Validation(*(pose_errors(
        with_geometry(equations.legs, each), equations.part(held).of_legs(each),
        equations.frames_at(each))
        for each in (before, after)))


def _shown(errors: PoseErrors) -> str:
    position, rotation = errors.rms
    return f'{1e3 * position:.3g} mm and {1e3 * rotation:.3g} mrad'
