# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
The motors in the step of a setpoint: their cost, and that of their messages.

Run by hand; see README.md beside this file.
"""

from __future__ import annotations

import argparse
import timeit
from typing import Any

from inverse_dynamics import markdown, measured_on, write
from latency import PARAMETERS
import numpy as np

from stewart_dynamics import Motion, Parameters
from stewart_dynamics.setpoints.output_messages import OutputMessages
from stewart_dynamics.setpoints.step import Batch, Step

BEGIN, END = '<!-- drives: begin -->', '<!-- drives: end -->'
CALLS, ROUNDS = 100, 3000
STAMP = 1_700_000_000 * 10 ** 9

DRIVES: dict[str, Any] = {
    'actuator.reflected_mass': None, 'actuator.screw_lead': 0.01, 'drive.gear_ratio': 2.0,
    'drive.motor_inertia': 2e-5, 'drive.efficiency': 0.9, 'drive.torque_max': 30.0,
    'drive.torque_speed': [0.0, 30.0, 600.0, 20.0, 900.0, 1.0], 'drive.speed_max': 900.0}
THERMAL = {'drive.torque_constant': 1.0, 'drive.resistance': 1.0,
           'drive.thermal_resistance': 1.0, 'drive.thermal_time_constant': 100.0}
CASES: dict[str, dict[str, Any]] = {
    'without `drive.*`': {}, 'with `drive.*`': DRIVES,
    'with temperatures': DRIVES | THERMAL,
    'with temperatures, screws that turn with their legs': DRIVES | THERMAL | {
        'drive.screw_rotation': 'universal'}}


def least(call: Any) -> float:
    """Return the least time of a call [us] in many rounds: others interrupt some of them."""
    return min(timeit.repeat(call, number=CALLS, repeat=ROUNDS)) / CALLS * 1e6


def measure() -> list[str]:
    """Return the lines for the page."""
    motion = Motion([0.0, 0.0, 1.1], np.eye(3), [0.05, 0.02, 0.03], [0.1, 0.1, 0.1],
                    [1.0, 1.0, 1.0])
    setpoint = Batch.from_parts(STAMP, motion.rows)
    cells: list[tuple[str, ...]] = [
        ('', 'step [us]', 'messages [us]', 'step, more [us]', 'messages, more [us]')]
    first = 0.0, 0.0
    for name, changes in CASES.items():
        parameters = Parameters.from_yaml(PARAMETERS).replaced(changes)
        step, messages = Step(parameters), OutputMessages(parameters)
        before = step(setpoint)
        assert before.answered[0] and not before.exceeding[0]
        later = setpoint._replace(stamps=setpoint.stamps + 10 ** 6)
        outputs = step(later, before.state)
        assert outputs.answered[0]
        times = (least(lambda: step(later, before.state)),  # noqa: B023
                 least(lambda: list(messages.write_outputs(outputs))))  # noqa: B023
        first = first if changes else times
        cells.append((name, *(f'{time:.2f}' for time in times), *(
            f'{time - of_legs:.2f}' if changes else '' for time, of_legs in zip(
                times, first, strict=True))))
    return ['', *markdown(cells), '',
            f'{measured_on()} Least of {ROUNDS} rounds of {CALLS} calls.', '']


def main() -> None:
    """Measure, and print the table or write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--write', action='store_true', help='into results/')
    arguments = parser.parse_args()
    lines = measure()
    if arguments.write:
        write(lines, BEGIN, END)
    else:
        print(*lines, sep='\n')


if __name__ == '__main__':
    main()
