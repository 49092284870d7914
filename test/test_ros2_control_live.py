# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The ros2_control controller with live setpoints: its governor, and an IMU on its base."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
import subprocess
from typing import Any, NamedTuple

from governed import (
    Array, CRANK_DEMANDS, CRANK_KINDS, CRANKS, DEMANDS, governable, KINDS, limited_cranks,
    limited_hexapod, random_demand)
from independent_limits import exceedances
from messages import imu
import numpy as np
from programs import run_program
import pytest
from referees import random_motion, rng
from stewart_dynamics import GovernedStream, Motion, Parameters, Pose, StewartPlatform
from stewart_dynamics.core.binding import CODES, function, record
from stewart_dynamics.mechanics.frames.rotation import to_quaternion
from stewart_dynamics.mechanics.kinematics.home_pose import home_pose
from stewart_dynamics.mechanics.rows import NO_BASE
from stewart_dynamics.setpoints.base_input import BaseInput
from stewart_dynamics.setpoints.input_messages import BASE_IMU
from stewart_dynamics.setpoints.rejections import Rejections
from stewart_dynamics.setpoints.step import Batch, Step
from test_ros2_control import as_text, compiled, ROOT

ANSWER = np.dtype([
    ('code', np.float64), ('governed', record('stewart_motion')), ('base', record('stewart_base')),
    *((name, np.float64, 6) for name in (
        'positions', 'velocities', 'efforts', 'torques', 'motor_velocities'))])
PERIOD = 1_000_000  # [ns]
REST = np.zeros(6)


class Cycle(NamedTuple):
    """Inputs of a cycle of the controller manager."""

    stamp: int
    reference: Array  # position, quaternion, velocities, accelerations (19,)
    repeated: bool = False
    wrench: Array = REST
    reading: Array = REST


@pytest.fixture(scope='module')
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the program that runs the feed-forward in cycles."""
    return compiled(tmp_path_factory.mktemp('cycles'), 'feed_forward_cycles.cpp',
                    ('-O2', '-ffp-contract=off', '-fsanitize=undefined',
                     '-fno-sanitize-recover=all'))


def run(program: Path, p: Parameters, cycles: Sequence[Cycle], period: int = PERIOD,
        **changes: Any) -> Any:
    """Return the answers to cycles, as records of ANSWER."""
    text = [as_text(p, {name.replace('__', '.'): value for name, value in changes.items()}),
            f'{len(cycles)} {period}']
    for cycle in cycles:
        numbers = np.concatenate([cycle.reference, cycle.wrench, cycle.reading])
        text.append(f'{cycle.stamp} {int(cycle.repeated)} ' + ' '.join(
            map(float.hex, numbers.tolist())))
    done = subprocess.run([program], input='\n'.join(text).encode(), capture_output=True)
    assert (done.returncode, done.stderr) == (0, b'')
    return np.frombuffer(done.stdout, ANSWER)


def to_references(motion: Motion) -> tuple[Array, Motion]:
    """Return a motion as references (N, 19), and with the bits of their rotations."""
    quaternions, rotations = to_quaternion(motion.rotation), motion.rotation.copy()
    for quaternion, rotation in zip(quaternions, rotations, strict=True):
        function('stewart_rotation')(quaternion, rotation)
    rates = (motion.linear_velocity, motion.angular_velocity, motion.linear_acceleration,
             motion.angular_acceleration)
    return (np.concatenate([motion.position, quaternions, *rates], axis=1),
            Motion(motion.position, rotations, *rates))


def from_home(p: Parameters, times: Array, demand: Motion) -> tuple[Any, Motion]:
    """Return stamps [ns] and a demand that begins at rest at home, a second before."""
    rows = np.concatenate([Motion.from_pose(home_pose(p)[None]).rows, demand.rows])
    stamps = np.concatenate([[0], 1_000_000_000 + np.round(times * 1e9).astype(np.int64)])
    return stamps, Motion.of_rows(rows)


def governed(program: Path, p: Parameters, stamps: Any, numbers: Array) -> tuple[Any, Motion]:
    """Return answers, and the motion that the governor makes of references at stamps [ns]."""
    found = run(program, p.replaced({'setpoint.timeout': 10.0}), [
        Cycle(stamp, each) for stamp, each in zip(stamps.tolist(), numbers, strict=True)],
        period=0, reference='platform', governor=True)
    rows = np.ascontiguousarray(found['governed']).view(np.float64).reshape(len(found), -1)
    return found, Motion.of_rows(rows)


def governed_within_limits(program: Path, p: Parameters, axes: Any, stamps: Any, demand: Motion,
                           named: str) -> tuple[Any, Motion]:
    """Return ``governed``, with the bits of Python's and within all limits."""
    numbers, demand = to_references(demand)
    found, motion = governed(program, p, stamps, numbers)
    expected = GovernedStream(p, demand[0]).advance(1e-9 * stamps, demand)
    assert motion.rows.tobytes() == expected.rows.tobytes(), named
    exceeded = exceedances(p, motion, axes)
    assert {name for name, wrong in exceeded.items() if wrong.any()} == set(), named
    assert (found['code'] == CODES['STEWART_OK']).all()
    return found, motion


