# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The hexapods that the tests of the plant simulate."""

from __future__ import annotations

from typing import Any

from referees import random_parameters, rng, ROOT, size_of

from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.parameters.yaml_file import read_yaml
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters

HEXAPOD = read_yaml(ROOT / 'config' / 'platform.yaml', 'stewart_simulator')
HOME = [0.0, 0.0, 1.1, 0.0, 0.0, 0.0]
FRICTIONLESS = {'actuator.viscous_friction': 0.0, 'actuator.coulomb_friction': 0.0}
UNLIMITED = dict.fromkeys(
    ('limits.length_min', 'limits.length_max', 'limits.velocity_max', 'limits.force_max'), None)
MASSLESS = {f'legs.{part}.{what}': 0.0 for part in ('cylinder', 'piston')
            for what in ('mass', 'center_of_mass', 'inertia')} | {'actuator.reflected_mass': 0.0}


def simulated(**changes: Any) -> SimulatorParameters:
    """Return the hexapod of config/platform.yaml; ``__`` in a name for a point."""
    return SimulatorParameters({**HEXAPOD, 'initial_pose': HOME, **{
        name.replace('__', '.'): value for name, value in changes.items()}})


def random_simulated(seed: int, **changes: Any) -> SimulatorParameters:
    """Return a hexapod with nothing special about it, at rest in its middle."""
    given = random_parameters(rng(seed)).given
    size = size_of(Parameters(given))
    return SimulatorParameters({**given, 'initial_pose': [0.0, 0.0, size, 0.0, 0.0, 0.0], **{
        name.replace('__', '.'): value for name, value in changes.items()}})
