# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""MJCF as a mechanism, by MuJoCo's own loader: defaults, includes and masses of shapes are its."""

from __future__ import annotations

import math
from pathlib import Path
import tempfile
from typing import Any

import numpy as np

from stewart_dynamics.description.bounded_process import load_in_process, unusable
from stewart_dynamics.description.xml_text import CARRIED, ELEMENT
from stewart_dynamics.legs.mechanism import (
    BALL, CarriedParameter, DescriptionError, FIXED, HINGE, Joint, Mechanism, MechanismBody, OTHER,
    Placement, SLIDE, WORLD)
from stewart_dynamics.mechanics.frames.rotation import from_quaternion
from stewart_dynamics.parameters.table import PARAMETERS


def read_mjcf(source: Path) -> Mechanism:
    """Return the mechanism of an MJCF; DescriptionError where MuJoCo rejects it."""
    try:
        import mujoco
    except ModuleNotFoundError as exc:
        raise DescriptionError(
            f"{source}: MJCF is read by mujoco: pip install 'stewart_dynamics[mujoco]'") from exc
    except Exception as exc:  # a package of parts of several versions fails in any way
        raise unusable(source, 'MJCF is read', 'mujoco', 'mujoco', exc) from exc
    try:
        return _mechanism(mujoco, source)
    except (AttributeError, ImportError) as exc:
        raise unusable(source, 'MJCF is read', 'mujoco', 'mujoco', exc) from exc


def _mechanism(mujoco: Any, source: Path) -> Mechanism:
    unread = ''
    try:
        model = _loaded(mujoco, source, 'load(source)')
    except DescriptionError as exc:
        # Meshes of a clone without Git LFS are pointers, and bodies with own masses need none.
        try:
            model = _loaded(mujoco, source, 'without_meshes(source)')
        except DescriptionError:
            raise exc from None
        unread = str(exc)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mechanism = Mechanism(str(source), source.stem, _parts(model, data), [],
                          gravity=np.array(model.opt.gravity))
    if unread:
        mechanism.remarks.append(f'meshes are left out, all bodies have masses: {unread}')
    _options(mujoco, model, mechanism)
    for body in range(1, model.nbody):
        _joints_of(mujoco, model, data, body, mechanism)
    for n in range(model.neq):
        _loop(mujoco, model, data, n, mechanism)
    _tendons(mujoco, model, mechanism)
    _actuators(mujoco, model, mechanism)
    texts = {mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_TEXT, n) or '': bytes(
        model.text_data[at:at + size]).rstrip(b'\0').decode()
        for n, (at, size) in enumerate(zip(model.text_adr, model.text_size, strict=True))}
    for name in PARAMETERS:
        if f'{CARRIED}.{name}' in texts:
            mechanism.carried[name] = CarriedParameter(
                texts[f'{CARRIED}.{name}'], texts.get(f'{ELEMENT}.{name}', ''))
    return mechanism


_LOADERS = """
import mujoco
save, load = mujoco.mj_saveModel, mujoco.MjModel.from_xml_path
def without_meshes(source):
    spec = mujoco.MjSpec.from_file(source)
    if spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE:
        raise ValueError('masses are those of shapes')
    for geom in [each for each in spec.geoms if each.meshname]:
        if not geom.parent.explicitinertial and geom.parent.name != 'world':
            raise ValueError('a mass is that of a mesh')
        spec.delete(geom)
    for mesh in [*spec.meshes]:
        spec.delete(mesh)
    return spec.compile()
"""


def _loaded(mujoco: Any, source: Path, load: str) -> Any:
    """
    Return the model that MuJoCo makes of a file; it writes warnings to a MUJOCO_LOG.TXT.

    load: an expression with the functions of ``_LOADERS``.
    """
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / 'model.mjb'
        load_in_process('MuJoCo', _LOADERS, f'save({load}, target)', source, model)
        return mujoco.MjModel.from_binary_path(str(model))


def _switched_off(mujoco: Any, model: Any, flag: str) -> bool:
    """Return whether an option of the file switches something off."""
    bit = getattr(mujoco.mjtDisableBit, f'mjDSBL_{flag}', None)
    return bit is not None and bool(model.opt.disableflags & int(bit))


def _options(mujoco: Any, model: Any, mechanism: Mechanism) -> None:
    """Take gravity as it acts, and name forces that act on all bodies."""
    if _switched_off(mujoco, model, 'GRAVITY'):
        mechanism.gravity = np.zeros(3)
        mechanism.remarks.append('gravity: switched off by a flag of the file: 0 m/s^2')
    for key, unit in (('density', 'kg/m^3'), ('viscosity', 'Pa s')):
        value = float(getattr(model.opt, key))
        if value:
            mechanism.remarks.append(
                f'forces of the surrounding fluid, {key} {value:.4g} {unit}, are left out')
    if model.nplugin:
        mechanism.remarks.append(f'{model.nplugin} plugins of MuJoCo are left out')
    if model.neq and _switched_off(mujoco, model, 'EQUALITY'):
        mechanism.remarks.append('constraints: switched off by a flag of the file: taken as on')


