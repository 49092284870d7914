# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
Many bags on this computer and on a cluster, and errors in some of them.

Processes are killed for real, where the files that they hold open show that they are in the
middle of a bag.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
import csv
import errno
import fcntl
import json
import logging
import multiprocessing
from multiprocessing.process import BaseProcess
import os
from pathlib import Path
import pickle
import pty
import re
import shutil
import signal
import struct
import subprocess
import sys
import termios
import time
from typing import Any
import uuid

from cases import few
from distributed import Client, LocalCluster
import messages
import numpy as np
from programs import run_program
import pytest
from referees import ROOT
from rosbags.highlevel import AnyReader
from snapshot import Snapshot

from stewart_dynamics import BagError, Motion, Parameters, StewartError
from stewart_dynamics.bags.find import folders_of_results
from stewart_dynamics.program import BAD_INPUT, DONE, PARTLY_READ
from stewart_dynamics.replay.bag_task import finished, kept, replay_task, STOPPED, Task
from stewart_dynamics.replay.dask_cluster import _on_worker, _stop
from stewart_dynamics.replay.local_processes import _start_server
from stewart_dynamics.replay.many_bags import Fleet, replay_fleet
from stewart_dynamics.replay.one_bag import replay
from stewart_dynamics.replay.replay_options import LIMIT_MET, NODE, Options

PROGRAM = 'stewart_replay'

PARAMS = ROOT / 'config' / 'platform.yaml'
PARAMETERS = Parameters.from_yaml(PARAMS)
PLAIN = Options(report=False)
SECOND = 1_000_000_000


def heave(folder: Path, number: int, amplitude: float = 0.05) -> Path:
    """Write a bag of setpoints 1 ms apart."""
    count = np.arange(number)
    up, phase = np.array([0.0, 0.0, 1.0]), 0.001 * count[:, None]
    sine, cosine = (amplitude * f(phase) * up for f in (np.sin, np.cos))
    return messages.write_bag(folder, messages.setpoints(
        SECOND + messages.MS * count, Motion(1.1 * up + sine, np.eye(3), cosine, None, -sine)))


@pytest.fixture(scope='module')
def long_bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a bag that takes so long that a process can be caught in the middle of it."""
    return heave(tmp_path_factory.mktemp('long') / 'long', 80_000)


@pytest.fixture(scope='module')
def nine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of nine bags."""
    folder = tmp_path_factory.mktemp('nine')
    for n in range(9):
        heave(folder / f'{n}', 50 + n)
    return folder


@pytest.fixture
def short(tmp_path: Path, nine: Path) -> Path:
    """Return a folder of ten short bags, one of which meets limits."""
    folder = tmp_path / 'bags'
    shutil.copytree(nine, folder / 'short')
    shutil.copytree(ROOT / 'bags' / 'singular', folder / 'singular')
    return folder


@pytest.fixture
def bags(short: Path, long_bag: Path) -> Path:
    """Return a folder of bags: a long one and ten short ones, one of which meets limits."""
    shutil.copytree(long_bag, short / 'long', copy_function=os.link)
    return short


@pytest.fixture(scope='module')
def two_workers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LocalCluster]:
    made = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address='127.0.0.1:0',
                        silence_logs=logging.CRITICAL,
                        local_directory=f'{tmp_path_factory.mktemp("dask")}')
    yield made
    # Workers that tests have killed may end later than Dask waits; they are daemons.
    with suppress(TimeoutError, asyncio.TimeoutError):
        made.close()


@pytest.fixture
def cluster(two_workers: LocalCluster) -> LocalCluster:
    """Return the cluster when both workers answer: another test may have killed one."""
    with Client(two_workers, set_as_default=False) as client:
        until(lambda: len(client.run(os.getpid, on_error='ignore')) == 2, 'two workers')
    return two_workers


def until(condition: Callable[[], Any], what: str) -> Any:
    """Return the value of a condition as soon as it is true."""
    end = time.monotonic() + 300.0
    while not (found := condition()):
        assert time.monotonic() < end, f'waited for {what}'
        time.sleep(0.002)
    return found