@pytest.mark.parametrize('wanted', DEMANDS)
def test_no_limit_is_exceeded_by_any_setpoint(program: Path, wanted: str) -> None:
    """Each kind of limit and of demand, 1100 setpoints each; they have the bits of Python's."""
    random = np.random.default_rng([7, DEMANDS.index(wanted)])
    checked = 0
    for kind in KINDS:
        p, axes, _ = governable(random, kind, limited_hexapod)
        stamps, demand = from_home(p, *random_demand(random, wanted, p, 1100))
        found, motion = governed_within_limits(program, p, axes, stamps, demand, kind)
        # These are the commands: no position is clipped, no effort either.
        platform = StewartPlatform(p)
        lengths = platform.inverse_kinematics(motion)
        assert np.array_equal(found['positions'], lengths - p['geometry.zero_length'])
        assert np.array_equal(found['efforts'], platform.inverse_dynamics(motion).forces)
        checked += len(motion)
    assert checked > (9_000 if wanted == 'lost' else 15_400)  # 10^5 of all demands


@pytest.mark.parametrize('kind', CRANK_KINDS)
def test_no_limit_of_cranks_is_exceeded_by_any_setpoint(program: Path, kind: str) -> None:
    """Each kind of limit, with a third of the demands; they have the bits of Python's."""
    place = CRANK_KINDS.index(kind)
    random = np.random.default_rng([8, place])
    for wanted in CRANK_DEMANDS[place % 3:-1:3]:  # without numbers that are not finite
        p, axes, _ = governable(random, kind, limited_cranks)
        stamps, demand = from_home(p, *random_demand(random, wanted, p, 200))
        found, motion = governed_within_limits(program, p, axes, stamps, demand, wanted)
        result = StewartPlatform(p).inverse_dynamics(motion)
        assert np.array_equal(found['positions'], result.angles)
        assert np.array_equal(found['efforts'], result.torques)


HEXAPOD = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')


def swing(count: int) -> Array:
    """Return references (N, 19) of a motion along x, a cycle each, from rest."""
    w, times = 6.0, 1e-9 * PERIOD * np.arange(count)
    numbers = np.tile(to_references(Motion.from_pose(home_pose(HEXAPOD)[None]))[0], (count, 1))
    numbers[:, 0] += 0.03 * (1.0 - np.cos(w * times))
    numbers[:, 7], numbers[:, 13] = 0.03 * w * np.sin(w * times), 0.03 * w * w * np.cos(w * times)
    return numbers


@pytest.mark.parametrize('fault', ['nan', 'silence'])
def test_a_governed_motion_stops_where_references_end(program: Path, fault: str) -> None:
    """Velocities end without a step, and the motion then goes on to the references."""
    numbers, last, again = swing(12000), 1800, 3000
    cycles = [Cycle(n * PERIOD, each) for n, each in enumerate(numbers)]
    for n in range(last, again):
        cycles[n] = Cycle(n * PERIOD, np.full(19, np.nan)) if fault == 'nan' else Cycle(
            n * PERIOD, numbers[last - 1], repeated=True)
    found = run(program, HEXAPOD, cycles, reference='platform', governor=True)
    speed = np.abs(found['velocities'])
    # Commands stand until a gap, since setpoints may come more rarely than cycles.
    held = slice(last, last + 9) if fault == 'silence' else slice(last, last)
    assert speed[last - 1].max() > 0.04
    assert (np.diff(found['positions'], axis=0)[held] == 0.0).all()
    assert np.abs(np.diff(found['velocities'], axis=0)).max() < 0.02
    assert speed[again - 1].max() < 1e-3 * speed[last - 1].max()
    codes = found['code'][last:again]
    assert (codes == (CODES['STEWART_NOT_FINITE'] if fault == 'nan' else 0)).all()
    assert (found['code'][again:] == 0).all()
    lengths = StewartPlatform(HEXAPOD).inverse_kinematics(Pose.from_quaternion(
        numbers[-1, :3], numbers[-1, 3:7]))
    np.testing.assert_allclose(
        found['positions'][-1], lengths - HEXAPOD['geometry.zero_length'], atol=1e-6)


