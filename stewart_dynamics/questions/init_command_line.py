# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The command line of stewart_init."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from stewart_dynamics.errors import StewartError
from stewart_dynamics.program import DONE, Program
from stewart_dynamics.signals import interrupt_on_signals
from stewart_dynamics.whole_file import FilesOfFolder

_PROGRAM = Program('stewart_init', 'the input ends too early, or a file is kept')
_HEAD = """\
# A hexapod as described by answers to stewart_init. SI units; write every number with a decimal
# point (5.0, not 5). Arrays of six are in the order of the legs; one value stands for all six.
"""
_KEPT = 'value of the example'


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; the exit code is explained in its help."""
    given = _arguments().parse_args(arguments)
    return _PROGRAM.exit_code(lambda: _write(given.file, given.force))


def _arguments() -> argparse.ArgumentParser:
    parser = _PROGRAM.parser(
        description='Ask for the numbers of a hexapod, and write its parameter file.',
        files='FILE gets the parameters, with comments. Beside it are written a picture with '
              'numbered joints (.svg)\nand parameters.schema.json, by which editors check FILE. '
              'Answers are read from the standard input.')
    parser.add_argument('file', nargs='?', type=_file, default=Path('my_hexapod.yaml'),
                        metavar='FILE', help='name of the file (default: my_hexapod.yaml)')
    parser.add_argument('--force', action='store_true',
                        help='replace files that exist without asking')
    return parser


def _file(text: str) -> Path:
    """Return the path of a parameter file as an argument gives it."""
    if Path(text).suffix not in ('.yaml', '.yml'):
        raise argparse.ArgumentTypeError(f'{text!r}: must end with .yaml')
    return Path(text)


def _write(file: Path, force: bool) -> int:
    # Imported here, so that --help is fast.
    import readline  # noqa: F401 - answers can be edited

    from stewart_dynamics.description.picture import picture
    from stewart_dynamics.mechanics.parameter_errors import find_parameter_errors
    from stewart_dynamics.parameters.yaml_file import yaml_text
    from stewart_dynamics.questions.editor_schema import NAMES_SCHEMA, SCHEMA, schema_text
    from stewart_dynamics.questions.questions import ask_hexapod, Dialog, NO, YES

    interrupt_on_signals()
    dialog = Dialog(_PROGRAM.complain)
    schema, drawing = {SCHEMA: schema_text()}, file.with_suffix('.svg').name
    files = FilesOfFolder(file.parent, replace=True)
    files.check((file.name, drawing, SCHEMA))  # before any answer is lost
    existing = ', '.join(files.existing((file.name, drawing), schema))
    if existing and not force and dialog.choose(f'{existing} exists; replace it?', NO, YES) == NO:
        raise StewartError(f'{existing}: exists and is kept; nothing is written')
    hexapod, kept = ask_hexapod(dialog)
    given, table = hexapod.parameters.given, hexapod.parameters.table
    comments = {name: '; '.join(filter(None, (
        hexapod.parameters.unit_of(name), table[name].text, _KEPT if name in kept else '')))
        for name in given}
    for path in files.write({
            file.name: yaml_text(given, comments, NAMES_SCHEMA + _HEAD),
            drawing: picture(hexapod, file.stem), **schema}):
        _PROGRAM.say(str(path))
    if kept:
        _PROGRAM.say(f'{len(kept)} of {len(given)} numbers are those of the example; {file} marks '
                     f'them: {_KEPT}')
    _PROGRAM.say(f'next: stewart_capability --params {file}')
    _PROGRAM.warn(find_parameter_errors(hexapod.parameters))
    return DONE
