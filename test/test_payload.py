# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The payload from measured legs: against Pinocchio, its intervals, identifiability."""

from __future__ import annotations

from collections.abc import Sequence
import re
from typing import Any, NamedTuple

from estimate_cases import drawn, payload as judged_payload
import numpy as np
from numpy.typing import NDArray
import pytest
from referees import PinocchioReferee, random_base_motion, relative, rng, ROOT

from stewart_dynamics import BaseMotion, Motion, Parameters, StewartPlatform
from stewart_dynamics.arrays import NO_WRENCH
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.external_wrench.estimate import Estimate
from stewart_dynamics.external_wrench.measured_legs import HIGHEST_RATE, LegHistory
from stewart_dynamics.external_wrench.payload import (
    carried_payload, identify, NAMES, numbers_of, Payload, PayloadOutcome)
from stewart_dynamics.mechanics.dynamics.linear_parameters import (
    about_origin, inertial_derivative)
from stewart_dynamics.mechanics.rows import NO_BASE
from stewart_dynamics.node.diagnostics.outcomes import PayloadDiagnostics
from stewart_dynamics.parameters.body import Body
from stewart_dynamics.parameters.table import inertia_matrix
from stewart_dynamics.reference_motion.motion_functions import motion_at
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters

Array = NDArray[np.float64]

FILE = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
# All but the payload is known well: errors are those of the measurements.
HEXAPOD = FILE.replaced({f'uncertainty.{name}': 1e-4 for name in (
    'leg_mass', 'reflected_mass', 'effort_gain', 'tilt')})
LOADED = HEXAPOD.replaced({
    'platform.mass': 172.0, 'platform.center_of_mass': [0.05, 0.02, 0.16],
    'platform.inertia': [15.0, 0.1, -0.6, 15.5, 0.3, 23.0]})
TRUE = np.array([LOADED['platform.mass'], *LOADED['platform.center_of_mass'],
                 *LOADED['platform.inertia']])
SECOND = 1_000_000_000
HOME = Motion([0.0, 0.0, 1.1], np.eye(3))


class Noise(NamedTuple):
    """Standard deviations of the measurements."""

    rate: float = 0.0  # [m/s]
    force: float = 0.0  # [N]


SENSORS = Noise(1e-3, 5.0)


def excited(seconds: Any) -> Motion:
    """Return a motion of all six coordinates at times [s]."""
    return motion_at(ReferenceMotionParameters.from_yaml(
        ROOT / 'config' / 'trajectory_fourier.yaml').replaced({'loop': True}), seconds)


def at_rest(seconds: Any) -> Motion:
    """Return the hexapod at home at times [s]."""
    many = len(seconds)
    return Motion(np.tile(HOME.position, (many, 1)), np.tile(HOME.rotation, (many, 1, 1)))


def recorded(moves: Any, seconds: float = 10.0, rate: float = 500.0, noise: Noise = SENSORS,
             seed: int = 1, true: Parameters = LOADED, **more: Any) -> LegHistory:
    """
    Return measurements of a hexapod that moves so, with the forces of the true parameters.

    The forces are those of the middle between two samples. ``more``: ``wrench`` on the platform,
    of which ``known`` is known; ``base`` at times [s]; ``offset`` and largest ``clip`` [N].
    """
    random = rng(seed)
    times = 2.0 + np.arange(round(seconds * rate) + 1) / rate
    motion, middle = moves(times), moves(times - 0.5 / rate)
    base, wrench = more.get('base'), more.get('wrench')
    clip = more.get('clip', np.inf)
    result = StewartPlatform(true).inverse_dynamics(
        middle, wrench, None if base is None else base(times - 0.5 / rate))
    forces = np.clip(result.forces + more.get('offset', 0.0) + noise.force * random.normal(
        size=result.forces.shape), -clip, clip)
    jacobians = StewartPlatform(true).inverse_jacobian(motion)
    rows = motion.rows.copy()
    rows[:, 12:18] += np.linalg.solve(
        jacobians, noise.rate * random.normal(size=(len(times), 6, 1)))[..., 0]
    bases = [NO_BASE] * len(times) if base is None else [
        tuple(row) for row in base(times).rows.tolist()]
    history = LegHistory(HEXAPOD['payload.window'])
    for stamp, row, force, of_base in zip(
            np.rint(times * 1e9).astype(int).tolist(), rows.tolist(), forces.tolist(), bases,
            strict=True):
        history.add_measurement(tuple(force), Estimate(stamp, tuple(row), None, None, of_base),
                                more.get('known', NO_WRENCH))
    return history


