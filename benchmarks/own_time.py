# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Own time of the node: from the bytes of the completing message to those of the answer, no DDS.

    PYTHONPATH=BUILD NEW/.venv/bin/python benchmarks/own_time.py

Each build is measured by its own calls, on the same setpoints; run the builds in turn, on a quiet
computer, and compare within one run.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import sys
import time
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
MS, COUNT = 1_000_000, 20_000


def setpoints(source: str) -> list[list[tuple[str, bytes]]]:
    """Return topics and bytes of each setpoint, at 1 kHz."""
    sys.path.insert(0, str(ROOT / 'test'))
    import messages

    found = []
    for n in range(1, COUNT + 1):
        stamp, x, v = n * MS, 0.05 * np.sin(1e-3 * n), 0.05 * np.cos(1e-3 * n)
        twist, accel = (v, 0.0, 0.0, 0.0, 0.0, 0.0), (-x, 0.0, 0.0, 0.0, 0.0, 0.0)
        found.append([
            ('setpoint/combined', messages.combined(
                stamp, (x, 0.0, 1.1), messages.UPRIGHT, twist, accel))]
            if source == 'combined' else [
                ('setpoint/pose', messages.pose(stamp, (x, 0.0, 1.1))),
                ('setpoint/twist', messages.twist(stamp, twist)),
                ('setpoint/accel', messages.accel(stamp, accel))])
    return found


def answering(parameters: Any, published: Callable[[Any], object],
              ) -> Callable[[str, bytes], object]:
    """Return what this build does with a message, up to the bytes to publish."""
    from stewart_dynamics.setpoints.joining import Setpoints
    from stewart_dynamics.setpoints.output_messages import OutputMessages
    from stewart_dynamics.setpoints.step import FIRST, Step

    of: Any = Setpoints(parameters, print, print)
    step = Step(parameters)
    messages: Any = OutputMessages(parameters)
    if hasattr(of, 'answer_setpoints'):
        of.answer_setpoints(step, messages, published)
        return lambda topic, data: of.join_message(topic, data, int)
    state: Any = FIRST
    write = messages.bound_to(step) if hasattr(messages, 'bound_to') else None

    def follow(topic: str, data: bytes) -> None:
        nonlocal state
        setpoint = (of.join_message(topic, data, int) if hasattr(of, 'join_message')
                    else of.take([(topic, data, int)]))
        if len(setpoint.stamps):
            outputs = step(setpoint, state)
            state = outputs.state
            published(write() if write else messages.of(outputs)[0][2].tobytes())

    return follow


def main() -> None:
    """Print the times of both sources of setpoints."""
    import stewart_dynamics
    from stewart_dynamics import Parameters

    for source in ('separate', 'combined'):
        given = setpoints(source)
        ends: list[int] = []
        take = answering(Parameters.from_yaml(ROOT / 'config' / 'platform.yaml').replaced(
            {'setpoint.source': source}),
            lambda found, ends=ends: ends.append(time.perf_counter_ns()))  # type: ignore[misc]
        times = []
        for *others, last in given:
            for message in others:
                take(*message)
            begin = time.perf_counter_ns()
            take(*last)
            times.append(ends[-1] - begin)
        low, middle = np.percentile(times, [20, 50]) / 1000.0
        print(f'{stewart_dynamics.__file__}: {source}: {low:.2f} us (20 %), {middle:.2f} us '
              f'(median) of {len(ends)}')


if __name__ == '__main__':
    main()
