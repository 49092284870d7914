# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The parameters of the hexapod in a file of another tool, with one remark for each assumption.

A leg is made of two slender bodies here: all bodies on one side of its slide become one, its
center of mass and its inertia are taken along the line between the joints.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
import math
from pathlib import Path
import re
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.description.mechanism import (
    BALL, DescriptionError, HERE, HINGE, Joint, Mechanism, MechanismBody, OF_SLIDE, Placement,
    UNIVERSAL)
from stewart_dynamics.description.read_mjcf import read_mjcf
from stewart_dynamics.description.read_sdf import read_sdf
from stewart_dynamics.description.read_urdf import read_urdf
from stewart_dynamics.description.read_usd import read_usd, SUFFIXES
from stewart_dynamics.description.topology import Chain, LegJoint, LEGS, Topology, topology_of
from stewart_dynamics.description.xml_text import NOT_SET
from stewart_dynamics.errors import one_line, shown
from stewart_dynamics.mechanics.kinematics.home_pose import home_of
from stewart_dynamics.mechanics.limits import LENGTH_MAX, LENGTH_MIN
from stewart_dynamics.parameters.table import (
    mean_radius, NEGATIVE, NO_MASS, PARAMETERS, Parameters, POSITIVE, STANDARD_GRAVITY)
from stewart_dynamics.whole_file import read_text

# Smaller parts of the length of a leg, or smaller angles [rad], are rounding errors.
_SMALL = 1e-6
_INCLINED = 1e-3
_ACROSS = math.radians(45.0)
_OFF_AXIS = 1e-3
_UNEQUAL = 0.01
_THICK = 0.05
# A platform with less of the mass of a leg has dummies of joints alone.
_MISSING = 0.02
_COUNTS = dict(enumerate(('no', 'one', 'two', 'three', 'four', 'five', 'six')))
# Legs whose mean direction has a smaller part along the normal of the base joints' plane point to
# neither side of it.
_FLAT = 0.05
# Bodies of a smaller part of the platform's mass are only frames.
_NEGLIGIBLE = 1e-7


class Recognized(NamedTuple):
    """The hexapod of a file."""

    parameters: Parameters
    remarks: tuple[str, ...]  # assumptions and missing values, one line each
    warnings: tuple[str, ...] = ()  # what makes forces wrong at rest, too, one line each


class _Body(NamedTuple):
    """Several bodies as one, in world axes."""

    mass: float
    center: Array
    inertia: Array


@np.errstate(all='ignore')  # what overflows breaks a rule of the parameters
def recognized(mechanism: Mechanism, geometry_only: bool = False) -> Recognized:
    """
    Return the parameters of the hexapod in a mechanism.

    geometry_only: leave masses and friction out; the platform gets a mass that stands for none.
    Raises DescriptionError if there is no hexapod in it, ParameterError if its numbers break a
    rule of the parameters.
    """
    found = topology_of(mechanism)
    parts = [*found.platform_parts, *(
        part for chain in found.chains for part in chain.lower + chain.upper)]
    _leave_out_frames(found.platform_parts, parts)
    remarks, warnings = list(mechanism.remarks), list(mechanism.warnings)
    legs, of_legs = [], []
    for chain in found.chains:
        said: list[str] = []
        legs.append(_leg(chain, found, said))
        of_legs.append(said)
    names = [leg['joints'] for leg in legs]
    warnings += _grouped(names, [[*_springs(chain)] for chain in found.chains])
    remarks += [part.note for part in parts if part.note]
    remarks += [f'{part.name}: {what} of this body is left out'
                for part in parts for what in part.left_out]
    warnings += [f'{part.name}: {part.weightless} is left out: forces have its whole weight'
                 for part in parts if part.weightless and part.mass]
    warnings += _placeholders(parts)
    _add_of_platform_joints(mechanism, found, remarks, warnings)
    remarks += _grouped(names, of_legs)
    values: dict[str, Any] = {
        'base_frame': found.base.name, 'platform_frame': found.platform.name,
        'joints': names}
    for key in legs[0]:
        if key not in ('joints', 'direction'):
            values[key] = np.array([leg[key] for leg in legs]).ravel() if all(
                leg[key] is not None for leg in legs) else None
    if not geometry_only:
        values |= _platform(found, remarks, warnings)
    values['gravity'] = _gravity(mechanism, found, remarks)
    values |= _carried(mechanism, found, values, remarks)
    if geometry_only:
        values, warnings = _without_masses(values), []
    given = {name: value for name, value in values.items() if value is not None}
    remarks += _missing(given, mechanism, found, legs)
    parameters = _with_side(Parameters(given, mechanism.source), [
        leg['direction'] for leg in legs])
    return Recognized(parameters, tuple(dict.fromkeys(remarks)), tuple(dict.fromkeys(warnings)))


