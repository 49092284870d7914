# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The table of many bags, one row each: fleet.csv, and index.html, which can be sorted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
import csv
from functools import cache, partial
import io
import math
import os
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

from stewart_dynamics.bags.find import FLEET_PAGE, FLEET_TABLE
from stewart_dynamics.legs import KINDS
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.mechanics.limits import LIMITS, limits_of_kind
from stewart_dynamics.program import BAD_INPUT, DONE, PARTLY_READ
from stewart_dynamics.records import key_of
from stewart_dynamics.replay.bag_summary import BagSummary, margin_key
from stewart_dynamics.replay.legs_table import harmless
from stewart_dynamics.replay.motor_loads import needed_motor
from stewart_dynamics.replay.replay_options import LIMIT_MET
from stewart_dynamics.replay.statements import (
    MEASURED, MISSING, needed_words, statements, values_of)
from stewart_dynamics.reporting.pages import digits, page, thousands
from stewart_dynamics.reporting.results_folder import REPORT_PAGE
from stewart_dynamics.whole_file import FilesOfFolder

FOLDER = Path(__file__).with_name('templates')

Cell = str | int | float | bool | None
Row = Mapping[str, Cell]  # the cells of one bag, by column

RESULTS = ('done', 'limit or warning', 'failed', 'incomplete')  # the results by exit code
REJECTED = 'messages rejected'
"""The result of code 0 if messages were rejected, more than a hundredth of the setpoints."""
_REJECTED_SHARE = 0.01
NOTHING_ANSWERED = 'nothing answered'  # the result of code 3 if no setpoint could be answered
SEVERITY = (RESULTS[DONE], REJECTED, RESULTS[LIMIT_MET], RESULTS[PARTLY_READ], NOTHING_ANSWERED,
            RESULTS[BAD_INPUT])
"""The results, the most severe last."""
IN_WORDS = {REJECTED: f'with {REJECTED}', RESULTS[LIMIT_MET]: 'with a limit or warning',
            NOTHING_ANSWERED: 'without an answer'}
"""Results after a number of bags, where they differ."""


class Column(NamedTuple):
    """
    A column: its key in fleet.csv, its title on the page, and its unit.

    ``of`` returns the cell from the summary of a bag; None: not from there.
    ``size``: the page sorts these numbers by magnitude. ``optional``: the page shows the column
    only if a bag has a value.
    """

    key: str
    head: str
    unit: str = ''
    of: Callable[[BagSummary], Cell] | None = None
    number: bool = True
    size: bool = False
    optional: bool = False


def _value(path: str) -> Callable[[BagSummary], Cell]:
    """Return a function for the value at a path of keys; None if one of them leads to none."""
    def of(summary: BagSummary) -> Cell:
        found: Any = summary
        for key in path.split('.'):
            found = None if found is None else found.under(key)
        cell: Cell = found
        return cell

    return of


def _of_legs(key: str, choose: Callable[..., Cell], part: str = '',
             ) -> Callable[[BagSummary], Cell]:
    """Return a function that chooses among a value of each leg, in a part of the summary."""
    def of(summary: BagSummary) -> Cell:
        group = summary.under(part) if part else summary
        legs = group.legs if group else {}
        return choose((value for value, _ in values_of(legs, key)), default=None)

    return of


def _of_worst_effort(what: int) -> Callable[[BagSummary], Cell]:
    """Return a function for the largest effort: 0 its value, 1 its leg, 2 its time."""
    def of(summary: BagSummary) -> Cell:
        peaks = [(leg.effort_peak, name, leg.effort_peak_at)
                 for name, leg in summary.legs.items() if leg.effort_peak is not None]
        return max(peaks, key=lambda peak: abs(peak[0]))[what] if peaks else None

    return of


_largest = partial(max, key=abs)


def _exceeded(summary: BagSummary) -> str:
    legs: dict[str, list[str]] = {}
    for each in summary.limits:
        legs.setdefault(each.limit.removeprefix('limits.'), []).append(each.leg)
    return '; '.join(f'{limit}: {", ".join(of)}' for limit, of in legs.items())


def _rejected(summary: BagSummary) -> int:
    return sum(each.count for each in summary.rejected)