def add_again(history: LegHistory, measurements: LegHistory, factor: float = 1.0) -> LegHistory:
    """Return a history to which measurements are added, their forces times a factor."""
    for row in measurements.rows(0, measurements.count):
        history.add_measurement(tuple(factor * row[19:25]), Estimate(
            int(row[:1].view(np.int64)[0]), tuple(row[1:19]), None, None), NO_WRENCH)
    return history


def outcome_of(history: LegHistory, given: Parameters = HEXAPOD) -> PayloadOutcome:
    """Return the outcome of all pieces of the work."""
    *pieces, last = identify(history, StewartPlatform(given))
    assert not any(pieces) and last is not None
    return last


def payload_of(history: LegHistory, given: Parameters = HEXAPOD) -> Payload:
    """Return the payload, which must have been identified."""
    outcome = outcome_of(history, given)
    assert outcome.payload is not None, outcome.message
    return outcome.payload


def errors(payload: Payload, true: Array = TRUE) -> Array:
    """Return the errors by half of the 95 % intervals (10,)."""
    fitted = payload.fitted
    parts: Array = np.where(fitted.known, np.array(numbers_of(fitted.body)) - true, 0.0)
    return parts / np.where(fitted.known, fitted.half_widths, 1.0)


def known(payload: Payload) -> list[str]:
    """Return the names of the identified numbers."""
    return [name for name, is_known in zip(NAMES, payload.fitted.known, strict=True) if is_known]


def test_mass_center_and_inertia_are_those_of_pinocchio() -> None:
    """The forces are another program's; the noise is that of good sensors."""
    random, rate, many = rng(3), 100.0, 500
    times = 2.0 + np.arange(many) / rate
    motion, middle = excited(times), excited(times - 0.5 / rate)
    referee, history = PinocchioReferee(LOADED, random), LegHistory(10.0)
    for stamp, row, at in zip(np.rint(times * 1e9).astype(int).tolist(), motion.rows.tolist(),
                              range(many), strict=True):
        forces = referee.forces(middle[at], np.zeros(6)) + 0.3 * random.normal(size=6)
        history.add_measurement(tuple(forces), Estimate(stamp, tuple(row), None, None), NO_WRENCH)
    payload = payload_of(history)
    assert known(payload) == list(NAMES) and payload.fitted.consistent
    assert np.abs(errors(payload)).max() < 1.5
    assert payload.fitted.half_widths[0] < 0.1
    assert payload.stamp == history.stamps(many - 1, many)[0]
    assert payload.seconds == pytest.approx((many - 1) / rate)


@pytest.mark.parametrize('motion', ['rich', 'heave'])
def test_another_gain_of_all_efforts_is_named_and_widens_the_intervals(motion: str) -> None:
    """Legs and rotors, which the file knows, do not have the mass that such efforts would need."""
    for seed in (1, 2):
        right = judged_payload(drawn(seed), motion, seed)
        assert right.causes == ()
        low = judged_payload(drawn(seed)._replace(gain=1.0 / 1.3), motion, seed)
        assert low.causes == ('effort_gain',)
        off, wide = (each.of('platform.mass') for each in (right, low))
        assert off.holds and wide.holds and wide.half > 8.0 * off.half
    high = judged_payload(drawn(1)._replace(gain=1.3), motion, 1)
    assert 'likely another gain of all efforts, by about +' in high.notices[0]


def test_a_body_is_moved_to_the_origin() -> None:
    center, mass, offset = np.array([0.1, -0.2, 0.3]), 7.0, np.array([0.05, 0.02, -0.1])
    inertia = np.array([1.0, 0.1, 0.2, 1.5, -0.1, 2.0])
    there = np.array([mass, *(mass * offset), *(inertia + about_origin(
        mass, offset, np.zeros(6)))])
    whole = center + offset
    expected = [mass, *(mass * whole), *about_origin(mass, whole, inertia)]
    np.testing.assert_allclose(inertial_derivative(1.0, center) @ there, expected, rtol=1e-14)


def test_the_intervals_hold() -> None:
    """The errors of all ten are as large as the intervals say."""
    quiet, given = Noise(rate=3e-4, force=2.0), HEXAPOD.replaced({
        f'uncertainty.{name}': 1e-6 for name in ('effort_gain', 'tilt')})
    parts = np.array([errors(payload_of(recorded(
        excited, rate=200.0, noise=quiet, seed=seed), given)) for seed in range(12)])
    spread = np.sqrt(np.mean(parts ** 2, axis=0)) * 1.96
    assert np.all(spread > 0.5) and np.all(spread < 1.6), spread
    assert np.mean(np.abs(parts) < 1.0) > 0.9


