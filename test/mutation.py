# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Mutation testing: how many wrong lines of the package the tests notice.

``python test/mutation.py`` draws a random sample of small changes (an operator, a comparison, a
constant, a condition, a call) in the modules named, makes each in a copy of the package, and runs
the tests that import the module, its own first, until one fails. It prints the share killed,
every survivor, and what was killed by the time limit alone. Mutants of ``mechanics`` run
uncompiled, so that they need no compilation.
"""

from __future__ import annotations

import argparse
import ast
from collections.abc import Iterator
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

# A plugin of pytest: few examples of each property, to kill most mutants soon. The share killed is
# thus a lower bound.
_FEW_EXAMPLES = """
from hypothesis import settings

original = settings.__init__

def few(self, *arguments, **given):
    if 'max_examples' in given:
        given['max_examples'] = min(given['max_examples'], 20)
    original(self, *arguments, **given)

settings.__init__ = few
settings.register_profile('few', max_examples=20)
settings.load_profile('few')
"""

# They take minutes uncompiled.
_COMPILED = {'test_external_wrench', 'test_planned_trajectory', 'test_planned_trajectory_messages'}

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
        """Return where it is and what it changes."""
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


def tests_of(path: Path, tests: list[Path]) -> list[Path]:
    """Return the test modules that import a module, its own first; without those that need ROS."""
    name = path.stem
    imported = re.compile(rf'^(from|import) .*\b{name}\b', re.MULTILINE)
    naming = [test for test in tests
              if imported.search(text := test.read_text(encoding='utf-8'))
              and 'from running import' not in text and 'import rclpy' not in text]
    return sorted(naming, key=lambda test: (test.stem != f'test_{name}', test.stat().st_size))


def fate(mutant: Mutant, tests: list[Path], seconds: float, deselect: list[str]) -> str:
    """Return whether a mutant was killed, survived all tests, or did not end in time."""
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / PACKAGE
        shutil.copytree(ROOT / PACKAGE, target)  # with the machine code kept so far
        changed = mutant.path.relative_to(ROOT)
        (Path(folder) / changed).write_text(mutant.text(), encoding='utf-8')
        (Path(folder) / 'few_examples.py').write_text(_FEW_EXAMPLES, encoding='utf-8')
        uncompiled = {'NUMBA_DISABLE_JIT': '1'} if 'mechanics' in changed.parts else {}
        if uncompiled:
            tests = [test for test in tests if test.stem not in _COMPILED]
        try:
            code = subprocess.run(
                [sys.executable, '-m', 'pytest', '-x', '-q',
                 '-p', 'no:cacheprovider', '-p', 'few_examples',
                 *(part for name in deselect for part in ('--deselect', name)),
                 *(str(test.relative_to(ROOT)) for test in tests)],
                cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=seconds,
                env={**os.environ, 'PYTHONPATH': folder, 'PYTHONSAFEPATH': '1',
                     'PYTHONDONTWRITEBYTECODE': '1', **uncompiled},
            ).returncode
        except subprocess.TimeoutExpired:
            return 'timed out'
    return 'killed' if code else 'survived'


def main() -> None:
    """Draw a sample, run it, and print what survives."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n\n')[0])
    parser.add_argument('modules', nargs='*', default=['mechanics', 'runtime'],
                        help='modules or folders of the package (default: mechanics runtime)')
    parser.add_argument('--sample', type=int, default=200, help='mutants (default: %(default)s)')
    parser.add_argument('--seed', type=int, default=1, help='of the sample (default: %(default)s)')
    parser.add_argument('--seconds', type=float, default=300.0,
                        help='after which a mutant is killed (default: %(default)s)')
    parser.add_argument('--deselect', nargs='*', default=[], help='tests to leave out')
    parser.add_argument('--leave-out', nargs='*', default=[], help='test modules to leave out')
    given = parser.parse_args()
    paths = [path for name in given.modules for path in (
        sorted((ROOT / PACKAGE / name).rglob('*.py')) if (ROOT / PACKAGE / name).is_dir()
        else [ROOT / PACKAGE / name])]
    tests = [test for test in sorted((ROOT / 'test').glob('test_*.py'))
             if test.stem not in given.leave_out]
    everything = list(mutants(paths))
    sample = random.Random(given.seed).sample(everything, min(given.sample, len(everything)))
    killed = 0
    for n, mutant in enumerate(sample, start=1):
        end = fate(mutant, tests_of(mutant.path, tests), given.seconds, given.deselect)
        if end != 'survived':  # an endless loop is noticed, too
            killed += 1
        if end != 'killed':
            print(f'{end}: {mutant}', flush=True)
        if n % 10 == 0:
            print(f'{killed} of {n} killed', flush=True)
    print(f'{killed} of {len(sample)} mutants killed, {100.0 * killed / len(sample):.1f} %; '
          f'{len(everything)} possible in {len(paths)} modules')


if __name__ == '__main__':
    main()
