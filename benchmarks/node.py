# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The node at 1 kHz beside nodes that compute nothing, in turns in one run.

Run by hand, ``make bench-node``, on Linux; see README.md beside this file.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, ExitStack
from functools import partial
from importlib.metadata import version
import os
from pathlib import Path
import platform
import signal
import socket
from statistics import median
import subprocess
import sys
import tempfile
import time
from timeit import repeat
from typing import NamedTuple

from inverse_dynamics import Array, HERE, markdown, processor_name, write
from latency import FIRST_STAMP, legs, MOTION, PARAMETERS, PERIOD
import numpy as np

from stewart_dynamics.arrays import NO_WRENCH
from stewart_dynamics.description.model import ModelMessages
from stewart_dynamics.executables import executable
from stewart_dynamics.external_wrench.estimate import ExternalWrench
from stewart_dynamics.external_wrench.measured_legs import MeasuredLegs
from stewart_dynamics.node.markers import Markers
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.reference_motion.motion_functions import motion_at
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.ros.security import PROFILES
from stewart_dynamics.setpoints.output_messages import OutputMessages
from stewart_dynamics.setpoints.step import Batch, Step

BEGIN, END = '<!-- node: begin -->', '<!-- node: end -->'
BEGIN_MARKERS, END_MARKERS = '<!-- markers: begin -->', '<!-- markers: end -->'
BEGIN_LEGS, END_LEGS = '<!-- measured legs: begin -->', '<!-- measured legs: end -->'
BEGIN_BASE, END_BASE = '<!-- IMU: begin -->', '<!-- IMU: end -->'
PARTS = 'node', 'markers', 'legs', 'base'
NODE = str(executable('stewart_dynamics'))

DOMAIN = '101'  # the tests have those below
ROUNDS = 6
SECONDS = 5
MINUTES = 10
RATE = 1_000_000_000 // PERIOD
SETTLE = 0.5  # [s] between turns: messages under way arrive
TICKS = os.sysconf('SC_CLK_TCK')
EACH = [50.0, 99.0, 99.9, 100.0]
HEADER: tuple[str, ...] = (
    'latency (us)', 'p50', 'p99', 'p99.9', 'max', 'lost', 'of a core', 'p50, times typed',
    'p99, times typed', 'p50, times serialized', 'p99, times serialized')


class Contestant(NamedTuple):
    """A node that answers setpoints."""

    title: str
    name: str
    source: str
    command: tuple[str, ...]


def ours(name: str, source: str, *parameters: str) -> Contestant:
    """Return the node under a name, with parameters ``name:=value``."""
    given = [part for each in (f'setpoint.source:={source}', *parameters) for part in ('-p', each)]
    return Contestant('`stewart_dynamics`', name, source, (
        NODE, '--ros-args', '-r', f'__node:={name}', '--params-file', str(PARAMETERS), *given))


def pass_through(how: str, source: str) -> Contestant:
    """Return a node that computes nothing."""
    name = f'{how}_{source}'
    return Contestant(f'pass-through, {how}', name, source, (
        sys.executable, str(HERE / 'pass_through.py'), name, source, how))


CONTESTANTS = {source: (
    ours(f'node_{source}', source), pass_through('typed', source),
    pass_through('serialized', source)) for source in ('separate', 'combined')}
CALLED = ours('called', 'separate')
KILLED_AFTER = 1.0  # [s]
SECURITY = HERE.parent / 'security'
PROFILE = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SYSTEM_DEFAULT', 'SKIP_DEFAULT_XML_FILE': '1'}


class Transport(NamedTuple):
    """Transport between processes: environments that select it in Fast DDS."""

    source: Mapping[str, str]
    node: Mapping[str, str]
    listener: Mapping[str, str]


