# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Cases of a test: few for ``make test``, all of them for ``make test-release``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def few(cases: Iterable[Any], count: int) -> list[Any]:
    """Return values of one argument of a test; those after the first ``count`` are slow."""
    return [case if n < count else pytest.param(case, marks=pytest.mark.slow)
            for n, case in enumerate(cases)]
