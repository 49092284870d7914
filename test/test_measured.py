# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Measured leg forces against computed ones: known loads, stamps out of order."""

from __future__ import annotations

from collections.abc import Sequence
import json
import math
from typing import Any, NamedTuple

from hypothesis import given
from hypothesis import strategies as st
from msgspec import to_builtins
import numpy as np
from numpy.typing import NDArray
import pytest
from referees import random_parameters, rng, size_of
from snapshot import Snapshot

from stewart_dynamics import Motion, ParameterError, Parameters, StewartPlatform
from stewart_dynamics.mechanics.drives.measured_efforts import force_per_effort
from stewart_dynamics.replay.residuals import Comparison
from stewart_dynamics.replay.summary_text import _measured_lines
from stewart_dynamics.setpoints.step import Batch, Outputs, Step
from stewart_dynamics.whole_file import to_json

Array = NDArray[np.float64]

SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND
TIMEOUT = 0.1


class Case(NamedTuple):
    """A hexapod in a motion, and the outputs of the step."""

    parameters: Parameters
    motion: Motion
    seconds: Array
    setpoints: Batch
    outputs: Outputs

    def forces(self, wrench: Any = None, parameters: Parameters | None = None) -> Array:
        """Return the leg forces of the motion under a load, of this hexapod or another."""
        forces: Array = StewartPlatform(parameters or self.parameters).inverse_dynamics(
            self.motion, wrench).forces
        return forces

    def later(self, seconds: int) -> Case:
        """Return the same some time later."""
        stamps = self.setpoints.stamps + seconds * SECOND
        return self._replace(seconds=self.seconds + seconds,
                             setpoints=self.setpoints._replace(stamps=stamps))

    def part(self, which: Any) -> Case:
        """Return some of the setpoints."""
        motion = Motion(*(each[which] for each in (
            self.motion.position, self.motion.rotation, self.motion.linear_velocity,
            self.motion.angular_velocity, self.motion.linear_acceleration,
            self.motion.angular_acceleration)))
        batch = self.setpoints.chosen(which)
        return Case(self.parameters, motion, self.seconds[which], batch,
                    Step(self.parameters)(batch))


def case_of(seed: int = 0, many: int = 500, step: float = 0.01,
            stamps: Sequence[int] | None = None) -> Case:
    """Return a random hexapod that moves about its home pose."""
    random = rng(seed)
    parameters = random_parameters(random)
    size = size_of(parameters)
    times = np.arange(many) * step
    amplitudes, w = random.uniform(0.05, 0.15, (2, 3)), random.uniform(2.0, 6.0, (2, 3))
    phases = random.uniform(0.0, 6.0, (2, 3))

    def wave(part: int, order: int) -> Array:
        return amplitudes[part] * w[part] ** order * np.sin(
            times[:, None] * w[part] + phases[part] + order * math.pi / 2.0)

    motion = Motion.from_euler(
        size * (wave(0, 0) + [0.0, 0.0, 1.0]), wave(1, 0), size * wave(0, 1), wave(1, 1),
        size * wave(0, 2), wave(1, 2))
    stamp = np.array(stamps) if stamps is not None else START + np.arange(many) * round(step * 1e9)
    batch = Batch.from_parts(stamp, motion.rows, restarts=np.diff(stamp, prepend=stamp[0]) < 0)
    seconds = np.cumsum(np.diff(stamp, prepend=stamp[0]).clip(0)) * 1e-9
    return Case(parameters, motion, seconds, batch, Step(parameters)(batch))


def compared(comparison: Comparison, *given: Any) -> list[Array]:
    """Return all that was compared: given are parts, each a case or (stamps, efforts)."""
    blocks = []
    for each in given:
        if isinstance(each, Case):
            blocks.append(comparison.add_setpoints(each.seconds, each.setpoints, each.outputs))
        else:
            blocks.append(comparison.add_measured(*each))
    blocks.append(comparison.finish())
    return [np.concatenate(each) for each in zip(*blocks, strict=True)]


def values_of(case: Case, measured: Array) -> dict[str, Any]:
    """Return the result for forces that are measured at every setpoint."""
    comparison = Comparison(case.parameters)
    compared(comparison, case, (case.setpoints.stamps, measured))
    found: dict[str, Any] = to_builtins(comparison.values())
    return found


