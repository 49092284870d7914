# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Motion cueing: the washout against independent integrations, and the governor."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from referees import PLATFORM
from scipy.integrate import solve_ivp
from scipy.signal import lsim, lti
from snapshot import Snapshot
from stewart_dynamics import (
    GovernedStream, Motion, MotionCueing, MotionError, ParameterError, Parameters, Pose)
from stewart_dynamics.arrays import Array
from stewart_dynamics.cueing.motion_cueing import AXES, GRAVITY, OMCT_FREQUENCIES
from stewart_dynamics.mechanics.frames.rotation import to_euler
from stewart_dynamics.mechanics.kinematics.home_pose import home_pose
from stewart_dynamics.mechanics.limits import OF_LOADS, result_values, VELOCITY_MAX
from stewart_dynamics.mechanics.pose_limits import PoseLimits
from stewart_dynamics.mechanics.rows import CONDITION, RATES
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform

PARAMETERS = Parameters.from_yaml(PLATFORM)
GAIN_1 = {'cueing.translation.gain': [1.0] * 3, 'cueing.tilt.gain': [1.0] * 2,
          'cueing.rotation.gain': [1.0] * 3}
FREE = {'cueing.govern': False, 'cueing.tilt.rate_max': 100.0}
AT_REST = np.array([0.0, 0.0, GRAVITY])
HOME = home_pose(PARAMETERS).position


def cueing_of(*changes: dict[str, Any], **more: Any) -> MotionCueing:
    """Return the cueing of the example hexapod with some parameters changed."""
    changed = {name: value for each in changes for name, value in each.items()}
    return MotionCueing(PARAMETERS.replaced({**changed, **more}))


def step(axis: int, size: float, times: Array) -> Array:
    """Return specific forces (N, 3) of a constant acceleration."""
    force = np.tile(AT_REST, (len(times), 1))
    force[:, axis] += size
    return force


def vehicle(times: Array) -> tuple[Array, Array]:
    """Return smooth specific forces and angular velocities (N, 3)."""
    force = AT_REST + np.sin(times[:, None] * [1.0, 0.7, 3.0] + [0.0, 1.0, 2.0])
    return force, 0.2 * np.sin(times[:, None] * [1.3, 0.9, 0.4] + [0.5, 0.0, 1.0])


@pytest.mark.parametrize('axis, largest, at', [
    (0, 0.11577, 1.607), (1, 0.04522, 1.004), (2, 0.04522, 1.004)])
@pytest.mark.parametrize('govern', [False, True])
def test_translation_is_washed_out(axis: int, largest: float, at: float, govern: bool) -> None:
    """The head moves as far, and as late, as the equations say, and returns."""
    times = np.arange(0.0, 20.0005, 0.001)
    motion = cueing_of(GAIN_1, {'cueing.govern': govern}).run(times, step(axis, 1.0, times))
    away = (motion.position - HOME)[:, axis]
    assert away.max() == pytest.approx(largest, abs=5e-6)
    assert times[away.argmax()] == pytest.approx(at, abs=1e-3)
    assert away[-1] == pytest.approx(0.00133 if axis == 0 else 0.0, abs=1e-4)


def test_tilt_gives_the_sustained_force() -> None:
    """1 m/s^2 tilts by 5.8527 degrees, nose up, at most at the maximum rate."""
    times = np.arange(0.0, 30.0, 0.01)
    cueing = cueing_of(GAIN_1)
    motion = cueing.run(times, step(0, 1.0, times))
    angles = np.degrees(to_euler(motion.rotation))
    np.testing.assert_allclose(angles[-1], [0.0, -5.8527, 0.0], atol=1e-4)
    assert np.abs(motion.angular_velocity).max() <= 0.0524
    assert np.abs(motion.angular_velocity).max() > 0.9 * 0.0524
    felt = cueing.felt(motion)
    np.testing.assert_allclose(felt.specific_force[-1, :2], [1.0, 0.0], atol=2e-3)
    right = to_euler(cueing.run(times, step(1, -1.0, times)).rotation[-1])
    np.testing.assert_allclose(np.degrees(right), [-5.8527, 0.0, 0.0], atol=1e-4)


