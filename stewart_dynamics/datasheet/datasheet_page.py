# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The page of a datasheet: figures, tables, and pictures as vectors; needs no script."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.bags.find import RESULT
from stewart_dynamics.capability.workspace import Section
from stewart_dynamics.datasheet import charts
from stewart_dynamics.datasheet.datasheet_text import (
    between_setpoints, both_payloads, both_ways, box_verdict, DEGREE, down, limit_name, LINEAR, MM,
    motion_verdict, numbers, OF_DRIVES, payloads_in_words, pose_row, possible, rated_payload,
    setpoints_used, span, stuck_rows, TORQUES, uncertain_line, Unit, unit_of)
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
    sheet: Mapping[str, Any]
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
                for key, sign in (('z+', 1.0), ('z-', -1.0))
                if (by := self.sheet['travel'][key]['value'])]
        return Drawing(self.hexapod.given, origin, tuple(ends), self.hexapod.pivot)

    def workspace(self) -> list[Picture]:
        """Return sections, tilt, rotation over height, and payload where it is limited."""
        found = [charts.section_chart(each, self.hexapod.origin.position, PLANES[name],
                                      self.ranges) for name, each in self.sections.items()]
        found += [charts.frequency_chart(
            self.sections[name], each, self.hexapod.origin.position, PLANES[name])
            for name, each in self.modes.items() if np.isfinite(each.values).any()]
        found.append(charts.tilt_chart(list(self.tilts.values()), list(self.tilts)))
        low, high = (self.sheet['travel'][key]['value'] for key in ('z-', 'z+'))
        if low and high:
            heights, turns = rotations_over_height(self.hexapod, -low, high)
            found.append(charts.curves_chart(
                'Rotation over height', MM.factor * heights,
                {f'±{name}': DEGREE.factor * each for name, each in turns.items()}, 'Z [mm]',
                'rotation [°]'))
        payload = self.sheet['payload']
        if payload is not None and self.hexapod.given['gravity'].any():
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


def write_page(path: Path, sheet: Mapping[str, Any], hexapod: RatedHexapod, pictures: Pictures,
               torque_unit: str) -> None:
    """Write datasheet.html, with the content of datasheet.json; torque_unit: one of TORQUES."""
    drawing, kind = pictures.drawing(), hexapod.given.leg_kind
    bag = Path(sheet['motion']['bag']) if sheet['motion'] else Path()
    name = (bag if bag.is_dir() else bag.with_suffix('')).name
    text = page(
        _FOLDER, 'datasheet', document=True, s=sheet, key_figures=_key_figures(sheet, hexapod),
        summary=_summary(hexapod), legs=hexapod.joints, travel=_travel(sheet, hexapod),
        rates=_rates(sheet, hexapod), loads=_loads(sheet, hexapod), stiffness=_stiffness(sheet),
        drive_heads=_drive_heads(sheet, hexapod, torque_unit),
        joints=_joints(sheet, hexapod, torque_unit),
        properties=_properties(sheet, hexapod, torque_unit), drive_unit=_drive_unit(hexapod),
        position=kind.position.name, kind=kind,
        rate_phrase=LIMITS[kind.rate_limit].phrase, effort_phrase=LIMITS[kind.effort_limit].phrase,
        verdicts=[(name.capitalize(), found, words(found)) for name, words in (
            ('motion', motion_verdict), ('box', box_verdict)) if (found := sheet[name])],
        report=link_to_other(path, [
            Path(name, REPORT_PAGE), Path(REPLAYS, name, REPORT_PAGE)], RESULT,
            sheet['parameters']) if name else None,
        oblique=drawing.oblique().svg(), front=drawing.front().svg(), top=drawing.top().svg(),
        workspace=[each.svg() for each in pictures.workspace()],
        motion=(chart.svg() if (chart := pictures.motion()) else None),
        between_setpoints=between_setpoints(sheet['motion']) if sheet['motion'] else '',
        dashes={name: charts.DASHES[name] for name in pictures.limits()},
        payloads=payloads_in_words(sheet),
        uncertain=uncertain_line(sheet['uncertainty']) if sheet['uncertainty'] else '',
        stuck=stuck_rows(sheet['stuck_leg']) if sheet['stuck_leg'] else None,
        limit_name=limit_name, possible=possible, setpoints_used=setpoints_used, down=down,
        span=span, MM=MM, DEGREE=DEGREE, names=_NAMES)
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


