# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of hexapods with cranks: two ways to give their directions, copies, wrong files."""

from __future__ import annotations

from itertools import count
import math
from pathlib import Path
import pickle
from typing import Any

import numpy as np
import pytest
from referees import ROOT
from snapshot import Snapshot
from stewart_dynamics import Motion, ParameterError, Parameters, StewartPlatform
from stewart_dynamics.legs import CRANK, TELESCOPIC
from test_parameters import assert_rejected, written

FILE = ROOT / 'config' / 'crank_platform.yaml'
RIG = Parameters.from_yaml(FILE)
TEXT = FILE.read_text(encoding='utf-8')
HEADINGS, AXES, DIRECTIONS = (
    'geometry.crank_angles', 'geometry.crank_axes', 'geometry.crank_directions')
HEADING_LINE = next(line for line in TEXT.splitlines() if 'crank_angles:' in line)
UP = np.array([0.0, 0.0, 1.0])


def directions() -> dict[str, Any]:
    """Return axes and directions of the rig's cranks, from their headings."""
    headings = np.deg2rad([150.0, -90.0, 30.0, 150.0, -90.0, 30.0])
    along = np.column_stack([np.cos(headings), np.sin(headings), np.zeros(6)])
    return {AXES: np.cross(along, UP), DIRECTIONS: along}


def test_headings_are_level_axes_about_which_a_positive_angle_lifts_the_crank() -> None:
    for name, expected in directions().items():
        assert RIG[name] == pytest.approx(expected, abs=1e-15)
    structure: Any = RIG.structure['legs']
    lifted = np.cross(structure['crank_axis'], structure['crank_direction'])
    assert lifted == pytest.approx(np.tile(UP, (6, 1)), abs=1e-15)


def test_axes_of_any_length_and_nearly_perpendicular_are_the_same_hexapod() -> None:
    given = directions()
    home = StewartPlatform(RIG).home_pose()
    expected = StewartPlatform(RIG).inverse_dynamics(Motion.from_pose(home))
    for lengths in ((7.0, 0.2), (1e200, 1e-100)):
        skewed = given[DIRECTIONS] + 9e-4 * given[AXES]
        by_axes = RIG.replaced({AXES: lengths[0] * given[AXES], DIRECTIONS: lengths[1] * skewed})
        assert by_axes[HEADINGS] is None
        platform = StewartPlatform(by_axes)
        assert platform.home_pose().position == pytest.approx(home.position, abs=1e-15)
        found = platform.inverse_dynamics(Motion.from_pose(home))
        assert found.angles == pytest.approx(expected.angles, abs=1e-14)
        assert found.torques == pytest.approx(expected.torques, rel=1e-13)


def test_changes_of_headings_and_of_axes_take_the_place_of_each_other(tmp_path: Path) -> None:
    by_axes = RIG.replaced(directions())
    assert by_axes[HEADINGS] is None and HEADINGS not in by_axes.given
    assert set(by_axes.given) - set(RIG.given) == {AXES, DIRECTIONS}
    back = by_axes.replaced({HEADINGS: RIG[HEADINGS]})
    assert back == RIG and set(back.given) == set(RIG.given)
    # A part of the other does not.
    with pytest.raises(ParameterError, match='geometry.crank_directions: not set: needed by geom'):
        RIG.replaced({AXES: directions()[AXES]})
    assert RIG.replaced({'legs.crank.length': 0.2})[HEADINGS] is not None
    for each in (by_axes, RIG):
        check_copies(each, tmp_path)
        points = each.with_points()
        assert points['geometry.base_radius'] is None
        assert points.structure['legs'].tobytes() == each.structure['legs'].tobytes()
        check_copies(points, tmp_path)


def check_copies(parameters: Parameters, folder: Path) -> None:
    """Check that files, copies and whole sets are equal, and complete."""
    parameters.to_yaml(folder / 'rig.yaml')
    whole = {name: value for name, value in parameters.plain().items() if value is not None}
    for same in (Parameters.from_yaml(folder / 'rig.yaml'), parameters.replaced({}),
                 pickle.loads(pickle.dumps(parameters)), Parameters(dict(parameters)),
                 Parameters(whole, exact_types=True)):
        assert same == parameters
        assert same.structure['legs'].tobytes() == parameters.structure['legs'].tobytes()


