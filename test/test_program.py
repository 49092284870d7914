# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Output that nobody reads changes neither results nor exit codes; a full disk is an error."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from importlib import import_module
import os
from pathlib import Path
import signal
import subprocess
import sys
from typing import TextIO

from programs import run_program
import pytest
from referees import ROOT

from stewart_dynamics import __version__
from stewart_dynamics.errors import StewartError
from stewart_dynamics.program import (
    BAD_INPUT, between, folder, frequency, names_of, node_name, number, Program, share, STRICT,
    whole)
from stewart_dynamics.signals import ending_signals, interrupt_on_signals

PROGRAM = Program('some_program', 'parameters', 'something is found')


def closed() -> TextIO:
    """Return a stream that nobody reads."""
    reader, writer = os.pipe()
    os.close(reader)
    return open(writer, 'w', encoding='utf-8')


def found() -> int:
    """Print results twice, more than a buffer holds, and end."""
    for _ in range(2):
        PROGRAM.say('result ' * 9999)
    return PROGRAM.end('out', {}, True)


def test_output_that_nobody_reads(monkeypatch: pytest.MonkeyPatch,
                                  capsys: pytest.CaptureFixture[str]) -> None:
    with closed() as out, monkeypatch.context() as patched:
        patched.setattr(sys, 'stdout', out)
        assert PROGRAM.exit_code(found) == STRICT
    assert capsys.readouterr().err == ''


def test_errors_that_nobody_reads(monkeypatch: pytest.MonkeyPatch) -> None:
    def bad() -> int:
        raise StewartError('bad')

    with closed() as out, closed() as err, monkeypatch.context() as patched:
        patched.setattr(sys, 'stdout', out)
        patched.setattr(sys, 'stderr', err)
        assert PROGRAM.exit_code(found) == STRICT
        assert PROGRAM.exit_code(bad) == BAD_INPUT


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='needs /dev/full')
def test_a_full_disk_is_reported_once(monkeypatch: pytest.MonkeyPatch,
                                      capsys: pytest.CaptureFixture[str]) -> None:
    with open('/dev/full', 'w', encoding='utf-8') as out, monkeypatch.context() as patched:
        patched.setattr(sys, 'stdout', out)
        assert PROGRAM.exit_code(found) == BAD_INPUT
    assert PROGRAM.exit_code(found) == STRICT  # on another stream
    assert capsys.readouterr().err == (
        'some_program: standard output: cannot be written: No space left on device\n')


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='needs /dev/full')
@pytest.mark.parametrize('option', ['--help', '--version'])
@pytest.mark.parametrize(('program', 'code'), [
    *((f'stewart_{name}', BAD_INPUT) for name in (
        'calibrate', 'capability', 'cueing_report', 'describe', 'export', 'identify', 'replay')),
    *((f'stewart_{name}', 1) for name in ('cueing', 'dynamics', 'simulator', 'trajectory'))])
def test_all_programs_say_that_the_disk_is_full(program: str, code: int, option: str) -> None:
    with open('/dev/full', 'w', encoding='utf-8') as out:
        done = subprocess.run(
            [Path(sys.executable).with_name(program), option], stdout=out,
            stderr=subprocess.PIPE, text=True, timeout=300, check=False)
    assert done.returncode == code
    assert done.stderr == (
        f'{program}: standard output: cannot be written: No space left on device\n')


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='needs /dev/full')
def test_results_are_complete_though_the_disk_of_the_output_is_full(tmp_path: Path) -> None:
    with open('/dev/full', 'w', encoding='utf-8') as out:
        done = subprocess.run(
            [Path(sys.executable).with_name('stewart_replay'), ROOT / 'bags' / 'clear',
             '--params', ROOT / 'config' / 'platform.yaml', '--output', tmp_path, '--no-report'],
            stdout=out, stderr=subprocess.PIPE, text=True, timeout=300, check=False)
    assert done.returncode == BAD_INPUT and 'cannot be written' in done.stderr
    assert (tmp_path / 'clear' / 'summary.json').exists()


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        PROGRAM.parser('Does something.', 'no files').parse_args(['--version'])
    assert end.value.code == 0
    assert capsys.readouterr().out == f'stewart_dynamics {__version__}\n'


