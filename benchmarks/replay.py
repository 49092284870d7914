# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The whole replay of a large bag beside what rosbags alone needs to read it, in turns in one run.

Run by hand, ``make bench-replay``, on Linux; see README.md beside this file.
"""

from __future__ import annotations

import argparse
from importlib.metadata import version
import os
from pathlib import Path
import platform
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from typing import NamedTuple
import zlib

from inverse_dynamics import Array, HERE, markdown, processor_name, write
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel, Chunk, ChunkIndex, DataEnd, Footer, Header, McapRecord, Schema, Statistics)
import numpy as np
from playwright.sync_api import sync_playwright
from rosbags.typesys import get_typestore, Stores

from stewart_dynamics.executables import executable
from stewart_dynamics.mechanics.frames.rotation import to_quaternion
from stewart_dynamics.reference_motion.motion_functions import motion_at
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.whole_file import write_json

BEGIN, END = '<!-- replay: begin -->', '<!-- replay: end -->'
PARAMETERS = HERE.parent / 'config' / 'platform.yaml'

ROUNDS = 3
SETPOINTS = 1_000_000
LONG = 2_000_000
STEP = 1_000_000  # between setpoints [ns]: 1 kHz
# As the recorder of ROS 2 does by default.
CHUNK_BYTES = 768 * 1024
MEGA = 1e6
FLEET, FLEET_SETPOINTS = 30, 60_000
BROWSERS = ('chromium', 'chromium-browser', 'google-chrome')

# Name of the topic, its type, how many numbers it has.
TOPICS = (('pose', 'geometry_msgs/msg/PoseStamped', 7),
          ('twist', 'geometry_msgs/msg/TwistStamped', 6),
          ('accel', 'geometry_msgs/msg/AccelStamped', 6))
# All six coordinates move, and their sum repeats itself only after 1000 s and more.
MOTION = {
    'motion.type': 'sine', 'motion.initial': (0.0, 0.0, 1.1, 0.0, 0.0, 0.0),
    'motion.amplitude': (0.03, 0.03, 0.04, 0.04, 0.04, 0.06),
    'motion.frequency': (0.231, 0.317, 0.173, 0.409, 0.271, 0.137),
    'motion.phase': (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)}

# Each contestant is a program of its own; its arguments are a bag and a folder for results. It
# prints the number of messages or setpoints, and its peak memory.
ROSBAGS = """
from pathlib import Path
import sys
from rosbags.highlevel import AnyReader

many = 0
with AnyReader([Path(sys.argv[1])]) as reader:
    for connection, _, data in reader.messages():
        reader.deserialize(data, connection.msgtype)
        many += 1
assert many % 3 == 0
"""
JOINED = f"""
from contextlib import closing
from pathlib import Path
import sys
from stewart_dynamics import Parameters
from stewart_dynamics.bags.recording import Recording
from stewart_dynamics.setpoints.input_messages import SOURCES
from stewart_dynamics.setpoints.joining import Setpoints

many = 0
setpoints = Setpoints(Parameters.from_yaml({str(PARAMETERS)!r}), print, print)
topics = {{f'/stewart_dynamics/{{topic}}': topic for topic in SOURCES['separate']}}
with closing(Recording(Path(sys.argv[1]))) as recording:
    for messages, _ in recording.messages(topics):
        many += len(setpoints.join_messages(messages).stamps)
many *= 3
"""
REPLAY = f"""
import json
from pathlib import Path
import sys
from stewart_dynamics.replay import main

if code := main([sys.argv[1], '--params', {str(PARAMETERS)!r}, '--output', sys.argv[2],
                 '--strict', *sys.argv[3:]]):
    sys.exit(code)
summary = json.loads(next(Path(sys.argv[2]).glob('*/summary.json')).read_text())
assert not summary['rejected']
many = 3 * summary['setpoints']['answered']
"""
ENDING = """
import resource
with open('/proc/self/status') as status:
    peak = next(int(line.split()[1]) for line in status if line.startswith('VmHWM'))
