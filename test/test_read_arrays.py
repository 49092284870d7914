# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Recordings as arrays and tables, and the notebook that draws one."""

from __future__ import annotations

from pathlib import Path
import subprocess
import sys

import numpy as np
import pytest
from recorded import fourier, recorded, write_bag
from referees import ROOT
from snapshot import Snapshot

from stewart_dynamics import (
    BagError, Parameters, read_legs, read_setpoints, StewartError, StewartPlatform)
from stewart_dynamics.reference_motion.motion_functions import motion_at, sample_times
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters

PROGRAM = 'stewart_replay'

PARAMS = ROOT / 'config' / 'platform.yaml'
PARAMETERS = Parameters.from_yaml(PARAMS)
CLEAR = ROOT / 'bags' / 'clear'


def test_setpoints_of_a_bag_are_those_that_were_recorded() -> None:
    motion = ReferenceMotionParameters.from_yaml(ROOT / 'config' / 'trajectory_clear.yaml')
    wanted = motion_at(motion, sample_times(motion) * 1e-9)
    for parameters in (None, PARAMETERS, StewartPlatform(PARAMETERS)):
        found = read_setpoints(str(CLEAR), parameters)
        np.testing.assert_allclose(found.motion.rows, wanted.rows, atol=1e-9)
        assert found.times[0] == 0.0 and found.missing == ()
        assert len(found.times) == len(found.stamps) == len(found.wrench) == len(wanted)


def test_legs_of_a_bag_are_those_that_were_recorded(tmp_path: Path, snapshot: Snapshot) -> None:
    given = recorded(PARAMETERS, fourier(1), 2.0, 100.0, 1, forces=np.ones((200, 6)))
    bag = write_bag(tmp_path / 'bag', given, PARAMETERS['joints'])
    for joints in (None, PARAMETERS, PARAMETERS['joints']):
        found = read_legs(bag, joints)
        np.testing.assert_allclose(found.times, given.times, atol=1e-9)
        np.testing.assert_array_equal(found.positions, given.positions)
        np.testing.assert_array_equal(found.velocities, given.rates)
        np.testing.assert_array_equal(found.efforts, given.efforts)
    with snapshot.raises(BagError):
        read_legs(bag, ('a', *PARAMETERS['joints'][1:]))
    with snapshot.raises(BagError):
        read_legs(bag, topic='/legs')


@pytest.mark.parametrize('options', [
    {'euler': 'rpy'},
    {'axes': 'x,y'},
    {'topics': {'position': '/a'}},
    {'topics': {'pose': '/a'}},
    {'cutoff': -1.0}])
def test_options_that_break_a_rule_are_named(
        options: dict[str, object], snapshot: Snapshot) -> None:
    with snapshot.raises(StewartError):
        read_setpoints(CLEAR, **options)  # type: ignore[arg-type]


def test_tables_have_the_numbers_of_the_arrays() -> None:
    pytest.importorskip('pandas')
    found = read_setpoints(CLEAR)
    result = StewartPlatform(PARAMETERS).inverse_dynamics(found.motion)
    table = result.to_dataframe()
    assert list(table) == list(result.to_dict())
    np.testing.assert_array_equal(table['force_3'], result.forces[:, 2])
    table = found.to_dataframe()
    np.testing.assert_array_equal(table['alz'], found.motion.angular_acceleration[:, 2])


def test_arrays_are_read_without_ros() -> None:
    code = ('import sys, stewart_dynamics as s; assert "rosbags" not in sys.modules; '
            f's.read_setpoints({str(CLEAR)!r}); assert "rclpy" not in sys.modules')
    subprocess.run([sys.executable, '-c', code], check=True, cwd=ROOT)