def test_stamps_of_arrival_are_a_possible_error() -> None:
    case = case_of()
    forces, stamps = case.forces(), case.setpoints.stamps
    n = np.arange(len(stamps))
    bursts = stamps[np.minimum(n - n % 5 + 4, n[-1])] + n % 5 * 10_000
    for times, expected in ((stamps, 0), (bursts, 1)):
        comparison = Comparison(case.parameters)
        compared(comparison, case, (times, forces))
        assert len(comparison.stamps.possible_errors(True, ['measured'])) == expected


# The residual and the external wrench

@pytest.mark.parametrize('seed', range(4))
def test_the_external_wrench_is_the_load_missing_in_the_model(seed: int) -> None:
    case = case_of(seed)
    load = rng(seed).uniform(-300.0, 300.0, (500, 6))
    forces = case.forces(load)
    comparison = Comparison(case.parameters)
    seconds, measured, computed, wrench = compared(
        comparison, case, (case.setpoints.stamps, forces))
    assert np.array_equal(seconds, case.seconds)
    assert np.array_equal(measured, forces)
    assert np.array_equal(computed, case.outputs.demanded_efforts)
    assert np.max(np.abs(wrench - load)) < 1e-9 * np.max(np.abs(forces))
    # by the library's matrix
    j_inv = StewartPlatform(case.parameters).inverse_jacobian(case.motion)
    assert np.allclose(wrench, np.einsum('nij,ni->nj', j_inv, computed - measured),
                       rtol=0.0, atol=1e-9 * np.max(np.abs(forces)))

    values = to_builtins(comparison.values())
    assert values['setpoints_compared'] == 500
    assert values['setpoints_not_compared'] == {'without_measurement': 0, 'without_force': 0}
    for number, (axis, unit) in enumerate([
            ('force_x', 'n'), ('force_y', 'n'), ('force_z', 'n'),
            ('moment_x', 'n_m'), ('moment_y', 'n_m'), ('moment_z', 'n_m')]):
        column, found = wrench[:, number], values['external_wrench'][axis]
        at = int(np.argmax(np.abs(column)))
        assert found == {
            f'rms_{unit}': pytest.approx(np.sqrt(np.mean(column ** 2)), rel=1e-12),
            f'mean_{unit}': pytest.approx(np.mean(column), rel=1e-9),
            f'peak_{unit}': column[at], 'peak_at_s': seconds[at]}
    residual = measured - computed
    for number, joint in enumerate(case.parameters['joints']):
        found = values['legs'][joint]
        at = int(np.argmax(np.abs(residual[:, number])))
        assert found['residual_peak_n'] == residual[at, number]
        assert found['residual_peak_at_s'] == seconds[at]
        assert found['residual_rms_n'] == pytest.approx(
            np.sqrt(np.mean(residual[:, number] ** 2)), rel=1e-12)
        assert found['residual_mean_n'] == pytest.approx(np.mean(residual[:, number]), rel=1e-9)
        assert found['measured_rms_n'] == pytest.approx(
            np.sqrt(np.mean(measured[:, number] ** 2)), rel=1e-12)
        assert found['computed_rms_n'] == pytest.approx(
            np.sqrt(np.mean(computed[:, number] ** 2)), rel=1e-12)
        assert found['correlation'] == pytest.approx(
            np.corrcoef(measured[:, number], computed[:, number])[0, 1], rel=1e-9)
    assert 'NaN' not in to_json(values)


def test_a_load_in_the_model_leaves_no_residual() -> None:
    case = case_of()
    load = rng().uniform(-300.0, 300.0, (500, 6))
    batch = case.setpoints
    with_load = Batch.from_parts(batch.stamps, batch.motions, load)
    outputs = Step(case.parameters)(with_load)
    comparison = Comparison(case.parameters)
    _, _, _, wrench = compared(
        comparison, case._replace(setpoints=with_load, outputs=outputs),
        (batch.stamps, case.forces(load)))
    assert np.max(np.abs(wrench)) < 1e-9
    assert to_builtins(comparison.values())['contacts']['count'] == 0


