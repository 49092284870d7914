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

"""The sources of the force breakdown that summary and report show."""

from __future__ import annotations

from stewart_dynamics.mechanics.dynamics.force_breakdown import SOURCES
from stewart_dynamics.parameters.table import Parameters


def sources_of(parameters: Parameters) -> tuple[str, ...]:
    """Return SOURCES, without the base's motion, the last, where ``base.source`` is fixed."""
    return SOURCES[:-1] if parameters['base.source'] == 'fixed' else SOURCES
