# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The datasheet of a hexapod: all its figures, pictures and files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.datasheet import (
    claimed_box, pose_ratings as ratings, rated_workspace as workspace)
from stewart_dynamics.datasheet.claimed_box import largest_length, LARGEST_RULE
from stewart_dynamics.datasheet.datasheet_page import Pictures, write_page
from stewart_dynamics.datasheet.datasheet_record import (
    AddedPayload, AtOnce, Box, Datasheet, Directions, RangesAtOnce, RatedPose, Tilt)
from stewart_dynamics.datasheet.motion_ratings import judged, uses
from stewart_dynamics.datasheet.pose_ratings import AXES, rate_extent
from stewart_dynamics.datasheet.rated_hexapod import Payload, RatedHexapod
from stewart_dynamics.datasheet.uncertain_payload import uncertain_payload
from stewart_dynamics.errors import shown, StewartError
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.mechanics.frames.rotation import to_euler
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.records import of_kind
from stewart_dynamics.replay.recorded_motion import read_motion
from stewart_dynamics.replay.replay_options import Options
from stewart_dynamics.reporting.block_statistics import finite
from stewart_dynamics.reporting.results_folder import (
    check_free, DATASHEET, DATASHEET_PAGE, whole_folder, WORKSPACE)
from stewart_dynamics.whole_file import now, write_files, write_json

# Heights of the tilt chart, as parts of the travel along z both ways.
_HEIGHTS = {'at the pose': 0.0, 'half way up': 0.5, 'half way down': -0.5}
# Levels of each axis of the grid on which the worst over the travel is computed.
_LEVELS = 3


class Order(NamedTuple):
    """Options of a datasheet."""

    name: str
    pose: Pose | None = None
    pivot: Array | None = None
    payload: Payload | None = None
    box: Array | None = None
    bag: Path | None = None
    recording: Options = Options()
    leg_stiffness: float | None = None
    stuck: int | None = None  # index of a leg
    uncertainty: int = 0  # hexapods that the file admits, whose payloads are computed as well
    torque_unit: str = 'Nm'  # of the drives' torques on the page, one of TORQUES


class Progress(NamedTuple):
    """Receivers of the progress."""

    stage: Callable[[str], object]  # called with each stage as it begins
    read: Callable[[int], object]  # called with the numbers of bytes of the bag that were read


# Natural frequency below that of any platform on its legs [Hz].
_SLOWEST = 1.0

STAGES = ('motion', 'travel', 'ranges at once', 'loads', 'workspace', 'page')


def write_datasheet(parameters: Parameters, order: Order, folder: Path, options: Options,
                    progress: Progress) -> Datasheet:
    """
    Write a datasheet into a folder; return the content of datasheet.json.

    Raises StewartError: no limit is given, the pose is outside the limits or singular, or the bag
        cannot be read.
    """
    before = check_free(folder, options, DATASHEET)
    hexapod = RatedHexapod(parameters, order.pose, order.pivot, order.payload)
    progress.stage('motion')
    recorded = None if order.bag is None else read_motion(
        order.bag, hexapod.given, order.recording, progress.read)
    progress.stage('travel')
    travel, clearance = ratings.travel(hexapod), hexapod.clearance()
    progress.stage('ranges at once')
    at_once = _at_once(hexapod, travel)
    ranges = None if at_once is None or at_once.all.factor is None else np.array(
        [at_once.all.ranges[axis] for axis in AXES])
    box = None if order.box is None else _checked(hexapod, order.box)
    progress.stage('loads')
    loads = ratings.rate_poses(hexapod, hexapod.pose[None])
    uncertain = uncertain_payload(hexapod, order.uncertainty) if order.uncertainty else None
    worst = None if ranges is None else ratings.worst(hexapod, ranges, _LEVELS)
    stiffness = None if order.leg_stiffness is None else ratings.stiffness(
        hexapod, order.leg_stiffness, ranges, _LEVELS)
    stuck_leg = None if order.stuck is None else ratings.stuck_leg(hexapod, order.stuck)
    drives = ratings.drives(hexapod, ranges, _LEVELS)
    progress.stage('workspace')
    sections = {name: hexapod.section(normal) for name, normal in zip(
        workspace.PLANES, 'yxz', strict=True) if hexapod.has_sections}
    modes = {} if order.leg_stiffness is None else {
        name: workspace.frequencies(hexapod, each, workspace.PLANES[name], order.leg_stiffness)
        for name, each in sections.items()}
    if stiffness and modes:
        stiffness.sections = {name: each.listed() for name, each in modes.items()}
    tilts = {name: workspace.tilt(hexapod, part * (
        (travel.z_plus if part > 0.0 else travel.z_minus).value or 0.0))
        for name, part in _HEIGHTS.items()}
    used = motion = None
    if recorded is not None:
        platform = StewartPlatform(hexapod.given)
        used = uses(platform, recorded)
        motion = judged(platform, recorded, used, str(order.bag))
    sheet = of_kind(Datasheet, hexapod.given.leg_kind)(
        date=now(), name=order.name, pose=RatedPose(
            hexapod.origin.position.tolist(), to_euler(hexapod.origin.rotation).tolist(),
            hexapod.pose.position.tolist(), order.pose is None),
        pivot=hexapod.pivot.tolist(), added_payload=None if order.payload is None else
        AddedPayload(order.payload.mass, np.asarray(order.payload.center_of_mass).tolist()),
        leg_clearance=clearance, travel=travel, at_once=at_once, box=box,
        velocity=loads.velocity or None, acceleration=loads.acceleration or None,
        force=loads.force or None, moment=loads.moment or None, payload=loads.payload or None,
        uncertainty=uncertain, worst=worst, stiffness=stiffness, stuck_leg=stuck_leg,
        drives=drives, tilt=_smallest_tilt(tilts['at the pose'], hexapod), motion=motion,
        parameters=hexapod.given.plain())
    progress.stage('page')
    pictures = Pictures(hexapod, sheet, sections, modes, tilts, ranges,
                        None if recorded is None else recorded.seconds, used)
    with whole_folder(folder, options, DATASHEET, before) as partial:
        write_json(partial / DATASHEET, sheet)
        write_files({partial / WORKSPACE: workspace.table(sections, tilts, hexapod)})
        write_page(partial / DATASHEET_PAGE, sheet, hexapod, pictures, order.torque_unit)
    return sheet


