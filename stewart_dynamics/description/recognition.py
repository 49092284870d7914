# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The parameters of the hexapod in a mechanism of any format, with one remark for each assumption.

A leg is made of two bodies: all bodies on one side of the joint between its parts become one. How
a leg follows from its chain of joints is a method of its kind.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.description.carried import NOT_SET
from stewart_dynamics.description.topology import LEGS, Topology, topology_of
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.legs.leg_reading import passive
from stewart_dynamics.legs.mechanism import (
    Chain, DescriptionError, joined, Mechanism, MechanismBody, Placement)
from stewart_dynamics.mechanics.frames.rotation import to_quaternion
from stewart_dynamics.mechanics.hexapod_structure import hexapod_structure
from stewart_dynamics.mechanics.kinematics.home_pose import home_of, level_axes
from stewart_dynamics.parameters.table import (
    mean_radius, NEGATIVE, NO_MASS, PARAMETERS, Parameters, POSITIVE, STANDARD_GRAVITY)

# A platform with less of the mass of a leg has dummies of joints alone.
_MISSING = 0.02
_COUNTS = dict(enumerate(('no', 'one', 'two', 'three', 'four', 'five', 'six')))
# Legs whose mean direction has a smaller part along the normal of the base joints' plane point to
# neither side of it.
_FLAT = 0.05
# Cosine of the angle by which level planes and frames may be inclined.
_LEVEL = math.cos(0.1)
# Bodies of a smaller part of the platform's mass are only frames.
_NEGLIGIBLE = 1e-7


class Recognized(NamedTuple):
    """The hexapod of a file."""

    parameters: Parameters
    remarks: tuple[str, ...]  # assumptions and missing values, one line each
    warnings: tuple[str, ...] = ()  # what makes forces wrong at rest, too, one line each


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
    if not mechanism.carried:
        found = _leveled(found, remarks)
    legs, of_legs = [], []
    for chain in found.chains:
        said: list[str] = []
        legs.append(found.kind.read_leg(chain, found.base, found.platform, said))
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
            values[key] = _of_all([leg[key] for leg in legs])
    if not geometry_only:
        values |= _platform(found, remarks, warnings)
    values['gravity'] = _gravity(mechanism, found, remarks)
    values |= _carried(mechanism, found, values, remarks)
    if geometry_only:
        values, warnings = _without_masses(values, found.kind), []
    given = {name: value for name, value in values.items() if value is not None}
    remarks += _missing(given, mechanism, found, legs)
    found.kind.tidy(given, mechanism.resolution)
    parameters = _with_side(Parameters(given, mechanism.source), [
        leg['direction'] for leg in legs])
    if not found.kind.likely.keys() & mechanism.carried.keys():
        parameters = _without_assembly(parameters, found.kind)
    return Recognized(parameters, tuple(dict.fromkeys(remarks)), tuple(dict.fromkeys(warnings)))


def _leveled(found: Topology, remarks: list[str]) -> Topology:
    """
    Return a hexapod whose platform frame is level where the platform is.

    Frames from CAD are at any part of the platform, and turned. Home has parallel axes.
    """
    base = found.base.placement
    below, above = (np.array([getattr(chain.steps[at], side) for chain in found.chains])
                    for at, side in ((0, 'near'), (-1, 'far')))
    normals = [level_axes(each - each.mean(axis=0))[2] for each in (below, above)]
    turned = found.platform.placement.rotation @ (base.rotation.T @ normals[0])
    if abs(normals[0] @ normals[1]) < _LEVEL or turned @ normals[0] > _LEVEL:
        return found
    level = Placement(base.rotation, above.mean(axis=0))
    given = found.platform.placement
    name = f'{found.platform.name}_level'
    at, turn = (' '.join(f'{round(float(each), 9) + 0.0:.9g}' for each in numbers) for numbers in (
        given.inside(level.position), to_quaternion(given.rotation.T @ level.rotation)))
    remarks.append(
        f'platform_frame: {found.platform.name!r} is inclined to {found.base.name!r} while the '
        f'platform is level: {name!r} has its place, parallel to {found.base.name!r} in the file: '
        f'in {found.platform.name!r} at {at} m, quaternion x y z w {turn}')
    return found._replace(platform=replace(
        found.platform, name=name, placement=level,
        center=level.inside(given.point(found.platform.center)),
        inertia=level.rotation.T @ given.rotation @ found.platform.inertia
        @ given.rotation.T @ level.rotation))


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
            yield f'{spring},{chain.where(n)} is left out'


