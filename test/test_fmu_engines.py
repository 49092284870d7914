# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The FMU in other engines than FMPy: the bits of the library at each of their steps.

Skipped without the engine: pip install ecospy tbb, or libcosimpy; their versions of the last run
stand in docs/real_time.md.
"""

from __future__ import annotations

from collections.abc import Callable
import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from referees import ROOT
from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.export.fmu import find_compiler, fmu, variables

PARAMETERS = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
VARIABLES = variables(PARAMETERS)
REFERENCES = {each.name: n for n, each in enumerate(VARIABLES)}
INPUTS = 'position.z', 'linear_velocity.z', 'linear_acceleration.z'
FORCES = [f'forces[{leg}]' for leg in range(1, 7)]
STEP = 0.001  # [s]
COMPILER = find_compiler()
pytestmark = pytest.mark.skipif(COMPILER is None, reason='needs a C compiler')

Rows = list[list[float]]


def engine(name: str) -> Any:
    """Return the package of an engine; skip the test without it."""
    try:
        return importlib.import_module(name)
    except (ImportError, OSError) as exc:  # OSError: ecospy without tbb
        pytest.skip(f'needs {name}: {exc}')


def by_ecos(path: Path, rows: Rows) -> Rows:
    """Return the forces after each step in Ecos."""
    ecospy = engine('ecospy')
    found = []
    with ecospy.EcosSimulationStructure() as structure:
        structure.add_model('hexapod', path)
        with ecospy.EcosSimulation(structure=structure, step_size=STEP) as simulation:
            simulation.init()
            for row in rows:
                for name, value in zip(INPUTS, row, strict=True):
                    simulation.set_real(f'hexapod::{name}', value)
                simulation.step(1)
                found.append([simulation.get_real(f'hexapod::{name}') for name in FORCES])
    return found


def by_libcosim(path: Path, rows: Rows) -> Rows:
    """Return the forces after each step in libcosim, of the Open Simulation Platform."""
    execution, slaves, manipulators, observers = (
        engine(f'libcosimpy.Cosim{part}') for part in (
            'Execution', 'Slave', 'Manipulator', 'Observer'))
    simulation = execution.CosimExecution.from_step_size(step_size=round(STEP * 1e9))
    hexapod = simulation.add_local_slave(local_slave=slaves.CosimLocalSlave(
        fmu_path=str(path), instance_name='hexapod'))
    inputs = manipulators.CosimManipulator.create_override()
    outputs = observers.CosimObserver.create_last_value()
    simulation.add_manipulator(inputs)
    simulation.add_observer(outputs)
    found = []
    for row in rows:
        inputs.slave_real_values(hexapod, [REFERENCES[name] for name in INPUTS], row)
        simulation.step()
        found.append(list(outputs.last_real_values(
            hexapod, [REFERENCES[name] for name in FORCES])))
    return found


@pytest.mark.parametrize(('run', 'version'), [
    (by_ecos, '3'), (by_ecos, '2'), (by_libcosim, '2')])  # libcosim knows no FMI 3
def test_an_engine_has_the_bits_of_the_library(
        run: Callable[[Path, Rows], Rows], version: str, tmp_path: Path) -> None:
    """A heaving platform: the forces of the inputs that were set before a step."""
    path = tmp_path / 'hexapod.fmu'
    path.write_bytes(fmu(PARAMETERS, 'hexapod', version, COMPILER))
    start = [each.start or 0.0 for each in VARIABLES[:3]]
    phases = np.arange(50) / 10.0
    rows = np.column_stack([
        start[2] + 0.02 * np.sin(phases), 0.2 * np.cos(phases), -np.sin(phases)]).tolist()
    nothing, platform = np.zeros(3), StewartPlatform(PARAMETERS)
    most = PARAMETERS['limits.force_max']
    assert run(path, rows) == [np.clip(platform.inverse_dynamics(Motion(
        [*start[:2], height], np.eye(3), [0.0, 0.0, rate], nothing, [0.0, 0.0, acceleration],
        nothing)).forces, -most, most).tolist() for height, rate, acceleration in rows]
