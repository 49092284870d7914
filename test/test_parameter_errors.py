# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Possible errors in parameters: no warning for valid hexapods, one for each error."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import assume, given, strategies as st
import numpy as np
import pytest
from referees import random_parameters, rng, ROOT, scaled
from snapshot import Snapshot
from stewart_dynamics import Motion, ParameterError, Parameters, Pose, StewartPlatform
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.mechanics.kinematics.home_pose import home_of, homes
from stewart_dynamics.mechanics.kinematics.symmetry import odd_joint
from stewart_dynamics.mechanics.parameter_errors import find_parameter_errors
from stewart_dynamics.parameters.table import inertia_matrix, PARAMETERS

Array = np.ndarray[Any, np.dtype[np.float64]]

PLATFORM = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')


def ring(radius: float, spread: float, turn: float = 0.0, height: float = 0.0) -> Array:
    """Return six joints in pairs, each pair by an angle to both sides of 0, 120, 240 degrees."""
    angles = np.deg2rad(turn + np.repeat([0.0, 120.0, 240.0], 2)
                        + np.tile([-spread, spread], 3))
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles),
                            np.full(6, height)])


def hexapod(base: Array, platform: Array, mass: float, inertia: float,
            **others: Any) -> dict[str, Any]:
    """Return the parameters of a hexapod, with one principal moment for all axes."""
    return {'geometry.base_joints': base.ravel(), 'geometry.platform_joints': platform.ravel(),
            'platform.mass': mass, 'platform.inertia': [inertia, 0.0, 0.0, inertia, 0.0, inertia],
            **{name.replace('__', '.'): value for name, value in others.items()}}


# Hexapods of every size that is built.
HEXAPODS = {
    # MathWorks' example of a Stewart platform (Smith and Wendlandt, 2002)
    'textbook': hexapod(
        ring(3.0, 2.5), np.roll(ring(1.0, 10.0, 60.0), 1, axis=0), 1200.0, 300.0,
        geometry__zero_length=2.8),
    # joints on 1.65 and 1.6 m, actuators of 1.25 m stroke
    'flight simulator': hexapod(
        ring(1.65, 10.5), np.roll(ring(1.6, 3.6, 60.0), 1, axis=0), 4000.0, 9000.0,
        platform__center_of_mass=[0.1, 0.0, 1.2], limits__length_min=2.08,
        limits__length_max=3.33, limits__velocity_max=1.0, geometry__zero_length=2.08,
        actuator__reflected_mass=0.0,  # hydraulic
        legs__cylinder__mass=120.0, legs__cylinder__center_of_mass=0.8,
        legs__cylinder__inertia=40.0, legs__piston__mass=40.0,
        legs__piston__center_of_mass=0.6, legs__piston__inertia=10.0),
    # the same with both frames' z down, as in aerospace
    'flight simulator, z down': hexapod(
        ring(1.65, 10.5), np.roll(ring(1.6, 3.6, 60.0), 1, axis=0), 4000.0, 9000.0,
        gravity=[0.0, 0.0, 9.80665], geometry__platform_side='negative',
        platform__center_of_mass=[0.1, 0.0, -1.2],
        limits__length_min=2.08, limits__length_max=3.33),
    # on a desk, under a mirror
    'micro hexapod': hexapod(
        ring(0.12, 12.0), np.roll(ring(0.08, 10.0, 60.0), 1, axis=0), 0.5, 6e-4,
        limits__length_min=0.13, limits__length_max=0.155, geometry__zero_length=0.13,
        legs__cylinder__mass=0.15, legs__cylinder__center_of_mass=-0.02,
        legs__cylinder__inertia=3e-5),
    # under a fiber's end, on piezos of a tenth of a millimeter
    'finger-sized hexapod': hexapod(
        ring(0.02, 15.0), np.roll(ring(0.015, 15.0, 60.0), 1, axis=0), 0.01, 5e-7,
        limits__length_min=0.0199, limits__length_max=0.02),
    # the secondary mirror of a large telescope, hanging; its reference is the mirror's vertex
    'telescope': hexapod(
        ring(0.9, 8.0, height=0.4), np.roll(ring(0.7, 8.0, 60.0, height=2.5), 1, axis=0), 2500.0,
        2800.0, platform__center_of_mass=[0.0, 0.0, 1.9], gravity=[0.0, 5.0, 8.4],
        geometry__platform_side='positive'),
    # a cabin on six cables from towers on a circle of 300 m, which meet it in pairs
    'cable robot': hexapod(
        ring(300.0, 30.0), np.roll(ring(6.5, 2.0, 60.0), 1, axis=0), 30000.0, 3e5,
        gravity=[0.0, 0.0, -9.8], limits__velocity_max=0.6, actuator__reflected_mass=2e4),
    # its axis along x
    'horizontal': hexapod(
        ring(1.0, 10.0)[:, [2, 0, 1]], np.roll(ring(0.7, 10.0, 60.0), 1, axis=0)[:, [2, 0, 1]],
        100.0, 20.0, limits__length_min=0.8, limits__length_max=1.6),
    # in orbit, with a heavy load on a thin mast
    'weightless': hexapod(
        ring(0.5, 20.0), np.roll(ring(0.4, 20.0, 60.0), 1, axis=0), 800.0, 2000.0,
        gravity=[0.0, 0.0, 0.0], platform__center_of_mass=[0.0, 0.0, 3.0]),
    # the platform's own mass left out
    'without mass': hexapod(
        ring(0.5, 20.0), np.roll(ring(0.4, 20.0, 60.0), 1, axis=0), 1e-3, 1e-4),
}


