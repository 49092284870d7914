# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Questions for the parameters of a hexapod.

The example of a kind of legs has the parameters that a hexapod of this kind needs: each of them is
asked for, in the words and by the rule of the table, and its value is the default answer.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
import math
import sys
from textwrap import fill
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.errors import shown_name, StewartError
from stewart_dynamics.legs import example, example_file, example_names
from stewart_dynamics.parameters.circles import BODIES, circle_names
from stewart_dynamics.parameters.parameter_set import checked, Parameter
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.program import number

T = TypeVar('T')

YES, NO = 'yes', 'no'
CIRCLES, POINTS = 'circles', 'points'
LEFT_OUT = '-'
_WIDTH = 79  # columns of a terminal


class Unit(NamedTuple):
    """A unit of answers: numbers of it are multiplied and divided for the unit of the table."""

    name: str
    factor: float = 1.0
    divisor: float = 1.0

    def to_table(self, value: float) -> float:
        """Return a number in the unit of the table; a converted one is rounded to 1e-9."""
        converted = self.divisor != 1.0
        return round(value * self.factor / self.divisor, 9) if converted else value

    def of_table(self, value: float) -> float:
        """Return a number of the table in this unit."""
        return value * self.divisor / self.factor


# Units of answers by those of the table, for each choice.
LENGTHS: Mapping[str, Mapping[str, Unit]] = {
    'mm': {'m': Unit('mm', divisor=1e3), 'm/s': Unit('mm/s', divisor=1e3)}, 'm': {}}
ANGLES: Mapping[str, Mapping[str, Unit]] = {
    'degrees': {'rad': Unit('degrees', math.pi, 180.0),
                'rad/s': Unit('degrees/s', math.pi, 180.0)}, 'rad': {}}


class Answers(NamedTuple):
    """A hexapod as answers describe it."""

    hexapod: Hexapod
    kept: frozenset[str]  # parameters with values of the example


class Dialog:
    """
    Questions on the standard output, and answers on the standard input, one a line.

    complain: prints in one line why an answer is rejected.
    """

    def __init__(self, complain: Callable[[object], None]) -> None:
        self.complain = complain

    def ask(self, prompt: str, default: str, read: Callable[[str], T]) -> T:
        """
        Return the first answer that ``read`` accepts; an empty one stands for the default.

        Raises StewartError or KeyboardInterrupt: the input ends or is interrupted before.
        """
        while True:
            try:
                given = input(f'{prompt} ({default}): ')
            except (EOFError, RuntimeError):  # the latter without a standard input
                print(flush=True)
                raise StewartError(
                    f'the input ended before the answer to {prompt!r}; nothing is written'
                ) from None
            except UnicodeDecodeError as exc:
                print(flush=True)
                raise StewartError(
                    f'standard input: {exc.reason}: not {exc.encoding} text; nothing is written'
                ) from None
            except KeyboardInterrupt:
                print(flush=True)
                raise KeyboardInterrupt('nothing is written') from None
            if not sys.stdin.isatty():  # no terminal has shown the answer
                print(given, flush=True)
            try:
                return read(given.strip())
            except (argparse.ArgumentTypeError, StewartError) as exc:
                self.complain(exc)

    def choose(self, prompt: str, *options: str) -> str:
        """Return one of the options, named by its beginning; the first is the default."""
        def read(given: str) -> str:
            meant = [each for each in options if each.startswith(given)]
            if given in options or not given:
                meant = [given or options[0]]
            if len(meant) != 1:
                raise StewartError(f'{shown_name(given)}: must be {" or ".join(options)}')
            return meant[0]

        return self.ask(f'{prompt} {" or ".join(options)}', options[0], read)