def test_response_of_surge() -> None:
    """The analytic response is that of the model's table."""
    found = cueing_of(GAIN_1, {'cueing.tilt.gain': [1.0, 0.0]}).response(
        [0.1, 1.0, 3.981, 15.849])
    np.testing.assert_allclose(np.abs(found['surge']), [0.99936, 0.82887, 0.41238, 0.88903],
                               atol=6e-6)
    np.testing.assert_allclose(np.degrees(np.angle(found['surge'])),
                               [-2.32, -21.50, 9.28, 17.21], atol=6e-3)
    assert list(found) == [*AXES[:1], *AXES[1:]]


@pytest.mark.parametrize('axis', range(6))
def test_measured_response_is_the_analytic_one(axis: int) -> None:
    """At the frequencies of the objective motion cueing test, within 0.1 % and 0.1 degrees."""
    cueing = cueing_of({'cueing.input': 'acceleration'})
    for n, frequency in enumerate(OMCT_FREQUENCIES):
        period = 2.0 * np.pi / frequency
        rest = np.ceil(40.0 / period)  # transients of 0.25 rad/s are gone
        samples = max(128, round(period / 0.01))
        times = np.arange((rest + 1.0) * samples) * period / samples
        inputs = np.zeros((len(times), 6))
        # Small: the felt is linear only then.
        inputs[:, axis] = 1e-3 * np.sin(frequency * times)
        motion = cueing.run(times, inputs[:, :3], inputs[:, 3:])
        felt = np.column_stack(cueing.felt(motion))[-samples:]
        felt[:, 2] -= GRAVITY
        wave = np.exp(-1j * frequency * times[-samples:])
        ratio = (felt[:, axis] @ wave) / (inputs[-samples:, axis] @ wave)
        wanted = cueing.response(OMCT_FREQUENCIES)[AXES[axis]][n]
        assert abs(abs(ratio) / abs(wanted) - 1.0) < 1e-3
        assert abs(np.degrees(np.angle(ratio / wanted))) < 0.1


def test_filters_are_those_of_scipy() -> None:
    """Exact for inputs that are linear between samples, also where these are far apart."""
    cueing = cueing_of(FREE, {'cueing.input': 'acceleration'})
    generator = np.random.default_rng(3)
    times = np.cumsum(generator.choice([1e-4, 0.003, 0.01, 0.4, 7.0], 300))
    inputs = generator.normal(size=(300, 6)) * [1.0, 1.0, 1.0, 0.1, 0.1, 0.1]
    motion = cueing.run(times, inputs[:, :3], inputs[:, 3:])
    angles = to_euler(motion.rotation)
    p = cueing.parameters
    fine = np.concatenate([np.linspace(a, b, 9)[:-1] for a, b in zip(
        times[:-1], times[1:], strict=True)] + [times[-1:]])

    def of_scipy(numerator: list[float], denominator: Array, column: Array) -> Array:
        # lsim is exact for equal steps; here each interval is one.
        system = lti(numerator, denominator).to_ss()
        state = np.zeros(len(system.A))
        outputs = [system.D[0, 0] * column[0]]
        for k in range(len(times) - 1):
            t = np.linspace(0.0, times[k + 1] - times[k], 2)
            _, y, x = lsim(system, column[k:k + 2], t, X0=state)
            state = np.atleast_2d(x.T).T[-1]
            outputs.append(y[-1])
        return np.array(outputs)

    assert len(fine) > len(times)
    for n in range(3):
        w, zeta, slow = (p[f'cueing.translation.{name}'][n] for name in (
            'natural_frequency', 'damping', 'washout_frequency'))
        filters = np.polymul([1.0, 2.0 * zeta * w, w ** 2], [1.0, slow])
        np.testing.assert_allclose(
            (motion.position - HOME)[:, n], of_scipy([0.5, 0.0], filters, inputs[:, n]),
            atol=1e-11)
        np.testing.assert_allclose(
            motion.linear_acceleration[:, n],
            of_scipy([0.5, 0.0, 0.0, 0.0], filters, inputs[:, n]), atol=1e-10)
    tilt = [of_scipy([0.5 * w ** 2 / GRAVITY], np.array([1.0, 2.0 * w, w ** 2]), inputs[:, n])
            for n, w in enumerate(p['cueing.tilt.natural_frequency'])]
    turn = [of_scipy([0.5], np.array([1.0, 1.0]), inputs[:, 3 + n]) for n in range(3)]
    np.testing.assert_allclose(angles, np.column_stack([
        turn[0] + np.arcsin(tilt[1]), turn[1] - np.arcsin(tilt[0]), turn[2]]), atol=1e-9)


