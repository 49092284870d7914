# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The response of the platform: against drives that are known exactly, noise, and geometry."""

from __future__ import annotations

import json
import math
from pathlib import Path
import re
from typing import Any, NamedTuple

import messages
from msgspec import convert, to_builtins
import numpy as np
from numpy.typing import NDArray
from programs import call
import pytest
from referees import rng, ROOT
from response_cases import EXCITATIONS, judged, NOISES
from scipy import signal
from scipy.interpolate import CubicSpline

from stewart_dynamics import Motion, Parameters, Pose, StewartPlatform
from stewart_dynamics.mechanics.frames.rotation import (
    from_rotation_vector, to_quaternion, to_rotation_vector)
from stewart_dynamics.messages.setpoint import StampedWriter
from stewart_dynamics.reference_motion.motion_functions import motion_at, sample_times
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.replay import main
from stewart_dynamics.response.axes_response import AXES, axes_response
from stewart_dynamics.response.even_samples import Run, Runs
from stewart_dynamics.response.frequency_response import periodic_parts
from stewart_dynamics.response.response_measures import bandwidths
from stewart_dynamics.response.response_record import AxisResponse

Array = NDArray[np.float64]

PARAMS = ROOT / 'config' / 'platform.yaml'
PARAMETERS = Parameters.from_yaml(PARAMS)
PLATFORM = StewartPlatform(PARAMETERS)
CENTER = [0.0, 0.0, 1.1, 0.0, 0.0, 0.0]
MOTION = ReferenceMotionParameters({
    'rate': 50.0, 'motion.type': 'response', 'motion.initial': CENTER,
    'motion.amplitude': [0.02, 0.02, 0.015, 0.03, 0.03, 0.04], 'motion.response.period': 5.0,
    'motion.response.periods': 3.0, 'motion.response.highest_frequency': 10.0})
START = 1_700_000_000_000_000_000
LEGS, TRACKER = '/stewart_dynamics/measured_legs', '/tracker/pose'
CRANK_FILE = ROOT / 'config' / 'crank_platform.yaml'
JOINT_STATE, POSE = 'sensor_msgs/msg/JointState', 'geometry_msgs/msg/PoseStamped'


class Drive(NamedTuple):
    """A drive of second order behind a delay."""

    frequency: float = 4.0  # [Hz]
    damping: float = 0.7
    delay: float = 0.0123  # [s]

    def at(self, frequency: Any) -> NDArray[np.complex128]:
        s, w = 2j * np.pi * np.asarray(frequency), 2.0 * np.pi * self.frequency
        return np.asarray(w * w / (s * s + 2.0 * self.damping * w * s + w * w)
                          * np.exp(-s * self.delay))

    def moved(self, x: Array, rate: float) -> Array:
        """Return the output for an input (N, K) that begins and ends with zeros, exactly."""
        size = 2 * len(x)
        h = self.at(np.fft.rfftfreq(size, 1.0 / rate))
        moved: Array = np.fft.irfft(np.fft.rfft(x, size, axis=0) * h[:, None], size, axis=0)
        return moved[:len(x)]

    @property
    def late(self) -> float:
        """By how much slow motion is late [s]."""
        return self.delay + 2.0 * self.damping / (2.0 * np.pi * self.frequency)


DRIVE = Drive()


def offsets(motion: Motion) -> Array:
    """Return the axes (N, 6) of a motion about CENTER."""
    return np.hstack([motion.position - CENTER[:3], to_rotation_vector(motion.rotation)])


def poses(axes: Array) -> Pose:
    return Pose(axes[:, :3] + CENTER[:3], from_rotation_vector(axes[:, 3:]))


def write_bag(folder: Path, commanded: Motion, times: Array,
              measured: dict[str, tuple[Any, Array]],
              late: int = 0) -> Path:
    """Write setpoints, and measured messages: their writers' arguments by topic, with times."""
    def stamps(at: Array) -> NDArray[np.int64]:
        return START + np.rint(at * 1e9).astype(np.int64)

    poses, of = StampedWriter('base', 7), [*messages.setpoints(stamps(times), commanded)]
    for topic, (values, at) in measured.items():
        of += [(topic, when + late, data) for _, when, data in (
            messages.leg_states(stamps(at), PARAMETERS['joints'], values, None, None)
            if topic == LEGS else ((topic, when, poses.write(when, row)) for when, row in zip(
                stamps(at).tolist(), values.tolist(), strict=True)))]
    return messages.write_bag(folder, of)


