# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Whether two builds answer recorded messages alike, byte for byte.

    python benchmarks/same_answers.py make FOLDER 1000
    OLD/.venv/bin/python benchmarks/same_answers.py answer FOLDER OLD.json
    NEW/.venv/bin/python benchmarks/same_answers.py answer FOLDER NEW.json
    python benchmarks/same_answers.py compare OLD.json NEW.json

Random recordings are irregular: stamps that jump, repeat or are zero, topics that overtake each
other, damaged messages, other byte orders and frames, late messages, restarts. Each is passed
through the joining message by message, as in the node, and in blocks of random lengths, as in
the replay; every tenth, and the bags in bags/, are replayed into files, too. Answers are digests
of rows, rejections in their order with details, notices, mistakes, and files.
"""

from __future__ import annotations

from collections.abc import Iterator
import hashlib
from itertools import pairwise
import json
from pathlib import Path
import pickle
import shutil
import sys
import tempfile
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
MS = 1_000_000
SECOND = 1000 * MS
BEGIN = 1_700_000_000 * SECOND
TYPES = {
    'setpoint/pose': 'geometry_msgs/msg/PoseStamped',
    'setpoint/twist': 'geometry_msgs/msg/TwistStamped',
    'setpoint/accel': 'geometry_msgs/msg/AccelStamped',
    'setpoint/combined': 'trajectory_msgs/msg/MultiDOFJointTrajectory',
    'base/pose': 'geometry_msgs/msg/PoseStamped',
    'base/twist': 'geometry_msgs/msg/TwistStamped',
    'base/accel': 'geometry_msgs/msg/AccelStamped', 'base/imu': 'sensor_msgs/msg/Imu',
    'wrench': 'geometry_msgs/msg/WrenchStamped',
    'measured_legs': 'sensor_msgs/msg/JointState'}
SOURCES = {'separate': ['setpoint/pose', 'setpoint/twist', 'setpoint/accel'],
           'combined': ['setpoint/combined'], 'pose': ['setpoint/pose']}
BASES = {'fixed': [], 'pose': ['base/pose'], 'motion': ['base/pose', 'base/twist', 'base/accel'],
         'imu': ['base/imu']}
TOPICS = tuple(TYPES)
LEGS = [f'leg_{n}' for n in range(1, 7)]


def make(folder: Path, number: int) -> None:
    """Write random recordings: parameters, messages, where they are cut; every tenth as a bag."""
    sys.path.insert(0, str(ROOT / 'test'))
    folder.mkdir()
    for seed in range(number):
        random = np.random.default_rng(seed)
        given, messages = recording_of(random, seed)
        cuts = sorted(random.integers(0, len(messages) + 1, random.integers(0, 9)).tolist())
        (folder / f'{seed}.pickle').write_bytes(pickle.dumps((given, messages, cuts)))
        if seed % 10 == 0:
            write_bag(folder / f'{seed}', messages)


def recording_of(random: Any, seed: int) -> tuple[dict[str, Any], list[tuple[str, int, bytes]]]:
    """Return parameters and messages: topic, time of recording, bytes."""
    source = str(random.choice(list(SOURCES), p=[0.6, 0.2, 0.2]))
    base = str(random.choice(list(BASES)))
    given = {'setpoint.source': source, 'base.source': base, 'setpoint.timeout': 0.1,
             'base.timeout': float(random.choice([0.02, 0.2])),
             'setpoint.sync_tolerance': float(random.choice([0.0, 0.0, 0.002, 0.02]))}
    long = seed % 50 == 0
    count = int(random.integers(2500, 4000) if long else random.integers(5, 120))
    faults = float(random.choice([0.0, 0.0 if long else 0.01, 0.05, 0.3]))
    streams = []
    stamp = BEGIN if random.random() < 0.8 else int(random.integers(1, SECOND))
    every = int(random.integers(1, 6))
    lag = int(random.choice([0, MS // 2])) if given['setpoint.sync_tolerance'] else 0
    for n in range(count):
        stamp += int(random.integers(MS // 2, 12 * MS)) if random.random() < 0.1 else 4 * MS
        if random.random() < faults * 0.2:
            stamp += int(random.integers(-400, 200)) * MS
        stamp = max(stamp, 1)
        at = BEGIN + n * 4 * MS
        for k, topic in enumerate(SOURCES[source]):
            streams.append((at + k * 1000, topic, stamp + int(k * lag * random.random())))
        if n % every == 0:
            for k, topic in enumerate(BASES[base]):
                streams.append((at + int(random.integers(-MS, MS)), topic,
                                stamp + int(random.integers(-2, 2)) * MS * (k == 0 or lag == 0)
                                * (random.random() < faults)))
        if random.random() < 0.1:
            streams.append((at + 10, 'wrench', stamp))
        streams.append((at + 20, 'measured_legs', stamp + int(random.integers(0, MS))))
    # topics that come late as a whole, or shuffled in time
    late = {topic: int(random.choice([0, 0, 0, 3, 80, 5000])) * MS for topic in TOPICS}
    jitter = int(random.choice([0, 0, 1, 9])) * MS
    streams = [(at + late[topic] + int(random.integers(0, jitter + 1)), topic, stamp)
               for at, topic, stamp in streams]
    streams.sort(key=lambda each: each[0])
    unstamped = random.random() < 0.1
    found: list[tuple[str, int, bytes]] = []
    for at, topic, stamp in streams:
        if topic == 'measured_legs' and random.random() < 0.5:
            continue
        if unstamped and topic.startswith('setpoint') and random.random() < 0.9:
            stamp = 0
        fate = 'good'
        if random.random() < faults:
            fate = str(random.choice(['lost', 'twice', 'zero', 'nan', 'frame', 'cut', 'garbage',
                                      'big', 'huge', 'quaternion', 'no frame', 'back']))
        data = message_of(random, topic, stamp, fate)
        found += [(topic, at + n, data) for n in range({'lost': 0, 'twice': 2}.get(fate, 1))]
    found.sort(key=lambda each: each[1])
    return given, found


def message_of(random: Any, topic: str, stamp: int, fate: str) -> bytes:
    """Return a message with a fault."""
    import messages
    stamp = {'zero': 0, 'back': max(stamp - int(random.integers(1, 300)) * MS, 1)}.get(fate, stamp)
    frame = {'frame': 'wrong', 'no frame': ''}.get(
        fate, 'world' if topic in TOPICS[4:7] else 'imu' if topic == 'base/imu' else 'base')
    if topic == 'measured_legs':
        frame = ''
    numbers = (0.02 * random.normal(size=19)).tolist()
    if fate == 'huge':
        numbers[0] = 1e200
    if fate == 'nan':
        numbers[1] = float('nan')
    quaternion = np.array([*numbers[3:6], 1.0])
    quaternion /= np.linalg.norm(quaternion) * (1.5 if fate == 'quaternion' else 1.0)
    position = (numbers[0], numbers[1], 1.1 + numbers[2])
    little = fate != 'big'
    if topic in ('setpoint/pose', 'base/pose'):
        data = messages.pose(stamp, position, quaternion.tolist(), frame, little)
    elif topic == 'setpoint/combined':
        data = messages.combined(stamp, position, quaternion.tolist(), numbers[7:13],
                                 numbers[13:19], frame, names=['a' * int(random.integers(1, 3))])
    elif topic == 'base/imu':
        data = messages.imu(stamp, numbers[:3], (numbers[3], numbers[4], 9.8), frame,
                            little_endian=little, covariances=(
                                -1.0, -1.0 if fate == 'quaternion' else 0.0, 0.0))
    elif topic == 'measured_legs':
        data = messages.joint_state(stamp, LEGS, np.array(numbers[:6]) + 1.0, numbers[6:12],
                                    np.array(numbers[12:18]) * 100, frame, little)
    else:
        make_one = {'twist': messages.twist, 'accel': messages.accel}.get(
            topic.rpartition('/')[2], messages.wrench)
        data = make_one(stamp, numbers[:6], frame)
    if fate == 'cut':
        return data[:-5]
    if fate == 'garbage':
        spoiled = bytearray(data)
        for at in random.integers(0, len(data), 3):
            spoiled[at] = random.integers(0, 256)
        return bytes(spoiled)
    return data


def write_bag(folder: Path, found: list[tuple[str, int, bytes]]) -> None:
    """Write messages as a bag in MCAP."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import get_typestore, Stores
    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        to = {topic: bag.add_connection(f'/stewart_dynamics/{topic}', kind, typestore=store)
              for topic, kind in TYPES.items() if topic in {each[0] for each in found}}
        for topic, at, data in found:
            bag.write(to[topic], at, data)