def test_limited_tilt_is_that_of_an_integration() -> None:
    """The law of the limited rate, integrated by another method."""
    w, most, size = 8.0, 0.0524, 3.0
    times = np.linspace(0.0, 4.0, 101)
    motion = cueing_of({'cueing.govern': False, 'cueing.tilt.gain': [0.0, 1.0],
                        'cueing.translation.gain': [0.0] * 3}).run(
        times, step(1, size, times))

    def law(t: float, state: Array) -> list[float]:
        angle, rate = state
        y, y_rate = np.sin(angle), np.cos(angle) * rate
        free = ((w ** 2 * (size / GRAVITY - y) - 2.0 * w * y_rate) / np.cos(angle)
                + np.tan(angle) * rate ** 2)
        k = 10.0 * w
        return [rate, max(min(free, k * (most - rate)), -k * (most + rate))]

    exact = solve_ivp(law, (0.0, 4.0), [0.0, 0.0], 'DOP853', times, rtol=1e-11, atol=1e-13,
                      max_step=0.01)
    np.testing.assert_allclose(to_euler(motion.rotation)[:, 0], exact.y[0], atol=1e-9)
    np.testing.assert_allclose(motion.angular_velocity[:, 0], exact.y[1], atol=1e-8)


@pytest.mark.parametrize('rate', [3.0, 20.0, 60.0, 300.0])
def test_tilt_is_never_faster_than_its_limit(rate: float) -> None:
    """Also where the input is slower than the filter, and the law changes its side in between."""
    random = np.random.default_rng(round(rate))
    for _ in range(60):
        frequency, damping = 10.0 ** random.uniform(-0.3, 2.0), random.choice([0.5, 1.0, 5.0])
        rate_max = 10.0 ** random.uniform(-2.5, 0.3)
        cueing = cueing_of(GAIN_1, {
            'cueing.govern': False, 'cueing.translation.gain': [0.0] * 3,
            'cueing.rotation.gain': [0.0] * 3, 'cueing.tilt.rate_max': rate_max,
            'cueing.tilt.natural_frequency': [frequency] * 2,
            'cueing.tilt.damping': [damping] * 2})
        times = np.cumsum(random.uniform(0.5, 1.5, 200)) / rate
        force = AT_REST + np.outer(
            random.normal(size=200), 10.0 ** random.uniform(-1.0, 1.5) * np.eye(3)[0])
        motion = cueing.run(times, force)
        assert np.abs(motion.angular_velocity[:, 1]).max() <= rate_max


@pytest.mark.parametrize('changes', [{}, {'cueing.govern': False}, {
    'cueing.translation.gain': [3.0] * 3, 'cueing.rotation.gain': [3.0] * 3}])
def test_pieces_give_the_same_bits(changes: dict[str, Any]) -> None:
    """Also where the governor holds the demand back."""
    cueing = cueing_of(changes)
    times = np.cumsum(np.random.default_rng(1).uniform(0.002, 0.02, 2000))
    force, rates = vehicle(times)
    whole, stream = cueing.run(times, force, rates), cueing.stream()
    pieces = [stream.advance(times[n:n + 77], force[n:n + 77], rates[n:n + 77]).rows
              for n in range(0, len(times), 77)]
    assert np.array_equal(whole.rows, np.concatenate(pieces))
    assert (sum(stream.held.values()) > 0.0) == ('cueing.rotation.gain' in changes)


