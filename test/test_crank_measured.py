# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Measured angles and torques of cranks: pose, external wrench, payload, possible errors."""

from __future__ import annotations

import json
from pathlib import Path
import re
from typing import Any

import messages
import numpy as np
from numpy.typing import NDArray
from programs import call
import pytest
from referees import rng, ROOT
from stewart_dynamics import (
    Motion, ParameterError, Parameters, PoseError, SingularityError, StewartPlatform)
from stewart_dynamics.estimation.uncertainty import root_of_covariance
from stewart_dynamics.external_wrench.effort_check import EffortCheck
from stewart_dynamics.external_wrench.estimate import Estimate, ExternalWrench, Measurement
from stewart_dynamics.external_wrench.measured_legs import LegHistory, MeasuredLegs
from stewart_dynamics.external_wrench.payload import identify
from stewart_dynamics.mechanics.dynamics.linear_parameters import linear_parameters
from stewart_dynamics.mechanics.rows import NO_BASE
from stewart_dynamics.messages.joint_state import JointStateWriter
from stewart_dynamics.replay.replay_command_line import main as replay

Array = NDArray[np.float64]

CRANKS = ROOT / 'config' / 'crank_platform.yaml'
# All but the payload is known well, so that errors are those of the measurements.
RIG = Parameters.from_yaml(CRANKS).replaced({f'uncertainty.{name}': 1e-4 for name in (
    'leg_mass', 'reflected_mass', 'effort_gain', 'tilt')})
PLATFORM = StewartPlatform(RIG)
HOME = PLATFORM.home_pose().position
BEGIN = 2_000_000_000
NO_LOAD = (0.0,) * 6
DRIVES = '    drive: {gear_ratio: 30.0, torque_constant: 0.12, efficiency: 0.8}\n'
LOAD = np.array([40.0, -30.0, -200.0, 8.0, 5.0, -6.0])


def six(values: Any) -> Any:
    return tuple(np.asarray(values, dtype=float).tolist())


def swaying(times: Array) -> Motion:
    """Return a motion of all six coordinates about home."""
    rates = 2.0 * np.pi * np.array([0.7, 0.9, 0.6, 0.8, 1.1, 1.0])
    sizes = np.array([0.04, 0.04, 0.04, 0.1, 0.1, 0.12])
    sine, cosine = np.sin(rates * times[:, None]), np.cos(rates * times[:, None])
    x, v, a = sizes * sine, sizes * rates * cosine, -sizes * rates ** 2 * sine
    return Motion.from_euler(HOME + x[:, :3], x[:, 3:], v[:, :3], v[:, 3:], a[:, :3], a[:, 3:])


def measured(times: Array, load: Any = None, parameters: Parameters = RIG) -> list[Measurement]:
    """Return measurements of a motion under a load; efforts act between two of them."""
    platform = StewartPlatform(parameters)
    at = platform.inverse_dynamics(swaying(times))
    middle = times - 0.5 * (times[1] - times[0])
    acting = platform.inverse_dynamics(swaying(middle), load)
    return [Measurement(BEGIN + round(1e9 * time), six(angles), six(speeds), six(torques))
            for time, angles, speeds, torques in zip(
                times, at.angles, at.speeds, acting.torques, strict=True)]


def test_an_external_wrench_follows_from_angles_and_torques() -> None:
    times = 0.001 * np.arange(2000)
    step, last = ExternalWrench(RIG.replaced({'external_wrench.cutoff': 50.0})), None
    for each in measured(times, LOAD):
        last = step(each, last, NO_LOAD, None)
    assert last is not None and last.wrench is not None
    motion = swaying(times[-1:])
    np.testing.assert_allclose(last.motion[:3], motion.position[0], atol=1e-12)
    np.testing.assert_allclose(last.motion[12:18], motion.rows[0, 12:18], atol=1e-9)
    # The acceleration is that of the middle between two samples.
    np.testing.assert_allclose(last.wrench, LOAD, atol=1e-3 * np.abs(LOAD).max())


def test_angles_without_an_assembly_are_an_error_that_names_them() -> None:
    angles = (1.5, 1.5, 1.5, -1.5, -1.5, -1.5)
    with pytest.raises((PoseError, SingularityError), match=r'angles \[1.5, 1.5, .*\] rad'):
        ExternalWrench(RIG)(Measurement(BEGIN, angles, NO_LOAD, NO_LOAD), None, NO_LOAD, None)