def answer(folder: Path, to: Path) -> None:
    """Write the digests of all answers of this build."""
    answers: dict[str, Any] = {}
    for file in sorted(folder.glob('*.pickle'), key=lambda each: int(each.stem)):
        given, found, cuts = pickle.loads(file.read_bytes())  # noqa: S301, from make()
        for way, ends in (('each', None), ('blocks', cuts)):
            try:
                each = joined(given, found, ends)
            except (ValueError, IndexError, TypeError) as exc:
                each = {'error': f'{exc!r}'}
            for name, value in each.items():
                answers[f'{file.stem} {way} {name}'] = value
    for bag, given, options in bags(folder):
        name = f'{bag.name} replay {options}'
        answers[name] = replayed(bag, given, options)
    to.write_text(json.dumps(answers, indent=1))


def parameters_of(given: dict[str, Any]) -> Any:
    """Return the parameters of the example with others."""
    from stewart_dynamics import Parameters
    return Parameters.from_yaml(ROOT / 'config' / 'platform.yaml').replaced(given)


def joined(given: dict[str, Any], found: list[tuple[str, int, bytes]], cuts: list[int] | None,
           ) -> dict[str, str]:
    """Return the digests of joined messages: one by one, or in blocks."""
    from stewart_dynamics.messages.recorded import Messages
    from stewart_dynamics.setpoints.joining import Setpoints
    said: list[tuple[Any, str]] = []
    notices: list[str] = []
    setpoints = Setpoints(parameters_of(given), lambda *each: said.append(each), notices.append)
    found = [each for each in found if each[0] != 'measured_legs']
    batches = []
    if cuts is None:
        take = getattr(setpoints, 'join_message', None) or (
            lambda topic, data, now: setpoints.take([(topic, data, now)]))
        check = getattr(setpoints, 'check_samples', None) or setpoints.judge
        for topic, at, data in found:
            batches.append(take(topic, data, lambda at=at: at))
            check()
    else:
        build: Any = Messages
        from_bytes = build.from_bytes if hasattr(build, 'from_bytes') else build.of
        whole = from_bytes(TOPICS, [TOPICS.index(each[0]) for each in found],
                           [each[1] for each in found], [each[2] for each in found])
        take = getattr(setpoints, 'join_messages', None) or setpoints.take
        for first, end in pairwise([0, *cuts, len(found)]):
            batches.append(take(whole.chosen(slice(first, end))))
    (getattr(setpoints, 'drop_waiting', None) or setpoints.end)('the bag ends')
    firsts: dict[Any, str] = {}
    for rejection, details in said:
        firsts.setdefault(rejection, details)
    answers = {
        'rows': digest(b''.join([*(each.stamps.tobytes() for each in batches),
                                 *(each.rows.tobytes() for each in batches)])),
        'setpoints': f'{sum(len(each.stamps) for each in batches)}',
        'notices': f'{notices}',
        'counts': f'{sorted(setpoints.counts.items())}', 'firsts': f'{sorted(firsts.items())}',
        'mistakes': f'{setpoints.possible_errors(True)} {setpoints.possible_errors()}',
        'base': f'{setpoints.base.last}'}
    if cuts is None:
        answers['said'] = digest(f'{said}'.encode())
        answers['last words'] = f'{said[-3:]}'
    else:
        answers['times'] = digest(b''.join(each.times.tobytes() for each in batches))
    return answers


