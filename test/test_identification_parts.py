# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The parts of an identification: filters, windows, kinematics, bounds, reading of bags."""

from __future__ import annotations

from contextlib import closing
import os
from pathlib import Path
import subprocess
import sys
from typing import Any

from estimate_cases import CASES, rich
from legs_of_all_kinds import efforts_of
import numpy as np
from numpy.typing import NDArray
from programs import call
import pytest
from recorded import fourier, Recorded, write_bag
from referees import relative, rng, ROOT
from snapshot import Snapshot

from stewart_dynamics import Parameters, StewartPlatform
from stewart_dynamics.bags.recording import Recording
from stewart_dynamics.errors import BagError
from stewart_dynamics.identification.filters import convolved, decimated, LowPass, white_deviation
from stewart_dynamics.identification.identify_command_line import main
from stewart_dynamics.identification.parameter_fit import consistent
from stewart_dynamics.identification.recorded_legs import find_topics, RecordedLegs
from stewart_dynamics.identification.unknowns import regressor_of, Unknowns
from stewart_dynamics.identification.window_poses import motions, pose_near, poses
from stewart_dynamics.identification.windows import interpolated, Signal, uniform
from stewart_dynamics.mechanics.dynamics.pseudo_inertia import is_consistent

PROGRAM = 'stewart_identify'

Array = NDArray[np.float64]

GIVEN = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
PERIOD = 1e-3
FILTER = LowPass.of(PERIOD, 25.0, 10.0)
TIMES = np.arange(4000) * PERIOD
INNER = TIMES[FILTER.half:-FILTER.half]


def wave(frequency: float, order: int = 0, times: Array = TIMES) -> Array:
    """Return a sine with mean one (N, 1), or its derivative."""
    w = 2.0 * np.pi * frequency
    sine: Array = w ** order * np.sin(w * times + 0.3 + 0.5 * np.pi * order)[:, None]
    return sine + 1.0 if not order else sine


@pytest.mark.parametrize('frequency', [0.2, 1.0, 5.0, 15.0])
def test_filters_give_derivatives_without_phase(frequency: float) -> None:
    w = 2.0 * np.pi * frequency
    for order, allowed in ((0, 1e-4), (1, 1e-4), (2, 2e-3)):
        found = convolved(wave(frequency), FILTER.taps(order))
        off = found - wave(frequency, order, INNER)
        assert np.abs(off).max() < allowed * w ** order, order
        of_positions, of_rates = FILTER.fused(order, 1e-5, 1e-3)
        both = convolved(wave(frequency), of_positions) + convolved(
            wave(frequency, 1), of_rates)
        assert np.abs(both - wave(frequency, order, INNER)).max() < 2e-3 * w ** order


@pytest.mark.parametrize(('period', 'cutoff'), [(4e-3, 10.0), (4e-3, 25.0), (2e-2, 5.0)])
@pytest.mark.parametrize('rates', [5e-6, 5e-4])
def test_derivatives_have_the_gain_of_the_filter(
        period: float, cutoff: float, rates: float) -> None:
    band = LowPass.of(period, cutoff, 0.4 * cutoff)
    at = period * np.arange(-band.half, band.half + 1)
    for w in 2.0 * np.pi * cutoff * np.array([0.02, 0.1, 0.2, 0.4]):
        waves = np.exp(1j * w * at)
        gain = band.taps() @ waves
        for order in (1, 2):
            assert abs(band.taps(order) @ waves / (1j * w) ** order - gain) < 5e-4
            of_positions, of_rates = band.fused(order, 5e-6, rates)
            both = of_positions @ waves + 1j * w * (of_rates @ waves)
            assert abs(both / (1j * w) ** order - gain) < 2e-3


@pytest.mark.parametrize('later', [0.3 * PERIOD, -0.7 * PERIOD])
def test_a_filter_gives_earlier_samples(later: float) -> None:
    for order in (0, 1, 2):
        found = convolved(wave(5.0), FILTER._replace(later=later).taps(order))
        np.testing.assert_allclose(found, wave(5.0, order, INNER - later), rtol=0.0,
                                   atol=1e-4 * (10.0 * np.pi) ** order)


def test_filters_remove_frequencies_above_the_band() -> None:
    assert np.abs(convolved(wave(40.0) - 1.0, FILTER.taps())).max() < 1e-3


@pytest.mark.parametrize('step', [1, 7, 25])
def test_decimation_keeps_every_nth_filtered_sample(step: int) -> None:
    signal = rng(1).normal(size=(1500, 2, 3))
    whole = convolved(signal.reshape(1500, -1), FILTER.taps())[::step]
    np.testing.assert_allclose(decimated(signal, FILTER.taps(), step).reshape(len(whole), -1),
                               whole, atol=1e-12)