def ask_hexapod(dialog: Dialog) -> Answers:
    """Ask for the kind of legs, units and each parameter; again for those that break a rule."""
    for name in example_names():
        print(fill(f'{name}: {example(name)[2:].partition(":")[0]}', _WIDTH))
    examples = Parameters.from_yaml(example_file(dialog.choose('Kind of legs:', *example_names())))
    form = dialog.choose('Joints by', CIRCLES, POINTS)
    units = {**LENGTHS[dialog.choose('Lengths in', *LENGTHS)],
             **ANGLES[dialog.choose('Angles in', *ANGLES)]}
    print(fill(f'Enter keeps the value in parentheses, that of the example; {LEFT_OUT} leaves a '
               'parameter out. One value stands for all six legs.', _WIDTH))
    points = {name: f'geometry.{body}_joints' for body in BODIES for name in circle_names(body)}
    names = dict.fromkeys(points.get(name, name) if form == POINTS else name
                          for name in examples.given)
    questions = [_Question(Parameters.table[name], units.get(
        examples.unit_of(name), Unit(examples.unit_of(name))),
        examples.given.get(name, examples[name])) for name in names]
    for question in questions:
        question.put(dialog)
    while True:
        try:
            hexapod = Hexapod(Parameters({each.parameter.name: each.value for each in questions
                                          if each.value is not None}, 'answers'))
            return Answers(hexapod, frozenset(
                each.parameter.name for each in questions if each.kept))
        except StewartError as exc:
            dialog.complain(exc)
            likely = [each for each in questions if each.parameter.name in str(exc)] or questions
            _chosen(dialog, questions, likely[0]).put(dialog)


def _chosen(dialog: Dialog, questions: Sequence[_Question], likely: _Question) -> _Question:
    """Ask which question is to be answered again: answers can be wrong together alone."""
    named = {each.parameter.name: each for each in questions}

    def read(given: str) -> _Question:
        if given and given not in named:
            raise StewartError(f'{shown_name(given)}: must be one of {", ".join(named)}')
        return named[given] if given else likely

    return dialog.ask('Parameter to be answered again', likely.parameter.name, read)


class _Question:
    """
    The question for a parameter: its value, at first the one of the example.

    value: number or numbers as in a file, or points (6, 3); None: left out.
    kept: whether no answer has changed it, or a part of it.
    """

    def __init__(self, parameter: Parameter, unit: Unit, value: ArrayLike) -> None:
        self.parameter, self._unit = parameter, unit
        self.value: Any = np.array(value, dtype=float)[()]
        self.kept = True

    def put(self, dialog: Dialog) -> None:
        """Put the question, for points leg by leg; Enter keeps the value."""
        print('\n' + fill(f'{self.parameter.name}: {self.parameter.text}', _WIDTH))
        if np.ndim(self.value) == 2:
            point = self.parameter._replace(sizes=(self.value.shape[1],))
            self.value = np.array([
                self._answer(dialog, f'leg {n}', point, row)
                for n, row in enumerate(self.value, start=1)])
        else:
            self.value = self._answer(
                dialog, self.parameter.name.rpartition('.')[2], self.parameter, self.value)

    def _answer(self, dialog: Dialog, prompt: str, parameter: Parameter, value: Any) -> Any:
        """Return the numbers of an answer, which the declaration of a parameter checks."""
        def read(given: str) -> Any:
            if not given:
                return value
            self.kept = False
            if given == LEFT_OUT and parameter is self.parameter:
                return None
            numbers = [self._unit.to_table(number(each))
                       for each in given.replace(',', ' ').split()]
            checked(parameter, numbers if parameter.sizes or len(numbers) != 1 else numbers[0],
                    'answer')
            return np.array(numbers) if parameter.sizes else numbers[0]

        shown = LEFT_OUT
        if value is not None:
            entries = np.ravel(value)[:1] if np.ptp(value) == 0.0 else np.ravel(value)
            shown = ', '.join(f'{self._unit.of_table(each):.6g}' for each in entries)
        return dialog.ask(' '.join(filter(None, (
            prompt, self._unit.name and f'[{self._unit.name}]'))), shown, read)