def _leave_out_frames(of_platform: Iterable[MechanismBody], parts: Iterable[MechanismBody],
                      ) -> None:
    """Take away the masses of bodies that have one only because an engine needs it."""
    least = _NEGLIGIBLE * max(part.mass or 0.0 for part in of_platform)
    for part in parts:
        if part.mass and part.mass < least:
            part.mass, part.inertia = 0.0, np.zeros((3, 3))


def _placeholders(parts: Iterable[MechanismBody]) -> list[str]:
    """Return the warning about bodies with the mass and inertia that other tools begin with."""
    names = [part.name for part in parts if part.mass == 1.0 and not part.note
             and np.array_equal(part.inertia, np.eye(3))]
    if not names:
        return []
    more = f' and {len(names) - 1} more' if len(names) > 1 else ''
    return [f'{names[0]}{more}: 1 kg and 1 kg m^2 about each axis: likely placeholders of another '
            'tool, in place of the masses of these bodies']


def _springs(chain: Chain) -> Iterator[str]:
    """Yield remarks about forces on the joints of a leg at rest, too."""
    for n, step in enumerate(chain.steps):
        for spring in step.joint.springs:
            yield f'{spring},{_place(chain, n)} is left out'


def _place(chain: Chain, n: int) -> str:
    """Return which joint of a leg it is, in words; nothing for its prismatic joint."""
    if n == chain.slide:
        return ''
    return f' of its joints at the {"base" if n < chain.slide else "platform"}'


def _left_out(chain: Chain) -> Iterator[str]:
    """Yield remarks about forces on the joints of a moving leg, and about their limits."""
    yield from chain.steps[chain.slide].joint.remarks
    for n, step in enumerate(chain.steps):
        for what in [*step.joint.left_out, *([] if n == chain.slide else _passive(step.joint))]:
            yield f'{what}{_place(chain, n)} is left out'


def _passive(joint: Joint) -> Iterator[str]:
    """Yield the friction and inertia of a joint that has no actuator in this model."""
    for name in ('damping', 'friction', 'armature'):
        if getattr(joint, name):
            yield f'{name} {getattr(joint, name):.6g}'


def _add_of_platform_joints(mechanism: Mechanism, found: Topology, remarks: list[str],
                            warnings: list[str]) -> None:
    """Add remarks about forces on joints of the platform outside the legs, as a free joint."""
    of_legs = {step.joint.name for chain in found.chains for step in chain.steps}
    platform = {part.name for part in found.platform_parts}
    for joint in mechanism.joints:
        if joint.name not in of_legs and platform & {joint.parent, joint.child}:
            warnings += [f'{joint.name}: {spring}, is left out' for spring in joint.springs]
            remarks += [f'{joint.name}: {what} is left out'
                        for what in (*joint.left_out, *_passive(joint))]


