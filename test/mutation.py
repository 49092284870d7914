# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Mutation testing: how many wrong lines of the package the tests notice.

``python test/mutation.py`` draws a random sample of small changes (an operator, a comparison, a
constant, a condition, a call) in the modules named, makes each in a copy of the package, and runs
the test modules that name the module, quick tests first, until one fails. It prints the share
killed, every survivor, and the mutants killed only by the time limit. Tests that need ROS or take
long are left out, and of each property few examples are tried (``mutation_plugin``): the share
killed is a lower bound.
"""

from __future__ import annotations

import argparse
import ast
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
import json
import os
from pathlib import Path
import random
import re
import shutil
import subprocess
import sys
import tempfile
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = 'stewart_dynamics'

# Test modules that are left out: with ROS, a browser, or processes that outlive a test.
_NEEDS = re.compile('from running import|import rclpy|playwright|many_bags')
_NO_TESTS = 5  # an exit code of pytest

_ARITHMETIC = {ast.Add: ('+', '-'), ast.Sub: ('-', '+'), ast.Mult: ('*', '/'),
               ast.Div: ('/', '*'), ast.FloorDiv: ('//', '*'), ast.Mod: ('%', '*'),
               ast.Pow: ('**', '*'), ast.BitAnd: ('&', '|'), ast.BitOr: ('|', '&')}
_COMPARISON = {ast.Lt: ('<', '<='), ast.LtE: ('<=', '<'), ast.Gt: ('>', '>='),
               ast.GtE: ('>=', '>'), ast.Eq: ('==', '!='), ast.NotEq: ('!=', '=='),
               ast.Is: ('is', 'is not'), ast.IsNot: ('is not', 'is'), ast.In: ('in', 'not in'),
               ast.NotIn: ('not in', 'in')}


class Mutant(NamedTuple):
    """One change of one module: its bytes from begin to end become others."""

    path: Path
    line: int
    begin: int
    end: int
    new: str

    def text(self) -> str:
        """Return the module's text with the change."""
        source = self.path.read_bytes()
        return (source[:self.begin] + self.new.encode() + source[self.end:]).decode()

    def __str__(self) -> str:
        """Return the location and the change of the mutant."""
        source = self.path.read_bytes()
        line = source.decode().splitlines()[self.line - 1].strip()
        old = source[self.begin:self.end].decode()
        return f'{self.path.relative_to(ROOT)}:{self.line}: {old!r} -> {self.new!r} in {line}'


class _Finder(ast.NodeVisitor):
    """Finds the mutants of a module; annotations, decorators and texts are left out."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._source = path.read_bytes()
        self._starts = [0]
        for line in self._source.splitlines(keepends=True):
            self._starts.append(self._starts[-1] + len(line))
        self.found: list[Mutant] = []

    def _span(self, node: ast.expr | ast.stmt) -> tuple[int, int]:
        assert node.end_lineno is not None and node.end_col_offset is not None
        return (self._starts[node.lineno - 1] + node.col_offset,
                self._starts[node.end_lineno - 1] + node.end_col_offset)

    def _add(self, node: ast.expr | ast.stmt, begin: int, end: int, new: str) -> None:
        self.found.append(Mutant(self._path, node.lineno, begin, end, new))

    def _between(self, left: ast.expr, right: ast.expr, old: str, new: str) -> None:
        begin, end = self._span(left)[1], self._span(right)[0]
        at = self._source.find(old.encode(), begin, end)
        if at >= 0:
            self._add(left, at, at + len(old), new)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        if type(node.op) in _ARITHMETIC and not isinstance(node.left, ast.JoinedStr):
            self._between(node.left, node.right, *_ARITHMETIC[type(node.op)])
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        left = node.left
        for op, right in zip(node.ops, node.comparators, strict=True):
            self._between(left, right, *_COMPARISON[type(op)])
            left = right
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        words = ('and', 'or') if isinstance(node.op, ast.And) else ('or', 'and')
        for left, right in zip(node.values, node.values[1:], strict=False):
            self._between(left, right, *words)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.USub | ast.Not):
            self._add(node, self._span(node)[0], self._span(node.operand)[0], '')
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        if type(node.op) in _ARITHMETIC:
            old, new = _ARITHMETIC[type(node.op)]
            self._between(node.target, node.value, f'{old}=', f'{new}=')
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        value = node.value
        new = (str(not value) if isinstance(value, bool) else str(value + 1)
               if isinstance(value, int) else (repr(2.0 * value) if value else '1.0')
               if isinstance(value, float) else '')
        if new:
            self._add(node, *self._span(node), new)

    def _negate(self, test: ast.expr) -> None:
        begin, end = self._span(test)
        self._add(test, begin, end, f'not ({self._source[begin:end].decode()})')

    def visit_If(self, node: ast.If) -> None:
        if not (isinstance(node.test, ast.Name) and node.test.id == 'TYPE_CHECKING'):
            self._negate(node.test)
            self.generic_visit(node)

    def visit_IfExp(self, node: ast.IfExp) -> None:
        self._negate(node.test)
        self.generic_visit(node)

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call):
            self._add(node, *self._span(node), 'pass')
            self.generic_visit(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        for default in (*node.args.defaults, *filter(None, node.args.kw_defaults)):
            self.visit(default)
        for statement in node.body:
            self.visit(statement)

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Leave formats out: they are words."""


