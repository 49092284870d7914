# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The replay: bags and tables as read by other programs, and every exit code."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
import csv
import io
import json
import math
from pathlib import Path
import re
import signal
import subprocess
import sys
import threading
import time
from types import FrameType
from typing import Any, NamedTuple

from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from mcap_ros2.decoder import DecoderFactory
import messages
from messages import (
    JOINT_STATE, motion, MS, RECORDED, Recorded, SECOND, STORE, UPRIGHT, write_bag)
import numpy as np
from programs import call, Ended, run_program
import pyarrow.parquet
import pytest
from referees import ROOT
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin
from scipy.spatial.transform import Rotation

from snapshot import Snapshot
import stewart_dynamics
from stewart_dynamics import BagError, Motion, Parameters, Pose, StewartPlatform
from stewart_dynamics.description.model import JOINT_STATES, TF
from stewart_dynamics.legs import TELESCOPIC
from stewart_dynamics.mechanics.dynamics.force_breakdown import SOURCES
from stewart_dynamics.mechanics.frames.motion import motion_rows
from stewart_dynamics.mechanics.frames.rotation import from_quaternion
from stewart_dynamics.mechanics.kinematics.leg_clearance import LegClearance
from stewart_dynamics.program import BAD_INPUT, DONE, INTERRUPTED, PARTLY_READ
from stewart_dynamics.replay import main
from stewart_dynamics.replay.one_bag import replay, Replayed
from stewart_dynamics.replay.output_bag import (
    RECORDED_TYPES, RecordedModel, ROBOT_DESCRIPTION, TF_STATIC)
from stewart_dynamics.replay.replay_options import LIMIT_MET, NODE
from stewart_dynamics.replay.summary import Summary
from stewart_dynamics.setpoints.input_messages import (
    ACCEL, COMBINED, INPUT_TYPES, POSE, TWIST, WRENCH)
from stewart_dynamics.setpoints.output_messages import output_types
from stewart_dynamics.setpoints.rejections import MALFORMED, NOT_FINITE, NOT_JOINED, TOO_OLD, TWICE
from stewart_dynamics.whole_file import to_json
from test_recording import write_ros_1

PROGRAM = 'stewart_replay'

PARAMS = ROOT / 'config' / 'platform.yaml'
OUTPUT_TYPES = output_types(TELESCOPIC)
PARAMETERS = Parameters.from_yaml(PARAMS)
PLATFORM = StewartPlatform(PARAMETERS)
BAGS = ('clear', 'singular', 'flawed')
TOPICS = (POSE, TWIST, ACCEL)

Rejected = Callable[..., str]


class Outputs(NamedTuple):
    """Outputs of a replay, as the independent reader of MCAP gives them."""

    messages: dict[str, list[tuple[int, Any]]]
    """Of each topic: record times and messages."""
    rows: list[dict[str, str]]
    """Of legs.csv."""
    folder: Path


def arguments(bag: Path, folder: Path, *options: str, params: Path = PARAMS) -> list[str]:
    return [str(bag), *options, '--params', str(params), '--output', str(folder)]


def run(bag: Path, folder: Path, *options: str, params: Path = PARAMS, report: bool = False,
        code: int | None = DONE) -> Ended:
    """Run the program in this process; options may begin with more bags."""
    plain = () if report else ('--no-report',)
    return call(main, *arguments(bag, folder, *options, *plain, params=params), code=code)


def decoded(bag: Path) -> list[tuple[str, int, Any]]:
    """Return a bag's messages as mcap and its own decoder read them: topic, time, message."""
    with bag.open('rb') as file:
        return [(channel.topic, message.log_time, of) for _, channel, message, of in make_reader(
            file, decoder_factories=[DecoderFactory()]).iter_decoded_messages()]


def rows_of(folder: Path) -> list[dict[str, str]]:
    with (folder / 'legs.csv').open(newline='', encoding='utf-8') as file:
        return list(csv.DictReader(file))


def forces_of(rows: Iterable[dict[str, str]]) -> list[list[float]]:
    return [[float(row[f'{leg}_force_n']) for leg in PARAMETERS['joints']] for row in rows]


def summary_of(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / 'summary.json').read_text(encoding='utf-8'))
    return found


def outputs_of(folder: Path) -> Outputs:
    found: dict[str, list[tuple[int, Any]]] = defaultdict(list)
    for topic, when, message in decoded(folder / 'bag' / 'bag.mcap'):
        found[topic].append((when, message))
    return Outputs(found, rows_of(folder), folder)


def recorded(bag: Path) -> list[Recorded]:
    """Return a bag's messages as mcap reads them: topic, time, bytes."""
    with bag.open('rb') as file:
        return [(channel.topic.removeprefix(f'{NODE}/'), message.log_time, message.data)
                for _, channel, message in make_reader(file).iter_messages()]


def nanoseconds(message: Any) -> int:
    return int(message.header.stamp.sec) * SECOND + int(message.header.stamp.nanosec)


def heave(number: int) -> Motion:
    """Return the same as the library's motion."""
    t = [0.01 * n for n in range(1, number + 1)]
    return Motion([(0.0, 0.0, 1.1 + 0.05 * math.sin(each)) for each in t], np.eye(3),
                  [(0.0, 0.0, 0.05 * math.cos(each)) for each in t], None,
                  [(0.0, 0.0, -0.05 * math.sin(each)) for each in t])


def at_home(stamp: int, when: int) -> list[Recorded]:
    """Return one setpoint at rest."""
    return [(topic, when, write(stamp)) for topic, write in (
        (POSE, messages.pose), (TWIST, messages.twist), (ACCEL, messages.accel))]


@pytest.fixture(scope='module')
def replayed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Outputs]:
    """Return what a replay of the repository's bags wrote."""
    folder = tmp_path_factory.mktemp('replayed') / 'made' / 'for us'
    call(main, *(str(ROOT / 'bags' / name) for name in BAGS), '--params', PARAMS, '--output',
         folder)
    return {name: outputs_of(folder / name) for name in BAGS}


def bag_file(name: str) -> Path:
    return ROOT / 'bags' / name / f'{name}.mcap'


def setpoints_of(name: str) -> dict[int, tuple[int, Any, Any, Any]]:
    """Return of each stamp that all topics have: last record time, pose, twist, accel."""
    of: dict[str, dict[int, tuple[int, Any]]] = defaultdict(dict)
    for topic, when, message in decoded(bag_file(name)):
        of[topic.removeprefix(f'{NODE}/')].setdefault(nanoseconds(message), (when, message))
    return {stamp: (max(of[topic][stamp][0] for topic in TOPICS),
                    of[POSE][stamp][1].pose, of[TWIST][stamp][1].twist, of[ACCEL][stamp][1].accel)
            for stamp in sorted(set.intersection(*(set(of[topic]) for topic in TOPICS)))}


def three(vector: Any) -> list[float]:
    return [vector.x, vector.y, vector.z]


def six_of(message: Any) -> list[float]:
    """Return the numbers of a WrenchStamped."""
    return [*three(message.wrench.force), *three(message.wrench.torque)]


def library_motion(name: str) -> Motion:
    """Return a bag's motion, read and put together without the package's joining."""
    parts = [(three(p.position), [p.orientation.x, p.orientation.y, p.orientation.z,
                                  p.orientation.w],
              three(t.linear), three(t.angular), three(a.linear), three(a.angular))
             for _, p, t, a in setpoints_of(name).values()]
    position, quaternion, *rates = (np.array(part) for part in zip(*parts, strict=True))
    rotation = [from_quaternion(*(np.array(q) / math.sqrt(
        q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])).tolist()) for q in quaternion]
    assert np.allclose(np.reshape(rotation, (-1, 3, 3)),
                       Rotation.from_quat(quaternion).as_matrix(), rtol=0, atol=3e-15)
    return Motion(position, np.reshape(rotation, (-1, 3, 3)), *rates)


