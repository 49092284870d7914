# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Random hexapods with cranks, and random states within their reach."""

from __future__ import annotations

from dataclasses import replace

from crank_newton_euler import Array, BaseState, CrankHexapod, Motion, State
import numpy as np
from referees import random_direction, rotation_about, STANDARD_GRAVITY

LEVER = 0.15  # smallest lever per crank length, in a state
LEVER_AT_HOME = 0.5
CONDITION = 40.0  # largest condition number of J_d, moments divided by the size of the base
UP = np.array([0.0, 0.0, 1.0])


def size_of(machine: CrankHexapod) -> float:
    """Return the mean distance of the motors from the origin of the base [m]."""
    return float(np.mean(np.linalg.norm(machine.center, axis=-1)))


def with_leg_masses(machine: CrankHexapod, factor: float) -> CrankHexapod:
    """Return the hexapod with masses and inertias of cranks and rods times a factor."""
    return replace(machine, **{
        name: factor * getattr(machine, name) for name in ('mc', 'Ic', 'mr', 'Ir')})


def within(machine: CrankHexapod, state: State, lever: float = LEVER) -> bool:
    """Return whether a state is in reach, away from dead centers and from singular poses."""
    try:
        motion = Motion(machine, state)
    except ValueError:
        return False
    scale = np.repeat([1.0, 1.0 / size_of(machine)], 3)
    return bool(np.all(np.abs(motion.lever) >= lever * machine.crank)
                and np.linalg.cond(motion.jacobian() * scale) < CONDITION)


def random_inertia(random: np.random.Generator, mass: float, radius: float) -> Array:
    """Return an inertia tensor that a body of a mass and a radius of gyration can have."""
    turn = rotation_about(random_direction(random), random.uniform(0.0, np.pi))
    second = mass * radius ** 2 * turn @ np.diag(random.uniform(0.05, 1.0, 3)) @ turn.T
    inertia: Array = np.trace(second) * np.eye(3) - second
    return inertia


def _random_machine(random: np.random.Generator) -> CrankHexapod:
    size = 10.0 ** random.uniform(-1.0, 0.2)
    thirds = np.repeat([0.0, 2.0, 4.0], 2) * np.pi / 3

    def ring(radius: float, spread: float) -> Array:
        headings = thirds + np.tile([-spread, spread], 3) + random.uniform(-0.1, 0.1, 6)
        return radius * np.column_stack([
            np.cos(headings), np.sin(headings), random.uniform(-0.1, 0.1, 6)])

    center, joints = size * ring(1.0, 0.8), size * ring(random.uniform(0.5, 1.0), 0.25)
    home = size * np.array([*random.uniform(-0.05, 0.05, 2), random.uniform(0.8, 1.8)])
    crank = size * random.uniform(0.2, 0.5, 6)
    # Motor axes of any heading, nearly level; cranks at home at any angle from their zeros.
    axis = np.array([[np.cos(a), np.sin(a), z] for a, z in zip(
        random.uniform(0.0, 2.0 * np.pi, 6), random.uniform(-0.3, 0.3, 6), strict=True)])
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    level = np.cross(axis, UP)
    level *= random.choice([-1.0, 1.0], (6, 1)) / np.linalg.norm(level, axis=-1, keepdims=True)
    angle = random.uniform(-4.0, 4.0, 6)

    def turned(lift: Array) -> Array:
        return np.array([rotation_about(u, q) @ e for u, q, e in zip(
            axis, lift, level, strict=True)])

    lift = random.uniform(-0.6, 0.6, 6)
    along = turned(lift)
    gap = home + joints - center - crank[:, None] * along
    mass = 400.0 * size ** 3 * random.uniform(0.3, 3.0)
    crank_masses, rod_masses = mass * random.uniform(0.003, 0.02, (2, 6))
    gravity = rotation_about(random_direction(random), random.uniform(0.1, 1.0)) @ (
        -STANDARD_GRAVITY * UP)
    rod = np.linalg.norm(gap, axis=-1)
    torque = mass * STANDARD_GRAVITY * crank
    return CrankHexapod(
        center, axis, turned(lift - angle), crank, rod,
        np.sign(np.sum(gap * np.cross(axis, along), axis=-1)), joints,
        mass, size * random.uniform(-0.2, 0.2, 3), random_inertia(random, mass, 0.4 * size),
        gravity, home,
        crank_masses, crank[:, None] * random.uniform(-0.4, 0.6, (6, 3)),
        np.array([random_inertia(random, m, 0.4 * each) for m, each in zip(
            crank_masses, crank, strict=True)]),
        rod_masses, rod * random.uniform(-0.1, 1.1, 6),
        rod_masses * rod ** 2 * random.uniform(0.02, 0.2, 6),
        mass * crank ** 2 * random.uniform(0.0, 0.1, 6), torque * random.uniform(0.0, 0.05, 6),
        torque * random.uniform(0.0, 0.05, 6), 10.0 ** random.uniform(-3.0, 0.0, 6),
        angle + random.uniform(-1.0, 1.0, 6))


def random_machine(random: np.random.Generator, leg_masses: float | None = None) -> CrankHexapod:
    """
    Return a random hexapod of six different legs, both branches among them.

    Axes of the motors have any heading and tilt by up to 0.3, gravity is tilted against the base,
    all centers of mass are off the lines. The middles of the ranges of angles are up to 5 rad from
    the cranks' zeros. leg_masses is a factor of the masses of cranks and rods, by default 0, 1 or
    random up to 20.
    """
    while True:
        machine = _random_machine(random)
        if within(machine, at_rest(machine), LEVER_AT_HOME):
            break
    if leg_masses is None:
        leg_masses = float(random.choice([0.0, 1.0, random.uniform(0.0, 20.0)]))
    return with_leg_masses(machine, leg_masses)


def at_rest(machine: CrankHexapod) -> State:
    """Return the state at home, at rest."""
    return State(machine.home, np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3),
                 np.zeros(6))


def random_state(machine: CrankHexapod, random: np.random.Generator, moving_base: bool = True,
                 ) -> State:
    """Return a random state within reach, on a base that moves or is at rest."""
    size, weight = size_of(machine), machine.m * STANDARD_GRAVITY
    while True:
        state = State(
            machine.home + machine.crank.mean() * random.uniform(-0.7, 0.7, 3),
            rotation_about(random_direction(random), random.uniform(0.0, 0.5)),
            size * random.uniform(-1.0, 1.0, 3), random.uniform(-2.0, 2.0, 3),
            size * random.uniform(-5.0, 5.0, 3), random.uniform(-10.0, 10.0, 3),
            weight * random.uniform(-1.0, 1.0, 6) * np.repeat([1.0, size], 3),
            BaseState(STANDARD_GRAVITY * random_direction(random),
                      size * random.uniform(-5.0, 5.0, 3), random.uniform(-2.0, 2.0, 3),
                      random.uniform(-10.0, 10.0, 3)) if moving_base else None)
        if within(machine, state):
            return state
