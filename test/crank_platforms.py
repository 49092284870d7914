# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Hexapods with cranks of the references, as the package takes them."""

from __future__ import annotations

from typing import Any

from crank_newton_euler import CrankHexapod, State
from stewart_dynamics import BaseMotion, Motion, Parameters
from stewart_dynamics.arrays import Array


def six(tensor: Array) -> list[float]:
    return [float(tensor[i, j]) for i in range(3) for j in range(i, 3)]


def parameters_of(machine: CrankHexapod, **changes: Any) -> Parameters:
    """Return the parameters of a machine of the references."""
    return Parameters({
        'geometry.base_joints': machine.center, 'geometry.platform_joints': machine.P,
        'geometry.crank_axes': machine.axis, 'geometry.crank_directions': machine.zero,
        'geometry.crank_branch': ['positive' if sign > 0.0 else 'negative'
                                  for sign in machine.branch],
        'legs.crank.length': machine.crank, 'legs.crank.mass': machine.mc,
        'legs.crank.center_of_mass': machine.cc,
        'legs.crank.inertia': [six(each) for each in machine.Ic],
        'legs.rod.length': machine.rod, 'legs.rod.mass': machine.mr,
        'legs.rod.center_of_mass': machine.sr, 'legs.rod.inertia': machine.Ir,
        'actuator.reflected_inertia': machine.J, 'actuator.viscous_friction': machine.visc,
        'actuator.coulomb_friction': machine.coul, 'actuator.coulomb_velocity': machine.slow,
        'platform.mass': machine.m, 'platform.center_of_mass': machine.c,
        'platform.inertia': six(machine.I), 'gravity': machine.g,
        'limits.angle_min': machine.middle - 3.0, 'limits.angle_max': machine.middle + 3.0,
        **changes})


def motion_of(state: State) -> Motion:
    return Motion(state.t, state.R, state.v, state.w, state.a, state.al)


def base_of(state: State) -> BaseMotion | None:
    base = state.base
    return None if base is None else BaseMotion(base.g, base.a, base.w, base.al)
