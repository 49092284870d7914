# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Replays of a base that moves: the numbers of the step, topics, and a base that is not known."""

from __future__ import annotations

from collections.abc import Iterable
import json
import math
from pathlib import Path
from typing import Any

import messages
from messages import Feed, JOINT_STATE, motion, MS, RECORDED, Recorded, write_bag
import numpy as np
from programs import call, Ended
import pytest
from referees import rotation_about
from scipy.spatial.transform import Rotation

from snapshot import Snapshot
from stewart_dynamics import BaseMotion, Motion, Parameters, StewartPlatform
from stewart_dynamics.mechanics.dynamics.force_breakdown import SOURCES
from stewart_dynamics.program import BAD_INPUT, DONE, PARTLY_READ
from stewart_dynamics.replay import one_bag
from stewart_dynamics.replay.replay_command_line import main
from stewart_dynamics.replay.replay_options import LIMIT_MET, NODE
from stewart_dynamics.setpoints.base_wrench_step import BaseWrench
from stewart_dynamics.setpoints.input_messages import (
    ACCEL, BASE_ACCEL, BASE_IMU, BASE_POSE, BASE_SOURCES, BASE_TWIST, COMBINED, INPUT_TYPES, POSE,
    TWIST, WRENCH)
from stewart_dynamics.setpoints.output_messages import OutputMessages
from stewart_dynamics.setpoints.step import Batch, FIRST, Outputs as Answer, Step
from test_replay import nanoseconds, Outputs, outputs_of, PARAMETERS, six_of

PROGRAM = 'stewart_replay'

MOVING = ('pose', 'motion', 'imu')
MOUNTING = {'base.imu.position': [0.4, -0.3, 0.2], 'base.imu.orientation': [0.5, 0.5, 0.5, 0.5]}
TURN = rotation_about([0.6, 0.8, 0.0], 0.3)


def parameters_of(source: str, **changes: Any) -> Parameters:
    return PARAMETERS.replaced({'base.source': source, **MOUNTING, **changes})


def deck(source: str, stamp: int) -> list[Recorded]:
    """Return the messages of a ship's deck at a stamp, 2 ms after it."""
    t = stamp * 1e-9
    turn = rotation_about([1.0, 0.3, 0.1], 0.2 * math.sin(2.0 * t))
    rate = [0.4 * math.cos(2.0 * t), 0.1, 0.02 * math.sin(t)]
    accelerations = [0.3 * math.sin(t), 0.1, 2.0 * math.cos(3.0 * t),
                     -0.8 * math.sin(2.0 * t), 0.05, 0.02 * math.cos(t)]
    of = {
        BASE_POSE: lambda: messages.pose(stamp, (t, 2.0, 3.0), Rotation.from_matrix(
            turn).as_quat(), 'world'),
        BASE_TWIST: lambda: messages.twist(stamp, (1.0, 2.0, 3.0, *rate), 'world'),
        BASE_ACCEL: lambda: messages.accel(stamp, accelerations, 'world'),
        BASE_IMU: lambda: messages.imu(stamp, rate, [0.3, 0.2 * t, 9.8 + math.sin(3.0 * t)])}
    return [(topic, RECORDED + stamp + 2 * MS, of[topic]()) for topic in BASE_SOURCES[source]]


def at_sea(source: str, number: int = 300) -> list[Recorded]:
    """
    Return setpoints at 100 Hz on a deck at 73 Hz, as they come.

    The first 5 setpoints are before the first sample of the base, and a gap is from 1.5 to 2 s.
    """
    of = motion(number)
    for n in range(4, int(number * 0.73)):
        stamp = round(n * 1e9 / 73)
        if not 1.5 < stamp * 1e-9 < 2.0:
            of += deck(source, stamp)
    return sorted(of, key=lambda each: each[1])


def answers(parameters: Parameters, of: Iterable[Recorded]) -> list[tuple[Batch, Answer]]:
    """Return setpoints and the outputs of the step, message by message, as in the node."""
    feed, step, state = Feed(parameters), Step(parameters), FIRST
    found: list[tuple[Batch, Answer]] = []
    for topic, when, data in of:
        if (setpoint := feed(topic, data, when)) is not None:
            answer = step(setpoint, state)
            assert answer.answered.tolist() == [True]
            state = answer.state
            found.append((setpoint, answer))
    return found


