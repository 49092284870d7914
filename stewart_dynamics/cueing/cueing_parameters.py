# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The parameters of the node stewart_cueing: those of the hexapod, and its own."""

from __future__ import annotations

from stewart_dynamics.parameters.parameter_set import declare
from stewart_dynamics.parameters.table import COMBINED, PARAMETERS, Parameters, SEPARATE

# Beginnings of names without an effect here.
_NOT_USED = ('drive.resistance', 'drive.temperature_rise_max', 'drive.thermal_',
             'drive.torque_constant', 'drive.torque_continuous', 'external_wrench.', 'base.',
             'joint_states.', 'meshes.', 'publish_tf', 'setpoint.', 'trajectory.', 'world_frame',
             'limits.action', 'singularity.action', 'singularity.warn_', 'visualization_rate',
             'uncertainty.', 'payload.')


class CueingParameters(Parameters):
    """The parameters of the hexapod, of motion cueing, and of its node."""

    target: str = declare(
        'node that receives the setpoints, on <target>/setpoint/...', default=Parameters.node)
    output: str = declare(
        'pose, twist and accel on three topics, or combined in one message', default=SEPARATE,
        choices=(SEPARATE, COMBINED))
    vehicle_timeout: float = declare(
        'time without ~/vehicle after which its motion is washed out, to rest', 's', 0.2,
        minimum=0.0, above=True, maximum=60.0)
    start_timeout: float = declare(
        'the approach to the home pose starts with the first of ~/measured_legs; without them, '
        'motion cueing starts at home after this time', 's', 5.0, minimum=0.0, maximum=86400.0)

    node = 'stewart_cueing'
    unused = frozenset(name for name in PARAMETERS if name.startswith(_NOT_USED))
