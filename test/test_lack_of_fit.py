# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Notices of a lack of fit: a small part of benchmarks/lack_of_fit.py."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
import re

from cases import few
import estimate_cases
from estimate_cases import (
    braked, drawn, FILE, identified, MOTIONS, recording, rich, SENSORS, stopping, Truth,
    with_friction)
from independent_hexapod import Legs, moving
import numpy as np
from numpy.typing import NDArray
import pytest
from recorded import about, at_rest, fourier, HOME, MotionAt, Noise, Recorded, recorded
from referees import rng
from simulated import simulated as simulated_hexapod

from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.arrays import NO_WRENCH
from stewart_dynamics.estimation.confidence_level import TWO_SIDED
from stewart_dynamics.estimation.contradiction import deviations
from stewart_dynamics.identification.identification_options import (
    DesignOptions, IdentificationOptions)
from stewart_dynamics.identification.identification_results import document, result_text
from stewart_dynamics.identification.identify import Identification, Identified
from stewart_dynamics.identification.lack_of_fit import LEFT_BY_FILTERS
from stewart_dynamics.identification.motion_design import design
from stewart_dynamics.identification.unknowns import Unknowns
from stewart_dynamics.identification.window_poses import pose_near
from stewart_dynamics.identification.windows import Window
from stewart_dynamics.reference_motion.motion_functions import motion_at
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.simulator.plant import Plant
import wrong_models
from wrong_models import (
    Case, CAUSES, GIVEN, identify, NOISE, RATE, SECONDS, simulated, true_hexapod)

Array = NDArray[np.float64]


def start_of(p: Parameters) -> Array:
    """Return the values of a hexapod that are identified by default."""
    unknowns = Unknowns(p)
    start: Array = unknowns.start[unknowns.asked]
    return start


def errors_of(found: Identified) -> Array:
    """Return their standard errors."""
    errors: Array = np.sqrt(np.diag(found.fit.covariance))[found.unknowns.asked]
    return errors


# The simulated hexapod of demo/identify.py.
TRUE_OF_SIMULATOR = {
    'platform__mass': 190.0, 'platform__center_of_mass': [0.06, -0.04, 0.17],
    'platform__inertia': [16.5, 0.1, -0.8, 17.0, 0.5, 24.0],
    'actuator__viscous_friction': 400.0, 'actuator__coulomb_friction': 50.0}
# Errors that are within the uncertainty of the file, or change nothing else.
SILENT = 'leg masses 10 % off', 'tilt 0.5 degrees', 'base joint 4 mm off'


@pytest.mark.parametrize('cause', [
    pytest.param(cause, marks=() if cause == 'gain of one leg 5 % off' else pytest.mark.slow)
    for cause in CAUSES if cause not in (*SILENT, 'all efforts times 1.05')])
def test_a_wrong_model_is_noticed_and_its_cause_named(cause: str) -> None:
    seed = 1
    make, right = CAUSES[cause]
    case = make(true_hexapod(seed), rng(1000 + seed))
    found = identify(simulated(case, seed))
    assert found.lack_of_fit is not None
    assert found.lack_of_fit.cause in right
    result = document(found, IdentificationOptions())
    assert result.lack_of_fit.cause in right
    assert result_text(result).startswith('LACK OF FIT: the residuals are more than noise: likely')
    if cause in ('saturation', 'two payloads in two bags', 'payload of 2 to 6 kg drops'):
        return  # true values do not hold for the whole recording
    off = np.abs(found.fit.values[found.unknowns.asked] - start_of(case.true))
    half = TWO_SIDED * errors_of(found)
    narrow, wide = off < half, half + found.lack_of_fit.shifts[found.unknowns.asked]
    assert np.mean(off < wide) >= max(0.8, narrow.mean())
    assert result.lack_of_fit.intervals == 'widened'
    given = np.array([each.interval for each in result.parameters])
    np.testing.assert_allclose(np.diff(given)[:, 0], 2.0 * wide)