@pytest.mark.parametrize('name', HEXAPODS)
def test_good_hexapods_give_no_warnings(name: str) -> None:
    expected = ('gravity: 0 m/s^2: none, as in orbit? The earth has 9.80665',)
    assert find_parameter_errors(Parameters(HEXAPODS[name])) == (
        expected if name == 'weightless' else ())


def test_random_hexapods_give_no_warning() -> None:
    for seed in range(20):
        assert find_parameter_errors(random_parameters(np.random.default_rng(seed))) == ()


@pytest.mark.parametrize('power', [2.0, 3.0])
@pytest.mark.parametrize('size', [1e-3, 1e-2, 1.0, 1e3])
def test_hexapods_of_any_size_give_no_warning(size: float, power: float) -> None:
    """Forces of actuators grow with the square of the size, or as weights with the third power."""
    limits = {'limits.length_min': 1.0, 'limits.length_max': 1.0, 'limits.force_max': power,
              'limits.velocity_max': 0.5 * power - 0.5, 'actuator.coulomb_friction': power}
    found = scaled(PLATFORM, size).replaced({
        name: PLATFORM[name] * size ** exponent for name, exponent in limits.items()
        if power == 3.0 or size <= 1.0 or name != 'limits.force_max'})
    assert find_parameter_errors(found) == ()
    for seed in range(2):
        assert find_parameter_errors(scaled(
            random_parameters(np.random.default_rng(seed)), 0.3 * size)) == ()


def test_lengths_in_mm_throughout_have_no_other_cause() -> None:
    names = [name for name, each in PARAMETERS.items() if each.unit == 'm' and name in
             PLATFORM.given]
    found = find_parameter_errors(PLATFORM.replaced({
        name: 1e3 * PLATFORM[name] for name in names}))
    assert all('in mm' in error for error in found), found
    assert not any('in g?' in error for error in found), found


# Mistakes: changes of the package's hexapod, and the warnings, word for word

BASE, TOP = PLATFORM['geometry.base_joints'], PLATFORM['geometry.platform_joints']
INERTIA = PLATFORM['platform.inertia']
HOME = StewartPlatform(PLATFORM).home_pose().position
FROM_BASE = PLATFORM['platform.center_of_mass'] + HOME
OF_BASE = (inertia_matrix(INERTIA) + PLATFORM['platform.mass'] * (
    FROM_BASE @ FROM_BASE * np.eye(3) - np.outer(FROM_BASE, FROM_BASE)))[np.triu_indices(3)]
