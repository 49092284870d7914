#!/bin/bash
# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

# Newton 1.8.0, add_usd: a UsdPhysics Joint with the three translations and rotZ locked is a universal
# joint; rotX and rotY have no limits, and are free by UsdPhysics. Newton makes 0 degrees of freedom of
# it: the axes are locked. With limits of +-179 degrees on them there are 2. Exits 1 if this changes.
set -euo pipefail
FOLDER=$(mktemp -d); trap 'rm -rf "$FOLDER"' EXIT; cd "$FOLDER"
python3 -m venv venv
venv/bin/pip install -q newton==1.8.0 newton-usd-schemas==0.6.0 usd-core==26.11 2>pip.txt || { cat pip.txt; exit 2; }
cat > joint.py <<'PYTHON'
import sys
from importlib.metadata import version
import newton
from pxr import Gf, Usd, UsdGeom, UsdPhysics
import warp

warp.config.quiet = True


def freedoms(limited):
    """Return the angular degrees of freedom of the joint in Newton."""
    stage = Usd.Stage.CreateInMemory()
    root = UsdGeom.Xform.Define(stage, '/robot')
    UsdPhysics.ArticulationRootAPI.Apply(root.GetPrim())
    for name in 'base', 'link':
        prim = UsdGeom.Xform.Define(stage, f'/robot/{name}').GetPrim()
        UsdPhysics.RigidBodyAPI.Apply(prim)
        mass = UsdPhysics.MassAPI.Apply(prim)
        mass.CreateMassAttr(1.0)
        mass.CreateDiagonalInertiaAttr(Gf.Vec3f(1.0))
    fixed = UsdPhysics.FixedJoint.Define(stage, '/robot/fixed')
    fixed.CreateBody1Rel().SetTargets(['/robot/base'])
    joint = UsdPhysics.Joint.Define(stage, '/robot/universal')
    joint.CreateBody0Rel().SetTargets(['/robot/base'])
    joint.CreateBody1Rel().SetTargets(['/robot/link'])
    limits = dict.fromkeys(('transX', 'transY', 'transZ', 'rotZ'), (1.0, -1.0))
    if limited:
        limits |= dict.fromkeys(('rotX', 'rotY'), (-179.0, 179.0))
    for axis, (low, high) in limits.items():
        limit = UsdPhysics.LimitAPI.Apply(joint.GetPrim(), axis)
        limit.CreateLowAttr(low)
        limit.CreateHighAttr(high)
    file = f'joint_{limited}.usda'  # layers are cached by their names
    stage.Export(file)
    builder = newton.ModelBuilder()
    builder.add_usd(file)
    return sum(angular for _, angular in builder.joint_dof_dim)


print('newton', version('newton'))
found = freedoms(False), freedoms(True)
print('degrees of freedom of the universal joint: rotX, rotY without limits:', found[0],
      '- with limits of 179 degrees:', found[1])
sys.exit(found != (0, 2))
PYTHON
venv/bin/python joint.py 2>/dev/null | grep -v "^ \|^Warp"
