# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Likely mistakes in measured poses, and numbers that these cannot distinguish.

A mistake is likely if the poses fit the file's geometry, up to a constant of each leg, several
times better without it: a real error of the geometry does not do that.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, product
import math

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.calibration.equations import (
    BASE, Equations, GEOMETRY, inverse, PLATFORM, SAME, values_of, ZERO)
from stewart_dynamics.calibration.frames import find_frames
from stewart_dynamics.calibration.measured_poses import Millimeters
from stewart_dynamics.errors import StewartError
from stewart_dynamics.mechanics.dynamics import lagrange
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.mechanics.frames.rotation import from_euler, to_quaternion
from stewart_dynamics.mechanics.kinematics.home_pose import determinant_at_home
from stewart_dynamics.parameters.table import AUTO, Parameters
from stewart_dynamics.reporting.estimates import LikelyMistake

# A mistake is likely if the misfit without it is smaller than this part.
_BETTER = 0.25
# Mistakes explain the poses alike if their misfits differ by this factor, or are below this value.
_ALIKE, _EXACT = 2.0, 1e-3
# Largest scale of positions that is tried and how near, logarithms; a misfit above all others.
_LARGEST_SCALE, _SCALE_STEP, _WORST = math.log(2.0), 1e-3, 1e3
DEVICE_SCALE, LEG_SCALE = 'device', 'scale'
# A joint that moves by a larger part of the characteristic length is not of this hexapod.
_FARTHEST = 0.3
# Residuals above this part of it mean that the model does not describe the poses.
_UNEXPLAINED = 0.03
# Zero lengths that become a smaller part of the file's are those of whole lengths.
_WHOLE = 0.1


def mistakes_of_input(parameters: Parameters, equations: Equations, unknown_frames: bool,
                      angles: Array | None, degrees: bool, millimeters: Millimeters,
                      ) -> Iterator[LikelyMistake]:
    """Yield the likeliest mistake in lengths, poses or their angles (N, 3), if one is likely."""
    given = _misfit(parameters, equations, unknown_frames)
    without = list(_without_mistakes(parameters, equations, millimeters))
    if angles is not None:
        rotation = from_euler(angles if degrees else np.radians(angles))
        text = ('the angles are in radians, not in degrees: without --degrees they are read so'
                if degrees else
                'the angles are in degrees, not in radians: --degrees reads them')
        turned = [(LikelyMistake('degrees', text), equations), *(
            (mistake._replace(text=f'{mistake.text}; {text}'), each)
            for mistake, each in without if mistake.what == 'unit')]
        without += [(mistake, each._replace(pose=Pose(each.pose.position, rotation)))
                    for mistake, each in turned]
    tried = [(_misfit(parameters, each, unknown_frames), mistake) for mistake, each in without]
    if not unknown_frames:
        tried.append((_misfit(parameters, equations, True), LikelyMistake(
            'frames', 'the poses are not those of the platform frame in the base frame, but of '
            'other frames: --frames unknown calibrates them as well')))
    best, mistake = min(tried, key=lambda each: each[0])
    if best >= _BETTER * given:
        tried = list(_of_scale(parameters, equations, unknown_frames)) or tried
        best, mistake = min(tried, key=lambda each: each[0])
    if best < _BETTER * given:
        # Symmetric hexapods: a mirrored frame is another order of the legs.
        texts = [each.text for misfit, each in tried if misfit <= max(_ALIKE * best, _EXACT)]
        yield mistake._replace(text=f'{"; or ".join(texts)} (misfit {best:.2g} of the motion'
                               + (f' instead of {given:.2g})' if given < math.inf else ')'))
    else:
        yield from _on_other_side(parameters, equations, unknown_frames)


