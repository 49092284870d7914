# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Loads of motors in summary and report: against the library's motors, sums and another grid."""

from __future__ import annotations

import csv
from pathlib import Path
import re
from typing import Any

from bag_summaries import bag_summary, motion_of
import numpy as np
import pytest
from recorded import fourier
from referees import Array, rng, ROOT
from scipy.integrate import trapezoid

from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.mechanics.drives.heat import temperature_rises
from stewart_dynamics.mechanics.drives.motors import (
    BREAKAWAY_TORQUES, MOTORS, Motors, SPEEDS)
from stewart_dynamics.mechanics.limits import OF_LEGS
from stewart_dynamics.replay.bag_summary import MotorLoads
from stewart_dynamics.replay.index import row_of, write_fleet
from stewart_dynamics.replay.motor_charts import Deliverable, motor_charts, OperatingPoints
from stewart_dynamics.replay.motor_loads import MARGIN, needed_motor
from stewart_dynamics.replay.statements import Card, cards, motion_statements
from stewart_dynamics.replay.summary import Answered, powers_of, Summary
from stewart_dynamics.setpoints.base_wrench_step import BaseWrench
from stewart_dynamics.setpoints.step import Batch, FIRST, Step
from stewart_dynamics.whole_file import to_json

DRIVES = {
    'actuator.reflected_mass': None, 'actuator.screw_lead': 0.01, 'drive.motor_inertia': 5e-5,
    'drive.efficiency': 0.85, 'drive.torque_max': 2.2, 'drive.torque_continuous': 0.9,
    'drive.speed_max': 450.0, 'drive.torque_speed': [0.0, 3.5, 250.0, 3.5, 800.0, 0.4],
    'drive.torque_constant': 0.35, 'drive.resistance': 1.5, 'drive.thermal_resistance': 0.9,
    'limits.velocity_max': None, 'drive.thermal_time_constant': 90.0,
    'drive.temperature_rise_max': 1.0}
P = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml').replaced(DRIVES)
SECOND = 1_000_000_000
TIMES: Array = np.arange(0.0, 8.0, 0.005)


def setpoints(motion: Motion, times: Array) -> Batch:
    """Return the setpoints of a motion."""
    return Batch.from_parts(np.round((1.0 + times) * SECOND), motion.rows)


def summary_of(p: Parameters, motion: Motion, times: Array, edges: list[int],
               quasi_static: bool = False) -> dict[str, Any]:
    """Return the summary of a motion that is given in blocks."""
    summary, step, base = Summary(p, quasi_static), Step(p), BaseWrench(p)
    state = FIRST
    for first, end in zip([0, *edges], [*edges, len(times)], strict=True):
        block = setpoints(motion, times).chosen(slice(first, end))
        outputs = step(block, state)
        state = outputs.state
        summary.add_block(Answered(times[first:end], block, outputs, base(block),
                                   powers_of(StewartPlatform(p), block, outputs)))
    to_json(summary.values())
    return motion_of(summary)


