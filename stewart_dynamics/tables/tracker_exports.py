# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Exports of optical trackers as tables with the names of the table of quantities.

Three layouts are known, by their first lines:

- Motive (OptiTrack), CSV: one line of keys and values, then rows with type, name and id of each
  column, its kind (Rotation, Position) and its axis. y is up.
- QTM (Qualisys), 6D as TSV: lines of keys and values, then the names of the columns, which begin
  with the name of the body: position [mm], angles of Rx Ry Rz [deg] and, column by column, the
  rotation matrix. Bodies that are not tracked are zero.
- Nexus and Tracker (Vicon), CSV: the kind of the export, its rate, names of the objects, names of
  the columns, units. RX RY RZ are a rotation vector, or with RW a quaternion.

Frames in which a body is not tracked have empty cells.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from stewart_dynamics.errors import BagError, shown_name
from stewart_dynamics.tables.cells import Cells, is_number, Row, split_rows

# Axes of the base frame, z up, in those of a source with y up.
_Y_UP = 'x,-z,y'
_QTM_COLUMNS = ('x [mm]', 'y [mm]', 'z [mm]', 'roll [deg]', 'pitch [deg]', 'yaw [deg]')
_QTM_MATRIX = tuple(f'r{row}{column}' for column in '123' for row in '123')
_VICON = ('Objects', 'Segments')
_VICON_OTHERS = ('Devices', 'Joints', 'Model Outputs', 'Trajectories')
_LISTED = 20


class Export(NamedTuple):
    """A body of a tracker as a table."""

    cells: Cells
    tracker: str
    euler: str | None = None  # order of its angles
    axes: str | None = None  # of the source that are x, y, z of a frame with z up


def find_export(path: Path, text: str, body: str | None) -> Export | None:
    """
    Return the poses of a body in the file of a tracker; None if this is not one.

    body: its name; None: the only one.

    Raises BagError if it does not have the body, or several, or no poses.
    """
    top = text[:4096].lstrip()
    first = top.partition('\n')[0].strip()
    for begins, read in ((first.startswith('Format Version'), _motive),
                         (first.startswith('NO_OF_FRAMES'), _qtm),
                         (first.rstrip(',;\t') in (*_VICON, *_VICON_OTHERS), _vicon)):
        if begins:
            separator = max(',;\t', key=top.count)
            return read(path, split_rows(path, text, separator), separator, body)
    return None


def _motive(path: Path, rows: list[Row], separator: str, body: str | None) -> Export:
    keys = dict(zip(rows[0].cells[::2], rows[0].cells[1::2], strict=False))
    at = _find(path, rows, lambda row: row.cells[0] == 'Frame', 'Frame, Time (Seconds)')
    named = {row.cells[1]: row.cells for row in rows[1:at] if len(row.cells) > 1}
    axes, kinds = rows[at].cells, rows[at - 1].cells
    types, names = named.get('Type', []), named.get('Name', [])
    bodies = dict.fromkeys(name for kind, name in zip(types, names, strict=False)
                           if kind == 'Rigid Body')
    chosen = _chosen(path, list(bodies), body, 'rigid body: export rigid bodies')
    places = [n for n, (kind, name) in enumerate(zip(types, names, strict=False))
              if kind == 'Rigid Body' and name == chosen]
    rotation = [n for n in places if n < len(kinds) and kinds[n] == 'Rotation']
    turns = ('qx', 'qy', 'qz', 'qw') if any(axes[n] == 'W' for n in rotation) else (
        'roll [deg]', 'pitch [deg]', 'yaw [deg]')
    columns = {1: 't'}
    columns |= {n: turns['XYZW'.index(axes[n])] for n in rotation if axes[n] in tuple('XYZW')}
    columns |= {n: f'{axes[n].lower()} [{keys.get("Length Units", "m")}]' for n in places
                if n < len(kinds) and kinds[n] == 'Position' and axes[n] in tuple('XYZ')}
    order = keys.get('Rotation Type', '')
    return Export(_table(path, rows, at, columns, separator), 'Motive',
                  order if sorted(order) == ['X', 'Y', 'Z'] else None, _Y_UP)


def _qtm(path: Path, rows: list[Row], separator: str, body: str | None) -> Export:
    at = _find(path, rows, lambda row: any(
        cell.strip().endswith('X') and [each.strip() for each in row.cells[n + 1:n + 3]] == [
            'Y', 'Z'] for n, cell in enumerate(row.cells)),
        'X, Y, Z, Roll: export with the header of the columns')
    keys = {row.cells[0]: row.cells[1:] for row in rows[:at]}
    names = [cell.strip() for cell in rows[at].cells]
    begins = [n for n, (name, *others) in enumerate(zip(
        names, names[1:], names[2:], strict=False)) if name.endswith('X') and others == ['Y', 'Z']]
    bodies = [name.strip() for name in keys.get('BODY_NAMES', []) if name.strip()]
    bodies = bodies if len(bodies) == len(begins) else [
        names[n].removesuffix('X').strip() for n in begins]
    begin = begins[bodies.index(_chosen(path, bodies, body, 'body: export 6D data'))]
    end = next((n for n in begins if n > begin), len(names))
    columns = {begin + n: name for n, name in enumerate(_QTM_COLUMNS)}
    if 'Rot[8]' in names[begin:end]:  # which angles they are, is up to the project of QTM
        first = names.index('Rot[0]', begin)
        columns = dict(list(columns.items())[:3]) | {
            first + n: name for n, name in enumerate(_QTM_MATRIX)}
    table = _table(path, rows, at, columns, separator)
    for row in table.rows:
        if all(is_number(cell) and not float(cell.replace(',', '.')) for n, cell in enumerate(
                row.cells) if n in columns):
            row.cells[:] = ['' if n in columns else cell for n, cell in enumerate(row.cells)]
    if 'Time' in names[:2]:
        table.header.cells[names.index('Time')] = 't'
    else:
        table = _timed(table, keys.get('FREQUENCY', ['']),
                       lambda n, row: n if names[0] != 'Frame' else int(row.cells[0]))
    return Export(table, 'QTM', 'XYZ')


