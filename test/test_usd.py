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
from stewart_dynamics import Parameters, StewartError, StewartPlatform
from stewart_dynamics.description.formats import read_hexapod
from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.description.usd import usd

pytest.importorskip('pxr', reason='needs usd-core')

from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics  # noqa: E402, I100

Array = NDArray[np.float64]
FILE = Parameters.from_yaml(Path(__file__).parents[1] / 'config' / 'platform.yaml')
Y_UP = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
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
        assert np.abs(second[0] - first[0]).max() < 10.0 * FLOAT * size, name


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
    # Newton rejects a joint whose body0 is not the parent.
    reached = {Sdf.Path('/hexapod/base')}
    for name in ('leg_{}_universal', 'leg_{}', 'leg_{}_platform_joint'):
        for n in range(1, 7):
            joint = joints[name.format(n)]
            parent, child = (each.GetTargets()[0] for each in (
                joint.GetBody0Rel(), joint.GetBody1Rel()))
            assert parent in reached
            assert joint.GetExcludeFromArticulationAttr().Get() or child not in reached
            reached.add(child)
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
    length = StewartPlatform(p).inverse_kinematics(home)[2]
    assert slide.GetLowerLimitAttr().Get() == pytest.approx(0.95 - length)
    assert slide.GetUpperLimitAttr().Get() == pytest.approx(1.65 - length)
    drive = UsdPhysics.DriveAPI(slide.GetPrim(), 'linear')
    assert drive.GetMaxForceAttr().Get() == 6000.0 and drive.GetDampingAttr().Get() == 250.0
    given = {'newton:armature': 30.0, 'physxJoint:armature': 30.0, 'newton:friction': 20.0,
             'physxJointAxis:linear:dynamicFrictionEffort': 20.0, 'newton:velocityLimit': 0.5,
             'physxJoint:maxJointVelocity': 0.5}
    assert {key: slide.GetPrim().GetAttribute(key).Get() for key in given} == given
    schemas = slide.GetPrim().GetPrimTypeInfo().GetAppliedAPISchemas()
    assert {'NewtonJointAPI', 'PhysxJointAPI', 'PhysxJointAxisAPI:linear'} <= {*schemas}
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


def other_usd(units: str) -> str:
    """Return a hexapod as another tool writes it, in cm with y up, joints beside the bodies."""
    p = FILE
    meters, up, turn = (0.01, 'Y', Y_UP) if units == 'cm' else (1.0, 'Z', np.eye(3))
    home = StewartPlatform(p).home_pose()
    tips = home.position + p['geometry.platform_joints'] @ home.rotation.T
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, up)
    UsdGeom.SetStageMetersPerUnit(stage, meters)
    UsdPhysics.Scene.Define(stage, '/scene')
    root = UsdGeom.Xform.Define(stage, '/World')
    stage.SetDefaultPrim(root.GetPrim())

    def body(name: str, at: Any, mass: float) -> str:
        prim = UsdGeom.Xform.Define(stage, f'/World/{name}')
        prim.AddTranslateOp().Set(Gf.Vec3d(*(turn @ at / meters).tolist()))
        if mass:
            UsdPhysics.RigidBodyAPI.Apply(prim.GetPrim())
            api = UsdPhysics.MassAPI.Apply(prim.GetPrim())
            api.CreateMassAttr(mass)
            api.CreateDiagonalInertiaAttr(Gf.Vec3f(*[0.3 * mass / meters ** 2] * 3))
        return f'/World/{name}'

    def joint(schema: Any, name: str, first: str, second: str, at: Any, ends: Any,
              turned: Any = (1.0, 0.0, 0.0, 0.0)) -> Any:
        made = schema.Define(stage, f'/World/joints/{name}')
        made.CreateBody0Rel().SetTargets([first])
        made.CreateBody1Rel().SetTargets([second])
        for side, end in enumerate(ends):
            getattr(made, f'CreateLocalPos{side}Attr')(
                Gf.Vec3f(*(turn @ (at - end) / meters).tolist()))
            getattr(made, f'CreateLocalRot{side}Attr')(Gf.Quatf(*turned))
        return made

    ground = body('ground', np.zeros(3), 0.0)  # a prim that is no rigid body
    plate = body('plate', home.position, 150.0)
    for n, (base, tip) in enumerate(zip(p['geometry.base_joints'], tips, strict=True)):
        lower, upper = body(f'lower{n}', base, 6.0), body(f'upper{n}', tip, 2.0)
        universal = joint(UsdPhysics.Joint, f'u{n}', ground, lower, base, (np.zeros(3), base))
        for axis in ('transX', 'transY', 'transZ', 'rotZ'):
            limit = UsdPhysics.LimitAPI.Apply(universal.GetPrim(), axis)
            limit.CreateLowAttr(1.0)
            limit.CreateHighAttr(-1.0)
        along = turn @ (tip - base)
        rotation = Gf.Rotation(Gf.Vec3d(1, 0, 0), Gf.Vec3d(*along.tolist())).GetQuat()
        slide = joint(UsdPhysics.PrismaticJoint, f's{n}', lower, upper, tip, (base, tip),
                      (rotation.real, *rotation.imaginary))
        slide.CreateAxisAttr('X')
        slide.CreateLowerLimitAttr(-0.2 / meters)
        slide.CreateUpperLimitAttr(0.3 / meters)
        joint(UsdPhysics.SphericalJoint, f'b{n}', plate, upper, tip, (home.position, tip))
    return str(stage.GetRootLayer().ExportToString())