def process_in(folder: Path, bag: str) -> int | None:
    """Return the other process that is writing the results of a bag."""
    if not any(folder.glob(f'.{bag}.*')):
        return None
    for process in Path('/proc').glob('[0-9]*'):
        if process.name == f'{os.getpid()}':
            continue  # it removes the partial results of others, and has that folder open
        try:
            held = [os.readlink(file) for file in (process / 'fd').iterdir()]
        except OSError:  # has ended, or belongs to another user
            continue
        if any(file.startswith(f'{folder}/.{bag}.') for file in held):
            return int(process.name)
    return None


def hidden(folder: Path) -> list[Path]:
    return [path for path in folder.rglob('.*') if folder in path.parents]


def rows(output: Path) -> dict[str, dict[str, str]]:
    """Return fleet.csv by bag."""
    with (output / 'fleet.csv').open(newline='', encoding='utf-8') as file:
        found = list(csv.DictReader(file))
    by_bag = {row['bag']: row for row in found}
    assert len(by_bag) == len(found)
    return by_bag


def check_whole(folder: Path, bag: Path) -> str:
    """Check that a bag has its results, all of them; return the name of the run."""
    summary = json.loads((folder / 'summary.json').read_text(encoding='utf-8'))
    answered = summary['setpoints']['answered']
    assert summary['complete']
    with AnyReader([bag]) as reader:
        assert answered == sum(c.msgcount for c in reader.connections
                               if c.topic == f'{NODE}/setpoint/pose')
    with AnyReader([folder / 'bag']) as reader:
        assert {c.topic: c.msgcount for c in reader.connections}[f'{NODE}/leg_forces'] == answered
    with (folder / 'legs.csv').open(encoding='utf-8') as file:
        assert sum(1 for _ in file) == answered + 1
    return str(summary['run'])


def check_each_once(fleet: Fleet, pairs: list[tuple[Path, Path]], output: Path) -> None:
    """Check that every bag is done, once, and that nothing else is there."""
    assert [(each.bag, each.folder) for each in fleet.ended] == pairs
    assert [each.error for each in fleet.ended] == [''] * len(pairs)
    runs = {check_whole(folder, bag) for bag, folder in pairs}
    assert len(runs) == 1
    assert runs != {''}
    assert list(rows(output)) == [f'{bag}' for bag, _ in pairs]
    assert {path.parent for path in output.rglob('summary.json')} == {f for _, f in pairs}
    assert hidden(output) == []
    assert (output / 'index.html').stat().st_size > 1000


def check_only_the_long_one_failed(
        fleet: Fleet, pairs: list[tuple[Path, Path]], output: Path) -> None:
    errors = {each.bag.name: each.error for each in fleet.ended if each.code == BAD_INPUT}
    assert [*errors] == ['long'], errors
    assert not fleet.ended[0].folder.exists()
    assert hidden(output) == []
    for bag, folder in pairs[1:]:
        check_whole(folder, bag)
    assert len(rows(output)) == len(pairs)


# On this computer