def test_wrong_masses_of_the_legs_are_within_the_intervals() -> None:
    """As far as the file says that they may be wrong."""
    light = LOADED.replaced({f'legs.{part}.mass': FILE[f'legs.{part}.mass'] / 1.05
                             for part in ('cylinder', 'piston')})
    sure = payload_of(recorded(excited, true=light))
    assert np.abs(errors(sure)).max() > 3.0
    unsure = payload_of(recorded(excited, true=light), FILE)
    assert np.abs(errors(unsure)).max() < 1.0
    assert unsure.fitted.half_widths[0] > 10.0 * sure.fitted.half_widths[0]


def test_noise_in_the_rates_makes_no_inertia_smaller() -> None:
    """As it would be without the correction: then the largest of these is 1.4."""
    rough = Noise(rate=2e-3, force=0.1)
    parts = [payload_of(recorded(excited, noise=rough, seed=seed)) for seed in range(8)]
    assert all(known(each) == list(NAMES) for each in parts)
    assert np.abs(np.mean([errors(each) for each in parts], axis=0)).max() < 0.9


def test_only_mass_and_horizontal_center_are_identified_at_rest() -> None:
    outcome = outcome_of(recorded(at_rest))
    payload, diagnostics = outcome.payload, PayloadDiagnostics(HEXAPOD)
    assert payload is not None
    assert known(payload) == ['mass', 'center of mass x', 'center of mass y']
    body, given = payload.fitted.body, payload.given
    assert body.center[2] == given.center[2]
    assert body.inertia.tolist() == given.inertia.tolist()
    assert np.abs(errors(payload)[:3]).max() < 1.0
    assert f'; not identified, as in the parameters: {", ".join(NAMES[3:])}; ' in outcome.message
    # A point mass at the height of the platform's center.
    assert ', 0.12], inertia: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]' in outcome.message
    diagnostics.done(outcome, 0.1)
    status = diagnostics.status(0.0)
    assert status is not None
    assert dict(status.values)[
        'inertia izz, half of the 95 % interval (kg m^2)'] == 'not identified'


def test_at_rest_the_interval_has_what_coulomb_friction_can_hold() -> None:
    """Legs that stopped after they extended carry less, as far as friction can hold them."""
    friction = HEXAPOD['actuator.coulomb_friction']
    for sign in (-1.0, 1.0):
        payload = payload_of(recorded(at_rest, noise=Noise(), offset=0.7 * sign * friction))
        assert abs(payload.fitted.body.mass - TRUE[0]) > 5.0
        assert abs(errors(payload)[0]) < 2.0
    without = HEXAPOD.replaced({'actuator.coulomb_friction': 0.0})
    of_none = payload_of(recorded(at_rest, noise=Noise()), without)
    assert of_none.fitted.half_widths[0] < 0.05  # by the gain of the efforts


def test_legs_above_the_velocity_of_coulomb_friction_do_not_stick() -> None:
    """Legs at 0.1 mm/s: what may hold a leg at rest adds to the interval of the mass, or not."""
    def slow(seconds: Any) -> Motion:
        motion = at_rest(seconds)
        motion.rows[:, 2] += 1e-4 * np.asarray(seconds)
        motion.rows[:, 14] = 1e-4
        return motion

    widths = []
    for velocity in (1e-3, 1e-5):
        changed = {'actuator.coulomb_velocity': velocity}
        payload = payload_of(recorded(slow, noise=Noise(), true=LOADED.replaced(changed)),
                             HEXAPOD.replaced(changed))
        assert abs(errors(payload)[0]) < 1.0
        widths.append(payload.fitted.half_widths[0])
    assert widths[1] < 0.6 * widths[0]


def test_saturated_efforts_do_not_count() -> None:
    limited = HEXAPOD.replaced({'limits.force_max': 600.0})
    history = recorded(excited, clip=600.0)
    payload = payload_of(history, limited)
    assert 100 < payload.excluded < 1000
    assert np.abs(errors(payload)).max() < 2.0
    assert f'; {payload.excluded} measurements not used: efforts at limits.force_max' in (
        outcome_of(history, limited).message)
    always = outcome_of(recorded(excited, clip=300.0), HEXAPOD.replaced(
        {'limits.force_max': 300.0}))
    assert always.message.startswith('too short: ')
    assert always.message.endswith(' 4999 measurements not used: efforts at limits.force_max or '
                                   'legs at their ends')


