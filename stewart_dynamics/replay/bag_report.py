# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
The report of one bag: an HTML page with tables, plots linked in time and the platform in motion.

It needs no network: plotly.js is taken from the PyPI package plotly. Numbers are embedded as
base64 of typed arrays.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime, timezone
import hashlib
import itertools
from pathlib import Path
from typing import Any

from msgspec.structs import asdict
import numpy as np

from stewart_dynamics.arrays import Array, RPM, SECOND
from stewart_dynamics.colors import FORCE_COLORS
from stewart_dynamics.estimation.confidence_level import PERCENT
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.mechanics.drives.motors import Motors
from stewart_dynamics.mechanics.dynamics.force_breakdown import sources_of
from stewart_dynamics.mechanics.frames.rotation import to_euler
from stewart_dynamics.mechanics.limits import (
    LIMITS, limits_of, limits_of_kind, OF_JOINTS, Quantity)
from stewart_dynamics.mechanics.rows import (
    ANGULAR_ACCELERATION, ANGULAR_VELOCITY, LINEAR_ACCELERATION, LINEAR_VELOCITY, PARTS_OF_WRENCH,
    POSE, POSITION, ROTATION)
from stewart_dynamics.parameters.table import PARAMETERS, Parameters
from stewart_dynamics.replay.bag_summary import BagSummary, LegLoads, margin_key, Rejected
from stewart_dynamics.replay.motor_charts import motor_charts, OperatingPoints
from stewart_dynamics.replay.motor_loads import NEEDS
from stewart_dynamics.replay.report_plots import (
    base_wrench_plots, measured_plots, motion_plots, plotted, spectrum_plots, uncertain_plots)
from stewart_dynamics.replay.statements import cards, FIRST, values_of
from stewart_dynamics.replay.summary import Answered
from stewart_dynamics.reporting.curves import Curves, Frames
from stewart_dynamics.reporting.pages import (
    base64_of, decimals_of, link, link_to_other, page, plotly_script)
from stewart_dynamics.reporting.results_folder import DATASHEET, DATASHEET_PAGE, DATASHEETS
from stewart_dynamics.reporting.spectrum import drawn, Spectrum
from stewart_dynamics.response.recorded_response import Followed
from stewart_dynamics.response.response_charts import bode_charts, legs_chart, zoom_charts
from stewart_dynamics.response.response_measures import bandwidths
from stewart_dynamics.setpoints.rejections import stamp_of
from stewart_dynamics.whole_file import FilesOfFolder, write_files

FOLDER = Path(__file__).with_name('templates')
# Where the numbers of the moving platform are in a frame; angles in degrees. Anchors: where the
# lines of force of the legs begin, if they move.
_FRAME = {'position': (0, 3), 'rotation': (3, 12), 'angles': (12, 15), 'positions': (15, 21),
          'efforts': (21, 27)}
_ANCHORS = {'anchors': (27, 45)}
# Maximum number of listed times of one kind, the first ones.
_MOST_TIMES = 20