@cache
def columns_of(kind: LegKind) -> tuple[Column, ...]:
    """Return the columns of bags of hexapods with a kind of legs."""
    limits, name, unit = limits_of_kind(kind), kind.effort.name, kind.effort.unit
    residual, of_motors = key_of('residual_rms', unit), _prefix_of_motors(kind)
    effort_rms = key_of(f'{name}_rms', unit)
    return (
        Column('bag', 'bag', number=False),
        Column('code', ''),
        Column('result', 'result', number=False),
        Column('reason', 'reason', number=False),
        Column('complete', '', '', _value('complete'), number=False),
        Column('setpoints', 'setpoints', '', _value('setpoints.answered')),
        Column('duration_s', 'duration', 's', _value('setpoints.duration_s')),
        Column(key_of(f'{name}_worst', unit), f'worst {name}', unit, _of_worst_effort(0),
               size=True),
        Column(f'{name}_worst_leg', 'of leg', '', _of_worst_effort(1), number=False),
        Column(f'{name}_worst_at_s', 'at', 's', _of_worst_effort(2)),
        *(Column(margin_key(quantity), f'{quantity.name} margin', quantity.unit,
                 _of_legs(margin_key(quantity), min), optional=not LIMITS[limit].usual)
          for limit in (*limits.loads, kind.position_limits[1], *limits.rates, *(
              each for each in limits.poses if each not in kind.position_limits))
          for quantity in [LIMITS[limit].quantity]),
        Column('limits_exceeded', 'limits exceeded', '', _exceeded, number=False),
        Column(effort_rms, f'RMS {name}', unit, _of_legs(effort_rms, max)),
        Column('power_peak_w', 'peak power', 'W', _of_legs('power_peak_w', _largest), size=True),
        *(Column(of_motors + key, head, unit, _of_legs(
            key, min if 'margin' in key else _largest, 'motors'),
            size='peak' in key, optional=True) for key, head, unit in (
            ('torque_rms_n_m', 'RMS motor torque', 'N m'),
            ('torque_peak_n_m', 'peak motor torque', 'N m'),
            ('speed_peak_rad_s', 'peak motor speed', 'rad/s'),
            ('torque_margin_n_m', 'torque margin', 'N m'),
            ('torque_continuous_margin_n_m', 'continuous torque margin', 'N m'),
            ('speed_margin_rad_s', 'speed margin', 'rad/s'),
            ('temperature_rise_max_k', 'temperature rise of windings', 'K'))),
        *(Column(f'bus_{key}', head, unit, _value(f'motors.bus.{key}'), optional=True)
          for key, head, unit in (
            ('power_peak_w', 'bus power', 'W'),
            ('regenerated_peak_w', 'power flowing back', 'W'),
            ('energy_per_cycle_j', 'energy of a cycle', 'J'))),
        Column('determinant_nearest_m3', 'det(J) nearest 0', 'm³',
               _value('singularity.determinant_nearest_m3'), size=True),
        Column('crossings', 'crossings', '', _value('singularity.crossings')),
        Column('condition_max', 'condition number', 'max', _value('singularity.condition_max')),
        Column('warnings', 'warnings', '', _value('singularity.warnings')),
        Column('rejected', 'rejected', '', _rejected),
        Column(residual, 'residual RMS', unit, _of_legs(residual, max, 'measured'), optional=True),
        Column('residual_share', 'residual share', '',
               _value('measured.residual_share'), optional=True),
        Column('contacts', 'contacts', '', _value('measured.contacts.count'), optional=True),
        Column('measured', 'measured', '', _value('measured.headline'), number=False,
               optional=True),
        Column('results', '', number=False),
    )


def _prefix_of_motors(kind: LegKind) -> str:
    """Return what precedes keys of motors, where drives have torques of their own."""
    return 'motor_' if kind.effort.unit == 'N m' else ''


def _kind_of(rows: Iterable[Row]) -> LegKind:
    """Return the kind of legs of bags, which are of one hexapod."""
    kinds = (kind for row in rows for kind in KINDS
             if key_of(f'{kind.effort.name}_worst', kind.effort.unit) in row)
    return next(kinds, KINDS[0])


def row_of(code: int, summary: BagSummary | None, error: str) -> dict[str, Cell]:
    """
    Return a bag's cells except its path and the folder of its results.

    They are those of its summary, or of a bag that failed if it is None. The error is the reason
    why the bag failed or was read in part.
    """
    cells: dict[str, Cell] = {'code': code, 'result': RESULTS[code], 'reason': error}
    if summary is not None:
        cells['software'] = summary.software
        cells['reason'] = '; '.join([*([error] if error else []), *_reasons(summary)])
        answered = summary.setpoints.answered
        if not answered:
            cells['result'] = NOTHING_ANSWERED
        elif code == DONE and _rejected(summary) > _REJECTED_SHARE * answered:
            cells['result'] = REJECTED
        cells.update({column.key: column.of(summary)
                      for column in columns_of(summary.kind) if column.of})
    return cells


def _reasons(summary: BagSummary) -> list[str]:
    """Return the warnings about a bag that was replayed; the unread parts are in the error."""
    return [each.line for each in statements(summary)
            if each.level in ('warn', 'bad') and each.topic not in (MEASURED, MISSING)]


def write_fleet(output: Path, rows: Sequence[Row], files: FilesOfFolder | None = None) -> None:
    """
    Write fleet.csv and index.html into a folder, both complete or not at all.

    ``files`` knows the content of the folder when the run began; by default the present one.
    """
    text = io.StringIO(newline='')
    # All text in quotes: spreadsheets that separate by semicolon do not split names.
    table = csv.writer(text, quoting=csv.QUOTE_NONNUMERIC)
    columns = columns_of(_kind_of(rows))
    table.writerow([column.key for column in columns])
    table.writerows([_harmless(column.key, row.get(column.key)) for column in columns]
                    for row in rows)
    files = files or FilesOfFolder(output, replace=True)
    files.write({FLEET_TABLE: text.getvalue(), FLEET_PAGE: _page(output, rows)})


