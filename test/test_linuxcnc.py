# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The HAL lines for genhexkins: its joints are the library's legs and drives.

Here the kinematics of genhexkins are a few lines of their own, which the real ones agree with, see
docs/linuxcnc.md.
"""

from __future__ import annotations

import math
from pathlib import Path
import re
from typing import Any

import numpy as np
from programs import call
import pytest
from referees import Array, random_motion, rng, ROOT
from snapshot import Snapshot
from stewart_dynamics import Motion, ParameterError, Parameters, StewartPlatform
from stewart_dynamics.export import main
from stewart_dynamics.export.linuxcnc import hal_lines
from stewart_dynamics.mechanics.drives.motors import motor_ratio
from stewart_dynamics.mechanics.frames.rotation import to_euler

EXAMPLE = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
TURNING = EXAMPLE.replaced({
    'actuator.screw_lead': 0.01, 'actuator.reflected_mass': None, 'drive.motor_inertia': 1e-4,
    'drive.gear_ratio': 2.0, 'drive.screw_rotation': 'universal'})


def pins(text: str) -> dict[str, float]:
    """Return the values that the HAL file sets, by the names of their pins."""
    lines = [line.split() for line in text.splitlines() if line and line[0] != '#']
    assert all(len(words) == 3 and words[0] == 'setp' for words in lines)
    assert len({words[1] for words in lines}) == len(lines)
    return {words[1].removeprefix('genhexkins.'): float(words[2]) for words in lines}


def unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def joints(values: dict[str, float], motion: Motion) -> Array:
    """Return the (N, 6) joints [mm] of genhexkins, by X Y Z [mm] and A B C [degrees]."""
    def vectors(name: str) -> Array:
        return np.array([[values[f'{name}.{leg}.{axis}'] for axis in 'xyz'] for leg in range(6)])

    a, b, c = np.moveaxis(np.radians(np.degrees(to_euler(motion.rotation))), -1, 0)
    turns = np.empty((*np.shape(a), 3, 3))
    turns[..., 0, :] = np.stack([
        np.cos(b) * np.cos(c), np.sin(a) * np.sin(b) * np.cos(c) - np.cos(a) * np.sin(c),
        np.cos(a) * np.sin(b) * np.cos(c) + np.sin(a) * np.sin(c)], -1)
    turns[..., 1, :] = np.stack([
        np.cos(b) * np.sin(c), np.sin(a) * np.sin(b) * np.sin(c) + np.cos(a) * np.cos(c),
        np.cos(a) * np.sin(b) * np.sin(c) - np.sin(a) * np.cos(c)], -1)
    turns[..., 2, :] = np.stack([-np.sin(b), np.sin(a) * np.cos(b), np.cos(a) * np.cos(b)], -1)
    legs = 1e3 * motion.position[..., None, :] + vectors('platform') @ np.swapaxes(
        turns, -1, -2) - vectors('base')
    lengths = np.asarray(np.linalg.norm(legs, axis=-1))
    if values['screw-lead'] == 0.0:
        return lengths
    s = unit(legs)
    across_base = np.cross(s, np.cross(vectors('base-n'), s))
    across_platform = np.cross(vectors('platform-n') @ np.swapaxes(turns, -1, -2), s)
    sines = np.sum(unit(across_base) * unit(across_platform), axis=-1)
    return np.asarray(lengths + values['screw-lead'] * np.arcsin(sines) / (2.0 * math.pi))


def test_joints_are_the_lengths_of_the_legs() -> None:
    motion = random_motion(EXAMPLE, rng(1), 500)
    expected = StewartPlatform(EXAMPLE).inverse_kinematics(motion)
    found = joints(pins(hal_lines(EXAMPLE)), motion)
    np.testing.assert_allclose(1e-3 * found, expected, rtol=0.0, atol=2e-15)


@pytest.mark.parametrize('changes', [
    {}, {'drive.screw_hand': 'left'},
    {'drive.base_universal_axes': [1.0, 0.3, 0.0] * 6,
     'drive.platform_universal_axes': [1.0, 0.3, 0.2] * 6}])
def test_joints_of_turning_screws_are_the_drives(changes: dict[str, Any]) -> None:
    """Sign and size of the correction: 0.8 mm here, which the other sense would double."""
    parameters = TURNING.replaced(changes)
    platform, motion = StewartPlatform(parameters), random_motion(parameters, rng(2), 500)
    lengths = platform.inverse_kinematics(motion)
    expected = parameters['geometry.zero_length'] + platform.motors(motion).angles / motor_ratio(
        parameters)
    found = joints(pins(hal_lines(parameters)), motion)
    np.testing.assert_allclose(1e-3 * found, expected, rtol=0.0, atol=2e-15)
    assert np.abs(expected - lengths).max() > 3e-4


def test_comments_have_the_lines_of_the_ini_file() -> None:
    text = hal_lines(TURNING)
    home = StewartPlatform(TURNING).home_pose()
    found = [float(each) for each in re.findall(r'\[TRAJ\] HOME = (.*)', text)[0].split()]
    assert found == pytest.approx([*(1e3 * home.position), 0.0, 0.0, 0.0], abs=1e-11)
    at_home = re.findall(
        r'\[JOINT_\d\] HOME = (\S+), MIN_LIMIT = 950, MAX_LIMIT = 1650, MAX_VELOCITY = 500', text)
    assert [float(each) for each in at_home] == pytest.approx(
        joints(pins(text), Motion.from_pose(home)).tolist(), abs=1e-9)
    assert 'e-1' not in text and '-0\n' not in text
    unlimited = hal_lines(EXAMPLE.replaced({
        'limits.length_min': None, 'limits.length_max': None, 'geometry.zero_length': 0.0,
        'limits.velocity_max': None}))
    assert 'JOINT_0' not in unlimited and 'HOME' not in unlimited
    assert pins(unlimited) == pins(hal_lines(EXAMPLE))


def test_a_home_far_from_c_0_and_several_leads_are_rejected(snapshot: Snapshot) -> None:
    """Genhexkins would find no pose there; it has one lead."""
    turn = math.radians(60.0)
    about_z = np.array([[math.cos(turn), -math.sin(turn), 0.0],
                        [math.sin(turn), math.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    turned = EXAMPLE.replaced({
        'geometry.platform_joints': (EXAMPLE['geometry.platform_joints'] @ about_z).ravel(),
        'limits.length_min': 1.25, 'limits.length_max': 1.35})
    for parameters in (turned, TURNING.replaced({'actuator.screw_lead': [0.01] * 5 + [0.02]})):
        with snapshot.raises(ParameterError):
            hal_lines(parameters)
    leads = EXAMPLE.replaced({'actuator.screw_lead': [0.01] * 5 + [0.02]})
    assert pins(hal_lines(leads))['screw-lead'] == 0.0  # guided


def test_stewart_export_writes_them_on_request(tmp_path: Path) -> None:
    given = ['--params', str(ROOT / 'config' / 'platform.yaml'), '--output', str(tmp_path)]
    call(main, *given, '--linuxcnc', '--name', 'rig')
    assert (tmp_path / 'rig_linuxcnc.hal').read_text() == hal_lines(EXAMPLE)
