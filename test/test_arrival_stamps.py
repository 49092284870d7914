# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Stamps of arrival are found in readings, and no others are: lost, uneven, noisy, at rest."""

from __future__ import annotations

import json
from pathlib import Path

import messages
import numpy as np
import pytest
from referees import rng, ROOT, symmetric_parameters

from stewart_dynamics.arrays import Array, Stamps
from stewart_dynamics.replay.replay_command_line import main as replay
from stewart_dynamics.setpoints.arrival_stamps import ArrivalStamps
from stewart_dynamics.setpoints.input_messages import BASE_IMU, BASE_POSE

BEGIN = messages.NOW
RATES = (50.0, 100.0, 200.0, 1000.0)


def readings(rate: float, noise: float = 0.0, seconds: float = 6.0) -> tuple[Array, Array]:
    """Return even times (N,) [s] and readings of six legs (N, 6) [m]."""
    t = np.arange(0.0, seconds, 1.0 / rate)
    w = 2.0 * np.pi * np.array([0.3, 0.4, 0.5, 0.35, 0.45, 0.55])
    return t, 0.05 * np.sin(w * t[:, None]) + noise * rng(1).normal(size=(len(t), 6))


def in_bursts(times: Array, size: int) -> Stamps:
    """Return stamps [ns] of messages that wait until there are ``size`` of them."""
    n = np.arange(len(times))
    last = np.minimum(n - n % size + size - 1, len(times) - 1)
    return stamps_of(times[last] + n % size * 1e-5)


def stamps_of(times: Array) -> Stamps:
    return BEGIN + np.rint(times * 1e9).astype(np.int64)


def found(stamps: Stamps, values: Array) -> str:
    """Return the error that is found, in many readings and in one after the other."""
    one, many = ArrivalStamps(), ArrivalStamps()
    for stamp, value in zip(stamps.tolist(), values.tolist(), strict=True):
        one.add_readings([stamp], [value])
    for part in np.array_split(np.arange(len(stamps)), 7):
        many.add_readings(stamps[part], values[part])
    assert one.found == many.found and one.present == many.present
    return one.found[0] if one.found else ''


@pytest.mark.parametrize('rate', RATES)
@pytest.mark.parametrize('noise', [0.0, 1e-5])
def test_bursts_are_found(rate: float, noise: float) -> None:
    t, values = readings(rate, noise)
    for milliseconds in (10.0, 20.0, 80.0):
        size = max(2, round(milliseconds * 1e-3 * rate))
        words = found(in_bursts(t, size), values)
        off = 1e3 / rate * np.sqrt((size ** 2 - 1) / 12.0)
        assert 'stamps of arrival, in bursts?' in words
        assert float(words.split('off by ')[1].split(' ms')[0]) == pytest.approx(off, rel=0.1)


@pytest.mark.parametrize('rate', RATES)
def test_other_uneven_stamps_are_no_possible_error(rate: float) -> None:
    random = rng(2)
    for noise in (0.0, 1e-5, 1e-3):
        t, values = readings(rate, noise)
        n = np.arange(len(t))
        streams = {
            'even': np.ones(len(t), dtype=bool), 'lost in groups': n % 20 < 8,
            'lost at random': random.uniform(size=len(t)) < 0.6,
            'every second pair': n % 4 < 2}
        for name, kept in streams.items():
            assert not found(stamps_of(t[kept]), values[kept]), (name, noise)
        uneven = np.sort(random.uniform(0.0, 6.0, len(t)))
        w = 2.0 * np.pi * np.array([0.3, 0.4])
        assert not found(stamps_of(uneven), np.sin(w * uneven[:, None]))
        # a clock that runs faster and faster, and jitter of a tenth of the period
        late = np.sort(t + 0.02 * t ** 2 + random.uniform(-0.05, 0.05, len(t)) / rate)
        assert not found(stamps_of(late), values), noise
    # noise alone, and readings that stand still, show nothing
    noise_alone = random.normal(size=(len(t), 6))
    assert not found(in_bursts(t, 4), noise_alone)
    assert not found(in_bursts(t, 4), np.ones((len(t), 6)) / 3.0)
    assert not found(in_bursts(t, 4), np.full((len(t), 6), 1e200) * noise_alone)


def test_the_possible_error_is_present_until_readings_show_that_it_has_ended() -> None:
    t, values = readings(100.0)
    check = ArrivalStamps()
    bursts, third = in_bursts(t, 4), len(t) // 3
    check.add_readings(bursts[:third], values[:third])
    assert check.present is not None and check.present == check.found
    assert check.present[1] < int(bursts[third])
    check.add_readings(bursts[third:2 * third], np.ones((third, 6)))  # at rest
    assert check.present is not None
    check.add_readings(stamps_of(t[2 * third:]), values[2 * third:])
    assert check.present is None and check.found is not None


@pytest.mark.parametrize('source', ['imu', 'pose'])
@pytest.mark.parametrize('size', [1, 4])
def test_stamps_of_an_imu_and_of_a_tracker_on_the_base_are_checked(source: str, size: int) -> None:
    feed = messages.Feed(symmetric_parameters().replaced({'base.source': source}))
    t, _ = readings(100.0)
    roll, rate = 0.2 * np.sin(2.0 * t), 0.4 * np.cos(2.0 * t)
    for n, stamp in enumerate(in_bursts(t, size).tolist()):
        if source == 'imu':
            feed(BASE_IMU, messages.imu(stamp, [rate[n], 0.0, 0.0], [
                0.0, 9.80665 * np.sin(roll[n]), 9.80665 * np.cos(roll[n])]))
        else:
            feed(BASE_POSE, messages.pose(stamp, quaternion=[
                np.sin(roll[n] / 2.0), 0.0, 0.0, np.cos(roll[n] / 2.0)], frame='world'))
    said = [each.words for each in feed.setpoints.possible_errors(ever=True)]
    assert len(said) == (size > 1)
    begin = f'base/{source}: possible error: stamps of arrival'
    assert all(each.startswith(begin) for each in said)
    assert len(feed.setpoints.possible_errors()) == len(said)


@pytest.mark.parametrize('size', [1, 4])
def test_stamps_of_poses_that_are_differentiated_are_checked(size: int, tmp_path: Path) -> None:
    t, _ = readings(100.0)
    times = (in_bursts(t, size) - BEGIN) * 1e-9
    path = tmp_path / 'tracker.csv'
    path.write_text('t,x,y,z\n' + ''.join(
        f'{1.0 + time:.6f},{0.05 * np.sin(2.0 * each)},0,1.1\n'
        for time, each in zip(times, t, strict=True)))
    parameters = str(ROOT / 'config' / 'platform.yaml')
    code = replay([str(path), '--params', parameters, '--output', str(tmp_path / 'r'),
                   '--no-report', '--differentiate', '--strict'])
    assert code == (size > 1)
    summary = json.loads((tmp_path / 'r' / 'tracker' / 'summary.json').read_text())
    assert [each['topic'] for each in summary['mistakes']] == ['setpoint/pose'] * (size > 1)
