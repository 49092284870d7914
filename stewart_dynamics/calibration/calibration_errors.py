# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Possible errors in measured poses, and numbers that these cannot distinguish.

An error is likely if the poses fit the file's geometry, up to a constant of each leg, several
times better without it: a real error of the geometry does not do that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import product
import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.calibration.assembly_errors import times_as_likely
from stewart_dynamics.calibration.equations import (
    BASE, Equations, inverse, PLATFORM, SAME, values_of)
from stewart_dynamics.calibration.frames import find_frames
from stewart_dynamics.calibration.measured_poses import Millimeters
from stewart_dynamics.errors import StewartError
from stewart_dynamics.legs.calibrated import CalibratedLegs, ComparedPositions, listed
from stewart_dynamics.mechanics.dynamics import lagrange
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.mechanics.frames.rotation import from_euler, to_quaternion
from stewart_dynamics.mechanics.kinematics.home_pose import determinant_at_home
from stewart_dynamics.parameters.table import AUTO, Parameters
from stewart_dynamics.possible_errors.hypothesis import (
    Hypothesis, likeliest, PossibleError, Table)
from stewart_dynamics.possible_errors.transforms import swapped_pairs

# An error is likely if the misfit without it is smaller than this part.
_BETTER = 0.25
# No error explains poses with a larger misfit, and none shows in poses that move the drives less
# than this part of their unit [m, rad].
_EXPLAINED, _SAME = 0.7, 1e-6
# Fewer poses have another unit of angles if the zeros are off by more than this [rad].
_LARGE_TURN = 0.3
# Cranks do not make more turns from zero.
_MOST_TURNS = 2.0
# Errors explain the poses alike if their misfits differ by this factor, or are below this value.
_ALIKE, _EXACT = 2.0, 1e-3
# Largest scale of positions that is tried and how near, logarithms; a misfit above all others.
_LARGEST_SCALE, _SCALE_STEP, _WORST = math.log(2.0), 1e-3, 1e3
DEVICE_SCALE, LEG_SCALE = 'device', 'scale'
# Fewer poses say nothing about errors that change the positions of a leg alike.
_FEWEST = 4
# A joint that moves by a larger part of the characteristic length is not of this hexapod.
_FARTHEST = 0.3
# Residuals above this part of it mean that the model does not describe the poses.
_UNEXPLAINED = 0.03


class Measured(NamedTuple):
    """Positions of the drives and poses as they are given, with the options that read them."""

    parameters: Parameters
    equations: Equations
    unknown_frames: bool
    angles: Array | None  # of the poses (N, 3), in the unit as they were read
    degrees: bool  # whether they, and positions that are angles, were read as degrees
    millimeters: Millimeters

    def misfit(self, equations: Equations, unknown_frames: bool | None = None) -> float:
        """Return how far positions are from the file's, up to a constant, by their spread."""
        unknown = self.unknown_frames if unknown_frames is None else unknown_frames
        try:
            known = equations._replace(frames=find_frames(
                self.parameters, equations) if unknown else SAME)
        except StewartError:
            return math.inf
        off, motions = _compared(known)
        whole = max(map(_spread, motions))
        return _spread(off) / whole if whole > 0.0 else math.inf


def find_input_errors(measured: Measured) -> Iterator[PossibleError]:
    """Yield the likeliest error in positions, poses or their angles, if one is likely."""
    equations = measured.equations
    if len(equations.positions) < _FEWEST or not _moved(equations):
        yield from _unit_of_few(equations, measured.degrees)
        yield from _on_other_side(measured)
        return
    given = measured.misfit(equations)
    tried = [(measured.misfit(each), error) for error, each in _without_errors(measured)]
    if not measured.unknown_frames:
        tried.append((measured.misfit(equations, unknown_frames=True), PossibleError(
            'frames', 'the poses are not those of the platform frame in the base frame, but of '
            'other frames: --frames unknown calibrates them as well')))
    largest = min(_BETTER * given, _EXPLAINED)
    # Symmetric hexapods: a mirrored frame is another order of the legs.
    if found := likeliest(tried, largest, _ALIKE, _EXACT) or likeliest(
            _of_scale(measured), largest, _ALIKE, _EXACT):
        best, error = min(found, key=lambda each: each[0])
        yield error._replace(text=(
            f'{"; or ".join(each.text for _, each in found)} (misfit {best:.2g} of the motion'
            + (f' instead of {given:.2g}' if given < math.inf else '')
            + _likelihood(equations, best, given) + ')'))
    else:
        yield from _on_other_side(measured)