def run(bag: Path, parameters: Parameters, folder: Path, *options: str, code: int | None = DONE,
        ) -> Ended:
    folder.mkdir(exist_ok=True)
    parameters.to_yaml(folder / 'platform.yaml')
    return call(main, bag, '--params', folder / 'platform.yaml', '--output', folder / 'out',
                *options, code=code)


def summary_of(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / 'out' / 'bag' / 'summary.json').read_text())
    return found


def replayed(of: list[Recorded], parameters: Parameters, folder: Path, *options: str) -> Outputs:
    bag = write_bag(folder / 'bag', of, **TYPES)
    run(bag, parameters, folder, *options)
    return outputs_of(folder / 'out' / 'bag')


# Types of topics with other names; the usual names imply their types.
TYPES = {'deck_pose': INPUT_TYPES[BASE_POSE], 'deck_twist': INPUT_TYPES[BASE_TWIST],
         'deck_accel': INPUT_TYPES[BASE_ACCEL], 'deck_imu': INPUT_TYPES[BASE_IMU],
         'where': INPUT_TYPES[POSE], 'state': JOINT_STATE}


# The numbers

@pytest.mark.parametrize('source', MOVING)
def test_a_replay_gives_the_bits_of_the_step_and_states_where_the_base_is_not_known(
        source: str, tmp_path: Path) -> None:
    parameters, of = parameters_of(source), at_sea(source)
    text = ' '.join(run(write_bag(tmp_path / 'bag', of), parameters, tmp_path).out.split())
    outputs = outputs_of(tmp_path / 'out' / 'bag')
    expected = answers(parameters, of)
    unknown = [n for n, (_, answer) in enumerate(expected)
               if np.isnan(answer.demanded_efforts).all()]
    assert len(expected) == 300
    assert unknown[:5] == [0, 1, 2, 3, 4]
    assert 30 < len(unknown) < 60
    load, written = BaseWrench(parameters), OutputMessages(parameters)
    platform = StewartPlatform(parameters)
    loads = {nanoseconds(each): each for _, each in outputs.messages[f'{NODE}/base_wrench']}
    forces = {nanoseconds(state): list(state.effort)
              for _, state in outputs.messages[f'{NODE}/leg_states']}
    for n, (setpoint, answer) in enumerate(expected):
        row, stamp = outputs.rows[n], int(setpoint.stamps[0])
        base_wrench, demanded = load(setpoint)[0].tolist(), answer.demanded_efforts[0].tolist()
        cells = [row[f'{leg}_demanded_force_n'] for leg in parameters['joints']]
        of_base = [row[f'base_{part}'] for part in (
            'force_x_n', 'force_y_n', 'force_z_n', 'moment_x_n_m', 'moment_y_n_m',
            'moment_z_n_m')]
        assert float(row['determinant_m3']) == answer.determinants[0]
        if n in unknown:
            assert np.isnan(base_wrench).all()
            assert set(cells) == set(of_base) == {''}
            assert forces[stamp] == []
            assert stamp not in loads
            continue
        assert demanded == list(map(float, cells))
        assert answer.efforts[0].tolist() == forces[stamp]
        assert base_wrench == six_of(loads[stamp]) == list(map(float, of_base))
        # and the library's
        assert setpoint.bases is not None
        given, base = Motion.of_rows(setpoint.motions[0]), BaseMotion.of_rows(setpoint.bases[0])
        assert platform.inverse_dynamics(given, base=base).forces.tolist() == demanded
        assert platform.base_wrench(given, base=base).tolist() == base_wrench
    # the very bytes of the node
    with (tmp_path / 'out' / 'bag' / 'bag' / 'bag.mcap').open('rb') as file:
        content = file.read()
    for setpoint, _ in expected[5:20]:
        _, having, message = written.write_base_wrenches(setpoint.stamps, load(setpoint))
        assert having[0]
        assert message[0].tobytes() in content

    found = summary_of(tmp_path)
    lacking = [row['time_s'] for row in outputs.rows if not row['base_force_z_n']]
    assert found['setpoints']['base_unknown'] == len(lacking)
    assert found['setpoints']['base_unknown_first_at_s'] == 0.0
    assert found['singularity']['unsolved'] == found['singularity']['suppressed'] == 0
    assert found['limits_not_checked'] == ['limits.force_max']
    assert (f"the base's motion is not known in {len(lacking)} setpoints, first at t = 0.00 s: "
            'they have no forces') in text
    assert set(found['inputs']['topics']) == {POSE, TWIST, ACCEL, *BASE_SOURCES[source]}
    sizes = np.linalg.norm([[float(row[f'base_force_{axis}_n'] or 'nan') for axis in 'xyz']
                            for row in outputs.rows], axis=1)
    assert found['base_wrench']['force']['peak_n'] == pytest.approx(np.nanmax(sizes))
    assert found['base_wrench']['force']['peak_at_s'] == float(
        outputs.rows[int(np.nanargmax(sizes))]['time_s'])
    of_leg = found['force_breakdown']['leg_1']
    assert list(of_leg) == list(SOURCES)
    # the tilt alone is gravity
    assert (of_leg['base motion']['peak_n'] == 0.0) is (source == 'pose')