peak += resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss  # the larger process that writes
print(f'\\n{many} {peak}')
"""


class Contestant(NamedTuple):
    """A program that goes through a bag."""

    name: str
    program: str
    options: tuple[str, ...] = ()


ALONE = Contestant('rosbags alone: iterate and deserialize', ROSBAGS)
READ = Contestant('reading and joining only', JOINED)
WITHOUT_REPORT = Contestant('`stewart_replay --no-report`', REPLAY, ('--no-report',))
PARQUET = Contestant('`stewart_replay --no-report --parquet`', REPLAY,
                     ('--no-report', '--parquet'))
WITH_REPORT = Contestant('`stewart_replay`', REPLAY)
CONTESTANTS = (ALONE, READ, WITHOUT_REPORT, PARQUET, WITH_REPORT)


class Turn(NamedTuple):
    """Time and memory of one run of a contestant."""

    seconds: float
    """The whole program."""
    processor: float
    """Time of all cores together [s]; other programs that run hardly change it."""
    peak: float
    """Memory [MB]."""
    report: float
    """Size of report.html [MB]."""
    opened: float
    """Until a browser has opened it and drawn the first plot [s]."""


class Round(NamedTuple):
    """The turns of a contestant in one round."""

    start: Turn
    """With a bag of a single setpoint."""
    whole: Turn


# --- the bag ---------------------------------------------------------------------------------

def message(numbers: int) -> np.dtype[np.void]:
    """Return how a message with a header lies in an MCAP file, its frame_id a short one."""
    return np.dtype([
        ('opcode', 'u1'), ('length', '<u8'), ('channel', '<u2'), ('sequence', '<u4'),
        ('logged', '<u8'), ('published', '<u8'), ('encapsulation', 'S4'), ('sec', '<i4'),
        ('nanosec', '<u4'), ('frame_length', '<u4'), ('frame', 'S12'),
        ('numbers', '<f8', (numbers,))])


SETPOINT = np.dtype([(topic, message(numbers)) for topic, _, numbers in TOPICS])


def make_bag(path: Path, setpoints: int) -> None:
    """Write setpoints at 1 kHz on three topics, in chunks with checksums."""
    trajectory = ReferenceMotionParameters(MOTION)
    store = get_typestore(Stores.ROS2_JAZZY)
    declared: list[McapRecord] = []
    for n, (topic, kind, _) in enumerate(TOPICS, start=1):
        declared += [
            Schema(data=store.generate_msgdef(kind, ros_version=2)[0].encode(),
                   encoding='ros2msg', id=n, name=kind),
            Channel(id=n, topic=f'/stewart_dynamics/setpoint/{topic}', message_encoding='cdr',
                    schema_id=n, metadata={'topic_type_hash': store.hash_rihs01(kind)})]
    together = CHUNK_BYTES // SETPOINT.itemsize
    chunks: list[McapRecord] = []
    with path.open('wb') as file:
        file.write(b'\x89MCAP0\r\n' + written(
            Header(profile='ros2', library='benchmark'), *declared))
        for first in range(0, setpoints, together):
            index = np.arange(first, min(first + together, setpoints))
            rows = setpoints_of(trajectory, index)
            begin, end = int(rows['pose']['logged'][0]), int(rows['accel']['logged'][-1])
            content = rows.tobytes()
            at = file.tell()
            file.write(written(Chunk(
                compression='', data=content, message_end_time=end, message_start_time=begin,
                uncompressed_crc=zlib.crc32(content), uncompressed_size=len(content))))
            behind, offsets = file.tell(), {}
            for channel, (topic, _, _) in enumerate(TOPICS, start=1):
                offsets[channel] = file.tell()
                starts = (np.arange(len(rows)) * SETPOINT.itemsize
                          + SETPOINT.fields[topic][1])
                entries = np.column_stack([
                    rows[topic]['logged'], starts.astype('<u8')]).tobytes()
                file.write(bytes([Opcode.MESSAGE_INDEX]) + (6 + len(entries)).to_bytes(
                    8, 'little') + channel.to_bytes(2, 'little') + len(entries).to_bytes(
                    4, 'little') + entries)
            chunks.append(ChunkIndex(
                chunk_length=behind - at, chunk_start_offset=at, compression='',
                compressed_size=len(content), message_end_time=end, message_start_time=begin,
                message_index_length=file.tell() - behind, message_index_offsets=offsets,
                uncompressed_size=len(content)))
        file.write(written(DataEnd(data_section_crc=0)))
        summary_start = file.tell()
        summary = written(*declared, Statistics(
            message_count=3 * setpoints, schema_count=3, channel_count=3, attachment_count=0,
            metadata_count=0, chunk_count=len(chunks), message_start_time=STEP,
            message_end_time=end, channel_message_counts=dict.fromkeys((1, 2, 3), setpoints)),
            *chunks)
        footer = written(Footer(
            summary_start=summary_start, summary_offset_start=0, summary_crc=0))[:-4]
        file.write(summary + footer + zlib.crc32(summary + footer).to_bytes(4, 'little')
                   + b'\x89MCAP0\r\n')


def setpoints_of(trajectory: ReferenceMotionParameters, index: Array) -> Array:
    """Return the messages of setpoints with these numbers, from 0 on, as they are in a chunk."""
    motion = motion_at(trajectory, index * (STEP * 1e-9))
    numbers = {
        'pose': (motion.position, to_quaternion(motion.rotation)),
        'twist': (motion.linear_velocity, motion.angular_velocity),
        'accel': (motion.linear_acceleration, motion.angular_acceleration)}
    stamps = (index + 1) * STEP  # zero is no stamp
    rows = np.zeros(len(index), dtype=SETPOINT)
    for n, (topic, _, _) in enumerate(TOPICS):
        part = rows[topic]
        part['opcode'], part['length'] = int(Opcode.MESSAGE), part.dtype.itemsize - 9
        part['channel'], part['sequence'] = n + 1, index
        part['logged'] = part['published'] = stamps + (n + 1) * 10_000
        part['encapsulation'], part['frame_length'], part['frame'] = b'\x00\x01', 5, b'base'
        part['sec'], part['nanosec'] = np.divmod(stamps, 1_000_000_000)
        part['numbers'] = np.concatenate(numbers[topic], axis=1)
    return rows


def written(*records: McapRecord) -> bytes:
    """Return the bytes of records."""
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())


# --- the benchmark ---------------------------------------------------------------------------

def take_turn(one: Contestant, bag: Path, setpoints: int) -> Turn:
    """Let a contestant go through a bag; stop if it did not find every setpoint."""
    results = bag.with_name('results')
    # Python's own compiled files are kept, as usual, but where the bags are.
    environment = {**os.environ, 'PYTHONPYCACHEPREFIX': str(bag.with_name('pycache'))}
    environment.pop('PYTHONDONTWRITEBYTECODE', None)
    before = processor_time()
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, '-c', one.program + ENDING, str(bag), str(results), *one.options],
        capture_output=True, text=True, env=environment, cwd=bag.parent)
    seconds = time.perf_counter() - start
    processor = processor_time() - before
    if done.returncode:
        raise SystemExit(f'{one.name}: exit code {done.returncode}:\n{done.stdout}{done.stderr}')
    found, peak = map(int, done.stdout.splitlines()[-1].split())
    if found != 3 * setpoints:
        raise SystemExit(f'{one.name}: found {found} messages, must be {3 * setpoints}')
    report = next(iter(results.glob('*/report.html')), None)
    size = 0.0 if report is None else report.stat().st_size / MEGA
    opening = 0.0 if report is None or setpoints == 1 else opened(report)
    shutil.rmtree(results, ignore_errors=True)
    return Turn(seconds, processor, peak * 1024 / MEGA, size, opening)


def opened(report: Path) -> float:
    """Return how long a browser takes to open a report and draw its first plot; 0 without one."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        return 0.0
    with sync_playwright() as playwright:
        page = playwright.chromium.launch(executable_path=browser, args=[
            '--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader']).new_page()
        start = time.perf_counter()
        page.goto(report.as_uri())
        page.locator('#plots').scroll_into_view_if_needed()
        page.locator('#plots .main-svg').first.wait_for()
        return time.perf_counter() - start


