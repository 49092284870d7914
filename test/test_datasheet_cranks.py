# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The datasheet of a hexapod with cranks: its figures applied in the dynamics, its page."""

from __future__ import annotations

import json
from pathlib import Path
import re
from typing import Any

from msgspec.structs import replace
import numpy as np
from programs import call
import pytest
from referees import ROOT
from stewart_dynamics import (
    Capability, Motion, Parameters, Pose, PoseError, StewartPlatform)
from stewart_dynamics.arrays import Array
from stewart_dynamics.datasheet import main
from stewart_dynamics.datasheet.datasheet import soft_legs
from stewart_dynamics.datasheet.datasheet_record import Box
from stewart_dynamics.datasheet.datasheet_text import box_verdict
from stewart_dynamics.datasheet.hexapod_drawing import Drawing
from stewart_dynamics.datasheet.motion_ratings import judged, uses
from stewart_dynamics.datasheet.pose_ratings import AXES, grid, KEYS, poses_of
from stewart_dynamics.datasheet.rated_hexapod import RatedHexapod
from stewart_dynamics.errors import ReachError
from stewart_dynamics.replay.recorded_motion import RecordedMotion

FILE = ROOT / 'config' / 'crank_platform.yaml'
PARAMETERS = Parameters.from_yaml(FILE)
PLATFORM = StewartPlatform(PARAMETERS)
HOME = PLATFORM.home_pose()
DIRECTIONS = np.repeat(np.eye(6), 2, axis=0) * np.tile([1.0, -1.0], 6)[:, None]
KG_CM = 0.0980665  # [N m]


def motion(rate: float = 3.0, height: float = 0.05) -> RecordedMotion:
    """Return a motion of one second along z."""
    t: Array = np.linspace(0.0, 1.0, 101, dtype=float)
    still = np.zeros((101, 3))

    def along(values: Array) -> Array:
        return np.outer(values, [0.0, 0.0, height])

    moving = Motion(HOME.position + along(np.sin(rate * t)), np.eye(3),
                    along(rate * np.cos(rate * t)), still,
                    along(-rate ** 2 * np.sin(rate * t)), still)
    return RecordedMotion(t, moving, np.zeros((101, 6)), None, [])


