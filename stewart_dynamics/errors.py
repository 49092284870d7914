# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The errors of the package; their texts name the parameter or argument, value and rule."""

from __future__ import annotations

from typing import Any

_LONGEST, _LONGEST_LINE = 80, 4000


def one_line(exc: object) -> str:
    """Return an error in one line of limited length: its text, or its type if that is empty."""
    text = f'{exc}'
    if len(text) > _LONGEST_LINE:  # texts of a file can have any length
        text = f'{text:.{_LONGEST_LINE}}...'
    return ' '.join(text.split()) or type(exc).__name__


def shown(value: Any) -> str:
    """Return a value as an error shows it: in one short line."""
    value = list(value) if isinstance(value, tuple) else value
    try:
        # Only as much of a long list as is shown.
        text = repr(value[:40] if isinstance(value, list | str | bytes) else value)
    except ValueError:  # an integer of more digits than Python writes
        text = f'an integer of {value.bit_length()} bits'
    return _cut(' '.join(text.split()))


def shown_name(name: Any) -> str:
    """Return a name, of whatever type, as an error shows it."""
    text = str(name)
    return _cut(text if text.isprintable() else repr(text))


def _cut(text: str) -> str:
    return text if len(text) < _LONGEST else f'{text:.{_LONGEST - 3}}...'


class StewartError(Exception):
    """The base class of all errors of this package."""


class ParameterError(StewartError, ValueError):
    """A parameter, or the file that it comes from, breaks a rule."""


class MotionError(StewartError, ValueError):
    """Arrays of a pose or motion whose shapes do not fit, or values that are not valid."""


class PoseError(StewartError, ValueError):
    """Leg lengths for which no pose near the guess was found."""


class SingularityError(StewartError):
    """A pose in which leg forces cannot balance the load."""


class ReachError(SingularityError):
    """A pose that a rod does not reach: names the leg and the missing distance."""


class DeviceError(StewartError, RuntimeError):
    """A GPU that cannot be used: no CuPy, no driver, no device, too little memory."""


class BagError(StewartError):
    """A bag that cannot be read or written."""