@pytest.mark.parametrize('inertia', [
    0.01, [0.01, 1e-3, 0.0, 0.02, 0.0, 0.02], [0.01, 1e-3, 0.0, 0.02, 0.0, 0.02] * 6])
@pytest.mark.parametrize('center', [
    0.05, [0.05, 0.01, -0.02], [0.01, 0.02, 0.03, 0.04, 0.05, 0.06],
    np.arange(18.0).reshape(6, 3) / 100.0])
def test_centers_and_inertias_of_all_shapes(tmp_path: Path, center: Any, inertia: Any) -> None:
    parameters = RIG.replaced(
        {'legs.crank.center_of_mass': center, 'legs.crank.inertia': inertia})
    legs: Any = parameters.structure['legs']
    expected = {1: lambda: np.outer(np.full(6, center), [1.0, 0.0, 0.0]),
                3: lambda: np.tile(center, (6, 1)),
                6: lambda: np.outer(center, [1.0, 0.0, 0.0]),
                18: lambda: np.asarray(center)}[np.size(center)]()
    assert legs['crank_center_of_mass'].tolist() == expected.tolist()
    of_all = [0.0] * 5 + [inertia] if np.size(inertia) == 1 else inertia[:6]
    assert legs['crank_inertia'].tolist() == [of_all] * 6
    check_copies(parameters, tmp_path)


def test_a_written_file_has_the_units_of_cranks_and_no_names_of_other_legs(tmp_path: Path) -> None:
    RIG.to_yaml(tmp_path / 'rig.yaml')
    text = (tmp_path / 'rig.yaml').read_text(encoding='utf-8')
    for line in ('coulomb_velocity: 0.02  # rad/s', 'viscous_friction: 3.0  # N m s/rad',
                 'coulomb_friction: 6.0  # N m'):
        assert f'      {line}\n' in text
    telescopic = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
    telescopic.to_yaml(tmp_path / 'telescopic.yaml')
    for file, kind in (('rig', CRANK), ('telescopic', TELESCOPIC)):
        written_names = Parameters.from_yaml(tmp_path / f'{file}.yaml').given
        assert not [name for name in written_names if name.startswith(kind.foreign)]


def test_defaults_of_cranks_are_not_those_of_telescopic_legs(tmp_path: Path) -> None:
    bare = RIG.replaced(dict.fromkeys(
        ('limits.lever_min', 'actuator.coulomb_velocity', 'actuator.reflected_inertia')))
    assert bare['limits.lever_min'].tolist() == [0.1] * 6
    assert bare['actuator.coulomb_velocity'].tolist() == [0.01] * 6
    # A uniform rod.
    assert bare['legs.rod.center_of_mass'].tolist() == [0.5 * 0.7239] * 6
    assert bare['legs.rod.inertia'] == pytest.approx(np.full(6, 1.3 * 0.7239 ** 2 / 12.0))
    check_copies(bare, tmp_path)
    geared = bare.replaced({'drive.gear_ratio': 95.0, 'drive.motor_inertia': 3.3e-5})
    assert geared['actuator.reflected_inertia'] == pytest.approx(np.full(6, 95.0 ** 2 * 3.3e-5))
    check_copies(geared, tmp_path)


# Wrong files: the part of the example that is changed, and its new text

def with_directions(axes: Any, along: Any) -> str:
    """Return lines with axes and directions."""
    return '\n'.join(f'      {name.partition(".")[2]}: {np.ravel(value).tolist()}'
                     for name, value in ((AXES, axes), (DIRECTIONS, along)) if value is not None)


