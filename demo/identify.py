# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Identify a hexapod from a recorded motion, and print the tracking errors before and after.

``make demo-identify`` runs it. The controller's parameter file lacks a payload and has too little
friction. A motion is designed for it (``stewart_identify --design``) and recorded in the loop of
demo/loop.py, with noise; ``stewart_identify`` writes a new file from the recording. Another
motion is followed with either file.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import json
from pathlib import Path
import shutil
import subprocess
import time
from typing import Any, NamedTuple

from closed_loop import (
    BANDWIDTH, BEGIN, demonstration, Errors, Failure, PLOTS, Progress, Recorder, ROOT, save,
    stamp_of, UNITS)
from loop import Loop, RATE
import matplotlib
import numpy as np
import rclpy
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores
from stewart_dynamics.executables import executable
from stewart_dynamics.identification.identification_record import IdentificationResult
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.records import record_of
from stewart_dynamics.whole_file import write_json

matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402, I100, I202

# The simulated hexapod, which nobody knows: a payload of 40 kg beside the center, more friction.
TRUE: dict[str, Any] = {
    'platform.mass': 190.0, 'platform.center_of_mass': [0.06, -0.04, 0.17],
    'platform.inertia': [16.5, 0.1, -0.8, 17.0, 0.5, 24.0],
    'actuator.viscous_friction': 400.0, 'actuator.coulomb_friction': 50.0}
NOISE = {'noise.length': 1e-5, 'noise.rate': 1e-3, 'noise.force': 5.0}

BEFORE, AFTER, BEST = 'before', 'after', 'true parameters'
COLORS = {BEFORE: '#d55e00', AFTER: '#0072b2', BEST: '#009e73'}


class Run(NamedTuple):
    """A motion that was followed with one parameter file, and its errors."""

    name: str
    errors: Errors


class Value(NamedTuple):
    """A number of the file: before, identified with half of its interval, and true."""

    name: str
    unit: str
    before: float
    after: float
    half_width: float
    true: float


def stewart_identify(*arguments: str | Path | float) -> None:
    """Run stewart_identify; Failure with its line where it fails."""
    command = [str(each) for each in (executable('stewart_identify'), *arguments)]
    done = subprocess.run(command, text=True, capture_output=True, check=False)
    if done.returncode:
        said = (done.stderr.strip().splitlines() or ['no output'])[-1]
        raise Failure(said.removeprefix('stewart_identify: '))


def write_bag(folder: Path, states: Sequence[bytes]) -> int:
    """Write states of the legs as a bag of ~/measured_legs, and return how many."""
    stamped = sorted({stamp_of(each): each for each in states if stamp_of(each) > BEGIN}.items())
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection(
            '/stewart_dynamics/measured_legs', 'sensor_msgs/msg/JointState',
            typestore=get_typestore(Stores.ROS2_JAZZY))
        for stamp, data in stamped:
            writer.write(connection, stamp, data)
    return len(stamped)


def values(document: IdentificationResult, true: Parameters) -> list[Value]:
    """Return the identified numbers, of legs the one that is farthest from the truth."""
    found: dict[str, Value] = {}
    for each in document.parameters:
        name, _, last = each.name.rpartition('.')
        if name.startswith('actuator.'):
            truth = true[name][true.joints.index(last)]
        elif name == 'platform':
            name, truth = each.name, true.platform.mass
        else:
            axes = {'platform.center_of_mass': ('x', 'y', 'z'),
                    'platform.inertia': ('xx', 'xy', 'xz', 'yy', 'yz', 'zz')}[name]
            truth = true[name][axes.index(last)]
            name = each.name
        low, high = each.interval or (each.value, each.value)
        value = Value(name, each.unit, each.file, each.value, 0.5 * (high - low), float(truth))
        worst = found.get(name, value)
        if abs(value.after - value.true) >= abs(worst.after - worst.true):
            found[name] = value
    return list(found.values())


def table(numbers: Sequence[Value], runs: Sequence[Run]) -> str:
    """Return the table of parameters and that of tracking errors."""
    lines = [f'{"parameter":28}{"unit":>8}{"before":>10}{"identified, 95 %":>24}{"true":>10}']
    for each in numbers:
        after = f'{each.after:.5g} +- {each.half_width:.2g}'
        lines.append(f'{each.name:28}{each.unit:>8}{each.before:10.4g}{after:>24}'
                     f'{each.true:10.4g}')
    lines += ['', f'{"tracking error, RMS (peak)":28}' + ''.join(
        f'{f"{name} [{UNITS[name]}]":>20}' for name in ('all legs', 'position', 'rotation'))]
    for run in runs:
        line = f'{run.name:28}'
        for name in ('all legs', 'position', 'rotation'):
            peak = f'({run.errors.peak[name]:.0f})'
            line += f'{run.errors.rms[name]:13.1f} {peak:>6}'
        if run.name == AFTER:
            ratio = runs[0].errors.rms['all legs'] / run.errors.rms['all legs']
            line += f'   1/{ratio:.0f} of before'
        lines.append(line)
    return '\n'.join(lines)


