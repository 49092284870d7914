# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A hexapod as an FMU in FMPy: the platform heaves, and a driver gets in after half of the time.

Needs fmpy. Make the FMU first: stewart_export --params my_hexapod.yaml --output exported --fmu
"""

import argparse
import importlib
from pathlib import Path

import numpy as np

# From requirements-fmi.txt, which is installed apart from all others.
fmpy = importlib.import_module('fmpy')

AMPLITUDE, FREQUENCY = 0.02, 0.5  # [m], [Hz]
DRIVER = {'payload.mass': 82.0, 'payload.center_of_mass.z': 0.5}
OUTPUTS = [f'forces[{leg}]' for leg in range(1, 7)] + ['condition_number', 'status']


def heaving(home: float, times: np.ndarray) -> dict[str, np.ndarray]:
    """Return height, velocity and acceleration, which belong together."""
    turn = 2.0 * np.pi * FREQUENCY
    return {'position.z': home + AMPLITUDE * (1.0 - np.cos(turn * times)),
            'linear_velocity.z': AMPLITUDE * turn * np.sin(turn * times),
            'linear_acceleration.z': AMPLITUDE * turn ** 2 * np.cos(turn * times)}


def simulated(file: Path, seconds: float = 4.0, step: float = 0.001) -> np.ndarray:
    """Return times and outputs as FMPy gives them, a structured array."""
    times = step * np.arange(round(seconds / step) + 1)
    # At home, with unit quaternion and gravity, where not changed below.
    inputs = {each.name: np.full(len(times), float(each.start))
              for each in fmpy.read_model_description(file).modelVariables
              if each.causality == 'input'}
    inputs |= heaving(inputs['position.z'][0], times)
    inputs |= {name: np.where(times < 0.5 * seconds, 0.0, value) for name, value in DRIVER.items()}
    table = np.zeros(len(times), [('time', float), *((name, float) for name in inputs)])
    table['time'] = times
    for name, values in inputs.items():
        table[name] = values
    return fmpy.simulate_fmu(file, stop_time=seconds, output_interval=step, step_size=step,
                             input=table, output=OUTPUTS)


def main() -> None:
    """Simulate, and print what the legs carry before and after."""
    parser = argparse.ArgumentParser(description='Simulate the FMU of a hexapod in FMPy.')
    parser.add_argument('file', type=Path, metavar='FMU')
    found = simulated(parser.parse_args().file)
    forces = np.column_stack([found[name] for name in OUTPUTS[:6]])
    middle = len(found) // 2
    for words, part in (('empty', slice(1, middle)), ('with a driver', slice(middle + 2, None))):
        print(f'{words}: forces {np.round(forces[part].mean(axis=0)).astype(int).tolist()} N in '
              f'the mean, at most {np.abs(forces[part]).max():.0f} N')
    print(f'status 0 throughout: {not found["status"].any()}')


if __name__ == '__main__':
    main()