AXIS, ALONG = directions().values()
BUT_THIRD = (np.arange(6) != 2)[:, None]
BAD = [
    # of the other kind
    *(('    legs:', f'    {name}\n    legs:') for name in (
        'legs.cylinder: {mass: 12.0}', 'legs.piston.center_of_mass: 0.4',
        'geometry.base_outline: [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]')),
    ('    actuator:', '    actuator:\n      reflected_mass: 30.0'),
    ('    actuator:', '    actuator:\n      screw_lead: 0.01'),
    ('    geometry:', '    geometry:\n      zero_length: 0.95'),
    *(('    limits:', f'    limits:\n      {name}: 1.0') for name in (
        'length_min', 'length_max', 'velocity_max', 'force_max', 'joint_force_max',
        'leg_clearance_min')),
    ('    limits:', '    drive: {screw_rotation: universal}\n    limits:'),
    # lengths
    ('        length: 0.7239 ', '        # '),
    ('        length: 0.7239 ', '        length: 0.0 '),
    ('        length: 0.18415 ', '        length: -0.18415 '),
    ('        length: 0.18415 ', '        length: [0.18415, 0.18415] '),
    # directions
    (HEADING_LINE, ''),
    (HEADING_LINE, with_directions(AXIS, None)),
    (HEADING_LINE, with_directions(None, ALONG)),
    (HEADING_LINE, f'{HEADING_LINE}\n{with_directions(AXIS, -ALONG)}'),
    (HEADING_LINE, f'{HEADING_LINE}\n{with_directions(-AXIS, None)}'),
    (HEADING_LINE, with_directions(AXIS, ALONG + 1.1e-3 * AXIS)),
    (HEADING_LINE, with_directions(AXIS * BUT_THIRD, ALONG)),
    (HEADING_LINE, with_directions(AXIS, ALONG * BUT_THIRD)),
    (HEADING_LINE, '      crank_angles: [150.0, -90.0, 30.0, 150.0, -90.0, 30.0]'),
    (HEADING_LINE, '      crank_angles: 0.0'),
    ('crank_branch: auto', 'crank_branch: left'),
    ('crank_branch: auto', 'crank_branch: [auto, auto]'),
    # masses
    ('        mass: 2.4 ', '        mass: -2.4 '),
    ('        mass: 1.3 ', '        mass: [1.3, 1.3, 1.3, 1.3, -1.3, 1.3] '),
    ('        mass: 1.3 ', '        mass: 1.3\n        inertia: -0.01 '),
    ('inertia: 0.0108 ', 'inertia: -0.0108 '),
    ('inertia: 0.0108 ', 'inertia: [0.01, 0.02, 0.0, 0.01, 0.0, 0.01] '),
    ('inertia: 0.0108 ', f'inertia: {[0.1, 0.0, 0.0, 0.1, 0.0, 0.1] * 5 + [0.1] * 5 + [-0.1]} '),
    ('center_of_mass: 0.06 ', 'center_of_mass: [0.06, 0.0] '),
    # limits
    ('angle_min: -1.0471975511965976', 'angle_min: 1.0471975511965976'),
    ('angle_max: 1.0471975511965976', 'angle_max: -1.2'),
    ('lever_min: 0.1\n', 'lever_min: 1.0\n'),
    ('lever_min: 0.1\n', 'lever_min: 1.5\n'),
    ('torque_max: 250.0', 'torque_max: 0.0'),
    ('reflected_inertia: 0.3 ', 'reflected_inertia: -0.3 '),
    ('    limits:', '    drive: {motor_inertia: 3.0e-5, gear_ratio: 50.0}\n    limits:')]


@pytest.mark.parametrize(('old', 'new'), BAD, ids=count())
def test_the_error_of_a_bad_file_names_parameter_value_and_rule(
        tmp_path: Path, old: str, new: str, snapshot: Snapshot) -> None:
    assert TEXT.count(old) == 1, old
    assert_rejected(tmp_path, TEXT.replace(old, new), snapshot)


OF_CRANKS = [
    'legs.crank: {mass: 2.4}', 'legs.rod: {length: 0.7}',
    'geometry.crank_angles: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]', 'geometry.crank_branch: positive',
    'actuator.reflected_inertia: 0.3',
    *(f'limits.{name}: 0.5' for name in (
        'angle_min', 'angle_max', 'speed_max', 'torque_max', 'rod_force_max', 'lever_min'))]


