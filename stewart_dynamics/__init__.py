# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Leg forces of Gough-Stewart platforms: inverse dynamics with massive legs, for ROS 2.

Names are imported on first use, so that checking a parameter file needs no compiler.
"""

from importlib import import_module
from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from stewart_dynamics.calibration.calibrate import calibrate, Calibration
    from stewart_dynamics.capability.capability import Capability, Extent
    from stewart_dynamics.capability.reachable import Reachable
    from stewart_dynamics.cueing.motion_cueing import CueingStream, Felt, MotionCueing
    from stewart_dynamics.errors import (
        BagError, MotionError, ParameterError, PoseError, ReachError, SingularityError,
        StewartError)
    from stewart_dynamics.mechanics.drives.motors import Motors
    from stewart_dynamics.mechanics.dynamics.force_breakdown import ForceBreakdown
    from stewart_dynamics.mechanics.dynamics.result import InverseDynamics
    from stewart_dynamics.mechanics.frames.base_motion import BaseMotion
    from stewart_dynamics.mechanics.frames.motion import Motion, Pose
    from stewart_dynamics.mechanics.governor import GovernedStream
    from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
    from stewart_dynamics.mechanics.stiffness import NaturalModes
    from stewart_dynamics.parameters.table import Parameters
    from stewart_dynamics.planned.approach import approach, rest_to_rest, TimedMotion
    from stewart_dynamics.planned.planned_trajectory import (
        check_planned_trajectory, PlannedTrajectory)
    from stewart_dynamics.replay.read_arrays import (
        read_legs, read_setpoints, RecordedLegStates, RecordedSetpoints)

__version__ = '1.0.0'

__all__ = [
    'BagError', 'BaseMotion', 'Calibration', 'Capability', 'CueingStream', 'Extent', 'Felt',
    'ForceBreakdown', 'GovernedStream', 'InverseDynamics', 'Motion', 'MotionCueing',
    'MotionError', 'Motors', 'NaturalModes', 'ParameterError', 'Parameters', 'PlannedTrajectory',
    'Pose', 'PoseError', 'ReachError', 'Reachable', 'RecordedLegStates', 'RecordedSetpoints',
    'SingularityError', 'StewartError', 'StewartPlatform', 'TimedMotion', '__version__',
    'approach', 'calibrate', 'check_planned_trajectory', 'read_legs', 'read_setpoints',
    'rest_to_rest']

_MODULES = {
    'calibration.calibrate': ('Calibration', 'calibrate'),
    'capability.capability': ('Capability', 'Extent'),
    'capability.reachable': ('Reachable',),
    'cueing.motion_cueing': ('CueingStream', 'Felt', 'MotionCueing'),
    'errors': ('BagError', 'MotionError', 'ParameterError', 'PoseError', 'ReachError',
               'SingularityError', 'StewartError'),
    'mechanics.frames.base_motion': ('BaseMotion',),
    'mechanics.drives.motors': ('Motors',),
    'mechanics.dynamics.force_breakdown': ('ForceBreakdown',),
    'mechanics.dynamics.result': ('InverseDynamics',),
    'mechanics.frames.motion': ('Motion', 'Pose'),
    'mechanics.governor': ('GovernedStream',),
    'mechanics.stewart_platform': ('StewartPlatform',),
    'mechanics.stiffness': ('NaturalModes',),
    'parameters.table': ('Parameters',),
    'planned.approach': ('TimedMotion', 'approach', 'rest_to_rest'),
    'planned.planned_trajectory': ('PlannedTrajectory', 'check_planned_trajectory'),
    'replay.read_arrays': ('RecordedLegStates', 'RecordedSetpoints', 'read_legs',
                           'read_setpoints'),
}
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Return one of the library's names (PEP 562)."""
    if name not in _MODULE_OF:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    value = getattr(import_module(f'{__name__}.{_MODULE_OF[name]}'), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names, imported or not."""
    return sorted(__all__)