NO_LIMITS: dict[str, Any] = {'limits.length_min': (), 'limits.length_max': ()}
QUARTER = from_euler([0.0, 0.0, np.pi / 2.0])
SLIPS: dict[str, tuple[dict[str, Any], list[str]]] = {
    'all joints in mm': (
        {'geometry.base_joints': 1e3 * BASE, 'geometry.platform_joints': 1e3 * TOP}, [
            'geometry.platform_joints: 600 m from their center, and platform.mass only 150 kg: '
            'in mm?']),
    'all joints in mm of a hexapod as long as a street': (
        {'geometry.base_joints': 3e3 * BASE, 'geometry.platform_joints': 3e3 * TOP}, [
            'geometry.base_joints: 2.7e+03 m from their center: larger than any hexapod '
            'known: in mm?',
            'limits.length_min: [0.95] m and limits.length_max: [1.65] m: no level pose has all '
            'legs within them; the base joints are 2.7e+03 m from their center, the platform '
            'joints 1.8e+03 m: different units?']),
    'the base joints in mm': (
        {'geometry.base_joints': 1e3 * BASE}, [
            'geometry.platform_joints: 0.6 m from their center, the base joints 900 m: one of '
            'them in mm?']),
    'one base joint in mm': (
        {'geometry.base_joints': BASE * np.where(np.arange(6) == 1, 1e3, 1.0)[:, None]}, [
            'geometry.platform_joints: ']),
    'limits in mm': (
        {'limits.length_min': 950.0, 'limits.length_max': 1650.0}, [
            'limits.length_min: 950 m, but the joints are 0.9 m from their center: in mm?',
            'limits.length_max: 1.65e+03 m, but']),
    'limits of another hexapod': (
        {'limits.length_min': 0.05, 'limits.length_max': 0.1}, [
            'no level pose has all legs within them; the base joints are 0.9 m']),
    'a longest leg in dm': ({'limits.length_min': (), 'limits.length_max': 0.165}, [
        'limits.length_max: [0.165] m: no level pose has all legs within']),
    'forces in kN': ({'limits.force_max': 0.2}, [
        'limits.force_max: [0.2] N: six such legs cannot carry the platform, 1.47e+03 N: in kN?']),
    'forces of joints in kN': ({'limits.joint_force_max': 6.0}, [
        'limits.joint_force_max: [6] N: six such legs cannot carry the platform, 1.47e+03 N: '
        'in kN?']),
    'the zero length in mm': ({'geometry.zero_length': 950.0}, [
        'geometry.zero_length: 950 m, but the joints are 0.9 m from their center: in mm?']),
    'the characteristic length in mm': ({'singularity.characteristic_length': 600.0}, [
        'singularity.characteristic_length: 600 m, but']),
    'inertia in g mm^2': ({'platform.inertia': 1e9 * INERTIA}, [
        'platform.inertia: 2.2e+10 kg m^2 at most, a radius of gyration of 1.21e+04 m, but the '
        'platform joints are 0.6 m from their center: in g mm^2 or kg mm^2?']),
    'inertia of no body': ({'platform.inertia': [13.0, 0.0, 0.0, 14.0, 0.0, 40.0]}, [
        'platform.inertia: principal moments [13, 14, 40] kg m^2: no body has one larger than '
        'the sum of the other two']),
    'a center of mass in mm': ({'platform.center_of_mass': [20.0, -10.0, 120.0]}, [
        'platform.center_of_mass: [20, -10, 120] m is 122 m from the middle of the platform '
        'joints']),
    'a cylinder in mm': ({'legs.cylinder.center_of_mass': 350.0}, [
        'legs.cylinder.center_of_mass: 350 m from the base joint, but no leg is over 1.65 m']),
    'a piston longer than the leg': (
        {'legs.piston.center_of_mass': [0.4, 0.4, 0.4, 0.4, 1.7, 0.4]}, [
            'legs.piston.center_of_mass: 1.7 m from the platform joint, but no leg is over 1.65']),
    'a piston with the other sign': ({'legs.piston.center_of_mass': -0.4}, [
        'legs.piston.center_of_mass: -0.4 m: behind the platform joint: a sign? It counts from '
        'this joint toward the base']),
    'friction in mN': ({'actuator.coulomb_friction': [40.0, 40.0, 40e3, 40.0, 40.0, 40.0]}, [
        'actuator.coulomb_friction: 4e+04 N: leg_3 cannot move with limits.force_max, '
        '6e+03 N: in mN?']),
    'base and platform exchanged': (
        {'geometry.base_joints': TOP, 'geometry.platform_joints': BASE}, [
            'geometry.platform_joints: 0.9 m from their center, the base joints only 0.6 m: base '
            'and platform exchanged?']),
    'gravity with the other sign': ({'gravity': [0.0, 0.0, 9.80665]}, [
        'gravity: [0, 0, 9.81] m/s^2 pulls the platform away from the base: a sign? For a '
        'hexapod that hangs, or whose axes point down, set geometry.platform_side']),
    'platform joints in the base frame': ({'geometry.platform_joints': TOP + HOME}, [
        'geometry.platform_joints: [0, 0, 1.18] m is their center, where it is in the base frame, '
        'legs of 1.3 m and more, but platform.center_of_mass is 1.06 m away from it: are the '
        'joints given in the base frame?']),
    'all of the platform in the base frame': ({
        'geometry.platform_joints': TOP + HOME,
        'platform.center_of_mass': PLATFORM['platform.center_of_mass'] + HOME}, [
        'geometry.platform_joints: [0, 0, 1.18] m is their center, where it is in the base frame, '
        'legs of 1.3 m and more: are the joints given in the base frame?']),
    'joints in the frame of the floor': ({
        'geometry.base_joints': BASE + 0.5 * HOME, 'geometry.platform_joints': TOP + 1.3 * HOME}, [
        'geometry.platform_joints: [0, 0, 1.53] m is their center, where it is in the base frame, '
        'legs of 1.09 m and more, but platform.center_of_mass is 1.41 m away from it']),
    'a center of mass from the origin of the base': (
        {'platform.center_of_mass': PLATFORM['platform.center_of_mass'] + HOME}, [
            'platform.center_of_mass: [0.02, -0.01, 1.3] m is where the platform is at home in '
            "the base frame: from the base's origin?"]),
    'an inertia about the origin of the base': ({'platform.inertia': OF_BASE}, [
        'platform.inertia: radii of gyration of 1.33 m and more across the axis of the hexapod, '
        '0.384 m about it, and the base is 1.3 m from the center of mass at home: about the '
        "base's origin?"]),
    'a piston in kg mm^2': ({'legs.piston.inertia': 0.32e6}, [
        'legs.piston.inertia: 3.2e+05 kg m^2, a radius of gyration of 231 m, but a length of '
        '1.65 m: in g mm^2 or kg mm^2?']),
    'gravity in mm/s^2': ({'gravity': [0.0, 0.0, -9806.65]}, [
        'gravity: 9806.65 m/s^2: four times that of Jupiter: in mm/s^2?']),
    'gravity in g': ({'gravity': [0.0, 0.0, -1.0]}, ['gravity: 1 m/s^2: in g?']),
    'a rate in mm/s': ({'limits.velocity_max': 500.0}, ['limits.velocity_max: 500 m/s: in mm/s?']),
    'a mass in g': ({'platform.mass': 150e3, 'limits.force_max': ()}, [
        'platform.mass: 150000 kg, with platform.inertia a radius of gyration of 0.0121 m, but '
        'the platform joints are 0.6 m from their center: in g, or the joints in cm?']),
    'a cylinder in g': ({'legs.cylinder.mass': 12e3}, [
        'legs.cylinder.mass: 12000 kg, with legs.cylinder.inertia a radius of gyration of '
        '0.00736 m, but a length of 1.65 m: in g?']),
    'no reflected mass': ({'actuator.reflected_mass': None}, [
        'actuator.reflected_mass: missing, but limits.velocity_max is given: it is '
        'J (2 pi / lead)^2 of rotor and screw; write 0.0 for a drive that has none']),
    'no reflected mass, friction alone': (
        {'actuator.reflected_mass': None, 'actuator.viscous_friction': None,
         'limits.force_max': None, 'limits.velocity_max': None}, [
            'actuator.reflected_mass: missing, but actuator.coulomb_friction is given']),
    'the inertia of the rotor in kg m^2': ({'actuator.reflected_mass': 4.2e-4}, [
        'actuator.reflected_mass: 0.00042 kg, but each leg carries 31 kg: the inertia of the '
        'rotor? It is J (2 pi / lead)^2']),
    'the inertia of the rotor in kg cm^2': ({'actuator.reflected_mass': 4.2}, [
        'actuator.reflected_mass: 4.2 kg: limits.force_max alone would accelerate it by 1.43e+03 '
        'm/s^2, more than any motor: the inertia of the rotor in kg cm^2? It is '
        'J (2 pi / lead)^2 in kg']),
    'the same without a limit of the rate': (
        {'actuator.reflected_mass': 0.76, 'limits.velocity_max': ()}, [
            'actuator.reflected_mass: 0.76 kg: limits.force_max alone']),
    'strokes in place of lengths': ({'limits.length_min': 0.0, 'limits.length_max': 0.7}, [
        'limits.length_min: [0] m, limits.length_max: [0.7] m: strokes? They are lengths from '
        'joint to joint']),
    'a stroke in place of the longest length': (
        {'limits.length_min': (), 'limits.length_max': 0.7}, [
            'limits.length_max: [0.7] m, less than geometry.zero_length, [0.95] m: a stroke?']),
    'platform joints that begin with the leg after the next': (
        {'geometry.platform_joints': np.roll(TOP, 2, axis=0)}, [
            'geometry.platform_joints: at home (the axes parallel, a mean leg of 1.3 m) the legs '
            'are shorter with the platform joints in the order [3, 4, 5, 6, 1, 2]: are the '
            'joints in another order?']),
    'two platform joints exchanged, no limits': (
        {'geometry.platform_joints': TOP[[0, 2, 1, 3, 4, 5]], **NO_LIMITS}, [
            'in the order [1, 3, 2, 4, 5, 6]']),
    'similar hexagons': ({'geometry.platform_joints': 0.65 * BASE}, [
        'geometry: singular at every pose of 150 tried: the condition number is at least ']),
    'similar hexagons, rounded': ({'geometry.platform_joints': np.round(0.65 * BASE, 3)}, [
        'geometry: nearly singular at every pose of 150 tried: the condition number is at least']),
    'two legs the same': (
        {'geometry.base_joints': BASE[[0, 0, 2, 3, 4, 5]],
         'geometry.platform_joints': TOP[[0, 0, 2, 3, 4, 5]], **NO_LIMITS}, [
            'geometry: singular at every pose of 150 tried']),
    'a quarter turn': ({'geometry.platform_joints': TOP @ QUARTER.T}, [
        'geometry: singular at home (the axes parallel, a mean leg of 1.3 m): the condition '
        'number is ']),
    'a quarter turn, no limits': ({'geometry.platform_joints': TOP @ QUARTER.T, **NO_LIMITS}, [
        'geometry: singular at home (the axes parallel, at any height): the condition number']),
}


