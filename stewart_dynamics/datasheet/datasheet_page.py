# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The page of a datasheet: figures, tables, and pictures as vectors; needs no script."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.bags.find import RESULT
from stewart_dynamics.capability.workspace import Section
from stewart_dynamics.datasheet import charts
from stewart_dynamics.datasheet.datasheet_record import Datasheet, Rating
from stewart_dynamics.datasheet.datasheet_text import (
    between_setpoints, both_ways, box_verdict, DEGREE, down, limit_name, LINEAR, MM,
    motion_verdict, numbers, OF_DRIVES, payloads_in_words, pose_row, possible, rated_payload,
    setpoints_used, span, stuck_row, TORQUES, uncertain_line, Unit, unit_of)
from stewart_dynamics.datasheet.hexapod_drawing import circle_of, Drawing
from stewart_dynamics.datasheet.pose_ratings import AXES, grid, Payloads, poses_of
from stewart_dynamics.datasheet.rated_hexapod import RatedHexapod
from stewart_dynamics.datasheet.rated_workspace import (
    Boundary, Frequencies, PLANES, rotations_over_height)
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.mechanics.limits import LIMITS
from stewart_dynamics.parameters.table import inertia_matrix, PARAMETERS
from stewart_dynamics.reporting.pages import digits, link_to_other, number, page
from stewart_dynamics.reporting.results_folder import REPLAYS, REPORT_PAGE
from stewart_dynamics.reporting.vector_picture import Picture
from stewart_dynamics.whole_file import write_files

_FOLDER = Path(__file__).with_name('templates')
_NAMES = dict(zip(AXES, ('X', 'Y', 'Z', 'θX', 'θY', 'θZ'), strict=True))


class Pictures(NamedTuple):
    """Content of the pictures."""

    hexapod: RatedHexapod
    sheet: Datasheet
    sections: Mapping[str, Section]
    modes: Mapping[str, Frequencies]
    tilts: Mapping[str, Boundary]
    ranges: Array | None  # ranges (6, 2) that are reachable at once
    seconds: Array | None  # times of the motion's samples [s]
    used: Mapping[str, Array] | None  # use of the limits at these times

    def drawing(self) -> Drawing:
        """Return the drawing of the hexapod, with the ends of its travel along z."""
        origin = self.hexapod.origin
        ends = [Pose(origin.position + [0.0, 0.0, sign * by], origin.rotation)
                for each, sign in ((self.sheet.travel.z_plus, 1.0),
                                   (self.sheet.travel.z_minus, -1.0)) if (by := each.value)]
        return Drawing(self.hexapod.given, origin, tuple(ends), self.hexapod.pivot)

    def workspace(self) -> list[Picture]:
        """Return sections, tilt, rotation over height, and payload where it is limited."""
        found = [charts.section_chart(each, self.hexapod.origin.position, PLANES[name],
                                      self.ranges) for name, each in self.sections.items()]
        found += [charts.frequency_chart(
            self.sections[name], each, self.hexapod.origin.position, PLANES[name])
            for name, each in self.modes.items() if np.isfinite(each.values).any()]
        found.append(charts.tilt_chart(list(self.tilts.values()), list(self.tilts)))
        low, high = (each.value for each in self.sheet.travel.both('z'))
        if low and high:
            heights, turns = rotations_over_height(self.hexapod, -low, high)
            found.append(charts.curves_chart(
                'Rotation over height', MM.factor * heights,
                {f'±{name}': DEGREE.factor * each for name, each in turns.items()}, 'Z [mm]',
                'rotation [°]'))
        if self.sheet.payload is not None and self.hexapod.given['gravity'].any():
            found.append(self._payload())
        return found

    def limits(self) -> list[str]:
        """Return the limits that are boundaries in the pictures."""
        found = {part.limit for each in self.sections.values() for part in each.boundary}
        found.update(next(iter(self.tilts.values())).limits)
        return [name for name in charts.DASHES if name in found]

    def _payload(self) -> Picture:
        """Return the largest payload over the distance of its center of mass from the pivot."""
        loads = self.hexapod.loads
        radius = float(np.linalg.norm(
            loads.platform.parameters.geometry.platform_joints, axis=1).mean())
        offsets = np.linspace(0.0, 1.5 * radius, 31, dtype=float)
        here = Payloads(loads, self.hexapod.pose[None])
        curves = {'at the pose': np.array([here.level(each) for each in offsets])}
        if self.ranges is not None:
            corners = Payloads(loads, poses_of(self.hexapod, grid(self.ranges, 2)))
            curves['worst'] = np.array([corners.level(each) for each in offsets])
        curves['any orientation'] = np.array([here.any_orientation(each) for each in offsets])
        if loads.limits_held:
            held = Payloads(loads, self.hexapod.pose[None], continuous=True)
            curves['continuous'] = np.array([held.level(each) for each in offsets])
        return charts.curves_chart(
            'Payload over the distance of its center of mass', MM.factor * offsets, curves,
            'center of mass from the pivot, sideways [mm]', 'payload [kg]')

    def motion(self) -> Picture | None:
        """Return the use of the limits over time."""
        if self.seconds is None or self.used is None:
            return None
        return charts.use_chart(self.seconds, self.used,
                                self.hexapod.given['setpoint.timeout'])