def _leg(chain: Chain, found: Topology, said: list[str]) -> dict[str, Any]:
    """Return the parameters of one leg."""
    at, base = chain.slide, found.base.placement
    slide, out = chain.steps[at].joint, chain.steps[at].from_parent
    lower, upper = chain.steps[:at], chain.steps[at + 1:]
    if not lower or not upper:
        end = found.platform if lower else found.base
        raise DescriptionError(f'{slide.name}: no joint between it and {shown(end.name)}: a leg '
                               'of this model turns at both of its ends')
    root = _center(lower, 'base', said)
    tip = _center(upper, 'platform', said)
    _say_other_joints(lower, upper, said)
    on_platform = tip if len(upper) > 1 or upper[0].joint.child_anchor is None else upper[-1].far
    gap = float(np.linalg.norm(tip - on_platform))
    length = float(np.linalg.norm(tip - root))
    axis = slide.axes[0]
    along = axis if axis @ (tip - root) >= 0.0 and (out or length > 0.0) else -axis
    closed = gap <= _SMALL * max(length, np.finfo(float).tiny)
    if length > 0.0:
        line = (tip - root) / length
        angle = math.acos(min(1.0, float(abs(line @ axis))))
        if angle > _ACROSS:
            raise DescriptionError(
                f'{slide.name}: the axis of this prismatic joint is inclined to the line between '
                f'the joints of its leg by {math.degrees(angle):.3g} degrees: must be along it')
        if angle > _INCLINED:
            said.append('the axis of its prismatic joint is inclined to the line between the '
                        f'joints by {math.degrees(angle):.3g} degrees: taken along the line')
        along = line if angle > _SMALL else along
    if not closed and not chain.steps[-1].joint.name.startswith(slide.name):
        said.append(f'its end is {gap:.3g} m from its joint on the platform at the positions of '
                    'the file: the loop is open')
    grows = float(np.sign((axis if out else -axis) @ along))
    if grows < 0.0:
        said.append('its prismatic joint is positive while it retracts: the sign is turned')
    zero = length - grows * slide.position
    ends = [None if q is None else zero + grows * q for q in (slide.lower, slide.upper)]
    if grows < 0.0:
        ends.reverse()
    low, high = (-math.inf if slide.lower is None else slide.lower,
                 math.inf if slide.upper is None else slide.upper)
    if not low - _SMALL * length <= slide.position <= high + _SMALL * length:
        said.append(f'its position in the file, {slide.position:.4g} m, is outside its limits, '
                    f'{low:.4g} to {high:.4g} m')
    leg: dict[str, Any] = {
        'joints': slide.name, 'direction': base.rotation.T @ along,
        'geometry.base_joints': base.inside(root),
        'geometry.platform_joints': found.platform.placement.inside(on_platform),
        'geometry.zero_length': max(zero, 0.0),
        'actuator.reflected_mass': slide.armature, 'actuator.viscous_friction': slide.damping,
        'actuator.coulomb_friction': slide.friction}
    for name, value in zip(OF_SLIDE, [*ends, slide.velocity_max, slide.force_max], strict=True):
        least = 0.0 if name == 'limits.length_min' else np.finfo(float).tiny
        if value is not None and value < least:
            said.append(f'{name}: {value:.3g}: cannot be: left out')
            value = None
        leg[name] = value
    if slide.lower is not None and slide.lower == slide.upper:
        said.append(f'{LENGTH_MIN}, {LENGTH_MAX}: lower and upper are both {slide.lower:.4g}: '
                    'no travel: left out')
        leg |= dict.fromkeys((LENGTH_MIN, LENGTH_MAX))
    said += _left_out(chain)
    for part, bodies, start, way in (('cylinder', chain.lower, root, along),
                                     ('piston', chain.upper, tip, -along)):
        leg |= _slender(part, bodies, start, way, length, said)
    return leg


def _say_other_joints(lower: list[LegJoint], upper: list[LegJoint], said: list[str]) -> None:
    """Say that a leg has not one universal joint and one ball joint."""
    axes = {HINGE: 1, UNIVERSAL: 2, BALL: 3}
    at_base, at_platform = (sum(axes.get(step.joint.kind, 0) for step in steps)
                            for steps in (lower, upper))
    if at_base >= 3 and at_platform >= 3:
        said.append('ball joints at both ends, no universal joint: it may turn about its own axis '
                    'in the file: taken as one that does not')
    elif at_base == at_platform == 2:
        said.append('universal joints at both ends: it cannot turn freely about its own axis: '
                    'taken as one with a ball joint')


def _center(steps: list[LegJoint], where: str, said: list[str]) -> Array:
    """Return the point about which joints turn, on the side of the leg [m]."""
    points = [step.far if where == 'base' else step.near for step in steps]
    full = [point for point, step in zip(points, steps, strict=True)
            if step.joint.kind in (BALL, UNIVERSAL)]
    if full:
        apart = max(float(np.linalg.norm(point - full[0])) for point in full)
        if apart > 0.0:
            said.append(f'its joints at the {where} are {apart:.3g} m apart: the first is taken')
        return full[0]
    lines = [(point, step.joint.axes[0]) for point, step in zip(points, steps, strict=True)
             if step.joint.kind == HINGE]
    if len(lines) < 2:
        said.append(f'its joint at the {where} turns about one axis: taken as one that turns '
                    'about all')
        return points[0]
    if all(np.array_equal(point, lines[0][0]) for point, _ in lines):
        return lines[0][0]
    across = [np.eye(3) - np.outer(axis, axis) for _, axis in lines]
    matrix = np.sum(across, axis=0)
    if np.linalg.cond(matrix) > 1.0 / _SMALL:
        said.append(f'the axes of its joints at the {where} are parallel: their middle is taken')
        return np.asarray(np.mean([point for point, _ in lines], axis=0))
    center = np.linalg.solve(matrix, np.sum(
        [a @ point for a, (point, _) in zip(across, lines, strict=True)], axis=0))
    missed = max(float(np.linalg.norm(a @ (center - point)))
                 for a, (point, _) in zip(across, lines, strict=True))
    if missed > _SMALL:
        said.append(f'the axes of its joints at the {where} miss each other by '
                    f'{2.0 * missed:.3g} m: their middle is taken')
    return center