def _vicon(path: Path, rows: list[Row], separator: str, body: str | None) -> Export:
    begin = next((n for n, row in enumerate(rows) if row.cells[0] in _VICON
                  and not any(row.cells[1:])), None)
    if begin is None:
        raise BagError(f'{path}: has {rows[0].cells[0]}, but no poses: export '
                       f'{" or ".join(_VICON)}')
    rows = rows[begin:]
    at = _find(path, rows, lambda row: row.cells[0] == 'Frame', 'Frame, Sub Frame')
    labels, names = rows[at - 1].cells, rows[at].cells
    begins = [n for n, label in enumerate(labels) if label.strip()]
    bodies = [labels[n].rpartition(' ')[2] if 'Global Angle' in labels[n] else labels[n]
              for n in begins]
    begin = begins[bodies.index(_chosen(path, bodies, body, 'object'))]
    end = next((n for n in begins if n > begin), len(names))
    below = rows[at + 1].cells if at + 1 < len(rows) else ['0']
    units = [''] * len(names) if is_number(below[0]) else below
    block = {n: names[n] for n in range(begin, min(end, len(names)))}
    turns = ('qx', 'qy', 'qz', 'qw') if 'RW' in block.values() else (
        ('roll', 'pitch', 'yaw') if 'Euler' in labels[begin] else ('rx', 'ry', 'rz'))
    known = dict(zip(('TX', 'TY', 'TZ', 'RX', 'RY', 'RZ', 'RW'), ('x', 'y', 'z', *turns),
                     strict=False))
    columns = {n: f'{known[name]} [{units[n].strip()}]' if units[n].strip() else known[name]
               for n, name in block.items() if name in known and n < len(units)}
    # A file may have several parts: this one ends where its frames end.
    last = next((n for n in range(at + 2, len(rows)) if not is_number(rows[n].cells[0])),
                len(rows))
    rate = rows[1].cells
    table = _table(path, rows[:last], at, columns, separator)
    if table.rows and not is_number(table.rows[0].cells[0]):
        del table.rows[0]  # the units
    return Export(_timed(table, rate, lambda n, row: int(row.cells[0])), 'Vicon', 'XYZ')


def _find(path: Path, rows: Sequence[Row], is_header: Callable[[Row], bool], names: str) -> int:
    at = next((n for n, row in enumerate(rows) if is_header(row)), None)
    if not at:
        raise BagError(f'{path}: has no row that begins with {names}')
    return at


def _chosen(path: Path, bodies: list[str], body: str | None, lacking: str) -> str:
    """Return the body that is read."""
    shown = ', '.join(shown_name(name) for name in bodies[:_LISTED])
    if not bodies:
        raise BagError(f'{path}: has no {lacking}')
    if body is None and len(bodies) == 1:
        return bodies[0]
    if body is None:
        raise BagError(f'{path}: has the bodies {shown}: select one by --child')
    found = [name for name in bodies if body in (name, name.partition(':')[0])]
    if not found:
        raise BagError(f'{path}: has no body {shown_name(body)}; it has {shown}')
    return found[0]


def _table(path: Path, rows: Sequence[Row], at: int, columns: Mapping[int, str], separator: str,
           ) -> Cells:
    """Return a table of some columns, by their places; shorter rows are filled up."""
    header = rows[at]
    width = max(len(header.cells), *(n + 1 for n in columns))
    return Cells(path, header._replace(cells=[columns.get(n, '') for n in range(width)]), [
        row._replace(cells=row.cells + [''] * (width - len(row.cells))) for row in rows[at + 1:]],
        separator)


def _timed(table: Cells, rate: Sequence[str], frame: Callable[[int, Row], int]) -> Cells:
    """Return a table with the times of its frames, by their rate [Hz]."""
    try:
        period = 1e9 / float(rate[0])
        times = [str(round(frame(n, row) * period)) for n, row in enumerate(table.rows)]
    except (IndexError, OverflowError, ValueError, ZeroDivisionError) as exc:
        raise BagError(f'{table.path}: has no time: rate {shown_name(rate[:1])}, or a frame that '
                       'is no whole number') from exc
    return table._replace(
        header=table.header._replace(cells=['t [ns]', *table.header.cells]),
        rows=[row._replace(cells=[time, *row.cells])
              for time, row in zip(times, table.rows, strict=True)])
