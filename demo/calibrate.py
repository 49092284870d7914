# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Calibrate a simulated hexapod whose joints are off, and print the pose errors before and after.

``make demo-calibrate`` runs it. The simulated hexapod has joints and zero lengths that are a
millimeter off the file of the controller. Poses are designed (``stewart_calibrate --design``) and
measured with the noise of a tracker; ``stewart_calibrate`` writes a new file from them. A motion
is followed with the file of the drawing, the calibrated one and the true one, in the loop of
demo/loop.py.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
import shutil
import subprocess
import time
from typing import NamedTuple

from closed_loop import (
    BANDWIDTH, demonstration, Errors, Failure, PLOTS, Progress, Recorder, ROOT, save)
from loop import Loop
import matplotlib
import numpy as np
import rclpy
from stewart_dynamics import Parameters, Pose, StewartPlatform
from stewart_dynamics.calibration.measured_poses import poses_csv, read_poses
from stewart_dynamics.executables import executable
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.program import folder
from stewart_dynamics.whole_file import write_files, write_json

matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402, I100, I202

GEOMETRY = ('geometry.base_joints', 'geometry.platform_joints', 'geometry.zero_length')
# Standard deviation of the joints, and noise of the tracker [m, rad].
DEVIATION, NOISE, SEED = 1e-3, 1e-5, 7
BEFORE, AFTER, BEST = 'drawing', 'calibrated', 'true geometry'
COLORS = {BEFORE: '#d55e00', AFTER: '#0072b2', BEST: '#009e73'}
# The controller pulls the legs to where its file has them [s].
SETTLING = 1.0


class Run(NamedTuple):
    """A motion that was followed with one parameter file, and its errors."""

    name: str
    errors: Errors


def stewart_calibrate(*arguments: str | Path | float) -> str:
    """Run stewart_calibrate; Failure with its line where it fails."""
    command = [str(each) for each in (executable('stewart_calibrate'), *arguments)]
    done = subprocess.run(command, text=True, capture_output=True, check=False)
    if done.returncode:
        said = (done.stderr.strip().splitlines() or ['no output'])[-1]
        raise Failure(said.removeprefix('stewart_calibrate: '))
    return done.stdout


def real_hexapod(drawing: Parameters, random: np.random.Generator) -> Parameters:
    """Return the hexapod as it was built: each number off by a millimeter or so."""
    return drawing.replaced({
        name: (np.broadcast_to(drawing[name], (6,) if name == GEOMETRY[2] else (6, 3))
               + random.normal(0.0, DEVIATION, (6,) if name == GEOMETRY[2] else (6, 3))).tolist()
        for name in GEOMETRY})


def measure(real: Parameters, poses: Path, random: np.random.Generator) -> str:
    """Return the poses that a tracker measures where the legs have the commanded positions."""
    commanded = read_poses(poses, real)
    true = StewartPlatform(real).forward_kinematics(
        commanded.positions + real.geometry.zero_length, commanded.poses)
    count = len(commanded.positions)
    turns = from_euler(random.normal(0.0, NOISE, (count, 3)))
    return poses_csv(real.joints, commanded.positions, Pose(
        true.position + random.normal(0.0, NOISE, (count, 3)), turns @ true.rotation))


def figures(run: Run) -> tuple[float, float, float]:
    """Return position [um]: RMS and largest; rotation [urad]: RMS; after the legs have settled."""
    later = run.errors.seconds > SETTLING
    position, rotation = run.errors.position[later], run.errors.rotation[later]
    return (float(np.sqrt(np.mean(position ** 2))), float(position.max()),
            float(np.sqrt(np.mean(rotation ** 2))))


def draw(path: Path, runs: list[Run]) -> None:
    """Draw the pose errors of all runs over time."""
    pyplot.rcParams.update(PLOTS)
    figure, panels = pyplot.subplots(1, 2, figsize=(11, 4), layout='constrained')
    for axes, kind, unit in zip(panels, ('position', 'rotation'), ('µm', 'µrad'), strict=True):
        for run in runs:
            axes.plot(run.errors.seconds, getattr(run.errors, kind), color=COLORS[run.name],
                      linewidth=1.2, label=run.name)
        axes.set(title=f'error of the {kind}  [{unit}]', xlabel='time  [s]', yscale='log',
                 xlim=(0.0, runs[0].errors.seconds[-1]))
    panels[0].legend(frameon=False, title='geometry of the controller')
    save(figure, path)


def main() -> None:
    """Design, measure, calibrate, and follow a motion with three files."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--params', type=Path, default=ROOT / 'config' / 'platform.yaml',
                        help='parameter file of the hexapod as it is drawn')
    parser.add_argument('--motion', type=Path, default=ROOT / 'config' / 'trajectory_loop.yaml',
                        help='parameter file of the motion, which must begin at rest')
    parser.add_argument('--poses', type=int, default=40, help='number of measured poses')
    parser.add_argument('--seconds', type=float, default=6.0, help='duration of the motion [s]')
    parser.add_argument('--output', type=folder, default=ROOT / 'calibrated_demo',
                        help='folder of the results')
    options = parser.parse_args()
    random = np.random.default_rng(SEED)
    with demonstration('demo-calibrate'):
        shutil.rmtree(options.output, ignore_errors=True)
        options.output.mkdir(parents=True)
        designed, results = options.output / 'designed', options.output / 'calibrated'
        print(stewart_calibrate('--design', options.poses, '--params', options.params,
                                '--output', designed), flush=True)
        drawing = Parameters.from_yaml(options.params)
        real = real_hexapod(drawing, random)
        true = options.output / 'true.yaml'
        real.to_yaml(true)
        measured = options.output / 'measured.csv'
        write_files({measured: measure(real, designed / 'poses.csv', random)})
        stewart_calibrate(measured, '--params', options.params, '--output', results)
        held = json.loads((results / 'calibration.json').read_text())['validation']
        print(f'held-out poses: {1e6 * held["before"]["position_rms_m"]:.0f} um by the drawing, '
              f'{1e6 * held["after"]["position_rms_m"]:.1f} um calibrated', flush=True)
        loop = Loop(options.params, options.motion, options.seconds, BANDWIDTH)
        simulated = {name: real[name].ravel().tolist() for name in GEOMETRY}
        runs: list[Run] = []
        rclpy.init()
        begun = time.monotonic()
        files = {BEFORE: options.params, AFTER: results / 'calibrated.yaml', BEST: true}
        with Progress(3 * options.seconds) as progress:
            for name, file in files.items():
                progress.stage(name, options.seconds)
                runs.append(Run(name, loop.errors(
                    True, simulated, progress.reached, Recorder(), file)))
        print(f'\n{"pose error with":18}{"RMS":>10}{"largest":>12}{"rotation, RMS":>18}')
        for run in runs:
            rms, largest, rotation = figures(run)
            print(f'{run.name:18}{rms:7.1f} um{largest:9.1f} um{rotation:13.1f} urad')
        draw(options.output / 'calibration.png', runs)
        write_json(options.output / 'calibration.json', {
            run.name: dict(zip(('position_rms_um', 'position_max_um', 'rotation_rms_urad'),
                               figures(run), strict=True)) for run in runs})
        print(f'\n{time.monotonic() - begun:.0f} s; {options.output}: calibration.png, '
              'calibrated/report.html')


if __name__ == '__main__':
    main()