def test_one_by_one_gives_the_same_bits() -> None:
    """As the node computes it, with the felt quantities."""
    cueing = cueing_of({'cueing.head': [0.1, 0.2, 0.9]})
    times = np.arange(200) * 0.004
    force, rates = vehicle(times)
    motion, stream = cueing.run(times, force, rates), cueing.stream()
    felt = np.column_stack(cueing.felt(motion))
    for n, time in enumerate(times.tolist()):
        stream.advance_by_one(time, [*force[n].tolist(), *rates[n].tolist()])
        assert np.array_equal(stream.row, motion.rows[n])
        assert np.array_equal(stream.felt, felt[n])


@pytest.mark.parametrize('changes', [FREE, {'cueing.tilt.rate_max': 100.0}, {
    'cueing.translation.gain': [3.0] * 3, 'cueing.rotation.gain': [3.0] * 3}])
def test_twist_and_acceleration_are_derivatives(changes: dict[str, Any]) -> None:
    """By Gauss quadrature between samples that are put between others."""
    nodes, weights = np.polynomial.legendre.leggauss(6)
    edges = np.arange(0.0, 12.0, 0.004)
    inner = edges[:-1, None] + 0.002 * (1.0 + nodes)
    times = np.column_stack([edges[:-1], inner]).ravel()
    # Linear between the edges, so that samples between them change nothing.
    on_edges = vehicle(edges)
    force, rates = (np.column_stack([np.interp(times, edges, each[:, n]) for n in range(3)])
                    for each in on_edges)
    cueing = cueing_of(changes, **{'cueing.head': [0.3, -0.2, 0.9]})
    rows = cueing.run(times, force, rates).rows.reshape(len(edges) - 1, 7, -1)
    motion = Motion.of_rows(rows)

    def integral(values: Array) -> Array:
        total: Array = 0.002 * np.einsum('kni,n->ki', values[:-1, 1:], weights)
        return total

    def change(values: Array) -> Array:
        difference: Array = np.diff(values[:, 0], axis=0)
        return difference

    governed = 'cueing.rotation.gain' in changes  # shares differ between steps
    tolerance = 1e-9 if not governed else 2e-5
    np.testing.assert_allclose(change(motion.position), integral(motion.linear_velocity),
                               atol=tolerance)
    np.testing.assert_allclose(change(motion.linear_velocity),
                               integral(motion.linear_acceleration), atol=40.0 * tolerance)
    np.testing.assert_allclose(change(motion.angular_velocity),
                               integral(motion.angular_acceleration), atol=40.0 * tolerance)
    skew = np.cross(motion.angular_velocity[..., None, :], np.eye(3)).swapaxes(-1, -2)
    turning = np.einsum('knij,knjl->knil', skew, motion.rotation).reshape(*motion.shape, 9)
    np.testing.assert_allclose(change(rows[..., 3:12]), integral(turning), atol=tolerance)


def test_felt_is_at_the_head() -> None:
    """Rotation about the head alone moves the platform's origin, and is felt as rotation."""
    head = [0.4, 0.1, 1.2]
    cueing = cueing_of({'cueing.head': head, 'cueing.input': 'acceleration'})
    times = np.arange(0.0, 3.0, 0.004)
    rates = np.column_stack([0.3 * np.sin(2.0 * times), np.zeros((len(times), 2))])
    motion = cueing.run(times, np.zeros((len(times), 3)), rates)
    at_head = motion.position + motion.rotation @ head
    np.testing.assert_allclose(at_head, np.tile(HOME + head, (len(times), 1)), atol=1e-12)
    felt = cueing.felt(motion)
    np.testing.assert_allclose(np.linalg.norm(felt.specific_force, axis=1), GRAVITY, rtol=1e-12)
    np.testing.assert_allclose(felt.angular_velocity[:, 0], motion.angular_velocity[:, 0],
                               atol=1e-12)
    assert np.ptp(motion.position[:, 1]) > 0.01


def exceeded(parameters: Parameters, motion: Motion) -> list[str]:
    """Return the limits that samples exceed, by the package's checks of samples."""
    limits, results = PoseLimits(parameters), StewartPlatform(parameters).solve(motion.rows)
    values = limits.values(motion.rows, results)
    if VELOCITY_MAX in limits.limits.bounds:
        values[VELOCITY_MAX] = results[:, RATES]
    found = [name for name, each in values.items() if limits.limits.exceeds(name, each).any()]
    found += [name for name, each in result_values(parameters, results).items()
              if name in OF_LOADS and limits.limits.exceeds(name, each).any()]
    if parameters.drives:
        motors = StewartPlatform(parameters).motors(motion)
        found += ['torque'] * bool((motors.margins < 0.0).any())
        found += ['speed'] * bool((np.abs(motors.speeds) > parameters['drive.speed_max']).any())
    return found + ['singular'] * bool((results[:, CONDITION] >= limits.stop_condition).any())