def _slender(part: str, bodies: list[MechanismBody], start: Array, way: Array, length: float,
             said: list[str]) -> dict[str, Any]:
    """Return mass, center and transverse inertia of a leg's bodies along its line."""
    body = _together(bodies, HERE)
    name = f'legs.{part}'
    if not any(each.mass for each in bodies):
        said.append(f'no mass of its {part}: {name}.mass is 0.0')
    arm = body.center - start
    center = float(arm @ way) if body.mass else 0.0
    off = float(np.linalg.norm(arm - center * way)) if body.mass else 0.0
    if off > _OFF_AXIS * max(length, abs(center)):
        said.append(f'the center of mass of its {part} is {off:.3g} m off the line between the '
                    'joints: taken on the line')
    axial = float(way @ body.inertia @ way)
    across = np.eye(3) - np.outer(way, way)
    moments = np.linalg.eigvalsh(across @ body.inertia @ across)[1:]
    transverse = 0.5 * (float(np.trace(body.inertia)) - axial)
    if transverse > 0.0 and moments[1] - moments[0] > _UNEQUAL * moments[1]:
        said.append(f'the two transverse moments of inertia of its {part} differ: their mean is '
                    'taken')
    if axial > _THICK * transverse:
        said.append(f'inertia of its {part} about its axis, {axial:.3g} kg m^2, is left out')
    return {f'{name}.mass': body.mass, f'{name}.center_of_mass': center,
            f'{name}.inertia': max(transverse, 0.0)}


def _together(parts: Iterable[MechanismBody], frame: Placement) -> _Body:
    """Return several bodies as one, in a frame."""
    heavy = [part for part in parts if part.mass]
    if not heavy:
        return _Body(0.0, np.zeros(3), np.zeros((3, 3)))
    if len(heavy) == 1 and heavy[0].placement is frame:
        return _Body(heavy[0].mass or 0.0, heavy[0].center, heavy[0].inertia)
    masses = np.array([part.mass for part in heavy])
    centers = np.array([frame.inside(part.placement.point(part.center)) for part in heavy])
    center = masses @ centers / masses.sum()
    inertia = np.zeros((3, 3))
    for part, mass, at in zip(heavy, masses, centers, strict=True):
        turn, arm = frame.rotation.T @ part.placement.rotation, at - center
        inertia += turn @ part.inertia @ turn.T + mass * (arm @ arm * np.eye(3)
                                                          - np.outer(arm, arm))
    return _Body(float(masses.sum()), center, inertia)


def _without_masses(values: dict[str, Any]) -> dict[str, Any]:
    """Return the geometry and the limits, with a platform whose mass stands for none."""
    kept = {name: value for name, value in values.items()
            if not name.startswith(('legs.', 'actuator.', 'drive.', 'platform.'))}
    radius = mean_radius(np.reshape(values['geometry.platform_joints'], (6, 3)))
    mass = NO_MASS * radius ** 3
    moment = 0.25 * mass * radius ** 2
    return kept | {'actuator.reflected_mass': 0.0, 'platform.mass': mass, 'platform.inertia': [
        moment, 0.0, 0.0, moment, 0.0, 2.0 * moment]}


