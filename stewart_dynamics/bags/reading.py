# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""How recordings of other sources are read: frames, axes, order of angles."""

from __future__ import annotations

import argparse
from typing import NamedTuple

from stewart_dynamics.program import AXES


class Reading(NamedTuple):
    """Options for recordings of other sources."""

    child: str | None = None
    """child_frame_id of the platform in TFMessage; None: platform_frame."""
    euler: str | None = None
    """One of EULER; None: xyz for roll pitch yaw, XYZ for u v w."""
    axes: str = AXES
    """The axes of the source that are x, y and z of the base frame, as x,-y,z."""

    @classmethod
    def given(cls, arguments: argparse.Namespace) -> Reading:
        """Return the options that ``program.add_reading`` has added."""
        return cls(arguments.child, arguments.euler, arguments.axes)