@pytest.mark.parametrize('cause', few(SILENT, 1))
def test_errors_that_the_file_allows_for_are_within_the_intervals(cause: str) -> None:
    case = CAUSES[cause][0](true_hexapod(1), rng(1001))
    found = identify(simulated(case, 1))
    assert (found.likely, found.lack_of_fit) == ((), None)
    off = np.abs(found.fit.values[found.unknowns.asked] - start_of(case.true))
    assert np.mean(off < TWO_SIDED * errors_of(found)) > 0.9


def test_a_right_model_gives_no_notice() -> None:
    case = Case(true_hexapod(11))
    found = identify(simulated(case, 11))
    assert found.lack_of_fit is None
    assert found.likely == ()
    off = np.abs(found.fit.values[found.unknowns.asked] - start_of(case.true))
    assert np.mean(off < TWO_SIDED * errors_of(found)) > 0.8


@pytest.mark.parametrize('motion', [
    at_rest, *map(about, np.eye(3)[::2])], ids=['at rest', 'about x', 'about z'])
def test_noise_of_lengths_in_the_columns_is_no_lack_of_fit(motion: MotionAt) -> None:
    assert identify(simulated(Case(true_hexapod(1)), 1, motion)).lack_of_fit is None


def of_pieces(*bags: list[Recorded]) -> Identified:
    """Return the identification from bags of pieces with gaps between them."""
    with closing(Identification(GIVEN, IdentificationOptions(hold_out=0.0))) as work:
        for n, pieces in enumerate(bags):
            work.add(Path(f'bag {n}'), [Window(
                round(1e11 * n), 1.0 / RATE, each.positions, each.rates, each.efforts,
                np.zeros(each.efforts.shape, dtype=bool)) for n, each in enumerate(pieces)])
        assert len(work.extracts) == sum(map(len, bags))
        return work.result()


def standing(seconds: float, moving: Recorded) -> Recorded:
    """Return a recording with the brakes on, before one that moves."""
    shape = (round(seconds * RATE), 6)
    lengths, rates = rng(5).normal(size=(2, *shape))
    return Recorded(np.arange(shape[0]) / RATE, moving.positions[0] + NOISE.length * lengths,
                    None if moving.rates is None else NOISE.rate * rates,
                    900.0 + NOISE.effort * rng(6).normal(size=shape))


def parked(seconds: float, moving: Recorded) -> Recorded:
    """Return a recording at the ends of the legs, of which nothing is used."""
    end = GIVEN['limits.length_min'] - GIVEN['geometry.zero_length']
    still = standing(seconds, moving)
    return still._replace(positions=still.positions - moving.positions[0] + end)


@pytest.mark.parametrize('pieces', few([1, 3], 1))
def test_short_recordings_are_not_tested(pieces: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wrong_models, 'SECONDS', 3.5 * pieces)  # 24 cut-off periods are left
    (whole,) = simulated(Case(true_hexapod(1)), 1)
    assert whole.rates is not None
    parts = [Recorded(*each) for each in zip(
        *(np.array_split(each, pieces) for each in whole if each is not None), strict=True)]
    for bag in (parts, [parked(10.0, parts[0]), *parts], [standing(10.0, parts[0]), *parts]):
        found = of_pieces(bag)
        assert (found.tested, found.lack_of_fit) == (False, None)
        result = document(found, IdentificationOptions())
        assert (result.tested_for_lack_of_fit, result.lack_of_fit) == (False, None)
        assert result_text(result).startswith('not tested for a lack of fit: what can be used')


@pytest.mark.parametrize('delay', few([0.0, 0.09], 1))
def test_pieces_at_rest_before_a_motion_are_no_lack_of_fit(
        delay: float, monkeypatch: pytest.MonkeyPatch) -> None:
    noise = NOISE._replace(delay=delay)
    monkeypatch.setattr(wrong_models, 'NOISE', noise)
    true = true_hexapod(2)
    (moving,) = simulated(Case(true), 2)
    begin = fourier(2)(np.zeros(1))
    held = recorded(true, lambda times: Motion(
        np.repeat(begin.position, len(times), axis=0),
        np.repeat(begin.rotation, len(times), axis=0)), 5.0, RATE, 1001, noise)
    for still in (held, standing(3.0, moving)):
        found = of_pieces([still, moving])
        assert (found.tested, found.lack_of_fit, found.likely) == (True, None, ())
        (bag,) = document(found, IdentificationOptions()).bags
        assert bag.delay_s == pytest.approx(delay, abs=2e-4)
        off = np.abs(found.fit.values[found.unknowns.asked] - start_of(true))
        assert np.mean(off < TWO_SIDED * errors_of(found)) > 0.8


