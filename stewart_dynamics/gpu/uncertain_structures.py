# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Hexapods that a parameter file admits: drawn from normal distributions by ``uncertainty.*``.

Mass, center of mass and inertia of the platform, without the payload; masses, centers of mass and
inertias of the parts of the legs, of all legs together and of each; reflected masses or inertias
of the drives; the direction of gravity. The deviations are those of the prior of
``stewart_identify`` (``estimation.uncertainty``), to first order. A hexapod that breaks a rule of
the file, as a negative mass does, is drawn again.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Records
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.gpu.own_structures import complete, copies
from stewart_dynamics.mechanics.frames.rotation import from_rotation_vector
from stewart_dynamics.parameters.table import Parameters

_MOST_ROUNDS = 1000


def uncertain_structures(parameters: Parameters, count: int, seed: int = 0) -> Records:
    """
    Return the structures (count,) of hexapods; the same for equal seeds.

    Raises ParameterError if the deviations admit nearly none that keeps the rules.
    """
    structures = _drawn(parameters, count, seed)
    complete(structures, copies(parameters, 1, follows=False)[1])
    return structures  # type: ignore[no-any-return]


def _drawn(parameters: Parameters, count: int, seed: int) -> Any:
    """Return structures (count,) without the payload, that keep the rules with it."""
    random = np.random.default_rng(seed)
    found: list[Any] = []
    missing = count
    for _ in range(_MOST_ROUNDS):
        structures, payload = copies(parameters, max(missing, 64), follows=False)
        _vary(parameters, structures, random)
        codes, _ = complete(structures.copy(), payload)
        found.append(structures[codes == 0][:missing])
        missing -= len(found[-1])
        if not missing:
            return np.concatenate(found)
    raise ParameterError(f'{parameters.source}: uncertainty.*: so large that hardly any hexapod '
                         'keeps the rules of the parameters')


def _vary(parameters: Parameters, structures: Any, random: np.random.Generator) -> None:
    """Change structures (n,) by random numbers, each hexapod by its own."""
    deviations, count = parameters.uncertainty, len(structures)
    normal = random.standard_normal
    body, legs = parameters.platform.body, structures['legs']
    structures['mass'] *= 1.0 + deviations.platform_mass * normal(count)
    structures['center_of_mass'] += deviations.center_of_mass * normal((count, 3))
    structures['inertia'] += (
        deviations.inertia * np.mean(body.inertia[[0, 3, 5]]) * normal((count, 6)))
    for part in parameters.leg_kind.parts:
        for what in ('mass', 'center_of_mass', 'inertia'):
            field = legs[f'{part}_{what}']
            factor = 1.0 + deviations.leg_mass * (normal((count, 1)) + normal((count, 6)))
            field *= factor.reshape(count, 6, *(1,) * (field.ndim - 2))
    if parameters.leg_kind.fields['reflected_mass'] in parameters.given:
        legs['reflected_mass'] *= 1.0 + deviations.reflected_mass * normal((count, 6))
    else:  # it follows from the inertias of the motors
        for name in ('motor_inertia', 'screw_inertia'):
            legs[name] *= 1.0 + deviations.reflected_mass * normal((count, 6))
    tilts = np.zeros((count, 3))
    tilts[:, :2] = deviations.tilt * normal((count, 2))
    structures['gravity'] = (
        from_rotation_vector(tilts) @ structures['gravity'][..., None])[..., 0]


def uncertain_parameters(parameters: Parameters, count: int, seed: int = 0,
                         ) -> Iterator[Parameters]:
    """Yield the parameters of the same hexapods, one at a time."""
    kind = parameters.leg_kind
    names = {f'{part}_{what}': f'legs.{part}.{what}' for part in kind.parts
             for what in ('mass', 'center_of_mass', 'inertia')}
    reflected = kind.fields['reflected_mass']
    if reflected in parameters.given:
        names['reflected_mass'] = reflected
    else:
        names |= {each: f'drive.{each}' for each in ('motor_inertia', 'screw_inertia')
                  if parameters[f'drive.{each}'] is not None}
    for structure in _drawn(parameters, count, seed):
        yield parameters.replaced({
            'platform.mass': structure['mass'], 'platform.inertia': structure['inertia'],
            'platform.center_of_mass': structure['center_of_mass'],
            'gravity': structure['gravity'],
            **{name: structure['legs'][field] for field, name in names.items()}})