LIMITED: dict[str, dict[str, Any]] = {
    'example': {},
    'angles': {'limits.base_joint_angle_max': [0.25], 'limits.platform_joint_angle_max': [0.2]},
    'clearance': {'limits.leg_clearance_min': 0.16, 'legs.cylinder.radius': [0.05],
                  'legs.piston.radius': [0.03], 'legs.cylinder.length': [0.8]},
    'forces': {'limits.force_max': [700.0]},
    'joint forces': {'limits.joint_force_max': [600.0], 'actuator.reflected_mass': [100.0],
                     'limits.force_max': None},
    'motors': {'actuator.screw_lead': [0.01], 'drive.torque_max': [1.6],
               'drive.speed_max': [250.0], 'drive.efficiency': [0.9]},
    'condition': {'singularity.warn_condition': 3.5, 'singularity.stop_condition': 4.0}}


@pytest.mark.parametrize('kind', LIMITED)
def test_governor_keeps_all_limits(kind: str) -> None:
    """Steps of 5 g, spins and noise; each limit holds some of them back."""
    parameters = PARAMETERS.replaced({
        'cueing.input': 'acceleration', **GAIN_1, **LIMITED[kind]})
    stream = MotionCueing(parameters).stream()
    generator = np.random.default_rng(5)
    times = np.arange(15000) * 0.004
    inputs = np.zeros((len(times), 6))
    for axis, size in enumerate([49.0, 49.0, 30.0, 3.0, 3.0, 20.0]):
        edges = np.sort(generator.uniform(0.0, 55.0, 12))
        levels = size * generator.uniform(-1.0, 1.0, 13) * (generator.random(13) < 0.4)
        inputs[:, axis] = levels[np.searchsorted(edges, times)]
        inputs[:, axis] += 0.1 * size * generator.normal(size=len(times)) * (times > 40.0)
    inputs[times > 55.0] = 0.0
    motion = stream.advance(times, inputs[:, :3], inputs[:, 3:])
    assert exceeded(parameters, motion) == []
    # No steps: each acceleration lasts for a period.
    assert np.abs(np.diff(motion.position, axis=0)).max() < 0.02
    assert np.abs(np.diff(motion.linear_velocity, axis=0)).max() < 0.25
    assert sum(stream.held.values()) > 1.0
    wanted = {'angles': 'joint_angle', 'clearance': 'clearance', 'forces': 'force_max',
              'motors': 'drive.', 'condition': 'singularity'}.get(kind, 'velocity_max')
    assert sum(time for name, time in stream.held.items() if wanted in name) > 0.0


def test_governor_returns_to_the_washout() -> None:
    """After it has held the demand back, the motion blends into the demand, to the bit."""
    times = np.arange(10000) * 0.004
    force, rates = vehicle(times)
    force[(times > 2.0) & (times < 5.0), 0] += 40.0
    governed, free = (cueing_of({'cueing.govern': govern}) for govern in (True, False))
    motion, demand = governed.run(times, force, rates), free.run(times, force, rates)
    assert np.array_equal(motion.rows[:400], demand.rows[:400])
    assert np.abs(motion.position - demand.position).max() > 0.1
    assert np.array_equal(motion.rows[-100:], demand.rows[-100:])