class Report:
    """
    The plots of a bag, collected block by block, and the file that contains them.

    With ``measured``, ``add_measured`` will be called. Until the end the folder contains a
    file, which has no name there.
    """

    def __init__(self, parameters: Parameters, measured: bool = False,
                 folder: Path | None = None, uncertain: bool = False) -> None:
        self._parameters = parameters
        self._legs: tuple[str, ...] = parameters.joints
        self._plotted = plotted(parameters)
        self._sources = len(sources_of(parameters))
        timeout = parameters.setpoint.timeout
        self._curves = Curves(timeout)
        self._places: dict[str, slice] = {}
        self._spectrum = Spectrum(6, timeout, folder)
        self._kind = kind = parameters.leg_kind
        moving = kind.anchors(parameters, np.zeros(6)) is not None
        self._frame = _FRAME | (_ANCHORS if moving else {})
        self._frames = Frames(max(end for _, end in self._frame.values()))
        self._compared = Curves(timeout) if measured else None
        self._places_compared: dict[str, slice] = {}
        self._angles: Array = np.zeros((1, 3))
        self._first: Array | None = None  # position [m]
        self._uncertain = uncertain
        self._operating = OperatingPoints() if parameters.drives else None

    def add_block(self, block: Answered, bands: Array | None = None) -> None:
        """Add setpoints, at least one, with their breakdown, and the bands of their efforts."""
        seconds, setpoints, outputs, base_wrenches, powers, breakdown = block
        assert breakdown is not None
        motions, positions = setpoints.motions, outputs.drive_positions
        if self._first is None:
            self._first = motions[0, POSITION].copy()
        angles = self._continued(np.degrees(to_euler(motions[:, ROTATION].reshape(-1, 3, 3))))
        quantities = {
            'position': motions[:, POSITION] - self._first,
            'angles': angles,
            'velocity': motions[:, LINEAR_VELOCITY],
            'angular_velocity': np.degrees(motions[:, ANGULAR_VELOCITY]),
            'acceleration': motions[:, LINEAR_ACCELERATION],
            'angular_acceleration': np.degrees(motions[:, ANGULAR_ACCELERATION]),
            **{LIMITS[name].quantity.key: outputs.rows[:, LIMITS[name].columns]
               for name in self._plotted},
            'powers': powers,
            'determinant': outputs.determinants[:, None],
            'condition': outputs.conditions[:, None],
            'base_force': base_wrenches[:, :3],
            'base_moment': base_wrenches[:, 3:],
            'breakdown': breakdown[:, :self._sources].reshape(len(seconds), -1),
            'joint_angles': np.degrees(outputs.joint_angles),
            'clearances': outputs.clearances}
        if bands is not None:
            quantities['uncertain'] = bands
        if self._operating is not None:
            motors = Motors.of_rows(outputs.motors)
            with np.errstate(invalid='ignore'):
                quantities |= {
                    'torques': motors.torques, 'speeds': motors.speeds,
                    'rises': outputs.rises,
                    'bus_power': motors.power.sum(axis=1, keepdims=True)}
            self._operating.add(motors)
        self._places = _add(self._curves, seconds, quantities)
        self._spectrum.add(seconds, base_wrenches.T)
        anchors = self._kind.anchors(self._parameters, positions)
        self._frames.add(seconds, np.concatenate([
            motions[:, POSE], angles, positions, outputs.demanded_efforts,
            *([] if anchors is None else [anchors.reshape(len(seconds), -1)])], axis=1))

    def add_measured(
            self, seconds: Array, measured: Array, computed: Array, wrench: Array) -> None:
        """Add setpoints that were compared, see Compared."""
        if self._compared is None:
            raise ValueError('the report was created without measured forces')
        self._places_compared = _add(self._compared, seconds, {
            'measured': measured, 'computed': computed, 'residual': measured - computed,
            'external_force': wrench[:, :3], 'external_moment': wrench[:, 3:]})

    def write_page(self, path: Path, summary: BagSummary, plotly: Path | None = None,
                   followed: Followed | None = None, command: str = '') -> None:
        """
        Write the report; a file that exists is overwritten.

        ``plotly`` is the file of plotly.js that several reports share; by default it is in the
        report. ``command`` rates the motion. Raises StewartError if plotly is not installed.
        """
        script = plotly_script() if plotly is None else ''
        known = not summary.quasi_static
        text = page(
            FOLDER, 'report', [script] if script else [], plotly is not None, True, s=summary,
            p=self._parameters, legs=list(self._legs),
            name=Path(summary.bag).name or summary.bag, plotly=script, command=command,
            plotly_file=None if plotly is None else link(path, plotly),
            datasheet=link_to_other(
                path, [Path(DATASHEET_PAGE), Path(DATASHEETS, DATASHEET_PAGE)], DATASHEET,
                summary.parameters),
            data=self._data(summary), sources=sources_of(self._parameters),
            cards=cards(summary), margins=smallest_margins(summary),
            margin_columns=margin_columns(self._parameters), rejections=rejections(summary),
            date=date(summary.setpoints.first_stamp_ns),
            quantities={name: limit.quantity for name, limit in LIMITS.items()},
            units={name: self._parameters.unit_of(name) or '' for name in PARAMETERS},
            most_times=_MOST_TIMES, needs=NEEDS, rpm=RPM, parts=PARTS_OF_WRENCH,
            kind=self._kind, **_decimals(self._kind, summary.legs),
            wrench_decimals={part: decimals_of(
                self._kind.decimals, [getattr(summary.base_wrench, part).peak])
                for part in PARTS_OF_WRENCH},
            base_wrench=asdict(summary.base_wrench),
            external_wrench=asdict(summary.measured.external_wrench) if summary.measured else {},
            percent=PERCENT, bandwidths=bandwidths, **_response_charts(followed),
            charts=motor_charts(self._operating, self._parameters, summary.motors.legs)
            if self._operating and summary.motors and known else {})
        write_files({path: text})

    def _continued(self, angles: Array) -> Array:
        """Return angles [deg] without jumps at half a turn."""
        whole = np.concatenate([self._angles, angles])
        turns = np.cumsum(np.round(np.diff(whole, axis=0) / 360.0), axis=0)
        continued: Array = angles - 360.0 * turns
        self._angles = continued[-1:]
        return continued

    def _data(self, summary: BagSummary) -> dict[str, Any]:
        times, frames = self._frames.chosen()
        singularity = summary.singularity
        p = self._parameters
        known = not summary.quasi_static
        curves = _lines(self._curves)
        plots = [] if self._first is None else [
            *motion_plots(p, self._places, known, self._first.tolist()),
            *base_wrench_plots(self._places),
            *(uncertain_plots(p, self._places) if self._uncertain else [])]
        density = self._spectrum.density()
        if density is not None:
            plots += spectrum_plots(density, len(curves))
            curves += [drawn(density.frequencies, each) for each in density.amplitudes]
        if self._compared is not None and self._compared.samples:
            shown = measured_plots(p, {
                name: slice(len(curves) + at.start, len(curves) + at.stop)
                for name, at in self._places_compared.items()})
            measured = summary.measured
            plots += [plot for plot in shown if not plot.key.startswith('external')
                      or measured is None or measured.external_wrench_given]
            curves += _lines(self._compared)
        return {
            'samples': self._curves.samples,
            'samplesInBucket': self._curves.samples_in_bucket,
            'begin': times[0] if len(times) else 0.0,
            'end': times[-1] if len(times) else 0.0,
            'legs': self._legs,
            'position': {'name': self._kind.position.name, 'unit': self._kind.position.unit},
            'effort': {'name': self._kind.effort.name, 'unit': self._kind.effort.unit,
                       'positive': self._kind.effort.positive},
            'forceColors': FORCE_COLORS,
            'baseJoints': p.geometry.base_joints,
            'platformJoints': p.geometry.platform_joints,
            'frames': {'times': base64_of(times, '<f8'), 'numbers': base64_of(frames, '<f8'),
                       'places': self._frame},
            'warnings': singularity.warnings_from_to_s,
            'crossings': singularity.crossings_at_s,
            'contacts': [[each.from_s, each.to_s] for each in (
                summary.measured.contacts.strongest if summary.measured else ())],
            'curves': [_packed(*each) for each in curves],
            'plots': [plot.plain() for plot in plots],
        }


