# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Possible errors in parameters of cranks: none in good hexapods, one line for each error."""

from __future__ import annotations

from typing import Any

from crank_machines import random_machine
from crank_platforms import parameters_of
import numpy as np
import pytest
from referees import rng, ROOT
from snapshot import Snapshot
from stewart_dynamics import Parameters, StewartPlatform
from stewart_dynamics.mechanics.parameter_errors import find_parameter_errors

Array = np.ndarray[Any, np.dtype[np.float64]]

RIG = Parameters.from_yaml(ROOT / 'config' / 'crank_platform.yaml')


def pairs(spread: float, turn: float = 0.0) -> Array:
    """Return angles to both sides of three directions, 120 degrees apart [rad]."""
    return np.deg2rad(turn + np.repeat([0.0, 120.0, 240.0], 2) + np.tile([-spread, spread], 3))


def tangential(angles: Array, senses: Any) -> Array:
    """Return headings along the circle of the motors, from -pi to pi."""
    headings: Array = np.remainder(angles + np.pi / 2.0 * np.asarray(senses) + np.pi,
                                   2.0 * np.pi) - np.pi
    return headings


# The head of a desktop robot, on six servos below it: cranks of a pair point away from each other.
HEAD = {
    'geometry.base_radius': 0.062, 'geometry.base_angles': pairs(20.0),
    'geometry.platform_radius': 0.04, 'geometry.platform_angles': np.roll(pairs(12.0, 60.0), 1),
    'geometry.crank_angles': tangential(pairs(20.0), [-1.0, 1.0] * 3),
    'platform.mass': 0.31, 'platform.center_of_mass': [0.0, 0.0, 0.02],
    'platform.inertia': [6e-4, 0.0, 0.0, 6e-4, 0.0, 7e-4],
    'legs.crank.length': 0.04, 'legs.crank.mass': 0.006, 'legs.crank.center_of_mass': 0.015,
    'legs.crank.inertia': 2e-6, 'legs.rod.length': 0.085, 'legs.rod.mass': 0.008,
    'actuator.reflected_inertia': 0.0018, 'actuator.viscous_friction': 0.005,
    'actuator.coulomb_friction': 0.02, 'limits.angle_min': -0.8, 'limits.angle_max': 1.4,
    'limits.speed_max': 8.0, 'limits.torque_max': 0.6, 'limits.rod_force_max': 60.0}
# A hexapod that hangs below its base, on hobby servos with short horns, and no masses of legs.
HANGING = {
    'geometry.base_radius': 0.075, 'geometry.base_angles': pairs(25.0),
    'geometry.platform_radius': 0.055, 'geometry.platform_angles': np.roll(pairs(15.0, 60.0), 1),
    'geometry.crank_angles': tangential(pairs(25.0), [-1.0, 1.0] * 3),
    'geometry.platform_side': 'negative', 'platform.mass': 0.2,
    'platform.inertia': [2e-4, 0.0, 0.0, 2e-4, 0.0, 3e-4],
    'legs.crank.length': 0.018, 'legs.rod.length': 0.14, 'actuator.reflected_inertia': 0.0006,
    'limits.angle_min': -1.2, 'limits.angle_max': 1.2, 'limits.speed_max': 7.0,
    'limits.torque_max': 0.5}
GOOD = {'rig': RIG, 'head': Parameters(HEAD), 'hanging': Parameters(HANGING),
        # Motors mounted as mirror images, whose positive senses are mirrored as well.
        'mirrored motors': RIG.replaced({
            'geometry.crank_axes': RIG['geometry.crank_axes'] * np.tile([1.0, -1.0], 3)[:, None],
            'geometry.crank_directions': RIG['geometry.crank_directions']}),
        # Cranks that hang down at their zeros, with ranges to match.
        'other zeros': RIG.replaced({
            'geometry.crank_axes': RIG['geometry.crank_axes'],
            'geometry.crank_directions': np.tile([0.0, 0.0, -1.0], (6, 1)),
            'limits.angle_min': 0.6, 'limits.angle_max': 2.6})}


@pytest.mark.parametrize('name', GOOD)
def test_good_hexapods_give_no_warning(name: str) -> None:
    parameters = GOOD[name]
    assert find_parameter_errors(parameters) == ()
    platform = StewartPlatform(parameters)
    angles = np.abs(platform.inverse_kinematics(platform.home_pose()))
    assert angles == pytest.approx(np.full(6, angles[0]), abs=1e-12)
    assert platform.check() == ()


