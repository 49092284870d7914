# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Joints on circles: the same hexapod as by points, from files, in the library and in changes."""

from __future__ import annotations

import math
from pathlib import Path
import pickle
from typing import Any

import numpy as np
import pytest
from snapshot import Snapshot

from stewart_dynamics import Parameters, StewartPlatform
from stewart_dynamics.errors import ParameterError

PROGRAM = 'stewart_describe'

FILE = Parameters.from_yaml(Path(__file__).parents[1] / 'config' / 'platform.yaml')
BASE = [math.radians(each) for each in (12.0, 108.0, 132.0, 228.0, 252.0, 348.0)]
PLATFORM = [math.radians(each) for each in (48.0, 72.0, 168.0, 192.0, 288.0, 312.0)]
CIRCLES: dict[str, Any] = {
    'geometry.base_radius': 0.9, 'geometry.base_angles': BASE,
    'geometry.platform_radius': 0.6, 'geometry.platform_angles': PLATFORM,
    'geometry.platform_height': -0.05}
OTHERS = {name: value for name, value in FILE.given.items() if not name.startswith('geometry.')}
ON_CIRCLES = Parameters({**OTHERS, **CIRCLES})


def points(radius: float, angles: list[float], height: float) -> list[float]:
    return [each for angle in angles
            for each in (radius * math.cos(angle), radius * math.sin(angle), height)]


def test_a_circle_is_the_points_on_it() -> None:
    expected = {'geometry.base_joints': points(0.9, BASE, 0.0),
                'geometry.platform_joints': points(0.6, PLATFORM, -0.05)}
    by_points = Parameters({**OTHERS, **expected})
    assert (repr(StewartPlatform(by_points).structure.tolist())
            == repr(StewartPlatform(ON_CIRCLES).structure.tolist()))
    assert by_points['geometry.base_radius'] is None
    # The example has the same joints, rounded to 0.1 mm.
    assert np.abs(ON_CIRCLES['geometry.base_joints'] - FILE['geometry.base_joints']).max() < 6e-5
    again = ON_CIRCLES.with_points()
    assert again == by_points and not any('radius' in name for name in again.given)


def test_files_copies_and_whole_sets_are_the_same(tmp_path: Path) -> None:
    ON_CIRCLES.to_yaml(tmp_path / 'hexapod.yaml')
    text = (tmp_path / 'hexapod.yaml').read_text(encoding='utf-8')
    assert 'base_radius: 0.9' in text and 'base_joints' not in text
    assert Parameters.from_yaml(tmp_path / 'hexapod.yaml') == ON_CIRCLES
    assert pickle.loads(pickle.dumps(ON_CIRCLES)) == ON_CIRCLES
    assert Parameters(dict(ON_CIRCLES)) == ON_CIRCLES


def test_changes_of_points_and_circles_take_the_place_of_each_other() -> None:
    moved = ON_CIRCLES.replaced({'geometry.base_joints': FILE['geometry.base_joints']})
    assert moved['geometry.base_radius'] is None
    assert np.array_equal(moved['geometry.base_joints'], FILE['geometry.base_joints'])
    back = moved.replaced({name: value for name, value in CIRCLES.items() if 'base' in name})
    assert back == ON_CIRCLES
    larger = ON_CIRCLES.replaced({'geometry.base_radius': 1.8})
    assert larger['geometry.base_joints'] == pytest.approx(
        2.0 * ON_CIRCLES['geometry.base_joints'], rel=1e-15)


@pytest.mark.parametrize('changes, expected', [
    ({'geometry.base_joints': FILE.given['geometry.base_joints']},
     'file: geometry.base_joints: given as well as geometry.base_radius, geometry.base_angles or '
     'geometry.base_height: leave out the points or the circle'),
    ({'geometry.platform_angles': None},
     'file: geometry.platform_angles: not set: needed by geometry.platform_radius'),
    ({'geometry.platform_radius': None},
     'file: geometry.platform_radius: not set: needed by geometry.platform_angles'),
    ({'geometry.platform_radius': None, 'geometry.platform_angles': None},
     'file: geometry.platform_joints: missing, it has no default; or give '
     'geometry.platform_radius and geometry.platform_angles'),
    ({'geometry.base_angles': [12.0, 108.0, 132.0, 228.0, 252.0, 348.0]},
     'file: geometry.base_angles: 12.0 rad: must be at least -6.28319, at most 6.28319: '
     'subtract a turn, or in degrees?'),
    ({'geometry.base_radius': 0.0}, 'file: geometry.base_radius: 0.0 m: must be more than 0'),
    ({'geometry.platform_angles': [0.0, 2.0 * math.pi] * 3},
     'file: geometry.platform_angles: all six are at one point'),
    ({'geometry.base_angles': BASE[:5]},
     'file: geometry.base_angles: ')])
def test_half_a_circle_and_both_are_rejected(changes: dict[str, Any], expected: str) -> None:
    with pytest.raises(ParameterError) as found:
        Parameters({**OTHERS, **CIRCLES, **changes}, 'file')
    assert str(found.value).startswith(expected)


def test_possible_errors_in_circles_name_what_was_given() -> None:
    def errors_of(**changes: float) -> str:
        return ' '.join(StewartPlatform(ON_CIRCLES.replaced(
            {f'geometry.{name}': value for name, value in changes.items()})).check())

    assert errors_of() == ''
    # And nothing that would follow from it, as other units.
    assert StewartPlatform(ON_CIRCLES.replaced({'geometry.base_angles': [1.0] * 6})).check() == (
        'geometry.base_angles: all six are at one point: the legs hold the platform in no pose',)
    assert 'geometry.platform_radius: 600 m from their center' in errors_of(
        base_radius=900.0, platform_radius=600.0)
    assert 'geometry.platform_radius: 0.9 m from their center, the base joints only' in errors_of(
        base_radius=0.6, platform_radius=0.9)
    assert 'geometry.platform_radius: 0.6 m from their center, the base joints 900 m' in errors_of(
        base_radius=900.0)


def test_a_height_with_points_is_rejected(snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        Parameters({**FILE.given, 'geometry.base_height': 0.1})