def _missing_mass(found: Topology, mass: float) -> str:
    """Return the warning that the platform's mass is missing; empty if it is not."""
    heavy = [part for part in found.platform_parts if part.mass]
    ends = {end for chain in found.chains
            for end in (chain.steps[-1].joint.parent, chain.steps[-1].joint.child)}
    of_legs = [part.mass or 0.0 for chain in found.chains for part in chain.lower + chain.upper]
    of_leg = sum(of_legs) / len(found.chains)
    dummies = not found.platform.mass and all(part.name in ends for part in heavy)
    if not dummies and mass > _MISSING * of_leg:
        return ''
    has = (f'{mass:.3g} kg' if found.platform.mass else
           f'no mass but {mass:.3g} kg of {_COUNTS.get(len(heavy), len(heavy))} links')
    return (f'platform: {has}; legs have {of_leg:.3g} kg each: is the mass of '
            f'{found.platform.name!r} missing?')


def _platform(found: Topology, remarks: list[str], warnings: list[str]) -> dict[str, Any]:
    heavy = [part for part in found.platform_parts if part.mass]
    body = _together(heavy, found.platform.placement)
    if not body.mass:
        raise DescriptionError(f'{found.platform.name}: the platform has no mass; --geometry-only '
                               'reads the geometry without masses')
    if missing := _missing_mass(found, body.mass):
        warnings.append(missing)
    if len(heavy) > 1:
        remarks.append(f'platform: {len(heavy)} bodies that are fixed to each other are one here')
    return {'platform.mass': body.mass, 'platform.center_of_mass': body.center,
            'platform.inertia': body.inertia[np.triu_indices(3)]}


def _gravity(mechanism: Mechanism, found: Topology, remarks: list[str]) -> Array:
    """Return gravity in base axes."""
    gravity = mechanism.gravity
    if gravity is None:
        gravity = np.array(STANDARD_GRAVITY)
        if 'gravity' not in mechanism.carried:
            remarks.append(f'gravity: not in the file: {-STANDARD_GRAVITY[2]} m/s^2 along the '
                           "world's -z")
    turn = found.base.placement.rotation
    return gravity if np.array_equal(turn, np.eye(3)) else np.asarray(turn.T @ gravity)


def _with_side(p: Parameters, directions: list[Array]) -> Parameters:
    """
    Return parameters whose home pose is on the side of the base to which the legs point.

    directions: unit vectors along the legs, from the base, in base axes. Where the loops are open
    in the file, its platform may be anywhere.
    """
    home = home_of(p)
    height = float(home.shape.axes[2] @ np.mean(directions, axis=0))
    if abs(height) < _FLAT or height * home.side > 0.0:
        return p
    return p.replaced({'geometry.platform_side': POSITIVE if height > 0.0 else NEGATIVE})


def _carried(mechanism: Mechanism, found: Topology, values: Mapping[str, Any],
             remarks: list[str]) -> dict[str, Any]:
    """Return the parameters that stewart_describe has added, as far as the elements are its."""
    slides = [chain.steps[chain.slide].joint for chain in found.chains]
    length = float(max(np.max(values[name]) for name in (
        'geometry.base_joints', 'geometry.zero_length')))
    holding: dict[str, Any] = {}
    for name, (text, of_element) in mechanism.carried.items():
        if name not in PARAMETERS:
            continue
        value, there = _value(mechanism, name, text), values.get(name)
        if of_element:
            present = there
            if name in OF_SLIDE:
                of_slides = [getattr(slide, OF_SLIDE[name]) for slide in slides]
                present = None if of_slides.count(None) == LEGS else np.array(of_slides, float)
            size = length if PARAMETERS[name].unit == 'm' else 0.0
            same = _unchanged(present, _value(mechanism, name, of_element), size,
                              mechanism.resolution)
            if not np.all(same):
                remarks.append(f'{name}: edited in the file: its element holds, in place of the '
                               f'parameter {text} that was written with it')
                value = there if value is None or there is None or np.ndim(same) == 0 else (
                    np.where(same, value, there))
        holding[name] = value
    return holding


def _value(mechanism: Mechanism, name: str, text: str) -> Any:
    """Return the value of a parameter that stewart_describe has written as text."""
    if PARAMETERS[name].kind != 'double':
        return text
    if text == NOT_SET:
        return None
    try:
        numbers = [float(each) for each in text.split()]
    except ValueError as exc:
        raise DescriptionError(f'{mechanism.source}: {name}: {text!r}: must be numbers') from exc
    return numbers[0] if len(numbers) == 1 and not PARAMETERS[name].sizes else numbers


def _unchanged(present: Any, written: Any, size: float, resolution: float) -> Any:
    """Return whether the numbers of elements, or which of several, are those written."""
    if written is None or present is None:
        return written is present
    if isinstance(written, str):
        return present == written
    if np.size(present) != np.size(written):
        return False
    return np.abs(present - written) <= resolution * max(size, np.max(np.abs(written)))


