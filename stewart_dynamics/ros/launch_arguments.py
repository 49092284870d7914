# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The arguments of the launch files: launch itself accepts any name, and ignores it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
import difflib
from pathlib import Path

from stewart_dynamics.errors import ParameterError, StewartError
from stewart_dynamics.parameters.parameter_set import ParameterSet


def check_launch_arguments(file: str, command_line: Sequence[str], known: Iterable[str]) -> None:
    """
    Raise StewartError for an argument that a launch file does not have.

    command_line: that of this process. Where it does not name the file, another launch file
        includes it: the arguments are those of the other.
    """
    if Path(file).name not in (Path(each).name for each in command_line):
        return
    names = list(known)
    for each in command_line:
        name, given, _ = each.partition(':=')
        if given and name not in names:
            close = difflib.get_close_matches(name, names, 1)
            raise StewartError(f'{name}: unknown argument; ' + (
                f'did you mean {close[0]}?' if close else f'known are {", ".join(names)}'))


def check_files(files: Mapping[str, tuple[str, type[ParameterSet] | None]]) -> None:
    """
    Raise StewartError for a file that is missing, or that breaks a rule of its program.

    Called before anything is started: a launch whose programs end one by one does not end itself.

    files: by the argument of the launch file that names it: its path, and the parameters of the
        program that reads it; None where the file has no parameters of this package.
    """
    for argument, (file, kind) in files.items():
        if not Path(file).is_file():
            raise StewartError(f'{argument}: {file}: no such file')
        if kind is not None:
            try:
                kind.check_file(file)
            except ParameterError as exc:
                raise StewartError(f'{argument}: {exc}') from exc