def test_angles_beyond_a_dead_centre_are_an_error() -> None:
    angles = (2.5,) * 6
    with pytest.raises(PoseError, match=r'angles \[2.5, .*\] rad: the pose is beyond a dead'):
        step = ExternalWrench(RIG)
        last = step(measured(np.array([0.0, 0.001]))[0], None, NO_LOAD, None)
        step(Measurement(BEGIN + 1000, angles, NO_LOAD, NO_LOAD), last, NO_LOAD, None)
    with pytest.raises(PoseError, match='the pose is beyond a dead centre of a leg'):
        PLATFORM.forward_kinematics(angles)


@pytest.mark.parametrize('factor, words', [
    (1e2 / 9.80665, 'kgf cm in place of N m'), (1e3, 'mN m in place of N m'),
    (-1.0, '+ must drive the angle up')])
def test_torques_in_another_unit_are_a_possible_error(factor: float, words: str) -> None:
    check, step, last = EffortCheck(RIG), ExternalWrench(RIG), None
    for each in measured(0.002 * np.arange(1500)):
        each = each._replace(efforts=six(factor * np.array(each.efforts)))
        last = step(each, last, NO_LOAD, None)
        check.add(last.stamp, each.efforts, last.differences)
    assert check.possible_error is not None
    assert words in check.possible_error.text


@pytest.mark.parametrize('masses', [0.0, 1.0])
def test_prior_deviations_are_those_of_a_relative_change(masses: float) -> None:
    p = RIG.replaced({'legs.crank.mass': masses, 'uncertainty.leg_mass': 0.1,
                      'legs.crank.center_of_mass': [0.06, 0.01, -0.02] * 6,
                      'legs.crank.inertia': [
                          masses * each for each in (0.02, 0.001, 0.0, 0.02, 0.0, 0.0108)] * 6})
    count = len(linear_parameters(p))
    root = root_of_covariance(p, p.carried, np.zeros(count))
    assert root.shape == (count, count)
    covariance, step = root @ root.T, 1e-5
    theta, expected = linear_parameters(p), np.zeros((72, 72))
    inertia, size = p['legs.rod.mass'] * p['legs.rod.length'] ** 2 / 12.0, p['legs.rod.length']
    p = p.replaced({'legs.rod.inertia': inertia, 'legs.rod.center_of_mass': 0.5 * size})
    for name in ('crank.mass', 'crank.center_of_mass', 'crank.inertia', 'rod.mass',
                 'rod.center_of_mass', 'rod.inertia'):
        value = np.asarray(p[f'legs.{name}'])
        if not np.any(value):
            continue
        for legs in ([0, 1, 2, 3, 4, 5], *([n] for n in range(6))):
            changed = np.broadcast_to(value, (6, *value.shape[1:])).copy()
            changed[legs] *= 1.0 + step
            by = 0.1 / step * (linear_parameters(p.replaced({
                f'legs.{name}': changed.ravel().tolist()})) - theta)[10:82]
            expected += np.outer(by, by)
    np.testing.assert_allclose(covariance[10:82, 10:82], expected, atol=1e-4 * max(
        float(np.abs(expected).max()), 1e-12))


def test_a_payload_is_identified_from_angles_and_torques() -> None:
    loaded = RIG.replaced({'platform.mass': 240.0, 'platform.center_of_mass': [0.08, 0.03, 0.42],
                           'platform.inertia': [31.0, 0.3, -0.8, 36.0, 0.4, 27.0]})
    random, times = rng(1), 0.002 * np.arange(5001)
    platform, motion = StewartPlatform(loaded), swaying(times)
    torques = platform.inverse_dynamics(swaying(times - 0.001)).torques
    torques = torques + 0.5 * random.normal(size=torques.shape)
    history = LegHistory(RIG['payload.window'])
    for time, row, efforts in zip(times, motion.rows, torques, strict=True):
        history.add_measurement(six(efforts), Estimate(
            BEGIN + round(1e9 * time), six(row), None, None, NO_BASE), NO_LOAD)
    *pieces, last = identify(history, PLATFORM)
    assert not any(pieces) and last is not None and last.payload is not None, last
    fitted = last.payload.fitted
    numbers = np.array([fitted.body.mass, *fitted.body.center, *fitted.body.inertia])
    true = np.array([240.0, 0.08, 0.03, 0.42, 31.0, 0.3, -0.8, 36.0, 0.4, 27.0])
    assert fitted.known.all()
    assert (np.abs(numbers - true) < 2.0 * fitted.half_widths).all()
    assert fitted.half_widths[0] < 1.0