def test_random_hexapods_give_no_warning() -> None:
    """Six different cranks each, of both branches, axes of any heading."""
    for seed in range(20):
        parameters = parameters_of(random_machine(rng(seed), 1.0))
        assert find_parameter_errors(parameters) == (), seed


@pytest.mark.parametrize('name', ['rig', 'head', 'hanging'])
@pytest.mark.parametrize('size', [0.1, 10.0])
def test_hexapods_of_any_size_give_no_warning(name: str, size: float) -> None:
    powers = {'m': 1.0, 'kg': 3.0, 'kg m^2': 5.0, 'N m': 4.0, 'N': 3.0, 'N m s/rad': 4.5,
              'rad/s': -0.5}
    p = GOOD[name]
    scaled = {each: np.ravel(p[each]) * size ** powers[p.unit_of(each)] for each in p.given
              if p.unit_of(each) in powers}
    assert find_parameter_errors(p.replaced({
        each: value if np.size(p[each]) > 1 else float(value[0])
        for each, value in scaled.items()})) == ()


AXES, ALONG = RIG['geometry.crank_axes'], RIG['geometry.crank_directions']


def flipped(*legs: int) -> dict[str, Any]:
    """Return directions with the signs of some axes changed."""
    signs = np.where(np.isin(np.arange(6), legs), -1.0, 1.0)
    return {'geometry.crank_axes': AXES * signs[:, None], 'geometry.crank_directions': ALONG}


def turned(leg: int, angle: float) -> dict[str, Any]:
    """Return directions with one zero turned about the axis of its motor."""
    along = ALONG.copy()
    along[leg] = np.cos(angle) * ALONG[leg] + np.sin(angle) * np.cross(AXES[leg], ALONG[leg])
    return {'geometry.crank_axes': AXES, 'geometry.crank_directions': along}


def replaced_heading(leg: int, heading: float) -> dict[str, Any]:
    headings = RIG['geometry.crank_angles'].copy()
    headings[leg] = heading
    return {'geometry.crank_angles': headings}


# Six servos MG996R, whose data sheet has 9.4 kg cm and 0.17 s for 60 degrees, under 0.5 kg.
GOOD['hobby'] = GOOD['head'].replaced({
    'platform.mass': 0.5, 'limits.torque_max': 0.922, 'limits.speed_max': 6.16,
    'limits.angle_max': 0.8, 'servo.angle_at_min': -1.0, 'servo.angle_at_max': 1.0})