def test_a_known_load_and_a_moving_base_are_no_payload() -> None:
    load = (40.0, -30.0, -200.0, 10.0, 20.0, -5.0)
    random = rng(5)
    shaken = random_base_motion(LOADED, random, 1)

    def base(seconds: Any) -> BaseMotion:
        swing = np.sin(1.3 * np.asarray(seconds))[:, None]
        return BaseMotion(
            np.tile([0.0, 0.0, -9.80665], (len(seconds), 1)),
            0.05 * swing * shaken.linear_acceleration, 0.05 * swing * shaken.angular_velocity,
            0.05 * 1.3 * np.cos(1.3 * np.asarray(seconds))[:, None] * shaken.angular_velocity)

    payload = payload_of(recorded(excited, base=base, wrench=load, known=load))
    assert np.abs(errors(payload)).max() < 2.0
    # It is 200 N, where nobody knows it; no mass pushes sideways.
    heavier = payload_of(recorded(excited, wrench=(0.0, 0.0, -200.0, 0.0, 0.0, 0.0)), FILE)
    assert heavier.fitted.body.mass - TRUE[0] == pytest.approx(200.0 / 9.80665, abs=4.0)
    assert outcome_of(recorded(excited, wrench=load)).message.startswith('the model does not')


def test_the_message_is_valid_in_a_parameter_file(tmp_path: Any) -> None:
    outcome = outcome_of(recorded(excited))
    assert outcome.message.startswith('mass 17') and ' +- 0.0' in outcome.message
    assert re.search(r'; 2\d\.\d+ kg more than platform\.mass; from', outcome.message)
    _, _, text = outcome.message.rpartition('; payload: ')
    file = tmp_path / 'payload.yaml'
    file.write_text(f'/**:\n  ros__parameters:\n    payload: {text}\n', encoding='utf-8')
    Parameters.check_file(file)
    assert text.startswith('{mass: 2')


def test_an_inertia_that_no_body_has_is_not_given() -> None:
    """A moment of inertia larger than the sum of the other two."""
    flat = LOADED.replaced({'platform.inertia': [8.0, 0.1, -0.6, 8.0, 0.3, 23.0]})
    outcome = outcome_of(recorded(excited, noise=Noise(force=0.1), true=flat))
    assert outcome.payload is not None and not outcome.payload.fitted.consistent
    assert 'no real body has the inertia that fits best' in outcome.message
    assert outcome.payload.fitted.body.inertia.tolist() == (
        HEXAPOD['platform.inertia'].tolist())


def test_the_inertia_of_a_plate_that_is_kept_is_one_of_a_body() -> None:
    plate = HEXAPOD.replaced({'platform.inertia': [13.0, 0.0, 0.0, 13.0, 0.0, 26.0]})
    outcome = outcome_of(recorded(at_rest), plate)
    assert 'not identified, as in the parameters' in outcome.message
    assert 'no real body' not in outcome.message


def test_too_few_measurements_are_rejected_with_the_reason() -> None:
    for history, said in (
            (LegHistory(10.0), 'no measured legs'),
            (recorded(excited, seconds=1.5),
             'too short: 1.5 s of measured legs, 2.0 s without gaps '),
            (recorded(excited, seconds=8.0, rate=8.0), 'too short: 8.0 s of measured legs, ')):
        outcome = outcome_of(history)
        assert outcome.payload is None
        assert outcome.message.startswith(said)


@pytest.mark.parametrize(('factor', 'said', 'cause'), [
    (-1.0, 'the measured forces are -1.', 'likely they have another sign'),
    (1e-3, 'the measured forces are 0.001', ''), (1e200, 'the measured forces are 1.', ''),
    (1e304, 'numbers overflow', ''),
    (5.0, 'the model does not explain the measured forces: residual ', '')])
def test_forces_of_another_size_are_named(factor: float, said: str, cause: str) -> None:
    outcome = outcome_of(add_again(
        LegHistory(10.0), recorded(excited, seconds=4.0, rate=200.0), factor))
    assert outcome.payload is None
    assert outcome.message.startswith(said)
    assert outcome.message.endswith(cause)


def test_after_a_restart_only_what_follows_counts() -> None:
    payload = payload_of(add_again(
        recorded(excited, true=HEXAPOD), recorded(excited, seconds=4.0)))
    assert payload.seconds == 4.0
    assert abs(payload.fitted.body.mass - TRUE[0]) < 0.5


def add(history: LegHistory, stamps: Sequence[int]) -> None:
    """Add measurements with these stamps, which are their forces as well."""
    for stamp in stamps:
        history.add_measurement((float(stamp),) * 6, Estimate(
            stamp, tuple(map(float, range(24))), None, None), NO_WRENCH)


