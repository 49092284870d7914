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


"""Likely mistakes in ``drive.*``: each is reported once, and good drives are not."""

from __future__ import annotations

import math
from typing import Any

import pytest
from referees import ROOT
from stewart_dynamics import Parameters

# 10 mm ball screw, belt 2 : 1, a servo motor of 400 W.
GOOD: dict[str, Any] = {
    'actuator.reflected_mass': None, 'actuator.screw_lead': 0.01, 'drive.gear_ratio': 2.0,
    'drive.motor_inertia': 3e-5, 'drive.screw_inertia': 6e-5, 'drive.efficiency': 0.9,
    'drive.torque_max': 6.0, 'drive.torque_continuous': 2.0, 'drive.speed_max': 700.0,
    'drive.torque_speed': [0.0, 6.0, 500.0, 6.0, 700.0, 4.0]}
HEXAPOD = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')


def mistakes(**changes: Any) -> tuple[str, ...]:
    from stewart_dynamics import StewartPlatform
    return StewartPlatform(HEXAPOD.replaced({**GOOD, **{
        name.replace('__', '.'): value for name, value in changes.items()}})).check()


def test_a_good_drive_gives_no_warning() -> None:
    assert mistakes() == ()
    assert mistakes(limits__velocity_max=None, limits__force_max=None) == ()
    assert mistakes(drive__speed_max=None, drive__torque_speed=None) == ()
    assert mistakes(drive__torque_max=None, drive__torque_continuous=None) == ()
    assert mistakes(drive__gear_ratio=1.0, actuator__screw_lead=0.005) == ()
    # the published machine: 8.2 N m, lead 5 mm, 3 : 1, for a slower and heavier hexapod
    assert mistakes(drive__gear_ratio=3.0, actuator__screw_lead=0.005, drive__torque_max=8.2,
                    drive__motor_inertia=1.37e-4, drive__torque_speed=None,
                    limits__velocity_max=0.16, limits__force_max=25e3) == ()


@pytest.mark.parametrize(('changes', 'begin', 'end'), [
    ({'actuator__screw_lead': 10.0}, 'actuator.screw_lead: 10 m for one turn', 'in mm?'),
    ({'actuator__screw_lead': 0.01 / (2.0 * math.pi)},
     'actuator.screw_lead: 0.00159155 m: the motors can push ', 'It is that of one turn'),
    ({'drive__gear_ratio': 0.5}, 'drive.gear_ratio: 0.5: the motors can push ',
     'in one turn of the screw'),
    ({'drive__gear_ratio': 1.0 / 3.0, 'actuator__screw_lead': 0.005, 'drive__torque_max': 8.2,
      'drive__torque_speed': None, 'limits__velocity_max': 0.16, 'limits__force_max': 25e3},
     'drive.gear_ratio: 0.333333: the motors can push ', 'in one turn of the screw'),
    ({'drive__motor_inertia': 0.3}, 'drive.motor_inertia: 0.3 kg m^2 reaches', 'at the screw?'),
    ({'drive__motor_inertia': None}, 'drive.motor_inertia: missing', 'without inertia'),
    ({'drive__screw_inertia': 0.6}, 'drive.screw_inertia: 0.6 kg m^2 is 0.15 kg m^2 at the motor',
     'at another shaft?'),
    ({'drive__speed_max': 6700.0}, 'drive.speed_max: 6700 rad/s, 63980 rpm', 'in rpm?'),
    ({'drive__torque_speed': [0.0, 6.0, 6700.0, 4.0]}, 'drive.torque_speed: 6700', 'in rpm?'),
    ({'drive__torque_max': 0.06, 'drive__torque_continuous': None, 'drive__torque_speed': None,
      'drive__motor_inertia': 3e-7, 'drive__screw_inertia': 0.0, 'limits__force_max': None},
     'drive.torque_max: 0.06 N m', 'less than a sixth of the weight'),
])
def test_a_mistake_is_reported(changes: dict[str, Any], begin: str, end: str) -> None:
    found = mistakes(**changes)
    about = [line for line in found if line.startswith(begin)]
    assert about, found
    assert about[0].endswith(end) and all(len(line) < 400 for line in found)