def _key_figures(sheet: Mapping[str, Any], hexapod: RatedHexapod) -> list[tuple[str, str, str]]:
    """Return name, value and unit of the first figures to be looked for."""
    travel = sheet['travel']
    found = [(f'Travel {_NAMES[axis]}', both_ways(travel, axis, unit_of(axis, 'travel')),
              unit_of(axis, 'travel').name) for axis in ('x', 'y', 'z')]
    found.append(('Tilt, every direction', f'±{down(DEGREE.factor * sheet["tilt"]["value"])}'
                  if sheet['tilt']['value'] is not None else '–', '°'))
    found.append(('Rotation θZ', both_ways(travel, 'rz', DEGREE), '°'))
    if sheet['payload'] is not None:
        for kind, payload in both_payloads(sheet):
            any_orientation, value = rated_payload(sheet, payload)
            found.append((f'Payload{kind and f", {kind}"}{any_orientation}', down(value), 'kg'))
        found.append(('Force, every direction', down(sheet['force']['every_direction']), 'N'))
    if 'drives' in sheet and sheet['drives']['worst_lever']:
        found.append(('Lever, smallest', down(100.0 * sheet['drives']['worst_lever']['value']),
                      '%'))
    if sheet['velocity'] is not None:
        found.append(('Velocity Z', both_ways(sheet['velocity'], 'z', LINEAR['velocity']), 'mm/s'))
    return found


class _Limit(NamedTuple):
    """Sign of a direction (empty: both), and the limit and leg that end its extent."""

    sign: str
    limit: str
    leg: int


def _limits(values: Mapping[str, Any], axis: str, joints: tuple[str, ...]) -> list[_Limit]:
    """Return what ends the extents of an axis, once if it is the same both ways."""
    found = [_Limit(sign, each['limit'], joints.index(each['leg']) if each['leg'] else -1)
             for key, sign in (('-', '−'), ('+', '+'))
             if (each := values[f'{axis}{key}'])['limit']]
    if len(found) == 2 and found[0][1:] == found[1][1:]:
        return [found[0]._replace(sign='')]
    return found


def _travel(sheet: Mapping[str, Any], hexapod: RatedHexapod) -> list[dict[str, Any]]:
    rows, at_once = [], sheet['at_once']
    for axis in AXES:
        unit = unit_of(axis, 'travel')
        kind = 'rotation' if axis.startswith('r') else 'translation'
        rows.append({
            'axis': _NAMES[axis], 'unit': unit.name,
            'alone': both_ways(sheet['travel'], axis, unit),
            'limits': _limits(sheet['travel'], axis, hexapod.joints),
            'three': at_once and span(at_once[kind]['ranges'][axis], unit),
            'all': at_once and span(at_once['all']['ranges'][axis], unit)})
    return rows


def _rates(sheet: Mapping[str, Any], hexapod: RatedHexapod) -> list[dict[str, Any]]:
    rows = []
    for axis in AXES:
        row: dict[str, Any] = {'axis': _NAMES[axis]}
        for name in ('velocity', 'acceleration'):
            if sheet[name] is None:
                continue
            unit = unit_of(axis, name)
            row[name] = {
                'unit': unit.name, 'value': both_ways(sheet[name], axis, unit),
                'limits': _limits(sheet[name], axis, hexapod.joints),
                'worst': both_ways(sheet['worst'][name], axis, unit) if sheet['worst'] else '–'}
        rows.append(row)
    return rows


def _loads(sheet: Mapping[str, Any], hexapod: RatedHexapod) -> list[dict[str, Any]]:
    if sheet['force'] is None:
        return []
    rows, worst = [], sheet['worst']

    def row(name: str, unit: str, kind: str, text: Callable[[Any], str], axis: str = '',
            of_axis: bool = True) -> dict[str, Any]:
        held = sheet[kind].get('continuous')
        ends = (sheet[kind] if axis else {'x-': sheet[kind], 'x+': sheet[kind]}) if of_axis else {}
        return {'name': name, 'unit': unit, 'value': text(sheet[kind]), 'sum': not axis,
                'limits': _limits(ends, axis or 'x', hexapod.joints) if ends else [],
                'continuous': text(held) if held else None,
                'worst': text(worst[kind]) if worst else '–'}

    for axis in AXES:
        name = 'moment' if axis.startswith('r') else 'force'
        unit = unit_of(axis, name)
        rows.append(row(f'{name.capitalize()} {_NAMES[axis].replace("θ", "")}', unit.name, name,
                        partial(both_ways, axis=axis, unit=unit), axis))
        if axis in ('z', 'rz'):
            rows.append(row(f'{name.capitalize()}, every direction', unit.name, name,
                            lambda found: down(found['every_direction']), of_axis=False))
    return [*rows,
            row('Payload at the pivot', 'kg', 'payload', lambda found: down(found['value'])),
            row('Payload, base in any orientation', 'kg', 'payload',
                lambda found: down(found['any_orientation']), of_axis=False)]