def _moved(equations: Equations) -> bool:
    """Return whether the poses differ from one another."""
    _, motions = _compared(equations)
    return max(map(_spread, motions)) > _SAME


def _unit_of_few(equations: Equations, degrees: bool) -> Iterator[PossibleError]:
    """Yield another unit of angles that a few poses, or one, show by the zeros they lead to."""
    if not equations.legs.signs:
        return
    unit, = equations.legs.units.values()
    given, by_unit = (_from_file(equations._replace(positions=factor * equations.positions))
                      for factor in (1.0, unit))
    largest = float(np.abs(equations.positions).max())
    if not degrees and given > _LARGE_TURN and by_unit < _BETTER * given:
        yield PossibleError('unit', (
            f'{_unit_words((1.0, unit), Millimeters(), degrees, equations)} (zeros are then '
            f'{math.degrees(by_unit):.2g} deg from those of the file, root mean square, instead '
            f'of {math.degrees(given):.2g} deg)'))
    elif largest > _MOST_TURNS * 2.0 * math.pi:
        yield PossibleError('unit', (
            f'{_name_of(equations)} are up to {largest:.3g} rad, {largest / (2.0 * math.pi):.3g} '
            'turns: likely degrees, pulses or increments'))


def _from_file(equations: Equations) -> float:
    """Return how far drives that turn are from where the file has them, root mean square."""
    legs = equations.legs
    values = values_of(legs, equations.frames)
    off = legs.zero_guesses(equations.vectors(values), equations.positions)
    return float(np.sqrt(np.mean(off ** 2)))


def _likelihood(equations: Equations, best: float, given: float) -> str:
    """Return how much likelier positions without an error are, in words; may be empty."""
    count = equations.positions.size - 12  # less the middle and the scatter of each leg
    if not equations.legs.signs or not 0.0 < best < given < math.inf or count < 1:
        return ''
    return f', {times_as_likely(count * math.log(given / best))} as likely'


def _of_scale(measured: Measured) -> Iterator[tuple[float, PossibleError]]:
    """Yield the smallest misfit of positions, or leg positions, of any scale, and the error."""
    from scipy.optimize import minimize_scalar

    equations = measured.equations
    positions, pose = equations.positions, equations.pose
    for what, words, scaled in (
            (DEVICE_SCALE, 'positions of the device are {:.3g} times as large as they are by the '
             'legs: its calibration, or its target', lambda factor: equations._replace(
                 pose=Pose(pose.position / factor, pose.rotation))),
            (LEG_SCALE, f'{_name_of(equations)} are {{:.3g}} times as large as they are by the '
             f'device: {equations.legs.scale_words}', lambda factor: equations._replace(
                 positions=positions / factor))):
        found = minimize_scalar(
            lambda logarithm, scaled=scaled: min(
                measured.misfit(scaled(math.exp(logarithm))), _WORST),
            bounds=(-_LARGEST_SCALE, _LARGEST_SCALE), method='bounded',
            options={'xatol': _SCALE_STEP})
        if abs(found.x) > _LARGEST_SCALE - 10.0 * _SCALE_STEP:
            continue  # any larger one would do: poses that do not determine the frames
        yield float(found.fun), PossibleError(what, words.format(math.exp(found.x)))