def test_a_bag_of_which_nothing_is_used_changes_nothing() -> None:
    (moving,) = simulated(Case(true_hexapod(2)), 2)
    alone, both = of_pieces([moving]), of_pieces([parked(20.0, moving)], [moving])
    off = np.abs(both.fit.values - alone.fit.values)[both.unknowns.asked]
    assert np.max(off / errors_of(alone)) < 0.1
    np.testing.assert_allclose(errors_of(both), errors_of(alone), rtol=0.05, atol=0.0)


def test_stribeck_friction_is_named_behind_a_piece_at_rest() -> None:
    (moving,) = simulated(CAUSES['Stribeck friction'][0](true_hexapod(1), rng(1001)), 1)
    noisier = moving._replace(rates=None, positions=moving.positions + 3e-5 * rng(8).normal(
        size=moving.positions.shape))
    for pieces in ([noisier], [standing(3.0, noisier)._replace(
            positions=noisier.positions[0] + 3e-5 * rng(9).normal(size=(750, 6))), noisier]):
        lack = of_pieces(pieces).lack_of_fit
        assert lack is not None
        assert lack.cause == 'stribeck_friction'


def test_possible_errors_in_short_recordings_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wrong_models, 'SECONDS', 5.0)
    bags = simulated(Case(true_hexapod(1)), 1)
    found = identify([each._replace(positions=each.positions - 0.02) for each in bags])
    assert not found.tested
    assert found.likely[0].what == 'zero_length'


def test_errors_of_the_filters_are_no_lack_of_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wrong_models, 'NOISE', Noise(0.0, 0.0, 0.0, 0.0, 0.0))
    found = identify(simulated(Case(true_hexapod(1)), 1))
    assert (found.tested, found.lack_of_fit) == (True, None)
    assert found.residuals.after.max() < LEFT_BY_FILTERS * found.residuals.measured.min()
    wrong = identify(simulated(CAUSES['offset of 40 N on one leg'][0](
        true_hexapod(1), rng(1001)), 1))
    assert wrong.lack_of_fit is not None


def test_identified_offsets_are_no_lack_of_fit() -> None:
    case = CAUSES['offsets of 20 N RMS'][0](true_hexapod(1), rng(1001))
    kinds = ('platform', 'friction', 'offset')
    assert identify(simulated(case, 1), GIVEN, kinds).lack_of_fit is None


@pytest.mark.parametrize(('delay', 'effort'), [
    (-0.09, 2.5), (-0.015, 0.1), (0.0, 2.5), (0.003, 0.1), (0.09, 0.1), (0.09, 2.5)])
def test_delays_of_the_efforts_up_to_a_tenth_of_a_second_are_found(
        delay: float, effort: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wrong_models, 'NOISE', NOISE._replace(
        delay=delay, effort=effort, coloured=0.8 * effort))
    case = Case(true_hexapod(2))
    found = identify(simulated(case, 2))
    assert (found.likely, found.lack_of_fit) == ((), None)
    (bag,) = document(found, IdentificationOptions()).bags
    assert bag.delay_s == pytest.approx(delay, abs=2e-4)
    off = np.abs(found.fit.values[found.unknowns.asked] - start_of(case.true))
    assert np.mean(off < TWO_SIDED * errors_of(found)) > 0.8


@pytest.mark.parametrize(('delay', 'word'), [(0.13, 'later'), (-0.13, 'earlier')])
def test_longer_delays_are_a_possible_error(
        delay: float, word: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wrong_models, 'NOISE', NOISE._replace(delay=delay))
    likely = identify(simulated(Case(true_hexapod(2)), 2)).likely
    assert likely[0].what == 'delay'
    assert f'{word} than the positions by 0.1 s or more' in likely[0].text


@pytest.mark.parametrize(('truth', 'motion'), [
    (drawn(0), 'yaw'), (with_friction(0), 'gentle, then rest')])