SHARED_MEMORY = Transport(*[{'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}] * 3)
ONE_HOST = Transport(*[
    {**PROFILE, PROFILES: str(SECURITY / 'one_host.xml')}] * 3)


def tls(folder: Path) -> Transport:
    """Return TLS over TCP with keys that are made into a folder."""
    with socket.socket() as source, socket.socket() as listener:
        for one in (source, listener):
            one.bind(('127.0.0.1', 0))
        ports = source.getsockname()[1], listener.getsockname()[1]
    keys = folder / 'keys'
    subprocess.run([str(SECURITY / 'make_keys.sh'), str(keys), f'source=127.0.0.1:{ports[0]}',
                    f'listener=127.0.0.1:{ports[1]}'], check=True, stdout=subprocess.DEVNULL)
    environments = [{
        **PROFILE, 'STEWART_KEYS': str(keys / name),
        PROFILES: str(keys / name / 'profile.xml')}
        for name in ('source', 'node', 'listener')]
    for of, name in ((0, 'source'), (2, 'listener')):
        environments[of]['OPENSSL_CONF'] = str(keys / name / 'openssl.cnf')
    return Transport(*environments)


class Turn(NamedTuple):
    """Measurements of one turn of a contestant."""

    latencies: Array
    """From the last message of a setpoint to its leg states, of those that came [us]."""
    sent: int
    cores: float
    """Processor time of the node by elapsed time."""

    @property
    def lost(self) -> int:
        """Setpoints that were not answered."""
        return self.sent - len(self.latencies)


class Process:
    """One of the processes around a node, or a node."""

    def __init__(self, command: Sequence[str], environment: dict[str, str]) -> None:
        self.command = command
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            env={**os.environ, **environment})

    def expect(self, line: str) -> None:
        """Wait until it says a line."""
        assert self.process.stdout is not None
        if (said := self.process.stdout.readline().strip()) != line:
            raise SystemExit(f'{" ".join(self.command)}: said {said!r} in place of {line!r}')

    def go(self) -> None:
        """Let it begin its next turn."""
        assert self.process.stdin is not None
        self.process.stdin.write('\n')
        self.process.stdin.flush()

    def stop(self) -> str:
        """End the process by a signal and return its last line."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        return self.process.communicate(timeout=60)[0]

    @property
    def processor(self) -> float:
        """Processor time so far [s]."""
        stat = Path(f'/proc/{self.process.pid}/stat').read_text().rpartition(')')[2].split()
        return (int(stat[11]) + int(stat[12])) / TICKS

    @property
    def memory(self) -> float:
        """Return the resident memory of the process [kB]."""
        lines = Path(f'/proc/{self.process.pid}/status').read_text().splitlines()
        return next(float(line.split()[1]) for line in lines if line.startswith('VmRSS'))


def role(*arguments: str) -> list[str]:
    """Return the command of one of the processes around a node."""
    return [sys.executable, str(HERE / 'latency.py'), *arguments]


class Measurement:
    """
    Contestants, a source, a listener, and the measurements of each turn.

    Parameters
    ----------
    contestants : sequence of Contestant
        All of them run all the time; those without a turn have nothing to do.
    turns : sequence of (index of contestant, setpoints)
        In this order.
    folder : Path
        Gets the times.
    transport : Transport
        How they talk.
    beside : str
        A role of ``latency.py`` that the first contestant has beside it all the time: its
        services are called, its markers viewed, its legs measured, or an IMU is on its base.
    killed : bool
        One more listener is killed by SIGKILL in the middle of the last turn.

    """

    def __init__(self, contestants: Sequence[Contestant], turns: Sequence[tuple[int, int]],
                 folder: Path, transport: Transport = SHARED_MEMORY,
                 beside: str = '', killed: bool = False) -> None:
        self._contestants, self._turns, self._folder = contestants, turns, folder
        self._transport, self._beside, self._killed = transport, beside, killed
        self._cores: list[float] = []
        self.memory: list[float] = []
        """Of the first contestant, every ten seconds [kB]."""

    def run(self) -> list[Turn]:
        """Take the turns."""
        with self._processes() as (nodes, source, spare):
            for n, (which, setpoints) in enumerate(self._turns, start=1):
                node = nodes[which]
                time.sleep(SETTLE)
                processor, begin = node.processor, time.monotonic()
                source.go()
                if spare and n == len(self._turns):
                    time.sleep(KILLED_AFTER)
                    spare.process.kill()
                while (left := begin + setpoints / RATE - time.monotonic()) > 0.0:
                    time.sleep(min(left, 10.0))
                    self.memory.append(nodes[0].memory)
                source.expect('done')
                self._cores.append((node.processor - processor) / (time.monotonic() - begin))
            time.sleep(SETTLE)
        return self._read()

    @contextmanager
    def _processes(self) -> Iterator[tuple[list[Process], Process, Process | None]]:
        common = {'ROS_DOMAIN_ID': DOMAIN, 'ROS_LOG_DIR': str(self._folder / 'log')}
        with ExitStack() as stack:
            def start(command: Sequence[str], environment: Mapping[str, str]) -> Process:
                process = Process(command, {**common, **environment})
                stack.callback(process.stop)
                return process

            nodes = [start(each.command, self._transport.node) for each in self._contestants]
            names = [each.name for each in self._contestants]
            listener, spare = (start(
                role('listen', str(self._folder / f'{which}.npz'), *names),
                self._transport.listener) if wanted else None
                for which, wanted in (('listened', True), ('spare', self._killed)))
            beside = self._beside and start(
                role(self._beside, self._contestants[0].name), self._transport.listener)
            for process in (listener, spare, beside):
                if process:
                    process.expect('ready')
            plan = [f'{self._contestants[which].name} {self._contestants[which].source} {number}'
                    for which, number in self._turns]
            source = start(role('publish', str(self._folder / 'published.npz'), *plan),
                           self._transport.source)
            source.expect('ready')
            yield nodes, source, spare
            source.process.wait(60)

    def _read(self) -> list[Turn]:
        heard = np.load(self._folder / 'listened.npz')
        arrived = dict(zip(heard['stamps'].tolist(), heard['times'].tolist(), strict=True))
        if len(arrived) != len(heard['stamps']):
            raise SystemExit('a setpoint was answered twice')
        published = np.load(self._folder / 'published.npz')
        turns = []
        stamp = FIRST_STAMP
        for (_, number), cores, times in zip(
                self._turns, self._cores, published.values(), strict=True):
            latencies = [(arrived[at] - time) * 1e-3 for at, time in zip(
                range(stamp, stamp + number * PERIOD, PERIOD), times.tolist(), strict=True)
                if at in arrived]
            turns.append(Turn(np.array(latencies), number, cores))
            stamp += number * PERIOD
        return turns


def in_turns(contestants: Sequence[Contestant], rounds: int, seconds: int, folder: Path,
             transport: Transport = SHARED_MEMORY, beside: str = '') -> list[list[Turn]]:
    """Return the turns of each contestant; they take turns in one order and then the other."""
    order = list(range(len(contestants)))
    plan = [which for n in range(rounds) for which in (order if n % 2 == 0 else order[::-1])]
    setpoints = seconds * RATE
    # The first turn of each is not measured: discovery settles, caches fill.
    turns = Measurement(contestants, [(which, RATE) for which in order] + [
        (which, setpoints) for which in plan], folder, transport, beside).run()[len(order):]
    return [[turn for turn, of in zip(turns, plan, strict=True) if of == which]
            for which in order]


def latency_rows(label: str, contestants: Sequence[Contestant], of_each: list[list[Turn]],
                 beside: int, least: int | None = None) -> list[tuple[str, ...]]:
    """Return rows of the table of latencies; ratios are to one or two of the contestants."""
    def ratios(turns: list[Turn], to: int) -> Iterator[str]:
        of_turns = [np.percentile(turn.latencies, (50, 99)) / np.percentile(
            other.latencies, (50, 99)) for turn, other in zip(turns, of_each[to], strict=True)]
        return (f'{middle:.2f}' for middle in np.median(of_turns, axis=0))

    rows = []
    for contestant, turns in zip(contestants, of_each, strict=True):
        latencies = np.concatenate([turn.latencies for turn in turns])
        rows.append((
            f'{label}, {contestant.title}',
            *(f'{value:,.0f}' for value in np.percentile(latencies, EACH)),
            str(sum(turn.lost for turn in turns)),
            f'{np.mean([turn.cores for turn in turns]):.0%}',
            *ratios(turns, beside), *(ratios(turns, least) if least else ('', ''))))
    return rows


def long_rows(turn: Turn, memory: list[float], minutes: int) -> list[tuple[str, ...]]:
    """Return the table of a long run, minute by minute."""
    rows = [('minute', 'p50', 'p99', 'p99.9', 'max', 'memory (MB)')]
    of_minute = np.array_split(turn.latencies, minutes)
    of_memory = np.array_split(np.array(memory), minutes)
    for n, (latencies, kilobytes) in enumerate(zip(of_minute, of_memory, strict=True), start=1):
        rows.append((str(n), *(f'{value:,.0f}' for value in np.percentile(latencies, EACH)),
                     f'{kilobytes[-1] / 1024:.2f}'))
    return rows


def stall_rows(folder: Path) -> list[tuple[str, ...]]:
    """Return the table of events that could make a setpoint wait."""
    rows = [('events that could make a setpoint wait (ms)', 'before', 'as it is')]
    measured = subprocess.run(
        [sys.executable, str(HERE / 'stalls.py'), str(PARAMETERS)], check=True, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env={
            **os.environ, 'ROS_DOMAIN_ID': DOMAIN, **SHARED_MEMORY.node}).stdout
    rows += [tuple(line.split('\t')) for line in measured.splitlines()]
    return rows


def killed_words(folder: Path) -> str:
    """Return how long setpoints took where a listener is killed."""
    longest = []
    for transport in (SHARED_MEMORY, ONE_HOST):
        turns = Measurement([CALLED], [(0, RATE), (0, 5 * RATE)], folder, transport,
                            killed=True).run()
        longest.append(turns[-1].latencies.max() * 1e-3)
    return (f'Longest latency in 5 s in which a second listener is killed: {longest[0]:.1f} ms on '
            f'shared memory, {longest[1]:.1f} ms on one host.')


def node_lines(rounds: int, seconds: int, minutes: int, folder: Path) -> list[str]:
    """Return the tables of the node beside those that compute nothing."""
    cells = [HEADER]
    for source, contestants in CONTESTANTS.items():
        turns = in_turns(contestants, rounds, seconds, folder)
        cells += latency_rows(source, contestants, turns, beside=1, least=2)
    called = [CALLED, CONTESTANTS['separate'][1]]
    turns = in_turns(called, rounds, seconds, folder, beside='call')
    cells += latency_rows('separate, services called', called, turns, beside=1)
    for label, transport in (('one host', ONE_HOST), ('TLS', tls(folder))):
        turns = in_turns(called, rounds, seconds, folder, transport)
        cells += latency_rows(f'separate, {label}', called, turns, beside=1)
    lines = ['', *markdown(cells), '', *markdown(stall_rows(folder)), '', killed_words(folder), '']
    if minutes:
        run = Measurement([CALLED], [(0, minutes * 60 * RATE)], folder)
        turn, = run.run()
        lines += [*markdown(long_rows(turn, run.memory, minutes)), '',
                  f'{turn.sent:,} setpoints in {minutes} minutes, {turn.lost} lost.', '']
    return lines


def markers_lines(rounds: int, seconds: int, folder: Path) -> list[str]:
    """Return the table of a node whose markers are viewed beside one whose are not."""
    nodes = [ours('viewed', 'separate'), ours('alone', 'separate')]
    turns = in_turns(nodes, rounds, seconds, folder, beside='view')
    cells = [HEADER[:-4] + ('p50, times alone', 'p99, times alone')]
    for title, row in zip(('`~/markers` viewed', 'nobody looks'),
                          latency_rows('', nodes, turns, beside=1), strict=True):
        cells.append((title, *row[1:-2]))
    return ['', *markdown(cells), '', picture_words(), '']


def legs_lines(rounds: int, seconds: int, folder: Path) -> list[str]:
    """Return the table of a node whose legs are measured beside one whose are not."""
    nodes = [ours('measured', 'separate'), ours('alone', 'separate')]
    turns = in_turns(nodes, rounds, seconds, folder, beside='measure')
    cells = [HEADER[:-4] + ('p50, times alone', 'p99, times alone')]
    for title, row in zip(('`~/measured_legs` at 1 kHz', 'no measured legs'),
                          latency_rows('', nodes, turns, beside=1), strict=True):
        cells.append((title, *row[1:-2]))
    return ['', *markdown(cells), '', measurement_words(), '']


def base_lines(rounds: int, seconds: int, folder: Path) -> list[str]:
    """Return the table of a node with an IMU on its base beside one whose base is fixed."""
    nodes = [ours('swaying', 'separate', 'base.source:=imu', 'base.timeout:=1.0'),
             ours('alone', 'separate')]
    turns = in_turns(nodes, rounds, seconds, folder, beside='sway')
    cells = [HEADER[:-4] + ('p50, times fixed', 'p99, times fixed')]
    for title, row in zip(('`~/base/imu` at 200 Hz', 'fixed base'),
                          latency_rows('', nodes, turns, beside=1), strict=True):
        cells.append((title, *row[1:-2]))
    return ['', *markdown(cells), '']


def measurement_words() -> str:
    """Return how long a measurement takes, from its message to the wrench's."""
    parameters = Parameters.from_yaml(PARAMETERS)
    messages = legs(parameters, FIRST_STAMP)
    step, written = ExternalWrench(parameters), OutputMessages(parameters)

    def follow() -> None:
        measured = MeasuredLegs(parameters, step, lambda *said: None, lambda said: None)
        for message in messages:
            estimate = measured.use_message(message, NO_WRENCH, None)
            if estimate is None:
                raise SystemExit('a measurement was rejected')
            if estimate.wrench is not None:
                written.write_wrench(estimate.stamp, estimate.wrench)

    times = repeat(follow, timer=time.process_time, repeat=21, number=1)
    return (f'A measurement takes {median(times) / len(messages) * 1e6:.1f} us of processor time, '
            "from its message's bytes to those of the wrench, median of 21.")


def picture_words() -> str:
    """Return how long a picture takes and how large it is."""
    parameters = Parameters.from_yaml(PARAMETERS)
    motion = motion_at(ReferenceMotionParameters(MOTION), np.array([0.3])).rows[0].tolist()
    setpoint = Batch.from_parts(FIRST_STAMP, motion)
    outputs = Step(parameters)(setpoint)
    assert outputs.answered[0]
    markers = Markers(parameters)
    size = len(markers.write(setpoint, outputs))
    times = repeat(lambda: markers.write(setpoint, outputs), timer=time.process_time, repeat=21,
                   number=200)
    words = (f'A picture has {size:,} bytes and is written in {median(times) / 200 * 1e6:.0f} us '
             'of processor time, median of 21.')
    model = ModelMessages(parameters)
    for what, make in (('message of `~/joint_states`', model.joint_states),
                       ('transform of `/tf`', model.transform)):
        times = repeat(partial(make, FIRST_STAMP, motion), timer=time.process_time, repeat=21,
                       number=1000)
        words += (f' A {what} has {len(make(FIRST_STAMP, motion))} bytes and is written in '
                  f'{median(times) / 1000 * 1e6:.1f} us.')
    return words


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--rounds', type=int, default=ROUNDS, help='turns of each (%(default)s)')
    parser.add_argument('--seconds', type=int, default=SECONDS, help='of a turn (%(default)s)')
    parser.add_argument('--minutes', type=int, default=MINUTES,
                        help='of the long run; 0: none (%(default)s)')
    parser.add_argument('--parts', nargs='+', choices=PARTS, default=PARTS,
                        help='what is measured (all of it)')
    parser.add_argument('--write', action='store_true', help='put the tables into results/')
    options = parser.parse_args()
    if options.rounds < 1 or options.seconds < 1 or options.minutes < 0:
        parser.error('--rounds and --seconds must be at least 1, --minutes 0')

    lines = {}
    with tempfile.TemporaryDirectory() as name:
        if 'node' in options.parts:
            lines[BEGIN, END] = node_lines(
                options.rounds, options.seconds, options.minutes, Path(name))
        if 'markers' in options.parts:
            lines[BEGIN_MARKERS, END_MARKERS] = markers_lines(
                options.rounds, options.seconds, Path(name))
        if 'legs' in options.parts:
            lines[BEGIN_LEGS, END_LEGS] = legs_lines(
                options.rounds, options.seconds, Path(name))
        if 'base' in options.parts:
            lines[BEGIN_BASE, END_BASE] = base_lines(
                options.rounds, options.seconds, Path(name))
    versions = ', '.join(f'{name} {version(name)}' for name in ('numpy', 'ros-rclpy'))
    computer = (f'{processor_name()}, {len(os.sched_getaffinity(0))} cores. Python '
                f'{platform.python_version()}, {versions}. {options.rounds} turns of '
                f'{options.seconds} s each.')
    for (begin, end), of_part in lines.items():
        of_part += [computer, '']
        print('\n'.join(of_part))
        if options.write:
            write(of_part, begin, end)


if __name__ == '__main__':
    main()
