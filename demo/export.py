# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Export the example hexapod as C source, compile it, and compare it with its golden vectors.

``make export-demo`` runs it: with CMake, and with each C compiler that is found, as a real-time
project would. Everything is written into a folder of its own.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
import shutil
import subprocess
import sys

from stewart_dynamics.executables import executable

ROOT = Path(__file__).resolve().parent.parent
COMPILERS = 'gcc', 'clang', 'cc'


def main() -> int:
    """Run the demo; the exit code is 1 where results differ or something fails."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--params', type=Path, default=ROOT / 'config' / 'platform.yaml')
    parser.add_argument('--output', type=Path, default=ROOT / '.cache' / 'export-demo')
    given = parser.parse_args()
    # the environment's cmake, else the one of the system
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get('PATH', '')])
    cmake = shutil.which('cmake', path=path)
    compilers = [name for name in COMPILERS if shutil.which(name)]
    if not compilers:
        print('export-demo: needs a C compiler, gcc or clang', file=sys.stderr)
        return 1
    folder = given.output
    steps: list[tuple[str, list[str | Path]]] = [('export', [
        executable('stewart_export'), '--params', given.params, '--output', folder, '--force'])]
    for name in compilers[:2]:
        program = folder / f'golden_{name}'
        steps += [(f'compile with {name}', [
            name, '-std=c99', '-O2', '-ffp-contract=off', '-Wall', '-Wextra',
            *(folder / each for each in ('test_golden.c', 'hexapod.c', 'stewart_dynamics.c')),
            '-o', program, '-lm']), ('compare with the node', [program])]
    if cmake is not None:
        build = folder / 'build'
        steps += [('configure with CMake', [cmake, '-S', folder, '-B', build]),
                  ('build', [cmake, '--build', build]),
                  ('test', [Path(cmake).with_name('ctest'), '--test-dir', build])]
    for title, command in steps:
        done = subprocess.run([str(each) for each in command], stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True)
        last = done.stdout.strip().splitlines()[-1:]
        print(f'{title:<24}{last[0] if last and not done.returncode else ""}')
        if done.returncode:
            print(done.stdout, file=sys.stderr)
            return 1
    print(f'\nThe C source is in {folder}: docs/real_time.md says how to call it.')
    return 0


if __name__ == '__main__':
    sys.exit(main())