def test_white_noise_is_separated_from_the_signal() -> None:
    noisy = wave(2.0) + 1e-5 * rng(2).normal(size=(4000, 1))
    assert white_deviation(noisy)[0] == pytest.approx(1e-5, rel=0.05)


@pytest.mark.parametrize(('kind', 'tolerance'), [('telescopic', 1e-6), ('crank', 1e-5)])
def test_the_motion_of_drives_is_the_motion_they_come_from(kind: str, tolerance: float) -> None:
    platform, path = StewartPlatform(CASES[kind].given), CASES[kind].placed(rich(rng(2)))
    times, h = np.arange(200) * 0.005, 1e-5
    truth, (rates, ahead, behind) = path(times), (
        getattr(platform.inverse_dynamics(path(times + s)), CASES[kind].given.leg_kind.rate.field)
        for s in (0.0, h, -h))
    positions = platform.inverse_kinematics(truth)
    found = poses(platform, positions, pose_near(platform, positions[0]))
    # accelerations of the drives by differences of the exact rates
    rows = motions(platform, found, rates, (ahead - behind) / (2.0 * h))
    np.testing.assert_allclose(rows[:, :18], truth.rows[:, :18], atol=1e-9)
    np.testing.assert_allclose(rows[:, 18:], truth.rows[:, 18:], atol=tolerance)


def test_uneven_stamps_are_interpolated_and_wild_values_replaced() -> None:
    random = rng(3)
    times = TIMES + 2e-4 * random.uniform(-1.0, 1.0, 4000)
    exact = np.tile(wave(2.0, 0, times), (1, 6))
    np.testing.assert_allclose(
        interpolated(times, exact, TIMES[10:-10]), np.tile(wave(2.0)[10:-10], (1, 6)), atol=1e-9)
    noisy = exact + 1e-5 * random.normal(size=exact.shape)
    spoiled = noisy.copy()
    spoiled[1000, 2] += 0.5
    spoiled[2000:, 4] += 0.1  # a step is not an outlier
    stamps = np.round(times * 1e9).astype(np.int64) + 10 ** 12
    window = uniform(Signal(stamps, spoiled), Signal(stamps, noisy), PERIOD)
    assert window is not None
    assert window.rates is None
    near = np.flatnonzero(window.outliers.any(axis=1))
    assert len(near) == 1 and abs(near[0] - 1000) < 3
    assert window.outliers[near[0]].tolist() == [False, False, True, False, False, False]
    assert np.abs(window.positions[1000, 2] - wave(2.0)[1000, 0]) < 1e-3


def assert_derivative(u: Unknowns, values: Array) -> None:
    """Check the derivative by central differences."""
    for n, change in enumerate(1e-6 * np.eye(len(values))):
        difference = (u.theta(values + change) - u.theta(values - change)) / 2e-6
        np.testing.assert_allclose(u.derivative(values)[:, n], difference, atol=1e-6)


def test_unknowns_are_in_the_terms_of_the_file() -> None:
    u = Unknowns(GIVEN, ['platform', 'friction', 'piston', 'offset'])
    assert u.names[0] == 'platform.mass'
    assert len(u.asked) == 10 + 12 + 18 + 6
    assert len(u.names) == len(u.units) == len(u.start) == len(u.root)
    values = u.start * 1.1 + 0.01
    assert_derivative(u, values)
    assert u.parameters(u.start) == GIVEN


@pytest.mark.parametrize(('kind', 'names'), [
    ('telescopic', ('cylinder', 'piston')), ('crank', ('reflected_inertia', 'crank', 'rod'))])
def test_efforts_under_a_turned_gravity_are_those_of_the_hexapod_with_it(
        kind: str, names: tuple[str, ...]) -> None:
    given = CASES[kind].given
    u = Unknowns(given, ('platform', 'friction', *names, 'tilt'))
    values = u.start.copy()
    values[u.asked] *= 1.1
    values[-3:-1] = 0.3, -0.5
    motion = CASES[kind].placed(rich(rng(2)))(np.arange(50) * 0.1)
    regressor = regressor_of(StewartPlatform(given), motion.rows)
    turned = u.parameters(values)
    assert turned['gravity'][2] > given['gravity'][2] + 1.0
    efforts = efforts_of(turned, motion)
    assert relative(regressor @ u.theta(values), efforts) < 1e-11
    if kind == 'telescopic':
        assert_derivative(u, values)
        # The library's columns are the first-order approximation.
        columns = regressor @ u.derivative(u.start)
        matrix = StewartPlatform(given).regressor(motion, tilt=True).matrix
        np.testing.assert_allclose(
            columns[..., -3:-1], matrix[..., -2:], rtol=1e-9, atol=1e-7)


