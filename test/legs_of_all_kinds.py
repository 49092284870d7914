# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Random hexapods of each kind of legs with random motions, for tests that ask the kind alone."""

from __future__ import annotations

from crank_machines import random_machine, random_state
from crank_platforms import motion_of, parameters_of
import numpy as np
from referees import Array, random_motion, random_parameters, rng
from stewart_dynamics import Motion, Parameters, StewartPlatform

KINDS = 'telescopic', 'crank'


def random_hexapod(kind: str, seed: int, count: int) -> tuple[Parameters, Motion]:
    """Return a hexapod and motions within its reach."""
    random = rng(seed)
    if kind == 'telescopic':
        p = random_parameters(random)
        return p, random_motion(p, rng(seed), count)
    machine = random_machine(random, 1.0)
    rows = [motion_of(random_state(machine, random, moving_base=False)).rows
            for _ in range(count)]
    return parameters_of(machine), Motion.of_rows(np.reshape(rows, (count, 24)))


def efforts_of(p: Parameters, motions: Motion) -> Array:
    """Return the efforts of the drives by the library."""
    efforts: Array = getattr(
        StewartPlatform(p).inverse_dynamics(motions), p.leg_kind.effort.field)
    return efforts