def test_repeated_references_are_no_setpoints(program: Path) -> None:
    """Setpoints of a fourth of the cycles have the bits of those alone; commands stand between."""
    numbers = swing(2000)[::4]
    cycles = [Cycle(n * PERIOD, numbers[n // 4], n % 4 > 0) for n in range(2000)]
    found = run(program, HEXAPOD, cycles, reference='platform', governor=True)
    alone = run(program, HEXAPOD, cycles[::4], reference='platform', governor=True)
    for name in ('governed', 'positions', 'velocities'):
        assert found[name].tobytes() == np.repeat(alone[name], 4, axis=0).tobytes(), name


def test_a_start_that_is_no_stop_is_rejected(program: Path) -> None:
    """A first reference with a leg out of its limits; then one at home."""
    numbers = swing(2)
    numbers[0, 2] += 0.9
    found = run(program, HEXAPOD, [Cycle(n, each) for n, each in enumerate(numbers)],
                reference='platform', governor=True)
    assert found['code'].tolist() == [CODES['STEWART_SUPPRESSED'], 0]
    assert not found['positions'][0].any()


def test_a_gap_of_the_cycles_is_no_jump(program: Path) -> None:
    """After 100 s without a cycle the motion goes on where it was, at once."""
    numbers = swing(600)
    stamps = PERIOD * np.arange(600)
    stamps[300:] += 100_000_000_000
    found = run(program, HEXAPOD, [Cycle(stamp, each) for stamp, each in zip(
        stamps.tolist(), numbers, strict=True)], reference='platform', governor=True)
    assert (found['code'] == 0).all()
    assert np.abs(np.diff(found['positions'], axis=0)).max() < 0.5e-3


@pytest.mark.parametrize(('changes', 'message'), [
    ({'reference': 'legs'}, 'governor: needs reference: platform'),
    ({'limits.length_min': [0.4], 'limits.length_max': [0.5]},
     'home pose: no level pose has all legs between limits.length_min and limits.length_max: '
     'needed by governor'),
    ({'limits.force_max': [100.0]}, 'governor: at home limits.force_max is exceeded, or nearer '
     'than the margin of the governor'),
    ({'governor': False, 'base.source': 'imu'},
     'imu_sensor: must be set: needed by base.source: imu'),
    ({'governor': False, 'base.source': 'imu', 'imu_sensor': 'imu',
      'base.imu.orientation': [1.0, 1.0, 0.0, 0.0]},
     'base.imu.orientation: must be a unit quaternion')])
def test_rules_in_one_line(program: Path, changes: dict[str, Any], message: str) -> None:
    """A rule that is broken is named, and nothing is computed."""
    assert_rule(program, HEXAPOD, changes, message)


@pytest.mark.parametrize(('changes', 'message'), [
    ({'limits.torque_max': [40.0]}, 'governor: at home limits.torque_max is exceeded, or nearer '
     'than the margin of the governor'),
    ({'limits.lever_min': [0.9]}, 'governor: at home limits.lever_min is exceeded, or nearer than '
     'the margin of the governor'),
    ({'legs.rod.length': [0.1], 'geometry.crank_branch': ['positive']}, 'home pose: no level pose '
     "has all rods at the cranks' middle angles: needed by governor")])
def test_rules_of_cranks_in_one_line(program: Path, changes: dict[str, Any], message: str) -> None:
    assert_rule(program, CRANKS, changes, message)


def assert_rule(program: Path, p: Parameters, changes: dict[str, Any], message: str) -> None:
    given = as_text(p, {'reference': 'platform', 'governor': True, **changes})
    done = run_program(program, code=1, text=given + '0 1')
    assert (done.out, done.err) == ('', f'{message}\n')


SHIP = Parameters.from_yaml(ROOT / 'config' / 'ship_hexapod.yaml')


@pytest.mark.parametrize('every', [1, 3, 7])
def test_forces_on_an_imu_have_the_bits_of_the_node(program: Path, every: int) -> None:
    """
    The same readings, by messages to the node and by state interfaces.

    Some are lost, one is nan, and the IMU is silent for longer than base.timeout.
    """
    random, count = rng(57), 900
    p = SHIP.replaced({
        'base.imu.position': random.normal(size=3), 'base.imu.cutoff': 35.0,
        'base.imu.orientation': [0.5, -0.5, 0.5, 0.5], 'base.timeout': 0.05,
        'setpoint.sync_tolerance': 0.0, 'limits.length_min': None, 'limits.length_max': None,
        'limits.velocity_max': None})
    motions = random_motion(p, random, count)
    numbers, motions = to_references(motions)
    base = BaseInput(p, Rejections(lambda *why: None), lambda text: None)
    cycles, rows = [], []
    reading = np.full(6, np.nan)  # none yet
    for n in range(count):
        stamp = 1_000_000_000 + n * PERIOD
        silent = n < 5 or 400 <= n < 480 or random.random() < 0.05
        if n == 400:
            reading = np.full(6, np.nan)
        if n % every == 0 and not silent:
            reading = random.normal([0.0, 0.0, 0.0, 0.0, 0.0, 9.8], 0.4)
            base.join_message(BASE_IMU, imu(stamp, reading[:3].tolist(), reading[3:].tolist()),
                              lambda stamp=stamp: stamp)
        lost = np.full(6, np.nan) if n == 100 and every > 1 and n % every else reading
        cycles.append(Cycle(stamp, numbers[n], wrench=random.normal(size=6), reading=lost))
        rows.append(base.at(stamp))
    found = run(program, p, cycles, reference='platform', imu_sensor='imu')
    expected = np.array(rows)
    known = ~np.isnan(expected[:, 0])
    assert known.sum() > 800 and (~known[400:480]).sum() > 20
    assert ((found['code'] == CODES['STEWART_OK']) == known).all()
    rows_found = np.ascontiguousarray(found['base']).view(np.float64).reshape(count, -1)
    assert rows_found[known].tobytes() == expected[known].tobytes()
    outputs = Step(p)(Batch.from_parts(
        [cycle.stamp for cycle in cycles], motions.rows, [cycle.wrench for cycle in cycles],
        bases=np.where(known[:, None], expected, NO_BASE)))
    efforts = outputs.records['forces']
    assert found['efforts'][known].tobytes() == efforts[known].tobytes()


def test_an_imu_that_repeats_its_reading_is_at_rest(program: Path) -> None:
    """A simulated IMU without noise: its reading is a new one after base.timeout, not unknown."""
    numbers = swing(500)
    numbers[:] = numbers[0]
    reading = np.array([0.0, 0.0, 0.2, 1.0, 0.0, 9.7])
    found = run(program, SHIP, [Cycle(n * PERIOD, each, reading=reading) for n, each in enumerate(
        numbers)], reference='platform', imu_sensor='imu')
    assert (found['code'] == 0).all()
    assert (found['base'] == found['base'][0]).all()
    assert np.ptp(found['efforts'], axis=0).max() == 0.0


def test_commands_turn_cranks_by_mock_gear_motors(program: Path) -> None:
    """
    Units and signs of commands: positions [rad], torques [N m] and speeds of the motors [rad/s].

    A mock gear motor counts 8192 increments a turn in its own sense, makes per mille of its rated
    torque, and turns its crank by a gear of 50.
    """
    directions = np.array([1.0, -1.0, 1.0, 1.0, -1.0, -1.0])
    counts, gear, rated = 8192.0, 50.0, 2.4
    p = Parameters.from_yaml(ROOT / 'config' / 'crank_platform.yaml').replaced({
        'actuator.reflected_inertia': 0.0, 'actuator.viscous_friction': 0.0,
        'actuator.coulomb_friction': 0.0, 'drive.gear_ratio': gear,
        'drive.direction': directions, 'drive.rated_torque': rated,
        'drive.counts_per_turn': counts})
    platform = StewartPlatform(p)
    home = platform.home_pose()
    moves = 0.03 * rng(4).uniform(-1.0, 1.0, (20, 3))
    motion = Motion(home.position + moves, np.tile(np.eye(3), (20, 1, 1)), 0.1 * moves / 0.03,
                    np.zeros((20, 3)), moves / 0.03, np.zeros((20, 3)))
    found = run(program, p, [Cycle(n * PERIOD, each) for n, each in enumerate(
        to_references(motion)[0])], reference='platform')
    assert (found['code'] == CODES['STEWART_OK']).all()
    on_bus = np.round(directions * found['positions'] * gear * counts / (2.0 * np.pi))
    angles = directions * on_bus / counts / gear * 2.0 * np.pi
    speeds = found['motor_velocities'] / gear
    per_mille = np.round(directions * found['torques'] * 1e3 / rated)
    torques = directions * per_mille * 1e-3 * rated * gear
    for n in range(len(motion)):
        pose = platform.forward_kinematics(angles[n])
        assert np.abs(pose.position - motion.position[n]).max() < 1e-5
        expected = platform.inverse_dynamics(motion[n])
        assert np.abs(speeds[n] - expected.speeds).max() < 1e-12
        assert np.abs(torques[n] - expected.torques).max() < 0.51e-3 * rated * gear
        moved = platform.forward_dynamics(motion[n], torques[n])
        assert np.abs(moved.linear_acceleration - motion.linear_acceleration[n]).max() < 0.05