def test_a_contact_may_last_for_nearly_half_of_the_bag() -> None:
    case = case_of(many=1000)
    load = np.where(((case.seconds >= 3.0) & (case.seconds < 7.0))[:, None],
                    [0.0, 0.0, -200.0, 0.0, 0.0, 0.0], 0.0)
    forces = case.forces(load)
    scale = np.sqrt(np.mean(forces ** 2))
    contacts = values_of(case, forces + 1e-4 * scale * rng().normal(size=forces.shape))['contacts']
    assert contacts['count'] == 1
    assert contacts['strongest'][0]['from_s'] == pytest.approx(3.0, abs=0.02)
    assert contacts['strongest'][0]['to_s'] == pytest.approx(7.0, abs=0.02)
    assert contacts['strongest'][0]['force_n'][2] == pytest.approx(-200.0, rel=0.2)


def test_the_headline_names_the_difference_and_the_leg_where_it_is_largest() -> None:
    case = case_of()
    offsets = np.array([1.0, 0.0, -2.0, 0.0, 20.0, 0.0])
    measured = case.forces() + offsets
    values = values_of(case, measured)
    rms = np.sqrt(np.mean(offsets ** 2))
    share = rms / np.sqrt(np.mean(measured ** 2))
    assert values['residual_rms_n'] == pytest.approx(rms, rel=1e-9)
    assert values['residual_share'] == pytest.approx(share, rel=1e-9)
    assert values['headline'] == (
        f'measured and computed forces differ by {rms:.3g} N RMS, {100.0 * share:.3g} % of the '
        'measured force; most in leg_5, by 20 N')


@pytest.mark.parametrize('screws', ['guided', 'universal'])
@pytest.mark.parametrize('back', [None, 0.3])
def test_torques_of_motors_are_compared_without_the_losses_of_the_drives(
        screws: str, back: float | None) -> None:
    case = case_of()
    p = case.parameters.replaced({
        'actuator.reflected_mass': None, 'actuator.screw_lead': 0.02, 'drive.motor_inertia': 1e-4,
        'drive.efficiency': 0.8, 'drive.back_driving_efficiency': back,
        'drive.screw_rotation': screws})
    torques = StewartPlatform(p).motors(case.motion).torques
    comparison = Comparison(p, of_motors=True)
    per_effort = force_per_effort(p, torques=True, currents=False)
    _, measured, computed, _ = compared(
        comparison, case._replace(parameters=p, outputs=Step(p)(case.setpoints)),
        (case.setpoints.stamps, torques * per_effort))
    np.testing.assert_allclose(measured, computed, rtol=1e-9, atol=1e-9 * np.abs(computed).max())
    assert np.abs(torques * per_effort - computed).max() > 0.05 * np.abs(computed).max()


@pytest.mark.parametrize('efficiency', [1.0, 0.75])
def test_forces_given_as_torques_of_motors_are_named(efficiency: float) -> None:
    case = case_of()
    p = case.parameters.replaced({
        'actuator.reflected_mass': None, 'actuator.screw_lead': 0.02,
        'drive.torque_constant': 0.5, 'drive.efficiency': efficiency})
    case = case._replace(parameters=p, outputs=Step(p)(case.setpoints))
    for currents in (False, True):
        per_effort = force_per_effort(p, torques=not currents, currents=currents)
        comparison = Comparison(p, of_motors=True)
        compared(comparison, case, (case.setpoints.stamps, case.forces() * per_effort))
        found = to_builtins(comparison.values())['likely_mistake']
        assert found['what'] == 'force'
        assert 'likely forces at the legs in place of torques or currents' in found['text']


def test_torques_of_self_locking_screws_are_rejected(snapshot: Snapshot) -> None:
    p = case_of().parameters.replaced({
        'actuator.reflected_mass': None, 'actuator.screw_lead': 0.02, 'drive.efficiency': 0.3})
    with snapshot.raises(ParameterError):
        force_per_effort(p, torques=True, currents=False)


# Contacts

@pytest.mark.parametrize(('factor', 'what', 'words'), [
    (-1.0, 'sign', 'the efforts have the opposite sign'), (1e-3, 'unit', 'kN in place of N'),
    (0.0, 'zero', 'all efforts are zero'), (3.0, 'scale', 'or a wrong platform.mass')])
def test_a_possible_error_in_the_efforts_is_named(factor: float, what: str, words: str) -> None:
    case = case_of()
    right = values_of(case, case.forces())
    assert right['likely_mistake'] is None and right['external_wrench_given']
    found = values_of(case, factor * case.forces())
    assert found['likely_mistake']['what'] == what
    assert words in found['likely_mistake']['text']
    assert words in found['headline']
    # the load may be three times that of the file; of another unit there is no external wrench
    known = found['external_wrench']['force_z']['mean_n'] is not None
    assert known == found['external_wrench_given'] == (what == 'scale')
    assert known or not found['contacts']['count']