def test_a_fixed_base_has_a_base_wrench_and_no_source_of_its_own(tmp_path: Path) -> None:
    outputs = replayed(motion(30), parameters_of('fixed'), tmp_path)
    found = summary_of(tmp_path)
    assert len(outputs.messages[f'{NODE}/base_wrench']) == 30
    assert list(found['force_breakdown']['leg_1']) == list(SOURCES[:-1])
    assert found['setpoints']['base_unknown'] == 0
    assert found['setpoints']['base_unknown_first_at_s'] is None
    p = PARAMETERS
    weight = 9.80665 * (p['platform.mass'] + p['legs.cylinder.mass'].sum()
                        + p['legs.piston.mass'].sum())
    assert found['base_wrench']['force_z']['mean_n'] == pytest.approx(-weight, rel=0.01)


def test_strict_rejects_forces_that_could_not_be_checked(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'bag', at_sea('imu', 50))
    for name, limit, code in (('limited', 6000.0, LIMIT_MET), ('free', None, DONE)):
        parameters = parameters_of('imu', **{'limits.force_max': limit})
        run(bag, parameters, tmp_path / name, '--no-report')
        run(bag, parameters, tmp_path / name, '--strict', '--no-report', '--force', code=code)
    # the base is known at every setpoint
    known = write_bag(tmp_path / 'known', [each for each in at_sea('imu', 50)
                                           if each[1] > RECORDED + 80 * MS])
    run(known, parameters_of('imu'), tmp_path / 'k', '--strict', '--no-report')


def test_a_bag_without_any_known_base_is_incomplete(tmp_path: Path, snapshot: Snapshot) -> None:
    late = [*motion(20), *deck('pose', 900 * MS)]
    bag = write_bag(tmp_path / 'bag', late)
    snapshot(run(bag, parameters_of('pose'), tmp_path / 'a', code=PARTLY_READ).err)
    assert summary_of(tmp_path / 'a')['base_wrench']['force']['peak_n'] is None


# Topics

@pytest.mark.parametrize('source', MOVING)
def test_a_bag_without_the_base_is_an_error_in_one_line(
        source: str, tmp_path: Path, snapshot: Snapshot) -> None:
    bag = write_bag(tmp_path / 'bag', motion(5))
    text = run(bag, parameters_of(source), tmp_path / 'a', code=BAD_INPUT).err
    assert text.count('\n') == 1
    snapshot(text)
    assert not (tmp_path / 'a' / 'out' / 'bag').exists()


@pytest.mark.parametrize(('source', 'option', 'words'), [
    ('fixed', '--base-imu', '--base-imu: is not read where base.source is fixed'),
    ('fixed', '--base-pose', '--base-pose: is not read where base.source is fixed'),
    ('pose', '--base-twist', '--base-twist: is not read where base.source is pose'),
    ('motion', '--base-imu', '--base-imu: is not read where base.source is motion'),
    ('imu', '--base-accel', '--base-accel: is not read where base.source is imu'),
    ('imu', '--combined', None)])
def test_options_of_topics_that_are_not_read_are_errors(
        source: str, option: str, words: str | None, tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'bag', at_sea(source, 20))
    error = run(bag, parameters_of(source), tmp_path / 'a', option, '/x', code=BAD_INPUT).err
    assert (words or '/x') in error


def renamed(of: list[Recorded], **names: str) -> list[Recorded]:
    """Return messages under other topics: base_imu='/deck_imu'."""
    return [(names.get(topic.replace('/', '_'), topic), when, data) for topic, when, data in of]


