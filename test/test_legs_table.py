# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The table of the legs as CSV and Parquet, as read by other programs."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from numpy.typing import NDArray
import pyarrow.parquet
import pytest
from scipy.spatial.transform import Rotation
from stewart_dynamics.legs import TELESCOPIC
from stewart_dynamics.mechanics.frames.rotation import to_quaternion
from stewart_dynamics.mechanics.rows import MOTION
from stewart_dynamics.mechanics.singularity_warning import CAUSE
from stewart_dynamics.replay.legs_table import column_names, CsvTable, LegsRows, ParquetTable
from stewart_dynamics.setpoints.step import Computed, FIRST, OUTPUT, Outputs, WARNING_STATE
from test_output_bag import answered, base_wrenches_of, PARAMETERS, turning

RESULTS = 27
PUBLISHED = TELESCOPIC.published
ROWS = LegsRows(PARAMETERS)


def motions_of(number: int) -> NDArray[np.float64]:
    """Return motions of a platform that rises, at an orientation of its own each (N, 24)."""
    motions = np.zeros((number, MOTION))
    motions[:, 2] = 1.0 / 3.0 + np.arange(number)
    for n, quaternion in enumerate(np.random.default_rng(number).normal(size=(number, 4))):
        motions[n, 3:12] = Rotation.from_quat(quaternion).as_matrix().ravel()
    return motions


def outputs_of(results: NDArray[np.float64], forces: NDArray[np.float64],
               stamps: NDArray[np.int64], warnings: NDArray[np.bool_]) -> Outputs:
    rows = np.zeros((len(stamps), OUTPUT))
    rows[:, :RESULTS], rows[:, PUBLISHED] = results, forces
    rows[:, WARNING_STATE][:, CAUSE] = warnings
    return Outputs(np.ones(len(stamps), dtype=bool), stamps, rows, Computed.of(PARAMETERS),
                   FIRST)


def bits(values: Any) -> list[int]:
    return [int(n) for n in np.asarray(values, dtype=float).view(np.uint64).ravel()]


def read_csv(file: Path) -> tuple[list[str], list[list[str]]]:
    with file.open(newline='', encoding='utf-8') as stream:
        head, *rows = csv.reader(stream)
    return head, rows


def check_tables(folder: Path, blocks: list[Outputs]) -> None:
    """Check that both tables give every number back to the bit."""
    tables: list[Any] = [
        kind(folder, ROWS.names) for kind in (CsvTable, ParquetTable)]
    for table in tables:
        for outputs in blocks:
            number = len(outputs.stamps)
            table.write(ROWS.of_block(answered(outputs, outputs.stamps, motions_of(number))))
        table.close()
    head, rows = read_csv(folder / 'legs.csv')
    parquet = pyarrow.parquet.read_table(folder / 'legs.parquet')
    assert parquet.column_names == head
    columns = [parquet.column(n).to_pylist() for n in range(len(head))]
    at = 0
    for outputs in blocks:
        number = len(outputs.stamps)
        seconds, motions = np.arange(number) / 7.0, motions_of(number)
        quaternions = to_quaternion(motions[:, 3:12].reshape(-1, 3, 3))
        for n in range(number):
            row, same = rows[at], [column[at] for column in columns]
            expected = [seconds[n], *motions[n, :3], *quaternions[n], *outputs.drive_positions[n],
                        *outputs.rates[n], *outputs.efforts[n],
                        *outputs.demanded_efforts[n], outputs.determinants[n],
                        outputs.determinant_rates[n], outputs.conditions[n],
                        *base_wrenches_of(outputs)[n]]
            assert int(row[0]) == same[0] == outputs.stamps[n]
            assert len(row) == len(expected) + 2
            for text, value, truth in zip(row[1:-1], same[1:-1], expected, strict=True):
                if math.isnan(truth):
                    assert (text, value) == ('', None)
                else:
                    assert bits(float(text)) == bits(value) == bits(truth)
            assert row[-1] == str(int(outputs.warnings[n]))
            assert same[-1] is bool(outputs.warnings[n])
            at += 1
    assert at == len(rows) == parquet.num_rows


def test_the_tables_give_every_number_back(tmp_path: Path) -> None:
    outputs = turning(300)
    assert outputs.warnings.any()
    assert np.isnan(outputs.efforts).any()
    check_tables(tmp_path, [outputs, turning(0), turning(1)])