# Slips that are reported by more than one line.
SEVERAL = {'all joints in mm', 'all joints in mm of a hexapod as long as a street',
           'the base joints in mm', 'one base joint in mm', 'limits in mm'}


def test_a_rotor_that_its_motor_cannot_accelerate_so_much_is_no_possible_error() -> None:
    p = PLATFORM.replaced({
        'actuator.reflected_mass': None, 'actuator.screw_lead': 0.01,
        'drive.motor_inertia': 7.6e-5, 'drive.torque_max': 8.0, 'limits.force_max': 20e3})
    assert not any('reflected_mass' in each for each in find_parameter_errors(p))


@pytest.mark.parametrize('name', SLIPS)
def test_a_possible_error_is_reported_once(name: str) -> None:
    changes, texts = SLIPS[name]
    found = find_parameter_errors(PLATFORM.replaced({
        name: np.ravel(value) if np.ndim(value) else value for name, value in changes.items()}))
    for text in texts:
        assert any(text in error for error in found), found
    assert all(error.isprintable() for error in found)
    assert len(found) == 1 or name in SEVERAL
    # A wrong unit is not also an order of the joints.
    assert name != 'one base joint in mm' or not any('another order' in each for each in found)


@pytest.mark.parametrize('height', [0.779, 0.994, 1.18, 1.5])
@pytest.mark.parametrize('limits', [{}, {
    'limits.length_min': (), 'limits.length_max': (), 'geometry.zero_length': 0.0}])
def test_points_in_the_frame_of_the_base_are_found_at_any_height(
        height: float, limits: dict[str, Any]) -> None:
    """A file from a drawing of the whole hexapod, with or without limits of length."""
    up = np.array([0.0, 0.0, height])
    center = PLATFORM['platform.center_of_mass']
    for changes, name in (
            ({'geometry.platform_joints': TOP + up}, 'geometry.platform_joints'),
            ({'platform.center_of_mass': center + up}, 'platform.center_of_mass')):
        found = find_parameter_errors(PLATFORM.replaced({**limits, **changes}))
        assert any(each.startswith(f'{name}: ') and 'base' in each for each in found), found
    # The frames of positioning hexapods: all of the base below, home at zero.
    assert not find_parameter_errors(PLATFORM.replaced({
        **limits, 'geometry.base_joints': BASE - up}))


@pytest.mark.parametrize('size', [0.1, 1.0])
def test_an_inertia_about_the_origin_of_the_base_is_found_wherever_the_platform_frame_is(
        size: float) -> None:
    words = (f'and the base is {1.3 * size:.3g} m from the center of mass at home: about the '
             "base's origin?")
    for height in (0.0, 0.4 * size, -0.3 * size):
        up = np.array([0.0, 0.0, height])
        found = find_parameter_errors(Parameters({
            'geometry.base_joints': size * BASE, 'geometry.platform_joints': size * TOP + up,
            'geometry.zero_length': 1.3 * size, 'platform.mass': 150.0 * size ** 3,
            'platform.center_of_mass': size * PLATFORM['platform.center_of_mass'] + up,
            'platform.inertia': size ** 5 * OF_BASE}))
        assert any(words in each for each in found), found


