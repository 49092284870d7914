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

"""The status ``limits``: each kind of limit has a state, a line and a peak of its own."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
import math

from stewart_dynamics.mechanics.limits import (
    ANGLES, CLEARANCE_MIN, CLIPPED, Exceedance, JUMP, LENGTH_MAX, LIMITS, OF_MOTORS, QUANTITIES)
from stewart_dynamics.node.diagnostics.inputs import Answers
from stewart_dynamics.node.diagnostics.levels import (
    ERROR, Level, LogLine, OK_LEVEL, Status, StatusPart)
from stewart_dynamics.setpoints.motor_step import DEMANDED_TORQUES, RISES, SPEEDS
from stewart_dynamics.setpoints.step import Output

_OF_MOTORS = (('motor speed', 'rad/s', SPEEDS), ('motor torque demanded', 'N m', DEMANDED_TORQUES),
              ('temperature rise', 'K', RISES))
_LIMITS = *LIMITS, *OF_MOTORS, JUMP
# Factor by which legs exceed their maximum length if positions are in mm instead of m.
_MILLIMETRES = 1000.0


class LimitsDiagnostics(StatusPart):
    """Notes which limits setpoints exceed, and the largest force demanded."""

    name = 'limits'

    def __init__(self, answers: Answers) -> None:
        super().__init__(*_LIMITS)
        self._answers = answers
        self._joints: tuple[str, ...] = answers.parameters['joints']
        self._setpoints = Counter[str]()  # that exceed each limit
        self._worst: dict[str, Exceedance] = {}
        self._suppressed = 0
        self._exceeding = False
        self._largest_force, self._its_leg = 0.0, 0

    def answered(self, output: Output, now: float) -> None:
        """Note an output."""
        forces = output.demanded_forces
        if forces is not None:
            largest = abs(self._largest_force)
            # These two take less time than abs of each.
            if max(forces) > largest or min(forces) < -largest:
                self._largest_force = max(forces, key=abs)
                self._its_leg = forces.index(self._largest_force)
        if output.exceedances or self._exceeding:
            self._exceeding = bool(output.exceedances)
            self._note_exceedances(output, now)

    def _note_exceedances(self, output: Output, now: float) -> None:
        suppressed = output.forces is None and output.demanded_forces is not None and (
            self._answers.parameters['limits.action'] == 'suppress_forces')
        self._suppressed += suppressed
        mistake = self._mistake(output)
        for name in _LIMITS:
            exceeded = [each for each in output.exceedances if each.limit == name]
            if not exceeded:
                self.held.see(OK_LEVEL, now, name)
                continue
            words = ', '.join(map(self._words, exceeded))
            if suppressed and name not in CLIPPED:
                words += '; forces suppressed'
            if name in (LENGTH_MAX, JUMP):
                words += mistake
            self.held.see(Level(ERROR, words), now, name)
            self._setpoints[name] += 1
            self._worst[name] = max(*exceeded, self._worst.get(name, exceeded[0]),
                                    key=lambda each: each.excess)

    def status(self, now: float) -> Status:
        """Return the status, with all causes of its level."""
        values = []
        if self._answers.output is not None:
            values = [(f'{leg}: {quantity} ({unit})', f'{number:.6g}')
                      for quantity, unit, numbers in self._of_legs(self._answers.output)
                      for leg, number in zip(self._joints, numbers, strict=False)
                      if not math.isnan(number)]
        if self._largest_force:
            values += [
                ('largest force demanded since activation (N)', f'{self._largest_force:.6g}'),
                ('leg of the largest force demanded', self._joints[self._its_leg])]
        for name in (each for each in _LIMITS if each in self._worst):
            values += [('jumps' if name == JUMP else f'setpoints that exceed {name}',
                        str(self._setpoints[name])),
                       (f'worst since activation, {name}', self._words(self._worst[name]))]
        if self._suppressed:
            values.append(('setpoints without forces, by limits.action', str(self._suppressed)))
        return Status(self.name, *self._answers.state(self.held.at(now), 'all held', now), values)

    def _of_legs(self, output: Output) -> list[tuple[str, str, Sequence[float]]]:
        """Return quantity, unit and six numbers; empty or nan where they are not computed."""
        return [
            ('length', 'm', output.lengths),
            ('rate', 'm/s', output.rates),
            ('force demanded', 'N', output.demanded_forces or ()),
            *((*QUANTITIES[limit], output.joint_angles[where]) for limit, where in ANGLES.items()),
            (*QUANTITIES[CLEARANCE_MIN], output.clearances),
            *((quantity, unit, output.motors[where]) for quantity, unit, where in _OF_MOTORS)]

    def log_lines(self, status: Status, now: float) -> list[LogLine]:
        """Return the changes of each kind of limit."""
        lines = []
        for name, worst in self._worst.items():
            level, message = self.held.of(name, now)
            lines += self._changed(level, message or (
                f'{name}: no longer exceeded; {self._setpoints[name]} setpoints since activation, '
                f'worst: {self._words(worst)}'), name)
        return lines

    def _mistake(self, output: Output) -> str:
        """Return the likely mistake where legs are too long, as words to append."""
        longest = self._answers.parameters['limits.length_max']
        reference = output.state.lengths if longest is None else longest.tolist()
        if reference and all(0.3 < length / (_MILLIMETRES * most) < 1.5 for length, most in zip(
                output.lengths, reference, strict=True)):
            return '; likely mistake: position in mm'
        return ''

    def _words(self, exceedance: Exceedance) -> str:
        clipped = ', clipped' if exceedance.limit in CLIPPED else ''
        return exceedance.words(self._joints) + clipped