def _of_scale(parameters: Parameters, equations: Equations, unknown_frames: bool,
              ) -> Iterator[tuple[float, LikelyMistake]]:
    """Yield the smallest misfit of positions, or leg positions, of any scale, and the mistake."""
    from scipy.optimize import minimize_scalar

    lengths, pose = equations.lengths, equations.pose
    for what, words, scaled in (
            (DEVICE_SCALE, 'positions of the device are {:.3g} times as large as they are by the '
             'legs: its calibration, or its target', lambda factor: equations._replace(
                 pose=Pose(pose.position / factor, pose.rotation))),
            (LEG_SCALE, 'leg positions are {:.3g} times as large as they are by the device: lead '
             'of the screw, gear or encoder', lambda factor: equations._replace(
                 lengths=lengths / factor))):
        found = minimize_scalar(
            lambda logarithm, scaled=scaled: min(_misfit(
                parameters, scaled(math.exp(logarithm)), unknown_frames), _WORST),
            bounds=(-_LARGEST_SCALE, _LARGEST_SCALE), method='bounded',
            options={'xatol': _SCALE_STEP})
        if abs(found.x) > _LARGEST_SCALE - 10.0 * _SCALE_STEP:
            continue  # any larger one would do: poses that do not determine the frames
        yield float(found.fun), LikelyMistake(what, words.format(math.exp(found.x)))


def _on_other_side(parameters: Parameters, equations: Equations, unknown_frames: bool,
                   ) -> Iterator[LikelyMistake]:
    """Yield a mistake if the platform is on the other side of its base, where lengths can fit."""
    try:
        frames = find_frames(parameters, equations) if unknown_frames else SAME
    except StewartError:
        return
    pose = equations.in_base(frames)
    determinants = lagrange.determinant(
        lagrange.unchecked_legs(parameters, pose.position, pose.rotation))
    if np.median(determinants) * determinant_at_home(parameters) < 0.0:
        yield LikelyMistake(
            'side', 'the poses are on the other side of the base than at home: likely a mirrored '
            '(left-handed) frame, with one axis of the opposite sign'
            + ('; or geometry.platform_side, which is not given'
               if parameters.geometry.platform_side == AUTO else
               f'; or geometry.platform_side, {parameters.geometry.platform_side}, is wrong'))


def mistakes_of_result(parameters: Parameters, values: Array, residuals: Array, size: float,
                       ) -> Iterator[LikelyMistake]:
    """Yield likely mistakes that show in calibrated values and their residuals (N, 6)."""
    left = float(np.sqrt(np.mean(residuals ** 2)))
    if left > _UNEXPLAINED * size:
        yield LikelyMistake('misfit', f'no geometry explains the poses: residuals of {_mm(left)} '
                            'mm remain; lengths and poses must be of the same instants')
    start, joints = values_of(parameters), parameters.joints
    zero = start[ZERO]
    moved = np.linalg.norm((values - start)[:PLATFORM.stop].reshape(12, 3), axis=1)
    if moved.max() > _FARTHEST * size:
        worst = int(np.argmax(moved))
        where = 'base' if worst < BASE.stop // 3 else 'platform'
        yield LikelyMistake('far', f'the {where} joint of {joints[worst % 6]} would move by '
                            f'{_mm(moved[worst])} mm: the poses are not those of this hexapod')
    off = np.abs(values[ZERO] - zero)
    if (zero > _FARTHEST * size).all() and (np.abs(values[ZERO]) < _WHOLE * zero).all():
        yield LikelyMistake(
            'zero_length', 'the leg positions are whole lengths between the joints, not positions '
            'from geometry.zero_length; if the hexapod publishes them so, it is zero')
    elif off.max() > _FARTHEST * size:
        worst = int(off.argmax())
        yield LikelyMistake(
            'zero_length', f'geometry.zero_length of {joints[worst]} would become '
            f'{values[ZERO][worst]:.4g} m in place of {zero[worst]:.4g} m: are the leg positions '
            'relative to home, or to another length?')


