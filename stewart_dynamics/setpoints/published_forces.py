# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The forces to publish: clipped, or suppressed by singularity warning, limits and jumps.

Batches call ``check_many``, compiled apart from the step of single setpoints, for which a node
waits at its first start.
"""

from __future__ import annotations

import math

import numpy as np

from stewart_dynamics.arrays import Array, Flags, NANOSECOND, Stamps
from stewart_dynamics.compilation.functions import entry_point, inlined
from stewart_dynamics.mechanics.limits import any_exceeded, jumps
from stewart_dynamics.mechanics.rows import (
    CONDITION, consecutive, DETERMINANT, DETERMINANT_RATE, FORCES, LENGTHS, RESULT)
from stewart_dynamics.mechanics.singularity_warning import (
    advance, forget, STATE, STOPPED, THRESHOLDS, UNSOLVABLE_CONDITION)
from stewart_dynamics.messages.cdr import STAMPS_END

# Layout of the settings: thresholds of the warning, whether to suppress forces inside
# stop_condition and while a limit is exceeded, thresholds of the limits, limits.force_max.
OF_WARNING, SUPPRESS, LIMITS_SUPPRESS, LIMITS, FORCE_MAX = consecutive(
    THRESHOLDS, 1, 1, 24, 6)


@inlined
def check(settings: Array, limits: Array, is_stamp: bool, base_known: bool, state: Array,
          restart: bool, followed: Array, elapsed: float, result: Array, forces: Array,
          ) -> tuple[bool, bool, bool]:
    """
    Check a result and write the forces to publish.

    Return whether it is answered, exceeds a limit, and is a jump; see Outputs.
    """
    finite = is_stamp
    for k in range(RESULT):
        finite = finite and math.isfinite(result[k])
    if not finite:
        return False, False, False
    if restart:
        forget(state)
    condition = result[CONDITION]
    advance(state, settings, result[DETERMINANT], result[DETERMINANT_RATE],
            condition)
    solved = condition < UNSOLVABLE_CONDITION and base_known
    for leg in range(6):
        if not solved:
            result[FORCES.start + leg] = np.nan
    moving, loaded = any_exceeded(limits, result)
    jumped = jumps(limits, result[LENGTHS], followed, elapsed)
    suppressed = ((state[STOPPED] > 0.0 and settings[SUPPRESS.start] > 0.0)
                  or ((moving or jumped) and settings[LIMITS_SUPPRESS.start] > 0.0))
    for leg in range(6):
        force, most = result[FORCES.start + leg], settings[FORCE_MAX.start + leg]
        forces[leg] = min(max(force, -most), most) if solved and not suppressed else np.nan
    return True, moving or loaded or jumped, jumped


@entry_point('f8[::1]', 'i8[::1]', 'b1[::1]', 'b1[::1]', 'f8[::1]', 'f8[::1]', 'i8[::1]',
             'f8[::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'b1[::1]', 'b1[::1]', 'b1[::1]')
def check_many(settings: Array, stamps: Stamps, bases_known: Flags, restarts: Flags,
               slack: Array, state: Array, followed_at: Stamps, followed: Array, results: Array,
               forces: Array, states: Array, answered: Flags, exceeding: Flags, jumped: Flags,
               ) -> None:
    """Check results in order, see Outputs; update ``followed`` and its stamp."""
    limits = settings[LIMITS]
    restart = False
    for n in range(len(results)):
        # If this one cannot be answered, the next one is the restart.
        restart = restart or restarts[n]
        is_stamp = -STAMPS_END <= stamps[n] < STAMPS_END
        elapsed = math.inf
        if is_stamp and not restart and stamps[n] > followed_at[0]:
            elapsed = (stamps[n] - followed_at[0]) * NANOSECOND + slack[n]
        answered[n], exceeding[n], jumped[n] = check(
            settings, limits, is_stamp, bases_known[n], state, restart, followed, elapsed,
            results[n], forces[n])
        restart = restart and not answered[n]
        if answered[n] and not jumped[n]:
            followed_at[0] = stamps[n]
            for leg in range(6):
                followed[leg] = results[n, LENGTHS.start + leg]
        for k in range(STATE):
            states[n, k] = state[k]