@pytest.mark.parametrize('seed', range(4))
def test_the_efforts_of_single_legs_are_judged(seed: int) -> None:
    case, random = case_of(seed), rng(seed)
    forces = case.forces()
    noisy = forces * random.uniform(0.98, 1.02, 6) + 0.01 * np.std(forces) * random.normal(
        size=forces.shape)
    assert values_of(case, noisy)['likely_mistake'] is None
    a, b = sorted(random.choice(6, 2, replace=False))
    order = list(range(6))
    order[a], order[b] = order[b], order[a]
    found = values_of(case, noisy[:, order])
    joints = case.parameters['joints']
    assert found['likely_mistake']['what'] == 'swapped'
    assert f'of {joints[a]} and {joints[b]} look swapped' in found['likely_mistake']['text']
    assert not found['external_wrench_given']
    for factor, what in ((-1.0, 'sign'), (0.0, 'zero')):
        factors = np.where(np.arange(6) == a, factor, 1.0)
        found = values_of(case, noisy * factors)['likely_mistake']
        assert found['what'] == what
        assert found['text'].startswith(f'the effort of {joints[a]} ')


@pytest.mark.parametrize('seed', range(12))
def test_loads_friction_and_a_wrong_mass_are_no_possible_error_in_the_efforts(seed: int) -> None:
    case, random = case_of(seed), rng(seed)
    p = case.parameters
    size, weight = size_of(p), 9.81 * p['platform.mass']
    heavier = p.replaced({'platform.mass': 1.2 * p['platform.mass']})
    lighter = p.replaced({'platform.mass': 0.8 * p['platform.mass']})
    payload = heavier.replaced({'platform.mass': 1.3 * p['platform.mass'],
                                'platform.center_of_mass': p['platform.center_of_mass']
                                + 0.3 / 1.3 * size * random.uniform(-0.3, 0.3, 3)})
    contact = np.zeros((500, 6))
    contact[200:350, :3] = weight * random.uniform(-1.0, 1.0, 3)
    contact[200:350, 3:] = 0.3 * size * weight * random.uniform(-1.0, 1.0, 3)
    constant = np.concatenate([0.5 * weight * random.uniform(-1.0, 1.0, 3),
                               0.2 * size * weight * random.uniform(-1.0, 1.0, 3)])
    friction = 0.1 * weight / 6.0 * np.sign(np.diff(
        case.outputs.drive_positions, axis=0, prepend=case.outputs.drive_positions[:1]))
    for measured in (
            case.forces(parameters=heavier), case.forces(parameters=lighter),
            case.forces(parameters=payload), case.forces(contact), case.forces(constant),
            case.forces() + friction):
        assert values_of(case, measured)['likely_mistake'] is None


def test_friction_may_hold_a_resting_platform_with_any_force() -> None:
    case = case_of()
    still = case._replace(motion=Motion(case.motion.position, case.motion.rotation))
    forces = still.forces()
    strong = {'actuator.coulomb_friction': 2.5 * float(np.abs(forces).max())}
    p = case.parameters.replaced(strong)
    batch = case.setpoints.replaced(motions=still.motion.rows)
    stuck = Case(p, still.motion, case.seconds, batch, Step(p)(batch))
    assert values_of(stuck, -forces)['likely_mistake'] is None
    without = still._replace(setpoints=batch, outputs=Step(case.parameters)(batch))
    assert values_of(without, -forces)['likely_mistake']['what'] == 'sign'


def test_a_contact_is_found_with_its_time_and_load() -> None:
    case = case_of(many=3000)
    load = np.zeros((3000, 6))
    load[1200:1230, 2] = -400.0
    load[2000:2005, 3] = 900.0
    contacts = values_of(case, case.forces(load) + rng().normal(0.0, 1.0, (3000, 6)))['contacts']
    assert contacts['count'] == 2
    push, blow = contacts['strongest']
    assert push['from_s'] == pytest.approx(12.0, abs=contacts['resolution_s'])
    assert push['to_s'] == pytest.approx(12.29, abs=contacts['resolution_s'])
    assert push['axis'] == 'force_z'
    assert push['force_n'][2] == pytest.approx(-400.0, abs=30.0)
    assert blow['from_s'] == pytest.approx(20.0, abs=contacts['resolution_s'])
    assert blow['axis'] == 'moment_x'
    assert blow['moment_n_m'][0] == pytest.approx(900.0, abs=30.0)
    assert contacts['resolution_s'] < 0.01