# Changes of a hexapod, and how the warning begins.
SLIPS: dict[str, tuple[str, dict[str, Any], str]] = {
    'a crank in mm': ('rig', {'legs.crank.length': 184.15}, 'legs.crank.length: 184 m, but'),
    'rods in mm': ('rig', {'legs.rod.length': 723.9}, 'legs.rod.length: 724 m, but'),
    'both in mm': ('head', {'legs.crank.length': 40.0, 'legs.rod.length': 85.0},
                   'legs.crank.length: 40 m, but'),
    'radii in mm': ('rig', {'geometry.base_radius': 406.4, 'geometry.platform_radius': 400.05},
                    'legs.rod.length: 0.724 m: shorter than the gap of 140 m'),
    'a radius in mm': ('hanging', {'geometry.base_radius': 75.0},
                       'legs.rod.length: 0.14 m: shorter than the gap of 74.9 m'),
    'all in mm': ('rig', {
        'geometry.base_radius': 406.4, 'geometry.platform_radius': 400.05,
        'legs.crank.length': 184.15, 'legs.rod.length': 723.9},
        'geometry.platform_radius: 400 m from their center, and platform.mass only 160 kg'),
    'angles in degrees': ('rig', {'limits.angle_min': -60.0, 'limits.angle_max': 60.0},
                          'limits.angle_min: -60 rad: in degrees?'),
    'one of them in degrees': ('head', {'limits.angle_max': 80.0},
                               'limits.angle_max: 80 rad: in degrees?'),
    'speed in degrees per second': ('head', {'limits.speed_max': 400.0},
                                    'limits.speed_max: 400 rad/s: in degrees per second'),
    'rods shorter than the gap': ('rig', {'legs.rod.length': 0.3},
                                  'legs.rod.length: 0.3 m: shorter than the gap of 0.322 m'),
    'platform below': ('rig', {'gravity': [0.0, 0.0, 9.80665]},
                       'gravity: [0, 0, 9.81] m/s^2 pulls the platform away from the base'),
    'reversed motor': ('rig', flipped(2), 'geometry.crank_axes: positive angles of leg_3 pull'),
    'a pair of reversed motors': (
        'rig', flipped(2, 3), 'geometry.crank_axes: positive angles of leg_3, leg_4 '),
    'a motor that is not mirrored as the others': (
        'mirrored motors', flipped(1, 3), 'geometry.crank_axes: positive angles of leg_2, leg_4 '),
    'horn on the next tooth': ('rig', turned(4, 0.2513),
                               'geometry.crank_directions: leg_5: at home the angle is -0.251'),
    'heading of the other direction': ('rig', replaced_heading(1, 1.5707963267948966),
                                       'geometry.crank_angles: leg_2: at home the angle is '),
    'heading with a wrong digit': ('rig', replaced_heading(0, 3.0179938779914944),
                                   'geometry.crank_angles: leg_1: at home the angle is '),
    'pairs that are not mirrored': (
        'head', {'geometry.crank_angles': tangential(pairs(20.0), np.ones(6)),
                 'limits.angle_min': -1.5, 'limits.angle_max': 1.5},
        'geometry.crank_angles: at home leg_'),
    'another branch': ('rig', {
        'geometry.crank_branch': ['positive'] * 5 + ['negative'], 'limits.angle_min': -3.0},
        'geometry.crank_angles: leg_6: at home the angle is '),
    'center of mass in mm': ('rig', {'legs.crank.center_of_mass': 60.0},
                             'legs.crank.center_of_mass: 60 m from the axis of the motor'),
    'center of mass beyond the crank': ('head', {'legs.crank.center_of_mass': 0.05},
                                        'legs.crank.center_of_mass: 0.05 m from the axis'),
    'center of mass of a rod in mm': ('rig', {'legs.rod.center_of_mass': 361.0},
                                      'legs.rod.center_of_mass: 361 m from the end'),
    'inertia in kg mm^2': ('rig', {'legs.crank.inertia': 10.8e3},
                           'legs.crank.inertia: 1.08e+04 kg m^2, a radius of gyration'),
    'inertia of a rod in kg mm^2': ('rig', {'legs.rod.inertia': 56.7e3},
                                    'legs.rod.inertia: 5.67e+04 kg m^2, a radius'),
    'a crank in g': ('head', {'legs.crank.mass': 60.0},
                     'legs.crank.mass: 60 kg, with legs.crank.inertia a radius of gyration'),
    'torque of the motor': ('rig', {'limits.torque_max': 25.0, 'actuator.coulomb_friction': 0.0},
                            'limits.torque_max: 25 N m: leg_'),
    'friction in mN m': ('rig', {'actuator.coulomb_friction': 6000.0},
                         'actuator.coulomb_friction: 6e+03 N m: leg_1 cannot move with limits.'),
    'rod force in kN': ('rig', {'limits.rod_force_max': 3.0}, 'limits.rod_force_max: 3 N: the'),
    'near a dead centre': ('rig', {'limits.lever_min': 0.95},
                           'limits.lever_min: 0.95: at home leg_'),
    'rotor before the gear': ('rig', {'actuator.reflected_inertia': 3.3e-7},
                              'actuator.reflected_inertia: 3.3e-07 kg m^2, but each leg carries '),
    'no rotor': ('head', {'actuator.reflected_inertia': None},
                 'actuator.reflected_inertia: missing, but limits.speed_max is given: it is N^2 '
                 'J of rotor and gear'),
    'the other branch': ('rig', {'geometry.crank_branch': ['positive'] * 5 + ['negative']},
                         'geometry.crank_branch: negative: leg_6: at home the angle is -2.'),
    'all of the other branch': ('head', {'geometry.crank_branch': 'negative'},
                                'geometry.crank_branch: negative: leg_1: at home the angle is '),
    'servos without home': ('hobby', {'servo.angle_at_min': [-1.0, 1.0, -1.0, 1.0, -1.0, 0.9],
                                      'servo.angle_at_max': [1.0, -1.0, 1.0, -1.0, 1.0, 2.9]},
                            'servo.angle_at_min: 0.9 rad, servo.angle_at_max: 2.9 rad: leg_6: '),
    'servos that turn less than the limits': (
        'hobby', {'servo.angle_at_min': [-1.0] * 5 + [-0.7]}, 'limits.angle_min: -0.8 rad: the '
        'servo of leg_6 ends at -0.7 rad'),
    'a servo reversed, its range not symmetric': (
        'hobby', {'servo.angle_at_min': [-1.0] * 5 + [0.7], 'servo.angle_at_max': [1.0] * 6},
        'servo.angle_at_min: 0.7 rad, servo.angle_at_max: 1 rad: leg_6: no pulse'),
    'an inertia that no crank has': ('rig', {
        'legs.crank.inertia': [0.001, 0.0, 0.0, 0.001, 0.0, 0.0108]},
        'legs.crank.inertia: principal moments [0.001, 0.001, 0.0108] kg m^2: no body has'),
    'gravity up and the platform below': (
        'hanging', {'gravity': [0.0, 0.0, 9.80665]},
        'gravity: [0, 0, 9.81] m/s^2 and geometry.platform_side: negative: each turns'),
    'seconds for 60 degrees': (
        'hobby', {'limits.speed_max': 0.17}, 'limits.speed_max: 0.17 rad/s: the time of a servo '
        'for 60 degrees? 0.17 s for 60 degrees are 6.16 rad/s'),
    'torque in kg cm': ('hobby', {'limits.torque_max': 9.4},
                        'limits.torque_max: 9.4 N m: 2'),
    'a platform wider than the ends of the cranks': (
        'hanging', {'geometry.platform_radius': 0.12},
        'geometry.platform_radius: 0.12 m from their center, the ends of the cranks only 0.0'),
    'rotor in kg cm^2': ('rig', {'actuator.reflected_inertia': 1.1e-3, 'limits.torque_max': 2500.0,
                                 'limits.speed_max': 2.0},
                         'actuator.reflected_inertia: 0.0011 kg m^2')}
