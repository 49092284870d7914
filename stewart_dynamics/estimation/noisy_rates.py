# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""True rates from rates that are measured with noise."""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.estimation.empirical_bayes import real_share


def rates_in_noise(measured: Array, noise: Array) -> tuple[Array, Array]:
    """
    Return the means and deviations (N, 6) of the true rates at uniform times [m/s].

    Before the measurement, the rates (N, 6) are a parabola in time and a white deviation from it,
    as large as the measured rates show beside the deviation of their noise (6,)
    (``empirical_bayes``).
    """
    count = len(measured)
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, count), 3))
    curve = basis @ (basis.T @ measured)
    variance = np.sum((measured - curve) ** 2, axis=0) / max(count - 3, 1)
    noise = noise ** 2
    share = real_share(variance, noise)
    of_curve = np.sum(basis ** 2, axis=1)[:, None] * noise
    return (curve + share * (measured - curve),
            np.sqrt(share * noise + (1.0 - share) ** 2 * of_curve))