@pytest.fixture(scope='module')
def sheet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a datasheet with everything in it."""
    folder = tmp_path_factory.mktemp('capability')
    box, recording = folder / 'box.yaml', folder / 'motion.csv'
    box.write_text('x: 0.05\nz: [-0.02, 0.02]\nrx: 0.05\n')
    recorded = motion()
    rows = recorded.motion
    recording.write_text('t,x,y,z,roll,pitch,yaw,vx,vy,vz,wx,wy,wz,ax,ay,az,alx,aly,alz\n' + (
        '\n'.join(','.join(f'{each!r}' for each in map(float, (
            recorded.seconds[n], *rows.position[n], 0.0, 0.0, 0.0, *rows.linear_velocity[n],
            0.0, 0.0, 0.0, *rows.linear_acceleration[n], 0.0, 0.0, 0.0))) for n in range(101))))
    call(main, *[str(each) for each in ('--params', FILE, '--pivot', 0, 0, 0.3, '--box', box,
                                        '--motion', recording, '--leg-stiffness', 2e4, '--stuck',
                                        'leg_3', '--torque-unit', 'kgcm', '--output',
                                        folder / 'sheet', '--strict')])
    return folder / 'sheet'


@pytest.fixture(scope='module')
def figures(sheet: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads((sheet / 'datasheet.json').read_text())
    return document


def test_figures_are_those_of_the_library(figures: dict[str, Any]) -> None:
    c = Capability(PLATFORM)
    travel = c.travel(HOME, DIRECTIONS, [0.0, 0.0, 0.3])
    assert [figures['travel'][key]['value'] for key in KEYS] == pytest.approx(
        travel.value.tolist(), rel=1e-12)
    assert [figures['travel'][key]['limit'] for key in KEYS] == travel.limit.tolist()
    result = PLATFORM.inverse_dynamics(Motion.from_pose(HOME))
    drives = figures['drives']
    assert drives['torques'] == pytest.approx(result.torques.tolist(), rel=1e-9)
    assert drives['angles'] == pytest.approx(result.angles.tolist(), abs=1e-12)
    assert drives['lever_ratios'] == pytest.approx(
        (np.abs(result.levers) / 0.18415).tolist(), rel=1e-9)
    assert figures['velocity']['z+']['limit'] == 'crank_speed_max'
    assert figures['payload']['limit'] == 'crank_torque_max'
    assert figures['box']['possible']
    assert figures['motion']['possible']
    assert figures['motion']['between_setpoints']['reason'] is None
    assert figures['stiffness']['leg_stiffness'] == 2e4
    assert figures['stiffness']['frequencies'] == sorted(figures['stiffness']['frequencies'])
    assert figures['stuck_leg']['leg'] == 'leg_3'


def test_the_worst_lever_is_the_smallest_of_the_grid(figures: dict[str, Any]) -> None:
    ranges = np.array([figures['at_once']['all']['ranges'][axis] for axis in AXES])
    hexapod = RatedHexapod(PARAMETERS, None, np.array([0.0, 0.0, 0.3]))
    poses = poses_of(hexapod, grid(ranges, 3))
    levers = hexapod.platform.inverse_dynamics(Motion.from_pose(poses)).levers
    worst = figures['drives']['worst_lever']
    assert worst['value'] == pytest.approx(np.abs(levers).min() / 0.18415, rel=1e-9)
    assert worst['value'] > 0.1
    assert PARAMETERS.joints.index(worst['leg']) == np.abs(levers).min(axis=0).argmin()


def test_the_page_has_angles_levers_and_torques(sheet: Path, figures: dict[str, Any]) -> None:
    text = re.sub(r'<[^>]+>', ' ', (sheet / 'datasheet.html').read_text())
    for words in ('angle [°]', 'lever [%]', 'torque at rest [kg cm]', '−60 to 60',
                  'Leg: crank, rod', 'Reflected inertia of an actuator', 'keeps its angle',
                  'Drives of 20.00 N m/mrad', 'An angle is at 0 %', 'arrows: positive angles',
                  'by the largest speed of a crank or motor',
                  'by the largest torque of a crank or torque of a motor'):
        assert words in text, words
    assert 'of a leg' not in text and 'longest' not in text
    torque = figures['drives']['torques'][0] / KG_CM
    assert f'{torque:.2f}' in text
    assert f'{250.0 / KG_CM:.1f} kg cm' in text


def test_torques_are_in_newton_metres_by_default(tmp_path: Path) -> None:
    call(main, '--params', FILE, '--output', tmp_path / 'sheet')
    text = re.sub(r'<[^>]+>', ' ', (tmp_path / 'sheet' / 'datasheet.html').read_text())
    assert 'torque at rest [N m]' in text
    assert 'largest angle' in text and 'smallest angle' in text
    assert 'kg cm' not in text


def test_a_drawing_has_cranks_and_rods() -> None:
    drawing = Drawing(PARAMETERS, HOME)
    ends = drawing._anchors
    assert ends is not None
    assert np.linalg.norm(ends - PARAMETERS.geometry.base_joints, axis=1) == pytest.approx(
        np.full(6, 0.18415), rel=1e-12)
    joints = HOME.position + PARAMETERS.geometry.platform_joints
    assert np.linalg.norm(joints - ends, axis=1) == pytest.approx(
        np.full(6, 0.7239), rel=1e-12)
    assert drawing.top().svg().count('class="joint"') == 18


def test_a_motion_at_its_factor_uses_a_limit_whole() -> None:
    recorded = motion()
    used = uses(PLATFORM, recorded)
    found = judged(PLATFORM, recorded, used)
    k, rows = found.factor, recorded.motion.rows.copy()
    rows[:, 12:18] *= k
    rows[:, 18:] *= k * k
    used = uses(PLATFORM, recorded._replace(motion=Motion.of_rows(rows)))
    assert max(each.max() for each in used.values()) == pytest.approx(1.0, rel=1e-9)
    assert set(used) == {'angle', 'lever', 'speed', 'torque', 'rod force', 'singularity'}
    between = found.between_setpoints
    assert between.reason is None
    assert 0.99 * k < between.factor <= k
    assert between.limit == found.limit


@pytest.mark.parametrize(('height', 'changes', 'limit'), [
    (0.05, {'limits.angle_max': 0.2, 'limits.angle_min': -0.2}, 'angle_max'),
    (0.4, {'limits.angle_max': None, 'limits.angle_min': None}, 'lever_min'),
    (0.05, {'limits.lever_min': 0.95}, 'lever_min')])
def test_a_motion_past_a_limit_of_poses_is_possible_at_no_speed(
        height: float, changes: dict[str, Any], limit: str) -> None:
    platform, recorded = StewartPlatform(PARAMETERS.replaced(changes)), motion(3.0, height)
    found = judged(platform, recorded, uses(platform, recorded))
    assert (found.possible, found.factor, found.limit) == (False, 0.0, limit)


@pytest.mark.parametrize(('pose', 'error', 'words'), [
    ([0.0, 0.0, 1.2], ReachError, 'cannot reach'),
    ([0.0, 0.0, 0.85], PoseError, 'limits.angle_max')])
def test_a_pose_that_cannot_be_held_has_no_datasheet(
        pose: list[float], error: type[Exception], words: str, tmp_path: Path) -> None:
    with pytest.raises(error, match=words):
        RatedHexapod(PARAMETERS, Pose(pose, np.eye(3)))
    error = call(main, '--params', FILE, '--pose', *pose, '0', '0', '0', '--output',
                 tmp_path / 'sheet', code=2).err
    assert words in error.splitlines()[-1]


def test_natural_frequencies_are_those_with_held_motors() -> None:
    hexapod = RatedHexapod(PARAMETERS)
    held = Capability(StewartPlatform(PARAMETERS.replaced({'actuator.reflected_inertia': 0.0})))
    assert hexapod.frequencies(HOME, 2e4).tolist() == held.modes(HOME, 2e4).frequencies.tolist()
    assert (hexapod.frequencies(HOME, 2e4) > Capability(PLATFORM).modes(
        HOME, 2e4).frequencies).all()


def test_the_unit_of_a_stiffness_and_of_an_excess() -> None:
    words, = soft_legs(PARAMETERS, 20.0)
    assert words.startswith('--leg-stiffness: 20 N m/rad: six such drives and 160 kg have')
    assert not list(soft_legs(PARAMETERS, 2e4))
    box = Box('lever_min', 'leg_1', False, None, {}, 0.0123, {'x': 0.5}, [], [])
    assert box_verdict(box).startswith('lever of a crank (leg_1) exceeded by 0.01230 at')
    assert 'exceeded by 5.729 °' in box_verdict(replace(box, limit='angle_max', excess=0.1))