def _stiffness(sheet: Mapping[str, Any]) -> list[dict[str, Any]]:
    found = sheet['stiffness']
    if found is None:
        return []
    rows = []
    for axis in AXES:
        unit = unit_of(axis, 'stiffness')
        rows.append({'name': f'Stiffness {_NAMES[axis]}', 'unit': unit.name,
                     'value': down(found[axis] * unit.factor),
                     'worst': down(found['worst'][axis] * unit.factor) if found['worst'] else '–'})
    worst = found['worst']
    for n, frequency in enumerate(found['frequencies'][:2]):
        rows.append({'name': f'{("Lowest", "Second")[n]} natural frequency', 'unit': 'Hz',
                     'value': down(frequency),
                     'worst': down(worst['frequencies'][n]) if worst else '–'})
    return rows


def _drive_unit(hexapod: RatedHexapod) -> Unit:
    """Return the unit of the stiffness of a drive."""
    return OF_DRIVES[hexapod.given.leg_kind.stiffness_unit]


def _position_unit(hexapod: RatedHexapod) -> Unit:
    return {'m': MM, 'rad': DEGREE}[hexapod.given.leg_kind.position.unit]


def _drive_heads(sheet: Mapping[str, Any], hexapod: RatedHexapod, torque_unit: str) -> list[str]:
    """Return the heads of the columns of the drives."""
    kind, unit = hexapod.given.leg_kind, _position_unit(hexapod).name
    heads = [f'{kind.position.name} [{unit}]', f'range [{unit}]']
    if 'drives' in sheet:
        heads += ['lever [%]', f'{kind.effort.name} at rest [{TORQUES[torque_unit].name}]']
    return heads


def _joints(sheet: Mapping[str, Any], hexapod: RatedHexapod, torque_unit: str,
            ) -> list[dict[str, Any]]:
    """Return a row for each leg: joints in mm, and its drive with its range."""
    p, unit, rows = hexapod.given, _position_unit(hexapod), []
    positions = hexapod.platform.inverse_kinematics(hexapod.pose)
    for n, name in enumerate(hexapod.joints):
        shown = round(unit.factor * float(positions[n]), 1) + 0.0  # no -0
        cells = [number(shown, 1), ' to '.join(
            '–' if p[limit] is None else f'{unit.factor * p[limit][n]:.6g}'.replace('-', '−')
            for limit in p.leg_kind.position_limits)]
        if 'drives' in sheet:
            drives = sheet['drives']
            cells += [number(100.0 * float(drives['lever_ratios'][n]), 1), digits(
                TORQUES[torque_unit].factor * float(drives[p.leg_kind.effort.field][n]))]
        rows.append({'leg': name, 'base': 1e3 * p.geometry.base_joints[n],
                     'platform': 1e3 * p.geometry.platform_joints[n], 'drive': cells})
    return rows


def _in_unit(value: Any, unit: str, torque_unit: str) -> str:
    """Return numbers of a parameter with their unit, angles in degrees."""
    if unit == 'rad':
        return numbers(value, DEGREE.factor, DEGREE.name)
    if unit == 'N m':
        unit = TORQUES[torque_unit].name
        return numbers(value, TORQUES[torque_unit].factor, f' {unit}')
    return numbers(value, 1.0, f' {unit}'.rstrip())


def _properties(sheet: Mapping[str, Any], hexapod: RatedHexapod, torque_unit: str,
                ) -> list[tuple[str, str]]:
    """Return names and values of the other parameters that the figures rest on."""
    p = hexapod.given
    kind = p.leg_kind
    reflected = kind.fields['reflected_mass']
    inertia = inertia_matrix(p.carried.inertia)

    rows = [
        pose_row(sheet['pose']),
        ('Pivot, platform frame', numbers(sheet['pivot'], 1e3, ' mm')),
        *([('Pivot at the rated pose', numbers(sheet['pose']['pivot_position'], 1e3, ' mm'))]
          if any(sheet['pivot']) else []),
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
    if sheet['leg_clearance'] is not None:
        rows.append(('Clearance between legs at the pose',
                     numbers(sheet['leg_clearance'], 1e3, ' mm')))
    rows.append(('singularity.stop_condition', f'{p.singularity.stop_condition:g}'))
    return rows