def test_a_right_model_holds_at_held_out_time(truth: Truth, motion: str) -> None:
    """Also where a fit with other legs, or with the noise of rates, is a little worse there."""
    assert identified([estimate_cases.recorded(truth, motion, 0)], truth).causes == ()


def test_a_file_that_is_better_at_held_out_time_is_said() -> None:
    empty, path = with_friction(1), MOTIONS['rich'](rng(7))
    loaded = empty.changed(platform__mass=400.0)

    def legs(times: Array) -> Legs:
        forces = np.where(times[:, None] < 15.0, *(
            moving(each.parameters, path(times)).forces for each in (loaded, empty)))
        return moving(empty.parameters, path(times))._replace(forces=forces)

    assert 'validation' in identified([recording(legs, 1)], empty).causes


def test_a_unit_is_named_though_the_mass_makes_another_scale_nearer() -> None:
    truth = drawn(3)  # a mass of 1.8 times the file's
    given = estimate_cases.recorded(truth, 'rich', 3)
    found = identified([given._replace(efforts=1e-3 * given.efforts)], truth)
    assert found.causes[0] == 'unit' and 'likely kN in place of N' in found.notices[0]


def test_swapped_legs_are_named_before_a_delay_that_fits_them_best() -> None:
    given = estimate_cases.recorded(drawn(3), 'roll', 3)
    swapped = given._replace(efforts=given.efforts[:, [1, 0, 2, 3, 4, 5]])
    assert identified([swapped], drawn(3)).causes[0] == 'swapped'


def test_brakes_before_a_motion_are_no_delay_of_the_efforts() -> None:
    truth, path = drawn(1), rich(rng(1))._replace(warp=stopping(0.0, 10.0))

    def legs(times: Array) -> Legs:
        return moving(truth.parameters, path(times))

    given = recording(
        braked(legs, 0.0, 9.9), 1, SENSORS._replace(delay=20e-3), truth.gain)
    assert identified([given], truth).delay == pytest.approx(20e-3, abs=5e-4)


def test_rest_before_and_after_a_motion_is_no_lack_of_fit() -> None:
    true, moving = true_hexapod(2), fourier(2)

    def motion(times: Array) -> Motion:
        # along its path at a rate that rises from and falls to zero between 10 and 30 s
        phase = 2.0 * np.pi * np.clip((times - 10.0) / 20.0, 0.0, 1.0)
        m = moving(10.0 / np.pi * (phase - np.sin(phase)))
        rate, change = (1.0 - np.cos(phase))[:, None], (np.pi / 10.0 * np.sin(phase))[:, None]
        return Motion(
            m.position, m.rotation, rate * m.linear_velocity, rate * m.angular_velocity,
            rate ** 2 * m.linear_acceleration + change * m.linear_velocity,
            rate ** 2 * m.angular_acceleration + change * m.angular_velocity)

    found = identify([recorded(true, motion, 40.0, RATE, 2, NOISE)])
    assert (found.tested, found.lack_of_fit, found.likely) == (True, None, ())


def test_a_motion_above_the_cutoff_is_reported() -> None:
    (given,) = simulated(Case(true_hexapod(1)), 1)
    for cutoff, said in ((0.8, True), (10.0, False)):
        options = IdentificationOptions(hold_out=0.0, cutoff=cutoff)
        with closing(Identification(GIVEN, options)) as work:
            work.add(Path('a bag'), [Window(0, 1.0 / RATE, given.positions, given.rates,
                                            given.efforts, np.zeros((5000, 6), dtype=bool))])
            assert any('of the motion is above the cut-off frequency' in notice
                       for notice in work.bags[0].notices) == said


@pytest.mark.parametrize(('velocity', 'said'), [(1e-3, False), (2.0, True)])
def test_rates_inside_the_coulomb_friction_band_are_reported(velocity: float, said: bool) -> None:
    band = {'actuator.coulomb_velocity': velocity}
    case = Case(true_hexapod(2).replaced(band))
    (bag,) = identify(simulated(case, 2), GIVEN.replaced(band)).bags
    assert any('% of the rates are below actuator.coulomb_velocity' in each
               for each in bag.notices) == said