def write_page(path: Path, sheet: Datasheet, hexapod: RatedHexapod, pictures: Pictures,
               torque_unit: str) -> None:
    """Write datasheet.html, with the content of datasheet.json; torque_unit: one of TORQUES."""
    drawing, kind, motion = pictures.drawing(), hexapod.given.leg_kind, sheet.motion
    bag = Path(motion.bag) if motion else Path()
    name = (bag if bag.is_dir() else bag.with_suffix('')).name
    text = page(
        _FOLDER, 'datasheet', document=True, s=sheet, key_figures=_key_figures(sheet),
        summary=_summary(hexapod), legs=hexapod.joints, ends=partial(_ends, hexapod.joints),
        drive_heads=_drive_heads(sheet, hexapod, torque_unit),
        joints=_joints(sheet, hexapod, torque_unit),
        properties=_properties(sheet, hexapod, torque_unit), drive_unit=_drive_unit(hexapod),
        position=kind.position.name, kind=kind,
        rate_phrase=LIMITS[kind.rate_limit].phrase, effort_phrase=LIMITS[kind.effort_limit].phrase,
        verdicts=[*([('Motion', motion, motion_verdict(motion))] if motion else []),
                  *([('Box', sheet.box, box_verdict(sheet.box))] if sheet.box else [])],
        report=link_to_other(path, [
            Path(name, REPORT_PAGE), Path(REPLAYS, name, REPORT_PAGE)], RESULT,
            sheet.parameters) if name else None,
        oblique=drawing.oblique().svg(), front=drawing.front().svg(), top=drawing.top().svg(),
        workspace=[each.svg() for each in pictures.workspace()],
        motion=(chart.svg() if (chart := pictures.motion()) else None),
        between_setpoints=between_setpoints(motion) if motion else '',
        dashes={name: charts.DASHES[name] for name in pictures.limits()},
        payloads=payloads_in_words(sheet),
        uncertain=uncertain_line(sheet.uncertainty) if sheet.uncertainty else '',
        stuck=list(map(stuck_row, sheet.stuck_leg.motions)) if sheet.stuck_leg else None,
        limit_name=limit_name, possible=possible, setpoints_used=setpoints_used, down=down,
        span=span, both_ways=both_ways, unit_of=unit_of, MM=MM, DEGREE=DEGREE, names=_NAMES)
    write_files({path: text})


def _summary(hexapod: RatedHexapod) -> str:
    p = hexapod.given
    parts = [f'{p.carried.mass:.4g} kg on six legs']
    if p.limits.length_min is not None and p.limits.length_max is not None:
        low, high = p.limits.length_min.min(), p.limits.length_max.max()
        parts.append(f'{1e3 * low:.5g} to {1e3 * high:.5g} mm long')
    for name, key in (('base', 'geometry.base_joints'), ('platform', 'geometry.platform_joints')):
        diameter = circle_of(p[key])
        if diameter is not None:
            parts.append(f'{name} joints on ⌀ {1e3 * diameter:.4g} mm')
    return ' · '.join(parts)


def _key_figures(sheet: Datasheet) -> list[tuple[str, str, str]]:
    """Return name, value and unit of the first figures to be looked for."""
    found = [(f'Travel {_NAMES[axis]}', both_ways(sheet.travel, axis, MM), MM.name)
             for axis in ('x', 'y', 'z')]
    tilt = sheet.tilt.value
    found.append(('Tilt, every direction', '–' if tilt is None else
                  f'±{down(DEGREE.factor * tilt)}', '°'))
    found.append(('Rotation θZ', both_ways(sheet.travel, 'rz', DEGREE), '°'))
    for kind, payload in sheet.payloads:
        any_orientation, value = rated_payload(payload, sheet.parameters)
        found.append((f'Payload{kind and f", {kind}"}{any_orientation}', down(value), 'kg'))
    if sheet.force is not None:
        found.append(('Force, every direction', down(sheet.force.every_direction), 'N'))
    if sheet.drives and sheet.drives.worst_lever:
        found.append(('Lever, smallest', down(100.0 * sheet.drives.worst_lever.value), '%'))
    if sheet.velocity is not None:
        found.append(('Velocity Z', both_ways(sheet.velocity, 'z', LINEAR['velocity']), 'mm/s'))
    return found


class _End(NamedTuple):
    """Sign of a direction (empty: both), and the limit and leg that end its extent."""

    sign: str
    limit: str
    leg: int


