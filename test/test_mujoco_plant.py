# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The demo's physics: MuJoCo moves the hexapod as the simulator does, and has its calls."""

from pathlib import Path
import sys

import numpy as np
import pytest

from stewart_dynamics import Motion, StewartPlatform
from stewart_dynamics.simulator.plant import Plant
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters

pytest.importorskip('mujoco')
pytest.importorskip('rclpy')

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT / 'demo'))
from mujoco_plant import MuJoCoPlant  # noqa: E402, I100, I202

GIVEN = {'initial_pose': [0.02, -0.03, 1.15, 0.05, -0.1, 0.2], 'rate': 500.0,
         'actuator.coulomb_friction': 0.0}


@pytest.fixture(scope='module')
def parameters():
    """Return the hexapod of the demos, without the friction that MuJoCo has another rule for."""
    platform = SimulatorParameters.table
    given = StewartPlatform.from_yaml(ROOT / 'config' / 'platform.yaml').parameters.given
    return SimulatorParameters({**{name: value for name, value in given.items()
                                   if name in platform}, **GIVEN})


def test_both_begin_in_the_same_state(parameters):
    ours, theirs = Plant(parameters).state, MuJoCoPlant(parameters).state
    for name in ('positions', 'rates', 'pose', 'twist', 'acceleration', 'efforts'):
        assert getattr(theirs, name) == pytest.approx(getattr(ours, name), abs=1e-12), name


def test_both_move_alike_under_the_same_forces(parameters):
    platform = StewartPlatform(parameters)
    ours, theirs = Plant(parameters), MuJoCoPlant(parameters)
    begin = Motion.from_euler(parameters['initial_pose'][:3], parameters['initial_pose'][3:])
    hold = platform.inverse_dynamics(begin).forces
    for n in range(150):  # 0.3 s
        forces = tuple((hold + 100.0 * np.sin(0.05 * n + np.arange(6.0))).tolist())
        for plant in (ours, theirs):
            plant.advance(forces, (0.0,) * 6)
    moved = np.array(ours.state.positions) - platform.inverse_kinematics(begin)
    assert np.abs(moved).max() > 5e-3
    assert theirs.state.positions == pytest.approx(ours.state.positions, abs=1e-4)
    assert theirs.state.rates == pytest.approx(ours.state.rates, abs=1e-3)
    assert theirs.state.pose == pytest.approx(ours.state.pose, abs=2e-4)
    assert theirs.state.twist == pytest.approx(ours.state.twist, abs=3e-3)
    assert theirs.state.efforts == pytest.approx(ours.state.efforts)


def test_brakes_take_all_speed(parameters):
    plant = MuJoCoPlant(parameters)
    plant.advance((2000.0,) * 6, (0.0,) * 6)
    assert max(map(abs, plant.state.twist)) > 1e-3
    plant.brake()
    assert plant.measured().twist == (0.0,) * 6
