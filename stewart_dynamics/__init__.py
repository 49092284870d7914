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
Leg forces of Gough-Stewart platforms: inverse dynamics with massive legs, for ROS 2.

The names are resolved when they are first used (PEP 562): to check a parameter file loads no
compiler.
"""

from importlib import import_module
from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from stewart_dynamics.errors import (
        BagError, MotionError, ParameterError, PoseError, SingularityError, StewartError)
    from stewart_dynamics.mechanics.force_breakdown import CAUSES, ForceCauses
    from stewart_dynamics.mechanics.motion import Motion
    from stewart_dynamics.mechanics.stewart_platform import InverseDynamics, Pose, StewartPlatform
    from stewart_dynamics.parameters import Parameters
    from stewart_dynamics.runtime.planned_trajectory import (
        check_planned_trajectory, PlannedTrajectory)

__all__ = [
    'BagError', 'CAUSES', 'ForceCauses', 'InverseDynamics', 'Motion', 'MotionError',
    'ParameterError', 'Parameters', 'PlannedTrajectory', 'Pose', 'PoseError', 'SingularityError',
    'StewartError', 'StewartPlatform', 'check_planned_trajectory']

_MODULES = {
    'errors': ('BagError', 'MotionError', 'ParameterError', 'PoseError', 'SingularityError',
               'StewartError'),
    'mechanics.force_breakdown': ('CAUSES', 'ForceCauses'),
    'mechanics.motion': ('Motion',),
    'mechanics.stewart_platform': ('InverseDynamics', 'Pose', 'StewartPlatform'),
    'parameters': ('Parameters',),
    'runtime.planned_trajectory': ('PlannedTrajectory', 'check_planned_trajectory'),
}
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Return one of the library's names, loaded now."""
    if name not in _MODULE_OF:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    value = getattr(import_module(f'{__name__}.{_MODULE_OF[name]}'), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the library's names with the others."""
    return sorted({*globals(), *__all__})