def _ends(joints: Sequence[str], minus: Rating, plus: Rating) -> list[_End]:
    """Return what ends the extents of an axis, once if it is the same both ways."""
    found = [_End(sign, each.limit, joints.index(each.leg) if each.leg else -1)
             for each, sign in ((minus, '−'), (plus, '+')) if each.limit]
    if len(found) == 2 and found[0][1:] == found[1][1:]:
        return [found[0]._replace(sign='')]
    return found


def _drive_unit(hexapod: RatedHexapod) -> Unit:
    """Return the unit of the stiffness of a drive."""
    return OF_DRIVES[hexapod.given.leg_kind.stiffness_unit]


def _position_unit(hexapod: RatedHexapod) -> Unit:
    return {'m': MM, 'rad': DEGREE}[hexapod.given.leg_kind.position.unit]


def _drive_heads(sheet: Datasheet, hexapod: RatedHexapod, torque_unit: str) -> list[str]:
    """Return the heads of the columns of the drives."""
    kind, unit = hexapod.given.leg_kind, _position_unit(hexapod).name
    heads = [f'{kind.position.name} [{unit}]', f'range [{unit}]']
    if sheet.drives:
        heads += ['lever [%]', f'{kind.effort.name} at rest [{TORQUES[torque_unit].name}]']
    return heads


def _joints(sheet: Datasheet, hexapod: RatedHexapod, torque_unit: str,
            ) -> list[tuple[str, Array, Array, list[str]]]:
    """Return name, joints in mm, and drive with its range, for each leg."""
    p, unit, rows = hexapod.given, _position_unit(hexapod), []
    positions = hexapod.platform.inverse_kinematics(hexapod.pose)
    for n, name in enumerate(hexapod.joints):
        shown = round(unit.factor * float(positions[n]), 1) + 0.0  # no -0
        cells = [number(shown, 1), ' to '.join(
            '–' if p[limit] is None else f'{unit.factor * p[limit][n]:.6g}'.replace('-', '−')
            for limit in p.leg_kind.position_limits)]
        if sheet.drives:
            cells += [number(100.0 * sheet.drives.lever_ratios[n], 1),
                      digits(TORQUES[torque_unit].factor * sheet.drives.efforts[n])]
        rows.append((name, 1e3 * p.geometry.base_joints[n], 1e3 * p.geometry.platform_joints[n],
                     cells))
    return rows


def _in_unit(value: Any, unit: str, torque_unit: str) -> str:
    """Return numbers of a parameter with their unit, angles in degrees."""
    if unit == 'rad':
        return numbers(value, DEGREE.factor, DEGREE.name)
    if unit == 'N m':
        unit = TORQUES[torque_unit].name
        return numbers(value, TORQUES[torque_unit].factor, f' {unit}')
    return numbers(value, 1.0, f' {unit}'.rstrip())


def _properties(sheet: Datasheet, hexapod: RatedHexapod, torque_unit: str,
                ) -> list[tuple[str, str]]:
    """Return names and values of the other parameters that the figures rest on."""
    p = hexapod.given
    kind = p.leg_kind
    reflected = kind.fields['reflected_mass']
    inertia = inertia_matrix(p.carried.inertia)

    rows = [
        pose_row(sheet.pose),
        ('Pivot, platform frame', numbers(sheet.pivot, 1e3, ' mm')),
        *([('Pivot at the rated pose', numbers(sheet.pose.pivot_position, 1e3, ' mm'))]
          if any(sheet.pivot) else []),
        ('Platform' + (' with payload' if p.payload.mass > 0.0 else ''),
         f'{p.carried.mass:.5g} kg at {numbers(p.carried.center, 1e3, " mm")}'),
        ('Its inertia, xx yy zz', numbers(np.diagonal(inertia), 1.0, ' kg m²')),
        (f'Leg: {", ".join(kind.bodies)}',
         f'{", ".join(numbers(p[name]) for name in kind.bodies.values())} kg'),
        (f'{reflected.rpartition(".")[2].replace("_", " ").capitalize()} of an actuator',
         numbers(p[reflected], 1.0, f' {kind.inertia_unit.replace("^2", "²")}')),
        ('Gravity', numbers(p.gravity, 1.0, ' m/s²'))]
    for name, value in p.items():
        if name.startswith('limits.') and name != 'limits.action' and value is not None and (
                name not in kind.position_limits):
            rows.append((name, _in_unit(value, PARAMETERS[name].unit, torque_unit)))
    if p.drives:
        for name, value in p.items():
            if value is not None and (name.startswith('drive.') or name == 'actuator.screw_lead'):
                unit = PARAMETERS[name].unit.replace('^2', '²')
                rows.append((name, _in_unit(value, unit, torque_unit)
                             if isinstance(value, np.ndarray) else str(value)))
    if sheet.leg_clearance is not None:
        rows.append(('Clearance between legs at the pose',
                     numbers(sheet.leg_clearance, 1e3, ' mm')))
    rows.append(('singularity.stop_condition', f'{p.singularity.stop_condition:g}'))
    return rows