@pytest.mark.parametrize('govern', [False, True])
@pytest.mark.parametrize('rate_max', [0.001, 0.03, 0.1])
def test_a_changed_rate_of_tilt_is_neared_without_a_jerk(rate_max: float, govern: bool) -> None:
    """While it tilts at the limit: never faster than the larger of both, and gently."""
    times = np.arange(1500) * 0.004
    force = step(0, 2.0, times)
    before = cueing_of(GAIN_1, {'cueing.govern': govern})
    stream = before.stream()
    first = stream.advance(times[:400], force[:400])
    stream.use(MotionCueing(before.parameters.replaced({'cueing.tilt.rate_max': rate_max})))
    motion = stream.advance(times[400:], force[400:])
    rates = np.concatenate([each.angular_velocity[:, 1] for each in (first, motion)])
    assert rates[399] == pytest.approx(-0.0524, abs=1e-4)
    assert np.abs(rates).max() <= max(0.0524, rate_max) * (1.0 + 1e-9)
    # The exponential with 4/s has this acceleration; a step of the input needs ten times as much.
    accelerations = motion.angular_acceleration[:, 1]
    assert np.abs(accelerations).max() < 4.0 * abs(rate_max - 0.0524) + 0.01
    assert np.abs(first.angular_acceleration).max() > 2.0
    assert np.abs(np.diff(accelerations)).max() < 0.2 * 4.0 * abs(rate_max - 0.0524)
    if rate_max < 0.0524:
        assert abs(rates[-1]) <= rate_max * 1.01


@pytest.mark.parametrize('changes', [
    {'cueing.translation.gain': [0.9, 0.2, 0.7], 'cueing.tilt.gain': [0.8, 0.1],
     'cueing.rotation.gain': [0.1, 0.9, 0.6], 'cueing.translation.natural_frequency': [4.0] * 3,
     'cueing.tilt.natural_frequency': [3.0, 3.0]},
    {'cueing.head': [0.3, -0.2, 1.0]}, {'cueing.tilt.rate_max': 0.1},
    {'cueing.translation.washout_frequency': [1.0] * 3},
    {'cueing.rotation.natural_frequency': [0.3] * 3}])
def test_changed_parameters_blend_in(changes: dict[str, Any]) -> None:
    """Without a step in the acceleration, and soon as if they had always been these."""
    times = np.arange(10000) * 0.004
    force, rates = vehicle(times)
    before, after = cueing_of(), cueing_of(changes)
    stream = before.stream()
    first = stream.advance(times[:2000], force[:2000], rates[:2000])
    stream.use(after)
    motion = Motion.of_rows(np.concatenate([
        first.rows, stream.advance(times[2000:], force[2000:], rates[2000:]).rows]))
    for name in ('position', 'linear_velocity', 'linear_acceleration', 'angular_velocity',
                 'angular_acceleration'):
        steps = np.abs(np.diff(getattr(motion, name), axis=0)).max(axis=1)
        # The return begins with a jerk, not with a step.
        assert steps[1999] < 5.0 * steps[500:1999].max(), name
    np.testing.assert_allclose(motion.rows[-1], after.run(times, force, rates).rows[-1],
                               atol=1e-4)


def test_stop_is_within_the_limits() -> None:
    """A motion that is stopped comes to rest, and goes on when it is released."""
    times = np.arange(5000) * 0.004
    force, rates = vehicle(times)
    stream = cueing_of(GAIN_1).stream()
    moving = stream.advance(times[:1000], force[:1000], rates[:1000])
    stream.stop()
    stopping = stream.advance(times[1000:2000], force[1000:2000], rates[1000:2000])
    assert exceeded(PARAMETERS, stopping) == []
    assert np.abs(moving.linear_velocity[-1]).max() > 0.05
    assert np.abs(stopping.rows[-1, 12:]).max() < 1e-6
    steps = np.abs(np.diff(np.concatenate([moving.rows, stopping.rows]), axis=0))
    assert steps[999, 18:].max() < 0.5
    stream.resume()
    again = stream.advance(times[2000:], force[2000:], rates[2000:])
    assert np.abs(again.linear_velocity).max() > 0.05


@pytest.mark.parametrize('times, force, rates', [
    ([0.0, 0.0], [AT_REST] * 2, None),
    ([0.0, -1.0], [AT_REST] * 2, None),
    ([0.0, np.nan], [AT_REST] * 2, None),
    ([0.0, 1.0], [AT_REST, [0.0, np.inf, 0.0]], None),
    ([0.0, 1.0], [AT_REST] * 2, [[0.0] * 3, [0.0, 0.0, np.nan]]),
    ([0.0, 1.0], [AT_REST, [1e5, 0.0, 0.0]], None),
    ([0.0], [AT_REST] * 2, None),
    ([0.0, 1.0], [[1.0, 2.0]] * 2, None)])
