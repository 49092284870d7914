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

"""The status ``singularity``: distance from a singularity, cause of the warning, crossings."""

from __future__ import annotations

from stewart_dynamics.arrays import NANOSECOND, SECOND
from stewart_dynamics.mechanics.kinematics.home_pose import determinant_at_home, other_side
from stewart_dynamics.mechanics.singularity_warning import Cause
from stewart_dynamics.node.diagnostics.inputs import Answers
from stewart_dynamics.node.diagnostics.levels import (
    ERROR, Level, LogLine, OK, OK_LEVEL, PERIOD, Status, StatusPart, WARN)
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.parameters.tolerances import HYSTERESIS
from stewart_dynamics.setpoints.step import Output

_CROSSING, _NEARNESS = 'crossing', 'nearness'


def singularity_state(output: Output, parameters: Parameters) -> Level:
    """Return the level of one output, and its cause with the numbers of the output."""
    if not output.solvable:
        return Level(ERROR, 'J_inv cannot be solved: no forces')
    state = output.singularity
    if state.stopped:
        is_suppressed = output.demanded_forces is not None and (
            parameters['singularity.action'] == 'suppress_forces')
        suppressed = ': forces suppressed' if is_suppressed else ''
        return Level(ERROR, f'inside stop_condition{suppressed}: '
                     + _condition(output, parameters, 'stop_condition'))
    if not state.warning:
        return OK_LEVEL
    if state.cause is Cause.CROSSED:
        return Level(ERROR, 'det(J) crossed zero since the last setpoint')
    if state.cause is Cause.CONDITION:
        return Level(WARN, _condition(output, parameters, 'warn_condition'))
    time, bound = state.time_to_crossing, parameters['singularity.warn_time']
    ends = '' if time < bound else f' (the warning ends above {bound / HYSTERESIS:g} s)'
    return Level(WARN, f'crossing of det(J) = 0 predicted in {time:.3g} s, singularity.warn_time '
                 f'is {bound:g} s{ends}')


def _condition(output: Output, parameters: Parameters, threshold: str) -> str:
    bound, condition = parameters[f'singularity.{threshold}'], output.condition
    if condition >= bound:
        return f'condition number {condition:.4g} exceeds singularity.{threshold}, {bound:g}'
    return (f'condition number {condition:.4g} has exceeded singularity.{threshold}, {bound:g}, '
            f'and is not yet below {HYSTERESIS * bound:g}')


class SingularityDiagnostics(StatusPart):
    """Notes the distance of setpoints from a singularity."""

    name = 'singularity'

    def __init__(self, answers: Answers) -> None:
        super().__init__(_CROSSING, _NEARNESS)
        self._answers = answers
        self._at_home, self._other_side = determinant_at_home(answers.parameters), ''
        self._crossed = False  # with the last setpoint
        self._crossings: list[str] = []  # since the last report
        self._crossing_logged_at = -PERIOD
        self._largest = 1.0

    def answered(self, output: Output, now: float) -> bool:
        """Note an output; return whether it must be reported at once, at any level."""
        before = self._answers.output_before
        if before is None:
            self._other_side = other_side(output.determinant, self._at_home)
        if output.condition > self._largest:
            self._largest = output.condition
        state = singularity_state(output, self._answers.parameters)
        if state.level == OK and self._other_side:
            state = Level(WARN, self._other_side)
        if output.singularity.cause is not Cause.CROSSED:
            self.held.see(state, now, _NEARNESS)
            if self._crossed:
                self.held.see(OK_LEVEL, now, _CROSSING)
                self._crossed = False
            return False
        self._crossed, self._other_side = True, ''
        crossing = Level(ERROR, _crossing(before, output))
        self._crossings.append(crossing.message)
        self.held.see(crossing, now, _CROSSING)
        stopped = output.singularity.stopped or not output.solvable
        self.held.see(state if stopped else OK_LEVEL, now, _NEARNESS)
        return now - self._crossing_logged_at >= PERIOD

    def status(self, now: float) -> Status:
        """Return the status."""
        answers, output, values = self._answers, self._answers.output, []
        if output is not None:
            forces = output.unit_load_forces
            worst = max(range(6), key=forces.__getitem__)
            crossing = output.singularity.time_to_crossing
            of_the_last_second = max(
                output.condition, answers.second.condition, answers.second_before.condition)
            values = [
                ('det(J) (m^3)', f'{output.determinant:.9g}'),
                ('d(det(J))/dt (m^3/s)', f'{output.determinant_rate:.9g}'),
                ('time to crossing (s)', f'{crossing:.3f}' if crossing < 1e6 else 'none'),
                ('crossings', str(output.singularity.crossings)),
                ('condition number', f'{output.condition:.6g}'),
                ('worst condition number of the last second', f'{of_the_last_second:.6g}'),
                ('worst condition number since activation', f'{self._largest:.6g}'),
                ('largest leg force under a unit load', f'{forces[worst]:.6g}'),
                ('its leg', answers.parameters['joints'][worst])]
        return Status(self.name, *answers.state(self.held.at(now), 'clear', now), values)

    def log_lines(self, status: Status, now: float) -> list[LogLine]:
        """Return the crossing since the last report, and the change of level besides."""
        lines = []
        if self._crossings:
            count = len(self._crossings)
            how_many = f' (the last of {count} crossings)' if count > 1 else ''
            lines = [LogLine(ERROR, f'{self.name}: {self._crossings[-1]}{how_many}')]
            self._crossings = []
            self._crossing_logged_at = now
        level, message = self.held.of(_NEARNESS, now)
        return lines + self._changed(level, message or 'clear')


def _crossing(before: Output | None, output: Output) -> str:
    """Return when det(J) crossed zero, on a straight line between two outputs."""
    seconds, nanoseconds = divmod(output.stamp, SECOND)
    stamp = f'stamp {seconds}.{nanoseconds:09d} s'
    passed = 0 if before is None else output.stamp - before.stamp
    if before is None or passed <= 0:
        return f'det(J) crossed zero before {stamp}'
    now, then = abs(output.determinant), abs(before.determinant)
    return f'det(J) crossed zero {passed * NANOSECOND * now / (now + then):.3g} s before {stamp}'