def test_loads_are_those_of_the_motors_of_the_library() -> None:
    motion = fourier(3, base=0.25, harmonics=6, size=0.9)(TIMES)
    found = summary_of(P, motion, TIMES, [1, 700, 701])
    motors = StewartPlatform(P).motors(motion)
    power = motors.power.sum(axis=1)
    rises = temperature_rises(P, TIMES, motors.copper_heat)
    for leg, load in enumerate(found['motors']['legs'].values()):
        torque, speed = motors.torques[:, leg], motors.speeds[:, leg]
        peak = int(np.abs(motors.breakaway_torques[:, leg]).argmax())
        rms = np.sqrt(trapezoid(torque ** 2, TIMES) / TIMES[-1])
        assert load == pytest.approx({
            'torque_peak_n_m': motors.breakaway_torques[peak, leg],
            'torque_peak_at_s': TIMES[peak], 'torque_rms_n_m': rms,
            'torque_margin_n_m': motors.margins[:, leg].min(),
            'torque_margin_at_s': TIMES[motors.margins[:, leg].argmin()],
            'torque_continuous_margin_n_m': 0.9 - rms,
            'speed_peak_rad_s': speed[np.abs(speed).argmax()],
            'speed_peak_at_s': TIMES[np.abs(speed).argmax()],
            'speed_mean_rad_s': trapezoid(np.abs(speed), TIMES) / TIMES[-1],
            'speed_margin_rad_s': 450.0 - np.abs(speed).max(),
            'current_peak_a': motors.currents[np.abs(torque).argmax(), leg],
            'current_rms_a': rms / 0.35,
            'temperature_rise_max_k': rises[:, leg].max(),
            'temperature_rise_max_at_s': TIMES[rises[:, leg].argmax()],
            'temperature_rise_steady_k':
                0.9 * trapezoid(motors.copper_heat[:, leg], TIMES) / TIMES[-1],
            'temperature_rise_margin_k': 1.0 - rises[:, leg].max()}, rel=1e-9)
    drawn, back = (trapezoid(np.maximum(sign * power, 0.0), TIMES) for sign in (1.0, -1.0))
    assert found['motors']['bus'] == pytest.approx({
        'power_peak_w': power.max(), 'power_peak_at_s': TIMES[power.argmax()],
        'regenerated_peak_w': -power.min(), 'regenerated_peak_at_s': TIMES[power.argmin()],
        'power_mean_w': trapezoid(power, TIMES) / TIMES[-1], 'energy_drawn_j': drawn,
        'energy_regenerated_j': back, 'cycles': 1, 'energy_per_cycle_j': drawn - back}, rel=1e-9)
    assert back > 0.0
    documented = (ROOT / 'docs' / 'summary.md').read_text(encoding='utf-8')
    for part in (*found['motors']['legs'].values(), found['motors']['bus'],
                 found['motors']['needed']):
        assert all(f'.{key}`' in documented for key in part)
    legs = found['motors']['legs'].values()
    assert found['motors']['needed'] == {'margin': MARGIN} | {
        key: pytest.approx(MARGIN * max(abs(leg[of]) for leg in legs)) for key, of in (
            ('torque_continuous_n_m', 'torque_rms_n_m'), ('torque_peak_n_m', 'torque_peak_n_m'),
            ('speed_rad_s', 'speed_peak_rad_s'))}
    # each limit is counted by its own definition
    torque, speed = np.abs(motors.breakaway_torques), np.abs(motors.speeds)
    curve = np.where(speed > 800.0, 0.0, np.interp(speed, [250.0, 800.0], [3.5, 0.4]))
    counts = {'drive.torque_max': torque > 2.2,
              'drive.torque_speed': (torque > curve) & (curve < 2.2),
              'drive.speed_max': speed > 450.0, 'drive.temperature_rise_max': rises > 1.0}
    for limit, exceeding in counts.items():
        entries = [each for each in found['limits'] if each['limit'] == limit]
        assert [each['setpoints'] for each in entries] == [
            count for count in exceeding.sum(axis=0).tolist() if count]
    assert {each['limit'] for each in found['limits']} > {'drive.torque_max', 'drive.speed_max'}
    lines = [each.line for each in motion_statements(bag_summary(found))]
    assert any(line.startswith('drive.torque_continuous, exceeded by') for line in lines)
    assert any('motor needed: ' in line and 'margin of 20 %' in line for line in lines)