def test_bad_input_is_named(times: Any, force: Any, rates: Any, snapshot: Snapshot) -> None:
    with snapshot.raises(MotionError):
        cueing_of().run(times, force, rates)


def test_home_must_be_within_the_limits(snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        cueing_of({'limits.force_max': [100.0]})
    cueing_of({'limits.force_max': [100.0], 'cueing.govern': False})


def test_path_will_do() -> None:
    assert MotionCueing(PLATFORM).parameters == PARAMETERS
    assert MotionCueing(str(PLATFORM)).parameters == PARAMETERS


def test_any_stream_can_be_governed(snapshot: Snapshot) -> None:
    """A demand within the limits is followed, and one beyond them as far as they let it."""
    times = np.arange(6000) * 0.004
    angle = np.outer(times, [0.5, 0.7, 1.1, 0.9, 0.4, 0.6])
    wave, slope, bend = np.sin(angle), np.cos(angle), -np.sin(angle)
    w = np.array([0.5, 0.7, 1.1, 0.9, 0.4, 0.6])

    def demanded(size: float) -> Motion:
        sizes = size * np.array([0.1, 0.1, 0.1, 0.1, 0.1, 0.2])
        q, v, a = sizes * wave, sizes * w * slope, sizes * w ** 2 * bend
        return Motion.from_euler(HOME + q[:, :3], q[:, 3:], v[:, :3], v[:, 3:], a[:, :3], a[:, 3:])

    small = demanded(1.0)
    stream = GovernedStream(PARAMETERS)
    motion = stream.advance(times, small)
    np.testing.assert_allclose(motion.rows[0, 12:], 0.0, atol=1e-12)  # it begins at rest at home
    np.testing.assert_allclose(motion.rows[-100:], small.rows[-100:], atol=1e-10)
    assert sum(stream.held.values()) == 0.0
    large, stream = demanded(6.0), GovernedStream(PARAMETERS, small[0])
    motion = Motion.of_rows(np.concatenate([
        stream.advance(times[n:n + 1000], large[n:n + 1000]).rows for n in range(0, 6000, 1000)]))
    assert exceeded(PARAMETERS, motion) == []
    assert exceeded(PARAMETERS, large) != []
    assert sum(stream.held.values()) > 1.0
    with snapshot.raises(MotionError):
        stream.advance(times[:1], large[:1])


def test_changes_under_which_the_stop_would_exceed_a_limit_are_rejected(
        snapshot: Snapshot) -> None:
    times = np.arange(1000) * 0.004
    force, rates = vehicle(times)
    stream = cueing_of(GAIN_1).stream()
    last = stream.advance(times[:500], force[:500], rates[:500])[-1]
    rate = np.abs(StewartPlatform(PARAMETERS).inverse_dynamics(last).rates).max()
    with snapshot.raises(ParameterError):
        stream.use(cueing_of({**GAIN_1, 'limits.velocity_max': 0.5 * float(rate)}))
    motion = stream.advance(times[500:], force[500:], rates[500:])
    assert np.array_equal(motion.rows, cueing_of(GAIN_1).run(times, force, rates).rows[500:])


def test_a_governed_stream_begins_within_the_limits(snapshot: Snapshot) -> None:
    beyond = Pose([0.0, 0.0, 5.0], np.eye(3))
    with snapshot.raises(MotionError):
        GovernedStream(PARAMETERS, beyond)
    with snapshot.raises(MotionError):
        GovernedStream(PARAMETERS, Pose(np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1))))
    with snapshot.raises(MotionError):
        GovernedStream('platform.yaml')  # type: ignore[arg-type]


def test_gaps_that_would_take_long_to_compute_are_rejected(snapshot: Snapshot) -> None:
    times, force = np.array([0.0, 1.0, 1e6]), np.tile([0.0, 0.0, 9.80665], (3, 1))
    with snapshot.raises(MotionError):
        cueing_of().run(times, force)
