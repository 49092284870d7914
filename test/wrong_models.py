# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Hexapods that differ from their parameter file, and the identification of their parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from recorded import fourier, MotionAt, Noise, Recorded, recorded
from referees import rng, ROOT, rotation_about

from stewart_dynamics import Parameters, StewartPlatform
from stewart_dynamics.identification.identification_options import IdentificationOptions
from stewart_dynamics.identification.identify import Identification, Identified
from stewart_dynamics.identification.unknowns import DEFAULT
from stewart_dynamics.identification.windows import Window

Array = NDArray[np.float64]

GIVEN = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
RATE, SECONDS = 250.0, 20.0
# Noise at 250 samples per second, each the mean of four at 1 kHz.
NOISE = Noise(length=5e-6, rate=5e-4, effort=2.5, coloured=2.0, delay=3e-3)
RIGHT = 'right model'
# Exponents of the size in the parameters of similar hexapods under the same gravity, whose times
# grow with the square root of the size.
EXPONENTS = {
    'geometry.base_joints': 1.0, 'geometry.platform_joints': 1.0, 'geometry.zero_length': 1.0,
    'platform.mass': 3.0, 'platform.center_of_mass': 1.0, 'platform.inertia': 5.0,
    **{f'legs.{part}.{name}': exponent for part in ('cylinder', 'piston')
       for name, exponent in (('mass', 3.0), ('center_of_mass', 1.0), ('inertia', 5.0))},
    'actuator.reflected_mass': 3.0, 'actuator.viscous_friction': 2.5,
    'actuator.coulomb_friction': 3.0, 'actuator.coulomb_velocity': 0.5,
    'limits.length_min': 1.0, 'limits.length_max': 1.0, 'limits.velocity_max': 0.5,
    'limits.force_max': 3.0, 'singularity.characteristic_length': 1.0}


class Case(NamedTuple):
    """A true hexapod: its parameters, the disturbance of its forces, and a later payload."""

    true: Parameters
    forces: Callable[[Array, Array], Array] = lambda forces, rates: forces
    later: Parameters | None = None
    bags: int = 1


def true_hexapod(seed: int) -> Parameters:
    """Return a hexapod whose payload and friction differ from the file's."""
    random = rng(seed)
    mass = GIVEN['platform.mass'] * random.uniform(0.9, 1.3)
    return GIVEN.replaced({
        'platform.mass': mass,
        'platform.center_of_mass': GIVEN['platform.center_of_mass'] + random.uniform(
            -0.04, 0.04, 3),
        'platform.inertia': GIVEN['platform.inertia'] * mass / GIVEN['platform.mass'],
        'actuator.viscous_friction': 250.0 * random.uniform(0.7, 1.7, 6),
        'actuator.coulomb_friction': 30.0 * random.uniform(0.7, 1.7, 6)})


def sized(p: Parameters, size: float) -> Parameters:
    """Return a hexapod of another size."""
    return p.replaced({name: np.multiply(p[name], size ** exponent).tolist()
                       for name, exponent in EXPONENTS.items()})


def lighter(p: Parameters, kilograms: float) -> Parameters:
    """Return a hexapod without a point mass at the center of its platform."""
    mass = p['platform.mass'] - kilograms
    return p.replaced({
        'platform.mass': mass,
        'platform.center_of_mass': p['platform.center_of_mass'] * p['platform.mass'] / mass})


def leg_masses(p: Parameters, random: np.random.Generator) -> Case:
    return Case(p.replaced({f'legs.{part}.mass': 1.1 * p[f'legs.{part}.mass']
                            for part in ('cylinder', 'piston')}))


def base_joint(p: Parameters, random: np.random.Generator) -> Case:
    joints = p['geometry.base_joints'].copy()
    direction = random.normal(size=3)
    joints.reshape(6, 3)[random.integers(6)] += 4e-3 * direction / np.linalg.norm(direction)
    return Case(p.replaced({'geometry.base_joints': joints}))


def offsets(p: Parameters, random: np.random.Generator) -> Case:
    added = 20.0 * random.normal(size=6)
    return Case(p, lambda forces, rates: forces + added)


def offset(p: Parameters, random: np.random.Generator) -> Case:
    added = 40.0 * np.eye(6)[random.integers(6)]
    return Case(p, lambda forces, rates: forces + added)


def stribeck(p: Parameters, random: np.random.Generator) -> Case:
    more, speed = 0.5 * p['actuator.coulomb_friction'], random.uniform(0.03, 0.08)
    return Case(p, lambda forces, rates: forces + more * np.sign(rates) * np.exp(
        -(rates / speed) ** 2))


