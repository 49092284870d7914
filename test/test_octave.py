# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The exported C source in Octave, as a MEX function: the bits of the library."""

from __future__ import annotations

from pathlib import Path
import shutil
import subprocess

import numpy as np
from programs import call, run_program
import pytest
from referees import ROOT
from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.export import main

pytestmark = pytest.mark.skipif(
    not shutil.which('octave-cli') or not shutil.which('mkoctfile'), reason='needs Octave')


def test_a_driver_gets_in(tmp_path: Path) -> None:
    file = ROOT / 'config' / 'platform.yaml'
    for each in (ROOT / 'demo' / 'octave').iterdir():
        shutil.copy(each, tmp_path)
    call(main, '--params', file, '--output', tmp_path / 'exported')
    subprocess.run([
        'mkoctfile', '--mex', '-DHEXAPOD=hexapod', '-Iexported',
        'stewart_forces.c', 'exported/hexapod.c', 'exported/stewart_dynamics.c'],
        cwd=tmp_path, check=True, capture_output=True)
    done = run_program('octave-cli', '--quiet', 'driver_gets_in.m', folder=tmp_path)
    lengths, empty, laden, codes = (
        [float(each) for each in line.split()] for line in done.stdout.splitlines())
    parameters = Parameters.from_yaml(file)
    with_driver = parameters.replaced({
        'payload.mass': 82.0, 'payload.center_of_mass': [0.1, -0.2, 0.6],
        'payload.inertia': [9.0, 0.1, 0.2, 8.0, -0.3, 3.0]})
    home = Motion([0.0, 0.0, 1.1], np.eye(3))
    for p, forces in ((parameters, empty), (with_driver, laden)):
        result = StewartPlatform(p).inverse_dynamics(home)
        assert forces == result.forces.tolist()
        assert lengths == result.lengths.tolist()
    assert codes == [0.0, 0.0]
    wrong = run_program('octave-cli', '--quiet', '--eval',
                        'stewart_forces([0, 0], eye(3), [], [])', code=1, folder=tmp_path)
    assert 'position: must be 3 real doubles' in wrong.err