# The platform joints of this hexapod are 0.6 m from their center, the base joints 0.9 m.
@pytest.mark.parametrize('gyration, words', [
    (26.0, ''), (28.0, 'in g mm^2 or kg mm^2?'), (0.6 / 190.0, ''), (0.6 / 210.0, 'scaled twice')])
def test_the_radius_of_gyration_has_bounds(gyration: float, words: str) -> None:
    moment = 150.0 * gyration ** 2
    found = find_parameter_errors(PLATFORM.replaced({
        'platform.inertia': [moment, 0.0, 0.0, moment, 0.0, moment]}))
    for suspected in ('in g mm^2 or kg mm^2?', 'scaled twice'):
        assert any(suspected in error for error in found) == (suspected == words), found


@pytest.mark.parametrize(('by', 'spread'), [
    (1, 8.0), (2, 8.0), (3, 12.0), (4, 12.0), (5, 25.0), (2, 25.0)])
def test_platform_joints_that_begin_with_another_leg_are_reported(
        by: int, spread: float) -> None:
    platform = np.roll(ring(0.6, spread, 60.0), 1, axis=0)
    right = hexapod(ring(0.9, 12.0), platform, 150.0, 20.0, geometry__zero_length=1.2)
    assert find_parameter_errors(Parameters(right)) == ()
    (error,) = find_parameter_errors(Parameters(
        {**right, 'geometry.platform_joints': np.roll(platform, by, axis=0).ravel()}))
    assert error.endswith('the joints in another order?')


def test_drives_without_reflected_mass_and_slow_ones_are_no_possible_errors() -> None:
    for change in ({'actuator.reflected_mass': 0.0},  # hydraulic
                   # a positioner of 0.5 mm/s, a screw of 1 mm
                   {'actuator.reflected_mass': 39.0, 'limits.velocity_max': 5e-4},
                   {'actuator.reflected_mass': None, 'limits.velocity_max': None,
                    'limits.force_max': None, 'actuator.viscous_friction': None,
                    'actuator.coulomb_friction': None}):
        assert find_parameter_errors(PLATFORM.replaced(change)) == ()


def test_the_figure_at_home_is_that_of_the_runtime_path() -> None:
    turned = PLATFORM.replaced({
        'geometry.platform_joints': (TOP @ from_euler([0.0, 0.0, 1.45]).T).ravel(),
        'singularity.warn_condition': 10.0, 'singularity.stop_condition': 12.0,
        'geometry.zero_length': 1.3,
        'limits.length_min': (), 'limits.length_max': ()})
    (error,) = find_parameter_errors(turned)
    assert error.startswith(
        'geometry: nearly singular at home (the axes parallel, a mean leg of 1.3 m)')
    figure = float(error.split('condition number is ')[1].split(',')[0])
    # At home the mean leg has the zero length: found again by the lengths themselves.
    platform = StewartPlatform(turned)
    heights = np.linspace(0.1, 2.0, 19001)
    position = np.zeros((len(heights), 3))
    position[:, 2] = heights
    result = platform.inverse_dynamics(Motion(position, np.eye(3)))
    home = int(np.argmin(np.abs(result.lengths.mean(axis=-1) - 1.3)))
    assert figure == pytest.approx(result.condition_number[home], rel=1e-2)


def test_a_home_that_is_turned_is_found_by_the_limits() -> None:
    # A hexapod whose platform frame is turned against the base: the axes parallel, no leg fits.
    there = ring(0.6, 12.0, 60.0)
    platform = np.roll(there, 1, axis=0) @ from_euler([0.0, 0.0, -np.pi / 2.0]).T
    good = hexapod(ring(0.9, 12.0), platform, 150.0, 20.0, limits__length_min=1.15,
                   limits__length_max=1.25)
    assert find_parameter_errors(Parameters(good)) == ()
    (error,) = find_parameter_errors(Parameters(
        {**good, 'limits.length_min': (), 'limits.length_max': ()}))
    assert 'singular at home (the axes parallel, at any height)' in error


@pytest.mark.parametrize(('changes', 'side'), [
    ({}, 1.0), ({'geometry.platform_side': 'positive'}, 1.0),
    ({'geometry.platform_side': 'negative'}, -1.0)])
def test_the_side_of_the_platform_is_a_parameter(changes: dict[str, Any], side: float) -> None:
    """Home, its first guess and the axes from which joints' angles are measured are there."""
    parameters = PLATFORM.replaced(changes)
    home = StewartPlatform(parameters).home_pose()
    assert side * home.position[2] > 0.9
    assert np.allclose(home.position, homes(parameters)[0][0])
    at_home = StewartPlatform(parameters).joint_angles(home)
    assert max(np.abs(angles).max() for angles in at_home) < 1e-6


def uneven_base() -> Array:
    """Return base joints off their plane, which stays level: the sides differ in their lengths."""
    plane = np.column_stack([np.ones(6), BASE[:, :2]])
    heights = np.array([0.4, -0.2, 0.3, 0.0, -0.4, 0.1])
    heights -= plane @ np.linalg.lstsq(plane, heights, rcond=None)[0]
    return np.column_stack([BASE[:, :2], heights])