def test_a_contact_of_one_sample_has_one_time_in_the_summary() -> None:
    case = case_of(many=3000)
    load = np.zeros((3000, 6))
    load[[0, *range(1200, 1230)], 2] = -400.0
    comparison = Comparison(case.parameters)
    compared(comparison, case, (case.setpoints.stamps, case.forces(load)))
    lines = _measured_lines(comparison.values())
    assert [line.partition(':')[0] for line in lines if line.startswith('contact')] == [
        'contact at t = 0.00 s', 'contact from t = 12.00 to 12.29 s']


def test_a_payload_and_noise_are_no_contact() -> None:
    case = case_of(many=3000)
    load = np.array([0.0, 0.0, -500.0, 30.0, 0.0, 0.0]) + np.zeros((3000, 1))
    noise = rng().normal(0.0, 20.0, (3000, 6))
    assert values_of(case, case.forces(load) + noise)['contacts']['count'] == 0


def test_times_of_contacts_hold_in_a_recording_of_hours() -> None:
    case = case_of(many=2000)
    comparison = Comparison(case.parameters)
    # the same 20 s over and over, 10 minutes apart, for 9 hours
    at_s = 600.0 * 31 + 7.0
    for turn in range(54):
        load = np.zeros((2000, 6))
        if turn == 31:
            load[700:720, 0] = 1000.0
        later = case.later(600 * turn)
        comparison.add_measured(later.setpoints.stamps, case.forces(load))
        comparison.add_setpoints(later.seconds, later.setpoints, later.outputs)
    comparison.finish()
    contacts = to_builtins(comparison.values())['contacts']
    assert contacts['count'] == 1
    contact = contacts['strongest'][0]
    assert contact['axis'] == 'force_x'
    assert contact['force_n'][0] == pytest.approx(1000.0, rel=1e-6)
    assert contacts['resolution_s'] <= 4.0
    assert abs(contact['from_s'] - at_s) <= contacts['resolution_s']
    assert abs(contact['to_s'] - at_s - 0.19) <= contacts['resolution_s']


def test_the_strongest_hundred_contacts_are_listed_in_order_of_time() -> None:
    case = case_of(many=20_000)
    load = np.zeros((20_000, 6))
    strengths = rng().uniform(3000.0, 9000.0, 150)
    for number, strength in enumerate(strengths):
        load[100 + 120 * number, 1] = strength
    contacts = values_of(case, case.forces(load))['contacts']
    assert contacts['count'] == 150
    found = [each['force_n'][1] for each in contacts['strongest']]
    assert found == pytest.approx([each for each in strengths
                                   if each >= np.sort(strengths)[50]], rel=1e-6)
    times = [each['from_s'] for each in contacts['strongest']]
    assert times == sorted(times)


# Time

def test_forces_are_interpolated_between_samples_and_never_extrapolated() -> None:
    case = case_of(many=100)
    stamps = case.setpoints.stamps
    slope, level = rng().normal(size=(2, 6))
    # every 30 ms from 85 ms on, a hole of 200 ms after 505 ms, an end at 895 ms
    at = START + np.array([ms for ms in range(85, 900, 30) if not 505 < ms < 685]) * 1_000_000
    efforts = level + ((at - START) * 1e-9)[:, None] * slope
    seconds, measured, _, _ = compared(comparison := Comparison(case.parameters), case,
                                       (at, efforts))
    within = np.array([(85 <= 10 * n <= 505 or 685 <= 10 * n <= 895) for n in range(100)])
    assert np.array_equal(seconds, case.seconds[within])
    assert np.allclose(measured, level + seconds[:, None] * slope, rtol=1e-12)
    values = to_builtins(comparison.values())
    assert values['setpoints_not_compared']['without_measurement'] == 100 - within.sum()
    assert values['gap_limit_s'] == TIMEOUT
    # samples exactly as far apart as the limit still count, and one at the very stamp alone
    seconds, *_ = compared(Comparison(case.parameters), case,
                           (stamps[[10, 20, 50]], np.zeros((3, 6))))
    assert np.array_equal(seconds, case.seconds[[*range(10, 21), 50]])