def test_gravity_turns_about_the_axes_across_it() -> None:
    on_a_wall = GIVEN.replaced({'gravity': [0.1, -9.8, 0.3]})
    u = Unknowns(on_a_wall, ['tilt'])
    assert u.tilt.names == ('gravity.tilt_x', 'gravity.tilt_z')
    values = u.start.copy()
    values[-3:-1] = 0.02, -0.01
    turned = u.parameters(values)['gravity']
    np.testing.assert_allclose(
        turned - on_a_wall['gravity'], np.cross([0.02, 0.0, -0.01], on_a_wall['gravity']),
        atol=5e-3)


def test_an_impossible_body_becomes_the_nearest_possible_one() -> None:
    u = Unknowns(GIVEN)
    values = u.start.copy()
    values[4:10] = [1.0, 0.0, 0.0, 1.0, 0.0, 5.0]  # one moment larger than the sum of the others
    friction = u.names.index('actuator.viscous_friction.leg_3')
    values[friction] = -3.0
    found, beyond = consistent(u, values, np.diag(1e-4 * u.deviations ** 2))
    assert is_consistent(u.inertial(found))
    assert found[friction] == 0.0
    assert set(beyond) == {*u.names[:10], u.names[friction]}
    np.testing.assert_allclose(found[[0, 1, 2, 3]], values[[0, 1, 2, 3]], rtol=1e-3, atol=1e-4)
    # all three moments are changed
    assert found[4] > 1.0 and found[7] > 1.0 and found[9] < 5.0
    u.parameters(found)


def recording() -> Recorded:
    """Return a recording of 5 s without noise."""
    times = np.arange(500) / 100.0
    result = StewartPlatform(GIVEN).inverse_dynamics(fourier(3)(times))
    return Recorded(times, result.lengths - GIVEN['geometry.zero_length'], result.rates,
                    result.forces)


def test_windows_end_at_gaps(tmp_path: Path) -> None:
    given = recording()
    kept = np.r_[0:200, 260:500]
    bag = write_bag(tmp_path / 'bag', Recorded(*(each[kept] for each in given)), GIVEN['joints'])
    with closing(Recording(bag)) as read:
        topics = find_topics(read, '/stewart_dynamics', None, None)
        legs = RecordedLegs(read, topics, GIVEN['joints'], 1.0)
        windows = list(legs.windows())
    assert [len(window.positions) for window in windows] == [200, 240]
    assert legs.samples == 440
    assert legs.rates and legs.period == pytest.approx(0.01)
    as_recorded = ~windows[1].outliers
    assert as_recorded.mean() > 0.98
    np.testing.assert_allclose(windows[1].efforts[as_recorded], given.efforts[260:][as_recorded],
                               rtol=1e-9)


@pytest.mark.parametrize(('options', 'changes'), [
    (('--measured', '/other'), {}),
    (('--cutoff', '0.5'), {}),
    (('--identify', 'mass,colour'), {}),
    ((), {'base.source': 'imu'}),
    ((), {'joints': list('abcdef')}),
], ids=['topic', 'short', 'unknown', 'base', 'joints'])
def test_bad_input_is_rejected_in_one_line(
        tmp_path: Path, options: tuple[str, ...], changes: dict[str, Any],
        snapshot: Snapshot) -> None:
    bag = write_bag(tmp_path / 'bag', recording(), GIVEN['joints'])
    GIVEN.replaced(changes).to_yaml(tmp_path / 'params.yaml')
    snapshot(call(main, bag, '--params', tmp_path / 'params.yaml', '--output', tmp_path / 'found',
                  *options, code=2).err)
    assert not (tmp_path / 'found').exists()


def test_a_bag_without_measured_legs_is_rejected(snapshot: Snapshot) -> None:
    with closing(Recording(ROOT / 'bags' / 'clear')) as read, snapshot.raises(BagError):
        find_topics(read, '/stewart_dynamics', None, None)


@pytest.mark.parametrize('name', ['leg_states', 'joint_states', 'motor_states'])
def test_joint_states_of_the_node_are_not_measured_legs(
        tmp_path: Path, name: str, snapshot: Snapshot) -> None:
    topic = f'/stewart_dynamics/{name}'
    bag = write_bag(tmp_path / 'bag', recording(), GIVEN['joints'], topic)
    with closing(Recording(bag)) as read:
        with snapshot.raises(BagError):
            find_topics(read, '/stewart_dynamics', None, None)
        assert find_topics(read, '/stewart_dynamics', topic, None).legs == topic


def test_small_matrices_are_multiplied_in_one_thread() -> None:
    code = ('import os, sys, types\n'
            'from stewart_dynamics.signals import run_program\n'
            'def threads(arguments):\n'
            '    import numpy\n'
            '    return len(os.listdir("/proc/self/task"))\n'
            'sys.modules["given"] = types.SimpleNamespace(main=threads)\n'
            'raise SystemExit(run_program("program", "given", []))\n')
    environment = {name: value for name, value in os.environ.items()
                   if name != 'OPENBLAS_NUM_THREADS'}
    assert subprocess.run([sys.executable, '-c', code], env=environment, check=False,
                          ).returncode == 1
