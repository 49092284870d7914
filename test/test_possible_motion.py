# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Changes with which a motion would be possible: they are possible, and little less is not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from programs import call
import pytest
from referees import ROOT
from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.datasheet.datasheet_command_line import main
from stewart_dynamics.datasheet.motion_ratings import judged, uses
from stewart_dynamics.replay.recorded_motion import read_motion, RecordedMotion
from stewart_dynamics.replay.replay_options import Options

FILE = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
BAG = ROOT / 'bags' / 'clear'
# Files in which the motion is not possible, and the changes that make it possible.
CASES: dict[str, tuple[dict[str, Any], list[str]]] = {
    'slow legs': ({'limits.velocity_max': 0.05}, ['amplitude', 'speed']),
    'longer legs': ({'limits.length_min': 1.2, 'limits.length_max': 1.9}, ['amplitude', 'height']),
    'short legs': ({'limits.length_min': 0.7, 'limits.length_max': 1.3}, ['amplitude']),
    'weak legs': ({'limits.force_max': 400.0}, ['amplitude']),
    'hanging': ({'limits.length_min': 1.2, 'limits.length_max': 1.9,
                 'gravity': [0.0, 0.0, 9.80665], 'geometry.platform_side': 'positive'},
                ['amplitude', 'height'])}


@pytest.fixture(scope='module')
def recorded() -> RecordedMotion:
    return read_motion(BAG, FILE, Options())


def is_possible(platform: StewartPlatform, recorded: RecordedMotion, change: str, by: float,
                ) -> bool:
    """Return whether a changed motion is possible; the change is computed independently."""
    m = recorded.motion
    position, rates = m.position.copy(), [m.linear_velocity, m.angular_velocity,
                                          m.linear_acceleration, m.angular_acceleration]
    if change == 'height':
        position[:, 2] += by
    elif change == 'speed':
        rates = [by * each for each in rates[:2]] + [by ** 2 * each for each in rates[2:]]
    else:  # small turns from a first pose without one
        from scipy.spatial.transform import Rotation
        turns = Rotation.from_matrix(m.rotation.copy())
        first = turns[0]
        small = Rotation.from_rotvec(by * (turns * first.inv()).as_rotvec()) * first
        changed = Motion(position[0] + by * (position - position[0]), small.as_matrix(),
                         *(by * each for each in rates))
        return judged(platform, recorded._replace(motion=changed), uses(
            platform, recorded._replace(motion=changed))).possible
    changed = Motion(position, m.rotation, *rates)
    used = uses(platform, recorded._replace(motion=changed))
    return all(each.max() <= 1.0 + 1e-9 for each in used.values())


@pytest.mark.parametrize('name', CASES)
def test_a_motion_is_possible_with_each_change_and_not_with_less(
        name: str, recorded: RecordedMotion) -> None:
    changes, expected = CASES[name]
    platform = StewartPlatform(FILE.replaced(changes))
    found = judged(platform, recorded, uses(platform, recorded))
    assert not found.possible
    assert [each.change for each in found.possible_with] == expected
    for each in found.possible_with:
        change, value = each.change, each.value
        assert is_possible(platform, recorded, change, value)
        less = value - np.sign(value) * 0.01 if change == 'height' else value + 0.03
        assert not is_possible(platform, recorded, change, less)
    words = ' '.join(each.words for each in found.possible_with)
    assert ('higher' in words) == (name == 'longer legs')
    assert ('lower' in words) == (name == 'hanging')


@pytest.mark.parametrize(('size', 'expected'), [
    (0.12, ['amplitude', 'height']), (0.5, ['amplitude'])])  # the larger one is singular as well
def test_motions_of_cranks_are_changed_as_well(size: float, expected: list[str]) -> None:
    platform = StewartPlatform.from_yaml(ROOT / 'config' / 'crank_platform.yaml')
    times, along, still = np.linspace(0.0, 10.0, 500), np.array([0.5, 0.0, 1.0]), np.zeros((
        500, 3))
    sine, cosine = (size * np.outer(each(times), along) for each in (np.sin, np.cos))
    motion = Motion.from_euler(
        platform.home_pose().position + sine, still, cosine, still, -sine, still)
    recorded = RecordedMotion(times, motion, np.zeros((500, 6)), None, [])
    found = judged(platform, recorded, uses(platform, recorded))
    assert [each.change for each in found.possible_with] == expected
    for each in found.possible_with:
        for value, possible in ((each.value, True), (
                each.value + (0.02 if each.change == 'amplitude' else -0.005), False)):
            assert is_possible(platform, recorded, each.change, value) is possible


def test_a_possible_motion_has_no_changes(recorded: RecordedMotion) -> None:
    platform = StewartPlatform(FILE)
    assert judged(platform, recorded, uses(platform, recorded)).possible_with == []


def test_terminal_and_page_say_with_which_changes_a_motion_is_possible(tmp_path: Path) -> None:
    FILE.replaced(CASES['longer legs'][0]).to_yaml(tmp_path / 'file.yaml')
    out = call(main, '--params', tmp_path / 'file.yaml', '--motion', BAG, '--output',
               tmp_path / 'out', '--strict', code=1).out
    words = 'possible at 9 % of its amplitude, or from 93 mm higher'
    assert words in ' '.join(out.split())
    assert words in (tmp_path / 'out' / 'datasheet.html').read_text()


def test_a_motion_of_more_than_half_a_turn_has_no_smaller_amplitude() -> None:
    """Its rotation vectors jump: a part of them would be another motion."""
    seconds = np.linspace(0.0, 10.0, 1001)
    yaw = 2.0 * np.pi * seconds / 10.0
    still = np.tile([0.0, 0.0, 1.1], (1001, 1))
    turning = RecordedMotion(
        seconds, Motion.from_euler(
            still, np.outer(yaw, [0.0, 0.0, 1.0]), 0.0 * still,
            np.tile([0.0, 0.0, 0.2 * np.pi], (1001, 1))), np.zeros((1001, 6)), None, [])
    platform = StewartPlatform(FILE)
    found = judged(platform, turning, uses(platform, turning))
    assert not found.possible
    assert 'amplitude' not in [each.change for each in found.possible_with]