def test_the_side_of_the_platform_is_given_by_limits_of_length() -> None:
    base = uneven_base()
    for mirror, side in ((1.0, 1.0), (-1.0, -1.0)):
        turned = Parameters({
            **{name: PLATFORM[name] for name in ('platform.mass', 'platform.inertia')},
            'geometry.base_joints': (base * [1.0, 1.0, mirror]).ravel(),
            'geometry.platform_joints': TOP.ravel()})
        level = Pose([0.0, 0.0, mirror * 1.0], np.eye(3))
        lengths = StewartPlatform(turned).inverse_kinematics(level)
        limited = turned.replaced({'limits.length_min': lengths - 0.005,
                                   'limits.length_max': lengths + 0.005})
        assert side * StewartPlatform(limited).home_pose().position[2] > 0.7


def test_home_on_the_given_side_must_be_within_the_limits(snapshot: Snapshot) -> None:
    base = uneven_base()
    parameters = PLATFORM.replaced({'geometry.base_joints': base.ravel()})
    lengths = StewartPlatform(parameters).inverse_kinematics(Pose([0.0, 0.0, 1.0], np.eye(3)))
    limited = parameters.replaced({
        'limits.length_min': lengths - 0.005, 'limits.length_max': lengths + 0.005,
        'geometry.platform_side': 'negative'})
    with snapshot.raises(ParameterError):
        StewartPlatform(limited).home_pose()


NUMBERS = st.one_of(st.floats(-3.0, 3.0), st.floats(allow_nan=False, allow_infinity=False))


@given(st.lists(NUMBERS, min_size=18, max_size=18), st.lists(NUMBERS, min_size=18, max_size=18),
       st.dictionaries(st.sampled_from([
           'geometry.zero_length', 'limits.length_min', 'limits.length_max', 'platform.mass',
           'legs.piston.inertia', 'legs.piston.center_of_mass', 'legs.piston.mass',
           'singularity.characteristic_length', 'singularity.stop_condition']), NUMBERS,
           max_size=4), st.floats(1e-300, 1e300))
@np.errstate(all='ignore')
def test_possible_errors_of_any_valid_parameters_are_short_lines(
        base: list[float], platform: list[float], changes: dict[str, float],
        moment: float) -> None:
    try:
        parameters = Parameters({
            'geometry.base_joints': base, 'geometry.platform_joints': platform,
            'platform.mass': 1.0, 'platform.inertia': [moment, 0.0, 0.0, moment, 0.0, moment],
            **changes})
    except ParameterError:
        assume(False)
    for error in find_parameter_errors(parameters):
        assert error.isprintable()
        assert len(error) < 500


def test_the_check_of_a_payload_reports_what_the_whole_check_does() -> None:
    p = PLATFORM.replaced({'platform.inertia': [1e9, 0.0, 0.0, 1e9, 0.0, 1e9],
                           'limits.length_max': 0.165, 'limits.length_min': ()})
    said, of_payload = find_parameter_errors(p), find_parameter_errors(p, geometry=False)
    assert len(said) > len(of_payload) == 1
    assert said[:1] == of_payload


# A wrong sign in a table of joints is found, and tables without one are not touched

TABLES = ('geometry.base_joints', 'geometry.platform_joints')


@pytest.mark.parametrize('table', TABLES)
@pytest.mark.parametrize('joint', range(6))
@pytest.mark.parametrize('axis', range(2))
def test_a_wrong_sign_is_found(table, joint, axis):
    good = PLATFORM[table]
    joints = good.copy()
    joints[joint, axis] *= -1.0
    odd = odd_joint(joints)
    # A sign may move a joint onto its mirror image; then the wrong joint is not identifiable.
    twins = [n for n in range(6) if np.array_equal(joints[n], joints[joint])]
    assert odd.joint in twins
    if len(twins) == 1:
        assert odd.expected == pytest.approx(good[joint], abs=2e-3)


@pytest.mark.parametrize('table', TABLES)
@pytest.mark.parametrize('off', [0.005, 0.02])
def test_a_wrong_digit_that_moves_a_joint_a_little_is_found(table, off):
    """The other five fit far better: by the four digits of the file."""
    good = PLATFORM[table]
    for seed in range(10):
        random, joints = rng(seed), good.copy()
        joint, axis = random.integers(6), random.integers(2)
        joints[joint, axis] += off
        odd = odd_joint(np.round(joints, 4))
        assert odd.joint == joint
        assert odd.expected == pytest.approx(good[joint], abs=3e-4)


@pytest.mark.parametrize('joint', range(6))
@pytest.mark.parametrize('axis', range(2))
def test_a_wrong_sign_among_mirror_images_is_found(joint: int, axis: int) -> None:
    angles, radii = np.deg2rad([10.0, -10.0, 80.0, -80.0, 160.0, -160.0]), [0.9, 0.7, 1.1]
    good = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(6)])
    good = (good * np.repeat(radii, 2)[:, None])[:, [axis, 1 - axis, 2]]
    joints = good.copy()
    joints[joint, axis] *= -1.0  # mirrored at the axis that the mirror images leave alone
    odd = odd_joint(joints)
    assert odd is not None and 'mirror images' in odd.symmetry
    assert odd.joint // 2 == joint // 2  # either of the pair may be wrong
    image = joints[odd.joint ^ 1] * np.where(np.arange(3) == 1 - axis, -1.0, 1.0)
    assert odd.expected == pytest.approx(image, abs=1e-12)