def _on_other_side(measured: Measured) -> Iterator[PossibleError]:
    """Yield an error if the platform is on the other side of its base, where lengths can fit."""
    p, equations = measured.parameters, measured.equations
    try:
        frames = find_frames(p, equations) if measured.unknown_frames else SAME
    except StewartError:
        return
    pose = equations.in_base(frames)
    with np.errstate(invalid='ignore'):  # poses out of reach
        determinants = lagrange.determinant(
            lagrange.unchecked_legs(p, pose.position, pose.rotation))
    if np.median(determinants) * determinant_at_home(p) < 0.0:
        side = p.geometry.platform_side
        yield PossibleError(
            'side', 'the poses are on the other side of the base than at home: likely a mirrored '
            '(left-handed) frame, with one axis of the opposite sign; or geometry.platform_side, '
            + ('which is not given' if side == AUTO else f'{side}, is wrong'))


class CalibratedFit:
    """Calibrated values (n,) and their residuals (N, 6) [m], for a hexapod of a size [m]."""

    def __init__(self, legs: CalibratedLegs, values: Array, residuals: Array, size: float) -> None:
        self.legs, self.values, self.size = legs, values, size
        self.left = 1e3 * float(np.sqrt(np.mean(residuals ** 2)))  # [mm]
        self.moved = 1e3 * np.linalg.norm(
            (values - values_of(legs))[:PLATFORM.stop].reshape(12, 3), axis=1)  # [mm]
        self.joint = [f'{body} joint of {leg}' for body in ('base', 'platform')
                      for leg in legs.parameters.joints]


RESULT_ERRORS: Table[CalibratedFit] = (
    Hypothesis('misfit', lambda c: c.left - 1e3 * _UNEXPLAINED * c.size, (
        'no geometry explains the poses: residuals of {left:.3g} mm remain; lengths and poses '
        'must be of the same instants')),
    Hypothesis('far', lambda c: c.moved - 1e3 * _FARTHEST * c.size, (
        'the {joint} would move by {moved:.3g} mm: the poses are not those of this hexapod')),
    lambda c: c.legs.possible_errors(c.values, c.size))


def _name_of(equations: Equations) -> str:
    """Return the name of the measured positions of the drives."""
    kind = equations.legs.parameters.leg_kind
    return 'leg positions' if kind.position.unit == 'm' else f'{kind.position.field} of the legs'


def _mirrored(mirror: Array, pose: Pose) -> Pose:
    """Return poses of a frame with axes of the opposite sign (3,)."""
    return Pose(mirror * pose.position, mirror[:, None] * pose.rotation * mirror)


# Errors of poses, and the poses without them.
_POSES: tuple[tuple[str, str, Callable[[Pose], Pose]], ...] = (
    *(('mirrored', 'the poses are of a mirrored (left-handed) frame: '
       f'{name} has the opposite sign', partial(_mirrored, mirror)) for name, mirror in zip(
        'xyz', 1.0 - 2.0 * np.eye(3), strict=True)),
    ('quaternion', 'quaternions have w first, not last', lambda pose: Pose.from_quaternion(
        pose.position, np.roll(to_quaternion(pose.rotation), -1, axis=1))),
    ('inverse', 'the poses are those of the base in the platform frame: the inverse is needed',
     inverse),
    ('inverse', 'the rotations are those of the base in the platform frame: the inverse is '
     'needed', lambda pose: Pose(pose.position, np.swapaxes(pose.rotation, 1, 2))))


def _orders(joints: Sequence[str]) -> Iterator[tuple[str, list[int]]]:
    """Yield other orders of the legs, in words."""
    for a, b, order in swapped_pairs():
        yield f'{joints[a]} and {joints[b]} are swapped', order
    for turn in range(6):
        rolled = [*range(turn, 6), *range(turn)]
        for order in (rolled, rolled[::-1]):
            yield f'the legs are in another order: {", ".join(joints[n] for n in order)}', order