@pytest.mark.parametrize('source', MOVING)
def test_topics_of_other_names_are_found_by_their_end_or_option(
        source: str, tmp_path: Path) -> None:
    of, parameters = at_sea(source, 50), parameters_of(source)
    expected = replayed(of, parameters, tmp_path / 'usual', '--no-report').rows
    keys = BASE_SOURCES[source]
    for way, names in (('ending', [f'/ship/{key}' for key in keys]),
                       ('option', [f'/deck_{key.rpartition("/")[2]}' for key in keys])):
        options = [part for key, name in zip(keys, names, strict=True) for part in (
            f'--{key.replace("/", "-")}', name)] if way == 'option' else []
        others = renamed(of, **{key.replace('/', '_'): name
                                for key, name in zip(keys, names, strict=True)})
        outputs = replayed(others, parameters, tmp_path / way, '--no-report', *options)
        assert outputs.rows == expected
        topics = summary_of(tmp_path / way)['inputs']['topics']
        assert [topics[key] for key in keys] == names


def test_a_setpoint_is_not_taken_from_what_is_named_as_the_base(
        tmp_path: Path, snapshot: Snapshot) -> None:
    of = renamed(at_sea('pose', 30), base_pose='/ship/base/pose', setpoint_pose='/cmd/where')
    replayed(of, parameters_of('pose'), tmp_path, '--no-report')
    found = summary_of(tmp_path)
    assert found['inputs']['topics'][POSE] == '/cmd/where'
    snapshot('\n'.join(found['notices']))


def test_a_pose_is_not_guessed_to_be_the_bases(tmp_path: Path, snapshot: Snapshot) -> None:
    bag = write_bag(tmp_path / 'bag', renamed(at_sea('pose', 30), base_pose='/deck_pose'), **TYPES)
    snapshot(run(bag, parameters_of('pose'), tmp_path / 'a', code=BAD_INPUT).err)
    run(bag, parameters_of('pose'), tmp_path / 'b', '--base-pose', '/deck_pose', '--no-report')
    # one topic cannot be both
    snapshot(run(bag, parameters_of('pose'), tmp_path / 'c', '--base-pose', f'{NODE}/{POSE}',
                 code=BAD_INPUT).err)


def test_the_only_imu_is_found_by_its_type_and_of_two_none(
        tmp_path: Path, snapshot: Snapshot) -> None:
    of = renamed(at_sea('imu', 30), base_imu='/deck_imu')
    replayed(of, parameters_of('imu'), tmp_path, '--no-report')
    snapshot('\n'.join(summary_of(tmp_path)['notices']))
    two = write_bag(tmp_path / 'two', [*of, ('/other/imu', RECORDED, messages.imu(0))],
                    **TYPES)
    snapshot(run(two, parameters_of('imu'), tmp_path / 'b', code=BAD_INPUT).err)


def test_topics_of_a_base_that_is_fixed_are_not_used_and_this_is_said(
        tmp_path: Path, snapshot: Snapshot) -> None:
    outputs = replayed(at_sea('imu', 30), parameters_of('fixed'), tmp_path, '--no-report')
    snapshot('\n'.join(summary_of(tmp_path)['notices']))
    still = replayed(motion(30), parameters_of('fixed'), tmp_path / 'still', '--no-report')
    assert outputs.rows == still.rows
    assert not any('base.source' in each for each in summary_of(tmp_path / 'still')['notices'])
    # An IMU is likely to be one, whatever its name.
    replayed(renamed(at_sea('imu', 30), base_imu='/deck_imu'), parameters_of('fixed'),
             tmp_path / 'deck', '--no-report')
    snapshot('\n'.join(summary_of(tmp_path / 'deck')['notices']))


# With the other ways of input

def test_poses_are_differentiated_on_a_base_that_moves(tmp_path: Path) -> None:
    """A base that is tilted for good is a hexapod whose gravity is turned."""
    poses = [each for each in motion(200) if each[0] == POSE]
    tilt = Rotation.from_matrix(TURN).as_quat()
    tilted = sorted([*poses, *((BASE_POSE, when - MS, messages.pose(
        nanoseconds_of(when), (0.0, 0.0, 0.0), tilt, 'world')) for _, when, _ in poses)],
        key=lambda each: each[1])
    outputs = replayed(tilted, parameters_of('pose'), tmp_path / 'tilted', '--differentiate',
                       '--no-report')
    turned = PARAMETERS.replaced({'gravity': (TURN.T @ PARAMETERS['gravity']).tolist()})
    expected = replayed(poses, turned, tmp_path / 'turned', '--differentiate', '--no-report')
    assert summary_of(tmp_path / 'tilted')['setpoints']['base_unknown'] == 0
    for key in ('leg_3_force_n', 'base_moment_x_n_m', 'base_force_y_n', 'leg_3_rate_m_s'):
        assert [float(row[key]) for row in outputs.rows] == pytest.approx(
            [float(row[key]) for row in expected.rows], rel=1e-9, abs=1e-9)


