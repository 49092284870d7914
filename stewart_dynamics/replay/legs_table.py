# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""legs.csv and legs.parquet: one row per setpoint: time, pose, legs, det(J), base wrench."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, TYPE_CHECKING

import numpy as np
import orjson

from stewart_dynamics.arrays import Array, Flags, Stamps
from stewart_dynamics.errors import StewartError
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.mechanics.frames.rotation import to_quaternion
from stewart_dynamics.mechanics.limits import OF_JOINTS
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.records import key_of
from stewart_dynamics.reporting.results_folder import LEGS_CSV, LEGS_PARQUET

if TYPE_CHECKING:  # the process that writes the table does not need it
    from stewart_dynamics.replay.summary import Answered

# Beginnings of text that spreadsheet programs execute.
_FORMULA = ('=', '+', '-', '@', '\t', '\r', '\n')
# Ends of rows without and with a warning.
_ENDS = (b',0\n', b',1\n')


def column_names(kind: LegKind, legs: Sequence[str], joint_angles: bool = False,
                 clearance: bool = False, joint_forces: bool = False) -> list[str]:
    """Return the names of the columns; a name ends with its unit."""
    position, rate, effort = (
        key_of(each.name, each.unit) for each in (kind.position, kind.rate, kind.effort))
    limited = (*((f'{kind.joint_force}_n',) if joint_forces else ()),
               *(('base_joint_angle_rad', 'platform_joint_angle_rad') if joint_angles else ()),
               *(('clearance_m',) if clearance else ()))
    return ['stamp_ns', 'time_s',
            *(f'position_{axis}_m' for axis in 'xyz'),
            *(f'orientation_{part}' for part in 'xyzw'),
            *(f'{leg}_{quantity}' for quantity in (
                position, rate, effort, f'demanded_{effort}') for leg in legs),
            'determinant_m3', 'determinant_rate_m3_s', 'condition',
            *(f'base_force_{axis}_n' for axis in 'xyz'),
            *(f'base_moment_{axis}_n_m' for axis in 'xyz'),
            *(f'{leg}_{quantity}' for quantity in limited for leg in legs), 'warning']


class Rows(NamedTuple):
    """N rows of the table."""

    stamps: Stamps  # (N,) [ns]
    numbers: Array  # (N, 41 to 65), nan: not known
    warnings: Flags  # (N,)


class LegsRows:
    """
    Columns of the table of a hexapod, and its rows.

    quasi_static: velocities are not known: columns that depend on them are empty.
    """

    def __init__(self, parameters: Parameters, quasi_static: bool = False) -> None:
        kind = parameters.leg_kind
        self._quasi_static = quasi_static
        self._joint_forces = parameters[kind.joint_force_limit] is not None
        self.names = column_names(
            kind, parameters.joints, any(parameters[name] is not None for name in OF_JOINTS),
            parameters.limits.leg_clearance_min is not None, self._joint_forces)

    def of_block(self, block: Answered) -> Rows:
        """Return the rows of N setpoints."""
        outputs, motions = block.outputs, block.setpoints.motions
        rates, determinant_rates = outputs.rates, outputs.determinant_rates
        if self._quasi_static:
            rates = np.full_like(rates, np.nan)
            determinant_rates = np.full_like(determinant_rates, np.nan)
        numbers = np.column_stack([
            block.seconds, motions[:, :3], to_quaternion(motions[:, 3:12].reshape(-1, 3, 3)),
            outputs.drive_positions, rates, outputs.efforts, outputs.demanded_efforts,
            outputs.determinants, determinant_rates, outputs.conditions, block.base_wrenches,
            outputs.joint_forces[:, :6 if self._joint_forces else 0], outputs.joint_angles,
            outputs.clearances])
        return Rows(outputs.stamps, numbers, outputs.warnings)


class Table(ABC):
    """
    A file with one row per setpoint.

    folder: folder of the file.
    names: names of the columns.
    """

    FILE = ''

    @abstractmethod
    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        """Begin the file."""

    @abstractmethod
    def write(self, rows: Rows) -> None:
        """Write rows."""

    @abstractmethod
    def close(self) -> None:
        """Complete the file."""

    def abandon(self) -> None:
        """Close the file, which need not be complete."""
        self.close()


class CsvTable(Table):
    """legs.csv: each number with the fewest digits that represent it exactly."""

    FILE = LEGS_CSV

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        self._file = (folder / self.FILE).open('wb')
        self._file.write(','.join(_quoted(harmless(name)) for name in names).encode() + b'\n')

    def write(self, rows: Rows) -> None:
        """Write rows."""
        if len(rows.stamps):
            self._file.write(_text_of(rows))

    def close(self) -> None:
        """Complete the file."""
        self._file.close()


def _text_of(rows: Rows) -> bytes:
    """Return the text of rows, nan as empty."""
    stamps, numbers, warnings = rows
    text = orjson.dumps(numbers, option=orjson.OPT_SERIALIZE_NUMPY)[2:-2]
    if not np.isfinite(numbers).all():
        text = text.replace(b'null', b'')
    # '1,2],[3,4' becomes ',1,2' and ',3,4'
    cells = [b''] * (3 * len(numbers))
    cells[::3] = orjson.dumps(stamps, option=orjson.OPT_SERIALIZE_NUMPY)[1:-1].split(b',')
    cells[1::3] = (b',' + text.replace(b'[', b'')).split(b']')
    cells[2::3] = [_ENDS[on] for on in warnings.tolist()]
    return b''.join(cells)


def harmless(text: str, mark: str = "'") -> str:
    """Return a text, with a mark before it if a spreadsheet would read it as a formula."""
    return f'{mark}{text}' if text.startswith(_FORMULA) else text


def _quoted(text: str) -> str:
    if any(mark in text for mark in ',"\n\r'):
        return '"' + text.replace('"', '""') + '"'
    return text


class ParquetTable(Table):
    """legs.parquet: the columns of legs.csv; null: not known, or no force."""

    FILE = LEGS_PARQUET

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        try:
            import pyarrow
            import pyarrow.parquet
        except ImportError as exc:
            raise StewartError(
                "--parquet needs pyarrow: pip install 'stewart_dynamics[parquet]'") from exc
        self._arrow = pyarrow
        self._schema = pyarrow.schema([
            (names[0], pyarrow.int64()), *((name, pyarrow.float64()) for name in names[1:-1]),
            (names[-1], pyarrow.bool_())])
        self._writer = pyarrow.parquet.ParquetWriter(folder / self.FILE, self._schema)
        self._waiting: list[Any] = []

    def write(self, rows: Rows) -> None:
        """Write rows."""
        stamps, numbers, warnings = rows
        self._waiting.append(self._arrow.record_batch(
            [self._arrow.array(column, type=field.type, from_pandas=True) for column, field in zip(
                [stamps, *numbers.T, warnings], self._schema, strict=True)],
            schema=self._schema))
        if sum(batch.num_rows for batch in self._waiting) >= 1 << 16:
            self._flush()

    def close(self) -> None:
        """Complete the file."""
        self._flush()
        self._writer.close()

    def _flush(self) -> None:
        # Parquet is read faster in large row groups.
        if self._waiting:
            self._writer.write_table(self._arrow.Table.from_batches(self._waiting))
            self._waiting.clear()


def kind_of_table(parquet: bool) -> type[Table]:
    """Return the kind of table that a replay writes."""
    return ParquetTable if parquet else CsvTable