@given(st.data())
def test_the_tables_give_any_number_back(
        tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    number = data.draw(st.integers(1, 4))
    values = st.floats(allow_nan=False, allow_infinity=False)
    some = data.draw(st.lists(values, min_size=8, max_size=40))
    results = np.resize(some, (number, RESULTS))
    forces = np.resize(some[3:], (number, 6))
    if data.draw(st.booleans()):
        forces[0] = np.nan
        results[0, 12:18] = np.nan
    stamps = data.draw(st.lists(st.integers(-(1 << 63), (1 << 63) - 1), min_size=number,
                                max_size=number))
    check_tables(tmp_path_factory.mktemp('table'), [outputs_of(
        results, forces, np.array(stamps), np.arange(number) % 2 == 0)])


def test_numbers_at_the_edges(tmp_path: Path) -> None:
    edges = np.array([0.0, -0.0, 5e-324, -5e-324, 2.2250738585072014e-308, 1.7976931348623157e308,
                      1e16, 1e17, 123456789012345680.0, 1e-5, 1e-7, 0.1, 1 / 3, 1e22, 1e23,
                      9007199254740993.0])
    rng = np.random.default_rng(1)
    random = rng.integers(0, 1 << 64, 27_000, dtype=np.uint64).view(float)
    random[~np.isfinite(random)] = 1.0
    results = np.concatenate([np.resize(edges, (16, 27)), random.reshape(-1, 27)])
    many = len(results)
    check_tables(tmp_path, [outputs_of(
        results, results[:, 5:11].copy(), np.arange(many), np.zeros(many, dtype=bool))])


@pytest.mark.parametrize('table', [CsvTable, ParquetTable])
def test_any_names_of_legs_are_written_exactly(table: Any, tmp_path: Path) -> None:
    legs = ('größe', 'a "leg"', 'one, two', 'line\nbreak', ' ', "'=1+1'")
    writer = table(tmp_path, column_names(TELESCOPIC, legs))
    outputs = turning(2)
    writer.write(ROWS.of_block(answered(outputs, outputs.stamps, motions_of(2))))
    writer.close()
    if table is CsvTable:
        head, rows = read_csv(tmp_path / 'legs.csv')
        assert [len(row) for row in rows] == [len(head)] * 2
    else:
        head = pyarrow.parquet.read_table(tmp_path / 'legs.parquet').column_names
    assert [name.removesuffix('_length_m') for name in head[9:15]] == list(legs)
    assert [name.removesuffix('_force_n') for name in head[21:27]] == list(legs)


def test_the_base_wrench_is_before_the_warning(tmp_path: Path) -> None:
    CsvTable(tmp_path, ROWS.names).close()
    head, _ = read_csv(tmp_path / 'legs.csv')
    assert head[-8:] == [
        'condition', 'base_force_x_n', 'base_force_y_n', 'base_force_z_n', 'base_moment_x_n_m',
        'base_moment_y_n_m', 'base_moment_z_n_m', 'warning']


def test_no_column_name_is_a_formula(tmp_path: Path) -> None:
    legs = '=1+1', '+a', '-b', '@c', '\td', 'e'
    CsvTable(tmp_path, column_names(TELESCOPIC, legs)).close()
    head, _ = read_csv(tmp_path / 'legs.csv')
    assert [name.removesuffix('_length_m') for name in head[9:15]] == [
        "'=1+1", "'+a", "'-b", "'@c", "'\td", 'e']


@pytest.mark.parametrize('table', [CsvTable, ParquetTable])
def test_tables_without_rows(table: Any, tmp_path: Path) -> None:
    writer = table(tmp_path, ROWS.names)
    outputs = turning(0)
    writer.write(ROWS.of_block(answered(outputs, outputs.stamps, motions_of(0))))
    writer.close()
    file, = tmp_path.iterdir()
    if table is CsvTable:
        assert len(read_csv(file)[0]) == 43
        assert not read_csv(file)[1]
    else:
        assert pyarrow.parquet.read_table(file).shape == (0, 43)


def test_parquet_is_written_in_groups_of_many_rows(tmp_path: Path) -> None:
    outputs = turning(1000)
    table = ParquetTable(tmp_path, ROWS.names)
    for _ in range(100):
        table.write(ROWS.of_block(answered(outputs, outputs.stamps, motions_of(1000))))
    table.close()
    file = pyarrow.parquet.ParquetFile(tmp_path / 'legs.parquet')
    assert file.metadata.num_rows == 100_000
    assert file.metadata.num_row_groups == 2
