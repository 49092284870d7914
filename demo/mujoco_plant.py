#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The node stewart_simulator with MuJoCo as its physics: topics, clock and parameters are the same.

The model is the MJCF that stewart_describe writes. End stops are MuJoCo's, a base that moves and
external wrenches are not simulated.
"""

from __future__ import annotations

import sys
from typing import Any

import mujoco
import numpy as np
from stewart_dynamics.arrays import Array, NO_WRENCH, Six
from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.description.mjcf import mjcf
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.frames.rotation import from_euler, from_quaternion, to_quaternion
from stewart_dynamics.mechanics.kinematics.leg_joints import TreeJoints
from stewart_dynamics.ros.run import run
from stewart_dynamics.simulator.plant import PlantState
from stewart_dynamics.simulator.simulator_node import SimulatorNode
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters

# Coordinates of the MJCF: three of each leg, then the platform's free joint.
_LEGS, _POSITION, _QUATERNION = slice(2, 18, 3), slice(18, 21), slice(21, 25)
_TWIST = slice(18, 24)


class MuJoCoPlant:
    """The hexapod in MuJoCo, with the calls of ``stewart_dynamics.simulator.plant.Plant``."""

    def __init__(self, parameters: SimulatorParameters) -> None:
        simulated = parameters.leg_kind.simulated
        if parameters.commands != simulated:
            raise ParameterError(f'commands: {parameters.commands}: must be {simulated} in MuJoCo')
        self.parameters = parameters
        self.fault = ''
        self._model = mujoco.MjModel.from_xml_string(mjcf(Hexapod(parameters), 'hexapod'))
        self._data = mujoco.MjData(self._model)
        self.steps = max(1, round(1.0 / (parameters.rate * self._model.opt.timestep)))
        self._model.opt.timestep = 1.0 / (parameters.rate * self.steps)
        self._zero_length = parameters.geometry.zero_length
        pose = parameters.initial_pose
        rotation = from_euler(pose[3:])
        qpos = self._data.qpos
        qpos[:18] = TreeJoints(parameters).positions(pose[:3], rotation)[6:]
        qpos[_POSITION] = pose[:3]
        qpos[_QUATERNION] = np.roll(to_quaternion(rotation), 1)
        mujoco.mj_forward(self._model, self._data)
        self.state = self._now()._replace(acceleration=NO_WRENCH, efforts=NO_WRENCH)

    def advance(self, commands: Six, wrench: Six, base: Array | None = None) -> PlantState:
        """Return the state one period later, under the commands [N]."""
        self._data.ctrl[:] = commands
        mujoco.mj_step(self._model, self._data, self.steps)
        if not np.isfinite(self._data.qpos).all():
            self.fault = 'MuJoCo has lost the hexapod: a coordinate is not finite'
            return self.state
        self.state = self._now()
        return self.state

    def brake(self) -> PlantState:
        """Return the state at rest in the present pose."""
        self._data.qvel[:] = 0.0
        self.state = self._now()._replace(acceleration=NO_WRENCH)
        return self.state

    def measured(self) -> PlantState:
        """Return the present state; there is no noise."""
        return self.state

    def _now(self) -> PlantState:
        qpos, qvel, qacc = self._data.qpos, self._data.qvel, self._data.qacc
        w, x, y, z = qpos[_QUATERNION].tolist()
        # A free joint turns in axes of its body.
        turn = np.reshape(from_quaternion(x, y, z, w), (3, 3))

        def in_base_axes(rates: Array) -> Any:
            linear, angular = rates[_TWIST][:3], turn @ rates[_TWIST][3:]
            return (*linear.tolist(), *angular.tolist())

        lengths: Any = tuple((qpos[_LEGS] + self._zero_length).tolist())
        rates: Any = tuple(qvel[_LEGS].tolist())
        forces: Any = tuple(self._data.actuator_force.tolist())
        return PlantState(lengths, rates, forces, (*qpos[_POSITION].tolist(), x, y, z, w),
                          in_base_axes(qvel), in_base_axes(qacc))


class MuJoCoNode(SimulatorNode):
    """The simulator, another physics in it."""

    plant = MuJoCoPlant


if __name__ == '__main__':
    sys.exit(run(MuJoCoNode, SimulatorParameters))