@pytest.mark.parametrize('error', [0.0, 1e-9, 1e-4, 1e-2])
@pytest.mark.parametrize('table', TABLES)
def test_symmetric_and_calibrated_hexapods_have_no_odd_joint(table, error):
    good = PLATFORM[table]
    for seed in range(25 if error else 1):
        assert odd_joint(good + rng(seed).normal(size=(6, 3)) * error) is None


@pytest.mark.parametrize('digits', [3, 5, 12])
def test_rounded_hexapods_have_no_odd_joint(digits):
    random = rng()
    for _ in range(30):
        radius, half, begin = random.uniform([0.2, 0.1, 0.0], [1.5, 0.5, 2.0])
        angles = begin + half * np.tile([-1.0, 1.0], 3) + np.repeat(np.arange(3), 2) * 2.0944
        joints = radius * np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles])
        assert odd_joint(np.round(joints, digits)) is None


def test_irregular_hexapods_have_no_odd_joint():
    for seed in range(15):
        p = random_parameters(rng(seed))
        assert [odd_joint(p[table]) for table in TABLES] == [None, None]


def test_the_possible_error_names_the_leg_and_the_place():
    p = PLATFORM
    joints = p['geometry.platform_joints'].copy()
    joints[2, 1] *= -1.0
    errors = StewartPlatform(p.replaced({'geometry.platform_joints': joints})).check()
    assert len(errors) == 1
    assert errors[0].startswith('geometry.platform_joints: leg_')
    assert 'repeat after a third of a turn' in errors[0]


def test_legs_that_share_a_joint_or_are_all_cylinder_are_reported() -> None:
    shape = {'legs.cylinder.radius': 0.02, 'legs.piston.radius': 0.01, 'legs.cylinder.length': 0.1,
             'limits.leg_clearance_min': 0.005}
    p = PLATFORM.replaced(shape)
    assert find_parameter_errors(p) == find_parameter_errors(PLATFORM)
    joints = p['geometry.base_joints'].copy()
    joints[1] = joints[0]
    found = find_parameter_errors(p.replaced({'geometry.base_joints': joints.ravel()}))
    assert any('limits.leg_clearance_min: 0.005 m, but leg_1 and leg_2 have the same place in '
               'geometry.base_joints' in each for each in found)
    found = find_parameter_errors(p.replaced({'legs.cylinder.length': 400.0}))
    assert any('legs.cylinder.length: 400 m, but leg_1 can be as short as' in each
               for each in found)


# Drives

# 10 mm ball screw, belt 2 : 1, a servo motor of 400 W.
GOOD_DRIVE: dict[str, Any] = {
    'actuator.reflected_mass': None, 'actuator.screw_lead': 0.01, 'drive.gear_ratio': 2.0,
    'drive.motor_inertia': 3e-5, 'drive.screw_inertia': 6e-5, 'drive.efficiency': 0.9,
    'drive.torque_max': 6.0, 'drive.torque_continuous': 2.0, 'drive.speed_max': 700.0,
    'drive.torque_speed': [0.0, 6.0, 500.0, 6.0, 700.0, 4.0]}


def drive_errors(**changes: Any) -> tuple[str, ...]:
    return find_parameter_errors(PLATFORM.replaced({**GOOD_DRIVE, **{
        name.replace('__', '.'): value for name, value in changes.items()}}))


def test_a_good_drive_gives_no_warning() -> None:
    assert drive_errors() == ()
    assert drive_errors(limits__velocity_max=None, limits__force_max=None) == ()
    assert drive_errors(drive__speed_max=None, drive__torque_speed=None) == ()
    assert drive_errors(drive__torque_max=None, drive__torque_continuous=None) == ()
    assert drive_errors(drive__gear_ratio=1.0, actuator__screw_lead=0.005) == ()
    # the thrust rating of the cylinder under its own name, or of a rotor that weighs little
    assert drive_errors(limits__force_max=None, limits__joint_force_max=1500.0) == ()
    assert drive_errors(limits__force_max=1500.0, limits__joint_force_max=1500.0) == ()
    assert drive_errors(limits__force_max=1500.0, drive__motor_inertia=2e-6,
                        drive__screw_inertia=0.0) == ()
    # the published machine: 8.2 N m, lead 5 mm, 3 : 1, for a slower and heavier hexapod
    assert drive_errors(drive__gear_ratio=3.0, actuator__screw_lead=0.005, drive__torque_max=8.2,
                        drive__motor_inertia=1.37e-4, drive__torque_speed=None,
                        limits__velocity_max=0.16, limits__force_max=25e3) == ()