def test_the_end_of_the_terminal_is_an_interrupt_but_not_under_nohup() -> None:
    before = signal.getsignal(signal.SIGHUP)
    try:
        assert signal.SIGHUP in ending_signals()
        interrupt_on_signals()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGHUP)
        # and is ignored from then on, while partial results are removed
        signal.raise_signal(signal.SIGHUP)
        assert signal.SIGHUP not in ending_signals()
        interrupt_on_signals()
        signal.raise_signal(signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.mark.parametrize('module', ['ros.console_scripts', *(
    'calibration', 'datasheet', 'description', 'export', 'identification', 'replay')])
def test_signals_are_handled_before_anything_large_is_imported(module: str) -> None:
    done = run_program(sys.executable, '-I', '-c',
                       f'import stewart_dynamics.{module}, sys; print(*sys.modules)')
    assert not {'argparse', 'numpy', 'yaml', 'threading', 'stewart_dynamics.program'} & set(
        done.out.split())


@pytest.mark.parametrize('module', ['datasheet', 'description', 'questions'])
def test_help_needs_no_numpy(module: str) -> None:
    code = (f'import sys; from stewart_dynamics.{module} import main\n'
            'try: main(["--help"])\n'
            'except SystemExit: print("numpy" in sys.modules)')
    assert run_program(sys.executable, '-c', code).out.endswith('False\n')


@pytest.mark.parametrize('kind', [number, frequency, between(-1.0, 1.0), share(0.5), whole(1, 9)])
@pytest.mark.parametrize('text', ['nan', 'inf', '1e400', '', 'abc', '1_0', '\u0661'])
def test_what_is_no_number_says_so_for_every_option(
        kind: Callable[[str], float], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    parser = Program('program', 'input').parser('text', 'files')
    parser.add_argument('--value', type=kind)
    with pytest.raises(SystemExit) as end:
        parser.parse_args([f'--value={text}'])
    assert end.value.code == BAD_INPUT
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith('program: error: argument --value: ') and 'must be a' in last


@pytest.mark.parametrize('module', [
    'calibration.calibrate', 'datasheet.datasheet', 'identification.identify', 'replay.replay'])
def test_no_option_takes_a_number_of_any_size(module: str) -> None:
    """An extreme value is rejected in a short line, or is of a size that can be computed with."""
    parser = import_module(f'stewart_dynamics.{module}_command_line')._arguments()
    options = [each for each in parser._actions if each.type is not None and getattr(
        each.type, '__module__', '') == 'stewart_dynamics.program' and each.type not in (
            folder, names_of, node_name)]
    assert options
    for option in options:
        for text in ('1e-320', '1e-299', '1e15', '1e300', '-1e300', '1.7e308', '-0', '', 'inf',
                     'nan', '9' * 400, '0x10', '1e', '- 1'):
            try:
                value = option.type(text)
            except argparse.ArgumentTypeError as exc:
                assert 'must be' in str(exc) and len(str(exc)) < 200
            else:
                assert abs(value) <= 1e15


@pytest.mark.parametrize('text', ['1e-320', '1e-299', '0.0009', '0.6', '-0.1'])
def test_a_share_of_something_is_none_or_enough_of_it(text: str) -> None:
    assert [share(0.5)(each) for each in ('0', '-0', '0.001', '0.5')] == [0.0, 0.0, 0.001, 0.5]
    with pytest.raises(argparse.ArgumentTypeError, match='must be at least 0.001, at most 0.5'):
        share(0.5)(text)


@pytest.mark.parametrize('text', ['-1e-3', '-1.e+3', '-.5E2', '-2'])
def test_a_negative_number_with_an_exponent_is_no_option(text: str) -> None:
    parser = Program('program', 'input').parser('text', 'files')
    parser.add_argument('--value', type=number, nargs=2)
    assert parser.parse_args(['--value', '0', text]).value == [0.0, float(text)]