def test_without_drives_there_are_no_motors_and_without_velocities_no_speeds() -> None:
    motion = fourier(3, size=0.5)(TIMES[:20])
    plain = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
    assert summary_of(plain, motion, TIMES[:20], [])['motors'] is None
    still = Motion(motion.position, motion.rotation)
    found = summary_of(P, still, TIMES[:20], [], quasi_static=True)
    assert found['limits_not_checked'] == ['drive.torque_speed', 'drive.speed_max']
    assert found['motors']['bus'] is None and found['motors']['needed']['speed_rad_s'] is None
    leg = found['motors']['legs']['leg_1']
    assert leg['speed_peak_rad_s'] is None and leg['torque_peak_n_m'] is not None
    bare = summary_of(P.replaced(dict.fromkeys(
        name for name in DRIVES if name not in ('actuator.screw_lead', 'drive.motor_inertia'))),
        motion, TIMES[:20], [])['motors']
    assert bare['bus'] is None
    assert {key for key, value in bare['legs']['leg_1'].items() if value is None} == {
        'torque_margin_n_m', 'torque_margin_at_s', 'torque_continuous_margin_n_m',
        'speed_margin_rad_s', 'current_peak_a', 'current_rms_a', 'temperature_rise_max_k',
        'temperature_rise_max_at_s', 'temperature_rise_steady_k', 'temperature_rise_margin_k'}


def test_the_card_of_the_motors_says_whether_their_limits_are_held() -> None:
    motion = fourier(3, size=0.5)(TIMES[:20])

    def of_limits(p: Parameters, **changes: Any) -> dict[str, Card]:
        found = summary_of(p.replaced({f'drive.{k}': v for k, v in changes.items()}), motion,
                           TIMES[:20], [])
        return cards(bag_summary(found, parameters=p))

    def card(**changes: Any) -> Card:
        return of_limits(P, **changes)['motors']

    limits = ('torque_max', 'torque_speed', 'speed_max', 'temperature_rise_max')
    ample = {'torque_max': 1e3, 'torque_continuous': 1e2, 'speed_max': 1e4, 'torque_speed': None}
    assert card(**ample)[:2] == ('good', 'Motors are large enough')
    said = [each.line for of in of_limits(P, **ample).values() for each in of.statements]
    assert said.count('within all limits of the motors') == 1
    assert card(**ample, efficiency=None).level == 'good'
    assert card(**ample | {'torque_continuous': 1e-3}).level == 'warn'
    exceeded = card(**ample | {'torque_max': 1e-2, 'torque_continuous': None})
    assert exceeded.level == 'bad'
    assert any(each.line.startswith('drive.torque_max, ') for each in exceeded.statements)
    assert card(**dict.fromkeys([*limits, 'torque_continuous'])).level == 'none'
    # a continuous torque bounds the RMS: it is no limit
    unlimited = P.replaced(dict.fromkeys(name for name in OF_LEGS if P[name] is not None))
    for continuous, level in ((1e-3, 'warn'), (1e2, 'good')):
        found = of_limits(unlimited, **dict.fromkeys(limits), torque_continuous=continuous)
        assert (found['limits'].level, found['motors'].level) == ('none', level)


def rows_of(speeds: Array, torques: Array) -> Array:
    """Return rows of motors with these speeds and demanded torques."""
    rows = np.zeros((len(speeds), MOTORS))
    rows[:, SPEEDS], rows[:, BREAKAWAY_TORQUES] = speeds, torques
    return rows


@pytest.mark.parametrize('seed', range(5))
def test_operating_points_are_counted_where_they_are_however_they_are_given(seed: int) -> None:
    random = rng(seed)
    sizes = 10.0 ** random.uniform(-6.0, 6.0, (40, 1))
    speeds = np.where(random.random((40, 6)) < 0.2, 0.0, sizes * random.normal(size=(40, 6)))
    torques = random.normal(size=(40, 6)) * random.choice([1e-3, 1.0, 1e4])
    torques[random.random((40, 6)) < 0.1] = np.nan
    rows = rows_of(speeds, torques)
    whole, parts = OperatingPoints(), OperatingPoints()
    whole.add(Motors.of_rows(rows))
    for row in rows:
        parts.add(Motors.of_rows(row[None]))
    for leg in range(6):
        known = np.isfinite(torques[:, leg])
        speed, torque = np.abs(speeds[known, leg]), torques[known, leg]
        torque = np.where(speed == 0.0, np.abs(torque), torque * np.sign(speeds[known, leg]))
        cells, counts = whole.cells(leg)
        points = np.column_stack([speed, torque])[:, None]
        inside = ((points >= cells[:, :2]) & (points < cells[:, :2] + cells[:, 2:])).all(axis=2)
        assert (inside.sum(axis=1) == 1).all()
        assert (inside.sum(axis=0) == counts).all()
        for found, same in zip(whole.cells(leg), parts.cells(leg), strict=True):
            np.testing.assert_array_equal(found, same)