def _without_errors(measured: Measured) -> Iterator[tuple[PossibleError, Equations]]:
    """Yield possible errors, each with the measurements as they were without it."""
    given, degrees = measured.equations, measured.degrees
    lengths, pose, legs = given.positions, given.pose, given.legs
    unit, = legs.units.values()
    turned = None if measured.angles is None else from_euler(
        measured.angles if degrees else np.radians(measured.angles))
    of_angles = ('the angles are in radians, not in degrees: without --degrees they are read so'
                 if degrees else 'the angles are in degrees, not in radians: --degrees reads them')
    for of_positions, of_legs in product((1.0, 1e-3, 1e3), (1.0, unit, round(1.0 / unit, 9))):
        words = '' if of_positions == of_legs == 1.0 else _unit_words(
            (of_positions, of_legs), measured.millimeters, degrees, given)
        scaled, position = given._replace(
            positions=of_legs * lengths), of_positions * pose.position
        if words:
            yield PossibleError('unit', words), scaled._replace(
                pose=Pose(position, pose.rotation))
        if turned is not None:
            yield PossibleError('unit' if words else 'degrees', (
                f'{words}; {of_angles}' if words else of_angles)), scaled._replace(
                    pose=Pose(position, turned))
    for what, words, without in _POSES:
        yield PossibleError(what, words), given._replace(pose=without(pose))
    yield PossibleError('sign', f'{_name_of(given)} have the opposite sign'
                        + ('' if legs.signs else ': they must increase as a leg extends')), (
        given._replace(positions=-lengths))
    orders = [*_orders(legs.parameters.joints)]
    for text, order in orders:
        yield PossibleError('swapped', text), given._replace(positions=lengths[:, order])
    if not legs.signs:
        return
    if measured.unknown_frames:
        for leg in range(6):
            yield _reversed(given, [leg])
        return
    for text, order in [('', [*range(6)]), *(each for each in orders if each[1] != [*range(6)])]:
        ordered = given._replace(positions=lengths[:, order])
        other_way = ordered._replace(positions=-ordered.positions)
        better = np.flatnonzero(
            _deviations(other_way) < _BETTER * _deviations(ordered)).tolist()
        if better and len(better) < 6:
            error, equations = _reversed(ordered, better)
            yield (PossibleError('swapped', f'{text}, and {error.text}') if text else error), (
                equations)


def _reversed(given: Equations, legs: Sequence[int]) -> tuple[PossibleError, Equations]:
    """Return the error that drives turn the other way, and the positions without it."""
    positions = given.positions.copy()
    positions[:, legs] *= -1.0
    names = listed([given.legs.parameters.joints[leg] for leg in legs])
    field = given.legs.parameters.leg_kind.position.field
    turn = 'turns' if len(legs) == 1 else 'turn'
    return PossibleError(
        'reversed', f'{names} {turn} the other way: {field} of the opposite sign'), given._replace(
            positions=positions)


def _unit_words(factors: tuple[float, float], given: Millimeters, degrees: bool,
                equations: Equations) -> str:
    """
    Return the wrong units of positions and leg positions, and the option that reads all of them.

    factors: by which both must be multiplied. degrees: whether angles were read so.
    """
    if equations.legs.parameters.leg_kind.position.unit == 'm':
        return _length_words(factors, given)
    of_positions, of_legs = factors
    words = [] if of_positions == 1.0 else [_length_words((of_positions, 1.0), given)]
    (unit, size), option = *equations.legs.units.items(), equations.legs.unit_option
    if of_legs == size:
        words.append(f'{_name_of(equations)} are in {unit}, not in rad'
                     + ('' if degrees else f': {option} reads them so'))
    elif of_legs != 1.0:
        words.append(f'{_name_of(equations)} are in rad, not in {unit}'
                     + (f': without {option} they are read so' if degrees else ''))
    return '; '.join(words)