def listed_results(table: Path) -> set[str] | None:
    """Return the folders of results in a fleet.csv; None if it cannot be read as one."""
    try:
        with table.open(newline='', encoding='utf-8') as file:
            reader = csv.DictReader(file)
            known = [[column.key for column in columns_of(kind)] for kind in KINDS]
            if list(reader.fieldnames or ()) not in known:
                return None
            return {row['results'].removeprefix('./') for row in reader if row['results']}
    except (OSError, ValueError, csv.Error):
        return None


def _harmless(key: str, cell: Cell) -> Cell:
    """
    Return a cell that no spreadsheet takes for a formula.

    A name that begins as one gets './' before it and is still the same path; other text gets an
    apostrophe.
    """
    if cell is None:
        return ''
    if isinstance(cell, bool):
        return str(cell).lower()
    if isinstance(cell, str):
        return harmless(cell, './' if key in ('bag', 'results') else "'")
    return cell


def _page(output: Path, rows: Sequence[Row]) -> str:
    shown = [column for column in columns_of(_kind_of(rows)) if column.head and not (
        column.optional and all(row.get(column.key) is None for row in rows))]
    prefix = os.path.commonprefix([f'{row["bag"]}' for row in rows])
    folder = prefix[:prefix.rfind('/') + 1] if len(rows) > 1 else ''
    software = next((f'{row["software"]}' for row in rows if 'software' in row), '')
    counts = Counter(row['result'] for row in rows)
    counts['all'] = len(rows)
    fleet = {
        'columns': [{'key': column.key, 'number': column.number, 'size': column.size}
                    for column in shown],
        # The colour of a row.
        'codes': [LIMIT_MET if row['result'] == REJECTED else row['code'] for row in rows],
        'severity': SEVERITY,
        'results': [result for result in ('all', *SEVERITY) if counts[result]],
        'folder': folder,
        'links': [_link(output, row) for row in rows],
        'rows': [[_shown(row.get(column.key)) for column in shown] for row in rows],
    }
    return page(FOLDER, 'index', fleet=fleet, columns=shown, counts=counts,
                totals=[*_totals(rows, len(folder))],
                software=', bags in '.join(filter(None, (software, folder))))


def _totals(rows: Sequence[Row], cut: int) -> Iterator[tuple[str, str, str]]:
    """Yield name, text and remark of the numbers of all bags; names of bags begin at ``cut``."""
    kind = _kind_of(rows)
    effort, prefix = kind.effort, _prefix_of_motors(kind)

    def known(key: str) -> list[tuple[float, str, Row]]:
        return [(found, f'{row["bag"]}'[cut:], row) for row in rows
                if isinstance(found := row.get(key), int | float) and math.isfinite(found)]

    seconds = sum(found for found, *_ in known('duration_s'))
    yield 'bags', thousands(len(rows)), ''
    yield 'setpoints', thousands(sum(int(found) for found, *_ in known('setpoints'))), ''
    yield 'recorded', (f'{seconds:.1f} s' if seconds < 120.0 else f'{seconds / 60.0:.1f} min'
                       if seconds < 7200.0 else f'{seconds / 3600.0:.1f} h'), ''
    worst = known(key_of(f'{effort.name}_worst', effort.unit))
    if worst:
        value, name, row = max(worst, key=lambda each: abs(each[0]))
        yield (f'worst {effort.name}', f'{digits(value)} {effort.unit}',
               f'{row[f"{effort.name}_worst_leg"]}, {name}')
    nearest = known('determinant_nearest_m3')
    if nearest:
        value, name, _ = min(nearest, key=lambda each: abs(each[0]))
        yield 'det(J) nearest 0', f'{digits(value)} m³', name
    loads: list[Any] = [
        [row[prefix + key] for key in ('torque_rms_n_m', 'torque_peak_n_m', 'speed_peak_rad_s')]
        for row in rows if f'{prefix}torque_peak_n_m' in row and not row['warnings']]
    motor = needed_words(needed_motor(loads))
    if motor:
        yield 'motor needed', motor, 'without bags with singularity warnings'


def _shown(cell: Cell) -> Cell:
    """Return a number rounded to nine digits, 0 for -0, None if it is not finite."""
    if isinstance(cell, float):
        return float(f'{cell:.9g}') + 0.0 if math.isfinite(cell) else None
    return cell


def _link(output: Path, row: Row) -> str | None:
    """Return the link to the report of a bag, or to its folder if there is no report."""
    if row['results'] is None:
        return None
    report = Path(str(row['results'])) / REPORT_PAGE
    target = report if (output / report).is_file() else report.parent
    return quote(os.fsencode(target))
