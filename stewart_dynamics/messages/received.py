# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
One check of numbers and texts that come from a network, for programs that read typed messages.

Whoever can reach a port or a topic decides about their contents: counts, numbers and texts are
checked before anything is computed, drawn or printed, and a message that fails is dropped.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
import math
from typing import Any

from stewart_dynamics.errors import StewartError
from stewart_dynamics.messages.joint_state import NUMBERS_END, UNEVEN

_LONGEST = 1000  # characters of a text


class ReceivedError(StewartError, ValueError):
    """A message from a network that cannot be used; the text says which part, and why."""


def checked_numbers(name: str, values: Iterable[float], count: int,
                    most: float = NUMBERS_END) -> list[float]:
    """
    Return numbers, or raise ReceivedError.

    Parameters
    ----------
    name : str
        Their name in the error.
    values : iterable of float
        Numbers of a message.
    count : int
        Their number.
    most : float
        Largest magnitude; larger ones, NaN and infinity are rejected.

    """
    numbers = [float(value) for value in values]
    if len(numbers) != count:
        raise ReceivedError(f'{name}: {len(numbers)} numbers, must be {count}')
    for number in numbers:
        if not math.fabs(number) <= most:
            raise ReceivedError(f'{name}: {number:g}: must be finite and at most {most:g}')
    return numbers


def checked_joints(state: Any, joints: Sequence[str] | None = None,
                   fields: Sequence[str] = ('position',)) -> dict[str, list[float]]:
    """
    Return numbers of a sensor_msgs/JointState by field, or raise ReceivedError.

    Parameters
    ----------
    state : JointState
        Joints in any order.
    joints : sequence of str, optional
        The joints whose numbers are returned, in this order; default: all as they come.
    fields : sequence of str
        Fields that must have one number for each name.

    """
    names = list(state.name)
    wanted = names if joints is None else list(joints)
    missing = sorted(set(wanted) - set(names))
    if missing or not wanted:
        raise ReceivedError(f'lacks {", ".join(missing) or "joints"}')
    found = {}
    for field in fields:
        values = getattr(state, field)
        if len(values) != len(names):
            raise ReceivedError(f'{field}: {UNEVEN}: {len(values)}, {len(names)}')
        by_name = dict(zip(names, values, strict=True))
        found[field] = checked_numbers(field, [by_name[name] for name in wanted], len(wanted))
    return found


def shown_text(text: Any) -> str:
    """Return a text in one printable line of limited length: no control codes of a terminal."""
    cut = str(text)[:_LONGEST]
    return ''.join(each if each.isprintable() else ' ' for each in cut)