def _add_of_platform_joints(mechanism: Mechanism, found: Topology, remarks: list[str],
                            warnings: list[str]) -> None:
    """Add remarks about forces on joints of the platform outside the legs, as a free joint."""
    of_legs = {step.joint.name for chain in found.chains for step in chain.steps}
    platform = {part.name for part in found.platform_parts}
    for joint in mechanism.joints:
        if joint.name not in of_legs and platform & {joint.parent, joint.child}:
            warnings += [f'{joint.name}: {spring}, is left out' for spring in joint.springs]
            remarks += [f'{joint.name}: {what} is left out'
                        for what in (*joint.left_out, *passive(joint))]


def _of_all(values: list[Any]) -> Any:
    """Return the values of six legs as one, None if one of them is missing."""
    if any(value is None for value in values):
        return None
    return values if isinstance(values[0], str) else np.array(values).ravel()


def _without_masses(values: dict[str, Any], kind: LegKind) -> dict[str, Any]:
    """Return the geometry and the limits, with a platform whose mass stands for none."""
    lengths = [name for name in kind.elements if name.endswith('.length')]
    kept = {name: value for name, value in values.items() if name in lengths
            or not name.startswith(('legs.', 'actuator.', 'drive.', 'platform.'))}
    radius = mean_radius(np.reshape(values['geometry.platform_joints'], (6, 3)))
    mass = NO_MASS * radius ** 3
    moment = 0.25 * mass * radius ** 2
    return kept | {kind.fields['reflected_mass']: 0.0, 'platform.mass': mass, 'platform.inertia': [
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
    body = joined(heavy, found.platform.placement)
    if not body.mass or not body.inertia.any():
        lacking = (f'{found.platform.name}: the platform has no '
                   f'{"inertia" if body.mass else "mass"}')
        why = next((part.note for part in heavy if part.note), lacking)
        raise DescriptionError(f'{why}; --geometry-only reads the geometry without masses')
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


def _without_assembly(p: Parameters, kind: LegKind) -> Parameters:
    """Return parameters without those of the assembly of legs if it follows from the others."""
    try:
        found = p.replaced(kind.likely)
        structures = [hexapod_structure(each)['legs'].tobytes() for each in (p, found)]
    except ParameterError:
        return p
    return found if kind.likely and structures[0] == structures[1] else p


def _carried(mechanism: Mechanism, found: Topology, values: Mapping[str, Any],
             remarks: list[str]) -> dict[str, Any]:
    """Return the parameters that stewart_describe has added, as far as the elements are its."""
    slides, of_drive = [chain.driven.joint for chain in found.chains], found.kind.drive_limits
    length = float(max(np.max(values[name]) for name in (
        'geometry.base_joints', found.kind.zero or 'geometry.platform_joints')))
    holding: dict[str, Any] = {}
    for name, (text, of_element) in mechanism.carried.items():
        if name not in PARAMETERS:
            continue
        value, there = _value(mechanism, name, text), values.get(name)
        if of_element:
            present = there
            if name in of_drive:
                of_slides = [getattr(slide, of_drive[name]) for slide in slides]
                present = None if of_slides.count(None) == LEGS else np.array(of_slides, float)
            size = {'m': length, 'rad': 1.0}.get(PARAMETERS[name].unit, 0.0)
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
        return text.split() if PARAMETERS[name].sizes else text
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
    for name, field in found.kind.drive_limits.items():
        without = [leg['joints'] for leg in legs if leg[name] is None]
        slides = [chain.driven.joint for chain in found.chains]
        if name in given or name in mechanism.carried and len(without) in (0, len(legs)):
            continue
        if len(without) < len(legs):
            said.append(f'{name}: {", ".join(without)} without it in the file: left out of all '
                        'legs: unlimited')
        elif not any(getattr(slide, field) is not None or field in slide.without
                     for slide in slides):
            said.append(f'{name}: not in the file: unlimited')
    reflected = found.kind.fields['reflected_mass']
    if not (mechanism.carried or np.any(given[reflected])):
        said.append(f'{reflected}: not in the file: 0 {found.kind.inertia_unit}')
    return said


def _grouped(names: list[str], of_legs: list[list[str]]) -> list[str]:
    """Return remarks on legs, those that are the same of all legs once."""
    counts = Counter(remark for said in of_legs for remark in dict.fromkeys(said))
    lines = []
    for name, said in zip(names, of_legs, strict=True):
        for remark in dict.fromkeys(said):
            lines.append(f'{"each leg" if counts[remark] == len(names) else name}: {remark}')
    return lines
