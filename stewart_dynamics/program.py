# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Exit codes, options and messages in one line of the programs without ROS."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from contextlib import suppress
import io
from itertools import permutations
import math
import os
from pathlib import Path
import re
import sys
from typing import Any, TextIO

from stewart_dynamics import __version__, signals
from stewart_dynamics.errors import one_line, shown_name, StewartError

DONE, STRICT, PARTLY_READ = 0, 1, 3
BAD_INPUT, INTERRUPTED = signals.BAD_INPUT, signals.INTERRUPTED
# Orders of rotations: capital letters about axes that turn along, others about fixed ones.
EULER = tuple(''.join(each) for letters in ('xyz', 'XYZ') for each in permutations(letters))
AXES = 'x,y,z'
NODE = '/stewart_dynamics'  # name of the node if no other is given
SOFTWARE = f'stewart_dynamics {__version__}'  # name and version, as results have it


class Program:
    """
    A program: its output and its end.

    bad: what ends it with BAD_INPUT, besides bad arguments.
    strict: what ends it with STRICT if the user wants that.
    partly: whether it can end with PARTLY_READ.
    """

    def __init__(self, name: str, bad: str, strict: str = '', partly: bool = False) -> None:
        self.name = name
        self._unwritten = False  # a part of the standard output is lost
        self._bad, self._strict, self._partly = bad, strict, partly

    def parser(self, description: str, files: str, more: str = '') -> argparse.ArgumentParser:
        """Return a parser whose help ends with the files that are written and the exit codes."""
        codes = {DONE: 'done', BAD_INPUT: f'bad arguments, {self._bad}',
                 INTERRUPTED: f'interrupted{more}'}
        if self._strict:
            codes[STRICT] = f'with --strict, when {self._strict}'
        if self._partly:
            codes[PARTLY_READ] = 'part of a bag could not be read, the rest is done'
        lines = [f'  {code:3} {what}' for code, what in sorted(codes.items())]
        parser = _Parser(
            prog=self.name, description=description,
            epilog='\n'.join([files, '', 'exit codes:', *lines]),
            formatter_class=argparse.RawDescriptionHelpFormatter)
        parser.register('action', None, _StoreOnce)
        # Before Python 3.14, argparse takes -1e-3 for an option.
        parser._negative_number_matcher = re.compile(r'-(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$')
        parser.add_argument('--version', action='version', version=SOFTWARE)
        return parser

    def add_results(self, parser: argparse.ArgumentParser, default: str = '') -> None:
        """Add the options of the results: their folder, required without a default, and more."""
        parser.add_argument('--output', type=folder, default=Path(default), metavar='DIR',
                            required=not default,
                            help=f'folder of the results (default: {default})' if default else
                            'folder of the results')
        parser.add_argument('--force', action='store_true', help='replace results that exist')
        if self._strict:
            parser.add_argument('--strict', action='store_true',
                                help=f'exit code {STRICT} when {self._strict}')

    def prepare(self, errors: Iterable[str]) -> None:
        """Print possible errors, and keep memory that is freed."""
        _keep_freed_memory()
        self.warn(errors)

    def warn(self, texts: Iterable[str]) -> None:
        """Print warnings, each in one line."""
        for text in texts:
            self.complain(f'warning: {text}')

    def exit_code(self, run: Callable[[], int]) -> int:
        """Run and return the exit code; errors of any kind end it with one line on stderr."""
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):  # names in bags may not be encodable
                stream.reconfigure(errors='backslashreplace')
        self._unwritten = False
        try:
            code = run()
            return BAD_INPUT if self._unwritten else code
        except StewartError as exc:
            self.complain(exc)
            return BAD_INPUT
        except OSError as exc:  # what cannot be read is a StewartError
            where = f'{exc.filename}: ' if exc.filename else ''
            self.complain(f'{where}cannot be written: {exc.strerror or exc}')
            return BAD_INPUT
        except Exception as exc:  # exit codes and one line also for errors that no rule covers
            self.complain(unexpected(exc))
            return BAD_INPUT
        except KeyboardInterrupt as exc:
            self.complain(f'interrupted: {exc}' if str(exc) else 'interrupted')
            return INTERRUPTED

    def end(self, results: object, missing: Mapping[Any, Sequence[str]], found: bool) -> int:
        """
        Print where the results are, and return the exit code.

        missing: the parts of each bag that could not be read, by bag; empty: all was.
        found: whether what gives STRICT was found, and the user wants that.
        """
        self.say(f'results: {results}')
        for bag, parts in missing.items():
            if parts:
                self.complain(partly_read(bag, parts))
        return PARTLY_READ if any(missing.values()) else STRICT if found else DONE

    def say(self, text: str) -> None:
        """Print on stdout."""
        if fault := written(_printable(text), sys.stdout):
            self._unwritten = True
            self.complain(unwritten(fault))

    def complain(self, what: object) -> None:
        """Print one line on stderr."""
        written(f'{self.name}: {_printable(one_line(what))}', sys.stderr)


