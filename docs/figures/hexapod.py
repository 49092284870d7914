# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Draw docs/figures/mujoco.png: the MJCF of config/platform.yaml in MuJoCo, at two poses.

``make docs`` runs it. MuJoCo draws without a screen by EGL, or by MUJOCO_GL.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

os.environ.setdefault('MUJOCO_GL', 'egl')

import matplotlib.image  # noqa: E402, I202
import mujoco  # noqa: E402
import numpy as np  # noqa: E402
from stewart_dynamics import Pose, StewartPlatform  # noqa: E402
from stewart_dynamics.description.hexapod import Hexapod  # noqa: E402
from stewart_dynamics.description.mjcf import mjcf  # noqa: E402
from stewart_dynamics.mechanics.kinematics.leg_joints import TreeJoints  # noqa: E402

HERE = Path(__file__).resolve().parent
SIZE = 470, 560  # height, width


def model_of(platform: StewartPlatform) -> Any:
    """Return the hexapod's model on a white ground, with a light above it."""
    root = ET.fromstring(mjcf(Hexapod(platform.parameters), 'hexapod'))
    visual, assets, world = root.find('visual'), root.find('asset'), root.find('worldbody')
    assert visual is not None
    assert assets is not None
    assert world is not None
    ET.SubElement(visual, 'global', {'offheight': str(SIZE[0]), 'offwidth': str(SIZE[1])})
    ET.SubElement(visual, 'quality', {'shadowsize': '4096', 'offsamples': '8'})
    ET.SubElement(assets, 'texture', {'type': 'skybox', 'builtin': 'flat', 'rgb1': '1 1 1',
                                      'width': '16', 'height': '96'})
    ET.SubElement(world, 'light', {'pos': '1.5 -2 4', 'dir': '-0.35 0.45 -1',
                                   'directional': 'true', 'diffuse': '0.5 0.5 0.5'})
    ET.SubElement(world, 'geom', {'type': 'plane', 'size': '0 0 0.1', 'pos': '0 0 -0.03',
                                  'rgba': '0.97 0.97 0.97 1'})
    return mujoco.MjModel.from_xml_string(ET.tostring(root, encoding='unicode'))


def picture(renderer: Any, model: Any, platform: StewartPlatform, pose: Pose) -> Any:
    """Return the pixels of the hexapod at a pose."""
    data = mujoco.MjData(model)
    joints = TreeJoints(platform.parameters).positions(pose.position, pose.rotation)
    data.qpos[:18], data.qpos[18:21] = joints[6:], pose.position
    data.qpos[21:25] = np.roll(pose.quaternion, 1)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation, camera.distance = 130.0, -16.0, 3.3
    camera.lookat[:] = 0.0, 0.0, 0.58
    renderer.update_scene(data, camera)
    return renderer.render()


def main() -> None:
    """Draw the picture."""
    platform = StewartPlatform.from_yaml(HERE.parents[1] / 'config' / 'platform.yaml')
    model = model_of(platform)
    poses = platform.home_pose(), Pose.from_euler([0.1, -0.12, 1.2], [0.22, -0.18, 0.35])
    with mujoco.Renderer(model, *SIZE) as renderer:
        pixels = np.hstack([picture(renderer, model, platform, pose) for pose in poses])
    matplotlib.image.imsave(HERE / 'mujoco.png', pixels, metadata={'Software': None})
    print('docs/figures/mujoco.png')


if __name__ == '__main__':
    main()