def nanoseconds_of(when: int) -> int:
    """Return the stamp of a message that was recorded then."""
    return when - RECORDED


def test_measured_forces_on_a_base_that_moves_differ_by_a_missing_mass_and_nothing_else(
        tmp_path: Path) -> None:
    parameters = parameters_of('motion', **{'platform.center_of_mass': [0.0, 0.0, 0.0]})
    of = [each for n in range(1, 201) for each in deck('motion', n * 10 * MS)]
    # a base sample comes before its setpoint
    of = sorted([*motion(200), *((topic, when - 3 * MS, data) for topic, when, data in of)],
                key=lambda each: each[1])
    for name, mass in (('as modelled', 0.0), ('loaded', 20.0)):
        true = StewartPlatform(parameters.replaced(
            {'platform.mass': parameters['platform.mass'] + mass}))
        legs, added = [], []
        for setpoint, answer in answers(parameters, of):
            stamp = int(setpoint.stamps[0])
            forces = true.solve(setpoint.motions, None, setpoint.bases)[0, 12:18]
            added.append(forces - answer.efforts[0])
            legs.append(('/hexapod/state', RECORDED + stamp + 3, messages.joint_state(
                stamp, parameters['joints'], [], [], forces)))
        replayed(sorted([*of, *legs], key=lambda each: each[1]), parameters, tmp_path / name,
                 '--measured', '/hexapod/state')
        found = summary_of(tmp_path / name)['measured']
        assert found['setpoints_compared'] == 200
        if mass:
            assert found['residual_rms_n'] == pytest.approx(
                np.sqrt(np.mean(np.square(added))), rel=1e-9)
            # what the mass weighs on average, in base axes that tilt
            assert found['external_wrench']['force_z']['mean_n'] == pytest.approx(
                -20.0 * 9.8, rel=0.05)
        else:
            assert found['residual_rms_n'] == 0.0


def all_of(folder: Path) -> dict[str, bytes]:
    """Return the content of the output bag and of the table of a replay."""
    return {name: (folder / name).read_bytes() for name in ('bag/bag.mcap', 'legs.csv')}


@pytest.mark.parametrize('given, options', [
    *(({'base.source': source, **MOUNTING}, ()) for source in MOVING),
    ({'setpoint.source': 'pose'}, ()), ({'setpoint.source': 'combined'}, ()),
    ({}, ('--differentiate',)), ({'setpoint.sync_tolerance': 0.001}, ('--pose', '/mine'))])
def test_the_output_bag_gives_the_same_output_bag(
        given: dict[str, Any], options: tuple[str, ...], tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch) -> None:
    """The setpoints in it, with base and wrench, some of them rejected, under other names."""
    parameters = PARAMETERS.replaced(given)
    of = at_sea(given.get('base.source', 'motion'))
    of = [*of[:300], *of[290:]]  # some are there twice
    if given.get('setpoint.source') == 'combined':
        of = [(COMBINED, RECORDED + n * MS, messages.combined(n * MS)) for n in range(1, 400)]
    of = sorted([
        *of, *((WRENCH, RECORDED + n * 100 * MS + 1,
                messages.wrench(0, (n, 2.0, 3.0, 4.0, 5.0, 6.0))) for n in range(20)),
        (POSE, RECORDED + 150 * MS, messages.pose(150 * MS)[:40]),
        (POSE, RECORDED + 170 * MS, messages.pose(150 * MS, (math.nan, 0.0, 1.0)))],
        key=lambda each: each[1])
    if '/mine' in options:
        of = [('/mine' if topic == POSE else topic, time, data) for topic, time, data in of]
    bag = write_bag(tmp_path / 'bag', of, **TYPES, mine=INPUT_TYPES[POSE])
    if '/mine' in options:
        monkeypatch.setattr(one_bag, '_LARGE', 0)  # written by a process of its own
    first = run(bag, parameters, tmp_path, *options, code=None).code
    monkeypatch.undo()
    assert first in (DONE, LIMIT_MET)
    again = tmp_path / 'again'
    run(tmp_path / 'out' / 'bag' / 'bag', parameters, again,
        *(each for each in options if each == '--differentiate'), code=first)
    assert summary_of(tmp_path)['setpoints'] == summary_of(again)['setpoints']
    assert all_of(tmp_path / 'out' / 'bag') == all_of(again / 'out' / 'bag')