def _decimals(kind: LegKind, legs: Mapping[str, LegLoads]) -> dict[str, int]:
    """Return the decimals of efforts, powers and energies in the tables."""
    names = {'effort': 'effort_peak', 'power': 'power_peak_w', 'energy': 'energy_driving_j'}
    return {f'{which}_decimals': decimals_of(
        kind.decimals, [getattr(leg, name) for leg in legs.values()])
        for which, name in names.items()}


def _response_charts(followed: Followed | None) -> dict[str, Any]:
    if followed is None:
        return {'bode': {}, 'bode_legs': '', 'zooms': {}}
    return {'bode': bode_charts(followed.values), 'bode_legs': legs_chart(followed.values),
            'zooms': zoom_charts(followed.values, followed.samples)}


def _add(curves: Curves, seconds: Array, quantities: Mapping[str, Array]) -> dict[str, slice]:
    """Add quantities (N, ...), always the same; return the curves of each of them."""
    curves.add(seconds, np.concatenate([values.T for values in quantities.values()]))
    ends = itertools.accumulate(values.shape[1] for values in quantities.values())
    return {name: slice(end - values.shape[1], end)
            for (name, values), end in zip(quantities.items(), ends, strict=True)}


def _lines(curves: Curves) -> list[tuple[Array, Array]]:
    return [curves.drawn(n) for n in range(curves.channels)]


def _packed(times: Array, values: Array) -> dict[str, str]:
    most = float(np.finfo(np.float32).max)
    return {'times': base64_of(times, '<f8'), 'values': base64_of(values.clip(-most, most), '<f4')}


def share_plotly(folder: Path) -> Path:
    """Write plotly.js into a folder, if it is not there; return its path."""
    script = plotly_script().encode()
    path = folder.absolute() / f'plotly-{hashlib.sha256(script).hexdigest()[:12]}.min.js'
    if not path.exists():
        FilesOfFolder(path.parent, True).write({path.name: script})
    return path


# -- tables ---------------------------------------------------------------------------------------

def rejections(summary: BagSummary) -> list[tuple[Rejected, str]]:
    """Return the rejected messages, with details that do not repeat the stamp."""
    return [(each, stamp_of(each.first)[1]) for each in summary.rejected]


def margin_columns(parameters: Parameters) -> list[tuple[Quantity, str, list[str]]]:
    """
    Return the quantities with limits, each with the key of its margin and its limits.

    Those that are not usual are left out if no limit is given; of joints, none at both ends.
    """
    limits: dict[Quantity, list[str]] = {}
    for limit in limits_of(parameters).legs:
        together = OF_JOINTS if limit in OF_JOINTS else (limit,)
        if LIMITS[limit].usual or any(parameters[name] is not None for name in together):
            limits.setdefault(LIMITS[limit].quantity, []).append(limit)
    return [(quantity, margin_key(quantity), names) for quantity, names in limits.items()]


def smallest_margins(summary: BagSummary) -> list[dict[str, Any]]:
    """Return the smallest margins of all quantities with a limit, each with its leg."""
    found = []
    names = limits_of_kind(summary.kind).legs
    for quantity in dict.fromkeys(LIMITS[limit].quantity for limit in names):
        if margins := values_of(summary.legs, margin_key(quantity)):
            value, joint = min(margins, key=FIRST)
            found.append({'name': quantity.name, 'value': value, 'unit': quantity.unit,
                          'leg': joint})
    return found


def date(stamp: int | None) -> str:
    """Return the date of a stamp, empty if it is not a plausible time."""
    if stamp is None or stamp < SECOND * 10 ** 9:
        return ''
    try:
        when = datetime.fromtimestamp(stamp // SECOND, timezone.utc)
    except (OverflowError, OSError, ValueError):
        return ''
    return f' ({when:%Y-%m-%d %H:%M:%S} UTC)'