class _Parser(argparse.ArgumentParser):
    """A parser whose help and version are written, or an error; shells complete by it."""

    def parse_args(self, *arguments: Any) -> Any:  # type: ignore[override]
        """Parse arguments, or answer a shell."""
        complete(self)
        return super().parse_args(*arguments)

    def _print_message(self, message: str, file: Any = None) -> None:
        """Print a message; exit if the standard output cannot be written."""
        fault = written(message.removesuffix('\n'), file or sys.stderr) if message else ''
        if fault and file is not sys.stderr:
            written(f'{self.prog}: {unwritten(fault)}', sys.stderr)
            sys.exit(BAD_INPUT)


def complete(parser: argparse.ArgumentParser) -> None:
    """Answer a shell that completes a command line, and exit; return if none has called."""
    if '_ARGCOMPLETE' in os.environ:
        with suppress(ImportError):  # an extra
            import argcomplete

            argcomplete.autocomplete(parser)


def unwritten(fault: str) -> str:
    """Return that the standard output cannot be written."""
    return f'standard output: cannot be written: {fault}'


def written(text: str, stream: TextIO) -> str:
    """
    Print text at once; return why it cannot be written, empty if it is or nobody reads it.

    Such a stream is discarded from then on, so that results do not depend on it.
    """
    try:
        print(text, file=stream, flush=True)
    except OSError as exc:
        # See "Note on SIGPIPE" in the documentation of Python's module signal.
        with open(os.devnull, 'wb') as nowhere:
            os.dup2(nowhere.fileno(), stream.fileno())
        return '' if isinstance(exc, BrokenPipeError) else exc.strerror or str(exc)
    return ''


def _keep_freed_memory() -> None:
    """
    Let glibc reuse freed memory, here and in programs started, unless the environment says how.

    Arrays of the same sizes come and go with each block of a bag; without this, a third of the
    time passes while the operating system clears their pages anew.
    """
    import ctypes  # late, so that --help is fast

    # M_MMAP_THRESHOLD and M_TRIM_THRESHOLD of mallopt(3); the first is at its largest.
    for name, number, size in (('MMAP', -3, 1 << 25), ('TRIM', -1, 1 << 28)):
        if (variable := f'MALLOC_{name}_THRESHOLD_') in os.environ:
            continue
        os.environ[variable] = str(size)
        with suppress(AttributeError, OSError, TypeError):  # another C library
            ctypes.CDLL(None).mallopt(number, size)


class _StoreOnce(argparse.Action):
    """Stores the value of an argument; an option that is given twice is an error."""

    _stored = False

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace,
                 values: Any, option_string: str | None = None) -> None:
        """Store the value."""
        if self._stored and self.option_strings:
            raise argparse.ArgumentError(self, 'given twice')
        self._stored = True
        setattr(namespace, self.dest, values)


def unexpected(exc: BaseException) -> str:
    """Return what an error is that should not occur, in one line, and where it was raised."""
    if isinstance(exc, MemoryError):
        return f'out of memory: {one_line(exc)}' if str(exc) else 'out of memory'
    at = exc.__traceback__
    while at is not None and at.tb_next is not None:
        at = at.tb_next
    where = f' ({Path(at.tb_frame.f_code.co_filename).name}, line {at.tb_lineno})' if at else ''
    return f'unexpected error, please report it: {type(exc).__name__}: {one_line(exc)}{where}'


def partly_read(bag: object, missing: Iterable[str]) -> str:
    """Return which part of a bag could not be read, for PARTLY_READ."""
    return f'{bag}: part of it could not be read: {"; ".join(missing)}'


def node_name(text: str) -> str:
    """Return the name of a node as an option gives it, with its first slash."""
    name = '/' + text.strip('/')
    if not re.fullmatch(r'(/[A-Za-z_][A-Za-z0-9_]*)+', name):
        raise argparse.ArgumentTypeError(f'{text!r}: not a valid node name')
    return name


def folder(text: str) -> Path:
    """Return the folder that an option gives; an empty text would be the current folder."""
    if not text:
        raise argparse.ArgumentTypeError("'': must name a folder")
    return Path(text)


def add_parameters(parser: argparse._ActionsContainer, more: str = '',
                   required: bool = True) -> None:
    """Add the option of the parameter file; ``more`` follows its help."""
    parser.add_argument('--params', required=required, type=Path, metavar='FILE',
                        help=f'parameters of the hexapod, the file that the node takes{more}')


