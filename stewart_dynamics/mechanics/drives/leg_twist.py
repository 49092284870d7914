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
The twist of a leg between its two universal joints, with its derivatives.

Each universal joint turns about an axis u that is fixed to the base, or w = R w_P that is fixed to
the platform, and about an axis across the leg and across the first: the latter axes, along
``u x s`` and ``w x s``, are fixed to the cylinder and to the piston. The angle from one to the
other about s, right-handed, is the turn of the piston against the cylinder:

    twist = atan2(y, x)    y = s . (u x w)    x = u . w - (u . s)(w . s)

y and x are sine and cosine times ``|u x s| |w x s|``; where x is positive, the twist is the
arcsine of the product of the unit vectors along s x (u x s) and w x s.
"""

from __future__ import annotations

import math

from stewart_dynamics.compilation.functions import inlined
from stewart_dynamics.mechanics.vectors import add, cross, dot, Vector3


@inlined
def leg_twist(u: Vector3, w: Vector3, w_rate: Vector3, w_acc: Vector3, s: Vector3,
              s_rate: Vector3, s_acc: Vector3) -> tuple[float, float, float]:
    """Return the twist of a leg [rad], its rate and its acceleration; base axes."""
    u_s, u_s_rate, u_s_acc = dot(u, s), dot(u, s_rate), dot(u, s_acc)
    w_s, w_s_rate = dot(w, s), dot(w_rate, s) + dot(w, s_rate)
    w_s_acc = dot(w_acc, s) + 2.0 * dot(w_rate, s_rate) + dot(w, s_acc)
    normal, normal_rate, normal_acc = cross(u, w), cross(u, w_rate), cross(u, w_acc)
    y = dot(s, normal)
    y_rate = dot(s_rate, normal) + dot(s, normal_rate)
    y_acc = dot(s_acc, normal) + 2.0 * dot(s_rate, normal_rate) + dot(s, normal_acc)
    x = dot(u, w) - u_s * w_s
    x_rate = dot(u, w_rate) - u_s_rate * w_s - u_s * w_s_rate
    x_acc = dot(u, w_acc) - u_s_acc * w_s - 2.0 * u_s_rate * w_s_rate - u_s * w_s_acc
    square = x * x + y * y
    inverse = 1.0 / square if square > 0.0 else math.nan
    rate = (x * y_rate - y * x_rate) * inverse
    return math.atan2(y, x), rate, (
        x * y_acc - y * x_acc - 2.0 * (x * x_rate + y * y_rate) * rate) * inverse


@inlined
def turned(w: Vector3, omega: Vector3, alpha: Vector3) -> tuple[Vector3, Vector3]:
    """Return first and second derivative of a vector that turns with the platform."""
    rate = cross(omega, w)
    return rate, add(cross(alpha, w), cross(omega, rate))