def _without_mistakes(parameters: Parameters, given: Equations, millimeters: Millimeters,
                      ) -> Iterator[tuple[LikelyMistake, Equations]]:
    """Yield mistakes, each with the measurements as they were without it."""
    lengths, pose = given.lengths, given.pose
    for of_positions, of_legs in product((1.0, 1e-3, 1e3), repeat=2):
        if (of_positions, of_legs) != (1.0, 1.0):
            words = _unit_words((of_positions, of_legs), millimeters)
            yield LikelyMistake('unit', words), given._replace(
                lengths=of_legs * lengths,
                pose=Pose(of_positions * pose.position, pose.rotation))
    for axis, name in enumerate('xyz'):
        mirror = np.where(np.arange(3) == axis, -1.0, 1.0)
        yield LikelyMistake(
            'mirrored', f'the poses are of a mirrored (left-handed) frame: {name} has the '
            'opposite sign'), given._replace(pose=Pose(
                mirror * pose.position, mirror[:, None] * pose.rotation * mirror))
    q = to_quaternion(pose.rotation)
    yield LikelyMistake('quaternion', 'quaternions have w first, not last'), given._replace(
        pose=Pose.from_quaternion(pose.position, np.roll(q, -1, axis=1)))
    yield LikelyMistake(
        'inverse', 'the poses are those of the base in the platform frame: the inverse is needed',
    ), given._replace(pose=inverse(pose))
    yield LikelyMistake(
        'inverse', 'the rotations are those of the base in the platform frame: the inverse is '
        'needed'), given._replace(pose=Pose(pose.position, np.swapaxes(pose.rotation, 1, 2)))
    yield LikelyMistake('sign', 'leg positions have the opposite sign: they must increase as a '
                        'leg extends'), given._replace(lengths=-lengths)
    joints = parameters.joints
    for a, b in combinations(range(6), 2):
        order = [{a: b, b: a}.get(leg, leg) for leg in range(6)]
        yield LikelyMistake('swapped', f'{joints[a]} and {joints[b]} are swapped'), given._replace(
            lengths=lengths[:, order])
    for turn in range(6):
        rolled = [*range(turn, 6), *range(turn)]
        for order in (rolled, rolled[::-1]):
            names = ', '.join(joints[n] for n in order)
            yield LikelyMistake('swapped', f'the legs are in another order: {names}'), (
                given._replace(lengths=lengths[:, order]))


def _unit_words(factors: tuple[float, float], given: Millimeters) -> str:
    """
    Return the wrong units of positions and leg positions, and the option that reads all of them.

    factors: by which both must be multiplied.
    """
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


def _misfit(parameters: Parameters, equations: Equations, unknown_frames: bool) -> float:
    """Return how far lengths are from those of the file, up to a constant, by their spread."""
    try:
        frames = find_frames(parameters, equations) if unknown_frames else SAME
    except StewartError:
        return math.inf

    def spread(lengths: Array) -> float:
        return float(np.linalg.norm(np.median(np.abs(lengths - np.median(lengths, 0)), axis=0)))

    r = equations._replace(frames=frames).at(values_of(parameters, frames)).residuals
    whole = max(spread(equations.lengths), spread(r + equations.lengths))
    return spread(r) / whole if whole > 0.0 else math.inf


def not_identified(joints: Sequence[str], shares: Array, largest: float, equations: Equations,
                   size: float) -> str | None:
    """Return which numbers the poses cannot distinguish and why, in words; None: all of them."""
    unclear = shares[:GEOMETRY] > largest
    if not unclear.any():
        return None
    kinds = []
    for part, name in ((BASE, 'base joints'), (PLATFORM, 'platform joints')):
        of_axes: dict[tuple[bool, ...], list[str]] = {}
        for axis, each in zip(('x', 'y', 'heights (z)'), unclear[part].reshape(6, 3).T,
                              strict=True):
            of_axes.setdefault(tuple(each.tolist()), []).append(axis)
        for of_legs, axes in of_axes.items():
            if any(of_legs):
                legs = '' if all(of_legs) else ' of ' + _listed(
                    [joint for joint, has in zip(joints, of_legs, strict=True) if has])
                kinds.append(f'{name}{legs}' if len(axes) == 3 else
                             f'{_listed(axes)} of the {name}{legs}')
    kinds += ['zero lengths'] if unclear[ZERO].any() else []
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
    return f'{motion}: {_listed(kinds)} cannot be distinguished; {more}'


def _listed(names: Sequence[str]) -> str:
    return ' and '.join([', '.join(names[:-1]), names[-1]]) if len(names) > 1 else names[0]


def _mm(meters: float) -> str:
    return f'{1e3 * meters:.3g}'