def add_node(parser: argparse._ActionsContainer, more: str = '') -> None:
    """Add the option of the node's name; ``more`` follows its help."""
    parser.add_argument('--node', default=NODE, metavar='NAME', type=node_name,
                        help=f'node whose parameters are read{more} (default: {NODE})')


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Add the options for recordings of other sources; ``reading_of`` returns their values."""
    group = parser.add_argument_group('recordings of other sources')
    group.add_argument('--child', metavar='FRAME',
                       help='child_frame_id of the platform in tf2_msgs/TFMessage (default: '
                            'platform_frame), or its body in the file of a tracker')
    group.add_argument('--columns', metavar='NAME=HEADING,...', type=columns, default={},
                       help='columns of a CSV file by their headings, as '
                            '"x=Surge [mm],roll=PtfmRoll [deg]", with the unit in brackets where '
                            'the file does not have it')
    group.add_argument('--euler', metavar='ORDER', choices=EULER,
                       help='order of the rotations about x, y, z in a CSV file, as XYZ: capital '
                            'letters about axes that turn along, others about fixed axes '
                            '(default: xyz, Rz Ry Rx, for roll pitch yaw; XYZ for u v w, those of '
                            'PI hexapods)')
    group.add_argument('--axes', metavar='X,Y,Z', type=axes,
                       help='axes of the source that are x, y, z of the base frame, as x,-y,-z '
                            'for z downward, or x,-y,z for a left-handed source')


def columns(text: str) -> dict[str, str]:
    """Return the headings of columns that an option gives, by the names of the columns."""
    found: dict[str, str] = {}
    # A heading may contain commas.
    for each in re.split(r',(?=\s*[A-Za-z_][\w.-]*\s*=)', text):
        name, sign, heading = (part.strip() for part in each.partition('='))
        if not (name and sign and heading) or name in found:
            raise argparse.ArgumentTypeError(
                f'{_shown(each)}: must be a name, = and a heading, each name once')
        found[name] = heading
    return found


def axes(text: str) -> str:
    """Return the axes that an option gives: x, y and z, each once, with a sign."""
    plain = text.replace(' ', '')
    if not re.fullmatch(r'[+-]?[xyz](,[+-]?[xyz]){2}', plain) or (
            len(set(re.findall('[xyz]', plain))) != 3):
        raise argparse.ArgumentTypeError(
            f'{_shown(text)}: must be x, y and z, each once, as z,-x,y')
    return plain


def add_motor_efforts(group: argparse._ArgumentGroup) -> None:
    """Add the options for measured efforts that are torques or currents of the motors."""
    motors = group.add_mutually_exclusive_group()
    motors.add_argument('--motor-torque', action='store_true',
                        help='efforts are torques of the motors [N m]; needs actuator.screw_lead, '
                             'and drive.gear_ratio where there is a gear')
    motors.add_argument('--motor-current', action='store_true',
                        help='efforts are currents of the motors [A]; needs drive.torque_constant '
                             'as well')


def add_accepted(parser: argparse._ActionsContainer) -> None:
    """Add the option that writes results in spite of a possible error."""
    parser.add_argument('--accept-mistakes', action='store_true',
                        help='write results although a possible error is found')


def add_report(parser: argparse._ActionsContainer) -> None:
    """Add the option by which no report is written."""
    parser.add_argument('--no-report', dest='report', action='store_false',
                        help='write no report.html')


def names_of(text: str) -> tuple[str, ...]:
    """Return the names that an option gives, with commas between them, each once."""
    names = tuple(dict.fromkeys(each.strip() for each in text.split(',') if each.strip()))
    if not names:
        raise argparse.ArgumentTypeError('names nothing')
    return names


def arguments_of(given: argparse.Namespace, names: Container[str]) -> dict[str, Any]:
    """Return the arguments with these names."""
    return {name: value for name, value in vars(given).items() if name in names}


def number(text: str) -> float:
    """Return a finite number as an option gives it."""
    try:
        value = float(plain_digits(text))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f'{_shown(text)}: must be a number')
    return value


def frequency(text: str) -> float:
    """Return a cut-off frequency as an option gives it [Hz]."""
    return between(1e-6, 1e6)(text)


def between(least: float, most: float) -> Callable[[str], float]:
    """Return the type of an option that is a number within bounds."""
    def read(text: str) -> float:
        value = number(text)
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(
                f'{_shown(text)}: must be at least {least:g}, at most {most:g}')
        return value

    return read


def share(most: float) -> Callable[[str], float]:
    """Return the type of an option that is a share: 0, or at least 0.001."""
    some = between(1e-3, most)

    def read(text: str) -> float:
        return some(text) if number(text) else 0.0

    return read


def whole(least: int, most: int) -> Callable[[str], int]:
    """Return the type of an option that is a whole number within bounds."""
    def read(text: str) -> int:
        try:
            value = int(plain_digits(text))
        except ValueError:
            raise argparse.ArgumentTypeError(
                f'{_shown(text)}: must be a whole number') from None
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(
                f'{_shown(text)}: must be at least {least}, at most {most}')
        return value

    return read


def _shown(text: str) -> str:
    return shown_name(text) if text.strip() else repr(text)


def plain_digits(text: str) -> str:
    """Return a text; ValueError for numbers of Python alone: 1_0, digits of other scripts."""
    if '_' in text or not text.isascii():
        raise ValueError(text)
    return text


def _printable(text: str) -> str:
    """Return text in which control characters, as names in bags may hold, are escaped."""
    return re.sub(r'[\x00-\x09\x0b-\x1f\x7f-\x9f]', lambda found: repr(found[0])[1:-1], text)