@pytest.mark.parametrize('saturated', [False, True])
def test_saturated_torques_and_cranks_at_their_ends_are_not_used(saturated: bool) -> None:
    limits = {'limits.torque_max': 60.0} if saturated else {'limits.angle_max': 0.1}
    history, times = LegHistory(RIG['payload.window']), 0.002 * np.arange(5001)
    torques = PLATFORM.inverse_dynamics(swaying(times - 0.001)).torques
    if saturated:
        torques = np.clip(torques, -60.0, 60.0)
    for time, row, efforts in zip(times, swaying(times).rows, torques, strict=True):
        history.add_measurement(six(efforts), Estimate(
            BEGIN + round(1e9 * time), six(row), None, None, NO_BASE), NO_LOAD)
    *_, last = identify(history, StewartPlatform(RIG.replaced(limits)))
    assert last is not None
    assert 'measurements not used: efforts at limits.torque_max or legs at their ends' in (
        last.message)


@pytest.mark.parametrize('option', ['', '--motor-torque', '--motor-current'])
def test_the_replay_compares_torques_and_currents_of_the_motors(
        option: str, tmp_path: Path) -> None:
    params = tmp_path / 'rig.yaml'
    params.write_text(CRANKS.read_text() + DRIVES)
    drives = Parameters.from_yaml(params)
    times = 0.005 * np.arange(1000)
    motion, platform = swaying(times), StewartPlatform(drives)
    result, motors = platform.inverse_dynamics(motion), platform.motors(motion)
    efforts = {'': result.torques, '--motor-torque': motors.torques,
               '--motor-current': motors.currents}[option]
    stamps = [1_700_000_000_000_000_000 + round(1e9 * time) for time in times]
    bag = messages.write_bag(tmp_path / 'bag', [
        *messages.setpoints(np.array(stamps), motion), *messages.leg_states(
            np.array(stamps), drives.joints, result.angles, result.speeds, efforts)])
    options = [option] * bool(option)
    call(replay, bag, '--params', params, '--output', tmp_path / 'results', '--measured',
         '/stewart_dynamics/measured_legs', *options)
    summary = json.loads((tmp_path / 'results' / 'bag' / 'summary.json').read_text())
    found = summary['measured']
    assert found['setpoints_compared'] > 990
    assert found['residual_rms_n_m'] < 1e-9 * np.abs(result.torques).max()
    assert found['likely_mistake'] is None
    assert found['headline'].startswith('measured and computed torques differ by ')


@pytest.mark.parametrize('efforts', ['motor_torques', 'motor_currents'])
@pytest.mark.parametrize('file', [CRANKS, ROOT / 'config' / 'platform.yaml'], ids=['cranks', ''])
def test_measured_torques_and_currents_of_motors_are_taken(file: Path, efforts: str) -> None:
    p = Parameters.from_yaml(file).replaced({
        'drive.gear_ratio': 3.0, 'drive.torque_constant': 0.12, 'drive.efficiency': 0.8,
        'external_wrench.efforts': efforts, 'external_wrench.cutoff': 50.0,
        **({'actuator.screw_lead': 0.01} if file != CRANKS else {})})
    platform, times = StewartPlatform(p), 0.001 * np.arange(1000)
    home, kind = platform.home_pose().position, p.leg_kind

    def moving(at: Array) -> Motion:
        rows = swaying(at).rows.copy()
        rows[:, :3] += home - HOME
        return Motion.of_rows(rows)

    at, middle = platform.inverse_dynamics(moving(times)), moving(times - 0.0005)
    motors = platform.motors(middle, LOAD)
    given = motors.torques if efforts == 'motor_torques' else motors.currents
    rejected: list[Any] = []
    follow = MeasuredLegs(p, ExternalWrench(p), lambda *each: rejected.append(each), print)
    states, found = JointStateWriter(p.joints), None
    positions, rates = (getattr(at, each.field) for each in (kind.position, kind.rate))
    for n, time in enumerate(times):
        found = follow.use_message(states.write(
            BEGIN + round(1e9 * time), positions[n] - p.geometry.zero_length, rates[n], given[n],
            ), NO_LOAD, None)
    assert found is not None and found.wrench is not None and not rejected
    assert follow.possible_error is None
    np.testing.assert_allclose(found.wrench, LOAD, atol=0.02 * np.abs(LOAD).max())


@pytest.mark.parametrize('file, changes, words', [
    (CRANKS, {'external_wrench.efforts': 'motor_currents'},
     'drive.torque_constant: not set: needed by external_wrench.efforts: motor_currents'),
    (ROOT / 'config' / 'platform.yaml', {'external_wrench.efforts': 'motor_torques'},
     'actuator.screw_lead: not set: needed by external_wrench.efforts: motor_torques'),
    (CRANKS, {'external_wrench.efforts': 'motor_torques', 'drive.efficiency': 0.4},
     'drive.back_driving_efficiency, -0.5, must be more than 0')])
def test_efforts_of_motors_need_their_parameters(
        file: Path, changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ParameterError, match=re.escape(words)):
        Parameters.from_yaml(file).replaced(changes)
