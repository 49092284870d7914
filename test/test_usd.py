# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The USD of a hexapod, as usd-core reads it: masses, joints that fit, loops and drives."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
import pytest
from referees import random_parameters, rng
from stewart_dynamics import Parameters, StewartPlatform
from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.description.usd import usd

pytest.importorskip('pxr', reason='needs usd-core')

from pxr import Gf, Usd, UsdGeom, UsdPhysics  # noqa: E402, I100

Array = NDArray[np.float64]
FILE = Parameters.from_yaml(Path(__file__).parents[1] / 'config' / 'platform.yaml')
FLOAT = 2e-7  # resolution of positions of joints, which are single-precision


def opened(p: Parameters) -> Any:
    """Return the stage that a reader of the text has."""
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString(usd(Hexapod(p), 'hexapod'))
    return stage


def joints_of(stage: Any) -> dict[str, Any]:
    """Return the joints by their names."""
    return {prim.GetName(): UsdPhysics.Joint(prim) for prim in stage.Traverse()
            if prim.IsA(UsdPhysics.Joint)}


def frame(stage: Any, target: Any, position: Any, rotation: Any) -> tuple[Array, Array]:
    """Return a joint's frame on a body, in the world."""
    local = Gf.Matrix4d(Gf.Rotation(Gf.Quatd(rotation)), Gf.Vec3d(position))
    world = Gf.Matrix4d(1.0)
    if target:
        world = UsdGeom.Xformable(stage.GetPrimAtPath(target[0])).ComputeLocalToWorldTransform(
            Usd.TimeCode.Default())
    matrix = np.array(local * world)  # of rows
    return matrix[3, :3], matrix[:3, :3].T


@pytest.mark.parametrize('seed', range(4))
def test_both_frames_of_each_joint_are_one_at_home(seed: int) -> None:
    p = FILE if seed == 0 else random_parameters(rng(seed))
    stage = opened(p)
    joints = joints_of(stage)
    assert len(joints) == 1 + 3 * 6
    size = float(np.abs(p['geometry.base_joints']).max())
    for name, joint in joints.items():
        first = frame(stage, joint.GetBody0Rel().GetTargets(), joint.GetLocalPos0Attr().Get(),
                      joint.GetLocalRot0Attr().Get())
        second = frame(stage, joint.GetBody1Rel().GetTargets(), joint.GetLocalPos1Attr().Get(),
                       joint.GetLocalRot1Attr().Get())
        assert np.abs(first[1] - second[1]).max() < 1e-6, name
        gap = second[0] - first[0]
        if joint.GetPrim().IsA(UsdPhysics.PrismaticJoint):
            gap = gap - first[1] @ [0.0, 0.0, first[1][:, 2] @ gap]  # along its axis
        assert np.abs(gap).max() < 10.0 * FLOAT * size, name


@pytest.mark.skipif(not hasattr(UsdPhysics, 'LoadUsdPhysicsFromRange'),
                    reason='needs usd-core that reads physics')
def test_five_loops_are_excluded_from_the_articulation_and_the_rest_is_a_tree() -> None:
    stage = opened(FILE)
    joints = joints_of(stage)
    excluded = [name for name, joint in joints.items()
                if joint.GetExcludeFromArticulationAttr().Get()]
    assert excluded == [f'leg_{n}_platform_joint' for n in range(2, 7)]
    bodies = [prim for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.RigidBodyAPI)]
    assert len(bodies) == 14
    # A tree has as many joints as bodies, one of which is fixed to the world.
    assert len(joints) - len(excluded) == len(bodies)
    roots = [prim for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.ArticulationRootAPI)]
    assert roots == [stage.GetDefaultPrim()]
    found = UsdPhysics.LoadUsdPhysicsFromRange(stage, ['/'])
    kinds = {str(kind).rpartition('.')[2]: len(prims) for kind, (prims, _) in found.items()}
    assert kinds.get('PrismaticJoint') == 6 and kinds.get('SphericalJoint') == 6, kinds


def test_masses_inertias_limits_drives_and_gravity_are_those_of_the_file() -> None:
    p = FILE.replaced({'payload.mass': 82.0, 'payload.center_of_mass': [0.1, -0.2, 0.6]})
    stage = opened(p)
    platform = UsdPhysics.MassAPI(stage.GetPrimAtPath('/hexapod/platform'))
    assert platform.GetMassAttr().Get() == pytest.approx(232.0)
    assert np.array(platform.GetCenterOfMassAttr().Get()) == pytest.approx(
        p.carried.center, rel=1e-6)
    axes = np.array(Gf.Matrix3d(Gf.Rotation(Gf.Quatd(platform.GetPrincipalAxesAttr().Get())))).T
    whole = axes @ np.diag(platform.GetDiagonalInertiaAttr().Get()) @ axes.T
    assert whole[np.triu_indices(3)] == pytest.approx(p.carried.inertia, abs=1e-4)
    home = StewartPlatform(p).home_pose()
    matrix = UsdGeom.Xformable(platform.GetPrim()).ComputeLocalToWorldTransform(
        Usd.TimeCode.Default())
    assert np.array(matrix)[3, :3] == pytest.approx(home.position, abs=1e-15)
    slide = UsdPhysics.PrismaticJoint(stage.GetPrimAtPath('/hexapod/joints/leg_3'))
    assert slide.GetLowerLimitAttr().Get() == pytest.approx(0.95)
    assert slide.GetUpperLimitAttr().Get() == pytest.approx(1.65)
    drive = UsdPhysics.DriveAPI(slide.GetPrim(), 'linear')
    assert drive.GetMaxForceAttr().Get() == 6000.0 and drive.GetDampingAttr().Get() == 250.0
    assert slide.GetPrim().GetAttribute('stewart_dynamics:reflected_mass').Get() == 30.0
    scene = UsdPhysics.Scene(stage.GetPrimAtPath('/physicsScene'))
    assert scene.GetGravityMagnitudeAttr().Get() == pytest.approx(9.80665)
    assert tuple(scene.GetGravityDirectionAttr().Get()) == (0.0, 0.0, -1.0)
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdGeom.GetStageUpAxis(stage) == 'Z'
    # Locked axes: translations, and the turn about the leg.
    universal = stage.GetPrimAtPath('/hexapod/joints/leg_1_universal')
    for axis in ('transX', 'transY', 'transZ', 'rotZ'):
        limit = UsdPhysics.LimitAPI(universal, axis)
        assert limit.GetLowAttr().Get() > limit.GetHighAttr().Get()
