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

"""How short steps must be: a bound that holds in every pose, and rejections."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from referees import rng, rotation_about, size_of
from simulated import random_simulated, simulated

from stewart_dynamics import ParameterError, Pose, StewartPlatform
from stewart_dynamics.simulator.plant import largest_eigenvalue, substeps


@pytest.mark.parametrize('seed', range(20))
def test_the_bound_of_stiffness_holds_in_every_pose(seed: int) -> None:
    random = rng(seed)
    reflected = random.uniform(0.0, 30.0, 6) * (seed % 2)
    p = random_simulated(seed, actuator__reflected_mass=reflected.tolist())
    platform = StewartPlatform(p)
    for kind in range(3):
        has = random.uniform(0.0, 1e5, 6) * (random.uniform(size=6) < (1.0, 0.5, 0.2)[kind])
        bound = largest_eigenvalue(p, has)
        worst = 0.0
        for _ in range(50):
            position = size_of(p) * random.uniform([-1, -1, 0.2], [1, 1, 2], 3)
            turn = rotation_about(np.array([0.6, 0.0, 0.8]), random.uniform(-1.0, 1.0))
            pose = Pose(position, turn)
            jacobian = platform.inverse_jacobian(pose)
            mobility = jacobian @ np.linalg.solve(platform.mass_matrix(pose), jacobian.T)
            root = np.sqrt(has)
            worst = max(worst, float(np.linalg.eigvalsh(root[:, None] * mobility * root)[-1]))
        assert worst <= bound * (1.0 + 1e-12)
        assert bound == 0.0 or worst > 0.05 * bound  # not for nothing


@pytest.mark.parametrize(('changes', 'named'), [
    ({'actuator.coulomb_friction': 1e8}, 'actuator.coulomb_friction'),
    ({'actuator.coulomb_velocity': 1e-12},
     r'actuator.coulomb_friction: \[20.0, .* within actuator.coulomb_velocity \[1e-12, '),
    ({'actuator.viscous_friction': 1e12}, 'actuator.viscous_friction'),
    ({'actuator.viscous_friction': 1e308}, 'actuator.viscous_friction'),
    ({'end_stops.frequency': 1e6}, 'end_stops.frequency'),
    ({'end_stops.frequency': 1e6, 'end_stops.damping_ratio': 1.5}, 'end_stops.damping_ratio'),
    ({'end_stops.damping_ratio': 1e7}, 'end_stops.damping_ratio')], ids=str)
def test_what_would_need_too_short_steps_is_rejected_by_name(
        changes: dict[str, Any], named: str) -> None:
    with pytest.raises(ParameterError, match=f'^{named}.* too large for a platform of 150 kg'):
        substeps(simulated(actuator__reflected_mass=0.0, **changes))


def test_steps_are_in_proportion_to_the_velocity_of_coulomb_friction() -> None:
    coarse, fine = (substeps(simulated(actuator__coulomb_velocity=velocity,
                                       actuator__reflected_mass=0.0))
                    for velocity in (1e-4, 1e-5))
    assert coarse > 1
    assert 9.5 < fine / coarse < 10.5