def test_a_platform_of_a_tenth_of_its_mass_is_no_possible_error() -> None:
    # Its delay must not be found by efforts of another unit.
    truth = drawn(122)
    assert truth.parameters['platform.mass'] < 0.11 * GIVEN['platform.mass']
    found = identified([estimate_cases.recorded(truth, 'heave', 122)], truth)
    assert found.causes == ()
    assert found.delay == pytest.approx(NOISE.delay, abs=2e-4)


@pytest.fixture(scope='module')
def right() -> tuple[list[Recorded], Identified]:
    """Return a recording of a right model, and the identification from it."""
    bags = simulated(Case(true_hexapod(1)), 1)
    return bags, identify(bags)


@pytest.mark.parametrize('size', [1e-3, 1e3])
def test_hexapods_of_all_sizes_have_similar_results(
        size: float, right: tuple[list[Recorded], Identified]) -> None:
    bags, of_one = right
    found = [of_one, identify(bags, size=size)]
    one, other = (np.concatenate([
        each.fit.values, each.fit.deviations])[np.tile(each.unknowns.deviations > 0.0, 2)]
        / np.tile(each.unknowns.deviations[each.unknowns.deviations > 0.0], 2) for each in found)
    np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-7)
    assert [(each.likely, each.lack_of_fit) for each in found] == 2 * [((), None)]
    ratio = found[1].parameters['platform.inertia'] / found[0].parameters['platform.inertia']
    np.testing.assert_allclose(ratio, size ** 5, rtol=1e-6)
    # two digits of the standard error: 14.4 +- 0.2 kg m^2 in a hexapod of 1:1
    shown = result_text(document(found[1], IdentificationOptions())).partition('inertia.xx')[2]
    assert shown.split()[1].startswith('1.4')
    assert shown.split()[1].endswith({1e-3: 'e-14', 1e3: 'e+16'}[size])
    wrong = [each._replace(positions=each.positions - 0.02) for each in bags]
    (error,) = identify(wrong, size=size).likely
    assert error.what == 'zero_length'


def below(up: MotionAt) -> MotionAt:
    """Return the motion of a platform that hangs below its base."""
    def at(times: Array) -> Motion:
        m = up(times)
        return Motion(m.position - 2.0 * HOME, m.rotation, m.linear_velocity, m.angular_velocity,
                      m.linear_acceleration, m.angular_acceleration)

    return at


@pytest.mark.parametrize(('motion', 'sign', 'said'), [
    (below(fourier(1)), 1.0, None),
    (below(fourier(1)), -1.0, 'opposite sign'),
    (fourier(1), -1.0, 'or the platform is on the other side of the base'),
    # in slow motions inertia is not observable
    (below(fourier(1, base=0.01)), 1.0, 'or the platform is on the other side of the base'),
], ids=['hangs', 'hangs, sign', 'stands, sign', 'slow'])
def test_the_side_of_the_base_follows_from_the_efforts(
        motion: MotionAt, sign: float, said: str | None) -> None:
    assert GIVEN['geometry.platform_side'] == 'auto'
    true = true_hexapod(1)
    times = np.arange(round(SECONDS * RATE)) / RATE - NOISE.delay
    forces = sign * StewartPlatform(true).inverse_dynamics(motion(times)).forces
    found = identify([recorded(true, motion, SECONDS, RATE, 1, NOISE, forces)])
    if said is not None:
        assert said in found.likely[0].text
        return
    assert (found.likely, found.lack_of_fit) == ((), None)
    assert found.parameters['geometry.platform_side'] == 'negative'
    assert found.bags[0].notices == [
        'geometry.platform_side: the efforts are those of a platform on the negative side of its '
        'base']
    off = np.abs(found.fit.values[found.unknowns.asked] - start_of(true))
    assert np.mean(off < TWO_SIDED * errors_of(found)) > 0.8