def processor_time() -> float:
    """Return what all programs started so far have used [s]."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def measure(bag: Path, setpoints: int, single: Path, rounds: int) -> dict[str, list[Round]]:
    """Let them take turns, forth in one round and back in the next."""
    turns: dict[str, list[Round]] = {one.name: [] for one in CONTESTANTS}
    for number in range(rounds):
        for one in CONTESTANTS if number % 2 else reversed(CONTESTANTS):
            turns[one.name].append(Round(
                take_turn(one, single, 1), take_turn(one, bag, setpoints)))
    return turns


def speed_table(setpoints: int, turns: dict[str, list[Round]]) -> list[str]:
    """Return what each took, beside what rosbags alone took in the same round."""
    cells = [(f'{setpoints:,} setpoints', 's', 'min .. max', 'of it start', 'processor s',
              'times rosbags', 'min .. max', 'without start')]
    for one in CONTESTANTS:
        own, its = turns[one.name], turns[ALONE.name]
        seconds = [turn.whole.seconds for turn in own]
        ratios = [mine.whole.seconds / alone.whole.seconds
                  for mine, alone in zip(own, its, strict=True)]
        without_start = [
            (mine.whole.seconds - mine.start.seconds)
            / (alone.whole.seconds - alone.start.seconds)
            for mine, alone in zip(own, its, strict=True)]
        cells.append((
            one.name, f'{statistics.median(seconds):.2f}',
            f'{min(seconds):.2f} .. {max(seconds):.2f}',
            f'{statistics.median(turn.start.seconds for turn in own):.2f}',
            f'{statistics.median(turn.whole.processor for turn in own):.2f}',
            f'{statistics.median(ratios):.2f}',
            '' if one is ALONE else f'{min(ratios):.2f} .. {max(ratios):.2f}',
            f'{statistics.median(without_start):.2f}'))
    return markdown(cells)


def memory_table(by_setpoints: dict[int, dict[str, Turn]]) -> list[str]:
    """Return how time, memory and report grow with the bag."""
    cells = [('', 'setpoints', 's', 'peak memory (MB)', 'report.html (MB)', 'opened in (s)')]
    for one in CONTESTANTS:
        cells += [
            (one.name, f'{setpoints:,}', f'{turn.seconds:.1f}', f'{turn.peak:.0f}',
             f'{turn.report:.1f}' if turn.report else '',
             f'{turn.opened:.1f}' if turn.opened else '')
            for setpoints, turns in by_setpoints.items()
            for turn in [turns.get(one.name)] if turn is not None]
    return markdown(cells)


def fleet_words(folder: Path) -> str:
    """Return how long many bags take with one process and with two, in turns."""
    bags = [folder / f'fleet_{n:02d}.mcap' for n in range(FLEET)]
    make_bag(bags[0], FLEET_SETPOINTS)
    for bag in bags[1:]:
        shutil.copy(bags[0], bag)
    seconds: dict[int, list[float]] = {1: [], 2: []}
    for jobs in (1, 2, 2, 1):
        results = folder / 'fleet'
        begun = time.perf_counter()
        subprocess.run(
            [str(executable('stewart_replay')), *map(str, bags), '--params', str(PARAMETERS),
             '--output', str(results), '--jobs', str(jobs)], check=True,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        seconds[jobs].append(time.perf_counter() - begun)
        shutil.rmtree(results)
    one, two = (statistics.mean(seconds[jobs]) for jobs in (1, 2))
    return (f'{FLEET} bags of a minute with all outputs: {one:.1f} s with `--jobs 1`, {two:.1f} s '
            f'with `--jobs 2`, {one / two:.2f} times faster.')


def measured_on(size: float, rounds: int) -> str:
    """Return processor, versions, and how it was measured."""
    versions = ', '.join(f'{name} {version(name)}' for name in (
        'numpy', 'rosbags', 'orjson', 'pyarrow'))
    return (f'{processor_name()}, {len(os.sched_getaffinity(0))} cores. Python '
            f'{platform.python_version()}, {versions}. The bag has {size:.0f} MB. Medians of '
            f'{rounds} rounds; the longer bag once.')


def main() -> None:
    """Make the bags, measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--rounds', type=int, default=ROUNDS, help='turns of each (%(default)s)')
    parser.add_argument('--setpoints', type=int, default=SETPOINTS,
                        help='in the bag (%(default)s)')
    parser.add_argument('--long', type=int, default=LONG,
                        help='in a longer bag, for the memory; 0: none (%(default)s)')
    parser.add_argument('--folder', type=Path,
                        help="for bags and results, removed afterwards; default: the system's")
    parser.add_argument('--json', type=Path, help='keep every turn in this file')
    parser.add_argument('--write', action='store_true', help='put the tables into results/')
    options = parser.parse_args()
    if options.rounds < 1 or options.setpoints < 2 or options.long < 0:
        parser.error('--rounds must be at least 1, --setpoints 2, --long 0')

    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        bag, single = Path(folder) / 'bag.mcap', Path(folder) / 'single.mcap'
        make_bag(single, 1)
        make_bag(bag, options.setpoints)
        size = bag.stat().st_size / MEGA
        for one in CONTESTANTS:  # fills the caches on disk
            take_turn(one, single, 1)
        rounds = measure(bag, options.setpoints, single, options.rounds)
        longest = {name: max((each.whole for each in turns), key=lambda turn: turn.peak)
                   for name, turns in rounds.items()}
        memory = {options.setpoints: longest}
        if options.long:
            make_bag(bag, options.long)
            memory[options.long] = {one.name: take_turn(one, bag, options.long)
                                    for one in CONTESTANTS if one is not ALONE}
        bag.unlink()
        fleet = fleet_words(Path(folder))
    lines = ['', *speed_table(options.setpoints, rounds), '', *memory_table(memory), '',
             fleet, '', measured_on(size, options.rounds), '']
    print('\n'.join(lines))
    if options.json:
        write_json(options.json, rounds)
    if options.write:
        write(lines, BEGIN, END)


if __name__ == '__main__':
    main()
