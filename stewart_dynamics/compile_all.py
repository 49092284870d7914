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

"""
Compiles what the package compiles, so that no later start waits: ``stewart_dynamics --compile``.

For the installation of the package, and for containers: the machine code is kept beside it.
"""

from __future__ import annotations

from importlib import import_module
import time

from stewart_dynamics.compilation.functions import EntryPoint, prepare
from stewart_dynamics.compilation.machine_code import folder_to_write, HINT

MODULES = (
    'mechanics.dynamics.inverse_dynamics', 'mechanics.dynamics.forward_dynamics',
    'mechanics.dynamics.base_wrench', 'mechanics.dynamics.friction',
    'mechanics.dynamics.regressor', 'mechanics.kinematics.forward_kinematics',
    'mechanics.kinematics.joint_angles', 'simulator.plant_dynamics', 'setpoints.step',
    'external_wrench.estimate', 'bags.blocks', 'bags.mcap_scan', 'capability.travel')
"""Those with functions that Python calls."""


def compile_all() -> int:
    """Compile what is not on disk, print what was done, and return the exit code."""
    if HINT:
        print(f'stewart_dynamics: nothing is compiled: {HINT}')
        return 1
    begun = time.monotonic()
    functions = [each for name in MODULES for each in vars(
        import_module(f'stewart_dynamics.{name}')).values() if isinstance(each, EntryPoint)]
    missing = [each for each in functions if not each.load()]
    prepare(missing)
    print(f'stewart_dynamics: {len(functions)} functions are compiled, {len(missing)} of them now '
          f'in {time.monotonic() - begun:.0f} s; their machine code is in {folder_to_write()}')
    return 0 if all(each.compiled for each in functions) else 1
