# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Options of a replay, and its exit code."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
import shlex
from typing import NamedTuple, TYPE_CHECKING

from stewart_dynamics.program import DONE, NODE, PARTLY_READ, STRICT
from stewart_dynamics.tables.reading import is_table, Reading

if TYPE_CHECKING:
    from stewart_dynamics.parameters.table import Parameters
    from stewart_dynamics.replay.bag_summary import BagSummary

LIMIT_MET = STRICT


class Options(NamedTuple):
    """Options of a replay."""

    node: str = NODE
    """Node name: the prefix of the output topics, and of setpoint topics with usual names."""
    reading: Reading = Reading()  # of recordings of other sources
    topics: Mapping[str, str] = {}
    """
    Topics in the bag to be read as pose, twist, accel, combined or wrench, or as base_pose,
    base_twist, base_accel or base_imu.
    """
    cutoff: float | None = None
    """Cut-off frequency [Hz]: read only poses, and differentiate them by smoothing splines."""
    measured: str | None = None  # topic of a sensor_msgs/JointState with the measured efforts
    response: bool = False  # analyze how the platform follows its setpoints
    measured_pose: str | None = None
    """Topic or table of the achieved poses; None: those of the measured legs."""
    motor_torque: bool = False  # measured efforts are motor torques [N m]
    motor_current: bool = False  # measured efforts are motor currents [A]
    uncertainty: int = 0  # hexapods that the file admits, on which the loads are computed as well
    parquet: bool = False  # write legs.parquet in place of legs.csv
    report: bool = True  # write report.html
    plotly: Path | None = None
    """The file of plotly.js that the reports share; None: it is in each report."""
    force: bool = False  # replace existing results
    params: str = ''  # the parameter file, as advice names it
    run: str = ''  # identifier of a run over many bags, written to summary.json

    @property
    def measured_table(self) -> Path | None:
        """Return the table of the achieved poses; None if they are in the bag."""
        path = Path(self.measured_pose or '')
        return path if is_table(path) else None

    @property
    def reading_of_bag(self) -> Reading:
        """Return how the bag is read: with a table of achieved poses the options are its own."""
        return self.reading if self.measured_table is None else Reading()

    def capability_command(self, bag: Path) -> str:
        """Return the command that rates the motion of a bag; empty if it cannot read it so."""
        if set(self.topics) - {'combined'}:
            return ''
        words = ['stewart_capability', '--motion', str(bag), '--params', self.params or 'FILE']
        for option, value in (
                ('--node', self.node if self.node != NODE else None),
                ('--combined', self.topics.get('combined')),
                ('--differentiate', self.cutoff and f'{self.cutoff:g}')):
            words += [option, value] if value else []
        return shlex.join([*words, *self.reading_of_bag.arguments()])

    def applied_to(self, parameters: Parameters, bag: Path) -> Parameters:
        """Return the parameters with the source of setpoints that options and bag demand."""
        source = ('pose' if self.cutoff is not None
                  else 'combined' if 'combined' in self.topics
                  else 'separate' if is_table(bag)
                  and parameters.setpoint.source == 'combined' else None)
        return parameters.replaced({'setpoint.source': source}) if source else parameters


def code_of(summary: BagSummary) -> int:
    """Return the exit code of a replayed bag."""
    error = summary.measured and summary.measured.likely_mistake
    return PARTLY_READ if not summary.complete else (
        LIMIT_MET if summary.limit_met or error else DONE)
