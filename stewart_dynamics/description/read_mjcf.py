# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""MJCF as a mechanism, by MuJoCo's own loader: defaults, includes and masses of shapes are its."""

from __future__ import annotations

from pathlib import Path
import subprocess
import sys
import tempfile
from typing import Any

import numpy as np

from stewart_dynamics.description.mechanism import (
    BALL, DescriptionError, FIXED, HINGE, Joint, Mechanism, MechanismBody, OTHER, Placement, SLIDE,
    WORLD)
from stewart_dynamics.description.xml_text import CARRIED
from stewart_dynamics.errors import one_line
from stewart_dynamics.mechanics.frames.rotation import from_quaternion

_TIME = 30  # [s]
_WAIT = 4 * _TIME
_MEMORY = 8 << 30  # of addresses; libraries reserve some without using them [bytes]
_LOAD = """
import resource, sys
source, model, time, memory = sys.argv[1:]
for kind, most in ((resource.RLIMIT_CPU, int(time)), (resource.RLIMIT_AS, int(memory))):
    _, hard = resource.getrlimit(kind)
    resource.setrlimit(kind, (most if hard < 0 else min(most, hard), hard))
import mujoco
try:
    mujoco.mj_saveModel(mujoco.MjModel.from_xml_path(source), model)
except MemoryError:
    sys.exit(2)
except Exception as exc:
    sys.exit(str(exc))
"""
_PREFIX = f'{CARRIED}.'


def read_mjcf(source: Path) -> Mechanism:
    """Return the mechanism of an MJCF; DescriptionError where MuJoCo rejects it."""
    try:
        import mujoco
    except ModuleNotFoundError as exc:
        raise DescriptionError(
            f"{source}: MJCF is read by mujoco: pip install 'stewart_dynamics[mujoco]'") from exc
    model = _loaded(mujoco, source)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mechanism = Mechanism(str(source), source.stem, _parts(model, data), [],
                          gravity=np.array(model.opt.gravity))
    for body in range(1, model.nbody):
        _joints_of(mujoco, model, data, body, mechanism)
    for n in range(model.neq):
        _loop(mujoco, model, data, n, mechanism)
    _actuators(mujoco, model, mechanism)
    for n in range(model.ntext):
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_TEXT, n) or ''
        at = model.text_adr[n]
        if name.startswith(_PREFIX):
            text = bytes(model.text_data[at:at + model.text_size[n]])
            mechanism.carried[name.removeprefix(_PREFIX)] = text.rstrip(b'\0').decode()
    return mechanism


def _loaded(mujoco: Any, source: Path) -> Any:
    """
    Return the model that MuJoCo's loader, in a process of its own, makes of a file.

    A file can make the loader repeat a body a billion times or read a device; warnings go to a
    MUJOCO_LOG.TXT in its working folder.
    """
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / 'model.mjb'
        try:
            ended = subprocess.run(
                [sys.executable, '-c', _LOAD, source.absolute(), model, str(_TIME), str(_MEMORY)],
                cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, timeout=_WAIT,
                check=False)
        except subprocess.TimeoutExpired as exc:
            raise DescriptionError(f'{source}: MuJoCo: not loaded within {_WAIT} s') from exc
        if ended.returncode == 1:
            why = one_line(ended.stderr.decode('utf-8', 'replace'))
            raise DescriptionError(f'{source}: MuJoCo: {why}')
        if ended.returncode:
            raise DescriptionError(
                f'{source}: MuJoCo: not loaded within {_TIME} s of processor time and '
                f'{_MEMORY >> 30} GiB (exit code {ended.returncode})')
        return mujoco.MjModel.from_binary_path(str(model))


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
            turn @ np.diag(model.body_inertia[body]) @ turn.T)
    return parts


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
        made = Joint(model.joint(n).name or f'{name}_joint_{n - first + 1}', kind, parent, child,
                     data.xanchor[n].copy(), [data.xaxis[n].copy()])
        dof = model.jnt_dofadr[n]
        made.damping, made.friction = float(model.dof_damping[dof].item()), float(
            model.dof_frictionloss[dof].item())
        made.armature = float(model.dof_armature[dof].item())
        if kind == SLIDE:
            made.position = float(model.qpos0[model.jnt_qposadr[n]])
            if model.jnt_limited[n]:
                made.lower, made.upper = map(float, model.jnt_range[n])
        mechanism.joints.append(made)
        parent = child


def _loop(mujoco: Any, model: Any, data: Any, n: int, mechanism: Mechanism) -> None:
    """Add the joint of a constraint, if it is one."""
    kind = {int(mujoco.mjtEq.mjEQ_CONNECT): BALL, int(mujoco.mjtEq.mjEQ_WELD): FIXED}.get(
        int(model.eq_type[n]))
    if kind is None:
        return
    first, second = int(model.eq_obj1id[n]), int(model.eq_obj2id[n])
    name = model.equality(n).name or f'{kind} {n + 1}'
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


def _actuators(mujoco: Any, model: Any, mechanism: Mechanism) -> None:
    """Take the order of the legs, and the largest forces of motors."""
    slides = {joint.name: joint for joint in mechanism.joints if joint.kind == SLIDE}
    order = []
    for n in range(model.nu):
        if model.actuator_trntype[n] != mujoco.mjtTrn.mjTRN_JOINT:
            continue
        joint = slides.get(model.joint(int(model.actuator_trnid[n, 0])).name)
        if joint is None:
            continue
        order.append(joint.name)
        gear = abs(float(model.actuator_gear[n, 0]))
        if model.actuator_gear[n, 0] < 0.0:
            mechanism.remarks.append(f'{joint.name}: the gear of its actuator is negative: '
                                     'forces are along its joint here')
        bounds = []
        if model.actuator_forcelimited[n]:
            bounds.append(gear * np.abs(model.actuator_forcerange[n]).min())
        if (model.actuator_ctrllimited[n]
                and model.actuator_biastype[n] == mujoco.mjtBias.mjBIAS_NONE):
            gain = abs(float(model.actuator_gainprm[n, 0]))
            bounds.append(gear * gain * np.abs(model.actuator_ctrlrange[n]).min())
        if bounds and min(bounds) > 0.0:
            joint.force_max = float(min(bounds))
    mechanism.order = tuple(dict.fromkeys(order))