@pytest.mark.parametrize(('changes', 'begin', 'end'), [
    ({'actuator__screw_lead': 10.0}, 'actuator.screw_lead: 10 m for one turn', 'in mm?'),
    ({'actuator__screw_lead': 0.01 / (2.0 * math.pi)},
     'actuator.screw_lead: 0.00159155 m: the motors can push ', 'It is that of one turn'),
    ({'drive__gear_ratio': 0.5}, 'drive.gear_ratio: 0.5: the motors can push ',
     'in one turn of the screw'),
    ({'drive__gear_ratio': 1.0 / 3.0, 'actuator__screw_lead': 0.005, 'drive__torque_max': 8.2,
      'drive__torque_speed': None, 'limits__velocity_max': 0.16, 'limits__force_max': 25e3},
     'drive.gear_ratio: 0.333333: the motors can push ', 'in one turn of the screw'),
    ({'drive__motor_inertia': 0.3}, 'drive.motor_inertia: 0.3 kg m^2 reaches', 'at the screw?'),
    ({'drive__motor_inertia': [0.2] + [0.3] * 5}, 'drive.motor_inertia: 0.3 kg m^2 reaches',
     'at the screw?'),
    ({'drive__motor_inertia': [2e-9] + [3e-9] * 5, 'drive__screw_inertia': 0.0},
     'drive.motor_inertia: 2e-09 kg m^2 reaches', 'at the screw?'),
    ({'drive__motor_inertia': None}, 'drive.motor_inertia: missing', 'without inertia'),
    ({'drive__screw_inertia': 0.6}, 'drive.screw_inertia: 0.6 kg m^2 is 0.15 kg m^2 at the motor',
     'at another shaft?'),
    ({'drive__gear_ratio': [4.0] * 5 + [1.0], 'drive__screw_inertia': [2.0] * 5 + [0.3]},
     'drive.screw_inertia: 0.3 kg m^2 is 0.3 kg m^2 at the motor', 'at another shaft?'),
    ({'drive__speed_max': 6700.0}, 'drive.speed_max: 6700 rad/s, 63980 rpm', 'in rpm?'),
    ({'drive__torque_speed': [0.0, 6.0, 6700.0, 4.0]}, 'drive.torque_speed: 6700', 'in rpm?'),
    ({'drive__torque_max': 0.06, 'drive__torque_continuous': None, 'drive__torque_speed': None,
      'drive__motor_inertia': 3e-7, 'drive__screw_inertia': 0.0, 'limits__force_max': None},
     'drive.torque_max: 0.06 N m', 'less than a sixth of the weight'),
    ({'limits__force_max': 1500.0}, 'limits.force_max: 1.5e+03 N: the motors can push ',
     'It is limits.joint_force_max'),
])
def test_a_possible_error_in_a_drive_is_reported(
        changes: dict[str, Any], begin: str, end: str) -> None:
    found = drive_errors(**changes)
    about = [line for line in found if line.startswith(begin)]
    assert about, found
    assert about[0].endswith(end) and all(len(line) < 400 for line in found)


# Data of a servo motor of 400 W: 1500 s for windings with housing, 4 A at 2 N m.
HEAT = {'drive__torque_constant': 0.5, 'drive__resistance': 0.8, 'drive__thermal_resistance': 0.7,
        'drive__thermal_time_constant': 1500.0}


def test_a_motor_with_its_heat_gives_no_warning() -> None:
    assert drive_errors(**HEAT) == ()
    assert drive_errors(**HEAT, drive__back_driving_efficiency=0.9) == ()


@pytest.mark.parametrize(('changes', 'begin'), [
    ({**HEAT, 'drive__thermal_time_constant': 25.0}, 'drive.thermal_time_constant: 25 s'),
    ({**HEAT, 'drive__resistance': 800.0}, 'drive.resistance: 800 Ohm'),
    ({**HEAT, 'drive__torque_constant': 500.0, 'drive__resistance': 8e8},
     'drive.resistance: 8e+08 Ohm'),
    ({'drive__torque_constant': 0.5, 'drive__resistance': 8000.0}, 'drive.resistance: 8000 Ohm'),
    ({'drive__efficiency': 0.3, 'drive__back_driving_efficiency': 0.9, 'limits__force_max': 2000.0,
      }, 'drive.back_driving_efficiency: 0.9, but drive.efficiency is 0.3'),
    ({'drive__torque_max': 0.2, 'drive__torque_continuous': None, 'drive__torque_speed': None,
      'limits__force_max': None, 'drive__motor_inertia': 1e-6, 'drive__screw_inertia': 0.0},
     'drive.torque_max: 0.2 N m: '),
])
def test_data_of_a_motor_that_no_motor_has_are_reported(changes: dict[str, Any], begin: str,
                                                        ) -> None:
    found = drive_errors(**changes)
    assert len(found) == 1
    assert found[0].startswith(begin)


@pytest.mark.parametrize(('changes', 'end'), [
    ({'limits.velocity_max': 30.0}, 'in m/min or mm/s?'),
    ({'limits.platform_joint_angle_max': math.radians(1.0)}, 'converted from degrees twice?')])
def test_limits_that_the_strokes_contradict_are_reported(changes: dict[str, Any], end: str,
                                                         ) -> None:
    found = find_parameter_errors(PLATFORM.replaced(changes))
    assert len(found) == 1
    assert found[0].endswith(end)


def moved(base: float, platform: float, center: float, scale: float = 1.0) -> Parameters:
    """Return PLATFORM with its frames moved along z, and a center of mass at a height."""
    p = PLATFORM
    inertia = scale ** 2 * p['platform.inertia']
    return p.replaced({
        'geometry.base_joints': scale * (p['geometry.base_joints'] + [0.0, 0.0, base]),
        'geometry.platform_joints': scale * (p['geometry.platform_joints'] + [0.0, 0.0, platform]),
        'platform.center_of_mass': [0.0, 0.0, scale * center], 'platform.inertia': inertia})


@pytest.mark.parametrize('center', [0.0, 1e-18, -1e-18, 0.05, -0.05])
@pytest.mark.parametrize('offset', [0.0, 0.02, -0.1, 1e-18])
def test_a_base_frame_at_the_home_of_the_platform_is_no_possible_error(
        center: float, offset: float) -> None:
    """As positioning hexapods have it: the base joints below, home at zero."""
    home = home_of(PLATFORM)
    middle = PLATFORM['geometry.base_joints'].mean(axis=0)[2]
    joints = PLATFORM['geometry.platform_joints'].mean(axis=0)[2]
    p = moved(offset - middle - float(home.heights[0]), offset - joints, center)
    assert find_parameter_errors(p) == ()
