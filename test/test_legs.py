# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Kinds of legs: features that a kind lacks, and all that a further kind needs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import subprocess
import sys

import numpy as np
import pytest
from referees import ROOT
from stewart_dynamics import (
    approach, calibrate, Capability, check_planned_trajectory, MotionCueing, ParameterError,
    Parameters, Pose, StewartPlatform)
from stewart_dynamics.calibration.pose_design import design_poses
from stewart_dynamics.cueing.cueing_parameters import CueingParameters
from stewart_dynamics.export.c_project import c_project
from stewart_dynamics.export.drive_files import drive_files
from stewart_dynamics.export.fmu import fmu
from stewart_dynamics.export.linuxcnc import hal_lines
from stewart_dynamics.identification.identification_options import IdentificationOptions
from stewart_dynamics.identification.identify import Identification
from stewart_dynamics.identification.motion_design import design, DesignOptions
from stewart_dynamics.legs import CRANK, require_kind, TELESCOPIC
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.planned.trajectory_messages import answer, NOT_AVAILABLE
from stewart_dynamics.program import BAD_INPUT
from stewart_dynamics.response.recorded_response import RecordedResponse

CONFIG = ROOT / 'config'
TELESCOPIC_FILE, CRANK_FILE = CONFIG / 'platform.yaml', CONFIG / 'crank_platform.yaml'
CRANKS = Parameters.from_yaml(CRANK_FILE)
NOT_FOR_CRANKS = 'legs.crank.length: {}: available for telescopic legs alone'

# Arguments of each program, and the feature that hexapods with cranks lack.
PROGRAMS = {
    'stewart_calibrate poses.csv': 'calibration', 'stewart_calibrate --design 20': 'calibration',
    'stewart_cueing_report vehicle.csv': 'motion cueing',
    'stewart_export': 'exported source', 'stewart_export --fmu --drives --linuxcnc':
    'exported source',
    'stewart_identify bag': 'identification', 'stewart_identify --design': 'identification',
    'stewart_replay bag --response --measured /legs': 'responses'}
NODES = {
    f'stewart_cueing --ros-args --params-file {CRANK_FILE}': 'motion cueing',
    'stewart_trajectory --ros-args -p motion.type:=response -p '
    'motion.initial:=[0.0,0.0,0.65,0.0,0.0,0.0] -p '
    f'motion.response.params_file:={CRANK_FILE}': 'motion response within limits'}


def run(folder: Path, program: str, *arguments: str | Path) -> tuple[int, str, str]:
    """Return the exit code of an installed program, and what it prints."""
    done = subprocess.run([Path(sys.executable).with_name(program), *arguments], cwd=folder,
                          capture_output=True, text=True, timeout=300, check=False)
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize('command', PROGRAMS)
def test_a_program_that_does_not_know_a_kind_says_so_first(tmp_path: Path, command: str) -> None:
    program, *arguments = command.split()
    code, out, err = run(tmp_path, program, *arguments, '--params', CRANK_FILE, '--output',
                         tmp_path / 'results')
    assert (code, out) == (BAD_INPUT, '')
    assert err == f'{program}: {CRANK_FILE}: {NOT_FOR_CRANKS.format(PROGRAMS[command])}\n'
    assert not list(tmp_path.iterdir())


@pytest.mark.ros
@pytest.mark.parametrize('command', NODES)
def test_a_node_that_does_not_know_a_kind_does_not_start(tmp_path: Path, command: str) -> None:
    program, *arguments = command.split()
    code, out, err = run(tmp_path, program, *arguments)
    assert (code, out) == (1, '')
    assert err == f'{program}: {CRANK_FILE}: {NOT_FOR_CRANKS.format(NODES[command])}\n'


def planned(platform: StewartPlatform) -> object:
    return check_planned_trajectory(
        platform, [0.0, 1.0], Motion.from_pose(Pose(np.zeros((2, 3)), [np.eye(3)] * 2)))


def responses(platform: StewartPlatform) -> object:
    return RecordedResponse(
        platform.parameters, {'measured': '/legs'}, lambda *rejected: None)


CALLS: dict[str, Callable[[StewartPlatform], object]] = {
    'clearance between legs': lambda platform: Capability(platform).clearance(
        platform.home_pose()),
    'planned trajectories': planned,
    'motion cueing': lambda platform: MotionCueing(platform.parameters),
    'calibration': lambda platform: calibrate(
        platform, np.zeros((20, 6)), Pose(np.zeros((20, 3)), [np.eye(3)] * 20)),
    'calibration ': lambda platform: design_poses(platform, 20),
    'identification': lambda platform: Identification(
        platform.parameters, IdentificationOptions()),
    'identification ': lambda platform: design(platform.parameters, DesignOptions()),
    'exported source': lambda platform: c_project(platform.parameters, 'rig'),
    'exported source ': lambda platform: fmu(platform.parameters, 'rig'),
    '--drives': lambda platform: drive_files(platform.parameters, 'rig'),
    '--linuxcnc': lambda platform: hal_lines(platform.parameters),
    'responses': responses,
    'motion cueing ': lambda platform: CueingParameters(
        platform.parameters.given, platform.parameters.source)}


@pytest.mark.parametrize('feature', CALLS)
def test_a_call_that_does_not_know_a_kind_raises_one_line(feature: str) -> None:
    with pytest.raises(ParameterError) as found:
        CALLS[feature](StewartPlatform(CRANKS))
    assert str(found.value) == f'{CRANK_FILE}: {NOT_FOR_CRANKS.format(feature.strip())}'


def test_an_approach_and_a_planned_trajectory_of_another_kind_are_rejected() -> None:
    home = StewartPlatform(CRANKS).home_pose()
    with pytest.raises(ParameterError, match='planned trajectories: available for telescopic'):
        approach(StewartPlatform(CRANKS), home, home)
    outcome, = answer(CRANKS, (0.0,) * 6, b'')
    assert outcome is not None
    assert outcome.reason == NOT_AVAILABLE
    assert outcome.message == (f'rejected: {NOT_AVAILABLE}: {CRANK_FILE}: '
                               + NOT_FOR_CRANKS.format('planned trajectories'))


def test_a_feature_may_know_several_kinds() -> None:
    telescopic = Parameters.from_yaml(TELESCOPIC_FILE)
    for parameters in (telescopic, CRANKS):
        require_kind(parameters, 'a feature', TELESCOPIC, CRANK)
    require_kind(CRANKS, 'a feature', CRANK)
    with pytest.raises(ParameterError) as found:
        require_kind(CRANKS, 'a feature')
    assert str(found.value) == f'{CRANK_FILE}: {NOT_FOR_CRANKS.format("a feature")}'