# Outputs

@pytest.mark.parametrize('name', BAGS)
def test_the_bag_has_the_topics_and_types_of_the_node(
        name: str, replayed: dict[str, Outputs]) -> None:
    with AnyReader([replayed[name].folder / 'bag']) as reader:
        assert {c.topic: c.msgtype for c in reader.connections} == {
            **{f'{NODE}/{topic}': kind for topic, kind in OUTPUT_TYPES.items()},
            **{f'{NODE}/{topic}': INPUT_TYPES[topic] for topic in (POSE, TWIST, ACCEL)},
            **{topic if topic.startswith('/') else f'{NODE}/{topic}': kind
               for topic, kind in RECORDED_TYPES.items()}}
    assert not list(replayed[name].folder.parent.glob('.*'))


@pytest.mark.parametrize('name', ['clear', 'singular'])
def test_every_setpoint_is_answered_as_the_library_does(
        name: str, replayed: dict[str, Outputs]) -> None:
    given, outputs = setpoints_of(name), replayed[name]
    result = PLATFORM.inverse_dynamics(library_motion(name))
    base_wrenches = PLATFORM.base_wrench(library_motion(name))
    assert len(given) == len(outputs.rows) == 1001
    of = {topic: outputs.messages[f'{NODE}/{topic}'] for topic in OUTPUT_TYPES}
    assert all(len(of[topic]) == 1001 for topic in of if topic != 'singularity_warning')
    bound = PARAMETERS['limits.force_max']
    clipped = np.clip(result.forces, -bound, bound)
    for n, (stamp, (when, *_)) in enumerate(given.items()):
        # the input's stamp and time of recording
        state = of['leg_states'][n][1]
        assert nanoseconds(state) == stamp
        assert {of[topic][n][0] for topic in (
            'leg_states', 'leg_lengths', 'leg_forces', 'jacobian_determinant',
            'base_wrench')} == {when}
        # the library's numbers, to the bit
        assert tuple(state.name) == PARAMETERS['joints']
        assert np.array_equal(
            state.position, result.lengths[n] - PARAMETERS['geometry.zero_length'])
        assert np.array_equal(state.velocity, result.rates[n])
        assert np.array_equal(state.effort, clipped[n])
        assert np.array_equal(of['leg_lengths'][n][1].data, result.lengths[n])
        assert np.array_equal(of['leg_forces'][n][1].data, clipped[n])
        assert of['jacobian_determinant'][n][1].data == result.determinant[n]
        load = of['base_wrench'][n][1]
        assert nanoseconds(load) == stamp
        assert load.header.frame_id == PARAMETERS['base_frame']
        assert six_of(load) == base_wrenches[n].tolist()


@pytest.mark.parametrize('name', ['clear', 'singular'])
def test_the_bag_shows_the_hexapod_as_a_model(name: str, replayed: dict[str, Outputs]) -> None:
    given, model = setpoints_of(name), RecordedModel(PARAMETERS, 'stewart_dynamics')
    written = dict(model.write_motions(np.array([*given]), library_motion(name).rows))
    whens = [when for when, *_ in given.values()]
    of = recorded(replayed[name].folder / 'bag' / 'bag.mcap')
    joints = {when: data for topic, when, data in of if topic == JOINT_STATES}
    assert 240 < len(joints) < 305  # in 10 s, at most 30 in a second, of setpoints at 100 Hz
    assert np.diff([*joints]).min() >= SECOND // 30
    for topic in (JOINT_STATES, TF):
        expected = dict(zip(whens, map(bytes, written[topic]), strict=True))
        found = {when: data for each, when, data in of if each == topic}
        assert found == {when: expected[when] for when in joints}
    first = min(when for topic, when, _ in of if 'setpoint/' not in topic)
    for topic in (TF_STATIC, ROBOT_DESCRIPTION):
        assert [when for each, when, _ in of if each == topic] == [first]
    with AnyReader([replayed[name].folder / 'bag']) as reader:
        latched = {each.topic for each in reader.connections for qos in
                   each.ext.offered_qos_profiles if qos.durability.name == 'TRANSIENT_LOCAL'}
    assert latched == {TF_STATIC, ROBOT_DESCRIPTION, f'{NODE}/singularity_warning'}


@pytest.mark.parametrize('name', BAGS)
def test_the_table_has_the_same_numbers_exactly(
        name: str, replayed: dict[str, Outputs]) -> None:
    outputs = replayed[name]
    of = {topic: outputs.messages[f'{NODE}/{topic}'] for topic in OUTPUT_TYPES}
    zero = PARAMETERS['geometry.zero_length']
    for n, row in enumerate(outputs.rows):
        state = of['leg_states'][n][1]
        assert int(row['stamp_ns']) == nanoseconds(state)

        def six(quantity: str, row: dict[str, str] = row) -> list[float]:
            return [float(row[f'{leg}_{quantity}']) for leg in PARAMETERS['joints']]

        assert six('length_m') == list(of['leg_lengths'][n][1].data)
        assert np.array_equal(np.array(six('length_m')) - zero, state.position)
        assert six('rate_m_s') == list(state.velocity)
        assert six('force_n') == list(state.effort) == list(of['leg_forces'][n][1].data)
        assert float(row['determinant_m3']) == of['jacobian_determinant'][n][1].data
        assert all(len(text) <= len(repr(float(text))) + 1 for text in row.values())


@pytest.mark.parametrize('name', ['clear', 'singular'])
def test_the_table_has_what_no_topic_has(name: str, replayed: dict[str, Outputs]) -> None:
    rows, motion = replayed[name].rows, library_motion(name)
    result = PLATFORM.inverse_dynamics(motion)
    first = int(rows[0]['stamp_ns'])
    for n, row in enumerate(rows):
        assert [float(row[f'{leg}_demanded_force_n'])
                for leg in PARAMETERS['joints']] == result.forces[n].tolist()
        assert float(row['determinant_rate_m3_s']) == result.determinant_rate[n]
        assert float(row['condition']) == result.condition_number[n]
        assert float(row['time_s']) == pytest.approx((int(row['stamp_ns']) - first) * 1e-9)
        assert [float(row[f'position_{axis}_m']) for axis in 'xyz'] == motion.position[n].tolist()
        quaternion = np.array([float(row[f'orientation_{part}']) for part in 'xyzw'])
        assert Rotation.from_quat(quaternion).as_matrix() == pytest.approx(
            motion.rotation[n], abs=1e-12)


def test_the_warning_is_written_at_every_change(replayed: dict[str, Outputs]) -> None:
    topic = f'{NODE}/singularity_warning'
    assert [m.data for _, m in replayed['clear'].messages[topic]] == [False]
    of = replayed['singular']
    assert [m.data for _, m in of.messages[topic]] == [False, True]
    column = [row['warning'] for row in of.rows]
    first = column.index('1')
    assert column == ['0'] * first + ['1'] * (1001 - first)
    assert of.messages[topic][1][0] == of.messages[f'{NODE}/leg_states'][first][0]
    # it comes before the sign of det(J) changes
    signs = np.sign([float(row['determinant_m3']) for row in of.rows])
    change = int(np.flatnonzero(signs[1:] != signs[:-1])[0])
    assert first < change - 10


# The flawed bag

