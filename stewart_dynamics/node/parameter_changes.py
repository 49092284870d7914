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

"""Changes of parameters: when they are allowed, and their log lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.plausibility import likely_mistakes
from stewart_dynamics.node.diagnostics.periodic_report import LogLine, OK, WARN
from stewart_dynamics.parameters.table import Parameters


def changed(parameters: Parameters, changes: Mapping[str, Any], configured: bool) -> Parameters:
    """
    Return the parameters with changes applied.

    Parameters
    ----------
    parameters : Parameters
        The present parameters.
    changes : mapping of name to value
        New values, as given by ROS.
    configured : bool
        Whether the node is configured: then only some parameters may change.

    Raises
    ------
    ParameterError
        A change breaks a rule.

    """
    for name, value in changes.items():
        if value is None:
            raise ParameterError(f'{name}: cannot be unset')
    if configured:
        fixed = [name for name in changes
                 if name in Parameters.table and not Parameters.table[name].while_active]
        if fixed:
            raise ParameterError(
                f'{", ".join(fixed)}: only changed while the node is unconfigured, because its '
                'topics and its model depend on it: deactivate and clean up first')
    return parameters.replaced(changes, exact_types=True)


def log_lines(before: Parameters, after: Parameters) -> Iterator[LogLine]:
    """Yield log lines for changed values and for new likely mistakes."""
    changes = [f'{name}: {before.given.get(name)} -> {value}'
               for name, value in after.given.items() if value != before.given.get(name)]
    if changes:
        yield LogLine(OK, '; '.join(changes))
    known = likely_mistakes(before, geometry=False)
    for mistake in likely_mistakes(after, geometry=False):
        if mistake not in known:
            yield LogLine(WARN, mistake)
