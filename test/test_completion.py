# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Completion of the programs' arguments, in real shells on a terminal."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
import pty
import re
import select
import shutil
import signal
import sys

import pytest
from referees import ROOT
from stewart_dynamics.executables import executable

pytest.importorskip('argcomplete', reason='needs argcomplete')

PAGE = (ROOT / 'docs' / 'installation.md').read_text(encoding='utf-8')
DEADLINE = 120.0  # without a character, on a computer with other work [s]
SHELLS = {'bash': ['--norc', '-i'], 'zsh': ['-f', '-i'], 'fish': ['--no-config', '-i']}
TYPED = {'stewart_replay --no-rep': '--no-report', 'stewart_init --fo': '--force',
         'stewart_dynamics --ros-args -p limits.force_ma': 'limits.force_max:=',
         'stewart_dynamics --example tel': 'telescopic'}


class Terminal:
    """A terminal with a shell."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor

    def type(self, text: str) -> None:
        """Type."""
        os.write(self._descriptor, text.encode())

    def until(self, words: str) -> None:
        """Read until the shell has printed some words."""
        shown = ''
        while words not in shown:
            assert select.select([self._descriptor], [], [], DEADLINE)[0], f'{words!r}: {shown}'
            shown += os.read(self._descriptor, 4096).decode(errors='replace')
            shown = re.sub(r'\x1b\[[0-9;?]*[A-Za-z]', '', shown)


@contextmanager
def terminal(shell: str) -> Iterator[Terminal]:
    """Run a shell in which the environment with the programs is active."""
    environment = executable('stewart_replay').parent.parent
    path = os.pathsep.join([f'{environment}/bin', f'{sys.prefix}/bin', os.environ['PATH']])
    pid, descriptor = pty.fork()
    if pid == 0:
        os.environ.update(VIRTUAL_ENV=str(environment), PATH=path, TERM='xterm')
        os.execvp(shell, [shell, *SHELLS[shell]])
    try:
        yield Terminal(descriptor)
    finally:
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        os.close(descriptor)


@pytest.mark.slow
@pytest.mark.parametrize('shell', SHELLS)
def test_a_shell_completes_arguments_by_the_command_of_the_page(shell: str) -> None:
    if shutil.which(shell) is None:
        pytest.skip(f'there is no {shell}')
    own, others = (re.findall(rf'^    (.*register-python-argcomplete {words}.*)', PAGE, re.M)[0]
                   for words in ('--shell fish', r'\$'))
    with terminal(shell) as screen:
        if shell == 'zsh':
            screen.type('autoload -U compinit && compinit -u\n')
        screen.type(f"{own if shell == 'fish' else others}; echo rea''dy\n")
        screen.until('ready\r')
        for typed, completed in TYPED.items():
            screen.type(f'{typed}\t')
            screen.until(completed)
            screen.type('\x15')  # Ctrl-U: removes the line