def test_setpoints_without_computed_forces_are_not_compared() -> None:
    case = case_of()
    case.outputs.demanded_efforts[7:11] = np.nan
    comparison = Comparison(case.parameters)
    seconds, measured, computed, wrench = compared(
        comparison, case, (case.setpoints.stamps, np.ones((500, 6))))
    assert np.array_equal(seconds, np.delete(case.seconds, slice(7, 11)))
    assert np.isfinite(computed).all() and np.isfinite(wrench).all()
    assert to_builtins(comparison.values())['setpoints_not_compared'] == {
        'without_measurement': 0, 'without_force': 4}


@pytest.mark.parametrize('effort', [-1e200, 9e99])
def test_efforts_whose_squares_overflow_give_no_number_that_is_not_finite(effort: float) -> None:
    case = case_of()
    case.outputs.demanded_efforts[7:11] = effort
    comparison = Comparison(case.parameters)
    seconds, *_ = compared(comparison, case, (case.setpoints.stamps, np.ones((500, 6))))
    too_large = 4 * (effort < -1e100)
    assert comparison.too_large == too_large == 500 - len(seconds)
    values = json.loads(to_json(comparison.values()))
    assert values['setpoints_not_compared']['without_force'] == too_large


def test_nothing_compared_gives_null() -> None:
    case = case_of(many=3)
    comparison = Comparison(case.parameters)
    for each in compared(comparison, case):
        assert len(each) == 0
    values = json.loads(to_json(comparison.values()))
    assert values['setpoints_compared'] == values['samples'] == 0
    assert values['setpoints_not_compared']['without_measurement'] == 3
    assert values['legs']['leg_1'] == dict.fromkeys(values['legs']['leg_1'])
    force = values['external_wrench']['force_x']
    assert force == dict.fromkeys(force)
    assert values['residual_rms_n'] is None and values['residual_share'] is None
    assert values['headline'] == 'no setpoint could be compared'
    assert values['contacts']['count'] == 0


def test_standing_still_gives_no_correlation() -> None:
    case = case_of(many=1)
    still = Motion(case.motion.position, case.motion.rotation)
    stamps = START + np.arange(50) * 10_000_000
    batch = Batch.from_parts(stamps, still.rows)
    outputs = Step(case.parameters)(batch)
    comparison = Comparison(case.parameters)
    comparison.add_setpoints(np.arange(50) * 0.01, batch, outputs)
    comparison.add_measured(stamps, np.full((50, 6), 100.0))
    comparison.finish()
    leg = json.loads(to_json(comparison.values()))['legs']['leg_1']
    assert leg['correlation'] is None
    assert leg['measured_rms_n'] == pytest.approx(100.0)


def looping(many: int, times: int) -> list[int]:
    """Return stamps that begin anew, as of a bag that loops."""
    return [START + n * 10_000_000 for _ in range(times) for n in range(many)]


def test_a_pass_is_compared_with_the_samples_of_the_same_pass() -> None:
    case = case_of(many=120, stamps=looping(40, 3))
    # in each pass another force
    efforts = np.repeat([[1.0], [2.0], [3.0]], 40, axis=0) * np.ones(6)
    whole = compared(Comparison(case.parameters), case, (case.setpoints.stamps, efforts))
    assert np.array_equal(whole[1], efforts)
    assert np.array_equal(whole[0], case.seconds)
    # samples that lead by a whole pass, and setpoints that do
    for parts in ([(case.setpoints.stamps[:70], efforts[:70]), case.part(slice(0, 30)),
                   (case.setpoints.stamps[70:], efforts[70:]), case.part(slice(30, 120))],
                  [case.part(slice(0, 90)), (case.setpoints.stamps, efforts),
                   case.part(slice(90, 120))]):
        again = compared(comparison := Comparison(case.parameters), *parts)
        for a, b in zip(again, whole, strict=True):
            assert np.allclose(a, b, rtol=1e-12)
        assert to_builtins(comparison.values())['samples_jumped_back'] == 2


def test_measured_samples_without_a_jump_begin_no_pass() -> None:
    case = case_of(many=80, stamps=looping(40, 2))
    efforts = np.ones((40, 6))
    comparison = Comparison(case.parameters)
    seconds, *_ = compared(comparison, case, (case.setpoints.stamps[:40], efforts))
    assert np.array_equal(seconds, case.seconds[:40])
    assert to_builtins(comparison.values())['setpoints_not_compared']['without_measurement'] == 40