@pytest.mark.parametrize('units', ['m', 'cm'])
def test_the_usd_of_another_tool_is_read_in_its_units(units: str, tmp_path: Path) -> None:
    file = tmp_path / 'other.usda'
    file.write_text(other_usd(units))
    found = read_hexapod(file)
    p = found.parameters
    assert (p['base_frame'], p['platform_frame']) == ('ground', 'plate')
    turn = Y_UP if units == 'cm' else np.eye(3)
    for name in ('geometry.base_joints', 'geometry.platform_joints'):
        assert p[name] == pytest.approx(FILE[name] @ turn.T, abs=1e-6)
    assert p['gravity'] == pytest.approx(turn @ [0.0, 0.0, -9.80665], abs=1e-5)
    assert p['platform.mass'] == 150.0
    assert p['platform.inertia'] == pytest.approx([45.0, 0.0, 0.0, 45.0, 0.0, 45.0], rel=1e-6)
    lengths = StewartPlatform(FILE).inverse_kinematics(StewartPlatform(FILE).home_pose())
    assert p['limits.length_max'] == pytest.approx(lengths + 0.3, abs=1e-6)
    assert p['legs.piston.mass'] == pytest.approx(2.0)
    assert p['actuator.reflected_mass'] == pytest.approx(0.0)


def test_a_mass_without_its_schema_has_no_inertia(tmp_path: Path) -> None:
    """An attribute that no schema declares has no default."""
    stage = opened(FILE)
    for prim in stage.Traverse():
        for name in ('centerOfMass', 'diagonalInertia', 'principalAxes'):
            prim.RemoveProperty(f'physics:{name}')
        prim.RemoveAPI(UsdPhysics.MassAPI)
    stage.Export(str(tmp_path / 'hexapod.usda'))
    with pytest.raises(StewartError, match='platform: no inertia: .*; --geometry-only'):
        read_hexapod(tmp_path / 'hexapod.usda')


@pytest.mark.parametrize(('data', 'why'), [
    (b'#usda 1.0\ndef Xform "a" {', 'usd-core: '), (b'PXR-USDC\0\0', 'usd-core: '),
    (b'#usda 1.0\n', 'no hexapod'), (b'', 'usd-core: '), (None, 'cannot be read')])
def test_a_usd_without_a_hexapod_is_rejected_in_one_line(
        data: bytes | None, why: str, tmp_path: Path) -> None:
    file = tmp_path / 'a.usd'
    if data is not None:
        file.write_bytes(data)
    with pytest.raises(StewartError, match=why) as caught:
        read_hexapod(file)
    assert '\n' not in str(caught.value)