def mutants(paths: list[Path]) -> Iterator[Mutant]:
    """Yield all mutants of modules."""
    for path in paths:
        finder = _Finder(path)
        finder.visit(ast.parse(path.read_text(encoding='utf-8')))
        yield from finder.found


def modules_of(path: Path, tests: list[Path]) -> list[str]:
    """Return the names of the test modules that name a module, or its folder within a layer."""
    names = [path.stem, *path.relative_to(ROOT / PACKAGE).parts[1:-1]]
    named = re.compile(rf'\b({"|".join(names)})\b')
    return [test.name for test in tests if named.search(test.read_text(encoding='utf-8'))]


class Suite:
    """
    The tests that need no ROS, and how long each takes.

    Parameters
    ----------
    folder : Path
        Gets the durations.

    """

    def __init__(self, folder: Path) -> None:
        self._durations = folder / 'durations.json'
        self._environment = {**os.environ, 'PYTHONDONTWRITEBYTECODE': '1',
                             'PYTHONSAFEPATH': '1', 'MUTATION_DURATIONS': str(self._durations)}

    def measure(self, modules: list[str]) -> None:
        """Run whole test modules on the package as it is, and note how long each test takes."""
        self._run(ROOT, modules, 3600.0)
        known = json.loads(self._durations.read_text(encoding='utf-8'))
        print(f'{len(known)} tests of {len(modules)} modules pass', flush=True)

    def fails(self, package: Path, modules: list[str], seconds: float) -> bool:
        """Return whether a test fails with a package; raises subprocess.TimeoutExpired."""
        return self._run(package, modules, seconds, '-x') not in (0, _NO_TESTS)

    def _run(self, package: Path, modules: list[str], seconds: float, *options: str) -> int:
        return subprocess.run(
            [sys.executable, '-m', 'pytest', '-q', '-p', 'no:cacheprovider',
             '-p', 'mutation_plugin', *options, *(f'test/{name}' for name in modules)],
            cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=seconds,
            env={**self._environment, 'PYTHONPATH': f'{package}:{ROOT / "test"}'}).returncode


def fate(mutant: Mutant, suite: Suite, modules: list[str], seconds: float) -> str:
    """Return whether a mutant was killed, survived all tests, or did not end in time."""
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(ROOT / PACKAGE, Path(folder) / PACKAGE)  # with the C library
        (Path(folder) / mutant.path.relative_to(ROOT)).write_text(mutant.text(), encoding='utf-8')
        try:
            return 'killed' if suite.fails(Path(folder), modules, seconds) else 'survived'
        except subprocess.TimeoutExpired:
            return 'timed out'


def main() -> None:
    """Draw a sample, run it, and print what survives."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n\n')[0])
    parser.add_argument('modules', nargs='*', default=['mechanics', 'setpoints'],
                        help='modules or folders of the package (default: mechanics setpoints)')
    parser.add_argument('--sample', type=int, default=200, help='mutants (default: %(default)s)')
    parser.add_argument('--seed', type=int, default=1, help='of the sample (default: %(default)s)')
    parser.add_argument('--seconds', type=float, default=300.0,
                        help='after which a mutant is killed (default: %(default)s)')
    given = parser.parse_args()
    paths = [path for name in given.modules for path in (
        sorted((ROOT / PACKAGE / name).rglob('*.py')) if (ROOT / PACKAGE / name).is_dir()
        else [ROOT / PACKAGE / name])]
    tests = [test for test in sorted((ROOT / 'test').glob('test_*.py'))
             if not _NEEDS.search(test.read_text(encoding='utf-8'))]
    everything = list(mutants(paths))
    sample = random.Random(given.seed).sample(everything, min(given.sample, len(everything)))
    modules = {path: modules_of(path, tests) for path in {mutant.path for mutant in sample}}
    ends: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(len(
            os.sched_getaffinity(0))) as pool:
        suite = Suite(Path(folder))
        suite.measure(sorted({name for names in modules.values() for name in names}))
        fates = pool.map(lambda mutant: fate(
            mutant, suite, modules[mutant.path], given.seconds), sample)
        for mutant, end in zip(sample, fates, strict=True):
            ends[end] += 1
            if end != 'killed':
                print(f'{end}: {mutant}', flush=True)
            if sum(ends.values()) % 10 == 0:
                print(dict(ends), flush=True)
    killed = len(sample) - ends['survived']  # an endless loop is noticed, too
    print(f'{killed} of {len(sample)} mutants killed, {100.0 * killed / len(sample):.1f} %; '
          f'{len(everything)} possible in {len(paths)} modules')


if __name__ == '__main__':
    main()
