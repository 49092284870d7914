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


"""How bags are replayed, and the exit codes."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

DONE, LIMIT_MET, BAD_INPUT, PARTLY_READ = range(4)
NODE = '/stewart_dynamics'


class Options(NamedTuple):
    """How a bag is replayed."""

    node: str = NODE
    """Name before the topics of the outputs, and of the setpoints where they have the usual."""
    topics: Mapping[str, str] = MappingProxyType({})
    """Names in the bag of some of the topics pose, twist, accel, combined and wrench."""
    cutoff: float | None = None
    """[Hz]: take only poses, and differentiate them by smoothing splines."""
    measured: str | None = None
    """Topic of a sensor_msgs/JointState with the efforts that were measured."""
    parquet: bool = False
    """Write legs.parquet in place of legs.csv."""
    report: bool = True
    """Write report.html."""
    force: bool = False
    """Write over results."""
    run: str = ''
    """In summary.json: the name of a run over many bags."""

    # A mapping proxy cannot be handed to another process.
    def __reduce__(self) -> tuple[Any, ...]:
        """Return what makes it anew."""
        return type(self), (*self._replace(topics=dict(self.topics)),)


def code_of(summary: Mapping[str, Any]) -> int:
    """Return the code of a bag that was replayed."""
    return (PARTLY_READ if not summary['complete'] else LIMIT_MET if summary['limit_met']
            else DONE)
