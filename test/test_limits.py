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

"""The limits of the legs: one rule for a row, a sample and an array, and its tolerance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
import pytest
from referees import rng, symmetric_parameters

from stewart_dynamics.mechanics.limits import (
    ANGLES, any_exceeded, BASE_ANGLE_MAX, CLEARANCE_MIN, Exceedance, FORCE_MAX, LENGTH_MAX,
    LENGTH_MIN, LIMITS,
    Limits, OF_JOINTS, OF_RESULTS, PLATFORM_ANGLE_MAX, TOLERANCE, VELOCITY_MAX)
from stewart_dynamics.mechanics.rows import FORCES, LENGTHS, RATES, RESULT

GIVEN = {LENGTH_MIN: [0.9, 0.91, 0.92, 0.93, 0.94, 0.95], LENGTH_MAX: 1.5, VELOCITY_MAX: 0.5,
         FORCE_MAX: 6000.0, BASE_ANGLE_MAX: 0.5,
         PLATFORM_ANGLE_MAX: [0.3, 0.4, 0.5, 0.6, 0.7, 0.8]}
PLACES = {LENGTH_MIN: LENGTHS, LENGTH_MAX: LENGTHS, VELOCITY_MAX: RATES, FORCE_MAX: FORCES}


def row() -> NDArray[np.float64]:
    """Return a result within all limits of GIVEN."""
    result = np.zeros(RESULT)
    result[LENGTHS] = 1.2
    return result


@pytest.mark.parametrize('limit', OF_RESULTS)
@pytest.mark.parametrize('leg', range(6))
def test_row_sample_and_array_agree_on_each_limit_of_each_leg(limit: str, leg: int) -> None:
    limits = Limits(symmetric_parameters().replaced(GIVEN))
    bound = float(limits.bounds[limit][leg])
    outward = -1.0 if limit == LENGTH_MIN else 1.0
    signs = (1.0, -1.0) if limit in (VELOCITY_MAX, FORCE_MAX) else (1.0,)
    for excess, exceeded in ((0.0, False), (0.5 * TOLERANCE, False), (-0.01, False),
                             (2.0 * TOLERANCE, True), (0.1, True)):
        for sign in signs:
            result = row()
            result[PLACES[limit].start + leg] = value = sign * bound * (1.0 + excess * outward)
            assert any_exceeded(limits.thresholds[:4].ravel(), result) == (
                exceeded and limit != FORCE_MAX, exceeded and limit == FORCE_MAX)
            for other in OF_RESULTS:
                expected = [exceeded and other == limit and n == leg for n in range(6)]
                assert limits.exceeds(other, result[PLACES[other]]).tolist() == expected
            of_sample = (tuple(result[at].tolist()) for at in (LENGTHS, RATES, FORCES))
            assert limits.exceeded(*of_sample) == (
                (Exceedance(limit, leg, value, bound),) if exceeded else ())


@pytest.mark.parametrize('limit', OF_JOINTS)
@pytest.mark.parametrize('leg', range(6))
def test_sample_and_array_agree_on_the_angle_of_each_joint(limit: str, leg: int) -> None:
    limits = Limits(symmetric_parameters().replaced(GIVEN))
    bound = float(limits.bounds[limit][leg])
    for excess, exceeded in ((0.0, False), (0.5 * TOLERANCE, False), (-0.01, False),
                             (2.0 * TOLERANCE, True), (0.1, True)):
        angles = np.zeros(12)
        angles[ANGLES[limit].start + leg] = value = bound * (1.0 + excess)
        for other in OF_JOINTS:
            expected = [exceeded and other == limit and n == leg for n in range(6)]
            assert limits.exceeds(other, angles[ANGLES[other]]).tolist() == expected
        assert limits.exceeded_angles(tuple(angles.tolist())) == (
            (Exceedance(limit, leg, value, bound),) if exceeded else ())


def test_a_limit_that_is_not_given_is_never_exceeded() -> None:
    limits = Limits(symmetric_parameters())
    huge = rng().choice([-1e300, 1e300], (5, 6))
    assert not any(limits.exceeds(limit, huge).any() for limit in LIMITS)
    assert limits.exceeded((1e300,) * 6, (-1e300,) * 6, (1e300,) * 6) == ()
    assert limits.exceeded_angles((3.14,) * 12) == ()
    assert np.isinf(limits.force_max).all() and not limits.bounds


def test_unknown_forces_exceed_no_limit() -> None:
    limits = Limits(symmetric_parameters().replaced({FORCE_MAX: 1.0}))
    result = row()
    result[FORCES] = np.nan
    assert any_exceeded(limits.thresholds[:4].ravel(), result) == (False, False)
    assert limits.exceeded((1.2,) * 6, (0.0,) * 6, None) == ()


@pytest.mark.parametrize(('exceedance', 'words'), [
    (Exceedance(LENGTH_MIN, 0, 0.9, 0.95), 'a: length 0.9 m is 0.05 m below limits.length_min'),
    (Exceedance(PLATFORM_ANGLE_MAX, 2, 0.75, 0.5),
     'c: platform joint angle 0.75 rad is 0.25 rad above limits.platform_joint_angle_max'),
    (Exceedance(CLEARANCE_MIN, 3, -0.25, 0.5),
     'd: clearance -0.25 m is 0.75 m below limits.leg_clearance_min'),
    (Exceedance(LENGTH_MAX, 1, 1.75, 1.5), 'b: length 1.75 m is 0.25 m above limits.length_max'),
    (Exceedance(VELOCITY_MAX, 2, -0.75, 0.5),
     'c: rate -0.75 m/s is 0.25 m/s above limits.velocity_max'),
    (Exceedance(FORCE_MAX, 5, -7000.0, 6000.0),
     'f: force -7000 N is 1000 N above limits.force_max')])
def test_the_text_says_which_leg_and_by_how_much(exceedance: Exceedance, words: str) -> None:
    assert exceedance.words('abcdef') == words