@pytest.mark.parametrize('line', OF_CRANKS)
def test_a_name_of_cranks_is_rejected_without_their_length(
        tmp_path: Path, line: str, snapshot: Snapshot) -> None:
    text = (ROOT / 'config' / 'platform.yaml').read_text(encoding='utf-8')
    assert_rejected(tmp_path, f'{text}\n    {line}\n', snapshot)


# Hexapods without a home pose, or of which it does not decide the branch

UNDECIDED = [
    # rods shorter than the gap; or as long as a street
    ({'legs.rod.length': 0.05}, 'legs.rod.length: [0.05] m: no level pose'),
    ({'legs.rod.length': 723.9}, 'legs.rod.length: [723.9] m: no level pose'),
    # one of them alone
    ({'legs.rod.length': [0.7239] * 5 + [0.2]},
     'legs.rod.length: leg_6: 0.2 m: does not reach'),
    ({'limits.angle_min': -4.0, 'limits.angle_max': 4.0},
     'geometry.crank_branch: auto: leg_1 has an angle of '),
    ({'limits.angle_min': [-1.0] * 5 + [2.0], 'limits.angle_max': [1.0] * 5 + [2.1]},
     'geometry.crank_branch: auto: leg_')]


@pytest.mark.parametrize(('changes', 'expected'), UNDECIDED, ids=count())
def test_a_home_pose_that_is_not_found_or_decides_no_branch_is_one_line(
        changes: dict[str, Any], expected: str, snapshot: Snapshot) -> None:
    parameters = RIG.replaced(changes)
    parameters.source = 'rig.yaml'
    with pytest.raises(ParameterError) as found:
        StewartPlatform(parameters)
    assert str(found.value).startswith(f'rig.yaml: {expected}')
    snapshot(found.value)


def test_limits_in_degrees_are_named_before_the_branch_that_they_leave_open() -> None:
    parameters = RIG.replaced({'limits.angle_min': -50.0, 'limits.angle_max': 50.0,
                               'geometry.crank_branch': 'auto'})
    with pytest.raises(ParameterError, match=r': limits.angle_min: -50 rad: in degrees\?$'):
        StewartPlatform(parameters)


@pytest.mark.parametrize(('degrees', 'advice'), [
    (382.0, 'subtract a turn, or in degrees?'), (1000.0, ': in degrees?')])
def test_an_angle_of_more_than_a_turn_is_rejected(degrees: float, advice: str) -> None:
    with pytest.raises(ParameterError) as found:
        RIG.replaced({'geometry.crank_angles': np.full(6, math.radians(degrees))})
    assert str(found.value).endswith(advice)


def test_a_branch_that_is_given_needs_no_home_pose() -> None:
    given = RIG.replaced({'limits.angle_min': -4.0, 'limits.angle_max': 4.0,
                          'geometry.crank_branch': ['positive'] * 5 + ['negative']})
    home = StewartPlatform(RIG).home_pose()
    angles = StewartPlatform(given).inverse_kinematics(home)
    assert angles[:5] == pytest.approx(np.zeros(5), abs=1e-14)
    assert angles[5] == pytest.approx(-2.72549, abs=1e-5)
    assert StewartPlatform(given).inverse_dynamics(Motion.from_pose(home)).levers[5] < 0.0
    # Without a home pose.
    short = given.replaced({'legs.rod.length': 0.05})
    with pytest.raises(ParameterError, match='legs.rod.length'):
        StewartPlatform(short).home_pose()


def test_angles_are_within_a_turn_of_the_middle_of_their_range() -> None:
    turned = RIG.replaced({
        'limits.angle_min': 2.0 * math.pi - 1.0, 'limits.angle_max': 2.0 * math.pi + 1.0})
    home = StewartPlatform(RIG).home_pose()
    assert StewartPlatform(turned).inverse_kinematics(home) == pytest.approx(
        np.full(6, 2.0 * math.pi), rel=1e-14)


def test_a_file_with_integers_is_rejected(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r'legs.rod.length: 1: is an integer, must be a doub'):
        Parameters.from_yaml(written(tmp_path, TEXT.replace('length: 0.7239 ', 'length: 1 ')))