def test_single_samples_out_of_order_are_left_out() -> None:
    case = case_of(many=100)
    stamps, efforts = case.setpoints.stamps.copy(), rng().normal(size=(100, 6))
    whole = compared(Comparison(case.parameters), case, (stamps, efforts))
    wild = np.full((1, 6), 1e6)
    for at, stamp in (
            (50, stamps[50] - 5 * SECOND),  # late by far
            (50, stamps[45]), (50, stamps[49]),  # late by less than the timeout, twice the same
            (50, stamps[50] + 3600 * SECOND)):  # from the future
        spoiled = np.insert(stamps, at, stamp), np.insert(efforts, at, wild, axis=0)
        for cut in (None, 50, 51):
            comparison = Comparison(case.parameters)
            parts = [spoiled] if cut is None else [
                tuple(each[:cut] for each in spoiled), tuple(each[cut:] for each in spoiled)]
            again = compared(comparison, case, *parts)
            for a, b in zip(again, whole, strict=True):
                assert np.array_equal(a, b)
            values = to_builtins(comparison.values())
            assert values['samples_out_of_order'] == 1
            assert values['samples_jumped_back'] == 0
            assert values['samples'] == 101


def reference(stamps: list[int], at: list[int], gap: int) -> list[int]:
    """Return which setpoints have samples around them, one by one; time goes forward in both."""
    found = []
    for number, stamp in enumerate(stamps):
        before = [each for each in at if each <= stamp]
        after = [each for each in at if each >= stamp]
        if before and after and min(after) - max(before) <= gap:
            found.append(number)
    return found


@given(st.lists(st.integers(1, 150), min_size=1, max_size=60),
       st.lists(st.integers(1, 150), min_size=1, max_size=60), st.integers(-100, 2000),
       st.lists(st.tuples(st.booleans(), st.integers(0, 20)), max_size=30))
def test_cuts_and_turns_change_nothing(
        steps: list[int], sample_steps: list[int], offset: int,
        turns: list[tuple[bool, int]]) -> None:
    milliseconds = 1_000_000
    stamps = (START + np.cumsum(steps) * milliseconds).tolist()
    at = START + (offset + np.cumsum(sample_steps)) * milliseconds
    case = case_of(many=len(steps), stamps=stamps)
    efforts = rng().normal(size=(len(at), 6))
    whole = compared(once := Comparison(case.parameters), case, (at, efforts))
    assert np.array_equal(
        whole[0], case.seconds[reference(stamps, at.tolist(), round(TIMEOUT * 1e9))])

    again = Comparison(case.parameters)
    parts: list[Any] = []
    done = [0, 0]
    for of_setpoints, number in [*turns, (True, 99), (False, 99)]:
        side = 0 if of_setpoints else 1
        part = slice(done[side], done[side] + number)
        done[side] += number
        parts.append(case.part(part) if of_setpoints and number and part.start < len(stamps)
                     else (at[part], efforts[part]) if not of_setpoints
                     else (at[:0], efforts[:0]))
    cut = compared(again, *parts)
    for a, b in zip(cut, whole, strict=True):
        assert np.array_equal(a, b)
    assert again.values().setpoints_not_compared == once.values().setpoints_not_compared


def test_unmatched_samples_are_dropped_and_counted() -> None:
    case = case_of(many=5000)
    forces = case.forces()
    comparison = Comparison(case.parameters)
    for turn in range(20):
        later = case.later(50 * turn)
        comparison.add_setpoints(later.seconds, later.setpoints, later.outputs)
    # the last waiting setpoints are all compared, earlier ones are not
    late = comparison.add_measured(later.setpoints.stamps, forces)
    rest = comparison.finish()
    assert len(late.seconds) + len(rest.seconds) == 5000
    values = to_builtins(comparison.values())
    assert values['setpoints_compared'] == 5000
    assert values['setpoints_not_compared']['without_measurement'] == 95_000

    comparison = Comparison(case.parameters)
    for turn in range(100):
        later = case.later(50 * turn)
        comparison.add_measured(later.setpoints.stamps, forces)
    assert values['samples'] == 5000
    comparison.add_setpoints(later.seconds, later.setpoints, later.outputs)
    comparison.finish()
    assert to_builtins(comparison.values())['setpoints_compared'] == 5000