def _length_words(factors: tuple[float, float], given: Millimeters) -> str:
    """Return the same of lengths alone."""
    wrong: dict[str, list[str]] = {}
    fitting = list(given)
    for n, (factor, name) in enumerate(zip(factors, ('positions', 'leg positions'), strict=True)):
        if factor != 1.0:
            in_mm = factor < 1.0
            text = ('are in mm, not in m' if in_mm and not given[n] else
                    'are in m, not in mm' if given[n] and not in_mm else
                    'are a thousand times too large' if in_mm else
                    'are a thousand times too small')
            wrong.setdefault(text, []).append(name)
            fitting[n] = in_mm
    option, now = Millimeters(*fitting).option, given.option
    if any('thousand' in text for text in wrong):
        hint = ''
    elif not option:
        hint = f': without {now} they are read so'
    else:
        hint = f': {option} reads them so' if not now else f': {option} in place of {now}'
    return '; '.join(f'{" and ".join(names)} {text}' for text, names in wrong.items()) + hint


def _spread(positions: Array) -> float:
    return float(np.linalg.norm(np.median(
        np.abs(positions - np.median(positions, 0)), axis=0)))


def _compared(equations: Equations) -> ComparedPositions:
    """Return positions by the file and measured ones."""
    values = values_of(equations.legs, equations.frames)
    return equations.legs.compared(
        equations.vectors(values), equations.at(values).residuals, equations.positions)


def _deviations(equations: Equations) -> Array:
    """Return the median magnitudes (6,) of position errors, each leg about its median."""
    off, _ = _compared(equations)
    found: Array = np.median(np.abs(off - np.median(off, 0)), axis=0)
    return found


def not_identified(equations: Equations, shares: Array, largest: float, size: float,
                   ) -> str | None:
    """Return which numbers the poses cannot distinguish and why, in words; None: all of them."""
    legs, unclear = equations.legs, shares > largest
    if not unclear.any():
        return None
    joints = legs.parameters.joints
    kinds = []
    for part, name in ((BASE, 'base joints'), (PLATFORM, 'platform joints')):
        of_axes: dict[tuple[bool, ...], list[str]] = {}
        for axis, each in zip(('x', 'y', 'heights (z)'), unclear[part].reshape(6, 3).T,
                              strict=True):
            of_axes.setdefault(tuple(each.tolist()), []).append(axis)
        for of_legs, axes in of_axes.items():
            if any(of_legs):
                which = '' if all(of_legs) else ' of ' + listed(
                    [joint for joint, has in zip(joints, of_legs, strict=True) if has])
                kinds.append(f'{name}{which}' if len(axes) == 3 else
                             f'{listed(axes)} of the {name}{which}')
    kinds += [each.words for each in legs.own if unclear[legs.parts[each.name]].any()]
    middle = equations.pose.rotation.mean(axis=0)
    u, _, v = np.linalg.svd(middle)
    turns = 2.0 * to_quaternion(equations.pose.rotation @ (u @ v).T)[:, :3]
    spreads, directions = np.linalg.eigh(turns.T @ turns / len(turns))
    turned = int(np.count_nonzero(np.sqrt(np.maximum(spreads, 0.0)) > 0.01))
    moved = np.linalg.svd(equations.pose.position - equations.pose.position.mean(axis=0),
                          compute_uv=False) / math.sqrt(len(turns))
    lines = int(np.count_nonzero(moved > 0.01 * size))
    if turned == 0:
        motion = 'translations only' if lines else 'one and the same pose'
        more = 'add poses that are turned about two axes or more'
    elif turned == 1:
        along = directions[:, -1]
        near = int(np.argmax(np.abs(along)))
        name = ('turns about x', 'turns about y', 'yaw')[near] if abs(along[near]) > 0.99 else (
            f'turns about ({", ".join(f"{x:.2f}" for x in along)})')
        motion, more = f'{name} only', 'add poses that are turned about another axis'
    elif lines < 3:
        motion = ('a fixed position', 'positions on a line', 'positions in a plane')[lines]
        more = 'add poses at other positions'
    else:
        motion, more = 'the poses vary too little for their residuals', (
            'larger motions and more poses identify more')
    return f'{motion}: {listed(kinds)} cannot be distinguished; {more}'
