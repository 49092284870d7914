#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

# The gravity compensation of reachy-mini gives the six motors of the head 3 to 13 % less than they
# need at home, and a torque about the vertical axis of the body, where there is none. It takes the
# torques of the tree of joints for those of a wrench on the head, by a pseudo-inverse: exact for
# cranks and rods without mass alone. Virtual work with its own matrices, the last lines below, holds
# the robot: torques of the passive joints count as well. Their class, Placo, their model.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/python -m pip install --quiet --disable-pip-version-check --no-deps reachy-mini==1.13.0 \
  placo==0.9.14 pin==3.4.0 coal-library==3.0.1 eigenpy==3.10.3 cmeel==0.62.0 cmeel-boost==1.87.0.1 \
  cmeel-assimp==5.4.3.1 cmeel-octomap==1.10.0 cmeel-qhull==8.0.2.1 cmeel-urdfdom==4.0.1 \
  cmeel-tinyxml2==10.0.0 cmeel-console-bridge==1.0.2.3 cmeel-zlib==1.3.2 eiquadprog==1.2.9 \
  rhoban-cmeel-jsoncpp==1.9.4.9 ischedule==1.2.7 numpy==2.3.5 scipy==1.16.3 2>&1 |
  grep -v '^WARNING' || true
cat > torques.py <<'PY'
from importlib.metadata import version
from pathlib import Path
import sys
from types import ModuleType
from xml.etree import ElementTree

import numpy as np

# Their module without what the package around it imports: network, cameras, sound.
package = next(Path(each) / 'reachy_mini' for each in sys.path
               if (Path(each) / 'reachy_mini').is_dir())
for name in ('reachy_mini', 'reachy_mini.kinematics', 'reachy_mini.utils'):
    sys.modules[name] = ModuleType(name)
    sys.modules[name].__path__ = [str(package.joinpath(*name.split('.')[1:]))]
from reachy_mini.kinematics import placo_kinematics as module

# Their model without shapes, which have no weight of their own.
tree = ElementTree.parse(package / 'descriptions' / 'reachy_mini' / 'urdf' / 'robot.urdf')
for link in tree.getroot().iter('link'):
    for shape in [*link.findall('visual'), *link.findall('collision')]:
        link.remove(shape)
tree.write('robot.urdf')

head = module.PlacoKinematics('robot.urdf')
head.fk(head.ik(np.eye(4), no_iterations=60), no_iterations=60)
theirs = head.compute_gravity_torque()

robot = head.robot
tree_torques = np.concatenate([np.zeros(6), list(
    robot.static_gravity_compensation_torques_dict('body_foot_3dprint').values())])
gaps = np.vstack([robot.relative_position_jacobian(f'closing_{n}_1', f'closing_{n}_2')
                  for n in range(1, 6)])
moved = -np.linalg.inv(gaps[:, head.passives_idx]) @ gaps[:, head.actives_idx]
holding = (tree_torques[head.actives_idx] + moved.T @ tree_torques[head.passives_idx])[
    head.actuated_idx_in_active]

print('reachy-mini', version('reachy-mini'), 'placo', version('placo'))
print('theirs [mN m]:      ', *(f'{1e3 * each + 0.0:.1f}' for each in theirs))
print('virtual work [mN m]:', *(f'{1e3 * each:.1f}'.replace('-0.0', '0.0') for each in holding))
print('missing [%]:             ', *(f'{100.0 * (1.0 - each):.1f}'
                                     for each in theirs[1:] / holding[1:]))
PY
venv/bin/python torques.py | tee found
diff - found <<'SEEN'
reachy-mini 1.13.0 placo 0.9.14
theirs [mN m]:       -0.2 18.8 -18.9 20.0 -19.3 21.5 -22.9
virtual work [mN m]: 0.0 21.1 -21.4 22.6 -22.1 23.4 -23.6
missing [%]:              11.2 11.6 11.4 12.5 8.1 3.3
SEEN
