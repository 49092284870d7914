# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""How recordings of other sources are read: frames, axes, order of angles, names of columns."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from stewart_dynamics.program import AXES

# Suffixes of the files that are read as tables.
TABLES = ('.csv', '.tsv', '.txt')


def is_table(path: Path) -> bool:
    """Return whether a file is a table, by its name."""
    return path.suffix.lower() in TABLES


class Reading(NamedTuple):
    """Options for recordings of other sources."""

    child: str | None = None
    """
    child_frame_id of the platform in TFMessage; None: platform_frame. Or its body in a file of a
    tracker; None: the only one.
    """
    euler: str | None = None
    """One of EULER; None: that of the source, else xyz for roll pitch yaw, XYZ for u v w."""
    axes: str | None = None
    """
    The axes of the source that are x, y and z of the base frame, as x,-y,z; None: those of the
    source if they are known, else x,y,z.
    """
    columns: Mapping[str, str] = {}
    """Headings of the columns of a table, by the names in the table of quantities."""

    @classmethod
    def given(cls, arguments: argparse.Namespace) -> Reading:
        """Return the options that ``program.add_reading`` has added."""
        return cls(arguments.child, arguments.euler, arguments.axes, arguments.columns)

    def arguments(self) -> list[str]:
        """Return the options of a command line that give this."""
        columns = ','.join(f'{name}={heading}' for name, heading in self.columns.items())
        return [f'--{name}={value}' for name, value in (
            *((name, getattr(self, name)) for name in ('child', 'euler', 'axes')),
            ('columns', columns)) if value]

    @property
    def axes_of_bag(self) -> str:
        """Return the axes of messages, which do not name any."""
        return self.axes or AXES
