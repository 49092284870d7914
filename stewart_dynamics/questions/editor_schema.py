# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The file by which editors complete and check parameter files of all nodes."""

from __future__ import annotations

from stewart_dynamics.cueing.cueing_parameters import CueingParameters
from stewart_dynamics.parameters.json_schema import json_schema
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters
from stewart_dynamics.whole_file import to_json

SCHEMA = 'parameters.schema.json'
"""Name of the file, in the folder of the parameter files."""
NAMES_SCHEMA = f'# yaml-language-server: $schema={SCHEMA}\n'
"""First line of a parameter file, which editors read."""


def schema_text() -> str:
    """Return the text of the file."""
    return to_json(json_schema((Parameters, ReferenceMotionParameters, SimulatorParameters,
                                CueingParameters)), indent=1) + '\n'