def test_efforts_in_another_unit_do_not_change_the_side() -> None:
    # the file's legs, in N, fit efforts in kN better on the wrong side
    p = Parameters.from_yaml(Path(__file__).parents[1] / 'config' / 'platform.yaml')
    sine = ReferenceMotionParameters({
        'motion.type': 'sine', 'motion.initial': (0.0, 0.0, 1.1, 0.0, 0.0, 0.0),
        'motion.amplitude': (0.03, 0.03, 0.04, 0.04, 0.04, 0.06),
        'motion.frequency': (0.231, 0.317, 0.173, 0.409, 0.271, 0.137),
        'motion.phase': (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)})
    times = np.arange(round(20.0 * RATE)) / RATE
    forces = 1e-3 * StewartPlatform(p).inverse_dynamics(motion_at(sine, times)).forces
    found = identify([recorded(p, lambda at: motion_at(sine, at), 20.0, RATE, 1,
                               Noise(effort=5e-3, coloured=0.0, delay=0.0), forces)], given=p)
    assert 'kN in place of N' in found.likely[0].text


def test_lengths_of_a_platform_below_its_base_have_their_pose() -> None:
    below = GIVEN.replaced({'geometry.platform_side': 'negative'})
    for p, sign in ((GIVEN, 1.0), (below, -1.0)):
        platform = StewartPlatform(p)
        home = platform.home_pose()
        assert np.sign(home.position[2]) == sign
        lengths = platform.inverse_kinematics(home) + 0.01
        assert np.sign(pose_near(platform, lengths).position[2]) == sign


def test_deviations_have_the_probability_of_chi_squared() -> None:
    # 99.865 % quantiles: three standard deviations
    for freedom, quantile in ((1, 10.27), (6, 21.85), (18, 40.59)):
        assert deviations(quantile, freedom) == pytest.approx(3.0, abs=0.1)


def test_masses_of_legs_are_not_named_for_a_constant_force_that_explains_the_same() -> None:
    truth = drawn(3)
    bag = estimate_cases.recorded(truth, 'roll', 3)
    efforts = bag.efforts + 40.0 * np.eye(6)[3]
    found = identified([bag._replace(efforts=efforts)], truth)
    assert found.causes == ('unknown',)
    # an error that is not explained widens the intervals, and the notice says by how much
    assert len(found.intervals) == len(found.judged)
    assert np.mean([each.holds for each in found.intervals]) > 0.9
    assert re.search('not explained; the largest part is in leg_. ?.*; the intervals are widened '
                     r'by .*: .* is [\d.]+ times as wide, half of all at most [\d.]+ times; '
                     'next: look at this part in the report', found.notices[0])


@pytest.mark.parametrize('seed', [0, 1])
def test_exact_recordings_of_the_simulator_have_intervals(seed: int) -> None:
    """Whether or not the errors of filters and of held forces are significant without noise."""
    rate, true = 500.0, TRUE_OF_SIMULATOR
    design_ = design(GIVEN, DesignOptions(
        duration=SECONDS, frequency=4.0, generations=5, seed=seed))
    motion = motion_at(design_.trajectory, np.arange(round(SECONDS * rate)) / rate)
    desired = StewartPlatform(GIVEN).inverse_dynamics(motion)
    plant = Plant(simulated_hexapod(rate=rate, **true))
    found = []
    for lengths, rates, forces in zip(desired.lengths, desired.rates, desired.forces, strict=True):
        state = plant.state
        found.append((state.positions, state.rates, state.efforts))
        plant.advance(tuple((forces + 4e5 * (lengths - state.positions) + 1.6e4 * (
            rates - state.rates)).tolist()), NO_WRENCH)
    lengths, rates, forces = np.array(found).swapaxes(0, 1)
    bag = Recorded(np.zeros(0), lengths - GIVEN['geometry.zero_length'], rates, forces)
    outcome = identified([bag], FILE.changed(**true), rate=rate)
    assert len(outcome.intervals) == len(outcome.judged) == 22
    assert all(each.holds and each.identified for each in outcome.intervals)


def test_a_possible_error_that_was_accepted_leaves_no_intervals() -> None:
    """Nothing can be said of the values where the recording is another one than the model's."""
    truth = drawn(3)
    bag = estimate_cases.recorded(truth, 'rich', 3)
    found = identified([bag._replace(efforts=-bag.efforts)], truth)
    assert 'sign' in found.causes
    assert found.intervals == []
