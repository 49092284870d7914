# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Speed of motion cueing, and random flights and drives under the governor: limits exceeded.

Half of the motions are wild: steps of 5 g, spins, noise; the other half are those of vehicles.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from stewart_dynamics import Motion, MotionCueing, Parameters, StewartPlatform
from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.drives.motor_limits import MotorLimits
from stewart_dynamics.mechanics.drives.motors import Drives
from stewart_dynamics.mechanics.pose_limits import PoseLimits
from stewart_dynamics.mechanics.rows import CONDITION, DETERMINANT, FORCES, RATES

RATE = 250.0
PIECE = 40.0  # [s]


def vehicle(generator: np.random.Generator, times: Array, wild: bool) -> tuple[Array, Array]:
    """Return accelerations without gravity and angular velocities (N, 3) of a random motion."""
    n = len(times)
    inputs = np.zeros((n, 6))
    size = np.array([4.0, 4.0, 3.0, 0.5, 0.4, 0.5]) * generator.uniform(0.2, 1.5)
    if wild:
        size = np.array([25.0, 25.0, 25.0, 3.0, 3.0, 6.0]) * generator.uniform(0.1, 2.0)
    for axis in range(6):
        kind = generator.integers(4)
        if kind == 0:  # steps
            knots = np.sort(generator.uniform(0.0, times[-1], generator.integers(1, 40)))
            levels = generator.normal(size=len(knots) + 1)
            inputs[:, axis] = levels[np.searchsorted(knots, times)]
        elif kind == 1:  # oscillations
            for _ in range(4):
                inputs[:, axis] += np.sin(
                    generator.uniform(0.1, 15.0) * times + generator.uniform(0.0, 6.3)) / 2.0
        elif kind == 2:  # noise of a bandwidth
            knots = np.arange(0.0, times[-1] + 1.0, generator.uniform(0.05, 1.0))
            inputs[:, axis] = np.interp(times, knots, generator.normal(size=len(knots)))
        elif wild and generator.random() < 0.5:
            inputs[:, axis] = generator.normal(size=n)
    return inputs[:, :3] * size[:3], inputs[:, 3:] * size[3:]


def exceeded(platform: StewartPlatform, motion: Motion) -> int:
    """Return the number of samples that exceed any limit of the hexapod."""
    limits = PoseLimits(platform.parameters)
    results = platform.solve(motion.rows)
    values = limits.values(motion.rows, results)
    found = limits.exceeded(values, len(results))
    for name, each in (('limits.velocity_max', RATES), ('limits.force_max', FORCES)):
        if name in limits.limits.bounds:
            found |= limits.limits.exceeds(name, results[:, each]).any(axis=1)
    found |= ~np.isfinite(results).all(axis=1)
    found |= results[:, CONDITION] >= limits.stop_condition
    found |= results[:, DETERMINANT] * results[0, DETERMINANT] <= 0.0
    if platform.parameters.drives:
        motors = Drives(platform.parameters)(motion.rows, results)
        for values_of, bounds in MotorLimits(platform.parameters).excesses(
                motors, np.zeros((len(results), 6))).values():
            found |= (np.abs(values_of) > bounds * (1.0 + 1e-9)).any(axis=1)
    return int(found.sum())


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--params', default='config/platform.yaml')
    parser.add_argument('--seconds', type=float, default=10_000.0, help='of random motions')
    parser.add_argument('--seed', type=int, default=0)
    options = parser.parse_args()
    parameters = Parameters.from_yaml(options.params)
    cueing = MotionCueing(parameters.replaced({'cueing.input': 'acceleration'}))
    platform = StewartPlatform(parameters)
    times = np.arange(1_000_000) / RATE
    force = np.sin(times[:, None] * [1.0, 0.7, 3.0])
    begun = time.process_time()
    cueing.run(times, force, 0.2 * force)
    print(f'10^6 samples, governed: {time.process_time() - begun:.2f} s')
    generator = np.random.default_rng(options.seed)
    samples, wrong, held, begun = 0, 0, 0.0, time.process_time()
    steps = np.zeros(2)
    while samples < options.seconds * RATE:
        times = np.arange(PIECE * RATE) / RATE
        stream = cueing.stream()
        motion = stream.advance(times, *vehicle(generator, times, samples // len(times) % 2 == 0))
        samples += len(times)
        wrong += exceeded(platform, motion)
        held += sum(stream.held.values())
        steps = np.maximum(steps, [
            np.abs(np.diff(motion.position, axis=0)).max(),
            np.abs(np.diff(motion.linear_velocity, axis=0)).max()])
    print(f'{samples / RATE:.0f} s of random motions, seed {options.seed}: {wrong} of {samples} '
          f'samples exceed a limit; held back {held / (samples / RATE):.1%}; largest step '
          f'{steps[0] * 1e3:.2f} mm, {steps[1]:.3f} m/s; '
          f'{(time.process_time() - begun) / samples * 1e6:.1f} us a sample')


if __name__ == '__main__':
    main()