# Mistakes that several lines report.
SEVERAL = {'both in mm', 'all in mm', 'angles in degrees'}


@pytest.mark.parametrize('name', SLIPS)
def test_a_possible_error_is_reported_once(name: str, snapshot: Snapshot) -> None:
    hexapod, changes, begin = SLIPS[name]
    found = find_parameter_errors(GOOD[hexapod].replaced({
        each: np.ravel(value) if np.ndim(value) else value for each, value in changes.items()}))
    assert found and found[0].startswith(begin), found
    assert len(found) == 1 or name in SEVERAL, found
    for each in found:
        assert each.isprintable()
        snapshot(each)


def test_errors_of_a_hexapod_that_cannot_be_assembled_are_not_followed_by_others() -> None:
    """A StewartPlatform of it raises the error; the check has nothing to say of poses."""
    undecided = RIG.replaced({'limits.angle_min': -4.0, 'limits.angle_max': 4.0})
    assert find_parameter_errors(undecided) == ()


@pytest.mark.parametrize(('limits', 'found'), [
    ({}, '1.05 rad'), ({'limits.angle_min': None, 'limits.angle_max': None}, 'not set'),
    ({'limits.angle_min': -0.8, 'limits.angle_max': 0.8}, '')])
def test_limits_of_angles_beyond_a_servo_are_named(limits: dict[str, Any], found: str) -> None:
    """Travel, datasheet and home know limits; a servo that ends before them gets no pulses."""
    rig = RIG.replaced({
        'servo.angle_at_min': [-1.2, 1.2, -1.2, 0.9, -1.2, 1.2],
        'servo.angle_at_max': [1.2, -1.2, 1.2, -1.1, 1.2, -1.2], **limits})
    words = find_parameter_errors(rig)
    assert len(words) == bool(found)
    assert all(f'limits.angle_max: {found}: the servo of leg_4 ends at 0.9 rad' in each
               for each in words)


def test_the_servo_that_ends_farthest_from_a_limit_is_named() -> None:
    """As after the calibration of a horn on another tooth."""
    example = Parameters.from_yaml(ROOT / 'stewart_dynamics' / 'legs' / 'examples' / 'cranks.yaml')
    first, last = (example[f'servo.angle_at_{end}'].copy() for end in ('min', 'max'))
    for leg, zero in ((1, -0.01), (2, 0.25)):
        first[leg] += zero
        last[leg] += zero
    (found,) = [each for each in StewartPlatform(example.replaced(
        {'servo.angle_at_min': first, 'servo.angle_at_max': last})).check() if 'servo' in each]
    assert 'leg_3 ends at -0.535 rad' in found
