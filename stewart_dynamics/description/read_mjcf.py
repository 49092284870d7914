# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""MJCF as a mechanism, by MuJoCo's own loader: defaults, includes and masses of shapes are its."""

from __future__ import annotations

import math
from pathlib import Path
import tempfile
from typing import Any

import numpy as np

from stewart_dynamics.description.bounded_process import load_in_process, read_with
from stewart_dynamics.description.carried import CARRIED, ELEMENT
from stewart_dynamics.legs.mechanism import (
    BALL, CarriedParameter, DescriptionError, FIXED, HINGE, Joint, Mechanism, MechanismBody, OTHER,
    Placement, SLIDE, WORLD)
from stewart_dynamics.mechanics.frames.rotation import from_quaternion
from stewart_dynamics.parameters.table import PARAMETERS


def read_mjcf(source: Path) -> Mechanism:
    """Return the mechanism of an MJCF; DescriptionError where MuJoCo rejects it."""
    return read_with('mujoco', 'mujoco', 'mujoco', source, 'MJCF', _mechanism)


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
        unread = f'meshes are left out, all bodies have masses: {exc}'
    return _Model(mujoco, model, source, unread).mechanism


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


class _Model:
    """Bodies, joints, constraints and actuators of a compiled model."""

    def __init__(self, mujoco: Any, model: Any, source: Path, unread: str) -> None:
        self._mujoco, self._model, self._data = mujoco, model, mujoco.MjData(model)
        mujoco.mj_kinematics(model, self._data)
        self.mechanism = Mechanism(
            str(source), source.stem, dict(map(self._body, range(model.nbody))), [],
            gravity=np.array(model.opt.gravity))
        if unread:
            self._remark(unread)
        self._take_options()
        for body in range(1, model.nbody):
            self._add_joints(body)
        self._joints = {joint.name: joint for joint in self.mechanism.joints}
        for n in range(model.neq):
            self._add_loop(n)
        for n in range(model.ntendon):
            self._name_tendon(n)
        self._take_actuators()
        texts = {mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_TEXT, n) or '': bytes(
            model.text_data[at:at + size]).rstrip(b'\0').decode()
            for n, (at, size) in enumerate(zip(model.text_adr, model.text_size, strict=True))}
        self.mechanism.carried = {
            name: CarriedParameter(texts[f'{CARRIED}.{name}'], texts.get(f'{ELEMENT}.{name}', ''))
            for name in PARAMETERS if f'{CARRIED}.{name}' in texts}

    def _remark(self, text: str) -> None:
        self.mechanism.remarks.append(text)

    def _is_off(self, flag: str) -> bool:
        """Return whether an option of the file switches something off."""
        bit = getattr(self._mujoco.mjtDisableBit, f'mjDSBL_{flag}')
        return bool(self._model.opt.disableflags & int(bit))

    def _number(self, field: str, n: int) -> float:
        """Return a number of the model."""
        return float(getattr(self._model, field)[n].item())

    def _grows(self, field: str, n: int) -> bool:
        """Return whether a joint has terms with powers."""
        return bool(np.any(getattr(self._model, field)[n]))

    def _take_options(self) -> None:
        """Take gravity as it acts, and name forces that act on all bodies."""
        model = self._model
        if self._is_off('GRAVITY'):
            self.mechanism.gravity = np.zeros(3)
            self._remark('gravity: switched off by a flag of the file: 0 m/s^2')
        for key, unit in (('density', 'kg/m^3'), ('viscosity', 'Pa s')):
            value = float(getattr(model.opt, key))
            if value:
                self._remark(
                    f'forces of the surrounding fluid, {key} {value:.4g} {unit}, are left out')
        if model.nplugin:
            self._remark(f'{model.nplugin} plugins of MuJoCo are left out')
        if model.neq and self._is_off('EQUALITY'):
            self._remark('constraints: switched off by a flag of the file: taken as on')

    def _name(self, body: int) -> str:
        return WORLD if body == 0 else self._model.body(body).name or f'body {body}'

    def _body(self, body: int) -> tuple[str, MechanismBody]:
        """Return a body with its name."""
        model, data, name = self._model, self._data, self._name(body)
        w, x, y, z = model.body_iquat[body].tolist()
        turn = np.reshape(from_quaternion(x, y, z, w), (3, 3))
        share = self._number('body_gravcomp', body)
        return name, MechanismBody(
            name, Placement(data.xmat[body].reshape(3, 3).copy(), data.xpos[body].copy()),
            self._number('body_mass', body), model.body_ipos[body].copy(),
            turn @ np.diag(model.body_inertia[body]) @ turn.T,
            shapes=int(model.body_geomnum[body]),
            weightless=f'gravcomp {share:.4g}' if share else '')

    def _joint_name(self, n: int) -> str:
        body = int(self._model.jnt_bodyid[n])
        return self._model.joint(n).name or (
            f'{self._name(body)}_joint_{n - int(self._model.body_jntadr[body]) + 1}')

    def _add_joints(self, body: int) -> None:
        """Add the joints of a body; between several there are bodies without mass."""
        model, parts, joints = self._model, self.mechanism.parts, self.mechanism.joints
        name, parent = self._name(body), self._name(model.body_parentid[body])
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        if not count:
            joints.append(Joint(f'{name} fixed', FIXED, parent, name,
                                self._data.xpos[body].copy()))
        for n in range(first, first + count):
            child = name if n == first + count - 1 else f'{name} after {n}'
            parts.setdefault(child, MechanismBody(child, parts[name].placement, 0.0))
            joints.append(self._joint(n, parent, child))
            parent = child

    def _joint(self, n: int, parent: str, child: str) -> Joint:
        model, types = self._model, self._mujoco.mjtJoint
        kind = {int(types.mjJNT_HINGE): HINGE, int(types.mjJNT_SLIDE): SLIDE,
                int(types.mjJNT_BALL): BALL}.get(int(model.jnt_type[n]), OTHER)
        made = Joint(self._joint_name(n), kind, parent, child, self._data.xanchor[n].copy(),
                     [self._data.xaxis[n].copy()])
        dof, moves = model.jnt_dofadr[n], kind in (SLIDE, HINGE)
        made.armature = self._number('dof_armature', dof)
        if not self._is_off('DAMPER'):
            made.damping = self._number('dof_damping', dof)
            if self._grows('dof_dampingpoly', dof):
                made.left_out.append('damping that grows with powers of the rate')
        if not self._is_off('FRICTIONLOSS'):
            made.friction = self._number('dof_frictionloss', dof)
        if moves:
            made.position = float(model.qpos0[model.jnt_qposadr[n]])
            if model.jnt_limited[n] and not self._is_off('LIMIT'):
                made.lower, made.upper = map(float, model.jnt_range[n])
        stiffness, more = self._number('jnt_stiffness', n), self._grows('jnt_stiffnesspoly', n)
        if (stiffness or more) and not self._is_off('SPRING'):
            # Joints with several coordinates have springs about their axes.
            reference = float(model.qpos_spring[model.jnt_qposadr[n]]) if moves else 0.0
            made.spring(stiffness, reference,
                        ', more with powers of the deflection' if more else '')
        return made

    def _add_loop(self, n: int) -> None:
        """Add the joint of a constraint, if it is one."""
        model, types = self._model, self._mujoco.mjtEq
        kind = {int(types.mjEQ_CONNECT): BALL, int(types.mjEQ_WELD): FIXED}.get(
            int(model.eq_type[n]))
        name = model.equality(n).name or f'{kind or "constraint"} {n + 1}'
        if kind is None:
            self._remark(f'{name}: a constraint that is neither connect nor weld is left out')
            return
        ends = int(model.eq_obj1id[n]), int(model.eq_obj2id[n])
        if not model.eq_active0[n]:
            self._remark(f'{name}: not active in the file: taken as active')
        if model.eq_objtype[n] == self._mujoco.mjtObj.mjOBJ_SITE:
            places = [self._data.site_xpos[site].copy() for site in ends]
            parent, child = (self._name(int(model.site_bodyid[site])) for site in ends)
        else:
            parent, child = map(self._name, ends)
            points = model.eq_data[n, 0:3], model.eq_data[n, 3:6]
            places = [self.mechanism.parts[end].placement.point(point) for end, point in zip(
                (parent, child), points[::-1] if kind == FIXED else points, strict=True)]
        self.mechanism.joints.append(
            Joint(name, kind, parent, child, places[0], child_anchor=places[1]))

    def _name_tendon(self, n: int) -> None:
        """Name the properties of a tendon, which this model does not have."""
        name = self._model.tendon(n).name or f'tendon {n + 1}'
        stiffness = self._number('tendon_stiffness', n)
        if stiffness and not self._is_off('SPRING'):
            self.mechanism.warnings.append(
                f'{name}: stiffness {stiffness:.6g} N/m of this tendon is left out')
        there = [f'{key} {value:.6g}' for key in ('damping', 'frictionloss', 'armature')
                 if (value := self._number(f'tendon_{key}', n))]
        if self._model.tendon_limited[n]:
            there.append('range {:.6g} {:.6g}'.format(*self._model.tendon_range[n].tolist()))
        if there:
            self._remark(f'{name}: {", ".join(there)} of this tendon: left out')

    def _take_actuators(self) -> None:
        """Take the order of the legs, and the largest forces and the inertia of actuators."""
        model, types = self._model, self._mujoco.mjtTrn
        bounds: dict[str, list[float]] = {}  # the largest force of each actuator, by its joint
        for n in range(model.nu):
            name = model.actuator(n).name or f'actuator {n + 1}'
            if int(model.actuator_trntype[n]) not in (
                    int(types.mjTRN_JOINT), int(types.mjTRN_JOINTINPARENT)):
                self._remark(f'{name}: an actuator that acts on no joint is left out')
                continue
            joint = self._joints[self._joint_name(int(model.actuator_trnid[n, 0]))]
            if joint.kind not in (SLIDE, HINGE):
                joint.left_out.append(f'actuator {name!r}')
                continue
            joint.actuators.append(name)
            gear = float(model.actuator_gear[n, 0])
            if gear < 0.0:
                self._remark(f'{joint.name}: the gear of its actuator is negative: '
                             'forces are along its joint here')
            bounds.setdefault(joint.name, []).append(self._largest_force(n, joint))
            for key in ('armature', 'damping'):
                setattr(joint, key, getattr(joint, key) + gear ** 2 * self._number(
                    f'actuator_{key}', n))
        for n in range(model.njnt):
            joint = self._joints[self._joint_name(n)]
            if joint.kind not in (SLIDE, HINGE):
                continue
            together = [sum(bounds.get(joint.name, [math.inf]))]
            if model.jnt_actfrclimited[n]:
                together.append(joint.symmetric(
                    'force_max', 'actuatorfrcrange', *model.jnt_actfrcrange[n]))
            if min(together) < math.inf:
                joint.force_max = min(together)
                joint.without.discard('force_max')
        self.mechanism.order = tuple(bounds)

    def _largest_force(self, n: int, joint: Joint) -> float:
        """Return the largest force of an actuator, both ways; infinity without one."""
        model, mujoco = self._model, self._mujoco
        gear, gain = (abs(float(each[n, 0])) for each in (
            model.actuator_gear, model.actuator_gainprm))
        found = [math.inf]
        if model.actuator_forcelimited[n]:
            found.append(gear * joint.symmetric(
                'force_max', 'forcerange', *model.actuator_forcerange[n]))
        of_forces = (int(model.actuator_biastype[n]) == int(mujoco.mjtBias.mjBIAS_NONE)
                     and int(model.actuator_dyntype[n]) != int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
                     and gain > 0.0)
        if model.actuator_ctrllimited[n] and of_forces and not self._is_off('CLAMPCTRL'):
            found.append(gear * gain * joint.symmetric(
                'force_max', 'ctrlrange', *model.actuator_ctrlrange[n]))
        return min(found)