def expected_of(name: str) -> tuple[list[int], Counter[tuple[str, str]]]:
    """Return stamps answered and rejections, by an independent form of the rules of bad input."""
    sound: dict[str, list[int]] = {topic: [] for topic in TOPICS}
    expected: Counter[tuple[str, str]] = Counter()
    answered: list[int] = []
    for topic, _, data in recorded(bag_file(name)):
        message = STORE.deserialize_cdr(data, INPUT_TYPES[topic])
        body = getattr(message, topic.rpartition('/')[2])
        numbers = [getattr(v, axis) for v in vars(body).values() if hasattr(v, 'x')
                   for axis in 'xyzw' if hasattr(v, axis)]
        stamp = nanoseconds(message)
        if not np.all(np.isfinite(numbers)):
            expected[topic, NOT_FINITE] += 1
        elif answered and stamp < answered[-1]:
            expected[topic, TOO_OLD] += 1
        elif stamp in sound[topic]:
            expected[topic, TWICE] += 1
        else:
            sound[topic].append(stamp)
            if all(stamp in sound[other] for other in TOPICS):
                answered.append(stamp)
    for topic in TOPICS:
        expected[topic, NOT_JOINED] = len(set(sound[topic]) - set(answered))
    return answered, +expected


def rejections(result: Replayed) -> dict[tuple[str, str], int]:
    return {(each.topic, each.reason): each.count
            for each in result.summary.rejected}


def test_the_flaws_are_counted_as_they_are_in_the_bag(tmp_path: Path) -> None:
    result = replay(ROOT / 'bags' / 'flawed', PARAMETERS, tmp_path / 'flawed')
    answered, expected = expected_of('flawed')
    assert rejections(result) == expected
    assert [int(row['stamp_ns']) for row in rows_of(tmp_path / 'flawed')] == answered
    # every message of the bag is in a setpoint or in a count
    held = Counter(topic for topic, _, _ in recorded(bag_file('flawed')))
    for topic in TOPICS:
        assert held[topic] == len(answered) + sum(
            n for (of, _), n in rejections(result).items() if of == topic)
    reasons = {reason for _, reason in rejections(result)}
    assert reasons == {NOT_FINITE, TOO_OLD, TWICE, NOT_JOINED}


def test_the_flawed_bag_gives_the_numbers_of_the_whole_one(
        replayed: dict[str, Outputs]) -> None:
    # the same motion, recorded at other times: its columns at t since the start are the same
    def by_time(name: str) -> dict[int, list[str]]:
        rows = replayed[name].rows
        first = min(int(row['stamp_ns']) for row in rows)
        return {int(row['stamp_ns']) - first: list(row.values())[2:33] for row in rows}

    flawed, clear = by_time('flawed'), by_time('clear')
    assert len(flawed) > 900
    offset = next(o for o in range(0, 100 * MS, 10 * MS) if flawed[0] == clear.get(o))
    assert all(clear[when + offset] == row for when, row in flawed.items())


def test_setpoints_incomplete_at_the_end_are_counted(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'bag', motion(10)[:-2] + [(POSE, RECORDED + SECOND, b'\0\1')])
    result = replay(bag, PARAMETERS, tmp_path / 'out')
    assert rejections(result) == {(POSE, NOT_JOINED): 1, (POSE, MALFORMED): 1}
    assert result.summary.setpoints.answered == 9


# Other bags

def test_a_wrench_in_the_bag_is_used(tmp_path: Path) -> None:
    load = (10.0, -20.0, 300.0, 4.0, -5.0, 6.0)
    of = motion(20)
    at = 3 * 10
    of.insert(at, (WRENCH, of[at][1] - 1, messages.wrench(0, load)))
    run(write_bag(tmp_path / 'loaded', of), tmp_path / 'out')
    forces = forces_of(rows_of(tmp_path / 'out' / 'loaded'))
    free = PLATFORM.inverse_dynamics(heave(20)).forces
    loaded = PLATFORM.inverse_dynamics(heave(20), load).forces
    assert np.array_equal(forces[:10], free[:10])
    assert np.array_equal(forces[10:], loaded[10:])
    assert np.min(np.max(np.abs(free - loaded), axis=1)) > 10.0


def parameter_file(folder: Path, text: str) -> Path:
    file = folder / 'platform.yaml'
    file.write_text(PARAMS.read_text(encoding='utf-8') + f'\n    {text}\n', encoding='utf-8')
    return file


def test_a_combined_bag_gives_the_numbers_of_the_separate_one(tmp_path: Path) -> None:
    separate = write_bag(tmp_path / 'separate', motion(30))
    combined = write_bag(tmp_path / 'combined', [
        (COMBINED, RECORDED + n * 10 * MS, messages.combined(
            n * 10 * MS, (0.0, 0.0, 1.1 + 0.05 * math.sin(0.01 * n)), UPRIGHT,
            (0.0, 0.0, 0.05 * math.cos(0.01 * n), 0, 0, 0),
            (0.0, 0.0, -0.05 * math.sin(0.01 * n), 0, 0, 0), names=['élan']))
        for n in range(1, 31)])
    params = parameter_file(tmp_path, 'setpoint: {source: combined}')
    run(separate, tmp_path / 'out')
    run(combined, tmp_path / 'out', params=params)
    assert rows_of(tmp_path / 'out' / 'combined') == rows_of(tmp_path / 'out' / 'separate')


def test_a_bag_of_poses_is_quasi_static(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'poses', motion(30)[::3])
    params = parameter_file(tmp_path, 'setpoint: {source: pose}')
    run(bag, tmp_path / 'out', params=params, report=True)
    still = PLATFORM.inverse_dynamics(Motion(heave(30).position, np.eye(3)))
    rows = rows_of(tmp_path / 'out' / 'poses')
    assert forces_of(rows) == still.forces.tolist()
    # values that depend on velocities are not known, and not zero
    assert {row[f'{leg}_rate_m_s'] for row in rows for leg in PARAMETERS['joints']} == {''}
    assert {row['determinant_rate_m3_s'] for row in rows} == {''}
    for options, code in (((), LIMIT_MET), (('--differentiate', '--cutoff', '5'), DONE)):
        text = run(bag, tmp_path / f'{code}', '--strict', *options, params=params, code=code).out
        assert ('limits.velocity_max could not be checked' in text) is (code == LIMIT_MET)
        assert ('within all limits' in text) is (code == DONE)


def test_control_characters_in_names_are_escaped(tmp_path: Path) -> None:
    hostile = '/a\x1b[2J\rb'
    bag = write_bag(tmp_path / 'bag', [*motion(3), (hostile, RECORDED, messages.wrench(0))],
                    **{hostile[1:]: INPUT_TYPES[WRENCH]})
    text = run(bag, tmp_path / 'out').out
    assert '/a\\x1b[2J\\rb' in text
    assert not set(text) & {'\x1b', '\r'}


def test_a_bag_of_sqlite_gives_the_same(tmp_path: Path) -> None:
    for plugin in (StoragePlugin.MCAP, StoragePlugin.SQLITE3):
        bag = write_bag(tmp_path / plugin.name, motion(30), plugin=plugin)
        run(bag, tmp_path / 'out')
    # and without its metadata, by the file alone
    run(tmp_path / 'SQLITE3' / 'SQLITE3.db3', tmp_path / 'alone')
    mcap, sqlite, alone = (outputs_of(folder) for folder in (
        tmp_path / 'out' / 'MCAP', tmp_path / 'out' / 'SQLITE3', tmp_path / 'alone' / 'SQLITE3'))
    assert len(mcap.rows) == 30
    assert mcap.rows == sqlite.rows == alone.rows
    times = [[when for when, _ in of.messages[f'{NODE}/leg_states']]
             for of in (mcap, sqlite, alone)]
    assert times[0] == times[1] == times[2] == [
        RECORDED + n * 10 * MS + 2 for n in range(1, 31)]