def _missing(given: Mapping[str, Any], mechanism: Mechanism, found: Topology,
             legs: list[dict[str, Any]]) -> list[str]:
    """Return one line for each limit that is not in the file, or not of all legs."""
    said = []
    for name, field in OF_SLIDE.items():
        without = [leg['joints'] for leg in legs if leg[name] is None]
        slides = [chain.steps[chain.slide].joint for chain in found.chains]
        if name in given or name in mechanism.carried and len(without) in (0, len(legs)):
            continue
        if len(without) < len(legs):
            said.append(f'{name}: {", ".join(without)} without it in the file: left out of all '
                        'legs: unlimited')
        elif not any(getattr(slide, field) is not None or field in slide.without
                     for slide in slides):
            said.append(f'{name}: not in the file: unlimited')
    if not (mechanism.carried or np.any(given['actuator.reflected_mass'])):
        said.append('actuator.reflected_mass: not in the file: 0 kg')
    return said


def _grouped(names: list[str], of_legs: list[list[str]]) -> list[str]:
    """Return remarks on legs, those that are the same of all legs once."""
    counts = Counter(remark for said in of_legs for remark in dict.fromkeys(said))
    lines = []
    for name, said in zip(names, of_legs, strict=True):
        for remark in dict.fromkeys(said):
            lines.append(f'{"each leg" if counts[remark] == len(names) else name}: {remark}')
    return lines


_LARGEST = 20_000_000  # bytes
# First bytes of files of other kinds, and the advice about them.
_KINDS = (
    (b'version https://git-lfs.github.com/spec/', 'a Git LFS pointer, not the file: run git lfs '
     'pull first'),
    (b'#usda', 'USD (text): its name must end in .usda or .usd'),
    (b'PXR-USDC', 'USD (binary): its name must end in .usdc or .usd'),
    (b'PK\x03\x04', 'a zip archive: unpack it first, or name it .usdz if it is USD'),
    (b'\x1f\x8b', 'compressed with gzip: unpack it first'),
    (b'ISO-10303-21', 'a STEP file: shapes without joints'))
_XACRO = re.compile(r'<xacro:|\$[{(][^})]*[})]')
_TEMPLATE = re.compile(r'<%|\{%|\{\{')


def read_hexapod(path: Path, geometry_only: bool = False) -> Recognized:
    """
    Return the parameters of the hexapod in a file, with remarks on all assumptions.

    geometry_only: as in ``recognized``.
    Raises StewartError if the file cannot be read, or there is no hexapod in it.
    """
    try:
        return recognized(read_mechanism(path), geometry_only)
    except np.linalg.LinAlgError as exc:
        raise DescriptionError(f'{path}: out of range: numbers overflow') from exc


def _check_kind(path: Path, data: bytes) -> None:
    """Raise DescriptionError for a file of another kind."""
    for begin, words in _KINDS:
        if data.startswith(begin):
            raise DescriptionError(f'{path}: is {words}')


def read_mechanism(path: Path) -> Mechanism:
    """Return the mechanism that a file describes."""
    if path.suffix in SUFFIXES:
        return read_usd(path)
    text = read_text(path, _LARGEST, DescriptionError, _check_kind)
    if path.suffix == '.xacro' or _XACRO.search(text) and '<robot' in text:
        raise DescriptionError(f'{path}: is xacro: run xacro first: xacro FILE > FILE.urdf')
    if _TEMPLATE.search(text):
        raise DescriptionError(f'{path}: is a template (ERB or Jinja): render it first')
    if '<!ENTITY' in text:  # which may grow without bound
        raise DescriptionError(f'{path}: has entities of its own: write their text out')
    try:
        root = ET.fromstring(text)
    except (ET.ParseError, ValueError) as exc:
        raise DescriptionError(f'{path}: not XML: {one_line(exc)}') from exc
    if root.tag == 'mujoco':
        return read_mjcf(path)
    readers = {'robot': read_urdf, 'sdf': read_sdf, 'gazebo': read_sdf}
    if root.tag not in readers:
        raise DescriptionError(
            f'{path}: begins with {root.tag!r}: must be URDF (robot), SDFormat (sdf) or MJCF '
            '(mujoco)')
    return readers[root.tag](root, path)
