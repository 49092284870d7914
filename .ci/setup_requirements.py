# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Print what setup.py requires, without ROS: the newest or the oldest versions it admits."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from distutils.core import run_setup  # from Python 3.12 on it is in setuptools
import json
import subprocess
import sys

from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet


def wheels(name: str) -> list[str]:
    """Return the versions of a package that have wheels for this Python, the newest first."""
    listed = subprocess.run(
        [sys.executable, '-m', 'pip', 'index', 'versions', '--json', '--only-binary', ':all:',
         name], check=True, stdout=subprocess.PIPE)
    versions: list[str] = json.loads(listed.stdout)['versions']
    return versions


def oldest(requirement: str) -> str:
    """Return a requirement for the oldest version with a wheel, if it has a lower bound."""
    parsed = Requirement(requirement)
    if any(specifier.operator == '>=' for specifier in parsed.specifier):
        for version in [*parsed.specifier.filter(wheels(parsed.name))][-1:]:
            parsed.specifier &= SpecifierSet(f'=={version}')
    return str(parsed)


def main() -> None:
    """Print the requirements, one in a line."""
    chosen = {'newest': str, 'oldest': oldest}[sys.argv[1]]
    package = run_setup('setup.py', stop_after='init')
    extras = [requirement for name, listed in package.extras_require.items()
              if not name.startswith('ros') for requirement in listed]
    required = dict.fromkeys([*package.install_requires, *extras])
    with ThreadPoolExecutor(16) as pool:  # waits for the package index
        print(*sorted(pool.map(chosen, required)), sep='\n')


if __name__ == '__main__':
    main()