def _name(model: Any, body: int) -> str:
    return WORLD if body == 0 else model.body(body).name or f'body {body}'


def _parts(model: Any, data: Any) -> dict[str, MechanismBody]:
    parts = {}
    for body in range(model.nbody):
        w, x, y, z = model.body_iquat[body].tolist()
        turn = np.reshape(from_quaternion(x, y, z, w), (3, 3))
        parts[_name(model, body)] = MechanismBody(
            _name(model, body),
            Placement(data.xmat[body].reshape(3, 3).copy(), data.xpos[body].copy()),
            float(model.body_mass[body]), model.body_ipos[body].copy(),
            turn @ np.diag(model.body_inertia[body]) @ turn.T,
            shapes=int(model.body_geomnum[body]))
        share = float(model.body_gravcomp[body])
        if share:
            parts[_name(model, body)].weightless = f'gravcomp {share:.4g}'
    return parts


def _joint_name(model: Any, n: int) -> str:
    body = int(model.jnt_bodyid[n])
    return model.joint(n).name or (
        f'{_name(model, body)}_joint_{n - int(model.body_jntadr[body]) + 1}')


def _joints_of(mujoco: Any, model: Any, data: Any, body: int, mechanism: Mechanism) -> None:
    """Add the joints of a body; between several there are bodies without mass."""
    kinds = {int(mujoco.mjtJoint.mjJNT_HINGE): HINGE, int(mujoco.mjtJoint.mjJNT_SLIDE): SLIDE,
             int(mujoco.mjtJoint.mjJNT_BALL): BALL}
    name, parent = _name(model, body), _name(model, model.body_parentid[body])
    first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    if not count:
        mechanism.joints.append(Joint(f'{name} fixed', FIXED, parent, name,
                                      data.xpos[body].copy()))
    for n in range(first, first + count):
        child = name if n == first + count - 1 else f'{name} after {n}'
        mechanism.parts.setdefault(
            child, MechanismBody(child, mechanism.parts[name].placement, 0.0))
        kind = kinds.get(int(model.jnt_type[n]), OTHER)
        made = Joint(_joint_name(model, n), kind, parent, child,
                     data.xanchor[n].copy(), [data.xaxis[n].copy()])
        dof = model.jnt_dofadr[n]
        made.armature = float(model.dof_armature[dof].item())
        if not _switched_off(mujoco, model, 'DAMPER'):
            made.damping = float(model.dof_damping[dof].item())
            if np.any(getattr(model, 'dof_dampingpoly', np.zeros(dof + 1))[dof]):
                made.left_out.append('damping that grows with powers of the rate')
        if not _switched_off(mujoco, model, 'FRICTIONLOSS'):
            made.friction = float(model.dof_frictionloss[dof].item())
        if kind in (SLIDE, HINGE):
            made.position = float(model.qpos0[model.jnt_qposadr[n]])
            if model.jnt_limited[n] and not _switched_off(mujoco, model, 'LIMIT'):
                made.lower, made.upper = map(float, model.jnt_range[n])
        _spring(mujoco, model, n, made)
        mechanism.joints.append(made)
        parent = child


def _spring(mujoco: Any, model: Any, n: int, made: Joint) -> None:
    """Add the spring of a joint, if it has one that acts."""
    stiffness = float(model.jnt_stiffness[n].item())
    powers = bool(np.any(getattr(model, 'jnt_stiffnesspoly', np.zeros(n + 1))[n]))
    if (stiffness or powers) and not _switched_off(mujoco, model, 'SPRING'):
        reference = 0.0  # of joints with several coordinates, and their axes
        if made.kind in (HINGE, SLIDE):
            reference = float(model.qpos_spring[model.jnt_qposadr[n]])
        made.spring(stiffness, reference, ', more with powers of the deflection' if powers else '')