def test_the_history_is_a_ring_and_keeps_stamps_exact() -> None:
    history = LegHistory(0.01)
    assert history.capacity == round(0.01 * HIGHEST_RATE)
    begin = 1_700_000_000_000_000_000
    add(history, range(begin, begin + 7))
    assert (history.first, history.count) == (0, 7)
    add(history, range(begin + 7, begin + 50))
    assert (history.first, history.count) == (30, 50)
    assert history.stamps(30, 50).tolist() == list(range(begin + 30, begin + 50))
    rows = history.rows(30, 50)
    assert rows[:, 1:19].tolist() == [list(map(float, range(18)))] * 20
    assert relative(rows[:, 19:25], np.arange(begin + 30, begin + 50)[:, None]) < 1e-15


def test_measurements_overwritten_during_the_work_are_left_out() -> None:
    history = recorded(excited, seconds=10.0, rate=HIGHEST_RATE)
    work = identify(history, StewartPlatform(HEXAPOD))
    next(work)
    add(history, range(12 * SECOND, 12 * SECOND + history.capacity // 2))
    *_, outcome = work
    assert outcome is not None and outcome.payload is not None
    assert abs(outcome.payload.fitted.body.mass - TRUE[0]) < 0.2


def test_the_payload_needs_no_home_pose() -> None:
    """Without limits of length and zero length: poses are those of the measurements."""
    given = HEXAPOD.replaced({
        'limits.length_min': None, 'limits.length_max': None,
        'geometry.zero_length': np.zeros(6)})
    with pytest.raises(ParameterError):
        StewartPlatform(given).home_pose()
    payload = payload_of(recorded(excited), given)
    assert abs(errors(payload)[0]) < 2.0


def test_the_gain_of_efforts_counts_for_the_weight_that_is_there() -> None:
    """A mass of 300 kg is known as well, by its own size, as one of 172 kg."""
    unsure = HEXAPOD.replaced({'uncertainty.effort_gain': 0.02})
    parts = []
    for mass in (TRUE[0], 300.0):
        true = LOADED.replaced({'platform.mass': mass})
        fitted = payload_of(recorded(excited, true=true), unsure).fitted
        parts.append(fitted.half_widths[0] / mass)
    assert parts[1] > 0.85 * parts[0]


def test_right_forces_of_creeping_legs_are_explained() -> None:
    """Rates near their noise: friction is that of the rates that neighbours support."""
    for seed in (9, 10, 15):
        found = judged_payload(drawn(seed), 'creeping', seed)
        assert found.judged, found.notices
        assert found.of('platform.mass').miss < 1.5


def test_a_payload_that_is_given_is_part_of_the_body() -> None:
    """Given apart or in ``platform.*``, the same body is identified from the same file."""
    rider = Body(30.0, np.array([0.1, 0.0, 0.3]), np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.5]))
    apart = HEXAPOD.with_payload(rider)
    one, two = (payload_of(recorded(excited), given) for given in (apart, apart.merged()))
    assert numbers_of(one.fitted.body) == pytest.approx(numbers_of(two.fitted.body), rel=1e-9)
    assert one.fitted.half_widths == pytest.approx(two.fitted.half_widths, rel=1e-9)
    # The payload alone does not depend on the one that was given.
    body, other = carried_payload(one), carried_payload(payload_of(recorded(excited)))
    assert isinstance(body, Body) and isinstance(other, Body)
    assert body.mass == pytest.approx(22.0, abs=1.0)
    assert other.mass == pytest.approx(22.0, abs=1.0)


def test_the_payload_alone_with_the_platform_is_what_was_identified() -> None:
    found = payload_of(recorded(excited))
    body = carried_payload(found)
    assert isinstance(body, Body)
    assert np.linalg.eigvalsh(inertia_matrix(body.inertia))[0] >= -1e-12
    carried = HEXAPOD.with_payload(body).carried
    assert carried.mass == pytest.approx(found.fitted.body.mass, rel=1e-12)
    assert carried.center == pytest.approx(found.fitted.body.center, rel=1e-12)


def test_no_payload_and_less_than_the_platform_are_told_apart() -> None:
    found = payload_of(recorded(at_rest, true=HEXAPOD))
    assert carried_payload(found) == Body(0.0, pytest.approx(np.zeros(3)), pytest.approx(
        np.zeros(6)))
    heavy = HEXAPOD.replaced({'platform.mass': 200.0})
    reason = carried_payload(payload_of(recorded(excited), heavy))
    assert isinstance(reason, str) and 'less than platform.mass, 200 kg' in reason
    # At rest the inertia is not identified: a point mass.
    point = carried_payload(payload_of(recorded(at_rest)))
    assert isinstance(point, Body) and point.mass == pytest.approx(22.0, abs=3.0)
    assert not point.inertia.any()