def test_setpoints_without_stamps_are_stamped_as_they_were_recorded(tmp_path: Path) -> None:
    times = [RECORDED + n * 10 * MS for n in range(5)]
    bag = write_bag(tmp_path / 'bag', [each for when in times for each in at_home(0, when)])
    run(bag, tmp_path / 'out')
    assert [int(row['stamp_ns']) for row in rows_of(tmp_path / 'out' / 'bag')] == times


def test_a_time_out_of_range_of_a_stamp_is_counted(tmp_path: Path) -> None:
    late = 2 ** 31 * SECOND
    bag = write_bag(tmp_path / 'bag', [*at_home(0, late - 1), *at_home(0, late)])
    assert 'setpoint: 1 rejected: out of range' in run(bag, tmp_path / 'out').out
    assert len(rows_of(tmp_path / 'out' / 'bag')) == 1


def test_a_bag_that_loops_is_followed_with_a_notice(tmp_path: Path) -> None:
    lap = motion(50)
    bag = write_bag(tmp_path / 'bag', lap + [(t, when + SECOND, d) for t, when, d in lap])
    printed = run(bag, tmp_path / 'out').out
    assert printed.count('followed as a restart') == 1
    assert 'rejected' not in printed
    assert '100 setpoints in 0.98 s, 1 restart' in printed
    assert len(rows_of(tmp_path / 'out' / 'bag')) == 100


def test_a_restart_that_cannot_be_answered_is_that_of_the_next_setpoint(tmp_path: Path) -> None:
    day, of = 86400 * SECOND, []
    for n, (stamp, x) in enumerate([(day, 0.0), (MS, 1e200), (2 * MS, 0.0)]):
        when = RECORDED + n * MS
        of += [('setpoint/pose', when, messages.pose(stamp, (x, 0.0, 1.1))),
               ('setpoint/twist', when, messages.twist(stamp)),
               ('setpoint/accel', when, messages.accel(stamp))]
    run(write_bag(tmp_path / 'bag', of), tmp_path / 'out')
    found = summary_of(tmp_path / 'out' / 'bag')['setpoints']
    assert (found['answered'], found['restarts']) == (2, 1)


def test_another_name_of_the_node(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'bag', motion(5), node='/cell/hexapod')
    run(bag, tmp_path / 'out', '--node', 'cell/hexapod')
    assert set(outputs_of(tmp_path / 'out' / 'bag').messages) == {
        TF, TF_STATIC, ROBOT_DESCRIPTION,
        *(f'/cell/hexapod/{topic}' for topic in (
            *OUTPUT_TYPES, JOINT_STATES, POSE, TWIST, ACCEL))}


def test_poses_that_cannot_be_solved_have_no_forces(tmp_path: Path) -> None:
    # the platform's joints in the plane of the base's
    of = [(topic, when, messages.pose(20 * MS, (0.0, 0.0, 0.0))
           if topic == POSE and when == RECORDED + 20 * MS else data)
          for topic, when, data in motion(3)]
    run(write_bag(tmp_path / 'bag', of), tmp_path / 'out')
    outputs = outputs_of(tmp_path / 'out' / 'bag')
    assert [row['leg_1_force_n'] != '' for row in outputs.rows] == [True, False, True]
    assert all(outputs.rows[1][f'leg_{leg}_demanded_force_n'] == '' for leg in range(1, 7))
    assert len(outputs.messages[f'{NODE}/leg_forces']) == 2
    assert [len(m.effort) for _, m in outputs.messages[f'{NODE}/leg_states']] == [6, 0, 6]


def test_a_bag_with_z_down_begins_beyond_a_singularity(tmp_path: Path) -> None:
    of = [(topic, when,
           messages.pose(when - RECORDED, (0.0, 0.0, -1.1)) if topic == POSE else data)
          for topic, when, data in motion(2)]
    printed = ' '.join(run(write_bag(tmp_path / 'bag', of), tmp_path / 'out').out.split())
    assert 'the motion begins beyond a singularity; possible error' in printed
    assert [each['topic'] for each in summary_of(tmp_path / 'out' / 'bag')['mistakes']] == [POSE]


# Exit codes

def test_a_bag_without_answers_is_reported(tmp_path: Path) -> None:
    cut = [(topic, when, data[:-1]) for topic, when, data in motion(3)]
    bag = write_bag(tmp_path / 'bag', cut)
    # nothing was checked: that must not pass as done
    printed = run(bag, tmp_path / 'out', code=PARTLY_READ).out
    assert 'no setpoint could be answered' in printed
    for topic in TOPICS:
        assert f'{topic}: 3 rejected: {MALFORMED}' in printed
    assert not rows_of(tmp_path / 'out' / 'bag')


@pytest.mark.parametrize(('name', 'options', 'code'), [
    ('clear', ('--strict',), DONE), ('singular', (), DONE),
    ('singular', ('--strict',), LIMIT_MET)])
def test_strict_exits_with_1_at_limits_and_warnings(
        name: str, options: tuple[str, ...], code: int, tmp_path: Path) -> None:
    printed = run(ROOT / 'bags' / name, tmp_path, *options, code=code)
    assert '1001 setpoints in 10.00 s' in printed.out
    assert ('crossed zero at t = 8.4' in printed.out) == (name == 'singular')
    assert not printed.err
    assert (tmp_path / name / 'legs.csv').exists()


def test_strict_exits_with_1_at_a_limit_without_a_warning(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'bag', motion(3))
    params = tmp_path / 'platform.yaml'
    PARAMETERS.replaced({'limits.force_max': 100.0}).to_yaml(params)
    run(bag, tmp_path / 'out', '--strict', params=params, code=LIMIT_MET)
    assert np.all(np.abs(forces_of(rows_of(tmp_path / 'out' / 'bag'))) == 100.0)


def test_twists_that_are_not_those_of_the_poses_are_no_motion_that_holds_all_limits(
        tmp_path: Path, snapshot: Snapshot) -> None:
    """Twists and accelerations that are never filled."""
    empty = {TWIST: messages.twist, ACCEL: messages.accel}
    given = [(topic.removeprefix(f'{NODE}/'), when, message)
             for topic, when, message in decoded(bag_file('clear'))]
    whole = {(topic, when): data for topic, when, data in recorded(bag_file('clear'))}
    bag = write_bag(tmp_path / 'bag', (
        (topic, when, empty[topic](nanoseconds(message)) if topic in empty
         else whole[topic, when]) for topic, when, message in given if topic in TOPICS))
    run(bag, tmp_path / 'out')
    strict = run(bag, tmp_path / 'strict', '--strict', code=LIMIT_MET)
    printed = ' '.join(strict.out.split())  # without line breaks
    assert 'within all limits' not in printed
    assert 'no limit was met by inputs that contradict each other' in printed
    found = summary_of(tmp_path / 'out' / 'bag')['mistakes']
    # accelerations are too small to matter
    assert {each['topic'] for each in found} == {TWIST}
    for each in found:
        snapshot(each['text'])
        assert f'{each["topic"]}: {each["text"]}' in printed


@pytest.fixture
def rejected(tmp_path: Path) -> Rejected:
    """Return a function that gives the one line printed for a bag; the code is 2, no results."""
    def given(bag: Path, *options: object, params: Path = PARAMS,
              output: Path = tmp_path / 'rejected') -> str:
        def found() -> list[Any]:
            # all but the time of the last access, which looking may change
            stats = ((path, path.stat()) for path in output.rglob('*'))
            return [output.exists(), *(
                (path, *at[:7], at.st_mtime_ns, at.st_ctime_ns) for path, at in stats)]

        before = found()
        printed = call(main, *arguments(bag, output, *map(str, options), params=params),
                       code=BAD_INPUT)
        assert not printed.out
        assert printed.err.count('\n') == 1
        assert printed.err.startswith('stewart_replay: ')
        assert found() == before
        return printed.err

    return given