def load_friction(p: Parameters, random: np.random.Generator) -> Case:
    return Case(p, lambda forces, rates: forces + 0.03 * np.abs(forces) * np.sign(rates))


def dropped(p: Parameters, random: np.random.Generator) -> Case:
    return Case(p, later=lighter(p, random.uniform(2.0, 6.0)))


def tilt(p: Parameters, random: np.random.Generator) -> Case:
    angle = random.uniform(0.0, 2.0 * np.pi)
    axis = np.array([np.cos(angle), np.sin(angle), 0.0])
    return Case(p.replaced({'gravity': rotation_about(axis, np.radians(0.5)) @ p['gravity']}))


def reflected_mass(p: Parameters, random: np.random.Generator) -> Case:
    return Case(p.replaced({'actuator.reflected_mass': 0.5 * p['actuator.reflected_mass']}))


def gain(p: Parameters, random: np.random.Generator) -> Case:
    gains = 1.0 + 0.05 * np.eye(6)[random.integers(6)]
    return Case(p, lambda forces, rates: forces * gains)


def scale(p: Parameters, random: np.random.Generator) -> Case:
    return Case(p, lambda forces, rates: 1.05 * forces)


def far_scale(p: Parameters, random: np.random.Generator) -> Case:
    return Case(p, lambda forces, rates: forces / 1.3)


def saturation(p: Parameters, random: np.random.Generator) -> Case:
    part = random.uniform(0.6, 0.8)

    def clipped(forces: Array, rates: Array) -> Array:
        most = part * np.abs(forces).max()
        return np.clip(forces, -most, most)

    return Case(p, clipped)


def two_bags(p: Parameters, random: np.random.Generator) -> Case:
    return Case(p, later=lighter(p, random.uniform(2.0, 6.0)), bags=2)


CAUSES: dict[str, tuple[Callable[[Parameters, np.random.Generator], Case], tuple[str, ...]]] = {
    'leg masses 10 % off': (leg_masses, ('leg_mass',)),
    'base joint 4 mm off': (base_joint, ('joint', 'zero_length')),
    'offsets of 20 N RMS': (offsets, ('offset',)),
    'offset of 40 N on one leg': (offset, ('offset',)),
    'Stribeck friction': (stribeck, ('stribeck_friction',)),
    'load-dependent friction 3 %': (load_friction, ('load_friction',)),
    'payload of 2 to 6 kg drops': (dropped, ('payload',)),
    'tilt 0.5 degrees': (tilt, ('tilt',)),
    'reflected mass halved': (reflected_mass, ('reflected_mass',)),
    'gain of one leg 5 % off': (gain, ('gain',)),
    'all efforts times 1.05': (scale, ('effort_gain',)),
    'all efforts divided by 1.3': (far_scale, ('effort_gain',)),
    'saturation': (saturation, ('saturation',)),
    'two payloads in two bags': (two_bags, ('payload',)),
}


def simulated(case: Case, seed: int, motion: MotionAt | None = None) -> list[Recorded]:
    """Return a recording for each bag."""
    motion = motion or fourier(seed)
    bags = []
    for bag in range(case.bags):
        seconds = SECONDS / case.bags
        times = np.arange(round(seconds * RATE)) / RATE - NOISE.delay + bag * seconds
        change = SECONDS * rng(seed).uniform(0.3, 0.7) if case.bags == 1 else seconds - 0.1
        parts = []
        for p in (case.true, case.later or case.true):
            result = StewartPlatform(p).inverse_dynamics(motion(times))
            parts.append(case.forces(result.forces, result.rates))
        efforts = np.where((times < change)[:, None], *parts)
        bags.append(recorded(
            case.true, lambda t, bag=bag, seconds=seconds: motion(t + bag * seconds), seconds,
            RATE, 100 * seed + bag, NOISE, efforts))
    return bags


def identify(bags: Sequence[Recorded], given: Parameters = GIVEN,
             kinds: Sequence[str] = DEFAULT, size: float = 1.0) -> Identified:
    """Return the identification from the recordings of one hexapod, or of one of another size."""
    slower = np.sqrt(size)
    options = IdentificationOptions(kinds=tuple(kinds), hold_out=0.0, cutoff=10.0 / slower)
    with closing(Identification(sized(given, size), options)) as work:
        for n, each in enumerate(bags):
            work.add(Path(f'bag {n}'), [Window(
                0, slower / RATE, size * each.positions,
                None if each.rates is None else slower * each.rates, size ** 3 * each.efforts,
                np.zeros(each.efforts.shape, dtype=bool))])
        return work.result()