def replayed(bag: Path, output: Path, *options: str, code: int = 0,
             params: Path = PARAMS) -> dict[str, Any]:
    call(main, bag, '--params', params, '--response', '--output', output, *options, code=code)
    found: dict[str, Any] = json.loads((output / bag.name / 'summary.json').read_text())
    return found


def check(one: dict[str, Any], drive: Drive, exactness: float = 1.0) -> None:
    """Compare a response with the truth: 0.1 dB, 0.5 degrees, 0.1 ms up to half the bandwidth."""
    f = np.array(one['frequency'])
    low = f <= 0.5 * min(one['bandwidth_3db'], one['bandwidth_90deg'])
    ratio = np.array(one['gain']) * np.exp(1j * np.radians(one['phase'])) / drive.at(f)
    assert low.sum() > 3
    assert np.abs(20.0 * np.log10(np.abs(ratio[low]))).max() < 0.1 * exactness
    assert np.abs(np.degrees(np.angle(ratio[low]))).max() < 0.5 * exactness
    assert abs(one['delay'] - drive.late) < 1e-4
    fine = np.linspace(0.1, 10.0, 100_000)
    assert one['bandwidth_3db'] == pytest.approx(
        fine[np.abs(drive.at(fine)) < math.sqrt(0.5)][0], rel=0.01)
    assert one['bandwidth_90deg'] == pytest.approx(
        fine[np.unwrap(np.angle(drive.at(fine))) < -np.pi / 2.0][0], rel=0.01)


@pytest.fixture(scope='module')
def commanded() -> tuple[Array, Motion]:
    times = sample_times(MOTION) * 1e-9
    return times, motion_at(MOTION, times)