def test_bad_bags_and_parameters_are_rejected_before_anything_is_written(
        tmp_path: Path, rejected: Rejected) -> None:
    """One of each kind; the modules that read bags and parameters test all of them."""
    clear, file, empty = ROOT / 'bags' / 'clear', tmp_path / 'file.mcap', tmp_path / 'empty'
    bad, none = tmp_path / 'bad.yaml', tmp_path / 'none'
    empty.mkdir()
    file.write_bytes(b'no bag')
    bad.write_text(PARAMS.read_text(encoding='utf-8').replace('mass: 150.0', 'mass: -1.0'))
    for bag, params, text in (
            (none, PARAMS, f'{none}'), (file, PARAMS, f'{file}'), (empty, PARAMS, f'{empty}'),
            (write_bag(tmp_path / 'bag', []), PARAMS, 'contains no topics'),
            (clear, bad, f'{bad}: platform.mass: -1.0 kg: must be more than 0'),
            (clear, none, f'{none}: cannot be read')):
        assert text in rejected(bag, params=params)


@pytest.mark.parametrize(('options', 'text'), [
    (['--params', 'y.yaml'], 'usage: stewart_replay'), (['--cutoff', '5'], '--cutoff'),
    (['--differentiate', '--cutoff', '1e300'], '--cutoff'),
    *((['--node', name], 'not a valid node name') for name in ('', '/', 'a b', '1st', 'a//b'))])
def test_bad_arguments(options: list[str], text: str, tmp_path: Path) -> None:
    assert text in run(ROOT / 'bags' / 'clear', tmp_path, *options, code=BAD_INPUT).err


def test_a_missing_topic_lists_the_topics_of_the_bag(
        tmp_path: Path, rejected: Rejected, snapshot: Snapshot) -> None:
    bag = write_bag(tmp_path / 'bag', motion(3)[:2])
    text = rejected(bag)
    snapshot(text)
    snapshot(rejected(bag, '--node', 'x'))


@pytest.mark.parametrize('topic', [*TOPICS, WRENCH])
def test_a_topic_of_another_type(
        topic: str, tmp_path: Path, rejected: Rejected, snapshot: Snapshot) -> None:
    of = [*motion(1), (WRENCH, RECORDED + SECOND, messages.wrench(0))]
    bag = write_bag(tmp_path / 'bag', of, **{
        topic.rpartition('/')[2]: 'geometry_msgs/msg/PointStamped'})
    snapshot(rejected(bag))


def test_a_bag_of_ros_1_gives_the_same(
        tmp_path: Path, rejected: Rejected, snapshot: Snapshot) -> None:
    of = motion(30)
    run(write_bag(tmp_path / 'bag', of), tmp_path / 'out')
    write_ros_1(tmp_path / 'old.bag', [
        (f'{NODE}/{topic}', when, data) for topic, when, data in of], None)
    run(tmp_path / 'old.bag', tmp_path / 'out')
    old, new = rows_of(tmp_path / 'out' / 'old'), rows_of(tmp_path / 'out' / 'bag')
    assert len(new) == 30
    assert old == new
    snapshot(rejected(tmp_path / 'old.bag', '--pose', '/none'))


def test_where_results_cannot_be_written_the_folder_is_named(
        tmp_path: Path, rejected: Rejected, snapshot: Snapshot) -> None:
    bag, file = write_bag(tmp_path / 'bag', motion(3)), tmp_path / 'file'
    file.touch()
    snapshot(rejected(bag, output=file / 'out'))
    snapshot(rejected(bag, output=file))


# Several bags

def test_bags_of_one_name_are_rejected_before_anything_is_written(
        tmp_path: Path, rejected: Rejected, snapshot: Snapshot) -> None:
    a, b = (write_bag(tmp_path / folder / 'x', motion(3)) for folder in ('a', 'b'))
    for second in (b, a, tmp_path / 'a' / '..' / 'a' / 'x', a / 'x.mcap'):
        snapshot(rejected(a, second, output=tmp_path / 'out'))


def test_a_point_in_a_name_is_no_suffix(tmp_path: Path) -> None:
    bags = [write_bag(tmp_path / name, motion(3)) for name in (
        'run_2024-05-01-12.00.01', 'run_2024-05-01-12.00.02')]
    run(bags[0], tmp_path / 'out', str(bags[1]))
    assert sorted(path.name for path in (tmp_path / 'out').iterdir()) == [
        'fleet.csv', 'index.html', *(bag.name for bag in bags)]


def test_a_bad_bag_is_reported_and_the_others_are_replayed(tmp_path: Path) -> None:
    one, two = (write_bag(tmp_path / name, motion(3)) for name in ('one', 'two'))
    printed = run(one, tmp_path / 'out', str(tmp_path / 'none'), str(two), code=BAD_INPUT)
    assert printed.out.count('3 setpoints') == 2
    assert str(tmp_path / 'none') in printed.err
    assert sorted(path.name for path in (tmp_path / 'out').iterdir()) == [
        'fleet.csv', 'index.html', 'one', 'two']


# Damaged bags

def chunked_bag(file: Path, number: int, chunk_size: int) -> Path:
    """Write a bag of setpoints in chunks of a size [bytes]."""
    with file.open('wb') as stream:
        writer = McapWriter(stream, chunk_size=chunk_size, compression=CompressionType.NONE)
        writer.start('ros2')
        channels = {}
        for topic in TOPICS:
            definition, _ = STORE.generate_msgdef(INPUT_TYPES[topic], ros_version=2)
            schema = writer.register_schema(INPUT_TYPES[topic], 'ros2msg', definition.encode())
            channels[topic] = writer.register_channel(f'{NODE}/{topic}', 'cdr', schema)
        for topic, when, data in motion(number):
            writer.add_message(channels[topic], when, data, when)
        writer.finish()
    return file