@pytest.mark.parametrize('where', few(['processes', 'here', 'cluster'], 1))
def test_every_bag_is_replayed_once_with_its_progress(
        bags: Path, tmp_path: Path, where: str, request: pytest.FixtureRequest,
        monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    # Relative paths mean the same in workers, wherever these were started.
    monkeypatch.chdir(tmp_path)
    output = Path('out') / 'of two'
    pairs = folders_of_results([Path('bags')], output)
    assert len(pairs) == 11
    scheduler = request.getfixturevalue(
        'cluster').scheduler_address if where == 'cluster' else None
    fleet = replay_fleet(pairs, PARAMETERS, output, PLAIN, 2 if where == 'processes' else 1,
                         scheduler, show_progress=True)
    check_each_once(fleet, pairs, output)
    assert [each.code for each in fleet.ended] == [DONE] * 10 + [LIMIT_MET]
    assert (fleet.code(strict=False), fleet.code(strict=True)) == (DONE, LIMIT_MET)
    assert fleet.text() == '11 bags: 10 done, 1 with a limit or warning'
    # the row of a bag is its summary's
    summary = json.loads((output / 'singular' / 'summary.json').read_text(encoding='utf-8'))
    row = rows(output)['bags/singular']
    peak = max(summary['legs'].items(), key=lambda leg: abs(leg[1]['force_peak_n']))
    assert (row['force_worst_leg'], float(row['force_worst_n'])) == (
        peak[0], peak[1]['force_peak_n'])
    assert (row['crossings'], row['warnings'], row['results']) == ('1', '1', 'singular')
    # results are those of a replay of one bag
    bag, folder = pairs[-1]
    replay(bag, PARAMETERS, tmp_path / 'own', PLAIN)
    for file in ('legs.csv', 'bag/bag.mcap'):
        own = tmp_path / 'own' / file
        assert (folder / file).read_bytes() == own.read_bytes()
    lines = capfd.readouterr().err.replace('\r', '\n').splitlines()
    found = [re.search(r'(\d+)%.* (\d+)/11 bags, (\S+) setpoints, (\S+)/s, (\S+) left', line)
             for line in lines]
    seen = [each.groups() for each in found if each]
    percents = [int(percent) for percent, *_ in seen]
    assert percents == sorted(percents)
    # in the middle there is nothing but the long bag
    assert where == 'cluster' or any(10 < percent < 90 for percent in percents)
    total = sum(int(f'{each.row["setpoints"]}') for each in fleet.ended)
    percent, number, setpoints, rate, left = seen[-1]
    assert (percent, number, left) == ('100', '11', '00:00')
    assert float(setpoints.removesuffix('k')) == pytest.approx(total / 1000, rel=0.01)
    assert float(rate.removesuffix('k')) > 0.0


def test_bad_bags_do_not_stop_the_others(
        short: Path, tmp_path: Path, long_bag: Path) -> None:
    bags, whole = short, (long_bag / 'long.mcap').read_bytes()
    (bags / 'cut').mkdir()
    (bags / 'cut' / 'cut.mcap').write_bytes(whole[:len(whole) // 2])
    (bags / 'noise').mkdir()
    (bags / 'noise' / 'noise.mcap').write_bytes(b'\x00\xff' * 1000)
    heave(bags / 'other', 3)
    shutil.copytree(ROOT / 'bags' / 'flawed', bags / 'flawed')
    output = tmp_path / 'out'
    (output / 'other').mkdir(parents=True)
    pairs = [*folders_of_results([bags], output), (tmp_path / 'none', output / 'none')]
    fleet = replay_fleet(pairs, PARAMETERS, output, PLAIN, jobs=2)
    ended = {each.bag.name: each for each in fleet.ended}
    assert {name: each.code for name, each in ended.items() if each.code} == {
        'cut': PARTLY_READ, 'noise': BAD_INPUT, 'none': BAD_INPUT, 'other': BAD_INPUT,
        'singular': LIMIT_MET}
    assert fleet.code(strict=True) == BAD_INPUT
    assert fleet._replace(ended=(ended['singular'], ended['cut'])).code(True) == PARTLY_READ
    # each is named, with its error, in one line
    head, *told = fleet.text().splitlines()
    assert head == (
        '15 bags: 9 done, 1 with messages rejected, 1 with a limit or warning, 1 incomplete, '
        '3 failed')
    assert len(told) == 4
    for name, why in (('cut', 'cut.mcap: '), ('noise', 'not MCAP, not sqlite3'),
                      ('none', 'no such file'), ('other', 'exists already')):
        line = ended[name].error
        assert line in told
        assert line.startswith(f'{ended[name].bag}')
        assert why in line
        row = rows(output)[f'{ended[name].bag}']
        assert row['reason']
        assert row['reason'].partition('; setpoint/')[0] in line  # without rejected messages
    assert int(rows(output)[f'{bags / "cut"}']['setpoints']) > 100
    assert rows(output)[f'{bags / "cut"}']['complete'] == 'false'
    assert int(rows(output)[f'{bags / "flawed"}']['rejected']) > 100
    assert rows(output)[f'{bags / "noise"}']['results'] == ''
    assert list((output / 'other').iterdir()) == []
    assert hidden(output) == []


def test_results_are_not_overwritten(short: Path, tmp_path: Path, snapshot: Snapshot) -> None:
    output = tmp_path / 'out'
    pairs = folders_of_results([short / 'short'], output)
    first = replay_fleet(pairs, PARAMETERS, output, PLAIN)
    before = {path: path.read_bytes() for path in output.rglob('*') if path.is_file()}
    heavy = PARAMETERS.replaced({'platform.mass': 151.0})
    with snapshot.raises(BagError):
        replay_fleet(pairs, heavy, output, PLAIN)
    with snapshot.raises(BagError):
        replay_fleet(folders_of_results([short / 'singular'], output), PARAMETERS, output, PLAIN)
    assert {path: path.read_bytes() for path in output.rglob('*') if path.is_file()} == before
    (tmp_path / 'other').mkdir()
    (tmp_path / 'other' / 'fleet.csv').write_text('ship,port\n')
    with snapshot.raises(BagError):
        replay_fleet(pairs, PARAMETERS, tmp_path / 'other', PLAIN)
    again = replay_fleet(pairs, PARAMETERS, output, PLAIN._replace(force=True))
    check_each_once(again, pairs, output)
    assert [each.row for each in again.ended] == [each.row for each in first.ended]
    (output / 'index.html').unlink()
    (output / 'index.html').mkdir()
    with snapshot.raises(BagError):
        replay_fleet(pairs, PARAMETERS, output, PLAIN._replace(force=True))


def test_a_bag_finished_by_the_same_run_is_not_replayed_again(short: Path, tmp_path: Path) -> None:
    """As left by a process that dies before it can report it."""
    (bag, folder), *_ = folders_of_results([short / 'short'], tmp_path / 'out')
    task = Task(0, bag, folder, PARAMETERS, PLAIN._replace(run='this'))
    first = replay_task(task, lambda *_: None)
    before = folder.stat().st_mtime_ns
    assert replay_task(task, lambda *_: None) == finished(task) == first
    other = replay_task(task._replace(options=PLAIN._replace(run='other')), lambda *_: None)
    assert other.code == BAD_INPUT
    assert 'exists already' in other.error
    assert folder.stat().st_mtime_ns == before


@pytest.mark.parametrize('deaths', [1, 2])
@pytest.mark.parametrize('where', few(['processes', 'cluster'], 1))
def test_a_process_that_dies_costs_only_its_bag(
        bags: Path, tmp_path: Path, deaths: int, where: str, request: pytest.FixtureRequest,
        monkeypatch: pytest.MonkeyPatch) -> None:
    output = tmp_path / 'out'
    pairs = folders_of_results([bags], output)
    how: dict[str, Any] = {'jobs': 2}
    if where == 'cluster':
        cluster = request.getfixturevalue('cluster')
        how = {'scheduler': cluster.scheduler_address}
        workers = {worker.pid for worker in cluster.workers.values()}
        if deaths == 2:
            # With one death Dask fails the bag, and each that waits for its worker: none does.
            pairs = pairs[:2]
            monkeypatch.setattr(cluster.scheduler, 'allowed_failures', 0)
    killed = [os.getpid()]
    with ThreadPoolExecutor() as apart:
        running = apart.submit(replay_fleet, pairs, PARAMETERS, output, PLAIN, **how)
        for _ in range(deaths):
            killed.append(until(
                lambda: (pid := process_in(output, 'long')) not in killed and pid,
                'another process in the middle of a bag'))
            os.kill(killed[-1], signal.SIGKILL)
        left = hidden(output)
        fleet = running.result()
    if where == 'cluster':
        # Its partial results are left, and another worker has replayed the bag.
        assert killed[1] in workers
        assert any(path.name.startswith('.long.') for path in left)
    if deaths == 1:
        check_each_once(fleet, pairs, output)
        return
    check_only_the_long_one_failed(fleet, pairs, output)
    assert fleet.ended[0].error == (f'{bags / "long"}: every process that replayed it was killed '
                                    '(out of memory?)')


def fork_server() -> int:
    """Return the process that starts the processes of this one."""
    def is_server(process: Path) -> bool:
        with suppress(OSError):  # it has ended
            parent = process.joinpath('stat').read_text().rpartition(')')[2].split()[1]
            return parent == f'{os.getpid()}' and b'forkserver' in (
                process / 'cmdline').read_bytes()
        return False

    return int(next(filter(is_server, Path('/proc').glob('[0-9]*'))).name)


@pytest.mark.parametrize('begun', few([True, False], 1))
def test_a_killed_fork_server_costs_no_bag(
        tmp_path: Path, begun: bool, request: pytest.FixtureRequest) -> None:
    output = tmp_path / 'out'
    pairs = folders_of_results([request.getfixturevalue('bags' if begun else 'short')], output)
    with ThreadPoolExecutor() as apart:
        if not begun:  # before the first process is started
            _start_server()
            os.kill(fork_server(), signal.SIGKILL)
        running = apart.submit(replay_fleet, pairs, PARAMETERS, output, PLAIN, 2)
        if begun:
            until(lambda: process_in(output, 'long'), 'a process in the middle of a bag')
            os.kill(fork_server(), signal.SIGKILL)
        fleet = running.result()
    check_each_once(fleet, pairs, output)


def test_processes_that_cannot_start_are_reported_at_once(short: Path, tmp_path: Path) -> None:
    script = tmp_path / 'script.py'
    script.write_text(
        'from pathlib import Path\n'
        'from stewart_dynamics import Parameters, StewartError\n'
        'from stewart_dynamics.bags.find import folders_of_results\n'
        'from stewart_dynamics.replay.many_bags import replay_fleet\n'
        'from stewart_dynamics.replay.replay_options import Options\n'
        f'output = Path({str(tmp_path / "out")!r})\n'
        f'pairs = folders_of_results([Path({str(short)!r})], output)\n'
        f'parameters = Parameters.from_yaml({str(PARAMS)!r})\n'
        # what a process runs, too, that is started by this one
        'try:\n'
        '    replay_fleet(pairs, parameters, output, Options(), jobs=2)\n'
        'except StewartError as exc:\n'
        '    print(exc)\n', encoding='utf-8')
    ended = run_program(sys.executable, script, code=None)
    assert ended.out == 'the processes to replay bags could not start\n'
    assert "if __name__ == '__main__':" in ended.err


def test_replaced_results_are_restored_if_their_replacement_is_incomplete(
        short: Path, tmp_path: Path) -> None:
    """As left by a process that dies between the two renames."""
    output = tmp_path / 'out'
    pairs = folders_of_results([short / 'short'], output)
    for name in ('.long.{}.replaced', '.0.{}', '.another.{}'):
        path = output / name.format(f'{32 * "a"}.partial.12345678')
        path.mkdir(parents=True)
        (path / 'summary.json').touch()
    replay_fleet([*pairs, (tmp_path / 'none', output / 'long')], PARAMETERS, output, PLAIN)
    assert (output / 'long' / 'summary.json').exists()
    # results of bags that are not in this run stay
    assert [path.name.split('.')[1] for path in hidden(output)] == ['another']


def test_hostile_names(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = ['=1+1', '-1', '@x', '+x', '<b>', 'a\nb', 'a;b', "'", os.fsdecode(b'caf\xe9')]
    for name in names:
        heave(tmp_path / 'bags' / name, 3)
    monkeypatch.chdir(tmp_path / 'bags')
    output = tmp_path / 'out'
    pairs = folders_of_results([Path('.')], output)
    assert {f'{bag}' for bag, _ in pairs} == set(names)
    fleet = replay_fleet(pairs, PARAMETERS, output, Options(), jobs=2)
    assert [each.error for each in fleet.ended] == [''] * len(names)
    assert set(rows(output)) == {'./=1+1', './-1', './@x', './+x', '<b>', 'a\nb', 'a;b', "'",
                                 'caf\\udce9'}
    assert {folder for folder in output.iterdir() if folder.is_dir()} == {
        output / name for name in names}


@pytest.mark.slow
def test_an_interrupted_run_continues(short: Path, tmp_path: Path) -> None:
    output = tmp_path / 'out'
    pairs = folders_of_results([short], output)
    for bag, folder in (pairs[0], pairs[-1]):
        replay(bag, PARAMETERS, folder, PLAIN._replace(run='interrupted'))
    (pairs[1][1] / 'bag').mkdir(parents=True)  # not complete: without summary.json
    for _, folder in (pairs[0], pairs[2]):  # of a run that was killed
        folder.with_name(f'.{folder.name}.{32 * "0"}.partial.12345678').mkdir(parents=True)

    def times() -> dict[Path, int]:
        return {folder: folder.stat().st_mtime_ns for _, folder in pairs if folder.exists()}

    before = times()
    fleet = replay_fleet(pairs, PARAMETERS, output, PLAIN)
    assert [each.kept for each in fleet.ended] == [True, *[False] * 8, True]
    assert hidden(output) == []
    assert fleet.text().splitlines() == [
        '10 bags: 8 done, 1 with a limit or warning, 1 failed; 2 kept from an earlier run, their '
        'inputs have not changed', fleet.ended[1].error]
    assert {folder: when for folder, when in times().items() if folder in before} == before
    (pairs[1][1] / 'bag').rmdir()
    pairs[1][1].rmdir()
    # all are in the table, as if they had been replayed at once
    again = replay_fleet(pairs, PARAMETERS, output, PLAIN)
    assert [each.kept for each in again.ended] == [True, False, *[True] * 8]
    whole = replay_fleet(
        folders_of_results([short], tmp_path / 'whole'), PARAMETERS, tmp_path / 'whole', PLAIN)
    assert [(each.row, each.text) for each in again.ended] == [
        (each.row, each.text) for each in whole.ended]
    assert (output / 'fleet.csv').read_bytes() == (tmp_path / 'whole' / 'fleet.csv').read_bytes()


def test_results_are_kept_only_of_unchanged_inputs(short: Path, tmp_path: Path) -> None:
    (bag, folder), (other_bag, _), *_ = folders_of_results([short / 'short'], tmp_path / 'out')
    replay(bag, PARAMETERS, folder, PLAIN)
    task = Task(0, bag, folder, PARAMETERS, PLAIN)
    assert kept(task)
    for other in (
            task._replace(parameters=PARAMETERS.replaced({'gravity': [0.0, 0.0, -9.8]})),
            task._replace(options=PLAIN._replace(cutoff=5.0)),
            task._replace(options=PLAIN._replace(topics={'wrench': '/load'})),
            task._replace(options=PLAIN._replace(report=True)),
            task._replace(bag=other_bag)):
        assert not kept(other)
    (folder / 'legs.csv').rename(folder / 'moved')
    assert not kept(task)
    (folder / 'moved').rename(folder / 'legs.csv')
    assert kept(task)
    file, = bag.glob('*.mcap')
    os.utime(file, ns=(1, 1))
    assert not kept(task)


# Progress

def test_progress_is_shown_only_in_terminals(
        bags: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    pairs = folders_of_results([bags / 'short'], tmp_path / 'out')
    replay_fleet(pairs, PARAMETERS, tmp_path / 'out', PLAIN)
    assert capfd.readouterr() == ('', '')
    ours, its = pty.openpty()
    fcntl.ioctl(its, termios.TIOCSWINSZ, struct.pack('4H', 24, 100, 0, 0))
    program = subprocess.Popen(
        [sys.executable, '-m', 'stewart_dynamics.replay', f'{bags}', '--params', f'{PARAMS}',
         '--output', f'{tmp_path / "seen"}', '--no-report', '--jobs', '2'], stderr=its,
        stdout=subprocess.DEVNULL)
    os.close(its)
    seen = b''
    try:
        while more := os.read(ours, 65536):
            seen += more
    except OSError as exc:  # on Linux: the other end is closed
        assert exc.errno == errno.EIO
    assert program.wait(300) == DONE
    assert re.search(r'\D[1-8]\d%.* \d+/11 bags, \d\S*k setpoints, \S+/s, 00:\d\d left',
                     seen.decode())


# Interrupts

def program(bags: Path, output: Path, *options: str) -> subprocess.Popen[str]:
    """Start the program as the head of a group of processes, as a shell does."""
    return subprocess.Popen(
        [sys.executable, '-m', 'stewart_dynamics.replay', f'{bags}', '--params', f'{PARAMS}',
         '--output', f'{output}', '--no-report', *options],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)


@pytest.fixture
def huge(bags: Path) -> Path:
    """Return a folder of bags one of which takes many seconds: a recording in many files."""
    shutil.copytree(bags / 'short', bags / 'more' / 'short')
    (bags / 'more' / 'huge').mkdir()
    for n in range(20):
        os.link(bags / 'long' / 'long.mcap', bags / 'more' / 'huge' / f'huge_{n}.mcap')
    return bags / 'more'


def group_is_gone(leader: int) -> bool:
    try:
        os.killpg(leader, 0)
    except ProcessLookupError:
        return True
    return False


@pytest.mark.parametrize('where, sent', [
    ('here', signal.SIGINT), ('processes', signal.SIGINT), ('processes', signal.SIGHUP),
    ('processes', signal.SIGTERM), ('cluster', signal.SIGINT)])
@pytest.mark.slow
def test_an_interrupt_leaves_no_partial_results(
        huge: Path, tmp_path: Path, where: str, sent: signal.Signals,
        cluster: LocalCluster) -> None:
    output = tmp_path / 'out'
    options = {'here': (), 'processes': ('--jobs', '2'),
               'cluster': ('--scheduler', cluster.scheduler_address)}[where]
    running = program(huge, output, *options)
    until(lambda: process_in(output, 'huge'), 'the middle of a bag')
    os.killpg(running.pid, sent)
    out, err = running.communicate(timeout=300)
    # Python itself dies of the signal where it comes while text is executed: 130 to a shell.
    assert running.returncode in (130, -signal.SIGINT)
    assert out == ''
    assert re.fullmatch(r'stewart_replay: interrupted: \d+ of \d+ bags are done; the same '
                        'command continues with the others\n', err)
    assert hidden(output) == []
    assert not (output / 'huge').exists()
    assert not (output / 'fleet.csv').exists()
    assert not (output / 'index.html').exists()
    until(lambda: group_is_gone(running.pid), 'the end of its processes')
    # finished results are complete
    for folder in (path.parent for path in output.rglob('summary.json')):
        check_whole(folder, huge / folder.relative_to(output))


@pytest.mark.slow
def test_a_signal_while_a_process_starts_is_not_in_its_way(
        short: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    start, begun = BaseProcess.start, []

    def interrupted(process: BaseProcess) -> None:
        signal.raise_signal(signal.SIGINT)
        start(process)
        begun.append(process)

    monkeypatch.setattr(BaseProcess, 'start', interrupted)
    output = tmp_path / 'out'
    handler, others = signal.getsignal(signal.SIGINT), set(multiprocessing.active_children())
    try:
        with pytest.raises(KeyboardInterrupt, match='^0 of 10 bags are done; the same command '):
            replay_fleet(folders_of_results([short], output), PARAMETERS, output, PLAIN, jobs=2)
        assert len(begun) == 1  # others are not waited for
        assert set(multiprocessing.active_children()) == others
        assert hidden(output) == []
        assert signal.getsignal(signal.SIGINT) is handler
    finally:
        # The end of the tests would wait for them.
        for left in set(multiprocessing.active_children()) - others:
            left.kill()


@pytest.mark.slow
def test_processes_end_with_the_one_that_started_them(huge: Path, tmp_path: Path) -> None:
    output = tmp_path / 'out'
    running = program(huge, output, '--jobs', '2')
    until(lambda: process_in(output, 'huge'), 'the middle of a bag')
    running.kill()
    running.wait()
    until(lambda: group_is_gone(running.pid), 'the end of its processes')
    running.communicate(timeout=300)
    assert hidden(output) == []


# On a cluster

@pytest.mark.slow
def test_a_lost_cluster_is_reported_for_each_bag(
        huge: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    script = tmp_path / 'cluster.py'
    script.write_text(
        'import sys\n'
        'from distributed import LocalCluster\n'
        "if __name__ == '__main__':\n"
        "    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address='127.0.0.1:0',"
        f'\n                      local_directory={str(tmp_path)!r}) as cluster:\n'
        '        print(cluster.scheduler_address, flush=True)\n'
        '        sys.stdin.read()\n', encoding='utf-8')
    output = tmp_path / 'out'
    pairs = folders_of_results([huge], output)
    lost = subprocess.Popen([sys.executable, script], stdin=subprocess.PIPE,
                            stdout=subprocess.PIPE, text=True, start_new_session=True)
    assert lost.stdout is not None
    with ThreadPoolExecutor() as apart:
        running = apart.submit(replay_fleet, pairs, PARAMETERS, output, PLAIN,
                               scheduler=lost.stdout.readline().strip())
        until(lambda: process_in(output, 'huge'), 'a worker in the middle of a bag')
        os.killpg(lost.pid, signal.SIGKILL)
        fleet = running.result()
    lost.communicate()
    failed = {each.bag: each.error for each in fleet.ended if each.code == BAD_INPUT}
    assert huge / 'huge' in failed
    assert all('connection' in error for error in failed.values())
    for each in fleet.ended:
        if each.bag not in failed:
            check_whole(each.folder, each.bag)
    assert set(rows(output)) == {f'{bag}' for bag, _ in pairs}
    assert hidden(output) == []
    assert 'Traceback' not in capfd.readouterr().err


@pytest.mark.slow
def test_a_worker_begins_no_bag_of_a_run_that_was_stopped(
        cluster: LocalCluster, tmp_path: Path) -> None:
    """A task may come to a worker before the end of its run, and begin after it."""
    options = PLAIN._replace(run=uuid.uuid4().hex)
    task = Task(0, tmp_path / 'none', tmp_path / 'out' / 'none', PARAMETERS, options)
    with Client(cluster, set_as_default=False) as client:
        client.run(_stop, options.run)
        ended = client.submit(_on_worker, task, pure=False).result()
    assert ended.error == f'{task.bag}: {STOPPED}'  # not that there is no such bag
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize('address', ['tcp://127.0.0.1:1', 'nonsense', 'foo://x', ''])
def test_a_cluster_that_is_not_there_is_an_error(
        short: Path, tmp_path: Path, address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('stewart_dynamics.replay.dask_cluster._PATIENCE', 1.0)
    output = tmp_path / 'out'
    with pytest.raises(StewartError, match=f'^{address}: no Dask scheduler answers there: \\w'):
        replay_fleet(folders_of_results([short], output), PARAMETERS, output, PLAIN,
                     scheduler=address)
    assert list(output.iterdir()) == []


def test_dask_is_imported_only_for_a_cluster(short: Path, tmp_path: Path) -> None:
    (tmp_path / 'sitecustomize.py').write_text(
        "import sys\nsys.modules['distributed'] = sys.modules['dask'] = None\n")
    arguments = [sys.executable, '-m', 'stewart_dynamics.replay', f'{short / "short"}',
                 '--params', f'{PARAMS}', '--no-report']
    for options, code, said in (
            (['--output', f'{tmp_path / "a"}', '--jobs', '2'], DONE, r'^$'),
            (['--output', f'{tmp_path / "b"}', '--scheduler', 'tcp://127.0.0.1:1'], BAD_INPUT,
             r"^stewart_replay: .*pip install 'stewart_dynamics\[cluster\]'.*\n$")):
        ended = subprocess.run(
            [*arguments, *options], capture_output=True, text=True, timeout=300, check=False,
            env={**os.environ, 'PYTHONPATH': f'{tmp_path}'})
        assert ended.returncode == code
        assert re.match(said, ended.stderr)


def test_tasks_and_outcomes_can_be_pickled() -> None:
    fleet = Fleet(())
    for each in (PLAIN, Options(topics={'pose': '/p'}), fleet):
        assert pickle.loads(pickle.dumps(each)) == each
    assert fleet.code(strict=True) == DONE
    there = pickle.loads(pickle.dumps(PARAMETERS))
    assert all(np.array_equal(there[name], PARAMETERS[name]) for name in PARAMETERS)
    assert list(there) == list(PARAMETERS)