def draw(path: Path, runs: Sequence[Run]) -> None:
    """Draw the errors of the legs over time, with either file."""
    pyplot.rcParams.update(PLOTS)
    figure, axes = pyplot.subplots(figsize=(9, 4), layout='constrained')
    labels = {BEFORE: 'forces by the file before', AFTER: 'by the identified file',
              BEST: 'by the true parameters'}
    for run in runs:
        errors = np.sqrt(np.mean(np.square(run.errors.legs), axis=1))
        axes.plot(run.errors.seconds, errors, color=COLORS[run.name], linewidth=1.2,
                  label=labels[run.name])
    axes.set(xlabel='time  [s]', ylabel='error of the leg lengths, RMS of six  [µm]',
             yscale='log', xlim=(0.0, runs[0].errors.seconds[-1]))
    axes.legend(frameon=False, ncols=3, loc='lower center', bbox_to_anchor=(0.5, 1.0))
    save(figure, path)


def main() -> None:
    """Design, record, identify, and follow another motion before and after."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--params', type=Path, default=ROOT / 'config' / 'platform.yaml',
                        help='parameter file of the controller before')
    parser.add_argument('--motion', type=Path, default=ROOT / 'config' / 'trajectory_loop.yaml',
                        help='parameter file of the motion that is followed before and after')
    parser.add_argument('--recorded', type=float, default=20.0,
                        help='duration of the designed motion [s]')
    parser.add_argument('--seconds', type=float, default=10.0,
                        help='duration of the other motion [s]')
    parser.add_argument('--output', type=Path, default=ROOT / 'identified_loop',
                        help='folder for the bag, the results, identify.json and identify.png')
    options = parser.parse_args()
    with demonstration('demo-identify'):
        begun = time.monotonic()
        folder = options.output
        shutil.rmtree(folder / 'bag', ignore_errors=True)
        folder.mkdir(parents=True, exist_ok=True)
        true = Parameters.from_yaml(options.params).replaced(TRUE)
        loop = Loop(options.params, options.motion, options.seconds, BANDWIDTH)
        print('designing the motion: about 30 s', flush=True)
        stewart_identify('--design', '--params', options.params, '--duration', options.recorded,
                         '--rate', RATE, '--output', folder / 'designed', '--force')
        rclpy.init()
        runs = []
        with Progress(options.recorded + 3 * options.seconds) as progress:
            progress.stage('recording', options.recorded)
            recorder = Recorder()
            Loop(options.params, folder / 'designed' / 'trajectory.yaml', options.recorded,
                 BANDWIDTH).errors(True, {**TRUE, **NOISE}, progress.reached, recorder)
            many = write_bag(folder / 'bag', recorder.states)
            stewart_identify(folder / 'bag', '--params', options.params,
                             '--output', folder / 'identified', '--force')
            true.to_yaml(folder / 'true.yaml')
            for name, hexapod in ((BEFORE, options.params),
                                  (AFTER, folder / 'identified' / 'identified.yaml'),
                                  (BEST, folder / 'true.yaml')):
                progress.stage(name, options.seconds)
                runs.append(Run(name, loop.errors(
                    True, TRUE, progress.reached, Recorder(), hexapod)))
        document = json.loads((folder / 'identified' / 'identification.json').read_text(
            encoding='utf-8'))
        numbers = values(record_of(IdentificationResult, document, true.leg_kind), true)
        print(f'\n{many} measurements of the legs in {options.recorded:g} s, with noise of '
              f'{NOISE["noise.force"]:g} N; of six legs the worst\n\n{table(numbers, runs)}\n')
        draw(folder / 'identify.png', runs)
        write_json(folder / 'identify.json', {
            'measurements': many, 'seconds': options.recorded, 'noise': NOISE, 'units': UNITS,
            'parameters': [each._asdict() for each in numbers],
            'runs': [{'name': run.name, 'rms': run.errors.rms, 'peak': run.errors.peak}
                     for run in runs]})
        print(f'{time.monotonic() - begun:.0f} s; {folder}: identify.png, identify.json, '
              'identified/report.html')


if __name__ == '__main__':
    main()