def damaged_bag(file: Path) -> Path:
    """Write a bag of 100 setpoints, and damage a byte of a chunk in the middle."""
    with chunked_bag(file, 100, 4000).open('rb') as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    chunks = summary.chunk_indexes
    assert len(chunks) > 5
    middle = chunks[len(chunks) // 2]
    content = bytearray(file.read_bytes())
    content[middle.chunk_start_offset + middle.chunk_length // 2] ^= 0x40
    file.write_bytes(content)
    return file


def test_the_rest_of_a_damaged_bag_is_replayed(tmp_path: Path, snapshot: Snapshot) -> None:
    bag = damaged_bag(tmp_path / 'damaged.mcap')
    printed = run(bag, tmp_path / 'out', code=PARTLY_READ)
    snapshot(printed.err)
    rows = rows_of(tmp_path / 'out' / 'damaged')
    assert 80 < len(rows) < 95
    run(write_bag(tmp_path / 'whole', motion(100)), tmp_path / 'out')
    expected = rows_of(tmp_path / 'out' / 'whole')
    lost = [n for n, row in enumerate(expected) if row not in rows]
    # only the messages in the chunk
    assert lost == list(range(lost[0], lost[-1] + 1))
    assert [row for row in expected if row in rows] == rows


@pytest.mark.parametrize('plugin', list(StoragePlugin))
def test_a_damaged_bag_never_crashes_the_replay(plugin: StoragePlugin, tmp_path: Path) -> None:
    bag = write_bag(tmp_path / 'bag', motion(60), plugin=plugin)
    file = next(path for path in bag.iterdir() if path.suffix in ('.mcap', '.db3'))
    whole = file.read_bytes()
    for n, at in enumerate(range(0, len(whole), len(whole) // 6)):
        file.write_bytes(whole[:at])
        done = run(bag, tmp_path / 'cut' / str(n), code=None)
        assert done.code in (BAD_INPUT, PARTLY_READ) and done.err.count('\n') == 1
        file.write_bytes(whole[:at] + bytes(b ^ 0xa5 for b in whole[at:at + 64])
                         + whole[at + 64:])
        assert run(bag, tmp_path / 'spoiled' / str(n), code=None).code in (
            DONE, BAD_INPUT, PARTLY_READ)


# In a process of its own

@pytest.mark.slow
def test_it_runs_as_a_program(tmp_path: Path, replayed: dict[str, Outputs]) -> None:
    done = run_program(
        sys.executable, '-m', 'stewart_dynamics.replay', *(ROOT / 'bags' / name for name in BAGS),
        '--params', PARAMS, '--output', tmp_path / 'out', '--strict', '--no-report',
        code=LIMIT_MET)
    assert done.err == ''
    assert done.out.count('setpoints in') == 3
    for name in BAGS:
        assert (tmp_path / 'out' / name / 'legs.csv').read_bytes() == (
            replayed[name].folder / 'legs.csv').read_bytes()


def test_the_results_are_readable_by_all(tmp_path: Path) -> None:
    run(ROOT / 'bags' / 'clear', tmp_path)
    for path in (tmp_path / 'clear', tmp_path / 'clear' / 'bag'):
        assert path.stat().st_mode & 0o777 == 0o755


def test_it_needs_no_ros() -> None:
    done = run_program(
        sys.executable, '-c', 'import sys, stewart_dynamics.replay; '
        'print([n for n in sys.modules if n.startswith(("rclpy", "rcl_interfaces", "rosidl", '
        '"geometry_msgs", "sensor_msgs", "std_msgs", "stewart_dynamics.node.dynamics_node")) '
        'or n == "stewart_dynamics.ros.run"])')
    assert done.out.strip() == '[]'


@pytest.fixture(scope='module')
def long_bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a bag that takes seconds, a part of one each chunk."""
    return chunked_bag(tmp_path_factory.mktemp('bags') / 'long.mcap', 120_000, 100_000)


def begun(bag: Path, out: Path) -> subprocess.Popen[str]:
    """Return a replay that is in the middle of its work."""
    process = subprocess.Popen(
        [sys.executable, '-m', 'stewart_dynamics.replay', *arguments(bag, out, '--no-report')],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 300.0
    while not any(path.stat().st_size for path in out.glob('.*/legs.csv')):
        assert time.monotonic() < end
        assert process.poll() is None
        time.sleep(0.005)
    return process


@pytest.mark.slow
def test_a_killed_replay_leaves_nothing_under_the_final_name(
        long_bag: Path, tmp_path: Path) -> None:
    with begun(long_bag, tmp_path / 'out') as process:
        process.send_signal(signal.SIGKILL)
        assert process.wait(300) == -signal.SIGKILL
    assert not (tmp_path / 'out' / 'long').exists()
    # its partial results do not prevent another replay
    run(ROOT / 'bags' / 'clear', tmp_path / 'out')
    # and are removed by that of a bag of the same name
    assert len(list((tmp_path / 'out').glob('.long.*'))) == 1
    run(chunked_bag(tmp_path / 'long.mcap', 100, 4000), tmp_path / 'out')
    assert not list((tmp_path / 'out').glob('.*'))


@pytest.mark.slow
@pytest.mark.parametrize('sent', [signal.SIGTERM, signal.SIGHUP], ids=['SIGTERM', 'SIGHUP'])
def test_an_interrupted_replay_leaves_nothing(
        long_bag: Path, tmp_path: Path, sent: signal.Signals, snapshot: Snapshot) -> None:
    """By SIGINT in test_fleet.py."""
    with begun(long_bag, tmp_path / 'out') as process:
        process.send_signal(sent)
        _, text = process.communicate(timeout=300)
        # Python itself dies of the signal where it comes while text is executed: 130 to a shell.
        assert process.returncode in (130, -signal.SIGINT)
    snapshot(text)
    assert not list((tmp_path / 'out').iterdir())


@pytest.mark.parametrize(('error', 'text'), [
    (MemoryError('Unable to allocate 3. GiB'), 'out of memory: Unable to allocate 3. GiB'),
    (MemoryError(), 'out of memory'),
    (ZeroDivisionError('by zero\nin two lines'), r'unexpected error, please report it: '
     r'ZeroDivisionError: by zero in two lines \(test_replay.py, line \d+\)')])
def test_unexpected_errors_are_one_line_and_leave_nothing(
        error: Exception, text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr(Summary, 'values', fail)
    out = tmp_path / 'out'
    for others in ([], [str(ROOT / 'bags' / 'flawed')]):
        lines = run(ROOT / 'bags' / 'clear', out, *others, code=BAD_INPUT).err.splitlines()
        assert len(lines) == 1 + len(others)
        for line in lines:
            assert re.fullmatch(f'stewart_replay: (.*: )?{text}', line)
        assert {path.name for path in out.iterdir()} <= {'fleet.csv', 'index.html'}


# As a library

def test_the_library_raises_what_the_program_prints(tmp_path: Path, snapshot: Snapshot) -> None:
    with snapshot.raises(BagError):
        replay(tmp_path / 'none', PARAMETERS, tmp_path / 'out')
    (tmp_path / 'there').mkdir()
    with snapshot.raises(BagError):
        replay(ROOT / 'bags' / 'clear', PARAMETERS, tmp_path / 'there')
    result = replay(ROOT / 'bags' / 'clear', PARAMETERS, tmp_path / 'out')
    assert (result.bag, result.code) == (ROOT / 'bags' / 'clear', DONE)
    assert result.summary.complete
    assert not result.summary.limit_met
    assert not rejections(result)
    assert summary_of(tmp_path / 'out') == json.loads(to_json(result.summary))


def test_joint_angles_clearance_and_joint_forces_are_in_the_results_where_they_have_limits(
        tmp_path: Path) -> None:
    platform = StewartPlatform(PARAMETERS.replaced({
        'limits.base_joint_angle_max': 0.5, 'limits.leg_clearance_min': 0.1,
        'limits.joint_force_max': 1e5,
        'legs.cylinder.radius': 0.05, 'legs.cylinder.length': 0.8, 'legs.piston.radius': 0.03}))
    file = tmp_path / 'hexapod.yaml'
    platform.parameters.to_yaml(file)
    text = run(ROOT / 'bags' / 'clear', tmp_path / 'out', '--strict', params=file, report=True,
               code=LIMIT_MET).out
    folder = tmp_path / 'out' / 'clear'
    rows = rows_of(folder)
    poses = Pose.from_quaternion(*(np.array(
        [[float(row[f'{name}_{axis}{unit}']) for axis in axes] for row in rows])
        for name, axes, unit in (('position', 'xyz', '_m'), ('orientation', 'xyzw', ''))))
    angles, _ = platform.joint_angles(poses)
    clearances = LegClearance(platform.parameters)(motion_rows(poses))
    summary = summary_of(folder)
    for leg, name in enumerate(PARAMETERS['joints']):
        of_leg = [float(row[f'{name}_base_joint_angle_rad']) for row in rows]
        np.testing.assert_allclose(of_leg, angles[:, leg], rtol=0.0, atol=1e-14)
        assert {row[f'{name}_platform_joint_angle_rad'] for row in rows} == {''}
        found = summary['legs'][name]
        assert found['base_joint_angle_max_rad'] == max(of_leg)
        assert found['platform_joint_angle_max_rad'] is None
        assert (name in [each['leg'] for each in summary['limits']
                         if 'joint' in each['limit']]) is (max(of_leg) > 0.5)
        clearance = [float(row[f'{name}_clearance_m']) for row in rows]
        np.testing.assert_allclose(clearance, clearances[:, leg], rtol=0.0, atol=1e-14)
        assert found['clearance_min_m'] == min(clearance)
        carried = [abs(float(row[f'{name}_joint_force_n'])) for row in rows]
        assert abs(found['joint_force_peak_n']) == max(carried)
    assert 'limits.base_joint_angle_max, 0.5 rad, exceeded by leg_4' in text
    assert 'clearance between legs: ' in text
    assert 'base joints: 0.5846 rad (33.5 deg) at most, leg_4 at t = 10.00 s; margin' in text
    assert 'platform joints:' not in text
    report = (folder / 'report.html').read_text(encoding='utf-8')
    assert 'Angles of the base joints' in report
    assert 'Angles of the platform joints' not in report
    assert 'Clearance between the legs' in report


# Topics under other names

def test_remapped_topics_are_found_by_their_type(tmp_path: Path) -> None:
    names = {POSE: '/cmd/where', TWIST: '/cmd/speed', ACCEL: '/cmd/push'}
    of = [(names[topic], when, data) for topic, when, data in motion(20)]
    bag = write_bag(tmp_path / 'bag', of, **{
        name.rpartition('/')[2]: INPUT_TYPES[topic] for topic, name in names.items()})
    run(bag, tmp_path / 'out')
    assert len(rows_of(tmp_path / 'out' / 'bag')) == 20
    assert summary_of(tmp_path / 'out' / 'bag')['inputs']['topics'] == names


def test_a_namespace_is_found_by_the_end_of_the_name(tmp_path: Path) -> None:
    of = [(f'/cell/{NODE}/{topic}', when, data) for topic, when, data in motion(20)]
    bag = write_bag(tmp_path / 'bag', [*of, ('/else/pose', RECORDED, messages.pose(0))])
    run(bag, tmp_path / 'out')
    assert len(rows_of(tmp_path / 'out' / 'bag')) == 20


def test_ambiguous_topics_are_listed_and_can_be_selected(
        tmp_path: Path, rejected: Rejected, snapshot: Snapshot) -> None:
    of = [('/a/where' if topic == POSE else topic, when, data)
          for topic, when, data in motion(20)]
    bag = write_bag(
        tmp_path / 'bag', [*of, ('/b/where', RECORDED, messages.pose(0, (0.0, 0.0, 1.2)))],
        where=INPUT_TYPES[POSE])
    snapshot(rejected(bag))
    run(bag, tmp_path / 'out', '--pose', '/a/where')
    assert len(rows_of(tmp_path / 'out' / 'bag')) == 20
    for topic, words in (('/none', 'has no topic /none; it contains /a/where (geometry'),
                         (f'{NODE}/{TWIST}', 'must be a geometry_msgs/msg/PoseStamped')):
        assert words in rejected(bag, '--pose', topic)


def test_a_wrench_is_never_found_by_its_type(tmp_path: Path) -> None:
    load = ('/cell/load', RECORDED, messages.wrench(0, (0.0, 0.0, -1000.0, 0, 0, 0)))
    bag = write_bag(tmp_path / 'bag', [load, *motion(5)], load=INPUT_TYPES[WRENCH])
    run(bag, tmp_path / 'free')
    run(bag, tmp_path / 'loaded', '--wrench', '/cell/load')
    free, loaded = (rows_of(tmp_path / name / 'bag')[0]['leg_1_force_n'] for name in (
        'free', 'loaded'))
    assert float(loaded) > float(free) + 100.0


def test_combined_by_its_option(tmp_path: Path, rejected: Rejected, snapshot: Snapshot) -> None:
    bag = write_bag(tmp_path / 'bag', [
        ('/cmd/all', RECORDED + n * MS, messages.combined(n * MS)) for n in range(1, 9)],
        all=INPUT_TYPES[COMBINED])
    snapshot(rejected(bag))
    snapshot(rejected(bag, '--differentiate', '--combined', '/all'))
    run(bag, tmp_path / 'out', '--combined', '/cmd/all')
    assert len(rows_of(tmp_path / 'out' / 'bag')) == 8


# Other files

def test_summary_and_report_are_written(replayed: dict[str, Outputs]) -> None:
    _, rows, folder = replayed['flawed']
    assert sorted(path.name for path in folder.iterdir()) == [
        'bag', 'legs.csv', 'report.html', 'summary.json']
    summary = summary_of(folder)
    assert summary['version'] == 1
    assert summary['complete']
    assert summary['setpoints']['answered'] == len(rows)
    for leg, found in summary['legs'].items():
        forces = np.array([float(row[f'{leg}_demanded_force_n']) for row in rows])
        assert abs(found['force_peak_n']) == np.max(np.abs(forces))
        lengths = [float(row[f'{leg}_length_m']) for row in rows]
        assert (found['length_min_m'], found['length_max_m']) == (min(lengths), max(lengths))
        rates = np.array([float(row[f'{leg}_rate_m_s']) for row in rows])
        assert abs(found['rate_peak_m_s']) == np.max(np.abs(rates))
    conditions = [float(row['condition']) for row in rows]
    assert summary['singularity']['condition_max'] == max(conditions)
    moments = [float(row['base_moment_y_n_m']) for row in rows]
    assert abs(summary['base_wrench']['moment_y']['peak_n_m']) == np.max(np.abs(moments))
    assert set(summary['force_breakdown']['leg_1']) == {*SOURCES} - {'base motion'}
    assert summary['parameters']['platform.mass'] == 150.0


def test_parquet_has_the_columns_and_numbers_of_csv(
        tmp_path: Path, replayed: dict[str, Outputs]) -> None:
    run(ROOT / 'bags' / 'singular', tmp_path, '--parquet')
    assert not (tmp_path / 'singular' / 'legs.csv').exists()
    table = pyarrow.parquet.read_table(tmp_path / 'singular' / 'legs.parquet')
    rows = replayed['singular'].rows
    assert table.column_names == list(rows[0])
    for name in table.column_names:
        values = table[name].to_pylist()
        assert values == [(int(row[name]) if 'stamp' in name else float(row[name]))
                          for row in rows]


def test_force_replaces_results_and_nothing_else(
        tmp_path: Path, rejected: Rejected, snapshot: Snapshot) -> None:
    clear = ROOT / 'bags' / 'clear'
    run(clear, tmp_path, report=True)
    for words in (f'{tmp_path / "clear"}: exists already', '--force replaces results'):
        assert words in rejected(clear, output=tmp_path)
    run(clear, tmp_path, '--force')
    assert sorted(path.name for path in (tmp_path / 'clear').iterdir()) == [
        'bag', 'legs.csv', 'summary.json']
    assert summary_of(tmp_path / 'clear')['force_breakdown'] is None
    assert [path.name for path in tmp_path.iterdir()] == ['clear']
    other = tmp_path / 'other' / 'clear'
    other.mkdir(parents=True)
    (other / 'thesis.tex').touch()
    snapshot(rejected(clear, '--force', output=other.parent))


def test_force_keeps_old_results_where_new_ones_fail(tmp_path: Path) -> None:
    run(write_bag(tmp_path / 'a' / 'bag', motion(5)), tmp_path / 'out')
    before = (tmp_path / 'out' / 'bag' / 'legs.csv').read_bytes()
    broken = tmp_path / 'b' / 'bag.mcap'
    broken.parent.mkdir()
    broken.write_bytes(b'no bag')
    run(broken, tmp_path / 'out', '--force', code=BAD_INPUT)
    assert (tmp_path / 'out' / 'bag' / 'legs.csv').read_bytes() == before


def test_clocks_that_differ_by_years_do_not_overflow(tmp_path: Path) -> None:
    of = []
    for n in range(1, 21):
        # two writers, of simulated and of real time
        stamp = n * 10 * MS + (n % 2) * 1_700_000_000 * SECOND
        of += at_home(stamp, RECORDED + n)
    run(write_bag(tmp_path / 'bag', of), tmp_path / 'out')
    found = summary_of(tmp_path / 'out' / 'bag')['setpoints']
    assert found['answered'] == 20
    assert found['duration_s'] == pytest.approx(9 * 1_700_000_000.0, rel=1e-6)


# A signal when the module that reads the arguments is looked for, and when the process ends.
@pytest.mark.parametrize('sent, when, code, text', [
    ('SIGTERM', "sys.meta_path.insert(0, type('Finder', (), {'find_spec': staticmethod(lambda "
     "name, *_: end() if name.endswith('replay_command_line') else None)}))", 130, 'interrupted'),
    ('SIGINT', 'atexit.register(end)', BAD_INPUT,
     'nowhere: not a bag that can be read: no such file or folder'),
    ('SIGHUP', "sys.meta_path.insert(0, type('Finder', (), {'find_spec': staticmethod(lambda "
     "name, *_: end() if name == 'argparse' else None)}))", 130, 'interrupted')])
def test_a_signal_at_the_start_or_end_is_no_traceback(
        sent: str, when: str, code: int, text: str, snapshot: Snapshot) -> None:
    done = run_program(sys.executable, '-c', 'import atexit, signal, sys\n'
                       f'def end():\n    signal.raise_signal(signal.{sent})\n'
                       f'from stewart_dynamics.replay import main\n{when}\nsys.exit(main())',
                       'nowhere', '--params', PARAMS, code=code)
    snapshot(done.err)


def test_an_interrupt_while_results_are_replaced_keeps_some(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run(ROOT / 'bags' / 'clear', tmp_path)
    rename, done = Path.rename, []

    def interrupted(path: Path, to: Path) -> Path:
        done.append(to)
        if len(done) == 2:
            raise KeyboardInterrupt
        return rename(path, to)

    monkeypatch.setattr(Path, 'rename', interrupted)
    run(ROOT / 'bags' / 'clear', tmp_path, '--force', code=INTERRUPTED)
    assert len(rows_of(tmp_path / 'clear')) == 1001
    assert [path.name for path in tmp_path.iterdir()] == ['clear']


def test_names_that_the_terminal_cannot_encode(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = io.TextIOWrapper(io.BytesIO(), encoding='ascii', write_through=True)
    monkeypatch.setattr(sys, 'stdout', terminal)
    assert main(arguments(write_bag(tmp_path / 'ü', motion(3)), tmp_path / 'out')) == DONE
    assert b'\\xfc:\n3 setpoints' in terminal.buffer.getvalue()


# Bags that have only poses

def test_poses_are_differentiated(tmp_path: Path, rejected: Rejected, snapshot: Snapshot) -> None:
    of = motion(400)
    bag = write_bag(tmp_path / 'bag', of[::3])
    snapshot(rejected(bag))
    printed = run(bag, tmp_path / 'out', '--differentiate', '--cutoff', '5').out
    assert 'smoothing splines through the poses, cut-off frequency 5 Hz' in printed
    run(write_bag(tmp_path / 'whole', of), tmp_path / 'out')
    made, whole = (rows_of(tmp_path / 'out' / name) for name in ('bag', 'whole'))
    assert [row['stamp_ns'] for row in made] == [row['stamp_ns'] for row in whole]
    # away from the ends as the twist and acceleration that were recorded
    for one, other in zip(made[50:-50], whole[50:-50], strict=True):
        assert float(one['leg_1_rate_m_s']) == pytest.approx(
            float(other['leg_1_rate_m_s']), abs=2e-5)
        assert float(one['leg_1_force_n']) == pytest.approx(
            float(other['leg_1_force_n']), abs=0.5)
    assert summary_of(tmp_path / 'out' / 'bag')['inputs']['differentiated_cutoff_hz'] == 5.0
    with AnyReader([tmp_path / 'out' / 'bag' / 'bag']) as reader:
        times = [when for connection, when, _ in reader.messages()
                 if connection.topic.endswith('leg_states')]
    assert times == [when for _, when, _ in of[::3]]


# Comparison with measured efforts

def test_measured_legs_that_are_not_compared_are_a_notice(tmp_path: Path) -> None:
    of = motion(5)
    own = dict.fromkeys(('leg_states', 'joint_states', 'motor_states'), JOINT_STATE)
    for topic in ('/hexapod/state', *own):
        of.insert(0, (topic, RECORDED, messages.joint_state(
            0, PARAMETERS['joints'], [], [], [0.0] * 6)))
    bag = write_bag(tmp_path / 'bag', of, state=JOINT_STATE, **own)
    expected = ('/hexapod/state: not used; --measured compares the efforts of measured legs with '
                'the computed forces')
    for options, given in (((), [expected]), (('--measured', '/hexapod/state'), [])):
        run(bag, tmp_path / 'out', '--force', *options, code=None)
        notices = summary_of(tmp_path / 'out' / 'bag')['notices']
        assert [each for each in notices if '--measured' in each] == given


def test_measured_forces_give_the_external_load(tmp_path: Path) -> None:
    load = np.array([30.0, -10.0, -200.0, 5.0, 8.0, -4.0])
    of = motion(200)
    loads = np.where((np.arange(200) >= 100)[:, None], load, np.zeros(6))
    forces = PLATFORM.inverse_dynamics(heave(200), loads).forces
    names = list(PARAMETERS['joints'])[::-1]
    for n in range(200):
        stamp = (n + 1) * 10 * MS
        of.append(('/hexapod/state', RECORDED + stamp + 3, messages.joint_state(
            stamp, ['other', *names], [], [], [0.0, *forces[n][::-1]])))
    of.sort(key=lambda each: each[1])
    bag = write_bag(tmp_path / 'bag', of, state=JOINT_STATE)
    out = run(bag, tmp_path / 'out', '--measured', '/hexapod/state', report=True).out
    found = summary_of(tmp_path / 'out' / 'bag')['measured']
    assert found['setpoints_compared'] == 200
    without = PLATFORM.inverse_dynamics(heave(200)).forces
    difference = np.sqrt(np.mean((forces - without) ** 2))
    assert found['headline'].startswith(
        f'measured and computed forces differ by {difference:.3g} N RMS')
    assert out.splitlines()[1] == found['headline']
    # with the sign of the load
    for axis, value in zip(('x', 'y', 'z'), load, strict=False):
        peak = found['external_wrench'][f'force_{axis}']
        assert peak['peak_n'] == pytest.approx(value, rel=1e-9)
        assert peak['peak_at_s'] >= 0.99


def test_the_page_names_files_that_a_bag_runs_through(tmp_path: Path) -> None:
    page = (ROOT / 'docs' / 'development.md').read_text(encoding='utf-8')
    section = page.partition('## Path of a bag')[2].partition('\n## ')[0]
    on_page = re.findall(r'^\| `([\w/]+\.py)` \|', section, flags=re.MULTILINE)
    found: set[str] = set()
    package = str(Path(stewart_dynamics.__file__).parent)

    def note(frame: FrameType, event: str, argument: Any) -> None:
        path = frame.f_code.co_filename
        if event == 'call' and path.startswith(package):
            found.add(path.removeprefix(package).lstrip('/'))

    threading.setprofile(note)
    sys.setprofile(note)
    try:
        run(ROOT / 'bags' / 'clear', tmp_path / 'replayed', report=True)
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    assert len(on_page) > 10
    assert set(on_page) <= found