@pytest.fixture(scope='module')
def followed(commanded: tuple[Array, Motion], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a bag of legs that follow as the drive does, and of a tracker that sees it later."""
    times, motion = commanded
    axes = DRIVE.moved(offsets(motion), MOTION['rate'])
    legs = PLATFORM.inverse_kinematics(poses(axes)) - PARAMETERS['geometry.zero_length']
    # Between the setpoints, at another rate, with its own offset.
    at = np.arange(0.003, times[-1], 1.0 / 130.0)
    spline = Drive(DRIVE.frequency, DRIVE.damping, DRIVE.delay)
    fine = spline.moved(offsets(motion_at(MOTION, np.arange(0.0, times[-1], 1e-3))), 1000.0)
    seen = np.array([np.interp(at, np.arange(len(fine)) * 1e-3, each) for each in fine.T]).T
    tracked = poses(seen)
    rows = np.hstack([tracked.position + [0.1, 0.0, 0.3], to_quaternion(tracked.rotation)])
    return write_bag(tmp_path_factory.mktemp('bags') / 'followed', motion, times,
                     {LEGS: (legs, times), TRACKER: (rows, at)})


def test_a_known_drive_is_found_from_measured_legs(followed: Path, tmp_path: Path) -> None:
    summary = replayed(followed, tmp_path)
    response = summary['response']
    assert summary['complete'] and response['topic'] == LEGS
    for name in AXES:
        check(response[name], DRIVE, exactness=1e-3)
        assert min(response[name]['coherence']) > 0.999999
        assert response[name]['noise'] < 1e-7 and response[name]['repeatability'] < 1e-8
        assert response[name]['turn_around'] < 1e-8
        assert response[name]['second_order'] == pytest.approx({
            'gain': 1.0, 'delay': DRIVE.delay, 'damping': DRIVE.damping,
            'natural_frequency': DRIVE.frequency}, rel=1e-4)
        assert set(response[name]['cross']) == set(AXES) - {name}
        assert all(each is None or each < 1e-5 for each in response[name]['cross'].values())
    for one in response['legs'].values():
        check(one, DRIVE)
    assert response['leg_balance']['phase_difference'] < 0.1
    page = (tmp_path / 'followed' / 'report.html').read_text()
    section = page.partition('<section id="response">')[2].partition('</section>')[0]
    assert section.count('<svg') == 6 + 1 + 12


def test_a_known_drive_of_cranks_is_found_from_measured_angles(
        commanded: tuple[Array, Motion], tmp_path: Path) -> None:
    """The axes follow as the drive does, with angles that are as linear as the travel is small."""
    rig = StewartPlatform.from_yaml(CRANK_FILE)
    home = rig.home_pose()
    times, about = commanded
    axes = offsets(about)
    setpoints = Motion(
        home.position + axes[:, :3], about.rotation, *np.split(about.rows[:, 12:], 4, axis=1))
    moved = DRIVE.moved(axes, MOTION['rate'])
    achieved = Pose(home.position + moved[:, :3], from_rotation_vector(moved[:, 3:]))
    angles = rig.inverse_kinematics(achieved)
    lost = np.arange(1000, 1010)
    angles[lost] = np.array([3.0, -3.0] * 3) + 1e-3 * rng(1).normal(size=(len(lost), 6))  # no pose
    bag = write_bag(tmp_path / 'followed', setpoints, times, {LEGS: (angles, times)})
    summary = replayed(bag, tmp_path / 'results', params=CRANK_FILE)
    response = summary['response']
    assert summary['complete'] and response['topic'] == LEGS
    assert [(each['reason'], each['count']) for each in summary['rejected']] == [
        ('no pose has these angles', len(lost))]
    for name in AXES:
        check(response[name], DRIVE)
        assert response[name]['second_order'] == pytest.approx({
            'gain': 1.0, 'delay': DRIVE.delay, 'damping': DRIVE.damping,
            'natural_frequency': DRIVE.frequency}, rel=0.01)
    assert list(response['legs']) == list(rig.parameters.joints)
    for one in response['legs'].values():
        check(one, DRIVE)
    assert response['leg_balance']['phase_difference'] < 0.1
    page = (tmp_path / 'results' / 'followed' / 'report.html').read_text()
    section = page.partition('<section id="response">')[2].partition('</section>')[0]
    assert section.count('<svg') == 6 + 1 + 12
    check_words_of_cranks(page, summary)


def check_words_of_cranks(page: str, summary: dict[str, Any]) -> None:
    """Check names, units and digits in the report of a hexapod with cranks."""
    used = page.partition('<section id="parameters">')[2].partition('</section>')[0]
    rows = {re.sub('<.*?>', '', name): unit for name, unit in re.findall(
        r'<tr><th scope="row">(.*?)</th>.*?<td>([^<]*)</td></tr>', used)}
    assert rows['actuator.viscous_friction'] == 'N m s/rad'
    assert rows['actuator.coulomb_friction'] == 'N m'
    assert rows['limits.angle_max'] == 'rad'
    assert not [name for name in rows if 'cylinder' in name or 'length_m' in name]
    plots = set(re.findall(r'"title": ?"([^"]*)"', page))
    assert {'Crank angles', 'Crank levers', 'Crank torques'} <= plots
    text = re.sub('<.*?>', '', page.partition('<section id="peaks">')[2].partition(
        '<section id="plots">')[0])
    assert 'torques: + drives the angle up, powers: + drives.' in text
    assert 'reflected inertia of the actuators' in text and 'screw' not in text
    # Four digits of the largest torque, above 100 N m.
    peak = max(abs(each['torque_peak_n_m']) for each in summary['legs'].values())
    assert 100.0 < peak < 1000.0
    assert f'{peak:.1f}' in text and f'{peak:.2f}' not in text


def test_a_known_drive_is_found_from_measured_poses(followed: Path, tmp_path: Path) -> None:
    response = replayed(followed, tmp_path, '--measured-pose', TRACKER, '--no-report')['response']
    assert response['topic'] == TRACKER and response['legs'] == {}
    for name in AXES:
        check(response[name], DRIVE)


def table_of(path: Path, rows: Array, times: Array) -> Path:
    """Write achieved poses as a table, whose frames of half a second are lost."""
    lines = ['Time (Seconds),x (mm),y (mm),z (mm),qx,qy,qz,qw']
    scaled = np.hstack([1e3 * rows[:, :3], rows[:, 3:]])
    for time, row in zip(times.tolist(), scaled.tolist(), strict=True):
        lost = 20.0 < time - times[0] < 20.5
        lines.append(','.join([f'{time:.6f}', *([''] * 7 if lost else map(repr, row))]))
    path.write_text('\n'.join(lines))
    return path


def seen_by_a_tracker(motion: Motion) -> tuple[Array, Array]:
    """Return times [s] and achieved poses (N, 7) of the drive, exactly."""
    end = sample_times(MOTION)[-1] * 1e-9
    fine = DRIVE.moved(offsets(motion_at(MOTION, np.arange(0.0, end, 1e-3))), 1000.0)
    tracked = poses(fine[::8])
    return np.arange(0.0, end, 1e-3)[::8], np.hstack([
        tracked.position + [0.1, 0.0, 0.3], to_quaternion(tracked.rotation)])


@pytest.mark.slow
def test_a_known_drive_is_found_from_a_table_of_a_tracker(
        commanded: tuple[Array, Motion], tmp_path: Path) -> None:
    times, motion = commanded
    at, rows = seen_by_a_tracker(motion)
    bag = write_bag(tmp_path / 'moved', motion, times, {})
    # Its clock is the one of the setpoints.
    table = table_of(tmp_path / 'tracker.csv', rows, START * 1e-9 + at)
    summary = replayed(bag, tmp_path / 'same', '--measured-pose', str(table), '--no-report')
    assert summary['complete'] and summary['response']['topic'] == str(table)
    for name in AXES:
        check(summary['response'][name], DRIVE)
    # Another clock: gains are known, delays are not.
    table_of(tmp_path / 'tracker.csv', rows, 77.0 + at)
    other = replayed(bag, tmp_path / 'other', '--measured-pose', str(table), '--no-report')
    assert any('has another clock' in notice for notice in other['notices'])
    for name in AXES:
        one = other['response'][name]
        assert one['delay'] is None
        assert one['bandwidth_3db'] == pytest.approx(
            summary['response'][name]['bandwidth_3db'], rel=0.01)


@pytest.mark.slow
def test_achieved_poses_in_another_unit_are_named(
        commanded: tuple[Array, Motion], tmp_path: Path) -> None:
    times, motion = commanded
    at, rows = seen_by_a_tracker(motion)
    bag = write_bag(tmp_path / 'moved', motion, times, {})
    table = table_of(tmp_path / 'tracker.csv', rows, START * 1e-9 + at)
    table.write_text(table.read_text().replace(' (mm)', ''))
    summary = replayed(bag, tmp_path / 'same', '--measured-pose', str(table), '--no-report')
    (notice,) = [each for each in summary['notices'] if 'unit' in each]
    assert notice.startswith(f'{table}: slow motion of x, y, z is 1e+03 times that of the setpoi')
    assert notice.endswith(': likely another unit of lengths in m')


@pytest.mark.slow
def test_setpoints_and_achieved_poses_in_tables_share_a_clock(
        commanded: tuple[Array, Motion], tmp_path: Path) -> None:
    times, motion = commanded
    at, rows = seen_by_a_tracker(motion)
    for begin, name in ((0.0, 'zero'), (3.0, 'later')):
        given = np.column_stack([begin + times, motion.position, to_quaternion(motion.rotation),
                                 motion.rows[:, 12:]])
        path = tmp_path / f'{name}.csv'
        np.savetxt(path, given, '%.12g', ',', comments='', header='t,x,y,z,qx,qy,qz,qw,vx,vy,vz,'
                   'wx,wy,wz,ax,ay,az,alx,aly,alz')
        table = table_of(tmp_path / f'{name}.txt', rows[40:], begin + at[40:])
        call(main, path, '--params', PARAMS, '--response', '--measured-pose', table, '--output',
             tmp_path / 'r', '--no-report')
        found = json.loads((tmp_path / 'r' / name / 'summary.json').read_text())['response']
        for axis in AXES:
            assert abs(found[axis]['delay'] - DRIVE.late) < 1e-4


def test_another_motion_is_not_aligned(
        commanded: tuple[Array, Motion], tmp_path: Path) -> None:
    times, motion = commanded
    at, rows = seen_by_a_tracker(motion)
    rows[:, :3] = np.random.default_rng(1).normal(size=(len(rows), 3))
    bag = write_bag(tmp_path / 'moved', motion, times, {})
    table = table_of(tmp_path / 'tracker.tsv', rows, at)
    summary = replayed(bag, tmp_path / 'r', '--measured-pose', str(table), '--no-report', code=3)
    assert 'and another motion' in summary['missing'][0]


def test_legs_without_efforts_are_compared_only_by_position(
        followed: Path, tmp_path: Path) -> None:
    summary = replayed(followed, tmp_path, '--measured', LEGS, '--no-report')
    assert summary['measured'] is None and summary['complete'] and not summary['rejected']
    assert summary['response']['x']['delay'] == pytest.approx(DRIVE.late, abs=1e-4)


@pytest.mark.parametrize('options', [
    ['--measured-pose', TRACKER], ['--response', '--measured', LEGS, '--measured-pose', TRACKER]])
def test_options_that_do_not_fit_are_rejected(
        options: list[str], followed: Path, tmp_path: Path) -> None:
    call(main, followed, '--params', PARAMS, '--output', tmp_path, *options, code=2)


def test_clocks_that_differ_are_said(
        commanded: tuple[Array, Motion], tmp_path: Path) -> None:
    times, motion = (each[:2000] for each in commanded)
    legs = PLATFORM.inverse_kinematics(Pose(motion.position, motion.rotation))
    legs = legs - PARAMETERS['geometry.zero_length']
    early = write_bag(tmp_path / 'early', motion, times, {LEGS: (legs, times - 0.1)}, 100_000_000)
    summary = replayed(early, tmp_path / 'out', '--no-report')
    assert summary['response']['x']['delay'] == pytest.approx(-0.1, abs=1e-4)
    assert any('if clocks differ by these 100 ms' in each for each in summary['notices'])
    assert any('100 ms earlier than the setpoints' in each for each in summary['notices'])
    apart = write_bag(tmp_path / 'apart', motion, times, {LEGS: (legs, times - 500.0)},
                      500_000_000_000)
    summary = replayed(apart, tmp_path / 'out', '--no-report', code=3)
    assert summary['response'] is None
    assert 'do not overlap; by the times of recording, their clocks differ by -500 s' in (
        summary['missing'][0])


def test_clocks_that_drift_are_said(periodic: tuple[Array, Array]) -> None:
    x, _ = periodic
    rate = MOTION['rate']
    times = np.arange(len(x)) / rate
    for drift in (2e-4, -5e-5):
        y = CubicSpline(times, x)(times - 0.02 - drift * times)
        noise = 1e-5 * rng(1).normal(size=x.shape)
        assert axes_of(x, y + noise, rate)['clock_drift'] == pytest.approx(drift, rel=0.05)
    for seed in range(5):
        still = x + 1e-4 * rng(seed).normal(size=x.shape)
        assert axes_of(x, still, rate)['clock_drift'] is None


def axes_of(commanded: Array, achieved: Array, rate: float) -> dict[str, Any]:
    run = Run(np.arange(len(commanded)) / rate, commanded, achieved,
              np.zeros(len(commanded), dtype=bool))
    found: dict[str, Any] = to_builtins(axes_response(Runs([run], rate, 0.45 * rate), 0.3))
    return found


@pytest.fixture(scope='module')
def periodic(commanded: tuple[Array, Motion]) -> tuple[Array, Array]:
    """Return commanded and achieved axes of the motion, without noise."""
    x = offsets(commanded[1])
    return x, DRIVE.moved(x, MOTION['rate'])


def test_coherence_band_and_noise_are_those_of_theory(periodic: tuple[Array, Array]) -> None:
    x, y = periodic
    sigma, rate, period = 2e-4, MOTION['rate'], 250
    inside, coherences, expected, noises = [], [], [], []
    for seed in range(20):
        found = axes_of(x, y + sigma * rng(seed).normal(size=y.shape), rate)
        for axis, name in enumerate(AXES):
            one = found[name]
            f = np.array(one['frequency'])
            part, = (each for each in periodic_parts(x[:, [axis]], rate)[:1])
            lines = np.fft.rfft(x[part.begin:part.begin + period, axis])[
                np.rint(f * period / rate).astype(int)]
            power = 2.0 * np.abs(lines * DRIVE.at(f)) ** 2 / (rate * period)
            density = 2.0 * sigma ** 2 / rate
            expected.append(power / (power + density))
            coherences.append(one['coherence'])
            value = np.array(one['gain']) * np.exp(1j * np.radians(one['phase']))
            radius = np.array(one['gain_high']) - np.array(one['gain'])
            inside.append(np.abs(value - DRIVE.at(f)) <= radius)
            noises.append(one['noise'])
    assert np.mean(noises) == pytest.approx(sigma, rel=0.02)
    share = np.mean(inside)
    count = np.size(inside)
    # Noise of neighboring frequencies is shared: a tenth as many are independent.
    assert abs(share - 0.95) < 4.0 * math.sqrt(0.95 * 0.05 / (0.1 * count))
    assert np.min(expected) < 0.9
    np.testing.assert_allclose(np.mean(coherences, axis=0), np.mean(expected, axis=0), atol=0.02)


def test_cross_terms_are_lost_in_noise_or_those_that_are_there(
        periodic: tuple[Array, Array]) -> None:
    x, y = periodic
    coupled = y + 2e-5 * rng(3).normal(size=y.shape)
    coupled[:, 1] += 0.05 * y[:, 0]
    found = axes_of(x, coupled, MOTION['rate'])
    gains = np.abs(DRIVE.at(np.array(found['x']['frequency'])))
    assert found['x']['cross'].pop('y') == pytest.approx(0.05 * gains.max(), rel=0.05)
    assert all(each is None for name in AXES for each in found[name]['cross'].values())


def test_cross_terms_of_a_wrong_geometry_are_as_predicted(
        commanded: tuple[Array, Motion]) -> None:
    wrong = rng(5).normal(scale=0.01, size=18)
    true = StewartPlatform(PARAMETERS.replaced({'geometry.platform_joints': (
        PARAMETERS['geometry.platform_joints'].ravel() + wrong).tolist()}))
    center = poses(np.zeros((1, 6)))[0]
    offset = PLATFORM.forward_kinematics(true.inverse_kinematics(center), center)
    predicted = np.linalg.solve(
        PLATFORM.inverse_jacobian(offset), true.inverse_jacobian(center))
    x = 0.01 * offsets(commanded[1])
    lengths = true.inverse_kinematics(poses(x))
    seen = PLATFORM.forward_kinematics(lengths, poses(x))
    turns = seen.rotation @ seen.rotation[0].T
    found = axes_of(x, np.hstack([seen.position, to_rotation_vector(turns)]), MOTION['rate'])
    for axis, name in enumerate(AXES):
        assert np.array(found[name]['gain']) == pytest.approx(predicted[axis, axis], rel=1e-3)
        for other, gain in found[name]['cross'].items():
            assert (gain or 0.0) == pytest.approx(
                abs(predicted[AXES.index(other), axis]), rel=0.01, abs=2e-4)
    assert max(abs(predicted - np.diag(np.diag(predicted))).ravel()) > 0.02


def test_axes_that_move_at_the_same_time_are_separated() -> None:
    rate, count = 50.0, 20_000
    white = signal.lfilter(*signal.butter(2, 0.3), rng(1).normal(size=(count, 6)), axis=0)
    x = 0.01 * white * np.clip(np.minimum(np.arange(count), count - np.arange(count) - 2000)
                               / 500.0, 0.0, 1.0)[:, None]
    y = DRIVE.moved(x, rate)
    y[:, 2] += 0.2 * y[:, 3]
    found = axes_of(x, y, rate)
    for name in AXES:
        one = found[name]
        f = np.array(one['frequency'])
        low = (f >= 0.2) & (f <= 0.5 * one['bandwidth_90deg'])
        ratio = np.array(one['gain']) * np.exp(1j * np.radians(one['phase'])) / DRIVE.at(f)
        assert np.abs(20.0 * np.log10(np.abs(ratio[low]))).max() < 0.1
        assert np.abs(np.degrees(np.angle(ratio[low]))).max() < 0.5
        assert one['delay'] == pytest.approx(DRIVE.late, abs=3e-4)
    assert found['rx']['cross']['z'] == pytest.approx(0.2, rel=0.1)
    assert (found['x']['cross']['z'] or 0.0) < 0.02


def test_what_is_not_excited_is_not_stated() -> None:
    rate = 50.0
    t = np.arange(5000) / rate
    x = np.zeros((len(t), 6))
    x[:, 0] = 0.01 * np.sin(2.0 * np.pi * 0.5 * t)
    late = 0.01 * np.sin(2.0 * np.pi * 0.5 * (t - 0.02))
    found = axes_of(x, np.column_stack([late, x[:, 1:]]), rate)
    assert found['x']['frequency'] == pytest.approx([0.5])
    assert found['x']['delay'] == pytest.approx(0.02, abs=1e-6)
    assert found['x']['bandwidth_3db'] is None and found['x']['second_order'] is None
    for name in AXES[1:]:
        assert len(found[name]['frequency']) == 0 and found[name]['reason'] == 'not excited'
    x[:, 4] = x[:, 0]
    found = axes_of(x, x, rate)
    assert found['x']['reason'] == found['ry']['reason'] == (
        'not separable: x and ry were moved alike')
    still = axes_of(np.zeros((500, 6)), np.zeros((500, 6)), rate)
    assert all(still[name]['reason'] == 'not excited' for name in AXES)


@pytest.mark.parametrize(('drive', 'low', 'high', 'said'), [
    (Drive(0.05, 0.7, 0.0), None, 0.2, 'below 0.2 Hz'),
    (Drive(50.0, 0.7, 0.0), 10.0, None, 'above 10 Hz')])
def test_a_bandwidth_outside_of_the_frequencies_is_said_to_be_there(
        drive: Drive, low: float | None, high: float | None, said: str,
        periodic: tuple[Array, Array]) -> None:
    rate = MOTION['rate']
    found = axes_of(periodic[0], drive.moved(periodic[0], rate), rate)
    for name in AXES:
        for key in ('bandwidth_3db', 'bandwidth_90deg'):
            assert found[name][key] is None
            assert found[name][f'{key}_bounds'] == pytest.approx((low, high))
        assert [*bandwidths(convert(found[name], AxisResponse)).values()] == [said, said]
    assert (found['x']['delay'] is None) == (low is None)


def test_a_step_is_late_by_its_delay() -> None:
    x = np.where(np.arange(3000)[:, None] > 1500, 0.01, 0.0) * np.eye(6)[0]
    found = axes_of(x, np.roll(x, 2, axis=0), 50.0)['x']
    assert found['delay'] == pytest.approx(0.04, abs=1e-4)


def test_an_axis_that_moves_the_other_way_has_no_delay(periodic: tuple[Array, Array]) -> None:
    x, y = periodic
    found = axes_of(x, y * [1.0, -1.0, 1.0, 1.0, 1.0, 1.0], MOTION['rate'])
    assert found['y']['opposite'] and found['y']['delay'] is None
    assert not found['x']['opposite']
    assert found['x']['delay'] == pytest.approx(DRIVE.late, abs=1e-4)


@pytest.mark.parametrize('count', [64, 100, 200])
def test_a_recording_that_is_too_short_is_said(count: int) -> None:
    x = rng(1).normal(size=(count, 6))
    found = axes_of(x, x, 50.0)
    assert {found[name]['reason'] for name in AXES} == {'the recording is too short'}


def test_a_platform_that_does_not_follow_has_no_delay(periodic: tuple[Array, Array]) -> None:
    still = 0.0 * periodic[0]
    for achieved in (still, still + 0.3, *(
            1e-3 * rng(seed).normal(size=still.shape) for seed in range(10))):
        found = axes_of(periodic[0], achieved, MOTION['rate'])
        assert all(found[name]['delay'] is None for name in AXES)
        assert {found[name]['reason'] for name in AXES} == {'not coherent with its setpoints'}


def test_a_platform_that_follows_at_once_has_no_delay(periodic: tuple[Array, Array]) -> None:
    found = axes_of(periodic[0], periodic[0], MOTION['rate'])
    for name in AXES:
        assert found[name]['delay'] == pytest.approx(0.0, abs=1e-9)
        np.testing.assert_allclose(found[name]['gain'], 1.0, atol=1e-9)
        assert found[name]['bandwidth_3db'] is found[name]['bandwidth_90deg'] is None


@pytest.mark.slow
@pytest.mark.parametrize('kind', EXCITATIONS)
def test_bands_contain_the_truth(kind: str) -> None:
    found = [judged(kind, axes, noise, seed) for noise in NOISES
             for axes, seed in ((1, 1), (1, 2), (2, 1), (3, 1))]
    inside = [each for one in found for each in one.own]
    # Estimates at neighboring frequencies share their noise: about ten of an axis are independent.
    independent = min(len(inside), 10 * sum(one.stated for one in found))
    assert np.mean(inside) > 0.95 - 4.0 * math.sqrt(0.95 * 0.05 / independent)
    assert sum(one.stated for one in found) >= 16
    bandwidths = np.array([each for one in found for each in one.bandwidths])
    delays = [each for one in found for each in one.delays]
    assert np.abs(bandwidths - 1.0).max() < 0.1 and np.abs(delays).max() < 2e-3


def test_axes_that_move_alike_are_not_stated() -> None:
    rate = 50.0
    white = signal.lfilter(*signal.butter(2, 0.3), rng(1).normal(size=4000))
    x = 0.01 * white[:, None] * [1.0, 0.0, 0.5, 1.0, 0.0, 0.0]
    x[:, 2] += 0.01 * signal.lfilter(*signal.butter(2, 0.3), rng(2).normal(size=4000))
    found = axes_of(x, DRIVE.moved(x, rate), rate)
    for name in ('x', 'rx'):
        assert found[name]['reason'] == 'not separable: x and rx were moved alike'
        assert not len(found[name]['frequency']) and found[name]['delay'] is None
    assert found['z']['delay'] == pytest.approx(DRIVE.late, abs=1e-3)


@pytest.mark.parametrize('how', ['missing', 'frozen'])
def test_poses_that_a_tracker_loses_are_left_out(how: str, tmp_path: Path) -> None:
    rate, count = 50.0, 3000
    x = np.zeros((count, 6))
    white = signal.lfilter(*signal.butter(2, 0.2), rng(1).normal(size=count))
    x[:, 0] = 0.01 * white * np.clip(np.arange(count) / 100.0, 0.0, 1.0)
    y = DRIVE.moved(x, rate)
    times = np.arange(count) / rate
    kept: NDArray[np.bool_] = np.arange(count) % 150 >= 15
    seen = y if how == 'missing' else y[np.maximum.accumulate(
        np.where(kept, np.arange(count), 0))]
    tracked = poses(seen)
    rows = np.hstack([tracked.position, to_quaternion(tracked.rotation)])
    if how == 'missing':
        rows, at = rows[kept], times[kept]
    else:
        at = times
    motion = Motion(poses(x).position, poses(x).rotation, *np.zeros((4, count, 3)))
    bag = write_bag(tmp_path / 'lost', motion, times, {TRACKER: (rows, at)})
    summary = replayed(bag, tmp_path / 'out', '--measured-pose', TRACKER, '--no-report')
    one = summary['response']['x']
    f = np.array(one['frequency'])
    value = np.array(one['gain']) * np.exp(1j * np.radians(one['phase']))
    low = f < 5.0
    assert low.sum() > 20
    assert np.abs(value - DRIVE.at(f))[low].max() < 5e-3
    assert one['delay'] == pytest.approx(DRIVE.late, abs=5e-4)
    assert any('repeat the one before' in each for each in summary['notices']) == (
        how == 'frozen')
