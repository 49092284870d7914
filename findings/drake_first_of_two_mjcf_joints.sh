#!/bin/bash
# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

# Drake 1.51.1 (Python 3.11 and older) to 1.58.0: an MJCF body that is turned by quat has two hinges,
# a universal joint. In MuJoCo both axes are in axes of the body. Drake takes the first one in axes of
# the parent, the second one as MuJoCo does. Exits 1 if this changes.
set -euo pipefail
FOLDER=$(mktemp -d); trap 'rm -rf "$FOLDER"' EXIT; cd "$FOLDER"
python3 -m venv venv
venv/bin/pip install -q 'drake>=1.51.1,<=1.58.0' mujoco==3.17.0 2>pip.txt || { cat pip.txt; exit 2; }
cat > joints.py <<'PYTHON'
import logging
import sys
from importlib.metadata import version
import mujoco
import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable

logging.disable(logging.WARNING)
MODEL = """<mujoco model="two"><worldbody><body name="link" quat="0.7071067811865476 0 0 0.7071067811865476">
<joint name="first" type="hinge" axis="1 0 0"/><joint name="second" type="hinge" axis="0 1 0"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>"""
model = mujoco.MjModel.from_xml_string(MODEL)
data = mujoco.MjData(model)
mujoco.mj_kinematics(model, data)
plant = MultibodyPlant(0.0)
Parser(plant).AddModelsFromString(MODEL, 'xml')
plant.Finalize()
world = plant.world_frame()
jacobian = plant.CalcJacobianSpatialVelocity(
    plant.CreateDefaultContext(), JacobianWrtVariable.kV, plant.GetBodyByName('link').body_frame(),
    np.zeros(3), world, world)
axes = [jacobian[:3, plant.GetJointByName(name).velocity_start()] for name in ('first', 'second')]
print('drake', version('drake'), 'mujoco', version('mujoco'))
print('axes in the world: MuJoCo', data.xaxis.round(6).tolist(), 'Drake',
      np.round(axes, 6).tolist())
apart = np.linalg.norm(np.array(axes) - data.xaxis, axis=1)
sys.exit(not (apart[0] > 1.0 and apart[1] < 1e-6))
PYTHON
venv/bin/python joints.py 2>/dev/null