def test_the_drawn_curve_is_the_available_torque() -> None:
    p = P.replaced({'drive.torque_max': 3.0, 'drive.speed_max': None})
    motors = StewartPlatform(p).motors(fourier(3, base=0.4, size=0.9)(TIMES))
    drawn = Deliverable(p, 2).at(np.abs(motors.speeds[:, 2]))
    assert drawn == pytest.approx(motors.available_torques[:, 2], abs=1e-12)
    assert drawn.min() == 0.0 and drawn.max() == 3.0
    outline = Deliverable(p, 2).outline(1e4)
    assert outline[0].tolist() == [0.0, 3.0] and outline[-1].tolist() == [800.0, 0.0]


@pytest.mark.parametrize(('bound', 'drawn'), [(3.0, True), (100.0, False)])
def test_a_bound_far_above_all_loads_is_stated_and_does_not_set_the_scale(
        bound: float, drawn: bool) -> None:
    p = P.replaced({'drive.torque_max': bound, 'drive.speed_max': 4.0 * bound,
                    'drive.torque_speed': None, 'drive.torque_continuous': bound})
    points = OperatingPoints()
    points.add(Motors.of_rows(rows_of(np.full((1, 6), 9.0), np.full((1, 6), -2.0))))
    load = MotorLoads(**dict.fromkeys(MotorLoads.__struct_fields__))
    load.speed_mean_rad_s, load.torque_rms_n_m = 4.0, 1.0
    charts = motor_charts(points, p, dict.fromkeys(p['joints'], load))
    for chart in charts.values():
        assert ('class="curve"' in chart) is drawn
        assert ('deliverable to 100 N m and 400 rad/s' in chart) is not drawn
        assert ('class="continuous"' in chart) is drawn
        highest = max(float(re.search(r'[\d.]+', each)[0])  # type: ignore[index]
                      for each in re.findall(r'>([\d.]+)</text>', chart))
        assert highest <= 13.0


def test_the_motor_needed_is_that_of_all_bags_but_those_near_a_singularity(tmp_path: Path) -> None:
    rows: list[dict[str, Any]] = []
    for n, (size, singular) in enumerate(((0.3, 0), (0.6, 0), (0.9, 1))):
        found = summary_of(P, fourier(3, size=size)(TIMES[:200]), TIMES[:200], [])
        found['singularity']['warnings'] = singular
        rows.append({**row_of(0, bag_summary(found), ''), 'bag': f'{n}', 'results': f'{n}'})
    rows.append({**row_of(2, None, 'bad'), 'bag': 'bad', 'results': None})
    write_fleet(tmp_path, rows)
    largest = needed_motor((
        row['torque_rms_n_m'], row['torque_peak_n_m'], row['speed_peak_rad_s'])
        for row in rows[:2])
    assert largest.torque_peak_n_m == pytest.approx(MARGIN * max(
        abs(row['torque_peak_n_m']) for row in rows[:2]))
    page = (tmp_path / 'index.html').read_text(encoding='utf-8')
    assert f'{largest.torque_continuous_n_m:.4g} N m continuous, ' in page
    with (tmp_path / 'fleet.csv').open(encoding='utf-8', newline='') as file:
        cells = next(csv.DictReader(file))
    assert float(cells['bus_power_peak_w']) == rows[0]['bus_power_peak_w']
    assert float(cells['torque_rms_n_m']) == rows[0]['torque_rms_n_m']