def bags(folder: Path) -> Iterator[tuple[Path, dict[str, Any], dict[str, Any]]]:
    """Yield bags, parameters, options."""
    for name in ('clear', 'flawed', 'singular'):
        yield ROOT / 'bags' / name, {}, {'report': True}
        yield ROOT / 'bags' / name, {}, {'cutoff': 20.0}
    for file in sorted(folder.glob('*.pickle'), key=lambda each: int(each.stem)):
        bag = folder / file.stem
        if bag.is_dir():
            given, found, _ = pickle.loads(file.read_bytes())  # noqa: S301
            measured = {'measured': '/stewart_dynamics/measured_legs'} if any(
                each[0] == 'measured_legs' for each in found) else {}
            yield bag, given, {'report': int(file.stem) % 100 == 0, **measured}


def replayed(bag: Path, given: dict[str, Any], options: dict[str, Any]) -> dict[str, str]:
    """Return the digests of the files of a replay, or its error."""
    from stewart_dynamics.errors import StewartError
    from stewart_dynamics.replay.one_bag import replay
    from stewart_dynamics.replay.replay_options import Options
    to = Path(tempfile.mkdtemp()) / 'replayed'
    try:
        replay(bag, parameters_of(given), to, Options(**options))
        return {str(file.relative_to(to)): digest(file.read_bytes())
                for file in sorted(to.rglob('*')) if file.is_file()}
    except (StewartError, ValueError) as exc:
        return {'error': f'{exc}'}
    finally:
        shutil.rmtree(to.parent)


def digest(data: bytes) -> str:
    """Return the digest of bytes."""
    return hashlib.sha256(data).hexdigest()


def compare(old: Path, new: Path) -> int:
    """Print what differs; return the exit code."""
    a, b = (json.loads(each.read_text()) for each in (old, new))
    different = [name for name in {**a, **b} if a.get(name) != b.get(name)]
    for name in different[:40]:
        print(f'{name}:\n  {a.get(name)}\n  {b.get(name)}')
    split = [name for name in b if ' each ' in name and b[name] != b.get(
        name.replace(' each ', ' blocks '), b[name])]
    print(f'{len(split)} answers of the new build depend on the blocks: {split[:20]}')
    setpoints = sum(int(value) for name, value in a.items() if name.endswith('each setpoints'))
    print(f'{len(different)} of {len(a)} answers differ; {setpoints} setpoints of recordings')
    return 1 if different else 0


def main() -> int:
    """Run a command."""
    command, *given = sys.argv[1:]
    if command == 'make':
        make(Path(given[0]), int(given[1]))
    elif command == 'answer':
        answer(Path(given[0]), Path(given[1]))
    else:
        return compare(Path(given[0]), Path(given[1]))
    return 0


if __name__ == '__main__':
    sys.exit(main())
