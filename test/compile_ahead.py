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
A program that has numba keep the machine code of the package: ``python compile_ahead.py``.

It starts itself once for each part, all at a time. ``make environment`` runs it, and the tests do
before several processes need the code.
"""

from __future__ import annotations

from contextlib import suppress
import subprocess
import sys
from tempfile import TemporaryDirectory

import numpy as np
from referees import ROOT

from stewart_dynamics import Motion, StewartError, StewartPlatform
from stewart_dynamics.arrays import NO_WRENCH
from stewart_dynamics.parameter_files import read_yaml
from stewart_dynamics.replay import main
from stewart_dynamics.runtime.external_wrench import ExternalWrench, Measurement
from stewart_dynamics.runtime.plant import Plant
from stewart_dynamics.runtime.simulator_parameters import SimulatorParameters

PLATFORM = ROOT / 'config' / 'platform.yaml'
SIMULATOR = ROOT / 'config' / 'simulator.yaml'


def step() -> None:
    """Compile what a replay calls."""
    with TemporaryDirectory() as folder:
        assert main([str(ROOT / 'bags' / 'clear'), '--params', str(PLATFORM), '--output', folder,
                     '--no-report']) == 0


def plant() -> None:
    """Compile the plant."""
    Plant(SimulatorParameters({
        **read_yaml(PLATFORM, 'stewart_simulator'), **read_yaml(SIMULATOR, 'stewart_simulator')},
    )).advance(NO_WRENCH, NO_WRENCH)


def library() -> None:
    """Compile what the library calls, and the external wrench."""
    platform = StewartPlatform.from_yaml(PLATFORM)
    home = Motion([0.0, 0.0, 1.1], np.eye(3))
    result = platform.inverse_dynamics(home)
    platform.forward_kinematics(result.lengths, home)
    platform.twist(home, result.rates)
    platform.forward_dynamics(home, result.forces)
    with suppress(StewartError):  # no legs have such lengths
        ExternalWrench(platform.parameters)(
            Measurement(0, NO_WRENCH, NO_WRENCH, NO_WRENCH), None, NO_WRENCH, None)


PARTS = {'step': step, 'plant': plant, 'library': library}

if __name__ == '__main__':
    if sys.argv[1:]:
        PARTS[sys.argv[1]]()
    else:
        programs = [subprocess.Popen([sys.executable, __file__, part], stdin=subprocess.DEVNULL,
                                     stdout=subprocess.DEVNULL) for part in PARTS]
        codes = [program.wait() for program in programs]
        sys.exit(any(codes))
