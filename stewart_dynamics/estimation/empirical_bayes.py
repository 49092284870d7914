# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
How much of a spread is real: the prior of many numbers from these numbers.

Empirical Bayes: B. Efron, "Large-Scale Inference", 2010, doi:10.1017/CBO9780511761362,
section 1.2.
"""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array


def real_share(variance: Array, by_chance: Array | float) -> Array:
    """Return the share of variances that is more than noise adds to them; 0 where none is."""
    share: Array = np.divide(variance - by_chance, variance, out=np.zeros(variance.shape),
                             where=variance > by_chance)
    return share