def _at_once(hexapod: RatedHexapod, alone: Directions) -> AtOnce | None:
    """Return the largest ranges of translation, rotation and both that are reachable at once."""
    whole = np.array([[math.nan if each.value is None else each.value
                       for each in alone.both(axis)] for axis in AXES]) * [-1.0, 1.0]
    if np.isnan(whole).any():
        return None
    found = []
    for axes in (slice(0, 3), slice(3, 6), slice(0, 6)):
        ranges = np.zeros((6, 2))
        ranges[axes] = whole[axes]
        if not np.ptp(ranges, axis=1).any():
            return None
        scaled = hexapod.reachable_factor(ranges)
        rated = rate_extent(scaled.value, scaled.limit, scaled.leg, hexapod.joints)
        found.append(RangesAtOnce(rated.limit, rated.leg, rated.value, claimed_box.in_words(
            np.multiply(scaled.value, ranges, out=np.zeros((6, 2)), where=ranges != 0.0))))
    return AtOnce(*found)


def _checked(hexapod: RatedHexapod, ranges: Array) -> Box:
    """Return whether a claimed box is reachable, and its worst pose."""
    found = hexapod.reachable(ranges)
    worst = found.worst
    factor = None
    if (ranges[:, 0] <= 0.0).all() and (ranges[:, 1] >= 0.0).all():
        factor = finite(hexapod.reachable_factor(ranges).value)
    moved = hexapod.displacement(Pose(
        worst.pose.position + worst.pose.rotation @ hexapod.pivot, worst.pose.rotation))
    return Box(
        worst.limit, hexapod.joints[worst.leg] if worst.leg >= 0 else None, found.certain, factor,
        claimed_box.in_words(ranges), finite(worst.excess),
        dict(zip(AXES, moved.tolist(), strict=True)), worst.pose.position.tolist(),
        to_euler(worst.pose.rotation).tolist())


def _smallest_tilt(boundary: workspace.Boundary, hexapod: RatedHexapod) -> Tilt:
    """Return the smallest tilt toward any azimuth [rad]."""
    n = int(np.argmin(boundary.values))
    found = rate_extent(boundary.values[n], boundary.limits[n], boundary.legs[n], hexapod.joints)
    return Tilt(found.limit, found.leg, found.value, 2.0 * math.pi * n / len(boundary.values))


def check_order(order: Order, parameters: Parameters) -> None:
    """Raise StewartError for values that no datasheet can be made for."""
    most = largest_length(parameters)
    for name, point in (('pivot', order.pivot),
                        ('payload', order.payload and order.payload.center_of_mass)):
        if point is not None and np.abs(point).max() > most:
            raise StewartError(f'--{name}: {np.abs(point).max():g} m from the platform frame: '
                               f'must be within {most:.4g}, {LARGEST_RULE}')
    if order.payload is not None and not order.payload.mass > 0.0:
        raise StewartError(f'--payload: mass {order.payload.mass:g} kg: must be above 0')
    if order.leg_stiffness is not None and not order.leg_stiffness > 0.0:
        raise StewartError(f'--leg-stiffness: {order.leg_stiffness:g} '
                           f'{parameters.leg_kind.stiffness_unit}: must be above 0')


def leg_of(name: str, parameters: Parameters) -> int:
    """Return the index of a leg by its name."""
    joints: tuple[str, ...] = parameters.joints
    if name not in joints:
        raise StewartError(f'--stuck: {shown(name)}: must be one of {", ".join(joints)}')
    return joints.index(name)


def soft_legs(parameters: Parameters, stiffness: float | None) -> Iterator[str]:
    """Yield a possible error in the stiffness of the legs [N/m]: its unit."""
    mass = parameters.carried.mass
    circles = parameters.leg_kind.anchor_circles(parameters)
    if circles is not None:
        if stiffness is not None and 6.0 * stiffness / float(circles.radii.min()) ** 2 < mass * (
                2.0 * math.pi * _SLOWEST) ** 2:
            yield (f'--leg-stiffness: {stiffness:g} {parameters.leg_kind.stiffness_unit}: six '
                   f'such drives and {mass:.3g} kg have a natural frequency below {_SLOWEST:g} '
                   'Hz: in N m/deg, or in N m/mrad?')
    elif stiffness is not None and 6.0 * stiffness < mass * (2.0 * math.pi * _SLOWEST) ** 2:
        yield (f'--leg-stiffness: {stiffness:g} N/m: six such legs and {mass:.3g} kg have a '
               f'natural frequency below {_SLOWEST:g} Hz: in N/um, or in N/mm?')