def _loop(mujoco: Any, model: Any, data: Any, n: int, mechanism: Mechanism) -> None:
    """Add the joint of a constraint, if it is one."""
    kind = {int(mujoco.mjtEq.mjEQ_CONNECT): BALL, int(mujoco.mjtEq.mjEQ_WELD): FIXED}.get(
        int(model.eq_type[n]))
    name = model.equality(n).name or f'{kind or "constraint"} {n + 1}'
    if kind is None:
        mechanism.remarks.append(f'{name}: a constraint that is neither connect nor weld is left '
                                 'out')
        return
    first, second = int(model.eq_obj1id[n]), int(model.eq_obj2id[n])
    if not model.eq_active0[n]:
        mechanism.remarks.append(f'{name}: not active in the file: taken as active')
    if model.eq_objtype[n] == mujoco.mjtObj.mjOBJ_SITE:
        ends = [(int(model.site_bodyid[site]), data.site_xpos[site].copy())
                for site in (first, second)]
    else:
        points = model.eq_data[n, 0:3], model.eq_data[n, 3:6]
        if kind == FIXED:
            points = points[1], points[0]
        ends = [(body, mechanism.parts[_name(model, body)].placement.point(point))
                for body, point in zip((first, second), points, strict=True)]
    (parent, on_parent), (child, on_child) = ends
    mechanism.joints.append(Joint(name, kind, _name(model, parent), _name(model, child), on_parent,
                                  child_anchor=on_child))


def _tendons(mujoco: Any, model: Any, mechanism: Mechanism) -> None:
    """Name the properties of tendons, which this model does not have."""
    for n in range(model.ntendon):
        name = model.tendon(n).name or f'tendon {n + 1}'
        stiffness = float(model.tendon_stiffness[n].item())
        if stiffness and not _switched_off(mujoco, model, 'SPRING'):
            mechanism.warnings.append(
                f'{name}: stiffness {stiffness:.6g} N/m of this tendon is left out')
        there = [f'{key} {value:.6g}' for key in ('damping', 'frictionloss', 'armature')
                 if (value := float(getattr(model, f'tendon_{key}', np.zeros(n + 1))[n].item()))]
        if model.tendon_limited[n]:
            there.append('range {:.6g} {:.6g}'.format(*model.tendon_range[n].tolist()))
        if there:
            mechanism.remarks.append(f'{name}: {", ".join(there)} of this tendon: left out')


def _actuators(mujoco: Any, model: Any, mechanism: Mechanism) -> None:
    """Take the order of the legs, and the largest forces and the inertia of actuators."""
    joints = {joint.name: joint for joint in mechanism.joints}
    order = []
    bounds: dict[str, list[float]] = {}  # the largest force of each actuator, by its joint
    for n in range(model.nu):
        name = model.actuator(n).name or f'actuator {n + 1}'
        joint = None
        if int(model.actuator_trntype[n]) in (int(mujoco.mjtTrn.mjTRN_JOINT),
                                              int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)):
            at = int(model.actuator_trnid[n, 0])
            joint = joints[_joint_name(model, at)]
        if joint is None:
            mechanism.remarks.append(f'{name}: an actuator that acts on no joint is left out')
            continue
        if joint.kind not in (SLIDE, HINGE):
            joint.left_out.append(f'actuator {name!r}')
            continue
        joint.actuators.append(name)
        order.append(joint.name)
        if model.actuator_gear[n, 0] < 0.0:
            mechanism.remarks.append(f'{joint.name}: the gear of its actuator is negative: '
                                     'forces are along its joint here')
        bounds.setdefault(joint.name, []).append(_largest_force(mujoco, model, n, joint))
        square = float(model.actuator_gear[n, 0]) ** 2
        for key in ('armature', 'damping'):
            added = getattr(model, f'actuator_{key}', np.zeros(n + 1))[n].item()
            setattr(joint, key, getattr(joint, key) + square * float(added))
    for n in range(model.njnt):
        joint = joints[_joint_name(model, n)]
        if joint.kind not in (SLIDE, HINGE):
            continue
        together = [sum(bounds.get(joint.name, [math.inf]))]
        if model.jnt_actfrclimited[n]:
            together.append(joint.symmetric(
                'force_max', 'actuatorfrcrange', *model.jnt_actfrcrange[n]))
        if min(together) < math.inf:
            joint.force_max = min(together)
            joint.without.discard('force_max')
    mechanism.order = tuple(dict.fromkeys(order))


def _largest_force(mujoco: Any, model: Any, n: int, joint: Joint) -> float:
    """Return the largest force of an actuator, both ways; infinity without one."""
    gear = abs(float(model.actuator_gear[n, 0]))
    found = [math.inf]
    if model.actuator_forcelimited[n]:
        found.append(gear * joint.symmetric(
            'force_max', 'forcerange', *model.actuator_forcerange[n]))
    gain = abs(float(model.actuator_gainprm[n, 0]))
    of_forces = (int(model.actuator_biastype[n]) == int(mujoco.mjtBias.mjBIAS_NONE)
                 and int(model.actuator_dyntype[n]) != int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
                 and gain > 0.0)
    if (model.actuator_ctrllimited[n] and of_forces
            and not _switched_off(mujoco, model, 'CLAMPCTRL')):
        found.append(gear * gain * joint.symmetric(
            'force_max', 'ctrlrange', *model.actuator_ctrlrange[n]))
    return min(found)
