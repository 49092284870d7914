# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Options of an identification and of the design of a motion."""

from __future__ import annotations

from typing import NamedTuple

from stewart_dynamics.identification.unknowns import DEFAULT
from stewart_dynamics.program import NODE
from stewart_dynamics.reporting.estimates import HOLD_OUT

CUTOFF = 10.0


class IdentificationOptions(NamedTuple):
    """Options of an identification."""

    node: str = NODE  # node name: the prefix of the usual topic
    measured: str | None = None  # topic of the measured legs; None: the usual one
    efforts: str | None = None  # topic of the efforts; None: the topic of the measured legs
    kinds: tuple[str, ...] = DEFAULT  # parameters to be identified, from ``unknowns.KINDS``
    motor_torque: bool = False  # efforts are motor torques [N m]
    motor_current: bool = False  # efforts are motor currents [A]
    cutoff: float = CUTOFF  # cut-off frequency of the filter on regressor and efforts [Hz]
    hold_out: float = HOLD_OUT  # fraction at the end of each bag that validates a fit to the rest
    delay: bool = True  # estimate the delay of the efforts
    accept_mistakes: bool = False  # write results although a possible error is found
    report: bool = True  # write report.html
    force: bool = False  # replace existing results
    run: str = ''


class DesignOptions(NamedTuple):
    """Options of a design."""

    kinds: tuple[str, ...] = DEFAULT  # parameters to be identified, from ``unknowns.KINDS``
    duration: float = 60.0  # duration of the motion [s]
    frequency: float = 2.0  # frequency of the highest harmonic [Hz]
    harmonics: int = 10
    amplitude: float | None = None
    """Largest displacement [m]; rotations: divided by the characteristic length."""
    center: tuple[float, ...] | None = None
    """Center of the motion, X Y Z alpha beta gamma [m, rad]; None: home."""
    noise: float | None = None
    """Standard deviation of the efforts, for the predicted intervals; None: a usual one."""
    rate: float = 500.0  # rate of setpoints and measured efforts [Hz]
    cutoff: float = CUTOFF  # that of the identification [Hz]
    generations: int = 400
    seed: int = 0
